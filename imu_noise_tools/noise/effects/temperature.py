# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Temperature sensitivity of the bias: linear, quadratic, cubic, lagged."""

from collections.abc import Callable

import numpy as np

from ..evidence import Evidence
from ..kinds import Inputs, Mean, Parameter, Portrait
from ..views import slow_mean, slow_rest
from ...loop.effect import Effect, Fit


LEADS, LAGS = 12, 20  # starts of either sign
SMOOTHED = (1, 2, 4, 8, 16)  # parts of a lead by which a thermometer is smoothed to be read ahead
POINTS = 512  # of a picture


class Temperature(Mean):
    """The bias follows the temperature, its square and its cube, later or earlier."""

    name = 'temperature'
    symbol = 'slope, curvature, cubed, lag, smoothing'
    title = 'temperature sensitivity of the bias'
    equation = (
        'mean = slope u + curvature [u^2] + cubed [u^3], u = T - mean T, [.] less the polynomial '
        'of lower order that comes nearest in the record; T behind a first-order time constant '
        'lag, or before it (lag < 0: T + |lag| dT/dt, a thermometer slower than the sensor; dT/dt '
        'of T smoothed by the time constant smoothing, both ways)'
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
    decide = 'let the temperature swing by some degrees, up and down, while it is recorded'
    parameters = (
        *(
            Parameter(
                name, unit, -1e3, 1e3, log=False, amplitude=True, linear=True, title=title
            )
            for name, unit, title in (
                ('slope', '{rate}/degC', 'change a degree, on the whole'),
                ('curvature', '{rate}/degC^2', 'change a degree squared'),
                ('cubed', '{rate}/degC^3', 'change a degree cubed'),
            )
        ),
        Parameter(
            'lag', 's', -1e6, 1e6, log=False, discrete=True, title='time constant of the lag'
        ),
        Parameter(
            'smoothing', 's', 0.0, 1e6, log=False, discrete=True,
            title='by which the temperature is smoothed before it is read ahead',
        ),
    )
    neutral = {'lag': 0.0, 'smoothing': 0.0}
    optional = ('curvature', 'cubed')

    def starts(self, evidence: Evidence) -> list[Effect]:
        """
        Lags from none to a quarter of the record; nothing without a temperature that moves.

        What a slow thermometer lost of a fast cycle is more than its noise, or less: so each lead
        comes with several smoothings.

        """
        t = evidence.slow_others.get('temperature')
        if t is None or np.ptp(t) == 0:
            return []
        least = max(evidence.duration / 2000, 2 * float(np.diff(evidence.slow_t[:2])[0]))
        later = np.geomspace(least, evidence.duration / 4, LAGS)
        earlier = np.geomspace(least, max(evidence.duration / 10, 2 * least), LEADS)
        moved = [(0.0, 0.0), *((x, 0.0) for x in later),
                 *((-x, x / q) for x in earlier for q in SMOOTHED)]
        return [self.with_values(lag=float(x), smoothing=float(s)) for x, s in moved]

    def columns(self, inputs: Inputs, lag: float, smoothing: float = 0.0) -> np.ndarray:
        """Return u, [u^2] and [u^3], each without mean."""
        u = _moved(np.asarray(inputs.covariates['temperature'], float), inputs.t, lag, smoothing)
        u = u - np.mean(u)
        scale = np.sqrt(np.mean(u * u)) or 1.0
        u = u / scale
        out = [u]
        for power in (2, 3):        # Gram and Schmidt's steps, twice for the sake of rounding
            x = u**power
            for _ in range(2):
                x = x - np.mean(x)
                for y in out:
                    x = x - y * (x @ y / max(y @ y, 1e-300))
            out.append(x)
        return np.column_stack(out) * scale ** np.arange(1, 4)

    def portraits(self, evidence: Evidence, fit: Fit) -> dict[str, Callable[[], Portrait]]:
        """Return the rate against the temperature, less all else that moves the mean."""
        return {'rate_over_temperature': lambda: self._over_temperature(evidence, fit)}

    def _over_temperature(self, evidence: Evidence, fit: Fit) -> Portrait:
        inputs = evidence.slow_inputs
        others = slow_mean(evidence, fit.model.minus(self.label))
        y, mine = slow_rest(evidence, fit.model) - others, self.mean(inputs)
        warmth = _moved(np.asarray(inputs.covariates['temperature'], float), inputs.t,
                        self['lag'], self.values.get('smoothing', 0.0))
        per = max(1, len(y) // POINTS)
        x, seen = (v[:len(v) // per * per].reshape(-1, per).mean(axis=1) for v in (warmth, y))
        order = np.argsort(warmth)[::per]
        behind = f', {self["lag"]:.3g} s later' if self['lag'] else ''
        return Portrait(('temperature' + behind, 'mean of the axis'), ('degC', '{rate}'),
                        x, seen - np.mean(seen), warmth[order], (mine - np.mean(mine))[order])

    @classmethod
    def example(cls) -> Effect:
        """Return 0.01 deg/s (1.7e-4 rad/s) for each degree."""
        return cls({'slope': 1.7e-4, 'curvature': 0.0, 'cubed': 0.0, **cls.neutral})


def _moved(temperature: np.ndarray, t: np.ndarray, lag: float, smoothing: float) -> np.ndarray:
    """
    Return a temperature behind a time constant, or what a thermometer with one is behind of.

    ``smoothing`` is the time constant (s) by which its noise is taken out of its rate of change,
    from both sides: 0 for none.

    """
    if not lag or len(t) < 3:
        return temperature
    from scipy.signal import lfilter  # half a second to load

    step = t[1] - t[0]

    def slow(x, tc):
        a = np.exp(-step / tc)
        return lfilter([1 - a], [1, -a], x, zi=[a * x[0]])[0]

    if lag > 0:
        return slow(temperature, lag)
    smooth = temperature
    if smoothing > 0:
        smooth = slow(slow(temperature, smoothing)[::-1], smoothing)[::-1]
    return temperature - lag * np.gradient(smooth, step)
