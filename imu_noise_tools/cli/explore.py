# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""``explore``: the loop in the browser."""

from __future__ import annotations

import argparse
from typing import Any

from . import common


def register(commands: Any) -> None:
    """Add the command."""
    c = commands.add_parser(
        'explore', help='the loop in the browser, on this machine alone',
        description='Serve a page over a study (a recording is analysed first): what is clicked '
        'is what the commands do, on the same files. Ctrl-C ends it.')
    c.add_argument('path', metavar='DIR|BAG', help='a study, or a recording')
    c.add_argument('--port', type=int, default=0, metavar='P',
                   help='of 127.0.0.1 (default: any that is free)')
    c.add_argument('--no-browser', action='store_true', help='print the address, open nothing')
    common.topic_options(c)
    c.add_argument('--effects-from', metavar='FILE', action='append', default=[],
                   help='a Python file that defines effects of your own')
    c.set_defaults(func=explore)


def explore(args: argparse.Namespace) -> int:
    """Run ``explore``."""
    from ..explore.server import serve
    from ..explore.session import Session

    common.load_own_effects(args)
    options = {k: v for k, v in (('topic', args.topic), ('fields', args.fields)) if v}
    session = Session(args.path, args.effects_from, options)

    def say(url: str) -> None:
        print(f'{session.folder}: open {url}\nCtrl-C ends it.', flush=True)

    serve(session, args.port, not args.no_browser, say=say)
    return 0
