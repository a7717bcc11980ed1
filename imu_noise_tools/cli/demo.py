# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""``demo``: the whole story on a simulated IMU with something hidden in it."""

from __future__ import annotations

import argparse
from typing import Any

from . import common


def register(commands: Any) -> None:
    """Add the command."""
    c = commands.add_parser(
        'demo', help='simulate an IMU with a hidden effect, find it, watch the error fall'
    )
    c.add_argument(
        '-o', '--output', default='imu_noise_demo', metavar='DIR', help='default: imu_noise_demo'
    )
    common.output_options(c, 'what was found')
    c.set_defaults(func=demo)


def demo(args: argparse.Namespace) -> int:
    """Run ``demo``."""
    from ..tasks.demo import demo as task

    with common.progress_line(args) as progress:
        story = task(
            args.output, progress=progress, say=(lambda line: None) if args.json else print
        )
    if args.json:
        common.print_json(story)
    return 0
