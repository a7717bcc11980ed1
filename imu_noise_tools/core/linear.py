# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Linear algebra where columns may be nothing in a record, or say the same as others."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

TOLD_APART = 1e-6  # of a Gram matrix the smallest of the largest eigenvalue: ten digits are left
SILENT = 1e-280  # of a signal behind a filter: the inverse of what is left is no number


class Solved(NamedTuple):
    """
    What fits x (q, p) beta to white y (q,).

    beta (p,), its covariance (p, p), what is left of y (q,), an orthonormal basis u (q, r) of the
    columns that are told apart, what takes it to them, (p, r): beta = told u' y, and ln |x' x| of
    the columns that are anything: one may be nothing in a record, or in a form.

    """

    beta: np.ndarray
    covariance: np.ndarray
    left: np.ndarray
    basis: np.ndarray
    told: np.ndarray
    log_det: float

    @property
    def leverage(self) -> np.ndarray:
        """The share (q,) of each of y that was solved for."""
        return np.einsum('ij,ij->i', self.basis, self.basis)

    def turned(self, change: np.ndarray, bend: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """
        Return how 1/2 (|y - x beta|^2 + ln |x' x|) turns with what the columns depend on.

        Of first and second derivatives (k, q, p) of the columns by each of k values the gradient
        (k,), beta solved for anew everywhere, and the curvature (k, k) of the square (Golub and
        Pereyra 1973, The differentiation of pseudo-inverses). Where that is none of a minimum, it
        is the part that cannot be anything else (Kaufman 1975).

        """
        moved = change @ self.beta
        inside, crossed = moved @ self.basis, change.transpose(0, 2, 1) @ self.left
        gradient = np.einsum('pr,qr,kqp->k', self.told, self.basis, change, optimize=True) \
            - moved @ self.left
        beside = moved - inside @ self.basis.T
        least = beside @ beside.T
        # with beta as it follows
        follows = crossed @ self.told
        curved = least + inside @ follows.T + follows @ inside.T - follows @ follows.T
        curved -= np.diag((bend @ self.beta) @ self.left)
        return gradient, curved if np.all(np.linalg.eigvalsh(curved) > 0) else least


def least_squares(x: np.ndarray, y: np.ndarray) -> Solved:
    """Return what fits columns x (q, p) to white y (q,)."""
    count, gram = x.shape[1], x.T @ x
    some = np.flatnonzero(np.diag(gram))
    if len(some) < count:
        x, gram = x[:, some], gram[np.ix_(some, some)]
    u, told, log_det = _decomposed(x, gram)
    if len(some) < count:
        every = np.zeros((count, told.shape[1]))
        every[some] = told
        told = every
    inside = y @ u
    return Solved(told @ inside, told @ told.T, y - u @ inside, u, told, log_det)


def _decomposed(x: np.ndarray, gram: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """
    Return an orthonormal basis u (q, r) of columns (q, p), what takes it to them, and ln |x' x|.

    The second is t (p, r): beta = t u' y. What is next to no rank of the columns, each taken to
    length 1, is left out. Where they are well told apart by their Gram matrix, by that: it takes a
    fraction of the time.

    """
    scale = np.sqrt(np.diag(gram))
    values, v = np.linalg.eigh(gram / (scale[:, None] * scale))
    if len(values) and values[0] > TOLD_APART * values[-1]:
        told = v / np.sqrt(values) / scale[:, None]
        u, s = x @ told, np.sqrt(values)
    else:
        u, s, vt = np.linalg.svd(x / scale, full_matrices=False)
        keep = s > 1e-10 * np.max(s, initial=0.0)
        u, s, vt = u[:, keep], s[keep], vt[keep]
        told = vt.T / s / scale[:, None]
    return u, told, 2 * float(np.log(s).sum() + np.log(scale).sum())


def nonnegative(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """
    Return what fits columns x (q, p), none below zero, to y (q,), nothing of it below zero, (p,).

    Each column as large as the others: their units are orders of magnitude apart.

    """
    scale = np.max(x, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    return np.asarray(nnls(x / scale, y)[0] / scale)


def log_size(x: np.ndarray) -> float:
    """Return ln |x' x| of the columns (q, p) that are anything, as :class:`Solved` has it."""
    gram = x.T @ x
    some = np.flatnonzero(np.diag(gram))
    return _decomposed(x[:, some], gram[np.ix_(some, some)])[2]


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
