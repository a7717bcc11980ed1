# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Two levels far apart: a short stay at the other is neither a spike nor a knock."""

from itertools import product

import numpy as np
from params import daily
import pytest
from scipy.signal import butter, lfilter
from scipy.stats import multivariate_normal, norm

from hidden import flicker, white
from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.loop.effect import model_of, registry
from imu_noise_tools.noise.effects import rts
from imu_noise_tools.noise.gather import gather
from imu_noise_tools.noise.problem import NoiseProblem
from imu_noise_tools.noise.telegraph import levels


def telegraph(rng, n, dwells, step):
    """Return a path (n,) between 0 and a step, with exponential stays of a mean length each."""
    ends = np.cumsum(rng.exponential(np.resize(dwells, 4 * int(n / np.mean(dwells)) + 20)))
    return step * (np.searchsorted(ends, np.arange(n)) % 2)


def knock(n, at, size):
    """Return a knock (n,) that rings down, of an amplitude at its beginning."""
    t = np.maximum(np.arange(n) - at, 0)
    return np.where(np.arange(n) >= at, size * np.exp(-t / 12) * np.cos(2 * np.pi * t / 9), 0.0)


@pytest.mark.parametrize('seed', range(12))
def test_levels_are_followed_through_noise_and_drift(seed):
    """Beside them is the noise alone, as wide, with nothing as large as half a jump."""
    rng = np.random.default_rng([441, seed])
    n = int(rng.integers(5000, 60000))
    step = rng.uniform(10, 60)
    noise = rng.standard_normal(n)
    drift = rng.uniform(0, 8) * np.sin(2 * np.pi * np.arange(n) / n)
    stays = rng.uniform(40, 400, 2)
    path = telegraph(rng, n, stays, step)
    y = 3e-4 * (noise + drift + path)
    at = levels(y)
    assert at is not None
    jumps = np.flatnonzero(np.diff(path))   # drift is followed from the first to the last
    beside = ((y - at) / 3e-4)[jumps[0]:jumps[-1]]
    assert np.std(beside) < 1.3
    assert np.max(np.abs(beside)) < 0.5 * step


@pytest.mark.parametrize('seed', range(6))
def test_a_knock_and_spikes_stay_beside_levels(seed):
    """What goes beyond both levels is left where it was."""
    rng = np.random.default_rng([442, seed])
    n, step = 20000, rng.uniform(12, 25)
    path = telegraph(rng, n, (150, 400), step)
    long = np.flatnonzero(np.convolve(path != path[0], np.ones(80), 'same') == 0)
    here = int(rng.choice(long[(long > 200) & (long < n - 200)]))
    y = rng.standard_normal(n) + path + knock(n, here, 3 * step)
    spikes = rng.choice(np.flatnonzero(np.abs(np.arange(n) - here) > 300), 5, replace=False)
    y[spikes] += 5 * step
    at = levels(y)
    assert at is not None
    beside = y - at
    assert beside[here] == pytest.approx(3 * step, abs=0.3 * step)
    assert np.sum(beside[spikes] > 3 * step) >= 4    # one may fall into a jump


def test_what_jumps_between_no_two_levels_has_none():
    """Noise, drift, swings, single steps, stairs of many levels, spikes, and held samples."""
    rng = np.random.default_rng(443)
    n = 20000
    white, t = rng.standard_normal(n), np.arange(n)
    records = {
        'noise': white,
        'drift': white + 40 * t / n,
        'swing': white + 40 * np.sin(2 * np.pi * t / 300),
        'fast swing': white + 40 * np.sin(2 * np.pi * t / 21),
        'two steps': white + 30 * ((t > 5000) & (t < 9000)),
        'stairs': white + np.cumsum(rng.normal(0, 20, 40))[t // 500],
        'walk': white + np.cumsum(rng.standard_normal(n)),
        'spikes': white + 30 * (rng.random(n) < 0.02) * rng.standard_normal(n),
        'knocks': white + sum(knock(n, at, 40) for at in range(500, n, 700)),
        'on and off': white * np.where(t // 1500 % 2, 30, 1),
        'held': np.repeat(white[: n // 4] + telegraph(rng, n // 4, (300,), 20), 4),
        'constant': np.zeros(n),
        'short': white[:100],
    }
    assert [k for k, y in records.items() if levels(y) is not None] == []


@pytest.mark.parametrize('share', [0.9, 1.2])
def test_levels_of_coarsely_rounded_samples(share):
    """The median of whole steps is a step: samples scatter by more than that says."""
    rng = np.random.default_rng([443, int(10 * share)])
    path = telegraph(rng, 16_000, (55, 270), 18.0)
    y = np.round((rng.standard_normal(16_000) + path) / share) * share
    at = levels(y)
    assert at is not None and np.std(y - at) < 1.3


@pytest.mark.parametrize('seed', range(6))
def test_a_burst_that_hides_a_jump_is_left_beside_the_levels(seed):
    """It goes beyond both levels; that the level is another behind it makes it no part of them."""
    rng = np.random.default_rng([445, seed])
    n, step, length = 20_000, rng.uniform(9, 12), int(rng.integers(3, 8))
    path = telegraph(rng, n, (150, 80), step)
    jumps = np.flatnonzero(np.diff(path))
    alone = np.minimum(np.diff(jumps, prepend=0), np.diff(jumps, append=n)) > 60
    where = rng.choice(jumps[alone], 20, replace=False)[:, None] \
        + np.arange(length) - int(rng.integers(length))
    y = rng.standard_normal(n) + path
    y[where] += rng.choice([-1, 1], where.shape) * rng.uniform(1.6, 2.5, where.shape) * step
    at = levels(y)
    assert at is not None
    assert np.mean(np.abs(y - at)[where] > 0.5 * step) > 0.9


@pytest.mark.parametrize('seed', range(6))
def test_levels_are_seen_beside_lines_that_hide_the_jumps(seed):
    """A machine swings by more than the noise, and the lines stay as they are."""
    rng = np.random.default_rng([446, seed])
    n, t = 40_000, np.arange(40_000)
    step = rng.uniform(12, 30)
    path = telegraph(rng, n, rng.uniform(300, 3000, 2), step)
    lines = sum(rng.uniform(0.1, 0.2) * step * np.cos(2 * np.pi * f * t + 6 * rng.random())
                for f in rng.uniform(0.05, 0.45, 3))
    at = levels(rng.standard_normal(n) + path + lines)
    assert at is not None
    left = at - path
    jumps = np.flatnonzero(np.diff(path))
    left = (left - np.median(left))[jumps[0]:jumps[-1]]
    assert np.mean(np.abs(left) > 0.1 * step) < 0.01


def test_lines_alone_have_no_levels():
    """Nor have those that come and go, swell or wander, steps beside them, and spikes."""
    rng = np.random.default_rng(447)
    n, t = 40_000, np.arange(40_000)
    for f in rng.uniform(0.02, 0.45, 3):
        phase = 2 * np.pi * f * t
        line = 20 * np.cos(phase)
        wander = np.cumsum(rng.standard_normal(n)) * 0.02
        records = {
            'line': line, 'on and off': line * (t // 1500 % 2),
            'swells': line * (1 + np.cos(2 * np.pi * t / 900)),
            'wanders': 20 * np.cos(phase + wander),
            'two steps': line + 30 * ((t > 9_000) & (t < 25_000)),
            'stairs': line + np.cumsum(rng.normal(0, 20, 40))[t // 1000],
            'spikes': line + 60 * (rng.random(n) < 0.003) * rng.standard_normal(n),
        }
        white = rng.standard_normal(n)
        assert [k for k, y in records.items() if levels(white + y) is not None] == []


@pytest.mark.thorough
@pytest.mark.parametrize('seed', range(2))
@pytest.mark.parametrize('two', [True, False])
def test_levels_are_told_behind_a_filter_that_remembers(seed, two):
    """Samples further apart than it remembers tell two levels from a relaxation."""
    rng = np.random.default_rng([448, seed])
    n, dt = 34_000, 0.005
    y = 1e-4 * lfilter(np.ones(12) / 12, [1], rng.standard_normal((n, 3)), axis=0)
    slow = telegraph(rng, n, (72, 35), 2.0) if two else lfilter(
        [np.sqrt(1 - 0.958**2)], [1, -0.958], rng.standard_normal(n))
    y[:, 0] += 7e-5 * lfilter(np.ones(12) / 12, [1], slow - np.mean(slow))
    record = ImuRecord(y, None, np.arange(n) * dt, 1 / dt)
    problem = NoiseProblem(gather(record, ['gyro_x'])['gyro_x'])
    fit = problem.point(model_of('noise', ['white', 'low_pass', 'rts']))
    assert fit.model['rts']['tau'] == pytest.approx(0.22 if two else 0.23, rel=0.2)
    bonus = fit.model['rts'].bonus(problem.evidence, fit)
    assert bonus > 30 if two else bonus < 3


@pytest.mark.parametrize('of', daily(
    ((0.157, 6.0, 3.0), (0.06, 6.0, 3.0), (0.3, 2.0, 3.0), (0.0872, 27.8, 0.66)),
    (0.157, 6.0, 3.0)))
@pytest.mark.parametrize('two', [True, False])
def test_dwells_of_no_more_than_a_filter_remembers_are_told(two, of):
    """What is white but for little is not taken for white: the last was 80 nats on one side."""
    tau, cutoff, size = of
    rng, n, dt, times = np.random.default_rng([451, int(1e4 * tau)]), 70_000, 0.005, 4
    keep = np.exp(-2 * dt / times / tau)
    x = 2.0 * (np.cumsum(rng.random(n * times) < 0.5 * (1 - keep)) % 2) - 1 if two else lfilter(
        [np.sqrt(1 - keep**2)], [1, -keep], rng.standard_normal(n * times))
    x = size * x + 0.18 * np.sqrt(times / dt) * rng.standard_normal(n * times)
    x = lfilter(*butter(2, 2 * cutoff * dt / times), x)[::times]
    y = 1e-6 * np.column_stack([x, *rng.standard_normal((2, n))])
    y[:, 0] += 3e-8 / np.sqrt(dt) * rng.standard_normal(n)
    record = ImuRecord(y, None, np.arange(n) * dt, 1 / dt)
    problem = NoiseProblem(gather(record, ['gyro_x'])['gyro_x'])
    fit = problem.point(model_of('noise', ['white', 'flicker', 'random_walk', 'low_pass', 'rts']))
    bonus = fit.model['rts'].bonus(problem.evidence, fit)
    least = 10 if size > 1 else -3     # a weak one may not be told, but for what it is not
    assert bonus > least if two else bonus < -least


@pytest.mark.parametrize('later, asked', [
    (['sinusoid', 'low_pass'], True), (['ramp'], True), (['sinusoid', 'narrowband'], False)])
def test_a_relaxation_is_asked_for_its_kind_beside_what_moves_its_levels(later, asked):
    """What the samples know of it goes with the noise that a filter leaves, and with means."""
    kinds = {k: cls() for k, cls in registry('noise').items()}
    some = {k: set(NoiseProblem.exchanges(None, e, [kinds[x] for x in later]))
            for k, e in kinds.items()}
    assert {k for k, v in some.items() if v} == ({'gauss_markov', 'rts'} if asked else set())
    assert all(v == {'gauss_markov', 'rts'} for v in some.values() if v)


def test_both_chains_have_their_probability():
    """That of an AR(1), of two levels over all paths, and of a random walk beside either."""
    rng = np.random.default_rng(449)
    k, width, tau = 7, 2.0, 5.0
    z = rng.standard_normal((2, k))
    loud = rng.uniform(0.5, 2.0, (2, k))
    i = np.arange(k)
    keep = np.exp(-2 * width / tau)
    constant = 2 * k * 0.5 * np.log(2 * np.pi)

    def normal(power, noise, drift):
        apart, earlier = np.abs(i[:, None] - i), np.minimum(i[:, None], i)
        return sum(multivariate_normal.logpdf(
            y, cov=power * keep**apart + np.diag(noise * here)
            + drift * (rts._UNKNOWN + earlier)) for y, here in zip(z, loud)) + constant

    def of(chain, step, noise, drift, *share):
        values = (np.array([float(v)]) for v in (step, tau, noise, drift, *share))
        return float(np.max(chain(z, loud, width, *values)))

    for step, noise, drift in ((2.0, 0.5, 0.0), (1.0, 1.0, 0.3)):
        assert of(rts._gauss_markov, step, noise, drift) == pytest.approx(
            normal(0.25 * step**2, noise, drift))
    assert of(rts._two_levels, 1e-9, 0.7, 0.3, 0.4) == pytest.approx(normal(0.0, 0.7, 0.3))
    step, share = 2.0, 0.3
    level = 0.5 * step / np.sqrt(share * (1 - share)) * np.array([-share, 1 - share])
    part = np.array([1 - share, share])
    moves = keep * np.eye(2) + (1 - keep) * part
    total = 0.0
    for y, here in zip(z, loud):
        paths = np.array(list(product([0, 1], repeat=k)))
        chance = part[paths[:, 0]] * np.prod(moves[paths[:, :-1], paths[:, 1:]], axis=1)
        likely = np.prod(norm.pdf(y, level[paths], np.sqrt(0.5 * here)), axis=1)
        total += np.log(np.sum(chance * likely))
    assert of(rts._two_levels, step, 0.5, 0.0, share) == pytest.approx(total + constant)


@pytest.mark.thorough
@pytest.mark.parametrize('two', [True, False])
@pytest.mark.parametrize('seed', range(2))
def test_levels_are_told_beside_flicker(seed, two):
    """What wanders between the levels is none of either: a relaxation was 55 nats likelier."""
    rng = np.random.default_rng([450, seed])
    n, dt, size = 60_000, 0.1, 1e-4
    slow = telegraph(rng, n, (90, 60), 2.0) if two else lfilter(
        [np.sqrt(1 - 0.972**2)], [1, -0.972], rng.standard_normal(n))
    y = 3e-4 * rng.standard_normal((n, 3))
    y[:, 0] = white(n, dt, size, rng) + flicker(n, dt, 1.2 * size, rng) \
        + 3.2 * size * (slow - np.mean(slow))
    record = ImuRecord(y, None, np.arange(n) * dt, 1 / dt)
    problem = NoiseProblem(gather(record, ['gyro_x'])['gyro_x'])
    fit = problem.point(model_of('noise', ['white', 'flicker', 'random_walk', 'rts']))
    bonus = fit.model['rts'].bonus(problem.evidence, fit)
    assert bonus > 10 if two else bonus < 0
