# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The way from a start down to a minimum of the likelihood of one axis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .likelihood import Likelihood
from .response import OPEN

REACH = 2.0  # by how much a step may change what is searched on a log scale
NEAR = 1.0  # squared standard deviations away is a minimum that is met
SAME = 0.3  # share of the way down to it by which the parabola may miss it
HOPELESS = 0.05  # share of what is lacking, that one more step must promise
PATIENCE = 6  # steps after which the curvature is learnt from the way, too


class Known(NamedTuple):
    """
    What a search knows when it begins from one more point.

    ``ends`` are minima of the same likelihood, x (p,) and -ln L; ``least`` is what must be reached
    to be of any use, the price of a form taken off.

    """

    ends: Sequence[tuple[np.ndarray, float]] = ()
    least: float = np.inf

    def met(self, here: _Here) -> tuple[np.ndarray, float] | None:
        """Return the minimum that the way leads to, if it is one of these."""
        return next((end for end in self.ends if here.leads_to(*end)), None)

    def hopeless(self, here: _Here, able: np.ndarray, form: float) -> bool:
        """
        Tell whether what is wanted is out of reach, where some (p,) may move.

        The parabola here leads a small share of the way that is left to it, whatever the step
        before has gained.

        """
        lacks = here.nll + form - self.least
        return lacks > 0 and here.gains(able) < HOPELESS * lacks


def minimise(likelihood: Likelihood, x0: np.ndarray, free: np.ndarray | None = None,
             penalty: float = 0.0, reddest: int | None = None, steps: int = 400,
             enough: float = 1e-7, known: Known = Known()) -> tuple[np.ndarray, float]:
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
    known : Known
        Where the way leads to a minimum that is known that one is returned, the very array; where
        it will not come to what is wanted, what it came to.

    """
    def value(x):
        nll, *rest = likelihood.value(x)
        return nll if reddest is None else nll - penalty * x[reddest], *rest

    x = np.array(x0, float)
    free = np.ones(len(x), bool) if free is None else free
    lower, upper = likelihood.bounds
    x = np.clip(x, lower, upper)
    best, *rest = value(x)
    damping = 1e-3
    reach = np.array([np.inf if s.label == OPEN else REACH for s in likelihood.slots])
    curvature = _Curvature()
    for _ in range(steps):
        here = _Here(x, best, *likelihood.derivatives(x, *rest))
        if reddest is not None:
            here.gradient[reddest] -= penalty
        end = known.met(here)
        if end is not None:
            return end
        curvature.arrive(here)
        # what a bound stops does not move, or it would bend the way of the others
        able = free & ~((x <= lower) & (here.gradient > 0)) & ~(
            (x >= upper) & (here.gradient < 0))
        if not able.any() or known.hopeless(here, able, rest[0].form):
            break
        for damping, moved in _moves(x, able, here.gradient, curvature.at(able), damping, reach):
            trial = np.clip(moved, lower, upper)
            result = value(trial)
            if np.isfinite(result[0]) and result[0] <= best:
                break
        else:
            break
        gain = best - result[0]
        x, (best, *rest) = trial, result
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

    def gains(self, able: np.ndarray) -> float:
        """Return what the parabola here gains, nats, where some (p,) may move."""
        g, f = self.gradient[able], self.information[np.ix_(able, able)]
        return 0.5 * float(g @ np.linalg.solve(f + 1e-9 * np.diag(np.diag(f) + 1e-3), g))

    def leads_to(self, end: np.ndarray, nll: float) -> bool:
        """
        Tell whether a minimum known, x (p,) and -ln L, is that below this place.

        It is less than a standard deviation away, and as deep as the parabola here says.

        """
        moved = end - self.x
        return float(moved @ self.information @ moved) < NEAR and \
            self.misses(moved, nll) < SAME * max(self.nll - nll, 0.0)


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
