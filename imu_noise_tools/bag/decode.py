# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
From raw messages to arrays.

All that is read here has one shape: a header (stamp and frame_id), then nothing but doubles.
Messages whose bytes have exactly that shape are decoded together, by one view of the buffer; each
that has not, by the deserialiser of rosbags. Both give the same bits.

"""

from __future__ import annotations

from functools import cache
from typing import Any, Literal, NamedTuple

import numpy as np

from .container import Batch, Connection, rows

IMU = 'sensor_msgs/msg/Imu'
VECTOR = 'geometry_msgs/msg/Vector3Stamped'
TEMPERATURE = 'sensor_msgs/msg/Temperature'
MAGNETIC = 'sensor_msgs/msg/MagneticField'
PRESSURE = 'sensor_msgs/msg/FluidPressure'

# Doubles after the header.
DOUBLES = {IMU: 37, VECTOR: 3, TEMPERATURE: 2, MAGNETIC: 12, PRESSURE: 2}
MOST_FRAMES = 8     # names of them that are looked at
# Where they are in an Imu: orientation, its covariance, then
GYRO, GYRO_COVARIANCE = slice(13, 16), slice(16, 25)
ACCEL, ACCEL_COVARIANCE = slice(25, 28), slice(28, 37)


class Decoded(NamedTuple):
    """
    Messages as arrays.

    They are header stamps (ns), doubles (n, k), which of the batch could be read at all, the
    temperature (n,), degC, of messages that hold one, and the names of the frames one after the
    other, the first few that differ from the one before, where they were looked at.

    """

    stamp: np.ndarray
    values: np.ndarray
    frame_id: str
    readable: np.ndarray        # (n of the batch,) bool
    temperature: np.ndarray | None = None
    frames: tuple[str, ...] = ()


def decode(batch: Batch, plain: bool = False) -> Decoded:
    """
    Decode a batch of messages of a type in DOUBLES.

    Parameters
    ----------
    batch : Batch
        Messages of one connection, of a type in DOUBLES or with a shape.
    plain : bool
        Decode message by message, whatever their shape (for comparison).

    Returns
    -------
    Decoded
        In the order of the batch, without those that cannot be read.

    """
    if batch.connection.shape is not None:
        return batch.connection.shape.decode(batch)
    count = DOUBLES[batch.connection.type]
    n = len(batch.receive)
    lengths = np.unique(batch.length)
    if not plain and len(lengths) == 1:
        stamp, values, good, frames = _bulk(batch, int(lengths[0]), count)
        if good.all():
            return Decoded(stamp, values, _frame(batch), good, frames=_one_after_other(frames))
    stamp, values, readable = np.zeros(n, np.int64), np.zeros((n, count)), np.zeros(n, bool)
    names = np.full(n, '', object)
    if not plain:
        for length in lengths:
            some = np.flatnonzero(batch.length == length)
            s, v, good, frames = _bulk(batch.take(some), int(length), count)
            names[some] = frames
            stamp[some[good]], values[some[good]] = s[good], v[good]
            readable[some[good]] = True
    seen = readable.copy()
    frame: dict[int, str] = {}
    for k in np.flatnonzero(~seen).tolist():
        found = _plain(batch.message(k), batch.connection, count)
        if found is not None:
            stamp[k], frame[k], values[k] = found
            names[k], readable[k] = frame[k], True
    first = np.flatnonzero(readable)[:1]
    name = (
        ''
        if not len(first)
        else frame.get(int(first[0]), '') if not seen[first[0]] else _frame(batch.take(first))
    )
    return Decoded(stamp[readable], values[readable], name, readable,
                   frames=_one_after_other(names[readable]))


def _bulk(
    batch: Batch, length: int, count: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """
    Return stamps, doubles, which messages have the expected bytes, and names of their frames.

    All of them are of one length.

    """
    body = length - 8 * count
    ros1 = batch.connection.encoding == 'ros1'
    n = len(batch.begin)
    if body < 16 or batch.connection.encoding not in ('ros1', 'cdr'):
        none = np.zeros(n, bool)
        return np.zeros(n, np.int64), np.zeros((n, count)), none, np.full(n, '', object)
    raw = rows(batch.data, batch.begin, length)
    big = False if ros1 else bool(raw[0, 1] == 0)
    order = '>' if big else '<'
    # sec, nanosec, length of frame_id
    head = np.ascontiguousarray(raw[:, 4:16]).view(f'{order}u4')
    name = head[:, 2].astype(np.int64)
    if ros1:
        good = 16 + name == body
    else:
        # CDR: four bytes say the encoding, places are counted from behind them, doubles are
        # aligned to eight.
        good = (raw[:, 0] == 0) & (raw[:, 1] == (0 if big else 1))
        good &= (name > 0) & (4 + (12 + name + 7) // 8 * 8 == body)
        last = np.clip(15 + name, 0, length - 1)
        good &= raw[np.arange(n), last] == 0
    # plain ASCII is read here, other letters one by one; what pads may be anything
    if body > 16:
        good &= np.all((raw[:, 16:body] < 128) | (np.arange(body - 16) >= name[:, None]), axis=1)
    seconds = head[:, 0].view(f'{order}u4' if ros1 else f'{order}i4').astype(np.int64)
    return (seconds * 1_000_000_000 + head[:, 1],
            raw[:, body:].view(f'{order}f8'), good, _frames(raw[:, 16:body], name, good))


def _frames(text: np.ndarray, length: np.ndarray, good: np.ndarray) -> np.ndarray:
    """Return the names (n,), str, in bytes (n, k), each so long (n,); '' beyond a few, or none."""
    out, left = np.full(len(text), '', object), np.flatnonzero(good)
    for _ in range(MOST_FRAMES):
        if not len(left):
            break
        size, first = int(length[left[0]]), text[left[0]]
        same = (length[left] == size) & np.all(text[left, :size] == first[:size], axis=1)
        out[left[same]] = first[:size].tobytes().rstrip(b'\0').decode(errors='replace')
        left = left[~same]
    return out


def _one_after_other(names: np.ndarray) -> tuple[str, ...]:
    """Return the first few of names (n,) that differ from the one before."""
    new = np.flatnonzero(np.append(True, names[1:] != names[:-1])[:len(names)])[:MOST_FRAMES]
    return tuple(names[new].tolist())


def _frame(batch: Batch) -> str:
    """Return the frame_id of the first message, whose bytes have the expected shape."""
    raw = batch.message(0)
    big = batch.connection.encoding == 'cdr' and raw[1] == 0
    order: Literal['big', 'little'] = 'big' if big else 'little'
    name = raw[16:16 + int.from_bytes(raw[12:16], order)]
    return name.rstrip(b'\0').decode(errors='replace')


@cache
def _store(encoding: str) -> Any:
    from rosbags.typesys import get_typestore, Stores
    return get_typestore(Stores.ROS1_NOETIC if encoding == 'ros1' else Stores.ROS2_JAZZY)


def _plain(raw: bytes, connection: Connection, count: int) -> tuple[int, str, list[float]] | None:
    """Return stamp, frame_id and doubles of one message, or None where it cannot be read."""
    store = _store(connection.encoding)
    read = store.deserialize_ros1 if connection.encoding == 'ros1' else store.deserialize_cdr
    try:
        message = read(raw, connection.type)
    except Exception:       # rosbags raises whatever its generated code runs into
        return None
    stamp = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
    values = _doubles(message)
    return (stamp, message.header.frame_id, values) if len(values) == count else None


def _doubles(message: Any) -> list[float]:
    """Return all numbers after the header, in order."""
    found: list[float] = []
    for name in message.__dataclass_fields__:
        if name in ('header', '__msgtype__'):
            continue
        value = getattr(message, name)
        if hasattr(value, '__dataclass_fields__'):
            found += _doubles(value)
        elif isinstance(value, np.ndarray):
            found += value.tolist()
        else:
            found.append(value)
    return found
