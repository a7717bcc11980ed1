# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""From a record to poses of the gyroscope: turns of known rate or angle, and rests."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from .gravity import EARTH_RATE
from .poses import DIRECTIONS, joined, nearest_face, Poses
from .positions import because, Rest, rests, standard_errors, temperatures
from ..core.errors import InputError, UsageError
from ..core.record import ImuRecord
from ..core.statistics import in_a_row
from ..core.stillness import still_stretches

REFERENCE = ('reference_x', 'reference_y', 'reference_z')      # columns of the true rate, rad/s
_CONE_DEG = 20.0
_BLOCK_S = 0.1


def turns(record: ImuRecord, *, rate: float | None = None, turn: float | None = None,
          latitude: float | None = None, seconds: float = 2.0,
          partly: bool = False) -> tuple[Poses, tuple[str, ...]]:
    """
    Return the gyroscope's poses of a record, with known inputs, and notes for people.

    One of three ways says what the true input is: the columns ``reference_x, _y, _z`` (rad/s) of
    the record; the ``rate`` (rad/s) of a rate table turned both ways about each axis; or the angle
    ``turn`` (rad) of hand turns about each axis, from rest to rest, where O is the integrated
    output and I = [angle; duration]. Rests count as well, with input zero. With a ``latitude``
    (deg) the vertical part of the Earth's rate is added to the input of whatever turns or rests
    about the vertical; without, it stays in the bias. ``partly`` takes a record that holds a part
    of a session.

    Raises
    ------
    UsageError
        Not exactly one way is given.
    InputError
        There is no gyroscope, or an axis is not turned.

    """
    if record.gyro is None:
        raise InputError(f'{record.path or "the record"} has no gyroscope',
                         'calibrate the accelerometer')
    known = [name for name in REFERENCE if name in record.covariates]
    if bool(known) + (rate is not None) + (turn is not None) != 1:
        raise UsageError('the gyroscope needs exactly one reference',
                         'give --rate (rate table), --turn (hand turns) or columns reference_x, '
                         '_y, _z')
    if known:
        poses, notes = _by_reference(record, seconds)
    elif rate is not None:
        poses, notes = _by_rate(record, abs(rate), seconds)
    else:
        poses, notes = _by_angle(record, abs(turn or 0.0), seconds)
    if not known and not partly:
        refuse_missing_axes(poses.names, 'turn' if rate is None else 'rate', notes)
    return _with_earth(poses, latitude, list(notes))


def _by_reference(record, seconds):
    true = np.column_stack([record.covariates.get(n, np.zeros(record.n)) for n in REFERENCE])
    parts = [(a, b) for a, b in _steady(record, true, seconds)]
    if not parts:
        raise InputError(f'the reference rate is never steady for {seconds:g} s',
                         'hold each rate for some seconds')
    inputs = np.array([true[a:b].mean(0) for a, b in parts]).T
    return _means(record, parts, inputs, [_turn_name(i) for i in inputs.T]), ()


def _by_rate(record, rate, seconds):
    parts, inputs, names, notes = [], [], [], []
    for a, b in _steady(record, record.gyro, seconds):
        mean = record.gyro[a:b].mean(0)
        face, angle = nearest_face(mean)
        size = np.linalg.norm(mean)
        if size < 0.2 * rate:
            parts.append((a, b))
            inputs.append(np.zeros(3))
            names.append('rest')
        elif angle > _CONE_DEG or not 0.6 < size / rate < 1.6:
            notes.append(f'a turn at {record.t[a]:.0f} s, {np.degrees(size):.3g} deg/s, '
                         f'{angle:.0f} deg from {face}, '
                         f'is not the table\'s {np.degrees(rate):.3g} deg/s: left out')
        else:
            parts.append((a, b))
            inputs.append(rate * DIRECTIONS[face])
            names.append(f'turn {face}')
    if not parts:
        raise InputError(f'the rate is never steady for {seconds:g} s{because(notes)}',
                         'hold each rate for some seconds')
    return _means(record, parts, np.array(inputs).T, names), notes


def _by_angle(record, angle, seconds):
    """Return hand turns between rests, as integrals, and the rests themselves."""
    still = still_stretches(record, min(seconds, 1.0))
    if not still:
        raise InputError('no rest found: it moves all the time', 'a turn goes from rest to rest')
    quiet = np.mean([record.gyro[a:b].std(0) for a, b in still], axis=0)
    margin = round(0.2 * record.rate_hz)
    turns, notes = [], []
    for (_, a), (b, _) in zip(still[:-1], still[1:]):
        turn = _turn(record, angle, max(0, a - margin), min(record.n, b + margin), margin)
        if isinstance(turn, str):
            notes.append(turn)
        elif turn is not None:
            turns.append(turn)
    found = _rests(record, seconds)
    resting = _means(record, [(r.begin, r.end) for r in found], np.zeros((3, len(found))),
                     ['rest'] * len(found), found)
    span = np.array([len(r.samples()) * record.dt for r in found])
    resting = Poses.of('gyro', resting.outputs * span, resting.std * span, angle, resting.inputs,
                       span,
                       resting.force, resting.temperature, resting.reference_temperature,
                       resting.time, resting.names)
    if not turns:
        return resting, notes
    outputs, inputs, amount, force, temperature, time, names = zip(*turns)
    # noise of the integral, and half a sample of uncertainty where the turn begins and ends
    std = [quiet * np.sqrt(duration * record.dt) for duration in amount]
    turning = Poses.of('gyro', np.array(outputs).T, np.array(std).T, angle, np.array(inputs).T,
                       list(amount), np.array(force).T, list(temperature),
                       resting.reference_temperature, list(time), list(names))
    return joined([turning, resting]), notes


def _turn(record, angle, a, b, margin):
    """
    Return one turn: output, input, duration, up, temperature, time and name.

    Handling is a sentence instead, and what hardly moves None.

    """
    dt = np.diff(record.t[a:b + 1], append=record.t[min(b, record.n - 1)] + record.dt)[:b - a]
    total = (record.gyro[a:b] * dt[:, None]).sum(0)
    face, off = nearest_face(total)
    size = np.linalg.norm(total)
    if size < 0.3 * angle:
        return None
    if off > _CONE_DEG or not 0.6 < size / angle < 1.6 or _tips(record, a, b, margin):
        return (f'a movement at {record.t[a]:.0f} s ({np.degrees(size):.0f} deg, {off:.0f} deg '
                f'from {face}) is no turn of {np.degrees(angle):.0f} deg about one axis: handling')
    up = np.full(3, np.nan) if record.accel is None else _up(record, a, b, margin)
    t = record.covariates.get('temperature')
    return (total, angle * DIRECTIONS[face], float(dt.sum()), up,
            np.nan if t is None else t[a:b].mean(), record.t[a:b].mean(), f'turn {face}')


def _rests(record, seconds):
    if record.accel is not None:
        return rests(record, seconds)
    return [Rest(((a, b),), np.full(3, np.nan), record.gyro[a:b].mean(0)) for a,
            b in still_stretches(record, seconds)]


def _tips(record, a, b, margin) -> bool:
    """Tell whether another side is up after a movement: then it was no turn about the vertical."""
    if record.accel is None:
        return False
    before, after = (record.accel[s].mean(0) for s in (slice(a, a + margin), slice(b - margin, b)))
    cosine = before @ after / np.linalg.norm(before) / np.linalg.norm(after)
    return bool(cosine < np.cos(np.radians(10.0)))


def _up(record, a, b, margin):
    return 0.5 * (record.accel[a:a + margin].mean(0) + record.accel[b - margin:b].mean(0))


def _means(record, parts, inputs, names, found=None) -> Poses:
    """Return poses that are means over sample ranges."""
    found = found or [Rest(((a, b),), np.full(3, np.nan), None) for a, b in parts]
    index = [r.samples() for r in found]
    force = None if record.accel is None else np.array([record.accel[k].mean(0) for k in index]).T
    return Poses.of(
        'gyro', np.array([record.gyro[k].mean(0) for k in index]).T,
        standard_errors(record.gyro, found, record.rate_hz),
        float(np.linalg.norm(inputs, axis=0).max()) or 1.0, inputs, force=force,
        temperature=temperatures(record, found), time=[record.t[k].mean() for k in index],
        names=names)


def _steady(record, rates, seconds) -> list[tuple[int, int]]:
    """Return sample ranges in which rates (n, 3) do not change from block to block."""
    block = max(2, round(_BLOCK_S * record.rate_hz))
    n = record.n // block
    cut = rates[:n * block].reshape(n, block, 3)
    middle = cut.mean(1)
    noise = np.median(cut.std(1), axis=0) / np.sqrt(block)
    tolerance = 6 * noise + 0.01 * np.abs(middle).max() + 1e-9
    change = np.abs(np.diff(middle, axis=0))
    still = np.r_[False, (change < tolerance).all(1)]
    edges = in_a_row(still)
    return [(a * block, (b - 1) * block) for a,
            b in edges if (b - 1 - a) * block >= seconds * record.rate_hz]


def _turn_name(rate) -> str:
    size = np.linalg.norm(rate)
    if size == 0:
        return 'rest'
    face, off = nearest_face(rate)
    about = f'{face} ' if off < _CONE_DEG else ''
    return f'turn {about}{np.degrees(size):.4g} deg/s'


def refuse_missing_axes(names: Iterable[str], option: str, notes: Iterable[str] = ()) -> None:
    """Raise InputError where an axis was not turned, or one way only and there is no rest."""
    seen = {n.split()[1][1] for n in names if n.startswith('turn')}
    missing = [k for k in 'xyz' if k not in seen]
    if missing:
        raise InputError(f'no turn about {", ".join(missing)} found{because(notes)}',
                         f'turn about each axis, both ways, from rest to rest; check --{option}')
    one_way = [k for k in 'xyz' for s in '+-' if f'turn {s}{k}' not in names]
    if one_way and 'rest' not in names:
        raise InputError(f'{", ".join(one_way)} is turned one way only, and there is no rest',
                         'turn each axis both ways, or record a rest: scale and bias look the '
                         'same otherwise')


def _with_earth(poses: Poses, latitude, notes):
    up = poses.force / np.linalg.norm(poses.force, axis=0)
    if latitude is None or not np.isfinite(up).all():
        notes.append('the Earth\'s rate (at most 15.04 deg/h, 7.3e-05 rad/s) stays in the bias'
                     + ('' if latitude is None else ': which way is up is not known'))
        return poses, tuple(notes)
    vertical = EARTH_RATE * np.sin(np.radians(latitude))
    inputs = poses.inputs + vertical * up * poses.amount
    notes.append(f'the vertical part of the Earth\'s rate ({np.degrees(vertical) * 3600:.2f} '
                 f'deg/h) is in the inputs; its '
                 'horizontal part averages out in whole turns and stays in the bias at rest')
    return poses.with_inputs(inputs), tuple(notes)
