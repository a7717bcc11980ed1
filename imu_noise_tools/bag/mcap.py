"""
MCAP files, whole or cut short: https://mcap.dev/spec.

A file is a row of records, op (1 byte), length (8) and content. It is read from the front, without
need of the summary at its end, so that a recording which lost its end to a crash is read the same
way. The index behind a chunk says where the messages of a topic lie in it, and each place is
checked; without an index the records are walked.

"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
import struct
from typing import NamedTuple
import zlib

import numpy as np

from .container import (
    AT_LEAST,
    Batch,
    Connection,
    Counts,
    Damaged,
    decompress,
    normal_type,
    partly,
    Progress,
    rows,
    size_of,
)

MAGIC = b'\x89MCAP0\r\n'
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, INDEX = 1, 2, 3, 4, 5, 6, 7
ATTACHMENT, STATISTICS, METADATA, DATA_END = 9, 11, 12, 15
HEAD = 9                # op and length
MESSAGE_HEAD = 31       # and channel (2), sequence (4), log time (8), publish time (8)
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


class McapFile:
    """One MCAP file, open for reading."""

    def __init__(self, path: Path, file=None):
        self.path = path
        self.file = file or open(path, 'rb')
        self.size = size_of(self.file)
        self.problems = Counts()
        self.span = (0, 0)
        self._schemas: dict[int, tuple[str, str]] = {}
        self._channels: dict[int, Connection] = {}
        self._messages: dict[int, int] = {}
        self.raw_schemas: dict[int, bytes] = {}
        self.raw_channels: dict[int, bytes] = {}
        self.profile = 'ros2'
        self.indexed = self._read_summary()
        if not self.indexed:
            self._scan()

    @property
    def connections(self) -> list[Connection]:
        """Topics."""
        return list(self._channels.values())

    def counts(self) -> tuple[dict[int, int], tuple[int, int]]:
        """
        Return the number of messages by topic, and the first and last time (ns).

        Without messages the times are 0.

        """
        return self._messages, self.span

    @property
    def warnings(self) -> list[str]:
        """What went wrong so far."""
        return self.problems.sentences(self.path.name)

    def close(self) -> None:
        """Close the file."""
        self.file.close()

    # -- the summary at the end

    def _read_summary(self) -> bool:
        """Take topics and counts from the summary; return False where it cannot be trusted."""
        if self.size < 8 + 37:
            return False
        self.file.seek(self.size - 37)
        tail = self.file.read(37)
        if tail[-8:] != MAGIC or tail[0] != FOOTER:
            return False
        start = int.from_bytes(tail[9:17], 'little')
        if not 8 < start < self.size - 37:
            return False
        self.file.seek(start)
        summary = self.file.read(self.size - 37 - start)
        found = None
        for op, body in _records(summary):
            self._learn(op, body)
            if op == STATISTICS and len(body) >= 46:
                found = body
        if not self._channels or found is None:
            return False
        self.span = struct.unpack_from('<QQ', found, 26)
        pairs = np.frombuffer(
            found[46:46 + (len(found) - 46) // 10 * 10], np.dtype([('id', '<u2'), ('n', '<u8')])
        )
        self._messages = {int(p['id']): int(p['n']) for p in pairs}
        return True

    def _learn(self, op: int, body: bytes) -> None:
        """Remember a schema or a channel; what cannot be read is left alone."""
        try:
            if op == SCHEMA:
                name, at = _string(body, 2)
                encoding, at = _string(body, at)
                text, _ = _string(body, at)
                id = struct.unpack_from('<H', body)[0]
                self._schemas[id] = (name, text if encoding == 'ros2msg' else '')
                self.raw_schemas.setdefault(id, body)
            elif op == CHANNEL:
                id, schema = struct.unpack_from('<HH', body)
                topic, at = _string(body, 4)
                encoding, _ = _string(body, at)
                name, text = self._schemas.get(schema, ('', ''))
                self._channels.setdefault(
                    id, Connection(id, topic, normal_type(name), encoding, text)
                )
                self.raw_channels.setdefault(id, body)
        except (struct.error, UnicodeDecodeError, Damaged):
            self.problems.bad_chunks += 1

    def _scan(self) -> None:
        """Count the messages of every topic by reading the whole file."""
        first, last = [], []
        for part in self._chunks(None, None):
            for id, receive, *_ in self._groups(part, None):
                self._messages[id] = self._messages.get(id, 0) + len(receive)
                first.append(int(receive.min()))
                last.append(int(receive.max()))
        self.span = (min(first), max(last)) if first else (0, 0)
        self.problems.bad_chunks = 0          # they are counted again when they are read

    # -- the data

    def batches(self, wanted: Collection[int], progress: Progress = None) -> Iterator[Batch]:
        """Yield the messages of these channels, chunk by chunk, each by log time."""
        wanted = set(wanted)
        for part in self._chunks(wanted, progress):
            yield from self.batches_of(part, wanted)

    def batches_of(self, part: Chunk | bytes, wanted: set[int]) -> Iterator[Batch]:
        """Yield the messages of these channels in a chunk, or in a row of records."""
        for id, receive, data, begin, length in sorted(
            self._groups(part, wanted), key=lambda g: g[0]
        ):
            if id in wanted and id in self._channels:
                batch = Batch(self._channels[id], receive, data, begin, length)
                yield batch if _rising(receive) else batch.take(np.argsort(receive, kind='stable'))

    def parts(self, progress: Progress = None) -> Iterator[Chunk | bytes | Other]:
        """
        Yield all of the file but its summary.

        It holds chunks, rows of records outside of them, and other records.

        """
        return self._chunks(None, progress, others=True)

    def _groups(self, part: Chunk | bytes, wanted: set[int] | None) -> list[Group]:
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
            found = _indexed(np.frombuffer(raw, np.uint8), part.places, wanted)
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
        return [_group(data, id, np.concatenate(at)) for id, at in places.items()]

    def _chunks(
        self, wanted: set[int] | None, progress: Progress, others: bool = False
    ) -> Iterator:
        """Yield chunks that may hold what is wanted, and rows of messages outside of chunks."""
        at = len(MAGIC)
        while at + HEAD <= self.size:
            self.file.seek(at)
            head = self.file.read(HEAD)
            op, length = head[0], int.from_bytes(head[1:], 'little')
            end = at + HEAD + length
            if op in (FOOTER, DATA_END):
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


class Group(NamedTuple):
    """Messages of one channel in one buffer."""

    id: int
    receive: np.ndarray
    data: np.ndarray
    begin: np.ndarray
    length: np.ndarray


def _group(data: np.ndarray, id: int, at: np.ndarray) -> Group:
    """Return the messages whose records begin at these places."""
    heads = rows(data, at, MESSAGE_HEAD)
    length = (
        np.ascontiguousarray(heads[:, 1:9]).view('<u8')[:, 0].astype(np.int64)
        + HEAD
        - MESSAGE_HEAD
    )
    receive = np.ascontiguousarray(heads[:, 15:23]).view('<i8')[:, 0]
    return Group(id, receive, data, at + MESSAGE_HEAD, length)


def _indexed(
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
        group = _group(data, id, at)
        true = np.all(heads[:, 0] == MESSAGE) and np.all(
            heads[:, HEAD:] == np.frombuffer(struct.pack('<H', id), np.uint8)
        )
        if not true or np.any(group.length < 0) or np.any(group.begin + group.length > len(data)):
            return None
        found.append(group)
    return found


def _rising(x: np.ndarray) -> bool:
    return bool(np.all(x[1:] >= x[:-1]))


def _string(body: bytes, at: int) -> tuple[str, int]:
    n = struct.unpack_from('<I', body, at)[0]
    if at + 4 + n > len(body):
        raise Damaged('string')
    return body[at + 4:at + 4 + n].decode(), at + 4 + n


def _records(data: bytes) -> Iterator[tuple[int, bytes]]:
    for run in walk(data):
        for k in range(run.number):
            yield run.op, data[run.begin + k * run.step + HEAD:run.begin + (k + 1) * run.step]
