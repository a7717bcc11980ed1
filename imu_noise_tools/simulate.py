# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Records with known truth, from a specification.

Each effect of each axis has a random stream of its own, named by the seed, the axis and the
effect's label: one seed gives one record, and adding an effect leaves the others' draws as they
were.

"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
import zlib

import numpy as np

from .core.errors import InputError, unknown, UsageError
from .core.record import AXES, ImuRecord, sensor_of
from .core.units import DEG, G0
from .loop.effect import find_effect, Model
from .noise.kinds import Coupling, Defect, Inputs, Modulation, NoiseEffect, Response, Spectrum

Progress = Callable[[float, str], None]

MOST_SAMPLES = 100_000_000
MOTIONS = {'rocking': ('axis', 'amplitude_deg', 'period_s'), 'constant_rate': ('axis', 'deg_s'),
           'vibration': ('axis', 'amplitude', 'frequency')}
KEYS = ('rate_hz', 'duration_s', 'seed', 'targets', 'covariates', 'motion',
        'bag')      # which a truth.yaml says of the record that it is of


def stage(effect: NoiseEffect, model: Model) -> int:
    """
    Return the order in which effects of a model act.

    Noise, then what the sensor does to it, then what the electronics do to samples. What passes a
    filter that acts on the sensor's own noise alone comes behind it.

    """
    if isinstance(effect, Response):
        return 5 if isinstance(effect, Defect) else 3
    if isinstance(effect, Coupling):
        return 1
    if isinstance(effect, Modulation):
        return 2
    if isinstance(effect, Spectrum) and not (effect.filtered and all(
            r.acts_on(effect) for r in model.of(Response))):
        return 7 if isinstance(effect, Defect) else 4
    return 6 if isinstance(effect, Defect) and not isinstance(effect, Spectrum) else 0


def simulate(spec: Mapping, progress: Progress | None = None) -> tuple[ImuRecord, dict]:
    """
    Return a record and its truth.

    Parameters
    ----------
    spec : mapping
        ``rate_hz``, ``duration_s``, ``seed``; ``targets``: {axis: {effect: {parameter: value}}}
        (labels such as ``sinusoid.2`` for a second one; ``bias`` is a plain number);
        ``covariates``: {temperature: {base, swing, period_s, settle, settle_s, noise}} in degrees
        Celsius; ``motion``: {rocking: {axis, amplitude_deg, period_s}, constant_rate: {axis,
        deg_s}, vibration: {axis, amplitude, frequency}}.
    progress : callable or None
        Called with (share done, what).

    Raises
    ------
    InputError
        Something in the specification is missing, unknown or out of range.

    """
    n, dt, seed = _size(spec)
    t = np.arange(n) * dt
    covariates = _covariates(_mapping(spec, 'covariates'), t, seed)
    targets = _mapping(spec, 'targets')
    if not targets:
        raise InputError(
            'targets: no axis in the specification', 'e.g. targets: {gyro_x: {white: {N: 8.7e-5}}}'
        )
    data = {a: _still(a, n) for a in _axes(targets)}
    _move(_mapping(spec, 'motion'), data, t)
    # the accelerometer first: it may leak into the gyroscope
    order = sorted(
        targets, key=lambda a: AXES.index(a) if a.startswith('accel') else 10 + AXES.index(a)
    )
    for k, axis in enumerate(order):
        if progress:
            progress(k / len(order), axis)
        model, bias = _model(axis, targets[axis])
        x = data[axis] + bias
        for e in sorted(model, key=partial(stage, model=model)):
            rng = np.random.default_rng(
                [seed, zlib.crc32(axis.encode()), zlib.crc32(e.label.encode())]
            )
            try:
                x = e.apply(x, Inputs(t, dt, covariates, data), rng)
            except KeyError as error:
                raise InputError(
                    f'targets.{axis}.{e.label}: needs {error.args[0]}', e.needs
                ) from None
        data[axis] = x
    record = ImuRecord(
        _stack(data, 'gyro'),
        _stack(data, 'accel'),
        t,
        1 / dt,
        covariates=covariates,
        topic='/imu/data_raw',
        frame_id='imu_link',
        start=1.7e9,
    )
    return record, {
        'rate_hz': 1 / dt,
        'duration_s': n * dt,
        'seed': seed,
        'targets': {a: dict(v or {}) for a, v in targets.items()},
        'covariates': spec.get('covariates') or {},
        'motion': spec.get('motion') or {},
    }


def _size(spec):
    if not isinstance(spec, Mapping):
        raise InputError(
            'the specification is not a mapping', 'see imu_noise simulate --help for an example'
        )
    _known(spec, 'specification', 'entry', KEYS)
    try:
        rate, duration, seed = (
            float(spec['rate_hz']),
            float(spec['duration_s']),
            int(spec.get('seed', 0)),
        )
    except KeyError as error:
        raise InputError(
            f'{error.args[0]} is missing from the specification',
            'e.g. rate_hz: 100, duration_s: 3600'
        ) from None
    except (TypeError, ValueError):
        raise InputError(
            'rate_hz, duration_s and seed must be numbers',
            'e.g. rate_hz: 100, duration_s: 3600, seed: 1',
        ) from None
    if (
        not (
            np.isfinite(rate)
            and rate > 0
            and np.isfinite(duration)
            and 9 <= rate * duration <= MOST_SAMPLES
        )
        or seed < 0
    ):
        raise InputError(
            f'rate_hz {rate:g}, duration_s {duration:g}, seed {seed}: out of range',
            f'9 to {MOST_SAMPLES} samples and a seed of zero or more',
        )
    return int(round(rate * duration)), 1 / rate, seed


def _known(given, where, what, known):
    """Raise InputError for the first name that is not known, with the nearest."""
    for name in given:
        if name not in known:
            error = unknown(what, name, known)
            raise InputError(f'{where}: {error.message}', error.remedy)


def _mapping(spec, name):
    found = spec.get(name) or {}
    if not isinstance(found, Mapping):
        raise InputError(f'{name}: not a mapping', 'see imu_noise simulate --help for an example')
    return found


def _numbers(values, where):
    """Return a mapping of finite floats; raise InputError for anything else."""
    try:
        found = {k: float(x) for k, x in (values or {}).items()}
    except (TypeError, ValueError, AttributeError):
        found = {'': np.nan}
    if not np.all(np.isfinite(list(found.values()))):
        raise InputError(f'{where}: values must be numbers', 'e.g. period_s: 600')
    return found


def _axes(targets):
    _known(targets, 'targets', 'axis', AXES)
    for a in targets:
        _mapping(targets, a)
    sensors = {sensor_of(a) for a in targets}
    return [a for a in AXES if sensor_of(a) in sensors]


def _still(axis, n):
    return np.full(n, G0 if axis == 'accel_z' else 0.0)


def _model(axis, entries):
    entries = dict(entries or {})
    if not entries:
        raise InputError(f'targets.{axis}: no effect', 'e.g. white: {N: 8.7e-5}')
    try:
        bias = float(entries.pop('bias', 0.0))
        model = Model(
            find_effect('noise', label)(values or {}, label)
            for label, values in entries.items()
        )
    except UsageError as error:
        raise InputError(f'targets.{axis}: {error.message}', error.remedy) from None
    except (TypeError, ValueError, AttributeError):
        raise InputError(
            f'targets.{axis}: parameters must be numbers', 'e.g. white: {N: 8.7e-5}'
        ) from None
    for e in model.of(NoiseEffect):
        for p in e.parameters:
            if p.name not in e.values:
                if p.discrete or p.linear or p.name in e.neutral:
                    value = e.neutral.get(p.name, 0.0)
                    model = model.with_values({e.label: {p.name: value}})
                    continue
                raise InputError(
                    f'targets.{axis}.{e.label}: {p.name} is missing',
                    f'{e.label}: {{{p.name}: {p.lower:g} to {p.upper:g}}}',
                )
            if not p.lower <= e[p.name] <= p.upper:
                raise InputError(
                    f'targets.{axis}.{e.label}.{p.name}: {e[p.name]:g} is out of range',
                    f'{p.lower:g} to {p.upper:g}',
                )
    return model, bias


def _covariates(spec, t, seed):
    out = {}
    _known(spec, 'covariates', 'covariate', ('temperature',))
    for name, values in spec.items():
        v = {
            'base': 25.0,
            'swing': 0.0,
            'period_s': 3600.0,
            'settle': 0.0,
            'settle_s': 600.0,
            'noise': 0.01,
        }
        values = _numbers(values, 'covariates.temperature')
        _known(values, 'covariates.temperature', 'entry', v)
        v.update(values)
        if not (v['period_s'] > 0 and v['settle_s'] > 0):
            raise InputError(
                'covariates.temperature: period_s and settle_s must be above zero',
                'e.g. period_s: 3600',
            )
        rng = np.random.default_rng([seed, zlib.crc32(b'temperature')])
        out[name] = (
            v['base']
            + v['swing'] * np.sin(2 * np.pi * t / v['period_s'])
            - v['settle'] * np.exp(-t / v['settle_s'])
            + v['noise'] * rng.standard_normal(len(t))
        )
    return out


def _move(spec, data, t):
    _known(spec, 'motion', 'motion', MOTIONS)
    for kind, v in spec.items():
        v = dict(_mapping(spec, kind))
        _known(v, f'motion.{kind}', 'entry', MOTIONS[kind])
        axis = v.pop('axis', 'no axis')
        v = _numbers(v, f'motion.{kind}')
        try:
            if kind == 'rocking':
                if not v['period_s'] > 0:
                    raise InputError('motion.rocking: period_s must be above zero', 'e.g. 10')
                w = 2 * np.pi / v['period_s']
                data[f'gyro_{axis}'] += v['amplitude_deg'] * DEG * w * np.cos(w * t)
            elif kind == 'constant_rate':
                data[f'gyro_{axis}'] += v['deg_s'] * DEG
            else:
                wave = np.sin(2 * np.pi * v['frequency'] * t)
                data[f'accel_{axis}'] += v['amplitude'] * wave
        except KeyError as error:
            raise InputError(
                f'motion.{kind}: {error.args[0]} is missing or unknown',
                'see imu_noise simulate --help',
            ) from None


def _stack(data, sensor):
    names = [f'{sensor}_{c}' for c in 'xyz']
    return np.column_stack([data[a] for a in names]) if names[0] in data else None
