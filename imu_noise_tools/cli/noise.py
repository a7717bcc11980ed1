# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""``analyse``: from a bag to a study."""

from __future__ import annotations

import argparse
from collections.abc import Collection
from typing import Any

from . import common, completion


def register(commands: Any) -> None:
    """Add the command."""
    c = commands.add_parser(
        'analyse',
        aliases=['analyze'],
        help='Allan curves, noise coefficients and imu.yaml of a bag',
        description='Read a bag, fit the noise model, write a study: study.yaml, imu.yaml '
        '(Kalibr), allan.csv, allan.png, report.html, evidence.npz.',
    )
    c.add_argument(
        'bag', metavar='BAG', help='rosbag1 file, rosbag2 folder, .mcap, .db3, .csv or .npz'
    )
    c.add_argument(
        '-o', '--output', metavar='DIR', help='where the study goes (default: BAG.study)'
    )
    common.topic_options(c, every=True)
    model_options(c)
    record_options(c)
    c.add_argument('--force', action='store_true', help='replace a study that is there')
    common.si_option(c)
    common.output_options(c, 'study.yaml')
    c.set_defaults(func=analyse)


def model_options(c: argparse.ArgumentParser) -> None:
    """Add what is fitted, and how."""
    axes = c.add_argument(
        '--axes', '--axis', type=common.names, metavar='A,…',
        help='e.g. gyro_x,gyro_y (default: all)'
    )
    completion.offer(axes, completion.axes, several=True)
    effects = c.add_argument(
        '--effects',
        type=common.names,
        default=None,
        metavar='E,…',
        help='the model (default: white,flicker,random_walk); see imu_noise effects',
    )
    completion.offer(effects, completion.effects('noise'), several=True)
    c.add_argument(
        '--method',
        choices=('likelihood', 'avar', 'slopes'),
        default='likelihood',
        help='maximum likelihood (default), least squares on the curve, or slope reading',
    )
    c.add_argument(
        '--bias-at',
        default='flat',
        metavar='RULE',
        help='with slopes: flat (default), rise, minimum, or seconds',
    )
    c.add_argument(
        '--curve',
        choices=('overlapping', 'standard'),
        help='kind of Allan variance (default: overlapping)',
    )
    c.add_argument(
        '--deviation', choices=('oadev', 'adev', 'mdev', 'hdev', 'totdev'), help='other deviations'
    )
    g = c.add_mutually_exclusive_group()
    g.add_argument(
        '--points', type=int, default=100, metavar='P', help='points of the curve (default: 100)'
    )
    g.add_argument('--octaves', action='store_true', help='one point an octave')


def record_options(c: argparse.ArgumentParser) -> None:
    """Add how the recording is to be read."""
    common.unit_options(c)
    g = c.add_mutually_exclusive_group()
    g.add_argument('--delta', action='store_true', help='each sample is an increment (rad, m/s)')
    g.add_argument(
        '--integrated', action='store_true', help='each sample is the angle or velocity itself'
    )
    common.selection_options(c)
    c.add_argument('--keep-motion', action='store_true', help='analyse everything, still or not')


def how_of(args: argparse.Namespace) -> dict[str, Any]:
    """Return what the options say of the model and the recording, for the task."""
    from ..core.errors import UsageError
    from ..tasks import noise as tasks

    if args.points < 2:
        raise UsageError(f'invalid --points {args.points}', 'it must be two or more')
    return dict(
        **common.units_of(args),
        fields=args.fields,
        input_kind='delta' if args.delta else 'integrated' if args.integrated else 'rate',
        axes=args.axes,
        effects=args.effects or tasks.DEFAULT_EFFECTS,
        method=args.method,
        bias_at=args.bias_at,
        deviation=args.deviation or {'standard': 'adev', 'overlapping': 'oadev',
                                     None: 'oadev'}[args.curve],
        points=args.points,
        octaves=args.octaves,
        keep_motion=args.keep_motion,
    )


def analyse(args: argparse.Namespace) -> int:
    """Run ``analyse``."""
    from ..bag import ALL
    from ..tasks import noise as tasks

    how = how_of(args)
    selection = common.selection_of(args)
    common.load_own_effects(args)
    with common.progress_line(args) as progress:
        how.update(selection=selection, force=args.force, progress=progress)
        if args.topic == ALL:
            every, refused, folder = tasks.analyse_every(args.bag, args.output, **how)
        else:
            study, folder = tasks.analyse(args.bag, args.output, topic=args.topic, **how)
    if args.topic == ALL:
        return _every(args, every, refused, folder)
    common.warn(study.source.get('warnings', ()))
    if args.json:
        from ..store import study_to_dict

        common.print_json(study_to_dict(study))
        return 0
    from .. import report

    print(report.text(study, str(folder), verbose=args.verbose, si=args.si))
    print(f'written to {folder}: study.yaml imu.yaml allan.csv allan.png report.html evidence.npz')
    return 0


def _every(args: argparse.Namespace, studies, refused, folder) -> int:
    """Say what became of each IMU of a bag."""
    from .. import report
    from ..store import study_to_dict

    for name, study in studies.items():
        common.warn(f'{name}: {w}' for w in study.source.get('warnings', ()))
    common.warn(f'{topic} is not analysed: {why}' for topic, why in refused.items())
    if args.json:
        common.print_json({'studies': {n: study_to_dict(s) for n, s in studies.items()},
                           'refused': refused})
        return 0
    for name, study in studies.items():
        print(f'{study.source["topic"]}:\n')
        print(report.text(study, str(folder / name), verbose=args.verbose, si=args.si))
    print(f'written to {folder}: {" ".join(studies)}, a study each')
    return 0


def solved(folder: str, targets: Collection[str]) -> str:
    """Return nothing: what a model comes to are its coefficients."""
    return ''
