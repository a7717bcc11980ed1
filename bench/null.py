# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Gains that candidates reach where nothing is hidden: writes imu_noise_tools/noise/null.py.

    python bench/null.py [--records 120] [--seconds 600] [--write]
    python bench/null.py --carry

Records of several durations and rates with a wandering temperature and an accelerometer beside
them; their noise is white, flicker and random walk, or lacks one of the last two, and the model is
what is in them. The penalty of a candidate is the gain that one axis in a thousand exceeds: an
exponential tail is fitted to the largest tenth, for a thousandth is beyond what a few hundred axes
show directly. What was drawn is kept beside the system's temporary files under a hash of the code
that it rests on: called again, it goes on from there. ``--write`` writes the table with that hash,
and the gains of a few of these records beside this file.

A test fails when the code is another. Most changes move no gain where nothing is hidden:
``--carry`` draws those few records again (half a minute) and, where no gain is another, writes the
hash of the code as it is beside that of the code that drew the table.

"""

from __future__ import annotations

import argparse
import ast
import hashlib
import json
from pathlib import Path
import re
import sys
import tempfile
import time

import numpy as np

TOP = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TOP), str(TOP / 'test')]

from hidden import draw, draw_sensor  # noqa: E402
from imu_noise_tools.loop.effect import model_of, registry  # noqa: E402
from imu_noise_tools.loop.findings import failures  # noqa: E402
from imu_noise_tools.noise.candidates import candidates  # noqa: E402
from imu_noise_tools.noise.gather import gather  # noqa: E402
from imu_noise_tools.noise.kinds import Line  # noqa: E402
from imu_noise_tools.noise.problem import NoiseProblem  # noqa: E402

CELLS = ((0.25, 50.0), (0.5, 50.0), (0.1, 100.0), (3.0, 10.0), (0.5, 100.0))  # hours, Hz
BASES = (  # model, and what the sensor lacks
    (('white', 'flicker', 'random_walk'), ''),
    (('white', 'flicker', 'random_walk'), ''),
    (('white', 'flicker'), 'K'),
    (('white', 'random_walk'), 'B'),
)
LEVEL = 1e-3
LEAST = 6.0  # a short tail is no licence: no candidate is believed for less
# modules of the noise domain that no gain is computed by: what is said of a fit, and plans
NO_GAIN = {'__init__', 'beside', 'classic', 'curve', 'differences', 'level', 'materiality', 'null',
           'plan', 'stated'}
SAMPLE = (0, 2, 10, 12, 15, 17)     # records of the short cells, one of each base and cell
SAMPLED = Path(__file__).with_name('null_sample.jsonl')
MOVED = 0.5     # nats by which no gain of the sample may be another; rounding moves them by less
TABLE = TOP / 'imu_noise_tools' / 'noise' / 'null.py'


def source_hash() -> str:
    """Return a hash of the lines of code that the table rests on; prose does not count."""
    total = hashlib.sha256()
    noise = TOP / 'imu_noise_tools' / 'noise'
    for path in sorted(p for p in noise.rglob('*.py') if p.stem not in NO_GAIN):
        text = path.read_text(encoding='utf-8')
        prose: set[int] = set()
        for node in ast.walk(ast.parse(text)):
            body = getattr(node, 'body', None)
            if isinstance(body, list) and body and isinstance(body[0], ast.Expr) and isinstance(
                    body[0].value, ast.Constant) and isinstance(body[0].value.value, str):
                prose.update(range(body[0].lineno, (body[0].end_lineno or 0) + 1))
        # lines, not the tree: every version of Python writes a tree in its own way
        code = [x.strip() for i, x in enumerate(text.splitlines(), 1) if i not in prose]
        total.update('\n'.join([path.name, *(x for x in code if x and x[0] != '#')]).encode())
    return total.hexdigest()[:16]


def one(seed: int) -> dict:
    """Return gains of every candidate, an axis each, and tests that failed, of one record."""
    rng = np.random.default_rng([20, seed])
    hours, rate = CELLS[seed % len(CELLS)]
    names, lacking = BASES[seed // len(CELLS) % len(BASES)]
    sensor = dict(draw_sensor(rng))
    if lacking:
        sensor[lacking] = 0.0
    record, _ = draw(rng, (), hours=hours, rate_hz=rate, accel=True, sensor=sensor)
    wander = np.cumsum(rng.standard_normal(record.n)) * 0.5 / np.sqrt(record.n)
    record.covariates['temperature'] = (
        25 + wander + rng.uniform(-3, 3) * np.exp(-record.t / rng.uniform(100, 2000))
    )
    out: dict = {'seed': seed, 'model': '+'.join(names), 'gains': [], 'failed': []}
    for e in gather(record, ('gyro_x', 'gyro_y', 'gyro_z')).values():
        problem = NoiseProblem(e)
        fit = problem.point(model_of('noise', names))
        out['gains'].append({f.name: float(f.gain) for f in candidates(problem, fit)
                             if not f.against})
        out['failed'].append([f.name for f in failures(problem.omnibus(fit))])
    return out


def moved(old: dict, new: dict) -> list[str]:
    """Return what gains another value in one of two rows of a record, in words."""
    out = []
    for axis, (before, after) in enumerate(zip(old['gains'], new['gains'])):
        for name in sorted({*before, *after}):
            one, other = (max(g.get(name, 0.0), 0.0) for g in (before, after))
            if abs(one - other) > MOVED:
                out.append(f'{name}: {one:.2f}, now {other:.2f} (record {old["seed"]}, '
                           f'axis {axis})')
    return out


def carry() -> int:
    """Write the hash of the code as it is, if the sample gains what it did; 1 if not."""
    found: list[str] = []
    for line in SAMPLED.read_text(encoding='utf-8').splitlines():
        old = json.loads(line)
        found += moved(old, one(old['seed']))
    if found:
        print('\n'.join([*found, 'gains are others: draw the table again, with --write']))
        return 1
    text = TABLE.read_text(encoding='utf-8')
    TABLE.write_text(re.sub("(?m)^SOURCES = '.*?'", f'SOURCES = {source_hash()!r}', text),
                     encoding='utf-8')
    print('no gain of the sample is another: the table holds')
    return 0


def threshold(gains: np.ndarray, total: int) -> float:
    """
    Return the gain exceeded with probability LEVEL.

    An exponential tail above the 90 % point.

    """
    gains = np.concatenate([gains, np.zeros(max(total - len(gains), 0))])
    start = max(float(np.quantile(gains, 0.9)), 0.0)
    scale = float(np.mean(gains[gains > start] - start)) if np.any(gains > start) else 0.5
    return max(start + scale * float(np.log(0.1 / LEVEL)), LEAST)


def table(rows: list[dict]) -> dict[str, float]:
    """Return the penalty of every effect: the largest over the models that it was tried on."""
    priced = [k for k, c in registry('noise').items() if not issubclass(c, Line)]
    out = {}
    for name in sorted(priced):
        found = [LEAST]
        for model in sorted({r['model'] for r in rows}):
            axes = [g for r in rows if r['model'] == model for g in r['gains']]
            gains = np.array([g[name] for g in axes if name in g])
            if len(gains):
                found.append(threshold(gains, len(axes)))
                print(f'{name:18s} {model:28s} {len(gains):4d} axes, 90 % '
                      f'{np.quantile(gains, 0.9):6.2f}, largest {gains.max():6.2f}, '
                      f'thousandth {found[-1]:6.2f}')
        out[name] = round(max(found), 2)
    return out


def gathered(records: int, seconds: float) -> list[dict]:
    """Return the rows of so many records, from where an earlier call ended, in so much time."""
    kept = Path(tempfile.gettempdir()) / f'imu_noise_null_{source_hash()}.jsonl'
    rows = [json.loads(x) for x in kept.read_text().splitlines()] if kept.exists() else []
    known, begun = {r['seed'] for r in rows}, time.process_time()
    with kept.open('a', encoding='utf-8') as out:
        for seed in range(records):
            if seed in known:
                continue
            if time.process_time() - begun > seconds:
                print(f'\nstopped after {seconds:.0f} CPU s; call again to go on', file=sys.stderr)
                break
            rows.append(one(seed))
            out.write(json.dumps(rows[-1]) + '\n')
            out.flush()
            print(f'\r{len(rows)} of {records} records', end='', file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return rows


def write(rows: list[dict], penalties: dict[str, float]) -> None:
    """Write the table, and the sample by which it may be carried on."""
    drawn = source_hash()
    lines = [
        '"""',
        'Gain in nats that a candidate exceeds by chance in one axis of a thousand.',
        '',
        'Written by bench/null.py. ``DRAWN`` is the hash of the code that it was drawn with,',
        '``SOURCES`` that of the last code that was found to gain the same in a sample of it.',
        '',
        '"""',
        '',
        f'AXES = {sum(len(r["gains"]) for r in rows)}',
        f'DRAWN = {drawn!r}',
        f'SOURCES = {drawn!r}',
        'DEFAULT = 10.0  # of an effect that is not of the package',
        'PENALTY = {',
        *(f'    {k!r}: {v},' for k, v in penalties.items()),
        '}',
    ]
    head = [x for x in TABLE.read_text(encoding='utf-8').splitlines() if x.startswith('#')]
    text = '\n'.join([*head, *([''] if head else []), *lines])     # the licence
    TABLE.write_text(f'{text}\n', encoding='utf-8')
    some = [json.dumps({**r, 'gains': [{k: round(v, 3) for k, v in g.items()}
                                       for g in r['gains']]}) for r in rows if r['seed'] in SAMPLE]
    SAMPLED.write_text('\n'.join([*some, '']), encoding='utf-8')


def main() -> int:
    """Run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--records', type=int, default=120)
    parser.add_argument('--seconds', type=float, default=600.0, help='CPU time of this call')
    parser.add_argument('--write', action='store_true')
    parser.add_argument('--carry', action='store_true',
                        help='draw a sample again; where it gains the same the table holds')
    args = parser.parse_args()
    if args.carry:
        return carry()
    rows = gathered(args.records, args.seconds)
    axes = sum(len(r['gains']) for r in rows)
    failed = [x for r in rows for x in r['failed']]
    print(f'{axes} axes; a test fails on {sum(map(bool, failed))}: {sorted(sum(failed, []))}')
    penalties = table(rows)
    if args.write:
        write(rows, penalties)
    return 0


if __name__ == '__main__':
    sys.exit(main())
