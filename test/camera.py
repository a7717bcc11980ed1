# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A depth camera's bag: gyroscope and accelerometer on topics and at rates of their own."""

from __future__ import annotations

import numpy as np

from imu_noise_tools.bag.decode import IMU, TEMPERATURE
from imu_noise_tools.bag.encode import imu_values, serialise
from imu_noise_tools.bag.mcap_writer import McapWriter

START = 1_700_000_000 * 10 ** 9
GYRO, ACCEL = '/camera/gyro/sample', '/camera/accel/sample'
GYRO_HZ, ACCEL_HZ = 200.0, 63.0
N_GYRO, N_ACCEL = 2.0e-4, 1.5e-3        # rad/s/sqrt(Hz), m/s^2/sqrt(Hz)


def stamps_of(rate, seconds, rng, first):
    """Return stamps (ns) that jitter by a twentieth of a step, as a driver's do."""
    n = int(seconds * rate)
    t = first + (np.arange(n) + 0.05 * rng.standard_normal(n)) / rate
    return START + np.round(t * 1e9).astype(np.int64)


def camera_bag(path, seconds=400.0, seed=7):
    """Write a bag as a depth camera gives it, with a temperature, in order of time."""
    rng = np.random.default_rng(seed)
    gyro_t, accel_t = (stamps_of(r, seconds, rng, f) for r, f in (
        (GYRO_HZ, 0.013), (ACCEL_HZ, 0.0)))
    gyro = 0.002 + N_GYRO * GYRO_HZ ** 0.5 * rng.standard_normal((len(gyro_t), 3))
    accel = [0.1, -9.79, 0.3] + N_ACCEL * ACCEL_HZ ** 0.5 * rng.standard_normal((len(accel_t), 3))
    warm_t = START + np.arange(int(seconds)) * 10 ** 9
    warm = np.column_stack([30 + 0.5 * np.sin(np.arange(len(warm_t)) / 60), 0 * warm_t])
    parts = {
        ACCEL: (IMU, accel_t, imu_values(None, accel)),
        GYRO: (IMU, gyro_t, imu_values(gyro, None)),
        '/camera/temperature': (TEMPERATURE, warm_t, warm),
    }
    with open(path, 'xb') as file:
        writer = McapWriter(file)
        writer.messages({writer.topic(name, type): (t, serialise(t, values, 'camera_imu_frame'))
                         for name, (type, t, values) in parts.items()})
        writer.finish()
    return path
