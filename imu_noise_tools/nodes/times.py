# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The time of each message of a stream: its stamp, or its arrival where stamps stand still."""

from __future__ import annotations

STANDING, REMEDY = 'the stamps do not advance', 'stamp the messages in the driver'
ARRIVALS = f'{STANDING}; the receive times are used; {REMEDY}'
_MESSAGES, _NS = 16, 100_000_000    # fewer, or sooner, is a burst of a driver that reads a buffer


class Times:
    """
    Times of messages in the order they came, from the first, ns.

    Stamps that are zero or constant say nothing of the intervals. Once 16 rates that differ have
    come with one stamp, over 0.1 s, the intervals are those of the arrivals, until stamps move
    again; ``standing`` says that it is so. Copies of a message do not count: they bear its stamp.

    """

    def __init__(self) -> None:
        self.standing = False
        self._time = self._same = self._since = 0
        self._last: tuple[int, int, object] | None = None

    def of(self, stamp: int, arrival: int, rate: object) -> int:
        """Return the time, ns, of a message with this stamp and arrival (ns, any clocks)."""
        if self._last is None:
            self._last, self._since = (stamp, arrival, rate), arrival
            return self._time
        stamp_before, arrival_before, rate_before = self._last
        self._last = stamp, arrival, rate
        standing = self.standing
        if stamp != stamp_before:
            self._same, self._since, self.standing = 0, arrival, False
        else:
            self._same += rate != rate_before
            self.standing |= self._same >= _MESSAGES and arrival - self._since >= _NS
        arrivals = standing or self.standing
        self._time += arrival - arrival_before if arrivals else stamp - stamp_before
        return self._time
