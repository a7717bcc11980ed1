# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What axes hear of one source, beside what each of them makes itself.

A mount that shakes is heard by all axes, by each with a gain and a phase. An axis that is to tell
another's share in it brings noise of its own along, so two signals are derived of it: itself a
quarter of a period later, and what in it is not its own noise (Wiener's estimate of the source):
what stands above the spectrum that its own noise can have, or is coherent with other axes. They
are named by what is put behind the axis's name, and are there for axes that hear something
together.

"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import combinations

import numpy as np
from scipy.fft import dct, dst, idct
from scipy.optimize import nnls
from scipy.special import digamma

from ..core.spectrum import Bins

LATER, SHAKEN = '^', '~'
HEARD = ('all', 'vibration')  # of an axis: as it was recorded, or what is not its own noise
LOOKED_AT = 1 << 17     # samples in which axes are compared
GROUPS, LEAST = 60, 16  # of coefficients, and the least in one
SURE = 6.0              # standard errors from which two axes hear something together
TOGETHER, CLEAR = 5, 3.0    # neighbouring groups that tell a coherence, its standard errors
ALIKE = 0.5             # of the largest share: above it a share is the same at all frequencies
STEPS = 30              # towards the shares of one source
ABOVE = 2.0             # times its own noise from which an axis is called shaken
ENOUGH = 50             # coefficients that tell a level, from the fewest of so many bins
WIDTHS = (3, 5, 9)


def derived(channel: str) -> bool:
    """Tell whether a channel is derived of an axis."""
    return channel[-1] in (LATER, SHAKEN)


def later(c: np.ndarray) -> np.ndarray:
    """
    Return cosine coefficients, (n,), of a signal a quarter of a period on (Hilbert's transform).

    For A cos(wt + p) these are of A sin(wt + p): but for the record's ends, the sine coefficients
    with the sign turned.

    """
    out = np.zeros(len(c))
    out[1:] = -dst(idct(c, type=2, norm='ortho'), type=2, norm='ortho')[:-1]
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
    c = [dct(x[:n] - np.mean(x[:n]), type=2, norm='ortho') for x in columns.values()]
    q = [later(x) for x in c]
    count = np.diff(np.append(edges, n))
    level = [np.maximum(np.add.reduceat(x * x, edges), 1e-300) for x in c]
    sure, square = set(), np.zeros((len(c), len(c), len(edges)))
    for a, b in combinations(range(len(c)), 2):
        both = sum(np.add.reduceat(c[a] * x[b], edges) ** 2 for x in (c, q))
        square[a, b] = square[b, a] = both / (level[a] * level[b]) * count - 2
        # of so many groups from the slow end on, or of one alone
        m = np.arange(1, len(edges) + 1)
        together = np.cumsum(square[a, b]) / (2 * np.sqrt(m))
        if max(np.max(together), np.sqrt(np.max(square[a, b] + 2))) > SURE:
            sure |= {a, b}
    f = (edges + 0.5 * count) / (2 * n * dt)
    found = _one_source(square, count)
    return {k: (f, found[i]) for i, k in enumerate(columns) if i in sure}


def _one_source(square: np.ndarray, count: np.ndarray) -> np.ndarray:
    """
    Return what share (axes, g) of each axis's power is of one source that all hear.

    The coherence of two axes is then the root of the product of their shares: of three or more
    axes the shares that come nearest to all pairs (one factor by least residuals, Harman and
    Jones, Psychometrika 31, 1966); two are taken for alike.

    Parameters
    ----------
    square : ndarray (axes, axes, g)
        Coherence squared times ``count`` in groups of coefficients, its mean by chance, 2, taken
        off; 0 of an axis with itself.
    count : ndarray (g,)
        Coefficients in each group.

    """
    near = np.minimum(len(count), TOGETHER)
    window = np.ones(near)

    def around(x):
        return np.apply_along_axis(np.convolve, -1, x, window, 'same')

    total = around(square)
    groups = around(np.ones(len(count)))
    both = np.sqrt(np.clip(np.where(total > CLEAR * 2 * np.sqrt(groups), total, 0.0)
                           / around(count - 2.0), 0.0, 1.0))
    root = np.sqrt(np.max(both, axis=1))
    for _ in range(STEPS):
        for i in range(len(root)):
            others = np.delete(np.arange(len(root)), i)
            root[i] = np.clip(np.sum(both[i, others] * root[others], axis=0)
                              / np.maximum(np.sum(root[others] ** 2, axis=0), 1e-12), 0.0, 1.0)
    return root**2


def share(bins: Bins, power: np.ndarray,
          common: tuple[np.ndarray, np.ndarray]) -> np.ndarray | None:
    """
    Return what part, (b,), of the power in bins is not the axis's own noise.

    None where it is all its own, or alike everywhere. What stands above the spectrum that its own
    noise can have is not, nor is what others hear too: ``common``, (f, share), of
    :func:`heard_together`. Each of them says the least.

    """
    above = _above_own(bins, power)
    f, heard = common
    heard = np.interp(np.log(bins.f), np.log(f), heard)
    if above is None:
        return heard if np.min(heard) < ALIKE * np.max(heard) else None
    return np.maximum(above, heard)


def _above_own(bins: Bins, power: np.ndarray) -> np.ndarray | None:
    """
    Return what part, (b,), of the power is beyond the axis's own noise; None where none is.

    That is what white noise, flicker and a random walk can make at most of the spectrum without
    overshooting it.

    """
    # the mean of the logarithm of chi-squared over its degrees of freedom
    log = np.log(np.maximum(power, 1e-300)) - digamma(bins.count / 2) + np.log(bins.count / 2)
    level, seen = log.copy(), bins.count.astype(float)
    for width in WIDTHS:        # the fewest neighbours that tell a level
        window, few = np.ones(width), seen < ENOUGH
        count = np.convolve(bins.count, window, 'same')
        level[few] = (np.convolve(bins.count * log, window, 'same') / count)[few]
        seen[few] = count[few]
    level = np.exp(level)
    w = np.minimum(bins.count, ENOUGH).astype(float)
    basis = np.stack([np.ones(len(bins.f)), 1 / bins.f, 1 / bins.f**2], axis=1)
    # relative to what is measured a peak counts once, however high, an overshoot without bound
    scaled = np.sqrt(w)[:, None] * basis / level[:, None]
    scale = np.max(scaled, axis=0)
    own = basis @ (nnls(scaled / scale, np.sqrt(w))[0] / scale)
    if not np.any((level > ABOVE * own) & (seen >= ENOUGH)):
        return None
    heard = level > (1 + 2 * np.sqrt(2 / seen)) * own
    return np.where(heard, 1 - own / np.maximum(level, own), 0.0)


def signals(axis: str, c: np.ndarray, dt: float, f: np.ndarray,
            above: np.ndarray | None) -> Iterator[tuple[str, np.ndarray]]:
    """
    Yield (name, coefficients (n,)) of what is derived of an axis, one at a time.

    ``c`` (n,) are its coefficients, ``above`` at ``f`` (Hz) the share of its power that is not its
    own noise.

    """
    weight = None
    if above is not None:
        k = np.maximum(np.arange(len(c)), 1)
        weight = np.interp(np.log(k / (2 * len(c) * dt)), np.log(f), above)
        yield axis + SHAKEN, c * weight
    c = later(c)
    yield axis + LATER, c
    if weight is not None:
        yield axis + SHAKEN + LATER, c * weight


def spread(pair: Callable[[str, str], np.ndarray], channel: str) -> np.ndarray:
    """
    Return the power (b,) by which a derived channel misses its source, of a gain of 1.

    With the share w of its power P the estimate w x leaves w (1 - w) P of the source.

    """
    plain = channel.rstrip(LATER)
    if not plain.endswith(SHAKEN):
        return np.zeros(1)
    return np.maximum(pair(plain[:-1], plain) - pair(plain, plain), 0.0)
