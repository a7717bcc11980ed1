"""From a file to an ImuRecord, and block by block where a whole one would not fit into memory."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
import re
from typing import NamedTuple

import numpy as np

from .container import Progress, rows
from .decode import ACCEL, ACCEL_COVARIANCE, decode, GYRO, GYRO_COVARIANCE, IMU, VECTOR
from .encode import imu_values, serialise
from .source import Bag
from .tables import read_table, table_kind
from .topics import Choice, choose, COVARIATES, covariates_of, list_topics, TopicInfo
from ..errors import InputError, UsageError
from ..record import ImuRecord, regular_rate
from ..units import DEG, G0

GYRO_UNITS = {'rad/s': 1.0, 'deg/s': DEG, 'mdeg/s': 1e-3 * DEG}
ACCEL_UNITS = {'m/s^2': 1.0, 'g': G0, 'mg': 1e-3 * G0}
KINDS = ('rate', 'delta', 'integrated')
NS = 1e-9
EPOCH = 1_700_000_000_000_000_000


def open_record(
    path,
    topic: str | None = None,
    *,
    gyro_unit: str | None = None,
    accel_unit: str | None = None,
    input_kind: str = 'rate',
    rate_hz: float | None = None,
    progress: Progress = None,
) -> ImuRecord:
    """
    Read one IMU record.

    Parameters
    ----------
    path : str or Path
        A rosbag1 file, a rosbag2 folder, an ``.mcap`` or ``.db3`` file (also compressed whole,
        ``.zstd``), a ``.csv`` or an ``.npz``.
    topic : str, optional
        The Imu topic, or a pair ``gyro_topic,accel_topic``; needed only where there are several.
    gyro_unit, accel_unit : str, optional
        Unit of the data where it is not SI: ``deg/s``, ``mdeg/s``; ``g``, ``mg``.
    input_kind : str
        ``rate``; ``delta``: each sample is an increment (rad, m/s); ``integrated``: the angle or
        velocity itself.
    rate_hz : float, optional
        Sample rate, in place of the stamps.
    progress : callable, optional
        Called with the fraction done, 0 to 1.

    Returns
    -------
    ImuRecord
        As recorded, in order of receive time: nothing sorted out, nothing resampled but the
        covariates.

    Raises
    ------
    InputError
        There is no record in it; the message lists the topics that there are.
    UsageError
        An unknown unit or kind.

    """
    _check(gyro_unit, GYRO_UNITS, 'gyro')
    _check(accel_unit, ACCEL_UNITS, 'accel')
    if input_kind not in KINDS:
        raise UsageError(
            f'there is no kind of input {input_kind}', f'kinds are {", ".join(KINDS)}'
        )
    if rate_hz is not None and not (np.isfinite(rate_hz) and rate_hz > 0):
        raise UsageError(f'a rate of {rate_hz} Hz makes no sense', 'give a positive number')
    if table_kind(path):
        record = read_table(Path(path), rate_hz)
    else:
        with Bag(path) as bag:
            record = _from_bag(bag, choose(bag, topic), rate_hz, progress)
    return _as_rate(_in_si(record, gyro_unit, accel_unit), input_kind)


def topics(path) -> list[TopicInfo]:
    """
    Return the topics of a bag (of a table: its one record), without reading the messages.

    Raises
    ------
    InputError
        It is no bag, or nothing in it can be recovered.

    """
    kind = table_kind(path)
    if kind:
        record = read_table(Path(path), 1.0)
        rate = record.labelled_rate_hz or regular_rate(record.t)
        return [TopicInfo('imu', kind, record.n, rate, 'imu')]
    with Bag(path) as bag:
        return list_topics(bag)


def _check(unit: str | None, known: dict[str, float], sensor: str) -> None:
    if unit is not None and unit not in known:
        raise UsageError(f'there is no {sensor} unit {unit}', f'units are {", ".join(known)}')


def _in_si(record: ImuRecord, gyro_unit: str | None, accel_unit: str | None) -> ImuRecord:
    for data, unit, known in (
        (record.gyro, gyro_unit, GYRO_UNITS),
        (record.accel, accel_unit, ACCEL_UNITS),
    ):
        if data is not None and unit is not None and known[unit] != 1.0:
            data *= known[unit]
    return record


def _as_rate(record: ImuRecord, kind: str) -> ImuRecord:
    """Turn increments, or the angle and velocity themselves, into rates."""
    if kind == 'rate':
        return record
    if kind == 'delta':
        for data in (record.gyro, record.accel):
            if data is not None:
                data *= record.rate_hz
        return record
    later = record.part(1, record.n)
    steps = [
        None if d is None else np.diff(d, axis=0) * record.rate_hz
        for d in (record.gyro, record.accel)
    ]
    return replace(later, gyro=steps[0], accel=steps[1])


class Columns:
    """Arrays that grow in place while a bag is read, so that no message is ever held twice."""

    def __init__(self, **widths: int):
        self.n = 0
        self._arrays = {
            name: np.empty((0, w) if w else 0, float if w else np.int64)
            for name, w in widths.items()
        }

    def extend(self, **more: np.ndarray) -> None:
        """Append rows to every column."""
        count = len(next(iter(more.values())))
        room = len(next(iter(self._arrays.values())))
        if self.n + count > room:
            room = max(self.n + count, room + room // 8, 1024)
            for a in self._arrays.values():
                a.resize((room, *a.shape[1:]), refcheck=False)
        for name, values in more.items():
            self._arrays[name][self.n:self.n + count] = values
        self.n += count

    def take(self) -> dict[str, np.ndarray]:
        """
        Return the arrays, cut to size and in order of ``receive``.

        The object is empty afterwards.

        """
        arrays, self._arrays = self._arrays, {}
        for a in arrays.values():
            a.resize((self.n, *a.shape[1:]), refcheck=False)
        receive = arrays['receive']
        if np.any(receive[1:] < receive[:-1]):
            order = np.argsort(receive, kind='stable')
            for name in arrays:
                arrays[name] = arrays[name][order]
        return arrays


class Part(NamedTuple):
    """One topic as it was read."""

    stamp: np.ndarray           # ns
    receive: np.ndarray         # ns
    gyro: np.ndarray | None
    accel: np.ndarray | None
    frame_id: str


class _Reader:
    """Gathers the messages of one topic."""

    def __init__(self, topic: str, type: str):
        self.topic, self.type = topic, type
        self.frame_id = ''
        self.unreadable = 0
        self.absent = [True, True]
        if type == IMU:
            self.columns = Columns(stamp=0, receive=0, gyro=3, accel=3)
        else:
            self.columns = Columns(
                stamp=0, receive=0, values={VECTOR: 3}.get(type) or len(COVARIATES[type])
            )

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
            width = self.columns._arrays['values'].shape[1]
            self.columns.extend(stamp=found.stamp, receive=receive, values=found.values[:, :width])
        self.frame_id = self.frame_id or found.frame_id


def _read(bag: Bag, wanted: dict[str, str], progress: Progress = None) -> dict[str, _Reader]:
    """Read topics of given types in one pass."""
    readers = {topic: _Reader(topic, type) for topic, type in wanted.items()}
    for batch in bag.batches(readers, set(wanted.values()), progress):
        reader = readers[batch.connection.topic]
        if batch.connection.type == reader.type:
            reader.add(batch)
    return readers


def _from_bag(bag: Bag, choice: Choice, rate_hz: float | None, progress: Progress) -> ImuRecord:
    wanted = {name: choice.type for name in choice.names}
    beside = covariates_of(bag, choice.base)
    readers = _read(bag, wanted | {t.name: t.type for t in beside}, progress)
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
        base = base._replace(accel=_joined(choice, base, parts[choice.accel], said))
    elif not choice.gyro:
        base = base._replace(gyro=None)
    elif not choice.accel:
        base = base._replace(accel=None)
    stamp = base.stamp
    covariates: dict[str, np.ndarray] = {}
    for info in beside:
        _resample(readers[info.name], stamp, base.receive, covariates, said)
    t = (stamp - stamp[0]) * NS
    receive_t = (base.receive - stamp[0]) * NS
    if rate_hz is not None:
        t = np.arange(len(t)) / rate_hz
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


def _part(bag: Bag, reader: _Reader, said: list[str]) -> Part:
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
    stamp, receive = arrays['stamp'], arrays['receive']
    if not stamp.any():
        said.append(f'{reader.topic}: all stamps are zero; the times of receiving were used')
        stamp = receive
    if reader.type == VECTOR:
        return Part(stamp, receive, arrays['values'], arrays['values'], reader.frame_id)
    data: list[np.ndarray | None] = []
    for sensor, absent in zip(('gyro', 'accel'), reader.absent):
        x = arrays[sensor]
        if absent or not np.any((x != 0) & ~np.isnan(x)):
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


def _joined(choice: Choice, gyro: Part, accel: Part, said: list[str]) -> np.ndarray:
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
    stamp, data = accel.stamp[order], accel.accel[order]
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
    if once and close.mean() > 0.99:
        taken = data[nearest].copy()
        taken[~close] = np.nan
        return taken
    said.append(
        f'{choice.accel} and {choice.gyro} are sampled at different times; the accelerations '
        'were interpolated, '
        f'so that their noise at short times reads low (choose --topic {choice.accel} for the '
        'accelerometer)'
    )
    out = np.empty((len(gyro.stamp), 3))
    at, known = (gyro.stamp - stamp[0]) * NS, (stamp - stamp[0]) * NS
    for k in range(3):
        out[:, k] = np.interp(at, known, data[:, k])
    return out


def _resample(
    reader: _Reader, stamp: np.ndarray, receive: np.ndarray, covariates: dict, said: list[str]
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
        covariates[name + suffix] = np.interp(
            (at - zero) * NS, (known[order] - zero) * NS, arrays['values'][order, k]
        )


class Block(NamedTuple):
    """
    Some thousand samples in a row: times in ns, rad/s and m/s^2 (n, 3).

    A part may be absent.

    """

    stamp: np.ndarray
    receive: np.ndarray
    gyro: np.ndarray | None
    accel: np.ndarray | None
    frame_id: str


def iter_blocks(path, topic: str | None = None, block: int = 4096) -> Iterator[Block]:
    """
    Yield the samples of a record block by block, in memory that does not grow with the bag.

    Messages are in order of receive time within each chunk of the file. Pairs of topics and tables
    are read whole first. A part that is not there is NaN, or as the messages have it.

    Parameters
    ----------
    path, topic
        As for :func:`open_record`.
    block : int
        The most samples in a block.

    Raises
    ------
    InputError
        As :func:`open_record`.

    """
    if table_kind(path):
        yield from _whole(read_table(Path(path), None), block)
        return
    with Bag(path) as bag:
        choice = choose(bag, topic)
        if choice.type != IMU or choice.gyro != choice.accel:
            yield from _whole(_from_bag(bag, choice, None, None), block)
            return
        zero: bool | None = None
        for batch in bag.batches([choice.base], [IMU]):
            for k in range(0, len(batch.begin), block):
                some = batch.take(np.arange(k, min(k + block, len(batch.begin))))
                found = decode(some)
                receive = some.receive[found.readable]
                if not len(receive):
                    continue
                zero = not found.stamp.any() if zero is None else zero
                yield Block(
                    receive if zero else found.stamp,
                    receive,
                    np.ascontiguousarray(found.values[:, GYRO]),
                    np.ascontiguousarray(found.values[:, ACCEL]),
                    found.frame_id,
                )


def iter_raw(path, topic: str | None = None) -> Iterator[tuple[int, bytes, int]]:
    """
    Yield the Imu messages one by one, for replay: receive time (ns), CDR bytes, header stamp (ns).

    What is no CDR Imu message (ROS 1, big-endian, pairs of topics, tables) is made into one. A
    stamp in the bytes is as recorded, zero too; the stamp beside them is the receive time where
    all of them are zero.

    Raises
    ------
    InputError
        As :func:`open_record`.

    """
    if not table_kind(path):
        with Bag(path) as bag:
            choice = choose(bag, topic)
            if choice.type == IMU and choice.gyro == choice.accel:
                yield from _raw_of(bag, choice.base)
                return
    for block in iter_blocks(path, topic):
        values = imu_values(*(None if x is None or np.isnan(x).all() else x for x in (block.gyro, block.accel)))
        for row, receive, stamp in zip(
            serialise(block.stamp, values, block.frame_id or 'imu_link'),
            block.receive.tolist(),
            block.stamp.tolist(),
        ):
            yield receive, row.tobytes(), stamp


def _raw_of(bag: Bag, topic: str) -> Iterator[tuple[int, bytes, int]]:
    zero: bool | None = None
    for batch in bag.batches([topic], [IMU]):
        found = decode(batch)
        batch = batch.take(np.flatnonzero(found.readable))
        if not len(batch.receive):
            continue
        zero = not found.stamp.any() if zero is None else zero
        as_it_is = batch.connection.encoding == 'cdr' and bool(
            np.all(rows(batch.data, batch.begin, 2)[:, 1] == 1)
        )
        made = None if as_it_is else serialise(found.stamp, found.values, found.frame_id)
        for k, (receive, stamp) in enumerate(zip(batch.receive.tolist(), found.stamp.tolist())):
            yield receive, batch.message(k) if made is None else made[k].tobytes(), (
                receive if zero else stamp
            )


def _whole(record: ImuRecord, block: int) -> Iterator[Block]:
    for b in blocks_of(record, block):
        gap = np.full((len(b.stamp), 3), np.nan)
        yield b._replace(
            gyro=gap if b.gyro is None else b.gyro, accel=gap if b.accel is None else b.accel
        )


def start_ns(record: ImuRecord) -> int:
    """
    Return when a record began, ns.

    Where it does not know, that is some day: a stamp of zero would mean "unset".

    """
    return round(record.start * 1e9) or EPOCH


def blocks_of(record: ImuRecord, block: int) -> Iterator[Block]:
    """Yield the samples of a record block by block."""
    start = start_ns(record)
    for k in range(0, record.n, block):
        part = record.part(k, k + block)
        stamp = start + np.round(part.t * 1e9).astype(np.int64)
        receive = (
            stamp
            if part.receive_t is None
            else start + np.round(part.receive_t * 1e9).astype(np.int64)
        )
        yield Block(stamp, receive, part.gyro, part.accel, record.frame_id)
