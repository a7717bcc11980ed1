# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A line that sweeps: a machine that runs up or down.

Spread over many frequencies and all of the time it is lost in every bin and every block, and bends
the spectrum like a filter. Along its own path, a line in time and frequency that is straight, or
bent a little in its middle, it is not: sums along all such lines through the power of short
blocks, by the discrete Radon transform of Brady (SIAM J. Comput. 27, 1998), which takes n ln n
additions. A line that stays, comes and goes, or wanders about its frequency only crosses such
paths, and is loud where it does: what follows one is seen in every sixteenth of it.

"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.fft import rfft
from scipy.ndimage import uniform_filter1d
from scipy.special import lambertw

from .passing import in_part
from ..loop.effect import Finding
from ..loop.verdict import FLEXIBLE

SHORTEST = 32   # blocks along which a line is followed at least
SHORTEST_SHARE = 1 / 8  # of the record, along which it is followed at least
LEAST = 6       # cells through which it sweeps at least: what stays is a line or a narrow band
PER = 2         # cells to each of these that are looked at: between two a line is half lost
BENT = 8        # of these by which the halves of a path may differ at most
LONG = 1 / 2    # share of the record, along which one so fine, or bent, is followed at least
FOLLOWED = 10_000   # halves of paths, the loudest, that are followed on to either side at most
CAP = 4.0       # times the mean power that a cell counts at most: few that are crossed say little
HALVED = 4      # times, a path: each of these parts has to show what all of it does
UNEVEN = 1.77   # standard deviations by which the least of 16 normal values is less, on average
LINE, BESIDE, AROUND = PER, 6 * PER, 17     # cells on each side of a line and beside it, blocks
LOUD = 1.3      # times the mean power of those beside, which by chance are four deviations less
NONE = np.zeros(6)
NOWHERE = (0.0, 0.0, 1, 0, 0, 0)    # of sums along lines, where there is none


class Sweep(NamedTuple):
    """How sure (nats), how strong (nats), and (s, Hz) of its beginning and end."""

    sure: float
    strong: float
    begin: float
    end: float
    first: float
    last: float


def find_sweep(white: np.ndarray, dt: float) -> np.ndarray:
    """
    Return the :class:`Sweep` (6,) that is told best from noise; zeros where there is none.

    Parameters
    ----------
    white : ndarray (n,)
        Samples, whitened by their smooth spectrum.
    dt : float
        Interval of the samples, s.

    """
    # as many blocks as there are frequencies and more: a cell a block is through all of the band
    depth, length = _cells(len(white))
    blocks = 1 << depth
    if blocks < SHORTEST:
        return NONE
    cells = rfft(white[:blocks * length].reshape(blocks, length).astype(np.float32), PER * length)
    power = np.abs(cells[:, PER:(PER * length + 1) // 2]) ** 2
    # steady lines are not what is looked for, nor what is loud for a moment
    power /= np.mean(power, axis=0)
    power /= np.mean(power, axis=1, keepdims=True)
    power = np.minimum(power, CAP)
    # nor a band that is switched on and off, and what it leaks into: a line has calm beside it
    beside = _beside(power)
    power /= np.where(beside > LOUD, beside, np.float32(1.0))
    best = NONE
    # in cells of half the width, which hear it better, and in whole ones, through which it may be
    # twice as fast; what wanders follows a path for a while, and better heard it would be one
    for per, turned in product((PER, 1), (False, True)):
        seen = power[:, ::PER // per]
        seen = seen[:, ::-1] if turned else seen
        # the sums alone are no less sure than what counts of them, and mostly none is
        if not _along_lines(seen, depth, per, 0)[0]:
            continue
        sure, strong, count, window, steps, at = _along_lines(seen, depth, per, HALVED)
        first, last = (seen.shape[1] - 1 - k if turned else k for k in (at, at + steps))
        hz = (np.array([first, last]) + per) / (per * length * dt)
        s = np.array([window, window + 1]) * count * length * dt
        if sure > best[0]:
            best = np.array(Sweep(sure, strong, *s, *hz))
    return best


def _cells(n: int) -> tuple[int, int]:
    """Return how often blocks are paired until one is left, and the samples of each."""
    depth = int(np.ceil(np.log2(max(n, 2) / 2) / 2))
    return depth, n >> depth


def on_one_path(found: Sweep, n: int, dt: float) -> bool:
    """
    Tell whether a line moves on one straight path for most of a record of n samples, and steadily.

    Half of its blocks show as much there as counts. A machine that wanders crosses any path, and
    follows none of them for long.

    """
    depth, length = _cells(n)
    blocks = (found.end - found.begin) / (length * dt)
    return blocks >= 0.5 * (1 << depth) and found.strong > 0.5 * (CAP - 1) * blocks


def on_its_path(found: Sweep, lines: np.ndarray, n: int, dt: float) -> np.ndarray:
    """
    Tell which of some lines, (l, 6), are places that one that sweeps all along passes, (l,) bool.

    There it is a line for a while.

    """
    low, high = sorted((found.first, found.last))
    cell = 1 / (_cells(n)[1] * dt)
    inside = (lines[:, 0] > low - cell) & (lines[:, 0] < high + cell)
    long = found.sure > FLEXIBLE and found.end - found.begin >= 0.5 * n * dt
    return in_part(lines, n) & inside & long


def _beside(power: np.ndarray) -> np.ndarray:
    """Return the mean of cells (blocks, m) on both sides of each, in the blocks around it."""
    near = uniform_filter1d(power, AROUND, axis=0, mode='nearest')
    both, line = (width * uniform_filter1d(near, width, axis=1, mode='nearest')
                  for width in (2 * BESIDE + 1, 2 * LINE + 1))
    return (both - line) / np.float32(2 * (BESIDE - LINE))


def _along_lines(power: np.ndarray, depth: int, per: int,
                 halved: int) -> tuple[float, float, int, int, int, int]:
    """
    Return (sure, strong, blocks, which stretch of so many, steps, cell at its beginning).

    Of lines that rise by a whole number of steps, up to one a block, through cells (blocks, m).
    Sums of w cells exceed x w by chance less often than e^-(w (x - 1 - ln x)), Chernoff's bound;
    of all lines that are looked at once in so many. A sum counts as much as if all of its parts,
    which it is ``halved`` to, were as loud as the least may be: a bound on what is less is one on
    that too. ``per`` cells are one that is resolved.

    """
    cells, fewest, best = power.shape[1], LEAST * per, NOWHERE
    # along each line the sum of the cells, and of its halves, quarters and so on the least sum
    least = [power[:, None, :]] * (halved + 1)
    shortest = max(SHORTEST, (SHORTEST_SHARE if per == 1 else LONG) * len(power))
    for level in range(1, depth + 1):
        w, halves = 1 << level, least
        least = [_joined(np.add, halves[0])]
        for k in range(1, halved + 1):  # of what is too short yet no parts are asked for
            asked = w << (halved - k) >= shortest
            least.append(_joined(np.minimum, halves[k - 1]) if asked else least[0])
        if w < shortest or w <= fewest:
            continue
        sums = least[0]
        counted = _counted(sums, least[-1], w, halved)[:, fewest:]
        # a line that would go on at the other end of the band is none
        counted = counted * (np.add.outer(np.arange(fewest, w), np.arange(cells)) < cells)
        window, steps, at = np.unravel_index(int(np.argmax(counted)), counted.shape)
        looks = 2 * PER * depth * sums.size
        sure = _sure(float(counted[window, steps, at]), w, looks)
        if sure > best[0]:
            steps += fewest
            strong = float(sums[window, steps, at]) - w
            best = (sure, strong, w, int(window), int(steps), int(at))
        if w >= LONG * len(power):
            best = max(best, _bent(halves, fewest, looks * (2 * BENT + 1), best[0]))
    return best


def _counted(sums: np.ndarray, parts: np.ndarray, w: int, halved: int) -> np.ndarray:
    """Return what sums of w cells count by the least of the parts that each is halved to."""
    if not halved:
        return sums
    many = 1 << halved
    return np.minimum(sums, many * parts + np.float32(UNEVEN * np.sqrt(many * w)))


def _sure(counted: float, w: int, looks: int) -> float:
    """Return how seldom one of so many sums of w cells counts so much by chance, nats."""
    x = max(1.0, counted / w)
    return float(w * (x - 1 - np.log(x)) - np.log(looks))


def _bent(halves: Sequence[np.ndarray], fewest: int, looks: int,
          least: float) -> tuple[float, float, int, int, int, int]:
    """
    Return what :func:`_along_lines` does, of lines that are bent in their middle.

    Of the sums and the least parts of halves (k, w / 2, m) of lines of w blocks. One that is surer
    than ``least`` has a half that is as loud, on the mean, as all of it must be: the loudest of
    those are followed on to the other side, each by a few steps more or less.

    """
    early, late = (halves[0][k::2] for k in (0, 1))
    halved = len(halves) - 1
    parts = [halves[max(halved - 1, 0)][k::2] for k in (0, 1)]
    w = 2 * early.shape[1]
    window, before, after, first = _bends(
        early, late, fewest, 0.5 * w * _as_sure_as(least, w, looks))
    if not len(window):
        return NOWHERE
    one, two = (window, before, first), (window, after, first + before)
    sums = early[one] + late[two]
    counted = _counted(sums, np.minimum(parts[0][one], parts[1][two]), w, halved)
    k = int(np.argmax(counted))
    return (_sure(float(counted[k]), w, looks), float(sums[k]) - w, w, int(window[k]),
            int(before[k] + after[k]), int(first[k]))


def _bends(early: np.ndarray, late: np.ndarray, fewest: int, loud: float) -> np.ndarray:
    """
    Return (stretch, steps in each half, cell at the beginning) of lines, (4, c).

    Of those that rise by so many steps, and stay in the band, with a half, of the sums (k, w, m)
    of early and late ones, that is so loud.

    """
    bends = np.arange(-BENT, BENT + 1)
    window, before, first = (x[:, None] for x in _loudest(early, loud))
    onwards = np.broadcast_arrays(window, before, before + bends, first)
    window, after, middle = (x[:, None] for x in _loudest(late, loud))
    back = np.broadcast_arrays(window, after + bends, after, middle - (after + bends))
    paths = np.concatenate([np.reshape(x, (4, -1)) for x in (onwards, back)], axis=1)
    _, before, after, first = paths
    steps, (_, tall, cells) = before + after, early.shape
    return paths[:, (np.minimum(before, after) >= 0) & (np.maximum(before, after) < tall)
                 & (steps >= fewest) & (first >= 0) & (first + steps < cells)]


def _as_sure_as(sure: float, w: int, looks: int) -> float:
    """Return the mean of w cells that is as sure, of so many looks, by Chernoff's bound."""
    return float(-lambertw(-np.exp(-1 - (sure + np.log(looks)) / w), -1).real)


def _loudest(sums: np.ndarray, least: float) -> tuple[np.ndarray, ...]:
    """Return where sums (k, w, m) are at least so much, of so many as are followed at most."""
    some = np.flatnonzero(sums >= least)
    if len(some) > FOLLOWED:
        some = some[np.argpartition(sums.ravel()[some], -FOLLOWED)[-FOLLOWED:]]
    return np.unravel_index(some, sums.shape)


def _joined(op: np.ufunc, parts: np.ndarray) -> np.ndarray:
    """
    Return what op makes of both halves of each line twice as long, (k / 2, 2 w, m).

    Of parts (k, w, m): of k stretches of w blocks, the lines that rise by 0 to w - 1 steps from
    each of m cells, which go on at the other end.

    """
    early, late = parts[0::2], parts[1::2]
    w, cells = 2 * parts.shape[1], parts.shape[2]
    out = np.empty((len(early), w, cells), parts.dtype)
    for steps in range(w):
        half, shift = steps // 2, (steps + 1) // 2 % cells
        to = out[:, steps]
        op(early[:, half, :cells - shift], late[:, half, shift:], out=to[:, :cells - shift])
        if shift:
            op(early[:, half, cells - shift:], late[:, half, :shift], out=to[:, cells - shift:])
    return out


def test_of(sweep: np.ndarray) -> Finding:
    """Return the test for a sweeping line, of the nats by which it stands out along its path."""
    found = Sweep(*sweep.tolist())
    words = (f'a line sweeps from {found.first:.4g} to {found.last:.4g} Hz between '
             f'{found.begin:.4g} and {found.end:.4g} s') if found.sure > 0 else 'no line sweeps'
    return Finding('sweep', found.strong, view='sweep',
                   p_value=float(np.exp(-max(found.sure, 0.0))), evidence=words)
