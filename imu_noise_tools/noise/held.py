# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Lines that are held: what a sensor slower than its reader makes of a coherent line.

Each value is sent until the next is there, so the line comes late, by what the two clocks stand
apart: it has images at the multiples of the sensor's own rate, which are lines themselves.

"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np

from ..core.spectrum import folded

#: complex values, of size 1, at numbered samples (n,)
Wave: TypeAlias = Callable[[np.ndarray], np.ndarray]

PIECE = 1 << 18  # samples of a wave that are made at once
AROUND = 0.02   # of the sample rate in which the sensor's own is looked for
STEADY = 0.5    # share of what a steady clock has at its rate that one needs to have
SHARP = 0.01    # turns by which the times of new samples may be off
ORIGINS = (0, -1, 1, -2, 2)     # orders, of images that may be stronger than their line
LEFT = 0.5      # of an amplitude: what has less left was an image of a stronger line


def clock(same: np.ndarray, fraction: float) -> tuple[float, float] | None:
    """
    Return the rate (a sample) and phase (turns) of a sensor's own clock; None where it wanders.

    A sample is new where the phase is less than the rate: a pulse train, whose first harmonic is
    sin(pi r)/pi.

    Parameters
    ----------
    same : ndarray (n - 1,) of bool
        Whether a sample equals the one before.
    fraction : float
        Share that is held, nearly.

    """
    n, new = len(same) + 1, 1.0 - np.append(False, same)
    new -= np.mean(new)
    power = np.abs(np.fft.rfft(new)) ** 2
    centre, reach = int(folded(1 - fraction, 1.0) * n), max(int(AROUND * n), 2)
    low = max(1, centre - reach)
    near = (low + int(np.argmax(power[low:centre + reach + 1]))) / n
    rate = min((near, 1 - near), key=lambda x: abs(x - (1 - fraction)))
    for _ in range(3):      # between two frequencies: how far the second half is ahead
        first, second = (_size(half, _turning(rate, begin)) for half, begin in (
            (new[:n // 2], 0), (new[n // 2:], n // 2)))
        rate += float(np.angle(second * np.conj(first))) / (np.pi * n)
    whole = 0.5 * _size(new, _turning(rate))
    if abs(whole) < np.sqrt(STEADY) * np.sin(np.pi * rate) / np.pi:
        return None
    phase = float(np.angle(whole) / (2 * np.pi) + rate / 2)
    # what rounding makes equal blurs it, but never makes a sample new
    turns = (rate * (np.flatnonzero(~same) + 1) + phase + 0.5 * (1 - rate)) % 1
    low, high = np.min(turns), np.max(turns)
    return rate, (phase + 0.5 * (1 - low - high) * (high - low < rate + SHARP)) % 1


def images_of_lines(y: np.ndarray, lines: np.ndarray, own: Sequence[float],
                    dt: float) -> np.ndarray:
    """
    Return the images (n,) of lines in samples that are held.

    What a line is late by is whole samples where the reader's clock decided what was measured,
    and goes on evenly where the sensor's did: what comes nearer is taken.

    Parameters
    ----------
    y : ndarray (n,)
        Samples.
    lines : ndarray (l, 4)
        Of a line table, the strongest first.
    own : (float, float)
        Rate and phase of the sensor's clock (:func:`clock`).
    dt : float
        Interval, s.

    """
    rest, out = y - np.mean(y), np.zeros(len(y))
    for f, a, b, _ in lines.tolist():
        wave = _turning(f * dt)
        if abs(_size(rest, wave)) < LEFT * np.hypot(a, b):
            continue
        forms = [_late(f * dt, own, order) for order in (None, *ORIGINS)]
        size, form = max(((_size(rest, x), x) for x in forms), key=lambda z: abs(z[0]))
        share = sum(len(j) * _size(np.real(size * form(j)), wave, j[0])
                    for j in _pieces(len(y))) / len(y)
        for j in _pieces(len(y)):
            whole = np.real(size * form(j))
            rest[j] -= whole
            out[j] += whole - np.real(share * wave(j))
    return out


def _pieces(n: int) -> list[np.ndarray]:
    """Return the numbers 0 ... n - 1 in pieces: no wave of a day is held at once."""
    return [np.arange(k, min(k + PIECE, n)) for k in range(0, n, PIECE)]


def _turning(f: float, begin: int = 0) -> Wave:
    """Return the wave of f (a sample) of which the first sample asked for is a later one."""
    return lambda j: np.exp(2j * np.pi * f * (j + begin))


def _late(f: float, own: Sequence[float], order: int | None) -> Wave:
    """
    Return a wave of f (a sample) that is late by what two clocks stand apart.

    Of the wave whose image of an ``order`` that is, late by whole samples; None: late evenly, when
    all of them are one.

    """
    rate, phase = own

    def form(j):
        late = (j * rate + phase) % 1 / rate
        if order is None:
            return np.exp(2j * np.pi * f * (j - late))
        return np.exp(2j * np.pi * (f + order * rate) * (j - np.floor(late)))

    return form


def _size(y: np.ndarray, wave: Wave, begin: int = 0) -> complex:
    """Return the amplitude, and phase, of a wave of size 1 in samples (n,) from one on."""
    return complex(2 / len(y) * sum(
        np.sum(y[j] * np.conj(wave(j + begin))) for j in _pieces(len(y))))
