# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which further poses would tell two effects from each other that explain the same so far."""

from __future__ import annotations

from itertools import product

import numpy as np

from .effects import Regressor
from .linear import equations, MAGNITUDES, terms_of, whitened
from .poses import joined, Poses, unit
from ..loop.effect import Fit, Model

ENOUGH = 3.0        # nats: e^3 to one, more than a name needs to be sure (20 to 1)
MOST = 200          # poses that are still advised


def _signs(axes: int) -> list[tuple[int, ...]]:
    return [s for s in product((1, 0, -1), repeat=3) if sum(map(abs, s)) == axes]


def _between() -> np.ndarray:
    """Return the directions halfway between a face and an edge, 22.5 deg from the face."""
    faces, edges = (unit(np.array(_signs(k), float).T) for k in (1, 2))
    near = [(f, e) for f in faces.T for e in edges.T if f @ e > 0.5]
    return unit(np.array([unit(f) + unit(e) for f, e in near]).T)


def sets() -> dict[str, np.ndarray]:
    """Return sets of directions (3, k) that hands can hold, by what people call them."""
    return {'edges (45 deg)': unit(np.array(_signs(2), float).T),
            'corners': unit(np.array(_signs(3), float).T),
            'directions halfway between a face and an edge (22 deg off the face)': _between()}


def nats(one: Fit, other: Fit, poses: Poses, method: str, more: np.ndarray | None = None) -> float:
    """
    Return by how many nats poses would prefer a model to another one, were it true.

    The expected gain: half the squared length of what the first one's added effects do in
    whitened outputs and the other model cannot follow. ``more`` (3, k) are directions held beside
    the poses there are.

    """
    poses = poses.with_inputs(one.details.inputs)
    if more is not None:
        k = more.shape[1]
        new = Poses.of(poses.sensor, np.zeros((3, k)), np.median(poses.std, axis=1)[:, None],
                       poses.magnitude, poses.magnitude * more, temperature=np.full(
                           k, np.median(poses.temperature)), time=np.full(
                           k, poses.time[-1]), force=np.full((3, k), np.nan))
        poses = joined([poses, new])
    scale = one.details.scale
    system, _ = equations(other.model, poses, scale, one.details.tilt, method, before=False)
    free = method in MAGNITUDES
    keys = [e for e in one.model.of(Regressor) if e.label not in other.model]
    values = np.array([e.values[p.name] for e in keys for p in e.coefficients])
    signal = whitened(system.whitener, terms_of(Model(keys), poses, scale, free)) @ values
    left = signal - system.basis @ (system.basis.T @ signal)
    return 0.5 * float(left @ left)


def advised(one: Fit, other: Fit, poses: Poses, method: str) -> tuple[str, int]:
    """
    Return the set that tells two fits apart with the fewest poses, and how many; 0: too many.

    The 45 deg edges come first wherever holding them once does.

    """
    best, fewest = '', np.inf
    before = min(nats(one, other, poses, method), nats(other, one, poses, method))
    for name, directions in sets().items():
        gained = min(nats(one, other, poses, method, directions),
                     nats(other, one, poses, method, directions)) - before
        k = directions.shape[1]
        count = k * max(1.0, np.ceil(ENOUGH / max(gained, 1e-9)))
        if name.startswith('edges') and count == k:
            return name, k
        if count < fewest:
            best, fewest = name, count
    return best, int(fewest) if fewest <= MOST else 0
