# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Effects in the forms they take: where they are the error falls, elsewhere they are null."""

from __future__ import annotations

import numpy as np
import pytest

import hidden
from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.loop.effect import find_effect, model_of
from imu_noise_tools.loop.prediction import fall_of
from imu_noise_tools.loop.verdict import FALL
from imu_noise_tools.noise.gather import gather
from imu_noise_tools.noise.problem import NoiseProblem

BASE = ('white', 'flicker', 'random_walk')


def problem_of(names, seed=3, strength=5.0):
    """Return the problem of a gyroscope axis that holds these effects."""
    record, truth = hidden.draw(np.random.default_rng([seed, 11]), names, strength=strength,
                                hours=0.5, rate_hz=20.0)
    return NoiseProblem(gather(record, ['gyro_x'])['gyro_x']), truth.hidden['gyro_x']


@pytest.mark.parametrize('name', ['harmonics', 'narrowband', 'slow_periodic', 'shock'])
def test_what_is_there_lowers_the_error(name):
    problem, _ = problem_of([name])
    before, after = (problem.held_out(model_of('noise', m)) for m in (BASE, (*BASE, name)))
    assert fall_of(before, after, [find_effect('noise', name)()]) > FALL


@pytest.mark.parametrize('name', ['harmonics', 'narrowband', 'slow_periodic', 'drift', 'shock'])
def test_what_is_not_there_is_null_or_small(name):
    """Null with an upper limit, or no more than chance allows."""
    problem, _ = problem_of([])
    fit = problem.fit(model_of('noise', (*BASE, name)))
    for p in fit.model[name].parameters:
        e = fit.estimates[name][p.name]
        if p.amplitude and e.value is not None:
            assert e.std and abs(e.value) < 4.5 * e.std, p.name


def test_a_second_step_lands_beside_the_first():
    """Up at 400 s and down at 1100 s, ten standard deviations of a block mean each."""
    rng, rate, n = np.random.default_rng(5), 20.0, 36_000
    sensor = hidden.draw_sensor(rng)
    t = np.arange(n) / rate
    y = hidden.base_noise(n, 1 / rate, sensor, rng)
    size = 25 * sensor['B']
    y = y + size * ((t >= 400) & (t < 1100))
    record = ImuRecord(np.column_stack([y, rng.permutation(y), rng.permutation(y)]), None, t, rate)
    problem = NoiseProblem(gather(record, ['gyro_x'])['gyro_x'])
    fit = problem.fit(model_of('noise', (*BASE, 'step', 'step')))
    times = sorted(fit.model[k]['time'] for k in ('step', 'step.2'))
    assert abs(times[0] - 400) < 5 and abs(times[1] - 1100) < 5


@pytest.mark.parametrize(('share', 'size'), [(0.02, 29.0), (0.02, 8.0), (0.001, 12.0)])
def test_many_spikes_have_their_rate_and_size(share, size):
    rng, rate, n = np.random.default_rng(6), 50.0, 60_000
    x = rng.standard_normal((n, 3))
    x[:, 0] += size * rng.standard_normal(n) * (rng.random(n) < share)
    record = ImuRecord(1e-3 * x, None, np.arange(n) / rate, rate)
    (found,) = (find_effect('noise', 'spikes')().find(e)
                for e in gather(record, ['gyro_x']).values())
    assert found.effect['sigma'] == pytest.approx(1e-3 * size, rel=0.2)
    assert found.effect['rate'] == pytest.approx(share * rate, rel=0.25)
