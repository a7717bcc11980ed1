# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
MCAP files, whole or cut short: https://mcap.dev/spec.

A file is a row of records, op (1 byte), length (8) and content. It is read from the front, without
need of the summary at its end, so that a recording which lost its end to a crash is read the same
way. The index behind a chunk says where the messages of a topic lie in it, and each place is
checked; without an index the records are walked.

"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
import struct
from typing import NamedTuple
import zlib

import numpy as np

from .chunked import ChunkedFile, Group
from .container import AT_LEAST, Connection, Damaged, decompress, normal_type, partly, Progress
from .mcap_records import (
    ATTACHMENT, CHANNEL, CHUNK, CHUNK_INDEX, DATA_END, FOOTER, group_of, HEAD, HEADER, INDEX,
    indexed, MAGIC, MESSAGE, MESSAGE_HEAD, METADATA, records, SCHEMA, STATISTICS, string_at, walk,
)

WINDOW = 1 << 22        # how much of a file without chunks is looked at together


class Chunk(NamedTuple):
    """One chunk record as it lies in the file, and the index records behind it."""

    compression: str
    size: int
    crc: int
    raw: bytes
    places: dict[int, np.ndarray] | None         # (n, 2): log time, offset
    whole: bool = True


class Other(NamedTuple):
    """An attachment or metadata record."""

    op: int
    body: bytes


class McapFile(ChunkedFile):
    """One MCAP file, open for reading."""

    def __init__(self, path: Path):
        self._schemas: dict[int, tuple[str, str]] = {}
        self.raw_schemas: dict[int, bytes] = {}
        self.raw_channels: dict[int, bytes] = {}
        self.profile = 'ros2'
        self._ends = False          # with the magic that only a finished file has
        super().__init__(path)

    def read_summary(self) -> bool:
        """Take topics and counts from the summary; return False where it cannot be trusted."""
        if self.size < 8 + 37:
            return False
        self.file.seek(self.size - 37)
        tail = self.file.read(37)
        self._ends = tail[-8:] == MAGIC
        if tail[-8:] != MAGIC or tail[0] != FOOTER:
            return False
        start = int.from_bytes(tail[9:17], 'little')
        if not 8 < start < self.size - 37:
            return False
        self.file.seek(start)
        summary = self.file.read(self.size - 37 - start)
        found = None
        for op, body in records(summary):
            self._learn(op, body)
            if op == CHUNK_INDEX:
                self._learn_index(body)
            if op == STATISTICS and len(body) >= 46:
                found = body
        if not self.known or found is None:
            return False
        self.span = struct.unpack_from('<QQ', found, 26)
        pairs = np.frombuffer(
            found[46:46 + (len(found) - 46) // 10 * 10], np.dtype([('id', '<u2'), ('n', '<u8')])
        )
        self.messages = {int(p['id']): int(p['n']) for p in pairs}
        return True

    def _learn(self, op: int, body: bytes) -> None:
        """Remember a schema or a channel; what cannot be read is left alone."""
        try:
            if op == SCHEMA:
                name, at = string_at(body, 2)
                encoding, at = string_at(body, at)
                text, _ = string_at(body, at)
                id = struct.unpack_from('<H', body)[0]
                self._schemas[id] = (name, text if encoding == 'ros2msg' else '')
                self.raw_schemas.setdefault(id, body)
            elif op == CHANNEL:
                id, schema = struct.unpack_from('<HH', body)
                topic, at = string_at(body, 4)
                encoding, _ = string_at(body, at)
                name, text = self._schemas.get(schema, ('', ''))
                self.known.setdefault(
                    id, Connection(id, topic, normal_type(name), encoding, text)
                )
                self.raw_channels.setdefault(id, body)
        except (struct.error, UnicodeDecodeError, Damaged):
            self.problems.bad_chunks += 1

    def _learn_index(self, body: bytes) -> None:
        """Remember which channels a chunk holds, from when to when."""
        if len(body) < 36:
            return
        first, last, start, length, size = struct.unpack_from('<QQQQI', body)
        pairs = body[36:36 + size]
        for id, _ in struct.iter_unpack('<HQ', pairs[:len(pairs) // 10 * 10]):
            self.learn_chunk(id, start + length, first, last)

    def times_at(self, place: int, id: int) -> np.ndarray:
        """Return the times (ns) of a channel that the index behind a chunk holds, (n,)."""
        index, _ = self._read_index(place, {id})
        return (index or {}).get(id, np.empty((0, 2), '<u8'))[:, 0].astype(np.int64)

    def parts(self, progress: Progress = None) -> Iterator[Chunk | bytes | Other]:
        """
        Yield all of the file but its summary.

        It holds chunks, rows of records outside of them, and other records.

        """
        return self.chunks(None, progress, others=True)

    def groups(self, part: Chunk | bytes, wanted: set[int] | None) -> list[Group]:
        """Return the messages of a chunk by channel; nothing of one that is damaged."""
        if isinstance(part, bytes):
            return self._walk(part)
        try:
            raw = self.content(part)
        except Damaged:
            self.problems.bad_chunks += 1
            return []
        found = None
        if wanted is not None and part.places is not None:
            found = indexed(np.frombuffer(raw, np.uint8), part.places, wanted)
        return self._walk(raw) if found is None else found

    def content(self, chunk: Chunk) -> bytes:
        """
        Return what a chunk holds, as far as it goes.

        Raise Damaged where its checksum does not fit.

        """
        if not chunk.whole:
            return partly(chunk.compression, chunk.raw, min(chunk.size, AT_LEAST))
        raw = decompress(chunk.compression, chunk.raw, chunk.size)
        if chunk.crc and zlib.crc32(raw) != chunk.crc:
            raise Damaged('checksum')
        return raw

    def _walk(self, raw: bytes) -> list[Group]:
        """Return the messages of a row of records, and learn the schemas and channels in it."""
        places: dict[int, list[np.ndarray]] = {}
        for run in walk(raw):
            if run.op == MESSAGE and run.step >= MESSAGE_HEAD:
                id = int.from_bytes(raw[run.begin + HEAD:run.begin + HEAD + 2], 'little')
                places.setdefault(id, []).append(run.begin + run.step * np.arange(run.number))
            elif run.op in (SCHEMA, CHANNEL):
                self._learn(run.op, raw[run.begin + HEAD:run.begin + run.step])
        data = np.frombuffer(raw, np.uint8)
        return [group_of(data, id, np.concatenate(at)) for id, at in places.items()]

    def chunks(
        self, wanted: set[int] | None, progress: Progress = None, others: bool = False
    ) -> Iterator:
        """Yield chunks that may hold what is wanted, and rows of messages outside of chunks."""
        at = len(MAGIC)
        while at + HEAD <= self.size:
            self.file.seek(at)
            head = self.file.read(HEAD)
            op, length = head[0], int.from_bytes(head[1:], 'little')
            end = at + HEAD + length
            if op in (FOOTER, DATA_END):
                self.problems.cut = not self._ends
                return
            if op == CHUNK:
                chunk, end = self._read_chunk(at + HEAD, end, wanted)
                if chunk is not None:
                    yield chunk
            elif op == MESSAGE:
                window, end = self._window(at, end)
                if window:
                    yield window
            elif op in (SCHEMA, CHANNEL) and end <= self.size:
                self._learn(op, self.file.read(length))
            elif op == HEADER and length >= 4 and end <= self.size:
                self.profile = self.file.read(min(length, 64))[4:8].decode('latin-1')
            elif others and op in (ATTACHMENT, METADATA) and end <= self.size:
                yield Other(op, self.file.read(length))
            if progress:
                progress(min(1.0, end / self.size))
            at = end
        self.problems.cut = True

    def _read_chunk(self, at: int, end: int, wanted: set[int] | None) -> tuple[Chunk | None, int]:
        whole = end <= self.size
        head = self.file.read(32)
        if len(head) < 32:
            return None, self.size
        _, _, size, crc, n = struct.unpack('<QQQII', head)
        rest = self.file.read(n + 8) if n <= 64 else b''
        if len(rest) != n + 8:
            self.problems.bad_chunks += 1
            return None, end
        compression, stored = rest[:n].decode('latin-1'), int.from_bytes(rest[n:], 'little')
        begin = at + 40 + n
        if not whole:
            return Chunk(compression, size, 0, self.file.read(), None, False), self.size
        if begin + stored > end:
            self.problems.bad_chunks += 1
            return None, end
        index, after = self._read_index(end, wanted)
        if index is not None and wanted is not None and not index.keys() & wanted:
            return None, after
        self.file.seek(begin)
        return Chunk(compression, size, crc, self.file.read(stored), index), after

    def _read_index(
        self, at: int, wanted: set[int] | None
    ) -> tuple[dict[int, np.ndarray] | None, int]:
        """Return the index records that follow a chunk, by channel, and where they end."""
        index: dict[int, np.ndarray] = {}
        self.file.seek(at)
        while True:
            head = self.file.read(HEAD)
            length = int.from_bytes(head[1:], 'little')
            if len(head) < HEAD or head[0] != INDEX or at + HEAD + length > self.size:
                return index or None, at
            body = self.file.read(length) if length < 1 << 28 else b''
            if len(body) != length or length < 6 or (length - 6) % 16:
                return None, at
            id = int.from_bytes(body[:2], 'little')
            if wanted is None or id in wanted:
                index[id] = np.frombuffer(body, '<u8', offset=6).reshape(-1, 2)
            else:
                index.setdefault(id, np.empty((0, 2), '<u8'))
            at += HEAD + length

    def _window(self, at: int, end: int) -> tuple[bytes, int]:
        """Return whole records from here on, and where they end."""
        self.file.seek(at)
        raw = self.file.read(min(max(WINDOW, end - at), self.size - at))
        stop = 0
        for run in walk(raw):
            if run.op in (CHUNK, FOOTER, DATA_END):
                break
            stop = run.begin + run.step * run.number
        return raw[:stop], at + stop if stop else self.size + 1
