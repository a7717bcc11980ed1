# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
GTSAM's PreintegrationCombinedParams: continuous-time covariances N^2 and K^2, as JSON.

Source: borglab/gtsam, gtsam/navigation/PreintegrationParams.h at eadfbacd82
(accelerometerCovariance: continuous-time, of the accelerometer), PreintegratedRotation.h at
a90dbc7fc5 (gyroscopeCovariance), PreintegrationCombinedParams.h at 191db153dd
(biasAccCovariance, biasOmegaCovariance: continuous-time, of the random walks of the biases).

"""

from __future__ import annotations

import json

import numpy as np

from ._numbers import Numbers
from ..loop.study import Study

CONSUMER = 'borglab/gtsam'
HOLDS = 'N^2, K^2'
HOW = '3x3, continuous time'
#: file, lines, commit
PLACES = (
    ('gtsam/navigation/PreintegrationParams.h', '27-29', 'eadfbacd82'),
    ('gtsam/navigation/PreintegratedRotation.h', '60', 'a90dbc7fc5'),
    ('gtsam/navigation/PreintegrationCombinedParams.h', '37-39', '191db153dd'),
)
DESCRIPTION = 'GTSAM PreintegrationCombinedParams: covariances N^2, K^2 per second, as JSON'
KEYS = (('accelerometerCovariance', 'accel', 'N'), ('gyroscopeCovariance', 'gyro', 'N'),
        ('biasAccCovariance', 'accel', 'K'), ('biasOmegaCovariance', 'gyro', 'K'))


def text(study: Study, axes: str = 'worst', inflate: float = 1.0,
         horizon: float | None = None) -> str:
    """Return 3x3 matrices by the names of the members."""
    numbers = Numbers(study, axes, inflate, horizon)
    said = numbers.about('GTSAM: continuous-time covariances (N^2, K^2), SI; set p.NAME = NAME. '
                         'integrationCovariance is of the integration, not of the sensor')
    out: dict = {'about': said}
    for key, sensor, parameter in KEYS:
        variances = np.square(numbers.three(sensor, parameter))
        out[key] = [[float(x) for x in row] for row in np.diag(variances)]
    return json.dumps(out, indent=2) + '\n'
