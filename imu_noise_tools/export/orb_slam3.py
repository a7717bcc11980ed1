# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
ORB-SLAM3's IMU lines: continuous-time N and K, read by OpenCV's FileStorage.

Source: UZ-SLAMLab/ORB_SLAM3 at 0df83dde1c (release 1.0): src/Settings.cc, readIMU (lines 414-420)
and readParameter<float> (36-57: a real, with a point or an exponent); src/Tracking.cc,
newParameterLoader (608-614): Calib(Tbc, Ng*sf, Na*sf, Ngw/sf, Naw/sf) with sf =
sqrt(IMU.Frequency), so N and K go in as they are.

"""

from __future__ import annotations

from ._numbers import commented, Numbers
from ._values import number
from ..loop.study import Study

CONSUMER = 'UZ-SLAMLab/ORB_SLAM3'
HOLDS = 'N, K'
HOW = 'it takes N sqrt(f) and K / sqrt(f) itself'
#: file, lines, commit
PLACES = (
    ('src/Settings.cc', '36-57, 414-420', '0df83dde1c'),
    ('src/Tracking.cc', '608-614', '0df83dde1c'),
)
DESCRIPTION = 'ORB-SLAM3: IMU.NoiseGyro, NoiseAcc, GyroWalk, AccWalk, Frequency (N, K per second)'


def text(study: Study, axes: str = 'worst', inflate: float = 1.0,
         horizon: float | None = None) -> str:
    """Return the lines, to be put into a configuration, with the header it needs."""
    numbers = Numbers(study, axes, inflate, horizon)
    said = numbers.about('ORB-SLAM3: continuous-time densities (two-sided), SI; it multiplies N '
                         'and divides K by sqrt(IMU.Frequency) itself')
    out = '%YAML:1.0\n\n' + commented(said)
    for key, sensor, parameter in (
            ('NoiseGyro', 'gyro', 'N'), ('NoiseAcc', 'accel', 'N'), ('GyroWalk', 'gyro', 'K'),
            ('AccWalk', 'accel', 'K')):
        out += f'IMU.{key}: {number(numbers.one(sensor, parameter))}\n'
    return out + f'IMU.Frequency: {number(numbers.rate("gyro"))}\n'
