# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Rivals without a name to what moves a mean by time alone.

In one direction, a power of time since before the record began: creep (Andrade's t^1/3, the
logarithm), what diffuses (the root). With a bend within the record, a cubic. An exponential that
dies out and a parabola are forms of the library, and several of them, of swings and of steps
together imitate any other course. Nothing is named by it.

"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

POWERS = np.array([-4.0, -2.0, -1.2, -0.7, -0.3, 0.01, 0.3, 0.7, 1.2, 2.0, 3.0, 4.0])
BEGUN = np.geomspace(1e-4, 3.0, 14)  # of the record's length, before it
PARAMETERS = 3  # size, power, and since when; or the sizes of three powers
POWER, CUBIC = 'a power of time since before the record', 'a cubic of time'


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
                     root: np.ndarray) -> tuple[float, str]:
    """
    Return half the squares that the best course and other columns leave of block means y (k,).

    And which course that is, in words.

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
    solved = np.linalg.solve(root, np.column_stack([y, others, np.eye(len(y))]))
    z, columns, white = solved[:, 0], solved[:, 1:1 + others.shape[1]], solved[:, -len(y):]
    u = spanned(columns)
    z = z - u @ (u.T @ z)
    cubic = white @ _cubic(t)
    explained = spanned(cubic - u @ (u.T @ cubic)).T @ z
    gain, words = max((_by_a_power(t, z, u, white), POWER),
                      (0.5 * float(explained @ explained), CUBIC))
    return 0.5 * float(z @ z) - gain, words


def spanned(columns: np.ndarray) -> np.ndarray:
    """Return orthonormal columns (k, r) that span what columns (k, p) do."""
    u, s, _ = np.linalg.svd(columns, full_matrices=False)
    return u[:, s > 1e-8 * np.max(s, initial=0.0)]


def _cubic(t: np.ndarray) -> np.ndarray:
    """Return the means (k, 3) of the first three powers of time in blocks about times t (k,)."""
    edges = np.append(t, 2 * t[-1] - t[-2]) - 0.5 * (t[1] - t[0]) - np.mean(t)
    edges = edges / np.max(np.abs(edges))
    x = np.stack([np.diff(edges**(p + 1)) for p in (1, 2, 3)], axis=1)
    x = x / np.diff(edges)[:, None]
    return x - np.mean(x, axis=0)


def _by_a_power(t: np.ndarray, z: np.ndarray, u: np.ndarray, white: np.ndarray) -> float:
    """
    Return the nats that a power of time gains.

    Of white means z (k,) beside orthonormal columns u (k, p); ``white`` (k, k) makes means white.

    """
    span = t[-1] - t[0]

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
    return -float(found.fun)     # no less than that of where it began
