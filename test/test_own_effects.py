# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What holds for every effect of every domain, and for a copy of it in a file of the user's own.

A copy under another name does what its original does, to the last digit: so nothing in the package
goes by the name of an effect.

"""

from __future__ import annotations

import pickle

from calibration_sessions import Device, faces
import numpy as np
from params import daily
import pytest
import yaml

from imu_noise_tools import calibration, store
from imu_noise_tools.calibration import CalibrationProblem, Poses, Regressor, Scatter
from imu_noise_tools.core.errors import ImuNoiseError
from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.filter import FilterProblem, Motion
from imu_noise_tools.filter.problem import START
from imu_noise_tools.loop.domains import DOMAINS
from imu_noise_tools.loop.effect import find_effect, load_effects, Model, model_of, registry
from imu_noise_tools.noise.gather import gather
from imu_noise_tools.noise.kinds import Inputs
from imu_noise_tools.noise.problem import NoiseProblem

EVERY = [(d, n) for d in DOMAINS for n in registry(d)]
COPIES = '''
from imu_noise_tools.loop.domains import DOMAINS
from imu_noise_tools.loop.effect import registry

for domain in DOMAINS:
    for name, original in list(registry(domain).items()):
        class Copy(original):
            name = f'copy_of_{name}'
'''
every = pytest.mark.parametrize(('domain', 'name'), EVERY, ids=[f'{d}-{n}' for d, n in EVERY])


@pytest.fixture(scope='module')
def copies(tmp_path_factory):
    """Load a copy of every effect from a file, and forget them afterwards."""
    from imu_noise_tools.loop import effect
    before = {d: dict(known) for d, known in effect._REGISTRY.items()}
    path = tmp_path_factory.mktemp('own') / 'copies.py'
    path.write_text(COPIES)
    assert len(load_effects(path)) == len(EVERY)
    yield
    effect._REGISTRY.clear()
    effect._REGISTRY.update(before)


# --- every effect --------------------------------------------------------------------------------

@every
def test_an_effect_says_what_it_is(domain, name):
    cls = find_effect(domain, name)
    assert cls.domain == domain and cls.lineage() == (name,)
    for said in (cls.symbol, cls.title, cls.equation, cls.signature, cls.hint, cls.reference):
        assert said, 'a person reads it'
    names = [p.name for p in cls.parameters]
    assert len(set(names)) == len(names)
    for p in cls.parameters:
        assert p.title and p.lower < p.upper and (p.choices or not p.log or p.lower > 0)
        assert p.unit and cls.parameter(p.name) is p


@every
def test_an_example_is_a_value(domain, name):
    e = find_effect(domain, name).example()
    assert e.fitted and all(p.lower <= e[p.name] <= p.upper for p in e.parameters)
    assert pickle.loads(pickle.dumps(e)) == e and hash(e) == hash(type(e)(e.values))
    text = store.dump_yaml({'effect': e.name, **e.written()})
    data = yaml.safe_load(text)
    assert find_effect(domain, data.pop('effect'))(data) == e
    model = Model([e])
    if e.several:
        assert (model + e).labels == [name, f'{name}.2']
    else:
        with pytest.raises(ImuNoiseError, match=name):
            model + e


@pytest.mark.parametrize('name', list(registry('filter')))
def test_a_filter_effect_can_do_what_it_says(name):
    e = find_effect('filter', name).example()
    b = e.block(0.01)
    assert e.kind == ('motion' if isinstance(e, Motion) else 'noise')
    assert e.jumps == (b.jitter > 0 or any(
        x is not None for x in (b.step, b.outliers, b.switching)))
    assert (b.r > 0) == bool(e.variance) and (not e.variance or b.r == e[e.variance])
    assert e.scales or b.r_factor == 1
    assert {e.line, *e.measured} - {''} <= {p.name for p in e.parameters}
    assert not e.line or e.parameter(e.line).unit == 'Hz'
    z = np.random.default_rng(0).standard_normal(500)
    read = e.read(z, 0.01)
    changed = {k for k in e.values if read[k] != e[k]}
    assert set(e.measured) <= changed and (changed == set() or e.measured)


@pytest.mark.parametrize('name', list(registry('calibration')))
def test_a_calibration_effect_has_columns_or_scatter(name):
    e, poses = find_effect('calibration', name)(), the_poses()
    if isinstance(e, Regressor):
        assert e.terms(poses, np.eye(3)).shape == (3, poses.n, len(e.coefficients))
    else:
        assert isinstance(e, Scatter) and len(e.parameters) == 1
        low, high = e.bounds(poses, np.eye(3))
        assert 0 < low < high
        cov = e.covariance(poses, np.eye(3), low)
        assert cov.shape == (poses.n, 3, 3) and np.linalg.eigvalsh(cov).min() > -1e-9 * cov.max()


# --- copies --------------------------------------------------------------------------------------

def the_record(effect, n=6000, dt=0.02) -> ImuRecord:
    """Return a record at rest with an effect in it, with temperature and accelerometer."""
    rng = np.random.default_rng(4)
    t = np.arange(n) * dt
    gyro = 6e-4 * rng.standard_normal((n, 3))
    accel = 5e-3 * rng.standard_normal((n, 3)) + [0, 0, 9.8]
    covariates = {'temperature': 25 + np.cumsum(rng.standard_normal(n)) * 0.01}
    axes = {f'{s}_{c}': a[:, i] for s, a in (('gyro', gyro), ('accel', accel))
            for i, c in enumerate('xyz')}
    gyro[:, 0] = effect.apply(gyro[:, 0], Inputs(t, dt, covariates, axes), rng)
    return ImuRecord(gyro, accel, t, 1 / dt, covariates=covariates)


def the_poses():
    """Return poses of an accelerometer: faces twice, and edges between."""
    rng = np.random.default_rng(2)
    edges = np.array([[a, b, c] for a in (-1, 0, 1) for b in (-1, 0, 1) for c in (-1, 0, 1)
                      if abs(a) + abs(b) + abs(c) == 2]) / np.sqrt(2)
    inputs = 9.80665 * np.vstack([faces(2)[1], edges])
    temperature = np.linspace(20, 40, len(inputs))
    out = Device.drawn(rng).output(inputs, rng)
    return Poses.of('accel', out.T, 1e-3, 9.80665, inputs.T, temperature=temperature,
                    time=np.arange(len(inputs)) * 10.0)


def same(first, second, name):
    """Assert that two fits differ in a label only."""
    assert first.log_likelihood == pytest.approx(second.log_likelihood, rel=1e-9)
    for label, found in first.estimates.items():
        other = second.estimates[label.replace(name, f'copy_of_{name}')
                                 if label.startswith(name) else label]
        for key, e in found.items():
            for k in ('value', 'std', 'upper95', 'point'):
                x, y = getattr(e, k), getattr(other[key], k)
                if x is None or y is None:
                    assert x is y, (key, k)
                else:
                    assert x == pytest.approx(y, rel=1e-9, abs=1e-30), (key, k)


def alike_or_refused(first, second, name) -> bool:
    """Assert that two fits are the same, or refused in the same words; tell whether they are."""
    if isinstance(first, str):
        assert first == second.replace(f'copy_of_{name}', name)
        return False
    same(first, second, name)
    return True


def alike(findings, name):
    """Assert that a candidate and its copy stand alike."""
    a, b = ([f for f in findings if f.name == n] for n in (name, f'copy_of_{name}'))
    assert len(a) == len(b)
    for x, y in zip(a, b):
        assert (x.gain, x.penalty) == pytest.approx((y.gain, y.penalty), rel=1e-9)
        assert x.view == y.view and x.evidence == y.evidence.replace(f'copy_of_{name}', name)
    return bool(a)


def fitted(problem, names):
    """Return the fit of a model of these names, or why there is none."""
    try:
        return problem.fit(model_of(problem.domain, names))
    except ImuNoiseError as error:
        return error.message


@pytest.mark.parametrize('name', daily(registry('noise'), 'sinusoid'))
def test_a_copy_of_a_noise_effect(name, copies):
    cls = find_effect('noise', name)
    problem = NoiseProblem(gather(the_record(cls.example()), ['gyro_x'])['gyro_x'])
    base = ['white'] if name != 'white' else ['random_walk']
    fits = [fitted(problem, [*base, n]) for n in (name, f'copy_of_{name}')]
    alike_or_refused(*fits, name)
    alike(problem.candidates(fitted(problem, base)), name)


@pytest.mark.parametrize('name', [n for n in registry('calibration')
                                  if n not in calibration.effects.BASE])
def test_a_copy_of_a_calibration_effect(name, copies):
    problem = CalibrationProblem(the_poses())
    base = calibration.effects.BASE
    fits = [fitted(problem, [*base, n]) for n in (name, f'copy_of_{name}')]
    if alike_or_refused(*fits, name):
        first, second = (problem.held_out(f.model) for f in fits)
        assert first.excess == pytest.approx(second.excess, rel=1e-9)
    alike(problem.candidates(problem.fit(calibration.base_model())), name)


@pytest.mark.parametrize(
    'name', daily(registry('filter'), 'outliers'))
def test_a_copy_of_a_filter_effect(name, copies):
    """In place of its original where that is of the base, beside the base elsewhere."""
    rng = np.random.default_rng(5)
    t = 0.01 * np.arange(800)
    z = 0.01 * rng.standard_normal(800) + 0.3 * np.sin(0.8 * np.pi * t)
    z[::97] += 0.2
    z += 0.05 * np.sin(2 * np.pi * 17.3 * t)
    stated = {k: {'R': 1e-4} for k in ('white', 'copy_of_white')}
    problem = FilterProblem(z, 0.01, stated=stated if name == 'noise_level' else {})
    models = [[n if m == name else m for m in START] if name in START else [*START, n]
              for n in (name, f'copy_of_{name}')]
    one, two = (fitted(problem, m) for m in models)
    same(one, two, name)
    scores = [problem.held_out(f.model).excess for f in (one, two)]
    assert scores[0] == pytest.approx(scores[1], rel=1e-9)


def test_copies_are_candidates_of_a_filter_as_their_originals_are(copies, monkeypatch):
    """The gain of a few, which stand for all: a jump, a line, a factor on what is stated."""
    rng = np.random.default_rng(6)
    z = 0.014 * rng.standard_normal(800) + 0.05 * np.sin(34.6 * np.pi * np.arange(800) / 100)
    problem = FilterProblem(z, 0.01, stated={'white': {'R': 1e-4}})
    some = ('sinusoid', 'noise_level', 'gauss_markov')
    known = dict(registry('filter'))
    wanted = {n for s in some for n in (s, f'copy_of_{s}')}
    from imu_noise_tools.filter import problem as module
    monkeypatch.setattr(module, 'registry',
                        lambda _: {k: v for k, v in known.items() if k in wanted})
    found = problem.candidates(problem.fit(model_of('filter', START)))
    assert all([alike(found, name) for name in some])
