# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Effects of the noise of an axis put in by hand: those that a curve shows."""

from __future__ import annotations

from typing import cast

import numpy as np

from .panels import within
from ..core.errors import InputError
from ..loop.effect import Effect, Parameter, registry
from ..loop.prediction import State
from ..noise.curve import effect_avar
from ..noise.kinds import Defect, Line, Mean, NoiseEffect, Response, Spectrum
from ..plots.curves import curves, evidence_of

DRAWN = (Spectrum, Mean, Line, Response)        # kinds that a curve shows


def by_hand(state: State) -> list[str]:
    """Return the effects that a curve shows."""
    if evidence_of(state).curve.deviation not in ('oadev', 'adev'):
        return []
    return [name for name, cls in registry('noise').items()
            if issubclass(cls, DRAWN) and not issubclass(cls, Defect)
            and (name not in state.model or cls.several)]


def begin(state: State, name: str) -> Effect:
    """
    Return an effect with values to begin with.

    It stands in the middle of what the record can show, its top at the height of the model.
    Raise InputError where the record has not what it needs.

    """
    cls = cast('type[NoiseEffect]', registry('noise')[name])
    if not issubclass(cls, Line) and not cls().starts(evidence_of(state)):
        raise InputError(f'{name} does not apply to this record', cls.needs)
    return _as_high_as_the_model(state, _in_the_middle(state, cls))


def _in_the_middle(state: State, cls: type[NoiseEffect]) -> NoiseEffect:
    e = evidence_of(state)
    values: dict[str, float] = {}
    for p in cls.parameters:
        low, high = within(p, e.dt, e.duration)
        idle = p.choices or not p.log or p.name in cls.neutral
        values[p.name] = cls.neutral.get(p.name, 0.0) if idle else float(np.sqrt(low * high))
        if issubclass(cls, Response) and p.unit == 'Hz':    # at the fast end it takes little away
            values[p.name] = 0.25 / e.dt
    sizes = [p.name for p in cls.parameters if p.amplitude or p.linear]
    if sizes and not any(values[name] for name in sizes):
        values[sizes[0]] = 1.0
    return cls(values)


def span(state: State, effect: Effect, parameter: Parameter) -> tuple[float, float]:
    """Return between which values a record can show a parameter."""
    e = evidence_of(state)
    return within(parameter, e.dt, e.duration)


def _as_high_as_the_model(state: State, effect: NoiseEffect) -> NoiseEffect:
    """Return it scaled: the Allan variance goes with the square of an amplitude."""
    found = curves(state)
    scaled = [p for p in effect.parameters
              if (p.amplitude or p.linear) and effect[p.name]][:1]
    if not scaled or found is None:
        return effect
    p = scaled[0]
    one = effect.with_values(**{p.name: 1.0})
    v = effect_avar(evidence_of(state), state.model.plus(one), one, evidence_of(state).curve.m)
    top = 0.0 if v is None else float(np.max(v / found.model))
    size = np.clip(1 / np.sqrt(top), p.lower, p.upper) if np.isfinite(top) and top > 0 else 1.0
    return effect.with_values(**{p.name: float(f'{size:.3g}')})
