# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Basalt's calibration.json: continuous-time N and K for each axis, and its bias-and-scale models.

Source: VladyslavUsenko/basalt-headers at a585db348a:
include/basalt/serialization/headers_serialization.h:244-256 names the members (cereal's JSON has
them below ``value0``); include/basalt/calibration/calibration.hpp:134-160 multiplies the noise by
sqrt(imu_update_rate); include/basalt/calibration/calib_bias.hpp:91-112: raw + scale raw - bias,
scale of the accelerometer lower triangular (9 numbers), that of the gyroscope full (12).

"""

from __future__ import annotations

import json

import numpy as np

from ._calibration import Inverse
from ._numbers import Numbers
from ..loop.study import Study

CONSUMER = 'VladyslavUsenko/basalt-headers'
HOLDS = 'N, K'
HOW = 'x, y, z; it takes N sqrt(f) itself; bias and scale from a calibration'
#: file, lines, commit
PLACES = (
    ('include/basalt/serialization/headers_serialization.h', '243-256', 'a585db348a'),
    ('include/basalt/calibration/calibration.hpp', '134-160', 'a585db348a'),
    ('include/basalt/calibration/calib_bias.hpp', '91-112, 179-197', 'a585db348a'),
)
DESCRIPTION = 'Basalt calibration.json: N, K for x, y, z; with a calibration bias and scale'
CALIBRATION = True


def text(study: Study, axes: str = 'worst', inflate: float = 1.0, horizon: float | None = None,
         calibration: Inverse | None = None) -> str:
    """Return the IMU's part of calibration.json; ``about`` holds what a comment would."""
    numbers = Numbers(study, axes, inflate, horizon)
    said = numbers.about('Basalt: continuous-time densities (two-sided) for x, y, z, SI; merge '
                         'value0 into a calibration.json that has the cameras')
    value = {
        'imu_update_rate': numbers.rate('gyro'),
        'accel_noise_std': numbers.three('accel', 'N'),
        'gyro_noise_std': numbers.three('gyro', 'N'),
        'accel_bias_std': numbers.three('accel', 'K'),
        'gyro_bias_std': numbers.three('gyro', 'K'),
        'calib_accel_bias': [0.0] * 9,
        'calib_gyro_bias': [0.0] * 12,
    }
    if calibration is not None:
        said.append(calibration.said)
        accel, gyro = (np.linalg.inv(calibration.matrix(s)) for s in ('accel', 'gyro'))
        more = accel - np.eye(3)
        value['calib_accel_bias'] = [
            *(accel @ calibration.offset('accel')), *more[:, 0], more[1, 1], more[2, 1],
            more[2, 2]]
        value['calib_gyro_bias'] = [
            *(gyro @ calibration.offset('gyro')), *(gyro - np.eye(3)).T.ravel()]
    plain = {k: v if isinstance(v, float) else [float(x) for x in v]     # type: ignore
             for k, v in value.items()}
    return json.dumps({'about': said, 'value0': plain}, indent=2) + '\n'
