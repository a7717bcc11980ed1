# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Whether the axes of a sensor are behind one filter.

White noise behind one pole, and a little behind that, has the spectrum of a Gauss-Markov process
beside white noise. A filter is the sensor's: behind it all axes have one shape, where such a
process is as strong in each axis as it may be.

"""

from __future__ import annotations

import numpy as np
from scipy.special import logsumexp, polygamma

from .explained import Bands
from ..core.spectrum import Bins

SHARES = np.geomspace(1e-4, 10.0, 231)  # of white noise that does not pass, in what does
LEAST = 4  # bands that tell a shape
FAR = 5.0  # standard errors from which a band counts no more: a line of the other axis is there
ROUNDS = 3  # of leaving them out


def alike(bins: Bins, power: np.ndarray, passed: np.ndarray, every: np.ndarray, behind: float,
          std: float) -> float:
    """
    Return how much likelier another axis is behind the same filter than beside noise of its own.

    In nats. Of both the spectrum is a sum of white noise and of what passes a filter: behind one
    filter their ratio is this axis's, else it is any of SHARES (the odds of a point against a
    range: Jeffreys, Theory of Probability, 1961, 5.0).

    Parameters
    ----------
    bins : Bins
        Of the whole record.
    power : ndarray (b,)
        Of the other axis.
    passed, every : ndarray (b,)
        White noise that passes the filter, and all of it, as they are seen (behind what holds
        samples, say); ``passed`` 0 where more than white noise is in the spectrum.
    behind, std : float
        Share of this axis's white noise that arises behind the filter, its standard deviation.

    """
    bands, count = Bands.on(bins), bins.count * (passed > 0)
    some = bands.sum(count) > 0
    if np.sum(some) < LEAST:
        return 0.0

    def mean(x):
        return bands.sum(count * x)[some] / bands.sum(count)[some]

    level = mean(bins.log_level(power))
    # one over the variance of the logarithm of chi-squared over its degrees of freedom
    weight = bands.sum(count)[some] / mean(count * polygamma(1, bins.count / 2))
    through, white = (np.exp(mean(np.log(np.maximum(x, 1e-300)))) for x in (passed, every))
    away = level - np.log(through + SHARES[:, None] * white)
    away -= np.median(away, axis=1, keepdims=True)
    for _ in range(ROUNDS):
        w = np.where(away**2 * weight < FAR**2, weight, 0.0)
        away -= (np.sum(w * away, axis=1) / np.maximum(np.sum(w, axis=1), 1e-300))[:, None]
    lost = np.sum(np.minimum(away**2 * weight, FAR**2), axis=1)
    # what else that axis holds makes all of them worse: each says the less
    lost /= max(1.0, np.min(lost) / (len(level) - 2))
    wide = max(std, behind * np.log(SHARES[1] / SHARES[0]), SHARES[0])
    own = np.log(SHARES) - 0.5 * ((SHARES - behind) / wide) ** 2
    return float(logsumexp(own - 0.5 * lost) - logsumexp(own)
                 - logsumexp(-0.5 * lost) + np.log(len(SHARES)))
