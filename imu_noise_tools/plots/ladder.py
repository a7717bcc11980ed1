# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The ladder: the held-out deviance of the models tried, and what a rung changed; any domain."""

from __future__ import annotations

from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np

from .style import (
    CHANCE, dress, FAIL, FAINT, GOOD, log_scale, MEASURED, new_figure, signed_log_scale, SMALL
)
from ..loop import verdict
from ..loop.study import Contrast, Step, Study

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST = 1000.0            # standard errors shown at most
_X = {'Hz': 'frequency, Hz', 's': 'time, s', 'quantile': 'quantile of the samples'}


def contrast_figure(found: Contrast, before: str, after: str) -> Figure:
    """
    Return the pulls of one view under the model before a rung and after it, one above the other.

    ``before`` and ``after`` name the two models. Both panels have one scale, so that what is left
    is seen beside what was there.

    """
    figure = new_figure(9, 3.6)
    grid = figure.add_gridspec(2, 1, left=0.07, right=0.99, top=0.93, bottom=0.12, hspace=0.32)
    # parts of a record that were predicted one by one have bins at the same x: one pull each
    x, place, count = np.unique(found.x, return_inverse=True, return_counts=True)
    both = [np.bincount(place, pull) / np.sqrt(count) for pull in (found.before, found.after)]
    top = max(4.0, 1.15 * float(np.max(np.abs(both), initial=0.0)))
    for k, (pull, name) in enumerate(zip(both, (before, after))):
        ax = dress(figure.add_subplot(grid[k]), name, y='standard errors',
                   x=_X.get(found.unit, found.unit or found.view) if k else '')
        _pull(ax, x, pull, min(top, MOST))
        if found.unit == 'Hz' and x[0] > 0:
            log_scale(ax.xaxis, x[0], x[-1])
        elif len(x) > 1:
            ax.set_xlim(x[0], x[-1])
        if not k:
            ax.tick_params(labelbottom=False)
    return figure


def _pull(ax: Axes, x: np.ndarray, pull: np.ndarray, top: float) -> None:
    """Draw pulls against x, what is beyond chance filled; logarithmic where they are large."""
    few = '.' if len(x) < 40 else ''
    shown = np.clip(pull, -top, top)
    beyond = verdict.CHANCE
    ax.axhspan(-beyond, beyond, color=CHANCE, linewidth=0)
    for sign in (1, -1):
        ax.fill_between(x, sign * beyond, shown, where=sign * shown > beyond, interpolate=True,
                        color=FAIL, alpha=0.55, linewidth=0)
    ax.plot(x, shown, color=MEASURED, linewidth=0.9, marker=few or None, markersize=5)
    if top > 30:
        ax.set_yscale('symlog', linthresh=beyond, linscale=0.5)
    ax.set_ylim(-top, top)


def ladder(ax: Axes, study: Study, target: str) -> Axes:
    """Draw the held-out deviance of each model tried; the green band is chance: 2 std."""
    steps = [s for s in study.history if s.target == target and np.isfinite(s.held_out)]
    dress(ax, target, y='held-out deviance')
    if not steps:
        ax.text(0.5, 0.5, 'not known: nothing was left to predict', transform=ax.transAxes,
                ha='center', fontsize=SMALL)
        return ax
    error = np.array([s.held_out for s in steps])
    chance = verdict.CHANCE * np.array([s.held_out_std for s in steps])
    x = np.arange(len(steps))
    linear = float(max(np.median(chance), 1e-9))
    signed_log_scale(ax.yaxis, linear, min(-1.5 * linear, 1.3 * error.min()),
                     max(6 * linear, 4 * error.max()))
    ends, level = [-0.5, *x, x[-1] + 0.5], [chance[0], *chance, chance[-1]]
    ax.fill_between(ends, ax.get_ylim()[0], level, color=GOOD, alpha=0.12, linewidth=0)
    ax.plot(ends, level, '--', color=GOOD, linewidth=1.0)
    ax.text(0.01, 0.02, 'what chance allows', transform=ax.transAxes, fontsize=SMALL, color=GOOD)
    ax.plot(x, error, color=FAINT, linewidth=1.2)
    for i, s in enumerate(steps):
        inside = verdict.within_chance(s.held_out, s.held_out_std) and not s.failing
        colour = GOOD if inside else FAIL
        ax.plot([i], [error[i]], 'o', color=colour, markersize=7)
        said = f'{error[i]:.0f}' if 100 <= abs(error[i]) < 1e5 else f'{error[i]:.2g}'
        ax.annotate(said, (i, error[i]), xytext=(0, 8), textcoords='offset points',
                    ha='center', fontsize=SMALL, fontweight='bold', color=colour,
                    bbox={'facecolor': 'white', 'edgecolor': 'none', 'pad': 0.8, 'alpha': 0.8})
    ax.set_xlim(-0.5, x[-1] + 0.5)
    ax.set_xticks(x)
    crowded = len(steps) > 6
    ax.set_xticklabels([_name(s, not crowded) for s in steps], fontsize=SMALL, color=MEASURED,
                       rotation=25 if crowded else 0, ha='right' if crowded else 'center')
    ax.grid(False, axis='x')
    return ax


def _name(step: Step, judged: bool) -> str:
    """Return what was done in one step: all effects at the start, then what came or went."""
    if step.added:
        done = '+ ' + step.added.replace('+', '\n+ ')
    elif step.removed:
        done = f'− {step.removed}'
    else:
        return '\n'.join(step.effects) or '(nothing)'
    return f'{done}\n{fill(step.verdict, 9)}' if judged else done


def ladder_figure(study: Study) -> Figure:
    """Return a figure with the ladder of each target, three in a row."""
    count = len(study.targets)
    columns = min(3, count)
    rows = -(-count // columns)
    most = max((sum(s.target == t for s in study.history) for t in study.targets), default=1)
    each = min(max(4.6, 1.15 * most + 0.8), 16.0 / columns)
    wide, high = columns * each, 3.2 * rows + 0.3
    figure = new_figure(wide, high)
    grid = figure.add_gridspec(rows, columns, left=0.65 / wide, right=1 - 0.15 / wide,
                               top=1 - 0.35 / high, bottom=0.72 / high, hspace=0.46, wspace=0.2)
    for i, target in enumerate(study.targets):
        ax = ladder(figure.add_subplot(grid[i // columns, i % columns]), study, target)
        if i % columns:
            ax.set_ylabel('')
    return figure
