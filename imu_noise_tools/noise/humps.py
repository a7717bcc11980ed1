# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Humps of a spectrum that are too narrow for the usual bins, and the bins that resolve them."""

from __future__ import annotations

import numpy as np

from .lines import line_penalty, PIECE

MOST_HUMPS = 8  # of an axis
MOST_RESOLVED = 16  # of all axes


def find_humps(c: np.ndarray, level: np.ndarray, dt: float) -> np.ndarray:
    """
    Return (h, 3): frequency, width and nats of what is too narrow for the usual bins.

    The windows, from 4 coefficients to a 64th of the record, whose power stands highest above the
    smooth spectrum.

    Parameters
    ----------
    c : ndarray (n,)
        Cosine coefficients, coherent lines taken out.
    level : ndarray (n - 1,)
        Smooth one-sided PSD at each coefficient k >= 1.
    dt : float
        Interval, s.

    """
    n = len(c)
    total = np.zeros((n - 1) // 2 + 1)      # of pairs of coefficients
    for i in range(1, len(total), PIECE):
        j = min(i + PIECE, len(total))
        ratio = 2 * dt * c[2 * i - 1:2 * j - 1] ** 2 / level[2 * i - 2:2 * j - 2]
        total[i:j] = ratio[::2] + ratio[1::2]
    np.cumsum(total, out=total)
    found, width = [], 4
    while width <= max(n // 64, 8):
        half, step = width // 2, max(1, width // 4)
        x = (total[half::step] - total[:-half:step]) / width
        # ln x < x - 1: what is lower than this has too few nats
        some = np.flatnonzero(x > 1 + np.sqrt(2 * line_penalty(n) / width))
        x, at = x[some], some * step * 2 + half + 1
        nats = 0.5 * width * (x - 1 - np.log(x))
        nats[(at < 16) | (at > n - 16)] = 0.0
        best = np.argsort(-nats)[:1000]
        found += [(nats[i], int(at[i]), width) for i in best if nats[i] > line_penalty(n)]
        width *= 2
    out: list[tuple[float, float, float]] = []
    taken: list[tuple[int, int]] = []
    for gain, k, width in sorted(found, reverse=True):
        if len(out) == MOST_HUMPS:
            break
        if all(k + width < low or k - width > high for low, high in taken):
            out.append((k / (2 * n * dt), width / (4 * n * dt), gain))
            taken.append(_extent(total, k, width))
    return np.array(out).reshape(-1, 3)


def _extent(total: np.ndarray, k: int, width: int) -> tuple[int, int]:
    """Return [low, high) of the coefficients where the power of a hump stands above the level."""
    step, ends = max(width // 2, 1), []
    for sign in (-1, 1):
        i = k // 2 + sign * step
        while 0 <= i and i + step < len(total) \
                and total[i + step] - total[i] > 2 * step * (1 + 2 / np.sqrt(step)):
            i += sign * step
        ends.append(2 * i)
    return ends[0], ends[1] + 2 * step


def fine_edges(humps: np.ndarray) -> tuple[float, ...]:
    """
    Return edges (Hz) of bins that resolve the humps (h, 3) of all axes, closest at their middle.

    One that several axes show is resolved once, the clearest of it.

    """
    reach = np.array([0.15, 0.4, 0.7, 1.1, 1.7, 2.8, 4.5, 8.0])
    offsets = np.concatenate([-reach, reach])
    chosen: list[tuple[float, float]] = []
    for f, width, _ in sorted(humps.tolist(), key=lambda h: -h[2]):
        if all(abs(f - g) > 0.5 * (width + w) or not 0.3 < width / w < 3 for g, w in chosen):
            chosen.append((f, width))
    edges = [f + width * x for f, width in chosen[:MOST_RESOLVED] for x in offsets]
    return tuple(sorted(float(x) for x in edges))
