# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What axes have in common and is no coupling: a machine that all hear, a mount that turns."""

from __future__ import annotations

import re

import numpy as np
from params import daily, seldom
import pytest
from scipy.signal import iirpeak, lfilter

from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.core.spectrum import bins_of, cosine_transform, power
from imu_noise_tools.loop.effect import model_of
from imu_noise_tools.noise.coupled import heard_at, why_no_coupling
from imu_noise_tools.noise.gather import gather
from imu_noise_tools.noise.problem import NoiseProblem
from imu_noise_tools.noise.shared import heard_together, share
from imu_noise_tools.tasks.noise import analyse_record

BASE = ('white', 'flicker', 'random_walk')
N, RATE, GRAVITY = 24_000, 100.0, 9.81
T = np.arange(N) / RATE


def record_of(rng, gyro=0.0, accel=0.0):
    """Return a record at rest, with something (n, 3) of each sensor beside its white noise."""
    noise = rng.standard_normal((2, N, 3)) * np.array([1e-3, 1e-2])[:, None, None]
    return ImuRecord(noise[0] + gyro, noise[1] + [0, 0, GRAVITY] + accel, T, RATE)


def fan(rng):
    """Return (2, n, 3) of a fan that runs now and then, of any phase and size on each axis."""
    on = np.isin((T // 30).astype(int), [1, 3, 4, 7])
    sizes = rng.uniform(0.5, 1.5, (2, 1, 3)) * np.array([1.5e-3, 2e-2])[:, None, None]
    phases = rng.uniform(0, 2 * np.pi, (2, 1, 3))
    return sizes * np.sin(2 * np.pi * 41.7 * T[:, None] + phases) * on[:, None]


def sway(rng, f, q):
    """Return a mount (n, 3) that each of three resonances moves."""
    some = [lfilter(*iirpeak(f * k, q, fs=RATE), rng.standard_normal(2 * N))[N:]
            for k in (0.9, 1.0, 1.15)]
    return np.column_stack(some) / np.std(some, axis=1)


def fitted(record, coupling):
    """Return (evidence, fit, label) of the x-axis with a coupling."""
    problem = NoiseProblem(gather(record, ['gyro_x'])['gyro_x'])
    return problem.evidence, problem.point(model_of('noise', (*BASE, coupling))), coupling


def said_of(record, coupling):
    return why_no_coupling(*fitted(record, coupling))


@pytest.mark.thorough
@pytest.mark.parametrize('coupling', ['accel_coupling', 'shared_noise'])
def test_at_one_frequency_no_coupling_is_told(coupling):
    """Shares of axes that have other phases make any line."""
    rng = np.random.default_rng(1)
    assert 'at one frequency' in said_of(record_of(rng, *fan(rng)), coupling)


@pytest.mark.parametrize('f, q', [seldom(0.6, 4.0), (12.0, 15.0)])
def test_what_a_resonance_shakes_tells_a_coupling(f, q):
    rng = np.random.default_rng(2)
    moves = sway(rng, f, q)
    some = fitted(record_of(rng, 3e-3 * moves @ rng.standard_normal((3, 3)), 0.1 * moves),
                  'accel_coupling')
    assert not why_no_coupling(*some)
    start = r'around (\S+) Hz, .*: as a machine' if q > 10 else r'most of it between (\S+)'
    words = re.match(start, heard_at(*some))
    assert words and float(words[1]) == pytest.approx(f, rel=0.2 if q > 10 else 0.8)


@pytest.mark.parametrize('share, turns', [(1.0, True), (0.5, False), seldom(-1.0, False)])
def test_a_mount_that_turns_moves_gravity(share, turns):
    """
    By a rotation about x the acceleration along y grows; the angle is that over gravity.

    Of another size, or the other way round, it is none.

    """
    rng = np.random.default_rng(3)
    angle = 3e-3 * sway(rng, 0.12, 8.0)[:, :1]
    x, y = np.eye(3)[0], np.eye(3)[1]
    record = record_of(rng, share * np.gradient(angle, 1 / RATE, axis=0) * x, GRAVITY * angle * y)
    assert ('gravity' in said_of(record, 'accel_coupling')) == turns


@pytest.mark.thorough
@pytest.mark.parametrize('seed', range(3))
def test_a_machine_that_all_axes_hear_is_named_on_each(seed):
    """Each was explained by the others, in a circle, and the machine by none."""
    rng = np.random.default_rng([4, seed])
    said = analyse_record(record_of(rng, *fan(rng)), keep_motion=True).diagnose()
    for axis, one in said.items():
        names = {f.name for f in one.found}
        assert names and names <= {'narrowband', 'sinusoid'}, (axis, one.found)
        assert all(abs(f.effect['frequency'] - 41.7) < 0.1 for f in one.found), (axis, one.found)


def test_a_few_percent_above_the_noise_that_is_fitted_are_nothing_from_outside():
    """Far from a sway the fit of the own noise is off by as much: in most records nothing."""
    n, dt, far = 90_000, 0.01, []
    pole = np.exp((2j * np.pi * 0.42 - np.pi * 0.01) * dt)
    ring = [1, -1], [1, -2 * pole.real, abs(pole) ** 2]
    bins = bins_of(n, dt)
    for seed in range(10):
        rng = np.random.default_rng(seed)
        moves = lfilter(*ring, rng.standard_normal(n + 50_000))[50_000:]
        y = np.array([[3.3], [1.0]]) * moves / np.std(moves) + rng.standard_normal((2, n))
        heard = heard_together(dict(zip(('accel_x', 'accel_y'), y)), dt)
        told = share(bins, power(cosine_transform(y[1]), dt, bins), heard['accel_y'])
        far.append(np.average(told[bins.f > 10], weights=bins.count[bins.f > 10]))
    assert np.median(far) < 0.001 and np.max(far) < 0.1


@pytest.mark.parametrize('seed', daily(range(8), 0))
def test_below_what_shakes_two_axes_they_have_nothing_in_common(seed):
    """What a swing leaks through the ends of a record is the same wave in both."""
    rng, n, dt = np.random.default_rng(seed), 60_000, 0.01
    each = rng.uniform(1.5, 2.5, 100)
    moves = sum(np.cos(2 * np.pi * (f * np.arange(n) * dt + rng.uniform())) for f in each)
    y = np.array([[30.0], [20.0]]) * moves + rng.standard_normal((2, n))
    f, heard = heard_together(dict(zip(('accel_x', 'accel_y'), y)), dt)['accel_x']
    assert np.min(heard[(f > 1.8) & (f < 2.2)]) > 0.7
    assert np.median(heard[f < 0.5]) < 0.3
