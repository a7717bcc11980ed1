# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which bags: paths, globs, directories, manifests and URLs, with what is known of each."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
import csv
from dataclasses import dataclass, field
from datetime import datetime
import os
from pathlib import Path, PurePath, PurePosixPath
import re
from typing import Any

from . import extra
from ..core.errors import InputError, UsageError
from ..core.units import to_si

BAGS = ('.bag', '.mcap', '.db3', '.npz')        # what a directory is searched for
METADATA = 'metadata.yaml'                      # makes a directory a rosbag2
UNITS = {'gyro_unit': 'gyro', 'accel_unit': 'accel'}    # columns: in what a bag is read
KNOWN = ('bag', 'unit', 'model', 'topic', *UNITS)       # of a manifest, that are no factors
DATE = 'date'
_GLOB = re.compile(r'[*?\[]')


@dataclass(frozen=True)
class Bag:
    """
    One recording of one unit.

    Parameters
    ----------
    path : str
        A local path, or a URL that fsspec knows.
    unit, model : str
        Which device, and of which kind.
    topic : str
        The Imu topic; empty: the only one.
    factors : mapping of str to str
        What else is known of it: firmware, mount, date (ISO 8601) and whatever a manifest says.
    size : int
        Bytes.
    stamp : str
        Changes when its bytes do; empty where nothing tells.
    units : mapping of str to str
        In what it is read where that is said of this one: gyro_unit, accel_unit.

    """

    path: str
    unit: str
    model: str = ''
    topic: str = ''
    factors: Mapping[str, str] = field(default_factory=dict)
    size: int = 0
    stamp: str = ''
    units: Mapping[str, str] = field(default_factory=dict)

    @property
    def remote(self) -> bool:
        """Tell whether it has to be fetched."""
        return '://' in self.path


def bags_of(given: Iterable[str], pattern: str = '', topic: str = '') -> list[Bag]:
    """
    Return the bags that paths, globs, directories, manifests and URLs stand for, each once.

    Parameters
    ----------
    given : iterable of str
        As typed.
    pattern : str
        A regular expression whose named groups (unit, model, firmware ...) are found in the path
        of a bag that no manifest describes; without one the unit is the name of the file.
    topic : str
        Of the bags for which none is named.

    Raises
    ------
    InputError
        Nothing there, or a manifest that makes no sense.
    UsageError
        The pattern is none.

    """
    try:
        named = re.compile(pattern) if pattern else None
    except re.error as error:
        raise UsageError(f'--pattern {pattern}: {error}',
                         "e.g. '(?P<unit>imu[0-9]+)_(?P<firmware>v[0-9]+)'") from None
    found: dict[tuple[str, str], Bag] = {}
    for one in given:
        for bag in _of_one(one, named, topic):
            if (bag.path, bag.topic) in found and bag != found[bag.path, bag.topic]:
                raise InputError(f'{bag.path}: named twice, as different units',
                                 'name it once, or with a topic each')
            found[bag.path, bag.topic] = bag
    if not found:
        raise InputError(f'{", ".join(given)}: no bag there',
                         f'name bags, directories with {", ".join(BAGS)}, or a manifest')
    return list(found.values())


def _of_one(text: str, named: re.Pattern | None, topic: str) -> Iterator[Bag]:
    where = _Place(text)
    if text.endswith('.csv') and where.is_file() and (rows := _manifest(where)) is not None:
        yield from _described(rows, where, topic)
        return
    if where.lacks():
        raise InputError(f'{text}: no such file', 'name bags, directories, globs or URLs')
    paths = [p for one in where.expand() for p in _Place(one).bags()]
    if not paths:
        raise InputError(f'{text}: no bag there', f'looked for {", ".join(BAGS)} and rosbag2 '
                         'directories; name other files one by one')
    for path in sorted(dict.fromkeys(paths)):
        facts = {'unit': _stem(path), 'topic': topic, **_groups(named, path)}
        yield _bag(path, facts, path)


def _groups(named: re.Pattern | None, path: str) -> dict[str, str]:
    if named is None:
        return {}
    hit = named.search(path)
    if hit is None:
        raise InputError(f'{path}: --pattern does not match it', 'mend it, or name fewer bags')
    return {k: v for k, v in hit.groupdict().items() if v is not None}


def _bag(path: str, facts: Mapping[str, str], where: str) -> Bag:
    factors = {k: v for k, v in facts.items() if k not in KNOWN and v}
    if DATE in factors:
        day(factors[DATE], where)
    units = {k: facts[k] for k in UNITS if facts.get(k)}
    for name, unit in units.items():
        try:
            to_si(UNITS[name], unit)
        except UsageError as error:
            raise InputError(f'{where}: {unit!r} is no {name}', error.remedy) from None
    size, stamp = _Place(path).stat()
    return Bag(path, facts.get('unit') or _stem(path), facts.get('model', ''),
               facts.get('topic', ''), factors, size, stamp, units)


def day(text: str, where: str = 'date') -> float:
    """Return an ISO 8601 date in days since 1970; raise InputError for anything else."""
    try:
        date = datetime.fromisoformat(text.replace('Z', '+00:00'))
    except ValueError:
        raise InputError(f'{where}: {text!r} is no date', 'e.g. 2026-03-31') from None
    return (date.replace(tzinfo=None) - datetime(1970, 1, 1)).total_seconds() / 86400


def _stem(path: str) -> str:
    name = PurePosixPath(path).name
    return name.rsplit('.', 1)[0] if name.endswith((*BAGS, '.csv')) else name


def _manifest(where: '_Place') -> list[dict[str, str]] | None:
    """Return the rows of a manifest; None for a record in CSV."""
    try:
        lines = list(csv.reader(where.text().splitlines(), strict=True))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f'{where.path}: not readable as a manifest ({error})',
                         'a CSV file with a column bag') from None
    head = [h.strip().lower() for h in lines[0]] if lines else []
    if 'bag' not in head:
        if {'gyro_x', 'accel_x'} & set(head):
            return None
        raise InputError(f'{where.path}: no column bag in the manifest',
                         'its first line names the columns: bag, unit, model, firmware, date ...')
    twice = [h for h in head if head.count(h) > 1]
    if twice or '' in head:
        raise InputError(f'{where.path}: column {twice[0] if twice else "without a name"} '
                         f'{"twice" if twice else ""}'.rstrip(), 'name each column once')
    rows = []
    for number, cells in enumerate(lines[1:], 2):
        if not any(c.strip() for c in cells):
            continue
        if len(cells) > len(head) or len(cells) < head.index('bag') + 1:
            raise InputError(f'{where.path}, line {number}: {len(cells)} cells, '
                             f'the head has {len(head)}', 'quote cells that hold commas')
        row = dict(zip(head, (c.strip() for c in cells)))
        if not row['bag']:
            raise InputError(f'{where.path}, line {number}: no bag named', 'fill the cell')
        rows.append({**row, '': f'{where.path}, line {number}'})
    if not rows:
        raise InputError(f'{where.path}: a manifest without a bag', 'a line for each bag')
    return rows


def _described(rows: list[dict[str, str]], where: '_Place', topic: str) -> Iterator[Bag]:
    for row in rows:
        line, row['topic'] = row.pop(''), row.get('topic') or topic
        yield _bag(where.beside(row['bag']), row, line)


class _Place:
    """A path or URL, looked at through fsspec where it is a URL and by itself where not."""

    def __init__(self, path: str) -> None:
        self.path = path
        self.remote = '://' in path
        self.fs: Any = None
        if self.remote:
            try:
                self.fs, self.inner = extra('fsspec').core.url_to_fs(path)
            except (ImportError, ValueError) as error:
                raise InputError(f'{path}: {error}', 'see the list of file systems of fsspec'
                                 ) from None

    def _url(self, inner: str) -> str:
        return str(self.fs.unstrip_protocol(inner))

    def is_file(self) -> bool:
        return bool(self.fs.isfile(self.inner)) if self.remote else Path(self.path).is_file()

    def lacks(self) -> bool:
        """Tell whether it is a path on this machine, no glob, with nothing there."""
        return not (self.remote or _GLOB.search(self.path) or Path(self.path).exists())

    def text(self) -> str:
        if self.remote:
            with self.fs.open(self.inner) as file:
                return bytes(file.read()).decode('utf-8-sig')
        return Path(self.path).read_text(encoding='utf-8-sig')

    def beside(self, name: str) -> str:
        """Return a path as a manifest at this place names it."""
        if '://' in name:
            return name
        if self.remote:
            return f'{self.path.rsplit("/", 1)[0]}/{name}'
        return str(Path(self.path).parent / name)

    def expand(self) -> list[str]:
        if not _GLOB.search(self.path):
            return [self.path]
        if self.remote:
            return [self._url(p) for p in self.fs.glob(self.inner)]
        base = Path(PurePath(self.path).anchor or '.')
        rest = PurePath(self.path)
        text = str(rest.relative_to(rest.anchor)) if rest.anchor else str(rest)
        return sorted(str(p) for p in base.glob(text))

    def bags(self) -> Iterator[str]:
        """Yield the bags below a directory; what is a file is a bag."""
        if self.remote:
            if not self.fs.isdir(self.inner):
                yield self.path
                return
            tree = ((d, files) for d, _, files in self.fs.walk(self.inner))
            for directory, names in tree:
                for name in _bags_among(names):
                    yield self._url(f'{directory}/{name}'.rstrip('/.'))
            return
        if not Path(self.path).is_dir():
            yield self.path
            return
        for directory, names in _tree(self.path):
            for name in _bags_among(names):
                yield str(Path(directory) / name)

    def stat(self) -> tuple[int, str]:
        """Return bytes and a stamp that changes with them; nothing where it cannot be had."""
        try:
            if self.remote:
                parts = self.fs.find(self.inner, detail=True).values() or [
                    self.fs.info(self.inner)]
                told = ('ETag', 'etag', 'checksum', 'mtime', 'LastModified', 'created', 'size')
                stamp = [[str(i.get(k)) for k in told if k in i] for i in parts]
                tells = all(len(s) > 1 for s in stamp)
                return sum(int(i.get('size') or 0) for i in parts), str(stamp) if tells else ''
            own = Path(self.path)
            found = [p.stat() for p in (own.rglob('*') if own.is_dir() else [own])]
            return (sum(s.st_size for s in found),
                    str(sorted((s.st_size, s.st_mtime_ns) for s in found)))
        except Exception:       # whatever a file system of somebody else's raises
            return 0, ''


def _tree(top: str) -> Iterator[tuple[str, list[str]]]:
    """Yield each folder at and below one with its files; links are followed, no folder twice."""
    seen = {os.path.realpath(top)}
    for directory, below, names in os.walk(top, followlinks=True):
        paths = {os.path.join(directory, n): n for n in sorted(below)}
        below.clear()
        for path in sorted(paths, key=os.path.islink):      # by its own name where it has one
            if (real := os.path.realpath(path)) not in seen:
                seen.add(real)
                below.append(paths[path])
        yield directory, names


def _bags_among(names: Iterable[str]) -> list[str]:
    """Return which files of a directory are bags; the directory itself where it is a rosbag2."""
    names = set(names)
    if METADATA in names:
        return ['.']
    if 'study.yaml' in names:
        return []
    return sorted(n for n in names if n.endswith(BAGS))
