# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A notch filter of the sensor: a band that it takes out."""

import numpy as np

from ..behind import beside_unfiltered
from ..evidence import Evidence
from ..kinds import FILTERS, Parameter, Response, Spectrum
from ...core.spectrum import Bins
from ...loop.effect import Effect, Model

WIDEST = 1.5  # of the centre that a fit starts at: a filter that takes out more is no notch
BEHIND = 0.002  # share of the white noise behind it from which a fit starts
WHOLE = 0.45  # of the rate: a filter so wide leaves next to nothing


class Notch(Response):
    """Power dips to nothing around one frequency."""

    name = 'notch'
    symbol = 'f0, width'
    title = "the sensor's own notch filter"
    equation = (
        'gain^2 = (g + behind)/(1 + behind), g = (x^2 - x0^2)^2/((x^2 - x0^2)^2 + (x w)^2), x = '
        'tan(pi f dt), x0 = tan(pi f0 dt), w = tan(pi width dt) (1 + x0^2)'
    )
    signature = 'a dip in the PSD, of one frequency, with the level as it was on both sides'
    hint = (
        'The sensor or its driver filters a band out, its own drive or a known vibration. '
        'Harmless below; do not look for signals in that band. Switch the filter off and record '
        'again where it can be.'
    )
    reference = 'Oppenheim and Schafer, Discrete-Time Signal Processing, section 6.4'
    several = True
    decide = 'switch the filter off and record again'
    parameters = (
        Parameter('frequency', 'Hz', 1e-4, 1e5, title='centre'),
        Parameter('width', 'Hz', 1e-6, 1e5, title='width between the -3 dB points'),
        Parameter('behind', '1', 0.0, 0.02, log=False, knee=1e-4,
                  title='share of the white noise that arises behind it'),
        FILTERS,
    )
    neutral = {'behind': 0.0, 'filters': 0.0}
    optional = ('behind', 'filters')

    def starts(self, evidence: Evidence) -> list[Effect]:
        """Start at the deepest dips."""
        if self.fitted:
            return [self]
        dips = evidence.bumps(2, -1)
        return [self.with_values(frequency=f, width=width, behind=BEHIND, filters=0.0)
                for f, width, _ in dips]

    def bounds(self, evidence: Evidence) -> dict[str, tuple[float, float]]:
        """Stay near the dip that the start is at."""
        top = 0.499 / evidence.dt
        if not self.fitted:
            return {'frequency': (4 / evidence.duration, top)}
        f, width = self['frequency'], self['width']
        reach = min(2 * width, 0.5 * f)
        return {
            'frequency': (f - reach, min(f + reach, top)),
            'width': (1 / evidence.duration, min(WIDEST * f, WHOLE / evidence.dt)),
        }

    def part_of(self, model: Model) -> str:
        """Say that a peak stands in its hole: the two draw one hump, of which neither is seen."""
        for peak in model.of(Spectrum):
            off = np.inf if peak.centre is None else abs(peak.centre - self['frequency'])
            if off < 0.5 * self['width'] and peak.values.get('width', 0.0) < self['width']:
                return f'a peak stands in its hole at {peak.centre:.4g} Hz: both draw one hump'
        return ''

    def gain2(self, f: np.ndarray, dt: float) -> np.ndarray:
        """Return the squared gain."""
        x = np.tan(np.pi * np.minimum(np.asarray(f, float) * dt, 0.49999))
        x0 = np.tan(np.pi * min(self['frequency'] * dt, 0.499))
        w = np.tan(np.pi * min(self['width'] * dt, 0.49)) * (1 + x0**2)
        behind = self.values.get('behind', 0.0)
        g = (x**2 - x0**2) ** 2 / ((x**2 - x0**2) ** 2 + (x * w) ** 2)
        return beside_unfiltered(g, behind)

    def least(self, bins: Bins, dt: float) -> float:
        """Return that at its frequency: a bin may be wider than the notch."""
        return float(self.gain2(np.array(self['frequency']), dt))

    @classmethod
    def example(cls) -> Effect:
        """Return a notch at 9 Hz, 2 Hz wide."""
        return cls({'frequency': 9.0, 'width': 2.0, 'behind': 0.0, 'filters': 0.0})
