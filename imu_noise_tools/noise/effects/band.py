# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A band of noise of no form that is known: machines that change their speed."""

from collections.abc import Callable

import numpy as np
from scipy.fft import idct
from scipy.ndimage import median_filter
from scipy.special import chdtri

from ..evidence import AROUND, Evidence, Part, STEP
from ..kinds import Inputs, Parameter, Spectrum
from ..rivals import swept
from ...core.spectrum import band_of, Bins, leaked_beside, OCTAVE
from ...core.statistics import in_a_row
from ...loop.effect import Effect, Fit, Model

HIGH = 10.0     # times the power around it that a band has somewhere (a choice: 10 dB)
CLEAR = 1.0     # standard errors above what is around it, to where it ends
RARE = 1e-3     # in how many records of nothing it may gain as much
MANY = 4        # that are looked for
FEWEST = 8      # coefficients that hold nearly all of its power: in fewer it may be lines
POINTS = 1024   # of the rule by which its Allan variance is integrated
NOTHING = 1e-9  # of its level, outside of it
LAST = 0.01     # of the spectrum's end: what stands for what is above a band that ends there


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
        return [self.with_values(low=low, high=high) for low, high in _bands(evidence)]

    @property
    def uneven(self) -> bool:
        """What a machine makes may come and go."""
        return True

    def colour(self, evidence: Evidence,
               part: str = 'whole') -> Callable[[np.ndarray], np.ndarray]:
        """Return the band as it is measured in a part over an even one, a function of Hz."""
        here, whole = evidence.part(part), evidence.whole
        power, total = (_seen(p, self['low'], self['high']) for p in (here, whole))
        inside = self.heard_by_all(whole.bins.f)
        rms2 = np.sum((total * whole.bins.count)[inside]) / (2 * whole.bins.n * whole.dt)
        even = self.with_values(rms=np.sqrt(max(rms2, 1e-300)))
        step = 2 * here.n * here.dt
        return lambda f: power[np.clip(here.bins.index(np.round(f * step)), 0, len(power) - 1)] \
            / even.psd(f, here.dt)

    def by_chance(self, evidence: Evidence) -> float:
        """Return what a free level in each of its bins gains by chance: half of chi-squared."""
        free = np.sum(self.heard_by_all(evidence.whole.bins.f))
        return 0.5 * float(chdtri(max(free, 1), RARE))

    def otherwise(self, evidence: Evidence, fit: Fit, claim: float) -> str:
        """Say that it is where a line passes that sweeps."""
        return swept(evidence, self, claim, fit)

    def part_of(self, model: Model) -> str:
        """Say that a peak of the model is in it: what has a form is told by that."""
        for other in model.of(Spectrum):
            if other.centre is not None and self.heard_by_all(np.array(other.centre)):
                return f'{other.label} at {other.centre:.4g} Hz is in it'
        return ''

    def heard_by_all(self, f: np.ndarray) -> np.ndarray:
        """Tell that within the band axes share what shakes them all."""
        return (f >= self['low']) & (f < self['high'])

    def psd(self, f: np.ndarray, dt: float) -> np.ndarray:
        """Return rms^2/(high - low) within the band, one-sided, and next to nothing elsewhere."""
        level = self['rms'] ** 2 / (self['high'] - self['low'])
        return level * np.where(self.heard_by_all(np.asarray(f, float)), 1.0, NOTHING)

    def binned(self, bins: Bins) -> np.ndarray:
        """Return its power in bins, in one at an end by how many coefficients are within."""
        ends = np.ceil(2 * bins.n * bins.dt * np.array([[self['low']], [self['high']]]))
        within = np.diff(np.clip(ends, bins.first, bins.last), axis=0)[0] / bins.count
        level = self['rms'] ** 2 / (self['high'] - self['low'])
        return level * (within + NOTHING * (1 - within))

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


def _seen(part: Part, low: float, high: float) -> np.ndarray:
    """Return the power (b,) of a band beyond what is around it, and what of it leaks beside it."""
    bins = part.bins
    inside = (bins.f >= low) & (bins.f < high)
    left = part.power - leaked_beside(part.power, bins, inside)
    beside = _beside(bins, left, low, high)
    if _ends_there(bins, high):     # what is there may be the band itself
        beside = np.minimum(beside, beside[0])
    around = np.exp(np.interp(np.log(bins.f), np.log([low, high]), np.log(beside)))
    own = np.where(inside, np.maximum(part.power - around, 0.0), 0.0)
    return own + leaked_beside(own, bins, inside)


def _beside(bins: Bins, power: np.ndarray, low: float, high: float) -> np.ndarray:
    """Return the level (2,) below a band and above it, or at its end where the spectrum ends."""
    ends = high, min(high * (1 + STEP), 0.5 / bins.dt)
    if _ends_there(bins, high):
        ends = high * (1 - LAST), high
    return np.array([bins.between(power, np.array(some))[1][0]
                     for some in ((low * (1 - STEP), low), ends)])


def _ends_there(bins: Bins, high: float) -> bool:
    """Tell whether nothing of the spectrum is above a band."""
    return high > (1 - LAST) * 0.5 / bins.dt


def _bands(evidence: Evidence) -> list[tuple[float, float]]:
    """Return where (low, high), Hz, each of the bands is that stand out most, best first."""
    bins, power, top = evidence.whole.bins, evidence.whole.power, 0.5 / evidence.dt
    f = top * np.exp(-STEP * np.arange(np.log(top * evidence.duration / 8) / STEP)[::-1])
    if len(f) < AROUND:
        return []
    high = _over(bins, power, f) > np.log(HIGH)
    at = np.searchsorted(f, bins.f, side='right') - 1
    left = power - leaked_beside(power, bins, (at >= 0) & high[np.clip(at, 0, len(high) - 1)])
    count, level = bins.between(left, f)
    over = _over(bins, left, f)
    out = []
    for a, b in in_a_row(over > CLEAR * np.sqrt(2 / count)):
        low, end = float(f[a]), float(f[b])
        inside = (bins.f >= low) & (bins.f < end)
        # a step may lie between the middles of two bins
        if a == 0 or not np.any(inside) or np.max(over[a:b]) < np.log(HIGH) \
                or np.max(level[a:b]) < HIGH * np.max(_beside(bins, left, low, end)):
            continue
        own = _seen(evidence.whole, low, end) * bins.count
        first, last = band_of(own[inside], bins.f[inside])
        if last <= OCTAVE * first and last - first > FEWEST / (2 * evidence.duration):
            out.append((float(np.max(over[a:b])), low, end))
    return [(low, end) for _, low, end in sorted(out, reverse=True)[:MANY]]


def _over(bins: Bins, power: np.ndarray, f: np.ndarray) -> np.ndarray:
    """Return by how much the power between frequencies (k,) is above that around it, (k - 1,)."""
    # Evidence.bumps asks this of steps that begin at the other end, and for summits of any height:
    # there the spectrum is taken to go on as it ends, here a band that ends with it is mirrored
    level = np.log(bins.between(power, f)[1])
    return level - median_filter(level, AROUND)
