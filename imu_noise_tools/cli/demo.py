# Copyright 2026 imu_noise_tools maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""``demo``: the whole story on a simulated IMU with something hidden in it."""

from __future__ import annotations

from . import common


def register(commands) -> None:
    """Add the command."""
    c = commands.add_parser(
        'demo', help='simulate an IMU with a hidden effect, find it, watch the error fall'
    )
    c.add_argument(
        '-o', '--output', default='imu_noise_demo', metavar='DIR', help='default: imu_noise_demo'
    )
    common.output_options(c, 'what was found')
    c.set_defaults(func=demo)


def demo(args) -> int:
    """Run ``demo``."""
    from ..tasks.demo import demo as task

    with common.progress_line(args) as progress:
        story = task(
            args.output, progress=progress, say=(lambda line: None) if args.json else print
        )
    if args.json:
        common.print_json(story)
    return 0
