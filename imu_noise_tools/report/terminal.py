# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A study as text for a terminal: one block a target."""

from __future__ import annotations

from . import words
from ..loop.prediction import State
from ..loop.study import Study


def text(study: Study, folder: str | None = None, verbose: bool = False) -> str:
    """
    Return a study as plain text: coefficients, error on data not fitted, verdict, what is next.

    Parameters
    ----------
    study : Study
        Of any domain.
    folder : str or None
        Where it is kept, for the commands that are proposed; without it none are.
    verbose : bool
        Say also what each failure means, what was measured in full, and the other candidates.

    """
    blocks = [_head(study, verbose)] + [_target(study, t, verbose) for t in study.targets]
    if folder is not None and (steps := words.next_steps(study, folder)):
        blocks.append('\n'.join(f'next: {command}    {why}' for command, why in steps))
    return _clean('\n\n'.join(blocks))


def _head(study, verbose):
    known = words.source_rows(study.source)
    short = [value for key, value in known if key in ('file', 'topic', 'duration', 'rate')]
    lines = [f'{study.domain}: ' + ', '.join(short)] if short else [study.domain]
    if verbose:
        lines += [f'  {key}: {value}' for key, value in known]
    lines += [f'  warning: {w}' for w in study.source.get('warnings') or ()]
    return '\n'.join(lines)


def _target(study: Study, target: str, verbose: bool) -> str:
    state = study.states[target]
    lines = [f'{target}: {state.model}']
    lines += _coefficients(state, target)
    lines.append(f'  error on data not fitted: {words.error_in_words(state.error)}')
    for view in words.failing(state.error):
        lines.append('  fails in ' + (words.view_in_words(view) if verbose else
                     f'{words.title_of(view.name)}: {words.places_in_words(view, 1)}'))
    if verbose:
        lines += [f'  {said}' for said in words.summary_in_words(state.summary)]
    lines += [f'  note: {flag}' for flag in state.fit.flags]
    lines += _diagnosis(study.diagnosis.get(target), target, verbose)
    return '\n'.join(lines)


def _coefficients(state: State, target: str) -> list[str]:
    lines = [(r.label, r.symbol, r.shown, r.interval, r.note) for r in words.rows(state, target)]
    width = [max(map(len, column)) for column in zip(*lines)]
    return ['  ' + '  '.join(f'{c:<{w}}' for c, w in zip(line, width)).rstrip() for line in lines]


def _diagnosis(d, target, verbose):
    if d is None:
        return []
    lines = [f'  diagnosis: {words.diagnosis_in_words(d)}']
    shown = d.ranked if verbose else d.found
    for f in shown:
        said = '; '.join(s for s in (words.parameters_of(f, target), f.evidence) if s)
        lines.append(f'    {f.name}: {said}' if said else f'    {f.name}')
        if f.against:
            lines.append(f'      against it: {f.against}')
    if d.remaining is not None:
        lines.append(f'    {words.remaining_in_words(d)}')
    return lines + ([f'    advice: {d.advice}'] if d.advice else [])


def _clean(said: str) -> str:
    """Return text without control characters: what comes from a file must not steer a terminal."""
    return ''.join(c if c == '\n' or c.isprintable() else '?' for c in said)
