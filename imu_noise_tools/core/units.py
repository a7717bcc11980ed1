# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
SI, and the units the field speaks.

A parameter's unit is a template: ``{rate}`` stands for rad/s or m/s^2, ``{slope}`` for its time
derivative, ``{integral}`` for its time integral.

"""

from __future__ import annotations

from datetime import datetime, timezone
import math

_SI = {
    'gyro': {'rate': 'rad/s', 'slope': 'rad/s^2', 'integral': 'rad'},
    'accel': {'rate': 'm/s^2', 'slope': 'm/s^3', 'integral': 'm/s'},
}
DEG = math.pi / 180
G0 = 9.80665
HOUR = 3600.0

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


def date(start: float) -> str:
    """Return date and time of a stamp, s since 1970; empty where it counts from elsewhere."""
    return datetime.fromtimestamp(start, timezone.utc).strftime('%Y-%m-%d %H:%M UTC') \
        if 1e8 < start < 1e11 else ''


def in_percent(share: float) -> str:
    """Return a share in percent for people, two digits; what is next to nothing is said so."""
    if 0 < share < 5e-4:
        return 'less than 0.1 %'
    return f'{100 * share:.0f} %' if share >= 0.095 else f'{100 * share:.2g} %'
