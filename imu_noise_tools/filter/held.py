# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Held samples: a whole message that repeats the one before, of a sensor read faster than it samples.

In a record that moves, most equal neighbours are equal by rounding: at rest, at the turning points
of a sway. All three rates repeat there too, but not while one of them changes by many steps.

"""

from __future__ import annotations

import numpy as np

REMEDY = 'read the sensor at its own rate, on its data-ready interrupt'
BLOCK = 128             # samples in which it is asked how fast the rates change
LEAST_BLOCKS = 5        # in which they change fast: fewer tell nothing
FAST = 3.0              # steps between neighbours, in the median: rounding makes 9 % of them equal
MORE = 0.02             # share of messages that rounding is not asked to explain


def held_samples(z: np.ndarray) -> np.ndarray | None:
    """
    Return which of the rates z (n, axes) repeat those before them, (n,); None: they are not held.

    They are where, in most of the blocks in which some axis changes fast, more messages repeat
    than twice what rounding makes of that axis alone: of normal differences whose median size is k
    steps, 0.27/k are rounded to zero. The step is read from the small differences, since a grid
    may be hidden by the rounding of the numbers it is kept in.

    """
    d = np.abs(np.diff(np.asarray(z, float), axis=0))
    again = np.concatenate([[False], (d == 0).all(axis=1)])
    count = len(d) // BLOCK
    if not again.any() or count < LEAST_BLOCKS:
        return None
    step = np.array([np.quantile(x[x > 0], 0.05) if (x > 0).any() else np.inf for x in d.T])
    blocks = np.sort(np.where(d > 0, d, np.inf)[:count * BLOCK].reshape(count, BLOCK, -1), axis=1)
    some = np.isfinite(blocks).sum(axis=1)
    size = np.take_along_axis(blocks, np.maximum(some - 1, 0)[:, None] // 2, axis=1)[:, 0]
    size = np.max(np.where(some > 0, size, 0.0) / step, axis=1)
    fast = size >= FAST
    if np.count_nonzero(fast) < LEAST_BLOCKS:
        return None
    share = again[1:][:count * BLOCK].reshape(count, BLOCK).mean(axis=1)
    return again if np.median(share[fast] - 2 * 0.27 / size[fast]) > MORE else None
