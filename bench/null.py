# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Gains that candidates reach where nothing is hidden: writes imu_noise_tools/noise/null.py.

    python bench/null.py [--records 200] [--write]

Records of several durations and rates with white, flicker and random-walk noise, a wandering
temperature and an accelerometer beside them. The penalty of a candidate is the gain that one
record in a thousand exceeds: an exponential tail is fitted to the largest tenth, for a thousandth
is beyond what a few hundred records show directly.

"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
import sys

import numpy as np

TOP = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TOP), str(TOP / 'test')]

from hidden import draw  # noqa: E402
from imu_noise_tools.loop.effect import model_of  # noqa: E402
from imu_noise_tools.noise.candidates import candidates  # noqa: E402
from imu_noise_tools.noise.gather import gather  # noqa: E402
from imu_noise_tools.noise.problem import NoiseProblem  # noqa: E402

CELLS = ((1.0, 50.0), (0.5, 100.0), (2.0, 50.0), (6.0, 10.0), (0.1, 100.0))  # hours, Hz
LEVEL = 1e-3
LEAST = 6.0  # a short tail is no licence: no candidate is believed for less


def one(seed: int) -> list[tuple[str, float]]:
    """Return (name, gain) of every candidate on the gyroscope axes of one record."""
    rng = np.random.default_rng([20, seed])
    hours, rate = CELLS[seed % len(CELLS)]
    record, _ = draw(rng, (), hours=hours, rate_hz=rate, accel=True)
    wander = np.cumsum(rng.standard_normal(record.n)) * 0.5 / np.sqrt(record.n)
    record.covariates['temperature'] = (
        25 + wander + rng.uniform(-3, 3) * np.exp(-record.t / rng.uniform(100, 2000))
    )
    out = []
    model = model_of('noise', ('white', 'flicker', 'random_walk'))
    for axis, e in gather(record, ('gyro_x', 'gyro_y', 'gyro_z')).items():
        problem = NoiseProblem(e)
        out += [(f.name, f.gain) for f in candidates(problem, problem.fit(model))]
        out.append(('axes', 1.0))
    return out


def threshold(gains: np.ndarray, total: int) -> float:
    """
    Return the gain exceeded with probability LEVEL.

    An exponential tail above the 90 % point.

    """
    gains = np.concatenate([gains, np.zeros(max(total - len(gains), 0))])
    start = max(float(np.quantile(gains, 0.9)), 0.0)
    scale = float(np.mean(gains[gains > start] - start)) if np.any(gains > start) else 0.5
    return max(start + scale * float(np.log(0.1 / LEVEL)), LEAST)


def main():
    """Run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--records', type=int, default=200)
    parser.add_argument('--write', action='store_true')
    parser.add_argument('--jobs', type=int, default=1)
    args = parser.parse_args()
    found: dict[str, list[float]] = {}
    with ProcessPoolExecutor(args.jobs) as pool:
        for k, rows in enumerate(pool.map(one, range(args.records)), 1):
            print(f'\r{k} of {args.records}', end='', file=sys.stderr, flush=True)
            for name, gain in rows:
                found.setdefault(name, []).append(gain)
    total = len(found.pop('axes'))
    table = {}
    found.pop('sinusoid', None)  # what chance reaches there depends on the length: line_penalty
    for name, gains in sorted(found.items()):
        table[name] = round(threshold(np.array(gains), total), 2)
        print(
            f'{name:20s} {len(gains):5d}  90 % {np.quantile(gains, 0.9):6.2f}  '
            f'99 % {np.quantile(gains, 0.99):6.2f}  largest {max(gains):6.2f}  '
            f'penalty {table[name]:6.2f}'
        )
    if args.write:
        lines = [
            '"""',
            'Gain in nats that a candidate exceeds by chance in one axis of a thousand.',
            '',
            'Written by bench/null.py.',
            '',
            '"""',
            '',
            f'AXES = {total}',
            'DEFAULT = 10.0',
            'PENALTY = {',
            *(f'    {k!r}: {v},' for k, v in table.items()),
            '}',
        ]
        path = TOP / 'imu_noise_tools' / 'noise' / 'null.py'
        head = [x for x in path.read_text().splitlines() if x.startswith('#')]   # the licence
        path.write_text('\n'.join([*head, *([''] if head else []), *lines]) + '\n')


if __name__ == '__main__':
    main()
