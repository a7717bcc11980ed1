# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
FAST-LIO's mapping parameters: variances a step at the rate of the IMU.

Source: hku-mars/FAST_LIO at 7cc4175de6: src/laserMapping.cpp:777-780 reads them,
src/IMU_Processing.hpp:280-283 puts them on the diagonal of Q,
include/IKFoM_toolkit/esekfom/esekfom.hpp:381 adds (dt F) Q (dt F)': a step of dt adds dt^2 Q, so
that N^2 dt = dt^2 Q gives N^2 f, and K^2 f by the same code.

"""

from __future__ import annotations

from ._numbers import commented, Numbers
from ._values import number
from ..loop.study import Study

CONSUMER = 'hku-mars/FAST_LIO'
HOLDS = 'N^2 f, K^2 f'
HOW = 'variances; its filter adds dt^2 Q a step'
#: file, lines, commit
PLACES = (
    ('src/laserMapping.cpp', '777-780', '7cc4175de6'),
    ('src/IMU_Processing.hpp', '280-283', '7cc4175de6'),
    ('include/IKFoM_toolkit/esekfom/esekfom.hpp', '381', '7cc4175de6'),
)
DESCRIPTION = 'FAST-LIO: acc_cov, gyr_cov (N^2 f), b_acc_cov, b_gyr_cov (K^2 f), variances'


def text(study: Study, axes: str = 'worst', inflate: float = 1.0,
         horizon: float | None = None) -> str:
    """Return the lines below ``mapping:``; ``inflate`` is of N and K, its square of these."""
    numbers = Numbers(study, axes, inflate, horizon)
    said = numbers.about('FAST-LIO: variances, SI; its filter adds dt^2 times them a step')
    said += ['acc_cov, gyr_cov: N^2 f; b_acc_cov, b_gyr_cov: K^2 f by the same code (many write '
             'K^2). Its defaults (0.1, 0.0001) are far larger: they stand for vibration and for '
             'errors of the model too']
    out = commented(said) + 'mapping:\n'
    for key, sensor, parameter in (('acc_cov', 'accel', 'N'), ('gyr_cov', 'gyro', 'N'),
                                   ('b_acc_cov', 'accel', 'K'), ('b_gyr_cov', 'gyro', 'K')):
        value = numbers.one(sensor, parameter) ** 2 * numbers.rate(sensor)
        out += f'    {key}: {number(value)}\n'
    return out
