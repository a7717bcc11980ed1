# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What speaks against an effect of a model: something else does what it is there for as well.

A smooth form, a knee or a course without a name, a line that sweeps, other peaks with which it
draws one shape, gains that are free; or what it explains is not what the effect says.

"""

from __future__ import annotations

from typing import cast

import numpy as np

from . import in_time
from .coupled import coupled_otherwise, why_no_coupling
from .evidence import Evidence
from .fit import fit as fit_part
from .flexible import mean_gain, smooth_gain, spectrum_left, variance_gain
from .kinds import Coupling, is_peak, Mean, Modulation, NoiseEffect, Response, Spectrum
from .knee import KNOTS
from .likelihood import lost_without
from .nameless import beside_a_knee, course_instead, knee_instead
from .normality import not_normal
from .sweep import on_one_path, SHORTEST_SHARE, Sweep
from .unswept import gained_beside
from ..loop.effect import Fit, Model, unfitted
from ..loop.verdict import DIRECTED, FLEXIBLE, FLEXIBLE_SHARE

# of the lower of two peaks: with less power than that between them they are apart (a choice)
VALLEY = 0.5
# peaks that no valley parts, from which they draw one shape and none of them is named (a choice)
TOGETHER = 3
# widths of a peak: a line that sweeps farther is not a peak that wanders (a choice)
BEYOND = 3.0
# of ln power: an effect is felt in the bins that it changes by more (a choice)
FELT = 0.02


def shape(evidence: Evidence, fit: Fit, without: Fit, label: str, claim: float) -> str:
    """
    Say that a flexible form does better than an effect of a model, empty where it does not.

    ``fit`` and ``without`` are the model with the effect and without it, nor the peaks that draw
    one shape with it; ``claim`` is what the effect gains, nats.

    """
    effect, claimed = cast(NoiseEffect, fit.model[label]), claim
    peak = is_peak(effect)
    if isinstance(effect, Coupling):
        return why_no_coupling(evidence, fit, label) or coupled_otherwise(
            evidence, fit, effect, claim) or swept(evidence, effect, claim)
    against = effect.otherwise(evidence, fit, claim)
    if against:
        return against
    if effect.as_measured:      # it has no form: what it may be instead is where a line passes
        return swept(evidence, effect, claim, fit)
    if peak:
        claim = max(claim, min(fit.details.ml - without.details.ml,
                               lost_without(evidence, fit, label)))
    if peak and isinstance(effect, Spectrum) and effect.sharp:
        # no smooth form has it, whatever is left
        gain, where = 0.0, ''
        loud = _loud_at_times(evidence, fit) * _on_what_wanders(evidence, fit, effect)
        if claim <= FLEXIBLE * loud:
            return f'noise that is loud at times draws as sharp a peak by chance ({loud:.1f}-fold)'
    elif isinstance(effect, (Spectrum, Response)) and not effect.certain:
        gain, claim, where = _smoother(evidence, fit, without, label, claimed, claim)
    elif isinstance(effect, Mean):
        gain = mean_gain(evidence, fit)[0]
        where = 'in time'
    elif isinstance(effect, Modulation):
        gain = variance_gain(evidence, fit)
        where = 'in time'
    else:
        return ''
    if gain > max(FLEXIBLE, FLEXIBLE_SHARE * claim):
        return f'a smooth form without a name fits better by {gain:.0f} nats {where}'
    if isinstance(effect, Mean):
        return course_instead(evidence, fit, effect, claim) \
            or beside_a_knee(evidence, fit, label, claim)
    against = swept(evidence, effect, claim, fit)
    if against:
        return against
    gain = -effect.bonus(evidence, fit)
    if gain > FLEXIBLE:     # of the candidate it was asked where the others were not there
        return f'the samples themselves speak against it by {gain:.0f} nats'
    if peak and _is_hollow(evidence, fit, label):
        return 'where its peak would be the record has less than half of it'
    # in the model a peak may have come to lie on another one, that was found before it or later
    against = effect.part_of(_stronger(evidence, fit, label) if peak else fit.model)
    if against:
        return against
    if len(joined(fit, label, evidence.dt)) >= TOGETHER:
        # two may each be a machine, near as they are; more bend to any hump
        return 'with other peaks it draws one shape: there is no valley between them'
    if effect.broad:
        against = knee_instead(evidence, fit, effect, claimed)
        if against:
            return against
    return not_normal(evidence, fit, effect, claim) if isinstance(effect, Spectrum) else ''


def _smoother(evidence: Evidence, fit: Fit, without: Fit, label: str, claimed: float,
              claim: float) -> tuple[float, float, str]:
    """
    Return what a smooth form gains where an effect bends the spectrum, its claim, and where.

    It ``claimed`` as much as a candidate, and has a ``claim`` to as much in the model, nats.

    """
    effect = cast(Spectrum | Response, fit.model[label])
    peak = is_peak(effect)
    f, x, w = spectrum_left(evidence, fit)
    felt = np.abs(np.log(fit.details.v / without.details.v)) > FELT
    if peak:    # without it others bend elsewhere too, where what is left is theirs
        felt &= fit.details.each[label] > FELT * fit.details.v
    if felt.sum() < 2 * KNOTS:
        felt = np.ones(len(f), bool)
    i, j = np.flatnonzero(felt)[[0, -1]]
    gain = smooth_gain(x[i:j + 1], w[i:j + 1], np.log(f[i:j + 1]))
    if peak and FLEXIBLE < gain <= FLEXIBLE_SHARE * claim:
        claim = max(claimed, min(claim, _explains(evidence, fit, without)))
    if effect.elsewhere():
        gain /= _restless(evidence, f[i], f[j])
    if isinstance(effect, Response):    # of a claim no band counts more than a little
        _, x, _ = spectrum_left(evidence, without)
        claim = max(claim, min(smooth_gain(x[i:j + 1], w[i:j + 1], np.log(f[i:j + 1])),
                               lost_without(evidence, fit, label)))
    return gain, claim, f'between {f[i]:.3g} and {f[j]:.3g} Hz'


def _is_hollow(evidence: Evidence, fit: Fit, label: str) -> bool:
    """
    Tell whether the record surely has less than half of what a peak's own half is in a model.

    What rests on the bins that it explains sets a peak aside that is far too high, and keeps its
    skirts: those of anything.

    """
    _, x, w = spectrum_left(evidence, fit)
    own, power = (evidence.whole.bins.count * v for v in (fit.details.each[label], fit.details.v))
    order = np.argsort(-own)
    half = order[:1 + int(np.searchsorted(np.cumsum(own[order]), 0.5 * np.sum(own)))]
    left = max(float(np.sum((power * x)[half]) / np.sum(power[half])), 1e-300)
    surely = 0.5 * np.sum(w[half]) * (left - 1 - np.log(left))
    return left < 0.5 and surely > DIRECTED


def _stronger(evidence: Evidence, fit: Fit, label: str) -> Model:
    """Return the spectra of a model that have more power than one of them."""
    power = {k: float(np.sum(evidence.whole.bins.count * v)) for k, v in fit.details.each.items()}
    return Model(e for e in fit.model.of(Spectrum) if power[e.label] > power[label])


def _explains(evidence: Evidence, fit: Fit, without: Fit) -> float:
    """
    Return what a fit explains that another one does not where it is fitted to every bin, nats.

    What rests on the bins that it explains sets a peak aside, and misses it by any amount; of that
    a little is no small share of what the peak does.

    """
    every = fit_part(evidence, unfitted(without.model), intervals=False, start=without.model,
                     robust=False)
    return fit.details.ml - every.details.ml


def _loud_at_times(evidence: Evidence, fit: Fit) -> float:
    """
    Return by how much more than that of steady noise the power in a few coefficients varies.

    Noise of variance a(t) has coefficients that go together over as many as the level has, so that
    a sum of them varies by mean(a^2) / mean(a)^2 more; what the model says of a(t) is no excuse.

    """
    _, x, w = in_time.power_in_time(evidence, fit.model)
    level = in_time.pooled(x, w)
    chance = 2 / in_time.degrees_of(w)
    return max(1.0, float(np.mean(level**2) / np.mean(level) ** 2) - chance)


def _on_what_wanders(evidence: Evidence, fit: Fit, effect: Spectrum) -> float:
    """
    Return how restless (:func:`_restless`) a line that wanders is on which a peak lies, or 1.

    That of few stays has its power here and there within its width, and a peak at each.

    """
    assert effect.centre is not None
    out = 1.0
    for other in _stronger(evidence, fit, effect.label).of(Spectrum):
        width = other.values.get('width', 0.0)
        if other.centre is not None and other.elsewhere() \
                and abs(other.centre - effect.centre) < width:
            out = max(out, _restless(evidence, other.centre - width, other.centre + width))
    return out


def _restless(evidence: Evidence, low: float, high: float) -> float:
    """
    Return how much more than noise's the power of a band differs between the halves, 1 at least.

    A line that wanders is now here, now there, and has in a record the form of where it was: of
    few stays that is as far from its mean form as halves are from each other.

    """
    halves = evidence.first, evidence.second
    bins = halves[0].bins
    some = np.flatnonzero((bins.f >= low) & (bins.f <= high))
    if len(some) < KNOTS or len(halves[1].power) != len(bins.f):
        return 1.0
    count = np.array([np.sum(bins.count[i]) for i in np.array_split(some, KNOTS)])
    one, other = (np.array([np.average(part.power[i], weights=bins.count[i])
                            for i in np.array_split(some, KNOTS)]) for part in halves)
    return max(1.0, float(np.mean(count * ((one - other) / (one + other)) ** 2)))


def joined(fit: Fit, label: str, dt: float) -> list[str]:
    """
    Return the labels of what draws one shape with an effect: of peaks that no valley parts.

    Of what is no peak, its own.

    """
    peaks = sorted(((e.centre, e) for e in fit.model.of(Spectrum) if e.centre is not None),
                   key=lambda z: z[0])
    run = [peaks[0][1].label] if peaks else []
    for (low, _), (high, other) in zip(peaks, peaks[1:]):
        f = np.linspace(low, high, 65)
        both = sum((p.psd(f, dt) for _, p in peaks), np.zeros(len(f)))
        if np.min(both) <= VALLEY * min(both[0], both[-1]):
            if label in run:
                break
            run = []
        run.append(other.label)
    return run if label in run else [label]


def swept(evidence: Evidence, effect: NoiseEffect, claim: float, fit: Fit | None = None) -> str:
    """
    Say that a line that sweeps stands out by more than an effect explains of the spectrum.

    What is spread over many frequencies stands out of the spectrum by less than along its path,
    and bends it like a filter or a drift, makes it louder at times, or is what axes share; a peak
    only where it passes all of its band and far beyond, and takes most of the record for it: one
    that wanders is seen on a straight path of little more than its width. Noise that is nothing
    where it passes is not its doing. What axes share in all of the record it may do that is seen
    in a part of it, on a path that is not straight. What follows one path all along is no peak
    that it passes, however wide that is. Of noise that is louder at times counts what is so off
    the path.

    """
    sweep = Sweep(*evidence.sweep.tolist())
    part, sure = 1.0, FLEXIBLE
    low, high = sorted((sweep.first, sweep.last))
    if isinstance(effect, Coupling):
        part, sure = max((sweep.end - sweep.begin) / evidence.duration, SHORTEST_SHARE), DIRECTED
    elif not isinstance(effect, (Spectrum, Response, Modulation)) \
            or effect.certain and not effect.nameless:
        return ''
    elif isinstance(effect, Spectrum) and effect.middle is not None:
        width = effect.values.get('width', 0.0)
        inside = low < effect.middle - width / 2 < effect.middle + width / 2 < high
        far = inside and high - low > BEYOND * width
        if low - width / 2 < effect.middle < high + width / 2 \
                and on_one_path(sweep, evidence.n, evidence.dt):
            claim = 0.0
        elif not far or sweep.end - sweep.begin < 0.5 * evidence.duration:
            return ''
    elif isinstance(effect, Spectrum) and fit is not None and fit.details is not None:
        f = evidence.whole.bins.f
        passed = (f >= low) & (f <= high)
        if not np.any(fit.details.each[effect.label][passed] > FELT * fit.details.v[passed]):
            return ''
    elif isinstance(effect, Modulation) and fit is not None and sweep.sure > sure:
        claim = min(claim, gained_beside(evidence, fit.model.minus(effect.label), effect, sweep))
    if sweep.sure <= sure or sweep.strong <= claim * part:
        return ''
    return f'a line that sweeps, which shows there as well, has {sweep.strong:.0f} nats'
