# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The blocks of a linear state space of each axis' noise, discrete at its rate, as JSON.

x_{k+1} = Phi x_k + w, w ~ N(0, Q); y_k = H x_k + v, v ~ N(0, R): y is the noise of the output.

Source: the effects themselves (``state_space``); flicker has no finite state space.

"""

from __future__ import annotations

import json
from typing import cast

import numpy as np

from ._numbers import Numbers
from ..core import units
from ..core.errors import UsageError
from ..loop.study import Study
from ..noise.kinds import Spectrum
from ..noise.problem import NoiseProblem

CONSUMER = ''
HOLDS = 'Phi, Q, H, R'
HOW = 'of each axis, discrete at its rate; from the effects themselves'
PLACES = ()
DESCRIPTION = 'state-space blocks Phi, Q, H, R of each axis, discrete at its rate, as JSON'


def text(study: Study, axes: str = 'worst', inflate: float = 1.0,
         horizon: float | None = None) -> str:
    """Return one entry an axis; ``inflate`` is of amplitudes, its square of Q and R."""
    if axes == 'mean':
        raise UsageError('--axes mean: kalman holds each axis for itself', 'leave it out')
    if horizon is not None:
        raise UsageError('--horizon: kalman holds the effects themselves', 'leave it out')
    numbers = Numbers(study, 'worst', inflate)
    said = numbers.about('x[k+1] = Phi x[k] + w, w ~ (0, Q); y[k] = H x[k] + v, v ~ (0, R)')
    return json.dumps({
        'about': said, 'axes': {axis: _axis(study, axis, inflate) for axis in study.targets},
    }, indent=2) + '\n'


def _axis(study: Study, axis: str, inflate: float) -> dict:
    """Return the blocks of one axis; what of the model has none is named."""
    state = study.states[axis]
    dt = cast(NoiseProblem, state.problem).evidence.dt
    unit = units.si('{rate}', axis.partition('_')[0])
    blocks, without, r = [], [], 0.0
    for e in state.model:
        made = e.state_space(dt) if isinstance(e, Spectrum) else None
        if e.name == 'white':
            r += e['N'] ** 2 / dt * inflate ** 2
        elif made is None:
            without.append(e.label)
        else:
            phi, q, h = (np.atleast_2d(x) for x in made)
            blocks.append({'effect': e.label, 'Phi': phi.tolist(),
                           'Q': (q * inflate ** 2).tolist(), 'H': h.tolist()})
    return {'dt': dt, 'unit_of_y': unit, 'R': [[r]], 'blocks': blocks, 'without': without}
