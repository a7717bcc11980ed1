# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Pictures of a filter.

Before and after against the truth, innovations, the autoregression of a record at rest.

"""

from __future__ import annotations

import numpy as np

from .style import (
    dress,
    EFFECTS,
    FAINT,
    GOOD,
    log_scale,
    MEASURED,
    MODEL,
    new_figure,
    NORMAL,
    SMALL,
)
from ..core.units import DEG
from ..filter.evaluate import autocorrelation, distribution_view, spectrum_view

POINTS = 4000           # drawn of a series at most


def before_after(ax, t, raw, filtered, truth=None, variance=None, title: str = ''):
    """
    Draw raw and filtered rates (rad/s, (n,)) in deg/s over t (s), the truth where there is one.

    ``variance`` (n,), rad^2/s^2, is drawn as the filter's own 95 % band.

    """
    dress(ax, title, 'time, s', 'rate, °/s')
    some = slice(None, None, max(1, len(t) // POINTS))
    ax.plot(t[some], raw[some] / DEG, color=FAINT, linewidth=0.5, alpha=0.7, label='raw')
    if variance is not None:
        half = 1.96 * np.sqrt(variance[some])
        ax.fill_between(
            t[some],
            (filtered[some] - half) / DEG,
            (filtered[some] + half) / DEG,
            color=MODEL,
            alpha=0.25,
            linewidth=0,
        )
    if truth is not None:
        ax.plot(t[some], truth[some] / DEG, color=GOOD, linewidth=1.4, label='true')
    ax.plot(t[some], filtered[some] / DEG, color=MODEL, linewidth=1.0, label='filtered')
    ax.legend(
        fontsize=SMALL,
        frameon=False,
        loc='lower right',
        bbox_to_anchor=(1, 1),
        ncols=3,
        borderpad=0,
    )
    return ax


def error_before_after(ax, t, raw, filtered, title: str = ''):
    """Draw errors (rad/s, (n,)) before and after the filter in deg/s."""
    dress(ax, title, 'time, s', 'error, °/s')
    some = slice(None, None, max(1, len(t) // POINTS))
    ax.plot(t[some], raw[some] / DEG, color=FAINT, linewidth=0.5, alpha=0.7,
            label=f'before: std {np.std(raw) / DEG:.3g}')
    ax.plot(
        t[some],
        filtered[some] / DEG,
        color=MODEL,
        linewidth=1.0,
        label=f'after: std {np.std(filtered) / DEG:.3g}',
    )
    ax.legend(
        fontsize=SMALL,
        frameon=False,
        loc='lower right',
        bbox_to_anchor=(1, 1),
        ncols=2,
        borderpad=0,
    )
    return ax


def error_by_filter(ax, names, errors, raw: float, title: str = ''):
    """
    Draw the rms error of filters side by side on a log scale.

    In deg/s; that of no filter as a line.

    """
    dress(ax, title, '', 'rms error, °/s')
    errors = np.asarray(errors, float)
    top, low = 2.2 * max(errors.max(), raw), 0.6 * min(errors.min(), raw)
    log_scale(ax.yaxis, low, top)
    x = np.arange(len(names))
    ax.bar(
        x, errors - low, bottom=low, width=0.6, color=[MODEL if e > raw else GOOD for e in errors]
    )
    ax.axhline(raw, color=MEASURED, linewidth=1.0, linestyle='--')
    ax.text(len(names) - 0.55, raw * 1.05, 'no filter', fontsize=SMALL, color=MEASURED, ha='right')
    for i, e in enumerate(errors):
        ax.text(i, e * 1.06, f'{e:.3g}', ha='center', fontsize=SMALL, fontweight='bold')
    ax.set_xticks(x)
    ax.set_xticklabels(names, fontsize=SMALL)
    ax.grid(False, axis='x')
    return ax


def ladder_by_amplitude(figure, amplitude, rungs, raw: float):
    """
    Draw a ladder of models in rocking: error against the truth, and what the loop sees of it.

    ``rungs`` maps a name to ``std`` (deg/s) and ``lost`` (nats a sample), each for every
    ``amplitude`` (deg); ``raw`` is the error of no filter, deg/s.

    """
    grid = figure.add_gridspec(1, 2, left=0.075, right=0.985, top=0.9, bottom=0.25, wspace=0.22)
    panels = [('error against the truth', 'std of the error, °/s', 'std'),
              ('error of the loop: no truth is needed', 'nats lost a sample', 'lost')]
    for k, (title, y, key) in enumerate(panels):
        ax = dress(figure.add_subplot(grid[k]), title, 'amplitude of rocking, °', y)
        every = np.concatenate([np.asarray(v[key]) for v in rungs.values()])
        log_scale(ax.xaxis, 0.8 * min(amplitude), 1.25 * max(amplitude))
        log_scale(ax.yaxis, 0.5 * every.min(), 2 * every.max())
        ax.set_xticks(amplitude, [f'{a:g}' for a in amplitude])
        for i, (name, v) in enumerate(rungs.items()):
            ax.plot(amplitude, v[key], 'o-', color=EFFECTS[(0, 3, 1)[i % 3]], linewidth=1.6,
                    markersize=4.5, label=name)
        if key == 'std':
            ax.axhline(raw, color=MEASURED, linewidth=1.0, linestyle='--')
            ax.text(amplitude[-1], raw * 1.08, 'no filter', fontsize=SMALL, color=MEASURED,
                    ha='right')
    figure.legend(*ax.get_legend_handles_labels(), fontsize=NORMAL, frameon=False,
                  loc='lower center', ncols=len(rungs))
    return figure


def correlation(ax, z, lags: int = 40, title: str = ''):
    """Draw the autocorrelation of z (n,) with the 95 % limits of white noise."""
    dress(ax, title, 'lag, samples', 'autocorrelation')
    r = autocorrelation(z, lags)
    limit = 1.96 / np.sqrt(len(z))
    ax.axhspan(-limit, limit, color=GOOD, alpha=0.15, linewidth=0)
    ax.vlines(
        np.arange(1, lags + 1),
        0,
        r[1:],
        color=np.where(np.abs(r[1:]) > limit, MODEL, MEASURED),
        linewidth=1.5,
    )
    ax.axhline(0, color=FAINT, linewidth=0.8)
    ax.set_xlim(0, lags + 1)
    return ax


def innovations(axes, u, dt: float, title: str = ''):
    """
    Draw scores u (n,) into four Axes: in time, spectrum, distribution, autocorrelation.

    All flat if the model is right. ``title`` is put before that of the first.

    """
    time, spectrum, distribution, lags = axes
    dress(time, f'{title}: innovations' if title else 'innovations', 'time, s', 'sigma')
    some = slice(None, None, max(1, len(u) // POINTS))
    time.plot((np.arange(len(u)) * dt)[some], u[some], '.', markersize=1.5, color=MEASURED)
    time.axhspan(-1.96, 1.96, color=GOOD, alpha=0.15, linewidth=0)
    view = spectrum_view(u, dt)
    dress(spectrum, 'spectrum: pull from flat', 'frequency, Hz', 'sigma')
    log_scale(spectrum.xaxis, view.x[0], view.x[-1], most=4)
    _pulls(spectrum, view.x, view.pull)
    view = distribution_view(u)
    dress(distribution, 'distribution: pull from normal', 'sigma of the innovation', 'sigma')
    _pulls(distribution, view.x, view.pull)
    correlation(lags, u, title='autocorrelation')
    return axes


def _pulls(ax, x, pull):
    ax.axhspan(-2, 2, color=GOOD, alpha=0.15, linewidth=0)
    ax.vlines(x, 0, pull, color=np.where(np.abs(pull) > 2, MODEL, MEASURED), linewidth=1.2)
    ax.axhline(0, color=FAINT, linewidth=0.8)
    return ax


def innovations_figure(scores, dt: float):
    """Return a figure of :func:`innovations`, a row for each name of ``scores``: its u (n,)."""
    rows = len(scores)
    height = 2.5 * rows + 0.4
    figure = new_figure(13.0, height)
    grid = figure.add_gridspec(rows, 4, left=0.045, right=0.99, top=1 - 0.35 / height,
                               bottom=0.55 / height, hspace=0.62, wspace=0.27)
    for i, (name, u) in enumerate(scores.items()):
        innovations([figure.add_subplot(grid[i, k]) for k in range(4)], u, dt, name)
    return figure


def study_figure(study):
    """Return the figure of the innovations of a filter's study under its present models."""
    states = study.states
    scores = {t: state.problem.prediction(state.fit.model).u
              for t, state in states.items()}
    return innovations_figure(scores, next(iter(states.values())).problem.dt)
