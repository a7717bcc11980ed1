# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A fleet as one self-contained HTML page, in the style of a study's report."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any
from urllib.parse import quote

import numpy as np

from .findings import worst_first
from ..core.units import shown
from ..health import suspected
from ..report.markup import badge, bullets, cell, escape, folded, page, table

SURE = 0.9
MOST_UNITS = 1000       # listed; the table of the fleet has all
MOST_CHANGES = 40
WIDTH, HEIGHT = 280, 46
TITLES = {'N': 'noise density', 'B': 'bias instability', 'K': 'random walk'}
SENSORS = {'gyro': 'Gyroscope', 'accel': 'Accelerometer'}
READING = (
    ('spread between units', 'how much one axis differs from unit to unit, one standard '
     'deviation, the error of measuring it taken out: what all axes of a unit have in common '
     '(whole units) and what each has alone; units that are out do not count in it'),
    ('measured to', 'the usual standard error of one record of one axis'),
    ('covers 95 %', 'what the worst axis of a unit never measured stays below in 95 of 100: '
     'imu_noise export FLEET --population'),
    ('below', 'an upper limit: the record cannot tell the value from zero; it counts as a limit, '
     'not as a zero'),
    ('probability', 'that the unit is out and no chance of its kind. Of all that are called, one '
     'in twenty is expected to be false'),
    ('drifts', 'the values of a unit go up or down over its dates (three or more)'),
    ('change', 'ratio between two levels of a factor, the other factors held, with its 95 % '
     'interval; units that had both levels are compared with themselves'))


REMEDY = ('counts in no value of a unit or a model: --gyro-unit and --accel-unit say in what all '
          'bags are read, the columns gyro_unit and accel_unit of a manifest say it of one bag')


def html(summary: Mapping[str, Any], title: str = 'Fleet') -> str:
    """Return what :func:`imu_noise_tools.fleet.findings.summary` gave as one page."""
    return page(title, [
        _head(summary), _outlying(summary), _changes(summary['changes']), _models(summary),
        _missing(summary), _lines(summary), _units(summary), _failed(summary), _warned(summary),
        _reading()])


def _head(s: Mapping[str, Any]) -> str:
    names = [m or 'no model named' for m in s['models']]
    said = [f'{s["units"]} units of {len(names)} model{"s" * (len(names) != 1)} '
            f'({", ".join(names)}), {s["bags"]} bags.' if names else f'{s["bags"]} bags.']
    bad, failed = len(s['outlying']), len(s['failed'])
    said.append(badge(f'{bad} unit{"s" * (bad != 1)} to look at.', 'bad') if bad
                else badge('No unit is out.', 'good'))
    if failed:
        said.append(badge(f'{failed} bag{"s" * (failed != 1)} could not be analysed.', 'doubt'))
    if out := sum(bool(w['left_out']) for w in s['warned']):
        said.append(badge(f'{out} recording{"s" * (out != 1)} left out: unit suspected.', 'doubt'))
    beyond = sum(c['beyond_chance'] for c in s['changes'])
    if s['changes']:
        said.append(f'{beyond} of {len(s["changes"])} changes between the levels of a factor are '
                    'beyond chance.')
    return f'<p>{" ".join(x if x.startswith("<") else escape(x) for x in said)}</p>'


def _link(s: Mapping[str, Any], unit: str) -> str:
    """Return a unit's name, leading to the report of its last bag."""
    bags = s['about'].get(unit, {}).get('bags') or []
    if not bags:
        return escape(unit)
    last = max(bags, key=lambda b: b['date'] or '')
    return f'<a href="bags/{quote(last["key"])}/{s["report"]}">{escape(unit)}</a>'


def _outlying(s: Mapping[str, Any]) -> str:
    rows = []
    for one in s['outlying']:
        told = [escape(why(c)) for c in sorted(one['why'], key=lambda c: -c['probability'])]
        rows.append((f'<b>{_link(s, one["unit"])}</b>', escape(one['model']),
                     bullets(told) if len(told) > 1 else told[0],
                     cell(f'{one["probability"]:.3f}')))
    return '<h2>Units to look at</h2>' + (
        table(('unit', 'model', 'what', 'probability'), rows)
        or f'<p>{badge("None.", "good")} No unit lies outside what its model does.</p>')


def why(case: Mapping[str, Any]) -> str:
    """Return in words how a unit is out."""
    axes = ', '.join(case['axes'])
    if 'ratio' not in case:
        return f'{case["what"]} ({axes})'
    between = f'{case["lo"]:.2f} to {case["hi"]:.2f}'
    if case['drift']:
        return f'{case["what"]} drifts: times {case["ratio"]:.2f} a year ({between}); {axes}'
    return f'{case["what"]} is {case["ratio"]:.2f} times its model\'s ({between}); {axes}'


def _changes(changes: Iterable[Mapping[str, Any]]) -> str:
    some = worst_first(changes)
    if not some:
        return ''
    rows = [(escape(c['model']), escape(f'{c["sensor"]} {c["parameter"]}'),
             escape(f'{c["factor"]}: {c["level"]} against {c["against"]}'),
             cell(percent(c['ratio'])), cell(f'{percent(c["lo"])} to {percent(c["hi"])}'),
             badge('changed', 'bad') if c['beyond_chance'] else badge('within chance', 'faint'))
            for c in some]
    head = ('model', '', 'factor', 'change', '95 %', '')
    shown_first = [r for r, c in zip(rows, some) if c['beyond_chance']][:MOST_CHANGES]
    rest = rows[len(shown_first):]
    out = '<h2>What changed</h2>' + (table(head, shown_first) or (
        f'<p>{badge("Nothing beyond chance.", "good")}</p>'))
    return out + (folded(f'{len(rest)} more', table(head, rest), False) if rest else '')


def percent(ratio: float) -> str:
    """Return a ratio as a change in per cent; a large one as a factor."""
    return f'{100 * (ratio - 1):+.1f} %' if 0.3 < ratio < 3 else f'× {ratio:.3g}'


def _models(s: Mapping[str, Any]) -> str:
    out = []
    for model, found in s['models'].items():
        rows = []
        for name, p in found.items():
            sensor, parameter = name.split()
            rows.append((
                f'<b>{cell(f"{SENSORS[sensor]} {parameter}")}</b><br>{cell(TITLES[parameter])}',
                _means(p, sensor), _spread(p), cell(shown(p['covers95'], p['template'], sensor))
                if p['covers95'] else '', _strip(p, sensor)))
        out.append(f'<h3>{escape(model or "Model not named")}</h3>' + table(
            ('', 'typical', 'spread between units', 'covers 95 % of units', 'units'), rows))
    said = ('<p class="small">A dot is a unit, on a logarithmic scale; red is out; a dash has '
            'an upper limit alone. The bar is where 95 % of regular units are.</p>')
    return '<h2>What the models do</h2>' + ''.join(out) + said


def _means(p: Mapping[str, Any], sensor: str) -> str:
    if not p['axes']:
        limit = p['largest_limit']
        return escape('shown by too few units'
                      + (f'; below {shown(limit, p["template"], sensor)} on all' if limit else ''))
    return '<br>'.join(
        f'{axis[-1]} {cell(shown(m["mean"], p["template"], sensor))} '
        + badge(f'({shown(m["lo"], p["template"], sensor).split()[0]} to '
                f'{shown(m["hi"], p["template"], sensor).split()[0]})', 'faint')
        for axis, m in p['axes'].items())


def _spread(p: Mapping[str, Any]) -> str:
    if not p['axes']:
        return ''
    limits = f', {p["limits"]} of {p["records"]} are limits' if p['limits'] else ''
    return (f'<b>{small(p["between"])}</b><br><span class="small faint">whole units '
            f'{small(p["between_units"])}, single axes '
            f'{small(p["between_axes"])}; measured to {small(p["measurement"])}{limits}</span>')


def small(percent: float) -> str:
    """Return a spread in per cent."""
    return f'{percent:.2g} %' if percent >= 0.1 else 'none seen'


def _strip(p: Mapping[str, Any], sensor: str) -> str:
    """Return a picture of the units on a log scale: one path for all that are regular."""
    dots = [(v, limit, q) for _, v, limit, q in p['spread'] if v > 0]
    if not dots:
        return ''
    x = np.log([d[0] for d in dots])
    low, high = x.min(), x.max()
    if p['axes']:
        centre = float(np.mean([np.log(m['mean']) for m in p['axes'].values()]))
        half = 1.96 * np.hypot(np.log1p(p['between_units'] / 100),
                               np.log1p(p['between_axes'] / 100) / np.sqrt(len(p['axes'])))
        low, high = min(low, centre - half), max(high, centre + half)
    pad = 0.06 * (high - low) + 1e-3
    scale = (WIDTH - 12) / (high - low + 2 * pad)

    def at(value: float) -> float:
        return 6 + (value - low + pad) * scale

    out = [f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}" role="img" '
           f'aria-label="{len(dots)} units">']
    if p['axes']:
        left, right = at(centre - half), at(centre + half)
        out.append(f'<rect x="{left:.1f}" y="8" width="{max(right - left, 1):.1f}" height="14" '
                   'fill="currentColor" opacity=".12"/>')
    regular = ''.join(f'M{at(v):.0f} {_height(i)}h0' for i, (v, d) in enumerate(zip(x, dots))
                      if d[2] <= SURE and not d[1])
    hollow = ''.join(f'M{at(v) - 4:.0f} {_height(i)}h8' for i, (v, d) in enumerate(zip(x, dots))
                     if d[2] <= SURE and d[1])
    bad = ''.join(f'M{at(v):.0f} 15h0' for v, d in zip(x, dots) if d[2] > SURE)
    for path, name, width in ((regular, 'ink', 4), (hollow, 'faint', 2), (bad, 'bad', 8)):
        if path:
            out.append(f'<path d="{path}" class="{name}" stroke="currentColor" fill="none" '
                       f'stroke-width="{width}" stroke-linecap="round" opacity=".75"/>')
    for value, anchor in ((low, 'start'), (high, 'end')):
        out.append(f'<text x="{at(value):.0f}" y="42" font-size="12" text-anchor="{anchor}" '
                   'class="faint" fill="currentColor">'
                   f'{escape(shown(float(np.exp(value)), p["template"], sensor))}</text>')
    return ''.join(out) + '</svg>'


def _height(i: int) -> int:
    """Return where a dot is drawn: beside each other, so that many are seen as many."""
    return 8 + (i * 7) % 15


def _missing(s: Mapping[str, Any]) -> str:
    rows = [(escape(m['model']), escape(m['effect']), cell(f'{m["units"]} of {m["of"]}'),
             cell(f'{100 * m["share"]:.0f} %'), _names(s, m['names'])) for m in s['missing']]
    return '<h2>Effects missing from the models</h2>' + (
        table(('model', 'effect', 'units', '', 'which'), rows)
        or '<p>None was found in the axes that were diagnosed.</p>')


def _names(s: Mapping[str, Any], names: list[str]) -> str:
    if len(names) > 12:
        return escape(f'{", ".join(names[:10])} and {len(names) - 10} more')
    return ', '.join(_link(s, n) for n in names)


def _lines(s: Mapping[str, Any]) -> str:
    rows = [(cell(f'{g["frequency"]:.4g} Hz'), cell(f'{g["units"]} of {g["of"]}'),
             escape('the place or the model' if g['units'] > max(2, 0.2 * g['of'])
                    else 'the unit'), escape(', '.join(g['effects'])),
             _names(s, g['names'])) for g in s['lines'][:60]]
    return '<h2>Lines in the spectrum</h2><p>The same frequency on many units comes from the ' \
        'building, the mount or the model; on one it is its own.</p>' + table(
            ('frequency', 'units', 'likely from', 'effect', 'which'), rows) if rows else ''


def _units(s: Mapping[str, Any]) -> str:
    rows = []
    for unit, one in list(s['about'].items())[:MOST_UNITS]:
        bags = sorted(one['bags'], key=lambda b: b['date'] or '')
        links = ', '.join(f'<a href="bags/{quote(b["key"])}/{s["report"]}">'
                          f'{escape(b["date"] or str(k))}</a>'
                          for k, b in enumerate(bags[-12:], 1))
        said = '; '.join(f'{v}: {len(a)}' for v, a in sorted(one.get('verdicts', {}).items()))
        rows.append((_link(s, unit), escape(one['model']), links, escape(said)))
    more = len(s['about']) - len(rows)
    note = f'<p>{more} more are in fleet.csv.</p>' if more > 0 else ''
    return '<h2>All units</h2>' + folded(
        f'{len(s["about"])} units, each with its reports',
        table(('unit', 'model', 'reports', 'axes by verdict'), rows) + note, False)


def _failed(s: Mapping[str, Any]) -> str:
    if not s['failed']:
        return ''
    return '<h2>Bags that could not be analysed</h2>' + table(
        ('unit', 'why'), [(escape(f['unit']), escape(f['error'])) for f in s['failed'][:500]])


def left(one: Mapping[str, Any]) -> str:
    """Return in words what of a recording is left out, and why."""
    why = [w for w in one['warnings'] if suspected([w])]
    return f'{" and ".join(one["left_out"])} left out: {"; ".join(why)}'


def _warned(s: Mapping[str, Any]) -> str:
    """Return what is left out, with what to do, and the warnings of all recordings."""
    out = [(_link(s, w['unit']), escape(w['bag']), escape(left(w)))
           for w in s['warned'] if w['left_out']][:500]
    rows = [(_link(s, w['unit']), escape(w['bag']), bullets(map(escape, w['warnings'])))
            for w in s['warned']][:500]
    said = '<h2>Recordings left out</h2>' + table(('unit', 'recording', 'why'), out) + \
        f'<p>What is left out {escape(REMEDY)}.</p>' if out else ''
    return said + ('<h2>Warnings</h2>' + folded(
        f'{len(s["warned"])} recordings with warnings',
        table(('unit', 'recording', 'warnings'), rows), False) if rows else '')


def _reading() -> str:
    return '<h2>How to read this</h2><dl>' + ''.join(
        f'<dt>{escape(k)}</dt><dd>{escape(v)}</dd>' for k, v in READING) + '</dl>'
