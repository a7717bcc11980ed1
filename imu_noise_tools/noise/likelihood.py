# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The likelihood of a model in the cosine domain, and the way to its maximum.

-ln L = 1/2 sum_b w_b (ln v_b + P_b/v_b), P_b the measured power of a bin, w_b its coefficients,
v_b the model's. What acts on the mean is solved for by generalised least squares inside, with the
restricted (REML) likelihood: each coefficient then counts by one less its leverage. What the
samples tell of a parameter beyond the spectrum counts with it. Searched parameters move by Fisher
scoring with Levenberg's damping.

v is put together of what effects put into the bins (:mod:`~imu_noise_tools.noise.effect_spectra`),
the mean is solved for in slow coefficients (:mod:`~imu_noise_tools.noise.slow_part`), the gains of
couplings beside it (:mod:`~imu_noise_tools.noise.channels`). What is searched is known here alone.

"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from typing import cast

import numpy as np

from .behind import leaks_behind
from .channels import Channels
from .effect_spectra import EffectSpectra
from .evidence import Evidence
from .explained import Bands, Explained
from .kinds import (
    Coupling,
    Mean,
    MEASURED,
    NoiseEffect,
    owners,
    Response,
    Spectrum,
)
from .response import OpenResponse
from .shared import own_power
from .slow_part import SlowPart, SolvedMeans
from ..core.linear import inverse
from ..core.spectrum import Bins
from ..loop.effect import Fit, Model, Parameter
from ..loop.verdict import PRICE

KEPT = 16  # points of a search at which the value is kept
AT_BOUND = 1e-3     # share of the room of a shape, on the search scale, that is none


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

    ``means`` is how the columns of the mean were solved for, None where there are none.

    """

    beta: np.ndarray
    covariance: np.ndarray
    power: np.ndarray
    weight: np.ndarray
    means: SolvedMeans | None = None

    @property
    def taken(self) -> float:
        """What REML takes for the columns of the mean: twice that, nats."""
        return 0.0 if self.means is None else self.means.log_det + self.means.level

    @property
    def form(self) -> float:
        """
        What forms of the mean with more or fewer columns are compared by beside -ln L.

        A price for each in place of what REML takes, which goes with the column's size.

        """
        return 0.0 if self.means is None else \
            PRICE * self.means.columns - 0.5 * self.means.log_det


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

    Attributes
    ----------
    slow : SlowPart
        The slow coefficients, and the columns of the mean in them.
    channels : Channels
        What couplings bring in.

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
        self._values: dict[bytes, tuple[float, Linear, np.ndarray, dict[str, np.ndarray]]] = {}
        self._effects = EffectSpectra(evidence, part)
        self.slow = SlowPart(evidence, part, model, explained)
        self.channels = Channels(evidence, part, self.couplings, self.slow)
        if mean and self.means:
            self.slow.know(mean.model, self.power)
            self.power = self.slow.less_known(self.power, self.slow.measured)

    # --- what is solved for
    # ---------------------------------------------------------------------------------------------

    def slow_rest(self, model: Model, v: np.ndarray) -> np.ndarray:
        """Return the slow coefficients (q,) less what the couplings add, given a spectrum v."""
        slow = self.slow.measured
        if self.channels.names(model):
            slow = self.channels.taken_out(model, self._gains(model, v)[0])[1]
        return slow - self.slow.path

    def _gains(self, model, v):
        """Return the gains (p,) of the couplings at a spectrum (b,), and their covariance."""
        return self.channels.gains(model, v, self.weight)

    def solve_linear(self, model: Model, v: np.ndarray) -> Linear:
        """Solve for all linear parameters given the model's spectrum v (b,)."""
        power, slow, weight = self.power, self.slow.measured, self.weight
        means = None
        betas, covariances = [], []
        if self.couplings:
            beta, covariance = self._gains(model, v)
            power, slow = self.channels.taken_out(model, beta)
            betas.append(beta)
            covariances.append(covariance)
        if any(s.label == m.label for s in self.linear_slots for m in self.means):
            means = self.slow.solve(model, v, slow, power, weight)
            power, weight = means.power, means.weight
            betas.append(means.solved.beta)
            covariances.append(means.solved.covariance)
        beta = np.concatenate(betas) if betas else np.zeros(0)
        covariance = np.zeros((len(beta), len(beta)))
        at = 0
        for c in covariances:
            covariance[at:at + len(c), at:at + len(c)] = c
            at += len(c)
        return Linear(beta, covariance, power, weight, means)

    def without_couplings(self, model: Model) -> np.ndarray:
        """
        Return the power (b,) less what the model's couplings put there.

        The couplings have the values that the model gives them.

        """
        beta = [model[c.label][k] for c in self.couplings for k in c.linear]
        return self.channels.taken_out(model, np.array(beta))[0]

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

    def spectra(self, model: Model,
                leaks: bool = False) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Return (v, {label: v of that effect}) in the bins; ``leaks`` as of effects' spectra."""
        total, each = self._own(model, leaks)
        return self._with_missed(total, model) if each else total, each

    def spectrum(self, model: Model, label: str) -> np.ndarray:
        """Return v (b,) of one effect of a model, as :meth:`spectra` has it."""
        return self._effects.spectrum(cast(Spectrum, model[label]), model)

    def _own(self, model, leaks=False):
        """Return :meth:`spectra` less what couplings miss of their sources."""
        total, each = self._effects.of_model(model, leaks)
        if not each:
            # a model of the mean alone: white noise of the measured level stands in
            total = np.full(len(self.power), float(np.average(self.power, weights=self.weight)))
        return total, each

    def _with_missed(self, total, model):
        """Return a spectrum (b,) and what the model's couplings miss of their sources."""
        some = self.channels
        return np.maximum(total + some.missed(model) if some.spreads else total, 1e-290)

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
        if self.channels.spreads and each:  # what a shaken source is missed by goes with the gains
            v = self._with_missed(total, self.with_linear(model, self._gains(model, v)[0]))
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
            np.sum(linear.weight * (np.log(v) + linear.power / v))) + 0.5 * linear.taken

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
        if of and linear.means is not None:
            at = [(self.slots[j].label, self.slots[j].parameter, x[j]) for j in of]
            turned, told = self.slow.turned(self.with_search(x), at, linear.means)
            gradient[of] = turned
            information[np.ix_(of, of)] = told + 1e-3 * np.eye(len(of))
        for j, at, error in self._told:
            gradient[j] += (x[j] - at) / error**2
            information[j, j] += 1 / error**2
        return gradient, information


def spectrum_without(evidence: Evidence, fit: Fit, label: str) -> np.ndarray | None:
    """
    Return the spectrum (b,) of a fit less one effect; None where no noise would be left.

    What leaks, and what rounding adds, is there all the same: it is not the doing of the response
    beside which it shows.

    """
    rest = fit.model.minus(label)
    if not rest.of(Spectrum):
        return None
    return Likelihood(evidence, 'whole', rest).spectra(rest, leaks_behind(fit.model))[0]


def lost_without(evidence: Evidence, fit: Fit, label: str) -> float:
    """
    Return what a fit loses without an effect, nats, where all others keep their values.

    What the others do in another place beside it, where a fit without it was caught, is not its.

    """
    v, d = spectrum_without(evidence, fit, label), fit.details
    if v is None:
        return np.inf
    return 0.5 * float(np.sum(d.weight * (np.log(v / d.v) + d.power / v - d.power / d.v)))


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
