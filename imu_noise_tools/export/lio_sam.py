# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
LIO-SAM's params.yaml: continuous-time N and K, which it hands to GTSAM.

Source: TixiaoShan/LIO-SAM at 0be1fbe627: include/utility.h:203-206 reads them,
src/imuPreintegration.cpp:215-216 squares N, line 225 with 375 multiplies K by sqrt(dt).

"""

from __future__ import annotations

from ._numbers import commented, Numbers
from ._values import number
from ..core.units import G0
from ..loop.study import Study

CONSUMER = 'TixiaoShan/LIO-SAM'
HOLDS = 'N, K'
HOW = 'it squares N for GTSAM and multiplies K by sqrt(dt)'
#: file, lines, commit
PLACES = (
    ('include/utility.h', '203-206', '0be1fbe627'),
    ('src/imuPreintegration.cpp', '215-216, 225, 375', '0be1fbe627'),
)
DESCRIPTION = 'LIO-SAM params.yaml: imuAccNoise, imuGyrNoise, imuAccBiasN, imuGyrBiasN (N, K)'


def text(study: Study, axes: str = 'worst', inflate: float = 1.0,
         horizon: float | None = None) -> str:
    """Return the lines below ``/**: ros__parameters:``, as the ROS 2 branch reads them."""
    numbers = Numbers(study, axes, inflate, horizon)
    said = numbers.about('LIO-SAM: continuous-time densities (two-sided), SI; GTSAM squares them. '
                         'In ROS 1 the same four stand below lio_sam:')
    out = commented(said) + '/**:\n  ros__parameters:\n'
    for key, sensor, parameter in (('imuAccNoise', 'accel', 'N'), ('imuGyrNoise', 'gyro', 'N'),
                                   ('imuAccBiasN', 'accel', 'K'), ('imuGyrBiasN', 'gyro', 'K')):
        out += f'    {key}: {number(numbers.one(sensor, parameter))}\n'
    return out + f'    imuGravity: {number(G0)}\n'
