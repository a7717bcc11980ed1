# Copyright 2026 imu_noise_tools maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""From the parameters of the filter node to what its engine is made of."""

from __future__ import annotations

import math

from .params import Setting
from .. import units
from ..denoise.statespace import DOMAIN
from ..effect import registry
from ..tasks.denoise import from_study


def value_settings() -> list[Setting]:
    """Return a setting for every parameter of every effect; NaN stands for a typical value."""
    return [Setting(f'{name}.{p.name}', math.nan, f'{effect.title}: {p.title}; NaN: typical',
                    units.si(p.unit, 'gyro'), p.lower, p.upper, optional=True)
            for name, effect in registry(DOMAIN).items() for p in effect.parameters]


def given_values(p) -> dict[str, dict[str, float]]:
    """Return the values that parameters state, by label of their effect."""
    values: dict[str, dict[str, float]] = {}
    for setting in value_settings():
        if not math.isnan(p[setting.name]):
            label, _, parameter = setting.name.rpartition('.')
            values.setdefault(label, {})[parameter] = p[setting.name]
    return values


def chosen(p) -> dict:
    """
    Return what an engine is to be: motion, noise, alpha, values; ``p`` maps names of parameters.

    Raises
    ------
    InputError
        There is no study where ``model`` says.

    """
    motion, noise = p['motion'], p['noise']
    if p['model']:
        dt = 1 / p['rate_hz'] if p['rate_hz'] else None
        motion, noise, _, _ = from_study(p['model'], motion, noise, dt)
    return {'motion': motion, 'noise': noise, 'alpha': p['alpha'], 'values': given_values(p)}
