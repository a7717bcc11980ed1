# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
ArduPilot's EK3_* parameters: sigmas of one step of its filter.

Source: ArduPilot/ardupilot, libraries/AP_NavEKF3/AP_NavEKF3_core.cpp, CovariancePrediction (lines
1057-1065 and 1150-1154 at e37bf9ad53): dAngBiasVar = (dt^2 _gyroBiasProcessNoise)^2 of an angle's
bias a step (so that of the rate is (dt p)^2), and (dt _gyrNoise)^2 of the angle; a step is
EKF_TARGET_DT (AP_NavEKF3_core.h:60, 12 ms). So p = N / sqrt(dt) and K / sqrt(dt). Ranges:
AP_NavEKF3.cpp, var_info (342-376 at d5670ace3b; ABIAS_P_NSE goes to 0.02 since 83c544f792). The
file is a list of NAME,VALUE, as ground stations and pymavlink's mavparm.py read it.

"""

from __future__ import annotations

from ._numbers import commented, Numbers, steps
from ._values import number
from ..loop.study import Study

CONSUMER = 'ArduPilot/ardupilot'
HOLDS = 'N / sqrt(12 ms), K / sqrt(12 ms)'
HOW = 'sigma of a step of its filter, within its ranges'
#: file, lines, commit
PLACES = (
    ('libraries/AP_NavEKF3/AP_NavEKF3_core.cpp', '1057-1065, 1150-1154', 'e37bf9ad53'),
    ('libraries/AP_NavEKF3/AP_NavEKF3_core.h', '60', 'e37bf9ad53'),
    ('libraries/AP_NavEKF3/AP_NavEKF3.cpp', '342-376', 'd5670ace3b'),
)
DESCRIPTION = 'ArduPilot EK3_GYRO_P_NSE ... as a .param file (N, K over sqrt of 12 ms)'
STEP_S = 0.012
# name, sensor, parameter, range that ArduPilot documents
PARAMETERS = (
    ('EK3_ACC_P_NSE', 'accel', 'N', 0.01, 1.0), ('EK3_GYRO_P_NSE', 'gyro', 'N', 0.0001, 0.1),
    ('EK3_ABIAS_P_NSE', 'accel', 'K', 0.00001, 0.02),
    ('EK3_GBIAS_P_NSE', 'gyro', 'K', 0.00001, 0.001))


def text(study: Study, axes: str = 'worst', inflate: float = 1.0,
         horizon: float | None = None) -> str:
    """Return the parameters; what is out of range is put at its end, and said."""
    numbers = Numbers(study, axes, inflate, horizon)
    said = numbers.about(f'ArduPilot EKF3: sigma of a step of {STEP_S:g} s: N and K over its '
                         'root, SI')
    found = steps(numbers, PARAMETERS, STEP_S, 'its range is', said)
    lines = (f'{name},{number(value)}\n' for name, value in found)
    return commented(said) + ''.join(lines)
