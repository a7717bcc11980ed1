# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The clock behind the stamps of a stream: its rate, and which samples were lost.

A sensor samples evenly; stamps are put on later, by a driver that is late, reads a buffer, or
counts coarse ticks. A late stamp is caught up by those after it; a lost sample shifts all that
follow by one interval. So the lag of the stamps behind an even clock is followed, on the samples
themselves where they are good, on levels of blocks where they are not, and a loss is a step of the
lag that stays and that is a whole number of intervals.

"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from .statistics import in_a_row, median_sigma, middle_sigma, quantile_sigma, row_medians
from .units import times

SCALES = (8, 16, 32, 64, 128, 256, 512, 1024)    # samples in a block whose level is followed
SURE = 12.0             # scatters of the levels that a loss has to be
LEAST_BLOCKS = 16
STEP = 0.5              # a lag that changes by so much of an interval is looked at
FEW = 3                 # levels that are needed on each side
NEAR = 8                # levels on each side of a step that tell its size
WIDE, BRIEF = 48, 256   # and, of so many samples each, what was lost there once more
DRIFT = 0.01            # more than a clock wanders, relative
OFTEN, COUNTED = 0.05, 20   # share of losses that hides the period, and lost in a row that tell it
EVEN = 1e-9             # relative scatter of intervals that only arithmetic gives
GOOD = 0.1              # stamps that scatter by less of an interval are followed one by one
FINE = 0.04             # and by less of it, even a part of an interval shows
OVER = 100              # samples across which a first rate is read
SELDOM = 1e-3           # a clock is set after no fewer samples than one over this
WHOLE = 0.3             # a step this near to a whole number of intervals is a loss
MANY = 200              # of so many lost in a row the exact number matters no more
LEVELS = 512            # of which the rate is fitted
MANY_STEPS = 500_000    # tell a first rate well enough
STAMPED_HZ = (0.95, 2e4)    # rates that stamps of an IMU in s give; others are in another unit
LONG_GAP_S = 1.0        # a gap of so long (and of ten samples) is a pause of the stream


PATTERNS = {
    'computed': 'perfectly even, counted or calculated',
    'even': 'even',
    'jitter': 'put on late, by a varying delay',
    'coarse': 'counted in ticks',
    'bursts': 'put on when a buffer was read, in bursts',
}


@dataclass(frozen=True)
class SampleClock:
    """
    An even clock and what the stamps do about it.

    Parameters
    ----------
    rate_hz : float
        Samples per second of the stamps' clock, losses and steps of the clock allowed for.
    gaps : ndarray (g,)
        Index of the last sample before each loss.
    lost : ndarray (g,)
        How many samples were lost there.
    steps : ndarray (s, 2)
        Where the clock itself was set: index of the last sample before, s (forward positive).
    resolvable : int
        The smallest number of samples lost in a row that these stamps can show.
    jitter_s : float
        Scatter of single stamps about the clock, s.
    tick_s : float
        Step of the grid that the stamps lie on, s; 0 where there is none.
    pattern : str
        ``computed`` (from a rate, not measured), ``even``, ``jitter``, ``coarse`` (ticks) or
        ``bursts`` (stamped when a buffer was read).

    """

    rate_hz: float
    gaps: np.ndarray
    lost: np.ndarray
    steps: np.ndarray
    resolvable: int
    jitter_s: float
    tick_s: float
    pattern: str

    @property
    def missing(self) -> int:
        """Number of samples lost."""
        return int(np.sum(self.lost))

    def pauses(self) -> np.ndarray:
        """Return the index of the last sample before each long interruption, (p,) int."""
        least = max(LONG_GAP_S, 10 / self.rate_hz)
        lost = self.gaps[self.lost / self.rate_hz > least]
        return np.unique(np.r_[lost, self.steps[self.steps[:, 1] > least, 0]]).astype(np.int64)

    def doubts(self) -> tuple[str, ...]:
        """Return sentences on stamps that had to be evened out."""
        said = []
        if self.resolvable > 1:
            said.append(
                f'the stamps ({PATTERNS[self.pattern]}) scatter by {1e3 * self.jitter_s:.3g} ms: '
                f'the samples are taken as even at {self.rate_hz:.6g} Hz; fewer than '
                f'{self.resolvable} lost in a row would not show'
            )
        if len(self.steps):
            most = float(self.steps[np.argmax(np.abs(self.steps[:, 1])), 1])
            said.append(
                f'the stamps step {times(len(self.steps))} against the samples, by up to '
                f'{most:.3g} s: their clock was set; the samples go on evenly'
            )
        return tuple(said)

    def place(self, n: int) -> np.ndarray:
        """Return the place of each of n samples on the even clock, (n,) int."""
        out = np.ones(n, np.int64)
        out[:1] = 0
        np.add.at(out, self.gaps + 1, self.lost)
        return np.cumsum(out, out=out)


def median_rate(t: np.ndarray) -> float | None:
    """
    Return one over the median positive interval of stamps t (n,), s, in Hz; None: there is none.

    What a stream shows at once; buffered or coarse stamps belie it.

    """
    dt = np.diff(t)
    dt = dt[dt > 0]
    return float(1 / np.median(dt)) if dt.size else None


def regular_rate(t: np.ndarray) -> float | None:
    """
    Return the rate of stamps t (n,), s, in Hz, that gaps, jitter and bursts do not change.

    Return None where there is none.

    The median step alone is wrong where stamps are coarse (3 and 4 ms for 285 Hz) or come in
    bursts: the median is taken of steps over up to 100 samples, and refined by the mean of those
    near it. :func:`fit_clock` is better by far, and slower.

    """
    t = t[np.isfinite(t)]
    return _rate_over(t, min(OVER, (len(t) - 1) // 2))


def _rate_over(t: np.ndarray, m: int) -> float | None:
    """Return the rate that steps over m of stamps t (n,), s, usually give, Hz, or None."""
    if m < 1:
        return None
    some = len(t) // MANY_STEPS | 1     # odd, so as not to beat with a buffer
    step = (t[m::some] - t[:len(t) - m:some]) / m
    step = step[step > 0]
    if not len(step):
        return None
    middle = np.median(step)
    return float(1 / np.mean(step[np.abs(step / middle - 1) < 0.1]))


def fit_clock(t: np.ndarray) -> SampleClock | None:
    """
    Return the clock behind stamps t (n,), s, finite and never falling; None: there is no rate.

    Where the stamps are too rough to show one lost sample, only losses of ``resolvable`` and more
    in a row are claimed.

    """
    rate = regular_rate(t)
    if rate is None:
        return None
    period, interval = 1 / rate, np.diff(t)
    tick = _tick(interval, period)
    beats = tick > 0.5 * period and _beats(interval, tick)
    if not beats:
        period = _counted(interval) or _near(interval, period)
    clock = _Lag(t, period, beats).followed(tick)
    if clock.scale > 1 or len(clock.gaps):
        # once more with the better period: a wrong one tilts what is compared across a step
        clock = _Lag(t, clock.period, beats).followed(tick)
    jitter = clock.jitter()
    # rough stamps of a stream that begins with a delay look as if their clock had been set
    steps = clock.steps[:len(clock.steps) if clock.resolvable == 1 else 0]
    return SampleClock(
        1 / clock.period, clock.gaps, clock.lost, steps, clock.resolvable, jitter, tick,
        _pattern(interval, clock.period, jitter, tick),
    )


def _thinned(interval: np.ndarray) -> np.ndarray:
    """Return as many intervals as tell a rate, an odd number apart: that beats with no buffer."""
    return interval[::len(interval) // MANY_STEPS | 1]


def _beats(interval: np.ndarray, tick: float) -> bool:
    """Tell whether stamps skip ticks at short and even distances: no losses, but a slower rate."""
    late = np.flatnonzero(interval > np.median(interval) + 0.5 * tick)
    if len(late) < 20:
        return False
    low, middle, high = np.quantile(np.diff(late), (0.1, 0.5, 0.9))
    return bool(high - low <= 0.3 * middle + 1 and middle < 0.01 * len(interval))


def _counted(interval: np.ndarray) -> float:
    """
    Return the period of stamps that are whole numbers of it apart, whatever was lost, or 0.

    Most are one apart: half of all samples may be lost, where no hundred follow each other.

    """
    some = _thinned(interval)
    usual = float(np.median(some))
    if not usual > 0:
        return 0.0
    usual = float(np.mean(some[np.abs(some - usual) < WHOLE * usual]))
    whole = np.round(some / usual)
    near = np.abs(some - whole * usual) < WHOLE * usual
    told = (whole >= 1) & (whole <= COUNTED) & near
    several = float(np.mean(whole > 1))
    # of the pauses of a reader that takes a buffer at once three of five are that near by chance
    if several and np.mean(near[whole > 1]) < 1 - OFTEN:
        return 0.0
    # what is seldom lost needs no counting, and what comes late is caught up in no time
    if np.mean(told) < 1 - OFTEN or several < OFTEN or np.mean(whole < 1) > OFTEN * several:
        return 0.0
    return float(np.sum(some[told]) / np.sum(whole[told]))


def _near(interval: np.ndarray, period: float) -> float:
    """Return the mean of the intervals near a period, if most are: losses do not count in it."""
    off = _thinned(interval) - period
    usual = off[np.abs(off) < STEP * period]
    change = float(np.mean(usual)) if len(usual) > 0.5 * len(off) else 0.0
    return period + change if abs(change) < 0.15 * period else period


def _pattern(interval: np.ndarray, period: float, jitter: float, tick: float) -> str:
    """Return the name of what the stamps look like."""
    # a millionth of a second is what stamps of this century in a float64 leave
    if len(interval) >= 1000 and np.ptp(interval) < max(EVEN * period, 5e-15 * len(interval)):
        return 'computed'
    if tick > 0.05 * period:
        return 'coarse'
    if np.mean(interval < 0.3 * period) > 0.2:
        return 'bursts'
    return 'jitter' if jitter > 0.1 * period else 'even'


def _tick(interval: np.ndarray, period: float) -> float:
    """Return the grid of the stamps, s: all intervals are multiples of it; 0 where none is."""
    some = np.sort(interval[:200_000])
    part = np.flatnonzero(np.diff(some, prepend=-1.0) > 0.02 * period)
    counts = np.diff(np.append(part, len(some)))
    levels = np.array([np.median(some[k:k + c]) for k, c in zip(part[:100], counts)])
    # what happened once or twice is no grid: a clock that was set leaves an interval of its own
    levels = levels[counts[:100] > max(1e-5 * len(some), FEW - 1)]
    apart = np.diff(levels[levels > 0.02 * period], prepend=0.0)
    if len(part) > 100 or len(levels) < 2 or not len(apart):
        return 0.0
    tick = np.min(apart)
    tick = np.sum(apart) / np.sum(np.round(apart / tick))
    off = np.abs(some - tick * np.round(some / tick))
    return float(tick) if np.mean(off <= 2e-6 + 0.02 * tick) > 0.999 else 0.0


class _Lag:
    """The lag of stamps behind an even clock of a given period, and the steps in it."""

    def __init__(self, t: np.ndarray, period: float, beats: bool = False) -> None:
        self.t, self.period, self.beats = t, period, beats
        self.n = len(t)
        none = np.zeros(0, np.int64)
        self.gaps, self.lost, self.steps = none, none, np.zeros((0, 2))
        self.resolvable = 1
        self.low, self.scale = False, 1

    def followed(self, tick: float) -> _Lag:
        """Find the steps and fit the period."""
        interval = np.diff(self.t)
        some = _thinned(interval)
        off = some - self.period * np.maximum(np.round(some / self.period), 1)
        good = not self.beats and _scatter(off) < GOOD * self.period
        buffer = self._buffer(interval) if good else 0.0
        if good and not buffer:
            self._by_sample(interval)
            buffer = self._read()
        if good and not buffer:
            if not tick and _scatter(some - self.period) < FINE * self.period:
                self._set_back(interval)
        else:
            self._by_level(buffer)
        self._without_beat(interval, tick)
        self.period = self._fitted()
        if self._recounted():
            self.period = self._fitted()
        return self

    def _buffer(self, interval: np.ndarray) -> float:
        """
        Return a length above that of the buffers by which stamps are late, samples; 0: by none.

        Within a buffer such stamps may be perfectly even, and what came late is caught up by the
        next buffer, far from the late interval. Early intervals that no late one just before asks
        for tell them: clocks are not set so often.

        """
        early = np.flatnonzero(interval < (1 - STEP) * self.period)
        if len(early) < SELDOM * self.n:
            return 0.0
        late = np.flatnonzero(interval > (1 + STEP) * self.period)
        until = np.maximum.accumulate(np.r_[0, late + _reach(interval[late] / self.period)])
        alone = int(np.sum(until[np.searchsorted(late, early)] < early))
        return self.n / alone if alone > SELDOM * self.n else 0.0

    def _read(self) -> float:
        """
        Return the length of buffers, samples, that jumps found one by one betray; 0: none.

        Stamps counted back from the reading of a buffer at a nominal rate jump at every reading of
        a sensor that is slower: by no whole number of intervals, or after the same number of
        samples each time. What is lost is whole, and by chance.

        """
        steps = self.steps[self.steps[:, 1] > 0, 0].astype(np.int64)
        jumps = np.sort(np.r_[self.gaps, steps])
        if len(jumps) < COUNTED or self.n < LEAST_BLOCKS * SCALES[0]:
            return 0.0
        apart = np.diff(jumps)
        usual = int(np.median(apart))
        even = usual > 1 and np.mean(apart % usual == 0) > 1 - OFTEN
        # of jumps by any size three of five are near a whole number: the others tell
        often = len(steps) > max(OFTEN * len(jumps), COUNTED / 2)
        return float(usual) if even or often else 0.0

    def _by_sample(self, interval: np.ndarray) -> None:
        """
        Find the losses of stamps most of which are good, one late interval after the other.

        A delay is one-sided, and caught up by the time the samples that waited have arrived: the
        least lag after a late interval and the least before it differ by what stays.

        """
        late = np.flatnonzero(interval > (1 + STEP) * self.period).tolist()
        gaps, lost, steps = [], [], []
        begin = 0
        for k in late:
            if k < begin:
                continue
            x = self._stays(k, begin, interval)
            if x < STEP:
                continue
            whole = round(x)
            if abs(x - whole) <= WHOLE or x > MANY:
                gaps.append(k)
                lost.append(whole)
            else:
                steps.append((k, x * self.period))
            begin = k + 1
        self.gaps, self.lost = np.array(gaps, np.int64), np.array(lost, np.int64)
        self.steps = np.array(steps).reshape(-1, 2)

    def _stays(self, k: int, begin: int, interval: np.ndarray) -> float:
        """Return what stays of a late interval, of those since ``begin``, in periods."""
        reach = int(_reach(interval[k] / self.period))
        near = slice(max(begin, k + 1 - NEAR), k + 1)
        far = slice(k + 1, k + 1 + reach)
        before = np.min(self.t[near] - self.period * np.arange(*near.indices(self.n)))
        after = np.min(self.t[far] - self.period * np.arange(*far.indices(self.n)))
        return float((after - before) / self.period)

    def _set_back(self, interval: np.ndarray) -> None:
        """
        Find where the clock of even stamps was set back by a part of an interval.

        That is a short interval by itself, and seldom: often, it is a late reader that catches up.
        A simple fraction of an interval is where polls slip against the samples, and no clock's.

        """
        part = interval / self.period
        off = np.flatnonzero(np.abs(part - 1) > 5 * FINE)
        apart = np.diff(np.r_[-self.n, off, 2 * self.n]) > NEAR
        k = off[apart[1:] & apart[:-1] & (part[off] < 1)]
        often = part[k, None] * (2, 3, 4)
        k = k[np.all(np.abs(often - np.round(often)) > FINE, axis=1)]
        near = np.arange(NEAR)
        before, after = (
            np.median(self.t[at] - self.period * at, axis=1) for at in (
                np.maximum(k[:, None] - near, 0), np.minimum(k[:, None] + 1 + near, self.n - 1))
        )
        stays = after - before < -5 * FINE * self.period    # no late stamp that was caught up
        if np.sum(stays) < SELDOM * self.n:
            steps = np.column_stack([k, after - before])[stays]
            self.steps = np.vstack([self.steps, steps])
            self.steps = self.steps[np.argsort(self.steps[:, 0])]

    def _by_level(self, buffer: float) -> None:
        """Find the losses of rough stamps, as steps between the levels of blocks."""
        if buffer:      # within one the stamps go at another rate, and no level follows that
            over = min(NEAR * int(np.ceil(buffer)), (self.n - 1) // FEW)
            self.period = 1 / (_rate_over(self.t, over) or 1 / self.period)
        lag = self.t - self.period * np.arange(self.n)
        levels, noise = self._levels(lag, buffer)
        self.resolvable = max(1, int(np.ceil(SURE * noise / self.period)))
        where, size = self._clusters(levels, noise)
        x = size / self.period
        whole = np.round(x)
        # near an end too few levels tell a loss from a delay
        count = len(levels)
        inside = (where[:, 0] >= FEW - 1) & (where[:, 1] <= count - FEW) | (x > NEAR)
        loss = (whole >= self.resolvable) & inside
        clock = ~loss & (np.abs(x) > max(STEP, self.resolvable - 1))
        at = np.array([self._found(lag, a, b) for a, b in where.tolist()], np.int64)
        self.gaps, self.lost = at[loss], whole[loss].astype(np.int64)
        self.steps = np.column_stack([at[clock], size[clock]])
        self._beside_few()

    def _beside_few(self) -> None:
        """Find the pauses beside which so few samples lie that no levels show them, or half."""
        interval = np.diff(self.t)
        lost: dict[int, int] = {}
        for k in np.flatnonzero(interval > max(LONG_GAP_S, NEAR * self.period)).tolist():
            x = self._stays(k, max(lost, default=-1) + 1, interval)
            if x > NEAR:
                lost[k] = round(x)
        apart = np.diff(np.r_[-1, np.array(list(lost), np.int64), self.n - 1])
        few = np.minimum(apart[:-1], apart[1:]) < FEW * self.scale
        new = np.array(list(lost), np.int64)[few]

        def others(at: np.ndarray) -> np.ndarray:
            return np.abs(at[:, None] - new).min(axis=1, initial=self.n) > self.scale

        kept = others(self.gaps)
        at = np.append(self.gaps[kept], new)
        order = np.argsort(at)
        self.gaps = at[order]
        self.lost = np.append(self.lost[kept], np.array(list(lost.values()), np.int64)[few])[order]
        self.steps = self.steps[others(self.steps[:, 0])]

    def _levels(self, lag: np.ndarray, buffer: float) -> tuple[np.ndarray, float]:
        """
        Return the levels of the finest blocks that scatter little, and their scatter, s.

        A block holds several buffers: within one the stamps are as good as their first.

        """
        best: tuple[float, np.ndarray] = (np.inf, lag[:2])
        for scale in SCALES:
            if scale < min(buffer, SCALES[-1]):
                continue
            count = self.n // scale
            if count < LEAST_BLOCKS and np.isfinite(best[0]):
                break
            rows = lag[:count * scale].reshape(count, scale)
            for low in (False, True):
                change = np.diff(rows.min(axis=1) if low else row_medians(rows))
                most = DRIFT * scale * self.period
                # what a clock cannot do is a step or a delay, and must not look like drift
                drift = np.where(np.abs(change) < 4 * most, change, 0.0)
                change -= np.clip(median_filter(drift, 31, mode='nearest'), -most, most)
                noise = _scatter(change)
                if noise < best[0]:
                    best = noise, np.append(0.0, np.cumsum(change))
                    self.scale, self.low = scale, low
            if SURE * best[0] < self.period:
                break
        return best[1], best[0]

    def _clusters(self, levels: np.ndarray, noise: float) -> tuple[np.ndarray, np.ndarray]:
        """
        Return where the levels step: last before and first after, (c, 2), and by how much, s.

        A delay and its catching up are one cluster, across which nothing changes.

        """
        hot = np.abs(np.diff(levels)) > max(0.3 * self.period, 4 * noise)
        where = in_a_row(hot)
        if not len(where):
            return where, np.zeros(0)
        begin = np.append(0, where[:-1, 1])
        end = np.append(where[1:, 0], len(levels) - 1)
        near = np.arange(NEAR)
        before, after = where[:, :1] - near, where[:, 1:] + near
        size = _median(levels, after, after <= end[:, None]) - _median(
            levels, before, before >= begin[:, None]
        )
        return where, size

    def _found(self, lag: np.ndarray, first: int, last: int) -> int:
        """Return the last sample before a step between two levels."""
        a, b = first * self.scale, min((last + 1) * self.scale, self.n - 1)
        if self.low:
            return a + int(np.argmax(np.diff(self.t[a:b + 1])))
        some = lag[a:b] - np.mean(lag[a:b])
        return a + int(np.argmin(np.cumsum(some)[:-1]))     # least squares: one step

    def _without_beat(self, interval: np.ndarray, tick: float) -> None:
        """
        Take back what is the beat of the sampling with coarse ticks, not loss.

        Stamps that count ticks as long as the interval skip one, or repeat one, whenever the phase
        of the two has gone round: always the same step, at even distances.

        """
        if tick < 0.5 * self.period:
            return
        size = np.abs(self.steps[:, 1])
        slip = np.flatnonzero(size < 1.5 * max(tick, self.period))
        beat = slip[_regular(self.steps[slip, 0], self.n)]
        other = size > 1.2 * tick
        other[beat] = False
        self.steps = self.steps[other]
        if not len(self.gaps) or self.scale == 1 and self._repeats(interval):
            return
        slip = self.lost * self.period < 1.5 * max(tick, self.period)
        single = np.flatnonzero(slip & (self.lost == np.min(self.lost)))
        beat = single[_regular(self.gaps[single], self.n)]
        keep = np.ones(len(self.gaps), bool)
        keep[beat] = False
        self.gaps, self.lost = self.gaps[keep], self.lost[keep]

    def _repeats(self, interval: np.ndarray) -> bool:
        """Tell whether the ticks are repeated now and then: then none is skipped in turn."""
        short = interval < (1 - STEP) * self.period
        late = interval > (1 + STEP) * self.period
        alone = short[1:-1] & ~late[:-2] & ~late[2:]
        return bool(np.sum(alone) > 0)

    def _residual(self, period: float) -> np.ndarray:
        """Return the stamps less the clock, with losses and set clocks allowed for, s."""
        out = np.arange(self.n) * -period
        out += self.t
        if len(self.gaps) or len(self.steps):
            shift = np.zeros(self.n)
            np.add.at(shift, self.gaps + 1, self.lost * period)
            np.add.at(shift, self.steps[:, 0].astype(np.int64) + 1, self.steps[:, 1])
            out -= np.cumsum(shift, out=shift)
        return out

    def _fitted(self) -> float:
        """
        Return the mean period, s.

        A robust line through the levels of blocks; where the clock wanders beyond what single
        blocks scatter, the ends of the wander count.

        """
        period = self.period
        length = max(self.scale, self.n // LEVELS, 1)
        count = self.n // length
        total = self.n - 1 + int(np.sum(self.lost))
        for _ in range(2):
            rows = self._residual(period)[:count * length].reshape(count, length)
            level = rows.min(axis=1) if self.low else row_medians(rows)
            at = self._middle(count, length)
            slope, rest = _line(at, level)
            period += slope
        if count >= LEAST_BLOCKS:
            rough, all_of_it = np.sum(np.diff(rest) ** 2), np.sum(rest ** 2)
            if rough < 0.6 * all_of_it:
                some = max(4, count // 16)
                span = at[-1] - at[0]
                first = np.polyval(np.polyfit(at[:some], rest[:some], 1), at[0])
                last = np.polyval(np.polyfit(at[-some:], rest[-some:], 1), at[-1])
                period += (last - first) / span
        return float(period) if 0 < period and total > 0 else self.period

    def _recounted(self) -> bool:
        """
        Count the losses of the roughest stamps again beside the fitted clock; tell of changes.

        The levels that steps are found in were freed of drift piece by piece, and wander by that:
        a count can be off by one. Beside the fitted clock what is wrong with a count stays as a
        step, read off two lines of one slope through short blocks on either side.

        """
        if self.scale < BRIEF or not len(self.gaps):
            return False
        count = self.n // BRIEF
        rows = self._residual(self.period)[:count * BRIEF].reshape(count, BRIEF)
        level = (rows.min(axis=1) if self.low else row_medians(rows)) / self.period
        near = self.scale // BRIEF + 1      # the place of a loss is known no better
        block = self.gaps // BRIEF
        edges = np.sort(np.r_[-near, block, self.steps[:, 0] // BRIEF, count + near]).astype(int)
        change = np.zeros(len(block), np.int64)
        for i, b in enumerate(block.tolist()):
            last, after = edges[edges < b].max(initial=-near), edges[edges > b].min()
            low, high = max(b - WIDE, last) + near, min(b + WIDE, after) - near
            x = np.r_[low:b - near, b + near + 1:high]
            if min(np.sum(x < b), np.sum(x > b)) >= NEAR:
                change[i] = round(_step(x - b, level[x]))
        # what is off by more was no matter of counting
        change[(self.lost + change < self.resolvable) | (np.abs(change) > 2)] = 0
        self.lost = self.lost + change
        return bool(change.any())

    def _middle(self, count: int, length: int) -> np.ndarray:
        """Return the places of the middles of blocks on the even clock."""
        at = (np.arange(count) + 0.5) * length - 0.5
        lost = np.append(0, np.cumsum(self.lost))
        return at + lost[np.searchsorted(self.gaps, at)]

    def jitter(self) -> float:
        """Return the scatter of single stamps about their neighbours' clock, s."""
        rest = self._residual(self.period)
        length = min(self.n, max(32, 2 * self.scale))
        count = self.n // length
        rows = rest[:count * length].reshape(count, length)
        return middle_sigma(np.ravel(rows - row_medians(rows)[:, None]))


def _regular(at: np.ndarray, n: int) -> np.ndarray:
    """
    Return which of some events among n samples follow each other at even distances, (e,) bool.

    None where they are too few to tell, or where chance makes such a train.

    """
    none = np.zeros(len(at), bool)
    if len(at) < 4:
        return none
    apart = np.diff(at)
    if np.std(apart) < 0.1 * np.mean(apart):
        return ~none
    best = none
    for skip in (1, 2, 3):
        for distance in np.unique(at[skip:] - at[:-skip])[:400].tolist():
            slack = 0.003 * distance + 2
            chance = len(at) * (1 - np.exp(-2 * (2 * slack + 1) * len(at) / n))
            if chance > 0.3 * len(at):
                continue
            member = none.copy()
            for way in (-distance, distance):
                near = np.minimum(np.searchsorted(at, at + way - slack), len(at) - 1)
                member |= np.abs(at[near] - at - way) <= slack
            found = np.sum(member)
            if found > max(np.sum(best), 5, 0.8 * (n / distance - 1), chance + 8 * chance**0.5):
                best = member
    return best


def _reach(late: np.ndarray) -> np.ndarray:
    """Return after how many samples an interval of so many periods has been caught up."""
    return 2 * NEAR + 4 * np.minimum(late, 4 * MANY).astype(np.int64)


def _scatter(x: np.ndarray) -> float:
    """Return the standard deviation of x if its middle four fifths are normal."""
    return float(quantile_sigma(x, 0.8)) if len(x) else np.inf


def _median(levels: np.ndarray, index: np.ndarray, there: np.ndarray) -> np.ndarray:
    """Return the median of some of the levels for every row of indices, (c,)."""
    values = levels[np.clip(index, 0, len(levels) - 1)]
    return np.nanmedian(np.where(there, values, np.nan), axis=1)


def _step(x: np.ndarray, y: np.ndarray) -> float:
    """Return the step at 0 between two lines of one slope that outliers do not turn."""
    return float(_robust(np.column_stack([np.ones(len(x)), x, x > 0]), y)[0][2])


def _line(x: np.ndarray, y: np.ndarray) -> tuple[float, np.ndarray]:
    """Return slope and residuals of a line that outliers do not turn."""
    if len(x) < 2:
        return 0.0, np.zeros(len(x))
    values, rest = _robust(np.column_stack([np.ones(len(x)), x - np.mean(x)]), y)
    return float(values[1]), rest


def _robust(columns: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the values (p,) of columns (n, p) by Huber's weights, and what they leave (n,)."""
    weight = np.ones(len(y))
    for _ in range(10):
        values = np.linalg.lstsq(columns * weight[:, None], y * weight, rcond=None)[0]
        rest = y - columns @ values
        scale = median_sigma(rest)
        if not scale > 0:
            break
        weight = np.sqrt(np.minimum(1.0, 1.5 * scale / np.maximum(np.abs(rest), 1e-300)))
    return values, rest
