# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a fitted model adds up to in the Allan variance of its record, effect by effect."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from .behind import model_avar, psd_behind
from .evidence import Evidence
from .kinds import Coupling, Defect, Line, Mean, Response, Spectrum
from .likelihood import Likelihood
from ..core.allan import overlapping_variance
from ..core.spectrum import Bins, quadrature_avar
from ..loop.effect import Effect, Model


def model_curve(evidence: Evidence, model: Model, m: np.ndarray,
                each: Mapping[str, np.ndarray] | None = None) -> np.ndarray:
    """
    Return the Allan variance (k,) of a fitted model at cluster sizes m (k,).

    Noises are independent, and their variances add up. What has one course in the record, a mean
    or another channel, is added up before it is squared. ``each`` is that of every effect by
    itself, by label, where it is known.

    """
    if each is None:
        each = effects_avar(evidence, (e for e in model if not _has_a_course(e)), model, m)
    out = mean_avar(evidence, model, m)
    if couplings := model.of(Coupling):
        out = out + _coupled_avar(evidence, couplings, m)
    rest = (v for label, v in each.items() if not _has_a_course(model[label]))
    return np.maximum(sum(rest, out), 1e-300)


def effects_avar(evidence: Evidence, effects: Iterable[Effect], model: Model,
                 m: np.ndarray) -> dict[str, np.ndarray]:
    """Return :func:`effect_avar` (k,) of those effects of a model that have any, by label."""
    each = {e.label: effect_avar(evidence, model, e, m) for e in effects}
    return {label: v for label, v in each.items() if v is not None}


def _has_a_course(effect: Effect) -> bool:
    """Tell whether what an effect does is one course in the record, and no noise of its own."""
    return isinstance(effect, (Coupling, Mean))


def mean_avar(evidence: Evidence, model: Model, m: np.ndarray) -> np.ndarray:
    """Return the Allan variance (k,) of a model's mean, all of its effects together."""
    means = model.of(Mean)
    if not means:
        return np.zeros(len(m))
    if len(means) == 1 and type(means[0]).avar is not Mean.avar:
        return means[0].avar(m, evidence.dt)
    return _drift_avar(evidence, means, m)


def bin_weights(bins: Bins, m: np.ndarray) -> np.ndarray:
    """
    Return what power in each bin adds to the Allan variances at cluster sizes m, (k, b).

    The Allan variance is a weighted sum of periodogram ordinates, weights 2 sin^4(pi f m dt)/(m
    sin(pi f dt))^2 df (sin^4 replaced by its mean where a bin holds many of its oscillations).

    """
    f, width = bins.f, bins.count / (2 * bins.n * bins.dt)
    m = np.asarray(m, float)[:, None]
    wave = np.where(m * bins.dt * width < 0.25, np.sin(np.pi * f * m * bins.dt) ** 4, 0.375)
    return 2 * wave / (m * np.sin(np.pi * f * bins.dt)) ** 2 * width


def effect_avar(evidence: Evidence, model: Model, effect: Effect,
                m: np.ndarray) -> np.ndarray | None:
    """Return the Allan variance (k,) of one effect by itself at cluster sizes m; None: nothing."""
    dt = evidence.dt
    if isinstance(effect, Mean):
        return mean_avar(evidence, Model([effect]), m)
    if isinstance(effect, Spectrum):
        behind = [r for r in model.of(Response) if r is not effect]
        if (colour := effect.colour(evidence)) is not None:
            return quadrature_avar(lambda f: psd_behind(effect, model, f, dt) * colour(f), m, dt)
        return model_avar(Model([effect, *behind]), m, dt)
    if isinstance(effect, Line):
        return effect.share(evidence.duration) * effect.avar(m, dt)
    if isinstance(effect, Coupling):
        return _coupled_avar(evidence, [effect], m)
    if isinstance(effect, Defect) and effect.screens():
        return _screened_avar(evidence, m)
    return None


def _drift_avar(evidence, means, m):
    """Allan variance of a fitted mean by its block means; below a block, of a straight line."""
    length = evidence.common.slow_length
    y = sum(e.mean(evidence.slow_inputs) for e in means)
    blocks = np.unique(np.clip(np.round(m / length), 1, len(y) // 3).astype(int))
    v = np.maximum(overlapping_variance(y, blocks), 1e-300)
    out = np.exp(np.interp(np.log(m), np.log(blocks * length), np.log(v)))
    return np.where(m < length, v[0] * (m / length) ** 2, out)


def _coupled_avar(evidence, couplings, m):
    """
    Allan variance of what other channels put into this one, from the binned cross-spectra.

    With it comes what they share with the rest of the axis, its mean for one.

    """
    alone = Model(couplings)
    likelihood = Likelihood(evidence, 'whole', alone)
    s = np.maximum(likelihood.power - likelihood.without_couplings(alone), 0)
    at = np.log(likelihood.bins.f)
    return quadrature_avar(lambda f: np.interp(np.log(f), at, s), m, evidence.dt)


def _screened_avar(evidence, m):
    """
    Allan variance of isolated samples that are screened before the fit, and stay in the curve.

    They are white; their level is that of the curve at one sample less that of the spectrum, which
    was made without them: 2 int S(f) sin^2(pi f dt) df.

    """
    bins, curve, part = evidence.whole.bins, evidence.curve, evidence.whole
    width = bins.count / (2 * bins.n * bins.dt)
    s = part.power + part.lines.sum(axis=0)
    clean = 2 * np.sum(s * np.sin(np.pi * bins.f * bins.dt) ** 2 * width)
    return max(curve.dev[0] ** 2 * curve.m[0] - clean, 0.0) / m
