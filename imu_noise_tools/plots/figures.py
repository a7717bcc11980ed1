"""Whole figures of a noise study: all curves, one target in full, the time series."""

from __future__ import annotations

from ..study import Diagnosis, State, Study
from .curves import curves, runs
from .noise import allan, distribution, in_time, psd, pulls, series, shade, suspected
from .style import AXES, dress, log_scale, MEASURED, MODEL, new_figure, readable, SMALL
from .. import units
from ..noise import views


def _rows(study: Study) -> list[list[str]]:
    rows = [[t for t in study.targets if t.startswith(s)] for s in ('gyro', 'accel')]
    return [r for r in rows if r]


def allan_figure(study: Study):
    """Return all curves of a study: a row a sensor, its axes with the pulls below, and all its axes together."""
    rows = _rows(study)
    columns = max(len(r) for r in rows) + 1
    figure = new_figure(max(8.0, 4.0 * columns), 5.0 * len(rows) + 0.4)
    high = figure.get_figheight()
    for i, row in enumerate(rows):
        top, bottom = 1 - (0.6 + 5.0 * i) / high, 1 - (5.0 * (i + 1) - 0.15) / high
        grid = figure.add_gridspec(2, columns, left=0.62 / figure.get_figwidth(), right=0.99, top=top, bottom=bottom,
                                   height_ratios=[3.4, 1], hspace=0.08, wspace=0.22)
        for k, target in enumerate(row):
            state, diagnosis = study.states[target], study.diagnosis.get(target)
            _curve_and_pulls(figure, grid, k, state, diagnosis)
        _together(figure.add_subplot(grid[:, len(row)]), study, row)
    _key(figure)
    return figure


def _curve_and_pulls(figure, grid, column, state: State, diagnosis: Diagnosis | None):
    found = curves(state)
    upper = figure.add_subplot(grid[0, column])
    allan(upper, state, found)
    upper.set_ylabel(upper.get_ylabel() if column == 0 else '', fontsize=SMALL)
    if found is None:
        upper.set_xlabel('averaging time τ, s', fontsize=SMALL)
        return
    upper.tick_params(labelbottom=False)
    shade(upper, found.tau, runs(found.pull))
    lower = pulls(figure.add_subplot(grid[1, column]), found.tau, found.pull, suspected(diagnosis))
    lower.set_ylabel('pull' if column == 0 else '', fontsize=SMALL)


def _together(ax, study, row):
    evidence = [study.states[t].problem.evidence for t in row]
    factor, unit = units.field('{rate}', evidence[0].sensor)
    dress(ax, f'{evidence[0].sensor}: all axes', 'averaging time τ, s', '')
    log_scale(ax.xaxis, min(e.curve.tau[0] for e in evidence), 1.05 * max(e.curve.tau[-1] for e in evidence))
    log_scale(ax.yaxis, min(e.curve.dev.min() for e in evidence) / factor / 2, max(e.curve.hi.max() for e in evidence) / factor * 1.5)
    for e in evidence:
        c, colour = e.curve, AXES[e.axis[-1]]
        ax.fill_between(c.tau, c.lo / factor, c.hi / factor, color=colour, alpha=0.12, linewidth=0)
        ax.plot(c.tau, c.dev / factor, color=colour, linewidth=1.6, label=e.axis)
    ax.legend(fontsize=SMALL, frameon=False, loc='upper right')
    return ax


def _key(figure):
    from matplotlib.lines import Line2D
    entries = [Line2D([], [], color=MEASURED, linewidth=1.6, label='measured, with 95 % band'),
               Line2D([], [], color=MODEL, linewidth=1.5, label='model'),
               Line2D([], [], color=MEASURED, linewidth=1.1, linestyle='--', label='one effect alone'),
               Line2D([], [], color=MEASURED, marker='o', markerfacecolor='white', linestyle='none',
                      label='where a coefficient is read'),
               Line2D([], [], color='#e9a9a1', linewidth=7, label='measured and model differ: |pull| > 2')]
    figure.legend(handles=entries, loc='upper center', ncol=len(entries) if figure.get_figwidth() > 11 else 2, fontsize=SMALL,
                  frameon=False, handlelength=1.8, borderaxespad=0.2)


def target_figure(state: State, diagnosis: Diagnosis | None = None, left_out=()):
    """Return one axis in full: Allan deviation and spectrum with pulls, time series, loudness, distribution."""
    figure = new_figure(14, 8.4)
    grid = figure.add_gridspec(2, 2, left=0.055, right=0.99, top=0.93, bottom=0.36, height_ratios=[3.4, 1], hspace=0.08, wspace=0.14)
    label = suspected(diagnosis)
    _curve_and_pulls(figure, grid, 0, state, diagnosis)
    upper = psd(figure.add_subplot(grid[0, 1]), state)
    upper.tick_params(labelbottom=False)
    upper.set_xlabel('')
    view = views.frequency(state.problem.evidence, 'whole', state.fit, fitted_here=True)
    pulls(figure.add_subplot(grid[1, 1]), view.x, view.pull, label, 'frequency, Hz')
    below = figure.add_gridspec(1, 3, left=0.055, right=0.99, top=0.26, bottom=0.065, wspace=0.2)
    series(figure.add_subplot(below[0]), state, left_out)
    in_time(figure.add_subplot(below[1]), state)
    distribution(figure.add_subplot(below[2]), state)
    _key(figure)
    return figure


def series_figure(study: Study, left_out=()):
    """Return the time series of all axes, a row for each of x, y, z, a column a sensor."""
    rows = _rows(study)
    count = max(len(r) for r in rows)
    figure = new_figure(6.5 * len(rows), 1.75 * count + 0.3)
    high = figure.get_figheight()
    grid = figure.add_gridspec(count, len(rows), left=0.7 / figure.get_figwidth(), right=0.99, top=1 - 0.28 / high,
                               bottom=0.45 / high, hspace=0.42, wspace=0.16)
    for k, row in enumerate(rows):
        for i, target in enumerate(row):
            series(figure.add_subplot(grid[i, k]), study.states[target], left_out, xlabel=i == len(row) - 1)
    return figure
