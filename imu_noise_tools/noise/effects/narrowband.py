# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A narrow band of noise: a resonance, or a line that a wandering speed has broadened."""

import numpy as np

from ..evidence import Evidence
from ..kinds import Inputs, Parameter, Spectrum, StateSpace
from ...core import oscillator
from ...core.spectrum import Bins
from ...loop.effect import Effect

SHARPEST = 0.1  # cells of 1/T: sharper than that nothing is told from a line
BLUNTEST = 3.0  # f0/width: below, it is no band
NARROW, BROAD = 4, 2  # starts from peaks that need bins of their own, and from others
CLEAR = 5.0  # standard errors of one of those


class Narrowband(Spectrum):
    """Noise in a band around f0, of a full width at half height, as a damped oscillator's."""

    name = 'narrowband'
    symbol = 'f0, width, rms'
    title = 'narrow band of noise'
    equation = (
        'S(f) = 2 s^2 dt/|1 - 2 r cos(2 pi f0 dt) z^-1 + r^2 z^-2|^2 (one-sided), z = e^(i 2 pi f '
        'dt), r = e^(-pi width dt), s by the rms'
    )
    signature = (
        'a peak in the PSD that is wider than the record resolves; a bump in the Allan deviation '
        'with washed-out nulls'
    )
    hint = (
        'A resonance of the mount, the case or the sensing element, or a machine whose speed '
        'wanders. Tap the mount and see whether it rings there; change the speed of what turns '
        'near by; record on a heavy base.'
    )
    reference = 'Box and Jenkins, Time Series Analysis, section 3.2 (AR(2), pseudo-periodic)'
    several = True
    broad = True
    decide = 'record on another base with the machines near by stopped: what rings by itself stays'
    parameters = (
        Parameter('frequency', 'Hz', 1e-5, 1e5, title='centre'),
        Parameter('width', 'Hz', 1e-8, 1e4, title='full width at half height'),
        Parameter('rms', '{rate}', 1e-12, 1e3, amplitude=True, title='standard deviation'),
    )

    def starts(self, evidence: Evidence) -> list[Effect]:
        """Start at the peaks that stand highest above the spectrum around them."""
        if {'frequency', 'width'} <= set(self.values):
            return super().starts(evidence)
        narrow = [(float(f), float(width)) for f, width, _ in evidence.humps[:NARROW]]
        bumps = evidence.bumps(2 * BROAD)
        broad = [(f, width) for f, width, clear in bumps
                 if clear > CLEAR and all(abs(f - g) > w for g, w in narrow)]
        some = [*narrow, *broad[:BROAD]] or [(f, width) for f, width, _ in bumps[:1]]
        return [self.with_values(frequency=f, width=width) for f, width in some]

    def bounds(self, evidence: Evidence) -> dict[str, tuple[float, float]]:
        """Stay on the peak that the start is at: between a line and a broad shoulder."""
        f, width = (self.values.get(k) for k in ('frequency', 'width'))
        least = SHARPEST / evidence.duration
        if f is None or width is None:
            return {'width': (least, 0.2 / evidence.dt)}
        reach = min(4 * max(width, 1 / evidence.duration), 0.5 * f)
        return {
            'frequency': (f - reach, min(f + reach, 0.499 / evidence.dt)),
            'width': (least, max(f / BLUNTEST, 4 * least)),
        }

    @property
    def centre(self) -> float:
        """Its power is narrower than a grid of frequencies may resolve."""
        return self['frequency']

    def psd(self, f: np.ndarray, dt: float) -> np.ndarray:
        """Return the AR(2) spectrum."""
        return oscillator.psd(f, self['rms'], self['frequency'], self['width'], dt)

    def binned(self, bins: Bins) -> np.ndarray:
        """Return its expected power in bins, however narrow it is."""
        return oscillator.binned(bins, self['rms'], self['frequency'], self['width'])

    def slopes(self, bins: Bins) -> dict[str, np.ndarray]:
        """Return how that follows the centre and the width."""
        found = oscillator.slopes(bins, self['rms'], self['frequency'], self['width'])
        return dict(zip(('frequency', 'width'), found))

    def avar(self, m: np.ndarray, dt: float) -> np.ndarray:
        """Return the closed form of the sampled process."""
        return oscillator.avar(m, self['rms'], self['frequency'], self['width'], dt)

    def _coefficients(self, dt):
        r = np.exp(-np.pi * self['width'] * dt)
        return 2 * r * np.cos(2 * np.pi * self['frequency'] * dt), -r * r

    def state_space(self, dt: float) -> StateSpace | None:
        """Two states: this sample and the last."""
        first, second = self._coefficients(dt)
        q = oscillator.innovation_variance(
            self['rms'], self['frequency'], self['width'], dt)
        return (
            np.array([[first, second], [1.0, 0.0]]),
            np.array([[q, 0.0], [0.0, 0.0]]),
            np.array([[1.0, 0.0]]),
        )

    def apply(self, x: np.ndarray, inputs: Inputs, rng: np.random.Generator) -> np.ndarray:
        """Add the recursion, started stationary."""
        from scipy.signal import lfilter, lfiltic  # half a second to load
        first, second = self._coefficients(inputs.dt)
        rho = first / (1 - second)
        last = self['rms'] * rng.standard_normal()
        before = rho * last + self['rms'] * np.sqrt(1 - rho * rho) * rng.standard_normal()
        q = oscillator.innovation_variance(
            self['rms'], self['frequency'], self['width'], inputs.dt)
        w = np.sqrt(q) * rng.standard_normal(len(x))
        a = [1.0, -first, -second]
        return x + lfilter([1.0], a, w, zi=lfiltic([1.0], a, [last, before]))[0]

    @classmethod
    def example(cls) -> Effect:
        """Return a resonance of Q 10 at 4 Hz, of 20.6 deg/h rms (1e-4 rad/s)."""
        return cls({'frequency': 4.0, 'width': 0.4, 'rms': 1e-4})
