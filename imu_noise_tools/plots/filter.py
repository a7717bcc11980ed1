# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pictures of a filter: its innovations, and their autocorrelation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, cast, TYPE_CHECKING

import numpy as np

from .curves import rebinned
from .panel import Curve, Panel, plain
from .signed import signed
from .style import (
    dress, FAINT, GOOD, log_scale, MEASURED, MODEL, new_figure, NORMAL, png, readable, SMALL
)
from ..core import units
from ..core.allan import interval
from ..core.spectrum import bins_of, cosine_transform, power
from ..core.statistics import TWO_SIDED
from ..filter import FilterProblem
from ..filter.evaluate import autocorrelation, distribution_view, spectrum_view, time_view
from ..filter.predict import Prediction
from ..filter.statespace import FilterEffect, Motion, psd
from ..loop.effect import Finding, Fit, Model
from ..loop.findings import failures
from ..loop.prediction import State
from ..loop.study import Study

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

POINTS = 4000           # drawn of a series at most
PANELS = ('time', 'spectrum', 'distribution', 'lag')
BEYOND = '#8fa3b5'      # outside the band, as some are by chance or of a coarse model


@dataclass(frozen=True)
class Judged:
    """
    What the diagnosis makes of the innovations of an axis: the picture colours by it.

    ``failing`` holds the panels (``time``, ``spectrum``, ``distribution``, ``lag``) of which a
    test fails, ``said`` what is written above one.

    """

    failing: frozenset[str] = frozenset()
    said: Mapping[str, str] = field(default_factory=dict)


def judged(problem: FilterProblem, fit: Fit) -> Judged:
    """Return what the tests of a diagnosis say of each panel, and what the model loses."""
    failed = failures(problem.omnibus(fit))
    strict = {_panel(f) for f in failures(problem.strict(fit.model))}
    lost, where = problem.lost(fit.model), {_panel(f): f.evidence for f in reversed(failed)}
    said = {}
    for panel in PANELS:
        if panel in where:
            said[panel] = where[panel]
        elif panel in strict:
            said[panel] = 'no failure: a bank is coarse'
    amount, allowed = lost['spectrum']
    if allowed and 'spectrum' in strict and 'spectrum' not in where:
        said['spectrum'] = f'{amount:.2g} nats a sample lost, of {allowed:.2g} allowed'
    return Judged(frozenset(where), said)


def _panel(finding: Finding) -> str:
    """Return the panel that shows what a test of the innovations looks at."""
    return 'time' if finding.view == 'level' else finding.view


def correlation(ax: Axes, z: np.ndarray, lags: int = 40, title: str = '',
                failing: bool = True) -> Axes:
    """
    Draw the autocorrelation of z (n,) with the 95 % limits of white noise.

    Bars above them are bright where the test of it is ``failing``: below they say that the model
    allows for more motion than there is.

    """
    dress(ax, title, 'lag, samples', 'autocorrelation')
    r = autocorrelation(z, lags)
    limit = TWO_SIDED / np.sqrt(len(z))
    ax.axhspan(-limit, limit, color=GOOD, alpha=0.15, linewidth=0)
    ax.vlines(
        np.arange(1, lags + 1),
        0,
        r[1:],
        color=_colours(np.abs(r[1:]) > limit, (r[1:] > limit) & failing),
        linewidth=1.5,
    )
    ax.axhline(0, color=FAINT, linewidth=0.8)
    ax.set_xlim(0, lags + 1)
    return ax


def innovations(axes: Sequence[Axes], u: np.ndarray, dt: float,
                title: str = '', found: Judged | None = None,
                smooth: np.ndarray | None = None) -> Sequence[Axes]:
    """
    Draw scores u (n,) into four Axes: in time, spectrum, distribution, autocorrelation.

    All flat if the model is right. ``title`` is put before that of the first. What ``found``
    names as failing is bright, all where it is not known. ``smooth`` (n,) are the scores whose
    distribution is judged, where it is not that of u.

    """
    time, spectrum, distribution, lags = axes
    fails = set(PANELS) if found is None else found.failing
    dress(time, f'{title}: innovations' if title else 'innovations', 'time, s',
          'standard deviations')
    some = slice(None, None, max(1, len(u) // POINTS))
    time.plot((np.arange(len(u)) * dt)[some], u[some], '.', markersize=1.5, color=MEASURED)
    time.axhspan(-TWO_SIDED, TWO_SIDED, color=GOOD, alpha=0.15, linewidth=0)
    view = spectrum_view(u, dt)
    dress(spectrum, 'spectrum', 'frequency, Hz', 'power more than flat,\nstandard errors')
    log_scale(spectrum.xaxis, view.x[0], view.x[-1], most=4)
    # too little power is no failure: the model allows for motion that is not there
    _pulls(spectrum, view.x, view.pull, (view.pull > 2) & ('spectrum' in fails))
    view = distribution_view(u if smooth is None else smooth)
    dress(distribution, 'distribution', 'innovation, standard deviations',
          'samples more than normal,\nstandard errors')
    _pulls(distribution, view.x, view.pull, (np.abs(view.pull) > 2) & ('distribution' in fails))
    correlation(lags, u, title='autocorrelation', failing='lag' in fails)
    for panel, ax in zip(PANELS, axes):
        words = found.said.get(panel, '') if found else ''
        if words:       # below the title: both have the width of a panel
            ax.set_title(ax.get_title(loc='left') + '\n', fontsize=NORMAL, fontweight='bold',
                         loc='left', color=MEASURED)
            ax.text(0, 1.03, words, transform=ax.transAxes, fontsize=SMALL,
                    color=MODEL if panel in fails else FAINT)
    return axes


def _colours(beyond, bright):
    return np.where(bright, MODEL, np.where(beyond, BEYOND, MEASURED))


def _pulls(ax, x, pull, bright):
    ax.axhspan(-2, 2, color=GOOD, alpha=0.15, linewidth=0)
    ax.vlines(x, 0, pull, color=_colours(np.abs(pull) > 2, bright), linewidth=1.2)
    ax.axhline(0, color=FAINT, linewidth=0.8)
    return ax


def _key(figure: Figure) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch
    handles: list[Any] = [Patch(color=GOOD, alpha=0.15, linewidth=0,
                                label='where 95 % are if the model is right')]
    handles += [Line2D([], [], color=colour, linewidth=2, label=label) for colour, label in (
        (MEASURED, 'inside'), (BEYOND, 'outside, but no test of the diagnosis fails by it'),
        (MODEL, 'outside, and the test of this panel fails'))]
    figure.legend(handles=handles, loc='upper center', ncol=4, fontsize=SMALL, frameon=False,
                  handlelength=1.6, borderaxespad=0.2)


def innovations_figure(scores: Mapping[str, np.ndarray], dt: float,
                       found: Mapping[str, Judged] | None = None,
                       smooth: Mapping[str, np.ndarray] | None = None) -> Figure:
    """
    Return a figure of :func:`innovations`, a row for each name of ``scores``: its u (n,).

    ``found`` and ``smooth`` by name as there.

    """
    rows = len(scores)
    height = 2.6 * rows + 0.65
    figure = new_figure(13.0, height)
    grid = figure.add_gridspec(rows, 4, left=0.05, right=0.99, top=1 - 0.75 / height,
                               bottom=0.5 / height, hspace=0.72, wspace=0.3)
    for i, (name, u) in enumerate(scores.items()):
        innovations([figure.add_subplot(grid[i, k]) for k in range(4)], u, dt, name,
                    (found or {}).get(name), (smooth or {}).get(name))
    _key(figure)
    return figure


def study_figure(study: Study) -> Figure:
    """Return the figure of the innovations of a filter's study under its present models."""
    problems = {t: cast(FilterProblem, s.problem) for t, s in study.states.items()}
    seen = {t: p.prediction(study.states[t].fit.model) for t, p in problems.items()}
    return innovations_figure(
        {t: s.u for t, s in seen.items()}, next(iter(problems.values())).dt,
        {t: judged(p, study.states[t].fit) for t, p in problems.items()},
        {t: s.smooth for t, s in seen.items()})


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
