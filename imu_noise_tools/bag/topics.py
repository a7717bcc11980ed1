# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Which topics of a bag make a record.

They are found by type, and joined where gyroscope and accelerometer are apart.

"""

from __future__ import annotations

from dataclasses import dataclass
import re

import numpy as np

from .decode import (
    ACCEL,
    ACCEL_COVARIANCE,
    decode,
    GYRO,
    GYRO_COVARIANCE,
    IMU,
    MAGNETIC,
    PRESSURE,
    TEMPERATURE,
    VECTOR,
)
from .fields import Fields, proposed
from .source import Bag
from ..core.errors import InputError, UsageError

ALL = 'all'         # what is typed for every Imu of a bag
# Names of the columns that a covariate's message holds, and where among its doubles they are.
COVARIATES = {
    TEMPERATURE: {'temperature': 0},
    MAGNETIC: {'magnetic_x': 0, 'magnetic_y': 1, 'magnetic_z': 2},
    PRESSURE: {'pressure': 0},
}


@dataclass(frozen=True)
class TopicInfo:
    """
    One topic of a bag.

    Parameters
    ----------
    name, type : str
        As in the bag; the type always as ``package/msg/Name``.
    samples : int
        Number of messages.
    rate_hz : float or None
        Messages per second from the first to the last of the topic, by their receive times.
    role : str
        ``imu``, ``covariate`` or empty: what it is used for.

    """

    name: str
    type: str
    samples: int
    rate_hz: float | None
    role: str = ''


@dataclass(frozen=True)
class Choice:
    """
    Topics to be read.

    ``gyro`` and ``accel`` are the same where one topic has both, or empty.

    """

    gyro: str
    accel: str
    type: str

    @property
    def names(self) -> tuple[str, ...]:
        """Topics to be read, each once."""
        return tuple(dict.fromkeys(n for n in (self.gyro, self.accel) if n))

    @property
    def base(self) -> str:
        """Return the topic whose stamps the record has."""
        return self.gyro or self.accel


def list_topics(bag: Bag) -> list[TopicInfo]:
    """Return the topics of a bag by name, counted over all of its files."""
    role = {(t.name, t.type): t.role for t in _names(bag)}
    return [TopicInfo(*of, seen.samples, seen.rate_hz, role[of])
            for of, seen in sorted(bag.counts().items())]


def _names(bag: Bag) -> list[TopicInfo]:
    """Return the topics of a bag, not counted."""
    return [TopicInfo(name, type, 0, None, _role(kind))
            for name, type, kind in sorted({(c.topic, c.type, c.kind) for c in bag.connections})]


def _role(type: str) -> str:
    return 'imu' if type == IMU else 'covariate' if type in COVARIATES else ''


def choose(bag: Bag, topic: str | None, fields: str | None = None) -> Choice:
    """
    Return the topic, or the pair of topics, that a record is made of.

    Where ``fields`` are given (:class:`~imu_noise_tools.bag.fields.Fields`), messages that have
    them are read by them.

    Raises
    ------
    InputError
        There is none, or several and none is chosen, or the chosen one is not there or of another
        type.
    UsageError
        No topic has these fields.

    """
    wanted = Fields.of(fields) if fields else None
    if wanted:
        asked = [t.strip().strip('/') for t in (topic or '').split(',')]
        bag.read_as(wanted, [t for t in asked if t])
    known = _names(bag)
    if not known:
        raise InputError(f'{bag.path}: nothing can be recovered from it, it names no topics',
                         'record again, or repair the file')
    if topic:
        return _asked(bag, known, topic)
    imu = _imu(bag, known, wanted)
    if len(imu) > 1:
        held = {t.name for t in list_topics(bag) if t.samples}
        imu = [t for t in imu if t.name in held] or imu
    if len(imu) == 1:
        return Choice(imu[0].name, imu[0].name, IMU)
    if imu:
        parts = {t.name: _parts(bag, t.name) for t in imu}
        pair = _pair(
            [n for n, p in parts.items() if p == ('gyro',)],
            [n for n, p in parts.items() if p == ('accel',)],
        )
        if pair and len(imu) == 2:
            return Choice(*pair, IMU)
        raise InputError(
            f'{bag.path}: {len(imu)} Imu topics: {", ".join(t.name for t in imu)}',
            'choose one with --topic',
        )
    vectors = [t.name for t in known if t.type == VECTOR]
    pair = _pair(
        [n for n in vectors if _says(n, 'gyro')], [n for n in vectors if _says(n, 'accel')]
    )
    if pair:
        return Choice(*pair, VECTOR)
    raise _no_imu(bag, known)


def _imu(bag: Bag, known: list[TopicInfo], fields: Fields | None) -> list[TopicInfo]:
    """Return the Imu topics: what is read by given fields first, then Imus, then types known."""
    given = {c.topic for c in bag.connections if c.shape and c.shape.fields == fields}
    return ([t for t in known if t.name in given] or [t for t in known if t.type == IMU]
            or [t for t in known if t.role == 'imu'])


def _pair(gyro: list[str], accel: list[str]) -> tuple[str, str] | None:
    return (gyro[0], accel[0]) if len(gyro) == len(accel) == 1 else None


def _says(topic: str, part: str) -> bool:
    return bool(
        re.search(r'gyr|angular|omega' if part == 'gyro' else r'acc', topic, re.IGNORECASE)
    )


def _asked(bag: Bag, known: list[TopicInfo], topic: str) -> Choice:
    """Return the choice of a user: one topic, or two of them with a comma between."""
    found = []
    for name in topic.split(','):
        same = [t for t in known if t.name.strip('/') == name.strip().strip('/')]
        if not same and name.strip() == ALL:
            raise UsageError('--topic all is for analyse and inspect', f'name one; {_has(known)}')
        if not same:
            raise InputError(f'{bag.path}: no topic {name.strip()}', _has(known))
        readable = [t for t in same if t.role == 'imu' or t.type == VECTOR]
        if not readable:
            raise InputError(
                f'{bag.path}: {same[0].name} is {same[0].type}, not sensor_msgs/Imu',
                f'{_how(bag, same[0])}; {_has(known)}',
            )
        found.append(readable[0])
    if len(found) > 2 or len({t.role for t in found}) > 1:
        raise InputError(f'{bag.path}: {topic} must name two topics of the same type', _has(known))
    if len(found) == 2:
        gyro_first = _parts(bag, found[0].name) == ('gyro',) or _says(found[0].name, 'gyro')
        gyro, accel = found if gyro_first else found[::-1]
        return Choice(gyro.name, accel.name, IMU if gyro.role else VECTOR)
    only = found[0]
    if only.role:
        return Choice(only.name, only.name, IMU)
    return (
        Choice('', only.name, VECTOR)
        if _says(only.name, 'accel')
        else Choice(only.name, '', VECTOR)
    )


def _has(known: list[TopicInfo]) -> str:
    return 'it has ' + ', '.join(f'{t.name} ({t.type})' for t in known)


def _proposed(bag: Bag, topic: TopicInfo) -> str:
    """Return the fields that a topic's type might be read by; nothing where it has none."""
    return next((proposed(c) for c in bag.connections if c.topic == topic.name), '')


def _how(bag: Bag, topic: TopicInfo) -> str:
    """Return what to do about a topic of another type."""
    fields = _proposed(bag, topic) or 'gyro=…,accel=…'
    return f'name its fields, as in --fields {fields}'


def _no_imu(bag: Bag, known: list[TopicInfo]) -> InputError:
    custom = [t for t in known if re.search('imu', t.type.rpartition('/')[2], re.IGNORECASE)]
    custom += [t for t in known if t not in custom and _proposed(bag, t)]
    if custom:
        return InputError(
            f'{bag.path}: {custom[0].name} has a custom type, {custom[0].type}, which cannot '
            'be read by itself',
            f'{_how(bag, custom[0])}; {_has(known)}',
        )
    return InputError(f'{bag.path}: no Imu topic', f'record sensor_msgs/Imu; {_has(known)}')


def parts_of(values: np.ndarray) -> tuple[bool, bool]:
    """Tell whether (gyro, accel) of Imu messages' doubles, (n, 37), hold anything at all."""
    return (
        _there(values[:, GYRO], values[:, GYRO_COVARIANCE]),
        _there(values[:, ACCEL], values[:, ACCEL_COVARIANCE]),
    )


def _there(data: np.ndarray, covariance: np.ndarray) -> bool:
    return not (np.all(covariance[:, 0] == -1) or np.all((data == 0) | np.isnan(data)))


def _parts(bag: Bag, topic: str) -> tuple[str, ...]:
    """Return which parts the first messages of an Imu topic hold: ``gyro``, ``accel``."""
    for batch in bag.batches([topic], [IMU]):
        some = decode(batch.take(np.arange(min(len(batch.begin), 1000))))
        if len(some.stamp):
            return tuple(n for n, there in zip(('gyro', 'accel'), parts_of(some.values)) if there)
    return ()


def every(bag: Bag, fields: str | None = None) -> list[str]:
    """
    Return what :func:`choose` takes for each Imu of a bag: a topic, or a pair of them.

    A topic of rates and one of accelerations are a pair where their names begin alike.

    Raises
    ------
    InputError, UsageError
        As :func:`choose`.

    """
    wanted = Fields.of(fields) if fields else None
    if wanted:
        bag.read_as(wanted)
    held = {t.name for t in list_topics(bag) if t.samples}
    names = [t.name for t in _imu(bag, _names(bag), wanted) if t.name in held]
    if not names:
        return [','.join(choose(bag, None, fields).names)]
    parts = {n: _parts(bag, n) for n in names}
    left = [n for n in names if parts[n] == ('accel',)]
    out = []
    for name in names:
        if parts[name] == ('gyro',):
            near = max(left, key=lambda n: _alike(n, name), default='')
            if near and (_alike(near, name) or len(names) == 2):
                left.remove(near)
                name = f'{name},{near}'
            out.append(name)
        elif parts[name] != ('accel',):
            out.append(name)
    return out + left


def _alike(one: str, other: str) -> int:
    """Return with how many parts two names begin alike."""
    pairs = zip(one.strip('/').split('/')[:-1], other.strip('/').split('/')[:-1])
    return next((k for k, (a, b) in enumerate(pairs) if a != b),
                min(one.strip('/').count('/'), other.strip('/').count('/')))


def covariates_of(bag: Bag, near: str) -> list[TopicInfo]:
    """Return the covariate topics, those in the namespace of the Imu topic first."""
    space = near.rpartition('/')[0]
    found = [t for t in _names(bag) if t.role == 'covariate']
    return sorted(found, key=lambda t: (not (space and t.name.startswith(space)), t.name))
