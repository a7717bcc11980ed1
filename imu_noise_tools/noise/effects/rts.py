# Copyright 2026 imu_noise_tools maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Random telegraph signal: popcorn noise."""

import numpy as np

from ..grid import grid_step
from ..kinds import Defect, Parameter, Spectrum
from ... import ar1
from ...effect import Estimate, Finding


class Rts(Spectrum, Defect):
    """The bias jumps back and forth between two levels, dwelling tau on average in each."""

    name = 'rts'
    symbol = 'step, tau'
    title = 'random telegraph signal (popcorn noise)'
    equation = (
        'two levels, step apart, mean dwell tau: the spectrum of a Gauss-Markov process with '
        'sigma = step/2, Tc = tau/2'
    )
    signature = (
        'block means have two humps; the Allan deviation bumps as for a Gauss-Markov process, '
        'which has one hump'
    )
    hint = (
        'A defect in the semiconductor traps and frees a charge. It belongs to the unit: compare '
        'another one. Averaging helps only beyond many dwell times.'
    )
    reference = 'Machlup, Noise in semiconductors: spectrum of a two-parameter random signal, 1954'
    views = ('frequency', 'time')
    decide = 'record longer, so that dozens of switches are in it'
    parameters = (
        Parameter('step', '{rate}', 1e-12, 1e3, amplitude=True, title='distance of the levels'),
        Parameter('tau', 's', 1e-4, 1e6, title='mean dwell in a level'),
    )

    @classmethod
    def statistics(cls, y, inputs):
        """
        Keep the two-level fit to block means and what it gains over one level.

        For block lengths 1, 2, 4 ...

        """
        step, _ = grid_step(y)
        if (
            step > 0
        ):  # levels of the output are none of the sensor: a triangular dither smooths them away
            y = y + step * (np.random.default_rng(0).random((2, len(y))).sum(axis=0) - 1)
        rows = []
        length = 1
        while len(y) // length >= 128 and length <= 1 << 16:
            rows.append(_two_levels(y, length, inputs.dt))
            length *= 2
        return {'scales': np.array(rows).reshape(-1, 6)}

    def find(self, evidence):
        """
        Find the block length at which two levels gain most.

        It is counted in dwells, not in samples.

        """
        kept = evidence.kept(self.name)
        if not kept:
            return None
        rows = kept['scales']
        good = rows[
            (rows[:, 5] > 4) & (rows[:, 1] > 0) & (rows[:, 2] > 3 * rows[:, 0] * evidence.dt)
        ]
        if not len(good):
            return None
        best = good[np.argmax(good[:, 4])]
        length, step, tau, spread, gain, switches = best
        if not gain > 0 or step < 2 * spread:
            return None
        effect = self.with_values(step=float(step), tau=float(tau))
        error = float(spread / np.sqrt(max(switches, 1)) + 0.01 * step)
        dwell = float(tau / np.sqrt(max(switches, 1)))
        return Finding(
            self.name,
            float(gain),
            effect,
            {
                'step': Estimate(
                    float(step), error, (float(step - 1.96 * error), float(step + 1.96 * error))
                ),
                'tau': Estimate(
                    float(tau),
                    dwell,
                    (float(max(tau - 1.96 * dwell, 0)), float(tau + 1.96 * dwell)),
                ),
            },
            view='frequency',
            evidence=f'means of {length * evidence.dt:.3g} s stand on two levels '
            f'{step / spread:.1f} standard deviations apart, {int(switches)} switches',
        )

    def psd(self, f, dt):
        """Return the AR(1) spectrum."""
        return ar1.psd(f, self['step'] / 2, self['tau'] / 2, dt)

    def avar(self, m, dt):
        """Return that of the Gauss-Markov process of the same spectrum."""
        return ar1.avar(m, self['step'] / 2, self['tau'] / 2, dt)

    def state_space(self, dt):
        """One decaying state of the same spectrum."""
        q = ar1.innovation_variance(self['step'] / 2, self['tau'] / 2, dt)
        return np.array([[ar1.phi(dt, self['tau'] / 2)]]), np.array([[q]]), np.ones((1, 1))

    def apply(self, x, inputs, rng):
        """Add two levels that switch with probability (1 - e^(-2 dt/tau))/2 a sample."""
        flip = rng.random(len(x)) < -0.5 * np.expm1(-2 * inputs.dt / self['tau'])
        flip[0] = rng.random() < 0.5
        return x + self['step'] * (np.cumsum(flip) % 2 - 0.5)

    @classmethod
    def example(cls):
        """10 deg/h, a few seconds."""
        return cls({'step': 2e-3, 'tau': 8.0})


def _two_levels(y, length, dt):
    """Return (length, step, tau, spread, gain, switches) of a two-level fit to block means."""
    count = len(y) // length
    z = y[: count * length].reshape(count, length).mean(axis=1) if length > 1 else y
    z = z - _slow_part(z)
    scale = np.std(z)
    none = (length, 0.0, 0.0, 0.0, 0.0, 0.0)
    if not scale > 0:
        return none
    edges = np.linspace(-5, 5, 201)
    cells = np.histogram(z / scale, 200, (-5, 5))[0].astype(float)  # even cells need no sorting
    x = 0.5 * (edges[1:] + edges[:-1])
    total = cells.sum()
    mean = cells @ x / total
    var = cells @ (x - mean) ** 2 / total
    one = cells @ (-0.5 * (x - mean) ** 2 / var - 0.5 * np.log(var))
    a, b, s2, share = mean - np.sqrt(var) * 0.8, mean + np.sqrt(var) * 0.8, 0.3 * var, 0.5
    for _ in range(60):
        pa = share * np.exp(-0.5 * (x - a) ** 2 / s2)
        pb = (1 - share) * np.exp(-0.5 * (x - b) ** 2 / s2)
        r = pa / np.maximum(pa + pb, 1e-300)
        wa, wb = cells @ r, cells @ (1 - r)
        if min(wa, wb) < 4:
            return none
        a, b = cells @ (r * x) / wa, cells @ ((1 - r) * x) / wb
        s2 = max((cells @ (r * (x - a) ** 2) + cells @ ((1 - r) * (x - b) ** 2)) / total, 1e-4)
        share = wa / total
    two = cells @ (
        np.log(
            np.maximum(
                share * np.exp(-0.5 * (x - a) ** 2 / s2)
                + (1 - share) * np.exp(-0.5 * (x - b) ** 2 / s2),
                1e-300,
            )
        )
        - 0.5 * np.log(s2)
    )
    # switches with hysteresis: a level counts when it is nearer than a quarter of the distance
    low, high = a + 0.25 * (b - a), b - 0.25 * (b - a)
    state = np.where(z / scale < low, -1, np.where(z / scale > high, 1, 0))
    state = state[state != 0]
    switches = int(np.count_nonzero(np.diff(state)))
    if switches < 1:
        return none
    tau = count * length * dt / switches
    # samples within a dwell repeat each other: only the dwells are independent
    independent = min(count, 2.0 * switches)
    return (
        length,
        (b - a) * scale,
        tau,
        float(np.sqrt(s2)) * scale,
        (two - one) / total * independent - 3.0,
        switches,
    )


def _slow_part(z):
    """
    Return a smooth curve through z, far slower than anything that switches often.

    Means of 12 stretches, interpolated.

    """
    k = 12
    if len(z) < 8 * k:
        return np.mean(z)
    edges = np.linspace(0, len(z), k + 1).astype(int)
    sums = np.concatenate([[0.0], np.cumsum(z)])
    means = (sums[edges[1:]] - sums[edges[:-1]]) / np.diff(edges)
    return np.interp(np.arange(len(z)), 0.5 * (edges[1:] + edges[:-1]), means)
