# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What can be looked at of a target, as numbers: curves with the model beside them, and pulls.

What there is to see belongs to the domain: the module of its name beside this one offers
``panels(state)``, {name: function that gives a :class:`Panel`}. A report draws them on paper, the
page of ``explore`` in the browser.

"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..core import units
from ..loop.effect import View

X_TITLES = {'Hz': 'frequency, Hz', 's': 'time, s', 'quantile': 'quantile of the samples',
            'sigma': 'standard deviations', 'lag': 'lag, samples'}


@dataclass(frozen=True)
class Curve:
    """
    One line of a panel, x and y (k,).

    ``kind`` is ``measured``, ``model``, ``effect`` (one effect of the model alone), ``dots``,
    ``channel`` (one of several beside each other) or ``chance`` (only ``lo`` and ``hi`` are
    drawn). ``seen`` is whether the record can show it.

    """

    name: str
    x: np.ndarray
    y: np.ndarray
    kind: str = 'measured'
    lo: np.ndarray | None = None
    hi: np.ndarray | None = None
    seen: bool = True


@dataclass(frozen=True)
class Stretch:
    """From ``low`` to ``high`` on the x axis of a panel, in the unit of that."""

    low: float
    high: float
    unit: str

    def __str__(self) -> str:
        """Return it as people read it."""
        if self.unit == 's':
            return f'{units.duration(self.low)} to {units.duration(self.high)}'
        if self.unit == 'pose':
            return f'poses {self.low:.0f} to {self.high:.0f}'
        return f'{self.low:.3g} to {self.high:.3g} {self.unit}'.strip()

    def holds(self, x: np.ndarray) -> np.ndarray:
        """Return which x (k,) are in it; the nearest where none is."""
        inside = (x >= self.low) & (x <= self.high)
        if len(x) and not inside.any():
            inside[int(np.argmin(np.abs(x - 0.5 * (self.low + self.high))))] = True
        return inside


@dataclass(frozen=True)
class Panel:
    """
    One way to look at a target.

    ``log`` names the logarithmic axes; x of the pulls (k,) is that of the curves, which may be
    none. The curves of single effects add up as squares.

    """

    name: str
    x_title: str
    unit: str
    x: np.ndarray
    pull: np.ndarray
    y_title: str = ''
    log: str = ''
    curves: tuple[Curve, ...] = ()

    def fails(self, stretch: Stretch) -> tuple[int, float]:
        """Return how many pulls a stretch holds, and their squares beyond what chance gives."""
        some = self.pull[stretch.holds(self.x)]
        return len(some), float(np.sum(some ** 2)) - len(some)

    def makes(self, stretch: Stretch) -> tuple[tuple[str, float], ...]:
        """Return the share of each effect in what the model has in a stretch, largest first."""
        parts = {c.name: float(np.mean(c.y[stretch.holds(c.x)] ** 2)) for c in self.curves
                 if c.kind == 'effect'}
        total = sum(parts.values())
        shares = [(k, v / total) for k, v in parts.items() if total > 0 and v / total > 0.005]
        return tuple(sorted(shares, key=lambda s: -s[1]))


def plain(view: View) -> Panel:
    """Return the panel of a view that has nothing to show but its pulls."""
    order = np.argsort(view.x, kind='stable')
    x = view.x[order]
    log = 'x' if view.unit == 'Hz' and x[0] > 0 else ''
    return Panel(view.name, X_TITLES.get(view.unit, view.unit or view.name), view.unit, x,
                 view.pull[order], log=log)
