"""The ladder: the error on data not fitted against the models tried, for any domain."""

from __future__ import annotations

import numpy as np

from ..study import Study
from .style import dress, FAIL, FAINT, GOOD, MEASURED, new_figure, signed_log_scale, SMALL


def ladder(ax, study: Study, target: str):
    """Draw the error on data not fitted for each model tried, with what chance allows: two of its standard deviations."""
    steps = [s for s in study.history if s.target == target and np.isfinite(s.held_out)]
    dress(ax, target, y='error on data not fitted')
    if not steps:
        ax.text(0.5, 0.5, 'no error: nothing was left to predict', transform=ax.transAxes, ha='center', fontsize=SMALL)
        return ax
    error, chance = np.array([s.held_out for s in steps]), 2 * np.array([s.held_out_std for s in steps])
    x = np.arange(len(steps))
    linear = float(max(np.median(chance), 1e-9))
    signed_log_scale(ax.yaxis, linear, min(-1.5 * linear, 1.3 * error.min()), max(6 * linear, 4 * error.max()))
    ax.fill_between([-0.5, *x, x[-1] + 0.5], ax.get_ylim()[0], [chance[0], *chance, chance[-1]], color=GOOD, alpha=0.12, linewidth=0)
    ax.plot([-0.5, *x, x[-1] + 0.5], [chance[0], *chance, chance[-1]], '--', color=GOOD, linewidth=1.0)
    ax.text(0.01, 0.02, 'what chance allows', transform=ax.transAxes, fontsize=SMALL, color=GOOD, va='bottom')
    ax.plot(x, error, color=FAINT, linewidth=1.2)
    for i, s in enumerate(steps):
        colour = GOOD if error[i] <= chance[i] else FAIL
        ax.plot([i], [error[i]], 'o', color=colour, markersize=7)
        ax.annotate(f'{error[i]:.2g}', (i, error[i]), xytext=(0, 8), textcoords='offset points', ha='center', fontsize=SMALL, color=colour,
                    fontweight='bold', bbox={'facecolor': 'white', 'edgecolor': 'none', 'pad': 0.8, 'alpha': 0.8})
    ax.set_xlim(-0.5, x[-1] + 0.5)
    ax.set_xticks(x)
    ax.set_xticklabels([step_name(s) for s in steps], fontsize=SMALL, color=MEASURED)
    ax.grid(False, axis='x')
    return ax


def step_name(step) -> str:
    """Return what was done in one step: its effects at the start, then what came or went."""
    if step.added:
        done = '+ ' + step.added.replace('+', '\n+ ')
    elif step.removed:
        done = f'− {step.removed}'
    else:
        return '\n'.join(step.effects) or '(nothing)'
    return f'{done}\n({step.verdict})' if step.verdict else done


def ladder_figure(study: Study):
    """Return a figure with the ladder of each target, three in a row."""
    columns = min(3, len(study.targets))
    rows = -(-len(study.targets) // columns)
    most = max((sum(s.target == t for s in study.history) for t in study.targets), default=1)
    figure = new_figure(columns * max(4.0, min(8.0, 0.9 * most + 1.2)) if columns > 1 else max(6.0, 1.2 * most + 2), 3.1 * rows + 0.3)
    grid = figure.add_gridspec(rows, columns, left=0.065, right=0.985, top=1 - 0.35 / figure.get_figheight(),
                               bottom=0.62 / figure.get_figheight(), hspace=0.42, wspace=0.18)
    for i, target in enumerate(study.targets):
        ladder(figure.add_subplot(grid[i // columns, i % columns]), study, target)
    return figure
