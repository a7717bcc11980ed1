# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What is missing from a model: the verdict, the candidates and their probabilities.

Several effects may be missing at once. One that is there may gain next to nothing while another
hides it, and leave what it explains unhealed; so each candidate is also judged beside those that
stand out once it is in the model.

"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from .effect import Finding, Model, Score, unfitted
from .prediction import FALL, fall_of, State
from ..core.errors import FitError

VERDICTS = ('missing', 'complete', 'unknown', 'undecidable')
SURE = 0.9  # probability from which one effect is named
OMNIBUS_LEVEL = 0.005  # family-wise, by Holm
TRIED = 4  # candidates that are judged on data not fitted
SHADOW = 10.0  # times as much that fails elsewhere makes a finding a side of something else


@dataclass(frozen=True)
class Diagnosis:
    """
    What is missing from one target's model.

    A verdict, the ranked candidates, what failed, and what to do.

    """

    verdict: str
    ranked: tuple[Finding, ...] = ()
    failed: tuple[Finding, ...] = ()
    advice: str = ''


def diagnose(state: State) -> Diagnosis:
    """
    Return the verdict on one target.

    *missing*: the best candidate has probability >= 0.9, lowers the error on data not fitted, and
    leaves no failure that it should have healed; *complete*: nothing fails and no candidate stands
    out; *unknown*: something fails and no candidate explains it; *undecidable*: otherwise.

    """
    problem, fit = state.problem, state.fit
    search = _Search(state, problem.candidates(fit))
    failed = failures(problem.omnibus(fit))
    verdict = 'complete' if not failed else 'unknown'
    if search.able():
        found = search.confirmed(failed)
        if found:
            verdict = 'missing' if (search.ranked[0].probability or 0) >= SURE else 'undecidable'
        elif not failed:
            verdict = 'undecidable'
    advice = problem.advice(verdict, search.ranked, failed)
    return Diagnosis(verdict, tuple(search.ranked[:5]), tuple(failed), advice)


class _Search:
    """The candidates of one target, what stands out beside each, and which are refuted."""

    def __init__(self, state: State, findings: list[Finding]):
        self.state, self.problem = state, state.problem
        self.findings = [f for f in findings if f.effect is not None]
        self.refuted: set[str] = set()
        self._beside: dict[str, list[Finding]] = {}
        self._tested: dict[Model, list[Finding]] = {}
        self._scored: dict[Model, Score | None] = {}
        self.ranked = with_probabilities(self.findings)
        able = self.able()
        if len(able) > 1:
            for f in able[:TRIED - 1]:
                self.beside(f)
            self._rank()

    def able(self) -> list[Finding]:
        """Return what stands out, alone or beside another, best first."""
        return [f for f in self.ranked if f.name not in self.refuted
                and (f.gain > f.penalty or (f.probability or 0) >= SURE)]

    def beside(self, finding: Finding) -> list[Finding]:
        """
        Return what stands out once a candidate is in the model, best first.

        Nothing where the problem says that looking again costs more than it tells.

        """
        if not self.problem.looks_again:
            return []
        if finding.name not in self._beside:
            try:
                fit = self.problem.point(self.with_effects(finding))
                found = self.problem.candidates(fit)
            except FitError:  # the record cannot hold both
                found = []
            self._beside[finding.name] = sorted(
                (f for f in found if f.gain > f.penalty), key=lambda f: f.penalty - f.gain)
        return self._beside[finding.name]

    def with_effects(self, *findings: Finding) -> Model:
        """Return the model with candidates added, not fitted: one model for any order of them."""
        model = unfitted(self.state.model)
        for f in sorted(findings, key=lambda f: f.name):
            model = model.plus(type(f.effect)())
        return model

    def _rank(self) -> None:
        left = [f for f in self.findings if f.name not in self.refuted]
        beside = {k: {g.name: g.gain - g.penalty for g in v if g.name not in self.refuted}
                  for k, v in self._beside.items() if k not in self.refuted}
        out = [replace(f, probability=0.0) for f in self.findings if f.name in self.refuted]
        self.ranked = [*with_probabilities(left, beside), *out]

    def confirmed(self, failed: list[Finding]) -> bool:
        """
        Tell whether a candidate holds on data not fitted; then it leads the ranking.

        One that raises the error, leaves the failure that it claims to explain, or stands in the
        shadow of what nothing explains, is out of the race; one whose fall chance could explain
        stays in it, without being named.

        """
        tried: set[str] = set()
        while len(tried) < TRIED:
            f = next((f for f in self.able() if f.name not in tried), None)
            if f is None:
                break
            tried.add(f.name)
            fall, healed = self.confirm(f, failed)
            if fall > FALL and healed and not self.overshadowed(f, failed):
                self.ranked.sort(key=lambda g: g.name != f.name)
                return True
            if not (healed and 0 <= fall <= FALL):
                self.refuted.add(f.name)
                self._rank()
        return False

    def confirm(self, finding: Finding, failed: list[Finding]) -> tuple[float, bool]:
        """
        Return by how much a candidate lowers the error, and whether it heals its view.

        The error is that on data not fitted.

        """
        alone = self._error(finding)
        fall = -np.inf if alone is None else fall_of(self.state.error, alone, [finding.effect])
        if fall <= FALL:
            # the nearer a model comes, the more sticks out what is missing as well: look with it
            for other in self._company(finding):
                before, after = self._error(other), self._error(other, finding)
                if before is not None and after is not None:
                    fall = max(fall, fall_of(before, after, [finding.effect]))
                if fall > FALL:
                    break
        fails = finding.view in {f.name for f in failed}
        return fall, not fails or fall <= FALL or self.heals(finding)

    def _company(self, finding: Finding) -> list[Finding]:
        """Return three that may be missing as well, those that stand out beside it first."""
        some = {f.name: f for f in (*self.beside(finding), *self.able())
                if f.name not in self.refuted}
        return [f for f in some.values() if f.name != finding.name or f.effect.several][:3]

    def heals(self, finding: Finding) -> bool:
        """
        Tell whether a finding's view holds under a model with it, or with one or two others more.

        Several may be hidden at once, several of the same kind (lines) too.

        """
        if self._holds(finding):
            return True
        company = self._company(finding)
        some = [[f] for f in company]
        if finding.effect.several and finding.name not in {f.name for f in company}:
            some.insert(0, [finding])
        return any(self._holds(finding, *more) for more in (*some, company[:2]))

    def overshadowed(self, finding: Finding, failed: list[Finding]) -> bool:
        """
        Tell whether far more fails elsewhere than a finding explains, and nothing explains that.

        What is unknown may well show in two views, and in one of them look like what is known.

        """
        most = SHADOW * finding.gain
        elsewhere = [f for f in failed if f.view != finding.view]
        if sum(f.gain for f in elsewhere) <= most:
            return False
        company = self._company(finding)
        for some in ([], *([f] for f in company), company):
            tests = self._tests(finding, *some)
            left = failures(tests) if tests else elsewhere
            if sum(f.gain for f in left if f.view != finding.view) <= most:
                return False
        return True

    def _holds(self, finding: Finding, *others: Finding) -> bool:
        tests = self._tests(finding, *others)
        # an effect that hides a view does not heal it
        seen = finding.view in {f.name for f in tests}
        return seen and finding.view not in {f.name for f in failures(tests)}

    def _tests(self, *findings: Finding) -> list[Finding]:
        """Return the tests of the model with these; none where the record cannot hold them."""
        model = self.with_effects(*findings)
        if model not in self._tested:
            try:
                self._tested[model] = self.problem.omnibus(self.problem.point(model))
            except FitError:
                self._tested[model] = []
        return self._tested[model]

    def _error(self, *findings: Finding) -> Score | None:
        """Return the error on data not fitted of the model with these, None where none is had."""
        model = self.with_effects(*findings)
        if model not in self._scored:
            try:
                self._scored[model] = self.problem.held_out(model)
            except FitError:
                self._scored[model] = None
        return self._scored[model]


def with_probabilities(
    findings: Iterable[Finding], beside: Mapping[str, Mapping[str, float]] | None = None
) -> list[Finding]:
    """
    Return findings, best first, with the probabilities that they are missing.

    Nothing, each alone and each pair have equal priors and the weight exp(gain - penalty), summed
    over a pair; a finding has those of all that hold it. ``beside`` maps a name to the surplus
    (gain - penalty, nats) of others once that one is in the model.

    """
    found = list(findings)
    if not found:
        return []
    surplus = {f.name: f.gain - f.penalty for f in found}
    sets: dict[tuple[str, ...], float] = {(): 0.0, **{(k,): v for k, v in surplus.items()}}
    for first, others in (beside or {}).items():
        for second, more in others.items():
            pair = tuple(sorted((first, second)))
            sets[pair] = max(surplus[first] + more, sets.get(pair, -np.inf))
    values = np.array(list(sets.values()))
    weight = np.exp(np.clip(values - values.max(), -700, 0))
    weight /= weight.sum()
    out = [replace(f, probability=float(sum(w for w, s in zip(weight, sets) if f.name in s)))
           for f in found]
    return sorted(out, key=lambda f: (f.probability < SURE, f.penalty - f.gain))


def failures(findings: Iterable[Finding], level: float = OMNIBUS_LEVEL) -> list[Finding]:
    """Return the tests that fail at a family-wise level (Holm 1979)."""
    tests = sorted(findings, key=lambda f: f.p_value)
    out = []
    for i, f in enumerate(tests):
        if f.p_value > level / (len(tests) - i):
            break
        out.append(f)
    return out
