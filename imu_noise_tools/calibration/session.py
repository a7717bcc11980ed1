# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A person's session: samples come in, faces are captured when asked, what is left is said."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from . import solve
from .axes import refuse_crossed_axes
from .between import gathered, together, Turns
from .correction import Correction
from .poses import angle_deg, FACES, joined, nearest_face, Poses
from .positions import (
    averaged, CONE_DEG, counted, pooled_errors, Rest, rest_of_samples, still_until_now)
from .problem import CalibrationProblem
from .solution import calibrate, calibrate_turns, Calibration
from .turns import turns
from ..core.errors import FitError, InputError, unknown, UsageError
from ..core.record import ImuRecord
from ..core.units import G0

HOLD_S = 2.0                # how long a person holds a pose before it is captured
_KEEP_S = 120.0             # what is remembered of the stream
_SEEN_S = 30.0              # longest rest that a capture averages
_UNMOVED_DEG = 0.3          # captures of one face closer than this are one placement


@dataclass(frozen=True)
class Captured:
    """What a capture saw: the pose, what is done and what is left; its text is for people."""

    name: str
    done: int
    of: int
    left: tuple[str, ...]
    note: str = ''

    def __str__(self):
        """Return ``held: +x; 5 of 6 done; left: -z``."""
        left = f'left: {", ".join(self.left)}' if self.left else 'none left: solve'
        return f'held: {self.name}; {self.done} of {self.of} done; {left}' + (f' ({self.note})'
                                                                              if self.note else '')


class Session:
    """
    One sensor's calibration as a person makes it.

    Parameters
    ----------
    sensor : str
        ``accel`` or ``gyro``.
    gravity : float
        Local gravity, m/s^2.
    rate, turn : float, optional
        For the gyroscope: rate of the table (rad/s), or angle of a hand turn (rad).
    still_seconds : float
        How long a pose has to be still before it is captured.
    tilt : float
        Tilt of the faces, rad.
    method : str, optional
        ``faces``, ``wls``, ``ols``, ``norm`` or ``few``; chosen from the poses when not given.

    """

    def __init__(self, sensor: str = 'accel', gravity: float = G0, rate: float | None = None,
                 turn: float | None = None, still_seconds: float = HOLD_S,
                 tilt: float = solve.TILT,
                 method: str | None = None):
        if sensor not in ('accel', 'gyro'):
            raise unknown('sensor', sensor, ('accel', 'gyro'))
        if sensor == 'gyro' and (rate is None) == (turn is None):
            raise UsageError('the gyroscope needs a rate or a turn',
                             'set one of rate_deg_s and turn_deg')
        self.sensor, self.gravity, self.rate, self.turn = sensor, gravity, rate, turn
        self.still_seconds, self.tilt, self.method = still_seconds, tilt, method
        self.calibration: Calibration | None = None
        self._samples: deque = deque()
        self._poses: list[Poses] = []
        # accelerometer samples of each face, for the noise of all
        self._windows: list[np.ndarray] = []
        self._since = -np.inf               # stamp from which the next turn counts
        # from each pose to the next, both rests with it: turns of the gyroscope
        self._between: list[tuple[ImuRecord, Rest, Rest]] = []
        self._last: tuple[float, float] | None = None
        self.gyro: Calibration | None = None

    def feed(
        self, stamp_s: float, gyro: Any, accel: Any, temperature: float | None = None
    ) -> None:
        """
        Take one sample: gyro (3,) rad/s, accel (3,) m/s^2, temperature in deg C where it is known.

        One that is not finite or goes back is dropped. The node knows no temperature, which has a
        topic of its own: what a sensor does with it, a recorded session shows.

        """
        values = (*gyro, *accel)
        if not np.isfinite(values).all() or (self._samples and stamp_s <= self._samples[-1][0]):
            return
        if self._samples and stamp_s - self._samples[-1][0] > 1.0:
            # a gap: nothing before it belongs to this pose
            self._samples.clear()
        self._samples.append((stamp_s, *values, np.nan if temperature is None else temperature))
        while stamp_s - self._samples[0][0] > _KEEP_S:
            self._samples.popleft()

    def reset(self) -> None:
        """Forget all poses and the solution; the stream goes on."""
        self._poses.clear()
        self._windows.clear()
        self._between.clear()
        self.calibration = self.gyro = self._last = None
        self._since = -np.inf

    def capture(self, expected: str | None = None) -> Captured:
        """
        Average the still window (or take the turn) that ends now, and say what is left.

        ``expected`` is the face the person says is up: the opposite one means a sign upside down.
        It is for callers from Python; the node's service takes no argument, and says which it saw.

        Raises
        ------
        InputError
            It is moving, there are too few samples, no face is seen, or the reading is impossible;
            nothing is kept.

        """
        record = self._record()
        self._rate_hz = record.rate_hz
        return self._turn(record) if self.sensor == 'gyro' else self._face(record, expected)

    def _record(self) -> ImuRecord:
        data = np.array(self._samples, float).reshape(-1, 8)
        span = data[-1, 0] - data[0, 0] if len(data) > 1 else 0.0
        if len(data) < 20 or span < self.still_seconds:
            raise InputError(f'{span:.1f} s of samples so far, a pose takes '
                             f'{self.still_seconds:g} s',
                             'wait, and check that the Imu topic arrives')
        covariates = {'temperature': data[:, 7]} if np.isfinite(data[:, 7]).all() else {}
        return ImuRecord(data[:, 1:4], data[:, 4:7], data[:, 0], (len(data) - 1) / span,
                         covariates=covariates)

    def _still(self, record: ImuRecord) -> ImuRecord:
        """Return the part of the record in which it has been still until now."""
        begin = still_until_now(record, self.still_seconds, _SEEN_S)
        if begin is None:
            raise InputError(f'moving: not still for the last {self.still_seconds:g} s',
                             'hold it still and capture again')
        return record.part(begin, record.n)

    def _face(self, record, expected) -> Captured:
        still = self._still(record)
        pose = averaged(still, self.gravity)
        face, off = nearest_face(pose.outputs[:, 0])
        if expected and expected not in FACES:
            raise unknown('face', expected, FACES)
        if expected and off <= CONE_DEG and face != expected:
            if face[1] == expected[1]:
                raise InputError(f'{expected} should be up, but {face} reads +g: the sign of '
                                 f'this axis is upside down, '
                                 'or the box is', 'REP-145: +g on the axis that points up; turn '
                                                  'it over, or fix the driver')
            raise InputError(f'{expected} should be up, but {face} is',
                             'turn it and capture again')
        name = face if off <= CONE_DEG else f'pose {len(self._poses) + 1}'
        note = '' if off <= CONE_DEG else f'{off:.0f} deg from {face}: counts for a norm fit only'
        pose = replace(pose, names=(name,))
        if self._poses and angle_deg(
                self._poses[-1].outputs[:, -1], pose.outputs[:, -1]) < _UNMOVED_DEG:
            self._poses.pop()
            self._windows.pop()
            if self._between:
                self._between.pop()
            note = 'not moved since the last capture, which it replaces'
        self._poses.append(pose)
        self._windows.append(np.asarray(still.accel))
        self._keep_turn(record, float(still.t[0]))
        held = counted(self._names())[face] if off <= CONE_DEG else 1
        return self._said(name, note or (f'held {held} times: averaged' if held > 1 else ''))

    def _keep_turn(self, record, begin: float) -> None:
        """Keep what lies between the last capture and this one, where all of it is remembered."""
        if self._last is not None and self._last[0] >= record.t[0]:
            a, b, c = (int(np.searchsorted(record.t, x)) for x in (*self._last, begin))
            some = record.part(a, record.n)
            ends = [rest_of_samples(some, 0, b - a), rest_of_samples(some, c - a, some.n)]
            if ends[0].end <= ends[1].begin:
                self._between.append((some, ends[0], ends[1]))
        self._last = (begin, float(record.t[-1]))

    def _turn(self, record) -> Captured:
        since, rested = record.t[-1] - 1.2 * self.still_seconds, -np.inf
        if self.turn is not None:
            since, rested = self._since, self._still(record).t[0]
        recent = record.part(int(np.searchsorted(record.t, since)), record.n)
        pose = self._by_angle(recent) if self.turn is not None else self._by_rate(recent)
        self._poses.append(pose)
        self._since = rested
        return self._said(pose.names[0], '')

    def _by_rate(self, recent) -> Poses:
        try:
            poses, _ = turns(recent, rate=self.rate, seconds=0.8 * self.still_seconds, partly=True)
        except InputError as error:
            raise InputError(f'moving, but not steadily: {error.message}',
                             'hold the table at its rate and capture again') from error
        return poses.take(poses.n - 1)

    def _by_angle(self, recent) -> Poses:
        poses, notes = turns(recent, turn=self.turn, seconds=min(1.0, self.still_seconds / 2),
                             partly=True)
        turned = [k for k, n in enumerate(poses.names) if n.startswith('turn')]
        other = [n for n in notes if n.endswith('handling')]
        if not turned and other:
            raise InputError(other[-1], 'turn it again about one axis, on a flat table, from '
                                        'rest to rest')
        return poses.take(turned[-1] if turned else poses.n - 1)

    def _names(self) -> list[str]:
        return [p.names[0] for p in self._poses]

    @property
    def wanted(self) -> tuple[str, ...]:
        """Names of the poses that a whole session has."""
        return FACES if self.sensor == 'accel' else tuple(f'turn {f}' for f in FACES)

    @property
    def left(self) -> tuple[str, ...]:
        """Names of the poses not captured yet."""
        return tuple(f for f in self.wanted if f not in self._names())

    def _said(self, name, note) -> Captured:
        return Captured(name, 6 - len(self.left), 6, self.left, note)

    @property
    def poses(self) -> Poses:
        """All poses captured so far; raise InputError where there is none."""
        if not self._poses:
            raise InputError('no pose has been captured', 'hold a face up, still, and capture')
        return joined(self._poses)

    def solve(self) -> Calibration:
        """
        Solve the poses captured so far.

        Raises
        ------
        InputError, FitError
            See :func:`calibrate`; a solution that was there before stays.

        """
        poses = self.poses
        if self._windows:
            poses = replace(poses, std=pooled_errors(self._windows, self._rate_hz))
        self.calibration = calibrate(poses, self.method, self.tilt)
        self.gyro = None
        if self._between:
            self._solve_turns(self.calibration)
        return self.calibration

    def _solve_turns(self, accel: Calibration) -> None:
        """Solve the gyroscope by the turns between captures; say in the notes why not."""
        parts: list[Turns] = []
        for record, a, b in self._between:
            found = gathered(record, [a, b], accel.correction, self.gravity)
            # a rest is the end of one turn and the begin of the next: once is enough
            parts.append(replace(found, rests=found.rests.take(1)) if parts else found)
        every = together(parts)
        refuse_crossed_axes(every)
        try:
            self.gyro = calibrate_turns(every, accel=accel)
        except (InputError, FitError) as error:
            self.calibration = replace(accel, notes=(
                *accel.notes, f'the gyroscope is left out: {error.message}'))

    def solved(self) -> Calibration:
        """Return the solution; raise InputError where there is none."""
        if self.calibration is None:
            left = f' ({", ".join(self.left)} left)' if self.left else ''
            raise InputError(f'not solved yet{left}', 'capture what is left, then solve')
        return self.calibration

    @property
    def problem(self) -> CalibrationProblem:
        """What the loop works on; raise InputError where nothing is solved."""
        return self.solved().problem

    @property
    def corrections(self) -> tuple[Correction, ...]:
        """What corrects samples, the accelerometer's first; nothing before it is solved."""
        return tuple(c.correction for c in (self.calibration, self.gyro) if c is not None)

    def apply(self, gyro: Any, accel: Any, temperature: Any = None) -> tuple[Any, Any]:
        """
        Return (gyro, accel), (3,) or (n, 3) each, what is calibrated corrected.

        Raise InputError where there is nothing to correct by.

        """
        found = self.corrections or (self.solved().correction,)
        return applied(found, gyro, accel, temperature)


def applied(corrections: Iterable[Correction], gyro: Any, accel: Any,
            temperature: Any = None) -> tuple[Any, Any]:
    """Return (gyro, accel), (3,) or (n, 3) each, corrected as they say, in their order."""
    gyro, accel = np.asarray(gyro, float), np.asarray(accel, float)
    for c in corrections:
        if c.sensor == 'accel':
            accel = c.apply(accel, temperature)
        else:       # it may need a calibrated specific force
            gyro = c.apply(gyro, temperature, accel)
    return gyro, accel
