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
SOME = 20   # independent amplitudes from which one that stays would be told
CUT = 0.1    # of its power in the outer quarters: a band is wider than what is looked at
STAYS, SWINGS, COMES, UNTOLD = 'stays', 'swings', 'comes', ''


def fading(c: np.ndarray, reference: np.ndarray, dt: float, k: int,
           width: int) -> tuple[float, float]:
    """
    Return <a^4>/<a^2>^2 of a band less the noise below it, and of how many amplitudes; or zeros.

    The amplitude is that of the analytic signal that the coefficients of the band make (Rice 1944,
    section 3.7). How many of them are independent is told by the equivalent width of the band's
    spectrum (Bendat, Piersol, Random Data, section 8.3).

    Parameters
    ----------
    c : ndarray (n,)
        Cosine coefficients of the record (:func:`.cosine_transform`).
    reference : ndarray (n - 1,)
        One-sided PSD of what is below the band, at each coefficient from the first on.
    dt : float
        Interval, s.
    k, width : int
        The middle of the band, and a width, coefficients, that holds most of it.

    """
    low, high = k - REACH * width, k + REACH * width
    if low < 1 or high >= len(c):
        return 0.0, 0.0
    band, floor = c[low:high], reference[low - 1:high - 1] / (2 * dt)
    noise = float(np.sum(floor))
    power = float(band @ band) - noise
    edge = len(band) // 8
    outer = np.sum((band ** 2 - floor)[:edge]) + np.sum((band ** 2 - floor)[len(band) - edge:])
    if power < noise or outer > CUT * power:
        return 0.0, 0.0
    size = 2 * len(band)
    padded = np.zeros(2 * size, complex)
    padded[:len(band)] = band * np.exp(0.5j * np.pi * np.arange(len(band)) / size)
    square = np.abs(np.fft.ifft(padded)[:size] * len(padded)) ** 2
    fourth = float(np.mean(square ** 2)) - 4 * power * noise - 2 * noise ** 2
    cells = (band ** 2 - floor).reshape(-1, 2).sum(axis=1)
    count = 2 * power ** 2 / float(np.sum(cells ** 2)) / (1 + noise / power) ** 4
    return fourth / power ** 2, count


def of_humps(c: np.ndarray, reference: np.ndarray, dt: float, humps: np.ndarray,
             lines: np.ndarray) -> np.ndarray:
    """
    Return :func:`fading` of humps (h, 3) as :func:`.find_peaks` has them, (h, 2).

    Not of those that a line (frequencies, Hz) lies on, which stays by itself.

    """
    out = np.zeros((len(humps), 2))
    for i, (f, half, _) in enumerate(humps.tolist()):
        if not np.any(np.abs(lines - f) < 2 * REACH * half):
            size = 2 * len(c) * dt
            out[i] = fading(c, reference, dt, round(f * size), round(2 * half * size))
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
    return SWINGS if count > SOME and off > 0.5 * STEADY else UNTOLD


def in_words(ratio: float, count: float) -> str:
    """Say how the level of a band fades, '' where that is not told."""
    return {
        STAYS: 'its level stays as that of a machine does, more than that of a resonance would',
        SWINGS: 'its level swings as that of a resonance in noise does',
        COMES: f'its level comes and goes: it is there for some {100 / max(ratio, 1):.0f} to '
               f'{100 * min(2 / max(ratio, 1), 1):.0f} % of the time',
        UNTOLD: '',
    }[kind(ratio, count)]
