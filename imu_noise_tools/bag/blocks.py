# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The samples of a bag block by block, and message by message for replay."""

from __future__ import annotations

from collections.abc import Iterator
from heapq import merge
from pathlib import Path
from typing import NamedTuple

import numpy as np

from .assemble import record_of
from .container import rows
from .decode import ACCEL, decode, GYRO, IMU
from .encode import imu_values, serialise
from .source import Bag
from .tables import read_table, table_kind
from .topics import choose
from ..core.record import ImuRecord

EPOCH = 1_700_000_000_000_000_000


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


def iter_blocks(
    path: str | Path, topic: str | None = None, block: int = 4096, fields: str | None = None,
    apart: bool = False,
) -> Iterator[Block]:
    """
    Yield the samples of a record block by block, in memory that does not grow with the bag.

    Messages are in order of receive time within each chunk of the file. Pairs of topics and tables
    are read whole first. A part that is not there is NaN, or as the messages have it.

    Parameters
    ----------
    path, topic, fields
        As for :func:`open_record`.
    block : int
        The most samples in a block.
    apart : bool
        Of two topics that are not sampled together, yield the blocks of each, in order of their
        first stamps, without the part that the other has.

    Raises
    ------
    InputError
        As :func:`open_record`.

    """
    if table_kind(path):
        yield from _whole(read_table(Path(path), None, fields), block)
        return
    with Bag(path) as bag:
        choice = choose(bag, topic, fields)
        if choice.type != IMU or choice.gyro != choice.accel:
            record = record_of(bag, choice, None, None, apart=apart)
            yield from _in_turn(record, block) if record.beside else _whole(record, block)
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


def iter_raw(
    path: str | Path, topic: str | None = None, fields: str | None = None
) -> Iterator[tuple[int, bytes, int]]:
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
            choice = choose(bag, topic, fields)
            if choice.type == IMU and choice.gyro == choice.accel:
                yield from _raw_of(bag, choice.base)
                return
    for block in iter_blocks(path, topic, fields=fields):
        values = imu_values(present(block.gyro), present(block.accel))
        for row, receive, stamp in zip(
            serialise(block.stamp, values, block.frame_id or 'imu_link'),
            block.receive.tolist(),
            block.stamp.tolist(),
        ):
            yield receive, row.tobytes(), stamp


def present(x: np.ndarray | None) -> np.ndarray | None:
    """Return the part of a block, or None where it holds nothing."""
    return None if x is None or (len(x) and np.isnan(x).all()) else x


def _raw_of(bag: Bag, topic: str) -> Iterator[tuple[int, bytes, int]]:
    zero: bool | None = None
    for batch in bag.batches([topic], [IMU]):
        found = decode(batch)
        batch = batch.take(np.flatnonzero(found.readable))
        if not len(batch.receive):
            continue
        zero = not found.stamp.any() if zero is None else zero
        plain = batch.connection.encoding == 'cdr' and batch.connection.shape is None
        as_it_is = plain and bool(np.all(rows(batch.data, batch.begin, 2)[:, 1] == 1))
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


def _in_turn(record: ImuRecord, block: int) -> Iterator[Block]:
    return merge(*(blocks_of(r, block) for r in record.streams), key=lambda b: b.stamp[0])


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
