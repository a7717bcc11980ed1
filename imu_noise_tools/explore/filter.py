# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Effects of a filter put in by hand: the filter is run again, with what is said of it."""

from __future__ import annotations

from typing import cast

from .panels import within
from ..core.errors import InputError
from ..filter import FilterProblem
from ..filter.statespace import FilterEffect, jumps
from ..loop.effect import Effect, Parameter, registry
from ..loop.prediction import State


def by_hand(state: State) -> list[str]:
    """Return the effects beside which a model still has a steady state: a bank takes seconds."""
    if jumps(state.model):
        return []
    known = cast('dict[str, type[FilterEffect]]', registry('filter'))
    return [name for name, cls in known.items()
            if not cls.jumps and not cls.variance and (name not in state.model or cls.several)]


def begin(state: State, name: str) -> Effect:
    """Return an effect as it would be looked for first; raise InputError where it cannot be."""
    cls = cast('type[FilterEffect]', registry('filter')[name])
    found = cls.guesses(cast(FilterProblem, state.problem).look)
    if not found:
        raise InputError(f'{name} does not apply to this record', cls.hint)
    return found[0]


def span(state: State, effect: Effect, parameter: Parameter) -> tuple[float, float]:
    """Return between which values a record can show a parameter."""
    problem = cast(FilterProblem, state.problem)
    return within(parameter, problem.dt, len(problem.z) * problem.dt)
