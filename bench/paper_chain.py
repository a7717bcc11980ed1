# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What Qian et al. 2010 do with a record at rest, step by step, each a line of a report.

Outliers, stationarity, order, coefficient, whiteness.

Qian, Xia, Que, Zhang 2010; Box, Jenkins (order and adequacy); Bendat, Piersol 4.5.2 (reverse
arrangements).

"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from imu_noise_tools.core.errors import InputError
from imu_noise_tools.filter.evaluate import autocorrelation

SEGMENTS = 100          # of the test of reverse arrangements


def moving_average_outliers(
    z: np.ndarray, window: int = 25, threshold: float = 4.0
) -> tuple[np.ndarray, np.ndarray]:
    """
    Return z (n,) with its outliers replaced by the moving average; and their mask.

    An outlier is further than ``threshold`` robust standard deviations from the centred moving
    average of ``window`` samples, itself left out.

    """
    z = np.asarray(z, float)
    if len(z) < 4 * window:
        raise InputError(f'{len(z)} samples are too few', f'give at least {4 * window}')
    bad = np.zeros(len(z), bool)
    clean = z
    for _ in range(10):
        near = _neighbours(clean, window)
        off = np.abs(z - near)
        sigma = np.median(np.abs(clean - near)) / 0.6745
        found = off > threshold * max(sigma, 1e-300)
        clean = np.where(found, near, z)
        if np.array_equal(found, bad):
            break
        bad = found
    return clean, bad


def _neighbours(z, window):
    """Return the mean of the window around each sample without the sample."""
    half = window // 2
    padded = np.pad(z, half, mode='reflect')
    total = np.convolve(padded, np.ones(2 * half + 1), mode='valid')
    return (total - z) / (2 * half)


def reverse_arrangements(values: np.ndarray) -> float:
    """
    Return u, standard normal for a series (n,) without trend: |u| > 1.96 is a trend at 5 %.

    The number of pairs i < j with values_i > values_j has mean n(n-1)/4 and variance
    n(2n+5)(n-1)/72.

    """
    v = np.asarray(values, float)
    n = len(v)
    count = int(np.sum(np.triu(v[:, None] > v[None, :], 1)))
    return float((count - n * (n - 1) / 4) / np.sqrt(n * (2 * n + 5) * (n - 1) / 72))


def stationarity(z: np.ndarray, segments: int = SEGMENTS) -> tuple[float, float]:
    """Return u of the reverse arrangements of segment means and mean squares of z (n,)."""
    size = len(z) // segments
    if size < 2:
        raise InputError(f'{len(z)} samples are too few', f'give at least {2 * segments}')
    parts = np.asarray(z, float)[:size * segments].reshape(segments, size)
    return (reverse_arrangements(parts.mean(axis=1)),
            reverse_arrangements(((parts - np.mean(parts)) ** 2).mean(axis=1)))


def yule_walker(z: np.ndarray, order: int) -> tuple[np.ndarray, float]:
    """
    Return (coefficients (order,), innovation variance) from the biased autocovariance.

    Always a stable model.

    """
    d = np.asarray(z, float) - np.mean(z)
    r = autocorrelation(d, order) * float(np.mean(d * d))
    lag = np.abs(np.subtract.outer(np.arange(order), np.arange(order)))
    a = np.linalg.solve(r[lag], r[1:]) if order else np.zeros(0)
    return a, float(r[0] - a @ r[1:])


def akaike(z: np.ndarray, highest: int = 6) -> np.ndarray:
    """Return n ln(innovation variance) + 2 (order + 1) for orders 0 ... highest."""
    n = len(z)
    return np.array([n * np.log(yule_walker(z, p)[1]) + 2 * (p + 1) for p in range(highest + 1)])


def residual(z: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    """Return what an autoregression leaves of z (n,), (n - order,)."""
    d = np.asarray(z, float) - np.mean(z)
    p = len(coefficients)
    out = d[p:].copy()
    for k, a in enumerate(coefficients, 1):
        out -= a * d[p - k:len(d) - k]
    return out


def whiteness(rest: np.ndarray, z: np.ndarray) -> tuple[float, float, float]:
    """
    Return the residual's autocorrelation at lag 1, a cross-correlation, and p.

    The cross-correlation is with the series a sample before.

    p is the Ljung-Box test's over 20 lags: below 0.05 the order is too low.

    """
    r = autocorrelation(rest, 20)
    n = len(rest)
    box = n * (n + 2) * float(np.sum(r[1:] ** 2 / (n - np.arange(1, 21))))
    d = np.asarray(z, float) - np.mean(z)
    earlier = d[len(d) - n - 1:-1] if len(d) > n else d[:-1]
    m = min(len(earlier), n)
    cross = float(rest[-m:] @ earlier[-m:]) / max(
        float(np.sqrt((rest @ rest) * (earlier @ earlier))), 1e-300
    )
    return float(r[1]), cross, float(stats.chi2.sf(box, 19))


@dataclass(frozen=True)
class ArReport:
    """What the chain found in one axis at rest; variances in the square of the rate's unit."""

    samples: int
    outliers: int
    u_mean: float
    u_square: float
    aic: tuple[float, ...]
    order: int
    phi: float
    variance: float
    autocorrelation: float
    cross_correlation: float
    p_white: float

    def lines(self) -> list[str]:
        """Return the report, a line a step."""
        least = min(self.aic)
        return [
            (
                f'outliers          {self.outliers} of {self.samples} samples replaced by the'
                ' moving average'
            ),
            (
                f'stationarity      reverse arrangements u = {self.u_square:+.4f} (mean squares),'
                f' {self.u_mean:+.4f} (means); |u| < 1.96 is no trend at 5 %'
            ),
            'order             AIC less its least: '
            + ', '.join(f'{p}: {v - least:.1f}' for p, v in enumerate(self.aic)),
            f'                  least at {self.order}; AR(1) is used',
            (
                f'coefficient       phi = {self.phi:.4f} (Yule-Walker), innovation variance'
                f' {self.variance:.4g}'
            ),
            (
                f'adequacy          residual autocorrelation {self.autocorrelation:+.4f}, with the'
                f' series {self.cross_correlation:+.4f}, Ljung-Box p = {self.p_white:.3g}'
            ),
        ]


def chain(z: np.ndarray) -> ArReport:
    """Run the whole chain on one axis at rest, z (n,)."""
    clean, bad = moving_average_outliers(z)
    u_mean, u_square = stationarity(clean)
    aic = akaike(clean)
    a, variance = yule_walker(clean, 1)
    rest = residual(clean, a)
    auto, cross, p = whiteness(rest, clean)
    return ArReport(
        len(clean),
        int(bad.sum()),
        u_mean,
        u_square,
        tuple(aic.tolist()),
        int(np.argmin(aic)),
        float(a[0]),
        variance,
        auto,
        cross,
        p,
    )
