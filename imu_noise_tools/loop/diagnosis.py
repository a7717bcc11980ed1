# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The verdict on a model: what is missing from it, as far as was found, and what still fails."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from . import verdict as rules
from .against import DOUBT
from .effect import Finding, Model
from .findings import beyond_chance, failures, label, surplus
from .prediction import State
from .search import FROM_NOTHING, Search

LISTED = 8  # candidates that are listed
LITTLE = 0.01  # share of what fails that is next to nothing


@dataclass(frozen=True)
class Remaining:
    """
    What still fails with all that is found in the model.

    Attributes
    ----------
    failed : tuple of Finding
        The tests, each with where it fails.
    share : float or None
        Of the record's power that the model does not account for.
    largest_ratio : float or None
        Of measured to model Allan deviation, beyond what chance allows.
    sufficient : bool or None
        Whether it does not matter all the same.
    nearest : Finding or None
        The candidate that comes nearest; its ``against`` says what speaks against it.

    """

    failed: tuple[Finding, ...]
    share: float | None = None
    largest_ratio: float | None = None
    sufficient: bool | None = None
    nearest: Finding | None = None


@dataclass(frozen=True)
class Diagnosis:
    """
    What is missing from one target's model.

    Attributes
    ----------
    verdict : str
        ``missing``, ``complete``, ``unknown`` or ``undecidable``.
    ranked : tuple of Finding
        Candidates, those found first; what speaks against one is in its ``against``.
    failed : tuple of Finding
        The tests that fail with the model as it is.
    advice : str
        What to do next.
    found : tuple of Finding
        What is missing, in the order to add it.
    remaining : Remaining or None
        What then still fails; None where nothing does.
    sufficient : bool or None
        Whether what remains does not matter; None where that is not known.

    """

    verdict: str
    ranked: tuple[Finding, ...] = ()
    failed: tuple[Finding, ...] = ()
    advice: str = ''
    found: tuple[Finding, ...] = ()
    remaining: Remaining | None = None
    sufficient: bool | None = None


def diagnose(state: State, tried: Iterable[Finding] = ()) -> Diagnosis:
    """
    Return the verdict on one target; what was ``tried`` in vain is not found again.

    *missing*: something is found; *complete*: nothing fails and no candidate stands out;
    *unknown*: something fails and no candidate explains it; *undecidable*: otherwise.

    """
    search = Search(state, tried)
    chain = [f for f in search.settled() if not _as_nothing(f)]
    # what explains next to nothing by itself may raise an error that the others make
    found = sorted((f for f in chain if not f.against), key=_explains_little)
    failed = failures(search.places.tests(state.model)) or beyond_chance(state.error)
    # what was confirmed but shares its probability is in the model when the rest is judged
    left = _remaining(search, search.places.model_of(chain))
    rivals = [f for f in chain if f.against]
    if not rivals and not failed and left is None:
        rivals = [f for f in search.refuted.values() if f.against.startswith(DOUBT)]
    said = rules.word(len(found), len(rivals), len(failed) + (left is not None))
    ranked = _ranking(search, chain, found)
    telling = left.failed if left and not found else failed
    advice = state.problem.advice(said, ranked, list(telling))
    if said == 'complete':
        advice = '; '.join(x for x in (advice, state.problem.leave(state.model)) if x)
    enough = True if left is None else left.sufficient
    return Diagnosis(said, tuple(ranked), tuple(failed), advice, tuple(found), left, enough)


def _as_nothing(finding: Finding) -> bool:
    """
    Tell whether what stood out is next to certainly nothing, and nothing fails for its sake.

    What has many shapes to choose from gains more than one of them would by chance.

    """
    return (finding.against == FROM_NOTHING and finding.probability is not None
            and finding.probability <= rules.RIVAL and not finding.explains)


def _remaining(search: Search, model: Model) -> Remaining | None:
    """Return what fails with a model; None where nothing does."""
    places = search.places
    failed = failures(places.tests(model))
    error = None if failed else places.error(model)
    failed = failed or (beyond_chance(error) if error is not None else [])
    if not failed:
        return None
    place = places.at(model)
    weighed = (None, None, None) if place is None else places.problem.materiality(place.fit)
    near = [*search.refuted.values(), *(place.candidates if place else ())]
    near = [f for f in near if f.gain > f.penalty]
    nearest = max(near, key=surplus, default=None)
    return Remaining(tuple(failed), *weighed, nearest)


def _explains_little(finding: Finding) -> bool:
    """Tell whether what is found takes away less than LITTLE of what fails."""
    return finding.explains is not None and finding.explains < LITTLE


def _ranking(search: Search, chain: list[Finding], found: list[Finding]) -> list[Finding]:
    """
    Return the candidates: what was found, and the rest by probability.

    What was refuted stands before what gains no more than chance. Each name is listed once,
    but for what was found more than once.

    """
    places, base = search.places, search.places.base
    refuted = [f if f.against.startswith(DOUBT) else replace(f, probability=0.0)
               for f in sorted(search.refuted.values(), key=lambda f: -surplus(f))]
    first = places.at(base)
    other = [replace(f, probability=search.odds(base, label(base, f))[0])
             for f in (first.candidates if first is not None else ())
             if label(base, f) not in search.refuted]
    rest = sorted([*(f for f in chain if f.against), *refuted, *other],
                  key=lambda f: (f.gain <= f.penalty, -(f.probability or 0.0)))
    out, seen = found[:], {f.name for f in found}
    for f in rest:
        if f.name not in seen:
            out.append(f)
            seen.add(f.name)
    return out[:LISTED]
