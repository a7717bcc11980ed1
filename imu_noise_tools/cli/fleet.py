# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""``fleet``: many bags of many units, one table and what it says of them."""

from __future__ import annotations

import argparse
from pathlib import Path
import sys
from typing import Any

from . import common, noise

MANIFEST = """a manifest is CSV with a line a bag; other columns than these are kept as factors:
  bag,unit,model,firmware,mount,date,topic
  2026/imu07_a.mcap,imu07,BMI088,1.4,arm,2026-03-31,/imu/data_raw
  s3://recordings/imu08_a.mcap,imu08,BMI088,1.5,arm,2026-04-02,
columns gyro_unit and accel_unit say in what a bag is read, where it is not the unit of all
on other machines: dask scheduler; dask worker ADDRESS --nthreads 1; then --scheduler ADDRESS
"""


def register(commands: Any) -> None:
    """Add the command."""
    c = commands.add_parser(
        'fleet',
        help='many bags of many units: one table, outlying units, what changed',
        description='Analyse many bags on Dask; write fleet.html, fleet.csv, fleet.parquet and a '
        'study of each bag. What is done is kept: the same command goes on where it stopped.',
        epilog=MANIFEST,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    c.add_argument('inputs', metavar='INPUT', nargs='*',
                   help='bags, directories, globs, URLs (s3://, gs://, https://), a manifest .csv')
    c.add_argument('-o', '--output', metavar='DIR', help='where the fleet is kept')
    c.add_argument('--scheduler', metavar='ADDRESS',
                   help='of a Dask cluster, e.g. tcp://10.0.0.7:8786 (default: this machine)')
    c.add_argument('--workers', type=int, metavar='N',
                   help='on this machine (default: as many as cores and memory hold)')
    c.add_argument('--pattern', metavar='RE', default='',
                   help="finds unit, model, date ... in paths: '(?P<unit>imu[0-9]+)_'")
    c.add_argument('--diagnose', choices=('failing', 'all', 'none'), default='failing',
                   help='which axes are diagnosed (default: those whose model fails)')
    c.add_argument('--no-reports', action='store_true',
                   help='draw no report of each bag: half of the time, a fifth of the room')
    c.add_argument('--retry-failed', action='store_true',
                   help='try the bags again that failed before')
    c.add_argument('--compare', nargs=2, metavar=('A', 'B'),
                   help='two fleets: what differs between them')
    common.topic_options(c)
    noise.model_options(c)
    noise.record_options(c)
    common.output_options(c, 'fleet.json')
    c.set_defaults(func=fleet)


def fleet(args: argparse.Namespace) -> int:
    """Run ``fleet``."""
    from ..core.errors import UsageError

    if args.compare:
        return _compare(args)
    if not args.inputs or not args.output:
        raise UsageError('fleet needs INPUT and -o DIR',
                         'e.g. imu_noise fleet recordings -o fleet')
    if args.workers is not None and args.workers < 1:
        raise UsageError(f'invalid --workers {args.workers}', 'one or more')
    return _run(args)


def _run(args: argparse.Namespace) -> int:
    """Examine the bags and write what they say."""
    from ..fleet import assemble, extra, inputs, run

    for name in ('distributed', 'pyarrow'):
        extra(name)
    options = _options(args)
    bags = inputs.bags_of(args.inputs, args.pattern, args.topic or '')
    kept = run.Fleet(Path(args.output), options)

    def begun(todo: int, dashboard: str) -> None:
        if not args.json:
            print(f'{len(bags)} bags, {len(bags) - todo} of them done before; '
                  f'dashboard: {dashboard}', flush=True)

    try:
        with common.progress_line(args) as progress:
            summary = assemble.bring_up_to_date(kept, bags, args.scheduler, args.workers,
                                                args.retry_failed, progress, begun)
    except KeyboardInterrupt as stop:
        done = sum(kept.done(b) for b in bags)
        print(f'interrupted: {done} of {len(bags)} bags are done and kept in {kept.folder}; the '
              'same command goes on from there', file=sys.stderr)
        return common.status_of(stop)
    if args.json:
        common.print_json(summary)
    else:
        print(assemble.text(summary, str(kept.folder)))
    return 0


def _options(args: argparse.Namespace) -> Any:
    from ..core.errors import InputError
    from ..fleet.work import Options

    common.selection_of(args)       # wrong usage is said before anything is done
    common.load_own_effects(args)
    try:
        own = tuple(Path(p).read_text(encoding='utf-8') for p in args.effects_from)
    except OSError as error:
        raise InputError(f'{error.filename}: {error.strerror}') from None
    return Options(noise.how_of(args), (args.start, args.duration, args.mask, not args.no_screen),
                   args.diagnose, not args.no_reports, own)


def _compare(args: argparse.Namespace) -> int:
    """Say what differs between two fleets."""
    from ..fleet import assemble

    rows = assemble.compare(*args.compare)
    if args.json:
        common.print_json({'changes': rows})
    else:
        print(assemble.changes_text(rows, 'B against A'))
    return 0
