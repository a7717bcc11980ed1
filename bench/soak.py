# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The analyser and the filter for an hour of compressed time.

``python bench/soak.py [--hours 1] [--seed 1]``: the publisher ends and comes back, the rate of the
stamps changes, messages come paced and in bursts. Every message sent must be counted by the
analyser and come back from the filter once, and memory must be flat once the buffers are full.
Needs rclpy.

"""

from __future__ import annotations

import argparse
from pathlib import Path
import sys
import tempfile
import time

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'test')]

from imu_noise_tools.bag.encode import imu_values, serialise  # noqa: E402
from nodes_support import DiagnosticArray, Imu, rclpy, Ros, values, wait_for  # noqa: E402

BEGIN = 1_700_000_000 * 10 ** 9
DEPTH = 5000
GROWTH_MB = 15.0


class Returned:
    """Counts what the filter sends."""

    def __init__(self, namespace: str):
        from rclpy.qos import QoSProfile
        self.node = rclpy.create_node('counter', namespace=namespace)
        self.count, self.twice, self.last = 0, 0, b''
        self.node.create_subscription(Imu, 'imu/data_filtered', self._take,
                                      QoSProfile(depth=DEPTH), raw=True)

    def _take(self, raw) -> None:
        self.count += 1
        self.twice += raw[4:12] == self.last
        self.last = raw[4:12]


class Sensor:
    """A publisher that lives for one stretch."""

    def __init__(self, namespace: str, readers: int):
        from rclpy.qos import QoSProfile
        self.node = rclpy.create_node('sensor', namespace=namespace)
        self.publisher = self.node.create_publisher(Imu, 'imu/data_raw', QoSProfile(depth=DEPTH))
        assert wait_for(lambda: self.publisher.get_subscription_count() >= readers, 30)

    def close(self) -> None:
        """Go away as a driver does."""
        self.node.destroy_node()


def stretch(rng, n: int, start: int, rate: float):
    """Return n serialised messages of a unit at rest from a time (ns) on, and where it ends."""
    stamps = start + np.round(np.arange(n) * 1e9 / rate).astype(np.int64)
    data = imu_values(1e-3 * rng.standard_normal((n, 3)),
                      0.02 * rng.standard_normal((n, 3)) + [0, 0, 9.8])
    return [bytes(r) for r in serialise(stamps, data, 'imu')], int(stamps[-1] + 1e9 / rate)


def soak(ros: Ros, wanted: int, seed: int) -> bool:
    """Send so many messages in stretches; return whether all is as asked."""
    rng = np.random.default_rng(seed)
    ns = ros.namespace()
    nodes = [ros.start('analyser', ns, buffer_hours=0.02, update_period=1.0),
             ros.start('filter', ns)]
    ros.ready(*nodes)
    from rclpy.executors import SingleThreadedExecutor
    back, executor = Returned(ns), SingleThreadedExecutor()
    executor.add_node(back.node)
    sent, now, stretches, held = 0, BEGIN, 0, []
    with ros.listening(f'{ns}/analyser/status', DiagnosticArray, latched=True) as told:
        begun = time.monotonic()
        while sent < wanted:
            rate = float(rng.choice([50, 100, 200, 400, 1000]))
            n = int(min(rng.integers(2000, 12000), wanted - sent))
            rows, now = stretch(rng, n, now, rate)
            sensor = Sensor(ns, 2)
            assert wait_for(lambda: back.node.count_publishers(f'{ns}/imu/data_filtered'), 30)
            burst = int(rng.choice([1, 10, 200, 1000]))
            for k in range(0, n, burst):
                for raw in rows[k:k + burst]:
                    sensor.publisher.publish(raw)
                sent += len(rows[k:k + burst])
                while sent - back.count > DEPTH // 2:       # the sensor is no faster than they
                    executor.spin_once(timeout_sec=0.1)
                executor.spin_once(timeout_sec=0.0)
            end = time.monotonic() + 30
            while back.count < sent and time.monotonic() < end:
                executor.spin_once(timeout_sec=0.2)
            wait_for(lambda: told and int(values(told[-1], 'analyser')['samples']) >= sent, 30)
            sensor.close()
            stretches += 1
            held.append((sent, *(p.memory for p in nodes)))
            counted = int(values(told[-1], 'analyser')['samples']) if told else 0
            if counted != sent or back.count != sent:
                break
        took = time.monotonic() - begun
    used = np.array(held, float)
    later = used[used[:, 0] > 0.3 * wanted][:, 1:]
    quarter = max(1, len(later) // 4)
    grown = np.median(later[-quarter:], axis=0) - np.median(later[:quarter], axis=0)
    good = counted == sent == back.count >= wanted and not back.twice and max(grown) < GROWTH_MB
    print(f'{sent} messages in {stretches} stretches and {took:.0f} s, each with a publisher of '
          f'its own: analyser counted {counted}, filter gave back {back.count} '
          f'({back.twice} twice)')
    for node, g, top in zip(('analyser', 'filter'), grown, used[:, 1:].max(axis=0)):
        print(f'{node}: {top:.0f} MB at the most, grown by {g:.1f} MB (asked: {GROWTH_MB:g})')
    print('ok' if good else 'MISSED')
    executor.shutdown()
    back.node.destroy_node()
    return good


def main() -> int:
    """Soak the nodes; return 1 where a count is off or memory grows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--hours', type=float, default=1.0, help='of 200 Hz')
    parser.add_argument('--seed', type=int, default=1)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        ros = Ros(Path(folder))
        good = soak(ros, round(args.hours * 3600 * 200), args.seed)
        ros.stop_all()
        ros.close()
    return int(not good)


if __name__ == '__main__':
    sys.exit(main())
