# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A spectrum as smooth as the record asks for, from which faint lines are told.

A level from the median of a few dozen neighbours is off by a tenth and more, and what stands
eighteen nats above its level then seems to stand at fifteen or twenty: a line is lost, or more is
asked of all. Of a sensor's noise the level changes over octaves, so that thousands of coefficients
tell it; how many do, the record says. It begins from running medians, which no line pulls.

"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from ..core.statistics import MEDIAN, median_of

CLIP = 5.0  # times the level: what is higher is no noise's, and counts as that
CLIPPED = 0.9549  # mean of a chi-squared of one degree of freedom that is clipped so
FINE = 4  # bins in a piece of the line
STIFF = 10.0 ** np.arange(5, -2, -1)  # weights of its roughness that are tried
STEPS, STEP = 4, 3.0  # of Fisher's scoring for each, and the longest
WIDE = 32  # coefficients on either side, at least, among which it is looked for what is no line
PIECE = 1 << 15  # coefficients that are worked on at a time
BEYOND = 2.0  # standard errors from which what stands out there is the level
CURVED = 256  # coefficients whose level is read from a parabola


def reach_at(k: np.ndarray | int, n: int) -> np.ndarray:
    """Return how many coefficients on either side of k its level is taken from."""
    # a filter may end at Nyquist as steeply as drift begins at zero
    return np.clip(0.2 * np.minimum(k, n - k), 12, max(12, n // 100)).astype(int)


def reference_spectrum(c: np.ndarray, dt: float) -> np.ndarray:
    """
    Return a smooth one-sided PSD at every k >= 1 from running medians, (n - 1,), unit^2/Hz.

    Of cosine coefficients c (n,); lines and spikes in it do not show.

    """
    n = len(c)
    centres = np.round(np.geomspace(1, n - 1, 400)).astype(int)
    centres = np.unique(np.concatenate([centres, n - centres]))
    values = np.empty(len(centres))
    for i, (k, wide) in enumerate(zip(centres, reach_at(centres, n))):
        some = c[max(1, k - wide):k + wide + 1]
        if len(some) > 2048:
            some = some[:: len(some) // 2048 + 1]
        values[i] = median_of(2 * dt * some * some) / MEDIAN
    at, level = np.log(centres), np.log(np.maximum(values, 1e-300))
    level = _smoothed_below(CURVED, c, dt, centres, level)
    out = np.empty(n - 1)
    for i in range(0, n - 1, PIECE):
        k = np.arange(i + 1, min(i + PIECE, n - 1) + 1)
        out[i:i + PIECE] = np.exp(np.interp(np.log(k), at, level))
    return out


def _smoothed_below(top: int, c, dt, centres, level):
    """
    Return ln of the levels, those of the first centres from parabolas over ln k.

    A few dozen neighbours are too few for a median, and more of them too far apart on a red
    spectrum; a parabola over k/4 ... 4 k follows it. Ordinates far off the median do not pull it.

    """
    last = min(4 * top, len(c) - 1)
    if last < 32:
        return level
    k = np.log(np.arange(1, last + 1))
    rough = np.interp(k, np.log(centres), level)
    seen = np.log(np.maximum(2 * dt * c[1:last + 1] ** 2, 1e-300))
    seen = rough + np.clip(seen - rough, -5, 2.5) + 1.1395  # its mean for one degree of freedom
    parabolas = _parabolas(tuple(centres[centres <= top].tolist()), last)
    right = np.stack([columns @ seen[a:b] for a, b, columns in parabolas])
    left = np.stack([columns @ columns.T for _, _, columns in parabolas])
    out = level.copy()
    out[centres <= top] = np.linalg.solve(left, right[:, :, None])[:, 0, 0]
    return out


@lru_cache(maxsize=4)
def _parabolas(centres: tuple[int, ...], last: int) -> list[tuple[int, int, np.ndarray]]:
    """Return [begin, end) of k - 1 around each centre, and 1, x, x^2 there, x = ln k/centre."""
    log_k, out = np.log(np.arange(1, last + 1)), []
    for centre in centres:
        a, b = max(1, centre // 4) - 1, min(last, max(4 * centre, 32))
        x = log_k[a:b] - log_k[centre - 1]
        out.append((a, b, np.stack([np.ones(len(x)), x, x * x])))
    return out


def smooth_level(c: np.ndarray, rough: np.ndarray,
                 dt: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """
    Return ln k (b,) of some k, ln of a smooth one-sided PSD there, and the variance of that.

    A broken line of ln S with knots a reach apart and a penalty on its second differences (Eilers
    and Marx 1996), by Whittle's likelihood of the coefficients; how stiff it is by the likelihood
    with the line integrated out (Laplace). Where what is near stands above it beyond chance, a
    hump that is as wide, that is the level.

    Parameters
    ----------
    c : ndarray (n,)
        Cosine coefficients.
    rough : ndarray (n - 1,)
        A level that lines do not pull, at each k >= 1.
    dt : float
        Interval, s.

    """
    grid = _grid(len(c))
    first, count = grid.first, grid.size
    fitted = np.log(_means(first, count, lambda _, a, b: rough[a - 1:b - 1]))

    def clipped(bins: slice, a: int, b: int) -> np.ndarray:
        most = np.repeat(CLIP * np.exp(fitted[bins]), count[bins])
        return np.minimum(2 * dt * c[a:b] ** 2, most)

    for _ in range(2):      # clipped at a level that is better known
        power = _means(first, count, clipped) / CLIPPED
        fitted, variance = _line(grid, np.log(np.maximum(power, 1e-300)), fitted)
    over, variance = _above(grid, np.exp(np.log(power) - fitted), variance)
    return np.log(first + 0.5 * (count - 1)), fitted + over, variance


class _Grid(NamedTuple):
    """
    The bins (b,) of a record, and the broken line (knots,) over them.

    The ``first`` coefficient of each and its ``size``; how far the level around it may be looked
    at; the line's value there by its knots, and the second differences of these.

    """

    first: np.ndarray
    size: np.ndarray
    wide: np.ndarray
    basis: np.ndarray
    bend: np.ndarray


@lru_cache(maxsize=4)
def _grid(n: int) -> _Grid:
    """Return the bins of n coefficients, and a line with knots a reach apart."""
    first, u, k, at = [], [], 1, 0.0
    while k < n:
        # at the slow end a level is that of an octave
        step = max(1.0, min(float(reach_at(k, n)), 0.2 * k))
        width = min(max(1, int(step / FINE)), n - k)
        first.append(k)
        u.append(at + 0.5 * width / step)
        k, at = k + width, at + width / step
    basis = np.maximum(1 - np.abs(np.array(u)[:, None] - np.arange(np.ceil(u[-1]) + 1)), 0)
    return _Grid(np.array(first), np.diff([*first, n]),
                 np.array([max(float(reach_at(k, n)), WIDE) for k in first]), basis,
                 np.diff(np.eye(basis.shape[1]), 2, axis=0))


def _means(first: np.ndarray, count: np.ndarray,
           values: Callable[[slice, int, int], np.ndarray]) -> np.ndarray:
    """
    Return the mean of each bin, so many coefficients from its ``first`` on.

    Of ``values(bins, a, b)``, what coefficients [a, b) of some bins have: of a day no array is as
    long as the record.

    """
    out, i = np.empty(len(first)), 0
    while i < len(first):
        j = max(i + 1, int(np.searchsorted(first, first[i] + PIECE)))
        some = values(slice(i, j), int(first[i]), int(first[j - 1] + count[j - 1]))
        out[i:j] = np.add.reduceat(some, first[i:j] - first[i])
        i = j
    return out / count


def _line(grid: _Grid, power: np.ndarray, begin: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the broken line in each bin by ln powers, as stiff as is likeliest, its variance."""
    basis, bend, count = grid.basis, grid.bend, grid.size
    weighed = basis.T * (0.5 * count)
    data, rough = weighed @ basis, bend.T @ bend
    best, level, most = begin, begin, -np.inf
    for stiff in STIFF:
        bent = cho_factor(data + stiff * rough, lower=True, check_finite=False)
        for _ in range(STEPS):
            slope = np.exp(np.clip(power - level, -STEP, STEP)) - 1
            beta = cho_solve(bent, weighed @ (level + slope), check_finite=False)
            level = basis @ beta
        log_det = 2 * np.sum(np.log(np.diag(bent[0])))
        nats = 0.5 * (len(bend) * np.log(stiff) - log_det
                      - stiff * np.sum((bend @ beta) ** 2)
                      - count @ (level + np.exp(power - level)))
        if nats > most:
            best, most, chosen = level, nats, bent
    return best, np.sum(basis * cho_solve(chosen, basis.T).T, axis=1)


def _above(grid: _Grid, ratio: np.ndarray,
           variance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return ln of how far what is near stands above a level beyond chance, and the variance."""
    first, count, wide = grid.first, grid.size, grid.wide
    total = np.append(0.0, np.cumsum(ratio * count))
    number = np.append(0, np.cumsum(count))
    low, high = np.searchsorted(first, first - wide), np.searchsorted(first, first + wide, 'right')
    some = number[high] - number[low]
    near = (total[high] - total[low]) / some
    over = near > 1 + BEYOND * np.sqrt(2 / some)
    return np.log(np.where(over, near, 1.0)), np.where(over, 2 / some, variance)
