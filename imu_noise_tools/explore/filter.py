# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What can be looked at of a filter: what its innovations do that white noise does not."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from .panels import of_views, Panel
from ..loop.prediction import State


def panels(state: State) -> Mapping[str, Callable[[], Panel]]:
    """Return a panel for each view of the innovations over the whole series."""
    return of_views(state.problem.score(state.fit).views.values())


def by_hand(state: State) -> list[str]:
    """Return nothing: a filter with another model is run, not drawn."""
    return []
