# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Calibration: scale, cross-axis sensitivity and bias from poses, and what else is in the outputs.

:func:`positions` and :func:`turns` find the poses of a record, :func:`calibrate` solves them or
refuses, and :class:`Session` does both while a person holds one face up after the other.

"""

from .axes import refuse_crossed_axes
from .between import gathered, together, Turns
from .correction import Correction, from_dict, is_heated
from .effects import Regressor, Scatter
from .gravity import EARTH_RATE, gravity, normal_gravity
from .poses import DIRECTIONS, FACES, joined, nearest_face, Poses
from .positions import coarse, held, positions, rests, STILL_S, too_short
from .problem import CalibrationProblem
from .session import applied, Captured, HOLD_S, Session
from .solution import (
    as_dict, calibrate, calibrate_turns, Calibration, completed, of_study, offset_of, stated)
from .solve import base_model, fit, ols
from .turn_problem import arrays_of, problems, TurnsProblem
from .turns import REFERENCE, refuse_missing_axes, turns

TITLE = 'Calibration of an IMU'
NUMBERS = ''        # the format whose numbers open the page about a study
UNDISTURBED = 'Nothing stands out of its noise.'
NEXT = (('imu_noise apply BAG -o BAG2 --calibration {study}', 'corrects a recording'),)
DECIDES = (('imu_noise calibrate BAG MORE -o {study} --force',
            'decides, with poses in MORE that the advice asks for'),)

__all__ = [
    'applied', 'arrays_of', 'as_dict', 'base_model', 'calibrate', 'calibrate_turns',
    'Calibration', 'CalibrationProblem', 'Captured', 'coarse', 'completed', 'Correction',
    'DECIDES', 'DIRECTIONS', 'EARTH_RATE', 'FACES', 'fit', 'from_dict', 'gathered', 'gravity',
    'held', 'HOLD_S', 'is_heated', 'joined', 'nearest_face', 'NEXT', 'normal_gravity', 'of_study',
    'offset_of', 'ols', 'Poses', 'positions', 'problems', 'REFERENCE', 'refuse_crossed_axes',
    'refuse_missing_axes', 'Regressor', 'rests', 'Scatter', 'Session', 'stated', 'STILL_S',
    'TITLE', 'together', 'too_short', 'Turns', 'turns', 'TurnsProblem', 'UNDISTURBED']
