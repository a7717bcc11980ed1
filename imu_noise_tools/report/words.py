# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a study says, as short sentences and rows of strings; knows no terminal and no HTML."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timezone
import math
import shlex
from typing import Any

import numpy as np

from ..core import units
from ..core.record import sensor_of
from ..loop.diagnosis import Diagnosis
from ..loop.domains import package
from ..loop.effect import Effect, Estimate, Finding, Parameter, Score, View
from ..loop.findings import rivals
from ..loop.prediction import State
from ..loop.study import Step, Study
from ..loop.verdict import CANNOT_TELL, CHANCE, STRIKING

ERROR = 'held-out deviance'     # the one name of the error on data that the fit has not seen
UNSEEN = 'not observable'     # what is said of a value that the record cannot tell from zero

# name of a view: (what it looks at, what it means when it fails)
VIEWS = {
    'allan': ('Allan deviation', 'the curve lies beside the model\'s'),
    'frequency': ('power over frequency', 'at some frequencies the power is not the model\'s'),
    'time': ('mean over time', 'the mean moves in a way that the model does not foresee'),
    'variance': ('noise level over time',
                 'the noise level is higher at some times than at others'),
    'distribution': ('distribution of the samples',
                     'the samples do not spread as Gaussian noise does'),
    'spectrum': ('spectrum of the innovations',
                 'what the filter leaves has more or less power there than it foresees'),
    'shape': ('smooth form of the spectrum', 'the spectrum bends where the model does not'),
    'course': ('slow course of the mean',
               'the mean moves slowly in a way that is no noise of the model'),
    'coherence': ('other channels', 'it moves together with other axes or covariates'),
    'repeats': ('equal neighbours', 'samples repeat the one before more often than by chance'),
    'sweep': ('lines that sweep', 'a line moves through the frequencies, as of a machine that '
              'runs up or down'),
    'grid': ('levels of the output', 'the samples lie on few levels, evenly spaced'),
    'ends': ('first and last samples', 'the first or the last samples stand out'),
    'moments': ('single moments', 'at some moments the samples swing as noise does not'),
    'poses': ('poses left out', 'poses are not where the other poses put them'),
}
VERDICTS = {
    'missing': 'an effect is missing, and this record says which',
    'complete': 'nothing is missing that this record could show',
    'unknown': 'something is missing that no known effect explains',
    'undecidable': 'this record cannot tell which effect it is',
}
FIGURES = {'nis': 'normalised innovation squared (1 if the model is right)',
           'nats_per_sample': 'log-likelihood lost, nats a sample',
           'chi_squared': 'chi-squared', 'dof': 'degrees of freedom'}
QUALITY = {'missing': 'bad', 'unknown': 'bad', 'undecidable': 'doubt', 'complete': 'good'}
GLOSSARY = {
    'model': 'The sum of the named effects that were fitted to an axis: white + flicker says that '
             'these two make all of its noise.',
    ERROR: 'The error of a model on data that it was not fitted to, mean over the views. 0 is as '
           'good as the true model; what chance makes of it is given beside it.',
    'within chance': 'As large as a true model would show on a record of this length in 39 of 40 '
                     'cases, and no view fails.',
    'view': 'One way to look at what a model leaves: its spectrum, its mean and its level in '
            'time, its distribution, what it shares with other channels.',
    'pull': 'Measured minus model, in standard errors: 2 by chance once in twenty, 5 never.',
    'N, noise density': 'White noise: the Allan deviation at 1 s. Angle or velocity random walk.',
    'B, bias instability': 'Flicker noise: the flat part of the Allan curve is 0.664 B.',
    'K, random walk': 'The slow wandering of the bias: the Allan curve rises to K at 3 s.',
    UNSEEN: 'The record cannot tell it from zero: the limit given holds in 95 of 100.',
    'gain, nats': 'How much better a model with the candidate explains the data: a factor e of '
                  'likelihood each. What chance would gain is given beside it.',
    'undecidable': 'Two or more effects explain the same thing, or one gains little more than '
                   'chance does: this record cannot tell which, or whether.',
    'unknown': 'The model fails, and nothing that is known explains how.',
    'sufficient': 'What the model leaves changes no Allan deviation by more than 5 % and no '
                  'coefficient by more than its interval.',
}
_SOURCE = {'path': 'file', 'rate_hz': 'rate', 'duration_s': 'duration', 'frame_id': 'frame',
           'begin_s': 'analysed from'}


LARGE = 0.05    # of the power: what makes so much of it is worth a word, whether it matters or not


@dataclass(frozen=True)
class Row:
    """One coefficient as people read it: ``shown`` and ``interval`` in the field's unit."""

    label: str
    symbol: str
    title: str
    shown: str
    interval: str
    si: str
    note: str


# in sentences of their own
SAID_APART = ('warnings', 'notes', 'left_out', 'disturbances', 'streams')


def significant(value: float, std: float | None = None, least: int = 3) -> str:
    """Return a number to two digits of its standard deviation; to ``least`` digits without one."""
    if not math.isfinite(value):
        return str(value)
    if value == 0:
        return '0'
    power = math.floor(math.log10(abs(value)))
    if std and math.isfinite(std):
        least = min(max(power - math.floor(math.log10(std)) + 2, 2), 9)
    if -5 < power < 6:
        return f'{value:.{max(0, least - 1 - power)}f}'
    return f'{value:.{least - 1}e}'


def rows(state: State, target: str) -> list[Row]:
    """Return the coefficients of one target."""
    found = state.fit.estimates
    return [_row(effect, p, found[effect.label][p.name], target)
            for effect in state.model for p in effect.parameters
            if p.name in found.get(effect.label, {})
            and not _idle(effect, p, found[effect.label][p.name])]


def _idle(effect: Effect, parameter: Parameter, e: Estimate) -> bool:
    """Tell whether a parameter says no more than that this form of its effect is not there."""
    says = parameter.amplitude or parameter.choices and parameter.name not in effect.optional
    return e.value == 0 and not (e.std or e.note or says)


def _row(effect: Effect, parameter: Parameter, e: Estimate, target: str) -> Row:
    if parameter.choices or parameter.in_words(e.value):
        name = UNSEEN if e.value is None else (
            parameter.in_words(e.value) or str(parameter.written(e.value)))
        return Row(effect.label, parameter.name, parameter.title, name, '', '', e.note)
    factor, unit = 1.0, e.unit
    if effect.field_units:
        factor, unit = units.field(parameter.unit, sensor_of(target))
    unit, si_unit = ('' if u == '1' else f' {u}' for u in (unit, e.unit))
    shown, interval, si = UNSEEN, '', ''
    if e.value is not None:
        std = None if e.std is None else e.std / factor
        shown = significant(e.value / factor, std) + unit
        spread = f' ± {significant(e.std, least=2)}' if e.std else ''
        si = f'{significant(e.value, e.std)}{spread}{si_unit}'
        if e.ci95 is not None:
            interval = ' ... '.join(significant(v / factor, std) for v in e.ci95)
    elif e.upper95 is not None:
        interval = f'below {significant(e.upper95 / factor)}{unit}'
        si = f'< {significant(e.upper95)}{si_unit}'
    note = e.note if e.value is not None else e.note.removeprefix(f'{UNSEEN}: ')
    return Row(effect.label, parameter.name, parameter.title or effect.title, shown, interval, si,
               note)


def parameters_of(finding: Finding, target: str, si: bool = False) -> str:
    """Return the values that a candidate would have, in the field's units (and in SI)."""
    if finding.effect is None:
        return ''
    found = [_row(finding.effect, p, finding.estimates[p.name], target)
             for p in finding.effect.parameters if p.name in finding.estimates
             and not _idle(finding.effect, p, finding.estimates[p.name])]
    # what is not observable is one thing to say of all of them
    seen = [r for r in found if r.shown != UNSEEN or len(found) == 1]
    said = [f'{r.symbol} {r.shown}' + (f' [{r.si}]' if si and r.si else '') for r in seen]
    hidden = [r.symbol + (f' [{r.si}]' if si and r.si else '') for r in found if r not in seen]
    return ', '.join(said + ([f'{UNSEEN}: {" and ".join(hidden)}'] if hidden else []))


def error_in_words(error: Score) -> str:
    """Return the held-out deviance beside what chance allows."""
    if not math.isfinite(error.excess):
        return 'not known: nothing was left to predict'
    limit = CHANCE * error.std
    if error.failing and error.excess <= limit:  # the mean hides what one view shows
        return (f'{error.excess:.2g} in the mean, up to {limit:.2g} by chance; {error.side}: '
                f'{len(error.failing)} of {len(error.views)} views fail')
    return f'{error.excess:.2g}, {error.side} (up to {limit:.2g})'


def verdict_in_words(error: Score, d: Diagnosis | None) -> tuple[str, str]:
    """Return the verdict on one target in a line, and its quality: good, doubt, bad or faint."""
    if d is not None:
        # of what nothing explains: what is found matters, or may
        enough = not d.found and d.remaining is not None and d.sufficient
        return (diagnosis_in_words(d) + (' (sufficient all the same)' if enough else ''),
                'doubt' if enough else QUALITY.get(d.verdict, 'faint'))
    if not math.isfinite(error.excess):
        return 'not known: nothing was left to predict', 'doubt'
    views = ', '.join(title_of(v.name) for v in failing(error))
    if not views:
        return 'fails nowhere', 'good'
    return f'fails in {views}; not asked yet what is missing', 'bad'


def recording_in_words(source: Mapping) -> str:
    """Return what a recording is, in a line."""
    rate = source.get('rate_hz')
    parts = [f'{source["samples"]} samples' if source.get('samples') else '',
             f'at {rate:.6g} Hz' if rate else '',
             f'over {units.duration(source["duration_s"])}' if source.get('duration_s') else '']
    topic = source.get('topic')
    said = ' '.join(p for p in parts if p)
    return (f'{said}, topic {topic}.' if topic else f'{said}.') if said else 'See below.'


def times_in_words(source: Mapping) -> list[str]:
    """Say from when times count, where what is analysed begins later than the recording."""
    streams = {f'{k}: ': s for k, s in (source.get('streams') or {}).items()} or {'': source}
    return [f'{of}times count from {s["begin_s"]:.6g} s of the recording on, where what is '
            'analysed begins' for of, s in streams.items() if s.get('begin_s')]


def failing(error: Score) -> list[View]:
    """Return the views that fail by themselves, the surest first."""
    return [error.views[k] for k in error.failing]


def places_in_words(view: View, most: int = 3) -> str:
    """Return where a view fails most; nearby places are named once."""
    said: dict[str, str] = {}
    taken: list[float] = []
    for i in np.argsort(-np.abs(view.pull), kind='stable'):
        x, pull = float(view.x[i]), float(view.pull[i])
        if abs(pull) < STRIKING or len(said) == most:
            break
        if not any(_near(view, x, y) for y in taken):
            taken.append(x)
            said.setdefault(_place(view, x), _size(view, pull))
    if not said:
        return 'a little in many places, nowhere strikingly'
    return 'worst ' + ', '.join(f'{place} ({size})' for place, size in said.items())


def _near(view: View, x: float, y: float) -> bool:
    if view.unit == 'Hz' and x > 0 and y > 0:
        return abs(math.log(x / y)) < 0.4
    return abs(x - y) < 0.05 * np.ptp(view.x)


def _place(view: View, x: float) -> str:
    if view.unit == 'Hz':
        return f'near {x:.3g} Hz' + (f' (period {units.duration(1 / x)})' if 0 < x < 0.1 else '')
    if view.unit == 's':
        return f'at {units.duration(x)}'
    if view.unit == 'quantile':
        out = min(x, 1 - x)
        return 'in the tails' if out < 0.05 else 'on the flanks' if out < 0.3 else 'near the mean'
    return f'at {x:.3g} {view.unit}'.strip()


def _size(view: View, pull: float) -> str:
    more, less = {'frequency': ('too much', 'too little'), 'variance': ('too high', 'too low'),
                  'distribution': ('too many', 'too few')}.get(view.name, ('', ''))
    return f'{abs(pull):.2g} standard errors {more if pull > 0 else less}'.rstrip()


def title_of(view: str) -> str:
    """Return what a view looks at."""
    return VIEWS.get(view, (view.replace('_', ' '), ''))[0]


def view_in_words(view: View) -> str:
    """Return one sentence on a view that fails."""
    meaning = VIEWS.get(view.name, ('', 'the model does not describe it'))[1]
    return f'{title_of(view.name)}: {meaning}; {places_in_words(view)}'


def failed_in_words(test: Finding) -> str:
    """Return one sentence on a test that fails."""
    p = '' if test.p_value is None else f' (p = {test.p_value:.1g})'
    return f'{title_of(test.name)} fails its test{p}: {test.evidence}'


def change(step: Step) -> str:
    """Return what a rung of the ladder did to the model."""
    return f'+ {step.added}' if step.added else f'- {step.removed}' if step.removed else 'start'


def diagnosis_in_words(d: Diagnosis) -> str:
    """Return the verdict in one line."""
    if d.found:
        names = ', then '.join(dict.fromkeys(f.name for f in d.found))
        p = d.found[0].probability
        shared = '; '.join(f'{f.name}, but {f.against}' for f in d.ranked
                           if f.against.startswith(CANNOT_TELL))
        return f'missing: {names}' + ('' if p is None else f', probability {p:.2g}') + (
            f'; and {shared}' if shared else '')
    some = [f.name for f in rivals(d.ranked)]
    if d.verdict == 'undecidable' and some:
        return f'undecidable: {" or ".join(some)}{" or nothing" * (len(some) == 1)}'
    return f'{d.verdict}: {VERDICTS.get(d.verdict, "")}'


def percent(share: float) -> str:
    """Return a share for people; one that rounds to nothing is not nothing."""
    return 'less than 1 %' if 0 < share < 0.005 else f'{100 * share:.0f} %'


def finding_in_words(f: Finding, target: str, si: bool = False) -> str:
    """Return what was found, how sure it is, what it explains, its values and the evidence."""
    sure = '' if f.probability is None else f'probability {f.probability:.2f}'
    part = '' if f.explains is None else f'explains {percent(f.explains)} of what fails'
    said = '; '.join(s for s in (parameters_of(f, target, si), sure, part, f.evidence) if s)
    return f'{f.name}: {said}' if said else f.name


def remaining_in_words(d: Diagnosis) -> str:
    """Return what still fails with all that is found, and whether it matters; '' for nothing."""
    left = d.remaining
    if left is None:
        return ''
    where = '; '.join(f'{title_of(f.name)} ({f.evidence})' for f in left.failed)
    said = f'{"then" if d.found else "it"} still fails in: {where}.'
    if left.share is not None and left.largest_ratio is not None:
        said += f' {_weighed_in_words(left.share, left.largest_ratio, bool(d.sufficient))}'
    if left.nearest is not None and left.nearest.against:
        said += f' Nearest comes {left.nearest.name}, but {left.nearest.against}.'
    return said


def _weighed_in_words(share: float, ratio: float, enough: bool) -> str:
    """Return what is left: its share of the power, what it does to the curve, if it matters."""
    off = f'the Allan deviation {_off_in_words(ratio)}'
    power = f'That is {units.in_percent(share)} of the power'
    if not share:
        power = 'The power is as the model has it'
    elif enough and share > LARGE:     # the numbers hold, but much of the record has no name
        return (f'{power}, and what makes it is not known. The coefficients hold all the same: '
                f'{off}, and none of them leaves its interval by it.')
    return f'{power}, and {off}{": sufficient all the same" if enough else ""}.'


def _off_in_words(ratio: float) -> str:
    """Return how far a measured curve is from the model's, of their largest ratio."""
    if abs(ratio - 1) < 0.005:
        return 'is within chance'
    if ratio >= 2:
        return f'is up to {ratio:.3g} times the model\'s'
    return (f'is up to {100 * abs(ratio - 1):.2g} % {"above" if ratio > 1 else "below"} '
            'the model\'s')


def summary_in_words(summary: Mapping[str, float]) -> list[str]:
    """Return what else is known of a fit, one sentence each."""
    rest = dict(summary)
    out = []
    if {'misfit_percent', 'misfit_expected'} <= set(rest):
        found, expected = rest.pop('misfit_percent'), rest.pop('misfit_expected')
        out.append(f'model and measured Allan deviation differ by {found:.2g} percent rms up to '
                   f'a tenth of the record (a true model: some {expected:.2g} percent)')
    return out + [f'{FIGURES.get(k, k.replace("_", " "))}: {v:.4g}' for k, v in rest.items()]


def disturbed_in_words(source: Mapping) -> list[str]:
    """
    Return a sentence on each disturbed stretch of a record, and on each that was masked.

    When (seconds of the record, as ``--mask`` takes them), what, its largest deviation, on which
    axes, and whether it is set aside from the fit.

    """
    streams = source.get('streams')
    if streams:
        return [said for one in streams.values() for said in disturbed_in_words(one)]
    left = source.get('left_out') or ()
    said = []
    for d in source.get('disturbances') or ():
        sizes = []
        for sensor, unit in (('gyro', 'rad/s'), ('accel', 'm/s^2')):
            most = [v for a, v in d['size'].items() if a.startswith(sensor)]
            sizes += [f'up to {max(most):.3g} {unit}'] if most else []
        aside = any(a <= d['end'] and d['begin'] <= b for a, b, *_ in left)
        when = (
            f'at {d["begin"]:.6g} s' if d['end'] <= d['begin']
            else f'from {d["begin"]:.6g} s to {d["end"]:.6g} s'
        )
        said.append(
            f'{d["kind"]} {when}, {", ".join(sizes)} ({", ".join(d["size"])}): '
            + ('set aside' if aside else 'not set aside')
        )
    said += [
        f'left out: {a:.6g} s to {b:.6g} s, {why}' for a, b, why in left
        if not said or 'masked' in str(why)
    ]
    return said


def source_rows(source: Mapping) -> list[tuple[str, str]]:
    """
    Return what was measured, as (what, value), without warnings and stretches left out.

    Of sensors with a clock each, what differs is given for each.

    """
    streams = source.get('streams') or {}
    out = []
    for key, value in source.items():
        if key in SAID_APART or value is None or value in ('', [], {}):
            continue
        name = _SOURCE.get(key, str(key).replace('_', ' '))
        told = {sensor: _source_value(key, one[key]) for sensor, one in streams.items()
                if one.get(key) not in (None, '', [], {})}
        if len(set(told.values())) > 1:
            out += [(f'{name} ({sensor})', text) for sensor, text in told.items()]
        else:
            out.append((name, _source_value(key, value)))
    return out


def _source_value(key: str, value: Any) -> Any:
    if isinstance(value, (list, tuple)):
        return ', '.join(str(v) for v in value)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return str(value)
    if key == 'rate_hz':
        return f'{value:.6g} Hz'
    if key == 'duration_s':
        return units.duration(value)
    if key == 'begin_s':
        return f'{value:.6g} s of the record'
    if key == 'start' and 1e8 < value < 1e11:
        return datetime.fromtimestamp(value, timezone.utc).strftime('%Y-%m-%d %H:%M:%S UTC')
    return f'{value:.6g}' if isinstance(value, float) else str(value)


def next_steps(study: Study, folder: str = 'DIR') -> list[tuple[str, str]]:
    """Return (command, why): what to run next."""
    where = shlex.quote(str(folder))
    if any(t not in study.diagnosis for t in study.targets):
        return [(f'imu_noise diagnose {where}', 'finds out what is missing, if anything')]
    missing: dict[str, list[str]] = {}
    for t, d in study.diagnosis.items():
        if d.found:
            missing.setdefault(d.found[0].name, []).append(t)
    if missing:
        what = ', '.join(f'{name} ({" ".join(some)})' for name, some in missing.items())
        return [(f'imu_noise add {where}', f'puts in {what} and fits again')]
    domain = package(study.domain)
    undecided = any(d.verdict == 'undecidable' for d in study.diagnosis.values())
    steps = undecided and domain.DECIDES or domain.NEXT
    return [(command.format(study=where), why) for command, why in steps]
