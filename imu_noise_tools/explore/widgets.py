# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The two kinds of button of the page."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from nicegui import ui


def quiet(text: str, clicked: Callable[[], Any], pressed: bool | None = None,
          enabled: bool = True) -> Any:
    """Return a button; ``pressed`` where it is one of several."""
    button = ui.button(text, on_click=lambda: clicked(), color=None).props(
        'no-caps unelevated dense padding="2px 10px"').classes('quiet')
    if pressed is not None:
        button.props(f'aria-pressed={"true" if pressed else "false"}')
    button.set_enabled(enabled)
    return button


def loud(text: str, clicked: Callable[[], Any], enabled: bool = True) -> Any:
    """Return the button that comes next."""
    button = ui.button(text, on_click=lambda: clicked()).props(
        'no-caps unelevated dense padding="2px 10px"')
    button.set_enabled(enabled)
    return button
