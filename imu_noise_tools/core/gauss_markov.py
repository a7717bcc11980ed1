# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The first-order Gauss-Markov process, sampled: AR(1). One place for noise, filter and simulation.

With correlation time Tc and standard deviation sigma, x_k = phi x_{k-1} + w_k, phi = exp(-dt/Tc),
var w = sigma^2 (1 - phi^2). Continuous forms: IEEE 952 Annex B.

"""

from __future__ import annotations

import numpy as np


def phi(dt: float, tc: float) -> float:
    """Return exp(-dt/tc)."""
    return float(np.exp(-dt / tc))


def innovation_variance(sigma: float, tc: float, dt: float) -> float:
    """
    Return the variance of the driving noise of one step, sigma^2 (1 - phi^2).

    Exact for dt << tc too.

    """
    return float(-(sigma**2) * np.expm1(-2 * dt / tc))


def state_space(sigma: float, tc: float, dt: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (Phi, Q, H), (1, 1) each: x_{k+1} = Phi x_k + w, w ~ Q, y_k = H x_k."""
    return (np.array([[phi(dt, tc)]]), np.array([[innovation_variance(sigma, tc, dt)]]),
            np.ones((1, 1)))


def psd(f: np.ndarray, sigma: float, tc: float, dt: float) -> np.ndarray:
    """
    Return the one-sided PSD of the sampled process at f (Hz), of its shape, unit^2/Hz.

    2 dt sigma^2 (1 - phi^2) / (1 - 2 phi cos(2 pi f dt) + phi^2), written without cancellation.

    """
    one_less = -np.expm1(-dt / tc)  # 1 - phi
    s = 2 * np.sin(np.pi * np.asarray(f) * dt)
    return 2 * dt * sigma**2 * -np.expm1(-2 * dt / tc) / (one_less**2 + (1 - one_less) * s**2)


def avar(m: np.ndarray, sigma: float, tc: float, dt: float) -> np.ndarray:
    """
    Return the Allan variance of the sampled process at cluster sizes m, of their shape, unit^2.

    sigma^2 (m - 3 phi - m phi^2 + 4 phi^(m+1) - phi^(2m+1)) / (m (1 - phi))^2; where that cancels
    (dt << tc) the continuous (2 sigma^2 Tc/tau) [1 - Tc/(2 tau) (3 - 4 exp(-tau/Tc) + exp(-2
    tau/Tc))], IEEE 952 C.1.5, its series for tau << Tc, and the factor 1 + 1/(2 m^2) by which a
    sampled random walk exceeds the averaged one.

    """
    m = np.asarray(m, float)
    p = phi(dt, tc)
    if dt > 1e-3 * tc:
        return (
            sigma**2
            * (m - 3 * p - m * p**2 + 4 * p ** (m + 1) - p ** (2 * m + 1))
            / (m * (1 - p)) ** 2
        )
    x = m * dt / tc
    a, b = np.expm1(-x), np.expm1(-2 * x)
    exact = 2 * sigma**2 / x * (1 - (b - 4 * a) / (2 * x))
    series = sigma**2 * x * (2 / 3 - x / 2 + 7 * x**2 / 30 - x**3 / 12)
    return np.where(x < 1e-2, series, exact) * (1 + 1 / (2 * m**2))
