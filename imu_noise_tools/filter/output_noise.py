# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What adds to the output of a gyroscope, as blocks of the filter.

And what an analysed study says of it.

"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from .oscillation import Oscillation, parameters
from .statespace import Block, Look, nothing, OutputNoise
from ..core import gauss_markov
from ..core.linear import nonnegative
from ..core.units import DEG
from ..loop.effect import Effect, Model, Parameter
from ..noise.kinds import Line, Spectrum

STEADY = 1e3            # s that a line keeps its phase where nobody says how long
SMALLEST = 1e-8         # rad/s: the least a Gauss-Markov term may be
LONGEST = 3600.0        # s: a slower wander of the bias cannot be told from rotation
ALONE = 3.0             # times what its neighbours differ by is a sample off that stands alone,
FAR_OFF = 6.0           # and so many sigma: by chance one in 10^9 and fewer
FEWEST = 3              # of such, from which their size is told
ANY_MOMENT = 12 ** -0.5     # of the interval: how far off samples are that are taken at any


class White(OutputNoise):
    """White noise of the samples."""

    name = 'white'
    symbol = 'R'
    sought = False
    variance = 'R'
    title = 'white noise'
    equation = 'z_k = x_k + v_k, var v = R'
    signature = 'the level of the innovations'
    hint = 'N of an analysed study: R = N^2 rate'
    reference = 'IEEE 952 C.1.1'
    parameters = (
        Parameter('R', '({rate})^2', 1e-16, 1e2, amplitude=True, title='variance of a sample'),
    )

    @classmethod
    def example(cls) -> Effect:
        """Return the ADIS16350's 0.60 deg/s."""
        return cls({'R': 0.36 * DEG ** 2})

    @classmethod
    def guesses(cls, look: Look) -> list[Effect]:
        """Return what third differences show."""
        return [cls({'R': look.r})]

    def block(self, dt: float) -> Block:
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
    scales = True
    idle = {'factor': 1.0}
    parameters = (Parameter('factor', '1', 1e-4, 1e4, title='variance over what was stated'),)

    @classmethod
    def guesses(cls, look: Look) -> list[Effect]:
        """Return some levels, and that of the third differences over what they should be."""
        return [
            cls({'factor': float(np.clip(f, 1e-3, 1e3))}) for f in (0.3, 1.5, np.mean(look.u**2))
        ]

    def block(self, dt: float) -> Block:
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
    def example(cls) -> Effect:
        """Return half a degree a second over 0.1 s."""
        return cls({'sigma': 0.5 * DEG, 'tc': 0.1})

    @classmethod
    def guesses(cls, look: Look) -> list[Effect]:
        """Return colours of a few samples to a tenth of the record."""
        longest = 0.1 * len(look.z) * look.dt
        return [
            cls({'sigma': k * np.sqrt(look.r), 'tc': tc})
            for tc in np.geomspace(2 * look.dt, longest, 5)
            for k in (0.1, 0.5, 2.0)
        ]

    def block(self, dt: float) -> Block:
        """Return one AR(1) state."""
        sigma, tc = self['sigma'], self['tc']
        phi, q, h = gauss_markov.state_space(sigma, tc, dt)
        return Block(phi, q, h[0], np.array([[sigma**2]]))


class RandomWalk(OutputNoise):
    """
    Rate random walk of the bias, over an hour at most.

    Beyond that it is held to a Gauss-Markov process of the same density with tc = 1 h: from the
    output alone a bias that wanders without bound is the same as a rotation that does, and the
    filter would have no steady state.

    """

    name = 'random_walk'
    symbol = 'K'
    sought = False
    title = 'rate random walk'
    equation = "b' = white of density K^2, over an hour at most"
    signature = 'slow wander at rest'
    hint = 'K of an analysed study'
    reference = 'IEEE 952 C.1.3'
    parameters = (
        Parameter('K', '{slope}/sqrt(Hz)', 1e-12, 1.0, amplitude=True, title='coefficient'),
    )

    @classmethod
    def example(cls) -> Effect:
        """Return a MEMS gyroscope's."""
        return cls({'K': 1e-6})

    def block(self, dt: float) -> Block:
        """Return the Gauss-Markov state that wanders alike for an hour."""
        return GaussMarkov({'sigma': self['K'] * np.sqrt(LONGEST / 2), 'tc': LONGEST}).block(dt)


class Sinusoid(Oscillation, OutputNoise):
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
    band = (3.0, 1e4)
    parameters = parameters(1e-8, band)

    @classmethod
    def example(cls) -> Effect:
        """Return one degree a second at 20 Hz."""
        return cls({'amplitude': DEG, 'frequency': 20.0, 'tc': STEADY})


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
    jumps = True
    search = 4.0
    idle = {'fraction': 1e-5, 'factor': 4.0}
    parameters = (Parameter('fraction', '1', 1e-5, 0.3, title='share of the samples'),
                  Parameter('factor', '1', 4.0, 1e6, title='their variance over R'))

    @classmethod
    def example(cls) -> Effect:
        """Return one sample in a hundred, ten times the noise."""
        return cls({'fraction': 0.01, 'factor': 100.0})

    @classmethod
    def guesses(cls, look: Look) -> list[Effect]:
        """Return from one in a thousand to one in twenty, 3 to 100 times the noise."""
        if not look.tails:
            return []
        return [
            cls({'fraction': p, 'factor': c})
            for p in (1e-3, 0.01, 0.05)
            for c in (10.0, 100.0, 1e3, 1e4)
        ]

    def told(self, z: np.ndarray, r: float) -> Effect:
        """
        Return it with the share and the size of single samples that stand out of the four around.

        By three times what those differ by: a blow lasts, and they differ by more. The typical
        outlier is ten times the noise, and one far beyond is a blow then; were it larger for all
        records, blows would be taken away.

        """
        if len(z) < 5:
            return self
        around = np.stack([z[:-4], z[1:-3], z[3:-1], z[4:]])
        off = np.abs(z[2:-2] - np.mean(around, axis=0))
        size = off[off > ALONE * np.ptp(around, axis=0) + FAR_OFF * np.sqrt(r)]
        if len(size) < FEWEST:
            return self
        known = {'fraction': len(size) / len(z), 'factor': float(np.mean(size ** 2)) / r}
        return self.with_values(**{
            p.name: float(np.clip(max(known[p.name], 0.1 * self[p.name]), p.lower, p.upper))
            for p in self.parameters})

    def block(self, dt: float) -> Block:
        """Return the mixture."""
        return nothing(outliers=(self['fraction'], self['factor']))


class SamplingJitter(OutputNoise):
    """
    A sample is taken a little before or after its time.

    While the rate changes by a in a second, that is an error of a times the delay; the filter
    weighs every sample by the change that it expects. A sample taken at any moment of its
    interval is off by dt/sqrt(12), and none by more: errors that ask for more are others.

    """

    name = 'sampling_jitter'
    symbol = 'j'
    title = 'noise that grows with angular acceleration (sampling jitter)'
    equation = "v_k normal with variance R + (jitter x')^2"
    signature = 'white innovations that are the larger the faster the rate changes'
    hint = ('samples are not taken when their stamps say (a busy bus, resampled data), or the'
            ' mount gives way when it is shaken')
    reference = 'Balakrishnan 1962'
    jumps = True
    slopes = True
    search = 6.0  # where the acceleration is all but constant, it is another level of the noise
    parameters = (Parameter('jitter', 's', 1e-7, 1.0, amplitude=True,
                            title='standard deviation of when a sample is taken'),)

    @classmethod
    def example(cls) -> Effect:
        """Return a tenth of the interval at 100 Hz."""
        return cls({'jitter': 1e-3})

    @classmethod
    def guesses(cls, look: Look) -> list[Effect]:
        """Return from a hundredth of the interval to any moment of it."""
        return [cls({'jitter': k * look.dt}) for k in (0.01, 0.03, 0.1, ANY_MOMENT)]

    @classmethod
    def within(cls, parameter: Parameter, dt: float) -> tuple[float, float]:
        """Return up to any moment of the interval: beyond that the block does not change."""
        return parameter.lower, ANY_MOMENT * dt

    def block(self, dt: float) -> Block:
        """Return the jitter."""
        return nothing(jitter=min(self['jitter'], ANY_MOMENT * dt))


def gauss_markov_terms(
    psd: Callable[[np.ndarray, float], np.ndarray], dt: float, shortest: float, longest: float,
    per_decade: int = 1
) -> tuple[Model, float]:
    """
    Return Gauss-Markov terms that stand for noise of some density, and how far off they are.

    ``psd`` takes f (n,), Hz, and dt, s, and returns the one-sided density (n,), (rad/s)^2/Hz.

    Flicker noise, for one, has no finite state space. The tc of the terms stand in a fixed ratio
    from ``shortest`` to ``longest`` (s), their variances are those of least squared relative
    error (non-negative) between 1/(2 pi tc) of the two, less the outermost half decade at either
    end; the error is the largest relative one there.

    """
    count = max(2, int(round(np.log10(longest / shortest) * per_decade)) + 1)
    tc = np.geomspace(shortest, longest, count)
    f = np.geomspace(10 ** 0.5 / longest, 10 ** -0.5 / shortest, 200) / (2 * np.pi)
    shares = np.array([gauss_markov.psd(f, 1.0, c, dt) for c in tc]).T / psd(f, dt)[:, None]
    variance = nonnegative(shares, np.ones(len(f)))
    error = float(np.max(np.abs(shares @ variance - 1)))
    return Model(GaussMarkov({'sigma': max(float(np.sqrt(v)), SMALLEST), 'tc': float(c)})
                 for v, c in zip(variance, tc)), error


def noise_blocks(effects: Iterable[Effect], dt: float) -> tuple[Model, tuple[str, ...]]:
    """
    Return the noise part of a filter from the effects of an analysed study.

    By what each effect can say of itself, whatever its name: its state space, its density where
    that is not finite, the frequency of a line. Second come notes on what is left out, and on what
    is not exact.

    Parameters
    ----------
    effects : iterable of Effect
        Of the domain ``noise``, with values.
    dt : float
        Sample interval, s.

    """
    model, notes = Model(), []
    for e in effects:
        if isinstance(e, Line):
            parts, note = _line(e, dt)
        elif isinstance(e, Spectrum):
            parts, note = _spectrum(e, dt)
        else:
            parts, note = Model(), 'left out: it has no state space in the filter'
        for part in parts:
            if part.name == 'white' and 'white' in model:
                model = model.with_effect(White({'R': model['white']['R'] + part['R']}))
            else:
                model = model + type(part)(dict(part.values))
        notes += [f'{e.label} {note}'] if note else []
    return model, tuple(notes)


def _line(e: Effect, dt: float) -> tuple[Model, str]:
    frequency = e['frequency']
    if frequency < 3.0:
        return Model(), 'left out: below 3 Hz an oscillation is taken for motion'
    if frequency >= 0.5 / dt:
        return Model(), f'left out: {frequency:.4g} Hz is beyond half the rate'
    return Model([Sinusoid({'amplitude': e['amplitude'], 'frequency': frequency,
                            'tc': STEADY})]), ''


def _spectrum(e: Spectrum, dt: float) -> tuple[Model, str]:
    """Return the blocks of x_k = phi x_{k-1} + w, seen by h; of more states there is none."""
    space = e.state_space(dt)
    if space is None:
        terms, error = gauss_markov_terms(e.psd, dt, 1.0, LONGEST)
        if error > 0.5:
            return Model(), 'left out: it has no state space'
        return terms, (f'stands as {len(terms)} Gauss-Markov terms from 1 s to {LONGEST:.0f} s, '
                       f'density within {100 * error:.0f} %')
    phi, q, h = (np.asarray(a, float) for a in space)
    if phi.shape != (1, 1):
        return Model(), f'left out: its state space has {len(phi)} states'
    phi, variance = float(phi[0, 0]), float(h[0, 0] ** 2 * q[0, 0])
    if phi == 0:
        return Model([White({'R': variance})]), ''
    if phi == 1:
        return Model([RandomWalk({'K': float(np.sqrt(variance / dt))})]), ''
    if phi < 0:
        return Model(), 'left out: it alternates'
    sigma = np.sqrt(variance / -np.expm1(2 * np.log(phi)))
    return Model([GaussMarkov({'sigma': float(sigma), 'tc': float(-dt / np.log(phi))})]), ''
