# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Clipped samples are seen at any level, one by one or in a row, and only where there are some."""

from dataclasses import replace

import numpy as np
import pytest

from imu_noise_tools.core.clipped import ends_of_range, narrowed, stays
from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.health.examine import examine
from imu_noise_tools.health.prepare import prepare
from imu_noise_tools.loop.effect import model_of
from imu_noise_tools.noise.gather import gather
from imu_noise_tools.noise.level import clipped
from imu_noise_tools.noise.problem import NoiseProblem

RATE = 100.0


@pytest.mark.parametrize('step', [0.0, 0.05, 0.12, 0.3])
@pytest.mark.parametrize('share', [0.02, 0.16, 0.4])
@pytest.mark.parametrize('sign', [-1, 1])
def test_a_lump_at_the_end_is_clipping(step, share, sign):
    """Of white noise, which comes to its end sample by sample; at a level that is no range."""
    x = np.random.default_rng(1).standard_normal(60_000) + 0.37
    x = np.round(x / step) * step if step else x
    end = np.quantile(x, 1 - share, method='nearest')
    assert ends_of_range(x) == ()
    assert ends_of_range(sign * np.minimum(x, end)) == (sign * end,)
    if step < 0.2:      # else few levels are left between them
        assert set(ends_of_range(np.clip(x, -end, end))) == {-end, end}


def of(kind, rng, n=60_000):
    """Return noise (n,) that is not clipped, with what might look like it."""
    white, k = rng.standard_normal(n), np.arange(n)
    return {
        'noise': lambda: white,
        'uniform': lambda: rng.uniform(-1.7, 1.7, n),
        'telegraph': lambda: white + 9 * (np.cumsum(rng.random(n) < 0.2) % 2),
        'square': lambda: 0.05 * white + 9 * (k // 50 % 2),
        'vibration': lambda: 0.2 * white + 7 * np.sin(0.77 * k),
        'levels off': lambda: 0.1 * white - 30 * np.exp(-k / 3000),
        'wanders': lambda: white + 0.05 * np.cumsum(rng.standard_normal(n)),
        'held': lambda: white[np.maximum.accumulate(np.where(rng.random(n) < 0.1, k, 0))],
        'frozen': lambda: white[np.where((k > 9000) & (k < 9400), 9000, k)],
    }[kind]()


@pytest.mark.parametrize('kind', ['noise', 'uniform', 'telegraph', 'square', 'vibration',
                                  'levels off', 'wanders', 'held', 'frozen'])
def test_what_only_looks_like_clipping_is_none(kind):
    """Whether the steps of the output are fine, or as large as the noise and larger."""
    for seed, step in enumerate((0.0, 0.1, 1.0, 2.0, 5.0)):
        x = of(kind, np.random.default_rng([seed, 3]))
        assert ends_of_range(np.round(x / step) * step if step else x) == (), step


def test_a_dead_axis_and_what_goes_to_its_end_in_a_row():
    """A constant is none; a swing beyond the range stays there, noise does not."""
    assert ends_of_range(np.full(1000, 9.8)) == ()
    rng = np.random.default_rng(5)
    noise = rng.standard_normal(20_000)
    swing = np.clip(noise + 30 * np.sin(2e-2 * np.arange(20_000)), -20, 20)
    assert stays(swing).mean() > 0.4
    assert not stays(np.minimum(noise, 1.0)).any()


@pytest.mark.parametrize('shares', [(0.16,), (0.3, 0.02), (0.01, 0.01)])
def test_what_clipping_leaves_of_the_noise(shares):
    """As samples say that are clipped so."""
    x = np.random.default_rng(2).standard_normal(400_000)
    low = np.quantile(x, shares[1]) if len(shares) > 1 else -np.inf
    some = np.clip(x, low, np.quantile(x, 1 - shares[0]))
    assert narrowed(shares) == pytest.approx(some.std() / x.std(), abs=3e-3)


def record_of(share):
    rng = np.random.default_rng(7)
    n = 30_000
    accel = np.round(rng.standard_normal((n, 3)) * 0.01 / 3e-4) * 3e-4 + [0, 0, 9.8]
    if share:
        accel[:, 2] = np.minimum(accel[:, 2], np.quantile(accel[:, 2], 1 - share))
    return ImuRecord(1e-3 * rng.standard_normal((n, 3)), accel, np.arange(n) / RATE, RATE)


def test_clipping_is_said_with_share_level_and_what_it_does():
    """By inspection, as a warning, and of N, which it makes insufficient."""
    record = record_of(0.15)
    health = examine(record)
    assert set(health.saturated) == {'accel_z'}
    said = [a for a in health.advice if 'end of its range' in a]
    assert len(said) == 1 and '15 % at 9.81' in said[0] and 'larger range' in said[0]
    ready = prepare(record)
    assert said[0][:-1] in ready.warnings
    assert not any(d.kind == 'clipped' for d in ready.disturbances)
    evidence = gather(ready, ['accel_x', 'accel_z'])
    assert clipped(evidence['accel_x']) == ''
    problem = NoiseProblem(evidence['accel_z'])
    fit = problem.point(model_of('noise', ('white',)))
    assert not problem.matters(fit).sufficient and problem.matters(fit).narrow == ('white.N',)
    for verdict in ('complete', 'unknown', 'missing'):
        assert 'mean and N are wrong' in problem.advice(verdict, [], [])
    noted = problem.fit(model_of('noise', ('white',))).estimates['white']['N'].note
    assert 'mean and level are wrong' in noted


def test_nothing_is_said_where_nothing_is_clipped():
    """The same record, and one whose clipped stretch is set aside."""
    record = record_of(0.0)
    assert examine(record).range_ends == {} and examine(record).saturated == {}
    problem = NoiseProblem(gather(prepare(record), ['accel_z'])['accel_z'])
    fit = problem.point(model_of('noise', ('white',)))
    assert problem.matters(fit).sufficient and problem.advice('complete', [], []) == ''
    accel = record.accel.copy()
    accel[5000:5040, 2] = 19.6
    aside = replace(record, accel=accel)
    assert not any('end of its range' in w for w in
                   prepare(aside, masks=[(49.9, 50.5)]).warnings)
