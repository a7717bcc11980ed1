# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
In an environment with only what package.xml and README.md name, every command and node runs.

The keys of package.xml are installed by their names in the Python index, README's line beside
them, and then the package with none of its own requirements: what nothing names is not there.
Everything is run from elsewhere, by the names that it is installed under.

"""

from __future__ import annotations

import json
import os
from pathlib import Path
import re
import shutil
import signal
import subprocess
import sys
import time
import xml.etree.ElementTree as ElementTree

import calibration_sessions as sessions
import numpy as np
import pytest

from imu_noise_tools.cli.main import parser

pytestmark = pytest.mark.thorough
NAME = 'imu_noise_tools'
# Keys of ROS packages: who follows README.md without a sourced ROS has them from these.
ROS = ('ros-jazzy-rclpy[fastrtps]', 'ros-jazzy-common-interfaces')
NOT_IN_THE_INDEX = {'launch', 'launch_ros'}       # only launch files need them
SPEC = """
rate_hz: 50
duration_s: 90
seed: 3
targets:
  gyro_x: {white: {N: 1.0e-3}, sinusoid: {amplitude: 0.004, frequency: 7.3}}
  gyro_y: {white: {N: 1.0e-3}}
  gyro_z: {white: {N: 1.0e-3}}
  accel_x: {white: {N: 1.0e-2}}
  accel_y: {white: {N: 1.0e-2}}
  accel_z: {white: {N: 1.0e-2}}
"""


def wanted(root: Path) -> list[str]:
    """Return what package.xml and README.md tell somebody to install."""
    keys = [e.text for e in ElementTree.parse(root / 'package.xml').getroot().iter('exec_depend')]
    named = re.search(r'no\s+rosdep key: `pip install ([^`]+)`', (root / 'README.md').read_text())
    python = [k.removeprefix('python3-').removesuffix('-pip') for k in keys
              if k.startswith('python3-')]
    other = {k for k in keys if not k.startswith('python3-')} - NOT_IN_THE_INDEX
    assert all(k == 'rclpy' or k.endswith(('_msgs', '_srvs', '_interfaces')) for k in other), other
    return [*({'yaml': 'pyyaml'}.get(p, p) for p in python), *named.group(1).split(), *ROS]


class Clean:
    """An environment of its own, and a folder that is not the source's."""

    def __init__(self, root: Path, folder: Path):
        self.bin, self.here = folder / 'venv' / 'bin', folder / 'here'
        self.here.mkdir()
        subprocess.run([sys.executable, '-m', 'venv', folder / 'venv'], check=True)
        self.env = {k: v for k, v in os.environ.items()
                    if not k.startswith(('PYTHON', 'IMU_NOISE', 'AMENT', 'VIRTUAL'))}
        self.env.update(PATH=f'{self.bin}:/usr/bin:/bin', ROS_LOG_DIR=str(folder))
        copy = folder / 'source'
        shutil.copytree(root, copy, ignore=shutil.ignore_patterns(
            '.git', '.venv*', '*.egg-info', 'build', '__pycache__', '*.study'))
        for words in (wanted(root), ['--no-deps', str(copy)]):
            # what is run is compiled when it is, and most of what is installed is not
            done = subprocess.run([self.bin / 'python', '-m', 'pip', 'install', '-q',
                                   '--no-compile', *words],
                                  env=self.env, capture_output=True, text=True, timeout=1500)
            if done.returncode and 'No matching distribution' in done.stderr:
                pytest.skip('no package index')
            assert done.returncode == 0, done.stderr[-2000:]
        shutil.rmtree(copy)

    def run(self, *words, status=0) -> str:
        """Run something that is installed; return what it printed."""
        done = subprocess.run([self.bin / words[0], *map(str, words[1:])], cwd=self.here,
                              env=self.env, capture_output=True, text=True, timeout=900)
        assert done.returncode == status, (words, done.stdout[-1500:], done.stderr[-3000:])
        return done.stdout

    def start(self, node: str, **parameters) -> subprocess.Popen:
        """Start a node by its installed name."""
        words = [w for k, v in parameters.items() for w in ('-p', f'{k}:={json.dumps(v)}')]
        log = open(self.here / f'{node}.log', 'w')
        return subprocess.Popen([self.bin / node, '--ros-args', *words], cwd=self.here,
                                env=self.env, stdout=log, stderr=subprocess.STDOUT)


@pytest.fixture(scope='module')
def clean(root, tmp_path_factory):
    """Return the environment, with a recording and a session of six faces in its folder."""
    made = Clean(root, tmp_path_factory.mktemp('clean'))
    (made.here / 'spec.yaml').write_text(SPEC)
    rng = np.random.default_rng(5)
    device = sessions.Device.drawn(rng, noise=2e-3)
    t, gyro, accel, _ = sessions.stream(device, sessions.faces()[1], rng)
    np.savez(made.here / 'faces.npz', gyro=gyro, accel=accel, t=t)
    yield made
    shutil.rmtree(made.bin.parent)      # pytest keeps the folders of three runs: of 20 000 files


# every command, in an order in which each finds what it needs
COMMANDS = (
    ('simulate', 'spec.yaml', '-o', 'bag'),
    ('inspect', 'bag'),
    ('analyse', 'bag', '-o', 'study', '--effects', 'white', '--axes', 'gyro_x,accel_z'),
    ('analyze', 'bag', '-o', 'other', '--deviation', 'mdev', '--method', 'avar'),
    ('analyse', 'bag', '-o', 'third', '--deviation', 'totdev', '--method', 'slopes',
     '--axes', 'gyro_x'),
    ('compare', 'study'),
    ('compare', 'study', 'other'),
    ('diagnose', 'study'),
    ('add', 'study', 'sinusoid', '--axis', 'gyro_x'),
    ('history', 'study'),
    ('remove', 'study', 'sinusoid', '--axis', 'gyro_x'),
    ('effects',),
    ('effects', 'flicker'),
    ('export', 'other', '--format', 'kalibr', '-o', 'imu.yaml'),
    ('export', '--list'),
    ('calibrate', 'faces.npz', '-o', 'cal'),
    ('apply', 'bag', '-o', 'applied', '--calibration', 'cal'),
    # what is installed says nothing of how many motions a filter is ready for: of one it is quick
    ('filter', 'bag', '-o', 'filtered', '--motion', 'constant_rate,ar_increment'),
    ('plan', 'study'),
    ('sheet', '--list'),
    ('sheet', 'bmi088', '-o', 'sheet'),
    ('explore', 'study', '--no-browser'),
    ('fleet', 'bag', '-o', 'fleet'),
    ('completion', 'bash'),
    ('demo', '-o', 'demo'),
)

EXTRA = {'explore', 'fleet'}


def commands() -> set[str]:
    """Return the names of all commands."""
    return {name for action in parser()._actions if isinstance(action.choices, dict)
            for name in action.choices}


def test_every_command_is_among_those_that_are_run():
    """A new command is added here, with how it is run."""
    assert commands() - {c[0] for c in COMMANDS} == set()


def test_only_what_is_named_is_there(clean):
    """The environment is no copy of this one; what is tested is what is installed in it."""
    code = ('import importlib.util as u, sys, imu_noise_tools; '
            'print(imu_noise_tools.__file__, [n for n in sys.argv[1:] if u.find_spec(n)])')
    where, there = clean.run('python', '-c', code, 'hypothesis', 'xdist', 'mypy').split(' ', 1)
    assert where.startswith(str(clean.bin.parent)) and there.strip() == '[]'


def test_every_command_runs(clean):
    for words in COMMANDS:
        if words[0] == 'demo':
            continue
        if words[0] in EXTRA:       # says in a line what to install
            clean.run('imu_noise', *words, status=1)
            continue
        out = clean.run('imu_noise', *words)
        assert out.strip(), words
    assert (clean.here / 'imu.yaml').is_file() and (clean.here / 'study' / 'allan.png').is_file()


def test_the_demo_runs_with_real_nodes(clean):
    out = clean.run('imu_noise', 'demo', '-o', 'demo')
    assert 'the analyser computed the same coefficients as the command line' in out
    assert (clean.here / 'demo' / 'report.html').is_file()


def test_every_node_runs(clean):
    """A bag goes through them, and each ends well on a signal."""
    from nodes_support import domain_of_its_own        # skips where there is no ROS
    if not (clean.here / 'bag').exists():
        clean.run('imu_noise', *COMMANDS[0])
    with domain_of_its_own():
        clean.env.update({k: v for k, v in os.environ.items()
                          if k.startswith(('ROS_DOMAIN', 'ROS_AUTO', 'FASTDDS'))})
        analyser = clean.start('analyser', input='messages', exit_at_end=True, output_dir='nodes')
        others = [clean.start('filter'), clean.start('calibration')]
        reader = clean.start('bag_reader', bag='bag', publish='messages',
                             readers=['analyser', 'filter', 'calibration'])
        running = [reader, analyser, *others]
        try:
            status = analyser.wait(400)
            assert status == 0, (clean.here / 'analyser.log').read_text()[-2000:]
            assert (clean.here / 'nodes' / 'imu.yaml').is_file()
            for process, name in zip((reader, *others), ('bag_reader', 'filter', 'calibration')):
                assert process.poll() is None, (clean.here / f'{name}.log').read_text()
                process.send_signal(signal.SIGTERM)
            for process, name in zip((reader, *others), ('bag_reader', 'filter', 'calibration')):
                assert process.wait(60) == 0, (clean.here / f'{name}.log').read_text()
        finally:
            for process in running:
                if process.poll() is None:
                    process.kill()
            time.sleep(0.1)
