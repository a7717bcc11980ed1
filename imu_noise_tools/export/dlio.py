# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
DLIO's intrinsics: matrix and bias of the accelerometer, bias of the gyroscope; no noise.

Source: vectr-ucla/direct_lidar_inertial_odometry at fc8d183f18: cfg/dlio.yaml:25-32 names them,
src/dlio/odom.cc:257-278 reads them, and line 987 corrects: sm raw - bias, so sm = S^-1 and bias =
S^-1 b; the gyroscope's rates are less its bias alone (line 988).

"""

from __future__ import annotations

import numpy as np

from ._calibration import Inverse
from ._numbers import commented, numbers_of
from ..core.errors import UsageError
from ..loop.study import Study

CONSUMER = 'vectr-ucla/direct_lidar_inertial_odometry'
HOLDS = 'none'
HOW = 'sm raw - bias, from a calibration'
#: file, lines, commit
PLACES = (
    ('cfg/dlio.yaml', '24-32', 'fc8d183f18'),
    ('src/dlio/odom.cc', '257-278, 987-988', 'fc8d183f18'),
)
DESCRIPTION = 'DLIO imu/intrinsics: accel sm and bias, gyro bias; needs --calibration'
CALIBRATION = True


def text(study: Study, axes: str = 'worst', inflate: float = 1.0, horizon: float | None = None,
         calibration: Inverse | None = None) -> str:
    """Return the lines below ``dlio: imu:``."""
    if calibration is None:
        raise UsageError('dlio reads no densities, only scale factors and biases',
                         'give --calibration DIR')
    inverse = np.linalg.inv(calibration.S.get('accel', np.eye(3)))
    said = [f'DLIO: sm raw - bias. Scale, cross-axis and bias of '
            f'{" and ".join(sorted(calibration.S))} are from {calibration.path}']
    return commented(said) + f"""dlio:
  imu:
    calibration: false
    intrinsics:
      accel:
        bias: {numbers_of(inverse @ calibration.offset('accel'))}
        sm: {numbers_of(inverse)}
      gyro:
        bias: {numbers_of(calibration.offset('gyro'))}
"""
