# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tell what changed between two studies: motor off and on, say, or cold and warm."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
import math
from typing import Any

import numpy as np
from scipy.special import ndtri

from ..core import units
from ..core.errors import InputError
from ..loop.effect import Estimate, Parameter
from ..loop.study import Study

#: chance that anything at all is said to have changed between two records of the same sensor
LEVEL = 0.01
CI95, CI90 = 1.96, 1.645    # standard deviations at the ends of such intervals


def compare_two(first: Study, second: Study) -> list[dict]:
    """
    Return what differs between two studies of one domain, target by target.

    Every parameter that both models hold is compared by its interval; for noise, the power in a
    few bands and the lines too, whatever the models are. ``sigmas`` says how rare a difference is
    where nothing has changed, as standard deviations of a normal distribution; it is ``changed``
    beyond :func:`limit`.

    Raises
    ------
    InputError
        The studies are of different domains, or have no target in common.

    """
    if first.domain != second.domain:
        one, other = (f'a {s.domain} study' for s in (first, second))
        raise InputError(f'the first is {one}, the second {other}',
                         'compare two studies of the same kind')
    targets = [t for t in first.targets if t in second.targets]
    if not targets:
        raise InputError('the two studies have no target in common: '
                         f'{", ".join(first.targets)} and {", ".join(second.targets)}',
                         'compare two studies of the same axes')
    out = [row for t in targets for row in _of_target(t, first, second)]
    beyond = limit(out)
    for row in (r for r in out if r['sigmas'] is not None):
        row['verdict'] = 'changed' if abs(row['sigmas']) > beyond else 'the same'
    return [{**r, 'sigmas': '' if r['sigmas'] is None else f'{r["sigmas"]:+.1f}'} for r in out]


def tested(rows: Sequence[Mapping[str, Any]]) -> int:
    """Return how many of these rows are tests: the others are told, or cannot be."""
    return sum(r['sigmas'] not in (None, '') for r in rows)


def limit(rows: Sequence[Mapping[str, Any]]) -> float:
    """
    Return beyond how many sigma one of these rows is no chance.

    They are as many tests, dependent or not (Bonferroni): of two records of the same sensor one of
    all rows is beyond it with the probability LEVEL, at most.

    """
    return -float(ndtri(LEVEL / 2 / max(tested(rows), 1)))


def _of_target(t: str, first: Study, second: Study) -> list[dict]:
    """Return the rows of one target, verdicts on what is tested left open."""
    out, a, b = [], first.states[t], second.states[t]
    fits, other_fits = ({n: s.fit for n, s in x.states.items()} for x in (first, second))
    instead = a.problem.comparable(fits, b.problem, other_fits)
    for label in a.model.labels:
        if a.problem.differs_in_data(a.model[label]):
            continue
        for name, x in a.fit.estimates.get(label, {}).items():
            y = b.fit.estimates.get(label, {}).get(name)
            of = a.model[label].parameter(name)
            if y is not None and not _unused(of, x, y):
                what, x, y = instead.get((label, name), (f'{label}.{name}', x, y))
                out.append(_of_estimates(t, what, of, x, y, a.model[label].field_units))
    for label in dict.fromkeys([*a.model.labels, *b.model.labels]):
        has = [label in s.model for s in (a, b)]
        if not all(has) and not a.problem.differs_in_data((a if has[0] else b).model[label]):
            out.append(_row(t, label, *('in the model' if h else '-' for h in has),
                            verdict='only in one model'))
    for d in a.problem.differences(a.fit, b.problem, b.fit):
        out.append(_values(t, d.what, d.unit, d.first, d.second, d.sigmas))
    return out


def _unused(of: Parameter, x: Estimate, y: Estimate) -> bool:
    """Tell whether a parameter says in both that this form of its effect is not there."""
    return (x.value == y.value == 0 and not (x.std or y.std)
            and not (of.amplitude or of.choices))


def _of_estimates(target: str, what: str, of: Parameter, x: Estimate, y: Estimate,
                  as_field: bool) -> dict:
    if of.choices:
        names = ['-' if e.value is None else str(of.written(e.value)) for e in (x, y)]
        return _row(target, what, *names,
                    verdict='the same' if names[0] == names[1] else 'another in each model')
    return _values(target, what, of.unit, x, y, _apart(of, x, y), as_field)


def _apart(of: Parameter, x: Estimate, y: Estimate) -> float | None:
    """
    Return by how many standard deviations two estimates are apart; None where that is not told.

    Intervals of few degrees of freedom are not symmetric: what counts is how far each reaches
    towards the other, on the scale of the search. How far it reaches beyond its end depends on
    what hides it: an amplitude known by few waves goes on by its logarithm, one beside stronger
    noise by its power, on which none of it is not far. The scale counts on which they are nearer.

    """
    if None not in (x.value, y.value) and x.value == y.value:
        return 0.0 if x.std and y.std else None

    def searched(value: float) -> float:
        return of.to_search(value) if value > 0 or not of.log else -np.inf

    found = [_on_scale(searched, x, y)]
    if of.log and of.amplitude:
        found.append(_on_scale(np.square, x, y))
    return min((z for z in found if z is not None), key=abs, default=None)


def _on_scale(scale: Callable[[float], float], x: Estimate, y: Estimate) -> float | None:
    """Return :func:`_apart` by one scale."""
    up = _likely(x) < _likely(y)
    ends = [_towards(scale, e, above) for e, above in ((x, up), (y, not up))]
    if None in ends or x.value is None and y.value is None:
        return None
    (at, std), (other, more) = ends     # type: ignore[misc]
    return float((other - at) / np.hypot(std, more)) if up == (other > at) else 0.0


def _likely(e: Estimate) -> float:
    return e.value if e.value is not None else 0.0


def _towards(scale: Callable[[float], float], e: Estimate,
             above: bool) -> tuple[float, float] | None:
    """
    Return where an estimate is on a scale, and its deviation to one side.

    An amplitude that may be zero has two upper limits, of 95 % and 97.5 %: a normal deviation of
    that scale that has both.

    """
    if e.value is None:
        if not (above and e.upper95 and e.ci95 and e.ci95[1] > e.upper95):
            return None
        near, far = (scale(v) for v in (e.upper95, e.ci95[1]))
        std = (far - near) / (CI95 - CI90)
        return near - CI90 * std, std
    if not e.std:
        return None
    end = e.ci95[above] if e.ci95 else e.value + (CI95 if above else -CI95) * e.std
    at = scale(e.value)
    std = abs(scale(end) - at) / CI95
    return (at, std) if std > 0 else None


def _values(target: str, what: str, unit: str, x: Estimate, y: Estimate,
            sigmas: float | None, as_field: bool = True) -> dict:
    """Return a row of two numbers, in SI and as people write them: as the field, or SI again."""
    sensor = target.partition('_')[0]
    known = sensor in ('gyro', 'accel')
    si = units.si(unit, sensor) if known else x.unit or unit
    factor, field = units.field(unit, sensor) if known and as_field else (1.0, si)
    return _row(
        target, what, _shown(x), _shown(y), si,
        _shown(x, factor), _shown(y, factor), field,
        sigmas=sigmas, verdict='not to be told')


def _row(target: str, what: str, first: str, second: str, unit: str = '',
         first_shown: str = '', second_shown: str = '', unit_shown: str = '', *,
         sigmas: float | None = None, verdict: str) -> dict:
    return {'target': target, 'what': what, 'first': first, 'second': second, 'unit': unit,
            'first_shown': first_shown or first, 'second_shown': second_shown or second,
            'unit_shown': unit_shown if unit_shown != '1' else '', 'sigmas': sigmas,
            'verdict': verdict}


def _shown(e: Estimate, factor: float = 1.0) -> str:
    """Return a number with its standard deviation, divided by what its unit is in SI."""
    if e.value is not None:
        of = f' +- {e.std / factor:.2g}' if e.std else ''
        digits = 4      # or as many as make two of the deviation
        if e.std and e.value:
            digits = min(max(4, 2 + math.floor(math.log10(abs(e.value)))
                             - math.floor(math.log10(e.std))), 8)
        return f'{e.value / factor:.{digits}g}{of}'
    return f'< {e.upper95 / factor:.3g}' if e.upper95 is not None else '?'
