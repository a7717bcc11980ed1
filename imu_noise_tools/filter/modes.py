# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The models of a bank: the default's, and those that effects stand for."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .motion import AnyMotion
from .statespace import state_space, StateSpace
from ..loop.effect import Model

NEVER = 1e-15                                      # probability of a step within no time


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


def default_modes(noise: list[Model], dt: float) -> Modes:
    """
    Return the default bank.

    From rest over turns by hand to impacts, one fixed setting for every motion.

    Motion is physical: the setting does not depend on the sensor, whose noise (a model for each
    axis) sets R.

    """
    return modes_of([AnyMotion() + model for model in noise], dt)


def _wandering(space: StateSpace, q: float) -> StateSpace:
    """
    Return a random walk of the rate in the states of ``space``, by the variance q an interval.

    The acceleration (state 1) is held at zero.

    """
    phi, cov, p0 = space.phi.copy(), space.q.copy(), space.p0.copy()
    phi[0, 1] = 0.0
    for m in (phi, cov, p0):
        m[1, :] = m[:, 1] = 0.0
    cov[0, 0] = q
    return replace(space, phi=phi, q=cov, p0=p0)


def _accelerating(space: StateSpace, density: float) -> StateSpace:
    q = space.q.copy()
    q[:2, :2] *= density
    if not space.law:
        return replace(space, q=q)
    size, share, decay, spring = space.law
    q[:2, :2] *= size
    phi, s = space.phi.copy(), 0.5 * decay
    w = np.sqrt(spring - s * s + 0j)
    c, one = np.cos(w * space.dt).real, space.dt * np.sinc(w * space.dt / np.pi).real
    phi[:2, :2] = np.exp(-s * space.dt) * np.array([[c + s * one, one],
                                                    [-spring * one, c - s * one]])
    return replace(space, phi=phi, q=q, grows=share * space.q[:2, :2])


def modes_of(models: list[Model], dt: float) -> Modes:
    """
    Return the bank that a model is for each axis.

    One mode, two where the rate may step, or those of what switches.

    """
    axes = []
    prior, stay = np.ones(1), 0.0
    for model in models:
        space = state_space(model, dt)
        modes = [space]
        if space.switching:
            turns = space.switching
            modes = [*(_wandering(space, q * dt) for q in turns.wander),
                     *(_accelerating(space, q) for q in turns.acceleration)]
            # never all of it: a mode that a blow has ruled out must find back over no time, too
            prior, stay = np.array(turns.prior), np.clip(np.exp(-dt * turns.leave), 0, 1 - NEVER)
        elif space.step:
            step = max(space.step[0], NEVER), space.step[1]
            q = space.q.copy()
            q[0, 0] += step[1]
            modes.append(replace(space, q=q))
            prior = np.array([1 - step[0], step[0]])
        axes.append(tuple(modes))
    return Modes(tuple(axes), prior, stay)
