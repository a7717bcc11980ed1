# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""``filter``: a bag with less noise in its rates."""

from __future__ import annotations

import argparse
from collections.abc import Collection, Iterable
from typing import Any

from . import common, completion


def register(commands: Any) -> None:
    """Add the command."""
    c = commands.add_parser(
        'filter',
        help='write a bag with filtered rates beside the original topics',
        description=(
            'Filter the angular rates of a bag: imu/data_filtered beside all that the bag holds,'
            ' and a study of the innovations, which compare, diagnose, add and history take.'
        ),
        epilog=(
            'When not to: an estimator that models the noise itself (a navigation filter,'
            ' visual-inertial odometry) wants the raw rates, since the error of filtered ones is'
            ' correlated in time; and no filter of a gyroscope alone takes away a constant bias.'
        ),
    )
    c.add_argument('bag', metavar='BAG', help='what to filter')
    c.add_argument(
        '-o', '--output', metavar='BAG2', required=True, help='the bag to write, of the same kind'
    )
    c.add_argument('--model', metavar='DIR', help='a study: of noise (analyse), or of a filter')
    motion = c.add_argument(
        '--motion',
        type=common.names,
        default=['auto'],
        metavar='M,…',
        help='auto (default: a bank for any motion), or '
             'constant_rate,ar_increment,angular_acceleration,…',
    )
    completion.offer(motion, completion.blocks('Motion'), several=True)
    noise = c.add_argument('--noise', type=common.names, default=['white'], metavar='N,…',
                           help='white (default), gauss_markov, sinusoid, outliers, …')
    completion.offer(noise, completion.blocks('OutputNoise'), several=True)
    c.add_argument('--alpha', type=float, default=1.0, metavar='A',
                   help='fading memory, 0 < A <= 1 (default: 1, none)')
    c.add_argument(
        '--smooth',
        action='store_true',
        help='let each rate know the samples after it too: nearer than any live filter can be',
    )
    c.add_argument('--delay', type=float, default=0.0, metavar='S', help=(
        'let each rate wait S seconds for the samples after it, as the node does with delay'))
    c.add_argument(
        '--set',
        action='append',
        default=[],
        metavar='LABEL.PARAMETER=VALUE',
        dest='values',
        help='a value of an effect, in SI, e.g. white.R=1e-4',
    )
    common.topic_options(c)
    common.gyro_unit_option(c, 'that of the recording of --model, else rad/s')
    common.part_options(c)
    c.add_argument(
        '--rate-hz', type=float, metavar='R', help='nominal rate, in place of that of the stamps'
    )
    c.add_argument('--force', action='store_true', help='replace a bag and a study that are there')
    common.si_option(c)
    common.output_options(c, 'the result')
    c.set_defaults(func=filter_bag)


def values_of(pairs: Iterable[str]) -> dict:
    """
    Return ``{label: {parameter: value}}`` of ``label.parameter=value``.

    Raise UsageError for anything else.

    """
    from ..filter.statespace import DOMAIN
    from ..loop.effect import find_effect
    from ..core.errors import UsageError
    out: dict = {}
    for text in pairs:
        name, equals, value = text.partition('=')
        label, dot, parameter = name.rpartition('.')
        try:
            number = float(value)
        except ValueError:
            number = float('nan')
        if not (equals and dot and number == number):
            raise UsageError(f'invalid --set {text}', 'e.g. --set white.R=1e-4')
        known = find_effect(DOMAIN, label)({parameter: number}).parameter(parameter)
        if number < 0 <= known.lower or number == 0 < known.lower and not known.amplitude:
            raise UsageError(f'invalid --set {text}', 'it must be above 0')
        out.setdefault(label, {})[parameter] = number
    return out


def filter_bag(args: argparse.Namespace) -> int:
    """Run ``filter``."""
    from ..core.errors import UsageError
    from ..tasks import filter as tasks
    common.load_own_effects(args)
    if args.rate_hz is not None and not 0 < args.rate_hz < 1e6:
        raise UsageError(f'invalid --rate-hz {args.rate_hz:g}', 'it must be a positive number')
    selection = common.selection_of(args)
    with common.progress_line(args) as progress:
        done = tasks.filter_bag(
            args.bag,
            args.output,
            model=args.model,
            motion=args.motion,
            noise=args.noise,
            alpha=args.alpha,
            smooth=args.smooth,
            delay=args.delay,
            values=values_of(args.values) or None,
            topic=args.topic,
            fields=args.fields,
            gyro_unit=args.gyro_unit,
            selection=selection,
            rate_hz=args.rate_hz,
            force=args.force,
            progress=progress,
        )
    common.warn(done.notes)
    data = done.as_dict()
    if args.json:
        common.print_json(data)
        return 0
    print(
        f'{data["counts"]["samples"]} samples at {data["rate_hz"]:.4g} Hz, motion'
        f' {", ".join(data["motion"])}, noise {", ".join(data["noise"])}'
        + (f', alpha {args.alpha:g}' if args.alpha < 1 else '')
        + (', smoothed' if args.smooth else '')
        + (f', with a delay of {args.delay:g} s' if args.delay else '')
    )
    for line in _table(data, args.si):
        print(line)
    print(
        f'\nwritten: {data["bag"]} (topic {data["topic"]})'
        + (
            f' and {data["study"]}\nnext: imu_noise diagnose {data["study"]}'
            if data['study'] else ''
        )
    )
    return 0


def _table(data: dict, si: bool) -> Iterable[str]:
    """Yield what the noise of each axis was, what is left of it, and how the innovations look."""
    from ..core.units import DEG
    slow = any(f['sigma_slow'] for f in data['axes'].values())
    yield (f'          {"error of a rate" if slow else "noise of a sample"}, deg/s   '
           f'{"  " if slow else ""} left: median       rms  '
           ' innovations: mean square (1)   lag 1 (0)   kurtosis (0)')
    for axis, f in data['axes'].items():
        sigmas = [f[f'sigma_{k}'] for k in ('before', 'after', 'rms')]
        before, after, rms = (x / DEG for x in sigmas)
        yield (f'  {axis}  {before:22.4f} -> {after:15.4f} {rms:9.4f}'
               f' {f["nis"]:27.3f} {f["lag1"]:14.3f} {f["kurtosis"]:11.2f}'
               + ('   {:.3g} -> {:.3g}, {:.3g} rad/s'.format(*sigmas) if si else ''))
    if slow:
        yield _with_what_is_slow(data)


def _with_what_is_slow(data: dict) -> str:
    """Return what the errors of the rates, and the covariance in the messages, hold."""
    from ..core.units import DEG
    white, slow = (', '.join(f'{f[k] / DEG:.4f}' for f in data['axes'].values())
                   for k in ('sigma_white', 'sigma_slow'))
    return (f'  before: white noise of a sample {white} deg/s, and what is correlated in time '
            f'(of a random walk an hour, as an uncertainty of the bias) {slow} deg/s; after, and '
            'in the covariance of the messages: what is left of both. A slow bias stays: it looks '
            'like rotation')


def solved(folder: str, targets: Collection[str]) -> str:
    """Return nothing: what a model comes to are its coefficients."""
    return ''
