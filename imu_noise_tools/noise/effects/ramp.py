# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rate ramp: a bias that drifts at a constant rate."""

import numpy as np

from ..kinds import Inputs, Mean, Parameter
from ...loop.effect import Effect


class Ramp(Mean):
    """R: the mean grows linearly."""

    name = 'ramp'
    smooth = slow = True
    symbol = 'R'
    title = 'rate ramp'
    equation = 'mean = R t, sigma^2(tau) = R^2 tau^2/2'
    signature = (
        'slope +1 at the long end of the Allan deviation; the mean of the record drifts in one '
        'direction'
    )
    hint = (
        'Warming up, a slow temperature change, ageing. See whether it follows the temperature, '
        'and wait before recording: if the drift then ends it was a warm-up (transient) or '
        'temperature.'
    )
    reference = 'IEEE 952 C.1.6'
    explains = ('ramp',)
    decide = 'record twice as long: a ramp goes on, what settles or wanders does not'
    parameters = (
        Parameter(
            'R', '{slope}', -1e3, 1e3, log=False, amplitude=True, linear=True, title='rate ramp'
        ),
    )

    def columns(self, inputs: Inputs) -> np.ndarray:
        """t."""
        return inputs.t[:, None]

    def avar(self, m: np.ndarray, dt: float) -> np.ndarray:
        """R^2 tau^2/2."""
        return (self['R'] * np.asarray(m) * dt) ** 2 / 2

    @classmethod
    def example(cls) -> Effect:
        """Return 9.7 deg/h in an hour."""
        return cls({'R': 1.3e-8})
