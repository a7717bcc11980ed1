# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Fitting a model to one axis: point values, profile intervals, upper limits.

By maximum likelihood in the cosine domain (:mod:`~imu_noise_tools.noise.likelihood`), from the
most promising of several starts (:mod:`~imu_noise_tools.noise.search`). Where bands of the
spectrum disagree with that fit, it is made again on those that a fit explains
(:mod:`~imu_noise_tools.noise.robust`).

"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from .descent import minimise
from .evidence import Evidence
from .explained import Bands, Explained, judge, set_aside, SetAside, supported as supported_by
from .kinds import Mean, MEASURED, Modulation
from .likelihood import Likelihood, Linear
from .measured import with_measured
from .response import OPEN, OpenResponse, Rational
from .robust import (
    flat, in_quiet, lacks, more_explained, ratio_of, resting_on_what_it_explains, TERM, with_basis
)
from .search import Found, Search
from .starts import starts
from .uncertainty import (
    chosen_estimates, covariance_of, estimates, marginal, plain_estimates, widened
)
from .ways import over_ways, Way, ways
from ..core.errors import FitError
from ..core.units import in_percent
from ..loop.effect import Fit, Model

NAMED = 3  # stretches that are named one by one where the fit leaves out more


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


def fit(evidence: Evidence, model: Model, part: str = 'whole', *, mean: Fit | None = None,
        intervals: bool = True, cautious: bool | None = None, start: Model | None = None,
        basis: Explained | None = None, hint: Explained | None = None, robust: bool = True,
        smaller: Model | None = None) -> Fit:
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
    smaller : Model or None
        The fit of a model with an effect less, from whose values it starts as well as from what
        the effects propose by themselves.

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
    search = Search(cautious, mean, 1e-7 if intervals else 1e-5 if cautious else 1e-3)
    # of a half, or on a basis that is known, the start is the end of much the same fit
    known = start is not None and set(model.labels) <= set(start.labels) and (
        mean is not None or basis is not None)
    begins = starts(plain, start, not known)
    if smaller is not None:
        begins += starts(plain, smaller, anew=True)
    found = search.from_starts(plain, begins, 1 if known else None)
    if found is None:
        raise FitError(
            f'{evidence.axis}: {model} has no finite likelihood',
            'remove an effect, or look at the data',
        )
    if intervals and mean is None:
        found, _ = ways(found)      # bands that a lag between two explains are not set aside
    if robust and basis is None and mean is None:
        if start is None or not set(model.labels) <= set(start.labels):
            found = search.with_responses_anew(found)
        first = found
        found = resting_on_what_it_explains(search, found, hint, start)
        found = more_explained(found, first)
        found = in_quiet(search, found, hint)
    found, alike = ways(found) if intervals and mean is None else (found, [])
    return _fit_of(found, alike, measured, flags, intervals)


def _fit_of(found: Found, alike: list[Way], measured, flags, intervals: bool) -> Fit:
    """Return the fit of a minimum, which ways to read a mean are as likely as."""
    likelihood, x = found.likelihood, found.x
    nll, linear, _, _ = likelihood.value(x)
    fitted = likelihood.with_linear(likelihood.with_search(x), linear.beta)
    if fitted.of(Modulation):   # beside peaks as they were fitted
        fitted, measured, flags = with_measured(likelihood.evidence, fitted)
    said = dict(measured)
    if intervals:
        more, hit = estimates(likelihood, x, found.information, linear)
        more = widened(likelihood, more, _wider(found))
        flags = [*flags, *hit]
    else:
        more = plain_estimates(likelihood, x, found.information, linear)
    for some in (more, chosen_estimates(likelihood)):
        for label, values in some.items():
            said[label] = {**said.get(label, {}), **values}
    said = over_ways(said, found, alike)
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
    model, said, flags = with_measured(evidence, model.with_values(
        {e.label: e.values for e in fit.model
         if e.label in model and not isinstance(e, MEASURED)}))
    return replace(
        fit, model=model,
        estimates={k: said[k] if k in said else fit.estimates[k] for k in model.labels
                   if k in said or k in fit.estimates},
        flags=(*flags, *_in_words(fit.details, evidence.loud)))


def _wider(found: Found) -> np.ndarray:
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
    x, nll = minimise(likelihood, found.x)
    keep = range(len(x) - terms)
    own = np.diag(covariance_of(marginal(likelihood.information(x), keep)))
    gain2 = likelihood.with_search(x).of(OpenResponse)[0].gain2(likelihood.bins.f, likelihood.dt)
    left = ratio_of(replace(found, x=x))[0] * gain2
    chances, spreads = [1.0], [own]
    for order in basis.order.rivals:
        tried = Rational(left, likelihood.weight, likelihood.bins, order).fit(
            [(basis.order, x[-terms:])] if basis.order.within(order) else [])
        if tried is None:
            continue
        values = tried[0]
        other = with_basis(likelihood, replace(basis, order=order, values=tuple(values)))
        rival = Found(other, *minimise(other, np.append(x[:-terms], values)), None)
        if not np.isfinite(rival.nll) or not flat(rival) or lacks(rival):
            continue
        its = np.diag(covariance_of(marginal(rival.information, keep)))
        apart = (rival.x[:len(keep)] - x[:len(keep)]) ** 2
        gain = nll - rival.nll - TERM * (order.terms - terms)
        chances.append(np.exp(np.clip(gain, -50, 50)))
        # what one of them does not know at all is not known by a factor
        spreads.append(np.minimum(its + apart, np.maximum(own, 1.0)))
    total = np.average(spreads, axis=0, weights=chances)
    wide[:len(keep)] = np.sqrt(np.maximum(total / np.maximum(own, 1e-300), 1))
    return wide


def _details(found: Found, fitted: Model, linear: Linear) -> Details:
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


def _place(low: float, high: float) -> str:
    """Return a stretch of frequencies; one that is narrower than it is told as is one place."""
    ends = f'{low:.3g}', f'{high:.3g}'
    return f'at {ends[0]} Hz' if ends[0] == ends[1] else f'from {ends[0]} to {ends[1]} Hz'


def _in_words(details: Details, loud: np.ndarray) -> list[str]:
    """Say what the fit does not rest on."""
    aside = details.set_aside
    if not aside:
        return []
    largest = sorted(sorted(aside, key=lambda s: -s.share)[:NAMED], key=lambda s: s.low)
    others = [s for s in aside if s not in largest]
    said = [
        f'{_place(s.low, s.high)} ({s.direction} power, {s.ratio:.2g} times the '
        f'model\'s; {in_percent(s.share)} of the power)'
        for s in largest
    ]
    if others:
        count = f'{len(others)} narrow stretches' if len(others) > 1 else 'a narrow stretch'
        said.append(
            f'in {count} from {others[0].low:.3g} to {others[-1].high:.3g} Hz '
            f'({in_percent(sum(s.share for s in others))} of the power)'
        )
    rest = 'on the rest'
    if np.isfinite(details.hint.quiet):
        times = ', '.join(f'{a:.4g} to {b:.4g} s' for a, b in loud[:NAMED])
        more = f' and {len(loud) - NAMED} more' if len(loud) > NAMED else ''
        rest += f', from {details.hint.quiet:.3g} Hz on without {times}{more}, where it is louder'
    if details.hint.order.terms:
        rest += ', and on a response left open there, as of a filter'
    return [f'not explained {", ".join(said)}: the values rest {rest}']
