# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The bag_reader node: plays a recorded bag, message by message or block by block."""

from __future__ import annotations

from collections.abc import Callable
import sys
import time

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.duration import Duration
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.time import Time
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

from . import messages
from .params import Setting, Settings
from .playback import about, Piece, pieces, Player
from .run import run
from .topics import complete, overridable, result, STEADY
from ..core.errors import InputError

_UNDER_WAY = 16             # blocks not yet acknowledged: they are held in memory
_TICK = 0.01                # s between two messages on /clock


class BagReader(Node):
    """Plays a bag: where a :class:`~imu_noise_tools.nodes.playback.Player` puts its pieces."""

    def __init__(self) -> None:
        super().__init__('bag_reader')
        self._settings = p = Settings(
            self,
            Setting('bag', '', 'rosbag1 file, rosbag2 folder, .mcap, .db3, .csv or .npz',
                    fixed=True),
            Setting('topic', '', 'Imu topic of the bag; empty: the only one', fixed=True),
            Setting('fields', '', 'of messages of another type: gyro=PATH,accel=PATH,'
                    'stamp=PATH:us', fixed=True),
            Setting('speed', 0.0, 'times real time; 0: as fast as the subscribers take it',
                    unit='1', low=0.0, high=1e6),
            Setting('start', 0.0, 'where to begin, after the first stamp', 's', 0.0, 1e9,
                    fixed=True),
            Setting('duration', 0.0, 'how much to play; 0: to the end', 's', 0.0, 1e9,
                    fixed=True),
            Setting('publish', 'both', 'blocks on imu/buffer, messages on imu/data_raw, or both',
                    choices=('buffer', 'messages', 'both'), fixed=True),
            Setting('wait_for_subscribers', 10.0, 'longest wait for somebody to listen; 0: none',
                    's', 0.0, 86400.0, fixed=True),
            Setting('readers', [''], 'nodes that must listen before it plays, e.g. analyser; '
                    'none: whoever comes', fixed=True),
            Setting('loop', False, 'begin again at the end'),
            Setting('clock', False, 'publish the stamps on /clock', fixed=True),
            Setting('stamps', 'header', 'keep the header stamps, or stamp with the present time',
                    choices=('header', 'now')))
        if not p['bag']:
            raise InputError('no bag is given', 'give one with -p bag:=PATH')
        bag, topic, fields = p['bag'], p['topic'] or None, p['fields'] or None
        self._total, self._of, said = about(bag, topic, p['publish'] != 'buffer', fields)
        if said:
            self.get_logger().warning(said)
        self._messages = self._publish_on(Imu, 'imu/data_raw') \
            if p['publish'] != 'buffer' else None
        self._blocks = self._publish_on(Float64MultiArray, 'imu/buffer') \
            if p['publish'] != 'messages' else None
        self._clock_topic = self.create_publisher(Clock, '/clock', 10) if p['clock'] else None
        self._status = self.create_publisher(DiagnosticArray, '~/status', result())
        self.create_service(Trigger, '~/restart', self._restart)
        self.create_service(Trigger, '~/pause', self._pause)
        self.create_timer(0.5, self._tell, clock=STEADY)
        self._tick_at, self._since_flush = 0.0, 0
        self._player = Player(
            lambda: pieces(bag, topic, self._messages is not None, fields), self, p['speed'],
            p['start'], p['duration'], p['wait_for_subscribers'], p['loop'])
        p.changed = self._changed
        self._changed({})
        self._player.begin()

    def _publish_on(self, kind, topic: str):
        return self.create_publisher(kind, topic, complete(), qos_overriding_options=overridable())

    # What the player calls, in its thread.

    def listeners(self) -> list[int]:
        """Return how many listen to each output."""
        return [o.get_subscription_count() for o in self._outputs()]

    def missing(self) -> list[str]:
        """Return which of the readers that must listen are not there yet."""
        space = self.get_namespace().rstrip('/')
        wanted = [r if r.startswith('/') else f'{space}/{r}' for r in self._settings['readers']]
        if not wanted:
            return []
        there = self._readers()
        # a reader that the graph shows is not yet one that gets what is sent
        known = all(o.get_subscription_count() >= self.count_subscribers(o.topic_name)
                    for o in self._outputs())
        return [r for r in wanted if r not in there or not known]

    def _outputs(self) -> list:
        return [o for o in (self._messages, self._blocks) if o is not None]

    def _readers(self) -> list[str]:
        """Return the full names of the nodes that listen to an output."""
        return sorted({
            f'{i.node_namespace.rstrip("/")}/{i.node_name}' for o in self._outputs()
            for i in self.get_subscriptions_info_by_topic(o.topic_name)})

    def waits_for(self, missing: list[str]) -> None:
        """Say who is waited for."""
        others = ', '.join(self._readers()) or 'nobody'
        self.get_logger().warning(
            f'waiting for {", ".join(missing)} to listen (there: {others})')

    def alone(self) -> None:
        """Say that nobody listens."""
        self.get_logger().warning('nobody subscribes; playing all the same')

    def piece(self, piece: Piece, due: Callable[[int], bool]) -> None:
        """Publish a piece: its messages when each is due, the block when its last sample is."""
        if self._messages is not None:
            for stamp, message in zip(piece.stamps.tolist(), piece.raw):
                if not due(stamp):
                    return
                if self._present:
                    message = messages.with_stamp(message, self.get_clock().now().nanoseconds)
                self._tick(stamp)
                self._send(self._messages, message)
        if self._blocks is not None and due(int(piece.stamps[-1])):
            self._tick(int(piece.stamps[-1]))
            self._send(self._blocks, messages.block(
                piece.first, piece.stamps, piece.gyro, piece.accel, piece.sensor))
            self._since_flush += 1
            if self._since_flush >= _UNDER_WAY:
                self.flush()

    def _tick(self, stamp: int) -> None:
        now = time.monotonic()
        if self._clock_topic is not None and now - self._tick_at >= _TICK:
            self._clock_topic.publish(Clock(clock=Time(nanoseconds=stamp).to_msg()))
            self._tick_at = now

    def _send(self, output, message) -> None:
        """Publish; a reader that is full refuses for a while."""
        while not self._player.interrupted():
            try:
                output.publish(message)
                return
            except rclpy_implementation.RCLError:
                time.sleep(0.001)

    def flush(self) -> None:
        """Wait until all readers have what was sent."""
        self._since_flush = 0
        for output in self._outputs():
            while not self._player.interrupted() and \
                    not output.wait_for_all_acked(Duration(seconds=0.2)):
                pass

    def ended(self) -> None:
        """Say at once that the bag is at its end (or cannot be read further)."""
        if self._player.error:
            self.get_logger().error(self._player.error)
        else:
            readers = ', '.join(self._readers()) or 'nobody'
            self.get_logger().info(f'end of bag: {self._player.sent} samples, to {readers}')
        self._tell()

    # Services, parameters, status.

    def _restart(self, _, response):
        self._player.restart()
        return messages.answer(response, {'restarted': True})

    def _pause(self, _, response):
        paused = self._player.pause()
        return messages.answer(response, {'paused': paused, 'samples': self._player.sent})

    def _changed(self, values) -> None:
        if 'speed' in values:
            self._player.set_speed(values['speed'])
        self._player.loop = self._settings['loop']
        self._present = self._settings['stamps'] == 'now'

    def _tell(self) -> None:
        p = self._player
        done = 100.0 * min(1.0, p.seen / self._total) if self._total else None
        text = p.error or {'end': 'end of bag', 'waiting': 'waiting for subscribers'}.get(
            p.state, f'{p.state}, {p.sent} samples')
        level = messages.ERROR if p.error else messages.OK
        status = messages.status('bag_reader', text, {
            'state': p.state, 'samples': p.sent, 'samples in the bag': self._total,
            'progress [%]': done, 'position [s]': p.position_s, 'passes': p.passes,
            'bag': self._settings['bag'], 'topic': self._of, 'frame_id': p.frame_id}, level)
        self._status.publish(messages.diagnostics(self, [status]))

    def finish(self) -> None:
        """Stop playing."""
        self._player.end()


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    return run(BagReader, args)


if __name__ == '__main__':
    sys.exit(main())
