# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The manual: every command and every program in it runs, and prints what it shows."""

from __future__ import annotations

import importlib.util
from pathlib import Path
import re
import subprocess
import sys

import pytest

DOC = Path(__file__).resolve().parents[1] / 'doc'
LONG = {'tutorial.md'}      # over 40 s of computing


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


def test_the_manual_builds_without_a_warning(tmp_path):
    pytest.importorskip('sphinx', reason='pip install ".[docs]"')
    pytest.importorskip('furo', reason='pip install ".[docs]"')
    done = subprocess.run(
        [sys.executable, '-m', 'sphinx', '-W', '--keep-going', '-q', '-b', 'html', str(DOC),
         str(tmp_path / 'html'), '-d', str(tmp_path / 'trees')], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    effects = (tmp_path / 'html' / 'generated' / 'effects_noise.html').read_text()
    assert 'gauss_markov' in effects and '<math' in ''.join(
        p.read_text() for p in (tmp_path / 'html' / 'theory').glob('*.html'))
