# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""From the messages of a bag to one ImuRecord: gathered, joined, with covariates."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

from .container import Progress
from .decode import ACCEL, ACCEL_COVARIANCE, decode, GYRO, GYRO_COVARIANCE, IMU, VECTOR
from .source import Bag
from .topics import Choice, COVARIATES, covariates_of
from ..core.clock import regular_rate
from ..core.errors import InputError
from ..core.record import ImuRecord, Memory

NS = 1e-9
REST = 1 << 21          # samples after which memory rests


class Columns:
    """Arrays that grow while a bag is read, each column in one piece."""

    def __init__(self, memory: Memory, room: int, **widths: int):
        self.n, self.room, self.memory = 0, max(room, 1024), memory
        self._arrays = {name: self._new(w) for name, w in widths.items()}

    def _new(self, width: int) -> np.ndarray:
        shape = (width, self.room) if width else (self.room,)
        return self.memory.empty(shape, float if width else np.int64)

    def extend(self, **more: np.ndarray) -> None:
        """Append rows to every column."""
        end = self.n + len(next(iter(more.values())))
        if end > self.room:
            self.room = max(end, self.room + self.room // 2)
            for name, old in self._arrays.items():
                self._arrays[name] = self._new(len(old) if old.ndim == 2 else 0)
                self._arrays[name][..., :self.n] = old[..., :self.n]
                self.memory.rest()
        for name, values in more.items():
            self._arrays[name][..., self.n:end] = values.T
        if self.n // REST != end // REST:
            self.memory.rest()
        self.n = end

    def take(self) -> dict[str, np.ndarray]:
        """
        Return the arrays, (n,) or (n, width), cut to size and in order of ``receive``.

        The object is empty afterwards.

        """
        arrays, self._arrays = {k: a[..., :self.n] for k, a in self._arrays.items()}, {}
        receive = arrays['receive']
        if np.any(receive[1:] < receive[:-1]):
            order = np.argsort(receive, kind='stable')
            for a in arrays.values():
                for column in np.atleast_2d(a):
                    column[:] = column[order]
        return {name: a.T for name, a in arrays.items()}


class Part(NamedTuple):
    """One topic as it was read."""

    stamp: np.ndarray           # ns
    receive: np.ndarray         # ns
    gyro: np.ndarray | None
    accel: np.ndarray | None
    frame_id: str


class Reader:
    """Gathers the messages of one topic."""

    def __init__(self, topic: str, type: str, memory: Memory, room: int = 0):
        self.topic, self.type = topic, type
        self.frame_id = ''
        self.unreadable = 0
        self.absent = [True, True]
        if type == IMU:
            self.columns = Columns(memory, room, stamp=0, receive=0, gyro=3, accel=3)
        else:
            width = {VECTOR: 3}.get(type) or len(COVARIATES[type])
            self.columns = Columns(memory, room, stamp=0, receive=0, values=width)

    def add(self, batch) -> None:
        """Decode a batch and keep what is needed of it."""
        found = decode(batch)
        self.unreadable += int(np.sum(~found.readable))
        receive = batch.receive if found.readable.all() else batch.receive[found.readable]
        if self.type == IMU:
            self.absent[0] &= bool(np.all(found.values[:, GYRO_COVARIANCE.start] == -1))
            self.absent[1] &= bool(np.all(found.values[:, ACCEL_COVARIANCE.start] == -1))
            self.columns.extend(stamp=found.stamp, receive=receive, gyro=found.values[:, GYRO],
                                accel=found.values[:, ACCEL])
        else:
            width = len(self.columns._arrays['values'])
            self.columns.extend(stamp=found.stamp, receive=receive, values=found.values[:, :width])
        self.frame_id = self.frame_id or found.frame_id


def _read(
    bag: Bag, wanted: dict[str, str], memory: Memory, progress: Progress = None
) -> dict[str, Reader]:
    """Read topics of given types in one pass."""
    readers = {
        topic: Reader(topic, type, memory, bag.expected(topic)) for topic, type in wanted.items()
    }
    for batch in bag.batches(readers, set(wanted.values()), progress):
        reader = readers[batch.connection.topic]
        if batch.connection.type == reader.type:
            reader.add(batch)
    return readers


def record_of(
    bag: Bag,
    choice: Choice,
    rate_hz: float | None,
    progress: Progress,
    memory: Memory | None = None,
) -> ImuRecord:
    """
    Return the record that the chosen topics make; ``rate_hz`` goes before the stamps.

    Long arrays are kept where ``memory`` says.

    Raises
    ------
    InputError
        There is nothing in them, or no rate.

    """
    memory = memory or Memory()
    wanted = {name: choice.type for name in choice.names}
    beside = covariates_of(bag, choice.base)
    readers = _read(bag, wanted | {t.name: t.type for t in beside}, memory, progress)
    said: list[str] = []
    for reader in readers.values():
        if reader.unreadable and reader.columns.n:
            said.append(
                f'{reader.topic}: {reader.unreadable} message(s) could not be decoded and were '
                'left out'
            )
    parts = {name: _part(bag, readers[name], said) for name in choice.names}
    base = parts[choice.base]
    if choice.gyro and choice.accel and choice.gyro != choice.accel:
        base = base._replace(accel=_joined(choice, base, parts[choice.accel], said, memory))
    elif not choice.gyro:
        base = base._replace(gyro=None)
    elif not choice.accel:
        base = base._replace(accel=None)
    stamp = base.stamp
    covariates: dict[str, np.ndarray] = {}
    for info in beside:
        _resample(readers[info.name], stamp, base.receive, covariates, said, memory)
    t = _seconds(stamp, stamp[0], memory)
    receive_t = _seconds(base.receive, stamp[0], memory)
    memory.rest()
    if rate_hz is not None:
        t[:] = np.arange(len(t)) / rate_hz
    rate = rate_hz or regular_rate(t)
    if rate is None:
        raise InputError(
            f'{bag.path}: {choice.base} has no rate to be had from its stamps',
            'give one with --rate-hz',
        )
    return ImuRecord(
        gyro=base.gyro,
        accel=base.accel,
        t=t,
        rate_hz=rate,
        start=float(stamp[0]) * NS,
        covariates=covariates,
        topic=','.join(choice.names),
        frame_id=base.frame_id,
        path=str(bag.path),
        receive_t=receive_t,
        warnings=tuple(dict.fromkeys((*bag.warnings, *said))),
    )


def _seconds(ns: np.ndarray, zero: int, memory: Memory) -> np.ndarray:
    """Return times in s since zero."""
    out = memory.empty(len(ns))
    return np.multiply(np.subtract(ns, zero), NS, out=out)


def _part(bag: Bag, reader: Reader, said: list[str]) -> Part:
    """
    Return one topic, with receive times for stamps that are all zero.

    A part that holds nothing is None.

    """
    if not reader.columns.n:
        if reader.unreadable:
            raise InputError(
                f'{bag.path}: no message of {reader.topic} has the layout of {reader.type}',
                'it is of a custom type under a standard name; publish it as sensor_msgs/Imu',
            )
        raise InputError(
            f'{bag.path}: nothing of {reader.topic} can be recovered, it has no messages',
            'record again' if not bag.warnings else bag.warnings[0],
        )
    arrays = reader.columns.take()
    reader.columns.memory.rest()
    stamp, receive = arrays['stamp'], arrays['receive']
    if not stamp.any():
        said.append(f'{reader.topic}: all stamps are zero; the times of receiving were used')
        stamp = receive
    if reader.type == VECTOR:
        return Part(stamp, receive, arrays['values'], arrays['values'], reader.frame_id)
    data: list[np.ndarray | None] = []
    for sensor, absent in zip(('gyro', 'accel'), reader.absent):
        x = arrays[sensor]
        if absent or not _holds_anything(x):
            said.append(
                f'{reader.topic}: its {sensor} part is all zero or marked absent; left out'
            )
            data.append(None)
        else:
            data.append(x)
    if data[0] is None and data[1] is None:
        raise InputError(
            f'{bag.path}: {reader.topic} holds neither rates nor accelerations',
            'choose another --topic',
        )
    return Part(stamp, receive, data[0], data[1], reader.frame_id)


def _holds_anything(x: np.ndarray) -> bool:
    """Tell whether a value is neither zero nor NaN; the first ones mostly tell."""
    return any(np.any((some != 0) & ~np.isnan(some)) for some in (x[:1000], *x[1000:].T))


def _joined(
    choice: Choice, gyro: Part, accel: Part, said: list[str], memory: Memory
) -> np.ndarray:
    """
    Return the accelerations at the stamps of the rates.

    Samples taken together are put together as they are. Where the rates of the topics differ, the
    accelerations are interpolated, which takes noise out of them at short times.

    """
    said[:] = [s for s in said if 'part is all zero' not in s]
    if gyro.gyro is None or accel.accel is None:
        empty = choice.gyro if gyro.gyro is None else choice.accel
        raise InputError(f'{empty} holds no such part', 'choose another pair with --topic')
    if len(gyro.stamp) == len(accel.stamp) and np.array_equal(gyro.stamp, accel.stamp):
        return accel.accel
    order = np.argsort(accel.stamp, kind='stable')
    stamp = accel.stamp[order]
    after = np.clip(np.searchsorted(stamp, gyro.stamp), 1, max(len(stamp) - 1, 1))
    nearest = np.clip(
        after
        - (gyro.stamp - stamp[after - 1] <= stamp[np.minimum(after, len(stamp) - 1)] - gyro.stamp),
        0,
        len(stamp) - 1,
    )
    step = np.median(np.diff(gyro.stamp)) if len(gyro.stamp) > 1 else 0
    close = np.abs(stamp[nearest] - gyro.stamp) <= step / 2
    once = np.all(np.diff(nearest) > 0)
    out = memory.columns(len(gyro.stamp))
    if once and close.mean() > 0.99:
        for k in range(3):
            out[:, k] = np.where(close, accel.accel[order[nearest], k], np.nan)
        return out
    said.append(
        f'{choice.accel} and {choice.gyro} are sampled at different times; the accelerations '
        'were interpolated, '
        f'so that their noise at short times reads low (choose --topic {choice.accel} for the '
        'accelerometer)'
    )
    at, known = (gyro.stamp - stamp[0]) * NS, (stamp - stamp[0]) * NS
    for k in range(3):
        out[:, k] = np.interp(at, known, accel.accel[order, k])
    return out


def _resample(
    reader: Reader,
    stamp: np.ndarray,
    receive: np.ndarray,
    covariates: dict,
    said: list[str],
    memory: Memory,
) -> None:
    """Add a covariate topic, linearly interpolated to the Imu's times."""
    if not reader.columns.n:
        return
    arrays = reader.columns.take()
    at, known = stamp, arrays['stamp']
    if known.max() < stamp.min() or known.min() > stamp.max():
        at, known = receive, arrays['receive']
        if known.max() < at.min() or known.min() > at.max():
            said.append(f'{reader.topic}: recorded at another time than the Imu; not used')
            return
        said.append(
            f'{reader.topic}: its stamps are not of the clock of the Imu; the times of '
            'receiving were used'
        )
    order = np.argsort(known, kind='stable')
    zero = known[order[0]]
    names = COVARIATES[reader.type]
    number = 1 + sum(bool(re.fullmatch(rf'{next(iter(names))}(_\d+)?', c)) for c in covariates)
    suffix = f'_{number}' if number > 1 else ''
    for k, name in enumerate(names):
        values = memory.empty(len(at))
        values[:] = np.interp(
            (at - zero) * NS, (known[order] - zero) * NS, arrays['values'][order, k]
        )
        covariates[name + suffix] = values
