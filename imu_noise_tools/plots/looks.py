# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What can be looked at of the noise of an axis: Allan curve, spectrum, course in time ..."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from .curves import (
    against_normal, chance_of_level, coarse, curves, densities, DENSITY, evidence_of,
    line_envelope, noise_level, observable, SHOWN, TAU,
)
from .panel import Curve, Panel, plain
from .style import readable
from ..core import units
from ..loop.prediction import State
from ..noise import block_means, in_frequency, views
from ..noise.kinds import Line, NoiseEffect, Portrait


def panels(state: State) -> Mapping[str, Callable[[], Panel]]:
    """Return the panels of one axis."""
    known = {'allan': allan, 'frequency': frequency, 'time': time, 'variance': variance,
             'distribution': distribution}
    e = evidence_of(state)
    if e.channels:
        known['coherence'] = coherence
    out = {name: partial(make, state) for name, make in known.items()}
    for effect in state.model.of(NoiseEffect):
        for name, make in effect.portraits(e, state.fit).items():
            out[name] = partial(_portrait, name, make, e.sensor)
    return out


def _portrait(name: str, make: Callable[[], Portrait], sensor: str) -> Panel:
    """Return what an effect shows of itself, in units as people read them."""
    p = make()
    (_, x_unit), (factor, y_unit) = (
        SHOWN[sensor] if u == '{rate}' else (1.0, '' if u == '1' else u) for u in p.units)
    x_title, y_title = (f'{t}, {readable(u)}' if u else t
                        for t, u in zip(p.titles, (x_unit, y_unit)))
    return Panel(name, x_title, x_unit, np.zeros(0), np.zeros(0), y_title, '', (
        Curve('measured', p.x, p.y / factor, 'dots'),
        Curve('as the effect has it', p.line_x, p.line_y / factor, 'model')))


def _seen(state: State, label: str) -> bool:
    return label not in state.fit.estimates or observable(state, label)


def _claiming(state: State) -> State:
    """Return a target without the lines of its model that are near no line of the record."""
    e = evidence_of(state)
    far = [x.label for x in state.model.of(Line) if not any(
        abs(f - at) < max(2 / e.duration, 1e-3 * at)
        for f in e.line_table[:, 0] for at, _ in x.lines())]
    model = state.model
    for label in far:
        model = model.minus(label)
    return replace(state, fit=replace(state.fit, model=model)) if far else state


def allan(state: State) -> Panel:
    """Return the Allan deviation, the model, each effect."""
    e = evidence_of(state)
    c, found = e.curve, curves(state)
    factor, unit = units.field('{rate}', e.sensor)
    lines = [Curve('measured', c.tau, c.dev / factor, 'measured', c.lo / factor, c.hi / factor)]
    if found:
        lines.append(Curve('model', c.tau, np.sqrt(found.model) / factor, 'model'))
        for label, v in found.each.items():
            effect = state.model[label]
            if isinstance(effect, Line):
                v = effect.share(e.duration) * line_envelope(effect, c.m, c.dt)
            lines.append(Curve(label, c.tau, np.sqrt(np.maximum(v, 0)) / factor, 'effect',
                               seen=_seen(state, label)))
    return Panel('allan', TAU, 's', c.tau,
                 found.pull if found else np.zeros(len(c.tau)),
                 f'Allan deviation, {readable(unit)}', 'xy', tuple(lines))


def frequency(state: State) -> Panel:
    """Return the noise density, the model, each effect; lines that it does not hold are in it."""
    e = evidence_of(state)
    factor, unit = DENSITY[e.sensor]
    d, claiming = densities(state), _claiming(state)
    lines = [Curve('every bin', d.f, d.with_lines(claiming), 'dots'),
             Curve('measured', d.mid, d.level, 'measured', d.lo, d.hi),
             Curve('model', d.f, d.model, 'model')]
    lines += [Curve(label, d.f, s, 'effect', seen=_seen(state, label))
              for label, s in d.each.items()]
    for line in state.model.of(Line):
        for at, amplitude in line.lines():
            # what a coherent line puts into one bin of the width of the record's
            top = 0.5 * amplitude * line.share(e.duration) * np.sqrt(e.duration) / factor
            ends = np.array([top, 3e-5 * np.min(d.model)])
            lines.append(Curve(line.label, np.array([at, at]), ends, 'effect'))
    view = in_frequency.frequency(e, 'whole', claiming.fit, fitted_here=True)
    return Panel('frequency', 'frequency, Hz', 'Hz', view.x,
                 view.pull, f'noise density (two-sided), {readable(unit)}', 'xy', tuple(lines))


def time(state: State) -> Panel:
    """Return the record itself: extremes of each column, block means, the model's mean."""
    e = evidence_of(state)
    factor, unit = SHOWN[e.sensor]
    t, lo, hi = e.envelope.T
    mean = float(np.mean(e.slow_y))
    slow_t, slow = coarse(e)
    lines = [Curve('smallest to largest', t, 0 * t, 'extremes', (lo - mean) / factor,
                   (hi - mean) / factor),
             Curve('block means', slow_t, (slow - mean) / factor, 'measured')]
    known = views.slow_mean(e, state.model)
    lines.append(Curve('model of the mean', e.slow_t, (known - np.mean(known)) / factor, 'model'))
    both = [block_means.time(e, state.fit, known) for known in ('odd', 'even')]
    x, pull = (np.concatenate([getattr(v, k) for v in both]) for k in ('x', 'pull'))
    order = np.argsort(x, kind='stable')
    return Panel('time', 'time, s', 's', x[order], pull[order],
                 f'less its mean, {readable(unit)}', '', tuple(lines))


def variance(state: State) -> Panel:
    """Return the rms of the noise in time beside its mean over the record."""
    t, ratio, spread = noise_level(state)
    pull = (np.cbrt(ratio) - (1 - spread)) / np.sqrt(spread)
    lo, hi = (np.full(len(t), v) for v in chance_of_level(spread))
    lines = (Curve('chance', t, 0 * t + 1, 'chance', lo, hi),
             Curve('noise level', t, np.sqrt(ratio)))
    return Panel('variance', 'time, s', 's', t, pull,
                 'rms / mean rms', '', lines)


def distribution(state: State) -> Panel:
    """Return how many samples lie where a normal distribution puts equally many."""
    at, cells, expected, chance = against_normal(state)
    one = np.ones(len(at))
    lines = (Curve('chance', at, one, 'chance', one - chance, one + chance),
             Curve('samples', at, cells / expected))
    pull = (cells - expected) / np.sqrt(expected * (1 - expected / cells.sum()))
    return Panel('distribution', 'standard deviations from the mean', 'sigma', at, pull,
                 'samples / normal', '', lines)


def coherence(state: State) -> Panel:
    """Return what the axis shares with each other channel, frequency by frequency."""
    e = evidence_of(state)
    view = in_frequency.coherence(e, state.fit)
    lines = []
    for channel in e.channels:
        f, r, _ = in_frequency.cross_correlation(e, channel, state.fit)
        lines.append(Curve(f'shared with {channel}', f, r, 'channel'))
    return replace(plain(view), curves=tuple(lines), y_title='correlation')
