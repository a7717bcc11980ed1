# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What is no coupling of a sensor, though axes are coherent.

A machine that all of them hear is none, nor is what other gains tell as well, what is no noise, or
a course that axes have in common.

"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import cast

import numpy as np
from scipy.special import chdtri

from .block_means import block_means, slow_rest
from .evidence import Evidence
from .explained import Bands
from .flexible import beside_cosines, squares_left
from .kinds import Coupling, Defect, heard_by_all, Mean, model_crowd, Modulation
from .likelihood import explained_by, Likelihood, told_anew, told_by_gains
from .normality import COURSE_OF_AXES, differences_of, happens_once, not_normal, octaves_of
from .together import unlike_noise
from ..core.linear import inverse, SILENT
from ..core.spectrum import band_of, Bins, OCTAVE
from ..core.statistics import means_of_blocks
from ..loop.effect import Fit
from ..loop.verdict import DIRECTED, FLEXIBLE, FLEXIBLE_SHARE, HEALED

ACCEL = ('accel_x', 'accel_y', 'accel_z')
MOST = 0.9      # of what a coupling explains (a choice): no coupling if it lies within ...
SHARP = 30.0    # ... a width of f over this: a driven resonance with Q = 190
# of the largest share that a turn would move gravity by: shares that are off by less are those
# of a turn (a choice)
LIKE = 0.25
# coefficients for each gain, from which a half octave gets gains of its own
ENOUGH = 4.0
# how often gains that are free in every half octave gain so much by chance: what is more refutes
RARE = 1e-3
# of the nats that a coupling claims: evidence against normal noise refutes it from there on. Noise
# whose kurtosis is half of what a line's would be has as much
UNLIKE_SHARE = 0.005
# runs of held samples, over which what axes share is averaged before it is asked whether it is
# normal: from one run to the next it comes and goes with the holding
HELD = 8
# of the nats of a coupling: it falls if less is left once the own noise of the channels of another
# one, that hears the same source, is accounted for (a choice)
LEFT_BESIDE = 0.1
# of the nats of a coupling: with less than that above what block means resolve it is told by the
# slow end alone, and may be a course (a choice)
FAST_SHARE = 0.1


def why_no_coupling(evidence: Evidence, fit: Fit, label: str) -> str:
    """Say why what a coupling of a model explains is no coupling of the sensor, or nothing."""
    effect = cast(Coupling, fit.model[label])
    return at_one_frequency(evidence, fit, label) or effect.motion(evidence, fit)


def at_one_frequency(evidence: Evidence, fit: Fit, label: str) -> str:
    """
    Say that what a coupling of a model explains lies at one frequency, or nothing.

    A coupling is told by gains that are the same at all frequencies. At one any signal is a share
    of any two others that have different phases, and a machine that shakes the mount is heard by
    all axes: the peak is there in any case, the coupling is not shown.

    """
    bins, nats = _heard(evidence, fit, label)
    if not nats.sum() > 0:
        return ''
    for e, heard in heard_by_all(fit.model, bins.f):
        if nats[heard].sum() > MOST * nats.sum():
            return f'what it explains is {e.label}, which all axes hear'
    wide = bins.count / (2 * evidence.duration)
    order = np.argsort(-nats / wide)
    some = order[:1 + np.searchsorted(np.cumsum(nats[order]), MOST * nats.sum())]
    width, f = float(wide[some].sum()), float(np.average(bins.f[some], weights=nats[some]))
    if width > f / SHARP:
        return ''
    return (f'{100 * MOST:.0f} % of what it explains lies within {width:.2g} Hz at {f:.4g} Hz: '
            'at one frequency a coupling cannot be told from a machine that all axes hear')


def _heard(evidence: Evidence, fit: Fit, label: str) -> tuple[Bins, np.ndarray]:
    """Return the bins, and the nats (b,) that a coupling of a model explains in each."""
    bins, weight, power = explained_by(evidence, fit, label)
    return bins, np.maximum(weight * power, 0.0)


def heard_at(evidence: Evidence, fit: Fit, label: str) -> str:
    """
    Say at which frequencies a coupling of a model explains something, empty where nowhere.

    What is heard in a narrow band comes from a machine or from a resonance of the mount.

    """
    bins, nats = _heard(evidence, fit, label)
    if not nats.sum() > 0:
        return ''
    low, high = band_of(nats, bins.f)
    if high > OCTAVE * low:
        return f'most of it between {low:.3g} and {high:.3g} Hz'
    middle = bins.f[np.searchsorted(np.cumsum(nats), 0.5 * nats.sum())]
    return (f'around {middle:.4g} Hz, most of it between {low:.4g} and {high:.4g} Hz: as a '
            'machine or a resonance of the mount is heard')


def by_gravity(evidence: Evidence, fit: Fit, label: str, shares: np.ndarray) -> str:
    """
    Say that shares of the accelerometer are those by which a turn moves gravity, or nothing.

    While the mount turns by omega the specific force f moves by -omega x f, so that across f
    omega = f' x f/|f|^2 (Titterton and Weston, Strapdown Inertial Navigation Technology, section
    3.6): the gyroscope tells a rotation that is there. At a frequency f' is 2 pi times that, a
    quarter of a period earlier.

    ``shares`` (2, 3) are those of the accelerometer axes, at once and a quarter of a period later.

    """
    force = np.array([np.mean(evidence.slow_others[a]) for a in ACCEL])
    if not np.any(force):
        return ''
    view = Likelihood(evidence, 'whole', fit.model, fit)
    heard = cast(Coupling, fit.model[label]).channels(evidence)[:3]
    # a share that is fitted is the mean over what is heard
    power = np.array([evidence.common.pair(a, a, 'whole') for a in heard])
    power = power * view.weight / fit.details.v
    f = power @ view.bins.f / np.maximum(power.sum(axis=1), np.finfo(float).tiny)
    turned = np.cross(force, np.eye(3))[:, 'xyz'.index(evidence.axis[-1])]    # force x e_j
    wanted = np.array([np.zeros(3), 2 * np.pi * f * turned / (force @ force)])
    if np.abs(shares - wanted).max() > LIKE * np.abs(wanted).max():
        return ''
    at = f[np.argmax(np.abs(turned))]
    return (f'these are the shares by which turning moves gravity at {at:.2g} Hz: the mount '
            'turns, and the gyroscope tells it')


def coupled_otherwise(evidence: Evidence, fit: Fit, effect: Coupling, claim: float) -> str:
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
        return COURSE_OF_AXES if happens_once(differences) else ''
    against = not_normal(evidence, fit, effect, claim)
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
    y, mean, free = beside_cosines(replace(means, y=means.y + told, columns=np.column_stack(
        [means.columns, told / np.std(told)])))
    *mean, its = mean

    def gain(some):
        return squares_left(y, [*mean, *some]) - squares_left(y, [*mean, *some, its])

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
