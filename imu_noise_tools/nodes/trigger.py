# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Call a node's service from the shell where ros2 is not installed.

    python -m imu_noise_tools.nodes.trigger /analyser/analyse [--patience SECONDS]

Prints the answer, which is YAML; exit status 0 for success, 1 for a refusal, 3 where nobody
answers.

"""

from __future__ import annotations

import argparse
import os
import sys
import time

import rclpy
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import Trigger

from ..core.files import plain_yaml
from ..core.interrupt import loaded
from ..store import dump_yaml


def call(name: str, patience: float) -> tuple[bool, str] | None:
    """
    Return (success, message) of a Trigger service.

    None where it is not there or does not answer in time.

    """
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node('trigger')
    end = time.monotonic() + patience
    try:
        client = node.create_client(Trigger, name)
        while not client.service_is_ready():
            if time.monotonic() > end:
                return None
            time.sleep(0.05)
        future = client.call_async(Trigger.Request())
        while not future.done():
            if time.monotonic() > end:
                return None
            rclpy.spin_once(node, timeout_sec=0.1)
        answer = future.result()
        return answer.success, answer.message
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def main(args: list[str] | None = None) -> int:
    """Run."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('service')
    parser.add_argument('--patience', type=float, default=60.0, metavar='SECONDS')
    given = parser.parse_args(args)
    loaded()
    try:
        answer = call(given.service, given.patience)
    except KeyboardInterrupt:
        return 130
    if answer is None:
        print(
            f'{given.service}: no answer in {given.patience:g} s: is the node running, in this '
            'ROS domain?',
            file=sys.stderr,
        )
        return 3
    try:
        print(dump_yaml(plain_yaml(answer[1])).rstrip(), flush=True)
    except BrokenPipeError:     # who reads has enough; nor is the rest written as the process ends
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 0 if answer[0] else 1


if __name__ == '__main__':
    sys.exit(main())
