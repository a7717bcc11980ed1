# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Ways to look at a record beside its model.

Under a true model pulls are standard normal, and a deviance is zero.

Each view returns a :class:`~imu_noise_tools.loop.effect.View`. ``frequency`` needs a fit; ``time``
predicts half of the block means from the other half; ``variance``, ``distribution`` and
``coherence`` compare the samples with what the model says of their stationarity, shape and
independence. Here are those of the samples, the power in time that ``variance`` rests on, and what
views have in common; ``frequency`` and ``coherence`` are in
:mod:`~imu_noise_tools.noise.in_frequency`, ``time`` in :mod:`~imu_noise_tools.noise.block_means`.

"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import ndtr, ndtri

from .blocks import degrees, FEWER, FIRST, leaked, SKEW, taper
from .evidence import claimed_lines, Evidence
from .kinds import Defect, Mean, model_tails, Modulation, NoiseEffect, Spectrum
from ..core.statistics import gamma_excess, gamma_pull
from ..loop.effect import Fit, Model, registry, View
from ..loop.verdict import tail

TIME_BLOCKS = 256   # block means of a record at most
_PART = 0.1  # of its power, from which the mean or a peak is seen there
_BESIDE = 4  # blocks on either side that tell the power of one


def view_of(name: str, x: np.ndarray, pull: np.ndarray, excess: np.ndarray,
            variance: np.ndarray, unit: str, extra: float = 0.0) -> View:
    """
    Return the view of some bins (k,) at x, in a unit, with their pulls.

    Of the excess deviance of each and its variance, by chance; ``extra`` is that of their sum.

    """
    count = max(len(excess), 1)
    return View(name, np.asarray(x), np.asarray(pull), float(np.sum(excess)) / count,
                float(np.sqrt(np.sum(variance) + extra)) / count, unit)


def nothing(name: str, unit: str) -> View:
    """Return a view that can say nothing of this record and model."""
    return View(name, np.zeros(0), np.zeros(0), float('nan'), float('nan'), unit)


def hidden_by(evidence: Evidence, fit: Fit, view: str) -> bool:
    """
    Tell whether an effect that is there, and not in the model's name only, hides a view.

    A coarse grid does not hide the variance where the levels tell it.

    """
    if view == 'variance' and _hides_loudness(evidence, fit.model):
        return True
    if view == 'variance' and evidence.unrounded.size:
        return False
    return any(view in e.hides and is_there(fit, e) for e in fit.model.of(NoiseEffect))


def _hides_loudness(evidence: Evidence, model: Model) -> bool:
    return any(e.hides_loudness(evidence) for e in model.of(NoiseEffect))


def muted_by(fit: Fit, view: str) -> bool:
    """Tell whether an effect that is there mutes a view."""
    return any(view in e.muting() and is_there(fit, e) for e in fit.model.of(NoiseEffect))


def is_there(fit: Fit, effect: NoiseEffect) -> bool:
    """Tell whether an effect does something in a fit, and is not in the model's name only."""
    there = any(effect[k] > 0 for k in effect.amplitudes)
    if there and not isinstance(effect, Defect):  # fitted, and never quite zero
        mine = fit.details.each.get(effect.label) if fit.details else None
        there = mine is None or bool(np.max(mine / fit.details.v) > 0.01)
    return there


def unclaimed(evidence: Evidence, model: Model) -> np.ndarray:
    """Return the power (b,), of the whole record, of the lines that the model does not hold."""
    return np.sum(evidence.whole.lines[lines_left(evidence, model)], axis=0)


def lines_left(evidence: Evidence, model: Model) -> list[int]:
    """Return rows of the line table that the model does not hold, strongest first."""
    mine = claimed_lines(evidence, model)
    return [i for i in range(len(evidence.line_table)) if i not in mine]


def slow_mean(evidence: Evidence, model: Model) -> np.ndarray:
    """Return what the model's effects on the mean say of the slow means (s,)."""
    inputs = evidence.slow_inputs
    return sum((m.mean(inputs) for m in model.of(Mean)), np.zeros(len(inputs.t)))


def p_value(view: View) -> float:
    """
    Return the chance that a true model shows as much excess.

    By a scaled chi-squared of the same mean and scatter.

    """
    return tail(view.excess, view.std) if len(view.pull) else 1.0


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
    if _hides_loudness(evidence, model):
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


def distribution(evidence: Evidence, fit: Fit) -> View:
    """Return the whitened samples in equiprobable cells beside the normal distribution."""
    if hidden_by(evidence, fit, 'distribution'):
        return nothing('distribution', 'quantile')
    cells = evidence.cells_of(fit.model).astype(float)
    # cells narrower than a few steps of the output would show the converter's own unevenness
    sigma = np.sqrt(np.median(evidence.whole.power[-20:]) / (2 * evidence.dt))
    merge = int(
        np.clip(2 ** np.ceil(np.log2(max(50 * evidence.resolution / max(sigma, 1e-300), 1))), 1, 4)
    )
    cells = cells.reshape(-1, merge).sum(axis=1)
    total, k = cells.sum(), len(cells)
    share, fitted = cell_shares(evidence, fit.model, cells)
    pull = (cells - share * total) / np.sqrt(share * total * (1 - share))
    # mean and spread were taken from the samples: three degrees of freedom are gone
    excess = pull**2 - (k - 3 - fitted) / (k - 1)
    view = view_of(
        'distribution', (np.arange(k) + 0.5) / k, pull, excess, np.full(k, 2.0), 'quantile'
    )
    return replace(view, muted=muted_by(fit, 'distribution'))


def cell_shares(evidence: Evidence, model: Model, cells: np.ndarray) -> tuple[np.ndarray, int]:
    """
    Return (shares, fitted): what a model expects in each of the equiprobable cells (k,).

    More in the tails of a mix, and where a defect says that the samples have such; ``fitted`` is
    how many values were fitted to them besides their mean and spread.

    """
    k, tails = len(cells), model_tails(model, evidence)
    scale = np.ones(1)
    if model.of(Modulation):
        t, x, w = power_in_time(evidence, model)
        scale = np.sqrt(pooled(modulated(model, t, x, w), w))
        scale /= np.sqrt(np.mean(scale**2))
    if tails is not None:
        return tails.fitted(cells, scale)[0], int(np.isfinite(tails.degrees))
    inner = ndtri(np.arange(1, k) / k)
    below = np.mean(ndtr(inner[:, None] / scale), axis=1)
    return np.diff(np.concatenate([[0.0], below, [1.0]])), 0


def of_nats(name: str, t: np.ndarray, nats: np.ndarray, part: str, known: bool) -> View:
    """
    Return the view of a part of what samples say at times t (k,), s, for what a model has or not.

    ``nats`` (k,) of them, of which the first half is of the first half of the record; where it is
    ``known`` to the model nothing is left.

    """
    half = len(t) // 2
    here = {'first': slice(half), 'second': slice(half, None)}.get(part, slice(None))
    pull = np.sqrt(2 * nats[here]) * (not known)
    return View(name, t[here], pull, float(np.mean(pull**2)), float(np.sqrt(2 / len(pull))), 's')


def of_samples(evidence: Evidence, part: str, fit: Fit) -> list[View]:
    """Return the views of a part that defects have of their own (:meth:`Defect.held_out`)."""
    found = (cls.held_out(evidence, part, fit) for cls in registry('noise').values()
             if issubclass(cls, Defect))
    return [view for view in found if view is not None]
