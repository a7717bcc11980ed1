# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What can be looked at of a calibration: how far each pose is from where the others put it."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from .panels import of_views, Panel
from ..loop.prediction import State


def panels(state: State) -> Mapping[str, Callable[[], Panel]]:
    """Return a panel for each view of the error on poses left out."""
    return of_views(state.problem.held_out(state.model).views.values())


def by_hand(state: State) -> list[str]:
    """Return nothing: an entry of S or b says nothing without the fit of the others."""
    return []
