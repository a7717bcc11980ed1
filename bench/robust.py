# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How well N, B and K come out of records that hold what the model does not know.

    python bench/robust.py [--records 10] [--hours 1] [--rate 50] [--seed 1] [--only NAME]

Each record has three independent axes with the same disturbance in other draws. The generator is
here, in the time domain (recursions and filters), and shares nothing with the package. Errors are
beside those of the base model fitted to the same noise without the disturbance, which no method
that has to find the disturbance can beat. The truth of N is the level at 1 s: the white noise and
the slow side of what disturbs it, where it has one.
"""

from __future__ import annotations

import argparse
from pathlib import Path
import sys
import time

import numpy as np
from scipy.signal import butter, iirpeak, lfilter

TOP = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TOP)]

from imu_noise_tools.core.record import ImuRecord  # noqa: E402
from imu_noise_tools.health import prepare  # noqa: E402
from imu_noise_tools.loop.effect import model_of  # noqa: E402
from imu_noise_tools.noise.fit import fit  # noqa: E402
from imu_noise_tools.noise.gather import gather  # noqa: E402

AXES = ('gyro_x', 'gyro_y', 'gyro_z')
TRUTH = {'N': 8.7e-5, 'B': 2.4e-5, 'K': 2.5e-6}
LABEL = {'N': 'white', 'B': 'flicker', 'K': 'random_walk'}


# --- the noise -----------------------------------------------------------------------------------

def slow_noise(n, dt, rng):
    """Return flicker noise (a ladder of recursions) and a random walk."""
    out = TRUTH['K'] * np.sqrt(dt) * np.cumsum(rng.standard_normal(n))
    ratio = 2.5
    tc = 0.3 * dt
    while tc < 100 * n * dt:
        p = np.exp(-dt / tc)
        s = TRUTH['B'] * np.sqrt(np.log(ratio) / np.pi)
        w = s * np.sqrt(1 - p * p) * rng.standard_normal(n)
        w[0] = s * rng.standard_normal()
        out += lfilter([1.0], [1.0, -p], w)
        tc *= ratio
    return out


def white(n, dt, rng):
    """Return white noise."""
    return TRUTH['N'] / np.sqrt(dt) * rng.standard_normal(n)


# --- what disturbs it: (samples with it, N at 1 s) -----------------------------------------------

def first_order(y, dt, rng):
    """Roll-off of first order, cutoff 0.15 ... 0.8 of Nyquist."""
    p = np.exp(-np.pi * rng.uniform(0.15, 0.8))
    return lfilter([1 - p], [1, -p], y), TRUTH['N']


def second_order(y, dt, rng):
    """Butterworth of second order, cutoff 0.15 ... 0.8 of Nyquist."""
    return lfilter(*butter(2, rng.uniform(0.15, 0.8)), y), TRUTH['N']


def averaging(y, dt, rng):
    """Mean of 2 ... 6 samples."""
    k = int(rng.integers(2, 7))
    return lfilter(np.ones(k) / k, [1.0], y), TRUTH['N']


def folded(y, dt, rng):
    """Mean over 1.25 ... 3 output intervals at four times the rate, then one sample in four."""
    n, k = len(y), int(rng.integers(5, 13))
    fast = TRUTH['N'] / np.sqrt(dt / 4) * rng.standard_normal(4 * n)
    base = slow_noise(n, dt, rng)
    gain = np.abs(np.exp(-0.5j * np.pi * np.outer(range(4), range(k))).sum(axis=1) / k)
    level = TRUTH['N'] * np.sqrt(np.sum(gain ** 2))     # at zero, with what folds onto it
    return base + lfilter(np.ones(k) / k, [1.0], fast)[::4], level


def three_lines(y, dt, rng):
    """Lines at 0.02 ... 0.9 of Nyquist, 0.2 ... 3 standard deviations of a sample high."""
    t = np.arange(len(y)) * dt
    for _ in range(3):
        f = 0.5 / dt * np.exp(rng.uniform(np.log(0.02), np.log(0.9)))
        size = np.std(np.diff(y)) * np.exp(rng.uniform(np.log(0.2), np.log(3)))
        y = y + size * np.sin(2 * np.pi * f * t + rng.uniform(0, 6))
    return y, TRUTH['N']


def resonance(y, dt, rng):
    """Add a band of Q 5 ... 50 at 0.1 ... 0.8 of Nyquist, its top 3 ... 300x the white."""
    b, a = iirpeak(rng.uniform(0.1, 0.8), np.exp(rng.uniform(np.log(5), np.log(50))))
    high = np.exp(0.5 * rng.uniform(np.log(3), np.log(300)))
    return y + high * lfilter(b, a, white(len(y), dt, rng)), TRUTH['N']


def resonance_slow_side(y, dt, rng):
    """Return the same with two poles and no zeros: its slow side is white and belongs to N."""
    f, q = rng.uniform(0.1, 0.6), np.exp(rng.uniform(np.log(5), np.log(50)))
    r = np.exp(-np.pi * f / (2 * q))
    a = [1, -2 * r * np.cos(np.pi * f), r * r]
    top = 1 / abs(np.polyval(a[::-1], np.exp(-1j * np.pi * f)))
    high = np.exp(0.5 * rng.uniform(np.log(3), np.log(300))) / top
    return y + high * lfilter([1.0], a, white(len(y), dt, rng)), \
        TRUTH['N'] * np.sqrt(1 + (high / sum(a)) ** 2)


def hump(y, dt, rng):
    """Add a band one to three octaves wide at 0.02 ... 0.4 of Nyquist, 2 ... 30x the white."""
    middle = np.exp(rng.uniform(np.log(0.02), np.log(0.4)))
    half = 2 ** (0.5 * rng.uniform(1, 3))
    b, a = butter(2, (middle / half, min(middle * half, 0.95)), 'band')
    high = np.sqrt(np.exp(rng.uniform(np.log(2), np.log(30))))
    return y + high * lfilter(b, a, white(len(y), dt, rng)), TRUTH['N']


def knocks(y, dt, rng):
    """Four to twelve decaying swings of 20 ... 200 standard deviations."""
    t, sigma, y = np.arange(len(y)) * dt, np.std(np.diff(y)), y.copy()
    for _ in range(rng.integers(4, 13)):
        i = rng.integers(0, len(y) - 100)
        k = min(len(y) - i, int(3 / dt))
        f, tau = rng.uniform(0.05, 0.8) * 0.5 / dt, rng.uniform(0.05, 0.4)
        size = sigma * np.exp(rng.uniform(np.log(20), np.log(200)))
        y[i:i + k] += size * np.exp(-t[:k] / tau) * np.sin(2 * np.pi * f * t[:k] + 1)
    return y, TRUTH['N']


def on_and_off(y, dt, rng):
    """Add a machine that runs for 5 ... 30 % of the time: a band 3 ... 30x the white."""
    n = len(y)
    length = int(rng.uniform(0.05, 0.3) * n)
    i = int(rng.integers(0, n - length))
    b, a = butter(2, np.sort(rng.uniform(0.1, 0.9, 2)) + [0, 0.05], 'band')
    high = np.sqrt(np.exp(rng.uniform(np.log(3), np.log(30))))
    more = np.zeros(n)
    more[i:i + length] = high * lfilter(b, a, white(length, dt, rng))
    return y + more, TRUTH['N']


def several(y, dt, rng):
    """Return a roll-off, a hump, a resonance and a line at once."""
    for one in (hump, resonance, three_lines, second_order):
        y, _ = one(y, dt, rng)
    return y, TRUTH['N']


def nothing(y, dt, rng):
    """No disturbance."""
    return y, TRUTH['N']


CASES = (nothing, first_order, second_order, averaging, folded, three_lines, resonance,
         resonance_slow_side, hump, knocks, on_and_off, several)


# --- the figures ---------------------------------------------------------------------------------

def run(case, records, n, dt, seed):
    """Return rows of (truth, fit, plain fit, fit without the disturbance) and seconds a fit."""
    model, rows, spent = model_of('noise', LABEL.values()), [], 0.0
    for i in range(records):
        rng = np.random.default_rng([seed, CASES.index(case), i])
        clean = [white(n, dt, rng) + slow_noise(n, dt, rng) for _ in AXES]
        dirty = [case(y, dt, rng) for y in clean]
        both = [gather(prepare(ImuRecord(np.column_stack(y), None, np.arange(n) * dt, 1 / dt),
                               keep_motion=True), AXES)
                for y in ([y for y, _ in dirty], clean)]
        for axis, (_, level) in zip(AXES, dirty):
            begin = time.process_time()
            found = fit(both[0][axis], model)
            spent += time.process_time() - begin
            plain = fit(both[0][axis], model, robust=False)
            best = found if case is nothing else fit(both[1][axis], model)
            rows.append(({**TRUTH, 'N': level}, found, plain, best))
    return rows, spent / len(rows)


def table(case, rows, seconds):
    """Print one case."""
    for k, label in LABEL.items():
        def error(which, truth=None):
            point = [r[which].estimates[label][k].point / (truth or r[0][k]) for r in rows]
            return float(np.sqrt(np.mean((np.array(point) - 1) ** 2)))
        some = [r[1].estimates[label][k] for r in rows]
        covers = np.mean([e.ci95[0] <= r[0][k] <= e.ci95[1] for e, r in zip(some, rows)])
        null = np.mean([e.value is None for e in some])
        bias = np.mean([e.point / r[0][k] for e, r in zip(some, rows)])
        best = error(3, TRUTH[k])
        print(f'| {case.__name__ if k == "N" else ""} | {k} | {100 * error(2):.3g} | '
              f'{100 * error(1):.3g} | {100 * best:.3g} | {error(1) / best:.2f} | {bias:.3f} | '
              f'{100 * covers:.0f} | {100 * null:.0f} |'
              + (f' {seconds:.2f} s |' if k == 'N' else ' |'), flush=True)


def main():
    """Run."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--records', type=int, default=10, help='of three axes, for each case')
    parser.add_argument('--hours', type=float, default=1.0)
    parser.add_argument('--rate', type=float, default=50.0)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--only', help='one case')
    parser.add_argument('--each', action='store_true', help='print every axis')
    args = parser.parse_args()
    n, dt = int(args.hours * 3600 * args.rate), 1 / args.rate
    print(f'{3 * args.records} axes a case, {args.hours:g} h at {args.rate:g} Hz, seed '
          f'{args.seed}; errors are relative rms of the most likely value, %\n')
    print('| case | | plain fit | fit | without it | ratio | mean of value/truth | ci95 covers % '
          '| null % | CPU a fit |\n|---|---|---|---|---|---|---|---|---|---|')
    for case in CASES:
        if args.only in (None, case.__name__):
            rows, seconds = run(case, args.records, n, dt, args.seed)
            table(case, rows, seconds)
            for truth, found, _, _ in rows if args.each else ():
                said = ', '.join(
                    f'{k} {found.estimates[v][k].point / truth[k]:.3f} '
                    f'[{found.estimates[v][k].ci95[0] / truth[k]:.3f} '
                    f'{found.estimates[v][k].ci95[1] / truth[k]:.3f}]' for k, v in LABEL.items())
                basis = found.details.basis
                print(f'    {said}; order {tuple(basis.order) if basis else 0}', '; '.join(
                    f'{s.low:.3g}-{s.high:.3g} Hz x {s.ratio:.2g}'
                    for s in found.details.set_aside))


if __name__ == '__main__':
    main()
