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

from .passing import projected
from ..core.spectrum import line_basis
from ..core.statistics import MEDIAN

REACH = 2   # widths on either side of the middle that are looked at
STEADY, SWITCHED = -2.0, 4.5    # what a Gaussian band passes once in a thousand (simulated)
EACH = 8    # independent amplitudes, of which a stretch has that many: within it a machine is on
MOST = 64   # such stretches
ONE = 1.25  # the ratio of one machine is below: of one alone it is 1, of two as loud 1.5
LONGEST = 2 ** 20   # coefficients: of a wider band it would take more room than all else does
SOME = 40   # independent amplitudes from which one that stays is told from one that swings
BESIDE = 4   # times as far as the level beside the band is read (a choice)
CUT = 0.1    # of its power in the outer quarters: a band is wider than what is looked at
RATES = np.geomspace(0.5, 40, 14)   # 1/T: how fast a line may fade
NARROW, WIDEST = 4, 64  # coefficients: of a line that fades
LIKELIER = 20.0     # nats, than one that stays (a choice: far beyond chance)
STAYS, SWINGS, COMES, UNTOLD = 'stays', 'swings', 'comes', ''
RUNS = 'its level stays as that of one machine does, while that runs'


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
    floor = _floor(c, low, high)
    band = c[low:high]
    noise, edge = len(band) * floor, len(band) // 8
    power = float(band @ band) - noise
    outer = np.concatenate([band[:edge], band[len(band) - edge:]])
    if power <= 0 or outer @ outer - len(outer) * floor > CUT * power:
        return 0.0, 0.0
    square, count = _amplitudes(band)
    fourth = float(np.mean(square ** 2)) - 4 * power * noise - 2 * noise ** 2
    whole = power + noise
    return fourth / power ** 2, count * (power / whole) ** 4     # what is below it swings too


def stays(c: np.ndarray, low: int, high: int) -> bool:
    """
    Tell whether the level of a loud band stays as one machine's, while that is on.

    As :func:`fading` tells it, <a^4> over <a^2>^2 of stretches of ``EACH`` amplitudes: a machine
    that is switched is on, or off, in nearly each of them. Of several side by side that beat it is
    2 less the sum of the squares of their shares of the power.

    Parameters
    ----------
    c : ndarray (n,)
        Cosine coefficients of the record.
    low, high : int
        The band [low, high), coefficients.

    """
    low, high = max(low, 1), min(high, len(c))
    if not 2 * EACH <= high - low <= LONGEST:
        return False
    band, floor = c[low:high], _floor(c, low, high)
    square, count = _amplitudes(band)
    stretches = int(np.clip(count // EACH, 1, MOST))
    each = np.array_split(square, stretches)
    noise, weight = len(band) * floor, np.array([len(x) for x in each])
    power = np.array([np.mean(x) for x in each]) - noise
    fourth = np.array([np.mean(x ** 2) for x in each]) - 4 * power * noise - 2 * noise ** 2
    ratio = float(weight @ fourth / (weight @ np.maximum(power, 0.0) ** 2))
    some = count / stretches
    return ratio < ONE and (ratio - 2 * some / (some + 1)) * np.sqrt(count) / 2 < STEADY


def _floor(c: np.ndarray, low: int, high: int) -> float:
    """Return the square of a coefficient of the noise beside a band [low, high)."""
    far = BESIDE * (high - low) // 2
    middle = (low + high) // 2
    beside = np.concatenate([c[max(1, middle - far):low], c[high:middle + far]])
    return float(np.median(beside ** 2)) / MEDIAN


def _amplitudes(band: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the squared amplitudes of a band in time, and how many of them are independent."""
    size = 2 * len(band)
    padded = np.zeros(2 * size, complex)
    padded[:len(band)] = band * np.exp(0.5j * np.pi * np.arange(len(band)) / size)
    square = np.abs(np.fft.ifft(padded)[:size] * len(padded)) ** 2
    cells = (band ** 2)[:len(band) // 2 * 2].reshape(-1, 2).sum(axis=1)
    return square, 2 * float(band @ band) ** 2 / float(np.sum(cells ** 2))


def decay(c: np.ndarray, dt: float, k: int, width: int) -> float:
    """
    Return in which time, s, a line fades by a factor e; below zero, in which it swells; 0: none.

    A swing that was begun before the record, or ends after it: a pendulum, a machine that runs
    down without changing its speed. It is likelier than a line that stays, and all of the band.

    ``c``, ``k`` and ``width`` are those of :func:`fading`, of a band as narrow as a record
    resolves.

    """
    n, reach = len(c), 4 * max(width, NARROW)
    some = np.arange(max(1, k - reach), min(n, k + reach))
    y = c[some]
    floor = float(np.median(y ** 2)) / MEDIAN
    rate, energy, still = _fastest(k, some, y, n, dt)
    left, chance = float(y @ y) - energy - len(y) * floor, 3 * floor * np.sqrt(2 * len(y))
    if energy - still < 2 * LIKELIER * floor or left > CUT * energy + chance:
        return 0.0
    return n * dt / rate


def _fastest(k: int, some: np.ndarray, y: np.ndarray, n: int,
             dt: float) -> tuple[float, float, float]:
    """
    Return the rate, 1/T, at which a line near k fades to explain most of y, its energy there.

    And the most of one that stays. ``some`` are the coefficients of y.

    """
    f, rate, energy, still = k / (2 * n * dt), 0.0, 0.0, 0.0
    step, rates = NARROW / (n * dt), np.concatenate([-RATES[::-1], [0.0], RATES])
    for turn in range(1, 5):
        at = f + step * np.linspace(-1, 1, 33)[:, None]
        for r in rates:
            found = projected(line_basis(at + 0.5j * r / (np.pi * n * dt), some, n, dt), y)[0]
            best = int(np.argmax(found))
            still = max(still, float(found[best])) if r == 0 else still
            if found[best] > energy:
                energy, rate, f = float(found[best]), float(r), float(at[best, 0])
        step, rates = step / 8, np.append(rate * np.linspace(0.7, 1.4, 15) ** (1 / turn), 0.0)
    return rate, energy, still


def of_humps(c: np.ndarray, dt: float, humps: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """
    Return :func:`fading` and :func:`decay` of humps (h, 3), :func:`.find_peaks` has them, (h, 3).

    Not of those that a line (frequencies, Hz) lies on, which stays by itself.

    """
    out = np.zeros((len(humps), 3))
    for i, (f, half, _) in enumerate(humps.tolist()):
        if not np.any(np.abs(lines - f) < 2 * REACH * half):
            size = 2 * len(c) * dt
            k, width = round(f * size), round(2 * half * size)
            out[i, :2] = fading(c, k, width)
            if width <= WIDEST:
                out[i, 2] = decay(c, dt, k, width)
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


def in_words(ratio: float, count: float, time: float) -> str:
    """Say how the level of a band fades, '' where that is not told."""
    if time:
        return (f'it is a line that {"fades" if time > 0 else "swells"} by a factor e in '
                f'{abs(time):.3g} s')
    return {
        STAYS: 'its level stays as that of a machine does, more than that of a resonance would',
        SWINGS: 'its level swings as that of a resonance in noise does',
        COMES: f'its level comes and goes: it is there for some {100 / max(ratio, 1):.0f} to '
               f'{100 * min(2 / max(ratio, 1), 1):.0f} % of the time',
        UNTOLD: '',
    }[kind(ratio, count)]
