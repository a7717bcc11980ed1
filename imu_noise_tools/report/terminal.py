# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A study as text for a terminal: what the commands of the loop print, one block a target."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import zip_longest
import math
import shutil
import textwrap
from typing import Any

from . import words
from ..loop.diagnosis import Diagnosis
from ..loop.prediction import State
from ..loop.study import Step, Study

WIDTH = 100
ENDLESS = 1 << 20       # columns, where it is no terminal
NARROWEST = 10          # of a column of a table
MOST_DISTURBED = 5      # stretches that are listed without -v


def text(study: Study, folder: str | None = None, verbose: bool = False,
         si: bool = False) -> str:
    """
    Return a study as plain text: coefficients, held-out deviance, verdict, what is next.

    Parameters
    ----------
    study : Study
        Of any domain.
    folder : str or None
        Where it is kept, for the commands that are proposed; without it none are.
    verbose : bool
        Say also what each failure means, what was measured in full, and the other candidates.
    si : bool
        Coefficients in SI as well.

    """
    blocks = [_head(study, verbose)] + [_target(study, t, verbose, si) for t in study.targets]
    if folder is not None and (steps := words.next_steps(study, folder)):
        blocks.append('\n'.join(f'next: {command}    {why}' for command, why in steps))
    return _clean('\n\n'.join(blocks))


def compare(study: Study, verbose: bool = False) -> str:
    """
    Return, per target, where the model fails and by how much more than chance allows.

    Parameters
    ----------
    study : Study
        Of any domain.
    verbose : bool
        Say also what each failure means, and name the views that hold.

    """
    return _clean('\n'.join('\n'.join(_error(study, t, verbose)) for t in study.targets))


def verdict(study: Study, target: str, verbose: bool = False, si: bool = False) -> str:
    """
    Return the verdict on one target, with evidence and advice.

    Parameters
    ----------
    study : Study
        In which the target was diagnosed.
    target : str
        Its name.
    verbose : bool
        Show all candidates with what they gain.
    si : bool
        Coefficients in SI as well.

    """
    d = study.diagnosis[target]
    return _clean('\n'.join([f'{target}: {words.diagnosis_in_words(d)}',
                             *_evidence(d, target, verbose, si)]))


def after_diagnosis(study: Study, folder: str = 'DIR') -> str:
    """
    Return what stands below all verdicts: from when times count, and what to run next.

    ``folder`` is where the study is kept, for the commands that are proposed.

    """
    lines = []
    if any(d.found or d.remaining for d in study.diagnosis.values()):
        lines += words.times_in_words(study.source)
    lines += [f'next: {command}    {why}' for command, why in words.next_steps(study, folder)]
    return _clean('\n'.join(lines))


def history(steps: Iterable[Step]) -> str:
    """Return the ladder of models tried as a table."""
    head = ('target', 'model', 'change', 'error', 'chance', 'deviance fell by', 'the error')
    return _clean(table([(s.target, ' + '.join(s.effects), words.change(s), _or_dash(s.held_out),
                          _or_dash(words.CHANCE * s.held_out_std),
                          '' if s.fall is None else f'{s.fall:.1f}', s.verdict)
                         for s in steps], head))


def _or_dash(value: float) -> str:
    """Return an error, or a dash where nothing was predicted."""
    return '-' if math.isnan(value) else f'{value:.4f}'


def rung(step: Step) -> str:
    """Return one rung of the ladder as a line."""
    return _clean(f'{step.target}: {words.change(step)}: error {step.held_out:.4f} '
                  f'(chance: up to {words.CHANCE * step.held_out_std:.4f}), {step.verdict}')


def steps(study: Study, done: Sequence[Step], si: bool = False) -> str:
    """Return what steps changed: the error before and after, and what was added came out as."""
    lines = []
    for s in done:
        earlier = [r for r in study.history if r.target == s.target and not any(
            r is other for other in done)]
        before = f'{earlier[-1].held_out:.4f} -> ' if earlier else ''
        lines.append(f'{s.target}: {words.change(s)}: error {before}{s.held_out:.4f} '
                     f'(chance: up to {words.CHANCE * s.held_out_std:.4f}), {s.verdict}')
        added = (s.added or '').split('+')
        lines += [f'  {row.label} {row.symbol} = ' + ', '.join(
                      x for x in (row.shown, row.interval, row.si if si else '', row.note) if x)
                  for row in words.rows(study.states[s.target], s.target)
                  if row.label.partition('.')[0] in added or (row.label, row.symbol) in s.moved]
        lines += [f'  outside of the interval before: {", ".join(map(" ".join, s.moved))}; one of '
                  'the two models is wrong there'] if s.moved else []
    if any(s.added for s in done):
        lines += words.times_in_words(study.source)
    return _clean('\n'.join(lines))


def width() -> int:
    """Return how wide text is set: as the terminal (or COLUMNS), but no wider than WIDTH."""
    return min(WIDTH, shutil.get_terminal_size((WIDTH, 0)).columns)


def table(rows: Iterable[Sequence[object]], head: Sequence[str]) -> str:
    """
    Return aligned columns under their names, no wider than the terminal (or COLUMNS) where it can.

    What is too long for its column goes on below.

    """
    cells = [[str(x) for x in r] for r in (head, *rows)]
    width = [max(map(len, column)) for column in zip(*cells)]
    most = shutil.get_terminal_size((ENDLESS, 0)).columns - 2 * (len(width) - 1)
    while sum(width) > most and max(width) > NARROWEST:
        widest = width.index(max(width))
        others = sorted(width)[-2] if len(width) > 1 else 0
        enough = max(others, width[widest] - (sum(width) - most))
        width[widest] = max(NARROWEST, min(width[widest] - 1, enough))
    lines = []
    for row in cells:
        parts = [[x] if len(x) <= w else textwrap.wrap(x, w) for x, w in zip(row, width)]
        lines.append('\n'.join(
            '  '.join(x.ljust(w) for x, w in zip(line, width)).rstrip()
            for line in zip_longest(*parts, fillvalue='')))
    return '\n'.join([lines[0], '  '.join('-' * w for w in width), *lines[1:]])


def _head(study: Study, verbose: bool) -> Any:
    known = words.source_rows(study.source)
    short = [value for key, value in known if key in ('file', 'topic', 'duration', 'rate')]
    lines = [f'{study.domain}: ' + ', '.join(short)] if short else [study.domain]
    if verbose:
        lines += [f'  {key}: {value}' for key, value in known]
    disturbed = words.disturbed_in_words(study.source)
    most = len(disturbed) if verbose else MOST_DISTURBED
    lines += [f'  {line}' for line in disturbed[:most]]
    if len(disturbed) > most:
        lines.append(f'  and {len(disturbed) - most} more (-v shows all)')
    return '\n'.join(lines)


def _target(study: Study, target: str, verbose: bool, si: bool) -> str:
    state, d = study.states[target], study.diagnosis.get(target)
    model, *error = _error(study, target, verbose)
    lines = [model, *_coefficients(state, target, si), *error]
    lines += [f'  note: {flag}' for flag in state.fit.flags]
    if d is not None:
        lines.append(f'  diagnosis: {words.diagnosis_in_words(d)}')
        lines += _evidence(d, target, verbose, si)
    return '\n'.join(lines)


def _error(study: Study, target: str, verbose: bool) -> list[str]:
    """Return the model, its error, and where it fails."""
    state = study.states[target]
    failing = words.failing(state.error)
    lines = [f'{target}: {state.model}', f'  {words.ERROR}: {words.error_in_words(state.error)}']
    lines += ['  fails in ' + (words.view_in_words(v) if verbose else
              f'{words.title_of(v.name)}: {words.places_in_words(v, 1)}') for v in failing]
    if verbose:
        lines += [f'  holds in {words.title_of(v.name)}'
                  for v in state.error.views.values() if v not in failing]
        lines += [f'  {said}' for said in words.summary_in_words(state.summary)]
    return lines


def _coefficients(state: State, target: str, si: bool) -> list[str]:
    lines = [(r.label, r.symbol, r.shown, r.interval, *([r.si] if si else []), r.note)
             for r in words.rows(state, target)]
    width = [max(map(len, column)) for column in zip(*lines)]
    return ['  ' + '  '.join(f'{c:<{w}}' for c, w in zip(line, width)).rstrip() for line in lines]


def _evidence(d: Diagnosis, target: str, verbose: bool, si: bool = False) -> list[str]:
    """Return what a verdict rests on, and the advice."""
    lines = []
    for f in d.ranked if verbose else d.found:
        gain = f'gains {f.gain:.1f} nats, by chance {f.penalty:.1f}' if verbose else ''
        said = words.finding_in_words(f, target, si) if f in d.found else '; '.join(
            s for s in (f.name, words.parameters_of(f, target, si), f.evidence) if s)
        against = f'against it: {f.against}' if f.against else ''
        lines += _wrapped('; '.join(s for s in (said, gain, against) if s))
    if d.remaining is not None:
        lines += _wrapped(words.remaining_in_words(d))
    hint = d.found[0].effect.hint if d.found and d.found[0].effect is not None else ''
    if hint:
        lines += _wrapped(hint)
    if d.advice and not (hint and hint in d.advice):
        lines += _wrapped(f'advice: {d.advice}')
    return lines


def _wrapped(said: str) -> list[str]:
    return textwrap.wrap(said, width() - 4, initial_indent=' ' * 4, subsequent_indent=' ' * 4)


def _clean(said: str) -> str:
    """Return text without control characters: what comes from a file must not steer a terminal."""
    return ''.join(c if c == '\n' or c.isprintable() else '?' for c in said)
