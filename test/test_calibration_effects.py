# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every calibration effect against the sessions' own physics, and the loop that looks for it."""

from __future__ import annotations

from dataclasses import replace

import calibration_sessions as sim
import numpy as np
from params import daily, seldom
import pytest

from imu_noise_tools import calibration as core
from imu_noise_tools.calibration import flexible, telling
from imu_noise_tools.calibration.effects import Regressor, Scatter
from imu_noise_tools.calibration.linear import Equations
from imu_noise_tools.calibration.turn_problem import arrays_of, problems
from imu_noise_tools.core.errors import FitError
from imu_noise_tools.loop.diagnosis import diagnose
from imu_noise_tools.loop.effect import find_effect, registry
from imu_noise_tools.loop.prediction import State
from imu_noise_tools.loop.study import Study
from imu_noise_tools.report.words import diagnosis_in_words
from imu_noise_tools.tasks import calibration as tasks

DEG = np.pi / 180
DEVICE = ('quadratic', 'cubic', 'asymmetry', 'temperature', 'g_sensitivity')


def table(rng, device, rates=(30, 100, 200)):
    """Return a rate table: each axis up and down, both ways, several rates, changing heat."""
    rows = [(way * r * DEG * axis, up * sim.G * axis) for axis in np.eye(3) for up in (1, -1)
            for way in (1, -1)
            for r in rates]
    inputs, force = (np.array([row[k] for row in rows]) for k in (0, 1))
    t = rng.uniform(15, 45, len(rows))
    size = np.linalg.norm(inputs, axis=1, keepdims=True)
    true = size * sim.tilted(inputs / size, 0.05 * DEG, rng)
    poses = core.Poses.of('gyro', device.output(true, rng, t, force).T, device.noise, 200 * DEG,
                          inputs.T,
                          force=force.T, temperature=t, reference_temperature=25.0)
    return core.CalibrationProblem(poses, 'wls', 0.05 * DEG)


def spread(rng, device, n=24):
    """Return poses in all directions, fitted by magnitude."""
    out = device.output(sim.G * sim.spread_directions(n, rng), rng)
    return core.CalibrationProblem(core.Poses.of('accel', out.T, device.noise, sim.G), 'norm')


def placed(rng, device, tilt=1.0, times=1):
    """Return faces held so many times, tilted each time anew; 1 deg is stated."""
    names, directions = sim.faces(times)
    out = device.output(sim.G * sim.tilted(directions, tilt * DEG, rng), rng)
    return core.CalibrationProblem(core.Poses.of('accel', out.T, device.noise, sim.G,
                                                 sim.G * directions.T, names=names))


def verdict(problem):
    """Return the diagnosis of the base model."""
    return diagnose(State(problem, problem.fit(core.base_model()),
                          problem.held_out(core.base_model())))


@pytest.mark.parametrize('name', DEVICE)
def test_columns_are_the_physics(name):
    """What a device does with an effect is what its columns times its values say."""
    rng = np.random.default_rng(0)
    device = sim.Device(noise=0.0)
    problem = table(rng, device)
    cls = find_effect('calibration', name)
    value = rng.uniform(-1, 1, 9 if name == 'g_sensitivity' else 3) * 1e-2
    setattr(device, name, value.reshape(3, 3) if len(value) == 9 else value)
    p = problem.poses
    out = device.output(p.inputs.T, None, p.temperature, p.force.T).T
    np.testing.assert_allclose(p.inputs + cls().terms(p, np.eye(3)) @ value, out, atol=1e-12)


@pytest.mark.parametrize('name', list(registry('calibration')))
def test_every_effect_is_whole(name):
    """Each has its texts, unique parameters, finite columns, and poses that would show it."""
    cls = find_effect('calibration', name)
    assert all((cls.title, cls.equation, cls.signature, cls.hint, cls.reference, cls.symbol))
    assert len({p.name for p in cls.parameters}) == len(cls.parameters) > 0
    if name not in ('scale', 'cross_axis', 'bias'):
        assert cls.needs
    p = table(np.random.default_rng(1), sim.Device()).poses
    if issubclass(cls, Regressor):
        effect = cls.example()
        terms = effect.terms(p, np.eye(3))
        assert terms.shape == (3, p.n, len(effect.coefficients)) and np.isfinite(terms).all()
        assert (np.abs(terms).sum(axis=(0, 1)) > 0).all()
    else:
        assert issubclass(cls, Scatter)
        assert (np.linalg.eigvalsh(cls().covariance(p, np.eye(3), 0.01)) >= -1e-15).all()


def test_fitted_values_come_back():
    """An effect is estimated with its stated error: pulls over 40 sessions have variance one."""
    rng = np.random.default_rng(2)
    pulls = []
    for _ in range(40):
        device = sim.Device.drawn(rng, 'gyro', 1e-4)
        device.g_sensitivity = rng.uniform(-1e-4, 1e-4, (3, 3))
        fit = table(rng, device).fit(core.base_model() + find_effect('calibration',
                                                                     'g_sensitivity')())
        found = fit.estimates['g_sensitivity']
        pulls += [(found[f'D_{"xyz"[k]}{"xyz"[m]}'].point - device.g_sensitivity[k, m])
                  / found[f'D_{"xyz"[k]}{"xyz"[m]}'].std for k in range(3) for m in range(3)]
    assert np.std(pulls) == pytest.approx(1, abs=0.12) and abs(np.mean(pulls)) < 0.2


def hidden(name, make, rng, strength, sensor='gyro', noise=1e-4):
    """Return a problem with an effect so many standard errors large, its rival in the model."""
    device = sim.Device.drawn(rng, sensor, noise)
    model = core.base_model() + find_effect('calibration', name)()
    rival = {'quadratic': 'asymmetry', 'asymmetry': 'quadratic'}.get(name)
    if rival:
        model = model + find_effect('calibration', rival)()
    std = np.array([e.std for e in make(rng, device).fit(model).estimates[name].values()])
    draw = rng.uniform(-1, 1, len(std))
    if name == 'g_sensitivity':             # its isotropic part is what the Earth's rate does
        draw -= np.eye(3).ravel() * draw[[0, 4, 8]].mean()
    value = strength * draw / np.abs(draw / std).max()
    setattr(device, name, value.reshape(3, 3) if len(std) == 9 else value)
    return make(rng, device)


@pytest.mark.thorough
@pytest.mark.parametrize('name, make, sensor, noise', [
    ('quadratic', spread, 'accel', 1e-3), ('asymmetry', spread, 'accel', 1e-3),
    ('cubic', table, 'gyro', 1e-4), ('temperature', table, 'gyro', 1e-4),
    ('g_sensitivity', table, 'gyro', 1e-4)])
def test_hidden_effect_is_found(name, make, sensor, noise):
    """At 5 to 15 standard errors the verdict is right 9 times of 10, never another name."""
    rng = np.random.default_rng(3)
    found = [verdict(hidden(name, make, rng, rng.uniform(5, 15), sensor, noise)) for _
             in range(10)]
    right = [d.verdict == 'missing' and d.ranked[0].name == name for d in found]
    assert sum(right) >= 9, [(d.verdict, d.ranked[0].name) for d in found]
    assert all(d.verdict != 'missing' or d.ranked[0].name == name for d in found)


@pytest.mark.thorough
def test_hidden_tilt_is_found():
    """Faces put down four times each, off by 3 to 6 deg where 1 is stated."""
    rng = np.random.default_rng(4)
    for _ in range(6):
        tilt = rng.uniform(3, 6)
        d = verdict(placed(rng, sim.Device.drawn(rng), tilt, 4))
        assert d.verdict == 'missing' and d.ranked[0].name == 'tilt'
        angle = d.ranked[0].estimates['angle']
        assert angle.ci95[0] * 0.8 < tilt * DEG < angle.ci95[1] * 1.25


@pytest.mark.parametrize('make, sensor, noise', [
    (spread, 'accel', 1e-3), seldom(table, 'gyro', 1e-4), (placed, 'accel', 1e-3)])
def test_nothing_hidden_is_complete(make, sensor, noise):
    """At most one false alarm in 20 sessions of each kind."""
    rng = np.random.default_rng(5)
    found = [verdict(make(rng, sim.Device.drawn(rng, sensor, noise))).verdict for _ in range(20)]
    assert found.count('complete') >= 19, found


@pytest.mark.thorough
@pytest.mark.parametrize('name', ['quadratic', 'asymmetry'])
def test_twins_of_six_faces(name):
    """With six faces i^2 and |i| are one: undecidable, with the poses that would tell."""
    rng = np.random.default_rng(6)
    for _ in range(6):
        device = sim.Device.drawn(rng)
        model = core.base_model() + find_effect('calibration', name)()
        std = [e.std for e in placed(rng, device).fit(model).estimates[name].values()]
        setattr(device, name, rng.uniform(6, 15) * np.array(std))
        d = verdict(placed(rng, device))
        able = {f.name for f in d.ranked if f.gain > f.penalty}
        assert d.verdict == 'undecidable' and {'quadratic', 'asymmetry'} <= able
        assert '45 deg edges' in d.advice and 'quadratic' in d.advice and 'asymmetry' in d.advice


def test_what_cannot_be_seen_is_listed():
    """Six faces show neither cubic nor wrong gravity; a complete verdict says so."""
    rng = np.random.default_rng(7)
    problem = placed(rng, sim.Device.drawn(rng))
    blind = {name: why for name, why, _ in problem.blind(problem.fit(core.base_model()))}
    assert 'same' in blind['cubic'] and 'same' in blind['wrong_gravity']
    assert 'no temperature' in blind['temperature']
    d = verdict(problem)
    assert d.verdict == 'complete' and 'could not show cubic' in d.advice


def test_g_sensitivity_of_one_end_up():
    """
    Each axis up in turn, plus and minus: 6 of 9 parts are visible, none by itself.

    The bias keeps the mean.

    """
    rng = np.random.default_rng(8)
    inputs = np.vstack([np.eye(3), -np.eye(3)])
    force = sim.G * np.vstack([np.eye(3), np.eye(3)])
    device = sim.Device.drawn(rng, 'gyro', 1e-4)
    poses = core.Poses.of('gyro', device.output(inputs, rng, None, force).T, 1e-4, 1.0, inputs.T,
                          force=force.T)
    problem = core.CalibrationProblem(poses, tilt=0.001)
    found = {f.name: f for f in problem.candidates(problem.fit(core.base_model()))}
    assert '3 of its 9 cannot be seen' in found['g_sensitivity'].evidence
    fit = problem.fit(core.base_model() + find_effect('calibration', 'g_sensitivity')())
    assert all(e.value is None for e in fit.estimates['g_sensitivity'].values())
    assert any('not determined' in flag for flag in fit.flags)


def test_a_turn_left_out_leaves_its_axis_open_and_the_rest_sound():
    """One turn an axis and rests: without one, S of that axis is open, and nothing blows up."""
    rng = np.random.default_rng(20)
    inputs = np.vstack([np.eye(3), np.zeros((9, 3))])
    force = sim.G * np.vstack([np.eye(3)] * 4)
    device = sim.Device.drawn(rng, 'gyro', 1e-5)
    poses = core.Poses.of('gyro', device.output(inputs, rng, None, force).T, 1e-5, 1.0, inputs.T,
                          force=force.T)
    problem = core.CalibrationProblem(poses)
    for name in ('earth_rate', 'g_sensitivity', 'quadratic'):
        model = core.base_model() + find_effect('calibration', name)()
        for to_fit, to_score in problem.split():
            fit = to_fit.fit(model)
            assert np.abs(fit.details.scale).max() < 2
            assert all(np.isfinite(v.pull).all() for v in to_score.score(fit).views.values())


def test_error_of_left_out_poses_falls_for_the_right_one_alone():
    """The ladder in eight sessions: the right effect, a wrong one (by chance in 8 % of them)."""
    rng = np.random.default_rng(9)
    by_chance = 0
    for _ in range(8):
        study = Study.begin({'gyro': hidden('temperature', table, rng, 12)}, core.base_model())
        right, = study.add(['temperature'])
        assert right.fall > 20 and right.held_out < study.history[0].held_out
        wrong, = study.add(['cubic'])
        by_chance += wrong.fall > 4
    assert by_chance <= 3


def test_ladder_of_a_study():
    """Diagnose, add, add what is not there, remove: each rung is there and the verdicts follow."""
    rng = np.random.default_rng(19)
    study = Study.begin({'gyro': hidden('temperature', table, rng, 15)}, core.base_model())
    assert study.diagnose()['gyro'].verdict == 'missing'
    assert [s.added for s in study.add()] == ['temperature']
    study.add(['cubic'])
    study.remove('cubic')
    assert study.diagnose()['gyro'].verdict == 'complete'
    assert [(s.added, s.removed) for s in study.history] == [
        (None, None), ('temperature', None), ('cubic', None), (None, 'cubic')]


def test_adding_what_is_not_there_is_null():
    """A null amplitude with its limit, for columns and for scatter."""
    rng = np.random.default_rng(10)
    problem = placed(rng, sim.Device.drawn(rng), 1.0, 3)
    fit = problem.fit(core.base_model() + find_effect('calibration', 'quadratic')()
                      + find_effect('calibration', 'repeatability')())
    for e in [*fit.estimates['quadratic'].values(), *fit.estimates['repeatability'].values()]:
        assert e.value is None and e.upper95 > 0 and e.ci95[0] <= 0 <= e.ci95[1]


def test_unknown_pose():
    """One pose that fits nothing: unknown, and it is named with its time."""
    rng = np.random.default_rng(11)
    problem = spread(rng, sim.Device.drawn(rng))
    outputs = problem.poses.outputs.copy()
    outputs[:, 7] *= 1.01
    d = verdict(replace(problem, poses=replace(problem.poses, outputs=outputs)))
    assert d.verdict in ('unknown', 'undecidable')
    assert any('pose 8' in f.evidence for f in d.failed)


def test_arrays_come_back():
    """A problem survives the arrays of a study's evidence."""
    rng = np.random.default_rng(12)
    for problem in (table(rng, sim.Device()), spread(rng, sim.Device())):
        back = problems(arrays_of({problem.target: problem}))[problem.target]
        assert back.method == problem.method and back.tilt == problem.tilt
        assert back.poses.names == problem.poses.names
        np.testing.assert_array_equal(back.fit(core.base_model()).details.cov,
                                      problem.fit(core.base_model()).details.cov)


def test_an_effect_of_a_users_own(tmp_path):
    """Twelve lines in a file: a quintic term, found by its name."""
    from imu_noise_tools.loop import effect
    file = tmp_path / 'quintic.py'
    file.write_text("""
from imu_noise_tools.calibration.effects import OWN, Regressor
from imu_noise_tools.loop.effect import Parameter

class Quintic(Regressor):
    name = 'quintic'
    symbol, title, equation, signature = 'v', 'quintic', 'o_k = v_k i_k^5', 'ends off'
    hint, reference, needs = 'mine', 'mine', 'inputs of several sizes'
    parameters = tuple(Parameter(f'v_{k}', '1/({rate})^4', -1, 1, log=False, amplitude=True)
                       for k in 'xyz')
    feeds = OWN

    def columns(self, poses):
        return poses.rates ** 5
""")
    assert effect.load_effects(file) == ['quintic']
    try:
        rng = np.random.default_rng(13)
        problem = spread(rng, sim.Device.drawn(rng), 60)
        u = problem.fit(core.base_model()).details.inputs
        outputs = problem.poses.outputs + np.array([[4e-7], [0], [0]]) * u ** 5
        d = verdict(replace(problem, poses=replace(problem.poses, outputs=outputs)))
        assert 'quintic' in [f.name for f in d.ranked[:2]]
    finally:
        effect._REGISTRY['calibration'].pop('quintic')


def over_time(rng, n=24, temperature=None, late=None, **device):
    """Return poses in all directions, 8 s each; ``late`` (n, 3) adds to the outputs."""
    sensor = sim.Device.drawn(rng, noise=3e-4, upper=True)
    for name, value in device.items():
        setattr(sensor, name, value)
    out = sensor.output(sim.G * sim.spread_directions(n, rng)[rng.permutation(n)], rng,
                        temperature) + (0.0 if late is None else late)
    poses = core.Poses.of('accel', out.T, sensor.noise, sim.G, time=8.0 * np.arange(n),
                          temperature=temperature, reference_temperature=25.0)
    return core.CalibrationProblem(poses, 'norm'), sensor


@pytest.mark.thorough
def test_a_step_between_poses_is_found_at_its_time():
    """By name and not as scatter; the bias is the one after it, and its time is held."""
    rng = np.random.default_rng(11)
    for k in (6, 15):
        jump = np.where(np.arange(24)[:, None] >= k, [0.0, 0.01, -0.005], 0.0)
        problem, sensor = over_time(rng, late=jump)
        d = verdict(problem)
        assert (d.verdict, [f.name for f in d.found], d.remaining) == ('missing', ['step'], None)
        at = d.found[0].estimates['t']
        assert at.ci95 == (8.0 * (k - 1), 8.0 * k) and at.ci95[0] < at.value < at.ci95[1]
        fit = problem.fit(core.base_model() + find_effect('calibration', 'step')())
        np.testing.assert_allclose(fit.details.bias, sensor.bias + jump[-1], atol=1e-3)
        assert fit.estimates['step']['j_y'].point == pytest.approx(0.01, abs=1e-3)
        study = Study.begin({'accel': problem}, core.base_model(), {'gravity': sim.G})
        study.complete()
        assert b'<html' in tasks.outputs(study)['report.html'].encode()


@pytest.mark.thorough
def test_names_with_fewer_coefficients_that_explain_as_much_are_sure():
    """Heat that settles is no warm-up of its own, and a line in time none: 10 sessions each."""
    rng, t = np.random.default_rng(12), 8.0 * np.arange(24)
    heat = 25 + 9 * (1 - np.exp(-t / 110))
    for name, made in (
            ('temperature', {'temperature': heat,
                             'late': np.outer(heat - 25, [6e-3, -4e-3, 8e-3])}),
            ('drift', {'late': np.outer(t, [1e-4, -5e-5, 8e-5])})):
        said = [verdict(over_time(rng, **made)[0]) for _ in range(10)]
        right = [d.verdict == 'missing' and [f.name for f in d.found] == [name] for d in said]
        assert sum(right) >= 8, [d.advice for d in said]


@pytest.mark.thorough
def test_of_two_effects_neither_is_taken_for_what_did_its_work_alone():
    """Beside the cubic the line in temperature does what the warm-up did of both without it."""
    rng, t = np.random.default_rng(13), 8.0 * np.arange(24)
    heat = 25 + 9 * (1 - np.exp(-t / 110))
    for _ in range(3):
        d = verdict(over_time(rng, temperature=heat, late=np.outer(heat - 25, [6e-3, -4e-3, 8e-3]),
                              cubic=(-4e-5, -5e-5, -3e-5))[0])
        assert {f.name for f in d.found} == {'temperature', 'cubic'} and d.remaining is None


@pytest.mark.thorough
def test_advice_names_rivals_alone():
    """What is told apart is no rival, and where no freedom is left the number of poses is."""
    rng = np.random.default_rng(14)
    names, directions = sim.faces(4)
    device = sim.Device.drawn(rng, noise=1e-4)
    device.quadratic = (3e-3, -2e-3, 2e-3)
    out = device.output(sim.G * np.array(directions), rng)
    d = verdict(core.CalibrationProblem(core.Poses.of(
        'accel', out.T, 1e-4, sim.G, sim.G * np.array(directions).T, names=names,
        time=8.0 * np.arange(24)), 'wls', 0.0))
    assert d.verdict == 'undecidable'
    assert 'cannot tell' in d.advice and {'quadratic', 'asymmetry'} == {
        w.strip(';') for w in d.advice.split('; record')[0].split()
        } & set(registry('calibration'))
    d = verdict(over_time(rng, 12, quadratic=(8e-4, -4e-4, 5e-4))[0])
    assert d.verdict == 'undecidable' and '12 poses leave 3 degrees of freedom' in d.advice


def test_equations_too_large_to_be_solved_are_refused():
    """A fit on its way to infinity ends in words."""
    with pytest.raises(FitError, match='diverges'):
        Equations(np.full((4, 1), 1e200), np.ones(4), np.arange(4), (('bias', 'b_x'),), []).theta


def scattered(rng, kind, n=40, size=0.01):
    """Return poses in all directions that are off by what has no name, or by scatter, m/s^2."""
    device = sim.Device.drawn(rng, upper=True)
    u = sim.spread_directions(n, rng)[rng.permutation(n)].T
    out = device.output(sim.G * u.T, rng).T
    if kind == 'scatter':
        out += size * rng.normal(size=out.shape)
    elif kind == 'before':      # what the axis did in the pose before
        out[:, 1:] += size * np.sign(u[:, :-1])
    elif kind == 'others':      # the product of the two other axes' inputs
        out += 3 * size * np.array([[1.0], [-0.8], [0.9]]) * u[[1, 2, 0]] * u[[2, 0, 1]]
    else:
        turns = 2 * np.pi * (1.3 * np.arange(n) / n + 0.1)
        out += 1.5 * size * np.array([[1.0], [-0.6], [0.8]]) * np.sin(turns)
    return core.CalibrationProblem(core.Poses.of('accel', out, device.noise, sim.G,
                                                 time=8.0 * np.arange(n) + 3), 'norm')


@pytest.mark.thorough
@pytest.mark.parametrize('kind, words, advice', [
    ('others', 'it is a function of direction', 'another order'),
    ('time', 'it is a course in time', 'temperature')])
def test_what_follows_direction_or_time_is_no_scatter(kind, words, advice):
    """What has no name is unknown; scatter does not stand for it, nor does any other name."""
    rng = np.random.default_rng(31)
    found = [verdict(scattered(rng, kind)) for _ in range(2)]
    assert [d.verdict for d in found] == ['unknown'] * 2
    for d in found:
        against = next(f.against for f in d.ranked if f.name == 'repeatability')
        assert words in against and words in d.advice and advice in d.advice


@pytest.mark.parametrize('kind', daily(['scatter', 'before'], 'scatter'))
def test_scatter_stays_scatter(kind):
    """What is drawn anew in each pose, or follows the one before, keeps its name."""
    rng = np.random.default_rng(32)
    found = [verdict(scattered(rng, kind)) for _ in range(6)]
    assert [[f.name for f in d.found] for d in found] == [['repeatability']] * 6
    few = verdict(scattered(rng, kind, 24))
    assert 'too few to tell it from a function of direction' in few.advice


@pytest.mark.thorough
@pytest.mark.parametrize('n', [13, 14, 16, 20])
def test_few_poses_that_scatter_are_seldom_something_else(n):
    """What leaves nothing to confirm it, or does so only beside others, is no name."""
    rng = np.random.default_rng([34, n])
    wrong = 0
    for _ in range(8):
        d = verdict(scattered(rng, 'scatter', n))
        names = {f.name for f in d.found}
        wrong += bool(names - {'repeatability'})
        if d.verdict == 'undecidable':
            assert 'repeatability' in [f.name for f in d.ranked if f.gain > f.penalty]
    assert wrong <= 3   # most of them were, up to 16 poses


@pytest.mark.thorough
def test_chance_of_a_smooth_course_is_what_it_says():
    """Of 60 sessions of scatter as many look like a course as stated, some 3 at one in twenty."""
    rng = np.random.default_rng(33)
    model = core.base_model() + find_effect('calibration', 'repeatability')()
    chance = []
    for _ in range(60):
        problem = scattered(rng, 'scatter', 20)
        fit = problem.fit(model)
        poses = problem.poses.with_inputs(fit.details.inputs)
        chance.append(flexible.course_of(fit.details.equations, poses, 0.0).chance)
    assert np.mean(np.array(chance) < 0.05) < 0.15
    assert np.mean(chance) == pytest.approx(0.5, abs=0.12)


def test_six_faces_say_what_hides_in_the_bias():
    """A quadratic of 1 % of g is complete in six faces, and the verdict says that it would be."""
    rng = np.random.default_rng(34)
    device = sim.Device.drawn(rng)
    device.quadratic = (1e-3, -6e-4, 8e-4)
    names, directions = sim.faces()
    out = device.output(sim.G * sim.tilted(directions, 2 * DEG, rng), rng)
    problem = core.calibrate(core.Poses.of('accel', out.T, device.noise, sim.G)).problem
    blind = {name: why for name, why, _ in problem.blind(problem.fit(core.base_model()))}
    assert problem.method == 'faces' and 'same' in blind['cubic']
    assert 'same' in blind['wrong_gravity']
    assert all('hides in bias (\u00b10.' in blind[k] for k in ('quadratic', 'asymmetry'))
    d = verdict(problem)
    assert d.verdict == 'complete'
    assert 'quadratic' in d.advice and 'hold only without' in d.advice


def test_poses_in_all_directions_hide_no_shape():
    """What is told well beside bias and scale is not among what could not be shown."""
    problem = spread(np.random.default_rng(35), sim.Device.drawn(np.random.default_rng(35)), 40)
    blind = [name for name, _, _ in problem.blind(problem.fit(core.base_model()))]
    assert not {'quadratic', 'asymmetry', 'cubic'} & set(blind)


def told(rng, more=()):
    """Return the diagnosis of faces, edges and corners with an asymmetry, and of more poses."""
    cube = np.array([s for s in np.ndindex(3, 3, 3)], float) - 1
    cube = cube[np.abs(cube).sum(axis=1) > 0]
    directions = np.array([*cube, *more])
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    device = sim.Device.drawn(rng, upper=True)
    device.asymmetry = (3e-3, 0.0, -2.2e-3)
    out = device.output(sim.G * sim.tilted(directions, 1 * DEG, rng), rng).T
    return verdict(core.CalibrationProblem(core.Poses.of('accel', out, device.noise, sim.G),
                                           'norm'))


def test_undecidable_says_what_helps_and_what_does_not_hold():
    """Edges that are held are not advised again; the poses that are do tell the two."""
    d = told(np.random.default_rng(36))
    assert d.verdict == 'undecidable'
    said = diagnosis_in_words(d)
    assert set(said.removeprefix('undecidable: ').split(' or ')) == {'quadratic', 'asymmetry'}
    assert '45 deg edges' not in d.advice and '22 deg off the face' in d.advice
    assert 'intervals do not hold' in d.advice and 'add asymmetry moves bias by up to' in d.advice
    between = telling.sets()['directions halfway between a face and an edge (22 deg off the face)']
    found = [told(np.random.default_rng(k), between.T) for k in range(4)]
    assert [d.ranked[0].name for d in found] == ['asymmetry'] * 4
    assert [d.verdict for d in found].count('missing') >= 3
