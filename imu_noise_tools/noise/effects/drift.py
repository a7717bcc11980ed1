# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A drift that bends: a parabola."""

import numpy as np

from ..kinds import Inputs, Mean, Parameter
from ...loop.effect import Effect


class Drift(Mean):
    """The mean follows a parabola: a ramp that grows, dies out or turns back."""

    name = 'drift'
    smooth = slow = True
    symbol = 'rate, curvature'
    title = 'drift that bends'
    equation = 'mean = rate t + curvature t^2/2'
    signature = (
        'the mean of the record bends in one direction throughout; slope +1 and more at the long '
        'end of the Allan deviation'
    )
    hint = (
        'A slow change of temperature or supply that has not settled, ageing after power-on. '
        'See whether it follows the temperature, and record longer: a transient settles, a period '
        'comes back.'
    )
    reference = 'IEEE 952 C.1.6, with the next term of the Taylor series'
    explains = ('ramp', 'curvature')
    decide = 'record twice as long: a parabola goes on, what settles or swings does not'
    parameters = (
        Parameter(
            'rate', '{slope}', -1e3, 1e3, log=False, amplitude=True, linear=True,
            title='rate of change at the beginning',
        ),
        Parameter(
            'curvature', '{slope}/s', -1e3, 1e3, log=False, amplitude=True, linear=True,
            title='change of that rate',
        ),
    )

    def columns(self, inputs: Inputs) -> np.ndarray:
        """Return t and t^2/2."""
        return np.column_stack([inputs.t, 0.5 * inputs.t**2])

    @classmethod
    def example(cls) -> Effect:
        """Return a drift that turns back after 25 min, at 9.3 deg/h (4.5e-5 rad/s)."""
        return cls({'rate': 6e-8, 'curvature': -4e-11})
