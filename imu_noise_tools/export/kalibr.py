# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Kalibr's imu.yaml: continuous-time densities N and random walks K.

Source: the wiki of kalibr, IMU-Noise-Model; ethz-asl/kalibr at 1f60227442,
aslam_offline_calibration/kalibr/python/kalibr_common/ConfigReader.py:464-492: each must be above
zero, and N is multiplied by sqrt(update_rate).

"""

from __future__ import annotations

from typing import Any

from ._numbers import commented, Numbers
from ._values import number
from ..loop.study import Study

CONSUMER = 'ethz-asl/kalibr'
HOLDS = 'N, K'
HOW = 'one a sensor, above zero; it takes N sqrt(f) itself'
#: file, lines, commit
PLACES = (
    ('aslam_offline_calibration/kalibr/python/kalibr_common/ConfigReader.py', '464-492',
     '1f60227442'),
)
CONVENTION = ('Kalibr IMU noise parameters, continuous time (square roots of two-sided '
              'densities), SI units')
DESCRIPTION = 'Kalibr imu.yaml: noise densities N and random walks K, continuous time'
KEYS = (
    ('accelerometer_noise_density', 'accel', 'N', 'm/s^2/sqrt(Hz)'),
    ('accelerometer_random_walk', 'accel', 'K', 'm/s^3/sqrt(Hz)'),
    ('gyroscope_noise_density', 'gyro', 'N', 'rad/s/sqrt(Hz)'),
    ('gyroscope_random_walk', 'gyro', 'K', 'rad/s^2/sqrt(Hz)'),
)


def text(
    study: Study, axes: str = 'worst', inflate: float = 1.0, horizon: float | None = None,
    **_: Any
) -> str:
    """Return imu.yaml; one value per sensor, by the rule ``axes``, times ``inflate``."""
    numbers = Numbers(study, axes, inflate, horizon)
    body = []
    for key, sensor, parameter, unit in KEYS:
        if sensor not in numbers.sensors:
            body.append(f'# {key}: the record has no {sensor}')
            continue
        body.append(f'{key}: {number(numbers.one(sensor, parameter))}   # {unit}')
    body += _stream(study)
    return commented(numbers.about(CONVENTION)) + '\n'.join(body) + '\n'


def _stream(study: Study) -> list[str]:
    """Return topic and rate, which are those of the gyroscope where the sensors have their own."""
    streams = study.source.get('streams') or {}
    first = streams.get('gyro', study.source)
    known = str(first.get('topic') or '').split(',')[0]
    topic = known or '/imu0'
    quoted = "'" + topic.replace("'", "''") + "'"
    rate = float(first.get('rate_hz', 0.0))
    out = [
        f'rostopic: {quoted}' + ('' if known else '   # not known here: put that of your bag'),
        f'update_rate: {rate:.6g}' if rate % 1 else f'update_rate: {rate:.1f}',
    ]
    if 'accel' in streams and 'gyro' in streams:
        accel = streams['accel']
        out.insert(0, f'# Topic and rate are the gyroscope\'s; the accelerometer is on '
                      f'{accel["topic"]} at {accel["rate_hz"]:.6g} Hz: unite them for Kalibr.')
    return out
