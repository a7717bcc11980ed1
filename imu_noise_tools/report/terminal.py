"""A study as text for a terminal: one block a target."""

from __future__ import annotations

from ..study import State, Study
from . import words


def text(study: Study, folder: str = 'DIR') -> str:
    """
    Return a study as plain text: coefficients, error on data not fitted, verdict, and what to run next.

    Parameters
    ----------
    study : Study
        Of any domain.
    folder : str
        Where it is kept, for the commands that are proposed.

    """
    blocks = [_head(study)] + [_target(study, t) for t in study.targets]
    steps = words.next_steps(study, folder)
    if steps:
        blocks.append('\n'.join(['next'] + [f'  {command}    {why}' for command, why in steps]))
    return '\n\n'.join(b for b in blocks if b) + '\n'


def _head(study):
    said = dict(words.source_rows(study.source))
    first = '  '.join(said[k] for k in ('file', 'topic', 'samples', 'rate', 'duration') if k in said)
    lines = [f'{study.domain}  {first}'.rstrip()]
    lines += [f'  warning: {w}' for w in study.source.get('warnings') or ()]
    return _clean('\n'.join(lines))


def _target(study: Study, target: str) -> str:
    state = study.states[target]
    lines = [f'{target}: {" + ".join(state.model.labels) or "(nothing)"}']
    lines += _coefficients(state, target)
    lines.append(f'  error on data not fitted: {words.error_in_words(state.error)}')
    lines += [f'    {words.view_in_words(v)}' for v in words.failing(state.error)]
    lines += [f'  note: {flag}' for flag in state.fit.flags]
    d = study.diagnosis.get(target)
    if d:
        lines.append(f'  diagnosis: {words.diagnosis_in_words(d)}')
        best = d.ranked[0] if d.ranked and d.verdict == 'missing' else None
        if best:
            said = '; '.join(s for s in (words.parameters_of(best, target), best.evidence) if s)
            lines += [f'    {said}'] if said else []
        if d.advice:
            lines.append(f'    advice: {d.advice}')
    return _clean('\n'.join(lines))


def _coefficients(state: State, target: str) -> list[str]:
    rows = words.rows(state, target)
    if not rows:
        return []
    wide = [max(len(getattr(r, k)) for r in rows) for k in ('label', 'symbol', 'shown')]
    return [f'  {r.label:<{wide[0]}}  {r.symbol:<{wide[1]}}  {r.shown:<{wide[2]}}  '
            f'{r.interval}{"  " + r.note if r.note else ""}'.rstrip() for r in rows]


def _clean(text_: str) -> str:
    """Return text without control characters: what comes from a file must not steer a terminal."""
    return ''.join(c if c == '\n' or c.isprintable() else '?' for c in text_)
