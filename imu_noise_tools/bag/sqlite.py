"""
Rosbag2's sqlite3 files: a table of topics and one of messages.

Opened immutable where nothing is beside them, so that reading never writes. A file that was cut short is
read as far as its pages go.

"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
import sqlite3
from urllib.parse import quote

import numpy as np

from .container import Batch, Connection, Counts, Damaged, normal_type, Progress

MAGIC = b'SQLite format 3\0'
BLOCK = 4096


class SqliteFile:
    """One sqlite3 file of a bag, open for reading."""

    def __init__(self, path: Path):
        self.path = path
        self.counts = Counts()
        self.connections: list[Connection] = []
        self.span = (0, 0)
        self._open()

    def _open(self) -> None:
        journal = self.path.with_name(self.path.name + '-wal')
        mode = 'mode=ro' if journal.exists() and journal.stat().st_size else 'immutable=1'
        self.database = sqlite3.connect(f'file:{quote(str(self.path))}?{mode}', uri=True, check_same_thread=False)
        self.database.text_factory = lambda raw: raw.decode(errors='replace')
        try:
            self._read_topics()
        except sqlite3.DatabaseError:
            # A file shorter than its header says is refused as it is; with this flag its pages are read.
            self.database.execute('PRAGMA writable_schema = ON')
            self.counts.cut = True
            try:
                self._read_topics()
            except sqlite3.DatabaseError as error:
                self.database.close()
                raise Damaged(str(error)) from error

    @property
    def warnings(self) -> list[str]:
        """What went wrong so far."""
        return self.counts.sentences(self.path.name)

    def close(self) -> None:
        """Close the database."""
        self.database.close()

    def _read_topics(self) -> None:
        ask = self.database.execute
        tables = {name for name, in ask("SELECT name FROM sqlite_master WHERE type = 'table'")}
        if not {'topics', 'messages'} <= tables:
            raise Damaged('has no tables of topics and messages')
        text = {}
        if 'message_definitions' in tables:
            try:
                text = dict(ask('SELECT topic_type, encoded_message_definition FROM message_definitions'))
            except sqlite3.DatabaseError:
                pass
        known = list(ask('SELECT id, name, type, serialization_format FROM topics ORDER BY id'))
        count = self._count()
        self.connections = [
            Connection(int(id), str(topic), normal_type(str(type)), str(form), str(text.get(type, '')),
                       count.get(id, 0))
            for id, topic, type, form in known]

    def _count(self) -> dict[int, int]:
        ask = self.database.execute
        if not self.counts.cut:
            low, high = ask('SELECT min(timestamp), max(timestamp) FROM messages').fetchone()
            self.span = (int(low or 0), int(high or 0))
            return dict(ask('SELECT topic_id, count(*) FROM messages GROUP BY topic_id'))
        count: dict[int, int] = {}
        stamps = []
        try:
            for topic, stamp in ask('SELECT topic_id, timestamp FROM messages ORDER BY id'):
                count[topic] = count.get(topic, 0) + 1
                stamps.append(stamp)
        except sqlite3.DatabaseError:
            pass
        self.span = (min(stamps), max(stamps)) if stamps else (0, 0)
        return count

    def batches(self, wanted: Collection[int], progress: Progress = None) -> Iterator[Batch]:
        """Yield the messages of these topics in the order of their rows, some thousand at a time."""
        known = {c.id: c for c in self.connections}
        total = sum(known[id].count for id in wanted if id in known)
        done = 0
        for id in wanted:
            if id not in known:
                continue
            for times, blobs in self._blocks(id):
                length = np.fromiter(map(len, blobs), np.int64, len(blobs))
                begin = np.cumsum(length) - length
                receive = np.array(times, np.int64)
                yield Batch(known[id], receive, np.frombuffer(b''.join(blobs), np.uint8), begin, length)
                done += len(blobs)
                if progress and total:
                    progress(min(1.0, done / total))

    def _blocks(self, id: int) -> Iterator[tuple]:
        ask = 'SELECT timestamp, data FROM messages WHERE topic_id = ? ORDER BY id'
        cursor, seen = self.database.execute(ask, (id,)), 0
        try:
            while found := cursor.fetchmany(BLOCK):
                yield tuple(zip(*found))
                seen += len(found)
        except sqlite3.DatabaseError:
            # A damaged page: what the block held before it is read once more, one by one.
            self.counts.cut = True
            found = []
            try:
                for k, row in enumerate(self.database.execute(ask, (id,))):
                    if k >= seen:
                        found.append(row)
            except sqlite3.DatabaseError:
                pass
            if found:
                yield tuple(zip(*found))
