# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the commands share: options, a progress line, warnings, JSON."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from contextlib import contextmanager
import json
import sys
from typing import Any

from . import completion
from ..core.units import A_COUNT, INPUT, to_si


class Terminated(KeyboardInterrupt):
    """A signal that asks to end: it unwinds as Ctrl-C does, so that nothing is left half."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.status = 128 + number


def status_of(stop: KeyboardInterrupt) -> int:
    """Return the exit status of a command that was interrupted, or ended by a signal."""
    return stop.status if isinstance(stop, Terminated) else 130


def names(text: str) -> list[str]:
    """Return a comma-separated list; raise ArgumentTypeError for one that names nothing."""
    out = [x.strip() for x in text.split(',') if x.strip()]
    if not out:
        raise argparse.ArgumentTypeError(f'{text!r} names nothing')
    return out


def output_options(command: argparse.ArgumentParser, json_of: str) -> None:
    """Add ``--json``, ``-v`` and ``--effects-from``."""
    command.add_argument(
        '--json',
        action='store_true',
        help=f'print {json_of} as JSON, and nothing else, on standard output',
    )
    command.add_argument('-v', '--verbose', action='store_true', help='more detail')
    command.add_argument(
        '--effects-from',
        metavar='FILE',
        action='append',
        default=[],
        help='a Python file that defines effects of your own',
    )


def si_option(command: argparse.ArgumentParser) -> None:
    """Add ``--si``."""
    command.add_argument('--si', action='store_true',
                         help="coefficients in SI as well, beside the field's units")


def topic_options(command: argparse.ArgumentParser, every: bool = False) -> None:
    """Add the options that say which messages of a bag are read, and how."""
    command.add_argument(
        '--topic', metavar='T', help='the Imu topic, where there are several'
        + (' (all: each of them, one after the other)' if every else ''))
    command.add_argument(
        '--fields', metavar='F',
        help='messages of another type: gyro=PATH,accel=PATH,stamp=PATH:us, each with its unit '
             'behind it (rad/s, deg/s, deg/h; m/s^2, g, mg, ug; or what one raw count is, as '
             f'{A_COUNT["accel"]}; s, ms, 0.1ms, us, ns); a path to three numbers or '
             'to x, y, z, or three joined with +; temperature=PATH:degC where there is one; of a '
             '.csv the names of columns, or their numbers, and only=COLUMN:VALUE where it holds '
             'several sensors in turn')


def unit_options(command: argparse.ArgumentParser) -> None:
    """Add the options that say what the samples are where the bag does not, or says it wrong."""
    command.add_argument('--rate-hz', type=float, metavar='R',
                         help='sample rate, in place of the stamps')
    gyro_unit_option(command)
    accel_unit_option(command)


def gyro_unit_option(command: argparse.ArgumentParser, default: str = 'rad/s') -> None:
    """Add ``--gyro-unit``; None where it is not given."""
    _unit_option(command, 'gyro', f'unit of the gyroscope data: deg/s, or what one raw count '
                 f'is, as {A_COUNT["gyro"]} (default: {default})')


def accel_unit_option(command: argparse.ArgumentParser, default: str = 'm/s^2') -> None:
    """Add ``--accel-unit``; None where it is not given."""
    _unit_option(command, 'accel', f'unit of the accelerometer data: g, mg, or what one raw '
                 f'count is, as {A_COUNT["accel"]} (default: {default})')


def _unit_option(command: argparse.ArgumentParser, sensor: str, said: str) -> None:
    option = command.add_argument(f'--{sensor}-unit', metavar='U', help=said)
    completion.offer(option, lambda args: INPUT[sensor])


def units_of(args: argparse.Namespace) -> dict[str, Any]:
    """
    Return what :func:`unit_options` says, as the tasks take it: None where nothing is.

    A unit that is none is refused before anything is read.

    """
    for sensor in INPUT:
        if (unit := getattr(args, f'{sensor}_unit')) is not None:
            to_si(sensor, unit)
    return {name: getattr(args, name) for name in ('rate_hz', 'gyro_unit', 'accel_unit')}


def part_options(command: argparse.ArgumentParser) -> None:
    """Add the options that choose a stretch of a record."""
    command.add_argument(
        '--start', default='', metavar='T', help='leave out what is before, s or per cent (10%%)'
    )
    command.add_argument(
        '--duration', default='', metavar='T', help='how much of it, s or per cent'
    )


def selection_options(command: argparse.ArgumentParser) -> None:
    """Add the options that choose a stretch of a record, and what of it is set aside."""
    part_options(command)
    command.add_argument(
        '--mask', default='', metavar='T0-T1,…', help='set these stretches aside, s'
    )
    command.add_argument(
        '--no-screen', action='store_true', help='set no disturbed stretches aside by yourself'
    )


def selection_of(args: argparse.Namespace) -> Any:
    """Return the part of the record that was asked for."""
    from ..health import Selection

    return Selection.of(args.start, args.duration, getattr(args, 'mask', ''),
                        not getattr(args, 'no_screen', False))


def load_own_effects(args: argparse.Namespace) -> None:
    """Register a user's own effects."""
    if args.effects_from:
        from ..loop.effect import load_effects

        for path in args.effects_from:
            load_effects(path)


@contextmanager
def progress_line(args: argparse.Namespace) -> Any:
    """
    Yield a function of (share or None, what) that draws one line.

    It draws on a terminal, and nothing elsewhere.

    """
    if not sys.stderr.isatty() or getattr(args, 'json', False):
        yield None
        return
    width = 24

    def draw(share, what=''):
        bar = (
            '' if share is None else f'[{"#" * int(width * share):{width}s}] {100 * share:3.0f} % '
        )
        sys.stderr.write(f'\r\x1b[K{bar}{what}')
        sys.stderr.flush()

    try:
        yield draw
    finally:
        sys.stderr.write('\r\x1b[K')
        sys.stderr.flush()


def say_at_once(said: str, progress: Any) -> None:
    """Print now what is known by now, in place of the line that :func:`progress_line` draws."""
    if progress is not None:
        sys.stderr.write('\r\x1b[K')
        sys.stderr.flush()
    print(said, flush=True)


def warn(warnings: Iterable[str]) -> None:
    """Print each warning on standard error."""
    for w in warnings:
        print(f'warning: {w}', file=sys.stderr)


def print_json(data: Any) -> None:
    """Print plain JSON (not-a-number becomes null)."""
    from ..store import plain

    def clean(x):
        if isinstance(x, dict):
            return {k: clean(v) for k, v in x.items()}
        if isinstance(x, list):
            return [clean(v) for v in x]
        return (
            None if isinstance(x, float) and (x != x or x in (float('inf'), float('-inf'))) else x
        )

    print(json.dumps(clean(plain(data)), indent=2, allow_nan=False))
