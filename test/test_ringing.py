# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Knocks that ring: found at their moments, and nothing that only looks like them."""

from __future__ import annotations

import warnings

import numpy as np
from params import daily
import pytest
from scipy.signal import iirnotch, lfilter

import hidden
from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.loop.diagnosis import diagnose
from imu_noise_tools.loop.effect import find_effect, model_of
from imu_noise_tools.loop.prediction import State
from imu_noise_tools.noise.effects import shock
from imu_noise_tools.noise.gather import gather
from imu_noise_tools.noise.kinds import Inputs
from imu_noise_tools.noise.problem import NoiseProblem
from imu_noise_tools.noise.ringing import find_rings

DT, LEAST = 0.01, 7.0


def knocked(y, times, frequency, decay, nats, dt=DT, rng=None):
    """Return samples of noise of variance 1 with rings that are worth so much each."""
    y = y.copy()
    size = np.sqrt(8 * nats * dt / decay)
    for k, at in enumerate(times):
        i = int(at / dt)
        t = np.arange(min(len(y) - i, int(10 * decay / dt))) * dt
        phase = 0.7 * k if rng is None else rng.uniform(0, 2 * np.pi)
        y[i:i + len(t)] += size * np.exp(-t / decay) * np.cos(2 * np.pi * frequency * t + phase)
    return y


def test_knocks_that_ring_alike_are_found_and_taken_out():
    """Three of 30 nats each, which no block of samples shows."""
    rng, times = np.random.default_rng(3), (20.0, 71.3, 150.2)
    noise = rng.standard_normal(20_000)
    y = knocked(noise, times, 12.0, 0.2, 30.0)
    found = find_rings(y, DT, LEAST)
    assert np.allclose(found.begin * DT, times, atol=0.06)
    assert np.allclose(found.omega / (2 * np.pi * DT), 12.0, atol=0.5)
    assert np.all((found.tau * DT > 0.1) & (found.tau * DT < 0.4))
    left = found.out_of(y) - noise
    assert np.sum(left**2) < 0.2 * np.sum((y - noise) ** 2)


def test_knocks_at_both_ends_are_found_whatever_the_length():
    """As of a hand that starts and stops the logger; no transform likes 30 350 samples."""
    times = (0.05, 302.5)
    y = knocked(np.random.default_rng(5).standard_normal(30_350), times, 12.0, 0.1, 60.0)
    assert np.allclose(find_rings(y, DT, LEAST).begin * DT, times, atol=0.06)


@pytest.mark.parametrize('seed', daily((0, 1, 2, 3), 1))
def test_long_knocks_in_a_short_record_are_found_beside_faint_places(seed):
    """Five of half a second in a minute, and three places that chance may have made."""
    rng, times = np.random.default_rng(seed), np.array([6.0, 17.0, 28.0, 39.0, 50.0])
    y = knocked(rng.standard_normal(6_000), times, 30.0, 0.5, 300.0, rng=rng)
    y = knocked(y, times[:3] + 5.5, 30.0, 0.5, 12.0, rng=rng)
    found = find_rings(y, DT, LEAST)
    assert np.all(np.min(np.abs(found.begin * DT - times[:, None]), axis=1) < 0.06)


def test_few_samples_and_a_silent_axis_are_no_knocks():
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        for y in (np.zeros(0), np.ones(1), np.arange(30.0), np.zeros(3000)):
            assert not len(find_rings(y, DT, LEAST).begin)


@pytest.mark.parametrize('since, louder', [(0.25, 1.35), (7.6 / 24, 3.0)])
def test_what_chance_has_in_a_long_record_does_not_hide_short_knocks(since, louder):
    """Noise alone is beyond four standard deviations now and then, more often where it is loud."""
    rng, n = np.random.default_rng(6), 120_000
    y = rng.standard_normal(n)
    for at, nats in ((500.0, 32.0), (920.0, 26.0)):
        y = knocked(y, (at,), 25.0, 0.03, nats)
    y[int(since * n):] *= louder
    y[70_000:73_200] *= 1e-3
    assert np.allclose(find_rings(y, DT, LEAST).begin * DT, (500.0, 920.0), atol=0.03)


@pytest.mark.thorough
@pytest.mark.parametrize('seed', range(2))
def test_what_only_looks_like_a_knock_is_none(seed):
    """Noise, spikes alone and in bursts, steps, popcorn, a line that is on for a minute."""
    rng, n = np.random.default_rng(seed), 12_000
    noise = rng.standard_normal(n)
    at = rng.integers(0, n - 5, 40)
    spikes = np.zeros(n)
    spikes[at] = 15 * rng.standard_normal(len(at))
    bursts = np.zeros(n)
    bursts[(at[:, None] + np.arange(4)).ravel()] = 15 * rng.standard_normal(4 * len(at))
    t = np.arange(n)
    popcorn = 4 * (np.searchsorted(np.sort(rng.uniform(0, n, 100)), t) % 2)
    line = np.sin(0.8 * t) * ((t > 3000) & (t < 9000))
    for y in (0, spikes, bursts, 5 * (t > 7000), popcorn, line):
        assert not len(find_rings(noise + y, DT, LEAST).begin)


@pytest.mark.parametrize('walk', daily([0.003, 0.01], 0.01))
def test_what_creeps_from_the_beginning_on_is_no_knock(walk):
    """With the logarithm of time, beside noise that wanders: steepest where the record begins."""
    rng, n, dt = np.random.default_rng(0), 150_000, 0.0005
    y = rng.standard_normal(n) - 3 * np.log1p(np.arange(n) * dt / 0.03)
    assert not len(find_rings(y + np.cumsum(walk * rng.standard_normal(n)), dt, LEAST).begin)


@pytest.mark.thorough
@pytest.mark.parametrize(('seed', 'q'), [(0, 5.0), (1, 10.0), (2, 5.0)])
def test_a_band_whose_level_wanders_is_no_knocks(seed, q):
    """It goes beyond any threshold, a little and again and again."""
    rng, n = np.random.default_rng(seed), 400_000
    r = np.exp(-np.pi * 25.0 / q * DT)
    band = lfilter([1.0], [1.0, -2 * r * np.cos(2 * np.pi * 25.0 * DT), r * r],
                   rng.standard_normal(n))
    level = lfilter([1.0], [1.0, -np.exp(-DT / 20)], rng.standard_normal(n)) * np.sqrt(2 * DT / 20)
    y = rng.standard_normal(n) + np.exp(0.5 * level) * band / np.std(band)
    assert not len(find_rings(y, DT, LEAST).begin)


def wandering(seed):
    """Return samples of noise of variance 1 with a motor in them whose speed wanders."""
    rng, n, dt = np.random.default_rng(seed), 30_000, 0.005
    tc, wander, size = rng.uniform(0.5, 8), rng.uniform(0.3, 3), rng.uniform(0.2, 1.5)
    a = np.exp(-dt / tc)
    frequency = 50 + wander * lfilter([np.sqrt(1 - a * a)], [1.0, -a], rng.standard_normal(n))
    on = np.arange(n) * dt % 100 < 60 if seed % 2 else 1.0
    return rng.standard_normal(n) + size * on * np.cos(2 * np.pi * np.cumsum(frequency) * dt)


@pytest.mark.thorough
def test_where_a_line_lingers_that_wanders_it_is_no_knock():
    """Of five of these seven it was one: what lingers for a second rings for a second."""
    assert sum(len(find_rings(wandering(seed), 0.005, LEAST).begin) > 0
               for seed in (1, 2, 7, 10, 15, 16, 18)) <= 1


def test_knocks_beside_a_line_that_wanders_are_found():
    y = knocked(wandering(2), (30.0, 80.0), 30.0, 0.2, 40.0, dt=0.005)
    assert np.allclose(find_rings(y, 0.005, LEAST).begin * 0.005, (30.0, 80.0), atol=0.06)


@pytest.mark.parametrize('seed', daily((3, 11, 14, 18, 22), 3))
def test_a_telegraph_of_short_dwells_is_no_knock(seed):
    """Of all of these it was one: up and down and up again in 20 ms."""
    rng, n = np.random.default_rng(seed), 60_000
    levels = np.cumsum(rng.random(n) < 0.004) % 2
    assert not len(find_rings(rng.standard_normal(n) + 6 * levels, 0.001, LEAST).begin)


def test_the_ends_of_what_a_notch_filtered_are_no_knocks():
    """Mirrored there a record has what the filter took out of it: 35 nats of the second."""
    for seed in (2, 23):
        rng, n = np.random.default_rng(seed), 17_500
        y = lfilter(*iirnotch(8.75, 1.6, fs=50), rng.standard_normal(n))
        y += 0.02 * rng.standard_normal(n)
        assert not len(find_rings(y, 0.02, LEAST).begin)


@pytest.mark.parametrize('seed', daily((5, 9, 14), 5))
def test_lines_that_join_held_samples_do_not_ring_where_a_filter_takes_out(seed):
    """They bend there, and a notch took nothing out of that: one record in five had knocks."""
    rng, n, dt = np.random.default_rng([seed, 96]), 22_500, 0.008
    y = lfilter(*iirnotch(51.0, 51.0 / 37, 1 / dt), rng.standard_normal(n + 100))[100:]
    y += 0.06 * rng.standard_normal(n)
    held = np.convolve(rng.random(n) < 0.001, np.ones(8))[:n] > 0
    held[0] = False
    y = y[np.maximum.accumulate(np.where(held, 0, np.arange(n)))]
    assert not shock._rings_in(y, dt)[0].size
    assert find_rings(shock._joined_by_lines(y), dt, LEAST).begin.size


@pytest.mark.thorough
def test_weak_knocks_are_named_and_nothing_remains():
    """Two of 25 nats, in a record of a sensor with drift."""
    rng, n, dt = np.random.default_rng(6), 30_000, 0.02
    sensor = hidden.draw_sensor(rng)
    y = np.column_stack([hidden.base_noise(n, dt, sensor, rng) for _ in range(3)])
    sigma = np.std(np.diff(y[:, 0])) / np.sqrt(2)
    y[:, 0] += sigma * knocked(np.zeros(n), (101.0, 377.0), 9.0, 0.3, 25.0, dt)
    problem = NoiseProblem(gather(ImuRecord(y, None, np.arange(n) * dt, 1 / dt), ['gyro_x'])
                           ['gyro_x'])
    fit = problem.fit(model_of('noise', ('white', 'flicker', 'random_walk')))
    found = diagnose(State(problem, fit, problem.held_out(fit.model)))
    assert [f.name for f in found.found] == ['shock'] and found.remaining is None
    assert found.found[0].effect['ring'] == pytest.approx(9.0, abs=0.5)


def test_what_is_put_in_is_found_with_its_values():
    """Its own simulation: rate, size, decay and frequency of a ring."""
    shock = find_effect('noise', 'shock')({'rate': 0.02, 'size': 8.0, 'decay': 0.2, 'ring': 12.0})
    rng, n = np.random.default_rng(1), 40_000
    inputs = Inputs(np.arange(n) * DT, DT)
    y = shock.apply(rng.standard_normal(n), inputs, rng)
    kept = shock.statistics(y, inputs)
    assert np.median(kept['ring']) == pytest.approx(12.0, rel=0.02)
    assert np.median(kept['size']) == pytest.approx(8.0, rel=0.1)
    assert np.median(kept['decay']) == pytest.approx(0.2, rel=0.15)
    assert np.std(shock.screen(y, kept, inputs)) < 1.03


@pytest.mark.parametrize('begins', daily([20_000, 31_000], 20_000))
def test_a_knock_where_noise_is_louder_than_in_all_of_the_record_stands_out_of_that(begins):
    """The spectrum is that of all the record: beside it, all that is louder would stand out."""
    n, t = 36_000, np.arange(700)
    for seed in range(3):
        rng = np.random.default_rng([41, seed])
        y = rng.standard_normal(n) * np.where(np.arange(n) < 14_000, 1.0, 1.2)
        y[begins:begins + 700] += 2.8 * np.exp(-t / 85) * np.cos(0.62 * t)
        rings = find_rings(y, 0.002, 7.0)
        assert np.sum(np.abs(rings.begin - begins) < 8) == 1 and np.sum(rings.nats) < 100


@pytest.mark.thorough
def test_a_knock_that_ends_where_noise_falls_stands_out_of_the_louder():
    """Beside the mean of both sides all that is louder there would, and be no ring."""
    for seed in range(3):
        rng = np.random.default_rng([43, seed])
        noise = rng.standard_normal(60_000) * np.where(np.arange(60_000) < 8000, 1.2, 1.0)
        y = knocked(noise, (5.9, 30.0), 27.0, 0.3, 150.0, dt=0.001, rng=rng)
        assert np.any(np.abs(find_rings(y, 0.001, LEAST).begin - 5900) < 30)


@pytest.mark.thorough
@pytest.mark.parametrize('real', [False, True])
@pytest.mark.parametrize('seed', [12, 17, 22])
def test_what_stays_on_the_levels_of_a_coarse_grid_is_no_shock(seed, real):
    """Of noise less than the counts of an angle some blocks are far from normal by chance."""
    rng, n, dt = np.random.default_rng([22, seed]), 270_000, 2.5e-4
    rate = 0.3 * (np.cumsum(rng.random(n) < dt / 3) % 2 - 0.5)
    angle = np.cumsum(rate + 0.05 * rng.standard_normal(n)) + 0.25 * rng.standard_normal(n)
    if real:
        angle[150_000:151_000] += 3 * np.exp(-np.arange(1000) / 200) * rng.standard_normal(1000)
    found = find_effect('noise', 'shock').statistics(
        1e-3 * np.diff(np.round(angle)), Inputs(dt * np.arange(n - 1), dt))
    assert bool(found and np.sum(found['worth']) > 0) == real


@pytest.mark.parametrize('what, count, told', [
    ('knock', 4, True), ('knock', 2, False), ('burst', 4, False), ('spike', 4, False)])
@pytest.mark.parametrize('seed', daily(range(3), 0))
def test_knocks_that_hardly_swing_are_told_by_several_that_are_alike(what, count, told, seed):
    """Of four samples and less than half a swing each: one by itself is a spike as well."""
    rng, n = np.random.default_rng([seed, 61]), 20_000
    y, t = rng.standard_normal(n), np.arange(40)
    knock = np.exp(-t / 4) * np.cos(2 * np.pi * 0.1 * t)
    for begin in (np.arange(count) * n) // count + rng.integers(500, 4500, count):
        size = rng.uniform(10, 20)
        form = {'knock': knock, 'spike': t == 0,
                'burst': rng.choice([-1, 1], 40) * rng.uniform(0.3, 1, 40) * (t < 4)}[what]
        y[begin:begin + 40] += size * form
    rings = find_rings(y, 0.04, LEAST)
    assert len(rings.begin) == count * told
    if told:
        assert np.allclose(rings.tau, 4, rtol=0.35)
