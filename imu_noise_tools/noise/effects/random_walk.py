# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random walk of the rate."""

import numpy as np

from ..kinds import Inputs, Parameter, Spectrum, StateSpace
from ...loop.effect import Effect


class RandomWalk(Spectrum):
    """K: integrated white noise."""

    common = True
    name = 'random_walk'
    symbol = 'K'
    title = 'rate random walk'
    equation = 'S(f) = (K/2 pi)^2/f^2 (two-sided), sigma^2(tau) = K^2 tau/3 (1 + 1/(2 m^2))'
    signature = 'slope +1/2 at the long end of the Allan deviation; PSD falling as 1/f^2'
    hint = (
        'Slow wandering of the bias. Short records cannot tell it from flicker noise, a ramp or '
        'temperature: record longer, and see whether it follows the temperature.'
    )
    reference = 'IEEE 952 C.1.4'
    broad = True
    decide = 'record several times longer'
    own = True
    parameters = (
        Parameter('K', '{slope}/sqrt(Hz)', 1e-14, 1e2, amplitude=True, title='rate random walk'),
    )

    def psd(self, f: np.ndarray, dt: float) -> np.ndarray:
        """2 K^2 dt^2 / (2 sin(pi f dt))^2."""
        return 2 * self['K'] ** 2 * dt**2 / (2 * np.sin(np.pi * np.asarray(f) * dt)) ** 2

    def avar(self, m: np.ndarray, dt: float) -> np.ndarray:
        """K^2 tau/3 with the sampled form's factor."""
        m = np.asarray(m, float)
        return self['K'] ** 2 * m * dt / 3 * (1 + 1 / (2 * m**2))

    def state_space(self, dt: float) -> StateSpace | None:
        """One integrator."""
        return np.ones((1, 1)), np.array([[self['K'] ** 2 * dt]]), np.ones((1, 1))

    def apply(self, x: np.ndarray, inputs: Inputs, rng: np.random.Generator) -> np.ndarray:
        """Add a running sum of N(0, K^2 dt)."""
        steps = rng.standard_normal(len(x)) * self['K'] * np.sqrt(inputs.dt)
        steps[0] = 0.0
        return x + np.cumsum(steps)

    @classmethod
    def example(cls) -> Effect:
        """Return the effect of a consumer MEMS gyroscope."""
        return cls({'K': 1.5e-6})
