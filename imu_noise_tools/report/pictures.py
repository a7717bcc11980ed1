# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The pictures of a study's report, each as PNG bytes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

from .words import change, failing
from ..core.errors import FitError
from ..loop.diagnosis import Diagnosis
from ..loop.domains import part
from ..loop.effect import find_effect, Finding, Model, unfitted
from ..loop.prediction import State
from ..loop.study import Step, Study
from ..plots import ladder, proof, signed, style

MOST_TARGETS = 2          # targets shown in full
MOST_PROOFS = 16          # a page is one file that can be mailed


def pictures(study: Study) -> dict[str, bytes]:
    """
    Return the pictures of a study by name.

    Those of its domain, with the targets that fail most in full where it has such pictures;
    ``ladder`` where something was added or removed; ``added``, ``found`` and ``unexplained``, with
    target and label, are the proofs of what is in the model, missing, or not known.

    """
    out: dict[str, bytes] = {}
    if all(s.problem is not None for s in study.states.values()):
        out.update(part('plots', study.domain).pictures(study, worst_targets(study)))
        for name, data in _proofs(study):
            if sum(k.partition(' ')[0] in ('added', 'found', 'unexplained')
                   for k in out) < MOST_PROOFS:
                out[name] = data
    if any(s.added or s.removed for s in study.history):
        out['ladder'] = style.png(signed.signed(ladder.ladder_figure(study), study.source))
    return out


def worst_targets(study: Study) -> list[str]:
    """Return the targets that fail most, judged by their worst view."""
    worst = {t: max((v.over / v.std for v in failing(s.error)), default=0.0)
             for t, s in study.states.items()}
    return [t for t in sorted(worst, key=lambda t: -worst[t]) if worst[t] > 0][:MOST_TARGETS]


def rung(before: Step, step: Step) -> bytes:
    """Return the picture of what a rung of the ladder changed, in the view that shows it."""
    assert step.contrast is not None
    return style.small_png(style.png(ladder.contrast_figure(
        step.contrast, f'before: {" + ".join(before.effects)}', f'after: {change(step)}')))


# --- proofs --------------------------------------------------------------------------------------

def _proofs(study: Study) -> Iterator[tuple[str, bytes]]:
    """Yield name and picture of what is missing or not known, then of what was added."""
    for t, state in study.states.items():
        if t in study.diagnosis:
            yield from _of_diagnosis(study.domain, t, state, study.diagnosis[t])
    for t, state in study.states.items():
        steps = [s for s in study.history if s.target == t]
        for before, step in zip(steps, steps[1:]):
            new = new_labels(before, step)
            if new and all(x in state.model for x in new):
                view = step.contrast.view if step.contrast else ''
                less = _without(state, new)
                if less is not None:
                    yield (f'added {t} {"+".join(new)}',
                           _proof(
                               study.domain, less, state, new,
                               _views(*new, state=state, first=view), '+'.join(new)))


def new_labels(before: Step, step: Step) -> list[str]:
    """Return the labels that a rung put into the model."""
    return [x for x in step.effects if x not in before.effects] if step.added else []


def _of_diagnosis(domain: str, target: str, state: State,
                  d: Diagnosis) -> Iterator[tuple[str, bytes]]:
    now: State | None = state
    for f in d.found or (d.ranked[:1] if d.verdict == 'undecidable' else ()):
        more = _with(now, f)
        if now is None or more is None:
            return
        label = more.model.labels[-1]
        yield f'found {target} {f.name}', _proof(
            domain, now, more, [label], _views(label, state=more, first=f.view), label)
        now = more
    if now is None or not (d.remaining or d.verdict == 'unknown'):
        return
    near = nearest(d)
    more = _with(now, near) if near else None
    tests = d.remaining.failed if d.remaining else d.failed
    labels = more.model.labels[-1:] if more else []
    yield f'unexplained {target}', _proof(
        domain, now, more or now, labels,
        [*(f.view for f in tests), *_views(*labels, state=more or now, first='')],
        near.name if near else '')


def nearest(d: Diagnosis) -> Finding | None:
    """Return the known effect that comes nearest to what is not explained, though rejected."""
    if d.remaining is not None and d.remaining.nearest is not None:
        return d.remaining.nearest
    return next((f for f in d.ranked if f.against and f not in d.found), None)


def _without(state: State, labels: Sequence[str]) -> State | None:
    """Return a target without some of its effects; None where that cannot be."""
    model = state.model
    for label in labels:
        model = model.minus(label)
    return _of_model(state, model)


def _with(state: State | None, finding: Finding) -> State | None:
    """Return a target with one more effect; None where that cannot be."""
    if state is None:
        return None
    effect = find_effect(state.problem.domain, finding.name)
    if finding.name in state.model and not effect.several:
        return None
    return _of_model(state, state.model.plus(finding.effect or effect()))


def _of_model(state: State, model: Model) -> State | None:
    """Return a target with another model, fitted where that takes no more than a moment."""
    try:
        if state.problem.looks:
            return replace(state, fit=state.problem.point(unfitted(model)))
    except FitError:
        return None
    return replace(state, fit=replace(state.fit, model=model)) if all(
        e.fitted for e in model) else None


def _proof(domain: str, before: State, after: State, labels: Sequence[str],
           views: Iterable[str], name: str) -> bytes:
    old, new = (part('plots', domain).panels(s) for s in (before, after))
    own = [new[k]() for k in new if k not in old]
    both = [k for k in old if k in new]
    view = next((v for v in views if v in both), both[0])
    a = old[view]()
    b = a if after is before else new[view]()
    return style.small_png(style.png(proof.proof_figure(a, b, labels, own, name)))


def _views(*labels: str, state: State, first: str) -> list[str]:
    """Return views in which effects may be seen, the most telling first."""
    return [first, *(v for label in labels for v in state.model[label].views),
            *state.error.failing]
