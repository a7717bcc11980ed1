# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A course that one power of time explains is not two effects; two effects are none."""

import numpy as np
import pytest
from scipy.fft import idct

import hidden
from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.loop.diagnosis import diagnose
from imu_noise_tools.loop.effect import model_of
from imu_noise_tools.loop.findings import failures
from imu_noise_tools.loop.prediction import State
from imu_noise_tools.noise import nameless
from imu_noise_tools.noise.course import course, left_by_a_course
from imu_noise_tools.noise.gather import gather
from imu_noise_tools.noise.problem import NoiseProblem
from imu_noise_tools.tasks.noise import analyse_record

N, DT = 6000, 0.04
T = np.arange(N) * DT
U = T / (N * DT)
SIZE = 1e-3
BASE = 'white', 'flicker', 'random_walk'


def record_of(mean, rng):
    """Return a record of which the first axis has a mean, in standard deviations of a sample."""
    white = SIZE * rng.standard_normal((N, 3))
    white[:, 0] += hidden.flicker(N, DT, SIZE / 60, rng) + SIZE * mean
    return ImuRecord(white, None, T, 1 / DT)


def said_of(mean, names, seed):
    """Return what is said against the last of some effects that explain a mean together."""
    record = record_of(mean, np.random.default_rng([seed, 41]))
    problem = NoiseProblem(gather(record, ['gyro_x'])['gyro_x'])
    fit = problem.point(model_of('noise', (*BASE, *names)))
    return nameless.course_instead(problem.evidence, fit, fit.model[fit.model.labels[-1]], 30.0)


CREEPS = [np.log1p(U / 4e-4), 8 * U ** (1 / 3), np.log1p(U / 5e-3)]
TWO = [(3 * np.exp(-U / 0.1) + 4 * U - 6 * U**2, ('transient', 'drift')),
       (3 * np.exp(-U / 0.05) + 4 * U, ('transient', 'ramp')),
       (2.0 * (U > 0.3) - 3 * np.exp(-U / 0.15), ('transient', 'step')),
       (2 * np.sin(9 * U) + 4 * U, ('slow_periodic', 'ramp'))]


@pytest.mark.parametrize('kind', [0, 1, pytest.param(2, marks=pytest.mark.thorough)])
def test_a_power_of_time_is_not_two_effects(kind):
    said = said_of(CREEPS[kind], ('transient', 'drift'), kind)
    assert 'power of time' in said, said


@pytest.mark.parametrize('names', [('slow_periodic', 'slow_periodic'), pytest.param(
    ('slow_periodic', 'ramp'), marks=pytest.mark.thorough)])
def test_a_cubic_is_not_two_effects(names):
    """It has a bend within the record, as no power of time since before it has."""
    said = said_of(30 * (U - 0.45) ** 3 - 2 * U, names, 3)
    assert said.startswith('a cubic of time'), said


@pytest.mark.parametrize('kind', [0, 2, *(
    pytest.param(k, marks=pytest.mark.thorough) for k in (1, 3))])
def test_two_effects_are_no_power_of_time(kind):
    assert said_of(*TWO[kind], kind) == ''


@pytest.mark.parametrize(('mean', 'name'), [
    (3 * np.exp(-U / 0.1), 'transient'), (4 * U + 4 * U**2, 'drift')])
def test_one_effect_that_a_power_of_time_explains_as_well_keeps_its_name(mean, name):
    """An exponential and a parabola are powers of time as well, with a parameter more."""
    assert said_of(mean, (name,), 7) == ''


def red(rng):
    """Return noise of a power that goes with 1/f^3 from a third of the slowest frequency on."""
    f = np.fft.rfftfreq(4 * N, DT)
    z = rng.standard_normal((2, len(f))).T @ [1, 1j]
    y = np.fft.irfft(z * (f**2 + (0.3 / (N * DT)) ** 2) ** -0.75)[:N]
    return 20 * (y - np.mean(y)) / np.std(y)


def beside_a_knee(mean, rng):
    """Return what is said against each of two swings, of what moves a mean, beside a knee."""
    problem = NoiseProblem(gather(record_of(mean, rng), ['gyro_x'])['gyro_x'])
    fit = problem.point(model_of(
        'noise', ('white', 'flicker', 'random_walk', 'slow_periodic', 'slow_periodic')))
    return [nameless.beside_a_knee(problem.evidence, fit, label, 150.0)
            for label in fit.model.labels[3:]]


@pytest.mark.parametrize('seed', [1, *(
    pytest.param(k, marks=pytest.mark.thorough) for k in (0, 6))])
def test_swings_that_imitate_redder_noise_are_none_though_they_hold_it_where_it_is(seed):
    rng = np.random.default_rng([seed, 5])
    assert all(said.startswith('beside a knee') for said in beside_a_knee(red(rng), rng))


@pytest.mark.thorough
def test_a_drift_gains_beside_a_knee_no_more_than_the_knee_alone_leaves_to_it():
    """In redder noise a parabola holds a knee where there is room for both."""
    rng = np.random.default_rng([9, 9])
    f = np.fft.rfftfreq(4 * N, DT)
    y = np.fft.irfft(rng.standard_normal((2, len(f))).T @ [1, 1j]
                     * (f**2 + (0.5 / (N * DT)) ** 2) ** -0.75)[:N]
    y = 20 * (y - np.mean(y)) / np.std(y)
    problem = NoiseProblem(gather(record_of(y, rng), ['gyro_x'])['gyro_x'])
    base = ('white', 'flicker', 'random_walk')
    claim = next(f.gain for f in problem.candidates(problem.fit(model_of('noise', base)))
                 if f.name == 'drift')
    fit = problem.point(model_of('noise', (*base, 'drift')))
    steepness, gain = nameless._gains_beside_a_knee(problem.evidence, fit, ['drift'])
    assert 1.2 < steepness < 2 and 0 <= gain < claim


def test_a_swing_in_redder_noise_gains_beside_a_knee_what_both_gain_over_that():
    """Taken out of a fit that had it, without another fit, it seemed to gain twice as much."""
    rng, n, dt = np.random.default_rng([19, 5]), 20_000, 0.01
    f, t = np.arange(n) / (2 * n * dt), np.arange(n) * dt
    x = idct(np.append(0, rng.standard_normal(n)[1:])
             * (f**2 + (0.5 / (n * dt)) ** 2) ** -0.75, type=2, norm='ortho')
    y = rng.standard_normal((n, 3))
    y[:, 0] += 10 * x / np.std(x) + 4 * np.sin(2 * np.pi * 5.3 * t / (n * dt))
    record = ImuRecord(SIZE * y, None, t, 1 / dt)
    problem = NoiseProblem(gather(record, ['gyro_x'])['gyro_x'])
    fit = problem.point(model_of('noise', (*BASE, 'slow_periodic')))
    steepness, gain = nameless._gains_beside_a_knee(problem.evidence, fit, ['slow_periodic'])
    assert 1.2 < steepness < 1.6 and 0 <= gain < 40


@pytest.mark.thorough
# of four; one of the swings of the fourth is taken for a knee of steepness 4
@pytest.mark.parametrize('seed', [0, 2])
def test_swings_that_are_there_stay_beside_a_knee(seed):
    rng = np.random.default_rng([seed, 6])
    hum = np.convolve(rng.standard_normal(N), np.cos(0.3 * np.arange(60)) / 4, 'same')
    mean = 10 * np.sin(2 * np.pi * U / 0.7) + 6 * np.sin(2 * np.pi * U / 0.31 + 1) + hum
    assert beside_a_knee(mean, rng) == ['', '']


def test_a_course_is_its_mean_over_each_block():
    t = np.linspace(2.0, 398.0, 100)
    fine = np.arange(40_000) * 0.01 + 0.005
    for power, since in ((0.01, 0.3), (-1.2, 5.0), (3.0, 40.0)):
        y = ((1 + fine / since) ** power).reshape(100, -1).mean(axis=1)
        x = course(t, power, since)
        y = y - np.mean(y)
        np.testing.assert_allclose(x / np.ptp(x), y / np.ptp(y), atol=2e-3)


def test_a_cubic_is_its_mean_over_each_block_and_leaves_nothing_but_noise():
    rng, t = np.random.default_rng(5), np.linspace(0.5, 199.5, 200)
    fine = (np.arange(20_000) + 0.5) * 0.01
    y = (1e-5 * (fine - 90) ** 3 - 0.03 * fine).reshape(200, -1).mean(axis=1)
    left, words = left_by_a_course(t, y, np.ones((200, 1)), np.eye(200))
    assert left < 1e-12 * float(y @ y) and words == 'a cubic of time'
    left, words = left_by_a_course(t, y + rng.standard_normal(200), np.ones((200, 1)), np.eye(200))
    assert words == 'a cubic of time' and abs(left - 0.5 * 196) < 3 * np.sqrt(0.5 * 196)


def test_nothing_but_noise_is_left_by_a_course_that_is_one():
    rng, t = np.random.default_rng(4), np.linspace(0.5, 199.5, 200)
    y = 5 * np.log1p(t / 0.7) + rng.standard_normal(200)
    left, words = left_by_a_course(t, y, np.ones((200, 1)), np.eye(200))
    assert 'power' in words
    assert abs(left - 0.5 * 196) < 3 * np.sqrt(0.5 * 196)


@pytest.mark.thorough
@pytest.mark.parametrize('seed', [2, 3])     # of six; four were a transient and a drift
def test_a_creep_is_not_a_transient_with_a_drift(seed):
    rng = np.random.default_rng([seed, 44])
    mean = rng.uniform(1, 4) * (
        np.log1p(U / rng.uniform(3e-4, 3e-3)) if seed % 2 else 4 * U ** (1 / 3))
    said = analyse_record(record_of(mean, rng), axes=('gyro_x',), keep_motion=True).diagnose(
        ['gyro_x'])['gyro_x']
    assert not said.found and said.remaining is not None, said.found


@pytest.mark.thorough
def test_a_creep_that_a_random_walk_holds_is_not_sufficient():
    """The Allan curve fits, with ten times the K there is; with slow cosines in its place not."""
    rng = np.random.default_rng(12)
    for size, holds in ((0.0, True), (12.0, False)):
        mean = size * np.log1p(40 * U)
        problem = NoiseProblem(gather(record_of(mean, rng), ['gyro_x'])['gyro_x'])
        fit = problem.fit(model_of('noise', ('white', 'flicker', 'random_walk')))
        found = problem.matters(fit)
        assert found.sufficient == holds and ('random_walk.K' in found.moved) != holds
        assert ('random_walk.K' in str(found)) != holds


LONG = 30_000
V = (np.arange(LONG) + 0.5) / LONG
NAMELESS = {     # sizes in standard deviations of a sample
    'logarithm': (0.3, np.log1p(V / 2e-3)), 'stretched': (0.4, np.exp(-(V / 0.1) ** 0.5)),
    'two': (0.4, np.exp(-V / 0.03) + 1.2 * np.exp(-V / 0.35)), 'root': (1.0, np.sqrt(V)),
    's': (2.0, np.tanh((V - 0.5) / 0.12))}


def course_beside_noise(size, mean, k=0.0, seed=0):
    """Return the problem of an axis of white noise, flicker, a walk of such a K and a mean."""
    rng, dt = np.random.default_rng([seed, 43]), 0.02
    x = SIZE * rng.standard_normal((LONG, 3))
    x[:, 0] += hidden.flicker(LONG, dt, SIZE / 100, rng) + hidden.random_walk(LONG, dt, k, rng)
    x[:, 0] += SIZE * size * (mean - np.mean(mean)) / max(np.std(mean), 1e-300)
    record = ImuRecord(x, None, dt * np.arange(LONG), 1 / dt)
    return NoiseProblem(gather(record, ['gyro_x'])['gyro_x'])


def failing_of(problem, *names):
    """Return the tests of a model that fail, by name."""
    return {f.name: f for f in failures(problem.omnibus(problem.point(model_of('noise', names))))}


@pytest.mark.thorough
@pytest.mark.parametrize('kind', NAMELESS)
def test_a_slow_course_that_a_walk_holds_fails_a_test_of_its_own(kind):
    """As smooth as it is in time, the spectrum is much that of a walk, and may well hold."""
    for seed in range(2):
        problem = course_beside_noise(*NAMELESS[kind], seed=seed)
        tests = failing_of(problem, *BASE)
        assert tests['course'].view == 'time' and 'cosines' in tests['course'].evidence
        assert set(tests) == {'course'} or kind in ('root', 's')


@pytest.mark.thorough
def test_a_walk_that_holds_a_nameless_course_is_not_said_to_be_all():
    """A transient is refused, for a power of time does better; the walk is not what it says."""
    problem = course_beside_noise(*NAMELESS['stretched'])
    fit = problem.fit(model_of('noise', BASE))
    said = diagnose(State(problem, fit, problem.held_out(fit.model)))
    assert said.verdict == 'unknown' and not said.sufficient
    assert said.remaining is not None and said.remaining.failed[0].name == 'course'
    assert 'random_walk.K' in problem.matters(fit).moved


@pytest.mark.thorough
def test_noise_that_wanders_is_no_course():
    """A walk that is most of what moves, faint to strong, and flicker without a walk."""
    for seed, k in enumerate((0.0, 1e-6, 1e-5, 1e-5, 1e-4, 1e-4, 1e-3, 1e-3)):
        problem = course_beside_noise(0.0, V, k, seed)
        assert 'course' not in failing_of(problem, *BASE), (seed, k)
    # it is weighed by the walk of the model: without one the same mean is a course
    assert 'course' in failing_of(problem, 'white', 'flicker')


def creeps(seed):
    """Return a record of which all axes creep, each by its own size."""
    rng = np.random.default_rng([seed, 43])
    white = SIZE * rng.standard_normal((N, 3))
    creep = np.log1p(U / 10 ** rng.uniform(-3, -1.5))
    for axis, size in enumerate(rng.uniform(1.5, 4, 3) * rng.choice([-1, 1], 3)):
        white[:, axis] += hidden.flicker(N, DT, SIZE / 60, rng) + SIZE * size * creep
    return ImuRecord(white, None, T, 1 / DT)


@pytest.mark.thorough
@pytest.mark.parametrize('seed', range(6))
def test_what_axes_creep_by_together_is_no_noise_that_they_share(seed):
    study = analyse_record(creeps(seed), effects=BASE, keep_motion=True, axes=['gyro_x'])
    found = study.diagnose()['gyro_x']
    assert 'shared_noise' not in [f.name for f in found.found]


@pytest.mark.thorough
@pytest.mark.parametrize('seed', range(4))
def test_noise_that_axes_share_beside_a_warm_up_is_no_course(seed):
    """The others tell the warm-up as well, so that it may be theirs."""
    rng = np.random.default_rng([seed, 44])
    white = SIZE * rng.standard_normal((N, 3))
    shared = hidden.decay(N, DT, 0.3 * SIZE, 1.5, rng)
    for axis in range(3):
        white[:, axis] += hidden.flicker(N, DT, SIZE / 60, rng) + shared \
            + SIZE * rng.uniform(2, 4) * np.exp(-U / 0.1)
    record = ImuRecord(white, None, T, 1 / DT)
    study = analyse_record(record, effects=BASE, keep_motion=True, axes=['gyro_x'])
    names = [f.name for f in study.diagnose()['gyro_x'].found]
    assert 'shared_noise' in names and not {*names} - {'shared_noise', 'transient'}
