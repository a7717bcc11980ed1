# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What commands print for people that is no study: effects, changes, the health of a bag."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import groupby
import textwrap
from typing import Any

from ..core import units
from ..core.clipped import ends_in_words
from ..core.clock import PATTERNS
from ..health.examine import STEP
from ..health.values import where_not_finite
from ..loop.effect import Effect, Parameter
from ..report.terminal import table, width
from ..report.words import significant


def unit_of(parameter: Parameter) -> str:
    """Return a parameter's unit for gyroscope and accelerometer; of a choice, its names."""
    if parameter.choices:
        return ' | '.join(parameter.choices)
    gyro, accel = units.si(parameter.unit, 'gyro'), units.si(parameter.unit, 'accel')
    return gyro if gyro == accel else f'{gyro} | {accel}'


def effects_table(classes: Iterable[type[Effect]]) -> str:
    """Return what is known, a line each where the terminal is as wide, and where there is more."""
    rows = [(c.domain, c.name, ', '.join(_runs([p.name for p in c.parameters])), c.title)
            for c in classes]
    return (table(rows, ('problem', 'effect', 'parameters', 'what it is'))
            + '\n\nunits, equation, how it shows and what causes it: imu_noise effects EFFECT')


def _runs(names: Iterable[str]) -> list[str]:
    """Return names, of which those that differ in their ending only are one: gain_x..z."""
    out = []
    for stem, some in groupby(names, lambda n: n.rpartition('_')[0] or n):
        same = list(some)
        last = same[-1].rpartition('_')[2]
        out += [f'{same[0]}..{last}'] if len(same) > 2 else same
    return out


def effect(cls: type[Effect]) -> str:
    """Return an effect's page."""
    out = [f'{cls.name} ({cls.domain}): {cls.title}', '']
    for head, body in (
        ('equation', cls.equation),
        ('signature', cls.signature),
        ('hint', cls.hint),
        ('reference', cls.reference),
    ):
        if body:
            out += textwrap.wrap(f'{head}: {body}', width(), subsequent_indent='  ')
    out += ['parameters:'] + [f'  {p.name} [{unit_of(p)}]  {p.title}' for p in cls.parameters]
    kinds = [
        b.__name__
        for b in cls.__mro__
        if b.__module__.endswith('.kinds') and b.__name__ != 'NoiseEffect'
    ]
    if kinds:
        out.append(f'kind: {", ".join(kinds)}')
    if 'Spectrum' in kinds:
        out += ['', *sketch(cls.example())]
    return '\n'.join(out)


def sketch(example: Any) -> list[str]:
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


def changes(found: Any, first: str, second: str, si: bool = False) -> str:
    """
    Return what changed between two records beyond chance, and what chance does.

    In the field's units or in SI, target by target, and at the end what changed.

    """
    from ..tasks.compare import LEVEL, limit, tested

    end = '' if si else '_shown'
    head = ('what', 'first', 'second', 'unit', 'sigma', '')
    by_target: dict[str, list[tuple[str, ...]]] = {}
    changed: dict[str, list[str]] = {}
    for c in found:
        mark = '*' if c['verdict'] == 'changed' else ''
        if mark:
            changed.setdefault(c['target'], []).append(c['what'])
        by_target.setdefault(c['target'], []).append((
            c['what'].replace(' to ', '-'), *(c[k + end].replace(' +- ', ' ±') for k in (
                'first', 'second')), c[f'unit{end}'], c['sigmas'] or '-', mark))
    rows = [row for target, own in by_target.items()
            for row in (('',) * len(head), (target, *('',) * (len(head) - 1)), *own)]
    lines = [f'first: {first}', f'second: {second}', table(rows, head), '']
    tests = tested(found)
    if tests:
        lines += [f'* changed: by more than {limit(found):.1f} sigma. By chance one of these '
                  f'{tests} rows is in', f'one of {1 / LEVEL:.0f} pairs of records of one sensor. '
                  '- is not to be told.']
        lines += [f'{t}: {", ".join(what)}' for t, what in changed.items()] or ['nothing changed']
    return '\n'.join(lines).rstrip()


def disturbed(found: Any) -> list[str]:
    """Return the disturbed stretches of a record: when, what, how large, set aside or not."""
    unit = {'gyro': 'rad/s', 'accel': 'm/s^2'}
    rows = []
    for d in found.disturbances:
        sizes = []
        for sensor in ('gyro', 'accel'):
            most = max((v for a, v in d.size.items() if a.startswith(sensor)), default=None)
            sizes.append('' if most is None else f'{most:.3g} {unit[sensor]}')
        aside = any(a <= d.end and d.begin <= b for a, b, _ in found.left_out)
        rows.append((
            f'{d.begin:.6g}', f'{d.end - d.begin:.3g}', d.kind, *sizes,
            'yes' if aside else 'no', ' '.join(d.axes),
        ))
    return table(
        rows, ('from, s', 'for, s', 'disturbed by', 'gyro', 'accel', 'set aside', 'axes')
    ).split('\n')


def inspection(found: Any, others: Iterable[Any] = (), names: Iterable[str] = ()) -> str:
    """
    Return a bag's topics and the health of its records, each sensor's where they are apart.

    ``names`` is what --topic takes for each IMU, where there are several.

    """
    topics = [(t.name, t.type, t.samples, '' if t.rate_hz is None else f'{t.rate_hz:.4g}', t.role)
              for t in found.topics]
    out = [table(topics, ('topic', 'type', 'messages', 'Hz', 'used as'))]
    each = list(names)
    if len(each) > 1:
        out += ['', *textwrap.wrap(
            f'{len(each)} IMUs: analyse, calibrate, apply, filter, explore and fleet take one, '
            f'named with --topic {" or --topic ".join(each)}; analyse --topic all makes a study '
            'of each.', width(), break_long_words=False, break_on_hyphens=False)]
    for one in (x for whole in (found, *others) for x in (whole, *whole.beside)):
        out += ['', *_health(one)]
    return '\n'.join(out)


def _jitter(seconds: float | None) -> str:
    """Return the scatter of stamps, none where it is less than they are written in."""
    if seconds is None:
        return 'unknown'
    if seconds < STEP:
        return 'none'
    return f'{1e6 * seconds:.3g} us' if seconds < 1e-3 else f'{1e3 * seconds:.3g} ms'


def _drift(ppm: float, std: float) -> str:
    """Return a drift of the clock and its standard error, ppm, as far as it is one."""
    if abs(ppm) < 2 * std:
        return f'none found against the receiver (below {2 * std:.1g} ppm)'
    return f'{significant(ppm, std)} ± {std:.1g} ppm against the receiver'


def _health(found) -> list[str]:
    """Return the health of one stream, line by line."""
    h = found.health
    out: list[str] = []

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
        line('clock drift', _drift(h.clock_drift_ppm, h.clock_drift_std_ppm))
    line('gaps', f'{h.gaps}, {h.missing} samples missing, the longest {h.longest_gap_s:.3g} s')
    look = f'{PATTERNS[h.stamps]}; ' if h.stamps else ''
    ahead = f'set ahead {units.times(h.ahead)}, ' if h.ahead else ''
    line('stamps', f'{look}{h.duplicates} duplicate, {h.backward} backward, {ahead}jitter '
                   f'{_jitter(h.jitter_s)}')
    if h.received:
        line('receive times', PATTERNS[h.received])
    bad = where_not_finite(h.not_finite_axes)
    line('not finite', f'{h.not_finite} samples: {bad}' if bad else 0)
    line('stuck axes', ', '.join(h.stuck) or 'none')
    line('saturation', ', '.join(
        f'{a} {ends_in_words(a, [(end, k / h.samples) for end, k in ends])}'
        for a, ends in h.range_ends.items()) or 'none')
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
    if found.looked and not found.disturbances:
        line('disturbed', 'nowhere plainly; what is faint or goes on for long diagnose names')
    if found.disturbances:
        out += ['', *disturbed(found)]
    if h.advice:
        out += ['', 'advice'] + [
            w
            for a in h.advice
            for w in textwrap.wrap(a, width() - 2, initial_indent='- ', subsequent_indent='  ')
        ]
    return out
