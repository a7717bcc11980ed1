# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What a domain lets the page do with what can be looked at of a target.

The panels are those of :mod:`imu_noise_tools.plots`. The module of a domain's name beside this one
offers ``by_hand(state)``, the effects that can be put into the model by hand. Where there are any,
``begin(state, name)`` gives one with values to begin with, and ``span(state, effect, parameter)``
between which values its slider goes.

"""

from __future__ import annotations

from dataclasses import replace

from ..loop.domains import part
from ..loop.effect import Effect, Model, Parameter, unfitted
from ..loop.prediction import State
from ..plots.panel import Panel
from ..report import words


def panel_of(domain: str, state: State, name: str) -> Panel:
    """Return one panel of a target; raise KeyError where there is none of that name."""
    return part('plots', domain).panels(state)[name]()


def names_of(domain: str, state: State) -> dict[str, str]:
    """Return the panels of a target: titles by name."""
    return {name: words.title_of(name) for name in part('plots', domain).panels(state)}


def names_by_hand(domain: str, state: State) -> list[str]:
    """Return the effects that can be put into a model by hand."""
    return part('explore', domain).by_hand(state)


def begin_by_hand(domain: str, state: State, name: str) -> Effect:
    """Return one of them with values to begin with; raise InputError where it does not apply."""
    return part('explore', domain).begin(state, name)


def span_of(domain: str, state: State, effect: Effect, parameter: Parameter,
            ) -> tuple[float, float]:
    """
    Return between which values a parameter of an effect put in by hand can be set.

    A size within three decades of where it began.

    """
    low, high = part('explore', domain).span(state, effect, parameter)
    size = abs(effect[parameter.name])
    if (parameter.amplitude or parameter.linear) and size:
        low = max(low, size / 1e3 if parameter.log else -10 * size)
        high = min(high, size * 1e3 if parameter.log else 10 * size)
    return low, high


def within(parameter: Parameter, dt: float, duration: float) -> tuple[float, float]:
    """Return between which values a record of a duration, sampled at dt, can show a parameter."""
    p = parameter
    # a moment of a record may be its first
    shortest = 2 * dt if p.log else p.lower
    low, high = {'s': (shortest, duration), 'Hz': (1 / duration, 0.5 / dt)}.get(
        p.unit, (p.lower, p.upper))
    return max(low, p.lower), min(high, p.upper)


def stated(state: State, model: Model) -> State:
    """Return a target with another model fitted; its error is not worked out."""
    return replace(state, fit=state.problem.point(unfitted(model)))


def with_hand(state: State, effect: Effect) -> State:
    """Return a target with an effect of stated size in its model, nothing fitted again."""
    return replace(state, fit=replace(state.fit, model=state.fit.model.plus(effect)))
