# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Temperature sensitivity of the bias: linear, quadratic, cubic, lagged."""

from collections.abc import Callable

import numpy as np

from ..block_means import slow_rest
from ..evidence import Evidence
from ..kinds import Inputs, Mean, Parameter, Portrait
from ..stairs import hidden, missed
from ..thermal import COURSE, moved, POWERS, powers, readings, rows_of_readings, TEMPERATURE
from ..views import slow_mean
from ...core.statistics import means_of_blocks
from ...loop.effect import Effect, Fit


READ = ('thermometer', 'axes')  # by what: alone, or beside the axes that follow it as well
POINTS = 512  # of a picture


class Temperature(Mean):
    """The bias follows the temperature, its square and its cube, later or earlier."""

    name = 'temperature'
    slow = True  # not smooth: the noise of a thermometer, read ahead, is not
    symbol = 'slope, curvature, cubed, course, lag, smoothing, read'
    title = 'temperature sensitivity of the bias'
    equation = (
        'mean = slope u + curvature [u^2] + cubed [u^3], u = T - mean T, [.] less the polynomial '
        'of lower order that comes nearest in the record; T behind a first-order time constant '
        'lag, or before it (lag < 0: T + |lag| dT/dt, a thermometer slower than the sensor; dT/dt '
        'of T smoothed by the time constant smoothing, both ways); + course r, r what other axes '
        'that follow the temperature tell of it and the thermometer does not'
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
        Parameter('course', '1', -1e3, 1e3, log=False, amplitude=True, linear=True,
                  title='of a course that other axes tell, as large as this axis sways'),
        Parameter(
            'lag', 's', -1e6, 1e6, log=False, discrete=True, title='time constant of the lag'
        ),
        Parameter(
            'smoothing', 's', 0.0, 1e6, log=False, discrete=True,
            title='by which the temperature is smoothed before it is read ahead',
        ),
        Parameter.choice('read', READ, title='by the thermometer, or by other axes as well'),
    )
    neutral = {'lag': 0.0, 'smoothing': 0.0}
    optional = ('curvature', 'cubed', 'course')
    # of the thousands of coefficients that make the whitened samples its course fills a few; other
    # axes follow the temperature as well, and what they share at high frequencies is none of it
    aside = ('distribution', 'coherence')
    of_readings = True

    @classmethod
    def statistics(cls, y: np.ndarray, inputs: Inputs) -> dict[str, np.ndarray]:
        """
        Return what the steps of its readings hide of the temperature, rms degC, (1,) each.

        Of all that reads the same, and of what goes on between the steps as smoothly as it may.

        """
        if TEMPERATURE not in inputs.covariates:
            return {}
        read = np.asarray(inputs.covariates[TEMPERATURE], float)
        return {'hidden': np.array([hidden(read)]), 'missed': np.array([missed(read)])}

    def unread(self, evidence: Evidence) -> float:
        """Return how far the mean may go, rms, with a temperature that reads the same."""
        return self._by_steps(evidence, 'hidden')

    def missed(self, evidence: Evidence) -> float:
        """Return how far the mean is off, rms, by where the temperature went between the steps."""
        return self._by_steps(evidence, 'missed')

    def _by_steps(self, evidence: Evidence, what: str) -> float:
        """
        Return what the steps make of the mean, rms, by how steep that is.

        Beside a course that other axes tell as well it is not the thermometer's steps that hide
        it.

        """
        rms = float(evidence.kept(self.name).get(what, np.zeros(1))[0])
        if not rms or self.values.get('read'):
            return 0.0
        t = evidence.slow_inputs
        u = moved(np.asarray(t.covariates[TEMPERATURE], float), t.t, self['lag'],
                  self.values.get('smoothing', 0.0))
        law = np.polynomial.Polynomial.fit(u, self.mean(t), POWERS)     # which it is, but for u
        return rms * float(np.sqrt(np.mean(law.deriv()(u) ** 2)))

    def starts(self, evidence: Evidence) -> list[Effect]:
        """
        All ways to read the thermometer; nothing without a temperature that moves.

        And the one that comes nearest to what other axes tell of it, beside that.

        """
        t = evidence.slow_others.get(TEMPERATURE)
        if t is None or np.ptp(t) == 0:
            return []
        step = float(np.diff(evidence.slow_t[:2])[0])
        tried = [(*some, 0) for some in readings(evidence.duration, step)]
        if evidence.course is not None:
            tried.append((evidence.course.lag, evidence.course.smoothing, 1))
        return [self.with_values(lag=lag, smoothing=s, read=r) for lag, s, r in tried]

    def finer(self, evidence: Evidence) -> list[Effect]:
        """Return all ways to read it: beside what was missing from the mean it was another."""
        return self.starts(evidence)

    def ways(self, evidence: Evidence) -> list[list[Mean]]:
        """Return all lags by the thermometer alone, in a row for each way to smooth it."""
        step = float(np.diff(evidence.slow_t[:2])[0])
        return [[self.with_values(lag=lag, smoothing=s, read=0) for lag, s in row]
                for row in rows_of_readings(evidence.duration, step)]

    def columns(self, inputs: Inputs, lag: float, smoothing: float = 0.0,
                read: float = 0.0) -> np.ndarray:
        """Return u, [u^2], [u^3] and what axes tell beyond them, each without mean."""
        u = moved(np.asarray(inputs.covariates[TEMPERATURE], float), inputs.t, lag, smoothing)
        course = inputs.covariates.get(COURSE) if read else None
        return powers(u, [np.zeros(len(u)) if course is None else course])

    def portraits(self, evidence: Evidence, fit: Fit) -> dict[str, Callable[[], Portrait]]:
        """
        Return the rate against the temperature, less all else that moves the mean.

        And less what other axes tell beyond the thermometer, which is no function of it.

        """
        return {'rate_over_temperature': lambda: self._over_temperature(evidence, fit)}

    def _over_temperature(self, evidence: Evidence, fit: Fit) -> Portrait:
        inputs = evidence.slow_inputs
        mine = self.with_values(read=0.0).mean(inputs)
        others = slow_mean(evidence, fit.model) - mine
        y = slow_rest(evidence, fit.model) - others
        warmth = moved(np.asarray(inputs.covariates[TEMPERATURE], float), inputs.t,
                       self['lag'], self.values.get('smoothing', 0.0))
        per = max(1, len(y) // POINTS)
        x, seen = (means_of_blocks(v, per) for v in (warmth, y))
        order = np.argsort(warmth)[::per]
        lag = self['lag']
        read = (f' behind a lag of {lag:.3g} s' if lag > 0
                else f' ahead of a thermometer {-lag:.3g} s slow' if lag else '')
        return Portrait(('temperature' + read, 'mean of the axis'), ('degC', '{rate}'),
                        x, seen - np.mean(seen), warmth[order], (mine - np.mean(mine))[order])

    def plain(self) -> Mean:
        """Return the bias that goes with the thermometer as it is read."""
        return Plain()

    @classmethod
    def example(cls) -> Effect:
        """Return 0.01 deg/s (1.7e-4 rad/s) for each degree."""
        return cls({p.name: 0.0 for p in cls.parameters} | {'slope': 1.7e-4})


class Plain(Temperature):
    """Nothing but the slope: no powers, no lag."""

    def starts(self, evidence: Evidence) -> list[Effect]:
        """Return the one way to read it; nothing without a temperature that moves."""
        return super().starts(evidence)[:1]

    def ways(self, evidence: Evidence) -> list[list[Mean]]:
        """Return none but its own."""
        return []

    def columns(self, inputs: Inputs, lag: float, smoothing: float = 0.0,
                read: float = 0.0) -> np.ndarray:
        """Return u, and no more."""
        out = super().columns(inputs, lag, smoothing)
        out[:, 1:] = 0.0
        return out
