# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The nodes, measured: latency of the filter at 1 kHz, memory of the analyser, playing, stops.

    python bench/nodes.py [latency] [delay] [memory] [day] [stops]

Prints each figure with what was asked; ends with status 1 where one is missed. Needs rclpy.

"""

from __future__ import annotations

from pathlib import Path
import signal
import subprocess
import sys
import tempfile
import threading
import time

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'test')]

from imu_noise_tools.bag.encode import imu_values, serialise  # noqa: E402
from imu_noise_tools.bag.writing import write_bag  # noqa: E402
from imu_noise_tools.core.record import ImuRecord  # noqa: E402
from nodes_support import (  # noqa: E402
    DiagnosticArray, Float64MultiArray, Imu, NODES, rclpy, Ros, values, wait_for)

BEGIN = 1_700_000_000
ECHO = '''
import sys, rclpy
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.qos import QoSProfile
from sensor_msgs.msg import Imu
rclpy.init(args=sys.argv)
node = rclpy.create_node('echo')
publisher = node.create_publisher(Imu, 'imu/data_filtered', QoSProfile(depth=2000))
node.create_subscription(Imu, 'imu/data_raw', publisher.publish, QoSProfile(depth=2000))
executor = EventsExecutor()
executor.add_node(node)
while True:
    executor.spin_once(timeout_sec=0.5)
'''
missed: list[str] = []


def figure(what: str, value: str, asked: str, good: bool) -> None:
    """Print one figure."""
    print(f'{"ok  " if good else "MISS"} {what}: {value} (asked: {asked})', flush=True)
    if not good:
        missed.append(what)


class Pulse:
    """Sends messages at a steady rate and takes them back: a node that its sender spins."""

    def __init__(self, namespace: str):
        from rclpy.experimental.events_executor import EventsExecutor
        from rclpy.qos import QoSProfile
        self._node = rclpy.create_node('pulse', namespace=namespace)
        self._publisher = self._node.create_publisher(Imu, 'imu/data_raw', QoSProfile(depth=5000))
        self._node.create_subscription(Imu, 'imu/data_filtered', self._take,
                                       QoSProfile(depth=5000), raw=True)
        self._executor = EventsExecutor()
        self._executor.add_node(self._node)
        self._back: dict[int, float] = {}
        self._twice = 0
        back = f'{namespace}/imu/data_filtered'
        assert wait_for(self._publisher.get_subscription_count)
        assert wait_for(lambda: self._node.count_publishers(back))
        self._spin(1.0)

    def _take(self, raw) -> None:
        now, key = time.perf_counter(), raw[4:12]
        self._twice += key in self._back
        self._back[key] = now

    def _spin(self, seconds: float) -> None:
        end = time.perf_counter() + seconds
        while (left := end - time.perf_counter()) > 0:
            self._executor.spin_once(timeout_sec=left)

    def run(self, n: int, rate: float):
        """Send n messages; return (lost, twice, latencies in ms)."""
        self._back.clear()
        rng = np.random.default_rng(3)
        stamps = BEGIN * 10 ** 9 + np.round(np.arange(n) * 1e9 / rate).astype(np.int64)
        values_ = imu_values(0.01 * rng.standard_normal((n, 3)),
                             0.02 * rng.standard_normal((n, 3)) + [0, 0, 9.8])
        rows = serialise(stamps, values_, 'imu')
        sent, begun = {}, time.perf_counter()
        for k, raw in enumerate(map(bytes, rows)):
            self._spin(begun + k / rate - time.perf_counter())
            sent[raw[4:12]] = time.perf_counter()
            self._publisher.publish(raw)
        end = time.perf_counter() + 5
        while len(self._back) < n and time.perf_counter() < end:
            self._spin(0.1)
        took = [1e3 * (self._back[k] - t) for k, t in sent.items() if k in self._back]
        return n - len(took), self._twice, np.array(took)

    def close(self) -> None:
        """Remove the node."""
        self._executor.remove_node(self._node)
        self._node.destroy_node()


def latency(ros: Ros) -> None:
    """Send 1 kHz for 60 s through the filter, between two runs through a bare echo."""
    spaces = {'echo': ros.namespace(), 'filter': ros.namespace()}
    node = ros.start('filter', spaces['filter'])
    echo = subprocess.Popen([sys.executable, '-c', ECHO, '--ros-args', '-r',
                             f'__ns:={spaces["echo"]}'])
    ros.ready(node)
    found: dict[str, list] = {'echo': [], 'filter': []}
    lost = twice = 0
    for name, seconds in (('echo', 15), ('filter', 60), ('echo', 15)):
        pulse = Pulse(spaces[name])
        missing, again, took = pulse.run(seconds * 1000, 1000.0)
        pulse.close()
        found[name].append(took)
        lost, twice = lost + missing * (name == 'filter'), twice + again
    # The same again while a diagnosis computes.
    pulse = Pulse(spaces['filter'])
    asking = threading.Thread(
        target=lambda: ros.trigger(f'{node.full}/diagnose', 600), daemon=True)
    asking.start()
    missing, _, during = pulse.run(10_000, 1000.0)
    still = asking.is_alive()
    pulse.close()
    q = {name: np.percentile(np.concatenate(t), [50, 99]) for name, t in found.items()}
    q['diagnosing'] = np.percentile(during, [50, 99])
    for name, (median, tail) in q.items():
        print(f'     {name}: median {median:.3f} ms, p99 {tail:.3f} ms')
    added = q['filter'] - q['echo']
    figure('filter, 1 kHz for 60 s: lost', f'{lost}', '0', lost == 0 and twice == 0)
    for k, (which, most) in enumerate((('median', 1), ('p99', 5))):
        figure(f'filter: latency added to a bare echo, {which}', f'{added[k]:.3f} ms',
               f'{most}', added[k] <= most)
    figure(f'filter while a diagnosis computes{"" if still else " (ended early)"}: lost',
           f'{missing}', '0', missing == 0)
    node.stop(signal.SIGKILL)
    echo.kill()
    echo.wait()


def delay(ros: Ros) -> None:
    """Send 200 Hz for 30 s through the filter, without and with a delay: what it takes."""
    for seconds in (0.0, 0.1):
        space = ros.namespace()
        node = ros.start('filter', space, delay=seconds, rate_hz=200.0)
        ros.ready(node)
        pulse = Pulse(space)
        before = node.cpu_seconds
        missing, again, took = pulse.run(6000, 200.0)
        share = (node.cpu_seconds - before) / 30
        pulse.close()
        median, tail = np.percentile(took[:5900], [50, 99])
        figure(f'filter with a delay of {seconds:g} s, 200 Hz for 30 s: lost', f'{missing}', '0',
               missing == 0 and again == 0)
        figure(f'filter with a delay of {seconds:g} s: a core', f'{100 * share:.0f} %', '50',
               share < 0.5)
        figure(f'filter with a delay of {seconds:g} s: latency', f'median {median:.1f} ms, '
               f'p99 {tail:.1f} ms', f'{1e3 * seconds:g} and 10 in the median',
               median < 1e3 * seconds + 10)
        node.stop(signal.SIGTERM)


def hour_bag(folder: Path, hours: float = 1.0) -> tuple[Path, int]:
    """Write white noise at 200 Hz."""
    n = int(hours * 3600 * 200)
    rng = np.random.default_rng(1)
    record = ImuRecord(1e-3 * rng.standard_normal((n, 3)),
                       0.02 * rng.standard_normal((n, 3)) + [0, 0, 9.8],
                       np.arange(n) / 200, 200.0, start=float(BEGIN), frame_id='imu')
    path = folder / f'hours_{hours:g}'
    write_bag(path, record)
    return path, n


def memory(ros: Ros) -> None:
    """Play an hour of messages into an analyser whose buffers hold a tenth of it."""
    with tempfile.TemporaryDirectory() as folder:
        bag, n = hour_bag(Path(folder))
        ns = ros.namespace()
        analyser = ros.start('analyser', ns, buffer_hours=0.1, update_period=1.0)
        ros.ready(analyser)
        ros.start('bag_reader', ns, bag=str(bag), publish='messages')
        found, began = [], None
        with ros.listening(f'{ns}/analyser/status', DiagnosticArray, latched=True) as told:
            while True:
                time.sleep(0.2)
                count = int(values(told[-1], 'analyser')['samples']) if told else 0
                began = began or (time.monotonic() if count else None)
                found.append((count, analyser.memory))
                if count >= n:
                    break
            took = time.monotonic() - began
        counts, used = np.array(found).T
        full = used[(counts > 0.2 * n) & (counts < n)]
        grown = np.median(full[-len(full) // 4:]) - np.median(full[:len(full) // 4])
        print(f'     {n} messages in {took:.1f} s; {used.max():.0f} MB at the most')
        figure('analyser, an hour of 200 Hz: memory grown after its buffers are full',
               f'{grown:.1f} MB', 'flat: 10', grown < 10)
        speed = n / took
        figure('messages taken without loss', f'{speed:.0f} a second', '> 5000', speed > 5000)
        ros.stop_all()


def day(ros: Ros) -> None:
    """Play three hours as blocks; a day is eight times that."""
    with tempfile.TemporaryDirectory() as folder:
        bag, n = hour_bag(Path(folder), 3.0)
        ns = ros.namespace()
        with ros.listening(f'{ns}/imu/buffer', Float64MultiArray, raw=True) as blocks:
            reader = ros.start('bag_reader', ns, bag=str(bag), publish='buffer')
            assert wait_for(lambda: blocks, 60), reader.text
            began = time.monotonic()
            ros.latest(f'{reader.full}/status', DiagnosticArray, lambda m: (
                values(m, 'bag_reader')['state'] == 'end'), 300)
            took = time.monotonic() - began
            complete = wait_for(lambda: len(blocks) >= -(-n // 4096), 10)
        figure('blocks: three hours of 200 Hz',
               f'{took:.1f} s, all there: {bool(complete)}; a day in {8 * took:.0f} s',
               'a day in 60', complete and 8 * took < 60)
        ros.stop_all()


def stops(ros: Ros) -> None:
    """Start and stop every node twenty times, by SIGINT and SIGTERM in turn."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'some.npz'
        np.savez(path, gyro=np.random.default_rng(1).standard_normal((500, 3)), rate_hz=100.0)
        slowest, bad = 0.0, 0
        for k in range(20):
            ns = ros.namespace()
            started = [ros.start(n, ns, **({'bag': str(path)} if n == 'bag_reader' else {}))
                       for n in NODES]
            ros.ready(*started)
            for process in started:
                took, code = process.stop((signal.SIGINT, signal.SIGTERM)[k % 2])
                slowest, bad = max(slowest, took), bad + (code != 0 or took > 2)
            ros.stop_all()
    figure('20 starts and stops of each node: not clean within 2 s', f'{bad} of 80, slowest '
           f'{slowest:.2f} s', '0', bad == 0)


def main() -> int:
    """Measure what is named, or everything."""
    chosen = sys.argv[1:] or ['latency', 'delay', 'memory', 'day', 'stops']
    with tempfile.TemporaryDirectory() as folder:
        ros = Ros(Path(folder))
        for name in chosen:
            {'latency': latency, 'delay': delay, 'memory': memory, 'day': day, 'stops': stops}[
                name](ros)
            ros.stop_all()
        ros.close()
    return 1 if missed else 0


if __name__ == '__main__':
    sys.exit(main())
