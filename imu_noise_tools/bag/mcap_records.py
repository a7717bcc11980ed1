# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The records of an MCAP, thousands at once: https://mcap.dev/spec."""

from __future__ import annotations

from collections.abc import Iterator
import struct
from typing import NamedTuple

import numpy as np

from .chunked import Group
from .container import Damaged, rows

MAGIC = b'\x89MCAP0\r\n'
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, INDEX = 1, 2, 3, 4, 5, 6, 7
CHUNK_INDEX, ATTACHMENT, STATISTICS, METADATA, SUMMARY_OFFSET, DATA_END = 8, 9, 11, 12, 14, 15
HEAD = 9                # op and length
MESSAGE_HEAD = 31       # and channel (2), sequence (4), log time (8), publish time (8)


class Run(NamedTuple):
    """Records of one kind and size (and, if messages, one channel) that follow each other."""

    op: int
    begin: int
    step: int
    number: int


def walk(raw: bytes) -> Iterator[Run]:
    """Yield the whole records of a buffer, alike ones together."""
    data = np.frombuffer(raw, np.uint8)
    at, n = 0, len(raw)
    while at + HEAD <= n:
        op = raw[at]
        step = HEAD + int.from_bytes(raw[at + 1:at + HEAD], 'little')
        if at + step > n or op == 0:
            return
        count = 1
        if op == MESSAGE and step >= MESSAGE_HEAD:
            alike = raw[at:at + HEAD + 2]
            if raw[at + step:at + step + HEAD + 2] == alike:
                count = _how_many(data[at:], step, alike)
        yield Run(op, at, step, count)
        at += step * count


def _how_many(data: np.ndarray, step: int, alike: bytes) -> int:
    """Return how many records from the front of ``data`` on begin with the same bytes."""
    known, most = 2, len(data) // step
    block = 64
    want = np.frombuffer(alike, np.uint8)
    while known < most:
        some = min(block, most - known)
        heads = rows(data, (known + np.arange(some)) * step, len(alike))
        same = np.all(heads == want, axis=1)
        if not same.all():
            return known + int(np.argmin(same))
        known += some
        block *= 8
    return known


def group_of(data: np.ndarray, id: int, at: np.ndarray) -> Group:
    """Return the messages whose records begin at these places."""
    heads = rows(data, at, MESSAGE_HEAD)
    length = (
        np.ascontiguousarray(heads[:, 1:9]).view('<u8')[:, 0].astype(np.int64)
        + HEAD
        - MESSAGE_HEAD
    )
    receive = np.ascontiguousarray(heads[:, 15:23]).view('<i8')[:, 0]
    return Group(id, receive, data, at + MESSAGE_HEAD, length)


def indexed(
    data: np.ndarray, index: dict[int, np.ndarray], wanted: set[int]
) -> list[Group] | None:
    """Return the messages where the index says that they are; None where it is not so."""
    found = []
    for id in sorted(index.keys() & wanted):
        if not len(index[id]):
            continue
        if index[id][:, 1].max() + MESSAGE_HEAD > len(data):
            return None
        at = index[id][:, 1].astype(np.int64)
        if np.any(np.diff(at) <= 0):
            at = np.unique(at)
        heads = rows(data, at, HEAD + 2)
        group = group_of(data, id, at)
        true = np.all(heads[:, 0] == MESSAGE) and np.all(
            heads[:, HEAD:] == np.frombuffer(struct.pack('<H', id), np.uint8)
        )
        if not true or np.any(group.length < 0) or np.any(group.begin + group.length > len(data)):
            return None
        found.append(group)
    return found


def string_at(body: bytes, at: int) -> tuple[str, int]:
    """Return a string of a record, and where it ends; raise Damaged where it goes beyond."""
    n = struct.unpack_from('<I', body, at)[0]
    if at + 4 + n > len(body):
        raise Damaged('string')
    return body[at + 4:at + 4 + n].decode(), at + 4 + n


def records(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield op and content of each whole record."""
    for run in walk(data):
        for k in range(run.number):
            yield run.op, data[run.begin + k * run.step + HEAD:run.begin + (k + 1) * run.step]
