# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What the spectrum is where the record is quiet, when something beside it is switched on and off.

A machine that runs for a part of the time adds to the power in some bands. What the sensor itself
does there shows in the rest of the time: the spectrum of the quiet stretches, each transformed for
itself, put into the bins of the whole record.

"""

from __future__ import annotations

import numpy as np
from scipy.special import ndtri

from .explained import Bands
from .line_search import find_peaks
from .lines import take_lines_out
from .smooth import reference_spectrum
from ..core.spectrum import Bins, bins_of, CORRECTED, cosine_transform
from ..core.statistics import gamma_pull_exact, in_a_row

LEAST_COUNT = 8  # coefficients of a band of a block
WIDTHS = (1, 4)  # blocks that are looked at together
OUT = 6.0  # standard errors of what is louder than the rest
LASTS = 3  # blocks; what is shorter is a knock
QUIET = 0.3  # share of the record, or of a part of it, that must be quiet
SHORTEST = 0.125  # of the longest quiet stretch: what is shorter serves for nothing
DIFFERS = 4.0  # standard errors by which a band is louder than where it is quiet
ENOUGH = 30  # coefficients from which a band may say so
SKIRT = 4  # half octaves below the first such band that it may reach down, too faint to be seen
LOW, HIGH = 0.1, 0.5  # quantiles between which the scatter of the quiet blocks shows


def loud_stretches(power: np.ndarray, count: np.ndarray) -> np.ndarray:
    """
    Return the ranges (stretches, 2) of blocks in which some band is louder than in the others.

    Parameters
    ----------
    power : ndarray (blocks, bands)
        Power in time.
    count : ndarray (bands,)
        Coefficients in each band.

    Returns
    -------
    ndarray of int (stretches, 2)
        Begin and end, a block more on either side; none where too little would be left.

    """
    blocks = len(power)
    loud = np.zeros(blocks, bool)
    for band in np.flatnonzero(count >= LEAST_COUNT):
        for width in WIDTHS:
            if blocks < 8 * width:
                continue
            x = np.convolve(power[:, band], np.ones(width) / width, 'valid')
            hot = _stands_out(x, float(width * count[band]))
            for k in range(width):
                loud[k:k + len(x)] |= hot
    edges = in_a_row(loud)
    edges = edges[edges[:, 1] - edges[:, 0] >= LASTS]
    out: list[list[int]] = []
    for a, b in edges.tolist():
        a, b = max(a - 1, 0), min(b + 1, blocks)
        if out and a <= out[-1][1] + LASTS:
            out[-1][1] = b
        else:
            out.append([a, b])
    if not out or sum(b - a for a, b in out) > (1 - QUIET) * blocks:
        return np.zeros((0, 2), int)
    return np.array(out)


def _stands_out(x: np.ndarray, count: float) -> np.ndarray:
    """
    Return which powers are larger than those of the quiet ones scatter, (n,) bool.

    Level and scatter are read from the lower half, where what is switched on is not; the scatter
    is that of the bare coefficients at least.

    """
    if not np.all(x > 0):
        return np.zeros(len(x), bool)
    low, middle = np.quantile(np.log(x), (LOW, HIGH))
    spread = (middle - low) / -ndtri(LOW)
    degrees = min(count, 2 / max(spread, 1e-9) ** 2)
    return gamma_pull_exact(x / np.exp(middle), np.full(len(x), degrees)) > OUT


def quiet_spectrum(y: np.ndarray, loud: np.ndarray, dt: float, bins: Bins) -> np.ndarray:
    """
    Return the power of the quiet stretches and the coefficients that tell it, (2, b).

    Parameters
    ----------
    y : ndarray (n,)
        Samples of a part of the record.
    loud : ndarray of int (stretches, 2)
        Ranges of samples to leave out.
    dt : float
        Interval, s.
    bins : Bins
        Of that part.

    Returns
    -------
    ndarray (2, b)
        Without coefficients where the quiet stretches are too short to tell, or too few;
        (0, b) where nothing of this part is loud.

    """
    n = len(y)
    loud = np.clip(loud, 0, n)
    if not np.any(loud[:, 1] > loud[:, 0]):
        return np.zeros((0, len(bins.f)))
    ends = np.r_[0, loud.ravel(), n].reshape(-1, 2)
    length = ends[:, 1] - ends[:, 0]
    total, count = np.zeros((2, len(bins.f)))
    if np.sum(length) >= QUIET * n:
        for a, b in ends[length >= max(SHORTEST * np.max(length), 1024)]:
            power, some = _rebinned(y[a:b], dt, bins)
            total += power * some
            count += some
    return np.array([total / np.maximum(count, 1e-9), count])


def _rebinned(y: np.ndarray, dt: float, bins: Bins) -> tuple[np.ndarray, np.ndarray]:
    """Return the power of a stretch without its lines in bins of another length, and its count."""
    c = cosine_transform(y)
    table, _ = find_peaks(c, reference_spectrum(c, dt), dt)
    take_lines_out(c, table, 0, dt, bins_of(len(c), dt))
    until = np.concatenate([[0.0], np.cumsum(2 * dt * c * c)])
    # a coefficient stands for half a step on either side
    edges = (np.append(bins.first, bins.last[-1]) - 0.5) * (len(c) / bins.n) + 0.5
    power = np.diff(np.interp(edges, np.arange(len(until)), until))
    count = np.diff(edges)
    return power / count, np.where(edges[:-1] >= CORRECTED, count, 0.0)


def quiet_from(
    bins: Bins, bands: Bands, power: np.ndarray, quiet: np.ndarray
) -> tuple[float, np.ndarray] | None:
    """
    Return (Hz from which the quiet stretches are told apart, bands that are louder), or None.

    Parameters
    ----------
    bins : Bins
        Of the record.
    bands : Bands
        Of these bins.
    power : ndarray (b,)
        Of the whole record.
    quiet : ndarray (2, b)
        Of its quiet stretches, and what they count.

    """
    if not len(quiet):
        return None
    known = quiet[1] > 0
    rest = np.where(known, bins.count - quiet[1], 0.0)
    few = bands.sum(np.where(known, quiet[1], 0.0))
    more = bands.sum(rest)
    calm = bands.sum(np.where(known, quiet[0] * quiet[1], 0.0)) / np.maximum(few, 1e-9)
    loud = bands.sum(np.where(known, power * bins.count - quiet[0] * quiet[1], 0.0)) \
        / np.maximum(more, 1e-9)
    told = (np.minimum(few, more) > ENOUGH) & (calm > 0)
    over = np.where(told, loud / np.where(told, calm, 1.0) - 1, 0.0)
    error = np.sqrt(2 / np.maximum(few, 1e-9) + 2 / np.maximum(more, 1e-9))
    louder = over > DIFFERS * error
    if not louder.any():
        return None
    first = max(int(np.argmax(louder)) - SKIRT, 0)
    return float(max(bands.low[first], bins.f[int(np.argmax(known))])), louder
