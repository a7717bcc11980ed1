# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What can drive a rate.

Each a small class, in the units of the rate (``{rate}``) and its derivative (``{slope}``).

"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .oscillation import Oscillation, parameters
from .statespace import Block, Look, Motion, nothing, Switching
from ..core.units import DEG
from ..loop.effect import Effect, Parameter

DIFFUSE = (
    3000 * DEG
) ** 2  # no gyroscope turns faster: the variance of a rate nothing is known of


SOJOURN = 10.0  # s that a mode of the bank for any motion lasts on average
REST = 0.5  # share of its changes of mode that lead to rest: where nothing speaks for motion
WANDER = (1e-7, 1e6)  # random walks of the rate, (deg/s)^2/s: at rest, and jumps
# random walks of the acceleration, (deg/s^2)^2/s: from a slow turn to a sensor that is struck, by
# steps of 7.7, which move the variance of an estimate (to the fourth root of it) by less than a
# third either way of the best
ACCELERATION = tuple(float(q) for q in np.geomspace(0.3, 1.8e9, 12))


def _integrator(phi, q, p0=0.0) -> Block:
    """Return a block whose first state is the rate; p0 is the variance of the second."""
    d = len(phi)
    start = np.zeros((d, d))
    start[0, 0] = DIFFUSE
    if d > 1:
        start[1, 1] = p0
    return Block(
        np.asarray(phi, float), np.asarray(q, float), np.eye(d)[0], start, integrates=True
    )


class ConstantRate(Motion):
    """The rate does not change."""

    name = 'constant_rate'
    symbol = 'x'
    sought = False
    title = 'constant rate'
    equation = 'x_k = x_{k-1}'
    signature = 'innovations of one sign whenever the rate changes'
    hint = 'right at rest and on a rate table; in motion something must drive the rate'
    reference = 'Qian, Xia, Que, Zhang 2010'

    def block(self, dt: float) -> Block:
        """Return the integrator alone."""
        return _integrator([[1.0]], [[0.0]])


class ArIncrement(Motion):
    """
    The increments of the rate, message by message, are a first-order autoregression.

    The augmentation of Qian et al. 2010.

    """

    name = 'ar_increment'
    symbol = 'w'
    title = 'autoregressive increments of the rate'
    equation = 'x_k = x_{k-1} + w_{k-1}, w_k = phi w_{k-1} + xi_k'
    signature = 'innovations that follow the rotation, more so the larger it is'
    hint = 'q is a choice, not a measurement: a record at rest does not hold it'
    reference = 'Qian, Xia, Que, Zhang 2010'
    counts = True
    parameters = (
        Parameter(
            'phi', '1', -0.99, 0.99, log=False, title='correlation of neighbouring increments'
        ),
        Parameter('q', '({rate})^2', 1e-16, 1.0, amplitude=True,
                  title='variance of the innovation, each step'),
    )

    @classmethod
    def example(cls) -> Effect:
        """Return that of Qian et al. 2010: phi = 0.107, q = 4e-4 (deg/s)^2."""
        return cls({'phi': 0.107, 'q': 4e-4 * DEG ** 2})

    @classmethod
    def guesses(cls, look: Look) -> list[Effect]:
        """Return bandwidths from a thousandth to a tenth of the rate."""
        return [cls({'phi': 0.1, 'q': f * look.r}) for f in (1e-6, 1e-4, 1e-2, 1.0)]

    def block(self, dt: float) -> Block:
        """Return one step, whatever dt: Qian et al. 2010 count in messages."""
        phi, q = self['phi'], self['q']
        return _integrator([[1, 1], [0, phi]], [[0, 0], [0, q]], q / (1 - phi ** 2))


class AngularAcceleration(Motion):
    """The angular acceleration wanders: the rate is the integral of a random walk."""

    name = 'angular_acceleration'
    symbol = 'a'
    title = 'angular acceleration'
    smooth = True
    equation = "x' = a, a' = white of density q"
    signature = 'innovations of one sign for as long as the rotation speeds up or slows down'
    hint = 'the filter lags behind every change of rate; turning by hand, rocking, vehicles'
    reference = 'Bar-Shalom, Li, Kirubarajan 2001, 6.2.2'
    heals = 'autocorrelation'
    parameters = (
        Parameter(
            'q', '({slope})^2/s', 1e-12, 1e6, amplitude=True, title='density of its changes'
        ),
    )

    @classmethod
    def example(cls) -> Effect:
        """Return motion by hand: 100 (deg/s^2)^2/s."""
        return cls({'q': 100 * DEG ** 2})

    @classmethod
    def guesses(cls, look: Look) -> list[Effect]:
        """Return bandwidths (q/(R dt))^(1/4)/2 pi from a hundredth to a fifth of the rate."""
        return [cls({'q': x ** 4 * look.r / look.dt ** 3}) for x in np.geomspace(0.003, 1.0, 8)]

    def block(self, dt: float) -> Block:
        """Return the doubly integrated white noise."""
        q = self['q'] * np.array([[dt ** 3 / 3, dt ** 2 / 2], [dt ** 2 / 2, dt]])
        return _integrator([[1, dt], [0, 1]], q, (100 * DEG) ** 2)


class Switched(Motion):
    """What drives the rate changes: a subclass says from what to what."""

    jumps = True
    smooth = True

    def switching(self) -> Switching:
        """Return the modes."""
        raise NotImplementedError

    def block(self, dt: float) -> Block:
        """Return rate and acceleration, driven by a density of one, and what switches."""
        return replace(AngularAcceleration({'q': 1.0}).block(dt), switching=self.switching())


class AnyMotion(Switched):
    """
    The bank that ``auto`` runs: any motion, from rest to impacts.

    One fixed setting; a share REST of the changes of mode leads to rest.

    """

    name = 'any_motion'
    symbol = 'm'
    every = True
    heals = 'autocorrelation'
    search = float(np.log(len(WANDER) + len(ACCELERATION)))
    title = 'any motion'
    equation = 'x driven by one of fourteen densities, from rest to impacts, that take turns'
    signature = 'innovations whose size and correlation change from stretch to stretch'
    hint = 'hands, legs, vehicles: filter with --motion auto, which runs this bank'
    reference = 'Blom, Bar-Shalom 1988'

    def switching(self) -> Switching:
        """Return rest, jumps, and accelerations by one ratio."""
        count = len(WANDER) + len(ACCELERATION)
        prior = REST, *[(1 - REST) / (count - 1)] * (count - 1)
        return Switching(tuple(q * DEG ** 2 for q in WANDER),
                         tuple(q * DEG ** 2 for q in ACCELERATION),
                         prior, 1 / (SOJOURN * (1 - REST)))


class Law(Motion):
    """
    What a bank of random walks does not know of a motion: a rival of effects, not one by itself.

    Its density lies between those of the bank, its acceleration dies out, the rate comes back to
    zero, and what drives them grows with them. What a bank loses by that grows with motion, as
    what it loses by samples off their time does.

    """

    jumps = True
    title = 'a law of the motion'
    parameters = (
        Parameter('size', '1', 0.3, 3.3, title='of the densities, over those of the bank'),
        Parameter('share', '1/s', 1e-3, 1e3, title='by which the density grows with a^2'),
        Parameter('decay', '1/s', 1e-3, 1e3, title='of the acceleration'),
        Parameter('spring', '1/s^2', 1e-3, 1e5, title='that brings the rate back to zero'),
    )

    def block(self, dt: float) -> Block:
        """Return what the modes of a bank make of it."""
        return nothing(law=tuple(self[p.name] for p in self.parameters))


class StopAndGo(Switched):
    """Motion that stops and starts: the angular acceleration wanders, or all is at rest."""

    name = 'stop_and_go'
    symbol = 's'
    title = 'motion that stops and starts'
    equation = "x' = a, a' = white of density q while it moves; x' = 0 while it rests"
    signature = 'stretches of large innovations and of small ones, each longer than a moment'
    hint = 'hands, vehicles, robots: motion auto is made for it'
    reference = 'Ackerson, Fu 1970; Blom, Bar-Shalom 1988'
    heals = 'variance in time'
    search = 4.0
    parameters = (
        Parameter('q', '({slope})^2/s', 1e-10, 1e6, amplitude=True, title='density in motion'),
        Parameter('dwell', 's', 0.05, 1e3, title='how long motion, or rest, lasts'),
    )

    @classmethod
    def example(cls) -> Effect:
        """Return turns by hand, some seconds each."""
        return cls({'q': 1e4 * DEG ** 2, 'dwell': 5.0})

    @classmethod
    def guesses(cls, look: Look) -> list[Effect]:
        """Return bandwidths in motion from a hundredth to a third of the rate."""
        return [cls({'q': x ** 4 * look.r / look.dt ** 3, 'dwell': dwell})
                for x in (0.01, 0.05, 0.2, 0.8) for dwell in (0.5, 5.0)]

    def switching(self) -> Switching:
        """Return rest and motion, alike in length."""
        return Switching((WANDER[0] * DEG ** 2,), (self['q'],), (0.5, 0.5), 2 / self['dwell'])


class Jerk(Motion):
    """The angular jerk wanders: one integral more than angular_acceleration."""

    name = 'jerk'
    symbol = 'j'
    title = 'angular jerk'
    smooth = True
    equation = "x'' = j, j' = white of density q"
    signature = 'innovations that keep their sign while the angular acceleration changes'
    hint = 'smooth and strong motion, well above the noise'
    reference = 'Mehrotra, Mahapatra 1997'
    after = 'angular_acceleration'
    heals = 'autocorrelation'
    parameters = (
        Parameter(
            'q', '({slope})^2/s^3', 1e-12, 1e10, amplitude=True, title='density of its changes'
        ),
    )

    @classmethod
    def example(cls) -> Effect:
        """Return motion by hand: 1e4 (deg/s^3)^2/s."""
        return cls({'q': 1e4 * DEG ** 2})

    @classmethod
    def guesses(cls, look: Look) -> list[Effect]:
        """Return bandwidths (q/(R dt))^(1/6)/2 pi from a hundredth to a fifth of the rate."""
        return [cls({'q': x ** 6 * look.r / look.dt ** 5}) for x in np.geomspace(0.01, 1.0, 7)]

    def block(self, dt: float) -> Block:
        """Return the triply integrated white noise."""
        power = np.array(
            [
                [dt**5 / 20, dt**4 / 8, dt**3 / 6],
                [dt**4 / 8, dt**3 / 3, dt**2 / 2],
                [dt**3 / 6, dt**2 / 2, dt],
            ]
        )
        block = _integrator(
            [[1, dt, dt**2 / 2], [0, 1, dt], [0, 0, 1]], self['q'] * power, (100 * DEG) ** 2
        )
        block.p0[2, 2] = (1000 * DEG) ** 2
        return block


class Singer(Motion):
    """A manoeuvre: angular acceleration that lasts about tc (Gauss-Markov)."""

    name = 'singer'
    symbol = 'a'
    title = 'manoeuvre (Gauss-Markov acceleration)'
    smooth = True
    equation = "x' = a, a Gauss-Markov (sigma, tc)"
    signature = 'bursts of innovations of one sign, each about tc long'
    hint = 'turns that begin and end'
    reference = 'Singer 1970; Bar-Shalom, Li, Kirubarajan 2001, 8.2.3'
    heals = 'autocorrelation'
    parameters = (
        Parameter('sigma', '{slope}', 1e-6, 1e3, amplitude=True, title='standard deviation of it'),
        Parameter('tc', 's', 0.02, 100.0, title='how long it lasts'),
    )

    @classmethod
    def example(cls) -> Effect:
        """Return turns by hand: 50 deg/s^2 for half a second."""
        return cls({'sigma': 50 * DEG, 'tc': 0.5})

    @classmethod
    def guesses(cls, look: Look) -> list[Effect]:
        """
        Return manoeuvres of a few samples to many seconds.

        Of a fraction of the noise to far above it.

        """
        sizes = np.sqrt(look.r) * np.array([0.3, 3.0, 30.0])
        return [
            cls({'sigma': a / tc, 'tc': tc})
            for tc in (0.05, 0.3, 2.0, 10.0)
            for a in sizes
            if tc > 2 * look.dt
        ]

    def block(self, dt: float) -> Block:
        """Return the sampled form; its series where dt << tc and the closed one cancels."""
        sigma2, tc = self['sigma'] ** 2, self['tc']
        x = dt / tc
        e, one_less = np.exp(-x), -np.expm1(-x)
        q11 = -sigma2 * np.expm1(-2 * x)
        q01 = sigma2 * tc * one_less ** 2
        q00 = sigma2 * tc**2 * (2 * x**3 / 3 - x**4 / 2 if x < 1e-3 else 2 * x - 3 + 4 * e - e * e)
        return _integrator([[1, tc * one_less], [0, e]], [[q00, q01], [q01, q11]], sigma2)


class Harmonic(Oscillation, Motion):
    """Sway: an oscillation of the rate itself, slow enough to be motion."""

    name = 'harmonic'
    symbol = 's'
    title = 'sway'
    smooth = True
    equation = 'x = A cos(2 pi f t + phase)'
    signature = 'innovations oscillate at one slow frequency'
    hint = (
        'ships, cranes, a pendulum, a rocking table; above 3 Hz an oscillation is taken for'
        ' vibration (sinusoid)'
    )
    reference = 'Harvey 1989, 2.3.3'
    heals = 'autocorrelation'
    band = (0.02, 3.0)
    parameters = parameters(1e-6, band)

    @classmethod
    def example(cls) -> Effect:
        """Return the rocking of Qian et al. 2010 by 50 deg at 10 s."""
        return cls({'amplitude': 31.4 * DEG, 'frequency': 0.1, 'tc': 1e4})


class RateStep(Motion):
    """Now and then the rate jumps; between jumps the other motions hold."""

    name = 'rate_step'
    symbol = 'u'
    title = 'steps of the rate'
    equation = 'x_k = x_{k-1} + u_k, u_k normal (size) with probability rate dt, else 0'
    signature = 'a train of innovations of one sign after each jump, dying out'
    hint = 'a rate table or a stepper motor; a shock that moved the bias'
    reference = 'Willsky, Jones 1976'
    heals = 'kurtosis'
    jumps = True
    search = 4.0
    parameters = (Parameter('size', '{rate}', 1e-6, 1e2, amplitude=True, title='rms of a step'),
                  Parameter('rate', 'Hz', 1e-4, 10.0, title='steps in a second'))

    @classmethod
    def example(cls) -> Effect:
        """Return a step of 30 deg/s every ten seconds."""
        return cls({'size': 30 * DEG, 'rate': 0.1})

    @classmethod
    def guesses(cls, look: Look) -> list[Effect]:
        """
        Return steps of two to two hundred times the noise.

        From twice in a minute to twice a second.

        """
        if not look.tails:
            return []
        return [
            cls({'size': k * np.sqrt(look.r), 'rate': rate})
            for k in (2, 6, 20, 60, 200)
            for rate in (0.03, 0.2, 2.0)
        ]

    def block(self, dt: float) -> Block:
        """Return what a bank of two makes of it: with and without a jump in this interval."""
        return nothing(step=(min(0.5, self['rate'] * dt), self['size'] ** 2))
