# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Messages of other types read as if they were Imu messages.

A type is known by its definition, which the bag holds (for PX4's, where it holds none, one is
here). What is named of it, :class:`Fields`, is found by walking the definition through the bytes
of thousands of messages at once: each is at its own place, for strings and sequences differ in
length.

"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
import math
import re
from typing import Any

import numpy as np

from .container import Batch, Connection, Damaged, rows
from .decode import ACCEL, ACCEL_COVARIANCE, Decoded, DOUBLES, GYRO, GYRO_COVARIANCE, IMU
from ..core.errors import unknown, UsageError
from ..core.units import ACCEL_UNITS, GYRO_UNITS, SI, to_si

#: unit to (factor, what is added): degC
TEMPERATURE_UNITS = {'degC': (1.0, 0.0), 'K': (1.0, -273.15), 'mdegC': (1e-3, 0.0)}
TIME_UNITS = {                                                               # in ns
    's': 1_000_000_000, 'ms': 1_000_000, '0.1ms': 100_000, 'us': 1000, 'ns': 1}
UNITS: dict[str, Mapping[str, Any]] = {
    'gyro': GYRO_UNITS, 'accel': ACCEL_UNITS, 'stamp': TIME_UNITS,
    'temperature': TEMPERATURE_UNITS}
HOW = 'e.g. --fields gyro=gyro_rad,accel=accelerometer_m_s2,stamp=timestamp:us'
MOST_ELEMENTS = 4096        # of a sequence of strings or messages

SIZES = {
    'bool': 'u1', 'byte': 'u1', 'char': 'u1', 'octet': 'u1',
    'int8': 'i1', 'uint8': 'u1', 'int16': 'i2', 'uint16': 'u2', 'int32': 'i4', 'uint32': 'u4',
    'int64': 'i8', 'uint64': 'u8', 'float32': 'f4', 'float64': 'f8',
}


@dataclass(frozen=True)
class Fields:
    """
    Which fields of a message are those of an Imu message.

    Parameters
    ----------
    gyro, accel : tuple of str
        One path, to an array of three or to a message with x, y and z; or three, to a number
        each. A path is written ``state.imu.gyro``, an element of an array ``data[3]``. Empty: the
        message has none.
    stamp : str
        Path to a time, or to a number; empty: the header's, where there is one.
    temperature : str
        Path to the sensor's temperature; empty: there is none.
    units : mapping of str to str
        Of ``gyro``, ``accel``, where they are not SI, of ``temperature``, where it is not degC; a
        ``stamp`` that is a number needs its unit.
    invalid : tuple of (str, str, int)
        A sensor's samples are missing where this field has this value.
    only : (str, float) or None
        Of a table: the column that tells several sensors apart, and the value of the one that is
        read.

    """

    gyro: tuple[str, ...] = ()
    accel: tuple[str, ...] = ()
    stamp: str = ''
    units: Mapping[str, str] | None = None
    invalid: tuple[tuple[str, str, int], ...] = ()
    temperature: str = ''
    only: tuple[str, float] | None = None

    @classmethod
    def of(cls, text: str, table: bool = False) -> Fields:
        """
        Return what is meant by a text as typed.

        ``gyro=PATH,accel=PATH,stamp=PATH,temperature=PATH``, each with ``:unit`` behind it where
        it has another; three numbers are joined with ``+``. Of a ``table`` also
        ``only=COLUMN:VALUE``, and what has a name that is known need not be named.

        Raises
        ------
        UsageError
            It makes no sense.

        """
        found: dict[str, str] = {}
        units: dict[str, str] = {}
        for piece in text.split(','):
            name, equals, value = (x.strip() for x in piece.partition('='))
            path, colon, unit = (x.strip() for x in value.partition(':'))
            if not equals or not path or name in found:
                raise UsageError(f'invalid --fields {text}', HOW)
            known = [*UNITS, *(['only'] if table else [])]
            if name not in known:
                raise unknown('name in --fields', name, known)
            if name == 'only' and not _is_number(unit):
                raise UsageError(f'invalid --fields {text}', 'only=COLUMN:VALUE names the lines '
                                 'of one sensor by a number in a column')
            if colon and name in SI:
                try:
                    to_si(name, unit)
                except UsageError as error:
                    raise UsageError(f'unknown unit of {name} {unit}', error.remedy) from None
            elif colon and name != 'only' and unit not in UNITS[name]:
                raise unknown(f'unit of {name}', unit, UNITS[name])
            found[name] = path
            units |= {name: unit} if colon else {}
        vectors = {s: tuple(p.strip() for p in found[s].split('+'))
                   for s in ('gyro', 'accel') if s in found}
        by_name = table and bool({'stamp', 'temperature', 'only'} & set(found))
        if not (vectors or by_name) or any(
                len(v) not in (1, 3) or not all(v) for v in vectors.values()):
            raise UsageError(f'invalid --fields {text}', 'gyro and accel are one field, or three '
                             f'joined with +; {HOW}')
        only = (found['only'], float(units.pop('only'))) if 'only' in found else None
        return cls(vectors.get('gyro', ()), vectors.get('accel', ()), found.get('stamp', ''),
                   units, temperature=found.get('temperature', ''), only=only)

    def scale(self, name: str) -> float:
        """Return the factor that turns a sensor's unit into SI."""
        unit = (self.units or {}).get(name)
        return to_si(name, unit) if unit else 1.0


def _is_number(text: str) -> bool:
    """Tell whether a text is a number that a column can have."""
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


# PX4's own, since 2020: PX4/px4_msgs at a4a9864b3c, msg/SensorCombined.msg, SensorGyro.msg and
# SensorAccel.msg. A bag of rosbag2 older than Iron holds no definitions.
_SENSOR = """uint64 timestamp
uint64 timestamp_sample
uint32 device_id
float32 x
float32 y
float32 z
float32 temperature
uint32 error_count
uint8[3] clip_counter
uint8 samples
"""
_COMBINED = """uint64 timestamp
float32[3] gyro_rad
uint32 gyro_integral_dt
int32 accelerometer_timestamp_relative
float32[3] accelerometer_m_s2
uint32 accelerometer_integral_dt
uint8 accelerometer_clipping
uint8 gyro_clipping
uint8 accel_calibration_count
uint8 gyro_calibration_count
"""
_XYZ = ('x', 'y', 'z')
_US = {'stamp': 'us'}
#: type: definition, what of it is an Imu's (the first that fits)
KNOWN: dict[str, tuple[str, tuple[Fields, ...]]] = {
    'px4_msgs/msg/SensorCombined': (_COMBINED, (Fields(
        ('gyro_rad',), ('accelerometer_m_s2',), 'timestamp', _US,
        (('accel', 'accelerometer_timestamp_relative', 0x7fffffff),)),)),
    'px4_msgs/msg/SensorGyro': (_SENSOR, (
        Fields(gyro=_XYZ, stamp='timestamp_sample', units=_US, temperature='temperature'),
        Fields(gyro=_XYZ, stamp='timestamp', units=_US))),
    'px4_msgs/msg/SensorAccel': (_SENSOR, (
        Fields(accel=_XYZ, stamp='timestamp_sample', units=_US, temperature='temperature'),
        Fields(accel=_XYZ, stamp='timestamp', units=_US))),
}
# What is proposed for a type that has such fields.
USUAL = (('gyro', ('angular_velocity', 'gyro', 'gyroscope', 'gyro_rad', 'omega', 'rates')),
         ('accel', ('linear_acceleration', 'accel', 'accelerometer', 'acceleration',
                    'accelerometer_m_s2')))


class Types:
    """
    The fields of a type, and of the types in it, by its definition.

    Parameters
    ----------
    type, text : str
        Name of the type and its definition, with those of the types in it behind it, as bags hold
        them.
    encoding : str
        ``cdr`` or ``ros1``.

    Raises
    ------
    Damaged
        The definition cannot be read.

    """

    def __init__(self, type: str, text: str, encoding: str):
        from rosbags.typesys import get_types_from_msg, get_typestore, Stores
        store = get_typestore(Stores.ROS1_NOETIC if encoding == 'ros1' else Stores.ROS2_JAZZY)
        try:
            own = get_types_from_msg(text, type) if text else {}
        except Exception as error:      # whatever the parser runs into
            raise Damaged(f'the definition of {type} cannot be read') from error
        self.type, self.ros1 = type, encoding == 'ros1'
        self._fields = {name: fields for name, (_, fields) in {**store.fielddefs, **own}.items()}
        if type not in self._fields:
            raise Damaged(f'the bag holds no definition of {type}')

    def fields(self, type: str) -> list[tuple[str, Any]]:
        """Return names and types of a type's fields; raise Damaged where it is not defined."""
        if type not in self._fields:
            raise Damaged(f'{type} is not defined')
        return self._fields[type]

    def leaves(self) -> dict[str, int | None]:
        """Return all numbers by their path: 0, of an array its length, of a sequence None."""
        return dict(self._leaves(self.type, '', 0))

    def _leaves(self, type: str, above: str, depth: int) -> Iterator[tuple[str, int | None]]:
        for name, (node, of) in self.fields(type):
            kind = node.name
            if kind == 'NAME' and depth < 16:
                yield from self._leaves(of, f'{above}{name}.', depth + 1)
            elif kind == 'BASE' and of[0] in SIZES:
                yield above + name, 0
            elif kind in ('ARRAY', 'SEQUENCE') and of[0][0].name == 'BASE':
                if of[0][1][0] in SIZES:
                    yield above + name, of[1] if kind == 'ARRAY' else None

    def walk(self, batch: Batch, order: str) -> _Walk:
        """
        Return where the numbers and strings of messages lie, numbers in this order of bytes.

        Raises
        ------
        Damaged
            The definition names what is not known.

        """
        walk = _Walk(self, batch, order)
        walk.message(self.type, '')
        left = walk.end - walk.at
        walk.good &= (left >= 0) & (left < 4)       # some pad the end
        return walk


class _Walk:
    """
    One way through the bytes of many messages at once, each at its own place.

    ``good`` (n,) says which are as their definition says; ``on`` which of them have the element
    that is walked through: sequences may differ in length.

    """

    def __init__(self, types: Types, batch: Batch, order: str):
        self.types, self.data, self.order = types, batch.data, order
        self.origin = batch.begin + (0 if types.ros1 else 4)
        self.at, self.end = self.origin, batch.begin + batch.length
        self.good = self.at <= self.end
        self.on = self.good
        #: path to (places of the first byte (n,), numpy type, how many (n,))
        self.places: dict[str, tuple[np.ndarray, str, np.ndarray]] = {}

    def message(self, type: str, above: str) -> None:
        """Go through a message, or one within."""
        fields = self.types.fields(type)
        if not fields and not self.types.ros1:
            self._pass(1)       # an empty structure has one octet
        for name, (node, of) in fields:
            kind = node.name
            if kind in ('BASE', 'NAME'):
                self._one(kind, of, above + name)
            else:
                count = np.full(len(self.at), of[1]) if kind == 'ARRAY' else self._length()
                self._many(of[0][0].name, of[0][1], above + name, count)

    def column(self, path: str) -> np.ndarray:
        """Return one number of each message, (n,); those that have none are not good."""
        name, index = _element(path)
        at, dtype, count = self.places[name]
        size = np.dtype(dtype).itemsize
        at = at + (index or 0) * size
        self.good &= (count > (index or 0)) & (at + size <= self.end)
        raw = rows(self.data, np.where(self.good, at, 0), size)
        return np.ascontiguousarray(raw).view(dtype)[:, 0]

    def text(self, path: str) -> str:
        """Return a string of the first message that is good; nothing where it has none."""
        first = np.flatnonzero(self.good)[:1]
        if path not in self.places or not len(first):
            return ''
        places, _, counts = self.places[path]
        at, count = int(places[first[0]]), int(counts[first[0]])
        return self.data[at:at + count].tobytes().rstrip(b'\0').decode(errors='replace')

    def _one(self, kind: str, of: Any, path: str) -> None:
        if kind == 'NAME':
            self.message(of, f'{path}.')
        elif of[0] == 'string':
            count = self._length()
            self.places[path] = self.at, 'S', count
            self._pass(count)
        else:
            self._numbers(of[0], path, np.ones(len(self.at), np.int64))

    def _many(self, kind: str, of: Any, path: str, count: np.ndarray) -> None:
        if kind == 'BASE' and of[0] in SIZES:
            self._numbers(of[0], path, count)
            return
        self.good &= ~self.on | (count <= MOST_ELEMENTS)
        before, count = self.on, np.where(self.good, count, 0)
        for k in range(int(count.max(initial=0))):
            self.on = before & (count > k)
            self._one(kind, of, f'{path}[{k}]')
        self.on = before & self.good

    def _numbers(self, base: str, path: str, count: np.ndarray) -> None:
        if base not in SIZES:
            raise Damaged(f'{base} is not known')
        size = int(SIZES[base][1])
        self._align(size, self.on & (count > 0))
        self.places[path] = self.at, self.order + SIZES[base], np.where(self.on, count, 0)
        self._pass(count * size)

    def _length(self) -> np.ndarray:
        self._align(4, self.on)
        there = self.on & (self.at + 4 <= self.end)
        self.good &= there | ~self.on
        raw = np.ascontiguousarray(rows(self.data, np.where(there, self.at, 0), 4))
        self.at = self.at + 4 * there
        return np.where(there, raw.view(f'{self.order}u4')[:, 0].astype(np.int64), 0)

    def _align(self, size: int, which: np.ndarray) -> None:
        if not self.types.ros1 and size > 1:
            self.at = self.at + np.where(which, -(self.at - self.origin) % size, 0)

    def _pass(self, bytes: Any) -> None:
        self.at = self.at + np.where(self.on, bytes, 0)
        self.good = self.good & (self.at <= self.end)
        self.on = self.on & self.good


@dataclass(frozen=True)
class Shape:
    """How messages of a type are read as Imu messages."""

    types: Types
    fields: Fields
    kind: str = IMU

    @property
    def without(self) -> set[str]:
        """Return the sensors that the messages do not have."""
        return {s for s in ('gyro', 'accel') if not getattr(self.fields, s)}

    @classmethod
    def of(cls, connection: Connection, fields: Fields) -> Shape:
        """
        Return the shape of a topic's messages.

        Raises
        ------
        Damaged
            The bag holds no definition of the type, or one that cannot be read.
        UsageError
            The type has no such fields, or they are not what they should be.

        """
        text = connection.definition or KNOWN.get(connection.type, ('',))[0]
        types = _types(connection.type, text, connection.encoding)
        leaves = types.leaves()
        for sensor in ('gyro', 'accel'):
            paths = getattr(fields, sensor)
            for path in paths:
                _check_vector(path, leaves, connection.type, len(paths) == 3)
        if fields.stamp and not (f'{fields.stamp}.sec' in leaves
                                 and f'{fields.stamp}.nanosec' in leaves):
            _check_number(fields.stamp, leaves, connection.type)
            if not (fields.units or {}).get('stamp'):
                raise UsageError(f'--fields: the unit of {fields.stamp} is not said',
                                 f'e.g. stamp={fields.stamp}:us')
        beside = [fields.temperature] if fields.temperature else []
        for path in (*(path for _, path, _ in fields.invalid), *beside):
            _check_number(path, leaves, connection.type)
        return cls(types, fields)

    def decode(self, batch: Batch) -> Decoded:
        """Return messages as those of an Imu: see :func:`imu_noise_tools.bag.decode.decode`."""
        n = len(batch.receive)
        stamp, values, good = np.zeros(n, np.int64), np.zeros((n, DOUBLES[IMU])), np.zeros(n, bool)
        values[:, 3], values[:, 4] = 1.0, -1.0
        temperature = np.full(n, np.nan) if self.fields.temperature else None
        frame = ''
        for part, covariance in ((self.fields.gyro, GYRO_COVARIANCE),
                                 (self.fields.accel, ACCEL_COVARIANCE)):
            values[:, covariance.start] = 0.0 if part else -1.0
        for order, some in _orders(batch, self.types.ros1):
            try:
                walk = self.types.walk(batch.take(some), order)
                stamp[some], values[some] = self._read(walk, values[some])
                if temperature is not None:
                    temperature[some] = self._temperature(walk)
            except Damaged:
                continue
            good[some] = walk.good
            frame = frame or walk.text('header.frame_id')
        return Decoded(stamp[good], values[good], frame, good,
                       None if temperature is None else temperature[good])

    def _read(self, walk: _Walk, values: np.ndarray) -> tuple:
        """Return stamps and doubles of messages."""
        for sensor, where in (('gyro', GYRO), ('accel', ACCEL)):
            paths = getattr(self.fields, sensor)
            if not paths:
                continue
            if len(paths) == 3:
                columns = [walk.column(p) for p in paths]
            elif f'{paths[0]}.x' in walk.places:
                columns = [walk.column(f'{paths[0]}.{a}') for a in 'xyz']
            else:
                columns = [walk.column(f'{paths[0]}[{k}]') for k in range(3)]
            values[:, where] = np.stack(columns, axis=1)
            values[:, where] *= self.fields.scale(sensor)
        for sensor, path, value in self.fields.invalid:
            values[walk.column(path) == value, GYRO if sensor == 'gyro' else ACCEL] = np.nan
        return self._stamps(walk), values

    def _temperature(self, walk: _Walk) -> np.ndarray:
        factor, added = TEMPERATURE_UNITS[(self.fields.units or {}).get('temperature', 'degC')]
        return walk.column(self.fields.temperature) * factor + added

    def _stamps(self, walk: _Walk) -> np.ndarray:
        path = self.fields.stamp or 'header.stamp'
        if f'{path}.sec' in walk.places:
            return (walk.column(f'{path}.sec').astype(np.int64) * 1_000_000_000
                    + walk.column(f'{path}.nanosec').astype(np.int64))
        if not self.fields.stamp:
            return np.zeros(len(walk.at), np.int64)
        unit = TIME_UNITS[(self.fields.units or {})['stamp']]
        number = walk.column(path)
        if number.dtype.kind == 'f':
            return np.round(number.astype(float) * unit).astype(np.int64)
        return number.astype(np.int64) * unit


def _orders(batch: Batch, ros1: bool) -> list[tuple[str, np.ndarray]]:
    """Return orders of bytes, and which messages are in each; other bytes are in none."""
    if ros1:
        return [('<', np.arange(len(batch.begin)))]
    long = batch.length >= 4
    head = rows(batch.data, np.where(long, batch.begin, 0), 2) if long.any() else np.zeros((1, 2))
    kinds = (('<', 1), ('>', 0))
    found = [(o, np.flatnonzero(long & (head[:, 0] == 0) & (head[:, 1] == k))) for o, k in kinds]
    return [(order, some) for order, some in found if len(some)]


@cache
def _types(type: str, text: str, encoding: str) -> Types:
    return Types(type, text, encoding)


def known_shape(connection: Connection) -> Shape | None:
    """Return how messages of a type are read that is no Imu, but known; None of another."""
    for fields in KNOWN.get(connection.type, ('', ()))[1]:
        try:
            return Shape.of(connection, fields)
        except (Damaged, UsageError):
            continue
    return None


def known_table(names: Collection[str], file: str) -> Fields | None:
    """
    Return how a table with these columns is read, where they are of a known type; or None.

    So PX4's ``ulog2csv`` writes them: a column for each number. Types that have the same ones are
    told by the name of the file, which ends in that of the topic.

    """
    fits = {}
    for type, (_, choices) in KNOWN.items():
        for fields in choices:
            vectors = (f'{v}[{k}]' for v in fields.gyro + fields.accel for k in range(3)) \
                if len(fields.gyro or fields.accel) == 1 else fields.gyro + fields.accel
            wanted = {*vectors, fields.stamp, *(f for _, f, _ in fields.invalid)}
            if type not in fits and wanted | {fields.temperature} <= {*names, ''}:
                fits[type] = fields
    if len(fits) > 1:
        topic = {t: re.sub('(?<=[a-z])(?=[A-Z])', '_', t.rpartition('/')[2]).lower() for t in fits}
        fits = {t: f for t, f in fits.items() if topic[t] in file}
    return next(iter(fits.values())) if len(fits) == 1 else None


def proposed(connection: Connection) -> str:
    """Return what ``--fields`` might be for a type, by the names that are usual; or nothing."""
    try:
        leaves = _types(connection.type, connection.definition, connection.encoding).leaves()
    except Damaged:
        return ''
    found = []
    for sensor, names in USUAL:
        for path in leaves:
            path = path.removesuffix('.x')
            if path.rpartition('.')[2] in names and (
                    leaves.get(path) == 3 or all(f'{path}.{a}' in leaves for a in 'xyz')):
                found.append(f'{sensor}={path}')
                break
    return ','.join(found)


def _check_vector(path: str, leaves: dict[str, int | None], type: str, number: bool) -> None:
    if number:
        _check_number(path, leaves, type)
        return
    if all(f'{path}.{a}' in leaves for a in 'xyz'):
        return
    if path not in leaves:
        raise _no_field(path, leaves, type)
    if leaves[path] not in (3, None):
        raise UsageError(f'--fields: {path} of {type} is not three numbers',
                         'name three, joined with +')


def _check_number(path: str, leaves: dict[str, int | None], type: str) -> None:
    name, index = _element(path)
    if name not in leaves:
        raise _no_field(path, leaves, type)
    n = leaves[name]
    if (index is None) != (n == 0) or (n and index is not None and index >= n):
        raise UsageError(f'--fields: {path} of {type} is not a number',
                         'name an element of an array as in data[3]')


def _no_field(path: str, leaves: dict[str, int | None], type: str) -> UsageError:
    shown = {n: f'{n}[{k}]' if k else f'{n}[]' if k is None else n for n, k in leaves.items()}
    error = unknown(f'field of {type}:', path, shown)
    return UsageError(error.message, re.sub(r'choose from .*', 'it has ' + ', '.join(
        shown.values()), error.remedy))


def _element(path: str) -> tuple[str, int | None]:
    """Return the name of an array and the number of its element; None without one."""
    found = re.fullmatch(r'(.*)\[(\d+)\]', path)
    return (found[1], int(found[2])) if found else (path, None)
