# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
One study on disk that pages look at: what is under way, what came of it, who else changed it.

All windows of one server share it. What changes the study is computed in another process, then
written by the code of the command line; where the study on disk is another by then, nothing is
written, and what is there is read.

"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
import threading
from typing import Any

from . import jobs
from .jobs import Answer
from .. import export, store
from ..core.errors import ImuNoiseError, InputError
from ..loop.domains import package
from ..loop.prediction import State
from ..loop.study import Study
from ..plots.panel import Stretch
from ..tasks import loop as tasks
from ..tasks.noise import default_folder
from ..tasks.worker import StoppedError, Worker


@dataclass(frozen=True)
class Said:
    """A sentence for the person at the page; ``kind`` is good, doubt or bad."""

    text: str
    kind: str = 'good'


class Session:
    """
    A study, driven from pages.

    Parameters
    ----------
    path : str or Path
        A study's folder, or a recording; that is analysed first, into ``<path>.study``, unless
        that is there already.
    options : dict
        Of the analysis, where there is one: those of :func:`imu_noise_tools.tasks.noise.analyse`.

    Attributes
    ----------
    study : Study or None
        As it is on disk, but for what is being written.
    version : int
        Goes up when there is something new to show.
    busy : tuple of (share or None, what) or None
        What is under way.
    said : Said or None
        What is to be told.
    answers : dict of (target, view) to Answer
        What stretches were found to be.

    """

    def __init__(self, path: str | Path, options: dict[str, Any] | None = None) -> None:
        given = Path(path)
        is_study = (given / 'study.yaml').is_file()
        self.folder = given if is_study else default_folder(given)
        self._bag = None if is_study or (self.folder / 'study.yaml').is_file() else given
        if not given.exists():
            raise InputError(f'{given}: no such file or folder', store.not_in(
                given, 'study.yaml', 'name a recording, or a study of one').remedy)
        if self._bag is None:
            self._check(self.folder)
        self._options = dict(options or {})
        self._worker = Worker()
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._dropped = False
        self._undo: list[jobs.Models] = []
        self._known: dict[str, tuple[State, jobs.Seen]] = {}
        self._seen = self._stamp = ''
        self.study: Study | None = None
        self.version = 0
        self.busy: tuple[float | None, str] | None = None
        self.said: Said | None = None
        self.answers: dict[tuple[str, str], Answer] = {}

    @staticmethod
    def _check(folder: Path) -> None:
        data = store.read(folder)
        if data['source'].get('sheet'):
            raise InputError(f'{folder}: a data sheet, no measurement',
                             'analyse a record of the unit')
        store.refuse_other(folder, data)

    # --- what is under way -----------------------------------------------------------------------

    def begin(self) -> None:
        """Read the study, or analyse the recording first."""
        self._start('reading', self._open)

    def close(self) -> None:
        """Stop what is under way."""
        self.stop()
        self.wait(2.0)

    def wait(self, seconds: float | None = None) -> None:
        """Wait until nothing is under way."""
        if self._thread is not None:
            self._thread.join(seconds)

    def stop(self) -> None:
        """Drop what is under way; what is on disk stays as it is."""
        self._dropped = True
        self._worker.stop()

    def _start(self, what: str, work: Callable[[], None]) -> bool:
        """Do something aside; return False where something is under way."""
        with self._lock:
            if self.busy is not None:
                return False
            self.busy, self.said, self._dropped = (None, what), None, False
            self._thread = threading.Thread(target=self._guarded, args=(work,), daemon=True)
        self._thread.start()
        self.version += 1
        return True

    def _guarded(self, work: Callable[[], None]) -> None:
        try:
            work()
        except tasks.ChangedError as error:
            self._read_again(f'{error.message}: it was read again, and your last step was not '
                             'kept')
        except StoppedError:
            self.said = Said('Stopped: nothing was changed.', 'doubt')
        except ImuNoiseError as error:
            self.said = Said(str(error), 'bad')
        finally:
            self.busy = None
            self.version += 1

    def _run(self, function: Callable[..., Any], *args: Any) -> Any:
        if self._dropped:
            raise StoppedError('stopped', 'nothing was changed')
        return self._worker.run(function, *args, tell=self._progress)

    def _progress(self, share: float | None, what: str = '') -> None:
        self.busy = (share, what)

    # --- the study on disk -----------------------------------------------------------------------

    def _open(self) -> None:
        if self._bag is not None:
            self._run(jobs.analyse, str(self._bag), str(self.folder), self._options)
            self._bag = None
        self._load()

    def _load(self) -> None:
        self._stamp = self._stamp_now()
        study, self._seen, fresh = self._run(jobs.load, str(self.folder))
        self._take(study, fresh)
        self._undo.clear()
        self.answers.clear()

    def _read_again(self, why: str) -> None:
        try:
            self._load()
            self.said = Said(why, 'doubt')
        except ImuNoiseError as error:
            self.said = Said(str(error), 'bad')

    def _stamp_now(self) -> str:
        """Return what tells cheaply that the file may be another."""
        try:
            found = (self.folder / 'study.yaml').stat()
        except OSError:
            return ''
        return f'{found.st_mtime_ns} {found.st_size} {found.st_ino}'

    def look(self) -> None:
        """Read the study again where somebody else has changed it; to be called now and then."""
        if self.study is None or self.busy is not None:
            return
        stamp = self._stamp_now()
        if stamp in ('', self._stamp):
            return
        self._stamp = stamp
        if store.fingerprint(self.folder) != self._seen:
            self._start('reading', lambda: self._read_again(
                f'{self.folder.name} was changed elsewhere, and read again'))

    def _write(self, study: Study) -> None:
        """Write a study as the command line does."""
        content = self._run(jobs.files, study, str(self.folder))
        self._seen = tasks.rewrite(self.folder, content, self._seen)
        self._stamp = self._stamp_now()

    def go_to(self, folder: str | Path) -> bool:
        """Look at another study; return False where something is under way."""
        self._check(Path(folder))

        def work() -> None:
            before, self.folder, self._bag = self.folder, Path(folder), None
            try:
                self._load()
            except BaseException:
                self.folder = before
                raise
        return self._start('reading', work)

    def others(self) -> dict[str, str]:
        """Return the studies beside this one, {folder: name and domain}, itself among them."""
        out: dict[str, str] = {}
        for path in sorted({self.folder, *(p.parent for p in self.folder.resolve().parent.glob(
                '*/study.yaml'))}):
            head = _head(path / 'study.yaml')
            if 'sheet' not in head and 'domain' in head:
                out.setdefault(str(path.resolve()), f'{path.name} ({head["domain"]})')
        return out

    # --- the loop --------------------------------------------------------------------------------

    def _change(self, what: str, *steps: tuple[Any, ...],
                undo: jobs.Models | None = None) -> bool:
        """Compute another study by steps (function, arguments), each shown, and write it."""
        def work() -> None:
            before = study = self.study
            if study is None:
                raise InputError('there is no study yet', 'wait for it')
            if store.fingerprint(self.folder) != self._seen:
                raise tasks.ChangedError(f'{self.folder.name} was changed elsewhere')
            try:
                for function, *args in steps:
                    study, fresh = self._run(jobs.changed, function, study, *args)
                    self._take(study, fresh)
                    self.answers.clear()
                    self.version += 1
                self._write(study)
            except BaseException:
                self.study = before         # what is shown is what is on disk
                raise
            if undo is not None:
                self._undo.append(undo)
        return self._start(what, work)

    def _models(self, targets: Sequence[str]) -> jobs.Models:
        assert self.study is not None
        return {t: tuple(self.study.states[t].model.labels) for t in targets}

    def diagnose(self, targets: Sequence[str]) -> bool:
        """Find out what is missing."""
        return self._change('diagnose', (jobs.diagnose, list(targets)))

    def add(self, target: str, effects: Sequence[str] | None = None,
            everything: bool = False) -> bool:
        """Put effects into a model; without names what the diagnosis found."""
        return self._change('add', (jobs.add, target, effects, everything),
                            (jobs.diagnose, [target]), undo=self._models([target]))

    def remove(self, target: str, label: str) -> bool:
        """Take an effect out of a model."""
        return self._change('remove', (jobs.remove, target, label), (jobs.diagnose, [target]),
                            undo=self._models([target]))

    def complete(self, targets: Sequence[str]) -> bool:
        """Add what is missing until nothing is."""
        return self._change('complete', (jobs.complete, list(targets)),
                            undo=self._models(targets))

    @property
    def can_undo(self) -> str:
        """What undo would go back to, in words; empty where there is nothing to undo."""
        models = self._undo[-1] if self._undo else {}
        return '; '.join(f'{t}: {" + ".join(labels)}' for t, labels in models.items())

    def undo(self) -> bool:
        """Go back to the models before the last step."""
        if not self._undo or self.busy is not None:
            return False
        models = self._undo.pop()
        return self._change('undo', (jobs.back, models), (jobs.diagnose, list(models)))

    def identify(self, target: str, view: str, stretch: Stretch) -> bool:
        """Ask what a stretch of a panel is; :attr:`answers` holds what came of it."""
        def work() -> None:
            study, answer = self._run(jobs.identify, self.study, target, view, stretch)
            self._take(study, {})
            self.answers[target, view] = answer
        return self._start('looking', work)

    def _take(self, study: Study, fresh: jobs.Everything) -> None:
        """Take what another process made of the study: its states are copies, changed or not."""
        self._known = {t: (state, fresh[t] if t in fresh else self._known[t][1])
                       for t, state in study.states.items()}
        self.study = study

    def seen(self, target: str) -> jobs.Seen:
        """Return what is to be seen of a target; at once, unless a step was taken back."""
        assert self.study is not None
        state = self.study.states[target]
        if self._known[target][0] is not state:
            self._known[target] = state, jobs.seen(self.study.domain, state)
        return self._known[target][1]

    def export(self, name: str, axes: str = 'worst', inflate: float = 1.0) -> str:
        """Return the numbers as another program reads them."""
        if self.study is None or not package(self.study.domain).NUMBERS:
            raise InputError('only a noise study has densities to export', 'open one')
        return export.export(self.study, name, axes=axes, inflate=inflate)


def _head(path: Path) -> dict[str, str]:
    """Return what the first lines of a study say of it."""
    try:
        with open(path, encoding='utf-8') as file:
            lines = [line.rstrip() for _, line in zip(range(6), file)]
    except (OSError, UnicodeDecodeError):
        return {}
    pairs = (line.partition(':') for line in lines)
    return {k.strip(): v.strip() for k, _, v in pairs}
