# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Fitting a model to one axis: point values, profile intervals, upper limits.

By maximum likelihood in the cosine domain (:mod:`~imu_noise_tools.noise.likelihood`), from the
most promising of several starts.

"""

from __future__ import annotations

import numpy as np

from .evidence import Evidence
from .kinds import Mean
from .likelihood import Likelihood
from .measured import with_measured
from .starts import most_promising, reddest, starts
from .uncertainty import chosen_estimates, estimates, plain_estimates, with_linear
from ..core.errors import FitError
from ..loop.effect import Fit, Model

_REDDEST = 1.0  # weight of -ln(slowest amplitude) in the point estimate


def fit(
    evidence: Evidence,
    model: Model,
    part: str = 'whole',
    *,
    mean: Fit | None = None,
    intervals: bool = True,
    cautious: bool | None = None,
    start: Model | None = None,
) -> Fit:
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
        For a half: the fit of the same model to the whole.
    intervals : bool
        Whether to compute profile intervals (slow part).
    cautious : bool or None
        Whether to keep the slowest amplitude off zero, as a value with an interval wants it; None:
        where there are intervals. For a prediction the most likely value is better.
    start : Model or None
        A model whose values to start from first (the fit of a smaller model, say).

    Raises
    ------
    FitError
        No finite likelihood from any start.

    """
    model, measured, flags = with_measured(evidence, model)
    if mean is not None:
        for e in model.of(Mean):
            model = model.with_effect(mean.model[e.label])
    plain = Likelihood(evidence, part, model, mean)
    proposed = starts(plain, start)
    best = None
    cautious = intervals if cautious is None else cautious
    enough, most = (1e-7, 6) if cautious else (1e-3, 3)  # a comparison needs no more
    for likelihood, x0 in most_promising(plain, proposed, mean, most):
        slowest = reddest(likelihood, x0) if cautious else None
        found = likelihood.minimise(x0, penalty=_REDDEST, reddest=slowest, enough=enough)
        found = _revived(likelihood, found, slowest, enough)
        if np.isfinite(found[1]) and (best is None or found[1] < best[0][1] - 1e-9):
            best = found, slowest, likelihood
    if best is None:
        raise FitError(
            f'{evidence.axis}: {model} has no finite likelihood',
            'remove an effect, or look at the data',
        )
    (x, _, information), slowest, likelihood = best
    nll, linear, v, each = likelihood.value(x)
    fitted = with_linear(likelihood, likelihood.with_search(x), linear)
    said = dict(measured)
    if intervals:
        more, hit = estimates(likelihood, x, information, linear, slowest)
        flags += hit
    else:
        more = plain_estimates(likelihood, x, information, linear)
    for found in (more, chosen_estimates(likelihood)):
        for label, values in found.items():
            said[label] = {**said.get(label, {}), **values}
    return Fit(
        fitted,
        {label: said[label] for label in fitted.labels if label in said},
        -nll,
        tuple(flags),
        {
            'information': information,
            'v': v,
            'each': each,
            'power': linear.power,
            'weight': linear.weight,
            'ml': _maximum_likelihood(likelihood, linear, v),
            'slots': tuple((s.label, s.parameter.name) for s in likelihood.slots),
        },
    )


def _maximum_likelihood(likelihood, linear, v):
    """Return ln L without the REML terms, which makes models with other means comparable."""
    w = likelihood.weight
    return -0.5 * float(np.sum(w * np.log(v) + linear.power * linear.weight / v))


def _revived(likelihood, found, reddest, enough):
    """
    Return the better of a minimum and what follows when dead amplitudes are revived.

    These are the amplitudes that died on the way to the minimum.

    """
    x = found[0]
    v, each = likelihood.spectra(likelihood.with_search(x))
    again = x.copy()
    for j, slot in enumerate(likelihood.slots):
        share = np.max(each[slot.label] / v) if slot.label in each else 1.0
        if slot.parameter.amplitude and slot.parameter.log and share < 1e-3:
            again[j] += 0.5 * np.log(0.3 / max(share, 1e-300))
    if np.array_equal(again, x):
        return found
    other = likelihood.minimise(again, penalty=_REDDEST, reddest=reddest, enough=enough)
    return other if other[1] < found[1] - 1e-6 else found
