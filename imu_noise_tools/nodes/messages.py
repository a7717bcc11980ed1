# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The only place that builds or reads messages: arrays in, arrays out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
import re
import struct
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
import numpy as np
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import Image, Imu
from std_msgs.msg import Float64MultiArray, MultiArrayDimension

from . import answers
from ..bag.container import Batch, Connection
from ..bag.decode import ACCEL, decode, DOUBLES, GYRO, IMU
from ..core.record import AXES

BLOCK_COLUMNS = ('stamp', *AXES)
CURVE_COLUMNS = ('tau', 'adev', 'lo', 'hi', 'model', 'log10_tau', 'log10_adev')
_LIVE = Connection(0, 'imu/data_raw', IMU, 'cdr')


# ---- sensor_msgs/Imu, serialised ----

def _body(raw: bytes) -> int:
    """Return where the doubles of an Imu begin (little-endian CDR, aligned from byte 4)."""
    if raw[:2] != b'\0\1':
        raise ValueError('not little-endian CDR')
    length = struct.unpack_from('<I', raw, 12)[0]
    body = 4 + (12 + length + 7) // 8 * 8
    if len(raw) < body + 8 * DOUBLES[IMU]:
        raise ValueError('too short for an Imu')
    return body


def plain(raw: bytes) -> bytes:
    """Return the message in the serialisation that the rest here reads."""
    return raw if raw[:2] == b'\0\1' else serialize_message(deserialize_message(raw, Imu))


@dataclass(frozen=True)
class Samples:
    """
    Imu messages as arrays: stamps (n,) ns, gyro and accel (n, 3), SI.

    ``readable`` (of the batch,) says which messages they are from.

    """

    stamps: np.ndarray
    gyro: np.ndarray
    accel: np.ndarray
    frame_id: str = ''
    readable: np.ndarray = field(default_factory=lambda: np.ones(0, bool))

    def __len__(self):
        """Return how many there are."""
        return len(self.stamps)

    @property
    def refused(self) -> int:
        """How many messages could not be read."""
        return int(np.sum(~self.readable))


def samples(batch: Sequence[bytes]) -> Samples:
    """Read serialised Imu messages, as they are read from a bag."""
    length = np.fromiter(map(len, batch), np.int64, len(batch))
    data = np.frombuffer(b''.join(batch), np.uint8)
    unknown = np.zeros(len(batch), np.int64)            # receive times
    found = decode(Batch(_LIVE, unknown, data, length.cumsum() - length, length))
    return Samples(found.stamp, found.values[:, GYRO].copy(), found.values[:, ACCEL].copy(),
                   found.frame_id, found.readable)


def rate_of(raw: bytes) -> tuple[int, tuple[float, float, float], bool]:
    """Return stamp (ns), angular rate (rad/s), and whether there is one (else -1 is stated)."""
    sec, nanosec = struct.unpack_from('<iI', raw, 4)
    *rate, covariance = struct.unpack_from('<4d', raw, _body(raw) + 8 * GYRO.start)
    return sec * 10 ** 9 + nanosec, tuple(rate), covariance != -1.0


def frame_of(raw: bytes) -> str:
    """Return the frame of an Imu message."""
    length = struct.unpack_from('<I', raw, 12)[0]
    return raw[16:16 + length].rstrip(b'\0').decode(errors='replace')


def with_rate(raw: bytes, rate: Iterable[float], variance: Iterable[float]) -> bytes:
    """Return the message with another rate (rad/s) and variance; all else is copied."""
    x, y, z = variance
    out = bytearray(raw)
    struct.pack_into('<12d', out, _body(raw) + 8 * GYRO.start, *rate, x, 0, 0, 0, y, 0, 0, 0, z)
    return bytes(out)


def with_vectors(raw: bytes, gyro: np.ndarray | None = None,
                 accel: np.ndarray | None = None) -> bytes:
    """Return the message with another rate (rad/s) or acceleration (m/s^2); all else is copied."""
    out, body = bytearray(raw), _body(raw)
    for first, vector in ((GYRO.start, gyro), (ACCEL.start, accel)):
        if vector is not None:
            struct.pack_into('<3d', out, body + 8 * first, *vector)
    return bytes(out)


def with_stamp(raw: bytes, ns: int) -> bytes:
    """Return the message with another header stamp."""
    out = bytearray(raw)
    struct.pack_into('<iI', out, 4, *divmod(int(ns), 10 ** 9))
    return bytes(out)


# ---- tables ----

def table(rows: np.ndarray, columns: Sequence[str], label: str) -> Float64MultiArray:
    """Return an array (n, columns) with its columns named; ``label`` is that of the rows."""
    rows = np.ascontiguousarray(rows, float)
    n, k = rows.shape
    out = Float64MultiArray()
    out.layout.dim = [MultiArrayDimension(label=label, size=n, stride=n * k),
                      MultiArrayDimension(label=','.join(columns), size=k, stride=k)]
    out.data.frombytes(rows.tobytes())
    return out


def rows_of(message: Float64MultiArray) -> tuple[str, list[str], np.ndarray]:
    """Return label, names of columns, array (n, columns); raise ValueError where they disagree."""
    if len(message.layout.dim) != 2:
        raise ValueError('a table has two dimensions')
    rows, columns = message.layout.dim
    data = np.frombuffer(message.data, float)
    if len(data) != rows.size * columns.size:
        raise ValueError(f'{len(data)} numbers for {rows.size} x {columns.size}')
    return rows.label, columns.label.split(','), data.reshape(rows.size, columns.size)


def block(first: int, stamps: np.ndarray, gyro: np.ndarray, accel: np.ndarray,
          sensor: str = '') -> Float64MultiArray:
    """
    Return a block of samples for ``imu/buffer``.

    ``first`` is the index of the first one, ``stamps`` (n,) ns, ``gyro`` rad/s and ``accel`` m/s^2
    (n, 3). ``sensor`` names the one whose samples they are, at times of its own; the other's
    columns are NaN then, and ``first`` counts its samples alone.

    """
    label = f'first:{first}:{sensor}' if sensor else f'first:{first}'
    return table(np.column_stack([stamps / 1e9, gyro, accel]), BLOCK_COLUMNS, label)


def samples_of_block(message: Float64MultiArray) -> tuple[int, str, Samples]:
    """
    Return index of the first sample, the sensor ('': both), and the samples.

    Raises
    ------
    ValueError
        It is no block.

    """
    label, columns, rows = rows_of(message)
    found = re.fullmatch(r'first:(\d+)(?::(gyro|accel))?', label)
    if not found or tuple(columns) != BLOCK_COLUMNS:
        raise ValueError(f'not a block of Imu samples: {label} {columns}')
    stamps = np.round(rows[:, 0] * 1e9).astype(np.int64)
    return (int(found[1]), found[2] or '',
            Samples(stamps, rows[:, 1:4].copy(), rows[:, 4:7].copy()))


def curve(tau: np.ndarray, adev: np.ndarray, lo: np.ndarray, hi: np.ndarray,
          model: np.ndarray | None = None, label: str = '') -> Float64MultiArray:
    """Return an Allan curve; log10 columns too, since some viewers have no such axes."""
    model = np.full(len(tau), np.nan) if model is None else model
    with np.errstate(divide='ignore'):
        logs = np.log10(tau), np.log10(adev)
    return table(np.column_stack([tau, adev, lo, hi, model, *logs]), CURVE_COLUMNS, label)


# ---- what people read ----

OK, WARN, ERROR, STALE = (DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR,
                          DiagnosticStatus.STALE)


def status(name: str, message: str,
           values: Mapping[str, object] | Iterable[tuple[str, object]] = (),
           level: bytes = OK) -> DiagnosticStatus:
    """Return one status; numbers are written so that they can be plotted (units are in keys)."""
    pairs = values.items() if isinstance(values, Mapping) else values
    return DiagnosticStatus(
        level=level, name=name, message=message,
        values=[KeyValue(key=str(k), value=_number(v)) for k, v in pairs if v is not None])


def coefficients(target: str, entry: Mapping) -> DiagnosticStatus:
    """
    Return one target of study.yaml as a status: values and intervals with their unit in the key.

    A single capital (N, B, K, Q, R) names itself; other parameters bear the label of their effect.
    A model beyond chance is a warning, unless what it leaves out changes nothing; one without the
    value of a coefficient and without a limit to it is an error.

    """
    values: list[tuple[str, object]] = []
    level, text = OK, ' + '.join(entry['effects'])
    if not entry['error'].get('within_chance', True) and not entry.get('sufficient'):
        level, text = WARN, f'{text}: beyond chance'
    for label, effect in entry['effects'].items():
        for name, e in effect.items():
            if not isinstance(e, Mapping):
                continue
            if e.get('value') is None and e.get('upper95') is None:
                level, text = ERROR, f'{label}.{name} could not be estimated'
            capital = len(name) == 1 and name.isupper() and '.' not in label
            key = name if capital else f'{label}.{name}'
            lo, hi = e.get('ci95') or (None, None)
            unit = f' [{e["unit"]}]' if 'unit' in e else ''     # what is chosen has none
            values += [(f'{key}{suffix}{unit}', v) for suffix, v in (
                ('', e.get('value')), ('_std', e.get('std')), ('_lo', lo), ('_hi', hi),
                ('_upper95', e.get('upper95')))]
    values += [(k, v) for k, v in entry['error'].items() if isinstance(v, (int, float))]
    return status(target, text, values, level)


def diagnosis(target: str, entry: Mapping) -> DiagnosticStatus:
    """Return one target's diagnosis as a status; a missing or unknown effect is a warning."""
    found: list = entry.get('found') or []
    remaining: Mapping = entry.get('remaining') or {}
    best: Mapping = next(iter(found or entry.get('ranked') or ()), {})
    named = [f['effect'] for f in found] or (
        [best['effect']] if best and entry['verdict'] == 'undecidable' else [])
    text = f'{entry["verdict"]}: {", ".join(named)}' if named else entry['verdict']
    failed = remaining.get('failed', ())
    # where nothing has a name it is what fails that is seen
    evidence = best.get('evidence') if named or not failed else '; '.join(
        f['evidence'] for f in failed)
    values = {'verdict': entry['verdict'], 'found': ', '.join(f['effect'] for f in found) or None,
              'remaining': ', '.join(f['test'] for f in failed) or None,
              'sufficient': entry.get('sufficient'), 'best': best.get('effect'),
              'gain [nat]': best.get('gain'), 'probability [1]': best.get('probability'),
              'evidence': evidence, 'advice': entry.get('advice') or None}
    level = WARN if entry['verdict'] in ('missing', 'unknown') else OK
    return status(target, text, values, level)


def copied(one: DiagnosticStatus) -> DiagnosticStatus:
    """Return the same status again, to be changed."""
    return DiagnosticStatus(level=one.level, name=one.name, message=one.message,
                            hardware_id=one.hardware_id, values=list(one.values))


def _number(value) -> str:
    if isinstance(value, (bool, np.bool_)):
        return str(bool(value)).lower()
    return repr(float(value)) if isinstance(value, (float, np.floating)) else str(value)


def diagnostics(node: Any, statuses: Iterable[DiagnosticStatus],
                frame_id: str = '') -> DiagnosticArray:
    """Return an array of statuses, stamped with the time of a node."""
    out = DiagnosticArray(status=list(statuses))
    out.header.stamp, out.header.frame_id = node.get_clock().now().to_msg(), frame_id
    return out


def image(node: Any, pixels: np.ndarray) -> Image:
    """Return an image of RGB pixels (height, width, 3), uint8, stamped with the node's time."""
    pixels = np.ascontiguousarray(pixels, np.uint8)
    out = Image(height=pixels.shape[0], width=pixels.shape[1], encoding='rgb8',
                step=3 * pixels.shape[1])
    out.header.stamp = node.get_clock().now().to_msg()
    out.data.frombytes(pixels.tobytes())
    return out


def answer(response: Any, result: Any, success: bool = True) -> Any:
    """Fill a Trigger's response: its message is YAML in one line, with a summary first."""
    response.success = success
    response.message = answers.text(result)
    return response
