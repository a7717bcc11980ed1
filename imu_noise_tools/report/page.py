"""A study as one self-contained HTML page: no scripts, nothing loaded from elsewhere."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping
from html import escape
from pathlib import PurePath

from ..allan import dominant_shape
from ..study import Diagnosis, Study
from . import words
from .pictures import pictures as drawn

_STYLE = """
:root{--ink:#1f2d3d;--faint:#5d6b78;--line:#dfe4e8;--bad:#b3261e;--good:#1a7f4b;--doubt:#9a6700}
*{box-sizing:border-box}
body{font:16px/1.5 system-ui,-apple-system,"Segoe UI",Roboto,sans-serif;color:var(--ink);background:#fff;max-width:72rem;
margin:0 auto;padding:1rem}
h1{font-size:1.6rem;line-height:1.2;margin:.5rem 0}h2{font-size:1.25rem;margin:2.2rem 0 .5rem;border-top:2px solid var(--line);
padding-top:1rem}h3{font-size:1.05rem;margin:1.4rem 0 .3rem}
p,li{max-width:46rem}.faint{color:var(--faint)}.small{font-size:.87rem}
.wide{overflow-x:auto;-webkit-overflow-scrolling:touch}
table{border-collapse:collapse;font-size:.9rem;margin:.4rem 0 .8rem}
th,td{text-align:left;padding:.3rem .7rem .3rem 0;border-bottom:1px solid var(--line);vertical-align:top}
th{font-weight:600;color:var(--faint);white-space:nowrap}td.n{white-space:nowrap;font-variant-numeric:tabular-nums}
.bad{color:var(--bad);font-weight:600}.good{color:var(--good);font-weight:600}.doubt{color:var(--doubt);font-weight:600}
figure{margin:.8rem 0}figure img{max-width:100%;height:auto;border:1px solid var(--line)}
figcaption{font-size:.87rem;color:var(--faint);max-width:46rem}
code{background:#f1f4f6;padding:.1rem .35rem;border-radius:.25rem;overflow-wrap:anywhere}
.warn{border-left:4px solid #e0a800;padding:.1rem .8rem;background:#fff9e6}
"""
_TITLES = {'noise': 'Noise of an IMU at rest', 'calibration': 'Calibration of an IMU', 'filter': 'Innovations of a filter'}
_COLOURS = {'missing': 'bad', 'unknown': 'bad', 'undecidable': 'doubt', 'complete': 'good'}


def html(study: Study, pictures: Mapping[str, bytes] | None = None, extra: Iterable[tuple[str, bytes]] = (),
         folder: str = 'DIR') -> str:
    """
    Return a study as one HTML page that tells its story from top to bottom.

    Parameters
    ----------
    study : Study
        Of any domain.
    pictures : mapping of str to bytes, optional
        What :func:`pictures` gave, where it is at hand; drawn here otherwise.
    extra : iterable of (title, PNG bytes)
        Further pictures, shown after the model.
    folder : str
        Where the study is kept, for the commands that are proposed.

    """
    shown = dict(drawn(study) if pictures is None else pictures)
    name = PurePath(str(study.source.get('path') or '')).name
    title = _TITLES.get(study.domain, study.domain) + (f': {name}' if name else '')
    body = [f'<h1>{escape(title)}</h1>', _summary(study), _measured(study, shown), _model(study), _extra(extra), _curves(shown),
            _fails(study, shown), _missing(study, folder), _ladder(study, shown), _glossary(study)]
    return ('<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
            '<meta name="viewport" content="width=device-width, initial-scale=1">'
            f'<title>{escape(title)}</title><style>{_STYLE}</style></head>\n<body>\n'
            + '\n'.join(b for b in body if b) + '\n</body></html>\n')


def _table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a table; cells are HTML already."""
    first = ''.join(f'<th>{escape(h)}</th>' for h in head)
    rest = ''.join('<tr>' + ''.join(f'<td>{c}</td>' for c in row) + '</tr>' for row in rows)
    return f'<div class="wide"><table><thead><tr>{first}</tr></thead><tbody>{rest}</tbody></table></div>'


def _image(data: bytes, title: str, caption: str = '') -> str:
    coded = base64.b64encode(data).decode('ascii')
    said = f'<figcaption>{escape(caption)}</figcaption>' if caption else ''
    return f'<figure><img alt="{escape(title, quote=True)}" src="data:image/png;base64,{coded}">{said}</figure>'


def _badge(word: str, colour: str) -> str:
    return f'<span class="{colour}">{escape(word)}</span>'


def _error(error) -> str:
    return _badge(words.error_in_words(error), 'good' if error.within_chance else 'bad')


def _summary(study: Study) -> str:
    rows = []
    for t in study.targets:
        d = study.diagnosis.get(t)
        verdict = _badge(words.diagnosis_in_words(d), _COLOURS.get(d.verdict, '')) if d else \
            '<span class="faint">not asked yet</span>'
        rows.append((f'<b>{escape(t)}</b>', escape(' + '.join(study.states[t].model.labels)), _error(study.states[t].error), verdict))
    return _table(('', 'model', 'error on data not fitted', 'diagnosis'), rows)


def _measured(study: Study, shown) -> str:
    out = ['<h2>What was measured</h2>']
    known = words.source_rows(study.source)
    if known:
        out.append(_table(('', ''), ((escape(a), escape(b)) for a, b in known)))
    warnings = list(study.source.get('warnings') or ())
    if warnings:
        out.append('<div class="warn"><ul>' + ''.join(f'<li>{escape(str(w))}</li>' for w in warnings) + '</ul></div>')
    elif known:
        out.append('<p class="faint">No warnings.</p>')
    if 'series' in shown:
        out.append(_image(shown['series'], 'time series', 'Smallest to largest sample (coloured) and block means (dark line) of each '
                                                         'axis; an orange line is what the model says of the mean. Grey: left out.'))
    for begin, end, *why in study.source.get('left_out') or ():
        reason = escape(' '.join(str(w) for w in why))
        out.append(f'<p class="small">Left out: {begin:.6g} s to {end:.6g} s {reason}</p>')
    return '\n'.join(out)


def _model(study: Study) -> str:
    out = ['<h2>What the model says</h2>']
    for t in study.targets:
        state = study.states[t]
        out.append(f'<h3>{escape(t)}: {escape(" + ".join(state.model.labels) or "(nothing)")}</h3>')
        rows = [(escape(r.label), f'<b>{escape(r.symbol)}</b> <span class="faint">{escape(r.title)}</span>', _nowrap(r.shown),
                 _nowrap(r.interval), _nowrap(r.si), escape(r.note)) for r in words.rows(state, t)]
        out.append(_table(('effect', 'coefficient', 'value', '95 % interval or limit', 'SI, ± std', 'note'), rows))
        said = []
        if study.domain == 'noise':
            said.append(dominant_shape(state.problem.evidence.curve))
            said.append(words.misfit(state.summary))
        else:
            said += [f'{k.replace("_", " ")}: {v:.4g}' for k, v in state.summary.items()]
        said += list(state.fit.flags)
        out += [f'<p class="small">{escape(s)}.</p>' for s in said if s]
    return '\n'.join(out)


def _nowrap(text: str) -> str:
    return f'<span style="white-space:nowrap">{escape(text)}</span>'


def _extra(extra) -> str:
    return '\n'.join(f'<h3>{escape(title)}</h3>' + _image(data, title) for title, data in extra)


def _curves(shown) -> str:
    if 'allan' not in shown:
        return ''
    return '<h2>Allan deviation</h2>' + _image(
        shown['allan'], 'Allan deviation of all axes',
        'Dark: measured, with its 95 % band. Orange: the model, the sum of its effects; dashed: each effect alone. Circles: where '
        'coefficients are read (N at 1 s, K at 3 s, 0.664 B on the flat part). Below each curve its pull: measured less model in '
        'standard errors. Red: more than chance explains.')


def _fails(study: Study, shown) -> str:
    names = list(dict.fromkeys(v for t in study.targets for v in study.states[t].error.views))
    out = ['<h2>Where the model fails</h2>']
    rows = []
    for t in study.targets:
        views = study.states[t].error.views
        rows.append([f'<b>{escape(t)}</b>', *(_excess(views[n]) if n in views else '' for n in names)])
    out.append(_table(('', *(words.VIEWS.get(n, (n, ''))[0] for n in names)), rows))
    out.append('<p class="small faint">Each number is the excess over what a true model would show on data it was not fitted to, '
               'in parentheses its chance scatter. 0 is as good as the truth.</p>')
    items = [f'<li><b>{escape(t)}</b>, {escape(words.view_in_words(v))}.</li>'
             for t in study.targets for v in words.failing(study.states[t].error)]
    out.append(f'<ul>{"".join(items)}</ul>' if items else '<p class="good">Nowhere: every view is within chance.</p>')
    for name, data in shown.items():
        if name.startswith('target '):
            target = name.removeprefix('target ')
            out.append(f'<h3>{escape(target)} in full</h3>' + _image(
                data, f'{target} in full', 'Allan deviation and spectrum with their pulls; the time series; the rms of the noise in '
                'time; how many samples lie where a normal distribution has equally many. Grey: what chance allows, but for one '
                'point of a thousand.'))
    return '\n'.join(out)


def _excess(view) -> str:
    colour = 'bad' if view.excess > words.DOUBT * view.std else 'doubt' if view.excess > 2 * view.std else 'good'
    return f'{_badge(f"{view.excess:.2g}", colour)} <span class="faint">({view.std:.2g})</span>'


def _missing(study: Study, folder: str) -> str:
    out = ['<h2>What is missing, and why we think so</h2>']
    for t in study.targets:
        d = study.diagnosis.get(t)
        if d:
            out.append(_one_diagnosis(t, d))
    if not study.diagnosis:
        out.append('<p>Not asked yet.</p>')
    steps = words.next_steps(study, folder)
    if steps:
        out.append('<h3>What to run next</h3><ul>' + ''.join(
            f'<li><code>{escape(command)}</code> {escape(why)}</li>' for command, why in steps) + '</ul>')
    return '\n'.join(out)


def _one_diagnosis(target: str, d: Diagnosis) -> str:
    said = f'{d.verdict}: {words.VERDICTS.get(d.verdict, "")}'
    out = [f'<h3>{escape(target)}: {_badge(said, _COLOURS.get(d.verdict, ""))}</h3>']
    if d.ranked:
        rows = [(f'<b>{escape(f.name)}</b>', '' if f.probability is None else f'{f.probability:.2g}', f'{f.gain:.1f}', f'{f.penalty:.1f}',
                 escape(words.parameters_of(f, target)), escape(f.evidence)) for f in d.ranked]
        out.append(_table(('candidate', 'probability', 'gain, nats', 'what chance gives', 'it would be', 'evidence'), rows))
    if d.failed:
        out.append('<ul>' + ''.join(f'<li>test of {escape(words.VIEWS.get(f.name, (f.name, ""))[0])} fails (p = {f.p_value:.1g}): '
                                    f'{escape(f.evidence)}</li>' for f in d.failed) + '</ul>')
    best = d.ranked[0].effect if d.ranked and d.verdict in ('missing', 'undecidable') else None
    if best is not None:
        out.append(f'<p><b>{escape(best.name)}</b>, {escape(best.title)}. Signature: {escape(best.signature)}. '
                   f'{escape(best.hint)}</p>')
    if d.advice:
        out.append(f'<p>{escape(d.advice)}</p>')
    return '\n'.join(out)


def _ladder(study: Study, shown) -> str:
    if not study.history:
        return ''
    out = ['<h2>What happened when effects were added</h2>']
    if 'ladder' in shown:
        out.append(_image(shown['ladder'], 'error against effects added',
                          'The error on data that the fit has not seen, model after model. In the green band it is as good as a true '
                          'model could do. An effect that is really there makes it fall; one that is not there does not.'))
    rows = []
    for s in study.history:
        change = f'+ {s.added}' if s.added else f'− {s.removed}' if s.removed else 'start'
        inside = s.held_out <= 2 * s.held_out_std
        rows.append((escape(s.target), escape(change), escape(' + '.join(s.effects)),
                     f'{_badge(f"{s.held_out:.3g}", "good" if inside else "bad")} <span class="faint">(chance: up to '
                     f'{2 * s.held_out_std:.2g})</span>', escape(s.verdict)))
    out.append(_table(('target', 'change', 'model', 'error on data not fitted', 'the error'), rows))
    return '\n'.join(out)


def _glossary(study: Study) -> str:
    found = {e.name: e for t in study.targets for e in study.states[t].model}
    items = ''.join(f'<li><b>{escape(e.name)}</b> ({escape(e.symbol)}), {escape(e.title)}: {escape(e.equation)}. '
                    f'{escape(e.hint)} <span class="faint">{escape(e.reference)}</span></li>' for e in found.values())
    return f'<h2>The effects in the model</h2><ul class="small">{items}</ul>' if items else ''
