# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
PX4's EKF2_* parameters: sigmas of one step of its filter.

Source: PX4/PX4-Autopilot, src/modules/ekf2/EKF/covariance.cpp:116-162 at 765f2844e9,
Ekf::predictCovariance: gyro_noise^2 is the variance of a rate (dt^2 of it that of the step's
angle), gyro_bias_sig = dt gyro_bias_p_noise a step, the same of the accelerometer; a step is
EKF2_PREDICT_US (10 ms). So N^2 dt = (dt p)^2 gives p = N / sqrt(dt), and p = K / sqrt(dt). Ranges:
src/modules/ekf2/module.yaml:215-250 at f55e3b2db4. The file is QGroundControl's: vehicle,
component, name, value, type (9: a float), with tabs between.

"""

from __future__ import annotations

from ._numbers import commented, Numbers, steps
from ._values import number
from ..loop.study import Study

CONSUMER = 'PX4/PX4-Autopilot'
HOLDS = 'N / sqrt(10 ms), K / sqrt(10 ms)'
HOW = 'sigma of a step of its filter, within its ranges'
#: file, lines, commit
PLACES = (
    ('src/modules/ekf2/EKF/covariance.cpp', '116-162', '765f2844e9'),
    ('src/modules/ekf2/module.yaml', '10-20, 215-250', 'f55e3b2db4'),
)
DESCRIPTION = 'PX4 EKF2_GYR_NOISE ... as a QGroundControl .params file (N, K over sqrt of 10 ms)'
STEP_S = 0.01
# name, sensor, parameter, range that PX4 allows
PARAMETERS = (
    ('EKF2_ACC_NOISE', 'accel', 'N', 0.01, 1.0), ('EKF2_GYR_NOISE', 'gyro', 'N', 0.0001, 0.1),
    ('EKF2_ACC_B_NOISE', 'accel', 'K', 0.0, 0.01), ('EKF2_GYR_B_NOISE', 'gyro', 'K', 0.0, 0.01))


def text(study: Study, axes: str = 'worst', inflate: float = 1.0,
         horizon: float | None = None) -> str:
    """Return the parameters; what PX4 does not allow is put at the end of its range, and said."""
    numbers = Numbers(study, axes, inflate, horizon)
    said = numbers.about(f'PX4 EKF2: sigma of a step of {STEP_S:g} s (EKF2_PREDICT_US): N and K '
                         'over its root, SI')
    found = steps(numbers, PARAMETERS, STEP_S, 'PX4 allows', said)
    lines = (f'1\t1\t{name}\t{number(value)}\t9\n' for name, value in found)
    return commented(said) + ''.join(lines)
