# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What the table of a fleet says: populations, outlying units, changes, missing effects, lines.

Everything here is plain data in and plain data out; the statistics are in ``population``.

"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import population
from .amplitude import SQUARE
from .inputs import day
from .population import called, Fit, fit, Sample, upper
from .table import BETWEEN, DATE, factors_of
from ..core import units
from ..core.errors import InputError
from ..core.record import AXES, sensor_of
from ..export import PARAMETERS
from ..loop.effect import find_effect

LEVELS = 8          # of a factor; one with more is a name, not a factor
COMMON = 0.2        # share of a model's units from which an effect is the model's, not theirs
YEAR = 365.25       # days
NEAR = 0.01         # relative width within which two lines are one
FLOOR = 0.004       # standard error (log) below which no record is believed
SENSORS = ('gyro', 'accel')


@dataclass(frozen=True)
class Columns:
    """The columns of a table as arrays; words as an array of objects."""

    data: Mapping[str, np.ndarray]
    factors: tuple[str, ...]

    @classmethod
    def of(cls, whole: Any) -> Columns:
        """Return those of a table (pyarrow)."""
        data = {}
        for name in whole.column_names:
            column = whole.column(name)
            if str(column.type).startswith('dictionary'):
                column = column.cast('string')
            data[name] = np.asarray(column.to_numpy())
        return cls(data, tuple(factors_of(whole)))

    def __getitem__(self, name: str) -> np.ndarray:
        """Return a column."""
        return self.data[name]

    def where(self, some: np.ndarray) -> Columns:
        """Return some rows."""
        return Columns({k: v[some] for k, v in self.data.items()}, self.factors)

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.data['unit'])


def summary(whole: Any) -> dict[str, Any]:
    """Return all that a table says, as the plain data of fleet.json."""
    rows = Columns.of(whole)
    bags = rows['bag']
    failed = rows['kind'] == 'failed'
    out: dict[str, Any] = {
        'format': 'imu_noise_fleet/1', 'bags': len(set(bags)),
        'units': len(set(rows['unit'])),
        'failed': [{'bag': b, 'unit': u, 'error': e} for b, u, e in zip(
            bags[failed], rows['unit'][failed], rows['error'][failed])],
        'models': {}, 'outlying': [], 'changes': [], 'drifts': [], 'shrunk': {}}
    out['warned'] = warned(rows)
    good = rows.where(counting(rows))
    found = [one for model in sorted(set(good['model'])) for one in populations(
        good.where(good['model'] == model), model)]
    for one in found:
        out['models'].setdefault(one.model, {})[f'{one.sensor} {one.parameter}'] = one.plain()
        out['changes'] += one.changes()
        for unit, axis, value, low, high, weight in one.levels():
            out['shrunk'].setdefault(unit, {}).setdefault(axis, {})[one.parameter] = {
                'value': value, 'lo': low, 'hi': high, 'weight': weight}
    effects = missing(good)
    out['missing'], out['lines'] = effects['often'], lines(good)
    out['outlying'], out['drifts'] = outlying(found, effects['units'])
    out['about'] = about(rows.where(~failed))
    return out


def counting(rows: Columns) -> np.ndarray:
    """Tell which rows count in what is said of units and models (n,)."""
    return (rows['kind'] != 'failed') & ~_said(rows['left_out'])


def _said(words: np.ndarray) -> np.ndarray:
    return np.array([isinstance(w, str) and w != '' for w in words], bool)


def warned(rows: Columns) -> list[dict[str, Any]]:
    """Return the recordings with warnings: what they are, and which sensors are left out."""
    out: dict[tuple[str, str], dict[str, Any]] = {}
    some = rows.where(_said(rows['warnings']) | _said(rows['left_out']))
    for unit, bag, topic, axis, left, said in zip(*(some[n] for n in (
            'unit', 'bag', 'topic', 'axis', 'left_out', 'warnings'))):
        one = out.setdefault((bag, topic), {'unit': unit, 'bag': bag, 'left_out': [],
                                            'warnings': said.split(BETWEEN) if said else []})
        if left and sensor_of(axis) not in one['left_out']:
            one['left_out'].append(sensor_of(axis))
    return sorted(out.values(), key=lambda w: not w['left_out'])


def about(rows: Columns) -> dict[str, dict[str, Any]]:
    """Return what is to be known of each unit: its model, its bags with their keys."""
    out: dict[str, dict[str, Any]] = {}
    for unit, model, bag, key, date in dict.fromkeys(zip(
            rows['unit'], rows['model'], rows['bag'], rows['key'], rows[DATE])):
        one = out.setdefault(unit, {'model': model, 'bags': []})
        one['bags'].append({'bag': bag, 'key': key, 'date': date})
    for unit, axis, said in dict.fromkeys(zip(rows['unit'], rows['axis'], rows['verdict'])):
        out[unit].setdefault('verdicts', {}).setdefault(said, []).append(axis)
    return out


@dataclass(frozen=True)
class Population:
    """One coefficient of one sensor of one model over its units."""

    model: str
    sensor: str
    parameter: str
    axes: tuple[str, ...]
    units: tuple[str, ...]
    sample: Sample
    fixed: tuple[tuple[str, str, str], ...]     # (factor, level, against), behind the axes
    fit: Fit | None
    aliased: tuple[str, ...]

    @property
    def template(self) -> str:
        """Unit of the coefficient, as a template of :mod:`imu_noise_tools.core.units`."""
        return find_effect('noise', PARAMETERS[self.parameter])({}).parameter(
            self.parameter).unit

    def plain(self) -> dict[str, Any]:
        """Return it as plain data, values in SI."""
        s, f = self.sample, self.fit
        out: dict[str, Any] = {
            'unit': units.si(self.template, self.sensor), 'template': self.template,
            'units': len(self.units), 'records': len(s.y), 'limits': int(s.limit.sum()),
            'largest_limit': float(np.exp(np.max(s.y[s.limit]))) if s.limit.any() else None,
            'spread': self._strip()}
        if f is None:
            return {**out, 'axes': {}, 'covers95': None}
        out['axes'] = {a: _ratio(f, k) for k, a in enumerate(self.axes)}
        out.update(between=_percent(np.hypot(f.tau, f.omega)), between_units=_percent(f.tau),
                   between_axes=_percent(f.omega), between_records=_percent(f.rho),
                   aliased=list(self.aliased),
                   measurement=_percent(float(np.median(s.s[~s.limit]))),
                   covers95=float(np.exp(upper(f, range(len(self.axes))))))
        return out

    def _strip(self) -> list[list[Any]]:
        """Return what is drawn of it: unit, mean level (SI), whether a limit, probability."""
        s = self.sample
        y = s.y if self.fit is None else np.where(s.limit, self.fit.level, s.y)
        level = np.bincount(s.unit, y, s.units) / np.bincount(s.unit, minlength=s.units)
        limits = np.bincount(s.unit, s.limit, s.units) == np.bincount(s.unit, minlength=s.units)
        p = np.zeros(s.units) if self.fit is None else self.fit.p_out
        return [[u, float(np.exp(v)), bool(c), round(float(q), 4)]
                for u, v, c, q in zip(self.units, level, limits, p)]

    def changes(self) -> list[dict[str, Any]]:
        """Return what the levels of its factors change, each against the first."""
        if self.fit is None:
            return []
        out = []
        for k, (factor, level, against) in enumerate(self.fixed, len(self.axes)):
            low, high = self.fit.interval(k)
            out.append({
                'model': self.model, 'sensor': self.sensor, 'parameter': self.parameter,
                'factor': factor, 'level': level, 'against': against,
                'ratio': float(np.exp(self.fit.beta[k])), 'lo': float(np.exp(low)),
                'hi': float(np.exp(high)), 'beyond_chance': bool(low > 0 or high < 0)})
        return out

    def levels(self) -> Iterator[tuple[str, str, float, float, float, float]]:
        """Yield (unit, axis, value, lo, hi, weight of its own record), shrunk; the last record."""
        if self.fit is None:
            return
        f, s = self.fit, self.sample
        last = {(u, a): i for i, (u, a) in enumerate(zip(s.unit, s.axis))}
        prior = f.tau**2 + f.omega**2
        for (u, a), i in last.items():
            mean, half = f.level[i], 1.96 * f.level_std[i]
            weight = float(np.clip(1 - f.level_std[i] ** 2 / prior, 0, 1)) if prior > 0 else 0.0
            yield (self.units[u], self.axes[a], float(np.exp(mean)), float(np.exp(mean - half)),
                   float(np.exp(mean + half)), weight)


def _ratio(f: Fit, k: int) -> dict[str, float]:
    low, high = f.interval(k)
    return {'mean': float(np.exp(f.beta[k])), 'lo': float(np.exp(low)),
            'hi': float(np.exp(high))}


def _percent(sd: float) -> float:
    """Return a standard deviation of logarithms as per cent."""
    return float(100 * np.expm1(sd))


def populations(rows: Columns, model: str) -> Iterator[Population]:
    """Yield the population of N, B and K of each sensor of one model's rows."""
    wanted = rows['kind'] == 'coefficient'
    for sensor in SENSORS:
        for parameter, effect in PARAMETERS.items():
            some = wanted & (rows['effect'] == effect) & (rows['parameter'] == parameter) \
                & np.char.startswith(rows['axis'].astype(str), sensor)
            if some.any():
                yield _population(rows.where(some), model, sensor, parameter)


def _population(rows: Columns, model: str, sensor: str, parameter: str) -> Population:
    null = rows['null'].astype(bool)
    value = np.where(null, limits_of(rows), rows['value']).astype(float)
    ok = np.isfinite(value) & (value > 0)
    rows, null, value = rows.where(ok), null[ok], value[ok]
    time = np.array([day(d) if d else np.nan for d in rows[DATE]], float)
    order = np.lexsort((np.nan_to_num(time), rows['axis'].astype(str), rows['unit'].astype(str)))
    rows, null, value, time = rows.where(order), null[order], value[order], time[order]
    names, unit = np.unique(rows['unit'].astype(str), return_inverse=True)
    axes, axis = np.unique(rows['axis'].astype(str), return_inverse=True)
    X = (axis[:, None] == np.arange(len(axes))).astype(float)
    X, fixed, aliased = _design(rows, X)
    sample = Sample(np.log(value), _errors(rows, value, null), null, unit, axis, X,
                    time if np.isfinite(time).any() else None,
                    np.column_stack([rows[n].astype(float) for n in SQUARE]))
    try:
        found = fit(sample)
    except (ValueError, np.linalg.LinAlgError):
        found = None
    return Population(model, sensor, parameter, tuple(axes), tuple(names), sample, fixed, found,
                      aliased)


def _errors(rows: Columns, value: np.ndarray, null: np.ndarray) -> np.ndarray:
    """Return standard errors of the logarithms: from the interval, else from std."""
    with np.errstate(divide='ignore', invalid='ignore'):
        lo, hi = rows['lo'].astype(float), rows['hi'].astype(float)
        s = np.where(lo > 0, np.log(hi / lo) / (2 * 1.96), rows['std'].astype(float) / value)
    return np.where(null, 1.0, np.clip(np.nan_to_num(s, nan=1.0), FLOOR, 2.0))


def limits_of(rows: Columns) -> np.ndarray:
    """Return the 95 % upper limits, or else the upper ends of the intervals."""
    limit, hi = rows['upper95'].astype(float), rows['hi'].astype(float)
    return np.where(np.isfinite(limit), limit, hi)


def _design(rows: Columns, X: np.ndarray) -> tuple:
    """
    Return X with the levels of the factors that can be told apart, what they are, what cannot.

    A level counts against the first of its factor; a column that others already say is left out.

    """
    fixed, aliased = [], []
    for factor in rows.factors:
        if factor == DATE:
            continue
        words = np.array([w or '' for w in rows[factor]])
        levels = sorted(set(words) - {''})
        if not 2 <= len(levels) <= LEVELS:
            continue
        some = [(words == level).astype(float) for level in levels[1:]]
        # records that do not say are told apart from those that do
        extra = [(words == '').astype(float)] if (words == '').any() else []
        wider = np.column_stack([X, *some, *extra])
        if np.linalg.matrix_rank(wider) < wider.shape[1]:
            aliased.append(factor)
            continue
        X = np.column_stack([X, *some, *extra])
        fixed += [(factor, level, levels[0]) for level in levels[1:]]
        fixed += [(factor, 'not said', levels[0])] * len(extra)
    return X, tuple(fixed), tuple(aliased)


def outlying(found: Sequence[Population], effects: Sequence[Mapping[str, Any]]) -> tuple:
    """
    Return the units that are out, each once with all that is said of it, and those that drift.

    One false discovery rate over every unit and coefficient, and the missing effects with them.

    """
    cases: list[dict[str, Any]] = [dict(e) for e in effects]
    for one in found:
        f = one.fit
        if f is None:
            continue
        shape = f.names
        for u, unit in enumerate(one.units):
            if f.p_out[u] < 0.05:
                continue
            k = int(np.argmax(f.out[u, 1:]))
            cases.append({
                'unit': unit, 'model': one.model, 'probability': float(f.p_out[u]),
                'what': f'{one.sensor} {one.parameter}', 'axes': _axes_out(one, u),
                'drift': shape[k] == 'drift', **_moved(one, u, k)})
    sure = called(np.array([c['probability'] for c in cases], float))
    out: dict[str, dict[str, Any]] = {}
    for case, yes in zip(cases, sure):
        if yes:
            one = out.setdefault(case['unit'], {'unit': case['unit'], 'model': case['model'],
                                                'probability': 0.0, 'why': []})
            one['probability'] = max(one['probability'], case['probability'])
            one['why'].append(case)
    listed = sorted(out.values(), key=lambda c: (-c['probability'], c['unit']))
    return listed, [c for u in listed for c in u['why'] if c.get('drift')]


def _axes_out(one: Population, u: int) -> list[str]:
    assert one.fit is not None
    p = dict(zip(one.fit.names, one.fit.out[u, 1:]))
    single = [a for k, a in enumerate(one.axes) if p.get(f'axis {k}', 0) > 0.5]
    return single or list(one.axes)


def _moved(one: Population, u: int, k: int) -> dict[str, float]:
    """Return by how much a unit is out, as a ratio; of a drift, over a year."""
    assert one.fit is not None
    size, std = one.fit.size[u, k], one.fit.size_std[u, k]
    if one.fit.names[k] == 'drift' and one.sample.time is not None:
        known = one.sample.time[np.isfinite(one.sample.time)]
        scale = YEAR / np.ptp(known)
        size, std = size * scale, std * scale
    low, high = size - 1.96 * std, size + 1.96 * std
    return dict(zip(('ratio', 'lo', 'hi'), np.exp(np.clip([size, low, high], -20, 20)).tolist()))


def missing(rows: Columns) -> dict[str, list]:
    """
    Return which effects are missing how often in each model, and the units that it singles out.

    A finding speaks for an effect by what it gains beyond its penalty, nats that add up over the
    axes and bags of a unit (a log likelihood ratio); against it stand that few units are out, and
    the bags in which it was looked for in vain. An effect of many units is the model's own.

    """
    some = rows.where(rows['kind'] == 'missing')
    units_of = {m: set(rows['unit'][rows['model'] == m]) for m in set(rows['model'])}
    seen: dict[tuple[str, str], dict[str, dict[str, Any]]] = {}
    for model, effect, unit, axis, bag, gain, penalty in dict.fromkeys(zip(
            some['model'], some['effect'], some['unit'], some['axis'], some['bag'], some['gain'],
            some['penalty'])):
        one = seen.setdefault((model, effect), {}).setdefault(
            unit, {'nats': 0.0, 'axes': {}, 'bags': {}})
        one['nats'] += max(gain - penalty, 0.0)
        one['axes'][axis] = one['bags'][bag] = None
    bags_of = {u: len(set(rows['bag'][rows['unit'] == u])) for u in {
        u for by in seen.values() for u in by}}
    often, out = [], []
    for (model, effect), by_unit in sorted(seen.items()):
        share = len(by_unit) / len(units_of[model])
        often.append({'model': model, 'effect': effect, 'units': len(by_unit),
                      'of': len(units_of[model]), 'share': share, 'names': sorted(by_unit)})
        for unit, one in by_unit.items():
            against = bags_of[unit] - len(one['bags'])
            odds = np.log(population.OUT) + one['nats'] - against
            if share > COMMON and len(by_unit) > 2 or odds < -3:
                continue
            out.append({'unit': unit, 'model': model, 'what': f'{effect} missing from its model',
                        'probability': float(1 / (1 + np.exp(-min(odds, 30.0)))),
                        'axes': sorted(one['axes'], key=AXES.index), 'drift': False})
    return {'often': sorted(often, key=lambda o: -float(o['share'])), 'units': out}


def lines(rows: Columns) -> list[dict[str, Any]]:
    """Return the lines found over the fleet by frequency, and how many units have each."""
    some = rows.where((rows['kind'] == 'missing') & (rows['parameter'] == 'frequency'))
    value = some['value'].astype(float)
    order = np.argsort(value)
    groups: list[list[int]] = []
    for i in order:
        if not np.isfinite(value[i]):
            continue
        near = NEAR * value[i]
        if groups and value[i] - value[groups[-1][-1]] <= near:
            groups[-1].append(int(i))
        else:
            groups.append([int(i)])
    whole = len(set(rows['unit']))
    out = []
    for group in groups:
        names = sorted(set(some['unit'][group]))
        out.append({'frequency': float(np.median(value[group])), 'units': len(names), 'of': whole,
                    'names': names, 'effects': sorted(set(some['effect'][group])),
                    'axes': sorted(set(some['axis'][group]))})
    return sorted(out, key=lambda g: -g['units'])


def compare(a: Any, b: Any) -> list[dict[str, Any]]:
    """
    Return what differs between two tables, B against A, model by model and coefficient.

    Units that are in both are the same units, and speak for the change by themselves.

    """
    first, second = Columns.of(a), Columns.of(b)
    names = [n for n in first.data if n in second.data]
    factor = '(fleet)'
    data = {n: np.concatenate([first[n], second[n]]) for n in names}
    data[factor] = np.array(['A'] * len(first) + ['B'] * len(second), dtype=object)
    both = Columns(data, (factor,))
    good = both.where(counting(both))
    models = sorted(set(first['model']) & set(second['model']))
    out = [c for m in models for one in populations(good.where(good['model'] == m), m)
           for c in one.changes()]
    if not out:
        raise InputError('the two fleets have no model and coefficient in common',
                         'compare fleets of the same models')
    return out


def worst_first(cases: Iterable[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Return changes with those beyond chance first."""
    return sorted(cases, key=lambda c: (not c['beyond_chance'], -abs(np.log(c['ratio']))))
