# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a motion may do as well is not called noise; what one axis has idles in the others."""

import numpy as np
import pytest
from scipy.signal import butter, lfilter, sosfilt

from imu_noise_tools.filter.design import aligned
from imu_noise_tools.filter.output_noise import (
    GaussMarkov, NoiseLevel, Outliers, SamplingJitter, Sinusoid, White
)
from imu_noise_tools.filter.problem import AS_MOTION, FilterProblem, TOO_SLOW
from imu_noise_tools.filter.still import is_as_strong, is_coloured, outlasts_motion
from imu_noise_tools.loop.effect import Model, model_of
from imu_noise_tools.loop.study import Study

RATE, SIGMA = 100.0, 0.005
BANK = 'any_motion', 'white'
WHITE = White({'R': SIGMA**2})


def coloured(rng, n, sigma, tc):
    keep = np.exp(-1 / (RATE * tc))
    return lfilter([1], [1, -keep], sigma * np.sqrt(1 - keep**2) * rng.standard_normal(n))


def on_its_springs(rng, n):
    """Return the rate of a body that never rests, rad/s, noise of the sensor added."""
    def band(corner, order):
        x = sosfilt(butter(order, corner, fs=RATE, output='sos'), rng.standard_normal(n))
        return x / np.std(x)
    return 0.02 * band(1.3, 2) + 0.012 * band(9.0, 1) + SIGMA * rng.standard_normal(n)


def stop_and_go(rng, n, much=1.0):
    """Return the rate of an arm that turns, and rests, by turns of a second or so."""
    t, rate, begin = np.arange(n) / RATE, np.zeros(n), 1.0
    while begin < t[-1] - 3:
        lasts = rng.uniform(0.6, 1.6)
        s = np.clip((t - begin) / lasts, 0, 1)
        rate += rng.choice([-1, 1]) * rng.uniform(0.3, 1.6) / lasts * 30 * s**2 * (1 - s)**2
        begin += lasts + rng.uniform(0.8, 3)
    return much * rate


def study_of(z):
    return Study.begin({'gyro_x': FilterProblem(z, 1 / RATE, stated={'white': WHITE.values})},
                       model_of('filter', BANK))


@pytest.mark.parametrize('seed', range(6))
def test_noise_that_goes_on_at_rest_outlasts_the_motion_and_a_motion_that_goes_on_does_not(seed):
    rng, n = np.random.default_rng(79501 + seed), 6000
    noise = GaussMarkov({'sigma': rng.uniform(2, 4) * SIGMA, 'tc': rng.uniform(0.03, 0.2)})
    model = Model([WHITE, noise])
    own = coloured(rng, n, noise['sigma'], noise['tc']) + SIGMA * rng.standard_normal(n)
    assert outlasts_motion(own + stop_and_go(rng, n), 1 / RATE, model, 'gauss_markov')
    assert not outlasts_motion(own, 1 / RATE, model, 'gauss_markov')    # nothing to tell it by
    like = GaussMarkov({'sigma': 0.023, 'tc': 0.1})
    assert not outlasts_motion(on_its_springs(rng, n), 1 / RATE, Model([WHITE, like]),
                               'gauss_markov')
    # rests in which there is no such noise
    quiet = stop_and_go(rng, n) + SIGMA * rng.standard_normal(n)
    assert not outlasts_motion(quiet, 1 / RATE, model, 'gauss_markov')


def test_noise_is_counted_at_the_level_that_it_has():
    """A noise that is nine times as strong as stated hides what rests with less of it."""
    rng, n = np.random.default_rng(79516), 6000
    noise = GaussMarkov({'sigma': 3 * SIGMA, 'tc': 0.1})
    z = stop_and_go(rng, n) + coloured(rng, n, noise['sigma'], noise['tc'])
    z += 3 * SIGMA * rng.standard_normal(n)
    for factor, lasts in ((9.0, True), (100.0, False)):
        model = Model([WHITE, NoiseLevel({'factor': factor}), noise])
        assert outlasts_motion(z, 1 / RATE, model, 'gauss_markov') == lasts


def test_a_record_of_few_stretches_tells_nothing():
    noise = GaussMarkov({'sigma': 1.0, 'tc': 5.0})
    assert not outlasts_motion(np.zeros(3000), 1 / RATE, Model([WHITE, noise]), 'gauss_markov')


def test_only_noise_with_a_memory_is_coloured():
    assert is_coloured(GaussMarkov.example())
    for effect in (White, NoiseLevel, Outliers, SamplingJitter, Sinusoid):
        assert not is_coloured(effect.example())


@pytest.mark.parametrize('factor', [0.5, 1.3, 2.0, 9.0])
def test_white_noise_is_as_strong_where_no_motion_comes_to(factor):
    rng, n = np.random.default_rng(79507), 6000
    z = stop_and_go(rng, n) + np.sqrt(factor) * SIGMA * rng.standard_normal(n)
    model = Model([WHITE, NoiseLevel({'factor': factor})])
    assert is_as_strong(z, model, 'noise_level')
    fast = on_its_springs(rng, n)
    assert is_as_strong(fast, model, 'noise_level') == (factor < 2)


@pytest.mark.thorough
@pytest.mark.parametrize('seed', [
    79508, *(pytest.param(s, marks=pytest.mark.thorough) for s in (79509, 79510, 79511))])
def test_a_body_on_its_springs_is_not_taken_for_noise(seed):
    study = study_of(on_its_springs(np.random.default_rng(seed), 3000))
    found = study.diagnose()['gyro_x']
    assert found.verdict in ('unknown', 'complete')
    against = {f.name: f.against for f in found.ranked if f.gain > f.penalty}
    assert against.get('gauss_markov', AS_MOTION) == AS_MOTION
    assert against.get('noise_level', TOO_SLOW) == TOO_SLOW


@pytest.mark.thorough
@pytest.mark.parametrize('seed', [79512, 79513, 79514])
def test_coloured_noise_of_an_arm_that_rests_at_times_is_named(seed):
    rng, n = np.random.default_rng(seed), 5000
    z = stop_and_go(rng, n) + coloured(rng, n, 4 * SIGMA, 0.05) + SIGMA * rng.standard_normal(n)
    study = study_of(z)
    found = study.diagnose()['gyro_x']
    assert found.verdict == 'missing' and found.ranked[0].name == 'gauss_markov'


@pytest.mark.thorough
def test_noise_that_grows_to_another_level_is_no_share_of_outliers():
    rng, n = np.random.default_rng(79515), 6000
    level = np.where(np.arange(n) < n // 2, 1.0, 4.0)
    z = 3 * on_its_springs(rng, n) + SIGMA * level * rng.standard_normal(n)
    for finding in study_of(z).diagnose()['gyro_x'].found:
        assert finding.name != 'outliers'


def test_what_one_axis_has_idles_in_the_others():
    x = Model([WHITE, SamplingJitter({'jitter': 2e-3})])
    y = Model([WHITE, NoiseLevel({'factor': 3.3})])
    z = Model([WHITE, Outliers({'fraction': 0.3, 'factor': 50.0})])
    for model, own in zip(aligned([x, y, z]), (x, y, z)):
        assert set(model.labels) == {'white', 'sampling_jitter', 'noise_level', 'outliers'}
        for label in own.labels:
            assert model[label] == own[label]
        rest = model.minus(own.labels[1])
        assert all(e.block(0.01).r_factor == 1 for e in rest if e.name == 'noise_level')
        assert all(e['jitter'] < 1e-6 for e in rest if e.name == 'sampling_jitter')
        assert all(e['fraction'] < 1e-4 for e in rest if e.name == 'outliers')
