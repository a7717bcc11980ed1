# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""``inspect``, ``simulate`` and ``plan``: before and around an analysis."""

from __future__ import annotations

import argparse
from typing import Any

from . import common

SPEC = """example of SPEC.yaml:
  rate_hz: 100
  duration_s: 3600
  seed: 1
  targets:
    gyro_x: {white: {N: 8.7e-5}, flicker: {B: 2.4e-5}, sinusoid: \
{amplitude: 1.0e-4, frequency: 23}, bias: 0.01}
    accel_z: {white: {N: 1.0e-3}}
  covariates: {temperature: {base: 25, swing: 5, period_s: 3600}}
  motion: {rocking: {axis: x, amplitude_deg: 15, period_s: 10}}
"""


def register(commands: Any) -> None:
    """Add the commands."""
    c = commands.add_parser('inspect', help='topics, rate, stamps, health of a bag, with advice')
    c.add_argument('bag', metavar='BAG')
    common.topic_options(c, every=True)
    common.unit_options(c)
    common.selection_options(c)
    common.output_options(c, 'what was found')
    c.set_defaults(func=inspect)

    c = commands.add_parser(
        'simulate',
        help='a record with known truth',
        epilog=SPEC,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    c.add_argument('spec', metavar='SPEC.yaml')
    c.add_argument(
        '-o',
        '--output',
        required=True,
        metavar='BAG',
        help='a folder, or a file .mcap .db3 .bag .csv .npz',
    )
    c.add_argument('--force', action='store_true', help='replace what is there')
    common.output_options(c, 'the truth')
    c.set_defaults(func=simulate)

    c = commands.add_parser(
        'plan', help='how long to record, and how fast, for a wanted precision'
    )
    c.add_argument(
        'dir', metavar='DIR', nargs='?', help='a study to plan from; or give the coefficients'
    )
    c.add_argument('--sensor', choices=('gyro', 'accel'), default='gyro')
    c.add_argument('--N', type=float, metavar='X', help='white noise, SI')
    c.add_argument('--B', type=float, metavar='X', help='bias instability, SI')
    c.add_argument('--K', type=float, metavar='X', help='random walk, SI')
    c.add_argument('--rate-hz', type=float, default=100.0, metavar='R')
    c.add_argument(
        '--precision',
        type=float,
        default=20.0,
        metavar='PERCENT',
        help='wanted standard deviation (default: 20)',
    )
    common.si_option(c)
    common.output_options(c, 'the plan')
    c.set_defaults(func=plan)


def inspect(args: argparse.Namespace) -> int:
    """Run ``inspect``."""
    from dataclasses import asdict
    from ..bag import ALL
    from ..tasks import inspect as tasks

    selection = common.selection_of(args)
    with common.progress_line(args) as progress:
        how: dict[str, Any] = dict(
            selection=selection, fields=args.fields, **common.units_of(args),
            progress=(lambda p: progress(p, 'reading')) if progress else None)
        if args.topic == ALL:
            known, refused = tasks.inspect_every(args.bag, **how)
        elif args.topic:
            known, refused = {args.topic: tasks.inspect(args.bag, args.topic, **how)}, {}
        else:
            known, refused = tasks.inspect_what_is_there(args.bag, **how)
    found, *others = every = list(known.values())
    several = args.topic == ALL or len(known) + len(refused) > 1
    common.warn(dict.fromkeys(w for one in every for w in one.warnings))
    common.warn(f'{topic} cannot be read: {error.message}' for topic, error in refused.items())
    if args.json:
        shown = [_of_both(one) for one in every]
        common.print_json(
            {
                'path': str(args.bag),
                'topics': [asdict(t) for t in found.topics],
                **({'records': shown} if several else shown[0]),
            }
        )
        return 0
    from . import text

    print(text.inspection(found, others, (*known, *refused) if several else ()))
    return 0


def _of_both(found) -> dict:
    """Return what was found in a record, and in the sensor beside it."""
    return {
        **_inspected(found),
        'beside': {'gyro' if 'accel' in one.health.absent else 'accel': _inspected(one)
                   for one in found.beside},
    }


def _inspected(found) -> dict:
    """Return what was found in one stream as plain data."""
    from dataclasses import asdict

    return {
        'topic': found.topic,
        'health': asdict(found.health),
        'disturbances': [asdict(d) for d in found.disturbances],
        'left_out': found.left_out,
    }


def simulate(args: argparse.Namespace) -> int:
    """Run ``simulate``."""
    from pathlib import Path
    from ..tasks.simulate import simulate as task, truth_of

    common.load_own_effects(args)
    with common.progress_line(args) as progress:
        truth = task(args.spec, args.output, force=args.force, progress=progress)
    if args.json:
        common.print_json(truth)
    else:
        print(
            f'written to {args.output}; what is in it: {truth_of(Path(args.output)).name} '
            'beside it\n'
            f'next: imu_noise analyse {args.output}'
        )
    return 0


def _planned(row, si: bool) -> list[str]:
    """Return the value that is planned for, or its limit, as the field writes it and in SI."""
    value = row['value'] if row['value'] is not None else row.get('upper95')
    cells = [row.get('shown', '')]
    if si:
        below = 'below ' if row['value'] is None else ''
        cells.append('' if value is None else f'{below}{value:.3g} {row["unit"]}')
    return cells


def plan(args: argparse.Namespace) -> int:
    """Run ``plan``."""
    from ..core.errors import UsageError
    from ..tasks.plan import plan as task
    from . import text

    given = {k: v for k, v in (('N', args.N), ('B', args.B), ('K', args.K)) if v is not None}
    if not args.dir and not given:
        raise UsageError('nothing to plan from', 'name a study, or give --N, --B, --K')
    if any(not v > 0 for v in (*given.values(), args.rate_hz, args.precision)):
        raise UsageError(
            'coefficients, rate and precision must be above zero',
            'e.g. plan --N 8.7e-5 --B 2.4e-5 --K 1e-6',
        )
    rows = task(
        args.dir, given, sensor=args.sensor, rate_hz=args.rate_hz, wanted=args.precision / 100
    )
    if args.json:
        common.print_json({'plan': rows})
    else:
        print(
            text.table(
                [
                    (r['target'], r['parameter'], *_planned(r, args.si), r['one_hour'],
                     r['record'])
                    for r in rows
                ],
                (
                    'target',
                    'parameter',
                    'value',
                    *(['SI'] if args.si else []),
                    'one hour gives',
                    f'for {args.precision:g} % record',
                ),
            )
        )
        print(
            'along with it: the temperature (sensor_msgs/Temperature) and all six axes; on a '
            'heavy base, motors off;\n'
            "a rate of at least twice the sensor's bandwidth; half an hour of warm-up before."
        )
    return 0
