# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Noise whose samples are held now and then, each time for as many: what becomes of its spectrum.

At random some samples begin to be held, for so many each, which may overlap. What follows a fresh
sample does not depend on what was before it: the record is a row of blocks of one value each, of
independent lengths L (a renewal process).

"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

LONGEST = 50    # samples that are held at a time
MOST = 8 * LONGEST      # samples that one is repeated for, runs that overlap
RARE = 1e-4     # of the chance to repeat one sample, to repeat it once more that is left out
KEPT = 32   # sets of frequencies for which what is wanted again and again is kept
LEAST = 1e-9    # squared gain
ANGLES = (np.arange(256) + 0.5) / 256   # cubed, of Nyquist: a filter may end far below it


def begins(fraction: float, run: int) -> float:
    """Return the chance that a sample is the first of a run that is held, of the share held."""
    return 1 - (1 - fraction) ** (1 / run)


def ages(fraction: float, run: int) -> np.ndarray:
    """Return the chances (k,) that a sample is what was measured 0, 1, 2 ... samples before."""
    begin = begins(fraction, run)
    left = np.zeros(run)    # of those held, by how many of their run are still to come
    left[-1] = begin
    out = [begin]
    while out[-1] > RARE * begin and len(out) < MOST:
        left = np.append((1 - begin) * left[1:], begin * out[-1])
        out.append(float(np.sum(left)))
    return (1 - fraction) * np.append(1.0, out)


def coherent(fraction: float, run: int, f: ArrayLike, dt: float) -> np.ndarray:
    """Return the squared gain at f (Hz) on what is no noise: |sum_k P(age k) e^(-i w k)|^2."""
    at = np.asarray(f, float) * dt
    return _coherent(fraction, run, at.tobytes()).reshape(at.shape)


def scattered(fraction: float, run: int, gain2: np.ndarray, f: np.ndarray,
              dt: float) -> np.ndarray:
    """
    Return the level at f (Hz, (k,)) of what holding scatters of white noise behind a filter.

    Over :func:`coherent`, which passes it; ``gain2`` (m,) is the filter's at :data:`ANGLES` cubed,
    of Nyquist, or (m, n) of several.

    """
    return _spread(fraction, run, (np.asarray(f, float) * dt).tobytes()) @ gain2


@lru_cache(maxsize=KEPT)
def _coherent(fraction: float, run: int, f: bytes) -> np.ndarray:
    """Return :func:`coherent` at frequencies f (a sample), (k,), and no less than a little."""
    some = ages(fraction, run)
    turns = np.exp(-2j * np.pi * np.multiply.outer(np.frombuffer(f), np.arange(len(some))))
    return np.maximum(np.abs(turns @ some / np.sum(some)) ** 2, LEAST)


@lru_cache(maxsize=KEPT)
def _spread(fraction: float, run: int, f: bytes) -> np.ndarray:
    """
    Return what noise at each of the angles puts at frequencies f (a sample), (k, m), over A^2.

    A^2 that of :func:`coherent`. With w the one, u the other, v = w - u and D_L = (1 - e^(-i w
    L))/(1 - e^(-i w)), it puts (E|D|^2 + 2 Re[E(D* e^(-i v L)) E(D)/(1 - E e^(-i v L))])/E(L)
    there: the transform of a row of blocks, each of which is D_L of its value, in its place (of
    the renewals' sum over k >= 1 of Q^(k-1) = 1/(1 - Q)).

    """
    w = 2 * np.pi * np.maximum(np.frombuffer(f), 1e-7)
    survive = ages(fraction, run)
    length = np.arange(1, len(survive) + 1)
    chance = (survive - np.append(survive[1:], 0.0)) / survive[0]
    block = (1 - np.exp(-1j * np.multiply.outer(w, length))) / (1 - np.exp(-1j * w))[:, None]
    square, mean = np.abs(block) ** 2 @ chance, block @ chance
    out = np.zeros((len(w), len(ANGLES)))
    for side in (1, -1):
        v = w[:, None] - side * np.pi * ANGLES**3
        v = np.where(np.abs(v) < 1e-6, 1e-6, v)
        turn, each = np.exp(-1j * v), np.ones(v.shape, complex)
        q, b = np.zeros(v.shape, complex), np.zeros(v.shape, complex)
        for k, p in enumerate(chance):
            each *= turn
            q += p * each
            b += (p * np.conj(block[:, k]))[:, None] * each
        out += 0.5 * (square[:, None] + 2 * np.real(b * mean[:, None] / (1 - q)))
    out *= 3 * ANGLES**2 / (len(ANGLES) * (chance @ length))
    return out / _coherent(fraction, run, f)[:, None]
