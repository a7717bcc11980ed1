# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a calibration is made from: mean outputs at known inputs, one column a pose."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

FACES = ('+x', '-x', '+y', '-y', '+z', '-z')
DIRECTIONS = {face: sign * np.eye(3)['xyz'.index(axis)]
              for face in FACES for sign, axis in [(1.0 if face[0] == '+' else -1.0, face[1])]}


@dataclass(frozen=True)
class Poses:
    """
    Poses of one sensor, n columns.

    Parameters
    ----------
    sensor : str
        ``accel`` or ``gyro``.
    outputs : ndarray (3, n)
        Mean output of each pose, m/s^2 or rad/s (or counts); for a turn through an angle its
        integral, rad.
    std : ndarray (3, n)
        Standard error of these means from the noise within the pose.
    inputs : ndarray (3, n)
        Known input in the body frame; nan where only its magnitude is known.
    magnitude : float
        Size of the input by which the regressor is scaled: gravity, or the largest turn.
    amount : ndarray (n,)
        What the bias is multiplied by: 1 for a mean, the duration in s for an integral.
    force : ndarray (3, n)
        Specific force during the pose, m/s^2, body frame (gyro only); nan where unknown.
    temperature : ndarray (n,)
        Degrees Celsius; nan where unknown.
    reference_temperature : float
        Temperature at which scale and bias are stated.
    time : ndarray (n,)
        Middle of the pose, s since the start of the record.
    names : tuple of str
        ``+x`` for a face, ``pose 7``, ``turn +z``.

    """

    sensor: str
    outputs: np.ndarray
    std: np.ndarray
    inputs: np.ndarray
    magnitude: float
    amount: np.ndarray
    force: np.ndarray
    temperature: np.ndarray
    reference_temperature: float
    time: np.ndarray
    names: tuple[str, ...]

    @classmethod
    def of(
        cls,
        sensor: str,
        outputs: Any,
        std: Any,
        magnitude: float,
        inputs: Any = None,
        amount: Any = None,
        force: Any = None,
        temperature: Any = None,
        reference_temperature: float | None = None,
        time: Any = None,
        names: Iterable[str] | None = None,
    ) -> Poses:
        """Return poses, what is not given filled in: unknown inputs, means, in this order."""
        outputs = np.atleast_2d(np.asarray(outputs, float))
        n = outputs.shape[1]
        temperature = np.full(n, np.nan) if temperature is None else np.asarray(temperature, float)
        if reference_temperature is None:
            known = temperature[np.isfinite(temperature)]
            reference_temperature = float(np.round(known.mean(), 1)) if known.size else 25.0
        unknown = np.full((3, n), np.nan)
        return cls(
            sensor, outputs, np.broadcast_to(np.asarray(std, float), outputs.shape).copy(),
            unknown if inputs is None else np.asarray(inputs, float), float(magnitude),
            np.ones(n) if amount is None else np.asarray(amount, float),
            unknown if force is None else np.asarray(force, float), temperature,
            reference_temperature,
            np.arange(n, dtype=float) if time is None else np.asarray(time, float),
            tuple(names) if names is not None else tuple(f'pose {k + 1}' for k in range(n)))

    @property
    def n(self) -> int:
        """Number of poses."""
        return self.outputs.shape[1]

    @property
    def known(self) -> bool:
        """Whether every input is known, not only its magnitude."""
        return bool(np.isfinite(self.inputs).all())

    @property
    def rates(self) -> np.ndarray:
        """Mean input of each pose, (3, n): the input itself, or angle over duration."""
        return self.inputs / self.amount

    def take(self, index: Any) -> Poses:
        """Return some of the poses."""
        index = np.atleast_1d(index)
        return replace(self, names=tuple(self.names[k] for k in index),
                       **{name: getattr(self, name)[..., index] for name in _PER_POSE})

    def without(self, k: int) -> Poses:
        """Return all poses but one."""
        return self.take(np.delete(np.arange(self.n), k))

    def with_inputs(self, inputs: Any) -> Poses:
        """Return the poses with these inputs, (3, n)."""
        return replace(self, inputs=np.asarray(inputs, float))

    def directed(self, scale: np.ndarray, rest: np.ndarray) -> Poses:
        """Return the poses as directed as S (3, 3) sees them in the outputs less (3, n)."""
        return self.with_inputs(
            self.magnitude * unit(np.linalg.solve(scale, self.outputs - rest)))

    def to_arrays(self) -> dict[str, np.ndarray]:
        """Return all fields as plain arrays by name, for an npz file; shapes as above."""
        return {f.name: np.asarray(getattr(self, f.name)) for f in fields(self)}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Any]) -> Poses:
        """Return the poses that :meth:`to_arrays` wrote."""
        return cls(sensor=str(arrays['sensor']), names=tuple(str(n) for n in arrays['names']),
                   magnitude=float(arrays['magnitude']),
                   reference_temperature=float(arrays['reference_temperature']),
                   **{name: np.array(arrays[name], float) for name in _PER_POSE})


_PER_POSE = ('outputs', 'std', 'inputs', 'amount', 'force', 'temperature', 'time')


def joined(parts: Sequence[Poses]) -> Poses:
    """Return poses of several records as one, scaled and referred as the first."""
    first = parts[0]
    together: dict[str, Any] = {
        name: np.concatenate([getattr(p, name) for p in parts], axis=-1) for name in _PER_POSE}
    return replace(first, names=tuple(n for p in parts for n in p.names), **together)


def unit(vectors: np.ndarray) -> np.ndarray:
    """Return vectors (3, n) scaled to length one, (3, n); a column of zeros stays."""
    length = np.linalg.norm(vectors, axis=0)
    return vectors / np.where(length > 0, length, 1.0)


def aims(names: Sequence[str]) -> np.ndarray:
    """Return the nominal direction of each pose by its name, (3, n); nan where it is no face."""
    none = np.full(3, np.nan)
    return np.array([DIRECTIONS.get(n, none) for n in names]).reshape(-1, 3).T


def angle_deg(a: np.ndarray, b: np.ndarray) -> float:
    """Return the angle between two vectors (3,), degrees."""
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))


def nearest_face(direction: np.ndarray) -> tuple[str, float]:
    """Return the face nearest to a direction (3,), and the angle between them in degrees."""
    direction = np.asarray(direction, float)
    k = int(np.argmax(np.abs(direction)))
    cosine = abs(direction[k]) / np.linalg.norm(direction)
    return ('-+'[int(direction[k] > 0)] + 'xyz'[k]), float(np.degrees(np.arccos(min(1.0, cosine))))
