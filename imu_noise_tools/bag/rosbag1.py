# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Rosbag1 files (version 2.0), whole or cut short: http://wiki.ros.org/Bags/Format/2.0.

A file is a row of records, each a header of named fields and data. Messages lie in chunks; behind
a chunk stands where the messages of each connection are in it. It is read from the front, so that
a recording without the index at its end is read the same way.

"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import struct
from typing import NamedTuple

import numpy as np

from .chunked import ChunkedFile, Group
from .container import (
    AT_LEAST, Connection, Damaged, decompress, normal_type, partly, Progress, rows,
)

MAGIC = b'#ROSBAG V2.0\n'
MESSAGE, BAG, INDEX, CHUNK, CHUNK_INFO, CONNECTION = 2, 3, 4, 5, 6, 7


class Record(NamedTuple):
    """Where a record lies: its header's fields, its data, and its end."""

    fields: dict[bytes, bytes]
    begin: int
    end: int

    @property
    def op(self) -> int:
        """Return what kind of record it is."""
        return (self.fields.get(b'op') or b'\0')[0]


class Chunk(NamedTuple):
    """A chunk record, and the index records behind it (s, ns, offset; (n, 3)) by connection."""

    record: Record
    places: dict[int, np.ndarray] | None


class Rosbag1File(ChunkedFile):
    """One rosbag1 file, open for reading."""

    def __init__(self, path: Path):
        self.raw_connections: dict[int, tuple[dict[bytes, bytes], bytes]] = {}
        super().__init__(path)
        if not self.indexed:
            self.problems.cut = True

    def _record(self, at: int) -> Record | None:
        """Return the record at a place of the file, or None where there is no whole header."""
        self.file.seek(at)
        head = self.file.read(4)
        n = int.from_bytes(head, 'little')
        if len(head) < 4 or n > min(self.size - at, 1 << 24):
            return None
        header = self.file.read(n + 4)
        if len(header) < n + 4:
            return None
        begin = at + 8 + n
        return Record(fields_of(header[:n]), begin, begin + int.from_bytes(header[n:], 'little'))

    def read_summary(self) -> bool:
        """
        Take topics and counts from the index at the end.

        Return False where there is none to be trusted.

        """
        bag = self._record(len(MAGIC))
        if bag is None or bag.op != BAG:
            return False
        at = _number(bag.fields, b'index_pos')
        if not len(MAGIC) < at < self.size:
            return False
        while at < self.size:
            record = self._record(at)
            if record is None or record.end > self.size:
                return False
            self.file.seek(record.begin)
            body = self.file.read(record.end - record.begin)
            if record.op == CONNECTION:
                self._learn(record.fields, body)
            elif record.op == CHUNK_INFO:
                place, begin, end = (_number(record.fields, b'chunk_pos'), *(
                    _time(record.fields.get(k, b'')) for k in (b'start_time', b'end_time')))
                for id, count in struct.iter_unpack('<II', body[:len(body) // 8 * 8]):
                    self.messages[id] = self.messages.get(id, 0) + count
                    self.learn_chunk(id, place, begin, end)
            at = record.end
        return bool(self.known)

    def times_at(self, place: int, id: int) -> np.ndarray:
        """Return the times (ns) of a connection that the index behind a chunk holds, (n,)."""
        chunk = self._record(place)
        index = self._read_index(chunk.end)[0] if chunk and chunk.op == CHUNK else None
        when = (index or {}).get(id, np.empty((0, 3), '<u4')).astype(np.int64)
        return when[:, 0] * 10 ** 9 + when[:, 1]

    def _learn(self, fields: dict[bytes, bytes], body: bytes) -> None:
        more = fields_of(body)
        try:
            id, topic = _number(fields, b'conn'), fields[b'topic'].decode()
            type, text = more[b'type'].decode(), more.get(b'message_definition', b'').decode(
                errors='replace'
            )
        except (KeyError, UnicodeDecodeError):
            self.problems.bad_chunks += 1
            return
        self.raw_connections.setdefault(id, (fields, body))
        self.known.setdefault(id, Connection(id, topic, normal_type(type), 'ros1', text))

    def chunks(self, wanted: set[int] | None, progress: Progress = None) -> Iterator[Chunk]:
        """Yield the chunks that may hold messages of these connections."""
        at = len(MAGIC)
        while at < self.size:
            record = self._record(at)
            if record is None:
                self.problems.cut = True
                return
            after = record.end
            if record.op == CHUNK:
                index, after = self._read_index(record.end)
                if wanted is None or index is None or index.keys() & wanted:
                    yield Chunk(record, index)
            elif record.op == CONNECTION and record.end <= self.size:
                self.file.seek(record.begin)
                self._learn(record.fields, self.file.read(record.end - record.begin))
            if record.end > self.size:
                self.problems.cut = True
                return
            if progress:
                progress(min(1.0, after / self.size))
            at = after

    @staticmethod
    def compression(part: Chunk) -> str:
        """Return how a chunk is compressed."""
        return part.record.fields.get(b'compression', b'none').decode('latin-1')

    def content(self, part: Chunk) -> bytes:
        """Return what a chunk holds, as far as it goes; raise Damaged where that is nothing."""
        self.file.seek(part.record.begin)
        raw = self.file.read(min(part.record.end, self.size) - part.record.begin)
        compression, size = self.compression(part), _number(part.record.fields, b'size')
        if part.record.end <= self.size:
            return decompress(compression, raw, size)
        try:
            return partly(compression, raw, min(size, AT_LEAST))
        except (ValueError, OSError, EOFError, RuntimeError) as error:
            raise Damaged(str(error)) from error

    def groups(self, part: Chunk, wanted: set[int] | None) -> list[Group]:
        """Return the messages of a chunk by connection; nothing of one that is damaged."""
        try:
            raw = self.content(part)
        except Damaged:
            self.problems.bad_chunks += 1
            return []
        data = np.frombuffer(raw, np.uint8)
        if part.places is not None and wanted is not None:
            found = indexed(data, part.places, wanted)
            if found is not None:
                return found
        return [Group(id, times, data, begin, length)
                for id, (_, times, begin, length) in self.walk(raw)[0].items()]

    def _read_index(self, at: int) -> tuple[dict[int, np.ndarray] | None, int]:
        """Return the index records behind a chunk, by connection, and where they end."""
        index: dict[int, np.ndarray] = {}
        while at < self.size:
            record = self._record(at)
            if record is None or record.op != INDEX or record.end > self.size:
                break
            count = _number(record.fields, b'count')
            if _number(record.fields, b'ver') != 1 or record.end - record.begin != 12 * count:
                return None, at
            self.file.seek(record.begin)
            index[_number(record.fields, b'conn')] = np.frombuffer(
                self.file.read(12 * count), '<u4'
            ).reshape(-1, 3)
            at = record.end
        return index or None, at

    def walk(self, raw: bytes) -> tuple[dict[int, np.ndarray], int]:
        """
        Go through a chunk record by record, and learn the connections in it.

        Returns
        -------
        dict of int to ndarray (4, n)
            Place of the record, time (ns), place and length of the message, by connection.
        int
            Where the last whole record ends.

        """
        found: dict[int, list[tuple[int, int, int, int]]] = {}
        at, n = 0, len(raw)
        while at + 8 <= n:
            head = int.from_bytes(raw[at:at + 4], 'little')
            begin = at + 8 + head
            if begin > n:
                break
            length = int.from_bytes(raw[begin - 4:begin], 'little')
            if begin + length > n:
                break
            fields = fields_of(raw[at + 4:at + 4 + head])
            op = (fields.get(b'op') or b'\0')[0]
            if op == MESSAGE:
                id = _number(fields, b'conn')
                found.setdefault(id, []).append(
                    (at, _time(fields.get(b'time', b'')), begin, length)
                )
            elif op == CONNECTION:
                self._learn(fields, raw[begin:begin + length])
            elif op == 0:
                break
            at = begin + length
        return {id: np.array(places, np.int64).T for id, places in found.items()}, at


def indexed(
    data: np.ndarray, index: dict[int, np.ndarray], wanted: set[int]
) -> list[Group] | None:
    """
    Return the messages where the index says that they are.

    Return None where it is not so, or not regular.

    """
    found = []
    for id in sorted(index.keys() & wanted):
        at = index[id][:, 2].astype(np.int64)
        if not len(at):
            continue
        if np.any(np.diff(at) <= 0):
            at = np.unique(at)
        head = int.from_bytes(data[at[0]:at[0] + 4].tobytes(), 'little')
        if head > 256 or at[-1] + 8 + head > len(data):
            return None
        fields = fields_of(data[at[0] + 4:at[0] + 4 + head].tobytes())
        if (
            fields.get(b'op') != bytes([MESSAGE])
            or fields.get(b'conn') != struct.pack('<I', id)
            or len(fields.get(b'time', b'')) != 8
        ):
            return None
        heads = rows(data, at, 8 + head)
        when = heads[0].tobytes().index(b'time=') + 5
        same = np.ones(4 + head, bool)
        same[when:when + 8] = False
        if not np.all(heads[:, :4 + head][:, same] == heads[0, :4 + head][same]):
            return None
        time = np.ascontiguousarray(heads[:, when:when + 8]).view('<u4').astype(np.int64)
        length = np.ascontiguousarray(heads[:, 4 + head:]).view('<u4')[:, 0].astype(np.int64)
        begin = at + 8 + head
        if np.any(begin + length > len(data)):
            return None
        found.append(Group(id, time[:, 0] * 10 ** 9 + time[:, 1], data, begin, length))
    return found


def fields_of(header: bytes) -> dict[bytes, bytes]:
    """Return the named fields of a record's header; what cannot be parsed is left out."""
    fields: dict[bytes, bytes] = {}
    at = 0
    while at + 4 <= len(header):
        n = int.from_bytes(header[at:at + 4], 'little')
        name, equals, value = header[at + 4:at + 4 + n].partition(b'=')
        if not equals or at + 4 + n > len(header):
            break
        fields[name] = value
        at += 4 + n
    return fields


def _number(fields: dict[bytes, bytes], name: bytes) -> int:
    return int.from_bytes(fields.get(name, b''), 'little')


def _time(value: bytes) -> int:
    return int.from_bytes(value[:4], 'little') * 10 ** 9 + int.from_bytes(value[4:8], 'little')
