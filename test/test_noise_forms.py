# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Effects in the forms they take: where they are the error falls, elsewhere they are null."""

from __future__ import annotations

from dataclasses import replace
import pickle

import numpy as np
from params import daily, seldom
import pytest
from scipy.fft import dct, idct
from scipy.signal import butter, iirnotch, lfilter

import hidden
from imu_noise_tools.core.errors import FitError
from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.core.spectrum import bins_of, cosine_transform, power
from imu_noise_tools.loop.diagnosis import diagnose
from imu_noise_tools.loop.effect import find_effect, Finding, Model, model_of
from imu_noise_tools.loop.findings import failures
from imu_noise_tools.loop.prediction import fall_of, State
from imu_noise_tools.loop.verdict import FALL
from imu_noise_tools.noise import flexible, Inputs, rivals, shared, slow_part
from imu_noise_tools.noise.block_means import time
from imu_noise_tools.noise.candidates import candidates, clear_of_less
from imu_noise_tools.noise.doubts import at_bound, of_levels
from imu_noise_tools.noise.dwells import two_levels
from imu_noise_tools.noise.evidence import REMEMBERED
from imu_noise_tools.noise.gather import gather
from imu_noise_tools.noise.in_time import beside, variance
from imu_noise_tools.noise.likelihood import Likelihood
from imu_noise_tools.noise.measured import penalty, with_measured
from imu_noise_tools.noise.normality import differences_of, octaves_of, pieces
from imu_noise_tools.noise.problem import NoiseProblem, where_to_look
from imu_noise_tools.noise.response import open_response, Order
from imu_noise_tools.noise.starts import _background
from imu_noise_tools.noise.views import p_value

BASE = ('white', 'flicker', 'random_walk')


def evidence_of(x, rate, **covariates):
    """Return what is kept of samples (n,) of one axis; the others are dead, and not looked at."""
    record = ImuRecord(np.outer(x, [1, 0, 0]), None, np.arange(len(x)) / rate, rate,
                       covariates=covariates)
    return gather(record, ['gyro_x'])['gyro_x']


def problem_of(names, seed=3, strength=5.0):
    """Return the problem of a gyroscope axis that holds these effects."""
    record, truth = hidden.draw(np.random.default_rng([seed, 11]), names, strength=strength,
                                hours=0.5, rate_hz=20.0)
    alone = replace(record, gyro=record.gyro * [1, 0, 0])
    return NoiseProblem(gather(alone, ['gyro_x'])['gyro_x']), truth.hidden['gyro_x']


def test_a_filter_of_nothing_is_refused():
    with pytest.raises(FitError, match='no noise that low_pass could filter: add white'):
        problem_of([])[0].fit(model_of('noise', ('low_pass', 'ramp')))


@pytest.mark.thorough
@pytest.mark.parametrize('name', ['harmonics', 'narrowband', 'slow_periodic', 'shock'])
def test_what_is_there_lowers_the_error(name):
    problem, _ = problem_of([name])
    before, after = (problem.held_out(model_of('noise', m)) for m in (BASE, (*BASE, name)))
    assert fall_of(before, after, [find_effect('noise', name)()]) > FALL


@pytest.mark.parametrize('name', daily(
    ['harmonics', 'narrowband', 'slow_periodic', 'drift', 'shock'], 'harmonics', 'drift'))
def test_what_is_not_there_is_null_or_small(name):
    """Null with an upper limit, or no more than chance allows."""
    problem, _ = problem_of([])
    fit = problem.fit(model_of('noise', (*BASE, name)))
    for p in fit.model[name].parameters:
        e = fit.estimates[name][p.name]
        if p.amplitude and e.value is not None:
            assert e.std and abs(e.value) < 4.5 * e.std, p.name


@pytest.mark.parametrize('skew, orders', [seldom(0.0, {1.0}), (0.5, {2.0, 3.0})])
def test_a_swing_has_the_harmonics_that_it_shows_and_they_are_no_second_one(skew, orders):
    rng, n, dt = np.random.default_rng(5), 20_000, 0.05
    t = dt * np.arange(n)
    turn = 2 * np.pi * t / (0.37 * t[-1]) + 1
    gyro = 1e-3 * rng.standard_normal((n, 3))
    x = gyro[:, 0] + 3e-4 * np.cos(turn + skew * np.sin(turn))
    problem = NoiseProblem(evidence_of(x, 1 / dt))
    fit = problem.point(model_of('noise', (*BASE, 'slow_periodic')))
    assert fit.model['slow_periodic']['orders'] in orders
    assert fit.model['slow_periodic']['period'] == pytest.approx(0.37 * t[-1], rel=0.02)
    second = problem.point(model_of('noise', (*BASE, 'slow_periodic', 'slow_periodic')))
    assert second.details.ml - fit.details.ml < penalty('slow_periodic')


@pytest.mark.parametrize('swing', daily([
    (1.17, 4.5, 1e-3), (1.4, 3.0, 1.5e-3), (1.64, 4.1, 2e-3), (1.94, 3.1, 3e-3)],
    (1.94, 3.1, 3e-3)))
def test_part_of_a_skewed_swing_is_one_with_harmonics_and_nothing_beside_it(swing):
    """A sine leaves what a drift or a second sine explains, with every confidence."""
    periods, phase, size = swing
    rng, n, dt = np.random.default_rng(round(100 * periods)), 20_000, 0.05
    t = dt * np.arange(n)
    turn = 2 * np.pi * t / (periods * t[-1]) + phase
    gyro = 1e-3 * rng.standard_normal((n, 3))
    x = gyro[:, 0] + size * np.cos(turn + 0.5 * np.sin(turn))
    problem = NoiseProblem(evidence_of(x, 1 / dt))
    alone = model_of('noise', (*BASE, 'slow_periodic'))
    fit = problem.point(alone)
    assert fit.model['slow_periodic']['orders'] > 1
    for name in ('drift', 'ramp', 'slow_periodic'):
        more = problem.point(model_of('noise', (*BASE, 'slow_periodic', name)))
        assert more.details.ml - fit.details.ml < penalty(name)


@pytest.mark.thorough
@pytest.mark.parametrize('swing', [
    (1.33, 0.7, 1e-3), (1.75, 3.8, 3e-3), (1.92, 0.1, 7e-4)])
def test_half_a_swing_is_a_sine_and_not_its_harmonics(swing):
    """A form with harmonics comes nearer to a sine whose period is not among those tried."""
    periods, phase, size = swing
    rng, n, dt = np.random.default_rng(round(100 * periods)), 20_000, 0.05
    t = dt * np.arange(n)
    gyro = 1e-3 * rng.standard_normal((n, 3))
    x = gyro[:, 0] + size * np.cos(2 * np.pi * t / (periods * t[-1]) + phase)
    problem = NoiseProblem(evidence_of(x, 1 / dt))
    swing, = (f for f in problem.candidates(problem.point(model_of('noise', BASE)))
              if f.name == 'slow_periodic')
    assert swing.gain > swing.penalty and not swing.against
    assert swing.effect['orders'] == 1
    assert swing.effect['period'] == pytest.approx(periods * t[-1], rel=0.1)


@pytest.mark.parametrize('course', [lambda x: x**4, seldom(lambda x: np.exp(-6 * x))])
def test_a_course_that_axes_have_in_common_is_no_noise(course):
    """It comes in a few pieces, where noise of however few frequencies comes in many."""
    rng, n, dt = np.random.default_rng(8), 20_000, 0.05
    x = np.arange(n) / n
    gyro = 1e-3 * rng.standard_normal((n, 3))
    gyro += 0.03 * course(x)[:, None] / np.std(course(x)) * [1.0, 0.7, -0.9]
    record = ImuRecord(gyro, None, dt * np.arange(n), 1 / dt)
    axes = ('gyro_x', 'gyro_y', 'gyro_z')
    problem = NoiseProblem(gather(record, axes)['gyro_x'])
    fit = problem.point(model_of('noise', (*BASE, 'shared_noise')))
    shared_noise = fit.model['shared_noise']
    assert pieces(differences_of(octaves_of(problem.evidence, fit, shared_noise))) < 64
    assert 'no noise' in problem.shape(fit, 'shared_noise', 50.0) or \
        'not normal' in problem.shape(fit, 'shared_noise', 50.0)


def test_what_columns_leave_next_to_nothing_of_has_a_level():
    """Where the slow end is left with nothing, by the columns' doing, nothing is divided by it."""
    bins = problem_of([])[0].evidence.whole.bins
    power = np.where(bins.f < 0.05, 1e-300, 1.0)
    level = _background(bins, power)
    assert np.all(np.isfinite(level)) and np.all(level > 0)
    assert np.median(level) == pytest.approx(1.0, rel=0.2)


@pytest.mark.thorough
@pytest.mark.parametrize('kind, holds', [
    ('filter', True), ('one axis', False), ('each its own', False)])
def test_white_noise_behind_one_pole_is_told_from_a_relaxation_by_the_other_axes(kind, holds):
    """Beside a floor both have one spectrum; a filter is the same in every axis of the sensor."""
    rng, n, dt = np.random.default_rng(41), 40_000, 0.01
    pole = np.exp(-0.3)
    gyro = np.zeros((n, 3))
    for axis, ratio in enumerate({'filter': (300, 300, 300), 'one axis': (300, 0, 0),
                                  'each its own': (300, 60, 1500)}[kind]):
        passed = lfilter([1 - pole], [1, -pole], rng.standard_normal(n + 500))[500:]
        gyro[:, axis] = 1e-4 * (np.sqrt(ratio) * passed + rng.standard_normal(n))
    record = ImuRecord(gyro, None, dt * np.arange(n), 1 / dt)
    problem = NoiseProblem(gather(record, ['gyro_x'])['gyro_x'])
    found = {f.name: f for f in problem.candidates(problem.point(model_of('noise', BASE)))}
    low_pass, relaxation = found['low_pass'], found['gauss_markov']
    assert (low_pass.gain - low_pass.penalty > relaxation.gain - relaxation.penalty + 5) == holds
    if holds:
        assert low_pass.effect['behind'] == pytest.approx(1 / 301, rel=0.3)
        assert low_pass.effect['cutoff'] == pytest.approx(0.3 / (2 * np.pi * dt), rel=0.05)


@pytest.mark.thorough
@pytest.mark.parametrize('run', [1, 3])
def test_one_filter_is_told_by_the_other_axes_where_messages_are_repeated(run):
    """At random, which fills what it left empty: in each axis the same share of its own noise."""
    rng, n, dt = np.random.default_rng(42), 60_000, 0.1
    pole, fresh = np.exp(-0.15), np.arange(n)
    fresh[np.convolve(rng.random(n) < 0.3 / run, np.ones(run))[:n] > 0] = 0
    passed = lfilter([1 - pole], [1, -pole], rng.standard_normal((n + 500, 3)), axis=0)[500:]
    gyro = (passed + 0.05 * rng.standard_normal((n, 3))) * [1e-4, 3e-4, 5e-5]
    gyro = gyro[np.maximum.accumulate(fresh)]
    record = ImuRecord(gyro, None, dt * np.arange(n), 1 / dt)
    problem = NoiseProblem(gather(record, ['gyro_x'])['gyro_x'])
    fit = problem.point(model_of('noise', (*BASE, 'duplicates')))
    found = {f.name: f for f in problem.candidates(fit)}
    gains = [found[name].gain - found[name].penalty for name in ('low_pass', 'gauss_markov')]
    assert fit.model['duplicates']['fraction'] == pytest.approx(0.3, abs=0.05)
    assert found['low_pass'].effect.knees and gains[0] > gains[1] + 5


@pytest.mark.thorough
def test_a_refit_that_finds_another_place_is_no_gain_of_what_was_measured():
    """What was caught elsewhere before any refit frees, by no doing of the effect."""
    rng, n, dt = np.random.default_rng(6), 20_000, 0.01
    gyro = 1e-5 * np.round(100 * rng.standard_normal((n, 3)))
    problem = NoiseProblem(evidence_of(gyro[:, 0], 1 / dt))
    fit = problem.point(model_of('noise', BASE))
    caught = replace(fit, details=replace(fit.details, v=1.1 * fit.details.v))
    gains = []
    for before in (fit, caught):
        problem.tried.clear()
        gains += [f.gain for f in candidates(problem, before) if f.name == 'rate_quantization']
    assert len(gains) == 2 and abs(gains[1] - gains[0]) < 2


@pytest.mark.parametrize('more, holds', [(2.4, False), (7.0, True)])
def test_a_drift_is_named_where_it_is_clear_of_a_ramp(more, holds):
    ramp, drift = (find_effect('noise', name).example() for name in ('ramp', 'drift'))
    some = [Finding('ramp', 95.0, ramp, penalty=6.4),
            Finding('drift', 95.0 + more, drift, penalty=7.5)]
    assert [not f.against for f in clear_of_less(some)] == [True, holds]
    assert not any(f.against for f in clear_of_less(some[1:]))


@pytest.mark.parametrize('names', [
    seldom(['slow_periodic']), ['slow_periodic', 'ramp', 'transient'],
    seldom(['low_pass']), ['low_pass', 'duplicates']])
def test_the_likelihood_falls_as_its_derivatives_say(names):
    """Of a mean, of a filter and what leaks past it, or what holding samples fills of it."""
    problem, _ = problem_of(names)
    model = problem.point(model_of('noise', (*BASE, *names))).model
    likelihood = Likelihood(problem.evidence, 'whole', model)
    x = np.array([s.to_search(model[s.label][s.parameter.name]) for s in likelihood.slots]) + 0.3
    _, linear, v, each = likelihood.value(x)
    gradient, _ = likelihood.derivatives(x, linear, v, each)
    for j, expected in enumerate(gradient):
        step = 1e-3 * (np.arange(len(x)) == j)
        change = likelihood.value(x + step)[0] - likelihood.value(x - step)[0]
        assert change / 2e-3 == pytest.approx(expected, rel=0.02, abs=0.02)


def test_columns_that_come_to_say_the_same_are_no_likelier_for_it():
    """Two swings of periods ever nearer fit as a swing and its slope do, and no better."""
    problem, _ = problem_of(['slow_periodic'])
    model = problem.point(model_of('noise', (*BASE, 'slow_periodic', 'slow_periodic'))).model
    likelihood = Likelihood(problem.evidence, 'whole', model)
    x = np.array([s.to_search(model[s.label][s.parameter.name]) for s in likelihood.slots])
    first, second = (j for j, s in enumerate(likelihood.slots) if s.parameter.name == 'period')
    values = []
    for apart in (1e-2, 1e-3, 1e-4):
        x[second] = x[first] + apart
        values.append(likelihood.value(x)[0])
    assert np.ptp(values) < 0.5


@pytest.mark.parametrize('seed', range(2))
def test_a_filter_that_leaves_next_to_nothing_at_the_end_of_the_spectrum_is_followed_there(seed):
    """A digital one has a zero at Nyquist: a floor of 1e-9 of the noise failed by 20 there."""
    x = np.random.default_rng([seed, 83]).standard_normal((20_500, 3))
    y = 1e-3 * lfilter(*butter(2, 42.0, fs=400.0), x, axis=0)[500:]
    record = ImuRecord(y, None, np.arange(len(y)) / 400, 400.0)
    problem = NoiseProblem(gather(record, ['gyro_x'])['gyro_x'])
    fit = problem.point(model_of('noise', ('white', 'low_pass')))
    assert fit.model['low_pass']['cutoff'] == pytest.approx(42.0, rel=0.03)
    (said,) = (f for f in problem.omnibus(fit) if f.name == 'frequency')
    assert said.p_value > 1e-3, said


@pytest.mark.parametrize(('power', 'place', 'where'), [
    (0.0, (9.0, 11.0), ''), (1e8, (24.999, 25.0), '25 Hz')])
def test_where_power_is_missing_there_is_nothing_to_look_for(power, place, where):
    """A machine at 10 Hz was to be looked for where a notch is; one at one place is at that."""
    c = np.fft.rfft(np.random.default_rng(84).standard_normal(40_000))
    f = np.fft.rfftfreq(40_000, 1 / 50)
    c[(f >= place[0]) & (f <= place[1])] *= np.sqrt(power)
    y = np.random.default_rng(85).standard_normal((40_000, 3))
    y[:, 0] = np.fft.irfft(c)
    problem = NoiseProblem(gather(ImuRecord(y, None, np.arange(40_000) / 50, 50.0),
                                  ['gyro_x'])['gyro_x'])
    tests = {t.name: t for t in failures(problem.omnibus(problem.point(
        model_of('noise', ('white',)))))}
    assert {'frequency', 'shape'} <= set(tests)
    assert tests['shape'].where == where
    assert bool(tests['frequency'].where) == bool(where)
    assert where_to_look([tests['shape'], tests['frequency']]) == (
        f'Look for what turns or swings at {where}.' if where else '')


@pytest.mark.thorough
@pytest.mark.parametrize('form', ['runs', 'slower'])
def test_samples_held_in_runs_or_by_a_slower_clock_are_named_and_nothing_remains(form):
    """In runs of six, or by a sensor that measures at 0.7 times the rate it is read with."""
    rng, rate, n = np.random.default_rng(8), 50.0, 60_000
    sensor, k = hidden.draw_sensor(rng), np.arange(n)
    y = np.column_stack([hidden.base_noise(n, 1 / rate, sensor, rng) for _ in range(3)])
    held = np.convolve(rng.random(n) < 0.004, np.ones(6))[:n] > 0
    at = np.maximum.accumulate(np.where(held, 0, k)) if form == 'runs' \
        else np.floor(np.floor(k * 0.7 + 1e-9) / 0.7 + 1e-9).astype(int)
    problem = NoiseProblem(gather(ImuRecord(y[at], None, k / rate, rate), ['gyro_x'])['gyro_x'])
    fit = problem.fit(model_of('noise', BASE))
    found = diagnose(State(problem, fit, problem.held_out(fit.model)))
    assert [f.name for f in found.found] == ['duplicates'] and found.remaining is None


@pytest.mark.thorough
@pytest.mark.parametrize('name, filters', [('notch', iirnotch(0.3, 1.5)),
                                           ('low_pass', butter(2, 0.4))])
def test_a_filter_is_named_before_samples_that_are_held_at_random(name, filters):
    rng, rate, n = np.random.default_rng(9), 50.0, 90_000
    sensor = hidden.draw_sensor(rng)
    y = np.column_stack([lfilter(*filters, hidden.base_noise(n, 1 / rate, sensor, rng))
                         for _ in range(3)])
    at = np.maximum.accumulate(np.where(rng.random(n) < 0.35, 0, np.arange(n)))
    record = ImuRecord(y[at], None, np.arange(n) / rate, rate)
    problem = NoiseProblem(gather(record, ['gyro_x'])['gyro_x'])
    fit = problem.fit(model_of('noise', BASE))
    found = diagnose(State(problem, fit, problem.held_out(fit.model)))
    assert {f.name for f in found.found} == {'duplicates', name} and found.remaining is None


def test_runs_are_told_from_what_rounding_makes_equal():
    rng, n = np.random.default_rng(4), 40_000
    held = np.convolve(rng.random(n) < 0.018, np.ones(4))[:n] > 0
    held[0] = False
    y = np.round(14 * rng.standard_normal(n))[
        np.maximum.accumulate(np.where(held, 0, np.arange(n)))]
    kept = find_effect('noise', 'duplicates').statistics(y, Inputs(np.arange(n), 1.0))
    assert kept['expected'] > 0.018 and kept['run'] == 4 and not kept['regular']


@pytest.mark.parametrize('share, size, named', [(0.46, 20, True), seldom(3.0, 20, False),
                                                (0.45, 2, True)])
def test_a_transient_near_its_bound_is_one_where_the_record_tells(share, size, named):
    """It settles in nearly half of the record, or in what is no more than a ramp."""
    n, dt = 8000, 0.1
    t = np.arange(n) * dt
    x = np.random.default_rng(2).standard_normal((n, 3))
    x[:, 0] += size * np.exp(-t / (share * n * dt)) / min(share, 1)
    evidence = evidence_of(x[:, 0], 1 / dt)
    fit = NoiseProblem(evidence).point(model_of('noise', ('white', 'transient')))
    said = at_bound(evidence, fit.model['transient'], fit.estimates['transient'])
    assert said == ('' if named else 'its tc lies at its bound, 400 s')


@pytest.mark.thorough
def test_a_second_step_lands_beside_the_first():
    """Up at 400 s and down at 1100 s, ten standard deviations of a block mean each."""
    rng, rate, n = np.random.default_rng(5), 20.0, 36_000
    sensor = hidden.draw_sensor(rng)
    t = np.arange(n) / rate
    y = hidden.base_noise(n, 1 / rate, sensor, rng)
    size = 25 * sensor['B']
    y = y + size * ((t >= 400) & (t < 1100))
    problem = NoiseProblem(evidence_of(y, rate))
    fit = problem.fit(model_of('noise', (*BASE, 'step', 'step')))
    times = sorted(fit.model[k]['time'] for k in ('step', 'step.2'))
    assert abs(times[0] - 400) < 5 and abs(times[1] - 1100) < 5


@pytest.mark.thorough
def test_up_and_down_again_is_two_steps():
    """One of them alone leaves more than half of what it claims: a pair is tried as one."""
    rng, rate, n = np.random.default_rng([22, 1]), 100.0, 12_000
    t = np.arange(n) / rate
    x = 2e-4 * rng.standard_normal((n, 3))
    x[:, 0] += 2.5e-4 * ((t >= 15) & (t < 78))
    problem = NoiseProblem(gather(ImuRecord(x, None, t, rate), ['gyro_x'])['gyro_x'])
    fit = problem.fit(model_of('noise', BASE))
    found = diagnose(State(problem, fit, problem.held_out(fit.model)))
    assert [f.name for f in found.found] == ['step', 'step'] and found.remaining is None


@pytest.mark.parametrize(('form', 'width', 'size'), [
    ('displacement', 6.3, 5e-4), ('velocity', 6.3, 5e-4), ('folded', 2.0, 4e-3)])
def test_a_broad_resonance_is_told_as_displacement_or_velocity_or_folded(form, width, size):
    """Near Nyquist they differ: of velocity nothing is left there; a faint one is not folded."""
    rng, rate, n, f0 = np.random.default_rng(78), 100.0, 40_000, 41.8
    r, f = np.exp(-np.pi * width / rate), f0
    if form == 'folded':
        f += 3 * rate
        noise = rng.standard_normal((2, n))
        ring = lfilter([1], [1, -r * np.exp(2j * np.pi * f / rate)], noise[0] + 1j * noise[1]).real
    else:
        ring = lfilter([1, 0, -1] if form == 'velocity' else [1],
                       [1, -2 * r * np.cos(2 * np.pi * f / rate), r * r], rng.standard_normal(n))
    x = 1e-3 * rng.standard_normal((n, 3))
    evidence = evidence_of(x[:, 0] + size * ring / np.std(ring), rate)
    found = NoiseProblem(evidence).point(model_of('noise', ['white', 'narrowband']))
    assert found.model['narrowband'].chosen('form') == form and not found.details.set_aside
    assert found.model['narrowband']['frequency'] == pytest.approx(f0, rel=0.02)
    assert found.model['narrowband']['rms'] == pytest.approx(size, rel=0.1)


@pytest.mark.parametrize(('share', 'size'), [
    seldom(0.02, 29.0), (0.02, 8.0), (0.001, 12.0)])
def test_many_spikes_have_their_rate_and_size(share, size):
    rng, rate, n = np.random.default_rng(6), 50.0, 60_000
    x = rng.standard_normal((n, 3))
    x[:, 0] += size * rng.standard_normal(n) * (rng.random(n) < share)
    found = find_effect('noise', 'spikes')().find(evidence_of(1e-3 * x[:, 0], rate))
    assert found.effect['sigma'] == pytest.approx(1e-3 * size, rel=0.2)
    assert found.effect['rate'] == pytest.approx(share * rate, rel=0.25)
    assert found.effect['nu'] == 0


@pytest.mark.parametrize('length', daily([5, 9], 5))
def test_spikes_that_come_in_bursts_are_found_and_taken_out(length):
    """Runs of samples of either sign, beside which the neighbours say nothing."""
    rng, rate, n = np.random.default_rng(12), 100.0, 60_000
    x = rng.standard_normal((n, 3))
    hit = np.convolve(rng.random(n) < 1e-3, np.ones(length))[:n] > 0
    x[hit, 0] += rng.choice([-1, 1], hit.sum()) * rng.uniform(7, 20, hit.sum())
    evidence = evidence_of(1e-3 * x[:, 0], rate)
    found = find_effect('noise', 'spikes')().find(evidence)
    count = found.effect['rate'] * n / rate
    assert count == pytest.approx(hit.sum(), rel=0.15)
    white = 1e-6 * 2 / rate     # one-sided, of the noise beneath
    assert np.median(evidence.whole.power[-20:]) == pytest.approx(white, rel=0.05)


@pytest.mark.parametrize('two_levels', [True, False])
def test_dwells_shorter_than_block_means_are_told_from_a_process_of_the_same_spectrum(two_levels):
    """Eight samples long where a block is of seven."""
    rng, rate, n, dwell = np.random.default_rng(13), 100.0, 120_000, 8
    if two_levels:
        y = 3 * (np.cumsum(rng.random(n) < 1 / dwell) % 2 - 0.5)
    else:
        phi = np.exp(-2 / dwell)
        y = lfilter([1], [1, -phi], 1.5 * np.sqrt(1 - phi**2) * rng.standard_normal(n))
    evidence = evidence_of(1e-3 * (y + rng.standard_normal((n, 3))[:, 0]), rate)
    fit = NoiseProblem(evidence).point(model_of('noise', ('white', 'rts')))
    bonus = fit.model['rts'].bonus(evidence, fit)
    assert bonus > 20 if two_levels else bonus < -20


@pytest.mark.parametrize('cutoff', daily([5.0, 8.0], 8.0))
def test_a_filter_is_found_beside_the_rounding_of_an_angle_behind_it(cutoff):
    """Without the filter white noise fills the middle, and the rounding is taken for less."""
    rng, rate, n = np.random.default_rng(16), 50.0, 60_000
    p = np.exp(-2 * np.pi * cutoff / rate)
    y = lfilter([1 - p], [1, -p], rng.standard_normal(n)) + np.diff(rng.uniform(-2, 2, n + 1))
    problem = NoiseProblem(evidence_of(1e-3 * y, rate))
    problem.point(model_of('noise', ('white', 'quantization')))
    fit = problem.point(model_of('noise', ('white', 'quantization', 'low_pass')))
    assert fit.model['low_pass']['cutoff'] == pytest.approx(cutoff, rel=0.15)


@pytest.mark.thorough
def test_a_machine_that_is_switched_on_hides_no_change_of_the_noise():
    """Beside its band what the noise does is seen: its own coming and going is none of that."""
    rng, rate, n = np.random.default_rng(17), 20.0, 80_000
    t = np.arange(n) / rate
    swing = lfilter([1], [1, -1.96 * np.cos(2 * np.pi * 4.0 / rate), 0.96], rng.standard_normal(n))
    on = (t > 0.3 * t[-1]) & (t < 0.55 * t[-1])
    y = rng.standard_normal(n) * np.where(t > 0.8 * t[-1], 1.4, 1.0) + 0.5 * on * swing
    problem = NoiseProblem(evidence_of(1e-3 * y, rate))
    fit = problem.point(model_of('noise', ('white', 'narrowband')))
    change = {f.name: f for f in problem.candidates(fit)}['variance_change']
    assert change.effect.chosen('form') == 'step' and not change.against
    assert change.effect['time'] == pytest.approx(0.8 * t[-1], rel=0.02)
    more = problem.point(model_of('noise', ('white', 'narrowband', 'variance_change')))
    assert p_value(variance(problem.evidence, more)) > 1e-3 > p_value(
        variance(problem.evidence, fit))


@pytest.mark.thorough
@pytest.mark.parametrize('n', [64 * 256 + 250, 100 * 256, 211 * 256 - 1])
def test_when_the_noise_changes_is_told_where_blocks_leave_samples(n):
    """Blocks of 64 samples leave 250 of 16 634, by which a time late in the record was off."""
    y = np.random.default_rng([19, n]).standard_normal(n)
    t = np.arange(n) / 50.0
    y[t >= 0.93 * n / 50] *= 3
    found = find_effect('noise', 'variance_change')().measure(evidence_of(1e-3 * y, 50.0))
    assert found.effect.chosen('form') == 'step'
    assert found.effect['time'] == pytest.approx(0.93 * n / 50, abs=0.5 * n / 50 / 256)


@pytest.mark.thorough
def test_where_noise_has_two_levels_bins_tell_less_of_a_smooth_form():
    """Of white noise of variance v(t) a mean of coefficients squared has 2 mean(v^2)/mean(v)^2."""
    n = 16_000
    y = np.random.default_rng(20).standard_normal(n)
    y[int(0.79 * n):] *= np.sqrt(95)
    problem = NoiseProblem(evidence_of(1e-3 * y, 50.0))
    fit = problem.point(model_of('noise', ('white', 'variance_change')))
    count = problem.evidence.whole.bins.count
    wide = count > 100
    weight = flexible.spectrum_left(problem.evidence, fit)[2][wide]
    uneven = (0.79 + 0.21 * 95**2) / (0.79 + 0.21 * 95) ** 2
    np.testing.assert_allclose(weight, 1 + (count[wide] - 1) / uneven, rtol=0.05)


@pytest.mark.thorough
@pytest.mark.parametrize('turn, told', [(0.1, False), (0.2, False), (0.5, True)])
def test_how_loud_the_error_of_a_counted_angle_is_says_nothing_where_it_is_a_swing(turn, told):
    """It goes with where the mean stands; of more than a third of a count it is noise."""
    rng, n, rate = np.random.default_rng(18), 40_000, 50.0
    t = np.arange(n) / rate
    louder = np.where((t > 0.6 * t[-1]) & told, 1.5, 1.0)
    angle = np.cumsum(0.4 * np.sin(2 * np.pi * t / 422) + turn * louder * rng.standard_normal(n))
    evidence = evidence_of(1e-3 * np.diff(np.round(angle)), rate)
    for names, free in ((('white', 'quantization'), told), (('white',), True)):
        found = beside(evidence, model_of('noise', names)).measured(
            find_effect('noise', 'variance_change')())
        assert bool(found and found.gain > 20) == free


@pytest.mark.thorough
def test_what_samples_say_against_a_finding_counts_where_chains_are_compared():
    """By its spectrum alone a telegraph is as good as the process that is there."""
    rng, n = np.random.default_rng(14), 60_000
    phi = np.exp(-0.05)
    y = lfilter([1], [1, -phi], np.sqrt(1 - phi**2) * rng.standard_normal(n))
    problem = NoiseProblem(evidence_of(1e-3 * (y + rng.standard_normal((n, 3))[:, 0]), 100.0))
    fit = problem.point(model_of('noise', ('white',)))
    found = {f.name: f for f in problem.candidates(fit)}
    assert found['rts'].elsewhere < -20 and found['gauss_markov'].elsewhere == 0
    assert found['rts'].gain - found['rts'].elsewhere == pytest.approx(
        found['gauss_markov'].gain, rel=0.02)


@pytest.mark.thorough
@pytest.mark.parametrize('two_levels', [True, False])
def test_a_grid_that_slow_noise_walks_over_is_no_telegraph(two_levels):
    """Rounded, what a filter lets through stays on a level; steps less than the grid's show."""
    rng, n = np.random.default_rng(15), 24_000
    if two_levels:
        y = 0.35 * rng.standard_normal(n) + dwelling(15, 4.0, n) / 5
    else:
        y = 2 * lfilter(*butter(2, 0.05), rng.standard_normal(n))
    evidence = evidence_of(1e-3 * np.round(y), 50.0)
    fit = NoiseProblem(evidence).point(model_of('noise', ('white', 'rts')))
    bonus = fit.model['rts'].bonus(evidence, fit)
    assert bonus > 20 if two_levels else bonus == 0


def dwelling(seed, dwell, n=12_000, rate=50.0):
    """Return two levels, four standard deviations of a sample apart, that last ``dwell`` s."""
    rng = np.random.default_rng(seed)
    return 4 * (np.cumsum(rng.random(n) < 1 / (dwell * rate)) % 2 - 0.5)


@pytest.mark.parametrize('far, own', [(1.2, True), (2.0, False)])
def test_a_step_no_further_than_levels_are_apart_is_one_of_their_jumps(far, own):
    """Dwells of half a second are no path of a record of minutes, and some of them are long."""
    y = 0.25 * dwelling(7, 0.5) + np.random.default_rng(70).standard_normal(12_000)
    evidence = evidence_of(1e-3 * y, 50.0)
    model = model_of('noise', ('white', 'rts')).with_values({'rts': {'step': 1e-3, 'tau': 0.5}})
    step = find_effect('noise', 'step')({'size': far * 1e-3, 'time': 100.0})
    assert ('jumps to and fro' in of_levels(evidence, model, step)) == own


@pytest.mark.thorough
@pytest.mark.parametrize('seed', [0, 2])
def test_long_dwells_are_read_from_the_path_and_leave_nothing_in_time(seed):
    """Fitted to the spectrum a random walk takes a telegraph of few switches for its own."""
    n, rate, dwell = 12_000, 50.0, 8.0
    rng = np.random.default_rng([seed, 1])
    y = dwelling(seed, dwell) + 2 * (np.arange(n) > 0.37 * n) + rng.standard_normal(n)
    evidence = evidence_of(1e-3 * y, rate)
    fit = NoiseProblem(evidence).point(
        model_of('noise', ('white', 'flicker', 'random_walk', 'rts')))
    rts = fit.model['rts']
    assert rts['step'] == pytest.approx(4e-3, rel=0.15)
    assert dwell / 2 < rts['tau'] < 2 * dwell
    assert rts.bonus(evidence, fit) > 20
    assert min(p_value(time(evidence, fit, known)) for known in ('odd', 'even')) > 1e-3


@pytest.mark.thorough
@pytest.mark.parametrize('louder', [1.0, 1.6])
@pytest.mark.parametrize('seed', [1, 3])
def test_jumps_between_levels_are_no_change_of_variance_and_hide_none(seed, louder):
    """They lie where they will: some stretch has more of them than others."""
    rng, n, rate = np.random.default_rng([seed, 92]), 30_000, 25.0
    noise = rng.standard_normal(n)
    noise[9_000:14_000] *= louder
    y = noise + 4 * dwelling(seed, 25.0, n, rate)
    evidence = evidence_of(1e-3 * y, rate)
    model = model_of('noise', ('white', 'rts', 'variance_change'))
    found = with_measured(evidence, model)[0]['variance_change']
    if louder == 1:
        assert found['factor'] == 1
    else:
        before, inside, behind = found.variance(np.array([180.0, 460.0, 900.0]))
        assert before == behind and inside / before == pytest.approx(louder**2, rel=0.1)


@pytest.mark.parametrize('of', daily(
    ((None, True, True), (0.2, True, True), (20.0, True, True), (20.0, False, True),
     (40.0, True, False)), (0.2, True, True), (40.0, True, False)))
def test_behind_a_filter_samples_tell_levels_that_outlast_what_it_remembers(of):
    """Both ways of predicting them are those of white noise."""
    deep, two, told = of
    rng, n, rate = np.random.default_rng(95), 60_000, 100.0
    noise = rng.standard_normal(n + 100)
    if deep:
        noise = lfilter(*iirnotch(30.0, 30.0 / deep, rate), noise)
    phi = np.exp(-2 / 5)
    levels = 2 * (np.cumsum(rng.random(n) < 1 / 5) % 2 - 0.5) if two else lfilter(
        [np.sqrt(1 - phi**2)], [1, -phi], rng.standard_normal(n))
    evidence = evidence_of(1e-3 * (noise[100:] + levels), rate)
    names = ('white', 'notch', 'rts') if deep else ('white', 'rts')
    fitted = NoiseProblem(evidence).point(model_of('noise', names))
    bonus = fitted.model['rts'].bonus(evidence, fitted)
    assert (bonus > 10 if two else bonus < -5) if told else bonus == 0, bonus


@pytest.mark.parametrize('often', daily((1.0, 2.0), 2.0))
def test_a_telegraph_that_switches_now_more_often_now_less_is_no_louder_noise(often):
    """Of dwells too short for a path; what the white noise does is seen above them."""
    n, rate = 120_000, 100.0
    rng = np.random.default_rng([93, int(10 * often)])
    faster = np.where(np.arange(n) < n // 2, 2.0 * often, 2.0)
    levels = 1.5e-3 * (np.cumsum(rng.random(n) < faster / rate) % 2 - 0.5)
    evidence = evidence_of(levels + 1e-3 * rng.standard_normal(n), rate)
    fitted = NoiseProblem(evidence).point(model_of('noise', ('white', 'rts')))
    assert fitted.model['rts'].path(evidence) is None
    found = find_effect('noise', 'variance_change')().measure(beside(evidence, fitted.model))
    assert found is None or found.gain < penalty('variance_change')
    seen = variance(evidence, fitted)
    assert seen.excess < 4 * seen.std


@pytest.mark.thorough
@pytest.mark.parametrize('kind', ['walk', 'relaxation', 'steps', 'swing', 'white'])
def test_what_does_not_come_back_to_two_levels_has_none(kind):
    n, rng = 12_000, np.random.default_rng(7)
    t = np.arange(n) / n
    for _ in range(4):
        noise = rng.standard_normal(n)
        made = {'walk': np.cumsum(noise) / 20,
                'relaxation': lfilter([0.1], [1, -0.995], noise),
                'steps': sum(3 * rng.standard_normal() * (t > at) for at in rng.random(4)),
                'swing': 4 * np.sin(2 * np.pi * 5 * t + 6 * rng.random()), 'white': 0.0}
        assert two_levels(rng.standard_normal(n) + made[kind], 240.0) is None


@pytest.mark.thorough
def test_a_path_of_three_levels_is_none_of_two():
    """Though it is seldom at one of them, so that steps of any size are no better than two."""
    rng, n = np.random.default_rng([0, 33]), 16_384
    ends = np.cumsum(rng.exponential(n / 30, 200))
    place = np.where(rng.random(201) < 0.15, 2, np.arange(201) % 2)
    path = np.array([0.0, 8.0, 20.0])[place[np.searchsorted(ends, np.arange(n))]]
    y = rng.standard_normal(n) + 0.01 * np.cumsum(rng.standard_normal(n))
    assert two_levels(y + path, 240.0) is None
    assert two_levels(y + 8.0 * (path > 0), 240.0).lead > 20


@pytest.mark.thorough
def test_a_path_is_followed_through_the_first_switches_and_short_visits():
    y = dwelling(5, 8.0)
    found = two_levels(y + np.random.default_rng(3).standard_normal(len(y)), 240.0)
    assert np.mean(np.abs(found.path - found.path.mean() - (y - y.mean())) > 1) < 0.005


@pytest.mark.thorough
@pytest.mark.parametrize('levels', [2, 9])
def test_steps_to_and_fro_between_two_levels_are_a_telegraph(levels):
    """One after another they gain far more than it does; of any other size they are steps."""
    rng, n, rate = np.random.default_rng([levels, 33]), 40_000, 50.0
    ends = np.cumsum(rng.exponential(np.resize((4500, 1800), 40)))
    place = np.searchsorted(ends, np.arange(n))
    sizes = np.resize((0.0, 1.0), 41) if levels == 2 else np.cumsum(rng.uniform(-1.5, 1.5, 41))
    problem = NoiseProblem(evidence_of(1e-3 * rng.standard_normal(n) + 8e-4 * sizes[place], rate))
    step, = (f for f in problem.candidates(problem.point(model_of('noise', BASE)))
             if f.name == 'step')
    assert step.gain > step.penalty
    assert ('between two levels' in step.against) == (levels == 2), step


@pytest.mark.thorough
@pytest.mark.parametrize('seed', [0, 3])
def test_levels_far_apart_are_told_as_exactly_as_they_are(seed):
    """To a thousandth: beside them are hundreds of blocks in which any other step is unlikely."""
    rng, n, step = np.random.default_rng([seed, 31]), 16_384, 30.0
    ends = np.cumsum(rng.exponential(np.resize((1500, 350), 200)))
    path = step * (np.searchsorted(ends, np.arange(n)) % 2)
    drift = 0.01 * np.cumsum(rng.standard_normal(n))
    found = two_levels(rng.standard_normal(n) + drift + path, 240.0)
    share = np.mean(path > 0)
    assert found.lead > 20
    assert np.std(found.path - path) < 0.02 * step
    assert found.step == pytest.approx(2 * step * np.sqrt(share * (1 - share)), rel=0.3)


@pytest.mark.thorough
@pytest.mark.parametrize('spikes', [0, 400])
def test_short_stays_at_the_other_level_are_no_spikes(spikes):
    """Samples drawn of the rest of the model have as many of them, and no more."""
    rng, n, rate = np.random.default_rng([5, 95]), 60_000, 50.0
    noise = lfilter(*butter(1, 0.2), rng.standard_normal((n, 3)), axis=0)
    x = noise / np.std(noise)
    x[:, 0] += 5.5 * (np.cumsum(rng.random(n) < 1 / 27) % 2)
    x[rng.choice(n, spikes, replace=False), 0] += rng.normal(0, 20, spikes)
    evidence = evidence_of(1e-3 * x[:, 0], rate)
    claim = find_effect('noise', 'spikes')().find(evidence).gain
    assert claim > 1000
    fit = NoiseProblem(evidence).point(
        model_of('noise', ('white', 'flicker', 'rts', 'spikes', 'low_pass')))
    said = fit.model['spikes'].otherwise(evidence, fit, claim)
    assert not said if spikes else said.startswith('beside rts samples that have none claim')


def telegraph(rng, n, high, low):
    """Return a path (n,) of 0 and 1 that stays so many samples, on the average, at either."""
    stays = (np.arange(n) + rng.integers(2)) % 2
    ends = np.cumsum(rng.geometric(1 / np.array([low, high])[stays]))
    return stays[np.searchsorted(ends, np.arange(n), 'right')]


@pytest.mark.parametrize('share', daily([0.15, 0.78], 0.15))
def test_samples_are_drawn_of_two_levels_as_unlike_as_those_of_the_record(share):
    """Their third moment tells it, in means of two samples as well."""
    rng, n = np.random.default_rng([133, int(100 * share)]), 40_000
    x = rng.standard_normal(n) + 10.0 * telegraph(rng, n, 20 * share, 20 * (1 - share))
    evidence = evidence_of(1e-3 * x, 50.0)
    fit = NoiseProblem(evidence).point(model_of('noise', ('white', 'flicker', 'rts')))
    y = fit.model['rts'].drawing(evidence, fit)(n, rng)
    assert np.mean(y == np.max(y)) == pytest.approx(share, abs=0.04)
    assert np.ptp(y) == pytest.approx(1e-2, rel=0.05)


@pytest.mark.thorough
@pytest.mark.parametrize('seed', (0, 9, 15, 36, 39))
def test_what_one_path_of_dozens_has_by_chance_is_no_spikes(seed):
    """Single samples at the other level, where it is left sooner; of stays alike none has them."""
    rng, n = np.random.default_rng([77, seed]), 9000
    x = rng.standard_normal(n) + 10.4 * telegraph(rng, n, 12.9, 3.6)
    evidence = evidence_of(1e-3 * x, 50.0)
    claim = find_effect('noise', 'spikes')().find(evidence).gain
    assert claim > 50
    fit = NoiseProblem(evidence).point(model_of('noise', ('white', 'flicker', 'rts', 'spikes')))
    said = fit.model['spikes'].otherwise(evidence, fit, claim)
    assert said.startswith('beside rts samples that have none claim')


@pytest.mark.thorough
@pytest.mark.parametrize('seed', (0, 1, 2))
def test_levels_of_which_a_third_is_held_have_no_spikes(seed):
    """What is held is looked at once, so that stays are shorter, and are drawn so as well."""
    rng, n = np.random.default_rng([78, seed]), 5400
    x = rng.standard_normal(n) + 9.0 * telegraph(rng, n, 46, 46)
    x = x[np.maximum.accumulate(np.where(rng.random(n) < 0.66, np.arange(n), 0))]
    evidence = evidence_of(1e-3 * x, 25.0)
    claim = find_effect('noise', 'spikes')().find(evidence).gain
    assert claim > 20
    fit = NoiseProblem(evidence).point(
        model_of('noise', ('white', 'flicker', 'duplicates', 'rts', 'spikes')))
    said = fit.model['spikes'].otherwise(evidence, fit, claim)
    assert said.startswith('beside rts samples that have none claim')


@pytest.mark.parametrize('swing', [0.0, 0.8])
def test_noise_that_is_loud_at_times_draws_sharp_peaks_by_chance(swing):
    """Its coefficients go together; by mean(a^2) / mean(a)^2 of its variance a(t)."""
    rng, n, rate = np.random.default_rng(86), 60_000, 50.0
    a = np.exp(2 * swing * np.sin(2 * np.pi * np.arange(n) / 9000))
    evidence = evidence_of(1e-3 * rng.standard_normal(n) * np.sqrt(a), rate)
    peak = find_effect('noise', 'narrowband')(
        {'frequency': 12.3, 'width': 0.002, 'rms': 2e-5, 'form': 'displacement'})
    fit, without = (NoiseProblem(evidence).point(model_of('noise', ('white',)).plus(e) if e
                                                 else model_of('noise', ('white',)))
                    for e in (peak, None))
    fit = replace(fit, model=fit.model.with_effect(peak))
    loud = np.mean(a**2) / np.mean(a) ** 2
    assert rivals._loud_at_times(evidence, fit) == pytest.approx(loud, rel=0.1)
    said = rivals.shape(evidence, fit, without, 'narrowband', 20.0)
    assert ('loud at times' in said) == (swing > 0), said


def heavy(nu, n=40_000, rate=50.0, seed=0):
    """Return an axis of Student's t with a walk beside it."""
    rng = np.random.default_rng([seed, int(10 * nu)])
    x = rng.standard_t(nu, (n, 3)) + 5e-3 * np.cumsum(rng.standard_normal((n, 3)), axis=0)
    return NoiseProblem(evidence_of(1e-3 * x[:, 0], rate))


@pytest.mark.parametrize('nu', daily([2.5, 4.0, 7.0], 2.5))
def test_noise_with_heavy_tails_holds_with_its_degrees_of_freedom(nu):
    problem = heavy(nu)
    before, after = (problem.point(model_of('noise', (*BASE, *more))) for more in ((), ['spikes']))
    found = after.estimates['spikes']['nu']
    assert found.value == pytest.approx(nu, abs=4 * found.std) and found.std < 0.15 * nu
    for fit, fails in ((before, True), (after, False)):
        tests = {f.name: f.p_value for f in problem.omnibus(fit)}
        assert (tests['distribution'] < 1e-6) == fails
    assert tests['variance'] > 1e-3


def test_what_is_louder_for_a_while_has_no_heavy_tails():
    """Normal noise, twice as loud for a third of the time, and some spikes."""
    rng, rate, n = np.random.default_rng(9), 50.0, 40_000
    x = rng.standard_normal((n, 3)) * np.where(np.arange(n) < n // 3, 2.0, 1.0)[:, None]
    x[::997] += 30
    found = find_effect('noise', 'spikes')().find(evidence_of(1e-3 * x[:, 0], rate))
    assert found.gain > 100 and found.effect['nu'] == 0


@pytest.mark.thorough
def test_noise_whose_loudness_wanders_is_none_of_student():
    """Its samples are heavy-tailed as well, but those near each other are large together."""
    rng, rate, n = np.random.default_rng(14), 50.0, 40_000
    slow = lfilter([1], [1, -np.exp(-1 / 60)], rng.standard_normal(n))
    x = rng.standard_normal((n, 3)) * np.exp(0.5 * slow / np.std(slow))[:, None]
    found = find_effect('noise', 'spikes')().find(evidence_of(1e-3 * x[:, 0], rate))
    assert found is None or found.effect['nu'] == 0


@pytest.mark.thorough
def test_tails_that_are_not_those_of_student_are_none_of_them():
    """A tenth of the samples four times as large: neither normal nor Student's t."""
    rng, rate, n = np.random.default_rng(10), 50.0, 100_000
    x = rng.standard_normal((n, 3)) * np.where(rng.random((n, 3)) < 0.1, 4.0, 1.0)
    found = find_effect('noise', 'spikes')().find(evidence_of(1e-3 * x[:, 0], rate))
    assert found is None or found.effect['nu'] == 0


@pytest.mark.parametrize('every, step', [seldom(1, 0.05), (40, 0.25)])
def test_a_bias_that_bends_with_temperature_is_followed(every, step):
    """Cubic in a temperature that wanders, read every fourth second to a quarter of a degree."""
    rng, rate, n = np.random.default_rng(8), 10.0, 18_000
    t = np.arange(n) / rate
    wander = np.convolve(np.cumsum(rng.standard_normal(n)), np.ones(600) / 600, 'same')
    true = 6 * np.exp(-t / 250) - 3 * t / t[-1] + 0.02 * wander
    true -= true.mean()
    bias = 1e-5 * true ** 3 - 2e-4 * true
    read = step * np.round(true[np.arange(n) // every * every] / step)
    x = 2e-4 * rng.standard_normal((n, 3))[:, 0] + bias
    problem = NoiseProblem(evidence_of(x, rate, temperature=30 + read))
    fit = problem.fit(model_of('noise', ('white', 'temperature')))
    found = fit.estimates['temperature']['cubed']
    assert found.value == pytest.approx(1e-5, abs=5 * found.std + 2e-7)
    left = problem.evidence.slow_y - fit.model['temperature'].mean(
        Inputs(problem.evidence.slow_t, 1 / rate, problem.evidence.slow_others))
    assert np.std(left) < 1.1 * 2e-4 and np.std(bias) > 2e-4


@pytest.mark.parametrize('period', daily([17.3, 40.1]))
def test_a_heater_that_cycles_is_in_the_temperature(period):
    """Its cycle is no line of nobody's; a thermometer six seconds slow is read ahead."""
    rng, rate, n = np.random.default_rng([23, int(period)]), 25.0, 10_000
    t = np.arange(n) / rate
    course = 2 * np.exp(-t / 150) + np.abs(2 * (t / period % 1) - 1)
    a = np.exp(-1 / (6 * rate))
    read = lfilter([1 - a], [1, -a], course, zi=[a * course[0]])[0]
    read = 0.02 * np.round((read + 0.01 * rng.standard_normal(n)) / 0.02)
    x = 2e-4 * rng.standard_normal((n, 3))
    x[:, 0] += 1e-4 * (course + 0.3 * course**2)
    record = ImuRecord(x, None, t, rate, covariates={'temperature': 30 + read})
    problem = NoiseProblem(gather(record, ['gyro_x'])['gyro_x'])
    fit = problem.fit(model_of('noise', BASE))
    found = diagnose(State(problem, fit, problem.held_out(fit.model)))
    assert [f.name for f in found.found] == ['temperature'] and found.remaining is None
    assert found.found[0].effect['lag'] == pytest.approx(-6, rel=0.3)


@pytest.mark.parametrize('later', daily([0, 3], 3))
def test_one_source_is_heard_at_any_phase_through_the_noise_of_the_axes(later):
    """
    A mount of Q 12 at 4 Hz, a few times above each axis's own noise there, later on gyro_x.

    Another axis brings its own noise along: times a plain gain it would stand in the rest of the
    spectrum, and what is missed in the band would be too much.
    """
    rng, rate, n = np.random.default_rng([9, later]), 50.0, 30_000
    w, r = 2 * np.pi * 4.0 / rate, np.exp(-np.pi * 4.0 / 12 / rate)
    source, push = np.zeros(n + 2000), rng.standard_normal(n + 2000)
    for k in range(2, n + 2000):
        source[k] = 2 * r * np.cos(w) * source[k - 1] - r * r * source[k - 2] + push[k]
    source /= np.std(source)
    x = rng.standard_normal((n, 3))
    for axis, (gain, shift) in enumerate([(0.3, later), (0.35, 0), (-0.25, 0)]):
        x[:, axis] += gain * source[1000 - shift:1000 - shift + n]
    record = ImuRecord(1e-3 * x, None, np.arange(n) / rate, rate)
    problem = NoiseProblem(gather(record, ['gyro_x', 'gyro_y', 'gyro_z'])['gyro_x'])
    found = {}
    for names in (('white',), ('white', 'shared_noise')):
        fit = problem.point(model_of('noise', names))
        found[names] = {f.name: f for f in problem.omnibus(fit)}
    before, after = found.values()
    views = 'coherence', 'frequency'
    failing = [sum(max(x[k].gain, 0.0) for k in views) for x in (before, after)]
    assert failing[0] > 100 and failing[1] < 0.25 * failing[0]
    assert min(after[k].p_value for k in ('frequency', 'shape')) > 1e-3
    assert fit.model['shared_noise'].chosen('heard') == 'vibration'
    quarter, gain = (fit.model['shared_noise'][k] for k in ('later', 'gain'))
    assert np.arctan2(quarter, gain) % np.pi == pytest.approx(
        (later * w + 0.5) % np.pi - 0.5, abs=0.25) or later == 0 and abs(quarter) < 0.2


def relaxing(rng, n, tc):
    """Return a relaxation over tc samples, of rms 1, and its power over that of white noise."""
    phi = np.exp(-1 / tc)
    source = lfilter([np.sqrt(1 - phi * phi)], [1, -phi], rng.standard_normal(n + 4000))
    return source, lambda f: (1 - phi**2) / np.abs(1 - phi * np.exp(-2j * np.pi * f)) ** 2


def test_what_axes_hear_together_is_each_ones_share():
    """Of a relaxation in white noise, whose spectrum by itself might be flicker and drift."""
    rng, n, gains = np.random.default_rng(31), 1 << 15, (0.8, -0.6, 1.0)
    source, power = relaxing(rng, n, 20.0)
    heard = shared.heard_together(
        {str(g): g * source[:n] + rng.standard_normal(n) for g in gains}, 0.01)
    for g in gains:
        f, share = heard[str(g)]
        true = g * g * power(0.01 * f)
        assert np.sqrt(np.mean((share - true / (1 + true)) ** 2)) < 0.1
    assert not shared.heard_together({k: rng.standard_normal(n) for k in 'abc'}, 0.01)


@pytest.mark.parametrize('seed', range(900, 906))
def test_what_is_loud_at_the_same_times_is_not_heard_together(seed):
    """Few of the samples are most of what noise shares by chance, so that it is more."""
    n = 1 << 17
    swells = np.sqrt(1 + 0.95 * np.sin(2 * np.pi * np.arange(n) / 40000))
    axes = swells * np.random.default_rng(seed).standard_normal((3, n))
    assert not shared.heard_together(dict(zip('abc', axes)), 0.01)


@pytest.mark.thorough
def test_faint_noise_over_octaves_keeps_nearly_all_that_it_tells():
    """Of what the share of it that is there would tell of one axis by another (Wiener)."""
    kept, n = [], 1 << 18
    for seed in range(920, 926):
        rng = np.random.default_rng(seed)
        tc = 10 ** rng.uniform(0.5, 2)
        source, power = relaxing(rng, n, tc)
        gains = rng.uniform(0.5, 2, 3) * rng.choice([-1, 1], 3) * 0.6 / np.sqrt(tc)
        heard = shared.heard_together({
            'gyro_' + k: g * source[:n] + rng.standard_normal(n)
            for k, g in zip('xyz', gains)}, 1.0)
        f = np.geomspace(1 / n, 0.5, 4000)
        told = np.interp(np.log(f), np.log(heard['gyro_y'][0]), heard['gyro_y'][1])
        from_it, own, other = power(f), *(1 + g * g * power(f) for g in gains[:2])
        kept.append(np.sum(f * told * from_it / own) ** 2 / (
            np.sum(f * told**2 * other / own) * np.sum(f * from_it**2 / (own * other))))
    assert np.mean(kept) > 0.9, kept


def test_drifts_of_their_own_are_not_heard_together():
    """Slow and strong as they are, they reach nothing of what is faster."""
    for seed in range(10):
        rng, n = np.random.default_rng([seed, 35]), 20_000
        assert not shared.heard_together({k: rng.standard_normal(n) + 0.1 * np.cumsum(
            rng.standard_normal(n)) for k in ('gyro_x', 'gyro_y', 'gyro_z')}, 0.01)
    walk = dct(np.cumsum(rng.standard_normal(n)), norm='ortho')
    fast = slice(n // 10, None)
    assert np.sum(shared.later(walk)[fast] ** 2) < 1.5 * np.sum(walk[fast] ** 2)


@pytest.mark.parametrize('seed', range(3))
def test_a_faint_source_is_heard_where_an_angle_is_rounded(seed):
    """A third of the power of each axis's noise at low frequencies, next to nothing at high."""
    rng, n, dt = np.random.default_rng([seed, 36]), 60_000, 0.01
    f, source = np.fft.rfftfreq(n), np.fft.rfft(rng.standard_normal(n))
    axes = {k: np.fft.irfft(0.6 * np.exp(1j * phase) * source, n) + rng.standard_normal(n)
            + 5 * np.diff(rng.standard_normal(n + 1))
            for k, phase in (('gyro_x', 0.0), ('gyro_y', 2.0), ('gyro_z', -1.0))}
    heard = shared.heard_together(axes, dt)
    own = 1 + 100 * np.sin(np.pi * f) ** 2
    for k, y in axes.items():
        at, found = heard[k]
        true = 0.36 / (0.36 + np.interp(dt * at, f, own))
        slow, width = at < 4, np.gradient(at)
        ratio = np.average(found[slow], weights=width[slow]) / np.average(
            true[slow], weights=width[slow])
        assert 0.5 < ratio < 1.6 and np.mean(found[at > 25]) < 0.01
        # what rises with the frequency is no vibration
        bins = bins_of(n, dt)
        share = shared.share(bins, power(cosine_transform(y), dt, bins), heard[k])
        assert np.max(share[bins.f > 25]) < 0.1


def test_a_strong_band_is_heard_where_it_is_and_a_line_is_not():
    """Its skirts are not as coherent as it is, and what turns steadily is no noise."""
    rng, n, dt = np.random.default_rng(33), 131_072, 0.001
    r = np.exp(-np.pi * 396 * dt / 34)
    band = lfilter([1.0], [1.0, -2 * r * np.cos(2 * np.pi * 396 * dt), r * r],
                   rng.standard_normal(n))
    line = 0.1 * np.cos(2 * np.pi * 51.47 * dt * np.arange(n))
    source = 0.25 * band / np.std(band)
    heard = shared.heard_together(
        {k: g * (source + line) + rng.standard_normal(n) for k, g in
         (('gyro_x', 1.0), ('gyro_y', -0.8), ('gyro_z', 1.2))}, dt)
    f, share = heard['gyro_z']
    assert np.max(share[np.abs(f - 396) < 4]) > 0.5
    assert np.mean(share[(f > 30) & (f < 90)]) < 0.005
    assert np.mean(share[(f > 200) & (f < 350)]) < 0.08
    assert not shared.heard_together(
        {k: g * line + rng.standard_normal(n) for k, g in (('gyro_x', 1.0), ('gyro_y', -0.8))}, dt)


def test_what_stands_above_the_noise_of_an_axis_ends_with_its_peak():
    """And its own noise is told as it is: slow bins hold few coefficients, of which low ones."""
    n, dt, own, beside = 50_000, 0.01, [], []
    bins = bins_of(n, dt)
    peak = 60 / (1 + ((bins.f - 8.6) / 0.4) ** 4)
    apart = (bins.f > 2) & (np.abs(bins.f - 8.6) > 3)
    for seed in range(12):
        some = np.random.default_rng([seed, 41]).chisquare(bins.count) / bins.count
        own.append(np.mean(shared.own_noise(bins, some)[2][bins.f < 10]))
        share = shared.share(bins, (1 + peak) * some, (bins.f, peak / (1 + peak)))
        assert np.max(share[np.abs(bins.f - 8.6) < 0.3]) > 0.9
        beside.append(np.average((share - peak / (1 + peak))[apart], weights=bins.count[apart]))
    assert np.mean(own) == pytest.approx(1, abs=0.03) and np.mean(beside) < 0.02


@pytest.mark.parametrize('course', [0.0, 20.0])
def test_how_far_axes_drift_says_nothing_of_what_they_share(course):
    """A band of 7 Hz beside flicker, and beside ramps that stand far above it."""
    rng, n, dt = np.random.default_rng(32), 40_000, 0.01
    f = np.maximum(np.fft.rfftfreq(n, dt), 1 / (n * dt))
    r = np.exp(-np.pi * 7 * dt / 7)
    band = lfilter([1.0], [1.0, -2 * r * np.cos(2 * np.pi * 7 * dt), r * r],
                   rng.standard_normal(n))
    axes = {}
    for k, gain in (('gyro_x', 1.0), ('gyro_y', -0.8), ('gyro_z', 1.2)):
        flicker = np.fft.irfft(np.fft.rfft(rng.standard_normal(n)) / np.sqrt(10 * f), n)
        axes[k] = gain * (0.3 * band / np.std(band) + course * np.linspace(0, 1, n)) \
            + flicker + rng.standard_normal(n)
    heard, bins = shared.heard_together(axes, dt), bins_of(n, dt)
    c = cosine_transform(axes['gyro_y'].copy())
    power = 2 * dt * np.add.reduceat(c**2, bins.first) / bins.count
    share = shared.share(bins, power, heard['gyro_y'])
    slow = bins.f < 1
    assert np.max(share[np.abs(bins.f - 7) < 0.5]) > 0.3
    assert np.average(share[slow], weights=bins.count[slow]) < 0.06
    # what is taken for the source there, over what the axis has of its own noise
    own = 2 * dt * (1 + 1 / (10 * bins.f))
    assert np.max((share * (1 - share) * power / own)[slow]) < 10


def test_what_comes_in_behind_a_filter_leaves_of_each_axis_what_the_filter_does():
    """Noise of one source behind means of 15 samples: nearly all where they let nothing pass."""
    rng, n, dt = np.random.default_rng(38), 80_000, 0.005
    source, mean = 0.6 * rng.standard_normal(n), np.ones(15) / 15
    gains = {'gyro_x': 1.0, 'gyro_y': 0.6, 'gyro_z': -1.3}
    axes = {k: lfilter(mean, 1, rng.standard_normal(n)) + 0.08 * rng.standard_normal(n)
            + gain * source for k, gain in gains.items()}
    heard, bins = shared.heard_together(axes, dt), bins_of(n, dt)
    gain2 = np.abs(np.fft.rfft(mean, 4096)) ** 2
    own = np.interp(bins.f, np.fft.rfftfreq(4096, dt), gain2) + 0.08**2
    for k, gain in gains.items():
        share = shared.share(bins, power(cosine_transform(axes[k]), dt, bins), heard[k])
        true = (0.6 * gain) ** 2 / ((0.6 * gain) ** 2 + own)
        ratio = (1 - share) / (1 - true)
        fast = bins.f > 25      # side lobes and what is between them, a factor of 4 apart
        assert np.median(np.abs(np.log(ratio[fast]))) < 0.15
        passes = (bins.f > 1) & (bins.f < 5)
        assert np.average(share[passes], weights=bins.count[passes]) == pytest.approx(
            np.average(true[passes], weights=bins.count[passes]), abs=0.12)


@pytest.mark.parametrize('filtered', [iirnotch(0.4, 1.3), butter(2, 0.5)])
def test_what_a_filter_takes_is_not_what_others_hear(filtered):
    """Behind one most of an axis stands above the noise that fits below what it leaves."""
    rng, n, dt = np.random.default_rng(37), 60_000, 0.02
    r = np.exp(-np.pi * 2.8 * dt / 9)
    band = lfilter([1.0, 0.0, -1.0], [1.0, -2 * r * np.cos(2 * np.pi * 2.8 * dt), r * r],
                   rng.standard_normal(n))
    source = 0.5 * band / np.std(band)
    turned = shared.quarter_later(source)
    axes = {k: lfilter(*filtered, gain * (np.cos(phase) * source + np.sin(phase) * turned)
                       + rng.standard_normal(n)) + 0.05 * rng.standard_normal(n)
            for k, gain, phase in (('gyro_x', 1.0, 0.0), ('gyro_y', 0.8, 2.2),
                                   ('gyro_z', -0.7, -1.1))}
    heard, bins = shared.heard_together(axes, dt), bins_of(n, dt)
    for k, y in axes.items():
        share = shared.share(bins, power(cosine_transform(y), dt, bins), heard[k])
        assert np.min(share[np.abs(bins.f - 2.8) < 0.1]) > 0.6
        away = (bins.f < 1) | (bins.f > 6)
        assert np.average(share[away], weights=bins.count[away]) < 0.1


@pytest.mark.parametrize('q, peak', [(None, False), (3.0, True), (50.0, True)])
def test_the_slow_side_of_a_hollow_is_no_peak(q, peak):
    """It stands as far above what is left in the hollow as a resonance above its floor."""
    f = np.geomspace(1e-3, 25, 600)
    above = 3000 / (1 + (f / 1.5) ** 4) if q is None else \
        3000 / q**2 / ((1 - (f / 0.4) ** 2) ** 2 + (f / 0.4 / q) ** 2) * (f / 0.4) ** 2
    at = int(np.argmin(np.abs(f - 0.4)))
    assert shared._is_peak(f, 12 + above, at) == peak


def test_noise_is_told_beside_what_others_hear_and_where_they_do_not():
    """Where nearly all is heard, even noise that is no stronger than elsewhere is."""
    bins = bins_of(100_000, 0.01)
    heard = np.where(bins.f < 1, 0.99, 0.0)
    own = shared.own_noise(bins, np.ones(len(bins.f)), heard)[2]
    assert np.all((own > 0.9) & (own < 1.1))


@pytest.mark.parametrize('seed', range(3))
def test_a_narrow_source_is_heard_through_axes_that_hide_it(seed):
    """A quarter of each axis's noise where it is, in one part of sixty of their band."""
    rng, n = np.random.default_rng([seed, 34]), 40_000
    f = np.fft.rfftfreq(n, 0.01)
    source = np.fft.irfft(np.fft.rfft(rng.standard_normal(n)) * (np.abs(f - 31.0) < 0.4), n)
    heard = shared.heard_together(
        {k: g * source + rng.standard_normal(n) for k, g in
         (('gyro_x', 0.5), ('gyro_y', -0.5), ('gyro_z', 0.5), ('accel_x', 0.0),
          ('accel_y', 0.0), ('accel_z', 0.0))}, 0.01)
    f, share = heard['gyro_x']
    inside = np.abs(f - 31.0) < 0.4
    assert 0.06 < np.mean(share[inside]) < 0.3 and np.mean(share[np.abs(f - 31.0) > 3]) < 0.005


@pytest.mark.thorough
def test_a_shared_relaxation_is_no_noise_of_each_axis():
    """At a tenth of the rate the axes hear one source, above that each only itself."""
    rng, rate, n = np.random.default_rng(32), 50.0, 40_000
    source, _ = relaxing(rng, n, 40.0)
    x = rng.standard_normal((n, 3))
    for axis, (gain, later) in enumerate([(0.4, 3), (0.5, 0), (-0.35, 5)]):
        x[:, axis] += gain * source[100 - later:100 - later + n]
    problem = NoiseProblem(gather(ImuRecord(1e-3 * x, None, np.arange(n) / rate, rate),
                                  ['gyro_x'])['gyro_x'])
    fit = problem.fit(model_of('noise', BASE))
    said = diagnose(State(problem, fit, problem.held_out(fit.model)))
    assert [f.name for f in said.found] == ['shared_noise'], said.ranked
    assert said.found[0].effect.chosen('heard') == 'vibration'


@pytest.mark.thorough
def test_a_band_far_below_what_the_axes_share_is_looked_for_where_that_is_taken_out():
    """What they share is thirty times as loud as the sensor, and a band a hundredth of that."""
    rng, rate, n = np.random.default_rng(34), 50.0, 60_000
    x = rng.standard_normal((n, 3)) + 30 * rng.standard_normal((n, 1))
    pole = np.exp((-0.05 + 2j) * np.pi / rate)
    band = lfilter([1.0], [1.0, -2 * pole.real, abs(pole)**2], rng.standard_normal(n))
    x[:, 0] += 0.3 * band / np.std(band)
    record = ImuRecord(1e-3 * x, None, np.arange(n) / rate, rate)
    problem = NoiseProblem(gather(record, ['gyro_x'])['gyro_x'])
    fit = problem.point(model_of('noise', ('white', 'shared_noise')))
    found = max(problem.candidates(fit), key=lambda f: f.gain - f.penalty)
    assert found.name == 'narrowband' and found.gain > 50
    assert found.effect['frequency'] == pytest.approx(1.0, abs=0.02)


@pytest.mark.thorough
def test_an_axis_that_was_not_asked_for_is_looked_at_without_its_spikes():
    """What axes share is the same whether the other one is asked for or not."""
    rng, rate, n = np.random.default_rng(33), 50.0, 30_000
    x = rng.standard_normal((n, 3)) + rng.standard_normal((n, 1))
    x[rng.choice(n, 300, replace=False), 1] += 40
    record = ImuRecord(1e-3 * x, None, np.arange(n) / rate, rate)
    alone, both = (gather(record, axes)['gyro_x'] for axes in (['gyro_x'], ['gyro_x', 'gyro_y']))
    np.testing.assert_allclose(alone.cross('gyro_y', 'whole'), both.cross('gyro_y', 'whole'))
    model = model_of('noise', ('white', 'shared_noise'))
    gains = [NoiseProblem(e).point(model).model['shared_noise']['gain'] for e in (alone, both)]
    assert gains[0] == pytest.approx(gains[1]) and gains[0] > 0.25


@pytest.mark.parametrize('what', daily(['everything', 'own_noise'], 'own_noise'))
@pytest.mark.parametrize('seed', daily(range(3), 1))
def test_what_enters_behind_a_filter_is_told_from_what_it_filters(what, seed):
    """By the slope where it falls alone; the filter is the same with either."""
    rng, n, dt, size = np.random.default_rng([8, seed]), 60_000, 0.02, 3e-4
    cutoff, tc = rng.uniform(9, 16), rng.uniform(0.5, 3)
    filtered = butter(2, 2 * cutoff * dt)
    phi = np.exp(-dt / tc)
    own = rng.standard_normal((n, 3))
    other = lfilter([10 * np.sqrt(1 - phi**2)], [1, -phi], rng.standard_normal((n, 3)), axis=0)
    behind = 0.1 * rng.standard_normal((n, 3))
    y = {'everything': lfilter(*filtered, own + other, axis=0),
         'own_noise': lfilter(*filtered, own, axis=0) + other}[what] + behind
    problem = NoiseProblem(evidence_of(size * y[:, 0], 1 / dt))
    fit = problem.point(model_of('noise', (*BASE, 'gauss_markov', 'low_pass')))
    assert fit.model['low_pass'].chosen('filters') == what
    assert fit.model['low_pass']['cutoff'] == pytest.approx(cutoff, rel=0.03)
    for effect, name, true in (('white', 'N', size * np.sqrt(dt)), ('gauss_markov', 'tc', tc)):
        e = fit.estimates[effect][name]
        assert abs(e.point - true) < 4 * e.std


@pytest.mark.parametrize('what', daily(['everything', 'white_noise'], 'everything'))
def test_a_filter_of_the_element_passes_the_bias_of_its_electronics(what):
    """An average of four samples, in whose null the flicker stands that was not filtered."""
    rng, n, dt = np.random.default_rng(9), 60_000, 0.02
    f = np.maximum(np.fft.rfftfreq(n, dt), 1 / (n * dt))
    white = rng.standard_normal((n, 3))
    flicker = np.fft.irfft(
        np.fft.rfft(rng.standard_normal((n, 3)), axis=0) / np.sqrt(f)[:, None] * 0.5, n, axis=0)
    average = np.ones(4) / 4, [1.0]
    y = {'everything': lfilter(*average, white + flicker, axis=0),
         'white_noise': lfilter(*average, white, axis=0) + flicker}[what]
    y = 3e-4 * (y + 0.02 * rng.standard_normal((n, 3)))
    problem = NoiseProblem(evidence_of(y[:, 0], 1 / dt))
    fit = problem.point(model_of('noise', ('white', 'flicker', 'low_pass')))
    assert fit.model['low_pass'].chosen('filters') == what
    assert fit.model['low_pass']['cutoff'] == pytest.approx(0.443 / (4 * dt), rel=0.01)
    n_, b = fit.estimates['white']['N'], fit.estimates['flicker']['B']
    assert abs(n_.point - 3e-4 * np.sqrt(dt)) < 4 * n_.std
    # 2 dt 0.25/f is B^2/(pi f)
    assert abs(b.point - 3e-4 * np.sqrt(0.5 * np.pi * dt)) < 4 * b.std


@pytest.mark.parametrize('n', [200, 300])
def test_a_record_of_few_samples_is_diagnosed(n):
    rng = np.random.default_rng(n)
    record = ImuRecord(1e-3 * rng.standard_normal((n, 3)), None, np.arange(n) / 50.0, 50.0)
    problem = NoiseProblem(gather(record, ['gyro_x'])['gyro_x'])
    fit = problem.fit(model_of('noise', ('white',)))
    assert diagnose(State(problem, fit, problem.held_out(fit.model))).verdict == 'complete'


@pytest.mark.parametrize('name', ['ramp', 'slow_periodic', 'transient'])
def test_what_is_smooth_is_the_same_at_a_quick_number_of_places(name):
    """Of a record whose number of blocks is twice a prime, beside what all of them say."""
    n = 2 * 8513
    evidence = evidence_of(np.random.default_rng(5).standard_normal(n), 100.0)
    effect = find_effect('noise', name)
    effect = effect.example().with_values(**{
        'slow_periodic': {'period': 55.0}, 'transient': {'tc': 3.0}}.get(name, {}))
    for part in ('whole', 'second'):
        view = Likelihood(evidence, part, model_of('noise', ('white',)).plus(effect))
        quick = view.slow.columns(effect)
        evidence.common.remembered.clear()
        exact = view.slow.transformed(effect.columns(
            evidence.slow_inputs, **{p.name: effect[p.name] for p in effect.parameters
                                     if not p.linear}))
        error = np.sqrt(np.sum((quick - exact) ** 2, axis=0))
        assert np.all(error <= 2e-3 * np.sqrt(np.sum(exact**2, axis=0)))


def test_a_noisy_thermometer_read_ahead_has_one_mean():
    """What is fitted is what is taken out: its rate of change is mostly noise, and no smooth."""
    rng, n = np.random.default_rng(6), 28_000
    read = 30 + np.cos(np.arange(n) / 9000) + 0.02 * rng.standard_normal(n)
    evidence = evidence_of(rng.standard_normal(n), 50.0, temperature=read)
    effect = find_effect('noise', 'temperature')().with_values(
        lag=-0.8, smoothing=0.05, read=0.0, slope=1e-2, curvature=-3e-3, cubed=2e-3, course=0.0)
    view = Likelihood(evidence, 'whole', model_of('noise', ('white',)).plus(effect))
    solved = view.slow.columns(effect) @ [effect[p.name] for p in effect.parameters if p.linear]
    known = view.slow.transformed(effect.mean(evidence.even_inputs))
    assert np.sum((solved - known) ** 2) <= 1e-6 * np.sum(known ** 2)


def test_what_is_asked_for_again_and_again_is_worked_out_once_whatever_a_search_asks_between():
    """Of the levels of a path every fit that has them asks; of a place of a search hardly one."""
    evidence = evidence_of(np.random.default_rng(5).standard_normal(3000), 100.0)
    made = []

    def make():
        made.append(1)
        return np.zeros(0)

    for k in range(20):
        evidence.remembered(('levels',), make)
        evidence.remembered(('place', k), lambda: np.zeros(REMEMBERED // 4))
    assert len(made) == 1
    there, gone = (pickle.loads(pickle.dumps(evidence)) for _ in range(2))
    there.remembered(('levels',), make)
    assert len(made) == 2, 'what can be made anew is not sent to another process'
    gone.common.remembered.get(('large',), lambda: np.zeros(2 * REMEMBERED))
    gone.remembered(('levels',), make)
    assert gone.common.remembered.numbers <= REMEMBERED
    for k in range(3):      # one after the other they would push it out
        gone.remembered(('on the way', k), lambda: np.zeros(REMEMBERED), once=True)
    gone.remembered(('levels',), make)
    assert len(made) == 3


def test_a_spectrum_is_made_once_for_all_models_and_evidence_that_was_fitted_goes_elsewhere(
        monkeypatch):
    evidence = evidence_of(np.random.default_rng(5).standard_normal(3000), 100.0)
    white, order = find_effect('noise', 'white'), Order(1, 1)
    values, asked = {'white': {'N': 1e-3}}, []
    psd = white.psd
    monkeypatch.setattr(white, 'psd', lambda *some: asked.append(1) or psd(*some))
    for more in {}, {'ramp': {'R': 0.0}}, {'quantization': {'Q': 1e-6}}:
        model = model_of('noise', ('white', *more)).with_values({**values, **more})
        assert len(Likelihood(evidence, 'whole', model).spectra(model)[1]) >= 1
    assert len(asked) == 1
    beside = Model([*model_of('noise', ('white',)).with_values(values),
                    open_response(order).with_values(a1=0.1, a2=0.2)])
    Likelihood(evidence, 'whole', beside).spectra(beside)
    assert evidence.units['whole'] and not pickle.loads(pickle.dumps(evidence)).units['whole']


@pytest.mark.thorough
def test_a_step_is_looked_for_where_the_best_one_hides_none():
    """Up, and down again, on a slope: the noise that the second leaves is the slope's as well."""
    rng, n, dt = np.random.default_rng(12), 45_000, 0.01
    t = dt * np.arange(n)
    y = rng.standard_normal((n, 3))[:, 0] + 4 * ((t > 48.1) & (t < 309.2)) + 0.035 * (t - 225)
    problem = NoiseProblem(evidence_of(1e-4 * y, 1 / dt))
    fit = problem.point(model_of('noise', ('white', 'flicker', 'random_walk', 'step')))
    assert min(abs(fit.model['step']['time'] - x) for x in (48.1, 309.2)) < 0.5
    step = next(f for f in problem.candidates(fit) if f.name == 'step')
    times = sorted((fit.model['step']['time'], step.effect['time']))
    assert times == pytest.approx([48.1, 309.2], abs=0.5) and step.gain > step.penalty


@pytest.mark.thorough
def test_loud_steps_end_within_the_means_in_which_they_fall_and_leave_no_power():
    """Ten standard deviations each, on flicker and a swing that is louder than they are."""
    rng, n, dt, begin, end = np.random.default_rng(31), 120_000, 0.005, 243.376, 379.653
    t = dt * np.arange(n)
    y = rng.standard_normal(n) + hidden.flicker(n, dt, 0.15, rng) + 6 * np.sin(0.474 * t)
    y += 9 * (t >= begin) - 7 * (t >= end)
    problem = NoiseProblem(evidence_of(1e-3 * y, 1 / dt))
    model = model_of('noise', ('white', 'random_walk', 'sinusoid', 'step'))
    fit = problem.point(model.plus(find_effect('noise', 'step')()).plus(
        find_effect('noise', 'flicker')()))
    times = sorted(fit.model[k]['time'] for k in ('step', 'step.2'))
    assert times == pytest.approx([begin, end], abs=2 * dt) and not fit.details.set_aside
    # what an edge claims within the means of the view of time is not that view's
    sure = next(f for f in problem.candidates(problem.point(model.minus('step')))
                if f.name == 'step')
    assert 0.2 * sure.gain < sure.elsewhere < sure.gain


@pytest.mark.thorough
def test_a_mean_that_is_known_stands_where_it_was_solved_for():
    """Means of seven samples leave the last six out: they are no seventh of all there are."""
    n, dt = 120_000, 0.005
    y = np.random.default_rng(37).standard_normal(n) + 9 * (dt * np.arange(n) >= 500.2)
    problem = NoiseProblem(evidence_of(1e-3 * y, 1 / dt))
    fit = problem.point(model_of('noise', ('white', 'step')))
    evidence, step = problem.evidence, fit.model['step']
    known = Likelihood(evidence, 'whole', fit.model, fit).slow.known
    solved = Likelihood(evidence, 'whole', fit.model).slow.columns(step)[:, 0] * step['size']
    assert np.max(np.abs(known - solved)) < 1e-9 * np.max(np.abs(solved))


@pytest.mark.parametrize('lines', daily([0, slow_part.LINES], slow_part.LINES))
def test_a_line_that_was_measured_beside_a_step_leaves_nothing_there(lines, monkeypatch):
    """What the step has at the line's frequency went with it, and came back as a slow wave."""
    monkeypatch.setattr(slow_part, 'LINES', lines)
    rng, n, dt = np.random.default_rng(33), 54_000, 0.01
    t = dt * np.arange(n)
    y = rng.standard_normal(n) + 0.5 * np.sin(2 * np.pi * 0.0403 * t) + 2.5 * (t >= 117.3)
    problem = NoiseProblem(evidence_of(1e-3 * y, 1 / dt))
    fit = problem.point(model_of('noise', ('white', 'random_walk', 'sinusoid', 'step')))
    near = np.abs(problem.evidence.whole.bins.f - 0.0403) < 0.005
    left = np.sum((fit.details.power / fit.details.v)[near])
    assert (left < 2 * np.sum(near)) == bool(lines)


def test_short_dwells_are_told_without_a_line_that_the_model_lacks():
    rng, n, dt = np.random.default_rng(9), 140_000, 5e-4
    t = dt * np.arange(n)
    y = rng.standard_normal(n) + 0.12 * np.sin(2 * np.pi * 40.0 * t)
    evidence = evidence_of(1e-4 * y, 1 / dt)
    rts = find_effect('noise', 'rts')().with_values(step=2e-5, tau=0.02)
    fit = NoiseProblem(evidence).point(model_of('noise', ('white', 'rts')))
    z, at, _ = rts._short(evidence, replace(fit, model=fit.model.with_effect(rts)))
    assert 2 * abs(np.mean(z * np.exp(2j * np.pi * 40.0 * at))) < 0.02e-4


def test_a_coefficient_near_zero_does_not_confirm_what_axes_do_not_share():
    """ln of it has no lower end: by the least of a gain it would become far likelier, or less."""
    rng, n, rate = np.random.default_rng(5), 16_384, 50.0
    x = 1e-3 * rng.standard_normal((n, 3))
    for half in (slice(None, n // 2), slice(n // 2, None)):
        c = dct(x[half, 0], norm='ortho')
        c[8:16] *= 1e-9
        x[half, 0] = idct(c, norm='ortho')
    problem = NoiseProblem(gather(ImuRecord(x, None, np.arange(n) / rate, rate), ['gyro_x'])[
        'gyro_x'])
    more = model_of('noise', ('white', 'shared_noise'))
    before, after = problem.held_out(model_of('noise', ('white',))), problem.held_out(more)
    assert abs(fall_of(before, after, [more['shared_noise']])) < FALL


@pytest.mark.thorough
def test_a_band_is_held_out_where_it_is_on_in_one_half_alone():
    """Each half says how loud it is; the other where it is, and how wide. It raised the error."""
    rng, n, dt, f = np.random.default_rng(31), 40_000, 0.01, 18.3
    pole = np.exp(2j * np.pi * f * dt - np.pi * 0.8 * dt)
    band = lfilter([1], [1, -2 * pole.real, abs(pole) ** 2], rng.standard_normal(n + 500))[500:]
    y = rng.standard_normal((n, 3))
    y[23_000:33_000, 0] += 0.35 * band[23_000:33_000] / np.std(band)
    problem = NoiseProblem(gather(ImuRecord(1e-3 * y, None, np.arange(n) * dt, 1 / dt),
                                  ['gyro_x'])['gyro_x'])
    before = problem.fit(model_of('noise', BASE))
    found = diagnose(State(problem, before, problem.held_out(before.model)))
    assert 'narrowband' in {x.name for x in found.found} <= {'narrowband', 'variance_change'}
    band = next(x for x in found.found if x.name == 'narrowband')
    after = problem.fit(before.model.plus(band.effect))
    fall = fall_of(problem.held_out(before.model), problem.held_out(after.model), [band.effect])
    assert fall > band.gain
    assert after.model['narrowband']['frequency'] == pytest.approx(f, abs=0.2)


@pytest.mark.thorough
@pytest.mark.parametrize('seed', [1, 3])
def test_what_rises_as_an_angle_s_rounding_is_no_filter_that_folds(seed):
    """Wider than Nyquist a filter that is decimated bends the same way: neither was named."""
    rng, n = np.random.default_rng(seed), 30_000
    y = rng.standard_normal((n, 3)) + np.diff(rng.uniform(-0.4, 0.4, (n + 1, 3)), axis=0)
    problem = NoiseProblem(gather(ImuRecord(1e-4 * y, None, np.arange(n) * 0.01, 100.0),
                                  ['gyro_x'])['gyro_x'])
    fit = problem.fit(model_of('noise', BASE))
    found = diagnose(State(problem, fit, problem.held_out(fit.model)))
    assert [f.name for f in found.found] == ['quantization'] and found.found[0].probability > 0.99


@pytest.mark.thorough
def test_a_filter_is_found_around_a_peak_that_stands_far_above_it():
    """Neither was: on all bins the peak draws the filter along, and beside it none is left."""
    rng, n, dt, f = np.random.default_rng(12), 7000, 0.04, 5.7
    y = lfilter(*iirnotch(8.2 * 2 * dt, 3.3), rng.standard_normal((n, 3)), axis=0)
    y += 0.1 * rng.standard_normal((n, 3))
    pole = np.exp(2j * np.pi * f * dt - np.pi * 0.1 * dt)
    band = lfilter([1], [1, -2 * pole.real, abs(pole) ** 2], rng.standard_normal(n + 500))[500:]
    y[:, 0] += 0.8 * band / np.std(band)
    problem = NoiseProblem(gather(ImuRecord(1e-3 * y, None, np.arange(n) * dt, 1 / dt),
                                  ['gyro_x'])['gyro_x'])
    fit = problem.fit(model_of('noise', BASE))
    found = diagnose(State(problem, fit, problem.held_out(fit.model)))
    assert {x.name for x in found.found} == {'notch', 'narrowband'} and found.remaining is None
    effect = next(x.effect for x in found.found if x.name == 'notch')
    assert effect['frequency'] == pytest.approx(8.2, rel=0.03)


@pytest.mark.thorough
def test_of_a_day_of_samples_one_knock_is_told_by_its_moment():
    """Among so many its few samples do not show in how all are spread: no part confirmed it."""
    rng, n = np.random.default_rng(3), 150_000
    y = rng.standard_normal((n, 3))
    for begin in (30_000, 100_000):
        dying = 7 * np.exp(-np.arange(60) / 8)[:, None]
        y[begin:begin + 60] += dying * rng.standard_normal((60, 3))
    problem = NoiseProblem(gather(ImuRecord(1e-4 * y, None, np.arange(n) * 0.1, 10.0),
                                  ['gyro_x'])['gyro_x'])
    fit = problem.fit(model_of('noise', BASE))
    found = diagnose(State(problem, fit, problem.held_out(fit.model)))
    assert [f.name for f in found.found] == ['shock'] and found.remaining is None
    assert 'moments' in {f.name for f in found.failed}
    shock = found.found[0]
    after = problem.point(fit.model.plus(shock.effect))
    assert fall_of(problem.held_out(fit.model), problem.held_out(after.model),
                   [shock.effect]) > 1.5 * shock.gain


def test_a_peak_has_the_form_that_it_has_beside_the_filter_of_the_other_noise():
    """Behind a filter of another form it was told as another: 400 nats, which named a third."""
    rng, n, rate, f0, width = np.random.default_rng([80, 0]), 120_000, 10.0, 0.571, 0.0467
    own = lfilter(np.ones(13) / 13, 1, rng.standard_normal(n + 100))[100:]
    own = own + 0.06 * rng.standard_normal(n)
    r, theta = np.exp(-np.pi * width / rate), 2 * np.pi * f0 / rate
    x = lfilter([1], [1, -2 * r * np.cos(theta), r * r], rng.standard_normal(n + 1002))[1000:]
    swing = x[2:] - x[:-2]
    evidence = evidence_of(1e-3 * (own + 0.25 * swing / np.std(swing)), rate)
    fit = NoiseProblem(evidence).point(model_of('noise', ('white', 'narrowband', 'low_pass')))
    peak, response = fit.model['narrowband'], fit.model['low_pass']
    assert peak.chosen('form') == 'velocity' and response.chosen('form') == 'moving_average'
    assert peak['width'] == pytest.approx(width, rel=0.1)
    assert peak['frequency'] == pytest.approx(f0, rel=0.01)
