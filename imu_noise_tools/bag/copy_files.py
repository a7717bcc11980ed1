# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The files of a bag again, with one Imu topic more: nothing that they hold is touched."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
import sqlite3
from typing import Any, NamedTuple
import zlib

import numpy as np
import yaml
import zstandard

from .container import BagFile, Batch, Damaged, Progress, rows
from .decode import decode, Decoded, DOUBLES, IMU
from .encode import definition, imu_values, serialise
from .mcap import Chunk, McapFile, Other
from .mcap_records import MESSAGE, walk
from .mcap_writer import McapWriter
from .rosbag1 import Rosbag1File
from .rosbag1_writer import record as rosbag1_record, Rosbag1Writer
from .source import Bag, ZSTD
from .sqlite import SqliteFile
from .sqlite_writer import as_os_error, SqliteWriter
from .topics import choose
from ..core.errors import InputError


class Changed(NamedTuple):
    """
    What the new topic holds, sample by sample: (n, 3) each; None leaves the part as it was.

    Covariances are (9,) or (n, 9), row-major; None leaves them as they were. Only samples that
    are ``written``, (n,) bool, are there; None for all.

    """

    gyro: np.ndarray | None = None
    accel: np.ndarray | None = None
    gyro_covariance: np.ndarray | None = None
    accel_covariance: np.ndarray | None = None
    written: np.ndarray | None = None

    def take(self, which: np.ndarray) -> Changed:
        """Return some of the samples."""
        some = (x if x is None or np.ndim(x) == 1 else x[which] for x in self[:4])
        written = None if self.written is None else self.written[which]
        return Changed(*some)._replace(written=written)

    def within(self, begin: int, n: int) -> Changed:
        """Return these samples as a part of n, from begin on."""
        held = next((len(x) for x in self[:2] if x is not None), n)
        if held == n:
            return self
        place = slice(begin, begin + held)
        out = []
        for x in self[:4]:
            if x is not None and x.ndim == 2:
                x, some = np.full((n, x.shape[1]), np.nan), x
                x[place] = some
            out.append(x)
        written = np.zeros(n, bool)
        written[place] = True
        return Changed(*out)._replace(written=written)


class Copy:
    """
    Copies the files of one bag.

    What is new is brought into the order in which the messages lie in them.

    """

    def __init__(
        self, bag: Bag, topic: str | None, name: str, changed: Changed, n: int,
        progress: Progress, fields: str | None = None,
    ):
        self.bag, self.name, self.progress = bag, name, progress
        if any(c.topic == name for c in bag.connections):
            raise InputError(
                f'{bag.path}: the topic {name} exists already', 'start from the original bag'
            )
        choice = choose(bag, topic, fields)
        self.base, self.type = choice.base, choice.type
        receive = [
            batch.receive[decode(batch).readable]
            for batch in bag.batches([self.base], [self.type])
        ]
        order = np.argsort(np.concatenate(receive), kind='stable')
        if len(order) != n:
            raise InputError(f'{bag.path}: changed while it was read', 'wait until it is whole')
        rank = np.empty(n, np.int64)
        rank[order] = np.arange(n)
        self.changed = changed if np.array_equal(order, np.arange(n)) else changed.take(rank)
        self.at = 0
        self.added = 0

    def wanted(self, file: BagFile) -> set[int]:
        """Return the connections of a file that hold the Imu topic."""
        return {c.id for c in file.connections if c.topic == self.base and c.kind == self.type}

    def new(self, batch: Batch) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield times and messages for the messages of a batch, those of one length together."""
        found = decode(batch)
        batch = batch.take(np.flatnonzero(found.readable))
        n = len(found.stamp)
        some = self.changed.take(np.arange(self.at, self.at + n))
        self.at += n
        self.added += n
        old = np.array(found.values) if self.type == IMU else None
        values = imu_values(*some[:4], out=old)
        if some.written is not None:
            kept = np.flatnonzero(some.written)
            batch, values = batch.take(kept), values[kept]
            found = found._replace(stamp=found.stamp[kept])
            self.added -= n - len(kept)
        for length in np.unique(batch.length):
            which = np.flatnonzero(batch.length == length)
            yield batch.receive[which], self._messages(
                batch.take(which), found, which, values[which], int(length)
            )

    def _messages(
        self, batch: Batch, found: Decoded, which: np.ndarray, values: np.ndarray, length: int
    ) -> np.ndarray:
        encoding = batch.connection.encoding
        little = encoding == 'ros1' or bool(np.all(rows(batch.data, batch.begin, 2)[:, 1] == 1))
        if self.type != IMU or batch.connection.shape or not little:
            return serialise(found.stamp[which], values, found.frame_id, encoding)
        raw = np.array(rows(batch.data, batch.begin, length))
        raw[:, length - 8 * DOUBLES[IMU]:] = (
            np.ascontiguousarray(values, '<f8').view(np.uint8).reshape(len(raw), -1)
        )
        return raw

    def folder(self, folder: Path) -> None:
        """Copy all files of a rosbag2 folder, and its metadata brought up to date."""
        about = self.bag.metadata()
        for k, origin in enumerate(self.bag.origins):
            before = self.added
            self.file(k, folder / origin.name)
            _count_up(about.get('files'), origin.name, self.added - before)
        if about:
            about['message_count'] = int(about.get('message_count') or 0) + self.added
            about.setdefault('topics_with_message_count', []).append(
                {
                    'topic_metadata': {
                        'name': self.name,
                        'type': IMU,
                        'serialization_format': 'cdr',
                        'offered_qos_profiles': '' if int(about.get('version') or 9) < 9 else [],
                        'type_description_hash': definition(IMU, 'cdr')[1],
                    },
                    'message_count': self.added,
                }
            )
            text = yaml.safe_dump({'rosbag2_bagfile_information': about}, sort_keys=False)
            (folder / 'metadata.yaml').write_text(text)

    def file(self, k: int, path: Path) -> None:
        """Copy one file; one that was compressed whole is compressed again."""
        file, origin = self.bag.files[k], self.bag.origins[k]
        with open(origin, 'rb') as head:
            packed = head.read(4) == ZSTD
        plain = path.with_name(path.name + '.plain') if packed else path
        try:
            if isinstance(file, McapFile):
                self._mcap(file, plain)
            elif isinstance(file, Rosbag1File):
                self._rosbag1(file, plain)
            elif isinstance(file, SqliteFile):
                self._sqlite(file, plain)
            if packed:
                with open(plain, 'rb') as read, open(path, 'xb') as write:
                    zstandard.ZstdCompressor().copy_stream(read, write)
        finally:
            if packed:
                plain.unlink(missing_ok=True)

    def _mcap(self, file: McapFile, path: Path) -> None:
        with open(path, 'xb') as out:
            writer = McapWriter(out, profile=file.profile)
            if file.indexed:
                writer.known(file.raw_schemas, file.raw_channels)
            wanted = self.wanted(file)
            encoding = next((c.encoding for c in file.connections if c.id in wanted), 'cdr')
            # Those that only chunks to come define are known from the scan: their numbers are
            # taken as well.
            writer.reserve(file.raw_schemas, file.raw_channels)
            id = writer.topic(self.name, IMU, encoding)
            for part in file.parts(self.progress):
                if isinstance(part, Other):
                    writer.other(*part)
                    continue
                try:
                    self._mcap_part(file, writer, part)
                except Damaged:
                    continue
                for batch in file.batches_of(part, wanted):
                    for times, messages in self.new(batch):
                        writer.messages({id: (times, messages)})
            writer.finish()

    def _mcap_part(self, file: McapFile, writer: McapWriter, part: Chunk | bytes) -> None:
        """
        Write a chunk as it is.

        What has no index, or is cut, becomes a chunk of its whole records.

        """
        if isinstance(part, Chunk):
            writer.compression = (
                part.compression if part.compression == 'zstd' else writer.compression
            )
            raw = file.content(part)
            if part.places is not None and part.whole and file.indexed:
                writer.chunk(part.raw, part.compression, part.size, part.crc, part.places)
                return
        else:
            raw = part
        kept: list[bytes] = []
        index: dict[int, list[np.ndarray]] = {}
        at = 0
        for run in walk(raw):
            kept.append(raw[run.begin:run.begin + run.step * run.number])
            if run.op == MESSAGE:
                channel = int.from_bytes(raw[run.begin + 9:run.begin + 11], 'little')
                begin = run.begin + run.step * np.arange(run.number)
                when = np.ascontiguousarray(
                    rows(np.frombuffer(raw, np.uint8), begin + 15, 8)
                ).view('<i8')[:, 0]
                index.setdefault(channel, []).append(
                    np.stack([when, at + run.step * np.arange(run.number)], axis=1)
                )
            at += len(kept[-1])
        whole = b''.join(kept)
        writer.known(file.raw_schemas, file.raw_channels)
        if whole:
            writer.chunk(
                whole,
                '',
                len(whole),
                zlib.crc32(whole),
                {c: np.concatenate(i) for c, i in index.items()},
            )

    def _rosbag1(self, file: Rosbag1File, path: Path) -> None:
        with open(path, 'xb') as out:
            writer = Rosbag1Writer(out)
            for id, (fields, body) in file.raw_connections.items():
                writer.add_connection(
                    id, rosbag1_record(body, **{k.decode(): v for k, v in fields.items()})
                )
            new = writer.topic(self.name, IMU)
            wanted = self.wanted(file)
            for part in file.chunks(None, self.progress):
                try:
                    content = file.content(part)
                except Damaged:
                    continue
                index = part.places
                if index is None or part.record.end > file.size:
                    found, end = file.walk(content)
                    index = {
                        c: np.stack([t // 10**9, t % 10**9, at], axis=1)
                        for c, (at, t, *_) in found.items()
                    }
                    content = content[:end]
                # The new messages go into the same chunk: readers hold one chunk at a time, in
                # order of time.
                more = [m for batch in file.batches_of(part, wanted) for m in self.new(batch)]
                one, *others = more or [(np.empty(0, np.int64), np.empty((0, 0), np.uint8))]
                writer.messages({new: one}, content, index, file.compression(part))
                for some in others:
                    writer.messages({new: some})
            writer.finish()

    def _sqlite(self, file: SqliteFile, path: Path) -> None:
        if not file.problems.cut:
            with as_os_error(), closing(sqlite3.connect(path)) as copy:
                file.database.backup(copy)
        with SqliteWriter(path) as writer:
            if file.problems.cut:
                self._rows(file, writer)
            id = writer.topic(self.name, IMU)
            pack = zstandard.ZstdCompressor().compress
            for raw in file.batches(self.wanted(file), self.progress):
                batch, packed = self.bag.unpacked(raw)
                for times, messages in self.new(batch):
                    if packed:
                        writer.blobs(id, times, [pack(m.tobytes()) for m in messages])
                    else:
                        writer.messages({id: (times, messages)})
            writer.finish()

    @staticmethod
    def _rows(file: SqliteFile, writer: SqliteWriter) -> None:
        """Copy what can be read of a file that is damaged, row by row."""
        ids = {
            c.id: writer.plain_topic(c.topic, c.type, c.encoding, file.qos.get(c.id, ''))
            for c in file.connections
        }
        for batch in file.batches([c.id for c in file.connections]):
            writer.blobs(
                ids[batch.connection.id],
                batch.receive,
                [batch.message(k) for k in range(len(batch.begin))],
            )


def _count_up(files: Any, name: str, more: int) -> None:
    for entry in files if isinstance(files, list) else []:
        if isinstance(entry, dict) and Path(str(entry.get('path'))).name == name:
            held = entry.get('message_count')
            entry['message_count'] = (held if isinstance(held, int) else 0) + more
