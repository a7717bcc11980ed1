# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Drive Dask over the bags of a fleet: nothing lost, nothing done twice.

Dask distributed schedules, balances, retries and restarts. Here is what it cannot know: how much
memory a bag takes, which results are there already, and that a folder is written whole.

"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
import json
from pathlib import Path
import secrets
import time
from typing import Any

from . import extra
from .inputs import Bag
from .work import deliver, examine, facts_of, MARK, Options, Result
from ..core import files
from ..core.errors import InputError

Progress = Callable[[float | None, str], None]
# bytes of memory: a worker with nothing to do, and half as much again as analyse takes a message
# (bench/limits.py: 2.16 M messages 0.4 GB, a day at 200 Hz 1.5 GB)
BASE, PER_MESSAGE, MOST = 3e8, 150.0, 1.7e9
MESSAGE = {'.npz': 48, '.csv': 60}              # bytes a message takes on disk; a bag's 300
DEATHS = 3              # workers that a bag may kill
AHEAD = 3               # tasks a thread that the scheduler is given at one time
INDEX_EVERY = 20.0      # s between writings of the index


def need(bag: Bag) -> float:
    """Return the memory (bytes) that a bag takes, from its size."""
    suffix = Path(bag.path).suffix
    return min(BASE + PER_MESSAGE * bag.size / MESSAGE.get(suffix, 300), MOST)


def workers_for(bags: Sequence[Bag], cores: int, memory: float) -> tuple[int, float]:
    """Return how many workers a machine has room for, and the memory (bytes) of each."""
    most = max(map(need, bags), default=BASE)
    count = max(1, min(cores, int(0.85 * memory / most), len(bags)))
    return count, 0.85 * memory / count


@contextmanager
def connected(bags: Sequence[Bag], scheduler: str | None = None,
              workers: int | None = None) -> Iterator[Any]:
    """
    Give a Dask client: of a scheduler that is named, or of workers of its own on this machine.

    Raises
    ------
    InputError
        Nobody answers there, it has no workers, or the extra is not installed.

    """
    dask, distributed = extra('dask'), extra('distributed')
    if scheduler:
        try:
            client = distributed.Client(scheduler, timeout='15s', set_as_default=False)
        except (OSError, ValueError) as error:
            raise InputError(f'{scheduler}: no Dask scheduler answers ({error})',
                             'start one with: dask scheduler') from None
        with client:
            try:
                client.wait_for_workers(1, timeout=60)
            except (OSError, TimeoutError):
                raise InputError(f'{scheduler}: the scheduler has no workers',
                                 f'start some: dask worker {scheduler} --nthreads 1') from None
            yield client
        return
    memory = min(extra('distributed.system').MEMORY_LIMIT,
                 extra('psutil').virtual_memory().available)
    count, limit = workers_for(bags, workers or extra('dask.system').CPU_COUNT, memory)
    settings = {'distributed.scheduler.allowed-failures': DEATHS - 1,
                # a task that waits on a worker is suspected when another one kills it
                'distributed.scheduler.worker-saturation': 1.0,
                # the stack of what runs every 10 ms for a picture, the event loop's health every
                # 20 ms: both take the processor from what runs
                'distributed.worker.profile.enabled': False,
                'distributed.admin.tick.interval': '200ms',
                # by default a worker hands every 64 kB back to the system, and asks for it again
                # with each array: a fifth more of the processor's time
                'distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_': 64 << 20,
                'distributed.nanny.pre-spawn-environ.MALLOC_MMAP_THRESHOLD_': 64 << 20,
                'distributed.worker.memory.target': False,
                'distributed.worker.memory.spill': False,
                'distributed.worker.memory.pause': False}
    with dask.config.set(settings), \
            distributed.LocalCluster(n_workers=workers or count, threads_per_worker=1,
                                     memory_limit=int(limit), dashboard_address=':0',
                                     preload=f'{__package__}.worker',
                                     silence_logs=50) as cluster, \
            distributed.Client(cluster, set_as_default=False) as client:
        yield client


@dataclass
class Fleet:
    """
    The folder of a fleet: studies by their keys, facts beside them, and which bag has which.

    Parameters
    ----------
    folder : Path
        Made where it is not there.
    options : Options
        Of this run.

    """

    folder: Path
    options: Options
    index: dict[str, list[str]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Make the folder, or take it up again; raise InputError where it is another's."""
        mark = self.folder / MARK
        if self.folder.is_dir() and any(self.folder.iterdir()) and not mark.is_file():
            raise InputError(f'{self.folder}: holds something else than a fleet',
                             'choose another folder with -o')
        for name in ('bags', 'facts'):
            try:
                (self.folder / name).mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise files.cannot_write(self.folder, error) from None
        self.mark = secrets.token_hex(8)
        files.atomic_write(mark, self.mark)
        try:
            self.index = json.loads((self.folder / 'index.json').read_text())
        except (OSError, ValueError):
            self.index = {}         # what is in it is found again from the bytes

    def key(self, bag: Bag) -> str:
        """Return the key of a bag's result where its bytes are known, else nothing."""
        stamp, content = self.index.get(_name(bag), ('', ''))
        same = bool(stamp) and stamp == bag.stamp
        return self.options.of(bag).key(content, bag.topic) if same else ''

    def path(self, key: str) -> Path:
        """Return where the facts of a key are."""
        return self.folder / 'facts' / f'{key}.json'

    def done(self, bag: Bag, again: bool = False) -> bool:
        """Tell whether the result of a bag is there; with ``again`` a failure does not count."""
        key = self.key(bag)
        if not key or not self.path(key).is_file():
            return False
        return not (again and facts_of(self.path(key), self.path(key).read_text())['error'])

    def todo(self, bags: Sequence[Bag], again: bool = False) -> list[Bag]:
        """Return the bags without a result, the long ones first: none is left at the end."""
        return sorted((b for b in bags if not self.done(b, again)), key=lambda b: -b.size)

    def keep(self, bag: Bag, result: Result) -> None:
        """Write what became of a bag: the study first, then the facts that say it is there."""
        if not result.content:
            return
        if result.new:
            if result.files is not None:
                deliver(self.folder / 'bags' / result.key, result.files)
            files.atomic_write(self.path(result.key), result.facts())
        self.index[_name(bag)] = [bag.stamp, result.content]

    def write_index(self) -> None:
        """Write which bag has which bytes."""
        files.atomic_write(self.folder / 'index.json', json.dumps(self.index))

    def facts(self, bags: Sequence[Bag], lost: dict[str, str]) -> Iterator[tuple]:
        """Yield (bag, key, facts); of one without a result what was said of it."""
        for bag in bags:
            content = self.index.get(_name(bag), ('', ''))[1]
            key = self.options.of(bag).key(content, bag.topic)
            path = self.path(key)
            if _name(bag) not in lost and path.is_file():
                yield bag, key, facts_of(path, path.read_text())
            else:
                yield bag, '', {'rows': [], 'error': lost.get(_name(bag), 'not done yet')}


def _name(bag: Bag) -> str:
    return f'{bag.path}|{bag.topic}'


def run(fleet: Fleet, todo: Sequence[Bag], client: Any, progress: Progress | None = None,
        again: bool = False) -> dict[str, str]:
    """
    Examine bags; return why some have no result, by name.

    Parameters
    ----------
    fleet : Fleet
        Where the results are kept.
    todo : sequence of Bag
        As :meth:`Fleet.todo` gives them.
    client : distributed.Client
        Who does it.
    progress : callable or None
        Called with (share done, what), the time left in it.
    again : bool
        Whether bytes are examined anew where their result, a failure, is known.

    Raises
    ------
    InputError
        The scheduler is gone, or its workers do not have this package.

    """
    known = frozenset(() if again else (p.stem for p in (fleet.folder / 'facts').glob('*.json')))
    clock, lost = _Clock(todo, progress), {}
    written = time.monotonic()
    try:
        for bag, result in _results(fleet, todo, client, known):
            if isinstance(result, Result):
                fleet.keep(bag, result)
                if result.error and not result.content:
                    lost[_name(bag)] = result.error
            else:
                lost[_name(bag)] = _said(bag, result)
            clock.tick(bag)
            if time.monotonic() - written > INDEX_EVERY:
                fleet.write_index()
                written = time.monotonic()
    finally:
        fleet.write_index()
    return lost


def _results(fleet: Fleet, todo: Sequence[Bag], client: Any,
             known: frozenset[str]) -> Iterator[tuple[Bag, Any]]:
    """Yield (bag, Result or the exception); only a few tasks are with the scheduler at a time."""
    distributed = extra('distributed')
    shared = client.scatter(known, broadcast=True, hash=False) if len(known) > 50 else known
    done = distributed.as_completed(loop=client.loop)
    flying: dict[str, tuple[Bag, Any]] = {}
    rest = iter(todo)
    folder, finished = str(fleet.folder.resolve()), 0

    def fill(most: int) -> None:
        while len(flying) < most and (bag := next(rest, None)) is not None:
            key = f'examine-{secrets.token_hex(8)}'
            future = client.submit(examine, bag, fleet.options, folder, fleet.mark, shared,
                                   key=key, pure=False, retries=2)
            flying[key] = bag, future
            done.add(future)

    try:
        fill(most := _ahead(client))
        for future in done:
            bag, _ = flying.pop(future.key)
            finished += 1
            error = future.exception() if future.status != 'finished' else None
            if future.status == 'cancelled' or isinstance(error, distributed.CancelledError):
                raise InputError('the scheduler is gone', 'run the same again: what is done is '
                                 'kept')
            if isinstance(error, InputError):       # the worker's version is another
                raise error
            if isinstance(error, ModuleNotFoundError):
                raise InputError(f'the workers lack {error.name}',
                                 'install this package in their environment too')
            yield bag, error or future.result()
            if finished % 64 == 0:          # workers come and go
                most = _ahead(client)
            fill(most)
    finally:
        client.cancel([f for _, f in flying.values()], force=True)


def _ahead(client: Any) -> int:
    """Return how many tasks the scheduler is given at one time."""
    return AHEAD * max(sum(client.nthreads().values()), 4)


def _said(bag: Bag, error: BaseException) -> str:
    """Return one line on why a bag has no result."""
    if type(error).__name__ == 'KilledWorker':
        return (f'{bag.path}: set aside: it took {DEATHS} workers with it (too large for their '
                'memory, or a fault)')
    what = str(error).splitlines()[0] if str(error) else type(error).__name__
    if isinstance(error, OSError):
        return f'{bag.path}: cannot be fetched ({what})'
    return f'{bag.path}: unexpected {type(error).__name__} ({what}): a defect of imu_noise'


class _Clock:
    """Say how far it is and how long it will take, by bytes where they are known."""

    def __init__(self, todo: Sequence[Bag], progress: Progress | None) -> None:
        self.progress, self.count, self.done = progress, len(todo), 0
        self.whole = float(sum(b.size + 1e6 for b in todo))     # a small bag takes its time too
        self.part, self.begin = 0.0, time.monotonic()
        if progress:
            progress(0.0, f'0 of {self.count} bags')

    def tick(self, bag: Bag) -> None:
        """Count a bag as done."""
        self.done += 1
        self.part += bag.size + 1e6
        if self.progress:
            share = self.part / self.whole
            left = (time.monotonic() - self.begin) * (1 - share) / share
            self.progress(share, f'{self.done} of {self.count} bags, {span(left)} left')


def span(seconds: float) -> str:
    """Return a length of time as people say it."""
    if seconds < 90:
        return f'{seconds:.0f} s'
    return f'{seconds / 60:.0f} min' if seconds < 5400 else f'{seconds / 3600:.1f} h'
