# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Lines that begin or end within a record: how many are found so, and what is taken for one.

    python bench/passing.py [--count N] [--seed S]

Lines of some share of a record in white noise, so many standard deviations high while they are
there, half of them from or to an end of the record; then narrow bands and lines that fade, beat or
swing, of which none begins or ends.

"""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path
import sys

import numpy as np

TOP = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TOP), str(TOP / 'test')]

import hidden  # noqa: E402
from imu_noise_tools.core.spectrum import cosine_transform  # noqa: E402
from imu_noise_tools.noise.line_search import find_peaks  # noqa: E402
from imu_noise_tools.noise.passing import in_part  # noqa: E402
from imu_noise_tools.noise.smooth import reference_spectrum  # noqa: E402

DT, N = 0.01, 30_000
T = DT * np.arange(N)
SHARES = 0.1, 0.3, 0.5, 0.8, 0.95
HEIGHTS = 8, 12, 15, 20, 40, 200, 2000


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--count', type=int, default=20, help='records of each kind')
    parser.add_argument('--seed', type=int, default=1)
    args = parser.parse_args()
    rng = np.random.default_rng(args.seed)
    print('| share of the record | ' + ' | '.join(f'{z} sd' for z in HEIGHTS) + ' |')
    print('|---' * (len(HEIGHTS) + 1) + '|')
    for share in SHARES:
        cells = []
        for z in HEIGHTS:
            right = Counter(_of_a_stretch(rng, share, z) for _ in range(args.count))
            cells.append(', '.join(f'{n} {what}' for what, n in right.most_common()))
        print(f'| {share:g} | ' + ' | '.join(cells) + ' |', flush=True)
    print()
    print('| what it is | records | with a line that begins or ends |\n|---|---|---|')
    for name, make in OTHERS.items():
        some = [_passing(_table(make(rng, z)))
                for z in (8, 15, 40, 200) for _ in range(args.count)]
        print(f'| {name} | {len(some)} | {sum(map(bool, some))} |', flush=True)


def _table(y: np.ndarray) -> np.ndarray:
    c = cosine_transform(y)
    return find_peaks(c, reference_spectrum(c, DT), DT)[0]


def _passing(table: np.ndarray) -> int:
    """Return how many lines of a table are there for a part of the record."""
    return int(np.sum(in_part(table, N)))


def _of_a_stretch(rng, share: float, z: float) -> str:
    """Say what is made of a line that is there for a share of the record."""
    m, f, y = int(share * N), rng.uniform(2, 40), rng.standard_normal(N)
    begin = int(rng.choice([0, N - m, rng.integers(N - m)]))
    y[begin:begin + m] += z * np.sqrt(2 / m) * np.sin(
        2 * np.pi * f * DT * np.arange(m) + rng.uniform(0, 7))
    table = _table(y)
    passing = _passing(table)
    if len(table) == passing == 1 and abs(table[0, 0] - f) < 3 / (m * DT):
        return 'so'
    return 'steady' if len(table) == 1 and not passing else 'several' if len(table) else 'no line'


def _band(kind: str, cells: float):
    def make(rng, z):
        band = hidden.narrow_band(rng, N, DT, rng.uniform(2, 40), cells / (N * DT), kind)
        return rng.standard_normal(N) + z / np.sqrt(N) * band
    return make


def _band_of_a_stretch(cells: float):
    def make(rng, z):
        m = int(rng.uniform(0.1, 0.5) * N)
        begin = int(rng.choice([0, N - m, rng.integers(N - m)]))
        band = hidden.narrow_band(rng, N, DT, rng.uniform(2, 40), cells / (m * DT), 'resonance')
        band[:begin] = band[begin + m:] = 0
        return rng.standard_normal(N) + z / np.sqrt(m) * band
    return make


def _swelling(envelope):
    def make(rng, z):
        line = envelope(T / T[-1], rng) * np.sin(
            2 * np.pi * rng.uniform(2, 40) * T + rng.uniform(0, 7))
        return rng.standard_normal(N) + z / np.sqrt(N) * line / np.std(line)
    return make


OTHERS = {
    **{f'{kind}, {cells:g}/T wide': _band(kind, cells)
       for kind in ('resonance', 'wandering line') for cells in (0.1, 0.3, 1, 3, 10)},
    **{f'a resonance of a tenth to a half of a record, {cells:g}/its duration wide':
       _band_of_a_stretch(cells) for cells in (1, 3, 10, 30)},
    'a line that halves': _swelling(lambda u, rng: 1 - 0.5 * u),
    'a line that fades to 1/e': _swelling(lambda u, rng: np.exp(-u)),
    'a line that fades to 1/e^5': _swelling(lambda u, rng: np.exp(-5 * u)),
    'a line that swells and fades': _swelling(lambda u, rng: np.sin(np.pi * u) ** 2),
    'a line that swings by half, once': _swelling(
        lambda u, rng: 1 + 0.5 * np.cos(2 * np.pi * u + rng.uniform(0, 7))),
    'a beat, once': _swelling(lambda u, rng: np.cos(np.pi * u + rng.uniform(0, 7))),
    'a beat, three times': _swelling(lambda u, rng: np.cos(3 * np.pi * u + rng.uniform(0, 7))),
}


if __name__ == '__main__':
    main()
