# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Fitting a model to one axis: point values, profile intervals, upper limits.

By maximum likelihood in the cosine domain (:mod:`~imu_noise_tools.noise.likelihood`), from the
most promising of several starts. Where bands of the spectrum disagree with that fit, it is made
again on those that a fit explains (:mod:`~imu_noise_tools.noise.explained`).

"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from .evidence import Evidence
from .explained import (
    Bands, Explained, FAR, judge, Judgement, MANY, NEARLY, set_aside, SetAside,
    supported as supported_by
)
from .kinds import Coupling, Mean, Modulation, Spectrum
from .likelihood import Likelihood, Linear
from .measured import with_measured
from .quiet import quiet_from
from .response import (
    beside_a_band, DEEP, OPEN, OpenResponse, Order, Rational
)
from .starts import begun_anew, most_promising, reddest, Start, starts
from .uncertainty import (
    chosen_estimates, covariance_of, estimates, marginal, plain_estimates, widened, with_linear
)
from ..core.errors import FitError
from ..core.statistics import gamma_pull_exact
from ..loop.effect import Fit, Model
from ..loop.verdict import PRICE

_REDDEST = 1.0  # weight of -ln(slowest amplitude) in the point estimate
_SPANS = (0.45, 0.6, 0.75, 1.0)  # shares of the span of ln f, from the slow end, to start from
_HOLES = ((0.3, 0.6), (0.45, 0.75), (0.6, 0.9), (0.45, 0.9), (0.6, 0.95),
          (0.7, 0.95))  # or all but these
_OUT = 0.3  # of ln power by which a band stands out of those beside it
NAMED = 3  # stretches that are named one by one where the fit leaves out more
_FORMS = 2  # forms of a response that are begun anew beside a narrow peak
_ROUNDS = 12  # of choosing bands and fitting again
# of the response that may be left open
_ORDERS = tuple(Order(*order) for order in (
    (0, 1), (1, 0), (1, 1), (0, 2), (2, 0), (1, 2), (2, 1), (2, 2), (2, 2, True),
    (2, 2, False, np.inf, True), (3, 0), (0, 3), (4, 0), (3, 3), (3, 3, True), (5, 0), (4, 4, 2),
    (4, 4), (4, 4, True)))
_BENT = Order(1, 0)  # of one that is too little to be seen
_TERM = 4.0  # nats that a term of the response must be worth
_NEAR = 12.0  # nats behind the best, to which an order with fewer terms is fitted in full as well
_MORE = 2  # terms more than those that explain every band that are tried as well
_BAND = 12.0  # nats that a band left to levels of its own costs beside such terms
_FLAT, _FLATNESS = 0.02, 0.1  # share of Nyquist up to which ln gain^2 must stay so near to zero
_VAGUE = 2.0  # times the spread of the level beside holes: a response is no better than they are
_DRIFT = 0.1  # share of the power from which drift is told from it
_GAP = 2  # bands from one to the next over which a response reaches
_CREDIBLE = 0.3  # share of the bands that must agree for the others to be called disturbed
_LEAST = 0.05  # share of the power, somewhere, that must be left of what every sensor has


@dataclass(frozen=True)
class Details:
    """
    What a fit rests on, beside its values.

    ``slots`` (p) are (label, parameter) of what was searched for, ``information`` (p, p) their
    Fisher information; ``v`` (b,) the model's power in the bins, ``each`` that of each effect;
    ``power`` (b,) is measured, less what was solved for, ``weight`` (b,) its degrees of freedom;
    ``ml`` is ln L over all bins. ``basis`` is what the fit rests on, None for all of it;
    ``explained`` (b,) bool, ``set_aside`` the stretches that it does not rest on.

    """

    information: np.ndarray
    v: np.ndarray
    each: Mapping[str, np.ndarray]
    power: np.ndarray
    weight: np.ndarray
    ml: float
    slots: tuple[tuple[str, str], ...]
    basis: Explained | None = None
    explained: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))
    set_aside: tuple[SetAside, ...] = ()

    @property
    def hint(self) -> Explained:
        """What a similar model's fit may rest on, to begin with."""
        return self.basis or Explained(np.ones(0), np.ones(len(self.v)))


@dataclass(frozen=True)
class _Search:
    """How the searched parameters are looked for: cautiously or not, from how many starts."""

    cautious: bool
    mean: Fit | None
    enough: float  # nats that end a search; a comparison needs no more than 1e-3

    @property
    def most(self) -> int:
        """Starts that are tried."""
        return 6 if self.cautious else 3

    def from_starts(self, plain: Likelihood, proposed: list[Start],
                    most: int | None = None) -> _Found | None:
        """
        Return the best :class:`_Found` of several starts; None where none is finite.

        A form with more parameters must be that much better.

        """
        return self._best(most_promising(plain, proposed, self.mean, most or self.most), None)

    def with_responses_anew(self, found: _Found) -> _Found:
        """Return the better of a minimum and what a response begun anew there reaches."""
        return self._best(begun_anew(found.likelihood, found.x, _FORMS), found) or found

    def _best(self, begins: Iterable[tuple[Likelihood, np.ndarray]],
              best: _Found | None) -> _Found | None:
        """Return the best of the minima reached from some starts, and of one that is known."""
        least = np.inf if best is None else best.nll + PRICE * len(best.x)
        for likelihood, x0 in begins:
            found = self.from_point(likelihood, x0)
            cost = found.nll + PRICE * len(found.x) + found.likelihood.value(found.x)[1].form
            if np.isfinite(cost) and cost < least - 1e-9:
                best, least = found, cost
        return best

    def from_point(self, likelihood: Likelihood, x0: np.ndarray) -> _Found:
        """Return the minimum reached from one point."""
        slowest = reddest(likelihood, x0) if self.cautious else None
        found = likelihood.minimise(x0, penalty=_REDDEST, reddest=slowest, enough=self.enough)
        found = _revived(likelihood, found, slowest, self.enough)
        x, nll, information = found
        return _Found(likelihood, x, nll, information, slowest)


@dataclass(frozen=True)
class _Found:
    """A minimum: where, how deep, its information, and which amplitude was kept off zero."""

    likelihood: Likelihood
    x: np.ndarray
    nll: float
    information: np.ndarray
    slowest: int | None


def fit(
    evidence: Evidence,
    model: Model,
    part: str = 'whole',
    *,
    mean: Fit | None = None,
    intervals: bool = True,
    cautious: bool | None = None,
    start: Model | None = None,
    basis: Explained | None = None,
    hint: Explained | None = None,
    robust: bool = True,
) -> Fit:
    """
    Fit a model to one part of one axis.

    Parameters
    ----------
    evidence : Evidence
        Of the axis.
    model : Model
        Values it already has are starts, not constraints.
    part : str
        ``whole``, ``first`` or ``second``.
    mean : Fit or None
        For a half: the fit of the same model to the whole, whose basis it inherits.
    intervals : bool
        Whether to compute profile intervals (slow part).
    cautious : bool or None
        Whether to keep the slowest amplitude off zero, as a value with an interval wants it; None:
        where there are intervals. For a prediction the most likely value is better.
    start : Model or None
        A model whose values to start from first (the fit of a smaller model, say).
    basis : Explained or None
        What the fit rests on; None: chosen, or that of ``mean``.
    hint : Explained or None
        What the fit of a similar model rests on: bands are then chosen from there and from the
        plain fit only, which takes a fraction of the time.
    robust : bool
        Whether to choose what the fit rests on; else it rests on every bin.

    Raises
    ------
    FitError
        No finite likelihood from any start.

    """
    model, measured, flags = with_measured(evidence, model)
    if mean is not None:
        for e in model.of(Mean):
            model = model.with_effect(mean.model[e.label])
        basis = basis or mean.details.basis
    plain = Likelihood(evidence, part, model, mean, basis)
    cautious = intervals if cautious is None else cautious
    search = _Search(cautious, mean, 1e-7 if intervals else 1e-5 if cautious else 1e-3)
    # of a half, or on a basis that is known, the start is the end of much the same fit
    known = start is not None and set(model.labels) <= set(start.labels) and (
        mean is not None or basis is not None)
    found = search.from_starts(plain, starts(plain, start), 1 if known else None)
    if found is None:
        raise FitError(
            f'{evidence.axis}: {model} has no finite likelihood',
            'remove an effect, or look at the data',
        )
    if robust and basis is None and mean is None:
        if start is None or not set(model.labels) <= set(start.labels):
            found = search.with_responses_anew(found)
        found = _resting_on_what_it_explains(search, found, hint)
        found = _in_quiet(search, found, hint)
    return _fit_of(found, measured, flags, intervals)


def _fit_of(found: _Found, measured, flags, intervals: bool) -> Fit:
    """Return the fit of a minimum."""
    likelihood, x = found.likelihood, found.x
    nll, linear, _, _ = likelihood.value(x)
    fitted = with_linear(likelihood, likelihood.with_search(x), linear)
    said = dict(measured)
    if intervals:
        more, hit = estimates(likelihood, x, found.information, linear, found.slowest)
        more = widened(likelihood, more, _wider(found))
        flags = [*flags, *hit]
    else:
        more = plain_estimates(likelihood, x, found.information, linear)
    for some in (more, chosen_estimates(likelihood)):
        for label, values in some.items():
            said[label] = {**said.get(label, {}), **values}
    if OPEN in fitted:
        fitted = fitted.minus(OPEN)
    details = _details(found, fitted, linear)
    return Fit(
        fitted,
        {label: said[label] for label in fitted.labels if label in said},
        -nll,
        (*flags, *_in_words(details, likelihood.evidence.loud)),
        details,
        supported_by(Bands.on(likelihood.bins), details.power, details.weight, details.v),
    )


def beside(evidence: Evidence, fit: Fit, model: Model) -> Fit:
    """
    Return a fit with all that is read from the samples as another model has it.

    What is fitted, and the basis of that, must be the same in both models, in the same order; no
    intervals.

    """
    model, said, flags = with_measured(evidence, model)
    same = {e.label: e.values for e in fit.model if e.label in model and e.label not in said}
    return replace(
        fit, model=model.with_values(same),
        estimates={k: said[k] if k in said else fit.estimates[k] for k in model.labels
                   if k in said or k in fit.estimates},
        flags=(*flags, *_in_words(fit.details, evidence.loud)))


def _wider(found: _Found) -> np.ndarray:
    """
    Return by how much intervals (p,) of what is searched are wider behind an open response.

    Its form is believed where another of as many zeros and poles, or one less, does no better. The
    spread about the point is that over all of them, each weighed by its likelihood less what its
    terms cost (Hoeting et al. 1999, Bayesian model averaging, eq. 3).

    """
    likelihood, basis = found.likelihood, found.likelihood.explained
    wide = np.ones(len(found.x))
    if basis is None or not basis.order.rivals:
        return wide
    terms = basis.order.terms
    x, nll, information = likelihood.minimise(found.x)
    keep = range(len(x) - terms)
    own = np.diag(covariance_of(marginal(information, keep)))
    gain2 = likelihood.with_search(x).of(OpenResponse)[0].gain2(likelihood.bins.f, likelihood.dt)
    left = _ratio(replace(found, x=x))[0] * gain2
    chances, spreads = [1.0], [own]
    for order in basis.order.rivals:
        tried = Rational(left, likelihood.weight, likelihood.bins, order).fit(
            [(basis.order, x[-terms:])] if basis.order.within(order) else [])
        if tried is None:
            continue
        values = tried[0]
        other = _with_basis(likelihood, replace(basis, order=order, values=tuple(values)))
        rival = _Found(other, *other.minimise(np.append(x[:-terms], values)), None)
        if not np.isfinite(rival.nll) or not _flat(rival) or _lacks(rival):
            continue
        its = np.diag(covariance_of(marginal(rival.information, keep)))
        apart = (rival.x[:len(keep)] - x[:len(keep)]) ** 2
        gain = nll - rival.nll - _TERM * (order.terms - terms)
        chances.append(np.exp(np.clip(gain, -50, 50)))
        # what one of them does not know at all is not known by a factor
        spreads.append(np.minimum(its + apart, np.maximum(own, 1.0)))
    total = np.average(spreads, axis=0, weights=chances)
    wide[:len(keep)] = np.sqrt(np.maximum(total / np.maximum(own, 1e-300), 1))
    return wide


def _details(found: _Found, fitted: Model, linear: Linear) -> Details:
    """Return what a fit rests on; power and likelihood are those of all bins in any case."""
    likelihood, basis = found.likelihood, found.likelihood.explained
    power, weight, whole = linear.power, linear.weight, likelihood
    aside: tuple[SetAside, ...] = ()
    slots = tuple((s.label, s.parameter.name) for s in likelihood.slots)
    information = found.information
    if basis is not None:
        known = likelihood.mean or Fit(fitted, {}, 0.0)
        whole = Likelihood(likelihood.evidence, likelihood.part_name, fitted, known)
        power = whole.without_couplings(fitted) if whole.couplings else whole.power
        weight = whole.weight
        keep = [j for j, (label, _) in enumerate(slots) if label != OPEN]
        basis = replace(basis, values=tuple(np.delete(found.x, keep)))
        slots, information = tuple(slots[j] for j in keep), marginal(information, keep)
    v, each = whole.spectra(fitted)
    explained = np.ones(len(v), bool)
    if basis is not None:
        bands = Bands.on(whole.bins)
        now = judge(bands, power / v, weight)
        explained = (now.weight > 0) & (basis.on(whole.bins) > 0)
        lines = likelihood.evidence.part(likelihood.part_name).lines
        total = power + (np.sum(lines, axis=0) if len(lines) else 0.0)
        aside = set_aside(bands, explained, power, whole.bins.count, v, total)
    full = whole.weight
    ml = -0.5 * float(np.sum(full * np.log(v) + power * weight / v))
    return Details(information, v, each, power, weight, ml, slots, basis, explained, aside)


def _in_words(details: Details, loud: np.ndarray) -> list[str]:
    """Say what the fit does not rest on."""
    aside = details.set_aside
    if not aside:
        return []
    largest = sorted(sorted(aside, key=lambda s: -s.share)[:NAMED], key=lambda s: s.low)
    others = [s for s in aside if s not in largest]
    said = [
        f'from {s.low:.3g} to {s.high:.3g} Hz ({s.direction} power, {s.ratio:.2g} times the '
        f'model\'s; {100 * s.share:.2g} % of the power)'
        for s in largest
    ]
    if others:
        count = f'{len(others)} narrow stretches' if len(others) > 1 else 'a narrow stretch'
        said.append(
            f'in {count} from {others[0].low:.3g} to {others[-1].high:.3g} Hz '
            f'({100 * sum(s.share for s in others):.2g} % of the power)'
        )
    rest = 'on the rest'
    if np.isfinite(details.hint.quiet):
        times = ', '.join(f'{a:.4g} to {b:.4g} s' for a, b in loud[:NAMED])
        more = f' and {len(loud) - NAMED} stretches more' if len(loud) > NAMED else ''
        rest = f'from {details.hint.quiet:.3g} Hz on the record without {times}{more}, which is ' \
               'louder there, and ' + rest
    if details.hint.order.terms:
        rest += ', and on a response left open there, as of a filter'
    return [f'not explained {", ".join(said)}: the values rest {rest}']


def _resting_on_what_it_explains(search: _Search, plain: _Found, hint: Explained | None) -> _Found:
    """
    Return the fit made again on the bands that a fit explains; the same where none disagrees.

    Bands are chosen and fitted in turn until they stay, beginning with those of the slow end, with
    all, and with all but some in the middle; of where that ends, what explains most bands holds.
    Where that is few of them the model is wrong, not disturbed, and every bin counts.

    """
    thorough, search = search, replace(search, cautious=False, enough=1e-3)
    bands = Bands.on(plain.likelihood.bins)
    now = _judged(bands, plain)
    if np.all(now.weight == 1) and not _lacks(plain):
        return plain
    seen: list[np.ndarray] = []
    begins = _beginnings(plain, now, hint)
    ended = [e for e in (_settled(search, bands, plain, b, seen) for b in begins) if e]
    ended.sort(key=lambda e: -e[1])
    held = [found for found, _ in ended]
    if not held or ended[0][1] < _CREDIBLE * bands.count and not _lacks(plain):
        return plain
    without, best = held[0], _score(bands, held[0])
    for basis, x in _behind_responses(bands, without, hint):
        more = _settled(search, bands, without, basis, [], x)
        if more is None or not (_flat(more[0]) and _joined(bands, more[0])) \
                or _score(bands, more[0]) <= best + 1e-6:
            continue
        # what is added in the middle leaves the level to holes as well: they may tell it better
        vague = _VAGUE if _flat(more[0], strict=True) else 1.0
        if not basis.order.tied or _spread(more[0]) < vague * _spread(
                _on_the_safe_side(thorough, bands, without)):
            held.insert(0, more[0])
            best = _score(bands, more[0])
    first = None
    for found in held:  # a fit that leaves no white noise holds only where every one does
        found = _on_the_safe_side(thorough, bands, found)
        if _flat(found) and not _lacks(found):
            return found
        first = first or found
    assert first is not None
    return first


def _in_quiet(search: _Search, found: _Found, hint: Explained | None) -> _Found:
    """
    Return the fit made again on what is quiet where something is switched on now and then.

    The same where nothing is, or where the model explains what is: its own effects, sources that
    are shared, or a variance that changes, hold it then.

    """
    likelihood = found.likelihood
    part, bands = likelihood.part, Bands.on(likelihood.bins)
    told = quiet_from(likelihood.bins, bands, part.power, part.quiet)
    if told is None or any((likelihood.model.of(Coupling), likelihood.model.of(Modulation))):
        return found
    low, louder = told
    basis = likelihood.explained
    explains = np.all(_judged(bands, found).weight[louder[bands.of]] > 0)
    if explains and (basis is None or not basis.order.terms):
        return found
    every = Explained(likelihood.bins.f, np.ones(len(likelihood.bins.f)), quiet=low)
    calm = _with_basis(likelihood, every)
    again = search.from_starts(calm, starts(calm, None))
    return found if again is None else _resting_on_what_it_explains(search, again, hint)


def _score(bands: Bands, found: _Found) -> float:
    """Return ln L where each band may have a level of its own, less what the response costs."""
    likelihood = found.likelihood
    v, _ = likelihood.spectra(likelihood.with_search(found.x))
    ratio, weight = _ratio(found)
    basis = likelihood.explained
    assert basis is not None
    return supported_by(bands, ratio * v, weight, v, _BAND) - _TERM * basis.order.terms \
        - 4 * _BAND * _lacks(found)


def _spread(found: _Found) -> float:
    """Return the largest standard deviation of ln of what every sensor has."""
    certain = {e.label for e in found.likelihood.model.of(Spectrum) if e.in_every_sensor}
    some = [j for j, s in enumerate(found.likelihood.slots) if s.label in certain]
    std = np.sqrt(np.diag(np.linalg.pinv(marginal(found.information, some))))
    return float(np.max(std, initial=0.0))


def _flat(found: _Found, strict: bool = False) -> bool:
    """Tell whether the response that a fit leaves open, if any, does nothing at the slow end."""
    f, dt = found.likelihood.bins.f, found.likelihood.dt
    return all(
        _still(found, r.order, r.gain2(f, dt), 2 * _FLATNESS, strict)
        for r in found.likelihood.with_search(found.x).of(OpenResponse)
    )


def _joined(bands: Bands, found: _Found) -> bool:
    """
    Tell whether what a fit rests on behind a response is one stretch of the spectrum, or tied.

    Beyond a hole any response brings the level there down to any level at the slow end: what it
    says of that is its form, not the record.

    """
    basis = found.likelihood.explained
    assert basis is not None
    kept = np.flatnonzero(bands.sum(basis.weight) > 0)
    order = basis.order
    return not order.terms or order.tied > 0 or bool(np.max(np.diff(kept)) <= _GAP)


def _still(found: _Found, order: Order, gain2: np.ndarray, by: float, strict: bool) -> bool:
    """
    Tell whether ln gain^2 (b,) stays so near to zero at the slow end.

    That is a share of Nyquist. What is added in the middle, and nowhere takes away, has its level
    from both ends: if not ``strict``, it may reach down to where drift shows.

    """
    likelihood = found.likelihood
    slow = likelihood.bins.f < _FLAT * 0.5 / likelihood.dt
    away = np.log(np.maximum(gain2, 1e-300))
    if order.tied and not strict and np.min(away) > -by:
        model = likelihood.with_search(found.x)
        v, each = likelihood.spectra(model.minus(OPEN) if OPEN in model else model)
        drift = v - sum(each[e.label] for e in model.of(Spectrum) if e.in_every_sensor)
        slow &= np.cumsum((drift > _DRIFT * v)[::-1])[::-1] > 0
    return bool(np.max(np.abs(away[slow]), initial=0.0) <= by)


def _band(bands: Bands, x: np.ndarray, w: np.ndarray, dt: float):
    """Return the (order, values) of the response beside the band that stands out most, if any."""
    mean = bands.sum(w * x) / np.maximum(bands.sum(w), 1e-9)
    mean = np.where(bands.size >= MANY, mean, 0.0)
    top = int(np.argmax(mean))
    if mean[top] <= 1 + NEARLY:
        return []
    below = np.append(True, mean <= 1 + 0.5 * (mean[top] - 1))
    begin = int(np.flatnonzero(below[:top + 1])[-1])
    ends = np.flatnonzero(np.append(below[1:], True)[top:])
    low, high = 2 * dt * bands.low[begin], 2 * dt * bands.high[top + int(ends[0]) - 1]
    return [beside_a_band(float(low), min(float(high), 0.95), float(mean[top] - 1))]


def _behind_responses(bands: Bands, found: _Found, hint: Explained | None):
    """
    Yield (basis, start) with a response left open that does more than the model alone.

    First what does most, then what does nearly as much with fewer terms: they are found beside
    the drift as it was fitted without them, and what that misses by looks like one term more.

    """
    if hint is not None:
        if hint.order.terms:
            yield replace(hint, quiet=_quiet(found)), np.append(found.x, hint.values)
        return
    bins = found.likelihood.bins
    x, w = _ratio(found)
    best = bare = supported_by(bands, x, w, np.ones(len(x)), _BAND)
    chosen: list[tuple[float, Order, np.ndarray, np.ndarray]] = []
    begun = _band(bands, x, w, bins.dt)
    known: dict[Order, np.ndarray] = {}
    enough = np.inf
    for order in (o.about(begun[0][0].middle) if begun else o for o in _ORDERS):
        if order.terms > enough:
            continue
        near = [(o, a) for o, a in known.items() if order.twice and o.within(order)]
        near += [(o, a) for o, a in begun if o[:2] == order[:2]]
        weight = np.ones(len(x))
        for _ in range(3):
            tried = Rational(x, w * weight, bins, order).fit(near)
            if tried is None:
                break
            values, level, v = tried
            if not _still(found, order, v / level, _FLATNESS, False):
                break
            known[order] = values
            score = supported_by(bands, x, w, v, _BAND) - _TERM * order.terms
            if score > bare:
                chosen.append((score, order, weight, values))
            if score > best:
                best = score
                if np.all(judge(bands, x / v, w, 0.0).kept):
                    enough = order.terms + _MORE
            now = judge(bands, x / v, w, 0.0).weight * (v > DEEP * level)
            if np.array_equal(now, weight) or np.sum(now > 0) < 8:
                break
            weight = now
    fewer = np.inf
    for score, order, weight, values in sorted(chosen, key=lambda c: -c[0]):
        if score > best - _NEAR and order.terms < fewer:
            fewer = order.terms
            basis = Explained(bins.f, weight, order, tuple(values), _quiet(found))
            yield basis, np.append(found.x, values)


def _on_the_safe_side(search: _Search, bands: Bands, found: _Found) -> _Found:
    """
    Return the fit made again with a margin for what was too little to be seen.

    What is set aside does not end where a band still agrees: its neighbours are left out too, or,
    where it reaches to the fast end, one term of a response is left open.

    """
    basis = found.likelihood.explained
    assert basis is not None
    if not basis.order.terms and bands.sum(basis.weight)[-1] == 0:
        begun = replace(basis, order=_BENT, values=(0.0,) * _BENT.terms)
        more = search.from_point(
            _with_basis(found.likelihood, begun), np.append(found.x, begun.values))
        if np.isfinite(more.nll) and _flat(more) and not _lacks(more):
            return more
    margin = basis.weight * ~bands.beside(basis.weight)[bands.of]
    likelihood = _with_basis(found.likelihood, replace(basis, weight=margin))
    return _finite(search.from_point(likelihood, found.x), search, found)


def _finite(found: _Found, search: _Search, otherwise: _Found) -> _Found:
    """Return a minimum, or another one where it is none."""
    if np.isfinite(found.nll):
        return found
    return search.from_point(otherwise.likelihood, otherwise.x)


def _with_basis(likelihood: Likelihood, basis: Explained) -> Likelihood:
    """Return the same likelihood on another basis."""
    model = likelihood.model
    return Likelihood(
        likelihood.evidence, likelihood.part_name,
        model.minus(OPEN) if OPEN in model else model, likelihood.mean, basis,
    )


def _beginnings(plain: _Found, now: Judgement, hint: Explained | None):
    """Return what to begin with."""
    f, quiet = plain.likelihood.bins.f, _quiet(plain)
    if hint is not None:
        return [Explained(f, some, quiet=quiet) for some in (now.weight, hint.weight)]
    span = np.log(f / f[0]) / np.log(f[-1] / f[0])
    near = np.abs(gamma_pull_exact(*_ratio(plain))) < FAR
    parts = [span <= share for share in _SPANS[:-1]] + [near]
    parts += [_calm(plain) & (span <= share) for share in _SPANS[-2:]]
    parts += [(span < low) | (span > high) for low, high in _HOLES]
    return [Explained(f, part.astype(float), quiet=quiet) for part in parts]


def _calm(found: _Found) -> np.ndarray:
    """Return which bins (b,) are in bands that do not stand out of the four beside them."""
    bands, (x, w) = Bands.on(found.likelihood.bins), _ratio(found)
    level = np.log(np.maximum(bands.sum(w * x) / np.maximum(bands.sum(w), 1e-9), 1e-300))
    beside = np.lib.stride_tricks.sliding_window_view(np.pad(level, 2, 'edge'), 5)
    return (np.abs(level - np.median(beside, axis=1)) < _OUT)[bands.of]


def _quiet(found: _Found) -> float:
    """Return the Hz from which a fit rests on quiet stretches alone."""
    basis = found.likelihood.explained
    return np.inf if basis is None else basis.quiet


def _ratio(found: _Found) -> tuple[np.ndarray, np.ndarray]:
    """Return (measured over model, degrees of freedom) of all bins, (b,)."""
    likelihood = found.likelihood
    _, linear, v, _ = likelihood.value(found.x)
    power = linear.power if likelihood.linear_slots else likelihood.power
    return power / v, likelihood.full_weight


def _judged(bands: Bands, found: _Found) -> Judgement:
    """Return which bands a fit explains."""
    likelihood = found.likelihood
    basis = likelihood.explained
    if basis is None or not basis.order.terms:
        return judge(bands, *_ratio(found))
    open_one = likelihood.with_search(found.x).of(OpenResponse)[0]
    gain2 = open_one.gain2(likelihood.bins.f, likelihood.dt)
    now = judge(bands, *_ratio(found), 0.0)
    return replace(now, weight=now.weight * (gain2 > DEEP))


def _lacks(found: _Found) -> bool:
    """Tell whether a fit leaves next to nothing of what every sensor has."""
    likelihood = found.likelihood
    model = likelihood.with_search(found.x)
    v, each = likelihood.spectra(model)
    return any(
        e.in_every_sensor and np.max(each[e.label] / v) < _LEAST for e in model.of(Spectrum)
    )


def _settled(search: _Search, bands: Bands, near: _Found, basis: Explained, seen: list, x=None):
    """
    Return (fit, bands that it explains) of choosing bands and fitting in turn.

    Begins with a basis, and at a point where there is one; ends where the choice was ``seen``,
    which it adds to. None where no fit is finite.

    """
    weight, best = basis.weight, None
    found = None
    for _ in range(_ROUNDS):
        if np.sum(weight > 0) < 8 or any(np.array_equal(weight, w) for w in seen):
            break
        seen.append(weight)
        likelihood = _with_basis(near.likelihood, replace(basis, weight=weight))
        if found is None and x is None:
            begin = [*starts(likelihood, near.likelihood.with_search(near.x))]
            found = search.from_starts(likelihood, begin, 2)
        else:
            found = search.from_point(likelihood, x if found is None else found.x)
        if found is None or not np.isfinite(found.nll):
            break
        now = _judged(bands, found)
        used = bands.sum(weight) > 0  # what agrees and was not fitted is not yet explained
        worth = float(now.worth @ used) - 4 * _lacks(found)
        if best is None or worth > best[1]:
            best = found, worth
        weight = now.weight
    return best


def _revived(likelihood, found, reddest, enough):
    """
    Return the better of a minimum and what follows when dead amplitudes are revived.

    These are the amplitudes that died on the way to the minimum.

    """
    x = found[0]
    _, linear, v, each = likelihood.value(x)
    asked_for = linear.weight * (linear.power / v - 1) / v
    again = x.copy()
    for j, slot in enumerate(likelihood.slots):
        share = np.max(each[slot.label] / v) if slot.label in each else 1.0
        # what is dead stays so where a little more of it would be worse
        if slot.parameter.amplitude and slot.parameter.log and share < 1e-3 \
                and asked_for @ each[slot.label] > 0:
            again[j] += 0.5 * np.log(0.3 / max(share, 1e-300))
    if np.array_equal(again, x):
        return found
    other = likelihood.minimise(again, penalty=_REDDEST, reddest=reddest, enough=enough)
    return other if other[1] < found[1] - 1e-6 else found
