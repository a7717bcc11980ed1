# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Linear algebra where columns may be nothing in a record, or say the same as others."""

from __future__ import annotations

import numpy as np

SILENT = 1e-280  # of a signal behind a filter: the inverse of what is left is no number


def least_squares(x: np.ndarray, y: np.ndarray) -> tuple[
        np.ndarray, np.ndarray, np.ndarray, float]:
    """
    Return what fits x (q, p) beta to white y (q,): beta, its covariance, and the leverage (q,).

    And ln |x' x| of the columns that are anything: one may be nothing in a record, or in a form.

    """
    scale = np.sqrt(np.sum(x**2, axis=0))
    some = np.flatnonzero(scale)
    x, scale, beta = x[:, some], scale[some], np.zeros(len(scale))
    covariance = np.zeros((len(beta), len(beta)))
    u, s, vt = np.linalg.svd(x / scale, full_matrices=False)
    keep = s > 1e-10 * np.max(s, initial=0.0)
    u, s, vt = u[:, keep], s[keep], vt[keep]
    beta[some] = (vt.T @ ((u.T @ y) / s)) / scale
    covariance[np.ix_(some, some)] = (vt.T / s**2) @ vt / np.outer(scale, scale)
    log_det = 2 * float(np.sum(np.log(s))) + 2 * float(np.sum(np.log(scale)))
    return beta, covariance, np.sum(u**2, axis=1), log_det


def inverse(gram: np.ndarray) -> np.ndarray:
    """Return the inverse of a Gram matrix (p, p), of what it says nothing about zero."""
    power = np.diag(gram)
    # of a silent signal eigenvectors hold what rounding leaves, which no scale may enlarge
    unit = np.where(power > SILENT, 1 / np.sqrt(np.where(power > SILENT, power, 1.0)), 0.0)
    values, axes = np.linalg.eigh(gram * np.outer(unit, unit))
    some = values > 1e-12 * max(values[-1], 1e-300)
    axes = axes[:, some] * unit[:, None]
    return (axes / values[some]) @ axes.T


def inverse_of(x: np.ndarray) -> np.ndarray:
    """
    Return what takes y (q,) to what fits columns x (q, p) to it, (p, q).

    By the Gram matrix: for columns that are told apart or say the same, it takes a fifth of the
    time of a factorisation of x.

    """
    return inverse(x.T @ x) @ x.T
