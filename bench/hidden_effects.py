# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Tell whether something hidden in a record is named.

Confusion tables for bench/RESULTS.md.

    python bench/hidden_effects.py [--set one|none|unknown|two] [--records 300] [--strength 1,10]
                                   [--effects sinusoid,...] [--hours 1] [--rate 50] [--bags]

The records come from test/hidden.py, which shares no formula with the package. One gyroscope axis
holds the effect; the verdict on it is the first diagnosis of the base model white + flicker +
random_walk. With one effect hidden, it is then added, and after it another that is not there.

"""

from __future__ import annotations

import argparse
from collections import Counter, defaultdict
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
import sys
import tempfile

import numpy as np

TOP = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TOP), str(TOP / 'test')]

import hidden  # noqa: E402

from imu_noise_tools.core.errors import ImuNoiseError  # noqa: E402
from imu_noise_tools.loop.verdict import FALL, NO_BETTER, VERDICTS  # noqa: E402
from imu_noise_tools.tasks.noise import analyse_record  # noqa: E402


def verdict_of(diagnosis) -> str:
    """Return the name that is missing, or the verdict."""
    return diagnosis.ranked[0].name if diagnosis.verdict == 'missing' else diagnosis.verdict


def one(job) -> dict:
    """Return what was hidden in one record and what the loop said of it."""
    names, strength, hours, rate, seed, bags = job
    rng = np.random.default_rng([7, seed])
    record, truth = hidden.draw(rng, names, strength=strength, hours=hours, rate_hz=rate)
    if bags:
        record = through_bag(record)
    # the record is still by construction; a strong effect must not be mistaken for motion here
    study = analyse_record(record, axes=('gyro_x',), keep_motion=True)
    first = study.diagnose(['gyro_x'])['gyro_x']
    out = {
        'seed': seed,
        'hidden': truth.hidden['gyro_x'],
        'verdict': verdict_of(first),
        'ranked': [(f.name, round(float(f.gain), 1), round(float(f.penalty), 1))
                   for f in first.ranked[:3]],
        'failed': [f.name for f in first.failed],
    }
    if len(names) > 1:
        steps = study.complete(['gyro_x'], most=4)
        back = [s.removed for s in steps if s.removed]
        out['added'] = [k for s in steps if s.added for k in s.added.split('+') if k not in back]
        out['last'] = study.diagnosis['gyro_x'].verdict
    elif names and out['verdict'] == names[0]:
        (step,) = study.add([names[0]], ['gyro_x'])
        error = study.states['gyro_x'].error
        out['fell'] = step.fall > FALL
        out['within'] = bool(error.within_chance)
        out['views'] = [k for k, v in error.views.items() if v.excess > 3 * v.std]
        wrong = str(rng.choice([k for k in hidden.KNOWN if k != names[0]]))
        try:
            (step,) = study.add([wrong], ['gyro_x'])
            out['wrong'] = wrong, step.verdict not in NO_BETTER
        except ImuNoiseError:
            pass                                        # it does not apply to this record
    return out


def through_bag(record):
    """Write the record as a bag and read it back: the loop sees the bag alone."""
    from imu_noise_tools.bag import open_record, write_bag

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'bag'
        write_bag(path, record, storage='mcap')
        return open_record(path)


def right(row) -> bool:
    """Tell whether the verdict is right."""
    return hidden.right(tuple(row['hidden']), row['verdict'])


def found(row) -> bool:
    """Tell whether all that was hidden was added, where there were several."""
    return len(row['hidden']) < 2 or {h.name for h in row['hidden']} <= set(row['added'])


def share(good) -> str:
    """Return the share of what is true with its 95 % interval (Wilson)."""
    good = list(good)
    if not good:
        return '-'
    n, p, z = len(good), sum(good) / len(good), 1.96
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * np.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return f'{100 * p:.1f} % of {n} [{100 * (middle - half):.1f}, {100 * (middle + half):.1f}]'


def main():
    """Run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--records', type=int, default=300, help='records in all')
    parser.add_argument('--effects', default='', help='comma-separated; default: all known')
    parser.add_argument('--set', default='one', choices=('one', 'none', 'unknown', 'two'))
    parser.add_argument('--strength', default='1,10')
    parser.add_argument('--hours', type=float, default=1.0)
    parser.add_argument('--rate', type=float, default=50.0)
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--jobs', type=int, default=1)
    parser.add_argument(
        '--bags', action='store_true', help='write each record as a bag and read it back'
    )
    parser.add_argument('-v', action='store_true', help='print each wrong verdict')
    args = parser.parse_args()
    strength = tuple(float(x) for x in args.strength.split(','))
    strength = strength if len(strength) > 1 else strength[0]
    names = [e for e in args.effects.split(',') if e] or list(
        hidden.UNKNOWN if args.set == 'unknown' else hidden.KNOWN
    )
    rng = np.random.default_rng(args.seed)
    kinds = {'none': [()], 'one': [(n,) for n in names], 'unknown': [(n,) for n in names]}
    sets = [
        tuple(str(n) for n in rng.choice(names, 2, replace=False)) if args.set == 'two'
        else kinds[args.set][k % len(kinds[args.set])]
        for k in range(args.records)
    ]
    jobs = [
        (s, strength, args.hours, args.rate, args.seed * 100003 + k, args.bags)
        for k, s in enumerate(sets)
    ]
    rows = []
    with ProcessPoolExecutor(args.jobs) as pool:
        for row in pool.map(one, jobs):
            rows.append(row)
            if args.v and not (right(row) and found(row)):
                print(row, flush=True)
    print()
    (report_two if args.set == 'two' else report)(rows)


def report(rows):
    """Print the confusion table and the shares."""
    said = defaultdict(Counter)
    for r in rows:
        said[name_of(r)][r['verdict']] += 1
    print('| hidden | records | right | said |\n|---|---|---|---|')
    for name, counts in said.items():
        good = sum(right(r) for r in rows if name_of(r) == name)
        most = ', '.join(f'{v} {n}' for v, n in counts.most_common())
        total = sum(counts.values())
        print(f'| {name} | {total} | {100 * good / total:.0f} % | {most} |')
    print('\nright first verdict:', share(map(right, rows)))
    some = [r for r in rows if r['hidden']]
    if some and all(r['hidden'][0].known for r in some):
        print('of strength >= 1 and clear:', share(right(r) for r in some if r['hidden'][0].clear))
        for low, high in ((0.3, 1), (1, 3), (3, 10)):
            print(f'of strength {low} to {high}:', share(
                right(r) for r in some if low <= r['hidden'][0].strength < high))
        named = [r for r in rows if 'within' in r]
        print('the right one added, the error on data not fitted falls:',
              share(r['fell'] for r in named))
        print('  and is within chance:', share(r['within'] for r in named))
        print('  a view beyond three standard deviations:',
              dict(Counter((r['hidden'][0].name, v) for r in named for v in r['views'])))
        wrong = [r['wrong'] for r in named if 'wrong' in r]
        print('then a wrong one added, the error does not fall:',
              share(not falls for _, falls in wrong),
              dict(Counter(name for name, falls in wrong if falls)))
    else:
        wrong = [r for r in rows if r['verdict'] not in VERDICTS]
        print('a wrong name:', share(r in wrong for r in rows))


def report_two(rows):
    """Print how often both effects are found."""
    print('both found:', share(map(found, rows)))
    print('both of strength >= 1 and clear, each for itself:',
          share(found(r) for r in rows if all(h.clear for h in r['hidden'])))
    print('both clear beside the other too:',
          share(found(r) for r in rows if all(h.clear_beside for h in r['hidden'])))
    print('first verdict right:', share(map(right, rows)))
    print('nothing else added:', share(
        set(r['added']) <= set(h.name for h in r['hidden']) for r in rows))
    print('complete in the end:', share(r['last'] == 'complete' for r in rows))
    missed = Counter(str(h.name) for r in rows if all(h.clear_beside for h in r['hidden'])
                     for h in r['hidden'] if h.name not in r['added'])
    print('clear and missed:', dict(missed.most_common()))


def name_of(row) -> str:
    """Return the name of what is hidden."""
    return row['hidden'][0].name if row['hidden'] else 'nothing'


if __name__ == '__main__':
    main()
