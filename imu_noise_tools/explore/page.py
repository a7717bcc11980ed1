# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The screen: ladder on the left, curve with pull in the middle, verdict with evidence on the right.

A window has its own axis, view and stretch; the study and what is under way belong to the
session, which all windows share. What is drawn comes from numbers at hand; what takes longer the
session computes elsewhere, and the screen follows it a few times a second.

"""

from __future__ import annotations

from functools import partial
from typing import Any

from nicegui import ui

from . import look
from .figure import marked
from .hand import Hand
from .jobs import draw
from .live import Live, Source
from .panels import names_of, with_hand
from .session import Session
from .widgets import loud, Plot, press, quiet
from .. import export
from ..core.errors import ImuNoiseError
from ..loop.domains import package
from ..loop.effect import registry
from ..plots.panel import Stretch
from ..report import words

FOLLOW = 0.15       # s between looks at the session
DISK = 2.0          # s between looks at the study on disk


def build(session: Session | None, live: Source | None = None) -> None:
    """Offer the page of a session, or of what follows an analyser."""
    @ui.page('/')
    def index(axis: str = '', view: str = '') -> None:
        if session is not None:
            Page(session, axis, view)
        elif live is not None:
            Live(live, axis)


class Page:
    """One window."""

    def __init__(self, session: Session, target: str, view: str) -> None:
        self.session, self.target, self.view = session, target, view
        self.stretch: Stretch | None = None
        self.panel: Any = None              # that is on the screen
        self._shown = (-1, None, None)      # version, busy and said that are on the screen
        # what was made stays, and only what differs is sent: a click must not wait for the rest
        self._made: dict[str, Any] = {}
        self._axes: dict[str, Any] = {}
        self._views: dict[str, Any] = {}
        ui.add_css(look.STYLE)
        ui.colors(primary='#0072b2')
        self._bar = ui.element('header').classes('bar')
        with ui.element('div').classes('status').props('role=status aria-live=polite'):
            self._progress = ui.linear_progress(show_value=False).props('aria-label=progress')
            self._spinner = ui.spinner(size='1.3rem')
            self._said = ui.html('', sanitize=False)
            self._stop = quiet('Stop', self.session.stop)
        with ui.element('main').classes('screen'):
            with ui.element('section').classes('ladder'):
                self._rungs = ui.html('', sanitize=False)
                self._effects = ui.element('div')
                self._tools = ui.element('div').classes('asked q-mt-sm')
            with ui.element('section').classes('curve'):
                self._tabs = ui.element('nav').classes('tabs')
                self._plot = Plot()
                self._plot.element.on(
                    'plotly_selected', self._brushed,
                    js_handler='(e) => { if (e && e.range) emit(e.range.x) }')
                self._asked = ui.element('div').classes('small')
                self._by_hand = ui.element('div')
            with ui.element('section').classes('verdict'):
                self._verdict = ui.element('div')
                self._export = ui.element('div')
        self.hand = Hand(self)
        self.follow()
        ui.timer(FOLLOW, self.follow)
        ui.timer(DISK, self.session.look)

    # --- what the window looks at ----------------------------------------------------------------

    @property
    def study(self) -> Any:
        """The study; None while there is none."""
        return self.session.study

    @property
    def state(self) -> Any:
        """The target's state in the study."""
        return self.study.states[self.target]

    def show(self, target: str = '', view: str = '') -> None:
        """Look at another axis, or in another way."""
        self.stretch = None
        moved = bool(target) and target != self.target
        if moved:
            self.hand.clear()
        self.target, self.view = target or self.target, view or self.view
        self._settle()
        ui.run_javascript(
            f'history.replaceState(null, "", "?axis={self.target}&view={self.view}")')
        if moved:
            self.draw_all()
        else:
            self._draw_tabs()
            self.draw_curve()
            self.hand.draw(self._by_hand)

    def _settle(self) -> None:
        """Make axis and view such as the study has."""
        if self.target not in self.study.states:
            self.target = self.study.targets[0]
        names = names_of(self.study.domain, self.state)
        if self.view not in names:
            self.view = next(iter(names))

    def _brushed(self, event: Any) -> None:
        """Take the stretch that was drawn across the plot."""
        low, high = sorted(float(v) for v in event.args[:2])
        panel = self.session.seen(self.target).panels[self.view].panel
        if high > low:
            self.stretch = Stretch(low, high, panel.unit)
            self.draw_curve()

    def follow(self) -> None:
        """Show what is new in the session."""
        s = self.session
        now = (s.version, s.busy, s.said)
        if now == self._shown:
            return
        before, self._shown = self._shown, now      # type: ignore[assignment]
        self._draw_status()
        if s.version != before[0] and self.study is not None:
            self._settle()
            self.draw_all()

    # --- drawing ---------------------------------------------------------------------------------

    def draw_all(self) -> None:
        """Draw everything."""
        self._draw_bar()
        self._draw_ladder()
        self._draw_tabs()
        self.draw_curve()
        self.hand.draw(self._by_hand)
        self._draw_verdict()

    def _draw_status(self) -> None:
        busy, said = self.session.busy, self.session.said
        share = busy[0] if busy else None
        self._progress.set_visibility(share is not None)
        self._spinner.set_visibility(busy is not None and share is None)
        self._stop.set_visibility(busy is not None)
        if share is not None:
            self._progress.set_value(share)
        if busy:
            text, kind = f'{busy[1]} …', 'faint'
        elif said:
            text, kind = said.text, said.kind
        else:
            text, kind = f'On disk: {self.session.folder}', 'faint'
        self._said.set_content(look.badge(text, kind))

    def _changed(self, part: str, now: Any) -> bool:
        """Tell whether a part of the screen has to be made anew; remember what of."""
        if self._made.get(part) == now:
            return False
        self._made[part] = now
        return True

    def _draw_bar(self) -> None:
        others = self.session.others()
        if self._changed('bar', (self.session.folder, others, self.study.targets)):
            self._bar.clear()
            with self._bar:
                if len(others) < 2:
                    ui.html(f'<h1>{look.escape(self.session.folder.name)}</h1>', sanitize=False)
                else:
                    ui.select(others, value=str(self.session.folder.resolve()), label='study',
                              on_change=lambda e: self.session.go_to(e.value)
                              ).props('dense outlined options-dense')
                for t in self.study.targets:
                    with quiet('', partial(self.show, t), False) as self._axes[t]:
                        ui.html('', sanitize=False)
        for t in self.study.targets:
            _, quality = words.verdict_in_words(self.study.states[t].error,
                                                self.study.diagnosis.get(t))
            press(self._axes[t], t == self.target)
            next(iter(self._axes[t])).set_content(
                f'<span class="dot {quality}"></span>{look.escape(t)}')

    def _draw_tabs(self) -> None:
        names = names_of(self.study.domain, self.state)
        if self._changed('tabs', names):
            self._tabs.clear()
            with self._tabs:
                self._views = {name: quiet(title[:1].upper() + title[1:],
                                           partial(self.show, '', name), False)
                               for name, title in names.items()}
        for name, button in self._views.items():
            press(button, name == self.view)

    def _draw_ladder(self) -> None:
        s, busy = self.session, self.session.busy is not None
        steps = [x for x in self.study.history if x.target == self.target]
        self._rungs.set_content(
            f'<h2>Ladder of {look.escape(self.target)}</h2><p class="small faint">The error on '
            'data that the fit has not seen, model after model. Up to the green mark chance '
            f'explains it.</p>{look.rungs(steps)}<h2>In the model</h2>')
        self._effects.clear()
        with self._effects:
            for label in self.state.model.labels:
                with ui.element('div').classes('effect'):
                    ui.html(look.coefficients(self.state, self.target, label), sanitize=False)
                    quiet('Remove', partial(s.remove, self.target, label), enabled=not busy
                          ).props(f'aria-label="Remove {label}"')
        names = [n for n, c in registry(self.study.domain).items()
                 if n not in self.state.model or c.several]
        if not self._changed('tools', (s.can_undo, busy, names)):
            return
        self._tools.clear()
        with self._tools:
            quiet('Undo', s.undo, enabled=bool(s.can_undo) and not busy).tooltip(
                f'back to {s.can_undo}' if s.can_undo else 'nothing was changed here yet')
            ui.select(names, label='Add an effect', with_input=True, on_change=lambda e:
                      e.value and s.add(self.target, [e.value])
                      ).props('dense outlined options-dense').set_enabled(not busy)

    def draw_curve(self) -> None:
        """Draw the panel, and what its stretch is."""
        hand = self.hand.effect
        if hand is None:
            drawn = self.session.seen(self.target).panels[self.view]
        else:
            state = with_hand(self.state, hand)
            drawn = draw(self.study.domain, state, self.view, state.model.labels[-1])
        self.panel = drawn.panel
        found = self.study.diagnosis.get(self.target)
        suspect = found.found[0].name if found and found.found else ''
        self._plot.draw(marked(
            drawn, self.stretch, suspect if hand is None else ''))
        self._draw_asked()

    def _draw_asked(self) -> None:
        s, busy = self.session, self.session.busy is not None
        answer = s.answers.get((self.target, self.view))
        self._asked.clear()
        with self._asked:
            if answer is None and self.stretch is None:
                ui.html('<p class="faint">Draw across a stretch of the plot to ask what it is. '
                        'Below: pull, measured minus model in standard errors; grey is chance.'
                        '</p>', sanitize=False)
                return
            at = self.stretch or (answer.stretch if answer else Stretch(0, 0, ''))
            with ui.element('div').classes('asked'):
                ui.html(f'<b>{look.escape(str(at))}</b>', sanitize=False)
                if answer is None or answer.stretch != at:
                    loud('What is this?', partial(s.identify, self.target, self.view, at),
                         enabled=not busy)
                quiet('Clear', self._forget)
            if answer is None or answer.stretch != at:
                return
            ui.html(look.answer_of(answer), sanitize=False)
            for c in answer.candidates[:5]:
                with ui.element('div').classes('effect'):
                    ui.html(look.candidate(c), sanitize=False)
                    quiet('Add', partial(s.add, self.target, [c.name]), enabled=not busy)

    def _forget(self) -> None:
        self.stretch = None
        self.session.answers.pop((self.target, self.view), None)
        self.draw_curve()

    def _draw_verdict(self) -> None:
        s, busy = self.session, self.session.busy is not None
        state, d = self.state, self.study.diagnosis.get(self.target)
        self._verdict.clear()
        with self._verdict:
            ui.html('<h2>Verdict</h2>' + look.verdict_of(state, d), sanitize=False)
            for k, f in enumerate(d.found if d else ()):
                with ui.element('div').classes('card'):
                    ui.html(look.found(f, self.target), sanitize=False)
                    (quiet if k else loud)(f'Add {f.name}', partial(
                        s.add, self.target, [f.name]), enabled=not busy)
            ui.html(look.rest_of(d, s.seen(self.target).remarks), sanitize=False)
            with ui.element('div').classes('asked'):
                (quiet if d else loud)('Diagnose', lambda: s.diagnose([self.target]),
                                       enabled=not busy)
                quiet('Diagnose all', lambda: s.diagnose(self.study.targets), enabled=not busy)
                quiet('Until complete', lambda: s.complete([self.target]), enabled=not busy
                      ).tooltip('add what is missing, one after the other, until nothing is')
            self._draw_failing(state)
        if self._changed('export', self.study.domain):
            self._export.clear()
            if package(self.study.domain).NUMBERS:
                with self._export:
                    self._draw_export()

    def _draw_failing(self, state: Any) -> None:
        """Name the views that fail; a click looks at one."""
        failing = words.failing(state.error)
        if failing:
            ui.html('<h2>Where the model fails</h2>', sanitize=False)
        names = names_of(self.study.domain, state)
        for v in failing:
            with ui.element('div').classes('effect'):
                ui.html(f'<div class="small">{look.escape(words.view_in_words(v))}.</div>',
                        sanitize=False)
                if v.name in names:
                    quiet('Look', partial(self.show, '', v.name))

    def _draw_export(self) -> None:
        """Offer every format there is."""
        known = export.descriptions()
        with ui.expansion('Export').classes('full-width q-mt-md'):
            name = ui.select(list(known), value=next(iter(known)), label='format').props(
                'dense outlined options-dense')
            axes = ui.select(['worst', 'mean', 'each'], value='worst', label='axes').props(
                'dense outlined options-dense')
            said = ui.html('', sanitize=False)

            def text() -> str:
                try:
                    return self.session.export(name.value, axes.value)
                except ImuNoiseError as error:
                    said.set_content(look.badge(str(error), 'bad'))
                    return ''

            def show() -> None:
                found = text()
                if found:
                    said.set_content(f'<p class="small">{look.escape(known[name.value])}</p>'
                                     f'<pre>{look.escape(found)}</pre>')

            def save() -> None:
                found = text()
                if found:
                    ui.download.content(found, f'{self.session.folder.stem}.{name.value}.txt')
            with ui.element('div').classes('asked q-mt-sm'):
                loud('Show', show)
                quiet('Save', save)
