# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The streams of a node: one of both sensors, or one of each that has a topic of its own."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from .live import Curve, Stream
from ..core.record import AXES, ImuRecord

SENSORS = ('gyro', 'accel')


class Streams:
    """
    What a node received, by the sensor that it is of.

    Samples that hold both sensors fill the stream ``''``; those of a sensor that is sampled at its
    own times fill that of the sensor. What comes in one way replaces what came in the other.

    Parameters
    ----------
    hours : float
        How much each stream holds (:class:`~imu_noise_tools.nodes.live.Stream`).

    ``refused`` counts what could not be read; ``expected`` is how many samples there should be,
    where that is known; ``frame_id`` is that of the last sample that has one.

    """

    def __init__(self, hours: float):
        self._hours = hours
        self.frame_id = ''
        self.expected: int | None = None
        self.clear()

    def clear(self) -> None:
        """Forget everything."""
        self.refused = 0
        self._of = {'': Stream(self._hours)}

    def add(self, stamps: np.ndarray, gyro: np.ndarray, accel: np.ndarray,
            first: int | None = None, sensor: str = '', **more: Any) -> str:
        """
        Take samples of both sensors or of the one that is named; return what is worth saying.

        Shapes, units and ``more`` as those of :meth:`Stream.add`; ``first`` counts within the
        sensor.

        """
        if not len(stamps):
            return ''
        said = ''
        if (sensor == '') != ('' in self._of):
            said = 'one topic for both sensors' if not sensor else 'a topic for each sensor'
            said = f'{said} now; what was gathered before is dropped' if self.received else ''
            self._of = {s: Stream(self._hours) for s in (SENSORS if sensor else ('',))}
        if sensor:
            nothing = np.full((len(stamps), 3), np.nan)
            gyro, accel = (gyro, nothing) if sensor == 'gyro' else (nothing, accel)
        return self._of[sensor].add(stamps, gyro, accel, first, **more) or said

    @property
    def _filled(self) -> list[Stream]:
        """Those that hold something; the first where none does."""
        streams = list(self._of.values())
        return [s for s in streams if s.received] or streams[:1]

    @property
    def received(self) -> int:
        """How many samples came."""
        return sum(s.received for s in self._of.values())

    @property
    def missed(self) -> int:
        """How many did not."""
        return sum(s.missed for s in self._of.values())

    @property
    def mixed(self) -> bool:
        """Whether samples of several sources came as those of one."""
        return any(s.mixed for s in self._of.values())

    @property
    def not_finite(self) -> int:
        """How many came that are no numbers."""
        return sum(s.not_finite for s in self._of.values())

    @property
    def standing(self) -> str:
        """What to say where the stamps of one do not advance, else nothing."""
        return next((s.standing for s in self._of.values() if s.standing), '')

    @property
    def held(self) -> int:
        """How many are held."""
        return sum(s.held for s in self._of.values())

    @property
    def complete(self) -> bool:
        """Whether all that should have come has come, and is held; nothing is never complete."""
        enough = self.expected is None or self.received >= self.expected
        return enough and all(s.complete for s in self._filled)

    @property
    def rate_hz(self) -> float | None:
        """Return the rate of the gyroscope, else of what there is; None where it is not known."""
        return self._filled[0].rate_hz

    def curves(self) -> Iterator[tuple[str, int, float, Curve]]:
        """Yield axis, its column in the curve, time between two samples (s), and the curve."""
        for sensor, stream in self._of.items():
            curve, dt = stream.curve(), 1.0 / (stream.rate_hz or 1.0)
            for k, axis in enumerate(AXES):
                if axis.startswith(sensor):
                    yield axis, k, dt, curve

    def arrays(self) -> dict[str, dict[str, np.ndarray]]:
        """Return what is held, by the sensor that it is of: t (n,) s, gyro and accel (n, 3)."""
        out = {}
        for sensor, stream in self._of.items():
            stamps, gyro, accel = stream.samples()
            both = {'gyro': gyro, 'accel': accel}
            out[sensor] = {'t': (stamps - stamps[:1]) * 1e-9,
                           **({sensor: both[sensor]} if sensor else both)}
        return out

    def record(self, topic: str, path: str = '', frame_id: str = '') -> ImuRecord:
        """
        Return what is held, as a bag opened ``apart`` gives it.

        Raises
        ------
        InputError
            Nothing was received, or neither its stamps nor arrivals advance.

        """
        streams = self._filled
        topics = topic.split(',') if topic.count(',') + 1 == len(streams) else [topic] * 2
        first, *others = (s.record(t, path, frame_id) for s, t in zip(streams, topics))
        return replace(first, beside=tuple(others))
