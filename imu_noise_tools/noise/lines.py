# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Coherent lines of one axis: what is asked of one, what has it as well, and what it does.

A line keeps its phase through the record, or from when it begins to when it ends, so that one
frequency and two amplitudes take its power away. What leaves power behind (a resonance, a motor
whose speed wanders, vibration that comes and goes) is no line, and stays in the spectrum.

"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.fft import irfft, rfft

from .passing import projected
from .smooth import reference_spectrum
from ..core.spectrum import Bins, cosine_transform, line_basis, line_coefficients
from ..core.statistics import row_medians

PIECE = 1 << 15  # of an array as long as the record: what is worked on at a time
HALO = 1 << 11  # of a piece at either end, where lines leak
NEAR = 32  # coefficients on either side from which a line is measured
CROWD = 12  # coefficients within which lines are neighbours
BELOW = 2.0  # the level of the search is so much below that at which a line is believed
POWERS = 3  # of a slow quantity that a mean may follow
SWING, ORDERS = 10.0, 3  # cycles in the record up to which what recurs is slow, and its orders
NO_LINES = np.zeros((0, 6))     # a line table
CELL = 1  # coefficients by which lines of one cause may be apart: half a cycle in the record
SHOWN = 4.0  # times its power that an axis may be foretold to have: its own may be opposite


def line_penalty(n: int, known: int = 0) -> float:
    """
    Return the gain (nats) of a line that noise exceeds once in a thousand records.

    exp(-g) for each of n/2 frequencies that are independent, times sqrt(pi g/3) for the search
    between them (Rice 1954), g near 20. Where higher ones are ``known`` less is asked of the next:
    so many times as often, one line in a thousand is none (Benjamini and Hochberg 1995).

    """
    return float(np.log(1000 * n / 2 * np.sqrt(np.pi * 20 / 3))) - float(np.log1p(known))


def crowding(f: np.ndarray, duration: float, dt: float) -> np.ndarray:
    """
    Return how many times as likely an unrelated line is near f (n,), Hz, as if even over f.

    Nothing tells whether they are even over f or over ln f, from 8/T, where lines begin, to
    Nyquist; either is taken to be as likely. Slow lines stand at multiples the more often.

    """
    lowest = 8 / duration
    return 0.5 + 0.25 / (dt * np.maximum(f, lowest) * -np.log(2 * dt * lowest))


def sure(z: float, n: int, known: int = 0) -> bool:
    """Tell whether a line of height z^2 stands out by itself, not in company alone."""
    return z * z > least_height(n, known)


def least_height(n: int, known: int = 0) -> float:
    """Return the height z^2 from which the search takes a line up."""
    return 2 * line_penalty(n, known) - BELOW


def strong_lines(z: np.ndarray) -> np.ndarray:
    """
    Return the narrow lines of a piece (k,): vibration, beside which a spike would not stand out.

    Power beyond forty medians is no noise, which reaches fifteen.

    """
    c = rfft(z - np.mean(z))
    groups = len(c) // 128
    if groups < 2:
        return np.zeros(len(z))
    power = np.abs(c) ** 2
    level = row_medians(power[:128 * groups].reshape(groups, 128))
    level = np.interp(np.arange(len(c)), 128 * np.arange(groups) + 63.5, level)
    line = power > 40 * level
    line[:128] = False  # what is slow its neighbours tell
    if not np.any(line):
        return np.zeros(len(z))
    return irfft(np.where(line, c, 0), len(z))


def without_strong_lines(y: np.ndarray) -> np.ndarray:
    """Return samples (n,) less the narrow lines of each piece."""
    out, n = np.empty(len(y)), len(y)
    for i in range(0, n, PIECE - 2 * HALO):
        first = max(0, min(i - HALO, n - PIECE))
        z = y[first:first + PIECE]
        end = min(i + PIECE - 2 * HALO, n)
        out[i:end] = (z - strong_lines(z))[i - first:end - first]
    return out


def also_in(frequency: np.ndarray, x: np.ndarray, dt: float, top: int,
            axis: np.ndarray | None = None) -> np.ndarray:
    """
    Tell which lines of an axis, Hz (l,), a slow quantity has too: it, its square or its cube.

    Where one stands is known, so that noise exceeds what is asked of each once in a thousand
    times; it must be the highest near by, or it is the skirt of another. But the quantity has
    cycles of its own, and images of them where it is read now and then: an axis that follows it as
    far as the line says must show what it is foretold at lower frequencies.

    Parameters
    ----------
    frequency : ndarray (l,)
        Of the lines, Hz.
    x : ndarray (s,)
        The quantity, as long as the axis.
    dt : float
        Its interval, s.
    top : int
        Coefficient up to which what follows the quantity is told from it.
    axis : ndarray (s,) or None
        The axis in the same means; None where x is the axis.

    """
    n, out = len(x), np.zeros(len(frequency), bool)
    able = np.flatnonzero(2 * n * dt * frequency < min(top, n // 4))
    if not len(able) or n < 200 or not np.ptp(x) > 0:
        return out
    seen = None if axis is None else cosine_transform(axis)
    u = x - np.mean(x)
    u = u / np.sqrt(np.mean(u * u))
    for power in range(1, POWERS + 1):
        c = cosine_transform(u**power)
        level = reference_spectrum(c, dt)
        for i in able:
            out[i] |= _is_in(float(frequency[i]), c, level, dt, seen)
    return out


def _is_in(frequency: float, c: np.ndarray, level: np.ndarray, dt: float,
           seen: np.ndarray | None) -> bool:
    """Tell whether coefficients c (n,) have a line, and an axis's own, ``seen``, as much of it."""
    n, offsets = len(c), np.arange(-2 * CROWD, 2 * CROWD + 1)
    middle = int(2 * n * dt * frequency)
    k = np.arange(max(1, middle - NEAR), min(n, middle + NEAR + 1))
    root = np.sqrt(2 * dt / level[k - 1])
    wave = line_basis((frequency + offsets / (4 * n * dt))[:, None], k, n, dt)
    energy, a, b = projected(root * wave, root * c[k])
    best, here = int(np.argmax(energy)), 2 * CROWD
    # chi-squared with two degrees of freedom, at as many places as there are cells near
    if abs(offsets[best]) > 2 * CELL or energy[best] <= 2 * np.log(1000 * POWERS * 2 * CELL):
        return False
    return seen is None or _shows(seen, c, level[middle - 1] / (2 * dt), middle,
                                  wave[here:here + 1], k, float(a[here]**2 + b[here]**2))


def _shows(seen: np.ndarray, c: np.ndarray, noise: float, middle: int, wave: np.ndarray,
           k: np.ndarray, size: float) -> bool:
    """
    Tell whether an axis shows what it is foretold by a line at a coefficient, octave by octave.

    Of the coefficients of the axis and of a quantity, whose line has the square ``size`` and
    beside it as much noise as it may have anywhere.

    """
    _, a, b = projected(wave, seen[k])
    gain = (a[0]**2 + b[0]**2) / size
    high = middle - CROWD // 2
    while high > 4:
        low = high // 2
        some = np.arange(low, high)
        # a quantity that is read late loses of the line more than of what is slower, up to f
        foretold = gain * (some / middle) ** 2 @ (c[some]**2 - noise)
        if foretold > SHOWN * np.sum(seen[some]**2):
            return False
        high = low
    return True


def of_a_swing(frequency: np.ndarray, y: np.ndarray, dt: float) -> np.ndarray:
    """
    Tell which lines of an axis, Hz (l,), are orders of one slow swing of its mean.

    A swing of a few cycles in the record that is no sine has orders that are fast enough to be
    lines; by themselves they would be a machine's. Of one that is a sine there is one line. One
    that jumps has more orders than the mean, which are lines in any case: of one family.

    Parameters
    ----------
    frequency : ndarray (l,)
        Of the lines, Hz.
    y : ndarray (s,)
        Slow means of the axis.
    dt : float
        Their interval, s.

    """
    out, cell = np.zeros(len(frequency), bool), CELL / (2 * len(y) * dt)
    for order in range(2, ORDERS + 1):
        first = frequency / order
        more = np.arange(ORDERS + 1, 2 * ORDERS + 1)[:, None, None] * first[:, None]
        mine = also_in(first, y, dt, int(2 * SWING)) & ~np.any(
            np.abs(frequency - more) < cell, axis=(0, 2))
        out |= mine
        out |= np.any(np.abs(frequency[:, None] - first[mine]) < cell, axis=1)
    return out


def waves(lines: np.ndarray, t: np.ndarray, dt: float, length: int = 1) -> np.ndarray:
    """
    Return the sum (n,) of lines in time, or in means of so many samples.

    Parameters
    ----------
    lines : ndarray (l, 6)
        Of a line table: frequency Hz, a, b of a cos + b sin, z, begin and end.
    t : ndarray (n,)
        The middle of each mean, s.
    dt : float
        Interval of the samples, s.
    length : int
        Samples in a mean.

    """
    out = np.zeros(len(t))
    first = t / dt - 0.5 * (length - 1)
    for frequency, a, b, _, begin, end in lines:
        angle = 2 * np.pi * frequency * t
        gain = np.sinc(frequency * dt * length) / np.sinc(frequency * dt)
        there = np.minimum(first + length, end) - np.maximum(first, begin)
        out += gain * np.clip(there / length, 0, 1) * (a * np.cos(angle) + b * np.sin(angle))
    return out


def in_coefficients(table: np.ndarray, n: int, first: int,
                    dt: float) -> Iterator[tuple[int, int, int, np.ndarray]]:
    """Yield (row, low, high, what it has in those) of n coefficients from a sample on."""
    for i, (frequency, a, b, z, *stretch) in enumerate(table):
        begin, end = np.clip(np.subtract(stretch, first), 0, n).astype(int)
        if begin == end:
            continue
        angle = 2 * np.pi * frequency * dt * first
        a, b = a * np.cos(angle) + b * np.sin(angle), b * np.cos(angle) - a * np.sin(angle)
        centre = int(2 * n * dt * frequency)
        reach = min(1 << 15, 64 + int(40 * z))  # beyond, it is a hundredth of the noise
        low, high = max(1, centre - reach), min(n, centre + reach)
        yield i, low, high, line_coefficients(
            frequency, a, b, np.arange(low, high), n, dt, begin, end)


def take_lines_out(c: np.ndarray, table: np.ndarray, begin: int, dt: float,
                   bins: Bins) -> np.ndarray:
    """
    Subtract the lines from the coefficients of a part that begins at a sample, in place.

    Return what each adds to the power of the bins (l, b).

    """
    out = np.zeros((len(table), len(bins.first)))
    for i, low, high, line in in_coefficients(table, len(c), begin, dt):
        added = 2 * dt * (c[low:high] ** 2 - (c[low:high] - line) ** 2)
        c[low:high] -= line
        i0, i1 = bins.index(low), bins.index(high - 1) + 1
        starts = np.maximum(bins.first[i0:i1] - low, 0)
        out[i, i0:i1] = np.add.reduceat(added, starts) / bins.count[i0:i1]
    return out
