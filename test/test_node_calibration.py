# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The real calibration node: six faces by services, then a corrected stream."""

from __future__ import annotations

import signal
import time

import numpy as np
import pytest
import yaml

from nodes_support import DiagnosticArray, Imu, messages, Time, values, wait_for

G = 9.80665
S = np.array([[1.02, 0.004, -0.003], [0.002, 0.985, 0.005], [-0.004, 0.001, 1.01]])
BIAS = np.array([0.12, -0.2, 0.3])
FACES = {f'{"+-"[s]}{"xyz"[k]}': np.eye(3)[k] * (1 - 2 * s) for k in range(3) for s in range(2)}


def stamp_of(k):
    """Return the stamp of message k."""
    sec, nanosec = divmod(1_700_000_000_000_000_000 + k * 5_000_000, 10 ** 9)
    return Time(sec=sec, nanosec=nanosec)


def ns_of(stamp):
    """Return a stamp in ns."""
    return stamp.sec * 10 ** 9 + stamp.nanosec


class Bench:
    """An IMU in a node's hand: stamps advance by what is played, not by the clock."""

    def __init__(self, ros, **parameters):
        self.ros, self.ns = ros, ros.namespace()
        self.node = ros.start('calibration', self.ns, **parameters)
        ros.ready(self.node)
        self._publisher = ros.publisher(f'{self.ns}/imu/data_raw', Imu)
        self._listening = ros.listening(f'{self.node.full}/calibration', DiagnosticArray, True)
        self._told = self._listening.__enter__()
        self._k, self._rng = 0, np.random.default_rng(2)

    def close(self):
        """End listening, and the node, as it ends on Ctrl-C; return its status."""
        self._listening.__exit__(None, None, None)
        return self.node.stop(signal.SIGINT)[1]

    def play(self, accel, gyro):
        """Publish a stretch at 200 Hz, true inputs (n, 3), and wait until the node has it."""
        message = Imu()
        message.header.frame_id, message.orientation_covariance[0] = 'imu_link', -1.0
        for a, w in zip(accel, gyro):
            message.header.stamp = stamp_of(self._k)
            m, v = S @ a + BIAS + 0.01 * self._rng.standard_normal(3), message.linear_acceleration
            v.x, v.y, v.z = m.tolist()
            m, v = w + 0.001 * self._rng.standard_normal(3), message.angular_velocity
            v.x, v.y, v.z = m.tolist()
            self._publisher.publish(message)
            self._k += 1
        self._told[:] = self._told[-1:]
        self.ros.heard(self._told, lambda m: int(values(m, 'session')['samples']) == self._k)

    @property
    def sent(self):
        """How many messages were sent."""
        return self._k

    def rest(self, direction, seconds=4.0):
        """Hold a direction up."""
        n = int(200 * seconds)
        self.play(np.tile(G * np.asarray(direction), (n, 1)), np.zeros((n, 3)))

    def move(self, seconds=4.0):
        """Rock about y."""
        t = np.arange(int(200 * seconds)) * 0.005
        tilt, zero = 0.5 * np.sin(3 * t), np.zeros_like(t)
        self.play(G * np.column_stack([np.sin(tilt), zero, np.cos(tilt)]),
                  np.column_stack([zero, -1.5 * np.cos(3 * t), zero]))

    def call(self, name):
        """Call a service."""
        return self.ros.trigger(f'{self.node.full}/{name}')


@pytest.fixture(scope='module')
def solved(tmp_path_factory, ros_session):
    """Return a bench whose node has gone through all six faces, and what it answered."""
    ros = ros_session
    file = tmp_path_factory.mktemp('calibrations') / 'unit.yaml'
    bench = Bench(ros, file=str(file))
    bench.file = file
    answers = {name: bench.call(name) for name in ('capture', 'solve', 'diagnose', 'save')}
    bench.move()
    answers['moving'] = bench.call('capture')
    for name, direction in FACES.items():
        bench.rest(direction)
        answers[name] = bench.call('capture')
        if name == '-y':
            answers['early'] = bench.call('solve')
    answers['solved'] = bench.call('solve')
    yield bench, answers
    bench.close()


@pytest.fixture
def keep(ros_session):
    """Keep the node of the module when a test's other nodes are ended."""
    before = list(ros_session.processes)
    yield ros_session
    ros_session.end(p for p in list(ros_session.processes) if p not in before)
    ros_session.processes[:] = before


def test_each_call_at_the_wrong_time_is_refused_with_a_remedy(solved):
    _, answers = solved
    for name in ('capture', 'solve', 'diagnose', 'save', 'moving', 'early'):
        success, answer = answers[name]
        assert not success and answer['error'] and answer['remedy'], name
    assert 'moving' in answers['moving'][1]['error']
    assert '+z' in answers['early'][1]['error'] and '-z' in answers['early'][1]['error']


def test_captures_say_which_face_was_seen_and_which_are_left(solved):
    _, answers = solved
    for k, name in enumerate(FACES):
        success, answer = answers[name]
        assert success and answer['held'] == name and (answer['done'], answer['of']) == (k + 1, 6)
        assert answer['left'] == [f for f in ('+x', '-x', '+y', '-y', '+z', '-z')
                                  if f in list(FACES)[k + 1:]]


@pytest.mark.thorough
def test_monitors_see_how_it_is(solved):
    """The session is stale where nothing comes; the sensor is as its solution is."""
    bench, _ = solved
    name = f'{bench.node.full[1:]}: '
    with bench.ros.listening('/diagnostics', DiagnosticArray) as got:
        def told():
            return {s.name.partition(': ')[2]: s for m in got[-4:] for s in m.status
                    if s.name.startswith(name)}

        assert wait_for(lambda: told() and told()['session'].level == messages.STALE), got[-1:]
        seen = told()
    assert set(seen) == {'session', 'accel'} and seen['accel'].level == messages.OK
    assert {s.hardware_id for s in seen.values()} == {'imu_link'}
    assert 'nothing comes' in seen['session'].message


def test_the_solution_is_right_published_and_in_the_answer(solved):
    bench, answers = solved
    success, answer = answers['solved']
    assert success and np.allclose(answer['S'], S, atol=2e-3)
    assert np.allclose(answer['bias'], BIAS, atol=5e-3)
    told = bench.ros.latest(f'{bench.node.full}/calibration', DiagnosticArray,
                            lambda m: values(m, 'accel'))
    found = values(told, 'accel')
    assert float(found['S_xy [1]']) == pytest.approx(answer['S'][0][1], rel=1e-12)
    assert float(found['bias_z [m/s^2]']) == pytest.approx(answer['bias'][2], rel=1e-12)
    assert values(told, 'session')['captured'] == '6'


def test_the_stream_is_corrected_and_else_as_it_was(solved, keep):
    bench, _ = solved
    direction = np.array([0.6, 0.0, 0.8])
    with keep.listening(f'{bench.ns}/imu/data_calibrated', Imu) as got:
        keep.flowing(got, lambda: bench.rest(direction, 0.005))
        before = bench.sent
        bench.rest(direction, 3.0)
        assert wait_for(lambda: got[-1].header.stamp == stamp_of(bench.sent - 1))
        got = [m for m in got if ns_of(m.header.stamp) >= ns_of(stamp_of(before))]
    assert len(got) == 600
    accel = np.array([[m.linear_acceleration.x, m.linear_acceleration.y, m.linear_acceleration.z]
                      for m in got])
    assert np.abs(accel.mean(0) - G * direction).max() < 0.01
    assert got[0].header.frame_id == 'imu_link' and got[0].orientation_covariance[0] == -1
    steps = np.diff([ns_of(m.header.stamp) for m in got])
    assert np.all(steps == 5_000_000)


def test_the_loop_answers(solved):
    bench, _ = solved
    success, answer = bench.call('diagnose')
    assert success and answer['diagnosis']['accel']['verdict'] in (
        'complete', 'undecidable', 'missing', 'unknown')
    for name, key in (('compare', 'targets'), ('history', 'history'), ('add_best', 'added'),
                      ('remove_last', 'removed')):
        success, answer = bench.call(name)
        assert success and key in answer, name


@pytest.mark.thorough
def test_saved_loaded_and_reset(solved, keep):
    bench, _ = solved
    success, answer = bench.call('save')
    assert answer == {'summary': f'written to {bench.file}', 'file': str(bench.file)}
    data = yaml.safe_load(bench.file.read_text())
    assert success and np.allclose(np.array(data['G'])[:, :3], S, atol=2e-3)
    other = Bench(keep, file=answer['file'])
    with keep.listening(f'{other.ns}/imu/data_calibrated', Imu) as got:
        keep.flowing(got, lambda: other.rest([0, 0, 1], 0.005))
        other.rest([0, 0, 1], 0.5)
        last = stamp_of(other.sent - 1)
        assert wait_for(lambda: got[-1].header.stamp == last)
        assert np.mean([m.linear_acceleration.z for m in got]) == pytest.approx(G, abs=0.01)
        assert other.call('reset') == (True, {'reset': True})
        other.rest([0, 0, 1], 0.5)
        time.sleep(0.5)                                 # what should not come would by now
        assert got[-1].header.stamp == last
    assert other.close() == 0


def test_a_solution_not_saved_is_saved_on_a_signal(solved):
    """Run last: it ends the node."""
    bench, _ = solved
    assert bench.call('solve')[0]
    before = set(bench.file.parent.glob('*.yaml'))
    assert bench.node.stop(signal.SIGTERM)[1] == 0
    saved, = set(bench.file.parent.glob('*.yaml')) - before
    data = yaml.safe_load(saved.read_text())
    assert np.allclose(data['S'], S, atol=2e-3)


@pytest.mark.thorough
def test_stamps_that_stand_still_are_captured_by_arrival(keep):
    """A driver that stamps nothing can be calibrated with, and is told of."""
    ros, space = keep, keep.namespace()
    node = ros.start('calibration', space)
    ros.ready(node)
    publisher = ros.publisher(f'{space}/imu/data_raw', Imu)
    assert wait_for(lambda: publisher.get_subscription_count() == 1)
    message = Imu()
    for x, y in np.random.default_rng(8).normal(0, 0.01, (350, 2)).tolist():
        message.angular_velocity.x, message.linear_acceleration.z = x, G + y
        publisher.publish(message)
        time.sleep(0.01)
    success, answer = ros.trigger(f'{node.full}/capture')
    assert success and answer['held'] == '+z', answer
    assert node.text.count('the stamps do not advance') == 1
