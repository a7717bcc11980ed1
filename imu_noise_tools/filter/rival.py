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
NEAR_TOP = 0.5          # nats to which its law is climbed


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
        self._hoped = np.inf    # what was hoped for when the bank last learnt by itself

    def gain(self, model: Model, gain: float, penalty: float, rival: float = 0.0) -> float:
        """
        Return what a candidate gains, nats, where ``model`` (with it, and values) gained ``gain``.

        With a law of a few, the best without it; where the effect keeps less than most of its gain
        so, laws and values are climbed: without the effect as long as it may fall to chance
        (``penalty``) so, with it as long as it may come near what a ``rival`` has beyond chance.
        The law beside the effect may serve the bank alone, too: climbed from there as well. What
        gained less than chance is weighed alike: a bank that claims too much for a motion leaves
        no room for what grows with it.

        """
        begun = [model + self.model['law']]
        most = gain if gain > penalty else np.inf   # of what was hidden there may be more
        if most == gain and (self.evaluate(begun)[0] - self.value
                             > min(max(SURE, MOST * gain), FAR)):
            return gain
        own = model.with_values({e.label: e.values for e in self.model})
        begun.append(own + self.model['law'])   # far from its own values it is something else
        hope = float(np.max(self.evaluate(begun))) - penalty
        if hope < self._hoped and self.value < self._hoped:
            self._hoped, law = hope, self.model['law']
            self._learn(law.with_values(**{k: max(v, law[k]) for k, v in SEEN.items()}), hope)
            begun.append(own + self.model['law'])
        best = begun[int(np.argmax(self.evaluate(begun)))]
        best, value = maximise(
            best, self.stated, self.evaluate, self.value + penalty + rival, NEAR_TOP)
        if value - self.value > penalty + rival:
            self._learn(best['law'], value - penalty)
        return float(np.clip(value - self.value, 0.0, most))

    def _learn(self, law: Any, hope: float) -> None:
        """Let the bank learn from a law on, as long as it may come to what is hoped for."""
        model, value = maximise(
            self.model.with_effect(law), self.stated, self.evaluate, hope, NEAR_TOP)
        if value > self.value:
            self.model, self.value = model, value

    def _best(self, model: Model, laws: list[dict[str, float]]) -> tuple[Model, float]:
        """Return a model with the best of a few laws, and its log-likelihood."""
        tried = [model.with_effect(model['law'].with_values(**some)) for some in laws]
        best = tried[int(np.argmax(self.evaluate.parts()(tried)))]
        return best, float(self.evaluate([best])[0])
