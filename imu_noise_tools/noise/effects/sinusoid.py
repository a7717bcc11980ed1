# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A sinusoid: vibration, mains, an alias."""

from ..kinds import Line, Parameter
from ...loop.effect import Effect


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

    @classmethod
    def example(cls) -> Effect:
        """Return a line at 3.7 Hz, of 20.6 deg/h (1e-4 rad/s)."""
        return cls({'amplitude': 1e-4, 'frequency': 3.7})
