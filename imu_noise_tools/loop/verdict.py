# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The one meaning of each word of a verdict, and the thresholds that these words rest on.

*fails*, *within chance*, *beyond chance*, *falls*, *sufficient*, *missing*, *unknown*, *complete*
and *undecidable* mean the same on the terminal, the page, the pictures, the nodes and in JSON,
because all of them ask here. Everything here is about plain numbers: no problem, no effect.

"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.special import chdtrc

#: probability from which one effect is named (doc/theory/loop.md)
SURE = 0.9
#: share of the probability from which another one is a rival
RIVAL = 0.02
#: family-wise level at which a test fails, by Holm 1979; on records in which nothing is hidden
#: ``python bench/hidden_effects.py --set none`` shows what it costs
LEVEL = 0.005
#: the same for the views of a held-out deviance, which is looked at beside those tests and
#: at every rung: of 210 axes with nothing hidden 1.0 % fail at 0.5 %, where coherence has a tail
#: of 2.9 % instead, and none of coherence at this level
HELD_OUT_LEVEL = 0.001
#: standard deviations up to which a held-out deviance is within chance
CHANCE = 2.0
#: standard errors from which one place of a view is named or marked; by chance 1 in 370 is
STRIKING = 3.0
#: deviance (three nats) by which a held-out deviance must fall to be more than chance:
#: one that is not there, and whose place nothing looks for, lowers it by as much in one case of a
#: hundred and fifty (``python bench/hidden_effects.py --set one`` adds one that is not there)
FALL = 6.0
#: nats by which a form must be better for each parameter more than an amplitude, so that of nested
#: names with equal gain the simpler one has 0.92 of the probability: e^2.5/(1 + e^2.5)
PRICE = 2.5
#: nats of a penalty that two of a kind pay once: a penalty is what chance exceeds in one axis of a
#: thousand, the many places that were looked at and ln 1000. Two that are looked for together have
#: as many places each, but are one answer to one question
ONCE = 6.9
#: nats of the odds for what nearly every sensor has, ten to one (a choice: who looks at a sensor
#: expects its flicker and its random walk before a relaxation that looks like them)
COMMON = 2.3
#: nats by which a form without a name must do better than a named one to refute it: of eight free
#: levels, once in a thousand (chi-squared/2), ...
FLEXIBLE = 13.0
#: the same of a single free parameter, with the same odds
DIRECTED = 6.0
#: ... or this share of what the named form gains, for no real sensor follows a formula for ever
FLEXIBLE_SHARE = 0.02
#: share of what a finding claims, or of what failed, by which the failing deviance must fall (a
#: choice, as the next: most of it)
HEALED = 0.5
#: times as much that fails elsewhere makes a finding a side of something else
SHADOW = 10.0
#: models whose candidates are fitted at least where something that was added has fallen
ANEW = 2
#: relative change of the Allan deviation over tau <= T/10 that does not matter
MATERIAL = 0.05

#: how what is said against one begins that shares its probability with others
CANNOT_TELL = 'this record cannot tell it from'
#: what an error does that says nothing for what was added
NO_BETTER = RISES, NO_FALL, BY_CHANCE = 'rises', 'does not fall', 'falls no more than by chance'
VERDICTS = ('missing', 'complete', 'unknown', 'undecidable')


def tail(excess: float, std: float) -> float:
    """
    Return the chance that a true model shows as much excess deviance.

    By a scaled chi-squared of the same mean and scatter: with mean 1 and scatter std, chi^2_k/k
    has k = 2/std^2.

    """
    if not np.isfinite(excess) or not std > 0:
        return 1.0
    k = 2 / std**2
    return float(chdtrc(k, max(k * (1 + excess), 0.0)))


def failing(p_values: Sequence[float], level: float = LEVEL) -> list[int]:
    """Return which tests fail, the surest first, at a family-wise level (Holm 1979)."""
    order = sorted(range(len(p_values)), key=lambda i: p_values[i])
    out = []
    for k, i in enumerate(order):
        if p_values[i] > level / (len(order) - k):
            break
        out.append(i)
    return out


def views_failing(views: Mapping[str, tuple[float, float]]) -> list[str]:
    """Return the names of the views, given as (excess, std), that fail; the surest first."""
    names = list(views)
    return [names[i] for i in failing([tail(*views[k]) for k in names], HELD_OUT_LEVEL)]


def within_chance(excess: float, std: float) -> bool:
    """Tell whether a held-out deviance is one that a true model could have."""
    return bool(excess <= CHANCE * std)


def side(within: bool, fails: bool) -> str:
    """Say on which side of chance an error is: one true model in forty is at its edge."""
    return 'beyond chance' if fails else 'within chance' if within else 'at the edge of chance'


def change(before: float, after: float, fall: float, chance: bool, least: float = FALL) -> str:
    """
    Say what a held-out deviance did.

    Parameters
    ----------
    before, after : float
        The error printed of the two models.
    fall : float
        By how much the deviance fell in the views in which the change is judged.
    chance : bool
        Whether the error after is within chance.
    least : float
        By how much it must fall to be more than chance.

    """
    if not np.isfinite(fall):
        return 'not to be compared'
    if after > before:
        if chance and fall > least:
            return 'within chance, predicts better'
        return RISES if abs(fall) > FALL and not chance else NO_FALL
    if fall > least:
        return 'falls to chance' if chance else 'falls'
    return BY_CHANCE if fall > FALL else NO_FALL


def sufficient(largest_ratio: float) -> bool:
    """Tell whether what a model leaves unexplained changes the Allan deviation by too little."""
    return bool(abs(np.log(largest_ratio)) <= np.log1p(MATERIAL))


def word(found: int, rivals: int, failed: int) -> str:
    """
    Return the verdict.

    Parameters
    ----------
    found : int
        Effects that are named.
    rivals : int
        Effects that gain more than chance and are not named, nor refuted.
    failed : int
        Tests that fail with all that is found in the model.

    """
    if found:
        return 'missing'
    if rivals:
        return 'undecidable'
    return 'unknown' if failed else 'complete'
