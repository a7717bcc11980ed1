# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""From the messages of a bag to one ImuRecord: gathered, joined, with covariates."""

from __future__ import annotations

from dataclasses import replace
import re
from typing import NamedTuple

import numpy as np

from .container import Batch, Progress
from .decode import (
    ACCEL, ACCEL_COVARIANCE, decode, GYRO, GYRO_COVARIANCE, IMU, MOST_FRAMES, VECTOR
)
from .source import Bag
from .tables import against_stamps, read_between
from .topics import Choice, COVARIATES, covariates_of
from ..core.clock import regular_rate
from ..core.errors import InputError, listed
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
    temperature: np.ndarray | None = None       # degC, that the messages themselves hold


class Reader:
    """Gathers the messages of one topic."""

    def __init__(self, topic: str, type: str, memory: Memory, room: int = 0, warm: bool = False):
        self.topic, self.type = topic, type
        self.frame_id = ''
        self.frames: list[str] = []         # that its messages name, one after the other
        self.unreadable = 0
        self.absent = [True, True]
        self.unnamed: set[str] = set()      # sensors that its messages are not meant to have
        self.warm = warm                    # its messages hold a temperature
        if type == IMU:
            beside = {'temperature': 1} if warm else {}
            self.columns = Columns(memory, room, stamp=0, receive=0, gyro=3, accel=3, **beside)
        else:
            width = {VECTOR: 3}.get(type) or len(COVARIATES[type])
            self.columns = Columns(memory, room, stamp=0, receive=0, values=width)

    def add(self, batch: Batch) -> None:
        """Decode a batch and keep what is needed of it."""
        found = decode(batch)
        if batch.connection.shape is not None:
            self.unnamed = batch.connection.shape.without
        self.unreadable += int(np.sum(~found.readable))
        receive = batch.receive if found.readable.all() else batch.receive[found.readable]
        if self.type == IMU:
            self.absent[0] &= bool(np.all(found.values[:, GYRO_COVARIANCE.start] == -1))
            self.absent[1] &= bool(np.all(found.values[:, ACCEL_COVARIANCE.start] == -1))
            beside = {}
            if self.warm:
                none = np.full(len(found.stamp), np.nan)
                beside['temperature'] = (
                    none if found.temperature is None else found.temperature)[:, None]
            self.columns.extend(stamp=found.stamp, receive=receive, gyro=found.values[:, GYRO],
                                accel=found.values[:, ACCEL], **beside)
        else:
            width = len(self.columns._arrays['values'])
            self.columns.extend(stamp=found.stamp, receive=receive, values=found.values[:, :width])
        self.frame_id = self.frame_id or found.frame_id
        if len(self.frames) < MOST_FRAMES:
            new = [name for name in found.frames if name]
            self.frames += new[1:] if new[:1] == self.frames[-1:] else new


def _read(
    bag: Bag, wanted: dict[str, str], memory: Memory, progress: Progress = None
) -> dict[str, Reader]:
    """Read topics of given types in one pass."""
    warm = {c.topic for c in bag.connections if c.shape and c.shape.fields.temperature}
    readers = {
        topic: Reader(topic, type, memory, bag.expected(topic), topic in warm)
        for topic, type in wanted.items()
    }
    for batch in bag.batches(readers, set(wanted.values()), progress):
        reader = readers[batch.connection.topic]
        if batch.connection.kind == reader.type:
            reader.add(batch)
    return readers


def record_of(
    bag: Bag,
    choice: Choice,
    rate_hz: float | None,
    progress: Progress,
    memory: Memory | None = None,
    apart: bool = False,
) -> ImuRecord:
    """
    Return the record that the chosen topics make; ``rate_hz`` goes before the stamps.

    Long arrays are kept where ``memory`` says. Of two topics that are not sampled together the
    accelerometer's is a record ``beside`` where ``apart`` is asked for, else it is interpolated.

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
    made = _made_of(choice, parts, apart, said, memory)
    if rate_hz is not None and len(made) > 1:
        raise InputError(
            f'{bag.path}: {" and ".join(choice.names)} have different rates, --rate-hz gives '
            'only one',
            'choose one topic with --topic',
        )
    covariates = [
        (readers[t.name], readers[t.name].columns.take()) for t in beside
        if readers[t.name].columns.n
    ]
    first, *others = (
        _record(bag, topic, part, rate_hz, covariates, said, memory) for topic, part in made
    )
    warnings = tuple(dict.fromkeys((*bag.warnings, *said)))
    return replace(first, beside=tuple(others), warnings=warnings)


def _made_of(
    choice: Choice, parts: dict[str, Part], apart: bool, said: list[str], memory: Memory
) -> list[tuple[str, Part]]:
    """Return the topics and parts that records are made of: one, or one a sensor."""
    base = parts[choice.base]
    topic = ','.join(choice.names)
    if not choice.gyro:
        return [(topic, base._replace(gyro=None))]
    if not choice.accel:
        return [(topic, base._replace(accel=None))]
    if choice.gyro == choice.accel:
        return [(topic, base)]
    accel = parts[choice.accel]
    said[:] = [s for s in said if 'part is all zero' not in s]
    if base.gyro is None or accel.accel is None:
        empty = choice.gyro if base.gyro is None else choice.accel
        raise InputError(
            f'{empty} lacks the readings that are asked of it', 'choose another pair with --topic')
    together = _together(base, accel, memory)
    alike = abs(len(accel.stamp) / len(base.stamp) - 1) < 0.01
    if apart and not (alike and together is not None):
        return [(choice.gyro, base._replace(accel=None)),
                (choice.accel, accel._replace(gyro=None))]
    if together is None:
        together = _interpolated(choice, base, accel, said, memory)
    return [(topic, base._replace(accel=together))]


def _record(
    bag: Bag, topic: str, part: Part, rate_hz: float | None,
    known: list[tuple[Reader, dict[str, np.ndarray]]], said: list[str], memory: Memory,
) -> ImuRecord:
    """Return the record of one part, with the covariates at its times."""
    stamp = part.stamp
    covariates = {} if part.temperature is None else {'temperature': part.temperature}
    for reader, arrays in known:
        _resample(reader, arrays, part, covariates, said, memory)
    t = _seconds(stamp, stamp[0], memory)
    receive_t = _seconds(part.receive, stamp[0], memory)
    memory.rest()
    if rate_hz is not None:
        if stamp is not part.receive:       # else there are none
            said += against_stamps(t, rate_hz)
        t[:] = np.arange(len(t)) / rate_hz
    rate = rate_hz or regular_rate(t)
    if rate is None:
        raise InputError(
            f'{bag.path}: cannot determine the sample rate of {topic} from its stamps',
            'give it with --rate-hz',
        )
    return ImuRecord(
        gyro=part.gyro,
        accel=part.accel,
        t=t,
        rate_hz=rate,
        start=float(stamp[0]) * NS,
        covariates=covariates,
        topic=topic,
        frame_id=part.frame_id,
        path=str(bag.path),
        receive_t=receive_t,
        given_rate_hz=rate_hz,
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
                'a custom type under a standard name? publish it as sensor_msgs/Imu',
            )
        raise InputError(
            f'{bag.path}: nothing of {reader.topic} can be recovered, it has no messages',
            'record again' if not bag.warnings else bag.warnings[0],
        )
    names = sorted(set(reader.frames))
    if len(names) < len(reader.frames):     # in turn; a new name for the rest is none of another
        said.append(f'{reader.topic}: its messages name several frames in turn '
                    f'({listed(names, 4)}): if each is a sensor, no value is that of one; record '
                    'them on topics of their own')
    arrays = reader.columns.take()
    reader.columns.memory.rest()
    stamp, receive = arrays['stamp'], arrays['receive']
    if not stamp.any():
        said.append(f'{reader.topic}: all stamps are zero; the receive times were used')
        stamp = receive
    if reader.type == VECTOR:
        return Part(stamp, receive, arrays['values'], arrays['values'], reader.frame_id)
    data: list[np.ndarray | None] = []
    for sensor, absent in zip(('gyro', 'accel'), reader.absent):
        x = arrays[sensor]
        if absent or not _holds_anything(x):
            if sensor not in reader.unnamed:
                said.append(
                    f'{reader.topic}: its {sensor} part is all zero or marked absent; left out'
                )
            data.append(None)
        else:
            data.append(x)
    if data[0] is None and data[1] is None:
        raise InputError(
            f'{bag.path}: {reader.topic} has neither angular rates nor accelerations',
            'choose another --topic',
        )
    return Part(stamp, receive, data[0], data[1], reader.frame_id, _temperature(arrays))


def _temperature(arrays: dict[str, np.ndarray]) -> np.ndarray | None:
    """Return the temperature that the messages hold, interpolated where they do not say it."""
    if 'temperature' not in arrays or not _holds_anything(arrays['temperature']):
        return None
    return read_between(arrays['temperature'][:, 0])


def _holds_anything(x: np.ndarray) -> bool:
    """Tell whether a value is neither zero nor NaN; the first ones mostly tell."""
    return any(np.any((some != 0) & ~np.isnan(some)) for some in (x[:1000], *x[1000:].T))


def _together(gyro: Part, accel: Part, memory: Memory) -> np.ndarray | None:
    """
    Return the accelerations at the stamps of the rates, where they were sampled together.

    Each is at most half a step from its rate; None where they were sampled at other times.

    """
    if len(gyro.stamp) == len(accel.stamp) and np.array_equal(gyro.stamp, accel.stamp):
        return accel.accel
    assert accel.accel is not None
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
    if not (np.all(np.diff(nearest) > 0) and close.mean() > 0.99):
        return None
    out = memory.columns(len(gyro.stamp))
    for k in range(3):
        out[:, k] = np.where(close, accel.accel[order[nearest], k], np.nan)
    return out


def _interpolated(
    choice: Choice, gyro: Part, accel: Part, said: list[str], memory: Memory
) -> np.ndarray:
    """
    Return the accelerations interpolated at the stamps of the rates, and say so.

    That takes noise out of them at short times: it is for what needs both at once.

    """
    assert accel.accel is not None
    order = np.argsort(accel.stamp, kind='stable')
    stamp = accel.stamp[order]
    said.append(
        f'{choice.accel} and {choice.gyro} are sampled at different times; the accelerations '
        'were interpolated, '
        f'so that their noise at short times reads low (choose --topic {choice.accel} for the '
        'accelerometer)'
    )
    at, known = (gyro.stamp - stamp[0]) * NS, (stamp - stamp[0]) * NS
    out = memory.columns(len(gyro.stamp))
    for k in range(3):
        out[:, k] = np.interp(at, known, accel.accel[order, k])
    return out


def _resample(
    reader: Reader,
    arrays: dict[str, np.ndarray],
    part: Part,
    covariates: dict,
    said: list[str],
    memory: Memory,
) -> None:
    """Add a covariate topic, linearly interpolated to the Imu's times."""
    at, known = part.stamp, arrays['stamp']
    if known.max() < at.min() or known.min() > at.max():
        at, known = part.receive, arrays['receive']
        if known.max() < at.min() or known.min() > at.max():
            said.append(f'{reader.topic}: recorded at a different time than the Imu; not used')
            return
        said.append(
            f'{reader.topic}: its stamps come from another clock than the Imu\'s; the receive '
            'times were used'
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
