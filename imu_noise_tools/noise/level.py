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

from .curve import model_curve
from .evidence import Evidence
from .kinds import Modulation, Spectrum
from ..core import units
from ..core.clipped import ends_in_words, narrowed
from ..loop.effect import Estimate, Fit, Model

CLIPPED = 1e-3  # share of the samples at an end of the range; less takes no thousandth from N
APART = 1.25  # ratio of curve and model at 1 s from which it is said
TIMES = 4096  # moments of a record at which its level is asked for
NEAR = 1.2  # s: an averaging time within this factor of 1 s stands for it


def at_one_second(evidence: Evidence, model: Model) -> tuple[int, float]:
    """Return where a curve comes nearest to 1 s, and the deviation of a fitted model there."""
    c = evidence.curve
    i = int(np.argmin(np.abs(np.log(c.tau))))
    return i, float(np.sqrt(model_curve(evidence, model, c.m[i:i + 1])[0]))


def level_notes(evidence: Evidence, fit: Fit) -> list[str]:
    """Return what there is to say of the level of a fit to a whole record: mostly nothing."""
    out = []
    if said := clipped(evidence):
        out.append(f'{said}: mean and level are wrong')
    low, high = extremes(evidence, fit.model)
    if high > low:
        out.append('the mean over the whole record (rms), whose level changes in time')
    elif np.isfinite(fit.details.hint.quiet):
        out.append(f'the level from {fit.details.hint.quiet:.3g} Hz on is that of the quiet part '
                   'of the record')
    elif len(evidence.loud):
        out.append('the mean over the whole record, parts of which are louder')
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


def clipped(evidence: Evidence) -> str:
    """Return how many of the samples stand at an end of the range, and where; '' for too few."""
    if np.sum(evidence.clipped[:, 1]) < CLIPPED:
        return ''
    ends = ends_in_words(evidence.axis, evidence.clipped.tolist())
    return f'samples stand at the end of the range ({ends})'


def narrowed_by_clipping(evidence: Evidence, fit: Fit) -> tuple[str, ...]:
    """
    Return which levels would leave their interval if no sample was clipped.

    As normal noise would that is clipped so; of a coarse output that is more than there is.

    """
    left = narrowed(evidence.clipped[:, 1].tolist())
    out = []
    for e in fit.model.of(Spectrum) if clipped(evidence) else ():
        for name, found in fit.estimates.get(e.label, {}).items():
            if e.in_every_sensor and _is_flat(e, evidence.dt) and found.point and not (
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


def with_level_notes(evidence: Evidence, fit: Fit) -> dict[str, dict[str, Estimate]]:
    """Return the estimates of a fit, what every sensor has with what there is to say of it."""
    out = {k: dict(v) for k, v in fit.estimates.items()}
    said = level_notes(evidence, fit)
    low, high = extremes(evidence, fit.model)
    for e in fit.model.of(Spectrum):
        for p in e.parameters if said and e.in_every_sensor else ():
            estimate = out[e.label][p.name]
            notes = [estimate.note, *said] if estimate.note else list(said)
            if estimate.value and high > low and _is_flat(e, evidence.dt):
                quiet, loud = (units.shown(f * estimate.value, p.unit, evidence.sensor)
                               for f in (low, high))
                notes.append(f'{quiet} where it is quietest, {loud} where it is loudest')
            out[e.label][p.name] = replace(estimate, note='; '.join(notes))
    return out


def _is_flat(effect: Spectrum, dt: float) -> bool:
    """Tell whether an effect is as strong at all frequencies; of that blocks of time tell."""
    return bool(np.ptp(effect.psd(np.array([0.01, 0.1, 0.4]) / dt, dt)) == 0)
