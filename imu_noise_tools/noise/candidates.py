# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What could be missing from a model.

Every registered effect is tried, with the log-likelihood it gains.

"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import cast, NamedTuple, TYPE_CHECKING

import numpy as np

from . import in_time, views
from .coupled import heard_at, why_no_coupling
from .doubts import at_bound, hidden_by_steps, of_levels, of_rounding
from .evidence import Evidence
from .fit import fit as fit_part
from .flexible import asks_nothing
from .gains import (
    gain_of, gained_by, penalty_of, price_by_chance, shapes_of, unlikely, within_means
)
from .kinds import (
    Coupling, is_peak, Line, Mean, MEASURED, Modulation, NoiseEffect, Response, Spectrum
)
from .lines import line_penalty
from .measured import measure, penalty, with_units
from .refitted import by_its_middle, refitted, within_bounds
from .rivals import swept
from .shared import LATER, SHAKEN
from .starts import SHOWS
from ..loop.effect import Effect, Finding, Fit, Model, registry, unfitted
from ..loop.findings import price, surplus
from ..loop.verdict import DIRECTED, PRICE

if TYPE_CHECKING:
    from .problem import NoiseProblem


class Tried(NamedTuple):
    """
    A candidate that was tried beside a model; its finding is None where it does not apply.

    ``whole`` and ``partly`` are what it gains, nats, where it is fitted to the spectrum: of bands
    that it does not explain nothing, or what it explains of them. A ``peak`` is found by the
    latter.

    """

    finding: Finding | None
    whole: float = -np.inf
    partly: float = -np.inf
    peak: bool = False


def candidates(problem: NoiseProblem, fit: Fit,
               wanted: Callable[[type[Effect]], bool] | None = None) -> list[Finding]:
    """
    Return a finding for each registered effect, best first; if asked for, of some kinds alone.

    Left out are effects that are in the model or do not apply to the record.

    ``gain`` is the log-likelihood gained over the model as it is, summed over the views the effect
    acts on; ``penalty`` what chance reaches on records in which nothing is hidden
    (:func:`penalty`).

    """
    evidence: Evidence = problem.evidence
    if problem.method != 'likelihood':
        fit = fit_part(evidence, unfitted(fit.model), intervals=False)
    explained = {x for e in fit.model.of(NoiseEffect) for x in e.explains}
    # further on, where the spectrum asks for nothing, nothing is fitted to it
    quiet = bool(problem.tried) and not problem.knows_candidates(fit) and asks_nothing(
        evidence, fit)
    tried: list[Tried] = []
    for name, known in registry('noise').items():
        cls = cast('type[NoiseEffect]', known)
        if _has_enough(fit.model, cls) or wanted and not wanted(cls):
            continue
        if cls.explains and set(cls.explains) <= explained:
            continue
        if quiet and issubclass(cls, (Spectrum, Response)) and not issubclass(cls, MEASURED) \
                and not (issubclass(cls, Spectrum) and cls().path(evidence) is not None):
            continue
        # what is read from the samples is out of the spectrum: beside it others gain as before
        key = (*problem.spectral(fit.model), name)
        if issubclass(cls, Line) or key not in problem.tried:
            problem.tried[key] = _one(problem, fit, cls())
        tried.append(problem.tried[key])
    if wanted is None:
        problem.complete.add(problem.spectral(fit.model))
    # what a view hides nothing could confirm
    some = [f for f in by_one_measure(tried) if not views.hidden_by(evidence, fit, f.view)]
    some = as_likely_beforehand(problem, fit, some)
    return sorted(clear_of_less(some), key=lambda f: f.penalty - f.gain)


def _has_enough(model: Model, cls: type[NoiseEffect]) -> bool:
    """Tell whether a model has as many of a kind as are looked for."""
    return sum(e.name == cls.name for e in model) >= (cls.most if cls.several else 1)


def as_likely_beforehand(problem: NoiseProblem, fit: Fit,
                         findings: list[Finding]) -> list[Finding]:
    """
    Return the findings, a mean that follows what is recorded counted by its plain form if better.

    What has many ways to read a record must gain the more over nothing for it. One that chooses
    none of them costs what one free parameter does. Where it does what a course does that the mean
    may have by itself, both are there or neither, and it costs no less than that: what settles
    does so as what it follows does, and between the two the data alone decide.

    """
    courses = [f for f in findings if isinstance(f.effect, Mean) and f.gain > f.penalty
               and not f.against and f.effect.plain() is None]
    best = max(courses, key=surplus, default=None)
    # a shape that is free gains half a nat of what it does by chance
    cost = DIRECTED if best is None else price(best) - 0.5 * best.shapes
    return [_plainly(problem, fit, f, cost) if isinstance(f.effect, Mean) else f for f in findings]


def _plainly(problem: NoiseProblem, fit: Fit, finding: Finding, cost: float) -> Finding:
    """Return a finding as its plain form is counted at a cost, nats, where that stands out."""
    plain = cast(Mean, finding.effect).plain()
    if plain is None or not problem.evidence.starts(plain):
        return finding
    key = (*problem.spectral(fit.model), f'{finding.name} plainly')
    if key not in problem.tried:
        more = refitted(problem.evidence, fit, plain)
        problem.tried[key] = Tried(None, gain_of(problem.evidence, fit, more, False))
    counted = replace(finding, gain=problem.tried[key].whole, penalty=cost, shapes=0)
    return counted if surplus(counted) > max(surplus(finding), 0.0) else finding


def by_one_measure(tried: list[Tried]) -> list[Finding]:
    """
    Return the findings, a peak counted as its rivals are where one of them explains more.

    What a peak explains of bands that are not of its form counts, or none would be found; of
    another form it does not, which may bend to anything. Where what stands out without that
    explains more than the peak by the peak's own measure, beyond chance and for what it has to
    choose, it is no peak that is there.

    """
    some = [(t, t.finding, t.partly - t.finding.penalty - PRICE * t.finding.shapes)
            for t in tried if t.finding is not None and np.isfinite(t.finding.gain)]
    most = max((worth for t, f, worth in some
                if not t.peak and not f.against and f.gain > f.penalty),
               default=-np.inf)
    return [replace(f, gain=t.whole) if t.peak and worth < most else f for t, f, worth in some]


def clear_of_less(findings: list[Finding]) -> list[Finding]:
    """
    Return the findings, with what speaks against those that are another one and no more.

    An effect that holds all that another one explains stands for what it explains beyond, by which
    it must gain more than one free parameter does by chance. Between the two there is no choice
    that a better record would have to make: what both hold is there.

    """
    out = []
    for f in findings:
        less = max((g for g in findings
                    if _holds(type(f.effect), type(g.effect)) and not g.against),
                   key=lambda g: g.gain, default=None)
        if less is not None and less.gain > less.penalty and f.gain - less.gain <= DIRECTED:
            f = replace(f, against=f.against or _more(f.gain - less.gain, less.name))
        out.append(f)
    return out


def no_more_than_less(problem: NoiseProblem, fit: Fit, label: str) -> str:
    """
    Say that beside the others an effect of a model is no more than another one that it holds.

    As a candidate it may have been more: then it explained some of what they do.

    """
    for name, cls in registry('noise').items():
        if _holds(type(fit.model[label]), cls) and name not in fit.model:
            less = problem.point(Model((*unfitted(fit.model.minus(label)), cls())))
            beyond = gained_by(problem.evidence, less, fit)
            if beyond <= DIRECTED:
                return _more(beyond, name)
    return ''


def no_more_than_chance(problem: NoiseProblem, fit: Fit, without: Fit, label: str) -> str:
    """
    Say that beside the others a broad effect of a model gains no more than chance reaches.

    As a candidate it may have done what one of them does, which was not there yet.

    """
    effect = fit.model[label]
    if not isinstance(effect, (Spectrum, Response)) or effect.certain or is_peak(effect):
        return ''
    estimates = fit.estimates.get(label, {})
    beyond = gained_by(problem.evidence, without, fit)
    wanted = price(Finding(effect.name, beyond, effect, penalty=penalty_of(effect),
                           shapes=shapes_of(effect, estimates) if estimates else 0))
    if beyond < wanted:     # what the samples say against it is said as that
        beyond += max(effect.bonus(problem.evidence, fit), 0.0)
    return f'beside the others it gains {beyond:.1f} nats, chance reaches {wanted:.1f}' \
        if beyond < wanted else ''


def _holds(one: type, other: type) -> bool:
    """Tell whether an effect explains all that another one does, and more."""
    return issubclass(one, NoiseEffect) and issubclass(other, NoiseEffect) \
        and bool(other.explains) and set(other.explains) < set(one.explains)


def _more(gain: float, name: str) -> str:
    return f'it gains {gain:.1f} nats more than the {name} that it holds'


def _one(problem, fit: Fit, effect: NoiseEffect) -> Tried:
    evidence: Evidence = problem.evidence
    if isinstance(effect, Line):
        return Tried(_line(evidence, fit, effect))
    if isinstance(effect, MEASURED):
        return Tried(_measured(evidence, fit, effect))
    if not evidence.starts(effect):
        return Tried(None)
    more = within_bounds(evidence, fit, refitted(evidence, fit, effect))
    more = by_its_middle(evidence, fit, more)
    problem.begin_from(more)
    label = more.model.labels[-1]
    added = cast(NoiseEffect, more.model[label])
    bonus = added.bonus(evidence, more)
    where = _where(evidence, fit, more, effect)
    if abs(bonus) > 1:
        said = 'for' if bonus > 0 else 'against'
        where += f'; the samples themselves speak {said} it by {abs(bonus):.0f} nats'
    manner = added.manner(evidence)
    where = '; '.join(filter(None, (where, manner)))
    peak = is_peak(added)
    whole, partly = (gain_of(evidence, fit, more, k) for k in (False, True))
    fast = within_means(evidence, fit, more) if isinstance(effect, Mean) else 0.0
    bound = at_bound(evidence, added, more.estimates[label])
    bound += f': {manner}' if bound and manner else ''
    finding = Finding(
        effect.name,
        float(partly if peak else whole) + bonus,
        added,
        more.estimates[label],
        price_by_chance(added, evidence) + unlikely(more),
        _view_of(effect),
        where,
        against=bound or added.part_of(more.model)
        or of_rounding(evidence, fit.model, added)
        or hidden_by_steps(evidence, fit.model, added) or of_levels(evidence, fit.model, added)
        or (why_no_coupling(evidence, more, label) if isinstance(effect, Coupling) else '')
        # one peak after the other would follow a line that moves, and all would fall in the end
        or (swept(evidence, added, max(whole, partly)) if peak else ''),
        shapes=shapes_of(effect, more.estimates[label]),
        elsewhere=bonus + fast,
        samples=bonus,
        bounded=bool(bound),
    )
    return Tried(finding, whole, partly, peak)


def _line(evidence, fit, effect):
    left = views.lines_left(evidence, fit.model)
    rows = effect.rows(evidence, left)
    if not rows:
        return None
    # the lines that are left must not be taken for those in the model
    claimed = set(range(len(evidence.line_table))) - set(left)
    values, estimates, _ = measure(evidence, effect, claimed)
    added = np.sum(evidence.whole.lines[rows], axis=0)
    gain = 0.5 * float(np.sum(evidence.whole.bins.count * added / fit.details.v))
    return Finding(effect.name, gain, effect.with_values(**values), estimates,
                   line_penalty(evidence.n, len(claimed)), 'frequency',
                   effect.in_words(evidence, rows))


def _measured(evidence, fit, effect):
    here = in_time.beside(evidence, fit.model) if isinstance(effect, Modulation) else evidence
    finding = here.measured(effect)
    if finding is None or finding.effect is None:
        return None
    finding = with_units(finding, evidence)
    gain = finding.gain
    if isinstance(effect, (Spectrum, Response)):
        more = refitted(evidence, fit, effect)
        gain += float(gain_of(evidence, fit, more, False))
    return replace(finding, gain=float(gain), penalty=penalty(effect.name))


def _view_of(effect):
    if isinstance(effect, Mean):
        return 'time'
    return 'coherence' if isinstance(effect, Coupling) else 'frequency'


def _where(evidence, before: Fit, after: Fit, effect) -> str:
    """Say in words where the likelihood is gained."""
    if isinstance(effect, Mean):
        estimates = after.estimates[after.model.labels[-1]]
        # a choice is a word, and of what may be nothing there is nothing to say
        parts = [
            f'{p.name} {e.point:.3g}' + (f' +- {e.std:.2g}' if e.std else '') + f' {e.unit}'
            for p in effect.parameters
            if not p.choices and (e := estimates.get(p.name)) and e.point
            and abs(e.point) > 2 * (e.std or 0.0)
        ]
        return ': '.join(filter(None, ('the mean of the record follows it', ', '.join(parts))))
    if isinstance(effect, Coupling):
        fitted = cast(Coupling, after.model[after.model.labels[-1]])
        estimates = after.estimates[fitted.label]
        parts = [
            f'{k} {e.point:.3g} +- {e.std:.2g}'
            for k, e in estimates.items()
            if e.std and e.point is not None and abs(e.point) > 2 * e.std
        ]
        where = heard_at(evidence, after, fitted.label)
        # a quarter of a period later, and what shakes it, are of the same axis
        others = dict.fromkeys(c.rstrip(LATER + SHAKEN) for c in fitted.channels(evidence))
        return (
            f'coherent with {", ".join(others)}: '
            f'{", ".join(parts) or "nothing significant"}' + (where and f'; {where}')
        )
    w, f = evidence.whole.bins.count, evidence.whole.bins.f
    label = after.model.labels[-1]
    # where noise does not show, what is gained or lost is the doing of others that were refitted
    own = after.details.each.get(label, after.details.v)
    shows = own > SHOWS * after.details.v

    def minus_log(x):
        return 0.5 * w * (np.log(x.details.v) + evidence.whole.power / x.details.v)

    gain = np.cumsum(np.where(shows, minus_log(before) - minus_log(after), 0.0))
    if gain[-1] <= 0:
        return 'no part of the spectrum asks for it'
    f0 = f[np.searchsorted(np.maximum.accumulate(gain), 0.1 * gain[-1])]
    f1 = f[min(np.searchsorted(np.maximum.accumulate(gain), 0.9 * gain[-1]), len(f) - 1)]
    low, high = f'{f0:.3g}', f'{f1:.3g}'
    return 'the spectrum asks for it ' + (
        f'at {low} Hz' if low == high else f'between {low} and {high} Hz')
