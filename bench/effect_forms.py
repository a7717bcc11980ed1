# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Tell whether each effect, in the forms it takes, is the best candidate and is fitted to its truth.

Figures for bench/RESULTS.md.

    python bench/effect_forms.py [--records 6] [--effects narrowband,...] [--hours 0.5] [--rate 50]

Records from test/hidden.py, strength 1 to 10; the base model is white + flicker + random_walk.
*Best*: the effect's candidate has the largest gain less penalty. *Inside*: values of the true
model whose 95 % interval holds the truth, of those that have one.

"""

from __future__ import annotations

import argparse
from pathlib import Path
import sys
import time

import numpy as np

TOP = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TOP), str(TOP / 'test')]

import hidden  # noqa: E402

from imu_noise_tools.loop.effect import model_of  # noqa: E402
from imu_noise_tools.noise.candidates import candidates  # noqa: E402
from imu_noise_tools.noise.gather import gather  # noqa: E402
from imu_noise_tools.noise.problem import NoiseProblem  # noqa: E402

BASE = ('white', 'flicker', 'random_walk')
FORMS = ('sinusoid', 'harmonics', 'narrowband', 'low_pass', 'notch', 'drift', 'slow_periodic',
         'step', 'shock', 'spikes', 'variance_change')


def one(name: str, seed: int, hours: float, rate: float):
    """Return (clear, best, what is best, values inside, values) of one record."""
    rng = np.random.default_rng([13, FORMS.index(name), seed])
    record, truth = hidden.draw(rng, [name], hours=hours, rate_hz=rate)
    (inside,) = truth.hidden['gyro_x']
    problem = NoiseProblem(gather(record, ['gyro_x'])['gyro_x'])
    found = candidates(problem, problem.fit(model_of('noise', BASE)))
    best = max(found, key=lambda f: f.gain - f.penalty)
    estimates = problem.fit(model_of('noise', (*BASE, name))).estimates[name]
    held = [e.ci95[0] <= inside.values[k] <= e.ci95[1] for k, e in estimates.items()
            if e.value is not None and e.ci95 is not None and inside.values.get(k, 0) != 0]
    clear = inside.nats >= hidden.ENOUGH * (2 if name in hidden.IMITABLE else 1)
    return clear, best.name == name, best.name, sum(held), len(held)


def main():
    """Run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--records', type=int, default=6)
    parser.add_argument('--effects', default=','.join(FORMS))
    parser.add_argument('--hours', type=float, default=0.5)
    parser.add_argument('--rate', type=float, default=50.0)
    args = parser.parse_args()
    print('| effect | clear | best | instead | inside | CPU s |\n|---|---|---|---|---|---|')
    for name in args.effects.split(','):
        begin = time.process_time()
        rows = [one(name, k, args.hours, args.rate) for k in range(args.records)]
        clear = [r for r in rows if r[0]]
        instead = ', '.join(r[2] for r in clear if not r[1]) or '-'
        print(f'| {name} | {len(clear)} of {len(rows)} | {sum(r[1] for r in clear)} | {instead} | '
              f'{sum(r[3] for r in rows)} of {sum(r[4] for r in rows)} | '
              f'{(time.process_time() - begin) / len(rows):.1f} |', flush=True)


if __name__ == '__main__':
    main()
