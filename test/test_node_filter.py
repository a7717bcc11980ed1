# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The real filter node: every message comes back with less noise, otherwise as it was."""

from __future__ import annotations

import itertools
import threading
import time

import numpy as np
import pytest

from imu_noise_tools.filter.engine import Engine
from nodes_support import DiagnosticArray, Imu, messages, values, wait_for

START = 1_700_000_000_000_000_000
SIGMA = 0.01                # rad/s


def stamped(message, ns):
    """Return the message with a stamp."""
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(int(ns), 10 ** 9)
    return message


def imu(ns, gyro):
    """Return a message with something in every field."""
    m = stamped(Imu(), ns)
    m.header.frame_id = 'imu_link'
    m.orientation.w, m.orientation_covariance[0] = 1.0, -1.0
    m.angular_velocity.x, m.angular_velocity.y, m.angular_velocity.z = map(float, gyro)
    m.linear_acceleration.x, m.linear_acceleration.z = 0.25, 9.81
    m.linear_acceleration_covariance[4] = 0.01
    return m


def ns_of(m):
    """Return the stamp of a message."""
    return m.header.stamp.sec * 10 ** 9 + m.header.stamp.nanosec


def rate(m):
    """Return the rate of a message."""
    return [m.angular_velocity.x, m.angular_velocity.y, m.angular_velocity.z]


class Stream:
    """A filter that runs, with a publisher before it and a list behind it."""

    def __init__(self, ros, **parameters):
        self.ros, self.ns = ros, ros.namespace()
        self.process = ros.start('filter', self.ns, **parameters)
        ros.ready(self.process)
        self._listening = ros.listening(f'{self.ns}/imu/data_filtered', Imu)
        self.out = self._listening.__enter__()
        self._publisher = ros.publisher(f'{self.ns}/imu/data_raw', Imu)
        probes = (imu(START + k, np.zeros(3)) for k in itertools.count())
        last = None

        def probe():
            nonlocal last
            last = next(probes)
            self._publisher.publish(last)
        ros.flowing(self.out, probe)
        assert wait_for(lambda: self.out[-1].header == last.header)
        assert ros.trigger(f'{self.process.full}/reset') == (True, {'reset': True})
        self.out.clear()

    def send(self, sent, wait=True):
        """Send messages; return what came back of them."""
        before = len(self.out)
        for k, m in enumerate(sent):
            self._publisher.publish(m)
            if k % 50 == 49:
                time.sleep(0.01)
        if wait:
            assert wait_for(lambda: len(self.out) >= before + len(sent)), self.process.text
        return self.out[before:]

    def counts(self, such):
        """Return what the node says of its stream, once it is such."""
        told = self.ros.latest(f'{self.process.full}/innovations', DiagnosticArray,
                               lambda m: such(values(m, 'stream')))
        return values(told, 'stream')

    def close(self):
        """End listening."""
        self._listening.__exit__(None, None, None)


@pytest.fixture
def stream(ros):
    """Return a function that starts a filter."""
    open_ = []

    def start(**parameters):
        open_.append(Stream(ros, **parameters))
        return open_[-1]
    yield start
    for s in open_:
        s.close()


def noise(n, seed=1):
    """Return white noise, (n, 3) rad/s."""
    return SIGMA * np.random.default_rng(seed).standard_normal((n, 3))


def test_every_message_comes_back_filtered_and_otherwise_as_it_was(stream):
    s, z = stream(), noise(2000)
    stamps = START + np.arange(2000) * 5_000_000
    sent = [imu(t, g) for t, g in zip(stamps, z)]
    got = s.send(sent)
    assert [ns_of(m) for m in got] == stamps.tolist()
    engine = Engine()
    wanted = [engine.step(1e-9 * (t - START), g) for t, g in zip(stamps, z)]
    assert np.allclose([rate(m) for m in got], [w[0] for w in wanted], rtol=1e-12, atol=0)
    covariance = np.array([m.angular_velocity_covariance for m in got]).reshape(-1, 3, 3)
    assert np.allclose(np.diagonal(covariance, axis1=1, axis2=2), [w[1] for w in wanted])
    assert np.all(covariance[100:, 0, 0] > 0) and not covariance[:, 0, 1].any()
    assert np.std([m.angular_velocity.x for m in got[1000:]]) < 0.5 * SIGMA
    for a, b in zip(sent, got):
        assert a.header == b.header and a.linear_acceleration == b.linear_acceleration
        assert a.orientation == b.orientation and b.orientation_covariance[0] == -1
        assert np.array_equal(a.linear_acceleration_covariance, b.linear_acceleration_covariance)


@pytest.mark.thorough
def test_stamps_that_stand_are_said_and_arrivals_used(ros, stream):
    """All zero from the start, and one stamp after a good stretch: filtered all the same."""
    s = stream()

    def paced(stamps, seed):
        z = noise(len(stamps), seed)
        for t, g in zip(stamps, z):
            s.send([imu(t, g)], wait=False)
            time.sleep(0.005)
        assert wait_for(lambda: len(s.out) == len(stamps)), (len(s.out), s.process.text)
        got = [m.angular_velocity.x for m in s.out[-200:]]
        covariance = [m.angular_velocity_covariance[0] for m in s.out[-200:]]
        assert [ns_of(m) for m in s.out] == list(stamps)
        assert np.std(got) < 0.7 * SIGMA and min(covariance) > 0
        s.out.clear()

    def said():
        told = ros.latest(f'{s.process.full}/innovations', DiagnosticArray, lambda m: values(
            m, 'stream')['samples'] not in ('0', before))
        return next((x.level, x.message) for x in told.status if x.name == 'stream')
    before = '0'
    paced([0] * 400, 1)
    level, text = said()
    assert level == messages.WARN and 'stamps do not advance' in text and 'receive times' in text
    before = s.counts(lambda c: True)['samples']
    paced([START + k * 5_000_000 for k in range(300)], 2)
    assert said()[0] == messages.OK
    before = s.counts(lambda c: True)['samples']
    paced([START + 10 ** 10] * 400, 3)
    assert said()[0] == messages.WARN
    assert s.process.text.count('stamps do not advance') == 1


@pytest.mark.thorough
def test_flaws_of_a_stream_are_handled_and_counted(stream):
    s, z = stream(), noise(400)
    s.send([imu(START + k * 5_000_000, z[k]) for k in range(200)])
    bad = imu(START + 200 * 5_000_000, (float('nan'), 0.0, 0.0))
    absent = imu(START + 201 * 5_000_000, (7.0, 8.0, 9.0))
    absent.angular_velocity_covariance[0] = -1.0
    again = imu(START + 199 * 5_000_000, z[199])
    later = imu(START + 5_000_000_000, z[203])
    back = imu(START, z[204])
    got = s.send([again, bad, absent, later, back], wait=False)
    assert wait_for(lambda: len(s.out) == 204), len(s.out)
    got = s.out[200:]
    assert rate(got[1]) == [7.0, 8.0, 9.0] and got[1].angular_velocity_covariance[0] == -1
    told = s.counts(lambda c: c['resets'] == '1')
    assert {k: told[k] for k in ('samples', 'refused', 'duplicates', 'gaps', 'resets')} == {
        'samples': '203', 'refused': '1', 'duplicates': '1', 'gaps': '1', 'resets': '1'}


@pytest.mark.thorough
def test_parameters_set_while_it_runs(ros, stream):
    s, z = stream(), noise(1200)
    full, k = s.process.full, 0
    for name, value, why in (('alpha', -3.0, 'alpha'), ('motion', 'no_such', 'no_such'),
                             ('motion', ['white'], 'noise effect'), ('noise', ['jerk'], 'motion'),
                             ('model', '/no/study', '/no/study'), ('white.R', -1.0, 'white.R')):
        good, reason = ros.set_parameter(full, name, value)
        assert not good and why in reason, (name, reason)
    for settings in ({'alpha': 0.7}, {'motion': ['constant_rate', 'ar_increment']},
                     {'ar_increment.q': 1e-7, 'white.R': 1e-4}, {'noise': ['white', 'outliers']}):
        for name, value in settings.items():
            assert ros.set_parameter(full, name, value) == (True, '')
        got = s.send([imu(START + (k + j) * 5_000_000, z[k + j]) for j in range(300)])
        k += 300
        assert np.isfinite([rate(m) for m in got]).all()
    told = s.counts(lambda c: c['samples'] == '1200')
    assert told['motion'] == 'constant_rate ar_increment' and told['noise'] == 'white outliers'
    assert int(told['switches']) >= 4


@pytest.mark.thorough
def test_the_filter_of_parameters_is_the_augmented_one(stream):
    """phi, Q and R from parameters: the numbers are those of the Kalman filter's recursion."""
    phi, q, r, alpha = 0.107, 1.2e-7, 1.1e-4, 0.9
    s = stream(**{'motion': ['constant_rate', 'ar_increment'], 'alpha': alpha, 'white.R': r,
                  'ar_increment.phi': phi, 'ar_increment.q': q, 'rate_hz': 100.0})
    z = noise(300)
    got = s.send([imu(START + k * 10_000_000, z[k]) for k in range(300)])
    f, h = np.array([[1, 1], [0, phi]]), np.array([1.0, 0.0])
    x, p, wanted = np.zeros(2), np.diag([1e4, q / (1 - phi ** 2)]), []
    for k, v in enumerate(z[:, 0]):
        if k:
            x, p = f @ x, f @ p @ f.T / alpha + np.diag([0, q])
        gain = p @ h / (h @ p @ h + r)
        x, p = x + gain * (v - h @ x), p - np.outer(gain, h @ p)
        wanted.append(x[0])
    assert np.allclose([m.angular_velocity.x for m in got[50:]], wanted[50:], rtol=1e-4, atol=1e-7)


def test_a_delay_gives_smoothed_rates_under_their_own_stamps(ros, stream):
    settings = {'rate_hz': 200.0, 'delay': 0.05}
    s, z = stream(**settings), noise(600)
    stamps = START + np.arange(600) * 5_000_000
    s.send([imu(t, g) for t, g in zip(stamps[:300], z)], wait=False)
    # what waits for later samples comes out without them when none come
    assert wait_for(lambda: len(s.out) == 300), (len(s.out), s.process.text)
    assert ros.set_parameter(s.process.full, 'delay', 0.0) == (True, '')
    s.send([imu(t, g) for t, g in zip(stamps[300:], z[300:])])
    assert [ns_of(m) for m in s.out] == stamps.tolist()
    engine, causal, wanted = Engine(**settings), [], []
    for t, g in zip(stamps[:300], z):
        causal.append(engine.step(1e-9 * (t - START), g)[1])
        wanted += engine.due()
    engine.finish()
    wanted += engine.due()
    rates = [rate(m) for m in s.out[:300]]
    assert np.allclose(rates, [x for x, _ in wanted], rtol=1e-9, atol=1e-12)
    covariance = np.array([m.angular_velocity_covariance for m in s.out[:300]])[:, [0, 4, 8]]
    assert np.allclose(covariance, [v for _, v in wanted])
    assert np.median(covariance) < 0.9 * np.median(causal)


@pytest.mark.thorough
def test_messages_keep_their_order_where_some_have_no_rate(ros, stream):
    """One without a rate has nothing to wait for but those before it."""
    s, z = stream(rate_hz=200.0, delay=0.1), noise(200)
    stamps = START + np.arange(200) * 5_000_000
    sent = [imu(t, g) for t, g in zip(stamps, z)]
    for m in sent[:100:3] + sent[100:150]:
        m.angular_velocity_covariance[0] = -1.0
    for some in (sent[:160], sent[160:]):
        s.send(some, wait=False)
    assert wait_for(lambda: len(s.out) == 200), (len(s.out), s.process.text)
    assert [ns_of(m) for m in s.out] == stamps.tolist()
    absent = [m.angular_velocity_covariance[0] < 0 for m in sent]
    assert [m.angular_velocity_covariance[0] < 0 for m in s.out] == absent
    kept = np.array([rate(m) == g.tolist() for m, g in zip(s.out, z)])
    known = np.cumsum(~np.array(absent)) > 16           # till then rates pass as they are
    assert kept[absent].all() and not kept[known & ~np.array(absent)].any()
    s.send([imu(stamps[-1] + 5_000_000 * k, g) for k, g in enumerate(z[:10], 1)], wait=False)
    assert ros.trigger(f'{s.process.full}/reset')[0]        # forgets the stream, loses no message
    assert wait_for(lambda: len(s.out) == 210), (len(s.out), s.process.text)


@pytest.mark.thorough
def test_the_loop_finds_the_motion_while_the_stream_goes_on(ros, stream):
    """A filter for constant rates, swayed: the diagnosis names it, adding it halves the error."""
    s = stream(motion=['constant_rate', 'ar_increment'], rate_hz=200.0)

    def call(name):
        return ros.trigger(f'{s.process.full}/{name}')

    def error(got, truth):
        return np.std(np.array([rate(m) for m in got])[:, 0] - truth)
    success, answer = call('compare')
    assert not success and answer['error'] and answer['remedy']
    n, rng = 1500, np.random.default_rng(1)
    true = 0.5 * np.sin(2 * np.pi * 0.5 * np.arange(400 * 50) * 0.005)
    z = true[:, None] + SIGMA * rng.standard_normal((len(true), 3))

    def sway(first, last):
        got = s.send([imu(START + k * 5_000_000, z[k]) for k in range(first, last)])
        return error(got, true[first:last])
    before = sway(0, n)
    asking, answers = threading.Thread(target=lambda: answers.append(call('diagnose'))), []
    asking.start()
    k, while_asking = n, 0
    while asking.is_alive() and k < len(z) - n:
        sway(k, k + 50)                         # comes back, all of it
        k += 50
        while_asking += not answers             # before the answer does
    asking.join()
    assert while_asking > 1
    success, answer = answers[0]
    found = answer['diagnosis']['gyro_x']
    assert success and found['verdict'] == 'missing'
    assert found['ranked'][0]['effect'] == 'harmonic'
    success, answer = call('add_best')
    assert success and {step['added'] for step in answer['added']} == {'harmonic'}
    assert s.counts(lambda c: c['motion'] == 'constant_rate ar_increment harmonic')
    assert sway(k, k + n) < 0.5 * before
    success, answer = call('remove_last')
    assert success and {step['removed'] for step in answer['removed']} == {'harmonic'}
    assert s.counts(lambda c: c['motion'] == 'constant_rate ar_increment')
    first = call('history')[1]['history'][0]
    assert first['effects'] == ['constant_rate', 'ar_increment', 'white']
    assert call('compare')[1]['targets'].keys() == {'gyro_x', 'gyro_y', 'gyro_z'}
    assert call('reset') == (True, {'reset': True})
    assert s.counts(lambda c: c['samples'] == '0')
