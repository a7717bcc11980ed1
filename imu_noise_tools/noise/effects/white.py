# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""White noise: angle or velocity random walk."""

import numpy as np

from ..kinds import Inputs, Parameter, Spectrum, StateSpace
from ...loop.effect import Effect


class White(Spectrum):
    """N: the same power at all frequencies."""

    common = True
    name = 'white'
    symbol = 'N'
    title = 'angle / velocity random walk'
    equation = 'S(f) = N^2 (two-sided), sigma^2(tau) = N^2/tau'
    signature = 'slope -1/2 in the Allan deviation, flat PSD'
    hint = (
        'Thermal and electronic noise of the sensor. Present in every sensor; a lower bandwidth '
        'setting does not change N, only the variance of a sample.'
    )
    reference = 'IEEE 952 C.1.1'
    never_absent = True
    decide = 'record again'
    own = flat = True
    parameters = (
        Parameter('N', '{rate}/sqrt(Hz)', 1e-12, 1e3, amplitude=True, title='noise density'),
    )

    def psd(self, f: np.ndarray, dt: float) -> np.ndarray:
        """2 N^2."""
        return np.full(np.shape(f), 2 * self['N'] ** 2)

    def avar(self, m: np.ndarray, dt: float) -> np.ndarray:
        """N^2/tau."""
        return self['N'] ** 2 / (np.asarray(m) * dt)

    def state_space(self, dt: float) -> StateSpace | None:
        """No memory: one state redrawn at each step."""
        return np.zeros((1, 1)), np.array([[self['N'] ** 2 / dt]]), np.ones((1, 1))

    def apply(self, x: np.ndarray, inputs: Inputs, rng: np.random.Generator) -> np.ndarray:
        """Add N(0, N^2/dt) to each sample."""
        return x + self['N'] / np.sqrt(inputs.dt) * rng.standard_normal(len(x))

    @classmethod
    def example(cls) -> Effect:
        """Return the effect of a consumer MEMS gyroscope, 0.005 deg/s/sqrt(Hz)."""
        return cls({'N': 8.7e-5})
