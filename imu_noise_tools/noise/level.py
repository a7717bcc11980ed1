# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What the level of white noise is that of, where it is not plainly what the curve shows at 1 s.

N is read by others as the Allan deviation at 1 s. It is another where something that the model
does not explain holds the curve there, or where the level changes in time.

"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from . import in_time, views
from .curve import model_curve
from .evidence import Evidence
from .kinds import Modulation, Response, Spectrum
from ..core import units
from ..core.clipped import ends_in_words, narrowed
from ..core.statistics import TWO_SIDED
from ..loop.effect import Estimate, Fit, Model

CLIPPED = 1e-3  # share of the samples at an end of the range; less takes no thousandth from N
HALF = 0.5  # steps of noise on a coarse grid, at most
NOTHING = 0.01  # degrees of freedom that tell nothing of it
APART = 1.25  # ratio of curve and model at 1 s from which it is said
TIMES = 4096  # moments of a record at which its level is asked for
SHARE = 0.5  # of a band's power, that white noise has where the band tells of it
SURE = 4.0  # standard deviations by which a band follows a change by less than half
FAR_BELOW = 0.1  # of a level's power: where the record has less it is said
ENDS = 0.3  # of the sample rate, to which it is so
NEAR = 1.2  # s: an averaging time within this factor of 1 s stands for it


def at_one_second(evidence: Evidence, model: Model) -> tuple[int, float]:
    """Return where a curve comes nearest to 1 s, and the deviation of a fitted model there."""
    c = evidence.curve
    i = int(np.argmin(np.abs(np.log(c.tau))))
    return i, float(np.sqrt(model_curve(evidence, model, c.m[i:i + 1])[0]))


def _notes(evidence: Evidence, fit: Fit, changes: bool,
           band: tuple[float, float] | None) -> list[str]:
    """
    Return what there is to say of the level of a fit to a whole record: mostly nothing.

    Whether it ``changes`` in time, and the :func:`steady_band` of what does.

    """
    out = []
    if said := clipped(evidence):
        out.append(f'{said}: mean and level are wrong')
    if moving := in_motion(evidence):
        noise, most = _before_rounding(evidence)    # half a step: nothing tells how loud it was
        told = f' ({noise:.2g} of one)' if most < HALF else ''
        there = units.shown(moving, '{rate}/sqrt(Hz)', evidence.sensor)
        out.append(f'rounded to steps that are coarser than the noise{told}: the level is that of '
                   f'the output with the mean where it is, and up to {there} while the sensor '
                   'moves')
    if band:
        out.append(f'what changes the level in time is not heard from {band[0]:.3g} to '
                   f'{band[1]:.3g} Hz: it is no change of this')
    elif changes:
        out.append('the mean over the whole record (rms), whose level changes in time')
    elif np.isfinite(fit.details.hint.quiet):
        out.append(f'the level from {fit.details.hint.quiet:.3g} Hz on is that of the quiet part '
                   'of the record')
    elif len(evidence.loud):
        out.append('the mean over the whole record, parts of which are louder')
    out += _far_below(evidence, fit)
    c = evidence.curve
    at, model = at_one_second(evidence, fit.model)
    if c.deviation in ('oadev', 'adev') and 1 / NEAR < c.tau[at] < NEAR:
        ratio = c.dev[at] / model
        if ratio > APART and c.lo[at] > model:
            out.append(f'the curve at 1 s is {ratio:.2g} times the model: the level is that '
                       'beneath what is not explained')
        elif ratio < 1 / APART and c.hi[at] < model:
            out.append(f'the model at 1 s is {1 / ratio:.2g} times the curve: what is not '
                       'explained bends it')
    return out


def _far_below(evidence: Evidence, fit: Fit) -> list[str]:
    """Say where the record is so far below a level that no white noise has it, unless filtered."""
    f, power = evidence.whole.bins.f, fit.details.power
    for s in fit.details.set_aside if not fit.model.of(Response) else ():
        there = power[(f >= s.low) & (f < s.high)]
        if s.ratio < FAR_BELOW and s.high > ENDS / evidence.dt and len(there):
            level = units.shown(float(np.sqrt(np.median(there) / 2)), '{rate}/sqrt(Hz)',
                                evidence.sensor)
            return [f'from {s.low:.3g} Hz on the record has {1 / s.ratio:.2g} times less power '
                    f'(its level there is {level}): below that something moves, or a filter '
                    'begins there']
    return []


def clipped(evidence: Evidence) -> str:
    """Return how many of the samples stand at an end of the range, and where; '' for too few."""
    if np.sum(evidence.clipped[:, 1]) < CLIPPED:
        return ''
    ends = ends_in_words(evidence.axis, evidence.clipped.tolist())
    return f'samples stand at the end of the range ({ends})'


def in_motion(evidence: Evidence) -> float:
    """
    Return the density of noise on a coarse grid while the mean moves over it, 0 on no such.

    At rest that goes with where between two levels the mean stands: in the middle of a step little
    of the noise comes through. Over all places the error of a sample is the noise before the
    rounding, of which this takes the upper end of the interval, and that of the rounding.

    """
    if not evidence.before.size:
        return 0.0
    _, most = _before_rounding(evidence)
    return float(evidence.resolution * np.sqrt((most**2 + 1 / 12) * evidence.dt))


def _before_rounding(evidence: Evidence) -> tuple[float, float]:
    """Return the noise before a coarse grid, in steps, and the upper end of its interval."""
    noise, freedom = evidence.before.tolist()
    # of more than half a step the output would not be coarse
    return noise, min(noise * np.exp(TWO_SIDED / np.sqrt(2 * max(freedom, NOTHING))), HALF)


def narrowed_by_clipping(evidence: Evidence, fit: Fit) -> tuple[str, ...]:
    """
    Return which levels would leave their interval if no sample was clipped.

    As normal noise would that is clipped so; of a coarse output that is more than there is.

    """
    left = narrowed(evidence.clipped[:, 1].tolist())
    out = []
    for e in fit.model.of(Spectrum) if clipped(evidence) else ():
        for name, found in fit.estimates.get(e.label, {}).items():
            if e.never_absent and _is_flat(e, evidence.dt) and found.point and not (
                    found.ci95 and found.point / max(left, 1e-3) <= found.ci95[1]):
                out.append(f'{e.label}.{name}')
    return tuple(out)


def extremes(evidence: Evidence, model: Model) -> tuple[float, float]:
    """
    Return the least and the largest level of noise within a record, of its rms over the record.

    A fit to the whole record is one to the mean of a variance that its model lets change in time.

    """
    t = np.linspace(0.0, evidence.duration, TIMES)
    variance = np.ones(TIMES)
    for e in model.of(Modulation):
        variance = variance * e.variance(t)
    level = np.sqrt(variance / np.mean(variance))
    return float(np.min(level)), float(np.max(level))


def steady_band(evidence: Evidence, fit: Fit) -> tuple[float, float] | None:
    """
    Return the ends, Hz, of a band of white noise that a change of the level leaves as it is.

    A rumble that comes and goes makes the record louder, and not its white noise: where that has
    most of the power the blocks follow the change by surely less than half. None where none does.

    """
    changes, details = fit.model.of(Modulation), fit.details
    flat = [e.label for e in fit.model.of(Spectrum) if _is_flat(e, evidence.dt)]
    if not changes or details is None or not flat or views.muted_by(fit, 'variance'):
        return None
    t, x, _ = in_time.power_in_time(evidence, fit.model)
    edges = in_time.bands_in_time(evidence)
    groups = [i for i in np.array_split(np.arange(len(edges) - 1), x.shape[1]) if len(i)]
    if x.shape[1] < 2:  # of all bands together
        return None
    m = np.prod([in_time.block_variance(e, t) for e in changes], axis=0)
    m = m / np.mean(m) - 1
    f = evidence.whole.bins.f
    white, whole = sum(details.each[k] for k in flat), np.maximum(details.v, evidence.whole.power)
    for column, i in reversed([*enumerate(groups)]):
        low, high = edges[i[0]], edges[i[-1] + 1]
        there = (f >= low) & (f < high)
        if np.sum(white[there]) <= SHARE * np.sum(whole[there]):
            continue
        y = x[:, column] / np.mean(x[:, column]) - 1
        slope = float(m @ y / (m @ m))
        spread = np.sqrt(np.sum((y - slope * m)**2) / (len(y) - 2) / (m @ m))
        if slope + SURE * spread < 0.5:
            return float(low), float(high)
    return None


def with_level_notes(evidence: Evidence, fit: Fit) -> dict[str, dict[str, Estimate]]:
    """Return the estimates of a fit, what every sensor has with what there is to say of it."""
    out = {k: dict(v) for k, v in fit.estimates.items()}
    low, high = extremes(evidence, fit.model)
    band = steady_band(evidence, fit) if high > low else None
    said = _notes(evidence, fit, high > low, band)
    for e in fit.model.of(Spectrum):
        for p in e.parameters if said and e.never_absent else ():
            estimate = out[e.label][p.name]
            notes = [estimate.note, *said] if estimate.note else list(said)
            if estimate.value and high > low and not band and _is_flat(e, evidence.dt):
                quiet, loud = (units.shown(f * estimate.value, p.unit, evidence.sensor)
                               for f in (low, high))
                notes.append(f'{quiet} where it is quietest, {loud} where it is loudest')
            out[e.label][p.name] = replace(estimate, note='; '.join(notes))
    return out


def _is_flat(effect: Spectrum, dt: float) -> bool:
    """Tell whether an effect is as strong at all frequencies; of that blocks of time tell."""
    return bool(np.ptp(effect.psd(np.array([0.01, 0.1, 0.4]) / dt, dt)) == 0)
