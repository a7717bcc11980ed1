# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A study as one self-contained HTML page: no scripts, nothing loaded from elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import PurePath
from typing import Any

from . import words
from .markup import badge, bullets, cell, escape, image, page, table
from .pictures import pictures as drawn
from ..loop.diagnosis import Diagnosis
from ..loop.domains import package
from ..loop.effect import Score
from ..loop.study import Study

_COLOURS = {'missing': 'bad', 'unknown': 'bad', 'undecidable': 'doubt', 'complete': 'good'}
_TOGETHER = {'poses': ('Poses', 'residuals and directions of the poses'),
             'innovations': ('Innovations', 'innovations of all axes'),
             'allan': ('Allan deviation', 'Allan deviation of all axes')}
_CAPTIONS = {
    'series': 'Coloured: from the smallest to the largest sample of each column. Dark line: '
              'block means. Orange line: what the model says of the mean. Grey: left out.',
    'allan': 'Dark: measured, with its 95 % band. Orange: the model, the sum of its effects; '
             'dashed: each effect alone, in parentheses where this record cannot show it. '
             'Circles: where coefficients are read (N at 1 s, K at 3 s, 0.664 B on the flat '
             'part). Below each curve its pull, measured less model in standard errors. Red: more '
             'than chance explains.',
    'target': 'Allan deviation and spectrum with their pulls; the time series; the rms of the '
              'noise in time; how many samples lie where a normal distribution has equally many. '
              'Grey in the lower row: all but one point of a thousand lie there by chance.',
    'poses': 'Residual of each pose, shaded where the other poses predict something else; the '
             'directions covered; the errors before and after the calibration.',
    'innovations': 'What the model did not foresee, in its own standard deviations, axis by axis: '
                   'independent and normal if the model is right. Then the dots fill the green '
                   'band, and nothing sticks out of the other three beyond chance.',
    'ladder': 'The error on data that the fit has not seen, model after model. In the green band '
              'it is as good as a true model could do. An effect that is really there makes it '
              'fall; one that is not there does not.'}


def html(study: Study, pictures: Mapping[str, bytes] | None = None,
         folder: str = 'DIR') -> str:
    """
    Return a study as one HTML page that tells its story from top to bottom.

    Parameters
    ----------
    study : Study
        Of any domain.
    pictures : mapping of str to bytes, optional
        What :func:`~imu_noise_tools.report.pictures` gave, where it is at hand; else drawn here.
    folder : str
        Where the study is kept, for the commands that are proposed.

    """
    shown = dict(drawn(study) if pictures is None else pictures)
    name = PurePath(str(study.source.get('path') or '')).name
    title = package(study.domain).TITLE + (f': {name}' if name else '')
    return page(title, [
        _summary(study), _measured(study, shown), _model(study),
        _curves(shown),
        _fails(study, shown), _missing(study), _next(study, folder), _ladder(study, shown),
        _effects(study)])


def overview(study: Study) -> str:
    """Return a study as a piece of HTML, for a notebook: verdicts and coefficients, no picture."""
    return f'<div>{_summary(study)}{_model(study)}</div>'


def _summary(study: Study) -> str:
    rows = []
    for t, state in study.states.items():
        d = study.diagnosis.get(t)
        verdict = badge(words.diagnosis_in_words(d), _COLOURS.get(d.verdict, 'faint')) if d else \
            badge('not asked yet', 'faint')
        rows.append((_bold(t), _error(state.error), verdict, escape(repr(state.model))))
    return table(('', words.ERROR, 'diagnosis', 'model'), rows)


def _bold(text: str) -> str:
    return f'<b>{escape(text)}</b>'


def _error(error: Any) -> str:
    return badge(words.error_in_words(error), 'good' if error.within_chance else 'bad')


def _measured(study: Study, shown: Mapping[str, Any]) -> str:
    out = ['<h2>What was measured</h2>']
    known = words.source_rows(study.source)
    if known:
        out.append(table((), ((badge(a, 'faint'), escape(b)) for a, b in known)))
    said = [*(study.source.get('warnings') or ()), *(study.source.get('notes') or ())]
    said += words.disturbed_in_words(study.source)
    if said:
        out.append(f'<div class="warn">{bullets(escape(str(w)) for w in said)}</div>')
    if 'series' in shown:
        out.append(image(shown['series'], 'time series', _CAPTIONS['series']))
    return '\n'.join(out)


def _model(study: Study) -> str:
    out = ['<h2>What the model says</h2>']
    for t, state in study.states.items():
        out.append(f'<h3>{escape(t)}: {escape(repr(state.model))}</h3>')
        out.append(table(
            ('effect', 'coefficient', 'value', '95 % interval or limit', 'SI, ± std', 'note'),
            ((escape(r.label), f'{_bold(r.symbol)} {badge(r.title, "faint")}', cell(r.shown),
              cell(r.interval), cell(r.si), escape(r.note)) for r in words.rows(state, t))))
        said = [*(state.problem.remarks(state.fit) if state.problem else ()),
                *words.summary_in_words(state.summary), *state.fit.flags]
        out.append(bullets((escape(s) for s in said), 'small'))
    return '\n'.join(out)


def _curves(shown: Mapping[str, Any]) -> str:
    """Return the pictures of all targets together, whichever the domain has."""
    return ''.join(f'<h2>{head}</h2>' + image(shown[name], what, _CAPTIONS[name])
                   for name, (head, what) in _TOGETHER.items() if name in shown)


def _fails(study: Study, shown: Mapping[str, Any]) -> str:
    names = list(dict.fromkeys(n for s in study.states.values() for n in s.error.views))
    if not names:
        return ''
    out = ['<h2>Where the model fails</h2>',
           table(('', *(words.title_of(n) for n in names)),
                 ((_bold(t), *(_excess(s.error, n) for n in names))
                  for t, s in study.states.items())),
           '<p class="small faint">Each number is what the model loses, per bin, against a true '
           'model on data it was not fitted to; in parentheses what chance makes of it (one '
           'standard deviation). 0 is as good as the truth.</p>']
    items = [f'{_bold(t)}, {escape(words.view_in_words(v))}.' for t, s in study.states.items()
             for v in words.failing(s.error)]
    out.append(bullets(items) if items else
               '<p class="good">Nowhere: every view is within chance.</p>')
    for name, data in shown.items():
        if name.startswith('target '):
            title = f'{name.removeprefix("target ")} in full'
            out.append(f'<h3>{escape(title)}</h3>' + image(data, title, _CAPTIONS['target']))
    return '\n'.join(out)


def _excess(error: Score, name: str) -> str:
    view = error.views.get(name)
    if view is None:
        return ''
    colour = 'bad' if view in words.failing(error) else 'good'
    return f'{badge(f"{view.excess:.2g}", colour)} {badge(f"({view.std:.2g})", "faint")}'


def _missing(study: Study) -> str:
    out = ['<h2>What is missing, and why we think so</h2>']
    out += [_diagnosis(t, study.diagnosis[t]) for t in study.targets if t in study.diagnosis]
    return '\n'.join(out) if study.diagnosis else out[0] + '<p>Not asked yet.</p>'


def _diagnosis(target: str, d: Diagnosis) -> str:
    said = f'{d.verdict}: {words.VERDICTS.get(d.verdict, "")}'
    out = [f'<h3>{escape(target)}: {badge(said, _COLOURS.get(d.verdict, "faint"))}</h3>']
    if d.ranked:
        out.append(table(
            ('candidate', 'probability', 'gain, nats', 'by chance', 'it would be', 'evidence'),
            ((_bold(f.name), '' if f.probability is None else f'{f.probability:.2g}',
              f'{f.gain:.1f}', f'{f.penalty:.1f}', escape(words.parameters_of(f, target)),
              escape(f'{f.evidence}; against it: {f.against}' if f.against else f.evidence))
             for f in d.ranked)))
    out.append(bullets(escape(words.failed_in_words(f)) for f in d.failed))
    if d.remaining is not None:
        out.append(f'<p>{escape(words.remaining_in_words(d))}</p>')
    best = d.ranked[0].effect if d.ranked and d.verdict in ('missing', 'undecidable') else None
    if best is not None:
        out.append(f'<p>{_bold(best.name)}, {escape(best.title)}. Signature: '
                   f'{escape(best.signature)}. {escape(best.hint)}</p>')
    if d.advice:
        out.append(f'<p>{escape(d.advice)}</p>')
    return '\n'.join(out)


def _next(study: Study, folder: str) -> str:
    steps = words.next_steps(study, folder)
    if not steps:
        return ''
    return '<h3>What to run next</h3>' + bullets(
        f'<code>{escape(command)}</code> {escape(why)}' for command, why in steps)


def _ladder(study: Study, shown: Mapping[str, Any]) -> str:
    if not any(s.added or s.removed for s in study.history):
        return ''
    out = ['<h2>What happened when effects were added</h2>']
    if 'ladder' in shown:
        out.append(image(shown['ladder'], 'error against effects added', _CAPTIONS['ladder']))
    order = {t: i for i, t in enumerate(study.targets)}
    rows = []
    for s in sorted(study.history, key=lambda s: order.get(s.target, 0)):
        limit = words.CHANCE * s.held_out_std
        error = badge(f'{s.held_out:.3g}', 'good' if s.held_out <= limit else 'bad')
        rows.append((escape(s.target), cell(words.change(s)), escape(' + '.join(s.effects)),
                     f'{error} {badge(f"(chance: up to {limit:.2g})", "faint")}',
                     escape(s.verdict)))
    out.append(table(('target', 'change', 'model', words.ERROR, 'the error'), rows))
    return '\n'.join(out)


def _effects(study: Study) -> str:
    found = {e.name: e for s in study.states.values() for e in s.model}
    return '<h2>The effects in the model</h2>' + bullets(
        (f'{_bold(e.name)} ({escape(e.symbol)}), {escape(e.title)}: {escape(e.equation)}. '
         f'{escape(e.hint)} {badge(e.reference, "faint")}' for e in found.values()), 'small')
