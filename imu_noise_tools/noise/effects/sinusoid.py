# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A sinusoid: vibration, mains, an alias."""

from __future__ import annotations

import numpy as np

from ..evidence import Evidence
from ..kinds import Inputs, Line, Parameter
from ...loop.effect import Effect, Estimate


class Sinusoid(Line):
    """A coherent line: one frequency, its phase kept through the record, or while it is there."""

    name = 'sinusoid'
    symbol = 'Omega0, f0'
    title = 'sinusoidal noise'
    equation = (
        'sigma^2(tau) = Omega0^2 [sin^2(pi f0 tau)/(pi f0 tau)]^2, from begin to end, where it '
        'begins or ends within the record'
    )
    signature = (
        'one narrow line in the PSD; a bump in the Allan deviation with nulls at tau = n/f0'
    )
    hint = (
        'A rotating machine, mains, a pump or a fan near the sensor, or one of these folded down '
        'by sampling. Stop the machine and record again; change the sample rate: an alias moves.'
    )
    reference = 'IEEE 952 C.1.7'
    several = True
    decide = 'stop the machines near by, or change the sample rate: a line moves or goes'
    parameters = (
        Parameter('amplitude', '{rate}', 1e-12, 1e3, amplitude=True, title='amplitude'),
        Parameter('frequency', 'Hz', 1e-6, 1e5, title='frequency'),
        Parameter('begin', 's', 0, 1e7, log=False, title='when it begins, 0: before the record',
                  words=('before the record',)),
        Parameter('end', 's', 0, 1e7, log=False, title='when it ends, 0: after the record',
                  words=('after the record',)),
    )
    optional = ('begin', 'end')
    neutral = {'begin': 0.0, 'end': 0.0}

    def share(self, duration: float) -> float:
        """Return for what part of a record it is there."""
        begin, end = self._stretch
        return float(np.clip((min(end, duration) - begin) / duration, 0.0, 1.0))

    @property
    def _stretch(self) -> tuple[float, float]:
        return self.values.get('begin', 0.0), self.values.get('end', 0.0) or np.inf

    def read(self, evidence: Evidence, rows: list[int]) -> dict[str, Estimate]:
        """Return amplitude and frequency of its row, and when it begins and ends."""
        found = super().read(evidence, rows)
        if rows:
            line = evidence.line(rows[0])
            found |= {'begin': line.begin, 'end': line.end}
        return found

    def apply(self, x: np.ndarray, inputs: Inputs, rng: np.random.Generator) -> np.ndarray:
        """Add it while it is there, with a random phase."""
        begin, end = self._stretch
        return np.where((inputs.t >= begin) & (inputs.t < end), super().apply(x, inputs, rng), x)

    @classmethod
    def example(cls) -> Effect:
        """Return a line at 3.7 Hz, of 20.6 deg/h (1e-4 rad/s)."""
        return cls({**cls.neutral, 'amplitude': 1e-4, 'frequency': 3.7})
