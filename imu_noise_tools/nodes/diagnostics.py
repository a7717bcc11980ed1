# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How a node and its IMU are, on ``/diagnostics``, where a robot's monitors look.

Once a second, as they expect: every status bears the node's name, and the IMU's frame as its
``hardware_id``. Levels: OK; WARN: beyond chance, or something was lost; ERROR: no result, or an
axis that gives none; STALE: nothing comes.

"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.qos import QoSProfile

from . import messages

_QUIET = 3          # times told without a sample, after which what comes is stale


class Diagnostics:
    """
    The statuses of a node on ``/diagnostics``.

    Parameters
    ----------
    node : rclpy.node.Node
        Whose they are.
    statuses : callable
        Returns those of the moment; the first is of what comes in, and becomes STALE where nothing
        does.
    received : callable
        Returns how many samples came, or None where no more are to come.
    hardware : callable
        Returns what the IMU is called.

    Whoever makes it calls :meth:`tell` once a second.

    """

    def __init__(self, node, statuses: Callable[[], Iterable[DiagnosticStatus]],
                 received: Callable[[], int | None], hardware: Callable[[], str]) -> None:
        self._node, self._statuses = node, statuses
        self._received, self._hardware = received, hardware
        self._before: int | None = 0
        self._quiet = _QUIET        # nothing has come yet
        self._output = node.create_publisher(DiagnosticArray, '/diagnostics', QoSProfile(depth=10))

    def tell(self) -> None:
        """Publish."""
        now = self._received()
        self._quiet = 0 if now is None or now != self._before else self._quiet + 1
        self._before = now
        name = self._node.get_fully_qualified_name().strip('/')
        out = []
        for k, status in enumerate(self._statuses()):
            if k == 0 and self._quiet >= _QUIET:
                status.level = messages.STALE
                status.message = f'nothing comes; {status.message}'
            status.name = f'{name}: {status.name}'
            status.hardware_id = self._hardware()
            out.append(status)
        self._output.publish(messages.diagnostics(self._node, out))
