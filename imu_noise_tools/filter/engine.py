# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The filter on line: one message in, one estimate out.

Every flaw of a real stream handled, switching while it runs.

"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .design import AUTO, Design, design, memory, quiet_variance
from .imm import Bank, Coefficients
from .stamps import Clock, DUPLICATE, RESTART
from .window import Window
from ..core.clock import median_rate

WAIT = 16               # samples passed through while rate and noise are found out
REPLAY = 100            # samples a new model is run over before it takes over
BLEND = 0.25            # s within which the difference of old and new model dies out
READ_AGAIN = 4096       # samples between later readings of an unstated R


@dataclass
class Counts:
    """What a stream has shown so far."""

    samples: int = 0
    refused: int = 0
    duplicates: int = 0
    gaps: int = 0
    resets: int = 0
    switches: int = 0


@dataclass
class History:
    """A ring of the last samples and innovations: what a diagnosis while running looks at."""

    size: int
    axes: int
    t: np.ndarray = field(init=False)
    z: np.ndarray = field(init=False)
    score: np.ndarray = field(init=False)
    count: int = 0

    def __post_init__(self):
        """Make room."""
        self.t = np.zeros(self.size)
        self.z = np.zeros((self.size, self.axes))
        self.score = np.full((self.size, self.axes), np.nan)

    def append(self, t: float, z: np.ndarray) -> None:
        """Keep a sample z (axes,), rad/s, at t (s); its score is set later."""
        at = self.count % self.size
        self.t[at], self.z[at], self.score[at] = t, z, np.nan
        self.count += 1

    def mark(self, score: np.ndarray) -> None:
        """Set the score of the newest sample, (axes,), standard deviations."""
        self.score[(self.count - 1) % self.size] = score

    def latest(self, n: int | None = None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return (t, z, score) of the last n samples, oldest first."""
        n = min(self.count, self.size if n is None else min(n, self.size))
        at = np.arange(self.count - n, self.count) % self.size
        return self.t[at], self.z[at], self.score[at]

    def clear(self) -> None:
        """Forget all."""
        self.count = 0


def designed(delay: float = 0.0, **settings: Any) -> Design:
    """Return the design of an engine's settings, or refuse them: UsageError."""
    made = design(**settings)
    memory(made, False, delay)
    return made


class Engine:
    """
    A filter of three rates, message by message.

    Parameters
    ----------
    motion, noise, alpha, values
        As in :func:`imu_noise_tools.filter.design.design`; motion 'auto' is the default bank.
    rate_hz : float or None
        Nominal rate; by default read from the first 16 stamps, during which samples pass
        unfiltered.
    delay : float
        For how long, s, an answer waits for the samples after it; :meth:`due` then returns it.
    history : int
        Samples kept for a diagnosis.

    Rules (stamps in s): the interval is that of the stamps; a sample with the stamp of the one
    before is weighed in without a prediction (an exact copy is not weighed again); after a gap (1
    s, or ten intervals) or a jump backward the filter starts again; a sample that is not finite is
    refused and counted. Nothing waits over a gap, a jump backward or a change of the model.

    """

    def __init__(self, motion: Any = AUTO, noise: Any = ('white',), alpha: float = 1.0,
                 rate_hz: float | None = None, values: Any = None, history: int = 32768,
                 axes: int = 3, delay: float = 0.0):
        self.axes = axes
        self.counts = Counts()
        self._clock: Clock              # once the rate is known
        self._bank: Bank                # once R is known too
        self.history = History(history, axes)
        self._rate = rate_hz
        self._settings = {'motion': motion, 'noise': noise, 'alpha': alpha, 'values': values,
                          'delay': delay}
        self._given = designed(**self._settings, axes=axes)
        self._begin()

    def _begin(self):
        self.design: Design = self._given
        self._clocked = bool(self._rate)
        if self._rate:
            self._clock = Clock.of(self._rate)
        self._ready = self._clocked and not self.design.unknown_r
        self._last = None
        self._last_z = np.zeros(self.axes)
        self._answer = None
        self._due: list[tuple] = []
        self._window: Window | None = None
        self._copies: deque[int] = deque()      # messages with the answer of each that waits
        self._blend = None
        self._read_at = READ_AGAIN
        if self._ready:
            self._build()

    def _build(self):
        """Make the bank for the nominal interval; others are added as they come."""
        self._entries: dict = {}
        self._bank = Bank(
            Coefficients([self.design.modes(self._clock.interval)], self.design.alpha), self.axes
        )
        self._entries[0] = self._bank.table.at(0)
        length = self._clock.samples(self._settings['delay'])
        self._window = Window(self._bank, length) if length else None

    def reset(self) -> None:
        """Forget the stream, keep the settings."""
        self.history.clear()
        self.counts = Counts()
        self._begin()

    @property
    def rate_hz(self) -> float | None:
        """Nominal rate, once known."""
        return 1 / self._clock.interval if self._clocked else None

    def step(self, stamp_s: float, gyro: Any) -> tuple[np.ndarray, np.ndarray] | None:
        """
        Take one message; return (rate (3,), variance (3,)), or None where it is refused.

        By the samples so far; :meth:`due` says what the delay gives. A variance of 0 says that it
        is not known yet.

        """
        self._due = []
        z = np.array(gyro, float)
        if not (np.isfinite(z).all() and np.isfinite(stamp_s)):
            self.counts.refused += 1
            return None
        self.counts.samples += 1
        key = RESTART if self._last is None else self._sort(stamp_s)
        copy = key == DUPLICATE and np.array_equal(z, self._last_z)
        self._last, self._last_z = stamp_s, z
        if copy and self._answer is not None:
            if self._copies:
                self._copies[-1] += 1
            else:
                self._due.append(self._answer)
            return self._answer
        if key == RESTART:
            self.finish()
        self.history.append(stamp_s, z)
        if not self._ready:
            answer = self._wait(z)
            self._due.append(answer)
            return answer
        if self.design_reads_r and self.history.count >= self._read_at:
            self._read_again()
        x, var, score = self._advance(key, z)
        self.history.mark(score)
        self._answer = self._blended(stamp_s, x, var)
        if self._window is None:
            self._due.append(self._answer)
        else:
            self._copies.append(1)
            self._give(self._window.add(z, self._now))
        return self._answer

    def due(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """
        Return (rate, variance) of the messages whose delay is over, oldest first.

        Since the last step, with :meth:`finish` and :meth:`switch` after it; each once.

        """
        out, self._due = self._due, []
        return out

    def finish(self) -> None:
        """Let nothing wait any longer: what is left is due, by the samples there are."""
        for answer in self._window.rest() if self._window else ():
            self._give(answer)

    def _give(self, answer):
        if answer is not None:
            self._due += [answer] * self._copies.popleft()

    @property
    def design_reads_r(self) -> bool:
        """Whether the variance of the noise is read from the samples."""
        return self._given.unknown_r

    def _sort(self, stamp):
        """Return the key of the interval to this stamp, and count what is odd."""
        dt = stamp - self._last
        if dt == 0:
            self.counts.duplicates += 1
            return DUPLICATE
        if not self._clocked:
            return 0
        key = self._clock.key(dt)
        if key == RESTART:
            if dt < 0:
                self.counts.resets += 1
            else:
                self.counts.gaps += 1
        return key

    def _wait(self, z):
        """Pass a sample through until rate and noise can be read."""
        t, some, _ = self.history.latest()
        if self.history.count >= WAIT:
            rate = self._rate or median_rate(t)
            if rate:
                self._clock, self._clocked = Clock.of(rate), True
                if self.design.unknown_r:
                    self.design = self.design.with_r(quiet_variance(some))
                    self._read_at = 2 * self.history.count
                self._build()
                self._ready = True
                x, var, _ = self._replay(t, some)
                self._answer = x, var
                return self._answer
        return z.copy(), np.zeros(self.axes)

    def _replay(self, t, z):
        """Run the bank over samples from nothing known; return its last answer."""
        keys = self._clock.keys(np.diff(t))
        answer = self._advance(RESTART, z[0])
        for key, sample in zip(keys.tolist(), z[1:]):
            answer = self._advance(key, sample)
        return answer

    def _advance(self, key, z):
        """Carry the bank to a sample; return (rate, variance, normalised innovation)."""
        bank = self._bank
        if key == RESTART:
            bank.restart(slice(None))
            e = self._entries[0]
        else:
            e = self._entries.get(key)
            if e is None:
                e = self._entry(key)
            bank.mix(e)
            bank.predict(e)
        self._now = e
        nu, s, _ = bank.update(z, e)
        x, var = bank.rate()
        return x, var, bank.score(nu, s, e)

    def _entry(self, key):
        """Return the entries of an interval met for the first time."""
        usual, dt = self._clock.interval, self._clock.span(key)
        both = Coefficients([self.design.modes(usual), self.design.modes(dt)], self.design.alpha)
        if len(self._entries) > 512:
            self._entries = {0: self._entries[0]}
        self._entries[key] = both.at(1)
        return self._entries[key]

    def _read_again(self):
        """Read R anew from the latest samples; nothing else of the state changes."""
        self._read_at = self.history.count + min(self.history.count, READ_AGAIN)
        _, z, _ = self.history.latest(2048)
        self.design = self.design.with_r(quiet_variance(z))
        table = Coefficients([self.design.modes(self._clock.interval)], self.design.alpha)
        self._entries = {0: table.at(0)}
        bank = self._bank
        bank.table, bank.start = table, Bank(table, self.axes).start

    def switch(self, **settings: Any) -> None:
        """
        Change motion, noise, alpha, values or delay while running, without a jump in the output.

        The new model is run over the last samples and takes over at once; the difference to the
        old one's answer dies out within a quarter of a second, and counts as variance while it
        does.

        Raises
        ------
        UsageError
            As :func:`design`; the old model then stays.

        """
        new = {**self._settings, **settings}
        made = designed(**new, axes=self.axes)
        self.finish()
        self._settings, self._given = new, made
        self.counts.switches += 1
        if not self._ready:
            self.design = made
            return
        r = self.design.r
        self.design = made.with_r(r) if made.unknown_r and self.design_reads_r else made
        old = self._answer[0] if self._answer else None
        self._build()
        t, z, _ = self.history.latest(REPLAY)
        x, _, _ = self._replay(t, z)
        if old is not None:
            self._blend = self._last, old - x

    def _blended(self, stamp, x, var):
        if self._blend is None:
            return x, var
        since, offset = self._blend
        age = stamp - since
        if age < 0 or age > 20 * BLEND:
            self._blend = None
            return x, var
        left = offset * np.exp(-age / BLEND)
        return x + left, var + left ** 2
