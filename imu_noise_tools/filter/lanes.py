# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Chunks of a record side by side through a bank, each warmed up on what comes before it."""

from __future__ import annotations

from typing import Any

import numpy as np

from .design import Design
from .imm import Bank, Coefficients, Entries
from .stamps import Clock, RESTART

WARM_UP = 60.0         # s that a chunk starts ahead, for the bank to forget how it was started
LANES = 200            # chunks at once: more would spend their time on warming up, fewer on Python


class Layout:
    """
    Which samples each chunk takes: those it answers for, and those around that it warms up on.

    Parameters
    ----------
    n : int
        Samples of the record.
    interval : float
        Between them, s.
    beyond : int or None
        For how many samples the chunks go on past their own, for a pass backward; None: as long
        as they began before them, for it to forget how it was started.

    """

    def __init__(self, n: int, interval: float, beyond: int | None = 0):
        warm = int(round(WARM_UP / interval))
        size = max(-(-n // LANES), 4 * warm if n > 8 * warm else n)
        self.n = n
        self.first = np.arange(-(-n // size)) * size
        self.stop = np.minimum(self.first + size, n)
        self.begin = np.maximum(self.first - warm, 0)
        end = np.minimum(self.stop + (warm if beyond is None else beyond), n)
        self.steps = int(np.max(end - self.begin))

    def at(self, step: int) -> np.ndarray:
        """Return the place in the record of each chunk's sample of a step, (chunks,)."""
        return np.minimum(self.begin + step, self.n - 1)

    def over(self, step: int) -> np.ndarray:
        """Return which chunks are past the end of the record, (chunks,)."""
        return self.begin + step >= self.n

    def put(self, step: int, into: Any, answers: Any) -> None:
        """Write answers of (chunks * axes,) into arrays (n, axes) where the chunks answer."""
        at = self.begin + step
        valid = (at >= self.first) & (at < self.stop)
        if valid.any():
            for array, answer in zip(into, answers):
                array[at[valid]] = answer.reshape(len(at), -1)[valid]


class Lanes:
    """A bank that filters several chunks at once; ``keys`` are those of the whole record."""

    def __init__(self, keys: Any, design: Design, clock: Clock, chunks: int, axes: int):
        kinds, self.which = np.unique(np.where(keys == RESTART, 0, keys), return_inverse=True)
        self.table = Coefficients([design.modes(clock.span(int(k))) for k in kinds], design.alpha)
        self.common = [self.table.at(i).tiled(chunks) for i in range(len(kinds))]
        self.regular = len(kinds) == 1
        self.restart = keys == RESTART
        self.axes = axes
        self.bank = Bank(self.table, chunks * axes)

    def entries(self, at: np.ndarray) -> Entries:
        """Return the entries of the intervals before these places (chunks,) of the record."""
        now = self.which[at]
        same = self.regular or np.all(now == now[0])
        return self.common[now[0]] if same else self.table.at(now)

    def begins(self, at: np.ndarray, over: Any = False) -> np.ndarray | None:
        """
        Return which lanes know nothing before these places, (lanes,); None: all do.

        Those of the chunks that are ``over`` (chunks,) never do.

        """
        new = self.restart[at] | over
        return np.repeat(new, self.axes) if new.any() else None

    def step(self, samples: np.ndarray, at: np.ndarray, first: bool) -> Any:
        """Return (rate, variance, score) of one sample a lane, at these places of the record."""
        bank, e = self.bank, self.entries(at)
        if first:
            bank.restart(slice(None))
        else:
            bank.mix(e)
            bank.predict(e)
            begins = self.begins(at)
            if begins is not None:
                bank.restart(begins)
        nu, s, _ = bank.update(samples, e)
        return *bank.rate(), bank.score(nu, s, e)
