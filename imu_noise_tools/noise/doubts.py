# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What speaks against a candidate as it was fitted: that it is another one, or no estimate."""

from __future__ import annotations

from collections.abc import Mapping
from typing import cast

import numpy as np

from .evidence import Evidence
from .kinds import Mean, MEASURED, NoiseEffect, Parameter, Response, Spectrum
from .likelihood import AT_BOUND
from .rounded import moved_by_rounding
from ..loop.effect import Effect, Estimate, Model, registry

# times what the steps of a reading may hide of a mean, rms, that a course of its own is at least
UNREAD = 2.0
# times what rounding moves a mean by: a mean that changes by no more is rounding's (a choice)
ROUNDED = 2.0
# of all that a mean changes: more at one place is a jump; and of how far levels are apart: a jump
# is theirs if they change by more there (a choice)
JUMPS = 0.5
# times as far as levels are apart: a mean that changes by less is one of their dwells (a choice)
FURTHER = 1.5
# of so many parts of a record: jumps within one are at the same time
JUMP_BLOCKS = 256


def of_levels(evidence: Evidence, model: Model, effect: NoiseEffect) -> str:
    """
    Say that a mean jumps as levels do that the path of the record shows, or nothing.

    Or no further than levels do that are in the model and whose path is not seen: of many dwells
    some are long.

    """
    if not isinstance(effect, Mean):
        return ''
    jumps = np.diff(effect.mean(evidence.slow_inputs))
    far = float(np.sum(np.abs(jumps)))
    there = np.flatnonzero(np.abs(jumps) > JUMPS * far)
    if not len(there):
        return ''
    for one in model.of(Spectrum):
        if far < FURTHER * one.jumps and one.path(evidence) is None:
            return f'it is {far / one.jumps:.2g} of the jumps to and fro: {one.title}'
    near = 1 + len(jumps) // JUMP_BLOCKS
    for other in (e() for e in registry('noise').values() if issubclass(e, Spectrum)):
        path = None if other.name in model else other.path(evidence)
        if path is None:
            continue
        before, after = (path[np.clip(there + k, 0, len(jumps))] for k in (-near, near + 1))
        if np.all((after - before) * np.sign(jumps[there]) > JUMPS * np.ptp(path)):
            return f'the mean goes to and fro between two levels, here too: {other.title}'
    return ''


def of_rounding(evidence: Evidence, model: Model, effect: NoiseEffect) -> str:
    """Say that a mean changes by little more than what rounding moves means by, or nothing."""
    step, bins = evidence.resolution, evidence.whole.bins
    if not isinstance(effect, Mean) or not any(
            e.moves_means for e in model.of(NoiseEffect)) or not step > 0:
        return ''
    fast = bins.f > 0.25 / evidence.dt
    level = np.average(evidence.whole.power[fast], weights=bins.count[fast])
    moved = moved_by_rounding(step, np.sqrt(0.5 * level / evidence.dt), evidence.unrounded)
    size = float(np.ptp(effect.mean(evidence.slow_inputs))) if moved > 0 else np.inf
    return '' if size > ROUNDED * moved else (
        f'it is {size / step:.2g} steps of the output, by which rounding moves a mean by '
        f'{moved / step:.2g}')


def hidden_by_steps(evidence: Evidence, model: Model, effect: Effect) -> str:
    """Say that a course moves a mean no further than steps may hide that another is read in."""
    if not isinstance(effect, Mean) or effect.needs != NoiseEffect.needs:
        return ''
    hides, name = max(((m.unread(evidence), m.name) for m in model.of(Mean)), default=(0.0, ''))
    if not hides:
        return ''
    size = float(np.std(effect.mean(evidence.slow_inputs)))
    return '' if size >= UNREAD * hides else (
        f'it is {size / hides:.2g} of what the steps hide in which that of {name} is read')


def at_bound(evidence: Evidence, effect: Effect, estimates: Mapping[str, Estimate]) -> str:
    """
    Say that a shape lies at its bound: that is no estimate, another effect is meant.

    At it, or so near that its estimate does not tell it from there; or beyond: a bound that goes
    with another parameter has moved with that since the fit began. Of a mean, what takes over
    beyond is a rival with odds of its own: it is refused at the bound alone. What arises behind a
    filter is not seen where that lets more pass everywhere.

    """
    if not isinstance(effect, NoiseEffect) or isinstance(effect, MEASURED):
        return ''
    narrower = effect.bounds(evidence)
    for p in effect.parameters:
        if p.amplitude or p.linear or p.discrete or p.name in effect.optional and not p.knee:
            continue
        low, high = narrower.get(p.name, (p.lower, p.upper))
        low, high = max(low, p.lower), min(high, p.upper)
        low, at, high = (p.to_search(value) for value in (low, effect[p.name], high))
        room = high - low
        # what may be nothing is at no bound there
        within = [high - at] if p.knee else [at - low, high - at]
        std = estimates[p.name].std if p.name in estimates else None
        told = np.inf if std is None else 2 * std / p.slope(effect[p.name])
        near = AT_BOUND * room if isinstance(effect, Mean) else max(told, AT_BOUND * room)
        if min(within) < min(0.01 * room, near) and (
                not p.knee or _filled(evidence, effect, p)):
            return f'its {p.name} lies at its bound, {effect[p.name]:.3g} {p.unit}'
    return ''


def _filled(evidence: Evidence, effect: Effect, behind: Parameter) -> bool:
    """Tell whether what arises behind a filter shows: it lets less than that may be pass."""
    alone = cast(Response, effect.with_values(**{behind.name: 0.0}))
    return alone.least(evidence.whole.bins, evidence.dt) < behind.upper
