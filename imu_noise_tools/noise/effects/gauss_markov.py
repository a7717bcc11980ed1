# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""First-order Gauss-Markov process: exponentially correlated noise."""

import numpy as np

from ..evidence import Evidence
from ..kinds import Inputs, Parameter, Spectrum, StateSpace
from ...core import gauss_markov
from ...loop.effect import Effect


class GaussMarkov(Spectrum):
    """Exponentially correlated noise, sampled as AR(1) and stationary from the start."""

    name = 'gauss_markov'
    symbol = 'sigma, Tc'
    title = 'Gauss-Markov (exponentially correlated) noise'
    equation = (
        'S(f) = 2 sigma^2 Tc/(1 + (2 pi f Tc)^2) (two-sided), '
        'sigma^2(tau) = (2 sigma^2 Tc/tau) [1 - (Tc/2tau)(3 - 4 e^(-tau/Tc) + e^(-2tau/Tc))]'
    )
    signature = (
        'a smooth bump in the Allan deviation, peak at 1.893 Tc; a shoulder in the PSD without a '
        'line'
    )
    hint = (
        'A control loop, a regulator, a fan or slow internal temperature regulation. If two '
        'levels show in the time series it is rts, if a line shows in the spectrum a sinusoid.'
    )
    reference = 'IEEE 952 C.1.5'
    several = True
    must_be_normal = True
    broad = True
    decide = 'record ten times longer than its correlation time takes to show, on another supply'
    alike = 'relaxation'
    parameters = (
        Parameter('sigma', '{rate}', 1e-12, 1e3, amplitude=True, title='standard deviation'),
        Parameter('tc', 's', 1e-4, 1e6, title='correlation time'),
    )

    def starts(self, evidence: Evidence) -> list[Effect]:
        """
        Start from correlation times that the record can show.

        From two samples to a fifth of its length.

        """
        if 'tc' in self.values:
            return super().starts(evidence)
        shortest, longest = 2 * evidence.dt, evidence.n * evidence.dt / 5
        return [
            self.with_values(sigma=1.0, tc=float(tc)) for tc in np.geomspace(shortest, longest, 7)
        ]

    def bounds(self, evidence: Evidence) -> dict[str, tuple[float, float]]:
        """Below the interval it is white noise, beyond the record a random walk."""
        return {'tc': (evidence.dt, evidence.duration)}

    @property
    def knees(self) -> int:
        """Two: how high, and where."""
        return 2

    def psd(self, f: np.ndarray, dt: float) -> np.ndarray:
        """Return the AR(1) spectrum."""
        return gauss_markov.psd(f, self['sigma'], self['tc'], dt)

    def avar(self, m: np.ndarray, dt: float) -> np.ndarray:
        """Return the closed form of the sampled process."""
        return gauss_markov.avar(m, self['sigma'], self['tc'], dt)

    def state_space(self, dt: float) -> StateSpace | None:
        """One decaying state."""
        return gauss_markov.state_space(self['sigma'], self['tc'], dt)

    def apply(self, x: np.ndarray, inputs: Inputs, rng: np.random.Generator) -> np.ndarray:
        """Add the recursion, started stationary."""
        from scipy.signal import lfilter  # half a second to load

        w = rng.standard_normal(len(x)) * np.sqrt(
            gauss_markov.innovation_variance(self['sigma'], self['tc'], inputs.dt)
        )
        w[0] = self['sigma'] * rng.standard_normal()
        return x + lfilter([1.0], [1.0, -gauss_markov.phi(inputs.dt, self['tc'])], w)

    @classmethod
    def example(cls) -> Effect:
        """Return one whose Allan deviation peaks at 19 s, of 8.3 deg/h (4e-5 rad/s)."""
        return cls({'sigma': 4e-5, 'tc': 10.0})
