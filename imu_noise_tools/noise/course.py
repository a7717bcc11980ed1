# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A rival without a name to what moves a mean in one direction.

A power of time since before the record began: creep (Andrade's t^1/3, the logarithm), what
diffuses (the root), a cube. An exponential that dies out and a parabola are forms of the library,
and several of them and of steps together imitate any other course. Nothing is named by it.

"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

POWERS = np.array([-4.0, -2.0, -1.2, -0.7, -0.3, 0.01, 0.3, 0.7, 1.2, 2.0, 3.0, 4.0])
BEGUN = np.geomspace(1e-4, 3.0, 14)  # of the record's length, before it
PARAMETERS = 3  # size, power, and since when


def course(t: np.ndarray, power: float, since: float) -> np.ndarray:
    """
    Return the means (k,) of (1 + t/since)^power in equal blocks about some times.

    Parameters
    ----------
    t : ndarray (k,)
        Middle of each block, s, the first from 0 on.
    power : float
        Neither 0 nor -1; near 0 it is the logarithm.
    since : float
        How long before the record it began, s.

    """
    half = 0.5 * (t[1] - t[0])
    # about the first of them, or a logarithm would be a small part of a constant
    begin, end = ((1 + np.maximum(t + x - t[0] + half, 0) / since) ** (power + 1)
                  for x in (-half, half))
    out = (end - begin) * since / (power + 1)
    return out - np.mean(out)


def left_by_a_course(t: np.ndarray, y: np.ndarray, others: np.ndarray,
                     root: np.ndarray) -> float:
    """
    Return half the squares that the best course and other columns leave of block means y (k,).

    Parameters
    ----------
    t : ndarray (k,)
        Middle of each block, s.
    y : ndarray (k,)
        Means.
    others : ndarray (k, p)
        What else they follow.
    root : ndarray (k, k)
        Of the covariance of the means, the lower one.

    """
    span = t[-1] - t[0]
    solved = np.linalg.solve(root, np.column_stack([y, others, np.eye(len(y))]))
    z, columns, white = solved[:, 0], solved[:, 1:1 + others.shape[1]], solved[:, -len(y):]
    u, s, _ = np.linalg.svd(columns, full_matrices=False)
    u = u[:, s > 1e-8 * s[0]]
    z = z - u @ (u.T @ z)

    def gain(x):
        with np.errstate(over='ignore', invalid='ignore'):
            c = course(t, x[0], span * np.exp(x[1]))
            c = white @ (c / np.max(np.abs(c)))
        c = c - u @ (u.T @ c)
        size = float(c @ c)
        return 0.5 * float(c @ z) ** 2 / size if np.isfinite(size) and size > 1e-12 else 0.0

    best = max(((p, float(np.log(b))) for p in POWERS for b in BEGUN), key=gain)
    found = minimize(lambda x: -gain(x), best, method='Nelder-Mead',
                     options={'maxfev': 120, 'xatol': 1e-3, 'fatol': 1e-2})
    return 0.5 * float(z @ z) + float(found.fun)     # no more than that of where it began
