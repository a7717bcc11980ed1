# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The clock behind stamps, disturbed stretches, and the choice of a part of a record."""

from __future__ import annotations

from dataclasses import replace
import json

import bad_input
import numpy as np
from params import daily, seldom
import pytest
from scipy.signal import lfilter

from imu_noise_tools import store
from imu_noise_tools.bag import open_record, write_bag
from imu_noise_tools.cli.main import main
from imu_noise_tools.core.clock import fit_clock
from imu_noise_tools.core.errors import InputError, UsageError
from imu_noise_tools.core.record import ImuRecord, Memory
from imu_noise_tools.core.statistics import grid_step
from imu_noise_tools.core.units import G0
from imu_noise_tools.health import (
    examine, motion_doubts, prepare, resolution, Selection, still_stretches, unit_doubts)
from imu_noise_tools.health.examine import _warms_up
from imu_noise_tools.health.stamps import ordered
from imu_noise_tools.health.values import too_fast, wrong_units
from imu_noise_tools.plots.noise import left_out
from imu_noise_tools.tasks.filter import filter_samples
from imu_noise_tools.tasks.noise import analyse_record

SEEDS = range(3)


# -- stamps: one small mechanism a family; the 49 of bench/stamps.py are others

def read_late(t, period, parse=2e-4):
    """Return stamps given when a loop that wakes every so often empties a buffer."""
    turn = np.ceil(t / period)
    first = np.searchsorted(turn, turn)
    return np.maximum.accumulate(turn * period + parse * (np.arange(len(t)) - first))


FAMILIES = {
    'even': lambda t, rng: t,
    'jitter': lambda t, rng: np.maximum.accumulate(t + 1e-3 * rng.standard_normal(len(t))),
    'delays': lambda t, rng: np.maximum.accumulate(t + rng.exponential(1e-3, len(t))),
    'bursts': lambda t, rng: read_late(t, 0.053),
    'milliseconds': lambda t, rng: np.floor(1e3 * t) / 1e3,
    'ticks of 10 ms': lambda t, rng: np.floor(1e2 * t) / 1e2,
    'drift': lambda t, rng: t + 1e-6 * t * (t - t[-1]) + 1e-5 * rng.standard_normal(len(t)),
}


@pytest.mark.parametrize('name', FAMILIES)
@pytest.mark.parametrize('seed', SEEDS)
def test_stamps_without_losses(name, seed):
    """However stamps are put on, nothing is lost where nothing was, and the rate is right."""
    rng = np.random.default_rng(seed)
    rate = rng.uniform(110, 140)
    t = FAMILIES[name](np.arange(40_000) / rate, rng)
    found = fit_clock(t)
    assert found.missing == 0 and len(found.gaps) == 0
    assert found.rate_hz == pytest.approx(rate, rel=1e-5)


@pytest.mark.parametrize('name', FAMILIES)
@pytest.mark.parametrize('seed', SEEDS)
def test_losses_are_counted_in_any_stamps(name, seed):
    """Runs of 20 lost samples are counted exactly and lie where they were lost."""
    rng = np.random.default_rng([1, seed])
    rate = rng.uniform(110, 140)
    n = 40_000
    there = np.ones(n, bool)
    starts = np.array([7000, 18_000, 30_500]) + rng.integers(0, 2000, 3)
    for k in starts:
        there[k:k + 20] = False
    found = fit_clock(FAMILIES[name](np.arange(n)[there] / rate, rng))
    assert found.lost.tolist() == [20, 20, 20]
    assert np.max(np.abs(found.place(there.sum())[found.gaps] - (starts - 1))) <= 10
    assert found.rate_hz == pytest.approx(rate, rel=1e-5)


@pytest.mark.parametrize('name', FAMILIES)
def test_a_pause_beside_a_few_samples_is_seen(name):
    """A logger that writes some samples, pauses and goes on: no level of rough stamps shows it."""
    rng = np.random.default_rng(11)
    there = np.ones(8000, bool)
    there[16:2300] = there[5000:6000] = there[7000:7990] = False
    found = fit_clock(FAMILIES[name](np.arange(8000)[there] / 90.8, rng))
    np.testing.assert_allclose(found.lost, [2284, 1000, 990], atol=8)   # a burst is five
    np.testing.assert_allclose(found.gaps, [15, 2715, 3715], atol=8)
    assert len(found.pauses()) == 3 and not len(found.steps)


def test_runs_that_begin_anew_follow_each_other():
    """Runs one after the other in a file, each stamped from 0, are not sorted together."""
    t = np.tile(np.arange(700) / 200, 12)
    gyro = np.random.default_rng(12).standard_normal((len(t), 3))
    record = ordered(ImuRecord(gyro, None, t, None))
    np.testing.assert_array_equal(record.gyro, gyro)
    assert fit_clock(record.t).rate_hz == pytest.approx(200, rel=1e-6)
    assert record.warnings[0].startswith('11 backward stamps: the clock was set back')


@pytest.mark.parametrize('share', [0.001, 0.01, 0.1])
def test_single_losses_keep_their_place(share):
    """Lone lost samples are interpolated at their place: the others stay where they were."""
    rng = np.random.default_rng(int(1000 * share))
    r = quiet(rng, 200, 100)
    there = np.r_[True, rng.random(r.n - 2) > share, True]
    some = replace(r, t=r.t[there], gyro=r.gyro[there], accel=r.accel[there])
    found = prepare(some)
    assert found.n == r.n and found.missing == int(np.sum(~there))
    np.testing.assert_array_equal(found.gyro[there], r.gyro[there])
    assert found.rate_hz == pytest.approx(100, rel=1e-9)


def test_a_stalled_thread_loses_nothing():
    """A delay of any length that is caught up is no loss and no pause."""
    rng = np.random.default_rng(0)
    t = np.arange(30_000) / 100
    for begin in (20.0, 111.0, 222.0):
        late = (t >= begin) & (t < begin + 1.5)
        t = np.where(late, begin + 1.5 + 1e-4 * np.cumsum(late), t)
    t = np.maximum.accumulate(t + 1e-5 * rng.standard_normal(len(t)))
    found = fit_clock(t)
    assert found.missing == 0 and len(found.pauses()) == 0


def test_a_clock_that_is_set_loses_nothing():
    """A step that is no whole number of intervals is the clock's, and said."""
    t = np.arange(20_000) / 100
    found = fit_clock(t + 0.0345 * (t > 90))
    assert found.missing == 0 and found.steps[:, 1] == pytest.approx(0.0345, abs=1e-6)
    assert 'clock was set' in found.doubts()[0]
    assert found.rate_hz == pytest.approx(100, rel=1e-9)


@pytest.mark.parametrize('part', [0.22, 0.4, 0.7])
def test_a_clock_that_is_set_back_a_little_is_seen(part):
    """A step back by a part of an interval tilts no rate; a reader that catches up is no step."""
    t = np.arange(20_000) / 100
    rng = np.random.default_rng(7)
    found = fit_clock(t - 0.01 * part * (t > 90) + 1e-5 * rng.standard_normal(len(t)))
    assert found.missing == 0 and found.steps[:, 1].tolist() == [
        pytest.approx(-0.01 * part, abs=1e-4)]
    assert found.rate_hz == pytest.approx(100, rel=1e-6)
    caught_up = np.where(np.arange(len(t)) % 30 < 3, np.floor(t / 0.3) * 0.3 + 0.024, t)
    assert len(fit_clock(np.maximum.accumulate(caught_up)).steps) == 0
    late = t + 0.0019 * (np.arange(len(t)) == 7000) - 0.001 * (np.arange(len(t)) == 7001)
    assert len(fit_clock(late).steps) == 0
    polled = np.ceil(t * (1 - 4e-5) / 0.005) * 0.005        # slips by half an interval, once
    assert np.sum(np.diff(polled) < 0.006) == 1 and len(fit_clock(polled).steps) == 0


@pytest.mark.parametrize('late', [0.008, 0.02])
def test_stamps_that_scatter_by_more_than_an_interval_set_no_clock(late):
    """A fifth lies behind the one before: each was a clock set back, and the rate 93.7 Hz."""
    rng = np.random.default_rng(8)
    t = np.arange(60_000) / 100 + np.abs(late * rng.standard_normal(60_000))
    record = ordered(ImuRecord(rng.standard_normal((60_000, 3)), None, t, None))
    assert record.n == 60_000 and np.max(np.abs(record.t - t)) < 6 * late
    assert 'they scatter' in record.warnings[-1]
    found = fit_clock(record.t)
    assert found.missing == 0 and found.rate_hz == pytest.approx(100, rel=1e-4)
    # one that is set back by a minute, once, is
    back = ordered(ImuRecord(np.zeros((60_000, 3)), None, np.where(
        np.arange(60_000) < 30_000, 0, -60.0) + np.arange(60_000) / 100, None))
    assert back.t[-1] == pytest.approx(599.99, abs=0.02) and 'set back' in back.warnings[-1]


@pytest.mark.parametrize('ahead', [2.0, 86_400.0])
@pytest.mark.parametrize('lost', [0, 700])
def test_a_clock_that_is_set_ahead_loses_nothing_that_was_received(ahead, lost):
    """A reset or NTP moves the stamps; what the receiver missed as well was lost."""
    rng = np.random.default_rng(10)
    t = np.delete(np.arange(20_000) / 100, np.arange(10_000, 10_000 + lost))
    received = t + 0.002 + rng.exponential(0.001, len(t))
    stalled = np.where((t > 150) & (t < 153), 153.0, received)      # nothing was read for a while
    stamps = t + ahead * (np.arange(len(t)) >= 10_000)
    record = ImuRecord(rng.standard_normal((len(t), 3)), None, stamps, 100.0, receive_t=stalled)
    put_right = ordered(record)
    assert put_right.t == pytest.approx(t, abs=0.02) and 'set ahead 1' in put_right.warnings[-1]
    found = examine(record)
    assert (found.ahead, found.missing) == (1, lost) and 'set ahead 1 time' in str(found.advice)
    # without receive times, or where they have the gap too, it is one
    for seen in (None, stalled + ahead * (np.arange(len(t)) >= 10_000)):
        assert examine(replace(record, receive_t=seen)).missing == round(100 * ahead) + lost


def test_samples_that_overtook_each_other_are_put_in_order():
    rng = np.random.default_rng(9)
    order = np.argsort(np.arange(30_000) + rng.uniform(0, 3, 30_000))
    gyro = rng.standard_normal((30_000, 3))
    record = ordered(ImuRecord(gyro[order], None, order / 100, None))
    np.testing.assert_array_equal(record.gyro, gyro)


def test_packets_that_were_lost_are_counted_exactly():
    """Ten lost in stamps that scatter by several intervals are ten, not nine or eleven."""
    n = 45_000
    packet = np.arange(n) // 10
    there = ~np.isin(packet, [703, 1511, 2290, 3077, 3802])
    for seed in range(16):
        rng = np.random.default_rng(seed)
        sent = (10 * packet + 9) / 100 + rng.gamma(2, 0.008, packet[-1] + 1)[packet]
        found = fit_clock((np.maximum.accumulate(sent) + 2e-4 * (np.arange(n) % 10))[there])
        assert found.lost.tolist() == 5 * [10]
        assert found.rate_hz == pytest.approx(100, rel=1e-5)


@pytest.mark.parametrize('size', [16, 26, 104])
def test_a_buffer_that_is_read_late_is_no_loss(size):
    """Stamps counted back from the reading by a nominal rate are late a whole buffer long."""
    rng, n, rate = np.random.default_rng(size), 60_000, 105.352
    k = np.arange(n)
    last = np.minimum(k // size * size + size - 1, n - 1)
    read = last / rate + rng.exponential(0.012, n // size + 1)[k // size]
    t = np.maximum.accumulate(np.round(1e3 * (read - (last - k) / 104)) / 1e3)
    found = fit_clock(t)
    assert found.missing == 0 and len(found.steps) == 0
    assert found.rate_hz == pytest.approx(rate, rel=5e-6)
    found = fit_clock(np.delete(t, np.r_[20_000:20_000 + 2 * size]))
    assert found.lost.tolist() == [2 * size]


@pytest.mark.parametrize('gap, said', [(0.5, False), (1.01, True), (400.0, True)])
def test_a_long_gap_need_not_be_a_loss(gap, said):
    """Two recordings joined, or a leap second, do not ask for a faster disk alone."""
    r = quiet(np.random.default_rng(2), 60, 100)
    found = examine(replace(r, t=r.t + (gap - 0.01) * (np.arange(r.n) >= 3000)))
    assert found.gaps == 1 and ('recordings that were joined' in str(found.advice)) is said


def counted_back(n, rate, nominal, size, late, rng):
    """Return stamps of buffers read late, counted back at a nominal rate."""
    k = np.arange(n)
    last = k // size * size + size - 1
    read = last / rate + rng.gamma(2, late / 2, n // size + 1)[k // size]
    return read - (last - k) / nominal


@pytest.mark.parametrize('size, late, nominal', [
    (32, 2e-5, 103), (128, 0.001, 102), (256, 0.005, 101.5), (85, 0.02, 101.6)])
def test_a_buffer_of_a_sensor_slower_than_stated_loses_nothing(size, late, nominal):
    """Its stamps jump ahead at every reading, as losses would, but by no whole interval."""
    n = 60_000 // size * size
    t = counted_back(n, 100, nominal, size, late, np.random.default_rng(size))
    found = fit_clock(np.maximum.accumulate(t))
    assert found.missing == 0 and len(found.steps) == 0
    assert found.rate_hz == pytest.approx(100, rel=1e-5)


@pytest.mark.parametrize('size, nominal', [(128, 98.5), (256, 99), (500, 98.2)])
def test_a_buffer_of_a_sensor_faster_than_stated_sets_no_clock_back(size, nominal):
    """Its stamps fall back at every reading, seldom if the buffer is long, and yet get on."""
    n = 60_000 // size * size
    t = counted_back(n, 100, nominal, size, 0.001, np.random.default_rng(size))
    record = ordered(ImuRecord(np.zeros((n, 3)), None, t, None))
    assert np.sum(np.diff(t) < 0) > 100 and not any('set back' in w for w in record.warnings)
    found = fit_clock(record.t)
    assert found.missing == 0 and found.rate_hz == pytest.approx(100, rel=1e-5)


def test_samples_alike_by_chance_are_no_messages_that_came_twice():
    """At rest and in coarse counts one of fifty is as the one before, on all six axes."""
    rng, n = np.random.default_rng(17), 20_000
    x = np.round(0.5 * rng.standard_normal((n, 6)))
    even = np.arange(n) / 200
    held = even[np.arange(n) // 2 * 2]          # each stamp is given to two samples
    alike = np.all(x[1:] == x[:-1], axis=1) & (np.diff(held) == 0)
    assert np.sum(alike) > 100
    found = examine(ImuRecord(x[:, :3], x[:, 3:], held, 200.0))
    assert found.missing == 0 and found.rate_hz == pytest.approx(200, rel=1e-5)
    assert ordered(ImuRecord(x[:, :3], x[:, 3:], held, None)).n == n
    # of messages that come twice all are taken for it, however many are alike by chance
    twice = np.sort(np.r_[np.arange(n), rng.choice(n, 40, replace=False)])
    coarse = np.round(0.27 * rng.standard_normal((n, 6)))[twice]
    assert np.mean(np.all(coarse[1:] == coarse[:-1], axis=1)) > 0.3
    some = ordered(ImuRecord(coarse[:, :3], coarse[:, 3:], even[twice], None))
    np.testing.assert_array_equal(some.t, even)
    twice = np.sort(np.r_[np.arange(n), rng.choice(n, 40, replace=False)])
    some = ordered(ImuRecord(x[twice, :3], x[twice, 3:], even[twice], None))
    np.testing.assert_array_equal(some.t, even)
    assert '40 duplicate message(s) were dropped' in some.warnings


def test_stamps_that_scatter_are_not_told_as_duplicates():
    """
    Of those that fall back it is said so, and once: of 3 given twice among them 3 are told.

    A message that came twice is none of these.

    """
    rng, n = np.random.default_rng(8), 20_000
    t = np.arange(n) / 100 + np.repeat(rng.uniform(0, 0.06, n // 20), 20)
    t[[1003, 5003, 9003, 13_003]] = t[[1002, 5002, 9002, 13_002]]
    assert np.sum(np.diff(t) < 0) > 200
    gyro = rng.standard_normal((n, 3))
    gyro[13_003] = gyro[13_002]
    said = ordered(ImuRecord(gyro, None, t, None)).warnings
    assert any('1 duplicate message(s)' in s for s in said)
    assert any('3 duplicate stamps' in s for s in said) and any('they scatter' in s for s in said)


def test_the_pauses_of_a_reader_are_no_losses():
    """Seventeen samples taken at once, 1.5 ms each, do not come at 667 Hz with more lost."""
    rng, n, rate = np.random.default_rng(4), 120_000, 285.714
    read = np.cumsum(0.06 * rng.uniform(0.8, 1.2, 8000))
    turn = np.searchsorted(read, np.arange(n) / rate)
    t = np.maximum.accumulate(read[turn] + 1.5e-3 * (np.arange(n) - np.searchsorted(turn, turn)))
    found = fit_clock(t)
    assert found.missing == 0 and found.rate_hz == pytest.approx(rate, rel=1e-4)


def test_the_beat_of_ticks_is_no_loss():
    """Stamps in milliseconds at 1 kHz skip one whenever the clocks have slipped by one."""
    rng = np.random.default_rng(3)
    k = np.arange(300_000)
    there = np.ones(len(k), bool)
    t = np.floor(1e3 * k / (1000 * (1 - 6e-5))) / 1e3
    assert np.sum(np.diff(t) > 1.5e-3) > 10
    assert fit_clock(t).missing == 0
    there[rng.choice(k[1000:-1000], 12, replace=False)] = False
    exact = np.floor(1e3 * k[there] / 1000 + 1e-9) / 1e3
    assert fit_clock(exact).missing == 12


def test_rough_stamps_say_what_they_cannot_show():
    """Where stamps scatter by more than an interval, single losses are not claimed."""
    rng = np.random.default_rng(5)
    t = np.sort(np.arange(30_000) / 100 + rng.gamma(2, 0.03, 30_000))
    found = fit_clock(t)
    assert found.missing == 0 and found.resolvable >= 1
    assert found.rate_hz == pytest.approx(100, rel=1e-4)


def test_real_stamps(shared_data):
    """A buffered stream is even; a log with real gaps has lost what it has lost."""
    def clock(name):
        return fit_clock(open_record(shared_data / 'records' / f'{name}.npz').t)

    found = clock('mpu6050_buffered_655s')
    assert found.missing == 0 and found.pattern == 'bursts'
    assert found.rate_hz == pytest.approx(99.3, abs=0.1)
    # counted by hand from the intervals: 8, 15, 7, 7, 5 + 2 and 5 + 2
    assert clock('px4_auavx21').missing == 51
    for name in ('xsens_mti_multipos', 'yei_jitter_motion'):
        assert clock(name).missing == 0


def test_labels_are_said_to_be_labels(tmp_path):
    """Without stamps the rate is what somebody wrote down."""
    rng = np.random.default_rng(0)
    r = quiet(rng, 100, 50)
    np.savez(tmp_path / 'a.npz', gyro=r.gyro, accel=r.accel, rate_hz=50.0)
    assert any('only what the file says' in w for w in open_record(tmp_path / 'a.npz').warnings)
    np.savez(tmp_path / 'b.npz', gyro=r.gyro, accel=r.accel,
             t=r.t + 1e-5 * rng.standard_normal(r.n))
    record = open_record(tmp_path / 'b.npz')
    assert not record.warnings and examine(record).stamps == 'even'
    health = examine(open_record(tmp_path / 'a.npz'))
    assert health.stamps == 'computed' and any('bears out the rate' in a for a in health.advice)
    # a clock of its own, that of the receiver, bears the rate out
    received = replace(r, receive_t=r.t + 1e-3 * rng.random(r.n))
    assert examine(received).stamps == 'computed'
    assert not any('stamps' in a for a in examine(received).advice)


def test_the_table_of_topics_has_the_rate_of_the_stamps(tmp_path, capsys):
    """An .npz with stamps is listed at their rate."""
    r = quiet(np.random.default_rng(0), 100, 50)
    np.savez(tmp_path / 'a.npz', gyro=r.gyro, accel=r.accel, t=r.t * 50 / 47, rate_hz=50.0)
    assert main(['inspect', str(tmp_path / 'a.npz'), '--json']) == 0
    found = json.loads(capsys.readouterr().out)
    assert found['topics'][0]['rate_hz'] == pytest.approx(47, rel=1e-6)


def test_lost_samples_lower_no_rate_of_a_topic(tmp_path, capsys):
    """A bag that lost a third of its messages is listed at the rate of those that are left."""
    r = quiet(np.random.default_rng(0), 90, 50)
    write_bag(tmp_path / 'a.mcap', r.taken((r.t < 30) | (r.t > 60), Memory()))
    assert main(['inspect', str(tmp_path / 'a.mcap'), '--json']) == 0
    found = json.loads(capsys.readouterr().out)
    assert found['health']['gaps'] == 1
    assert found['topics'][0]['rate_hz'] == pytest.approx(50, rel=1e-6)


def test_two_clocks_are_told_by_name():
    """Header stamps and times of receiving each have their look."""
    rng = np.random.default_rng(0)
    r = quiet(rng, 300, 100)
    measured = r.t + 1e-5 * rng.standard_normal(r.n)
    h = examine(replace(r, t=measured, receive_t=read_late(r.t, 0.06)))
    assert (h.stamps, h.received) == ('even', 'bursts')


# -- disturbed stretches

def quiet(rng, seconds, rate, gyro=1e-3, accel=1e-2) -> ImuRecord:
    """Return white noise about a bias and gravity."""
    n = round(seconds * rate)
    return ImuRecord(gyro * rng.standard_normal((n, 3)) + [0.01, -0.02, 0.0],
                     accel * rng.standard_normal((n, 3)) + [0.1, 0.2, 9.8],
                     np.arange(n) / rate, float(rate))


@pytest.mark.parametrize('step, said', [
    (0.0, True), seldom(1e-3, True), (4e-3, False)])
def test_an_axis_that_dies_midway_is_said(step, said):
    """Its N is too small; of an output whose steps hide the noise nothing can be told."""
    record = quiet(np.random.default_rng(4), 300, 100.0)
    gyro = record.gyro.copy()
    if step:
        gyro = np.round(gyro / step) * step
    assert not any('one value' in w for w in prepare(replace(record, gyro=gyro)).warnings)
    gyro[18_000:, 1] = np.round(-0.02 / step) * step if step else gyro[18_000, 1]
    record = replace(record, gyro=gyro)
    for words in prepare(record).warnings, examine(record).advice:
        found = [w for w in words if 'stands at one value' in w]
        assert len(found) == said
        assert not said or found[0].startswith('gyro_y') and 'to 299.99 s' in found[0]
    assert 0 <= (18_000 if said else 30_000) - prepare(record).n < 5     # some may be equal before
    assert prepare(record, screen=False).n == 30_000
    study = analyse_record(record, axes=('gyro_y',), effects=('white',))
    n = study.states['gyro_y'].fit.estimates['white']['N']
    # of what is dead nothing is analysed: N is as before
    assert not said or n.ci95[0] < np.hypot(1e-3, step / np.sqrt(12)) * 0.1 < n.ci95[1]


def knocked(record, times, size=1.0, gyro=0.05) -> ImuRecord:
    """Return the record with knocks that ring down within a fifth of a second."""
    a, w = record.accel.copy(), record.gyro.copy()
    for at in times:
        t = np.clip(record.t - at, 0, None)
        ring = np.exp(-t / 0.1) * np.sin(2 * np.pi * 11 * t)
        a += np.outer(ring, size * np.array([1.0, 0.6, 0.8]))
        w += np.outer(ring, gyro * np.array([0.5, 1.0, 0.3]))
    return replace(record, accel=a, gyro=w)


@pytest.mark.parametrize('seed', daily(SEEDS, 1))
@pytest.mark.parametrize('rate', [50, 100, 400])
def test_knocks_are_found_and_set_aside(seed, rate):
    """Four knocks of 1 m/s^2: listed with time and size, set aside, and nothing else."""
    times = (100.3, 222.2, 301.1, 444.4)
    r = prepare(knocked(quiet(np.random.default_rng(seed), 600, rate), times))
    assert [d.kind for d in r.disturbances] == ['shock'] * 4
    for d, at in zip(r.disturbances, times):
        assert at - 1 < d.begin <= at + 0.1 < d.end < at + 2
        assert 0.5 < d.size['accel_x'] < 1.2 and 'gyro_y' in d.axes
    assert [why for *_, why in r.left_out] == ['shock'] * 4
    assert any('set aside' in w for w in r.warnings)
    kept = prepare(knocked(quiet(np.random.default_rng(seed), 600, rate), times), screen=False)
    assert len(kept.disturbances) == 4 and kept.left_out == ()


@pytest.mark.parametrize('rate', [100, seldom(400)])
def test_knocks_that_come_often_are_found(rate):
    """A tool that knocks every seven seconds: none of its knocks hides behind the others."""
    rng = np.random.default_rng(2)
    times = 7 * np.arange(1, 42) + rng.uniform(-1, 1, 41)
    r = knocked(quiet(rng, 300, rate), times)
    r = replace(r, accel=np.minimum(r.accel, [0.6, np.inf, np.inf]))    # the end of the range
    found = prepare(r)
    shocks = [d for d in found.disturbances if d.kind == 'shock']
    assert all(any(d.begin - 0.1 < at < d.end for d in shocks) for at in times)
    cut = [d for d in found.disturbances if d.kind == 'clipped']
    # what is cut is no sample of anything, and goes before knocks that are whole
    assert len(cut) > 3
    assert all(any(a <= d.begin and d.end <= b for a, b, _ in found.left_out) for d in cut)
    assert 7 < sum(b - a for a, b, _ in found.left_out) <= 15


@pytest.mark.parametrize('back, whole', [(True, True), (False, False)])
def test_a_nudge_of_seconds_does_not_part_a_record_of_hours(back, whole):
    """Gone for five seconds, then as before: of 2.8 h all is analysed. Or it lies otherwise."""
    r = quiet(np.random.default_rng(4), 10_000, 10)
    push = np.sin(np.pi * np.clip((r.t - 4000) / (5 if back else 10), 0, 1 if back else 0.5))
    found = prepare(replace(r, gyro=r.gyro + 0.3 * np.gradient(push, r.t)[:, None],
                            accel=r.accel + 2 * push[:, None]))
    assert found.n == r.n if whole else found.n == pytest.approx(60_000, abs=100)
    assert [d.kind for d in found.disturbances] == ['shock'] * whole
    assert len(found.left_out) == whole


def test_what_lasts_is_listed_and_kept():
    """A motor that runs for a quarter of the time is listed at most, never left out."""
    r = quiet(np.random.default_rng(0), 600, 100)
    hum = 0.2 * np.sin(2 * np.pi * 23 * r.t) * ((r.t > 200) & (r.t < 350))
    found = prepare(replace(r, accel=r.accel + hum[:, None], gyro=r.gyro + 0.1 * hum[:, None]))
    assert found.left_out == ()
    hum = hum * (r.t < 215)
    found = prepare(replace(r, accel=r.accel + hum[:, None], gyro=r.gyro + 0.1 * hum[:, None]))
    (begin, end, why), = found.left_out
    assert why == 'disturbed' and begin < 200.1 and end > 214.9 and end - begin < 25


def test_pieces_of_what_lasts_are_kept():
    """A machine that is found in pieces is left in as a whole: some of them would tell nothing."""
    r = quiet(np.random.default_rng(1), 600, 100)
    hum = 0.2 * np.sin(2 * np.pi * 23 * r.t) * ((r.t > 200) & (r.t < 400) & (r.t % 20 < 6))
    shaken = replace(r, accel=r.accel + hum[:, None], gyro=r.gyro + 0.1 * hum[:, None])
    found = prepare(shaken)
    assert [d.kind for d in found.disturbances] == ['disturbed'] * 10 and found.left_out == ()


@pytest.mark.parametrize('rate', [25, 200])
def test_what_dies_away_from_the_beginning_is_kept(rate):
    """A warm-up that is far above the noise moves within a frame, and is quiet about that."""
    r = quiet(np.random.default_rng(3), 154, rate, gyro=2.4e-4)
    warm = 0.0133 * np.exp(-r.t / 4.7)
    found = prepare(replace(r, gyro=r.gyro + np.outer(warm, [1, -1.3, 1.5])), keep_motion=True)
    assert found.n == r.n and found.left_out == ()


def test_a_step_is_listed_and_kept():
    """A step of one axis is seen, and is for the loop to explain."""
    r = quiet(np.random.default_rng(0), 600, 100)
    found = prepare(replace(r, gyro=r.gyro + np.outer(r.t > 300, [0.01, 0, 0])))
    step, = found.disturbances
    assert step.kind == 'step' and step.begin == pytest.approx(300, abs=1)
    assert step.size == {'gyro_x': pytest.approx(0.01, rel=0.1)} and found.left_out == ()


def own_noise(name, rng, n):
    """Return what a sensor does by itself, in standard deviations of its white noise, (n, 6)."""
    x = rng.standard_normal((n, 6))
    if name == 'random walk':
        return x + np.cumsum(rng.standard_normal((n, 6)), axis=0) / 30
    if name == 'coarse':
        return np.round(x / 4 + rng.uniform(-0.4, 0.4, 6)) * 4
    if name == 'vibration':
        return x + 20 * np.sin(0.9 * np.arange(n))[:, None]
    if name == 'popcorn':
        x[:, 1] += 5 * (np.cumsum(rng.random(n) < 5e-4) % 2)
        return x
    if name == 'spikes':
        return x + 15 * (rng.random((n, 6)) < 5e-3)
    return x + np.linspace(0, 100, n)[:, None] ** 1.2      # a drift


@pytest.mark.parametrize('seed', SEEDS)
@pytest.mark.parametrize(
    'name', ['random walk', 'coarse', 'vibration', 'popcorn', 'spikes', 'drift']
)
def test_noise_is_no_disturbance(name, seed):
    """What a sensor does by itself, however strong, is not set aside."""
    rng = np.random.default_rng(seed)
    r = quiet(rng, 400, 100)
    x = own_noise(name, rng, r.n)
    r = replace(r, gyro=1e-3 * x[:, :3], accel=1e-2 * x[:, 3:] + [0, 0, 9.8])
    found = prepare(r, keep_motion=True)
    assert found.left_out == () and found.disturbances == ()


def test_shaken_is_not_moved():
    """An engine that idles shakes strongly and slowly enough; the sensor still rests."""
    r = quiet(np.random.default_rng(0), 80, 100)
    shake = 3 * np.sin(2 * np.pi * 32.5 * r.t) + 0.4 * np.sin(2 * np.pi * 2.3 * r.t)
    turn = 0.03 * np.sin(2 * np.pi * 2.3 * r.t)
    shaken = replace(r, accel=r.accel + shake[:, None], gyro=r.gyro + turn[:, None])
    assert still_stretches(shaken) == [(0, r.n)] and prepare(shaken).n == r.n
    slowly = 0.3 * np.sin(2 * np.pi * 0.1 * r.t)
    with pytest.raises(InputError, match='moves'):
        prepare(replace(r, gyro=r.gyro + slowly[:, None]))


@pytest.mark.parametrize('sways, rests', [
    (lambda t: t >= 0, True), (lambda t: t % 200 < 150, True),
    (lambda t: (t > 300) & (t < 340), False)])      # something was slid aside
def test_what_sways_all_the_while_is_at_rest(sways, rests):
    """A tower or a raft: too slow to have gone round in three seconds; a sensor drifts besides."""
    r = quiet(np.random.default_rng(1), 900, 20)
    sway = 0.3 * np.sin(2 * np.pi * 0.23 * r.t) * sways(r.t) + 2e-4 * r.t
    swaying = replace(r, accel=r.accel + np.outer(sway, [1, 0.6, 0]),
                      gyro=r.gyro + np.outer(sway, [2e-3, 0, 0]))
    assert (still_stretches(swaying) == [(0, r.n)]) == rests


@pytest.mark.parametrize('size, rests', [(0.015, True), (0.05, False)])
def test_what_shakes_now_and_then_is_at_rest_while_the_sensor_warms_up(size, rests):
    """Of 24 h on a mast 50 min were analysed: the rate was not the same at both ends."""
    r = quiet(np.random.default_rng(2), 1800, 20, gyro=4e-4)
    shake = 0.5 * np.sin(2 * np.pi * 0.65 * r.t) * (r.t % 300 < 20)
    warm = size * np.exp(-r.t / 200)
    warming = replace(r, accel=r.accel + np.outer(shake, [1, 0.6, 0]),
                      gyro=r.gyro + np.outer(warm, [1, 0, 0]))
    assert (still_stretches(warming) == [(0, r.n)]) == rests


def rocked(record, begin, end, size=1.0) -> ImuRecord:
    """Return the record swung at 1.1 Hz between two times, far less than an engine shakes it."""
    t = record.t
    swing = size * np.sin(2 * np.pi * 1.1 * t) * ((t >= begin) & (t < end))
    return replace(record, gyro=record.gyro + np.outer(swing, [4e-3, 1e-3, 2e-3]),
                   accel=record.accel + np.outer(swing, [0.05, 0.06, 0.03]))


def test_what_is_rocked_at_its_ends_is_cut_off():
    """Who starts the record and comes back to stop it: too faint beside an engine for a shock."""
    r = quiet(np.random.default_rng(3), 200, 100)
    r = replace(r, accel=r.accel + 2 * np.sin(2 * np.pi * 32.5 * r.t)[:, None])
    handled = rocked(rocked(r, 0, 6), 190, 200)
    found = prepare(handled)
    assert 6 <= found.t[0] < 9 and 187 < found.t[-1] <= 190
    assert any('rocked at its ends' in w for w in found.warnings)
    assert prepare(handled, screen=False).n == r.n and prepare(handled, keep_motion=True).n == r.n
    only = prepare(rocked(r, 192, 200))
    assert only.t[0] == 0 and only.t[-1] < 192


def test_what_swings_elsewhere_is_not_cut_off():
    """In the middle, faintly, on one sensor, most of the time, or as a bench does by itself."""
    r = quiet(np.random.default_rng(4), 200, 100)
    for other in (rocked(r, 90, 100), rocked(r, 0, 100), rocked(r, 0, 6, 0.05),
                  replace(rocked(r, 0, 6), accel=r.accel)):
        assert len(prepare(other, screen=True).t) == r.n
    for seed in range(20):      # a vibration common to all axes, of random size
        rng = np.random.default_rng([5, seed])
        pole = np.exp(-np.pi * 0.02 / 60 + 2j * np.pi * 0.02)
        z = lfilter([1], [1, -2 * pole.real, abs(pole)**2], rng.standard_normal(r.n))
        z = (z / z.std())[:, None]
        assert prepare(replace(r, gyro=r.gyro + 3e-3 * z, accel=r.accel + 0.03 * z)).n == r.n


def test_real_disturbances(shared_data):
    """The shock on the desk is found, the truck that idles is analysed
    but for whoever is in it, quiet records are quiet."""
    def ready(name):
        return prepare(open_record(shared_data / 'records' / f'{name}.npz'))

    desk = ready('vn100_desk_756s')
    (begin, end, _), = desk.left_out
    assert begin < 742 and 744.5 < end < 748
    truck = ready('truck_idle_xsens_45s')
    assert 4 < truck.t[0] < 8 and 35 < truck.t[-1] < 38.8   # its note: disturbed from 38.8 s
    for name in ('mpu6050_static_449s', 'adis16405_run2', 'mpu6050_buffered_655s'):
        assert ready(name).disturbances == ()
    assert ready('px4_auavx21').t[0] > 5       # what is handled first is not analysed


# -- choosing a part

def test_start_and_duration():
    """A part is chosen by seconds or per cent; times stay those of the record."""
    r = quiet(np.random.default_rng(0), 200, 100)
    part = Selection.of('10%', '50%').part(r)
    assert part.t[0] == pytest.approx(20, abs=0.02)
    assert part.duration_s == pytest.approx(100, abs=1)
    part = Selection.of('30', '').part(r)
    assert part.t[0] == pytest.approx(30, abs=0.02) and part.t[-1] == r.t[-1]
    assert Selection().part(r) is r


def test_masks_are_set_aside():
    """What is masked is left out whatever it holds, in the times of the record."""
    r = quiet(np.random.default_rng(0), 200, 100)
    chosen = Selection.of('20', '', '10-25,50-60.5')
    found = prepare(chosen.part(r), masks=chosen.masks)
    first, second = found.left_out
    assert first[:2] == pytest.approx((20, 25)) and second[:2] == pytest.approx((50, 60.5))
    with pytest.raises(UsageError, match='too little'):
        prepare(r, masks=((0, 199),))


def test_a_mask_beside_the_record_is_said():
    found = prepare(quiet(np.random.default_rng(0), 200, 100), masks=((1e5, 2e5),))
    assert not found.left_out
    assert any('--mask 100000-200000 s is outside' in w for w in found.warnings)


@pytest.mark.parametrize('options', [
    ['--start', 'soon'], ['--start', '-3'], ['--start', '1e9'], ['--start', 'nan'],
    ['--duration', '0'], ['--duration', '130%'], ['--mask', '5-2'], ['--mask', '7'],
    ['--mask', '1-2,'], ['--mask', '0-1e9'],
])
@pytest.mark.parametrize('command', ['analyse', 'inspect'])
def test_wrong_choices_are_wrong_usage(options, command, tmp_path, capsys):
    """One line on standard error, exit status 2, nothing written."""
    r = quiet(np.random.default_rng(0), 100, 50)
    np.savez(tmp_path / 'a.npz', gyro=r.gyro, accel=r.accel, t=r.t)
    option, value = options
    assert main([command, str(tmp_path / 'a.npz'), f'{option}={value}']) == 2
    said = capsys.readouterr()
    assert said.err.count('\n') == 1 and option in said.err and said.out == ''
    assert [p.name for p in tmp_path.iterdir()] == ['a.npz']


@pytest.mark.thorough
def test_the_study_says_what_is_left_out(tmp_path, capsys):
    """The list of disturbed stretches is in study.yaml, on the terminal and on the page."""
    r = knocked(quiet(np.random.default_rng(0), 120, 50), (40.0, 90.0))
    np.savez(tmp_path / 'a.npz', gyro=r.gyro, accel=r.accel, t=r.t)
    arguments = [str(tmp_path / 'a.npz'), '-o', str(tmp_path / 's'), '--axes', 'gyro_x']
    assert main(['analyse', *arguments, '--json']) == 0
    source = json.loads(capsys.readouterr().out)['source']
    assert [d['kind'] for d in source['disturbances']] == ['shock', 'shock']
    assert len(source['left_out']) == 2 and source['disturbances'][0]['size']['accel_x'] > 0.5
    page = (tmp_path / 's' / 'report.html').read_text()
    assert 'shock from 39' in page or 'shock from 40' in page
    assert main(['analyse', *arguments, '--no-screen', '--force', '--start', '20', '--mask',
                 '60-62.5']) == 0
    said = capsys.readouterr().out
    assert 'not set aside' in said
    # in the seconds of the record that --mask takes, wherever the analysed stretch begins
    assert 'left out: 60 s to 62.5 s, masked' in said
    assert 'shock from 39' in said or 'shock from 40' in said or 'shock at 40' in said
    (begin, end), = [(a, b) for a, b, _ in left_out(store.load(tmp_path / 's'), 'gyro_x')]
    assert (begin, end) == (pytest.approx(40, abs=0.03), pytest.approx(42.5, abs=0.03))


# -- the rest of what inspect says

def test_one_step_of_the_grid():
    """Spikes on a coarse output do not hide its step, for health as for the fit."""
    for seed in range(6):
        rng = np.random.default_rng(seed)
        x = np.round(rng.standard_normal(30_000) / 0.4) * 0.4
        x += (rng.random(len(x)) < 1e-3) * 7 * rng.standard_normal(len(x))
        assert resolution(x).step == pytest.approx(0.4, rel=1e-6) == grid_step(x)[0]


@pytest.mark.parametrize('walk', daily([1.0, 0.03], 0.03))
def test_noise_that_wanders_is_no_warm_up(walk):
    """One random walk in a thousand begins as if it came from afar (one in 17, before)."""
    rng = np.random.default_rng(8)
    n, count = 1000, 3000
    x = np.cumsum(walk * rng.standard_normal((count, n)), axis=1) + rng.standard_normal((count, n))
    assert sum(_warms_up(row) for row in x) <= 9     # of which chance makes more in one of 1000
    t = np.arange(n) / n
    for tau in (0.05, 0.2):
        assert np.mean([_warms_up(0.1 * row + 60 * walk * np.exp(-t / tau))
                        for row in x[:200]]) > 0.8


def test_gravity_that_is_off_is_remarked():
    """Nine metres per second squared are no gravity; a good sensor is not blamed."""
    r = quiet(np.random.default_rng(0), 100, 50)
    off = replace(r, accel=r.accel - [0, 0, 0.8])
    assert any('Gravity reads 9' in a for a in examine(off).advice)
    assert not any('Gravity' in a for a in examine(r).advice)


@pytest.mark.parametrize('name', ['temperature', 'imu_temp', 'temperature_2'])
def test_no_advice_to_record_what_was_recorded(name):
    """A temperature by any of its names is one."""
    r = quiet(np.random.default_rng(0), 100, 50)
    with_it = replace(r, covariates={name: 30 + 0.0 * r.t})
    assert not any('no temperature' in a for a in examine(with_it).advice)
    assert any('no temperature' in a for a in examine(r).advice)


def test_a_filter_is_told_of_the_end_of_the_range_and_of_units():
    """In the words of inspect; a clean record of the same motion has no warning."""
    t = np.arange(3000) / 200.0
    rng = np.random.default_rng(3)
    gyro = 4 * np.sin(2 * np.pi * np.outer(t, [0.5, 0.7, 0.9])) + 0.01 * rng.normal(size=(3000, 3))
    clean = ImuRecord(gyro, None, t, 200.0)
    assert motion_doubts(clean) == []
    clipped = replace(clean, gyro=np.clip(gyro, -2.5, 2.5))
    said = motion_doubts(clipped)
    assert [s.split(' in ')[0] for s in said] == [
        f'gyro_{a} stands at the end of its range' for a in 'xyz']
    assert all(any(s + '.' == a for a in examine(clipped).advice) for s in said)
    _, done = filter_samples(clipped, motion='constant_rate')
    assert set(said) <= set(done.notes)
    assert 'deg/s' in motion_doubts(replace(clean, gyro=np.degrees(gyro)))[0]
    spiky = gyro.copy()
    spiky[5] = 500.0
    assert motion_doubts(replace(clean, gyro=spiky)) == []
    slow = motion_doubts(replace(clean, t=1e3 * t, rate_hz=0.2))
    assert len(slow) == 1 and 'they are in ms, not s' in slow[0]
    said = str(examine(replace(clean, t=1e3 * t)).advice)
    assert 'they are in ms' in said and 'in 0.1 ms' in said


@pytest.mark.parametrize('what', ['coarse', 'again', 'both'])
def test_a_coarse_output_repeats_by_itself(what):
    """On all axes in a tenth of the samples; a driver that repeats does so only one after one."""
    rng, n = np.random.default_rng(31), 20_000
    x = rng.standard_normal((n, 6)) + rng.uniform(0, 3, 6)
    x = np.round(x / 3.4) * 3.4 if what != 'again' else x
    if what != 'coarse':
        x = x[np.maximum.accumulate(np.where(rng.random(n) < 0.2, 0, np.arange(n)))]
    record = ImuRecord(1e-3 * x[:, :3], 0.05 * x[:, 3:] + [0, 0, 9.7], np.arange(n) / 100, 100.0)
    (said,) = (s for s in examine(record).advice if 'repeat the one before' in s)
    assert ('publishes faster' in said) == (what != 'coarse')
    assert ('steps of the output' in said) == (what == 'coarse')


@pytest.mark.parametrize('what, skipped', [
    ('missing', '1 level'), ('rounded twice', 'levels'), ('even', ''), ('telegraph', ''),
    ('drifts', '')])
def test_levels_that_noise_must_meet_and_never_does_are_said(what, skipped):
    """A stuck bit was called complete, and what it does with the mean a change of the noise."""
    rng, n = np.random.default_rng(7), 30_000
    x = 1.3 * rng.standard_normal((n, 6)) + 0.2
    if what == 'telegraph':
        x = 0.1 * x + 4 * (np.cumsum(rng.random((n, 1)) < 0.03, axis=0) % 2)
    elif what == 'drifts':
        x = 0.4 * x + np.linspace(0, 300, n)[:, None]
    x = np.round(x)
    if what == 'missing':
        x[x == 1] = 2
    elif what == 'rounded twice':
        x = np.round(1.5 * x)
    record = ImuRecord(1e-3 * x[:, :3], 0.05 * x[:, 3:] + [0, 0, 9.7], np.arange(n) / 100, 100.0)
    said = [s for s in examine(record).advice if 'never stands on' in s]
    assert len(said) == 6 * bool(skipped) == sum(
        'never stands on' in w for w in prepare(record).warnings)
    assert all(skipped in s for s in said)


@pytest.mark.parametrize('rate', [100.0, 37.0])
@pytest.mark.parametrize(
    'given, said', [(10.0, True), (1.05, True), (1.002, False), (None, False)])
@pytest.mark.parametrize('kind', ['npz', 'mcap', 'unstamped'])
def test_a_rate_that_contradicts_the_stamps_is_said(tmp_path, kind, rate, given, said):
    """It said that the stamps were used, and N came out by the rate that was given."""
    rng, n = np.random.default_rng(5), 3000
    t = (np.arange(n) + 0.1 * rng.random(n)) / rate
    record = ImuRecord(rng.standard_normal((n, 3)), rng.standard_normal((n, 3)), t, rate,
                       start=1e9, receive_t=t + 0.01)
    stamps = {} if kind == 'unstamped' else {'t': t}
    path = tmp_path / f'x.{"mcap" if kind == "mcap" else "npz"}'
    if kind == 'mcap':
        write_bag(path, record)
    else:
        np.savez(path, gyro=record.gyro, accel=record.accel, rate_hz=rate, **stamps)
    back = prepare(open_record(path, rate_hz=given and given * rate), keep_motion=True)
    heard = ' '.join(back.warnings)
    against = f'--rate-hz {(given or 1) * rate:.6g} contradicts the stamps, which give'
    assert (against in heard) == (said and kind != 'unstamped')
    assert 'stamps were used' not in heard
    if kind == 'mcap' and said:
        assert 'the samples at --rate-hz span' in heard and 'the rate was used' in heard


@pytest.mark.parametrize('gyro, accel, said', [
    (np.degrees(1), 1 / G0, ['--accel-unit g', '--gyro-unit deg/s']),
    (0.01, 0.01, ['increments', 'analyse --delta'])])
def test_a_unit_is_doubted_alike_by_every_command(gyro, accel, said, tmp_path, capsys):
    """By inspect, analyse, and what moves; read in the units that are named it is not."""
    r = bad_input.still(70)
    r = replace(r, gyro=r.gyro * gyro, accel=r.accel * accel)
    doubts = list(examine(r).units)
    assert len(doubts) == (2 if gyro > 1 else 1)
    assert all(any(s in d for d in doubts) for s in said)
    assert [w for w in prepare(r).warnings if 'wrong unit' in w] == doubts == unit_doubts(r)
    path = write_bag(tmp_path / 'x.npz', r)
    if gyro > 1:
        assert main(['inspect', str(path), '--gyro-unit', 'deg/s', '--accel-unit', 'g']) == 0
        said = capsys.readouterr().out
        assert 'Wrong unit' not in said and 'rest       9.8' in said
        assert main(['inspect', str(path), '--rate-hz', '50']) == 0
        assert 'rate                  50 Hz' in capsys.readouterr().out


@pytest.mark.parametrize('ppm, late, said', [
    (0.0, 0.0, 'none found against the receiver (below '),
    (0.0, 1e-3, 'none found against the receiver (below '),
    (40.0, 1e-4, '40.')])
def test_a_drift_of_the_clock_is_said_as_far_as_it_is_told(ppm, late, said, tmp_path, capsys):
    """Rounding is none: 4e-11 ppm was printed of receive times that are the stamps."""
    r = bad_input.still(200)
    delay = late * np.random.default_rng(2).exponential(size=r.n)
    received = r.t * (1 - 1e-6 * ppm) + 0.25 + delay
    path = write_bag(tmp_path / 'x.bag', replace(r, receive_t=received))
    assert main(['inspect', str(path)]) == 0
    (line,) = (x for x in capsys.readouterr().out.split('\n') if x.startswith('clock drift'))
    assert line.removeprefix('clock drift').strip().startswith(said)
    assert (' ± ' in line) == bool(ppm)


def test_what_is_never_at_rest_has_no_longest_rest():
    r = bad_input.still(70)
    turning = 3 * np.sin(2 * np.pi * 0.7 * r.t)[:, None]
    (said,) = (a for a in examine(replace(r, gyro=r.gyro + turning)).advice if 'moves' in a)
    assert '(it is nowhere at rest)' in said


def test_a_second_is_too_short_to_tell_rest_from_motion():
    """At rest at 1 kHz it was said to move."""
    rng = np.random.default_rng(3)
    r = ImuRecord(1e-3 * rng.standard_normal((1000, 3)), None, np.arange(1000) / 1000, 1000.0)
    advice = ' '.join(examine(r).advice)
    assert 'moves' not in advice
    assert '0.999 s are too short to tell whether the IMU rests' in advice
    with pytest.raises(InputError, match='too short to tell whether .*with --keep-motion'):
        prepare(r)
    assert prepare(r, keep_motion=True).n == 1000


def test_counts_are_read_by_what_one_is(tmp_path, capsys):
    """As `inspect` says it; nonsense is wrong usage, in one line."""
    r = bad_input.still(70)
    path = write_bag(tmp_path / 'x.csv', replace(
        r, gyro=np.round(np.degrees(r.gyro) * 131), accel=np.round(r.accel / G0 * 16384)))
    assert main(['inspect', str(path)]) == 0
    said = ' '.join(capsys.readouterr().out.split())
    assert 'raw counts' in said and '--accel-unit 1/16384g' in said
    options = ['--gyro-unit', '1/131deg/s', '--accel-unit', '1/16384g']
    assert main(['inspect', str(path), *options]) == 0
    said = capsys.readouterr().out
    assert 'raw counts' not in said and 'rest       9.8' in said
    for wrong in ('131/deg', '0', '-1/131deg/s', '1/131g'):
        assert main(['inspect', str(path), f'--gyro-unit={wrong}']) == 2
        assert capsys.readouterr().err.count('\n') == 1


def test_what_is_not_finite_is_told_by_axis(tmp_path, capsys):
    """How many, and when the first; the refusal says it, too."""
    r = bad_input.still(70)
    r.gyro[1000:1100, 1], r.accel[3000, 0] = np.nan, np.inf
    assert examine(r).not_finite_axes == {'gyro_y': (100, pytest.approx(10)),
                                          'accel_x': (1, pytest.approx(30))}
    path = write_bag(tmp_path / 'x.npz', r)
    assert main(['inspect', str(path)]) == 0
    assert '101 samples: gyro_y 100 from 10 s, accel_x 1 from 30 s' in capsys.readouterr().out
    assert main(['analyse', str(path)]) == 1
    assert 'gyro_y 100 from 10 s' in capsys.readouterr().err


@pytest.mark.parametrize('after, said', [
    (3 * 86400.0, '3 days before'), (-5000.0, '83.3 min after'), (0.5, '')])
def test_stamps_far_from_the_receive_times_are_said(after, said):
    r = bad_input.still(70)
    health = examine(replace(r, receive_t=r.t + after))
    assert health.received_after_s == pytest.approx(after)
    found = [a for a in health.advice if 'receive times: their clock' in a]
    assert len(found) == bool(said) and all(f'stamps are {said}' in a for a in found)


@pytest.mark.parametrize('backward, twice, said', [
    (1, 0, '1 backward stamp:'), (0, 3, '3 duplicate stamps:'),
    (2, 3, '3 duplicate and 2 backward stamps:')])
def test_of_stamps_what_is_there_is_said(backward, twice, said):
    r = bad_input.still(70)
    order = np.arange(r.n)
    for k in range(backward):
        order[100 * k + 50:100 * k + 52] += [1, -1]
    r.t[:] = r.t[order]
    for k in range(twice):
        r.t[100 * k + 31] = r.t[100 * k + 30]
    (found,) = [a for a in examine(r).advice if 'check the driver and the clock' in a]
    assert found.startswith(said)


def test_a_record_that_is_too_short_to_tell_says_so():
    """At rest it is analysed, and warned of below a minute; a minute is enough."""
    for seconds, some in ((15, True), (59, True), (60, False), (90, False)):
        ready = prepare(quiet(np.random.default_rng(3), seconds, 100.0))
        assert any('no more than the white noise N' in w for w in ready.warnings) == some


def test_raw_counts_are_told_as_such():
    """Of whole numbers it is asked what one is; a rate in deg/s has its unit."""
    rng = np.random.default_rng(1)
    gyro, accel = 40 * rng.standard_normal((6000, 3)), 20 * rng.standard_normal((6000, 3))
    accel[:, 2] += 16384
    t = np.arange(6000) / 200
    both = wrong_units(ImuRecord(np.round(gyro), np.round(accel), t, 200.0))
    assert len(both) == 2 and all('look like raw counts: say what one is' in s for s in both)
    assert both[0].endswith('--accel-unit 1/16384g') and both[1].endswith('--gyro-unit 1/131deg/s')
    (said,) = wrong_units(ImuRecord(gyro, None, t, 200.0))
    assert said.endswith('--gyro-unit deg/s')
    (said,) = too_fast(ImuRecord(np.round(4 * gyro), None, t, 200.0))
    assert 'raw counts' in said
    (said,) = wrong_units(ImuRecord(None, np.round(accel / 256), t, 200.0))      # 64 for 1 g
    assert 'raw counts' in said


def test_absurd_values_are_missing_to_all_that_looks_at_samples():
    """No warning of numpy's, and nothing said of the sensor but that they are there."""
    record = bad_input.still(20)
    record.gyro[::50, 0] = 1e300
    with np.errstate(all='raise'):
        found = examine(record)
        said = ' '.join(found.advice)
    assert found.not_finite_axes == {'gyro_x': (len(record.gyro[::50]), 0.0)}
    assert not found.saturated and found.resolution['gyro_x'].step is None
    assert 'interpolated' not in said


def test_what_moves_may_be_calibrated_or_filtered():
    """Rests in six directions are a session; a record of motion can be filtered."""
    rng = np.random.default_rng(4)
    t = np.arange(6 * 700) / 100
    ups = np.repeat(9.8 * np.vstack([np.eye(3), -np.eye(3)]), 700, axis=0)
    turns = ((np.arange(len(t)) % 700 > 500) * np.sin(9 * t))[:, None] * [1.0, 0.7, 0.3]
    gyro = turns + 1e-3 * rng.standard_normal(ups.shape)
    record = ImuRecord(gyro=gyro, accel=ups + turns + 0.01 * rng.standard_normal(ups.shape), t=t,
                       rate_hz=100.0)
    assert examine(record).directions == 6
    assert any('6 directions' in s and 'calibrate BAG' in s for s in examine(record).advice)
    rocked = np.sin(3 * t)[:, None] * [1.0, 0.7, 0.3]
    said = examine(ImuRecord(
        gyro=gyro + rocked, accel=record.accel, t=t, rate_hz=100.0)).advice
    assert any('filter BAG' in s for s in said) and not any('calibrate BAG' in s for s in said)


def test_inspect_says_what_is_there_as_people_do(tmp_path, capsys):
    """No scatter that is rounding, no 1e+04 s, and why not in place of a path."""
    r = bad_input.still(200)
    lines = []
    swing = np.sin(4 * r.t)[:, None]
    begun = replace(r, gyro=r.gyro + swing * (r.t < 50)[:, None])
    for k, one in enumerate((r, replace(r, gyro=r.gyro + swing), begun)):
        path = write_bag(tmp_path / f'{k}.npz', one)
        assert main(['inspect', str(path)]) == 0
        out = capsys.readouterr().out
        lines.append({x[:22].strip(): x[22:] for x in out.split('\n') if len(x) > 22})
    assert lines[0]['stamps'].endswith('jitter none')
    assert lines[0]['can be analysed'].endswith(' samples, 3.33 min at rest')
    assert lines[1]['can be analysed'].startswith('no: the IMU moves; ')
    begin, end = lines[2]['can be analysed'].split(' from ')[1].removesuffix(' s').split(' to ')
    assert 45 < float(begin) < 60 and float(end) == pytest.approx(r.t[-1], abs=1)
