# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Faces without a level: each pose has a tilt of its own, whose size is estimated along with S.

What the poses say is split by what tilt does to it. Along the input found, a reading is
|S^-1 (o - b)| = g whatever the tilt; across it, it is the tilt, a random angle of rms theta about
the nominal direction, plus the cross-axis terms. Both are one weighted least squares (errors in
the variables, directions as nuisances): theta -> 0 is the plain six-position fit, theta ->
infinity the norm fit. Theta is what lateral readings scatter by beyond noise and cross-axis terms;
they are weighed, and intervals stated, as if it were larger, by Student's t with its degrees of
freedom.

A tilted face feels in its magnitude that axes are not orthogonal, and six faces say little of it:
S_ij + S_ji, from what i and j read across, has an error of rms theta, the mean of tilts. That is
1.7 % at one degree, where terms within 1 % and 3 % make .8 and 2.4 %, and three such sums do not
tell which it is. So values take the size that data sheets state (:data:`CROSS`) and intervals that
of poor sensors (:data:`POOR`), until poses say otherwise.
A rotation common to all faces is mounting or tilt; as much of it is kept as the poses speak of.

"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import expit, gammaln, stdtrit

from .poses import aims, DIRECTIONS, Poses, unit
from ..core.statistics import TWO_SIDED

#: rms of a cross-axis term before it is measured: within 1 %, as data sheets state it, uniformly
CROSS = 0.01 / np.sqrt(3)
#: the same of a poor sensor, which intervals allow for: within 3 %
POOR = 0.03 / np.sqrt(3)
LEAST = 1e-5            # rad: no face is better than that
ANY = 0.2               # rad: a pose that is called a face by its nearness alone
#: rms of a rotation of the case before faces speak of it, rad: any
MOUNTING = 0.5
_PAIRS = ((0, 1), (0, 2), (1, 2))
_PLANES = ((1, 2), (2, 0), (0, 1))       # that a rotation about each axis turns
_FREE = 10.0            # rad, for a pose that is no face: any direction


def covariance(poses: Poses, scale: np.ndarray, theta: float) -> np.ndarray:
    """Return what tilts of rms theta (rad) about the inputs found do to outputs, (n, 3, 3)."""
    spread = np.where(np.isfinite(aims(poses.names)[0]), theta, _FREE)
    return spread[:, None, None] ** 2 * _across(poses, scale)


def _across(poses, scale):
    """Return (m S) (1 - u u') (m S)', (n, 3, 3): the outputs' change by a tilt of one radian."""
    u = unit(poses.inputs)
    half = poses.magnitude * (scale - np.einsum('ij,jn,kn->nik', scale, u, u))
    return half @ half.transpose(0, 2, 1)


def offset(poses: Poses, scale: np.ndarray) -> np.ndarray:
    """Return what the outputs would change if each input found were on its face, (3, n)."""
    u, aim = unit(poses.inputs), aims(poses.names)
    lateral = aim - u * np.sum(aim * u, axis=0)
    return poses.magnitude * scale @ np.where(np.isfinite(aim), lateral, 0.0)


def prior(elements: Sequence[tuple[int, int, int]], scale: np.ndarray, m: int, cross: float
          ) -> np.ndarray:
    """
    Return rows that hold axes orthogonal to within ``cross`` and the case to MOUNTING, (6, m).

    They are of unit variance and zero; ``elements`` are (column, i, j) of the S_ij among the m
    coefficients.

    """
    _, turn = polar(scale)
    size = np.abs(np.linalg.det(scale)) ** (1 / 3)
    rows = np.zeros((6, m))
    for column, i, j in elements:
        change = np.zeros((3, 3))
        change[i] = turn[:, j]              # of S turn', by S_ij
        rows[:3, column] = [(change[a, b] + change[b, a]) / (np.sqrt(2) * cross * size)
                            for a, b in _PAIRS]
        if i != j:
            rows[3 + _PAIRS.index((min(i, j), max(i, j))), column] = (j - i) / abs(j - i) / (
                2 * MOUNTING * size)
    return rows


def polar(scale: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (K, R), S = K R: symmetric scale and skew of the axes, and rotation of the case."""
    u, s, vt = np.linalg.svd(scale)
    turn = u @ vt
    if np.linalg.det(turn) < 0:
        return scale, np.eye(3)
    return (u * s) @ u.T, turn


def tilt_found(poses: Poses, scale: np.ndarray, bias: np.ndarray) -> tuple[float, int]:
    """
    Return (theta in rad, degrees of freedom) of faces, with S and b of the axis-aligned ellipsoid.

    Where no face says more than the cross-axis terms that it is needed for, any tilt is expected.

    """
    x = (poses.outputs - bias[:, None]) / np.diag(scale)[:, None] / poses.magnitude
    noise = poses.std / np.diag(scale)[:, None] / poses.magnitude
    found: dict[tuple[int, int], list[float]] = {}
    variance = []
    for k, name in enumerate(poses.names):
        for i in range(3) if name in DIRECTIONS else ():
            j = 'xyz'.index(name[1])
            if i != j:
                found.setdefault((i, j), []).append(DIRECTIONS[name][j] * x[i, k])
                variance.append(noise[i, k] ** 2)
    dof = sum(len(v) - 1 for v in found.values())
    if dof < 1:
        return ANY, 0
    scatter = sum(np.var(v) * len(v) for v in found.values()) / dof
    return float(np.sqrt(max(scatter - np.mean(variance), LEAST ** 2))), dof


def wider(dof: int | None) -> float:
    """Return by how much Student's t is wider than the normal distribution, in variance."""
    return float((stdtrit(dof, 0.975) / TWO_SIDED) ** 2) if dof else 1.0


def settled(scale: np.ndarray, cov: np.ndarray, dof: int | None) -> tuple[np.ndarray, np.ndarray]:
    """
    Return (turn, cov): what to multiply S by from the right, and the covariance after it.

    S = K R is left with as much of R as the poses speak of (:func:`_kept`); the rest of it is the
    chance that the tilts of the faces make it. ``cov`` is that of the nine elements of S, row by
    row; the tilt was found with ``dof`` degrees of freedom (None: it was known, 0: it may be any).
    A scale factor feels the square of the rotation kept, which is neither certain nor tilt, skew
    times what of the rotation is not known, and 3/2 of the square of what of the skew is not: o_i
    = S_ii (1 - t^2 / 2) + S_ij t, where the tilt t is o_j - S_ji.

    """
    k, r = polar(scale)
    to_k = np.kron(np.eye(3), r)        # elements of S r', row by row, from those of S
    of_k = to_k @ cov @ to_k.T
    size = np.abs(np.linalg.det(scale)) ** (1 / 3)
    odd = np.zeros((3, 9))
    for row, (i, j) in enumerate(_PLANES):
        odd[row, 3 * i + j], odd[row, 3 * j + i] = -0.5 / size, 0.5 / size
    angle = Rotation.from_matrix(r).as_rotvec()
    turned, kept, error = _kept(angle, odd @ of_k @ odd.T, dof)
    keep = Rotation.from_rotvec(kept).as_matrix()
    to_s = np.kron(np.eye(3), keep.T)
    out = to_s @ of_k @ to_s.T

    def lost(v):
        return (v @ v - v ** 2) * np.diag(k) / 2

    unsure = turned * (lost(angle) - lost(kept)) ** 2 + (1 - turned) * lost(kept) ** 2
    for e, (i, j) in zip(error, _PLANES):       # (K R)_ii holds K_ij R_ji
        skew = np.zeros(9)
        skew[[3 * i + j, 3 * j + i]] = 0.5
        variance = skew @ of_k @ skew
        unsure[[i, j]] += e * (k[i, j] ** 2 + variance) + 1.5 ** 2 * 3 * variance ** 2
    out[[0, 4, 8], [0, 4, 8]] += unsure
    return r.T @ keep, out


def _kept(
    angle: np.ndarray, cov: np.ndarray, dof: int | None
) -> tuple[float, np.ndarray, np.ndarray]:
    """
    Return the chance that the case is turned, the rotation expected, and its mean square error.

    ``angle`` (3,) is the rotation found, rad, with its covariance. Before, either is as likely:
    the sensor sits straight, but for what the cross-axis terms of data sheets turn it by, or it is
    turned anyhow. The poses weigh the two (Bayes), and the mean over both is kept. What chance
    makes of a tilt that is found itself has the tails of Student's t. Of any tilt, no pose speaks
    of a rotation.

    """
    straight = cov + 0.5 * CROSS ** 2 * np.eye(3)       # half the difference of two terms
    anyhow = cov + MOUNTING ** 2 * np.eye(3)
    odds = _log_t(angle, anyhow, 0) - _log_t(angle, straight / wider(dof), dof)
    turned = 0.0 if dof == 0 else float(expit(odds))
    share = np.eye(3) - cov @ np.linalg.inv(straight)
    little = share @ angle
    kept = turned * angle + (1 - turned) * little
    error = turned * (np.diag(cov) + (angle - kept) ** 2) + (1 - turned) * (
        np.diag(share @ cov) + (little - kept) ** 2)
    return turned, kept, error


def _log_t(x, shape, dof):
    """Return the log-density of Student's t (normal without ``dof``) at x (3,) less a constant."""
    q, size = x @ np.linalg.solve(shape, x), np.linalg.slogdet(shape)[1]
    if not dof:
        return -0.5 * (q + size)
    return (gammaln((dof + 3) / 2) - gammaln(dof / 2) - 1.5 * np.log(dof / 2)
            - 0.5 * (size + (dof + 3) * np.log1p(q / dof)))


def magnitude_rows(directions: np.ndarray) -> np.ndarray:
    """Return d|S^-1 (o - b)|/g by scale factors and biases (in g) at directions (3, n): (n, 6)."""
    return np.vstack([directions ** 2, directions]).T


def condition(directions: np.ndarray) -> float:
    """Return the condition number of scale and bias from the magnitudes at directions (3, n)."""
    s = np.linalg.svd(magnitude_rows(directions), compute_uv=False)
    return float(s[0] / s[-1]) if len(s) == 6 and s[-1] > 1e-9 * s[0] else float('inf')


def next_pose(directions: np.ndarray, solved: bool = False) -> str:
    """
    Return in words the pose that would add most: which way up, and what it would tell.

    Of faces, edges and corners the one that most improves the worst known combination of scale
    factors, biases and skew of the axes, beside poses of these directions (3, n), of length one.
    Where it is ``solved`` these tell it already, if not as well.

    """
    best, gained = '', 0.0
    rows = _with_skew(directions)
    weak = _weakest(rows)
    for signs in product((1, 0, -1), repeat=3):
        if not any(signs):
            continue
        u = np.array(signs, float)[:, None] / np.linalg.norm(signs)
        gain = abs(float((_with_skew(u) @ weak)[0]))
        if gain > gained * 1.01:
            best, gained = _spoken(signs), gain
    k = int(np.argmax(np.abs(weak)))
    what = [f'scale factor and bias of {a}' for a in 'xyz'] * 2
    what += [f'the angle between {"xyz"[i]} and {"xyz"[j]}' for i, j in _PAIRS]
    value = f'the {what[k].removeprefix("the ")}'
    would = f'tell {value} better' if solved else f'let {value} be told'
    return f'one more pose with {best} up would {would}'


def _with_skew(directions):
    pairs = np.array([2 * directions[i] * directions[j] for i, j in _PAIRS])
    return np.hstack([magnitude_rows(directions), pairs.T])


def _weakest(rows):
    """Return the combination known worst; scale and bias first while these are not told."""
    base = rows[:, :6]
    s, v = np.linalg.svd(base)[1:]
    if len(base) < 6 or s[-1] < 0.1 * s[0]:
        return np.r_[v[-1], 0, 0, 0]
    return np.linalg.svd(rows, full_matrices=True)[2][-1]


def _spoken(signs) -> str:
    names = [('+' if s > 0 else '-') + a for s, a in zip(signs, 'xyz') if s]
    return names[0] if len(names) == 1 else f'{", ".join(names[:-1])} and {names[-1]} alike'
