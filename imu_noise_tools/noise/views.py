# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Ways to look at a record beside its model.

Under a true model pulls are standard normal, and a deviance is zero.

Each view returns a :class:`~imu_noise_tools.loop.effect.View`. ``frequency`` needs a fit; ``time``
predicts half of the block means from the other half; ``variance``, ``distribution`` and
``coherence`` compare the samples with what the model says of their stationarity, shape and
independence.

"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from scipy.special import ndtr, ndtri

from .blocks import degrees, FEWER, FIRST, leaked, SKEW, taper
from .evidence import claimed_lines, Evidence
from .kinds import (
    Coupling,
    Defect,
    heard_by_all,
    Mean,
    model_crowd,
    model_psd,
    model_tails,
    Modulation,
    NoiseEffect,
    Spectrum,
)
from .likelihood import Likelihood
from .lines import waves
from ..core.spectrum import Bins, bins_of, expected
from ..core.statistics import gamma_excess, gamma_pull, means_of_blocks
from ..loop.effect import Fit, Model, registry, View
from ..loop.verdict import STRIKING, tail

TIME_BLOCKS = 256   # block means of a record at most
GROUP = 4  # block means to a bin of the time view
SEGMENTS = 8  # stretches of the record, predicted in turn from the others
TAKEN = 3.0  # coefficients that a line takes: frequency, amplitude and phase
# what is tried of a peak in one half: times the power that the other half, or the whole, gives it
LOUDER = np.append(0.0, np.geomspace(1e-3, 1e3, 121))
# times the power beside it: of a peak that has less in one half the whole record tells the form
UNFORESEEN = 10.0  # times what ln L as a parabola makes a draw cost: of usual noise up to 7
FAINT = 0.1
LEAKS = 0.01    # share of a bin's power, from which what axes share is what leaks from a band


def _view(name, x, pull, excess, variance, unit, extra=0.0):
    count = max(len(excess), 1)
    return View(name, np.asarray(x), np.asarray(pull), float(np.sum(excess)) / count,
                float(np.sqrt(np.sum(variance) + extra)) / count, unit)


def _nothing(name, unit):
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
    return any(view in e.hides and _there(fit, e) for e in fit.model.of(NoiseEffect))


def _hides_loudness(evidence: Evidence, model: Model) -> bool:
    return any(e.hides_loudness(evidence) for e in model.of(NoiseEffect))


def muted_by(fit: Fit, view: str) -> bool:
    """Tell whether an effect that is there mutes a view."""
    return any(view in e.muting() and _there(fit, e) for e in fit.model.of(NoiseEffect))


def _there(fit: Fit, effect) -> bool:
    there = any(effect[k] > 0 for k in effect.amplitudes)
    if there and not isinstance(effect, Defect):  # fitted, and never quite zero
        mine = fit.details.each.get(effect.label) if fit.details else None
        there = mine is None or bool(np.max(mine / fit.details.v) > 0.01)
    return there


def unclaimed(evidence: Evidence, model: Model) -> np.ndarray:
    """Return the power (b,), of the whole record, of the lines that the model does not hold."""
    return np.sum(evidence.whole.lines[lines_left(evidence, model)], axis=0)


def _unclaimed_lines(evidence: Evidence, part: str, model: Model,
                     v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """
    Return the power (b,) of lines that the model does not hold, and of others (l,) their own.

    Over the model's v (b,), in the few coefficients that a line takes: in a bin of thousands it
    would not show. So is what a line adds where it is taken out of a part that it is not in, if
    the model holds it; 1 of the rest.

    """
    here = evidence.part(part)
    rest = np.ones(len(here.lines), bool)
    rest[list(claimed_lines(evidence, model))] = False
    own = np.array([np.sum(x * here.bins.count / v) for x in here.lines]) / TAKEN
    stands = rest & (own > 1)
    in_bins = np.sum(here.lines[rest & ~stands], axis=0)
    return in_bins, np.where(stands, own, np.where(rest, 1.0, np.maximum(-own, 1.0)))


def frequency(
    evidence: Evidence, part: str, fit: Fit, mean: Fit | None = None, fitted_here: bool = False
) -> View:
    """
    Return the power in the bins of a part beside the model's.

    ``mean`` is the fit of the whole, for a half.

    """
    likelihood = Likelihood(evidence, part, fit.model, mean if mean is not None else fit)
    power, weight = likelihood.power, likelihood.weight
    if likelihood.couplings:
        power = likelihood.without_couplings(fit.model)
    v, each = likelihood.spectra(fit.model)
    asked = 0.0
    if not fitted_here:  # what is flat in the spectrum was as loud as it was in the other half
        v = v + np.min(v) * (_louder_than_in_the_other(evidence, fit.model, part) - 1)
        v, asked = _as_loud_as_here(likelihood, fit.model, mean, power, v, each)
    v = _around_lines(evidence.part(part).lines, power, v, weight)
    lines, own = _unclaimed_lines(evidence, part, fit.model, v)
    lines = lines * likelihood.bins.count / np.maximum(weight, 1)
    x = np.maximum(power + lines, 1e-300) / v
    # a bin whose one coefficient a line took with it says nothing more
    x = np.where((likelihood.weight > 0) | (lines != 0), x, 1.0)
    weight = independent(evidence, fit.model, weight)
    excess, variance = gamma_excess(x, weight)
    extra = 0.0 if fitted_here else parameter_scatter(evidence, part, fit, v, weight)
    taken = np.full(len(own), TAKEN)
    excess = np.append(excess, np.where(own > 1, gamma_excess(own, taken)[0], 0.0))
    excess[0] += asked
    pull = np.append(gamma_pull(x, weight), np.where(own > 1, gamma_pull(own, taken), 0.0))
    f = np.append(likelihood.bins.f, evidence.line_table[:, 0])
    order = np.argsort(f, kind='stable')    # pictures shade what fails side by side
    view = _view('frequency', f[order], pull[order], excess, variance, 'Hz', extra)
    if not likelihood.couplings:
        return view
    # ln of what is measured is the data's alone, and of one coefficient it has no lower end: what
    # is coupled in moves that of the rest as far as chance brings the rest near zero
    rest = np.maximum(power + lines, 1e-300) / np.maximum(likelihood.power + lines, 1e-300)
    return replace(view, log_score=float(np.sum(excess) + weight @ np.where(
        likelihood.weight > 0, np.log(rest), 0.0)))


def _as_loud_as_here(likelihood: Likelihood, model: Model, whole: Fit | None, power: np.ndarray,
                     v: np.ndarray, each: Mapping[str, np.ndarray]) -> tuple[np.ndarray, float]:
    """
    Return the model's power (b,) with that of each peak as it is in a part, and what that takes.

    What makes a peak is switched on and off: where it is, and how wide, was told by the other
    half, or by the whole record where it was off in that; how strong, each half tells for itself.
    So it does where a peak is that wanders, if that explains more. A deviance of 1 is what each
    such value takes by chance.

    """
    asked, w = 0.0, likelihood.weight
    for e in (s for s in model.of(Spectrum) if s.uneven):
        own = each[e.label]
        rest = np.maximum(v - own, 1e-9 * v)
        known = whole.model[e.label] if whole is not None and e.label in whole.model else e
        if known is not e and np.max(own / rest) < FAINT:
            own = likelihood.spectrum(model.with_effect(known), e.label)
        tried = [(own, 1.0)]
        for other in cast(Spectrum, known).elsewhere():
            tried.append((likelihood.spectrum(model.with_effect(other), e.label), 3.0))
        best = np.inf
        for here, cost in tried:
            louder = rest + np.multiply.outer(LOUDER, here)
            deviance = np.log(louder) @ w + (1 / louder) @ (w * power) + cost
            k = int(np.argmin(deviance))
            if deviance[k] < best:
                best, v, takes = deviance[k], louder[k], cost
        asked += takes
    return v, asked


def _around_lines(lines, power, v, weight):
    """
    Return the model's power (b,), where lines are no more than what is measured around them.

    What too high a model has beyond that it would take from a line: to hold it would be worse than
    not to.

    """
    held = np.sum(lines, axis=0) > power
    if not np.any(held):
        return v
    window = np.ones(15)
    count = np.convolve(weight, window, 'same')
    near = np.convolve(weight * power / v, window, 'same') / np.maximum(count, 1)
    return np.where(held & (near < 1 - STRIKING * np.sqrt(2 / np.maximum(count, 1))), near * v, v)


def _louder_than_in_the_other(evidence: Evidence, model: Model, half: str) -> float:
    """Return the mean variance in a half over that in the other, by the model's modulation."""
    t = (np.arange(1024) + 0.5) * evidence.duration / 1024
    out = 1.0
    for m in model.of(Modulation):
        first, second = np.mean(m.variance(t).reshape(2, -1), axis=1)
        out *= first / second if half == 'first' else second / first
    return float(out)


def independent(evidence: Evidence, model: Model, weight: np.ndarray) -> np.ndarray:
    """
    Return what bins (b,) of so many coefficients count.

    Coefficients of noise whose variance changes are not independent of their neighbours.

    """
    return np.where(weight > 1, 1 + (weight - 1) / _unevenness(evidence, model), weight)


def _unevenness(evidence: Evidence, model: Model) -> float:
    """Return mean(F^2)/mean(F)^2 of what the model's modulation does to the variance, F >= 0."""
    t = (np.arange(1024) + 0.5) * evidence.duration / 1024
    out = 1.0
    for m in model.of(Modulation):
        f = m.variance(t)
        out *= float(np.mean(f**2) / np.mean(f) ** 2)
    return out


def parameter_scatter(
    evidence: Evidence, part: str, fit: Fit, v: np.ndarray, weight: np.ndarray, draws: int = 32
) -> float:
    """
    Return the mean square of the excess deviance from the uncertainty of fitted parameters.

    Parameters are drawn from the fit's own information (at most a factor e apart on a logarithmic
    scale, where the information says next to nothing); a truth of v' in place of v costs sum w
    (v'/v - ln(v'/v) - 1).

    Where ln L is no parabola, as in a deep stop band, a draw by it may be one that no data allow:
    it is taken back along its ray until it costs what the parabola says, its squared length.

    """
    if not fit.details or not fit.details.slots:
        return 0.0
    slots, information = fit.details.slots, fit.details.information
    likelihood = Likelihood(evidence, part, fit.model, fit)
    spectral = [j for j, (label, _) in enumerate(slots) if not isinstance(fit.model[label], Mean)]
    if not spectral:
        return 0.0
    scale = np.sqrt(np.maximum(np.diag(information), 1e-12))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    root = vectors / np.sqrt(np.maximum(values, 1e-4))
    rng = np.random.default_rng(0)
    x0 = np.array([s.to_search(fit.model[s.label][s.parameter.name]) for s in likelihood.slots])
    lower, upper = np.array([s.bounds for s in likelihood.slots]).T
    lower, upper = np.minimum(lower, x0), np.maximum(upper, x0)
    total = 0.0
    for _ in range(draws):
        z = rng.standard_normal(len(slots))
        drawn = np.clip(x0 + np.clip((root @ z) / scale, -1, 1)[spectral], lower, upper)
        r = likelihood.spectra(likelihood.with_search(drawn))[0] / v
        cost, foreseen = float(np.sum(weight * (r - np.log(r) - 1))), float(z @ z)
        total += (cost if cost <= UNFORESEEN * foreseen else foreseen) ** 2
    return total / draws


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


def slow_mean(evidence: Evidence, model: Model) -> np.ndarray:
    """Return what the model's effects on the mean say of the slow means (s,)."""
    inputs = evidence.slow_inputs
    return sum((m.mean(inputs) for m in model.of(Mean)), np.zeros(len(inputs.t)))


def followed(evidence: Evidence, fit: Fit) -> list[Spectrum]:
    """Return what is noise to the spectrum and has a path that the samples show."""
    return [s for s in fit.model.of(Spectrum)
            if s.path(evidence) is not None and _there(fit, s)]


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
    low = expected(psd, bins_of(n, dt))[: min(32, len(q))]
    s[0, : len(low)] = low
    missing = np.maximum(1 - gain2.sum(axis=0) * count / n * length, 0)
    rest = beyond(float(np.max(k)) / (2 * n * dt))
    rest = s[-1] if rest is None else rest
    v = (np.sum(s * gain2, axis=0) * count / n + missing * rest / length) / (2 * dt)
    j = np.arange(count) + 0.5
    basis = np.sqrt(2 / count) * np.cos(np.pi * np.outer(j, q) / count)
    return np.asarray((basis * v) @ basis.T)


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
    return replace(_view('time', means.t[b], z, excess, variance, 's'), log_score=log_score)


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
        return _nothing('variance', 's')
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
    view = _view('variance', np.repeat(t, x.shape[1]), gamma_pull(x, w).ravel(), excess.ravel(),
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
        return _nothing('distribution', 'quantile')
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
    view = _view(
        'distribution', (np.arange(k) + 0.5) / k, pull, excess, np.full(k, 2.0), 'quantile'
    )
    return replace(view, muted=muted_by(fit, 'distribution'))


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


def coherence(evidence: Evidence, fit: Fit, part: str = 'whole') -> View:
    """
    Return the coherence with each other axis and covariate.

    In groups of at least eight coefficients.

    """
    x, pulls, excess, spread = [], [], [], []
    crowd = model_crowd(fit.model)
    for channel in evidence.channels:
        f, r, w = cross_correlation(evidence, channel, fit, part)
        # what axes share beyond their spectrum is spread over all coefficients alike, one to all
        alike, pull = np.sqrt((crowd - 1) * w / np.sum(w)), r * np.sqrt(w)
        root = np.sqrt(1 + alike @ alike)   # (1 + a a^T)^(-1/2) = 1 - a a^T/(root (1 + root))
        pull = pull - alike * (alike @ pull) / (root * (1 + root))
        x.append(f)
        pulls.append(pull)
        excess.append(pull**2 - 1)
        spread.append(2 * (w - 1) / (w + 2))
    if not x:
        return _nothing('coherence', 'Hz')
    return _view('coherence', np.concatenate(x), np.concatenate(pulls), np.concatenate(excess),
                 np.concatenate(spread), 'Hz')


def cross_correlation(evidence: Evidence, channel: str, fit: Fit | None,
                      part: str = 'whole') -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """
    Return (f, r, w): correlation of DCT coefficients with another channel.

    In groups of bins, (g,). Less what a channel that is made of the axis itself is of it: the
    square of what leans to one side, or stands on two levels, goes with it at every frequency.

    """
    bins = evidence.part(part).bins
    own = np.maximum(evidence.part(part).power, 1e-300)
    other = np.maximum(evidence.common.pair(channel, channel, part), 1e-300)
    both = evidence.cross(channel, part)
    if fit is not None:
        if fit.model.of(Mean):
            known = Likelihood(evidence, part, fit.model, fit)
            own, both = known.power, known.slow.cross_less_known(channel)
        for e in fit.model.of(Coupling):
            for name, gain in e.gains(evidence):
                both = both - gain * evidence.coupled(name, channel, part)
    # at least eight coefficients to a group: one alone may be next to nothing by chance
    edges = np.unique(8 * np.round(np.geomspace(1, bins.n / 8, 60)))
    group = np.searchsorted(edges, bins.last)
    starts = np.flatnonzero(np.diff(np.concatenate([[-1], group])))
    w = bins.count.astype(float)
    if evidence.holds_itself(channel):
        its = np.sum(w * both / _running(other)) / np.sum(w * own / _running(other))
        other = np.maximum(other - 2 * its * both + its**2 * own, 1e-300)
        both = both - its * own
    level = np.sqrt(_running(own) * _running(other))
    if fit is not None:
        w = np.where(_heard_or_leaked(fit, bins), 0.0, w)

    def total(v):
        v = np.add.reduceat(v, starts)
        return v[asked]

    asked = np.add.reduceat(w, starts) > 0
    r = total(w * both / level) / np.sqrt(
        total(w * own / _running(own)) * total(w * other / _running(other))
    )
    return total(w * bins.f) / total(w), r, total(w)


def _heard_or_leaked(fit: Fit, bins: Bins) -> np.ndarray:
    """Tell in which bins (b,) other axes hear what the model has from outside, or its leakage."""
    out = np.zeros(len(bins.f), bool)
    for e, heard in heard_by_all(fit.model, bins.f):
        if fit.details is not None and len(fit.details.v) == len(bins.f):
            heard = heard | (fit.details.each[e.label] > LEAKS * fit.details.v)
        out |= heard
    return out


def _running(power):
    window = np.ones(15) / 15
    return np.exp(np.convolve(np.pad(np.log(power), 7, mode='edge'), window, mode='valid'))


def p_value(view: View) -> float:
    """
    Return the chance that a true model shows as much excess.

    By a scaled chi-squared of the same mean and scatter.

    """
    return tail(view.excess, view.std) if len(view.pull) else 1.0


def lines_left(evidence: Evidence, model: Model) -> list[int]:
    """Return rows of the line table that the model does not hold, strongest first."""
    mine = claimed_lines(evidence, model)
    return [i for i in range(len(evidence.line_table)) if i not in mine]
