# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The error on data not fitted, and by how much one model lowers it against another.

Knows only the :class:`~imu_noise_tools.loop.effect.Problem` protocol.

"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from . import verdict
from .effect import Fit, Model, Problem, Score, View


@dataclass(frozen=True)
class State:
    """One target with its model, fit and error."""

    problem: Problem
    fit: Fit
    error: Score
    summary: Mapping[str, float] = field(default_factory=dict)

    @property
    def model(self) -> Model:
        """The model with its values."""
        return self.fit.model


def held_out(problem: Problem, model: Model) -> Score:
    """
    Return the error on data not fitted.

    Each view is averaged over the splits, then the views are averaged.

    """
    known = getattr(problem, 'held_out', None)          # some problems have it in closed form
    if known is not None:
        return known(problem.fit(model))
    found: dict[str, list[View]] = {}
    for to_fit, to_score in problem.split():
        score = to_score.score(to_fit.fit(model))
        for view in (*score.views.values(), *score.muted.values()):
            found.setdefault(view.name, []).append(view)
    return Score.of(_merged(views) for views in found.values())


def _merged(views: list[View]) -> View:
    if len(views) == 1:
        return views[0]
    k = len(views)
    x, pull = np.concatenate([v.x for v in views]), np.concatenate([v.pull for v in views])
    order = np.argsort(x, kind='stable')
    return View(
        views[0].name,
        x[order],
        pull[order],
        float(np.mean([v.excess for v in views])),
        float(np.sqrt(sum(v.std**2 for v in views)) / k),
        views[0].unit,
        None if views[0].log_score is None else float(sum(v.log_score for v in views)),
        any(v.muted for v in views),
    )


def deviance(score: Score, names=()) -> float:
    """Return the total deviance over views; over all of them where none is named."""
    return float(sum(v.deviance for k, v in score.views.items() if not names or k in names))


def point_of(problem: Problem):
    """Return what fits without intervals; not every problem makes a difference."""
    return getattr(problem, 'point', problem.fit)


def fall_of(before: Score, after: Score, effects) -> float:
    """
    Return by how much the deviance on data not fitted fell.

    It is counted in the views in which the effects are judged.

    A view that one of the two models cannot say anything in counts with its excess where that is
    above zero; one that is muted under both, where an effect names it.

    """
    named = {name for e in effects for name in e.views}
    names = named if all(e.views for e in effects) else set(before.views) | set(after.views)
    both = set(before.views) & set(after.views) & names
    fall = deviance(before, both) - deviance(after, both) if both else 0.0
    for score, sign in ((before, 1), (after, -1)):
        fall += sign * sum(
            max(score.views[k].excess, 0.0) * len(score.views[k].pull)
            for k in set(score.views) & names - both
        )
    muted = set(before.muted) & set(after.muted) & named
    return fall + sum(before.muted[k].deviance - after.muted[k].deviance for k in muted)


def fall_in_words(before: Score, after: Score, fall: float) -> str:
    """Say whether an error on data not fitted has fallen."""
    return verdict.change(before.excess, after.excess, fall, after.within_chance)
