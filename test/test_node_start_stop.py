# Copyright 2026 imu_noise_tools maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""How nodes start, are set, and stop: all four, in real processes."""

from __future__ import annotations

import json
import re
import signal
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
import yaml

from nodes_support import NODES


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


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM], ids=lambda n: n.name)
def test_every_node_ends_on_a_signal_within_two_seconds(ros, table, number):
    for _ in range(2):
        for process in started(ros, ros.namespace(), table):
            took, code = process.stop(number)
            assert code == 0 and took <= 2.0, f'{process.name}: {took:.2f} s, {code}'
            assert 'Traceback' not in process.text


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


def test_a_bad_parameter_at_the_start_is_refused_in_one_line(ros, table):
    ns = ros.namespace()
    cases = [('analyser', {'effects': ['white', 'nothing_such']}, 'nothing_such'),
             ('analyser', {'input': 'both'}, 'one of messages, buffer'),
             ('filter', {'alpha': 3.0}, 'alpha'), ('filter', {'motion': ['white']}, 'motion'),
             ('calibration', {'sensor': 'gyro'}, 'rate_deg_s'),
             ('calibration', {'still_seconds': 'long'}, 'still_seconds')]
    started_ = [(ros.start(node, ns, **given), why) for node, given, why in cases]
    for process, why in started_:
        assert process.end() == 1, process.text
        lines = [x for x in process.text.splitlines() if x.strip()]
        assert len(lines) == 1 and lines[0].startswith('error: ') and why in lines[0], lines


def test_layouts_of_viewers_show_topics_and_services_that_exist(ros, root, table):
    processes = started(ros, ros.namespace(), table)
    ns = processes[0].namespace
    names = {n.removeprefix(ns) for n in (*ros.topics(), *ros.services()) if n.startswith(ns)}
    foxglove = (root / 'config' / 'foxglove.json').read_text()
    layout = json.loads(foxglove)
    panels = set(re.findall(r'"(\w+!\w+)"', json.dumps(layout['configById']['Tab!all'])))
    assert panels == set(layout['configById']) - {'Tab!all'}
    plotjuggler = root / 'config' / 'plotjuggler.xml'
    ElementTree.parse(plotjuggler)
    seen = set()
    ours = re.compile(rf'/(?:imu|{"|".join(NODES)})/[a-z_/]*[a-z]')
    for text in (foxglove, plotjuggler.read_text()):
        found = set(ours.findall(text))
        seen |= {next((n for n in names if f == n or f.startswith(f'{n}/')), f) for f in found}
    assert len(seen) > 12 and seen <= names, seen - names
