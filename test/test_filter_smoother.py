# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The smoother against the plain one, against every sequence of modes, and against the filter."""

from __future__ import annotations

from itertools import product
import json

import numpy as np
from params import daily, seldom
import pytest
from scipy import stats

from imu_noise_tools.cli.main import main
from imu_noise_tools.core.errors import FitError, UsageError
from imu_noise_tools.core.units import DEG
from imu_noise_tools.filter import kalman, recorded
from imu_noise_tools.filter.design import design
from imu_noise_tools.filter.engine import Engine
from imu_noise_tools.filter.recorded import filter_record
from imu_noise_tools.filter.smoother import smooth_chunks
from imu_noise_tools.filter.stamps import Clock, RESTART
from imu_noise_tools.filter.statespace import state_space
from imu_noise_tools.filter.window import Window

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


@pytest.mark.parametrize('name', daily(sorted(LINEAR), 'acceleration', 'colour'))
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


@pytest.mark.thorough
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


def test_what_is_seen_only_in_a_sum_leaves_no_nan():
    """Flicker noise comes as several slow terms: no sample tells one from another."""
    t, noise = np.arange(200)[:, None] / 200, 1.236e-3
    truth = 40 * DEG * np.sin(2 * np.pi * 1.85 * t + np.arange(3))
    z = truth + noise * np.random.default_rng(1).standard_normal((200, 6))[:, :3]
    terms = {f'gauss_markov{k}': {'sigma': sigma, 'tc': tc} for k, sigma, tc in (
        ('', 3.2e-5, 1.0), ('.2', 2.8e-5, 7.7), ('.3', 2.9e-5, 60.0), ('.4', 2.8e-5, 460.0),
        ('.5', 3.2e-5, 3600.0))}
    chosen = design(noise=('white', *terms), values={'white': {'R': noise ** 2}, **terms})
    got = filter_record(t[:, 0], z, chosen, 200.0, smooth=True)
    assert np.sqrt(np.mean((got.rate - truth) ** 2)) < noise
    assert (got.variance > 0).all() and (got.variance < 1.5 * noise ** 2).all()


@pytest.mark.thorough
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
def test_a_delay_lies_between_the_filter_and_the_smoother():
    t, z, truth = turning(1200, seed=8)
    chosen = design(values=KNOWN)
    causal = filter_record(t, z, chosen, 100.0)
    both = filter_record(t, z, chosen, 100.0, smooth=True)
    whole = filter_record(t, z, chosen, 100.0, delay=100.0)
    assert np.abs(whole.rate - both.rate).max() < 1e-9 * SIGMA
    assert np.allclose(whole.variance, both.variance, rtol=1e-9)
    some = [filter_record(t, z, chosen, 100.0, delay=d) for d in (0.05, 0.2)]
    rms = [np.sqrt(np.mean((f.rate - truth) ** 2)) for f in (causal, *some, both)]
    assert rms[0] > 1.05 * rms[1] > 1.05 ** 2 * rms[2] and rms[2] > rms[3], rms
    for got in some:
        assert np.array_equal(got.score, causal.score)
        assert np.mean(np.abs(got.rate - truth) < 1.96 * np.sqrt(got.variance)) > 0.9
        assert np.median(got.variance[50:] / causal.variance[50:]) < 0.95


@pytest.mark.parametrize('later', [{'smooth': True}, seldom({'delay': 0.1})])
def test_outliers_count_for_little_on_the_way_back_too(later):
    t, z, truth = turning(700, seed=11)
    z[[150, 350, 550]] += 30 * SIGMA
    values = {**KNOWN, 'outliers': {'fraction': 0.01, 'factor': 900.0}}
    got = filter_record(t, z, design(noise=('white', 'outliers'), values=values), 100.0, **later)
    assert np.abs(got.rate - truth)[30:].max() < 2.5 * SIGMA


def test_a_window_of_no_length_is_the_filter():
    t, z, _ = turning(300)
    engine = Engine(rate_hz=100.0, values=KNOWN)
    window = None
    for stamp, sample in zip(t, z):
        rate, variance = engine.step(stamp, sample)
        window = window or Window(engine._bank, 0)
        now, var = window.add(sample, engine._now)
        assert np.allclose(now, rate, rtol=0, atol=1e-12) and np.allclose(var, variance)


@pytest.mark.thorough
def test_live_and_recorded_wait_alike():
    """A message lost, two of one stamp, a copy: every message comes once, in order."""
    t, z, _ = turning(700, seed=9)
    t[400:] += 0.01
    t[500] = t[499]
    t[600], z[600] = t[599], z[599]
    engine = Engine(rate_hz=100.0, values=KNOWN, delay=0.1)
    out, late = [], []
    for k, (stamp, sample) in enumerate(zip(t, z)):
        engine.step(stamp, sample)
        due = engine.due()
        late += [k - len(out) - i for i in range(len(due))]
        out += due
    assert max(late) == 11 and np.median(late) == 10     # one more behind the copy
    engine.finish()
    out += engine.due()
    got = filter_record(t, z, design(values=KNOWN), 100.0, delay=0.1)
    assert len(out) == len(z)
    assert np.abs(np.array([x for x, _ in out]) - got.rate).max() < 1e-9 * SIGMA
    assert np.allclose([v for _, v in out], got.variance, rtol=1e-9)


@pytest.mark.thorough
@pytest.mark.parametrize('event', ['gap', 'backward', 'switch', 'no delay'])
def test_nothing_waits_over_a_gap_or_another_model(event):
    t, z, truth = turning(700, seed=10)
    engine = Engine(values=KNOWN, delay=0.1)
    out = []
    for k, (stamp, sample) in enumerate(zip(t, z)):
        if k == 500 and event == 'switch':
            engine.switch(values={'white': {'R': 1.5 * SIGMA ** 2}})
        if k == 500 and event == 'no delay':
            engine.switch(delay=0.0)
        after = {'gap': 5.0, 'backward': -5.0}.get(event, 0.0) if k >= 500 else 0.0
        out += engine.due()
        engine.step(stamp + after, sample)
        out += engine.due()
        if k == 500:
            assert len(out) == (501 if event == 'no delay' else 500)
    engine.finish()
    out += engine.due()
    assert len(out) == len(z)
    assert np.sqrt(np.mean((np.array([x for x, _ in out]) - truth) ** 2)) < 0.3 * SIGMA


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


def test_answers_that_are_no_numbers_are_no_answers(monkeypatch):
    def spoilt(z, *_):
        return np.where(np.arange(len(z))[:, None] == 7, np.nan, z), z, z

    t, z, _ = turning(100)
    monkeypatch.setattr(recorded, 'smooth_chunks', spoilt)
    with pytest.raises(FitError, match='no numbers'):
        filter_record(t, z, design(values=KNOWN), smooth=True)


def test_a_delay_that_is_none_is_refused():
    for delay, smooth in ((-1.0, False), (float('nan'), False), (0.1, True)):
        with pytest.raises(UsageError, match='delay'):
            filter_record(np.arange(100) / 100, np.zeros((100, 3)), design(values=KNOWN), 100.0,
                          smooth=smooth, delay=delay)
    with pytest.raises(UsageError, match='no fading memory'):
        Engine(alpha=0.9, delay=0.1)


def test_a_fading_memory_is_refused():
    t, z, _ = turning(100)
    with pytest.raises(UsageError, match='fading'):
        filter_record(t, z, design(alpha=0.7), smooth=True)


@pytest.mark.thorough
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
