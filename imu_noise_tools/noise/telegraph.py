# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Two levels between which samples jump, where they lie so far apart that each sample shows its own.

A short stay at the other level is no defect: what looks for spikes and knocks looks beside it.

"""

import numpy as np
from scipy.ndimage import binary_closing

from .lines import PIECE, strong_lines, without_strong_lines
from ..core.statistics import repeats

_SOME = 1 << 20  # pairs of samples that tell how much they scatter
_FLAT = 8  # samples on either side of a jump that are flat
_BETWEEN = 4  # samples that a filter spreads a jump over
_APART = 8.0  # standard deviations between the levels: halfway, no sample is taken for the other
_LEAST = 5.6  # standard deviations that a jump is looked at from
_EVEN = 1.5  # standard deviations that a flat stretch scatters by at most
_NEAR = 4.0  # standard deviations of a sample that is at a level
_OFTEN = 6  # jumps, from which on they are no single steps
_SELDOM = 16  # samples from one to the next on the average, at least: half of them see flat ones
_ALIKE = 0.25  # by what share of their size jumps differ
_HIDDEN = 0.8  # of the scatter is left without lines that hide a jump
_MOST = 0.8  # share of them that do not differ more, and that go up and down in turn


def levels(y: np.ndarray) -> np.ndarray | None:
    """
    Return at which of two levels each sample (n,) is; None where there are no such levels.

    None as well where samples are held: beside a level that drifts repeats are none. The levels
    follow what is slow. Where the samples pass from one to the other it is they themselves, so
    that nothing of a jump is left beside it. Strong lines hide jumps, which are looked for
    without them.

    """
    at = _levels(y)
    some = y[max(0, len(y) - PIECE) // 2:][:PIECE]
    if at is None and len(y) >= 20 * _FLAT \
            and _over_lag(some - strong_lines(some)) < _HIDDEN * _over_lag(some):
        at = _levels(without_strong_lines(y))
    return at


def _levels(y: np.ndarray) -> np.ndarray | None:
    """Return :func:`levels` of samples as they are."""
    lag = 2 * _BETWEEN
    if len(y) < 20 * _FLAT:
        return None
    some = np.arange(0, len(y) - lag, 1 + len(y) // _SOME)
    sigma = _scatter(y[some + lag] - y[some])
    if not sigma > 0:
        return None
    apart = np.concatenate([
        np.abs(y[i + lag:i + lag + PIECE] - y[i:i + PIECE][:len(y) - lag - i]) > _LEAST * sigma
        for i in range(0, len(y) - lag, PIECE)])
    far = np.flatnonzero(np.diff(apart, prepend=False, append=False))
    at = far.reshape(-1, 2).sum(axis=1) // 2 + lag // 2
    if not _OFTEN <= len(at) < len(y) / _SELDOM:
        return None
    at, low, high = _jumps(y, at, sigma)
    if len(at) < _OFTEN:
        return None
    size = high - low
    step = float(np.median(np.abs(size)))
    alike = np.abs(np.abs(size) - step) < _ALIKE * step
    turns = np.sign(size[1:]) != np.sign(size[:-1])
    if step < _APART * sigma or np.mean(alike) < _MOST or np.mean(turns) < _MOST \
            or repeats(y).held:
        return None
    middle = np.interp(np.arange(len(y)), at[alike], 0.5 * (low + high)[alike])
    return _followed(y, middle, 0.5 * step, _NEAR * sigma)


def _over_lag(y: np.ndarray) -> float:
    """Return how much samples (k,) scatter that lie so far apart that a jump is between them."""
    return _scatter(y[2 * _BETWEEN:] - y[:-2 * _BETWEEN])


def _scatter(d: np.ndarray) -> float:
    """Return the deviation of samples, of which most differences are d, jumps left out."""
    sigma = float(np.median(np.abs(d))) * 1.4826 / np.sqrt(2)
    # rounded coarsely a median may be off by half a step
    inside = d[np.abs(d) < _LEAST * sigma]
    return max(sigma, float(np.sqrt(np.mean(inside**2) / 2))) if len(inside) else sigma


def _followed(y: np.ndarray, middle: np.ndarray, half: float, near: float) -> np.ndarray:
    """Return the level of each sample (n,), which lie half a step from the middle (n,)."""
    side = np.sign(y - middle).astype(np.int8)
    off = np.abs(np.abs(y - middle) - half)
    at_one = np.where(off < near, side, np.int8(0))
    begin = np.flatnonzero(np.concatenate([[True], at_one[1:] != at_one[:-1]]))
    long = (np.diff(np.append(begin, len(y))) >= _FLAT) & (at_one[begin] != 0)
    if not np.any(long):
        return y
    # stretches: a stay, or all that is between two of them
    first = long | np.concatenate([[True], long[:-1]])
    begin, stay = begin[first], long[first]
    off_both = np.abs(y - middle) > half + near
    beyond = np.logical_or.reduceat(off_both, begin)
    least, most = (f.reduceat(at_one, begin) for f in (np.minimum, np.maximum))
    state = np.where(stay, at_one[begin], 0)
    known = np.flatnonzero(stay)
    before = state[np.maximum(np.maximum.accumulate(np.where(stay, np.arange(len(stay)), -1)),
                              known[0])]
    after = np.append(before[1:], before[-1])
    # a short stay is seen at the other level and never beyond both, as knocks and spikes are
    visited = np.where(before > 0, -least, most) > 0
    passing = ~stay & ((before != after) | visited & ~beyond)
    ends = np.diff(np.append(begin, len(y)))
    level = middle + half * np.repeat(before, ends)
    out = np.where(np.repeat(passing, ends), y, level)
    # nor is what goes beyond both as it passes: it may do so unseen, behind a burst
    wild = binary_closing(off_both, np.ones(_BETWEEN + 1)) & np.repeat(passing, ends)
    return np.where(wild, middle + half * _of_nearest(side, ~wild), out)


def _of_nearest(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return values (n,), those that are not known as the nearest that is."""
    at = np.flatnonzero(known)
    if not len(at):
        return values
    nearest = np.interp(np.arange(len(values)), at, np.arange(len(at)))
    return values[at[np.rint(nearest).astype(int)]]


def _jumps(y: np.ndarray, at: np.ndarray, sigma: float):
    """Return (where, level before, level after) of those of samples ``at`` (k,) that jump."""
    reach = _BETWEEN // 2 + _FLAT
    at = at[(at >= reach) & (at < len(y) - reach)]
    around = np.arange(_FLAT)
    before = y[at[:, None] - reach + around]
    after = y[at[:, None] + _BETWEEN // 2 + around]
    low, high = before.mean(axis=1), after.mean(axis=1)
    even = np.maximum(before.std(axis=1), after.std(axis=1)) < _EVEN * sigma
    clear = even & (np.abs(high - low) > _LEAST * sigma)
    # noise may break one jump into two
    clear &= np.diff(at, prepend=-_FLAT) >= _FLAT
    return at[clear], low[clear], high[clear]
