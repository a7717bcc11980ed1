# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The power of blocks in time, and what their window makes of a spectrum.

The window is level, with a cosine on an eighth at either end (Tukey, 1967). The power of white
noise is told by it as by .87 of the samples (by .51 where the window is Hann's); from 9 ordinates
on less than 1e-4 of a line leaks.

"""

import numpy as np

POWER_BLOCKS = 256  # of a record, at most
BANDS = 20
SHORTEST = 64  # samples of a block, where a record is short
FIRST = 3  # ordinate at which the lowest band begins
TAPERED = 0.25  # of a block, half of it at either end
_LAGS = 16  # ordinates over which the window leaks


def taper(length: int) -> np.ndarray:
    """Return the window (length,) of a block."""
    edge = np.minimum((np.arange(length) + 0.5) / (0.5 * TAPERED * length), 1.0)
    return np.sin(0.5 * np.pi * np.minimum(edge, edge[::-1])) ** 2


def _after(window: np.ndarray) -> np.ndarray:
    """Return how much of the power of an ordinate is in the next ones, from itself on (k,)."""
    power = np.abs(np.fft.rfft(window)[:_LAGS + 1]) ** 2
    return power / power[0]


_WINDOW = taper(1024)
_SEEN, _SHARED = _after(_WINDOW), _after(_WINDOW**2)
_LEAK = np.append(_SEEN[:0:-1], _SEEN) / (2 * np.sum(_SEEN) - 1)
#: as by so many times fewer samples the power of all ordinates is told
FEWER = float(np.mean(_WINDOW**4) / np.mean(_WINDOW**2) ** 2)
#: Sums of correlated squares are more skewed than the chi-squared of their variance: by the third
#: cumulant, w E[x - ln x - 1] is lower by this/w (m3 m1/m2^2 - 1 of the moments of the weights).
SKEW = 8 / 3 * float(
    np.mean(_WINDOW**6) * np.mean(_WINDOW**2) / np.mean(_WINDOW**4) ** 2 - 1)


def block_power(y: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """
    Return the power in time of samples (n,) at an interval dt, s.

    Returns
    -------
    ndarray (blocks, bands)
        One-sided PSD, unit^2/Hz.
    ndarray of int (bands,)
        Ordinates in each band.

    """
    n = len(y)
    blocks = int(np.clip(n // SHORTEST, 4, POWER_BLOCKS))
    length = n // blocks
    window = taper(length)
    # the ordinate at Nyquist is real: half as much
    edges = np.unique(np.round(np.geomspace(FIRST, (length + 1) // 2, BANDS + 1)).astype(int))
    out = np.empty((blocks, len(edges) - 1))
    # rows at a time, so that a long record needs no second copy of itself
    rows = max(1, (1 << 18) // length)
    for i in range(0, blocks, rows):
        some = np.asarray(y[i * length:min(blocks, i + rows) * length], float).reshape(-1, length)
        some = (some - some.mean(axis=1, keepdims=True)) * window
        spectrum = np.abs(np.fft.rfft(some, axis=1)) ** 2
        out[i:i + len(some)] = np.add.reduceat(
            spectrum[:, :edges[-1]], edges[:-1], axis=1) / np.diff(edges)
    return 2 * dt * out / np.sum(window**2), np.diff(edges)


def degrees(s: np.ndarray) -> float:
    """Return the degrees of freedom of a sum of ordinates whose expectations are s (k,)."""
    both = np.sum(s * s) + 2 * sum(
        share * np.sum(s[lag:] * s[:-lag]) for lag, share in enumerate(_SHARED[1:len(s)], 1))
    return float(2 * np.sum(s) ** 2 / both)


def leaked(s: np.ndarray) -> np.ndarray:
    """Return the ordinates (k,) that the window makes of those of a spectrum s (k,)."""
    return np.convolve(np.pad(s, _LAGS, mode='edge'), _LEAK, 'valid')
