# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What a worker does with one bag: fetch, recognise by its bytes, analyse, say what was found.

Nothing here knows Dask. What comes back is plain, and small unless the files have to be carried.

"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
import hashlib
import json
import os
from pathlib import Path, PurePosixPath
import shutil
import time
from typing import Any

from . import amplitude, extra
from .inputs import Bag
from .. import __version__, export, store
from ..core import files
from ..core.errors import ImuNoiseError, InputError
from ..core.files import scratch_folder
from ..core.record import sensor_of
from ..core.units import SI
from ..health import Selection, suspected
from ..loop import verdict
from ..loop.effect import load_effects
from ..loop.study import Study
from ..tasks import noise

CHUNK = 1 << 22
FORMAT = 4          # of the facts; another one is not read
LEFT_OUT = 'unit suspected'
MARK = '.fleet'     # a file in the folder of a fleet, by which a worker knows that it sees it


@dataclass(frozen=True)
class Options:
    """
    What is done with every bag; part of the key of its result.

    Parameters
    ----------
    analyse : mapping
        Options of :func:`imu_noise_tools.tasks.noise.analyse_bag`.
    selection : tuple of (str, str, str, bool)
        As typed: start, duration, mask, screen.
    diagnose : str
        ``failing``: axes whose error is not within chance; ``all``; ``none``.
    reports : bool
        Whether report.html and allan.png are drawn (half of the time of a short bag).
    own : tuple of str
        The texts of a user's own effects.
    version : str
        Of the package; a worker with another one refuses.

    """

    analyse: Mapping[str, Any] = field(default_factory=dict)
    selection: tuple[str, str, str, bool] = ('', '', '', True)
    diagnose: str = 'failing'
    reports: bool = True
    own: tuple[str, ...] = ()
    version: str = __version__

    def key(self, content: str, topic: str) -> str:
        """Return the key of the result of a content: same key, same result."""
        said = json.dumps([content, topic, asdict(self), FORMAT], sort_keys=True)
        return hashlib.blake2b(said.encode(), digest_size=10).hexdigest()

    def of(self, bag: Bag) -> Options:
        """Return them for one bag, whose units a manifest may say."""
        return replace(self, analyse={**self.analyse, **bag.units}) if bag.units else self


@dataclass
class Result:
    """What became of a bag: its facts as rows, or one line on why there are none."""

    key: str
    content: str
    rows: list[dict[str, Any]] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    error: str = ''
    cpu_s: float = 0.0
    wall_s: float = 0.0
    files: dict[str, str | bytes] | None = None
    new: bool = True

    def facts(self) -> str:
        """Return what is kept of it beside the study."""
        return json.dumps({'format': FORMAT, 'content': self.content, 'error': self.error,
                           'cpu_s': round(self.cpu_s, 3), 'wall_s': round(self.wall_s, 3),
                           'warnings': self.warnings, 'rows': self.rows})


def examine(bag: Bag, options: Options, folder: str, mark: str,
            known: frozenset[str] = frozenset()) -> Result:
    """
    Return the result of one bag.

    Parameters
    ----------
    bag : Bag
        Which one.
    options : Options
        What is done with it.
    folder, mark : str
        The folder of the fleet and what its mark says. A worker that finds the mark there writes
        the study itself; else the files are carried back.
    known : frozenset of str
        Keys whose results are there already.

    Raises
    ------
    OSError
        The bag could not be fetched: worth another try.

    """
    cpu, wall = time.process_time(), time.monotonic()
    if options.version != __version__:
        raise InputError(f'a worker has imu_noise_tools {__version__}, this is {options.version}',
                         'install the same version on all of them')
    options = options.of(bag)
    with local(bag) as path:
        content = content_of(path)
        key = options.key(content, bag.topic)
        if content and key in known:
            return Result(key, content, new=False)
        out = Result(key, content)
        try:
            study = studied(path, bag.topic, options)
            study.source['path'] = bag.path
            out.rows, out.warnings = rows_of(study), list(study.source.get('warnings') or ())
            place = Path(folder) / 'bags' / key
            made = outputs(study, place, options.reports)
            if _seen(folder, mark):
                deliver(place, made)
            else:
                out.files = made
        except ImuNoiseError as error:
            out.error = ' '.join(str(error).replace(str(path), bag.path).split())
        except MemoryError:
            out.error = f'{bag.path}: not enough memory: give the workers more'
    out.cpu_s, out.wall_s = time.process_time() - cpu, time.monotonic() - wall
    return out


def deliver(place: Path, made: Mapping[str, str | bytes]) -> None:
    """Write the files of a study whole, in place of what a stopped run may have left."""
    with files.new_folder(place, force=True) as new:
        for name, data in made.items():
            files.atomic_write(Path(new) / name, data)


def _seen(folder: str, mark: str) -> bool:
    try:
        return (Path(folder) / MARK).read_text() == mark
    except OSError:
        return False


@contextmanager
def local(bag: Bag) -> Iterator[Path]:
    """Give the path of a bag on this machine; a copy of a remote one is removed afterwards."""
    if not bag.remote:
        yield Path(bag.path)
        return
    scratch = scratch_folder()
    try:
        fs, inner = extra('fsspec').core.url_to_fs(bag.path)
        target = scratch / PurePosixPath(inner.rstrip('/')).name
        try:
            if fs.isdir(inner):
                target.mkdir()
                for part in fs.find(inner):
                    with fs.open(part) as source, \
                            open(target / PurePosixPath(part).name, 'wb') as copy:
                        shutil.copyfileobj(source, copy, CHUNK)
            else:
                with fs.open(inner) as source, open(target, 'wb') as copy:
                    shutil.copyfileobj(source, copy, CHUNK)
        except OSError:
            raise
        except Exception as error:      # of whatever client the file system uses
            raise OSError(f'{type(error).__name__}: {error}') from None
        yield target
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


def content_of(path: Path) -> str:
    """Return the digest of a bag's bytes, of a directory with names; empty where none is."""
    parts = [p for p in (sorted(path.rglob('*')) if path.is_dir() else [path]) if p.is_file()]
    if not parts:
        return ''
    whole = hashlib.blake2b(digest_size=16)
    for part in parts:
        whole.update(f'{part.relative_to(path)}\0{os.path.getsize(part)}\0'.encode())
        with open(part, 'rb') as file:
            while chunk := file.read(CHUNK):
                whole.update(chunk)
    return whole.hexdigest()


def studied(path: Path, topic: str, options: Options) -> Study:
    """Return the study of a bag on this machine."""
    _know(options.own)
    study = noise.analyse_bag(path, topic=topic or None,
                              selection=Selection.of(*options.selection), **options.analyse)
    wanted = {'all': study.targets, 'none': [],
              'failing': [t for t, s in study.states.items() if not s.error.within_chance]}
    if wanted[options.diagnose]:
        study.diagnose(wanted[options.diagnose])
    return study


_LOADED: set[str] = set()


def _know(own: tuple[str, ...]) -> None:
    """Register a user's own effects, once in a process."""
    for text in own:
        if text not in _LOADED:
            scratch = scratch_folder()
            try:
                (scratch / 'own_effects.py').write_text(text)
                load_effects(scratch / 'own_effects.py')
            finally:
                shutil.rmtree(scratch, ignore_errors=True)
            _LOADED.add(text)


def outputs(study: Study, place: Path, reports: bool) -> dict[str, str | bytes]:
    """Return the files of a study; without the pictures where they are not wanted."""
    if reports:
        return noise.outputs(study, place)
    return {**store.study_files(study), 'imu.yaml': export.export(study, 'kalibr'),
            'allan.csv': noise.allan_csv(study)}


def rows_of(study: Study) -> list[dict[str, Any]]:
    """
    Return a study as rows: a coefficient each, and each parameter of an effect that is missing.

    ``kind`` is ``coefficient`` or ``missing``; values are SI; ``verdict`` is that of the axis.
    ``left_out`` says why an axis does not count among those of other recordings.

    """
    doubted = left_out(study.source)
    about = {'rate_hz': study.source.get('rate_hz'), 'start': study.source.get('start'),
             'duration_s': study.source.get('duration_s')}
    rows = []
    for axis, state in study.states.items():
        told = study.diagnosis.get(axis)
        error = state.error
        said = told.verdict if told else verdict.side(error.within_chance, bool(error.failing))
        one = {**about, 'axis': axis, 'left_out': doubted.get(sensor_of(axis), ''),
               'verdict': said, 'held_out': error.excess}
        for e in state.model:
            rows += [{**one, 'kind': 'coefficient', 'effect': e.name, 'parameter': name,
                      **_estimate(x), **(_square(x) if e.parameter(name).amplitude else {})}
                     for name, x in state.fit.estimates.get(e.label, {}).items()
                     if not e.parameter(name).choices]
        for f in told.found if told else ():
            found = {**one, 'kind': 'missing', 'effect': f.name, 'gain': f.gain,
                     'penalty': f.penalty, 'probability': f.probability}
            known = [{**found, 'parameter': name, **_estimate(x)}
                     for name, x in f.estimates.items()
                     if f.effect is not None and not f.effect.parameter(name).choices]
            rows += known or [{**found, 'parameter': ''}]
    return store.plain(rows)


def left_out(source: Mapping[str, Any]) -> dict[str, str]:
    """
    Return why which sensors of a recording do not count among those of other recordings.

    Their unit is suspected. A unit that somebody has said to be SI is taken at his word.

    """
    streams = (source.get('streams') or {'': source}).values()
    stated = {k: u for one in streams for k, u in (one.get('input_unit') or {}).items()}
    return {s: LEFT_OUT for s in suspected(source.get('warnings') or ())
            if stated.get(s) != SI[s]}


def _estimate(x: Any) -> dict[str, Any]:
    low, high = x.ci95 or (None, x.upper95)
    return {'value': x.value, 'std': x.std, 'lo': low, 'hi': high, 'null': x.value is None,
            'upper95': x.upper95, 'si': x.unit}


def _square(x: Any) -> dict[str, float]:
    """Return what a record says of an amplitude that it does not show well."""
    if not x.profile or x.value and x.std and x.std < amplitude.SHARP * x.value:
        return {}
    return dict(zip(amplitude.SQUARE, amplitude.of_profile(x.profile) or ()))


def facts_of(path: str | Path, text: str) -> dict[str, Any]:
    """Return what :meth:`Result.facts` wrote; raise InputError where it is damaged."""
    try:
        facts = json.loads(text)
        if facts['format'] == FORMAT and isinstance(facts['rows'], list):
            return facts
    except (ValueError, KeyError, TypeError):
        pass
    raise InputError(f'{path}: damaged', 'remove it and run the fleet again')
