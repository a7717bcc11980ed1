# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Work a stream must not wait for: services in another thread, computing in a process."""

from __future__ import annotations

from collections.abc import Callable
from multiprocessing import get_context
from multiprocessing.pool import Pool
import os
import signal
import threading
from typing import Any

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from .run import spin_aside


class Aside:
    """
    Offers the services and timers of a node whose own executor takes messages one by one.

    The events executor runs one callback at a time, and coroutine callbacks do not work in it: a
    service that computes for seconds would hold the stream. The node here is hidden; its services
    bear the names of the other. What computes long runs in a process, since two threads of Python
    take turns: beside one that computes, 1 kHz of messages would wait for half a second.

    Parameters
    ----------
    node : rclpy.node.Node
        Whose services these look like.

    """

    def __init__(self, node: Node) -> None:
        self._of, self._stop = node, threading.Event()
        self._node = Node(f'_{node.get_name()}_aside', namespace=node.get_namespace(),
                          use_global_arguments=False, start_parameter_services=False,
                          enable_rosout=False)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=spin_aside, daemon=True, args=(
            self._executor, self._stop, node.get_logger()))
        self._pool: Pool | None = None

    def begin(self) -> None:
        """Start, once everything is there."""
        self._thread.start()

    def end(self) -> None:
        """Stop; what is under way is dropped."""
        self._stop.set()
        if self._pool is not None:
            self._pool.terminate()
        self._thread.join(0.5)
        if not self._thread.is_alive():
            self._executor.shutdown()
            self._node.destroy_node()

    def compute(self, function: Callable[..., Any], *args: Any) -> Any:
        """Return function(*args), computed in a process that is kept for the next time."""
        if self._pool is None:
            self._pool = get_context('spawn').Pool(1, _modest)
        return self._pool.apply(function, args)

    def get_logger(self) -> Any:
        """Return the logger of the other node."""
        return self._of.get_logger()

    def create_service(self, kind: Any, name: str, callback: Callable[..., Any],
                       callback_group: Any = None) -> Any:
        """Create a service; ``~`` stands for the other node."""
        full = self._of.resolve_service_name(name)
        return self._node.create_service(kind, full, callback, callback_group=callback_group)

    def create_timer(self, period: float, callback: Callable[[], None], clock: Any = None) -> Any:
        """Create a timer."""
        return self._node.create_timer(period, callback, clock=clock)


def _modest() -> None:
    """Make a process give way to the stream, and end when its parent says so, not by Ctrl-C."""
    os.nice(5)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
