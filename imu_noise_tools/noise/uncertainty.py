# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Estimates of a fit: standard deviations, profile-likelihood intervals, upper limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from .descent import minimise
from .kinds import MEASURED, NoiseEffect, Spectrum
from .likelihood import Likelihood, Linear, settled, Slot
from .response import OPEN
from ..core import units
from ..core.statistics import (
    CHI2_90, CHI2_95, CHI2_995, interval, level_below, ONE_SIDED
)
from ..loop.effect import Estimate, Model

TRIED = 48  # sizes of an amplitude, over all that it may have
NOTHING = 14.0  # powers of e below the best value, where nothing more is to come
WELL_KNOWN = 0.1  # of an amplitude, as a share: zero is five standard deviations of its power away
SHOWN = 0.1  # of the upper end of an interval: what is less is no level that the record shows
NOT_TOLD_FROM_DRIFT = (
    'the interval reaches zero: the record does not tell it from what drifts, and that every '
    'sensor has it is all that speaks for it'
)

#: by label and parameter
Estimates: TypeAlias = dict[str, dict[str, Estimate]]


def chosen_estimates(likelihood: Likelihood) -> Estimates:
    """Return what was chosen among the proposed values, and what is no part of a choice."""
    evidence = likelihood.evidence

    def chosen(e, p):
        unit = units.si(p.unit, evidence.sensor)
        if p.linear:
            return Estimate(None, None, (0.0, 0.0), unit, upper95=0.0, point=0.0,
                            note='no part of this form')
        return Estimate(e[p.name], None, None, unit, point=e[p.name], note=(
            'the best of the values tried' if p.discrete else
            'as it is measured' if e.as_measured else 'no part of this form'))

    return {
        e.label: {
            p.name: chosen(e, p) for p in e.parameters
            if (p.linear or p.name in e.values) and (p.discrete or settled(e, p, evidence))
        }
        for e in likelihood.model.of(NoiseEffect)
        if not isinstance(e, MEASURED)
    }


def covariance_of(information: np.ndarray) -> np.ndarray:
    """Return the covariance (p, p), large of what the information says nothing about."""
    if not len(information):
        return information
    scale = np.sqrt(np.maximum(np.diag(information), 1e-12))
    return np.linalg.pinv(information / np.outer(scale, scale), rcond=1e-10) / np.outer(
        scale, scale
    )


def marginal(information: np.ndarray, keep: Sequence[int]) -> np.ndarray:
    """Return the information on some parameters with the others left open (Schur complement)."""
    if len(keep) == len(information):
        return information
    rest = [j for j in range(len(information)) if j not in keep]
    cross = information[np.ix_(keep, rest)]
    own = information[np.ix_(keep, keep)]
    return own - cross @ np.linalg.pinv(information[np.ix_(rest, rest)]) @ cross.T


def _linear_estimates(likelihood, linear):
    out: dict[str, dict] = {}
    for slot, value, variance in zip(
        likelihood.linear_slots, linear.beta, np.diag(linear.covariance)
    ):
        std = float(np.sqrt(max(variance, 0)))
        out.setdefault(slot.label, {})[slot.parameter.name] = of_linear(
            slot, float(value), std, interval(float(value), std), likelihood.evidence.sensor)
    return out


def of_linear(slot: Slot, value: float, std: float, ends: tuple[float, float],
              sensor: str) -> Estimate:
    """Return the estimate of what was solved for, of an interval; a limit if that holds zero."""
    lo, hi = ends
    unit = units.si(slot.parameter.unit, sensor)
    if slot.parameter.amplitude and lo <= 0 <= hi:
        return Estimate(None, std, (0.0, max(abs(lo), abs(hi))), unit, point=value,
                        upper95=abs(value) + ONE_SIDED * std,
                        note='not observable: the interval holds zero')
    return Estimate(value, std, (lo, hi), unit, point=value)


def plain_estimates(likelihood: Likelihood, x: np.ndarray, information: np.ndarray,
                    linear: Linear) -> Estimates:
    """Return values with the standard deviations of the information, without intervals."""
    out = _linear_estimates(likelihood, linear)
    std = np.sqrt(np.maximum(np.diag(covariance_of(information)), 0)) if len(x) else np.zeros(0)
    for slot, at, s in zip(likelihood.slots, x, std):
        if slot.label == OPEN:
            continue
        value = slot.from_search(at)
        s = float(s * slot.parameter.slope(value))
        out.setdefault(slot.label, {})[slot.parameter.name] = Estimate(
            value,
            s,
            interval(value, s),
            units.si(slot.parameter.unit, likelihood.evidence.sensor),
            point=value,
        )
    return out


def _never_absent(model: Model, label: str) -> bool:
    """Tell whether an effect is one that every sensor has."""
    return any(e.label == label and e.never_absent for e in model.of(Spectrum))


def estimates(likelihood: Likelihood, x: np.ndarray, information: np.ndarray,
              linear: Linear) -> tuple[Estimates, list[str]]:
    """Return profile-likelihood intervals, upper limits and flags."""
    out = _linear_estimates(likelihood, linear)
    flags: list[str] = []
    if not len(x):
        return out, flags
    std = np.sqrt(np.maximum(np.diag(covariance_of(information)), 0))
    top, least = minimise(likelihood, x)  # unpenalised
    profile = _Profile(likelihood, top, least)
    for j, slot in enumerate(likelihood.slots):
        if slot.label == OPEN:
            continue
        e, notes = _estimate(profile, j, float(x[j]), float(std[j]))
        flags += [f'{slot.label}.{slot.parameter.name}: {note}' for note in notes]
        e = replace(e, profile=tuple((slot.from_search(at), d) for at, d in profile.seen[j]))
        out.setdefault(slot.label, {})[slot.parameter.name] = e
    return out, flags


def _estimate(profile: _Profile, j: int, at: float, std: float) -> tuple[Estimate, list[str]]:
    """Return the estimate of a parameter that is ``at`` in the search, and what to say of it."""
    slot = profile.likelihood.slots[j]
    wide = float(np.clip(std, 1e-6, 3.0))
    value = slot.from_search(at)
    here = Estimate(value, std * slot.parameter.slope(value), None,
                    units.si(slot.parameter.unit, profile.likelihood.evidence.sensor), point=value)
    amplitude = slot.parameter.amplitude
    loss, without = profile.nothing(j) if amplitude and std > WELL_KNOWN else (np.inf, None)
    lo = profile.crossing(j, -1, CHI2_95, wide, without)
    if amplitude and (
            lo is None or loss < CHI2_995
            or lo > at and _nothing(slot, at, lo)):     # of two maxima one is at nothing
        return _limit(profile, j, wide, here), []
    hi = profile.crossing(j, +1, CHI2_95, wide)
    notes = []
    if (lo is not None and lo > at) or (hi is not None and hi < at):
        notes.append('the likelihood has two maxima: the interval holds both')
        lo, hi = (None if end is None else pick(end, at) for end, pick in ((lo, min), (hi, max)))
    if lo is None or hi is None:
        notes.append('one end of the interval is the bound of the search')
    lo, hi = (bound if end is None else end for end, bound in zip((lo, hi), slot.bounds))
    return replace(here, ci95=(slot.from_search(lo), slot.from_search(hi)),
                   note=notes[-1] if notes else ''), notes


def _limit(profile: _Profile, j: int, wide: float, here: Estimate) -> Estimate:
    """Return the estimate of an amplitude that may be nothing, ``wide`` a step in the search."""
    slot, model = profile.likelihood.slots[j], profile.likelihood.model
    bound = slot.bounds[1]
    upper, hi = (slot.from_search(bound if end is None else end)
                 for end in profile.highest(j, wide))
    hi = max(hi, upper)  # of a likelihood with two maxima the walks may end apart
    if _never_absent(model, slot.label) and here.value > SHOWN * hi:
        return replace(here, ci95=(0.0, hi), note=NOT_TOLD_FROM_DRIFT)
    return replace(here, value=None, ci95=(0.0, hi), upper95=upper,
                   note='not observable: the interval reaches zero')


def widened(likelihood: Likelihood, found: Estimates, by: np.ndarray) -> Estimates:
    """
    Return estimates whose intervals are wider about their points by factors (p,), all >= 1.

    The logarithm of a value is that much less known; of one that is not shown, whose point may be
    next to nothing, the square.

    """
    out = {label: dict(some) for label, some in found.items()}
    for slot, factor in zip(likelihood.slots, by):
        e = out.get(slot.label, {}).get(slot.parameter.name)
        if factor == 1 or not slot.parameter.log or e is None or e.ci95 is None or not e.point:
            continue
        low, high = (_further(e, end, factor) for end in e.ci95)
        out[slot.label][slot.parameter.name] = replace(
            e, ci95=(low, high), std=None if e.std is None else e.std * factor,
            upper95=None if e.upper95 is None else _further(e, max(e.upper95, e.point), factor))
    return out


def _further(e: Estimate, end: float, factor: float) -> float:
    """Return an end of an interval that is so many times as wide about its point."""
    if e.value is None:
        return end * factor ** 0.5
    assert e.point is not None
    return e.point * (end / e.point) ** factor if end > 0 else end


def _nothing(slot, at: float, lo: float) -> bool:
    """Tell whether an amplitude is next to nothing beside the lower end of an interval."""
    return slot.from_search(at) < 1e-2 * slot.from_search(lo)


class _Profile:
    """The profile likelihood of one parameter after another."""

    def __init__(self, likelihood, top, least):
        self.likelihood, self.top, self.least = likelihood, top, least
        self.seen = [[(float(at), 0.0)] for at in top]

    def deviance(self, j: int, at: float, *starts: np.ndarray) -> tuple[float, np.ndarray]:
        """Return 2 (-ln L(at) - min) with all others free, and where they went from a start."""
        free = np.ones(len(self.top), bool)
        free[j] = False
        found = []
        for start in starts:
            x = start.copy()
            x[j] = at
            found.append(minimise(self.likelihood, x, free=free, steps=25))
        x, nll = min(found, key=lambda reached: reached[1])
        deviance = max(2 * (nll - self.least), 0.0)
        self.seen[j].append((at, deviance))
        return deviance, x

    def nothing(self, j: int) -> tuple[float, np.ndarray]:
        """
        Return 2 (-ln L - min) with an amplitude at nothing, and where the others went.

        One of them that is next to nothing itself may take its place, and no slope leads there:
        each is tried at all of its sizes.

        """
        slots = self.likelihood.slots
        none = self.top.copy()
        none[j] = max(slots[j].bounds[0], none[j] - NOTHING)
        starts = [none]
        for i, slot in enumerate(slots):
            if i != j and slot.parameter.amplitude:
                sizes = np.tile(none, (TRIED, 1))
                sizes[:, i] = np.linspace(slot.bounds[0], slot.bounds[1], TRIED)
                starts.append(min(sizes, key=lambda x: self.likelihood.value(x)[0]))
        return self.deviance(j, float(none[j]), *starts)

    def highest(self, j: int, step: float) -> list[float | None]:
        """
        Return the 95 % limit of an amplitude that may be nothing, and the end of its interval.

        What little a record shows of it is in few coefficients. Of k of them the deviance goes
        farther down than up, and its level is that which chance exceeds below in chi-squared_k as
        often as in a normal distribution. None where it never comes to that.

        """
        levels = [CHI2_90, CHI2_95]
        at = self.crossing(j, +1, levels[0], step)
        if at is None:
            return [None, None]
        d, x = self.deviance(j, at, self.top)
        if self.likelihood.slots[j].parameter.log:
            # ln sigma of k coefficients has an information of 2 k
            count = 0.5 * float(marginal(self.likelihood.information(x), [j])[0, 0])
            levels = [level_below(level, count) for level in levels]
        return [at if level <= d else self.crossing(j, +1, level, step, begin=(at, d, x))
                for level in levels]

    def crossing(self, j: int, sign: int, level: float, step: float,
                 without: np.ndarray | None = None,
                 begin: tuple[float, float, np.ndarray] | None = None) -> float | None:
        """
        Return where the deviance reaches a level on one side.

        None where it never does (a limit). The others may as well be near where they go
        ``without`` it. The way may ``begin`` where it is known: there, its deviance and x.

        """
        others = () if without is None else (without,)
        lower, upper = self.likelihood.slots[j].bounds
        # downwards on a logarithmic scale there is nothing more to come after a few powers of ten
        reach = NOTHING if sign < 0 and self.likelihood.slots[j].parameter.log else np.inf
        low, d_low, warm = begin or (self.top[j], 0.0, self.top)
        wanted = np.sqrt(level)
        move = (wanted - np.sqrt(d_low)) * step
        high = None
        for _ in range(16):
            at = float(np.clip(low + sign * move, lower, upper))
            d, found = self.deviance(j, at, warm, *others)
            if d >= level:
                high, d_high = at, d
                break
            if at in (lower, upper) or abs(at - self.top[j]) > reach:
                return None
            low, d_low, warm = at, d, found
            move *= 2
        if high is None:
            return None
        # The square root of the deviance is nearly a straight line; but where a step went far up a
        # wall the secant creeps, so every second try halves.
        for k in range(40):
            below = np.sqrt(d_low)
            share = 0.5 if k % 2 else np.clip(
                (wanted - below) / max(np.sqrt(d_high) - below, 1e-12), 0.05, 0.95)
            at = low + share * (high - low)
            d, found = self.deviance(j, at, warm, *others)
            if abs(np.sqrt(d) - wanted) < 2e-3:
                return at
            if d >= level:
                high, d_high = at, d
            else:
                low, d_low, warm = at, d, found
        return 0.5 * (low + high)
