# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""From a record to poses of the accelerometer: rests, which way is up, standard errors."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import chdtri

from .poses import aims, angle_deg, FACES, nearest_face, Poses, unit
from ..core.clipped import stays
from ..core.disturbed import calm
from ..core.errors import InputError, listed
from ..core.record import ImuRecord
from ..core.statistics import grid_step, in_a_row, median_sigma
from ..core.stillness import LEAST, still_stretches
from ..core.units import A_COUNT

STILL_S = 0.8           # shortest rest that counts, s: one of a second, less its ends
CONE_DEG = 20.0         # a pose within this of an axis is a face
_APART_DEG = 10.0       # poses closer than this point in one direction
_SAME_DEG = 0.5         # rests closer than this, one after the other, are one placement
_PIECE_S = 0.5           # shortest part of a rest between knocks
_SHORT_S = 0.4          # shortest rest that is spoken of
_LONG_S = 2.0           # a rest of which views of a second see the most
_PICKED_UP = np.radians(5.0)        # a knock turns it by less, putting it down anew by more
_BLOCK_S = 0.5           # shortest part of a rest whose mean is looked at
_BLOCKS = 5             # of a rest: what swings, swings out in it as it does in such a part
_MEANS = 25             # of all rests, from which their variance is known
_CLIPPED = 0.02         # a larger share of a rest at the end of the range spoils its mean
_RULE = 8               # rests of which one can stand out
_CREEPS = chdtri(3, 1e-6)       # chi-squared of the rate in a rest, three axes
_ALIKE = chdtri(3, 0.01)        # the same of two rests at one rate: no two hands creep alike
_LISTED = 4             # poses that a message lists
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
        """Return the indices of the samples that are used, (k,) int."""
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
    return _rested(record, seconds)[0]


def _rested(record, seconds) -> tuple[list[Rest], str]:
    """Return the rests, and what is said of those that are too short; raise where none counts."""
    found, short = _placements(record, seconds)
    said = _short_in_words(short, seconds)
    if not found:
        raise InputError(f'no rest of {seconds:g} s: {said or "it moves all the time"}',
                         'hold every pose still, for some seconds, on something solid')
    return found, said


def _placements(record, seconds) -> tuple[list[Rest], list[tuple[float, float]]]:
    """Return the rests that are long enough, and (time, length) of those that are not, s."""
    if record.accel is None:
        raise InputError(f'{record.path or "the record"} has no accelerometer',
                         'which way is up is read from it').after(*record.warnings)
    found: list[Rest] = []
    step = grid_steps(record.accel)
    for a, b in _stretches(record, min(seconds, _PIECE_S)):
        pieces, note = _between_knocks(record, a, b, step)
        here = _rest(record, pieces, note)
        if found and angle_deg(found[-1].accel, here.accel) < _SAME_DEG and not _picked_up(
                record, found[-1], here):
            note = f'a knock at {record.t[found[-1].end - 1]:.1f} s was left out'
            here = _rest(record, (*found.pop().pieces, *pieces), note)
        found.append(here)
    # to a hundredth: the rate of the stamps is never quite the nominal one
    long = [round(len(r.samples()) / record.rate_hz, 2) for r in found]
    short = [(float(record.t[r.begin]), n) for r, n in zip(found, long) if n < seconds]
    return [r for r, n in zip(found, long) if n >= seconds], short


def too_short(record: ImuRecord, seconds: float = STILL_S) -> str:
    """Say which rests of a record are too short and what takes them; an empty string for none."""
    return _short_in_words(_placements(record, seconds)[1], seconds)


def _short_in_words(short: list[tuple[float, float]], seconds: float) -> str:
    if not short:
        return ''
    said = listed([f'{n:.1f} s at {t:.1f} s' for t, n in short], _LISTED)
    enough = [n for _, n in short if n >= _PIECE_S]
    if enough:
        least = max(_PIECE_S, np.floor(10 * min(enough)) / 10)
        some = 'it' if len(short) == 1 else 'them all' if len(enough) == len(short) else (
            f'{len(enough)} of them')
        way = f'--still {least:.1f} takes {some}'
    else:
        way = f'hold poses longer: --still takes none under {_PIECE_S:g} s'
    which = f'{len(short)} rests under {seconds:g} s are' if len(short) > 1 else (
        f'1 rest under {seconds:g} s is')
    return f'{which} too short to count: {said}; {way}'


def _stretches(record, seconds) -> list[tuple[int, int]]:
    """
    Return the stretches at rest, those too that views of a second are too long to see.

    Between the rests of :func:`~imu_noise_tools.core.stillness.still_stretches` half-second
    windows of tenths are looked at.

    """
    found = still_stretches(record, seconds)
    tenth = max(2, round(0.1 * record.rate_hz))
    quiet = _quiet_tenths(record, tenth, found)
    edges = in_a_row(quiet)
    least = _SHORT_S * record.rate_hz
    fine = [(i * tenth, min(j * tenth, record.n)) for i, j in edges.tolist()
            if (j - i) * tenth >= least]
    # a long rest is as it was found: what touches it is its end, where a hand is on it
    long = [(a, b) for a, b in found if b - a >= _LONG_S * record.rate_hz]
    fine = [f for f in fine if not _touch(f, long, 2 * tenth)]
    return sorted([*long, *fine, *(f for f in found if f not in long and not _touch(f, fine, 0))])


def _touch(one, others, near) -> bool:
    return any(a < one[1] + near and one[0] - near < b for a, b in others)


def _quiet_tenths(record, tenth, found) -> np.ndarray:
    """Tell of every tenth of a second whether a half-second around it is at rest."""
    n, view = record.n // tenth, 5
    quiet = np.zeros(n, bool)
    if n < view or record.gyro is None:
        return quiet                    # what turns slowly is at rest to an accelerometer
    still = np.ones(n - view + 1, bool)
    for sensor, least in LEAST.items():
        data = np.asarray(getattr(record, sensor))[:n * tenth].reshape(n, tenth, 3)
        means = data.mean(1)
        noise = np.median(data.std(1), axis=0) / np.sqrt(tenth)
        if found:
            noise = np.median([data[a // tenth:max(a // tenth + 1, b // tenth)].std(1).mean(0)
                               for a, b in found], axis=0) / np.sqrt(tenth)
        views = np.lib.stride_tricks.sliding_window_view(means, view, axis=0)
        still &= (np.ptp(views, axis=2) < np.maximum(least, 8 * noise)).all(1)
        if sensor == 'gyro':
            bias = np.median([means[a // tenth:b // tenth + 1].mean(0) for a, b in found],
                             axis=0) if found else np.zeros(3)
            still &= np.linalg.norm(views.mean(2) - bias, axis=1) < _TURNING / 4
    for k in range(view):
        quiet[k:k + len(still)] |= still
    return quiet


def _picked_up(record, before: Rest, after: Rest) -> bool:
    """Tell whether it was turned and put back between two rests, rather than knocked."""
    if record.gyro is None:
        return False
    between = slice(before.end, after.begin)
    rate = np.asarray(record.gyro)[between] - before.gyro
    angle = np.cumsum(rate, axis=0) * record.dt
    return bool(len(angle) and np.max(np.linalg.norm(angle, axis=1)) > _PICKED_UP)


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


def rest_of_samples(record: ImuRecord, begin: int, end: int) -> Rest:
    """Return the rest that these samples of a record are."""
    return _rest(record, ((begin, end),), '')


def _rest(record, pieces, note):
    index = np.concatenate([np.arange(a, b) for a, b in pieces])
    gyro = None if record.gyro is None else record.gyro[index].mean(0)
    return Rest(tuple(pieces), record.accel[index].mean(0), gyro, note)


def grid_steps(data: Any) -> np.ndarray:
    """Return the step of each axis's output, (3,), of samples (n, 3); 0 where there is none."""
    return np.array([grid_step(x[np.isfinite(x)])[0] for x in np.asarray(data, float).T])


def _between_knocks(record: ImuRecord, a: int, b: int, step: np.ndarray
                    ) -> tuple[list[tuple[int, int]], str]:
    """Return the pieces of a rest between its knocks, and a note."""
    data = np.asarray(record.accel)[a:b]
    pieces = [(a + p, a + q) for p, q in calm(data, record.rate_hz, step)]
    if pieces == [(a, b)]:
        return pieces, ''
    knock = pieces[0][1] if pieces[0][0] == a else a
    return pieces, f'a knock at {record.t[knock]:.1f} s was left out'


def held(record: ImuRecord, found: list[Rest]) -> tuple[list[Rest], list[str]]:
    """
    Return the rests in which nothing turned, and a note on those in which something did.

    A hand that holds a pose creeps: its rate stands out from that of the other rests, by more
    than their noise and their own scatter (median) make. Of few rests none is the rule. Two
    in a row that stand out alike are no hand: the bias went there.

    """
    if record.gyro is None or len(found) < _RULE:
        return found, []
    gyro = np.asarray(record.gyro, float)
    off = means_of(gyro, found)
    off -= np.median(off, axis=0)
    size2 = standard_errors(gyro, found, record.rate_hz).T ** 2 + median_sigma(off, axis=0) ** 2
    creeps = np.sum(off ** 2 / size2, axis=1) > _CREEPS
    same = np.sum(np.diff(off, axis=0) ** 2 / (size2[1:] + size2[:-1]), axis=1) < _ALIKE
    same &= creeps[1:] & creeps[:-1]
    creeps &= ~(np.append(same, False) | np.append(False, same))
    said = [f'{np.degrees(np.linalg.norm(v)):.2f} deg/s at {record.t[r.begin]:.0f} s'
            for r, v, c in zip(found, off, creeps) if c]
    note = f'rests that still turn are no ends of turns: {listed(said, _LISTED)}'
    return [r for r, c in zip(found, creeps) if not c], [note] if said else []


def standard_errors(data: np.ndarray, found: list[Rest], rate_hz: float) -> np.ndarray:
    """
    Return the standard error of each rest's mean, (3, rests), from means of fifths of a rest.

    No shorter than half a second. In longer parts a tremor averages out, and what wanders shows
    (batch means). Their variance is pooled over the rests (one sensor, one noise), so that a short
    rest is not judged by two or three numbers; a rest that scatters by more than three times the
    others does not count. What the step of the output hides comes to it (:func:`hidden`).

    """
    return np.sqrt(scatter_errors(data, found, rate_hz) ** 2 + hidden(data, found)[:, None] ** 2)


def scatter_errors(data: np.ndarray, found: list[Rest], rate_hz: float) -> np.ndarray:
    """Return the part of :func:`standard_errors` that a longer rest makes smaller, (3, rests)."""
    middle = np.median([len(r.samples()) for r in found])
    parts = max(_BLOCKS, _MEANS / len(found))
    block = max(2, round(_BLOCK_S * rate_hz), int(middle / parts))
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


def hidden(data: np.ndarray, found: list[Rest]) -> np.ndarray:
    """
    Return the standard error that the step of the output leaves in a mean, (3,), however long.

    LSB/sqrt(12) where the noise is far below the step, and exp(-(2 pi sigma / LSB)^2) of its
    square where noise dithers (Widrow and Kollar 2008, chapter 9: the largest term of the mean's
    error). An output that is constant at rest shows its step while it moves.

    """
    out = np.zeros(3)
    index = np.concatenate([r.samples() for r in found])
    steps = grid_steps(data[index])
    for k in range(3):
        step = steps[k] or grid_step(data[np.isfinite(data[:, k]), k])[0]
        if step > 0:
            seen = np.median([data[r.samples(), k].var() for r in found])
            sigma = np.sqrt(max(0.0, seen - step ** 2 / 12))
            out[k] = step / np.sqrt(12) * np.exp(-0.5 * (2 * np.pi * sigma / step) ** 2)
    return out


def coarse(sensor: str, data: np.ndarray, found: list[Rest], rate_hz: float) -> list[str]:
    """
    Say whose resolution limits the means at rest: it hides more than their noise does.

    Of samples ``data`` (n, 3), m/s^2 or rad/s, and the rests found in them.

    """
    least = hidden(data, found)
    limits = least > np.median(scatter_errors(data, found, rate_hz), axis=1)
    if not limits.any():
        return []
    unit_ = 'm/s^2' if sensor == 'accel' else 'rad/s'
    step = max(grid_step(data[np.isfinite(data[:, k]), k])[0] for k in np.flatnonzero(limits))
    names = ', '.join(f'{sensor}_{a}' for a, one in zip('xyz', limits) if one)
    return [f'the resolution of {names} ({step:.2g} {unit_}) limits: the noise is too small to '
            f'average it out, a mean at rest is off by {least.max():.1g} {unit_} rms, however '
            'long it is held']


def _refuse_saturated(record, found, names) -> None:
    """Raise InputError where an axis stands at the end of its range in a rest."""
    accel = np.asarray(record.accel)
    for k, axis in enumerate('xyz'):
        step, _ = grid_step(accel[:, k])
        sigma = np.median([accel[r.samples(), k].std() for r in found])
        at_end = stays(accel[:, k])
        if step > 2 * sigma or not at_end.any():
            continue                    # a level that is held is no end of the range
        for r, name in zip(found, names):
            share = at_end[r.samples()].mean()
            if share > _CLIPPED:
                raise InputError(
                    f'{name} at {record.t[r.begin]:.0f} s: accel_{axis} is saturated at '
                    f'{np.median(accel[r.samples(), k]):.4g} m/s^2 ({100 * share:.0f} % of the '
                    'samples at the end of its range)', 'set a larger range and record again')


def positions(record: ImuRecord, gravity: float, seconds: float = STILL_S
              ) -> tuple[Poses, tuple[str, ...]]:
    """
    Return the accelerometer's poses of a record, of unknown direction yet, and notes for people.

    Raises
    ------
    InputError
        No accelerometer, no rest, or readings that are not m/s^2.

    """
    found, short = _rested(record, seconds)
    outputs = np.array([r.accel for r in found]).T
    check_unit(outputs, gravity)
    poses = Poses.of(
        'accel', outputs, standard_errors(np.asarray(record.accel), found, record.rate_hz),
        gravity, temperature=temperatures(record, found),
        time=[record.t[r.samples()].mean() for r in found])
    _refuse_saturated(record, found, poses.names)
    said = [short] if short else []
    said += [f'{poses.names[k]}: {r.note}' for k, r in enumerate(found) if r.note]
    said += coarse('accel', np.asarray(record.accel, float), found, record.rate_hz)
    return poses, tuple(said)


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
    pieces, note = _between_knocks(record, 0, record.n, grid_steps(record.accel))
    found = [_rest(record, pieces, note)]
    outputs = found[0].accel[:, None]
    check_unit(outputs, gravity)
    std = standard_errors(np.asarray(record.accel), found, record.rate_hz)
    return Poses.of('accel', outputs, std, gravity, temperature=temperatures(record, found),
                    time=[record.t.mean()])


def means_of(x: np.ndarray, found: list[Rest]) -> np.ndarray:
    """Return the mean (rests, 3) of samples (n, 3) in each rest."""
    return np.array([x[r.samples()].mean(0) for r in found])


def temperatures(record: ImuRecord, found: list[Rest]) -> Any:
    """Return the mean temperature of each rest, or None where none was recorded."""
    t = record.covariates.get('temperature')
    return None if t is None else np.array([t[r.samples()].mean() for r in found])


def check_unit(outputs: np.ndarray, gravity: float) -> None:
    """Raise InputError where readings at rest (3, n) cannot be m/s^2, as gravity is."""
    size = float(np.median(np.linalg.norm(outputs, axis=0)))
    if 0.7 < size / gravity < 1.3:
        return
    if 0.7 < size < 1.3:
        raise InputError(f'the accelerometer reads {size:.3g} at rest: that is g, not m/s^2',
                         'give --accel-unit g')
    if 700 < size < 1300:
        raise InputError(f'the accelerometer reads {size:.4g} at rest: that is mg, not m/s^2',
                         'give --accel-unit mg')
    reads = f'the accelerometer reads {size:.4g} at rest, not {gravity:.4g} m/s^2'
    if size < 0.7:
        raise InputError(f'{reads}: gravity may have been removed',
                         'record the topic of the raw accelerations')
    raise InputError(f'{reads}: raw counts?', 'say what one is by the data sheet of the sensor, '
                     f'e.g. --accel-unit {A_COUNT["accel"]}')


def named(poses: Poses) -> Poses:
    """
    Return the poses, those that are faces with their names and nominal inputs.

    A pose is a face when its direction lies within a cone (CONE_DEG) about an axis, whatever its
    distance from g.

    """
    found = [nearest_face(o) for o in poses.outputs.T]
    names = tuple(face if angle <= CONE_DEG else poses.names[k]
                  for k, (face, angle) in enumerate(found))
    return replace(poses, inputs=poses.magnitude * aims(names), names=names)


def faced(poses: Poses) -> tuple[Poses, tuple[str, ...]]:
    """Return the poses that are faces, as :func:`named` names them, and notes on the others."""
    found = [nearest_face(o) for o in poses.outputs.T]
    off = [(angle, f'{name} ({angle:.0f} deg from {face})')
           for name, (face, angle) in zip(poses.names, found)]
    away = [said for angle, said in off if angle > CONE_DEG]
    doubtful = [said for angle, said in off if CONE_DEG / 2 < angle <= CONE_DEG]
    notes = [f'left out as no face: {listed(away, _LISTED)}'] if away else []
    notes += [f'off their faces: {listed(doubtful, _LISTED)}'] if doubtful else []
    keep = [k for k, (angle, _) in enumerate(off) if angle <= CONE_DEG]
    return named(poses).take(np.array(keep, int)), tuple(notes)


def because(notes: Iterable[str]) -> str:
    """Return what a refusal of poses ends with: what was found out about them before."""
    said = '; '.join(list(notes)[:4])
    return f' ({said})' if said else ''


def counted(names: Iterable[str]) -> dict[str, int]:
    """Return how often each of the six faces was seen, in their order."""
    names = list(names)
    return {face: sum(n == face for n in names) for face in FACES}


def spread(poses: Poses) -> int:
    """Return how many poses point in different directions, at least _APART_DEG apart."""
    chosen: list[np.ndarray] = []
    for u in unit(poses.outputs).T:
        if all(angle_deg(u, v) > _APART_DEG for v in chosen):
            chosen.append(u)
    return len(chosen)
