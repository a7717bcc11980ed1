# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How often ``compare`` says that something changed, where nothing has and where something has.

    python bench/compare_pairs.py [--change N] [--pairs 200] [--seed 1] [-o pairs.jsonl]

Each pair is of one sensor: a record of 60 s to 1 h at 50 to 400 Hz (100 000 samples at most), and
one of another length and, in half of the pairs, another rate. N and B are the same on all axes, K
from what does not show to what is seen from seconds on; a third of the sensors are quantised, a
third have a line; one axis, or six in a quarter of the pairs. With ``--change`` the second record
has N 10 % larger, K three times as large (of sensors whose K shows), or a line of twice the
amplitude. Asked: of pairs without a change one in a hundred has any row ``changed``.
"""

import argparse
import collections
import json
import pathlib

import numpy as np
from scipy.signal import lfilter

from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.tasks.compare import compare_two, LEVEL
from imu_noise_tools.tasks.noise import analyse_record

RATES = (50, 100, 200, 400)
LONGEST = 100_000       # samples of an axis


def sensor(rng, change: str) -> dict:
    """Return what a sensor is like."""
    n = 10 ** rng.uniform(-4.3, -3.5)
    # from 1/100 of the random walk that equals the white noise at the longest wave of a minute
    strong = n * 2 * np.pi / 60 * 10 ** rng.uniform(-2, 1.5)
    out = {'N': n, 'K': strong, 'B': n * 10 ** rng.uniform(-2.5, -0.5), 'step': 0.0, 'line': 0.0,
           'f': float(rng.uniform(2, 20)), 'axes': int(rng.choice((1, 1, 1, 6)))}
    if rng.random() < 1 / 3:
        out['step'] = n * 10 * rng.uniform(0.2, 1.5)    # of the deviation at 100 Hz
    if rng.random() < 1 / 3 or change == 'line':
        out['line'] = n * 10 ** rng.uniform(0, 1)
    if change == 'K':
        out['K'] = n * 2 * np.pi / 10 * rng.uniform(1, 3)
    return out


def flicker(rng, b: float, n: int, rate: float) -> np.ndarray:
    """Return noise of the spectrum B^2/(2 pi f): a relaxation an octave, 1/4096 s to 4096 s."""
    x = np.zeros(n)
    for tau in 2.0 ** np.arange(-6, 13):
        a = np.exp(-1 / (rate * tau))
        # of variance s^2 each, ln 2 s^2/(pi f) in sum, one-sided
        s = b / np.sqrt(2 * np.log(2))
        e = s * np.sqrt(1 - a * a) * rng.standard_normal(n)
        e[0] = s * rng.standard_normal()
        x += lfilter([1], [1, -a], e)
    return x


def record(rng, s: dict, seconds: float, rate: float) -> ImuRecord:
    """Draw a record of a sensor."""
    n = min(int(seconds * rate), LONGEST)
    t = np.arange(n) / rate
    y = np.zeros((n, 6))
    for k in range(s['axes']):
        y[:, k] = s['N'] * np.sqrt(rate) * rng.standard_normal(n) + flicker(rng, s['B'], n, rate)
        y[:, k] += s['K'] / np.sqrt(rate) * np.cumsum(rng.standard_normal(n))
        y[:, k] += s['line'] * np.sin(2 * np.pi * (s['f'] * t + rng.random()))
    y[:, 5] += 9.80665
    if s['step']:
        y = s['step'] * np.round(y / s['step'])
    return ImuRecord(y[:, :3], y[:, 3:] if s['axes'] > 3 else None, t, rate, start=1.7e9)


def pair(change: str, seed: int) -> dict:
    """Draw two records, compare them, return what is said to have changed."""
    rng = np.random.default_rng([31, seed])
    s = sensor(rng, change)
    rates = rng.choice(RATES, 2)
    rates[1] = rng.choice((rates[0], rates[1]))
    lengths = 10 ** rng.uniform(np.log10(60 if change == 'none' else 300), np.log10(3600), 2)
    other = {**s, **{'N': {'N': 1.1 * s['N']}, 'K': {'K': 3 * s['K']},
                     'line': {'line': 2 * s['line']}}.get(change, {})}
    studies = [analyse_record(record(rng, x, float(length), float(rate)),
                              axes=('gyro_x',) if s['axes'] == 1 else None)
               for x, length, rate in zip((s, other), lengths, rates)]
    rows = compare_two(*studies)
    return {'seed': seed, **s, 'rates': rates.tolist(), 'lengths': lengths.tolist(),
            'rows': sum(bool(r['sigmas']) for r in rows),
            'sigmas': {f'{r["target"]} {r["what"]}': float(r['sigmas']) for r in rows
                       if r['sigmas']},
            'changed': [f'{r["target"]} {r["what"]} {r["sigmas"]}' for r in rows
                        if r['verdict'] == 'changed']}


def kind(row: str) -> str:
    """Return what kind of row it is."""
    return row.split()[1] if 'power' in row or 'line' in row else row.split('.')[-1].split()[0]


def main() -> None:
    """Draw pairs and count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--change', choices=('none', 'N', 'K', 'line'), default='none')
    parser.add_argument('--pairs', type=int, default=200)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('-o', '--output', type=pathlib.Path)
    args = parser.parse_args()
    rows = []
    for seed in range(args.seed, args.seed + args.pairs):
        rows.append(pair(args.change, seed))
        if args.output:
            with args.output.open('a', encoding='utf-8') as out:
                out.write(json.dumps(rows[-1]) + '\n')
        if rows[-1]['changed']:
            print(seed, *rows[-1]['changed'], sep='\n    ')
    some = sum(bool(r['changed']) for r in rows)
    print(f'{some} of {len(rows)} pairs have a row that changed (chance: {LEVEL:.0%})')
    every = collections.defaultdict(list)
    for r in rows:
        for name, sigmas in r['sigmas'].items():
            every[kind(name)].append(sigmas)
    for name, sigmas in every.items():
        z = np.abs(sigmas)
        print(f'{name}: {len(z)} rows, beyond 2 sigma {np.mean(z > 1.96):.2%} (5 %), beyond 3 '
              f'{np.mean(z > 3):.2%} (0.27 %)')


if __name__ == '__main__':
    main()
