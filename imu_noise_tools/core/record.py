# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""An IMU record as the core sees it: plain arrays in SI, with no trace of where they came from."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import DTypeLike

from .errors import unknown, UsageError

AXES = ('gyro_x', 'gyro_y', 'gyro_z', 'accel_x', 'accel_y', 'accel_z')
SENSORS = ('gyro', 'accel')
MASKED = 'masked'  # why a stretch that a person named is left out
HUGE = 1e30         # no sensor's value in any unit, and its square overflows in sums


def possible(x: np.ndarray) -> np.ndarray:
    """Tell of each value x (...) whether a sensor may give it: it is finite and not absurd."""
    return np.abs(x) < HUGE


def sensor_of(axis: str) -> str:
    """Return ``gyro`` or ``accel`` for an axis; raise UsageError for an unknown axis."""
    if axis not in AXES:
        raise unknown('axis', axis, AXES)
    return axis.partition('_')[0]


class Memory:
    """
    Where arrays as long as a record are kept: here in memory.

    What reads, prepares and looks at records asks it for their place, so that a long record can be
    kept elsewhere (:class:`imu_noise_tools.bag.Scratch`).

    """

    def empty(self, shape: int | tuple[int, ...], dtype: DTypeLike = float) -> np.ndarray:
        """Return a new array of this shape."""
        return np.empty(shape, dtype)

    def keep(self, x: np.ndarray) -> np.ndarray:
        """Return an array, of whatever shape, in its place; here it is there."""
        return x

    def columns(self, n: int) -> np.ndarray:
        """Return a new array (n, 3) whose columns lie in one piece each."""
        return self.empty((3, n)).T

    def rest(self) -> None:
        """Let go of what can be had again; called where a piece of work is done."""


@dataclass(frozen=True)
class Disturbance:
    """
    A stretch of a record in which something happened that the sensor's noise does not do.

    Parameters
    ----------
    begin, end : float
        From when to when, s since the record's ``start`` (the time of ``ImuRecord.t``).
    kind : str
        ``shock`` (short, on several axes), ``disturbed`` (louder for a while), ``motion``
        (handled, then back), ``clipped`` (at the end of the range).
    size : mapping of str to float
        By axis, only those that show it: the largest deviation from the axis's level just before
        and after, rad/s or m/s^2.

    """

    begin: float
    end: float
    kind: str
    size: Mapping[str, float] = field(default_factory=dict)

    @property
    def axes(self) -> tuple[str, ...]:
        """Axes that show it."""
        return tuple(self.size)


@dataclass(frozen=True)
class ImuRecord:
    """
    One stretch of IMU data.

    Parameters
    ----------
    gyro : ndarray (n, 3) or None
        Angular rate, rad/s.
    accel : ndarray (n, 3) or None
        Specific force, m/s^2.
    t : ndarray (n,)
        Seconds since ``start``, from the header stamps, as recorded (not sorted, not resampled).
    rate_hz : float
        (n - 1) / span of the analysed stretch once prepared; the median rate before that.
    start : float
        Stamp of the first sample, s since the epoch; 0 where unknown.
    covariates : mapping of str to ndarray (n,)
        Temperature in degrees Celsius and the like, resampled to ``t``.
    topic, frame_id, path : str
        Where it came from, for people.
    receive_t : ndarray (n,) or None
        Receive (bag) times, s since ``start``: the cross-check of the clock.
    labelled_rate_hz : float or None
        Rate that the file itself states, if it does.
    warnings : tuple of str
        What is doubtful and what was done about it.
    left_out : tuple of (float, float, str)
        Stretches (from, to, why), s since ``start``, that the record holds but the noise fit does
        not use. What a person left out (``why`` holds ``MASKED``) nothing looks at.
    disturbances : tuple of Disturbance
        Everything that was found disturbed, in order of time, set aside (then it is in
        ``left_out`` as well) or not.
    missing : int
        How many of the samples are filled in, because they were lost or not finite.
    stuck : tuple of str
        Axes that never change; they are not among ``axes``.
    beside : tuple of ImuRecord
        Records of sensors that have a clock of their own (a camera's accelerometer, on a topic of
        its own); nothing done to this record is done to them.
    given_rate_hz : float or None
        Rate that somebody gave in place of the stamps: ``t`` counts by it.
    input_unit : mapping of str to str
        By sensor, the unit that the samples came in where somebody said which; they are in SI.

    """

    gyro: np.ndarray | None
    accel: np.ndarray | None
    t: np.ndarray
    rate_hz: float
    start: float = 0.0
    covariates: Mapping[str, np.ndarray] = field(default_factory=dict)
    topic: str = ''
    frame_id: str = ''
    path: str = ''
    receive_t: np.ndarray | None = None
    labelled_rate_hz: float | None = None
    warnings: tuple[str, ...] = ()
    left_out: tuple[tuple[float, float, str], ...] = ()
    disturbances: tuple[Disturbance, ...] = ()
    missing: int = 0
    stuck: tuple[str, ...] = ()
    beside: tuple[ImuRecord, ...] = ()
    given_rate_hz: float | None = None
    input_unit: Mapping[str, str] = field(default_factory=dict)

    @property
    def streams(self) -> tuple[ImuRecord, ...]:
        """This record and those beside it, each for itself."""
        return (replace(self, beside=()), *self.beside) if self.beside else (self,)

    def united(self) -> ImuRecord:
        """
        Return it with what is beside it, interpolated linearly at its own times, and said.

        For what needs both sensors at once; for noise each is taken by itself.

        """
        out = replace(self, beside=())
        for other in self.beside:
            at = (self.start - other.start) + self.t
            for sensor in ('gyro', 'accel'):
                known = getattr(other, sensor)
                if known is None or getattr(out, sensor) is not None:
                    continue
                columns = [np.interp(at, other.t, x) for x in known.T]
                out = replace(out.warned(
                    f'{other.topic or other.path or sensor}: the {sensor} is sampled at other '
                    'times; it was interpolated'), **{sensor: np.stack(columns).T},
                    input_unit={**out.input_unit, **other.input_unit})
        return out

    @property
    def n(self) -> int:
        """Number of samples."""
        return len(self.t)

    @property
    def dt(self) -> float:
        """Sample interval, s."""
        return 1.0 / self.rate_hz

    @property
    def duration_s(self) -> float:
        """Span of the stamps, s."""
        return float(self.t[-1] - self.t[0]) if self.n else 0.0

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the axes that are there, without those that are stuck."""
        return tuple(a for a in self.columns if a not in self.stuck)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the axes that are there, stuck or not."""
        return tuple(a for a in AXES if getattr(self, sensor_of(a)) is not None)

    @property
    def data(self) -> list[np.ndarray]:
        """Rates and accelerations, (n, 3) each, as far as they are there."""
        return [x for x in (self.gyro, self.accel) if x is not None]

    def column(self, axis: str) -> np.ndarray:
        """Return one axis, (n,); raise UsageError where it is not there."""
        data = getattr(self, sensor_of(axis))
        if data is None:
            raise UsageError(f'the record has no {axis}', f'it has {", ".join(self.axes)}')
        return data[:, 'xyz'.index(axis[-1])]

    def part(self, begin: int, end: int) -> ImuRecord:
        """
        Return samples begin to end (views, not copies).

        ``t`` still counts from the same ``start``.

        """
        some = slice(begin, end)
        return replace(
            self, t=self.t[some],
            gyro=None if self.gyro is None else self.gyro[some],
            accel=None if self.accel is None else self.accel[some],
            receive_t=None if self.receive_t is None else self.receive_t[some],
            covariates={k: v[some] for k, v in self.covariates.items()})

    def taken(self, which: np.ndarray, memory: Memory) -> ImuRecord:
        """Return some samples (copies), by mask (n,) or index (k,)."""
        return self.changed(lambda x: x[which], memory)

    def changed(self, change: Callable[[np.ndarray], np.ndarray], memory: Memory) -> ImuRecord:
        """Return a record whose columns are what a function makes of each, (n,) -> (m,)."""

        def new(x: np.ndarray) -> np.ndarray:
            some = change(x if x.ndim == 1 else x[:, 0])
            if x.ndim == 1:
                out = memory.empty(len(some))
                out[:] = some
            else:
                out = memory.columns(len(some))
                for k in range(3):
                    out[:, k] = change(x[:, k]) if k else some
            memory.rest()
            return out

        return replace(
            self,
            t=new(self.t),
            gyro=None if self.gyro is None else new(self.gyro),
            accel=None if self.accel is None else new(self.accel),
            receive_t=None if self.receive_t is None else new(self.receive_t),
            covariates={k: new(v) for k, v in self.covariates.items()},
        )

    def warned(self, *more: str) -> ImuRecord:
        """Return the record with warnings added (each once)."""
        return replace(self, warnings=tuple(dict.fromkeys((*self.warnings, *more))))
