# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Pictures of one axis: Allan deviation, spectrum, pulls, course in time, distribution.

Each function draws on an Axes and returns it.

"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TYPE_CHECKING, TypeAlias

import numpy as np

from .curves import (
    against_normal, chance_of_level, coarse, Curves, curves, densities, DENSITY, evidence_of,
    line_envelope, noise_level, NOTABLE, observable, readings, runs, SHOWN, TAU,
)
from .style import (
    AXES,
    CHANCE,
    dress,
    EFFECTS,
    FAIL,
    FAINT,
    fits_beside_name,
    label_lines,
    log_scale,
    MEASURED,
    MODEL,
    readable,
    SMALL,
)
from ..core import units
from ..loop.diagnosis import Diagnosis
from ..loop.prediction import State
from ..noise import views
from ..noise.classic import READINGS
from ..noise.kinds import Coupling, Line, Mean

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: (from, to, why), s from the first sample
Stretch: TypeAlias = Sequence[Any]


def suspected(diagnosis: Diagnosis | None) -> str:
    """Return what a diagnosis suspects, in a few words for a picture; empty for nothing."""
    if diagnosis is None or diagnosis.verdict == 'complete':
        return ''
    if diagnosis.found:
        return diagnosis.found[0].name
    if diagnosis.verdict == 'undecidable':
        able = [f for f in diagnosis.ranked if f.gain > f.penalty and f.probability != 0]
        rivals = [f.name for f in able[:2]]
        return ' or '.join(rivals) + '?' if rivals else ''
    return 'something unknown'


def allan(ax: Axes, state: State, found: Curves | None = None, title: str | None = None) -> Axes:
    """
    Draw the measured Allan deviation with its 95 % band, the model, each effect, and the readings.

    Parameters
    ----------
    ax : Axes
        Drawn on, and returned.
    state : State
        Of a noise study.
    found : Curves or None
        What :func:`~imu_noise_tools.plots.curves.curves` gave, where it is at hand.
    title : str or None
        The axis' name unless given.

    """
    e = evidence_of(state)
    c = e.curve
    factor, unit = units.field('{rate}', e.sensor)
    found = found or curves(state)
    dress(ax, e.axis if title is None else title, y=f'Allan deviation, {readable(unit)}')
    marks = [r for r in readings(state, found) if r.observable] if found else []
    low = c.dev.min() / factor
    # a reading up to a decade below the curve is worth the room
    low = min([low / 2.5, *(0.6 * r.sigma / factor for r in marks if r.sigma / factor > low / 25)])
    log_scale(ax.xaxis, c.tau[0], c.tau[-1] * 1.05)
    log_scale(ax.yaxis, low, c.hi.max() / factor * 1.6)
    _band(ax, c.tau, c.lo / factor, c.hi / factor, c.dev / factor)
    if found:
        lines = _effect_lines(ax, state, found, factor)
        ax.plot(c.tau, np.sqrt(found.model) / factor, color=MODEL, linewidth=1.5)
        shown = [r for r in marks if r.sigma / factor > low and c.tau[0] <= r.tau <= c.tau[-1]]
        written = []
        for r in shown:
            here = np.sqrt(np.interp(r.tau, found.tau, found.model))
            own, later = np.sqrt(np.interp([r.tau, 2 * r.tau], found.tau, found.each[r.label]))
            # its name stands to the right: above it only where its own line falls away from there
            below = r.sigma < 0.8 * here or later > 0.85 * own
            written.append(
                _mark(ax, r.tau, r.sigma / factor, r.symbol, _colour(state, r.label), below))
        label_lines(ax, lines, [(c.tau, c.dev / factor), (c.tau, np.sqrt(found.model) / factor),
                                *(([r.tau], [r.sigma / factor]) for r in shown)], written)
        values(ax, state)
    return ax


def values(ax: Axes, state: State) -> None:
    """Write above an axes, at its right, what the coefficients are that are read of a curve."""
    said = []
    for e in state.model:
        for p in e.parameters:
            found = state.fit.estimates.get(e.label, {}).get(p.name)
            if found is None or e.name not in READINGS or p.name != READINGS[e.name][0]:
                continue
            less, value = ('', found.value) if found.value is not None else ('< ', found.upper95)
            if value is not None:
                factor, unit = units.field(p.unit, evidence_of(state).sensor)
                said.append(f'{p.name} {less}{value / factor:.3g} {readable(unit)}')
    for most in (3, 2, 1):          # in a row: beside the name of the axes there may be no room
        rows = [';  '.join(said[k:k + most]) for k in range(0, len(said), most)]
        text = ax.set_title('\n'.join(rows), fontsize=SMALL, loc='right', color=MEASURED)
        if fits_beside_name(ax, text):
            break


def _band(ax, x, lo, hi, middle):
    ax.fill_between(x, lo, hi, color=MEASURED, alpha=0.16, linewidth=0)
    ax.plot(x, middle, color=MEASURED, linewidth=1.6)


def _colour(state, label):
    return EFFECTS[state.model.labels.index(label) % len(EFFECTS)]


def _dashed(ax, state, label, x, y):
    """Draw one effect's line; return what its label needs."""
    seen, colour = observable(state, label), _colour(state, label)
    ax.plot(x, y, '--', color=colour, linewidth=1.1, alpha=1 if seen else 0.45)
    return x, y, label if seen else f'({label})', colour


def _effect_lines(ax, state, found, factor):
    c = evidence_of(state).curve
    lines = []
    for label, v in found.each.items():
        if isinstance(state.model[label], Line):
            v = line_envelope(state.model[label], c.m, c.dt)
        y = np.sqrt(np.maximum(v, 1e-300)) / factor
        if np.sum(y > ax.get_ylim()[0]) > 2:        # what only touches a corner has no name there
            lines.append(_dashed(ax, state, label, c.tau, y))
    return lines


def _mark(ax, x, y, name, colour, below):
    """Circle a reading; its name stays clear of the curve. Return where that stands."""
    ax.plot([x], [y], 'o', markersize=6, markerfacecolor='white', markeredgecolor=colour,
            markeredgewidth=1.6, zorder=7)
    ax.annotate(name, (x, y), xytext=(5, -10 if below else 5), textcoords='offset points',
                fontsize=SMALL, fontweight='bold', color=colour, zorder=7,
                bbox={'facecolor': 'white', 'edgecolor': 'none', 'pad': 0.5, 'alpha': 0.85})
    points = ax.figure.dpi / 72
    at = ax.transData.transform((x, y)) + points * np.array([8, -7 if below else 8])
    return tuple(ax.transData.inverted().transform(at))


def pulls(ax: Axes, x: np.ndarray, pull: np.ndarray, label: str = '', xlabel: str = TAU) -> Axes:
    """
    Draw standard errors between measurement and model against x on a logarithmic scale.

    What lies beyond 2 is filled; runs that chance hardly explains are shaded, and the worst of
    them carries the label: the suspected effect.

    """
    x, pull = np.asarray(x), np.asarray(pull)
    dress(ax, x=xlabel, y='pull')
    top = float(np.clip(1.15 * np.max(np.abs(pull), initial=0.0), 4, 12))
    shown = np.clip(pull, -top, top)
    log_scale(ax.xaxis, x[0], x[-1] * 1.05)
    ax.set_ylim(-top, top)
    tick = 2 if top < 5 else 4 if top < 9 else 10
    ax.set_yticks([-tick, 0, tick])
    ax.axhspan(-NOTABLE, NOTABLE, color=CHANCE, linewidth=0)
    for sign in (1, -1):
        ax.fill_between(x, sign * NOTABLE, shown, where=sign * shown > NOTABLE, interpolate=True,
                        color=FAIL, alpha=0.55, linewidth=0)
    ax.plot(x, shown, color=MEASURED, linewidth=1.0)
    marked = runs(pull)
    shade(ax, x, marked)
    if marked and label:
        _name_run(ax, x, pull, max(marked, key=lambda r: np.sum(pull[r[0]:r[1]] ** 2)), label)
    return ax


def _name_run(ax, x, pull, run, label):
    """Write a label on the side of zero where the pull is not."""
    a, b = run
    middle = np.sqrt(x[a] * x[b - 1])
    share = np.log(middle / x[0]) / np.log(x[-1] / x[0])
    side = 'left' if share < 0.25 else 'right' if share > 0.75 else 'center'
    at = {'left': x[a], 'right': x[b - 1], 'center': middle}[side]
    positive = np.mean(pull[a:b]) > 0
    ax.text(at, 0.06 if positive else 0.94, label, transform=ax.get_xaxis_transform(), ha=side,
            va='bottom' if positive else 'top', fontsize=SMALL, fontweight='bold', color=FAIL)


def shade(ax: Axes, x: np.ndarray, marked: Sequence[tuple[int, int]]) -> Axes:
    """Shade stretches of x (k,), given as [begin, end) indices, half-way to their neighbours."""
    edges = np.concatenate([x[:1], np.sqrt(x[1:] * x[:-1]), x[-1:]])
    for a, b in marked:
        ax.axvspan(edges[a], edges[b], color=FAIL, alpha=0.10, linewidth=0)
    return ax


HATCHED: dict[str, Any] = {
    'facecolor': 'none', 'edgecolor': '#b9b9b9', 'hatch': '////', 'linewidth': 0.0, 'zorder': 0}


def psd(ax: Axes, state: State) -> Axes:
    """Draw the measured noise density with its 95 % band, the model, each effect, lines found."""
    e = evidence_of(state)
    unit = DENSITY[e.sensor][1]
    d = densities(state)
    f, v, level = d.f, d.model, d.level
    total = d.with_lines(state)
    known = state.model.of(Mean) + state.model.of(Coupling)
    less = f' less {", ".join(x.label for x in known)}' if known else ''
    dress(ax, f'{e.axis}: spectrum{less}', 'frequency, Hz',
          f'noise density (two-sided), {readable(unit)}')
    ax.set_title(_white_level(state), fontsize=SMALL, loc='right', color=MEASURED)
    log_scale(ax.xaxis, f[0], f[-1] * 1.05)
    log_scale(ax.yaxis, min(level.min(), v.min()) / 3, 2 * max(level.max(), v.max(), total.max()))
    ax.plot(f, total, '.', color=FAINT, markersize=2.0, alpha=0.5)
    _band(ax, d.mid, d.lo, d.hi, level)
    lines = [_dashed(ax, state, label, f, s) for label, s in d.each.items()]
    ax.plot(f, v, color=MODEL, linewidth=1.5)
    label_lines(ax, lines, [(d.mid, level)])
    for i in views.lines_left(e, state.model)[:3]:
        _name_line(ax, e, e.line_table[i, 0], total)
    hatch(ax, state)
    return ax


def _white_level(state: State) -> str:
    """Return N in the unit of the spectrum, and in the one that it is printed in."""
    found = state.fit.estimates.get('white', {}).get('N')
    if found is None or found.value is None:
        return ''
    sensor = evidence_of(state).sensor
    factor, unit = DENSITY[sensor]
    said = [(factor, unit)]
    printed = units.field('{rate}/sqrt(Hz)', sensor)
    said += [printed] if printed != said[0] else []
    return ' = '.join(['N', *(f'{found.value / f:.3g} {readable(u)}' for f, u in said)])


def set_aside(state: State) -> list[dict[str, Any]]:
    """Return the stretches of the spectrum that the fit does not rest on, as plain data."""
    return state.problem.basis(state.fit).get('set_aside', [])


def hatch(ax: Axes, state: State) -> None:
    """Hatch the stretches of the spectrum that the fit does not rest on."""
    for s in set_aside(state):
        ax.axvspan(s['from_hz'], s['to_hz'], **HATCHED)


def _name_line(ax, e, at, density):
    """Draw a line of the spectrum that the model does not hold, with its frequency."""
    top = density[e.whole.bins.index(min(max(1, round(2 * e.duration * at)), e.whole.n - 1))]
    ax.plot([at, at], [ax.get_ylim()[0], top], color=FAIL, linewidth=1.0)
    ax.annotate(f'{at:.4g} Hz', (at, top), xytext=(0, 4), textcoords='offset points', ha='center',
                fontsize=SMALL, color=FAIL, fontweight='bold')


def series(ax: Axes, state: State, left_out: Sequence[Stretch] = (),
           xlabel: bool = True, key: bool = True) -> Axes:
    """
    Draw the time series: extremes of each column, block means, what the model says of the mean.

    Parameters
    ----------
    ax : Axes
        Drawn on, and returned.
    state : State
        Of a noise study.
    left_out : iterable of (from, to, ...)
        Stretches that the fit did not use, s from the first sample.
    xlabel : bool
        Whether to label the time axis.
    key : bool
        Whether to say in it what is drawn.

    """
    e = evidence_of(state)
    factor, unit = SHOWN[e.sensor]
    t, lo, hi = e.envelope.T
    mean = float(np.mean(e.slow_y))
    scale, word = _time_unit(e.duration)
    dress(ax, f'{e.axis}, less its mean {mean / factor:.5g} {readable(unit)}',
          f'time, {word}' if xlabel else '', readable(unit))
    ax.fill_between(t / scale, (lo - mean) / factor, (hi - mean) / factor,
                    color=AXES[e.axis[-1]], alpha=0.45, linewidth=0)
    slow_t, slow = coarse(e)
    ax.plot(slow_t / scale, (slow - mean) / factor, color=MEASURED, linewidth=1.0)
    if state.model.of(Mean):
        known = views.slow_mean(e, state.model)
        ax.plot(e.slow_t / scale, (known - np.mean(known)) / factor, color=MODEL, linewidth=1.4)
    for begin, end, *_ in left_out:
        # the edge shows what is shorter than a pixel
        ax.axvspan(begin / scale, end / scale, color=FAINT, alpha=0.3, linewidth=1.0)
    ax.set_xlim(0, e.duration / scale)
    if key:
        ax.legend(handles=series_key(bool(state.model.of(Mean)), bool(left_out),
                                     AXES[e.axis[-1]]),
                  fontsize=SMALL, frameon=False, loc='upper right', ncol=4, handlelength=1.2,
                  columnspacing=1.0, borderaxespad=0.1)
        low, high = ax.get_ylim()
        ax.set_ylim(low, high + 0.15 * (high - low))        # room for it
    return ax


def series_key(mean: bool, left_out: bool, colour: str = FAINT) -> list[Any]:
    """Return the handles of a legend of time series."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch
    out: list[Any] = [Patch(color=colour, alpha=0.45, linewidth=0, label='smallest to largest'),
                      Line2D([], [], color=MEASURED, linewidth=1.0, label='means')]
    if mean:
        out.append(Line2D([], [], color=MODEL, linewidth=1.4, label='model of the mean'))
    if left_out:
        out.append(Patch(color=FAINT, alpha=0.3, linewidth=0, label='left out'))
    return out


def _time_unit(duration):
    return (3600.0, 'h') if duration > 7200 else (60.0, 'min') if duration > 300 else (1.0, 's')


def in_time(ax: Axes, state: State) -> Axes:
    """Draw the rms of the noise in time beside its mean over the record; grey: chance."""
    e = evidence_of(state)
    t, ratio, spread = noise_level(state)
    scale, word = _time_unit(e.duration)
    dress(ax, f'{e.axis}: noise level in time', f'time, {word}', 'rms / mean rms')
    _beside_chance(ax, t / scale, np.sqrt(ratio), *chance_of_level(spread))
    ax.set_xlim(0, e.duration / scale)
    return ax


def distribution(ax: Axes, state: State) -> Axes:
    """Draw how many samples lie where a normal distribution puts equally many; grey: chance."""
    e = evidence_of(state)
    at, cells, expected, chance = against_normal(state)
    dress(ax, f'{e.axis}: distribution of the samples', 'standard deviations from the mean',
          'samples / normal')
    _beside_chance(ax, at, cells / expected, 1 - chance, 1 + chance, 'steps-mid')
    return ax


def _beside_chance(ax, x, ratio, lo, hi, style='default'):
    """Draw a ratio whose expectation is 1, what chance allows, and the points beyond it."""
    ax.axhspan(lo, hi, color=CHANCE, linewidth=0)
    ax.plot(x, ratio, color=MEASURED, linewidth=1.0, drawstyle=style)
    out = (ratio < lo) | (ratio > hi)
    ax.plot(x[out], ratio[out], '.', color=FAIL, markersize=5)
    reach = 1.3 * max(np.max(np.abs(ratio - 1)), hi - 1)
    ax.set_ylim(max(0, 1 - reach), 1 + reach)
