# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""One way to start, run and stop every node."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import os
import signal
import sys
import threading
import time
import traceback
from typing import Any

import rclpy
from rclpy.exceptions import (
    InvalidParameterTypeException,
    InvalidParameterValueException,
    ParameterException,
)
from rclpy.executors import MultiThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from .params import not_heeded
from ..core.errors import ImuNoiseError

_REPEATED = 60.0            # s after which what goes on failing is logged again
_PAUSE = 0.02               # s; what fails at once, again and again, must not take a core
_SETTLE = 0.5               # s that callbacks have to end, of the two that a stop may take
_busy: list[object] = []
_ending = threading.Event()


def events_executor() -> Any:
    """Return the executor of lowest latency (in the wheels its ``spin`` is broken)."""
    try:
        from rclpy.experimental.events_executor import EventsExecutor
    except ImportError:                                     # before Jazzy's second half
        from rclpy.executors import SingleThreadedExecutor as EventsExecutor
    return EventsExecutor()


def threads_executor() -> MultiThreadedExecutor:
    """Return an executor in which a service may compute while data go on arriving."""
    return MultiThreadedExecutor(num_threads=4)


def run(make_node: Callable[[], Any], args: list[str] | None = None,
        make_executor: Callable[[], Any] = events_executor) -> int:
    """
    Make a node and spin it until SIGINT or SIGTERM; return the exit status.

    ``rclpy.spin`` with rclpy's own handlers hangs or ends with status 1 on SIGTERM, hence handlers
    that only set an event. A node may have ``finish()``, called once before it is destroyed, to
    save what was gathered, and may set ``status`` to end by itself with it. A computation still
    :func:`under_way` then is dropped.

    Parameters
    ----------
    make_node : callable
        Returns the node. An :class:`~imu_noise_tools.core.errors.ImuNoiseError` ends it with
        status 1 and one line.
    args : list of str or None
        ROS arguments, those of the process by default.
    make_executor : callable
        :func:`events_executor` or :func:`threads_executor`.

    """
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    node = executor = None
    try:
        node = make_node()
        for sentence in not_heeded(node):
            node.get_logger().warning(sentence)
        executor = make_executor()
        executor.add_node(node)
        while rclpy.ok() and not stop.is_set() and getattr(node, 'status', None) is None:
            executor.spin_once(timeout_sec=0.2)
        status = getattr(node, 'status', None) or 0
    except ImuNoiseError as error:
        print(f'error: {error}', file=sys.stderr)
        status = 1
    except (InvalidParameterTypeException, InvalidParameterValueException,
            ParameterException) as error:
        print(f'error: {str(error).strip()}', file=sys.stderr)
        status = 1
    finally:
        _ending.set()
        _close(node, executor)
    if _busy:
        # Threads of a pool are joined at exit, so one that computes would hold the process.
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
    return status


def spin_aside(executor: Any, stop: threading.Event, logger: Any) -> None:
    """
    Take callbacks beside the stream until ``stop`` is set: what a thread of its own runs.

    An executor raises what a callback did, which would end the thread without a word, and with it
    every service and timer that it has. It is logged, once a minute of each place that raises.

    """
    logged: dict[Any, float] = {}
    while not stop.is_set() and executor.context.ok():
        try:
            executor.spin_once(timeout_sec=0.2)
        except Exception as error:
            if stop.is_set() or not executor.context.ok():
                return                          # taken down while it worked
            place, now = traceback.extract_tb(error.__traceback__)[-1], time.monotonic()
            where = (type(error), place.filename, place.lineno)
            if now - logged.get(where, -_REPEATED) >= _REPEATED:
                logged[where] = now
                logger.error(traceback.format_exc())
            stop.wait(_PAUSE)


def _close(node, executor) -> None:
    """Save, destroy and shut down."""
    try:
        if hasattr(node, 'finish'):
            node.finish()
    except ImuNoiseError as error:
        print(f'error: {error}', file=sys.stderr)
    finally:
        if executor is not None:
            executor.remove_node(node)
            _settle(executor)
            executor.shutdown(timeout_sec=0.0)      # else its handles outlive the context
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()


def _settle(executor) -> None:
    """Let callbacks end that a pool of threads has begun, but for computations."""
    # Else they reach for what is destroyed beneath them, and rclpy prints that. Its own shutdown
    # does not wait (it asks for what it has just set), and has no public name for what runs.
    end = time.monotonic() + _SETTLE
    while (not _busy and time.monotonic() < end
           and not all(task.done() for task in getattr(executor, '_futures', ()))):
        time.sleep(0.005)


def ending() -> bool:
    """Tell whether the node is being taken down, so that what is under way fails for that."""
    return _ending.is_set()


@contextmanager
def under_way() -> Iterator[None]:
    """Say that something is computed which a signal need not wait for."""
    mark = object()
    _busy.append(mark)
    try:
        yield
    finally:
        _busy.remove(mark)
