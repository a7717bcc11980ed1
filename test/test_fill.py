# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is drawn for lost samples: the spectrum, levels and grids of those that were not lost."""

import numpy as np
from params import daily
import pytest
from scipy.signal import butter, lfilter

from imu_noise_tools.core.clock import fit_clock
from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.health.fill import drawn, REACH
from imu_noise_tools.health.prepare import prepare
from imu_noise_tools.loop.effect import model_of
from imu_noise_tools.noise.gather import gather
from imu_noise_tools.noise.problem import NoiseProblem


def lossy(y, share, rng):
    """Return y with a share of it interpolated, and which samples are there."""
    there = rng.random(len(y)) >= share
    there[[0, -1]] = True
    at = np.flatnonzero(there)
    return np.interp(np.arange(len(y)), at, y[there]), there


def power(y, edges):
    """Return the mean power in bands."""
    p = np.abs(np.fft.rfft(y)) ** 2
    return np.array([np.mean(p[a:b]) for a, b in zip(edges[:-1], edges[1:])])


@pytest.mark.parametrize('kind', ['white', 'filtered', 'line', 'grid'])
@pytest.mark.parametrize('share', [0.02, 0.1, 0.3])
def test_the_spectrum_stays(kind, share):
    """Of interpolated white noise a tenth lost makes 1.15 at the slow end, .75 at the fast."""
    rng = np.random.default_rng(7)
    n = 60_000
    y = rng.standard_normal(n)
    if kind == 'filtered':
        y = lfilter(*butter(2, 0.4), y)
    elif kind == 'line':
        y = y + 3 * np.sin(2 * np.pi * 0.123 * np.arange(n))
    elif kind == 'grid':
        y = 0.7 * np.round(y / 0.7) + 0.1
    found, there = lossy(y, share, rng)
    edges = np.array([100, 400, 1500, 6000, 15_000, 30_000])    # from where a level is followed
    filled = drawn(found, there, rng)
    np.testing.assert_array_equal(filled[there], y[there])
    was = power(y, edges)
    # what a filter all but takes away is told no better
    off = (power(filled, edges) - was) / np.maximum(was, 0.03 * np.max(was))
    assert np.all(np.abs(off) < (0.1 if share < 0.3 else 0.2)), off
    if kind == 'white' and share == 0.1:
        smooth = power(found, edges) / was
        assert smooth[0] > 1.08 and smooth[-1] < 0.85
    if kind == 'grid':
        steps = ((filled - 0.1) / 0.7)[filled != found]     # but for long runs and the ends
        np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)


def test_drift_is_followed():
    """What is drawn is about the level there, not about that of the whole."""
    rng = np.random.default_rng(8)
    n = 40_000
    slow = 50 * np.sin(2 * np.pi * np.arange(n) / n)
    found, there = lossy(slow + rng.standard_normal(n), 0.1, rng)
    rest = (drawn(found, there, rng) - slow)[~there]
    assert abs(np.mean(rest)) < 0.1 and np.std(rest) == pytest.approx(1, rel=0.15)


def test_long_runs_ends_and_what_stands_still_are_left():
    rng = np.random.default_rng(9)
    x = rng.standard_normal(10_000)
    there = np.ones(len(x), bool)
    there[500:500 + REACH + 1] = there[3] = there[-2] = False
    np.testing.assert_array_equal(drawn(x, there, rng), x)
    there[7000] = False
    np.testing.assert_array_equal(np.flatnonzero(drawn(x, there, rng) != x), [7000])
    flat = np.full(10_000, 4.0)
    np.testing.assert_array_equal(drawn(flat, there, rng), flat)


@pytest.mark.parametrize('share', [0.02, 0.1, 0.3, 0.45])
@pytest.mark.parametrize('jitter', [0.0, 1e-4])
def test_a_clock_is_found_whatever_share_of_samples_is_lost(share, jitter):
    """Where a third was lost no hundred samples follow each other."""
    rng = np.random.default_rng(10)
    there = rng.random(30_000) >= share
    there[[0, -1]] = True
    t = np.flatnonzero(there) * 0.01
    clock = fit_clock(np.sort(t + jitter * rng.standard_normal(len(t))))
    assert clock.rate_hz == pytest.approx(100, rel=1e-5)
    np.testing.assert_array_equal(clock.place(len(t)), np.flatnonzero(there))


def test_coarse_late_and_buffered_stamps_are_not_counted_as_losses():
    rng = np.random.default_rng(11)
    n = 30_000
    records = {
        'ticks': (np.floor(np.arange(n) / 285 / 1e-3) * 1e-3, 285),
        'buffers': (np.repeat(np.arange(n // 10) * 0.1, 10), 100),
        'late': (np.maximum.accumulate(np.arange(n) * 0.01 + 0.01 * (rng.random(n) < 0.1)), 100),
    }
    for name, (t, rate) in records.items():
        clock = fit_clock(t)
        assert clock.rate_hz == pytest.approx(rate, rel=1e-3), name
        assert clock.missing < 10, name


@pytest.mark.parametrize('share', daily([0.02, 0.1, 0.3], 0.3))
def test_white_noise_of_which_samples_were_lost_has_its_level(share):
    """Before, 0.994 of it, 1.077 and 1.19, with intervals of 1 %, and a filter was named."""
    rng, n = np.random.default_rng([12, int(100 * share)]), 60_000
    there = rng.random(n) >= share
    there[[0, -1]] = True
    record = ImuRecord(1e-3 * rng.standard_normal((n, 3))[there], None,
                       np.flatnonzero(there) / 100, 100.0)
    ready = prepare(record)
    assert ready.missing == n - np.sum(there) and ready.n == n
    assert abs(np.corrcoef(ready.gyro[~there].T) - np.eye(3)).max() < 0.15
    again = prepare(record)
    np.testing.assert_array_equal(again.gyro, ready.gyro)
    for axis, evidence in gather(ready, ['gyro_x', 'gyro_y', 'gyro_z']).items():
        fit = NoiseProblem(evidence).point(model_of('noise', ('white',)))
        e = fit.estimates['white']['N']
        assert abs(e.point - 1e-4) < 4 * e.std, axis
