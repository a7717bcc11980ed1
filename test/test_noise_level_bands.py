# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A level that changes in some bands only is no change of the white noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, iirpeak, lfilter

from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.loop.effect import model_of
from imu_noise_tools.noise.gather import gather
from imu_noise_tools.noise.level import steady_band, with_level_notes
from imu_noise_tools.noise.problem import NoiseProblem

N, DT = 60_000, 0.01
T = np.arange(N) * DT


@pytest.mark.thorough
@pytest.mark.parametrize('f, rumbles', [(12.0, True), (6.0, True), (12.0, False)])
def test_a_rumble_that_comes_and_goes_is_no_change_of_n(f, rumbles):
    """N was said to be another where the rumble was silent."""
    rng, on = np.random.default_rng(3), T % 300 < 130
    rumble = lfilter(*iirpeak(f, 2, 1 / DT), rng.standard_normal(N))
    y = rng.standard_normal((N, 3))
    y[:, 0] = y[:, 0] + 3 * on * rumble if rumbles else y[:, 0] * np.where(on, 1.5, 1)
    evidence = gather(ImuRecord(1e-3 * y, None, T, 1 / DT), ['gyro_x'])['gyro_x']
    fit = NoiseProblem(evidence).point(model_of('noise', ('white', 'variance_change')))
    band = steady_band(evidence, fit)
    note = with_level_notes(evidence, fit)['white']['N'].note
    assert (band is not None and band[0] > f) == rumbles
    assert ('is not heard from' in note) == rumbles != ('where it is quietest' in note)


def test_a_level_far_above_the_rest_of_the_record_says_so():
    """What sways, and hides the white level at the slow end, is no white noise."""
    rng = np.random.default_rng(11)
    sway = lfilter(*butter(4, 1.0, fs=1 / DT), rng.standard_normal((N, 3)), axis=0)
    record = ImuRecord(1e-3 * rng.standard_normal((N, 3)) + 0.1 * sway, None, T, 1 / DT)
    problem = NoiseProblem(gather(record, ['gyro_x'])['gyro_x'])
    fit = problem.fit(model_of('noise', ('white', 'flicker', 'random_walk')))
    note = fit.estimates['white']['N'].note
    assert 'times less power' in note and 'something moves' in note
