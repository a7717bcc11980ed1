# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Real bag_reader and analyser nodes in real processes."""

from __future__ import annotations

import contextlib
import signal
import subprocess
import sys
import time

from camera import ACCEL, camera_bag, GYRO
import numpy as np
from params import daily
import pytest

from imu_noise_tools.bag import open_record
from imu_noise_tools.bag.writing import write_bag
from imu_noise_tools.core.record import AXES, ImuRecord
from imu_noise_tools.noise.behind import model_avar
from imu_noise_tools.store import load, study_to_dict
from imu_noise_tools.tasks.noise import analyse_record
from nodes_support import (
    Clock,
    DiagnosticArray,
    Float64MultiArray,
    Image,
    Imu,
    messages,
    PATIENCE,
    values,
    wait_for,
)

COUNT = 44930               # messages of mpu6050_static_449s
SAME = 1e-9


@pytest.fixture(scope='module')
def static_bag(shared_data):
    """Return a real recording at rest."""
    return shared_data / 'bags' / 'mpu6050_static_449s'


@pytest.fixture(scope='module')
def static_study(static_bag):
    """Return its study, by the functions of the command line."""
    return analyse_record(open_record(static_bag))


@pytest.fixture(scope='module')
def small_bag(tmp_path_factory):
    """Write a minute of white noise, with a vibration on gyro_x; return the bag and its record."""
    rng, n = np.random.default_rng(3), 6000
    t = np.arange(n) / 100
    gyro = 1e-3 * rng.standard_normal((n, 3))
    gyro[:, 0] += 8e-4 * np.sin(2 * np.pi * 7.3 * t)
    accel = 0.02 * rng.standard_normal((n, 3)) + [0, 0, 9.81]
    record = ImuRecord(gyro, accel, t, 100.0, start=1.7e9, frame_id='imu_link')
    path = tmp_path_factory.mktemp('bags') / 'small'
    write_bag(path, record)
    return path, record


@contextlib.contextmanager
def busy():
    """Keep every core busy, for no longer than this process lives."""
    code = 'import os\nparent = os.getppid()\nwhile os.getppid() == parent:\n    pass'
    hogs = [subprocess.Popen([sys.executable, '-c', code]) for _ in range(3)]
    try:
        yield
    finally:
        for hog in hogs:
            hog.kill()
            hog.wait()


def status(ros, namespace, such=lambda told: True):
    """Return what the analyser says of its input, once it is such."""
    return status_after(ros, namespace, 0, such)


def status_after(ros, namespace, stamp_ns, such):
    """Return what the analyser says of its input, once it is such at a time after the stamp."""
    def good(message):
        stamp = message.header.stamp
        return stamp.sec * 10**9 + stamp.nanosec > stamp_ns and such(values(message, 'analyser'))
    message = ros.latest(f'{namespace}/analyser/status', DiagnosticArray, good)
    return values(message, 'analyser')


def player(ros, namespace, bag, **parameters):
    """Start a bag_reader that does not play to nobody, however long finding takes."""
    return ros.start('bag_reader', namespace, bag=str(bag), wait_for_subscribers=600.0,
                     **parameters)


def coefficients(ros, namespace):
    """Return the numbers of each axis by their keys, and what is said of the record."""
    message = ros.latest(f'{namespace}/analyser/coefficients', DiagnosticArray,
                         lambda m: len(m.status) > 1, 2 * PATIENCE)     # else there is no result
    return {axis: {k.partition(' [')[0]: float(v) for k, v in values(message, axis).items()
                   if ' [' in k} for axis in AXES}, values(message, 'record')


def assert_as_computed(found, study):
    """Compare what was published with a study made by the functions of the command line."""
    for axis, entry in study_to_dict(study)['targets'].items():
        for label, effect in entry['effects'].items():
            for name, e in effect.items():
                if isinstance(e, dict) and e['value'] is not None:
                    assert found[axis][name] == pytest.approx(e['value'], rel=SAME), (axis, label)
                    assert found[axis][f'{name}_std'] == pytest.approx(e['std'], rel=1e-6)
                elif isinstance(e, dict):
                    assert name not in found[axis]


@pytest.mark.thorough
def test_every_message_arrives_twice_in_a_row_while_the_machine_is_busy(
        ros, static_bag, static_study):
    """
    Every message of a real bag is used, and the numbers are those of the command line.

    It is busy while messages come: what is computed of them does not go with that.

    """
    ns = ros.namespace()
    analyser = ros.start('analyser', ns, input='messages')
    ros.ready(analyser)
    with busy():
        reader = player(ros, ns, static_bag, publish='messages')
        status(ros, ns, lambda told: int(told['samples']) == COUNT)
    found, about = coefficients(ros, ns)
    assert int(about['samples']) == COUNT and about['complete'] == 'true'
    assert_as_computed(found, static_study)
    with busy():
        assert ros.trigger(f'{reader.full}/restart') == (True, {'restarted': True})
        assert wait_for(lambda: 'the record begins again' in analyser.text), analyser.text
        told = status_after(ros, ns, time.time_ns(), lambda s: int(s['samples']) == COUNT)
    assert told['missed'] == told['refused'] == '0' and told['complete'] == 'true'
    for axis, state in static_study.states.items():
        c = state.problem.evidence.curve
        message = ros.latest(f'{ns}/analyser/allan/{axis}', Float64MultiArray,
                             lambda m: messages.rows_of(m)[0] == 'analysed')
        _, columns, rows = messages.rows_of(message)
        assert columns[:5] == ['tau', 'adev', 'lo', 'hi', 'model']
        model = np.sqrt(model_avar(state.model, c.m, c.dt))
        logs = np.log10(c.tau), np.log10(c.dev)
        wanted = np.column_stack([c.tau, c.dev, c.lo, c.hi, model, *logs])
        assert np.allclose(rows, wanted, rtol=SAME, atol=0)


@pytest.mark.parametrize('kind', daily(['buffer', 'messages']))
def test_a_cameras_sensors_are_analysed_each_at_its_own_rate(ros, tmp_path, kind):
    """From a bag by blocks, and live from two topics: as the command line does it."""
    bag = camera_bag(tmp_path / 'camera.mcap', seconds=120.0)
    ns = ros.namespace()
    live = {'accel_topic': 'camera/accel'} if kind == 'messages' else {}
    analyser = ros.start('analyser', ns, input=kind, **live)
    ros.ready(analyser)
    if kind == 'buffer':
        player(ros, ns, bag, publish='buffer')
    else:
        for name, topic, to in (('of_gyro', GYRO, 'imu/data_raw'),
                                ('of_accel', ACCEL, 'camera/accel')):
            player(ros, ns, bag, publish='messages', topic=topic,
                   remaps={'imu/data_raw': to, '__node': name})
        assert wait_for(lambda: int(status(ros, ns)['samples']) == 24000 + 7560)
        assert ros.trigger(f'{analyser.full}/analyse')[0]
    found, about = coefficients(ros, ns)
    assert about['complete'] == 'true' and about['missed'] == '0'
    assert_as_computed(found, analyse_record(open_record(bag, apart=True)))
    assert ros.trigger(f'{analyser.full}/save')[0]
    folder = analyser.folder / 'analyser.study'
    assert {'gyro.npz', 'accel.npz'} < {p.name for p in folder.iterdir()}
    assert open_record(folder / 'accel.npz').n == 7560


@pytest.mark.thorough
def test_the_loop_over_services(ros, small_bag):
    """Refusals before there is anything; then the whole loop, save and reset."""
    bag, record = small_bag
    ns = ros.namespace()
    analyser = ros.start('analyser', ns, input='buffer', effects=['white'])
    ros.ready(analyser)
    base = analyser.full

    def call(name):
        return ros.trigger(f'{base}/{name}')

    def steps(answer, what):
        return [s[what] for s in answer if s['target'] == 'gyro_x']
    for name in ('analyse', 'compare', 'diagnose', 'add_best', 'remove_last', 'history', 'save'):
        success, answer = call(name)
        assert not success and answer['error'] and answer['remedy'], name
        assert answer['summary'] == f'{answer["error"]}: {answer["remedy"]}'
    none = ros.latest(f'{base}/coefficients', DiagnosticArray)
    assert [s.level for s in none.status] == [messages.ERROR]
    player(ros, ns, bag, publish='buffer')
    found, about = coefficients(ros, ns)
    assert int(about['samples']) == record.n and about['complete'] == 'true'
    assert_as_computed(found, analyse_record(open_record(bag), effects=('white',)))
    success, answer = call('analyse')
    assert success and answer['source']['samples'] == record.n
    assert answer['source']['path'] == str(bag) and answer['source']['topic'] == '/imu/data_raw'
    assert answer['source']['frame_id'] == 'imu_link'
    success, answer = call('compare')
    before = answer['targets']['gyro_x']['held_out']
    assert success and not answer['targets']['gyro_x']['within_chance']
    success, answer = call('diagnose')
    found = answer['diagnosis']['gyro_x']
    assert success and (found['verdict'], found['ranked'][0]['effect']) == ('missing', 'sinusoid')
    assert 'parameters' in found['found'][0] and 'parameters' not in found['ranked'][0]
    assert '~/save' in answer['more']
    told = values(ros.latest(f'{base}/diagnosis', DiagnosticArray,
                             lambda m: values(m, 'gyro_x')), 'gyro_x')
    assert told['verdict'] == 'missing' and told['best'] == 'sinusoid'
    success, answer = call('add_best')
    assert success and steps(answer['added'], 'added') == ['sinusoid']
    assert call('compare')[1]['targets']['gyro_x']['held_out'] < 0.2 * before
    found, _ = coefficients(ros, ns)
    assert found['gyro_x']['sinusoid.frequency'] == pytest.approx(7.3, abs=0.01)
    success, answer = call('save')
    folder = analyser.folder / 'analyser.study'
    assert success and answer == {'summary': f'written to {folder}', 'folder': str(folder)}
    assert {'study.yaml', 'imu.yaml', 'allan.csv', 'allan.png', 'report.html', 'evidence.npz',
            'samples.npz'} == {p.name for p in folder.iterdir()}
    saved = open_record(folder / 'samples.npz')
    assert np.array_equal(saved.gyro, record.gyro) and np.array_equal(saved.accel, record.accel)
    success, answer = call('remove_last')
    assert success and steps(answer['removed'], 'removed') == ['sinusoid']
    ladder = call('history')[1]['history']
    assert steps(ladder, 'effects') == [['white'], ['white', 'sinusoid'], ['white']]
    picture = ros.latest(f'{base}/plot', Image)
    assert picture.encoding == 'rgb8' and len(picture.data) == picture.height * picture.width * 3
    assert np.ptp(np.frombuffer(picture.data, np.uint8)) > 100
    assert call('reset') == (True, {'reset': True})
    assert not call('compare')[0]


@pytest.mark.thorough
def test_effects_change_while_it_runs_and_a_wrong_one_is_refused(ros, small_bag):
    ns = ros.namespace()
    analyser = ros.start('analyser', ns, input='buffer', effects=['white'])
    ros.ready(analyser)
    player(ros, ns, small_bag[0], publish='buffer')
    coefficients(ros, ns)
    good, reason = ros.set_parameter(analyser.full, 'effects', ['white', 'no_such_effect'])
    assert not good and 'no_such_effect' in reason and 'white' in reason
    assert not ros.set_parameter(analyser.full, 'effects', [''])[0]
    assert ros.set_parameter(analyser.full, 'update_period', 0.5) == (True, '')
    assert ros.set_parameter(analyser.full, 'effects', ['white', 'random_walk']) == (True, '')
    message = ros.latest(f'{analyser.full}/coefficients', DiagnosticArray, lambda m: any(
        s.name == 'gyro_y' and s.message == 'white + random_walk' for s in m.status))
    assert 'K_upper95 [rad/s^2/sqrt(Hz)]' in values(message, 'gyro_y')
    for name, value, why in (('update_period', -1.0, 'range'), ('method', 'guess', 'one of'),
                             ('input', 'messages', 'read-only'), ('effects', 3, 'list of names')):
        good, reason = ros.set_parameter(analyser.full, name, value)
        assert not good and why in reason.lower(), (name, reason)


def blocks_of(n=4096, size=512):
    """Return blocks of a record of white noise."""
    rng = np.random.default_rng(1)
    stamps = 1_700_000_000_000_000_000 + np.arange(n) * 10_000_000
    data = rng.standard_normal((n, 6))
    return [messages.block(k, stamps[k:k + size], data[k:k + size, :3], data[k:k + size, 3:])
            for k in range(0, n, size)]


def test_a_missing_block_is_named_and_the_result_not_called_complete(ros):
    ns = ros.namespace()
    analyser = ros.start('analyser', ns, input='buffer')
    ros.ready(analyser)
    publisher = ros.publisher(f'{ns}/imu/buffer', Float64MultiArray)
    blocks = blocks_of()
    bad = messages.table(np.zeros((3, 2)), ['a', 'b'], 'first:0')
    for message in (*blocks[:3], bad, *blocks[4:]):
        publisher.publish(message)
    told = status(ros, ns, lambda s: int(s['samples']) == 4096 - 512 and s['refused'] == '1')
    assert told['missed'] == '512' and told['complete'] == 'false'
    assert wait_for(lambda: '512 samples are missing before sample 2048' in analyser.text)
    for message in blocks:                              # the record begins again, and is whole now
        publisher.publish(message)
    told = status(ros, ns, lambda s: int(s['samples']) == 4096)
    assert told['missed'] == '0' and told['complete'] == 'true'


@pytest.mark.thorough
def test_live_curves_come_while_data_do_and_buffers_have_an_end(ros):
    """A best-effort publisher is heard, the curve is refreshed, and says that it is a live one."""
    ns = ros.namespace()
    analyser = ros.start('analyser', ns, update_period=0.5, buffer_hours=0.002)        # 7.2 s
    ros.ready(analyser)
    publisher = ros.publisher(f'{ns}/imu/data_raw', Imu, reliable=False)
    rng, message = np.random.default_rng(1), Imu()
    with ros.listening(f'{ns}/analyser/allan/gyro_x', Float64MultiArray) as curves, \
            ros.listening(f'{ns}/analyser/status', DiagnosticArray, latched=True) as heard:

        def told():
            return values(heard[-1], 'analyser') if heard else {'samples': 0}

        # what is sent before the node has found that its publisher is a best-effort one is lost
        end, k = time.monotonic() + PATIENCE, 0
        while time.monotonic() < end and (len(curves) < 4 or int(told()['samples']) <= 2000):
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(k * 5_000_000, 10 ** 9)
            message.angular_velocity.x, message.angular_velocity.y, \
                message.angular_velocity.z = rng.standard_normal(3)
            message.linear_acceleration.z = 9.8 + rng.standard_normal()
            message.linear_acceleration.x, message.linear_acceleration.y = rng.standard_normal(2)
            publisher.publish(message)
            k += 1
            time.sleep(0.002)
        assert len(curves) >= 4 and int(told()['samples']) > 2000
        assert int(told()['held']) < 1800 and told()['complete'] == 'false'
        label, _, rows = messages.rows_of(curves[-1])
    assert label.startswith('live') and rows[0, 1] == pytest.approx(1.0, rel=0.1)
    assert 'best-effort' in analyser.text


@pytest.mark.thorough
def test_stamps_that_stand_are_said_and_arrivals_used(ros):
    ns = ros.namespace()
    analyser = ros.start('analyser', ns)
    ros.ready(analyser)
    publisher = ros.publisher(f'{ns}/imu/data_raw', Imu)
    rng, message, begin = np.random.default_rng(1), Imu(), time.monotonic()
    for k in range(1200):
        message.angular_velocity.x, message.angular_velocity.y, \
            message.angular_velocity.z = 1e-3 * rng.standard_normal(3)
        publisher.publish(message)
        time.sleep(max(0.0, begin + 0.005 * k - time.monotonic()))
    status(ros, ns, lambda s: int(s['samples']) == 1200)
    success, answer = ros.trigger(f'{analyser.full}/analyse')
    assert success, answer
    assert answer['source']['rate_hz'] == pytest.approx(200, rel=0.02)
    assert any('receive times are used' in w for w in answer['source']['warnings'])
    assert analyser.text.count('receive times are used') == 1


def test_what_was_gathered_is_saved_on_a_signal(ros):
    ns = ros.namespace()
    analyser = ros.start('analyser', ns, input='buffer', output_dir='here.study')
    ros.ready(analyser)
    publisher = ros.publisher(f'{ns}/imu/buffer', Float64MultiArray)
    for message in blocks_of():
        publisher.publish(message)
    status(ros, ns, lambda s: int(s['samples']) == 4096)
    (analyser.folder / 'here.study').mkdir()                    # what is there stays
    assert analyser.stop(signal.SIGTERM)[1] == 0, analyser.text
    assert open_record(analyser.folder / 'here.2.study' / 'samples.npz').n == 4096
    assert not list((analyser.folder / 'here.study').iterdir())


@pytest.mark.thorough
def test_two_namespaces_do_not_mix(ros, small_bag, tmp_path):
    path, record = small_bag
    write_bag(tmp_path / 'part', record.part(0, 4000))
    spaces = {ros.namespace(): (path, 6000), ros.namespace(): (tmp_path / 'part', 4000)}
    nodes = [ros.start('analyser', ns, input='messages') for ns in spaces]
    ros.ready(*nodes)
    for ns, (bag, _) in spaces.items():
        player(ros, ns, bag, publish='messages')
    for ns, (_, count) in spaces.items():
        _, about = coefficients(ros, ns)
        assert int(about['samples']) == count


@pytest.mark.thorough
def test_playing_keeps_stamps_paces_pauses_and_tells(ros, small_bag):
    """Slowly until it is paused, so that there is something left however late that comes."""
    bag, record = small_bag
    ns = ros.namespace()
    with ros.listening(f'{ns}/imu/data_raw', Imu) as got, \
            ros.listening('/clock', Clock) as clock:
        reader = player(ros, ns, bag, publish='messages', speed=0.05, start=5, duration=20.0,
                        clock=True)
        assert wait_for(lambda: len(got) > 3), reader.text
        assert ros.trigger(f'{reader.full}/pause')[1]['paused'] is True

        def told(such):
            message = ros.latest(f'{reader.full}/status', DiagnosticArray,
                                 lambda m: such(values(m, 'bag_reader')))
            return values(message, 'bag_reader')
        told(lambda s: s['state'] == 'paused')
        assert ros.set_parameter(reader.full, 'speed', 3.0) == (True, '')
        time.sleep(1.0)                                     # one message, if it did not pause
        held = len(got)
        time.sleep(1.0)                                     # now it would be three hundred
        assert len(got) < held + 10 < 2000
        began = time.monotonic()
        assert ros.trigger(f'{reader.full}/pause')[1]['paused'] is False
        at_end = told(lambda s: s['state'] == 'end')
        assert at_end['samples'] == '2000'
        assert float(at_end['position [s]']) == pytest.approx(24.99)
        assert wait_for(lambda: len(got) == 2000)
        # never faster than it should; how much slower is the machine's affair
        assert (2000 - held) / 100 / (time.monotonic() - began) < 3.1
        stamps = [m.header.stamp.sec * 10 ** 9 + m.header.stamp.nanosec for m in got]
        wanted = 1_700_000_000_000_000_000 + np.round((record.t[500:2500]) * 1e9).astype(int)
        assert np.abs(np.array(stamps) - wanted).max() < 1000
        rates = [[m.angular_velocity.x, m.angular_velocity.y, m.angular_velocity.z] for m in got]
        assert np.array_equal(rates, record.gyro[500:2500])
        assert got[0].header.frame_id == 'imu_link' and got[0].orientation_covariance[0] == -1
        assert wait_for(lambda: len(clock) > 3)
        assert clock[0].clock.sec >= 1_700_000_005


def test_a_bag_that_cannot_be_read_ends_with_one_line(ros, shared_data):
    ns = ros.namespace()
    bags = shared_data / 'bags'
    cases = [({'bag': '/no/such/bag'}, 'no such file'), ({}, 'bag:=PATH'),
             ({'bag': str(bags / 'mpu6050_static_449s'), 'topic': '/other'}, '/imu/data_raw'),
             ({'bag': str(bags / 'mpu6050_static_449s'), 'speed': -1.0}, 'speed')]
    for process, (_, why) in [(ros.start('bag_reader', ns, **p), (p, w)) for p, w in cases]:
        assert process.end() == 1
        lines = process.lines
        assert len(lines) == 1 and lines[0].startswith('error: ') and why in lines[0], process.text


@pytest.mark.thorough
def test_loops_begin_again_and_present_stamps_can_be_had(ros, small_bag):
    ns, began = ros.namespace(), time.time()
    with ros.listening(f'{ns}/imu/data_raw', Imu, raw=True) as got, \
            ros.listening(f'{ns}/imu/buffer', Float64MultiArray) as blocks:
        reader = player(ros, ns, small_bag[0], loop=True, stamps='now', duration=42.0)
        assert wait_for(lambda: len(got) > 4200 and len(blocks) > 4, 2 * PATIENCE), reader.text
        # of the present, not of the record (2023); the clock may be set meanwhile
        assert messages.rate_of(got[0])[0] * 1e-9 > began - 3600
        some = blocks[:]
        firsts = [b.layout.dim[0].label for b in some]
        k = firsts.index('first:0')     # what was sent before it found its second listener is lost
        assert k < 2
        assert firsts[k:k + 4] == ['first:0', 'first:4096', 'first:0', 'first:4096']
        assert [d.size for d in some[k + 1].layout.dim] == [4200 - 4096, 7]
        assert ros.set_parameter(reader.full, 'loop', False) == (True, '')


@pytest.mark.thorough
def test_a_bag_goes_to_the_analyser_whoever_else_listens(ros, small_bag):
    """With a listener there first, the reader waits for the one that is named, and says so."""
    bag, record = small_bag
    ns = ros.namespace()
    with ros.listening(f'{ns}/imu/buffer', Float64MultiArray):
        reader = ros.start('bag_reader', ns, bag=str(bag), publish='buffer',
                           wait_for_subscribers=1.0, readers=['analyser'])
        ros.ready(reader)
        assert wait_for(lambda: f'waiting for {ns}/analyser' in reader.text), reader.text
        analyser = ros.start('analyser', ns, input='buffer', exit_at_end=True)
        assert analyser.end() == 0, analyser.text
        assert 'end of bag' in reader.text and f'{ns}/analyser' in reader.text
    folder = analyser.folder / 'analyser.study'
    names = {p.name for p in folder.iterdir()}
    assert names >= {'study.yaml', 'imu.yaml', 'allan.csv', 'allan.png', 'report.html',
                     'evidence.npz'}
    study = load(folder)
    assert study.source['samples'] == record.n
    told = [x for x in analyser.lines if '[analyser]' in x and 'INFO' in x][-4:]
    for line, word in zip(told, (f'{record.n} samples', 'gyro', 'accel', str(folder))):
        assert word in line, analyser.text


@pytest.mark.thorough
def test_a_bag_of_which_nothing_arrived_is_not_complete(ros, small_bag):
    """A bag that was played before the analyser came: said, not complete, and status 1."""
    bag, _ = small_bag
    ns = ros.namespace()
    reader = ros.start('bag_reader', ns, bag=str(bag), publish='buffer', wait_for_subscribers=0.0)
    ros.ready(reader)
    assert wait_for(lambda: 'end of bag' in reader.text), reader.text
    analyser = ros.start('analyser', ns, input='buffer')
    told = status(ros, ns)
    assert told['samples'] == '0' and told['complete'] == 'false'
    assert wait_for(lambda: '6000 of 6000 samples did not arrive' in analyser.text), analyser.text
    again = ros.start('analyser', ns, {'__node': 'second'}, input='buffer', exit_at_end=True)
    assert again.end() == 1, again.text
