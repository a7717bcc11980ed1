# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Flicker noise: bias instability."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from ..kinds import Inputs, Parameter, Spectrum
from ...loop.effect import Effect


class Flicker(Spectrum):
    """
    B: power as 1/f.

    The sampled process is the fractional difference of order 1/2 of white noise.

    """

    common = True
    name = 'flicker'
    symbol = 'B'
    title = 'bias instability'
    equation = 'S(f) = B^2/(2 pi f) (two-sided), sigma^2(tau) = (2 ln2/pi) B^2 = (0.664 B)^2'
    signature = 'the flat part of the Allan deviation at 0.664 B; PSD falling as 1/f'
    hint = (
        'Electronics and the sensing element. It limits how well any averaging can determine the '
        'bias. It has no finite state space: a few Gauss-Markov terms imitate it over a stated '
        'band.'
    )
    reference = 'IEEE 952 C.1.3'
    broad = True
    decide = 'record several times longer'
    own = True
    parameters = (Parameter('B', '{rate}', 1e-12, 1e2, amplitude=True, title='bias instability'),)

    def psd(self, f: np.ndarray, dt: float) -> np.ndarray:
        """2 B^2 dt / (2 sin(pi f dt)): 1/f, sampled."""
        return 2 * self['B'] ** 2 * dt / (2 * np.sin(np.pi * np.asarray(f) * dt))

    def avar(self, m: np.ndarray, dt: float) -> np.ndarray:
        """
        (2 ln2/pi) B^2 times the sampled form's factor.

        Its structure function is that of fractional noise of order 1/2; the factor is 1.443,
        1.154, 1.034 at m = 1, 2, 5.

        """
        m = np.asarray(m, float)
        flat = 2 * np.log(2) / np.pi * self['B'] ** 2
        factor = np.ones(len(m))
        small = m < 60
        if small.any():
            kind: Any = type(self)
            factor[small] = _of_unit(kind, tuple(m[small].tolist()), dt) / (2 * np.log(2) / np.pi)
        return flat * factor

    def apply(self, x: np.ndarray, inputs: Inputs, rng: np.random.Generator) -> np.ndarray:
        """
        Add the running sum of ARFIMA(0, -1/2, 0) increments, drawn exactly by circulant embedding.

        Increments of S = sigma^2 |2 sin(pi f dt)|^{1}: gamma_0 = 4/pi,
        gamma_k = gamma_{k-1} (k - 3/2)/(k + 1/2) for sigma = 1 (Hosking 1981); B^2 = sigma^2 in
        S_1 = 2 B^2 dt/s of the sum.

        """
        n = len(x)
        k = np.arange(1, n + 1)
        gamma = 4 / np.pi * np.concatenate([[1.0], np.cumprod((k - 1.5) / (k + 0.5))])
        size = next_fast_len(2 * n)
        gap = size - 2 * n
        # the embedding may be longer than 2n: continue the autocovariance itself
        more = n + 1 + np.arange((gap + 1) // 2)
        if len(more):
            gamma = np.concatenate([gamma, gamma[-1] * np.cumprod((more - 1.5) / (more + 0.5))])
        half = size // 2
        row = np.concatenate([gamma[:half + 1], gamma[1:size - half][::-1]])
        eigen = np.maximum(rfft(row).real, 0)
        noise = rfft(rng.standard_normal(size))
        steps = irfft(np.sqrt(eigen) * noise, size)[:n]
        walk = np.cumsum(steps)
        return x + self['B'] * (walk - walk[0])

    @classmethod
    def example(cls) -> Effect:
        """Return the effect of a consumer MEMS gyroscope, 5 deg/h."""
        return cls({'B': 2.4e-5})


@lru_cache(maxsize=32)
def _of_unit(kind: Any, m: tuple[float, ...], dt: float) -> np.ndarray:
    """Return the Allan variance (m,) of B = 1 by its quadrature: every axis asks for the same."""
    return super(Flicker, kind({'B': 1.0})).avar(np.array(m), dt)
