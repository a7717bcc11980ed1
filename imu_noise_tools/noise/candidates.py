# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What could be missing from a model.

Every registered effect is tried, with the log-likelihood it gains.

"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import cast, NamedTuple, TYPE_CHECKING

import numpy as np

from . import in_time, views
from .coupled import heard_at, why_no_coupling
from .evidence import Evidence
from .explained import Bands, Explained, gained, gained_beyond
from .fit import Details, fit as fit_part
from .flexible import asks_nothing
from .kinds import (
    Coupling, is_peak, Line, Mean, MEASURED, model_crowd, Modulation, NoiseEffect, Parameter,
    Response, Spectrum
)
from .likelihood import AT_BOUND, Likelihood, spectrum_without, told_by_gains
from .lines import line_penalty
from .measured import measure, penalty, with_units
from .response import Order
from .rivals import swept
from .rounded import moved_by_rounding
from .shared import LATER, SHAKEN
from ..loop.effect import Effect, Estimate, Finding, Fit, Model, registry, unfitted
from ..loop.findings import price, surplus
from ..loop.verdict import DIRECTED, FLEXIBLE, PRICE

if TYPE_CHECKING:
    from .problem import NoiseProblem

# nats that a half octave may count at most for or against a candidate: what no model explains
# there would decide otherwise
CAP = 50.0
WHOLE = 1e9  # in the place of CAP where every band counts in full
# parameters besides the first that are priced at most where names are compared
MOST_SHAPES = 2
# cosine coefficients from the slowest on: they hold nearly all that an effect on the mean explains
SLOW = 32
# times what the steps of a reading may hide of a mean, rms, that a course of its own is at least
UNREAD = 2.0
# of the power of a bin: the least that is left of it where sources were known exactly (a choice)
LEFT = 0.01
# times the model's power: a peak that has more is not explained, and a filter is fitted beside it
STANDS = 3.0
# widths around its middle that such a peak is left out, a narrow one (whose skirts reach far) and
# one that is seen as broad as it is
FOOT, BROAD = 20.0, 1.5
SEEN = 8.0  # standard errors by which a broad one must stand out for that
# nats of a peak that is there in some form: from there on its other forms and places are tried too
CLEAR = 100.0
CLEAREST = 2    # narrow peaks, the clearest, at each of which a fit is begun for that
# standard deviations of an optional parameter: farther from zero it is used, and priced
OPTIONAL = 3.0
# times what rounding moves a mean by: a mean that changes by no more is rounding's (a choice)
ROUNDED = 2.0
# of all that a mean changes: more at one place is a jump; and of how far levels are apart: a jump
# is theirs if they change by more there (a choice)
JUMPS = 0.5
# times as far as levels are apart: a mean that changes by less is one of their dwells (a choice)
FURTHER = 1.5
# of so many parts of a record: jumps within one are at the same time
JUMP_BLOCKS = 256
# nats: the odds, 100 to 1 (a choice), against a sensor that lacks what every sensor has
ABSENT = float(np.log(100.0))


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
        more = _refitted(problem.evidence, fit, plain)
        problem.tried[key] = Tried(None, _gain(problem.evidence, fit, more, False))
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
            beyond = _gained(problem.evidence, less, fit)
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
    beyond = _gained(problem.evidence, without, fit)
    wanted = price(Finding(effect.name, beyond, effect, penalty=_penalty(effect),
                           shapes=_shapes(effect, estimates) if estimates else 0))
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
    more = _within_bounds(evidence, fit, _refitted(evidence, fit, effect))
    more = _by_its_middle(evidence, fit, more)
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
    whole, partly = (_gain(evidence, fit, more, k) for k in (False, True))
    fast = _within_means(evidence, fit, more) if isinstance(effect, Mean) else 0.0
    bound = at_bound(evidence, added, more.estimates[label])
    bound += f': {manner}' if bound and manner else ''
    finding = Finding(
        effect.name,
        float(partly if peak else whole) + bonus,
        added,
        more.estimates[label],
        price_by_chance(added, evidence) + _unlikely(more),
        _view_of(effect),
        where,
        against=bound or added.part_of(more.model)
        or _of_rounding(evidence, fit.model, added)
        or hidden_by_steps(evidence, fit.model, added) or _of_levels(evidence, fit.model, added)
        or (why_no_coupling(evidence, more, label) if isinstance(effect, Coupling) else '')
        # one peak after the other would follow a line that moves, and all would fall in the end
        or (swept(evidence, added, max(whole, partly)) if peak else ''),
        shapes=_shapes(effect, more.estimates[label]),
        elsewhere=bonus + fast,
        samples=bonus,
        bounded=bool(bound),
    )
    return Tried(finding, whole, partly, peak)


def _of_levels(evidence: Evidence, model: Model, effect: NoiseEffect) -> str:
    """
    Say that a mean jumps as levels do that the path of the record shows, or nothing.

    Or no further than levels do that are in the model and whose path is not seen: of many dwells
    some are long.

    """
    if not isinstance(effect, Mean):
        return ''
    jumps = np.diff(effect.mean(evidence.slow_inputs))
    far = float(np.sum(np.abs(jumps)))
    there = np.flatnonzero(np.abs(jumps) > JUMPS * far)
    if not len(there):
        return ''
    for one in model.of(Spectrum):
        if far < FURTHER * one.jumps and one.path(evidence) is None:
            return f'it is {far / one.jumps:.2g} of the jumps to and fro: {one.title}'
    near = 1 + len(jumps) // JUMP_BLOCKS
    for other in (e() for e in registry('noise').values() if issubclass(e, Spectrum)):
        path = None if other.name in model else other.path(evidence)
        if path is None:
            continue
        before, after = (path[np.clip(there + k, 0, len(jumps))] for k in (-near, near + 1))
        if np.all((after - before) * np.sign(jumps[there]) > JUMPS * np.ptp(path)):
            return f'the mean goes to and fro between two levels, here too: {other.title}'
    return ''


def _of_rounding(evidence: Evidence, model: Model, effect: NoiseEffect) -> str:
    """Say that a mean changes by little more than what rounding moves means by, or nothing."""
    step, bins = evidence.resolution, evidence.whole.bins
    if not isinstance(effect, Mean) or not any(
            e.moves_means for e in model.of(NoiseEffect)) or not step > 0:
        return ''
    fast = bins.f > 0.25 / evidence.dt
    level = np.average(evidence.whole.power[fast], weights=bins.count[fast])
    moved = moved_by_rounding(step, np.sqrt(0.5 * level / evidence.dt), evidence.unrounded)
    size = float(np.ptp(effect.mean(evidence.slow_inputs))) if moved > 0 else np.inf
    return '' if size > ROUNDED * moved else (
        f'it is {size / step:.2g} steps of the output, by which rounding moves a mean by '
        f'{moved / step:.2g}')


def hidden_by_steps(evidence: Evidence, model: Model, effect: Effect) -> str:
    """Say that a course moves a mean no further than steps may hide that another is read in."""
    if not isinstance(effect, Mean) or effect.needs != NoiseEffect.needs:
        return ''
    hides, name = max(((m.unread(evidence), m.name) for m in model.of(Mean)), default=(0.0, ''))
    if not hides:
        return ''
    size = float(np.std(effect.mean(evidence.slow_inputs)))
    return '' if size >= UNREAD * hides else (
        f'it is {size / hides:.2g} of what the steps hide in which that of {name} is read')


def price_by_chance(effect: NoiseEffect, evidence: Evidence) -> float:
    """Return what chance reaches of an effect as it is in the record of an axis, nats."""
    return max(_penalty(effect), effect.by_chance(evidence))


def _penalty(effect: NoiseEffect) -> float:
    """
    Return what chance reaches of an effect, nats, and no less than of those of its spectrum.

    What the spectrum alone says would otherwise name the one whose own chance is less.

    """
    return max(penalty(name) for name in (effect.name, *of_its_kind(effect)))


def of_its_kind(effect: NoiseEffect) -> list[str]:
    """Return the names of all with an effect's spectrum, its own too; none if no other has it."""
    known = cast('dict[str, type[NoiseEffect]]', registry('noise'))
    return [name for name, cls in known.items() if effect.alike and cls.alike == effect.alike]


def _gain(evidence: Evidence, before: Fit, after: Fit, partly: bool) -> float:
    """Return what the last effect of a fit gains over the one before, and by its own doing."""
    label = after.model.labels[-1]
    effect = after.model[label]
    gain = _gained(evidence, before, after, partly)
    if isinstance(effect, (Spectrum, Response)):
        gain = min(gain, _own(evidence, after, label, partly))
    if isinstance(effect, Coupling):
        if before.model.of(Coupling):
            gain = min(gain, gained_beyond(Bands.on(evidence.whole.bins), before.details,
                                           _known(evidence, before), after.details, CAP, partly))
        gain = min(gain, told_by_gains(evidence, after, label)) / model_crowd(before.model)
    return gain


def _within_means(evidence: Evidence, before: Fit, after: Fit) -> float:
    """Return what an edge gains that no view shows: it falls within the means of that of time."""
    resolved = views.TIME_BLOCKS / (2 * evidence.duration)
    bands = Bands.on(evidence.whole.bins)
    return max(gained(bands, before.details, after.details, CAP, above=resolved), 0.0)


def _known(evidence: Evidence, fit: Fit) -> Details:
    """
    Return what a fit would explain if all were known that its couplings miss of their sources.

    What the noise of an accelerometer hides of a motion other axes may hear more clearly; then
    they tell more of it, and of nothing else.

    """
    d = fit.details
    missed = Likelihood(evidence, 'whole', fit.model, fit).channels.missed(fit.model)
    heard = np.maximum(d.v - missed, LEFT * d.v)
    return replace(d, v=heard, power=d.power * heard / d.v)


def _own(evidence: Evidence, fit: Fit, label: str, partly: bool) -> float:
    """
    Return what a fit loses without an effect, nats, where all others keep their values.

    Refitted they lose less, so this is a bound of what the effect gains; a gain beyond it is that
    of a refit that was caught before, and none of the effect's doing. Without a filter few bands
    lose much, where refitted all lose some: of those each counts in full. But what stands out of
    what a filter lets pass is missed by more with it than without.

    """
    v, d = spectrum_without(evidence, fit, label), fit.details
    if v is None:
        return np.inf
    bands = Bands.on(evidence.whole.bins)
    cap = WHOLE if isinstance(fit.model[label], Response) else CAP
    return gained(bands, replace(d, v=v), d, cap, partly, loss=CAP)


def _shapes(effect: NoiseEffect, estimates) -> int:
    """
    Return how many parameters besides one are priced; optional ones where they are clear.

    Of the mean and of a free form all of them, for they bend to anything together.

    """
    clear = sum(abs(estimates[name].point or 0.0) > OPTIONAL * (estimates[name].std or 0.0)
                for name in effect.optional)
    if isinstance(effect, Mean):
        return min(effect.always_fitted - 1, MOST_SHAPES) + clear
    most = effect.always_fitted if effect.free else MOST_SHAPES
    return min(effect.always_fitted - 1 + clear, most)


def at_bound(evidence: Evidence, effect: Effect, estimates: Mapping[str, Estimate]) -> str:
    """
    Say that a shape lies at its bound: that is no estimate, another effect is meant.

    At it, or so near that its estimate does not tell it from there; or beyond: a bound that goes
    with another parameter has moved with that since the fit began. Of a mean, what takes over
    beyond is a rival with odds of its own: it is refused at the bound alone. What arises behind a
    filter is not seen where that lets more pass everywhere.

    """
    if not isinstance(effect, NoiseEffect) or isinstance(effect, MEASURED):
        return ''
    narrower = effect.bounds(evidence)
    for p in effect.parameters:
        if p.amplitude or p.linear or p.discrete or p.name in effect.optional and not p.knee:
            continue
        low, high = narrower.get(p.name, (p.lower, p.upper))
        low, high = max(low, p.lower), min(high, p.upper)
        low, at, high = (p.to_search(value) for value in (low, effect[p.name], high))
        room = high - low
        # what may be nothing is at no bound there
        within = [high - at] if p.knee else [at - low, high - at]
        std = estimates[p.name].std if p.name in estimates else None
        told = np.inf if std is None else 2 * std / p.slope(effect[p.name])
        near = AT_BOUND * room if isinstance(effect, Mean) else max(told, AT_BOUND * room)
        if min(within) < min(0.01 * room, near) and (
                not p.knee or _filled(evidence, effect, p)):
            return f'its {p.name} lies at its bound, {effect[p.name]:.3g} {p.unit}'
    return ''


def _filled(evidence: Evidence, effect: Effect, behind: Parameter) -> bool:
    """Tell whether what arises behind a filter shows: it lets less than that may be pass."""
    alone = cast(Response, effect.with_values(**{behind.name: 0.0}))
    return alone.least(evidence.whole.bins, evidence.dt) < behind.upper


def _gained(evidence: Evidence, before: Fit, after: Fit, partly: bool = False) -> float:
    """
    Return the gain in likelihood, nats, of which no band counts more than CAP.

    What neither model explains has levels of its own: to come somewhat nearer to it is no gain,
    unless what explains a part (``partly``) counts.

    """
    bands = Bands.on(evidence.whole.bins)
    return gained(bands, before.details, after.details, CAP, partly)


def _unlikely(fit: Fit) -> float:
    """
    Return what it costs a fit to leave nothing of what every sensor has, nats.

    White noise behind a low-pass has the spectrum of a Gauss-Markov process without white noise:
    only that there is no such sensor tells them apart.

    """
    share = {k: np.max(s / fit.details.v) for k, s in fit.details.each.items()}
    there = [e.label for e in fit.model.of(Spectrum) if e.never_absent]
    return ABSENT * sum(bool(share.get(label, 1.0) < 0.05) for label in there)


def _refitted(evidence, fit, effect):
    model, hint = Model((*unfitted(fit.model), effect)), fit.details.hint
    slow = evidence.whole.bins.last <= SLOW
    slow[:evidence.thermal('whole')] = True
    if isinstance(effect, Mean):
        known = hint.on(evidence.whole.bins)
        if np.all(known[slow] > 0):
            # it moves nothing but the slow end, which the fit rests on already
            return fit_part(evidence, model, intervals=False, start=fit.model, basis=hint)
        # what was set aside there may be its doing
        hint = replace(hint, f=evidence.whole.bins.f, weight=np.where(slow, 1.0, known))
    # what was left open must not do its work, nor does what it explained say where to look
    left_open = isinstance(effect, Response) and hint.order.terms
    more = fit_part(evidence, model, intervals=False, start=fit.model,
                    hint=None if left_open else hint)
    if isinstance(effect, Response) and not np.all(beside := _beside_peaks(evidence, fit)):
        # a peak without a name takes the filter along that is to be seen around it
        some = Explained(evidence.whole.bins.f, beside)
        other = fit_part(evidence, model, intervals=False, start=fit.model, basis=some)
        more = max(more, other, key=lambda x: _gain(evidence, fit, x, False))
    # nor that of noise beside which it is not needed; what is measured has nothing that is free
    if hint.order.terms and isinstance(effect, Spectrum) and not isinstance(effect, MEASURED):
        bare = replace(hint, order=Order(), values=())
        other = fit_part(evidence, model, intervals=False, start=fit.model, hint=bare)
        peak = is_peak(other.model.of(Spectrum)[-1])    # what is not fitted yet is nowhere
        more = max(more, other, key=lambda x: _gain(evidence, fit, x, peak))
    return more


def _within_bounds(evidence: Evidence, fit: Fit, more: Fit) -> Fit:
    """
    Return a fit with a clear peak more, in another of its forms where it ends at its bound.

    What is missing bends what is around a peak, so that the one form that should be none comes out
    somewhat better than the others.

    """
    peak = more.model.effects[-1]
    if not is_peak(peak) or not at_bound(evidence, peak, more.estimates[peak.label]) \
            or _gain(evidence, fit, more, True) < CLEAR:
        return more
    forms = [p for p in peak.parameters if p.choices]
    others = [_refitted(evidence, fit, type(peak)({p.name: k}))
              for p in forms for k in p.others(peak[p.name])]
    return _best_within(evidence, fit, others, more)


def _by_its_middle(evidence: Evidence, fit: Fit, more: Fit) -> Fit:
    """
    Return a fit with a peak more, by the middle of a narrow one where that explains far more.

    What a fit rests on has the skirts of a peak that stands far out, and not its middle; any
    narrow one explains them. Then it rests on that too, and on no other narrow one.

    """
    peak, humps = more.model.effects[-1], evidence.humps.tolist()
    if not is_peak(peak) or not humps or humps[0][2] < CLEAR:
        return more
    f, others = evidence.whole.bins.f, []
    for middle, width, _ in humps[:CLEAREST]:
        weight = fit.details.hint.on(evidence.whole.bins).astype(float)
        for other, wide, _ in [*humps, (middle, width, 0.0)]:
            weight[np.abs(f - other) < wide] = other == middle
        for start in evidence.starts(type(peak)()):
            if isinstance(start, Spectrum) and start.centre == middle:
                model = Model((*unfitted(fit.model), start))
                others.append(fit_part(evidence, model, start=fit.model,
                                       intervals=False, basis=Explained(f, weight)))
    best, before = _best_within(evidence, fit, others, more), _gain(evidence, fit, more, True)
    if at_bound(evidence, peak, more.estimates[peak.label]):
        return best
    return best if _gain(evidence, fit, best, True) > before + FLEXIBLE else more


def _best_within(evidence: Evidence, fit: Fit, others: list[Fit], more: Fit) -> Fit:
    """Return that of some fits whose last peak gains most within its bounds, if there is one."""
    return max((x for x in others if not at_bound(
        evidence, x.model.effects[-1], x.estimates[x.model.labels[-1]])),
        key=lambda x: _gain(evidence, fit, x, True), default=more)


def _beside_peaks(evidence: Evidence, fit: Fit) -> np.ndarray:
    """
    Return 0 (b,) in the bins of peaks that a fit does not explain, 1 in all others.

    1 in all where peaks are most of the spectrum.

    """
    f, out = evidence.whole.bins.f, np.ones(len(evidence.whole.bins.f))
    peaks = [(middle, FOOT * width) for middle, width, _ in evidence.humps.tolist()]
    peaks += [(middle, BROAD * width) for middle, width, z in evidence.bumps(2) if z > SEEN]
    for middle, reach in peaks:
        at = np.argmin(np.abs(f - middle))
        if fit.details.power[at] > STANDS * fit.details.v[at]:
            out[np.abs(f - middle) < reach] = 0.0
    return out if np.mean(out) > 0.5 else np.ones(len(f))


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
        more = _refitted(evidence, fit, effect)
        gain += float(_gain(evidence, fit, more, False))
    return replace(finding, gain=float(gain), penalty=penalty(effect.name))


def _view_of(effect):
    if isinstance(effect, Mean):
        return 'time'
    return 'coherence' if isinstance(effect, Coupling) else 'frequency'


def _where(evidence, before: Fit, after: Fit, effect) -> str:
    """Say in words where the likelihood is gained."""
    if isinstance(effect, Mean):
        estimates = after.estimates[after.model.labels[-1]]
        parts = [
            f'{k} {e.point:.3g}' + (f' +- {e.std:.2g}' if e.std else '') + f' {e.unit}'
            for k, e in estimates.items()
        ]
        return f'the mean of the record follows it: {", ".join(parts)}'
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

    def minus_log(x):
        return 0.5 * w * (np.log(x.details.v) + evidence.whole.power / x.details.v)

    gain = np.cumsum(minus_log(before) - minus_log(after))
    if gain[-1] <= 0:
        return 'no part of the spectrum asks for it'
    f0 = f[np.searchsorted(np.maximum.accumulate(gain), 0.1 * gain[-1])]
    f1 = f[min(np.searchsorted(np.maximum.accumulate(gain), 0.9 * gain[-1]), len(f) - 1)]
    low, high = f'{f0:.3g}', f'{f1:.3g}'
    return 'the spectrum asks for it ' + (
        f'at {low} Hz' if low == high else f'between {low} and {high} Hz')
