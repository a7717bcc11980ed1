# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pictures of a calibration: residual per pose, directions covered, before and after."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import cast, TYPE_CHECKING

import numpy as np

from .panel import Curve, Panel
from .signed import signed
from .style import (
    AXES,
    dress,
    EFFECTS,
    FAIL,
    FAINT,
    MEASURED,
    MODEL,
    new_figure,
    png,
    readable,
    SMALL,
)
from ..calibration import Calibration, CalibrationProblem, of_study, Regressor, TurnsProblem
from ..calibration.between import integrated, misses
from ..calibration.poses import DIRECTIONS, unit
from ..core.errors import degrees_of_freedom
from ..loop.prediction import State
from ..loop.study import Study

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FAINTEST = 1e-2     # standard errors: what is smaller is drawn there
_LOUD = 3.0         # a pose further off than this many standard errors is named


def residuals(ax: Axes, calibration: Calibration) -> Axes:
    """Draw each pose's residual, and shade what other poses predict differently."""
    poses, problem = calibration.poses, calibration.problem
    left = problem.left_out(calibration.fit)
    draw = {'norm': _magnitudes, 'few': _magnitudes, 'faces': _faces,
            'turns': _turns}.get(problem.method, _readings)
    unit_ = draw(ax, calibration, 1 + np.arange(poses.n))
    each = 'turn and rest' if problem.method == 'turns' else 'pose'
    more = ', with its tilt' if problem.method == 'faces' else ''
    dress(ax, f'{calibration.sensor}: residual of each {each}{more}', '', readable(unit_))
    ax.axhline(0, color=FAINT, linewidth=0.8)
    pull = np.sqrt(left.x / np.maximum(left.bins, 1))
    off = (pull > _LOUD) & (left.bins > 0)
    for k in np.flatnonzero(off):
        ax.axvspan(k + 0.5, k + 1.5, color=FAIL, alpha=0.12, linewidth=0)
    if poses.n <= 24:
        names = [name.split(' (')[0] for name in poses.names]      # without the angle of a turn
        ax.set_xticks(1 + np.arange(poses.n), names, rotation=90 if poses.n > 9 else 0)
    else:
        ax.xaxis.set_major_locator(_whole_numbers())
        ax.set_xlabel('turns, then rests' if problem.method == 'turns' else 'pose',
                      fontsize=SMALL)
    ax.set_xlim(0.3, poses.n + 0.7)
    low, high = ax.get_ylim()
    ax.set_ylim(low, high + 0.22 * (high - low))
    ax.legend(fontsize=SMALL, frameon=False, ncol=4, loc='upper left', handlelength=1.2,
              columnspacing=1.2)
    if off.any():       # above the bars, where none of them is
        ax.text(1.0, 1.02, 'shaded: the other poses predict something else',
                transform=ax.transAxes, ha='right', va='bottom', fontsize=SMALL, color=FAIL)
    return ax


def _whole_numbers():
    """Return what puts ticks at poses: there is none between two."""
    from matplotlib.ticker import MaxNLocator
    return MaxNLocator(integer=True, min_n_ticks=1)


def _magnitudes(ax, calibration, x):
    """Draw the residuals of magnitudes with their standard errors; return the unit."""
    whitener = calibration.fit.details.equations.whitener[:, 0, :]
    size = 1.0 / np.linalg.norm(whitener, axis=1)
    value = np.einsum('ni,in->n', whitener * size[:, None], calibration.fit.details.residual)
    ax.bar(x, value, 0.6, color=AXES['x'], label='residual of the magnitude')
    ax.errorbar(x, np.zeros(len(x)), 2 * size, fmt='none', ecolor=MEASURED, elinewidth=0.8,
                capsize=2, label='±2 standard errors')
    if calibration.problem.meets_any(calibration.fit):
        _met(ax, 0.04)
    return calibration.problem.unit


def _met(ax, y, more=''):
    """Say at a height of an axes why what is left says nothing, and what ``more`` follows."""
    ax.text(0.5, y, f'no more poses than coefficients: they are met whatever they say{more}',
            transform=ax.transAxes, ha='center', fontsize=SMALL, color=MEASURED,
            bbox={'facecolor': 'white', 'edgecolor': 'none', 'alpha': 0.85, 'pad': 1})


def _turns(ax, calibration, x):
    """
    Draw by how much turns miss gravity and rests the bias, as times their noise; return that.

    By noise alone: by noise and the scatter that was fitted everything is as large as it should.

    """
    turns, left = calibration.problem.data, calibration.fit.details.residual
    miss, rest = np.linalg.norm(left[:, :turns.n], axis=0), left[:, turns.n:]
    ax.axhspan(0, 2, color='#eef1f3', linewidth=0, zorder=0)
    ax.bar(x[:turns.n], miss / np.sqrt(2) / turns.spread, 0.6, color=AXES['x'],
           label=f'turns miss gravity by {np.degrees(np.sqrt(np.mean(np.square(miss)))):.2g}° rms')
    ax.bar(x[turns.n:], np.sqrt(np.mean((rest / turns.rests.std) ** 2, axis=0)), 0.6,
           color=AXES['z'], label=f'rests miss the bias by {np.sqrt(np.mean(rest ** 2)):.2g} '
                                  f'{readable(calibration.problem.unit)} rms')
    return 'times the noise'


def _readings(ax, calibration, x):
    """Draw the residuals of the three readings in standard errors; return that."""
    # tilt makes lateral readings a hundred times less certain than axial ones: only in
    # standard errors do both show
    left = calibration.fit.details.residual.T
    pull = left / _reading_std(calibration.fit.details.equations)
    return _bars(ax, x, left / calibration.poses.amount[:, None], pull, calibration.problem.unit)


def _faces(ax, calibration, x):
    """
    Draw what the readings of faces are off by, and of other poses the magnitude; return the unit.

    Beside their nominal inputs: about the directions that are found no tilt is left. The reading
    of the axis that is up is the magnitude, which feels no tilt.

    """
    details, poses = calibration.fit.details, calibration.poses
    system = details.equations
    back = np.linalg.inv(system.whitener)
    rows = system.residual[system.pose >= 0].reshape(poses.n, 3)
    left = np.einsum('nij,nj->ni', back, rows)
    axis = np.linalg.solve(details.scale.T, unit(details.inputs)).T
    size = np.linalg.norm(np.einsum('ni,nij->nj', axis, back), axis=1)
    along = np.sum(axis * left, axis=1) / size
    up = np.array([DIRECTIONS.get(name, np.zeros(3)) for name in poses.names])
    pull = np.where(up, up * along[:, None], left / _reading_std(system))
    face = up.any(axis=1)
    if not face.all():
        ax.bar(x[~face], along[~face], 0.6, color=MEASURED, label='magnitude, of no face')
    return _bars(ax, x[face], left[face], pull[face], calibration.problem.unit)


def _bars(ax, x, left, pull, unit_):
    """Draw pulls (n, 3) of what is left of readings (n, 3); return their unit."""
    ax.axhspan(-2, 2, color='#eef1f3', linewidth=0, zorder=0)
    for k, axis in enumerate('xyz' if len(x) else ''):
        rms = float(np.sqrt(np.mean(left[:, k] ** 2)))
        ax.bar(x + 0.27 * (k - 1), pull[:, k], 0.25, color=AXES[axis],
               label=f'{axis}: {rms:.2g} {readable(unit_)} rms')
    low, high = ax.get_ylim()
    ax.set_ylim(min(-2.5, 1.1 * low), max(2.5, 1.1 * high))
    return 'standard errors'


def _reading_std(system):
    """Return the standard error of each reading, (n, 3), tilt included."""
    back = np.linalg.inv(system.whitener)
    return np.sqrt(np.einsum('nij,nij->ni', back, back))


def sphere(axes: Sequence[Axes], calibration: Calibration) -> Sequence[Axes]:
    """
    Draw the directions that were covered, as equal-area maps for z > 0 and z < 0.

    Faces are rings; a filled ring was seen. Lambert's projection: equal areas of the sphere are
    equal on paper.

    """
    inputs = calibration.fit.details.inputs
    turning = np.linalg.norm(inputs, axis=0) > 0
    u = unit(inputs[:, turning])
    circle = np.linspace(0, 2 * np.pi, 181)
    for ax, sign, title in zip(axes, (1, -1), ('z > 0', 'z < 0')):
        ax.plot(np.cos(circle), np.sin(circle), color=FAINT, linewidth=0.8)
        for angle in (30, 60):
            r = np.sqrt(2) * np.sin(np.radians(angle) / 2)
            ax.plot(r * np.cos(circle), r * np.sin(circle), color='#e3e7ea', linewidth=0.6)
        for face, d in DIRECTIONS.items():
            if sign * d[2] > -0.5:
                x, y = _lambert(d, sign)
                ax.plot(x, y, 'o', markersize=13, markerfacecolor='none', markeredgecolor=FAINT)
                out = 1.2 if abs(d[2]) < 0.5 else 0
                ax.text(out * x, out * y - (0.25 if not out else 0), face, fontsize=SMALL,
                        ha='center', va='center', color=MEASURED)
        here = u[:, sign * u[2] >= -0.02]
        x, y = _lambert(here, sign)
        ax.plot(x, y, 'o', markersize=5, color=MODEL, alpha=0.75, markeredgewidth=0)
        ax.set_aspect('equal')
        ax.set_axis_off()
        ax.set_xlim(-1.35, 1.35)
        ax.set_ylim(-1.35, 1.35)
        ax.set_title(title, fontsize=SMALL, color=MEASURED)
    return axes


def _lambert(u, sign):
    z = np.clip(sign * np.asarray(u[2], float), -0.999, 1)
    k = 1 / np.sqrt(1 + z)
    return k * u[0], k * u[1]


def before_and_after(ax: Axes, calibration: Calibration) -> Axes:
    """Draw the error of each pose or turn, as it came and corrected; return the axes."""
    problem, met = calibration.problem, False
    if problem.method == 'turns':
        error, floor = _missed(calibration)
        title, unit_ = 'how far turns miss gravity', 'angle, °'
    else:
        error, floor = _of_magnitudes(calibration)
        met = problem.meets_any(calibration.fit)
        title, unit_ = 'error of the magnitude', readable(problem.unit)
        unit_ = f'{"| |f| − g |" if calibration.sensor == "accel" else "| |ω| − true |"}, {unit_}'
    x = 1 + np.arange(len(error[0]))
    if met:     # what is left is rounding
        error = error[:1]
        _met(ax, 0.8, ',\nso what is left once calibrated says nothing')
    for value, colour, name in zip(error, (FAINT, EFFECTS[0]), ('as it came', 'calibrated')):
        rms = float(np.sqrt(np.mean(value ** 2)))
        ax.plot(x, np.maximum(value, floor), 'o', markersize=4, color=colour,
                label=f'{name}: {rms:.2g} rms')
        ax.axhline(max(rms, floor), color=colour, linewidth=1, linestyle='--')
    ax.set_yscale('linear' if met else 'log')
    when = 'as it came' if met else 'before and after'
    dress(ax, f'{title}, {when}', 'turn' if problem.method == 'turns' else 'pose', unit_)
    ax.xaxis.set_major_locator(_whole_numbers())
    low, high = ax.get_ylim()
    ax.set_ylim(*((0, 1.3 * high) if met else (low, high * (high / low) ** 0.25)))
    ax.legend(fontsize=SMALL, frameon=False, loc='upper right', ncol=2)
    return ax


def _missed(calibration):
    """Return the angles by which turns miss gravity, as they came and corrected, and a floor."""
    turns = cast(TurnsProblem, calibration.problem).data
    raw = misses(turns, integrated(turns, turns.gyro))
    left = calibration.fit.details.residual[:, :turns.n].T
    return [np.degrees(np.linalg.norm(x, axis=1)) for x in (raw, left)], 1e-5


def _of_magnitudes(calibration):
    """Return the errors of the magnitudes, as they came and corrected, and a floor."""
    poses = calibration.poses
    mean = (poses.outputs / poses.amount).T
    after = calibration.correction.apply(mean,
                                         poses.temperature if np.isfinite(poses.temperature).all()
                                         else None,
                                         poses.force.T if np.isfinite(poses.force).all() else None)
    truth = np.linalg.norm(poses.rates, axis=0) if poses.known else np.full(poses.n,
                                                                            poses.magnitude)
    return ([np.abs(np.linalg.norm(v, axis=1) - truth) for v in (mean, after)],
            1e-7 * poses.magnitude)


def calibration_figure(calibration: Calibration) -> Figure:
    """Return the picture of a calibration: residuals, directions, before and after."""
    figure = new_figure(11, 7)
    grid = figure.add_gridspec(2, 3, left=0.075, right=0.985, top=0.90, bottom=0.085,
                               height_ratios=[1, 1.05], hspace=0.42,
                               width_ratios=[1, 1, 1.9], wspace=0.12)
    residuals(figure.add_subplot(grid[0, :]), calibration)
    pair = [figure.add_subplot(grid[1, 0]), figure.add_subplot(grid[1, 1])]
    sphere(pair, calibration)
    box = pair[0].get_position()
    figure.text(box.x0, box.y1 + 0.035, 'directions covered' if calibration.sensor == 'accel'
                else 'axes turned about',
                fontsize=9, fontweight='bold', color=MEASURED)
    right = grid[1, 2].subgridspec(1, 2, width_ratios=[0.07, 1])
    before_and_after(figure.add_subplot(right[0, 1]), calibration)
    figure.text(0.075, 0.955, f'{calibration.sensor}, {calibration.problem.method}: '
                              f'{_weighed(calibration)}', fontsize=12, fontweight='bold',
                color=MEASURED)
    return figure


def _weighed(calibration):
    """Return how many poses there are, and how well they are met, for people."""
    poses, details = calibration.poses, calibration.fit.details
    if calibration.problem.method == 'turns':       # their scatter is what chi-squared makes it
        turns = calibration.problem.data.n
        return f'{turns} turns between poses, and {poses.n - turns} rests'
    return f'{poses.n} poses, χ² {details.chi2:.1f} with {degrees_of_freedom(details.dof)}'


def pictures(study: Study, full: Sequence[str] = ()) -> dict[str, bytes]:
    """Return the picture of a calibration study, ``poses``; of a second sensor one of its own."""
    names = {'poses': study.targets[0], **{f'target {t}': t for t in study.targets[1:]}}
    return {name: png(signed(calibration_figure(of_study(study, t)), study.source))
            for name, t in names.items()}


def panels(state: State) -> Mapping[str, Callable[[], Panel]]:
    """Return the panel of a calibration: what other poses say of each, and each effect there."""
    return {'poses': lambda: by_pose(state)}


def by_pose(state: State) -> Panel:
    """
    Return the poses one after the other, in standard errors of a pose.

    The pulls are what the others do not foresee, the lines what each effect makes of a pose. An
    effect that the fit does not know (put in by hand) is taken off the outputs first.

    """
    problem, fit = cast(CalibrationProblem, state.problem), state.fit
    system, order = fit.details.equations, np.argsort(problem.poses.time, kind='stable')
    known, right, lines = {label for label, _ in system.keys}, system.right.copy(), []
    x, row = 1.0 + np.arange(len(order)), system.pose[system.pose >= 0]
    for e in fit.model.of(Regressor):
        made = problem.columns(fit, e) @ [e[p.name] for p in e.coefficients]
        if e.label not in known:
            right[len(right) - len(made):] -= made
        size = np.sqrt(np.bincount(row, made ** 2, len(order)) / np.bincount(row))
        lines.append(Curve(e.label, x, np.maximum(size, FAINTEST)[order], 'effect'))
    left = replace(system, right=right).left_out()
    size = np.sqrt(left.x / np.maximum(left.bins, 1))
    lines.append(Curve('error of a pose left out', x, np.maximum(size, FAINTEST)[order]))
    place = np.argsort(order)
    at = np.repeat(x[place], left.bins)
    by_place = np.argsort(at, kind='stable')
    names = [problem.poses.names[k] for k in order]
    title = 'pose' + (': ' + ', '.join(f'{k} {n}' for k, n in enumerate(names, 1))
                      if len(names) <= 12 else '')
    return Panel('poses', title, 'pose', at[by_place], left.pulls[by_place],
                 'standard errors of a pose', 'y', tuple(lines))
