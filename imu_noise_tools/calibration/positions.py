# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""From a record to poses of the accelerometer: rests, which way is up, standard errors."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .poses import DIRECTIONS, FACES, nearest_face, Poses, unit
from ..core.disturbed import calm
from ..core.errors import InputError
from ..core.record import ImuRecord
from ..core.stillness import LEAST, still_stretches

STILL_S = 2.0           # shortest rest that counts, s
CONE_DEG = 20.0         # a pose within this of an axis is a face
_SAME_DEG = 0.5         # rests closer than this, one after the other, are one placement
_PIECE_S = 0.5           # shortest part of a rest between knocks
_BLOCK_S = 0.5
_TURNING = 0.2          # rad/s: more than the bias of any gyroscope of today


@dataclass(frozen=True)
class Rest:
    """One placement: the sample ranges used, mean output of each sensor, what happened."""

    pieces: tuple[tuple[int, int], ...]
    accel: np.ndarray
    gyro: np.ndarray | None
    note: str = ''

    @property
    def begin(self) -> int:
        """First sample."""
        return self.pieces[0][0]

    @property
    def end(self) -> int:
        """One past the last sample."""
        return self.pieces[-1][1]

    def samples(self) -> np.ndarray:
        """Return the indices that are used."""
        return np.concatenate([np.arange(a, b) for a, b in self.pieces])


def rests(record: ImuRecord, seconds: float = STILL_S) -> list[Rest]:
    """
    Return the placements of a record in order.

    Rests between which nothing turned are one: there was a knock between.

    Raises
    ------
    InputError
        There is no accelerometer, or no rest of that length.

    """
    if record.accel is None:
        raise InputError(f'{record.path or "the record"} has no accelerometer',
                         'which way is up is read from it')
    found: list[Rest] = []
    for a, b in still_stretches(record, min(seconds, _PIECE_S)):
        pieces, note = _between_knocks(record, a, b)
        here = _rest(record, pieces, note)
        if found and _angle_deg(found[-1].accel, here.accel) < _SAME_DEG:
            note = f'a knock at {record.t[found[-1].end - 1]:.1f} s was left out'
            here = _rest(record, (*found.pop().pieces, *pieces), note)
        found.append(here)
    found = [r for r in found if len(r.samples()) >= seconds * record.rate_hz]
    if not found:
        raise InputError(f'no rest of {seconds:g} s: it moves all the time',
                         'hold every pose still, for some seconds, on something solid')
    return found


def still_until_now(record: ImuRecord, seconds: float = STILL_S, most: float = 30.0) -> int | None:
    """
    Return the first sample from which nothing has moved up to the end, within ``most`` s.

    None where the last ``seconds`` are not still: means over a tenth of a second spread by more
    than a sensor's do at rest, or it turns.

    """
    least = round(seconds * record.rate_hz)
    if record.n < least:
        return None
    begin = None
    for k in range(2, 1 + int(2 * most / seconds)):
        part = record.part(max(0, record.n - k * least // 2), record.n)
        if not _still(part):
            break
        begin = record.n - part.n
        if not begin:
            break
    return begin


def _still(part: ImuRecord) -> bool:
    piece = max(2, round(0.1 * part.rate_hz))
    n = part.n // piece
    for sensor, least in LEAST.items():
        data = getattr(part, sensor)
        if data is None:
            continue
        cut = data[-n * piece:].reshape(n, piece, 3)
        noise = np.median(cut.std(1), axis=0) / np.sqrt(piece)
        if (np.ptp(cut.mean(1), axis=0) > np.maximum(least, 8 * noise)).any():
            return False
        if sensor == 'gyro' and np.linalg.norm(data.mean(0)) > _TURNING:
            return False
    return True


def _rest(record, pieces, note):
    index = np.concatenate([np.arange(a, b) for a, b in pieces])
    gyro = None if record.gyro is None else record.gyro[index].mean(0)
    return Rest(tuple(pieces), record.accel[index].mean(0), gyro, note)


def _between_knocks(record: ImuRecord, a: int, b: int) -> tuple[list[tuple[int, int]], str]:
    """Return the pieces of a rest between its knocks, and a note."""
    pieces = [(a + p, a + q) for p, q in calm(np.asarray(record.accel)[a:b], record.rate_hz)]
    if pieces == [(a, b)]:
        return pieces, ''
    knock = pieces[0][1] if pieces[0][0] == a else a
    return pieces, f'a knock at {record.t[knock]:.1f} s was left out'


def _angle_deg(a, b) -> float:
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))


def standard_errors(data: np.ndarray, found: list[Rest], rate_hz: float) -> np.ndarray:
    """
    Return the standard error of each rest's mean, (3, rests), from half-second means.

    The variance of these means is pooled over the rests (one sensor, one noise), so that a short
    rest is not judged by two or three numbers; a rest that scatters by more than three times the
    others does not count.

    """
    block = max(2, round(_BLOCK_S * rate_hz))
    variances, weights = [], []
    for rest in found:
        means = [data[p + k * block:p + (k + 1) * block].mean(0)
                 for p, q in rest.pieces for k in range((q - p) // block)]
        if len(means) > 1:
            variances.append(np.var(means, axis=0, ddof=1))
            weights.append(len(means) - 1)
    if variances:
        v, w = np.array(variances), np.array(weights, float)[:, None]
        w = w * (v <= 9 * np.median(v, axis=0))
        pooled = (w * v).sum(0) / w.sum(0)
    else:
        pooled = np.mean([data[r.samples()].var(0) for r in found], axis=0) / block
    floor = (1e-9 * np.abs(data).max()) ** 2
    blocks = np.array([len(r.samples()) / block for r in found])
    return np.sqrt(np.maximum(pooled, floor)[:, None] / blocks)


def positions(record: ImuRecord, gravity: float, seconds: float = STILL_S,
              any_unit: bool = False) -> tuple[Poses, tuple[str, ...]]:
    """
    Return the accelerometer's poses of a record, of unknown direction yet, and notes for people.

    Raises
    ------
    InputError
        No accelerometer, no rest, or readings that are not m/s^2.

    """
    found = rests(record, seconds)
    outputs = np.array([r.accel for r in found]).T
    if not any_unit:
        check_unit(outputs, gravity)
    poses = Poses.of(
        'accel', outputs, standard_errors(np.asarray(record.accel), found, record.rate_hz),
        gravity, temperature=temperatures(record, found),
        time=[record.t[r.samples()].mean() for r in found])
    return poses, tuple(f'{poses.names[k]}: {r.note}' for k, r in enumerate(found) if r.note)


def pooled_errors(windows: list[np.ndarray], rate_hz: float) -> np.ndarray:
    """Return :func:`standard_errors` of rests that are given as samples, (n, 3) each."""
    ends = np.cumsum([0] + [len(w) for w in windows])
    found = [Rest(((a, b),), np.zeros(3), None) for a, b in zip(ends[:-1], ends[1:])]
    return standard_errors(np.concatenate(windows), found, rate_hz)


def averaged(record: ImuRecord, gravity: float) -> Poses:
    """
    Return a record that is still from beginning to end as one pose, knocks left out.

    Refuses a wrong unit.

    """
    pieces, note = _between_knocks(record, 0, record.n)
    found = [_rest(record, pieces, note)]
    outputs = found[0].accel[:, None]
    check_unit(outputs, gravity)
    std = standard_errors(np.asarray(record.accel), found, record.rate_hz)
    return Poses.of('accel', outputs, std, gravity, temperature=temperatures(record, found),
                    time=[record.t.mean()])


def temperatures(record: ImuRecord, found: list[Rest]) -> Any:
    """Return the mean temperature of each rest, or None where none was recorded."""
    t = record.covariates.get('temperature')
    return None if t is None else np.array([t[r.samples()].mean() for r in found])


def check_unit(outputs: np.ndarray, gravity: float) -> None:
    """Raise InputError where readings at rest cannot be m/s^2."""
    size = float(np.median(np.linalg.norm(outputs, axis=0)))
    if 0.7 < size / gravity < 1.3:
        return
    if 0.7 < size < 1.3:
        raise InputError(f'the accelerometer reads {size:.3g} at rest: that is g, not m/s^2',
                         'give --accel-unit g')
    if 700 < size < 1300:
        raise InputError(f'the accelerometer reads {size:.4g} at rest: that is mg, not m/s^2',
                         'give --accel-unit mg')
    raise InputError(f'the accelerometer reads {size:.4g} at rest, not {gravity:.4g} m/s^2: '
                     f'counts?',
                     'convert with the nominal scale of the data sheet first')


def named(poses: Poses, cone_deg: float = CONE_DEG) -> Poses:
    """
    Return the poses, those that are faces with their names and nominal inputs.

    A pose is a face when its direction lies within a cone about an axis, whatever its distance
    from g.

    """
    found = [nearest_face(o) for o in poses.outputs.T]
    names = tuple(face if angle <= cone_deg else poses.names[k]
                  for k, (face, angle) in enumerate(found))
    none = np.full(3, np.nan)
    aims = np.array([DIRECTIONS.get(n, none) for n in names]).reshape(-1, 3).T
    return replace(poses, inputs=poses.magnitude * aims, names=names)


def faced(poses: Poses, cone_deg: float = CONE_DEG) -> tuple[Poses, tuple[str, ...]]:
    """Return the poses that are faces, as :func:`named` names them, and notes on the others."""
    found = [nearest_face(o) for o in poses.outputs.T]
    off = [(angle, f'{name} ({angle:.0f} deg from {face})')
           for name, (face, angle) in zip(poses.names, found)]
    away = [said for angle, said in off if angle > cone_deg]
    doubtful = [said for angle, said in off if cone_deg / 2 < angle <= cone_deg]
    notes = [f'left out as no face: {_some(away)}'] if away else []
    notes += [f'off their faces: {_some(doubtful)}'] if doubtful else []
    keep = [k for k, (angle, _) in enumerate(off) if angle <= cone_deg]
    return named(poses, cone_deg).take(np.array(keep, int)), tuple(notes)


def _some(items, most: int = 4) -> str:
    more = f' and {len(items) - most} more' if len(items) > most else ''
    return ', '.join(items[:most]) + more


def counted(names: Iterable[str]) -> dict[str, int]:
    """Return how often each of the six faces was seen, in their order."""
    names = list(names)
    return {face: sum(n == face for n in names) for face in FACES}


def spread(poses: Poses, apart_deg: float = 10.0) -> int:
    """Return how many poses point in different directions, at least this far apart."""
    chosen: list[np.ndarray] = []
    for u in unit(poses.outputs).T:
        if all(_angle_deg(u, v) > apart_deg for v in chosen):
            chosen.append(u)
    return len(chosen)
