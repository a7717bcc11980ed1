# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a running analyser publishes, kept for who looks at it; its services, to be called."""

from __future__ import annotations

from collections.abc import Callable
import threading
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

from . import messages
from .run import spin_aside
from .topics import result
from ..core.errors import InputError
from ..core.files import plain_yaml
from ..core.record import AXES

THERE, PATIENCE = 10.0, 600.0       # s until a service is there; that it may take to answer
SERVICES = ('analyse', 'diagnose', 'add_best', 'remove_last', 'save', 'reset')


class Follower:
    """
    A node beside a running analyser.

    Parameters
    ----------
    name : str
        Of the analyser, with its namespace: ``/analyser``.

    Attributes
    ----------
    curves : dict of str to dict of str to ndarray (k,)
        The columns of ``~/allan/<axis>`` by name, and under ``label`` whether it is live.
    said : dict of str to list of (name, message, {key: value})
        The statuses of ``~/coefficients``, ``~/diagnosis`` and ``~/status``.
    version : int
        Goes up with each message.

    """

    def __init__(self, name: str) -> None:
        self.name = '/' + name.strip('/')
        self.curves: dict[str, dict[str, Any]] = {}
        self.said: dict[str, list[tuple[str, str, dict[str, str]]]] = {}
        self.version = 0
        self._context = rclpy.Context()
        rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node('imu_noise_explore', context=self._context,
                                       enable_rosout=False, start_parameter_services=False)
        for axis in AXES:
            self._listen(Float64MultiArray, f'allan/{axis}', self._take_curve(axis))
        for topic in ('coefficients', 'diagnosis', 'status'):
            self._listen(DiagnosticArray, topic, self._take_statuses(topic))
        self._clients = {s: self._node.create_client(Trigger, f'{self.name}/{s}')
                         for s in (*SERVICES, 'history')}
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=spin_aside, daemon=True, args=(
            self._executor, self._stop, self._node.get_logger()))
        self._thread.start()

    def _listen(self, kind: Any, topic: str, take: Callable[[Any], None]) -> None:
        self._node.create_subscription(kind, f'{self.name}/{topic}', take, result())

    def _take_curve(self, axis: str) -> Callable[[Any], None]:
        def take(message: Any) -> None:
            label, columns, rows = messages.rows_of(message)
            self.curves[axis] = {'label': label, **dict(zip(columns, np.array(rows.T)))}
            self.version += 1
        return take

    def _take_statuses(self, topic: str) -> Callable[[Any], None]:
        def take(message: Any) -> None:
            self.said[topic] = [(s.name, s.message, {v.key: v.value for v in s.values})
                                for s in message.status]
            self.version += 1
        return take

    def call(self, service: str) -> dict[str, Any]:
        """
        Return what a service answers; it takes as long as the work does.

        Raises
        ------
        InputError
            The node is not there, or refuses.

        """
        client = self._clients[service]
        if not self._waited(client.service_is_ready, THERE):
            raise InputError(f'{self.name} is not there', 'start the analyser, in this ROS domain')
        future = client.call_async(Trigger.Request())
        if not self._waited(future.done, PATIENCE):
            raise InputError(f'{self.name}/{service} does not answer', 'see its log')
        answer = future.result()
        found = plain_yaml(answer.message) or {}
        if not answer.success:
            raise InputError(str(found.get('error', answer.message)),
                             str(found.get('remedy', '')))
        return found

    def _waited(self, such: Callable[[], bool], seconds: float) -> bool:
        """Wait until something is so, or this ends; return whether it is."""
        end = time.monotonic() + seconds
        while not such() and time.monotonic() < end and not self._stop.wait(0.05):
            pass
        return such()

    def stop(self) -> None:
        """Wait for nothing any more."""
        self._stop.set()

    def close(self) -> None:
        """End."""
        self.stop()
        self._thread.join(2.0)
        self._executor.shutdown(timeout_sec=0.0)
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)
