# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Views of the coefficients of a part beside a model: their power, and what they share with others.

``frequency`` is the power in the bins, ``coherence`` the correlation with each other axis and
covariate.

"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import cast

import numpy as np

from .evidence import claimed_lines, Evidence
from .kinds import Coupling, heard_by_all, Mean, model_crowd, Modulation, Spectrum
from .likelihood import Likelihood
from .views import nothing, view_of
from ..core.spectrum import Bins
from ..core.statistics import gamma_excess, gamma_pull
from ..loop.effect import Fit, Model, View
from ..loop.verdict import STRIKING

TAKEN = 3.0  # coefficients that a line takes: frequency, amplitude and phase
# what is tried of a peak in one half: times the power that the other half, or the whole, gives it
LOUDER = np.append(0.0, np.geomspace(1e-3, 1e3, 121))
# times the power beside it: of a peak that has less in one half the whole record tells the form
FAINT = 0.1
UNFORESEEN = 10.0  # times what ln L as a parabola makes a draw cost: of usual noise up to 7
LEAKS = 0.01    # share of a bin's power, from which what axes share is what leaks from a band


def frequency(
    evidence: Evidence, part: str, fit: Fit, mean: Fit | None = None, fitted_here: bool = False
) -> View:
    """
    Return the power in the bins of a part beside the model's.

    ``mean`` is the fit of the whole, for a half.

    """
    likelihood = Likelihood(evidence, part, fit.model, mean if mean is not None else fit)
    power, weight = likelihood.power, likelihood.weight
    if likelihood.couplings:
        power = likelihood.without_couplings(fit.model)
    v, each = likelihood.spectra(fit.model)
    asked = 0.0
    if not fitted_here:  # what is flat in the spectrum was as loud as it was in the other half
        v = v + np.min(v) * (_louder_than_in_the_other(evidence, fit.model, part) - 1)
        v, asked = _as_loud_as_here(likelihood, fit.model, mean, power, v, each)
    v = _around_lines(evidence.part(part).lines, power, v, weight)
    lines, own = _unclaimed_lines(evidence, part, fit.model, v)
    lines = lines * likelihood.bins.count / np.maximum(weight, 1)
    x = np.maximum(power + lines, 1e-300) / v
    # a bin whose one coefficient a line took with it says nothing more
    x = np.where((likelihood.weight > 0) | (lines != 0), x, 1.0)
    weight = independent(evidence, fit.model, weight)
    excess, variance = gamma_excess(x, weight)
    extra = 0.0 if fitted_here else parameter_scatter(evidence, part, fit, v, weight)
    taken = np.full(len(own), TAKEN)
    excess = np.append(excess, np.where(own > 1, gamma_excess(own, taken)[0], 0.0))
    excess[0] += asked
    pull = np.append(gamma_pull(x, weight), np.where(own > 1, gamma_pull(own, taken), 0.0))
    f = np.append(likelihood.bins.f, evidence.line_table[:, 0])
    order = np.argsort(f, kind='stable')    # pictures shade what fails side by side
    view = view_of('frequency', f[order], pull[order], excess, variance, 'Hz', extra)
    if not likelihood.couplings:
        return view
    # ln of what is measured is the data's alone, and of one coefficient it has no lower end: what
    # is coupled in moves that of the rest as far as chance brings the rest near zero
    rest = np.maximum(power + lines, 1e-300) / np.maximum(likelihood.power + lines, 1e-300)
    return replace(view, log_score=float(np.sum(excess) + weight @ np.where(
        likelihood.weight > 0, np.log(rest), 0.0)))


def _unclaimed_lines(evidence: Evidence, part: str, model: Model,
                     v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """
    Return the power (b,) of lines that the model does not hold, and of others (l,) their own.

    Over the model's v (b,), in the few coefficients that a line takes: in a bin of thousands it
    would not show. So is what a line adds where it is taken out of a part that it is not in, if
    the model holds it; 1 of the rest.

    """
    here = evidence.part(part)
    rest = np.ones(len(here.lines), bool)
    rest[list(claimed_lines(evidence, model))] = False
    own = np.array([np.sum(x * here.bins.count / v) for x in here.lines]) / TAKEN
    stands = rest & (own > 1)
    in_bins = np.sum(here.lines[rest & ~stands], axis=0)
    return in_bins, np.where(stands, own, np.where(rest, 1.0, np.maximum(-own, 1.0)))


def _as_loud_as_here(likelihood: Likelihood, model: Model, whole: Fit | None, power: np.ndarray,
                     v: np.ndarray, each: Mapping[str, np.ndarray]) -> tuple[np.ndarray, float]:
    """
    Return the model's power (b,) with that of each peak as it is in a part, and what that takes.

    What makes a peak is switched on and off: where it is, and how wide, was told by the other
    half, or by the whole record where it was off in that; how strong, each half tells for itself.
    So it does where a peak is that wanders, if that explains more. A deviance of 1 is what each
    such value takes by chance.

    """
    asked, w = 0.0, likelihood.weight
    for e in (s for s in model.of(Spectrum) if s.uneven):
        own = each[e.label]
        rest = np.maximum(v - own, 1e-9 * v)
        known = whole.model[e.label] if whole is not None and e.label in whole.model else e
        if known is not e and np.max(own / rest) < FAINT:
            own = likelihood.spectrum(model.with_effect(known), e.label)
        tried = [(own, 1.0)]
        for other in cast(Spectrum, known).elsewhere():
            tried.append((likelihood.spectrum(model.with_effect(other), e.label), 3.0))
        best = np.inf
        for here, cost in tried:
            louder = rest + np.multiply.outer(LOUDER, here)
            deviance = np.log(louder) @ w + (1 / louder) @ (w * power) + cost
            k = int(np.argmin(deviance))
            if deviance[k] < best:
                best, v, takes = deviance[k], louder[k], cost
        asked += takes
    return v, asked


def _around_lines(lines, power, v, weight):
    """
    Return the model's power (b,), where lines are no more than what is measured around them.

    What too high a model has beyond that it would take from a line: to hold it would be worse than
    not to.

    """
    held = np.sum(lines, axis=0) > power
    if not np.any(held):
        return v
    window = np.ones(15)
    count = np.convolve(weight, window, 'same')
    near = np.convolve(weight * power / v, window, 'same') / np.maximum(count, 1)
    return np.where(held & (near < 1 - STRIKING * np.sqrt(2 / np.maximum(count, 1))), near * v, v)


def _louder_than_in_the_other(evidence: Evidence, model: Model, half: str) -> float:
    """Return the mean variance in a half over that in the other, by the model's modulation."""
    t = (np.arange(1024) + 0.5) * evidence.duration / 1024
    out = 1.0
    for m in model.of(Modulation):
        first, second = np.mean(m.variance(t).reshape(2, -1), axis=1)
        out *= first / second if half == 'first' else second / first
    return float(out)


def independent(evidence: Evidence, model: Model, weight: np.ndarray) -> np.ndarray:
    """
    Return what bins (b,) of so many coefficients count.

    Coefficients of noise whose variance changes are not independent of their neighbours.

    """
    return np.where(weight > 1, 1 + (weight - 1) / _unevenness(evidence, model), weight)


def _unevenness(evidence: Evidence, model: Model) -> float:
    """Return mean(F^2)/mean(F)^2 of what the model's modulation does to the variance, F >= 0."""
    t = (np.arange(1024) + 0.5) * evidence.duration / 1024
    out = 1.0
    for m in model.of(Modulation):
        f = m.variance(t)
        out *= float(np.mean(f**2) / np.mean(f) ** 2)
    return out


def parameter_scatter(
    evidence: Evidence, part: str, fit: Fit, v: np.ndarray, weight: np.ndarray, draws: int = 32
) -> float:
    """
    Return the mean square of the excess deviance from the uncertainty of fitted parameters.

    Parameters are drawn from the fit's own information (at most a factor e apart on a logarithmic
    scale, where the information says next to nothing); a truth of v' in place of v costs sum w
    (v'/v - ln(v'/v) - 1).

    Where ln L is no parabola, as in a deep stop band, a draw by it may be one that no data allow:
    it is taken back along its ray until it costs what the parabola says, its squared length.

    """
    if not fit.details or not fit.details.slots:
        return 0.0
    slots, information = fit.details.slots, fit.details.information
    likelihood = Likelihood(evidence, part, fit.model, fit)
    spectral = [j for j, (label, _) in enumerate(slots) if not isinstance(fit.model[label], Mean)]
    if not spectral:
        return 0.0
    scale = np.sqrt(np.maximum(np.diag(information), 1e-12))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    root = vectors / np.sqrt(np.maximum(values, 1e-4))
    rng = np.random.default_rng(0)
    x0 = np.array([s.to_search(fit.model[s.label][s.parameter.name]) for s in likelihood.slots])
    lower, upper = np.array([s.bounds for s in likelihood.slots]).T
    lower, upper = np.minimum(lower, x0), np.maximum(upper, x0)
    total = 0.0
    for _ in range(draws):
        z = rng.standard_normal(len(slots))
        drawn = np.clip(x0 + np.clip((root @ z) / scale, -1, 1)[spectral], lower, upper)
        r = likelihood.spectra(likelihood.with_search(drawn))[0] / v
        cost, foreseen = float(np.sum(weight * (r - np.log(r) - 1))), float(z @ z)
        total += (cost if cost <= UNFORESEEN * foreseen else foreseen) ** 2
    return total / draws


def coherence(evidence: Evidence, fit: Fit, part: str = 'whole') -> View:
    """
    Return the coherence with each other axis and covariate.

    In groups of at least eight coefficients.

    """
    x, pulls, excess, spread = [], [], [], []
    crowd = model_crowd(fit.model)
    for channel in evidence.channels:
        f, r, w = cross_correlation(evidence, channel, fit, part)
        # what axes share beyond their spectrum is spread over all coefficients alike, one to all
        alike, pull = np.sqrt((crowd - 1) * w / np.sum(w)), r * np.sqrt(w)
        root = np.sqrt(1 + alike @ alike)   # (1 + a a^T)^(-1/2) = 1 - a a^T/(root (1 + root))
        pull = pull - alike * (alike @ pull) / (root * (1 + root))
        x.append(f)
        pulls.append(pull)
        excess.append(pull**2 - 1)
        spread.append(2 * (w - 1) / (w + 2))
    if not x:
        return nothing('coherence', 'Hz')
    return view_of('coherence', np.concatenate(x), np.concatenate(pulls), np.concatenate(excess),
                   np.concatenate(spread), 'Hz')


def cross_correlation(evidence: Evidence, channel: str, fit: Fit | None,
                      part: str = 'whole') -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """
    Return (f, r, w): correlation of DCT coefficients with another channel.

    In groups of bins, (g,). Less what a channel that is made of the axis itself is of it: the
    square of what leans to one side, or stands on two levels, goes with it at every frequency.

    """
    bins = evidence.part(part).bins
    own = np.maximum(evidence.part(part).power, 1e-300)
    other = np.maximum(evidence.common.pair(channel, channel, part), 1e-300)
    both = evidence.cross(channel, part)
    if fit is not None:
        if fit.model.of(Mean):
            known = Likelihood(evidence, part, fit.model, fit)
            own, both = known.power, known.slow.cross_less_known(channel)
        for e in fit.model.of(Coupling):
            for name, gain in e.gains(evidence):
                both = both - gain * evidence.coupled(name, channel, part)
    # at least eight coefficients to a group: one alone may be next to nothing by chance
    edges = np.unique(8 * np.round(np.geomspace(1, bins.n / 8, 60)))
    group = np.searchsorted(edges, bins.last)
    starts = np.flatnonzero(np.diff(np.concatenate([[-1], group])))
    w = bins.count.astype(float)
    if evidence.holds_itself(channel):
        its = np.sum(w * both / _running(other)) / np.sum(w * own / _running(other))
        other = np.maximum(other - 2 * its * both + its**2 * own, 1e-300)
        both = both - its * own
    level = np.sqrt(_running(own) * _running(other))
    if fit is not None:
        w = np.where(_heard_or_leaked(fit, bins), 0.0, w)

    def total(v):
        v = np.add.reduceat(v, starts)
        return v[asked]

    asked = np.add.reduceat(w, starts) > 0
    r = total(w * both / level) / np.sqrt(
        total(w * own / _running(own)) * total(w * other / _running(other))
    )
    return total(w * bins.f) / total(w), r, total(w)


def _heard_or_leaked(fit: Fit, bins: Bins) -> np.ndarray:
    """Tell in which bins (b,) other axes hear what the model has from outside, or its leakage."""
    out = np.zeros(len(bins.f), bool)
    for e, heard in heard_by_all(fit.model, bins.f):
        if fit.details is not None and len(fit.details.v) == len(bins.f):
            heard = heard | (fit.details.each[e.label] > LEAKS * fit.details.v)
        out |= heard
    return out


def _running(power):
    window = np.ones(15) / 15
    return np.exp(np.convolve(np.pad(np.log(power), 7, mode='edge'), window, mode='valid'))
