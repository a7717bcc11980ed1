# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How well N can be known at all beside a disturbance: the Fisher information of each case.

    python bench/robust_limits.py [--draws 60] [--hours 1] [--rate 50] [--seed 1]

Cases are those of ``bench/robust.py``, their values drawn as there. All numbers are standard
deviations of ln N over that of the base model on the undisturbed record (rms over the draws):

- true: the form of the disturbance is known, its values (cutoff; place, width, height) are not;
- rational: only that what multiplies the spectrum is P(u)/Q(u) of the true degrees;
- tied: the same, known to be 1 at zero and at Nyquist;
- holes: told by an oracle where the disturbance is more than 0.3, 3 or 30 % of the rest, and that
  the level is the same on both sides.

Nothing that has to find the form can do better than ``true``, and a fit that does not know it no
better than the smallest of the others. Computed from closed forms with numpy and scipy alone.
"""

from __future__ import annotations

import argparse

import numpy as np
from scipy.signal import butter, freqz, iirpeak

N, B, K = 8.7e-5, 2.4e-5, 2.5e-6
HOLES = (0.003, 0.03, 0.3)


class Grid:
    """Frequencies of a record's cosine coefficients, grouped, and the base model on them."""

    def __init__(self, n: int, dt: float):
        """Group the coefficients."""
        edges = np.concatenate([np.arange(1, 400), np.geomspace(400, n, 1500),
                                np.linspace(2000, n, 1500)])
        edges = np.unique(np.round(edges).astype(int))
        self.weight = np.diff(edges).astype(float)
        self.omega = np.pi * 0.5 * (edges[1:] + edges[:-1] - 1) / n
        self.u = np.sin(self.omega / 2) ** 2
        s = 2 * np.sin(self.omega / 2)
        self.base = np.array([np.full(len(s), 2 * N**2), 2 * B**2 * dt / s,
                              2 * K**2 * dt**2 / s**2])

    def gain2(self, b, a):
        """Return |H|^2 of a filter."""
        return np.abs(freqz(b, a, worN=self.omega)[1]) ** 2

    def std(self, slopes, kept=1.0, of=None):
        """Return the standard deviation of the first parameter, or of a combination of all."""
        information = 0.5 * (slopes * (self.weight * kept)[:, None]).T @ slopes
        scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
        covariance = np.linalg.pinv(information / np.outer(scale, scale), rcond=1e-13)
        of = np.eye(len(scale))[0] if of is None else of
        return float(np.sqrt((of / scale) @ covariance @ (of / scale)))

    def slopes(self, white=1.0):
        """Return d ln v/d ln (N, B, K) where the white noise is multiplied."""
        parts = np.array([self.base[0] * white, *self.base[1:]])
        return (2 * parts / parts.sum(axis=0)).T

    def rational(self, zeros, poles, p, q, tied=False):
        """Return d ln gain^2/d (p_1 ..., q_1 ...) of P/Q."""
        x = 2 * self.u - 1
        terms = [np.polynomial.chebyshev.chebval(x, np.eye(j + 1)[j]) - (-1) ** j
                 for j in range(1, max(zeros, poles) + 1)]
        top, bottom = [t / p for t in terms[:zeros]], [-t / q for t in terms[:poles]]
        if tied:
            bottom = [b + (top[0] if j % 2 == 0 else 0) for j, b in enumerate(bottom)]
            top = [a - (top[0] if j % 2 == 0 else 0) for j, a in enumerate(top)][1:]
        return np.array([*top, *bottom]).T


def numeric(function, at):
    """Return d ln function/d x at a point, (b, p)."""
    h = 1e-4
    return np.array([(np.log(function(at + h * e)) - np.log(function(at - h * e))) / (2 * h)
                     for e in np.eye(len(at))]).T


# --- what multiplies everything ------------------------------------------------------------------

def behind(grid, gain2, at, p, q, degrees):
    """Return (true, rational) behind a filter of gain2(x)."""
    base = grid.slopes()
    true = grid.std(np.column_stack([base, numeric(gain2, at)])) if len(at) else grid.std(base)
    open_one = grid.rational(*degrees, np.maximum(p, 1e-3), q)
    return [true, grid.std(np.column_stack([base, open_one])), np.nan, np.nan, np.nan, np.nan]


def first_order(grid, rng):
    """Roll-off of first order: the cutoff is open."""
    c = rng.uniform(0.15, 0.8)

    def gain2(x):
        p = np.exp(-np.pi * c * np.exp(x[0]))
        return (1 - p) ** 2 / ((1 - p) ** 2 + 4 * p * grid.u)
    return behind(grid, gain2, np.zeros(1), np.ones(len(grid.u)), 1 / gain2(np.zeros(1)), (0, 1))


def second_order(grid, rng):
    """Butterworth of second order: the cutoff is open."""
    t = np.tan(np.pi * rng.uniform(0.15, 0.8) / 2)

    def gain2(x):
        return 1 / (1 + (grid.u / (1 - grid.u) / (t * np.exp(x[0])) ** 2) ** 2)
    p = (1 - grid.u) ** 2
    return behind(grid, gain2, np.zeros(1), p, p + grid.u**2 / t**4, (2, 2))


def averaging(grid, rng):
    """Mean of 2 ... 6 samples: nothing is open."""
    k = int(rng.integers(2, 7))
    p = grid.gain2(np.ones(k) / k, [1.0])
    return behind(grid, None, np.zeros(0), p, np.ones(len(p)), (k - 1, 0))


# --- what is added -------------------------------------------------------------------------------

def beside(grid, more, poles, degree, tied=True):
    """Return all limits beside white noise times more(x) >= 0, x its open values."""
    at = np.zeros(3)
    a = more(at)
    v = (grid.base[0] * (1 + a) + grid.base[1] + grid.base[2])
    own = np.array([2 * grid.base[0] / v, 2 * grid.base[1] / v, 2 * grid.base[2] / v]).T
    h = 1e-4
    change = [(more(h * e) - more(-h * e)) / (2 * h) for e in np.eye(3)]
    slopes = np.column_stack([own, *(grid.base[0] * c / v for c in change)])
    level = np.zeros(6)     # N is the level at zero: white noise and what is added there
    level[0] = 1 / (1 + a[0])
    level[3:] = [0.5 * c[0] / (1 + a[0]) for c in change]
    out = [grid.std(slopes, of=level)]
    q = 1 / grid.gain2([1.0], poles)
    q = q / q[0]
    whole = grid.slopes(white=1 + a)
    for some in (False, True):
        fits = not some or tied
        out.append(grid.std(np.column_stack(
            [whole, grid.rational(degree, degree, (1 + a) * q / (1 + a[0]), q, some)]))
            if fits else np.nan)
    base = grid.slopes()
    out += [grid.std(base, (np.abs(a - a[0]) < hole).astype(float)) for hole in HOLES]
    return out


def resonance(grid, rng):
    """Return the limits beside a band of Q 5 ... 50, with zeros at zero and Nyquist."""
    f, q, h = rng.uniform(0.1, 0.8), *np.exp(rng.uniform(np.log([5, 3]), np.log([50, 300])))
    return beside(grid, lambda x: h * np.exp(x[2]) * grid.gain2(
        *iirpeak(f * np.exp(x[0]), q * np.exp(x[1]))), iirpeak(f, q)[1], 2)


def resonance_slow_side(grid, rng):
    """Return the same with two poles and no zeros."""
    f, q, h = rng.uniform(0.1, 0.6), *np.exp(rng.uniform(np.log([5, 3]), np.log([50, 300])))

    def poles(x):
        r = np.exp(-np.pi * f * np.exp(x[0] - x[1]) / (2 * q))
        return np.array([1, -2 * r * np.cos(np.pi * f * np.exp(x[0])), r * r])

    def more(x):
        top = np.abs(np.polyval(poles(x)[::-1], np.exp(-1j * np.pi * f * np.exp(x[0])))) ** 2
        return h * np.exp(x[2]) * top * grid.gain2([1.0], poles(x))
    return beside(grid, more, poles(np.zeros(3)), 2, tied=False)


def hump(grid, rng):
    """Return the limits beside a band one to three octaves wide."""
    middle, half = np.exp(rng.uniform(np.log(0.02), np.log(0.4))), 2 ** (0.5 * rng.uniform(1, 3))
    high = np.exp(rng.uniform(np.log(2), np.log(30)))
    return band(grid, middle / half, min(middle * half, 0.95), high)


def on_and_off(grid, rng):
    """Return the limits beside the mean power of a machine that runs for 5 ... 30 %."""
    share = rng.uniform(0.05, 0.3)
    low, high = np.sort(rng.uniform(0.1, 0.9, 2)) + [0, 0.05]
    return band(grid, low, high, share * np.exp(rng.uniform(np.log(3), np.log(30))))


def band(grid, low, high, size):
    """Return the limits beside a band of second order."""
    def more(x):
        edges = (low * np.exp(x[0]), min(high * np.exp(x[1]), 0.99))
        return size * np.exp(x[2]) * grid.gain2(*butter(2, edges, 'band'))
    return beside(grid, more, butter(2, (low, high), 'band')[1], 4)


CASES = (first_order, second_order, averaging, resonance, resonance_slow_side, hump, on_and_off)


def main():
    """Run."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--draws', type=int, default=60)
    parser.add_argument('--hours', type=float, default=1.0)
    parser.add_argument('--rate', type=float, default=50.0)
    parser.add_argument('--seed', type=int, default=1)
    args = parser.parse_args()
    grid = Grid(int(args.hours * 3600 * args.rate), 1 / args.rate)
    alone = grid.std(grid.slopes())
    print(f'undisturbed: {100 * alone:.3g} %\n\n| case | true | rational | tied | holes 0.3 % | '
          '3 % | 30 % |\n|---|---|---|---|---|---|---|')
    for case in CASES:
        rng = np.random.default_rng([args.seed, CASES.index(case)])
        rows = np.array([case(grid, rng) for _ in range(args.draws)]) / alone
        print(f'| {case.__name__} | ' + ' | '.join(
            '-' if np.isnan(x) else f'{x:.2f}' for x in np.sqrt(np.mean(rows**2, axis=0))) + ' |')


if __name__ == '__main__':
    main()
