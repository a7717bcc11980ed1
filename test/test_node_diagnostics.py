# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What monitors and shells see of real nodes: /diagnostics, levels, answers of services."""

from __future__ import annotations

from dataclasses import replace
import subprocess
import sys
import time

import bad_input
import numpy as np
import pytest
import yaml

from imu_noise_tools.bag import write_bag
from imu_noise_tools.loop.effect import Estimate, registry
from imu_noise_tools.nodes import answers
from imu_noise_tools.nodes.times import ARRIVALS
from imu_noise_tools.store import estimate_to_dict
from nodes_support import (DiagnosticArray, Imu, messages, ROOT, Temperature, Trigger, values,
                           wait_for)

FRAME = 'imu_left'


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    """Return a bag in which gyro_y vibrates and gyro_z gives nothing."""
    record = bad_input.still(70)
    record.gyro[:, 1] += 0.02 * np.sin(2 * np.pi * 5 * record.t)
    record.gyro[:, 2] = 0.25
    path = tmp_path_factory.mktemp('diagnostics') / 'bag'
    write_bag(path, replace(record, frame_id=FRAME))
    return path


def of(got, node):
    """Return the last statuses of a node by their names, without its own."""
    mine = [m for m in got if all(s.name.startswith(f'{node.full[1:]}: ') for s in m.status)]
    return {s.name.partition(': ')[2]: s for s in mine[-1].status} if mine else {}


def level(got, node, name):
    status = of(got, node).get(name)
    return None if status is None else status.level


@pytest.mark.thorough
def test_monitors_see_how_an_imu_is(ros, bag):
    """Stale before anything comes; then a level for each axis, and the frame as hardware."""
    space = ros.namespace()
    analyser = ros.start('analyser', space, input='messages')
    filtering = ros.start('filter', space)
    ros.ready(analyser, filtering)
    with ros.listening('/diagnostics', DiagnosticArray) as got:
        for node, name in ((analyser, 'input'), (filtering, 'stream')):
            assert wait_for(lambda: level(got, node, name) == messages.STALE), got[-1:]
        reader = ros.start('bag_reader', space, bag=str(bag), publish='messages',
                           readers=['analyser', 'filter'])
        assert wait_for(lambda: level(got, analyser, 'gyro_y') is not None), analyser.text
        seen = of(got, analyser)
        assert {n: s.level for n, s in seen.items()} == {
            'input': messages.OK, 'record': messages.OK, 'gyro_x': messages.OK,
            'gyro_y': messages.WARN, 'gyro_z': messages.ERROR, 'accel_x': messages.OK,
            'accel_y': messages.OK, 'accel_z': messages.OK}
        assert {s.hardware_id for s in seen.values()} == {FRAME}
        assert 'beyond chance' in seen['gyro_y'].message
        assert 'never changes' in seen['gyro_z'].message
        assert any(v.key.startswith('N [') for v in seen['gyro_x'].values)
        coefficients = ros.latest(f'{analyser.full}/coefficients', DiagnosticArray)
        assert {s.name: s.level for s in coefficients.status} == {
            n: s.level for n, s in seen.items() if n != 'input'}
        # the bag is at its end: the analyser waits for nothing, the filter does not know
        assert wait_for(lambda: level(got, filtering, 'stream') == messages.STALE)
        assert level(got, analyser, 'input') == messages.OK
        assert of(got, filtering)['gyro_x'].hardware_id == FRAME
        assert {'stream', 'gyro_x', 'gyro_y', 'gyro_z'} == set(of(got, filtering))
        pace = [m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec for m in got
                if m.status[0].name.startswith(analyser.full[1:])]
        assert 0.8 < np.median(np.diff(pace)) < 1.5

    answer = ros.call(f'{analyser.full}/compare', Trigger, Trigger.Request())
    # as ros2 service call prints it
    assert '\\n' not in repr(answer) and answer.message.startswith('{summary: ')
    said = yaml.safe_load(answer.message)
    assert said['summary'] == 'beyond chance: gyro_y'
    assert said['targets']['gyro_x']['within_chance'] is True
    done = subprocess.run(
        [sys.executable, '-m', 'imu_noise_tools.nodes.trigger', f'{analyser.full}/history'],
        capture_output=True, text=True, timeout=200, cwd=ROOT)
    assert done.returncode == 0 and done.stdout.startswith('summary: 5 models were tried')
    assert len(done.stdout.splitlines()) > 5
    ros.end([reader, analyser, filtering])


def test_no_result_is_an_error(ros):
    space = ros.namespace()
    analyser = ros.start('analyser', space)
    ros.ready(analyser)
    good, said = ros.trigger(f'{analyser.full}/analyse')
    assert not good and said['summary'] == f'{said["error"]}: {said["remedy"]}'
    status = ros.latest(f'{analyser.full}/coefficients', DiagnosticArray)
    assert [s.level for s in status.status] == [messages.ERROR]
    assert 'nothing was received' in status.status[0].message
    assert values(status, 'record')['samples'] == '0'


@pytest.mark.thorough
def test_a_topic_on_which_nothing_comes_is_said_with_the_reason(ros):
    """In the log after some seconds, in answers and on /diagnostics: no topic, another type."""
    space = ros.namespace()
    nodes = [ros.start(n, space) for n in ('analyser', 'filter', 'calibration')]
    ros.ready(*nodes)
    topic = f'{space}/imu/data_raw'
    for node in nodes:
        assert wait_for(lambda: f'nobody publishes on {topic}' in node.text), node.text
    for node, name in ((nodes[0], 'analyse'), (nodes[1], 'diagnose')):
        good, said = ros.trigger(f'{node.full}/{name}')
        assert not good and 'nothing was received yet: nobody publishes' in said['error']
    other = ros.node.create_publisher(Imu, f'{space}/camera/imu', 10)
    wrong = ros.node.create_publisher(Temperature, topic, 10)
    for node in nodes:
        wanted = f'{topic} has the type sensor_msgs/msg/Temperature, not sensor_msgs/msg/Imu'
        assert wait_for(lambda: wanted in node.text), node.text
    good, said = ros.trigger(f'{nodes[1].full}/diagnose')
    assert not good and wanted in said['error']
    assert said['remedy'].startswith('remap imu/data_raw to ')
    assert f'{space}/camera/imu' in said['remedy'] and 'filtered' not in said['remedy']
    # nor what another node would make of the topic that is missing
    assert 'calibrated' not in said['remedy']
    with ros.listening('/diagnostics', DiagnosticArray) as got:
        for node, name in ((nodes[0], 'input'), (nodes[1], 'stream')):
            assert wait_for(lambda: level(got, node, name) == messages.STALE), got[-1:]
            assert wanted in of(got, node)[name].message
    for publisher in (other, wrong):
        ros.node.destroy_publisher(publisher)


@pytest.mark.thorough
def test_two_publishers_of_one_topic_are_said_once(ros):
    """Samples of two IMUs in one stream are no record of either."""
    space = ros.namespace()
    node = ros.start('filter', space)
    ros.ready(node)
    topic = f'{space}/imu/data_raw'
    both = [ros.node.create_publisher(Imu, topic, 10) for _ in range(2)]
    assert wait_for(lambda: f'2 publish on {topic}' in node.text), node.text
    time.sleep(2.5)
    assert node.text.count('come mixed') == 1

    other = ros.start('analyser', space)
    ros.ready(other)
    assert wait_for(lambda: all(p.get_subscription_count() == 2 for p in both))
    sent = Imu()
    for k in range(400):
        for publisher, late in zip(both, (0, 3_000_000)):
            stamp = 10 ** 9 + k * 10_000_000 + late
            sent.header.stamp.sec, sent.header.stamp.nanosec = divmod(stamp, 10 ** 9)
            publisher.publish(sent)
        time.sleep(0.003)
    with ros.listening('/diagnostics', DiagnosticArray) as got:
        assert wait_for(lambda: level(got, other, 'input') == messages.WARN
                        and 'mixed' in of(got, other)['input'].message), got[-1:]
    assert 'missing' not in other.text
    for publisher in both:
        ros.node.destroy_publisher(publisher)


@pytest.mark.thorough
def test_what_is_not_finite_is_said_alike(ros):
    """A level of WARN comes with its reason, and the two nodes agree on how many there were."""
    space = ros.namespace()
    nodes = [ros.start(n, space) for n in ('analyser', 'filter')]
    ros.ready(*nodes)
    publisher = ros.publisher(f'{space}/imu/data_raw', Imu)
    assert wait_for(lambda: publisher.get_subscription_count() == 2)
    rates = np.random.default_rng(8).normal(0, 0.01, (300, 3))
    rates[::30, 1] = np.nan
    for k, row in enumerate(rates.tolist()):
        message = Imu()
        message.header.stamp.nanosec = 1 + 2_000_000 * k
        v = message.angular_velocity
        v.x, v.y, v.z = row
        message.linear_acceleration.z = 9.81
        publisher.publish(message)
    with ros.listening('/diagnostics', DiagnosticArray) as got:
        for node, name, text in ((nodes[0], 'input', '300 samples, 10 not finite'),
                                 (nodes[1], 'stream', '290 samples, 10 refused: not finite')):
            assert wait_for(lambda: text in getattr(of(got, node).get(name), 'message', '')), (
                of(got, node))
            assert level(got, node, name) != messages.OK


@pytest.mark.thorough
def test_stamps_that_stand_are_a_warning_of_the_analyser(ros):
    space = ros.namespace()
    analyser = ros.start('analyser', space)
    ros.ready(analyser)
    publisher = ros.publisher(f'{space}/imu/data_raw', Imu)
    for row in np.random.default_rng(8).normal(0, 0.01, (300, 3)).tolist():
        message = Imu()
        v = message.angular_velocity
        v.x, v.y, v.z = row
        message.linear_acceleration.z = 9.81
        publisher.publish(message)
    with ros.listening('/diagnostics', DiagnosticArray) as got:
        text = f'300 samples; {ARRIVALS}'
        assert wait_for(lambda: text in getattr(of(got, analyser).get('input'), 'message', ''))
        assert level(got, analyser, 'input') != messages.OK
    assert analyser.text.count('the stamps do not advance') == 1


@pytest.mark.parametrize('result, said', [
    ({'error': 'no', 'remedy': 'do'}, 'no: do'),
    ({'diagnosis': {'gyro_x': {'verdict': 'missing', 'found': [{'effect': 'sinusoid'}]},
                    'gyro_y': {'verdict': 'complete', 'found': []}}},
     'gyro_x missing (sinusoid); gyro_y complete'),
    ({'diagnosis': {'gyro_x': {'verdict': 'undecidable', 'ranked': [
        {'effect': 'ramp'}, {'effect': 'step'}]}}}, 'gyro_x undecidable (ramp, step)'),
    ({'added': []}, 'added: nothing'),
    ({'added': [{'added': 'sinusoid', 'target': 'gyro_x'}]}, 'added: sinusoid to gyro_x'),
    ({'removed': [{'removed': 'ramp', 'target': 'gyro_x', 'effects': ['white']}]},
     'removed: ramp from gyro_x'),
    ({'history': [{'verdict': ''}, {'verdict': 'falls'}]}, '2 models were tried, the last falls'),
    ({'folder': '/tmp/x'}, 'written to /tmp/x'),
    ({'file': '/tmp/c.yaml'}, 'written to /tmp/c.yaml'),
    ({'held': '+x', 'done': 5, 'of': 6, 'left': ['-z'], 'note': ''},
     'held: +x; 5 of 6 done; left: -z'),
    ({'held': '-z', 'done': 6, 'of': 6, 'left': [], 'note': ''},
     'held: -z; 6 of 6 done; none left: solve'),
    ({'sensor': 'accel', 'method': 'faces', 'unit': 'm/s^2', 'bias': [0.1, -0.2, 0.0815],
      'S': [[1.01, 0, 0], [0, 0.99, 0], [0, 0, 1.0]], 'diagnosis': {}},
     'accel solved by faces: scale factors 1.01, 0.99, 1; bias 0.1, -0.2, 0.0815 m/s^2'),
    ({'paused': True}, ''),
    ({'targets': {'gyro_x': {'error': {'within_chance': True}, 'effects': {
        'white': {'N': {'value': 2.0, 'shown': '7 deg/sqrt(h)'}}}}},
      'source': {'samples': 100, 'rate_hz': 50.0}},
     '100 samples at 50 Hz; all axes within chance; gyro N 7 deg/sqrt(h)')])
def test_an_answer_begins_with_what_people_want(result, said):
    assert answers.summary(result) == said
    text = answers.text(result)
    assert '\n' not in text and yaml.safe_load(text) == (
        {'summary': said, **result} if said else result)


def test_a_diagnosis_is_answered_by_what_counts():
    """What is found, with its values, and rivals; nothing of a model that is complete."""
    def entry(name, probability):
        return {'effect': name, 'probability': probability, 'parameters': {
            'R': {'value': 1.0, 'std': 0.1, 'shown': '1 rad/s^2'}, 'form': {'value': 'x'}}}
    whole = {'verdict': 'missing', 'found': [entry('ramp', 0.9)], 'advice': ['a'],
             'ranked': [entry('ramp', 0.9), entry('drift', 0.09), entry('step', 0.001)]}
    got = answers.brief(whole)
    assert got['found'] == whole['found'] and got['advice'] == ['a']
    assert got['ranked'] == [{'effect': 'ramp', 'probability': 0.9}, {
        'effect': 'drift', 'probability': 0.09, 'parameters': {'R': '1 rad/s^2', 'form': 'x'}}]
    assert answers.brief({**whole, 'verdict': 'complete', 'found': []})['ranked'] == []


def test_a_coefficient_without_value_or_limit_is_an_error():
    entry = {'effects': {'white': {'N': {'value': None, 'unit': 'rad/s/sqrt(Hz)'}}},
             'error': {'within_chance': True}}
    assert messages.coefficients('gyro_x', entry).level == messages.ERROR
    entry['effects']['white']['N']['upper95'] = 1.0
    assert messages.coefficients('gyro_x', entry).level == messages.OK
    entry['error']['within_chance'] = False
    assert messages.coefficients('gyro_x', entry).level == messages.WARN
    assert messages.coefficients('gyro_x', {**entry, 'sufficient': True}).level == messages.OK


@pytest.mark.parametrize('name', sorted(registry('noise')))
def test_every_effect_of_a_model_is_told(name):
    """What is chosen by name has no unit: a narrow band in the model ended the service."""
    effect = registry('noise')[name].example()
    entry = {'error': {}, 'effects': {effect.label: {
        'effect': name, **{p.name: estimate_to_dict(Estimate(v, None, None, p.unit, point=v), p)
                           for p in effect.parameters
                           if (v := effect.values.get(p.name)) is not None}}}}
    told = {v.key: v.value for v in messages.coefficients('gyro_x', entry).values}
    for p in effect.parameters:
        if effect.values.get(p.name) is not None:
            found = [k for k in told if k.split(' [')[0] in (p.name, f'{effect.label}.{p.name}')]
            assert found and (not p.choices or told[found[0]] in p.choices)
