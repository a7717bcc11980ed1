# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Which columns of a table of text are what.

Known are our own names, those of EuRoC (``w_RS_S_x [rad s^-1]``), of ``rostopic echo -p``, of
PlotJuggler's export and of many loggers (``gx``, ``acc_x``, ``angular_velocity.x``,
``accel_z_g``), those of PX4's topics, and the columns of ``ros2 topic echo --csv``, which have no
names. Others are named with ``--fields``.

"""

from __future__ import annotations

from collections.abc import Sequence
import csv
from dataclasses import dataclass, field
from datetime import datetime
from functools import lru_cache
import os
from pathlib import Path
import re

from .fields import Fields, known_table, TEMPERATURE_UNITS, TIME_UNITS
from ..core.errors import InputError, listed, unknown, UsageError
from ..core.record import AXES
from ..core.units import SI, to_si

#: units as names have them behind the sensor or the axis: gyro_rad[0], accel_x_m_s2, gx_dps
IN_NAMES = {
    'gyro': {'rad': 'rad/s', 'rads': 'rad/s', 'radps': 'rad/s', 'rad_s': 'rad/s',
             'degs': 'deg/s', 'dps': 'deg/s', 'deg_s': 'deg/s', 'mdps': 'mdeg/s'},
    'accel': {'ms2': 'm/s^2', 'mps2': 'm/s^2', 'mss': 'm/s^2', 'm_s2': 'm/s^2', 'm_s_2': 'm/s^2',
              'm_s_s': 'm/s^2', 'g': 'g', 'mg': 'mg'},
}
#: names of a sensor; what may be an acceleration (``acc_g_x``) is none of the gyroscope
SAMPLE = {
    sensor: re.compile(rf'(?:^|_)(?:{words})_?(?:({units})_)?([xyz])(?:_({units}))?$')
    for sensor, words, units in (
        ('accel', 'acc(?:el(?:eration|erometer)?)?|linearacceleration|a_rs_s|a',
         '|'.join(IN_NAMES['accel'])),
        ('gyro', 'gyro(?:scope)?|gyr|angular_?(?:velocity|rate)|ang_?vel|omega|w_rs_s|w|g',
         '|'.join(IN_NAMES['gyro'])))
}
#: words for a unit of time
TIMES = {word: unit for unit, words in {
    's': 's sec secs second seconds', 'ms': 'ms msec msecs millis milliseconds',
    'us': 'us usec usecs micros microsec microseconds µs',
    'ns': 'ns nsec nsecs nanos nanosec nanosecs nanoseconds'}.items() for word in words.split()}
_WHOLE = '(?:s|secs?|seconds?)$'
_PART = '(?:' + '|'.join(w for w, unit in TIMES.items() if unit in ('ns', 'us')) + ')$'
#: names of the column of the stamps, the best first; a second one that holds parts of a second
STAMP = (
    (re.compile('(?:^|_)header_stamp_' + _WHOLE), re.compile('(?:^|_)header_stamp_' + _PART)),
    (re.compile(r'(?:^|_)header_stamp$'), None),
    (re.compile('(?:^|_)' + _WHOLE), re.compile('(?:^|_)' + _PART)),
    (re.compile(rf'^(?:t|time|time_?stamp|time_boot|stamp|(?={"|".join(TIMES)}))'
                rf'(?:_?(?:{"|".join(TIMES)}))?$'), None),
    (re.compile('(?:^|_)sampletimefine$'), None),
)
FINE = '0.1ms'      # what Xsens counts in that
ISO = re.compile(r'(\d{4}-\d\d-\d\d)[T ](\d\d:\d\d:\d\d)([.,]\d+)?'
                 r'\s*(?:Z|UTC|([+-]\d\d):?(\d\d))?')
WARM = re.compile(r'(?:^|_)temp(?:erature)?(?:_|$)')
#: tells the lines of several sensors apart: ArduPilot's I, an instance, a number of a device
WHICH = re.compile(r'^(?:i|instance|(?:(?:imu|sensor|device|dev)_)?(?:id|instance)|imu|sensor)$')
UNIT = re.compile(r'\s*[\[(](?!\d+[\])])([^\])]*)[\])]\s*$')
ELEMENT = re.compile(r'(?:\[|\.0)([012])\]?$')       # of an array: gyro_rad[0], gyro_rad.00
#: what is written for a unit, without spaces and ^
WRITTEN = {'rads-1': 'rad/s', 'degs-1': 'deg/s', 'dps': 'deg/s', '°/s': 'deg/s',
           'mdps': 'mdeg/s', 'deg/hr': 'deg/h', 'deg/hour': 'deg/h', '°/h': 'deg/h',
           '°/hr': 'deg/h', 'dph': 'deg/h', 'µg': 'ug', 'μg': 'ug',
           'm/s2': 'm/s^2', 'ms-2': 'm/s^2', 'm/s/s': 'm/s^2', 'm/s²': 'm/s^2',
           '°c': 'degC', 'degc': 'degC', 'c': 'degC', 'k': 'K'}
#: of sensor_msgs/Imu, one number after another; names are ours where they are used
ECHO = ('header.stamp.sec', 'header.stamp.nanosec', 'frame_id', *('orientation',) * 13,
        *AXES[:3], *('covariance',) * 9, *AXES[3:], *('covariance',) * 9)
HOW = ('name the columns, e.g. --fields gyro=A+B+C,accel=D+E+F,stamp=G:ms, each with its unit '
       'behind it where it is not SI')
LISTED = 16         # names that a message lists
LEAST_NUMBERS = 3   # in a line of samples: one for each axis of a sensor


@dataclass
class Columns:
    """
    How the lines of a table are read.

    ``place`` is where ``t``, ``t_part``, ``gyro_x`` ... are among the columns, ``scale`` of those
    that need it (factor, what is added); ``units`` are those by sensor that are stated and not SI;
    ``text`` the columns that hold no numbers, ``dates`` those of them that hold times as ISO 8601
    writes them; ``invalid`` as in :class:`~imu_noise_tools.bag.fields.Fields`, by places;
    ``which`` is where a column tells sensors apart, and ``only`` the one that is read. Of a
    table of ours (``own``) all are taken.

    """

    path: Path
    delimiter: str | None
    names: list[str]
    place: dict[str, int] = field(default_factory=dict)
    scale: dict[str, tuple[float, float]] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    text: set[int] = field(default_factory=set)
    dates: set[int] = field(default_factory=set)
    invalid: tuple[tuple[str, str, int], ...] = ()
    only: float | None = None
    first: list[str] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    own: bool = False
    headed: bool = True

    def cells(self, line: str) -> list[str]:
        """Return the cells of a line; of numbers with a decimal comma, with a point."""
        if self.delimiter and '"' in line:
            try:
                cells = next(csv.reader([line], delimiter=self.delimiter))
            except csv.Error:
                cells = []
        else:
            cells = line.split(self.delimiter)
        return cells if self.delimiter == ',' else [c.replace(',', '.') for c in cells]

    def number(self, cell: str, place: int) -> float:
        """Return what a cell of a column says, NaN where it is empty; raise ValueError if none."""
        if not cell.strip():
            return float('nan')
        return seconds(cell) if place in self.dates else float(cell)


def seconds(text: str) -> float:
    """Return the seconds since 1970 of a time as ISO 8601 writes it, UTC where it says no zone."""
    there = ISO.fullmatch(text.strip().strip('"'))
    if not there:
        raise ValueError(f'{text} is no time')
    day, clock, part, hours, minutes = there.groups()
    zone = (int(hours) * 3600 + int(hours[0] + minutes) * 60) if hours else 0
    return _whole(day, clock) + float('0' + (part or '.0').replace(',', '.')) - zone


@lru_cache(maxsize=16)          # a second has many samples
def _whole(day: str, clock: str) -> float:
    return datetime.fromisoformat(f'{day}T{clock}+00:00').timestamp()


def beginning(lines: Sequence[str]) -> int:
    """
    Return at which of the first lines of a file its table begins: after a preamble, if any.

    That is the first line, or the one from which on two lines, the second of numbers, have as
    many cells each.

    """
    bare = [_bare(line) for line in lines]
    begin = next((k for k, line in enumerate(bare) if line.strip()), 0)
    for k in range(begin, len(bare) - 1):
        width, after = len(_cells(bare[k])), _cells(bare[k + 1])
        if len(after) - (not after[-1]) <= width <= len(after) and are_numbers(bare[k + 1]):
            return k
    return begin


def are_numbers(line: str) -> bool:
    """Tell whether enough numbers are in a line for it to be a sample."""
    return sum(_is_number(c) for c in _cells(_bare(line))) >= LEAST_NUMBERS


def _cells(line: str) -> list[str]:
    return Columns(Path(), _delimiter(line), []).cells(line) or ['']


def _bare(line: str) -> str:
    return line.lstrip('#%\ufeff ').rstrip('\r\n')


def _delimiter(line: str) -> str | None:
    return next((d for d in ('\t', ';', ',') if d in line), None)


def columns_of(path: Path, first: str, second: str, fields: Fields | None) -> Columns:
    """
    Return which columns are what, by the first two lines and what the user says of them.

    Raises
    ------
    InputError
        They cannot be told: the message names those that there are.
    UsageError
        There is no such column as a field says.

    """
    first = _bare(first)
    found = Columns(path, _delimiter(first), [])
    cells = [c.strip().strip('"') for c in found.cells(first)]
    numbers = [_is_number(c) for c in cells]
    if len(cells) == len(ECHO) and numbers.count(False) == 1 and not numbers[2]:
        found.names, found.headed, second = list(ECHO), False, first
    elif any(numbers) and all(n or not c for n, c in zip(numbers, cells)):
        found.names, found.headed, second = [str(k + 1) for k in range(len(cells))], False, first
    else:
        found.names = cells
    found.first = [c.strip() for c in found.cells(second.rstrip('\r\n'))]
    found.text = {k for k, c in enumerate(found.first) if c and not _is_number(c)}
    if found.first and not found.first[-1]:     # where lines end in a separator is no column
        if len(found.first) == len(found.names) + 1:
            found.names.append('')
        if not found.headed or not found.names[-1]:
            found.text.add(len(found.names) - 1)
    found.dates = {k for k in found.text if ISO.fullmatch(found.first[k].strip('"'))}
    said = fields or Fields()
    named = fields if said.gyro or said.accel else known_table(found.names, path.stem)
    if named is None:
        _by_names(found)
    else:
        _by_fields(found, named)
    for each in (named, said):
        if each is not None:
            _beside_the_sensors(found, each)
    _one_of_several(found, said)
    return found


def _column(found: Columns, name: str) -> int:
    """Return where the column of a name is; raise UsageError where there is none."""
    for known in (found.names, [_plain(n) for n in found.names]):
        if name in known:
            return known.index(name)
    raise unknown(f'column of {found.path.name}', name, found.names)


def _beside_the_sensors(found: Columns, fields: Fields) -> None:
    """Take the stamps and the temperature that are named."""
    units = fields.units or {}
    if fields.stamp:
        whole, _, part = (x.strip() for x in fields.stamp.partition('+'))
        found.place['t'] = k = _column(found, whole)
        for name in ('t', 't_part'):
            found.scale.pop(name, None)
        found.place.pop('t_part', None)
        if part:
            found.place['t_part'] = j = _column(found, part)
            _time_unit(found, 't_part', units.get('stamp') or _part_stated(found.names[j]))
        else:
            _time_unit(found, 't', units.get('stamp') or _time_stated(found.names[k]))
    if fields.temperature:
        _temperature(found, _column(found, fields.temperature), units.get('temperature', ''))


def _one_of_several(found: Columns, said: Fields) -> None:
    """Find the column that tells sensors apart, and which of them is asked for."""
    if said.only:
        name, found.only = said.only
        found.place['which'] = _column(found, name)
        return
    taken = set() if found.own else set(found.place.values())
    which = [k for k, n in enumerate(found.names) if WHICH.search(_plain(n))
             and k not in taken | found.text]
    if len(which) == 1:
        found.place['which'] = which[0]


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _plain(name: str) -> str:
    """Return a name without its unit, in small letters, parts joined by ``_``; [0] as x."""
    name = ELEMENT.sub(lambda k: '_' + 'xyz'[int(k[1])], UNIT.sub('', name))
    return re.sub('[^a-z0-9]+', '_', name.lower()).strip('_')


def _sample(plain: str) -> tuple[str, str]:
    """Return which axis of ours a plain name means, and the unit that it has in it, or nothing."""
    for sensor, pattern in SAMPLE.items():
        if there := pattern.search(plain):
            before, axis, behind = there.groups()
            return f'{sensor}_{axis}', IN_NAMES[sensor].get(behind or before or '', '')
    return '', ''


def _stated(name: str) -> str:
    """Return the unit that a name states, as ours are written."""
    unit = UNIT.search(name)
    if not unit:
        return _sample(_plain(name))[1]
    said = unit[1].replace(' ', '').replace('^', '').lower()
    return WRITTEN.get(said, said)


def _by_names(found: Columns) -> None:
    """Find the columns by their names; raise InputError where they cannot be told."""
    names = [n.lower() for n in found.names]
    found.own = bool(set(names) & set(AXES)) and found.headed
    if found.own and len(set(names)) != len(names):
        raise InputError(f'{found.path}: its first line names a column twice', HOW)
    plain = [_plain(n) for n in names]
    meant = [_sample(n)[0] for n in plain]
    for axis in AXES:
        fits = [k for k, n in enumerate(names) if n == axis] or [
            k for k, n in enumerate(meant) if n == axis]
        if len(fits) > 1:
            raise InputError(f'{found.path}: several columns may be {axis}: '
                             + ', '.join(found.names[k] for k in fits), HOW)
        if fits:
            found.place[axis] = fits[0]
    if not set(found.place) & set(AXES):
        what = 'has no line of names' if not found.headed else 'its first line names no axis'
        raise InputError(
            f'{found.path}: {what}; its columns are {listed(found.names, LISTED)}', HOW)
    for sensor in SAMPLE:
        there = [a for a in AXES if a.startswith(sensor) and a in found.place]
        if len(there) not in (0, 3):
            raise InputError(f'{found.path}: has {", ".join(there)} but not all three axes; its '
                             f'columns are {listed(found.names, LISTED)}', HOW)
        if there:
            _unit(found, sensor, _stated(found.names[found.place[there[0]]]))
        if sensor in found.units:
            found.said.append(f'{sensor} is in {found.units[sensor]} by the name of its column, '
                              'and was read so')
    _stamps(found, plain)
    _left_over(found)
    warm = [k for k, n in enumerate(plain) if WARM.search(n) and k not in found.place.values()]
    if found.own:
        used = set(found.place.values())
        found.place |= {n: k for k, n in enumerate(names) if n and k not in used | found.text}
    elif len(warm) == 1:
        _temperature(found, warm[0], _stated(found.names[warm[0]]))


def _left_over(found: Columns) -> None:
    """Say so where no column is known as a sensor's, and others might be."""
    used = set(found.place.values()) | found.text
    left = [n for k, n in enumerate(found.names) if k not in used and n]
    lacks = [s for s in SAMPLE if f'{s}_x' not in found.place]
    if lacks and len(left) >= LEAST_NUMBERS and not found.own:
        found.said.append(
            f'no columns are known as {lacks[0]} by their names: where they are among '
            f'{listed(left, LISTED)}, name them with --fields {lacks[0]}=A+B+C')


def _by_fields(found: Columns, fields: Fields) -> None:
    """Find the columns that are named; raise UsageError for one that is not there."""
    plain = [_plain(n) for n in found.names]
    units = fields.units or {}
    for sensor in SAMPLE:
        three = getattr(fields, sensor)
        if len(three) == 1:         # an array
            element = _plain(three[0])
            three = tuple(f'{element}_{c}' for c in 'xyz')
            if not set(three) <= set(plain):
                raise UsageError(f'invalid --fields {sensor}={element}',
                                 'of a table three columns, joined with +')
        found.place |= {f'{sensor}_{c}': _column(found, name) for c, name in zip('xyz', three)}
        if three:
            unit = units.get(sensor) or _stated(found.names[found.place[f'{sensor}_x']])
            _unit(found, sensor, unit)
    if not fields.stamp:
        _stamps(found, plain)
    for sensor, name, value in fields.invalid:
        found.place[f'?{name}'] = _column(found, name)
        found.invalid += ((sensor, f'?{name}', value),)


def _unit(found: Columns, sensor: str, unit: str) -> None:
    """Take note of the unit of a sensor's columns."""
    try:
        factor = to_si(sensor, unit or SI[sensor])
    except UsageError:
        found.said.append(f'the unit {unit} of {sensor} is not known: it was taken as '
                          f'{SI[sensor]}')
        return
    if unit and unit != SI[sensor]:
        found.units[sensor] = unit
        found.scale |= {a: (factor, 0.0) for a in AXES if a.startswith(sensor)}


def _stamps(found: Columns, plain: Sequence[str]) -> None:
    """Find the stamps: of several, those named most like the samples."""
    if 't' in found.names:          # ours
        found.place['t'] = found.names.index('t')
        return
    sample = found.names[next(iter(found.place.values()))]

    def nearest(pattern: re.Pattern[str]) -> int | None:
        fits = [k for k, n in enumerate(plain)
                if pattern.search(n) and k not in found.text - found.dates]
        return max(fits, default=None,
                   key=lambda k: len(os.path.commonprefix([found.names[k], sample])))

    for whole, parts in STAMP:
        k, fine = nearest(whole), nearest(parts) if parts else None
        if k is None or parts and (fine is None or not _are_parts(found, k, fine)):
            continue
        found.place['t'] = k
        if fine is not None:
            found.place['t_part'] = fine
            _time_unit(found, 't_part', _time_stated(found.names[fine]))
            return
        ros1 = any(n.startswith('field.') for n in found.names)
        _time_unit(found, 't', _time_stated(found.names[k]) or ('ns' if ros1 else ''))
        return
    if len(found.dates) == 1:
        found.place['t'] = min(found.dates)


def _are_parts(found: Columns, whole: int, fine: int) -> bool:
    """
    Tell whether one column counts whole seconds, and another parts of one.

    They are named alike, and the first line has such numbers.

    """
    if re.sub(_WHOLE, '', _plain(found.names[whole])) != re.sub(
            _PART, '', _plain(found.names[fine])):
        return False
    counts = [found.first[k] for k in (whole, fine) if k < len(found.first)]
    most = 1_000_000_000 / TIME_UNITS[_time_stated(found.names[fine])]
    return (len(counts) == 2 and all(re.fullmatch(r'\d+(?:\.0*)?', c) for c in counts)
            and float(counts[1]) < most)


def _time_stated(name: str) -> str:
    """Return the unit that the name of a time states: in brackets, or as its last word."""
    if STAMP[-1][0].search(_plain(name)):
        return FINE
    unit = UNIT.search(name)
    word = unit[1].strip() if unit else re.sub('^(?:time_?stamp|time|t)', '', _plain(name))
    return TIMES.get(word.lower().rpartition('_')[2], '')


def _part_stated(name: str) -> str:
    """Return the unit of parts of a second: a word of the name, ns where none is one."""
    words = [TIMES[w] for w in _plain(name).split('_') if w in TIMES]
    return next((w for w in words if w != 's'), 'ns')


def _time_unit(found: Columns, name: str, unit: str) -> None:
    if unit in TIME_UNITS and found.place[name] not in found.dates:
        found.scale[name] = TIME_UNITS[unit] * 1e-9, 0.0


def _temperature(found: Columns, place: int, unit: str) -> None:
    found.place['temperature'] = place
    found.scale['temperature'] = TEMPERATURE_UNITS.get(unit, (1.0, 0.0))
