# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Effects of a calibration put in by hand: what they would make of each pose."""

from __future__ import annotations

from typing import cast

import numpy as np

from ..calibration import CalibrationProblem, Regressor
from ..core.errors import InputError
from ..loop.effect import Effect, Parameter, registry
from ..loop.prediction import State

FAR, BEGIN = 30.0, 3.0      # standard errors of a pose, rms: a slider's ends, and where it begins


def by_hand(state: State) -> list[str]:
    """Return the effects that add to the outputs; those that scatter them have no course."""
    return [name for name, cls in registry('calibration').items()
            if issubclass(cls, Regressor) and name not in state.model]


def begin(state: State, name: str) -> Effect:
    """Return one whose first coefficient is seen; raise InputError where these poses cannot."""
    problem = cast(CalibrationProblem, state.problem)
    why = {n: (said, needs) for n, said, needs in problem.blind(state.fit)}.get(name)
    cls = registry('calibration')[name]
    if why or not _sizes(state, cls()).any():
        raise InputError(f'{name}: {why[0] if why else "these poses do not feel it"}',
                         why and why[1] or 'hold others')
    sizes = _sizes(state, cls())
    first = int(np.argmax(sizes > 0))
    return cls({p.name: float(f'{BEGIN / sizes[k]:.3g}') if k == first else 0.0
                for k, p in enumerate(cls.parameters)})


def _sizes(state: State, effect: Effect) -> np.ndarray:
    """Return the standard errors of a pose that one unit of each coefficient makes, (p,), rms."""
    columns = cast(CalibrationProblem, state.problem).columns(state.fit, cast(Regressor, effect))
    return np.sqrt(np.mean(columns ** 2, axis=0))


def span(state: State, effect: Effect, parameter: Parameter) -> tuple[float, float]:
    """Return between which values a coefficient makes no more of the poses than can be drawn."""
    size = _sizes(state, effect)[[p.name for p in effect.parameters].index(parameter.name)]
    far = FAR / size if size > 0 else 1.0
    return max(-far, parameter.lower), min(far, parameter.upper)
