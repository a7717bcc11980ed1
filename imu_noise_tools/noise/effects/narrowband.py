# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A narrow band of noise: a resonance, or a line that a wandering speed has broadened."""

from collections.abc import Callable

import numpy as np

from .. import loud_bands
from ..evidence import Evidence
from ..fading import in_words, RUNS
from ..kinds import Inputs, Parameter, Spectrum, StateSpace
from ...core import bell, oscillator
from ...core.spectrum import Bins
from ...loop.effect import Effect, Model
from ...loop.verdict import FLEXIBLE_SHARE

SHARPEST = 0.1  # of 1/T, the least width: what is narrower is not told from a line
BLUNTEST = 3.0  # f0/width, at least: what is wider is no band
NARROW, BROAD = 4, 2  # peaks from which fits start: those narrower than a bin, and others
CLEAR = 5.0  # standard errors by which another one must stand out, but for the first
SHARP = 100.0    # f0/width: of a larger one nothing but a peak draws it
# f0/width of a peak no higher than what is around it: of a larger one displacement and velocity
# look alike, and the first is fitted alone
BLUNT = 30.0
# root of how many times the power around it a peak has that may be folded (a choice): what is
# folded lies between displacement and velocity, and of a lower peak one of these is as good
HIGH = 3.0
# in a part of a record a line that wanders is tried off its centre by so many widths, and so many
# times as wide as in the whole
MOVED = np.linspace(-1, 1, 17)
NARROWER = 1.0, 0.7, 0.5, 0.35
# of two peaks on each other the fainter is the shape of the stronger (choices): up to so many
# times as wide or as narrow; the narrower with less than so much of the power of one that
# wanders; within so many widths of the wider, where one of them wanders (ON) or both do, or one
# that wanders stayed a while (AWAY)
SKIRTS = 4.0
STAYED = 0.1
AWAY, ON = 2.0, 0.5
WANDERING, MEASURED = 'wandering', 'measured'
FORMS = oscillator.DISPLACEMENT, oscillator.VELOCITY, WANDERING, oscillator.FOLDED, MEASURED


class Narrowband(Spectrum):
    """
    Noise in a band around f0, of a full width at half height.

    A damped oscillator's peak (displacement, velocity, folded from above half the rate), or the
    bell of a line whose frequency wanders slowly, as that of a machine does. Of a machine that
    wanders too seldom in a record for a bell the levels are as they are measured.

    """

    name = 'narrowband'
    symbol = 'f0, width, rms'
    title = 'narrow band of noise'
    equation = (
        'S(f) = 2 s^2 dt/|1 - 2 r cos(2 pi f0 dt) z^-1 + r^2 z^-2|^2 (one-sided), z = e^(i 2 pi f '
        'dt), r = e^(-pi width dt), s by the rms; of velocity times |1 - z^-2|^2; folded: rms^2 '
        'dt (1 - r^2) (1/|1 - p z^-1|^2 + 1/|1 - p* z^-1|^2), p = r e^(i 2 pi f0 dt); wandering: '
        'rms^2 sqrt(4 ln 2/pi)/width e^(-4 ln 2 ((f - f0)/width)^2); measured: as it is measured'
    )
    signature = (
        'a peak in the PSD that is wider than the record resolves; a bump in the Allan deviation '
        'with washed-out nulls'
    )
    hint = (
        'A resonance of the mount, the case or the sensing element, or a machine whose speed '
        'wanders, or that comes and goes. Tap the mount and see whether it rings there; change '
        'the speed of what turns near by; record on a heavy base. What is folded rings above half '
        'the rate: record at a higher one and see whether it moves.'
    )
    reference = (
        'Box and Jenkins, Time Series Analysis, section 3.2 (AR(2), pseudo-periodic); Papoulis, '
        "Probability, Random Variables and Stochastic Processes, section 10-2 (Woodward's theorem)"
    )
    several = True
    broad = True
    aside = ('coherence',)      # other axes hear it as well
    decide = 'record on another base with the machines near by stopped: what rings by itself stays'
    parameters = (
        Parameter('frequency', 'Hz', 1e-5, 1e5, title='centre'),
        Parameter('width', 'Hz', 1e-8, 1e4, title='full width at half height'),
        Parameter('rms', '{rate}', 1e-12, 1e3, amplitude=True, title='standard deviation'),
        Parameter.choice('form', FORMS, title='what is heard of the swing'),
    )
    neutral = {'form': 0.0}

    def starts(self, evidence: Evidence) -> list[Effect]:
        """Start at the peaks that stand highest above the spectrum around them."""
        if {'frequency', 'width'} <= set(self.values):
            return super().starts(evidence)
        narrow = [(float(f), float(width)) for f, width, _ in evidence.humps[:NARROW]]
        bumps = [bump for bump in evidence.bumps(2 * BROAD)
                 if all(abs(bump[0] - g) > w for g, w in narrow)]
        # one at least: what stands narrow may be another effect's
        broad = [(f, width) for k, (f, width, clear) in enumerate(bumps[:BROAD])
                 if clear > CLEAR or k == 0]
        some = [*narrow, *broad]
        forms = (self.chosen('form'),) if 'form' in self.values else FORMS
        machines = evidence.machines.tolist() if MEASURED in forms else []
        forms = tuple(form for form in forms if form != MEASURED)
        least = bell.LEAST / evidence.duration

        def shows(form: str, f: float, width: float) -> bool:
            if form == WANDERING:
                return width > 2 * least
            high = _height(evidence, f, width)
            return f < BLUNT * width * high and (form != oscillator.FOLDED or high > HIGH)

        return [*(self.with_values(
            frequency=f, width=max(width, least) if form == WANDERING else width, form=form)
            for form in forms for f, width in some if form == forms[0] or shows(form, f, width)),
            *(self.with_values(frequency=f, width=width, form=MEASURED)
              for _, _, f, width in machines)]

    def bounds(self, evidence: Evidence) -> dict[str, tuple[float, float]]:
        """Stay on the peak that the start is at: between a line and a broad shoulder."""
        f, width = (self.values.get(k) for k in ('frequency', 'width'))
        least = (bell.LEAST if self._wanders else SHARPEST) / evidence.duration
        if f is None or width is None:
            return {'width': (least, 0.2 / evidence.dt)}
        if self.as_measured:
            return {'frequency': (f, f), 'width': (width, width)}
        reach = min(4 * max(width, 1 / evidence.duration), 0.5 * f)
        return {
            'frequency': (f - reach, min(f + reach, 0.499 / evidence.dt)),
            'width': (least, max(f / BLUNTEST, 4 * least)),
        }

    @property
    def centre(self) -> float | None:
        """Its power is narrower than a grid of frequencies may resolve, unless it is measured."""
        return None if self.as_measured else self.middle

    @property
    def middle(self) -> float:
        """It is around that."""
        return self['frequency']

    @property
    def as_measured(self) -> bool:
        """Of a machine that no form tells."""
        return self._form == MEASURED

    @property
    def sharp(self) -> bool:
        """It is narrower than a filter or what axes share can draw."""
        f, width = (self.values.get(k, 0.0) for k in ('frequency', 'width'))
        return f > SHARP * width or self.as_measured

    def colour(self, evidence: Evidence,
               part: str = 'whole') -> Callable[[np.ndarray], np.ndarray] | None:
        """Return what is measured of a machine, in a part, over its bell, a function of Hz."""
        at = evidence.machine_at(self['frequency']) if self.as_measured else None
        return None if at is None else loud_bands.colour(
            self, *at, evidence.part(part), evidence.whole)

    def by_chance(self, evidence: Evidence) -> float:
        """Return what a free level in each bin gains by chance where it is measured, nats."""
        if not self.as_measured:
            return 0.0
        at = evidence.machine_at(self['frequency'])
        return np.inf if at is None else loud_bands.by_chance(evidence.whole.bins, *at)

    def part_of(self, model: Model) -> str:
        """
        Say that one of two that lie on each other is what the other's form lacks.

        No machine wanders as a formula says: a peak far above all else is none of its forms to
        the last hundredth, and what is left of it is as wide as it, or its skirts. Where a line
        that wanders stayed a while it has a narrower peak, on its skirts too; and one that was
        nowhere long enough to draw a bell draws two of much the same width, beside each other.

        """
        for other in model.of(Narrowband):
            if other.label == self.label:
                continue
            weak, strong = sorted((self, other), key=lambda e: e['rms'])
            share = (weak['rms'] / strong['rms']) ** 2
            wider = weak['width'] / strong['width']
            alike = 1 / SKIRTS < wider < SKIRTS
            apart = abs(weak['frequency'] - strong['frequency']) / max(
                weak['width'], strong['width'])
            if apart < 1 and alike and share < FLEXIBLE_SHARE \
                    or apart < AWAY and strong._strays and wider < 1 and share < STAYED \
                    or apart < (0.0, ON, AWAY)[strong._strays + weak._strays] and alike:
                return (f'of two that lie on each other at {strong["frequency"]:.4g} Hz one has '
                        f'{100 * share:.2g} % of the power: it is the shape of the other')
        return ''

    def elsewhere(self) -> list[Effect]:
        """Return where a line that wanders may be in a part of a record, and how narrow."""
        if not self._wanders:
            return []
        f, width = self['frequency'], self['width']
        return [self.with_values(frequency=f + shift * width, width=share * width)
                for share in NARROWER for shift in MOVED if f + shift * width > 0]

    def manner(self, evidence: Evidence) -> str:
        """Say how its level fades: a machine's stays, a resonance's swings."""
        return RUNS if self.as_measured else in_words(
            *evidence.fades(self['frequency'], self['width']))

    @property
    def _form(self) -> str:
        return self.chosen('form') if 'form' in self.values else oscillator.DISPLACEMENT

    @property
    def _wanders(self) -> bool:
        return self._form == WANDERING

    @property
    def _strays(self) -> bool:
        return self._wanders or self.as_measured

    @property
    def _swing(self) -> tuple[float, float, float]:
        return self['rms'], self['frequency'], self['width']

    def psd(self, f: np.ndarray, dt: float) -> np.ndarray:
        """Return the AR(2) spectrum, or the bell; of that a little wherever it is measured."""
        if self.as_measured:
            return bell.psd(f, *self._swing, dt) \
                + loud_bands.NOTHING * self['rms']**2 / self['width']
        if self._wanders:
            return bell.psd(f, *self._swing, dt)
        return oscillator.psd(f, *self._swing, dt, self._form)

    def binned(self, bins: Bins) -> np.ndarray:
        """Return its expected power in bins, however narrow it is."""
        if self._strays:
            return bell.binned(bins, *self._swing)
        return oscillator.binned(bins, *self._swing, self._form)

    def slopes(self, bins: Bins) -> dict[str, np.ndarray]:
        """Return how that follows the centre and the width."""
        found = bell.slopes(bins, *self._swing) if self._strays else \
            oscillator.slopes(bins, *self._swing, self._form)
        return dict(zip(('frequency', 'width'), found))

    def avar(self, m: np.ndarray, dt: float) -> np.ndarray:
        """Return the closed form of the sampled process."""
        if self._strays:
            return bell.avar(m, *self._swing, dt)
        return oscillator.avar(m, *self._swing, dt, self._form)

    def _coefficients(self, dt):
        r = np.exp(-np.pi * self['width'] * dt)
        return 2 * r * np.cos(2 * np.pi * self['frequency'] * dt), -r * r

    def state_space(self, dt: float) -> StateSpace | None:
        """
        Two states, this sample of the swing and the last; of its velocity one more.

        Of what is folded the swing and what lies a quarter of a turn off it. None for a bell: no
        finite recursion has it.

        """
        if self._strays:
            return None
        q = oscillator.innovation_variance(*self._swing, dt, self._form)
        if self._form == oscillator.FOLDED:
            turn = np.exp(-np.pi * self['width'] * dt + 2j * np.pi * self['frequency'] * dt)
            step = np.array([[turn.real, -turn.imag], [turn.imag, turn.real]])
            return step, q * np.eye(2), np.array([[1.0, 0.0]])
        velocity = self._form == oscillator.VELOCITY
        many = 2 + velocity
        step = np.eye(many, k=-1)
        step[0, :2] = self._coefficients(dt)
        heard = [[1.0, 0.0, -1.0]] if velocity else [[1.0, 0.0]]
        return step, np.diag([q] + [0.0] * (many - 1)), np.array(heard)

    def apply(self, x: np.ndarray, inputs: Inputs, rng: np.random.Generator) -> np.ndarray:
        """Add the recursion, started stationary, or a bell's samples."""
        if self._strays:
            return x + bell.sample(len(x), *self._swing, inputs.dt, rng)
        from scipy.signal import lfilter, lfiltic  # half a second to load
        q = oscillator.innovation_variance(*self._swing, inputs.dt, self._form)
        if self._form == oscillator.FOLDED:
            turn = np.exp((-np.pi * self['width'] + 2j * np.pi * self['frequency']) * inputs.dt)
            w = np.sqrt(q) * (rng.standard_normal(len(x)) + 1j * rng.standard_normal(len(x)))
            w[0] *= self['rms'] / np.sqrt(q)
            return x + lfilter([1.0], [1.0, -turn], w).real
        first, second = self._coefficients(inputs.dt)
        rho = first / (1 - second)
        size = oscillator.displacement(*self._swing, inputs.dt, self._form)
        last = size * rng.standard_normal()
        before = rho * last + size * np.sqrt(1 - rho * rho) * rng.standard_normal()
        w = np.sqrt(q) * rng.standard_normal(len(x))
        a = [1.0, -first, -second]
        y = lfilter([1.0], a, w, zi=lfiltic([1.0], a, [last, before]))[0]
        if self._form == oscillator.VELOCITY:
            y = y - np.concatenate([[before, last], y])[:len(y)]
        return x + y

    @classmethod
    def example(cls) -> Effect:
        """Return a resonance of Q 10 at 4 Hz, of 20.6 deg/h rms (1e-4 rad/s)."""
        return cls({'frequency': 4.0, 'width': 0.4, 'rms': 1e-4, 'form': 'displacement'})


def _height(evidence: Evidence, f: float, width: float) -> float:
    """
    Return how high a peak stands above the spectrum around it, 1 at least, as a root of power.

    Its skirts reach so many half widths from it, of P times their power: there, the forms of a
    resonance differ by P^(1/2) width/f0 of it.

    """
    bins, power = evidence.whole.bins, evidence.whole.power
    at, around = np.abs(bins.f - f) < 0.5 * width, np.abs(np.log(bins.f / f)) < np.log(2)
    if not np.any(at):
        return 1.0
    top = np.average(power[at], weights=bins.count[at])
    return max(1.0, float(np.sqrt(top / np.median(power[around]))))
