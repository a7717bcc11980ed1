# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The likelihood of a model in the cosine domain, and the way to its maximum.

-ln L = 1/2 sum_b w_b (ln v_b + P_b/v_b), P_b the measured power of a bin, w_b its coefficients,
v_b the model's. What acts on the mean is solved for by generalised least squares inside, with the
restricted (REML) likelihood: each coefficient then counts by one less its leverage. What the
samples tell of a parameter beyond the spectrum counts with it. Searched parameters move by Fisher
scoring with Levenberg's damping.

v is put together of what effects put into the bins (:mod:`~imu_noise_tools.noise.effect_spectra`).

"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, cast

import numpy as np
from scipy.fft import dct

from .effect_spectra import EffectSpectra
from .evidence import Evidence
from .explained import Bands, Explained
from .kinds import (
    Coupling,
    Mean,
    MEASURED,
    model_crowd,
    NoiseEffect,
    owners,
    Response,
    Spectrum,
)
from .response import OpenResponse
from .shared import own_power, spread
from ..core.linear import inverse, inverse_of, least_squares, log_size, Solved
from ..core.spectrum import Bins, smooth
from ..loop.effect import Fit, Model, Parameter
from ..loop.verdict import PRICE

KEPT = 16  # points of a search at which the value is kept
LINES = 4       # that are slow, the strongest, whose values are solved for beside a mean
AT_BOUND = 1e-3     # share of the room of a shape, on the search scale, that is none
SLOWEST = 1024      # coefficients, in which all is that a slow mean does


@dataclass(frozen=True)
class Slot:
    """A searched parameter: which effect, which parameter."""

    label: str
    parameter: Parameter
    limits: tuple[float, float] | None = None

    def to_search(self, value: float) -> float:
        """Value -> search scale."""
        return self.parameter.to_search(value)

    def from_search(self, x: float) -> float:
        """Search scale -> value."""
        return self.parameter.from_search(x)

    @property
    def bounds(self) -> tuple[float, float]:
        """On the search scale."""
        low, high = self.limits or (self.parameter.lower, self.parameter.upper)
        return self.to_search(max(low, self.parameter.lower)), self.to_search(
            min(high, self.parameter.upper)
        )


@dataclass(frozen=True)
class Linear:
    """
    Solved parameters: values (p,), their covariance (p, p), and what is left in the bins.

    ``mean`` is how the columns of the mean were solved for, each coefficient times its ``root``
    (q,), None where there are none. ``level`` is the ln v of the degrees of freedom that they
    took, which the weight lacks: in its sum with ln |X' V^-1 X| no unit of v is left. ``size`` is
    ln |X' X|, less which no unit of the columns is left either, nor are columns that come to say
    the same any likelier for it (Harville 1974, Bayesian inference for variance components).

    """

    beta: np.ndarray
    covariance: np.ndarray
    power: np.ndarray
    weight: np.ndarray
    level: float = 0.0
    size: float = 0.0
    mean: Solved | None = None
    root: np.ndarray | None = None

    @property
    def log_det(self) -> float:
        """Of the columns of the mean, ln |X' V^-1 X| / |X' X|."""
        return 0.0 if self.mean is None else self.mean.log_det - self.size

    @property
    def columns(self) -> int:
        """How many columns were solved for, of those that are told apart."""
        return 0 if self.mean is None else self.mean.basis.shape[1]

    @property
    def form(self) -> float:
        """
        What forms of the mean with more or fewer columns are compared by beside -ln L.

        A price for each in place of what REML takes, which goes with the column's size.

        """
        return PRICE * self.columns - 0.5 * self.log_det


def settled(effect: NoiseEffect, parameter: Parameter, evidence: Evidence) -> bool:
    """Tell whether an effect, as it is, leaves a parameter no room: it is no part of its form."""
    low, high = effect.bounds(evidence).get(parameter.name, (0.0, 1.0))
    return low == high


class Likelihood:
    """
    The likelihood of a model of one part of one axis, as a function of its searched parameters.

    Parameters
    ----------
    evidence : Evidence
    part : str
        ``whole``, ``first`` or ``second``.
    model : Model
        Measured effects must have their values already.
    mean : Fit or None
        For a half: the fit to the whole, whose mean is subtracted (a mean is not solved for again
        in a half).
    explained : Explained or None
        Which bins count, and by how much; None: all of them.

    """

    def __init__(self, evidence: Evidence, part: str, model: Model, mean: Fit | None = None,
                 explained: Explained | None = None):
        response = explained.response() if explained else None
        if response is not None and response.label not in model:
            model = model.plus(response)
        self.evidence, self.part_name, self.part, self.model = (
            evidence,
            part,
            evidence.part(part),
            model,
        )
        self.bins: Bins = self.part.bins
        self.dt = evidence.dt
        self.means, self.couplings = model.of(Mean), model.of(Coupling)
        self.slots = [
            Slot(e.label, p, e.bounds(evidence).get(p.name))
            for e in model.of(NoiseEffect)
            if not isinstance(e, MEASURED)
            for p in e.parameters
            if not (p.linear or p.discrete or settled(e, p, evidence))
            and not (mean and isinstance(e, Mean))
        ]
        self._told = self._what_is_told()
        self.linear_slots = [
            Slot(e.label, p)
            for e in (*self.couplings, *(() if mean else self.means))
            for p in e.parameters
            if p.linear
        ]
        power, self.weight = self.part.quiet_above(explained.quiet if explained else np.inf)
        self.power = np.maximum(power, 1e-300)
        for row in self.part.lines:  # a line took frequency, amplitude and phase with it
            top = int(np.argmax(row))
            self.weight[top] = max(self.weight[top] - 3, 0.0)
        self.mean, self.explained, self.full_weight = mean, explained, self.weight
        if explained is not None:
            self.weight = self.weight * explained.on(self.bins)
        self._names: dict[tuple, tuple[str, ...]] = {}
        self._spreads = {
            n: self._spread(n)
            for c in self.couplings for n in c.channels(evidence) if evidence.common.holds(n)}
        self._spreads = {k: v for k, v in self._spreads.items() if np.any(v)}
        self._slow: np.ndarray | None = None
        self._gains: dict[int, np.ndarray] = {}
        self._path = np.zeros(0)
        self._last = np.zeros(0), np.zeros(0)
        self._known: np.ndarray | None = None
        self._columns: dict[tuple, Any] = {}
        self._effects = EffectSpectra(evidence, part)
        self._pairs: dict[tuple, tuple] = {}
        self._values: dict[bytes, tuple[float, Linear, np.ndarray, dict[str, np.ndarray]]] = {}
        if self.means:
            self._prepare_slow(mean)

    def _spread(self, channel: str) -> np.ndarray:
        """Return what :func:`spread` says of a channel, which is the same for all models."""
        return self.evidence.remembered(
            ('spread', self.part_name, channel),
            lambda: spread(partial(self.evidence.coupled, part=self.part_name), channel,
                           self.bins))

    # --- the mean
    # ---------------------------------------------------------------------------------------------

    def _prepare_slow(self, mean):
        e = self.evidence
        low = e.common.low[e.axis, self.part_name]
        self._count = min(len(self._in_part(e.slow_t)) // 4, len(low))
        if all(m.slow for m in self.means):
            self._count = min(self._count, SLOWEST)
        self._inside = int(np.searchsorted(self.bins.last, self._count + 1, side='right'))
        self._slow = low[:self._count]
        # a mean is no jump of noise whose path is seen
        paths = [s.path(e) for s in self.model.of(Spectrum)]
        self._path = sum((self._slow_transform(self._in_part(x)) for x in paths if x is not None),
                         np.zeros(self._count))
        if mean:
            known = sum(mean.model[m.label].mean(e.even_inputs) for m in self.means)
            self._known = self._slow_transform(self._in_part(known))
            self._known = self._known + self._change_of_lines(
                self._slow - self._path - self._known,
                np.sqrt(2 * self.dt / self._fine(smooth(self.power))))
            self.power = self._less_known(self.power, self._slow)

    def _in_part(self, x):
        """Return those of values (n, ...) over the record that lie in the part."""
        half = len(x) // 2
        return {'whole': x, 'first': x[:half], 'second': x[half:]}[self.part_name]

    def slow_columns(self, effect: Mean, once: bool = False) -> np.ndarray:
        """Return the slow coefficients (q, p) of the columns of an effect."""
        rest = effect.nonlinear
        # a lag and a mean temperature are those of the whole record
        e = self.evidence
        inputs = e.quick_inputs(4 * SLOWEST if effect.slow else len(e.slow_t) // 2) \
            if effect.smooth else e.even_inputs
        return e.remembered(
            (self.part_name, self._count, type(effect), *rest.values()),
            lambda: self._slow_transform(self._in_part(effect.columns(inputs, **rest))), once)

    def _slow_transform(self, y):
        """
        Return the slow coefficients (q, ...) of values (n, ...) at n places of the part.

        What is asked for at fewer places is too smooth to have any beyond half as many.

        """
        out = np.zeros((self._count, *y.shape[1:]))
        top = min(self._count, len(y) // 2)
        some = np.any(y, axis=0)    # a form may leave columns empty
        y = y[..., some] if y.ndim > 1 else y
        c = dct((y - np.mean(y, axis=0)).T, type=2, norm='ortho')[..., 1:top + 1]
        c = c * self._to_full(len(y))[:top]
        out[:top, some] = c.T if y.ndim > 1 else c[:, None]
        return out

    def _to_full(self, count):
        """Return by what coefficients (q,) of block means go to those of the samples."""
        if count not in self._gains:
            q, n = np.arange(1, self._count + 1), self.part.n
            # the mean over a block passes a cosine with the gain of its Dirichlet kernel
            gain = np.sin(np.pi * q / (2 * count)) / (
                (n / count) * np.sin(np.pi * q / (2 * n)))
            self._gains[count] = np.sqrt(n / count) / gain
        return self._gains[count]

    def _less_known(self, power, slow):
        """Return the bins' power less the mean that is known, of slow coefficients (q,)."""
        return np.maximum(self._replaced(power, slow, slow - self._known), 1e-300)

    def cross_less_known(self, channel: str) -> np.ndarray:
        """Return the cross-power (b,) with a channel less that of the mean that is known."""
        cross = self.evidence.cross(channel, self.part_name)
        if self._known is None:
            return cross
        other = self.evidence.common.low[channel, self.part_name][: len(self._known)]
        return self._changed(cross, -self._known * other)

    def _summed(self, slow):
        """Return the sums of slow terms (..., q) over the bins that they fill: there are some."""
        i = self._inside
        return np.add.reduceat(slow[..., :self.bins.last[i - 1] - 1], self.bins.first[:i] - 1,
                               axis=-1)

    def _taken(self, leverage):
        """Return what slow coefficients (q,) that were solved for take from the bins (b,)."""
        out = np.zeros(len(self.power))
        if self._inside:
            out[:self._inside] = self._summed(leverage)
        return out

    def _replaced(self, power, before, after):
        """Return the bins' power with slow coefficients (q,) replaced by others."""
        return self._changed(power, after**2 - before**2)

    def _changed(self, power, change):
        """Return powers (..., b) with more in their slow coefficients, (..., q)."""
        i = self._inside
        if i == 0:
            return power
        out = power.copy()
        out[..., :i] += 2 * self.dt * self._summed(change) / self.bins.count[:i]
        return out

    def _decoupled(self, beta, channels):
        """Return the power (b,) and the slow coefficients (q,) less what the couplings add."""
        _, cross, own, first = channels
        power = np.maximum(self.part.power, 1e-300)
        power = power - 2 * beta @ cross + beta @ (beta @ own)
        power = np.maximum(power, 1e-300)
        slow = self._slow
        if slow is not None:
            slow = slow - beta @ first
            if self._known is not None:
                power = self._less_known(power, slow)
        return power, slow

    def _gains_at(self, model, v):
        """Return the gains (p,) of the couplings at a spectrum (b,), and their covariance."""
        _, cross, own, first = self._channels(model)
        share = self.weight / v
        towards, gram = cross @ share, own @ share
        some = self._left_of_means(model, v, first, self._slow)
        if some is not None:    # what the slow coefficients give these sums, as beside the mean
            each = self._of_each(share)
            slow, rest, before, first = (x[..., :len(each)] for x in (*some, self._slow, first))
            towards = towards + rest @ (each * slow) - first @ (each * before)
            gram = gram + (each * rest) @ rest.T - (each * first) @ first.T
        covariance = inverse(gram)
        return covariance @ towards, covariance * model_crowd(model)

    def _of_each(self, share):
        """Return what a sum over bins (b,) counts their slow coefficients' squares by, (k,)."""
        i = self._inside
        return np.repeat(2 * self.dt * share[:i] / self.bins.count[:i], self.bins.count[:i])

    def _beside_means(self, model, v, cross, own, first, slow):
        """
        Return cross-powers (p, b) and own powers (p, p, b) of channels as beside the mean.

        ``first`` (p, q) are the channels' slow coefficients, ``slow`` (q,) those of the axis.

        A step of all axes would else decide the gain.

        """
        some = self._left_of_means(model, v, first, slow)
        if some is None:
            return cross, own
        left, rest = some
        return (self._changed(cross, left * rest - slow * first),
                own if rest is first else
                self._changed(own, rest[:, None] * rest - first[:, None] * first))

    def _left_of_means(self, model, v, first, slow):
        """
        Return slow coefficients of an axis (q,) and of channels (p, q) beside the mean, or None.

        Less the mean that is known; of one that is solved for less what its columns can explain of
        either (Frisch and Waugh 1933), so that gains and mean are solved for together.

        """
        if slow is None or not self._inside or not len(first):
            return None
        if self._known is not None:
            return slow - self._known, first
        known = [m for m in (model[m.label] for m in self.means) if m.placed]
        if not known:
            return None
        root = np.sqrt(2 * self.dt / self._fine(v)) * self._counted()
        x = np.concatenate([self._slow_columns_of(m) for m in known], axis=1)
        told = inverse_of(x * root[:, None]) * root

        def left(y):
            return y - (y @ told.T) @ x.T

        return left(slow), left(first)

    def slow_rest(self, model: Model, v: np.ndarray) -> np.ndarray:
        """Return the slow coefficients (q,) less what the couplings add, given a spectrum v."""
        slow = self._slow
        if self._coupled_names(model):
            slow = self._decoupled(self._gains_at(model, v)[0], self._channels(model))[1]
        assert slow is not None
        return slow - self._path

    def design(self, model: Model) -> np.ndarray:
        """Return the slow coefficients of all columns of the mean, (q, p)."""
        return np.concatenate([self._slow_columns_of(model[m.label]) for m in self.means], axis=1)

    def _slow_columns_of(self, effect):
        """Return :meth:`slow_columns`, the last few of them kept."""
        return self._lately(self._shapes_of(effect), lambda: self.slow_columns(effect, once=True))

    @staticmethod
    def _shapes_of(effect):
        """Return what the columns of an effect go with."""
        return effect.label, *effect.nonlinear.values()

    def _lately(self, key, make):
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

    def solve_linear(self, model: Model, v: np.ndarray) -> Linear:
        """Solve for all linear parameters given the model's spectrum v (b,)."""
        power, slow, weight = self.power, self._slow, self.weight
        solved: tuple = ()
        betas, covariances = [], []
        if self.couplings:
            beta, covariance = self._gains_at(model, v)
            power, slow = self._decoupled(beta, self._channels(model))
            betas.append(beta)
            covariances.append(covariance)
        if self.means and any(s.label == m.label for s in self.linear_slots for m in self.means):
            assert slow is not None
            x, y = self.design(model), slow - self._path
            every = np.sqrt(2 * self.dt / self._fine(v))
            root = every * self._counted()
            columns, rest = self._beside_lines(root, x * root[:, None], y * root)
            told = least_squares(columns, rest)
            leverage, change = told.leverage, x @ told.beta
            # what is set aside may be the line's rest itself
            change = change + self._change_of_lines(y - change, every)
            left = self._replaced(power, slow, slow - change)
            counts, weight = weight, np.maximum(weight - self._taken(leverage), 1e-9)
            # what is set aside takes no part in that, and may agree all the same
            power = np.maximum(np.where(counts > 0, left * counts / weight, left), 1e-300)
            solved = (float(leverage @ np.log(self._fine(v))), self._size(model, x), told, root)
            betas.append(told.beta)
            covariances.append(told.covariance)
        beta = np.concatenate(betas) if betas else np.zeros(0)
        covariance = np.zeros((len(beta), len(beta)))
        at = 0
        for c in covariances:
            covariance[at:at + len(c), at:at + len(c)] = c
            at += len(c)
        return Linear(beta, covariance, power, weight, *solved)

    @cached_property
    def _of_lines(self) -> np.ndarray:
        """
        Return a basis (q, 3 l) of the slow coefficients of changes of the lines that are slow.

        Of cosine, sine and frequency, which were measured beside no mean: what a step has there
        went with them. The spectrum has lost what three free values take already. Changes of
        lines side by side are all but the same: a basis tells them apart once, for all spectra.

        """
        return self.evidence.remembered(
            ('lines', self.part_name, self._count),
            lambda: np.linalg.qr(self._slow_transform(self._in_part(self._changes_of_lines())))[0])

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

    def _turned_mean(self, x, of, linear):
        """
        Return how -ln L turns with some of x (p,) that the columns depend on, and the information.

        The columns are weighted, and beside lines, as they are solved for.

        """
        raw = self._changes_of_columns(x, of)
        weighted = (np.stack([self._beside_lines(linear.root, linear.root[:, None] * y)[0]
                              for y in some]) for some in raw)
        gradient, curved = linear.mean.turned(*weighted)
        counted = np.reshape(self._counted(), (-1, 1))
        own = inverse_of(self.design(self.with_search(x)) * counted)
        return gradient - np.einsum('kqp,pq->k', raw[0] * counted, own), curved

    def _changes_of_columns(self, x, of, h: float = 1e-3):
        """Return first and second derivatives (k, q, p) of the columns by some of x (p,)."""
        model = self.with_search(x)
        whose = owners(self.means)
        change, bend = np.zeros((2, len(of), self._count, len(whose)))
        for k, slot in enumerate(self.slots[j] for j in of):
            own, at = cast(Mean, model[slot.label]), x[of[k]]
            up, down = (self.slow_columns(own.with_values(
                **{slot.parameter.name: slot.from_search(at + step)}), once=True)
                for step in (h, -h))
            some = (up - down) / (2 * h), (up - 2 * self._slow_columns_of(own) + down) / h**2
            change[k][:, whose == slot.label], bend[k][:, whose == slot.label] = some
        return change, bend

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

    def _counted(self):
        """Return the root of what each slow coefficient (q,) counts."""
        if self.explained is None:
            return 1.0
        at = self.bins.index(np.arange(1, self._count + 1))
        return np.sqrt(self.explained.on(self.bins)[at])

    def _fine(self, v):
        """Return a spectrum (b,) at each slow coefficient (q,); the last one is kept."""
        if self._last[0] is not v:      # it is asked for again where means move and v stays
            self._last = v, np.exp(np.interp(*self._places, np.log(v)))
        return self._last[1]

    @cached_property
    def _places(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the ln of the slow coefficients' numbers (q,) and of the bins' centres (b,)."""
        return (np.log(np.arange(1, self._count + 1)),
                np.log(0.5 * (self.bins.first + self.bins.last - 1)))

    def _channels_of(self, coupling):
        """Return the channels of a coupling, which go with its choices alone."""
        key = coupling.label, *(coupling.values.get(p.name) for p in coupling.parameters
                                if p.choices)
        if key not in self._names:
            self._names[key] = tuple(coupling.channels(self.evidence))
        return self._names[key]

    def _coupled_names(self, model):
        return [n for c in self.couplings for n in self._channels_of(model[c.label])]

    def _channels(self, model):
        """Return (names (p), cross (p, b), own (p, p, b), slow (p, q)) of the couplings."""
        pair, here, names = self.evidence.coupled, self.part_name, self._coupled_names(model)
        if tuple(names) not in self._pairs:
            slow = [] if self._slow is None else [
                self.evidence.coupled_first(n, here)[:len(self._slow)] for n in names]
            self._pairs[tuple(names)] = (
                names,
                np.array([pair(self.evidence.axis, n, here) for n in names]),
                np.array([[pair(a, b, here) for b in names] for a in names]),
                np.array(slow),
            )
        return self._pairs[tuple(names)]

    def without_couplings(self, model: Model) -> np.ndarray:
        """
        Return the power (b,) less what the model's couplings put there.

        The couplings have the values that the model gives them.

        """
        beta = [model[c.label][k] for c in self.couplings for k in c.linear]
        return self._decoupled(np.array(beta), self._channels(model))[0]

    def left_to(self, model: Model, v: np.ndarray,
                names: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
        """
        Return what channels (p) still share with what the model leaves of the axis.

        Cross-powers (p, b), and the channels' own (p, p, b), given a spectrum v (b,); both as
        beside the mean, which the channels may have too.

        """
        def shared(others):
            """Return cross-powers, and slow coefficients where there is a mean."""
            return (np.array([[pair(a, n, here) for n in names] for a in others]),
                    np.array([] if self._slow is None else [
                        self.evidence.coupled_first(a, here)[:self._count] for a in others]))

        pair, here = self.evidence.coupled, self.part_name
        gains = {known: model[c.label][k] for c in self.couplings
                 for known, k in zip(self._channels_of(model[c.label]), c.linear)}
        beta = np.array(list(gains.values()))
        cross = np.array([pair(self.evidence.axis, n, here) for n in names])
        known, slow = shared(gains)
        own, first = shared(names)
        cross = cross - np.tensordot(beta, known, 1) if len(beta) else cross
        slow = self._slow if self._slow is None or not len(beta) else self._slow - beta @ slow
        return self._beside_means(model, v, cross, own, first, slow)

    # --- the spectrum
    # -----------------------------------------------------------------------------------------

    def beside(self, model: Model) -> Likelihood:
        """Return that of another model of the same part, on the same basis."""
        return Likelihood(self.evidence, self.part_name, model, self.mean, self.explained)

    def with_search(self, x: np.ndarray) -> Model:
        """Return the model at a point of the search."""
        values: dict[str, dict[str, float]] = {}
        for slot, value in zip(self.slots, x):
            values.setdefault(slot.label, {})[slot.parameter.name] = slot.from_search(value)
        return self.model.with_values(values)

    def spectra(self, model: Model) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Return (v, {label: v of that effect}) in the bins."""
        total, each = self._own(model)
        return self._with_missed(total, model) if each else total, each

    def spectrum(self, model: Model, label: str) -> np.ndarray:
        """Return v (b,) of one effect of a model, as :meth:`spectra` has it."""
        return self._effects.spectrum(cast(Spectrum, model[label]), model)

    def _own(self, model):
        """Return :meth:`spectra` less what couplings miss of their sources."""
        total, each = self._effects.of_model(model)
        if not each:
            # a model of the mean alone: white noise of the measured level stands in
            total = np.full(len(self.power), float(np.average(self.power, weights=self.weight)))
        return total, each

    def _with_missed(self, total, model):
        return np.maximum(total + self.missed(model) if self._spreads else total, 1e-290)

    def missed(self, model: Model) -> np.ndarray:
        """Return the power (b,) of a shared source that the couplings' channels miss."""
        out = np.zeros(len(self.power))
        for e in model.of(Coupling):
            for channel, name in zip(self._channels_of(e), e.linear):
                if channel in self._spreads:
                    out = out + e.values.get(name, 0.0) ** 2 * self._spreads[channel]
        return out

    def with_linear(self, model: Model, beta: np.ndarray) -> Model:
        """Return a model with solved parameters (p,) in it; those of couplings come first."""
        values: dict[str, dict[str, float]] = {}
        for slot, value in zip(self.linear_slots, beta):
            values.setdefault(slot.label, {})[slot.parameter.name] = float(value)
        return model.with_values(values)

    def with_solved(self, model: Model, v: np.ndarray) -> Model:
        """Return a model with its linear parameters as they are solved for at a spectrum (b,)."""
        return self.with_linear(model, self.solve_linear(model, v).beta)

    def value(self, x: np.ndarray,
              ) -> tuple[float, Linear, np.ndarray, dict[str, np.ndarray]]:
        """Return (-ln L, Linear, v, each) at a point."""
        key = np.asarray(x, float).tobytes()
        if key not in self._values:     # where a search ends it is asked for again and again
            while len(self._values) >= KEPT:
                del self._values[next(iter(self._values))]
            self._values[key] = self._value(x)
        return self._values[key]

    def _value(self, x):
        model = self.with_search(x)
        total, each = self._own(model)
        v = self._with_missed(total, model) if each else total
        if not np.isfinite(v).all():      # a step too far
            nothing = np.zeros(0)
            return np.inf, Linear(nothing, nothing, self.power, self.weight), v, each
        if self._spreads and each:  # what a shaken source is missed by goes with the gains
            v = self._with_missed(total, self.with_linear(model, self._gains_at(model, v)[0]))
        linear = self.solve_linear(model, v)
        return self._cost(linear, v) + self._untold(x), linear, v, each

    def _what_is_told(self) -> list[tuple[int, float, float]]:
        """Return (index, where, error) of what is searched and the samples tell as well."""
        told = {e.label: e.told(self.evidence) for e in self.model.of(NoiseEffect)}
        out = []
        for j, slot in enumerate(self.slots):
            if slot.parameter.name in told[slot.label]:
                value, error = told[slot.label][slot.parameter.name]
                out.append((j, slot.to_search(value), error))
        return out

    def _untold(self, x):
        """Return by how many nats values (p,) are less likely by what the samples tell."""
        return 0.5 * sum(((x[j] - at) / error) ** 2 for j, at, error in self._told)

    @staticmethod
    def _cost(linear, v):
        return 0.5 * float(
            np.sum(linear.weight * (np.log(v) + linear.power / v))) + 0.5 * (
                linear.log_det + linear.level)

    def jacobian(self, x: np.ndarray, v: np.ndarray, each: Mapping[str, np.ndarray]) -> np.ndarray:
        """Return d ln v / d x, (b, p)."""
        out = np.zeros((len(v), len(x)))
        model = self.with_search(x)
        closed = {e.label: self._effects.slopes(e, model) for e in model.of(Spectrum)}
        for j, slot in enumerate(self.slots):
            effect, name = model[slot.label], slot.parameter.name
            if isinstance(effect, OpenResponse):
                if effect.parameters.index(slot.parameter) == 0:
                    some = slice(j, j + len(effect.parameters))
                    out[:, some] = effect.slopes(self.bins)
            elif isinstance(effect, Spectrum) and slot.parameter.amplitude and slot.parameter.log:
                out[:, j] = 2 * each[slot.label] / v  # power goes with the square of an amplitude
            elif isinstance(effect, Spectrum) and name in closed[slot.label]:
                out[:, j] = closed[slot.label][name] / v
            elif isinstance(effect, Spectrum):
                out[:, j] = self._effects.slope(effect, slot.parameter, x[j], model) / v
        for own in model.of(Response):
            of = [j for j, s in enumerate(self.slots) if s.label == own.label]
            if of and not isinstance(own, OpenResponse):
                at = [(self.slots[j].parameter, x[j]) for j in of]
                out[:, of] = self._effects.response_slopes(own, at, model, each) / v[:, None]
        return out

    @cached_property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper ends, (p,) each, on the search scale."""
        ends = np.array([s.bounds for s in self.slots]).reshape(-1, 2)
        return ends[:, 0], ends[:, 1]

    def ended(self, x: np.ndarray) -> int:
        """Return how many shapes of noise of several forms lie at a bound, of those of x (p,)."""
        lower, upper = self.bounds
        near = np.minimum(x - lower, upper - x) < AT_BOUND * (upper - lower)
        several = {e.label for e in self.model.of(Spectrum)
                   if any(p.discrete for p in e.parameters)}
        return sum(bool(at_end) and s.label in several and not s.parameter.amplitude
                   for s, at_end in zip(self.slots, near))

    def information(self, x: np.ndarray) -> np.ndarray:
        """Return the Fisher matrix (p, p) at a point."""
        _, linear, v, each = self.value(x)
        return self.derivatives(x, linear, v, each)[1]

    def derivatives(self, x: np.ndarray, linear: Linear, v: np.ndarray,
                    each: Mapping[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Return the gradient (p,) of -ln L and the information (p, p) where :meth:`value` is."""
        jac = self.jacobian(x, v, each)
        w = linear.weight
        gradient = 0.5 * jac.T @ (w * (1 - linear.power / v))
        information = 0.5 * (jac * w[:, None]).T @ jac
        of = [j for j, s in enumerate(self.slots) if isinstance(self.model[s.label], Mean)]
        if of and linear.mean is not None:
            turned, told = self._turned_mean(x, of, linear)
            gradient[of] = turned
            information[np.ix_(of, of)] = told + 1e-3 * np.eye(len(of))
        for j, at, error in self._told:
            gradient[j] += (x[j] - at) / error**2
            information[j, j] += 1 / error**2
        return gradient, information


def spectrum_without(evidence: Evidence, fit: Fit, label: str) -> np.ndarray | None:
    """Return the spectrum (b,) of a fit less one effect; None where no noise would be left."""
    rest = fit.model.minus(label)
    return Likelihood(evidence, 'whole', rest).spectra(rest)[0] if rest.of(Spectrum) else None


def told_by_gains(evidence: Evidence, fit: Fit, label: str) -> float:
    """
    Return what a coupling of a fit tells by its gains alone, nats.

    That is 1/2 g' C^-1 g of its gains g, C their covariance beside all others, at the spectrum of
    the fit. A candidate's gain is what it claims; where the fit before it was caught at another
    place the refit gains more, and the spectrum that it finds is none of the coupling's doing.

    """
    model = fit.model
    solved = Likelihood(evidence, 'whole', model).solve_linear(model, fit.details.v)
    mine = np.flatnonzero(owners(model.of(Coupling)) == label)
    gains = solved.beta[mine]
    return 0.5 * float(gains @ inverse(solved.covariance[np.ix_(mine, mine)]) @ gains)


def told_anew(evidence: Evidence, fit: Fit, label: str, other: str) -> tuple[float, float]:
    """
    Return what a coupling of a fit tells beside another one, nats, and what of it is of its own.

    A source that several instruments hear each of them tells anew: what the other one leaves of it
    is what its gains make of its channels' own noise, and no more. In bands what is explained
    beyond that is of the coupling's own.

    """
    v, less = fit.details.v, fit.model.minus(label)
    alone = cast(Coupling, Likelihood(evidence, 'whole', less, fit).with_solved(less, v)[other])
    hidden, pair = np.zeros(len(v)), partial(evidence.common.pair, part='whole')
    for channel, gain in alone.gains(evidence):
        hidden = hidden + gain ** 2 * own_power(pair, channel)
    bins, weight, explained = explained_by(evidence, fit, label)
    told, beyond = (np.bincount(Bands.on(bins).of, weight * x) for x in (
        explained, explained - hidden))
    return float(np.sum(told)), float(np.sum(np.maximum(beyond, 0.0)))


def explained_by(evidence: Evidence, fit: Fit, label: str) -> tuple[Bins, np.ndarray, np.ndarray]:
    """
    Return (bins, weight, power), (b,) each, of what a coupling of a fit explains beside the rest.

    Weight times power is in nats, at the spectrum of the fit.

    """
    v, less = fit.details.v, fit.model.minus(label)
    view, before = (Likelihood(evidence, 'whole', m, fit) for m in (fit.model, less))
    explained = before.solve_linear(less, v).power - view.solve_linear(fit.model, v).power
    return view.bins, 0.5 * view.weight / v, explained
