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

# importing the effects registers them
__all__ = [
    'Coupling',
    'Defect',
    'Inputs',
    'Line',
    'Mean',
    'Modulation',
    'NoiseEffect',
    'Parameter',
    'Response',
    'Spectrum',
    'effects',
]
