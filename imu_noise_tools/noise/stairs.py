# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A slow quantity that is read in steps: how it goes on between, and what they hide of it."""

from __future__ import annotations

import numpy as np

FLAT = 0.5      # share of neighbours that are equal, of a staircase
FEWEST = 3      # changes of the reading that make one
SHORT = 1 / 256     # of the record, in which noise takes a reading to and fro
LONG = 1 / 32       # in which what mostly turns back does so by noise, and no course of its own
BENT = 0.03         # of a step, rms in its midst, by which what went through it was off the cubic
DITHERED = 1 / 3    # share of the time for which it does so, from where its mean tells more


def unrounded(x: np.ndarray) -> np.ndarray:
    """
    Return a slow quantity that was read in coarse steps, (n,), as it may have gone on between.

    It crossed the middle between two levels when the reading changed; where noise takes that to
    and fro, in the midst of it. A stay that is left the other way than it was entered went from
    one edge to the other, as smoothly as those beside it. One that is left to where it came from,
    the first and the last go on from the edge as fast as those beside them, and turn: where they
    are long, to what the reading says. What noise takes to and fro for a third of the time is not
    hidden by the steps: it stays as it is.

    """
    out = x
    for here, course, _ in _stays(x):
        out = x.copy() if out is x else out
        out[here] = course
    return out


def missed(x: np.ndarray) -> float:
    """
    Return how far :func:`unrounded` x (n,) may be off, rms.

    It is as likely anywhere within a step, where nothing but the reading tells where it is.

    """
    return float(np.sqrt(sum(np.sum(off**2) for _, _, off in _stays(x)) / max(len(x), 1)))


def _stays(x):
    """
    Yield (where, course (m,), error (m,)) of each stay of what is read in steps, x (n,).

    None of what is not, or of which noise tells more.

    """
    read, at = _stairs(x)
    at, edge, chatter = _crossings(read, at)
    back = (np.diff(edge) == 0) & (np.diff(at) < LONG * len(x))
    if len(at) < 2 or chatter > DITHERED * len(x) or np.mean(back) > 0.5:
        return
    ends = np.r_[0, at, len(x)]
    before, after, length = np.r_[edge[0], edge], np.r_[edge, edge[-1]], np.diff(ends)
    pace = (after - before) / length
    for i, n in enumerate(length):
        t, here = (np.arange(n) + 0.5) / n, slice(ends[i], ends[i + 1])
        if pace[i]:
            course = _through(t, before[i], after[i], n * _at_ends(pace, length, i))
            yield here, course, BENT * (after[i] - before[i]) * 4 * t * (1 - t)
            continue
        level = np.median(read[here])
        beside = np.abs(np.r_[pace[max(i - 1, 0):i], pace[i + 1:i + 2]])
        off, left = before[i] - level, np.zeros(n)
        if np.any(beside) and off:
            gone = 1 - t if i == 0 else t if i == len(at) else t * (1 - t)
            left = np.exp(-n * np.mean(beside[beside > 0]) * gone / abs(off))
        yield here, level + off * left, off * (1 - left) / np.sqrt(3)


def _crossings(read: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """
    Return where a reading (n,) that changes at places (m,) crosses edges, (k,), those edges (k,).

    And for how many samples in all it goes to and fro. What does so and ends where it came from
    touches the edge, and crosses it twice.

    """
    if not len(at):
        return at, np.zeros(0), 0
    edge = 0.5 * (read[at] + read[at - 1])
    begins = np.r_[True, (np.diff(edge) != 0) | (np.diff(at) >= SHORT * len(read))]
    first = np.flatnonzero(begins)
    last = np.r_[first[1:], len(at)] - 1
    through = (last - first) % 2 == 0
    middle = (0.5 * (at[first] + at[last])).astype(int)
    places = np.column_stack([np.where(through, middle, at[first]), at[last]])
    some = np.column_stack([np.ones(len(first), bool), ~through])
    return places[some], np.repeat(edge[first], 2 - through), int(np.sum(at[last] - at[first]))


def _at_ends(pace: np.ndarray, length: np.ndarray, i: int) -> np.ndarray:
    """Return how fast stay i goes at its ends (2,): of the parabola through it and one beside."""
    beside = np.array([max(i - 1, 0), min(i + 1, len(pace) - 1)])
    turns = pace[beside] * pace[i] <= 0
    shared = (pace[i] * length[beside] + pace[beside] * length[i]) / (length[i] + length[beside])
    return np.where(turns, pace[i], shared)


def _through(t: np.ndarray, a: float, b: float, speed: np.ndarray) -> np.ndarray:
    """Return the cubic from a to b, at shares t (n,) of the way, of a speed (2,) at its ends."""
    y = a + (b - a) * t**2 * (3 - 2 * t) + t * (1 - t) * (speed[0] * (1 - t) - speed[1] * t)
    return np.clip(y, min(a, b), max(a, b))


def hidden(x: np.ndarray) -> float:
    """
    Return how far a quantity (n,) may go that reads the same, as an rms of the whole record.

    Within a step, where it stays for long. Where noise takes the reading to and fro its mean tells
    what the steps do not.

    """
    read, at = _stairs(x)
    if not len(at):
        return 0.0
    stays = np.diff(at, prepend=0, append=len(x))
    share = float(np.sum(stays[stays > SHORT * len(x)])) / len(x)
    step = float(np.median(np.abs(read[at] - read[at - 1])))
    return step * np.sqrt(share / 12)


def _stairs(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """
    Return a quantity (n,) on its levels, and where it is another than before (k,).

    Nowhere where it is no staircase. What is read less often than an axis goes from one level to
    the next on a line, which says nothing of how it did: it is on the nearest level at which it
    stays.

    """
    stays = np.diff(x) == 0
    if len(x) < 2 or np.mean(stays) < FLAT:
        return x, np.zeros(0, int)
    first = stays & ~np.r_[False, stays[:-1]]
    levels = np.unique(x[1:][first])
    read = levels[np.searchsorted(0.5 * (levels[1:] + levels[:-1]), x)]
    at = np.flatnonzero(np.diff(read)) + 1
    return read, at if len(at) >= FEWEST else at[:0]
