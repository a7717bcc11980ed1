# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Records in a ``.csv`` or an ``.npz``.

They are read without pickle, and with no more memory than the file warrants.

"""

from __future__ import annotations

from dataclasses import replace
import io
from pathlib import Path
import re
from typing import Any
import zipfile

import numpy as np

from .columns import are_numbers, beginning, Columns, columns_of, seconds, TIMES
from .container import AT_LEAST, EXPANSION
from .fields import Fields
from .source import _refuse_what_cannot_be_read
from ..core.clock import regular_rate, STAMPED_HZ
from ..core.errors import InputError, listed, UsageError
from ..core.record import AXES, ImuRecord, SENSORS

NPZ_ARRAYS = (
    'an .npz holds gyro (n, 3) in rad/s, accel (n, 3) in m/s^2, and t (n,) in s or rate_hz'
)
CSV_COLUMNS = (
    'a .csv begins with the line t,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z (s, rad/s, '
    'm/s^2), or its columns are named with --fields'
)
BAGS = ('.mcap', '.db3', '.bag', '.zst', '.zstd')
LOOKED_AT = 1 << 14         # bytes of a file of another name, and lines before its table
PREAMBLE = 100
#: parts of a second that stamps since 1970 may come in, and seconds since then that are now
SINCE_1970 = {'nanoseconds': 1e9, 'microseconds': 1e6, 'milliseconds': 1e3}
NOW = (0.9e9, 5e9)
USUAL = (8.0, 8000.0)       # Hz, of IMUs: three decades, so that one unit fits
LONGEST_STEP = 1000.0   # s from stamp to stamp that an IMU may have
MOST_BAD = 0.01             # of the lines of a .csv may be left out, as of samples
MOST_SENSORS, LEAST_SHARE = 8, 0.01     # in one table, in turn; of the lines that each has
CONTRADICTS = 0.01          # more than the clock of a stamp is off


def table_kind(path: str | Path) -> str:
    """
    Return ``csv`` or ``npz`` by the name of a file, or nothing.

    A file of another name, but no bag's, is a ``csv`` where lines of numbers are in it.

    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix in ('.csv', '.npz'):
        return '' if path.is_dir() else suffix[1:]
    return 'csv' if suffix not in BAGS and _has_lines_of_numbers(path) else ''


def _has_lines_of_numbers(path: Path) -> bool:
    """Tell whether a file is text, and some of its first lines are numbers."""
    try:
        if not path.is_file():
            return False
        with open(path, 'rb') as file:
            text = file.read(LOOKED_AT)
        if b'\0' in text:
            return False
        lines = text.decode(errors='replace').splitlines()[:-1]
    except (OSError, ValueError):
        return False
    return any(are_numbers(line) for line in lines)


def read_table(path: Path, rate_hz: float | None, fields: str | None = None) -> ImuRecord:
    """
    Read a table, in SI where it states a unit: ``input_unit`` says which are others.

    ``rate_hz`` goes before stamps and labels; ``fields`` names the columns of a .csv
    (:class:`~imu_noise_tools.bag.fields.Fields`). Raise InputError where it cannot be used,
    UsageError where it has no such column.

    """
    said: list[str] = []
    units: dict[str, str] = {}
    try:
        record = _record(path, table_arrays(path, said, fields, units), rate_hz, said)
        return replace(record, input_unit=units)
    except InputError as error:
        raise error.after(*said)


def table_size(path: Path, fields: str | None = None) -> tuple[int, float | None]:
    """Return the number of samples of a table, and how many there are in a second, if known."""
    arrays = table_arrays(path, fields=fields)
    label = _number(arrays.get('rate_hz'))
    record = _record(path, dict(arrays), label or 1.0, [])
    t = arrays.get('t')
    t = None if t is None else _in_seconds(path, np.array(t, float), [])
    span = float(np.ptp(t[np.isfinite(t)])) if t is not None and np.isfinite(t).any() else 0.0
    return record.n, (record.n - 1) / span if span > 0 else label


def table_arrays(
    path: Path, said: list[str] | None = None, fields: str | None = None,
    units: dict[str, str] | None = None,
) -> dict[str, np.ndarray]:
    """
    Return all arrays of numbers of a table, gyro and accel as (n, 3).

    Doubts are added to ``said``, units that the table states and are not SI to ``units``: what is
    returned is SI.

    """
    _refuse_what_cannot_be_read(path)
    try:
        if table_kind(path) == 'npz':
            if fields:
                raise UsageError('--fields is for bags and .csv: an .npz has its names',
                                 'leave it out')
            arrays, doubts = _read_npz(path)
        else:
            arrays, columns = _read_csv(path, Fields.of(fields, table=True) if fields else None)
            doubts = columns.said
            if units is not None:
                units.update(columns.units)
    except OSError as error:
        raise InputError(
            f'{path}: cannot be read ({(error.strerror or str(error)).lower()})'
        ) from error
    if said is not None:
        said += doubts
    return arrays


def read_between(x: np.ndarray) -> np.ndarray:
    """Return a slow quantity (n,), interpolated where it was not read: it comes less often."""
    known = np.isfinite(x)
    if known.all():
        return np.asarray(x, float)
    return np.interp(np.arange(len(x)), np.flatnonzero(known), x[known])


def _record(
    path: Path, arrays: dict[str, np.ndarray], rate_hz: float | None, said: list[str]
) -> ImuRecord:
    said = list(said)
    data: dict[str, np.ndarray | None] = {}
    empty = []
    for sensor in ('gyro', 'accel'):
        x = arrays.pop(sensor, None)
        if x is not None and (x.ndim != 2 or x.shape[1] != 3):
            raise InputError(f'{path}: {sensor} has the shape {x.shape}, not (n, 3)', NPZ_ARRAYS)
        if x is not None and len(x) and not np.any((x != 0) & ~np.isnan(x)):
            what = 'not a number anywhere' if np.isnan(x).all() else 'all zero'
            said.append(f'the {sensor} part is {what}; left out')
            empty.append(f'{sensor} is {what}')
            x = None
        data[sensor] = None if x is None else np.array(x, float)
    lengths = {len(x) for x in data.values() if x is not None}
    if len(lengths) != 1:
        raise InputError(
            f'{path}: '
            + ('gyro and accel differ in length' if lengths
               else ', '.join(empty) or 'has neither gyro nor accel'),
            NPZ_ARRAYS if table_kind(path) == 'npz' else CSV_COLUMNS,
        )
    n = lengths.pop()
    labelled = _number(arrays.pop('rate_hz', None))
    origin = _number(arrays.pop('start', None)) or 0.0
    t, rate = _stamps(path, arrays.pop('t', None), n, rate_hz, labelled, said)
    said += against_stamps(t, rate_hz)
    start = 0.0
    if t is None or rate_hz:
        t = np.arange(n) / rate
    else:
        start = float(t[np.isfinite(t)][0])
    covariates = {k: read_between(x) for k, x in arrays.items()
                  if x.ndim == 1 and len(x) == n and x.dtype.kind in 'fiu' and k not in AXES
                  and np.any(np.isfinite(x))}
    return ImuRecord(
        gyro=data['gyro'],
        accel=data['accel'],
        t=t - start,
        rate_hz=float(rate),
        start=origin + start,
        covariates=covariates,
        topic='imu',
        path=str(path),
        labelled_rate_hz=labelled,
        given_rate_hz=rate_hz,
        warnings=tuple(said),
    )


def against_stamps(t: np.ndarray | None, rate_hz: float | None) -> list[str]:
    """Return a sentence where stamps (n,), s, that give a rate give another than this one."""
    stamped = None if t is None or not rate_hz else regular_rate(t)
    if not rate_hz or not stamped or not STAMPED_HZ[0] < stamped < STAMPED_HZ[1]:
        return []
    if abs(rate_hz / stamped - 1) < CONTRADICTS:
        return []
    return [f'--rate-hz {rate_hz:.6g} contradicts the stamps, which give {stamped:.6g} Hz; it was '
            'used, and if they are right every coefficient is wrong: leave it out then']


def _in_seconds(path: Path, t: np.ndarray, said: list[str]) -> np.ndarray:
    """
    Return stamps (n,) in seconds, where they are since 1970 in a smaller unit.

    Others that are too far apart to be seconds are refused.

    """
    known = t[np.isfinite(t)]
    if len(known) < 2:
        return t
    middle = float(np.median(known))
    for unit, parts in SINCE_1970.items():
        if parts * NOW[0] < middle < parts * NOW[1]:
            said.append(f't reads as {unit} since 1970 and was taken as such; it is to be in s')
            return t / parts
    step = float(np.median(np.abs(np.diff(known))))
    if step > LONGEST_STEP:
        unit, parts = next(
            ((u, p) for u, p in SINCE_1970.items() if USUAL[0] < p / step < USUAL[1]),
            ('nanoseconds', 1e9))
        name = f' (or name the column t_{TIMES[unit]})' if table_kind(path) == 'csv' else ''
        raise InputError(f'{path}: t is in s, and its stamps are {step:.3g} s apart',
                         f'if they are {unit}, {parts / step:.4g} Hz, divide them by {parts:.0e}'
                         .replace('e+0', 'e') + name)
    return t


def _stamps(
    path: Path, t: np.ndarray | None, n: int, rate_hz: float | None, labelled: float | None,
    said: list[str],
) -> tuple[np.ndarray | None, float]:
    """Return the stamps where they say something, and the rate: given, theirs, or as labelled."""
    if t is not None and t.shape != (n,):
        raise InputError(f'{path}: t has the shape {t.shape}, not ({n},)', NPZ_ARRAYS)
    t = None if t is None else _in_seconds(path, np.array(t, float), said)
    if t is not None and n and not np.any(t):
        said.append('all stamps are zero; the rate was used')
        t = None
    if t is not None and not np.isfinite(t).any():
        t = None
    rate = rate_hz or (None if t is None else regular_rate(t)) or labelled
    if rate is None or not np.isfinite(rate) or rate <= 0:
        why = 'neither t nor rate_hz is there' if t is None else (
            'the stamps run backward' if np.nanmedian(np.diff(t)) < 0 else
            'the stamps do not advance')
        raise InputError(f'{path}: cannot determine the sample rate: {why}',
                         'give it with --rate-hz' + (
                             ', or name the column of the stamps with --fields'
                             if t is None and table_kind(path) == 'csv' else ''))
    if t is None and not rate_hz:
        said.append(
            f'no stamps: {rate:.6g} Hz is only what the file says; such labels are off by up to '
            '20 %, and every coefficient with them'
        )
    return t, rate


def _number(array: np.ndarray | None) -> float | None:
    """Return the one number of an array, if it is one."""
    return (
        float(np.ravel(array)[0])
        if array is not None and array.size == 1 and array.dtype.kind in 'fiu'
        else None
    )


def _read_npz(path: Path) -> tuple[dict[str, np.ndarray], list[str]]:
    """Return the numeric arrays of an .npz; whatever would need pickle is left alone."""
    arrays: dict[str, np.ndarray] = {}
    said: list[str] = []
    limit = max(AT_LEAST, EXPANSION * path.stat().st_size)
    try:
        with zipfile.ZipFile(path) as archive:
            for member in archive.infolist():
                name = member.filename.removesuffix('.npy')
                if not member.filename.endswith('.npy') or not re.fullmatch(r'\w+', name):
                    continue
                limit -= member.file_size
                if limit < 0:
                    raise InputError(
                        f'{path}: unpacks to far more than a recording could',
                        'it is damaged or hostile',
                    )
                array = _member(archive, member)
                if array is not None:
                    arrays[name] = array
                elif name in ('gyro', 'accel', 't', 'rate_hz'):
                    raise InputError(f'{path}: {name} is not an array of numbers', NPZ_ARRAYS)
                else:
                    said.append(f'{name} is not an array of numbers; left out')
    except (
        zipfile.BadZipFile,
        ValueError,
        EOFError,
        NotImplementedError,
        RuntimeError,
        MemoryError,
    ) as error:
        raise InputError(f'{path}: cannot be read as .npz ({error})', NPZ_ARRAYS) from error
    except Exception as error:
        if isinstance(error, (InputError, OSError)):
            raise
        raise InputError(f'{path}: cannot be read as .npz ({error})', NPZ_ARRAYS) from error
    return arrays, said


def _member(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> np.ndarray | None:
    """
    Return one array, or None where it is not numbers.

    Its header is checked before anything is allocated.

    """
    raw = archive.read(member)
    file = io.BytesIO(raw)
    version = np.lib.format.read_magic(file)
    if version not in ((1, 0), (2, 0)):
        return None
    header = (
        np.lib.format.read_array_header_1_0
        if version == (1, 0)
        else np.lib.format.read_array_header_2_0
    )
    try:
        shape, fortran, dtype = header(file)
    except Exception:       # of the tokenizer and the parser that numpy uses
        raise ValueError(f'the header of {member.filename} is damaged') from None
    if dtype.kind not in 'fiub' or dtype.hasobject:
        return None
    count = 1
    for k in shape:
        count *= int(k)
    if count < 0 or count * dtype.itemsize != len(raw) - file.tell():
        raise ValueError(
            f'{member.filename} declares the shape {shape} and holds {len(raw)} bytes'
        )
    array = np.frombuffer(raw, dtype, count, file.tell())
    return array.reshape(shape, order='F' if fortran else 'C')


def _read_csv(path: Path, fields: Fields | None) -> tuple[dict[str, np.ndarray], Columns]:
    """Return the columns of a .csv, in SI where they state a unit, and how they were read."""
    with open(path, encoding='utf-8', errors='replace', newline=None) as file:
        lines = [file.readline(1 << 16) for _ in range(PREAMBLE)]
        begin = beginning(lines)
        first, second = lines[begin], ''.join(lines[begin + 1:begin + 2])
        columns = columns_of(path, first, second, fields)
        if columns.headed and not second.strip():
            raise InputError(f'{path}: has a line of names and no samples', 'record again')
        if any(x.strip() for x in lines[:begin]):
            columns.said.append(f'the table begins in line {begin + 1}; what is before was left '
                                f'out: {lines[0].strip()[:40]!r}')
        line = begin + 1 + columns.headed
        lines = [x for x in lines[line - 1:] if x]
        blocks: list[np.ndarray] = []
        bad = _Bad(columns)
        lines += file.readlines(1 << 22)
        while lines:
            blocks.append(_numbers(columns, lines, line, bad))
            line += len(lines)
            lines = file.readlines(1 << 22)
    table = np.concatenate(blocks)
    bad.say(len(table))
    found = {n: table[:, k] for k, n in enumerate(columns.place)}
    for name, (factor, more) in columns.scale.items():
        if name in found:
            found[name] = factor * found[name] + more
    found = _of_one_sensor(columns, found)
    if 't_part' in found:
        found['t'] = found['t'] + found.pop('t_part')
    for sensor, name, value in columns.invalid:
        nothing = found.pop(name) == value
        found |= {a: np.where(nothing, np.nan, found[a]) for a in AXES if a.startswith(sensor)}
    if not columns.own:         # of a table of several topics other lines are theirs
        there = np.any([np.isfinite(x) for n, x in found.items() if n in AXES], axis=0)
        found = {n: x[there] for n, x in found.items()}
    arrays = {}
    for sensor in SENSORS:
        if f'{sensor}_x' in found:
            arrays[sensor] = np.stack([found.pop(f'{sensor}_{c}') for c in 'xyz'], axis=1)
    return arrays | found, columns


def _of_one_sensor(columns: Columns, found: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """
    Return the columns of the sensor that is asked for, of a table that holds several in turn.

    Raise InputError where none is asked for, or there is none such.

    """
    if 'which' not in columns.place:
        return found
    which = found.pop('which')
    values, often = np.unique(which[np.isfinite(which)], return_counts=True)
    names = [f'{v:g}' for v in values[:MOST_SENSORS + 1]]
    column = columns.names[columns.place['which']]
    if columns.only is None:
        several = 1 < len(values) <= MOST_SENSORS and np.all(values == np.rint(values)) and \
            np.min(often) > LEAST_SHARE * len(which)
        if several:
            raise InputError(
                f'{columns.path}: holds the samples of {len(values)} sensors, by its column '
                f'{column}: {listed(names, MOST_SENSORS)}',
                f'choose one with --fields only={column}:{names[0]}')
        return found
    mine = which == columns.only
    if not mine.any():
        raise InputError(f'{columns.path}: no line has {columns.only:g} in its column {column}',
                         f'it has {listed(names, MOST_SENSORS)}')
    return {n: x[mine] for n, x in found.items()}


class _Bad:
    """The lines of a table that are not numbers, or not as many as there are columns."""

    def __init__(self, columns: Columns):
        self.columns = columns
        self.at: list[int] = []
        self.first = self.last = ''
        self.end = 0            # the last line that is not empty

    def add(self, at: int, line: str) -> None:
        """Take note of a line and its number."""
        self.first = self.first if self.at else line.strip()[:40]
        self.at.append(at)

    def say(self, good: int) -> None:
        """Say what was left out, beside so many good lines; raise InputError where it is much."""
        columns, at, lines = self.columns, self.at, good + len(self.at)
        what = f'{len(columns.names)} numbers'
        cut = bool(at) and at[-1] == self.end       # power was lost while it was written
        if not good or len(at) - cut > MOST_BAD * lines:
            others = f' (and {len(at) - 1} of the {lines - 1} others)' if len(at) > 1 else ''
            raise InputError(f'{columns.path}: line {at[0]} is not {what}: {self.first!r}{others}',
                             CSV_COLUMNS)
        if cut:
            columns.said.append('the file was cut short; its last line was left out')
            at = at[:-1]
        if at:
            are = f'line {at[0]} is not {what} and was' if len(at) == 1 else (
                f'{len(at)} of {lines} lines are not {what} and were')
            where = '' if len(at) == 1 else f'; the first is line {at[0]}'
            columns.said.append(f'{are} left out{where}: {self.first!r}')


def _numbers(columns: Columns, lines: list[str], first: int, bad: _Bad) -> np.ndarray:
    """Return the numbers of some lines, from a number on; those that are none go to ``bad``."""
    use, width = list(columns.place.values()), len(columns.names)
    cut = _is_cut(columns, lines)
    dates: dict[Any, Any] = {k: seconds for k in columns.dates & set(use)}
    try:
        point = lines if columns.delimiter == ',' else [x.replace(',', '.') for x in lines]
        found = np.loadtxt(point, delimiter=columns.delimiter, ndmin=2, comments=None,
                           quotechar='"', usecols=use if columns.text else None,
                           converters=dates or None, encoding=None)
        if not cut and (columns.text or found.shape[1] == width):
            return found if columns.text else found[:, use]
    except ValueError:
        pass
    table = []
    for k, line in enumerate(lines):
        if not line.strip():
            continue
        bad.end = first + k
        cells = columns.cells(line)
        try:
            row = [columns.number(cells[k], k) for k in use]
        except (ValueError, IndexError):
            row = []
        if not row or len(cells) != width or cut and line is lines[-1]:
            bad.add(first + k, line)
        else:
            table.append(row)
    return np.array(table, float).reshape(-1, len(use))


def _is_cut(columns: Columns, lines: list[str]) -> bool:
    """
    Tell whether the last line is without its end.

    It has no newline then, and fewer or shorter cells than those before.

    """
    *before, last = lines
    if last.endswith('\n') or not before or not last:
        return False
    cells = [columns.cells(line.rstrip('\n')) for line in before[-20:]]
    mine = columns.cells(last)
    return len(mine) < len(cells[-1]) or len(mine[-1]) < min(len(c[-1]) for c in cells)
