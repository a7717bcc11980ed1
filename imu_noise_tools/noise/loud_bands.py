# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bands that stand high above what is around them, as they are measured; which a machine makes."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import median_filter
from scipy.special import chdtri

from .fading import stays
from ..core.bell import LEAST
from ..core.spectrum import band_of, Bins, leaked_beside, OCTAVE
from ..core.statistics import in_a_row

if TYPE_CHECKING:       # evidence asks for them
    from .evidence import Part
    from .kinds import Spectrum

STEP = 0.05  # of ln f: steps in which it is looked for what stands out of a spectrum
AROUND = 35  # such steps, over which the median is what is around it
HIGH = 10.0     # times the power around it that a band has somewhere (a choice: 10 dB)
CLEAR = 1.0     # standard errors above what is around it, to where it ends
RARE = 1e-3     # in how many records of nothing it may gain as much
MANY = 4        # that are looked for
FEWEST = 8      # coefficients that hold nearly all of its power: in fewer it may be lines
NOTHING = 1e-9  # of its level, where a band that is measured is nothing
LAST = 0.01     # of the spectrum's end: what stands for what is above a band that ends there
MIDDLE = 0.16, 0.5, 0.84    # shares of the power below: a deviation on either side of the middle


def bands(part: Part) -> list[tuple[float, float]]:
    """
    Return where (low, high), Hz, each of the bands is that stand out most, best first.

    Parameters
    ----------
    part : Part
        The spectrum of a whole record.

    """
    bins, power, top = part.bins, part.power, 0.5 / part.dt
    f = top * np.exp(-STEP * np.arange(np.log(top * part.n * part.dt / 8) / STEP)[::-1])
    if len(f) < AROUND:
        return []
    high = _over(bins, power, f) > np.log(HIGH)
    at = np.searchsorted(f, bins.f, side='right') - 1
    left = power - leaked_beside(power, bins, (at >= 0) & high[np.clip(at, 0, len(high) - 1)])
    count, level = bins.between(left, f)
    over = _over(bins, left, f)
    out = []
    for a, b in in_a_row(over > CLEAR * np.sqrt(2 / count)):
        low, end = float(f[a]), float(f[b])
        inside = (bins.f >= low) & (bins.f < end)
        # a step may lie between the middles of two bins
        if a == 0 or not np.any(inside) or np.max(over[a:b]) < np.log(HIGH) \
                or np.max(level[a:b]) < HIGH * np.max(_beside(bins, left, low, end)):
            continue
        own = seen(part, low, end) * bins.count
        first, last = band_of(own[inside], bins.f[inside])
        if last <= OCTAVE * first and last - first > FEWEST / (2 * part.n * part.dt):
            out.append((float(np.max(over[a:b])), low, end))
    return [(low, end) for _, low, end in sorted(out, reverse=True)[:MANY]]


def machines(part: Part, c: np.ndarray) -> np.ndarray:
    """
    Return (m, 4): low, high, middle and width, Hz, of the bands whose level stays as a machine's.

    A resonance's swings. The width is that of a bell (full, at half its height) that holds as much
    on either side of its middle. ``c`` (n,) are the cosine coefficients of the part, a whole
    record.

    """
    out, step = [], 2 * part.n * part.dt
    for low, high in bands(part):
        if not stays(c, round(low * step), round(high * step)):
            continue
        inside = (part.bins.f >= low) & (part.bins.f < high)
        total = np.cumsum((seen(part, low, high) * part.bins.count)[inside])
        at = np.interp(MIDDLE, total / total[-1], part.bins.f[inside])
        width = np.sqrt(2 * np.log(2)) * (at[2] - at[0])
        out.append((low, high, at[1], max(width, LEAST / (part.n * part.dt))))
    return np.array(out).reshape(-1, 4)


def seen(part: Part, low: float, high: float) -> np.ndarray:
    """Return the power (b,) of a band beyond what is around it, and what of it leaks beside it."""
    bins = part.bins
    inside = (bins.f >= low) & (bins.f < high)
    left = part.power - leaked_beside(part.power, bins, inside)
    beside = _beside(bins, left, low, high)
    if _ends_there(bins, high):     # what is there may be the band itself
        beside = np.minimum(beside, beside[0])
    around = np.exp(np.interp(np.log(bins.f), np.log([low, high]), np.log(beside)))
    own = np.where(inside, np.maximum(part.power - around, 0.0), 0.0)
    return own + leaked_beside(own, bins, inside)


def colour(effect: Spectrum, low: float, high: float, here: Part,
           whole: Part) -> Callable[[np.ndarray], np.ndarray]:
    """
    Return a band from low to high, Hz, as it is measured over an effect's own form, of Hz.

    Parameters
    ----------
    effect : Spectrum
        Its ``rms`` scales what is measured, all of it where it is that of the whole record.
    low, high : float
        Its ends, Hz.
    here, whole : Part
        The spectrum that is asked for, and that of the whole record.

    """
    power, total = (seen(p, low, high) for p in (here, whole))
    inside = (whole.bins.f >= low) & (whole.bins.f < high)
    rms2 = np.sum((total * whole.bins.count)[inside]) / (2 * whole.bins.n * whole.dt)
    even = effect.with_values(rms=np.sqrt(max(rms2, 1e-300)))
    step = 2 * here.n * here.dt
    return lambda f: power[np.clip(here.bins.index(np.round(f * step)), 0, len(power) - 1)] \
        / even.psd(f, here.dt)


def by_chance(bins: Bins, low: float, high: float) -> float:
    """Return what a free level in each of its bins gains by chance: half of chi-squared, nats."""
    free = np.sum((bins.f >= low) & (bins.f < high))
    return 0.5 * float(chdtri(max(free, 1), RARE))


def _beside(bins: Bins, power: np.ndarray, low: float, high: float) -> np.ndarray:
    """Return the level (2,) below a band and above it, or at its end where the spectrum ends."""
    ends = high, min(high * (1 + STEP), 0.5 / bins.dt)
    if _ends_there(bins, high):
        ends = high * (1 - LAST), high
    return np.array([bins.between(power, np.array(some))[1][0]
                     for some in ((low * (1 - STEP), low), ends)])


def _ends_there(bins: Bins, high: float) -> bool:
    """Tell whether nothing of the spectrum is above a band."""
    return high > (1 - LAST) * 0.5 / bins.dt


def _over(bins: Bins, power: np.ndarray, f: np.ndarray) -> np.ndarray:
    """Return by how much the power between frequencies (k,) is above that around it, (k - 1,)."""
    # Evidence.bumps asks this of steps that begin at the other end, and for summits of any height:
    # there the spectrum is taken to go on as it ends, here a band that ends with it is mirrored
    level = np.log(bins.between(power, f)[1])
    return level - median_filter(level, AROUND)
