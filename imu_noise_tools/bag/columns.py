# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Which columns of a table of text are what.

Known are our own names, those of EuRoC (``w_RS_S_x [rad s^-1]``), of ``rostopic echo -p``, of
PlotJuggler's export and of many loggers (``gx``, ``acc_x``, ``angular_velocity.x``), and the
columns of ``ros2 topic echo --csv``, which have no names. Others are named with ``--fields``.

"""

from __future__ import annotations

from collections.abc import Sequence
import csv
from dataclasses import dataclass, field
import os
from pathlib import Path
import re

from .fields import Fields, TEMPERATURE_UNITS, TIME_UNITS
from ..core.errors import InputError, listed, unknown, UsageError
from ..core.record import AXES
from ..core.units import INPUT, SI

SAMPLE = {
    'gyro': re.compile(r'(?:^|_)(?:gyro(?:scope)?|gyr|angular_?(?:velocity|rate)|ang_?vel|omega'
                       r'|w_rs_s|w|g)_?([xyz])$'),
    'accel': re.compile(r'(?:^|_)(?:acc(?:el(?:eration|erometer)?)?|linearacceleration|a_rs_s|a)'
                        r'_?([xyz])$'),
}
#: names of the column of the stamps, the best first; a second one that holds parts of them, ns
STAMP = (
    (re.compile(r'(?:^|_)header_stamp_secs?$'),
     re.compile(r'(?:^|_)header_stamp_n(?:ano)?secs?$')),
    (re.compile(r'(?:^|_)header_stamp$'), None),
    (re.compile(r'^(?:t|time|time_?stamp|stamp|seconds|secs?)(?:_(?:s|ms|us|ns))?$'), None),
)
WARM = re.compile(r'(?:^|_)temp(?:erature)?(?:_|$)')
UNIT = re.compile(r'\s*[\[(]([^\])]*)[\])]\s*$')
#: what is written for a unit, without spaces and ^
WRITTEN = {'rads-1': 'rad/s', 'degs-1': 'deg/s', 'dps': 'deg/s', '°/s': 'deg/s',
           'mdps': 'mdeg/s', 'm/s2': 'm/s^2', 'ms-2': 'm/s^2', 'm/s/s': 'm/s^2', 'm/s²': 'm/s^2',
           'sec': 's', 'µs': 'us', '°c': 'degC', 'degc': 'degC', 'c': 'degC', 'k': 'K'}
#: of sensor_msgs/Imu, one number after another; names are ours where they are used
ECHO = ('header.stamp.sec', 'header.stamp.nanosec', 'frame_id', *('orientation',) * 13,
        *AXES[:3], *('covariance',) * 9, *AXES[3:], *('covariance',) * 9)
HOW = ('name the columns, e.g. --fields gyro=A+B+C,accel=D+E+F,stamp=G:ms, each with its unit '
       'behind it where it is not SI')
LISTED = 16         # names that a message lists


@dataclass
class Columns:
    """
    How the lines of a table are read.

    ``place`` is where ``t``, ``t_ns``, ``gyro_x`` ... are among the columns, ``scale`` of those
    that need it (factor, what is added); ``units`` are those by sensor that are stated and not SI;
    ``text`` the columns that hold no numbers. Of a table of ours (``own``) all are taken.

    """

    path: Path
    delimiter: str | None
    names: list[str]
    place: dict[str, int] = field(default_factory=dict)
    scale: dict[str, tuple[float, float]] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    text: set[int] = field(default_factory=set)
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
    first = first.lstrip('#%\ufeff ').rstrip('\r\n')
    delimiter = next((d for d in ('\t', ';', ',') if d in first), None)
    found = Columns(path, delimiter, [])
    cells = [c.strip().strip('"') for c in found.cells(first)]
    numbers = [_is_number(c) for c in cells]
    if len(cells) == len(ECHO) and numbers.count(False) == 1 and not numbers[2]:
        found.names, found.headed, second = list(ECHO), False, first
    elif cells and all(numbers):
        found.names, found.headed, second = [str(k + 1) for k in range(len(cells))], False, first
    else:
        found.names = cells
    found.text = {k for k, c in enumerate(found.cells(second)) if c.strip() and not _is_number(c)}
    if fields is None:
        _by_names(found)
    else:
        _by_fields(found, fields)
    return found


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _plain(name: str) -> str:
    """Return a name without its unit, in small letters, parts joined by ``_``."""
    return re.sub('[^a-z0-9]+', '_', UNIT.sub('', name).lower()).strip('_')


def _stated(name: str) -> str:
    """Return the unit that a name states, as ours are written."""
    unit = UNIT.search(name)
    said = unit[1].replace(' ', '').replace('^', '').lower() if unit else ''
    return WRITTEN.get(said, said)


def _by_names(found: Columns) -> None:
    """Find the columns by their names; raise InputError where they cannot be told."""
    names = [n.lower() for n in found.names]
    found.own = bool(set(names) & set(AXES)) and found.headed
    if found.own and len(set(names)) != len(names):
        raise InputError(f'{found.path}: its first line names a column twice', HOW)
    plain = [_plain(n) for n in names]
    for sensor, pattern in SAMPLE.items():
        for axis in (a for a in AXES if a.startswith(sensor)):
            fits = [k for k, n in enumerate(names) if n == axis] or [
                k for k, n in enumerate(plain) if (m := pattern.search(n)) and m[1] == axis[-1]]
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
    warm = [k for k, n in enumerate(plain) if WARM.search(n) and k not in found.place.values()]
    if found.own:
        used = set(found.place.values())
        found.place |= {n: k for k, n in enumerate(names) if n and k not in used | found.text}
    elif len(warm) == 1:
        _temperature(found, warm[0], _stated(found.names[warm[0]]))


def _by_fields(found: Columns, fields: Fields) -> None:
    """Find the columns that are named; raise UsageError for one that is not there."""
    plain = [_plain(n) for n in found.names]

    def place(name: str) -> int:
        for known in (found.names, plain):
            if name in known:
                return known.index(name)
        raise unknown(f'column of {found.path.name}', name, found.names)

    units = fields.units or {}
    for sensor in SAMPLE:
        three = getattr(fields, sensor)
        if len(three) == 1:
            raise UsageError(f'invalid --fields {sensor}={three[0]}',
                             'of a table three columns, joined with +')
        found.place |= {f'{sensor}_{c}': place(name) for c, name in zip('xyz', three)}
        if three:
            unit = units.get(sensor) or _stated(found.names[found.place[f'{sensor}_x']])
            _unit(found, sensor, unit)
    if fields.stamp:
        k = place(fields.stamp)
        found.place['t'] = k
        _time_unit(found, units.get('stamp') or _stated(found.names[k]))
    else:
        _stamps(found, plain)
    if fields.temperature:
        _temperature(found, place(fields.temperature), units.get('temperature', ''))


def _unit(found: Columns, sensor: str, unit: str) -> None:
    """Take note of the unit of a sensor's columns."""
    if unit not in INPUT[sensor]:
        if unit:
            found.said.append(f'the unit {unit} of {sensor} is not known: it was taken as '
                              f'{SI[sensor]}')
        return
    if unit != SI[sensor]:
        found.units[sensor] = unit
        found.scale |= {a: (INPUT[sensor][unit], 0.0) for a in AXES if a.startswith(sensor)}


def _stamps(found: Columns, plain: Sequence[str]) -> None:
    """Find the stamps: of several, those named most like the samples."""
    if 't' in found.names:          # ours
        found.place['t'] = found.names.index('t')
        return
    sample = found.names[next(iter(found.place.values()))]

    def nearest(pattern: re.Pattern[str]) -> int | None:
        fits = [k for k, n in enumerate(plain) if pattern.search(n) and k not in found.text]
        return max(fits, default=None,
                   key=lambda k: len(os.path.commonprefix([found.names[k], sample])))

    for whole, parts in STAMP:
        k, fine = nearest(whole), nearest(parts) if parts else None
        if k is None or parts and fine is None:
            continue
        found.place['t'] = k
        if fine is not None:
            found.place['t_ns'] = fine
            return
        ros1 = any(n.startswith('field.') for n in found.names)
        name = found.names[k].lower()
        _time_unit(found, _stated(name) or ('ns' if ros1 else name.rpartition('_')[2]))
        return


def _time_unit(found: Columns, unit: str) -> None:
    if unit in TIME_UNITS:
        found.scale['t'] = TIME_UNITS[unit] * 1e-9, 0.0


def _temperature(found: Columns, place: int, unit: str) -> None:
    found.place['temperature'] = place
    found.scale['temperature'] = TEMPERATURE_UNITS.get(unit, (1.0, 0.0))
