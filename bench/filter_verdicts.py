# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Hidden effects in the filter's model: how often the innovations name the right one.

    python bench/filter_verdicts.py [RUNS] [SEED] [KIND ...]

The model is stated (constant_rate + ar_increment + white, the ADIS16350's values); the data hold
one effect more, at a strength of one or more, or none. Data come from recursions in the time
domain, not from the filter's own blocks. A share is met when its 95 % interval (Clopper, Pearson)
reaches it.

"""

from __future__ import annotations

import sys
import time

import numpy as np
from scipy.signal import lfilter
from scipy.stats import beta

from imu_noise_tools.core.units import DEG
from imu_noise_tools.filter.problem import FilterProblem, START
from imu_noise_tools.loop.effect import model_of
from imu_noise_tools.loop.study import Study

RATE, SECONDS = 100.0, 120.0
R, Q, PHI = 0.36, 4e-4, 0.107                     # (deg/s)^2
STATED = {'white': {'R': R * DEG ** 2}, 'ar_increment': {'phi': PHI, 'q': Q * DEG ** 2}}
# What may be named: in rocking an angular acceleration is there as well as a sway; a manoeuvre is
# one, limited in time.
RIGHT = {
    'harmonic': {'harmonic', 'angular_acceleration'},
    'singer': {'singer', 'angular_acceleration'},
}


def hidden(kind: str, rng, n: int) -> np.ndarray:
    """Return n samples, deg/s, of the stated model with one effect of a kind in it."""
    dt = 1 / RATE
    t = np.arange(n) * dt
    base = np.cumsum(lfilter([1], [1, -PHI], np.sqrt(Q) * rng.standard_normal(n)))
    white = np.sqrt(R) * rng.standard_normal(n)

    def pick(low, high):
        return np.exp(rng.uniform(np.log(low), np.log(high)))

    if kind == 'angular_acceleration':
        base += np.cumsum(np.cumsum(np.sqrt(pick(1, 1e3) * dt) * rng.standard_normal(n))) * dt
    elif kind == 'harmonic':
        base += pick(2, 60) * np.sin(2 * np.pi * pick(0.05, 2.0) * t + rng.uniform(0, 6.28))
    elif kind == 'rate_step':
        base += np.cumsum(
            pick(5, 50) * rng.standard_normal(n) * (rng.random(n) < pick(0.05, 0.3) * dt)
        )
    elif kind == 'singer':
        keep = np.exp(-dt / pick(0.1, 2.0))
        base += np.cumsum(lfilter([1], [1, -keep], pick(10, 100) * np.sqrt(1 - keep ** 2)
                                  * rng.standard_normal(n))) * dt
    elif kind == 'noise_level':
        white *= np.sqrt(pick(1.5, 4) if rng.random() < 0.5 else 1 / pick(1.5, 4))
    elif kind == 'gauss_markov':
        keep = np.exp(-dt / pick(0.03, 1.0))
        white += lfilter(
            [1], [1, -keep], pick(0.3, 1.5) * np.sqrt(1 - keep**2) * rng.standard_normal(n)
        )
    elif kind == 'sinusoid':
        white += pick(0.3, 3) * np.sin(2 * np.pi * pick(4, 45) * t + rng.uniform(0, 6.28))
    elif kind == 'outliers':
        white += (
            np.sqrt(R) * pick(5, 50) * rng.standard_normal(n) * (rng.random(n) < pick(0.002, 0.03))
        )
    return base + white


KINDS = (
    'none',
    'angular_acceleration',
    'harmonic',
    'rate_step',
    'singer',
    'noise_level',
    'gauss_markov',
    'sinusoid',
    'outliers',
)


def run(kind: str, seed: int) -> str:
    """Return the first verdict on one record: a name, or the verdict where nothing is named."""
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    problem = FilterProblem(hidden(kind, rng, int(RATE * SECONDS)) * DEG, 1 / RATE, stated=STATED)
    study = Study.begin({'gyro_x': problem}, model_of('filter', START))
    found = study.diagnose()['gyro_x']
    return found.ranked[0].name if found.verdict == 'missing' else found.verdict


def interval(hits: int, n: int) -> tuple[float, float]:
    """Return the 95 % interval of a share (Clopper, Pearson 1934)."""
    low = beta.ppf(0.025, hits, n - hits + 1) if hits else 0.0
    return float(low), float(beta.ppf(0.975, hits + 1, n - hits)) if hits < n else 1.0


def main(runs: int = 60, seed: int | None = None, *kinds: str) -> int:
    """Print the share of right first verdicts by kind; `none` is drawn 2.5 times as often."""
    seed = int(time.time()) if seed is None else seed
    print(f'{runs} records of {SECONDS:.0f} s at {RATE:.0f} Hz a kind, seed {seed}')
    missed = 0
    for kind in kinds or KINDS:
        begin, n = time.process_time(), runs if kind != 'none' else 5 * runs // 2
        said = [run(kind, seed + i) for i in range(n)]
        accepted = {'complete'} if kind == 'none' else RIGHT.get(kind, {kind})
        exact = sum(s == ('complete' if kind == 'none' else kind) for s in said)
        right = sum(s in accepted for s in said)
        low, high = interval(right, n)
        asked = 0.98 if kind == 'none' else 0.9
        missed += high < asked
        wrong = {s: said.count(s) for s in sorted(set(said)) if s not in accepted}
        print(
            f'{"ok  " if high >= asked else "MISS"} {kind:20s} {right}/{n} {right / n:6.1%}'
            f' [{low:.1%}, {high:.1%}], own name {exact}   else {wrong or "-"}'
            f'   {(time.process_time() - begin) / n:.1f} CPU s each',
            flush=True,
        )
    return int(missed > 0)


if __name__ == '__main__':
    raise SystemExit(main(*(int(a) for a in sys.argv[1:3]), *sys.argv[3:]))
