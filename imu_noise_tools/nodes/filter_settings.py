# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""From the parameters of the filter node to what its engine is made of."""

from __future__ import annotations

from collections.abc import Mapping
import math
from typing import Any

from .params import Setting, Settings
from ..core import units
from ..filter.statespace import DOMAIN
from ..loop.effect import registry
from ..tasks.filter import from_study, input_unit


def value_settings() -> list[Setting]:
    """Return a setting for every parameter of every effect; NaN stands for a typical value."""
    return [Setting(f'{name}.{p.name}', math.nan, f'{effect.title}: {p.title}; NaN: typical',
                    units.si(p.unit, 'gyro'), p.lower, p.upper, optional=True)
            for name, effect in registry(DOMAIN).items() for p in effect.parameters]


def given_values(p: Settings | Mapping[str, Any]) -> dict[str, dict[str, float]]:
    """Return the values that parameters state, by label of their effect."""
    values: dict[str, dict[str, float]] = {}
    for setting in value_settings():
        if not math.isnan(p[setting.name]):
            label, _, parameter = setting.name.rpartition('.')
            values.setdefault(label, {})[parameter] = p[setting.name]
    return values


def unit_of(p: Settings | Mapping[str, Any]) -> str:
    """Return the unit that rates come in: that of the model's recording."""
    return (input_unit(p['model']) if p['model'] else None) or units.SI['gyro']


def chosen(p: Settings | Mapping[str, Any]) -> dict[str, Any]:
    """
    Return what an engine is to be: motion, noise, alpha, values, delay; ``p``: by parameter.

    Raises
    ------
    InputError
        There is no study where ``model`` says.

    """
    motion, noise = p['motion'], p['noise']
    if p['model']:
        dt = 1 / p['rate_hz'] if p['rate_hz'] else None
        motion, noise, _, _ = from_study(p['model'], motion, noise, dt)
    return {'motion': motion, 'noise': noise, 'alpha': p['alpha'], 'values': given_values(p),
            'delay': p['delay']}
