# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What every format asks of a noise study.

N and K of a sensor, over its axes, with what had to be said.

"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import numpy as np

from ..core.errors import InputError, unknown, UsageError
from ..core.units import shown
from ..health import MOTION_KEPT
from ..loop.effect import find_effect, unfitted
from ..loop.prediction import observable, State
from ..loop.study import Study
from ..noise.curve import model_curve
from ..noise.level import at_one_second
from ..noise.problem import NoiseProblem

HORIZON = (0.1, 100.0)  # s: over which what is written for a model that fails is not too small
PARAMETERS = {'N': 'white', 'K': 'random_walk', 'B': 'flicker'}
RULES = ('worst', 'mean', 'each')


@dataclass(frozen=True)
class Value:
    """One number of a sensor over its axes, and remarks on it."""

    values: tuple[float, ...]
    axes: tuple[str, ...]
    notes: tuple[str, ...]

    def one(self, rule: str) -> float:
        """Return the largest (``worst``) or the rms (``mean``) over the axes."""
        if rule not in RULES:
            raise unknown('--axes', rule, RULES)
        if rule == 'each':
            raise UsageError('this format holds one value per sensor', 'use --axes worst or mean')
        return (
            max(self.values)
            if rule == 'worst'
            else float(np.sqrt(np.mean(np.square(self.values))))
        )


def value_of(
    study: Study, sensor: str, parameter: str, horizon: float | None = None
) -> Value | None:
    """
    Return N or K of a sensor; None where the study has none of its axes.

    Of a data sheet that states white noise alone there is no K, whatever the horizon.

    Where K is not resolved its 95 % upper limit is used, and said; where the model lacks the
    effect it is fitted for this. Where the model fails and it matters, N and K are those that
    cover the measured curve. N of an output that is coarser than its noise is that in motion.

    """
    axes = [t for t in study.targets if t.startswith(sensor)]
    if not axes:
        return None
    values, notes = [], []
    for axis in axes:
        state = study.states[axis]
        if parameter == 'K' and study.source.get('sheet') and not any(
                PARAMETERS[x] in state.model for x in 'BK'):
            raise InputError(f'{study.source.get("path")}: states nothing slow of {axis}, so no K '
                             'follows from it', 'state allan_minimum, bias_instability or '
                             'rate_random_walk, or analyse a record')
        covers = parameter in 'NK' and (horizon is not None or fails(state))
        value, note = (covering(state, horizon)[parameter], '') if covers else _resolved(
            state, parameter)
        if parameter == 'N' and value is not None:
            moving = cast(NoiseProblem, state.problem).in_motion()
            if moving > value:
                note = f'{note}; written is what it is in motion' if note else (
                    'N of the coarse output is written as it is in motion')
                value = moving
        values.append(np.nan if value is None else value)
        if note:
            notes.append(f'{axis}: {note}')
    if np.isnan(values).any():
        raise InputError(f'{study.source.get("path")}: gives no {parameter} of the {sensor}',
                         'bias instability is not a random walk: give --horizon S, which covers it'
                         if parameter == 'K' else 'state it')
    return Value(tuple(values), tuple(axes), tuple(notes))


def _resolved(state: State, parameter: str) -> tuple[float | None, str]:
    name = PARAMETERS[parameter]
    estimates, added = state.fit.estimates, ''
    if name not in estimates:
        estimates = state.problem.fit(
            unfitted(state.model).plus(find_effect('noise', name)())
        ).estimates
        added = f'{name} is not in the model; '
    e = estimates[name][parameter]
    if e.value is not None:
        said = f'{added}{parameter} fitted for this file' if added else ''
        if parameter == 'N' and e.note:     # of what it is the level, where that is not plain
            said = f'{said}; {e.note}' if said else f'N: {e.note}'
        return e.value, said
    return e.upper95, f'{added}{parameter} is not resolved, its 95 % upper limit is used'


def left_out(study: Study, horizon: float | None = None) -> list[str]:
    """
    Return what a (N, K) file leaves out of each axis' model, of what the record shows.

    Nothing where N and K are those that cover the curve.

    """
    return _others(study, horizon, lambda state, label: label if observable(state, label) else '')


def unseen(study: Study, horizon: float | None = None) -> list[str]:
    """Return what of each axis' model the record does not show, and below what it stays then."""
    def said(state: State, label: str) -> str:
        if observable(state, label):
            return ''
        found, sensor = state.fit.estimates[label], state.problem.target.partition('_')[0]
        limits = [f'{p.name} below {shown(found[p.name].upper95, p.unit, sensor)}'
                  for p in state.model[label].parameters
                  if p.name in found and found[p.name].upper95 is not None]
        return f'{label} ({", ".join(limits)})' if limits else ''
    return _others(study, horizon, said)


def _others(study: Study, horizon: float | None,
            say: Callable[[State, str], str]) -> list[str]:
    """Return what there is to say of the effects beside those of N and K, a text an axis."""
    out = []
    for axis, state in study.states.items():
        if horizon is None and not fails(state):
            more = [x for e in state.model if e.name not in ('white', 'random_walk')
                    if (x := say(state, e.label))]
            out += [f'{axis}: {", ".join(more)}'] if more else []
    return out


def covered(study: Study, horizon: float) -> str:
    """Say up to which averaging time N and K of a horizon cover the curves: those end."""
    reach = min(_span(s, horizon)[1] for s in study.states.values())
    more = '' if horizon <= 1.1 * reach else \
        f': the record shows nothing longer, of the {horizon:g} s that were asked for'
    return ('Chosen so that the Allan deviation covers model and data up to '
            f'{reach if more else horizon:.3g} s{more}')


def fails(state: State) -> bool:
    """Tell whether what the model does not explain changes the numbers."""
    return not cast(NoiseProblem, state.problem).matters(state.fit).sufficient


def rests_on(study: Study, horizon: float | None = None) -> list[str]:
    """Return what the numbers of each axis rest on, where its model does not hold everywhere."""
    out = []
    if study.source.get('keep_motion'):
        out.append(MOTION_KEPT)
    for axis, state in study.states.items():
        found = cast(NoiseProblem, state.problem).matters(state.fit)
        places = sorted(found.failures[:4], key=lambda f: f.low)
        where = ', '.join(_stretch(f.low, f.high) for f in places)
        more = f' and {len(found.failures) - 4} more' if len(found.failures) > 4 else ''
        if not (where or fails(state)):
            continue
        said = f'{axis}: model fails at {where}{more}' if where else \
            f'{axis}: {found.course}' if found.moved else \
            f'{axis}: {found.clipped}' if found.narrow else \
            f'{axis}: model and measured curve differ at {found.at_tau:.2g} s'
        out.append(f'{said}; {_at_one_second(state)}; ' + (
            'sufficient all the same' if found.sufficient else
            'N and K written are those whose curve is not below the measured one from '
            '{:g} to {:g} s'.format(*_span(state, horizon))))
    return out


def _stretch(low: float, high: float) -> str:
    """Return a stretch of frequencies; one that is narrower than it is told as is one place."""
    ends = f'{low:.3g}', f'{high:.3g}'
    return f'{ends[0]} Hz' if ends[0] == ends[1] else f'{"-".join(ends)} Hz'


def _at_one_second(state: State) -> str:
    """Say how the model's deviation at 1 s compares with the curve's."""
    evidence = cast(NoiseProblem, state.problem).evidence
    i, model = at_one_second(evidence, state.model)
    ratio = model / evidence.curve.dev[i]
    at = f'{evidence.curve.tau[i]:.2g} s'
    if abs(ratio - 1) < 0.1:
        return f'N agrees with the curve at {at} within {max(100 * abs(ratio - 1), 1):.0f} %'
    return f'the model is {ratio:.2g} times the curve at {at}'


def _span(state: State, horizon: float | None) -> tuple[float, float]:
    """Return the averaging times (s) over which N and K cover the curve."""
    c = cast(NoiseProblem, state.problem).evidence.curve
    low = max(HORIZON[0] if horizon is None else 0.0, c.tau[0])
    high = HORIZON[1] if horizon is None else horizon
    reach = c.tau[c.edf > 3]
    return float(low), float(min(high, reach[-1] if len(reach) else c.tau[0]))


def covering(state: State, horizon: float | None = None) -> dict[str, float]:
    """
    Return the (N, K) whose curve is not below the measured one, with the least excess.

    The curve is N^2/tau + K^2 tau/3. N covers all tau up to some tau_1, K the rest; tau_1 is where
    the mean log excess is smallest.

    Parameters
    ----------
    state : State
        Of one axis.
    horizon : float or None
        Longest averaging time, s, from the shortest on; the model is covered as well where it
        holds. None: HORIZON.

    """
    evidence = cast(NoiseProblem, state.problem).evidence
    c = evidence.curve
    low, high = _span(state, horizon)
    some = (c.tau >= low * (1 - 1e-9)) & (c.tau <= high * (1 + 1e-9)) & (c.edf > 3)
    if not some.any():
        some = c.tau <= c.tau[0]
    tau, wanted = c.tau[some], c.dev[some] ** 2
    if not fails(state):
        wanted = np.maximum(wanted, model_curve(evidence, state.model, c.m[some]))
    best = np.inf, np.nan, np.nan
    for i in range(1, len(tau) + 1):
        n2 = float(np.max(tau[:i] * wanted[:i]))
        k2 = float(np.max(np.append(3 * (wanted[i:] - n2 / tau[i:]) / tau[i:], 0.0)))
        excess = float(np.mean(np.log((n2 / tau + k2 * tau / 3) / wanted)))
        if excess < best[0]:
            best = excess, n2, k2
    k = np.sqrt(best[2])
    return {
        'N': float(np.sqrt(best[1])),
        'K': float(k if k > 0 else 1e-3 * np.sqrt(best[1]) / high),
    }


def number(x: float) -> str:
    """Return a number that YAML 1.1 reads as one: ``2.0e-05``."""
    mantissa, _, exponent = f'{x:.6e}'.partition('e')
    mantissa = mantissa.rstrip('0')
    return f'{mantissa}{"0" if mantissa.endswith(".") else ""}e{exponent}'
