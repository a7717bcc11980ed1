# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Calibration: scale, cross-axis sensitivity and bias from poses, and what else is in the outputs.

:func:`positions` and :func:`turns` find the poses of a record, :func:`calibrate` solves them or
refuses, and :class:`Session` does both while a person holds one face up after the other.

"""

from .correction import Correction, from_dict
from .effects import Regressor, Scatter
from .gravity import EARTH_RATE, gravity, normal_gravity
from .poses import DIRECTIONS, FACES, joined, nearest_face, Poses
from .positions import positions, STILL_S
from .problem import arrays_of, CalibrationProblem, problems
from .session import applied, Captured, Session
from .solution import as_dict, calibrate, Calibration, of_study, stated
from .solve import base_model, fit, ols
from .turns import refuse_missing_axes, turns

TITLE = 'Calibration of an IMU'
NUMBERS = ''        # the format whose numbers open the page about a study
NEXT = (('imu_noise apply BAG -o BAG2 --calibration {study}', 'corrects a recording'),)

__all__ = [
    'applied', 'arrays_of', 'as_dict', 'base_model', 'calibrate', 'Calibration',
    'CalibrationProblem', 'Captured', 'Correction', 'DIRECTIONS', 'EARTH_RATE', 'FACES', 'fit',
    'from_dict', 'gravity', 'joined', 'nearest_face', 'NEXT', 'normal_gravity', 'of_study',
    'ols', 'Poses', 'positions', 'problems', 'refuse_missing_axes', 'Regressor', 'Scatter',
    'Session', 'stated', 'STILL_S', 'TITLE', 'turns']
