# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The package's card: versions, scripts, dependencies, lints and licence."""

from __future__ import annotations

import ast
import functools
import json
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree

import pytest
import yaml

NAME = 'imu_noise_tools'
SOURCES = ('imu_noise_tools', 'test', 'bench', 'doc', 'launch')


def python_files(root: Path) -> list[Path]:
    """Return every Python file of the project."""
    return [root / 'setup.py', *(p for top in SOURCES for p in sorted((root / top).rglob('*.py')))]


@functools.cache
def setup_arguments(root: Path) -> dict:
    """Return the arguments that setup.py gives to setup()."""
    code = ('import setuptools, json, runpy\n'
            'setuptools.setup = lambda **given: print(json.dumps(given))\n'
            'runpy.run_path("setup.py")')
    done = subprocess.run([sys.executable, '-W', 'ignore', '-c', code], cwd=root, check=True,
                          capture_output=True, text=True)
    return json.loads(done.stdout)


def test_versions_are_equal(root):
    card = ElementTree.parse(root / 'package.xml').getroot()
    module = ast.parse((root / NAME / '__init__.py').read_text())
    stated = [ast.literal_eval(node.value) for node in module.body
              if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == '__version__']
    newest = re.search(r'^(\d+\.\d+\.\d+) ', (root / 'CHANGELOG.rst').read_text(), re.M)
    version = setup_arguments(root)['version']
    assert [version] == stated
    assert version == card.findtext('version').strip() == newest.group(1)


def test_card_is_an_ament_python_package(root):
    card = ElementTree.parse(root / 'package.xml').getroot()
    assert card.get('format') == '3' and card.findtext('name') == NAME
    assert card.findtext('export/build_type') == 'ament_python'
    assert card.find('license').text == setup_arguments(root)['license'] == 'Apache-2.0'
    marker = root / 'resource' / NAME
    assert marker.is_file()


def test_results_begin_with_where_it_stands_and_name_scripts_that_are_there(root):
    """The manual shows them as a page, so they link to nothing beside them."""
    text = (root / 'bench' / 'RESULTS.md').read_text(encoding='utf-8')
    assert re.search(r'^## (.+)', text, re.M).group(1) == 'Where it stands'
    named = set(re.findall(r'(?:bench/|\| `)(\w+\.py)', text))
    assert len(named) > 20
    assert not sorted(n for n in named if not (root / 'bench' / n).is_file())
    assert '](' not in text and (root / 'bench' / 'RUNS.md').is_file()


def test_card_says_where_the_project_is_and_who_answers(root):
    """The same as setup.py; rosdoc2 is told where the manual is."""
    card = ElementTree.parse(root / 'package.xml').getroot()
    given = setup_arguments(root)
    who = card.find('maintainer')
    assert who.text == given['maintainer'] and who.get('email') == given['maintainer_email']
    assert {u.get('type'): u.text for u in card.iter('url')} == {
        'website': given['url'], 'repository': given['project_urls']['Source'],
        'bugtracker': given['project_urls']['Tracker']}
    about, settings = yaml.safe_load_all((root / card.findtext('export/rosdoc2')).read_text())
    assert about == {'type': 'rosdoc2 config', 'version': 1}
    (builder,) = settings['builders']
    assert (root / builder['sphinx']['sphinx_sourcedir'] / 'conf.py').is_file()


def test_every_message_package_in_use_is_a_dependency(root):
    card = ElementTree.parse(root / 'package.xml').getroot()
    stated = {e.text for e in card.iter('exec_depend')}
    used = set()
    for path in (*(root / NAME / 'nodes').glob('*.py'), *(root / 'launch').glob('*.py')):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                used |= {a.name.split('.')[0] for a in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0:
                used.add(node.module.split('.')[0])
    ros = {n for n in used if n.endswith('_msgs') or n in ('std_srvs', 'builtin_interfaces',
                                                           'rcl_interfaces', 'rclpy', 'launch',
                                                           'launch_ros', 'ament_index_python')}
    assert ros <= stated, f'package.xml misses {sorted(ros - stated)}'


def test_every_dependency_is_a_key_of_rosdep(root):
    """Against a stored list: a key that does not exist stops rosdep install."""
    card = ElementTree.parse(root / 'package.xml').getroot()
    known = {line.strip() for line in (root / 'test' / 'rosdep_keys.txt').read_text().splitlines()
             if not line.startswith('#')}
    stated = {e.text for e in card if e.tag.endswith('depend')}
    assert len(stated) > 15 and stated <= known, sorted(stated - known)


def test_what_the_package_imports_is_to_be_had_by_who_follows_the_readme(root):
    """Each comes by a key of package.xml, by README's pip line, with one of these, or is extra."""
    card = ElementTree.parse(root / 'package.xml').getroot()
    keys = {e.text for e in card.iter('exec_depend')}
    named = re.search(r'no rosdep key: `pip install ([^`]+)`', (root / 'README.md').read_text())
    had = {k.removeprefix('python3-').removesuffix('-pip') for k in keys}
    had |= set(named.group(1).split()) | {'lz4', 'PIL'}     # rosbags and matplotlib need these
    for extra in ('notebook', 'explore', 'fleet'):
        had |= {re.match(r'[\w.-]+', r).group()
                for r in setup_arguments(root)['extras_require'][extra]}
    used = set()
    for path in (root / NAME).rglob('*.py'):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                used |= {a.name.split('.')[0] for a in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0:
                used.add(node.module.split('.')[0])
    used -= set(sys.stdlib_module_names) | {NAME}
    assert {'numpy', 'scipy', 'rosbags', 'zstandard', 'rclpy'} <= used
    assert used <= had, f'nothing says how to get {sorted(used - had)}'
    listed = {re.match(r'[\w.-]+', r).group() for r in setup_arguments(root)['install_requires']}
    assert set(named.group(1).split()) | {'lz4', 'rosbags'} <= listed


@pytest.mark.thorough
@pytest.mark.skipif(sys.version_info >= (3, 12), reason='an old pip needs distutils')
def test_an_old_pip_puts_the_command_on_the_path(root, tmp_path):
    """That of Python 3.10's ensurepip, without wheel: it must not run setup.py install."""
    copy = tmp_path / 'source'
    shutil.copytree(root, copy, ignore=shutil.ignore_patterns('.git', '.venv*', '*.egg-info'))
    subprocess.run([sys.executable, '-m', 'venv', tmp_path / 'venv'], check=True)
    pip = [tmp_path / 'venv' / 'bin' / 'python', '-m', 'pip']
    old = subprocess.run([*pip, 'install', '-q', 'pip==22.0.2'], capture_output=True, text=True)
    if old.returncode:
        pytest.skip('no package index')
    subprocess.run([*pip, 'uninstall', '-q', '-y', 'wheel'], capture_output=True)
    done = subprocess.run([*pip, 'install', '--no-deps', copy], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / 'venv' / 'bin' / 'imu_noise').is_file(), done.stdout


def test_console_scripts(root):
    given = setup_arguments(root)['entry_points']['console_scripts']
    scripts = dict(re.fullmatch(r'(\w+) = (\S+)', line).groups() for line in given)
    nodes = ('bag_reader', 'analyser', 'calibration', 'filter')
    assert scripts == {**{n: f'{NAME}.nodes.{n}:main' for n in nodes},
                       'imu_noise': f'{NAME}.cli.main:main'}
    for target in scripts.values():
        module, _, function = target.partition(':')
        path = root.joinpath(*module.split('.')).with_suffix('.py')
        assert path.is_file(), f'{path} is not there'
        names = [n.name for n in ast.parse(path.read_text()).body
                 if isinstance(n, ast.FunctionDef)]
        assert function in names


def test_every_module_is_in_the_package(root):
    packages = set(setup_arguments(root)['packages'])
    folders = {'.'.join(p.parent.relative_to(root).parts) for p in (root / NAME).rglob('*.py')}
    assert folders <= packages, f'no __init__.py in {sorted(folders - packages)}'


def test_licence(root):
    text = (root / 'LICENSE').read_text()
    assert 'Apache License' in text and 'Version 2.0, January 2004' in text
    assert 'END OF TERMS AND CONDITIONS' in text


def test_every_file_has_a_licence_header(root):
    """Two SPDX lines, so that a file opens with what it is for."""
    wanted = ('# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers\n'
              '# SPDX-License-Identifier: Apache-2.0\n\n"""')
    assert not [str(p.relative_to(root)) for p in python_files(root)
                if (text := p.read_text()).strip() and not text.startswith(wanted)]


def test_set_up_takes_an_interpreter_that_runs(root):
    """A version manager's shim can be on the PATH and fail: the Makefile runs it to see."""
    dry = subprocess.run(['make', '-n', '-B', 'test'], cwd=root, capture_output=True, text=True,
                         env={**os.environ, 'MAKEFLAGS': ''})
    assert dry.returncode == 0, dry.stderr
    assert 'pytest' in dry.stdout and 'sys.version_info' in dry.stdout
