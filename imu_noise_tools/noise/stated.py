# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The noise of an axis as somebody states it (a data sheet): values without a measurement."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from . import problem as measured
from .behind import model_avar
from .evidence import Evidence
from .materiality import Materiality
from .problem import NoiseProblem
from ..core import units
from ..core.allan import AllanCurve
from ..core.record import sensor_of
from ..loop.effect import Estimate, find_effect, Fit, Model, Score

STATED = 'stated'           # the method of evidence.npz
LONGEST = 1e5               # s: as far as the curve of what is stated goes


@dataclass(frozen=True)
class Stated:
    """What stands for the evidence: the curve (``dev`` of the model) at interval ``dt``, s."""

    axis: str
    dt: float
    curve: AllanCurve


class StatedProblem(NoiseProblem):
    """
    An axis whose values are stated.

    Parameters
    ----------
    axis : str
        Its name.
    dt : float
        Sample interval, s.
    values : mapping of (label, parameter) to float
        SI.

    """

    def __init__(self, axis: str, dt: float, values: Mapping[tuple[str, str], float]) -> None:
        self.values = dict(values)
        model = self._model(Model(find_effect('noise', e)() for e, _ in self.values))
        m = np.unique(np.round(np.geomspace(1, max(LONGEST / dt, 2), 120)).astype(int))
        dev = np.sqrt(model_avar(model, m, dt))
        curve = AllanCurve('oadev', dt, int(3 * m[-1]), m, m, dev, dev, dev,
                           np.full(len(m), 1e9))
        super().__init__(cast(Evidence, Stated(axis, dt, curve)))

    def _model(self, model: Model) -> Model:
        for e in model:
            known = {p.name: self.values.get((e.label, p.name), 0.0) for p in e.parameters}
            model = model.with_effect(e.with_values(**known))
        return model

    def fit(self, model: Model) -> Fit:
        """Return the values as they are stated; those that are not are None."""
        sensor = sensor_of(self.target)
        found = {
            e.label: {p.name: self._estimate(e.label, p.name, units.si(p.unit, sensor))
                      for p in e.parameters} for e in model}
        return Fit(self._model(model), found, float('nan'))

    def _estimate(self, label: str, name: str, unit: str) -> Estimate:
        value = self.values.get((label, name))
        return Estimate(value, None, None, unit, note='' if value else 'not stated', point=value)

    def point(self, model: Model) -> Fit:
        """Return the same."""
        return self.fit(model)

    def held_out(self, model: Model) -> Score:
        """Return no error: nothing was measured."""
        return Score.of([])

    def matters(self, fit: Fit) -> Materiality:
        """Nothing fails where nothing was measured."""
        return Materiality(True)

    def in_motion(self) -> float:
        """Nothing is known of how it was rounded."""
        return 0.0

    def basis(self, fit: Fit) -> dict[str, Any]:
        """Return nothing."""
        return {}

    def summary(self, fit: Fit) -> dict[str, float]:
        """Return nothing."""
        return {}

    def remarks(self, fit: Fit) -> list[str]:
        """Return nothing."""
        return []


def problems(arrays: Mapping[str, np.ndarray]) -> dict[str, NoiseProblem]:
    """Return the problem of each axis from the arrays of evidence.npz, measured or stated."""
    if str(arrays['method']) != STATED:
        return measured.problems(arrays)
    axes: dict[str, dict[tuple[str, str], float]] = {}
    for key, value in arrays.items():
        axis, _, rest = key.partition('/')
        label, _, name = rest.rpartition('.')
        if label:
            axes.setdefault(axis, {})[label, name] = float(value)
    return {axis: StatedProblem(axis, float(arrays[f'{axis}/dt']), values)
            for axis, values in axes.items()}


def arrays_of(found: dict[str, NoiseProblem]) -> dict[str, np.ndarray]:
    """Return the arrays of evidence.npz, ``axis/field``, which :func:`problems` reads back."""
    if not all(isinstance(p, StatedProblem) for p in found.values()):
        return measured.arrays_of(found)
    out = {'method': np.array(STATED)}
    for axis, p in found.items():
        out[f'{axis}/dt'] = np.array(p.evidence.dt)
        for (label, name), value in cast(StatedProblem, p).values.items():
            out[f'{axis}/{label}.{name}'] = np.array(value)
    return out
