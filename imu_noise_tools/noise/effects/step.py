# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A step of the bias."""

import numpy as np

from ..evidence import Evidence
from ..kinds import Inputs, Mean, Parameter
from ..lines import waves
from ...loop.effect import Effect

REACHES, PEAKS = (64, 256, 1024), 8   # means of such parts of the record are compared; the largest
BESIDE, FINER = 4, 8    # slow means on either side of those, and of the best of them
WITHIN = np.outer([-1.0, 1.0], [0.75, *0.5 ** np.arange(1.0, 7.0)])  # of a mean
BLURRED = 1.5   # samples in a mean from which it is one of several


class Step(Mean):
    """The bias jumps once and stays."""

    name = 'step'
    symbol = 'size, time'
    title = 'step of the bias'
    equation = 'mean = size for t >= time'
    signature = (
        'two flat parts of the time series with a jump between them; once, not back and forth '
        '(that is rts)'
    )
    hint = (
        'A knock, a change of supply or range, a thermal stress released. Look at what happened '
        'at that time; record again, and analyse the stretches before and after by themselves.'
    )
    reference = 'Basseville and Nikiforov, Detection of Abrupt Changes, 1993'
    several = True
    decide = 'record again: a step does not come back at the same time'
    parameters = (
        Parameter('size', '{rate}', -1e3, 1e3, log=False, amplitude=True, linear=True,
                  title='height of the step'),
        Parameter('time', 's', 0.0, 1e7, log=False, discrete=True,
                  title='when, from the beginning of the record'),
    )

    def starts(self, evidence: Evidence) -> list[Effect]:
        """
        Start at every 256th part of the record.

        The starts are finer around the largest contrasts of neighbouring means: of several steps
        each is tried, for beside another none may be seen from nearby.

        """
        t, lines = evidence.slow_t, evidence.line_table
        grid = np.linspace(t[0], t[-1], 258)[2:-2]
        # what swings from one mean to the next is no contrast that lasts
        swing = waves(lines, t, evidence.dt, evidence.common.slow_length)
        y = np.concatenate([[0.0], np.cumsum(evidence.slow_y - swing)])
        fine = []
        for reach in {max(4, len(t) // k) for k in REACHES}:
            i = np.arange(reach, len(t) - reach)
            contrast = np.abs(y[i + reach] - 2 * y[i] + y[i - reach])
            for _ in range(PEAKS if len(i) else 0):
                k = int(np.argmax(contrast))
                near = i[max(k - BESIDE, 0):k + BESIDE + 1]
                fine.append(t[near] - 0.5 * (t[1] - t[0]))
                contrast[max(k - reach, 0):k + reach] = -1.0
        return [self.with_values(time=float(x)) for x in np.unique(np.concatenate([grid, *fine]))]

    def finer(self, evidence: Evidence) -> list[Effect]:
        """Return the times around its own, as far as its edge is blurred, and within a mean."""
        t = evidence.slow_t
        width = float(t[1] - t[0])
        some = self['time'] + width * np.union1d(np.arange(-FINER, FINER + 1), WITHIN)
        return [self.with_values(time=float(x)) for x in some if t[0] < x < t[-1]]

    def columns(self, inputs: Inputs, time: float) -> np.ndarray:
        """0 before, 1 after; of means of blocks the one in which it falls has a part of it."""
        t = inputs.t
        width = (t[-1] - t[0]) / max(len(t) - 1, 1)
        if width < BLURRED * inputs.dt:
            return (t >= time).astype(float)[:, None]
        return np.clip((t - time) / width + 0.5, 0.0, 1.0)[:, None]

    @classmethod
    def example(cls) -> Effect:
        """Return a step of 20.6 deg/h (1e-4 rad/s) after 100 s."""
        return cls({'size': 1e-4, 'time': 100.0})
