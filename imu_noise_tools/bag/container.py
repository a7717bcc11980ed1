# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What every kind of bag file looks like to the rest.

A bag has connections; messages come in batches, raw, of one connection each.

A batch is one buffer and the places of many messages in it, so that a decoder can look at all of
them at once. The readers of the three formats (:mod:`mcap`, :mod:`rosbag1`, :mod:`sqlite`) know
nothing of Imu messages.

"""

from __future__ import annotations

import bz2
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass, field
import os
from typing import Any, NamedTuple, Protocol

import lz4.frame
import numpy as np
from numpy.lib.stride_tricks import as_strided
import zstandard

# What is decompressed may be this many times as large as what is compressed, or this large in any
# case: real recordings reach some 30; beyond it, a declared size is a mistake or an attack.
EXPANSION = 200
AT_LEAST = 1 << 28


class Damaged(Exception):
    """A part of a file is not what its format says; what is whole elsewhere is still read."""


@dataclass(frozen=True)
class Connection:
    """
    A topic as one file holds it; ``type`` is always written ``package/msg/Name``.

    ``shape`` says how its messages are read where that is not by their type.

    """

    id: int
    topic: str
    type: str
    encoding: str           # 'cdr' or 'ros1'
    definition: str = ''
    shape: Any = field(default=None, compare=False)     # a fields.Shape

    @property
    def kind(self) -> str:
        """Return the type that its messages are read as."""
        return self.shape.kind if self.shape else self.type


class Batch(NamedTuple):
    """
    Messages of one connection.

    Those at ``data[begin:begin + length]``, with their receive times (ns).

    """

    connection: Connection
    receive: np.ndarray
    data: np.ndarray
    begin: np.ndarray
    length: np.ndarray

    def message(self, k: int) -> bytes:
        """Return the raw bytes of one message."""
        return self.data[self.begin[k]:self.begin[k] + self.length[k]].tobytes()

    def take(self, which: np.ndarray) -> Batch:
        """Return some of the messages."""
        return self._replace(
            receive=self.receive[which], begin=self.begin[which], length=self.length[which]
        )


class Seen(NamedTuple):
    """How many messages of a topic there are, and when the first and the last were received."""

    samples: int
    first: int      # ns
    last: int       # ns

    @classmethod
    def over(cls, parts: Iterable[Seen]) -> Seen:
        """Return what several parts of a bag hold; without messages the times are 0."""
        held = [p for p in parts if p.samples > 0]
        return cls(sum(p.samples for p in held), min((p.first for p in held), default=0),
                   max((p.last for p in held), default=0))

    @property
    def rate_hz(self) -> float | None:
        """Messages in a second from the first to the last; None where that is no time."""
        span = (self.last - self.first) * 1e-9
        return (self.samples - 1) / span if self.samples > 1 and span > 0 else None


class BagFile(Protocol):
    """One file of a bag, open for reading."""

    file: Any

    @property
    def connections(self) -> list[Connection]:
        """Topics."""

    @property
    def warnings(self) -> list[str]:
        """What went wrong so far, for people."""

    def counts(self) -> dict[int, Seen]:
        """Return by topic how many messages there are, and from when to when."""

    def expected(self, id: int) -> int:
        """Return about how many messages of a topic there are, at no cost; 0: not known."""

    def batches(self, wanted: Collection[int], progress: Progress = None) -> Iterator[Batch]:
        """Yield the messages of these connections, by id, in the order of the file."""

    def know(self, connection: Connection) -> None:
        """Put a connection in the place of the one with its id."""

    def close(self) -> None:
        """Let go of the file."""


Progress = Callable[[float], None] | None


@dataclass
class Counts:
    """What went wrong while reading, counted so that it is said once."""

    bad_chunks: int = 0
    cut: bool = False
    others: list[str] = field(default_factory=list)

    def sentences(self, name: str) -> list[str]:
        """Return warnings for people."""
        found = list(self.others)
        if self.cut:
            found.append(f'{name}: the file was cut short; what is whole in it was read')
        if self.bad_chunks:
            found.append(f'{name}: {self.bad_chunks} damaged part(s) were skipped')
        return found


def normal_type(name: str) -> str:
    """
    Return a type's name as ``package/msg/Name``.

    Others write ``package/Name`` or ``package::msg::dds_::Name_``.

    """
    parts = [p for p in name.replace('::', '/').split('/') if p and p != 'dds_']
    if len(parts) == 2:
        parts.insert(1, 'msg')
    return '/'.join(parts)


def rows(data: np.ndarray, begin: np.ndarray, width: int) -> np.ndarray:
    """
    Return the ``width`` bytes at each of the places, (n, width) uint8.

    It is a view where the places are regular.

    The caller has made sure that all of them lie inside ``data``.

    """
    n = len(begin)
    step = int(begin[1] - begin[0]) if n > 1 else width
    if step >= 0 and (n < 3 or np.all(np.diff(begin) == step)):
        return as_strided(
            data[int(begin[0]):] if n else data, (n, width), (step, 1), writeable=False
        )
    # All windows of that width, one byte apart, share the buffer: taking some of them copies row
    # by row.
    return as_strided(data, (len(data) - width + 1, width), (1, 1), writeable=False)[begin]


def decompress(kind: str, raw: bytes, size: int | None) -> bytes:
    """
    Return decompressed bytes.

    Parameters
    ----------
    kind : str
        ``''`` or ``none``, ``lz4``, ``zstd`` or ``bz2``.
    raw : bytes
        What is compressed.
    size : int or None
        The size that the file declares, if it does; more than that is never produced.

    Raises
    ------
    Damaged
        It cannot be decompressed, or to something far larger than the file could honestly hold.

    """
    if kind in ('', 'none'):
        return raw
    limit = max(AT_LEAST, EXPANSION * len(raw))
    if size is not None and size > limit:
        raise Damaged(f'declares {size} bytes, compressed to {len(raw)}')
    out = partly(kind, raw, limit if size is None else size)
    if size is not None and len(out) != size:
        raise Damaged(f'declares {size} bytes and holds {len(out)}')
    return out


def partly(kind: str, raw: bytes, limit: int) -> bytes:
    """
    Return up to ``limit`` decompressed bytes of a stream that may be cut short.

    Raise Damaged where nothing comes out.

    """
    if kind in ('', 'none'):
        return raw[:limit]
    try:
        if kind == 'zstd':
            return _zstd(raw, limit)
        if kind == 'lz4':
            return lz4.frame.LZ4FrameDecompressor().decompress(raw, max_length=limit)
        if kind == 'bz2':
            return bz2.BZ2Decompressor().decompress(raw, max_length=limit)
    except (ValueError, OSError, EOFError, RuntimeError, zstandard.ZstdError) as error:
        raise Damaged(str(error)) from error
    raise Damaged(f'compression {kind!r} is not known')


def _zstd(raw: bytes, limit: int) -> bytes:
    known = zstandard.frame_content_size(raw)
    if 0 < known <= limit:
        try:
            return zstandard.ZstdDecompressor().decompress(raw)
        except zstandard.ZstdError:
            # cut short: what comes out of the stream before the cut is taken
            pass
    out = bytearray()
    stream = zstandard.ZstdDecompressor().stream_reader(raw, read_across_frames=True)
    try:
        while len(out) < limit:
            some = stream.read(min(1 << 20, limit - len(out)))
            if not some:
                break
            out += some
    except zstandard.ZstdError:
        if not out:
            raise
    return bytes(out)


def size_of(file: Any) -> int:
    """Return the size of an open file."""
    return os.fstat(file.fileno()).st_size
