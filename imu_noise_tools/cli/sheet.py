# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""``sheet``: the values of a data sheet as a study."""

from __future__ import annotations

import argparse
from typing import Any

from . import common, completion

EXAMPLE = """example of SHEET.yaml (units as on the sheet; each entry may be three values, x y z):
  name: my IMU
  source: data sheet, revision, table
  rate_hz: 200
  one_sided: true
  gyro: {noise_density: 0.014 deg/s/sqrt(Hz), allan_minimum: 8 deg/h}
  accel: {noise_rms: {value: 1.4 mg, bandwidth_hz: 47}, rate_random_walk: 1e-4 m/s^3/sqrt(Hz)}
"""


def register(commands: Any) -> None:
    """Add the command."""
    c = commands.add_parser(
        'sheet', help="a data sheet's values and units as a study that every export takes",
        epilog=EXAMPLE, formatter_class=argparse.RawDescriptionHelpFormatter)
    which = c.add_argument('sheet', metavar='SHEET.yaml', nargs='?',
                           help='a file, or the name of a sheet that comes with the package')
    completion.offer(which, completion.sheets)
    c.add_argument('--list', action='store_true', help='the sheets that come with the package')
    c.add_argument('-o', '--output', metavar='DIR', help='where the study goes')
    c.add_argument('--force', action='store_true', help='replace what is there')
    common.output_options(c, 'the coefficients')
    c.set_defaults(func=sheet)


def sheet(args: argparse.Namespace) -> int:
    """Run ``sheet``."""
    from ..core.errors import UsageError
    from ..report.terminal import table
    from ..store import study_to_dict
    from ..tasks.sheet import known, load, sheet as task

    if args.list:
        some = {name: load(path) for name, path in known().items()}
        if args.json:
            common.print_json({'sheets': {k: v.source for k, v in some.items()}})
        else:
            print(table([(k, v.name, v.source) for k, v in some.items()],
                        ('sheet', 'sensor', 'source')))
        return 0
    if args.sheet is None or args.output is None:
        raise UsageError('sheet needs SHEET.yaml and -o DIR',
                         'e.g. sheet bmi088 -o bmi088.study; --list shows those at hand')
    study, folder = task(args.sheet, args.output, force=args.force)
    data = study_to_dict(study)
    if args.json:
        common.print_json(data)
        return 0
    rows = [(axis, name, f'{e["value"]:.4g} {e["unit"]}', e['shown'])
            for axis, target in data['targets'].items() for effect in target['effects'].values()
            for name, e in effect.items() if isinstance(e, dict) and e['value'] is not None]
    print(table(rows, ('axis', 'coefficient', 'SI', 'as the field writes it')))
    for note in study.source['notes']:
        print(f'note: {note}')
    print(f'written to {folder}\nnext: imu_noise export {folder} --format NAME -o FILE')
    return 0
