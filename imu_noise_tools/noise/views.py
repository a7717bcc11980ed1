# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Ways to look at a record beside its model.

Under a true model pulls are standard normal, and a deviance is zero.

Each view returns a :class:`~imu_noise_tools.loop.effect.View`. ``frequency`` needs a fit; ``time``
predicts half of the block means from the other half; ``variance``, ``distribution`` and
``coherence`` compare the samples with what the model says of their stationarity, shape and
independence. ``frequency`` and ``coherence`` are in :mod:`~imu_noise_tools.noise.in_frequency`,
``time`` is in :mod:`~imu_noise_tools.noise.block_means`, ``variance`` in
:mod:`~imu_noise_tools.noise.in_time`, ``distribution`` in
:mod:`~imu_noise_tools.noise.in_samples`. Here is what they have in common.

"""

from __future__ import annotations

import numpy as np

from .evidence import claimed_lines, Evidence
from .kinds import Defect, Mean, NoiseEffect
from ..loop.effect import Fit, Model, View
from ..loop.verdict import tail

TIME_BLOCKS = 256   # block means of a record at most


def view_of(name: str, x: np.ndarray, pull: np.ndarray, excess: np.ndarray,
            variance: np.ndarray, unit: str, extra: float = 0.0) -> View:
    """
    Return the view of some bins (k,) at x, in a unit, with their pulls.

    Of the excess deviance of each and its variance, by chance; ``extra`` is that of their sum.

    """
    count = max(len(excess), 1)
    return View(name, np.asarray(x), np.asarray(pull), float(np.sum(excess)) / count,
                float(np.sqrt(np.sum(variance) + extra)) / count, unit)


def nothing(name: str, unit: str) -> View:
    """Return a view that can say nothing of this record and model."""
    return View(name, np.zeros(0), np.zeros(0), float('nan'), float('nan'), unit)


def hidden_by(evidence: Evidence, fit: Fit, view: str) -> bool:
    """
    Tell whether an effect that is there, and not in the model's name only, hides a view.

    A coarse grid does not hide the variance where the levels tell it.

    """
    if view == 'variance' and hides_loudness(evidence, fit.model):
        return True
    if view == 'variance' and evidence.unrounded.size:
        return False
    return any(view in e.hides and is_there(fit, e) for e in fit.model.of(NoiseEffect))


def hides_loudness(evidence: Evidence, model: Model) -> bool:
    """Tell whether how loud the samples are says nothing of the noise under an effect."""
    return any(e.hides_loudness(evidence) for e in model.of(NoiseEffect))


def muted_by(fit: Fit, view: str) -> bool:
    """Tell whether an effect that is there mutes a view."""
    return any(view in e.muting() and is_there(fit, e) for e in fit.model.of(NoiseEffect))


def is_there(fit: Fit, effect: NoiseEffect) -> bool:
    """Tell whether an effect does something in a fit, and is not in the model's name only."""
    there = any(effect[k] > 0 for k in effect.amplitudes)
    if there and not isinstance(effect, Defect):  # fitted, and never quite zero
        mine = fit.details.each.get(effect.label) if fit.details else None
        there = mine is None or bool(np.max(mine / fit.details.v) > 0.01)
    return there


def unclaimed(evidence: Evidence, model: Model) -> np.ndarray:
    """Return the power (b,), of the whole record, of the lines that the model does not hold."""
    return np.sum(evidence.whole.lines[lines_left(evidence, model)], axis=0)


def lines_left(evidence: Evidence, model: Model) -> list[int]:
    """Return rows of the line table that the model does not hold, strongest first."""
    mine = claimed_lines(evidence, model)
    return [i for i in range(len(evidence.line_table)) if i not in mine]


def slow_mean(evidence: Evidence, model: Model) -> np.ndarray:
    """Return what the model's effects on the mean say of the slow means (s,)."""
    inputs = evidence.slow_inputs
    return sum((m.mean(inputs) for m in model.of(Mean)), np.zeros(len(inputs.t)))


def p_value(view: View) -> float:
    """
    Return the chance that a true model shows as much excess.

    By a scaled chi-squared of the same mean and scatter.

    """
    return tail(view.excess, view.std) if len(view.pull) else 1.0
