# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A rival without a name: how much better a free smooth form would do than a model.

In every comparison of named effects one takes part that is no effect: over ln f a broken line of
the level of the spectrum, in time a few slow cosines of the mean or of the variance. Where it
does much better, no name holds: the form is something else.

"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import cast, TypeAlias

import numpy as np
from scipy.special import chdtrc, chdtri

from . import views
from .block_means import block_means, BlockMeans, followed, root_of, slow_rest
from .coupled import why_no_coupling
from .course import left_by_a_course, PARAMETERS, spanned
from .evidence import Evidence
from .explained import Bands, gained
from .fit import fit as fit_part
from .in_frequency import independent
from .kinds import (
    Coupling, Defect, is_peak, Mean, MEASURED, model_crowd, Modulation, NoiseEffect, owners,
    Response, Spectrum
)
from .knee import Knee, KNOTS, slow_cosines, STEEPEST
from .likelihood import explained_by, Likelihood, spectrum_without, told_anew, told_by_gains
from .nonlinear import follows_a_law
from .sweep import on_one_path, SHORTEST_SHARE, Sweep
from .together import unlike_noise
from .unswept import gained_beside
from ..core.linear import inverse, SILENT
from ..core.spectrum import band_of, OCTAVE
from ..core.statistics import gamma_pull, independent_squares, kurtosis_pull, means_of_blocks
from ..loop.effect import Effect, Finding, Fit, Model, unfitted
from ..loop.verdict import DIRECTED, FLEXIBLE, FLEXIBLE_SHARE, HEALED, PRICE

#: of each octave, the narrowest first: differences of block means, how many are independent
Differences: TypeAlias = list[tuple[np.ndarray, float]]

# nats that a smooth form gains, below which no broad effect can pass its penalty: none is tried
QUIET_GAIN = 4.0
# standard deviations of bins side by side, below which no narrow effect can: none is tried
QUIET_PULL = 4.0
# coefficients for each gain, from which a half octave gets gains of its own
ENOUGH = 4.0
# how often gains that are free in every half octave gain so much by chance: what is more refutes
RARE = 1e-3
# of the lower of two peaks: with less power than that between them they are apart (a choice)
VALLEY = 0.5
# peaks that no valley parts, from which they draw one shape and none of them is named (a choice)
TOGETHER = 3
# of the nats that a coupling claims: evidence against normal noise refutes it from there on. Noise
# whose kurtosis is half of what a line's would be has as much
UNLIKE_SHARE = 0.005
COURSE_OF_AXES = 'what it explains is a course that axes have in common, and no noise'
# independent differences of block means: fewer tell no kurtosis; what comes in fewer pieces is a
# course and no noise
FEWEST = 64
# times FEWEST: a record with fewer differences of its shortest blocks cannot count pieces
MANY = 4
# how many cosines of the mean are tried, the slowest first: a few may tell a misfit more surely
FIRST = 2, 4, KNOTS
SLOWLY = 'time', 'the logarithm of time'  # of which cosines of the mean are slow
# widths of a peak: a line that sweeps farther is not a peak that wanders (a choice)
BEYOND = 3.0
# runs of held samples, over which what axes share is averaged before it is asked whether it is
# normal: from one run to the next it comes and goes with the holding
HELD = 8
# of the nats of a coupling: it falls if less is left once the own noise of the channels of another
# one, that hears the same source, is accounted for (a choice)
LEFT_BESIDE = 0.1
# of the nats of a coupling: with less than that above what block means resolve it is told by the
# slow end alone, and may be a course (a choice)
FAST_SHARE = 0.1
# of ln power: an effect is felt in the bins that it changes by more (a choice)
FELT = 0.02


def smooth_gain(x: np.ndarray, w: np.ndarray, u: np.ndarray) -> float:
    """
    Return by how many nats a broken line in u betters x = measured/model power (b,).

    Each x is chi^2_w/w about its level; -ln L = 1/2 sum w (s + x e^-s), s the line's ln level, by
    Fisher scoring with step control.

    """
    if len(x) < 2 * KNOTS or not u[-1] > u[0]:
        return 0.0
    at = np.linspace(u[0], u[-1], KNOTS)
    basis = np.maximum(1 - np.abs(u[:, None] - at) / (at[1] - at[0]), 0)
    w = np.maximum(w, 1e-9)

    def cost(a):
        s = np.clip(basis @ a, -60, 60)
        return 0.5 * float(np.sum(w * (s + x * np.exp(-s))))

    # a start that no single bin far off can spoil
    a = np.zeros(KNOTS)
    for j in range(KNOTS):
        share = w * basis[:, j]
        a[j] = np.log(max(np.sum(share * x) / max(np.sum(share), 1e-300), 1e-12))
    first = cost(np.zeros(KNOTS))
    best = cost(a)
    if best > first:
        a, best = np.zeros(KNOTS), first
    information = 0.5 * (basis * w[:, None]).T @ basis + 1e-6 * np.eye(KNOTS)
    for _ in range(60):
        left = x * np.exp(-np.clip(basis @ a, -60, 60))
        step = np.linalg.solve(information, 0.5 * basis.T @ (w * (left - 1)))
        step = np.clip(step, -2, 2)
        scale = 1.0
        while scale > 1e-4 and cost(a + scale * step) > best:
            scale /= 2
        trial = cost(a + scale * step)
        if trial > best - 1e-4:
            break
        a, best = a + scale * step, trial
    return first - best


def spectrum_left(evidence: Evidence, fit: Fit) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (f, x, w): measured over model power in the bins, and what each counts."""
    view = Likelihood(evidence, 'whole', fit.model, fit)
    power = view.without_couplings(fit.model) if view.couplings else view.power
    v, _ = view.spectra(fit.model)
    return view.bins.f, power / v, independent(evidence, fit.model, view.weight)


def smooth_misfit(evidence: Evidence, fit: Fit) -> Finding:
    """
    Return the directed test of smooth misfit: the gain of the flexible form over the spectrum.

    The total over hundreds of bins is blind to a bend that each of them shows a little.

    """
    f, x, w = spectrum_left(evidence, fit)
    gain = smooth_gain(x, w, np.log(f))
    used = min(len(fit.details.slots) if fit.details else 0, KNOTS // 2)
    narrow = _in_a_band(f, x, w)
    where = f', too much power at {narrow}' if narrow else _where(f, x, w)
    return Finding('shape', gain, view='frequency',
                   p_value=float(chdtrc(KNOTS - used, 2 * max(gain, 0.0))),
                   evidence=f'a smooth form fits the spectrum better by {gain:.1f} nats{where}',
                   where=narrow)


def slow_misfit(evidence: Evidence, fit: Fit) -> Finding:
    """
    Return the directed test of the mean in time: the gain of slow cosines over a model.

    Noise that wanders is no misfit: the means are weighed by the covariance of all that the model
    holds, of a random walk too. Were that known, twice the gain of the first k cosines would be
    chi^2_k; fitted to the same means it explains a part of them, and the gain is less. Of few
    cosines and of more, of time and of its logarithm, that counts which chance reaches least
    often, times how many are asked (Bonferroni).

    """
    gains = _gains_of_cosines(evidence, fit)
    chances = gains.size * chdtrc(np.array(FIRST, float), 2 * np.maximum(gains, 0.0))
    kind, few = np.unravel_index(np.argmin(chances), chances.shape)
    gain = float(gains[kind, few])
    return Finding('course', gain, view='time', p_value=min(float(chances[kind, few]), 1.0),
                   evidence=f'{FIRST[few]} slow cosines of {SLOWLY[kind]} fit the mean better by '
                            f'{gain:.1f} nats')


def asks_nothing(evidence: Evidence, fit: Fit) -> bool:
    """
    Tell whether neither a smooth form nor a few bins of the spectrum ask for more.

    One, two, four ... side by side: a peak that is wider than one stands out of them together.

    """
    f, x, w = spectrum_left(evidence, fit)
    some = w > 0
    x, w, width = x[some], w[some], 1
    if smooth_gain(x, w, np.log(f[some])) >= QUIET_GAIN:
        return False
    power, count = (np.concatenate([[0.0], np.cumsum(z)]) for z in (x * w, w))
    while width <= len(x) // KNOTS:
        total, size = power[width:] - power[:-width], count[width:] - count[:-width]
        if np.max(np.abs(gamma_pull(total / size, size))) >= QUIET_PULL:
            return False
        width *= 2
    return True


def _in_a_band(f: np.ndarray, x: np.ndarray, w: np.ndarray) -> str:
    """
    Return the band in which nearly all power is that is too much, in words; else nothing.

    No wider than an octave. f (b,) in Hz; x (b,) is measured over model power, w what it counts.

    """
    low, high = band_of(w * np.maximum(x - 1, 0), f)
    ends = f'{low:.4g}', f'{high:.4g}'
    return f'{" to ".join(dict.fromkeys(ends))} Hz' if high <= OCTAVE * low else ''


def _where(f, x, w):
    parts = np.array_split(np.arange(len(f)), 12)
    pull = [np.sum(w[i] * (x[i] - 1)) / np.sqrt(2 * max(np.sum(w[i]), 1e-9)) for i in parts]
    k = int(np.argmax(np.abs(pull)))
    side = 'too little' if pull[k] < 0 else 'too much'
    return f', {side} power at {f[parts[k][0]]:.3g} to {f[parts[k][-1]]:.3g} Hz'


def shape(evidence: Evidence, fit: Fit, without: Fit, label: str, claim: float) -> str:
    """
    Say that a flexible form does better than an effect of a model, empty where it does not.

    ``fit`` and ``without`` are the model with the effect and without it, nor the peaks that draw
    one shape with it; ``claim`` is what the effect gains, nats.

    """
    effect, claimed = cast(NoiseEffect, fit.model[label]), claim
    peak = is_peak(effect)
    if isinstance(effect, Coupling):
        return why_no_coupling(evidence, fit, label) or _coupled_otherwise(
            evidence, fit, effect, claim) or swept(evidence, effect, claim)
    against = effect.otherwise(evidence, fit, claim)
    if against:
        return against
    if peak:
        claim = max(claim, min(fit.details.ml - without.details.ml, _own(evidence, fit, label)))
    if isinstance(effect, Spectrum) and effect.sharp:   # no smooth form has it, whatever is left
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
        gain = _variance_gain(evidence, fit)
        where = 'in time'
    else:
        return ''
    if gain > max(FLEXIBLE, FLEXIBLE_SHARE * claim):
        return f'a smooth form without a name fits better by {gain:.0f} nats {where}'
    if isinstance(effect, Mean):
        return _course(evidence, fit, effect, claim) or _beside_a_knee(evidence, fit, label, claim)
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
        against = _knee(evidence, fit, effect, claimed)
        if against:
            return against
    return _not_normal(evidence, fit, effect, claim) if isinstance(effect, Spectrum) else ''


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
                               _own(evidence, fit, label)))
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
    _, x, w = views.power_in_time(evidence, fit.model)
    level = views.pooled(x, w)
    chance = 2 / views.degrees_of(w)
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


def _coupled_otherwise(evidence: Evidence, fit: Fit, effect: Coupling, claim: float) -> str:
    """Say that what a coupling explains is told by other gains, or another one, or is no noise."""
    for other in (e for e in fit.model.of(Coupling) if e.label != effect.label):
        tells, most = (told_by_gains(evidence, fit, e.label) for e in (effect, other))
        if tells < FLEXIBLE_SHARE * most:
            return (f'it tells {tells:.0f} nats, {other.name} {most:.0f}: it is what the '
                    'channels of that do not hear of the same source')
        if tells < most:
            told, own = told_anew(evidence, fit, effect.label, other.label)
            if own < max(DIRECTED, LEFT_BESIDE * told):
                return (f'it tells {told:.0f} nats, all but {own:.0f} of them what {other.name} '
                        'misses of the same source by the own noise of what it hears')
    better = []
    for heard in _ways_to_hear(evidence, fit, effect.label):
        gain, chance = _gains_free(evidence, heard, cast(Coupling, heard.model[effect.label]))
        # where it was found, what hid it from the spectrum may have hidden most of what it tells
        if gain <= max(FLEXIBLE, chance, HEALED * max(
                claim, told_by_gains(evidence, heard, effect.label))):
            break
        better.append(gain)
    else:
        return f'gains that are free in every half octave fit better by {better[0]:.0f} nats'
    if not effect.must_be_normal:
        differences = differences_of(octaves_of(evidence, fit, effect))
        return COURSE_OF_AXES if _happens_once(differences) else ''
    against = _not_normal(evidence, fit, effect, claim)
    if not against and _is_a_course(evidence, fit, effect):
        return COURSE_OF_AXES
    if not against:
        gain = _shared_otherwise(evidence, fit, effect)
        if gain > max(DIRECTED, UNLIKE_SHARE * claim):
            return f'what is shared moves, or comes and goes, as no noise does, by {gain:.0f} nats'
    return against


def _is_a_course(evidence: Evidence, fit: Fit, effect: Coupling) -> bool:
    """
    Tell whether a coupling tells next to nothing beside slow cosines of the mean.

    What all axes do as they warm up, or creep, is one course, and beside a mean that has most of
    it what is left passes for noise that they share.

    """
    means, without = block_means(evidence, fit), fit.model.minus(effect.label)
    count = len(means.y)
    slow = slow_rest(evidence, without) - slow_rest(evidence, fit.model)
    told = means_of_blocks(slow, len(slow) // count)[:count]
    if not np.std(told) > 0:
        return False
    y, mean, free = _beside_cosines(replace(means, y=means.y + told, columns=np.column_stack(
        [means.columns, told / np.std(told)])))
    *mean, its = mean

    def gain(some):
        return _squares_left(y, [*mean, *some]) - _squares_left(y, [*mean, *some, its])

    if gain([]) < FLEXIBLE or min(map(gain, free)) > DIRECTED:
        return False
    bins, weight, power = explained_by(evidence, fit, effect.label)
    fast = bins.f > 0.5 * count / evidence.duration     # than block means resolve
    return bool((weight * power)[fast].sum() < FAST_SHARE * (weight @ power))


def _ways_to_hear(evidence: Evidence, fit: Fit, label: str) -> Iterator[Fit]:
    """
    Yield a fit and what its coupling would be with each other choice, at the same spectrum.

    By faint noise the fit may choose the axes as they were recorded; the gain is then less where
    their own noise is more. That is no other gain, and goes where that noise is known.

    """
    yield fit
    effect = fit.model[label]
    for p in (p for p in effect.parameters if p.name == 'heard'):
        for other in p.others(effect[p.name]):
            model = fit.model.with_values({label: {p.name: other}})
            if cast(Coupling, model[label]).channels(evidence):
                view = Likelihood(evidence, 'whole', model, fit)
                yield replace(fit, model=view.with_solved(model, fit.details.v))


def _not_normal(evidence: Evidence, fit: Fit, effect: Spectrum | Coupling, claim: float) -> str:
    """Say that what an effect explains is no normal noise, where it is to be."""
    if not effect.must_be_normal:
        return ''
    octaves = octaves_of(evidence, fit, effect)
    differences = differences_of(octaves)
    gain = uneven(differences)
    if gain > max(FLEXIBLE, FLEXIBLE_SHARE * claim):
        return f'what it explains is not normal noise, by {gain:.0f} nats'
    # where a path is seen, or noise is louder at times, the model says that it is not normal
    if not fit.model.of(Modulation) and not followed(evidence, fit):
        gain = follows_a_law(octaves)
        if gain > FLEXIBLE:     # however strong: of few values it would be as clear
            return f'what it explains follows a law that is no noise\'s, by {gain:.0f} nats'
    if isinstance(effect, Coupling) and (
            pieces(differences) < FEWEST or _happens_once(differences)):
        return COURSE_OF_AXES
    return ''


def _happens_once(differences: Differences) -> bool:
    """
    Tell whether what differences of block means hold is slow and over within a part of the record.

    All that warms up together does so: nearly all of it is in the slowest octave, and of that most
    in a twentieth of the record.

    """
    energy = [(2.0**k * float(np.sum(d**2)), d) for k, (d, _) in enumerate(differences)]
    if not energy:
        return False
    slowest, d = energy[-1]
    few = max(1, len(d) // 20)
    return slowest > HEALED * sum(x for x, _ in energy) \
        and np.sum(np.sort(d**2)[-few:]) > HEALED * np.sum(d**2)


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
    elif isinstance(effect, Spectrum) and effect.centre is not None:
        width = effect.values.get('width', 0.0)
        inside = low < effect.centre - width / 2 < effect.centre + width / 2 < high
        far = inside and high - low > BEYOND * width
        if low - width / 2 < effect.centre < high + width / 2 \
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


def _own(evidence: Evidence, fit: Fit, label: str) -> float:
    """
    Return what a fit loses without an effect, nats, where all others keep their values.

    What the others do in another place beside it, where a fit without it was caught, is not its.

    """
    v, d = spectrum_without(evidence, fit, label), fit.details
    if v is None:
        return np.inf
    return 0.5 * float(np.sum(d.weight * (np.log(v / d.v) + d.power / v - d.power / d.v)))


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


def _knee(evidence: Evidence, fit: Fit, effect: NoiseEffect, claim: float) -> str:
    """
    Say that a knee of free steepness does better than an effect and all knees of one steepness.

    Of several of these the last is asked, which is there for what the others do not explain. What
    the samples say for one the knee lacks. Bands count a little each, so that one that does
    something else somewhere else may seem as good: it must do most of what the effect does.

    """
    spent = {e.label: e.knees for e in fit.model.of(NoiseEffect) if e.knees}
    said = sum(max(e.bonus(evidence, fit), 0.0) for e in fit.model.of(NoiseEffect) if e.knees)
    if effect.label in [*spent][:-1]:
        return ''
    spent.setdefault(effect.label, effect.always_fitted)
    # as where names are compared: what is optional counts where it is used
    spent = {e.label: spent[e.label] + _used(e)
             for e in fit.model.of(NoiseEffect) if e.label in spent}
    left = [e for e in fit.model if e.label not in spent]
    # drift of other colours may be the knee's, and mostly ends the search before it
    plain = [e for e in left if not isinstance(e, Spectrum) or e.never_absent]
    # and filters may be there for no more than to bend others to its form
    filters = [e for e in plain if isinstance(e, Response) and not isinstance(e, MEASURED)]
    bare = [e for e in plain if e not in filters]
    peak = is_peak(effect)
    bands = Bands.on(evidence.whole.bins)
    for some in {len(x): x for x in (left, plain, bare)}.values():
        rival = _with_a_knee(evidence, fit, some)
        # a part of a peak counts as well
        better = gained(bands, fit.details, rival.details, partly=peak) - said
        gone = [e for e in filters if e not in some]
        more = len(Knee.parameters) - sum(spent.values()) - sum(
            e.always_fitted + _used(e) for e in gone)
        # a filter alone is named where it is as good; several may do a knee's work together
        alone = isinstance(effect, Response) and not gone and len(spent) == 1
        least = DIRECTED if alone else PRICE * more
        if more > 0:    # of a drift that the knee does without it has the parameters as well
            spared = max(0, _levels(fit, some) - _levels(rival, some))
            more = max(0, more - spared)
            least = max(DIRECTED + PRICE * (more - 1), FLEXIBLE_SHARE * claim)
        missed = fit.details.ml - rival.details.ml
        if better > least and missed < max(HEALED * _own(evidence, fit, effect.label), FLEXIBLE):
            steepness = rival.model['knee']['steepness']
            return f'a knee of steepness {steepness:.2g}, {_nameless(better, -more)}'
    return ''


def _nameless(better: float, less: int) -> str:
    """Say how a rival without a name fits: better by some nats, or with parameters less."""
    how = f'better by {better:.0f} nats' if better > 0 else \
        f'as well, with {less} parameter{"s" * (less > 1)} less'
    return f'which has no name, fits {how}'


def _used(effect: NoiseEffect) -> int:
    """Return how many of an effect's optional parameters differ from what does nothing."""
    return sum(effect.values.get(k, 0.0) != effect.neutral.get(k, 0.0) for k in effect.optional)


def _levels(fit: Fit, some: Iterable[Effect]) -> int:
    """Return how many of some effects the spectrum needs: of a power beyond two deviations."""
    labels = {e.label for e in some if isinstance(e, Spectrum)}
    d = fit.details
    each = np.stack([x / d.v for x in d.each.values()])
    spread = np.sqrt(np.maximum(np.diag(inverse(0.5 * (each * d.weight) @ each.T)), 0.0))
    return sum(k in labels and 0 < s < 0.5 for k, s in zip(d.each, spread))


def _with_a_knee(evidence: Evidence, fit: Fit, some: Iterable[Effect]) -> Fit:
    """Return the fit of some effects and a knee of any steepness, begun from a fit."""
    return fit_part(evidence, Model((*unfitted(Model(some)), Knee({}, 'knee'))),
                    intervals=False, start=fit.model, hint=fit.details.hint)


def _course(evidence: Evidence, fit: Fit, effect: Mean, claim: float) -> str:
    """
    Say that one course in time does as well as all effects that move a mean by time alone.

    Of several the last is asked. What follows something recorded stays beside it.

    """
    timed = _timed(fit)
    if [effect.label] != [*timed][-1:]:
        return ''
    spent = _spent(timed.values())
    means = block_means(evidence, fit)
    others = means.columns[:, [k not in timed for k in ('', *owners(fit.model.of(Mean)))]]
    left, words = left_by_a_course(means.t, means.y, others, root_of(means.covariance))
    better = _unexplained(means, means.columns) - left
    more = PARAMETERS - spent
    least = PRICE * more if more < 0 else max(
        DIRECTED + PRICE * (more - 1), FLEXIBLE_SHARE * claim)
    if better <= least:
        return ''
    return f'{words}, {_nameless(better, -more)}'


def _timed(fit: Fit) -> dict[str, Mean]:
    """Return the effects of a model that move a mean by time alone, by label."""
    return {m.label: m for m in fit.model.of(Mean) if m.needs == NoiseEffect.needs}


def _spent(means: Iterable[Mean]) -> int:
    """Return how many parameters of effects on the mean do something."""
    return sum(m.values[p.name] != m.neutral.get(p.name) for m in means for p in m.parameters)


def _beside_a_knee(evidence: Evidence, fit: Fit, label: str, claim: float) -> str:
    """
    Say that noise of another colour does most of what an effect on the mean is there for.

    Asked where the spectrum does not hold with the effect in the model: noise that is redder than
    any of the library wanders in the record as a slow mean does. Where it holds, a few swings may
    hold it: there that noise must do as well as all that moves the mean by time alone. At its
    steepest it is no noise, but the edge of a band that holds all of a swing.

    """
    f, x, w = spectrum_left(evidence, fit)
    if smooth_gain(x, w, np.log(f)) <= FLEXIBLE:
        return _wanders(evidence, fit) if label in _timed(fit) else ''
    labels = [m.label for m in fit.model.of(Mean)]
    steepness, *gains = evidence.remembered(
        ('beside a knee', fit.model), lambda: _gains_beside_a_knee(evidence, fit, labels))
    gain = gains[labels.index(label)]
    if gain > HEALED * claim or steepness > 0.99 * STEEPEST:
        return ''
    return f'beside a knee of steepness {steepness:.2g}, which has no name, ' \
           f'it gains {gain:.0f} nats of {claim:.0f}'


def _wanders(evidence: Evidence, fit: Fit) -> str:
    """Say that noise of another colour explains as well what moves the mean by time alone."""
    means = _timed(fit).values()
    knees = [s for s in fit.model.of(Spectrum) if s.knees]
    more = _spent(means) + sum(s.knees for s in knees) - len(Knee.parameters)
    if more < 1:
        return ''
    missed, steepness = evidence.remembered(
        ('wanders', fit.model), lambda: _with_noise_for(evidence, fit, [*means, *knees]))
    if missed > PRICE * more or steepness > 0.99 * STEEPEST:
        return ''
    return f'noise that falls with f^-{2 * steepness:.2g}, {_nameless(-missed, more)}'


def _with_noise_for(evidence: Evidence, fit: Fit, some: list[NoiseEffect]) -> np.ndarray:
    """Return what a fit misses with a knee for some effects, nats, and how steep that is."""
    rival = _with_a_knee(evidence, fit, [e for e in fit.model if e not in some])
    return np.array([fit.details.ml - rival.details.ml, rival.model['knee']['steepness']])


def _gains_beside_a_knee(evidence: Evidence, fit: Fit, labels: list[str]) -> np.ndarray:
    """Return the steepness of a knee in the place of drift, and what means gain beside it."""
    plain = [e for e in fit.model if not isinstance(e, Spectrum) or e.never_absent]
    rival = _with_a_knee(evidence, fit, plain)
    # effects that stand for a knee hold it where it leaves them what they explain
    alone = _with_a_knee(evidence, fit, [e for e in plain if not isinstance(e, Mean)])
    begun = Model((*alone.model, *fit.model.of(Mean)))
    rival = max(rival, fit_part(evidence, unfitted(rival.model), intervals=False, start=begun,
                                basis=rival.details.hint), key=lambda f: f.log_likelihood)
    means = block_means(evidence, rival)
    whose = np.append('', owners(rival.model.of(Mean)))
    left = _unexplained(means, means.columns)
    # it may do it all: where next to nothing is left to all of them, neither is it to one
    together = gained(Bands.on(evidence.whole.bins), alone.details, rival.details)
    most = max(together, 0.0) if together <= FLEXIBLE else np.inf
    return np.array([rival.model['knee']['steepness'], *(
        min(_unexplained(means, means.columns[:, whose != label]) - left, most)
        for label in labels)])


def mean_gain(evidence: Evidence, fit: Fit) -> tuple[float, bool]:
    """
    Return what slow cosines of the mean gain over a model, nats, given its red noise.

    Of time, or (True) of its logarithm from the record's begin on, whichever gain more: what sets
    in with the record, a creep, say, is steep there and flat later.

    """
    gains = _gains_of_cosines(evidence, fit)[:, -1]
    return float(np.max(gains)), bool(gains[1] > gains[0])


def _gains_of_cosines(evidence: Evidence, fit: Fit) -> np.ndarray:
    """Return what cosines of each kind of SLOWLY gain, so many as FIRST says, (2, 3), nats."""
    y, mean, free = _beside_cosines(block_means(evidence, fit))
    before = _squares_left(y, mean)
    return before - np.array([
        [_squares_left(y, [*mean, *some[:k]]) for k in FIRST] for some in free])


def _beside_cosines(means: BlockMeans) -> tuple[
        np.ndarray, list[np.ndarray], list[list[np.ndarray]]]:
    """Return means (k,), their columns, and slow cosines of each kind of SLOWLY, whitened."""
    count, own = len(means.y), means.columns.shape[1]
    u = (np.arange(count) + 0.5) / count
    slow = [slow_cosines(u, count, bool(kind)) for kind in range(len(SLOWLY))]
    y, *columns = np.linalg.solve(root_of(means.covariance), np.column_stack(
        [means.y, means.columns, *slow])).T
    return y, columns[:own], [columns[k:k + KNOTS] for k in range(own, len(columns), KNOTS)]


def _unexplained(means: BlockMeans, columns: np.ndarray) -> float:
    """Return half the squares that columns (k, p) leave of block means, by their covariance."""
    y, *columns = np.linalg.solve(root_of(means.covariance),
                                  np.column_stack([means.y, columns])).T
    return _squares_left(y, columns)


def _squares_left(y: np.ndarray, columns: Sequence[np.ndarray]) -> float:
    """Return half the squares that columns (k,) leave of y (k,)."""
    u = spanned(np.column_stack(columns))
    return 0.5 * float(np.sum((y - u @ (u.T @ y)) ** 2))


def _variance_gain(evidence: Evidence, fit: Fit) -> float:
    """Return what a smooth level in time gains over a model's modulation, nats."""
    t, x, w = views.power_in_time(evidence, fit.model)
    x = x / views.modulated(fit.model, t, x, w)
    w = views.rough_degrees(x, w)
    return smooth_gain(views.pooled(x, w), np.full(len(t), views.degrees_of(w)), t)


def _gains_free(evidence: Evidence, fit: Fit, effect: Coupling) -> tuple[float, float]:
    """
    Return what gains of a coupling's own in each half octave gain beyond chance's mean, nats.

    And what as many of them reach by chance once in a thousand, as eight levels reach FLEXIBLE.

    """
    view = Likelihood(evidence, 'whole', fit.model)
    v, w = fit.details.v, view.weight
    cross, own = view.channels.left_to(fit.model, v, effect.channels(evidence))
    bands, gain, free = Bands.on(view.bins), 0.0, 0
    for k in range(bands.count):
        some = bands.of == k
        gram, c = own[:, :, some] @ (w / v)[some], cross[:, some] @ (w / v)[some]
        there = np.diag(gram) > SILENT
        if np.sum(w[some]) > ENOUGH * np.sum(there):
            gain += 0.5 * float(c @ inverse(gram) @ c - np.sum(there))
            free += int(np.sum(there))
    return gain, 0.5 * float(chdtri(free, RARE) - free) if free else 0.0


def _shared_otherwise(evidence: Evidence, fit: Fit, effect: Coupling) -> float:
    """
    Return what speaks against normal noise in what an axis shares with others, nats.

    Nothing where the model says that some of it is none. Of axes whose samples are held together
    what they share comes and goes with that, from one sample to the next: there means over several
    are asked.

    """
    e, model = evidence, fit.model
    if any((model.of(Mean), [d for d in model.of(Defect) if d.screens()])):
        return 0.0
    without = slow_rest(e, model.minus(effect.label))
    loud = np.sqrt(np.prod([np.ones(len(without)), *(
        m.variance(e.slow_t) for m in model.of(Modulation))], axis=0))
    # of a mean, divided by what steps, a step is left
    crowd = model_crowd(model)
    some = int(np.ceil(HELD * crowd / e.common.slow_length)) if crowd > 1 else 1
    if len(without) < 2 * some:
        return 0.0
    return unlike_noise(*(means_of_blocks((x - np.mean(x)) / loud, some) for x in (
        without, without - slow_rest(e, model))))


def uneven(differences: Differences) -> float:
    """
    Return what speaks against normal noise on some time scale that an effect makes, nats.

    Sums of many small things are normal on every scale, a path between wells or levels is not: its
    differences of block means (Haar's wavelets) have heavy tails in the octaves in which it moves.
    Of those in which the effect has most of the power, the kurtosis, beyond chance.

    """
    return sum(0.5 * kurtosis_pull(difference, several) ** 2 - 0.5
               for difference, several in differences if several >= FEWEST)


def pieces(differences: Differences) -> float:
    """
    Return in how many independent pieces the energy of what an effect makes comes.

    Of a random walk they are some hundreds, the most that the widest differences of block means
    can be; of a course a dozen. Infinite where the record has too few differences to tell.

    """
    told = [(2.0**k * float(np.sum(difference**2)), several, len(difference))
            for k, (difference, several) in enumerate(differences)]
    energy, several, count = np.array(told).reshape(-1, 3).T
    if not len(told) or count[0] < MANY * FEWEST or not np.sum(energy) > 0:
        return np.inf
    return float(np.sum(energy) ** 2 / np.sum(energy**2 / several))


def differences_of(octaves: Iterable[np.ndarray]) -> Differences:
    """Return (differences, how many independent ones) of the block means of octaves."""
    some = (y[0::2] - y[1::2] for y in octaves)
    return [(difference, independent_squares(difference)) for difference in some]


def octaves_of(evidence: Evidence, fit: Fit, effect: Spectrum | Coupling) -> list[np.ndarray]:
    """Return block means of what an effect makes, in octaves in which it has most of the power."""
    e, model = evidence, fit.model
    # what those touch is in the block means, and what one axis has, a mean, levels, samples that
    # are held, others may have of their own
    own = any(d.screens() for d in model.of(Defect))
    if isinstance(effect, Coupling):
        own = own or bool(model.of(Mean)) or bool(model.of(Defect)) \
            or any(s.jumps and s.bonus(e, fit) > 0 for s in model.of(Spectrum))
    if own:
        return []
    rest, out = slow_rest(e, model), []
    y = slow_rest(e, model.minus(effect.label)) - rest if isinstance(effect, Coupling) \
        else rest - views.slow_mean(e, model)
    f = 1 / (2 * np.diff(e.slow_t[:2])[0])
    while len(y) >= 2 * FEWEST:
        y, f = y[:len(y) // 2 * 2], 0.5 * f
        mine = 1.0
        if isinstance(effect, Spectrum):
            mine = np.interp(f, e.whole.bins.f, fit.details.each[effect.label] / fit.details.v)
        if mine > 0.5:
            out.append(y)
        y = y.reshape(-1, 2).mean(axis=1)
    return out
