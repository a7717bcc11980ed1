# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What MCAP and rosbag1 share: messages in chunks, and an index at the end that may be lost."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .container import Batch, Connection, Counts, Progress, size_of


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

    def counts(self) -> tuple[dict[int, int], tuple[int, int]]:
        """
        Return the number of messages by topic, and the first and last time (ns).

        Without messages the times are 0.

        """
        return self.messages, self.span

    def expected(self, id: int) -> int:
        """Return how many messages of a topic the file says that it has."""
        return self.messages.get(id, 0)

    def close(self) -> None:
        """Close the file."""
        self.file.close()

    def _scan(self) -> None:
        """Find and count the topics by reading the whole file."""
        self.messages = {}
        first, last = [], []
        for part in self.chunks(None):
            for group in self.groups(part, None):
                self.messages[group.id] = self.messages.get(group.id, 0) + len(group.receive)
                first.append(int(group.receive.min()))
                last.append(int(group.receive.max()))
        self.span = (min(first), max(last)) if first else (0, 0)
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
