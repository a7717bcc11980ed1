# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What an effect gains beside a bank, beyond what the bank itself does not know of the motion.

A bank for any motion is coarse in each: no motion by hand is a random walk of the acceleration.
What it loses by that grows with the motion, and whatever grows alike seems to be missing. So each
candidate is weighed once more where the bank may learn a law of the motion (:class:`Law`) as well.

"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .fitting import Likelihood, maximise
from .motion import Law
from .statespace import Look
from ..loop.effect import Model

SHARES = 1e-3, 4.0, 32.0        # 1/s
# (decay 1/s, spring 1/s^2): none, of the acceleration alone, and as motion below some Hz has them
RETURNS = (1e-3, 1e-3), (5.0, 1e-3), (25.0, 1e-3), (8.0, 30.0), (25.0, 300.0)
MOST = 0.5  # share of its gain that a candidate keeps where laws need not be climbed


class Beside:
    """The gains of candidates beside a bank (``model``, with values) that may learn a law."""

    def __init__(self, model: Model, stated: Mapping, look: Look, evaluate: Likelihood):
        self.stated, self.look, self.evaluate = stated, look, evaluate
        self.model, self.coarse = self._start(model)
        self._fine: float | None = None

    def gain(self, model: Model, new: Any, gain: float, penalty: float) -> float:
        """
        Return what ``new`` gains, nats, where ``model`` (with it, and values) gained ``gain``.

        From a few laws, those of either best; where the effect keeps less than most of its gain
        so, laws and values are climbed.

        """
        after, value = self._start(model)
        if value - self.coarse > max(penalty, MOST * gain):
            return gain
        if self._fine is None:
            self.model, self._fine = maximise(self.model, self.stated, self.evaluate)
        known = after.with_values({e.label: e.values for e in self.model})
        begun = [after, known, *(known.with_effect(type(new)(dict(g.values), new.label))
                                 for g in type(new).guesses(self.look))]
        best = begun[int(np.argmax(self.evaluate(begun)))]
        hope = self._fine + penalty
        return min(gain, maximise(best, self.stated, self.evaluate, hope)[1] - self._fine)

    def _start(self, model: Model) -> tuple[Model, float]:
        """Return a model with the best of a few laws, and its log-likelihood."""
        tried = [model + Law({'share': s, 'decay': d, 'spring': k}, 'law')
                 for s in SHARES for d, k in RETURNS]
        value = self.evaluate(tried)
        best = int(np.argmax(value))
        return tried[best], float(value[best])
