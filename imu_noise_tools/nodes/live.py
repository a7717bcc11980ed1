# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A stream of samples in bounded memory: its last hours, and the Allan curve of all of it."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
import threading
from typing import TypeAlias

import numpy as np

from .times import ARRIVALS, REMEDY, STANDING
from ..core.allan import equivalent_freedom, interval
from ..core.clock import regular_rate
from ..core.errors import InputError
from ..core.record import ImuRecord
from ..core.units import times

#: tau (k,) s; deviation, lower and upper limit (k, columns)
Curve: TypeAlias = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]

_PER_CLUSTER = 16           # a stride of m/16 loses under 1 % of the degrees of freedom
_STANDING = 100             # samples with one stamp: more than a driver reads at once
_LONGEST = 1 << 27          # largest cluster, samples: a week and more at 200 Hz


@dataclass
class _Size:
    """What one cluster size m remembers: the last 2 m of the prefix sums, one in ``stride``."""

    m: int
    stride: int
    tail: np.ndarray
    total: np.ndarray
    count: int = 0

    def add(self, first: int, prefix: np.ndarray) -> None:
        """Take prefix sums (n, columns), the first of them that of ``first`` samples."""
        points = prefix[-first % self.stride::self.stride]
        if not len(points):
            return
        lag = self.m // self.stride
        x = np.concatenate([self.tail, points])
        if len(x) > 2 * lag:
            d = x[2 * lag:] - 2 * x[lag:-lag] + x[:-2 * lag]
            self.total += np.einsum('ij,ij->j', d, d)
            self.count += len(d)
        self.tail = x[-2 * lag:]


class LiveCurve:
    """
    The overlapping Allan deviation of a stream, with a stride of m/16; memory does not grow.

    sigma^2(m) = mean over k of (x_{k+2m} - 2 x_{k+m} + x_k)^2 / (2 m^2), x the prefix sums, k = 0,
    s, 2s ... with s = max(1, m/16) (IEEE 952 C.2). A sample that is not finite is taken for the
    one before it.

    """

    def __init__(self, columns: int):
        strides = np.unique(np.geomspace(1, _LONGEST / _PER_CLUSTER, 120).astype(int))
        self.n = 0
        self._offset: np.ndarray | None = None
        self._last = self._sum = np.zeros(columns)
        self._sizes = [
            _Size(m, s, np.zeros((1, columns)), np.zeros(columns))
            for m, s in [*((m, 1) for m in range(1, _PER_CLUSTER)),
                         *((_PER_CLUSTER * int(s), int(s)) for s in strides)]]

    def add(self, y: np.ndarray) -> None:
        """Take more rates, (n, columns); best some hundreds at once."""
        if not len(y):
            return
        if self._offset is None:
            self._offset = np.where(np.isfinite(y[0]), y[0], 0.0)
        y = _filled(y - self._offset, self._last)
        self._last = y[-1]
        prefix = self._sum + np.cumsum(y, axis=0)
        self._sum = prefix[-1]
        for size in self._sizes:
            size.add(self.n + 1, prefix)
        self.n += len(y)

    def curve(self, dt: float) -> Curve:
        """Return tau (k,) s, and deviation, lower and upper limit (95 %), each (k, columns)."""
        sizes = [s for s in self._sizes if s.count and s.m <= max(self.n // 3, 1)]
        if not sizes:
            empty = np.empty((0, len(self._sum)))
            return np.empty(0), empty, empty, empty
        m = np.array([s.m for s in sizes])
        dev = np.sqrt(np.array([s.total / s.count / 2 for s in sizes])) / m[:, None]
        lo, hi = np.empty_like(dev), np.empty_like(dev)
        for k in range(dev.shape[1]):
            seen = np.maximum(dev[:, k], np.finfo(float).tiny)
            lo[:, k], hi[:, k] = interval(dev[:, k], equivalent_freedom(seen, m, self.n))
        return m * dt, dev, lo, hi


def _filled(y: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Return y with each sample that is not finite replaced by the one before it."""
    bad = ~np.isfinite(y)
    if not bad.any():
        return y
    y = np.vstack([before, y])
    last = np.maximum.accumulate(np.where(np.isfinite(y), np.arange(len(y))[:, None], 0), axis=0)
    return np.take_along_axis(y, last, axis=0)[1:]


@dataclass
class Stream:
    """
    The samples of a node: the last ``hours`` of them and the curve of all.

    Safe to fill from one thread and to read from another. ``received`` counts what came,
    ``missed`` what did not (by the index of blocks, else by stamps), ``not_finite`` what came and
    is no number, of a sensor that has given some: one that is not there gives none. ``mixed`` says
    that the samples are of several sources, whose stamps tell of none what is missing.

    """

    hours: float
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def __post_init__(self):
        """Begin empty."""
        self.clear()

    def clear(self) -> None:
        """Forget everything."""
        with self._lock:
            self._clear()

    def _clear(self) -> None:
        self.missed = self.received = self.held = self.not_finite = 0
        self._gives = np.zeros(2, bool)
        self._parts: deque = deque()
        self._limit: int | None = None
        self._curve = LiveCurve(6)
        self._first = self._last = self._same = 0
        self._said = self.mixed = False

    @property
    def standing(self) -> str:
        """What to say where the stamps do not advance (the last hundred are one), else nothing."""
        if self._same < _STANDING:
            return ''
        by_arrival = self._held(20)[1]
        return ARRIVALS if by_arrival else f'{STANDING}; {REMEDY}'

    @property
    def whole(self) -> bool:
        """Whether everything that was received is still held."""
        return self.held == self.received

    @property
    def complete(self) -> bool:
        """Whether all that should have come has come, and is held; nothing is never complete."""
        return bool(self.received) and not (self.missed or self.mixed) and self.whole

    def add(self, stamps: np.ndarray, gyro: np.ndarray, accel: np.ndarray,
            first: int | None = None, arrivals: np.ndarray | None = None,
            several: Callable[[], bool] = lambda: False) -> str:
        """
        Take samples in the order of their arrival; return what is worth saying about them.

        A record that begins again, by its index or by its stamps, replaces what was there.

        Parameters
        ----------
        stamps : ndarray (n,)
            Header stamps, ns.
        gyro, accel : ndarray (n, 3)
            rad/s, m/s^2.
        first : int or None
            Index of the first sample in its record, where that is known.
        arrivals : ndarray (n,) or None
            When they came, ns of any clock: the times where all stamps are one.
        several : callable
            Tells whether they may be of several sources: asked where samples seem to be missing.

        """
        if not len(stamps):
            return ''
        said = ''
        arrivals = stamps[:0] if arrivals is None else arrivals
        with self._lock:
            again = self._again(stamps, first)
            if again is not None:
                self._clear()
                stamps, gyro, accel = stamps[again:], gyro[again:], accel[again:]
                arrivals = arrivals[again:]
                said = 'the record begins again; what was gathered before is dropped'
            lost = self._lost(stamps, first)
            self.mixed = self.mixed or lost > 0 and several()
            if lost and not self.mixed:
                self.missed += lost
                said = (f'{times(lost, "sample")} {"is" if lost == 1 else "are"} missing before '
                        f'sample {self.received + self.missed}')
            self._append(stamps, np.column_stack([gyro, accel]), arrivals)
            if not self._said and self.standing:
                self._said = True
                said = self.standing
        return said

    def _again(self, stamps, first) -> int | None:
        """Return from which sample on the record begins again; None where it goes on."""
        if first is not None:
            return 0 if first == 0 and self.received else None
        zero = self._first if self.received else stamps[0]
        before = np.concatenate([[self._last if self.received else stamps[0]], stamps[:-1]])
        found = np.flatnonzero((stamps < before) & (stamps <= zero))
        return int(found[-1]) if len(found) else None

    def _lost(self, stamps, first) -> int:
        if first is not None:
            return max(0, first - self.received - self.missed)
        step = 1e9 / self.rate_hz if self.rate_hz and self.received >= 100 else 0
        gaps = np.diff(stamps, prepend=self._last) if step else np.empty(0)
        return int(np.sum(np.round(gaps[gaps > 1.5 * step] / step) - 1)) if step else 0

    def _append(self, stamps, rows, arrivals) -> None:
        if not self.received:
            self._first = stamps[0]
        moved = np.flatnonzero(np.diff(stamps, prepend=self._last))
        self._same = len(stamps) - (moved[-1] if len(moved) else -self._same)
        self._last = stamps[-1]
        bad = ~np.isfinite(rows).reshape(-1, 2, 3).all(2)
        self._gives |= ~bad.all(0)
        self.not_finite += int(bad[:, self._gives].any(1).sum())
        self._parts.append((stamps, rows, arrivals))
        self.held += len(stamps)
        self.received += len(stamps)
        self._curve.add(rows)
        if self._limit is None and self.held >= 100:
            self._limit = int(self.hours * 3600 * (self.rate_hz or 1000.0))
        while self._limit and self.held - len(self._parts[0][0]) >= self._limit:
            self.held -= len(self._parts.popleft()[0])

    @property
    def rate_hz(self) -> float | None:
        """Rate by the first times held, median or, of arrivals, mean; None where they stand."""
        times, by_arrival = self._held(20)
        gaps = np.diff(times[:2000])
        step = np.mean(gaps) if by_arrival else np.median(gaps[gaps > 0]) if (
            gaps > 0).any() else 0
        return 1e9 / step if step > 0 else None

    def _held(self, most: int | None = None) -> tuple[np.ndarray, bool]:
        """Return the times (n,) ns, of so many parts, and whether they are those of arrival."""
        parts = list(self._parts)[:most]
        stamps, arrivals = (np.concatenate([p[k] for p in parts] or [np.empty(0, np.int64)])
                            for k in (0, 2))
        by_arrival = len(arrivals) == len(stamps) > 1 and bool(np.all(stamps == stamps[0])) \
            and arrivals[-1] > arrivals[0]
        return (stamps[0] + arrivals - arrivals[0] if by_arrival else stamps), by_arrival

    def samples(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return what is held: times (n,) ns, gyro (n, 3), accel (n, 3)."""
        with self._lock:
            if not self._parts:
                return np.empty(0, np.int64), np.empty((0, 3)), np.empty((0, 3))
            rows = np.concatenate([p[1] for p in self._parts])
            return self._held()[0], rows[:, :3], rows[:, 3:]

    def curve(self) -> Curve:
        """Return the curve of everything received; see :meth:`LiveCurve.curve`."""
        with self._lock:
            return self._curve.curve(1.0 / (self.rate_hz or 1.0))

    def record(self, topic: str, path: str = '', frame_id: str = '') -> ImuRecord:
        """
        Return what is held as a record, as :func:`imu_noise_tools.bag.open_record` gives it.

        Raises
        ------
        InputError
            Nothing was received, or neither its stamps nor arrivals advance.

        """
        stamps, gyro, accel = self.samples()
        if not len(stamps):
            raise InputError('nothing was received yet', f'publish on {topic}, or play a bag')
        t = (stamps - stamps[0]) * 1e-9
        rate_hz = regular_rate(t)
        if rate_hz is None:
            raise InputError(f'{topic}: {STANDING}', REMEDY)
        there = [bool(np.any((x != 0) & ~np.isnan(x))) for x in (gyro, accel)]
        if not any(there):
            raise InputError(f'{topic} holds neither rates nor accelerations', 'check the driver')
        return ImuRecord(gyro if there[0] else None, accel if there[1] else None, t, rate_hz,
                         start=float(stamps[0]) * 1e-9, topic=topic, frame_id=frame_id,
                         path=path or topic,
                         warnings=(f'{ARRIVALS}: they jitter',) if self._held(20)[1] else ())
