# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Tell whether a fleet's table is right about units, models and changes, and what it costs.

    python bench/fleet.py fleets [--count 20] [--seed 1] [--minutes 5]   bags of 64 simulated units
    python bench/fleet.py fleets --keep DIR; python bench/fleet.py again --keep DIR
    python bench/fleet.py draws [--count 400] [--seed 1]     the statistics alone, on drawn numbers
    python bench/fleet.py cost [--bags 8,64] [--minutes 5]   small bags, 1 and 2 workers
    python bench/fleet.py reduce [--bags 100000]             the table and the statistics alone

``fleets``: 64 units of two models, recorded once, twelve of them on two later dates too. One is
noisy (all axes or one), one has a line that its model does not have, one drifts; a firmware
changes N by 10 %, for half of the units from the first, for the twelve at their last date.
``draws`` are numbers with the same structure that no bag was made for: for the coverage of
intervals alone.

"""

from __future__ import annotations

import argparse
from collections import Counter
import json
from pathlib import Path
import sys
import tempfile
import time

import numpy as np

TOP = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TOP), str(TOP / 'test')]

import hidden  # noqa: E402

from imu_noise_tools.core.errors import ImuNoiseError  # noqa: E402
from imu_noise_tools.fleet import findings, population, run, table, work  # noqa: E402
from imu_noise_tools.fleet.inputs import Bag, bags_of  # noqa: E402
from imu_noise_tools.fleet.work import Options  # noqa: E402

RATE = 50.0
# no K: what minutes do not show would be counted as B by a model without it
MODELS = {'A': {'N': 1e-4, 'B': 3e-5}, 'B': {'N': 3e-4, 'B': 5e-5}}
OPTIONS = Options({'effects': ('white', 'flicker'), 'points': 20}, reports=False)
BETWEEN, WITHIN, AGAIN, CHANGE = 0.10, 0.04, 0.01, 0.10     # of log N
DATES = ('2026-01-10', '2026-06-10', '2026-11-10')


def make(folder: Path, rng: np.random.Generator, minutes: float, units: int = 64) -> dict:
    """Write a fleet's bags and its manifest; return the truth."""
    order = rng.permutation(units)
    often = sorted(int(u) for u in order[:12])
    truth = {'drift': int(order[0]), 'noisy': int(order[20]), 'line': int(order[21])}
    lines = ['bag,unit,model,firmware,date']
    how = {'noisy': (rng.uniform(1.5, 2.5), rng.choice(['all', 0, 1, 2])),
           'drift': rng.uniform(0.3, 0.6), 'line': (rng.uniform(2, 20), rng.integers(3))}
    for u in range(units):
        model = 'AB'[u % 2]
        level = rng.normal(0, BETWEEN) + rng.normal(0, WITHIN, 3)
        for k, date in enumerate(DATES if u in often else DATES[:1]):
            new = (u // 2 % 2 == 1) or (u in often and k == 2)
            log_n = level + rng.normal(0, AGAIN, 3) + new * np.log1p(CHANGE)
            if u == truth['noisy']:
                log_n[slice(None) if how['noisy'][1] == 'all' else int(how['noisy'][1])] += \
                    np.log(how['noisy'][0])
            if u == truth['drift']:
                log_n += how['drift'] * k / 2
            line = how['line'] if u == truth['line'] else None
            name = f'u{u:02d}_{k}.npz'
            record(folder / name, rng, MODELS[model], np.exp(log_n), minutes, line)
            lines.append(f'{name},u{u:02d},{model},{"1.1" if new else "1.0"},{date}')
    (folder / 'manifest.csv').write_text('\n'.join(lines) + '\n')
    return truth


def record(path: Path, rng, model, factor, minutes: float, line=None) -> None:
    """Write one record of a gyroscope; its axes' N are the model's times the factors."""
    n, dt = int(minutes * 60 * RATE), 1 / RATE
    gyro = np.column_stack([
        hidden.white(n, dt, model['N'] * f, rng) + hidden.flicker(n, dt, model['B'], rng)
        for f in factor])
    if line is not None:
        frequency, axis = line
        size = 3 * model['N'] * np.sqrt(RATE) / 10
        gyro[:, axis] += size * np.sin(2 * np.pi * frequency * np.arange(n) * dt)
    np.savez(path, gyro=gyro, rate_hz=RATE)


def fleets(args: argparse.Namespace) -> None:
    """Print what the table says of fresh fleets, against the truth."""
    tally = Tally()
    for k in range(args.count):
        rng = np.random.default_rng([args.seed, k])
        with tempfile.TemporaryDirectory() as folder:
            truth = make(Path(folder), rng, args.minutes)
            whole = table.table(map(said_of, bags_of([f'{folder}/manifest.csv'])),
                                ('firmware', 'date'))
        if args.keep:
            (args.keep / str(k)).mkdir(parents=True, exist_ok=True)
            table.write(args.keep / str(k), whole)
            (args.keep / str(k) / 'truth.json').write_text(json.dumps(truth))
        tally.count(k, whole, truth)
    tally.print()


def said_of(bag: Bag) -> tuple[Bag, str, dict]:
    """Return (bag, key, facts): what a worker finds in it, without the files that it writes."""
    try:
        return bag, bag.unit, {'error': '', 'rows': work.rows_of(work.studied(
            Path(bag.path), bag.topic, OPTIONS))}
    except ImuNoiseError as error:
        return bag, '', {'error': str(error), 'rows': []}


def again(args: argparse.Namespace) -> None:
    """Print the same of tables that ``fleets --keep`` wrote."""
    tally = Tally()
    for one in sorted(args.keep.iterdir(), key=lambda p: int(p.name)):
        tally.count(int(one.name), table.read(one), json.loads((one / 'truth.json').read_text()))
    tally.print()


class Tally:
    """What was right and wrong over several fleets."""

    def __init__(self) -> None:
        self.found, self.false, self.covered = Counter(), Counter(), Counter()
        self.changes, self.spreads, self.fleets = Counter(), [], 0

    def count(self, k: int, whole, truth: dict) -> None:
        """Add what a table says, and print it."""
        said = findings.summary(whole)
        self.fleets += 1
        called = {o['unit']: [c['what'] + (' drift' if c['drift'] else '') for c in o['why']]
                  for o in said['outlying']}
        bad = {f'u{u:02d}': kind for kind, u in truth.items()}
        for unit, kind in bad.items():
            self.found[kind] += unit in called
        extra = {u: w for u, w in called.items() if u not in bad}
        self.false.update(list(extra))
        for c in said['changes']:       # the firmware changes N and nothing else
            kind, ratio = ('N', 1 + CHANGE) if c['parameter'] == 'N' else (c['parameter'], 1)
            self.changes[kind] += 1
            self.covered[kind] += c['lo'] <= ratio <= c['hi']
        self.spreads += [m['gyro N']['between_units'] for m in said['models'].values()]
        told = {bad[u]: called.get(u) for u in bad}
        print(f'{k}: {said["bags"]} bags, failed {len(said["failed"])}, bad {told}, '
              f'false {extra}', flush=True)

    def print(self) -> None:
        """Print the whole."""
        n, wrong = self.fleets, sum(self.false.values())
        print(f'bad ones found: {dict(self.found)} of {n} each; {sum(self.found.values())} of '
              f'{3 * n}')
        print(f'false alarms: {wrong} of {61 * n} good units, {wrong / n:.2f} in a fleet of 64')
        print('intervals of the change cover: ' + ', '.join(
            f'{k} {self.covered[k]} of {self.changes[k]}' for k in self.changes))
        print(f'spread of N between units: median {np.median(self.spreads):.1f} % (truth '
              f'{100 * np.expm1(BETWEEN):.1f} %)')


def drawn(rng, units: int, axes: int, often: int, s: float, new) -> population.Sample:
    """Return a sample with the structure of a fleet, from drawn numbers."""
    unit, axis, when, firmware, y = [], [], [], [], []
    level = rng.normal(0, BETWEEN, units)
    for u in range(units):
        own = rng.normal(0, WITHIN, axes)
        for k in range(3 if u < often else 1):
            for a in range(axes):
                changed = bool(new(u, k))
                unit.append(u)
                axis.append(a)
                when.append(150.0 * k)
                firmware.append(changed)
                y.append(level[u] + own[a] + rng.normal(0, AGAIN) + rng.normal(0, s)
                         + changed * np.log1p(CHANGE))
    X = (np.array(axis)[:, None] == np.arange(axes)).astype(float)
    n = len(y)
    return population.Sample(np.array(y), np.full(n, s), np.zeros(n, bool), np.array(unit),
                             np.array(axis), np.column_stack([X, np.array(firmware, float)]),
                             np.array(when))


CASES = {
    '32 units, 6 of them three times': (32, 3, 6, 0.01),
    '32 units, measured to 10 %': (32, 3, 0, 0.10),
    '12 units': (12, 3, 0, 0.01),
    '8 units': (8, 3, 0, 0.01),
    '5 units': (5, 3, 0, 0.01),
    '4 units': (4, 3, 0, 0.01),
    '4 units, measured to 10 %': (4, 3, 0, 0.10),
    '4 units, each three times': (4, 3, 4, 0.01),
    '6 units, one axis': (6, 1, 0, 0.01),
}


def draws(args: argparse.Namespace) -> None:
    """Print coverage on drawn numbers: the change, what a new unit stays below, false alarms."""
    print(f'{"case":34s} {"change":>7s} {"bound":>7s} {"false":>8s} {"tau":>6s} {"s a fit":>8s}')
    for name, (units, axes, often, s) in CASES.items():
        inside, bound, false, taus, cpu = 0, 0, 0, [], time.process_time()
        for k in range(args.count):
            rng = np.random.default_rng([args.seed, k, units])
            sample = drawn(rng, units, axes, often, s,
                           lambda u, k: u % 2 == 1 or (u < often and k == 2))
            found = population.fit(sample)
            low, high = found.interval(axes)
            inside += low <= np.log1p(CHANGE) <= high
            new = rng.normal(0, BETWEEN) + rng.normal(0, WITHIN, axes).max()
            bound += new <= population.upper(found, range(axes))
            false += int(population.called(found.p_out).sum())
            taus.append(found.tau)
        each = (time.process_time() - cpu) / args.count
        print(f'{name:34s} {inside / args.count:7.3f} {bound / args.count:7.3f} '
              f'{false / args.count / units:8.4f} {np.median(taus):6.3f} {each:8.2f}', flush=True)


def cost(args: argparse.Namespace) -> None:
    """Print what small bags cost in a plain loop and on 1 and 2 workers."""
    import os
    import resource

    from imu_noise_tools.fleet.work import examine

    def cpu() -> float:
        """Return the CPU seconds of this process and of its children that have ended."""
        return sum(sum(resource.getrusage(who)[:2])
                   for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))

    options = Options(reports=False)
    with tempfile.TemporaryDirectory() as top:
        folder = Path(top)
        for k in range(max(args.bags)):
            record(folder / f'{k}.npz', np.random.default_rng(k), MODELS['A'], np.ones(3),
                   args.minutes)
        every = bags_of([top])
        begin, before = time.monotonic(), cpu()
        plain = [examine(b, options, top, '') for b in every[:args.bags[0]]]
        loop = time.monotonic() - begin
        print(f'plain loop: {len(plain)} bags, {loop / len(plain):.2f} s and '
              f'{(cpu() - before) / len(plain):.2f} CPU s a bag, load {os.getloadavg()[0]:.1f}')
        for workers in (1, 2):
            for count in args.bags:
                kept = run.Fleet(folder / f'fleet_{workers}_{count}', options)
                with run.connected(every[:count], None, workers) as client:
                    client.run(exec, 'import imu_noise_tools.fleet.work')
                    begin, before = time.monotonic(), time.process_time()
                    run.run(kept, kept.todo(every[:count]), client)
                    wall, mine = time.monotonic() - begin, time.process_time() - before
                inside = [f['cpu_s'] for _, _, f in kept.facts(every[:count], {})]
                print(f'{workers} workers, {count} bags: {wall:.1f} s, {np.mean(inside):.2f} '
                      f'CPU s a bag in workers, {1e3 * mine / count:.1f} CPU ms a bag in client '
                      f'and scheduler, load {os.getloadavg()[0]:.1f}', flush=True)


def reduce(args: argparse.Namespace) -> None:
    """Print what the table and the statistics of many bags take, whatever their length."""
    import resource

    rng = np.random.default_rng(args.seed)
    level = {u: rng.normal(0, BETWEEN) for u in range(args.bags // 4)}
    facts = []
    for k in range(args.bags):
        rows = []
        for axis in ('gyro_x', 'gyro_y', 'gyro_z', 'accel_x', 'accel_y', 'accel_z'):
            for effect, parameter, value in (('white', 'N', 1e-4), ('flicker', 'B', 3e-5),
                                             ('random_walk', 'K', 2e-6)):
                v = value * np.exp(level[k // 4 % len(level)] + rng.normal(0, 0.05))
                rows.append({'axis': axis, 'kind': 'coefficient', 'effect': effect,
                             'parameter': parameter, 'value': v, 'std': 0.05 * v, 'lo': 0.9 * v,
                             'hi': 1.1 * v, 'null': False, 'si': '', 'verdict': 'complete',
                             'rate_hz': 200.0, 'duration_s': 10800.0})
        facts.append((k, rows))
        if len(facts) == 2000 or k == args.bags - 1:
            break
    whole = ((Bag(f's3://bags/{k}.mcap', f'u{k // 4}', 'AB'[k // 4 % 2],
                  factors={'date': DATES[k % 3], 'firmware': '12'[k // 8 % 2]}), f'{k:020d}',
              {'error': '', 'rows': facts[k % len(facts)][1]}) for k in range(args.bags))
    begin = time.process_time()
    made = table.table(whole)
    print(f'{args.bags} bags: table of {made.num_rows} rows, {made.nbytes / 1e6:.0f} MB, '
          f'{time.process_time() - begin:.0f} CPU s, peak '
          f'{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6:.2f} GB', flush=True)
    begin = time.process_time()
    findings.summary(made)
    print(f'statistics: {time.process_time() - begin:.0f} CPU s, peak '
          f'{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6:.2f} GB')


def main() -> None:
    """Run one of the measurements."""
    p = argparse.ArgumentParser(description=__doc__,
                                formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument('what', nargs='?', default='draws',
                   choices=('fleets', 'again', 'draws', 'cost', 'reduce'))
    p.add_argument('--count', type=int)
    p.add_argument('--seed', type=int, default=1)
    p.add_argument('--minutes', type=float, default=5.0)
    p.add_argument('--keep', type=Path)
    p.add_argument('--workers', type=int, default=1)
    p.add_argument('--bags', type=lambda t: [int(x) for x in t.split(',')], default=[8, 64])
    args = p.parse_args()
    if args.what == 'reduce':
        args.bags = args.bags[-1]
    args.count = args.count or {'fleets': 20}.get(args.what, 400)
    {'fleets': fleets, 'again': again, 'draws': draws, 'cost': cost,
     'reduce': reduce}[args.what](args)


if __name__ == '__main__':
    main()
