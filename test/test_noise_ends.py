# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a loud band leaks far below itself through the ends of a record."""

from __future__ import annotations

import numpy as np
from params import daily, seldom
import pytest
from scipy.signal import lfilter

from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.core.spectrum import bins_of, cosine_transform, expected, power
from imu_noise_tools.noise.ends import without_ends
from imu_noise_tools.tasks.noise import analyse_record

RATE, NOISE = 50.0, 1e-4    # Hz; rad/s/sqrt(Hz)


def swell(rng, n, f, rms, waves=200):
    """Return (n,): what a ship does at sea, waves of Pierson and Moskowitz about f, Hz."""
    each = f * (0.8 / -np.log(rng.uniform(0, 1, waves))) ** 0.25
    t = np.arange(n) / RATE
    y = sum(np.cos(2 * np.pi * (g * t + rng.uniform())) for g in each)
    return rms * y / np.std(y)


def white(rng, n):
    """Return (n,): white noise of the density NOISE."""
    return NOISE * np.sqrt(RATE) * rng.standard_normal(n)


def counted(rng, n, step):
    """Return (n,): the rate of an angle that is read with an error of ``step``, rms."""
    return np.diff(rng.standard_normal(n + 1)) * step * RATE


def spectrum_of(y):
    """Return (without ends or not, bins, the power of both)."""
    c, bins = cosine_transform(y - y.mean()), bins_of(len(y), 1 / RATE)
    out = without_ends(c, bins)
    return out is not c, bins, power(c, 1 / RATE, bins), power(out, 1 / RATE, bins)


@pytest.mark.parametrize('seed', daily(range(12), 1, 2))
def test_below_a_swell_is_what_the_sensor_does(seed):
    rng, n = np.random.default_rng(seed), 100_000
    f = rng.uniform(0.1, 0.3)
    y = swell(rng, n, f, rng.uniform(0.02, 0.3)) + white(rng, n)
    found, bins, before, after = spectrum_of(y)
    low = bins.f < 0.15 * f
    level = np.average(after[low], weights=bins.count[low]) / (2 * NOISE**2)
    assert found
    assert np.average(before[low], weights=bins.count[low]) > 2 * level * 2 * NOISE**2
    assert level == pytest.approx(1, abs=4.5 * np.sqrt(2 / bins.count[low].sum()))


@pytest.mark.parametrize('seed', daily(range(12), 1, 2))
def test_below_counts_of_an_angle_is_their_spectrum_alone(seed):
    rng, n, q = np.random.default_rng(seed), 100_000, 1e-3
    found, bins, before, after = spectrum_of(counted(rng, n, q) + white(rng, n))
    true = expected(lambda f: 8 * q**2 * RATE * np.sin(np.pi * f / RATE) ** 2 + 2 * NOISE**2,
                    bins_of(n, 1 / RATE, (), found))
    ratio = after / true
    for low, high in ((0, 0.05), (0.05, 0.5), (0.5, 25)):
        some = (bins.f >= low) & (bins.f < high)
        count = bins.count[some]
        assert np.average(ratio[some], weights=count) == pytest.approx(
            1, abs=4.5 * np.sqrt(2 / count.sum()))


@pytest.mark.parametrize('make', [
    white, lambda rng, n: np.cumsum(white(rng, n)),
    lambda rng, n: white(rng, n) + 0.002 * np.cumsum(white(rng, n)),
    lambda rng, n: lfilter([0.05], [1, -0.95], white(rng, n)),
    lambda rng, n: swell(rng, n, 0.2, NOISE) + white(rng, n),
], ids=['white', 'random walk', 'both', 'relaxation', 'faint swell'])
def test_where_nothing_leaks_nothing_is_touched(make):
    for seed in range(12):
        assert not spectrum_of(make(np.random.default_rng(seed), 20_000))[0]


@pytest.mark.parametrize(('seeds', 'complete'), [((2,), 1), seldom(range(1, 9), 7)])
def test_counts_of_an_angle_leave_no_white_noise_behind(seeds, complete):
    told = [loop_over_counts(np.random.default_rng(seed)) for seed in seeds]
    for _, estimates in told:
        assert estimates['quantization']['Q'].value == pytest.approx(2e-4, rel=0.01)
        n = estimates['white']['N']
        assert (n.upper95 if n.value is None else n.ci95[1]) < 5e-3 * NOISE
    assert [verdict for verdict, _ in told].count('complete') >= complete


def loop_over_counts(rng):
    """Return (verdict, estimates) of what the loop says of counts with next to no noise."""
    y = counted(rng, 180_000, 2e-4) + 1e-3 * white(rng, 180_000)
    gyro = np.stack([y, white(rng, len(y)), white(rng, len(y))], axis=1)
    record = ImuRecord(gyro, None, np.arange(len(y)) / RATE, RATE)
    study = analyse_record(record, axes=('gyro_x',), keep_motion=True)
    study.complete()
    return study.diagnosis['gyro_x'].verdict, study.states['gyro_x'].fit.estimates
