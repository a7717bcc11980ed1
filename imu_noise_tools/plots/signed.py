# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a picture is of, written below it: pasted into a report it still says so."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import PurePath
from typing import Any, TYPE_CHECKING

from .style import FAINT, SMALL
from ..core import units

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STRIP = 0.24            # inches that the line takes


def origin(source: Mapping[str, Any]) -> str:
    """Return name, topic, rate, duration and date of a study's record, as far as it has them."""
    streams = source.get('streams') or {}
    every = list(streams.values()) or [source]
    rates = [float(s.get('rate_hz') or 0.0) for s in every]
    said = [source.get('sheet') or PurePath(str(source.get('path') or '')).name]
    said += list(dict.fromkeys(str(s.get('topic') or '') for s in every))
    said += list(dict.fromkeys(f'{r:.4g} Hz' for r in rates if r))
    duration, start = (float(source.get(k) or 0.0) for k in ('duration_s', 'start'))
    if duration:
        said.append(units.duration(duration))
    said.append(units.date(start))
    return '  ·  '.join(x for x in said if x)


def signed(figure: Figure, source: Mapping[str, Any]) -> Figure:
    """Return a figure with a strip more at its foot, in which it says what it is of."""
    said = origin(source)
    if not said:
        return figure
    wide, high = figure.get_size_inches()
    figure.set_size_inches(wide, high + STRIP)

    def up(y: float) -> float:
        return (y * high + STRIP) / (high + STRIP)

    for ax in figure.axes:
        box = ax.get_position(original=True)
        ax.set_position((box.x0, up(box.y0), box.width, up(box.y1) - up(box.y0)))
    for text in figure.texts:
        text.set_y(up(text.get_position()[1]))
    # a dollar in a name begins no formula
    figure.text(1 - 0.08 / wide, 0.06 / (high + STRIP), said, fontsize=SMALL, color=FAINT,
                ha='right', va='bottom', parse_math=False)
    return figure
