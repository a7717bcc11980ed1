# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""An effect put into the model by hand: sliders for its size, and where it would stand."""

from __future__ import annotations

import math
from typing import Any

from nicegui import ui

from . import look
from .panels import begin_by_hand, names_by_hand, span_of
from .widgets import loud, quiet
from ..core import units
from ..core.errors import ImuNoiseError
from ..loop.effect import Effect, Parameter
from ..plots.panel import Stretch
from ..report import words

EVERYWHERE = Stretch(-math.inf, math.inf, '')


class Hand:
    """
    The effect that one window has put in by hand, and its sliders.

    Nothing is fitted: the model keeps its values, the effect those of the sliders.

    """

    def __init__(self, page: Any) -> None:
        self._page = page
        self._begun: Effect | None = None       # whose sizes the sliders' ends follow
        self.effect: Effect | None = None
        self._open = False
        self._for: tuple[Any, ...] = ()
        self._outcome: Any = None

    def clear(self) -> None:
        """Take it away."""
        self.effect = self._begun = None

    def draw(self, where: Any) -> None:
        """Draw the choice and the sliders, where the domain has any."""
        page = self._page
        names = names_by_hand(page.study.domain, page.state)
        if self.effect is not None and self.effect.name not in names:
            self.clear()
        now = (page.study.domain, names, self._begun)
        if now == self._for:
            self._say()
            return
        self._for = now
        where.clear()
        with where:
            if not names:
                return
            with ui.expansion('Put an effect in by hand', value=self._open,
                              on_value_change=self._opened).classes('full-width'):
                ui.html('<p class="small faint">Its line is drawn as you move the sliders; '
                        'nothing is fitted.</p>', sanitize=False)
                ui.select(names, value=self.effect.name if self.effect else None, label='effect',
                          on_change=lambda e: self._choose(e.value), with_input=True
                          ).props('dense outlined options-dense').style('max-width: 16rem')
                if self.effect is not None:
                    for p in self.effect.parameters:
                        self._slider(p)
                    self._outcome = ui.html('', sanitize=False).classes('small hand-outcome')
                    self._buttons()
        self._say()

    def _opened(self, event: Any) -> None:
        self._open = bool(event.value)

    def _buttons(self) -> None:
        page, effect = self._page, self.effect
        assert effect is not None
        with ui.element('div').classes('asked'):
            loud(f'Add {effect.name} and fit', lambda: self._add(effect.name))
            quiet('Take away', self._take_away)
        page.draw_curve()

    def _add(self, name: str) -> None:
        if self._page.session.add(self._page.target, [name]):
            self.clear()

    def _take_away(self) -> None:
        self.clear()
        self._page.draw_all()

    def _choose(self, name: str | None) -> None:
        page = self._page
        try:
            self.effect = begin_by_hand(page.study.domain, page.state, name) if name else None
        except ImuNoiseError as error:
            self.effect = None
            ui.notify(str(error))
        self._begun, self._open = self.effect, True
        page.draw_all()

    def _slider(self, p: Parameter) -> None:
        """Draw the slider of one parameter; of a choice its names."""
        begun, effect = self._begun, self.effect
        assert begun is not None and effect is not None
        with ui.element('div').classes('hand-row'):
            if p.choices:
                ui.select(list(p.choices), value=p.written(effect[p.name]), label=p.title,
                          on_change=lambda e: self._set(p, p.number(e.value), None)
                          ).props('dense outlined options-dense')
                return
            page = self._page
            low, high = span_of(page.study.domain, page.state, begun, p)
            ends = (math.log10(low), math.log10(high)) if p.log else (low, high)
            at = effect[p.name]
            ui.html(f'<label class="small">{look.escape(p.title or p.name)}</label>',
                    sanitize=False).style('width: 9rem')
            slider = ui.slider(min=ends[0], max=ends[1], step=(ends[1] - ends[0]) / 400,
                               value=math.log10(at) if p.log and at > 0 else at).style(
                'width: 12rem').props(f'aria-label="{p.title or p.name}"')
            shown = ui.html(self._shown(p, at), sanitize=False).classes('small')

            def moved(event: Any) -> None:
                self._set(p, 10.0 ** event.args if p.log else float(event.args), shown)
            slider.on('update:model-value', moved, throttle=0.1)

    def _shown(self, p: Parameter, value: float) -> str:
        sensor = self._page.target.partition('_')[0]
        field = self.effect is not None and self.effect.field_units
        factor, unit = units.field(p.unit, sensor) if field else (1.0, units.si(p.unit, sensor))
        return look.escape(f'{words.significant(value / factor)} {"" if unit == "1" else unit}')

    def _set(self, p: Parameter, value: float, shown: Any) -> None:
        if self.effect is None:
            return
        self.effect = self.effect.with_values(**{p.name: value})
        if shown is not None:
            shown.set_content(self._shown(p, value))
        self._page.draw_curve()
        self._say()

    def _say(self) -> None:
        """Say what fails in this view with it and without."""
        page = self._page
        if self.effect is None or self._outcome is None:
            return
        where = page.stretch or EVERYWHERE
        bins, before = page.session.seen(page.target).panels[page.view].panel.fails(where)
        after = page.panel.fails(where)[1]
        chance = 2 * math.sqrt(2 * max(bins, 1))
        quality = 'good' if after <= chance else 'bad' if after > before else 'doubt'
        self._outcome.set_content(
            f'<p>Misfit in this {"stretch" if page.stretch else "view"}, not fitted (sum of '
            f'squared pulls above its expectation): {before:.3g} without it, '
            f'{look.badge(f"{after:.3g} with it", quality)}, '
            f'up to {chance:.2g} by chance.</p>')
