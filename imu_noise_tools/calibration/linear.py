# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The equations of a calibration: linear, of unit variance, grouped by pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import null_space

from . import faces
from .effects import BASE, Regressor, Scatter, Tilt
from .poses import Poses, unit
from ..core.errors import FitError
from ..loop.effect import Model

DIVERGES = 'the fit diverges', 'add poses in other directions'
_SMALL = 1e-8       # relative: a direction the poses do not determine
# set to zero where only the magnitude of the input is known
GAUGE = ('S_yx', 'S_zx', 'S_zy')
#: methods that use the magnitude of the input alone
MAGNITUDES = ('norm', 'few')
#: rms of the angle between two axes before poses speak of it, rad: right to 2 deg, uniformly
SKEW = np.radians(2.0) / np.sqrt(3)


@dataclass(frozen=True)
class Equations:
    """
    matrix @ theta = right, with independent errors of variance one.

    Parameters
    ----------
    matrix : ndarray (N, m)
        One column a coefficient.
    right : ndarray (N,)
        Whitened outputs.
    pose : ndarray (N,)
        To which pose an equation belongs; -1, in front, for what was known before.
    keys : tuple of (label, parameter)
        What the coefficients are.
    whitener : ndarray (n, r, 3), or list of (r, 3)
        What turns the three outputs of a pose into its r equations: 3, or 1 where only the
        magnitude is known; of a turn between rests 2.

    """

    matrix: np.ndarray
    right: np.ndarray
    pose: np.ndarray
    keys: tuple[tuple[str, str], ...]
    whitener: Any

    @cached_property
    def _decomposed(self):
        with np.errstate(over='ignore'):
            size = np.linalg.norm(self.matrix, axis=0)
        if not np.isfinite(size).all():
            raise FitError(*DIVERGES)
        size = np.where(size > 0, size, 1.0)
        u, s, vt = np.linalg.svd(self.matrix / size, full_matrices=False)
        keep = s > _SMALL * s[0]
        return u[:, keep], s[keep], vt, keep, size

    @property
    def basis(self) -> np.ndarray:
        """Orthonormal basis of what the coefficients explain, (N, rank)."""
        return self._decomposed[0]

    @property
    def rank(self) -> int:
        """Number of combinations of coefficients that the poses determine."""
        return self._decomposed[0].shape[1]

    @property
    def dof(self) -> int:
        """Equations left over."""
        return len(self.right) - self.rank

    @property
    def condition(self) -> float:
        """Condition number of the matrix with its columns scaled to length one."""
        s = self._decomposed[1]
        return float(s[0] / s[-1]) if self.rank == self.matrix.shape[1] else float('inf')

    @cached_property
    def theta(self) -> np.ndarray:
        """
        Least-squares coefficients; the smallest where they are not determined.

        What an added effect shares with the base model (cubic with scale, in six faces) stays in
        the base.

        """
        u, s, vt, keep, size = self._decomposed
        scaled = vt[keep].T @ (u.T @ self.right / s)
        added = np.array([label not in BASE for label, _ in self.keys])
        if added.any() and not keep.all():
            shared = self.undetermined * size[:, None]
            # columns of ``shared`` have length one: to touch the added ones by less is rounding
            u, s, vt = np.linalg.svd(shared[added], full_matrices=False)
            felt = s > 1e-6
            move = vt[felt].T @ ((u.T @ scaled[added])[felt] / s[felt])
            scaled = scaled - shared @ move
        return scaled / size

    @cached_property
    def cov(self) -> np.ndarray:
        """Covariance of the coefficients (m, m), of their determined part."""
        _, s, vt, keep, size = self._decomposed
        half = vt[keep].T / s / size[:, None]
        return half @ half.T

    @cached_property
    def undetermined(self) -> np.ndarray:
        """Basis of what the poses say nothing about, (m, k)."""
        size = self._decomposed[4]
        return null_space(self.matrix / size, rcond=_SMALL) / size[:, None]

    @cached_property
    def determined(self) -> np.ndarray:
        """Whether each coefficient is determined by itself, (m,)."""
        _, _, vt, keep, _ = self._decomposed
        return (vt[keep] ** 2).sum(0) > 1 - 1e-6

    @cached_property
    def residual(self) -> np.ndarray:
        """Right side minus matrix times coefficients, (N,)."""
        u = self._decomposed[0]
        return self.right - u @ (u.T @ self.right)

    @property
    def chi2(self) -> float:
        """Sum of squared residuals: chi-squared with ``dof`` degrees of freedom."""
        return float(self.residual @ self.residual)

    def log_restricted(self, log_det: float) -> float:
        """Return the restricted log-likelihood; log_det: of the covariance whitened away."""
        _, s, _, _, size = self._decomposed
        return -0.5 * (self.chi2 + log_det + 2 * np.log(s).sum() + 2 * np.log(size).sum())

    def _added(self, columns: np.ndarray) -> np.ndarray:
        """Return columns (N, k) beside the equations, scaled to length one, without empty ones."""
        before = np.zeros((len(self.right) - len(columns), columns.shape[1]))
        columns = np.vstack([before, columns])
        size = np.linalg.norm(columns, axis=0)
        return columns[:, size > 0] / size[size > 0]

    def gain(self, columns: np.ndarray) -> tuple[float, int]:
        """
        Return what adding columns (N, k) gains, in nats, and how many of them say something new.

        Twice the gain is chi-squared with that many degrees of freedom where they are not there.

        """
        u, columns = self._decomposed[0], self._added(columns)
        fresh = columns - u @ (u.T @ columns)
        if not fresh.size:
            return 0.0, 0
        v, s, _ = np.linalg.svd(fresh, full_matrices=False)
        v = v[:, s > 1e-6]
        return float(0.5 * np.sum((v.T @ self.residual) ** 2)), v.shape[1]

    def inflation(self, columns: np.ndarray) -> np.ndarray:
        """
        Return how many times as uncertain each coefficient is with columns (N, k) added, (m,).

        By the covariance of a partitioned least squares; what is the same as others is left out.

        """
        u, s, vt, keep, size = self._decomposed
        columns = self._added(columns)
        shared = vt[keep].T @ (u.T @ columns / s[:, None]) / size[:, None]
        _, fresh, w = np.linalg.svd(columns - u @ (u.T @ columns), full_matrices=False)
        told = fresh > 1e-6
        more = np.sum((shared @ w[told].T / fresh[told]) ** 2, axis=1)
        own = np.diag(self.cov)
        return np.sqrt(1 + more / np.where(own > 0, own, np.inf))

    def left_of_noise(self) -> np.ndarray:
        """
        Return which part of its variance the residual of each pose keeps, (n,).

        It is that of what is known best of a pose, as its magnitude is where it may be tilted. 0
        where the coefficients meet it whatever it is.

        """
        u = self._decomposed[0]
        best = [np.linalg.svd(w)[0][:, 0] for w in self.whitener]
        return np.array([1 - np.sum((v @ u[self.pose == k]) ** 2) for k, v in enumerate(best)])

    def left_out(self) -> LeftOut:
        """Return how well each pose is predicted by all the others (closed form, by leverage)."""
        u = self._decomposed[0]
        error, vectors, inverse = [], [], []
        for k in range(self.pose[-1] + 1):
            mine = self.pose == k
            value, vector = np.linalg.eigh(np.eye(mine.sum()) - u[mine] @ u[mine].T)
            keep = value > 1e-6                # leverage one: no other pose speaks of it
            vectors.append(vector[:, keep])
            inverse.append(1 / value[keep])
            error.append(inverse[-1] * (vector[:, keep].T @ self.residual[mine]))
        return LeftOut(error, vectors, inverse, self)


@dataclass(frozen=True)
class LeftOut:
    """
    Each pose predicted by the others, in the whitened directions in which they can.

    ``error[k]`` in the basis ``vectors[k]`` has variances ``variance[k]`` under a true model.

    """

    error: list[np.ndarray]
    vectors: list[np.ndarray]
    variance: list[np.ndarray]
    equations: Equations

    @property
    def x(self) -> np.ndarray:
        """Squared error over variance, (n,): chi-squared with ``bins`` degrees of freedom."""
        return np.array([float(np.sum(e ** 2 / v)) for e, v in zip(self.error, self.variance)])

    @property
    def bins(self) -> np.ndarray:
        """Number of directions in which each pose is predicted, (n,)."""
        return np.array([len(v) for v in self.variance])

    @property
    def pulls(self) -> np.ndarray:
        """Errors over their standard deviations, (k,): standard normal under a true model."""
        return np.concatenate([e / np.sqrt(v) for e, v in zip(self.error, self.variance)])

    @property
    def excess_std(self) -> float:
        """Chance scatter of the mean squared pull, its correlations included."""
        u = self.equations._decomposed[0]
        block = np.zeros((len(u), len(u)))
        for k, (vector, value) in enumerate(zip(self.vectors, self.variance)):
            mine = np.flatnonzero(self.equations.pose == k)
            block[np.ix_(mine, mine)] = (vector * value) @ vector.T
        project = np.eye(len(u)) - u @ u.T
        quadratic = project @ block @ project
        return float(np.sqrt(2 * np.sum(quadratic ** 2)) / max(1, self.bins.sum()))

    def outputs(self) -> np.ndarray:
        """Errors in units of the output, (n, 3), as far as they are predicted."""
        return np.array([np.linalg.pinv(w) @ (vector @ e) for w, vector, e in
                         zip(self.equations.whitener, self.vectors, self.error)])


def keys_of(model: Model, free_direction: bool) -> tuple[tuple[str, str], ...]:
    """Return the (label, parameter) of every linear coefficient that is to be fitted."""
    return tuple((e.label, p.name) for e in model.of(Regressor) for p in e.coefficients
                 if not (free_direction and e.name == 'cross_axis' and p.name in GAUGE))


def elements(keys: Sequence[tuple[str, str]]) -> list[tuple[int, int, int]]:
    """Return (column, i, j) of every S_ij among coefficients."""
    return [(k, 'xyz'.index(name[-2]), 'xyz'.index(name[-1])) for k, (label, name)
            in enumerate(keys) if label in ('scale', 'cross_axis')]


def terms_of(model: Model, poses: Poses, scale: np.ndarray, free_direction: bool) -> np.ndarray:
    """Return the columns of every coefficient of :func:`keys_of`, (3, n, m)."""
    parts = []
    for e in model.of(Regressor):
        keep = [k for k, p in enumerate(e.coefficients)
                if not (free_direction and e.name == 'cross_axis' and p.name in GAUGE)]
        parts.append(e.terms(poses, scale)[:, :, keep])
    return np.concatenate(parts, axis=2)


def tilt_of(model: Model, stated: float) -> float:
    """Return the tilt of the faces, rad: of the model where it holds one, else what is stated."""
    return next((e.amplitude for e in model.of(Scatter) if e.tilts), stated)


def covariance(model: Model, poses: Poses, scale: np.ndarray, tilt: float,
               method: str) -> np.ndarray:
    """
    Return the covariance of each pose's outputs, (n, 3, 3): noise, tilt and the model's scatter.

    ``tilt`` (rad) is the stated one; one in the model stands in its place.

    """
    cov = np.zeros((poses.n, 3, 3))
    cov[:, range(3), range(3)] = poses.std.T ** 2
    scatter = model.of(Scatter)
    if method == 'faces':
        cov += faces.covariance(poses, scale, tilt)
        scatter = [e for e in scatter if not e.tilts]
    elif method not in MAGNITUDES and tilt > 0 and not any(e.tilts for e in scatter):
        cov += Tilt().covariance(poses, scale, tilt)
    for e in scatter:
        cov += e.covariance(poses, scale, e.amplitude)
    return cov


def whitener_of(
    poses: Poses, cov: np.ndarray, scale: np.ndarray, free_direction: bool
) -> tuple[np.ndarray, float]:
    """
    Return the whitener (n, r, 3) and the log-determinant of what it takes away.

    Of covariances (n, 3, 3) around scale (3, 3); raise FitError where these are none.

    """
    if free_direction:
        # gradient of |S^-1 (o - b)|
        w = np.linalg.solve(scale.T, unit(poses.inputs)).T
        variance = np.einsum('ni,nij,nj->n', w, cov, w)
        return (w / np.sqrt(variance)[:, None])[:, None, :], float(np.log(variance).sum())
    try:
        lower = np.linalg.cholesky(cov)
    except np.linalg.LinAlgError:       # of a scale that has gone astray
        raise FitError(*DIVERGES) from None
    log_det = 2 * np.log(np.diagonal(lower, axis1=1, axis2=2)).sum()
    return np.linalg.inv(lower), float(log_det)


def whitened(whitener: np.ndarray, terms: np.ndarray) -> np.ndarray:
    """Return terms (3, n, k) as rows of equations, (n r, k)."""
    rows = np.einsum('nri,ink->nrk', whitener, terms)
    return rows.reshape(-1, terms.shape[2])


def _square_axes(keys: Sequence[tuple[str, str]], scale: np.ndarray) -> np.ndarray:
    """Return rows of variance one and zero that hold axes square to within SKEW, (k, m)."""
    across = [column for column, i, j in elements(keys) if i != j]
    return np.eye(len(keys))[across] / (SKEW * np.abs(np.linalg.det(scale)) ** (1 / 3))


def equations(model: Model, poses: Poses, scale: np.ndarray, tilt: float, method: str,
              before: bool = True, cross: float = faces.CROSS) -> tuple[Equations, float]:
    """
    Return the whitened equations around S = scale (3, 3), and the log-determinant taken away.

    ``before`` puts what is known without any pose in front, where the method knows something: for
    faces, that cross-axis terms are of rms ``cross``.

    """
    free = method in MAGNITUDES
    cov = covariance(model, poses, scale, tilt, method)
    whitener, log_det = whitener_of(poses, cov, scale, free)
    matrix = whitened(whitener, terms_of(model, poses, scale, free))
    outputs, keys = poses.outputs, keys_of(model, free)
    if method == 'faces':
        outputs = outputs - faces.offset(poses, scale)
    right = np.einsum('nri,in->nr', whitener, outputs).ravel()
    pose = np.repeat(np.arange(poses.n), whitener.shape[1])
    if method in ('faces', 'few') and before:
        rows = faces.prior(elements(keys), scale, len(keys), cross) if method == 'faces' else (
            _square_axes(keys, scale))
        matrix = np.vstack([rows, matrix])
        right, pose = np.r_[np.zeros(len(rows)), right], np.r_[np.full(len(rows), -1), pose]
    return Equations(matrix, right, pose, keys, whitener), log_det
