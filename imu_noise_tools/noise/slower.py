# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A sensor with a clock of its own that is read faster: each value is sent until the next is there.

What is repeated says nothing more: such a record is looked at as the sensor measured, once each
and evenly. Its clock is read from what it repeats, and followed where it goes slower or faster; a
line that was measured when it was read, and not when the sensor's clock said, has images.

"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import cast, NamedTuple, TypeAlias

import numpy as np

from ..core.record import ImuRecord, Memory, sensor_of
from ..core.statistics import repeats, whole_runs

#: complex values, of size 1, at numbered samples (n,)
Wave: TypeAlias = Callable[[np.ndarray], np.ndarray]

PIECE = 1 << 18  # samples of a wave that are made at once
BEATS = (1024, 256)  # samples in which a beat is looked for
FEWEST = 0.02   # share of equal neighbours below which no beat is looked for
AROUND = 0.02   # of the sample rate in which the sensor's own is looked for
STEADY = 0.5    # share of what a steady clock has at its rate that one needs to have
HALF = 0.51     # of the reader's rate, up to which a value's own time tells how many there are
FOLLOWED = 256  # samples in which a clock is that is followed
LEAST, LOST = 0.7, 0.02     # of that, in a piece; share of the pieces in which it may be less
EVEN = 0.99     # of a clock that is followed, from which a steady one is as good
CHUNKS = 16     # of the record, in which new samples are held against the clock
RARE = 1e-3     # share of them that may be off
ONE = 0.5       # share of what two clocks show at once beyond chance, that are one
ORIGINS = (0, -1, 1, -2, 2)     # orders, of images that may be stronger than their line
LEFT = 0.5      # of an amplitude: what has less left was an image of a stronger line


def shown_first(same: np.ndarray, chance: float = 0.0) -> np.ndarray | None:
    """
    Return the samples (k,) that show each value of a slower sensor first; None: of no clock.

    Parameters
    ----------
    same : ndarray (n - 1,) of bool
        Whether a sample equals the one before.
    chance : float
        Share of two values that are equal by rounding.

    """
    seen = float(np.mean(same)) if len(same) > 64 else 0.0
    share = (seen - chance) / (1 - chance)
    if not FEWEST < share < 1 or not (_as_long(same, seen, chance) or _beats(same, share)):
        return None
    if 1 - share <= HALF:
        return _by_runs(same, 1 / (1 - share))
    return _by_a_clock(same, share)


def _by_runs(same: np.ndarray, length: float) -> np.ndarray:
    """Return what :func:`shown_first` does of values held for ``length`` or one more or less."""
    begins = np.append(0, np.flatnonzero(~same) + 1)
    runs = np.diff(begins, append=len(same) + 1)
    # two that are equal are held for twice as long
    count = np.where(runs < length + 1, 1, np.maximum(np.round(runs / length), 1)).astype(int)
    nth = np.arange(np.sum(count)) - np.repeat(np.cumsum(count) - count, count)
    return np.repeat(begins, count) + (nth * np.repeat(runs / count, count)).astype(int)


def _as_long(same: np.ndarray, seen: float, chance: float) -> bool:
    """Tell whether all are held as long: one length, or two that are neighbours."""
    runs = whole_runs(same)
    if len(runs) <= 10:
        return False
    counts = np.bincount(runs)
    shorter = int(np.argmax(counts[:-1] + counts[1:]))
    by_chance = seen ** (shorter + 1)
    # two of them become one where rounding makes them equal
    merged = chance if shorter > 1 else 0.0
    return bool(np.mean(runs > shorter + 1) < 0.1 * by_chance + merged
                and by_chance * len(runs) > 10 and np.mean(runs < shorter) < 0.02)


def _beats(same: np.ndarray, p: float) -> bool:
    """
    Tell whether a share p is held in the beat of two rates, whatever rounding makes equal beside.

    A sensor that is read 1/(1-p) times as often as it measures is held at the frequency p of the
    reading: the indicator has 2 (sin(pi p)/pi)^2 of its variance p (1 - p) there (the first
    harmonic of a pulse train), held at random or in runs what is around there as well.

    """
    length = next((n for n in BEATS if len(same) >= 8 * n), 0)
    if not length:
        return False
    rows = same[:len(same) // length * length].reshape(-1, length)
    rows = rows - rows.mean(axis=1, keepdims=True)
    window = np.hanning(length + 1)[:length]
    power = np.mean(np.abs(np.fft.rfft(rows * window, axis=1)) ** 2, axis=0)
    # what rounding makes equal is known to a hundredth or so
    at, reach = int(abs(p - round(p)) * length), length // 50
    if at <= reach:     # slower than what comes in bursts
        return False
    k = at - reach + int(np.argmax(power[at - reach:at + reach + 1]))
    near = power[max(1, k - 2):k + 3]
    around = np.median(power[max(1, k - length // 32):k + length // 32])
    beat = 2 * (np.sin(np.pi * p) / np.pi) ** 2 / (p * (1 - p))
    return bool(np.sum(near - 2 * around) > 0.5 * beat * np.sum(power[1:]))


def _by_a_clock(same: np.ndarray, share: float) -> np.ndarray | None:
    """
    Return what :func:`shown_first` does of a clock little slower than the reader's.

    A sample is new where what its turns are over whole ones is less than the rate: a pulse train,
    whose first harmonic is sin(pi r)/pi.

    """
    n, new = len(same) + 1, 1.0 - np.append(False, same)
    new -= np.mean(new)
    power = np.abs(np.fft.rfft(new)) ** 2
    centre, reach = int(share * n), max(int(AROUND * n), 2)
    low = max(1, centre - reach)
    rate = 1 - (low + int(np.argmax(power[low:centre + reach + 1]))) / n
    for _ in range(3):      # between two frequencies: how far the second half is ahead
        first, second = (_size(half, _turning(rate, begin)) for half, begin in (
            (new[:n // 2], 0), (new[n // 2:], n // 2)))
        rate += float(np.angle(second * np.conj(first))) / (np.pi * n)
    whole = 0.5 * _size(new, _turning(rate))
    clear = np.sqrt(STEADY) * np.sin(np.pi * rate) / np.pi
    turns, ahead = rate * np.arange(n), _followed(new, rate, max(clear, abs(whole) / EVEN))
    if ahead is not None:
        turns += ahead
    elif abs(whole) > clear:
        turns += float(np.angle(whole)) / (2 * np.pi)
    else:
        return None
    # new ones lie within half of a rate of whole turns: what rounding makes equal blurs the
    # phase, but never makes a sample new
    fresh = np.array_split(np.flatnonzero(~same) + 1, CHUNKS)
    middle = [0.5 * np.sum(np.quantile(_off(turns[j]), (RARE, 1 - RARE))) for j in fresh]
    turns -= np.polyval(np.polyfit([np.mean(j) for j in fresh], middle, 1), np.arange(n))
    return np.flatnonzero(np.diff(np.floor(turns + 0.5 * rate)) > 0) + 1


def _off(turns: np.ndarray) -> np.ndarray:
    """Return what turns (k,) are off whole ones."""
    return turns - np.round(turns)


def _followed(new: np.ndarray, rate: float, clear: float) -> np.ndarray | None:
    """
    Return what a clock that is followed is ahead of its rate, turns (n,); None where it is lost.

    ``new`` (n,) tells which samples are new, less the mean; a piece needs to be as ``clear``, on
    average.

    """
    pieces = len(new) // FOLLOWED
    each = new[:pieces * FOLLOWED].reshape(pieces, FOLLOWED) @ _turning(-rate)(
        np.arange(FOLLOWED)) / FOLLOWED
    each = each * _turning(-rate * FOLLOWED)(np.arange(pieces))
    seen = np.abs(each) > LEAST * clear
    if pieces < CHUNKS or np.mean(~seen) > LOST or np.mean(np.abs(each)) < clear:
        return None
    ahead = np.unwrap(np.angle(each[seen])) / (2 * np.pi)
    return np.interp(np.arange(len(new)), (np.flatnonzero(seen) + 0.5) * FOLLOWED, ahead)


class Measured(NamedTuple):
    """A record as some axes were measured, and which samples (n,) that were read show it first."""

    record: ImuRecord
    axes: list[str]
    first: np.ndarray | None = None

    @property
    def slower(self) -> bool:
        """Whether the sensor is, than its reader."""
        return self.first is not None


def as_measured(record: ImuRecord, axes: Sequence[str], memory: Memory) -> list[Measured]:
    """Return axes that have one clock together: as the sensor measured where that is slower."""
    groups: list[tuple[np.ndarray | None, list[str]]] = []
    for sensor in dict.fromkeys(map(sensor_of, axes)):
        some = [a for a in axes if sensor_of(a) == sensor]
        held, first = _of_a_sensor(record, sensor)
        memory.rest()
        for own, which in ((first, [a for a in some if a in held]),
                           (None, [a for a in some if a not in held])):
            same = next((g for other, g in groups if _one(own, other, record.n)), None)
            if same is not None:
                same += which
            elif which:
                groups.append((own, which))
    return [Measured(record, some) if first is None else _once_each(record, first, some, memory)
            for first, some in groups]


def _of_a_sensor(record: ImuRecord, sensor: str) -> tuple[list[str], np.ndarray | None]:
    """Return the axes of a sensor that a slower clock holds, and what shows each value first."""
    held, chance, same = [], 1.0, None
    for axis in (a for a in record.axes if sensor_of(a) == sensor):
        y = np.ascontiguousarray(record.column(axis), float)
        equal = y[1:] == y[:-1]
        if np.mean(equal) > FEWEST and (seen := repeats(y)).held:
            held.append(axis)
            chance *= seen.chance
            same = equal if same is None else same & equal
    first = None if same is None else shown_first(same, chance)
    return ([], None) if first is None else (held, first)


def _one(first: np.ndarray | None, other: np.ndarray | None, n: int) -> bool:
    """Tell whether what is shown first (k,) of two sensors is so by one clock."""
    if first is None or other is None:
        return first is other
    least = min(len(first), len(other))
    share = len(np.intersect1d(first, other, assume_unique=True)) / least
    by_chance = max(len(first), len(other)) / n
    return share - by_chance > ONE * (1 - by_chance)


def _once_each(record: ImuRecord, first: np.ndarray, axes: list[str], memory: Memory) -> Measured:
    """Return a record with what a sensor measured once each, in even times."""
    # a reader that is late or early shows it in mid-time all the same
    at = first + (np.diff(first, append=record.n) - 1) // 2
    begin, end = record.t[first[[0, -1]]]
    rate = float((len(at) - 1) / (end - begin))
    return Measured(replace(record.taken(at, memory), rate_hz=rate,
                            t=begin + np.arange(len(at)) / rate), axes, first)


def images_of_lines(y: np.ndarray, lines: np.ndarray, seen: Measured) -> np.ndarray:
    """
    Return the images (n,) of lines of a sensor that measured when its value was first read.

    What its own clock measured has none: what comes nearer is taken.

    Parameters
    ----------
    y : ndarray (n,)
        Samples, once each.
    lines : ndarray (l, 6)
        Of a line table, the strongest first.
    seen : Measured
        How they were read.

    """
    rest, out = y - np.mean(y), np.zeros(len(y))
    for f, a, b, *_ in lines.tolist():
        wave = _turning(f * seen.record.dt)
        if abs(_size(rest, wave)) < LEFT * np.hypot(a, b):
            continue
        forms = [wave, *(_when_read(f * seen.record.dt + k, seen) for k in ORIGINS)]
        size, form = max(((_size(rest, x), x) for x in forms), key=lambda z: abs(z[0]))
        share = sum(len(j) * _size(np.real(size * form(j)), wave, j[0])
                    for j in _pieces(len(y))) / len(y)
        for j in _pieces(len(y)):
            whole = np.real(size * form(j))
            rest[j] -= whole
            out[j] += whole - np.real(share * wave(j))
    return out


def _when_read(f: float, seen: Measured) -> Wave:
    """Return the wave of f (a value of the sensor's) at the times at which it was first read."""
    first = cast(np.ndarray, seen.first)
    rate = (len(first) - 1) / float(first[-1] - first[0])   # values a sample that was read
    return lambda m: np.exp(2j * np.pi * f * rate * first[m])


def _pieces(n: int) -> list[np.ndarray]:
    """Return the numbers 0 ... n - 1 in pieces: no wave of a day is held at once."""
    return [np.arange(k, min(k + PIECE, n)) for k in range(0, n, PIECE)]


def _turning(f: float, begin: int = 0) -> Wave:
    """Return the wave of f (a sample) of which the first sample asked for is a later one."""
    return lambda j: np.exp(2j * np.pi * f * (j + begin))


def _size(y: np.ndarray, wave: Wave, begin: int = 0) -> complex:
    """Return the amplitude, and phase, of a wave of size 1 in samples (n,) from one on."""
    return complex(2 / len(y) * sum(
        np.sum(y[j] * np.conj(wave(j + begin))) for j in _pieces(len(y))))
