# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Oscillations that keep their phase for a while, whether motion or noise."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from .statespace import Block, FilterEffect, Look
from ..core import gauss_markov
from ..loop.effect import Effect, Parameter


def oscillator(amplitude: float, frequency: float, tc: float, dt: float) -> Block:
    """
    Return a random-phase oscillation: a rotation by 2 pi f dt that forgets its phase within tc.

    Stationary variance amplitude^2/2 in each of its two states (a Gauss-Markov pair turned by the
    carrier).

    """
    keep, angle = gauss_markov.phi(dt, tc), 2 * np.pi * frequency * dt
    c, s = keep * np.cos(angle), keep * np.sin(angle)
    variance = 0.5 * amplitude ** 2
    return Block(np.array([[c, s], [-s, c]]), -np.expm1(-2 * dt / tc) * variance * np.eye(2),
                 np.array([1.0, 0.0]), variance * np.eye(2), keeps=True)


class Oscillation(FilterEffect):
    """
    Amplitude, frequency, and how long the phase is kept; a subclass states the band it is for.

    Below 3 Hz an oscillation is taken for motion, above for vibration.

    """

    several = True
    line = 'frequency'
    keeps = 'tc'
    measured = ('amplitude',)
    search = 2.0
    #: frequencies it is looked for at, Hz
    band: ClassVar[tuple[float, float]]

    @classmethod
    def guesses(cls, look: Look) -> list[Effect]:
        """Return the two strongest lines of the band."""
        low, high = cls.band
        found = [(f, a) for f, a in look.lines if low <= f <= min(high, 0.49 / look.dt)][:2]
        return [cls({'amplitude': a, 'frequency': f, 'tc': tc})
                for f, a in found for tc in (10.0, 1e3, 1e5)]

    def read(self, z: np.ndarray, dt: float) -> Effect:
        """
        Return it with the amplitude read at its frequency; how fast it changes is kept.

        By least squares beside a mean: a projection leaks where the periods are few and not whole.

        """
        seen = np.flatnonzero(np.isfinite(z))
        angle = 2 * np.pi * self['frequency'] * seen * dt
        waves = np.stack([np.cos(angle), np.sin(angle), np.ones(len(seen))], axis=1)
        amplitude = float(np.hypot(*np.linalg.lstsq(waves, z[seen], rcond=None)[0][:2]))
        tc = self.parameter('tc')
        longer = np.clip(self['tc'] * (amplitude / self['amplitude']) ** 2, tc.lower, tc.upper)
        return self.with_values(amplitude=amplitude, tc=float(longer))

    def block(self, dt: float) -> Block:
        """Return the oscillator."""
        return oscillator(self['amplitude'], self['frequency'], self['tc'], dt)


def parameters(smallest: float, band: tuple[float, float]) -> tuple[Parameter, ...]:
    """Return the parameters of an oscillation of at least this amplitude in a band (Hz)."""
    return (Parameter('amplitude', '{rate}', smallest, 1e2, amplitude=True, title='amplitude'),
            Parameter('frequency', 'Hz', *band, title='frequency'),
            Parameter('tc', 's', 1.0, 1e6, title='how long it keeps its phase'))
