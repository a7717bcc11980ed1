# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The way from a start down to a minimum of the likelihood of one axis."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .likelihood import Likelihood
from .response import OPEN

REACH = 2.0  # by how much a step may change what is searched on a log scale
PATIENCE = 6  # steps after which the curvature is learnt from the way, too


def minimise(likelihood: Likelihood, x0: np.ndarray, free: np.ndarray | None = None,
             penalty: float = 0.0, reddest: int | None = None, steps: int = 400,
             enough: float = 1e-7) -> tuple[np.ndarray, float]:
    """
    Return (x, -ln L) of the minimum below a start, by Levenberg's rule.

    The information is the curvature where the model is right. Where it is far off, what that lacks
    is learnt from the gradients along the way (Dennis, Gay and Welsch 1981): the last decimals of
    a hopeless fit take hundreds of steps without.

    Parameters
    ----------
    likelihood : Likelihood
        Of the axis and the model.
    x0 : ndarray (p,)
        Where to start, on the search scale.
    free : ndarray (p,) of bool or None
        Which parameters move; all for None.
    penalty, reddest : float, int or None
        Nats by which -ln L is less for each unit that a parameter of this index, the slowest
        amplitude, is larger: it keeps that off zero, and is in what is returned.
    steps : int
        At most.
    enough : float
        A step that gains less, nats, is the last.

    """
    def value(x):
        nll, linear, v, each = likelihood.value(x)
        return nll if reddest is None else nll - penalty * x[reddest], linear, v, each

    x = np.array(x0, float)
    free = np.ones(len(x), bool) if free is None else free
    lower, upper = likelihood.bounds
    x = np.clip(x, lower, upper)
    best, linear, v, each = value(x)
    damping = 1e-3
    reach = np.array([np.inf if s.label == OPEN else REACH for s in likelihood.slots])
    curvature = _Curvature()
    for _ in range(steps):
        gradient, information = likelihood.derivatives(x, linear, v, each)
        if reddest is not None:
            gradient[reddest] -= penalty
        curvature.arrive(_Here(x, best, gradient, information))
        # what a bound stops does not move, or it would bend the way of the others
        able = free & ~((x <= lower) & (gradient > 0)) & ~((x >= upper) & (gradient < 0))
        if not able.any():
            break
        for damping, moved in _moves(x, able, gradient, curvature.at(able), damping, reach):
            trial = np.clip(moved, lower, upper)
            result = value(trial)
            if np.isfinite(result[0]) and result[0] <= best:
                break
        else:
            break
        gain = best - result[0]
        x, (best, linear, v, each) = trial, result
        if gain < enough:
            break
        damping = min(max(damping / 10, 1e-9), 1.0)
    return x, best


class _Here(NamedTuple):
    """A place on the way: x (p,), -ln L, its gradient (p,) and the information (p, p)."""

    x: np.ndarray
    nll: float
    gradient: np.ndarray
    information: np.ndarray

    def misses(self, moved: np.ndarray, nll: float, lacks: np.ndarray | float = 0.0) -> float:
        """Return by how much the parabola here, of more curvature, misses -ln L after a step."""
        curved = self.information + lacks
        return abs(self.nll + float(moved @ (self.gradient + 0.5 * curved @ moved)) - nll)


class _Curvature:
    """The curvature on a way that takes long: the information, and what was learnt beside it."""

    def __init__(self) -> None:
        self._lacks: np.ndarray | None = None
        self._here: _Here | None = None
        self._steps, self._told = 0, False

    def arrive(self, here: _Here) -> None:
        """Learn from a step, and whether what was learnt before foretold it better."""
        last, self._here = self._here, here
        if last is None or self._lacks is None:
            self._lacks = np.zeros_like(here.information)
            return
        moved = here.x - last.x
        better = last.misses(moved, here.nll, self._lacks) < last.misses(moved, here.nll)
        self._steps += 1
        self._told = better and self._steps >= PATIENCE
        self._lacks = _learnt(self._lacks, moved, here.gradient - last.gradient, here.information)

    def at(self, able: np.ndarray) -> np.ndarray:
        """Return it (p, p): that of a minimum in what is able (p,) to move."""
        assert self._here is not None and self._lacks is not None
        curved = self._here.information + self._lacks
        some = np.ix_(able, able)
        if self._told and np.all(np.linalg.eigvalsh(curved[some]) > 0):
            return curved
        return self._here.information


def _learnt(lacks: np.ndarray, moved: np.ndarray, turned: np.ndarray,
            information: np.ndarray) -> np.ndarray:
    """
    Return what the information (p, p) lacks of the curvature, after one more step.

    It turns the gradient by what the step, ``moved`` (p,), has turned it, and is no larger than
    that asks for.

    """
    along = float(turned @ moved)
    if along <= 0:
        return np.zeros_like(lacks)
    wanted = turned - information @ moved
    size = float(moved @ lacks @ moved)
    if size:
        lacks = lacks * min(abs(float(moved @ wanted) / size), 1.0)
    rest = wanted - lacks @ moved
    both = np.outer(rest, turned) / along
    return lacks + both + both.T - float(rest @ moved) / along**2 * np.outer(turned, turned)


def _moves(x, able, gradient, information, damping, reach):
    """
    Yield (damping, x moved) by Levenberg's rule, shorter and shorter, where x may move.

    By no more than ``reach`` (p,) at once.

    """
    g, f = gradient[able], information[np.ix_(able, able)]
    scale = np.maximum(np.diag(f), 1e-9)
    while damping < 1e9:
        step = -np.linalg.solve(f + damping * np.diag(scale) + 1e-12 * np.eye(len(g)), g)
        moved = x.copy()
        moved[able] += np.clip(step, -reach[able], reach[able])
        yield damping, moved
        damping *= 10
