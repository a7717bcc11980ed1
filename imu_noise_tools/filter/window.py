# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Answers that wait for later samples: the smoother over the latest stretch of a stream.

Each moment is answered when a number of others have followed. The way back over them is gone once
for the older half: so a sample costs two steps of it however long the delay is, and an answer
knows all later samples of half of the delay, or more.

"""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np

from .imm import Bank, Entries
from .smoother import at_once, keep, Kept, look_back


class Window:
    """The latest moments of a bank; ``length`` later ones are waited for."""

    def __init__(self, bank: Bank, length: int):
        self.bank, self.length = bank, length
        self._kept: list[Kept] = []
        self._ready: deque[tuple] = deque()

    def __len__(self) -> int:
        """Return how many moments wait."""
        return len(self._ready) + len(self._kept)

    def add(self, z: np.ndarray, e: Entries, begins: Any = None) -> tuple | None:
        """
        Take the bank as it is after samples z (lanes,), by the entries of the interval before.

        Return (rate, variance), (lanes,) each, of the moment ``length`` before; None at first.

        """
        self._kept.append(keep(self.bank, z, e, begins))
        if len(self) <= self.length:
            return None
        if not self._ready:
            self._answer(max(1, self.length // 2))
        return self._ready.popleft()

    def rest(self) -> list[tuple]:
        """Return what is still to come, by the samples there are; nothing waits then."""
        self._answer(len(self._kept))
        out = list(self._ready)
        self._ready.clear()
        return out

    def _answer(self, count: int) -> None:
        """Answer the oldest moments."""
        if count:
            answers, _ = look_back(self.bank, self._kept)
            answers.append(at_once(self.bank, self._kept[-1]))
            self._ready.extend(answers[:count])
            del self._kept[:count]
