# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The engine: the same numbers live and recorded, every flaw of a stream, switching, speed, and
errors in motion.

"""

from __future__ import annotations

import numpy as np
from params import seldom
import pytest

from imu_noise_tools.core.errors import InputError, UsageError
from imu_noise_tools.core.units import DEG
from imu_noise_tools.filter.design import AUTO, design, quiet_variance
from imu_noise_tools.filter.engine import Engine, WAIT
from imu_noise_tools.filter.recorded import filter_record
from imu_noise_tools.filter.stamps import Clock, DUPLICATE, RESTART
from imu_noise_tools.loop.effect import Model

SIGMA = 0.6 * DEG
KNOWN = {'white': {'R': SIGMA ** 2}}
SEED = ('constant_rate', 'ar_increment')
SETTINGS = {
    'auto': {},
    'seed': {'motion': SEED},
    'fading': {'motion': SEED, 'alpha': 0.7},
    'colour': {
        'motion': ('constant_rate', 'angular_acceleration'),
        'noise': ('white', 'gauss_markov'),
    },
    'robust': {'noise': ('white', 'outliers')},
    'uneven': {'noise': ('white', 'sampling_jitter')},
    'steps': {'motion': ('constant_rate', 'ar_increment', 'rate_step')},
    'vibration': {'noise': ('white', 'sinusoid')},
}


def rms(error):
    """Return the root mean square of errors (n, ...) over the first axis, NaN left out."""
    return np.sqrt(np.nanmean(np.square(error), axis=0))


def rocking(n, rate=100.0, amplitude=50.0, seed=0):
    """
    Return stamps, noisy rates (n, 3) and true ones: rocking at a period of 10 s, amplitudes by
    axis.

    """
    t = np.arange(n) / rate
    w = 2 * np.pi / 10
    truth = DEG * w * amplitude * np.sin(w * t)[:, None] * np.array([1.0, 0.3, 0.0])
    return t, truth + SIGMA * np.random.default_rng(seed).standard_normal((n, 3)), truth


def live(engine, t, z):
    """Return rates and variances (n, 3); NaN where refused."""
    out = np.full((2, len(t), 3), np.nan)
    for k in range(len(t)):
        answer = engine.step(t[k], z[k])
        if answer is not None:
            out[:, k] = answer
    return out


@pytest.mark.parametrize('name', sorted(SETTINGS))
def test_live_and_recorded_give_the_same_numbers_on_a_bad_stream(name):
    t, z, _ = rocking(1500)
    rng = np.random.default_rng(1)
    t = t + 1e-4 * rng.standard_normal(len(t))
    t[400:] += 0.01                                  # a message lost
    t[700:] += 5.0                                   # a gap
    t[900] = t[899]                                  # the same stamp, another sample
    t[950], z[950] = t[949], z[949]                  # a copy
    t[1100:] -= 60.0                                 # backward
    z[500, 1] = np.nan
    settings = SETTINGS[name]
    engine = Engine(values=KNOWN, rate_hz=100.0, **settings)
    rate, variance = live(engine, t, z)
    got = filter_record(t, z, design(values=KNOWN, **settings), 100.0)
    assert np.array_equal(np.isnan(rate), np.isnan(got.rate))
    assert np.nanmax(np.abs(rate - got.rate)) < 1e-5 * SIGMA
    assert np.nanmax(np.abs(variance / got.variance - 1)) < 1e-4
    c = engine.counts
    assert (c.samples, c.refused, c.duplicates, c.gaps, c.resets) == (1499, 1, 2, 1, 1)
    assert got.counts == {'samples': 1500, 'refused': 1, 'duplicates': 2, 'restarts': 2}


@pytest.mark.parametrize('name', [pytest.param('auto', marks=pytest.mark.thorough), 'seed'])
def test_chunks_and_steady_state_are_the_recursion(name):
    t, z, _ = rocking(60000, seed=2)
    chosen = design(values=KNOWN, **SETTINGS[name])
    whole = filter_record(t, z, chosen, 100.0)
    engine = Engine(values=KNOWN, rate_hz=100.0, **SETTINGS[name])
    rate, variance = live(engine, t[:40000], z[:40000])
    assert np.abs(rate - whole.rate[:40000]).max() < 1e-3 * SIGMA
    assert np.abs(variance / whole.variance[:40000] - 1).max() < 0.01


def test_refuses_what_is_not_finite_and_counts_it():
    t, z, _ = rocking(300)
    engine = Engine(values=KNOWN, rate_hz=100.0)
    clean = Engine(values=KNOWN, rate_hz=100.0)
    for k in range(300):
        if k == 100:
            before = engine.step(t[k] - 0.005, [np.nan, 0, 0])
            assert before is None and engine.step(np.inf, z[k]) is None
            assert engine.step(t[k] - 0.002, [0, np.inf, 0]) is None
        a, b = engine.step(t[k], z[k]), clean.step(t[k], z[k])
        assert np.array_equal(a[0], b[0])
    assert engine.counts.refused == 3 and engine.counts.samples == 300


def test_a_gap_and_a_jump_backward_start_again():
    t, z, _ = rocking(600)
    for shift in (30.0, -30.0):
        late = t.copy()
        late[300:] += shift
        engine = Engine(motion=SEED, values=KNOWN, rate_hz=100.0)
        rate, variance = live(engine, late, z)
        fresh, _ = live(Engine(motion=SEED, values=KNOWN, rate_hz=100.0), t[300:], z[300:])
        assert np.allclose(rate[300:], fresh, atol=1e-12)
        assert np.allclose(variance[300], SIGMA ** 2, rtol=1e-3)
        assert (engine.counts.gaps, engine.counts.resets) == ((1, 0) if shift > 0 else (0, 1))


def test_a_duplicate_stamp_is_weighed_without_prediction_and_a_copy_not_at_all():
    t, z, _ = rocking(200)
    engine = Engine(motion=SEED, values=KNOWN, rate_hz=100.0)
    live(engine, t, z)
    last, variance = engine.step(t[-1], z[-1])
    again, same = engine.step(t[-1], z[-1])
    assert np.array_equal(last, again) and np.array_equal(variance, same)
    moved, smaller = engine.step(t[-1], z[-1] + SIGMA)
    assert np.all(moved > again) and np.all(smaller < same)
    assert engine.counts.duplicates == 3


@pytest.mark.parametrize('blow', [1.0, 60.0])
def test_a_blow_and_another_sample_at_its_stamp_are_survived(blow):
    """The blow rules the mode at rest out to the last digit; no time passes to let it back in."""
    t, z, _ = rocking(300, amplitude=0.0)
    z[200:202] += blow
    t[201:203] = t[200]
    rate, variance = live(Engine(values=KNOWN, rate_hz=100.0), t, z)
    assert np.isfinite(rate).all() and np.all(variance > 0)
    assert np.abs(rate[-1]).max() < SIGMA
    assert np.isfinite(filter_record(t, z, design(values=KNOWN), 100.0).rate).all()


def test_a_change_of_rate_in_mid_stream_is_followed():
    dt = np.r_[np.full(1000, 0.01), np.full(1000, 0.02), np.full(2000, 0.005)]
    t = np.cumsum(dt)
    w = 2 * np.pi / 10
    truth = (DEG * 50 * w * np.sin(w * t))[:, None] * np.ones(3)
    z = truth + SIGMA * np.random.default_rng(3).standard_normal(truth.shape)
    engine = Engine(values=KNOWN, rate_hz=100.0)
    rate, _ = live(engine, t, z)
    error = rms(rate - truth)
    for part in (slice(500, 1000), slice(1200, 2000), slice(2500, 4000)):
        assert np.all(rms((rate - truth)[part]) < 0.6 * SIGMA), error
    assert engine.counts.gaps == engine.counts.resets == 0


@pytest.mark.thorough
def test_stamps_far_from_zero_and_jittered_change_nothing():
    t, z, truth = rocking(2000)
    a, _ = live(Engine(values=KNOWN, rate_hz=100.0), t, z)
    b, _ = live(Engine(values=KNOWN, rate_hz=100.0), t + 1.7e9, z)
    assert np.abs(a - b).max() < 1e-9
    jitter = t + 2e-3 * np.random.default_rng(4).standard_normal(len(t))
    c, _ = live(Engine(values=KNOWN, rate_hz=100.0), np.maximum.accumulate(jitter), z)
    assert np.all(rms((c - truth)[500:]) < 1.15 * rms((a - truth)[500:]))


def test_rate_and_noise_are_read_from_the_samples_where_nobody_states_them():
    t, z, truth = rocking(3000, rate=200.0)
    engine = Engine()
    first = [engine.step(t[k], z[k]) for k in range(WAIT - 1)]
    assert all(
        np.array_equal(a[0], z[k]) and not a[1].any() for k, a in enumerate(first)
    )  # 0: not known yet
    rate, variance = live(engine, t[WAIT - 1:], z[WAIT - 1:])
    assert engine.rate_hz == pytest.approx(200.0, rel=0.01)
    r = np.array([m['white']['R'] for m in engine.design.noise])
    assert np.all(np.abs(np.sqrt(r) / SIGMA - 1) < 0.15)
    assert np.all(rms((rate - truth[WAIT - 1:])[1000:]) < 0.5 * SIGMA) and np.all(
        variance > 0
    )


@pytest.mark.parametrize('amplitude', [0.0, 15.0, 500.0])
def test_noise_is_read_right_at_rest_and_in_motion(amplitude):
    _, z, _ = rocking(20000, amplitude=amplitude)
    z[::500] += 50 * SIGMA                                   # knocks do not count
    assert np.all(np.abs(np.sqrt(quiet_variance(z)) / SIGMA - 1) < 0.06)


def test_a_constant_or_coarse_output_has_some_noise():
    assert np.all(quiet_variance(np.full((1000, 3), 0.2)) > 0)
    coarse = np.zeros((1000, 1))
    coarse[::50] = 1e-3
    assert 0 < quiet_variance(coarse)[0] < 1e-6
    rate, variance = live(Engine(), np.arange(100) / 100, np.full((100, 3), 0.2))
    assert np.allclose(rate, 0.2, atol=1e-6) and np.isfinite(variance).all()


SWITCHES = [
    seldom({'motion': AUTO}),
    {'motion': ('constant_rate', 'angular_acceleration')},
    {'alpha': 0.7},
    {'noise': ('white', 'gauss_markov')},
    {'motion': AUTO, 'noise': ('white', 'outliers')},
    seldom({'motion': AUTO, 'noise': ('white', 'sampling_jitter')}),
]


@pytest.mark.parametrize('change', SWITCHES, ids=str)
def test_switching_while_it_runs_makes_no_jump(change):
    t, z, truth = rocking(2000, amplitude=150.0)
    engine = Engine(motion=SEED, values=KNOWN, rate_hz=100.0)  # lags far behind: the hardest case
    before, _ = live(engine, t[:1000], z[:1000])
    usual = np.abs(np.diff(before[500:], axis=0)).max()
    engine.switch(**change)
    after, variance = live(engine, t[1000:], z[1000:])
    jump = np.abs(after[0] - before[-1])
    lag = np.abs(before[-1] - truth[999])
    assert np.all(jump < 2 * usual + 0.05 * lag)  # a quarter of a second for the whole lag
    settled, _ = live(
        Engine(**{'motion': SEED, 'values': KNOWN, 'rate_hz': 100.0, **change}), t, z
    )
    assert np.abs(after[600:] - settled[1600:]).max() < 0.2 * SIGMA
    assert np.all(variance > 0) and engine.counts.switches == 1


def test_a_switch_to_nonsense_is_refused_and_changes_nothing():
    t, z, _ = rocking(300)
    engine, other = (Engine(values=KNOWN, rate_hz=100.0) for _ in range(2))
    for bad in (
        {'alpha': -3.0},
        {'alpha': 1.5},
        {'alpha': float('nan')},
        {'motion': 'no_such_motion'},
        {'motion': ()},
        {'noise': ('angular_acceleration',)},
        {'motion': ('white',)},
        {'motion': ('rate_step',)},
        {'motion': ('constant_rate', 'constant_rate')},
    ):
        with pytest.raises(UsageError) as caught:
            engine.switch(**bad)
        assert caught.value.remedy
    assert np.array_equal(live(engine, t, z), live(other, t, z)) and engine.counts.switches == 0


def test_reset_forgets_the_stream():
    t, z, _ = rocking(200)
    engine = Engine(values=KNOWN, rate_hz=100.0)
    first = live(engine, t, z)
    engine.reset()
    assert engine.counts.samples == 0 and engine.history.count == 0
    assert np.array_equal(first, live(engine, t, z))


def test_history_is_a_ring_of_the_latest():
    t, z, _ = rocking(500)
    engine = Engine(values=KNOWN, rate_hz=100.0, history=128)
    live(engine, t, z)
    kept_t, kept, score = engine.history.latest()
    assert (
        np.array_equal(kept_t, t[-128:])
        and np.array_equal(kept, z[-128:])
        and np.isfinite(score).all()
    )
    assert len(engine.history.latest(10)[0]) == 10


def test_the_clock_sorts_intervals():
    clock = Clock.of(100.0)
    keys = clock.keys(np.array([0.01, 0.0101, 0.02, 0.0, -0.01, 5.0, 1e-7]))
    assert keys.tolist()[:1] == [0] and keys[1] == 0 and keys[3] == DUPLICATE
    assert keys[4] == keys[5] == RESTART and clock.span(int(keys[2])) == pytest.approx(
        0.02, rel=0.025
    )
    assert [clock.key(d) for d in (0.01, 0.0101, 0.02, 0.0, -0.01, 5.0, 1e-7)] == keys.tolist()
    assert Clock.of(1.0).gap == 10.0                        # a slow sensor is not all gaps


def test_values_by_axis_and_models_by_axis():
    t, z, _ = rocking(500, amplitude=0.0)
    z = z * np.array([1.0, 3.0, 10.0])
    each = [{'white': {'R': (k * SIGMA) ** 2}} for k in (1, 3, 10)]
    got = filter_record(t, z, design(values=each), 100.0)
    sigma = np.sqrt(got.variance[-1])
    assert 2 < sigma[1] / sigma[0] < 6 and 2 < sigma[2] / sigma[1] < 6
    models = [Model(m) for m in design(values=each).noise]
    assert np.array_equal(filter_record(t, z, design(noise=models), 100.0).rate, got.rate)


def test_too_little_or_no_time_is_said():
    t, z, _ = rocking(100)
    with pytest.raises(InputError, match='too few'):
        filter_record(t[:5], z[:5], design())
    with pytest.raises(InputError, match='never advance'):
        filter_record(np.zeros(100), z, design())


def test_outliers_pass_through_the_plain_filter_and_not_through_the_robust_one():
    t, z, truth = rocking(3000)
    hit = np.arange(500, 3000, 50)
    z[hit] += 20 * SIGMA
    plain, _ = live(Engine(values=KNOWN, rate_hz=100.0), t, z)
    robust, _ = live(Engine(values=KNOWN, rate_hz=100.0, noise=('white', 'outliers')), t, z)
    assert np.all(rms((robust - truth)[hit]) < 0.1 * rms((plain - truth)[hit]))


def test_a_vibration_line_is_taken_away_and_motion_is_not():
    t, z, truth = rocking(4000)
    z = z + 2 * DEG * np.sin(2 * np.pi * 20 * t)[:, None]
    line = {**KNOWN, 'sinusoid': {'amplitude': 2 * DEG, 'frequency': 20.0, 'tc': 1e3}}
    with_line, _ = live(Engine(values=line, rate_hz=100.0, noise=('white', 'sinusoid')), t, z)
    assert np.all(rms((with_line - truth)[1000:]) < 0.6 * SIGMA)


@pytest.mark.thorough
def test_variance_is_honest_in_every_motion():
    for amplitude in (0.0, 15.0, 150.0):
        t, z, truth = rocking(20000, amplitude=amplitude)
        got = filter_record(t, z, design(values=KNOWN), 100.0)
        ratio = np.mean((got.rate - truth)[1000:] ** 2, axis=0) / np.mean(
            got.variance[1000:], axis=0
        )
        assert np.all((ratio < 1.5) & (ratio > 0.02)), (amplitude, ratio)


def test_an_engine_says_what_it_does_not_know_yet():
    """Before it has read the rate, and after a reset, it has no rate."""
    engine = Engine()
    assert engine.rate_hz is None
    for k in range(WAIT + 1):
        engine.step(0.01 * k, 0.01 * np.sin(np.arange(3) + k))
    assert engine.rate_hz == pytest.approx(100)
    engine.reset()
    assert engine.rate_hz is None
