# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What shells offer at the tab key: real shells, as far as they are installed."""

from __future__ import annotations

import os
from pathlib import Path
import pty
import select
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.store import study_files
from imu_noise_tools.tasks.noise import analyse_record

pytest.importorskip('argcomplete')
COMMAND = Path(sys.executable).with_name('imu_noise')
needs_command = pytest.mark.skipif(not COMMAND.is_file(), reason='imu_noise is not installed')
READY = 'ready-for-it'


def environment() -> dict:
    """Return an environment in which the shell finds this command first."""
    return {**os.environ, 'PATH': f'{COMMAND.parent}:{os.environ["PATH"]}', 'TERM': 'dumb',
            'COLUMNS': '200', 'LINES': '200'}


class Shell:
    """A shell at a terminal, to which lines are typed."""

    def __init__(self, *words: str, folder: Path) -> None:
        self.pid, self.fd = pty.fork()
        if self.pid == 0:
            os.chdir(folder)
            os.execvpe(words[0], words, environment())

    def said(self, until: str, seconds: float = 60.0) -> str:
        """Return what it prints up to some words."""
        out, end = '', time.monotonic() + seconds
        while time.monotonic() < end:
            if select.select([self.fd], [], [], 0.2)[0]:
                out += os.read(self.fd, 65536).decode(errors='replace').replace('\a', '')
            if until in out:
                return out
        raise AssertionError(f'{until!r} did not come: {out!r}')

    def type(self, text: str) -> None:
        """Type something."""
        os.write(self.fd, text.encode())

    def close(self) -> None:
        """End it."""
        os.kill(self.pid, signal.SIGKILL)
        os.waitpid(self.pid, 0)
        os.close(self.fd)


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    """Return a folder with a study of two axes in it."""
    folder = tmp_path_factory.mktemp('completion')
    gyro = np.random.default_rng(1).standard_normal((7000, 3)) * 1e-3
    study = analyse_record(ImuRecord(gyro, None, np.arange(7000) / 100, 100.0),
                           axes=['gyro_x', 'gyro_z'])
    (folder / 'my.study').mkdir()
    for name, data in study_files(study).items():
        (folder / 'my.study' / name).write_bytes(
            data if isinstance(data, bytes) else data.encode())
    (folder / 'mine.yaml').touch()
    return folder


@pytest.fixture(params=['bash', 'zsh'])
def shell(request, folder):
    """Return a shell whose completion is set up as `imu_noise completion --help` says."""
    name = request.param
    if not shutil.which(name) or not COMMAND.is_file():
        pytest.skip(f'no {name}, or imu_noise is not installed')
    words = {'bash': ('bash', '--norc', '--noprofile', '-i'), 'zsh': ('zsh', '-f', '-i')}[name]
    shell = Shell(*words, folder=folder)
    if name == 'zsh':
        shell.type('autoload -U compinit; compinit -u -D; unsetopt ZLE_RPROMPT_INDENT\n')
    shell.type(f'PS1=; eval "$(imu_noise completion {name})"; echo {READY[:5]}"{READY[5:]}"\n')
    shell.said(READY)
    yield shell
    shell.close()


@pytest.mark.parametrize('typed, whole', [
    ('expo', 'export '), ('analyse x --effects white,flick', 'white,flicker'),
    ('add my.study --axis gy', 'gyro_'), ('diagnose my.study --axis gy', 'gyro_'),
    *(pytest.param(*more, marks=pytest.mark.thorough) for more in (
        ('analyse --effe', '--effects'), ('export my.study --format openv', 'openvins '),
        ('remove my.study random_w', 'random_walk '), ('sheet bmi0', 'bmi088 ')))])
def test_a_shell_completes_at_the_tab_key(shell, typed, whole):
    """The line is shown as the shell completes it."""
    shell.type(f'imu_noise {typed}\t')
    shell.said(whole.rstrip())
    shell.type('\x03')


@needs_command
@pytest.mark.parametrize('typed, some, none', [
    ('', ('analyse', 'calibrate', 'filter', 'export', 'completion'), ('bmi088',)),
    ('add my.study --axis ', ('gyro_x', 'gyro_z'), ('gyro_y', 'accel_x')),
    ('analyse x --effects white,', ('white,flicker',), ('white,white',)),
    ('sheet ', ('bmi088', 'mine.yaml'), ()),
    *(pytest.param(*more, marks=pytest.mark.thorough) for more in (
        ('export my.study --format ', ('kalibr', 'gtsam', 'px4'), ('bmi088', '_values')),
        ('export my.study --axes ', ('worst', 'mean', 'each'), ('gyro_x',)),
        ('add my.study ', ('sinusoid', 'gauss_markov'), ('ar_increment', 'tilt')),
        ('remove my.study ', ('white', 'flicker', 'random_walk'), ('sinusoid',)),
        ('effects ', ('flicker', 'ar_increment', 'tilt'), ()),
        ('filter x --noise ', ('outliers', 'gauss_markov'), ('constant_rate',)),
        ('calibrate x --sensor ', ('accel', 'gyro'), ())))])
def test_fish_offers_what_fits(folder, typed, some, none):
    """By the shell's own ``complete -C``; where there is no fish, by what fish would run."""
    fish = shutil.which('fish')
    line = f'imu_noise {typed}'
    if fish:
        code = f'imu_noise completion fish | source; complete -C "{line}"'
        done = subprocess.run([fish, '--no-config', '-c', code], capture_output=True, text=True,
                              env=environment(), cwd=folder, timeout=120)
        out = [x.split('\t')[0] for x in done.stdout.splitlines()]
    else:
        done = subprocess.run(
            ['bash', '-c', f'exec 8>&1; "{COMMAND}"'], capture_output=True, text=True, timeout=120,
            env={**environment(), '_ARGCOMPLETE': '1', 'COMP_LINE': line, '_ARGCOMPLETE_IFS': '\n',
                 'COMP_POINT': str(len(line)), '_ARGCOMPLETE_SUPPRESS_SPACE': '1'}, cwd=folder)
        out = done.stdout.split('\n')
    for name in some:
        assert name in out, (out, done.stderr)
    for name in none:
        assert name not in out


@needs_command
def test_completing_a_command_is_quick():
    """Under half a second of CPU: nothing heavy is loaded for names of commands."""
    line = 'imu_noise ana'
    env = {**environment(), '_ARGCOMPLETE': '1', 'COMP_LINE': line, 'COMP_POINT': str(len(line))}
    code = ('import resource, subprocess, sys\n'
            f'subprocess.run(["bash", "-c", "exec 8>/dev/null; {COMMAND}"])\n'
            'print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime)')
    took = min(float(subprocess.run([sys.executable, '-c', code], env=env, capture_output=True,
                                    text=True, check=True).stdout) for _ in range(3))
    assert took < 0.5


def test_without_argcomplete_it_says_how_to_get_it(tmp_path):
    (tmp_path / 'argcomplete.py').write_text('raise ImportError\n')
    done = subprocess.run([sys.executable, '-m', 'imu_noise_tools.cli.main', 'completion', 'zsh'],
                          capture_output=True, text=True,
                          env={**os.environ, 'PYTHONPATH': str(tmp_path)})
    assert done.returncode == 1 and 'pip install argcomplete' in done.stderr
