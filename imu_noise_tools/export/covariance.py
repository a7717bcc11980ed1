# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The covariances of a sensor_msgs/Imu: variance of one sample, nine numbers a sensor.

Source: ros2/common_interfaces, sensor_msgs/msg/Imu.msg:5-13, 21, 24 at c0c0bc57f9: row-major
about x, y, z; all zeros: unknown; first element -1: no estimate of that quantity.
robot_localization takes a measurement's covariance from the message (cra-ros-pkg at 1cb9533793,
src/ros_filter.cpp:588-606, 615, 2670), and
gz-sensors fills it with the square of a sample's sigma (src/ImuSensor.cc:272, at 9ba02f2410).

"""

from __future__ import annotations

import numpy as np

from ._numbers import commented, Numbers, numbers_of
from ..loop.study import Study

CONSUMER = 'ros2/common_interfaces'
HOLDS = 'N^2 f'
HOW = 'row-major, -1 first where absent; no place for K'
#: file, lines, commit
PLACES = (
    ('sensor_msgs/msg/Imu.msg', '5-13, 21, 24', 'c0c0bc57f9'),
)
DESCRIPTION = 'sensor_msgs/Imu covariances for drivers, robot_localization, imu_tools: N^2 f'


def text(study: Study, axes: str = 'worst', inflate: float = 1.0,
         horizon: float | None = None) -> str:
    """Return YAML with both covariances; ``inflate`` is of sigma, its square of these."""
    numbers = Numbers(study, axes, inflate, horizon)
    said = numbers.about('sensor_msgs/Imu: variance of a sample, N^2 f, on the diagonal '
                         '(row-major, SI). K has no place there: what integrates must model '
                         'the bias')
    out = commented(said)
    for key, sensor in (('angular_velocity_covariance', 'gyro'),
                        ('linear_acceleration_covariance', 'accel')):
        if sensor not in numbers.sensors:
            out += f'{key}: {numbers_of([-1.0] + [0.0] * 8)}   # not measured\n'
            continue
        variances = np.square(numbers.three(sensor, 'N')) * numbers.rate(sensor)
        out += f'{key}: {numbers_of(np.diag(variances))}\n'
    return out
