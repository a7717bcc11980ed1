# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Print what is found of sensors with filters that have no usual form, and of some that have.

    python bench/digital_filters.py [--seconds 1800] [--seed 7]

White noise of three axes at 1600 Hz passes a filter and is decimated to 200 Hz; flicker noise and
a random walk come behind it. One axis is diagnosed.

"""

from __future__ import annotations

import argparse
import time

import numpy as np
from scipy import signal

from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.tasks.noise import analyse_record

RATE, TIMES = 200.0, 8
INSIDE = RATE * TIMES
BOX = np.ones(TIMES) / TIMES
FILTERS = {
    'FIR, 63 taps, 60 Hz': [(signal.firwin(63, 60, fs=INSIDE), 1)],
    'Chebyshev II, 4, 40 dB, 90 Hz': [signal.cheby2(4, 40, 90, fs=INSIDE)],
    'elliptic, 3, 30 dB, 55 Hz': [signal.ellip(3, 0.5, 30, 55, fs=INSIDE)],
    'Bessel, 4, 50 Hz': [signal.bessel(4, 50, fs=INSIDE)],
    'Butterworth, 3, 60 Hz': [signal.butter(3, 60, fs=INSIDE)],
    'Butterworth, 4, 50 Hz': [signal.butter(4, 50, fs=INSIDE)],
    'three averages of 5 ms': 3 * [(BOX, 1)],
    'one pole, 30 Hz, and three averages of 5 ms': [
        signal.butter(1, 30, fs=INSIDE), *3 * [(BOX, 1)]],
    'Butterworth, 2, 45 Hz, and two averages of 5 ms': [
        signal.butter(2, 45, fs=INSIDE), *2 * [(BOX, 1)]],
    'Butterworth, 2, 40 Hz': [signal.butter(2, 40, fs=INSIDE)],
    'none': [],
}


def record_behind(stages, seconds: float, rng: np.random.Generator) -> ImuRecord:
    """Return a gyroscope at rest behind a chain of filters (b, a)."""
    n = int(seconds * RATE)
    f = np.maximum(np.fft.rfftfreq(n, 1 / RATE), 1 / seconds)
    axes = []
    for _ in range(3):
        white, slow, walk = np.array([1e-4, 2e-5, 1e-6]) * np.exp(0.25 * rng.standard_normal(3))
        x = white * np.sqrt(INSIDE) * rng.standard_normal(n * TIMES)
        for b, a in stages:
            x = signal.lfilter(b, a, x)
        x = x[::TIMES] if stages else x[::TIMES] / np.sqrt(TIMES)
        pink = np.fft.rfft(rng.standard_normal(n)) * np.sqrt(RATE / (2 * np.pi * f)) * slow
        axes.append(x + np.fft.irfft(pink, n)
                    + np.cumsum(walk / np.sqrt(RATE) * rng.standard_normal(n)))
    return ImuRecord(np.column_stack(axes), None, np.arange(n) / RATE, RATE)


def main() -> None:
    """Diagnose one axis behind each filter."""
    parser = argparse.ArgumentParser(description=__doc__.strip().splitlines()[0])
    parser.add_argument('--seconds', type=float, default=1800.0)
    parser.add_argument('--seed', type=int, default=7)
    args = parser.parse_args()
    for k, (name, stages) in enumerate(FILTERS.items()):
        record = record_behind(stages, args.seconds, np.random.default_rng([args.seed, k]))
        before = time.process_time()
        said = analyse_record(record, keep_motion=True).diagnose(['gyro_x'])['gyro_x']
        found = ', '.join(f.name for f in said.found) or '-'
        print(f'| {name} | {said.verdict} | {found} | {time.process_time() - before:.0f} |',
              flush=True)


if __name__ == '__main__':
    main()
