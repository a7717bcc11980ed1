# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The numbers of a fleet as studies of stated values, which every export takes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from . import page
from .assemble import read
from ..core.errors import InputError, unknown
from ..core.record import AXES
from ..export import PARAMETERS
from ..loop.study import Study
from ..sheet import Sheet

NOT_SHOWN = 'shown by too few units'


def unit_study(folder: str | Path, unit: str) -> Study:
    """
    Return what a fleet knows of one unit: its own records, beside what its model does.

    Each axis is the mean of both by their weights: a value that was measured well stays as it is,
    one that its records do not show is the model's.

    Raises
    ------
    UsageError
        No such unit.
    InputError
        There is no fleet, or its models show nothing.

    """
    said = read(folder)
    if unit not in said['about']:
        raise unknown('unit', unit, said['about'])
    left = [f'{w["bag"]}: {page.left(w)}' for w in said['warned']
            if w['unit'] == unit and w['left_out']]
    if unit not in said['shrunk'] and left:
        raise InputError(f'{folder}: {left[0]}', f'it {page.REMEDY}')
    if unit not in said['shrunk']:
        raise InputError(f'{folder}: {NOT_SHOWN} of {said["about"][unit]["model"] or "the model"}',
                         'name the study of its bag: three units make a population')
    values: dict[str, dict[tuple[str, str], float]] = {}
    notes = []
    for axis in sorted(said['shrunk'][unit], key=AXES.index):
        for name, x in said['shrunk'][unit][axis].items():
            values.setdefault(axis, {})[PARAMETERS[name], name] = x['value']
            notes.append(f'{axis} {name}: {100 * x["weight"]:.0f} % its own record, the rest its '
                         f'model; 95 % {x["lo"]:.3g} to {x["hi"]:.3g}')
    notes += left
    out = [o for o in said['outlying'] if o['unit'] == unit]
    if out:
        notes.append(f'the unit is out of what its model does ({out[0]["probability"]:.3f})')
    model = said['about'][unit]['model']
    _limits(values, said['models'].get(model, {}), notes)
    return _study(folder, f'unit {unit}', said['rate_hz'].get(model), values, notes)


def population_study(folder: str | Path, model: str | None = None) -> Study:
    """
    Return what covers 95 % of a model's units: for a unit that was never measured.

    Each coefficient is one that the worst axis of a new, regular unit does not exceed in 95 of 100
    (:func:`imu_noise_tools.fleet.population.upper`).

    Raises
    ------
    UsageError
        An unknown model, or several and none chosen.
    InputError
        There is no fleet, or its units show nothing.

    """
    said = read(folder)
    names = list(said['models'])
    if model is None and len(names) == 1:
        model = names[0]
    if model not in said['models']:
        raise unknown('model (--model)', model or 'not chosen', names)
    values: dict[str, dict[tuple[str, str], float]] = {}
    notes = ['covers 95 % of units, the worst axis of each; units that are out do not count']
    for name, p in said['models'][model].items():
        sensor, parameter = name.split()
        if p['covers95'] is not None:
            notes.append(f'{name}: from {p["units"]} units, {p["between"]:.2g} % between them')
            for axis in p['axes']:
                values.setdefault(axis, {})[PARAMETERS[parameter], parameter] = p['covers95']
    if not values:
        raise InputError(f'{folder}: {NOT_SHOWN}', 'analyse more or longer records')
    _limits(values, said['models'][model], notes)
    return _study(folder, f'population of {model or "the model"}', said['rate_hz'].get(model),
                  values, notes)


def _limits(values: dict[str, dict[tuple[str, str], float]], found: Mapping[str, Any],
            notes: list[str]) -> None:
    """Put the largest upper limit where a coefficient is shown by too few units."""
    for name, p in found.items():
        sensor, parameter = name.split()
        if p['axes'] or not p['largest_limit']:
            continue
        for axis in [a for a in values if a.startswith(sensor)]:
            values[axis].setdefault((PARAMETERS[parameter], parameter), p['largest_limit'])
        notes.append(f'{name} is {NOT_SHOWN}, the largest upper limit is used')


def _study(folder: str | Path, what: str, rate: float | None,
           values: Mapping[str, Mapping[tuple[str, str], float]], notes: list[str]) -> Study:
    order = sorted(values, key=AXES.index)
    return Sheet(f'{folder}: {what}', 'a fleet', rate or 100.0,
                 {a: values[a] for a in order}, tuple(notes)).study(f'{folder}: {what}')
