# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Axes that follow the temperature tell it better than a coarse thermometer; noise tells none."""

import numpy as np
from params import daily
import pytest
from scipy.signal import lfilter

from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.loop.effect import find_effect, model_of
from imu_noise_tools.noise import thermal
from imu_noise_tools.noise.candidates import candidates
from imu_noise_tools.noise.doubts import hidden_by_steps
from imu_noise_tools.noise.gather import gather
from imu_noise_tools.noise.problem import NoiseProblem
from imu_noise_tools.noise.stairs import hidden, missed, unrounded
from imu_noise_tools.noise.thermal import course_of
from imu_noise_tools.tasks.noise import analyse_record

RATE, N = 20.0, 12_000


def heated(rng):
    """Return a course with kinks, as of a heater and the weather, of 0 to 1."""
    knots = np.cumsum(np.cumsum(rng.standard_normal(60)))
    knots -= np.linspace(knots[0], knots[-1], 60)
    course = np.interp(np.linspace(0, 59, N), np.arange(60), knots)
    return (course - course.min()) / np.ptp(course)


def read(course, rng, step):
    """Return what a thermometer logs of it twice a second, in steps and through noise."""
    ticks = course[::10] + 0.3 * step * rng.standard_normal(N // 10)
    return np.repeat(step * np.round(ticks / step), 10)


def evidence(mean, temperature, rng, line=0.0):
    """Return the evidence of gyro_x, where all axes hold a share of a mean; gyros of a line."""
    x = rng.standard_normal((N, 6)) + mean[:, None] * np.array([9, 5, -7, 20, 15, -18])
    x[:, :3] += np.outer(line * np.ones(N), [1, -1.5, -0.8])
    x *= 1e-3
    record = ImuRecord(x[:, :3], x[:, 3:], np.arange(N) / RATE, RATE,
                       covariates={'temperature': 30 + temperature})
    return gather(record, ['gyro_x'])['gyro_x']


def left(mean, *columns):
    """Return the rms of what columns leave of a mean."""
    x = np.column_stack([np.ones(len(mean)), *columns])
    return np.std(mean - x @ np.linalg.lstsq(x, mean, rcond=None)[0])


def warmed():
    """Return a mean that bends with a temperature, and the evidence of axes that follow it."""
    rng = np.random.default_rng(3)
    course = heated(rng)
    mean = course + 0.5 * course**2
    return mean, evidence(mean, read(course, rng, 0.12), rng)


def test_axes_tell_the_temperature_that_a_coarse_thermometer_misses():
    mean, e = warmed()
    t = e.common.slow['temperature']
    mean = mean[:len(t) * e.common.slow_length].reshape(len(t), -1).mean(axis=1)
    assert left(mean, e.course.values) < 0.3 * left(mean, t, t**2, t**3)
    # what the axes share is the temperature's
    assert not np.any(e.coupled('gyro_x', 'gyro_y', 'whole')[:e.thermal('whole')])
    assert np.any(e.cross('gyro_y', 'whole')[:e.thermal('whole')])


def test_noise_is_known_in_the_unit_of_what_it_is_compared_with(monkeypatch):
    """Of blocks of two samples, of which two more make one that is compared."""
    given, rng, shared = {}, np.random.default_rng(4), thermal._shared

    def seen(c, trend, x, noise):
        given.update(c=c, noise=noise)
        return shared(c, trend, x, noise)

    monkeypatch.setattr(thermal, '_shared', seen)
    course = np.repeat(heated(rng), 4)
    x = 1e-3 * (rng.standard_normal((4 * N, 3)) + 20 * course[:, None])
    record = ImuRecord(x, None, np.arange(4 * N) / RATE, RATE,
                       covariates={'temperature': 30 + course})
    e = gather(record, ['gyro_x'])['gyro_x']
    assert e.course is not None and e.common.slow_length == 2
    fast = slice(len(given['c']) // 2, None)
    assert np.mean(given['c'][fast]**2) == pytest.approx(np.mean(given['noise'][fast]), rel=0.2)


@pytest.mark.thorough
def test_no_coupling_is_named_for_the_temperature():
    problem = NoiseProblem(warmed()[1])
    found = {f.name: f for f in candidates(
        problem, problem.point(model_of('noise', ('white', 'flicker', 'random_walk'))))}
    assert found['temperature'].gain > 100
    assert all(found[k].gain < found[k].penalty for k in ('accel_coupling', 'shared_noise'))


@pytest.mark.parametrize('kind', ['walk', 'transient', 'sine', 'step'])
def test_what_sways_by_itself_follows_no_temperature(kind):
    """Nor do axes that hold one smooth mean, each beside white noise and a random walk."""
    rng, n = np.random.default_rng([7, len(kind)]), 4000
    t, k = np.arange(float(n)), np.arange(1, 501)
    mean = {'walk': 0.0, 'transient': np.exp(-t / 800), 'sine': np.sin(t / 300),
            'step': t > 1500.0}[kind]
    for _ in range(2):
        slow = {a: rng.standard_normal(n) + 0.05 * np.cumsum(rng.standard_normal(n))
                + rng.uniform(2, 20) * mean for a in ('gyro_y', 'gyro_z', 'accel_x')}
        own = {a: 1 + (0.05 * n / (np.pi * k))**2 for a in slow}
        slow['temperature'] = heated(rng)[::3]
        assert course_of(slow, t, own) is None


@pytest.mark.thorough
def test_a_line_that_was_taken_out_of_an_axis_is_not_put_back_by_a_course():
    """Others swing with it as they follow the temperature, and told alone it is no part of it."""
    t = np.arange(2400) * 0.25
    slow, line = np.cos(np.pi * t / 600), np.sin(2 * np.pi * 0.0613 * t + 1.0)
    course = thermal.Course(slow + 0.3 * line, 0.1, -9.0, 1.0)
    left = thermal.without_lines(course, np.array([0.0613, 0.2]), t).values
    assert np.max(np.abs(left - np.sqrt(2) * slow)) < 0.03   # of 0.42
    assert thermal.without_lines(course, np.array([0.2]), t) is course
    rng = np.random.default_rng(11)
    warmth, cycle = 3 * heated(rng), np.sin(2 * np.pi * 0.06 * np.arange(N) / RATE)
    e = evidence(warmth, read(warmth, rng, 0.12), rng, cycle)
    swing = np.exp(2j * np.pi * 0.06 * e.slow_t)
    assert np.any(np.abs(e.line_table[:, 0] - 0.06) < 0.002) and e.course.edge > 0.06
    assert abs(np.mean(e.course.values * swing)) < 1e-3


@pytest.mark.parametrize('seed', daily(range(3, 9), 7))
def test_how_a_thermometer_is_read_is_asked_beside_what_was_missing(seed):
    """Behind some lag the temperature was like the ramp, as long as that was not there."""
    rng = np.random.default_rng(seed)
    course, names = heated(rng), ('white', 'flicker', 'random_walk', 'temperature')
    x = 1e-3 * (rng.standard_normal((N, 3)) + course[:, None] * np.array([2, -1.5, 1])
                + np.linspace(0, 9, N)[:, None] * [1, -0.8, 0.4])
    e = gather(ImuRecord(x, None, np.arange(N) / RATE, RATE, covariates={
        'temperature': 30 + read(course, rng, 0.02)}), ['gyro_x'])['gyro_x']
    later, both = NoiseProblem(e), model_of('noise', (*names, 'ramp'))
    before = later.point(model_of('noise', names))
    after, anew = (p.point(both) for p in (later, NoiseProblem(e)))
    assert after.log_likelihood == pytest.approx(anew.log_likelihood, abs=0.5)
    assert abs(after.model['temperature']['lag']) < abs(before.model['temperature']['lag'])


@pytest.mark.thorough
@pytest.mark.parametrize('size, at', [(0.02, 0.06), (0.004, 0.06), (0.02, 0.2)])
@pytest.mark.parametrize('whose', ['heater', 'own', 'shared'])
def test_a_line_is_the_temperatures_where_the_axis_follows_what_others_tell_of_it(
        whose, size, at):
    """
    The thermometer is far too slow to show the cycle of a heater, and all axes follow that.

    Where that is slow itself, and beyond where anything else of it is seen.

    """
    rng, t = np.random.default_rng(11), np.arange(N) / RATE
    cycle = size * np.sin(2 * np.pi * at * t)
    warmth = heated(rng) + cycle * (whose == 'heater')
    a = np.exp(-1 / (25 * RATE))
    slow = lfilter([1 - a], [1, -a], warmth, zi=[a * warmth[0]])[0]
    gains = np.array([9, 5, -7, 20, 15, -18])
    x = rng.standard_normal((N, 6)) + 3 * warmth[:, None] * gains
    x[:, 0] += 27 * cycle * (whose != 'heater')
    x[:, 1] += 27 * cycle * (whose == 'shared')
    record = ImuRecord(1e-3 * x[:, :3], 1e-3 * x[:, 3:], t, RATE, covariates={
        'temperature': 30 + read(3 * slow, rng, 0.12)})
    e = gather(record, ['gyro_x'])['gyro_x']
    assert whose != 'heater' or e.course.edge > at
    assert np.any(np.abs(e.line_table[:, 0] - at) < 0.002) == (whose != 'heater')


@pytest.mark.thorough
@pytest.mark.parametrize('seed', range(2))
@pytest.mark.parametrize('what', ['settles with it', 'settles before it', 'sways with it',
                                  'settles, none recorded', 'rises with it'])
def test_a_course_and_a_temperature_that_has_it_are_as_likely_beforehand(what, seed):
    """The ways to read a thermometer are no price where it is read as it is: data decide."""
    rng = np.random.default_rng([seed, 61])
    t = np.arange(N) / RATE
    warmth = 1 - np.exp(-t / 100)
    bias = {'settles before it': 1 - np.exp(-t / 15)}.get(what, warmth)
    if what == 'sways with it':
        warmth = bias = heated(rng)
    elif what == 'rises with it':
        warmth = bias = t / t[-1]
    x = 1e-3 * (rng.standard_normal((N, 3)) + np.outer(bias, [2.0, 0.0, 0.0]))
    logged = {} if 'none' in what else {'temperature': 24 + 14 * warmth}
    record = ImuRecord(x, None, t, RATE, covariates=logged)
    study = analyse_record(record, axes=('gyro_x',), keep_motion=True)
    said = study.diagnose(['gyro_x'])['gyro_x']
    found, both = [f.name for f in said.found], {f.name for f in said.ranked[:2]}
    if what == 'settles with it':
        assert said.verdict == 'undecidable' and both == {'temperature', 'transient'}
    elif what == 'rises with it':
        assert said.verdict == 'undecidable' and both == {'temperature', 'ramp'}
    else:
        assert found == ['temperature' if what == 'sways with it' else 'transient']
        assert ('Record the temperature' in said.advice) == ('none' in what)


@pytest.mark.parametrize('seed', daily(range(4), 0))
def test_one_slope_costs_one_free_parameter(seed):
    """Of five standard errors it is named; all ways to read a thermometer cost more than that."""
    rng = np.random.default_rng([seed, 62])
    t = np.arange(18_000) / RATE
    warmth = np.sin(2 * np.pi * t / 100 + seed)
    x = 1e-3 * (rng.standard_normal((len(t), 3)) + np.outer(
        warmth, [5.2 / np.sqrt(np.sum(warmth ** 2)), 0.0, 0.0]))
    record = ImuRecord(x, None, t, RATE, covariates={'temperature': 24 + warmth})
    said = analyse_record(record, axes=('gyro_x', 'gyro_y'), keep_motion=True).diagnose()
    assert [f.name for f in said['gyro_x'].found] == ['temperature']
    assert 6 < said['gyro_x'].found[0].gain < 25
    assert said['gyro_y'].verdict == 'complete'


def swings(seconds):
    """Return the temperature of a die that warms up in a room of which the air is conditioned."""
    t = np.arange(float(seconds))
    return 26 + 5 * (1 - np.exp(-t / 3000)) + 0.9 * np.sin(2 * np.pi * t / 1320)


def test_what_was_read_in_coarse_steps_goes_on_between_them():
    t = np.arange(5000.0)
    true = 20 + 6 * (1 - np.exp(-t / 1500))
    read = 0.5 * np.round(2 * true)
    assert np.std(unrounded(read) - true) < 0.2 * np.std(read - true)
    noisy = 0.5 * np.round(2 * true + 0.03 * np.random.default_rng(0).standard_normal(len(t)))
    assert np.std(unrounded(noisy) - true) < 0.5 * np.std(noisy - true)
    turned = np.round(swings(7200))
    assert np.std(unrounded(turned) - swings(7200)) < 0.75 * np.std(turned - swings(7200))
    # what is off is known by about as much
    assert missed(turned) == pytest.approx(np.std(unrounded(turned) - swings(7200)), rel=0.3)
    assert missed(true) == 0.0
    assert unrounded(true) is true and hidden(true) == 0.0
    assert hidden(read) == pytest.approx(0.5 / np.sqrt(12), rel=0.05)


def test_a_thermometer_read_once_a_second_is_as_coarse_between_its_readings():
    """They come with a line from one to the next, which says nothing of how it went."""
    true, t = np.round(swings(7200)), np.arange(0, 7199, 0.1)
    told, held = np.interp(t, np.arange(7200.0), true), true[t.astype(int)]
    np.testing.assert_allclose(hidden(told), hidden(held), rtol=0.01)
    off = np.abs(unrounded(told) - unrounded(held))
    assert np.mean(off) < 2e-3


@pytest.mark.parametrize('noise', [0.3, 0.6])
def test_what_noise_takes_to_and_fro_hides_little_and_stays_what_it_is(noise):
    rng, true = np.random.default_rng(1), swings(7200)
    read = np.round(true + noise * rng.standard_normal(7200))
    assert hidden(read) < 0.1 < hidden(np.round(true))
    slow = np.ones(100) / 100
    assert unrounded(read) is read
    assert np.std(np.convolve(read - true, slow, 'valid')) < 0.1


def heated_by(seed, steps, seconds=7200, rate=2.0):
    """Return a record of which the first axis bends with a temperature, 40 s behind it."""
    rng = np.random.default_rng([seed, 12])
    true, t = swings(seconds), np.arange(0, seconds - 1, 1 / rate)
    a = np.exp(-1 / 40)
    late = lfilter([1 - a], [1, -a], true, zi=[a * true[0]])[0] - 28
    x = 1.4e-3 * rng.standard_normal((len(t), 3))
    x[:, 0] += np.interp(t, np.arange(float(seconds)), 1.5e-3 * late + 4e-4 * late**2)
    x += 2e-6 * np.cumsum(rng.standard_normal((len(t), 3)), axis=0)
    read = np.interp(t, np.arange(float(seconds)), steps * np.round(true / steps))
    return ImuRecord(x, None, t, rate, covariates={'temperature': read})


def slope_of(seed, steps, lag=25.0, seconds=1800, rate=10.0):
    """Return the estimates of a slope of 3.67e-4 behind a lag, by a thermometer in steps, warm."""
    rng = np.random.default_rng([seed, 63])
    before, t = 60 * rate, np.arange(seconds * rate) / rate
    all_t = np.arange(-before, seconds * rate) / rate
    true = rng.uniform(4, 9) * (1 - np.exp(-(all_t + 60) / rng.uniform(300, 1200))) \
        + rng.uniform(0, 0.5) * np.sin(all_t / rng.uniform(80, 200))
    a = np.exp(-1 / (lag * rate))
    late = lfilter([1 - a], [1, -a], true, zi=[a * true[0]])[0][-len(t):]
    x = 2e-4 * rng.standard_normal((len(t), 3))
    x[:, 0] += 3.67e-4 * late
    read = steps * np.round((true[-len(t):] + rng.uniform(0, steps)) / steps)
    record = ImuRecord(x, None, t, rate, covariates={'temperature': read})
    e = gather(record, ['gyro_x'])['gyro_x']
    fit = NoiseProblem(e).fit(model_of('noise', ('white', 'random_walk', 'temperature')))
    return fit.estimates['temperature']


def test_a_slope_is_no_better_known_than_the_lag_behind_which_it_is():
    """A warm-up is much the same behind any lag, but for the slope."""
    said = slope_of(0, 0.5)
    low, high = said['slope'].ci95
    assert low < 3.67e-4 < high and high - low > 0.05 * low
    assert said['lag'].ci95[0] < 25.0 < said['lag'].ci95[1]
    assert not said['slope'].note
    assert 'few steps' in slope_of(0, 1.0)['slope'].note


@pytest.mark.thorough
@pytest.mark.parametrize('steps', [0.01, 0.5, 1.0])
def test_the_interval_of_a_slope_holds_it(steps):
    """Whatever the thermometer's steps: of one lag and flat stays it held 14, 16 and 8 times."""
    ends = np.array([slope_of(seed, steps)['slope'].ci95 for seed in range(16)])
    assert np.sum((ends[:, 0] < 3.67e-4) & (3.67e-4 < ends[:, 1])) >= 14


def test_a_fine_thermometer_tells_a_lag_between_those_that_are_tried():
    rng, t = np.random.default_rng(5), np.arange(N) / RATE
    warmth, a = 3 * heated(rng), np.exp(-1 / (13.5 * RATE))
    late = lfilter([1 - a], [1, -a], warmth, zi=[a * warmth[0]])[0]
    x = 1e-4 * rng.standard_normal((N, 3)) + 1e-3 * late[:, None] * [1, 0, 0]
    e = gather(ImuRecord(x, None, t, RATE, covariates={'temperature': 30 + warmth}),
               ['gyro_x'])['gyro_x']
    assert not any(lag == pytest.approx(13.5, rel=0.05)
                   for lag, _ in thermal.readings(e.duration, np.diff(e.slow_t[:2])[0]))
    said = NoiseProblem(e).fit(model_of('noise', ('white', 'temperature'))).estimates[
        'temperature']
    low, high = said['lag'].ci95
    assert low < 13.5 < high < low + 1.0
    assert said['slope'].value == pytest.approx(1e-3, rel=1e-3)


def test_what_the_steps_of_a_thermometer_hide_is_no_course_of_its_own():
    """The same course is one beside a thermometer that would have shown it."""
    names = ('white', 'flicker', 'random_walk', 'temperature')
    for steps, less in ((1.0, True), (0.05, False)):
        e = gather(heated_by(0, steps), ['gyro_x'])['gyro_x']
        model = NoiseProblem(e).point(model_of('noise', names)).model
        swing = find_effect('noise', 'slow_periodic')({
            **{p.name: 0.0 for p in find_effect('noise', 'slow_periodic').parameters},
            'cosine': 6e-4, 'period': 1320.0, 'orders': 1.0})
        assert bool(hidden_by_steps(e, model, swing)) == less
        assert not hidden_by_steps(e, model, swing.with_values(cosine=8e-3))
        assert not hidden_by_steps(e, model.minus('temperature'), swing)
        assert not hidden_by_steps(e, model.minus('temperature'), model['temperature'])
