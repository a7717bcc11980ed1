# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What the samples say for a telegraph against a relaxation of the same spectrum, beside flicker.

    python bench/telegraphs.py [--count 40] [--seed 7]

Every second record holds the one or the other, in white noise and flicker of up to half its size;
lengths, time constants and sizes are drawn. Nats for two levels: above zero of a telegraph, below
of a relaxation, about zero where the record cannot tell.

"""

from __future__ import annotations

import argparse
import pathlib
import sys

import numpy as np

TOP = pathlib.Path(__file__).parent.parent
sys.path[:0] = [str(TOP), str(TOP / 'test')]

import hidden  # noqa: E402
from imu_noise_tools.core.record import ImuRecord  # noqa: E402
from imu_noise_tools.loop.effect import model_of  # noqa: E402
from imu_noise_tools.noise.gather import gather  # noqa: E402
from imu_noise_tools.noise.problem import NoiseProblem  # noqa: E402

DT, WHITE = 0.1, 3e-4   # s, standard deviation of a sample


def telegraph(n: int, tc: float, rng: np.random.Generator) -> np.ndarray:
    """Return a path (n,) of two levels, variance 1, that is forgotten in tc samples."""
    uneven = rng.uniform(0.5, 2)
    stays = tc * np.array([1 + uneven, 1 + 1 / uneven])
    ends = np.cumsum(rng.exponential(np.resize(stays, 4 * int(n / np.mean(stays)) + 20)))
    path = (np.searchsorted(ends, np.arange(n)) % 2).astype(float)
    return (path - np.mean(path)) / max(float(np.std(path)), 1e-9)


def said(seed: tuple[int, int], two: bool) -> tuple[float, str]:
    """Return what the samples of a record say for two levels, nats, and what it is in words."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(8000, 120_000))
    tc = float(np.exp(rng.uniform(np.log(20), np.log(n / 60))))
    size = WHITE * np.exp(rng.uniform(np.log(0.1), np.log(1.5))) * min(1, 9 / np.sqrt(tc))
    slow = size * telegraph(n, tc, rng) if two else hidden.decay(n, DT, size, tc * DT, rng)
    y = WHITE * rng.standard_normal((n, 3))
    y[:, 0] += slow + hidden.flicker(n, DT, 0.5 * size * rng.uniform(0, 1), rng)
    record = ImuRecord(y, None, np.arange(n) * DT, 1 / DT)
    problem = NoiseProblem(gather(record, ['gyro_x'])['gyro_x'])
    fit = problem.point(model_of('noise', ['white', 'flicker', 'random_walk', 'rts']))
    words = f'{n} samples, tc {tc * DT:.1f} s, {size / WHITE:.2f} of the white noise'
    return fit.model['rts'].bonus(problem.evidence, fit), words


def main() -> None:
    """Print what is said of each record, and how often it is wrong by more than three nats."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[1])
    parser.add_argument('--count', type=int, default=40)
    parser.add_argument('--seed', type=int, default=7)
    args = parser.parse_args()
    out = {True: [], False: []}
    for k in range(args.count):
        two = bool(k % 2)
        nats, words = said((args.seed, k), two)
        out[two].append(nats)
        print(f"{'telegraph ' if two else 'relaxation'} {nats:8.1f}   {words}", flush=True)
    for two, nats in out.items():
        wrong, right = (np.sum(np.array(nats) * (1 if two else -1) * side > 3) for side in (-1, 1))
        print(f"{'telegraphs' if two else 'relaxations'}: {right} of {len(nats)} told,"
              f' {wrong} taken for the other')


if __name__ == '__main__':
    main()
