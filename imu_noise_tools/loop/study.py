# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The loop, for any problem: compare, diagnose, add, remove, and the history of what was tried.

Knows only what a :class:`~imu_noise_tools.loop.problem.Problem` is: nothing of noise, calibration
or filters, no files.

"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from . import verdict as rules
from .diagnosis import diagnose, Diagnosis
from .effect import Effect, find_effect, Finding, Model, Score, unfitted
from .prediction import fall_in_words, fall_of, State
from .problem import Problem
from ..core.errors import unknown

TRIED = 'it was added, raised the error and was taken back'

Progress = Callable[[float | None, str], None]      # (share done, what)
LOOKS = 'looks for what is missing'


@dataclass(frozen=True)
class Contrast:
    """The view that a rung changed most: pulls (k,) at x before and after it."""

    view: str
    unit: str
    x: tuple[float, ...]
    before: tuple[float, ...]
    after: tuple[float, ...]

    @classmethod
    def of(cls, before: Score, after: Score, effects: Iterable[Effect] = ()) -> Contrast | None:
        """
        Return the contrast of two models of the same data; None where no view can be compared.

        The views in which the effects are judged come first, of those the one whose sum of
        squared pulls changes most.

        """
        named = {name for e in effects for name in e.views}
        able = {name: a for name, a in after.views.items()
                if name in before.views and np.array_equal(before.views[name].x, a.x)}
        names = named & set(able) or set(able)
        if not names:
            return None
        change = {n: abs(float(np.sum(before.views[n].pull**2) - np.sum(able[n].pull**2)))
                  for n in names}
        name = max(sorted(names), key=lambda n: change[n])
        view = able[name]
        # a picture needs no more digits, and what is read back is what was written
        x, old, new = (tuple(float(v) for v in np.asarray(a, np.float32))
                       for a in (view.x, before.views[name].pull, view.pull))
        return cls(name, view.unit, x, old, new)


@dataclass(frozen=True)
class Step:
    """
    One rung of the ladder: what was fitted and how well it predicts data it has not seen.

    ``fall`` is the deviance gained on data not fitted, ``failing`` names the views that still
    fail, ``why`` is what a diagnosis had found of what was added, ``contrast`` what it changed,
    ``moved`` (label, parameter) the values of which the interval does not meet the one before.

    """

    target: str
    effects: tuple[str, ...]
    held_out: float
    held_out_std: float
    added: str | None = None
    removed: str | None = None
    fall: float | None = None
    verdict: str = ''
    failing: tuple[str, ...] = ()
    why: tuple[Finding, ...] = ()
    contrast: Contrast | None = None
    moved: tuple[tuple[str, str], ...] = ()


def assess(problem: Problem, model: Model, intervals: bool = True) -> State:
    """
    Fit a model to a target and score it on data not fitted.

    Without the intervals of the values, which the error does not need, it takes half the time.

    """
    model = unfitted(model)
    fit = problem.fit(model) if intervals else problem.point(model)
    return State(problem, fit, problem.held_out(model), problem.summary(fit))


def _moved(before: State, after: State) -> tuple[tuple[str, str], ...]:
    """Return (label, parameter) of each value whose intervals before and after do not meet."""
    out = []
    for label, estimates in before.fit.estimates.items():
        for name, old in estimates.items():
            new = after.fit.estimates.get(label, {}).get(name)
            if new is not None and old.ci95 and new.ci95 and None not in (old.value, new.value) \
                    and (new.ci95[0] > old.ci95[1] or new.ci95[1] < old.ci95[0]):
                out.append((label, name))
    return tuple(out)


#: called with a target and its new rung, or None where its verdict is there
Told = Callable[[str, Step | None], None]


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
        source: Mapping[str, Any] | None = None,
        history: Iterable[Step] = (),
        diagnosis: Mapping[str, Diagnosis] | None = None,
    ) -> None:
        self.domain = domain
        self.states = dict(states)
        self.source = dict(source or {})
        self.history = list(history)
        self.diagnosis = dict(diagnosis or {})

    @classmethod
    def begin(
        cls, problems: Mapping[str, Problem], model: Model,
        source: Mapping[str, Any] | None = None, progress: Progress | None = None,
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

    @property
    def settled(self) -> list[str]:
        """Targets whose model has its verdict, which finds nothing more to add."""
        return [t for t in self.states if t in self.diagnosis and not self.diagnosis[t].found]

    def chosen(self, targets: Iterable[str] | None) -> list[str]:
        """Return the targets that are named, all for None; raise UsageError for an unknown one."""
        if targets is None:
            return self.targets
        for t in targets:
            if t not in self.states:
                raise unknown('axis', t, self.states)
        return list(dict.fromkeys(targets))

    def _step(
        self, target: str, added: str | None = None, removed: str | None = None,
        before: State | None = None, why: Iterable[Finding] = (), found: bool = True,
    ) -> Step:
        """Return a rung; what was not ``found`` but chosen must do more than chance may."""
        state = self.states[target]
        fall, verdict, contrast = None, 'start', None
        if before is not None:
            changed = [
                e
                for e in (*before.model, *state.model)
                if not (e.label in before.model and e.label in state.model)
            ]
            fall = fall_of(before.error, state.error, changed)
            least = rules.FALL if found else max(map(before.problem.falls_by_chance, changed))
            verdict = fall_in_words(before.error, state.error, fall, least)
            contrast = Contrast.of(before.error, state.error, changed)
        return Step(
            target,
            tuple(state.model.labels),
            state.error.excess,
            state.error.std,
            added,
            removed,
            fall,
            verdict,
            tuple(state.error.failing),
            tuple(why),
            contrast,
            _moved(before, state) if before is not None else (),
        )

    def compare(self, targets: Iterable[str] | None = None) -> dict[str, Score]:
        """Return, for each target, the held-out deviance, view by view."""
        return {t: self.states[t].error for t in self.chosen(targets)}

    def diagnose(
        self, targets: Iterable[str] | None = None, progress: Progress | None = None,
        told: Told | None = None,
    ) -> dict[str, Diagnosis]:
        """
        Find out what is missing from each target's model; ``told`` hears of each verdict.

        What raised the error when it was added to this very model, and was taken out again, is
        not found once more.

        """
        names = self.chosen(targets)
        for i, t in enumerate(names):
            if progress:
                progress(i / len(names), f'{t}: {LOOKS}')
            self.diagnosis[t] = diagnose(self.states[t], self._tried(t))
            if told:
                told(t, None)
            if progress:
                progress((i + 1) / len(names), f'{t}: {self.diagnosis[t].verdict}')
        return {t: self.diagnosis[t] for t in names}

    def add(
        self, effects: Iterable[str] | None = None, targets: Iterable[str] | None = None,
        everything: bool = False
    ) -> list[Step]:
        """
        Put effects into the model of the targets.

        Without names, the first that the diagnosis found for each target, with ``everything`` all
        that it found.

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
                found = [f.name for f in self.diagnosis[t].found]
                if found:
                    plan[t] = found if everything else found[:1]
        steps = []
        for t, names in plan.items():
            before = self.states[t]
            model = before.model
            for name in names:
                model = model.plus(find_effect(self.domain, name)())
            self.states[t] = assess(before.problem, model)
            steps.append(self._step(t, added='+'.join(names), before=before,
                                    why=self._reasons(t, names), found=self._found(t, names)))
        self.history += steps
        self._forget(plan)
        return steps

    def remove(self, label: str, targets: Iterable[str] | None = None) -> list[Step]:
        """
        Take an effect out of the model of each target that has it.

        Raise UsageError where none has it.

        """
        names = [t for t in self.chosen(targets) if label in self.states[t].model]
        if not names:
            some = sorted({x for t in self.chosen(targets) for x in self.states[t].model.labels})
            raise unknown('label', label, some)
        steps = []
        for t in names:
            before = self.states[t]
            self.states[t] = assess(before.problem, before.model.minus(label))
            steps.append(self._step(t, removed=label, before=before))
        self.history += steps
        self._forget(names)
        return steps

    def undo(self, targets: Iterable[str] | None = None) -> list[Step]:
        """Take out what each target's last rung put in; an empty list where nothing was added."""
        steps = []
        for t in self.chosen(targets):
            base = next(s for s in self.history if s.target == t)
            extra = [x for x in self.states[t].model.labels if x not in base.effects]
            if extra:
                steps += self.remove(extra[-1], [t])
        return steps

    def complete(
        self, targets: Iterable[str] | None = None, most: int = 12,
        progress: Progress | None = None, told: Told | None = None,
        keep: Callable[[], None] | None = None,
    ) -> list[Step]:
        """
        Diagnose and add until nothing more is found in any target; return all rungs.

        Of what is found the first that raises nothing is added: one may show only beside another;
        where each of them raises something, all of it.
        A rung that raises the held-out deviance, or the printed error beyond what chance allows,
        is taken back, and what it added is not found again. ``told`` hears of each rung, and of
        each last verdict; ``keep`` is called where what there is may be written: after a rung
        that stands, and after a last verdict.

        """
        steps: list[Step] = []

        def climbed(step: Step) -> None:
            steps.append(step)
            if told:
                told(step.target, step)

        for t in self.chosen(targets):
            in_vain: list[list[str]] = []
            for _ in range(most):
                if progress:
                    progress(None, f'{t}: {LOOKS} beside {self.states[t].model}')
                self.diagnose([t])
                if progress:
                    progress(None, f'{t}: {self.diagnosis[t].verdict}')
                names = [f.name for f in self.diagnosis[t].found]
                if not names or names in in_vain:
                    break
                before, rung = self.states[t], self._next(t)
                climbed(rung)
                if self._higher(t, before, rung):
                    climbed(self._taken_back(t, before, rung))
                    in_vain.append(names)
                if keep:
                    keep()
            self.diagnose([t])
            if keep:
                keep()
            if told:
                told(t, None)
        return steps

    def _next(self, target: str) -> Step:
        """
        Add the first of what was found that raises no error, or all together.

        The first where that does, too. Of several steps each alone may leave more to see.

        """
        before, said, rungs = self.states[target], self.diagnosis[target], len(self.history)
        found = [f.name for f in said.found]
        tries = [[name] for name in dict.fromkeys(found)]
        if len(found) > 1:
            tries.append(found)
        for names in tries:
            (step,) = self.add(names, [target])
            if not self._higher(target, before, step):
                return step
            self.states[target], self.diagnosis[target] = before, said
            del self.history[rungs:]
        return self.add(None, [target])[0]

    def _higher(self, target: str, before: State, step: Step) -> bool:
        """Tell whether a rung raised the held-out deviance, or the printed error beyond chance."""
        now = self.states[target].error
        return step.fall is not None and step.fall < 0 \
            or now.excess > before.error.excess and not now.within_chance

    def _taken_back(self, target: str, state: State, step: Step) -> Step:
        """Return to the state before a rung; append the rung that says so."""
        label = next(x for x in step.effects if x not in state.model)
        after, self.states[target] = self.states[target], state
        self.history.append(self._step(target, removed=label, before=after))
        self._forget([target])
        return self.history[-1]

    def _tried(self, target: str) -> list[Finding]:
        """Return what raised the error when it was added to the model as it is, and went again."""
        rungs = [s for s in self.history if s.target == target]
        here = tuple(self.states[target].model.labels)
        return [replace(f, against=TRIED) for up, back in zip(rungs, rungs[1:])
                if up.added and back.removed and back.effects == here
                and up.fall is not None and (up.fall < 0 or up.verdict in rules.NO_BETTER
                                             and up.held_out > back.held_out)
                for f in up.why]

    def _reasons(self, target: str, names: Iterable[str]) -> list[Finding]:
        """Return what the last diagnosis of a target found of each of these effects, if it did."""
        d = self.diagnosis.get(target)
        known = {f.name: f for f in (*reversed(d.ranked), *reversed(d.found))} if d else {}
        return [known[n] for n in dict.fromkeys(names) if n in known]

    def _found(self, target: str, names: Iterable[str]) -> bool:
        """Tell whether the last diagnosis of a target found all of these effects."""
        d = self.diagnosis.get(target)
        return d is not None and set(names) <= {f.name for f in d.found}

    def _forget(self, targets: Iterable[str]) -> None:
        for t in targets:
            self.diagnosis.pop(t, None)
