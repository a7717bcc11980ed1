# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What stamps say of a stream: intervals, duplicates, gaps, jumps backward.

The same rules live and recorded.

"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

GRID = 0.05            # intervals are rounded to steps of 5 %: jitter is the clock's, not motion
DUPLICATE = -10 ** 6   # the key of an interval of zero
RESTART = 10 ** 6      # the key of a sample that nothing is known before


@dataclass(frozen=True)
class Clock:
    """
    The rules.

    ``interval`` is the nominal one, s; after ``gap`` s without a sample the filter starts again.

    """

    interval: float
    gap: float

    @classmethod
    def of(cls, rate_hz: float) -> Clock:
        """Return the rules for a rate: a gap is a second, or ten intervals if longer."""
        return cls(1 / rate_hz, max(1.0, 10 / rate_hz))

    def keys(self, dt: np.ndarray) -> np.ndarray:
        """
        Return for intervals dt (s) which step of the grid they are.

        DUPLICATE (0) or RESTART (a gap, backward).

        """
        dt = np.asarray(dt, float)
        with np.errstate(divide='ignore', invalid='ignore'):
            k = np.round(np.log(np.maximum(dt, 1e-9) / self.interval) / GRID)
        return np.where(
            (dt < 0) | (dt > self.gap), RESTART, np.where(dt == 0, DUPLICATE, k)
        ).astype(np.int64)

    def key(self, dt: float) -> int:
        """Return the key of one interval."""
        if dt < 0 or dt > self.gap:
            return RESTART
        if dt == 0:
            return DUPLICATE
        return int(round(float(np.log(max(dt, 1e-9) / self.interval)) / GRID))

    def samples(self, delay: float) -> int:
        """Return how many samples a delay, s, is: at least one where there is a delay."""
        return max(1, int(round(delay / self.interval))) if delay > 0 else 0

    def span(self, key: int) -> float:
        """Return the interval, s, that a key stands for."""
        return 0.0 if key == DUPLICATE else self.interval * float(np.exp(GRID * key))
