# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The power of blocks in time: its level, how much of the samples tells it, what leaks."""

import numpy as np
import pytest
from scipy.signal import lfilter

from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.loop.effect import model_of
from imu_noise_tools.loop.findings import failures
from imu_noise_tools.noise.block_means import covariance_of_means
from imu_noise_tools.noise.blocks import block_power, FEWER, FIRST, leaked
from imu_noise_tools.noise.gather import gather
from imu_noise_tools.noise.in_time import power_in_time
from imu_noise_tools.noise.problem import NoiseProblem

DT = 0.01
AXES = ['gyro_x', 'gyro_y', 'gyro_z']


def test_white_noise_has_its_density_in_all_bands():
    p, count = block_power(np.random.default_rng(1).normal(0, 3.0, 200_000), DT)
    off = p.mean(axis=0) / (2 * DT * 9) - 1
    # an ordinate has two degrees of freedom, some of them shared
    assert np.all(np.abs(off) < 5 * np.sqrt(1.1 / (count * len(p))))


@pytest.mark.thorough
@pytest.mark.parametrize('n', [6000, 20_011, 100_000])
@pytest.mark.parametrize('a', [[1.0], [1.0, -0.98], [1.0, -1.6, 0.65]])
def test_blocks_scatter_as_said_and_use_most_of_the_samples(n, a):
    rng = np.random.default_rng(n)
    found = gather(ImuRecord(lfilter([1.0], a, rng.standard_normal((n, 3)), axis=0), None,
                             DT * np.arange(n), 1 / DT), AXES)
    scatter, told = [], []
    for evidence in found.values():
        _, x, w = power_in_time(evidence)
        scatter.append(np.var(x @ w / w.sum(), ddof=1) * w.sum() / 2)
        told.append(w.sum() / (2 * np.sum(evidence.block_count)))
    blocks = 3 * len(x)
    assert abs(np.mean(scatter) - 1) < 4 * np.sqrt((2 + 12 / w.sum()) / blocks) + 0.02
    assert 1 / FEWER > 0.85
    assert min(told) > 0.8      # of Hann's window half


@pytest.mark.parametrize('phase', [0.0, 1.0, 2.0])
@pytest.mark.parametrize('at', [40.0, 40.5])
def test_a_line_leaks_into_neighbours_alone(at, phase):
    n = 256 * 1000
    p, count = block_power(np.cos(2 * np.pi * at * np.arange(n) / 1000 + phase), DT)
    edges = FIRST + np.append(0, np.cumsum(count))
    far = (edges[1:] < at - 9) | (edges[:-1] > at + 9)
    assert far.any()
    assert np.max(p[:, far]) < 1e-4 * np.max(p @ count)


def test_what_leaks_keeps_its_power():
    line = np.zeros(200)
    line[100] = 1.0
    seen = leaked(line)
    assert np.sum(seen) == pytest.approx(1)
    assert seen[100] > 0.7
    assert seen[102] < 0.02
    assert leaked(np.ones(50)) == pytest.approx(np.ones(50))


@pytest.mark.parametrize('length', [1, 2, 3, 4, 13, 30])
def test_means_of_blocks_have_the_covariance_of_the_samples(length):
    """Of blocks of few samples as well, behind a filter: what folds is what the record has."""
    count = 64
    n = count * length

    def psd(f):
        return 1 + 4 * np.cos(np.pi * f * DT) ** 2

    k, j = np.arange(1, n), np.arange(n) + 0.5
    basis = np.sqrt(2 / n) * np.cos(np.pi * np.outer(j, k) / n)
    means = basis.reshape(count, length, n - 1).mean(axis=1)
    exact = (means * psd(k / (2 * n * DT)) / (2 * DT)) @ means.T
    told = covariance_of_means(psd, count, n, DT)
    assert np.max(np.abs(told - exact)) < 0.02 * np.max(np.abs(exact))


@pytest.mark.parametrize(('seconds', 'rate'), [(4, 200), (15, 100)])
def test_short_records_of_noise_pass(seconds, rate):
    """Their blocks have a few samples each: 4 s of white noise failed in every axis."""
    rng = np.random.default_rng(seconds)
    n, failed = seconds * rate, []
    for _ in range(3):
        record = ImuRecord(rng.standard_normal((n, 3)), None, np.arange(n) / rate, rate)
        for evidence in gather(record, AXES).values():
            problem = NoiseProblem(evidence)
            fit = problem.point(model_of('noise', ('white', 'flicker', 'random_walk')))
            failed += [t.name for t in failures(problem.omnibus(fit))]
    assert len(failed) <= 1
