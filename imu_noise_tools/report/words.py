"""What a study says, as short sentences and rows of plain strings: nothing here knows a terminal or HTML."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
import math
import shlex

import numpy as np

from .. import units
from ..effect import Effect, Estimate, Finding, Score, View
from ..study import Diagnosis, State, Study

DOUBT = 3.0          # standard deviations from which one view alone is said to fail; 2 for the mean of all (Score)
STRIKING = 3.0       # standard errors from which one place is named

# name of a view: (what it looks at, what it means when it fails)
VIEWS = {
    'frequency': ('power over frequency', 'the power of the noise at some frequencies is not what the model says'),
    'time': ('mean over time', 'the mean moves in a way that the model does not foresee'),
    'variance': ('loudness over time', 'the noise is louder at some times than at others'),
    'distribution': ('distribution of the samples', 'the samples are not spread as Gaussian noise is'),
    'repeats': ('repeated samples', 'neighbouring samples are equal more often than noise makes them'),
    'coherence': ('other channels', 'it moves together with other axes or covariates'),
    'poses': ('poses left out', 'poses are not predicted by the other poses'),
}
VERDICTS = {
    'missing': 'something is missing, and this record says what',
    'complete': 'nothing is missing that this record could show',
    'unknown': 'something is missing that no known effect explains',
    'undecidable': 'this record cannot tell which effect it is',
}


@dataclass(frozen=True)
class Row:
    """One coefficient as people read it."""

    label: str
    symbol: str
    title: str
    shown: str          # in the field's unit, or 'not observable'
    interval: str       # in the field's unit
    si: str             # with its standard deviation
    note: str


def sensor_of(target: str) -> str:
    """Return ``gyro`` or ``accel`` for a target of any domain; empty for anything else."""
    sensor = target.partition('_')[0]
    return sensor if sensor in ('gyro', 'accel') else ''


def significant(value: float, std: float | None = None, least: int = 3) -> str:
    """Return a number with two digits of its standard deviation, three digits without one."""
    if not math.isfinite(value):
        return str(value)
    if value and std and math.isfinite(std):
        least = min(max(math.floor(math.log10(abs(value) / std)) + 2, 2), 9)
    if value and least <= math.log10(abs(value)) < 6:
        return f'{value:.0f}'
    return f'{value:.{least}g}'


def rows(state: State, target: str) -> list[Row]:
    """Return the coefficients of one target."""
    out = []
    for effect in state.model:
        known = state.fit.estimates.get(effect.label, {})
        for p in effect.parameters:
            if p.name in known:
                out.append(_row(effect, p, known[p.name], sensor_of(target)))
    return out


def _row(effect: Effect, parameter, e: Estimate, sensor: str) -> Row:
    factor, unit = units.field(parameter.unit, sensor) if sensor else (1.0, e.unit or parameter.unit)
    unit = '' if unit == '1' else f' {unit}'
    std = None if e.std is None else e.std / factor
    interval = ''
    if e.value is None:
        shown = 'not observable'
        if e.upper95 is not None:
            interval = f'below {significant(e.upper95 / factor)}{unit}'
        si = '' if e.upper95 is None else f'< {significant(e.upper95)} {e.unit}'
    else:
        shown = f'{significant(e.value / factor, std)}{unit}'
        if e.ci95 is not None:
            interval = ' ... '.join(significant(v / factor, std) for v in e.ci95)
        si = f'{significant(e.value, e.std)}' + ('' if e.std is None else f' ± {significant(e.std, least=2)}') + f' {e.unit}'
    note = e.note.removeprefix('not observable: ') if e.value is None else e.note
    return Row(effect.label, parameter.name, parameter.title or effect.title, shown, interval, si.strip(), note)


def parameters_of(finding: Finding, target: str) -> str:
    """Return the values that a candidate would have, in the field's units."""
    if finding.effect is None:
        return ''
    found = [_row(finding.effect, p, finding.estimates[p.name], sensor_of(target))
             for p in finding.effect.parameters if p.name in finding.estimates]
    return ', '.join(f'{r.symbol} {r.shown}' for r in found)


def error_in_words(error: Score) -> str:
    """Return the error on data not fitted beside what chance allows."""
    if not math.isfinite(error.excess):
        return 'not known: nothing was left to predict'
    if error.within_chance:
        return f'{error.excess:.2g}, within chance (up to {2 * error.std:.2g})'
    return f'{error.excess:.2g}, beyond chance (up to {2 * error.std:.2g})'


def failing(error: Score) -> list[View]:
    """Return the views that exceed chance by themselves, worst first."""
    beyond = [v for v in error.views.values() if v.std > 0 and v.excess > DOUBT * v.std]
    return sorted(beyond, key=lambda v: -v.excess / v.std)


def worst_places(view: View, most: int = 3) -> list[tuple[float, float]]:
    """Return (x, pull) of the places that stand out most, none near another."""
    chosen: list[tuple[float, float]] = []
    span = np.ptp(view.x) if len(view.x) else 0.0
    for i in np.argsort(-np.abs(view.pull), kind='stable'):
        if abs(view.pull[i]) < STRIKING or len(chosen) == most:
            break
        x = float(view.x[i])
        near = (abs(math.log(x / y)) < 0.4 if view.unit == 'Hz' and x > 0 and y > 0 else abs(x - y) < 0.05 * span
                for y, _ in chosen)
        if not any(near):
            chosen.append((x, float(view.pull[i])))
    return chosen


def places_in_words(view: View) -> str:
    """Return where a view fails most."""
    found = worst_places(view)
    if not found:
        return 'a little in many places, nowhere strikingly'
    return 'worst ' + ', '.join(f'{_place(view, x)} ({_pull(view, pull)})' for x, pull in found)


def _place(view, x):
    if view.unit == 'Hz':
        return f'near {x:.3g} Hz' + (f' (a period of {1 / x:.3g} s)' if 0 < x < 0.1 else '')
    if view.unit == 's':
        return f'at {duration(x)}'
    if view.name == 'distribution':
        return 'in the tails' if min(x, 1 - x) < 0.05 else 'close to the mean' if abs(x - 0.5) < 0.2 else 'on the flanks'
    return f'at {x:.3g} {view.unit}'.strip()


def _pull(view, pull):
    size = f'{abs(pull):.1f} standard errors'
    if view.name in ('frequency', 'variance', 'distribution'):
        return f'{size} too {"much" if pull > 0 else "little"}'
    return size


def view_in_words(view: View) -> str:
    """Return one sentence on a view that fails."""
    title, meaning = VIEWS.get(view.name, (view.name, 'the model does not describe it'))
    return f'{title}: {meaning}; {places_in_words(view)}'


def duration(seconds: float) -> str:
    """Return a length of time as people say it."""
    if seconds < 120:
        return f'{seconds:.3g} s'
    return f'{seconds / 60:.3g} min' if seconds < 7200 else f'{seconds / 3600:.3g} h'


def diagnosis_in_words(d: Diagnosis) -> str:
    """Return the verdict in one line."""
    if d.verdict == 'missing' and d.ranked:
        best = d.ranked[0]
        sure = f', probability {best.probability:.2g}' if best.probability is not None else ''
        return f'missing: {best.name}{sure}'
    if d.verdict == 'undecidable' and d.ranked:
        return 'undecidable: ' + ' or '.join(f.name for f in d.ranked if f.gain > f.penalty)
    return f'{d.verdict}: {VERDICTS.get(d.verdict, "")}'


def misfit(summary: Mapping[str, float]) -> str:
    """Return how far model and measured Allan deviation are apart; empty where it is not known."""
    if 'misfit_percent' not in summary:
        return ''
    return (f'model and Allan deviation differ by {summary["misfit_percent"]:.2g} % rms up to a tenth of the record '
            f'(a true model: about {summary["misfit_expected"]:.2g} %)')


def source_rows(source: Mapping) -> list[tuple[str, str]]:
    """Return what was measured, as (what, value), without warnings and stretches left out."""
    names = {'path': 'file', 'topic': 'topic', 'samples': 'samples', 'rate_hz': 'rate', 'duration_s': 'duration', 'frame_id': 'frame'}
    out = []
    for key, value in source.items():
        if key in ('warnings', 'left_out') or value is None or value == '':
            continue
        if key == 'rate_hz':
            value = f'{value:.6g} Hz'
        elif key == 'duration_s':
            value = duration(value)
        elif key == 'start' and isinstance(value, (int, float)) and not isinstance(value, bool):
            value = _date(value)
        elif isinstance(value, float):
            value = f'{value:.6g}'
        out.append((names.get(key, str(key).replace('_', ' ')), str(value)))
    return out


def _date(stamp):
    from datetime import datetime, timezone
    if not 1e8 < stamp < 1e11:
        return f'{stamp:.6g} s'
    return datetime.fromtimestamp(stamp, timezone.utc).strftime('%Y-%m-%d %H:%M:%S UTC')


def next_steps(study: Study, folder: str = 'DIR') -> list[tuple[str, str]]:
    """Return (command, why): what to run next."""
    where = shlex.quote(str(folder)) if folder != 'DIR' else folder
    if any(t not in study.diagnosis for t in study.targets):
        return [(f'imu_noise diagnose {where}', 'finds out what is missing, if anything')]
    missing = {t: d.ranked[0].name for t, d in study.diagnosis.items() if d.verdict == 'missing' and d.ranked}
    if missing:
        said = ', '.join(f'{name} ({" ".join(t for t in missing if missing[t] == name)})' for name in dict.fromkeys(missing.values()))
        return [(f'imu_noise add {where}', f'puts {said} into the model and fits again')]
    out = []
    if study.domain == 'noise':
        out.append((f'imu_noise export {where} --format kalibr -o imu.yaml', 'writes the numbers for a consumer'))
    elif study.domain == 'calibration':
        out.append((f'imu_noise apply BAG -o BAG2 --calibration {where}', 'calibrates a recording'))
    if study.history:
        out.append((f'imu_noise history {where}', 'shows the models tried'))
    return out
