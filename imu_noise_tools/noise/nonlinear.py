# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Whether what a path does next is told by where it is, and not by sums alone.

Of normal noise, whatever its spectrum and however much other normal noise covers it, the best
prediction is a weighted sum of past values: what that misses is independent of them. A chaotic
sway, a path between wells or levels follows a law that is none, and their squares and cubes tell
more (Barahona and Poon, Nature 381, 1996). That needs no heavy tails and few independent values.

"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import combinations_with_replacement

import numpy as np
from scipy.special import chdtrc

from ..core.statistics import independent_squares

PAST = 8        # values that predict the next one by their sum
STATE = 3       # of them whose squares, cubes and products may tell more
FEWEST, MOST = 128, 4096        # values of a time scale that is looked at
INDEPENDENT = 32    # of which as many are: a drift is at one place, and chance there is its own


def follows_a_law(octaves: Iterable[np.ndarray]) -> float:
    """
    Return what speaks against normal noise in how values (n,) follow each other, nats.

    On the one of several scales of time that says most, by the odds of chance, less the logarithm
    of how many are looked at.

    """
    found = [_beyond_sums(y) for y in octaves if FEWEST <= len(y) <= MOST
             and independent_squares(y - np.mean(y)) >= INDEPENDENT]
    return max(found) - float(np.log(len(found))) if found else 0.0


def _beyond_sums(y: np.ndarray) -> float:
    """
    Return the nats by which powers of the last values foretell what their sum does not.

    By a score test that holds though the noise be louder at times (Wooldridge, Journal of
    Econometrics 47, 1991).

    """
    if not np.ptp(y) > 0:
        return 0.0
    y = (y - np.mean(y)) / np.std(y)
    past = np.lib.stride_tricks.sliding_window_view(y, PAST)[:-1, ::-1]
    # values that follow each other are alike: their principal parts are not
    state = np.linalg.svd(past[:, :STATE], full_matrices=False)[0] * np.sqrt(len(past))
    powers = np.column_stack([
        np.prod(state[:, some], axis=1) for degree in (2, 3)
        for some in map(list, combinations_with_replacement(range(STATE), degree))])
    q = np.linalg.qr(np.column_stack([np.ones(len(past)), past]))[0]
    missed, more = y[PAST:] - q @ (q.T @ y[PAST:]), powers - q @ (q.T @ powers)
    u, s, _ = np.linalg.svd(more * missed[:, None], full_matrices=False)
    score = float(np.sum(np.sum(u[:, s > 1e-9 * s[0]], axis=0) ** 2))
    return -float(np.log(max(chdtrc(powers.shape[1], score), 1e-300)))
