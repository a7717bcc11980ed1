# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A bag as it is played: piece by piece, each as arrays and as messages, at a pace."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
import threading
import time

import numpy as np

from . import messages
from ..bag import Block, iter_blocks, iter_raw
from ..bag.source import Bag
from ..bag.tables import read_table, table_kind
from ..bag.topics import choose, list_topics
from ..core.errors import ImuNoiseError

_BLOCK = 4096               # samples, 229 kB
_SETTLE = 2.0               # s that further listeners get once the first is there


@dataclass(frozen=True)
class Piece:
    """
    Samples ``first`` and on: stamps (n,) ns, gyro and accel (n, 3), the frame.

    ``raw`` holds the messages, serialised, where they are wanted. ``sensor`` is the one that they
    are of, where each has its own times; ``first`` counts within it.

    """

    first: int
    stamps: np.ndarray
    gyro: np.ndarray
    accel: np.ndarray
    frame_id: str
    raw: list[bytes]
    sensor: str = ''

    def part(self, some: np.ndarray, first: int) -> Piece:
        """Return some samples (mask), the first of which has this index."""
        if some.all():
            return replace(self, first=first)
        raw = [r for r, good in zip(self.raw, some) if good]
        return replace(self, first=first, stamps=self.stamps[some], gyro=self.gyro[some],
                       accel=self.accel[some], raw=raw)


def pieces(path: str | Path, topic: str | None, raw: bool,
           fields: str | None = None) -> Iterator[Piece]:
    """
    Yield a record piece by piece; with the messages where they are wanted.

    Without them, sensors that have topics of their own come each at its own times, in order of
    time; a message holds both, the accelerations interpolated.

    Raises
    ------
    InputError
        As :func:`imu_noise_tools.bag.open_record`.

    """
    if not raw:
        yield from _pieces(iter_blocks(path, topic, _BLOCK, fields, apart=True))
        return
    source, first = iter_raw(path, topic, fields), 0
    while some := list(islice(source, _BLOCK)):
        stamps = np.array([stamp for _, _, stamp in some], np.int64)
        # where all stamps of a record are zero, the receive time beside the bytes is its stamp
        batch = [message if messages.rate_of(message)[0] else messages.with_stamp(message, stamp)
                 for _, message, stamp in some]
        found = messages.samples(batch)
        yield Piece(first, stamps, found.gyro, found.accel, found.frame_id, batch)
        first += len(some)


def _pieces(blocks: Iterable[Block]) -> Iterator[Piece]:
    first: Counter[str] = Counter()
    for b in blocks:
        sensor = 'gyro' if b.accel is None else 'accel' if b.gyro is None else ''
        nothing = np.full((len(b.stamp), 3), np.nan)
        gyro, accel = (nothing if x is None else x for x in (b.gyro, b.accel))
        yield Piece(first[sensor], b.stamp, gyro, accel, b.frame_id, [], sensor)
        first[sensor] += len(b.stamp)


def about(path: str | Path, topic: str | None, raw: bool,
          fields: str | None = None) -> tuple[int, str, str]:
    """
    Return how many samples a record is said to have (0: nobody knows), its topic, and a warning.

    ``raw`` says whether its messages are wanted, as for :func:`pieces`.

    Raises
    ------
    InputError
        There is no record in it, as :func:`imu_noise_tools.bag.open_record`.

    """
    if table_kind(path):
        record = read_table(Path(path), 1.0, fields)
        return record.n, record.topic, ''
    with Bag(path) as bag:
        choice = choose(bag, topic, fields)
        counts = {t.name: t.samples for t in list_topics(bag) if t.name in choice.names}
        said, samples = '', counts[choice.base]
        if len(counts) == 2 and max(counts.values()) > 1.01 * min(counts.values()):
            if raw:
                said = (f'{" and ".join(choice.names)} are sampled at rates of their own; in the '
                        'messages the accelerations are interpolated, so that their noise reads '
                        'low: to analyse them play with -p publish:=buffer')
            else:
                samples = sum(counts.values())
        return samples, ','.join(choice.names), said


class Player:
    """
    Plays a record in a thread: at a pace, with pauses, again and again.

    Parameters
    ----------
    source : callable
        Returns the pieces from the beginning; see :func:`pieces`.
    outputs : Outputs
        Where the pieces go.
    speed, start, duration, patience : float
        Times real time (0: as fast as the outputs take it); what to play, s; how long to wait for
        a listener, s.
    loop : bool
        Begin again at the end.

    ``state`` is waiting, playing, paused, end, or failed (then ``error`` says why); ``frame_id``
    is that of the last piece.

    """

    def __init__(self, source, outputs, speed=0.0, start=0.0, duration=0.0, patience=10.0,
                 loop=False):
        self._source, self._outputs = source, outputs
        self.start, self.duration, self.patience, self.loop = start, duration, patience, loop
        self._speed, self._begun = speed, None
        self._paused, self._quit = False, False
        self._interrupt, self._again = threading.Event(), threading.Event()
        self.state, self.error, self.frame_id = 'waiting', '', ''
        self._sent: Counter[str] = Counter()        # by sensor
        self.seen = self.passes = 0
        self.position_s = 0.0
        self._thread = threading.Thread(target=self._run, daemon=True)

    @property
    def sent(self) -> int:
        """How many samples were handed over in this pass."""
        return self._sent.total()

    def begin(self) -> None:
        """Start playing."""
        self._thread.start()

    def end(self) -> None:
        """Stop for good, within a moment."""
        self._quit = True
        self._again.set()
        self._interrupt.set()
        self._thread.join(1.0)

    def restart(self) -> None:
        """Go back to the beginning, and play."""
        self._paused = False
        self._again.set()
        self._interrupt.set()

    def pause(self) -> bool:
        """Pause, or go on; return whether it is paused now."""
        self._paused = not self._paused
        return self._paused

    def set_speed(self, speed: float) -> None:
        """Change the speed from here on."""
        self._speed, self._begun = speed, None

    def _run(self) -> None:
        while True:
            self._interrupt.clear()
            self._again.clear()
            if self._quit:              # looked at after the events: an end() before counts, too
                return
            self.state, self.error, self._begun = 'waiting', '', None
            self._sent = Counter()
            self.seen = 0
            try:
                self._wait_for_listeners()
                self._once()
            except ImuNoiseError as error:
                self.state, self.error = 'failed', str(error)
            if not self._interrupt.is_set():
                self._outputs.ended()
                if not (self.loop and self.state == 'end'):
                    self._again.wait()

    def _wait_for_listeners(self) -> None:
        """
        Wait until every output has a listener, or a while after the first, or patience ends.

        For readers that are named it waits without end: a bag played to others is lost to them.

        """
        began, first = time.monotonic(), None
        while self.patience and not self._interrupt.wait(0.05):
            there, missing = self._outputs.listeners(), self._outputs.missing()
            now = time.monotonic()
            if missing and now - began > self.patience:
                self._outputs.waits_for(missing)
                began = now
            if missing:
                continue
            if any(there) and first is None:
                first = now
            if all(there) or (first is not None and now - first > _SETTLE):
                return
            if now - began > self.patience and first is None:
                self._outputs.alone()
                return

    def _once(self) -> None:
        """Play from the beginning to the end, unless interrupted."""
        zero = None
        self.state = 'playing'
        for piece in self._source():
            zero = int(piece.stamps[0]) if zero is None else zero
            self.seen += len(piece.stamps)
            piece = self._cut(piece, zero)
            if len(piece.stamps):
                self.frame_id = piece.frame_id
                self._outputs.piece(piece, self._due)
                self._sent[piece.sensor] += len(piece.stamps)
                self.position_s = (int(piece.stamps[-1]) - zero) * 1e-9
            elif self.sent and self.duration:
                break
            if self._interrupt.is_set():
                return
        self._outputs.flush()
        self.passes += 1
        self.state = 'end'

    def _cut(self, piece: Piece, zero: int) -> Piece:
        """Return what is to be played of a piece; samples are counted from the first that is."""
        after = piece.stamps - zero
        some = after >= self.start * 1e9
        if self.duration:
            some &= after < (self.start + self.duration) * 1e9
        return piece.part(some, self._sent[piece.sensor])

    def interrupted(self) -> bool:
        """Whether to leave off at once."""
        return self._interrupt.is_set()

    def _due(self, stamp_ns: int) -> bool:
        """Wait until a stamp is due; return False where the playing was interrupted meanwhile."""
        while self._paused and not self._interrupt.wait(0.05):
            self.state, self._begun = 'paused', None
        if self.state == 'paused':
            self.state = 'playing'
        speed = self._speed
        if speed:
            now = time.monotonic()
            if self._begun is None or stamp_ns < self._begun[1]:
                self._begun = now, stamp_ns
            began, first = self._begun
            left = began + (stamp_ns - first) * 1e-9 / speed - now
            while left > 5e-4 and not self._interrupt.wait(min(left, 0.1)) and not self._paused:
                left = began + (stamp_ns - first) * 1e-9 / speed - time.monotonic()
        return not self._interrupt.is_set()
