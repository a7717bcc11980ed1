# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Lines that are held: what a sensor slower than its reader makes of a coherent line.

Each value is sent until the next is there, so the line comes late, by what the two clocks stand
apart: it has images at the multiples of the sensor's own rate, which are lines themselves.

"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..core.spectrum import folded

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
        first, second = (np.sum(x) for x in np.array_split(
            new * np.exp(-2j * np.pi * rate * np.arange(n)), 2))
        rate += float(np.angle(second * np.conj(first))) / (np.pi * n)
    whole = np.mean(new * np.exp(-2j * np.pi * rate * np.arange(n)))
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
    rate, phase = own
    n = len(y)
    j = np.arange(n)
    late = (j * rate + phase) % 1 / rate
    rest, out = y - np.mean(y), np.zeros(n)
    for f, a, b, _ in lines.tolist():
        wave = np.exp(2j * np.pi * f * dt * j)
        if abs(_size(rest, wave)) < LEFT * np.hypot(a, b):
            continue
        whole = max((_held(rest, wave, f * dt, late, rate, order)
                     for order in (None, *ORIGINS)), key=lambda x: x @ x)
        out += whole - np.real(_size(whole, wave) * wave)
        rest -= whole
    return out


def _held(y: np.ndarray, wave: np.ndarray, f: float, late: np.ndarray, rate: float,
          order: int | None) -> np.ndarray:
    """
    Return what of samples (n,) is a wave of f (a sample) that is so many samples late.

    Of the wave whose image of an ``order`` that is, late by whole samples; None: late evenly, when
    all of them are one.

    """
    if order is None:
        form = wave * np.exp(-2j * np.pi * f * late)
    else:
        turns = order * rate * np.arange(len(y))
        form = wave * np.exp(2j * np.pi * (turns - (f + order * rate) * np.floor(late)))
    return np.real(_size(y, form) * form)


def _size(y: np.ndarray, wave: np.ndarray) -> complex:
    """Return the amplitude, and phase, of a complex wave (n,) of size 1 in samples (n,)."""
    return complex(2 * np.mean(y * np.conj(wave)))
