# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A process that computes one thing after another, and tells how far it is.

Beside a thread that fits models others would wait for their turn: two threads of Python take
turns, two processes do not.

"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection
import os
import signal
import sys
import threading
from typing import Any

from ..core.errors import ImuNoiseError, InputError
from ..loop.effect import load_effects, loaded_effects


class StoppedError(InputError):
    """What was under way was stopped."""


class Worker:
    """Computes in a process that is kept for the next time, and knows a user's own effects."""

    def __init__(self) -> None:
        self._process: Any = None
        self._pipe: Any = None

    def start(self) -> None:
        """Start the process, if it is not there."""
        if self._process is None or not self._process.is_alive():
            context = get_context('spawn')
            self._pipe, other = context.Pipe()
            self._process = context.Process(
                target=_work, args=(other, loaded_effects()), daemon=True)
            self._process.start()
            other.close()

    def run(self, function: Callable[..., Any], *args: Any,
            tell: Callable[..., None] | None = None) -> Any:
        """
        Return ``function(*args, tell)``, computed there: what it tells there is told here.

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
                if kind == 'told' and tell:
                    tell(*said)
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


def _end_with_parent() -> None:
    """Ask this process to end once the one that began it is gone, however that ended."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os.kill(os.getpid(), signal.SIGTERM)


def _work(pipe: Connection, own: Sequence[str]) -> None:
    """Serve until the other end is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    os.nice(5)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    for path in own:
        load_effects(path)

    def tell(*said: Any) -> None:
        pipe.send(('told', *said))

    while True:
        try:
            function, args = pipe.recv()
        except EOFError:
            return
        try:
            pipe.send(('done', function(*args, tell)))
        except ImuNoiseError as error:
            pipe.send(('failed', error))
        except Exception as error:          # a defect must not take the page along
            pipe.send(('failed', InputError(
                f'unexpected {type(error).__name__} ({error})',
                'this is a defect of imu_noise; please report it with the input')))
