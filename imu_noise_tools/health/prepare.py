# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
From a record as it was recorded to what an analysis needs.

That is one stretch, at rest, with one sample every 1/rate.

Whatever is done to the record is counted and said in its warnings.

"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from .stamps import changed, losses, ordered
from .values import finite, is_constant, wrong_units
from ..core.errors import InputError
from ..core.record import AXES, ImuRecord, Memory, regular_rate, sensor_of
from ..core.stillness import longest_rest

LEAST_SAMPLES = 100
LEAST_REST_S = 60.0
MOST_MISSING = 0.01         # share of samples not finite that is refused
LONG_GAP_S = 1.0            # a gap of so long (and of ten samples) ends a stretch
RECORDING = (
    'lay the IMU on something solid, at rest and away from people and machines, and record it '
    'still for at least 60 s (hours, for all but the white noise)'
)


def prepare(
    record: ImuRecord, keep_motion: bool = False, memory: Memory | None = None
) -> ImuRecord:
    """
    Return the part of a record that is analysed, ordered, without gaps and at rest.

    Parameters
    ----------
    record : ImuRecord
        As recorded.
    keep_motion : bool
        Analyse all of it, whether it moves or not.
    memory : Memory, optional
        Where long arrays are kept.

    Returns
    -------
    ImuRecord
        Stamps rise, samples are 1/``rate_hz`` apart by their number, ``rate_hz`` is (n - 1)/span,
        all values are finite; ``missing`` counts the interpolated ones, ``stuck`` names axes that
        never change, ``left_out`` the knocks within.

    Raises
    ------
    InputError
        Fewer than 100 samples, more than 1 % not finite, every axis constant, or under 60 s at
        rest.

    """
    memory = memory or Memory()
    _enough(record)
    record = ordered(record, memory)
    memory.rest()
    record = _without_gaps(record)
    _enough(record)
    _finite_enough(record)
    record = _stuck(record)
    memory.rest()
    if not keep_motion:
        record = _at_rest(record)
    memory.rest()
    record = _filled(record, memory)
    memory.rest()
    _enough(record)
    record = replace(record, rate_hz=(record.n - 1) / record.duration_s)
    return record.warned(*_rate_doubts(record), *_unit_doubts(record, keep_motion))


def _enough(record: ImuRecord) -> None:
    if record.n < LEAST_SAMPLES:
        raise InputError(f'{_name(record)} has {record.n} samples, too few to analyse',
                         f'record at least {LEAST_SAMPLES}, better some hours')


def _name(record: ImuRecord) -> str:
    return record.path or record.topic or 'the record'


def _without_gaps(record: ImuRecord) -> ImuRecord:
    """Return the longest stretch without a long gap."""
    rate = regular_rate(record.t)
    if rate is None:
        raise InputError(
            f'{_name(record)} has no rate to be had from its stamps', 'give one with --rate-hz'
        )
    where = np.flatnonzero(np.diff(record.t) > max(LONG_GAP_S, 10 / rate))
    record = replace(record, rate_hz=rate)
    if not len(where):
        return record
    ends = np.r_[0, where + 1, record.n]
    k = int(np.argmax(np.diff(ends)))
    longest = float(np.max(np.diff(record.t)[where]))
    part = record.part(int(ends[k]), int(ends[k + 1]))
    return part.warned(
        f'{len(where)} long gap(s), the longest of {longest:.4g} s: the longest stretch without '
        'one is '
        f'analysed, {part.duration_s:.4g} s from {part.t[0]:.4g} s on'
    )


def _finite_enough(record: ImuRecord) -> None:
    bad = record.n - int(finite(record).sum())
    if bad > MOST_MISSING * record.n:
        raise InputError(
            f'{_name(record)}: {100 * bad / record.n:.3g} % of the samples are not finite (NaN '
            'or infinite)',
            'mend the driver and record again',
        )


def _stuck(record: ImuRecord) -> ImuRecord:
    stuck = tuple(
        a
        for a in AXES
        if getattr(record, sensor_of(a)) is not None and is_constant(record.column(a))
    )
    there = [a for a in AXES if getattr(record, sensor_of(a)) is not None]
    if len(stuck) == len(there):
        raise InputError(
            f'{_name(record)}: every axis is constant',
            'check that the sensor is powered and its driver reads it',
        )
    if not stuck:
        return record
    return replace(record, stuck=stuck).warned(
        f'{", ".join(stuck)} never changes; left out of the study')


def _at_rest(record: ImuRecord) -> ImuRecord:
    """Return the longest stretch at rest, knocks within it marked."""
    pieces = longest_rest(record)
    a, b = (pieces[0][0], pieces[-1][1]) if pieces else (0, 0)
    whole = a == 0 and b == record.n
    span = record.t[b - 1] - record.t[a] if b > a else 0.0
    if not whole and span + record.dt < LEAST_REST_S:
        raise InputError(
            f'{_name(record)}: the IMU moves; its longest still stretch is {span:.3g} s, under '
            f'{LEAST_REST_S:g} s at rest',
            f'{RECORDING}, or override with --keep-motion',
        )
    part = record.part(a, b)
    knocks = tuple(
        (float(record.t[i[1] - 1]), float(record.t[j[0]]), 'knock')
        for i, j in zip(pieces, pieces[1:])
    )
    part = replace(part, left_out=(*part.left_out, *knocks))
    if knocks:
        part = part.warned(f'{len(knocks)} knock(s) are left out of the noise fit')
    if whole:
        return part
    return part.warned(f'the IMU moves: the longest still stretch is analysed, {span:.4g} s from '
                       f'{part.t[0]:.4g} s on')


def _filled(record: ImuRecord, memory: Memory) -> ImuRecord:
    """Return the record with lost and non-finite samples interpolated, and counted."""
    good = finite(record)
    where, count = losses(record.t, record.dt)
    # One sample lost by itself is left as it is: the rest moves by one step, and nothing is made
    # up.
    alone = int(np.sum(count == 1))
    where, count = where[count > 1], count[count > 1]
    if alone:
        record = record.warned(
            f'{alone} sample(s) lost one at a time; analysed as if they had not been taken'
        )
    bad, lost = record.n - int(good.sum()), int(count.sum())
    if bad == 0 and lost == 0:
        return record
    if lost > record.n:
        raise InputError(
            f'{_name(record)}: more samples were lost than recorded',
            'record with fewer topics or a faster disk',
        )
    memory.rest()
    # Places of the recorded samples on the regular grid.
    place = np.zeros(record.n, np.int64)
    np.add.at(place, where + 1, count)
    np.cumsum(place, out=place)
    place += np.arange(record.n)
    said = []
    if bad:
        said.append(f'{bad} sample(s) not finite, treated as missing')
    if lost:
        said.append(f'{lost} sample(s) lost in {len(where)} short dropout(s), treated as missing')
    axes = replace(record, receive_t=None, covariates={})
    axes = changed(axes, _on_grid(place, good, record.n + lost), memory)
    rest = replace(record, gyro=None, accel=None)
    rest = changed(rest, _on_grid(place, np.ones(record.n, bool), record.n + lost), memory)
    filled = replace(rest, gyro=axes.gyro, accel=axes.accel, missing=record.missing + bad + lost)
    return filled.warned(*said)


def _on_grid(place: np.ndarray, good: np.ndarray, n: int) -> Callable:
    """Return a function that puts a column's good samples in their places of n, others between."""
    known = place[good]
    there = np.zeros(n, bool)
    there[known] = True
    missing = np.flatnonzero(~there)
    after = np.clip(np.searchsorted(known, missing), 0, len(known) - 1)
    before = np.maximum(np.searchsorted(known, missing) - 1, 0)
    share = (missing - known[before]) / np.maximum(known[after] - known[before], 1)
    source = np.flatnonzero(good)
    before, after = source[before], source[after]

    def fill(x: np.ndarray) -> np.ndarray:
        out = np.empty(n)
        out[there] = x[good]
        out[missing] = x[before] + np.clip(share, 0, 1) * (x[after] - x[before])
        return out

    return fill


def _unit_doubts(record: ImuRecord, moves: bool) -> list[str]:
    """Return what is doubtful about the units: only at rest is it known what to expect."""
    if not moves:
        return wrong_units(record)
    rest = longest_rest(record)
    return wrong_units(record.part(rest[0][0], rest[-1][1])) if rest else []


def _rate_doubts(record: ImuRecord) -> list[str]:
    """Return sentences where the label or the receive times tell another rate."""
    said = []
    label = record.labelled_rate_hz
    if label and abs(label / record.rate_hz - 1) > 0.01:
        said.append(
            f'the stamps give {record.rate_hz:.6g} Hz where the file says {label:.6g} Hz; the '
            'stamps were used'
        )
    if record.receive_t is not None and record.n > 1:
        span = float(record.receive_t[-1] - record.receive_t[0])
        if span > 10 and abs(record.duration_s / span - 1) > 0.01:
            said.append(
                f'the stamps span {record.duration_s:.5g} s and the times of receiving '
                f'{span:.5g} s; '
                'the stamps were used'
            )
    return said
