# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Writing MCAP in whole chunks: https://mcap.dev/spec."""

from __future__ import annotations

from collections.abc import Mapping
import struct
from typing import BinaryIO
import zlib

import numpy as np
import zstandard

from .encode import definition
from .mcap_records import (
    ATTACHMENT,
    CHANNEL,
    CHUNK,
    CHUNK_INDEX,
    DATA_END,
    FOOTER,
    HEADER,
    INDEX,
    MAGIC,
    MESSAGE,
    SCHEMA,
    STATISTICS,
    SUMMARY_OFFSET,
)


def record(op: int, body: bytes) -> bytes:
    """Return one record."""
    return struct.pack('<BQ', op, len(body)) + body


def text(value: str) -> bytes:
    """Return a string as records hold it."""
    raw = value.encode()
    return struct.pack('<I', len(raw)) + raw


class McapWriter:
    """
    One MCAP file with an index and a summary.

    Parameters
    ----------
    file : binary file
        Where to; it is closed by the caller.
    compression : str
        ``''`` or ``zstd``.
    profile : str
        ``ros2`` or ``ros1``.

    """

    def __init__(self, file: BinaryIO, compression: str = '', profile: str = 'ros2'):
        self.file = file
        self.compression = compression
        self.schemas: dict[int, bytes] = {}
        self.channels: dict[int, bytes] = {}
        self.count: dict[int, int] = {}
        self._indexes: list[bytes] = []
        self._new: list[bytes] = []         # schemas and channels that no chunk holds yet
        self._first, self._last = 2 ** 63, 0
        self._sequence: dict[int, int] = {}
        self._taken = 0, 0
        self._others = [0, 0]               # attachments, metadata
        self._at = file.write(MAGIC + record(HEADER, text(profile) + text('imu_noise_tools')))

    def _write(self, raw: bytes) -> None:
        self._at += self.file.write(raw)

    def add_schema(self, body: bytes) -> None:
        """Take over a schema record."""
        self._add(self.schemas, SCHEMA, body)

    def add_channel(self, body: bytes) -> None:
        """Take over a channel record."""
        self._add(self.channels, CHANNEL, body)

    def reserve(self, schemas: Mapping[int, bytes], channels: Mapping[int, bytes]) -> None:
        """Give no new topic a number that one of these has."""
        self._taken = max([0, *schemas]), max([0, *channels])

    def known(self, schemas: Mapping[int, bytes], channels: Mapping[int, bytes]) -> None:
        """Take over schemas and channels that the chunks to come hold themselves."""
        self.schemas |= schemas
        self.channels |= channels

    def _add(self, known: dict[int, bytes], op: int, body: bytes) -> None:
        id = int.from_bytes(body[:2], 'little')
        if id not in known:
            known[id] = body
            self._new.append(record(op, body))

    def topic(self, name: str, type: str, encoding: str = 'cdr') -> int:
        """Add a topic; return its channel."""
        for schema, body in self.schemas.items():
            if body[2:].startswith(text(type)):
                break
        else:
            schema = max([self._taken[0], *self.schemas]) + 1
            form = 'ros1msg' if encoding == 'ros1' else 'ros2msg'
            self.add_schema(
                struct.pack('<H', schema)
                + text(type)
                + text(form)
                + text(definition(type, encoding)[0])
            )
        channel = max([self._taken[1], *self.channels]) + 1
        self.add_channel(
            struct.pack('<HH', channel, schema)
            + text(name)
            + text(encoding)
            + struct.pack('<I', 0)
        )
        return channel

    def messages(self, parts: Mapping[int, tuple[np.ndarray, np.ndarray]]) -> None:
        """
        Write one chunk.

        Parameters
        ----------
        parts : mapping of int to (ndarray (n,), ndarray (n, length) uint8)
            Log times (ns) and messages by channel.

        """
        content = [b''.join(self._new)]
        self._new = []
        index, at = {}, len(content[0])
        for channel, (times, rows) in parts.items():
            if not len(times):
                continue
            n, length = rows.shape
            raw = np.empty((n, 31 + length), np.uint8)
            first = self._sequence.get(channel, 0)
            self._sequence[channel] = first + n
            head = np.zeros(
                n,
                np.dtype(
                    [
                        ('op', 'u1'),
                        ('length', '<u8'),
                        ('channel', '<u2'),
                        ('sequence', '<u4'),
                        ('log', '<u8'),
                        ('publish', '<u8'),
                    ]
                ),
            )
            head['op'], head['length'], head['channel'] = MESSAGE, 22 + length, channel
            head['sequence'] = first + np.arange(n)
            head['log'] = head['publish'] = times
            raw[:, :31] = head.view(np.uint8).reshape(n, 31)
            raw[:, 31:] = rows
            content.append(raw.tobytes())
            index[channel] = np.stack([np.asarray(times, np.int64),
                                       at + np.arange(n, dtype=np.int64) * (31 + length)], axis=1)
            at += n * (31 + length)
        raw = b''.join(content)
        if raw:
            packed = (
                zstandard.ZstdCompressor(level=1).compress(raw)
                if self.compression == 'zstd'
                else raw
            )
            self.chunk(packed, self.compression, len(raw), zlib.crc32(raw), index)

    def chunk(
        self, packed: bytes, compression: str, size: int, crc: int, index: Mapping[int, np.ndarray]
    ) -> None:
        """
        Write a chunk as it is, and its index.

        The index is (log time, offset), (n, 2), of its messages by channel.

        """
        times = [i[:, 0] for i in index.values() if len(i)]
        first, last = (
            (int(min(t.min() for t in times)), int(max(t.max() for t in times)))
            if times
            else (0, 0)
        )
        if times:
            self._first, self._last = min(self._first, first), max(self._last, last)
        begin = self._at
        self._write(struct.pack('<BQ', CHUNK, 40 + len(compression) + len(packed))
                    + struct.pack('<QQQI', first, last, size, crc) + text(compression)
                    + struct.pack('<Q', len(packed)))
        self._write(packed)
        end = self._at
        offsets = b''
        for channel, entries in index.items():
            offsets += struct.pack('<HQ', channel, self._at)
            self.count[channel] = self.count.get(channel, 0) + len(entries)
            entries = np.ascontiguousarray(entries, '<i8').tobytes()
            self._write(record(INDEX, struct.pack('<HI', channel, len(entries)) + entries))
        self._indexes.append(
            struct.pack('<QQQQ', first, last, begin, end - begin)
            + struct.pack('<I', len(offsets))
            + offsets
            + struct.pack('<Q', self._at - end)
            + text(compression)
            + struct.pack('<QQ', len(packed), size)
        )

    def other(self, op: int, body: bytes) -> None:
        """Take over an attachment or metadata record."""
        self._others[0 if op == ATTACHMENT else 1] += 1
        self._write(record(op, body))

    def finish(self) -> None:
        """Write the summary and the end."""
        if self._new:
            raw, self._new = b''.join(self._new), []
            self.chunk(raw, '', len(raw), zlib.crc32(raw), {})
        self._write(record(DATA_END, struct.pack('<I', 0)))
        start = self._at
        groups = []
        for op, bodies in ((SCHEMA, self.schemas.values()), (CHANNEL, self.channels.values()),
                           (CHUNK_INDEX, self._indexes), (STATISTICS, [self._statistics()])):
            begin = self._at
            for body in bodies:
                self._write(record(op, body))
            if self._at > begin:
                groups.append(struct.pack('<BQQ', op, begin, self._at - begin))
        offsets = self._at
        for group in groups:
            self._write(record(SUMMARY_OFFSET, group))
        self._write(record(FOOTER, struct.pack('<QQI', start, offsets, 0)) + MAGIC)

    def _statistics(self) -> bytes:
        count = {c: self.count.get(c, 0) for c in self.channels}
        total = sum(count.values())
        pairs = b''.join(struct.pack('<HQ', c, n) for c, n in sorted(count.items()))
        return (
            struct.pack(
                '<QHIIIIQQI',
                total,
                len(self.schemas),
                len(self.channels),
                *self._others,
                len(self._indexes),
                self._first if total else 0,
                self._last,
                len(pairs),
            )
            + pairs
        )
