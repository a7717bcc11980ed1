# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The manual: every command and every program in it runs, and prints what it shows."""

from __future__ import annotations

import contextlib
import importlib.util
import io
import os
from pathlib import Path
import re
import shlex
import subprocess
import sys

import pytest

from imu_noise_tools.cli.main import parser

DOC = Path(__file__).resolve().parents[1] / 'doc'
LONG = {'tutorial.md', 'ci.md', 'faq.md', 'filter.md', 'record.md', 'own_effect.md',
        'calibrate.md', 'long.md', 'files.md'}  # over 10 s


def module(name):
    """Return a script of doc/ as a module."""
    spec = importlib.util.spec_from_file_location(f'manual_{name}', DOC / f'{name}.py')
    found = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = found      # a dataclass looks its module up
    spec.loader.exec_module(found)
    return found


examples = module('examples')


@pytest.mark.parametrize('page', [
    pytest.param(p, id=str(p.relative_to(DOC)),
                 marks=[pytest.mark.thorough] if p.name in LONG else [])
    for p in examples.pages()])
def test_a_page_runs(page, tmp_path):
    """Else: python doc/examples.py --write, and read what has changed."""
    examples.run(page, tmp_path)


def page_of(tmp_path, text):
    """Return a page inside doc/'s parent, as the runner names them."""
    path = tmp_path / 'page.md'
    path.write_text(text)
    return path


@pytest.mark.parametrize('text, said', [
    ('```console\n$ imu_noise nothing\n```\n', 'exit status 2, not 0'),
    ('```console\n$ echo one 1\none 2\ntwo\n```\n', '-two'),
    ('```console\n$ echo one\ntwo\n```\n', '+one'),
    ('```console\n$ true # exits with 1\n```\n', 'exit status 0, not 1'),
    ('```python\nx = 1\n```\n```python\nassert x == 2\n```\n', 'AssertionError'),
    ('% picture: pictures/no.png = a.study : allan\n', 'no study a.study'),
])
def test_what_is_stale_is_found(tmp_path, monkeypatch, text, said):
    monkeypatch.setattr(examples, 'HERE', tmp_path / 'doc')
    with pytest.raises(examples.Stale, match=re.escape(said)) as stale:
        examples.run(page_of(tmp_path, text), tmp_path)
    assert str(stale.value).startswith('page.md:')


def test_what_fits_passes_and_writing_replaces_only_what_is_shown(tmp_path, monkeypatch):
    monkeypatch.setattr(examples, 'HERE', tmp_path / 'doc')
    text = ('before\n```console\n$ echo a 2; echo b; echo c\na 1\n...\nc\n$ echo hidden\n```\n'
            '```{code-block} yaml\n:caption: x.yaml\n\na: 1\n```\n'
            '```console\n$ cat x.yaml\na: 2\n$ (exit 3) # exits with 3\n```\nafter\n')
    page = page_of(tmp_path, text)
    examples.run(page, tmp_path)
    assert page.read_text() == text
    examples.run(page, tmp_path, write=True)
    assert page.read_text() == text.replace('a: 2', 'a: 1')


def test_every_command_is_run():
    """No block is marked as something that nobody runs."""
    for page in DOC.rglob('*.md'):
        if 'generated' not in page.parts:
            kinds = {b.kind for b in examples.blocks(page.read_text())}
            assert not kinds & {'bash', 'sh', 'shell', ''}, page


@pytest.mark.thorough
def test_the_manual_builds_without_a_warning(tmp_path):
    """By itself, or as `make docs` has just built it where IMU_NOISE_MANUAL says so (.ci/run)."""
    html = Path(os.environ.get('IMU_NOISE_MANUAL') or tmp_path / 'html')
    if 'IMU_NOISE_MANUAL' not in os.environ:
        pytest.importorskip('sphinx', reason='pip install ".[docs]"')
        pytest.importorskip('furo', reason='pip install ".[docs]"')
        done = subprocess.run(
            [sys.executable, '-m', 'sphinx', '-W', '--keep-going', '-q', '-b', 'html', str(DOC),
             str(html), '-d', str(tmp_path / 'trees')], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    effects = (html / 'generated' / 'effects_noise.html').read_text()
    assert 'gauss_markov' in effects and '<math' in ''.join(
        p.read_text() for p in (html / 'theory').glob('*.html'))


def shown_commands():
    """Return (page, command) of all that is shown and not run: text blocks and inline code."""
    found = []
    for page in [*DOC.rglob('*.md'), DOC.parent / 'README.md']:
        if 'generated' in page.parts or page.name in examples.ELSEWHERE:
            continue
        text = page.read_text(encoding='utf-8')
        lines = [line for b in examples.blocks(text) if b.kind == 'text'
                 for line in b.text.splitlines()]
        prose = re.sub(r'^```.*?^```', '', text, flags=re.M | re.S)
        lines += [' '.join(m.split()) for m in re.findall(r'`([^`]+)`', prose)]
        found += [(page.relative_to(DOC.parent), line.split('  #')[0].strip()) for line in lines
                  if re.match(r'(imu_noise|ros2|make|pip install) ', line)]
    return found


def wrong_with(command):
    """Return what is wrong with a command that is only shown: '' where nothing is."""
    root = DOC.parent
    words = shlex.split(command)
    if words[0] == 'ros2' and len(words) < 4:       # the name of a command of ROS, no more
        return ''
    if words[0] == 'imu_noise':
        words = [w for w in words if not w.startswith(('…', '...', '[', '|', '>'))]
        try:
            with contextlib.redirect_stderr(io.StringIO()) as said:
                parser().parse_args(words[1:])
        except SystemExit as end:
            # what is shown without its arguments names a command
            bare = len(words) == 2 and 'are required' in said.getvalue()
            return '' if end.code == 0 or bare else said.getvalue()
    elif words[0] == 'make':
        goal = next(w for w in words[1:] if '=' not in w)
        return '' if re.search(rf'^{goal}:', (root / 'Makefile').read_text(), re.M) else 'target'
    elif words[:2] == ['ros2', 'launch']:
        text = (root / 'launch' / words[3]).read_text()
        return ' '.join(w for w in words[4:]
                        if f"DeclareLaunchArgument('{w.split(':=')[0]}'" not in text)
    elif words[:2] == ['ros2', 'run']:
        known = "'imu_noise'" + (root / 'setup.py').read_text()
        return '' if f"'{words[3]}'" in known else 'executable'
    elif words[:3] == ['ros2', 'service', 'call']:
        _, node, name = words[3].split('/')
        return '' if (root / 'imu_noise_tools' / 'nodes' / f'{node}.py').exists() and \
            f"'{name}'" in ''.join(p.read_text() for p in (root / 'imu_noise_tools' / 'nodes')
                                   .glob('*.py')) else 'service'
    elif words[0] == 'pip':
        extras = re.findall(r'\[([\w,]+)\]', command)
        setup = (root / 'setup.py').read_text()
        return ' '.join(e for group in extras for e in group.split(',') if f"'{e}':" not in setup)
    return ''


def test_commands_that_are_only_shown_exist():
    """Those with placeholders, for a robot or for set-up: options, nodes, targets are there."""
    some = shown_commands()
    assert len(some) > 30
    assert not {(str(page), c): said for page, c in some if (said := wrong_with(c))}


@pytest.mark.parametrize('command', [
    'imu_noise analyse', 'imu_noise analyse b --points 7', 'make docs', 'pip install ".[ros]"',
    'ros2 launch imu_noise_tools live.launch.py imu:=/x', 'ros2 run imu_noise_tools filter',
    'ros2 service call /analyser/analyse std_srvs/srv/Trigger'])
def test_a_command_that_exists_passes(command):
    assert wrong_with(command) == ''


@pytest.mark.parametrize('command', [
    'imu_noise nothing', 'imu_noise analyse b --pints 7', 'make tea', 'pip install ".[tea]"',
    'ros2 launch imu_noise_tools live.launch.py tea:=/x', 'ros2 run imu_noise_tools tea',
    'ros2 service call /analyser/tea std_srvs/srv/Trigger'])
def test_a_command_that_does_not_exist_is_found(command):
    assert wrong_with(command)
