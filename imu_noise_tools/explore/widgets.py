# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The two kinds of button of the page, and its plot."""

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
        press(button, pressed)
    button.set_enabled(enabled)
    return button


def press(button: Any, pressed: bool) -> None:
    """Say whether one of several buttons is the chosen one; nothing is sent where it is so."""
    said = 'true' if pressed else 'false'
    if button.props.get('aria-pressed') != said:
        button.props(f'aria-pressed={said}')


def loud(text: str, clicked: Callable[[], Any], enabled: bool = True) -> Any:
    """Return the button that comes next."""
    button = ui.button(text, on_click=lambda: clicked()).props(
        'no-caps unelevated dense padding="2px 10px"')
    button.set_enabled(enabled)
    return button


class Plot:
    """
    A plot that is drawn anew by what it is sent, and is told nothing else.

    As a property of an element every number of a figure would be watched for changes, here and in
    the browser: that took longer than to draw them.

    """

    # the last of what comes while plotly is being loaded
    _DRAW = """(() => {
      const plot = getElement(%d), figure = %s;
      plot.wanted = figure;
      const draw = () => {
        if (plot.wanted !== figure) return;
        if (plot.last_options) plot.Plotly.react(plot.$el, figure); else setTimeout(draw, 20);
      };
      draw();
    })()"""

    def __init__(self) -> None:
        self.element = ui.plotly({'data': [], 'layout': {}}).classes('plot')

    def draw(self, figure: str) -> None:
        """Draw a figure, JSON."""
        self.element.client.run_javascript(self._DRAW % (self.element.id, figure))
