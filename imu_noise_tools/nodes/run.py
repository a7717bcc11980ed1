"""One way to start, run and stop every node."""

from __future__ import annotations

import os
import signal
import sys
import threading

import rclpy
from rclpy.exceptions import (InvalidParameterTypeException, InvalidParameterValueException,
                              ParameterException)
from rclpy.executors import MultiThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from ..errors import ImuNoiseError

_PATIENCE = 0.3         # s that callbacks under way get to end


def events_executor():
    """Return the executor of lowest latency (in the wheels its ``spin`` is broken)."""
    try:
        from rclpy.experimental.events_executor import EventsExecutor
    except ImportError:                                     # before Jazzy's second half
        from rclpy.executors import SingleThreadedExecutor as EventsExecutor
    return EventsExecutor()


def threads_executor():
    """Return an executor in which a service may compute while data go on arriving."""
    return MultiThreadedExecutor(num_threads=4)


def run(make_node, args=None, make_executor=events_executor) -> int:
    """
    Make a node and spin it until SIGINT or SIGTERM; return the exit status.

    ``rclpy.spin`` with rclpy's own handlers hangs or ends with status 1 on SIGTERM, hence handlers
    that only set an event. A node may have ``finish()``, called once before it is destroyed, to
    save what was gathered; it returns False where something is still under way. A computation
    that is not done by then is dropped.

    Parameters
    ----------
    make_node : callable
        Returns the node. An :class:`~imu_noise_tools.errors.ImuNoiseError` ends it with status 1
        and one line.
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
        executor = make_executor()
        executor.add_node(node)
        while rclpy.ok() and not stop.is_set():
            executor.spin_once(timeout_sec=0.2)
        status = 0
    except ImuNoiseError as error:
        print(f'error: {error}', file=sys.stderr)
        status = 1
    except (InvalidParameterTypeException, InvalidParameterValueException,
            ParameterException) as error:
        print(f'error: {str(error).strip()}', file=sys.stderr)
        status = 1
    finally:
        idle = _close(node, executor)
    if not idle:
        # A pool's threads are joined at exit, so one that computes would hold the process.
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
    return status


def _close(node, executor) -> bool:
    """Save, destroy and shut down; return whether every callback has ended."""
    idle = True
    try:
        if node is not None and hasattr(node, 'finish'):
            idle = node.finish() is not False
    except ImuNoiseError as error:
        print(f'error: {error}', file=sys.stderr)
    finally:
        if isinstance(executor, MultiThreadedExecutor):
            idle &= executor.shutdown(timeout_sec=_PATIENCE)
        elif executor is not None:
            executor.remove_node(node)
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return idle
