# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pictures of a filter: its innovations, and their autocorrelation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import cast, TYPE_CHECKING

import numpy as np

from .curves import rebinned
from .panel import Curve, Panel, plain
from .signed import signed
from .style import dress, FAINT, GOOD, log_scale, MEASURED, MODEL, new_figure, png, readable
from ..core import units
from ..core.allan import interval
from ..core.spectrum import bins_of, cosine_transform, power
from ..core.statistics import TWO_SIDED
from ..filter import FilterProblem
from ..filter.evaluate import autocorrelation, distribution_view, spectrum_view, time_view
from ..filter.predict import Prediction
from ..filter.statespace import FilterEffect, Motion, psd
from ..loop.effect import Model
from ..loop.prediction import State
from ..loop.study import Study

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

POINTS = 4000           # drawn of a series at most


def correlation(ax: Axes, z: np.ndarray, lags: int = 40, title: str = '') -> Axes:
    """Draw the autocorrelation of z (n,) with the 95 % limits of white noise."""
    dress(ax, title, 'lag, samples', 'autocorrelation')
    r = autocorrelation(z, lags)
    limit = TWO_SIDED / np.sqrt(len(z))
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


def innovations(axes: Sequence[Axes], u: np.ndarray, dt: float,
                title: str = '') -> Sequence[Axes]:
    """
    Draw scores u (n,) into four Axes: in time, spectrum, distribution, autocorrelation.

    All flat if the model is right. ``title`` is put before that of the first.

    """
    time, spectrum, distribution, lags = axes
    dress(time, f'{title}: innovations' if title else 'innovations', 'time, s', 'sigma')
    some = slice(None, None, max(1, len(u) // POINTS))
    time.plot((np.arange(len(u)) * dt)[some], u[some], '.', markersize=1.5, color=MEASURED)
    time.axhspan(-TWO_SIDED, TWO_SIDED, color=GOOD, alpha=0.15, linewidth=0)
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


def innovations_figure(scores: Mapping[str, np.ndarray], dt: float) -> Figure:
    """Return a figure of :func:`innovations`, a row for each name of ``scores``: its u (n,)."""
    rows = len(scores)
    height = 2.5 * rows + 0.4
    figure = new_figure(13.0, height)
    grid = figure.add_gridspec(rows, 4, left=0.045, right=0.99, top=1 - 0.35 / height,
                               bottom=0.55 / height, hspace=0.62, wspace=0.27)
    for i, (name, u) in enumerate(scores.items()):
        innovations([figure.add_subplot(grid[i, k]) for k in range(4)], u, dt, name)
    return figure


def study_figure(study: Study) -> Figure:
    """Return the figure of the innovations of a filter's study under its present models."""
    problems = {t: cast(FilterProblem, s.problem) for t, s in study.states.items()}
    scores = {t: p.prediction(study.states[t].fit.model).u for t, p in problems.items()}
    return innovations_figure(scores, next(iter(problems.values())).dt)


def pictures(study: Study, full: Sequence[str] = ()) -> dict[str, bytes]:
    """Return the picture of a filter's study, ``innovations``; no target has one of its own."""
    return {'innovations': png(signed(study_figure(study), study.source))}


def panels(state: State) -> Mapping[str, Callable[[], Panel]]:
    """Return the panels of an axis: the spectrum with each effect's, scores by size and time."""
    problem = cast(FilterProblem, state.problem)
    return {'spectrum': lambda: _spectrum(problem, state.model),
            'distribution': lambda: plain(distribution_view(_seen(problem, state.model).smooth)),
            'level_in_time': lambda: plain(time_view(_seen(problem, state.model).u, problem.dt))}


def _seen(problem: FilterProblem, model: Model) -> Prediction:
    return problem.prediction(model)


def _spectrum(problem: FilterProblem, model: Model) -> Panel:
    """Return what was measured, what the model says of it, and the pulls of the innovations."""
    z, dt = problem.bridged, problem.dt
    bins = bins_of(len(z), dt)
    some = bins.f > 0
    f, count = bins.f[some], bins.count[some]
    measured = power(cosine_transform(z), dt, bins)[some]
    factor, unit = units.DEG, 'deg/s/sqrt(Hz)'

    def density(s: np.ndarray) -> np.ndarray:
        return np.sqrt(np.maximum(s, 1e-300) / 2) / factor

    mid, level, weight = rebinned(f, measured, count)
    lo, hi = interval(density(level), weight)
    lines = [Curve('every bin', f, density(measured), 'dots'),
             Curve('measured', mid, density(level), 'measured', lo, hi)]
    each = {e.label: s for e in model.of(FilterEffect) if (s := psd(e, f, dt)) is not None}
    if all(e.label in each for e in model.of(Motion)):
        lines.append(Curve('model', f, density(np.sum(list(each.values()), axis=0)), 'model'))
    lines += [Curve(label, f, density(s), 'effect') for label, s in each.items()]
    view = spectrum_view(_seen(problem, model).u, dt)
    return Panel('spectrum', 'frequency, Hz', 'Hz', view.x, view.pull,
                 f'spectrum of the rate (two-sided), {readable(unit)}', 'xy', tuple(lines))
