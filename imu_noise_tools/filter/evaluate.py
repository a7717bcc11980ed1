# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Is a filter right? From its innovations alone.

Everything looks at the scores u of :mod:`imm`: independent standard normal numbers if, and only
if, the model is right. The information that a wrong model loses is that between u and such
numbers: one part lies in their spectrum, one in their distribution.

"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtr, chdtrc, ndtr, ndtri

from ..core.spectrum import bins_of, cosine_transform, power
from ..core.statistics import gamma_excess, gamma_pull, kurtosis_pull, means_of_blocks
from ..loop.effect import Finding, Score, View

LAGS = 20               # of the Ljung-Box test
VARIANCE_BLOCKS = 32    # of the test for a change in time
CLASSES = 32            # of the distribution
# nats a sample that the bank for any motion loses on motions that none of its modes is, by view:
# the most of `python bench/filter.py coarse`
COARSE = {'spectrum': 0.12, 'distribution': 0.01}


@dataclass(frozen=True)
class Innovations:
    """
    Figures of normalised innovations, all with their value under a true model.

    ``nis`` mean square (1); ``mean`` (0); ``lag1`` autocorrelation (0); ``kurtosis`` (0, excess);
    ``n`` of them.

    """

    n: int
    nis: float
    mean: float
    lag1: float
    kurtosis: float

    @classmethod
    def of(cls, u: np.ndarray) -> Innovations:
        """Return the figures of u (n,); what is not finite is left out."""
        u = u[np.isfinite(u)]
        if len(u) < 10:
            return cls(len(u), *[float('nan')] * 4)
        r = autocorrelation(u, 1)
        return cls(
            len(u), float(np.mean(u * u)), float(np.mean(u)), float(r[1]), excess_kurtosis(u)
        )


def excess_kurtosis(u: np.ndarray) -> float:
    """Return the kurtosis of u (n,) less that of a normal distribution; 0 of a constant."""
    square = (u - np.mean(u)) ** 2
    variance = float(np.mean(square))
    return float(np.mean(square ** 2)) / variance ** 2 - 3.0 if variance > 0 else 0.0


def autocorrelation(u: np.ndarray, lags: int) -> np.ndarray:
    """Return the autocorrelation of u (n,) at lags 0 ... lags, biased estimate."""
    d = u - np.mean(u)
    total = max(float(d @ d), 1e-300)
    return np.array([float(d[:len(d) - k] @ d[k:]) / total for k in range(lags + 1)])


def spectrum_view(u: np.ndarray, dt: float) -> View:
    """
    Return the spectrum of the scores u (n,), at dt (s), against the flat one of a true model.

    The deviance is the sum of w (x - ln x - 1), x the binned periodogram over its expectation, w
    coefficients a bin, less what chance gives: twice the Gaussian information (Whittle 1953),
    noise level and mean included.

    """
    n = len(u)
    bins = bins_of(n, dt)
    x = power(cosine_transform(u), dt, bins) / (2 * dt)
    w = bins.count.astype(float)
    excess, variance = gamma_excess(x, w)
    mean = n * float(np.mean(u) ** 2) - 1
    return View('spectrum', bins.f, gamma_pull(x, w), float(np.sum(excess) + mean) / len(x),
                float(np.sqrt(np.sum(variance) + 2)) / len(x), 'Hz')


def distribution_view(u: np.ndarray) -> View:
    """
    Return the distribution of the scores u (n,), their scale removed, in classes of the normal.

    The deviance is the likelihood-ratio statistic less its degrees of freedom: twice n times the
    negentropy, binned. The outermost classes begin at three and a half standard deviations.

    """
    n = len(u)
    edges = np.concatenate([[-3.5], ndtri(np.arange(1, CLASSES) / CLASSES), [3.5]])
    p = np.diff(np.concatenate([[0.0], ndtr(edges), [1.0]]))
    v = (u - np.mean(u)) / max(float(np.std(u)), 1e-300)
    seen = np.bincount(np.searchsorted(edges, v), minlength=len(p)).astype(float)
    expected = n * p
    with np.errstate(divide='ignore', invalid='ignore'):
        g = 2 * float(np.sum(np.where(seen > 0, seen * np.log(seen / expected), 0.0)))
    dof = len(p) - 3
    centre = ndtri(np.cumsum(p) - p / 2)
    return View('distribution', centre, (seen - expected) / np.sqrt(expected), (g - dof) / len(p),
                float(np.sqrt(2 * dof)) / len(p), 'sigma')


def time_view(u: np.ndarray, dt: float) -> View:
    """
    Return the mean square of the scores u (n,), at dt (s), in blocks.

    Its excess is within the others', so it counts for nothing.

    """
    size = max(1, len(u) // VARIANCE_BLOCKS)
    level = means_of_blocks(u**2, size)
    pull = (np.cbrt(level) - (1 - 2 / (9 * size))) / np.sqrt(2 / (9 * size))
    return View('time', (np.arange(len(level)) + 0.5) * size * dt, pull, 0.0, 0.0, 's')


def score_of(
    u: np.ndarray, dt: float, coarse: bool = False, smooth: np.ndarray | None = None,
    log_l: float | None = None
) -> Score:
    """
    Return the error of the loop.

    Excess deviance per bin, 0 for a true model in expectation, the views averaged.

    The deviance of both views together is 2 n times the mean innovation log-likelihood that a true
    model would have scored above this one: u and the samples carry the same information.
    ``coarse``: what a bank loses by itself is allowed; the error shows it all the same, and falls
    by what an effect that was missing explains of it.
    ``smooth`` (n,): the scores whose distribution counts where rounding makes a comb of that of u.
    ``log_l``: the log-likelihood of the samples, by which two models are compared, half in either
    view: it also knows which samples a model expects to be large, and the views do not.

    """
    u = np.clip(u, -1e6, 1e6)
    smooth = u if smooth is None else np.clip(smooth, -1e6, 1e6)
    views = [spectrum_view(u, dt), distribution_view(smooth)]
    if coarse:
        views = [replace(v, allowed=2 * len(u) * COARSE[v.name] / len(v.pull)) for v in views]
    return Score.of(views if log_l is None else (replace(v, log_score=-log_l) for v in views))


def omnibus(
    u: np.ndarray, dt: float, coarse: bool = False, smooth: np.ndarray | None = None
) -> list[Finding]:
    """
    Return tests of u (n,) that fail when anything is missing.

    Each with its p-value and what it saw.

    Spectrum and autocorrelation are tested on the side of too much: innovations with too little
    power at low frequency say that the model allows for motion that the record does not hold, and
    nothing is missing then. ``coarse``: what a bank loses by itself is no failure either, in any
    test of a view that loses no more. ``smooth`` as for :func:`score_of`.

    """
    n = len(u)
    smooth = u if smooth is None else smooth
    r = autocorrelation(u, LAGS)
    nis = float(np.mean(u * u))
    p_spectrum, where = _too_much_power(u, dt)
    blocks = time_view(u / max(float(np.std(u)), 1e-300), dt)
    power_k = cosine_transform(u)[1:] ** 2
    peak = int(np.argmax(power_k)) + 1
    level = max(float(np.mean(power_k)), 1e-300)
    tests = [
        (
            'level',
            2 * min(chdtr(n, n * nis), chdtrc(n, n * nis)),
            'level',
            f'normalised innovation squared is {nis:.3g}, not 1',
        ),
        (
            'mean',
            2 * ndtr(-abs(float(np.mean(u))) * np.sqrt(n)),
            'level',
            f'innovations have a mean of {float(np.mean(u)):.3g} sigma',
        ),
        (
            'autocorrelation',
            _positive_correlation(r, n),
            'lag',
            f'autocorrelation is {r[1]:.3g} at lag 1, {r[LAGS]:.3g} at {LAGS}',
        ),
        ('spectrum', p_spectrum, 'spectrum', f'too much power, most near {where:.3g} Hz'),
        (
            'line',
            -np.expm1(n * np.log1p(-_chi2_tail(float(power_k[peak - 1]) / level))),
            'spectrum',
            f'a line at {peak / (2 * n * dt):.4g} Hz',
        ),
        (
            'kurtosis',
            float(2 * ndtr(-abs(kurtosis_pull(smooth - np.mean(smooth))))),
            'distribution',
            f'excess kurtosis is {excess_kurtosis(smooth):.3g}',
        ),
        (
            'variance in time',
            chdtrc(len(blocks.pull) - 1, float(np.sum(blocks.pull**2))),
            'time',
            f'noise level changes, most at {blocks.x[int(np.argmax(np.abs(blocks.pull)))]:.4g} s',
        ),
    ]
    passed = set()
    if coarse:
        views = score_of(u, dt, True, smooth).views
        passed = {k for k, v in views.items() if v.over <= 0}
    return [Finding(name, 0.0, view=where, evidence=words,
                    p_value=1.0 if ('distribution' if where == 'distribution' else 'spectrum')
                    in passed else float(np.clip(p, 0.0, 1.0)))
            for name, p, where, words in tests]


def _positive_correlation(r, n) -> float:
    """
    Return the p-value of sums of the first autocorrelations being positive.

    Of the first 1, 2, 4 ... m of them: each sum is normal with variance m/n.

    """
    sums = np.cumsum(r[1:])
    m = np.array([1, 2, 4, 8, 16])
    m = m[m <= len(sums)]
    return float(min(1.0, len(m) * np.min(ndtr(-sums[m - 1] * np.sqrt(n / m)))))


def _too_much_power(u, dt) -> tuple[float, float]:
    """
    Return the p-value of too much power in some stretch of the spectrum, and where (Hz).

    Stretches are of 1, 4, 16 ... bins.

    The power of w coefficients is chi-squared with w degrees of freedom; by Bonferroni over all
    stretches.

    """
    bins = bins_of(len(u), dt)
    w = bins.count.astype(float)
    x = power(cosine_transform(u), dt, bins) / (2 * dt) * w
    best, where, tried = 1.0, float('nan'), 0
    for size in 4 ** np.arange(6):
        if size > len(w):
            break
        first = np.arange(0, len(w), size)
        p = chdtrc(np.add.reduceat(w, first), np.add.reduceat(x, first))
        tried += len(p)
        at = int(np.argmin(p))
        if p[at] < best:
            best, where = float(p[at]), float(bins.f[min(first[at] + size // 2, len(w) - 1)])
    return min(1.0, tried * best), where


def _chi2_tail(x: float) -> float:
    return float(min(chdtrc(1, x), 1 - 1e-16))
