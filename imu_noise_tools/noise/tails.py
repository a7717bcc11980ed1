# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Heavy tails of the samples themselves: Student's t in place of the normal distribution.

Its degrees of freedom are those of the whitened samples. Where noise of other colours is added, or
a filter has acted, a whitened sample is a sum over neighbours and nearer to normal than what the
sensor makes: the degrees are then more than those of any part.

"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import ndtr, ndtri, stdtr, stdtrit

NEIGHBOURS = 0.55  # standard deviation of the median of four samples, in theirs (normal: 0.546)
WIDEST = 3.0  # factor by which the scale may be off the one at which the quartiles agree
LEVELS = 16  # scales that stand for those of all blocks
GRID = 4000  # points of a quadrature over quantiles


@dataclass(frozen=True)
class Tails:
    """
    How samples are distributed whose largest were taken out.

    Attributes
    ----------
    degrees : float
        Of freedom of Student's t; infinite: normal.
    out : float
        Share that was taken out: of a t distribution the ends of it, else what came on top.
    hidden : float
        Share of what came on top and is too small to be told from the rest.
    wide, beyond : float
        Its standard deviation and the size from which it was taken out, in those of the rest.

    """

    degrees: float = np.inf
    out: float = 0.0
    hidden: float = 0.0
    wide: float = 1.0
    beyond: float = np.inf

    def shares(self, inner: np.ndarray, scale: float, spread: np.ndarray) -> np.ndarray:
        """
        Return the share of samples in cells between edges.

        What was taken out lies where its neighbours do.

        Parameters
        ----------
        inner : ndarray (k - 1,)
            Edges, without the infinite ones.
        scale : float
            Unit of the distribution.
        spread : ndarray (m,)
            Factors of it in parts of the record, all of them as long.

        Returns
        -------
        ndarray (k,)

        """
        x = inner[:, None] / (scale * spread)
        beside = _between(ndtr(x / NEIGHBOURS))
        if np.isfinite(self.degrees):
            share = _between(stdtr(self.degrees, x))
            share[[0, -1]] = np.maximum(share[[0, -1]] - 0.5 * self.out, 1e-9)
            return share + self.out * beside
        share = (1 - self.out - self.hidden) * _between(ndtr(x)) + self.out * beside
        if self.hidden > 0:
            low = ndtr(-self.beyond / self.wide)
            below = np.clip((ndtr(x / self.wide) - low) / (1 - 2 * low), 0, 1)
            share += self.hidden * _between(below)
        return share

    def fitted(self, cells: np.ndarray, spread: np.ndarray) -> tuple[np.ndarray, float]:
        """
        Return (shares, nats) of equiprobable cells (k,), the scale the likeliest.

        The nats are those by which free quantiles do better.

        """
        k, total = len(cells), np.sum(cells)
        inner = ndtri(np.arange(1, k) / k)
        spread = np.array([np.mean(x) for x in np.array_split(
            np.sort(spread), min(LEVELS, len(spread)))])
        measured = cells / total
        free = float(np.sum(cells * np.log(np.maximum(measured, 1e-12))))

        def lost(log_scale):
            shares = self.shares(inner, float(np.exp(log_scale)), spread)
            return free - float(np.sum(cells * np.log(shares)))

        best = minimize_scalar(lost, bounds=(-np.log(WIDEST), np.log(WIDEST)), method='bounded',
                               options={'xatol': 1e-5})
        return self.shares(inner, float(np.exp(best.x)), spread), float(best.fun)

    def kurtosis(self) -> float:
        """Return the excess kurtosis of what was not taken out."""
        if not np.isfinite(self.degrees):
            return 0.0
        low = 0.5 * max(self.out, 1e-12)
        x = stdtrit(self.degrees, low + (0.5 - low) * (np.arange(GRID) + 0.5) / GRID)
        return float(np.mean(x**4) / np.mean(x**2) ** 2 - 3)


def _between(below: np.ndarray) -> np.ndarray:
    """Return shares of cells (k,) from shares below their inner edges (k - 1, m), the mean."""
    return np.diff(np.concatenate([[0.0], np.mean(below, axis=1), [1.0]]))
