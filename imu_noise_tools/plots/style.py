# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What all pictures share: colours, labels, axes that draw fast, and a figure as PNG bytes.

Figures are drawn on an Agg canvas of their own: nothing global is read or changed, and one study
gives one picture, byte for byte.

"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
import io
import math
from typing import cast, TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.text import Text

MEASURED, MODEL, FAIL, GOOD, FAINT = '#1f2d3d', '#d55e00', '#c0392b', '#1a7f4b', '#7a8793'
CHANCE = '#e4e9ec'
# Okabe and Ito (2008), darkened: told apart by the colour-blind too.
EFFECTS = ('#0072b2', '#009e73', '#9a5fb5', '#b8860b', '#56b4e9', '#cc79a7', '#5d4037', '#607d8b')
# none is the model's colour, and each is told from it; of the schemes of Okabe and Ito, Tol (2021)
AXES = {'x': '#0072b2', 'y': '#bb5566', 'z': '#44aa99'}
SMALL, NORMAL = 8, 9
FEW = 2.5           # decades: over fewer than that 2 and 5 have their numbers too
_RAISED = str.maketrans('-0123456789.', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹·')


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure of a size in inches, on a canvas of its own."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    figure = Figure(figsize=(width, height), dpi=100, facecolor='white')
    FigureCanvasAgg(figure)
    return figure


def _agg(figure: Figure) -> FigureCanvasAgg:
    """Return the canvas that :func:`new_figure` gave a figure."""
    return cast('FigureCanvasAgg', figure.canvas)


def png(figure: Figure) -> bytes:
    """Return a figure that :func:`new_figure` made as PNG bytes, the same for the same figure."""
    out = io.BytesIO()
    _agg(figure).print_png(out, metadata={'Software': None})
    return out.getvalue()


def small_png(data: bytes) -> bytes:
    """Return a PNG with few colours: 40 % of the size, and lines and labels look the same."""
    from PIL import Image
    out = io.BytesIO()
    with Image.open(io.BytesIO(data)) as image:
        few = image.convert('RGB').quantize(96, dither=Image.Dither.NONE)
        few.save(out, 'PNG')        # packed as well as can be it takes seven times as long
    return out.getvalue()


def stacked(pictures: Sequence[bytes]) -> bytes:
    """Return PNGs of the same width as one, below each other."""
    from PIL import Image
    out = io.BytesIO()
    images = [Image.open(io.BytesIO(data)).convert('RGB') for data in pictures]
    whole = Image.new('RGB', (images[0].width, sum(i.height for i in images)))
    for k, image in enumerate(images):
        whole.paste(image, (0, sum(i.height for i in images[:k])))
    whole.save(out, 'PNG')
    return out.getvalue()


def pixels(figure: Figure) -> np.ndarray:
    """Return a figure as RGB pixels, (height, width, 3) uint8: what an image message wants."""
    canvas = _agg(figure)
    canvas.draw()
    return np.ascontiguousarray(np.asarray(canvas.buffer_rgba())[..., :3])


def readable(unit: str) -> str:
    """Return a unit as people write it: ``deg/sqrt(h)`` -> ``°/√h``, ``m/s^2`` -> ``m/s²``."""
    text = unit.replace('sqrt(Hz)', '√Hz').replace('sqrt(h)', '√h').replace('deg', '°')
    text = 'µ' + text[1:] if text.startswith('ug') else text
    head, *tails = text.split('^')
    for tail in tails:
        rest = tail.lstrip('-0123456789.')
        head += tail[:len(tail) - len(rest)].translate(_RAISED) + rest
    return head


def number(value: float) -> str:
    """Return a tick's number: 0.01, 1, 1000, 10⁵, 2·10⁻⁵."""
    power = round(math.log10(abs(value))) if value else 0
    if value and (power > 3 or power < -3) and math.isclose(abs(value), 10.0 ** power):
        return ('−' if value < 0 else '') + '10' + str(power).translate(_RAISED)
    head, e, tail = f'{value:g}'.partition('e')
    return f'{head}·10{str(int(tail)).translate(_RAISED)}' if e else head


def dress(ax: Axes, title: str = '', x: str = '', y: str = '') -> Axes:
    """Give an axes its fonts, grid and labels; return it."""
    ax.tick_params(labelsize=SMALL, length=3, color=FAINT)
    for side in ('top', 'right'):
        ax.spines[side].set_visible(False)
    for side in ('left', 'bottom'):
        ax.spines[side].set_color(FAINT)
    ax.grid(True, color='#e3e7ea', linewidth=0.6)
    ax.set_axisbelow(True)
    if title:
        ax.set_title(title, fontsize=NORMAL, fontweight='bold', loc='left', color=MEASURED)
    if x:
        ax.set_xlabel(x, fontsize=SMALL)
    if y:
        ax.set_ylabel(y, fontsize=SMALL)
    return ax


def fits_beside_name(ax: Axes, title: Text) -> bool:
    """Tell whether a title at the right leaves the one at the left, of :func:`dress`, alone."""
    from matplotlib.text import Text
    renderer = cast('FigureCanvasAgg', ax.figure.canvas).get_renderer()
    name = ax.get_title(loc='left')
    left = [t for t in ax.get_children() if isinstance(t, Text) and t.get_text() == name]
    wide = sum(t.get_window_extent(renderer).width for t in [title, *left[:1]])
    return not name or wide + SMALL * ax.figure.dpi / 72 <= ax.get_window_extent().width


def log_scale(axis: Axis, low: float, high: float, most: int = 7) -> None:
    """
    Make one axis (``ax.xaxis`` or ``ax.yaxis``) logarithmic from low to high, a tick a decade.

    Fixed ticks without minor ones draw several times faster than matplotlib's own search.

    """
    first = math.ceil(math.log10(low) - 1e-9)
    last = math.floor(math.log10(high) + 1e-9)
    decades, step = range(first - 1, last + 2), max(1, -(-(last - first) // most))
    if math.log10(high / low) < FEW:
        at = [d * 10.0 ** k for k in decades for d in (1, 2, 5)]
    else:
        at = [10.0 ** k for k in range(first, last + 1, step)]
    _scale(axis, [v for v in at if low <= v <= high], 'log', low, high)
    if step == 1:
        _between(axis, [v for k in decades for d in range(1, 10)
                        if low <= (v := d * 10.0 ** k) <= high and v not in at])


def _between(axis, ticks):
    """Put ticks without numbers, with faint lines, between those of a logarithmic axis."""
    from matplotlib.ticker import FixedLocator
    axis.set_minor_locator(FixedLocator(ticks))
    axis.set_tick_params(which='minor', length=1.5, color=FAINT, width=0.5)
    axis.grid(True, which='minor', color='#f1f3f5', linewidth=0.5)


def signed_log_scale(axis: Axis, linear: float, low: float, high: float) -> None:
    """Make one axis linear within +-``linear`` and logarithmic beyond, from low to high."""
    first = math.ceil(math.log10(linear) - 0.3)      # a smaller one would lie upon that of zero
    last = math.floor(math.log10(max(high, 10.0 ** first)) + 1e-9)
    at = [10.0 ** k for k in range(first, last + 1, max(1, -(-(last - first) // 4)))]
    at = [v for v in (-at[0], 0.0, *at) if low <= v <= high]
    _scale(axis, at, 'symlog', low, high, linthresh=linear, linscale=0.5)


def _scale(axis, ticks, kind, low, high, **options):
    from matplotlib.ticker import FixedFormatter, FixedLocator, NullLocator
    ax, name = axis.axes, axis.axis_name
    (ax.set_xscale if name == 'x' else ax.set_yscale)(kind, **options)
    (ax.set_xlim if name == 'x' else ax.set_ylim)(low, high)
    axis.set_major_locator(FixedLocator(ticks))
    axis.set_major_formatter(FixedFormatter([number(v) for v in ticks]))
    axis.set_minor_locator(NullLocator())


def label_lines(ax: Axes, lines: Sequence[tuple[np.ndarray, np.ndarray, str, str]],
                avoid: Iterable[tuple[ArrayLike, ArrayLike]] = (),
                written: Iterable[tuple[float, float]] = ()) -> None:
    """
    Write names on lines, each where it is farthest from all other lines and names.

    Parameters
    ----------
    ax : Axes
        Its limits and scales must stand.
    lines : sequence of (x, y, name, colour)
        Data coordinates, (k,) each.
    avoid : sequence of (x, y)
        What else should stay free.
    written : sequence of (x, y)
        Where names stand already.

    """
    box = ax.get_window_extent()
    size = np.array([box.width, box.height])
    line_height = SMALL * ax.figure.dpi / 72

    def on_page(x, y):
        with np.errstate(all='ignore'):
            at = ax.transData.transform(np.column_stack([x, y])) - (box.x0, box.y0)
        return at[np.all(np.isfinite(at), axis=1)]

    paths = [on_page(x, y) for x, y, *_ in lines]
    seen = [p[np.all((p > 0) & (p < size), axis=1)] for p in paths]
    taken = np.concatenate([*(on_page([x], [y]) for x, y in written), np.zeros((0, 2))])
    others = [*(on_page(x, y) for x, y in avoid), taken]
    wide = np.full(len(taken), 0.5 * line_height)       # half of each name's width
    # first those that have the least choice
    for i in sorted((k for k, p in enumerate(seen) if len(p)), key=lambda k: len(seen[k])):
        _, _, name, colour = lines[i]
        half = np.array([0.3 * line_height * len(name), 0.8 * line_height])
        rest = np.concatenate([*(q for k, q in enumerate(paths) if k != i), *others])
        at = _place(seen[i], half, size, rest, taken, wide)
        taken, wide = np.vstack([taken, at]), np.append(wide, half[0])
        x, y = at / size
        ax.text(x, y, name, transform=ax.transAxes, fontsize=SMALL, color=colour,
                ha='center', va='center', zorder=6,
                bbox={'facecolor': 'white', 'edgecolor': 'none', 'pad': 1.0, 'alpha': 0.85})


def _place(path: np.ndarray, half: np.ndarray, size: np.ndarray, rest: np.ndarray,
           taken: np.ndarray, wide: np.ndarray) -> np.ndarray:
    """
    Return where a name of half a size (2,) stands best, (2,) pixels.

    On its ``path`` (n, 2), far from ``rest`` (k, 2), or below it where that is crowded; not on
    names that are ``taken``, half as ``wide``, nor where it would hide a line.

    """
    line_height = half[1] / 0.8
    below = line_height * np.array([0.0, 1.2, 2.2])
    at = np.clip(np.concatenate([path - (0, b) for b in below]), half, size - half)
    liked = np.repeat(-below / 3, len(path)) - line_height * np.abs(at[:, 0] / size[0] - 0.5)
    room = np.minimum(_distance(at, rest, half[0]), 2.5 * line_height)
    # two names side by side need the width of one
    flat = np.array([0.25, 1.0])
    room = np.minimum(room, _distance(at * flat, taken * flat))
    hides = room < 0.5 * line_height
    apart = np.column_stack([half[0] + wide, np.full(len(wide), 1.2 * line_height)])
    upon = np.any(np.all(np.abs(at[:, None] - taken) < apart, axis=2), axis=1)
    return at[int(np.argmax(room + liked - line_height * (2 * hides + 9 * upon)))]


def _distance(a, b, half=0.0):
    """Return how far each of a (n, 2), so wide to either side, is from the nearest of b."""
    if not len(b):
        return np.full(len(a), np.inf)
    apart = np.abs(a[:, None, :] - b[None, :, :])
    apart[..., 0] = np.maximum(apart[..., 0] - half, 0.0)
    return np.sqrt(np.min(np.sum(apart ** 2, axis=2), axis=1))
