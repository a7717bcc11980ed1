# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The held-out deviance (the error on data not fitted), and by how much one model lowers it.

Knows only what a :class:`~imu_noise_tools.loop.problem.Problem` is.

"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from . import verdict
from .effect import Effect, Fit, Model, Score
from .problem import Problem


@dataclass(frozen=True)
class State:
    """One target with its model, fit and error."""

    problem: Problem
    fit: Fit[Any]
    error: Score
    summary: Mapping[str, float] = field(default_factory=dict)

    @property
    def model(self) -> Model:
        """The model with its values."""
        return self.fit.model


def observable(state: State, label: str) -> bool:
    """Tell whether any amplitude of an effect is resolved; of what has none it is."""
    found = state.fit.estimates.get(label, {})
    amplitudes = [found[p.name].value is not None for p in state.model[label].parameters
                  if p.amplitude and p.name in found]
    return any(amplitudes) or not amplitudes


def deviance(score: Score, names: Collection[str] = ()) -> float:
    """Return the total deviance over views; over all of them where none is named."""
    return float(sum(v.deviance for k, v in score.views.items() if not names or k in names))


def fall_of(before: Score, after: Score, effects: Iterable[Effect]) -> float:
    """
    Return by how much the held-out deviance fell.

    It is counted in the views in which the effects are judged.

    A view that one of the two models cannot say anything in counts with its excess where that is
    above zero; one that is muted under both, where an effect names it.

    """
    effects = list(effects)
    named = {name for e in effects for name in e.views}
    names = named if all(e.views for e in effects) else set(before.views) | set(after.views)
    both = set(before.views) & set(after.views) & names
    fall = deviance(before, both) - deviance(after, both) if both else 0.0
    for score, sign in ((before, 1), (after, -1)):
        fall += sign * sum(
            max(score.views[k].excess, 0.0) * len(score.views[k].pull)
            for k in score.views if k in names - both   # in an order that no run changes
        )
    muted = [k for k in before.muted if k in after.muted and k in named]
    return fall + sum(before.muted[k].deviance - after.muted[k].deviance for k in muted)


def fall_in_words(before: Score, after: Score, fall: float, least: float = verdict.FALL) -> str:
    """Say whether the held-out deviance has fallen, by ``least`` at least."""
    return verdict.change(before.excess, after.excess, fall, after.within_chance, least)
