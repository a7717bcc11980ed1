# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Writing rosbag2's sqlite3 files (schema version 4)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
import errno
from pathlib import Path
import sqlite3
from typing import Any

import numpy as np

from .encode import definition

TABLES = """
CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);
CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL,
    metadata TEXT NOT NULL);
CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,
    serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL,
    type_description_hash TEXT NOT NULL);
CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT NOT NULL,
    encoding TEXT NOT NULL, encoded_message_definition TEXT NOT NULL,
    type_description_hash TEXT NOT NULL);
CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL,
    timestamp INTEGER NOT NULL, data BLOB NOT NULL);
INSERT INTO schema(schema_version, ros_distro) VALUES (4, 'jazzy');
"""
INDEX = 'CREATE INDEX IF NOT EXISTS timestamp_idx ON messages (timestamp ASC)'


@contextmanager
def as_os_error() -> Iterator[None]:
    """Say as an OSError what went wrong in writing, as of any other file."""
    try:
        yield
    except sqlite3.Error as error:
        number = errno.ENOSPC if 'full' in str(error) else errno.EIO
        raise OSError(number, str(error)) from error


class SqliteWriter:
    """One sqlite3 file, or more rows for one that is there; use it in a ``with``."""

    def __init__(self, path: Path):
        fresh = not path.exists()
        with as_os_error():
            self.database = sqlite3.connect(path, isolation_level=None)
            # It is renamed into place when it is whole: a journal would only double the writing.
            self.database.execute('PRAGMA journal_mode = OFF')
            self.database.execute('PRAGMA synchronous = OFF')
            if fresh:
                self.database.executescript(TABLES)
            self.database.execute('BEGIN')

    def topic(self, name: str, type: str, encoding: str = 'cdr') -> int:
        """Add a topic; return its id."""
        ask = self.database.execute
        columns = [row[1] for row in ask('PRAGMA table_info(topics)')]
        text, digest = definition(type, 'cdr')
        given = {
            'name': name,
            'type': type,
            'serialization_format': encoding,
            'offered_qos_profiles': '',
            'type_description_hash': digest,
        }
        used = [c for c in columns if c in given]
        id = ask(f'INSERT INTO topics({", ".join(used)}) VALUES ({", ".join("?" * len(used))})',
                 [given[c] for c in used]).lastrowid
        if (
            ask("SELECT 1 FROM sqlite_master WHERE name = 'message_definitions'").fetchone()
            and not ask(
                'SELECT 1 FROM message_definitions WHERE topic_type = ?', (type,)
            ).fetchone()
        ):
            ask(
                'INSERT INTO message_definitions(topic_type, encoding, '
                'encoded_message_definition, '
                'type_description_hash) VALUES (?, ?, ?, ?)',
                (type, 'ros2msg', text, digest),
            )
        return int(id or 0)

    def plain_topic(self, name: str, type: str, encoding: str, qos: str) -> int:
        """Add a topic whose definition is not known; return its id."""
        return int(
            self.database.execute(
                'INSERT INTO topics(name, type, serialization_format, offered_qos_profiles, '
                "type_description_hash) VALUES (?, ?, ?, ?, '')",
                (name, type, encoding, qos),
            ).lastrowid
            or 0
        )

    def messages(self, parts: Mapping[int, tuple[np.ndarray, np.ndarray]]) -> None:
        """
        Write rows.

        ``parts`` are receive times (ns) and messages (n, length) uint8 by topic, put in order of
        time.

        """
        for id, (times, rows) in parts.items():
            length = rows.shape[1] if len(rows) else 0
            raw = rows.tobytes()
            self.blobs(id, times, [raw[k:k + length] for k in range(0, len(raw), length or 1)])

    def blobs(self, id: int, times: np.ndarray, blobs: list[bytes]) -> None:
        """Write messages that may differ in length."""
        self.database.executemany(
            'INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)',
            zip([id] * len(blobs), np.asarray(times).tolist(), blobs),
        )

    def finish(self, metadata: str = '') -> None:
        """Make the index, and keep the folder's metadata."""
        self.database.execute(INDEX)
        held = self.database.execute(
            "SELECT 1 FROM sqlite_master WHERE name = 'metadata'"
        ).fetchone()
        if metadata and held:
            self.database.execute('DELETE FROM metadata')
            self.database.execute(
                'INSERT INTO metadata(metadata_version, metadata) VALUES (9, ?)', (metadata,)
            )
        self.database.execute('COMMIT')

    def __enter__(self) -> SqliteWriter:
        """Return itself."""
        return self

    def __exit__(self, kind: Any, error: Any, _: Any) -> None:
        """Close; say as an OSError what went wrong in writing."""
        self.database.close()
        if isinstance(error, sqlite3.Error):
            with as_os_error():
                raise error
