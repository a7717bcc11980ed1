# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A slow quantity that is read in steps: how it goes on between, and what they hide of it."""

from __future__ import annotations

import numpy as np

FLAT = 0.5      # share of neighbours that are equal, of a staircase
FEWEST = 3      # changes of the reading that make one
SHORT = 1 / 256     # of the record, in which noise takes a reading to and fro


def unrounded(x: np.ndarray) -> np.ndarray:
    """
    Return a slow quantity that was read in coarse steps, (n,), as it may have gone on between.

    It crossed the middle between two levels when the reading changed. A stay that is left the way
    it was entered went from one edge to the other; of one that is left to where it came from, and
    of the first and the last, no more is known than the reading says. What mostly turns back at
    once is noise that the steps do not hide: it stays as it is.

    """
    read, at = _stairs(x)
    edge = 0.5 * (read[at] + read[at - 1])
    if not len(at) or np.mean((np.diff(edge) == 0) & (np.diff(at) < SHORT * len(x))) > 0.5:
        return x
    out = read.copy()
    for i in np.flatnonzero(np.diff(edge)):
        n = at[i + 1] - at[i]
        out[at[i]:at[i + 1]] = edge[i] + (edge[i + 1] - edge[i]) * (np.arange(n) + 0.5) / n
    return out


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
