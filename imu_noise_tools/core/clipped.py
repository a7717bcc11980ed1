# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Which samples stand at an end of the range: clipped there, in a row or one by one.

Noise thins out towards its end: there are the fewest, ever more steeply. A lump on the last level
is what would have gone beyond it. So it is asked of the samples alone, wherever the end is, and
of visits to a level: a value that is held, or that the noise never leaves, is one.

"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from statistics import NormalDist

import numpy as np

from .record import ImuRecord, possible, sensor_of
from .units import in_percent

LEAST = 100             # samples that tell
FEWEST = 10             # of them at the end
LEAST_SHARE = 1e-5      # what is less changes no number
LEVELS = 6              # two states, each with the neighbours that its noise reaches: no more
MANY = 100              # visits that tell how noise thins out next to the end
SURE = 6.0              # standard errors: one end of 1e9
NONE_BEYOND = 20.0      # samples expected beyond the end where there are none: once in 5e8
LUMP = 3.0              # times the level next to it, where they come in a row
IN_A_ROW = 0.2          # share of them that follow another


def stays(x: np.ndarray) -> np.ndarray:
    """Return which samples stand at an end where x (n,) stays in a row, (n,) bool."""
    found = np.zeros(len(x), bool)
    for end in _ends(x, _stays):
        found |= x == end
    return found


def ends_of_range(x: np.ndarray) -> tuple[float, ...]:
    """Return at which of its least and greatest values x (n,) is clipped."""
    return _ends(x, lambda *of: _stays(*of) or _lump(*of))


def at_ends(record: ImuRecord) -> dict[str, tuple[tuple[float, int], ...]]:
    """
    Return the ends at which axes of a record are clipped, and how many samples stand there.

    By axis, those that are not clipped left out; of what is not set aside.

    """
    keep = np.ones(record.n, bool)
    for begin, end, _ in record.left_out:
        keep[slice(*np.searchsorted(record.t, (begin, end)))] = False
    found = {}
    for axis in record.columns:
        x = record.column(axis)
        x = x if keep.all() else x[keep]
        found[axis] = tuple((end, int(np.sum(x == end))) for end in ends_of_range(x))
    return {axis: ends for axis, ends in found.items() if ends}


def ends_in_words(axis: str, ends: Iterable[tuple[float, float]]) -> str:
    """Return the shares of the samples of an axis that stand at ends of its range, with these."""
    gyro = sensor_of(axis) == 'gyro'
    return ', '.join(f'{in_percent(share)} at '
                     + (f'{np.degrees(end):.5g} deg/s' if gyro else f'{end:.5g} m/s^2')
                     for end, share in ends)


def narrowed(shares: Sequence[float]) -> float:
    """
    Return what clipping leaves of the standard deviation of normal noise.

    Of such shares of the samples at one end or at both.

    """
    mean, square = 0.0, 1.0
    for share, sign in zip(shares, (1, -1)):
        p = min(share, 0.99)
        u = NormalDist().inv_cdf(1 - p)
        density = NormalDist().pdf(u)
        mean -= sign * (density - u * p)
        square -= u * density + p - u * u * p
    return float(np.sqrt(max(square - mean**2, 0.0)))


def _ends(x: np.ndarray, clipped: Callable[..., bool]) -> tuple[float, ...]:
    """Return the least and the greatest value, where x (n,) is clipped there."""
    finite = possible(x)
    some = x if finite.all() else x[finite]
    if len(some) < LEAST or some.min() == some.max() or len(np.unique(some[:20_000])) <= LEVELS:
        return ()
    found = []
    for sign in (-1, 1):
        y = sign * some
        at = y == y.max()
        if np.sum(at) >= max(FEWEST, LEAST_SHARE * len(y)):
            if clipped(y, at, y[np.r_[True, y[1:] != y[:-1]]]):
                found.append(float(sign * y.max()))
    return tuple(found)


def _stays(y: np.ndarray, at: np.ndarray, visits: np.ndarray) -> bool:
    """
    Tell whether y (n,) goes to its end, ``at`` (n,), by more than a level and stays there.

    What is held elsewhere too does not stay, nor does a course that levels off: it comes to its
    last level from the one before, where it was for longer than to pass.

    """
    top = y.max()
    inner = y[~at]
    next_one = inner.max()
    held = len(inner) / np.sum(visits != top)
    came = y[:-1][at[1:] & ~at[:-1]]
    count, beside = int(np.sum(at)), int(np.sum(inner == next_one))
    return bool(
        count > max(FEWEST * held, LUMP * beside)
        and np.sum(at[1:] & at[:-1]) > IN_A_ROW * count
        and (beside <= len(came) or np.median(came) < next_one)
    )


def _lump(y: np.ndarray, at: np.ndarray, visits: np.ndarray) -> bool:
    """
    Tell whether more visits are to the end of y (n,) than the next levels let one expect.

    Two things are asked. The logarithm of how often noise takes a level is concave, of a bounded
    one too: its line through the next levels is no less than what the last one has. And however
    its mean wanders, noise of variance s^2 on a grid of step q thins out by no more than
    exp(-q^2/s^2) from one ratio of levels to the next: if so many would be beyond the end that
    none is no chance, there is an end. s is that of neighbours, which is none where most of them
    are equal: what the steps hide cannot be seen to end.

    """
    levels, count = np.unique(visits, return_counts=True)
    last, before = float(count[-1]), count[-2::-1].astype(float)
    if last < FEWEST:
        return False
    m = 1
    while before[:m].sum() < MANY and 4 * m <= len(before):
        m *= 2
    one, two = before[:m].sum(), before[m:2 * m].sum()
    if not two:
        return False
    w = 0.5 * (m + 1) / m       # from the middle of the first m levels to the last
    over = np.log(last) - (1 + w) * np.log(one / m) + w * np.log(two / m)
    error = np.sqrt(1 / last + (1 + w)**2 / one + w**2 / two)
    inside = ~at & (y > y.min())
    step = np.abs(np.diff(y)[inside[1:] & inside[:-1]])
    sigma = float(np.median(step)) / (0.6745 * np.sqrt(2)) if len(step) else 0.0
    if over < SURE * error or not sigma:
        return False
    beyond = last**2 * m / one * np.exp(-((levels[-1] - levels[-2]) / sigma)**2)
    return bool(beyond > NONE_BEYOND)
