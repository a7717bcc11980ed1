# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
VINS-Fusion's (and VINS-Mono's) IMU lines: sigma of a sample, and K as its code takes it.

Source: HKUST-Aerial-Robotics/VINS-Fusion at be55a937a5:
vins_estimator/src/estimator/parameters.cpp:98-102 reads the keys by OpenCV's FileStorage (a number
without a point is an integer there); vins_estimator/src/factor/integration_base.h:31-36 squares
them, and lines 118-129 multiply by dt^2 a step: acc_n and gyr_n are sigmas of one sample, N
sqrt(f), and acc_w and gyr_w enter as dt acc_w a step, so that K^2 dt = (dt acc_w)^2: K sqrt(f).

"""

from __future__ import annotations

from ._numbers import commented, Numbers
from ._values import number
from ..core.units import G0
from ..loop.study import Study

CONSUMER = 'HKUST-Aerial-Robotics/VINS-Fusion'
HOLDS = 'N sqrt(f), K sqrt(f)'
HOW = 'sigma of a sample; the bias by dt a step'
#: file, lines, commit
PLACES = (
    ('vins_estimator/src/estimator/parameters.cpp', '98-102', 'be55a937a5'),
    ('vins_estimator/src/factor/integration_base.h', '31-36, 117-129', 'be55a937a5'),
)
DESCRIPTION = 'VINS-Fusion, VINS-Mono: acc_n, gyr_n per sample (N sqrt f), acc_w, gyr_w (K sqrt f)'


def text(study: Study, axes: str = 'worst', inflate: float = 1.0,
         horizon: float | None = None) -> str:
    """Return the lines, to be put into a configuration, with the header it needs."""
    numbers = Numbers(study, axes, inflate, horizon)
    said = numbers.about('VINS-Fusion: discrete time at the rate of the sensor, SI')
    said += ['acc_n, gyr_n: sigma of a sample, N sqrt(f); acc_w, gyr_w: K sqrt(f) by its code '
             '(integration_base.h: V(9, 12) = dt). Many configurations hold K itself there',
             'Its midpoint rule takes the two samples of a step for independent, which halves the '
             'variance; many multiply by ten for vibration and what the model leaves out: '
             '--inflate 10']
    out = '%YAML:1.0\n\n' + commented(said)
    for key, sensor, parameter in (('acc_n', 'accel', 'N'), ('gyr_n', 'gyro', 'N'),
                                   ('acc_w', 'accel', 'K'), ('gyr_w', 'gyro', 'K')):
        value = numbers.one(sensor, parameter) * numbers.rate(sensor) ** 0.5
        out += f'{key}: {number(value)}\n'
    return out + f'g_norm: {number(G0)}\n'
