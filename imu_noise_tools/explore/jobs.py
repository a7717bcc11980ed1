# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What takes long, as functions that another process can run; the last argument is progress.

They take a study and give it back: what they learnt on the way (fits, candidates) comes along.

"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .figure import Drawn, drawn
from .panels import names_of, panel_of, stated
from .. import store
from ..core.errors import FitError
from ..loop.effect import find_effect, Finding, registry
from ..loop.prediction import State
from ..loop.study import Study
from ..plots.panel import Stretch
from ..report import words
from ..tasks import loop as tasks, noise

Progress = Callable[[float | None, str], None]
LEAST = 0.01        # share of what fails in a stretch from which a candidate is worth a line
Models = dict[str, tuple[str, ...]]         # labels by target


@dataclass(frozen=True)
class Seen:
    """What takes a moment to work out of a target, ready before it is clicked."""

    panels: dict[str, Drawn]
    remarks: list[str]


Everything = dict[str, Seen]        # by target


def analyse(bag: str, folder: str, options: dict[str, Any], progress: Progress) -> None:
    """Analyse a bag into a study on disk."""
    noise.analyse(bag, folder, progress=progress, **options)


def load(folder: str, progress: Progress) -> tuple[Study, str, Everything]:
    """Return the study of a folder, the fingerprint of what it was read from, its panels."""
    progress(None, f'reading {Path(folder).name}')
    fingerprint = store.fingerprint(folder)
    study = store.load(folder)
    return study, fingerprint, look(study, study.targets)


def changed(function: Callable[..., Study], study: Study, *args: Any) -> tuple[Study, Everything]:
    """Return what a function makes of a study, and the panels of the targets that it changed."""
    before = dict(study.states)
    study = function(study, *args)
    return study, look(study, [t for t, s in study.states.items() if before.get(t) is not s])


def look(study: Study, targets: Sequence[str]) -> Everything:
    """Return what is to be seen of some targets."""
    return {t: seen(study.domain, study.states[t]) for t in targets}


def seen(domain: str, state: State) -> Seen:
    """Return every panel of a target, and what is to be said of its fit."""
    return Seen({view: draw(domain, state, view) for view in names_of(domain, state)},
                state.problem.remarks(state.fit))


def draw(domain: str, state: State, view: str, hand: str = '') -> Drawn:
    """Return one panel of a target; ``hand`` is the label of what was put in by hand."""
    return drawn(panel_of(domain, state, view), state.model.labels, hand)


def diagnose(study: Study, targets: Sequence[str], progress: Progress) -> Study:
    """Find out what is missing."""
    for k, t in enumerate(targets):
        progress(k / len(targets), f'{t}: looking for what is missing')
        study.diagnose([t])
    return study


def add(study: Study, target: str, effects: Sequence[str] | None, everything: bool,
        progress: Progress) -> Study:
    """Put effects, or what the diagnosis found, into a model."""
    progress(None, f'{target}: fitting')
    study.add(effects, [target], everything)
    return study


def remove(study: Study, target: str, label: str, progress: Progress) -> Study:
    """Take an effect out of a model."""
    progress(None, f'{target}: fitting without {label}')
    study.remove(label, [target])
    return study


def complete(study: Study, targets: Sequence[str], progress: Progress) -> Study:
    """Add what is missing until nothing is."""
    study.complete(targets, progress=progress)
    return study


def back(study: Study, models: Models, progress: Progress) -> Study:
    """Go back to models that were, by rungs of their own: a ladder forgets nothing."""
    for target, labels in models.items():
        now = study.states[target].model.labels
        progress(None, f'{target}: back to {" + ".join(labels)}')
        for label in [x for x in now if x not in labels]:
            study.remove(label, [target])
        gone = [x for x in labels if x not in now]
        if gone:
            study.add(gone, [target])
    return study


def files(study: Study, folder: str, progress: Progress) -> dict[str, str | bytes]:
    """Return all files of a study."""
    progress(None, 'writing the study and its report')
    return tasks.outputs(study, folder)


# --- what is this? -------------------------------------------------------------------------------

@dataclass(frozen=True)
class Candidate:
    """
    One effect that could explain a stretch.

    ``share`` is the part of what fails there that it would take away (0 to 1), ``values`` what it
    would be, ``against`` what speaks against it.

    """

    name: str
    title: str
    share: float
    gain: float
    penalty: float
    values: str
    evidence: str
    against: str

    @property
    def beyond_chance(self) -> bool:
        """Whether it gains more than chance would."""
        return self.gain > self.penalty and not self.against


@dataclass(frozen=True)
class Answer:
    """
    What a stretch of a panel is.

    ``makes`` is the share of each effect of the model in what the model says there; ``fails`` the
    sum of squared pulls beyond its expectation, with ``chance`` its two standard deviations.

    """

    stretch: Stretch
    makes: tuple[tuple[str, float], ...]
    fails: float
    chance: float
    candidates: tuple[Candidate, ...]

    @property
    def nearest(self) -> Candidate | None:
        """The known effect that comes nearest; None where nothing fails."""
        return self.candidates[0] if self.candidates and self.fails > self.chance else None


def identify(study: Study, target: str, view: str, stretch: Stretch,
             progress: Progress) -> tuple[Study, Answer]:
    """
    Say what a stretch of a panel is: what makes it, what fails there, and what would explain that.

    Each candidate is fitted into the model, to the whole record; then its pulls there are counted.

    """
    state = study.states[target]
    before = panel_of(study.domain, state, view)
    bins, fails = before.fails(stretch)
    chance = 2 * float(np.sqrt(2 * max(bins, 1)))
    found: list[Candidate] = []
    if fails > chance:
        progress(None, f'{target}: fitting what it could be')
        some = [f for f in state.problem.candidates(state.fit) if f.effect and f.gain > 0]
        for k, f in enumerate(some):
            progress(k / len(some), f'{target}: {f.name} there')
            share = _share(study.domain, state, view, stretch, f.name, fails)
            if share is not None and share > LEAST:
                found.append(Candidate(
                    f.name, registry(study.domain)[f.name].title, share, f.gain, f.penalty,
                    words.parameters_of(f, target), f.evidence, f.against or _refuted(study, f,
                                                                                      target)))
    found.sort(key=lambda c: (-round(c.share, 2) * c.beyond_chance, -c.share))
    return study, Answer(stretch, before.makes(stretch), fails, chance, tuple(found))


def _share(domain: str, state: State, view: str, stretch: Stretch, name: str,
           fails: float) -> float | None:
    """Return which part of what fails in a stretch a candidate takes away."""
    try:
        more = stated(state, state.model.plus(find_effect(domain, name)()))
        left = panel_of(domain, more, view).fails(stretch)[1]
    except FitError:
        return None
    return float(np.clip(1 - left / fails, 0, 1))


def _refuted(study: Study, finding: Finding, target: str) -> str:
    """Return what the last diagnosis had against a candidate."""
    d = study.diagnosis.get(target)
    known = {f.name: f.against for f in (*d.ranked, *d.found)} if d else {}
    return known.get(finding.name, '')
