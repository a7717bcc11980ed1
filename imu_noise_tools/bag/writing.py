# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Writing a record as a bag, whole or not at all.

That is rosbag2 (MCAP or sqlite3), rosbag1, .csv or .npz.

"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
import io
from pathlib import Path
import re
from typing import Any

import numpy as np
import yaml

from .blocks import Block, blocks_of, present, start_ns
from .container import Progress
from .decode import IMU, MAGNETIC, PRESSURE, TEMPERATURE
from .encode import definition, imu_values, serialise
from .mcap_writer import McapWriter
from .rosbag1_writer import Rosbag1Writer
from .sqlite_writer import SqliteWriter
from ..core.errors import InputError, UsageError
from ..core.files import atomic_path, new_folder
from ..core.record import ImuRecord

STORAGES = ('mcap', 'sqlite3', 'rosbag1')
SUFFIX = {'.mcap': 'mcap', '.db3': 'sqlite3', '.bag': 'rosbag1', '.csv': 'csv', '.npz': 'npz'}
TOPIC = '/imu/data_raw'
COVARIATE_TOPICS = {
    'temperature': ('/imu/temperature', TEMPERATURE),
    'magnetic': ('/imu/mag', MAGNETIC),
    'pressure': ('/imu/pressure', PRESSURE),
}
COVARIATE_HZ = 10.0         # what moves slower than a few hertz is written no faster
BLOCK = 4096


def write_bag(
    path: str | Path,
    record: ImuRecord | Iterable[Block],
    *,
    storage: str | None = None,
    topic: str = TOPIC,
    frame_id: str = '',
    compression: str = '',
    gyro_covariance: np.ndarray | None = None,
    accel_covariance: np.ndarray | None = None,
    force: bool = False,
    progress: Progress = None,
) -> Path:
    """
    Write a record as a bag.

    Parameters
    ----------
    path : str or Path
        A folder (rosbag2), or a file that ends in ``.mcap``, ``.db3``, ``.bag``, ``.csv`` or
        ``.npz``.
    record : ImuRecord or iterable of Block
        What to write; blocks where it is too long for memory. The covariates temperature,
        magnetic_x to z and pressure become topics of their own, at 10 Hz at most; a .csv or .npz
        holds all of them, at every sample.
    storage : str, optional
        ``mcap`` (default), ``sqlite3`` or ``rosbag1``; by the name where that says it.
    topic, frame_id : str
        Topic of the Imu messages; frame where the record has none.
    compression : str
        ``zstd`` compresses the chunks of an MCAP.
    gyro_covariance, accel_covariance : array (9,), optional
        Covariance of every message.
    force : bool
        Replace a bag that is there.
    progress : callable, optional
        Called with the fraction done, where it is known.

    Returns
    -------
    Path
        What was written.

    Raises
    ------
    InputError
        Something is in the way, or there is no room.

    """
    path = Path(path)
    kind = SUFFIX.get(path.suffix.lower()) or storage or 'mcap'
    if kind not in (*STORAGES, 'csv', 'npz') or storage not in (None, kind):
        raise UsageError(
            f'{path.name} cannot be written as {storage}', f'choose from {", ".join(STORAGES)}'
        )
    if kind in ('csv', 'npz'):
        if not isinstance(record, ImuRecord):
            raise UsageError(f'{path.name}: a table is written from a whole record', 'write a bag')
        with writing_file(path, force) as temporary:
            write_table(temporary, kind, table_of(record))
        return path
    covariances = {'gyro_covariance': gyro_covariance, 'accel_covariance': accel_covariance}
    content = Content(record, kind, topic, frame_id, covariances)
    if SUFFIX.get(path.suffix.lower()) or kind == 'rosbag1':
        with writing_file(path, force) as temporary:
            _write_one(temporary, kind, path.name, content, compression, progress)
    else:
        name = f'{path.name}_0{".mcap" if kind == "mcap" else ".db3"}'
        with new_folder(path, force) as folder:
            _write_one(folder / name, kind, name, content, compression, progress,
                       folder / 'metadata.yaml')
    return path


@contextmanager
def writing_file(path: Path, force: bool = True) -> Iterator[Path]:
    """
    Give a temporary path that becomes ``path`` at success.

    Raise InputError where something is in the way.

    """
    if path.exists() and not force:
        raise InputError(
            f'{path}: the file exists',
            'choose another name with -o, or replace it with --force',
        )
    with atomic_path(path) as temporary:
        yield temporary


def _write_one(
    path: Path, kind: str, name: str, content: Content, compression: str, progress: Progress,
    metadata: Path | None = None,
) -> None:
    """Write the one file of a bag, and the metadata beside it."""
    if kind == 'sqlite3':
        with SqliteWriter(path) as writer:
            content.write(writer, progress)
            text = metadata_text(name, kind, content.topics, content.summary)
            writer.finish(text)
    else:
        with open(path, 'xb') as file:
            to = Rosbag1Writer(file) if kind == 'rosbag1' else McapWriter(file, compression)
            content.write(to, progress)
            to.finish()
        text = metadata_text(name, kind, content.topics, content.summary) if metadata else ''
    if metadata:
        metadata.write_text(text)


class Summary:
    """What a bag's metadata says: messages by topic, first and last time."""

    def __init__(self) -> None:
        self.count: dict[str, int] = {}
        self.first, self.last = 2 ** 63 - 1, 0

    def add(self, topic: str, times: np.ndarray) -> None:
        """Count messages."""
        self.count[topic] = self.count.get(topic, 0) + len(times)
        if len(times):
            self.first = min(self.first, int(times.min()))
            self.last = max(self.last, int(times.max()))


class Content:
    """What is written: blocks of an Imu topic, and the covariates of a record beside it."""

    def __init__(
        self, record: ImuRecord | Iterable[Block], kind: str, topic: str, frame_id: str,
        covariances: dict,
    ):
        self.encoding = 'ros1' if kind == 'rosbag1' else 'cdr'
        self.frame_id, self.covariances = frame_id or 'imu_link', covariances
        self.imu = topic
        self.topics = {topic: IMU}
        self.summary = Summary()
        self.beside: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        self.blocks: Iterable[Block]
        self.total = 0
        if isinstance(record, ImuRecord):
            for name, type, times, values in _covariates(record):
                self.topics[name] = type
                self.beside[name] = times, values
            self.blocks, self.total = blocks_of(record, BLOCK), record.n
        else:
            self.blocks = record

    def write(self, writer: Any, progress: Progress) -> None:
        """Write all of it, the covariates with the block of their time."""
        ids = {name: writer.topic(name, type, self.encoding) for name, type in self.topics.items()}
        done = 0
        for block in self.blocks:
            times = np.asarray(block.receive, np.int64)
            done += len(times)
            values = imu_values(present(block.gyro), present(block.accel), **self.covariances)
            frame = block.frame_id or self.frame_id
            parts = {ids[self.imu]: (times, serialise(block.stamp, values, frame, self.encoding))}
            self.summary.add(self.imu, times)
            until = times.max() if len(times) and done < self.total else np.iinfo(np.int64).max
            for name, (when, numbers) in list(self.beside.items()):
                k = int(np.searchsorted(when, until, 'right'))
                parts[ids[name]] = when[:k], serialise(when[:k], numbers[:k], frame, self.encoding)
                self.summary.add(name, when[:k])
                self.beside[name] = when[k:], numbers[k:]
            writer.messages(parts)
            if progress and self.total:
                progress(done / self.total)


def _covariates(record: ImuRecord) -> Iterator[tuple[str, str, np.ndarray, np.ndarray]]:
    """
    Yield topic, type, times (ns) and doubles of each covariate.

    Those that no message type exists for are passed over.

    """
    start = start_ns(record)
    step = max(1, int(record.rate_hz / COVARIATE_HZ))
    some = np.unique(np.append(np.arange(0, record.n, step), max(record.n - 1, 0)))
    times = start + np.round(record.t[some] * 1e9).astype(np.int64)
    order = np.argsort(times, kind='stable')
    for suffix in sorted(
        {m[1] for name in record.covariates if (m := re.fullmatch(r'[a-z_]+?((?:_\d+)?)', name))}
    ):
        for kind, (topic, type) in COVARIATE_TOPICS.items():
            names = (
                [f'magnetic_{a}{suffix}' for a in 'xyz'] if kind == 'magnetic' else [kind + suffix]
            )
            if not all(n in record.covariates for n in names):
                continue
            values = np.zeros((len(some), 12 if kind == 'magnetic' else 2))
            for k, n in enumerate(names):
                values[:, k] = record.covariates[n][some]
            yield topic + suffix, type, times[order], values[order]


def metadata_text(name: str, kind: str, topics: dict[str, str], summary: Summary) -> str:
    """Return the metadata.yaml of a rosbag2 folder with one file."""
    total = sum(summary.count.values())
    begin, span = (summary.first, summary.last - summary.first) if total else (0, 0)
    when = {'starting_time': {'nanoseconds_since_epoch': begin}, 'duration': {'nanoseconds': span},
            'message_count': total}
    about = {
        'version': 9,
        'storage_identifier': kind,
        **when,
        'topics_with_message_count': [
            {
                'topic_metadata': {
                    'name': topic,
                    'type': type,
                    'serialization_format': 'cdr',
                    'offered_qos_profiles': [],
                    'type_description_hash': definition(type, 'cdr')[1],
                },
                'message_count': summary.count.get(topic, 0),
            }
            for topic, type in topics.items()
        ],
        'compression_format': '',
        'compression_mode': '',
        'relative_file_paths': [name],
        'files': [{'path': name, **when}],
        'custom_data': None,
        'ros_distro': 'jazzy',
    }
    return yaml.safe_dump({'rosbag2_bagfile_information': about}, sort_keys=False)


def table_of(record: ImuRecord) -> dict[str, np.ndarray]:
    """Return the arrays of a record as an .npz holds them."""
    # Seconds since 1970 would keep but 0.2 us of a stamp.
    arrays = {'t': record.t, 'start': np.array(record.start),
              'rate_hz': np.array(record.labelled_rate_hz or record.rate_hz)}
    arrays |= {s: x for s in ('gyro', 'accel') if (x := getattr(record, s)) is not None}
    return arrays | dict(record.covariates)


def write_table(path: Path, kind: str, arrays: dict[str, np.ndarray]) -> None:
    """Write arrays as .npz, or as .csv with a column for each (and for each axis)."""
    if kind == 'npz':
        with open(path, 'xb') as file:
            np.savez(file, **arrays)       # type: ignore[arg-type]
        return
    columns: dict[str, np.ndarray] = {}
    if 't' in arrays and 'start' in arrays:
        arrays = arrays | {'t': arrays['t'] + arrays['start']}
    for name, x in sorted(arrays.items(), key=lambda item: item[0] != 't'):
        if x.ndim == 2:
            prefix, _, suffix = name.partition('_')
            suffix = f'_{suffix}' if suffix else ''
            columns |= {f'{prefix}_{a}{suffix}': x[:, k] for k, a in enumerate('xyz')}
        elif x.ndim == 1:
            columns[name] = x
    with open(path, 'x') as file:
        file.write(','.join(columns) + '\n')
        n = len(next(iter(columns.values())))
        for k in range(0, n, BLOCK):
            text = io.StringIO()
            np.savetxt(
                text,
                np.stack([c[k:k + BLOCK] for c in columns.values()], axis=1),
                fmt='%.17g',
                delimiter=',',
            )
            file.write(text.getvalue())
