# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""How the page looks, and its pieces of HTML: text in, escaped text out."""

from __future__ import annotations

from collections.abc import Sequence
import math

import numpy as np

from .jobs import Answer, Candidate
from ..loop import verdict
from ..loop.diagnosis import Diagnosis
from ..loop.effect import Finding
from ..loop.prediction import State
from ..loop.study import Step
from ..plots.style import readable
from ..report import words
from ..report.markup import badge, bullets, escape

# the report's colours; a picture in the dark is turned as the report turns its own
STYLE = """
:root { --ink: #1f2d3d; --faint: #5d6b78; --line: #dfe4e8; --paper: #fff; --box: #f3f6f8;
  --bad: #b3261e; --good: #1a7f4b; --doubt: #8a5a00; --accent: #0072b2 }
body.body--dark { --ink: #e4e9ee; --faint: #9fadba; --line: #36424e; --paper: #14191f;
  --box: #1f272f; --bad: #ff8a80; --good: #6fd39b; --doubt: #f2bf5e; --accent: #6cb8e6 }
body.body--dark .plot { filter: invert(.92) hue-rotate(180deg) }
body { background: var(--paper) !important; color: var(--ink); font-size: 15px; line-height: 1.45 }
.nicegui-content { padding: 0; gap: 0; display: block }
.bar, .tabs, .asked, .hand-row { display: flex; flex-wrap: wrap; gap: .35rem; align-items: center }
.bar { padding: .5rem .9rem; border-bottom: 1px solid var(--line) }
.bar h1 { font-size: 1.05rem; line-height: 1.3; font-weight: 600; margin: 0 .8rem 0 0;
  overflow-wrap: anywhere }
.status { min-height: 2.1rem; padding: .3rem .9rem; background: var(--box);
  border-bottom: 1px solid var(--line); display: flex; gap: .8rem; align-items: center }
.status .q-linear-progress { max-width: 14rem }
.screen { display: grid; grid-template-columns: 17rem minmax(0, 1fr) 21rem;
  grid-template-areas: "ladder curve verdict"; align-items: start }
.ladder { grid-area: ladder } .curve { grid-area: curve } .verdict { grid-area: verdict }
.screen > * { padding: .7rem .9rem; min-width: 0 }
.curve { border-left: 1px solid var(--line); border-right: 1px solid var(--line) }
.plot { height: min(60vh, 34rem); min-height: 21rem; width: 100%; background: #fff }
h2 { font-size: 1rem; font-weight: 600; line-height: 1.3; margin: 1.1rem 0 .3rem }
section > :first-child > h2:first-child,
.verdict > :first-child > :first-child > h2:first-child { margin-top: 0 }
p { margin: .3rem 0; overflow-wrap: anywhere }
ul { margin: .3rem 0; padding-left: 1.1rem } li { overflow-wrap: anywhere; margin: .15rem 0 }
.small { font-size: .87rem } .faint { color: var(--faint) }
.good { color: var(--good); font-weight: 600 } .bad { color: var(--bad); font-weight: 600 }
.doubt { color: var(--doubt); font-weight: 600 }
.rung { margin: .45rem 0 } .rung .top { display: flex; justify-content: space-between; gap: .6rem }
.track { position: relative; height: .7rem; background: var(--box); border-radius: .2rem }
.track i { position: absolute; inset: 0 auto 0 0; min-width: 3px; border-radius: .2rem;
  background: currentColor }
.track b { position: absolute; top: -.2rem; bottom: -.2rem; width: 2px; background: var(--good) }
.effect { display: flex; justify-content: space-between; gap: .5rem; align-items: start;
  border-bottom: 1px solid var(--line); padding: .25rem 0 }
.effect > :first-child { min-width: 0; overflow-wrap: anywhere }
.card { border: 1px solid var(--line); border-radius: .4rem; padding: .5rem .7rem; margin: .5rem 0;
  width: 100% }
.q-btn { min-height: 2.1rem; font-size: .93rem; font-weight: 500; flex: none }
.tabs .q-btn { font-size: .87rem }
.tabs .q-btn[aria-pressed=true], .bar .q-btn[aria-pressed=true] {
  background: var(--accent); color: var(--paper) !important }
.q-btn.quiet { color: var(--ink) !important; border: 1px solid var(--line) }
.dot { width: .6rem; height: .6rem; border-radius: 50%; margin-right: .4rem;
  background: currentColor; display: inline-block }
[aria-pressed=true] .dot { outline: 2px solid var(--paper) }
.q-field { font-size: .93rem } .q-expansion-item { border-top: 1px solid var(--line) }
pre { background: var(--box); padding: .5rem; overflow-x: auto; font-size: .8rem;
  max-height: 22rem; margin: .4rem 0 }
.share { display: inline-block; height: .6rem; background: var(--accent); border-radius: .15rem;
  vertical-align: middle; margin-right: .4rem }
@media (max-width: 70rem) { .screen { grid-template-columns: 16rem minmax(0, 1fr);
  grid-template-areas: "curve curve" "ladder verdict" }
  .curve { border: 0; border-bottom: 1px solid var(--line) } }
@media (max-width: 45rem) { .screen { display: flex; flex-direction: column; align-items: stretch }
  .plot { height: 24rem } .verdict { order: 1 } .curve { order: 2 } .ladder { order: 3 }
  .screen > * { border: 0; border-bottom: 1px solid var(--line) } }
"""


def rungs(steps: Sequence[Step]) -> str:
    """
    Return the ladder of one target: a bar for the error of each model, what chance allows marked.

    Bars are linear below what chance allows and logarithmic beyond.

    """
    known = [s for s in steps if math.isfinite(s.held_out)]
    if not known:
        return '<p class="faint">not known: nothing was left to predict</p>'
    chance = max(float(np.median([words.CHANCE * s.held_out_std for s in known])), 1e-9)
    top = max(2.0, *(1.05 * s.held_out / chance for s in known))

    def width(error: float) -> float:
        return 100 * math.asinh(max(error, 0.0) / chance) / math.asinh(top)
    out = []
    for s in known:
        inside = verdict.within_chance(s.held_out, s.held_out_std) and not s.failing
        quality, limit = 'good' if inside else 'bad', words.CHANCE * s.held_out_std
        what = words.change(s) if s.added or s.removed else ' + '.join(s.effects) or '(nothing)'
        why = '; '.join(words.finding_in_words(f, s.target) for f in s.why)
        said = '' if s.verdict == 'start' else badge(s.verdict, 'small faint')
        out.append(
            f'<div class="rung" title="{escape(why)}"><div class="top"><span>{escape(what)}</span>'
            f'{badge(words.significant(s.held_out, least=2), quality)}</div>'
            f'<div class="track {quality}"><i style="width:{width(s.held_out):.1f}%"></i>'
            f'<b style="left:{width(limit):.1f}%"></b></div>{said}</div>')
    return ''.join(out)


def coefficients(state: State, target: str, label: str) -> str:
    """Return one effect of a model with its values."""
    effect = state.model[label]
    found = [f'{r.symbol} {r.shown}' + (f' ({r.interval})' if r.interval else '')
             for r in words.rows(state, target) if r.label == label]
    said = '<br>'.join(escape(readable(x)) for x in found)
    return (f'<div><b>{escape(label)}</b> {badge(effect.title, "small faint")}'
            f'<div class="small">{said}</div></div>')


def verdict_of(state: State, d: Diagnosis | None) -> str:
    """Return the verdict on a target and its error."""
    said, quality = words.verdict_in_words(state.error, d)
    side = 'good' if state.error.within_chance else 'bad' if state.error.failing else 'doubt'
    return (f'<p>{badge(said, quality)}</p><p class="small">Error on data not fitted: '
            f'{badge(words.error_in_words(state.error), side)}</p>')


def rest_of(d: Diagnosis | None, remarks: Sequence[str]) -> str:
    """Return what then still fails, the advice, and what else is to be said of the fit."""
    said = []
    if d is not None:
        rivals = [f for f in d.ranked if f.against and f.gain > f.penalty][:3]
        said += [f'Not {escape(f.name)}: {escape(f.against)}.' for f in rivals]
        left = words.remaining_in_words(d)
        said += [escape(left[:1].upper() + left[1:])] if left else []
        said += [escape(d.advice)] if d.advice else []
    said += [escape(s) for s in remarks]
    return bullets(said, 'small')


def found(f: Finding, target: str) -> str:
    """Return what was found, why, and what to check on the bench."""
    assert f.effect is not None
    sure = '' if f.probability is None else f', probability {f.probability:.2f}'
    part = '' if f.explains is None else f'It explains {words.percent(f.explains)} of what fails.'
    return (f'<b>{escape(f.name)}</b>{escape(sure)}<p class="small">{escape(f.effect.title)}: '
            f'{escape(words.parameters_of(f, target))}. {part}</p>'
            f'<p class="small">Evidence: {escape(f.evidence)}.</p>'
            f'<p class="small faint">{escape(f.effect.hint)}</p>')


def answer_of(answer: Answer) -> str:
    """Return what a stretch is: what makes it, and what fails there."""
    makes = ', '.join(f'{escape(k)} {100 * v:.0f} %' for k, v in answer.makes)
    out = f'<p>What the model has there: {makes} of the power.</p>' if makes else ''
    if answer.fails <= answer.chance:
        return out + (f'<p>{badge("Nothing stands out there", "good")}: measured and model differ '
                      'by no more than chance.</p>')
    near = answer.nearest
    if near is None:
        return out + f'<p>{badge("Something is there that no known effect explains", "bad")}.</p>'
    said = (f'Nearest comes {near.name}: it takes away {words.percent(near.share)} of what fails '
            'there')
    if not near.beyond_chance:
        said += ', but over the whole record chance would do as well' \
            if not near.against else f', but {near.against}'
    return out + f'<p>{badge(said, "bad" if near.beyond_chance else "doubt")}.</p>'


def candidate(c: Candidate) -> str:
    """Return one candidate of a stretch, its share as a bar."""
    doubt = c.against or ('' if c.gain > c.penalty else
                          f'gains {c.gain:.1f} nats, chance {c.penalty:.1f}')
    return (f'<div><span class="share" style="width:{4 * c.share:.2f}rem"></span>'
            f'<b>{escape(c.name)}</b> {100 * c.share:.0f} % '
            f'<span class="small faint">{escape(c.values)}</span>'
            + (f' <span class="small doubt">{escape(doubt)}</span>' if doubt else '') + '</div>')
