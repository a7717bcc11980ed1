# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The package from Python: what ``import imu_noise_tools as imu`` offers, loaded on first use.

A face of :mod:`imu_noise_tools.tasks` and the loop and nothing more: numbers and files are those
of the commands. All three problems give a :class:`Study`; every error is an
:class:`~imu_noise_tools.core.errors.ImuNoiseError` with what is wrong, where, and the remedy.

"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from . import bag, export as exports, report, store
from .core import files
from .core.errors import FitError, ImuNoiseError, InputError, unknown, UsageError
from .core.record import ImuRecord
from .health import Selection
from .loop import study as loop
from .loop.diagnosis import Diagnosis
from .loop.domains import part
from .loop.effect import load_effects, Model
from .report import terminal, words
from .report.markup import cell, escape, table
from .simulate import simulate as simulated
from .tasks import calibration as calibrating, compare as comparing, filter as filtering
from .tasks import loop as tasks, noise, sheet as sheets, side_by_side
from .tasks.simulate import simulate as simulate_bag

__all__ = [
    'analyse', 'calibrate', 'Coefficient', 'data_sheet', 'filter', 'FitError', 'Fleet', 'fleet',
    'ImuNoiseError', 'ImuRecord', 'InputError', 'load', 'load_effects', 'open_fleet',
    'open_record', 'Picture', 'simulate', 'Study', 'Table', 'Target', 'UsageError']

Progress = Callable[[float | None, str], None]
Source = str | Path | ImuRecord


class MissingError(UsageError, AttributeError, KeyError):
    """A target, an effect or a coefficient that a study has not."""


class Table(list[dict[str, Any]]):
    """Rows with the same columns: a list of mappings that shows itself as a table."""

    @property
    def columns(self) -> list[str]:
        """Names of the columns."""
        return list(dict.fromkeys(k for row in self for k in row))

    def _cells(self) -> list[list[str]]:
        return [[_written(row.get(k)) for k in self.columns] for row in self]

    def __repr__(self) -> str:
        """Return the table as text."""
        return terminal.table(self._cells(), self.columns) if self else '(nothing)'

    def _repr_html_(self) -> str:
        """Return the table as HTML, for a notebook."""
        return table(self.columns, ([cell(c) if len(c) < 24 else escape(c) for c in row]
                                    for row in self._cells()))

    def to_pandas(self) -> Any:
        """Return a pandas DataFrame; raise InputError where there is no pandas."""
        try:
            import pandas
        except ImportError:
            raise InputError('pandas is not installed', 'pip install pandas') from None
        return pandas.DataFrame(list(self), columns=self.columns)


class Picture(bytes):
    """A PNG; a notebook shows it."""

    def _repr_png_(self) -> bytes:
        """Return the picture, for a notebook."""
        return bytes(self)

    def __repr__(self) -> str:
        """Return what it is, not its bytes."""
        return f'<PNG of {len(self)} bytes>'

    __str__ = __repr__

    def save(self, path: str | Path) -> Path:
        """Write it into a file."""
        files.atomic_write(path, bytes(self))
        return Path(path)


@dataclass(frozen=True, repr=False)
class Coefficient:
    """
    One number of a model, in SI.

    Parameters
    ----------
    name, effect : str
        Of the parameter, and the label of its effect.
    value : float, str or None
        None where the record does not show it; then ``upper95`` limits it. The name of a choice.
    std : float or None
        One standard deviation.
    interval : tuple of (float, float) or None
        95 % interval.
    upper95 : float or None
        One-sided 95 % limit.
    unit : str
        SI.
    shown : str
        As the field writes it, with its unit.
    note : str
        What is to be said of it.

    """

    name: str
    effect: str
    value: Any
    std: float | None
    interval: tuple[float, float] | None
    upper95: float | None
    unit: str
    shown: str
    note: str = ''

    def __float__(self) -> float:
        """Return the value; raise InputError where the record does not show it."""
        if self.value is None:
            raise InputError(f'{self.effect}.{self.name} is not observable',
                             f'upper95 is {self.upper95}, at 95 %')
        return float(self.value)

    def __repr__(self) -> str:
        """Return name, value and interval as people read them."""
        return f'{self.name} = {self.shown}'

    def as_dict(self) -> dict[str, Any]:
        """Return it as a row of a table."""
        low, high = self.interval or (None, None)
        return {'effect': self.effect, 'parameter': self.name, 'value': self.value,
                'std': self.std, 'low': low, 'high': high, 'upper95': self.upper95,
                'unit': self.unit, 'shown': self.shown, 'note': self.note}


class Coefficients(Mapping[str, Coefficient]):
    """Coefficients by name, also as attributes: ``study['gyro_x']['white'].N``."""

    def __init__(self, where: str, found: Iterable[Coefficient]) -> None:
        self._where = where
        self._found: dict[str, list[Coefficient]] = {}
        for c in found:
            self._found.setdefault(c.name, []).append(c)

    def __getitem__(self, name: str) -> Coefficient:
        """Return a coefficient; raise UsageError where there is none or more than one."""
        some = self._found.get(name, [])
        if len(some) == 1:
            return some[0]
        if some:
            raise MissingError(
                f'{self._where}: {name} of which effect',
                f'{", ".join(c.effect for c in some)} have it: study[target][effect].{name}')
        raise MissingError(*_unknown('coefficient', name, self._found, self._where))

    def __getattr__(self, name: str) -> Coefficient:
        """Return a coefficient by its name."""
        if name.startswith('_'):
            raise AttributeError(name)
        return self[name]

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names."""
        return iter(self._found)

    def __len__(self) -> int:
        """Return how many names there are."""
        return len(self._found)

    def __dir__(self) -> list[str]:
        """Return what completion offers."""
        return [*super().__dir__(), *self._found]

    def _ipython_key_completions_(self) -> list[str]:
        return list(self._found)

    def __repr__(self) -> str:
        """Return a line a coefficient."""
        return '\n'.join(map(repr, (c for some in self._found.values() for c in some)))


class Target(Coefficients):
    """
    One axis, or one sensor, of a study: ``study['gyro_x'].N``, ``study['gyro_x']['sinusoid.2']``.

    Its coefficients by name, and by the label of an effect all of that effect.

    """

    def __init__(self, name: str, state: Any, diagnosis: Diagnosis | None) -> None:
        self.name = name
        self.model: Model = state.model
        self.error = state.error
        self.diagnosis = diagnosis
        shown = {(r.label, r.symbol): r for r in words.rows(state, name)}
        found = []
        for e in state.model:
            for p in e.parameters:
                x = state.fit.estimates.get(e.label, {}).get(p.name)
                row = shown.get((e.label, p.name))
                if x is None or row is None:
                    continue
                value = p.written(x.value) if p.choices and x.value is not None else x.value
                text = f'{row.shown} ({row.interval})' if row.interval else row.shown
                found.append(Coefficient(p.name, e.label, value, x.std, x.ci95, x.upper95, x.unit,
                                         text, x.note))
        super().__init__(name, found)

    def __getitem__(self, name: str) -> Any:
        """Return a coefficient by its name, or all of an effect by its label."""
        if name in self.model:
            return Coefficients(f'{self.name}, {name}',
                                (c for c in self.coefficients if c.effect == name))
        return super().__getitem__(name)

    @property
    def coefficients(self) -> list[Coefficient]:
        """All of them, in the order of the model."""
        return [c for some in self._found.values() for c in some]

    def _ipython_key_completions_(self) -> list[str]:
        return [*self.model.labels, *self._found]

    def __repr__(self) -> str:
        """Return the model, its coefficients and its error."""
        return '\n  '.join([f'{self.name}: {self.model}',
                            *(f'{c.effect} {c!r}' for c in self.coefficients),
                            f'{words.ERROR}: {words.error_in_words(self.error)}'])


class Study:
    """
    A model beside its measurement, of noise, of a calibration or of a filter.

    ``study['gyro_x'].N`` is a :class:`Coefficient`; iterating gives the names of the targets.

    Parameters
    ----------
    study : imu_noise_tools.loop.study.Study
        What the loop drives.
    folder : Path or None
        Where it is kept.
    record : ImuRecord or None
        What the filter made of the record.

    """

    def __init__(self, study: loop.Study, folder: Path | None = None,
                 record: ImuRecord | None = None) -> None:
        self.study = study
        self.folder = folder
        self.record = record

    @property
    def domain(self) -> str:
        """``noise``, ``calibration`` or ``filter``."""
        return self.study.domain

    @property
    def targets(self) -> list[str]:
        """Names of the axes or sensors."""
        return self.study.targets

    @property
    def source(self) -> dict[str, Any]:
        """Where the data came from."""
        return self.study.source

    @property
    def warnings(self) -> list[str]:
        """What is doubtful in the record, and what was done about it."""
        return list(self.source.get('warnings') or ())

    def __getitem__(self, target: str) -> Target:
        """Return one target; raise UsageError for an unknown one."""
        if target not in self.study.states:
            raise MissingError(*_unknown('target', target, self.targets, 'the study'))
        return Target(target, self.study.states[target], self.study.diagnosis.get(target))

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names of the targets."""
        return iter(self.targets)

    def __len__(self) -> int:
        """Return how many targets there are."""
        return len(self.targets)

    def __contains__(self, target: object) -> bool:
        """Return whether there is such a target."""
        return target in self.study.states

    def _ipython_key_completions_(self) -> list[str]:
        return self.targets

    @property
    def coefficients(self) -> Table:
        """A row a coefficient of every target, in SI."""
        return Table({'target': t, **c.as_dict()} for t in self for c in self[t].coefficients)

    def to_pandas(self) -> Any:
        """Return the coefficients as a pandas DataFrame."""
        return self.coefficients.to_pandas()

    def compare(self, other: Study | None = None, *, sheet: str | Path | None = None) -> Table:
        """
        Say where the model fails, by how much more than chance allows.

        With another study: what changed between the two beyond chance. With ``sheet``, a data
        sheet's YAML file: which axes meet it, with the interval.

        Raises
        ------
        InputError
            The other study, or the sheet, has nothing that this one has as well.

        """
        if sheet is not None:
            return Table(sheets.against(self.study, sheet))
        if other is not None:
            return Table(comparing.compare_two(self.study, other.study))
        return Table({'target': t, 'error': e.excess, 'chance': words.CHANCE * e.std,
                      'within_chance': e.within_chance, 'fails_in': ', '.join(e.failing)}
                     for t, e in self.study.compare().items())

    def diagnose(self, targets: str | Iterable[str] | None = None, *,
                 until_complete: bool = False, processes: int = 1,
                 progress: Progress | None = None) -> Table:
        """
        Say which effect is missing from each target's model, with the evidence.

        ``until_complete`` adds the best and looks again until nothing is missing. With more
        ``processes`` as many targets are looked at side by side; they import the script that
        runs, which has to call this under ``if __name__ == '__main__':``.
        ``study[target].diagnosis`` holds all that was found. Raise UsageError for another
        target.

        """
        names = self.study.chosen(_several(targets))
        side_by_side.diagnose(self.study, names, until_complete=until_complete,
                              processes=processes, progress=progress)
        found = {t: self.study.diagnosis[t] for t in names}
        return Table({'target': t, 'verdict': d.verdict,
                      'found': ' + '.join(f.name for f in d.found),
                      'evidence': '; '.join(f.evidence for f in d.found or d.failed
                                            if f.evidence),
                      'advice': d.advice} for t, d in found.items())

    def add(self, effects: str | Iterable[str] | None = None,
            targets: str | Iterable[str] | None = None, *, everything: bool = False) -> Table:
        """
        Put effects into the model and refit; return the new rungs of the ladder.

        Without ``effects`` the first that the diagnosis found, with ``everything`` all of them.

        Raises
        ------
        UsageError
            No such effect or target, or the model has it and can hold only one.
        FitError
            The model with it cannot be fitted.

        """
        return _ladder(self.study.add(_several(effects), _several(targets), everything))

    def remove(self, effect: str, targets: str | Iterable[str] | None = None) -> Table:
        """
        Take an effect (its label) out of the model and refit; return the new rungs.

        Raise UsageError where no target has it, FitError where what is left cannot be fitted.

        """
        return _ladder(self.study.remove(effect, _several(targets)))

    @property
    def history(self) -> Table:
        """The ladder of models tried, with the error of each on data that it has not seen."""
        return _ladder(self.study.history)

    def export(self, format: str, path: str | Path | None = None, *, axes: str = 'worst',
               inflate: float = 1.0, horizon: float | None = None,
               calibration: str | Path | None = None, force: bool = False) -> str:
        """
        Return the numbers as another program reads them; with ``path``, write them as well.

        As on the command line, a file that is there is replaced where it is an earlier export of
        the same format, any other only with ``force``.

        Raises
        ------
        UsageError
            An unknown format, or an option that it cannot hold.
        InputError
            The study is not one of noise, or does not hold what the format needs; or another file
            is in the way.

        """
        text = exports.export(self._of('noise'), format, axes=axes, inflate=inflate,
                              horizon=horizon, calibration=calibration)
        if path is not None:
            exports.write(path, text, force)
        return text

    def plot(self, name: str | None = None) -> Picture:
        """
        Return a picture: the main one of the study, or one by its name.

        Names are those of the report: a target (in full), ``ladder``, and for noise ``series`` and
        ``allan``. Raise UsageError for another.

        """
        if name == 'ladder':
            from .plots import ladder, signed, style
            return Picture(style.png(
                signed.signed(ladder.ladder_figure(self.study), self.study.source)))
        full = [name] if name in self.study.states else []
        found = part('plots', self.domain).pictures(self.study, full)
        if name is None:
            return Picture(list(found.values())[-1])
        wanted = f'target {name}' if full else name
        if wanted not in found:
            raise unknown('picture', name, [*found, 'ladder'])
        return Picture(found[wanted])

    def apply(self, record: ImuRecord) -> ImuRecord:
        """
        Return a record (SI) corrected by this calibration, what is doubtful in its warnings.

        Raise InputError for a study of something else, or a record without the sensor.

        """
        study = self._of('calibration')
        return calibrating.corrected(record, *(calibrating.core.of_study(study, t).correction
                                               for t in study.targets))

    def save(self, folder: str | Path | None = None, *, force: bool = False) -> Path:
        """
        Write the study as the commands do, and return its folder.

        Without ``folder`` where it came from (``load``), all its files anew and others kept.

        Raises
        ------
        UsageError
            It came from nowhere, and no folder is named.
        InputError
            The folder is there and not replaced by ``force``, or cannot be written.

        """
        if folder is not None:
            self.folder = tasks.save(self.study, folder, force)
        elif self.folder is not None:
            files.replace_files(self.folder, tasks.outputs(self.study, self.folder))
        else:
            raise UsageError('save where?', "name a folder, e.g. save('my_bag.study')")
        return self.folder

    def _of(self, domain: str) -> loop.Study:
        if self.domain != domain:
            raise InputError(f'this is a {self.domain} study', f'it takes one of {domain}')
        return self.study

    def __repr__(self) -> str:
        """Return what the commands print."""
        return terminal.text(self.study)

    def _repr_html_(self) -> str:
        """Return verdicts and coefficients as HTML, for a notebook."""
        return report.overview(self.study)


class Fleet:
    """
    What many bags of many units say; see :func:`fleet` and :func:`open_fleet`.

    Parameters
    ----------
    folder : Path
        Where it is kept.
    summary : mapping
        All of fleet.json: models, shrunk values, about each unit.

    """

    def __init__(self, folder: Path, summary: Mapping[str, Any]) -> None:
        self.folder, self.summary = folder, summary

    @property
    def units(self) -> list[str]:
        """Names of the units."""
        return list(self.summary['about'])

    @property
    def models(self) -> Table:
        """A row a model and coefficient: units, typical value (SI), spread in per cent."""
        return Table({'model': model, 'coefficient': name, 'units': p['units'],
                      'typical': max((a['mean'] for a in p['axes'].values()), default=None),
                      'spread_percent': p.get('between'), 'covers95': p['covers95'],
                      'unit': p['unit']}
                     for model, found in self.summary['models'].items()
                     for name, p in found.items())

    @property
    def outlying(self) -> Table:
        """A row a unit and reason why it is to be looked at."""
        return Table({'unit': o['unit'], 'model': o['model'], 'what': c['what'],
                      'axes': ', '.join(c['axes']), 'probability': c['probability'],
                      'ratio': c.get('ratio'), 'lo': c.get('lo'), 'hi': c.get('hi'),
                      'drift': c['drift']} for o in self.summary['outlying'] for c in o['why'])

    @property
    def changes(self) -> Table:
        """What the levels of each factor change, as ratios with 95 % intervals."""
        return Table(self.summary['changes'])

    @property
    def missing(self) -> Table:
        """Which effects are missing from the models, in how many units."""
        return Table(self.summary['missing'])

    @property
    def lines(self) -> Table:
        """Lines in the spectrum by frequency (Hz), and how many units have each."""
        return Table(self.summary['lines'])

    @property
    def failed(self) -> Table:
        """Bags that gave nothing, each with why."""
        return Table(self.summary['failed'])

    @property
    def warned(self) -> Table:
        """Recordings with warnings, those first of which sensors are left out of all values."""
        return Table({**w, 'left_out': ', '.join(w['left_out']),
                      'warnings': '; '.join(w['warnings'])} for w in self.summary['warned'])

    def to_pandas(self) -> Any:
        """Return fleet.parquet, a row a coefficient of each bag, as a pandas DataFrame."""
        from .fleet import table as tables
        return Table(tables.read(self.folder).to_pylist()).to_pandas()

    def unit(self, name: str) -> Study:
        """
        Return the values of a unit, beside what its model does, as a study to export.

        Raise UsageError for no such unit, InputError where it shows nothing.

        """
        from .fleet import export as numbers
        return Study(numbers.unit_study(self.folder, name))

    def population(self, model: str | None = None) -> Study:
        """
        Return what covers 95 % of a model's units, as a study to export.

        Raise UsageError for no such model, InputError where its units show nothing.

        """
        from .fleet import export as numbers
        return Study(numbers.population_study(self.folder, model))

    def compare(self, other: Fleet) -> Table:
        """Return what differs in another fleet; units in both are compared with themselves."""
        from .fleet import assemble
        return Table(assemble.compare(self.folder, other.folder))

    def __repr__(self) -> str:
        """Return what the command prints."""
        from .fleet import assemble
        return assemble.text(dict(self.summary), str(self.folder))


def fleet(inputs: str | Path | Iterable[str | Path], out: str | Path, *, pattern: str = '',
          topic: str | None = None, scheduler: str | None = None, workers: int | None = None,
          diagnose: str = 'failing', reports: bool = True, retry_failed: bool = False,
          progress: Progress | None = None, **options: Any) -> Fleet:
    """
    Analyse many bags on Dask into a folder; what is done there already is kept.

    Parameters
    ----------
    inputs : str, Path, or several
        Bags, directories, globs, URLs, manifests.
    out : str or Path
        Where the fleet is kept.
    pattern, topic, scheduler, workers, diagnose, reports, retry_failed
        As of the command.
    progress : callable or None
        Called with (share done, what).
    options
        Those of :func:`imu_noise_tools.tasks.noise.analyse_bag`.

    Raises
    ------
    InputError
        No bag there, another's folder, or no scheduler; what is wrong with a bag is in ``failed``.
    UsageError
        The pattern is none.

    """
    from .fleet import assemble, inputs as given, run
    from .fleet.work import Options

    some = [inputs] if isinstance(inputs, (str, Path)) else list(inputs)
    options.update({k: tuple(_several(options[k]) or ()) for k in ('axes', 'effects')
                    if k in options})
    bags = given.bags_of([str(s) for s in some], pattern, topic or '')
    kept = run.Fleet(Path(out), Options(options, diagnose=diagnose, reports=reports))
    return Fleet(kept.folder, assemble.bring_up_to_date(
        kept, bags, scheduler, workers, retry_failed, progress))


def open_fleet(folder: str | Path) -> Fleet:
    """Return the fleet of a folder as it was written last; raise InputError for no fleet."""
    from .fleet import assemble
    return Fleet(Path(folder), assemble.read(folder))


def open_record(path: str | Path, topic: str | None = None, *, apart: bool = True,
                **options: Any) -> ImuRecord:
    """
    Read one IMU record; as :func:`imu_noise_tools.bag.open_record`.

    Sensors with a clock of their own are kept ``apart``, which noise needs; :func:`calibrate` and
    :func:`filter` unite them, as ``apart=False`` does here. Raises what that function raises.

    """
    return bag.open_record(path, topic, apart=apart, **options)


def analyse(source: Source, *, start: float | str = '', duration: float | str = '',
            mask: str = '', screen: bool = True, **options: Any) -> Study:
    """
    Analyse the noise of a bag, or of a record at hand.

    Parameters
    ----------
    source : str, Path or ImuRecord
        What to analyse.
    start, duration : float or str
        A part of it: s, or per cent (``'10%'``).
    mask : str
        Stretches to set aside, ``'10-12.5,300-310'`` (s).
    screen : bool
        Whether disturbed stretches are set aside as well.
    options
        Those of :func:`imu_noise_tools.tasks.noise.analyse_record`; of a bag those of
        :func:`imu_noise_tools.tasks.noise.analyse_bag` as well. One axis or effect may be given
        by its name alone.

    Raises
    ------
    InputError, UsageError, FitError
        What these functions raise.

    """
    options.update({k: _several(options[k]) for k in ('axes', 'effects') if k in options})
    options['selection'] = Selection.of(str(start), str(duration), mask, screen)
    if isinstance(source, ImuRecord):
        return Study(noise.analyse_record(source, **options))
    return Study(noise.analyse_bag(source, **options))


def calibrate(source: Source | Iterable[Source], *, topic: str | None = None,
              gyro_unit: str | None = None, accel_unit: str | None = None,
              rate_hz: float | None = None, **options: Any) -> Study:
    """
    Calibrate a sensor from a bag, several, or records at hand: poses or turns.

    Options, and errors, are those of
    :func:`imu_noise_tools.tasks.calibration.calibrate_records`.

    """
    some = [source] if isinstance(source, (str, Path, ImuRecord)) else list(source)
    records = [s.united() if isinstance(s, ImuRecord) else bag.open_record(
        s, topic, gyro_unit=gyro_unit, accel_unit=accel_unit, rate_hz=rate_hz) for s in some]
    return Study(calibrating.calibrate_records(records, **options).study)


def filter(source: Source, out: str | Path | None = None, *, topic: str | None = None,
           gyro_unit: str | None = None, **options: Any) -> Study:
    """
    Filter the rates of a bag, or of a record at hand; return the study of its innovations.

    ``record`` of what is returned has the filtered rates. With ``out`` a bag is written as well,
    and its study beside it, as the command does.

    Parameters
    ----------
    source : str, Path or ImuRecord
        What to filter.
    out : str, Path or None
        The bag to write, of the same kind.
    topic : str or None
        The Imu topic, where there are several.
    gyro_unit : str or None
        Unit of the rates of a bag; by default that of the recording of ``model``.
    options
        Those of :func:`imu_noise_tools.tasks.filter.filter_bag`.

    Raises
    ------
    InputError
        The record is too short for a study, has no gyroscope, or cannot be read.

    """
    if out is not None:
        if isinstance(source, ImuRecord):
            raise UsageError('out is for a bag', 'give the path of the bag')
        done = filtering.filter_bag(
            source, out, topic=topic, gyro_unit=gyro_unit, **options)
        record = bag.open_record(done.bag or out, filtering.TOPIC)
    else:
        if gyro_unit is None and options.get('model') is not None:
            gyro_unit = filtering.input_unit(options['model'])
        given = (source.united() if isinstance(source, ImuRecord)
                 else bag.open_record(source, topic, gyro_unit=gyro_unit))
        record, done = filtering.filter_samples(given, **options)
    if done.study is None:
        raise InputError('no study of the innovations: ' + '; '.join(done.notes),
                         'give a longer record')
    return Study(done.study, done.folder, record)


def load(folder: str | Path) -> Study:
    """
    Return the study of a folder; effects of your own first: :func:`load_effects`.

    Raise InputError where it is none, or damaged.

    """
    return Study(store.load(folder), Path(folder))


def data_sheet(path: str | Path) -> Study:
    """
    Return the values of a data sheet's YAML file as a study, which every export takes.

    Raise InputError where it is none.

    """
    return Study(sheets.load(path).study(str(path)))


def simulate(spec: Mapping[str, Any] | str | Path, out: str | Path | None = None, *,
             force: bool = False) -> ImuRecord:
    """
    Return a record with known truth from a specification (or a YAML file of one).

    With ``out`` it is written as a bag as well, its truth beside it. Raise InputError for what a
    specification cannot say, and where a bag is in the way without ``force``.

    """
    data = spec if isinstance(spec, Mapping) else store.load_yaml(spec)
    if out is not None:
        simulate_bag(dict(data), out, force)
    return simulated(data)[0]


def _several(names: str | Iterable[str] | None) -> list[str] | None:
    """Return names as a list; None stays."""
    return None if names is None else [names] if isinstance(names, str) else list(names)


def _ladder(steps: Iterable[loop.Step]) -> Table:
    """Return rungs as rows."""
    return Table({'target': s.target, 'model': ' + '.join(s.effects), 'change': words.change(s),
                  'error': s.held_out, 'chance': words.CHANCE * s.held_out_std,
                  'deviance_fell_by': s.fall, 'verdict': s.verdict} for s in steps)


def _unknown(what: str, name: str, known: Iterable[str], where: str) -> tuple[str, str]:
    """Return message and remedy for a name that is not known."""
    error = unknown(what, name, known)
    return f'{where}: {error.message}', error.remedy


def _written(value: Any) -> str:
    """Return a value for a cell of a table."""
    if value is None:
        return ''
    return f'{value:.4g}' if isinstance(value, float) else str(value)
