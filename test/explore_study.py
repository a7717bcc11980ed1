# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A small study with something hidden, of a generator that knows no effect of the package."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.tasks import loop as tasks, noise

RATE, SECONDS, LINE = 50.0, 1200.0, 6.7


def record(seed=11):
    """Return white noise on two axes, a line of 6.7 Hz in the first and a slow wander in both."""
    rng = np.random.default_rng(seed)
    n = int(RATE * SECONDS)
    t = np.arange(n) / RATE
    gyro = 1e-3 * rng.standard_normal((n, 3)) + np.cumsum(
        2e-6 * rng.standard_normal((n, 3)), axis=0)
    gyro[:, 0] += 2e-4 * np.cos(2 * np.pi * LINE * t + 0.3)
    accel = 1e-2 * rng.standard_normal((n, 3)) + np.array([0, 0, 9.81]) + np.cumsum(
        2e-5 * rng.standard_normal((n, 3)), axis=0)
    return ImuRecord(t=t, gyro=gyro, accel=accel, rate_hz=RATE)


def study(folder: Path) -> Path:
    """Write the study of it, of two axes, and return its folder."""
    found = noise.analyse_record(record(), axes=['gyro_x', 'accel_z'])
    return tasks.save(found, folder)
