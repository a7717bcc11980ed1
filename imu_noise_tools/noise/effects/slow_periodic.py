# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A mean that swings slowly: air conditioning, heating, day and night."""

import numpy as np

from ..evidence import Evidence
from ..kinds import Inputs, Mean, Parameter
from ..lines import ORDERS, SWING
from ..thermal import TEMPERATURE
from ...loop.effect import Effect


# what a room, a day or a regulator has beyond those orders is little
CYCLES = np.linspace(0.5, SWING, 24)  # in the record, that are started from


class SlowPeriodic(Mean):
    """A swing of a few periods in the record: a sine, of part of one too, or with harmonics."""

    name = 'slow_periodic'
    smooth = slow = True
    symbol = 'cosine, sine, ..., period'
    title = 'slow periodic change of the bias'
    equation = (
        'mean = cosine cos(2 pi t/period) + sine sin(2 pi t/period) + the same at 2 and 3 times '
        'that frequency, up to orders'
    )
    signature = (
        'the mean of the record swings with a period of T/10 to 2 T; slope +1 in the Allan '
        'deviation up to half of that period, then a dip'
    )
    hint = (
        'Air conditioning or heating that switches, the day, a regulator that hunts. Close the '
        'room, or record over several periods.'
    )
    reference = 'IEEE 952 C.1.7 (sinusoidal noise), below the frequencies at which lines are found'
    several = True
    most = 3    # with two harmonics each these bend more than the smooth form without a name does
    decide = 'record over several of its periods, the temperature too where it is not there yet'
    parameters = (
        *(
            Parameter(
                f'{name}{suffix}', '{rate}', -1e3, 1e3, log=False, amplitude=True, linear=True,
                title=title + of,
            )
            for suffix, of in (('', ''), *((f'_{k}', f', order {k}')
                                           for k in range(2, ORDERS + 1)))
            for name, title in (('cosine', 'part in phase with the beginning of the record'),
                                ('sine', 'part a quarter of a period later'))
        ),
        Parameter('period', 's', 1e-2, 1e7, title='period'),
        Parameter('orders', '1', 1, ORDERS, log=False, discrete=True,
                  title='highest order of a swing that is no sine'),
    )
    optional = tuple(f'{name}_{k}' for k in range(2, ORDERS + 1) for name in ('cosine', 'sine'))
    anew = ('orders',)
    neutral = {**dict.fromkeys(optional, 0.0), 'orders': 1.0}

    def starts(self, evidence: Evidence) -> list[Effect]:
        """Start at periods from a tenth of the record to twice its length, 24 in all."""
        if 'period' in self.values:
            return [self.with_values(orders=float(k)) for k in range(1, ORDERS + 1)]
        return [self.with_values(period=evidence.duration / x, orders=1.0) for x in CYCLES]

    def finer(self, evidence: Evidence) -> list[Effect]:
        """Try harmonics or none, of periods so near that the highest stays in step."""
        beside = (CYCLES[1] - CYCLES[0]) / ORDERS * np.array([-1, 0, 1])
        cycles = evidence.duration / self['period'] + beside
        return [self.with_values(period=evidence.duration / x, orders=float(k))
                for x in cycles for k in range(1, ORDERS + 1)]

    def bounds(self, evidence: Evidence) -> dict[str, tuple[float, float]]:
        """
        Below a tenth of the record it is a line, beyond twice its length a drift.

        With harmonics too: what part of a skewed swing leaves of a sine would else be a drift or
        a second swing.

        """
        orders = int(self.values.get('orders', ORDERS))
        return {'period': (0.09 * evidence.duration, 2.2 * evidence.duration),
                **{name: (0.0, 0.0) for name in self.optional[2 * orders - 2:]}}

    def lacking(self, evidence: Evidence) -> str:
        """Ask for the temperature where none was recorded, which may swing alike."""
        return '' if TEMPERATURE in evidence.slow_others else (
            'Record the temperature along with the IMU: if it swings alike, temperature is the '
            'effect to add.')

    def columns(self, inputs: Inputs, period: float, orders: float = 1.0) -> np.ndarray:
        """Return cosine and sine of each order, zero beyond the highest."""
        wave = order = np.exp(2j * np.pi / period * inputs.t)
        out = np.zeros((len(wave), 2 * ORDERS))
        for k in range(int(orders)):
            out[:, 2 * k], out[:, 2 * k + 1] = order.real, order.imag
            order = order * wave
        return out

    @classmethod
    def example(cls) -> Effect:
        """Return a skewed swing of 20.6 deg/h (1e-4 rad/s) to either side in ten minutes."""
        return cls({'cosine': 6e-5, 'sine': 8e-5, 'cosine_2': 2e-5, 'sine_2': -1e-5,
                    'cosine_3': -2e-5, 'sine_3': 1e-5, 'period': 600.0, 'orders': 3.0})
