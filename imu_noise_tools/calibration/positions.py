"""From a record to poses of the accelerometer: where it rests, which way is up, and how well the mean is known."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..errors import InputError
from ..record import ImuRecord
from .poses import DIRECTIONS, FACES, nearest_face, Poses, unit

STILL_S = 2.0           # shortest rest that counts, s
CONE_DEG = 20.0         # a pose within this of an axis is a face
_SAME_DEG = 0.5         # rests closer than this, one after the other, are one placement
_PIECE_S = 0.5           # shortest part of a rest between knocks
_BLOCK_S = 0.5
_KNOCK = 8.0            # a piece of a rest off by this many standard errors is a knock
_MOVING_RATE, _MOVING_FORCE = 0.1, 0.6      # rad/s, m/s^2: scatter no IMU has at rest


@dataclass(frozen=True)
class Rest:
    """One placement: sample ranges that are used, mean output of each sensor, and what happened."""

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


def stillness(record: ImuRecord, seconds: float = STILL_S) -> list[tuple[int, int]]:
    """
    Return sample ranges in which nothing moves, at least this long.

    A tenth of a second is still where every axis scatters by less than four times its own quiet level; both
    sensors have a say.

    """
    block = max(4, round(0.1 * record.rate_hz))
    n = record.n // block
    if not n:
        return []
    still = np.ones(n, bool)
    for data, most in ((record.gyro, _MOVING_RATE), (record.accel, _MOVING_FORCE)):
        if data is None:
            continue
        cut = data[:n * block].reshape(n, block, 3)
        scatter, middle = cut.std(1), cut.mean(1)
        quiet = np.minimum(np.percentile(scatter, 20, axis=0), most)
        step = np.abs(np.diff(middle, axis=0, prepend=middle[:1]))
        still &= (scatter < 4 * quiet + 1e-12).all(1)
        still &= (step < 6 * quiet + 1e-12).all(1)
    edges = np.flatnonzero(np.diff(np.r_[0, still.astype(int), 0])).reshape(-1, 2)
    return [(a * block, b * block) for a, b in edges if (b - a) * block >= seconds * record.rate_hz]


def rests(record: ImuRecord, seconds: float = STILL_S) -> list[Rest]:
    """
    Return the placements of a record in order; rests between which nothing turned are one (a knock between).

    Raises
    ------
    InputError
        There is no accelerometer, or no rest of that length.

    """
    if record.accel is None:
        raise InputError(f'{record.path or "the record"} has no accelerometer', 'which way is up is read from it')
    found: list[Rest] = []
    for a, b in stillness(record, min(seconds, _PIECE_S)):
        pieces, note = _without_knocks(record, a, b)
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


def _rest(record, pieces, note):
    index = np.concatenate([np.arange(a, b) for a, b in pieces])
    gyro = None if record.gyro is None else record.gyro[index].mean(0)
    return Rest(tuple(pieces), record.accel[index].mean(0), gyro, note)


def _without_knocks(record, a, b):
    """Return the pieces of a rest between its knocks, and a note."""
    block = max(2, round(0.1 * record.rate_hz))
    n = (b - a) // block
    cut = record.accel[a:a + n * block].reshape(n, block, 3)
    middle, centre = cut.mean(1), np.median(cut.mean(1), axis=0)
    scale = 1.4826 * np.median(np.abs(middle - centre), axis=0)
    spread = 1.4826 * np.median(np.abs(cut.std(1) - np.median(cut.std(1), axis=0)), axis=0)
    bad = ((np.abs(middle - centre) > _KNOCK * scale + 1e-12)
           | (cut.std(1) - np.median(cut.std(1), axis=0) > _KNOCK * spread + 1e-12)).any(1)
    if not bad.any() or bad.mean() > 0.2:
        return [(a, b)], ''
    edges = np.flatnonzero(np.diff(np.r_[0, (~bad).astype(int), 0])).reshape(-1, 2)
    pieces = [(a + p * block, a + q * block if q < n else b) for p, q in edges]
    return pieces, f'a knock at {record.t[a + int(np.argmax(bad)) * block]:.1f} s was left out'


def _angle_deg(a, b) -> float:
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))


def standard_errors(data: np.ndarray, found: list[Rest], rate_hz: float) -> np.ndarray:
    """
    Return the standard error of each rest's mean, (3, rests), from the scatter of half-second means.

    The variance of these means is pooled over the rests (one sensor, one noise), so that a short rest is not
    judged by two or three numbers; a rest that scatters by more than three times the others does not count.

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
        'accel', outputs, standard_errors(record.accel, found, record.rate_hz), gravity,
        temperature=temperatures(record, found), time=[record.t[r.samples()].mean() for r in found])
    return poses, tuple(f'{poses.names[k]}: {r.note}' for k, r in enumerate(found) if r.note)


def temperatures(record: ImuRecord, found: list[Rest]):
    """Return the mean temperature of each rest, or None where none was recorded."""
    t = record.covariates.get('temperature')
    return None if t is None else np.array([t[r.samples()].mean() for r in found])


def check_unit(outputs: np.ndarray, gravity: float) -> None:
    """Raise InputError where readings at rest cannot be m/s^2."""
    size = float(np.median(np.linalg.norm(outputs, axis=0)))
    if 0.7 < size / gravity < 1.3:
        return
    if 0.7 < size < 1.3:
        raise InputError(f'the accelerometer reads {size:.3g} at rest: that is g, not m/s^2', 'give --accel-unit g')
    if 700 < size < 1300:
        raise InputError(f'the accelerometer reads {size:.4g} at rest: that is mg, not m/s^2',
                         'give --accel-unit mg')
    raise InputError(f'the accelerometer reads {size:.4g} at rest, not {gravity:.4g} m/s^2: counts?',
                     'convert with the nominal scale of the data sheet first')


def faced(poses: Poses, cone_deg: float = CONE_DEG) -> tuple[Poses, tuple[str, ...]]:
    """
    Return the poses that are faces, with their nominal inputs and names, and notes on the others.

    A pose is a face when its direction lies within a cone about an axis, whatever its distance from g.

    """
    keep, names, doubtful, away = [], [], [], []
    for k, o in enumerate(poses.outputs.T):
        face, angle = nearest_face(o)
        if angle > cone_deg:
            away.append(f'{poses.names[k]} ({angle:.0f} deg from {face})')
            continue
        if angle > cone_deg / 2:
            doubtful.append(f'{poses.names[k]} ({angle:.0f} deg from {face})')
        keep.append(k)
        names.append(face)
    notes = [f'left out as no face: {_some(away)}'] if away else []
    notes += [f'off their faces: {_some(doubtful)}'] if doubtful else []
    inputs = poses.magnitude * np.array([DIRECTIONS[f] for f in names]).reshape(-1, 3).T
    some = poses.take(np.array(keep, int))
    return replace(some, inputs=inputs, names=tuple(names)), tuple(notes)


def _some(items, most: int = 4) -> str:
    more = f' and {len(items) - most} more' if len(items) > most else ''
    return ', '.join(items[:most]) + more


def counted(names) -> dict[str, int]:
    """Return how often each of the six faces was seen, in their order."""
    return {face: sum(n == face for n in names) for face in FACES}


def spread(poses: Poses, apart_deg: float = 10.0) -> int:
    """Return how many poses point in different directions, at least this far apart."""
    chosen: list[np.ndarray] = []
    for u in unit(poses.outputs).T:
        if all(_angle_deg(u, v) > apart_deg for v in chosen):
            chosen.append(u)
    return len(chosen)
