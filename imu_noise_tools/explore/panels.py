# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What can be looked at of a target, as numbers: curves with the model beside them, and pulls.

What there is to see belongs to the domain: the module of its name beside this one offers
``panels(state)``, {name: function that gives a :class:`Panel`}, and ``by_hand(state)``, the
effects that can be put into the model by hand. Where there are any, ``begin(state, name)`` gives
one with values to begin with, and ``span(state, parameter)`` between which values its slider goes.

"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..loop.domains import part
from ..loop.effect import Effect, Model, Parameter, unfitted, View
from ..loop.prediction import State
from ..report import words

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
            return f'{words.duration(self.low)} to {words.duration(self.high)}'
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
    title: str
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


def panel_of(domain: str, state: State, name: str) -> Panel:
    """Return one panel of a target; raise KeyError where there is none of that name."""
    return part('explore', domain).panels(state)[name]()


def names_of(domain: str, state: State) -> dict[str, str]:
    """Return the panels of a target: titles by name."""
    return {name: words.title_of(name) for name in part('explore', domain).panels(state)}


def names_by_hand(domain: str, state: State) -> list[str]:
    """Return the effects that can be put into a model by hand."""
    return part('explore', domain).by_hand(state)


def begin_by_hand(domain: str, state: State, name: str) -> Effect:
    """Return one of them with values to begin with; raise InputError where it does not apply."""
    return part('explore', domain).begin(state, name)


def span_of(domain: str, state: State, effect: Effect, parameter: Parameter,
            ) -> tuple[float, float]:
    """
    Return between which values a parameter of an effect put in by hand can be set.

    A size within three decades of where it began.

    """
    low, high = part('explore', domain).span(state, parameter)
    size = abs(effect[parameter.name])
    if (parameter.amplitude or parameter.linear) and size:
        low = max(low, size / 1e3 if parameter.log else -10 * size)
        high = min(high, size * 1e3 if parameter.log else 10 * size)
    return low, high


def stated(state: State, model: Model) -> State:
    """Return a target with another model fitted; its error is not worked out."""
    return replace(state, fit=state.problem.point(unfitted(model)))


def with_hand(state: State, effect: Effect) -> State:
    """Return a target with an effect of stated size in its model, nothing fitted again."""
    return replace(state, fit=replace(state.fit, model=state.fit.model.plus(effect)))


def of_views(views: Iterable[View]) -> Mapping[str, Callable[[], Panel]]:
    """Return a panel of its pulls for each view that says anything."""
    return {v.name: lambda v=v: plain(v) for v in views if len(v.pull)}     # type: ignore[misc]


def plain(view: View) -> Panel:
    """Return the panel of a view that has nothing to show but its pulls."""
    order = np.argsort(view.x, kind='stable')
    x = view.x[order]
    log = 'x' if view.unit == 'Hz' and x[0] > 0 else ''
    return Panel(view.name, words.title_of(view.name),
                 X_TITLES.get(view.unit, view.unit or words.title_of(view.name)), view.unit,
                 x, view.pull[order], log=log)
