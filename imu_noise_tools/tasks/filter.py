# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Filter a recorded bag: what a command and a script both call.

And what an analysed study states of the noise.

"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
import math
from pathlib import Path
from typing import Any

import numpy as np

from .. import report, store
from ..core import files
from ..core.errors import InputError, UsageError
from ..core.record import ImuRecord
from ..core.units import not_si, read_in, SI
from ..filter.design import aligned, AUTO, Design, design, memory
from ..filter.evaluate import Innovations
from ..filter.held import held_samples, REMEDY
from ..filter.motion import AnyMotion
from ..filter.output_noise import noise_blocks
from ..filter.problem import problem_of
from ..filter.recorded import filter_record, Filtered
from ..filter.statespace import DOMAIN, Motion, output_noise, OutputNoise
from ..health import motion_doubts, Selection
from ..loop.effect import Effect, find_effect, Model, model_of, registry
from ..loop.study import Study

TOPIC = 'imu/data_filtered'
AXES = ('gyro_x', 'gyro_y', 'gyro_z')
CORRELATED = (
    'the error of the filtered rate is correlated in time: give an estimator (a navigation filter,'
    ' visual-inertial odometry) the raw rate'
)
BIAS = 'a constant bias stays: a gyroscope alone cannot tell it from rotation'
Progress = Callable[[float | None, str], None]


@dataclass(frozen=True)
class Done:
    """
    What filtering a bag gave.

    ``bag`` and ``folder`` (of the study; None where the record is too short for one) are what was
    written, None where nothing was; ``figures`` are the innovations' of each axis under the filter
    that was run; ``notes`` say what was left out or is doubtful.

    """

    bag: Path | None
    folder: Path | None
    filtered: Filtered
    study: Study | None
    figures: Mapping[str, Innovations]
    notes: tuple[str, ...]

    def as_dict(self) -> dict:
        """Return the result as plain data."""
        return store.plain(
            {
                'bag': None if self.bag is None else str(self.bag),
                'study': None if self.folder is None else str(self.folder),
                'topic': TOPIC,
                **self.filtered.design.names,
                'alpha': self.filtered.design.alpha,
                'smooth': self.filtered.smooth,
                'delay_s': self.filtered.delay,
                'rate_hz': 1 / self.filtered.clock.interval,
                'counts': self.filtered.counts,
                'notes': list(self.notes),
                'axes': {
                    a: {
                        'nis': f.nis,
                        'mean': f.mean,
                        'lag1': f.lag1,
                        'kurtosis': f.kurtosis,
                        'samples': f.n,
                        **parts_of_a_sample(model, self.filtered.clock.interval),
                        'sigma_before': noise_of_a_sample(model, self.filtered.clock.interval),
                        'sigma_after': float(np.sqrt(np.nanmedian(self.filtered.variance[:, i]))),
                        # in motion it varies: this is what the error over the record comes to
                        'sigma_rms': float(np.sqrt(np.nanmean(self.filtered.variance[:, i]))),
                    }
                    for i, (model, (a, f)) in enumerate(
                        zip(self.filtered.design.noise, self.figures.items())
                    )
                },
                'targets': (
                    {} if self.study is None else store.study_to_dict(self.study)['targets']
                ),
            }
        )


def filter_bag(
    bag: str | Path,
    out: str | Path,
    *,
    model: str | Path | None = None,
    motion: Any = AUTO,
    noise: Any = ('white',),
    alpha: float = 1.0,
    values: Mapping | None = None,
    smooth: bool = False,
    delay: float = 0.0,
    topic: str | None = None,
    fields: str | None = None,
    gyro_unit: str | None = None,
    selection: Selection | None = None,
    rate_hz: float | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> Done:
    """
    Write a bag with ``imu/data_filtered`` beside all it holds, and a study of the innovations.

    The study, ``<out>.study``, starts from what ran: the bank for any motion and white noise, or
    the motion and noise named; what is given with ``model`` or ``values`` is stated, the rest
    fitted.

    Parameters
    ----------
    bag, out : str or Path
        The bag, and the one to write, of the same kind.
    model : str, Path or None
        Folder of a study: of noise (then it states the noise) or of a filter (then it states
        motion and noise).
    motion, noise, alpha, values
        As :func:`imu_noise_tools.filter.design.design`; the noise of ``model`` and the noise
        named add.
    smooth : bool
        Whether each rate knows the samples after it too.
    delay : float
        For how long, s, each rate waits for the samples after it, as the node does.
    topic, fields : str or None
        The Imu topic, and what of its messages, as for
        :func:`imu_noise_tools.bag.open_record`.
    gyro_unit : str or None
        Unit of the rates in the bag; by default that of the recording of ``model``, which is said.
        The new topic is in rad/s.
    selection : Selection or None
        The part that is filtered; the new topic holds no more.
    rate_hz : float or None
        Nominal rate; by default that of the stamps.
    force : bool
        Replace a bag and a study that are there.
    progress : callable or None
        Called with (share done, what).

    Raises
    ------
    InputError
        The bag cannot be read or has no gyroscope, something is in the way, no study in ``model``.
    UsageError
        An unknown effect, alpha out of range.

    """
    from ..bag import copy_bag
    folder = Path(f'{str(out).rstrip("/")}.study')
    # wrong usage is said before anything is read
    memory(design(motion, noise, alpha, values), smooth, delay)
    made: dict = {}
    unit = gyro_unit or (input_unit(model) if model is not None else None)
    why = 'as told' if gyro_unit else 'as the model\'s recording was'
    said = read_in({'gyro': unit} if unit and unit != SI['gyro'] else {}, why)
    together = ExitStack()      # bag and study take their places one right after the other

    def transform(record: ImuRecord):
        within = None if progress is None else lambda p, what: progress(0.3 + 0.4 * p, what)
        made.update(
            _filtered(record, model, motion, noise, alpha, values, rate_hz, within, smooth, delay))
        if made['study'] is not None:
            new = together.enter_context(files.new_folder(folder, force=force))
            for name, data in outputs(made['study'], folder).items():
                files.atomic_write(Path(new) / name, data)
        return made['changed']

    def share(p: float) -> None:
        if progress and p < 0.4:
            progress(0.3 * p / 0.4, 'reading')
        elif progress:
            progress(0.7 + 0.3 * (p - 0.4) / 0.6, 'writing')

    if not force and folder.exists():
        raise InputError(
            f'{folder}: exists already', 'replace it with --force, or choose another name'
        )
    with together:
        written = copy_bag(
            bag, out, transform, topic=topic, fields=fields, new_topic=TOPIC, force=force,
            progress=share, part=selection.bounds if selection else None, gyro_unit=unit,
            rate_hz=rate_hz,
        )
    study = made['study']
    return Done(written, None if study is None else folder, made['filtered'], study,
                made['figures'], (*said, *made['notes']))


def filter_samples(
    record: ImuRecord,
    *,
    model: str | Path | None = None,
    motion: Any = AUTO,
    noise: Any = ('white',),
    alpha: float = 1.0,
    values: Mapping | None = None,
    rate_hz: float | None = None,
    smooth: bool = False,
    delay: float = 0.0,
    progress: Progress | None = None,
) -> tuple[ImuRecord, Done]:
    """
    Return a record with filtered rates, and what filtering it gave; nothing is written.

    Options and errors are those of :func:`filter_bag`.

    """
    made = _filtered(
        record, model, motion, noise, alpha, values, rate_hz, progress, smooth, delay)
    done = Done(None, None, made['filtered'], made['study'], made['figures'], made['notes'])
    return replace(record, gyro=made['changed'].gyro), done


def outputs(study: Study, folder: str | Path | None = None) -> dict[str, str | bytes]:
    """Return all files of a filter's study by name; ``folder`` is what the page names."""
    pictures = report.pictures(study)
    return {**store.study_files(study), 'innovations.png': pictures['innovations'],
            'report.html': report.html(study, pictures, folder=str(folder or 'DIR'))}


def _filtered(
    record, model, motion, noise, alpha, values, rate_hz, progress, smooth, delay
) -> dict:
    """Filter a record and study its innovations."""
    from ..bag import Changed
    if record.gyro is None:
        raise InputError(f'{record.path} has no gyroscope', 'the filter is for angular rates')
    stated: Any = {}
    notes = motion_doubts(record)
    if model is not None:
        rate = rate_hz or record.rate_hz
        motion, noise, stated, more = from_study(model, motion, noise, 1 / rate)
        notes += more
    chosen = design(motion, noise, alpha, values)
    for label in values or ():
        if label not in (*chosen.names['motion'], *chosen.names['noise']):
            raise UsageError(f'a value is given for {label}, which is not in the model',
                             'name it under --motion or --noise')
    done = filter_record(record.t, record.gyro, chosen, rate_hz,
                         None if progress is None else lambda p: progress(p, 'filtering'), smooth,
                         delay)
    c = done.counts
    for count, what in (
        (c['refused'], 'not finite: refused'),
        (c['duplicates'], 'with the stamp of the one before'),
        (c['restarts'], 'after a gap or a jump backward: the filter began again'),
    ):
        if count:
            notes.append(f'{count} samples {what}')
    gyro = np.where(done.used[:, None], done.rate, record.gyro)
    covariance = np.zeros((record.n, 9))
    covariance[:, [0, 4, 8]] = np.where(done.used[:, None], done.variance, 0.0)
    figures = {a: Innovations.of(done.score[:, i]) for i, a in enumerate(AXES)}
    study = _study(record, chosen, stated, values, alpha, notes)
    return {
        'changed': Changed(gyro=gyro, gyro_covariance=covariance),
        'filtered': done,
        'figures': figures,
        'study': study,
        'notes': tuple(dict.fromkeys([*record.warnings, *notes, BIAS, CORRELATED])),
    }


def _study(record, chosen: Design, stated, values, alpha, notes) -> Study | None:
    """
    Return the study of the innovations, or None.

    None, with a note, where the record is too short or an axis constant.

    """
    problems, held = {}, held_samples(record.gyro)
    for i, axis in enumerate(AXES):
        given = {**stated.get(axis, {}), **(values or {})}
        try:
            problems[axis] = problem_of(
                record.t, record.gyro[:, i], axis, given, alpha, held)
        except InputError as error:
            notes.append(f'{axis} is not in the study: {error.message}: {error.remedy}')
    if not problems:
        return None
    if held is not None:
        notes.append(f'{np.mean(held):.0%} of the messages repeat the one before: they are left'
                     ' out of what is judged, but the filter takes them for new samples;'
                     f' {REMEDY}')
    names = [AnyMotion.name] if chosen.motion is None else [e.name for e in chosen.motion[0]]
    parts = {axis: p.part for axis, p in problems.items()}
    for first, last in sorted(set(parts.values())):
        if last - first < record.n:
            axes = ', '.join(a for a, part in parts.items() if part == (first, last))
            notes.append(f'{axes}: judged by samples {first} to {last - 1} of {record.n}, the'
                         ' longest stretch without a pause (or, of many losses, without one), or'
                         ' its beginning')
    model = model_of(DOMAIN, [*names, *(e.name for e in chosen.noise[0])])
    source = {
        'path': record.path,
        'topic': record.topic,
        'samples': record.n,
        'rate_hz': record.rate_hz,
        'duration_s': record.duration_s,
        'start': record.start,
        'frame_id': record.frame_id,
        **({'input_unit': dict(record.input_unit)} if record.input_unit else {}),
        **chosen.names,
        'alpha': alpha,
        'judged': {axis: list(part) for axis, part in parts.items()},
        'warnings': [*record.warnings, *notes, BIAS, CORRELATED],
    }
    return Study.begin(problems, model, source)


def noise_of_a_sample(model: Model, dt: float) -> float:
    """
    Return the standard deviation, rad/s, of what the noise of an output adds to a sample.

    The white part and what is beside it (a Gauss-Markov process, a line, an hour's random walk):
    what is left of them is in the variance of the filtered rate too.

    """
    return math.hypot(*parts_of_a_sample(model, dt).values())


def parts_of_a_sample(model: Model, dt: float) -> dict[str, float]:
    """Return the standard deviations, rad/s, of what of it is white and of what wanders."""
    b = output_noise(model, dt)
    return {'sigma_white': float(np.sqrt(b.r)), 'sigma_slow': float(np.sqrt(b.h @ b.p0 @ b.h))}


def input_unit(folder: str | Path) -> str | None:
    """Return the unit, not rad/s, that the rates of a study's recording came in, or None."""
    source = store.read(folder)['source']
    stated: dict = {}
    for one in (source, *(source.get('streams') or {}).values()):
        stated |= one.get('input_unit') or {}
    return not_si(stated, str(folder)).get('gyro')


def from_study(
    folder: str | Path, motion: Any = AUTO, noise: Any = ('white',), dt: float | None = None
) -> tuple[Any, Any, Any, list[str]]:
    """
    Return (motion, noise, stated values by axis and label, notes) from the folder of a study.

    A noise study states the noise of each axis, as blocks over the interval dt (s); a study of a
    filter its motion and noise, where the caller names no motion. Effects of ``noise`` that the
    study has not are added, typical.

    Raises
    ------
    InputError
        No study, or one of a calibration.

    """
    data = store.read(folder)
    if data['domain'] not in ('noise', DOMAIN):
        raise InputError(
            f'{folder}: a study of a {data["domain"]}', 'give one that analyse or filter wrote'
        )
    entries = {a: data['targets'][a] for a in AXES if a in data['targets']}
    if not entries:
        raise InputError(f'{folder}: no gyroscope axis', 'analyse a recording that has one')
    found, notes = {}, []
    for axis, entry in entries.items():
        if data['domain'] == 'noise':
            rate = data['source'].get('rate_hz')
            effects, unseen = _noise_effects(entry['effects'])
            model, more = noise_blocks(effects, dt or 1 / rate)
            notes += [f'{axis}: {m}' for m in (*unseen, *more)]
        else:
            model = Model(
                find_effect(DOMAIN, e['effect'])(_points(e), label)
                for label, e in entry['effects'].items()
            )
        found[axis] = model
    some = next(iter(found.values()))
    whole = aligned([found.get(a, some) for a in AXES])
    noises = [Model(m.of(OutputNoise)) for m in whole]
    wanted = [noise] if isinstance(noise, str) else [] if isinstance(noise, Model) else list(noise)
    if wanted and isinstance(wanted[0], Model):
        raise UsageError('both a study and noise models are given', 'give only one')
    for name in wanted:
        if name and name not in noises[0]:
            noises = [m + find_effect(DOMAIN, name)() for m in noises]
    moving = [Model(m.of(Motion)) for m in whole]
    if data['domain'] == DOMAIN and motion in (AUTO, [AUTO], (AUTO,)):
        motion = moving
    stated = {
        a: {e.label: dict(e.values) for e in m if e.fitted and e.parameters}
        for a, m in zip(AXES, noises)
    }
    return motion, noises, stated, notes


def _noise_effects(entries) -> tuple[list[Effect], list[str]]:
    """Return the effects of an axis in study.yaml that have values; notes on the others."""
    found, notes = [], []
    for label, entry in entries.items():
        values: dict = {k: e.get('value') for k, e in entry.items() if isinstance(e, dict)}
        if entry['effect'] not in registry('noise'):
            notes.append(f'{label} left out: unknown here')
        elif None in values.values():
            notes.append(f'{label} left out: not observable')
        else:
            found.append(find_effect('noise', entry['effect'])(values, label))
    return found, notes


def _points(entry) -> dict:
    """Return the most likely values of an effect in study.yaml."""
    return {
        k: e['value'] if e.get('value') is not None else e.get('point', 0.0)
        for k, e in entry.items()
        if isinstance(e, dict)
    }
