# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
N of white noise of which samples were lost at random, and how often its interval holds it.

    python bench/lost.py [--shares 0,0.02,0.1,0.3] [--records 6]

Ten minutes at 100 Hz a record, two axes of each, stamps as a driver writes them that loses some.

"""

import argparse
from pathlib import Path
import tempfile

import numpy as np

from imu_noise_tools import analyse

RATE, SAMPLES, N, AXES = 100.0, 60_000, 1e-4, ('gyro_x', 'gyro_y')


def main():
    """Print a line for each share."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--shares', default='0,0.005,0.01,0.02,0.05,0.1,0.3')
    parser.add_argument('--records', type=int, default=6)
    args = parser.parse_args()
    print('lost    N/true            held')
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'record.npz'
        for share in map(float, args.shares.split(',')):
            ratios, held = [], []
            for seed in range(args.records):
                rng = np.random.default_rng(seed)
                gyro = N * np.sqrt(RATE) * rng.standard_normal((SAMPLES, 3))
                accel = 1e-2 * rng.standard_normal((SAMPLES, 3)) + [0, 0, 9.8]
                there = rng.random(SAMPLES) >= share
                np.savez(path, gyro=gyro[there], accel=accel[there],
                         t=np.arange(SAMPLES)[there] / RATE)
                study = analyse(path, axes=list(AXES))
                for axis in AXES:
                    low, high = study[axis].N.interval
                    ratios.append(study[axis].N.value / N)
                    held.append(low < N < high)
            error = np.std(ratios) / np.sqrt(len(ratios))
            print(f'{100 * share:4.1f} %  {np.mean(ratios):.4f} +- {error:.4f}  '
                  f'{sum(held)} of {len(held)}', flush=True)


if __name__ == '__main__':
    main()
