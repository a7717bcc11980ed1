# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A process that computes one thing after another, and says how far it is.

Beside a thread that fits models the threads of a page would wait for their turn: two threads of
Python take turns, two processes do not.

"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from multiprocessing import get_context
from multiprocessing.connection import Connection
import os
import signal
import sys
from typing import Any

from ..core.errors import ImuNoiseError, InputError
from ..loop.effect import load_effects

Progress = Callable[[float | None, str], None]


class StoppedError(InputError):
    """What was under way was stopped."""


class Worker:
    """
    Computes in a process that is kept for the next time.

    Parameters
    ----------
    effects_from : sequence of str
        Files of a user's own effects, which the process has to know as well.

    """

    def __init__(self, effects_from: Sequence[str] = ()) -> None:
        self._effects = tuple(effects_from)
        self._process: Any = None
        self._pipe: Any = None

    def start(self) -> None:
        """Start the process, if it is not there."""
        if self._process is None or not self._process.is_alive():
            context = get_context('spawn')
            self._pipe, other = context.Pipe()
            self._process = context.Process(
                target=_work, args=(other, self._effects), daemon=True)
            self._process.start()
            other.close()

    def run(self, function: Callable[..., Any], *args: Any,
            progress: Progress | None = None) -> Any:
        """
        Return ``function(*args, progress)``, computed there.

        Raises
        ------
        ImuNoiseError
            What the function raised, or what went wrong with it.
        StoppedError
            :meth:`stop` was called.

        """
        self.start()
        try:
            self._pipe.send((function, args))
            while True:
                kind, *said = self._pipe.recv()
                if kind == 'progress' and progress:
                    progress(*said)
                elif kind == 'done':
                    return said[0]
                elif kind == 'failed':
                    raise said[0]
        except (EOFError, BrokenPipeError, ConnectionResetError):
            raise StoppedError('stopped', 'nothing was changed') from None

    def stop(self) -> None:
        """End the process, and what it computes; it takes what it was writing away."""
        process, self._process = self._process, None
        if process is not None:
            process.terminate()
            process.join(2.0)
            if process.is_alive():
                process.kill()
                process.join()


def _work(pipe: Connection, effects_from: Sequence[str]) -> None:
    """Serve until the other end is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    os.nice(5)
    for path in effects_from:
        load_effects(path)

    def progress(share: float | None, what: str = '') -> None:
        pipe.send(('progress', share, what))

    while True:
        try:
            function, args = pipe.recv()
        except EOFError:
            return
        try:
            pipe.send(('done', function(*args, progress)))
        except ImuNoiseError as error:
            pipe.send(('failed', error))
        except Exception as error:          # a defect must not take the page along
            pipe.send(('failed', InputError(
                f'unexpected {type(error).__name__} ({error})',
                'this is a defect of imu_noise; please report it with the input')))
