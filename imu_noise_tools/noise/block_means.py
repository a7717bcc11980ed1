# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The means of equal blocks of a record, what a model says of them, and one half by the other.

The view ``time`` predicts half of the block means from the other half.

"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .behind import model_psd
from .evidence import claimed_lines, Evidence
from .in_time import block_variance
from .kinds import Coupling, Mean, Modulation, Spectrum
from .likelihood import Likelihood
from .lines import waves
from .views import is_there, TIME_BLOCKS, view_of
from ..core.spectrum import bins_of, expected
from ..core.statistics import gamma_excess, means_of_blocks
from ..loop.effect import Fit, Model, View

LEAKS = 1e-3  # of the density, what leaks into means from far above that counts
GROUP = 4  # block means to a bin of the time view
SEGMENTS = 8  # stretches of the record, predicted in turn from the others


@dataclass(frozen=True)
class BlockMeans:
    """
    Means of equal blocks, (k,), and their times.

    With what acts on the mean as columns (k, p), and their covariance (k, k).

    """

    t: np.ndarray
    y: np.ndarray
    columns: np.ndarray
    covariance: np.ndarray


def slow_rest(evidence: Evidence, model: Model) -> np.ndarray:
    """Return the slow means (s,) of the axis less what the model couples in and its lines."""
    e = evidence
    y, t = e.slow_y.astype(float), e.slow_t
    for c in model.of(Coupling):
        for channel, gain in c.gains(e):
            y = y - gain * e.coupled_blocks(channel)
    lines = e.line_table[list(claimed_lines(e, model))]
    return y - waves(lines, t, e.dt, e.common.slow_length)


def followed(evidence: Evidence, fit: Fit) -> list[Spectrum]:
    """Return what is noise to the spectrum and has a path that the samples show."""
    return [s for s in fit.model.of(Spectrum)
            if s.path(evidence) is not None and is_there(fit, s)]


def block_means(evidence: Evidence, fit: Fit) -> BlockMeans:
    """
    Return block means of the whole record and what the model says of them.

    Noise whose path is seen is no noise to them: a jump is unlike any of its spectrum.

    """
    e, noise = evidence, fit.model
    count = min(TIME_BLOCKS, len(e.slow_y) // 2 * 2)
    per = len(e.slow_y) // count
    used = count * per

    def mean(v):
        return v[:used].reshape(count, per, *v.shape[1:]).mean(axis=1)

    y, t = slow_rest(e, fit.model), e.slow_t
    for s in followed(e, fit):
        y, noise = y - s.path(e), noise.minus(s.label)
    columns = [np.ones((len(y), 1))]
    for m in fit.model.of(Mean):
        columns.append(m.columns(e.slow_inputs, **m.nonlinear))
    x = mean(np.concatenate(columns, axis=1))
    scale = np.sqrt(np.mean(x**2, axis=0))
    covariance = (
        covariance_of_means(
            lambda f: model_psd(noise, f, e.dt) + _missed(e, fit.model, f),
            count, used * e.common.slow_length, e.dt,
            lambda low: _fast(e, fit, noise, low)
        )
        if noise.of(Spectrum)
        else np.eye(count) * np.var(mean(y))
    )
    for m in fit.model.of(Modulation):  # it acts on what is flat in the spectrum
        f = np.arange(1, 65) / (128 * e.dt)
        flat = np.min(model_psd(noise, f, e.dt)) / (2 * e.dt * per * e.common.slow_length)
        factor = block_variance(m, mean(t))
        covariance = covariance + np.diag(flat * (factor / np.mean(factor) - 1))
    return BlockMeans(mean(t), mean(y), x / np.where(scale > 0, scale, 1.0), covariance)


def _missed(evidence: Evidence, model: Model, f: np.ndarray) -> np.ndarray | float:
    """Return the power at f (Hz) of sources that the model's couplings miss."""
    if not model.of(Coupling):
        return 0.0
    known = Likelihood(evidence, 'whole', Model(model.of(Coupling)))
    return np.interp(f, known.bins.f, known.channels.missed(model))


def _fast(evidence: Evidence, fit: Fit, noise: Model, low: float) -> float | None:
    """
    Return the level that white noise would need to add as much to means of blocks.

    As all of the noise of a model does above ``low`` Hz, by its power in the bins: peaks there may
    be narrower than any grid. None where no bin is above that, or the fit has none.

    """
    bins = evidence.whole.bins
    above = bins.f > low
    if fit.details is None or not np.any(above):
        return None
    v = sum((v for k, v in fit.details.each.items() if k in noise), np.zeros(len(bins.f)))
    weight = (bins.count / np.sin(np.pi * bins.f * bins.dt) ** 2)[above]
    return float(weight @ v[above] / np.sum(weight))


def covariance_of_means(psd: Callable[[np.ndarray], np.ndarray], count: int, n: int, dt: float,
                        beyond: Callable[[float], float | None] = lambda low: None) -> np.ndarray:
    """
    Return the covariance (count, count) of the means of blocks of n samples of noise of a density.

    ``psd`` gives it at frequencies in Hz, ``dt`` is in s. It is Phi diag(V) Phi^T, Phi the DCT
    basis of the blocks.

    A cosine k of the record is, averaged over blocks, a cosine of the blocks with the gain of its
    Dirichlet kernel; k and 2 count j +- k fold onto each other, those of them that the record has.
    Of the first of these each is asked for; the others are all taken for as loud as the last, or
    as ``beyond`` tells of what is above its frequency, Hz.

    """
    q = np.arange(1, count)
    folds = 12
    k = np.stack([q] + [2 * count * j + s * q for j in range(1, folds + 1) for s in (-1, 1)])
    has, k = k < n, np.minimum(k, n - 1)
    length = n // count
    gain2 = has * (
        np.sin(np.pi * k / (2 * count)) / (length * np.sin(np.pi * k / (2 * n)))) ** 2
    s = psd(k.ravel() / (2 * n * dt)).reshape(k.shape)
    low, seen = (  # without what leaks from far above, and with it
        expected(psd, bins_of(n, dt, ended=ended))[: min(32, len(q))] for ended in (True, False))
    s[0, : len(low)] = low
    missing = np.maximum(1 - gain2.sum(axis=0) * count / n * length, 0)
    rest = beyond(float(np.max(k)) / (2 * n * dt))
    rest = s[-1] if rest is None else rest
    v = (np.sum(s * gain2, axis=0) * count / n + missing * rest / length) / (2 * dt)
    j = np.arange(count) + 0.5
    basis = np.sqrt(2 / count) * np.cos(np.pi * np.outer(j, q) / count)
    out = (basis * v) @ basis.T
    leaks = float(seen[-1] - low[-1])
    if leaks > LEAKS * low[-1]:     # all from two numbers: cosines of one sign at an end together
        far = np.sqrt(gain2[0] * leaks * count / n / (2 * dt))
        ends = np.stack([basis[:, ::2] @ far[::2], basis[:, 1::2] @ far[1::2]], axis=1)
        out += ends @ ends.T
    return np.asarray(out)


def root_of(spread: np.ndarray) -> np.ndarray:
    """
    Return the lower Cholesky factor of a covariance (k, k).

    Where rounding has left no positive definite one (a narrow line orders of magnitude above the
    rest), that of the nearest.

    """
    spread = spread + np.eye(len(spread)) * 1e-12 * np.trace(spread) / len(spread)
    try:
        return np.linalg.cholesky(spread)
    except np.linalg.LinAlgError:
        values, axes = np.linalg.eigh(spread)
        values = np.maximum(values, 1e-10 * max(values[-1], 1e-300))
        return np.linalg.cholesky((axes * values) @ axes.T)


def predicted(
    means: BlockMeans, known: np.ndarray, wanted: np.ndarray
) -> tuple[np.ndarray, float]:
    """
    Return (standard normal residuals, -2 ln p) of the wanted blocks.

    They are predicted from the known ones (universal kriging).

    """
    c_kk = means.covariance[np.ix_(known, known)]
    c_wk = means.covariance[np.ix_(wanted, known)]
    x_k, x_w = means.columns[known], means.columns[wanted]
    c_kk = c_kk + np.eye(len(c_kk)) * 1e-12 * np.trace(c_kk) / len(c_kk)
    solved = np.linalg.solve(c_kk, np.column_stack([c_wk.T, x_k, means.y[known]]))
    gain, kx, ky = solved[:, :len(c_wk)].T, solved[:, len(c_wk):-1], solved[:, -1]
    about = x_k.T @ kx
    if np.linalg.matrix_rank(x_k) < np.count_nonzero(np.any(means.columns, axis=0)):
        # a step behind all that is known: nothing tells its size, which must not be taken for 0
        y = means.y - np.mean(means.y[known])
        means = replace(means, y=y)
        ky = np.linalg.solve(c_kk, y[known])
        about = about + np.eye(len(about)) / (100 * np.var(means.y))
    gram = np.linalg.pinv(about)
    beta = gram @ (x_k.T @ ky)
    rest = means.y[wanted] - x_w @ beta - gain @ (means.y[known] - x_k @ beta)
    lever = x_w - gain @ x_k
    spread = means.covariance[np.ix_(wanted, wanted)] - gain @ c_wk.T + lever @ gram @ lever.T
    root = root_of(0.5 * (spread + spread.T))
    z = np.linalg.solve(root, rest)
    return z, float(z @ z + 2 * np.sum(np.log(np.diag(root))))


def time(evidence: Evidence, fit: Fit, known: str = 'odd') -> View:
    """
    Return the block means of the stretches of one parity predicted from the other's.

    Pulls in time order. The drift that a fit finds beside noise whose path is seen may hold some
    of that, so that it is no misfit where the rest moves less.

    """
    means = block_means(evidence, fit)
    index = np.arange(len(means.y))
    stretch = index * SEGMENTS // len(index)
    odd, even = index[stretch % 2 == 1], index[stretch % 2 == 0]
    a, b = (odd, even) if known == 'odd' else (even, odd)
    z, log_score = predicted(means, a, b)
    x = means_of_blocks(z**2, GROUP)
    if followed(evidence, fit):
        x = np.maximum(x, 1.0)
    excess, variance = gamma_excess(x, np.full(len(x), float(GROUP)))
    return replace(view_of('time', means.t[b], z, excess, variance, 's'), log_score=log_score)
