# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Rosbag2's sqlite3 files: a table of topics and one of messages.

The messages are taken from the pages of the file (:mod:`sqlite_pages`) where these have the usual
shape, and by SQL otherwise. A file that was cut short is read as far as its pages go. Reading
never writes: the database is opened immutable, unless a write-ahead log lies beside it.

"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
import sqlite3
from urllib.parse import quote

import numpy as np

from .container import Batch, Connection, Counts, Damaged, normal_type, Progress, size_of
from .sqlite_pages import Pages, SOME, Unexpected

MAGIC = b'SQLite format 3\0'
BLOCK = 4096
COLUMNS = ['id', 'topic_id', 'timestamp', 'data']


class SqliteFile:
    """One sqlite3 file of a bag, open for reading."""

    def __init__(self, path: Path):
        self.path = path
        self.problems = Counts()
        self.connections: list[Connection] = []
        self._root = 0
        self.file = open(path, 'rb')
        try:
            self._open()
        except BaseException:
            self.file.close()
            raise

    def _open(self) -> None:
        journal = self.path.with_name(self.path.name + '-wal')
        self._logged = journal.exists() and journal.stat().st_size > 0
        for mode in ['mode=ro'] * self._logged + ['immutable=1']:
            try:
                return self._connect(mode)
            except Damaged:             # the log needs a folder that may be written to
                if mode == 'immutable=1':
                    raise
                self._logged = False

    def _connect(self, mode: str) -> None:
        where = f'file:{quote(str(self.path.absolute()))}?{mode}'
        try:
            self.database = sqlite3.connect(where, uri=True, check_same_thread=False)
        except sqlite3.Error as error:
            raise Damaged(str(error)) from error
        self.database.text_factory = lambda raw: raw.decode(errors='replace')
        try:
            try:
                self._read_topics()
            except sqlite3.DatabaseError:
                # A file shorter than its header says is refused as it is; with this flag its pages
                # are read.
                self.database.execute('PRAGMA writable_schema = ON')
                self.problems.cut = True
                self._read_topics()
        except (sqlite3.Error, Damaged) as error:
            self.database.close()
            raise Damaged(str(error)) from error

    @property
    def warnings(self) -> list[str]:
        """What went wrong so far."""
        return self.problems.sentences(self.path.name)

    def close(self) -> None:
        """Close the database."""
        self.database.close()
        self.file.close()

    def _read_topics(self) -> None:
        ask = self.database.execute
        tables = dict(ask("SELECT name, rootpage FROM sqlite_master WHERE type = 'table'"))
        if not {'topics', 'messages'} <= tables.keys():
            raise Damaged('it has no tables of topics and messages')
        self._root = (
            tables['messages']
            if [r[1] for r in ask('PRAGMA table_info(messages)')] == COLUMNS
            else 0
        )
        text = {}
        if 'message_definitions' in tables:
            try:
                text = dict(
                    ask('SELECT topic_type, encoded_message_definition FROM message_definitions')
                )
            except sqlite3.DatabaseError:
                pass
        self.qos: dict[int, str] = {}
        if 'offered_qos_profiles' in [r[1] for r in ask('PRAGMA table_info(topics)')]:
            self.qos = {id: str(q) for id, q in ask('SELECT id, offered_qos_profiles FROM topics')}
        self.connections = [
            Connection(
                int(id), str(topic), normal_type(str(type)), str(form), str(text.get(type, ''))
            )
            for id, topic, type, form in ask(
                'SELECT id, name, type, serialization_format FROM topics ORDER BY id'
            )
        ]

    def expected(self, id: int) -> int:
        """Return the most messages there can be: the rows are numbered."""
        try:
            return int(self.database.execute('SELECT max(rowid) FROM messages').fetchone()[0] or 0)
        except (sqlite3.DatabaseError, ValueError, TypeError):
            return 0

    def counts(self) -> tuple[dict[int, int], tuple[int, int]]:
        """
        Return the number of messages by topic, and the first and last time (ns).

        Without messages the times are 0.

        """
        ask = self.database.execute
        if not self.problems.cut:
            try:
                low, high = ask('SELECT min(timestamp), max(timestamp) FROM messages').fetchone()
                by_topic = 'SELECT topic_id, count(*) FROM messages GROUP BY topic_id'
                if len(self.connections) == 1:      # then an index is all that has to be read
                    by_topic = f'SELECT {self.connections[0].id}, count(*) FROM messages'
                return dict(ask(by_topic)), (int(low or 0), int(high or 0))
            # a number may have become a text
            except (sqlite3.DatabaseError, ValueError, TypeError):
                self.problems.cut = True
        count: dict[int, int] = {}
        ends = []
        for batch in self.batches([c.id for c in self.connections]):
            id = batch.connection.id
            count[id] = count.get(id, 0) + len(batch.receive)
            ends += [int(batch.receive.min()), int(batch.receive.max())]
        return count, (min(ends), max(ends)) if ends else (0, 0)

    def batches(self, wanted: Collection[int], progress: Progress = None) -> Iterator[Batch]:
        """Yield the messages of these topics in the order of their rows."""
        known = {c.id: c for c in self.connections if c.id in wanted}
        after = 0
        if self._root and not self._logged:
            try:
                for rows, done in self._from_pages():
                    for id, connection in known.items():
                        some = np.flatnonzero(rows.topic == id)
                        if not len(some):
                            continue
                        if rows.length[some].min() < 0:
                            raise Unexpected('long message')
                        yield Batch(
                            connection,
                            rows.time[some],
                            rows.data,
                            rows.begin[some],
                            rows.length[some],
                        )
                    after = int(rows.id.max(initial=after))
                    if progress:
                        progress(done)
                return
            except (Unexpected, Damaged):
                pass            # SQL goes on behind the last row that was given
        for id, connection in known.items():
            for times, blobs in self._by_sql(id, after):
                length = np.fromiter(map(len, blobs), np.int64, len(blobs))
                yield Batch(
                    connection,
                    np.array(times, np.int64),
                    np.frombuffer(b''.join(blobs), np.uint8),
                    np.cumsum(length) - length,
                    length,
                )
        if progress:
            progress(1.0)

    def _from_pages(self) -> Iterator[tuple]:
        """
        Yield rows from the pages, and the fraction done.

        Where the tree is broken, all that look like messages are taken.

        """
        pages = Pages(self.file, size_of(self.file))
        try:
            leaves = pages.leaves(self._root)
            broken = bool(leaves.max(initial=0) * pages.page > pages.size)
        except Damaged:
            broken = True
        if broken:
            self.problems.cut = True
            leaves = pages.every_leaf()
        for k, rows in enumerate(pages.rows(leaves, strict=not broken), 1):
            yield rows, min(1.0, k * SOME / len(leaves))

    def _by_sql(self, id: int, after: int) -> Iterator[tuple]:
        ask = 'SELECT id, timestamp, data FROM messages WHERE topic_id = ? AND id > ? ORDER BY id'
        try:
            cursor = self.database.execute(ask, (id, after))
            while found := cursor.fetchmany(BLOCK):
                after = found[-1][0]
                yield _columns(found)
        except sqlite3.DatabaseError:
            # A damaged page: what the block held before it is read once more, one by one.
            self.problems.cut = True
            found = []
            try:
                for row in self.database.execute(ask, (id, after)):
                    found.append(row)
            except sqlite3.DatabaseError:
                pass
            if found:
                yield _columns(found)


def _columns(rows: list[tuple]) -> tuple:
    _, times, blobs = zip(*rows)
    return [t if isinstance(t, int) else 0 for t in times], [
        b if isinstance(b, bytes) else b'' for b in blobs
    ]
