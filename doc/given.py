# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a reader of the manual brings along, simulated: a bag of his own, a session of poses."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from imu_noise_tools.bag.writing import write_bag
from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.core.units import G0
from imu_noise_tools.simulate import simulate

GYRO = {'white': {'N': 8.7e-5}, 'flicker': {'B': 2.4e-5}}
ACCEL = {'white': {'N': 1.0e-3}, 'flicker': {'B': 4.0e-4}}
FACES = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)


def at_rest(duration: float = 600.0, seed: int = 3) -> ImuRecord:
    """Return a record at rest, 50 Hz."""
    axes = {f'{sensor}_{k}': dict(own) for sensor, own in (('gyro', GYRO), ('accel', ACCEL))
            for k in 'xyz'}
    return simulate({'rate_hz': 50, 'duration_s': duration, 'seed': seed, 'targets': axes})[0]


def turned(ups: np.ndarray, rng: np.random.Generator, rate: float = 100.0, hold: float = 5.0,
           move: float = 2.0) -> ImuRecord:
    """
    Return a session that holds the directions ``ups`` (n, 3) up in turn, with its sensor errors.

    Between two poses the body turns about the axis that leads from one to the other.

    """
    up, spin = [], []
    for k, now in enumerate(ups):
        if k:
            last = ups[k - 1]
            axis = np.cross(last, now)
            if np.linalg.norm(axis) < 1e-3:
                axis = np.cross(last, np.eye(3)[np.argmin(np.abs(last))])
            angle, axis = np.arctan2(np.linalg.norm(np.cross(last, now)), last @ now), (
                axis / np.linalg.norm(axis))
            n = round(move * rate)
            phase = np.pi * (np.arange(n) + 0.5) / n
            done = angle * (1 - np.cos(phase))[:, None] / 2
            up.append(last * np.cos(done) + np.cross(axis, last) * np.sin(done)
                      + axis * (axis @ last) * (1 - np.cos(done)))
            spin.append(-axis * (angle / move * np.pi / 2 * np.sin(phase))[:, None])
        n = round(hold * rate)
        up.append(np.tile(now, (n, 1)))
        spin.append(np.zeros((n, 3)))
    force, rates = G0 * np.concatenate(up), np.concatenate(spin)
    scale = np.diag([1.004, 0.997, 1.006]) + 0.002 * (np.eye(3, k=1) - np.eye(3, k=-1))
    accel = force @ scale.T + [0.12, -0.08, 0.21] + 0.01 * rng.normal(size=force.shape)
    gyro = rates * [1.01, 0.99, 1.005] + [0.01, -0.02, 0.005] + 2e-3 * rng.normal(size=rates.shape)
    return ImuRecord(gyro, accel, np.arange(len(force)) / rate, rate, topic='/imu/data_raw',
                     frame_id='imu_link', start=1.7e9)


def faces(n: int = 6) -> ImuRecord:
    """Return the first n of six faces, each tilted by a degree or so."""
    rng = np.random.default_rng(5)
    ups = FACES + rng.normal(0, 0.017, FACES.shape)
    return turned((ups / np.linalg.norm(ups, axis=1)[:, None])[:n], rng)


def five() -> ImuRecord:
    """Return a session in which a face was forgotten."""
    return faces(5)


def poses(n: int = 20) -> ImuRecord:
    """Return poses in all directions."""
    k = np.arange(n) + 0.5
    z, phi = 1 - 2 * k / n, np.pi * (1 + 5 ** 0.5) * k
    flat = np.sqrt(1 - z ** 2)
    ups = np.column_stack([flat * np.cos(phi), flat * np.sin(phi), z])
    return turned(ups, np.random.default_rng(6))


def last_month() -> ImuRecord:
    """Return a record of the same sensor, drawn anew."""
    return at_rest(seed=4)


def turntable() -> ImuRecord:
    """Return a minute of the same sensor, turned to and fro about the vertical."""
    still = at_rest(60.0, seed=5)
    t = np.arange(still.n) / still.rate_hz
    rate = 0.8 * np.sin(2 * np.pi * 0.3 * t) + 0.4 * np.sin(2 * np.pi * 0.77 * t + 1)
    return replace(still, gyro=still.gyro + rate[:, None] * [0, 0, 1])


def bring(name: str, folder: Path) -> None:
    """Write what is asked for by its name into a folder."""
    record = {'faces.mcap': faces, 'five.mcap': five, 'poses.mcap': poses,
              'last_month': last_month, 'turntable': turntable}.get(name, at_rest)()
    write_bag(Path(folder) / name, record)
