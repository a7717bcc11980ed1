# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the formats share: N and K by the options, rates, the comment on where they are from."""

from __future__ import annotations

from typing import Any

import numpy as np

from ._values import (
    covered, left_out, number, PARAMETERS, rests_on, unseen, Value, value_of
)
from ..core.errors import InputError, UsageError
from ..core.units import date, duration
from ..health import SUSPECTED
from ..loop.effect import Estimate
from ..loop.study import Study

SENSORS = {'gyro': 'gyroscope', 'accel': 'accelerometer'}
UNITS = {'N': {'gyro': 'rad/s/sqrt(Hz)', 'accel': 'm/s^2/sqrt(Hz)'},
         'K': {'gyro': 'rad/s^2/sqrt(Hz)', 'accel': 'm/s^3/sqrt(Hz)'}}


class Numbers:
    """
    N and K of a study, continuous time, square roots of two-sided densities (SI).

    Parameters
    ----------
    study : Study
        Of noise.
    axes : str
        ``worst`` or ``mean`` of a sensor's axes, or ``each``.
    inflate : float
        Factor on all of them.
    horizon : float or None
        They cover model and data up to so many s.

    """

    def __init__(self, study: Study, axes: str = 'worst', inflate: float = 1.0,
                 horizon: float | None = None) -> None:
        self.study, self.axes, self.inflate, self.horizon = study, axes, inflate, horizon
        self._values: dict[tuple[str, str], Value | None] = {}

    @property
    def sensors(self) -> list[str]:
        """Sensors that the study has."""
        return [s for s in SENSORS if any(t.startswith(s) for t in self.study.targets)]

    def value(self, sensor: str, parameter: str) -> Value:
        """Return a coefficient of all axes of a sensor."""
        key = sensor, parameter
        if key not in self._values:
            self._values[key] = value_of(self.study, sensor, parameter, self.horizon)
        found = self._values[key]
        if found is None:
            raise InputError(f'the study has no {SENSORS[sensor]}', 'analyse a record with both')
        return found

    def one(self, sensor: str, parameter: str) -> float:
        """Return a coefficient of a sensor, by the rule for the axes."""
        return self.value(sensor, parameter).one(self.axes) * self.inflate

    def three(self, sensor: str, parameter: str) -> list[float]:
        """Return a coefficient for x, y, z; the same one where the rule gives one."""
        if self.axes != 'each':
            return [self.one(sensor, parameter)] * 3
        found = self.value(sensor, parameter)
        by_axis = dict(zip((a[-1] for a in found.axes), found.values))
        if len(by_axis) < 3:
            raise UsageError(f'--axes each: the study has {", ".join(found.axes)} alone',
                             'use --axes worst or mean')
        return [by_axis[a] * self.inflate for a in 'xyz']

    def rate(self, sensor: str) -> float:
        """Return the sample rate of a sensor, Hz."""
        streams = self.study.source.get('streams') or {}
        return float(streams.get(sensor, self.study.source).get('rate_hz') or 0.0)

    def topic(self, default: str = '/imu0') -> str:
        """Return one topic: the gyroscope's where each sensor has its own."""
        streams = self.study.source.get('streams') or {}
        topic = streams.get('gyro', self.study.source).get('topic')
        return str(topic or default).split(',')[0]

    def about(self, convention: str) -> list[str]:
        """Return sentences on where the numbers are from, what they leave out, and how to read."""
        said = [convention, *self._doubted(), *self._origin()]
        rule = {'each': 'each axis its own', 'mean': 'rms of the axes',
                'worst': 'the largest of the axes'}.get(self.axes, self.axes)
        said.append(f'Of a sensor: {rule}' + (f', times {self.inflate:g}'
                                              if self.inflate != 1 else ''))
        if self.horizon is not None:
            said.append(covered(self.study, self.horizon))
        there = [(s, p) for s in self.sensors for p in 'NK' if self._gives(s, p)]
        said += [self._measured(*some) for some in there]
        said += rests_on(self.study, self.horizon)
        out = left_out(self.study, self.horizon)
        if out:
            said.append('Not in N and K: ' + '; '.join(out))
        out = unseen(self.study, self.horizon)
        if out:
            said.append('Not observable in this record: ' + '; '.join(out))
        notes = [n for some in there for n in self.value(*some).notes]
        return said + list(dict.fromkeys(notes))

    def _doubted(self) -> list[str]:
        """Return why the unit of the record is doubted: then every number is wrong by a factor."""
        return [f'WARNING: {w}' for w in self.study.source.get('warnings') or () if SUSPECTED in w]

    def _origin(self) -> list[str]:
        """Return the record that the numbers are from; of stated values who states them."""
        source = self.study.source
        rates = ', '.join(f'{SENSORS[s]} {self.rate(s):.6g} Hz' for s in self.sensors)
        name = source.get('path') or 'a study'
        if source.get('sheet'):
            stated = source.get('sheet_source') or source['sheet']
            return [f'From {name}: values stated by {stated}, of no record of its own; {rates}',
                    *(source.get('notes') or ())]
        more = [f'topic {self.topic("")}', f'{source.get("samples")} samples']
        if source.get('duration_s'):
            more.append(duration(source['duration_s']))
        more += [x for x in [date(source.get('start') or 0.0)] if x]
        return [f'From {name}, {", ".join(more)}; {rates}']

    def _gives(self, sensor: str, parameter: str) -> bool:
        """Tell whether the study gives a coefficient at all: what states values may not."""
        try:
            return bool(self.value(sensor, parameter).axes)
        except InputError:
            return False

    def _measured(self, sensor: str, parameter: str) -> str:
        """Return what was measured of a coefficient, axis by axis, with intervals."""
        found = self.value(sensor, parameter)
        label = PARAMETERS[parameter]
        parts = []
        for axis, value in zip(found.axes, found.values):
            e = self.study.states[axis].fit.estimates.get(label, {}).get(parameter)
            parts.append(f'{axis[-1]} {_stated(e, value)}')
        return f'{sensor} {parameter} in {UNITS[parameter][sensor]}: {", ".join(parts)}'


def _stated(e: Estimate | None, value: float) -> str:
    """Return a value with the interval of its estimate, the fit's where it is not; or a limit."""
    if e is not None and e.value is None and e.upper95 is not None and np.isclose(
            value, e.upper95, rtol=1e-6):
        return f'below {value:.4g}'
    if e is None or not e.ci95:
        return f'{value:.4g}'
    said = f'[{e.ci95[0]:.3g}, {e.ci95[1]:.3g}]'
    own = e.value is not None and np.isclose(value, e.value, rtol=1e-6)
    return f'{value:.4g} {said if own else f"(fitted {said})"}'


def commented(said: list[str]) -> str:
    """Return sentences as lines of comment."""
    return ''.join(f'# {" ".join(s.split())}\n' for s in said)


def numbers_of(values: Any) -> str:
    """Return numbers in brackets."""
    return '[' + ', '.join(number(float(x)) for x in np.ravel(values)) + ']'


def rows_of(matrix: Any, indent: str) -> str:
    """Return a matrix as rows of YAML."""
    return ''.join(f'{indent}- {numbers_of(row)}\n' for row in np.atleast_2d(matrix))


AT_REST = ('These are of the sensor at rest. In flight vibration is many times louder; the '
           'defaults (0.35, 0.015) allow for it: go below them with logs in hand alone')


def steps(numbers: Numbers, parameters: tuple, step: float, limits: str,
          said: list[str]) -> list[tuple[str, float]]:
    """
    Return (name, value) of an autopilot's sigmas of a step of so many s: N and K over its root.

    ``parameters`` are (name, sensor, N or K, low, high); what is out of range is put at its end,
    and ``said``, with ``limits`` for whose range it is.

    """
    said.append(AT_REST)
    out = []
    for name, sensor, parameter, low, high in parameters:
        value = numbers.one(sensor, parameter) / step ** 0.5
        kept = min(max(value, low), high)
        if kept != value:
            said.append(f'{name} would be {value:.3g}; {limits} {low:g} to {high:g}')
        out.append((name, kept))
    return out
