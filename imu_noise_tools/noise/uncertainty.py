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
from .likelihood import Likelihood, Linear, settled
from .response import OPEN
from ..core import units
from ..core.statistics import CHI2_90, CHI2_95, interval, ONE_SIDED
from ..loop.effect import Estimate, Model

SHOWN = 0.1  # of the upper end of an interval: what is less is no level that the record shows
IN_EVERY_SENSOR = (
    'the interval reaches zero: the record does not tell it from what drifts, and that every '
    'sensor has it is all that speaks for it'
)

#: by label and parameter
Estimates: TypeAlias = dict[str, dict[str, Estimate]]


def with_linear(likelihood: Likelihood, model: Model, linear: Linear) -> Model:
    """Return the model with the solved parameters in it."""
    for slot, value in zip(likelihood.linear_slots, linear.beta):
        model = model.with_effect(
            model[slot.label].with_values(**{slot.parameter.name: float(value)})
        )
    return model


def chosen_estimates(likelihood: Likelihood) -> Estimates:
    """Return what was chosen among the proposed values, and what is no part of a choice."""
    evidence = likelihood.evidence

    def chosen(e, p):
        unit = units.si(p.unit, evidence.sensor)
        if p.linear:
            return Estimate(None, None, (0.0, 0.0), unit, upper95=0.0, point=0.0,
                            note='no part of this form')
        return Estimate(e[p.name], None, None, unit, point=e[p.name], note=(
            'the best of the values tried' if p.discrete else 'no part of this form'))

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
        value = float(value)
        lo, hi = interval(value, std)
        unit = units.si(slot.parameter.unit, likelihood.evidence.sensor)
        if slot.parameter.amplitude and lo <= 0 <= hi:
            upper = abs(value) + ONE_SIDED * std
            e = Estimate(
                None,
                std,
                (0.0, max(abs(lo), abs(hi))),
                unit,
                upper95=upper,
                point=value,
                note='not observable: the interval holds zero',
            )
        else:
            e = Estimate(value, std, (lo, hi), unit, point=value)
        out.setdefault(slot.label, {})[slot.parameter.name] = e
    return out


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


def _certain(model: Model, label: str) -> bool:
    """Tell whether an effect is one that every sensor has."""
    return any(e.label == label and e.in_every_sensor for e in model.of(Spectrum))


def estimates(likelihood: Likelihood, x: np.ndarray, information: np.ndarray, linear: Linear,
              reddest: int | None) -> tuple[Estimates, list[str]]:
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
        unit = units.si(slot.parameter.unit, likelihood.evidence.sensor)
        value = slot.from_search(x[j])
        wide = float(np.clip(std[j], 1e-6, 3.0))
        spread = float(std[j]) * slot.parameter.slope(value)
        lower_bound, upper_bound = slot.bounds
        lo = profile.crossing(j, -1, CHI2_95, wide)
        if slot.parameter.amplitude and lo is not None and lo > x[j] and _nothing(slot, x[j], lo):
            lo = None  # of two maxima one is at nothing
        if slot.parameter.amplitude and lo is None:
            upper = slot.from_search(profile.crossing(j, +1, CHI2_90, wide) or upper_bound)
            hi = slot.from_search(profile.crossing(j, +1, CHI2_95, wide) or upper_bound)
            hi = max(hi, upper)  # of a likelihood with two maxima the walks may end apart
            e = Estimate(
                None,
                spread,
                (0.0, hi),
                unit,
                upper95=upper,
                point=value,
                note='not observable: the interval reaches zero',
            )
            if _certain(likelihood.model, slot.label) and value > SHOWN * hi:
                e = replace(e, value=value, upper95=None, note=IN_EVERY_SENSOR)
        else:
            hi = profile.crossing(j, +1, CHI2_95, wide)
            note = ''
            if (lo is not None and lo > x[j]) or (hi is not None and hi < x[j]):
                note = 'the likelihood has two maxima: the interval holds both'
                flags.append(f'{slot.label}.{slot.parameter.name}: {note}')
                lo, hi = (None if end is None else pick(end, x[j])
                          for end, pick in ((lo, min), (hi, max)))
            if lo is None or hi is None:
                note = 'one end of the interval is the bound of the search'
                flags.append(f'{slot.label}.{slot.parameter.name}: {note}')
            e = Estimate(
                value,
                spread,
                (
                    slot.from_search(lower_bound if lo is None else lo),
                    slot.from_search(upper_bound if hi is None else hi),
                ),
                unit,
                point=value,
                note=note,
            )
        e = replace(e, profile=tuple((slot.from_search(at), d) for at, d in profile.seen[j]))
        out.setdefault(slot.label, {})[slot.parameter.name] = e
    return out, flags


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

        def further(end, point=e.point, factor=factor, shown=e.value is not None):
            if not shown:
                return end * factor ** 0.5
            return point * (end / point) ** factor if end > 0 else end
        low, high = e.ci95
        out[slot.label][slot.parameter.name] = replace(
            e, ci95=(further(low), further(high)), std=None if e.std is None else e.std * factor,
            upper95=None if e.upper95 is None else further(max(e.upper95, e.point)))
    return out


def _nothing(slot, at: float, lo: float) -> bool:
    """Tell whether an amplitude is next to nothing beside the lower end of an interval."""
    return slot.from_search(at) < 1e-2 * slot.from_search(lo)


class _Profile:
    """The profile likelihood of one parameter after another."""

    def __init__(self, likelihood, top, least):
        self.likelihood, self.top, self.least = likelihood, top, least
        self.seen = [[(float(at), 0.0)] for at in top]

    def deviance(self, j: int, at: float, warm: np.ndarray) -> tuple[float, np.ndarray]:
        """Return 2 (-ln L(at) - min) with all others free, and where they went."""
        free = np.ones(len(self.top), bool)
        free[j] = False
        x = warm.copy()
        x[j] = at
        x, nll = minimise(self.likelihood, x, free=free, steps=25)
        deviance = max(2 * (nll - self.least), 0.0)
        self.seen[j].append((at, deviance))
        return deviance, x

    def crossing(self, j: int, sign: int, level: float, step: float) -> float | None:
        """
        Return where the deviance reaches a level on one side.

        None where it never does (a limit).

        """
        lower, upper = self.likelihood.slots[j].bounds
        # downwards on a logarithmic scale there is nothing more to come after a few powers of ten
        reach = 14.0 if sign < 0 and self.likelihood.slots[j].parameter.log else np.inf
        low, d_low, warm = self.top[j], 0.0, self.top
        move = np.sqrt(level) * step
        high = None
        for _ in range(16):
            at = float(np.clip(low + sign * move, lower, upper))
            d, found = self.deviance(j, at, warm)
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
            a, b, c = np.sqrt(d_low), np.sqrt(d_high), np.sqrt(level)
            share = 0.5 if k % 2 else np.clip((c - a) / max(b - a, 1e-12), 0.05, 0.95)
            at = low + share * (high - low)
            d, found = self.deviance(j, at, warm)
            if abs(np.sqrt(d) - c) < 2e-3:
                return at
            if d >= level:
                high, d_high = at, d
            else:
                low, d_low, warm = at, d, found
        return 0.5 * (low + high)
