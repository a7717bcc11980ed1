# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Rivals without a name to drift and to a mean: a knee of any steepness, and one course in time.

Several effects together imitate what has another form; where one such form does as well as all of
them, they are no names for it.

"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from .block_means import block_means, root_of
from .course import left_by_a_course, PARAMETERS
from .evidence import Evidence
from .explained import Bands, gained
from .fit import fit as fit_part
from .flexible import smooth_gain, spectrum_left, unexplained
from .kinds import is_peak, Mean, MEASURED, NoiseEffect, owners, Response, Spectrum
from .knee import Knee, STEEPEST
from .likelihood import lost_without
from ..core.linear import inverse
from ..loop.effect import Effect, Fit, Model, unfitted
from ..loop.verdict import DIRECTED, FLEXIBLE, FLEXIBLE_SHARE, HEALED, PRICE


def knee_instead(evidence: Evidence, fit: Fit, effect: NoiseEffect, claim: float) -> str:
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
        if better > least and missed < max(
                HEALED * lost_without(evidence, fit, effect.label), FLEXIBLE):
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


def course_instead(evidence: Evidence, fit: Fit, effect: Mean, claim: float) -> str:
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
    better = unexplained(means, means.columns) - left
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


def beside_a_knee(evidence: Evidence, fit: Fit, label: str, claim: float) -> str:
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
    left = unexplained(means, means.columns)
    # refitted without one of them it misses no more than without all
    together = gained(Bands.on(evidence.whole.bins), alone.details, rival.details)
    most = max(together, rival.details.ml - alone.details.ml, 0.0)
    return np.array([rival.model['knee']['steepness'], *(
        min(unexplained(means, means.columns[:, whose != label]) - left, most)
        for label in labels)])
