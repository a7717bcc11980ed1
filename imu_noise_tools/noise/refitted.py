# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The fit of a model with a candidate more: where it begins, and what it rests on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .doubts import at_bound
from .evidence import Evidence
from .explained import Explained
from .fit import fit as fit_part
from .gains import gain_of
from .kinds import is_peak, Mean, MEASURED, Response, Spectrum
from .response import Order
from ..loop.effect import Effect, Fit, Model, unfitted
from ..loop.verdict import FLEXIBLE

# cosine coefficients from the slowest on: they hold nearly all that an effect on the mean explains
SLOW = 32
# times the model's power: a peak that has more is not explained, and a filter is fitted beside it
STANDS = 3.0
# widths around its middle that such a peak is left out, a narrow one (whose skirts reach far) and
# one that is seen as broad as it is
FOOT, BROAD = 20.0, 1.5
SEEN = 8.0  # standard errors by which a broad one must stand out for that
# nats of a peak that is there in some form: from there on its other forms and places are tried too
CLEAR = 100.0
CLEAREST = 2    # narrow peaks, the clearest, at each of which a fit is begun for that


def refitted(evidence: Evidence, fit: Fit, effect: Effect) -> Fit:
    """Return the fit of a model with an effect more, the best of where it may begin."""
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
        more = max(more, other, key=lambda x: gain_of(evidence, fit, x, False))
    # nor that of noise beside which it is not needed; what is measured has nothing that is free
    if hint.order.terms and isinstance(effect, Spectrum) and not isinstance(effect, MEASURED):
        bare = replace(hint, order=Order(), values=())
        other = fit_part(evidence, model, intervals=False, start=fit.model, hint=bare)
        peak = is_peak(other.model.of(Spectrum)[-1])    # what is not fitted yet is nowhere
        more = max(more, other, key=lambda x: gain_of(evidence, fit, x, peak))
    return more


def within_bounds(evidence: Evidence, fit: Fit, more: Fit) -> Fit:
    """
    Return a fit with a clear peak more, in another of its forms where it ends at its bound.

    What is missing bends what is around a peak, so that the one form that should be none comes out
    somewhat better than the others.

    """
    peak = more.model.effects[-1]
    if not is_peak(peak) or not at_bound(evidence, peak, more.estimates[peak.label]) \
            or gain_of(evidence, fit, more, True) < CLEAR:
        return more
    forms = [p for p in peak.parameters if p.choices]
    others = [refitted(evidence, fit, type(peak)({p.name: k}))
              for p in forms for k in peak.others(p, evidence)]
    return _best_within(evidence, fit, others, more)


def by_its_middle(evidence: Evidence, fit: Fit, more: Fit) -> Fit:
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
    best, before = _best_within(evidence, fit, others, more), gain_of(evidence, fit, more, True)
    if at_bound(evidence, peak, more.estimates[peak.label]):
        return best
    return best if gain_of(evidence, fit, best, True) > before + FLEXIBLE else more


def _best_within(evidence: Evidence, fit: Fit, others: list[Fit], more: Fit) -> Fit:
    """Return that of some fits whose last peak gains most within its bounds, if there is one."""
    return max((x for x in others if not at_bound(
        evidence, x.model.effects[-1], x.estimates[x.model.labels[-1]])),
        key=lambda x: gain_of(evidence, fit, x, True), default=more)


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
