# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How often ``compare`` says that something changed, where nothing has and where something has.

    python bench/compare_pairs.py [--of noise] [--change N] [--pairs 200] [--seed 1]
                                  [-o pairs.jsonl]

Each pair of noise is of one sensor: a record of 60 s to 1 h at 50 to 400 Hz (100 000 samples at
most), and one of another bias, another length and, in half of the pairs, another rate. N and B are
the same on all axes, K from what does not show to what is seen from seconds on; a third of the
sensors are quantised (noise of 0.4 to 5 steps at 100 Hz), a third have a line; one axis, or six in
a quarter of the pairs. With ``--change`` the second record
has N 10 % larger, K three times as large (of sensors whose K shows), or a line of twice the
amplitude. Asked: of pairs without a change one in a hundred has any row ``changed``.

``--of calibration``: two sessions of one device, six faces held level to 1 deg or ten to twenty
poses (then the gyroscope too, by the turns between). ``--of filter``: two records of one sensor
that is filtered, one axis, 25 to 60 s: at rest or in motion of one kind with the bank for any
motion, at rest with coloured noise, or moved by the increments of Qian et al. 2010, each with its
model; in half of the pairs at another rate.
"""

import argparse
import collections
import json
import pathlib
import sys

import numpy as np
from scipy.signal import lfilter

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'test')]

import calibration_sessions as sim  # noqa: E402,I100,I201

from imu_noise_tools.core.record import ImuRecord  # noqa: E402,I201
from imu_noise_tools.filter.problem import problem_of  # noqa: E402
from imu_noise_tools.loop.effect import model_of  # noqa: E402
from imu_noise_tools.loop.study import Study  # noqa: E402
from imu_noise_tools.tasks.calibration import calibrate_records  # noqa: E402
from imu_noise_tools.tasks.compare import compare_two, LEVEL  # noqa: E402
from imu_noise_tools.tasks.noise import analyse_record  # noqa: E402

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
        out['step'] = n * 10 * rng.uniform(0.2, 2.5)    # deviations at 100 Hz
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
        y[:, k] += 100 * s['N'] * rng.standard_normal()     # another bias from start to start
    y[:, 5] += 9.80665
    if s['step']:
        y = s['step'] * np.round(y / s['step'])
    return ImuRecord(y[:, :3], y[:, 3:] if s['axes'] > 3 else None, t, rate, start=1.7e9)


def two_rates(rng, rates) -> list[float]:
    """Draw the rates of two records: one rate in half of the pairs and more."""
    first, second = rng.choice(rates, 2)
    return [float(first), float(rng.choice((first, second)))]


def of_noise(rng, change: str) -> tuple[dict, list[Study]]:
    """Return what a sensor is, and the studies of two records of it at rest."""
    s = sensor(rng, change)
    rates = two_rates(rng, RATES)
    lengths = 10 ** rng.uniform(np.log10(60 if change == 'none' else 300), np.log10(3600), 2)
    other = {**s, **{'N': {'N': 1.1 * s['N']}, 'K': {'K': 3 * s['K']},
                     'line': {'line': 2 * s['line']}}.get(change, {})}
    return {**s, 'rates': rates, 'lengths': lengths.tolist()}, [
        analyse_record(record(rng, x, float(length), rate),
                       axes=('gyro_x',) if s['axes'] == 1 else None)
        for x, length, rate in zip((s, other), lengths, rates)]


def of_calibration(rng, change: str) -> tuple[dict, list[Study]]:
    """Return what is calibrated how, and the studies of two sessions."""
    faces = bool(rng.random() < 0.5)
    accel = sim.Device.drawn(rng, noise=10 ** rng.uniform(-2.3, -1.5), upper=not faces)
    gyro = sim.Device.drawn(rng, 'gyro', noise=10 ** rng.uniform(-3, -2.3))
    studies, poses = [], []
    for rate in (rates := two_rates(rng, (50, 100))):
        poses.append(6 if faces else int(rng.integers(10, 21)))
        ups = (sim.tilted(sim.faces()[1], np.radians(1), rng) if faces else
               sim.spread_directions(poses[-1], rng)[rng.permutation(poses[-1])])
        t, rates_, force, _ = sim.stream(accel, ups, rng, rate, rng.uniform(2.5, 5), gyro=gyro)
        studies.append(calibrate_records([ImuRecord(rates_, force, t, rate)]).study)
    return {'faces': faces, 'rates': rates, 'poses': poses, 'noise': accel.noise}, studies


MOTIONS = {'rest': ('any_motion', 'white'), 'sway': ('any_motion', 'white'),
           'coloured': ('constant_rate', 'white', 'gauss_markov'),
           'increments': ('constant_rate', 'ar_increment', 'white')}


def of_filter(rng, change: str) -> tuple[dict, list[Study]]:
    """Return what is filtered, and the studies of two records of it."""
    s = {'motion': str(rng.choice(list(MOTIONS))), 'N': 10 ** rng.uniform(-4.3, -3.5),
         'size': float(rng.uniform(0.1, 1)), 'tc': float(rng.uniform(0.1, 1))}
    s['rates'] = two_rates(rng, (50, 100, 200))
    if s['motion'] == 'increments':     # which are counted in messages
        s['rates'][1] = s['rates'][0]
    studies = []
    for rate in s['rates']:
        t = np.arange(int(rng.uniform(25, 60) * rate)) / rate
        x, a = rng.standard_normal(len(t)), np.exp(-1 / (rate * s['tc']))
        if s['motion'] == 'sway':
            x = lfilter([1], [1, -2 * a, a * a], x)     # a rate that has a slope
            x *= s['size'] / np.std(x)
        elif s['motion'] == 'coloured':
            x[1:] *= np.sqrt(1 - a * a)
            x = s['N'] * 30 * s['size'] * lfilter([1], [1, -a], x)
        elif s['motion'] == 'increments':
            x = np.cumsum(lfilter([1], [1, -0.3], x)) * s['N'] * np.sqrt(rate) * s['size']
        else:
            x *= 0
        z = x + s['N'] * np.sqrt(rate) * rng.standard_normal(len(t))
        studies.append(Study.begin({'gyro_x': problem_of(t, z, 'gyro_x')},
                                   model_of('filter', MOTIONS[s['motion']]), {}))
    return s, studies


def pair(rng, of: str, change: str) -> dict:
    """Draw two records, compare them, return what is said to have changed."""
    s, studies = {'noise': of_noise, 'calibration': of_calibration,
                  'filter': of_filter}[of](rng, change)
    rows = compare_two(*studies)
    return {**s, 'rows': sum(bool(r['sigmas']) for r in rows),
            'sigmas': {f'{r["target"]} {r["what"]}': float(r['sigmas']) for r in rows
                       if r['sigmas']},
            'changed': [f'{r["target"]} {r["what"]} {r["sigmas"]}' for r in rows
                        if r['verdict'] == 'changed']}


def kind(row: str) -> str:
    """Return what kind of row it is: power or line, a coefficient's symbol or effect."""
    what = row.split()[1]
    effect, _, name = what.partition('.')
    return effect if '_' in name or not name else name


def main() -> None:
    """Draw pairs and count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--of', choices=('noise', 'calibration', 'filter'), default='noise')
    parser.add_argument('--change', choices=('none', 'N', 'K', 'line'), default='none')
    parser.add_argument('--pairs', type=int, default=200)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('-o', '--output', type=pathlib.Path)
    args = parser.parse_args()
    if args.of != 'noise' and args.change != 'none':
        parser.error('--change is of noise')
    rows = []
    for seed in range(args.seed, args.seed + args.pairs):
        rng = np.random.default_rng([31, seed])
        rows.append({'seed': seed, **pair(rng, args.of, args.change)})
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
