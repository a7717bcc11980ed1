# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A spectrum as smooth as the record asks for, from which faint lines are told.

A level from the median of a few dozen neighbours is off by a tenth and more, and what stands
eighteen nats above its level then seems to stand at fifteen or twenty: a line is lost, or more is
asked of all. Of a sensor's noise the level changes over octaves, so that thousands of coefficients
tell it; how many do, the record says.

"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

CLIP = 5.0  # times the level: what is higher is no noise's, and counts as that
CLIPPED = 0.9549  # mean of a chi-squared of one degree of freedom that is clipped so
FINE = 4  # bins in a piece of the line
STIFF = 10.0 ** np.arange(5, -2, -1)  # weights of its roughness that are tried
STEPS, STEP = 4, 3.0  # of Fisher's scoring for each, and the longest
WIDE = 32  # coefficients on either side, at least, among which it is looked for what is no line
BEYOND = 2.0  # standard errors from which what stands out there is the level


def smooth_level(c: np.ndarray, rough: np.ndarray, dt: float,
                 reach: Callable[[int], float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
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
    reach : callable
        How far on either side of k a level may be taken for one.

    """
    first, u = _bins(len(c), reach)
    count = np.diff(np.append(first, len(c)))
    ends = list(zip(first, first + count))
    fitted = np.log([np.mean(rough[a - 1:b - 1]) for a, b in ends])
    for _ in range(2):      # clipped at a level that is better known
        power = np.array([np.mean(np.minimum(2 * dt * c[a:b] ** 2, CLIP * level))
                          for (a, b), level in zip(ends, np.exp(fitted))]) / CLIPPED
        fitted, variance = _line(u, np.log(np.maximum(power, 1e-300)), count, fitted)
    over, variance = _above(first, np.exp(np.log(power) - fitted), count, variance, reach)
    return np.log(first + 0.5 * (count - 1)), fitted + over, variance


def _bins(n: int, reach: Callable[[int], float]) -> tuple[np.ndarray, np.ndarray]:
    """Return the first coefficients of bins, and where their middle is, in reaches from k = 1."""
    first, u, k, at = [], [], 1, 0.0
    while k < n:
        step = max(1.0, min(reach(k), 0.2 * k))     # at the slow end a level is that of an octave
        width = min(max(1, int(step / FINE)), n - k)
        first.append(k)
        u.append(at + 0.5 * width / step)
        k, at = k + width, at + width / step
    return np.array(first), np.array(u)


def _line(u, power, count, begin) -> tuple[np.ndarray, np.ndarray]:
    """Return the broken line at each u by ln powers, as stiff as is likeliest, its variance."""
    basis = np.maximum(1 - np.abs(u[:, None] - np.arange(np.ceil(u[-1]) + 1)), 0)
    bend = np.diff(np.eye(basis.shape[1]), 2, axis=0)
    weighed = basis.T * (0.5 * count)
    best, level, most = begin, begin, -np.inf
    for stiff in STIFF:
        bent = weighed @ basis + stiff * bend.T @ bend
        for _ in range(STEPS):
            slope = np.exp(np.clip(power - level, -STEP, STEP)) - 1
            beta = np.linalg.solve(bent, weighed @ (level + slope))
            level = basis @ beta
        nats = 0.5 * (len(bend) * np.log(stiff) - np.linalg.slogdet(bent)[1]
                      - stiff * np.sum((bend @ beta) ** 2)
                      - count @ (level + np.exp(power - level)))
        if nats > most:
            best, most, chosen = level, nats, bent
    return best, np.sum(basis * np.linalg.solve(chosen, basis.T).T, axis=1)


def _above(first, ratio, count, variance, reach) -> tuple[np.ndarray, np.ndarray]:
    """Return ln of how far what is near stands above a level beyond chance, and the variance."""
    total = np.append(0.0, np.cumsum(ratio * count))
    number = np.append(0, np.cumsum(count))
    wide = np.array([max(reach(k), WIDE) for k in first])
    low, high = np.searchsorted(first, first - wide), np.searchsorted(first, first + wide, 'right')
    some = number[high] - number[low]
    near = (total[high] - total[low]) / some
    over = near > 1 + BEYOND * np.sqrt(2 / some)
    return np.log(np.where(over, near, 1.0)), np.where(over, 2 / some, variance)
