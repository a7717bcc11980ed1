# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Warm-up transient: the bias settles exponentially."""

import numpy as np

from ..evidence import Evidence
from ..kinds import Inputs, Mean, Parameter
from ..thermal import TEMPERATURE
from ...loop.effect import Effect


class Transient(Mean):
    """An exponential that dies out: amplitude e^(-t/tc)."""

    name = 'transient'
    smooth = True
    symbol = 'A, tc'
    title = 'warm-up transient'
    equation = 'mean = amplitude e^(-t/tc), t from the beginning of the record'
    signature = (
        'the mean moves fast at first, then settles; the Allan deviation rises towards slope +1 '
        'at the long end'
    )
    hint = (
        'The sensor was warming up after power-on. Wait a few tc before recording.'
    )
    reference = 'IEEE 1554, warm-up time'
    decide = 'record again after an hour of warm-up: a transient is gone'
    parameters = (
        Parameter('amplitude', '{rate}', -1e3, 1e3, log=False, amplitude=True, linear=True,
                  title='excess at the beginning'),
        Parameter('tc', 's', 1e-2, 1e6, title='time constant'),
    )

    def starts(self, evidence: Evidence) -> list[Effect]:
        """Time constants that settle within the record, but not within a few blocks."""
        t = evidence.duration
        return [self.with_values(tc=float(c)) for c in np.geomspace(t / 200, t / 3, 8)]

    def bounds(self, evidence: Evidence) -> dict[str, tuple[float, float]]:
        """Bound the settling to half the record; what takes longer is a ramp to it."""
        return {'tc': (5 * evidence.dt, evidence.duration / 2)}

    def columns(self, inputs: Inputs, tc: float) -> np.ndarray:
        """e^(-t/tc)."""
        return np.exp(-inputs.t / tc)[:, None]

    def lacking(self, evidence: Evidence) -> str:
        """Ask for the temperature where none was recorded, which may be what it follows."""
        return '' if TEMPERATURE in evidence.slow_others else (
            'Record the temperature as well: then it may turn out to be a temperature effect.')

    @classmethod
    def example(cls) -> Effect:
        """Return 20.6 deg/h (1e-4 rad/s) that falls to 1/e in five minutes."""
        return cls({'amplitude': 1e-4, 'tc': 300.0})
