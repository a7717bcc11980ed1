# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What a sensor with a clock of its own tells beside another: its axes at the other's times.

So that coherence and coupling between a camera's gyroscope and accelerometer, sampled at rates of
their own, can be looked for. No curve and no coefficient comes from what is resampled here.

"""

from __future__ import annotations

import numpy as np

from ..core.record import ImuRecord

LEAST_COVERED = 0.9     # share of the record that the other one must cover


def seen_from(record: ImuRecord, other: ImuRecord) -> dict[str, np.ndarray]:
    """
    Return the axes of another prepared record at the times of this one, by name, (n,) each.

    And the squared vibration as ``accel_square``, squared before it is resampled. Empty where the
    two do not lie over each other in time.

    """
    at = record.t + (record.start - other.start)
    if np.mean((at >= other.t[0]) & (at <= other.t[-1])) < LEAST_COVERED:
        return {}
    out = {a: _averaged(other.t, other.column(a), at, record.dt) for a in other.axes}
    if other.accel is not None:
        total = np.zeros(other.n)
        for x in other.accel.T:
            total += (x - np.mean(x)) ** 2
        out['accel_square'] = _averaged(other.t, total, at, record.dt)
    return out


def _averaged(t: np.ndarray, x: np.ndarray, at: np.ndarray, width: float) -> np.ndarray:
    """
    Return the means of x over ``width`` s about some times: x held, each sample about its time.

    The mean takes away what would alias where x is the faster one.

    """
    step = (t[-1] - t[0]) / (len(t) - 1)
    edges = t[0] + step * (np.arange(len(t) + 1) - 0.5)
    level = float(np.mean(x))
    area = np.concatenate([[0.0], np.cumsum(x - level)]) * step

    def before(when: np.ndarray) -> np.ndarray:
        return np.interp(when, edges, area)

    return level + (before(at + width / 2) - before(at - width / 2)) / width
