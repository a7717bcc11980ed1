# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Rosbag2's sqlite3 files: a table of topics and one of messages.

A file that was cut short, or a page of which is damaged, is read as far as the rest goes. Reading
never writes: the database is opened immutable, unless a write-ahead log lies beside it.

"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
import sqlite3
from typing import Any
from urllib.parse import quote

import numpy as np

from .container import Batch, Connection, Counts, Damaged, normal_type, Progress, Seen, size_of

MAGIC = b'SQLite format 3\0'
BLOCK = 4096
# what of the rows of some topics (which) that are sound, from an id on; in the order of their ids
ROWS = 'SELECT {} FROM messages NOT INDEXED WHERE topic_id IN ({}) {} AND id > ?'
# numbers of a block of rows as text, the bytes of all of them as one
JOINED = ("max(id), count(*), {topic}, group_concat(timestamp), group_concat(length(data)), "
          "CAST(group_concat(data, '') AS BLOB)")
#: topics, times (ns) and lengths of rows, and the bytes of all
Columns = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


class SqliteFile:
    """One sqlite3 file of a bag, open for reading."""

    def __init__(self, path: Path):
        self.path = path
        self.problems = Counts()
        self.connections: list[Connection] = []
        self.file = open(path, 'rb')
        try:
            self._open()
        except BaseException:
            self.file.close()
            raise

    def _open(self) -> None:
        journal = self.path.with_name(self.path.name + '-wal')
        logged = journal.exists() and journal.stat().st_size > 0
        for mode in ['mode=ro'] * logged + ['immutable=1']:
            try:
                return self._connect(mode)
            except Damaged:             # the log needs a folder that may be written to
                if mode == 'immutable=1':
                    raise

    def _connect(self, mode: str) -> None:
        where = f'file:{quote(str(self.path.absolute()))}?{mode}'
        try:
            self.database = sqlite3.connect(where, uri=True, check_same_thread=False)
        except sqlite3.Error as error:
            raise Damaged(str(error)) from error
        self.joins = False
        self.database.text_factory = lambda raw: raw.decode(errors='replace')
        try:
            try:
                # any bytes are text that SQL can put together, if text is UTF-8
                self.joins = self.database.execute('PRAGMA encoding').fetchone() == ('UTF-8',)
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
        tables = {row[0] for row in ask("SELECT name FROM sqlite_master WHERE type = 'table'")}
        if not {'topics', 'messages'} <= tables:
            raise Damaged('it has no tables of topics and messages')
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

    def know(self, connection: Connection) -> None:
        """Put a connection in the place of the one with its id."""
        self.connections = [connection if c.id == connection.id else c for c in self.connections]

    def expected(self, id: int) -> int:
        """Return the most messages there can be: the rows are numbered."""
        try:
            return int(self.database.execute('SELECT max(rowid) FROM messages').fetchone()[0] or 0)
        except (sqlite3.DatabaseError, ValueError, TypeError):
            return 0

    def counts(self) -> dict[int, Seen]:
        """Return by topic how many messages there are, and from when to when."""
        if not self.problems.cut:
            what = 'count(*), min(timestamp), max(timestamp) FROM messages'
            by_topic = f'SELECT topic_id, {what} GROUP BY topic_id'
            if len(self.connections) == 1:      # then an index is all that has to be read
                by_topic = f'SELECT {self.connections[0].id}, {what}'
            try:
                return {id: Seen(n, int(low or 0), int(high or 0))
                        for id, n, low, high in self.database.execute(by_topic)}
            # a number may have become a text
            except (sqlite3.DatabaseError, ValueError, TypeError):
                self.problems.cut = True
        found: dict[int, Seen] = {}
        for batch in self.batches([c.id for c in self.connections]):
            id, when = batch.connection.id, batch.receive
            more = Seen(len(when), int(when.min()), int(when.max()))
            found[id] = Seen.over([more, *([found[id]] if id in found else [])])
        return found

    def batches(self, wanted: Collection[int], progress: Progress = None) -> Iterator[Batch]:
        """Yield the messages of these topics in the order of their rows."""
        known = {c.id: c for c in self.connections if c.id in wanted}
        last = self.expected(0)
        for at, (topic, time, length, data) in self._blocks(known):
            begin = np.cumsum(length) - length
            for id, connection in known.items():
                some = np.flatnonzero(topic == id)
                if len(some):
                    yield Batch(connection, time[some], data, begin[some], length[some])
            if progress and last:
                progress(min(1.0, at / last))
        if progress:
            progress(1.0)

    def _blocks(self, topics: Collection[int]) -> Iterator[tuple[int, Columns]]:
        """
        Yield id of the last row and columns of a block of rows at a time.

        Where a page is damaged it goes on behind it, with the first row that a search by id finds.

        """
        sound = ''
        if tail := self._cut_page():
            self.database.create_function('whole', 1, partial(_whole, tail))
            sound = 'AND whole(data)'
        of = ', '.join('?' * len(topics))
        topic = 'NULL' if len(topics) == 1 else 'group_concat(topic_id)'    # that of all is known
        one_by_one, joined = (ROWS.format(what, of, sound) for what in (
            'id, topic_id, timestamp, data', JOINED.format(topic=topic)))
        after, step, block = 0, 0, BLOCK
        while after + step < 2 ** 62:
            try:
                found = self._joined(joined, (*topics, after + step), block) or self._rows(
                    one_by_one, (*topics, after + step), block)
            except sqlite3.DatabaseError:
                self.problems.cut = True
                # A block is lost with its last row: the rows before the damage come one by one.
                step, block = (step, 1) if block > 1 else (2 * step or 1, 1)
                continue
            if found is None:
                return
            block = BLOCK if step else block        # it is behind the damage
            after, step = max(after + step, found[0]), 0
            yield found

    def _joined(self, ask: str, values: tuple[int, ...],
                block: int) -> tuple[int, Columns] | None:
        """
        Return id of the last row and columns of the rows whose ids are the next of a block.

        SQL puts them together in a third of the time that handing them over one by one takes. None
        where it cannot, and where there are none: the ids may have a gap.

        """
        if not self.joins:
            return None
        id, n, *text, data = self.database.execute(
            f'{ask} AND id <= ?', (*values, values[-1] + block)).fetchone()
        with suppress(ValueError):      # it is no number
            topic, time, length = (np.fromstring(x or '', np.int64, sep=',') for x in text)
            if len(values) == 2:
                topic = np.full(n, values[0])
            whole = len(topic) == len(time) == len(length) == n > 0
            if whole and length.sum() == len(data or b''):
                return id, (topic, time, length, np.frombuffer(data or b'', np.uint8))
        return None

    def _rows(self, ask: str, values: tuple[int, ...], block: int) -> tuple[int, Columns] | None:
        """Return id of the last and columns of so many rows at most; None without any."""
        found = self.database.execute(f'{ask} ORDER BY id LIMIT ?', (*values, block))
        # flipped bits make other types than there should be
        rows = [_mended(row) for row in found]
        if not rows:
            return None
        _, topic, time, blobs = zip(*rows)
        return rows[-1][0], (np.array(topic, np.int64), np.array(time, np.int64),
                             np.fromiter(map(len, blobs), np.int64, len(blobs)),
                             np.frombuffer(b''.join(blobs), np.uint8))

    def _cut_page(self) -> bytes:
        """Return what there is of a page that the end of the file cuts; nothing of a whole one."""
        self.file.seek(16)
        page = int.from_bytes(self.file.read(2), 'big')
        page = 65536 if page == 1 else max(page, 512)
        self.file.seek(size_of(self.file) // page * page)
        return self.file.read()


def _mended(row: tuple) -> tuple:
    """Return a row with a time of 0 and no data for those that are of another type."""
    return (*row[:2], row[2] if isinstance(row[2], int) else 0,
            row[3] if isinstance(row[3], bytes) else b'')


def _whole(tail: bytes, data: Any) -> bool:
    """Tell whether a row's data end before the end of the file: sqlite gives zeros from there."""
    at = tail.rfind(data.rstrip(b'\0')) if isinstance(data, bytes) else -1
    return at < 0 or at + len(data) <= len(tail)
