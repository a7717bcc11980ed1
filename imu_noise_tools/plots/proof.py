# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The proof of an effect: measured, the model without it and with it, and what fails under either.

Takes any panel of any domain: what is drawn follows from the kinds of its curves, not from whose
they are.

"""

from __future__ import annotations

from collections.abc import Sequence
import math
from typing import Any, TYPE_CHECKING

import numpy as np

from .curves import runs
from .ladder import MOST
from .panel import Curve, Panel
from .style import (
    CHANCE, dress, EFFECTS, FAIL, FAINT, log_scale, MEASURED, MODEL, new_figure, SMALL
)
from ..loop import verdict

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDE, UPPER, LOWER, BESIDE = 9.0, 2.7, 1.0, 2.2      # inches
LETTERS = 130        # that a line of the key holds
_MADE_OF = ('measured', 'channel')      # of these the model takes its part off, so they change


def proof_figure(before: Panel, after: Panel, labels: Sequence[str],
                 portraits: Sequence[Panel] = (), name: str = 'it') -> Figure:
    """
    Return one view without an effect and with it, the pulls of both below it.

    Parameters
    ----------
    before, after : Panel
        The same view of two models; the same panel twice where there is only one.
    labels : sequence of str
        Of the effects that make the difference; their own lines are drawn.
    portraits : sequence of Panel
        What shows them by themselves, drawn below.
    name : str
        What makes the difference, for the key.

    """
    beside = BESIDE + 0.55 if portraits else 0.0
    upper = UPPER if before.curves else 0.0
    with_it, without = (f' with {name}', f' without {name}') if after is not before else ('', '')
    high = 0.45 + upper + LOWER * (1 if upper else 2) + 0.5 + beside
    figure = new_figure(WIDE, high)
    bottom = (0.5 + beside) / high
    grid = figure.add_gridspec(2 if upper else 1, 1, left=0.085, right=0.99, bottom=bottom,
                               top=1 - 0.45 / high, hspace=0.1,
                               height_ratios=[upper, LOWER] if upper else [1])
    low = figure.add_subplot(grid[-1])
    _both_pulls(low, before, after)
    _x_axis(low, before, after)
    handles: list[Any] = []
    if upper:
        top = figure.add_subplot(grid[0])
        handles = draw(top, after, before if without else None, labels, with_it, without)
        _x_axis(top, before, after)
        top.tick_params(labelbottom=False)
        top.set_xlabel('')
        shade(top, before)
    key = [*handles, *_pull_key(with_it, without)]
    wide = sum(len(h.get_label()) + 8 for h in key[:4]) > LETTERS
    figure.legend(handles=key, loc='upper center', ncol=3 if wide else 4, fontsize=SMALL,
                  frameon=False, handlelength=1.8, borderaxespad=0.2)
    if portraits:
        row = figure.add_gridspec(1, len(portraits), left=0.085, right=0.99, bottom=0.45 / high,
                                  top=(BESIDE + 0.3) / high, wspace=0.2)
        for k, panel in enumerate(portraits):
            draw(figure.add_subplot(row[k]), panel)
    return figure


def draw(ax: Axes, panel: Panel, before: Panel | None = None, labels: Sequence[str] = (),
         with_it: str = '', without: str = '') -> list[Any]:
    """
    Draw a panel's curves, beside those of another model where one is given; return the key.

    Of single effects only those named are drawn.

    """
    dress(ax, '', panel.x_title, panel.y_title)
    found: list[Any] = []
    ratio = not any(c.kind == 'model' for p in (panel, before) if p for c in p.curves)
    chosen = _chosen(panel, before)
    _y_axis(ax, panel, before)
    if before is not None:
        for c in before.curves:
            if c.kind == 'model' or ratio and c.kind in _MADE_OF and c.name in chosen:
                colour = FAIL if ratio else FAINT
                found += ax.plot(c.x, c.y, color=colour, linewidth=1.1,
                                 linestyle='-' if ratio else (0, (5, 2)),
                                 label=f'{c.name if ratio else "model"}{without}')
    for c in panel.curves:
        found += _curve(ax, c, labels, chosen, with_it, ratio)
    names: dict[str, Any] = {}
    for handle in found:
        if not str(handle.get_label()).startswith('_'):
            names.setdefault(handle.get_label(), handle)
    return list(names.values())


def _curve(ax: Axes, c: Curve, labels: Sequence[str], chosen: set[str], with_it: str,
           ratio: bool) -> list[Any]:
    """Draw one curve; return what a key can show of it."""
    if c.lo is not None and c.hi is not None:
        colour = CHANCE if c.kind == 'chance' else EFFECTS[0] if c.kind == 'extremes' else MEASURED
        ax.fill_between(c.x, c.lo, c.hi, color=colour, linewidth=0,
                        alpha={'chance': 1.0, 'extremes': 0.25}.get(c.kind, 0.15))
    if c.kind == 'dots':
        ax.plot(c.x, c.y, '.', color=FAINT, markersize=3, alpha=0.6)
    elif c.kind == 'model':
        return ax.plot(c.x, c.y, color=MODEL, linewidth=1.6, label=f'model{with_it}')
    elif c.kind == 'effect' and c.name in labels:
        colour = EFFECTS[list(labels).index(c.name) % len(EFFECTS)]
        return ax.plot(c.x, c.y, '--', color=colour, linewidth=1.4, label=f'{c.name} alone')
    elif c.kind in _MADE_OF and c.name in chosen:
        return ax.plot(c.x, c.y, color=MEASURED, linewidth=1.2,
                       label=f'{c.name}{with_it if ratio else ""}')
    return []


def _chosen(panel: Panel, before: Panel | None) -> set[str]:
    """Return the names of the measured curves to draw: of many channels the one that changes."""
    channels = {c.name: c.y for c in panel.curves if c.kind == 'channel'}
    names = {c.name for c in panel.curves if c.kind == 'measured'}
    if channels:
        old = {c.name: c.y for c in before.curves} if before is not None else {}
        change = {k: float(np.sum(np.square(old[k]) - np.square(y)))
                  if k in old and len(old[k]) == len(y) else 0.0 for k, y in channels.items()}
        names.add(max(change, key=lambda k: change[k]))
    return names


def _both_pulls(ax: Axes, before: Panel, after: Panel) -> None:
    """Draw the pulls of both models, what is beyond chance before filled."""
    beyond = verdict.CHANCE
    everything = np.concatenate([before.pull, after.pull])
    top = min(max(4.0, 1.15 * float(np.max(np.abs(everything), initial=0.0))), MOST)
    dress(ax, '', after.x_title, 'pull')
    ax.axhspan(-beyond, beyond, color=CHANCE, linewidth=0)
    x, pull = _single(before)
    shown = np.clip(pull, -top, top)
    for sign in (1, -1):
        ax.fill_between(x, sign * beyond, shown, where=sign * shown > beyond, interpolate=True,
                        color=FAIL, alpha=0.45, linewidth=0)
    few = '.' if len(x) < 40 else None
    ax.plot(x, shown, color=FAIL, linewidth=0.6, alpha=0.6, marker=few)
    x, pull = _single(after)
    ax.plot(x, np.clip(pull, -top, top), color=MEASURED, linewidth=0.9, marker=few)
    if top > 30:
        ax.set_yscale('symlog', linthresh=beyond, linscale=0.5)
        powers = [10.0 ** k for k in range(1, math.ceil(math.log10(top)))]
        ax.set_yticks([*(-v for v in powers), 0, *powers],
                      [*(f'−{v:g}' for v in powers), '0', *(f'{v:g}' for v in powers)])
        ax.minorticks_off()
    ax.set_ylim(-top, top)


def _single(panel: Panel) -> tuple[np.ndarray, np.ndarray]:
    """Return one pull a place: of several the root of the mean square, with the sum's sign."""
    x, place, count = np.unique(panel.x, return_inverse=True, return_counts=True)
    total = np.bincount(place, panel.pull)
    return x, np.sign(total) * np.sqrt(np.bincount(place, panel.pull ** 2) / count)


def _pull_key(with_it: str, without: str) -> list[Any]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch
    return [Patch(color=FAIL, alpha=0.45, linewidth=0, label=f'beyond chance{without}'),
            Line2D([], [], color=MEASURED, linewidth=0.9, label=f'pull{with_it}')]


def shade(ax: Axes, panel: Panel) -> None:
    """Shade where a model fails."""
    x, pull = _single(panel)
    if len(x) < 8:
        return
    edges = np.concatenate([x[:1], 0.5 * (x[1:] + x[:-1]), x[-1:]])
    for a, b in runs(pull):
        ax.axvspan(edges[a], edges[b], color=FAIL, alpha=0.08, linewidth=0)


def _x_axis(ax: Axes, before: Panel, after: Panel) -> None:
    values = np.concatenate([before.x, after.x, *(c.x for c in after.curves)])
    if 'x' in after.log:
        values = values[values > 0]
        log_scale(ax.xaxis, values.min(), 1.02 * values.max())
    elif len(values):
        low, high = values.min(), values.max()
        ax.set_xlim(low, high if high > low else low + 1)


def _y_axis(ax: Axes, panel: Panel, before: Panel | None) -> None:
    """Scale y by what is measured and by the models; single effects may leave the picture."""
    if 'y' not in panel.log:
        return
    some = [c for p in (panel, before) if p for c in p.curves if c.kind in ('measured', 'model')]
    dots = [c.y for c in panel.curves if c.kind == 'dots']
    values = np.concatenate([c.y for c in some])
    values = values[np.isfinite(values) & (values > 0)]
    top = max(values.max(), *(v.max() for v in dots)) if dots else values.max()
    log_scale(ax.yaxis, values.min() / 2, 1.5 * top)
