# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A panel as plotly draws it, plain data: the curves above, the pulls below, one x axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import json
import math
from typing import Any

import numpy as np

from ..loop.verdict import CHANCE
from ..plots.panel import Curve, Panel, Stretch
from ..plots.style import CHANCE as BAND, EFFECTS, FAIL, FAINT, MEASURED, MODEL, number

HAND = '#8a5a00'        # what was put in by hand: none of the others'
CONFIG = {'displaylogo': False, 'displayModeBar': False, 'doubleClick': False,
          'scrollZoom': False}
COLUMNS = 350           # of pixels that a curve is drawn in: half of those of a wide screen
SMOOTH = 100            # those of what has no scatter
_GRID = '#e3e7ea'
_MOST = 12.0            # standard errors shown at most
_FONT = {'family': 'Roboto, system-ui, sans-serif', 'size': 13, 'color': MEASURED}


@dataclass(frozen=True)
class Drawn:
    """A panel and what plotly takes of it, its curves as JSON: made once, sent often."""

    panel: Panel
    data: str
    layout: dict[str, Any]


def drawn(panel: Panel, labels: Sequence[str] = (), hand: str = '') -> Drawn:
    """
    Return a panel as plotly takes it.

    Parameters
    ----------
    panel : Panel
        What is drawn.
    labels : sequence of str
        Of the model's effects, in whose order they have their colours.
    hand : str
        Label of what was put in by hand.

    """
    data: list[dict[str, Any]] = []
    for k, curve in enumerate(panel.curves):
        data += _traces(panel, curve, k, list(labels), hand)
    both = bool(panel.curves) and bool(len(panel.pull))
    data += _pulls(panel, both)
    return Drawn(panel, json.dumps(data, separators=(',', ':')), _layout(panel, both))


def marked(found: Drawn, stretch: Stretch | None = None, suspect: str = '') -> str:
    """
    Return a drawn panel with what is marked on it, JSON: ``data``, ``layout``, ``config``.

    ``suspect`` is written where the pulls fail most.

    """
    panel, layout = found.panel, dict(found.layout)
    if stretch is not None:
        layout['shapes'] = [{
            'type': 'rect', 'xref': 'x', 'yref': 'paper', 'x0': stretch.low, 'x1': stretch.high,
            'y0': 0, 'y1': 1, 'fillcolor': EFFECTS[0], 'opacity': 0.12, 'line': {'width': 0},
            'layer': 'below'}]
    if suspect and len(panel.pull) and np.max(np.abs(panel.pull)) > 2 * CHANCE:
        at = float(panel.x[int(np.argmax(np.abs(panel.pull)))])
        layout['annotations'] = [{
            'x': math.log10(at) if 'x' in panel.log else at, 'xref': 'x', 'yref': 'paper',
            'y': 0.30 if panel.curves else 1.0, 'text': f'<b>{suspect}</b>', 'showarrow': False,
            'bgcolor': 'rgba(255,255,255,0.85)', 'font': {**_FONT, 'color': FAIL}}]
    return (f'{{"data":{found.data},"layout":{json.dumps(layout)},'
            f'"config":{json.dumps(CONFIG)}}}')


def few(x: np.ndarray, y: np.ndarray, log: bool, columns: int = COLUMNS) -> np.ndarray:
    """
    Return which points (k,) a screen can show: of each column of pixels the lowest and highest.

    All of them, as a slice would, where they are few.

    """
    if len(x) <= 2 * columns:
        return np.arange(len(x))
    at = np.log(np.maximum(x, 1e-300)) if log else np.asarray(x, float)
    low, high = np.min(at[np.isfinite(at)]), np.max(at[np.isfinite(at)])
    column = np.clip((at - low) / max(high - low, 1e-300) * columns, 0, columns - 1).astype(int)
    order = np.lexsort((y, column))
    first = np.flatnonzero(np.diff(column[order], prepend=-1))
    last = np.append(first[1:], len(order)) - 1
    return np.unique(order[np.concatenate([first, last])])


def _list(values: np.ndarray) -> list[float | None]:
    """Return numbers as JSON has them, with no more digits than a screen shows."""
    return [float(f'{v:.5g}') if math.isfinite(v) else None for v in np.asarray(values, float)]


def _traces(panel: Panel, c: Curve, k: int, labels: list[str], hand: str) -> list[dict[str, Any]]:
    """Return one curve, its band first."""
    colour = {'measured': MEASURED, 'model': MODEL, 'dots': FAINT}.get(c.kind) or (
        EFFECTS[(labels.index(c.name) if c.name in labels else k) % len(EFFECTS)])
    line: dict[str, Any] = {'color': colour, 'width': 2.2 if c.kind == 'model' else 1.8}
    if c.kind == 'effect':
        line.update(dash='dash', width=1.4)
        if c.name == hand:
            line.update(color=HAND, width=2.4, dash='dot')
    some = few(c.x, c.hi if c.hi is not None and c.kind != 'measured' else c.y,
               'x' in panel.log, SMOOTH if c.kind in ('model', 'effect') else COLUMNS)
    look: dict[str, Any] = {'x': _list(c.x[some]), 'type': 'scatter', 'hoverinfo': 'name+x+y',
                            'mode': 'lines', 'line': line,
                            'name': c.name if c.seen else f'({c.name})'}
    if c.kind == 'dots':
        look.update(mode='markers', marker={'color': colour, 'size': 3.5, 'opacity': 0.6})
    out = []
    if c.lo is not None and c.hi is not None:
        fill = BAND if c.kind == 'chance' else colour
        edge = {**look, 'mode': 'lines', 'line': {'width': 0, 'color': fill}, 'showlegend': False,
                'hoverinfo': 'skip'}
        out = [{**edge, 'y': _list(c.lo[some])},
               {**edge, 'y': _list(c.hi[some]), 'fill': 'tonexty',
                'fillcolor': _faint(fill, c.kind), 'name': c.name,
                'showlegend': c.kind in ('chance', 'extremes')}]
    if c.kind not in ('chance', 'extremes'):
        out.append({**look, 'y': _list(c.y[some]), 'opacity': 1.0 if c.seen else 0.45})
    return out


def _faint(colour: str, kind: str) -> str:
    red, green, blue = (int(colour[i:i + 2], 16) for i in (1, 3, 5))
    return f'rgba({red},{green},{blue},{1.0 if kind == "chance" else 0.18})'


def _pulls(panel: Panel, below: bool) -> list[dict[str, Any]]:
    """Return the pulls, what chance allows behind them, what is beyond it marked."""
    if not len(panel.pull):
        return []
    axis = 'y2' if below else 'y'
    some = few(panel.x, panel.pull, 'x' in panel.log)
    x, pull = panel.x[some], panel.pull[some]
    shown = np.clip(pull, -_MOST, _MOST)
    single = len(np.unique(x)) < len(x)     # several to a place: no line
    mode = 'markers' if single else 'lines+markers' if len(x) < 40 else 'lines'
    beyond = np.abs(pull) > CHANCE
    base = {'type': 'scatter', 'yaxis': axis, 'showlegend': False}
    ends = [float(x[0]), float(x[-1])]
    return [
        {**base, 'x': ends, 'y': [-CHANCE] * 2, 'line': {'width': 0}, 'mode': 'lines',
         'hoverinfo': 'skip'},
        {**base, 'x': ends, 'y': [CHANCE] * 2, 'line': {'width': 0}, 'mode': 'lines',
         'fill': 'tonexty', 'fillcolor': BAND, 'hoverinfo': 'skip'},
        {**base, 'x': _list(x), 'y': _list(shown), 'name': 'pull',
         'hovertemplate': '%{x}: %{y:.1f} standard errors<extra></extra>', 'mode': mode,
         'line': {'color': MEASURED, 'width': 1.1}},
        {**base, 'x': _list(x[beyond]), 'y': _list(shown[beyond]), 'mode': 'markers',
         'marker': {'color': FAIL, 'size': 5}, 'hoverinfo': 'skip'}]


def _layout(panel: Panel, both: bool) -> dict[str, Any]:
    common = {'gridcolor': _GRID, 'linecolor': FAINT, 'zeroline': False, 'fixedrange': True,
              'title': {'font': {'size': 13}}}
    x = {**common, 'title': {'text': panel.x_title, 'font': {'size': 13}}, 'anchor':
         'y2' if both else 'y', **_scale(panel, 'x')}
    pull = {**common, 'title': {'text': 'pull', 'font': {'size': 13}}, **_reach(panel)}
    layout: dict[str, Any] = {
        'font': _FONT, 'paper_bgcolor': 'white', 'plot_bgcolor': 'white', 'shapes': [],
        'margin': {'l': 62, 'r': 10, 't': 8, 'b': 44}, 'dragmode': 'select',
        'selectdirection': 'h', 'hovermode': 'closest', 'xaxis': x, 'uirevision': panel.name,
        'legend': {'orientation': 'h', 'x': 0, 'y': 1.01, 'yanchor': 'bottom',
                   'traceorder': 'normal',
                   'font': {'size': 12}},
        'newselection': {'line': {'width': 1, 'color': EFFECTS[0]}},
        'showlegend': bool(panel.curves)}
    if both:
        layout['yaxis'] = {**common, 'domain': [0.30, 1], 'anchor': 'x',
                           'title': {'text': panel.y_title, 'font': {'size': 13}},
                           **_scale(panel, 'y')}
        layout['yaxis2'] = {**pull, 'domain': [0, 0.24], 'anchor': 'x'}
    elif panel.curves:
        layout['yaxis'] = {**common, 'anchor': 'x', **_scale(panel, 'y'),
                           'title': {'text': panel.y_title, 'font': {'size': 13}}}
    else:
        layout['yaxis'] = {**pull, 'title': {'text': 'pull, standard errors',
                                             'font': {'size': 13}}}
    return layout


def _reach(panel: Panel) -> dict[str, Any]:
    top = float(np.clip(1.1 * np.max(np.abs(panel.pull), initial=0.0), 4, 1.1 * _MOST))
    return {'range': [-top, top], 'nticks': 5}


def _scale(panel: Panel, axis: str) -> dict[str, Any]:
    """Return a logarithmic scale over what is measured, with a tick a decade; or none."""
    if axis not in panel.log:
        return {}
    if axis == 'x':
        found = [panel.x, *(c.x for c in panel.curves)]
    else:
        kinds = {'measured', 'model'}
        if not any(c.kind == 'model' for c in panel.curves):
            kinds.add('effect')
        found = [v for c in panel.curves if c.kind in kinds
                 for v in (c.y, c.lo, c.hi) if v is not None]
    values = np.concatenate(found)
    values = values[np.isfinite(values) & (values > 0)]
    low, high = float(np.log10(values.min())), float(np.log10(values.max()))
    room = 0.02 if axis == 'x' else 0.25
    ticks = [10.0 ** k for k in range(math.ceil(low - room), math.floor(high + room) + 1)]
    out: dict[str, Any] = {'type': 'log', 'range': [low - room, high + room]}
    if len(ticks) > 1:
        out.update(tickvals=ticks, ticktext=[number(v) for v in ticks])
    return out
