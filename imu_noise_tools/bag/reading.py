# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""From a file to an ImuRecord."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from .assemble import record_of
from .container import Progress
from .fields import Fields
from .source import Bag
from .tables import read_table, table_kind, table_size
from .topics import choose, every, list_topics, TopicInfo
from ..core.errors import ImuNoiseError, unknown, UsageError
from ..core.record import ImuRecord, Memory
from ..core.units import SI, to_si

KINDS = ('rate', 'delta', 'integrated')


def open_record(
    path: str | Path,
    topic: str | None = None,
    *,
    gyro_unit: str | None = None,
    accel_unit: str | None = None,
    input_kind: str = 'rate',
    rate_hz: float | None = None,
    progress: Progress = None,
    memory: Memory | None = None,
    apart: bool = False,
    fields: str | None = None,
) -> ImuRecord:
    """
    Read one IMU record.

    Parameters
    ----------
    path : str or Path
        A rosbag1 file, a rosbag2 folder, an ``.mcap`` or ``.db3`` file (also compressed whole,
        ``.zstd``), a ``.csv`` or an ``.npz``.
    topic : str, optional
        The Imu topic, or a pair ``gyro_topic,accel_topic``; needed only where there are several.
    gyro_unit, accel_unit : str, optional
        Unit of the data where it is not SI: ``deg/s``, ``mdeg/s``; ``g``, ``mg``; or what one
        count is, ``1/131deg/s`` (:func:`imu_noise_tools.core.units.to_si`).
    input_kind : str
        ``rate``; ``delta``: each sample is an increment (rad, m/s); ``integrated``: the angle or
        velocity itself.
    rate_hz : float, optional
        Sample rate, in place of the stamps.
    progress : callable, optional
        Called with the fraction done, 0 to 1.
    memory : Memory, optional
        Where long arrays are kept; :class:`~imu_noise_tools.bag.Scratch` for what is too long for
        memory.
    apart : bool
        Of two topics that are not sampled together, keep each as it is: the accelerometer's is a
        record ``beside`` the gyroscope's. Otherwise its samples are interpolated, which lowers
        their noise, and that is said.
    fields : str, optional
        Which fields of a message of another type are those of an Imu, ``gyro=PATH,accel=PATH,
        stamp=PATH:us`` (:class:`~imu_noise_tools.bag.fields.Fields`); px4_msgs' SensorCombined,
        SensorGyro and SensorAccel are known without. Of a .csv they are its columns.

    Returns
    -------
    ImuRecord
        As recorded, in order of receive time: nothing sorted out, nothing else resampled but the
        covariates.

    Raises
    ------
    InputError
        There is no record in it; the message lists the topics that there are.
    UsageError
        An unknown unit or kind.

    """
    for sensor, unit in (('gyro', gyro_unit), ('accel', accel_unit)):
        if unit is not None:
            to_si(sensor, unit)         # what is wrong is said before anything is read
    if input_kind not in KINDS:
        raise unknown('kind of input', input_kind, KINDS)
    if rate_hz is not None and not (np.isfinite(rate_hz) and rate_hz > 0):
        raise UsageError(f'invalid sample rate: {rate_hz} Hz', 'it must be a positive number')
    if table_kind(path):
        record = read_table(Path(path), rate_hz, fields)
    else:
        with Bag(path) as bag:
            try:
                choice = choose(bag, topic, fields)
                record = record_of(bag, choice, rate_hz, progress, memory, apart)
            except ImuNoiseError as error:
                raise error.after(*bag.warnings)
    first, *others = (
        _as_rate(_in_si(r, gyro_unit, accel_unit), input_kind, memory or Memory())
        for r in record.streams
    )
    return replace(first, beside=tuple(others))


def topics(path: str | Path, fields: str | None = None) -> list[TopicInfo]:
    """
    Return the topics of a bag (of a table: its one record), without reading the messages.

    Raises
    ------
    InputError
        It is no bag, or nothing in it can be recovered.

    """
    kind = table_kind(path)
    if kind:
        return [TopicInfo('imu', kind, *table_size(Path(path), fields), 'imu')]
    with Bag(path) as bag:
        if fields:
            bag.read_as(Fields.of(fields))
        return list_topics(bag)


def imus(path: str | Path, fields: str | None = None) -> list[str]:
    """
    Return what :func:`open_record` takes as ``topic`` for each IMU of a bag; of a table ``''``.

    Raises
    ------
    InputError, UsageError
        As :func:`open_record`.

    """
    if table_kind(path):
        return ['']
    with Bag(path) as bag:
        try:
            return every(bag, fields)
        except ImuNoiseError as error:
            raise error.after(*bag.warnings)


def _in_si(record: ImuRecord, gyro_unit: str | None, accel_unit: str | None) -> ImuRecord:
    units = {'gyro': gyro_unit, 'accel': accel_unit}
    said = {s: unit for s, unit in units.items()
            if unit is not None and getattr(record, s) is not None}
    for sensor, unit in said.items():
        stated = record.input_unit.get(sensor, SI[sensor])     # what it was read in already
        if (factor := to_si(sensor, unit) / to_si(sensor, stated)) != 1.0:
            data = getattr(record, sensor)
            data *= factor
    return replace(record, input_unit={**record.input_unit, **said})


def _as_rate(record: ImuRecord, kind: str, memory: Memory) -> ImuRecord:
    """Turn increments, or the angle and velocity themselves, into rates."""
    if kind == 'rate':
        return record
    if kind == 'delta':
        for data in (record.gyro, record.accel):
            if data is not None:
                data *= record.rate_hz
        return record
    later = record.part(1, record.n)

    def steps(data: np.ndarray | None) -> np.ndarray | None:
        if data is None:
            return None
        out = memory.columns(later.n)
        for k in range(3):
            np.subtract(data[1:, k], data[:-1, k], out=out[:, k])
            out[:, k] *= record.rate_hz
        return out

    return replace(later, gyro=steps(record.gyro), accel=steps(record.accel))
