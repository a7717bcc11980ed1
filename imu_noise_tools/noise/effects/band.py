# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A band of noise of no form that is known: machines that change their speed."""

from collections.abc import Callable

import numpy as np
from scipy.fft import idct

from .. import loud_bands
from ..evidence import Evidence
from ..kinds import Inputs, Parameter, Spectrum
from ...core.spectrum import Bins
from ...loop.effect import Effect, Model

POINTS = 1024   # of the rule by which its Allan variance is integrated


class Band(Spectrum):
    """
    Noise in a band that stands high above what is around it, in whichever form.

    Its levels are those that are measured: a motor whose speed wanders, or several side by side,
    follow no formula, and what is known of them is where they are and how strong.

    """

    name = 'band'
    symbol = 'low, high, rms'
    title = 'a band of noise of no known form'
    equation = 'S(f) as measured from low to high, less what is around it; rms^2 its integral'
    signature = 'a hump or several in the PSD, ten times as high as what is around them'
    hint = (
        'Something that turns or swings near by and changes its speed, or several: motors, '
        'an engine, a fan. It is none of the sensor\'s own noise. Record with it stopped; isolate '
        'the mount; put a notch or a low-pass there.'
    )
    reference = 'none: it is measured'
    several = True
    certain = True      # what is measured needs no form
    nameless = True
    filtered = False    # it is measured behind the filter
    decide = 'record with the machines near by stopped'
    parameters = (
        Parameter('low', 'Hz', 1e-5, 1e5, discrete=True, title='where it begins'),
        Parameter('high', 'Hz', 1e-5, 1e5, discrete=True, title='where it ends'),
        Parameter('rms', '{rate}', 1e-12, 1e3, amplitude=True, title='standard deviation'),
    )

    def starts(self, evidence: Evidence) -> list[Effect]:
        """Start with the strongest bands that stand out of the spectrum around them."""
        if {'low', 'high'} <= set(self.values):
            return super().starts(evidence)
        return [self.with_values(low=low, high=high)
                for low, high in loud_bands.bands(evidence.whole)]

    @property
    def as_measured(self) -> bool:
        """It has no form."""
        return True

    @property
    def uneven(self) -> bool:
        """What a machine makes may come and go."""
        return True

    def colour(self, evidence: Evidence,
               part: str = 'whole') -> Callable[[np.ndarray], np.ndarray]:
        """Return the band as it is measured in a part over an even one, a function of Hz."""
        return loud_bands.colour(
            self, self['low'], self['high'], evidence.part(part), evidence.whole)

    def by_chance(self, evidence: Evidence) -> float:
        """Return what a free level in each of its bins gains by chance, nats."""
        return loud_bands.by_chance(evidence.whole.bins, self['low'], self['high'])

    def part_of(self, model: Model) -> str:
        """Say that a peak of the model is in it: what has a form is told by that."""
        for other in model.of(Spectrum):
            if other.middle is not None and self.heard_by_all(np.array(other.middle)):
                return f'{other.label} at {other.middle:.4g} Hz is in it'
        return ''

    def heard_by_all(self, f: np.ndarray) -> np.ndarray:
        """Tell that within the band axes share what shakes them all."""
        return (f >= self['low']) & (f < self['high'])

    def psd(self, f: np.ndarray, dt: float) -> np.ndarray:
        """Return rms^2/(high - low) within the band, one-sided, and next to nothing elsewhere."""
        level = self['rms'] ** 2 / (self['high'] - self['low'])
        return level * np.where(self.heard_by_all(np.asarray(f, float)), 1.0, loud_bands.NOTHING)

    def binned(self, bins: Bins) -> np.ndarray:
        """Return its power in bins, in one at an end by how many coefficients are within."""
        ends = np.ceil(2 * bins.n * bins.dt * np.array([[self['low']], [self['high']]]))
        within = np.diff(np.clip(ends, bins.first, bins.last), axis=0)[0] / bins.count
        level = self['rms'] ** 2 / (self['high'] - self['low'])
        return level * (within + loud_bands.NOTHING * (1 - within))

    def avar(self, m: np.ndarray, dt: float) -> np.ndarray:
        """
        Return the integral of its transfer (IEEE 952 annex C) over the band, by the midpoint rule.

        Of many oscillations of that their mean, 3/8, counts, and 1/sin^2 has its antiderivative.

        """
        low, high = self['low'], min(self['high'], 0.5 / dt)
        m = np.asarray(m, float)
        f = low + (high - low) * (np.arange(POINTS) + 0.5) / POINTS
        own = np.mean(np.sin(np.pi * np.outer(m, f) * dt) ** 4 / np.sin(np.pi * f * dt) ** 2, 1)
        ends = 1 / np.tan(np.pi * np.array([low, high]) * dt)
        many = 0.375 * (ends[0] - ends[1]) / (np.pi * dt * (high - low))
        own = np.where(m * dt * (high - low) < POINTS / 16, own, many)
        return 2 * self['rms'] ** 2 * (high - low) / (self['high'] - self['low']) * own / m**2

    def apply(self, x: np.ndarray, inputs: Inputs, rng: np.random.Generator) -> np.ndarray:
        """Add cosines of the record within the band, of random amplitudes."""
        n, dt = len(x), inputs.dt
        power = self.psd(np.arange(n) / (2 * n * dt), dt) / (2 * dt)
        power[0] = 0.0
        return x + idct(rng.standard_normal(n) * np.sqrt(power), type=2, norm='ortho')

    @classmethod
    def example(cls) -> Effect:
        """Return a band of 4 to 8 Hz, of 206 deg/h rms (1e-3 rad/s)."""
        return cls({'low': 4.0, 'high': 8.0, 'rms': 1e-3})
