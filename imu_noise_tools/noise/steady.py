# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Whether a line is as strong and in phase in every stretch of a record.

The rival of a steady line is one whose two amplitudes are free in each of a few stretches: where
that takes away much more, something fades, wanders or is switched on, and a steady line is the
wrong form, however far its mean stands out.

"""

from __future__ import annotations

import numpy as np

from ..core.spectrum import line_basis, line_coefficients
from ..loop.verdict import FLEXIBLE

STRETCHES = 4


def unsteady(lines: np.ndarray, c: np.ndarray, reference: np.ndarray, dt: float, near: int,
             most: float) -> np.ndarray:
    """
    Tell of which lines amplitudes of their own in each stretch take away much more, (l,) bool.

    More than chance does, by as much as a smooth form must gain elsewhere, and more than a share
    of what the steady one takes: no machine is steady for ever.

    Parameters
    ----------
    lines : ndarray (l, 3)
        Frequency Hz, a, b of a cos + b sin, measured together.
    c : ndarray (n,)
        Cosine coefficients, the lines in them.
    reference : ndarray (n - 1,)
        Smooth one-sided PSD at each coefficient k >= 1.
    dt : float
        Interval, s.
    near : int
        Coefficients on either side of a line that are looked at.
    most : float
        That share.

    """
    n, out = len(c), np.zeros(len(lines), bool)
    at = 2 * n * dt * lines[:, 0]
    ends = np.linspace(0, n, STRETCHES + 1).astype(int)
    for i, line in enumerate(lines):
        k = np.arange(max(1, int(at[i]) - near), min(n, int(at[i]) + near + 1))
        root = np.sqrt(2 * dt / reference[k - 1])
        waves = [line_coefficients(f, a, b, k, n, dt) for f, a, b in lines]
        rest = c[k] - np.sum(waves, axis=0)
        beside = _columns(lines[np.abs(at - at[i]) < 2 * near], k, n, dt)
        own = [line_basis(line[0], k, n, dt, *ends[j:j + 2]) for j in range(STRETCHES - 1)]
        free = [x for wave in own for x in (wave.real, wave.imag)]
        gain = 0.5 * (_left(beside, rest, root) - _left([*beside, *free], rest, root))
        claim = 0.5 * float(np.sum((root * waves[i]) ** 2))
        out[i] = gain > max(FLEXIBLE, most * claim)
    return out


def _columns(lines: np.ndarray, k: np.ndarray, n: int, dt: float) -> list[np.ndarray]:
    """Return how coefficients k follow a, b and the frequency of each of some lines (l, 3)."""
    out: list[np.ndarray] = []
    step = 0.05 / (n * dt)
    for f, a, b in lines:
        up, wave, down = (line_basis(f + d * step, k, n, dt) for d in (1, 0, -1))
        slope = up - down
        out += [wave.real, wave.imag, a * slope.real + b * slope.imag]
    return out


def _left(columns: list[np.ndarray], y: np.ndarray, root: np.ndarray) -> float:
    """Return the squares that columns (k,) each leave of y (k,), weighed by root (k,) squared."""
    x = np.array(columns).T * root[:, None]
    x = x / np.maximum(np.sqrt(np.sum(x * x, axis=0)), 1e-300)
    beta = np.linalg.lstsq(x, y * root, rcond=1e-9)[0]
    return float(np.sum((y * root - x @ beta) ** 2))
