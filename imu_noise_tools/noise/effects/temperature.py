# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Temperature sensitivity of the bias: linear, quadratic, lagged."""

import numpy as np

from ..kinds import Mean, Parameter


class Temperature(Mean):
    """The bias follows the temperature, its square, and both with a first-order lag."""

    name = 'temperature'
    symbol = 'slope, curvature, lag'
    title = 'temperature sensitivity of the bias'
    equation = (
        'mean = slope (T - Tm) + curvature ((T - Tm)^2 - mean), T lagged by a first-order time '
        'constant'
    )
    signature = (
        'the slow part of the record follows the temperature topic; slope +1/2 to +1 at the long '
        'end'
    )
    hint = (
        'The bias drifts with the temperature of the die. Calibrate it over temperature, keep '
        'the temperature constant, or feed the temperature to the estimator.'
    )
    reference = 'IEEE 1554, bias temperature sensitivity'
    needs = 'record a temperature topic (sensor_msgs/Temperature) or column along with the IMU'
    decide = 'record the temperature and let it swing by some degrees, up and down'
    parameters = (
        Parameter(
            'slope',
            '{rate}/degC',
            -1e3,
            1e3,
            log=False,
            amplitude=True,
            linear=True,
            title='change a degree',
        ),
        Parameter(
            'curvature',
            '{rate}/degC^2',
            -1e3,
            1e3,
            log=False,
            amplitude=True,
            linear=True,
            title='change a degree squared',
        ),
        Parameter(
            'lag', 's', 0.0, 1e6, log=False, discrete=True, title='time constant of the lag'
        ),
    )

    def starts(self, evidence):
        """Lags from none to a tenth of the record; nothing without a temperature that moves."""
        t = evidence.slow_others.get('temperature')
        if t is None or np.ptp(t) == 0:
            return []
        return [
            self.with_values(lag=float(x))
            for x in (0.0, *np.geomspace(evidence.duration / 500, evidence.duration / 8, 12))
        ]

    def columns(self, inputs, lag):
        """T - Tm and its square, both without mean."""
        t = np.asarray(inputs.covariates['temperature'], float)
        if lag > 0 and len(inputs.t) > 1:
            from scipy.signal import lfilter  # half a second to load

            a = np.exp(-(inputs.t[1] - inputs.t[0]) / lag)
            t = lfilter([1 - a], [1, -a], t, zi=[a * t[0]])[0]
        t = t - np.mean(t)
        return np.column_stack([t, t**2 - np.mean(t**2)])

    @classmethod
    def example(cls):
        """Return 0.01 deg/s (1.7e-4 rad/s) for each degree."""
        return cls({'slope': 1.7e-4, 'curvature': 0.0, 'lag': 0.0})
