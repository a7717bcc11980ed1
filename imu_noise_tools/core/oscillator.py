# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The damped oscillator driven by white noise, sampled: AR(2). A resonance, or a wandering line.

x_k = 2 r cos(theta) x_{k-1} - r^2 x_{k-2} + w_k, theta = 2 pi f0 dt, r = exp(-pi width dt), width
the full width at half the height of a narrow peak, Hz. Its autocovariance is sigma^2 r^|k|
(cos k theta + c sin |k| theta), c = (1 - r^2)/(1 + r^2) cot theta (Box and Jenkins, Time Series
Analysis, section 3.2), so that all that follows are geometric sums of p = r e^{i theta}.

"""

from __future__ import annotations

import numpy as np

from .spectrum import Bins


def _pole(f0: float, width: float, dt: float) -> tuple[complex, complex]:
    """Return (p, a): the autocovariance at lag k is sigma^2 Re(a p^k)."""
    theta, r = 2 * np.pi * f0 * dt, np.exp(-np.pi * width * dt)
    c = np.tanh(np.pi * width * dt) / np.tan(theta)
    return complex(r * np.exp(1j * theta)), complex(1, -c)


def innovation_variance(sigma: float, f0: float, width: float, dt: float) -> float:
    """Return the variance of w_k."""
    theta, r2 = 2 * np.pi * f0 * dt, np.exp(-2 * np.pi * width * dt)
    return float(sigma**2 * (1 - r2) / (1 + r2) * ((1 - r2) ** 2 + 4 * r2 * np.sin(theta) ** 2))


def psd(f: np.ndarray, sigma: float, f0: float, width: float, dt: float) -> np.ndarray:
    """Return the one-sided PSD of the sampled process at f (Hz), unit^2/Hz."""
    p, _ = _pole(f0, width, dt)
    r, half = abs(p), np.pi * np.asarray(f, float) * dt
    both = np.ones(np.shape(f))
    for theta in (np.angle(p), -np.angle(p)):
        both = both * ((1 - r) ** 2 + 4 * r * np.sin(half - 0.5 * theta) ** 2)
    return 2 * dt * innovation_variance(sigma, f0, width, dt) / both


def binned(bins: Bins, sigma: float, f0: float, width: float) -> np.ndarray:
    """
    Return what the power of a record is expected to be in each bin, (b,): exactly.

    A peak may be far narrower than a bin, or than what the record resolves. E c_k^2 = sum over
    lags of R(lag) [(1 - |lag|/n) cos(lag phi) - sin(|lag| phi)/(n sin phi)], phi = pi k/n; of a
    bin with several coefficients the integral of that, less what alternates between neighbours.

    """
    n, dt = bins.n, bins.dt
    p, a = _pole(f0, width, dt)
    phi = 2 * np.pi * bins.f * dt
    alone = bins.count == 1
    up, down = p * np.exp(1j * phi[alone]), p * np.exp(-1j * phi[alone])
    out = np.empty(len(phi))
    out[alone] = 1 + (a * (_tapered(up, n) + _tapered(down, n))).real \
        - (a * (_plain(up, n) - _plain(down, n)) / 1j).real / (n * np.sin(phi[alone]))
    if not alone.all():
        wide = ~alone
        low, high = (np.pi * (k[wide] - 0.5) / n for k in (bins.first, bins.last))
        part = []
        for edge in (low, high):
            # z = p e^{+-i phi}: z/(1 - z) integrates to +-i ln(1 - z), z/(1 - z)^2 to -+i/(1 - z)
            up, down = 1 - p * np.exp(1j * edge), 1 - p * np.exp(-1j * edge)
            plain = 1j * np.log(up), -1j * np.log(down)
            tapered = plain[0] + 1j / up / n, plain[1] - 1j / down / n
            part.append(edge + (a * (tapered[0] + tapered[1])).real
                        - (a * (plain[0] - plain[1]) / 1j).real / (n * np.sin(phi[wide])))
        out[wide] = (part[1] - part[0]) / (high - low)
    return 2 * dt * sigma**2 * np.maximum(out, 0.0)


def _plain(z: np.ndarray, n: int) -> np.ndarray:
    """Return the sum of z^j over 0 < j < n."""
    return (z - z**n) / (1 - z)


def _tapered(z: np.ndarray, n: int) -> np.ndarray:
    """Return the sum of (1 - j/n) z^j over 0 < j < n."""
    return z / (1 - z) - z * (1 - z**n) / (n * (1 - z) ** 2)


def avar(m: np.ndarray, sigma: float, f0: float, width: float, dt: float) -> np.ndarray:
    """Return the Allan variance at cluster sizes m: the variance of a mean less its covariance."""
    m = np.asarray(m, float)
    p, a = _pole(f0, width, dt)
    pm = np.exp(m * np.log(p))
    within = m + 2 * (m * p / (1 - p) - p * (1 - pm) / (1 - p) ** 2)
    between = p * (1 - pm) ** 2 / (1 - p) ** 2
    return sigma**2 / m**2 * (a * (within - between)).real
