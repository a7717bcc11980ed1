# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where effects begin or end that are placed: each of their places is tried on the residuals."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .effects import Regressor
from .poses import Poses
from ..core.errors import FitError
from ..core.statistics import CHI2_95
from ..core.units import si
from ..loop.effect import Estimate

Gain = Callable[[Regressor], tuple[float, int]]


def everywhere(effect: Regressor, poses: Poses) -> list[Regressor]:
    """Return an effect at each of its places; alone where it is not placed, or has its place."""
    if not effect.placed or effect.placed in effect.values:
        return [effect]
    return [effect.with_values(**{effect.placed: float(x)}) for x in effect.places(poses)]


def best(effect: Regressor, poses: Poses, gain: Gain) -> Estimate:
    """
    Return where an effect gains most, with the times of the poses between which that may be.

    The interval holds each place that gains as much but for what chance takes (95 %).

    Raises
    ------
    FitError
        It has no place among these poses.

    """
    some = everywhere(effect, poses)
    if not some:
        raise FitError(f'{effect.name}: {effect.why_not(poses)}', effect.needs)
    at = np.array([e[effect.placed] for e in some])
    gained = np.array([gain(e)[0] for e in some])
    near = at[gained > gained.max() - CHI2_95 / 2]
    ci95 = (float(poses.time[poses.time < near.min()].max()),
            float(poses.time[poses.time > near.max()].min()))
    value = float(at[np.argmax(gained)])
    unit = si(effect.parameter(effect.placed).unit, poses.sensor)
    # anywhere between two poses alike
    return Estimate(value, (ci95[1] - ci95[0]) / np.sqrt(12), ci95, unit, point=value)
