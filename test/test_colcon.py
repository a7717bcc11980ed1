# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What colcon builds of the package, and that the launch files can be read by it."""

from __future__ import annotations

import os
from pathlib import Path
import runpy
import shutil
import subprocess
import sys
from types import ModuleType

import pytest

NAME = 'imu_noise_tools'
EXECUTABLES = ('bag_reader', 'analyser', 'calibration', 'filter', 'imu_noise')
ARGUMENTS = {'namespace', 'params_file', 'use_sim_time', 'log_level'}


def colcon() -> str:
    """Return the path of colcon, the one beside this interpreter first."""
    beside = Path(sys.executable).parent / 'colcon'
    found = str(beside) if beside.is_file() else shutil.which('colcon')
    if not found:
        pytest.skip('colcon is not installed')
    return found


@pytest.fixture(scope='module')
def prefix(root, tmp_path_factory) -> Path:
    """Build the package in a workspace of its own; return its install prefix."""
    space = tmp_path_factory.mktemp('colcon')
    shutil.copytree(root, space / 'src' / NAME, ignore=shutil.ignore_patterns(
        '.git', '.venv*', '__pycache__', 'build', 'install', 'log', '*.egg-info', '.*_cache',
        'imu_noise_demo', '*.study'))
    env = {k: v for k, v in os.environ.items() if k not in ('PYTHONPATH', 'COLCON_PREFIX_PATH')}
    env['PATH'] = f'{Path(sys.executable).parent}:{env["PATH"]}'
    done = subprocess.run(
        [colcon(), 'build', '--packages-select', NAME, '--event-handlers', 'console_direct+'],
        cwd=space, env=env, capture_output=True, text=True, timeout=800)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return space / 'install' / NAME


def test_executables_are_where_ros2_run_looks(prefix):
    for name in EXECUTABLES:
        path = prefix / 'lib' / NAME / name
        assert path.is_file() and os.access(path, os.X_OK), path


def test_share_holds_launch_config_and_marker(root, prefix):
    share = prefix / 'share'
    assert (share / 'ament_index' / 'resource_index' / 'packages' / NAME).is_file()
    assert (share / NAME / 'package.xml').is_file()
    for folder, pattern in (('launch', '*.launch.py'), ('config', '*.*')):
        ours = {p.name for p in (root / folder).glob(pattern)}
        assert ours and ours == {p.name for p in (share / NAME / folder).glob(pattern)}


def test_every_module_and_data_file_is_installed(root, prefix):
    site = next(prefix.glob('lib/python3*/site-packages'))
    for pattern in ('*.py', '*.yaml', '*.npz', '*.json'):
        ours = {p.relative_to(root) for p in (root / NAME).rglob(pattern)}
        missing = [str(p) for p in ours if not (site / p).is_file()]
        assert not missing


def test_an_installed_executable_runs(prefix):
    pytest.importorskip('rclpy')
    site = next(prefix.glob('lib/python3*/site-packages'))
    done = subprocess.run([sys.executable, prefix / 'lib' / NAME / 'imu_noise', '--help'],
                          env={**os.environ, 'PYTHONPATH': str(site)},
                          capture_output=True, text=True, timeout=300)
    assert done.returncode == 0 and 'analyse' in done.stdout, done.stderr[-1000:]


class Recorded:
    """Stands for an action or substitution of launch: keeps what it was made of."""

    def __init__(self, *args, **options):
        self.args, self.options = args, options


@pytest.fixture
def launching(monkeypatch):
    """Make launch files importable where launch is not (it is not to be had from pip)."""
    for module, names in (('launch', ('LaunchDescription',)), ('launch_ros', ()),
                          ('launch.actions', ('DeclareLaunchArgument', 'Shutdown')),
                          ('launch.substitutions', ('LaunchConfiguration',)),
                          ('launch_ros.actions', ('Node',)),
                          ('launch_ros.parameter_descriptions', ('ParameterValue',))):
        stand_in = ModuleType(module)
        for name in names:
            setattr(stand_in, name, type(name, (Recorded,), {}))
        monkeypatch.setitem(sys.modules, module, stand_in)


@pytest.mark.parametrize('where', ['source', 'installed'])
def test_launch_files_start_what_they_say(root, prefix, launching, where):
    """Each declares the four arguments, and hands them to nodes that exist, with files that do."""
    folder = root / 'launch' if where == 'source' else prefix / 'share' / NAME / 'launch'
    files = sorted(folder.glob('*.launch.py'))
    assert [p.name.partition('.')[0] for p in files] == ['bag_analysis', 'calibration', 'live']
    for path in files:
        entries = runpy.run_path(str(path))['generate_launch_description']().args[0]
        declared = {e.args[0] for e in entries if type(e).__name__ == 'DeclareLaunchArgument'}
        assert ARGUMENTS <= declared, path.name
        used, nodes = set(), [e.options for e in entries if type(e).__name__ == 'Node']
        for node in nodes:
            assert node['package'] == NAME and node['executable'] in EXECUTABLES[:4]
            own, params_file, given = node['parameters']
            assert Path(own).is_file() and Path(own).stem == node['executable']
            handed = [node['namespace'], params_file, node['ros_arguments'][1], *given.values(),
                      *(new for _, new in node.get('remappings', ()))]
            handed = [h.args[0] if type(h).__name__ == 'ParameterValue' else h for h in handed]
            used |= {h.args[0] for h in handed if isinstance(h, Recorded)}
        assert nodes and used == declared, path.name
        defaults = {e.args[0]: e.options.get('default_value') for e in entries
                    if type(e).__name__ == 'DeclareLaunchArgument'}
        assert Path(defaults['params_file']).is_file()


LAUNCH = """
import sys
from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
path, *given = sys.argv[1:]
service = LaunchService(argv=given)
service.include_launch_description(LaunchDescription([IncludeLaunchDescription(
    PythonLaunchDescriptionSource(path), launch_arguments=[a.split(':=', 1) for a in given])]))
sys.exit(service.run())
"""


def test_launch_files_are_read_by_launch(root):
    """Where launch is installed: its own parser finds the arguments, described, and the nodes."""
    pytest.importorskip('launch_ros')
    from launch import LaunchIntrospector
    from launch.launch_description_sources import get_launch_description_from_python_launch_file
    for path in sorted((root / 'launch').glob('*.launch.py')):
        description = get_launch_description_from_python_launch_file(str(path))
        arguments = {a.name: a for a in description.get_launch_arguments()}
        assert ARGUMENTS <= set(arguments)
        assert all(a.description for a in arguments.values())
        assert {n for n, a in arguments.items() if not a.default_value} <= {
            'bag', 'namespace', 'accel'}
        shown = LaunchIntrospector().format_launch_description(description)
        assert any(name in shown for name in EXECUTABLES[:4]), shown


@pytest.mark.thorough
def test_a_bag_is_analysed_by_launch(root, prefix, tmp_path):
    """Where launch is installed: it starts the nodes, ends by itself, and its status is theirs."""
    pytest.importorskip('launch_ros')
    from bad_input import still
    from nodes_support import domain_of_its_own
    import numpy as np
    record = still(70)
    np.savez(tmp_path / 'a.npz', gyro=record.gyro, accel=record.accel, t=record.t)
    with domain_of_its_own():
        (site,) = prefix.glob('lib/python*/site-packages')
        env = {**os.environ, 'ROS_LOG_DIR': str(tmp_path)}
        for name, own in (('AMENT_PREFIX_PATH', prefix), ('PYTHONPATH', site)):
            env[name] = os.pathsep.join([str(own), *filter(None, [os.environ.get(name)])])
        path = prefix / 'share' / NAME / 'launch' / 'bag_analysis.launch.py'
        for bag, status in (('a.npz', 0), ('nowhere.npz', 1)):
            done = subprocess.run(
                [sys.executable, '-c', LAUNCH, str(path), f'bag:={tmp_path / bag}',
                 'namespace:=robot', f'output_dir:={tmp_path / "study"}'],
                cwd=tmp_path, env=env, capture_output=True, text=True, timeout=400)
            said = done.stdout + done.stderr
            assert done.returncode == status, said[-3000:]
        assert 'no such file' in said
        assert (tmp_path / 'study' / 'imu.yaml').is_file()
