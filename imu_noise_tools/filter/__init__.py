# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Denoising a rate, live or recorded.

Motion that drives it, noise that adds to it, a Kalman filter between.

Units are SI (rad/s); one axis at a time, since the three see each other only through the motion.

"""

from .motion import ConstantRate
from .oscillation import Oscillation, oscillator
from .output_noise import noise_blocks
from .problem import arrays_of, FilterProblem, problem_of, problems
from .statespace import Block, FilterEffect, Look, Motion, nothing, OutputNoise

TITLE = 'Innovations of a filter'
NUMBERS = ''        # the format whose numbers open the page about a study
UNDISTURBED = 'Nothing stands out of its noise.'
NEXT = ()
DECIDES = ()

__all__ = ['arrays_of', 'Block', 'ConstantRate', 'DECIDES', 'FilterEffect', 'FilterProblem',
           'Look', 'Motion', 'NEXT', 'noise_blocks', 'nothing', 'Oscillation', 'oscillator',
           'OutputNoise', 'problem_of', 'problems', 'TITLE', 'UNDISTURBED']
