# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Noise of one axis of a static record.

Effects, evidence, fit, and the problem that the loop drives.

"""

from . import effects
from .kinds import (
    Coupling,
    Defect,
    Inputs,
    Line,
    Mean,
    Modulation,
    NoiseEffect,
    Parameter,
    Response,
    Spectrum,
)
from .problem import NoiseProblem
from .stated import arrays_of, problems

TITLE = 'Noise of an IMU at rest'
NUMBERS = 'kalibr'        # the format whose numbers open the page about a study
UNDISTURBED = ('Nothing stands out of its noise, such as a knock on several axes at once. What is '
               'fainter, or goes on for long, the diagnosis of each axis names.')
NEXT = (('imu_noise export {study} --format kalibr -o imu.yaml',
         'writes the numbers for an estimator'),)
DECIDES = ()

__all__ = [
    'Coupling',
    'DECIDES',
    'Defect',
    'Inputs',
    'Line',
    'Mean',
    'Modulation',
    'NEXT',
    'NUMBERS',
    'NoiseEffect',
    'NoiseProblem',
    'Parameter',
    'Response',
    'Spectrum',
    'TITLE',
    'UNDISTURBED',
    'arrays_of',
    'effects',
    'problems',
]
