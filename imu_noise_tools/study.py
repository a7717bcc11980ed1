# Copyright 2026 imu_noise_tools maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
The loop, for any problem: compare, diagnose, add, remove, and the history of what was tried.

Knows only the :class:`~imu_noise_tools.effect.Problem` protocol: nothing of noise, calibration or
filters, no files.

"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from .effect import find_effect, Finding, Fit, Model, Problem, Score, unfitted, View
from .errors import UsageError

VERDICTS = ('missing', 'complete', 'unknown', 'undecidable')
SURE = 0.9  # probability from which one effect is named
# deviance (three nats) by which an error on data not fitted must fall to be more than chance
FALL = 6.0
OMNIBUS_LEVEL = 0.005  # family-wise, by Holm


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


@dataclass(frozen=True)
class Step:
    """One rung of the ladder: what was fitted and how well it predicts data it has not seen."""

    target: str
    effects: tuple[str, ...]
    held_out: float
    held_out_std: float
    added: str | None = None
    removed: str | None = None
    fall: float | None = None  # deviance gained on data not fitted
    verdict: str = ''


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
        for view in to_score.score(to_fit.fit(model)).views.values():
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
    )


def deviance(score: Score, names=()) -> float:
    """Return the total deviance over views; over all of them where none is named."""
    return float(sum(v.deviance for k, v in score.views.items() if not names or k in names))


def _point_of(problem: Problem):
    """Return what fits without intervals; not every problem makes a difference."""
    return getattr(problem, 'point', problem.fit)


def fall_of(before: Score, after: Score, effects) -> float:
    """
    Return by how much the deviance on data not fitted fell.

    It is counted in the views in which the effects are judged.

    A view that one of the two models cannot say anything in counts with its excess where that is
    above zero.

    """
    names: set = set()
    for e in effects:
        if not e.views:
            names = set(before.views) | set(after.views)
            break
        names |= set(e.views)
    both = set(before.views) & set(after.views) & names
    fall = deviance(before, both) - deviance(after, both) if both else 0.0
    for score, sign in ((before, 1), (after, -1)):
        fall += sign * sum(
            max(score.views[k].excess, 0.0) * len(score.views[k].pull)
            for k in set(score.views) & names - both
        )
    return fall


def assess(problem: Problem, model: Model, intervals: bool = True) -> State:
    """
    Fit a model to a target and score it on data not fitted.

    Without the intervals of the values, which the error does not need, it takes half the time.

    """
    fit = (problem.fit if intervals else _point_of(problem))(unfitted(model))
    summary: dict[str, float] = getattr(problem, 'summary', lambda _: {})(fit)
    return State(problem, fit, held_out(problem, unfitted(model)), summary)


class Study:
    """
    A model of each target, what was tried, and what is missing.

    Parameters
    ----------
    domain : str
        ``noise``, ``calibration`` or ``filter``.
    states : mapping of str to State
    source : mapping
        Where the data came from, for people.
    history, diagnosis
        What went before.

    """

    def __init__(
        self,
        domain: str,
        states: Mapping[str, State],
        source: Mapping | None = None,
        history: Iterable[Step] = (),
        diagnosis: Mapping[str, Diagnosis] | None = None,
    ):
        self.domain = domain
        self.states = dict(states)
        self.source = dict(source or {})
        self.history = list(history)
        self.diagnosis = dict(diagnosis or {})

    @classmethod
    def begin(
        cls, problems: Mapping[str, Problem], model: Model, source=None, progress=None
    ) -> Study:
        """Fit the same model to every target."""
        study = cls(next(iter(problems.values())).domain, {}, source)
        for i, (target, problem) in enumerate(problems.items()):
            study.states[target] = assess(problem, model)
            study.history.append(study._step(target))
            if progress:
                progress((i + 1) / len(problems), f'{target}: fit')
        return study

    @property
    def targets(self) -> list[str]:
        """Names of the targets."""
        return list(self.states)

    def chosen(self, targets: Iterable[str] | None) -> list[str]:
        """Return the targets that are named, all for None; raise UsageError for an unknown one."""
        if targets is None:
            return self.targets
        for t in targets:
            if t not in self.states:
                raise UsageError(f'the study has no {t}', f'it has {", ".join(self.states)}')
        return list(targets)

    def _step(self, target, added=None, removed=None, before: State | None = None) -> Step:
        state = self.states[target]
        fall, verdict = None, 'start'
        if before is not None:
            changed = [
                e
                for e in (*before.model, *state.model)
                if not (e.label in before.model and e.label in state.model)
            ]
            fall = fall_of(before.error, state.error, changed)
            verdict = fall_in_words(before.error, state.error, fall)
        return Step(
            target,
            tuple(state.model.labels),
            state.error.excess,
            state.error.std,
            added,
            removed,
            fall,
            verdict,
        )

    def compare(self, targets=None) -> dict[str, Score]:
        """Return, for each target, the error on data not fitted, view by view."""
        return {t: self.states[t].error for t in self.chosen(targets)}

    def diagnose(self, targets=None, progress=None) -> dict[str, Diagnosis]:
        """Find out what is missing from each target's model."""
        names = self.chosen(targets)
        for i, t in enumerate(names):
            self.diagnosis[t] = diagnose(self.states[t])
            if progress:
                progress((i + 1) / len(names), f'{t}: {self.diagnosis[t].verdict}')
        return {t: self.diagnosis[t] for t in names}

    def add(self, effects: Iterable[str] | None = None, targets=None) -> list[Step]:
        """
        Put effects into the model of the targets.

        Without names, the best of the diagnosis for each target it names.

        Returns the rungs added to the ladder (none where nothing is missing).

        """
        plan = {}
        if effects:
            for name in effects:
                find_effect(self.domain, name)
            for t in self.chosen(targets):
                plan[t] = list(effects)
        else:
            for t in self.chosen(targets):
                if t not in self.diagnosis:
                    self.diagnose([t])
                if self.diagnosis[t].verdict == 'missing':
                    plan[t] = [self.diagnosis[t].ranked[0].name]
        steps = []
        for t, names in plan.items():
            before = self.states[t]
            model = before.model
            for name in names:
                model = model.plus(find_effect(self.domain, name)())
            self.states[t] = assess(before.problem, model)
            steps.append(self._step(t, added='+'.join(names), before=before))
        self.history += steps
        self._forget(plan)
        return steps

    def remove(self, label: str, targets=None) -> list[Step]:
        """
        Take an effect out of the model of each target that has it.

        Raise UsageError where none has it.

        """
        names = [t for t in self.chosen(targets) if label in self.states[t].model]
        if not names:
            some = sorted({x for t in self.chosen(targets) for x in self.states[t].model.labels})
            raise UsageError(f'no target has {label} in its model', f'there is {", ".join(some)}')
        steps = []
        for t in names:
            before = self.states[t]
            self.states[t] = assess(before.problem, before.model.minus(label))
            steps.append(self._step(t, removed=label, before=before))
        self.history += steps
        self._forget(names)
        return steps

    def undo(self, targets=None) -> list[Step]:
        """Take out what each target's last rung put in; an empty list where nothing was added."""
        steps = []
        for t in self.chosen(targets):
            base = next(s for s in self.history if s.target == t)
            extra = [x for x in self.states[t].model.labels if x not in base.effects]
            if extra:
                steps += self.remove(extra[-1], [t])
        return steps

    def complete(self, targets=None, most: int = 8, progress=None) -> list[Step]:
        """Diagnose and add until nothing more is found in any target; return all rungs."""
        steps = []
        for t in self.chosen(targets):
            for _ in range(most):
                self.diagnose([t])
                if progress:
                    progress(None, f'{t}: {self.diagnosis[t].verdict}')
                if self.diagnosis[t].verdict != 'missing':
                    break
                steps += self.add(None, [t])
            self.diagnose([t])
        return steps

    def _forget(self, targets):
        for t in targets:
            self.diagnosis.pop(t, None)


def fall_in_words(before: Score, after: Score, fall: float) -> str:
    """Say whether an error on data not fitted has fallen."""
    if not np.isfinite(fall):
        return 'not to be compared'
    if fall > FALL:
        return 'falls to chance' if after.within_chance else 'falls'
    if fall < -FALL and not after.within_chance:
        return 'rises'
    return 'does not fall'


def diagnose(state: State) -> Diagnosis:
    """
    Return the verdict on one target.

    *missing*: the best candidate has probability >= 0.9, lowers the error on data not fitted, and
    leaves no failure that it should have healed; *complete*: nothing fails and no candidate stands
    out; *unknown*: something fails and no candidate explains it; *undecidable*: otherwise.

    """
    problem, fit = state.problem, state.fit
    ranked = with_probabilities(problem.candidates(fit))
    failed = failures(problem.omnibus(fit))
    able = [f for f in ranked if f.gain > f.penalty]
    verdict = 'complete' if not failed else 'unknown'
    if able:
        ranked, found = _confirmed(state, ranked, failed)
        if found:
            verdict = 'missing' if (ranked[0].probability or 0) >= SURE else 'undecidable'
        elif not failed:
            verdict = 'undecidable'
    advice = getattr(problem, 'advice', _no_advice)(verdict, ranked, failed)
    return Diagnosis(verdict, tuple(ranked[:5]), tuple(failed), advice)


def _confirmed(state: State, ranked: list[Finding], failed: list[Finding]):
    """
    Return the ranking, led by the first that holds on data not fitted, and whether one does.

    A candidate that raises the error, or leaves the failure that it claims to explain, is out of
    the race; one whose fall chance could explain stays in it, without being named.

    """
    refuted: set[str] = set()
    able = [f for f in ranked if f.gain > f.penalty]
    for f in able[:4]:
        fall, healed = confirm(state, f, failed, [g for g in able if g.name not in refuted])
        if fall > FALL and healed:
            left = with_probabilities(g for g in ranked if g.name not in refuted)
            out = [replace(g, probability=0.0) for g in ranked if g.name in refuted]
            return sorted([*left, *out], key=lambda g: g.name != f.name), True
        if fall < 0 or not healed:
            refuted.add(f.name)
    return ranked, False


def _no_advice(verdict, ranked, failed):
    return ''


def with_probabilities(findings: Iterable[Finding]) -> list[Finding]:
    """
    Return findings, best first, with probabilities.

    Equal priors, weight exp(gain - penalty), 'nothing' among them.

    """
    found = sorted(findings, key=lambda f: f.penalty - f.gain)
    if not found:
        return []
    surplus = np.array([f.gain - f.penalty for f in found] + [0.0])
    weight = np.exp(np.clip(surplus - surplus.max(), -700, 0))
    return [replace(f, probability=float(w)) for f, w in zip(found, weight / weight.sum())]


def failures(findings: Iterable[Finding], level: float = OMNIBUS_LEVEL) -> list[Finding]:
    """Return the tests that fail at a family-wise level (Holm 1979)."""
    tests = sorted(findings, key=lambda f: f.p_value)
    out = []
    for i, f in enumerate(tests):
        if f.p_value > level / (len(tests) - i):
            break
        out.append(f)
    return out


def confirm(
    state: State, finding: Finding, failed: list[Finding], others: Iterable[Finding] = ()
) -> tuple[float, bool]:
    """
    Return by how much a candidate lowers the error, and whether it heals its view.

    The error is that on data not fitted. ``others`` are candidates that may be there as well.

    """
    assert finding.effect is not None
    problem = state.problem
    model = unfitted(state.model).plus(type(finding.effect)())
    fall = fall_of(state.error, held_out(problem, model), [finding.effect])
    rivals = [g for g in others if g.effect is not None and g.name != finding.name]
    for g in rivals[:3]:
        if fall > FALL:
            break
        # the nearer a model comes, the more sticks out what is missing as well: look again with it
        beside = unfitted(state.model).plus(type(g.effect)())
        more = beside.plus(type(finding.effect)())
        fall = max(fall, fall_of(held_out(problem, beside), held_out(problem, more),
                                 [finding.effect]))
    fails = finding.view in {f.name for f in failed}
    return fall, not fails or fall <= FALL or heals(problem, model, finding, rivals)


def heals(problem: Problem, model: Model, finding: Finding, others: Iterable[Finding]) -> bool:
    """
    Tell whether a finding's view holds under a model with it, or with one or two others more.

    Several may be hidden at once, several of the same kind (lines) too.

    """
    rest = [g.effect for g in others]
    again = [finding.effect] * 2 if finding.effect.several else []
    singles = [*again[:1], *rest[:3]]
    for more in ([], *([e] for e in singles), [*again, *rest][:2]):
        tried = model
        for e in more:
            tried = tried.plus(type(e)())
        tests = problem.omnibus(_point_of(problem)(tried))
        # an effect that hides a view does not heal it
        seen = finding.view in {f.name for f in tests}
        if seen and finding.view not in {f.name for f in failures(tests)}:
            return True
    return False
