# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
From a record as it was recorded to what an analysis needs.

That is one stretch, at rest, with one sample every 1/rate.

Whatever is done to the record is counted and said in its warnings.

"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from .fill import drawn
from .stamps import ordered
from .united import united
from .values import (
    at_the_end, finite, is_constant, never_taken, not_finite, standing, too_fast,
    unit_of_stamps, where_not_finite, wrong_units)
from ..core.clipped import at_ends
from ..core.clock import fit_clock, median_rate, SampleClock
from ..core.disturbed import disturbance, disturbances
from ..core.errors import ImuNoiseError, InputError, UsageError
from ..core.record import Disturbance, ImuRecord, MASKED, Memory, SENSORS
from ..core.statistics import longest_in_a_row
from ..core.stillness import handled_ends, longest_rest, span, STILL_S

LEAST_SAMPLES = 100
LEAST_REST_S = 60.0
MOST_MISSING = 0.01         # share of samples not finite that is refused
FEW_LOST = 1e-3             # share of samples that may be interpolated: a filter that none sees
SEED = 1                    # of what is drawn for lost samples: twice the same numbers
ALIVE = 0.5     # share of the time in which no axis stands still, from which that is analysed
MOST_SET_ASIDE = 0.05       # share of the time that is set aside by itself
PIECE = 1 << 20             # of an array as long as the record: what is worked on at a time
MOTION_KEPT = (
    'analysed with --keep-motion: the record may hold motion, which is no noise of the sensor'
)
RECORDING = (
    'lay the IMU on something solid, at rest and away from people and machines, and record it '
    'still for at least 60 s (hours, for all but the white noise)'
)


def prepare(
    record: ImuRecord,
    keep_motion: bool = False,
    memory: Memory | None = None,
    *,
    screen: bool = True,
    masks: Iterable[tuple[float, float]] = (),
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
    screen : bool
        Set disturbed stretches aside where they are short.
    masks : iterable of (float, float)
        Stretches to set aside whatever they hold, from and to, s since ``record.start``.

    Returns
    -------
    ImuRecord
        Stamps rise, samples are 1/``rate_hz`` apart by their number, ``rate_hz`` is (n - 1)/span,
        all values are finite; ``missing`` counts those filled in, ``stuck`` names axes that
        never change, ``disturbances`` what was found disturbed, ``left_out`` what of it (and of
        the masks) is set aside.

    Raises
    ------
    InputError
        Fewer than 100 samples, more than 1 % not finite, every axis constant, or a record that
        moves with under 60 s at rest.

    """
    memory = memory or Memory()
    try:
        _enough(record)
        record = ordered(record, memory)
        memory.rest()
        record, clock = _without_pauses(record)
        _enough(record)
        _finite_enough(record)
        record = record.warned(*united(record), *never_taken(record))
        record = _filled(record, clock, memory)
        memory.rest()
        record = _alive(_stuck(record), screen)
        memory.rest()
        if not keep_motion:
            record = _at_rest(record)
            if screen:
                record = _without_handling(record)
        memory.rest()
        _enough(record)
        record = _set_aside(record, screen, tuple(masks))
        memory.rest()
        record = record.warned(*at_the_end(at_ends(record), record.n))
        memory.rest()
    except ImuNoiseError as error:
        raise error.after(*record.warnings)
    record = record.warned(*([MOTION_KEPT] if keep_motion else []))
    return record.warned(*_rate_doubts(record), *_unit_doubts(record, keep_motion),
                         *_too_short(record))


def _too_short(record: ImuRecord) -> list[str]:
    """Say what a record that is shorter than a rest is asked to be cannot show."""
    if record.duration_s + record.dt >= LEAST_REST_S:
        return []
    return [f'only {record.duration_s:.3g} s: no more than the white noise N shows in so short a '
            f'record; for anything slower {RECORDING}']


def in_motion(record: ImuRecord) -> ImuRecord:
    """
    Return a record that moves and rests, as it is, but without samples that are none.

    Those are not finite, or all axes of a sensor stand at one value: nothing measured there.

    Raises
    ------
    InputError
        More than 1 % are not finite, or the stamps are not s.

    """
    stamps = unit_of_stamps(median_rate(record.t), slowest=1.5)
    if stamps:
        raise InputError(f'{_name(record)}: {stamps[0]}', stamps[1])
    _finite_enough(record)
    record = _without_dead(record)
    good = finite(record)
    bad = record.n - int(good.sum())
    if not bad:
        return record
    return record.taken(good, Memory()).warned(f'{bad} sample(s) not finite, treated as missing')


def _without_dead(record: ImuRecord) -> ImuRecord:
    """Return the record without what all axes stand at one value for: one may be coarse."""
    alive, said = np.ones(record.n, bool), []
    dead = standing(record)
    for sensor in SENSORS:
        ranges = [(d.first, d.first + d.samples) for d in dead if d.axis.startswith(sensor)]
        begin, end = (over(x) for over, x in zip((max, min), zip(*ranges))) if ranges else (0, 0)
        if len(ranges) == 3 and begin < end:
            alive[begin:end] = False
            said.append(f'the {sensor} stands at one value on all axes from {record.t[begin]:.4g} '
                        f's to {record.t[end - 1]:.4g} s ({end - begin} samples): left out')
    return record.taken(alive, Memory()).warned(*said) if said else record


def motion_doubts(record: ImuRecord) -> list[str]:
    """Return what is doubtful about the gyroscope of a record that moves."""
    if record.gyro is None:
        return []
    stamps = unit_of_stamps(median_rate(record.t))
    ends = at_the_end(at_ends(replace(record, accel=None)), record.n)
    units = unit_doubts(record, sensors=('gyro',))
    return [*([': '.join(stamps)] if stamps else []), *units, *ends]


def unit_doubts(record: ImuRecord, sensors: Iterable[str] = SENSORS) -> list[str]:
    """
    Return what is doubtful about the units of these sensors of any record, as recorded.

    What seems to rest may be on a table that turns.

    """
    ready = ordered(record)
    clocked = (ready.n >= LEAST_SAMPLES and fit_clock(ready.t) is not None
               and unit_of_stamps(ready.rate_hz) is None)
    rest = _resting(ready) if clocked else None
    fast = too_fast(record) if 'gyro' in sensors else []
    if rest is None:
        return fast
    some = replace(rest, gyro=rest.gyro if 'gyro' in sensors else None,
                   accel=rest.accel if 'accel' in sensors else None)
    return [*fast, *wrong_units(some, turns=True)]


def _enough(record: ImuRecord) -> None:
    if record.n < LEAST_SAMPLES:
        raise InputError(f'{_name(record)} has only {record.n} samples, too few to analyse',
                         f'record at least {LEAST_SAMPLES}, ideally some hours')


def _name(record: ImuRecord) -> str:
    return record.path or record.topic or 'the record'


def _without_pauses(record: ImuRecord) -> tuple[ImuRecord, SampleClock]:
    """Return the longest stretch that no pause of the stream interrupts, and its clock."""
    clock = fit_clock(record.t)
    if clock is None:
        raise InputError(
            f'cannot determine the sample rate of {_name(record)} from its stamps',
            'give it with --rate-hz'
        )
    where = clock.pauses()
    if not len(where):
        return record, clock
    ends = np.r_[0, where + 1, record.n]
    k = int(np.argmax(np.diff(ends)))
    longest = float(np.max(np.diff(record.t)[where]))
    part = record.part(int(ends[k]), int(ends[k + 1]))
    part = part.warned(
        f'{len(where)} long gap(s), the longest of {longest:.4g} s: the longest stretch without '
        'one is '
        f'analysed, {part.duration_s:.4g} s from {part.t[0]:.4g} s on'
    )
    _enough(part)
    return part, fit_clock(part.t) or clock


def _alive(record: ImuRecord, screen: bool) -> ImuRecord:
    """Return the longest stretch in which no axis stands at one value, if it is long enough."""
    dead = standing(record)
    if not dead:
        return record
    alive = np.ones(record.n, bool)
    for one in dead:
        alive[one.first:one.first + one.samples] = False
    begin, end = longest_in_a_row(alive)
    said = [s.in_words for s in dead]
    if not screen or end - begin < ALIVE * record.n:
        return record.warned(*(
            f'{s}, and leave that out (--start, --duration, --mask): N comes out too small'
            for s in said))
    part = record.part(begin, end)
    return part.warned(*said, 'the longest stretch without that is analysed, '
                       f'{part.duration_s:.4g} s from {part.t[0]:.4g} s on; --no-screen keeps all')


def _finite_enough(record: ImuRecord) -> None:
    bad = record.n - int(finite(record).sum())
    if bad > MOST_MISSING * record.n:
        raise InputError(
            f'{_name(record)}: {100 * bad / record.n:.3g} % of the samples are not finite (NaN '
            f'or infinite; {where_not_finite(not_finite(record))})',
            'fix the driver and record again',
        )


def _stuck(record: ImuRecord) -> ImuRecord:
    stuck = tuple(a for a in record.columns if is_constant(record.column(a)))
    if len(stuck) == len(record.columns):
        raise InputError(
            f'{_name(record)}: every axis is constant',
            'check that the sensor is powered and its driver reads it',
        )
    if not stuck:
        return record
    return replace(record, stuck=stuck).warned(
        f'{", ".join(stuck)} never changes; left out of the study')


def _at_rest(record: ImuRecord) -> ImuRecord:
    """Return the longest stretch at rest, shocks within it marked."""
    pieces = longest_rest(record)
    a, b = (pieces[0][0], pieces[-1][1]) if pieces else (0, 0)
    whole = a == 0 and b == record.n
    rest = span(record, pieces)
    if not pieces and record.duration_s < STILL_S:
        raise InputError(
            f'{_name(record)}: {record.duration_s:.3g} s are too short to tell whether the IMU '
            'rests', f'{RECORDING}, or take it to rest with --keep-motion')
    if not whole and rest + record.dt < LEAST_REST_S:
        raise InputError(
            f'{_name(record)}: the IMU moves; its longest still stretch is {rest:.3g} s, under '
            f'{LEAST_REST_S:g} s at rest',
            f'{RECORDING}, or override with --keep-motion',
        )
    shocks = tuple(
        disturbance(record, i[1] - 1, j[0] + 1, 'shock') for i, j in zip(pieces, pieces[1:])
    )
    part = replace(record.part(a, b), disturbances=shocks)
    if whole:
        return part
    return part.warned(f'the IMU moves: the longest still stretch is analysed, {rest:.4g} s from '
                       f'{part.t[0]:.4g} s on')


def _without_handling(record: ImuRecord) -> ImuRecord:
    """Return the record without what is rocked as it begins and ends, by whom started it."""
    a, b = handled_ends(record)
    if (a, b) == (0, record.n) or b - a < LEAST_SAMPLES:
        return record
    times = [(0, a), (b, record.n)]
    said = ' and '.join(
        f'{record.t[i]:.4g}-{record.t[j - 1]:.4g} s' for i, j in times if j > i)
    kept = tuple(d for d in record.disturbances
                 if d.begin > record.t[a] and d.end < record.t[b - 1])
    return replace(record.part(a, b), disturbances=kept).warned(
        f'rocked at its ends, {said}: {record.t[b - 1] - record.t[a]:.4g} s between are analysed '
        '(--no-screen keeps them in)')


def _set_aside(
    record: ImuRecord, screen: bool, masks: tuple[tuple[float, float], ...]
) -> ImuRecord:
    """
    Return the record with what disturbs it named, and set aside where that is little.

    Shocks and clipping, the shortest first, as long as all is little; the rest as a whole: what
    disturbs a record for long, and may be found in pieces, is an effect to be found, not a stretch
    to be left out.

    """
    known = record.disturbances
    found = [
        d for d in disturbances(record)
        if not any(d.begin < k.end and k.begin < d.end for k in known)
    ]
    every = tuple(sorted((*known, *found), key=lambda d: d.begin))
    record = replace(record, disturbances=every)
    lasting = sorted((d for d in every if d.kind != 'step'), key=lambda d: d.end - d.begin)
    most = MOST_SET_ASIDE * record.duration_s
    brief = [d for d in lasting if d.kind != 'disturbed']
    chosen = [d for k, d in enumerate(brief) if screen and _length(brief[:k + 1]) <= most]
    if screen and _length(lasting) <= most:
        chosen = lasting
    begin, end = float(record.t[0]), float(record.t[-1])
    masked = [(max(a, begin), min(b, end), MASKED) for a, b in masks if a < end and b > begin]
    outside = [f'{a:g}-{b:g}' for a, b in masks if not (a < end and b > begin)]
    if outside:
        record = record.warned(
            f'--mask {",".join(outside)} s is outside of what is analysed, {begin:.4g} to '
            f'{end:.4g} s: it leaves nothing out'
        )
    out = _merged([*((d.begin, d.end, d.kind) for d in chosen), *masked])
    total = sum(b - a for a, b, _ in out)
    if masked and total > 0.9 * record.duration_s:
        raise UsageError('--mask leaves too little to analyse', 'mask less of it')
    if chosen:
        record = record.warned(
            f'{_stretches(chosen)} set aside from the noise fit (--no-screen keeps it in)'
        )
    if len(chosen) < len(lasting):
        record = record.warned(
            f'{_stretches([d for d in lasting if d not in chosen])} left in the noise fit'
        )
    return replace(record, left_out=(*record.left_out, *out))


def _stretches(found: list[Disturbance]) -> str:
    """Return how many stretches there are, and how long: the beginning of a sentence."""
    many = 'stretch of' if len(found) == 1 else 'stretches of together'
    verb = 'is' if len(found) == 1 else 'are'
    return f'{len(found)} disturbed {many} {_length(found):.3g} s {verb}'


def _length(found: Iterable[Disturbance]) -> float:
    return sum(d.end - d.begin for d in found)


def _merged(stretches: list[tuple[float, float, str]]) -> list[tuple[float, float, str]]:
    """Return stretches in order, those that overlap as one."""
    out: list[tuple[float, float, str]] = []
    for a, b, why in sorted(stretches):
        if out and a <= out[-1][1]:
            before = out.pop()
            why = before[2] if why in before[2] else f'{before[2]}, {why}'
            a, b = before[0], max(b, before[1])
        out.append((a, b, why))
    return out


def _filled(record: ImuRecord, clock: SampleClock, memory: Memory) -> ImuRecord:
    """
    Return the record on its even clock, lost and non-finite samples filled in and counted.

    Each sample that was recorded stays as it is, in its place.

    """
    good = finite(record)
    bad, lost = record.n - int(good.sum()), clock.missing
    if lost > record.n:
        raise InputError(
            f'{_name(record)}: more samples were lost than recorded',
            'record with fewer topics or a faster disk',
        )
    record = replace(record, rate_hz=clock.rate_hz).warned(*clock.doubts())
    n, start = record.n + lost, float(record.t[0])
    said = []
    if bad:
        said.append(f'{bad} sample(s) not finite, treated as missing')
    if lost:
        said.append(
            f'{lost} sample(s) lost in {len(clock.gaps)} short dropout(s), treated as missing'
        )
    if bad or lost:
        memory.rest()
        place = clock.place(record.n)
        axes = replace(record, receive_t=None, covariates={})
        many = bad + lost > FEW_LOST * n
        axes = axes.changed(
            _on_grid(place, good, n, np.random.default_rng(SEED) if many else None), memory)
        rest = replace(record, gyro=None, accel=None)
        rest = rest.changed(_on_grid(place, np.ones(record.n, bool), n), memory)
        record = replace(
            rest, gyro=axes.gyro, accel=axes.accel, missing=record.missing + bad + lost
        ).warned(*said)
    t = memory.empty(n)
    for i in range(0, n, PIECE):
        k = np.arange(i, min(i + PIECE, n))
        t[i:i + PIECE] = start + k / clock.rate_hz
    return replace(record, t=t)


def _on_grid(place: np.ndarray, good: np.ndarray, n: int,
             rng: np.random.Generator | None = None) -> Callable:
    """
    Return a function that puts a column's good samples in their places of n, others between.

    Where there is a generator those are drawn with the spectrum of the column, for one axis after
    the other (:mod:`~imu_noise_tools.health.fill`).

    """
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
        return out if rng is None else drawn(out, there, rng)

    return fill


def _unit_doubts(record: ImuRecord, moves: bool) -> list[str]:
    """Return what is doubtful about the units: only at rest is it known what to expect."""
    rest = _resting(record) if moves else record
    return [] if rest is None else wrong_units(rest)


def _resting(record: ImuRecord) -> ImuRecord | None:
    """Return the longest rest of a record that moves, knocks in it, or None."""
    rest = longest_rest(record)
    return record.part(rest[0][0], rest[-1][1]) if rest else None


def _rate_doubts(record: ImuRecord) -> list[str]:
    """Return sentences where the label or the receive times tell another rate."""
    stamps = unit_of_stamps(record.rate_hz)
    said = [': '.join(stamps)] if stamps else []
    given = record.given_rate_hz is not None
    label = None if given else record.labelled_rate_hz
    if label and abs(label / record.rate_hz - 1) > 0.01:
        said.append(
            f'the stamps give {record.rate_hz:.6g} Hz where the file says {label:.6g} Hz; the '
            'stamps were used'
        )
    if record.receive_t is not None and record.n > 1:
        span = float(record.receive_t[-1] - record.receive_t[0])
        if span > 10 and abs(record.duration_s / span - 1) > 0.01:
            what = 'the samples at --rate-hz' if given else 'the stamps'
            said.append(f'{what} span {record.duration_s:.5g} s and the receive times '
                        f'{span:.5g} s; the {"rate" if given else "stamps"} '
                        f'{"was" if given else "were"} used')
    return said
