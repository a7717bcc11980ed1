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

"""
What adds to the output of a gyroscope, as blocks of the filter.

And what an analysed study says of it.

"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .motion import oscillator
from .statespace import Block, nothing, OutputNoise
from .. import ar1
from ..effect import Model, Parameter
from ..units import DEG

STEADY = 1e3            # s that a line keeps its phase where nobody says how long
LONGEST = 3600.0        # s: a slower wander of the bias cannot be told from rotation


class White(OutputNoise):
    """White noise of the samples."""

    name = 'white'
    symbol = 'R'
    title = 'white noise'
    equation = 'z_k = x_k + v_k, var v = R'
    signature = 'the level of the innovations'
    hint = 'N of an analysed study: R = N^2 rate'
    reference = 'IEEE 952 C.1.1'
    parameters = (
        Parameter('R', '{rate}^2', 1e-16, 1e2, amplitude=True, title='variance of a sample'),
    )

    @classmethod
    def example(cls):
        """Return the ADIS16350's 0.60 deg/s."""
        return cls({'R': 0.36 * DEG ** 2})

    @classmethod
    def guesses(cls, look):
        """Return what third differences show."""
        return [cls({'R': look.r})]

    def block(self, dt):
        """Return R."""
        return nothing(r=self['R'])


class NoiseLevel(OutputNoise):
    """The noise is stronger or weaker than stated."""

    name = 'noise_level'
    symbol = 'c'
    title = 'another noise level'
    equation = 'var v = c R'
    signature = 'white innovations whose normalised square is not 1'
    hint = 'wrong R: another range, bandwidth or temperature than when it was measured'
    reference = 'Mehra 1970'
    heals = 'level'
    parameters = (Parameter('factor', '1', 1e-4, 1e4, title='variance over what was stated'),)

    @classmethod
    def guesses(cls, look):
        """Return some levels, and that of the third differences over what they should be."""
        return [
            cls({'factor': float(np.clip(f, 1e-3, 1e3))}) for f in (0.3, 1.5, np.mean(look.u**2))
        ]

    def block(self, dt):
        """Return the factor."""
        return nothing(r_factor=self['factor'])


class GaussMarkov(OutputNoise):
    """Coloured noise of the output: first-order Gauss-Markov."""

    name = 'gauss_markov'
    symbol = 'b'
    title = 'coloured noise (Gauss-Markov)'
    equation = 'b_k = exp(-dt/tc) b_{k-1} + w_k'
    signature = 'correlation of innovations over tc that does not grow with motion'
    hint = "the sensor's own filter, or a drift of bias"
    reference = 'IEEE 952 C.1.5'
    heals = 'autocorrelation'
    parameters = (
        Parameter('sigma', '{rate}', 1e-8, 10.0, amplitude=True, title='standard deviation of it'),
        Parameter('tc', 's', 1e-3, 1e5, title='correlation time'),
    )
    several = True

    @classmethod
    def example(cls):
        """Return half a degree a second over 0.1 s."""
        return cls({'sigma': 0.5 * DEG, 'tc': 0.1})

    @classmethod
    def guesses(cls, look):
        """Return colours of a few samples to a tenth of the record."""
        longest = 0.1 * len(look.z) * look.dt
        return [
            cls({'sigma': k * np.sqrt(look.r), 'tc': tc})
            for tc in np.geomspace(2 * look.dt, longest, 5)
            for k in (0.1, 0.5, 2.0)
        ]

    def block(self, dt):
        """Return one AR(1) state."""
        sigma, tc = self['sigma'], self['tc']
        return Block(
            np.array([[ar1.phi(dt, tc)]]),
            np.array([[ar1.innovation_variance(sigma, tc, dt)]]),
            np.ones(1),
            np.array([[sigma**2]]),
        )


class RandomWalk(OutputNoise):
    """
    Rate random walk of the bias, over an hour at most.

    Beyond that it is held to a Gauss-Markov process of the same density with tc = 1 h: from the
    output alone a bias that wanders without bound is the same as a rotation that does, and the
    filter would have no steady state.

    """

    name = 'random_walk'
    symbol = 'K'
    title = 'rate random walk'
    equation = "b' = white of density K^2, over an hour at most"
    signature = 'slow wander at rest'
    hint = 'K of an analysed study'
    reference = 'IEEE 952 C.1.3'
    parameters = (
        Parameter('K', '{slope}/sqrt(Hz)', 1e-12, 1.0, amplitude=True, title='coefficient'),
    )

    @classmethod
    def example(cls):
        """Return a MEMS gyroscope's."""
        return cls({'K': 1e-6})

    def block(self, dt):
        """Return the Gauss-Markov state that wanders alike for an hour."""
        return GaussMarkov({'sigma': self['K'] * np.sqrt(LONGEST / 2), 'tc': LONGEST}).block(dt)


class Sinusoid(OutputNoise):
    """A vibration line in the output, fast enough to be no motion."""

    name = 'sinusoid'
    symbol = 'v'
    title = 'vibration line'
    equation = 'v = A cos(2 pi f t + phase)'
    signature = 'a line in the spectrum of the innovations'
    hint = (
        'motor, fan, resonance of the mount; below 3 Hz an oscillation is taken for motion'
        ' (harmonic)'
    )
    reference = 'IEEE 952 C.1.7'
    heals = 'line'
    parameters = (Parameter('amplitude', '{rate}', 1e-8, 1e2, amplitude=True, title='amplitude'),
                  Parameter('frequency', 'Hz', 3.0, 1e4, title='frequency'),
                  Parameter('tc', 's', 1.0, 1e6, title='how long it keeps its phase'))
    several = True
    measured = ('amplitude',)

    @classmethod
    def example(cls):
        """Return one degree a second at 20 Hz."""
        return cls({'amplitude': DEG, 'frequency': 20.0, 'tc': STEADY})

    @classmethod
    def guesses(cls, look):
        """Return the strongest fast lines of the series."""
        fast = [(f, a) for f, a in look.lines if 3.0 <= f < 0.49 / look.dt][:2]
        return [
            cls({'amplitude': a, 'frequency': f, 'tc': tc})
            for f, a in fast
            for tc in (10.0, 1e3, 1e5)
        ]

    def block(self, dt):
        """Return an oscillator."""
        return oscillator(self['amplitude'], self['frequency'], self['tc'], dt)


class Outliers(OutputNoise):
    """
    Now and then a sample is wrong by much more than the noise.

    The update weighs every sample by how likely that is.

    """

    name = 'outliers'
    symbol = 'o'
    title = 'outliers'
    equation = 'v_k normal with variance R, or factor R for a fraction of the samples'
    signature = 'heavy tails, single samples'
    hint = 'transmission errors, knocks; never a motion, which would last'
    reference = 'Sorenson, Alspach 1971'
    heals = 'kurtosis'
    parameters = (Parameter('fraction', '1', 1e-5, 0.3, title='share of the samples'),
                  Parameter('factor', '1', 4.0, 1e6, title='their variance over R'))

    @classmethod
    def example(cls):
        """Return one sample in a hundred, ten times the noise."""
        return cls({'fraction': 0.01, 'factor': 100.0})

    @classmethod
    def guesses(cls, look):
        """Return from one in a thousand to one in twenty, 3 to 100 times the noise."""
        if not look.tails:
            return []
        return [
            cls({'fraction': p, 'factor': c})
            for p in (1e-3, 0.01, 0.05)
            for c in (10.0, 100.0, 1e3, 1e4)
        ]

    def block(self, dt):
        """Return the mixture."""
        return nothing(outliers=(self['fraction'], self['factor']))


def flicker_terms(
    b: float, shortest: float, longest: float, per_decade: int = 1
) -> tuple[Model, float]:
    """
    Return Gauss-Markov terms that stand for flicker noise, and how far off they are.

    Flicker, B^2/(2 pi f) two-sided, has no finite state space. Terms of equal variance B^2
    ln(ratio)/pi whose tc stand in a fixed ratio from ``shortest`` to ``longest`` (s) have its
    slope between 1/(2 pi tc) of the two; the error is the largest relative one of the density over
    that band, less its outermost half decade at either end.

    """
    count = max(2, int(round(np.log10(longest / shortest) * per_decade)) + 1)
    tc = np.geomspace(shortest, longest, count)
    sigma = b * np.sqrt(np.log(tc[1] / tc[0]) / np.pi)
    f = np.geomspace(10 ** 0.5 / longest, 10 ** -0.5 / shortest, 200) / (2 * np.pi)
    density = sum(2 * sigma ** 2 * c / (1 + (2 * np.pi * f * c) ** 2) for c in tc)
    error = float(np.max(np.abs(density * 2 * np.pi * f / b ** 2 - 1)))
    return Model(GaussMarkov({'sigma': sigma, 'tc': c}) for c in tc), error


def noise_blocks(
    values: Mapping[str, Mapping[str, float]], dt: float
) -> tuple[Model, tuple[str, ...]]:
    """
    Return the noise part of a filter from a study; and notes on what it leaves out.

    Parameters
    ----------
    values : mapping of label to mapping of parameter to value
        As in study.yaml, plain numbers in SI: ``{'white': {'N': ...}, 'flicker': {'B': ...},
        'random_walk': {'K': ...}, 'gauss_markov': {'sigma': ..., 'tc': ...}, 'sinusoid':
        {'amplitude': ..., 'frequency': ...}}``.
    dt : float
        Sample interval, s: R = N^2/dt.

    """
    model, notes = Model(), []
    for label, v in values.items():
        name = label.partition('.')[0]
        if any(x is None for x in v.values()):
            notes.append(f'{label} left out: not observable')
        elif name == 'white':
            model = model + White({'R': v['N'] ** 2 / dt})
        elif name == 'flicker':
            terms, error = flicker_terms(v['B'], 1.0, LONGEST)
            model = model + terms
            notes.append(
                f'flicker stands as {len(terms)} Gauss-Markov terms from 1 s to {LONGEST:.0f} s, '
                f'density within {100 * error:.0f} %'
            )
        elif name == 'random_walk':
            model = model + RandomWalk({'K': v['K']})
        elif name == 'gauss_markov':
            model = model + GaussMarkov({'sigma': v['sigma'], 'tc': v['tc']})
        elif name == 'sinusoid' and 3.0 <= v['frequency'] < 0.5 / dt:
            model = model + Sinusoid(
                {'amplitude': v['amplitude'], 'frequency': v['frequency'], 'tc': STEADY}
            )
        else:
            notes.append(f'{label} left out: it has no state space in the filter')
    return model, tuple(notes)
