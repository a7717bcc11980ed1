# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What MCAP and rosbag1 share: messages in chunks, and an index at the end that may be lost."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .container import Batch, Connection, Counts, Progress, Seen, size_of


class Group(NamedTuple):
    """Messages of one connection in one buffer."""

    id: int
    receive: np.ndarray
    data: np.ndarray
    begin: np.ndarray
    length: np.ndarray


class ChunkedFile:
    """
    One file, open for reading.

    A format says how its summary is read, which parts the file has, and which messages are in one.

    """

    def __init__(self, path: Path):
        self.path = path
        self.file = open(path, 'rb')
        self.size = size_of(self.file)
        self.problems = Counts()
        self.known: dict[int, Connection] = {}
        self.messages: dict[int, int] = {}
        self.span = (0, 0)
        # (time, place) of the chunks with the first and the last message of each topic
        self.outer: dict[int, tuple[tuple[int, int], tuple[int, int]]] = {}
        self.ends: dict[int, tuple[int, int]] = {}      # times of those messages, once looked up
        self.indexed = self.read_summary()
        if not self.indexed:
            self._scan()

    def read_summary(self) -> bool:
        """Take topics and counts from the end of the file; False where it cannot be trusted."""
        raise NotImplementedError

    def chunks(self, wanted: set[int] | None, progress: Progress = None) -> Iterator[Any]:
        """Yield the parts that may hold messages of these connections; all, if None."""
        raise NotImplementedError

    def groups(self, part: Any, wanted: set[int] | None) -> list[Group]:
        """Return the messages in a part by connection; learn what else it defines."""
        raise NotImplementedError

    @property
    def connections(self) -> list[Connection]:
        """Topics."""
        return list(self.known.values())

    def know(self, connection: Connection) -> None:
        """Put a connection in the place of the one with its id."""
        self.known[connection.id] = connection

    @property
    def warnings(self) -> list[str]:
        """What went wrong so far."""
        return self.problems.sentences(self.path.name)

    def times_at(self, place: int, id: int) -> np.ndarray:
        """Return the times (ns) of a topic that the index of the chunk at a place holds, (n,)."""
        raise NotImplementedError

    def learn_chunk(self, id: int, place: int, first: int, last: int) -> None:
        """Remember that messages of a topic are in the chunk at a place, from when to when."""
        begin, end = self.outer.get(id, ((first, place), (last, place)))
        self.outer[id] = min(begin, (first, place)), max(end, (last, place))

    def counts(self) -> dict[int, Seen]:
        """Return by topic how many messages there are, and from when to when."""
        return {id: Seen(n, *self._when(id)) for id, n in self.messages.items()}

    def _when(self, id: int) -> tuple[int, int]:
        """Return the first and last time of a topic, as far as the index tells; else of all."""
        if id not in self.ends and id in self.outer:
            (first, begin), (last, end) = self.outer[id]
            begins, ends = (self.times_at(place, id) if place < self.size else np.zeros(0)
                            for place in (begin, end))
            self.ends[id] = (int(np.min(begins)) if len(begins) else first,
                             int(np.max(ends)) if len(ends) else last)
        return self.ends.get(id, self.span)

    def expected(self, id: int) -> int:
        """Return how many messages of a topic the file says that it has."""
        return self.messages.get(id, 0)

    def close(self) -> None:
        """Close the file."""
        self.file.close()

    def _scan(self) -> None:
        """Find and count the topics by reading the whole file."""
        self.messages = {}
        for part in self.chunks(None):
            for group in self.groups(part, None):
                self.messages[group.id] = self.messages.get(group.id, 0) + len(group.receive)
                low, high = int(group.receive.min()), int(group.receive.max())
                begin, end = self.ends.get(group.id, (low, high))
                self.ends[group.id] = min(begin, low), max(end, high)
        self.problems.bad_chunks = 0            # they are counted again when they are read

    def batches(self, wanted: Collection[int], progress: Progress = None) -> Iterator[Batch]:
        """Yield the messages of these connections, part by part."""
        wanted = set(wanted)
        for part in self.chunks(wanted, progress):
            yield from self.batches_of(part, wanted)

    def batches_of(self, part: Any, wanted: set[int]) -> Iterator[Batch]:
        """Yield the messages of these connections in a part, in order of the receive times."""
        for group in sorted(self.groups(part, wanted), key=lambda g: g.id):
            if group.id in wanted and group.id in self.known:
                batch = Batch(self.known[group.id], *group[1:])
                rising = np.all(batch.receive[1:] >= batch.receive[:-1])
                yield batch if rising else batch.take(np.argsort(batch.receive, kind='stable'))
