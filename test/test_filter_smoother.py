# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The smoother against the plain one, against every sequence of modes, and against the filter."""

from __future__ import annotations

from itertools import product
import json

import numpy as np
import pytest
from scipy import stats

from imu_noise_tools.cli.main import main
from imu_noise_tools.core.errors import UsageError
from imu_noise_tools.core.units import DEG
from imu_noise_tools.filter import kalman
from imu_noise_tools.filter.design import design
from imu_noise_tools.filter.recorded import filter_record
from imu_noise_tools.filter.smoother import smooth_chunks
from imu_noise_tools.filter.stamps import Clock, RESTART
from imu_noise_tools.filter.statespace import state_space

SIGMA = 0.6 * DEG
KNOWN = {'white': {'R': SIGMA ** 2}}
LINEAR = {
    'acceleration': (('constant_rate', 'angular_acceleration'), ('white',)),
    'colour': (('constant_rate', 'ar_increment'), ('white', 'gauss_markov')),
    'vibration': (('jerk',), ('white', 'sinusoid')),
}


def there_and_back(spaces, z):
    """Return rate and variance (n,) by Rauch, Tung and Striebel; spaces (n,) of each interval."""
    x, p, seen, guessed = np.zeros(spaces[0].size), spaces[0].p0, [], []
    for k, (space, sample) in enumerate(zip(spaces, z)):
        if k:
            x, p = kalman.predict(space, x, p)
        guessed.append((x, p))
        x, p, _, _ = kalman.update(space, x, p, sample)
        seen.append((x, p))
    out = [seen[-1]]
    for k in range(len(z) - 2, -1, -1):
        (x, p), (x1, p1) = seen[k], guessed[k + 1]
        gain = p @ spaces[k + 1].phi.T @ np.linalg.pinv(p1, hermitian=True)
        out.append((x + gain @ (out[-1][0] - x1), p + gain @ (out[-1][1] - p1) @ gain.T))
    h = spaces[0].rate
    return np.array([(h @ x, h @ p @ h) for x, p in reversed(out)]).T


def turning(n, seed=0, rate=100.0):
    """Return stamps, samples and truth (n, 3): rest, a turn, rest, a step."""
    t = np.arange(n) / rate
    x = np.clip((t - 0.3 * t[-1]) / 1.0, 0, 1)
    truth = 90 * DEG * (1 - np.cos(2 * np.pi * x)) + 20 * DEG * (t > 0.7 * t[-1])
    truth = truth[:, None] * np.array([1.0, -0.5, 0.0])
    return t, truth + SIGMA * np.random.default_rng(seed).standard_normal((n, 3)), truth


@pytest.mark.parametrize('name', sorted(LINEAR))
def test_one_model_is_the_plain_smoother(name):
    t, z, _ = turning(700)
    chosen = design(*LINEAR[name], values=KNOWN)
    got = filter_record(t, z, chosen, 100.0, smooth=True)
    for axis in range(3):
        spaces = [state_space(chosen.models()[axis], 0.01)] * len(z)
        rate, variance = there_and_back(spaces, z[:, axis])
        assert np.abs(got.rate[:, axis] - rate).max() < 1e-7 * SIGMA
        assert np.abs(got.variance[:, axis] / variance - 1).max() < 1e-7


def test_every_sequence_of_modes():
    """Steps or none in each interval: the exact mean and variance are sums over 2^n sequences."""
    n = 9
    chosen = design(('constant_rate', 'rate_step'), axes=1, values={
        **KNOWN, 'rate_step': {'size': 10 * SIGMA, 'rate': 5.0}})
    keys = np.r_[RESTART, np.zeros(n - 1, int)]
    off, share = [], []
    for seed in range(12):
        z = SIGMA * np.random.default_rng(seed).standard_normal((n, 1))
        z[4:] += (10, 5, 0)[seed % 3] * SIGMA
        got = smooth_chunks(z, keys, chosen, Clock.of(100.0))
        rate, variance = _exact(z[:, 0], chosen.modes(0.01), 0)
        off.append((got[0][:, 0] - rate) / SIGMA)
        share.append(got[1][:, 0] / variance)
    assert np.sqrt(np.mean(np.square(off))) < 0.1         # of a filter 0.5
    assert 0.9 < np.median(share) < 1.1


def _exact(z, modes, axis):
    n = len(z)
    spaces = modes.spaces[axis]
    total, parts = [], []
    for sequence in product((0, 1), repeat=n - 1):
        q = np.array([0.0, *(spaces[m].q[0, 0] for m in sequence)])
        first = spaces[0].p0[0, 0]
        covariance = first + np.minimum.outer(np.cumsum(q), np.cumsum(q))
        s = covariance + spaces[0].r * np.eye(n)
        gain = np.linalg.solve(s, covariance).T
        total.append(stats.multivariate_normal(np.zeros(n), s).logpdf(z)
                     + sum(np.log(modes.prior[m]) for m in sequence))
        parts.append((gain @ z, np.diag(covariance - gain @ covariance)))
    w = np.exp(np.array(total) - max(total))
    w /= w.sum()
    mean = sum(a * x for a, (x, _) in zip(w, parts))
    return mean, sum(a * (v + (x - mean) ** 2) for a, (x, v) in zip(w, parts))


def test_it_is_nearer_than_the_filter_at_rest_in_a_turn_and_at_a_step():
    t, z, truth = turning(6000, seed=5)
    chosen = design(values=KNOWN)
    causal = filter_record(t, z, chosen, 100.0)
    both = filter_record(t, z, chosen, 100.0, smooth=True)
    parts = {'rest': slice(200, 1700), 'turn': slice(1790, 1910), 'step': slice(4150, 4260)}
    for name, part in parts.items():
        before, after = (np.sqrt(np.mean((f.rate - truth)[part, :2] ** 2)) for f in (causal, both))
        assert after < 0.8 * before, (name, before / SIGMA, after / SIGMA)
    error = (both.rate - truth) / np.sqrt(both.variance)
    assert np.mean(np.abs(error) < 1.96) > 0.9 and np.abs(error).max() < 8
    assert np.array_equal(both.score, causal.score)


def test_flaws_of_a_stream():
    t, z, truth = turning(3000, seed=6)
    late = t.copy()
    late[400:] += 0.01                                  # a message lost
    late[1500:] += 30.0                                 # a gap
    late[2400] = late[2399]                             # the same stamp, another sample
    late[2500], z[2500] = late[2499], z[2499]           # a copy
    z[500, 1] = np.nan
    chosen = design(values=KNOWN)
    got = filter_record(late, z, chosen, 100.0, smooth=True)
    assert np.isnan(got.rate[500]).all() and np.isfinite(np.delete(got.rate, 500, 0)).all()
    assert np.array_equal(got.rate[2500], got.rate[2499])
    alone = filter_record(late[1500:], z[1500:], chosen, 100.0, smooth=True)
    assert np.abs(got.rate[1500:] - alone.rate).max() < 1e-6 * SIGMA     # nothing over the gap
    error = (got.rate - truth)[np.isfinite(got.rate[:, 0])]
    assert np.sqrt(np.mean(error ** 2)) < 0.25 * SIGMA


@pytest.mark.thorough
def test_blocks_and_chunks_are_the_whole(monkeypatch):
    from imu_noise_tools.filter import lanes, smoother
    t, z, truth = turning(9000, seed=7, rate=10.0)
    chosen = design(values=KNOWN)
    chunks = filter_record(t, z, chosen, 10.0, smooth=True)
    monkeypatch.setattr(lanes, 'WARM_UP', 900.0)
    whole = filter_record(t, z, chosen, 10.0, smooth=True)
    # at rest the bank remembers for minutes; what a chunk lacks of that is within its variance
    error = [np.sqrt(np.mean((f.rate - truth) ** 2)) for f in (whole, chunks)]
    assert error[1] < 1.05 * error[0]
    assert (np.abs(whole.rate - chunks.rate) / np.sqrt(chunks.variance)).max() < 3
    monkeypatch.setattr(smoother, 'BLOCK', 100)
    assert np.array_equal(whole.rate, filter_record(t, z, chosen, 10.0, smooth=True).rate)


def test_a_fading_memory_is_refused():
    t, z, _ = turning(100)
    with pytest.raises(UsageError, match='fading'):
        filter_record(t, z, design(alpha=0.7), smooth=True)


def test_command(tmp_path, capsys):
    t, z, truth = turning(1200, seed=8)
    bag = tmp_path / 'in.npz'
    np.savez(bag, t=t, gyro=z, accel=np.tile([0.0, 0.0, 9.81], (len(t), 1)), rate_hz=100.0)
    command = ['filter', str(bag), '--smooth', '--json']
    assert main([*command, '-o', str(tmp_path / 'out.npz')]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said['smooth'] is True
    with np.load(tmp_path / 'out.npz') as out:
        error = out['gyro_filtered'] - truth
    assert np.sqrt(np.mean(error ** 2)) < 0.25 * SIGMA
    assert main([*command, '-o', str(tmp_path / 'no.npz'), '--alpha', '0.7']) == 2
    assert 'fading' in capsys.readouterr().err and not (tmp_path / 'no.npz').exists()
