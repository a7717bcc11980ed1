# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Records: rest and motion, what is examined, and what is prepared for an analysis."""

from __future__ import annotations

from dataclasses import replace

import bad_input
import numpy as np
from params import daily
import pytest

from imu_noise_tools.bag import open_record
from imu_noise_tools.core.clock import fit_clock, regular_rate
from imu_noise_tools.core.errors import InputError, UsageError
from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.health import (examine, prepare, resolution,
                                    still_stretches)


DEG = np.pi / 180


def record_of(seconds=200.0, rate=100.0, gyro_n=1e-3, accel_n=5e-3, seed=1, **more) -> ImuRecord:
    """Return white noise about a bias and gravity; densities in SI."""
    rng = np.random.default_rng(seed)
    n = round(seconds * rate)
    return ImuRecord(
        gyro=gyro_n * np.sqrt(rate) * rng.standard_normal((n, 3)) + [0.01, -0.02, 0.005],
        accel=accel_n * np.sqrt(rate) * rng.standard_normal((n, 3)) + [0.1, -0.2, 9.81],
        t=np.arange(n) / rate, rate_hz=rate, **more)


def with_gyro(record, change) -> ImuRecord:
    """Return the record with something added to its rates; change(t) gives (n, 3) or (n,)."""
    more = np.asarray(change(record.t), float)
    return replace(
        record, gyro=record.gyro + (more[:, None] * [1.0, 0.3, 0.0] if more.ndim == 1 else more)
    )


# -- the record itself

def test_columns_and_parts():
    """Axes are found by name; a part is a view; a stuck axis is no axis."""
    r = record_of(20, covariates={'temperature': np.arange(2000.0)})
    assert (
        np.shares_memory(r.part(5, 50).gyro, r.gyro)
        and r.part(5, 50).covariates['temperature'][0] == 5
    )
    assert r.column('accel_z') is not None and r.n == 2000 and r.duration_s == pytest.approx(19.99)
    assert replace(r, stuck=('gyro_x',)).axes == (
        'gyro_y',
        'gyro_z',
        'accel_x',
        'accel_y',
        'accel_z',
    )
    with pytest.raises(UsageError, match='choose from gyro_x'):
        r.column('gyro_w')
    with pytest.raises(UsageError, match='it has'):
        replace(r, gyro=None).column('gyro_x')
    assert r.warned('a', 'b').warned('a').warnings == ('a', 'b')


@pytest.mark.parametrize('rate', [30.0, 100.0, 285.7142857])
@pytest.mark.parametrize('seed', range(5))
def test_regular_rate(rate, seed):
    """The rate survives coarse stamps, jitter, bursts and gaps."""
    rng = np.random.default_rng(seed)
    t = np.arange(5000) / rate
    assert regular_rate(np.round(t, 3)) == pytest.approx(rate, rel=1e-3)
    assert regular_rate(t + 0.3 / rate * rng.standard_normal(5000)) == pytest.approx(
        rate, rel=1e-3
    )
    bursts = np.floor(np.arange(5000) / 10) * 10 / rate + (np.arange(5000) % 10) * 1e-4
    assert regular_rate(bursts) == pytest.approx(rate, rel=1e-3)
    t[3000:] += 500
    assert regular_rate(t) == pytest.approx(rate, rel=1e-9)
    assert regular_rate(np.zeros(50)) is None and regular_rate(t[:1]) is None


# -- rest

GRADES = {
    'tactical': (5e-6, 3e-4),
    'mems': (1e-4, 2e-3),
    'cheap': (1e-3, 1e-2),
    'poor': (3e-3, 3e-2),
}


@pytest.mark.parametrize('grade', GRADES)
@pytest.mark.parametrize('rate', [20.0, 100.0, 1000.0])
def test_rest_of_any_grade(grade, rate):
    """A sensor at rest is at rest, whatever its noise and rate, to the last sample."""
    gyro_n, accel_n = GRADES[grade]
    for seed in range(5):
        r = record_of(100 if rate < 1000 else 30, rate, gyro_n, accel_n, seed)
        assert still_stretches(r) == [(0, r.n)]
        assert prepare(r).n == r.n


def still_effects():
    """Yield what is not motion: name and addition to a rate of 1e-3 rad/s/sqrt(Hz) at 100 Hz."""
    rng = np.random.default_rng(0)
    yield 'vibration', lambda t: 0.5 * np.sin(2 * np.pi * 27.3 * t)
    yield 'a fan that starts', lambda t: 0.3 * np.sin(2 * np.pi * 21.7 * t) * (t > 80)
    yield 'slow drift', lambda t: 0.02 * (t / 200) ** 2
    yield 'temperature', lambda t: 0.03 * np.exp(-t / 60)
    yield 'random walk', lambda t: np.cumsum(rng.standard_normal(len(t))) * 3e-5
    yield 'sway of the bench', lambda t: 2e-3 * np.sin(2 * np.pi * 0.3 * t)
    yield 'a step of the bias', lambda t: 5e-3 * (t > 100)
    yield 'popcorn', lambda t: 4e-3 * ((t % 20) < 7)
    yield 'spikes', lambda t: 0.3 * (rng.random(len(t)) < 5e-4) * rng.standard_normal(len(t))
    yield 'louder later', lambda t: 1e-2 * rng.standard_normal(len(t)) * 2 * (t > 120)


@pytest.mark.parametrize(
    'name, effect', list(still_effects()), ids=lambda x: x if isinstance(x, str) else ''
)
def test_disturbed_rest_is_rest(name, effect):
    """Vibration, drift, steps of the bias, outliers and the like are analysed, not cut away."""
    r = with_gyro(record_of(), effect)
    found = prepare(r)
    assert found.n == r.n and found.left_out == ()


@pytest.mark.parametrize('lsb', [1e-3, 5e-3, 0.05 * DEG, 0.5 * DEG])
def test_quantised_rest(lsb):
    """A coarse output that hardly ever changes is at rest."""
    r = record_of(gyro_n=1e-4)
    r = replace(r, gyro=np.round(r.gyro / lsb) * lsb, accel=np.round(r.accel / 0.04) * 0.04)
    assert still_stretches(r) == [(0, r.n)]


def turned(record, begin, angle_deg, seconds=1.0) -> ImuRecord:
    """Return the record with a turn about x within some seconds."""
    dt = record.dt
    profile = np.clip((record.t - begin) / seconds, 0, 1)
    angle = angle_deg * DEG * (profile - np.sin(2 * np.pi * profile) / (2 * np.pi))
    g = np.stack([0 * angle, 9.81 * np.sin(angle), 9.81 * np.cos(angle)], axis=1)
    return replace(with_gyro(record, lambda t: np.outer(np.gradient(angle, dt), [1, 0, 0])),
                   accel=record.accel - [0, 0, 9.81] + g)


@pytest.mark.parametrize('grade', ['tactical', 'mems', 'cheap'])
@pytest.mark.parametrize('angle', daily([5.0, 30.0, 90.0, 180.0], 5.0, 180.0))
def test_a_turn_is_motion(grade, angle):
    """A step of orientation parts two rests, for any grade; the longer one is analysed."""
    r = turned(record_of(200, 100, *GRADES[grade], seed=3), 70.0, angle)
    first, second = still_stretches(r)
    assert first[0] == 0 and 66 < r.t[first[1] - 1] <= 70.6
    assert 70.4 <= r.t[second[0]] < 74 and second[1] == r.n
    found = prepare(r)
    assert found.n == second[1] - second[0]
    assert any('moves' in w and 'still' in w for w in found.warnings)
    assert prepare(r, keep_motion=True).n == r.n


def test_rocking_and_handling_are_motion():
    """A record that moves all the time has no rest, whatever it does."""
    rng = np.random.default_rng(0)
    for swing in (
        lambda t: 0.3 * np.sin(2 * np.pi * 0.1 * t),
        lambda t: 2 * np.sin(2 * np.pi * 1.3 * t),
        lambda t: np.convolve(rng.standard_normal(len(t)), np.hanning(80) / 5, 'same'),
    ):
        r = with_gyro(record_of(), swing)
        assert max((b - a for a, b in still_stretches(r)), default=0) < 5 * r.rate_hz
        with pytest.raises(InputError, match='still stretch is .* s, under 60 s at rest'):
            prepare(r)


def test_a_turntable_is_motion():
    """A steady rate that is not that of the rest is a turn."""
    r = with_gyro(record_of(), lambda t: np.outer(0.5 * ((t > 60) & (t < 130)), [0, 0, 1]))
    kept = np.concatenate([np.arange(a, b) for a, b in still_stretches(r)])
    assert not np.any((r.t[kept] > 61) & (r.t[kept] < 129)) and len(kept) > 0.6 * r.n


def test_a_shock_is_set_aside():
    """A knock, after which all is as before, does not part the record; it is marked."""
    r = with_gyro(record_of(), lambda t: 3 * np.exp(-((t - 90) / 0.2) ** 2) * np.sin(9 * (t - 90)))
    found = prepare(r)
    assert found.n == r.n and len(found.left_out) == 1
    begin, end, why = found.left_out[0]
    assert why == 'shock' and 86 < begin < 90 < end < 94
    # the rest that health tells of is that which is analysed
    health = examine(r)
    assert len(health.still) == 2 and health.longest_still_s == pytest.approx(r.duration_s)


def test_rest_on_real_records(shared_data):
    """Real recordings rest where it is known that they do, and nowhere else."""
    def stretches(name):
        record = open_record(next((shared_data).glob(f'*/{name}')))
        return record, still_stretches(record)
    for name in ('mpu6050_static_449s.npz', 'mpu6050_static_100s.npz', 'amr_imu_static_mcap'):
        record, found = stretches(name)
        assert found == [(0, record.n)]
    assert len(stretches('xsens_mti_multipos')[1]) == 38
    assert 18 <= len(stretches('mpu9150_0_multipos.npz')[1]) <= 22
    assert len(stretches('imucal_ferraris')[1]) >= 6
    record, found = stretches('px4_auavx21.npz')
    assert len(found) == 1 and 5 < record.t[found[0][0]] < 9 and found[0][1] == record.n
    for name in ('broad_01*.npz', 'broad_10*.npz', 'broad_24*.npz'):
        path = next(shared_data.glob(f'records/{name}'))
        record = open_record(path)
        with np.load(path) as arrays:
            moves = arrays['movement']
        rest = np.zeros(record.n, bool)
        for a, b in still_stretches(record):
            rest[a:b] = True
        assert (rest & moves).mean() < 0.02, 'motion is taken for rest'
        assert (rest & ~moves).sum() > 0.6 * (~moves).sum()
    record, found = stretches('yei_jitter_motion.npz')
    assert sum(b - a for a, b in found) < 0.1 * record.n


@pytest.mark.parametrize(
    'name', ['imu_tools_phidgets_imu_upside_down.bag', 'robot_localization_test1.bag']
)
def test_moving_bags_are_refused(shared_data, name):
    """A bag of a moving robot without a minute of rest is refused, with advice on recording."""
    with pytest.raises(InputError, match='moves.*60 s at rest.*record it still.*--keep-motion'):
        prepare(open_record(shared_data / 'bags' / name))


@pytest.mark.parametrize('name', ['adis16405_run2', 'adis16405_run6'])
def test_long_records_are_used_whole(shared_data, name):
    """A million samples of a tactical unit are all used."""
    assert prepare(open_record(shared_data / 'records' / f'{name}.npz')).n == 1_000_000


# -- stamps

def test_rate_is_that_of_the_stretch():
    """The rate is (n - 1)/span of what is analysed."""
    r = record_of()
    r = replace(r, t=r.t * 1.003)
    assert prepare(r).rate_hz == pytest.approx((r.n - 1) / (r.t[-1] - r.t[0]), rel=1e-12)


def test_lateness_is_not_loss():
    """A stamp that is late is no loss; a loss shifts all that follow."""
    t = np.arange(1000) * 0.01
    late = t.copy()
    late[500] += 0.008
    assert fit_clock(late).missing == 0
    lost = np.delete(t, np.r_[300:305, 600])
    found = fit_clock(lost)
    assert found.gaps.tolist() == [299, 594] and found.lost.tolist() == [5, 1]


@pytest.mark.parametrize('jitter', [0.0, 0.1])
def test_dropouts_are_filled(jitter):
    """Lost samples are interpolated on the regular grid, and counted."""
    r = record_of()
    keep = np.delete(np.arange(r.n), np.r_[3000:3020, 9000:9005])
    rng = np.random.default_rng(1)
    lost = replace(
        r,
        t=r.t[keep] + jitter * r.dt * rng.uniform(-1, 1, len(keep)),
        gyro=r.gyro[keep],
        accel=r.accel[keep],
    )
    found = prepare(lost)
    assert found.n == r.n and found.missing == 25
    np.testing.assert_array_equal(found.gyro[:3000], r.gyro[:3000])
    np.testing.assert_array_equal(found.gyro[9005:], r.gyro[9005:])
    np.testing.assert_allclose(
        found.gyro[3009], r.gyro[2999] + (r.gyro[3020] - r.gyro[2999]) * 10 / 21
    )
    assert any('25 sample(s) lost in 2' in w for w in found.warnings)


def test_clock_set_back():
    """Where a clock is set back, the samples keep their order and go on."""
    r = record_of()
    t = r.t.copy()
    t[12000:] -= 50
    found = prepare(replace(r, t=t))
    np.testing.assert_array_equal(found.gyro, r.gyro)
    assert found.rate_hz == pytest.approx(100, rel=1e-4)


def test_messages_in_the_wrong_order():
    """Samples that came in another order than they were taken are put right."""
    r = record_of()
    order = np.arange(r.n)
    order[[100, 101]] = [101, 100]
    order[[7000, 7001, 7002]] = [7002, 7000, 7001]
    found = prepare(replace(r, t=r.t[order], gyro=r.gyro[order], accel=r.accel[order]))
    np.testing.assert_array_equal(found.gyro, r.gyro)


def test_label_and_receive_time_are_checked():
    """
    Another rate in the label, or another clock at the receiver, is said.

    The stamps are used.

    """
    r = record_of(labelled_rate_hz=200.0)
    r = replace(r, receive_t=1.05 * r.t)
    said = '\n'.join(prepare(r).warnings)
    assert 'the file says 200 Hz' in said and 'receive times' in said
    assert prepare(r).rate_hz == pytest.approx(100)


def test_longest_stretch_between_gaps():
    """The longest stretch without a long gap is analysed."""
    r = record_of(300)
    t = r.t.copy()
    t[8000:] += 100
    t[25000:] += 100
    found = prepare(replace(r, t=t))
    assert found.n == 17000
    np.testing.assert_array_equal(found.gyro, r.gyro[8000:25000])


# -- health

def test_health_of_a_good_record():
    """A good record has nothing wrong, and the numbers are right."""
    h = examine(replace(record_of(), receive_t=record_of().t * (1 + 2e-4)))
    assert (h.samples, h.gaps, h.duplicates, h.backward, h.not_finite, h.moving) == (
        20000,
        0,
        0,
        0,
        0,
        0,
    )
    assert h.rate_hz == pytest.approx(100) == h.median_rate_hz
    assert h.clock_drift_ppm == pytest.approx(-200, rel=0.05) and h.clock_drift_std_ppm < 1e-3
    assert h.receive_rate_hz == pytest.approx(99.98, rel=1e-4)
    assert (
        h.gravity == pytest.approx(9.81, abs=0.02)
        and h.units == ()
        and h.stuck == ()
        and h.saturated == {}
    )
    assert h.longest_still_s == pytest.approx(199.99)
    assert not any('warm' in a for a in h.advice)


def test_health_names_what_is_wrong():
    """Stuck, clipped, coarse, held, hot and drifting: each is seen and has its advice."""
    r = record_of(covariates={'temperature': np.linspace(20, 45, 20000)})
    gyro, accel = r.gyro.copy(), r.accel.copy()
    gyro[:, 0] = 0.25
    swing = 40 * np.sin(2 * np.pi * 0.2 * r.t)
    accel[:, 1] = np.clip(accel[:, 1] + swing, -20, 20)
    gyro[:, 2] = np.round((gyro[:, 2] + 0.3 * np.exp(-r.t / 20)) / 0.002) * 0.002
    h = examine(replace(r, gyro=gyro, accel=accel))
    assert h.stuck == ('gyro_x',) and set(h.saturated) == {'accel_y'}
    assert h.resolution['gyro_z'].step == pytest.approx(0.002, rel=1e-3)
    assert h.resolution['gyro_y'].step is None
    assert h.temperature == {'temperature': (20.0, 45.0)}
    said = '\n'.join(h.advice)
    for words in (
        'gyro_x never changes',
        'accel_y stands at the end',
        'moves',
        'from 20 to 45 degrees',
    ):
        assert words in said
    warm = replace(r, gyro=r.gyro + 0.01 * np.exp(-r.t / 20)[:, None])
    assert 'gyro_x' in examine(warm).warm_up
    held = np.repeat(np.arange(0, r.n, 4), 4)
    assert examine(replace(r, gyro=r.gyro[held], accel=r.accel[held])).held == pytest.approx(
        0.75, abs=0.01
    )


def test_health_never_refuses():
    """Whatever a record holds, it can be examined."""
    r = record_of(20)
    for bad in (
        r.part(0, 0),
        r.part(0, 1),
        r.part(0, 3),
        replace(r, t=np.zeros(r.n)),
        replace(r, gyro=None),
        replace(r, accel=np.full((r.n, 3), np.nan)),
        replace(r, t=np.full(r.n, np.nan)),
        replace(r, gyro=np.zeros((r.n, 3)), accel=None),
    ):
        assert examine(bad).samples == bad.n


@pytest.mark.parametrize('seed', daily(range(20), *range(5)))
def test_clipping_is_not_seen_where_there_is_none(seed):
    """Noise, coarse or fine, is not taken for clipping."""
    r = record_of(seed=seed)
    for lsb in (1e-9, 2e-3, 1e-2, 5e-2):
        assert examine(replace(r, gyro=np.round(r.gyro / lsb) * lsb)).saturated == {}


def test_resolution_of_real_sensors(shared_data):
    """The steps are those of the data sheets and of the raw counts."""
    record = open_record(shared_data / 'records' / 'mpu6050_static_449s.npz')
    assert resolution(record.gyro[:, 0]).step == pytest.approx(DEG / 131, rel=1e-4)
    assert resolution(record.accel[:, 2]).step == pytest.approx(9.80665 / 16384 * 4, rel=1e-3)
    record = open_record(shared_data / 'records' / 'adis16405_run2.npz')
    assert resolution(record.gyro[:, 1]).step == pytest.approx(0.05 * DEG, rel=1e-3)


@pytest.mark.parametrize('name', bad_input.opening())
def test_every_bad_input_that_opens_can_be_examined(name, tmp_path):
    """Inspection never fails on what analysis refuses."""
    health = examine(open_record(bad_input.make_one(name, tmp_path).path))
    assert all(line.endswith('.') and '\n' not in line for line in health.advice)


def test_units_are_judged_at_rest_only():
    """Where nothing rests, the mean acceleration says nothing about its unit."""
    r = with_gyro(record_of(), lambda t: 2 * np.sin(2 * np.pi * 0.3 * t))
    r = replace(r, accel=r.accel * np.sin(2 * np.pi * 0.3 * r.t)[:, None])
    assert not any('unit' in w for w in prepare(r, keep_motion=True).warnings)
    assert examine(r).units == () and examine(r).gravity is None
