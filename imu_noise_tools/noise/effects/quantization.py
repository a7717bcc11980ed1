# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Quantization of the angle or velocity."""

from collections.abc import Callable

import numpy as np

from ..descent import minimise
from ..evidence import Evidence
from ..kinds import Inputs, Parameter, Spectrum, StateSpace
from ..likelihood import Likelihood
from ..rounded import coarse, colour_of_turns, told_by_grid, turns_of_counts
from ...core.statistics import grid_step, quiet_sigma
from ...loop.effect import Effect, Fit

FINER = 2.0  # times: from which steps are finer than counts, dithered or not
QUICK = 1 << 16     # samples whose differences say whether a step is large
SWINGS = 0.2    # of the first wave of an error, that two samples have in common: it is no noise
LEAST = 1e-3    # of white: what is told of the colour is not exact


class Quantization(Spectrum):
    """Q: the angle is read to a finite step, so the rate holds differenced white noise."""

    name = 'quantization'
    symbol = 'Q'
    title = 'quantization noise (of the angle)'
    equation = 'S(f) = (4 Q^2/tau0) sin^2(pi f tau0) (two-sided), sigma^2(tau) = 3 Q^2/tau^2'
    signature = 'slope -1 in the Allan deviation; PSD rising as f^2 up to Nyquist'
    hint = (
        'The output is an angle or velocity increment that is read to a finite step (ring laser '
        'and fibre-optic gyroscopes). A step in the *rate* is something else: rate_quantization, '
        'which is white.'
    )
    reference = 'IEEE 952 C.1.2'
    broad = True
    decide = 'record at another output rate: quantization of the angle scales with it'
    parameters = (
        Parameter('Q', '{integral}', 1e-14, 1e2, amplitude=True, title='angle quantization'),
    )
    filtered = False
    explains = ('grid',)
    mutes = ('distribution', 'variance')  # samples on a coarse grid are not normal

    @classmethod
    def statistics(cls, y: np.ndarray, inputs: Inputs) -> dict[str, np.ndarray]:
        """
        Keep the step of the rate's grid, which is that of the angle over dt, and the noise.

        And the colour that the error has where the angle turns by little of a step in a sample.

        """
        step, _ = grid_step(y)
        sigma, told = quiet_sigma(y, step)
        out = {'step': np.array(step), 'sigma': np.array(sigma), 'told': np.array(told)}
        if step > 0 and np.mean(np.diff(y[:QUICK]) ** 2) < step**2:
            turned, mean = turns_of_counts(y, step)
            out['colour'] = colour_of_turns(turned, mean)
            if len(turned):
                out['turned'] = np.array(turned[0])
        return out

    def colour(self, evidence: Evidence,
               part: str = 'whole') -> Callable[[np.ndarray], np.ndarray] | None:
        """Return the spectrum of the angle's error over that of a white one, a function of Hz."""
        r = evidence.kept(self.name).get('colour', np.ones(1))
        if len(r) == 1:
            return None
        s = np.fft.rfft(np.append(r, np.zeros(15 * len(r)))).real * 2 - 1
        at = np.linspace(0, 0.5 / evidence.dt, len(s))
        return lambda f: np.interp(f, at, np.maximum(s, LEAST))

    def hides_loudness(self, evidence: Evidence) -> bool:
        """
        Where the angle turns by little of a step in a sample.

        The error is then a swing, whose power goes with where the mean stands.

        """
        turned = float(evidence.kept(self.name).get('turned', np.inf))
        return bool(np.exp(-2 * np.pi**2 * turned) > SWINGS)

    def otherwise(self, evidence: Evidence, fit: Fit, claim: float) -> str:
        """
        Say that an accelerometer's samples lie on finer steps than whole counts of velocity do.

        A gyroscope's may, where its dither is taken out of them; an accelerometer has none, and
        what rises so with frequency is a vibration.

        """
        step = float(evidence.kept(self.name).get('step', 0.0))
        count = np.sqrt(12) * self['Q'] / evidence.dt
        if evidence.sensor != 'accel' or not 0 < FINER * step < count:
            return ''
        return (f'whole counts of velocity would lie on steps of {count:.2g} m/s^2 at this rate, '
                f'and the samples lie on steps of {step:.2g}: what rises so with frequency is '
                'something else, as a vibration')

    def bonus(self, evidence: Evidence, fit: Fit) -> float:
        """
        Count the grid too, less what the spectrum loses by the Q that an angle read to it has.

        Something else that is missing may draw Q away from that.

        """
        kept = evidence.kept(self.name)
        gain = told_by_grid(kept, evidence.n)
        if not gain:
            return 0.0
        step = float(kept['step'])
        wanted = step * evidence.dt / np.sqrt(12)
        # a dithered one has sqrt(2) of it; errors of noise that spans no step go together
        least = 0.7 if coarse(step, float(kept['sigma'])) else 1.0
        near = float(np.clip(self['Q'], least * wanted, 2.0 * wanted))
        if near == self['Q']:
            return gain
        # both on what the fit explains: with all of the spectrum either could come out the better
        here, moved = (Likelihood(evidence, 'whole', model, explained=fit.details.basis)
                       for model in (fit.model, fit.model.with_effect(self.with_values(Q=near))))
        at, x0 = (np.array([s.to_search(x.model[s.label][s.parameter.name]) for s in x.slots])
                  for x in (here, moved))
        free = np.array([s.label != self.label for s in moved.slots])
        lost = minimise(moved, x0, free=free, enough=1e-3)[1] - here.value(at)[0]
        return gain - min(max(lost, 0.0), gain)

    def psd(self, f: np.ndarray, dt: float) -> np.ndarray:
        """2 Q^2 s^2/dt, s = 2 sin(pi f dt)."""
        return 2 * self['Q'] ** 2 * (2 * np.sin(np.pi * np.asarray(f) * dt)) ** 2 / dt

    def avar(self, m: np.ndarray, dt: float) -> np.ndarray:
        """3 Q^2/tau^2."""
        return 3 * self['Q'] ** 2 / (np.asarray(m) * dt) ** 2

    def state_space(self, dt: float) -> StateSpace | None:
        """Two states: this and the last reading's error, (e_k - e_{k-1})/dt with e ~ N(0, Q^2)."""
        return (
            np.array([[0.0, 0.0], [1.0, 0.0]]),
            np.diag([self['Q'] ** 2, 0.0]),
            np.array([[1.0, -1.0]]) / dt,
        )

    def apply(self, x: np.ndarray, inputs: Inputs, rng: np.random.Generator) -> np.ndarray:
        """Add the difference of white angle errors."""
        e = rng.standard_normal(len(x) + 1) * self['Q']
        return x + np.diff(e) / inputs.dt

    @classmethod
    def example(cls) -> Effect:
        """Return a quantization of the angle of one arc second (4.8e-6 rad)."""
        return cls({'Q': 4.8e-6})
