# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What axes hear of one source, beside what each of them makes itself.

A mount that shakes is heard by all axes, by each with a gain and a phase. An axis that is to tell
another's share in it brings noise of its own along, so two signals are derived of it: itself a
quarter of a period later, and what in it stands above its own noise (Wiener's estimate of the
source). They are named by what is put behind the axis's name, and are there for axes that hear
something together.

"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np
from scipy.fft import dct, dst, idct
from scipy.optimize import nnls
from scipy.special import digamma

from ..core.spectrum import Bins

LATER, SHAKEN = '^', '~'
HEARD = ('all', 'vibration')  # of an axis: as it was recorded, or what is above its own noise
LOOKED_AT = 1 << 17     # samples in which axes are compared
GROUPS, LEAST = 60, 16  # of coefficients, and the least in one
SURE = 6.0              # standard errors from which two axes hear something together
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


def heard_together(columns: Mapping[str, np.ndarray]) -> set[str]:
    """Return the names of the axes, (n,) each, that are coherent with another, at any phase."""
    n = min(LOOKED_AT, *(len(x) for x in columns.values())) if columns else 0
    if n < 4 * LEAST:
        return set()
    edges = np.unique(np.maximum(np.geomspace(LEAST, n - 1, GROUPS), LEAST
                                 * np.arange(1, GROUPS + 1)).astype(int))
    edges = edges[edges < n - LEAST]
    c = {k: dct(x[:n] - np.mean(x[:n]), type=2, norm='ortho') for k, x in columns.items()}
    q = {k: later(x) for k, x in c.items()}
    count = np.diff(np.append(edges, n))

    def power(x, y):
        return np.add.reduceat(x * y, edges)

    level = {k: power(x, x) for k, x in c.items()}
    out = set()
    for a in c:
        for b in c:
            if a < b:
                scale = np.sqrt(count / np.maximum(level[a] * level[b], 1e-300))
                square = (power(c[a], c[b])**2 + power(c[a], q[b])**2) * scale**2
                # of so many groups from the slow end on, or of one alone
                m = np.arange(1, len(square) + 1)
                together = np.cumsum(square - 2) / (2 * np.sqrt(m))
                if max(np.max(together), np.sqrt(np.max(square))) > SURE:
                    out |= {a, b}
    return out


def share(bins: Bins, power: np.ndarray) -> np.ndarray | None:
    """
    Return what part, (b,), of the power in bins is not the axis's own noise; None where all is.

    Its own noise is what white noise, flicker and a random walk can make at most of the spectrum
    without overshooting it.

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
