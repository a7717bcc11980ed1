# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A line that begins, or ends, within a record: a machine that was switched on or off.

In the stretch in which it is there it keeps frequency, amplitude and phase. In the cosine
coefficients of the whole record it is spread over as many as the stretch is shorter.

"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..core.spectrum import line_basis
from ..loop.verdict import DIRECTED

SCAN_BLOCKS = 64    # of the record, by which a stretch is first looked for
SHORTEST = 2    # of them for which it is looked for at least, and it may last half as long
WIDE = 128      # coefficients on either side of it that tell it
WIDEST = 1 << 14    # and of a strong one, whose edges leak far
OFF = np.arange(-8, 8.1, 0.25)      # of 1/T, by which its frequency may be off its highest
GRID = np.linspace(-1, 1, 9)        # places at which an edge is looked for more closely,
CLOSER = 3.0                        # and by how much closer they are in the next round
BESIDE = np.arange(2, 10)           # 1/its duration from it, where the noise beside it is told


class Passing(NamedTuple):
    """A line in samples [begin, end): frequency Hz, a, b of a cos + b sin, twice its nats."""

    frequency: float
    a: float
    b: float
    height: float
    begin: int
    end: int


def in_part(lines: np.ndarray, n: int) -> np.ndarray:
    """Tell which of some lines, (l, 6), are there in a part of n samples only, (l,) bool."""
    return lines[:, 5] - lines[:, 4] < n


def shortest(n: int) -> int:
    """Return how many samples it lasts at least: one that is as short may be shorter."""
    return SHORTEST * n // (2 * SCAN_BLOCKS)


def searched() -> float:
    """Return the nats that chance gains by all stretches that are looked at."""
    return float(np.log(SCAN_BLOCKS * (SCAN_BLOCKS - SHORTEST) / 2))


def likeliest(frequency: float, c: np.ndarray, reference: np.ndarray, dt: float) -> Passing:
    """
    Return the line of a stretch that explains most near a frequency.

    Parameters
    ----------
    frequency : float
        At which coefficients stand out, Hz.
    c : ndarray (n,)
        Cosine coefficients.
    reference : ndarray (n - 1,)
        Smooth one-sided PSD at each coefficient k >= 1.
    dt : float
        Interval, s.

    """
    return _closer(_roughly(frequency, c, reference, dt), c, reference, dt, WIDE)


def refined(line: Passing, c: np.ndarray, reference: np.ndarray, dt: float) -> Passing:
    """Return it from as many coefficients as its edges show in."""
    wide = int(min(WIDEST, WIDE + 40 * np.sqrt(line.height)))
    return _closer(line, c, reference, dt, wide) if wide > WIDE else line


def louder(line: Passing, c: np.ndarray, reference: np.ndarray, dt: float) -> float:
    """
    Return how many times as strong the noise beside a line is in its stretch as on the whole.

    Once it is taken out of the coefficients. What is switched on with it, a resonance say, makes
    lines by chance that nothing makes where the level of the whole record holds. At least one.

    """
    n, cell = len(c), 1 / ((line.end - line.begin) * dt)
    wide = int(WIDE + 2 * BESIDE[-1] * n * dt * cell)
    k, root, y = _some(line.frequency, c, reference, dt, wide)
    f = line.frequency + cell * np.concatenate([-BESIDE, BESIDE])[:, None]
    f = np.clip(f, 1 / (n * dt), 0.5 / dt - 1 / (n * dt))
    energy = projected(root * line_basis(f, k, n, dt, line.begin, line.end), y)[0]
    return max(float(np.median(energy)) / (2 * np.log(2)), 1.0)


def _some(frequency: float, c: np.ndarray, reference: np.ndarray, dt: float,
          wide: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return coefficients k on both sides of a frequency, their roots of weight, both weighed."""
    middle = int(2 * len(c) * dt * frequency)
    k = np.arange(max(1, middle - wide), min(len(c), middle + wide + 1))
    root = np.sqrt(2 * dt / reference[k - 1])
    return k, root, root * c[k]


def _roughly(frequency: float, c, reference, dt: float) -> Passing:
    """Return the likeliest stretch of whole blocks, from sums over the blocks before it."""
    n = len(c)
    k, root, y = _some(frequency, c, reference, dt, WIDE)
    ends = np.linspace(0, n, SCAN_BLOCKS + 1).astype(int)
    until = root * line_basis(frequency, k, n, dt, 0, ends[1:, None])
    block = np.diff(until.conj() @ y, prepend=0.0)
    middle = 0.5 * (ends[1:] + ends[:-1]) / n
    turned = block * np.exp(-2j * np.pi * OFF[:, None] * middle)
    total = np.concatenate([np.zeros((len(OFF), 1)), np.cumsum(turned, axis=1)], axis=1)
    i, j = np.triu_indices(SCAN_BLOCKS + 1, SHORTEST)
    energy = np.abs(total[:, j] - total[:, i]) ** 2 / (ends[j] - ends[i])
    off, best = np.unravel_index(int(np.argmax(energy)), energy.shape)
    return Passing(float(frequency + OFF[off] / (n * dt)), 0.0, 0.0, 0.0,
                   int(ends[i[best]]), int(ends[j[best]]))


def _closer(line: Passing, c, reference, dt: float, wide: int) -> Passing:
    """Return it where frequency, beginning and end, moved in turn, explain most."""
    n = len(c)
    k, root, y = _some(line.frequency, c, reference, dt, wide)

    def best(f, begin, end):
        """Return the line of those (places, 1) that explains most."""
        f, begin, end = np.broadcast_arrays(f, begin, end)
        energy, a, b = projected(root * line_basis(f, k, n, dt, begin, end), y)
        i = int(np.argmax(energy))
        return Passing(float(f[i, 0]), float(a[i]), float(b[i]), float(energy[i]),
                       int(begin[i, 0]), int(end[i, 0]))

    least = shortest(n)
    edge, cell = n / SCAN_BLOCKS, 0.25 / (n * dt)
    while edge > 0.3:
        f, _, _, _, begin, end = line
        line = best(f + cell * GRID[:, None], begin, end)
        moved = np.round(edge * GRID[:, None]).astype(int)
        line = best(line.frequency, np.clip(begin + moved, 0, end - least), end)
        line = best(line.frequency, line.begin, np.clip(end + moved, line.begin + least, n))
        edge, cell = edge / CLOSER, cell / CLOSER
    for whole in (line._replace(begin=0), line._replace(end=n)):
        there = best(whole.frequency, np.array([[whole.begin]]), whole.end)
        if there.height > line.height - 2 * DIRECTED:
            line = there
    return line


def projected(wave: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (energy, a, b) of y on the real and imaginary part of each row of waves."""
    p, q = wave.real, wave.imag
    pp, qq, pq = (np.sum(u * v, axis=1) for u, v in ((p, p), (q, q), (p, q)))
    py, qy = p @ y, q @ y
    # one coefficient of no level, of samples without noise, may weigh more than all others
    det = np.maximum(pp * qq - pq * pq, 1e-12 * pp * qq + 1e-300)
    a, b = (qq * py - pq * qy) / det, (pp * qy - pq * py) / det
    return a * py + b * qy, a, b
