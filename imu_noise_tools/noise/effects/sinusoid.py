# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A sinusoid: vibration, mains, an alias."""

from ..kinds import Line, Parameter
from ...loop.effect import Estimate


class Sinusoid(Line):
    """A coherent line: one frequency, its phase kept through the record."""

    name = 'sinusoid'
    symbol = 'Omega0, f0'
    title = 'sinusoidal noise'
    equation = 'sigma^2(tau) = Omega0^2 [sin^2(pi f0 tau)/(pi f0 tau)]^2'
    signature = (
        'one narrow line in the PSD; a bump in the Allan deviation with nulls at tau = n/f0'
    )
    hint = (
        'A rotating machine, mains, a pump or a fan near the sensor, or one of these folded down '
        'by sampling. Stop the machine and record again; change the sample rate: an alias moves.'
    )
    reference = 'IEEE 952 C.1.7'
    several = True
    decide = 'stop the machines near by, or change the sample rate: a line moves or goes'
    parameters = (
        Parameter('amplitude', '{rate}', 1e-12, 1e3, amplitude=True, title='amplitude'),
        Parameter('frequency', 'Hz', 1e-6, 1e5, title='frequency'),
    )

    def lines(self):
        """Return the one line."""
        return [(self['frequency'], self['amplitude'])]

    def rows(self, evidence, free):
        """Take the strongest free row, or the one near a frequency that is given."""
        wanted = self.values.get('frequency')
        width = max(2 / evidence.duration, 1e-3 * (wanted or 0))
        near = [i for i in free if wanted and abs(evidence.line_table[i, 0] - wanted) < width]
        return (near or free)[:1]

    def read(self, evidence, rows):
        """Return amplitude and frequency of the row; an upper limit where there is none."""
        if not rows:
            return {
                'amplitude': evidence.no_line(),
                'frequency': Estimate(None, None, None, point=0.25 / evidence.dt, note='no line'),
            }
        line = evidence.line(rows[0])
        return {'amplitude': line.amplitude, 'frequency': line.frequency}

    def in_words(self, evidence, rows):
        """Say where it is and how far it stands out."""
        frequency, _, _, z = evidence.line_table[rows[0]]
        rpm = f' ({60 * frequency:.0f} rpm)' if 5 <= frequency <= 500 else ''
        return (
            f'a line at {frequency:.6g} Hz, {z:.0f} standard deviations above the spectrum around '
            f'it, coherent through the record{rpm}'
        )

    @classmethod
    def example(cls):
        """Return a line at 3.7 Hz, of 20.6 deg/h (1e-4 rad/s)."""
        return cls({'amplitude': 1e-4, 'frequency': 3.7})
