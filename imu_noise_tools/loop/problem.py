# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A target of a study as the loop sees it: all that the loop knows of any domain."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from . import verdict as rules
from .effect import Effect, Estimate, Finding, Fit, Model, Score, unfitted, View


@dataclass(frozen=True)
class Difference:
    """
    What the data of two problems say of one quantity, and by how many standard deviations apart.

    ``unit`` is a template, as of a parameter. ``sigmas`` is how rare such a difference is where
    nothing differs, as a deviate of the normal distribution, whatever its own distribution is.

    """

    what: str
    first: Estimate
    second: Estimate
    unit: str
    sigmas: float


class Problem(ABC):
    """
    One target of one domain: data that models are fitted to, scored on and tested against.

    A domain gives what is abstract here, and replaces a default where it knows better.

    """

    domain: ClassVar[str]
    #: models of one search whose candidates are fitted; those of the first always are, and 0 where
    #: that takes too long beside each of them
    looks: ClassVar[int] = 6

    @property
    @abstractmethod
    def target(self) -> str:
        """Name of the target: an axis, or a sensor."""

    @abstractmethod
    def split(self) -> list[tuple[Problem, Problem]]:
        """Return pairs (to fit, to score) that share no data."""

    @abstractmethod
    def fit(self, model: Model) -> Fit[Any]:
        """Fit a model."""

    @abstractmethod
    def score(self, fit: Fit[Any]) -> Score:
        """Score a fit made elsewhere on this data."""

    @abstractmethod
    def omnibus(self, fit: Fit[Any]) -> list[Finding]:
        """Return tests that fail when anything at all is missing, each with its p-value."""

    @abstractmethod
    def candidates(self, fit: Fit[Any]) -> list[Finding]:
        """Return what could be added to the model, best gain first."""

    def falls_by_chance(self, effect: Effect) -> float:
        """
        Return the deviance by which an effect that is not there lowers the error by chance.

        More where all the data chose its place: what is then fitted is not all that they told.

        """
        return rules.FALL

    def some_candidates(self, fit: Fit[Any],
                        wanted: Callable[[type[Effect]], bool]) -> list[Finding]:
        """
        Return the candidates of the kinds that are wanted; where that costs less, these alone.

        What stands out of all of them is among these as well.

        """
        return [f for f in self.candidates(fit) if f.effect is not None and wanted(type(f.effect))]

    def exchanges(self, effect: Effect | None,
                  later: Sequence[Effect | None]) -> Collection[str]:
        """Return the names that are tried in an effect's place beside what came ``later``."""
        return ()

    def point(self, model: Model) -> Fit[Any]:
        """Fit a model without intervals, where that is cheaper."""
        return self.fit(model)

    def held_out(self, model: Model) -> Score:
        """
        Return the held-out deviance of a model: its error on data that it was not fitted to.

        Each view is averaged over the splits, then the views are averaged.

        """
        model = unfitted(model)
        return merged(to_score.score(to_fit.fit(model)) for to_fit, to_score in self.split())

    def knows_candidates(self, fit: Fit[Any]) -> bool:
        """Tell whether the candidates of a fit are known already, so that asking costs nothing."""
        return False

    def shape(self, fit: Fit[Any], label: str, claim: float) -> str:
        """
        Say that a form without a name does better than an effect of the model.

        ``claim`` is what the effect gains, nats; empty where its form is as good.

        """
        return ''

    def materiality(self, fit: Fit[Any]) -> tuple[float | None, float | None, bool | None]:
        """
        Return what a model leaves: its share of the power, what it does, and whether it matters.

        The second is the largest ratio of measured to model Allan deviation beyond what chance
        allows, the last whether the model is sufficient all the same; None where a domain has no
        such thing.

        """
        return None, None, None

    def basis(self, fit: Fit[Any]) -> dict[str, Any]:
        """Return what the values of a fit rest on, and what they leave, as plain data."""
        return {}

    def advice(self, verdict: str, ranked: list[Finding], failed: list[Finding]) -> str:
        """
        Return what to do next, in a sentence or two; '' where there is nothing to say.

        What fails, and what comes nearest, is said beside it.

        """
        return ''

    def leave(self, model: Model) -> str:
        """Say by what leave a model is complete that does not meet the data; or nothing."""
        return ''

    def summary(self, fit: Fit[Any]) -> dict[str, float]:
        """Return what else describes a fit, as numbers by name."""
        return {}

    def remarks(self, fit: Fit[Any]) -> list[str]:
        """Return what else is to be said of a fit to people, a sentence each."""
        return []

    def differences(self, fit: Fit[Any], other: Problem, other_fit: Fit[Any]) -> list[Difference]:
        """Return what differs in the data from another problem's, whatever the models say."""
        return []

    def comparable(
        self, fits: Mapping[str, Fit[Any]], other: Problem, other_fits: Mapping[str, Fit[Any]]
    ) -> Mapping[tuple[str, str], tuple[str, Estimate, Estimate]]:
        """
        Return, of what differs by nature between two records of one sensor, what can be compared.

        By label and parameter: what it is then called, and the estimates of both, without a
        deviation where nothing can be. ``fits`` are those of all targets of a study.

        """
        return {}

    def differs_in_data(self, effect: Effect) -> bool:
        """Tell whether :meth:`differences` compares what an effect of a model says."""
        return False


def merged(scores: Iterable[Score]) -> Score:
    """Return the scores of several splits as one: each view is averaged over them."""
    found: dict[str, list[View]] = {}
    for score in scores:
        for view in (*score.views.values(), *score.muted.values()):
            found.setdefault(view.name, []).append(view)
    return Score.of(_merged(views) for views in found.values())


def _merged(views: list[View]) -> View:
    """Return the views of several splits as one."""
    if len(views) == 1:
        return views[0]
    k = len(views)
    x, pull = np.concatenate([v.x for v in views]), np.concatenate([v.pull for v in views])
    order = np.argsort(x, kind='stable')
    scores = [v.log_score for v in views if v.log_score is not None]
    return View(
        views[0].name,
        x[order],
        pull[order],
        float(np.mean([v.excess for v in views])),
        float(np.sqrt(sum(v.std**2 for v in views)) / k),
        views[0].unit,
        float(sum(scores)) if len(scores) == k else None,
        any(v.muted for v in views),
        float(np.mean([v.allowed for v in views])),
    )
