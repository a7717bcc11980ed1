# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The power of a record in time, in bands of frequency, and what a model says of it.

The view ``variance`` compares the two. What the model's mean, paths and peaks have of that power
is none of the sensor's noise, and is taken out of it.

"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .blocks import degrees, FEWER, FIRST, leaked, SKEW, taper
from .evidence import Evidence
from .kinds import model_tails, Modulation, Spectrum
from .views import hidden_by, hides_loudness, muted_by, nothing, slow_mean, view_of
from ..core.statistics import gamma_excess, gamma_pull
from ..loop.effect import Fit, Model, View

_PART = 0.1  # of its power, from which the mean or a peak is seen there
_BESIDE = 4  # blocks on either side that tell the power of one


def power_in_time(evidence: Evidence, model: Model | None = None,
                  groups: int = 10) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """
    Return (t, x, w): power of groups of bands in time beside its mean (blocks, groups).

    What the model's defects account for is taken off the samples, all of them where there is no
    model; w is in degrees of freedom, (groups,). Of noise below a coarse grid in one group, with
    degrees for each of its blocks, (blocks, 1).

    """
    below = evidence.unrounded if model is None else evidence.beside(model).unrounded
    if below.size:
        blocks = below.shape[1]
        t = (np.arange(blocks) + 0.5) * evidence.duration / blocks
        return t, below[0][:, None], below[1][:, None]
    p = evidence.block_power[-1] if model is None else evidence.block_power_of(model)
    if model is not None:
        p = _without_peaks(_peaks_in(evidence, model), evidence.block_count,
                           _without_mean(evidence, model, p))
    blocks = len(p)     # which leave a few samples at the end
    t = (np.arange(blocks) + 0.5) * (evidence.n // blocks) * evidence.dt
    level = np.mean(p, axis=0)
    count = evidence.block_count.astype(float)
    parts = [i for i in np.array_split(np.arange(len(level)), groups) if len(i)]
    x = np.column_stack([(p[:, i] / level[i]) @ count[i] / count[i].sum() for i in parts])
    band = np.repeat(np.arange(len(level)), evidence.block_count)
    # within a band that falls steeply few ordinates hold most of the power
    s = _ordinates(evidence, evidence.whole.power)[FIRST - 1:]
    s = s / (np.bincount(band, s) / count)[band]
    mean, square = _mean_power(evidence, _bands(evidence)[0])
    s = leaked(s)
    coarse = np.bincount(band, s * s) / np.bincount(band, s) ** 2 * count
    # what is narrower than blocks resolve swells and fades over many of them
    fine = np.maximum(square / mean**2, coarse)
    w = np.array([
        degrees(s[(band >= i[0]) & (band <= i[-1])])
        * np.sum((count * coarse)[i]) / np.sum((count * fine)[i]) for i in parts])
    return t, x, w


def beside(evidence: Evidence, model: Model) -> Evidence:
    """
    Return what is seen beside a model of what changes in time.

    A jump of a path that is seen is no noise that is loud where it comes, and a machine that comes
    and goes none that is the sensor's.

    """
    here = evidence.beside(model)
    if hides_loudness(evidence, model):
        return here.as_rounded.steadier(('level',), lambda p: np.ones_like(p) * np.mean(p, axis=0))
    seen = [s for s in model.of(Spectrum) if s.path(evidence) is not None]
    if seen:
        here = here.steadier(tuple(s.label for s in seen), lambda p: _without(
            evidence, _followed_by(evidence, Model(tuple(seen))), p))
    held = _peaks_in(evidence, model)
    return here.steadier(('bands', *np.flatnonzero(held)), lambda p: _without_peaks(
        held, evidence.block_count, p)) if np.any(held) else here


def _peaks_in(evidence: Evidence, model: Model) -> np.ndarray:
    """
    Tell in which bands of the power in time the model's peaks are seen, (bands,) bool.

    And all else of which the power comes and goes. Nowhere where that is most of them: what then
    changes are the peaks.

    """
    count = evidence.block_count
    none = np.zeros(len(count), bool)
    peaks = [s for s in model.of(Spectrum) if all(p.name in s.values for p in s.parameters)
             and s.uneven]
    if not peaks:
        return none
    band = np.repeat(np.arange(len(count)), count)
    own, total = (np.bincount(band, leaked(_ordinates(evidence, v))[FIRST - 1:]) for v in (
        np.sum([s.binned(evidence.whole.bins) for s in peaks], axis=0), evidence.whole.power))
    held = own > _PART * total
    return held if count[held].sum() <= 0.5 * count.sum() else none


def _without_peaks(held: np.ndarray, count: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Return the power in time (blocks, bands) with some bands as loud as the others are."""
    if not np.any(held):
        return p
    level = np.mean(p, axis=0)
    others = (p[:, ~held] / level[~held]) @ count[~held] / count[~held].sum()
    return np.where(held, level * others[:, None], p)


def _without_mean(evidence: Evidence, model: Model, p: np.ndarray) -> np.ndarray:
    """
    Return the power in time (blocks, bands) as beside it where the model's mean is a part of it.

    A step is no noise that is loud where it comes, nor is a jump of a path that is seen.

    """
    known = _followed_by(evidence, model)
    return _without(evidence, known, p) if np.any(known) else p


def _followed_by(evidence: Evidence, model: Model) -> np.ndarray:
    """Return what the model says of the slow means (s,), with paths that the samples show."""
    paths = (s.path(evidence) for s in model.of(Spectrum))
    return sum((x for x in paths if x is not None), slow_mean(evidence, model))


def _without(evidence: Evidence, known: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Return the power in time (blocks, bands) as beside it where slow means (s,) are in it."""
    blocks, slow = len(p), evidence.common.slow_length
    length = evidence.n // blocks
    per = length // slow
    if per <= 2 * FIRST:
        return p
    window = taper(per)
    begin = np.arange(blocks) * length // slow
    pieces = known[begin[:, None] + np.arange(per)]
    pieces = (pieces - pieces.mean(axis=1, keepdims=True)) * window
    # a step at a third of a block is nothing at every third ordinate
    own = np.max(np.abs(np.fft.rfft(pieces, axis=1)[:, FIRST:FIRST + 2]) ** 2, axis=1)
    own *= 2 * evidence.dt * slow / np.sum(window**2)
    there = own > _PART * np.mean(p[:, 0])
    if not np.any(there) or np.all(there):
        return p
    out, others = p.copy(), np.flatnonzero(~there)
    for i in np.flatnonzero(there):
        k = np.searchsorted(others, i)
        out[i] = np.mean(p[others[max(0, k - _BESIDE):k + _BESIDE]], axis=0)
    return out


def _mean_power(evidence: Evidence, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean of the measured power and of its square between edges (Hz), (k,) each."""
    bins, power = evidence.whole.bins, evidence.whole.power
    # of w coefficients the mean square is larger than the square of their level by 1 + 2/w
    square = power**2 * bins.count / (bins.count + 2)
    return bins.between(power, edges)[1], bins.between(square, edges)[1]


def _ordinates(evidence: Evidence, v: np.ndarray) -> np.ndarray:
    """Return a spectrum v (b,) at the ordinates of a block in time, from the first on (k,)."""
    edges, width = _bands(evidence)
    each = width * (0.5 + np.arange(round(edges[-1] / width + 0.5)))
    return evidence.whole.bins.between(v, each)[1]


def _bands(evidence: Evidence) -> tuple[np.ndarray, float]:
    """Return the edges (bands + 1,) of the power in time's bands, and an ordinate's width, Hz."""
    width = 1 / (evidence.n // evidence.block_power.shape[1] * evidence.dt)
    return width * (FIRST - 0.5 + np.concatenate([[0], np.cumsum(evidence.block_count)])), width


def bands_in_time(evidence: Evidence) -> np.ndarray:
    """Return the edges (bands + 1,) of the bands of the power in time, Hz."""
    return _bands(evidence)[0]


def modulated(model: Model, t: np.ndarray, x: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Return what the model's modulation says of power in time (blocks, groups), mean near 1."""
    followed = np.ones_like(x)
    for m in model.of(Modulation):
        followed = followed * followed_by(block_variance(m, t), x, w)
    return followed


def block_variance(effect: Modulation, t: np.ndarray) -> np.ndarray:
    """Return the mean variance over each block of which t are the middles."""
    width = t[1] - t[0]
    part = (np.arange(8) + 0.5) / 8 - 0.5
    return effect.variance((t[:, None] + width * part).ravel()).reshape(len(t), 8).mean(axis=1)


def followed_by(factor: np.ndarray, x: np.ndarray, w: np.ndarray) -> np.ndarray:
    """
    Return what x (blocks, groups) is when part of each group follows a factor (blocks,).

    Noise that changes is one part of a group of bands, noise that does not (flicker, say) the
    other: m = (1 - a) + a factor, a from 0 to 1 the likeliest of each group, and 1 in the group
    that says most of the factor.

    """
    share = np.linspace(0, 1, 41)[:, None, None]
    m = 1 - share + share * (factor / np.mean(factor))[None, :, None]
    each = np.broadcast_to(w, x.shape)
    total = each.sum(axis=0)
    part = each / total
    cost = np.log(np.sum(part * x / m, axis=1)) + np.sum(part * np.log(m), axis=1)
    chosen = np.argmin(cost, axis=0)
    chosen[np.argmax(total * (cost[0] - np.min(cost, axis=0)))] = len(share) - 1
    best = m[chosen, :, 0].T
    return best * np.sum(part * x / best, axis=0)


def pooled(x: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Return the power in time (blocks,) of all groups together."""
    return x[:, 0] if x.shape[1] == 1 else x @ w / w.sum()


def degrees_of(w: np.ndarray) -> float:
    """Return the degrees of freedom of all groups of a block, or of the usual one."""
    return float(w.sum() if w.ndim == 1 else np.mean(w))


def variance(evidence: Evidence, fit: Fit) -> View:
    """Return the power in time beside its mean over the record, in four groups of bands."""
    if hidden_by(evidence, fit, 'variance'):
        return nothing('variance', 's')
    t, x, w = power_in_time(evidence, fit.model)
    x = x / modulated(fit.model, t, x, w)
    muted = muted_by(fit, 'variance')
    if muted:  # it scatters otherwise than normal noise: as neighbours do, defects left out
        # alike for all models compared
        w = rough_degrees(power_in_time(beside(evidence, fit.model))[1], w)
    tails = model_tails(fit.model, evidence)
    if tails is not None and not muted:
        w = heavy_degrees(w, tails.kurtosis(), evidence.n // len(t))
    blocks = len(t)
    w = np.broadcast_to(w, x.shape)
    told = w[:, 0] > 0      # below a coarse grid some blocks tell nothing
    t, x, w = t[told], x[told], w[told]
    excess, spread = gamma_excess(x, w)
    excess = excess + SKEW / w
    view = view_of('variance', np.repeat(t, x.shape[1]), gamma_pull(x, w).ravel(), excess.ravel(),
                   spread.ravel() * (1 - 1 / blocks), 's')
    return replace(view, muted=muted)


def heavy_degrees(w: np.ndarray, kurtosis: float, length: int) -> np.ndarray:
    """
    Return the degrees of freedom (groups,) of blocks of samples with an excess kurtosis.

    The relative variance of the power of a block is 2/w + kurtosis sum h^4/(sum h^2)^2, the second
    term the same in all groups at once, h the window over ``length`` samples.

    """
    return w / (1 + w.sum() * kurtosis * FEWER / (2 * length))


def rough_degrees(x: np.ndarray, w: np.ndarray) -> np.ndarray:
    """
    Return the degrees of freedom (groups,) of x (blocks, groups) by the scatter of neighbours.

    At most w, those of normal noise; fewer where groups rise and fall together, too.

    """
    def seen(z):
        rough = np.mean(np.diff(np.log(np.maximum(z, 1e-300)), axis=0) ** 2, axis=0)
        return 4 / np.maximum(rough, 1e-12)

    if w.ndim > 1:      # each block tells as much as it does: some tell nothing
        told = w[:, 0] > 0
        z, own = np.log(x[told, 0]), 2 / w[told, 0]
        return w * min(1.0, 1 / max(float(np.mean(np.diff(z)**2 / (own[1:] + own[:-1]))), 1e-12))
    w = np.minimum(w, seen(x))
    return w * min(1.0, seen(x @ w / w.sum()) / w.sum())
