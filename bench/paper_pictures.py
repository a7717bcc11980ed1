# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Figures that only the experiments of Qian et al. 2010 (paper.py) draw."""

from __future__ import annotations

import numpy as np

from imu_noise_tools.core.units import DEG
from imu_noise_tools.plots.style import (
    dress,
    EFFECTS,
    FAINT,
    log_scale,
    MEASURED,
    MODEL,
    NORMAL,
    SMALL,
)

POINTS = 4000           # drawn of a series at most


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
