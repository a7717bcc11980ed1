# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Whether what two signals share is normal noise.

Normal noise is normal in every band of frequencies, narrow or wide, and what two signals share of
it has no fourth joint cumulant. A line that moves is in a narrow band for a while only, bursts
come and go in a wide one, a path between levels stays on each. This is the spectral kurtosis
(Antoni, Mechanical Systems and Signal Processing 20, 2006) of two signals instead of one, so that
what either brings along by itself says nothing.

"""

from __future__ import annotations

import numpy as np
from scipy.fft import dct, idct, rfft

from ..core.statistics import normal_pull

LEAST = 16      # coefficients in a band, from which its width doubles
REACH = 0.1     # of a frequency, within which power and coherence are told
CLEAR = 4.0     # times what chance makes of a coherence
ROUNDING = 1e-10     # of the mean power, that is none
END = 16        # part of the cells at each end that is left out


def unlike_noise(x: np.ndarray, y: np.ndarray) -> float:
    """
    Return what speaks against normal noise in what two signals (n,) share in phase, nats.

    That of the width of bands that says most, less the logarithm of how many there are.

    """
    c, d = _weighted(*(dct(v - np.mean(v), norm='ortho')[1:] for v in (x, y)))
    found, size = [], LEAST
    while size <= len(c):
        found.append(0.5 * _pull(*(_cells(v, size) for v in (c, d))) ** 2)
        size *= 2
    return max(found) - float(np.log(len(found))) if found else 0.0


def _weighted(c: np.ndarray, d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return coefficients (n,) of two signals, whitened; of the second what is coherent."""
    half = np.maximum(LEAST // 2, (REACH * np.arange(len(c))).astype(int))
    low = np.maximum(np.arange(len(c)) - half, 0)
    high = np.minimum(np.arange(len(c)) + half + 1, len(c))
    one, other, both = (
        np.diff(np.concatenate([[0.0], np.cumsum(v)])[np.stack([low, high])], axis=0)[0]
        / (high - low) for v in (c * c, d * d, c * d))
    # what is left of a sum by rounding is no power
    one, other = (np.maximum(v, ROUNDING * np.mean(v) + 1e-150) for v in (one, other))
    chance = CLEAR / (high - low)
    share = np.maximum(both / one * (both / other) - chance, 0.0) / (1 - chance)
    return c / np.sqrt(one), d / np.sqrt(other) * np.sqrt(share)


def _cells(c: np.ndarray, size: int) -> np.ndarray:
    """
    Return bands of coefficients (n,) in time: (bands, cells).

    Without those at the record's ends, where a cosine transform puts what a peak leaks.

    """
    bands = len(c) // size
    cells = idct(c[:bands * size].reshape(bands, size), norm='ortho', axis=1)
    return cells[:, size // END:size - size // END]


def _pull(a: np.ndarray, b: np.ndarray) -> float:
    """
    Return the normal pull of the fourth joint cumulant of two signals in bands (bands, cells).

    Estimated without bias: of normal cells, <a^2 b^2> is in the mean K/(K + 2) (<a^2> <b^2> +
    2 <a b>^2) of K cells, its variance that of the Wick product :a^2 b^2:. It is more by as much
    as the squares of either signal by itself say: the noise of one may come in bursts.

    """
    count = a.shape[1]
    one, other, both, four = (np.mean(v, axis=1) for v in (a * a, b * b, a * b, (a * b) ** 2))
    product = one * other
    cumulant = four - count / (count + 2) * (product + 2 * both**2)
    variance = 4 * product**2 + 16 * product * both**2 + 4 * both**4
    total = float(np.sum(variance))
    if not total > 0:
        return 0.0
    independent = count * float(np.sum(np.sqrt(variance))) ** 2 / total
    rough = _roughness(a, b, one, other, variance)
    return normal_pull(float(np.sum(cumulant)) / np.sqrt(rough * total / count), independent)


def _roughness(a: np.ndarray, b: np.ndarray, one: np.ndarray, other: np.ndarray,
               weight: np.ndarray) -> float:
    """
    Return the variance of the mean product of squares over that of normal cells, 1 or more.

    Of signals (bands, cells) of mean squares ``one`` and ``other`` and a weight (bands,) each, as
    it is where their squares have nothing to do with each other: the sum over all lags of the
    product of their autocovariances.

    """
    there = (one > 0) & (other > 0)
    spectra = [np.abs(rfft(v[there]**2 / p[there, None] - 1, 2 * v.shape[1], axis=1)) ** 2
               for v, p in ((a, one), (b, other))]
    lags = np.mean(spectra[0] * spectra[1], axis=1) / a.shape[1] ** 2   # but for the very ends
    return max(1.0, 0.25 * float(np.average(lags, weights=weight[there])))
