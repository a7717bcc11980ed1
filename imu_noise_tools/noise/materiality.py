# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Whether what a model does not explain matters: to the Allan curve, and to the coefficients.

A long record shows disturbances that hold a ten-thousandth of its power. Beside *is it there*
stands *does it change the numbers that people use*.

"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .coupled import RARE
from .curve import bin_weights, model_curve
from .evidence import Evidence
from .explained import Bands, judge, stretches
from .fit import fit as fit_part
from .flexible import mean_gain, slow_misfit
from .knee import SlowMean
from .level import clipped, narrowed_by_clipping
from .views import unclaimed
from ..core.units import in_percent
from ..loop.effect import Fit, Model, unfitted
from ..loop.verdict import sufficient as sufficient_ratio

SPAN = 0.1  # of the record's length: averaging times up to which curves are compared


@dataclass(frozen=True)
class Failure:
    """
    One stretch of the spectrum, ``low`` to ``high`` Hz, that disagrees with the model.

    ``share`` of the record's power that it holds; ``ratio`` of the Allan deviation with it to the
    model's, where that is farthest from 1, at ``tau`` s.

    """

    low: float
    high: float
    share: float
    ratio: float
    tau: float

    def __str__(self):
        """Say where it is and what it does."""
        return (f'{self.low:.3g} to {self.high:.3g} Hz: {in_percent(self.share)} of the power, '
                f'Allan deviation times {self.ratio:.3g} at {self.tau:.3g} s')


@dataclass(frozen=True)
class Materiality:
    """
    What the failures of a model change.

    Parameters
    ----------
    sufficient : bool
        Whether no failure changes the Allan deviation by more than 5 % (tau <= T/10), nor a
        coefficient by more than its interval.
    largest_ratio, at_tau : float
        Of measured to model Allan deviation, as far as failures and not chance cause it, where it
        is farthest from 1; 1 and nan where nothing fails.
    failures : tuple of Failure
        Of the spectrum, from low to high frequencies.
    moved : tuple of str
        Coefficients (``white.N``) that would leave their interval if the fit had to follow what
        it does not explain, or if a slow course of the mean that has no name were not theirs.
    clipped : str
        How many samples stand at an end of the range; empty for none.
    narrow : tuple of str
        Levels that would leave their interval if these did not.

    """

    sufficient: bool
    largest_ratio: float = 1.0
    at_tau: float = float('nan')
    failures: tuple[Failure, ...] = ()
    moved: tuple[str, ...] = ()
    clipped: str = ''
    narrow: tuple[str, ...] = ()

    @property
    def shares(self) -> dict[str, float]:
        """Share of the record's power that each failure holds, by its frequencies."""
        return {f'{f.low:.3g} to {f.high:.3g} Hz': f.share for f in self.failures}

    @property
    def course(self) -> str:
        """What amplitudes may hold where nothing of the spectrum fails."""
        return f'{", ".join(self.moved)} may hold a slow course of the mean that has no name'

    def __str__(self):
        """Say it in a sentence."""
        if not self.failures and self.sufficient and not self.clipped:
            return 'nothing fails that the Allan curve could show'
        said = []
        if self.failures or self.largest_ratio != 1:
            said.append(f'the Allan deviation is up to {self.largest_ratio:.3g} times the '
                        f'model\'s (at {self.at_tau:.3g} s)')
        if self.moved:
            said.append(f'{", ".join(self.moved)} would leave the interval' if self.failures
                        else self.course)
        if self.clipped:
            said.append(self.clipped + (f': {", ".join(self.narrow)} would be larger'
                                        if self.narrow else ''))
        return ('sufficient: ' if self.sufficient else 'it matters: ') + ', and '.join(said)


def materiality(evidence: Evidence, fit: Fit) -> Materiality:
    """
    Return what the failures of a fit change.

    Parameters
    ----------
    evidence : Evidence
        Of one axis.
    fit : Fit
        Of it.

    """
    details = fit.details
    bins = evidence.whole.bins
    measured = details.power + unclaimed(evidence, fit.model)
    bands = Bands.on(bins)
    judged = judge(bands, measured / details.v, details.weight)
    off = np.where(judged.weight > 0, 0.0, measured - details.v)
    c = evidence.curve
    some = np.flatnonzero(c.tau <= SPAN * evidence.duration)
    if not len(some) or c.deviation not in ('oadev', 'adev'):
        some = np.flatnonzero(c.m == c.m[0])
    gain = bin_weights(bins, c.m[some])
    model = model_curve(evidence, fit.model, c.m[some])
    failures = []
    for at, low, high in stretches(bands, judged.weight > 0):
        ratio = np.sqrt(np.maximum(1 + gain[:, at] @ off[at] / model, 0))
        far = int(np.argmax(np.abs(np.log(np.maximum(ratio, 1e-9)))))
        share = float(np.sum(measured[at] * bins.count[at]) / np.sum(measured * bins.count))
        failures.append(Failure(low, high, share, float(ratio[far]), float(c.tau[some][far])))
    ratio = np.sqrt(np.maximum(1 + gain @ off / model, 1e-9))
    ratio = _farther(ratio, _beyond_chance(c, some, np.sqrt(model)))
    far = int(np.argmax(np.abs(np.log(ratio))))
    moved = _moved(evidence, fit) if failures else ()
    moved += tuple(k for k in _without_a_course(evidence, fit) if k not in moved)
    narrow = narrowed_by_clipping(evidence, fit)
    sufficient = sufficient_ratio(ratio[far]) and not (moved or narrow)
    return Materiality(bool(sufficient), float(ratio[far]),
                       float(c.tau[some][far]) if ratio[far] != 1 else float('nan'),
                       tuple(failures), moved, clipped(evidence), narrow)


def _farther(a, b):
    return np.where(np.abs(np.log(a)) >= np.abs(np.log(b)), a, b)


def _beyond_chance(c, some, model):
    """Return the ratio of measured to model deviation less what chance allows, at least 1."""
    if c.deviation not in ('oadev', 'adev'):
        return np.ones(len(some))
    spread = 4 / np.sqrt(2 * np.maximum(c.edf[some], 1))
    ratio = c.dev[some] / model
    return np.where(ratio > 1, np.maximum(ratio / (1 + spread), 1),
                    np.minimum(ratio * (1 + spread), 1))


def _moved(evidence: Evidence, fit: Fit) -> tuple[str, ...]:
    """Return which amplitudes leave their interval in a fit that has to follow every bin."""
    return _outside(fit, fit_part(evidence, unfitted(fit.model), intervals=False,
                                  start=fit.model, robust=False))


def _without_a_course(evidence: Evidence, fit: Fit) -> tuple[str, ...]:
    """
    Return which amplitudes leave their interval where a slow course of the mean is no noise.

    A random walk holds a creep or a warm-up that has no name, and the Allan curve fits.

    """
    if (slow_misfit(evidence, fit).p_value or 0.0) > RARE:
        return ()
    slow = SlowMean({'of': float(mean_gain(evidence, fit)[1])}, 'course')
    return _outside(fit, fit_part(evidence, Model((*unfitted(fit.model), slow)), intervals=False,
                                  start=fit.model, hint=fit.details.hint))


def _outside(fit: Fit, other: Fit) -> tuple[str, ...]:
    """Return which amplitudes another fit has outside of a fit's intervals."""
    out = []
    for label, found in fit.estimates.items():
        for name, e in found.items():
            there = other.estimates.get(label, {}).get(name)
            if e.ci95 is None or e.fixed or there is None or there.point is None:
                continue
            if not e.ci95[0] <= there.point <= e.ci95[1]:
                out.append(f'{label}.{name}')
    return tuple(out)
