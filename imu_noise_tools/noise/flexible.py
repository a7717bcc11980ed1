# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A rival without a name: how much better a free smooth form would do than a model.

In every comparison of named effects one takes part that is no effect: over ln f a broken line of
the level of the spectrum, in time a few slow cosines of the mean or of the variance. Where it
does much better, no name holds: the form is something else.

"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import chdtrc

from . import in_time
from .block_means import block_means, BlockMeans, root_of
from .course import spanned
from .evidence import Evidence
from .in_frequency import independent
from .knee import KNOTS, slow_cosines
from .likelihood import Likelihood
from ..core.spectrum import band_of, OCTAVE
from ..core.statistics import gamma_pull
from ..loop.effect import Finding, Fit

# nats that a smooth form gains, below which no broad effect can pass its penalty: none is tried
QUIET_GAIN = 4.0
# standard deviations of bins side by side, below which no narrow effect can: none is tried
QUIET_PULL = 4.0
# how many cosines of the mean are tried, the slowest first: a few may tell a misfit more surely
FIRST = 2, 4, KNOTS
SLOWLY = 'time', 'the logarithm of time'  # of which cosines of the mean are slow


def smooth_gain(x: np.ndarray, w: np.ndarray, u: np.ndarray) -> float:
    """
    Return by how many nats a broken line in u betters x = measured/model power (b,).

    Each x is chi^2_w/w about its level; -ln L = 1/2 sum w (s + x e^-s), s the line's ln level, by
    Fisher scoring with step control.

    """
    if len(x) < 2 * KNOTS or not u[-1] > u[0]:
        return 0.0
    at = np.linspace(u[0], u[-1], KNOTS)
    basis = np.maximum(1 - np.abs(u[:, None] - at) / (at[1] - at[0]), 0)
    w = np.maximum(w, 1e-9)

    def cost(a):
        s = np.clip(basis @ a, -60, 60)
        return 0.5 * float(np.sum(w * (s + x * np.exp(-s))))

    # a start that no single bin far off can spoil
    a = np.zeros(KNOTS)
    for j in range(KNOTS):
        share = w * basis[:, j]
        a[j] = np.log(max(np.sum(share * x) / max(np.sum(share), 1e-300), 1e-12))
    first = cost(np.zeros(KNOTS))
    best = cost(a)
    if best > first:
        a, best = np.zeros(KNOTS), first
    information = 0.5 * (basis * w[:, None]).T @ basis + 1e-6 * np.eye(KNOTS)
    for _ in range(60):
        left = x * np.exp(-np.clip(basis @ a, -60, 60))
        step = np.linalg.solve(information, 0.5 * basis.T @ (w * (left - 1)))
        step = np.clip(step, -2, 2)
        scale = 1.0
        while scale > 1e-4 and cost(a + scale * step) > best:
            scale /= 2
        trial = cost(a + scale * step)
        if trial > best - 1e-4:
            break
        a, best = a + scale * step, trial
    return first - best


def spectrum_left(evidence: Evidence, fit: Fit) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (f, x, w): measured over model power in the bins, and what each counts."""
    view = Likelihood(evidence, 'whole', fit.model, fit)
    power = view.without_couplings(fit.model) if view.couplings else view.power
    v, _ = view.spectra(fit.model)
    return view.bins.f, power / v, independent(evidence, fit.model, view.weight)


def smooth_misfit(evidence: Evidence, fit: Fit) -> Finding:
    """
    Return the directed test of smooth misfit: the gain of the flexible form over the spectrum.

    The total over hundreds of bins is blind to a bend that each of them shows a little.

    """
    f, x, w = spectrum_left(evidence, fit)
    gain = smooth_gain(x, w, np.log(f))
    used = min(len(fit.details.slots) if fit.details else 0, KNOTS // 2)
    narrow = _in_a_band(f, x, w)
    where = f', too much power at {narrow}' if narrow else _where(f, x, w)
    return Finding('shape', gain, view='frequency',
                   p_value=float(chdtrc(KNOTS - used, 2 * max(gain, 0.0))),
                   evidence=f'a smooth form fits the spectrum better by {gain:.3g} nats{where}',
                   where=narrow)


def _in_a_band(f: np.ndarray, x: np.ndarray, w: np.ndarray) -> str:
    """
    Return the band in which nearly all power is that is too much, in words; else nothing.

    No wider than an octave. f (b,) in Hz; x (b,) is measured over model power, w what it counts.

    """
    low, high = band_of(w * np.maximum(x - 1, 0), f)
    ends = f'{low:.4g}', f'{high:.4g}'
    return f'{" to ".join(dict.fromkeys(ends))} Hz' if high <= OCTAVE * low else ''


def _where(f, x, w):
    parts = np.array_split(np.arange(len(f)), 12)
    pull = [np.sum(w[i] * (x[i] - 1)) / np.sqrt(2 * max(np.sum(w[i]), 1e-9)) for i in parts]
    k = int(np.argmax(np.abs(pull)))
    side = 'too little' if pull[k] < 0 else 'too much'
    return f', {side} power at {f[parts[k][0]]:.3g} to {f[parts[k][-1]]:.3g} Hz'


def asks_nothing(evidence: Evidence, fit: Fit) -> bool:
    """
    Tell whether neither a smooth form nor a few bins of the spectrum ask for more.

    One, two, four ... side by side: a peak that is wider than one stands out of them together.

    """
    f, x, w = spectrum_left(evidence, fit)
    some = w > 0
    x, w, width = x[some], w[some], 1
    if smooth_gain(x, w, np.log(f[some])) >= QUIET_GAIN:
        return False
    power, count = (np.concatenate([[0.0], np.cumsum(z)]) for z in (x * w, w))
    while width <= len(x) // KNOTS:
        total, size = power[width:] - power[:-width], count[width:] - count[:-width]
        if np.max(np.abs(gamma_pull(total / size, size))) >= QUIET_PULL:
            return False
        width *= 2
    return True


def slow_misfit(evidence: Evidence, fit: Fit) -> Finding:
    """
    Return the directed test of the mean in time: the gain of slow cosines over a model.

    Noise that wanders is no misfit: the means are weighed by the covariance of all that the model
    holds, of a random walk too. Were that known, twice the gain of the first k cosines would be
    chi^2_k; fitted to the same means it explains a part of them, and the gain is less. Of few
    cosines and of more, of time and of its logarithm, that counts which chance reaches least
    often, times how many are asked (Bonferroni).

    """
    gains = _gains_of_cosines(evidence, fit)
    chances = gains.size * chdtrc(np.array(FIRST, float), 2 * np.maximum(gains, 0.0))
    kind, few = np.unravel_index(np.argmin(chances), chances.shape)
    gain = float(gains[kind, few])
    return Finding('course', gain, view='time', p_value=min(float(chances[kind, few]), 1.0),
                   evidence=f'{FIRST[few]} slow cosines of {SLOWLY[kind]} fit the mean better by '
                            f'{gain:.3g} nats')


def mean_gain(evidence: Evidence, fit: Fit) -> tuple[float, bool]:
    """
    Return what slow cosines of the mean gain over a model, nats, given its red noise.

    Of time, or (True) of its logarithm from the record's begin on, whichever gain more: what sets
    in with the record, a creep, say, is steep there and flat later.

    """
    gains = _gains_of_cosines(evidence, fit)[:, -1]
    return float(np.max(gains)), bool(gains[1] > gains[0])


def _gains_of_cosines(evidence: Evidence, fit: Fit) -> np.ndarray:
    """Return what cosines of each kind of SLOWLY gain, so many as FIRST says, (2, 3), nats."""
    y, mean, free = beside_cosines(block_means(evidence, fit))
    before = squares_left(y, mean)
    return before - np.array([
        [squares_left(y, [*mean, *some[:k]]) for k in FIRST] for some in free])


def beside_cosines(means: BlockMeans) -> tuple[
        np.ndarray, list[np.ndarray], list[list[np.ndarray]]]:
    """Return means (k,), their columns, and slow cosines of each kind of SLOWLY, whitened."""
    count, own = len(means.y), means.columns.shape[1]
    u = (np.arange(count) + 0.5) / count
    slow = [slow_cosines(u, count, bool(kind)) for kind in range(len(SLOWLY))]
    y, *columns = np.linalg.solve(root_of(means.covariance), np.column_stack(
        [means.y, means.columns, *slow])).T
    return y, columns[:own], [columns[k:k + KNOTS] for k in range(own, len(columns), KNOTS)]


def unexplained(means: BlockMeans, columns: np.ndarray) -> float:
    """Return half the squares that columns (k, p) leave of block means, by their covariance."""
    y, *columns = np.linalg.solve(root_of(means.covariance),
                                  np.column_stack([means.y, columns])).T
    return squares_left(y, columns)


def squares_left(y: np.ndarray, columns: Sequence[np.ndarray]) -> float:
    """Return half the squares that columns (k,) leave of y (k,)."""
    u = spanned(np.column_stack(columns))
    return 0.5 * float(np.sum((y - u @ (u.T @ y)) ** 2))


def variance_gain(evidence: Evidence, fit: Fit) -> float:
    """Return what a smooth level in time gains over a model's modulation, nats."""
    t, x, w = in_time.power_in_time(evidence, fit.model)
    x = x / in_time.modulated(fit.model, t, x, w)
    w = in_time.rough_degrees(x, w)
    return smooth_gain(in_time.pooled(x, w), np.full(len(t), in_time.degrees_of(w)), t)
