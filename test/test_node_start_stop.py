# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""How nodes start, are set, and stop: all four, in real processes."""

from __future__ import annotations

import json
import math
import os
import re
import signal
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

import numpy as np
from params import daily
import pytest
import yaml

from nodes_support import DiagnosticArray, Float64MultiArray, NODES, Parameter, wait_for


@pytest.fixture(scope='module')
def table(tmp_path_factory):
    """Write a record that a bag_reader can start with."""
    path = tmp_path_factory.mktemp('tables') / 'some.npz'
    np.savez(path, gyro=np.random.default_rng(1).standard_normal((500, 3)), rate_hz=100.0)
    return str(path)


def started(ros, ns, table, nodes=NODES):
    """Start nodes, and wait until they are there."""
    processes = [ros.start(n, ns, **({'bag': table} if n == 'bag_reader' else {})) for n in nodes]
    ros.ready(*processes)
    return processes


@pytest.mark.parametrize('number', daily([signal.SIGINT, signal.SIGTERM], signal.SIGTERM),
                         ids=lambda n: n.name)
def test_every_node_ends_on_a_signal(ros, table, number):
    """How fast, bench/nodes.py measures: two seconds are asked."""
    for process in started(ros, ros.namespace(), table):
        _, code = process.stop(number)
        assert code == 0, f'{process.name}: {code}'
        assert 'Traceback' not in process.text


@pytest.mark.thorough
def test_parameters_are_described_and_config_files_hold_their_defaults(ros, root, table):
    """Nothing of config/ is unknown to the nodes, and nothing of theirs is left out."""
    for process in started(ros, ros.namespace(), table):
        text = (root / 'config' / f'{process.name}.yaml').read_text()
        given = yaml.safe_load(text)['/**']['ros__parameters']
        described = ros.parameters(process.full)
        assert all(d.description.strip() for d in described.values()), process.name
        own = {n for n in described if '.' not in n}        # values of effects have no default
        assert own == set(given), process.name
        found = ros.values_of(process.full, own - {'bag'})
        assert {k: v if np.isscalar(v) else list(v) for k, v in found.items()} == {
            k: v for k, v in given.items() if k != 'bag'}
        assert set(re.findall(r'(?m)^    (\w+): .*\(fixed\)$', text)) == {
            n for n in own if described[n].read_only}, process.name


@pytest.mark.parametrize('cases', daily([0, 1], 0), ids=['of meaning', 'of type and range'])
def test_a_bad_parameter_at_the_start_is_refused_in_one_line(ros, table, cases):
    ns = ros.namespace()
    cases = [[('analyser', {'effects': ['white', 'nothing_such']}, 'nothing_such'),
              ('analyser', {'output_dir': '/proc/x'}, 'set the parameter output_dir'),
              ('filter', {'motion': ['white']}, 'motion'),
              ('calibration', {'sensor': 'gyro'}, 'rate_deg_s'),
              ('calibration', {'file': '/proc/x.yaml'}, 'set the parameter file')],
             [('analyser', {'input': 'both'}, 'one of messages, buffer'),
              ('filter', {'alpha': 3.0}, 'alpha'),
              ('calibration', {'still_seconds': 'long'}, 'still_seconds')]][cases]
    started_ = [(ros.start(node, ns, **given), why) for node, given, why in cases]
    for process, why in started_:
        assert process.end() == 1, process.text
        lines = process.lines
        assert len(lines) == 1 and lines[0].startswith('error: ') and why in lines[0], lines


@pytest.mark.thorough
def test_a_parameter_that_a_node_does_not_have_is_said(ros):
    """A misspelt one would be passed over without a word; what is there is no such one."""
    process = ros.start('filter', ros.namespace(), **{'whit.R': 1e-4, 'alpha': 0.9})
    ros.ready(process)
    said = 'there is no parameter whit.R: it is not heeded (did you mean white.R?)'
    assert wait_for(lambda: said in process.text), process.text
    assert process.text.count('no parameter') == 1


_BUSY = """
import sys
import time
from imu_noise_tools.nodes import run
from rclpy.node import Node
from std_msgs.msg import Empty


class Slow(Node):
    def __init__(self):
        super().__init__('slow')
        self.out = self.create_publisher(Empty, 'out', 1)
        self.create_timer(0.01, self.work)

    def work(self):
        self.status = 0
        time.sleep(0.2)
        self.out.publish(Empty())


sys.exit(run.run(Slow, [], run.threads_executor))
"""


@pytest.mark.thorough
def test_what_a_thread_does_ends_before_its_node(root):
    """A callback under way at the stop publishes what it has: nothing is printed."""
    ended = subprocess.run([sys.executable, '-c', _BUSY], capture_output=True, text=True,
                           timeout=100, env={**os.environ, 'PYTHONPATH': str(root)})
    assert ended.returncode == 0 and 'exception' not in ended.stderr, ended.stderr


@pytest.mark.thorough
def test_layouts_of_viewers_show_topics_and_services_that_exist(ros, root, table):
    processes = started(ros, ros.namespace(), table)
    ns = processes[0].namespace

    def names():
        """Return what is there by now: nodes go on making topics when they can be seen."""
        return {n.removeprefix(ns) for n in (*ros.topics(), *ros.services()) if n.startswith(ns)}
    foxglove = (root / 'config' / 'foxglove.json').read_text()
    layout = json.loads(foxglove)
    panels = set(re.findall(r'"(\w+!\w+)"', json.dumps(layout['configById']['Tab!all'])))
    assert panels == set(layout['configById']) - {'Tab!all'}
    plotjuggler = root / 'config' / 'plotjuggler.xml'
    ElementTree.parse(plotjuggler)
    ours = re.compile(rf'/(?:imu|{"|".join(NODES)})/[a-z_/]*[a-z]')
    shown = {f for text in (foxglove, plotjuggler.read_text()) for f in ours.findall(text)}

    def strangers(there):
        return {f for f in shown if not any(f == n or f.startswith(f'{n}/') for n in there)}
    assert wait_for(lambda: not strangers(names())), strangers(names())
    assert len({n for n in names() for f in shown if f == n or f.startswith(f'{n}/')}) > 12


@pytest.fixture
def make_filter(ros):
    """Return a function that makes a filter node in this process."""
    from imu_noise_tools.nodes.filter import Filter
    made = []

    def make():
        made.append(Filter())
        return made[-1]
    yield make
    for node in made:
        node.finish()
        node.destroy_node()


def test_what_fails_beside_the_filter_is_logged_and_all_else_goes_on(
        ros, make_filter, monkeypatch, capfd):
    """A timer fails at each tick, every 20 ms here: that is logged once."""
    from imu_noise_tools.nodes.aside import Aside
    from imu_noise_tools.nodes.filter import Filter
    timer = Aside.create_timer

    def broken(self):
        raise ValueError('broken on purpose')
    monkeypatch.setattr(Aside, 'create_timer', lambda self, _, *a, **k: timer(self, 0.02, *a, **k))
    monkeypatch.setattr(Filter, '_tell', broken)
    make_filter()
    with ros.listening('/diagnostics', DiagnosticArray) as got:
        assert wait_for(lambda: len(got) > 20), 'nothing is told any more'
    good, said = ros.trigger('/filter/history')
    assert not good and 'nobody publishes' in said['error']
    assert capfd.readouterr().err.count('ValueError: broken on purpose') == 1


def test_a_message_that_cannot_be_read_does_not_end_following(ros, capfd):
    from imu_noise_tools.nodes.follow import Follower
    from imu_noise_tools.nodes.topics import result
    name = f'{ros.namespace()}/analyser'
    bad = ros.node.create_publisher(Float64MultiArray, f'{name}/allan/gyro_x', result())
    good = ros.node.create_publisher(DiagnosticArray, f'{name}/status', result())
    bad.publish(Float64MultiArray())
    follower = Follower(name)
    try:
        def logged():
            return 'Traceback' in capfd.readouterr().err
        assert wait_for(logged)
        good.publish(DiagnosticArray())
        assert wait_for(lambda: 'status' in follower.said), 'it hears nothing any more'
    finally:
        follower.close()
        for publisher in (bad, good):
            ros.node.destroy_publisher(publisher)


def test_the_file_of_the_paper_states_its_filter(make_filter, root):
    """R and q are those of the paper in SI; the node takes every one, and runs what they say."""
    text = (root / 'config' / 'adis16350.yaml').read_text()
    given = yaml.safe_load(text)['/**']['ros__parameters']
    device = given.pop('device')
    given.pop('paper')
    flat = {f'{k}.{x}' if isinstance(v, dict) else k: y for k, v in given.items()
            for x, y in (v.items() if isinstance(v, dict) else [(k, v)])}
    node = make_filter()
    answer = node.set_parameters_atomically([Parameter(k, value=v) for k, v in flat.items()])
    assert answer.successful, answer.reason
    ran = node._engine.design
    values = {e.name: dict(e.values) for e in (*ran.motion[0], *ran.noise[0])}
    r, q = (pytest.approx(math.radians(x) ** 2) for x in (device['noise_deg_s'], 0.02))
    assert ran.alpha == 0.7 and values == {
        'constant_rate': {}, 'ar_increment': {'phi': device['phi'], 'q': q}, 'white': {'R': r}}


def test_an_answer_may_be_read_in_part():
    """What takes the first lines ends; the rest is nobody's failure."""
    run = ('import sys; from imu_noise_tools.nodes import trigger; '
           'trigger.call = lambda *_: (True, "a: " + "x" * 400000); '
           'sys.exit(trigger.main(["/a/b"]))')
    with subprocess.Popen([sys.executable, '-c', run], text=True, stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE) as process:
        assert process.stdout.read(2) == '{a'
        process.stdout.close()
        assert process.stderr.read() == '' and process.wait(60) == 0
