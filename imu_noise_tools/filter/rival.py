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
from ..loop.effect import Model

SIZES = 0.5, 2.0
NONE = {'size': 1.0, 'share': 1e-3, 'decay': 1e-3, 'spring': 1e-3}
LAWS = ({'decay': 5.0}, {'decay': 25.0}, {'decay': 25.0, 'spring': 300.0})
SHARES = 4.0, 32.0
SEEN = {'share': 0.3, 'decay': 1.0, 'spring': 10.0}     # from which on a climb feels them
# what a candidate keeps of its gain, nats and share, where laws need not be climbed
SURE = 100.0
MOST = 0.5
FAR = 500.0             # nats; a climb of laws gained up to 210 over the best of a few
AGAIN = 3               # times that the bank may learn from the law beside a candidate


class Beside:
    """The gains of candidates beside a bank (``model``, with values) that may learn a law."""

    def __init__(self, model: Model, stated: Mapping, evaluate: Likelihood):
        self.stated, self.evaluate = stated, evaluate
        law = Law(NONE, 'law')
        self.model, self.value = self._best(
            model + law, [{}, *({'size': v} for v in SIZES)])
        self.model, self.value = self._best(self.model, [
            {}, *LAWS, *({'share': v, **some} for v in SHARES for some in ({}, *LAWS))])
        self.model, self.value = self._best(self.model, [{}, *({'size': v} for v in SIZES)])
        self._climbed = False

    def gain(self, model: Model, gain: float, penalty: float) -> float:
        """
        Return what a candidate gains, nats, where ``model`` (with it, and values) gained ``gain``.

        With a law of a few, the best without it; where the effect keeps less than most of its gain
        so, laws and values are climbed. The law beside the effect may serve the bank alone, too:
        that is climbed from there as well.

        """
        begun = [model + self.model['law']]
        if self.evaluate(begun)[0] - self.value > min(max(SURE, MOST * gain), FAR):
            return gain
        if not self._climbed:
            law = self.model['law']
            self._climb(law.with_values(**{k: max(v, law[k]) for k, v in SEEN.items()}))
            self._climbed = True
        known = model.with_values({e.label: e.values for e in self.model}) + self.model['law']
        begun.append(known)     # its own values: far from them it is something else
        best = begun[int(np.argmax(self.evaluate(begun)))]
        best, value = maximise(best, self.stated, self.evaluate, self.value + penalty)
        for _ in range(AGAIN):
            if value - self.value <= penalty or not self._climb(best['law']):
                break
        return float(np.clip(value - self.value, 0.0, gain))

    def _climb(self, law: Any) -> bool:
        """Let the bank learn from a law on; tell whether that is better than what it knew."""
        model, value = maximise(self.model.with_effect(law), self.stated, self.evaluate)
        better = value > self.value + 1.0
        if value > self.value:
            self.model, self.value = model, value
        return better

    def _best(self, model: Model, laws: list[dict[str, float]]) -> tuple[Model, float]:
        """Return a model with the best of a few laws, and its log-likelihood."""
        tried = [model.with_effect(model['law'].with_values(**some)) for some in laws]
        value = self.evaluate(tried)
        best = int(np.argmax(value))
        return tried[best], float(value[best])
