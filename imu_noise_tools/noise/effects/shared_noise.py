# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A disturbance that axes share."""

import numpy as np

from ..kinds import Coupling, Parameter
from ...core.record import AXES


class SharedNoise(Coupling):
    """This axis holds a share of what another axis of the same sensor measures."""

    name = 'shared_noise'
    symbol = 'gain, source'
    title = 'noise shared with another axis'
    equation = 'y = ... + gain * y_source'
    signature = 'coherence between axes of one sensor at rest'
    hint = (
        'Common supply or reference noise, real motion of the mount, or cross-talk. At rest on a '
        'heavy base true motion should be gone: record there; if it stays it is electrical.'
    )
    reference = 'Bendat and Piersol, Random Data, coherence functions'
    needs = 'analyse a record with all axes of the sensor'
    decide = 'record on a heavy base, on another supply'
    parameters = (
        Parameter(
            'gain',
            '1',
            -1e3,
            1e3,
            log=False,
            amplitude=True,
            linear=True,
            title='share of the other axis',
        ),
        Parameter.choice('source', AXES, title='the other axis'),
    )

    def starts(self, evidence):
        """Each other axis of the same sensor."""
        return [
            self.with_values(source=a)
            for a in evidence.channels
            if a in AXES and a.split('_')[0] == evidence.sensor
        ]

    def channels(self, evidence):
        """Return the source."""
        name = self.chosen('source') if 'source' in self.values else AXES[0]
        return (name,) if name in evidence.channels else ()

    def apply(self, x, inputs, rng):
        """Add the share of the other axis."""
        other = inputs.axes[self.chosen('source')]
        return x + self['gain'] * (other - np.mean(other))

    @classmethod
    def example(cls):
        """Return half of what gyro_y shows."""
        return cls({'gain': 0.5, 'source': 'gyro_y'})
