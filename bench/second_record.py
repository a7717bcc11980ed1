# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Whether an error that falls on one record falls on another of the same truth.

    python bench/second_record.py [--kinds one,two,three] [--count 20] [--seed 1] [-o rungs.jsonl]

Two records are drawn of a plan of wild_mechanisms.py: the same effects with the same values, new
noise. The installed command analyses both and diagnoses the first until nothing more is found.
Each rung of that ladder is then scored on the second record, which no fit, no search and no
choice has seen: with the spectrum and the response of the first. What acts on single samples and
the mean (a spike, a phase) is read from the second, as the ladder itself reads it from the whole.
"""

import argparse
import json
import pathlib
import tempfile

import numpy as np
import wild
import wild_mechanisms

from imu_noise_tools.loop.effect import Model, model_of, Score
from imu_noise_tools.loop.prediction import fall_of
from imu_noise_tools.loop.problem import merged
from imu_noise_tools.noise.fit import beside
from imu_noise_tools.store import load

AXIS = 'gyro_x'


def elsewhere(first, second, model: Model) -> Score:
    """Return the error on the second record of a model fitted to the first."""
    fit = beside(second.evidence, first.point(model), model)
    return merged(part.score(fit) for _, part in second.split())


def rungs(study):
    """Return (effects before, after, step) of each rung that adds and is not taken back."""
    steps = [s for s in study.history if s.target == AXIS]
    pairs = list(zip(steps, steps[1:]))
    return [(a.effects, b.effects, b) for (a, b), later in zip(pairs, [*steps[2:], None])
            if b.added and not (later and later.removed)]


def judge(kind: str, seed: int, limit: float) -> dict:
    """Draw both records of a plan; return its rungs, with the fall on the first and the second."""
    record = getattr(wild_mechanisms, kind)(seed)
    row = {'kind': kind, 'seed': seed, 'hidden': [h['name'] for h in record.truth['hidden']]}
    with tempfile.TemporaryDirectory(prefix='second_') as made:
        folder = pathlib.Path(made)
        for name, drawn in ('first', record), ('second', wild_mechanisms.second(record)):
            np.savez(folder / f'{name}.npz', **drawn.arrays())
            code, _, errors, _ = wild.run(
                ['analyse', f'{name}.npz', '-o', name, '--axes', AXIS, '--keep-motion',
                 '--effects', ','.join(record.truth['fit'])], folder, limit)
            if code:
                return {**row, 'failed': errors[-500:]}
        code, _, errors, _ = wild.run(['diagnose', 'first', '--until-complete'], folder, limit)
        if code:
            return {**row, 'failed': errors[-500:]}
        study = load(folder / 'first')
        first = study.states[AXIS].problem
        second = load(folder / 'second').states[AXIS].problem
        row['verdict'] = study.diagnosis[AXIS].verdict
        row['rungs'] = []
        for before, after, step in rungs(study):
            scores = [elsewhere(first, second, model_of('noise', m)) for m in (before, after)]
            new = [e for e in model_of('noise', after) if e.label not in before]
            row['rungs'].append({
                'added': [e.label for e in new], 'fall': step.fall, 'verdict': step.verdict,
                'error': step.held_out, 'fall_second': fall_of(*scores, new),
                'error_before_second': scores[0].excess, 'error_second': scores[1].excess})
    return row


def main():
    """Judge records, print every rung and the share of falls that fall on the second record."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--kinds', default='one,two,three')
    parser.add_argument('--count', type=int, default=20)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--limit', type=float, default=600)
    parser.add_argument('-o', '--output', default='')
    args = parser.parse_args()
    found = []
    for seed in range(args.seed, args.seed + args.count):
        for kind in args.kinds.split(','):
            row = judge(kind, seed, args.limit)
            found += row.get('rungs', [])
            print(kind, seed, row['hidden'], row.get('failed') or row['verdict'], flush=True)
            for r in row.get('rungs', []):
                print(f"    {'+'.join(r['added']):40s} fall {r['fall']:10.1f}, on the second "
                      f"{r['fall_second']:10.1f}; error there {r['error_before_second']:.3f} to "
                      f"{r['error_second']:.3f}", flush=True)
            if args.output:
                with open(args.output, 'a') as file:
                    file.write(json.dumps(row) + '\n')
    falls = [r for r in found if r['fall'] > 0]
    print('falls on the second record too',
          wild.wilson(sum(r['fall_second'] > 0 for r in falls), len(falls)))


if __name__ == '__main__':
    main()
