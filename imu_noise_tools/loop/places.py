# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Models on the way of a search, each looked at once: its fit, candidates, tests and error."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

from .effect import Effect, Finding, Fit, Model, Score, unfitted
from .findings import failures, fresh, surplus
from .prediction import State
from ..core.errors import FitError


@dataclass(frozen=True)
class Place:
    """A model on the way, its fit, and its candidates, best first."""

    model: Model
    fit: Fit[Any]
    candidates: tuple[Finding, ...]


def _place(model: Model, fit: Fit[Any], found: Iterable[Finding]) -> Place:
    """Return a place with its candidates, what gains most beyond chance first."""
    some = (f for f in found if f.effect is not None)
    return Place(model, fit, tuple(sorted(some, key=lambda f: -surplus(f))))


class Places:
    """
    The models of one target that a search comes to, with what it sees there.

    A model is known by its labels: in whichever order its effects came, it is looked at once.

    """

    def __init__(self, state: State):
        self.state, self.problem = state, state.problem
        self.base = unfitted(state.model)
        self._places: dict[frozenset[str], Place | None] = {}
        self._tested: dict[frozenset[str], list[Finding]] = {}
        self._scored: dict[frozenset[str], Score | None] = {}
        self._looked = self._further = 0
        self._unseen: set[frozenset[str]] = set()
        self._partly: set[frozenset[str]] = set()

    def look_further(self, more: int) -> None:
        """Allow ``more`` places to be looked at: what was thought to hold has fallen."""
        self._further = self._looked + more

    def overlooked(self, chain: Iterable[Finding]) -> bool:
        """Tell whether the effort ended before it was asked what stands out behind a chain."""
        return self.set_of(chain) in self._unseen

    @property
    def _may_look(self) -> bool:
        return self._looked < max(self.problem.looks, self._further)

    def _is_open(self, key: frozenset[str]) -> bool:
        return key not in self._places or key in self._unseen and self._may_look

    def at(self, model: Model) -> Place | None:
        """Return a model fitted, with its candidates; None where the record cannot hold it."""
        key = frozenset(model.labels)
        if self._is_open(key):
            try:
                here = self.fit(model)
                # the effort is bounded: where everything fails, each place takes seconds
                begun = key in self._partly
                looks = model == self.base or begun or self._may_look
                (self._unseen.discard if looks else self._unseen.add)(key)
                self._looked += looks and not begun and not self.problem.knows_candidates(here)
                found = self.problem.candidates(here) if looks else []
                self._places[key] = _place(model, here, found)
            except FitError:
                self._places[key] = None
        return self._places[key]

    def offering(self, model: Model, wanted: Callable[[type[Effect]], bool]) -> Place | None:
        """
        Return a model fitted, with its candidates of the kinds wanted; None where none stands out.

        The others are not tried: what acts on the mean takes a fraction of the time that all take.

        """
        key = frozenset(model.labels)
        if not self._is_open(key):
            return self._places[key]
        if not self._may_look and key not in self._partly:
            return None
        try:
            here = self.fit(model)
        except FitError:
            return None
        known = self.problem.knows_candidates(here)
        found = self.problem.some_candidates(here, wanted)
        if not known and key not in self._partly:
            self._looked += 1
            self._partly.add(key)
        if not any(f.gain > f.penalty and not f.against for f in found):
            return None
        return _place(model, here, found)

    def supported(self, model: Model) -> float | None:
        """Return ln L of what a fit of a model explains; None where there is none, or no such."""
        try:
            return self.fit(model).supported
        except FitError:
            return None

    def fit(self, model: Model) -> Fit[Any]:
        """Fit a model without intervals, where that is cheaper; that of the base is known."""
        return self.state.fit if model == self.base else self.problem.point(model)

    def tests(self, model: Model) -> list[Finding]:
        """Return the tests of a model; none where the record cannot hold it."""
        model = unfitted(model)
        key = frozenset(model.labels)
        if key not in self._tested:
            try:
                here = self.fit(model)
                self._tested[key] = self.problem.omnibus(here)
            except FitError:
                self._tested[key] = []
        return self._tested[key]

    def error(self, model: Model) -> Score | None:
        """Return the held-out deviance of a model, None where none is had."""
        key = frozenset(model.labels)
        if key not in self._scored:
            try:
                self._scored[key] = (self.state.error if model == self.base
                                     else self.problem.held_out(model))
            except FitError:
                self._scored[key] = None
        return self._scored[key]

    def model_of(self, chain: Iterable[Finding]) -> Model:
        """Return the base model with a chain's members added, not fitted."""
        model = self.base
        for f in chain:
            model = model.plus(fresh(f))
        return model

    def set_of(self, chain: Iterable[Finding]) -> frozenset[str]:
        """Return what a model with a chain's members holds, in whichever order they came."""
        return frozenset(self.model_of(chain).labels)

    def labels_of(self, chain: Iterable[Finding]) -> list[str]:
        """Return the labels of a chain's members."""
        return self.model_of(chain).labels[len(self.base):]

    def beside_others(self, finding: Finding, name: str, model: Model) -> Finding:
        """
        Return a finding with the values that it has, by a label, in a larger model.

        Whether a bound still holds it there is asked of its form, as of every member's.

        """
        fit = self.fit(model)
        return replace(finding, effect=fit.model[name], estimates=fit.estimates.get(name, {}),
                       against='' if finding.bounded else finding.against)

    def left(self, chain: Iterable[Finding]) -> float:
        """Return what fails after a chain, nats."""
        return float(sum(f.gain for f in self._failures_after(chain)))

    def views_left(self, chain: Iterable[Finding]) -> set[str]:
        """Return the views that fail after a chain."""
        return {f.view for f in self._failures_after(chain)}

    def _failures_after(self, chain: Iterable[Finding]) -> list[Finding]:
        return failures(self.tests(self.model_of(chain)))

    def failing(self, model: Model) -> float:
        """Return what a model leaves failing in the views that fail under the base, nats."""
        views = {f.view for f in failures(self.tests(self.base))}
        return float(sum(max(f.gain, 0.0) for f in self.tests(model) if f.view in views))
