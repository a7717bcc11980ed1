# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How much of what axes tell of a source that they share is kept by the shares that are found.

    python bench/shares.py [--count 16] [--seed 1000]

An axis is weighed by its share in each frequency (Wiener) and put beside another axis. Of weights
w the pull is known to sum(s w)^2 / sum(w^2), with what was simulated for s, beside its greatest;
strong: the source is worth 80 to 1000 nats in one axis; faint: 30 to 160.

"""

from __future__ import annotations

import argparse

import numpy as np

from imu_noise_tools.noise.shared import heard_together

FORMS = ('white', 'relaxation', 'resonance', 'relaxation and band', 'white, delayed')
STRENGTHS = {'strong': ((1 << 16, 1 << 18, 400_000), (80, 1000)),
             'faint': ((5000, 20_000, 60_000), (30, 160))}


def source(form: str, f: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return the shape of a source's spectrum at f (k,), in cycles a sample."""
    corner = 10 ** rng.uniform(-3, -1)
    if form == 'resonance':
        return 1 / ((1 - (f / corner) ** 2) ** 2 + (f / corner / rng.uniform(3, 30)) ** 2)
    if form.startswith('relaxation'):
        band = 0.3 * np.exp(-0.5 * ((f - 0.3) / 0.01) ** 2) if form != 'relaxation' else 0.0
        return 1 / (1 + (f / corner) ** 2) + band
    return np.ones(len(f))


def kept(form: str, strength: str, rng: np.random.Generator) -> float:
    """Return what part is kept of one record of three axes, 0 where nothing is heard."""
    lengths, nats = STRENGTHS[strength]
    n = int(rng.choice(lengths))
    f = np.fft.rfftfreq(n)
    f[0] = f[1]
    own = 1 + 10 ** rng.uniform(-4, -1.5, (3, 1)) / f \
        + 10 ** rng.uniform(-9, -5) * rng.uniform(0.5, 2, (3, 1)) / f**2
    gains = (rng.uniform(0.5, 2, 3) * rng.choice([-1, 1], 3))[:, None]
    phases = rng.uniform(0, 2, (3, 1)) * rng.integers(2)
    phases = phases + 2 * np.pi * f * rng.uniform(0, 4, (3, 1)) * (form == 'white, delayed')
    shape = source(form, f, rng)

    def heard(level):
        power = level * gains**2 * shape
        return power / (own + power)

    wanted = np.exp(rng.uniform(*np.log(nats)))
    low, high = 1e-8, 1e8
    while high / low > 1.01:
        level = np.sqrt(low * high)
        share = heard(level)
        low, high = (low, level) if 0.5 * np.sum(share[0] * share[1:]) > wanted else (level, high)

    def white(rows):
        return rng.standard_normal((rows, len(f))) + 1j * rng.standard_normal((rows, len(f)))

    x = white(3) * np.sqrt(own) + gains * np.exp(1j * phases) * white(1) * np.sqrt(level * shape)
    x[:, 0] = 0
    found = heard_together({f'gyro_{k}': np.fft.irfft(y, n) for k, y in zip('xyz', x)}, 1.0)
    if 'gyro_y' not in found:
        return 0.0
    at, w = found['gyro_y']
    w = np.interp(np.log(f), np.log(at), w)
    total = own + level * gains**2 * shape
    beside, square = share[1] * w * total[1] / total[0], w**2 * total[1] / total[0]
    return float(np.sum(beside) ** 2 / np.sum(square) / np.sum(
        share[1] ** 2 * total[1] / total[0]))


def main() -> None:
    """Print the mean and the least part that is kept, by form and strength."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[1])
    parser.add_argument('--count', type=int, default=16)
    parser.add_argument('--seed', type=int, default=1000)
    args = parser.parse_args()
    for strength in STRENGTHS:
        for form in FORMS:
            parts = [kept(form, strength, np.random.default_rng([args.seed, k]))
                     for k in range(args.count)]
            print(f'{strength:7} {form:20} {np.mean(parts):.2f}, least {np.min(parts):.2f}')


if __name__ == '__main__':
    main()
