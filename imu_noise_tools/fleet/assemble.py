# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a fleet's folder holds besides the studies: the table, what it says, the page."""

from __future__ import annotations

from collections.abc import Callable, Sequence
import json
from pathlib import Path
from typing import Any

from . import findings, page, run, table
from .inputs import Bag
from .run import Fleet, Progress
from ..core import files
from ..core.errors import InputError
from ..core.units import shown
from ..report.terminal import table as columns

SUMMARY = 'fleet.json'


def bring_up_to_date(fleet: Fleet, bags: Sequence[Bag], scheduler: str | None = None,
                     workers: int | None = None, again: bool = False,
                     progress: Progress | None = None,
                     begun: Callable[[int, str], None] | None = None) -> dict[str, Any]:
    """
    Examine the bags that have no result yet, write what all of them say, and return it.

    Parameters
    ----------
    fleet : Fleet
        Where all is kept.
    bags : sequence of Bag
        All of the fleet.
    scheduler : str or None
        Address of a Dask cluster; None: this machine, with as many ``workers``.
    workers : int or None
        None: what cores and memory hold.
    again : bool
        Whether bags that failed are tried again.
    progress, begun : callable or None
        Called with (share done, what), and once with (bags to do, address of the dashboard).

    """
    todo, lost = fleet.todo(bags, again), {}
    if todo:
        with run.connected(todo, scheduler, workers) as client:
            if begun:
                begun(len(todo), client.dashboard_link)
            lost = run.run(fleet, todo, client, progress, again)
    return write(fleet, bags, lost)


def write(fleet: Fleet, bags: Sequence[Bag], lost: dict[str, str]) -> dict[str, Any]:
    """Write fleet.parquet, fleet.csv, fleet.json and fleet.html; return what they say."""
    whole = table.table(fleet.facts(bags, lost), [f for b in bags for f in b.factors])
    table.write(fleet.folder, whole)
    said = findings.summary(whole)
    said['report'] = 'report.html' if fleet.options.reports else 'allan.csv'
    said['rate_hz'] = _rates(whole)
    files.atomic_write(fleet.folder / SUMMARY, json.dumps(said))
    files.atomic_write(fleet.folder / 'fleet.html',
                       page.html(said, f'Fleet: {fleet.folder.resolve().name}'))
    return said


def _rates(whole: Any) -> dict[str, float]:
    """Return the usual rate of each model's records, Hz."""
    rates: dict[str, list[float]] = {}
    for model, rate in zip(whole['model'].to_pylist(), whole['rate_hz'].to_pylist()):
        if rate:
            rates.setdefault(model, []).append(rate)
    return {m: sorted(r)[len(r) // 2] for m, r in rates.items()}


def read(folder: str | Path) -> dict[str, Any]:
    """Return the summary of a fleet's folder; raise InputError where there is none."""
    path = Path(folder) / SUMMARY
    try:
        said = json.loads(path.read_text(encoding='utf-8'))
        if said['format'] == 'imu_noise_fleet/1' and 'warned' in said:
            return said
    except OSError:
        raise InputError(f'{folder}: no {SUMMARY} in it', 'name a folder that fleet wrote'
                         ) from None
    except (ValueError, KeyError, TypeError):
        pass
    raise InputError(f'{path}: damaged, or of an older version',
                     'run the fleet again: what is done is kept')


def text(said: dict[str, Any], folder: str) -> str:
    """Return a summary as lines for a terminal."""
    out = []
    if said['models']:
        out.append(columns([
            (m, name, str(p['units']), *(_of(p, name)))
            for m, found in said['models'].items() for name, p in found.items()],
            ('model', '', 'units', 'typical', 'spread', 'covers 95 %')))
    for one in said['outlying']:
        why = '; '.join(page.why(c) for c in one['why'])
        out.append(f'look at {one["unit"]} ({one["probability"]:.3f}): {why}')
    if not said['outlying']:
        out.append('no unit is out')
    beyond = [c for c in said['changes'] if c['beyond_chance']]
    if beyond:
        out.append(changes_text(beyond, 'changed'))
    out += [f'warning: {f["error"]}' for f in said['failed'][:20]]
    if len(said['failed']) > 20:
        out.append(f'warning: and {len(said["failed"]) - 20} bags more, see fleet.csv')
    out += _warnings(said['warned'])
    out.append(f'written to {folder}: fleet.html fleet.csv fleet.parquet fleet.json, a study of '
               'each bag in bags')
    return '\n'.join(out)


def _warnings(warned: list[dict[str, Any]]) -> list[str]:
    """Return lines on recordings that are left out, and how many others have warnings."""
    left = [w for w in warned if w['left_out']]
    out = [f'warning: {w["bag"]}: {page.left(w)}' for w in left[:20]]
    if len(left) > 20:
        out.append(f'warning: and {len(left) - 20} recordings more are left out, see fleet.csv')
    if left:
        out.append(f'what is left out {page.REMEDY}')
    if others := len(warned) - len(left):
        out.append(f'{others} recording{"s" * (others > 1)}{" more" if left else ""} with '
                   'warnings, see fleet.html')
    return out


def _of(p: dict[str, Any], name: str) -> tuple[str, str, str]:
    sensor = name.split()[0]
    if not p['axes']:
        limit = p['largest_limit']
        said = f'below {shown(limit, p["template"], sensor)}' if limit else ''
        return said or 'shown by too few units', '', ''
    worst = max(m['mean'] for m in p['axes'].values())
    return (shown(worst, p['template'], sensor), page.small(p['between']),
            shown(p['covers95'], p['template'], sensor))


def compare(a: str | Path, b: str | Path) -> list[dict[str, Any]]:
    """Return what differs between the fleets of two folders, B against A."""
    return findings.compare(table.read(a), table.read(b))


def changes_text(rows: list[dict[str, Any]], title: str) -> str:
    """Return changes as a table for a terminal."""
    return columns(
        [(c['model'], f'{c["sensor"]} {c["parameter"]}', f'{c["level"]} against {c["against"]}'
          if c['factor'] == '(fleet)' else f'{c["factor"]} {c["level"]} against {c["against"]}',
          page.percent(c['ratio']), f'{page.percent(c["lo"])} to {page.percent(c["hi"])}',
          'changed' if c['beyond_chance'] else 'within chance')
         for c in findings.worst_first(rows)], ('model', '', title, 'change', '95 %', ''))
