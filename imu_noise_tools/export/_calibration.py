# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A calibration as other programs hold it: raw = S x + b, cut into a triangle and a rotation."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..core.errors import InputError
from ..core.files import plain_yaml

FILE = 'calibration.yaml'


@dataclass(frozen=True)
class Inverse:
    """
    Scale and cross-axis matrices S (3, 3) and biases b (3,) by sensor, as far as known.

    Programs hold a triangular matrix and choose the frame so that it fits. ``frame`` (3, 3) turns
    the body into that frame, which is the accelerometer's: ``S_accel = L frame`` with L lower
    triangular.

    """

    path: str
    S: dict[str, np.ndarray]
    bias: dict[str, np.ndarray]

    @property
    def frame(self) -> np.ndarray:
        """The rotation into the accelerometer's frame."""
        return lower(self.S['accel'])[1] if 'accel' in self.S else np.eye(3)

    def matrix(self, sensor: str) -> np.ndarray:
        """Return S from that frame to the outputs; the identity where it is not known."""
        return self.S.get(sensor, self.frame) @ self.frame.T

    def offset(self, sensor: str) -> np.ndarray:
        """Return b in units of the output; zero where it is not known."""
        return self.bias.get(sensor, np.zeros(3))

    @property
    def said(self) -> str:
        """What is from where, for a comment."""
        turned = np.degrees(np.arccos(np.clip((np.trace(self.frame) - 1) / 2, -1, 1)))
        return (f'Scale, cross-axis and bias of {" and ".join(sorted(self.S))} are from '
                f'{self.path}; its frame is turned by {turned:.3g} deg so that the '
                "accelerometer's matrix is triangular.")


def lower(s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (L, R) with s = L R, L lower triangular with a positive diagonal, R a rotation."""
    q, r = np.linalg.qr(s.T)
    signs = np.sign(np.diag(r))
    return (r.T * signs), (q * signs).T


def read(folder: str | Path) -> Inverse:
    """
    Return the calibration of a folder that calibrate wrote.

    Raises
    ------
    InputError
        There is none, or it is damaged.

    """
    path = Path(folder)
    path = path / FILE if path.is_dir() or path.suffix not in ('.yaml', '.yml') else path
    if not path.is_file():
        raise InputError(f'{folder}: no {FILE} in it', 'name a folder that calibrate wrote')
    try:
        data = plain_yaml(path.read_text(encoding='utf-8'))
        parts = {data['sensor']: data} if 'sensor' in data else {
            s: data[s] for s in ('accel', 'gyro') if s in data}
        S = {s: np.array(d['S'], float).reshape(3, 3) for s, d in parts.items()}
        bias = {s: np.array(d['bias'], float).reshape(3) for s, d in parts.items()}
    except (KeyError, TypeError, ValueError, OSError):
        S = bias = {}
    good = all(np.isfinite(x).all() for x in (*S.values(), *bias.values()))
    good = good and set(S) <= {'accel', 'gyro'}
    if not S or not good or min(abs(np.linalg.det(x)) for x in S.values()) < 1e-12:
        raise InputError(f'{path}: not a calibration that can be used', 'calibrate again')
    return Inverse(str(folder), S, bias)
