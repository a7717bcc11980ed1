# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How loud noise was before it was rounded to a grid as coarse as itself.

The power of such samples moves with the mean's place between two levels, and hides what the noise
does. How many samples stand on which level tells the mean and the noise apart.

"""

from collections.abc import Mapping

import numpy as np
from scipy.special import ndtr

from ..core.statistics import grid_gain, robust_sigma, stretches

MOST_BLOCKS, LENGTH = 256, 256  # at most, and samples of one at least
SPANNED = 0.577  # steps of noise, after the rounding, that are half a step before it
QUIET_PARTS = 8  # of a record, in which noise may be less than in all of it
PIECES = 8  # of a block, over which its mean may move evenly
REACH = 8  # levels on either side of a block's middle one; what is beyond counts as there
LOW, HIGH = 0.05, 5.0  # steps between which the noise is looked for
ROUNDS = 40
PRIOR = 4.0  # degrees of freedom
CERTAIN, HALVED = 1e9, 12  # of them, where the noise is known; times that it is narrowed down
FEWEST = 24.0  # degrees of freedom of a block that tells something
TELLING = 0.5  # share of the blocks that must
STRETCH = 1 << 16  # samples looked at together: a day of them is not held twice
MANY = 1 << 20  # samples whose angle or colour is followed
REMEMBERED = 4  # blocks for which a band remembers how loud it was
GONE, FAINT, LEAST = 0.4, 0.02, 1e-6    # counts^2: its error is another; no colour; no turn
ORDERS, LAGS = 40, 65  # of polynomials, samples in which what a rounding adds has a colour
_LEVELS, _EDGES = np.arange(-REACH, REACH + 1), np.arange(-REACH, REACH) + 0.5  # about the middle
_TIME = (np.arange(PIECES) + 0.5) / PIECES - 0.5    # of pieces about the middle of a block


def coarse(step: float, sigma: float) -> bool:
    """Tell whether noise, a standard deviation after the rounding, spans less than half a step."""
    return bool(step > 0 and sigma < SPANNED * step)


def coarse_part(y: np.ndarray, step: float) -> np.ndarray:
    """Return the samples (k,) of the stretches of y (n,) whose grid is :func:`coarse`; or all."""
    parts = stretches(y)
    kept = [part for part in parts if coarse(step, robust_sigma(part))]
    return np.concatenate(kept) if 0 < len(kept) < len(parts) else y


def told_by_grid(kept: Mapping[str, np.ndarray], n: int) -> float:
    """Return what a grid says of n samples, nats, by its step and the noise beside it as kept."""
    told = float(kept.get('told', 1.0)) * n
    return grid_gain(told, float(kept['step']), float(kept['sigma'])) if kept else 0.0


def moved_by_rounding(step: float, sigma: float, blocks: np.ndarray) -> float:
    """
    Return by how much rounding moves means at most, from one place between levels to another.

    Noise of s before it leaves of a mean m an error of step/pi e^(-2 pi^2 s^2/step^2) sin(2 pi
    m/step), the first of its waves (Widrow and Kollar, Quantization Noise, 2008). Where the noise
    is the least it is the most.

    Parameters
    ----------
    step, sigma : float
        Of the grid; standard deviation of the fast part of the samples on it.
    blocks : ndarray (2, blocks)
        How loud the noise was in each (:func:`before_rounding`); may be empty, (2, 0).

    """
    if not coarse(step, sigma):
        return 0.0
    parts = (np.array_split(x, min(QUIET_PARTS, blocks.shape[1])) for x in blocks) \
        if blocks.size else ([], [])
    least = min((np.average(v, weights=w) for v, w in zip(*parts) if np.sum(w) > 0), default=1.0)
    before = max(least * (sigma**2 - step**2 / 12), 0.0)
    return float(2 * step / np.pi * np.exp(-2 * np.pi**2 * before / step**2))


def before_rounding(y: np.ndarray, step: float) -> np.ndarray:
    """
    Return the variance of normal noise in each block before it was rounded, and what tells it.

    Parameters
    ----------
    y : ndarray (n,)
        Samples on the grid.
    step : float
        Of the grid.

    Returns
    -------
    ndarray (2, blocks)
        Variances over their mean, and degrees of freedom of each; 1 and 0 where a block stands
        on too few levels. Empty, (2, 0), where most do.

    """
    counts = _counted(y, step)
    place = _likeliest(counts, np.log(0.4), 0.01)
    told = _information(counts, place)
    if not np.any(told >= FEWEST):
        return np.zeros((2, 0))
    # by the noise of the whole: by its own a block that happens to be loud would count for more,
    # and one that happens to stand on two levels, as quiet noise would, says less than it seems
    usual = float(np.median(place[told >= FEWEST, 2]))
    place = _likeliest(counts, usual, PRIOR)
    told = _information(counts, np.column_stack([place[:, :2], np.full(len(place), usual)]))
    some = told >= FEWEST
    if np.mean(some) < TELLING:
        return np.zeros((2, 0))
    variance = np.exp(2 * place[:, 2])
    level = np.average(variance[some], weights=told[some])
    return np.array([np.where(some, variance / level, 1.0),
                     np.where(some, told * _independent(y, step, len(y) // len(told)), 0.0)])


def _independent(y: np.ndarray, step: float, length: int) -> float:
    """
    Return what share of the samples say as much of their variance as all of them do.

    1/(1 + 2 sum r_k^2), r_k the autocorrelation of the levels about the mean of a block, so long
    (Bartlett, Journal of the Royal Statistical Society 8 suppl., 1946): what is loud in a band
    goes up and down for as long as the band is narrow, which the autocorrelation of squares, that
    swings through zero, says up to there.

    """
    block = y[:min(len(y), MANY) // length * length].reshape(-1, length) / step
    x = (block - block.mean(axis=1, keepdims=True)).ravel()
    most = min(REMEMBERED * length, len(x) // 4)
    r = np.fft.irfft(np.abs(np.fft.rfft(x, len(x) + 2 * most)) ** 2)[:2 * most + 1]
    square = (r[1:] / r[0] / (1 - np.arange(1, 2 * most + 1) / len(x))) ** 2
    # chance has as much of it at every lag, and a line, which is as loud all the time
    return 1 / (1 + 2 * max(float(np.sum(square[:most] - np.mean(square[most:]))), 0.0))


def noise_before(y: np.ndarray, step: float) -> np.ndarray:
    """
    Return how loud one normal noise was before it was rounded, and what tells it.

    Parameters
    ----------
    y : ndarray (n,)
        Samples on a coarse grid.
    step : float
        Of the grid.

    Returns
    -------
    ndarray (2,)
        Standard deviation, in steps, and degrees of freedom.

    """
    counts = _counted(y, step)
    place, _ = _of_one_noise(counts)
    return np.array([np.exp(place[0, 2]), np.sum(_information(counts, place))])


def added_by_rounding(y: np.ndarray, step: float, sigma: float) -> np.ndarray:
    """
    Return the autocovariance, from lag 0 on, of what rounding adds to normal noise.

    A twelfth of the squared step and white, where noise spans some of it. Of less noise, most
    samples stand on one level and few jump by all of a step, which passes little of the noise
    itself: by Hermite polynomials, of whose coefficients the first is what is passed and all
    others are added (Bussgang 1952; Price 1958). Noise that is coloured lends its colour to it.

    Parameters
    ----------
    y : ndarray (n,)
        Samples on the grid.
    step, sigma : float
        Of the grid, and the standard deviation of the fast part of the samples.

    """
    if not coarse(step, sigma):
        return np.array([step**2 / 12])
    place, variance = _of_one_noise(_counted(y, step))
    power = _powers(place)
    # by differences, in which a drift is little
    after = [_mean_square_after(y, k) for k in range(1, min(LAGS, len(y) // 2))]
    of, orders = np.linspace(-1, 1, 2001), np.arange(1, ORDERS + 1)
    covariance = np.maximum.accumulate(of[:, None] ** orders @ power)
    rho = np.interp(variance - 0.5 * np.array(after) / step**2, covariance, of)
    # what orders beyond those have is gone after one sample
    return step**2 * np.append(variance - power[0], rho[:, None] ** orders[1:] @ power[1:])


def colour_of_turns(turned: np.ndarray, mean: np.ndarray) -> np.ndarray:
    """
    Return the autocorrelation, from lag 0 on, of the error of an angle that is read in counts.

    Of an angle of any phase R(k) = sum_h cos(2 pi h k b) e^(-2 pi^2 h^2 D_k)/(2 pi^2 h^2), in
    counts, b the mean that one sample counts and D_k the variance of what k samples turn by beside
    that (the characteristic functions of Widrow and Kollar, Quantization Noise, 2008). It is white
    where D_1 is beyond a tenth. What is counted tells D_k: V_k = D_k + 2 (1/12 - R(k)).

    Parameters
    ----------
    turned : ndarray (k,)
        D of 1, 2, ... samples, in counts squared (:func:`turns_of_counts`).
    mean : ndarray (blocks,)
        b of each block, in counts.

    """
    every = np.arange(1, len(turned) + 1)
    out = 12 * np.array([_error(d, _waves(k * mean)) for k, d in zip(every, turned)])
    return np.append(1.0, out) if np.any(np.abs(out) > FAINT) else np.ones(1)


def turns_of_counts(y: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """
    Return D (k,), counts squared, after k samples, and b (blocks,) of :func:`colour_of_turns`.

    None of either where no angle is counted, or one that turns by next to nothing. y (n,) are
    rates that are whole counts, of a step.

    """
    count = np.rint((y[:MANY] - y[0]) / step)
    length = max(len(count) // MOST_BLOCKS, LENGTH)
    while length <= len(count):
        turned, mean = _turned_after(count[:len(count) // length * length].reshape(-1, length))
        if turned[-1] > GONE:
            # in twice the time no angle turns by more than twice as much: each rate was rounded
            # by itself
            counted = len(turned) > 1 and turned[1] <= 4 * turned[0]
            return (turned, mean) if counted else (np.zeros(0), np.zeros(0))
        length *= 4
    return np.zeros(0), np.zeros(0)     # its error is a swing, or none


def _turned_after(count: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return D (k,) of counts (blocks, n) after k samples, until it is GONE, and b (blocks,)."""
    mean = count.mean(axis=1)
    angle = np.cumsum(count - mean[:, None], axis=1)
    lags, turned = np.unique(np.rint(np.geomspace(1, count.shape[1] // 16, 64))), []
    for k in lags.astype(int):
        counted = float(np.mean((angle[:, k:] - angle[:, :-k]) ** 2))
        waves = _waves(k * mean)
        low, high = np.log(LEAST), np.log(max(counted, LEAST))
        for _ in range(ROUNDS):     # the counted grows with it
            middle = 0.5 * (low + high)
            less = np.exp(middle) + 2 * (1 / 12 - _error(np.exp(middle), waves)) < counted
            low, high = (middle, high) if less else (low, middle)
        turned.append(low)
        if low > np.log(GONE):
            break
    lags = lags[:len(turned)]
    # what so many samples turn by goes about with a power of their number
    return np.exp(np.interp(np.log(np.arange(1, int(lags[-1]) + 1)), np.log(lags), turned)), mean


def _waves(turn: np.ndarray) -> np.ndarray:
    """Return the means (h,) of cos 2 pi h x over turns x, in counts."""
    return np.mean(np.cos(2 * np.pi * np.arange(1, ORDERS + 1)[:, None] * turn), axis=1)


def _error(turned: float, waves: np.ndarray) -> float:
    """Return R, counts squared, after turns of a variance beside some that are known."""
    h2 = np.arange(1, ORDERS + 1) ** 2
    return float(np.sum(waves * np.exp(-2 * np.pi**2 * h2 * turned) / (2 * np.pi**2 * h2)))


def _mean_square_after(y: np.ndarray, k: int) -> float:
    """Return the mean square by which samples (n,) differ k later, a stretch at a time."""
    total = 0.0
    for begin in range(0, len(y) - k, STRETCH):
        some = y[begin:begin + STRETCH + k]
        total += float(np.sum((some[k:] - some[:-k]) ** 2))
    return total / (len(y) - k)


def _of_one_noise(counts: np.ndarray) -> tuple[np.ndarray, float]:
    """
    Return the places of blocks (blocks, 3), all of one noise, and the variance about their means.

    Of the noise that leads to the variance of the blocks: what single ones tell of it is the more
    certain the louder they happen to be.

    """
    def variance(share):
        return float(np.mean(share @ _LEVELS**2 - (share @ _LEVELS) ** 2))

    total = counts.sum(axis=1)
    there = variance(total / total.sum(axis=1, keepdims=True))
    low, high = np.log(LOW), 0.0
    for _ in range(HALVED):
        middle = 0.5 * (low + high)
        place = _likeliest(counts, middle, CERTAIN)
        share = _shares(place)[0]
        if variance(np.mean(share, axis=1)) > there:
            high = middle
        else:
            low = middle
    return place, variance(share)


def _powers(place: np.ndarray) -> np.ndarray:
    """Return the power (k,) of each Hermite polynomial in levels about places (blocks, 3)."""
    mean = place[:, :1] + place[:, 1:2] * _TIME
    u = np.clip((_EDGES - mean[..., None]) * np.exp(-place[:, 2])[:, None, None], -30, 30)
    # orthonormal ones times the density: He_(k+1) = u He_k - k He_(k-1)
    here, before = np.exp(-0.5 * u * u) / np.sqrt(2 * np.pi), np.zeros(u.shape)
    out = []
    for k in range(1, ORDERS + 1):
        out.append(np.mean(np.sum(here, axis=-1) ** 2) / k)
        here, before = (u * here - np.sqrt(k - 1) * before) / np.sqrt(k), here
    return np.array(out)


def _counted(y: np.ndarray, step: float) -> np.ndarray:
    """Return how many samples are on each level about a block's own, (blocks, pieces, levels)."""
    blocks = int(np.clip(len(y) // LENGTH, 4, MOST_BLOCKS))
    values, often = np.unique(y[:200_000], return_counts=True)
    level = np.rint((y - values[np.argmax(often)]) / step)
    piece = np.arange(len(y)) * (blocks * PIECES) // len(y)
    block = piece // PIECES
    own = np.rint(np.bincount(block, level) / np.bincount(block))
    level = np.clip(level - own[block], -REACH, REACH) + REACH
    levels = len(_LEVELS)
    counts = np.bincount(piece * levels + level.astype(int), minlength=blocks * PIECES * levels)
    return counts.reshape(blocks, PIECES, levels).astype(float)


def _shares(place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """
    Return the share of each level, (blocks, pieces, levels), and its derivatives, (3, ...).

    By mean, slope (over the block) and the logarithm of the noise, in steps: (blocks, 3).

    """
    mean, slope, noise = (v[:, None, None] for v in place.T)
    u = np.clip((_EDGES - mean - slope * _TIME[:, None]) * np.exp(-noise), -30, 30)
    density = np.exp(-0.5 * u * u) / np.sqrt(2 * np.pi)

    def cells(v, first, last):
        ends = (*v.shape[:2], 1)
        return np.diff(np.concatenate([np.full(ends, first), v, np.full(ends, last)], axis=2))

    # of what lies above the mean the upper tail, which does not round to 1
    upper = u[..., :-1] > 0
    share = cells(ndtr(u), 0.0, 1.0)
    tail = -cells(ndtr(-u), 1.0, 0.0)
    share[..., 1:-1] = np.where(upper, tail[..., 1:-1], share[..., 1:-1])
    share[..., -1] = tail[..., -1]
    by_mean = -cells(density, 0.0, 0.0) * np.exp(-noise)
    return np.maximum(share, 1e-200), np.array([
        by_mean, by_mean * _TIME[:, None], -cells(u * density, 0.0, 0.0)])


def _likeliest(counts: np.ndarray, usual: float, prior: float) -> np.ndarray:
    """
    Return mean, slope and logarithm of the noise of each block (blocks, 3), by scoring.

    That noise is as ``usual`` counts as much as ``prior`` degrees of freedom.

    """
    total = counts.sum(axis=1)
    mean = total @ _LEVELS / total.sum(axis=1)
    place = np.column_stack([mean, 0 * mean, np.full(len(mean), np.log(0.4))])
    damping = np.full(len(mean), 1e-3)
    share, slope = _shares(place)
    value = np.sum(counts * np.log(share), axis=(1, 2)) - prior * (place[:, 2] - usual) ** 2
    size = counts.sum(axis=2)[..., None]
    for _ in range(ROUNDS):
        score = np.einsum('bpl,kbpl->bk', counts / share, slope)
        score[:, 2] -= 2 * prior * (place[:, 2] - usual)
        known = np.einsum('kbpl,jbpl->bkj', slope * size / share, slope)
        known[:, 2, 2] += 2 * prior
        known = known + (damping[:, None] * (1 + np.einsum('bkk->bk', known)))[..., None] \
            * np.eye(3)
        move = np.clip(np.linalg.solve(known, score[..., None])[..., 0], -0.5, 0.5)
        tried = place + move
        tried[:, 2] = np.clip(tried[:, 2], np.log(LOW), np.log(HIGH))
        share_there, slope_there = _shares(tried)
        there = np.sum(counts * np.log(share_there), axis=(1, 2)) \
            - prior * (tried[:, 2] - usual) ** 2
        better = there >= value
        place, value = np.where(better[:, None], tried, place), np.where(better, there, value)
        share = np.where(better[:, None, None], share_there, share)
        slope = np.where(better[:, None, None], slope_there, slope)
        damping = np.clip(np.where(better, damping / 10, damping * 10), 1e-6, 1e6)
        if np.max(np.abs(move)) < 1e-4:
            break
    return place


def _information(counts: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Return the degrees of freedom (blocks,) that tell the variance, mean and slope unknown."""
    share, slope = _shares(place)
    size = counts.sum(axis=2)[..., None]
    known = np.einsum('kbpl,jbpl->bkj', slope * size / share, slope)
    known = known + 1e-9 * np.eye(3)
    # n samples that are not rounded have an information of 2 n about the logarithm
    return 0.5 / np.linalg.inv(known)[:, 2, 2]
