# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A study as one self-contained HTML page: nothing is loaded from elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import PurePath
from typing import Any

from . import words
from .markup import badge, bullets, cell, copied, escape, folded, image, page, table
from .pictures import nearest, new_labels, pictures as drawn, rung
from .. import export
from ..loop.diagnosis import Diagnosis
from ..loop.domains import package
from ..loop.effect import Effect, Score
from ..loop.study import Step, Study
from ..plots.style import small_png

MOST_BYTES = 700_000     # of pictures as they are; beyond that in few colours
_TOGETHER = {'poses': ('Poses', 'residuals and directions of the poses'),
             'innovations': ('Innovations', 'innovations of all axes'),
             'allan': ('Allan deviation', 'Allan deviation of all axes')}
_CAPTIONS = {
    'series': 'Coloured: from the smallest to the largest sample of each column. Dark line: '
              'block means. Orange line: what the model says of the mean. Grey: left out.',
    'allan': 'Dark: measured, with its 95 % band. Orange: the model, the sum of its effects; '
             'dashed: each effect alone, in parentheses where this record cannot show it. '
             'Circles: where coefficients are read (N at 1 s, K at 3 s, 0.664 B on the flat '
             'part). Below each curve its pull, measured minus model in standard errors. Red: '
             'more than chance explains.',
    'target': 'Allan deviation and spectrum with their pulls; the time series; the rms of the '
              'noise in time; how many samples lie where a normal distribution has equally many. '
              'Grey in the lower row: all but one point of a thousand lie there by chance.',
    'poses': 'Residual of each pose, shaded where the other poses predict something else (of '
             'turns and rests, how many times as large as noise alone makes it); the directions '
             'covered; the errors before and after the calibration.',
    'innovations': 'What the model did not foresee, in its own standard deviations, axis by axis: '
                   'independent and normal if the model is right. Then the dots fill the green '
                   'band, and nothing sticks out of the other three beyond chance.',
    'ladder': 'The error on data that the fit has not seen, model after model. In the green band '
              'it is as good as a true model could do. An effect that is really there makes it '
              'fall; one that is not there does not.'}


_PROOF = ('Measured on the whole record, beside the model without {0} and with it. Below: what '
          'either leaves, measured minus model in standard errors; grey is chance, red what '
          'chance does not explain.')


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
    if sum(map(len, shown.values())) > MOST_BYTES:
        shown = {k: small_png(v) if v else v for k, v in shown.items()}
    name = PurePath(str(study.source.get('path') or '')).name
    title = package(study.domain).TITLE + (f': {name}' if name else '')
    return page(title, [
        _summary(study), _numbers(study), _recording(study), _next(study, folder),
        '<h2>Axis by axis</h2>' if len(study.states) > 1 else '',
        *(_target(study, t, shown) for t in study.targets),
        _ladder(shown), _curves(shown), _views(study), _measured(study, shown),
        _effects(study), _glossary()])


def overview(study: Study) -> str:
    """Return a study as a piece of HTML, for a notebook: verdicts and coefficients, no picture."""
    each = ''.join(f'<h3>{escape(t)}</h3>{_coefficients(study, t)}' for t in study.targets)
    return f'<div>{_summary(study)}{each}</div>'


# --- what people came for ------------------------------------------------------------------------

def _summary(study: Study) -> str:
    rows = []
    for t, state in study.states.items():
        said, quality = words.verdict_in_words(state.error, study.diagnosis.get(t))
        rows.append((_bold(t), badge(said, quality), _error(state.error),
                     escape(' + '.join(state.model.labels))))
    return table(('', 'verdict', words.ERROR, 'model'), rows)


def _numbers(study: Study) -> str:
    """Return the numbers for an estimator, to be copied, where the domain has such a file."""
    name = package(study.domain).NUMBERS
    if not name:
        return ''
    text = export.export(study, name)
    lines = [line for line in text.splitlines() if not line.startswith('#')]
    rests = [line.lstrip('# ') for line in text.splitlines() if line.startswith('#')]
    return (f'<h2>For {escape(name.capitalize())}</h2>' + copied('\n'.join(lines))
            + folded('what these numbers rest on', bullets(map(escape, rests), 'small'), False))


def _recording(study: Study) -> str:
    """Return whether the recording is good."""
    said = [*(study.source.get('warnings') or ()), *(study.source.get('notes') or ())]
    said += words.disturbed_in_words(study.source)
    out = '<h2>The recording</h2>' + f'<p>{escape(words.recording_in_words(study.source))}</p>'
    if said:
        return out + f'<div class="warn">{bullets(escape(str(w)) for w in said)}</div>'
    return out + f'<p>{badge(package(study.domain).UNDISTURBED, "good")}</p>'


def _bold(text: str) -> str:
    return f'<b>{escape(text)}</b>'


def _error(error: Any) -> str:
    quality = 'good' if error.within_chance else 'bad' if error.failing else 'doubt'
    return badge(words.error_in_words(error), quality)


# --- the story of each axis ----------------------------------------------------------------------

def _target(study: Study, target: str, shown: Mapping[str, Any]) -> str:
    """Return one axis: how its model came about, what it says, where it fails, what is missing."""
    state, d = study.states[target], study.diagnosis.get(target)
    said, quality = words.verdict_in_words(state.error, d)
    done = quality == 'good'
    parts = [_rungs(study, target, shown), _coefficients(study, target)]
    if failing := words.failing(state.error):
        parts.append('<h4>Where the model fails</h4>' + bullets(
            f'{escape(words.view_in_words(v))}.' for v in failing))
    if d is not None:
        parts.append(_diagnosis(target, d, shown))
    full = shown.get(f'target {target}')
    if full is not None:
        parts.append(image(full, f'{target} in full',
                           _CAPTIONS['poses' if 'poses' in shown else 'target']))
    added = [s.added for s in study.history if s.target == target and s.added]
    story = badge(f'after adding {", then ".join(added)}', 'faint') if added else ''
    return folded(f'{_bold(target)} {badge(said, quality)} {story}', '\n'.join(parts),
                  not done or len(study.states) == 1)


def _rungs(study: Study, target: str, shown: Mapping[str, bytes]) -> str:
    """Return what was added and removed, why, and what it changed."""
    steps = [s for s in study.history if s.target == target]
    out = [_rung(before, step, shown) for before, step in zip(steps, steps[1:])]
    return '<h4>What happened when effects were added</h4>' + '\n'.join(out) if out else ''


def _rung(before: Step, step: Step, shown: Mapping[str, bytes]) -> str:
    change = words.change(step)
    out = [f'<p>{_bold(change)}: {words.ERROR} {before.held_out:.3g} to {step.held_out:.3g} '
           f'{badge(f"(chance: up to {words.CHANCE * step.held_out_std:.2g})", "faint")}, '
           f'{escape(step.verdict)}.</p>']
    told = []
    if before.failing:
        told.append('Before it the model failed in: '
                    + escape(', '.join(map(words.title_of, before.failing))) + '.')
    for f in step.why:
        told.append('Why: ' + escape(words.finding_in_words(f, step.target)) + '.')
        if f.effect is not None:
            told.append(_physics(f.effect))
    if step.failing:
        told.append('What fails with it: '
                    + escape(', '.join(map(words.title_of, step.failing))) + '.')
    out.append(bullets(told))
    labels = '+'.join(new_labels(before, step))
    full = shown.get(f'added {step.target} {labels}')
    if full is not None:
        out.append(image(full, f'{step.target}: measured, and the model without and with {labels}',
                         _PROOF.format(labels)))
    elif step.contrast is not None:
        out.append(image(
            rung(before, step), f'{step.target}: pulls before and after {change}',
            f'{words.title_of(step.contrast.view).capitalize()}, on data that neither model was '
            'fitted to: measured minus model in standard errors, before and after. Grey: chance. '
            'Red: more than chance explains.'))
    return '\n'.join(out)


def _probability(p: float | None) -> str:
    return '' if p is None else f'{p:.2g}' if p >= 0.001 else escape('< 0.001')


def _sentence(text: str) -> str:
    """Return a hint as a sentence, with which it begins and ends."""
    said = text[:1].upper() + text[1:]
    return said if said.endswith(('.', '!', '?')) else said + '.'


def _physics(effect: Effect) -> str:
    hint = f' {_sentence(effect.hint)}' if effect.hint else ''
    return escape(f'Physically: {effect.title}. Signature: {effect.signature}.{hint}')


def _coefficients(study: Study, target: str) -> str:
    state = study.states[target]
    out = f'<h4>What the model says: {escape(" + ".join(state.model.labels))}</h4>' + table(
        ('effect', 'coefficient', 'value', '95 % interval or limit', 'SI, ± std', 'note'),
        ((escape(r.label), f'{_bold(r.symbol)} {badge(r.title, "faint")}', cell(r.shown),
          cell(r.interval), cell(r.si), escape(r.note)) for r in words.rows(state, target)))
    said = [*(state.problem.remarks(state.fit) if state.problem else ()),
            *words.summary_in_words(state.summary), *state.fit.flags]
    return out + bullets((escape(s) for s in said), 'small')


# --- what they share -----------------------------------------------------------------------------

def _measured(study: Study, shown: Mapping[str, Any]) -> str:
    out = ['<h2>What was measured</h2>']
    known = words.source_rows(study.source)
    if known:
        out.append(table((), ((badge(a, 'faint'), escape(b)) for a, b in known)))
    if 'series' in shown:
        out.append(image(shown['series'], 'time series', _CAPTIONS['series']))
    return '\n'.join(out)


def _curves(shown: Mapping[str, Any]) -> str:
    """Return the pictures of all targets together, whichever the domain has."""
    return ''.join(f'<h2>{head}</h2>' + image(shown[name], what, _CAPTIONS[name])
                   for name, (head, what) in _TOGETHER.items() if name in shown)


def _views(study: Study) -> str:
    names = list(dict.fromkeys(n for s in study.states.values() for n in s.error.views))
    if not names:
        return ''
    return '\n'.join([
        '<h2>Where the models fail, view by view</h2>',
        table(('', *(words.title_of(n) for n in names)),
              ((_bold(t), *(_excess(s.error, n) for n in names))
               for t, s in study.states.items())),
        '<p class="small faint">Each number is what the model loses, per bin, against a true '
        'model on data it was not fitted to; in parentheses what chance makes of it (one '
        'standard deviation). 0 is as good as the truth.</p>'])


def _excess(error: Score, name: str) -> str:
    view = error.views.get(name)
    if view is None:
        return ''
    colour = 'bad' if view in words.failing(error) else 'good'
    return f'{badge(f"{view.excess:.2g}", colour)} {badge(f"({view.std:.2g})", "faint")}'


def _diagnosis(target: str, d: Diagnosis, shown: Mapping[str, bytes]) -> str:
    said = f'{d.verdict}: {words.VERDICTS.get(d.verdict, "")}'
    out = ['<h4>What is missing, and why we think so</h4>',
           f'<p>{badge(said, words.QUALITY.get(d.verdict, "faint"))}</p>']
    if d.ranked:
        out.append(table(
            ('candidate', 'probability', 'gain, nats', 'by chance', 'it would be', 'evidence'),
            ((_bold(f.name), _probability(f.probability),
              f'{f.gain:.1f}', f'{f.penalty:.1f}', escape(words.parameters_of(f, target)),
              escape(f'{f.evidence}; against it: {f.against}' if f.against else f.evidence))
             for f in d.ranked)))
    if d.remaining is None or d.remaining.failed != d.failed:       # else they are said below
        out.append(bullets(escape(words.failed_in_words(f)) for f in d.failed))
    for name in dict.fromkeys(f.name for f in d.found or d.ranked[:1]):
        full = shown.get(f'found {target} {name}')
        if full is not None:
            out.append(image(full, f'{target}: measured, and the model without and with {name}',
                             _PROOF.format(name)))
    if d.remaining is not None:
        out.append(f'<p>{escape(words.remaining_in_words(d))}</p>')
    full = shown.get(f'unexplained {target}')
    if full is not None:
        near = nearest(d)
        out.append(image(full, f'{target}: where no known effect explains what was measured', (
            f'{_PROOF.format(near.name)} {near.name} comes nearest, and was rejected: '
            f'{near.against}.' if near else 'Where the model fails: nothing known comes near.')))
    best = d.ranked[0].effect if d.ranked and d.verdict in ('missing', 'undecidable') else None
    if best is not None:
        out.append(f'<p>{_bold(best.name)}. {_physics(best)}</p>')
    if d.advice and not (best is not None and best.hint and best.hint in d.advice):
        out.append(f'<p>{escape(_sentence(d.advice))}</p>')
    return '\n'.join(out)


def _next(study: Study, folder: str) -> str:
    steps = words.next_steps(study, folder)
    if not steps:
        return ''
    return '<h2>What to run next</h2>' + bullets(
        f'<code>{escape(command)}</code> {escape(why)}' for command, why in steps)


def _ladder(shown: Mapping[str, Any]) -> str:
    if 'ladder' not in shown:
        return ''
    return ('<h2>The ladder</h2>'
            + image(shown['ladder'], 'error against effects added', _CAPTIONS['ladder']))


def _effects(study: Study) -> str:
    found = {e.name: e for s in study.states.values() for e in s.model}
    return '<h2>The effects in the model</h2>' + bullets(
        (f'{_bold(e.name)} ({escape(e.symbol)}), {escape(e.title)}: {escape(e.equation)}. '
         f'{escape(e.hint)} {badge(e.reference, "faint")}' for e in found.values()), 'small')


def _glossary() -> str:
    said = ''.join(f'<dt>{escape(name)}</dt><dd>{escape(meaning)}</dd>\n'
                   for name, meaning in words.GLOSSARY.items())
    return f'<h2>The words of this page</h2>\n<dl class="small">\n{said}</dl>'
