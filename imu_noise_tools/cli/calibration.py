# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""``calibrate`` and ``apply``: from poses to a calibration, and a bag corrected by it."""

from __future__ import annotations

import argparse
from collections.abc import Collection
from pathlib import Path
from typing import Any

from . import common


def register(commands: Any) -> None:
    """Add the commands."""
    c = commands.add_parser(
        'calibrate', help='scale, cross-axis sensitivity and bias from six faces, many poses, or '
                          'turns',
        description='Read poses held still (accelerometer), or turns of known rate or angle '
                    '(gyroscope), solve, and '
                    'write calibration.yaml, calibration.png, report.html and the study.')
    c.add_argument('bags', metavar='BAG', nargs='+',
                   help='one bag with all poses, or a bag a pose')
    c.add_argument('-o', '--output', metavar='DIR', help='where it goes (default: BAG.study)')
    c.add_argument('--sensor', choices=('accel', 'gyro'),
                   help='default: both, the gyroscope by the turns between the poses; gyro with '
                        '--rate or --turn')
    c.add_argument('--gravity', type=float, metavar='G',
                   help='local gravity, m/s^2 (default: 9.80665)')
    c.add_argument('--latitude', type=float, metavar='DEG',
                   help='local gravity by the WGS-84 formula; Earth rate of a gyroscope')
    c.add_argument('--height', type=float, metavar='M',
                   help='height above the ellipsoid, with --latitude')
    g = c.add_mutually_exclusive_group()
    g.add_argument('--rate', type=float, metavar='DEG_S',
                   help='gyroscope: rate of the table, turned both ways about each axis')
    g.add_argument('--turn', type=float, metavar='DEG',
                   help='gyroscope: angle of hand turns about each axis, from rest to rest')
    c.add_argument('--tilt', type=float, default=1.0, metavar='DEG',
                   help='how well the faces are level, rms, for --method wls (default: 1)')
    c.add_argument('--method', choices=('faces', 'wls', 'ols', 'norm', 'few'),
                   help='faces (default): by magnitudes, and across them by faces of unknown '
                        'tilt; wls: by a stated tilt; ols: plain; norm (default with 12 and more '
                        'spread poses): by the magnitude alone; few (default with fewer that '
                        'are no faces): so, with axes square to 2 deg')
    c.add_argument('--still', type=float, default=0.8, metavar='S',
                   help='shortest rest that is a pose, 0.5 to 60 s (default: 0.8, of a second\'s '
                        'hold)')
    common.topic_options(c)
    common.part_options(c)
    common.unit_options(c)
    c.add_argument('--force', action='store_true', help='replace a study that is there')
    common.output_options(c, 'calibration.yaml')
    c.set_defaults(func=calibrate)

    c = commands.add_parser('apply', help='write a bag with calibrated Imu messages beside the '
                                          'original topics')
    c.add_argument('bag', metavar='BAG', help='what to correct')
    c.add_argument('-o', '--output', metavar='BAG2', required=True,
                   help='the bag to write, of the same kind')
    c.add_argument('--calibration', metavar='DIR', required=True,
                   help='a folder that calibrate wrote, or a calibration.yaml')
    common.topic_options(c)
    c.add_argument('--rate-hz', type=float, metavar='R',
                   help='sample rate of a table that has no stamps')
    common.gyro_unit_option(c, 'that of the calibration\'s recording')
    common.accel_unit_option(c, 'that of the calibration\'s recording')
    c.add_argument('--force', action='store_true', help='replace a bag that is there')
    common.output_options(c, 'what was written')
    c.set_defaults(func=apply)


def calibrate(args: argparse.Namespace) -> int:
    """Run ``calibrate``."""
    from ..core.errors import UsageError
    from ..report.words import next_steps
    from ..tasks import calibration as tasks
    common.load_own_effects(args)
    selection = common.selection_of(args)
    if not 0.5 <= args.still <= 60:
        raise UsageError(f'invalid --still {args.still:g}', 'it must be 0.5 to 60 (seconds)')
    for name in ('rate', 'turn'):
        value = getattr(args, name)
        if value is not None and not 0 < abs(value) < 1e5:
            raise UsageError(f'invalid --{name} {value:g}', 'give degrees, not zero')
    with common.progress_line(args) as progress:
        done = tasks.calibrate(
            args.bags, args.output, topic=args.topic, fields=args.fields, selection=selection,
            force=args.force, progress=progress, **common.units_of(args),
            sensor=args.sensor, gravity=args.gravity, latitude=args.latitude, height=args.height,
            rate_deg_s=args.rate, turn_deg=args.turn, tilt_deg=args.tilt, method=args.method,
            seconds=args.still)
    common.warn(done.study.source['warnings'])
    common.warn(f'gyro: {w}' for w in done.study.source.get('gyro', {}).get('warnings', ()))
    data = tasks.as_dict(done.study)
    if args.json:
        common.print_json(data)
        return 0
    for c in (done.calibration, done.gyro):
        if c is not None:
            _show(c, data if done.gyro is None else data[c.sensor], done.study.source)
    if 'time_offset' in data:
        print(_late(data['time_offset']))
    print(f'written to {done.folder}: calibration.yaml, calibration.png, report.html')
    for command, why in next_steps(done.study, str(done.folder)):
        print(f'next: {command}    {why}')
    return 0


def _show(c: Any, data: Any, source: Any) -> None:
    """Print what one sensor came to."""
    from ..core.errors import degrees_of_freedom

    held = (f'{c.problem.data.n} turns between {c.problem.data.rests.n} rests'
            if c.problem.method == 'turns' else f'{c.poses.n} poses, {c.problem.method}')
    print(f'{c.sensor}: {held}'
          + (f', gravity {source["gravity"]:.5f} m/s^2: {source["gravity_from"]}'
             if c.sensor == 'accel' else ''))
    for note in c.notes:
        print(f'  {note}')
    print(_solved(data))
    if c.plain is not c.fit:
        print(f'  {_beside(c)}')
    if 'left_out_deg' in data:
        print(f'  turns left out miss gravity by {data["left_out_deg"]:.2f} deg rms')
    print(f'  chi-squared {c.fit.details.chi2:.1f} with {degrees_of_freedom(c.fit.details.dof)}')
    found = data['diagnosis']
    fails = [f['evidence'] for f in found['failed']] if found['verdict'] == 'unknown' else []
    print(f'  {found["verdict"]}: {"; ".join([*fails, found["advice"]])}')


def solved(folder: str, targets: Collection[str]) -> str:
    """Return S and bias of some sensors as the calibration.yaml of a study's folder has them."""
    from ..core.errors import InputError
    from ..tasks import calibration as tasks

    file = Path(folder) / tasks.FILE
    try:
        return '\n'.join(f'{data["sensor"]}:\n{_solved(data)}'
                         for data in (tasks.sensors_of(file) if file.is_file() else ())
                         if data['sensor'] in targets)
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise InputError(f'{file}: not a calibration ({type(error).__name__}: {error})',
                         'calibrate again with --force') from None


def _solved(data: Any) -> str:
    """Return S and bias in a table, and the temperature they hold at where they follow one."""
    from ..calibration import is_heated

    std = data['std']
    rows = ['      S (scale and cross-axis sensitivity), ± one standard deviation   bias']
    for k, axis in enumerate('xyz'):
        row = '  '.join(f'{s:9.6f} ±{e:.1e}' if s or e else f'{"0 (chosen axes)":>18}'
                        for s, e in zip(data['S'][k], std['S'][k]))
        rows.append(f'  {axis}   {row}   {data["bias"][k]:10.6f} ±{std["bias"][k]:.1e} '
                    f'{data["unit"]}')
    if is_heated(data):
        rows.append(f'  at {data["reference_temperature"]:.2f} degC')
    return '\n'.join(rows)


def _late(offset: Any) -> str:
    """Return how the stamps of the two sensors differ, or within what they do not."""
    low, high = (1e3 * x for x in offset['ci95'])
    if low <= 0 <= high:
        return ('accelerometer and gyroscope are stamped alike, as far as the turns tell: '
                f'within {max(-low, high):.1f} ms (95 %)')
    value = 1e3 * offset['value']
    return (f'the accelerometer is {abs(value):.1f} ms {"later" if value > 0 else "earlier"} than '
            f'the gyroscope (± {1e3 * offset["std"]:.2g} ms, one standard deviation)')


def _beside(c: Any) -> str:
    """Return how far plain least squares is from the solution, and why."""
    import numpy as np
    apart = np.abs(c.plain.details.bias - c.bias).max()
    ppm = 1e6 * np.abs(np.diag(c.plain.details.scale) / np.diag(c.S) - 1).max()
    return (f'plain least squares (ols) puts the bias up to {apart:.2g} {c.problem.unit} and the '
            f'scale factors up to {ppm:.0f} ppm elsewhere: the faces are tilted by '
            f'{np.degrees(c.fit.details.tilt):.2g} deg')


def apply(args: argparse.Namespace) -> int:
    """Run ``apply``."""
    from ..tasks import calibration as tasks
    common.load_own_effects(args)
    with common.progress_line(args) as progress:
        share = (lambda p: progress(p, 'correcting')) if progress else None
        written, warnings = tasks.apply_calibration(
            args.bag, args.output, args.calibration, topic=args.topic, fields=args.fields,
            gyro_unit=args.gyro_unit, accel_unit=args.accel_unit, rate_hz=args.rate_hz,
            force=args.force, progress=share)
    common.warn(warnings)
    if args.json:
        common.print_json({'written': str(written), 'topic': tasks.CALIBRATED,
                           'warnings': list(warnings)})
        return 0
    print(f'written to {written}, with {tasks.CALIBRATED} beside the original topics')
    return 0
