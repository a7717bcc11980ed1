# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Calibration sessions with known truth, made without the package: poses and streams.

Everything is written from the physics (vectors, rotations, sums), so that a wrong formula in the
package cannot hide behind the same one here.

"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

G = 9.80665
AXES = {'+x': (1, 0, 0), '-x': (-1, 0, 0), '+y': (0, 1, 0), '-y': (0, -1, 0), '+z': (0, 0, 1),
        '-z': (0, 0, -1)}


@dataclass
class Device:
    """A sensor: output = S i + b and whatever else; three numbers are one an axis."""

    scale: np.ndarray = field(default_factory=lambda: np.eye(3))
    bias: np.ndarray = field(default_factory=lambda: np.zeros(3))
    quadratic: tuple = (0, 0, 0)
    cubic: tuple = (0, 0, 0)
    asymmetry: tuple = (0, 0, 0)
    temperature: tuple = (0, 0, 0)
    g_sensitivity: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)))
    noise: float = 1e-3                 # of one mean, or of one sample in a stream

    @classmethod
    def drawn(cls, rng, sensor='accel', noise=1e-3, cross=0.005, upper=False):
        """Return a consumer part: scale within 1 %, cross-axis 0.5 %, bias 0.3 m/s^2."""
        s = np.diag(1 + rng.uniform(-0.01, 0.01, 3)) + (1 - np.eye(3)) * rng.uniform(-cross, cross,
                                                                                     (3, 3))
        size = 0.3 if sensor == 'accel' else 0.02
        return cls(np.triu(s) if upper else s, rng.uniform(-size, size, 3), noise=noise)

    def output(self, inputs, rng=None, temperature=None, force=None):
        """Return outputs (n, 3) of inputs (n, 3)."""
        out = np.zeros_like(inputs)
        for k in range(len(inputs)):
            i = inputs[k]
            for axis in range(3):
                o = sum(self.scale[axis, j] * i[j] for j in range(3)) + self.bias[axis]
                o += self.quadratic[axis] * i[axis] * i[axis] + self.cubic[axis] * i[axis] ** 3
                o += self.asymmetry[axis] * abs(i[axis])
                if temperature is not None:
                    o += self.temperature[axis] * (temperature[k] - 25.0)
                if force is not None:
                    o += sum(self.g_sensitivity[axis, j] * force[k, j] for j in range(3))
                out[k, axis] = o
        return out if rng is None else out + self.noise * rng.normal(size=out.shape)


def tilted(directions, theta, rng):
    """Return unit vectors (n, 3) turned by two small angles each, of rms theta."""
    out = []
    for u in np.asarray(directions, float):
        other = np.eye(3)[int(np.argmin(np.abs(u)))]
        e1 = np.cross(u, other)
        e1 /= np.linalg.norm(e1)
        e2 = np.cross(u, e1)
        a, b = rng.normal(0, theta, 2) if theta > 0 else (0.0, 0.0)
        angle = np.hypot(a, b)
        lateral = (a * e1 + b * e2) / angle if angle > 0 else 0 * e1
        out.append(np.cos(angle) * u + np.sin(angle) * lateral)
    return np.array(out)


def faces(times=1):
    """Return the names and directions of the six faces, several times over."""
    names = list(AXES) * times
    return names, np.array([AXES[n] for n in names], float)


def spread_directions(n, rng):
    """Return n directions spread over the sphere by the golden angle, turned at random."""
    k = np.arange(n) + 0.5
    z, phi = 1 - 2 * k / n, np.pi * (1 + 5 ** 0.5) * k
    u = np.column_stack([np.sqrt(1 - z ** 2) * np.cos(phi), np.sqrt(1 - z ** 2) * np.sin(phi), z])
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return u @ q.T


def turned(v, axis, angle):
    """Return v (3,) turned about an axis (3,) by an angle (Rodrigues)."""
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    return (v * np.cos(angle) + np.cross(axis, v) * np.sin(angle) + axis * (axis @ v)
            * (1 - np.cos(angle)))


def stream(device, ups, rng, rate=100.0, hold_s=5.0, move_s=1.5, temperature=None, gyro=None,
           knock=None):
    """
    Return (t, gyro, accel, temperature) of poses with handling between them.

    ``ups`` (n, 3): the direction of up in the body for each; ``hold_s`` one for all or each;
    ``temperature`` one each; ``knock``: (pose, size).

    """
    gyro = gyro or Device(bias=np.array([0.01, -0.02, 0.005]), noise=2e-3)
    up_all, rate_all, temp_all, shock = [], [], [], []
    n_move = round(move_s * rate)
    for k, (up, hold) in enumerate(zip(ups, np.broadcast_to(hold_s, len(ups)))):
        n_hold = round(hold * rate)
        if k:
            last = ups[k - 1]
            axis = np.cross(last, up)
            if np.linalg.norm(axis) < 1e-6:
                axis = np.cross(last, np.eye(3)[int(np.argmin(np.abs(last)))])
            angle = np.arctan2(np.linalg.norm(np.cross(last, up)), last @ up)
            share = 0.5 * (1 - np.cos(np.pi * (np.arange(n_move) + 1) / n_move))
            axis = axis / np.linalg.norm(axis)
            for j in range(n_move):
                up_all.append(turned(last, axis, angle * share[j]))
                # up turns by +angle in the body, so the body turns by -angle
                rate_all.append(-axis * angle * (np.pi / 2) * np.sin(np.pi * (j + 1) / n_move)
                                / move_s)
                shock.append(rng.normal(0, 0.8, 3))
                temp_all.append(np.nan if temperature is None else temperature[k])
        for j in range(n_hold):
            up_all.append(np.asarray(up, float))
            rate_all.append(np.zeros(3))
            hit = knock is not None and knock[0] == k and abs(j - n_hold // 2) < 4
            shock.append(knock[1] * rng.normal(size=3) if hit else np.zeros(3))
            temp_all.append(np.nan if temperature is None else temperature[k])
    force = G * np.array(up_all)
    temp = np.array(temp_all)
    known = None if temperature is None else temp
    accel = device.output(force + np.array(shock), rng, known)
    rates = gyro.output(np.array(rate_all), rng, known, force)
    return np.arange(len(force)) / rate, rates, accel, known


def hand_turns(gyro, rng, angle=2 * np.pi, rate=100.0, hold_s=3.0, turn_s=3.0, theta=0.0,
               ways=(1, -1)):
    """Return (t, gyro, accel) of hand turns about each axis, that axis up, rests between."""
    device = Device(noise=5e-3)
    up_all, rate_all = [], []
    for axis in np.eye(3):
        up = tilted([axis], theta, rng)[0]
        for way in ways:
            n = round(turn_s * rate)
            for _ in range(round(hold_s * rate)):
                up_all.append(up)
                rate_all.append(np.zeros(3))
            for j in range(n):
                up_all.append(up)
                rate_all.append(way * up * angle / turn_s
                                * (1 - np.cos(2 * np.pi * (j + 0.5) / n)))
        for _ in range(round(hold_s * rate)):
            up_all.append(up)
            rate_all.append(np.zeros(3))
    force = G * np.array(up_all)
    return np.arange(len(force)) / rate, gyro.output(np.array(rate_all), rng, None,
                                                     force), device.output(force, rng)
