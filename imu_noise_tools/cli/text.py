# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the commands of the loop print for people."""

from __future__ import annotations

import textwrap

from ..core import units

WIDTH = 100


def table(rows, head) -> str:
    """Return aligned columns."""
    rows = [[str(x) for x in r] for r in (head, *rows)]
    width = [max(len(r[i]) for r in rows) for i in range(len(head))]
    lines = ['  '.join(x.ljust(w) for x, w in zip(r, width)).rstrip() for r in rows]
    return '\n'.join([lines[0], '  '.join('-' * w for w in width), *lines[1:]])


def against_chance(excess: float, std: float) -> str:
    """Return an error beside what chance allows: ``0.31 = 5.2 x chance``, ``within chance``."""
    if not std > 0:
        return 'not to be had'
    if excess <= 2 * std:
        return f'{excess:.3f}, within chance (2 std = {2 * std:.3f})'
    return f'{excess:.3f}, {excess / std:.0f} std beyond a true model'


def compare(study, verbose=False) -> str:
    """Return, per target, where the model fails and by how much more than chance allows."""
    out = []
    for target, score in study.compare().items():
        state = study.states[target]
        out.append(f'{target}: {state.model!r}')
        out.append(f'  error on data not fitted: {against_chance(score.excess, score.std)}')
        if 'misfit_percent' in state.summary:
            out.append(
                '  Allan deviation of the model is off by {misfit_percent:.1f} % rms '
                '(a true model: {misfit_expected:.1f} %)'.format(**state.summary)
            )
        for view in score.views.values():
            bad = view.excess > 2 * view.std
            if bad or verbose:
                out.append(
                    f'  {"FAILS in" if bad else "holds in"} {view.name}: '
                    f'{against_chance(view.excess, view.std)}'
                )
            if bad:
                out.append(f'    {where(view)}')
    return '\n'.join(out)


def where(view) -> str:
    """Say in which stretches of a view the pulls are worst: each with its range, side and size."""
    import numpy as np

    order = np.argsort(view.x, kind='stable')
    x, pull = view.x[order], view.pull[order]
    groups = np.array_split(np.arange(len(x)), min(24, len(x)))
    size = [float(np.sum(pull[g] ** 2 - 1) / np.sqrt(2 * len(g))) for g in groups]
    worst = sorted(np.argsort(size)[::-1][:3])
    parts = []
    for i in worst:
        g = groups[i]
        if size[i] > 2:
            side = 'above' if np.mean(pull[g]) > 0 else 'below'
            side = side if abs(np.mean(pull[g])) * np.sqrt(len(g)) > 2 else 'about'
            parts.append(
                f'{x[g[0]]:.3g} to {x[g[-1]]:.3g} {view.unit} (measured {side} the model, worst '
                f'pull {pull[g][np.argmax(np.abs(pull[g]))]:+.1f})'
            )
    return 'worst: ' + '; '.join(parts) if parts else 'spread over the whole range'


def diagnosis(study, folder, verbose=False) -> str:
    """Return the verdict on each target, with evidence and advice."""
    out = []
    for target, d in study.diagnosis.items():
        model = study.states[target].model
        if d.verdict == 'complete':
            out.append(f'{target}: complete. {model!r} says all that this record shows')
        elif d.verdict == 'missing':
            best = d.ranked[0]
            out.append(
                f'{target}: {best.name} is missing (probability {best.probability:.2f}). '
                f'{best.evidence}'
            )
            sensor = target.partition('_')[0]
            for p in best.effect.parameters:
                e = best.estimates.get(p.name)
                if e is not None and e.value is not None:
                    text = (
                        p.written(e.value)
                        if p.choices
                        else units.shown(e.value, p.unit, sensor)
                        if sensor in ('gyro', 'accel')
                        else f'{e.value:.4g} {e.unit}'
                    )
                    out.append(f'    {p.name} = {text}')
            out += textwrap.wrap(
                best.effect.hint, WIDTH - 4, initial_indent='    ', subsequent_indent='    '
            )
        elif d.verdict == 'unknown':
            failed = ', '.join(f'{f.name} ({f.evidence})' for f in d.failed)
            out.append(
                f'{target}: something is missing that no known effect explains. It shows in '
                f'{failed}'
            )
        else:
            able = [f for f in d.ranked if f.gain > f.penalty] or list(d.ranked[:2])
            out.append(
                f'{target}: undecidable from this record: {", ".join(f.name for f in able)}'
            )
        hint = d.ranked[0].effect.hint if d.verdict == 'missing' else ''
        if d.advice and hint not in d.advice:
            out += textwrap.wrap(
                d.advice, WIDTH - 4, initial_indent='    ', subsequent_indent='    '
            )
        if verbose:
            out += [
                f'    {f.name:20s} gain {f.gain:8.1f} nats, chance up to {f.penalty:.1f}'
                for f in d.ranked
            ]
    if any(d.verdict == 'missing' for d in study.diagnosis.values()):
        out.append(f'next: imu_noise add {folder}')
    return '\n'.join(out)


def history(rows) -> str:
    """Return the ladder as a table; rows are those of study.yaml."""
    return table(
        [
            (
                r['target'],
                ' + '.join(r['effects']),
                f'+{r["added"]}'
                if r.get('added')
                else f'-{r["removed"]}'
                if r.get('removed')
                else '',
                f'{r["held_out"]:.4f}',
                f'{2 * r["held_out_std"]:.4f}',
                '' if r.get('fall') is None else f'{r["fall"]:.1f}',
                r['verdict'],
            )
            for r in rows
        ],
        ('target', 'model', 'step', 'error', 'chance', 'fall', 'verdict'),
    )


def steps(study, done) -> str:
    """
    Return what a step changed.

    The error before and after, and what the added effect came out as.

    """
    out = []
    for s in done:
        state = study.states[s.target]
        before = next(
            (
                r
                for r in reversed(study.history)
                if r.target == s.target and r is not s and r not in done
            ),
            None,
        )
        change = (
            f'error {before.held_out:.4f} -> {s.held_out:.4f}'
            if before
            else f'error {s.held_out:.4f}'
        )
        what = f'+{s.added}' if s.added else f'-{s.removed}'
        out.append(f'{s.target}: {what}: {change} (chance: {2 * s.held_out_std:.4f}), {s.verdict}')
        if s.added:
            for label, found in state.fit.estimates.items():
                if label.partition('.')[0] in s.added.split('+'):
                    for k, e in found.items():
                        parameter = state.model[label].parameter(k)
                        out.append(f'    {label}.{k} = {estimate(e, parameter)}')
    return '\n'.join(out)


def estimate(e, parameter) -> str:
    """Return one estimate with its interval; a choice by its name."""
    if parameter.choices and e.value is not None:
        return parameter.written(e.value)
    if e.value is None:
        return (
            f'not observable, below {e.upper95:.3g} {e.unit} (95 %)'
            if e.upper95 is not None
            else 'not observable'
        ) + (f' ({e.note})' if e.note and 'not observable' not in e.note else '')
    interval = f' [{e.ci95[0]:.4g}, {e.ci95[1]:.4g}]' if e.ci95 else ''
    return f'{e.value:.4g}{interval} {e.unit}'


def unit_of(parameter) -> str:
    """Return a parameter's unit for gyroscope and accelerometer; of a choice, its names."""
    if parameter.choices:
        return ' | '.join(parameter.choices)
    gyro, accel = units.si(parameter.unit, 'gyro'), units.si(parameter.unit, 'accel')
    return gyro if gyro == accel else f'{gyro} | {accel}'


def effects_table(classes) -> str:
    """Return what is known, a line each."""
    rows = [
        (c.domain, c.name, ', '.join(
            p.name if p.choices else f'{p.name} [{unit_of(p)}]' for p in c.parameters
        ), c.title)
        for c in classes
    ]
    return table(rows, ('problem', 'effect', 'parameters', 'what it is'))


def effect(cls) -> str:
    """Return an effect's page."""
    out = [f'{cls.name} ({cls.domain}): {cls.title}', '']
    for head, body in (
        ('equation', cls.equation),
        ('signature', cls.signature),
        ('hint', cls.hint),
        ('reference', cls.reference),
    ):
        if body:
            out += textwrap.wrap(f'{head}: {body}', WIDTH, subsequent_indent='  ')
    out += ['parameters:'] + [f'  {p.name} [{unit_of(p)}]  {p.title}' for p in cls.parameters]
    kinds = [
        b.__name__
        for b in cls.__mro__
        if b.__module__.endswith('.kinds') and b.__name__ != 'NoiseEffect'
    ]
    if kinds:
        out.append(f'kind: {", ".join(kinds)}')
    if cls.domain == 'noise' and 'Spectrum' in kinds:
        out += ['', *sketch(cls.example())]
    return '\n'.join(out)


def sketch(example) -> list[str]:
    """
    Return its Allan deviation as a small picture in text.

    Log-log, for typical values at 100 Hz.

    """
    import numpy as np

    m = np.unique(np.round(np.geomspace(1, 1e5, 60)).astype(int))
    dev = np.sqrt(np.maximum(example.avar(m, 0.01), 1e-300))
    level = np.log10(dev)
    rows, top, bottom = 10, level.max(), max(level.min(), level.max() - 4)
    grid = [[' '] * 60 for _ in range(rows)]
    for x, y in zip(np.log10(m) / 5 * 59, level):
        if y >= bottom:
            r = int(round((top - y) / max(top - bottom, 0.3) * (rows - 1)))
            grid[min(r, rows - 1)][int(round(x))] = '*'
    body = [f'{"dev" if i == 0 else "":>5s} |{"".join(g)}' for i, g in enumerate(grid)]
    return [
        'Allan deviation for typical values:',
        *body,
        '      +' + '-' * 60,
        '      0.01 s' + ' ' * 44 + '1000 s  tau',
    ]


def changes(found, first, second) -> str:
    """Return what changed between two records beyond chance."""
    rows = [
        (c['target'], c['what'], c['first'], c['second'], c['sigmas'], c['verdict']) for c in found
    ]
    return f'first: {first}\nsecond: {second}\n' + table(
        rows, ('target', 'what', 'first', 'second', 'sigma', 'verdict')
    )


def inspection(found) -> str:
    """Return a bag's topics and the health of its record."""
    h = found.health
    out = [
        table(
            [
                (
                    t.name,
                    t.type,
                    t.samples,
                    '' if t.rate_hz is None else f'{t.rate_hz:.4g}',
                    t.role,
                )
                for t in found.topics
            ],
            ('topic', 'type', 'messages', 'Hz', 'used as'),
        ),
        '',
    ]

    def line(name, value):
        out.append(f'{name:22s}{value}')

    def hertz(x):
        return 'unknown' if x is None else f'{x:.6g} Hz'

    line('record', f'{found.topic}: {h.samples} samples, {h.duration_s:.6g} s')
    line(
        'rate',
        f'{hertz(h.rate_hz)} (median {hertz(h.median_rate_hz)}, received '
        f'{hertz(h.receive_rate_hz)})',
    )
    if h.clock_drift_ppm is not None:
        line('clock drift', f'{h.clock_drift_ppm:.3g} ppm against the receiver')
    line('gaps', f'{h.gaps}, {h.missing} samples missing, the longest {h.longest_gap_s:.3g} s')
    jitter = 'unknown' if h.jitter_s is None else f'{1e6 * h.jitter_s:.3g} us'
    line('stamps', f'{h.duplicates} duplicate, {h.backward} backward, jitter {jitter}')
    line('not finite', h.not_finite)
    line('stuck axes', ', '.join(h.stuck) or 'none')
    line('saturation', ', '.join(f'{k} {v}' for k, v in h.saturated.items()) or 'none')
    line(
        'resolution',
        ', '.join(
            f'{k} {r.step:.3g} ({r.levels} levels)' if r.step else f'{k} no grid'
            for k, r in h.resolution.items()
        )
        or 'unknown',
    )
    if h.gravity is not None:
        line('gravity at rest', f'{h.gravity:.4g} m/s^2')
    line(
        'temperature topics',
        ', '.join(f'{k} {lo:.4g} to {hi:.4g} degC' for k, (lo, hi) in h.temperature.items())
        or 'none',
    )
    line('can be analysed', found.analysed)
    if h.advice:
        out += ['', 'advice'] + [
            w
            for a in h.advice
            for w in textwrap.wrap(a, WIDTH - 2, initial_indent='- ', subsequent_indent='  ')
        ]
    return '\n'.join(out)
