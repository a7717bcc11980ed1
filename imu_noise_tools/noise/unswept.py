# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What of a change of the variance is seen where a line that sweeps does not pass.

A line that moves makes the bands it passes louder, one after the other: together they rise and
fall as noise does that changes, which does so in all bands, and all of the time.

"""

from __future__ import annotations

import numpy as np

from . import in_time
from .evidence import Evidence
from .kinds import Modulation
from .sweep import Sweep
from ..loop.effect import Model

HALF_WIDTH = 1.5    # blocks of time, half of what counts as the path of a line


def gained_beside(evidence: Evidence, model: Model, effect: Modulation, sweep: Sweep) -> float:
    """
    Return what a change gains over a steady level off the path of a line that sweeps, nats.

    Beside a model. The path is followed on to both ends of the record: a line is found in a part
    of it that may be shorter than its own.

    """
    edges = in_time.bands_in_time(evidence)
    t, x, w = in_time.power_in_time(evidence, model, len(edges) - 1)
    if w.ndim > 1:  # of all bands together
        return np.inf
    degrees = np.broadcast_to(in_time.rough_degrees(x, w), x.shape) * ~passed(sweep, t, edges)
    told = degrees.sum(axis=0) > 0
    if not np.any(told):
        return 0.0
    x, degrees = x[:, told], degrees[:, told]
    x = x * degrees.sum(axis=0) / np.sum(degrees * x, axis=0)
    m = in_time.followed_by(np.maximum(in_time.block_variance(effect, t), 1e-6), x, degrees)
    return 0.5 * float(np.sum(degrees * (x - 1 - np.log(m) - x / m + 1)))


def passed(sweep: Sweep, t: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """
    Return where a line passes of blocks in the middle of times t (s) and bands between edges (Hz).

    (blocks, bands), those beside its path too, which it leaks into.

    """
    rate = (sweep.last - sweep.first) / (sweep.end - sweep.begin)
    at = sweep.first + rate * (t - sweep.begin)
    reach = HALF_WIDTH * abs(rate) * (t[1] - t[0])
    low = np.searchsorted(edges, at - reach, side='right') - 2
    high = np.searchsorted(edges, at + reach, side='right')
    band = np.arange(len(edges) - 1)
    return (band >= low[:, None]) & (band <= high[:, None])
