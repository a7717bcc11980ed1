# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Analyse a record, and go on with a study on disk."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
import csv
from dataclasses import replace
import io
from pathlib import Path
from typing import Any, cast

import numpy as np

from .. import export, report, store
from ..bag import imus, open_record, Scratch
from ..core import files
from ..core.errors import ImuNoiseError, InputError, unknown, UsageError
from ..core.record import ImuRecord, Memory, sensor_of
from ..health import prepare, Selection
from ..loop.effect import model_of
from ..loop.study import assess, Study
from ..noise.beside import seen_from
from ..noise.curve import model_curve
from ..noise.evidence import Evidence
from ..noise.gather import gather
from ..noise.problem import METHODS, NoiseProblem

DEFAULT_EFFECTS = ('white', 'flicker', 'random_walk')
Progress = Callable[[float | None, str], None]


def analyse_record(
    record: ImuRecord,
    *,
    axes: Iterable[str] | None = None,
    effects: Iterable[str] = DEFAULT_EFFECTS,
    method: str = 'likelihood',
    bias_at: str = 'flat',
    deviation: str = 'oadev',
    points: int = 100,
    octaves: bool = False,
    keep_motion: bool = False,
    selection: Selection | None = None,
    progress: Progress | None = None,
    memory: Memory | None = None,
) -> Study:
    """
    Return the study of a record: screened, gathered, fitted with exactly these effects.

    Parameters
    ----------
    record : ImuRecord
        As recorded; the longest still stretch of it is analysed.
    axes : iterable of str or None
        None for all that are there and move.
    effects, method, bias_at
        The model and how it is fitted (:mod:`imu_noise_tools.noise.problem`).
    deviation, points, octaves
        The curve (:func:`imu_noise_tools.core.allan.curve`).
    keep_motion : bool
        Analyse everything, still or not.
    selection : Selection or None
        Which part of the record, what is set aside of it; None for all, screened.
    progress : callable or None
        Called with (share done or None, what).
    memory : Memory or None
        Where arrays as long as the record are kept.

    Raises
    ------
    InputError
        Nothing in the record can be analysed.
    UsageError
        An unknown axis, effect or method.

    """
    model = model_of('noise', effects)
    if not len(model):
        raise UsageError('no effects to fit', f'e.g. --effects {",".join(DEFAULT_EFFECTS)}')
    if method not in METHODS:
        raise unknown('method', method, METHODS)
    for a in axes or ():
        sensor_of(a)
    selection = selection or Selection()
    ready = [
        prepare(
            selection.part(one),
            keep_motion=keep_motion,
            memory=memory,
            screen=selection.screen,
            masks=selection.masks,
        )
        for one in record.streams
    ]
    del record
    chosen = _axes(ready, axes)
    evidence = _gathered(
        ready,
        chosen,
        deviation=deviation,
        points=points,
        octaves=octaves,
        progress=(lambda p, what: progress(0.8 * p, what)) if progress else None,
        memory=memory,
    )
    rest = (lambda p, what: progress(0.8 + 0.2 * p, what)) if progress else None
    problems = {a: NoiseProblem(e, method=method, bias_at=bias_at) for a, e in evidence.items()}
    source = source_of(ready, method)
    if keep_motion:
        source['keep_motion'] = True
    return Study.begin(problems, model, source, rest)


def _gathered(ready: Sequence[ImuRecord], axes, progress=None, **how) -> dict[str, Evidence]:
    """Gather the axes of each prepared record for itself, beside what the others tell of it."""
    out: dict[str, Evidence] = {}
    for k, record in enumerate(ready):
        mine = [a for a in axes if a in record.axes]
        if not mine:
            continue
        beside = {n: x for other in ready if other is not record
                  for n, x in seen_from(record, other).items()}
        part = (lambda p, what, k=k: progress((k + p) / len(ready), what)) if progress else None
        record = replace(record, covariates={**record.covariates, **beside})
        out.update(gather(record, mine, progress=part, **how))
    return {a: out[a] for a in axes}


def _axes(ready: Sequence[ImuRecord], axes: Iterable[str] | None) -> list[str]:
    able = [a for r in ready for a in r.axes if np.ptp(r.column(a)) > 0]
    path = ready[0].path
    if axes is None:
        if not able:
            raise InputError(
                f'{path}: every axis is constant',
                'check that the driver publishes live data',
            )
        return able
    axes = list(dict.fromkeys(axes))
    missing = [a for a in axes if a not in able]
    if missing:
        raise InputError(
            f'{path}: {", ".join(missing)} is constant or not recorded',
            f'choose from {", ".join(able)}',
        )
    return axes


def source_of(ready: Sequence[ImuRecord], method: str) -> dict:
    """
    Return where prepared records came from, for study.yaml.

    Of several (sensors with a clock each) it is the first, with all of them in ``streams``.

    """
    first, *others = (_one_source(r) for r in ready)
    out = {**first, 'method': method}
    if others:
        streams = {r.axes[0].partition('_')[0]: one for r, one in zip(ready, (first, *others))}
        out['warnings'] = list(dict.fromkeys(
            w if w in ready[0].warnings and w in r.warnings else f'{sensor}: {w}'
            for (sensor, one), r in zip(streams.items(), ready) for w in one['warnings']))
        out['streams'] = {
            s: {k: v for k, v in one.items() if k not in ('path', 'warnings')}
            for s, one in streams.items()
        }
    return out


def _one_source(record: ImuRecord) -> dict:
    """Return it of one record; stretches in seconds of the record, as ``--mask`` takes them."""
    begin = float(record.t[0])
    return {
        'path': record.path,
        'topic': record.topic,
        'samples': record.n,
        'rate_hz': record.rate_hz,
        'duration_s': record.duration_s,
        'start': record.start + begin,
        **({'begin_s': begin} if begin else {}),
        'frame_id': record.frame_id,
        **({'input_unit': dict(record.input_unit)} if record.input_unit else {}),
        'covariates': list(record.covariates),
        'warnings': list(record.warnings),
        'left_out': [list(one) for one in record.left_out],
        'disturbances': [
            {'begin': d.begin, 'end': d.end, 'kind': d.kind, 'size': dict(d.size)}
            for d in record.disturbances
        ],
    }


def analyse_bag(
    bag: str | Path,
    *,
    topic: str | None = None,
    fields: str | None = None,
    rate_hz: float | None = None,
    input_kind: str = 'rate',
    gyro_unit: str | None = None,
    accel_unit: str | None = None,
    progress: Progress | None = None,
    **options: Any,
) -> Study:
    """
    Return the study of a bag, each sensor of it at its own rate; nothing is written.

    Raises what :func:`analyse_record` and :func:`imu_noise_tools.bag.open_record` raise.

    """
    model_of(
        'noise', options.get('effects', DEFAULT_EFFECTS)
    )  # wrong usage is said before anything is read
    for a in options.get('axes') or ():
        sensor_of(a)
    reading = (lambda p: progress(0.5 * p, 'reading')) if progress else None
    memory = Scratch()
    record = open_record(
        bag,
        topic,
        fields=fields,
        gyro_unit=gyro_unit,
        accel_unit=accel_unit,
        input_kind=input_kind,
        rate_hz=rate_hz,
        progress=reading,
        memory=memory,
        apart=True,
    )
    rest = (lambda p, what: progress(0.5 + 0.45 * p, what)) if progress else None
    study = analyse_record(record, progress=rest, memory=memory, **options)
    if fields:
        study.source['fields'] = fields
    return study


def analyse(
    bag: str | Path,
    out: str | Path | None = None,
    *,
    force: bool = False,
    **options: Any,
) -> tuple[Study, Path]:
    """
    Analyse a bag and write its study.

    Return both the study and its folder (``<bag>.study`` unless given).

    Raises what :func:`analyse_bag` raises, whose the options are, and InputError where the folder
    holds a study already and ``force`` is not given.

    """
    folder = Path(out) if out is not None else default_folder(bag)
    with files.new_folder(folder, force=force) as new:
        study = analyse_bag(bag, **options)
        for name, data in outputs(study, folder).items():
            files.atomic_write(Path(new) / name, data)
    return study, folder


def analyse_every(
    bag: str | Path,
    out: str | Path | None = None,
    *,
    force: bool = False,
    fields: str | None = None,
    **options: Any,
) -> tuple[dict[str, Study], dict[str, str], Path]:
    """
    Analyse each IMU of a bag and write a study of each, in a folder of its own below ``out``.

    Returns
    -------
    studies : dict
        By the name of the folder, which is that of the topic.
    refused : dict
        Why the others cannot be analysed, by topic.
    folder : Path
        Where the folders are.

    Raises
    ------
    InputError, UsageError
        As :func:`analyse`; none of them can be analysed.

    """
    folder = Path(out) if out is not None else default_folder(bag)
    studies: dict[str, Study] = {}
    refused: dict[str, ImuNoiseError] = {}
    with files.new_folder(folder, force=force) as new:
        for topic in imus(bag, fields):
            first = topic.partition(',')[0].strip('/').replace('/', '_') or 'imu'
            name = next(n for n in (first, *(f'{first}_{k}' for k in range(2, 1000)))
                        if n not in studies)
            try:
                study = analyse_bag(bag, topic=topic or None, fields=fields, **options)
            except InputError as error:
                refused[topic] = error
                continue
            studies[name] = study
            Path(new, name).mkdir()
            for file, data in outputs(study, folder / name).items():
                files.atomic_write(Path(new) / name / file, data)
        if not studies:
            raise next(iter(refused.values()))
        files.atomic_write(Path(new) / 'studies.yaml', store.dump_yaml({
            'studies': {n: s.source['topic'] for n, s in studies.items()},
            'refused': {t: str(e) for t, e in refused.items()}}))
    return studies, {t: str(e) for t, e in refused.items()}, folder


def look_again(study: Study, bag: str | Path, progress: Progress | None = None) -> None:
    """
    Draw a study's evidence anew from its recording, with what effects known since then look at.

    An effect of one's own that looks at the samples keeps what it saw when a record is analysed;
    where it is given for the first time afterwards, the samples are asked for.

    Raises
    ------
    UsageError
        The study is not of noise: the others keep all that there is.
    InputError
        The recording is not the one of the study, or not as it was read then.

    """
    if study.domain != NoiseProblem.domain:
        raise UsageError(
            f'--bag does not apply to a {study.domain} study', 'it keeps all its samples')
    source, memory = study.source, Scratch()
    streams = source.get('streams') or {'': source}
    topic = ','.join(one['topic'] for one in streams.values() if one.get('topic'))
    units = {f'{s}_unit': unit for one in streams.values()
             for s, unit in (one.get('input_unit') or {}).items()}
    record = open_record(
        bag, topic or None, memory=memory, apart=True, fields=source.get('fields'), **units)
    moving = bool(source.get('keep_motion'))
    ready = [prepare(one, keep_motion=moving, memory=memory) for one in record.streams]
    problems = {t: cast(NoiseProblem, s.problem) for t, s in study.states.items()}
    before = {t: p.evidence for t, p in problems.items()}
    missing = [t for t in before if not any(t in r.axes for r in ready)]
    kind = next(iter(before.values())).curve.deviation
    found = _gathered(ready, list(before), deviation=kind, progress=progress,
                      memory=memory) if not missing else {}
    for target, old in before.items():
        new = found.get(target)
        if new is None or new.n != old.n or not np.isclose(new.curve.dev[0], old.curve.dev[0]):
            raise InputError(
                f'{bag}: not the recording of this study, or not read as it was then ({target})',
                'analyse it again, with --effects-from and --force')
        p = problems[target]
        p = NoiseProblem(replace(new, curve=old.curve), method=p.method, bias_at=p.bias_at)
        study.states[target] = assess(p, study.states[target].model)


def default_folder(bag: str | Path) -> Path:
    """Return ``<bag>.study`` beside the bag."""
    path = Path(bag)
    return (
        path.parent / f'{path.resolve().name if path.name in ("", ".", "..") else path.name}.study'
    )


def outputs(study: Study, folder: str | Path | None = None) -> dict[str, str | bytes]:
    """
    Return all files of a noise study by name.

    ``folder`` is what the page's next commands name.

    """
    shown = report.pictures(study)
    return {
        **store.study_files(study),
        'imu.yaml': export.export(study, 'kalibr'),
        'allan.csv': allan_csv(study),
        'allan.png': shown['allan'],
        'report.html': report.html(study, shown, folder=str(folder or 'DIR')),
    }


def allan_csv(study: Study) -> str:
    """
    Return the curves with the model's deviation beside them.

    With a column ``motion`` more where motion may be in them.

    """
    kept = ['kept'] if study.source.get('keep_motion') else []
    text = io.StringIO()
    writer = csv.writer(text, lineterminator='\n')
    writer.writerow(
        ['axis', 'tau_s', 'n', 'adev', 'adev_lo', 'adev_hi', 'percent_error', 'edf', 'model',
         *(['motion'] if kept else [])]
    )
    for axis, state in study.states.items():
        evidence = cast(NoiseProblem, state.problem).evidence
        c = evidence.curve
        model = np.sqrt(model_curve(evidence, state.model, c.m))
        for row in zip(c.tau, c.count, c.dev, c.lo, c.hi, c.percent_error, c.edf, model):
            writer.writerow(
                [axis, repr(float(row[0])), int(row[1]), *(repr(float(x)) for x in row[2:]), *kept]
            )
    return text.getvalue()
