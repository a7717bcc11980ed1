# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What axes hear of one source, beside what each of them makes itself.

A mount that shakes is heard by all axes, by each with a gain and a phase. An axis that is to tell
another's share in it brings noise of its own along, so two signals are derived of it: itself a
quarter of a period later, and what in it is not its own noise (Wiener's estimate of the source):
what stands above the spectrum that its own noise can have, or is coherent with other axes. They
are named by what is put behind the axis's name, and are there for axes that hear something
together, and for an accelerometer that moves far above its own noise.

"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import combinations
from typing import TypeAlias

import numpy as np
from scipy.fft import dct, idst
from scipy.ndimage import maximum_filter1d, median_filter
from scipy.special import chdtri, polygamma

from .ends import without_ends
from .line_search import without_lines
from ..core.linear import nonnegative
from ..core.record import AXES
from ..core.spectrum import Bins, bins_of

#: two axes, by their numbers, the lower first
Pair: TypeAlias = tuple[int, int]

# behind the name of an axis: itself a quarter of a period later, and what is not its own noise
LATER, SHAKEN = '^', '~'
HEARD = ('all', 'vibration')  # of an axis: as it was recorded, or what is not its own noise
LOOKED_AT = 1 << 19     # samples, from the first on, in which axes are compared at most
# groups of cosine coefficients at most, and coefficients in one at least
GROUPS, LEAST = 960, 16
CHANCE = 1e-3           # of records of independent noise, that seem to hear something together
# neighbouring groups that may tell a coherence, fewest first, and the standard errors from which
# they do: the widest are left what fewer did not tell, and ask for less (a choice)
WINDOWS = (1, 3, 5, 9, 19, 39, 79, 159, 319)
CLEAR = (8.0,) * 8 + (3.0,)
# coherence: an estimate above is taken for this, or its error would be none (a choice)
FULL = 0.9999
# chance of a step in a coherence where there is none; offsets of the grid, whose mean counts
STEP, SHIFTS = 1e-3, 16
# of the largest share: a share that is nowhere less is the same at all frequencies; and of what
# stands above an axis's own noise: where others hear no more, it is that axis alone (a choice)
ALIKE = 0.5
# of what stands above an axis's own noise: where others hear more of it, it is theirs too
PART = 0.25
# ridge that pulls the shares of axes to one common share: it decides where shares are so faint
# that which of them is the greater is chance, and is nothing where they are large
EVEN = 0.005
STEPS = 30              # iterations towards the shares of one source
# times an axis's own noise: what has more stands above it (a choice)
ABOVE = 2.0
# of an axis's own noise, to which its form is known (a choice): so little above it may be its own
KNOWN = 0.1
# times its own noise: what has more is not an axis's own though no other one hears it (a choice)
TALL = 100.0
# times the median of the bins from f/BESIDE to f BESIDE: a bin with more is a peak (a choice)
PEAK, BESIDE = 5.0, 3.0
# coefficients that tell a level to 20 %: a bin of fewer is told by its neighbours too
ENOUGH = 50
# bins in such a mean of neighbours, and in a median of them, fewest first
WIDTHS = (3, 5, 9, 19)
WIDE = (9, 19, 39, 79)
FLANKS = 39     # bins in a median that steps over a peak: its flanks are fewer than half
BETWEEN = 3     # bins, of which a straight drift is large in one at least
# of an axis's power: no larger share is taken off as heard, or its own noise would be lost
MOST = 0.95
TIMES = 64      # parts of a record, in each of which it is looked how loud it is
# medians of its neighbours that one coefficient in 400 reaches by chance: with more it is of a
# drift, or of a line and counts as this
OUT = 20.0


def derived(channel: str) -> bool:
    """Tell whether a channel is derived of an axis."""
    return channel[-1] in (LATER, SHAKEN)


def later(c: np.ndarray) -> np.ndarray:
    """
    Return cosine coefficients, (n,), of a signal a quarter of a period on (Hilbert's transform).

    For A cos(wt + p) these are of A sin(wt + p): the same coefficients, of sines. So what is slow
    and strong, a drift, reaches little of what is faster: a record repeated with its sign turned,
    which makes sines of it as well, jumps at its ends.

    """
    out = dct(idst(np.append(c[1:], 0.0), type=2, norm='ortho'), type=2, norm='ortho')
    out[0] = 0.0
    return out


def quarter_later(x: np.ndarray) -> np.ndarray:
    """Return samples (n,) or (n, k) a quarter of a period later, at every frequency."""
    from scipy.signal import hilbert  # half a second to load

    return np.imag(hilbert(x, axis=0))


def heard_together(columns: Mapping[str, np.ndarray], dt: float) -> dict[
        str, tuple[np.ndarray, np.ndarray]]:
    """
    Return (f, share), (g,) each, of the axes that are coherent with another, at any phase.

    ``columns`` are samples (n,) by the axes' names, ``share`` is what part of an axis's power at f
    (Hz) is of one source that others hear too, 0 where nothing says so.

    """
    n = min(LOOKED_AT, *(len(x) for x in columns.values())) if columns else 0
    if n < 4 * LEAST or len(columns) < 2:
        return {}
    edges = np.unique(np.maximum(np.geomspace(LEAST, n - 1, GROUPS), LEAST
                                 * np.arange(1, GROUPS + 1)).astype(int))
    edges = edges[edges < n - LEAST]
    # a line is no noise, and one of a machine is coherent in all axes
    bins = bins_of(n, dt)   # and what leaks from one loud band is coherent far below it
    c = [without_ends(without_lines(dct(x[:n] - np.mean(x[:n]), type=2, norm='ortho'), dt), bins)
         for x in columns.values()]
    q = [later(x) for x in c]
    count = np.diff(np.append(edges, n))
    # what is later of a drift may have more power than the drift
    level, other = ([np.maximum(np.add.reduceat(v * v, edges), 1e-300) for v in x] for x in (c, q))
    pulls = {(a, b): np.array([
        np.add.reduceat(c[a] * x[b], edges) * np.sqrt(count / (level[a] * power[b]))
        for x, power in ((c, level), (q, other))]) for a, b in combinations(range(len(c)), 2)}
    f = (edges + 0.5 * count) / (2 * n * dt)
    spread = _louder_together([x[:n] for x in columns.values()], dt, f)
    found = _one_source(_coherence(
        {pair: z / np.sqrt(spread[pair]) for pair, z in pulls.items()}, _sets(list(columns)),
        {pair: count / spread[pair] for pair in pulls}, np.array(level) / count))
    return {k: (f, found[i]) for i, k in enumerate(columns) if np.any(found[i] > 0)}


def _louder_together(columns: list[np.ndarray], dt: float,
                     f: np.ndarray) -> dict[Pair, np.ndarray]:
    """
    Return by how much more than that of steady noise what pairs share by chance varies, (g,) at f.

    Where axes are loud at the same times few of the samples say what they share: of independent
    noise of variances a(t), b(t) the square of it is that of steady noise times
    mean(a b) / (mean(a) mean(b)). Told of differences of block means, octave by octave.

    """
    x = np.array(columns)
    at: list[float] = []
    found: list[np.ndarray] = []
    while x.shape[1] >= 2 * TIMES * LEAST:
        two = x[:, :x.shape[1] // 2 * 2].reshape(len(x), -1, 2)
        change = (two[:, :, 1] - two[:, :, 0])[:, :two.shape[1] // TIMES * TIMES]
        loud = np.mean(change.reshape(len(x), TIMES, -1) ** 2, axis=2)
        loud /= np.maximum(np.mean(loud, axis=1, keepdims=True), 1e-300)
        at.append(1 / (3 * dt * 2 ** len(at)))
        found.append(loud @ loud.T / TIMES)
        x = np.mean(two, axis=2)
    if not at:
        return {pair: np.ones(len(f)) for pair in combinations(range(len(x)), 2)}
    return {(a, b): np.maximum(1.0, np.interp(-np.log(f), -np.log(at), [k[a, b] for k in found]))
            for a, b in combinations(range(len(x)), 2)}


def _sets(axes: list[str]) -> list[list[Pair]]:
    """Return what is looked at together: each pair of axes, and those of each sensor."""
    pairs = list(combinations(range(len(axes)), 2))
    of = [a.rpartition('_')[0] for a in axes]
    sensors = [[(a, b) for a, b in pairs if of[a] == of[b] == x] for x in sorted(set(of))]
    return [[pair] for pair in pairs] + [some for some in sensors if len(some) > 1]


def _coherence(pulls: Mapping[Pair, np.ndarray], sets: list[list[Pair]],
               count: Mapping[Pair, np.ndarray], power: np.ndarray) -> np.ndarray:
    """
    Return the coherence (axes, axes, g) of axes that hear something together, 0 of others.

    Of one phase in parts that are even; else, of any phase in each group, that of the fewest
    neighbouring groups that tell it.

    Parameters
    ----------
    pulls : dict of ndarray (2, g)
        What pairs of axes share in groups of coefficients, in phase and a quarter of a period
        later, in standard deviations of chance.
    sets : list of lists of pairs
        What is looked at together.
    count : dict of ndarray (g,)
        How many coefficients of steady noise tell as much as those in each group.
    power : ndarray (axes, g)
        Of each axis.

    """
    axes, groups = 1 + max(b for _, b in pulls), power.shape[1]
    both, stretches = np.zeros((axes, axes, groups)), list(_stretches(groups))
    level = CHANCE / (2 * len(sets) * sum(len(at) for _, at in stretches))
    square = {pair: np.sum(z * z, axis=0) - 2 for pair, z in pulls.items()}
    # what is told by the most groups is in many of them, not in one
    capped = {pair: np.minimum(x, 2 * CLEAR[0]) for pair, x in square.items()}
    for some in sets:
        told = [pulls[pair] for pair in some], np.array([count[pair] for pair in some])
        apart, alike = _together(*told, level, stretches)
        if np.any(alike):
            _put(both, some, alike, _in_steps(*told))
        for width, least in zip(WINDOWS, CLEAR) if np.any(apart) else ():
            beyond = square if width < WINDOWS[-1] else capped
            each, near, seen = np.array([
                _untold([beyond[pair], np.ones(groups), count[pair]], both[pair] > 0, width)
                for pair in some]).swapaxes(0, 1)
            clear = np.sum(each, axis=0) > least * 2 * np.sqrt(np.sum(near, axis=0))
            _put(both, some, apart & clear, each / np.maximum(seen - 2 * near, 1.0))
    for pair in pulls:
        _fill_slow_end(both, pair, count[pair], power)
    return both


def _untold(rows: Iterable[np.ndarray], told: np.ndarray, width: int) -> np.ndarray:
    """
    Return the sums (k, g) of rows in windows of so many groups (g,), less what was told before.

    The skirts of a band are not as coherent as the band, which fewer groups tell.

    """
    window = np.ones(min(width, len(told)))
    return np.array([np.convolve(np.where(told, 0.0, row), window, 'same') for row in rows])


def _fill_slow_end(both: np.ndarray, pair: Pair, count: np.ndarray, power: np.ndarray) -> None:
    """
    Take what a pair shares to go on to the slow end, where too few coefficients could tell.

    As a source with no more power there, for the axes' own drifts have ever more; and less of it
    where the axes have less.

    """
    a, b = pair
    told = np.flatnonzero(both[a, b])
    if not len(told):
        return
    first, near = told[0], told[:WINDOWS[1]]
    like = np.median(both[a, b][near])
    if np.sum(count[:first]) * like**2 < 2 * CLEAR[0]:
        level = np.sqrt(power[a] * power[b])
        ratio = np.median(level[near]) / level[:first]
        both[a, b, :first] = both[b, a, :first] = like * np.minimum(ratio, 1 / ratio)


def _put(both: np.ndarray, some: list[Pair], new: np.ndarray,
         squares: Iterable[np.ndarray]) -> None:
    """Put coherence squared, (g,) each, of some pairs into ``both`` where there is none yet."""
    for (a, b), square in zip(some, squares):
        at = new & (both[a, b] == 0)
        both[a, b, at] = both[b, a, at] = np.sqrt(np.clip(square, 0.0, 1.0))[at]


def _in_steps(pulls: list[np.ndarray], count: np.ndarray) -> np.ndarray:
    """
    Return the coherence squared (pairs, g) of what has one phase, or one that changes slowly.

    It is even but for steps that are clear, of all pairs at once, the mean of many places where
    the grid of them may begin (recursive dyadic partition: Donoho, Annals of Statistics 25, 1997;
    cycle spinning: Coifman and Donoho, Lecture Notes in Statistics 103, 1995). So a narrow band
    keeps its height, and what is faint over octaves is smooth. What is even is the less of it the
    nearer it is to chance (Wiener's estimate). A coherence near 1 is told the more exactly.

    """
    z, n = np.concatenate(pulls), np.repeat(count, 2, axis=0)
    k, groups = z.shape
    size, level = 2 << (groups - 1).bit_length(), chdtri(k, STEP)
    found = np.zeros(z.shape)
    for begin in np.linspace(0, size - groups, SHIFTS).astype(int):
        around = [(0, 0), (begin, size - groups - begin)]
        x, seen = np.pad(z * np.sqrt(n), around), np.pad(n, around)
        clear, parts = np.zeros(size, bool), []
        while True:
            mean = x / np.maximum(seen, 1e-300)
            beyond = 1 - k / np.maximum(np.sum(x * mean, axis=0), k)
            parts.append((mean * np.where(clear, 1.0, beyond), clear))
            if x.shape[1] == 1:
                break
            left, right = seen[:, ::2], seen[:, 1::2]
            x, both = x[:, ::2] + x[:, 1::2], np.maximum(left + right, 1e-300)
            apart = _apart(mean[:, ::2] - mean[:, 1::2], x / both, left * right / both, both)
            # where a half of it has a step, the whole has
            clear, seen = clear[::2] | clear[1::2] | (apart > level), left + right
        whole = parts[-1][0]
        for (half, _), (_, clear) in zip(parts[-2::-1], parts[:0:-1]):
            whole = np.where(np.repeat(clear, 2), half, np.repeat(whole, 2, axis=1))
        found += whole[:, begin:begin + groups] / SHIFTS
    return np.sum(found.reshape(-1, 2, groups) ** 2, axis=1)


def _apart(step: np.ndarray, mean: np.ndarray, weight: np.ndarray,
           count: np.ndarray) -> np.ndarray:
    """
    Return the squares of steps (2 pairs, g) of coherences, in what each scatters by, (g,).

    A coherence r scatters by 1 - r^2 of what chance does, its phase by the root of that (Bendat
    and Piersol, Random Data, 9.2). r is no more than is told of the mean (2 pairs, g) of so many
    coefficients: of few a large one is chance.

    """
    step, mean, weight, count = (v.reshape(-1, 2, v.shape[1]) for v in (step, mean, weight, count))
    r = np.minimum(np.sqrt(np.sum(mean**2, axis=1)), FULL)
    along = np.sum(step * mean, axis=1) ** 2 / np.maximum(np.sum(mean**2, axis=1), 1e-300)
    across = np.sum(step**2, axis=1) - along
    told = np.maximum(r - 2 * (1 - r * r) / np.sqrt(np.maximum(count[:, 0], 1.0)), 0.0)
    left = 1 - told * told
    return np.sum(weight[:, 0] * (along / left**2 + across / left), axis=0)


def _stretches(groups: int) -> Iterator[tuple[int, np.ndarray]]:
    """Yield (m, where they begin) of stretches of m groups, each width twice the one before."""
    m = 1
    while m <= groups:
        yield m, np.arange(0, groups - m + 1, max(1, m // 4))
        m *= 2


def _together(pulls: list[np.ndarray], count: np.ndarray, level: float,
              stretches) -> tuple[np.ndarray, np.ndarray]:
    """
    Return which groups (g,) lie in a stretch that noise makes as coherent at a ``level``.

    Of pairs of axes, pulls (2, g) each: by the sum of their squares, whatever the phase of what
    is heard is in each group, and by the square of their sum, where it is one.

    """
    def until(x):
        return np.cumsum(np.pad(x, [(0, 0)] * (x.ndim - 1) + [(1, 0)]), axis=-1)

    z, count = np.concatenate(pulls), np.repeat(count, 2, axis=0)
    square, total, seen = until(np.sum(z * z, axis=0)), until(z * np.sqrt(count)), until(count)
    out = np.zeros((2, count.shape[1]), bool)
    for m, at in stretches:
        apart = square[at + m] - square[at]
        alike = np.sum((total[:, at + m] - total[:, at]) ** 2
                       / (seen[:, at + m] - seen[:, at]), axis=0)
        for row, clear in zip(out, (apart > chdtri(len(z) * m, level),
                                    alike > chdtri(len(z), level))):
            for begin in at[clear]:
                row[begin:begin + m] = True
    return out[0], out[1]


def _one_source(both: np.ndarray) -> np.ndarray:
    """
    Return what share (axes, g) of each axis's power is of one source that all hear.

    The coherence ``both`` (axes, axes, g) of two axes is then the root of the product of their
    shares: of three or more axes the shares that come nearest to all pairs (one factor by least
    residuals, Harman and Jones, Psychometrika 31, 1966); two are taken for alike, and of faint
    shares which is the greater is hardly told.

    """
    alike = np.sqrt(np.max(both, axis=1))
    root = alike.copy()
    for _ in range(STEPS):
        for i in range(len(root)):
            others = np.delete(np.arange(len(root)), i)
            root[i] = np.clip((np.sum(both[i, others] * root[others], axis=0) + EVEN * alike[i])
                              / (np.sum(root[others] ** 2, axis=0) + EVEN), 0.0, 1.0)
    return root**2


def share(bins: Bins, power: np.ndarray,
          common: tuple[np.ndarray, np.ndarray] | None) -> np.ndarray | None:
    """
    Return what part, (b,), of the power in bins is not the axis's own noise.

    None where it is all its own, or alike everywhere. What stands above the spectrum that its own
    noise can have is not, nor is what others hear too, if they do: ``common``, (f, share), of
    :func:`heard_together`. Each of them says the least.

    """
    if common is None:
        return _above_own(bins, power)
    f, heard = common
    heard = _beside_drift(bins, power, np.interp(np.log(bins.f), np.log(f), heard))
    above = _above_own(bins, power, heard)
    if above is None:
        even = median_filter(heard, WIDE[0], mode='nearest')    # a few are where chance put them
        return heard if np.min(even) < ALIKE * np.max(even) else None
    return np.maximum(above, heard)


def _beside_drift(bins: Bins, power: np.ndarray, heard: np.ndarray) -> np.ndarray:
    """
    Return the share (b,) of the power that others hear, less where an axis drifts.

    There it is the share of its noise: how far it drifts says nothing of what others hear.

    """
    own = own_noise(bins, power, heard)[2]
    most = maximum_filter1d(power, BETWEEN)     # a straight one has every other coefficient
    drifts = np.cumprod(most > OUT * own, dtype=bool)
    return np.where(drifts, heard * own / np.maximum(own, most), heard)


def _above_own(bins: Bins, power: np.ndarray,
               heard: np.ndarray | None = None) -> np.ndarray | None:
    """
    Return what part, (b,), of the power is beyond the axis's own noise; None where none is.

    Its own noise is what fits the power less what others hear too. Only a tall peak is not its own
    unless others hear it together with the axis, ``heard`` (b,): a drift stands above noise, too.

    """
    level, seen, own = own_noise(bins, power, 0.0 if heard is None else heard)
    if heard is not None:
        own = _behind_filter(bins, level, seen, own, heard)
    there = level > TALL * own
    share = np.zeros(len(own))
    # of the fewest neighbours that tell it: a peak is narrow, its skirts are faint; a median of
    # many is no higher for a peak among them
    near, _ = _around(bins.log_level(power / own), bins.count, WIDE[0])
    for width in (w for w in WIDE if w <= len(own)):
        seen = np.convolve(bins.count, np.ones(width), 'same')
        ratio = np.exp(near if width == WIDE[0] else median_filter(near, width, mode='nearest'))
        if heard is not None:
            there |= (ratio > ABOVE) & (seen >= ENOUGH) & (heard > PART * (1 - 1 / ratio))
        told = (share == 0) & (ratio > 1 + np.maximum(2 * np.sqrt(2 / seen), KNOWN))
        share[told] = 1 - 1 / ratio[told]
    above = share > 0
    # by chance some bins far off are above it as well, where there is nothing to hear
    above = _with(above, there)
    return np.where(above, share, 0.0) if np.any(above) else None


def _behind_filter(bins: Bins, level: np.ndarray, seen: np.ndarray, own: np.ndarray,
                   heard: np.ndarray) -> np.ndarray:
    """
    Return an axis's own noise (b,) where a filter made it less somewhere, else as it is.

    Noise without a filter fits below what a notch leaves, and most of a filtered axis stands above
    that. Others hear no such thing: where they would and do not, in most of those bins and a
    quarter of all, the level (b,) less what is ``heard`` is the axis's own, and goes on through
    the band that they hear. Or what they hear came in behind the filter, and leaves less than the
    noise in a quarter of all. A tall peak that they do not hear says that this axis moves by
    itself.

    """
    told, ratio = seen >= ENOUGH, level / own
    stands = told & (ratio > ABOVE)
    alone = stands & (heard <= ALIKE * (1 - 1 / ratio))
    few = 0.25 * np.sum(told)
    lacks = told & ~stands & ((1 - np.minimum(heard, MOST)) * ratio < 1 / ABOVE)
    if np.sum(alone) <= max(0.5 * np.sum(stands), few) and np.sum(lacks) <= few:
        return own
    tall = ratio > TALL * max(1.0, float(np.median(ratio[told])))
    if any(_is_peak(bins.f, ratio, int(i)) for i in np.flatnonzero(
            tall & ~_with(tall, stands & ~alone))):
        return own
    beside = told & (alone | ~stands)
    more = np.log(np.maximum((1 - heard) * ratio, 1.0))[beside]
    more = np.interp(np.log(bins.f), np.log(bins.f[beside]), more)
    return own * np.exp(median_filter(more, FLANKS, mode='nearest'))


def _is_peak(f: np.ndarray, ratio: np.ndarray, i: int) -> bool:
    """Tell whether a bin stands out of those beside it: the slow side of a hollow does not."""
    near = slice(*np.searchsorted(f, (f[i] / BESIDE, f[i] * BESIDE)))
    return bool(ratio[i] > PEAK * np.median(ratio[near]))


def _with(some: np.ndarray, there: np.ndarray) -> np.ndarray:
    """Return those of some bins (b,) that lie in one stretch with one that is ``there``."""
    stretch = np.cumsum(np.diff(some, prepend=False))
    return some & np.isin(stretch, stretch[some & there])


def _around(x: np.ndarray, count: np.ndarray, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Return (means of x, coefficients in them), (b,) each, over so many bins of a count."""
    window = np.ones(width)
    seen = np.convolve(count, window, 'same')
    return np.convolve(count * x, window, 'same') / seen, seen


def own_noise(bins: Bins, power: np.ndarray, heard: np.ndarray | float = 0.0,
              ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """
    Return (level, coefficients that tell it, what of it is the axis's own noise), (b,) each.

    ``heard`` is the share that is known not to be; where it is most of it, it hides the noise.

    That is what white noise, flicker, a random walk and the rounding of an angle can make at most
    of the spectrum without overshooting it.

    """
    log = bins.log_level(power)
    each = bins.count**2 * polygamma(1, 0.5 * bins.count)
    level, seen, scatter = log.copy(), bins.count.astype(float), each / bins.count**2
    for width in WIDTHS:        # the fewest neighbours that tell a level
        few, (mean, count) = seen < ENOUGH, _around(log, bins.count, width)
        level[few] = mean[few]
        scatter[few] = (np.convolve(each, np.ones(width), 'same') / count**2)[few]
        seen[few] = count[few]
    level = np.exp(level)
    rest = 1 - np.minimum(heard, MOST)
    w = np.minimum(bins.count, ENOUGH) * rest**4
    basis = np.stack([np.ones(len(bins.f)), 1 / bins.f, 1 / bins.f**2,
                      np.sin(np.pi * bins.f * bins.dt) ** 2], axis=1)
    # relative to what is measured a peak counts once, however high, an overshoot without bound;
    # of levels that scatter the low ones count the more: E[1/x] / E[1/x^2] of lognormal ones
    middle = rest * level * np.exp(1.5 * np.minimum(scatter, 2 / ENOUGH))
    scaled = np.sqrt(w)[:, None] * basis / middle[:, None]
    return level, seen, basis @ nonnegative(scaled, np.sqrt(w))


def signals(axis: str, c: np.ndarray, dt: float, f: np.ndarray, above: np.ndarray | None,
            together: bool) -> Iterator[tuple[str, np.ndarray]]:
    """
    Yield (name, coefficients (n,)) of what is derived of an axis, one at a time.

    ``c`` (n,) are its coefficients, ``above`` at ``f`` (Hz) the share of its power that is not its
    own noise. What is later only of axes that hear something ``together``.

    """
    weight = None
    if above is not None:
        k = np.maximum(np.arange(len(c)), 1)
        weight = np.interp(np.log(k / (2 * len(c) * dt)), np.log(f), above)
        yield axis + SHAKEN, c * weight
    if not together:
        return
    # a ramp repeated with its sign turned is none a quarter of a period on: it bends
    ramp = dct(np.arange(len(c)) - 0.5 * (len(c) - 1), norm='ortho')
    c = later(c - (c @ ramp) / (ramp @ ramp) * ramp)
    yield axis + LATER, c
    if weight is not None:
        yield axis + SHAKEN + LATER, c * weight


def own_power(pair: Callable[[str, str], np.ndarray], channel: str) -> np.ndarray:
    """Return the power (b,) of its own noise that an axis adds to a channel, 0 where none does."""
    plain = channel.rstrip(LATER).removesuffix(SHAKEN)
    if plain not in AXES:
        return np.zeros(1)
    return np.maximum(pair(plain, plain) - pair(plain, plain + SHAKEN), 0.0)


def spread(pair: Callable[[str, str], np.ndarray], channel: str, bins: Bins) -> np.ndarray:
    """
    Return the power (b,) by which a derived channel misses its source, of a gain of 1.

    With the share w of its power P the estimate w x leaves w (1 - w) P of the source: that of the
    axis's own noise, which is smooth, so that bins of few coefficients are told by those beside;
    a line, which is not, counts there as no more than what noise may reach.

    """
    plain = channel.rstrip(LATER)
    if not plain.endswith(SHAKEN):
        return np.zeros(1)
    own = out = np.maximum(pair(plain[:-1], plain) - pair(plain, plain), 0.0)
    seen = bins.count.astype(float)
    for width in (w for w in WIDE if w <= len(own)):
        few, most = seen < ENOUGH, OUT * median_filter(own, width, mode='nearest')
        mean, count = _around(np.minimum(own, most), bins.count, width)
        out = np.where(few, mean, out)
        seen = np.where(few, count, seen)
    return out
