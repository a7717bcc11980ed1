# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
SI, and the units the field speaks.

A parameter's unit is a template: ``{rate}`` stands for rad/s or m/s^2, ``{slope}`` for its time
derivative, ``{integral}`` for its time integral.

"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime, timezone
import math
import re

from .errors import InputError, unknown, UsageError

_SI = {
    'gyro': {'rate': 'rad/s', 'slope': 'rad/s^2', 'integral': 'rad'},
    'accel': {'rate': 'm/s^2', 'slope': 'm/s^3', 'integral': 'm/s'},
}
DEG = math.pi / 180
G0 = 9.80665
HOUR = 3600.0
SI = {sensor: names['rate'] for sensor, names in _SI.items()}
#: what samples may come in: factor to SI; :func:`to_si` knows counts as well
GYRO_UNITS = {'rad/s': 1.0, 'deg/s': DEG, 'mdeg/s': 1e-3 * DEG, 'deg/h': DEG / HOUR}
ACCEL_UNITS = {'m/s^2': 1.0, 'g': G0, 'mg': 1e-3 * G0, 'ug': 1e-6 * G0}
INPUT = {'gyro': GYRO_UNITS, 'accel': ACCEL_UNITS}

_NUMBER = r'((?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)'
_COUNT = re.compile(rf'{_NUMBER}\s*(?:/\s*{_NUMBER})?\s*(.*)')
#: what a count is, as data sheets say it: 131 LSB/(deg/s), 16384 LSB/g
A_COUNT = {'gyro': '1/131deg/s', 'accel': '1/16384g'}


def to_si(sensor: str, unit: str) -> float:
    """
    Return the factor to SI of the unit that samples come in.

    Parameters
    ----------
    sensor : str
        ``gyro`` or ``accel``.
    unit : str
        One of :data:`INPUT`, or what one count of a raw output is: a number or a fraction, and a
        unit (none: SI), as ``0.061mg`` or ``1/131deg/s``.

    Raises
    ------
    UsageError
        It is neither, or not above zero.

    """
    known = INPUT[sensor]
    if unit in known:
        return known[unit]
    found = _COUNT.fullmatch(unit.strip())
    if found is None or (found[3] or SI[sensor]) not in known:
        error = unknown(f'{sensor} unit', unit, known)
        raise UsageError(error.message, f'{error.remedy}, or say what one count is, e.g. '
                         f'{A_COUNT[sensor]}')
    size, parts = float(found[1]), float(found[2] or 1)
    factor = size / parts * known[found[3] or SI[sensor]] if parts else math.inf
    if not (0 < factor < math.inf):
        raise UsageError(f'invalid {sensor} unit: {unit}', 'what a count is must be above zero')
    return factor


def not_si(stated: object, where: str) -> dict[str, str]:
    """Return what is not SI of units by sensor that a file states; InputError: none is known."""
    try:
        if not isinstance(stated, dict) or not set(stated) <= set(INPUT):
            raise ValueError
        for sensor, unit in stated.items():
            to_si(sensor, str(unit))
    except (ValueError, UsageError):
        raise InputError(f'{where}: input_unit {stated} is not known',
                         'e.g. {accel: g, gyro: deg/s}') from None
    return {sensor: unit for sensor, unit in stated.items() if unit != SI[sensor]}


def read_in(units: Mapping[str, str], why: str) -> list[str]:
    """Return a sentence where samples are converted, from which units by sensor, and why."""
    names = {'accel': 'accelerometer', 'gyro': 'gyroscope'}
    read = ' and '.join(f'the {names[s]} is read in {unit}' for s, unit in units.items())
    return [f'{read} ({why}) and written in SI'] if units else []


# (sensor, template): factor by which SI is divided, and the field's unit. IEEE 952 Table C.1.
_FIELD = {
    ('gyro', '{rate}'): (DEG / HOUR, 'deg/h'),
    ('gyro', '{rate}/sqrt(Hz)'): (DEG / math.sqrt(HOUR), 'deg/sqrt(h)'),
    ('gyro', '{slope}/sqrt(Hz)'): (DEG / HOUR**1.5, 'deg/h^1.5'),
    ('gyro', '{slope}'): (DEG / HOUR**2, 'deg/h^2'),
    ('gyro', '{integral}'): (DEG / HOUR, 'arcsec'),
    ('accel', '{rate}'): (1e-6 * G0, 'ug'),
    ('accel', '{rate}/sqrt(Hz)'): (1e-6 * G0, 'ug/sqrt(Hz)'),
    ('accel', '{slope}/sqrt(Hz)'): (1 / HOUR**1.5, 'm/s/h^1.5'),
    ('accel', '{slope}'): (1e-6 * G0 / HOUR, 'ug/h'),
    ('accel', '{integral}'): (1.0, 'm/s'),
}


def si(template: str, sensor: str) -> str:
    """
    Return the SI unit of a template for ``gyro`` or ``accel``.

    ``{rate}/sqrt(Hz)`` becomes ``rad/s/sqrt(Hz)``.

    """
    return template.format(**_SI[sensor]) if '{' in template else template


def field(template: str, sensor: str) -> tuple[float, str]:
    """Return (factor, unit): a value in SI divided by the factor is in the field's unit."""
    return _FIELD.get((sensor, template), (1.0, si(template, sensor)))


def shown(value: float | None, template: str, sensor: str) -> str:
    """
    Return a value as the field writes it: ``0.301 deg/sqrt(h)``.

    With three significant digits.

    """
    factor, unit = field(template, sensor)
    if value is None:
        return 'not observable'
    text = f'{value / factor:.3g}'
    return f'{text} {unit}' if unit != '1' else text


def duration(seconds: float) -> str:
    """Return a length of time as people say it."""
    if seconds < 120:
        return f'{seconds:.3g} s'
    return f'{seconds / 60:.3g} min' if seconds < 7200 else f'{seconds / 3600:.3g} h'


def times(n: int, what: str = 'time') -> str:
    """Return how many of something there are: 1 time, 2 times."""
    return f'{n} {what}{"" if n == 1 else "s"}'


def date(start: float) -> str:
    """Return date and time of a stamp, s since 1970; empty where it counts from elsewhere."""
    return datetime.fromtimestamp(start, timezone.utc).strftime('%Y-%m-%d %H:%M UTC') \
        if 1e8 < start < 1e11 else ''


def in_percent(share: float) -> str:
    """Return a share in percent for people, two digits; what is next to nothing is said so."""
    if 0 < share < 5e-4:
        return 'less than 0.1 %'
    return f'{100 * share:.0f} %' if share >= 0.095 else f'{100 * share:.2g} %'
