"""The verdict on a calibration model: what is missing, nothing, something unknown, or more than the poses tell."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..effect import find_effect, Finding, Fit, Model
from .problem import CalibrationProblem

LEVEL = 0.005           # of all tests together (Holm), and of the largest gain of all candidates
SURE = 0.9              # probability from which a name is given alone


@dataclass(frozen=True)
class Diagnosis:
    """
    What is missing in a model of one target.

    ``verdict`` is ``missing``, ``complete``, ``unknown`` or ``undecidable``; ``ranked`` holds the candidates that
    matter with their probability; ``failed`` the tests that failed; ``blind`` (effect, why, what would show it)
    what the record cannot show at all; ``advice`` is one sentence for people.

    """

    target: str
    verdict: str
    ranked: tuple[Finding, ...] = ()
    failed: tuple[Finding, ...] = ()
    advice: str = ''
    blind: tuple[tuple[str, str, str], ...] = ()


def holm(findings, level: float = LEVEL) -> list[Finding]:
    """Return the tests that fail when all of them together may fail with this probability (Holm 1979)."""
    failed = []
    for k, f in enumerate(sorted(findings, key=lambda f: f.p_value)):
        if f.p_value * (len(findings) - k) >= level:
            break
        failed.append(f)
    return failed


def weighed(candidates) -> list[Finding]:
    """Return the candidates with their probabilities: BIC weights, equal priors, nothing at all among them."""
    if not candidates:
        return []
    score = np.array([c.gain - c.penalty for c in candidates] + [0.0])
    weight = np.exp(score - score.max())
    weight /= weight.sum()
    ranked = [replace(c, probability=float(w)) for c, w in zip(candidates, weight)]
    return sorted(ranked, key=lambda c: -c.probability)


def significant(candidates, level: float = LEVEL) -> list[Finding]:
    """Return the candidates that chance would give among so many with less than this probability."""
    return [c for c in candidates if c.p_value * len(candidates) < level]


def enough(ranked, share: float = SURE) -> list[Finding]:
    """Return the first candidates that together have this probability."""
    total, out = 0.0, []
    for c in ranked:
        out.append(c)
        total += c.probability
        if total >= share:
            break
    return out


def diagnose(problem: CalibrationProblem, fit: Fit) -> Diagnosis:
    """Return the verdict on a fitted model; a name is given alone only when left-out poses confirm it."""
    failed, candidates = holm(problem.omnibus(fit)), problem.candidates(fit)
    blind = tuple(problem.blind(fit))
    strong = significant(candidates)
    if not strong:
        verdict = 'unknown' if failed else 'complete'
        return Diagnosis(problem.target, verdict, (), tuple(failed), _advice(verdict, (), failed, blind), blind)
    ranked = weighed(candidates)
    best = ranked[0]
    verdict = 'undecidable'
    if best.probability >= SURE and best in _same(strong, ranked):
        verdict = _confirmed(problem, fit, best)
    if verdict == 'unknown' and not failed:
        verdict = 'undecidable'
    shown = (best,) if verdict == 'missing' else tuple(enough(ranked)) if verdict == 'undecidable' else ()
    return Diagnosis(problem.target, verdict, shown, tuple(failed), _advice(verdict, shown, failed, blind), blind)


def _same(strong, ranked):
    names = {c.name for c in strong}
    return [c for c in ranked if c.name in names]


def _confirmed(problem, fit, best) -> str:
    """Return ``missing`` when poses left out agree and the tests heal, else what is to be said instead."""
    rank = max(1, round(best.penalty / (0.5 * np.log(len(fit.details['equations'].right)))))
    more = problem.fit(Model([*fit.model, type(best.effect)()]))
    gained, bins = problem.left_out(more).improvement(problem.left_out(fit))
    if not bins or bins < rank:
        return 'undecidable'
    if gained < 2 * np.sqrt(rank / 2):
        return 'unknown'
    if holm(problem.omnibus(more)) and not significant(problem.candidates(more)):
        return 'unknown'
    return 'missing'


def _advice(verdict, shown, failed, blind) -> str:
    if verdict == 'missing':
        return f'add {shown[0].name}: {shown[0].effect.hint}'
    if verdict == 'undecidable':
        needs = dict.fromkeys(c.effect.needs for c in shown if c.effect.needs)
        names = ' and '.join(c.name for c in shown)
        return f'these poses cannot tell {names} apart; record {"; or ".join(needs)}' if len(shown) > 1 else (
            f'{names} fits, but no pose left over confirms it; record {"; or ".join(needs)}')
    if verdict == 'unknown':
        return f'no known effect explains it ({"; ".join(f.evidence for f in failed)}); look at these poses, ' \
               'hold them again'
    hidden = [name for name, _, _ in blind]
    return 'nothing is missing' + (f'; these poses could not show {", ".join(hidden)}' if hidden else '')


def needs_of(name: str) -> str:
    """Return the poses that would show an effect."""
    return find_effect('calibration', name).needs
