# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A line that sweeps: a machine that runs up or down.

Spread over many frequencies and all of the time it is lost in every bin and every block, and bends
the spectrum like a filter. Along its own path, a straight line in time and frequency, it is not:
sums along all such lines through the power of short blocks, by the discrete Radon transform of
Brady (SIAM J. Comput. 27, 1998), which takes n ln n additions. A line that stays, comes and goes,
or wanders about its frequency only crosses such paths, and is loud where it does: what follows one
is seen in every eighth of it.

"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.fft import rfft
from scipy.ndimage import uniform_filter1d

from .passing import in_part
from ..loop.effect import Finding
from ..loop.verdict import FLEXIBLE

SHORTEST = 32   # blocks along which a line is followed at least
SHORTEST_SHARE = 1 / 8  # of the record, along which it is followed at least
LEAST = 6       # cells through which it sweeps at least: what stays is a line or a narrow band
CAP = 8.0       # times the mean power that a cell counts at most
HALVED = 3      # times, a path: each of these parts has to show what all of it does
UNEVEN = 1.42   # standard deviations by which the least of eight normal values is less, on average
LINE, BESIDE, AROUND = 1, 6, 17     # cells to either side of a line and beside it, and blocks
LOUD = 1.3      # times the mean power of those beside, which by chance are four deviations less
NONE = np.zeros(6)


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
    # as many cells in time as in frequency and more: a cell a block is through all of the band
    depth, length = _cells(len(white))
    blocks = 1 << depth
    if blocks < SHORTEST:
        return NONE
    cells = rfft(white[:blocks * length].reshape(blocks, length).astype(np.float32))
    power = np.abs(cells[:, 1:(length + 1) // 2]) ** 2
    # steady lines are not what is looked for, nor what is loud for a moment
    power /= np.mean(power, axis=0)
    power /= np.mean(power, axis=1, keepdims=True)
    power = np.minimum(power, CAP)
    # nor a band that is switched on and off, and what it leaks into: a line has calm beside it
    beside = _beside(power)
    power /= np.where(beside > LOUD, beside, np.float32(1.0))
    up = _along_lines(power, depth)
    down = _along_lines(power[:, ::-1], depth)
    best = NONE
    for turned, found in ((False, up), (True, down)):
        sure, strong, count, window, steps, at = found
        first, last = (power.shape[1] - 1 - k if turned else k for k in (at, at + steps))
        hz = (np.array([first, last]) % power.shape[1] + 1) / (length * dt)
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


def _along_lines(power: np.ndarray, depth: int) -> tuple[float, float, int, int, int, int]:
    """
    Return (sure, strong, blocks, which stretch of so many, steps, cell at its beginning).

    Of lines that rise by a whole number of steps, up to one a block, through cells (blocks, m).
    Sums of w cells exceed x w by chance less often than e^-(w (x - 1 - ln x)), Chernoff's bound;
    of all lines that are looked at once in so many. A sum counts as much as if all of its parts
    were as loud as the least may be: a bound on what is less is one on that too.

    """
    cells, best, parts = power.shape[1], (0.0, 0.0, 1, 0, 0, 0), 1 << HALVED
    # along each line the sum of the cells, and of its halves, quarters, eighths the least sum
    least = [power[:, None, :]] * (HALVED + 1)
    for level in range(1, depth + 1):
        w = 1 << level
        for k in range(HALVED, 0, -1):
            least[k] = _joined(np.minimum, least[k - 1])
        least[0] = _joined(np.add, least[0])
        if w < SHORTEST or w < SHORTEST_SHARE * len(power):
            continue
        sums, chance = least[0], np.float32(UNEVEN * np.sqrt(parts * w))
        counted = np.minimum(sums, parts * least[-1] + chance)[:, LEAST:]
        # a line that would go on at the other end of the band is none
        counted *= np.add.outer(np.arange(LEAST, w), np.arange(cells)) < cells
        window, steps, at = np.unravel_index(int(np.argmax(counted)), counted.shape)
        x = max(1.0, float(counted[window, steps, at]) / w)
        sure = w * (x - 1 - np.log(x)) - np.log(2 * depth * sums.size)
        if sure > best[0]:
            steps += LEAST
            strong = float(sums[window, steps, at]) - w
            best = (sure, strong, w, int(window), int(steps), int(at))
    return best


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
