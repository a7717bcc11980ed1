# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What a loud band leaks far below itself through the two ends of a record.

The cosines go on as a mirror image beyond either end, and what swings has a kink there. Below a
ship's swell, a motor, or the counts of an angle, two numbers say nearly all of it: how each end
cut the swing off. They raise every coefficient alike, as more white noise would, and by as much
or as little as two numbers happen to be: no mean of theirs describes them, so they are measured
and taken out.

"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import uniform_filter1d

from ..core.spectrum import Bins, from_above, power
from ..core.statistics import in_a_row

MOST = 1 << 17  # coefficients that are looked at
AROUND = 17     # bins whose mean power is their level
LOWEST = 16     # a swing of fewer coefficients is no band
SHARE = 0.01    # of the level that leaks, from which it is looked for
ORDERS = 4      # of the course over frequency of what either end leaks
ROUNDS = 12
SURE = 12.0     # nats that an order has to gain
NEAR, PEAK = 5, 10.0    # bins in whose mean a peak stands so many times above the level
STILL = 0.1     # nats, by which what is left changes no more


def without_ends(c: np.ndarray, bins: Bins) -> np.ndarray:
    """
    Return cosine coefficients (n,) without what leaks into them from loud bands far above.

    The same array where nothing does. Bands that leak do so from an octave above and more.

    Parameters
    ----------
    c : ndarray (n,)
        Coefficients, coherent lines taken out.
    bins : Bins
        Of them.

    """
    level = np.maximum(uniform_filter1d(power(c, bins.dt, bins), AROUND, mode='nearest'), 1e-300)
    each = from_above(level, bins)
    share = each.sum(axis=1) / level
    heard = (share > SHARE) & (bins.first >= LOWEST)
    out = c
    for begin, end in in_a_row(heard)[::-1].tolist():
        loud = np.where(bins.f > 2 * bins.f[end - 1], each[begin], 0.0)
        if np.any(loud) and bins.last[end - 1] > 4 * LOWEST:
            out = _without(out, bins, end, loud, surely=bool(np.any(share[begin:end] > 1)))
    return out


def _without(c: np.ndarray, bins: Bins, end: int, loud: np.ndarray,
             surely: bool) -> np.ndarray:
    """
    Take out of c (n,) below the bin ``end`` what the bands leak that are ``loud`` (b,).

    A wave of frequency omega leaves (a + b (-1)^k) cos(theta/2)/(cos theta - cos omega) in
    coefficient k, theta = pi k/n; many of them that, of their middle, times a series in
    sin^2(theta/2).

    """
    top = min(int(bins.last[end - 1]), MOST)
    theta = np.pi * np.arange(1, top) / bins.n
    middle = 2 * np.pi * bins.dt * (loud @ bins.f) / loud.sum()
    far = np.sin(theta / 2) ** 2 / np.sin(middle / 2) ** 2
    wave = np.cos(theta / 2) / (1 - far)
    both = np.stack([wave, wave * np.resize([-1.0, 1.0], top - 1)], axis=1)
    out, bin_of = c, bins.index(np.arange(1, top))
    level, height = _level(c, bins, end)
    after = height
    for order in range(ORDERS):
        columns = np.hstack([both * far[:, None] ** i for i in range(order + 1)])
        # what has to leak does, though it may be little by chance: then it shows by its absence
        before, least = out, STILL if surely else SURE
        for _ in range(ROUNDS):     # the level is that beneath what leaks
            scale = np.sqrt(2 * bins.dt / level[bin_of])
            ends = np.linalg.lstsq(columns * scale[:, None], c[1:top] * scale, rcond=None)[0]
            left = c[1:top] - columns @ ends
            if 0.5 * np.sum(((out[1:top] - left) * scale) ** 2) < least:
                break
            out, least = np.concatenate([c[:1], left, c[top:]]), STILL
            level, after = _level(out, bins, end)
        if out is before:
            break
    return out if after < height else c     # among lines it may raise what it is to lower


def _level(c: np.ndarray, bins: Bins, end: int) -> tuple[np.ndarray, float]:
    """
    Return (a level (end,) of the bins below one, infinite where a peak stands; its mean, ln).

    A cubic over the logarithm of frequency, which counts alike all over.

    """
    seen, x = power(c, bins.dt, bins), np.log(bins.f[:end] / bins.f[0])
    each, weight = bins.log_level(seen)[:end], np.gradient(x)
    level = np.exp(np.polyval(np.polyfit(x, each, 3, w=np.sqrt(weight)), x))
    near = uniform_filter1d(seen, NEAR, mode='nearest')[:end]
    return np.where(near > PEAK * level, np.inf, level), float(np.average(each, weights=weight))
