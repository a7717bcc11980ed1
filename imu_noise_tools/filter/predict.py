# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A model's one-step predictions of one series: log-likelihood and scores.

Many sets of values at once where it must be.

"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr, ndtri

from . import kalman
from .chunks import Chunks, settle_of
from .statespace import jumps, oscillates, state_space
from ..loop.effect import Model


@dataclass(frozen=True)
class Prediction:
    """
    Log-likelihood of the samples after the first ``settle``, and the scores of those.

    ``u`` (n - settle,); ``smooth`` alike, of samples as they may have been before they were
    rounded: rounding makes a comb of the distribution of ``u``, and no model is to blame. Where a
    sample is missing both hold a number drawn by chance, which keeps the others in their time.

    """

    log_likelihood: float
    u: np.ndarray
    smooth: np.ndarray


def finite(log_likelihood: float) -> float:
    """Return a log-likelihood, -inf where there is none."""
    return float(log_likelihood) if np.isfinite(log_likelihood) else -np.inf


def _from_best_start(steady, z, x):
    """
    Return innovations (n,) from the initial state that makes them least: they are linear in it.

    A narrow line's phase is learnt more slowly than any settling time; one least-squares problem
    finds it at once.

    """
    d = len(x)
    columns = np.zeros((len(z), d + 1))
    columns[:, 0] = z
    starts = np.concatenate([x[:, None], np.eye(d)], axis=1)
    nu = kalman.innovations_of(steady, columns, starts)
    return nu[:, 0] - nu[:, 1:] @ np.linalg.lstsq(nu[:, 1:], nu[:, 0], rcond=None)[0]


def within_step(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """
    Return scores drawn, by chance, between those of either end of a step of the output, (n,).

    By their probability: as normal as the samples were before they were rounded (the randomised
    transform of Brockwell 2007).

    """
    flip = low + high > 0       # in the lower tail small probabilities are exact
    low, high = np.where(flip, -high, low), np.where(flip, -low, high)
    share = np.random.default_rng(len(low)).random(len(low))
    below = ndtr(low)
    x = ndtri(np.maximum(below + share * (ndtr(high) - below), 1e-300))
    return np.where(flip, -x, x)


def predict(
    model: Model, z: np.ndarray, dt: float, alpha: float = 1.0, step: float = 0.0,
    chunks: Chunks | None = None
) -> Prediction:
    """
    Return the prediction of z (n,), NaN where missing, by one model.

    It is an output in steps of ``step``.

    ``chunks`` of z, where what is known of them can be of use again.

    Likelihood 0 where it cannot be.

    """
    settle = settle_of(len(z))
    ends = (-0.5 * step, 0.5 * step) if step else ()
    if jumps(model) or np.isnan(z).any():
        each, scores = (chunks or Chunks(z, dt, alpha)).densities([model], (0.0, *ends))
        u, *sides = (x[0] for x in scores)
        drawn = np.random.default_rng(len(u)).standard_normal(len(u))
        u, smooth = (np.where(np.isnan(x), drawn, x)
                     for x in (u, within_step(*sides) if step else u))
        return Prediction(finite(float(np.sum(each))), u, smooth)
    space = state_space(model, dt)
    steady = kalman.steady_state(space, alpha)
    start = float(np.mean(z[:32]))
    if steady is None:
        # a rate that nothing drives: over n samples it is one that wanders by less than can be
        # seen
        at = int(np.argmax(space.rate != 0))
        q = space.q.copy()
        q[at, at] += 4 * space.r / len(z) ** 2
        steady = kalman.steady_state(replace(space, q=q), alpha)
        start = float(np.mean(z))
    if steady is None:
        unknown = np.full(len(z) - settle, np.nan)
        return Prediction(-np.inf, unknown, unknown)
    x = np.zeros(space.size)
    x[int(np.argmax(space.rate != 0))] = start
    innovations = _from_best_start if oscillates(model) else kalman.innovations_of
    nu = innovations(steady, z, x)[settle:]
    sigma = np.sqrt(steady.s)
    smooth = within_step(*((nu + end) / sigma for end in ends)) if step else nu / sigma
    return Prediction(kalman.log_likelihood(nu, steady.s), nu / sigma, smooth)
