# Copyright 2026 imu_noise_tools maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
Tell whether something hidden in a record is named.

Confusion tables for bench/RESULTS.md.

    python bench/hidden_effects.py [--records 20] [--effects sinusoid,...] [--strength 1,10]
                                   [--hours 1] [--rate 50] [--bags]

The records come from test/hidden.py, which shares no formula with the package. One gyroscope axis
holds the effect; the verdict on it is the first diagnosis of the base model white + flicker +
random_walk.

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
from imu_noise_tools.tasks.noise import analyse_record  # noqa: E402


def verdict_of(diagnosis) -> str:
    """Return the name that is missing, or the verdict."""
    return diagnosis.ranked[0].name if diagnosis.verdict == 'missing' else diagnosis.verdict


def one(job) -> dict:
    """Return what was hidden in one record and what the loop said of it."""
    names, strength, hours, rate, seed, bags, steps = job
    rng = np.random.default_rng([7, seed])
    record, truth = hidden.draw(rng, names, strength=strength, hours=hours, rate_hz=rate)
    if bags:
        record = through_bag(record)
    # the record is still by construction; a strong effect must not be mistaken for motion here
    study = analyse_record(record, axes=('gyro_x',), keep_motion=True)
    first = study.diagnose(['gyro_x'])['gyro_x']
    out = {
        'names': names,
        'hidden': [(h.name, h.strength, h.nats, h.clear) for h in truth.hidden['gyro_x']],
        'verdict': verdict_of(first),
        'ranked': [(f.name, round(f.gain, 1), round(f.penalty, 1)) for f in first.ranked[:3]],
        'failed': [f.name for f in first.failed],
        'seed': seed,
    }
    if first.verdict == 'missing':
        before = study.states['gyro_x'].error
        done = study.complete(['gyro_x'], most=steps)
        out['added'] = [s.added for s in done]
        out['last'] = verdict_of(study.diagnosis['gyro_x'])
        after = study.states['gyro_x'].error
        out['within_chance'] = bool(after.within_chance)
        out['fell'] = bool(after.excess < before.excess or done[0].fall > 0)
    return out


def through_bag(record):
    """Write the record as a bag and read it back: the loop sees the bag alone."""
    from imu_noise_tools.bag import open_record, write_bag

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'bag'
        write_bag(path, record, storage='mcap')
        return open_record(path)


def right(row) -> bool:
    """
    Tell whether the verdict is right.

    Right is the name, below five nats complete and undecidable too; for what nobody knows,
    unknown.

    """
    if not row['hidden']:
        return row['verdict'] == 'complete'
    name, _, nats, _ = row['hidden'][0]
    if not hidden.RECIPES[name].known:
        return row['verdict'] == 'unknown'
    return row['verdict'] == name or (nats < 5 and row['verdict'] in ('complete', 'undecidable'))


def share(good: int, total: int) -> str:
    """Return a share with its 95 % interval (Wilson)."""
    if not total:
        return '-'
    p, z = good / total, 1.96
    middle = (p + z * z / (2 * total)) / (1 + z * z / total)
    half = z / (1 + z * z / total) * np.sqrt(p * (1 - p) / total + z * z / (4 * total * total))
    return f'{100 * p:.1f} % of {total} [{100 * (middle - half):.1f}, {100 * (middle + half):.1f}]'


def main():
    """Run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--records', type=int, default=20, help='records an effect')
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
    if args.set == 'none':
        sets = [()] * args.records
    elif args.set == 'two':
        sets = [tuple(rng.choice(names, 2, replace=False)) for _ in range(args.records)]
    else:
        sets = [(n,) for n in names for _ in range(args.records)]
    jobs = [
        (s, strength, args.hours, args.rate, args.seed * 100003 + k, args.bags, 4)
        for k, s in enumerate(sets)
    ]
    rows = []
    with ProcessPoolExecutor(args.jobs) as pool:
        for row in pool.map(one, jobs):
            rows.append(row)
            if args.v and not right(row):
                print(row, flush=True)
    report(rows, args)


def report(rows, args):
    """Print the confusion table and the shares."""
    if args.set == 'two':
        strong = [r for r in rows if all(h[3] for h in r['hidden'])]
        both = sum(set(h[0] for h in r['hidden']) <= set(r.get('added', ())) for r in strong)
        print(
            f'both found: {share(both, len(strong))} (strength >= 1 and clear); of all '
            f'{len(rows)}: {sum(set(r["names"]) <= set(r.get("added", ())) for r in rows)}'
        )
        return
    table = defaultdict(Counter)
    for r in rows:
        table[r['hidden'][0][0] if r['hidden'] else 'none'][r['verdict']] += 1
    said = sorted({v for c in table.values() for v in c})
    print(f'{"hidden":20s} right  ' + ' '.join(f'{s[:12]:>12s}' for s in said))
    for name, counts in table.items():
        mine = [r for r in rows if (r['hidden'][0][0] if r['hidden'] else 'none') == name]
        print(
            f'{name:20s} {100 * np.mean([right(r) for r in mine]):4.0f} % '
            + ' '.join(f'{counts[s] or "":>12}' for s in said)
        )
    print('right first verdict:', share(sum(right(r) for r in rows), len(rows)))
    clear = [r for r in rows if r['hidden'] and r['hidden'][0][3]]
    if clear and args.set == 'one':
        print('of strength >= 1 and clear:', share(sum(right(r) for r in clear), len(clear)))
        named = [r for r in rows if 'within_chance' in r and r['verdict'] == r['hidden'][0][0]]
        print(
            'after the right effect is added, held-out error within chance:',
            share(sum(r['within_chance'] for r in named), len(named)),
        )


if __name__ == '__main__':
    main()
