# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A rival without a name of the scatter of poses: a smooth function of direction, or of time.

Scatter explains anything, so that it would stand for whatever has no name. What is drawn anew in
each pose follows nothing; what follows direction or time does so smoothly, which is asked by a
normal process of unknown size (Rasmussen, Williams, Gaussian Processes for Machine Learning,
chapter 5): how much likelier than scatter alone it makes what the poses leave. How often chance
reaches as much is drawn, for these poses.

"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .linear import Equations
from .poses import Poses
from ..loop.verdict import HEALED

RARE = 1e-3             # how often chance reaches what refutes a name
DOUBTED = 0.05          # how often what is said in doubt
DRAWN = 20000           # so that chance is told to a fifth of itself
_TRIED = 400            # smooth courses of which it is asked how many would be told
_LENGTHS = {            # over which a course keeps its value, the longest first
    'direction': (1.0, 0.5),    # of the unit sphere: two polynomials' degrees and five
    'own': (0.5, 0.2),          # of the input of one axis, over its largest
    'time': (0.25, 0.1)}        # of the session
_SIZES = 10.0 ** np.arange(-1, 6, 0.5)      # variance of a course over that of scatter


@dataclass(frozen=True)
class Course:
    """
    What a smooth course would do in place of scatter.

    Attributes
    ----------
    of : str
        ``direction``, ``own`` (each axis of its own input) or ``time``: the one that does most.
    chance : float
        How often scatter alone reaches as much.
    share : float
        Of the variance of the scatter, that it explains.
    told : dict of str to float
        How often a course that is all of it would be told here, of ``direction`` and ``time``.

    """

    of: str
    chance: float
    share: float
    told: dict[str, float]

    @property
    def refutes(self) -> bool:
        """Whether it explains most of the scatter, and more than chance."""
        return self.chance <= RARE and self.share >= HEALED

    def followed(self, sensor: str) -> str:
        """Say what the scatter of a sensor follows."""
        of_input = 'direction' if sensor == 'accel' else 'input'
        return {'direction': f'it is a function of {of_input}',
                'own': 'it is a function of the input of each axis',
                'time': 'it is a course in time'}[self.of]


class _Rivals:
    """The normal processes over some poses, in the space of residuals."""

    def __init__(self, system: Equations, poses: Poses):
        whitener = np.asarray(system.whitener)
        rows = whitener.shape[0] * whitener.shape[1]
        whole = np.linalg.svd(system.basis, full_matrices=True)[0]
        free = whole[:, system.rank:]
        self.left = free.T @ system.residual
        self.names, self.variances, self.bases = [], [], []
        for name, kernel in _kernels(poses):
            among = np.einsum('nra,anm,msa->nrms', whitener, kernel, whitener).reshape(rows, rows)
            mine = free[len(free) - rows:]
            value, vector = np.linalg.eigh(mine.T @ among @ mine)
            value = np.maximum(value, 0.0)
            if value.mean() > 0:
                self.names.append(name)
                self.variances.append(value / value.mean())
                self.bases.append(vector)

    def gains(self, z: np.ndarray) -> np.ndarray:
        """Return by how many nats each is likelier than scatter alone, of draws z (k, d)."""
        d = z.shape[1]
        alone = 0.5 * d * np.log(np.mean(z ** 2, axis=1))
        out = []
        for value, vector in zip(self.variances, self.bases):
            v = 1 + _SIZES * value[:, None]
            rest = np.log((z @ vector) ** 2 @ (1 / v) / d)
            out.append(alone + np.max(-0.5 * d * rest - 0.5 * np.log(v).sum(axis=0), axis=1))
        return np.array(out)

    def share(self, k: int, noise: float) -> float:
        """Return the share of the scatter's variance that the likeliest size of one explains."""
        v = 1 + _SIZES * self.variances[k][:, None]
        y = (self.left @ self.bases[k]) ** 2
        rest = np.mean(y[:, None] / v, axis=0)
        likely = -0.5 * len(y) * np.log(rest) - 0.5 * np.log(v).sum(axis=0)
        before, after = np.mean(y), rest[np.argmax(likely)]
        return float(np.clip((before - after) / max(before - noise, 1e-12), 0.0, 1.0))


def course_of(system: Equations, poses: Poses, noise: float) -> Course | None:
    """
    Return what a smooth course does in the scatter's place; None where nothing is left to ask.

    Parameters
    ----------
    system : Equations
        Of the model with the scatter in it.
    poses : Poses
        With their inputs.
    noise : float
        Share of noise in the variance of the residuals.

    """
    if system.dof < 2:
        return None
    rivals = _Rivals(system, poses)
    if not rivals.names:
        return None
    rng = np.random.default_rng(0)
    chance = np.concatenate([rivals.gains(rng.standard_normal((DRAWN // 10, system.dof))).max(0)
                             for _ in range(10)])
    gain = rivals.gains(rivals.left[None])[:, 0]
    best = int(np.argmax(gain))
    limit = np.quantile(chance, 1 - RARE)
    told = {}
    for k, name in enumerate(rivals.names):
        if name in ('direction', 'time') and name not in told:
            size = np.sqrt((1 - noise) * rivals.variances[k])
            z = rng.standard_normal((_TRIED, system.dof)) * size @ rivals.bases[k].T
            z += np.sqrt(noise) * rng.standard_normal(z.shape)
            told[name] = float(np.mean(rivals.gains(z).max(axis=0) > limit))
    return Course(rivals.names[best], float((1 + np.sum(chance >= gain[best])) / (1 + DRAWN)),
                  rivals.share(best, noise), told)


def _kernels(poses: Poses) -> Iterator[tuple[str, np.ndarray]]:
    """Yield what outputs of poses share by each course: its name, (3, n, n) output by output."""
    u = poses.rates / np.linalg.norm(poses.rates, axis=0).max()
    over = {'direction': np.repeat(np.linalg.norm(u[:, :, None] - u[:, None], axis=0)[None], 3, 0),
            'own': np.abs(u[:, :, None] - u[:, None])}
    span = np.ptp(poses.time)
    if span > 0:
        over['time'] = np.repeat(np.abs(poses.time[:, None] - poses.time)[None] / span, 3, 0)
    for name, far in over.items():
        for length in _LENGTHS[name]:
            yield name, np.exp(-0.5 * (far / length) ** 2) * np.outer(poses.amount, poses.amount)
