# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""How samples come into the analyser: as messages or as blocks, and when a bag is at its end."""

from __future__ import annotations

from functools import partial
import threading
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from std_msgs.msg import Float64MultiArray

from . import messages
from .streams import SENSORS, Streams
from .topics import complete, ImuInput, overridable, result
from ..core.errors import InputError

_AT_ONCE = 256          # messages read together: one by one costs twenty times as much


class Intake:
    """
    Fills streams from ``imu/data_raw`` or ``imu/buffer``, never both.

    Parameters
    ----------
    node : rclpy.node.Node
        Whose subscriptions they are.
    stream : Streams
        What is filled.
    kind : str
        ``messages`` or ``buffer``.
    accel_topic : str
        Where the accelerations come from, if not in the messages of the rates.

    ``end`` is the number of samples of a bag at its end, as bag_reader says, None while it plays;
    ``passes`` says how often it was played.

    """

    def __init__(self, node, stream: Streams, kind: str, accel_topic: str = ''):
        self._stream, self._say = stream, node.get_logger().warning
        #: by sensor ('': both) messages, and when each came, ns
        self._waiting: dict[str, tuple[list[bytes], list[int]]] = {}
        self._lock = threading.Lock()
        self._quiet, self._seen = 0, 0
        self.end: int | None = None
        self.passes = '0'
        self._told: dict[str, str] = {}
        self._inputs: list[ImuInput] = []
        group = MutuallyExclusiveCallbackGroup()
        if kind == 'messages':
            topics = {'gyro': 'imu/data_raw', 'accel': accel_topic} if accel_topic else {
                '': 'imu/data_raw'}
            self._inputs = [ImuInput(node, partial(self._take, sensor), topic=topic)
                            for sensor, topic in topics.items()]
            self.topic = ','.join(i.topic for i in self._inputs)
        else:
            self.topic = node.resolve_topic_name('imu/buffer')
            node.create_subscription(Float64MultiArray, self.topic, self._take_block, complete(),
                                     callback_group=group, qos_overriding_options=overridable())
        node.create_subscription(DiagnosticArray, 'bag_reader/status', self._hear, result(),
                                 callback_group=group)

    def idle(self) -> int:
        """
        Return how many times in a row this was asked and nothing had come since.

        Counted, not timed: a process that stood still did not wait for data.

        """
        self._quiet = 0 if self._stream.received != self._seen else self._quiet + 1
        self._seen = self._stream.received
        return self._quiet

    @property
    def silence(self) -> InputError | None:
        """Why nothing was ever received; None where something was, or blocks are read."""
        why = [i.silence() for i in self._inputs]
        return why[0] if why and all(why) else None

    def read(self) -> None:
        """Put what waits into the stream."""
        with self._lock:
            waiting, self._waiting = self._waiting, {}
            for sensor in sorted(waiting, key=('', *SENSORS).index):
                batch, arrivals = waiting[sensor]
                samples = messages.samples(batch)
                self._add(samples, sensor, arrivals=np.array(arrivals)[samples.readable],
                          several=self._several)

    def clear(self) -> None:
        """Forget what was received."""
        with self._lock:
            self._waiting = {}
            self._stream.clear()

    def _take(self, sensor: str, batch: list[bytes]) -> None:
        with self._lock:
            waiting, arrivals = self._waiting.setdefault(sensor, ([], []))
            waiting += batch
            arrivals += [time.monotonic_ns()] * len(batch)
            enough = len(waiting) >= _AT_ONCE
        if enough:
            self.read()

    def _take_block(self, message) -> None:
        try:
            first, sensor, samples = messages.samples_of_block(message)
        except ValueError as error:
            self._stream.refused += 1
            self._say(f'{self.topic}: {error}')
            return
        with self._lock:
            self._add(samples, sensor, first)

    def _several(self) -> bool:
        return any(i.several for i in self._inputs)

    def _add(self, samples, sensor: str, first: int | None = None, **more: Any) -> None:
        self._stream.refused += samples.refused
        self._stream.frame_id = samples.frame_id or self._stream.frame_id
        said = self._stream.add(samples.stamps, samples.gyro, samples.accel, first, sensor, **more)
        if said:
            self._say(f'{self.topic}: {said}')

    def _hear(self, message) -> None:
        self._told = {v.key: v.value for s in message.status for v in s.values}
        self.end = int(self._told['samples']) if self._told.get('state') == 'end' else None
        self._stream.expected = self.end
        self.passes = self._told.get('passes', '0')

    @property
    def source(self) -> dict[str, str]:
        """Where the samples come from, as far as is known."""
        return {'path': self._told.get('bag', ''), 'topic': self._told.get('topic') or self.topic,
                'frame_id': self._stream.frame_id or self._told.get('frame_id', '')}
