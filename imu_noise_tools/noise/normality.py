# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Whether what an effect explains is normal noise: its block means in octaves, and how they differ.

Sums of many small things are normal on every scale, and go on all through the record. A path
between levels moves by jumps, and a course that axes have in common happens once.

"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeAlias

import numpy as np

from .block_means import followed, slow_rest
from .evidence import Evidence
from .kinds import Coupling, Defect, Mean, Modulation, Spectrum
from .nonlinear import follows_a_law
from .views import slow_mean
from ..core.statistics import independent_squares, kurtosis_pull
from ..loop.effect import Fit
from ..loop.verdict import FLEXIBLE, FLEXIBLE_SHARE, HEALED

#: of each octave, the narrowest first: differences of block means, how many are independent
Differences: TypeAlias = list[tuple[np.ndarray, float]]

COURSE_OF_AXES = 'what it explains is a course that axes have in common, and no noise'
# independent differences of block means: fewer tell no kurtosis; what comes in fewer pieces is a
# course and no noise
FEWEST = 64
# times FEWEST: a record with fewer differences of its shortest blocks cannot count pieces
MANY = 4


def not_normal(evidence: Evidence, fit: Fit, effect: Spectrum | Coupling, claim: float) -> str:
    """Say that what an effect explains is no normal noise, where it is to be."""
    if not effect.must_be_normal:
        return ''
    octaves = octaves_of(evidence, fit, effect)
    differences = differences_of(octaves)
    gain = uneven(differences)
    if gain > max(FLEXIBLE, FLEXIBLE_SHARE * claim):
        return f'what it explains is not normal noise, by {gain:.0f} nats'
    # where a path is seen, or noise is louder at times, the model says that it is not normal
    if not fit.model.of(Modulation) and not followed(evidence, fit):
        gain = follows_a_law(octaves)
        if gain > FLEXIBLE:     # however strong: of few values it would be as clear
            return f'what it explains follows a law that is no noise\'s, by {gain:.0f} nats'
    if isinstance(effect, Coupling) and (
            pieces(differences) < FEWEST or happens_once(differences)):
        return COURSE_OF_AXES
    return ''


def happens_once(differences: Differences) -> bool:
    """
    Tell whether what differences of block means hold is slow and over within a part of the record.

    All that warms up together does so: nearly all of it is in the slowest octave, and of that most
    in a twentieth of the record.

    """
    energy = [(2.0**k * float(np.sum(d**2)), d) for k, (d, _) in enumerate(differences)]
    if not energy:
        return False
    slowest, d = energy[-1]
    few = max(1, len(d) // 20)
    return slowest > HEALED * sum(x for x, _ in energy) \
        and np.sum(np.sort(d**2)[-few:]) > HEALED * np.sum(d**2)


def uneven(differences: Differences) -> float:
    """
    Return what speaks against normal noise on some time scale that an effect makes, nats.

    Sums of many small things are normal on every scale, a path between wells or levels is not: its
    differences of block means (Haar's wavelets) have heavy tails in the octaves in which it moves.
    Of those in which the effect has most of the power, the kurtosis, beyond chance.

    """
    return sum(0.5 * kurtosis_pull(difference, several) ** 2 - 0.5
               for difference, several in differences if several >= FEWEST)


def pieces(differences: Differences) -> float:
    """
    Return in how many independent pieces the energy of what an effect makes comes.

    Of a random walk they are some hundreds, the most that the widest differences of block means
    can be; of a course a dozen. Infinite where the record has too few differences to tell.

    """
    told = [(2.0**k * float(np.sum(difference**2)), several, len(difference))
            for k, (difference, several) in enumerate(differences)]
    energy, several, count = np.array(told).reshape(-1, 3).T
    if not len(told) or count[0] < MANY * FEWEST or not np.sum(energy) > 0:
        return np.inf
    return float(np.sum(energy) ** 2 / np.sum(energy**2 / several))


def differences_of(octaves: Iterable[np.ndarray]) -> Differences:
    """Return (differences, how many independent ones) of the block means of octaves."""
    some = (y[0::2] - y[1::2] for y in octaves)
    return [(difference, independent_squares(difference)) for difference in some]


def octaves_of(evidence: Evidence, fit: Fit, effect: Spectrum | Coupling) -> list[np.ndarray]:
    """Return block means of what an effect makes, in octaves in which it has most of the power."""
    e, model = evidence, fit.model
    # what those touch is in the block means, and what one axis has, a mean, levels, samples that
    # are held, others may have of their own
    own = any(d.screens() for d in model.of(Defect))
    if isinstance(effect, Coupling):
        own = own or bool(model.of(Mean)) or bool(model.of(Defect)) \
            or any(s.jumps and s.bonus(e, fit) > 0 for s in model.of(Spectrum))
    if own:
        return []
    rest, out = slow_rest(e, model), []
    y = slow_rest(e, model.minus(effect.label)) - rest if isinstance(effect, Coupling) \
        else rest - slow_mean(e, model)
    f = 1 / (2 * np.diff(e.slow_t[:2])[0])
    while len(y) >= 2 * FEWEST:
        y, f = y[:len(y) // 2 * 2], 0.5 * f
        mine = 1.0
        if isinstance(effect, Spectrum):
            mine = np.interp(f, e.whole.bins.f, fit.details.each[effect.label] / fit.details.v)
        if mine > 0.5:
            out.append(y)
        y = y.reshape(-1, 2).mean(axis=1)
    return out
