# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Calibrate from bags, keep the result as a study, correct a bag, and a session for the node."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
import re
from typing import Any

import numpy as np

from .noise import default_folder
from .. import calibration as core
from .. import report, store
from ..core import files
from ..core.clipped import stays
from ..core.errors import FitError, InputError, UsageError
from ..core.record import ImuRecord
from ..core.units import DEG, not_si, read_in, SI, to_si
from ..health import evenly_stamped, in_motion, Selection, unit_doubts
from ..loop.study import Study

FILE = 'calibration.yaml'
WROTE = 'name a folder that calibrate wrote'
CALIBRATED = 'imu/data_calibrated'
Progress = Callable[[float | None, str], None]
# A face in the name of a bag that holds one face: left_-z.mcap, x_up, minus_y, zn
_FACE = re.compile(r'(?:^|[^a-z0-9])(?:([+-])([xyz])|([xyz])_?(up|down|pos|neg|p|n)'
                   r'|(plus|minus)_?([xyz]))$')


@dataclass(frozen=True)
class Calibrated:
    """What calibrating gave: the solution, its study, and its folder (None: not written)."""

    calibration: core.Calibration
    study: Study
    folder: Path | None = None
    #: the gyroscope's, where one recording gave both
    gyro: core.Calibration | None = None


def face_in_name(path: str | Path) -> str | None:
    """Return the face that a bag's name says is up (``bench_-z``, ``x_up``), or None."""
    found = _FACE.search(Path(path).stem.lower())
    if not found:
        return None
    sign, axis = found[1] or found[4] or found[5], found[2] or found[3] or found[6]
    return ('+' if sign in ('+', 'up', 'pos', 'p', 'plus') else '-') + axis


def calibrate_records(records: Iterable[ImuRecord], *, sensor: str | None = None,
                      gravity: float | None = None,
                      latitude: float | None = None, height: float | None = None,
                      rate_deg_s: float | None = None, turn_deg: float | None = None,
                      tilt_deg: float = 1.0,
                      method: str | None = None, seconds: float = core.STILL_S) -> Calibrated:
    """
    Calibrate from records: all poses in one, or one record a pose.

    Without a sensor, a rate or a turn, the gyroscope too by the turns between the poses, where
    these tell enough; else the notes say why not.

    Parameters
    ----------
    records : iterable of ImuRecord
        As recorded, with rests (faces, turns) in them.
    sensor : str, optional
        ``accel`` or ``gyro`` alone (gyro where a rate or a turn is given); both unless given.
    gravity, latitude, height : float, optional
        Local gravity in m/s^2, or where it is (degrees, metres) for the WGS-84 formula.
    rate_deg_s, turn_deg : float, optional
        For the gyroscope: rate of the table, or angle of hand turns.
    tilt_deg : float
        How well the faces are level: rms of each of two angles.
    method : str, optional
        ``faces``, ``wls``, ``ols``, ``norm`` or ``few``; chosen from the poses when not given.
    seconds : float
        Shortest rest that counts as a pose.

    Raises
    ------
    InputError, FitError
        Faces are missing, it moves all the time, the unit is wrong ...: with number and remedy.
    UsageError
        Options that contradict each other.

    """
    records = [in_motion(r) for r in records]
    if not records:
        raise UsageError('nothing to calibrate from', 'name a bag')
    if not 0 <= tilt_deg <= 10:
        raise UsageError(f'invalid tilt: {tilt_deg:g} deg', 'it must be 0 to 10')
    known = rate_deg_s is not None or turn_deg is not None
    if sensor == 'accel' and known:
        raise UsageError('--rate and --turn are for the gyroscope',
                         'leave them out, or --sensor gyro')
    g, origin = core.gravity(gravity, latitude, height)
    gyro: core.Calibration | None = None
    if known or sensor == 'gyro' and _by_columns(records):
        poses, notes = _turns(records, rate_deg_s, turn_deg, latitude, seconds)
        result = core.calibrate(poses, method, tilt_deg * DEG, notes=notes)
    else:
        poses, notes = _faces(records, g, seconds)
        result = core.calibrate(poses, method, tilt_deg * DEG, notes=notes)
        if sensor != 'accel':
            gyro, why = _by_turns_between(records, result, g, seconds, sensor == 'gyro')
            result = replace(result, notes=(*result.notes, *why))
        if sensor == 'gyro':
            assert gyro is not None
            result, gyro = gyro, None
    first = records[0]
    source = {
        'path': first.path, 'topic': first.topic, 'samples': sum(r.n for r in records),
        'rate_hz': first.rate_hz, 'duration_s': float(sum(r.duration_s for r in records)),
        'start': first.start, 'frame_id': first.frame_id, 'records': [r.path for r in records],
        'input_unit': dict(first.input_unit),
        'gravity': g, 'gravity_from': origin, 'notes': list(result.notes),
        'warnings': [*dict.fromkeys(w for r in records for w in r.warnings), *result.warnings]}
    if gyro is not None:
        source['gyro'] = {'notes': list(gyro.notes), 'warnings': list(gyro.warnings)}
    return Calibrated(result, study_of(result, source, gyro), gyro=gyro)


def _by_columns(records) -> bool:
    """Tell whether the true rate was recorded along."""
    return any(name in r.covariates for r in records for name in core.REFERENCE)


def _by_turns_between(records, accel, gravity, seconds, asked):
    """
    Return the gyroscope's calibration by the turns between the poses, or None, and notes.

    Axes that contradict each other are refused in any case, what is too little only where it is
    asked for.

    """
    notes = _clipped_turns(records)
    if asked:           # else the accelerometer's notes say so
        notes += filter(None, (core.too_short(r, seconds) for r in records))
    better = core.completed(accel)
    more = [e.name for e in better.fit.model.of(core.Regressor)
            if e.label not in accel.fit.model]
    if more:
        notes.append(f'directions are those of the accelerometer with {" and ".join(more)}, which '
                     'its diagnosis finds')
    parts, even, found = [], [], []
    why: InputError | FitError = InputError('there is no gyroscope', 'record both sensors')
    try:
        for r in records:
            if r.gyro is not None:
                rests, said = core.held(r, core.rests(r, seconds))
                parts.append(core.gathered(r, rests, better.correction, gravity))
                notes += [*said, *core.coarse('gyro', r.gyro, rests, r.rate_hz)]
                again = evenly_stamped(r)
                even.append(parts[-1] if again is None else core.gathered(
                    again, rests, better.correction, gravity))
    except InputError as error:
        parts, why = [], error
    ways = [core.together(parts)] if parts else []
    if any(e is not p for e, p in zip(even, parts)):
        ways.append(core.together(even))
    if ways:
        core.refuse_crossed_axes(ways[0])
    for turns in ways:
        try:
            found.append(core.calibrate_turns(turns, notes, better))
        except (InputError, FitError) as error:
            why = error
    if found:
        return _borne_out(found), ()
    if asked:
        raise why
    return None, (f'the gyroscope is left out: {why.message}',)


def _borne_out(found: list[core.Calibration]) -> core.Calibration:
    """
    Return the calibration by which turns miss gravity least: by stamps, or by even samples.

    A driver that stamps late is no clock, and one that asks the sensor samples when it asks: the
    turns tell which it is.

    """
    miss = [c.problem.summary(c.fit)['residual_rms'] / DEG for c in found]
    best = int(np.argmin(miss))
    if not best:
        return found[0]
    return replace(found[best], notes=(
        *found[best].notes, f'samples are taken as even: turns miss gravity by {miss[best]:.2g} '
        f'deg rms so, and by {miss[0]:.2g} deg by their stamps, which scatter'))


def _clipped_turns(records) -> list[str]:
    """Say which gyroscope axes stand at the end of their range: such turns are left out."""
    counts = {f'gyro_{axis}': sum(int(stays(r.gyro[:, k]).sum()) for r in records
                                  if r.gyro is not None) for k, axis in enumerate('xyz')}
    return [f'{name} is saturated in {n} samples: turns with it are left out; turn more slowly'
            for name, n in counts.items() if n]


def _faces(records, g, seconds):
    """Return the accelerometer's poses; a record named after its face has to agree."""
    parts: list = []
    notes: list[str] = []
    for r in records:
        poses, said = core.positions(r, g, seconds)
        parts.append(poses)
        notes += said
        expected = face_in_name(r.path) if len(records) > 1 else None
        if expected:
            face, _ = core.nearest_face(poses.outputs.mean(1))
            if face == ('-' if expected[0] == '+' else '+') + expected[1]:
                raise InputError(f'{r.path}: by its name {expected} is up, but {face} reads +g: '
                                 f'upside down',
                                 'REP-145: +g on the axis that points up; mend the driver\'s '
                                 'sign, or rename the bag')
            if face != expected:
                raise InputError(f'{r.path}: by its name {expected} is up, but {face} reads +g',
                                 'rename the bag, or check the axes of the driver')
    return numbered(core.joined(parts)), notes


def numbered(poses: core.Poses) -> core.Poses:
    """Return poses that have no name of their own numbered through."""
    names = [f'pose {k + 1}' if n.startswith('pose ') else n for k, n in enumerate(poses.names)]
    return replace(poses, names=tuple(names))


def _turns(records, rate_deg_s, turn_deg, latitude, seconds):
    known = {'rate': None if rate_deg_s is None else rate_deg_s * DEG,
             'turn': None if turn_deg is None else turn_deg * DEG}
    found = [core.turns(r, **known, latitude=latitude, seconds=seconds, partly=len(records) > 1)
             for r in records]
    poses = core.joined([p for p, _ in found])
    notes = tuple(dict.fromkeys(n for _, said in found for n in said))
    if len(records) > 1 and (rate_deg_s or turn_deg):
        core.refuse_missing_axes(poses.names, 'turn' if rate_deg_s is None else 'rate', notes)
    return poses, notes


def study_of(calibration: core.Calibration, source: Mapping | None = None,
             gyro: core.Calibration | None = None) -> Study:
    """Return the study that the loop drives: a target each sensor."""
    problems = {c.sensor: c.problem for c in (calibration, gyro) if c is not None}
    return Study.begin(problems, calibration.fit.model, source)     # type: ignore[arg-type]


def as_dict(study: Study) -> dict:
    """
    Return the data of calibration.yaml: numbers, where they are from, diagnosis.

    One sensor at the top; two as ``accel`` and ``gyro``, with the ``time_offset`` between. The
    numbers are SI; ``input_unit`` is what the samples came in, by sensor.

    """
    stated = study.source.get('input_unit') or {}
    data: dict[str, Any] = {
        'format': 'imu_noise_calibration/1',
        'input_unit': {**{target: SI[target] for target in study.targets}, **stated}}
    said = ('notes', 'warnings', 'input_unit', *study.targets)
    source = {k: v for k, v in study.source.items() if k not in said}
    parts = {target: _part(study, target) for target in study.targets}
    if len(parts) == 1:
        data.update(*parts.values())
    else:
        data.update(parts)
    data['source'] = source
    for target in study.targets:
        offset = core.offset_of(core.of_study(study, target))
        if offset is not None:
            data['time_offset'] = offset
    if 'accel' in study.targets and 'gravity' in study.source:
        data['gravity'] = study.source['gravity']
    return store.plain(data)


def _part(study, target):
    """Return what calibration.yaml holds of one sensor."""
    found = study.diagnosis.get(target)
    return {**core.as_dict(core.of_study(study, target)),
            'diagnosis': store.diagnosis_to_dict(target, found) if found else {}}


def outputs(study: Study, folder: str | Path | None = None) -> dict[str, str | bytes]:
    """Return all files of a calibration study by name; ``folder`` is what the page names."""
    shown = report.pictures(study)
    both = [shown['poses'], *(shown[f'target {t}'] for t in study.targets[1:])]
    return {**store.study_files(study), 'calibration.png': report.stacked(both),
            'report.html': report.html(study, shown, folder=str(folder or 'DIR')),
            FILE: store.dump_yaml(as_dict(study))}


def calibrate(
    bags: Iterable[str | Path] | str | Path,
    out: str | Path | None = None,
    *,
    topic: str | None = None,
    fields: str | None = None,
    selection: Selection | None = None,
    gyro_unit: str | None = None,
    accel_unit: str | None = None,
    rate_hz: float | None = None,
    force: bool = False,
    progress: Progress | None = None,
    **options: Any,
) -> Calibrated:
    """
    Calibrate from bags; write calibration.yaml, a picture, a report and the study.

    ``out`` is ``<first bag>.study`` unless given; ``selection`` is the part of each bag that is
    read; options are those of :func:`calibrate_records`.
    Nothing is written when the calibration is refused.

    Raises
    ------
    InputError, FitError, UsageError
        What :func:`calibrate_records` and :func:`imu_noise_tools.bag.open_record` raise; a study
        in the way.

    """
    from ..bag import open_record
    bags = [bags] if isinstance(bags, (str, Path)) else list(bags)
    folder = Path(out) if out is not None else default_folder(bags[0])
    with files.new_folder(folder, force=force) as new:
        records = []
        for k, bag in enumerate(bags):
            if progress:
                progress(0.8 * k / len(bags), f'reading {bag}')
            record = open_record(bag, topic, fields=fields, gyro_unit=gyro_unit,
                                 accel_unit=accel_unit, rate_hz=rate_hz)
            records.append(selection.part(record) if selection else record)
        done = calibrate_records(records, **options)
        done.study.diagnose()
        if progress:
            progress(0.9, 'writing')
        for name, data in outputs(done.study, folder).items():
            files.atomic_write(Path(new) / name, data)
    return replace(done, folder=folder)


def _load(path: Path) -> Any:
    """Return the plain data of a calibration.yaml, given as such or by its folder."""
    if path.is_dir() or not path.exists():
        if not (path / FILE).is_file():
            raise store.not_in(path, FILE, WROTE)
        path = path / FILE
    if not path.is_file():
        raise InputError(f'{path}: not a file', WROTE)
    return store.load_yaml(path, 'calibrate again')


def sensors_of(path: Path) -> list[Any]:
    """Return what a calibration.yaml, or a folder's, holds of each sensor, accelerometer first."""
    return _sensors_in(_load(path))


def _sensors_in(data: Any) -> list[Any]:
    data = data if isinstance(data, dict) else {}
    return [data[s] for s in ('accel', 'gyro') if s in data] or [data]


def _corrections_in(data: Any, path: str | Path) -> tuple[core.Correction, ...]:
    """
    Return what corrects samples from the data of a calibration.yaml at a path.

    The accelerometer's comes first: the gyroscope's may need a calibrated specific force. Raise
    InputError where it is no calibration.

    """
    try:
        return tuple(core.from_dict(p if isinstance(p, dict) else {}) for p in _sensors_in(data))
    except InputError as error:
        raise InputError(f'{path}: {error.message}', error.remedy) from None


def _units_in(data: Any, path: str | Path) -> dict[str, str]:
    """
    Return by sensor the unit, not SI, of the samples that a calibration.yaml was made from.

    It is empty for a file that does not say it. Raise InputError where the unit is not known.

    """
    stated = data.get('input_unit', {}) if isinstance(data, dict) else {}
    return not_si(stated, str(path))


def doubts(path: str | Path) -> list[str]:
    """Return what the diagnosis in a calibration.yaml, or in a folder's, says is missing."""
    return _doubts_in(_load(Path(path)))


def _doubts_in(data: Any) -> list[str]:
    parts = [(p.get('sensor'), p.get('diagnosis') or {}) for p in _sensors_in(data)]
    return [f'{sensor}: this calibration is not complete ({found["verdict"]}): '
            f'{found.get("advice", "")}' for sensor, found in parts
            if found.get('verdict', 'complete') != 'complete']


def assumed(*corrections: core.Correction) -> list[str]:
    """Return what corrections assume of samples that come without a temperature."""
    return [f'{c.sensor}: no temperature is recorded: {c.reference_temperature:.2f} degC is '
            f'assumed, and what {" and ".join(c.heated)} adds at another stays in'
            for c in corrections if c.heated]


def corrected(record: ImuRecord, *corrections: core.Correction) -> ImuRecord:
    """Return a record with each correction applied to its sensor, and warnings of what it took."""
    if 'temperature' not in record.covariates:
        record = record.warned(*assumed(*corrections))
    record = record.warned(*unit_doubts(record))
    for c in corrections:
        raw = getattr(record, c.sensor)
        if raw is None:
            raise InputError(f'{record.path or "the record"} has no {c.sensor}',
                             f'this calibration is of the {c.sensor}')
        better = c.apply(raw, record.covariates.get('temperature'), record.accel)
        if c.sensor == 'accel':
            record = replace(record, accel=better)
        else:
            record = replace(record, gyro=better)
    return record


def apply_calibration(
    bag: str | Path,
    out: str | Path,
    calibration: str | Path,
    *,
    topic: str | None = None,
    fields: str | None = None,
    gyro_unit: str | None = None,
    accel_unit: str | None = None,
    rate_hz: float | None = None,
    force: bool = False,
    progress: Any = None,
) -> tuple[Path, tuple[str, ...]]:
    """
    Copy a bag with ``imu/data_calibrated`` beside its topics; return where it is, and warnings.

    They say what is missing in the calibration, what it assumes that the bag does not hold, and
    which samples were converted: the new topic is in SI. Units that are not given are those that
    the calibration was made from; ``rate_hz`` is that of a table that has no stamps.

    Raises
    ------
    InputError
        There is no calibration or no bag, or something is in the way.

    """
    from ..bag import copy_bag
    data = _load(Path(calibration))     # once: somebody may calibrate again meanwhile
    corrections = _corrections_in(data, calibration)
    stated = {s: unit for s, unit in (('gyro', gyro_unit), ('accel', accel_unit)) if unit}
    units = {s: u for s, u in {**_units_in(data, calibration), **stated}.items() if u != SI[s]}
    taken = {s: unit for s, unit in units.items() if s not in stated}
    warnings = [*_doubts_in(data), *read_in(taken, 'as the calibration\'s recording was'),
                *read_in({s: u for s, u in units.items() if s in stated}, 'as told')]

    def correct(record: ImuRecord) -> ImuRecord:
        better = corrected(record, *corrections)
        warnings.extend(better.warnings[len(record.warnings):])
        return better
    written = copy_bag(bag, out, correct, topic=topic, fields=fields, new_topic=CALIBRATED,
                       gyro_unit=units.get('gyro'), accel_unit=units.get('accel'),
                       force=force, progress=progress, rate_hz=rate_hz)
    return written, tuple(warnings)


def place(path: str | Path) -> Path:
    """Return where a calibration is written: into a folder by its usual name."""
    path = Path(path)
    return path / FILE if path.is_dir() else path


class Session(core.Session):
    """A person's session that can also be diagnosed, saved and loaded: what the node holds."""

    def __init__(self, *args: Any, **options: Any):
        super().__init__(*args, **options)
        self._study: Study | None = None
        self._loaded: tuple[core.Correction, ...] = ()
        self.input_unit = {}

    @property
    def input_unit(self) -> dict[str, str]:
        """Unit of the samples by sensor, where it is not SI: as the file that was loaded says."""
        return dict(self._input_unit)

    @input_unit.setter
    def input_unit(self, units: Mapping[str, str]) -> None:
        self._input_unit = dict(units)
        self._factor = {s: to_si(s, units.get(s, SI[s])) for s in SI}

    def in_si(self, gyro: Any, accel: Any) -> tuple[np.ndarray, np.ndarray]:
        """Return (gyro, accel), (3,) or (n, 3) each, in SI: they come in ``input_unit``."""
        return (np.multiply(gyro, self._factor['gyro'], dtype=float),
                np.multiply(accel, self._factor['accel'], dtype=float))

    def feed(
        self, stamp_s: float, gyro: Any, accel: Any, temperature: float | None = None
    ) -> None:
        """Take one sample, gyro (3,) and accel (3,), in SI or in ``input_unit``."""
        super().feed(stamp_s, *self.in_si(gyro, accel), temperature)

    def solve(self) -> core.Calibration:
        """Solve the poses captured so far, and begin a study of them."""
        solved = super().solve()
        source = {'gravity': self.gravity, 'input_unit': self.input_unit,
                  'notes': list(solved.notes),
                  'warnings': list(solved.warnings)}
        if self.gyro is not None:
            source['gyro'] = {'notes': list(self.gyro.notes), 'warnings': list(self.gyro.warnings)}
        self._study, self._loaded = study_of(solved, source, self.gyro), ()
        return solved

    def reset(self) -> None:
        """Forget all poses, the solution and what was loaded."""
        super().reset()
        self._study, self._loaded, self.input_unit = None, (), {}

    @property
    def study(self) -> Study:
        """The study of the solution; raise InputError where nothing is solved."""
        if self._study is None:
            self._study = study_of(self.solved())
        return self._study

    def adopt(self, study: Study) -> None:
        """Take the model that the loop has come to: what is applied from now on."""
        self._study = study
        self.calibration = core.of_study(study)
        self.gyro = core.of_study(study, 'gyro') if len(study.targets) > 1 else None

    def diagnose(self) -> Any:
        """Return what is missing in the solution's model."""
        return self.study.diagnose()[self.sensor]

    @property
    def corrections(self) -> tuple[core.Correction, ...]:
        """What corrects samples, in order: the solution, else what was loaded, else nothing."""
        return super().corrections or self._loaded

    def apply(
        self, gyro: np.ndarray, accel: np.ndarray, temperature: float | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """
        Return (gyro, accel), (3,) each, corrected.

        Raise InputError where nothing is solved or loaded.

        """
        return super().apply(*self.in_si(gyro, accel), temperature)

    def save(self, path: str | Path) -> Path:
        """
        Write calibration.yaml, whole.

        A session that is not solved is refused and nothing is written.

        """
        path = place(path)
        files.atomic_write(path, store.dump_yaml(as_dict(self.study)))
        return path

    def load(self, path: str | Path) -> core.Correction:
        """Take a calibration.yaml as what is applied until something is solved; return ours."""
        data = _load(Path(path))
        loaded = _corrections_in(data, path)
        mine = [c for c in loaded if c.sensor == self.sensor]
        if not mine:
            raise InputError(f'{path}: calibrates the {loaded[0].sensor}, not the {self.sensor}',
                             'name another file')
        self._loaded, self.input_unit = loaded, _units_in(data, path)
        return mine[0]
