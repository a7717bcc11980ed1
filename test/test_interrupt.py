# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Ctrl-C while a program is loaded: it ends as any program does, without a word."""

import os
from pathlib import Path
import signal
import subprocess
import sys

import pytest

ROOT = Path(__file__).resolve().parents[1]
PROGRAMS = {'imu_noise': ('imu_noise_tools.cli.main', 'argparse'),
            **{node: (f'imu_noise_tools.nodes.{node}', 'rclpy')
               for node in ('bag_reader', 'analyser', 'calibration', 'filter')}}
# The first thing of weight that it imports, in which Ctrl-C comes and is lost on the way.
STUB = """
import os, signal, time
try:
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(5)
except KeyboardInterrupt as error:
    raise ImportError from error
"""


def run(folder, *words):
    """Run Python, of which a shell may have asked to ignore Ctrl-C where tests run aside."""
    return subprocess.run(
        [sys.executable, *words], capture_output=True, text=True, cwd=folder, timeout=60,
        env={**os.environ, 'PYTHONPATH': f'{folder}{os.pathsep}{ROOT}'},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))


@pytest.mark.parametrize('how', ['module', 'script'])
@pytest.mark.parametrize('program', PROGRAMS)
def test_ctrl_c_while_a_program_is_loaded(tmp_path, program, how):
    module, first = PROGRAMS[program]
    (tmp_path / f'{first}.py').write_text(STUB)
    (tmp_path / program).write_text(f'import sys\nfrom {module} import main\nsys.exit(main())\n')
    done = run(tmp_path, *(['-m', module] if how == 'module' else [program]))
    assert done.returncode == -signal.SIGINT and not done.stderr, done.stderr


def test_who_imports_them_keeps_its_own_ctrl_c(tmp_path):
    (tmp_path / 'own.py').write_text(
        'import signal\nimport imu_noise_tools.cli.main, imu_noise_tools.nodes\n'
        'assert signal.getsignal(signal.SIGINT) == signal.default_int_handler\n')
    done = run(tmp_path, 'own.py')
    assert done.returncode == 0, done.stderr
