# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What can be looked at of a calibration: how far each pose is from where the others put it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import cast

import numpy as np

from .panels import of_views, Panel
from ..calibration import CalibrationProblem
from ..loop.prediction import State


def panels(state: State) -> Mapping[str, Callable[[], Panel]]:
    """Return a panel for each view of the error on poses left out, pose by pose."""
    found = of_views(state.problem.held_out(state.model).views.values())
    return {name: lambda make=make: _by_pose(state, make())         # type: ignore[misc]
            for name, make in found.items()}


def _by_pose(state: State, panel: Panel) -> Panel:
    """Return a panel over the number of the pose, not its time."""
    poses = cast(CalibrationProblem, state.problem).poses
    order = np.argsort(poses.time)
    at = np.searchsorted(poses.time[order], panel.x)
    if not np.allclose(poses.time[order][np.minimum(at, poses.n - 1)], panel.x):
        return panel
    some = [f'{k} {poses.names[i]}' for k, i in enumerate(order, 1)]
    title = 'pose: ' + ', '.join(some) if poses.n <= 12 else 'pose'
    return replace(panel, x=at + 1.0, unit='pose', x_title=title)


def by_hand(state: State) -> list[str]:
    """Return nothing: an entry of S or b says nothing without the fit of the others."""
    return []
