# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Look for what is missing from several targets at once, each in a process of its own.

The targets of a study know nothing of each other: what is found is the same as one after another,
and is told in the same order.

"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass
import os
from queue import SimpleQueue
import sys
import threading
from typing import Any

from .worker import StoppedError, Worker
from ..core.errors import InputError
from ..loop.diagnosis import Diagnosis
from ..loop.effect import Fit, Score
from ..loop.prediction import State
from ..loop.study import Progress, Step, Study, Told

Keep = Callable[[], None]


def diagnose(
    study: Study, targets: Iterable[str] | None = None, *, until_complete: bool = False,
    processes: int | None = None, progress: Progress | None = None, told: Told | None = None,
    keep: Keep | None = None
) -> None:
    """
    Find out what is missing from each target's model.

    Parameters
    ----------
    study : Study
        Is changed as :meth:`.Study.diagnose` and :meth:`.Study.complete` change it.
    targets : iterable of str, optional
        Default: all.
    until_complete : bool
        Add what is found, and look again.
    processes : int, optional
        How many at once, by default one for each processor that this process may use. No more
        than there are targets beyond chance: others take less than a process does.
    progress, told, keep : callable, optional
        As of the methods above.

    Raises
    ------
    InputError
        A process was ended from outside.

    """
    names = study.chosen(targets)
    fail = sum(not study.states[t].error.within_chance for t in names)
    count = min(processes or processors(), fail)
    if count > 1:
        _SideBySide(study, names, until_complete, progress, told, keep).run(count)
    elif until_complete:
        study.complete(names, progress=progress, told=told, keep=keep)
    else:
        study.diagnose(names, progress=progress, told=told)


def processors() -> int:
    """Return how many processors this process may use."""
    if sys.platform == 'linux':
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@dataclass(frozen=True)
class _Part:
    """What a process has of its target so far: all but the data, which are here as well."""

    fit: Fit[Any]
    error: Score
    summary: Mapping[str, float]
    new: tuple[Step, ...]
    diagnosis: Diagnosis | None

    @classmethod
    def of(cls, study: Study, target: str, known: int) -> _Part:
        """Return that of a study of one target, of which so many rungs were there before."""
        state = study.states[target]
        return cls(state.fit, state.error, state.summary, tuple(study.history[known:]),
                   study.diagnosis.get(target))


def _look(study: Study, until_complete: bool, tell: Callable[..., None]) -> _Part:
    """Look for what is missing from a study of one target; ``tell`` of each step and of it."""
    (target,), known = study.targets, len(study.history)

    def kept() -> None:
        tell('keep', _Part.of(study, target, known))

    def told(_: str, step: Step | None) -> None:
        if step is not None:    # the last word is told once it is there
            tell('rung', step)

    def progress(_: float | None, what: str) -> None:
        tell('progress', what)

    if until_complete:
        study.complete(progress=progress, told=told, keep=kept)
    else:
        study.diagnose(progress=progress)
    return _Part.of(study, target, known)


class _SideBySide:
    """The targets of a study, and what is known of each by now."""

    def __init__(self, study: Study, names: Sequence[str], until_complete: bool,
                 progress: Progress | None, told: Told | None, keep: Keep | None) -> None:
        self.study, self.names, self.until_complete = study, names, until_complete
        self.progress, self.told, self.keep = progress, told, keep
        self.before = list(study.history)
        self.new: dict[str, tuple[Step, ...]] = {t: () for t in names}
        self.unsaid: dict[str, list[Step | None]] = {t: [] for t in names}
        self.waiting = list(names)      # of which the last word is not said
        self.lock = threading.Lock()

    def run(self, count: int) -> None:
        """Look at all of them in so many processes."""
        with ThreadPoolExecutor(count) as pool, _workers(count) as free:
            each = [pool.submit(self._one, t, free) for t in self.names]
            try:
                for done in wait(each, return_when=FIRST_EXCEPTION).done:
                    done.result()
            finally:    # where one fails, or somebody presses Ctrl-C, no other is begun
                pool.shutdown(wait=False, cancel_futures=True)

    def _one(self, target: str, free: SimpleQueue[Worker]) -> None:
        """Look at one target in a process that is free."""
        worker, study = free.get(), self.study
        alone = Study(study.domain, {target: study.states[target]}, study.source,
                      [s for s in self.before if s.target == target],
                      {t: d for t, d in study.diagnosis.items() if t == target})
        try:
            part = worker.run(_look, alone, self.until_complete,
                              tell=lambda kind, what: self._hear(target, kind, what))
        except StoppedError:
            raise InputError(f'{target}: the process that looks for what is missing was ended',
                             'one at a time takes less memory: diagnose --jobs 1') from None
        finally:
            free.put(worker)
        with self.lock:
            self._take(target, part)
            self._say(target, None)

    def _hear(self, target: str, kind: str, what: Any) -> None:
        """Take in what the process of a target tells."""
        with self.lock:
            if kind == 'rung':
                self._say(target, what)
            elif kind == 'keep':
                self._take(target, what)
                if self.keep:
                    self.keep()
            elif self.progress:
                share = 1 - len(self.waiting) / len(self.names)
                self.progress(None if self.until_complete else share, what)

    def _take(self, target: str, part: _Part) -> None:
        """Put what there is of a target into the study; all in the order of the targets."""
        study = self.study
        study.states[target] = State(study.states[target].problem, part.fit, part.error,
                                     part.summary)
        self.new[target] = part.new
        study.history[:] = [*self.before, *(s for t in self.names for s in self.new[t])]
        known = {**study.diagnosis, target: part.diagnosis}
        study.diagnosis.clear()
        study.diagnosis.update((t, d) for t in study.targets if (d := known.get(t)))

    def _say(self, target: str, step: Step | None) -> None:
        """Tell of a rung, or of the last word, once all of the targets before have theirs."""
        self.unsaid[target].append(step)
        while self.waiting:
            first = self.waiting[0]
            said, self.unsaid[first] = self.unsaid[first], []
            for one in said:
                if self.told:
                    self.told(first, one)
            if None not in said:
                return
            del self.waiting[0]


@contextmanager
def _workers(count: int) -> Iterator[SimpleQueue[Worker]]:
    """Give a queue of processes, of which none is left behind."""
    workers, free = [Worker() for _ in range(count)], SimpleQueue[Worker]()
    try:
        for worker in workers:
            worker.start()
            free.put(worker)
        yield free
    finally:
        for worker in workers:
            worker.stop()
