# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Samples drawn as a fit says that they are, for what no formula tells of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.fft import idct

from .evidence import Evidence
from .kinds import Spectrum
from ..loop.effect import Fit


LEAST = 1e-3  # share of the power that is left for what is normal


def drawn(evidence: Evidence, fit: Fit, paths: Sequence[Spectrum], n: int,
          count: int) -> Iterator[np.ndarray]:
    """
    Yield so many times n samples of the noise of a fit, lines left out.

    Some of its spectra follow ``paths`` of their own, as sharp as they are ahead of a filter, for
    the spectrum hardly tells whether one acts on them; all others are normal.

    """
    rng, dt, bins = np.random.default_rng(0), evidence.dt, evidence.whole.bins
    each = [s.drawing(evidence, fit) for s in paths]
    rest = fit.details.v - sum(s.binned(bins) for s in paths)
    f = np.arange(1, n) / (2 * n * dt)
    power = np.exp(np.interp(np.log(f), np.log(bins.f), np.log(
        np.maximum(rest, LEAST * fit.details.v))))
    for _ in range(count):
        y = sum((draw(n, rng) for draw in each), np.zeros(n))
        c = np.append(0.0, rng.standard_normal(n - 1) * np.sqrt(power / (2 * dt)))
        yield y + idct(c, type=2, norm='ortho')
