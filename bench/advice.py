# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How good the advice on how long to record is: whether records that follow it resolve.

    python bench/advice.py [--records 100] [--hours 1] [--rate 5] [--seed 1]

A record shows no random walk; its study says how long another one must be for 20 %. That one is
drawn from the same truth, as long as the longest of the range, and K counts as resolved where
its interval does not reach zero and its standard deviation is within 20 % of it. Records come
from test/hidden.py. K is drawn so that a record needs 23 h, evenly in power up to what a record
of the first length shows, or evenly in its logarithm over a decade below that. What the
likeliest values of the first record alone would have said stands beside it.
"""

from __future__ import annotations

import argparse
from pathlib import Path
import sys

import numpy as np

TOP = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TOP), str(TOP / 'test')]

import hidden  # noqa: E402

from imu_noise_tools.core.record import ImuRecord  # noqa: E402
from imu_noise_tools.loop.effect import find_effect, Model, model_of  # noqa: E402
from imu_noise_tools.noise.fit import fit  # noqa: E402
from imu_noise_tools.noise.gather import gather  # noqa: E402
from imu_noise_tools.noise.plan import duration_for, durations_for, range_in_words  # noqa: E402

WANTED = 0.2
MOST = 300_000          # samples of the second record: N, B and K are densities, the rate is free
N, B = 8.7e-5, 2.4e-5   # rad/s/sqrt(Hz), rad/s
MODEL = ('white', 'flicker', 'random_walk')


def fitted(n: int, dt: float, base, rng):
    """Return the fit of one axis drawn with a base noise."""
    x = hidden.base_noise(n, dt, base, rng)
    record = ImuRecord(np.column_stack([x, x, x]), None, np.arange(n) * dt, 1 / dt)
    evidence = gather(record, ['gyro_x'])['gyro_x']
    return fit(evidence, model_of('noise', MODEL))


def needs(k: float, rate: float) -> float:
    """Return how long a record of the truth itself needs, s."""
    truth = Model(find_effect('noise', name)({p: v}) for name, p, v in (
        ('white', 'N', N), ('flicker', 'B', B), ('random_walk', 'K', k)))
    return duration_for(truth, 'random_walk', 'K', 1 / rate, WANTED) or np.inf


def k_that_needs(seconds: float, rate: float) -> float:
    """Return the K of a truth whose record must be so long."""
    low, high = 1e-9, 1e-4
    for _ in range(40):
        middle = np.sqrt(low * high)
        low, high = (middle, high) if needs(middle, rate) > seconds else (low, middle)
    return high


def trial(hours: float, rate: float, k: float, rng) -> dict | None:
    """Return what the first record advises and what the second shows; None where it showed."""
    base = {'N': N, 'B': B, 'K': k}
    first = fitted(int(hours * 3600 * rate), 1 / rate, base, rng)
    e = first.estimates['random_walk']['K']
    if e.value is not None and e.std and e.std <= WANTED * e.value:
        return None
    begin = hours * 3600
    least, most = durations_for(first.model, first.estimates, 'random_walk', 'K', 1 / rate,
                                WANTED, begin)
    point = duration_for(first.model, 'random_walk', 'K', 1 / rate, WANTED, begin)
    if most is None:
        return {'least': least, 'most': None, 'point': point}
    dt = max(1 / rate, most / MOST)
    e = fitted(int(most / dt), dt, base, rng).estimates['random_walk']['K']
    return {'least': least, 'most': most, 'point': point,
            'resolved': e.value is not None and e.std <= WANTED * e.value,
            'shown': e.value is not None}


def main() -> None:
    """Run both draws."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--records', type=int, default=100)
    parser.add_argument('--hours', type=float, default=1.0)
    parser.add_argument('--rate', type=float, default=5.0)
    parser.add_argument('--seed', type=int, default=1)
    args = parser.parse_args()
    fixed = k_that_needs(23 * 3600, args.rate)
    loudest = k_that_needs(args.hours * 3600, args.rate)
    for name, draw in (('K needs 23 h', lambda rng: fixed),
                       ('K^2 even up to what the first shows',
                        lambda rng: loudest * np.sqrt(rng.random())),
                       ('K even in its logarithm over a decade below that',
                        lambda rng: loudest * 10 ** -rng.random())):
        rng = np.random.default_rng(args.seed)
        found: list[dict] = []
        while len(found) < args.records:
            k = draw(rng)
            one = trial(args.hours, args.rate, k, rng)
            if one is not None:
                found.append({**one, 'needs': needs(k, args.rate)})
        done = [f for f in found if f['most'] is not None]
        good = sum(f['resolved'] for f in done)
        inside = sum((f['least'] or 0) <= f['needs'] <= (f['most'] or np.inf) for f in found)
        short = sum(f['point'] is not None and f['point'] < 0.5 * f['needs'] for f in found)
        typical = [None if np.isinf(x) else float(x) for x in (
            np.median([f['least'] or np.inf for f in found]),
            np.median([f['most'] or np.inf for f in found]))]
        print(f'{name}: {good} of {len(done)} that follow the advice resolve K to '
              f'{100 * WANTED:g} %, {sum(f["shown"] for f in done)} show it; '
              f'{len(found) - len(done)} told of no end; the range holds what the truth needs in '
              f'{inside} of {len(found)}, is {range_in_words(*typical)} in the middle; the '
              f'likeliest values alone: under half of it in {short}')


if __name__ == '__main__':
    main()
