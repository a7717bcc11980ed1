# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Rivals without a name: to what bends a spectrum over decades, and to what moves a mean slowly.

The first is a knee of any steepness, or a power of the frequency. A Gauss-Markov process is the
knee of one steepness, and several of them imitate any other over a band. The other is cosines.
Neither is an effect of the library: nothing is named by it.

"""

from __future__ import annotations

import numpy as np

from .evidence import Evidence
from .kinds import Inputs, Mean, Parameter, Spectrum
from ..loop.effect import Effect

MIDDLE = 0.01   # of the sample rate: where the level is read
STEEP = (-0.5, 0.35, 0.7, 1.5)    # to start from
STEEPEST = 4.0
KNOTS = 8       # free levels of a smooth form
CREEP_BLOCKS = 256    # of the record, of which the logarithm of time resolves the first


def slow_cosines(u: np.ndarray, blocks: int, logarithm: bool) -> np.ndarray:
    """Return cosines (n, KNOTS) of shares u (n,) of a record of some blocks, or of their logs."""
    if logarithm:
        u = np.log1p(blocks * u) / np.log1p(blocks)
    return np.cos(np.pi * np.outer(u, np.arange(1, KNOTS + 1)))


class Knee(Spectrum):
    """Power level^2 ((1 + (f/fc)^2)/(1 + (f_0/fc)^2))^-steepness."""

    parameters = (
        Parameter('level', '{rate}/sqrt(Hz)', 1e-12, 1e3, amplitude=True),
        Parameter('fc', 'Hz', 1e-9, 1e6),
        Parameter('steepness', '1', -1.5, STEEPEST, log=False),
    )

    def starts(self, evidence: Evidence) -> list[Effect]:
        """Start from knees below, inside and at the end of what the record shows."""
        lowest, highest = 0.1 / evidence.duration, 0.3 / evidence.dt
        return [self.with_values(level=1.0, fc=float(fc), steepness=p)
                for fc in np.geomspace(lowest, highest, 5) for p in STEEP]

    def bounds(self, evidence: Evidence) -> dict[str, tuple[float, float]]:
        """Keep it within a tenth of what the record resolves: below is a power of f."""
        return {'fc': (0.1 / evidence.duration, 1 / evidence.dt)}

    def psd(self, f: np.ndarray, dt: float) -> np.ndarray:
        """Return the knee."""
        def over(f):
            return 1 + (np.asarray(f) / self['fc']) ** 2

        return self['level'] ** 2 * (over(f) / over(MIDDLE / dt)) ** -self['steepness']


class SlowMean(Mean):
    """Cosines of time, or of its logarithm from the record's begin on, as a creep wants it."""

    smooth = slow = True
    parameters = (
        *(Parameter(f'order_{k}', '{rate}', -1e3, 1e3, log=False, amplitude=True, linear=True)
          for k in range(1, KNOTS + 1)),
        Parameter.choice('of', ('time', 'logarithm')),
    )

    def columns(self, inputs: Inputs, of: float = 0.0) -> np.ndarray:
        """Return them (n, KNOTS)."""
        u = (inputs.t - inputs.t[0]) / (inputs.t[-1] - inputs.t[0])
        return slow_cosines(u, CREEP_BLOCKS, bool(of))
