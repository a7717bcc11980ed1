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
from .imm import Bank, Coefficients, log_density
from .modes import modes_of
from .statespace import FilterEffect, jumps, state_space
from ..loop.effect import Model

CHUNKS = 40             # of a series, run side by side: fewer take more steps, more warm up more
CHUNK, WARM = 128, 256  # samples: the fewest of a chunk, and those before it that it warms up on
LANES = 400             # chunks and models at once: what they need then stays in the cache


@dataclass(frozen=True)
class Prediction:
    """
    Log-likelihood of the samples after the first ``settle``, and the scores of those.

    ``u`` (n - settle,); ``smooth`` alike, of samples as they may have been before they were
    rounded: rounding makes a comb of the distribution of ``u``, and no model is to blame.

    """

    log_likelihood: float
    u: np.ndarray
    smooth: np.ndarray


def settle_of(n: int) -> int:
    """Return how many samples at the start are left out while a filter settles."""
    return min(512, n // 8)


def oscillates(model: Model) -> bool:
    """Tell whether an effect of the model has a phase."""
    return any(e.line for e in model.of(FilterEffect))


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
    model: Model, z: np.ndarray, dt: float, alpha: float = 1.0, step: float = 0.0
) -> Prediction:
    """
    Return the prediction of z (n,), an output in steps of ``step``, by one model.

    Likelihood 0 where it cannot be.

    """
    settle = settle_of(len(z))
    ends = (-0.5 * step, 0.5 * step) if step else ()
    if jumps(model):
        log_l, scores = by_bank([model], z, dt, alpha, (0.0, *ends))
        u, *sides = (x[0] for x in scores)
        return Prediction(float(log_l[0]), u, within_step(*sides) if step else u)
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


def by_bank(
    models: list[Model], z: np.ndarray, dt: float, alpha: float = 1.0,
    at_off: tuple[float, ...] = ()
) -> tuple[np.ndarray, list[np.ndarray]]:
    """
    Return log-likelihoods (k,) of k models of one structure, and lists of scores (k, n - settle).

    By the recursion of the bank. There are scores of the samples off by each of ``at_off``.

    """
    each, scores = densities(models, z, dt, alpha, at_off)
    log_l = each.sum(1)
    return np.where(np.isfinite(log_l), log_l, -np.inf), scores


def densities(
    models: list[Model], z: np.ndarray, dt: float, alpha: float = 1.0,
    at_off: tuple[float, ...] = ()
) -> tuple[np.ndarray, list[np.ndarray]]:
    """
    Return what :func:`by_bank` does, the log-likelihood sample by sample, (k, n - settle).

    Chunks of the series run side by side, each warmed up on the samples before it.

    """
    size = max(CHUNK, -(-len(z) // CHUNKS))
    first = np.arange(0, len(z), size)
    some = max(1, LANES // len(first))
    parts = [_chunks(models[i:i + some], z, dt, alpha, at_off, first, size)
             for i in range(0, len(models), some)]
    return (np.concatenate([part[0] for part in parts]),
            [np.concatenate(u) for u in zip(*(part[1] for part in parts))])


def _chunks(models, z, dt, alpha, at_off, first, size):
    """Return what :func:`densities` does, by chunks of a size that begin at ``first``."""
    n, k, settle = len(z), len(models), settle_of(len(z))
    begin, stop = np.maximum(first - WARM, 0), np.minimum(first + size, n)
    bank, e = _side_by_side(models, dt, alpha, len(first))
    each, *scores = np.empty((1 + len(at_off), k, n))
    for step in range(int(np.max(stop - begin))):
        at = begin + step
        live = (at >= first) & (at < stop)
        samples = np.repeat(z[np.minimum(at, n - 1)], k)
        nu, s, density = bank.step(samples, e) if step else bank.update(samples, e)
        if not live.any():
            continue
        each[:, at[live]] = log_density(density).reshape(-1, k)[live].T
        for u, off in zip(scores, at_off):
            u[:, at[live]] = bank.transform(nu + off, s, e).reshape(-1, k)[live].T
    return each[:, settle:], [u[:, settle:] for u in scores]


def _side_by_side(models, dt, alpha, chunks):
    """Return a bank whose lanes are chunks of the series, all models each, and its entries."""
    each = [modes_of([m], dt) for m in models]
    table = Coefficients([replace(each[0], spaces=tuple(m.spaces[0] for m in each))], alpha)
    prior = np.tile(np.array([m.prior for m in each]).T, (1, chunks))
    stay = np.tile([m.stay for m in each], chunks)
    return (Bank(table, len(models) * chunks, prior),
            replace(table.at(0).tiled(chunks), prior=prior, stay=stay))
