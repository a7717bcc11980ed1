# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Allan deviation: the tau grid, the curve of one axis, its confidence.

Standard and overlapping Allan variance are computed here by prefix sums; the modified, Hadamard
and total deviations are allantools' (which also is the oracle of the tests). All take rates;
increments or integrated input are turned into rates when the record is read.

"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from .errors import InputError, unknown
from .statistics import sum_of_squares

DEVIATIONS = ('oadev', 'adev', 'mdev', 'hdev', 'totdev')
# Samples per pass: what it reads and works on stays in the cache.
_BLOCK = 1 << 15


@dataclass(frozen=True)
class AllanCurve:
    """
    One axis' deviation against averaging time; all arrays (k,).

    ``m`` samples per cluster, ``tau`` s, ``count`` terms averaged, ``dev`` in the unit of the
    rate, ``lo`` and ``hi`` its 95 % interval, ``percent_error`` the classic 100/sqrt(2(n/m - 1)),
    ``edf`` equivalent degrees of freedom.

    """

    deviation: str
    dt: float
    n: int
    m: np.ndarray
    count: np.ndarray
    dev: np.ndarray
    lo: np.ndarray
    hi: np.ndarray
    edf: np.ndarray

    @property
    def tau(self) -> np.ndarray:
        """Averaging times, s."""
        return self.m * self.dt

    @property
    def percent_error(self) -> np.ndarray:
        """
        Return the relative error of a standard estimate, in percent.

        100/sqrt(2 (n/m - 1)) (IEEE 952 C.1).

        """
        return 100 / np.sqrt(2 * (self.n / self.m - 1))

    @property
    def slope(self) -> np.ndarray:
        """Local slope of log dev against log tau."""
        return np.gradient(np.log(self.dev), np.log(self.tau))


def cluster_sizes(n: int, points: int = 100, octaves: bool = False) -> np.ndarray:
    """
    Return cluster sizes m from 1 to n/3, (k,) int.

    Log-spaced whole numbers, each once (``points`` at most), or octaves 1, 2, 4 ...

    Raises
    ------
    InputError
        Fewer than nine samples.

    """
    if n < 9:
        raise InputError(f'{n} samples are too few for an Allan curve', 'record at least a minute')
    longest = n // 3
    if octaves:
        return 2 ** np.arange(int(np.log2(longest)) + 1)
    return np.unique(np.round(np.geomspace(1, longest, points)).astype(np.int64))


def overlapping_variance(y: np.ndarray, m: np.ndarray) -> np.ndarray:
    """
    Return the overlapping Allan variance of rates y (n,) at cluster sizes m.

    Every pair of clusters is counted.

    sigma^2(m) = sum_j (x_{j+2m} - 2 x_{j+m} + x_j)^2 / (2 m^2 (n - 2m + 1)), x the prefix sums of
    y (IEEE 952 C.2).

    """
    x = _prefix(y)
    twice = 2 * x
    work = np.empty(_BLOCK)
    sizes = np.asarray(m).tolist()
    total = np.zeros(len(sizes))
    # All cluster sizes of a block before the next block: what the small ones read is in the cache.
    for j in range(0, len(x), _BLOCK):
        for i, k in enumerate(sizes):
            size = min(_BLOCK, len(x) - 2 * k - j)
            if size <= 0:
                continue
            d = np.add(x[j:j + size], x[j + 2 * k:j + 2 * k + size], out=work[:size])
            d -= twice[j + k:j + k + size]
            total[i] += sum_of_squares(d)
    k = np.asarray(m, float)
    return total / (2.0 * k * k * (len(x) - 2 * k))


def standard_variance(y: np.ndarray, m: np.ndarray) -> np.ndarray:
    """
    Return half the mean squared difference of neighbouring cluster means, (k,), unit^2.

    Of samples y (n,) and cluster sizes m (k,); the clusters lie side by side (IEEE 952 C.1).

    """
    x = _prefix(y)
    return np.array(
        [np.mean(np.diff(x[::k], 2) ** 2) / (2.0 * k * k) for k in np.asarray(m).tolist()]
    )


def _prefix(y: np.ndarray) -> np.ndarray:
    """
    Return the prefix sums of y less its mean.

    The mean cancels in every difference, and so does its rounding.

    """
    x = np.empty(len(y) + 1)
    x[0] = 0.0
    np.subtract(y, np.mean(y), out=x[1:])
    return np.cumsum(x, out=x)


def curve(
    y: np.ndarray, dt: float, *, deviation: str = 'oadev', points: int = 100, octaves: bool = False
) -> AllanCurve:
    """
    Return one axis' curve with 95 % intervals.

    Parameters
    ----------
    y : ndarray (n,)
        Rates, finite, evenly spaced.
    dt : float
        Sample interval, s.
    deviation : str
        One of :data:`DEVIATIONS`.
    points, octaves
        See :func:`cluster_sizes`.

    Raises
    ------
    UsageError
        An unknown deviation.
    InputError
        Too few samples.

    """
    if deviation not in DEVIATIONS:
        raise unknown('deviation', deviation, DEVIATIONS)
    n = len(y)
    m = cluster_sizes(n, points, octaves)
    if deviation == 'oadev':
        dev, count = np.sqrt(overlapping_variance(y, m)), n - 2 * m + 1
    elif deviation == 'adev':
        dev, count = np.sqrt(standard_variance(y, m)), n // m - 1
    else:
        m, count, dev = _by_allantools(y, deviation, m)
    edf = equivalent_freedom(dev, m, n, overlapping=deviation != 'adev')
    lo, hi = interval(dev, edf)
    return AllanCurve(deviation, dt, n, m, count, dev, lo, hi, edf)


def _by_allantools(
    y: np.ndarray, deviation: str, m: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    import allantools

    tau, dev, _, count = getattr(allantools, deviation)(
        y - np.mean(y), rate=1.0, data_type='freq', taus=m.astype(float)
    )
    good = np.isfinite(dev) & (dev > 0)
    return (
        np.round(tau[good]).astype(np.int64),
        np.asarray(count)[good].astype(np.int64),
        dev[good],
    )


def interval(
    dev: np.ndarray, edf: np.ndarray, confidence: float = 0.95
) -> tuple[np.ndarray, np.ndarray]:
    """
    Return the bounds (lo, hi) of a deviation.

    edf dev^2 / sigma^2 is chi-squared with edf degrees of freedom (IEEE 1139).

    """
    tail = (1 - confidence) / 2
    edf = np.maximum(edf, 1e-3)
    return dev * np.sqrt(edf / chdtri(edf, tail)), dev * np.sqrt(edf / chdtri(edf, 1 - tail))


def smooth_slope(m: np.ndarray, dev: np.ndarray, decades: float = 0.5) -> np.ndarray:
    """
    Return the slope of log dev (k,) against log m (k,) around each point, (k,).

    It is that of a straight line through so many ``decades``.

    """
    x, y = np.log(np.asarray(m, float)), np.log(dev)
    out = np.full(len(x), -0.5)
    reach = 0.5 * decades * np.log(10)
    for i in range(len(x) if len(x) > 1 else 0):
        near = np.abs(x - x[i]) <= reach
        if near.sum() < 3:
            near[max(0, i - 1):i + 2] = True
        u = x[near] - x[near].mean()
        out[i] = np.sum(u * y[near]) / np.sum(u * u)
    return out


def equivalent_freedom(
    dev: np.ndarray, m: np.ndarray, n: int, overlapping: bool = True
) -> np.ndarray:
    """
    Return equivalent degrees of freedom for the power law that the local slope shows, (k,).

    Of deviations ``dev`` (k,) of n samples at cluster sizes m (k,).

    Overlapping: the approximations of Riley, NIST SP 1065, table 5 (and the exact two-term
    correlation of neighbouring differences for the standard variance).

    """
    m = np.asarray(m, float)
    slope = smooth_slope(m, dev)
    law = np.clip(np.round(-2 * slope), -1, 2).astype(int)  # 2 quantization ... -1 random walk
    # Quantization shows at the short end or nowhere. A chance fall at the long end looks as steep
    # and would claim hundreds of degrees of freedom where there are five.
    law = np.where(np.logical_and.accumulate(law == 2), 2, np.minimum(law, 1))
    if not overlapping:
        k = np.maximum(n // m - 1, 1)
        rho2 = np.select([law == 2, law == 1, law == 0], [4 / 9 + 1 / 36, 0.25, 0.01], 1 / 16)
        return k**2 / (k + 2 * np.maximum(k - 1, 0) * rho2)
    phases = n + 1.0
    by_law = {
        2: (phases + 1) * (phases - 2 * m) / (2 * (phases - m)),
        1: (3 * (phases - 1) / (2 * m) - 2 * (phases - 2) / phases) * 4 * m**2 / (4 * m**2 + 5),
        0: np.where(m == 1, 2 * (phases - 2) ** 2 / (2.3 * phases - 4.9),
                    5 * phases**2 / (4 * m * (phases + 3 * m))),
        -1: (phases - 2)
        / m
        * ((phases - 1) ** 2 - 3 * m * (phases - 1) + 4 * m**2)
        / (phases - 3) ** 2,
    }
    return np.maximum(np.select([law == k for k in by_law], list(by_law.values())), 1.0)


def dominant_shape(curve_: AllanCurve) -> str:
    """
    Say in words which kind of gyroscope a curve looks like, from its share of slopes.

    MEMS: -1/2, a flat part from seconds, +1/2 beyond; fibre-optic: -1/2 for minutes, a short flat
    part; ring laser: -1 (or -1/2) over nearly everything.

    """
    good = curve_.edf > 5
    if good.sum() < 4:
        return 'too short to tell a shape'
    slope, tau = smooth_slope(curve_.m, curve_.dev)[good], curve_.tau[good]
    steep = np.mean(slope < -0.75)
    if steep > 0.5:
        return 'ring-laser-like: slope -1 over most of the curve'
    flat = tau[slope > -0.25]
    begin = flat[0] if len(flat) else np.inf
    if begin < 100:
        return f'MEMS-like: white noise, then flat from about {begin:.2g} s'
    if np.isfinite(begin):
        return f'fibre-optic-like: white noise up to {begin:.3g} s, then a short flat part'
    return f'white noise over the whole curve, up to {tau[-1]:.3g} s: no bias instability seen'
