# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The slow coefficients of a part of a record, and what acts on the mean in them.

What acts on the mean is slow, or shows in few coefficients: it is solved for in the first of them
themselves, with their signs, and taken from the power of the bins that they fill.

"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import numpy as np
from scipy.fft import dct

from .evidence import Evidence
from .explained import Explained
from .kinds import Mean, owners, Spectrum
from ..core.linear import inverse_of, least_squares, log_size, Solved
from ..core.spectrum import Bins, smooth
from ..loop.effect import Model, Parameter

LINES = 4       # that are slow, the strongest, whose values are solved for beside a mean
SLOWEST = 1024      # coefficients, in which all is that a slow mean does


@dataclass(frozen=True)
class SolvedMeans:
    """
    How the columns of the mean were ``solved`` for, each coefficient times its ``root`` (q,).

    ``power`` and ``weight`` (b,) are what is left of the bins. ``level`` is ln v of the degrees of
    freedom that they took, which the weight lacks: in its sum with ln |X' V^-1 X| no unit of v
    is left. ``size`` is ln |X' X|, less which no unit of the columns is left either, nor are
    columns that come to say the same any likelier for it (Harville 1974, Bayesian inference for
    variance components).

    """

    solved: Solved
    root: np.ndarray
    power: np.ndarray
    weight: np.ndarray
    level: float
    size: float

    @property
    def log_det(self) -> float:
        """Of the columns of the mean, ln |X' V^-1 X| / |X' X|."""
        return self.solved.log_det - self.size

    @property
    def columns(self) -> int:
        """How many columns were solved for, of those that are told apart."""
        return self.solved.basis.shape[1]


class SlowPart:
    """
    The first q coefficients of a part, with their signs; q is 0 for a model without a mean.

    Parameters
    ----------
    evidence : Evidence
    part : str
        ``whole``, ``first`` or ``second``.
    model : Model
        Its effects on the mean are what is solved for.
    explained : Explained or None
        Which bins count, and by how much; None: all of them.

    Attributes
    ----------
    measured : np.ndarray
        The coefficients (q,) of the axis.
    path : np.ndarray
        Those (q,) of noise whose path is seen: a mean is no jump of that.
    known : np.ndarray or None
        Those (q,) of a mean that is known (:meth:`know`), which is not solved for.

    """

    def __init__(self, evidence: Evidence, part: str, model: Model, explained: Explained | None):
        self.evidence, self.part_name, self.part = evidence, part, evidence.part(part)
        self.bins: Bins = self.part.bins
        self.dt, self.explained = evidence.dt, explained
        self.means = model.of(Mean)
        low = evidence.common.low[evidence.axis, part]
        self.count = min(len(self._in_part(evidence.slow_t)) // 4, len(low)) if self.means else 0
        if all(m.slow for m in self.means):
            self.count = min(self.count, SLOWEST)
        self._inside = int(np.searchsorted(self.bins.last, self.count + 1, side='right'))
        self.measured = low[:self.count]
        self._gains: dict[int, np.ndarray] = {}
        self._last = np.zeros(0), np.zeros(0)
        self._columns: dict[tuple, Any] = {}
        paths = [s.path(evidence) for s in model.of(Spectrum)] if self.means else []
        self.path = sum((self.transformed(x) for x in paths if x is not None),
                        np.zeros(self.count))
        self.known: np.ndarray | None = None

    def know(self, model: Model, power: np.ndarray) -> None:
        """Take the means as they are in a model, beside a measured spectrum (b,)."""
        inputs = self.evidence.even_inputs
        known = self.transformed(np.asarray(
            sum(cast(Mean, model[m.label]).mean(inputs) for m in self.means)))
        self.known = known + self._change_of_lines(
            self.measured - self.path - known,
            np.sqrt(2 * self.dt / self.fine(smooth(power))))

    # --- values over the record, as coefficients
    # ---------------------------------------------------------------------------------------------

    def _in_part(self, x):
        """Return those of values (n, ...) over the record that lie in the part."""
        half = len(x) // 2
        return {'whole': x, 'first': x[:half], 'second': x[half:]}[self.part_name]

    def transformed(self, x: np.ndarray) -> np.ndarray:
        """
        Return the slow coefficients (q, ...) of values (n, ...) at n places of the record.

        What is asked for at fewer places is too smooth to have any beyond half as many.

        """
        y = self._in_part(x)
        out = np.zeros((self.count, *y.shape[1:]))
        top = min(self.count, len(y) // 2)
        some = np.any(y, axis=0)    # a form may leave columns empty
        y = y[..., some] if y.ndim > 1 else y
        c = dct((y - np.mean(y, axis=0)).T, type=2, norm='ortho')[..., 1:top + 1]
        c = c * self._to_full(len(y))[:top]
        out[:top, some] = c.T if y.ndim > 1 else c[:, None]
        return out

    def _to_full(self, count):
        """Return by what coefficients (q,) of block means go to those of the samples."""
        if count not in self._gains:
            q, n = np.arange(1, self.count + 1), self.part.n
            # the mean over a block passes a cosine with the gain of its Dirichlet kernel
            gain = np.sin(np.pi * q / (2 * count)) / (
                (n / count) * np.sin(np.pi * q / (2 * n)))
            self._gains[count] = np.sqrt(n / count) / gain
        return self._gains[count]

    def of_channels(self, names: Sequence[str]) -> np.ndarray:
        """Return the slow coefficients (p, q) of channels (p) as couplings hear them."""
        if not self.count:
            return np.zeros((len(names), 0))
        heard = self.evidence.coupled_first
        return np.array([heard(n, self.part_name)[:self.count] for n in names])

    # --- coefficients and bins
    # ---------------------------------------------------------------------------------------------

    def fine(self, v: np.ndarray) -> np.ndarray:
        """Return a spectrum (b,) at each slow coefficient (q,); the last one is kept."""
        if self._last[0] is not v:      # it is asked for again where means move and v stays
            self._last = v, np.exp(np.interp(*self._places, np.log(v)))
        return self._last[1]

    @cached_property
    def _places(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the ln of the slow coefficients' numbers (q,) and of the bins' centres (b,)."""
        return (np.log(np.arange(1, self.count + 1)),
                np.log(0.5 * (self.bins.first + self.bins.last - 1)))

    def _counted(self) -> Any:
        """Return the root of what each slow coefficient (q,) counts."""
        if self.explained is None:
            return 1.0
        at = self.bins.index(np.arange(1, self.count + 1))
        return np.sqrt(self.explained.on(self.bins)[at])

    def of_each(self, share: np.ndarray) -> np.ndarray:
        """Return what a sum over bins (b,) counts their slow coefficients' squares by, (k,)."""
        i = self._inside
        return np.repeat(2 * self.dt * share[:i] / self.bins.count[:i], self.bins.count[:i])

    def _summed(self, slow):
        """Return the sums of slow terms (..., q) over the bins that they fill: there are some."""
        i = self._inside
        return np.add.reduceat(slow[..., :self.bins.last[i - 1] - 1], self.bins.first[:i] - 1,
                               axis=-1)

    def _taken(self, leverage):
        """Return what slow coefficients (q,) that were solved for take from the bins (b,)."""
        out = np.zeros(len(self.bins.f))
        if self._inside:
            out[:self._inside] = self._summed(leverage)
        return out

    def changed(self, power: np.ndarray, change: np.ndarray) -> np.ndarray:
        """Return powers (..., b) with more in their slow coefficients, (..., q)."""
        i = self._inside
        if i == 0:
            return power
        out = power.copy()
        out[..., :i] += 2 * self.dt * self._summed(change) / self.bins.count[:i]
        return out

    def replaced(self, power: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """Return the bins' power with slow coefficients (q,) replaced by others."""
        return self.changed(power, after**2 - before**2)

    def less_known(self, power: np.ndarray, slow: np.ndarray) -> np.ndarray:
        """Return the bins' power less the mean that is known, of slow coefficients (q,)."""
        if self.known is None:
            return power
        return np.maximum(self.replaced(power, slow, slow - self.known), 1e-300)

    def cross_less_known(self, channel: str) -> np.ndarray:
        """Return the cross-power (b,) with a channel less that of the mean that is known."""
        cross = self.evidence.cross(channel, self.part_name)
        if self.known is None:
            return cross
        other = self.evidence.common.low[channel, self.part_name][:self.count]
        return self.changed(cross, -self.known * other)

    # --- the columns of the mean
    # ---------------------------------------------------------------------------------------------

    def columns(self, effect: Mean, once: bool = False) -> np.ndarray:
        """Return the slow coefficients (q, p) of the columns of an effect."""
        rest = effect.nonlinear
        # a lag and a mean temperature are those of the whole record
        e = self.evidence
        inputs = e.quick_inputs(4 * SLOWEST if effect.slow else len(e.slow_t) // 2) \
            if effect.smooth else e.even_inputs
        return e.remembered(
            (self.part_name, self.count, type(effect), *rest.values()),
            lambda: self.transformed(effect.columns(inputs, **rest)), once)

    def design(self, model: Model) -> np.ndarray:
        """Return the slow coefficients of all columns of the mean, (q, p)."""
        return self._side_by_side(model[m.label] for m in self.means)

    def _side_by_side(self, effects):
        """Return the slow coefficients of the columns of effects, (q, p)."""
        return np.concatenate([self._columns_of(e) for e in effects], axis=1)

    def _columns_of(self, effect):
        """Return :meth:`columns`, the last few of them kept."""
        return self._lately(self._shapes_of(effect), lambda: self.columns(effect, once=True))

    @staticmethod
    def _shapes_of(effect):
        """Return what the columns of an effect go with."""
        return effect.label, *effect.nonlinear.values()

    def _lately(self, key: tuple, make: Callable[[], Any]) -> Any:
        """Return what was made for a key, or make it; the last few are kept."""
        if key not in self._columns:
            if len(self._columns) > 8:
                self._columns.clear()
            self._columns[key] = make()
        return self._columns[key]

    def _size(self, model, x):
        """Return ln |X' X| of the columns (q, p) of a model's mean, that of the last few kept."""
        return self._lately(
            tuple(self._shapes_of(model[m.label]) for m in self.means),
            lambda: log_size(x * np.reshape(self._counted(), (-1, 1))))

    def solve(self, model: Model, v: np.ndarray, slow: np.ndarray, power: np.ndarray,
              weight: np.ndarray) -> SolvedMeans:
        """
        Solve for the means of a model in slow coefficients (q,), given its spectrum v (b,).

        What they take is taken from the power and the weight of the bins (b,).

        """
        x, y = self.design(model), slow - self.path
        every = np.sqrt(2 * self.dt / self.fine(v))
        root = every * self._counted()
        columns, rest = self._beside_lines(root, x * root[:, None], y * root)
        told = least_squares(columns, rest)
        leverage, change = told.leverage, x @ told.beta
        # what is set aside may be the line's rest itself
        change = change + self._change_of_lines(y - change, every)
        left = self.replaced(power, slow, slow - change)
        counts, weight = weight, np.maximum(weight - self._taken(leverage), 1e-9)
        # what is set aside takes no part in that, and may agree all the same
        power = np.maximum(np.where(counts > 0, left * counts / weight, left), 1e-300)
        level = float(leverage @ np.log(self.fine(v)))
        return SolvedMeans(told, root, power, weight, level, self._size(model, x))

    def beside_means(self, model: Model, v: np.ndarray, slow: np.ndarray, others: np.ndarray,
                     ) -> tuple[np.ndarray, np.ndarray] | None:
        """
        Return slow coefficients of an axis (q,) and of others (p, q) beside the mean, or None.

        Less the mean that is known; of one that is solved for less what its columns can explain of
        either (Frisch and Waugh 1933), so that gains and mean are solved for together.

        """
        if not self._inside or not len(others):
            return None
        if self.known is not None:
            return slow - self.known, others
        placed = [m for m in (cast(Mean, model[m.label]) for m in self.means) if m.placed]
        if not placed:
            return None
        root = np.sqrt(2 * self.dt / self.fine(v)) * self._counted()
        x = self._side_by_side(placed)
        told = inverse_of(x * root[:, None]) * root

        def left(y):
            return y - (y @ told.T) @ x.T

        return left(slow), left(others)

    def turned(self, model: Model, at: Sequence[tuple[str, Parameter, float]],
               means: SolvedMeans) -> tuple[np.ndarray, np.ndarray]:
        """
        Return how -ln L turns with what the columns depend on (k,), and the information (k, k).

        That is ``at`` a label, a parameter and its place on the search scale each. The columns are
        weighted, and beside lines, as they were solved for.

        """
        raw = self._changes_of_columns(model, at)
        weighted = (np.stack([self._beside_lines(means.root, means.root[:, None] * y)[0]
                              for y in some]) for some in raw)
        gradient, curved = means.solved.turned(*weighted)
        counted = np.reshape(self._counted(), (-1, 1))
        own = inverse_of(self.design(model) * counted)
        return gradient - np.einsum('kqp,pq->k', raw[0] * counted, own), curved

    def _changes_of_columns(self, model, at, h: float = 1e-3):
        """Return first and second derivatives (k, q, p) of the columns by what they depend on."""
        whose = owners(self.means)
        change, bend = np.zeros((2, len(at), self.count, len(whose)))
        for k, (label, parameter, x) in enumerate(at):
            own = cast(Mean, model[label])
            up, down = (self.columns(own.with_values(
                **{parameter.name: parameter.from_search(x + step)}), once=True)
                for step in (h, -h))
            some = (up - down) / (2 * h), (up - 2 * self._columns_of(own) + down) / h**2
            change[k][:, whose == label], bend[k][:, whose == label] = some
        return change, bend

    # --- lines beside the mean
    # ---------------------------------------------------------------------------------------------

    @cached_property
    def _of_lines(self) -> np.ndarray:
        """
        Return a basis (q, 3 l) of the slow coefficients of changes of the lines that are slow.

        Of cosine, sine and frequency, which were measured beside no mean: what a step has there
        went with them. The spectrum has lost what three free values take already. Changes of
        lines side by side are all but the same: a basis tells them apart once, for all spectra.

        """
        return self.evidence.remembered(
            ('lines', self.part_name, self.count),
            lambda: np.linalg.qr(self.transformed(self._changes_of_lines()))[0])

    def _changes_of_lines(self):
        inputs, top = self.evidence.even_inputs, SLOWEST / (2 * self.evidence.duration)
        rows = [row for row in self.evidence.line_table if row[0] < top]
        rows = sorted(rows, key=lambda row: -abs(row[3]))[:LINES]
        t, out = inputs.t - np.mean(inputs.t), [np.zeros((len(inputs.t), 0))]
        for f, a, b, _, *stretch in rows:
            begin, end = self.evidence.dt * np.array(stretch)
            there = (inputs.t >= begin) & (inputs.t < end)
            cos, sin = (there * g(2 * np.pi * f * inputs.t) for g in (np.cos, np.sin))
            out.append(np.stack([cos, sin, t / t[-1] * (b * cos - a * sin) / np.hypot(a, b)], 1))
        return np.concatenate(out, axis=1)

    def _change_of_lines(self, slow, root):
        """Return the change of the lines (q,) that slow coefficients (q,) show, of such roots."""
        more = self._of_lines
        if not more.size:
            return 0.0
        return more @ (inverse_of(more * root[:, None]) @ (slow * root))

    def _beside_lines(self, root, *some):
        """Return weighted columns and coefficients (q, ...) less what changed lines explain."""
        if not self._of_lines.size:
            return some
        # beside a mean a line has other values than it had by itself
        own = self._of_lines * root[:, None]
        told = inverse_of(own)
        return [x - own @ (told @ x) for x in some]
