"""
From a record as it was recorded to what an analysis needs.

That is one stretch, at rest, with one sample every 1/rate.

Whatever is done to the record is counted and said in its warnings.

"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .stillness import finite_mean, longest_rest
from ..errors import InputError
from ..record import AXES, ImuRecord, regular_rate, sensor_of

LEAST_SAMPLES = 100
LEAST_REST_S = 60.0
MOST_MISSING = 0.01         # share of samples not finite that is refused
LONG_GAP_S = 1.0            # a gap of so long (and of ten samples) ends a stretch
NEAR = 8                    # samples on each side of a late stamp that tell a loss from a delay
RECORDING = (
    'lay the IMU on something solid, at rest and away from people and machines, and record it '
    'still for '
    'at least 60 s (hours, for all but the white noise)'
)


def prepare(record: ImuRecord, keep_motion: bool = False) -> ImuRecord:
    """
    Return the part of a record that is analysed, ordered, without gaps and at rest.

    Parameters
    ----------
    record : ImuRecord
        As recorded.
    keep_motion : bool
        Analyse all of it, whether it moves or not.

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
    _enough(record)
    record = ordered(record)
    record = _without_gaps(record)
    _enough(record)
    _finite_enough(record)
    record = _stuck(record)
    if not keep_motion:
        record = _at_rest(record)
    record = _filled(record)
    _enough(record)
    record = replace(record, rate_hz=(record.n - 1) / record.duration_s)
    return record.warned(*_rate_doubts(record), *wrong_units(record))


def _enough(record: ImuRecord) -> None:
    if record.n < LEAST_SAMPLES:
        raise InputError(f'{_name(record)} has {record.n} samples, too few to analyse',
                         f'record at least {LEAST_SAMPLES}, better some hours')


def _name(record: ImuRecord) -> str:
    return record.path or record.topic or 'the record'


@dataclass(frozen=True)
class Stamps:
    """What is wrong with the stamps of a record."""

    not_finite: int
    repeated: int           # same stamp and same data as the sample before
    duplicate: int          # same stamp, other data
    backward: int           # stamps before that of the sample before
    swapped: bool           # sorting by stamp puts the backward ones right


def examine_stamps(record: ImuRecord) -> Stamps:
    """Count what is wrong with the stamps."""
    t = record.t[np.isfinite(record.t)]
    step = np.diff(t)
    same = np.flatnonzero(np.diff(record.t) == 0)
    repeated = sum(_equal(record, k) for k in same.tolist()) if len(same) < 100_000 else 0
    backward = int(np.sum(step < 0))
    swapped = False
    if backward:
        after = np.diff(np.sort(t))
        swapped = bool(np.sum(after < 0.25 * np.median(after)) <= np.sum(step == 0))
    return Stamps(record.n - len(t), repeated, len(same) - repeated, backward, swapped)


def _equal(record: ImuRecord, k: int) -> bool:
    return all(
        np.array_equal(d[k], d[k + 1], equal_nan=True)
        for d in (record.gyro, record.accel)
        if d is not None
    )


def ordered(record: ImuRecord) -> ImuRecord:
    """
    Return the record with stamps that never fall, and no sample twice.

    Samples that came in the wrong order are put right; where a clock was set back, what follows
    goes on from there. A repeated message is dropped; a stamp given to two different samples stays
    with both.

    """
    found = examine_stamps(record)
    said = []
    if found.not_finite:
        record = _take(record, np.isfinite(record.t))
        said.append(f'{found.not_finite} sample(s) without a stamp were dropped')
    if found.backward and found.swapped:
        record = _take(record, np.argsort(record.t, kind='stable'))
        said.append(f'{found.backward} backward stamp(s): the samples were put in order')
    elif found.backward:
        record = replace(record, t=_going_on(record.t))
        said.append(
            f'{found.backward} backward stamp(s): the clock was set back, later samples follow on'
        )
    if found.repeated:
        step = np.diff(record.t)
        twice = [k + 1 for k in np.flatnonzero(step == 0).tolist() if _equal(record, k)]
        keep = np.ones(record.n, bool)
        keep[twice] = False
        record = _take(record, keep)
        said.append(f'{found.repeated} duplicate message(s) were dropped')
    if found.duplicate:
        said.append(
            f'{found.duplicate} duplicate stamp(s) with different data: the samples were kept'
        )
    return record.warned(*said)


def _going_on(t: np.ndarray) -> np.ndarray:
    """
    Return stamps in which every backward step has become one regular step.

    A lone wrong stamp is mended.

    """
    t = t.copy()
    rate = regular_rate(t)
    dt = 1 / rate if rate else 0.0
    for k in np.flatnonzero(np.diff(t) < 0):
        if k + 1 < len(t) and t[k] > t[k + 1]:
            before = t[k - 1] if k else t[k] - dt
            if 0 < k and before < t[k + 1] and t[k + 1] - before < 3 * dt:
                t[k] = 0.5 * (before + t[k + 1])                    # this one alone ran ahead
            elif k + 2 < len(t) and 0 < t[k + 2] - t[k] < 3 * dt:
                t[k + 1] = 0.5 * (t[k] + t[k + 2])                  # the next one alone fell back
            else:
                t[k + 1:] += t[k] + dt - t[k + 1]
    return np.maximum.accumulate(t)


def _take(record: ImuRecord, which: np.ndarray) -> ImuRecord:
    """Return some samples, by mask or index."""
    return replace(
        record, t=record.t[which],
        gyro=None if record.gyro is None else record.gyro[which],
        accel=None if record.accel is None else record.accel[which],
        receive_t=None if record.receive_t is None else record.receive_t[which],
        covariates={k: v[which] for k, v in record.covariates.items()})


def losses(t: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """
    Return where samples were lost and how many.

    A stamp can be late without a loss: then those after it catch up. A loss shifts all that
    follow, so the median lag behind a regular clock is compared on both sides.

    Returns
    -------
    ndarray (gaps,), ndarray (gaps,)
        Index of the last sample before each gap, and the number of samples missing in it.

    """
    late = np.flatnonzero(np.diff(t) > 1.5 * dt)
    if not len(late):
        return late, late
    lag = t - np.arange(len(t)) * dt
    near = np.arange(NEAR)
    before = np.median(lag[np.clip(late[:, None] - near, 0, len(t) - 1)], axis=1)
    after = np.median(lag[np.clip(late[:, None] + 1 + near, 0, len(t) - 1)], axis=1)
    count = np.minimum(
        np.round((after - before) / dt), np.round((t[late + 1] - t[late]) / dt) - 1
    ).astype(np.int64)
    return late[count > 0], count[count > 0]


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


def finite(record: ImuRecord) -> np.ndarray:
    """Tell of every sample whether all its values are finite, (n,)."""
    good = np.ones(record.n, bool)
    for data in record.data:
        for k in range(3):
            # column by column: many times faster than along the rows
            good &= np.isfinite(data[:, k])
    return good


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


def is_constant(x: np.ndarray) -> bool:
    """Tell whether the finite values of an axis are all the same."""
    if len(x) > 1000 and not is_constant(x[:1000]):
        return False
    some = x[np.isfinite(x)]
    return not len(some) or bool(np.all(some == some[0]))


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


def _filled(record: ImuRecord) -> ImuRecord:
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
    # Places of the recorded samples on the regular grid.
    place = np.arange(record.n)
    shift = np.zeros(record.n, np.int64)
    np.add.at(shift, where + 1, count)
    place = place + np.cumsum(shift)
    grid = np.arange(record.n + lost)

    def on_grid(x: np.ndarray | None) -> np.ndarray | None:
        return None if x is None else np.stack(
            [np.interp(grid, place[good], x[good, k]) for k in range(3)], axis=1)
    said = []
    if bad:
        said.append(f'{bad} sample(s) not finite, treated as missing')
    if lost:
        said.append(f'{lost} sample(s) lost in {len(where)} short dropout(s), treated as missing')
    filled = replace(
        record, gyro=on_grid(record.gyro), accel=on_grid(record.accel),
        t=np.interp(grid, place, record.t), missing=record.missing + bad + lost,
        receive_t=None if record.receive_t is None else np.interp(grid, place, record.receive_t),
        covariates={k: np.interp(grid, place, v) for k, v in record.covariates.items()})
    return filled.warned(*said)


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


def wrong_units(record: ImuRecord) -> list[str]:
    """Return sentences where the values at rest are such as no IMU gives in SI."""
    said = []
    if record.accel is not None:
        g = float(np.linalg.norm(finite_mean(record.accel)))
        if not (7 <= g <= 12.5 or np.isnan(g)):
            said.append(
                f'wrong unit suspected: |mean acceleration| is {g:.4g} m/s^2 at rest, not 9.8'
                + _likely_accel(g)
            )
    if record.gyro is not None:
        rate = float(np.max(np.abs(finite_mean(record.gyro))))
        scatter = float(np.max(_scatter(record.gyro)))
        # 30 deg/s of bias or 11 deg/s of sample noise: no gyro is so bad; the same numbers in
        # deg/s are common.
        if rate > 0.52 or scatter > 0.2:
            said.append(
                f'wrong unit suspected: the gyro reads {rate:.3g} rad/s (scatter {scatter:.3g}) '
                'at rest; '
                'if it is in deg/s, use --gyro-unit deg/s'
            )
    return said


def _likely_accel(g: float) -> str:
    if 0.7 <= g <= 1.3:
        return '; if it is in g, use --accel-unit g'
    if 700 <= g <= 1300:
        return '; if it is in mg, use --accel-unit mg'
    if g > 100:
        return '; these may be raw counts, which need the scale of the sensor'
    return '; gravity may have been removed' if g < 0.5 else ''


def _scatter(data: np.ndarray) -> np.ndarray:
    """Return the scatter of the samples, (3,), from neighbours."""
    step = np.diff(data[:100_000], axis=0)
    return np.array(
        [x[good].std() if (good := np.isfinite(x)).any() else 0.0 for x in step.T]
    ) / np.sqrt(2)
