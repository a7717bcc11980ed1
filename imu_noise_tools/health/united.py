# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Whether one sensor's samples were made to fit the other's stamps.

A driver that publishes gyroscope and accelerometer in one message, though they are sampled at
rates of their own, interpolates the slower or repeats it (a depth camera's ``unite_imu_method``):
its noise at short times is then not the sensor's.

"""

from __future__ import annotations

import numpy as np

from ..core.record import ImuRecord, SENSORS

LOOKED_AT = 200_000     # samples that tell
LEAST = 0.2             # share of samples for which it holds on all axes at once
TOGETHER = 0.5          # of the way from axes that have nothing to do with each other to one fate
ON_LINE = 1e-3          # of the usual change of slope: what counts as none


def united(record: ImuRecord) -> list[str]:
    """
    Return a sentence on each sensor whose samples are interpolated or repeated.

    Only where both are there, and only one is so: what holds for both is no matter of uniting.
    Under two samples for one that was taken, none lie on a line that would tell.

    """
    there = [s for s in SENSORS if getattr(record, s) is not None]
    if len(there) < 2 or record.n < 1000:
        return []
    t = record.t[:LOOKED_AT]
    found = {s: _how(getattr(record, s)[:LOOKED_AT], t) for s in there}
    if all(found.values()):
        return []
    return [
        f'{s} {how} at about {rate:.3g} Hz (a driver that unites two sensors): its noise at '
        'short times is not its own; record its own topic, and analyse that'
        for s, answer in found.items() if answer
        for how, rate in [answer]
    ]


def _how(x: np.ndarray, t: np.ndarray) -> tuple[str, float] | None:
    """Return how samples (n, 3) at t (n,) came about, and the rate (Hz) behind them."""
    x = x[:, np.ptp(x, axis=0) > 0]
    span = float(t[-1] - t[0])
    if x.shape[1] < 2 or not (np.isfinite(x).all() and span > 0):
        return None
    step = np.diff(x, axis=0)
    same = step == 0
    if _beyond_chance(same):
        return 'repeats samples taken', float(np.sum(~same.all(axis=1))) / span
    for width in (np.maximum(np.diff(t), 1e-9)[:, None], 1.0):
        bend = np.abs(np.diff(step / width, axis=0))
        straight = bend < ON_LINE * np.mean(bend, axis=0)
        straight &= ~(same[1:] | same[:-1])
        if _beyond_chance(straight):
            bent = ~straight.all(axis=1)
            return 'is interpolated between samples taken', _runs(bent) / span
    return None


def _beyond_chance(flags: np.ndarray) -> bool:
    """Tell whether flags (n, axes) come on all axes at once, and often."""
    together, alone = flags.all(axis=1).mean(), flags.mean(axis=0)
    chance = np.prod(alone)
    return bool(together > LEAST and together - chance > TOGETHER * (alone.min() - chance))


def _runs(flags: np.ndarray) -> int:
    return int(np.sum(flags[1:] & ~flags[:-1])) + int(flags[0])
