# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which part of a record somebody wants to be analysed, and what of it not."""

from __future__ import annotations

from dataclasses import dataclass
import math

import numpy as np

from ..core.errors import UsageError
from ..core.record import ImuRecord

HOW = 'give seconds (12.5) or per cent of the record (10%)'
HOW_MASK = 'give stretches in seconds from its beginning, e.g. 10-12.5,300-310'


@dataclass(frozen=True)
class Time:
    """A length of time: s, or a share of the record."""

    value: float
    share: bool

    def seconds(self, whole: float) -> float:
        """Return it in seconds, for a record of so many."""
        return self.value * whole if self.share else self.value


@dataclass(frozen=True)
class Selection:
    """
    A part of a record.

    Parameters
    ----------
    start, duration : Time or None
        From when and how long; None: from the beginning, to the end.
    masks : tuple of (float, float)
        Stretches to set aside, s from the beginning of the record.
    screen : bool
        Whether disturbed stretches are set aside as well.

    """

    start: Time | None = None
    duration: Time | None = None
    masks: tuple[tuple[float, float], ...] = ()
    screen: bool = True

    @classmethod
    def of(
        cls, start: str = '', duration: str = '', mask: str = '', screen: bool = True
    ) -> Selection:
        """Return what is meant by texts as typed; raise UsageError where they make no sense."""
        return cls(
            _time('--start', start) if start else None,
            _time('--duration', duration, least=1e-9) if duration else None,
            _masks(mask) if mask else (),
            screen,
        )

    def part(self, record: ImuRecord) -> ImuRecord:
        """
        Return the part of a record between start and start + duration.

        Raises
        ------
        UsageError
            It begins after the end of the record.

        """
        if self.start is None and self.duration is None:
            return record
        a, b = self.bounds(record)
        begin = record.t[a] - np.nanmin(record.t) if b > a else 0.0
        part = record.part(a, b)
        return part.warned(f'{part.duration_s:.6g} s from {begin:.6g} s on were chosen')

    def bounds(self, record: ImuRecord) -> tuple[int, int]:
        """Return from and to which sample the part goes; raises as :meth:`part`."""
        if self.start is None and self.duration is None:
            return 0, record.n
        good = record.t[np.isfinite(record.t)]
        first, last = (float(good.min()), float(good.max())) if len(good) else (0.0, 0.0)
        begin = first + (self.start.seconds(last - first) if self.start else 0.0)
        end = begin + self.duration.seconds(last - first) if self.duration else math.inf
        if begin >= last:
            raise UsageError(
                f'--start is past the end: the recording lasts {last - first:.6g} s', HOW
            )
        inside = np.flatnonzero((record.t >= begin) & (record.t <= end))
        return (int(inside[0]), int(inside[-1]) + 1) if len(inside) else (0, 0)


def _time(option: str, text: str, least: float = 0.0) -> Time:
    """Return a length of time as typed: seconds, or per cent."""
    share = str(text).strip().endswith('%')
    try:
        value = float(str(text).strip().removesuffix('%'))
    except ValueError:
        value = math.nan
    if not least <= value < math.inf or share and value > 100:
        raise UsageError(f'invalid {option} {text}', HOW)
    return Time(value / 100 if share else value, share)


def _masks(text: str) -> tuple[tuple[float, float], ...]:
    """Return stretches as typed: ``T0-T1,T0-T1``, s."""
    out = []
    for piece in text.split(','):
        try:
            begin, end = (float(x) for x in piece.split('-'))
        except ValueError:
            begin = end = math.nan
        if not 0 <= begin < end < math.inf:
            raise UsageError(f'invalid --mask {text}', HOW_MASK)
        out.append((begin, end))
    return tuple(out)
