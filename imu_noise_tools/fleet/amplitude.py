# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What one record says of an amplitude, in three numbers: the likelihood of its square.

Whether a record shows a value or an upper limit is chance, and so is a value that is shown: who
takes the shown ones as they are takes those that chance made large. So what goes into a population
is the likelihood itself, of p = value^2, as of a level over a background estimated from ``dof``
squares (a shifted chi-square):

    2 ln L(mode) - 2 ln L(p) = dof (ln u + 1/u - 1),   u = 1 + sqrt(2/dof) (p - mode)/std

Its mode may be below zero, where a record has less than its background; ``std`` is its curvature
there. An upper limit L without more is mode 0 and dof infinite: half of a normal density of p, at
whose one-sided 95 % point L^2 is.

"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..core.statistics import ONE_SIDED

Array = NDArray[np.float64]
SQUARE = ('square', 'square_std', 'square_dof')    # the three numbers as columns of a table
SHARP = 0.03        # relative standard error below which a value and its interval say it all
MOST = 1e8          # degrees of freedom: a normal density
FAR = 9.0           # deviance beyond which a profile is not followed
# where a profile's three numbers are looked for: mode and ln std in units of the square of the
# largest value, ln of the dof beyond the least
BOX = np.array([(-8.0, 1.0), (np.log(0.003), np.log(8.0)), (-3.0, 12.0)])
TRIES = 30


def deviance(p: Array, mode: Array, std: Array, dof: Array) -> Array:
    """Return 2 ln L below that of the mode, at squares p >= 0; all arrays, broadcast."""
    with np.errstate(divide='ignore', invalid='ignore', over='ignore'):
        step = np.sqrt(2 / dof) * (p - mode) / std
        u = 1 + step
        # ln u + 1/u - 1, which loses all its digits near u = 1
        exact = np.log(u) - step / u
        near = step**2 * (0.5 - 2 * step / 3)
        out = dof * np.where(np.abs(step) < 1e-4, near, exact)
    return np.where(u > 0, out, np.inf)


def least_dof(mode: Array, std: Array) -> Array:
    """Return the dof of a level without background, the least that a mode and std allow."""
    return np.clip(2 * (np.maximum(mode, 0) / std) ** 2, 1e-3, MOST)


def of_limit(upper95: Array) -> tuple[Array, Array, Array]:
    """Return (mode, std, dof) of 95 % upper limits of which no more is known, each (n,)."""
    return np.zeros(len(upper95)), upper95**2 / ONE_SIDED, np.full(len(upper95), MOST)


def of_profile(points: Sequence[tuple[float, float]]) -> tuple[float, float, float] | None:
    """
    Return (mode, std, dof) of a profile likelihood; None where it holds too little.

    Parameters
    ----------
    points : sequence of (float, float)
        (value, deviance from the most likely value), as in an Estimate.

    """
    some = np.array([(v, d) for v, d in points if np.isfinite(v) and np.isfinite(d)], float)
    if len(some) < 4:
        return None
    top = some[np.argmin(some[:, 1]), 0]
    some = some[(some[:, 1] < FAR) | (some[:, 0] < top)]
    above = some[some[:, 0] > top]
    if not len(above):
        return None
    root = np.sqrt(np.minimum(some[:, 1], FAR))
    unit = float(above[:, 0].max()) ** 2
    p = some[:, 0] ** 2 / unit
    mode, std, dof = _numbers(min((
        _nearest(p, root, np.array([top**2 / unit - less, -0.7, 2.0])) for less in (0.0, 0.5)),
        key=lambda found: found[0])[1])
    return float(mode * unit), float(std * unit), float(dof)


def _numbers(x: Array) -> tuple[Array, Array, Array]:
    """Return mode, std and dof of what is searched: mode, ln std, ln of the dof beyond least."""
    std = np.exp(x[1])
    return x[0], std, np.minimum(least_dof(x[0], std) + np.exp(x[2]), MOST)


def _nearest(p: Array, root: Array, x: Array) -> tuple[float, Array]:
    """Return (misfit, x) of the square roots of deviances (Levenberg and Marquardt)."""
    steps = 1e-4 * np.column_stack([np.zeros(3), np.eye(3)])

    def wrong(x: Array) -> Array:
        mode, std, dof = _numbers(x)
        d = deviance(p[:, None], mode, std, dof) - deviance(np.maximum(mode, 0), mode, std, dof)
        return np.sqrt(np.clip(d, 0, FAR)) - root[:, None]

    now, damping = wrong(x[:, None] + steps), 1e-2
    for _ in range(TRIES):
        slope = (now[:, 1:] - now[:, :1]) / 1e-4
        normal = slope.T @ slope
        move = np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-6),
                               -slope.T @ now[:, 0])
        there = np.clip(x + np.clip(move, -1, 1), *BOX.T)
        then = wrong(there[:, None] + steps)
        gain = np.sum(now[:, 0] ** 2) - np.sum(then[:, 0] ** 2)
        if gain > 0:
            x, now, damping = there, then, damping / 5
            if gain < 1e-6:
                break
        else:
            damping *= 5
    return float(np.sum(now[:, 0] ** 2)), x
