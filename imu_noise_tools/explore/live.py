# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The screen over a running analyser: what it publishes, and its services as buttons."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
import re
from typing import Any, Protocol

from nicegui import run, ui
import numpy as np

from . import look
from .figure import drawn, marked
from .widgets import loud, Plot, quiet
from .. import store
from ..core import units
from ..core.errors import ImuNoiseError
from ..plots.curves import TAU
from ..plots.panel import Curve, Panel
from ..plots.style import readable
from ..report import words

FOLLOW = 0.3        # s between looks at what has come
_END = re.compile('_(std|lo|hi|upper95)$')
NORMAL = 1.96       # standard deviations in half of a 95 % interval


class Source(Protocol):
    """What follows an analyser: :class:`imu_noise_tools.nodes.follow.Follower`."""

    name: str
    curves: Mapping[str, Mapping[str, Any]]
    said: Mapping[str, list[tuple[str, str, dict[str, str]]]]
    version: int

    def call(self, service: str) -> dict[str, Any]:
        """Call a service; raise InputError where it refuses."""


def panel(axis: str, found: Mapping[str, Any]) -> Panel:
    """Return the curve of an axis as it came, the model beside it where there is one."""
    factor, unit = units.field('{rate}', axis.partition('_')[0])
    tau, dev, lo, hi, model = (np.asarray(found[k], float)
                               for k in ('tau', 'adev', 'lo', 'hi', 'model'))
    lines = [Curve('measured', tau, dev / factor, 'measured', lo / factor, hi / factor)]
    pull = np.zeros(len(tau))
    if np.all(np.isfinite(model)) and np.all(model > 0):
        lines.append(Curve('model', tau, model / factor, 'model'))
        pull = np.log(dev / model) / np.maximum(np.log(hi / lo) / (2 * NORMAL), 1e-9)
    return Panel('allan', TAU, 's', tau, pull,
                 f'Allan deviation, {readable(unit)}', 'xy', tuple(lines))


def coefficients(values: Mapping[str, str]) -> list[str]:
    """Return a status's numbers as people read them: value, interval or limit, unit."""
    out = []
    for name in dict.fromkeys(_END.sub('', k.partition(' [')[0]) for k in values if '[' in k):
        found = {k.partition(' [')[0].removeprefix(name): (float(v), k.partition('[')[2][:-1])
                 for k, v in values.items() if k.startswith(name) and '[' in k}
        unit = next(u for _, u in found.values())
        if '' in found:
            ends = ' ... '.join(words.significant(found[e][0]) for e in ('_lo', '_hi')
                                if e in found)
            said = words.significant(found[''][0]) + (f' ({ends})' if ends else '')
        elif '_upper95' in found:
            said = f'not observable, below {words.significant(found["_upper95"][0])}'
        else:
            continue
        out.append(f'{name} {said} {readable(unit)}')
    return out


class Live:
    """One window over an analyser."""

    def __init__(self, source: Source, axis: str = '') -> None:
        self.source, self.axis = source, axis
        self._shown, self._busy = -1, ''
        self._steps: list[Any] = []
        self._axes: tuple[str, ...] = ()
        ui.add_css(look.STYLE)
        ui.colors(primary='#0072b2')
        self._bar = ui.element('header').classes('bar')
        with ui.element('div').classes('status').props('role=status aria-live=polite'):
            self._spinner = ui.spinner(size='1.3rem')
            self._said = ui.html('', sanitize=False)
        with ui.element('main').classes('screen'):
            self._ladder = ui.element('section').classes('ladder')
            with ui.element('section').classes('curve'):
                self._plot = Plot()
            with ui.element('section').classes('verdict'):
                self._verdict = ui.html('', sanitize=False)
                # made once: one that is drawn anew under the mouse would lose the click
                with ui.element('div').classes('asked'):
                    self._buttons = [
                        (loud if service == 'analyse' else quiet)(
                            text, partial(self._call, service))
                        for text, service in (
                            ('Analyse', 'analyse'), ('Diagnose', 'diagnose'),
                            ('Add the best', 'add_best'), ('Undo', 'remove_last'),
                            ('Save', 'save'), ('Reset', 'reset'))]
        self._tell(f'Following {source.name}; nothing has come yet.')
        self.follow()
        ui.timer(FOLLOW, self.follow)

    def _tell(self, text: str, kind: str = 'faint') -> None:
        self._spinner.set_visibility(bool(self._busy))
        self._said.set_content(look.badge(text, kind))

    def follow(self) -> None:
        """Show what has come."""
        if self.source.version == self._shown:
            return
        self._shown = self.source.version
        if not self._busy:
            self._tell(f'{self.source.name}: ' + '; '.join(
                message for _, message, _ in self.source.said.get('status', ())))
        self.draw()

    def draw(self) -> None:
        """Draw everything."""
        self.axis = self.axis or next(iter(sorted(self.source.curves)), '')
        if self._axes != (shown := (self.axis, *self.source.curves)):
            self._axes = shown
            self._bar.clear()
            with self._bar:
                ui.html(f'<h1>{look.escape(self.source.name)}</h1>', sanitize=False)
                for axis in self.source.curves:
                    quiet(axis, partial(self._show, axis), axis == self.axis)
        found = self.source.curves.get(self.axis)
        if found is not None and len(found['tau']):
            self._plot.draw(marked(drawn(panel(self.axis, found))))
        self._ladder.clear()
        with self._ladder:
            steps = [s for s in self._steps if s.target == self.axis]
            model, values = next(((m, v) for n, m, v in self.source.said.get('coefficients', ())
                                  if n == self.axis), ('', {}))
            ui.html(f'<h2>Ladder of {look.escape(self.axis)}</h2>'
                    + (look.rungs(steps) if steps else '<p class="faint">not analysed yet</p>')
                    + f'<h2>In the model</h2><p>{look.escape(model)}</p>' + look.bullets(
                        map(look.escape, coefficients(values)), 'small'), sanitize=False)
        self._draw_verdict()

    def _draw_verdict(self) -> None:
        said, values = next(((m, v) for n, m, v in self.source.said.get('diagnosis', ())
                             if n == self.axis), ('not asked yet what is missing', {}))
        quality = {'complete': 'good', 'missing': 'bad', 'unknown': 'bad'}.get(
            said.partition(':')[0], 'doubt')
        self._verdict.set_content(
            f'<h2>Verdict</h2><p>{look.badge(said, quality)}</p>' + look.bullets(
                (f'{look.escape(k)}: {look.escape(v)}' for k, v in values.items()), 'small'))
        for button in self._buttons:
            button.set_enabled(not self._busy)

    def _show(self, axis: str) -> None:
        self.axis = axis
        self.draw()

    async def _call(self, service: str) -> None:
        """Call a service; the page goes on following while it works."""
        if self._busy:
            return
        self._busy = service
        self._tell(f'{service} …')
        self._draw_verdict()
        try:
            answer = await run.io_bound(self.source.call, service) or {}
            told = str(answer.get('summary', 'done')), 'good'
            if service in ('analyse', 'add_best', 'remove_last', 'diagnose'):
                data = await run.io_bound(self.source.call, 'history') or {}
                self._steps = store.history_of({'domain': 'noise', **data})
        except ImuNoiseError as error:
            told = str(error), 'bad'
        self._busy = ''
        self._tell(*told)
        self.draw()
