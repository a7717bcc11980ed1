# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A mean that swings slowly: air conditioning, heating, day and night."""

import numpy as np

from ..evidence import Evidence
from ..kinds import Inputs, Mean, Parameter
from ...loop.effect import Effect


class SlowPeriodic(Mean):
    """A sine of a few periods in the record, or of part of one."""

    name = 'slow_periodic'
    symbol = 'cosine, sine, period'
    title = 'slow periodic change of the bias'
    equation = 'mean = cosine cos(2 pi t/period) + sine sin(2 pi t/period)'
    signature = (
        'the mean of the record swings with a period of T/10 to 2 T; slope +1 in the Allan '
        'deviation up to half of that period, then a dip'
    )
    hint = (
        'Air conditioning or heating that switches, the day, a regulator that hunts. Record the '
        'temperature along with the IMU: if it swings alike, temperature is the effect to add. '
        'Close the room, or record over several periods.'
    )
    reference = 'IEEE 952 C.1.7 (sinusoidal noise), below the frequencies at which lines are found'
    several = True
    decide = 'record over several of its periods, the temperature too where it is not there yet'
    parameters = (
        *(
            Parameter(
                name, '{rate}', -1e3, 1e3, log=False, amplitude=True, linear=True, title=title
            )
            for name, title in (('cosine', 'part in phase with the beginning of the record'),
                                ('sine', 'part a quarter of a period later'))
        ),
        Parameter('period', 's', 1e-2, 1e7, title='period'),
    )

    def starts(self, evidence: Evidence) -> list[Effect]:
        """Start at periods from a tenth of the record to twice its length, 24 in all."""
        if 'period' in self.values:
            return [self]
        t = evidence.duration
        return [self.with_values(period=float(p)) for p in 1 / np.linspace(0.5 / t, 10 / t, 24)]

    def bounds(self, evidence: Evidence) -> dict[str, tuple[float, float]]:
        """Below a tenth of the record it is a line, beyond twice its length a drift."""
        return {'period': (0.09 * evidence.duration, 2.2 * evidence.duration)}

    def columns(self, inputs: Inputs, period: float) -> np.ndarray:
        """Return cosine and sine."""
        angle = 2 * np.pi * inputs.t / period
        return np.column_stack([np.cos(angle), np.sin(angle)])

    @classmethod
    def example(cls) -> Effect:
        """Return a swing of 20.6 deg/h (1e-4 rad/s) to either side in ten minutes."""
        return cls({'cosine': 6e-5, 'sine': 8e-5, 'period': 600.0})
