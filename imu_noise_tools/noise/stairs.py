# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A slow quantity that is read in steps: how it goes on between, and how coarse they are."""

from __future__ import annotations

import numpy as np

STAIRS = 0.05  # share of samples at which a staircase rises or falls


def unrounded(x: np.ndarray) -> np.ndarray:
    """
    Return a slow quantity that was read in coarse steps, (n,), as it may have gone on between.

    It crossed the middle between two levels when the reading changed, and there as fast as the
    crossings before and after it say (a parabola through the three); where it turned back in
    between it went on beyond them, and within its level. Before the first and after the last of
    them it is on a line. What changes all the time is noise that the steps do not hide, and stays
    as it is.

    """
    read, at = _stairs(x)
    if not len(at):
        return x
    from scipy.interpolate import CubicHermiteSpline  # half a second to load

    t, when, crossed = np.arange(len(x)), at - 0.5, 0.5 * (read[at] + read[at - 1])
    half, speed = 0.5 * _step(read, at), np.gradient(crossed, when, edge_order=2)
    line = np.interp(t, np.r_[0, when, len(x) - 1], np.r_[read[0], crossed, read[-1]])
    curve = CubicHermiteSpline(when, crossed, speed)(t)
    curve = np.where((t < when[0]) | (t > when[-1]), line, curve)
    return np.clip(curve, np.minimum(line, read - half), np.maximum(line, read + half))


def step_of(x: np.ndarray) -> float:
    """Return the step in which a slow quantity (n,) was read, 0 where none is seen."""
    read, at = _stairs(x)
    return _step(read, at) if len(at) else 0.0


def _stairs(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """
    Return a quantity (n,) on its levels, and where it is another than before (k,).

    Nowhere where it is no staircase.

    What is read less often than an axis goes from one level to the next on a line, which says
    nothing of how it did: it is on the nearest of those at which it stays most of the time.

    """
    stays, read = np.diff(x) == 0, x
    if np.mean(stays) > 0.5:
        levels = np.unique(x[1:][stays])
        read = levels[np.searchsorted(0.5 * (levels[1:] + levels[:-1]), x)]
    at = np.flatnonzero(np.diff(read) != 0) + 1
    return read, at if 2 < len(at) < STAIRS * len(x) else at[:0]


def _step(read: np.ndarray, at: np.ndarray) -> float:
    """Return how far a staircase (n,) goes at most of the places (k,) where it does."""
    return float(np.median(np.abs(read[at] - read[at - 1])))
