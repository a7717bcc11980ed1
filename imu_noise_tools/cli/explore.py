# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""``explore``: the loop in the browser."""

from __future__ import annotations

import argparse
from collections.abc import Callable
import importlib
from typing import Any

from . import common


def register(commands: Any) -> None:
    """Add the command."""
    c = commands.add_parser(
        'explore', help='the loop in the browser, on this machine alone',
        description='Serve a page over a study (a recording is analysed first): what is clicked '
        'is what the commands do, on the same files. Ctrl-C ends it.')
    c.add_argument('path', metavar='DIR|BAG', nargs='?', help='a study, or a recording; without '
                   'one --topic names a running analyser, e.g. /analyser, that is followed')
    c.add_argument('--port', type=int, default=0, metavar='P',
                   help='of 127.0.0.1 (default: any that is free)')
    c.add_argument('--no-browser', action='store_true', help='print the address, open nothing')
    common.topic_options(c)
    common.unit_options(c)
    c.add_argument('--effects-from', metavar='FILE', action='append', default=[],
                   help='a Python file that defines effects of your own')
    c.set_defaults(func=explore)


def explore(args: argparse.Namespace) -> int:
    """Run ``explore``."""
    from ..core.errors import UsageError
    from ..explore.server import serve
    from ..explore.session import Session

    common.load_own_effects(args)
    if args.path is None and args.topic is None:
        raise UsageError('explore what', 'name a study, a recording, or with --topic an analyser')
    if args.path is None:
        live = _follower()(args.topic)
        serve(None, args.port, not args.no_browser, _said(f'following {live.name}'), live)
        return 0
    options = {'topic': args.topic, 'fields': args.fields, **common.units_of(args)}
    session = Session(args.path, options)
    serve(session, args.port, not args.no_browser, _said(session.folder))
    return 0


def _said(what: object) -> Callable[[str], None]:
    return lambda url: print(f'{what}: open {url}\nCtrl-C ends it.', flush=True)


def _follower() -> Any:
    """Return what follows an analyser: of the nodes, which are there only where ROS is."""
    from ..core.errors import InputError

    try:
        return importlib.import_module('imu_noise_tools.nodes.follow').Follower
    except ImportError as error:
        raise InputError(f'an analyser is followed with ROS 2, which is not here ({error})',
                         'source ROS, or pip install "imu_noise_tools[ros]"') from None
