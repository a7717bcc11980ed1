# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Read N, B and K off the Allan curves of the shared records, in a few lines that use no package.

    python bench/real_records.py [--data ../shared/data] [--json BEFORE AFTER]

N is the overlapping Allan deviation at 1 s, B its minimum over 0.664 (tau <= T/10), K the
deviation over sqrt(tau/3) at T/10 where it has risen by a half above the minimum. With ``--json``
the readings stand beside what ``imu_noise analyse --json`` said, kept as NAME.json in each of the
folders, so that any versions of the package can be compared.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

NAMES = ('adis16405_run2', 'adis16405_run6', 'mpu6050_static_449s', 'mpu6050_static_100s',
         'mpu6050_buffered_655s', 'vn100_desk_756s', 'px4_auavx21', 'truck_idle_xsens_45s')


def deviation(y, m):
    """Return the overlapping Allan deviation of y (n,) at m samples."""
    x = np.concatenate([[0.0], np.cumsum(y - y.mean())])
    d = x[2 * m:] - 2 * x[m:-m] + x[:-2 * m]
    return np.sqrt(0.5 * np.mean(d ** 2)) / m


def readings(y, dt):
    """Return N, B, K of one axis; K is nan where the curve does not rise."""
    m = np.unique(np.round(np.geomspace(1, len(y) // 10, 60)).astype(int))
    s = np.array([deviation(y, k) for k in m])
    low = s[m * dt >= min(1.0, m[-1] * dt / 2)].min()
    k = s[-1] / np.sqrt(m[-1] * dt / 3) if s[-1] > 1.5 * low else np.nan
    return deviation(y, max(1, round(1 / dt))), low / 0.664, k


def main():
    """Run."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--data', type=Path,
                        default=Path(__file__).resolve().parents[2] / 'shared' / 'data')
    parser.add_argument('--json', type=Path, nargs='*', default=(), help='folders of NAME.json')
    args = parser.parse_args()
    print('| record, axis | N at 1 s | B of the floor | K |' + ' N | B | K |' * len(args.json)
          + ' set aside | sufficient |\n|' + '---|' * (6 + 3 * len(args.json)))
    for name in NAMES:
        with np.load(args.data / 'records' / f'{name}.npz') as data:
            rate = float(data['rate_hz']) if 'rate_hz' in data else \
                (len(data['t']) - 1) / np.ptp(data['t'])
            axes = {f'{s}_{c}': data[s][:, i].astype(float) for s in ('gyro', 'accel')
                    if s in data for i, c in enumerate('xyz')}
        for axis, y in axes.items():
            read = ' | '.join(f'{v:.3g}' for v in readings(y[np.isfinite(y)], 1 / rate))
            said = ' | '.join(x for folder in args.json for x in values(folder, name, axis))
            print(f'| {name}, {axis} | {read} | {said} |', flush=True)


def values(folder, name, axis):
    """Return N, B, K of an analysis, and of one that says so what was set aside."""
    file = folder / f'{name}.json'
    text = file.read_text() if file.is_file() else ''
    found = json.loads(text or '{}').get('targets', {}).get(axis)
    if not found:
        return ['-'] * 3
    out = [shown(found['effects'][e][k])
           for e, k in (('white', 'N'), ('flicker', 'B'), ('random_walk', 'K'))]
    if 'sufficient' in found:
        aside = found.get('set_aside', ())
        out.append('; '.join(f'{s["from_hz"]:.3g}-{s["to_hz"]:.3g} Hz' for s in aside[:4])
                   + (f' and {len(aside) - 4} more' if len(aside) > 4 else ''))
        out.append('yes' if found['sufficient'] else 'no')
    return out


def shown(e):
    """Return a value, or its limit."""
    return f'{e["value"]:.3g}' if e['value'] is not None else f'< {e.get("upper95") or 0:.2g}'


if __name__ == '__main__':
    main()
