# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
OpenVINS's kalibr_imu_chain.yaml: continuous-time N and K, read by OpenCV's FileStorage.

Source: rpng/open_vins at 69488123ed: ov_msckf/src/core/VioManagerOptions.h:159-162 reads the four
densities of ``imu0``, Propagator.cpp:225-228 divides N^2 and multiplies K^2 by dt;
VioManagerOptions.h:307-339 reads Tw, Ta, R_IMUtoACC, R_IMUtoGYRO, Tg and, in the model ``kalibr``,
keeps the lower triangle of the inverses of Tw and Ta.

"""

from __future__ import annotations

import numpy as np

from ._calibration import Inverse, lower
from ._numbers import commented, Numbers, rows_of
from ._values import number
from ..loop.study import Study

CONSUMER = 'rpng/open_vins'
HOLDS = 'N, K'
HOW = 'it divides N^2 and multiplies K^2 by dt itself; Tw, Ta from a calibration'
#: file, lines, commit
PLACES = (
    ('ov_msckf/src/core/VioManagerOptions.h', '157-163, 305-340', '69488123ed'),
    ('ov_msckf/src/state/Propagator.cpp', '225-228', '69488123ed'),
)
DESCRIPTION = 'OpenVINS kalibr_imu_chain.yaml: N, K per second; with a calibration Tw, Ta'
CALIBRATION = True


def text(study: Study, axes: str = 'worst', inflate: float = 1.0, horizon: float | None = None,
         calibration: Inverse | None = None) -> str:
    """Return the file."""
    numbers = Numbers(study, axes, inflate, horizon)
    said = numbers.about('OpenVINS: continuous-time densities (two-sided), SI; one a sensor')
    tw, turned = np.eye(3), np.eye(3)
    ta = np.eye(3)
    if calibration is not None:
        tw, turned = lower(calibration.matrix('gyro'))
        ta = lower(calibration.matrix('accel'))[0]
        said += [calibration.said, 'OpenVINS estimates the biases itself; they are not in it']
    out = '%YAML:1.0\n\n' + commented(said) + '\nimu0:\n  T_i_b:\n' + rows_of(np.eye(4), ' ' * 4)
    for key, sensor, parameter in (
            ('accelerometer_noise_density', 'accel', 'N'),
            ('accelerometer_random_walk', 'accel', 'K'),
            ('gyroscope_noise_density', 'gyro', 'N'), ('gyroscope_random_walk', 'gyro', 'K')):
        out += f'  {key}: {number(numbers.one(sensor, parameter))}\n'
    out += (f'  rostopic: {numbers.topic()}\n  time_offset: 0.0\n'
            f'  update_rate: {number(numbers.rate("gyro"))}\n  model: "kalibr"\n')
    for key, matrix in (('Tw', tw), ('R_IMUtoGYRO', turned), ('Ta', ta),
                        ('R_IMUtoACC', np.eye(3)), ('Tg', np.zeros((3, 3)))):
        out += f'  {key}:\n{rows_of(matrix, " " * 4)}'
    return out
