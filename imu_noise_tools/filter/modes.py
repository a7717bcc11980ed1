# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The models of a bank: the default's, in one fixed setting, and those that effects stand for."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .motion import AngularAcceleration, ConstantRate
from .statespace import state_space, StateSpace
from ..core.units import DEG
from ..loop.effect import Model

SOJOURN = 10.0  # s that a mode of the default bank lasts on average
REST = 0.5  # share of the changes of mode that lead to rest: where nothing speaks for motion
WANDER = (1e-7, 3e4)  # random walks of the rate, (deg/s)^2/s: at rest, and jumps
NEVER = 1e-15                                      # probability of a step within no time
# random walks of the acceleration, (deg/s^2)^2/s: from a slow turn to vigorous hands, by steps of
# 7.7, which move the variance of an estimate (to the fourth root of it) by less than a third
# either way of the best
ACCELERATION = tuple(float(q) for q in np.geomspace(0.3, 3e7, 10))


@dataclass(frozen=True)
class Modes:
    """
    The models of a bank for each axis, over one interval.

    ``spaces[axis][mode]`` share their states; ``prior`` (modes,) is what the mode probabilities
    drift towards, ``stay`` how much of them is kept in one interval: P(j | i) = prior_j (1 - stay)
    + stay [i = j].

    """

    spaces: tuple[tuple[StateSpace, ...], ...]
    prior: np.ndarray
    stay: float


def default_modes(noise: list[Model], dt: float, sojourn: float = SOJOURN, wander: Any = WANDER,
                  acceleration: Any = ACCELERATION) -> Modes:
    """
    Return the default bank.

    From rest over turns by hand to impacts, one fixed setting for every motion.

    Motion is physical: the setting does not depend on the sensor, whose noise (a model for each
    axis) sets R.

    """
    axes = []
    for model in noise:
        smooth = state_space(AngularAcceleration({'q': DEG ** 2}) + model, dt)
        still = state_space(ConstantRate() + model, dt)
        axes.append(tuple([_wandering(smooth, still, q * DEG ** 2 * dt) for q in wander]
                          + [_accelerating(smooth, q) for q in acceleration]))
    count = len(wander) + len(acceleration)
    prior = np.array([REST, *np.full(count - 1, (1 - REST) / (count - 1))])
    leave = -np.expm1(-dt / sojourn) / (1 - REST)
    return Modes(tuple(axes), prior, 1 - min(leave, 1.0))


def _wandering(smooth: StateSpace, still: StateSpace, q: float) -> StateSpace:
    """
    Return a random walk of the rate in the states of ``smooth``.

    The acceleration (state 1) is held at zero.

    """
    keep = np.array([0, *range(2, smooth.size)])
    phi, cov, p0 = np.zeros_like(smooth.phi), np.zeros_like(smooth.q), np.zeros_like(smooth.p0)
    phi[np.ix_(keep, keep)], cov[np.ix_(keep, keep)], p0[np.ix_(keep, keep)] = (
        still.phi,
        still.q,
        still.p0,
    )
    cov[0, 0] += q
    return replace(smooth, phi=phi, q=cov, p0=p0)


def _accelerating(smooth: StateSpace, factor: float) -> StateSpace:
    q = smooth.q.copy()
    q[:2, :2] *= factor
    return replace(smooth, q=q)


def modes_of(models: list[Model], dt: float) -> Modes:
    """Return the bank that a model is for each axis: one mode, or two where the rate may step."""
    axes = []
    step = None
    for model in models:
        space = state_space(model, dt)
        modes = [space]
        if space.step:
            step = max(space.step[0], NEVER), space.step[1]
            q = space.q.copy()
            q[0, 0] += step[1]
            modes.append(replace(space, q=q))
        axes.append(tuple(modes))
    prior = np.array([1.0]) if step is None else np.array([1 - step[0], step[0]])
    return Modes(tuple(axes), prior, 0.0)
