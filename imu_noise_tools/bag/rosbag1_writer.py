# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Writing rosbag1 (version 2.0) in whole chunks: http://wiki.ros.org/Bags/Format/2.0."""

from __future__ import annotations

import bz2
from collections.abc import Mapping
import struct
from typing import BinaryIO

import lz4.frame
import numpy as np

from .encode import definition, split_stamp
from .rosbag1 import BAG, CHUNK, CHUNK_INFO, CONNECTION, INDEX, MAGIC, MESSAGE


PACK = {'none': lambda raw: raw, 'lz4': lz4.frame.compress, 'bz2': bz2.compress}


def header(**fields: bytes) -> bytes:
    """Return a record's header, its length before it."""
    raw = b''.join(struct.pack('<I', len(name) + 1 + len(value)) + name.encode() + b'=' + value
                   for name, value in fields.items())
    return struct.pack('<I', len(raw)) + raw


def record(data: bytes, **fields: bytes) -> bytes:
    """Return one record."""
    return header(**fields) + struct.pack('<I', len(data)) + data


def u32(value: int) -> bytes:
    """Return a number as fields hold it."""
    return struct.pack('<I', value)


def stamp(ns: int) -> bytes:
    """Return a time as fields hold it."""
    return struct.pack('<II', *divmod(int(ns), 1_000_000_000))


class Rosbag1Writer:
    """One rosbag1 file with an index; ``file`` is closed by the caller."""

    def __init__(self, file: BinaryIO):
        self.file = file
        self.connections: dict[int, bytes] = {}
        self.count: dict[int, int] = {}
        self._infos: list[bytes] = []
        self._new: list[bytes] = []
        file.write(MAGIC)
        self._head(0)

    def _head(self, index: int) -> None:
        fields = {
            'op': bytes([BAG]),
            'index_pos': struct.pack('<Q', index),
            'conn_count': u32(len(self.connections)),
            'chunk_count': u32(len(self._infos)),
        }
        head = header(**fields)
        self.file.write(head + u32(4096 - 4 - len(head)) + b' ' * (4096 - 4 - len(head)))

    def add_connection(self, id: int, raw: bytes) -> None:
        """Take over a connection record."""
        if id not in self.connections:
            self.connections[id] = raw
            self._new.append(raw)

    def topic(self, name: str, type: str, encoding: str = 'ros1') -> int:
        """Add a topic; return its connection."""
        text, md5 = definition(type, 'ros1')
        id = max(self.connections, default=-1) + 1
        data = header(
            topic=name.encode(),
            type=type.replace('/msg/', '/').encode(),
            md5sum=md5.encode(),
            message_definition=text.encode(),
        )[4:]
        self.add_connection(
            id, record(data, op=bytes([CONNECTION]), conn=u32(id), topic=name.encode())
        )
        return id

    def messages(self, parts: Mapping[int, tuple[np.ndarray, np.ndarray]], before: bytes = b'',
                 index: Mapping[int, np.ndarray] | None = None, compression: str = 'none') -> None:
        """
        Write one chunk.

        Parameters
        ----------
        parts : mapping of int to (ndarray (n,), ndarray (n, length) uint8)
            Receive times (ns) and messages by connection.
        before : bytes
            Records that the chunk begins with.
        index : mapping of int to ndarray (n, 3), optional
            Where the messages in ``before`` are, as :meth:`chunk` takes it.
        compression : str
            ``none``, ``lz4`` or ``bz2``.

        """
        content = [before, *self._new]
        self._new = []
        found = dict(index or {})
        at = sum(map(len, content))
        for id, (times, rows) in parts.items():
            if not len(times):
                continue
            n, length = rows.shape
            one = header(op=bytes([MESSAGE]), conn=u32(id), time=bytes(8)) + u32(length)
            raw = np.empty((n, len(one) + length), np.uint8)
            raw[:, :len(one)] = np.frombuffer(one, np.uint8)
            when = one.index(b'time=') + 5
            split = split_stamp(times)
            raw[:, when:when + 8] = split
            raw[:, len(one):] = rows
            content.append(raw.tobytes())
            places = (at + np.arange(n) * raw.shape[1]).astype('<u4')
            entries = np.concatenate([split.view('<u4'), places[:, None]], axis=1)
            found[id] = np.concatenate([found[id], entries]) if id in found else entries
            at += raw.size
        raw = b''.join(content)
        if raw:
            self.chunk(PACK[compression](raw), compression, len(raw), found)

    def chunk(
        self, packed: bytes, compression: str, size: int, index: Mapping[int, np.ndarray]
    ) -> None:
        """
        Write a chunk as it is, and its index.

        The index is (s, ns, offset), (n, 3), of its messages by connection.

        """
        begin = self.file.tell()
        self.file.write(
            record(packed, op=bytes([CHUNK]), compression=compression.encode(), size=u32(size))
        )
        for id, entries in index.items():
            self.count[id] = self.count.get(id, 0) + len(entries)
            self.file.write(
                record(
                    np.ascontiguousarray(entries, '<u4').tobytes(),
                    op=bytes([INDEX]),
                    ver=u32(1),
                    conn=u32(id),
                    count=u32(len(entries)),
                )
            )
        times = np.concatenate(
            [i[:, 0].astype(np.int64) * 10**9 + i[:, 1] for i in index.values()] or [[0]]
        )
        self._infos.append(
            record(
                b''.join(struct.pack('<II', id, len(i)) for id, i in index.items()),
                op=bytes([CHUNK_INFO]),
                ver=u32(1),
                chunk_pos=struct.pack('<Q', begin),
                start_time=stamp(times.min()),
                end_time=stamp(times.max()),
                count=u32(len(index)),
            )
        )

    def finish(self) -> None:
        """Write the index and complete the head."""
        if self._new:
            raw, self._new = b''.join(self._new), []
            self.chunk(raw, 'none', len(raw), {})
        index = self.file.tell()
        self.file.write(b''.join([*self.connections.values(), *self._infos]))
        self.file.seek(len(MAGIC))
        self._head(index)
