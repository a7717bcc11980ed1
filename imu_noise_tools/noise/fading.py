# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How the level of a narrow band fades: as a machine's, as a resonance's, or as it is switched.

The spectrum cannot tell these. The amplitude a of a machine whose speed wanders stays: <a^4> is
<a^2>^2. That of a resonance that noise drives has Rayleigh's distribution: twice as much. What is
there for a share of the time has one over that share more of either.

"""

from __future__ import annotations

import numpy as np

REACH = 2   # widths on either side of the middle that are looked at
STEADY, SWITCHED = -2.0, 4.5    # what a Gaussian band passes once in a thousand (simulated)
SOME = 40   # independent amplitudes from which one that stays is told from one that swings
BESIDE = 4   # times as far as the level beside the band is read (a choice)
CUT = 0.1    # of its power in the outer quarters: a band is wider than what is looked at
MEDIAN = 0.4549     # of a squared normal number
STAYS, SWINGS, COMES, UNTOLD = 'stays', 'swings', 'comes', ''


def fading(c: np.ndarray, k: int, width: int) -> tuple[float, float]:
    """
    Return <a^4>/<a^2>^2 of a band less the noise below it, and of how many amplitudes; or zeros.

    The amplitude is that of the analytic signal that the coefficients of the band make (Rice 1944,
    section 3.7). How many of them are independent is told by the equivalent width of the band's
    spectrum (Bendat, Piersol, Random Data, section 8.3).

    Parameters
    ----------
    c : ndarray (n,)
        Cosine coefficients of the record (:func:`.cosine_transform`).
    k, width : int
        The middle of the band, and a width, coefficients, that holds most of it.

    """
    reach = REACH * width
    low, high = k - reach, k + reach
    if low < 1 or high >= len(c):
        return 0.0, 0.0
    band = c[low:high]
    beside = np.concatenate([c[max(1, k - BESIDE * reach):low], c[high:k + BESIDE * reach]])
    floor = float(np.median(beside ** 2)) / MEDIAN
    noise, edge = len(band) * floor, len(band) // 8
    power = float(band @ band) - noise
    outer = np.concatenate([band[:edge], band[len(band) - edge:]])
    if power <= 0 or outer @ outer - len(outer) * floor > CUT * power:
        return 0.0, 0.0
    size = 2 * len(band)
    padded = np.zeros(2 * size, complex)
    padded[:len(band)] = band * np.exp(0.5j * np.pi * np.arange(len(band)) / size)
    square = np.abs(np.fft.ifft(padded)[:size] * len(padded)) ** 2
    fourth = float(np.mean(square ** 2)) - 4 * power * noise - 2 * noise ** 2
    cells, whole = (band ** 2).reshape(-1, 2).sum(axis=1), power + noise
    count = 2 * whole ** 2 / float(np.sum(cells ** 2))
    return fourth / power ** 2, count * (power / whole) ** 4     # what is below it swings too


def of_humps(c: np.ndarray, dt: float, humps: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """
    Return :func:`fading` of humps (h, 3) as :func:`.find_peaks` has them, (h, 2).

    Not of those that a line (frequencies, Hz) lies on, which stays by itself.

    """
    out = np.zeros((len(humps), 2))
    for i, (f, half, _) in enumerate(humps.tolist()):
        if not np.any(np.abs(lines - f) < 2 * REACH * half):
            size = 2 * len(c) * dt
            out[i] = fading(c, round(f * size), round(2 * half * size))
    return out


def kind(ratio: float, count: float) -> str:
    """
    Return which of these a band is by :func:`fading`: ``stays``, ``swings``, ``comes``, or ''.

    A resonance's ratio is 2, less by 2/(n + 1) of n amplitudes, with a standard deviation of
    2/sqrt(n) at most: what is linear in the power cancels in the ratio.

    """
    if count <= 0:
        return UNTOLD
    off = (ratio - 2 * count / (count + 1)) * np.sqrt(count) / 2
    if off < STEADY:
        return STAYS
    if off > SWITCHED:
        return COMES
    return SWINGS if count > SOME and off > STEADY / 2 else UNTOLD


def in_words(ratio: float, count: float) -> str:
    """Say how the level of a band fades, '' where that is not told."""
    return {
        STAYS: 'its level stays as that of a machine does, more than that of a resonance would',
        SWINGS: 'its level swings as that of a resonance in noise does',
        COMES: f'its level comes and goes: it is there for some {100 / max(ratio, 1):.0f} to '
               f'{100 * min(2 / max(ratio, 1), 1):.0f} % of the time',
        UNTOLD: '',
    }[kind(ratio, count)]
