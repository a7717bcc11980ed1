# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a candidate gains beside a model, nats, and what chance reaches of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import cast

import numpy as np

from . import views
from .evidence import Evidence
from .explained import Bands, gained, gained_beyond
from .fit import Details
from .kinds import Coupling, Mean, model_crowd, NoiseEffect, Response, Spectrum
from .likelihood import Likelihood, spectrum_without, told_by_gains
from .measured import penalty
from ..loop.effect import Estimate, Fit, registry

# nats that a half octave may count at most for or against a candidate: what no model explains
# there would decide otherwise
CAP = 50.0
WHOLE = 1e9  # in the place of CAP where every band counts in full
# parameters besides the first that are priced at most where names are compared
MOST_SHAPES = 2
# of the power of a bin: the least that is left of it where sources were known exactly (a choice)
LEFT = 0.01
# standard deviations of an optional parameter: farther from zero it is used, and priced
OPTIONAL = 3.0
# nats: the odds, 100 to 1 (a choice), against a sensor that lacks what every sensor has
ABSENT = float(np.log(100.0))


def price_by_chance(effect: NoiseEffect, evidence: Evidence) -> float:
    """Return what chance reaches of an effect as it is in the record of an axis, nats."""
    return max(penalty_of(effect), effect.by_chance(evidence))


def penalty_of(effect: NoiseEffect) -> float:
    """
    Return what chance reaches of an effect, nats, and no less than of those of its spectrum.

    What the spectrum alone says would otherwise name the one whose own chance is less.

    """
    return max(penalty(name) for name in (effect.name, *of_its_kind(effect)))


def of_its_kind(effect: NoiseEffect) -> list[str]:
    """Return the names of all with an effect's spectrum, its own too; none if no other has it."""
    known = cast('dict[str, type[NoiseEffect]]', registry('noise'))
    return [name for name, cls in known.items() if effect.alike and cls.alike == effect.alike]


def gain_of(evidence: Evidence, before: Fit, after: Fit, partly: bool) -> float:
    """Return what the last effect of a fit gains over the one before, and by its own doing."""
    label = after.model.labels[-1]
    effect = after.model[label]
    gain = gained_by(evidence, before, after, partly)
    if isinstance(effect, (Spectrum, Response)):
        gain = min(gain, _own(evidence, after, label, partly))
    if isinstance(effect, Coupling):
        if before.model.of(Coupling):
            gain = min(gain, gained_beyond(Bands.on(evidence.whole.bins), before.details,
                                           _known(evidence, before), after.details, CAP, partly))
        gain = min(gain, told_by_gains(evidence, after, label)) / model_crowd(before.model)
    return gain


def within_means(evidence: Evidence, before: Fit, after: Fit) -> float:
    """Return what an edge gains that no view shows: it falls within the means of that of time."""
    resolved = views.TIME_BLOCKS / (2 * evidence.duration)
    bands = Bands.on(evidence.whole.bins)
    return max(gained(bands, before.details, after.details, CAP, above=resolved), 0.0)


def _known(evidence: Evidence, fit: Fit) -> Details:
    """
    Return what a fit would explain if all were known that its couplings miss of their sources.

    What the noise of an accelerometer hides of a motion other axes may hear more clearly; then
    they tell more of it, and of nothing else.

    """
    d = fit.details
    missed = Likelihood(evidence, 'whole', fit.model, fit).channels.missed(fit.model)
    heard = np.maximum(d.v - missed, LEFT * d.v)
    return replace(d, v=heard, power=d.power * heard / d.v)


def _own(evidence: Evidence, fit: Fit, label: str, partly: bool) -> float:
    """
    Return what a fit loses without an effect, nats, where all others keep their values.

    Refitted they lose less, so this is a bound of what the effect gains; a gain beyond it is that
    of a refit that was caught before, and none of the effect's doing. Without a filter few bands
    lose much, where refitted all lose some: of those each counts in full. But what stands out of
    what a filter lets pass is missed by more with it than without.

    """
    v, d = spectrum_without(evidence, fit, label), fit.details
    if v is None:
        return np.inf
    bands = Bands.on(evidence.whole.bins)
    cap = WHOLE if isinstance(fit.model[label], Response) else CAP
    return gained(bands, replace(d, v=v), d, cap, partly, loss=CAP)


def shapes_of(effect: NoiseEffect, estimates: Mapping[str, Estimate]) -> int:
    """
    Return how many parameters besides one are priced; optional ones where they are clear.

    Of the mean and of a free form all of them, for they bend to anything together.

    """
    clear = sum(abs(estimates[name].point or 0.0) > OPTIONAL * (estimates[name].std or 0.0)
                for name in effect.optional)
    if isinstance(effect, Mean):
        return min(effect.always_fitted - 1, MOST_SHAPES) + clear
    most = effect.always_fitted if effect.free else MOST_SHAPES
    return min(effect.always_fitted - 1 + clear, most)


def gained_by(evidence: Evidence, before: Fit, after: Fit, partly: bool = False) -> float:
    """
    Return the gain in likelihood, nats, of which no band counts more than CAP.

    What neither model explains has levels of its own: to come somewhat nearer to it is no gain,
    unless what explains a part (``partly``) counts.

    """
    bands = Bands.on(evidence.whole.bins)
    return gained(bands, before.details, after.details, CAP, partly)


def unlikely(fit: Fit) -> float:
    """
    Return what it costs a fit to leave nothing of what every sensor has, nats.

    White noise behind a low-pass has the spectrum of a Gauss-Markov process without white noise:
    only that there is no such sensor tells them apart.

    """
    share = {k: np.max(s / fit.details.v) for k, s in fit.details.each.items()}
    there = [e.label for e in fit.model.of(Spectrum) if e.never_absent]
    return ABSENT * sum(bool(share.get(label, 1.0) < 0.05) for label in there)
