# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Real nodes in real processes, on a ROS domain of their own, and a client beside them.

Test modules take ROS's own names from here too: where there is no ROS, importing this skips them.

"""

from __future__ import annotations

from contextlib import contextmanager
import itertools
import json
import os
from pathlib import Path
import random
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time

import pytest
import yaml

rclpy = pytest.importorskip('rclpy', reason='no rclpy (pip install .[ros], or source ROS)')
# flake8: noqa: E402, F401, I100, I201, I202
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.srv import (DescribeParameters, GetParameters, ListParameters, SetParameters)
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image, Imu, Temperature
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

from imu_noise_tools.nodes import messages

ROOT = Path(__file__).resolve().parents[1]
NODES = ('bag_reader', 'analyser', 'calibration', 'filter')
PATIENCE = 120.0            # discovery takes seconds, and the machine may be busy
SETTLE = 0.3                # s, see Ros.call
ROOM = 256 << 20            # bytes that shared memory should have left


@contextmanager
def domain_of_its_own():
    """Run in a domain that nobody uses; then the nodes of other tests start in theirs again."""
    before = dict(os.environ)
    held = reserve_domain()
    try:
        yield
    finally:
        held.close()
        os.environ.clear()
        os.environ.update(before)


def reserve_domain() -> socket.socket:
    """Set a domain id that no other process here uses; it is ours while the socket is held."""
    for domain in random.SystemRandom().sample(range(2, 101), 99):
        held = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
                probe.bind(('0.0.0.0', 7400 + 250 * domain))        # the domain's discovery port
            held.bind(('127.0.0.1', 42000 + domain))
        except OSError:
            held.close()
            continue
        os.environ.update(ROS_DOMAIN_ID=str(domain), ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST')
        shared = Path('/dev/shm')
        if not shared.is_dir() or shutil.disk_usage(shared).free < ROOM:
            # a container has 64 MB of it; a node with none left says so, or ends by SIGBUS
            os.environ.setdefault('FASTDDS_BUILTIN_TRANSPORTS', 'UDPv4')
        return held
    raise RuntimeError('no free ROS domain id')


def wait_for(what, patience: float = PATIENCE, pause: float = 0.05):
    """Return what() as soon as it is true, or its last value when patience ends."""
    end = time.monotonic() + patience
    while True:
        value = what()
        if value or time.monotonic() > end:
            return value
        time.sleep(pause)


class NodeProcess:
    """One node as a process."""

    def __init__(self, node: str, namespace: str, folder: Path, parameters: dict, remaps: dict):
        self.name, self.namespace, self.folder = node, namespace, folder
        self.full = f'{namespace}/{node}'
        command = [sys.executable, '-m', f'imu_noise_tools.nodes.{node}', '--ros-args',
                   '-r', f'__ns:={namespace}']
        for key, value in parameters.items():
            command += ['-p', f'{key}:={json.dumps(value)}']
        for old, new in remaps.items():
            command += ['-r', f'{old}:={new}']
        folder.mkdir(parents=True, exist_ok=True)
        self._log = folder / f'{node}.log'
        with open(self._log, 'w') as log:
            self._child = subprocess.Popen(
                command, cwd=folder, stdout=log, stderr=subprocess.STDOUT, start_new_session=True,
                env={**os.environ, 'PYTHONPATH': str(ROOT), 'PYTHONUNBUFFERED': '1',
                     'OMP_NUM_THREADS': '1', 'ROS_LOG_DIR': str(folder)})

    @property
    def running(self) -> bool:
        """Whether it still runs."""
        return self._child.poll() is None

    @property
    def text(self) -> str:
        """What it printed."""
        return self._log.read_text(errors='replace')

    @property
    def lines(self) -> list[str]:
        """What it printed line by line, but for what the middleware has to say."""
        return [x for x in self.text.splitlines() if x.strip() and '[RTPS' not in x]

    @property
    def memory(self) -> float:
        """Memory now in use, MB."""
        status = Path(f'/proc/{self._child.pid}/status').read_text()
        return int(status.split('VmRSS:')[1].split()[0]) / 1024

    @property
    def cpu_seconds(self) -> float:
        """CPU time used so far, its own and the system's for it."""
        fields = Path(f'/proc/{self._child.pid}/stat').read_text().rsplit(')', 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')

    def end(self, patience: float = PATIENCE) -> int | None:
        """Wait until it ends by itself; return its status, None where it did not."""
        try:
            return self._child.wait(patience)
        except subprocess.TimeoutExpired:
            return None

    def stop(self, number: int = signal.SIGTERM) -> tuple[float, int]:
        """Send a signal; return seconds until it ended and its exit status (-9: was killed)."""
        began = time.monotonic()
        self.tell(number)
        if self.end() is None:
            self._child.kill()
            self._child.wait()
        return time.monotonic() - began, self._child.returncode

    def tell(self, number: int = signal.SIGTERM) -> None:
        """Send a signal, if it still runs."""
        if self.running:
            self._child.send_signal(number)


class Ros:
    """A client node that spins in a thread, and the processes that were started."""

    _numbers = itertools.count(1)

    def __init__(self, folder: Path):
        self.folder, self._domain = folder, reserve_domain()
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        self.node = rclpy.create_node(f'test_{os.getpid()}')
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()
        self.processes: list[NodeProcess] = []
        self._clients: dict = {}

    def _spin(self) -> None:
        while not self._stop.is_set():
            try:
                self._executor.spin_once(timeout_sec=0.1)
            except rclpy_implementation.InvalidHandle:
                pass                        # a subscription that a test has just destroyed

    def close(self) -> None:
        """Stop everything."""
        self.stop_all()
        self._stop.set()
        self._thread.join(5)
        self.node.destroy_node()
        rclpy.try_shutdown()
        self._domain.close()

    def namespace(self) -> str:
        """Return a namespace nobody has used: dead nodes stay visible for a while."""
        return f'/t{next(self._numbers)}'

    def start(self, node: str, namespace: str, remaps=None, **parameters) -> NodeProcess:
        """Start a node."""
        folder = self.folder / namespace.strip('/') / f'{node}_{len(self.processes)}'
        process = NodeProcess(node, namespace, folder, parameters, remaps or {})
        self.processes.append(process)
        return process

    def stop_all(self) -> None:
        """End every process that still runs; one that is killed leaves shared memory behind."""
        self.end(self.processes)
        self.processes.clear()

    @staticmethod
    def end(processes) -> None:
        """End processes, all at a time."""
        processes = list(processes)
        for process in processes:
            process.tell()
        for process in processes:
            process.stop()

    def ready(self, *processes: NodeProcess) -> None:
        """Wait until the services of nodes are there."""
        for p in processes:
            mark = f'{p.full}/describe_parameters'
            assert wait_for(lambda: mark in self.services() or not p.running), p.text
            assert p.running, p.text

    def topics(self) -> dict[str, list[str]]:
        """Return the types of each topic."""
        return dict(self.node.get_topic_names_and_types())

    def services(self) -> dict[str, list[str]]:
        """Return the types of each service."""
        return dict(self.node.get_service_names_and_types())

    @contextmanager
    def listening(self, topic: str, kind, latched: bool = False, raw: bool = False):
        """Yield a list that fills with what comes on a topic."""
        got: list = []
        durable = DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
        qos = QoSProfile(depth=5000, reliability=ReliabilityPolicy.RELIABLE, durability=durable)
        subscription = self.node.create_subscription(kind, topic, got.append, qos, raw=raw)
        try:
            yield got
        finally:
            self.node.destroy_subscription(subscription)

    def latest(self, topic: str, kind, such=lambda message: True, patience: float = PATIENCE):
        """Return a message of a latched topic, the last one or the first to come that is such."""
        with self.listening(topic, kind, latched=True) as got:
            return self.heard(got, such, patience, topic)

    def heard(self, got: list, such, patience: float = PATIENCE, what: str = ''):
        """Wait for a message that is such in a list that fills; however short it is the last."""
        looked, found = 0, []

        def look():
            nonlocal looked
            some = got[looked:]
            looked += len(some)
            found.extend(m for m in some if such(m))
            return found
        assert wait_for(look, patience), '\n'.join(
            [f'{what}: {got[-1:]}', *(f'{p.full}: {p.text}' for p in self.processes)])
        return found[0]

    @staticmethod
    def flowing(got: list, probe) -> None:
        """
        Call probe() until something comes back: only then has the other side found this one.

        That a publisher is known here does not say that it knows its subscriber; what it sends
        before that is lost, whatever the quality of service.

        """
        end = time.monotonic() + PATIENCE
        while not got and time.monotonic() < end:
            probe()
            wait_for(lambda: got, 0.5)
        assert got, 'nothing comes back'

    def publisher(self, topic: str, kind, reliable: bool = True):
        """Return a publisher that has found a subscriber."""
        qos = QoSProfile(depth=5000, reliability=ReliabilityPolicy.RELIABLE if reliable
                         else ReliabilityPolicy.BEST_EFFORT)
        publisher = self.node.create_publisher(kind, topic, qos)
        assert wait_for(publisher.get_subscription_count), f'nobody listens to {topic}'
        return publisher

    def call(self, name: str, kind, request, patience: float = 2 * PATIENCE):
        """Return the answer of a service."""
        client = self._clients.get(name)
        if client is None:
            client = self._clients[name] = self.node.create_client(kind, name)
            assert client.wait_for_service(timeout_sec=PATIENCE), f'no service {name}'
            # The server waits 0.1 s for a client whose answers it cannot send yet, then drops
            # them, and nothing on this side tells whether it has found this client.
            time.sleep(SETTLE)
        done = threading.Event()
        future = client.call_async(request)
        future.add_done_callback(lambda _: done.set())
        assert done.wait(patience), f'{name} did not answer in {patience} s'
        return future.result()

    def trigger(self, name: str, patience: float = 2 * PATIENCE):
        """Call a Trigger; return success and its message as YAML."""
        answer = self.call(name, Trigger, Trigger.Request(), patience)
        return answer.success, yaml.safe_load(answer.message)

    def set_parameter(self, full: str, name: str, value) -> tuple[bool, str]:
        """Set a parameter of a node; return whether it was taken, and the reason."""
        wanted = [Parameter(name, value=value).to_parameter_msg()]
        result = self.call(f'{full}/set_parameters', SetParameters,
                           SetParameters.Request(parameters=wanted)).results[0]
        return result.successful, result.reason

    def values_of(self, full: str, names) -> dict:
        """Return the values of a node's parameters by name."""
        names = list(names)
        answer = self.call(f'{full}/get_parameters', GetParameters,
                           GetParameters.Request(names=names))
        return dict(zip(names, map(parameter_value_to_python, answer.values)))

    def parameters(self, full: str) -> dict:
        """Return the descriptors of a node's own parameters by name."""
        listed = self.call(f'{full}/list_parameters', ListParameters, ListParameters.Request())
        names = [n for n in listed.result.names
                 if n not in ('use_sim_time', 'start_type_description_service')]
        described = self.call(f'{full}/describe_parameters', DescribeParameters,
                              DescribeParameters.Request(names=names))
        return dict(zip(names, described.descriptors))


def values(array, name: str) -> dict[str, str]:
    """Return the values of one status of a DiagnosticArray."""
    return {v.key: v.value for s in array.status if s.name == name for v in s.values}
