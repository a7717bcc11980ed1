# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is told from the samples: grids, held samples, spikes, each beside the others."""

from __future__ import annotations

from dataclasses import replace

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
from params import daily, seldom
import pytest
from scipy.signal import butter, lfilter
from scipy.special import ndtr

from imu_noise_tools.core import spectrum
from imu_noise_tools.core.allan import overlapping_variance
from imu_noise_tools.core.record import AXES, ImuRecord, Memory
from imu_noise_tools.core.statistics import (
    grid_gain, grid_step, means_of_blocks, middle_sigma, repeats, robust_sigma
)
from imu_noise_tools.loop.effect import find_effect, Model, model_of
from imu_noise_tools.loop.prediction import fall_of
from imu_noise_tools.loop.verdict import FALL
from imu_noise_tools.noise import repeated
from imu_noise_tools.noise.behind import model_psd
from imu_noise_tools.noise.curve import effect_avar
from imu_noise_tools.noise.effects.rate_quantization import RateQuantization
from imu_noise_tools.noise.effects.shock import _beyond_the_spectrum, _fainter, _loud
from imu_noise_tools.noise.effects.spikes import _gain, _swing, Spikes
from imu_noise_tools.noise.gather import gather
from imu_noise_tools.noise.in_frequency import coherence
from imu_noise_tools.noise.kinds import Inputs, Response, Spectrum
from imu_noise_tools.noise.level import in_motion
from imu_noise_tools.noise.likelihood import Likelihood
from imu_noise_tools.noise.problem import NoiseProblem
from imu_noise_tools.noise.rounded import (
    added_by_rounding, before_rounding, colour_of_turns, moved_by_rounding, turns_of_counts
)
from imu_noise_tools.noise.slower import as_measured, shown_first
from imu_noise_tools.tasks.noise import analyse_record

SPIKES, DUPLICATES, SHOCK = (
    find_effect('noise', k) for k in ('spikes', 'duplicates', 'shock'))
N = 40_000


def noise(seed, n=N):
    """Return white noise of variance 1."""
    return np.random.default_rng(seed).standard_normal(n)


def with_spikes(y, seed, count=60, sigma=40.0):
    """Return y with spikes, and where they are."""
    rng = np.random.default_rng(seed)
    at = np.sort(rng.choice(np.arange(10, len(y) - 10), count, replace=False))
    out = y.copy()
    out[at] += sigma * np.where(rng.random(count) < 0.5, -1, 1) * rng.uniform(0.5, 2, count)
    return out, at


def found(y):
    """Return the samples that spikes fill, and y without them."""
    inputs = Inputs(np.arange(len(y)) * 0.01, 0.01)
    kept = SPIKES.statistics(y, inputs)
    return kept.get('index', np.zeros(0, int)), SPIKES.screen(y, kept, inputs) if kept else y


def held_at_random(y, share, seed=1, run=1):
    """Return y with a share of its samples repeating the one before, run of them each time."""
    begun = np.random.default_rng(seed).random(len(y)) < 1 - (1 - share) ** (1 / run)
    fresh = np.convolve(begun, np.ones(run))[:len(y)] == 0
    fresh[0] = True
    return y[np.maximum.accumulate(np.where(fresh, np.arange(len(y)), 0))]


# --- grids ---------------------------------------------------------------------------------------

@given(st.floats(0.3, 4.0), st.floats(1e-6, 1e3), st.integers(0, 2**31))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_a_grid_is_found_whatever_its_size_and_with_spikes_off_it(step, unit, seed):
    y = step * unit * np.round(noise(seed) / step + 0.3)
    assert grid_step(y)[0] == pytest.approx(step * unit, rel=1e-6)
    spiked, _ = with_spikes(y / unit, seed)
    assert grid_step(spiked * unit)[0] == pytest.approx(step * unit, rel=1e-6)


@pytest.mark.parametrize('step', [0.06, 0.3, 1.5])
@pytest.mark.parametrize('stored', [np.float64, np.float32])
@pytest.mark.parametrize('drift', [77.0, 300.0])
def test_a_grid_is_found_under_a_drift_that_visits_few_levels_twice(step, stored, drift):
    y = step * np.round((noise(4) + np.linspace(0, drift, len(noise(4)))) / step + 0.3)
    y = y.astype(stored).astype(float)
    assert grid_step(y)[0] == pytest.approx(step, rel=1e-4)
    assert not repeats(y).held
    assert step > 1 or repeats(held_at_random(y, 0.3)).held


def test_noise_has_no_grid_nor_has_what_is_held_of_it():
    assert grid_step(noise(0))[0] == 0.0
    assert grid_step(held_at_random(noise(0), 0.8))[0] == 0.0


def test_the_size_of_the_noise_is_that_without_outliers():
    y, _ = with_spikes(noise(2), 3)
    assert middle_sigma(noise(2)) == pytest.approx(1, abs=0.02)
    assert robust_sigma(y) == pytest.approx(1, abs=0.02) and np.std(np.diff(y)) > 2


@pytest.mark.parametrize('step, shows', [
    seldom(0.0, False), (0.3, False), (0.7, True), seldom(2.0, True)])
def test_levels_are_a_view_of_their_own_until_they_are_in_the_model(step, shows):
    """Rounded, the spectrum stays white: nothing but the levels shows it."""
    y = step * np.round(noise(8) / step) if step else noise(8)
    y = np.column_stack([y, noise(9), noise(10)])
    problem = NoiseProblem(gather(
        ImuRecord(y, None, np.arange(N) * 0.01, 100.0), ['gyro_x'])['gyro_x'])
    white, more = (model_of('noise', k) for k in (('white',), ('white', 'rate_quantization')))
    for model, fails in ((white, shows), (more, False)):
        said = [f.p_value for f in problem.omnibus(problem.point(model)) if f.view == 'grid']
        assert [p < 1e-6 for p in said] == [fails] * shows
    fall = fall_of(problem.held_out(white), problem.held_out(more), [more['rate_quantization']])
    assert (fall > FALL) == shows


@pytest.mark.parametrize('step, quiet, told', [
    (1.0, 0.5, 0.5), (1.0, 1.0, 1.0), (1.0, 0.1, 0.1), (0.3, 0.5, 0.0)])
def test_a_grid_is_as_coarse_as_where_it_is_quiet(step, quiet, told):
    """What is loud now and then hides it there, and nowhere else."""
    rng, n = np.random.default_rng(30), 20_000
    loud = np.arange(n) >= quiet * n
    y = step * np.round(np.where(loud, 6.0, 1.0) * rng.standard_normal(n) / step)
    found = RateQuantization.statistics(y, Inputs(np.arange(n) * 0.01, 0.01))
    assert found['step'] == pytest.approx(step)
    assert found['told'] == pytest.approx(told, abs=0.06)
    gain = grid_gain(n * found['told'], float(found['step']), float(found['sigma']))
    assert (gain > 0.2 * n * quiet) == (told > 0.2), 'of little that is quiet it is not sure'


@pytest.mark.parametrize('ratio', [2.0, 2.6, 3.0])
@pytest.mark.parametrize('place', [0.0, 0.25, 0.5])
def test_the_noise_below_a_coarse_grid_is_told_by_its_levels(ratio, place):
    """Wherever the mean stands, moving or not: the power of the samples moves with it."""
    louder = np.where(np.arange(N) < N // 2, 1.0, 1.5)
    for move in (0.0, 3 * ratio):
        y = np.sqrt(louder) * noise(6) + place * ratio + np.linspace(0, move, N)
        x, w = before_rounding(ratio * np.round(y / ratio), ratio)
        half = len(x) // 2
        assert np.average(x, weights=w) == pytest.approx(1)
        first, second = (np.average(x[i], weights=w[i])
                         for i in (slice(half), slice(half, None)))
        assert second / first == pytest.approx(1.5, abs=0.15)
    y = noise(7) + np.linspace(0, 3 * ratio, N)
    x, w = before_rounding(ratio * np.round(y / ratio), ratio)
    assert np.sqrt(np.mean(w / 2 * np.log(x) ** 2)) == pytest.approx(1, abs=0.2)


def level_note(axis):
    """Return what is said of the white noise of an axis."""
    return NoiseProblem(axis).fit(model_of('noise', ('white',))).estimates['white']['N'].note


@pytest.mark.parametrize('ratio, place, most', [
    (2.2, 0.5, 1.1), (6.0, 0.05, 1.1), seldom(6.0, 0.3, 1.2), seldom(6.0, 0.5, 1.6)])
def test_what_a_coarse_grid_hides_at_rest_is_told_as_it_is_in_motion(ratio, place, most):
    """
    Told is how large errors are that are made in motion, with a limit where nothing tells.

    With the mean on a level a sensor looks quieter than it is. Half-way to the next one samples
    stand on both alike, however loud the noise is.

    """
    rest = noise(21) + place * ratio
    at = ImuRecord(None, np.stack([ratio * np.round(rest / ratio), noise(22), noise(23)], 1),
                   np.arange(N) / 100, 100.0)
    axes = gather(at, ['accel_x', 'accel_y'])
    moving = noise(24) + np.linspace(0, 40 * ratio, N)
    error = ratio * np.round(moving / ratio) - np.linspace(0, 40 * ratio, N)
    true = np.std(error) / np.sqrt(100)
    assert 0.97 * true < in_motion(axes['accel_x']) < most * true
    note = level_note(axes['accel_x'])
    assert 'coarser than the noise' in note and 'while the sensor moves' in note
    assert in_motion(axes['accel_y']) == 0.0
    two = replace(axes['accel_x'], before=np.array([0.8, 1e4]))     # not one noise
    assert in_motion(two) == pytest.approx(ratio * np.sqrt((0.25 + 1 / 12) / 100))


@pytest.mark.parametrize('place, most', [(0.05, 1.1), seldom(0.1, 1.1), seldom(0.3, 1.75)])
def test_what_is_loud_for_a_part_does_not_hide_that_the_rest_is_coarse(place, most):
    """What a machine moves over many levels is not the noise of the sensor."""
    machine = (np.arange(N) > N // 2) & (np.arange(N) < N * 2 // 3)
    y = noise(25) + 6.0 * place + np.where(machine, 20.0, 0.0) * noise(26)
    record = ImuRecord(None, np.stack([6.0 * np.round(y / 6.0), y, noise(27)], 1),
                       np.arange(N) / 100, 100.0)
    axes = gather(record, ['accel_x', 'accel_y'])
    true = np.sqrt((1 + 6.0**2 / 12) / 100)
    assert 0.97 * true < in_motion(axes['accel_x']) < most * true
    assert in_motion(axes['accel_y']) == 0.0
    told = 'of one)' in level_note(axes['accel_x'])
    limit = 6.0 * np.sqrt((0.5**2 + 1 / 12) / 100)
    assert told == (in_motion(axes['accel_x']) < 0.999 * limit), 'what nothing tells is not given'


@pytest.mark.thorough
def test_what_is_loud_in_a_band_below_a_coarse_grid_says_the_less_of_its_noise():
    """For as long as the band is narrow it goes up and down; a line is as loud all the time."""
    swing = np.exp(-0.003 + 0.06j)
    told, off = [], []
    for seed in range(12):
        band = lfilter([1.0], [1.0, -2 * swing.real, abs(swing)**2], noise(seed))
        y = noise(100 + seed)
        for more in (0.0, 1.4 * np.sin(0.06 * np.arange(N)), band / np.std(band)):
            x, w = before_rounding(3.0 * np.round((y + more) / 3), 3.0)
            told.append(float(np.mean(w)))
        half = len(x) // 2
        apart = np.average(x[:half], weights=w[:half]) - np.average(x[half:], weights=w[half:])
        off.append(apart / np.sqrt(2 / np.sum(w[:half]) + 2 / np.sum(w[half:])))
    white, line, loud = np.mean(np.reshape(told, (-1, 3)), axis=0)
    assert line > 0.25 * white and loud < 0.1 * white
    assert 0.3 < np.sqrt(np.mean(np.square(off))) < 2


def test_jumps_between_levels_are_no_bursts_where_samples_are_held():
    """Nine times each, now and then; levels were not told there, and stood in for knocks."""
    rng = np.random.default_rng(10)
    y = noise(10) + 18 * (np.cumsum(rng.random(N) < 1 / 2000) % 2)
    held = np.convolve(rng.random(N) < 0.02, np.ones(9))[:N] > 0
    y = y[np.maximum.accumulate(np.where(held, 0, np.arange(N)))]
    spikes = find_effect('noise', 'spikes')
    for more, least in ((0.0, 0), (25.0, 50)):
        y[50:-50:N // 60] += more
        kept = spikes.statistics(y, Inputs(np.arange(N) * 0.01, 0.01, {}))
        assert least <= len(kept['size']) <= least + 12


@pytest.mark.parametrize('kind', ['white', 'filtered', 'quieter at times'])
@pytest.mark.parametrize('seed', range(8))
def test_a_few_runs_of_one_length_are_held_samples(kind, seed):
    """Of 28 000 samples 18 begin to be held, for eight each: the grid makes 600 pairs equal."""
    rng, n = np.random.default_rng([21, seed]), 28_000
    y = rng.standard_normal(n)
    if kind == 'filtered':
        y = lfilter([0.5], [1, -0.5], y)
    elif kind != 'white':
        y[n // 2:n // 2 + 2000] /= 4
    held = y.copy()
    for k in rng.integers(0, n - 10, 18):
        held[k:k + 8] = held[k]
    for samples, is_held in ((y, False), (held, True)):
        assert repeats(0.07 * np.round(samples / 0.07)).held == is_held


def test_where_all_samples_stand_on_one_level_nothing_is_told():
    assert not before_rounding(np.r_[8.0 * np.round(noise(6) / 8), 8.0], 8.0).size


@pytest.mark.thorough
@pytest.mark.parametrize('drift', [0, 3])
@pytest.mark.parametrize('keep', [0.2, 0.6, 0.9])
@pytest.mark.parametrize('sigma, place', [(0.22, 0.0), (0.3, 0.45), (0.5, 0.2)])
def test_what_a_coarse_grid_adds_has_the_colour_of_the_noise(sigma, place, keep, drift):
    """What is left of the samples beside the share of the noise that passes, piece by piece."""
    rng, n = np.random.default_rng(3), 400_000
    x = lfilter([np.sqrt(1 - keep**2)], [1, -keep], rng.standard_normal(n))
    y = np.round(place + drift * np.arange(n) / n + sigma * x)
    x, left = (v.reshape(100, -1) - np.mean(v.reshape(100, -1), axis=1, keepdims=True)
               for v in (x, y))
    left -= np.mean(left * x, axis=1, keepdims=True) * x
    wanted = [np.mean(left[:, k:] * left[:, :left.shape[1] - k]) for k in range(4)]
    added = added_by_rounding(y, 1.0, robust_sigma(y))
    assert added[:4] == pytest.approx(wanted, abs=0.07 * wanted[0])
    # of finer steps all that is there is white
    fine = np.round(2 * y + rng.standard_normal(n))
    assert added_by_rounding(fine, 1.0, 1.0) == pytest.approx([1 / 12])


@pytest.mark.parametrize('noise', [0.2, 0.3, 0.4, 0.7])
def test_what_rounding_moves_a_mean_by_is_its_largest_error_of_two(noise):
    """As the distribution function of normal noise has it; where the noise is the least."""
    m, k = np.linspace(-0.5, 0.5, 401), np.arange(-20, 20) + 0.5
    seen = np.sum(ndtr((m[:, None] - k) / noise) - (k < 0), axis=1)
    want, sigma = np.ptp(seen - m), np.sqrt(noise**2 + 1 / 12)
    none = np.zeros((2, 0))
    found = moved_by_rounding(3.0, 3 * sigma, none) / 3
    assert found == (pytest.approx(want, rel=0.06) if noise < 0.5 else 0)
    calm = np.array([np.repeat([1.1, 0.25], [224, 32]), np.full(256, 40.0)])
    assert moved_by_rounding(3.0, 3 * sigma, calm) == pytest.approx(
        moved_by_rounding(3.0, 3 * np.sqrt(noise**2 / 4 + 1 / 12), none) if found else 0)


@pytest.mark.thorough
def test_a_filter_before_an_angle_s_rounding_gains_what_a_relaxation_gains_that_bends_alike():
    """Where it was bounded by what few bands lose without it, it gained 17 nats less of 460."""
    rng, n, dt = np.random.default_rng(13), 60_000, 0.02
    p = np.exp(-2 * np.pi * 1.9 * dt)
    x = lfilter([1 - p], [1, -p], rng.standard_normal((n, 3)), axis=0)
    x += 0.1 * rng.standard_normal((n, 3))
    y = np.diff(np.round(np.cumsum(x, axis=0) / 2.4 + 0.3), axis=0, prepend=0) * 2.4
    record = ImuRecord(1e-5 * y, None, dt * np.arange(n), 1 / dt)
    problem = NoiseProblem(gather(record, ['gyro_x'])['gyro_x'])
    fit = problem.point(model_of('noise', ('white', 'flicker', 'quantization')))
    gain = {f.name: f.gain for f in problem.candidates(fit)}
    assert gain['low_pass'] > 100 and gain['low_pass'] == pytest.approx(
        gain['gauss_markov'], abs=5)


@pytest.mark.thorough
def test_a_mean_that_rounding_moves_is_no_step():
    """Noise grew less, and then more of a mean between two levels was rounded away."""
    rng, n, level = np.random.default_rng(12), 60_000, -0.24
    noise = np.where(np.arange(n) < 0.8 * n, 0.365, 0.242)
    for size in (0.0, 0.6):
        y = level + noise * rng.standard_normal(n) + size * (np.arange(n) > 0.4 * n)
        y = np.column_stack([np.round(y), rng.standard_normal((n, 2))])
        record = ImuRecord(1e-3 * y, None, 0.01 * np.arange(n), 100.0)
        problem = NoiseProblem(gather(record, ['gyro_x'])['gyro_x'])
        model = model_of('noise', ('white', 'rate_quantization', 'variance_change'))
        step = next(f for f in problem.candidates(problem.point(model)) if f.name == 'step')
        assert step.gain > step.penalty and ('rounding moves a mean' in step.against) == (not size)


@pytest.mark.thorough
@pytest.mark.parametrize('louder', [1.0, 1.6])
def test_a_variance_that_changes_shows_below_a_coarse_grid(louder):
    rng = np.random.default_rng(5)
    y = np.where(np.arange(N) < 0.6 * N, 1.0, np.sqrt(louder)) * noise(11)
    y += np.cumsum(rng.standard_normal(N)) * 4 / np.sqrt(N)
    y = np.column_stack([2.5 * np.round(y / 2.5), noise(9), noise(10)])
    problem = NoiseProblem(gather(
        ImuRecord(y, None, np.arange(N) * 0.01, 100.0), ['gyro_x'])['gyro_x'])
    base, more = (model_of('noise', ('white', 'random_walk', 'rate_quantization', *k))
                  for k in ((), ('variance_change',)))
    told = {f.name: f for f in problem.candidates(problem.point(base))}.get('variance_change')
    assert (told is not None and told.gain > told.penalty) == (louder > 1)
    fall = fall_of(problem.held_out(base), problem.held_out(more), [more['variance_change']])
    assert (fall > FALL) == (louder > 1)
    if louder > 1:
        assert told.effect['factor'] == pytest.approx(louder, rel=0.2)
        assert told.effect['time'] == pytest.approx(0.6 * N * 0.01, abs=5)


# --- held samples --------------------------------------------------------------------------------

@pytest.mark.parametrize('share', [0.02, 0.3, 0.6, 0.8])
@pytest.mark.parametrize('step', [0.0, 0.05, 1.0, 2.5])
def test_held_samples_are_told_from_rounded_ones(share, step):
    plain = noise(4)
    plain = step * np.round(plain / step) if step else plain
    assert not repeats(plain).held
    if step >= 1 and share < 0.1:
        return                                              # too few among so many by chance
    seen = repeats(held_at_random(plain, share))
    assert seen.held
    assert (seen.seen - seen.chance) / (1 - seen.chance) == pytest.approx(share, abs=0.02)


@pytest.mark.parametrize('ratio', [0.21, 1 / 3, 0.3367, 0.62, 0.85])
@pytest.mark.parametrize('step', [0.0, 0.05, 0.3])
def test_a_slower_clock_is_told_from_holding_at_random(ratio, step):
    """Also where rounding makes two readings equal, so that some are held twice as long."""
    plain = step * np.round(noise(7) / step) if step else noise(7)
    held = plain[np.floor(np.arange(N) * ratio).astype(int)]
    chance = repeats(held).chance
    first = shown_first(np.diff(held) == 0, chance)
    assert len(first) == pytest.approx(N * ratio, rel=2e-3)
    assert shown_first(np.diff(held_at_random(plain, 1 - ratio)) == 0, chance) is None


@pytest.mark.parametrize('steps', [0, 43, 80])
def test_what_drifts_over_a_coarse_grid_is_not_held(steps):
    """What lies far apart in time is equal less often then: neighbours seemed to be held."""
    y = 0.75 * noise(6, 14_000) + np.linspace(0, steps, 14_000)
    seen = repeats(np.round(y))
    assert not seen.held and seen.chance == pytest.approx(seen.seen, abs=0.012)
    assert repeats(held_at_random(np.round(y), 0.2)).share == pytest.approx(0.2, abs=0.03)


@pytest.mark.parametrize('slow', [0.5, 0.9, 0.99])
def test_slow_noise_on_a_coarse_grid_is_not_held(slow):
    from scipy.signal import lfilter

    y = lfilter([np.sqrt(1 - slow**2)], [1, -slow], noise(5))
    for step in (0.5, 1.0, 2.0):
        assert not repeats(step * np.round(y / step)).held


def test_what_is_held_alike_scatters_as_said():
    """Sums of products of two whitened axes with one pattern of repeats, many times."""
    p, rng = 0.7, np.random.default_rng(6)
    total = []
    for seed in range(400):
        x, y = (held_at_random(noise_, p, seed) for noise_ in rng.standard_normal((2, 1000)))
        u, v = (z[1:] - p * z[:-1] for z in (x, y))
        total.append(np.sum(u * v) / (999 * (1 - p * p)))
    crowd = DUPLICATES({'fraction': p, 'pattern': 'random'}).crowd()
    assert np.var(total) * 999 == pytest.approx(crowd, rel=0.25)
    assert DUPLICATES(
        {'fraction': 1e-6, 'pattern': 'random'}).crowd() == pytest.approx(1, abs=1e-4)


@pytest.mark.thorough
def test_axes_that_are_held_alike_are_coherent_by_chance_alone():
    """What their patterns share moves all groups one way: it is one thing seen, not fifty."""
    p, n, values = 0.9, 4000, []
    for seed in range(40):
        rng = np.random.default_rng([8, seed])
        gyro = np.column_stack([held_at_random(x, p, seed) for x in rng.standard_normal((3, n))])
        record = ImuRecord(gyro, None, np.arange(n) * 0.01, 100.0)
        problem = NoiseProblem(gather(record, ['gyro_x'])['gyro_x'])
        fit = problem.point(model_of('noise', ('white', 'duplicates')))
        view = coherence(problem.evidence, fit)
        values.append(view.excess / view.std)
    assert np.std(values) == pytest.approx(1.0, abs=0.3) and max(values) < 3.5


def test_what_comes_last_acts_on_quantization_too():
    q = find_effect('noise', 'quantization').example()
    held, low = DUPLICATES.example(), find_effect('noise', 'low_pass').example()
    f = np.linspace(1, 49, 20)
    assert isinstance(held, Response) and isinstance(q, Spectrum)
    plain = model_psd(q + find_effect('noise', 'white')({'N': 1e-12}), f, 0.01)
    assert model_psd(q + low, f, 0.01) == pytest.approx(q.psd(f, 0.01), rel=1e-12)
    assert model_psd(q + held, f, 0.01) == pytest.approx(plain * held.gain2(f, 0.01), rel=1e-3)


@pytest.mark.thorough
@pytest.mark.parametrize('share', [0.1, 0.3, 0.6])
@pytest.mark.parametrize('name, values', [
    ('low_pass', {'cutoff': 0.12, 'form': 'butterworth_2'}),
    ('low_pass', {'cutoff': 0.443 / 4, 'form': 'moving_average'}),
    ('notch', {'frequency': 0.2, 'width': 0.15})])
@pytest.mark.parametrize('run', [1, 4])
def test_what_a_filter_took_is_filled_where_samples_are_held_at_random(name, values, share, run):
    """At every frequency, and the level at low ones is N."""
    low = find_effect('noise', name)
    low = low({**low.neutral, **values})
    inputs, rng = Inputs(np.arange(2**18) * 1.0, 1.0), np.random.default_rng(3)
    plain = low.apply(rng.standard_normal(2**18), inputs, rng)
    y, bins = held_at_random(plain, share, run=run), spectrum.bins_of(2**18, 1.0)
    seen = spectrum.power(spectrum.cosine_transform(y), 1.0, bins)
    held = DUPLICATES({'fraction': share, 'pattern': 'random', 'run': run})
    # of the variance, int S = 2 N^2 int gain^2, none is lost
    f = (np.arange(4096) + 0.5) / 8192
    white = find_effect('noise', 'white')
    model = Model([white({'N': 1.0}), low, held])
    n = np.sqrt(np.var(plain) / (0.5 * np.mean(model_psd(model, f, 1.0))))
    expected = spectrum.expected(lambda f: model_psd(Model([white({'N': n}), low, held]), f, 1.0),
                                 bins)
    some = bins.f > 0.03
    rows = np.array_split(np.flatnonzero(some), 16)
    ratio = [np.average(seen[i] / expected[i], weights=bins.count[i]) for i in rows]
    np.testing.assert_allclose(ratio, 1.0, atol=0.05)
    # and what the filter does is told from that
    own = expected / spectrum.expected(
        lambda f: model_psd(Model([white({'N': n}), held]), f, 1.0), bins)
    back = held.unscattered(own, bins)
    np.testing.assert_allclose(back, spectrum.expected(lambda f: low.gain2(f, 1.0), bins),
                               atol=0.01)


@pytest.mark.parametrize('share', [0.1, 0.99])
def test_a_sample_is_looked_for_no_further_than_a_few_runs_back(share):
    """Where nearly all is held a chain of runs that overlap has thousands of samples."""
    some = repeated.ages(share, 50)
    assert 50 <= len(some) <= 401 and np.all(np.diff(some) < 1e-12)


# --- counts of an angle ---

def counted(sigma, length, mean, n=N):
    """Return rates that are whole counts of an angle, and its rounding error before and after."""
    white = sigma * noise(11, n + length - 1)
    angle = np.cumsum(np.convolve(white, np.ones(length) / length, 'valid') + mean)
    angle = np.append(0.0, angle) + 0.3
    return np.diff(np.round(angle)), np.round(angle) - angle


@pytest.mark.parametrize('sigma, length, mean', [
    (0.1, 1, 0.0), (0.2, 1, 0.41), (0.35, 13, 0.0), (0.35, 13, 0.2),
    (0.35, 13, 0.7 * np.sin(np.arange(N) / 3000))])
def test_the_error_of_counts_has_a_colour_where_the_angle_turns_by_little(sigma, length, mean):
    """Also where the rate swings, so that one of its means is none."""
    y, error = counted(sigma, length, mean)
    colour = colour_of_turns(*turns_of_counts(0.7 * y, 0.7))
    assert len(colour) > 3
    e = error - np.mean(error)
    seen = [12 * np.mean(e[k:] * e[:-k]) for k in range(1, len(colour))]
    np.testing.assert_allclose(colour[1:], seen, atol=0.05)


def test_the_error_of_counts_is_white_where_noise_spans_one():
    assert len(colour_of_turns(*turns_of_counts(counted(0.6, 1, 0.2)[0], 1.0))) == 1


@pytest.mark.parametrize('mean', [0.1, 0.3, 0.45])
@pytest.mark.parametrize('sigma, share', [(0.3, 0.3), (0.25, 0.99)])
def test_rates_that_were_rounded_each_by_itself_are_no_counts(sigma, share, mean):
    y = np.round(sigma * lfilter(*butter(2, share), noise(12)) + mean)
    assert len(colour_of_turns(*turns_of_counts(y, 1.0))) == 1


@pytest.mark.parametrize('mean', daily([0.0, 0.2], 0.2))
def test_counts_behind_an_average_have_the_power_and_the_allan_variance_of_their_colour(mean):
    dt, m = 0.01, np.array([1, 2, 5, 20])
    y, error = counted(0.35, 13, mean)
    record = ImuRecord(np.tile(y[:, None], 3), None, np.arange(N) * dt, 1 / dt)
    evidence = gather(record, ['gyro_x'])['gyro_x']
    white, q, low = (find_effect('noise', k) for k in ('white', 'quantization', 'low_pass'))
    low = low({**low.neutral, 'cutoff': 0.443 / (13 * dt), 'form': 'moving_average'})
    model = Model([white({'N': 0.35 * np.sqrt(dt)}), q({'Q': dt / np.sqrt(12)}), low])
    likelihood = Likelihood(evidence, 'whole', model)
    bins, ratio = likelihood.bins, likelihood.power / likelihood.spectra(model)[0]
    rows = np.array_split(np.flatnonzero(bins.f > 2), 12)
    np.testing.assert_allclose([np.average(ratio[i], weights=bins.count[i]) for i in rows], 1.0,
                               atol=0.08)
    np.testing.assert_allclose(effect_avar(evidence, model, model['quantization'], m),
                               overlapping_variance(np.diff(error), m), rtol=0.1)


# --- spikes beside others ------------------------------------------------------------------------

def louder(y):
    """Return noise that is ten times louder in its second half."""
    return y * np.where(np.arange(len(y)) < len(y) // 2, 1.0, 10.0)


def on_a_line(y):
    """Return noise on a strong vibration."""
    return y + 8 * np.sin(2 * np.pi * 0.23 * np.arange(len(y)))


BACKGROUNDS = {
    'noise': lambda y: y,
    'line': on_a_line,
    'held': lambda y: held_at_random(y, 0.6),
    'held twice': lambda y: y[np.arange(len(y)) // 2 * 2],
    'coarse grid': lambda y: 3.0 * np.round(y / 3.0 + 0.2),
    'fine grid': lambda y: 0.1 * np.round(y / 0.1),
    'louder': louder,
}


@pytest.mark.parametrize('background', BACKGROUNDS)
def test_no_spikes_where_there_are_none(background):
    """Chance makes an outlier in a record of a hundred."""
    counts = [len(found(BACKGROUNDS[background](noise([7, k])))[0]) for k in range(10)]
    assert sum(counts) <= 3, counts


@pytest.mark.parametrize('background', BACKGROUNDS)
def test_spikes_are_found_and_taken_out(background):
    y = BACKGROUNDS[background](noise(8))
    spiked, at = with_spikes(y, 9, sigma=40 * (10 if background == 'louder' else 1))
    index, clean = found(spiked)
    assert np.mean(np.isin(at, index)) > 0.97 and np.mean(np.isin(index, at)) > 0.9
    assert np.max(np.abs(clean[at] - y[at])) < 8 * np.std(y)
    assert np.array_equal(np.delete(clean, index), np.delete(spiked, index))


@pytest.mark.parametrize('apart', daily([200, 270, 400], 270))
@pytest.mark.parametrize('begin', [60, 900])
def test_one_knock_soon_after_another_leaves_nothing_of_it(begin, apart):
    """In place of the second there was the noise before it, mirrored: the first one."""
    rng, y = np.random.default_rng([17, apart]), noise(17, 20_000)
    spiked, t = y.copy(), 0.02 * np.arange(400)
    for at in (begin, begin + apart, 9000):
        spiked[at:at + 400] += 20 * np.exp(-t / 1.5) * rng.standard_normal(400)
    inputs = Inputs(np.arange(len(y)) * 0.02, 0.02)
    clean = SHOCK.screen(spiked, SHOCK.statistics(spiked, inputs), inputs)
    assert np.max(means_of_blocks(clean**2, 50)) < 8     # a tail is left until it is faint


@pytest.mark.parametrize('length', [1, 2, 4, 9])
@pytest.mark.parametrize('bandwidth', [None, 0.27])
def test_bursts_are_taken_out_and_not_what_is_beside_them(length, bandwidth):
    """Behind a low-pass, noise is so even that what is beside a burst looks like a spike of it."""
    rng, count = np.random.default_rng([4, length]), 20_000
    y = noise(4, count)
    y = lfilter(*butter(2, bandwidth), y) if bandwidth else y
    hit = np.convolve(rng.random(count) < 0.015 / length, np.ones(length))[:count] > 0
    spiked = y + hit * rng.choice([-1, 1], count) * rng.uniform(6.5, 20, count)
    index, clean = found(spiked)
    assert np.mean(np.isin(np.flatnonzero(hit), index)) > 0.95
    assert np.mean(hit[index]) > 0.98
    assert np.var(clean) == pytest.approx(np.var(y), rel=0.05)


@pytest.mark.parametrize('seed', (14, 16, 21))
def test_noise_whose_loudness_wanders_has_no_spikes(seed):
    """Faster than blocks tell how loud it is; 49, 23 and 12 nats before that was looked at."""
    rng = np.random.default_rng(seed)
    count = int(rng.choice([6000, 30000, 200000]))
    phi = np.exp(-1 / (1000 * 10 ** rng.uniform(np.log10(0.005), np.log10(0.05))))
    slow = lfilter([np.sqrt(1 - phi**2)], [1, -phi], rng.standard_normal(2000))[1000:]
    y = rng.standard_normal(count)
    y *= np.exp(rng.uniform(0.1, 0.6) * np.interp(
        np.linspace(0, 1, count), np.linspace(0, 1, 1000), slow))
    kept = Spikes.statistics(y, Inputs(np.arange(count) * 0.01, 0.01, {}))
    assert not kept or not len(kept['size']) or (_gain(kept) or (0.0,))[0] < 6


def test_a_spike_beside_a_spike():
    """Two of four neighbours that are spikes must not hide one, nor make one."""
    y = noise(10)
    spiked = y.copy()
    spiked[[1000, 1001, 2000, 2002, 3000, 3003]] += 50
    index, clean = found(spiked)
    assert list(index) == [1000, 1001, 2000, 2002, 3000, 3003]
    assert np.max(np.abs(clean)) < 6


@pytest.mark.parametrize('place', [0, 1, -2, -1])
def test_a_spike_at_an_end_is_taken_out(place):
    """Half of its neighbours are missing; left in, it doubled the power at low frequency."""
    y = noise(14)
    spiked = y.copy()
    spiked[place] += 168
    index, clean = found(spiked)
    assert list(index) == [place % N] and np.max(np.abs(clean)) < 6


@pytest.mark.thorough
@pytest.mark.parametrize('place', [0, -1])
def test_a_spike_at_an_end_is_named(place):
    """No window of a block looks there: it was *undecidable*, of any size."""
    y = 1e-3 * noise([14, 1], (10_003, 3))
    y[place, 0] += 25e-3
    study = analyse_record(ImuRecord(y, None, 0.01 * np.arange(len(y)), 100.0), axes=('gyro_x',))
    said = study.diagnose(['gyro_x'])['gyro_x']
    assert [f.name for f in said.found] == ['spikes'] and said.remaining is None
    assert said.found[0].estimates['sigma'].ci95[0] > 0
    study.add(['spikes'], ['gyro_x'])
    assert study.diagnose(['gyro_x'])['gyro_x'].verdict == 'complete'


@pytest.mark.parametrize('course', [
    lambda t: 3 * t, lambda t: -3 * t, lambda t: 500 * np.exp(-t / 100),
    lambda t: 500 * np.exp((t - N) / 100), lambda t: 50 * np.sin(2 * np.pi * t / 100)])
def test_what_moves_at_an_end_is_no_spike_there(course):
    index, _ = found(noise(15) + course(np.arange(N)))
    assert not len(index)


@pytest.mark.parametrize('cutoff', daily([0.05, 0.2], 0.2))
def test_behind_a_filter_the_ends_are_no_spikes(cutoff):
    """Beside neighbours on one side alone smooth noise stands out."""
    b, a = butter(4, cutoff)
    at = [found(lfilter(b, a, noise([16, k], 3000)))[0] for k in range(150)]
    assert sum(np.any((i < 2) | (i >= 2998)) for i in at) <= len(at) // 50


def test_a_spike_that_was_held_is_taken_out_whole():
    y = noise(11)
    y[500] += 60
    held = y[np.arange(len(y)) // 4 * 4]
    index, clean = found(held)
    assert list(index) == [500, 501, 502, 503] and np.max(np.abs(clean)) < 6


@pytest.mark.parametrize('seed', daily(range(3), 1))
def test_a_knock_that_is_gone_within_a_tenth_of_a_second_is_a_shock(seed):
    """Taken for single spikes, what rings on beside them would stay."""
    y, t = noise([12, seed]), np.arange(15)
    inputs = Inputs(np.arange(N) * 0.02, 0.02)
    begins = np.random.default_rng([13, seed]).integers(100, N - 100, 6)
    for i in begins:
        y[i:i + 15] += 100 * np.exp(-t / 3) * np.sin(1.1 * t + 1)
    kept = SHOCK.statistics(y, inputs)
    assert all(np.any((kept['begin'] <= i) & (i < kept['end'])) for i in begins)
    assert np.max(np.abs(SHOCK.screen(y, kept, inputs))) < 6


def test_knocks_that_come_often_are_no_spikes_that_hide_each_other():
    """A tool of forty knocks, the faint ones gone within two blocks: all are told, none left."""
    rng, dt = np.random.default_rng(23), 1e-3
    y, t = rng.standard_normal(240_000), np.arange(300)
    begins = 6000 * np.arange(40) + rng.integers(1000, 4000, 40)
    for i, size in zip(begins, np.geomspace(30, 300, 40)):
        y[i:i + 300] += size * np.exp(-t / 30) * np.cos(0.53 * t + rng.uniform(0, 6))
    inputs = Inputs(np.arange(len(y)) * dt, dt)
    kept = SHOCK.statistics(y, inputs)
    assert all(np.any((kept['begin'] < i + 32) & (i < kept['end'])) for i in begins)
    assert np.max(np.abs(SHOCK.screen(y, kept, inputs))) < 6


@pytest.mark.thorough
@pytest.mark.parametrize('seed', [1, 2])
def test_the_crests_of_swings_are_no_shocks(seed):
    """A band of slow noise far above the white: blocks of one swing are loud together."""
    rng = np.random.default_rng(seed)
    band = lfilter(*butter(2, (0.02, 0.07), 'band'), rng.standard_normal(180_000))
    y = rng.standard_normal(len(band)) + 5 * band
    inputs = Inputs(np.arange(len(y)) * 0.02, 0.02)
    assert not SHOCK.statistics(y, inputs)
    t = np.arange(100) * 0.02
    y[90_000:90_100] += 40 * np.exp(-t / 0.3) * rng.standard_normal(100)
    kept = SHOCK.statistics(y, inputs)
    assert kept['begin'] == pytest.approx([90_000], abs=12)


def test_a_shock_may_be_longer_than_what_is_usually_looked_at_around_it():
    """Four seconds at 4 kHz, the end of which was weighed in place of all of it."""
    rng, begin, length = np.random.default_rng(21), 30_000, (1 << 14) + 2
    y = rng.standard_normal(80_000)
    y[begin:begin + length] += 10 * np.exp(-np.arange(length) / 3000) * rng.standard_normal(length)
    kept = {'begin': np.array([begin]), 'end': np.array([begin + length])}
    assert len(_beyond_the_spectrum(y, kept, 1 / 4000)['begin'])


@pytest.mark.thorough
@pytest.mark.parametrize('louder, lasts', [(5, 200), (5, 50), (10, 50), (10, 200)])
def test_what_is_louder_for_a_while_is_no_shock(louder, lasts):
    """It ends as it began; a shock dies out."""
    for seed in range(4):
        rng = np.random.default_rng([23, seed])
        scale = np.ones(N)
        for i in rng.integers(0, N, 5):
            scale[i:i + int(rng.exponential(lasts)) + 10] = np.sqrt(louder)
        y = rng.standard_normal(N) * scale
        kept = SHOCK.statistics(y, Inputs(np.arange(N) * 0.01, 0.01))
        assert np.all(kept.get('ring', 0.0 if kept else 1.0) > 0)   # a few of it may seem to ring


@pytest.mark.thorough
@pytest.mark.parametrize('memory', [100, 400])
def test_noise_whose_loudness_wanders_has_no_shocks(memory):
    """What is loudest of it is no louder than what else wanders makes likely."""
    shocks = 0
    for seed in range(4):
        rng = np.random.default_rng([24, seed])
        wander = lfilter([1], [1, -np.exp(-1 / memory)], rng.standard_normal(N))
        y = rng.standard_normal(N) * np.exp(0.35 * wander / np.std(wander))
        shocks += bool(SHOCK.statistics(y, Inputs(np.arange(N) * 0.01, 0.01)))
    assert shocks <= 1


@pytest.mark.parametrize('length', daily([4, 8, 16], 8))
@pytest.mark.parametrize('count', daily([3, 10], 3))
def test_bursts_of_spikes_are_no_shocks(length, count):
    rng = np.random.default_rng([25, length, count])
    y = noise(rng)
    for i in rng.integers(0, N - 100, count):
        y[i:i + length] += rng.choice([-1, 1], length) * rng.uniform(8, 15, length)
    assert not SHOCK.statistics(y, Inputs(np.arange(N) * 0.01, 0.01))


@pytest.mark.parametrize('signs', daily(['any', 'by turns'], 'any'))
def test_samples_that_go_up_and_down_by_turns_are_no_burst_of_spikes(signs):
    """A knock near half the sample rate is too short for a shock's shape."""
    said = 0
    for seed in range(20):
        rng = np.random.default_rng([27, seed])
        y, length = noise(rng), 12
        sign = rng.choice([-1, 1], length) if signs == 'any' else (-1) ** np.arange(length)
        y[9000:9000 + length] += sign * rng.uniform(8, 15, length)
        said += bool(_swing(Spikes.statistics(y, Inputs(np.arange(N) * 0.01, 0.01))))
    assert said == (0 if signs == 'any' else 20)


@pytest.mark.parametrize('size, decay', [seldom(5, 100), (10, 30), seldom(100, 5)])
@pytest.mark.parametrize('swells', [False, True])
def test_what_dies_out_is_a_shock_and_so_is_what_swells_before(size, decay, swells):
    """No form is that of all shocks; what speaks against one is a level."""
    rng, t = np.random.default_rng([26, size]), np.arange(1000.0)
    y, begins = noise(rng), (4000, 17000, 29000)
    for i in begins:
        form = np.exp(-np.abs(t - 500) / decay) if swells else np.exp(-t / decay)
        y[i:i + 1000] += size * form * rng.standard_normal(1000)
    kept = SHOCK.statistics(y, Inputs(np.arange(N) * 0.01, 0.01))
    for i in begins:
        top = i + 500 * swells
        assert np.any((kept['begin'] <= top + 12) & (top < kept['end']))


@pytest.mark.thorough
@pytest.mark.parametrize('heard', [0.0, 0.3, 1.0])
def test_what_no_other_axis_hears_is_no_knock_but_a_burst_behind_a_filter(heard):
    """By its form a short one is either; a knock moves all axes, each by its share."""
    rng = np.random.default_rng([27, round(10 * heard)])
    y, others = noise(rng), [noise(rng) for _ in range(5)]
    begins = (4000, 17000, 29000)
    for i in begins:
        burst = lfilter([0.2], [1, -0.8], np.append(80 * rng.standard_normal(6), np.zeros(30)))
        y[i:i + 36] += burst
        for k, x in enumerate(others):
            x[i:i + 36] += heard * burst * (-1) ** k
    names = ('gyro_x', 'gyro_y', 'gyro_z', 'accel_x', 'accel_y', 'accel_z')
    axes = dict(zip(names, (y, *others)))
    alone = Inputs(np.arange(N) * 0.01, 0.01)
    assert len(SHOCK.statistics(y, alone)['begin']) == len(begins)
    kept = SHOCK.statistics(y, replace(alone, axes=axes, axis='gyro_x'))
    assert len(kept.get('begin', ())) == (len(begins) if heard else 0)
    dead = {name: y if name == 'gyro_x' else np.zeros(N) for name in names}
    assert SHOCK.statistics(y, replace(alone, axes=dead, axis='gyro_x')), 'they can hear nothing'


@pytest.mark.parametrize('clear', [True, False])
@pytest.mark.parametrize('hear', [0, 1, 2, 5])
def test_what_an_axis_hears_faintly_where_several_others_hear_a_knock_is_one(hear, clear):
    """By itself it is a few samples that stand out, which pass for spikes."""
    rng, t = np.random.default_rng([28, hear]), np.arange(60.0)
    y, others = noise(rng), [noise(rng) for _ in range(5)]
    begins = {4000: 60.0 * clear, 17000: 50.0 * clear, 23000: 4.5, 29000: 5.0, 33000: 0.0}
    for i, size in begins.items():
        ring = np.exp(-t / 12) * np.sin(1.1 * t + 1)
        y[i:i + 60] += size * ring
        for x in others[:hear]:
            x[i:i + 60] += 40 * ring
    names = ('gyro_x', 'gyro_y', 'gyro_z', 'accel_x', 'accel_y', 'accel_z')
    inputs = Inputs(np.arange(N) * 0.01, 0.01, axes=dict(zip(names, (y, *others))), axis='gyro_x')
    kept = _fainter(y, _loud(y, 0.01), inputs)
    begin, end = (kept.get(k, np.zeros(0)) for k in ('begin', 'end'))
    found = {i for i in begins if np.any((begin <= i + 20) & (i < end))}
    assert found == {i for i, size in begins.items() if size > (2.0 if hear > 1 else 20.0)}
    assert np.all(end[:-1] <= begin[1:]) and len(begin) == len(found), 'each once'


def test_a_line_goes_on_through_what_is_loud():
    """The noise before it, mirrored, has the line in another phase: a foot as wide as it is."""
    rng, t = np.random.default_rng(28), np.arange(N) * 0.01
    line = 5 * np.sin(2 * np.pi * 1.917 * t + 1)
    y, inputs, begins = noise(rng) + line, Inputs(t, 0.01), (4000, 17000, 29000)
    for i in begins:
        y[i:i + 300] += 60 * np.exp(-np.arange(300) / 60) * rng.standard_normal(300)
    out = SHOCK.screen(y, SHOCK.statistics(y, inputs), inputs)
    for i in begins:
        assert np.std((out - line)[i:i + 100]) < 1.5


@pytest.mark.parametrize('share', daily([0.001, 0.01, 0.03], 0.03))
def test_spikes_are_no_shocks_however_many(share):
    y = noise(14)
    y = y + 40 * np.random.default_rng(15).standard_normal(N) * (
        np.random.default_rng(16).random(N) < share)
    assert not SHOCK.statistics(y, Inputs(np.arange(N) * 0.01, 0.01))


@pytest.mark.parametrize('held', [4, 8])
def test_a_spike_that_was_held_is_no_shock(held):
    y = noise(17)
    y[np.arange(500, N, 5000)] += 60
    y = y[np.arange(N) // held * held]
    assert not SHOCK.statistics(y, Inputs(np.arange(N) * 0.01, 0.01))


@pytest.mark.thorough
def test_spikes_of_which_some_are_held_are_no_shocks():
    """Lines join what is not held; one beside a spike is no ring, but for chance."""
    rang = 0
    for seed in range(12):
        rng = np.random.default_rng([22, seed])
        y = noise(rng)
        y[rng.choice(N, N // 250, replace=False)] += 25 * rng.standard_normal(N // 250)
        y = held_at_random(y, 0.15, seed)
        assert repeats(y).held
        rang += bool(SHOCK.statistics(y, Inputs(np.arange(N) * 0.01, 0.01)))
    assert rang <= 1


@pytest.mark.parametrize('seed', [2, 3, 5])
def test_what_jumps_between_three_levels_rings_not(seed):
    """What is averaged before it is rounded comes in groups; no knock."""
    n, step = 240_000, 4.0
    y = lfilter(np.ones(6) / 6**0.5, 1, np.random.default_rng([24, seed, 6]).standard_normal(n))
    y = step * np.round(y / step + 0.15)
    assert len(np.unique(y)) <= 4
    assert 'ring' not in SHOCK.statistics(y, Inputs(np.arange(n) * 0.00025, 0.00025))


@pytest.mark.parametrize('fraction', [0.28, 0.41, 0.63])
def test_knocks_ring_beside_a_slower_clock(fraction):
    """Its own samples are even, so that they are looked at alone; without knocks nothing rings."""
    rng, t = np.random.default_rng([21, int(100 * fraction)]), np.arange(N) * 0.01
    held = DUPLICATES().with_values(fraction=fraction, pattern=1.0, run=1.0)
    plain, begins = rng.standard_normal(N), np.array([51.7, 180.0, 333.3])
    knocks = sum(np.where(t >= b, 4 * np.exp(-np.maximum(t - b, 0) / 0.3)
                          * np.cos(2 * np.pi * 7.3 * (t - b)), 0) for b in begins)
    inputs = Inputs(t, 0.01)
    y, still = (as_measured(ImuRecord(np.outer(held.apply(x, inputs, rng), [1, 0, 0]), None, t,
                                      100.0), ['gyro_x'], Memory())[0].record
                for x in (plain + knocks, plain))
    inputs = Inputs(y.t, y.dt)
    assert y.rate_hz == pytest.approx(100 * (1 - fraction), rel=1e-4)
    kept = SHOCK.statistics(y.column('gyro_x'), inputs)
    assert kept['begin'] * y.dt == pytest.approx(begins, abs=0.06)
    assert kept['ring'] == pytest.approx(7.3, abs=0.2)
    assert kept['decay'] == pytest.approx(0.3, rel=0.4)
    left = SHOCK.screen(y.column('gyro_x'), kept, inputs) - still.column('gyro_x')
    assert np.sum(left**2) < 0.2 * np.sum(knocks**2) * (1 - fraction)
    assert not SHOCK.statistics(still.column('gyro_x'), inputs)


def test_knocks_ring_beside_a_few_samples_that_are_held():
    y, t = noise(23), np.arange(60)
    for begin in (9_000, 21_000, 33_000):
        y[begin:begin + 60] += 8 * np.exp(-t / 15) * np.cos(0.9 * t)
    kept = SHOCK.statistics(held_at_random(y, 0.05), Inputs(np.arange(N) * 0.01, 0.01))
    rings = (kept['ring'] > 0) & (kept['worth'] > 3)    # of three one more may seem to ring
    assert np.sum(rings) == 3
    assert kept['ring'][rings] == pytest.approx(0.9 / (2 * np.pi * 0.01), rel=0.05)


@pytest.mark.parametrize('share', [0.0, 0.01])
@pytest.mark.parametrize('step', [0.02, 0.1])
def test_few_held_samples_show_beside_what_rounding_makes_equal(step, share):
    """Noise of any colour on a grid fine enough that one neighbour in a hundred is equal."""
    y = noise(4, 4 * N)
    y = step * np.round((y + 0.6 * np.roll(y, 1)) / step)
    assert repeats(held_at_random(y, share)).held == (share > 0)


@pytest.mark.thorough
@pytest.mark.parametrize('counts', [False, True])
def test_a_filter_is_found_behind_a_grid_as_coarse_as_the_noise(counts):
    """Of the rate, or of the angle: what rounds that takes the place of the rate's grid."""
    rng, n, length = np.random.default_rng(8), 20_000 if counts else 45_000, 8
    x = np.cumsum(rng.standard_normal(n + length))
    x = (x[length:] - x[:-length]) / np.sqrt(length) + 0.2 * rng.standard_normal(n)
    x = np.column_stack([x, rng.standard_normal((n, 2))])
    step = 1.2 if counts else 3.0
    y = np.diff(np.round(np.cumsum(x, axis=0) / step + 0.3), axis=0, prepend=0) * step if counts \
        else step * np.round(x / step + 0.2)
    study = analyse_record(ImuRecord(1e-4 * y, None, 0.01 * np.arange(n), 100.0),
                           axes=('gyro_x',), keep_motion=True)
    found = study.diagnose(['gyro_x'])['gyro_x'].found
    assert {f.name for f in found} == {'quantization' if counts else 'rate_quantization',
                                       'low_pass'}


def of_a_slower_sensor(rng, n, rate, drift=0.0, late=0.0):
    """Return which value of a sensor each of n samples is, its clock and its reader uneven."""
    j = np.arange(n) + late * rng.uniform(-0.5, 0.5, n)
    turns = rate * (j + drift * n * np.sin(2 * np.pi * j / n) / (2 * np.pi)) + 0.33
    return np.floor(turns).astype(int)


@pytest.mark.parametrize('rate, step, axes, drift, late', [
    (0.2, 0.0, 1, 0.0, 0.0), (0.2, 1.0, 3, 2e-3, 0.8), (0.1, 0.5, 1, 1e-3, 0.9),
    (0.3367, 1.0, 1, 2e-3, 0.6), (0.5, 0.1, 3, 0.0, 0.0), (0.4993, 0.3, 3, 1e-4, 0.0),
    (0.58801, 0.0, 1, 1e-4, 0.0), (0.8017, 0.3, 3, 1e-4, 0.0), (0.93017, 0.02, 3, 1e-4, 0.0)])
def test_each_value_of_a_slower_sensor_is_taken_once(rate, step, axes, drift, late):
    """Whose clock goes faster and slower, whose reader is late and early, on a coarse grid."""
    rng, n = np.random.default_rng(2), 100_000
    which = of_a_slower_sensor(rng, n, rate, drift, late)
    x = rng.standard_normal((which[-1] + 1, 3))
    x = step * np.round(x / step) if step else x
    gyro = x[which]
    gyro[:, axes:] = rng.standard_normal((n, 3 - axes))
    record = ImuRecord(gyro, None, np.arange(n) * 0.01, 100.0)
    seen, *others = as_measured(record, ['gyro_x'], Memory())
    assert not others and seen.record.rate_hz == pytest.approx(100 * rate, rel=2e-3)
    taken = which[seen.first + (np.diff(seen.first, append=n) - 1) // 2]
    assert np.mean(np.diff(taken) != 1) < 5e-3
    assert np.mean(seen.record.column('gyro_x') == x[taken, 0]) == 1


@pytest.mark.parametrize('evenly', daily([False, True], True))
def test_the_images_of_lines_behind_a_slower_clock_are_no_lines(evenly):
    """More than a table holds of a strong line, whichever clock says when it was measured."""
    rng, n, dt, rate = np.random.default_rng(19), 60_000, 0.01, 0.5811
    late = (np.arange(n) * rate) % 1 / rate
    at = np.arange(n) - np.floor(late).astype(int)
    t = dt * (np.arange(n) - late if evenly else at)
    wave = 3 * np.cos(2 * np.pi * 4.31 * t + 1) + 0.2 * np.cos(2 * np.pi * 11.7 * t)
    y = np.column_stack([rng.standard_normal(n)[at] + wave, *rng.standard_normal((2, n))[:, at]])
    y, t = np.round(y, 4), dt * np.arange(n)
    evidence = gather(ImuRecord(1e-4 * y, None, t, 1 / dt), ['gyro_x'])['gyro_x']
    assert np.sort(evidence.line_table[:, 0]) == pytest.approx([4.31, 11.7], abs=1e-3)


@pytest.mark.thorough
def test_two_sensors_of_two_clocks_are_looked_at_each_at_its_own():
    rng, n = np.random.default_rng(6), 60_000
    x, data = rng.standard_normal((n, 3)), {}
    for sensor, rate in (('gyro', 0.2), ('accel', 0.41)):
        data[sensor] = x[of_a_slower_sensor(rng, n, rate)]
    record = ImuRecord(data['gyro'], data['accel'], np.arange(n) * 1e-3, 1000.0)
    found = gather(record, ['gyro_x', 'accel_y', 'gyro_z'])
    assert list(found) == ['gyro_x', 'accel_y', 'gyro_z']
    assert 1 / found['gyro_z'].dt == pytest.approx(200, rel=1e-3)
    assert 1 / found['accel_y'].dt == pytest.approx(410, rel=1e-3)
    both = gather(replace(record, accel=x[of_a_slower_sensor(rng, n, 0.2)]), record.axes)
    assert {round(1 / e.dt) for e in both.values()} == {200}
    assert both['gyro_x'].common is both['accel_x'].common


@pytest.mark.thorough
@pytest.mark.parametrize('read', [1000.0, 730.0, 415.0])
def test_a_filter_is_found_in_a_sensor_that_is_read_faster_than_it_measures(read):
    rng, n = np.random.default_rng(17), 36_000
    x = lfilter(*butter(2, 40 / 100), rng.standard_normal((n, 3)), axis=0)
    x += 0.02 * rng.standard_normal((n, 3))
    k = np.arange(int(n / 200 * read))
    record = ImuRecord(1e-3 * x[np.floor(k / read * 200 + 1e-9).astype(int)], None, k / read, read)
    study = analyse_record(record, axes=('gyro_x',), keep_motion=True)
    diagnosis = study.diagnose(['gyro_x'])['gyro_x']
    found = {f.name: f.effect for f in diagnosis.found}
    assert set(found) == {'duplicates', 'low_pass'} and diagnosis.remaining is None
    assert found['low_pass']['cutoff'] == pytest.approx(40, rel=0.03)


@pytest.mark.thorough
@pytest.mark.parametrize('what', ['rate', 'angle'])
def test_an_angle_has_its_error_in_full_where_noise_spans_its_step(what):
    """Of a grid as fine as .6 standard deviations only that tells a rate from an angle."""
    rng, n, dt, step = np.random.default_rng(51), 36_000, 0.02, 0.6
    x = rng.standard_normal(n + 1)
    y = step * (np.round(x[1:] / step) if what == 'rate'
                else np.diff(np.round(np.cumsum(x) / step)))
    record = ImuRecord(np.outer(1e-3 * y, [1, 0, 0]), None, np.arange(n) * dt, 1 / dt)
    problem = NoiseProblem(gather(record, ['gyro_x'])['gyro_x'])
    fit = problem.point(model_of('noise', ('white', 'flicker', 'random_walk')))
    gain = {f.name: f.gain for f in problem.candidates(fit)}
    better = gain['rate_quantization'] - gain['quantization']
    assert better > 6 if what == 'rate' else better < -6


@pytest.mark.parametrize('spikes', [0, 8])
@pytest.mark.parametrize('seed', [3, 7])
def test_behind_a_filter_samples_are_no_spikes_where_those_between_were_held(seed, spikes):
    """Neighbours are farther apart there than anywhere else."""
    rng, n = np.random.default_rng([seed, 77]), 50_000
    y = np.convolve(rng.standard_normal(n + 5), np.ones(6) / 6, 'valid')
    y += 0.03 * rng.standard_normal(n)
    held = rng.integers(0, n - 10, 300)[:, None] + np.arange(1, 9)
    index = np.arange(n)
    index[held] = 0
    y = y[np.maximum.accumulate(index)]
    y[rng.integers(100, n - 100, spikes)] += 5.0
    kept = find_effect('noise', 'spikes').statistics(y, Inputs(0.02 * np.arange(n), 0.02, {}))
    assert len(kept['size']) == spikes


@pytest.mark.parametrize('what, told', [('messages', True), ('one axis', False), ('rest', False)])
@pytest.mark.parametrize('seed', daily(range(2), 0))
def test_messages_sent_twice_are_told_by_all_axes_where_rounding_makes_one_equal(
        what, told, seed):
    """Of one axis they are lost in what chance makes equal; at rest that makes more of them so."""
    rng, n = np.random.default_rng([seed, 78]), 80_000
    level = np.where((np.arange(n) // 8000) % 2, 0.4, 1.0) if what == 'rest' else np.ones(n)
    x = np.round(rng.standard_normal((n, 3)) * level[:, None] / 0.06) * 0.06
    again = np.flatnonzero(rng.random(n - 1) < 0.004) + 1
    if what == 'messages':
        x[again] = x[again - 1]
    elif what == 'one axis':
        x[again, 0] = x[again - 1, 0]
    record = ImuRecord(1e-3 * x, None, 0.01 * np.arange(n), 100.0)
    kept = gather(record, ['gyro_x'])['gyro_x'].kept('duplicates')
    assert bool(kept['held']) == told
    if told:
        assert float(kept['fraction']) == pytest.approx(0.004, rel=0.2)


@pytest.mark.parametrize('what', ['again', 'again in runs', 'calm', 'shaken', 'on and off'])
@pytest.mark.parametrize('seed', range(3))
def test_messages_sent_twice_are_told_by_all_axes_of_a_coarse_output(what, seed):
    """Rounding makes a third of the neighbours equal; so does what turns, on all axes at once."""
    rng, n = np.random.default_rng([seed, 79]), 30_000
    t, phase = np.arange(n), 1.0 if what in ('shaken', 'on and off') else 0.0
    wave = phase * 4 * np.sin(0.91 * t) * (t % 4000 < 2500 if what == 'on and off' else 1.0)
    x = rng.standard_normal((n, 6)) + wave[:, None] * rng.choice([-1, 1], 6) + rng.uniform(0, 2, 6)
    x = np.round(x / 1.2) * 1.2
    if what.startswith('again'):
        held = rng.random(n) < 0.03
        index = np.where(np.convolve(held, np.ones(3 if 'runs' in what else 1))[:n] > 0, 0, t)
        x = x[np.maximum.accumulate(index)]
    axes = dict(zip(AXES, x.T))
    for axis in ('gyro_y', 'accel_z'):
        kept = find_effect('noise', 'duplicates').statistics(
            axes[axis], Inputs(0.01 * t, 0.01, axes=axes, axis=axis))
        assert bool(kept['held']) == what.startswith('again')
        if what == 'again':
            assert float(kept['fraction'] - kept['expected']) == pytest.approx(0.03, rel=0.2)


@pytest.mark.parametrize('shared', [0.0, 0.5])
def test_an_output_of_two_levels_shares_nothing_with_its_own_square(shared):
    """That goes with it at every frequency; what axes have in common is seen all the same."""
    rng, n = np.random.default_rng(84), 20_000
    both = shared * rng.standard_normal(n)
    x = np.round((0.29 * (rng.standard_normal((n, 3)) + both[:, None]) + [0.4, 0.1, -0.3]))
    record = ImuRecord(None, 0.15 * x + [0.0, 0.0, 9.75], np.arange(n) / 100, 100.0)
    problem = NoiseProblem(gather(record, ['accel_x'])['accel_x'])
    view = coherence(problem.evidence, problem.point(
        model_of('noise', ('white', 'rate_quantization'))))
    assert (np.max(np.abs(view.pull)) > 5) == bool(shared)


@pytest.mark.parametrize('seed', range(4))
def test_the_samples_at_a_step_are_no_spikes(seed):
    """They are half a step from their neighbours, and between the levels; spikes are beyond."""
    rng = np.random.default_rng([93, seed])
    n, size = 20_000, rng.uniform(12, 40)
    y = rng.standard_normal(n) + size * (np.arange(n) >= 9_000) - size * (np.arange(n) >= 13_000)
    inputs = Inputs(0.02 * np.arange(n), 0.02, {})
    assert not len(SPIKES.statistics(y, inputs)['size'])
    some = np.array([8_990, 9_000, 9_020, 12_999])
    y[some] += size * rng.choice([-1, 1], 4) + size * np.array([0, 1, 0, 1])
    assert {8_990, 9_020} <= set(SPIKES.statistics(y, inputs)['index'].tolist())


def test_means_of_blocks_leave_a_rest_out():
    assert list(means_of_blocks(np.arange(1, 6, dtype=np.float32), 2)) == [1.5, 3.5]
    assert not means_of_blocks(np.ones(3), 4).size


@pytest.mark.thorough
@pytest.mark.parametrize('axis, counts', [
    ('accel_x', True), ('accel_x', False), ('gyro_x', False)])
def test_an_accelerometer_s_counts_are_seen_in_its_samples(axis, counts):
    """What only rises with frequency as theirs does is a vibration, on steps far finer."""
    rng, n, dt, step = np.random.default_rng(28), 12_000, 0.01, 2e-3
    velocity = dt * np.cumsum(rng.standard_normal((n + 1, 3)) * 0.1, axis=0)
    read = step * np.round(velocity / step)
    x = np.diff(read, axis=0) / dt
    if not counts:      # something else has that spectrum
        x = np.diff(velocity + step / np.sqrt(12) * rng.standard_normal((n + 1, 3)), axis=0) / dt
        x = np.round(x / 1e-3) * 1e-3
    still = 1e-3 * np.round(rng.standard_normal((n, 3)) * 0.1 / 1e-3)
    sensors = (still, x) if axis == 'accel_x' else (x, still)
    study = analyse_record(ImuRecord(*sensors, np.arange(n) * dt, 1 / dt), axes=(axis,),
                           keep_motion=True)
    found = study.diagnose([axis])[axis]
    named = 'quantization' in [f.name for f in found.found]
    assert named == (counts or axis == 'gyro_x'), found
    if not named:
        (other,) = (f for f in found.ranked if f.name == 'quantization')
        assert 'the samples lie on steps of 0.001' in other.against
