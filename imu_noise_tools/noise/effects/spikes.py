# Copyright 2026 imu_noise_tools maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Spikes: isolated outliers."""

import numpy as np
from scipy.special import log_ndtr, ndtri

from ..kinds import Defect, Parameter
from ...effect import Estimate, Finding

SURE = 15.0  # nats from which outliers are taken out of the samples that the spectrum is made of
PIECE = 1 << 15  # samples worked on at a time


class Spikes(Defect):
    """Single samples far outside the noise: transmission errors, knocks."""

    name = 'spikes'
    symbol = 'rate, sigma'
    title = 'spikes (outliers)'
    equation = 'x_k + s_k, s_k ~ N(0, sigma^2) in a share rate*dt of the samples, else 0'
    signature = (
        'tails of the whitened samples beyond the normal distribution, isolated in time; white '
        'spectrum'
    )
    hint = (
        'Transmission errors, electrical interference, or knocks (these show on several axes at '
        'once and ring). Check the bus, its checksums and the supply. N as fitted here is that '
        'of the samples without them.'
    )
    reference = 'Huber, Robust Statistics, 1981'
    views = ('distribution', 'variance')
    decide = 'change cable or bus rate and record again'
    parameters = (
        Parameter('rate', 'Hz', 1e-9, 1e4, amplitude=True, title='spikes a second'),
        Parameter('sigma', '{rate}', 1e-12, 1e4, title='standard deviation of their size'),
    )

    @classmethod
    def statistics(cls, y, inputs):
        """Keep index and size of each outlier, the noise around it, and the threshold."""
        n = len(y)
        rest = _against_neighbours(y)
        sigma = _robust(rest)
        if not sigma > 0:
            return {}
        threshold = float(-ndtri(0.01 / n)) * sigma
        index = np.flatnonzero(np.abs(rest) > threshold)
        return {
            'index': index,
            'size': rest[index],
            'sigma': np.array(sigma),
            'threshold': np.array(threshold),
            'n': np.array(n),
            'dt': np.array(inputs.dt),
        }

    @classmethod
    def screen(cls, y, kept, inputs):
        """Put the mean of the nearest samples that are no spikes in place of each."""
        index = kept['index']
        found = _gain(kept)
        if found is None or found[0] < SURE:
            return y
        good = np.ones(len(y), bool)
        good[index] = False
        out = y.copy()
        at = np.flatnonzero(good)
        out[index] = np.interp(index, at, y[at])
        return out

    def find(self, evidence):
        """
        Weigh each outlier's likelihood as a spike against that of a normal sample.

        The spike is one of the fitted size.

        """
        kept = evidence.kept(self.name)
        found = _gain(kept) if kept else None
        if found is None:
            return None
        gain, spread, wide = found
        size, sigma, n = kept['size'], float(kept['sigma']), int(kept['n'])
        k = len(size)
        # spikes too small to be told from noise are missing: scale by the share beyond the
        # threshold
        seen = max(2 * float(np.exp(log_ndtr(-float(kept['threshold']) / wide))), 0.05)
        duration = n * float(kept['dt'])
        rate = k / duration / seen
        std = np.sqrt(k) / duration / seen
        effect = self.with_values(rate=rate, sigma=spread)
        return Finding(
            self.name,
            float(gain),
            effect,
            {
                'rate': Estimate(rate, float(std), (max(rate - 1.96 * std, 0), rate + 1.96 * std)),
                'sigma': Estimate(
                    spread,
                    spread / np.sqrt(2 * k),
                    (spread * (1 - 1.4 / np.sqrt(k)), spread * (1 + 1.4 / np.sqrt(k))),
                ),
            },
            view='distribution',
            evidence=f'{k} samples beyond {float(kept["threshold"]) / sigma:.1f} standard '
            f'deviations, the largest {np.max(np.abs(size)) / sigma:.0f}',
        )

    def apply(self, x, inputs, rng):
        """Add a normal spike to a share of the samples."""
        hit = rng.random(len(x)) < self['rate'] * inputs.dt
        return x + hit * self['sigma'] * rng.standard_normal(len(x))

    @classmethod
    def example(cls):
        """One in twenty seconds."""
        return cls({'rate': 0.05, 'sigma': 0.05})


def _gain(kept):
    """
    Return (nats, standard deviation of the spikes, of spike and noise together).

    None where there are none, or too many.

    """
    size, sigma, n = kept['size'], float(kept['sigma']), int(kept['n'])
    k = len(size)
    if not 0 < k <= 0.05 * n:
        return None
    spread = float(np.sqrt(max(np.mean(size**2) - sigma**2, sigma**2)))
    wide = float(np.hypot(sigma, spread))
    gain = np.sum(
        0.5 * (size / sigma) ** 2 - 0.5 * (size / wide) ** 2 - np.log(wide / sigma)
    ) - k * (np.log(n / k) + 1)
    return float(gain), spread, wide


def _against_neighbours(y):
    """Return y less the median of its four neighbours, scaled to its own share of the variance."""
    n = len(y)
    rest = np.zeros(n)
    for i in range(2, n - 2, PIECE):
        j = min(i + PIECE, n - 2)
        a, b, c, d = (y[i + k:j + k] for k in (-2, -1, 1, 2))
        low = np.maximum(np.minimum(a, b), np.minimum(c, d))
        high = np.minimum(np.maximum(a, b), np.maximum(c, d))
        rest[i:j] = y[i:j] - 0.5 * (low + high)
    return rest


def _robust(x):
    some = x[:: max(1, len(x) // 200_000)]
    sigma = 1.4826 * float(np.median(np.abs(some - np.median(some))))
    return sigma
