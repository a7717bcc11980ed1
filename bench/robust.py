# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How well N, B and K come out of records that hold what the model does not know.

    python bench/robust.py [--records 10] [--hours 1] [--rate 50] [--seed 1] [--only NAME]

Each record has three independent axes with the same disturbance in other draws. The generator is
here, in the time domain (recursions and filters), and shares nothing with the package. Errors are
beside those of the full true model, fitted here by maximum likelihood to the same samples: the
form of what disturbs them is known, its values (cutoff; place, width, height) are open and start
at the truth. Where that has no spectrum (lines, knocks, what is switched on) the base model on the
noise without it stands for it, which no method that has to find the disturbance can beat. The
truth of N is the level at 1 s: the white noise and the slow side of what disturbs it, where it has
one.
"""

from __future__ import annotations

import argparse
from pathlib import Path
import sys
import time
from typing import Callable, NamedTuple

import numpy as np
from scipy.fft import dct
from scipy.signal import butter, freqz, iirpeak, lfilter

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


# --- what disturbs it: (samples with it, N at 1 s, its form) -------------------------------------

class Form(NamedTuple):
    """
    The form of a disturbance: v = (white (1 + added) + slow) gain2, of (omega, values (open,)).

    ``filters_slow``: whether the drift goes through it too. Values are zero at the truth.

    """

    open: int = 0
    gain2: Callable = lambda omega, x: 1.0
    added: Callable = lambda omega, x: 0.0
    filters_slow: bool = True


def squared(b, a, omega):
    """Return |H|^2 of a filter."""
    return np.abs(freqz(b, a, worN=omega)[1]) ** 2


def first_order(y, dt, rng):
    """Roll-off of first order, cutoff 0.15 ... 0.8 of Nyquist."""
    c = rng.uniform(0.15, 0.8)

    def filtered(x=0.0):
        p = np.exp(-np.pi * c * np.exp(x))
        return [1 - p], [1, -p]
    return lfilter(*filtered(), y), TRUTH['N'], Form(1, lambda w, x: squared(*filtered(x[0]), w))


def second_order(y, dt, rng):
    """Butterworth of second order, cutoff 0.15 ... 0.8 of Nyquist."""
    c = rng.uniform(0.15, 0.8)
    t = np.tan(np.pi * c / 2)
    return lfilter(*butter(2, c), y), TRUTH['N'], Form(
        1, lambda w, x: 1 / (1 + (np.tan(w / 2) / (t * np.exp(x[0]))) ** 4))


def averaging(y, dt, rng):
    """Mean of 2 ... 6 samples."""
    k = int(rng.integers(2, 7))
    b = np.ones(k) / k
    return lfilter(b, [1.0], y), TRUTH['N'], Form(0, lambda w, x: squared(b, [1.0], w))


def folded(y, dt, rng):
    """Mean over 1.25 ... 3 output intervals at four times the rate, then one sample in four."""
    n, k = len(y), int(rng.integers(5, 13))
    fast = TRUTH['N'] / np.sqrt(dt / 4) * rng.standard_normal(4 * n)
    base = slow_noise(n, dt, rng)
    b = np.ones(k) / k

    def gain2(w):
        return sum(squared(b, [1.0], np.atleast_1d((w + 2 * np.pi * j) / 4)) for j in range(4))
    level = float(gain2(np.zeros(1))[0])     # at zero, with what folds onto it
    return base + lfilter(b, [1.0], fast)[::4], TRUTH['N'] * np.sqrt(level), Form(
        0, lambda w, x: gain2(w), filters_slow=False)


def three_lines(y, dt, rng):
    """Lines at 0.02 ... 0.9 of Nyquist, 0.2 ... 3 standard deviations of a sample high."""
    t = np.arange(len(y)) * dt
    for _ in range(3):
        f = 0.5 / dt * np.exp(rng.uniform(np.log(0.02), np.log(0.9)))
        size = np.std(np.diff(y)) * np.exp(rng.uniform(np.log(0.2), np.log(3)))
        y = y + size * np.sin(2 * np.pi * f * t + rng.uniform(0, 6))
    return y, TRUTH['N'], None


def resonance(y, dt, rng):
    """Add a band of Q 5 ... 50 at 0.1 ... 0.8 of Nyquist, its top 3 ... 300x the white."""
    f, q = rng.uniform(0.1, 0.8), np.exp(rng.uniform(np.log(5), np.log(50)))
    high = np.exp(0.5 * rng.uniform(np.log(3), np.log(300)))
    return y + high * lfilter(*iirpeak(f, q), white(len(y), dt, rng)), TRUTH['N'], Form(
        3, added=lambda w, x: high**2 * np.exp(x[2]) * squared(
            *iirpeak(min(f * np.exp(x[0]), 0.99), q * np.exp(x[1])), w))


def resonance_slow_side(y, dt, rng):
    """Return the same with two poles and no zeros: its slow side is white and belongs to N."""
    f, q = rng.uniform(0.1, 0.6), np.exp(rng.uniform(np.log(5), np.log(50)))

    def poles(x=(0, 0)):
        r = np.exp(-np.pi * f * np.exp(x[0] - x[1]) / (2 * q))
        return [1, -2 * r * np.cos(np.pi * f * np.exp(x[0])), r * r]
    top = 1 / abs(np.polyval(poles()[::-1], np.exp(-1j * np.pi * f)))
    high = np.exp(0.5 * rng.uniform(np.log(3), np.log(300))) / top
    return y + high * lfilter([1.0], poles(), white(len(y), dt, rng)), \
        TRUTH['N'] * np.sqrt(1 + (high / sum(poles())) ** 2), \
        Form(3, added=lambda w, x: high**2 * np.exp(x[2]) * squared([1.0], poles(x), w))


def hump(y, dt, rng):
    """Add a band one to three octaves wide at 0.02 ... 0.4 of Nyquist, 2 ... 30x the white."""
    middle = np.exp(rng.uniform(np.log(0.02), np.log(0.4)))
    half = 2 ** (0.5 * rng.uniform(1, 3))
    edges = np.array([middle / half, min(middle * half, 0.95)])
    high = np.sqrt(np.exp(rng.uniform(np.log(2), np.log(30))))

    def added(w, x):
        low, up = np.tan(0.5 * np.pi * np.minimum(edges * np.exp(x[:2]), 0.999))
        t = np.tan(w / 2)
        return high**2 * np.exp(x[2]) / (1 + ((t * t - low * up) / ((up - low) * t)) ** 4)
    return y + high * lfilter(*butter(2, edges, 'band'), white(len(y), dt, rng)), TRUTH['N'], \
        Form(3, added=added)


def knocks(y, dt, rng):
    """Four to twelve decaying swings of 20 ... 200 standard deviations."""
    t, sigma, y = np.arange(len(y)) * dt, np.std(np.diff(y)), y.copy()
    for _ in range(rng.integers(4, 13)):
        i = rng.integers(0, len(y) - 100)
        k = min(len(y) - i, int(3 / dt))
        f, tau = rng.uniform(0.05, 0.8) * 0.5 / dt, rng.uniform(0.05, 0.4)
        size = sigma * np.exp(rng.uniform(np.log(20), np.log(200)))
        y[i:i + k] += size * np.exp(-t[:k] / tau) * np.sin(2 * np.pi * f * t[:k] + 1)
    return y, TRUTH['N'], None


def on_and_off(y, dt, rng):
    """Add a machine that runs for 5 ... 30 % of the time: a band 3 ... 30x the white."""
    n = len(y)
    length = int(rng.uniform(0.05, 0.3) * n)
    i = int(rng.integers(0, n - length))
    b, a = butter(2, np.sort(rng.uniform(0.1, 0.9, 2)) + [0, 0.05], 'band')
    high = np.sqrt(np.exp(rng.uniform(np.log(3), np.log(30))))
    more = np.zeros(n)
    more[i:i + length] = high * lfilter(b, a, white(length, dt, rng))
    return y + more, TRUTH['N'], None


def several(y, dt, rng):
    """Return a roll-off, a hump, a resonance and a line at once."""
    forms = []
    for one in (hump, resonance, three_lines, second_order):
        y, _, form = one(y, dt, rng)
        forms.append(form)
    first, second, _, last = forms
    return y, TRUTH['N'], Form(
        7, lambda w, x: last.gain2(w, x[6:]),
        lambda w, x: first.added(w, x[:3]) + second.added(w, x[3:6]))


def nothing(y, dt, rng):
    """No disturbance."""
    return y, TRUTH['N'], None


CASES = (nothing, first_order, second_order, averaging, folded, three_lines, resonance,
         resonance_slow_side, hump, knocks, on_and_off, several)


# --- the full true model -------------------------------------------------------------------------

def true_fit(y, dt, form):
    """Return (N, B, K) over the truth of the most likely values of the true model, (3,)."""
    n = len(y)
    power = 2 * dt * dct(y - np.mean(y), norm='ortho')[1:] ** 2
    edges = np.unique(np.round(np.concatenate([
        np.arange(0, 400), np.geomspace(400, n - 1, 1200), np.linspace(2000, n - 1, 1200)])))
    edges = edges.astype(int)
    count = np.diff(edges)
    power = np.add.reduceat(power, edges[:-1]) / count
    omega = np.pi * 0.5 * (edges[1:] + edges[:-1] + 1) / n
    s = 2 * np.sin(omega / 2)
    flicker = 2 * TRUTH['B'] ** 2 * dt / s
    flicker[:6] *= (.774, .903, .931, .950, .959, .966)     # what is expected at the slow end
    walk = 2 * TRUTH['K'] ** 2 * dt**2 / s**2
    gain2 = form.gain2(omega, np.zeros(form.open))
    keep = np.ones(len(s)) * gain2 > 1e-6       # beyond, what leaks is more

    def spectrum(x):
        gain2 = form.gain2(omega, x[3:])
        slow = np.exp(2 * x[1]) * flicker + np.exp(2 * x[2]) * walk
        fast = 2 * TRUTH['N'] ** 2 * (np.exp(2 * x[0]) + form.added(omega, x[3:]))
        return gain2 * fast + slow * (gain2 if form.filters_slow else 1.0)

    def cost(x):
        v = spectrum(x)
        value = 0.5 * np.sum((count * (np.log(v) + power / v))[keep]) - x[2]
        return value if np.isfinite(value) else np.inf

    x, damping = np.zeros(3 + form.open), 1e-3
    keep &= power < (1 + 8 / np.sqrt(0.5 * count)) * spectrum(x)       # lines are known
    best = cost(x)
    for _ in range(60):
        v = spectrum(x)
        jac = np.array([(spectrum(x + e) - spectrum(x - e)) / (2e-4 * v)
                        for e in 1e-4 * np.eye(len(x))])[:, keep] * np.sqrt(0.5 * count[keep])
        gradient = jac @ (np.sqrt(0.5 * count) * (1 - power / v))[keep]
        gradient[2] -= 1        # as the package: what is slowest is kept off zero
        information, gain = jac @ jac.T, 0.0
        while damping < 1e8:
            step = np.linalg.solve(information + np.diag(
                damping * np.diag(information) + 1e-9), gradient)
            trial = np.clip(x - np.clip(step, -1, 1), -3.0, 3.0)
            value = cost(trial)
            if value <= best:
                gain, best, x = best - value, value, trial
                break
            damping *= 10
        damping = max(damping / 10, 1e-9)
        if gain < 1e-6:
            break
    now, was = (np.exp(2 * at[0]) + form.added(np.array([1e-6]), at[3:]) for at in (x, 0 * x))
    return np.append(np.sqrt(now / was), np.exp(x[1:3]))      # N is the level at zero


# --- the figures ---------------------------------------------------------------------------------

def run(case, records, n, dt, seed):
    """Return rows of (truth, fit, plain, fit without it, true model (3,)) and seconds a fit."""
    model, rows, spent = model_of('noise', LABEL.values()), [], 0.0
    for i in range(records):
        rng = np.random.default_rng([seed, CASES.index(case), i])
        clean = [white(n, dt, rng) + slow_noise(n, dt, rng) for _ in AXES]
        dirty = [case(y, dt, rng) for y in clean]
        both = [gather(prepare(ImuRecord(np.column_stack(y), None, np.arange(n) * dt, 1 / dt),
                               keep_motion=True), AXES)
                for y in ([y for y, _, _ in dirty], clean)]
        for axis, (y, level, form) in zip(AXES, dirty):
            begin = time.process_time()
            found = fit(both[0][axis], model)
            spent += time.process_time() - begin
            plain = fit(both[0][axis], model, robust=False)
            best = found if case is nothing else fit(both[1][axis], model)
            ideal = np.array([best.estimates[v][k].point / TRUTH[k] for k, v in LABEL.items()]) \
                if form is None else true_fit(y, dt, form)
            rows.append(({**TRUTH, 'N': level}, found, plain, best, ideal))
    return rows, spent / len(rows)


def table(case, rows, seconds):
    """Print one case."""
    for i, (k, label) in enumerate(LABEL.items()):
        def error(which, truth=None):
            point = [r[which].estimates[label][k].point / (truth or r[0][k]) for r in rows]
            return float(np.sqrt(np.mean((np.array(point) - 1) ** 2)))

        def covers(which, truth=None):
            some = [(r[which].estimates[label][k].ci95, truth or r[0][k]) for r in rows]
            return 100 * np.mean([low <= at <= high for (low, high), at in some])
        ideal = float(np.sqrt(np.mean([(r[4][i] - 1) ** 2 for r in rows])))
        some = [r[1].estimates[label][k] for r in rows]
        null = np.mean([e.value is None for e in some])
        bias = np.mean([e.point / r[0][k] for e, r in zip(some, rows)])
        print(f'| {case.__name__ if k == "N" else ""} | {k} | {100 * error(2):.3g} | '
              f'{100 * error(1):.3g} | {100 * ideal:.3g} | {error(1) / ideal:.2f} | '
              f'{100 * error(3, TRUTH[k]):.3g} | {bias:.3f} | {covers(1):.0f} | '
              f'{covers(3, TRUTH[k]):.0f} | {100 * null:.0f} |'
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
    print('| case | | plain fit | fit | true model | ratio | without it | mean of value/truth | '
          'ci95 covers % | without it % | null % | CPU a fit |\n' + 12 * '|---' + '|')
    for case in CASES:
        if args.only in (None, case.__name__):
            rows, seconds = run(case, args.records, n, dt, args.seed)
            table(case, rows, seconds)
            for truth, found, *_ in rows if args.each else ():
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
