# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A sinusoid: vibration, mains, an alias."""

import numpy as np

from ..kinds import Line, Parameter


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

    def avar(self, m, dt):
        """Omega0^2 sin^4(pi f m dt) / (m sin(pi f dt))^2: the sampled form of IEEE 952 C.1.7."""
        m = np.asarray(m, float)
        x = np.pi * self['frequency'] * dt
        return self['amplitude'] ** 2 * np.sin(m * x) ** 4 / (m * np.sin(x)) ** 2

    def apply(self, x, inputs, rng):
        """Add the sinusoid with a random phase."""
        phase = rng.uniform(0, 2 * np.pi)
        return x + self['amplitude'] * np.sin(2 * np.pi * self['frequency'] * inputs.t + phase)

    @classmethod
    def example(cls):
        """Return the line of a machine at 23 Hz."""
        return cls({'amplitude': 1e-4, 'frequency': 3.7})
