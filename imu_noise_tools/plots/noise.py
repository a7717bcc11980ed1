# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Whole figures of a noise study: all curves, one target in full, the time series."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TYPE_CHECKING

from .curves import curves, evidence_of, runs, TAU
from .ladder import ladder, ladder_figure
from .looks import panels
from .panels import (
    allan, distribution, HATCHED, in_time, psd, pulls, series, series_key, set_aside, shade,
    Stretch, suspected
)
from .signed import signed
from .style import AXES, dress, log_scale, MEASURED, MODEL, new_figure, pixels, png, SMALL
from ..core import units
from ..health import MOTION_KEPT
from ..loop.diagnosis import Diagnosis
from ..loop.prediction import State
from ..loop.study import Study
from ..noise import in_frequency
from ..noise.kinds import Mean

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ['allan', 'allan_figure', 'distribution', 'in_time', 'ladder', 'ladder_figure', 'panels',
           'pictures', 'pixels', 'png', 'psd', 'pulls', 'series', 'series_figure', 'target_figure']


def pictures(study: Study, full: Sequence[str] = ()) -> dict[str, bytes]:
    """
    Return the pictures of a noise study by name.

    ``series``, ``allan``, and ``target <name>`` of each target that is wanted in full.

    """
    figures = {'series': series_figure(study), 'allan': allan_figure(study)}
    for t in full:
        figures[f'target {t}'] = target_figure(
            study.states[t], study.diagnosis.get(t), left_out(study, t))
    if study.source.get('keep_motion'):
        for figure in figures.values():
            figure.text(0.004, 0.004, MOTION_KEPT, fontsize=SMALL, color=MODEL)
    return {name: png(signed(figure, study.source)) for name, figure in figures.items()}


def left_out(study: Study, target: str) -> Sequence[Stretch]:
    """Return the stretches (from, to, why), s from the first sample, that a fit does not use."""
    streams = study.source.get('streams') or {}
    source = streams.get(target.partition('_')[0], study.source)
    begin = source.get('begin_s') or 0.0
    return [(a - begin, b - begin, why) for a, b, why in source.get('left_out') or ()]


def _rows(study: Study) -> list[list[str]]:
    """Targets by sensor."""
    rows = [[t for t in study.targets if t.startswith(s)] for s in ('gyro', 'accel')]
    return [r for r in rows if r]


def allan_figure(study: Study) -> Figure:
    """
    Return all curves of a noise study: a row a sensor, its axes with pulls below, then together.

    1600 x 1040 pixels for six axes.

    """
    rows = _rows(study)
    columns = max(len(r) for r in rows) + 1
    wide, high = max(8.0, 4.0 * columns), 5.0 * len(rows) + 0.4
    figure = new_figure(wide, high)
    for i, row in enumerate(rows):
        grid = figure.add_gridspec(
            2, columns, left=0.62 / wide, right=0.99, top=1 - (0.6 + 5.0 * i) / high,
            bottom=1 - (5.0 * i + 4.85) / high, height_ratios=[3.4, 1], hspace=0.08, wspace=0.22)
        for k, target in enumerate(row):
            label = suspected(study.diagnosis.get(target))
            _curve_and_pulls(figure, grid, k, study.states[target], label)
        _together(figure.add_subplot(grid[:, -1]), study, row)
    _key(figure)
    return figure


def _curve_and_pulls(figure, grid, column, state: State, label: str):
    """Draw one axis' curve, its pulls below where a model can be drawn; y labels in column 0."""
    found = curves(state)
    upper = allan(figure.add_subplot(grid[0, column]), state, found)
    if column:
        upper.set_ylabel('')
    if found is None:
        upper.set_xlabel(TAU, fontsize=SMALL)
        return
    upper.tick_params(labelbottom=False)
    shade(upper, found.tau, runs(found.pull))
    lower = pulls(figure.add_subplot(grid[1, column]), found.tau, found.pull, label)
    if column:
        lower.set_ylabel('')


def _together(ax, study, row):
    evidence = [evidence_of(study.states[t]) for t in row]
    factor, _ = units.field('{rate}', evidence[0].sensor)
    curves_ = [e.curve for e in evidence]
    dress(ax, f'{evidence[0].sensor}: all axes', TAU)
    log_scale(ax.xaxis, min(c.tau[0] for c in curves_), 1.05 * max(c.tau[-1] for c in curves_))
    log_scale(ax.yaxis, min(c.dev.min() for c in curves_) / factor / 2,
              max(c.hi.max() for c in curves_) / factor * 1.5)
    for e, c in zip(evidence, curves_):
        colour = AXES[e.axis[-1]]
        ax.fill_between(c.tau, c.lo / factor, c.hi / factor, color=colour, alpha=0.12, linewidth=0)
        ax.plot(c.tau, c.dev / factor, color=colour, linewidth=1.6, label=e.axis)
    ax.legend(fontsize=SMALL, frameon=False, loc='upper right')


def _key(figure, hatched=False):
    """Say once what the lines of all panels are."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch
    circle = {'marker': 'o', 'markerfacecolor': 'white', 'linestyle': 'none'}
    dashes = {'linestyle': '--', 'linewidth': 1.1}
    entries: list[tuple[str, dict[str, Any]]] = [
        ('measured, with 95 % band', {'color': MEASURED, 'linewidth': 1.6}),
        ('model', {'color': MODEL, 'linewidth': 1.5}),
        ('one effect (in parentheses: not observable)', {'color': MEASURED, **dashes}),
        ('where a coefficient is read', {'color': MEASURED, **circle}),
        ('measured and model differ: |pull| > 2', {'color': '#e9a9a1', 'linewidth': 7})]
    handles: list = [Line2D([], [], label=name, **look) for name, look in entries]
    if hatched:
        handles.append(Patch(label='not explained: the fit does not rest on it', **HATCHED))
    figure.legend(handles=handles, loc='upper center',
                  ncol=len(handles) if figure.get_figwidth() > 11 else 3, fontsize=SMALL,
                  frameon=False, handlelength=1.8, borderaxespad=0.2)


def target_figure(state: State, diagnosis: Diagnosis | None = None,
                  left_out: Sequence[Stretch] = ()) -> Figure:
    """
    Return one axis in full: Allan deviation, spectrum, pulls, series, noise level, distribution.

    Parameters
    ----------
    state : State
        Of a noise study.
    diagnosis : Diagnosis or None
        Names what is suspected where the pulls fail.
    left_out : iterable of (from, to, ...)
        Stretches that the fit did not use, s from the first sample.

    """
    figure = new_figure(14, 8.4)
    grid = figure.add_gridspec(2, 2, left=0.055, right=0.99, top=0.93, bottom=0.36,
                               height_ratios=[3.4, 1], hspace=0.08, wspace=0.14)
    label = suspected(diagnosis)
    _curve_and_pulls(figure, grid, 0, state, label)
    upper = psd(figure.add_subplot(grid[0, 1]), state)
    upper.tick_params(labelbottom=False)
    upper.set_xlabel('')
    view = in_frequency.frequency(evidence_of(state), 'whole', state.fit, fitted_here=True)
    shade(upper, view.x, runs(view.pull))
    pulls(figure.add_subplot(grid[1, 1]), view.x, view.pull, label, 'frequency, Hz')
    below = figure.add_gridspec(1, 3, left=0.055, right=0.99, top=0.26, bottom=0.065, wspace=0.2)
    series(figure.add_subplot(below[0]), state, left_out)
    in_time(figure.add_subplot(below[1]), state)
    distribution(figure.add_subplot(below[2]), state)
    _key(figure, bool(set_aside(state)))
    return figure


def series_figure(study: Study) -> Figure:
    """Return the time series of all axes of a noise study: a column a sensor, a row an axis."""
    rows = _rows(study)
    count = max(len(r) for r in rows)
    wide, high = 6.5 * len(rows), 1.75 * count + 0.52
    figure = new_figure(wide, high)
    grid = figure.add_gridspec(count, len(rows), left=0.7 / wide, right=0.99, top=1 - 0.5 / high,
                               bottom=0.45 / high, hspace=0.42, wspace=0.16)
    for k, row in enumerate(rows):
        for i, target in enumerate(row):
            series(figure.add_subplot(grid[i, k]), study.states[target],
                   left_out(study, target), xlabel=i == len(row) - 1, key=False)
    figure.legend(handles=series_key(any(s.model.of(Mean) for s in study.states.values()),
                                     any(left_out(study, t) for t in study.targets)),
                  loc='upper right', ncol=4, fontsize=SMALL, frameon=False, borderaxespad=0.2)
    return figure
