# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Held samples: the same value is sent again."""

import numpy as np

from ..evidence import Evidence
from ..kinds import Defect, Inputs, Parameter, Response
from ...core.statistics import interval, repeats
from ...loop.effect import Effect, Estimate, Finding


class Duplicates(Defect, Response):
    """
    A share of the samples repeats the one before.

    The sensor is read faster than it measures, or a message is sent twice.

    """

    name = 'duplicates'
    symbol = 'fraction'
    title = 'repeated samples'
    equation = (
        'gain^2, scaled to 1 at f = 0: held at random (1-p)^2/(1-2p cos w+p^2); always r times '
        'the squared Dirichlet kernel of r = 1/(1-p) samples'
    )
    signature = (
        'neighbours are exactly equal more often than noise and resolution allow; power falls '
        'towards Nyquist'
    )
    hint = (
        'The bus or the driver is read faster than the sensor updates: lower the publishing rate '
        "to the sensor's, or read on its data-ready interrupt. N as fitted here holds at low "
        'frequencies.'
    )
    reference = 'sample and hold: Oppenheim and Schafer, Discrete-Time Signal Processing'
    views = ('frequency', 'time', 'distribution', 'variance')
    mutes = ('distribution', 'variance')  # whitened, held samples are neither normal nor steady
    last = True
    decide = 'read the sensor at its own rate'
    parameters = (
        Parameter('fraction', '1', 1e-6, 0.99, amplitude=True, title='share of repeated samples'),
        Parameter.choice('pattern', ('random', 'regular'),
                         title='runs of any length, or always of the same', formerly='regular'),
    )

    @classmethod
    def statistics(cls, y: np.ndarray, inputs: Inputs) -> dict[str, np.ndarray]:
        """
        Keep the share of equal neighbours and what chance gives.

        Kept too is whether the runs have one length.

        """
        fraction, expected, held = repeats(y)
        out = {
            'fraction': np.array(fraction),
            'expected': np.array(expected),
            'regular': np.array(0.0),
            'held': np.array(held),
            'n': np.array(len(y)),
        }
        if not held:
            return out
        same = np.diff(y) == 0
        edges = np.flatnonzero(np.concatenate([[True], ~same, [True]]))
        runs = np.diff(edges)[1:-1]
        if len(runs) > 10:
            counts = np.bincount(np.minimum(runs, 50))
            out['regular'] = np.array(
                float(counts.argmax() > 1 and counts.max() > 0.9 * len(runs))
            )
        return out

    def find(self, evidence: Evidence) -> Finding | None:
        """Test for more equal neighbours than a Poisson count of the expected ones allows."""
        kept = evidence.kept(self.name)
        if not kept or not kept['held']:
            return None
        n, seen, chance = int(kept['n']), float(kept['fraction']), float(kept['expected'])
        share = (seen - chance) / (1 - chance)
        # likelihood ratio of the binomial count of equal neighbours
        q = min(max(chance, 0.5 / n), 0.999)
        gain = n * (seen * np.log(seen / q) + (1 - seen) * np.log(max(1 - seen, 1e-12) / (1 - q)))
        std = float(np.sqrt(seen * (1 - seen) / n))
        effect = self.with_values(fraction=share, pattern=float(kept['regular']))
        return Finding(
            self.name,
            float(gain),
            effect,
            {
                'fraction': Estimate(share, std, interval(share, std, positive=True)),
                'pattern': Estimate(effect['pattern'], None, None),
            },
            evidence=f'{100 * seen:.3g} % of neighbours are exactly equal, {100 * chance:.2g} % '
            'would be by rounding',
        )

    def gain2(self, f: np.ndarray, dt: float) -> np.ndarray:
        """Return the squared gain on white noise, scaled to 1 at zero frequency."""
        p, w = self['fraction'], 2 * np.pi * np.asarray(f, float) * dt
        if self.chosen('pattern') == 'regular':
            r = 1 / max(1 - p, 1e-6)
            return np.maximum((np.sin(r * w / 2) / (r * np.sin(w / 2))) ** 2, 1e-9)
        return (1 - p) ** 2 / ((1 - p) ** 2 + p * (2 * np.sin(w / 2)) ** 2)

    def crowd(self) -> float:
        """
        Return the scatter of sums of products of two white axes held together, whitened.

        A run of L samples holds one product with the weight 1 + p^2 + (L-1)(1-p)^2, L geometric,
        and two of neighbouring runs with p; as many independent samples would have (1-p)(1+p)^2.

        """
        p = self['fraction']
        if self.chosen('pattern') == 'regular':
            return 1 / max(1 - p, 1e-6)
        return ((1 + p) ** 2 + p * (1 - p) ** 2 + 2 * p * p) / ((1 - p) * (1 + p) ** 2)

    def apply(self, x: np.ndarray, inputs: Inputs, rng: np.random.Generator) -> np.ndarray:
        """Hold samples, at random or always the same number of times."""
        n = len(x)
        if self.chosen('pattern') == 'regular':
            r = int(round(1 / (1 - self['fraction'])))
            return x[np.arange(n) // r * r]
        fresh = rng.random(n) >= self['fraction']
        fresh[0] = True
        return x[np.maximum.accumulate(np.where(fresh, np.arange(n), 0))]

    @classmethod
    def example(cls) -> Effect:
        """Every fifth sample is a repeat."""
        return cls({'fraction': 0.2, 'pattern': 'random'})
