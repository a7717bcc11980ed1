# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Entry point of ``imu_noise``: one parser, one way for every error to reach a person."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
import importlib
import importlib.util
import os
import signal
import sys
import threading
from typing import Any
import warnings

from . import common, completion
from ..core.errors import ImuNoiseError, unknown, UsageError
from ..core.interrupt import loaded

# The matrices here are small: threads of a linear algebra library cost more than they bring.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

# Each registers its commands; what they need beyond argparse they import when they run.
MODULES = ('noise', 'loop', 'calibration', 'filter', 'tools', 'sheet', 'fleet', 'demo', 'explore',
           'completion')


class Parser(argparse.ArgumentParser):
    """A parser that answers a mistyped command or choice with the nearest."""

    def _check_value(self, action, value) -> None:
        known = [str(c) for c in action.choices or ()]
        if known and value not in action.choices:
            error = unknown(action.dest, value, known)
            raise argparse.ArgumentError(None, str(error))


def parser() -> argparse.ArgumentParser:
    """Return the parser of all commands."""
    from .. import __version__

    top = Parser(
        prog='imu_noise',
        description='How good is my IMU, and what is wrong with my model of it?',
        epilog='Start with: imu_noise inspect BAG; imu_noise analyse BAG; imu_noise diagnose '
        'BAG.study',
    )
    top.add_argument('--version', action='version', version=__version__)
    commands = top.add_subparsers(dest='command', metavar='COMMAND', required=True)
    for name in MODULES:
        if importlib.util.find_spec(f'{__package__}.{name}'):
            importlib.import_module(f'{__package__}.{name}').register(commands)
    return top


@contextmanager
def _ended_by_signals() -> Iterator[None]:
    """
    Raise KeyboardInterrupt for Ctrl-C, and Terminated, which is one, for other requests to end.

    SIGTERM comes of docker stop, systemd and CI, SIGHUP of a closed terminal.

    """
    before: dict[int, Any] = {}

    def end(number, _):
        for one in before:      # `timeout` sends it twice: the second would stop the cleaning up
            signal.signal(one, signal.SIG_IGN)
        raise common.Terminated(number)

    if threading.current_thread() is threading.main_thread():
        loaded()
        for number in (signal.SIGTERM, signal.SIGHUP):
            if signal.getsignal(number) == signal.SIG_DFL:      # nohup ignores SIGHUP
                before[number] = signal.signal(number, end)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def main(argv: Sequence[str] | None = None) -> int:
    """
    Run one command.

    Return its exit status: 0 done, 1 bad input, 2 wrong usage, 130 interrupted (143, 129 by
    SIGTERM, SIGHUP).

    """
    commands = parser()
    completion.answer(commands)
    args = commands.parse_args(argv)
    try:
        with _ended_by_signals(), warnings.catch_warnings():
            if not sys.warnoptions:     # numpy's are for who programs; ours are printed
                warnings.simplefilter('ignore', RuntimeWarning)
            return args.func(args) or 0
    except UsageError as error:
        _say(error)
        return 2
    except ImuNoiseError as error:
        _say(error)
        return 1
    except KeyboardInterrupt as stop:
        status = common.status_of(stop)
        try:
            print('interrupted', file=sys.stderr)
        except OSError:         # of a terminal that is closed
            pass
        return status
    except BrokenPipeError:
        sys.stderr.close()
        return 1
    except MemoryError:
        _say('not enough memory for this record: analyse fewer axes with --axes, or a part of it')
        return 1
    except OSError as error:
        _say(f'{error.filename or ""}: {error.strerror or error}'.lstrip(': '))
        return 1
    except Exception as error:
        if getattr(args, 'verbose', False):
            raise
        _say(
            f'unexpected {type(error).__name__} ({error}): this is a defect of imu_noise; please '
            'report it with the input (-v shows where)'
        )
        return 1


def _say(error):
    for said in getattr(error, 'warnings', ()):
        print(f'warning: {said}', file=sys.stderr)
    print(f'imu_noise: {" ".join(str(error).split())}', file=sys.stderr)


if __name__ == '__main__':
    sys.exit(main())
