# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Opening a bag: what kind of file is it, and how do its parts make one whole."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
import os
from pathlib import Path, PurePath
import shutil
import stat

import numpy as np
import zstandard

from . import mcap, rosbag1, sqlite
from .container import (
    AT_LEAST,
    BagFile,
    Batch,
    Connection,
    Damaged,
    EXPANSION,
    Progress,
    Seen,
    size_of,
)
from .fields import Fields, known_shape, Shape
from ..core.errors import InputError, listed, UsageError
from ..core.files import plain_yaml, scratch_folder

ZSTD = b'\x28\xb5\x2f\xfd'
# What is used of a metadata.yaml must be of these types, or it is as if it were not there.
METADATA = {
    'version': int,
    'message_count': int,
    'files': list,
    'relative_file_paths': list,
    'topics_with_message_count': list,
}
MOST_ALIASES = 1000  # of a metadata.yaml: some writers give times of files so
# s that parts of one recording may have in common: messages are written a little out of order
OVERLAP_S = 1.0
LISTED = 8          # names that a message lists
LEAST_BYTES = 8     # a message takes no less, however well it is compressed
NS = 1e-9
NO_BAG = ('give a rosbag1 file, a rosbag2 folder, an .mcap or .db3 file, a .csv (or another '
          'table of text) or an .npz')


class Bag:
    """
    All files of one bag, in order; use it in a ``with``.

    Topics are known by name. ``warnings`` grows while it is read.

    """

    def __init__(self, path: str | Path):
        self.path = Path(path)
        self.files: list[BagFile] = []
        self.origins: list[Path] = []       # of each file, before it was unpacked
        self._said: list[str] = []
        self._scratch: Path | None = None
        _refuse_what_cannot_be_read(self.path)
        try:
            self._open()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Bag:
        """Return itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close all files."""
        self.close()

    def close(self) -> None:
        """Close all files and remove what was unpacked."""
        for file in self.files:
            file.close()
        self.files = []
        if self._scratch:
            shutil.rmtree(self._scratch, ignore_errors=True)
            self._scratch = None

    def _open(self) -> None:
        if not self.path.is_dir():
            try:
                self._add(self.path)
            except Damaged as error:
                raise _nothing(self.path, str(error)) from error
            return
        parts, listed = self._folder()
        for part in parts:
            try:
                _refuse_what_cannot_be_read(part)
                self._add(part)
            except (Damaged, InputError) as error:
                self._said.append(f'{part.name}: left out ({str(error).partition(": give")[0]})')
        if not self.files:
            raise _nothing(self.path, '; '.join(self._said))
        if not listed:
            self._join()

    def _join(self) -> None:
        """
        Put files that no metadata.yaml lists in the order of their times.

        Raise InputError where they overlap: they are no parts of one recording then.

        """
        rosbag2 = not all(isinstance(f, rosbag1.Rosbag1File) for f in self.files)
        missing = 'metadata.yaml is missing or cannot be used; ' if rosbag2 else ''
        if len(self.files) == 1:
            self._said += [f'{missing}the one file of the folder was read'] * rosbag2
            return
        whole = {k: Seen.over(f.counts().values()) for k, f in enumerate(self.files)}
        order = sorted(whole, key=lambda k: whole[k].first)
        held = [k for k in order if whole[k].samples]
        for a, b in zip(held, held[1:]):
            if (whole[a].last - whole[b].first) * NS > OVERLAP_S:
                names = _names(self.origins[k] for k in order)
                raise InputError(
                    f'{self.path}: holds recordings of the same time, {names}, and no '
                    'metadata.yaml that says what belongs together',
                    'name one of them; fleet takes all of a folder, each as a bag')
        self.files = [self.files[k] for k in order]
        self.origins = [self.origins[k] for k in order]
        self._said.append(
            f'{missing}the {len(order)} files of the folder were read as one recording in parts; '
            'where each is one of its own, name one (fleet takes all)')

    def _add(self, path: Path) -> None:
        self.files.append(self._file(path))
        for connection in self.files[-1].connections:
            if shape := known_shape(connection):
                self.files[-1].know(replace(connection, shape=shape))
        self.origins.append(path)

    def _folder(self) -> tuple[list[Path], bool]:
        """Return the files of a folder, and whether its metadata.yaml lists them, in order."""
        try:
            there = sorted(self.path.iterdir())
        except OSError as error:
            raise InputError(
                f'{self.path}: cannot be read ({(error.strerror or "").lower()})'
            ) from error
        about = self.metadata()
        names = about.get('relative_file_paths')
        listed = (
            [self.path / PurePath(n).name for n in names if isinstance(n, str)]
            if isinstance(names, list)
            else []
        )
        parts = [p for p in listed if p.exists()]
        missing = [p.name for p in listed if not p.exists()]
        if missing:
            self._said.append(f'{", ".join(missing)}: missing from the bag; the rest was read')
        if parts:
            return parts, True
        parts = [p for p in there if _kind_of_name(p)]
        others = [p for p in there if p.name.endswith('.bag')]
        if parts and others:        # the same, converted, as a rule
            self._said.append(f'{_names(others)}: left out (rosbag1 beside rosbag2; name one of '
                              'them to read it)')
        parts = parts or others
        if not parts:
            raise self._no_bag(there)
        return parts, bool(listed)

    def _no_bag(self, there: list[Path]) -> InputError:
        """Return what to say of a folder that holds these, and no file of a bag."""
        if (self.path / 'study.yaml').is_file() or (self.path / 'studies.yaml').is_file():
            return InputError(f'{self.path}: a study, not a bag', 'name the bag it is made of')
        ends = ('.mcap', '.db3', '.bag', '.zstd', '.zst')
        inside = [p for p in there if p.suffix in ('.csv', '.npz')
                  or any(f for end in ends for f in p.glob(f'*{end}'))]
        if inside:
            return InputError(f'{self.path}: not a bag, but a folder with {_names(inside)}',
                              'name one of them')
        return InputError(f'{self.path}: not a bag: the folder has no .mcap, .db3 or .bag file',
                          NO_BAG)

    def metadata(self) -> dict:
        """Return what the folder's metadata.yaml says, or nothing where it cannot be used."""
        path = self.path / 'metadata.yaml'
        try:
            if not path.is_file() or path.stat().st_size > 1 << 22:
                return {}
            found = plain_yaml(path.read_text(errors='replace'), MOST_ALIASES)
        except (OSError, ValueError):
            return {}
        about = found.get('rosbag2_bagfile_information') if isinstance(found, dict) else None
        if not isinstance(about, dict):
            return {}
        return {k: v for k, v in about.items() if isinstance(v, METADATA.get(k, object))}

    def _file(self, path: Path) -> BagFile:
        try:
            with open(path, 'rb') as file:
                head = file.read(16)
            if head[:4] == ZSTD:
                path = self._unpack(path)
                with open(path, 'rb') as file:
                    head = file.read(16)
            if head.startswith(mcap.MAGIC):
                return mcap.McapFile(path)
            if head.startswith(rosbag1.MAGIC):
                return rosbag1.Rosbag1File(path)
            if head.startswith(sqlite.MAGIC):
                return sqlite.SqliteFile(path)
        except OSError as error:
            raise InputError(
                f'{path}: cannot be read ({(error.strerror or str(error)).lower()})'
            ) from error
        if head.startswith(b'#ROSBAG'):
            raise InputError(
                f'{path}: unsupported rosbag version',
                'only rosbag version 2.0 can be read',
            )
        raise InputError(f'{path}: not a bag', NO_BAG)

    def _unpack(self, path: Path) -> Path:
        """Decompress a whole file into a temporary folder, as far as it goes."""
        if self._scratch is None:
            self._scratch = scratch_folder()
        target = self._scratch / f'{len(self.files)}_{path.stem}'
        limit = max(AT_LEAST, EXPANSION * path.stat().st_size)
        room = shutil.disk_usage(self._scratch).free
        done = 0
        with open(path, 'rb') as source, open(target, 'wb') as sink:
            stream = zstandard.ZstdDecompressor().stream_reader(source, read_across_frames=True)
            with suppress(zstandard.ZstdError):
                while some := stream.read(1 << 20):
                    done += len(some)
                    if done > limit:
                        raise Damaged('unpacks to far more than a recording could')
                    if done > room:
                        raise InputError(
                            f'{path}: no room to unpack it in {self._scratch.parent}',
                            'free some disk space or set TMPDIR',
                        )
                    sink.write(some)
        return target

    @property
    def connections(self) -> list[Connection]:
        """Every connection of every file."""
        return [c for f in self.files for c in f.connections]

    def read_as(self, fields: Fields, topics: Collection[str] = ()) -> None:
        """
        Have the messages of these topics (of all, if there are none) read by their fields.

        Raises
        ------
        InputError
            The bag holds no definition of their type.
        UsageError
            None of them has these fields.

        """
        wrong: dict[str, UsageError | Damaged] = {}
        for file in self.files:
            for c in file.connections:
                if topics and c.topic.strip('/') not in topics:
                    continue
                try:
                    file.know(replace(c, shape=Shape.of(c, fields)))
                except (UsageError, Damaged) as error:
                    wrong[c.topic] = error
        if not wrong or any(c.shape and c.shape.fields == fields for c in self.connections):
            return
        usage = sorted((e for e in wrong.values() if isinstance(e, UsageError)),
                       key=lambda e: 'did you mean' not in e.remedy)
        if usage and (topics or len(wrong) == 1 or 'did you mean' in usage[0].remedy):
            raise usage[0]
        if usage:
            raise UsageError(f'{self.path}: no topic has these fields',
                             'name one with --topic to hear which it has')
        raise InputError(f'{self.path}: {next(iter(wrong.values()))}',
                         'MCAP, ROS 1 and rosbag2 since Iron hold them: convert the bag with ros2 '
                         'bag convert where the type is installed')

    @property
    def warnings(self) -> tuple[str, ...]:
        """What went wrong so far."""
        return tuple(dict.fromkeys((*self._said, *(w for f in self.files for w in f.warnings))))

    def counts(self) -> dict[tuple[str, str], Seen]:
        """Return by topic and type how many messages there are, and from when to when."""
        parts: dict[tuple[str, str], list[Seen]] = {}
        for file in self.files:
            count = file.counts()
            for c in file.connections:
                parts.setdefault((c.topic, c.type), []).append(count.get(c.id, Seen(0, 0, 0)))
        return {of: Seen.over(some) for of, some in parts.items()}

    def expected(self, topic: str) -> int:
        """
        Return about how many messages of a topic there are, at no cost; 0: not known.

        It is what the files say, as far as their size allows it.

        """
        return sum(
            max(0, min(f.expected(c.id), size_of(f.file) // LEAST_BYTES))
            for f in self.files
            for c in f.connections
            if c.topic == topic
        )

    def batches(
        self, topics: Collection[str], types: Collection[str], progress: Progress = None
    ) -> Iterator[Batch]:
        """Yield the messages of these topics that have one of these types, file after file."""
        for k, file in enumerate(self.files):
            ids = [c.id for c in file.connections if c.topic in topics and c.kind in types]
            if ids:
                part = _part_of(progress, k, len(self.files))
                for batch in file.batches(ids, part):
                    yield self.unpacked(batch)[0]

    @staticmethod
    def unpacked(batch: Batch) -> tuple[Batch, bool]:
        """Return a batch whose messages are not compressed one by one, and whether they were."""
        packed = _is_compressed(batch)
        return (_unpacked(batch) if packed else batch), packed


def _part_of(progress: Progress, k: int, n: int) -> Progress:
    return None if progress is None else lambda fraction: progress((k + fraction) / n)


def _is_compressed(batch: Batch) -> bool:
    """
    Tell whether the messages are compressed one by one.

    CDR begins with two bytes that zstd's does not begin with.

    """
    return batch.connection.encoding == 'cdr' and batch.message(0)[:4] == ZSTD


def _unpacked(batch: Batch) -> Batch:
    """Decompress messages that are compressed one by one; those that cannot be are left empty."""
    unpack = zstandard.ZstdDecompressor()
    found = []
    for k in range(len(batch.begin)):
        raw = batch.message(k)
        try:
            known = zstandard.frame_content_size(raw)
            if known > max(1 << 20, EXPANSION * len(raw)):
                raise Damaged('size')
            found.append(unpack.decompress(raw, max_output_size=1 << 20))
        except (zstandard.ZstdError, Damaged):
            found.append(b'')
    length = np.array([len(f) for f in found], np.int64)
    return batch._replace(
        data=np.frombuffer(b''.join(found), np.uint8),
        begin=length.cumsum() - length,
        length=length,
    )


def _kind_of_name(path: Path) -> bool:
    return path.name.endswith(
        ('.mcap', '.db3', '.mcap.zstd', '.db3.zstd', '.mcap.zst', '.db3.zst')
    )


def _names(paths: Iterable[Path]) -> str:
    """Return the names of files, not more than a line of them."""
    return listed([p.name for p in paths], LISTED)


def _nothing(path: Path, why: str) -> InputError:
    return InputError(
        f'{path}: nothing can be recovered from it ({why})', 'record again, or repair the file'
    )


def _refuse_what_cannot_be_read(path: Path) -> None:
    """Refuse what is not there, is not a file or folder, is empty, or may not be read."""
    try:
        mode = path.stat().st_mode
    except OSError as error:
        if isinstance(error, PermissionError):
            raise InputError(f'{path}: cannot be read (permission denied)') from error
        raise InputError(f'{path}: no such file or folder', NO_BAG) from error
    except ValueError as error:
        raise InputError(f'{str(path)!r}: no such file or folder', NO_BAG) from error
    if stat.S_ISDIR(mode):
        return
    if not stat.S_ISREG(mode):
        raise InputError(f'{path}: not a file (a pipe or a device)', NO_BAG)
    if not os.access(path, os.R_OK):
        raise InputError(f'{path}: cannot be read (permission denied)')
    if not path.stat().st_size:
        raise InputError(f'{path}: the file is empty', NO_BAG)
