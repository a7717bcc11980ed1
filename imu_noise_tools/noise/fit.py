# Copyright 2026 imu_noise_tools maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
Maximum likelihood in the cosine domain: point values, profile intervals, upper limits.

-ln L = 1/2 sum_b w_b (ln v_b + P_b/v_b), P_b the measured power of a bin, w_b its coefficients,
v_b the model's. What acts on the mean is solved for by generalised least squares inside, with the
restricted (REML) likelihood: each coefficient then counts by one less its leverage. Searched
parameters move by Fisher scoring with Levenberg's damping.

"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.fft import dct
from scipy.optimize import nnls

from .evidence import Evidence
from .kinds import Coupling, Defect, Inputs, Line, Mean, Modulation, psd_behind, Response
from .kinds import Spectrum
from .null import DEFAULT, PENALTY
from .. import units
from ..effect import Estimate, Finding, Fit, Model, Parameter
from ..errors import FitError
from ..spectrum import Bins, expected, leaked

MEASURED = (
    Line,
    Defect,
    Modulation,
)  # kinds whose values come from the samples, not from the spectral fit
CHI2_95, CHI2_90 = 3.841458820694124, 2.705543454095404
_REDDEST = 1.0  # weight of -ln(slowest amplitude) in the point estimate


@dataclass(frozen=True)
class Slot:
    """A searched parameter: which effect, which parameter."""

    label: str
    parameter: Parameter
    limits: tuple[float, float] | None = None

    def to_search(self, value: float) -> float:
        """Value -> search scale."""
        return float(np.log(value)) if self.parameter.log else float(value)

    def from_search(self, x: float) -> float:
        """Search scale -> value."""
        return float(np.exp(x)) if self.parameter.log else float(x)

    @property
    def bounds(self):
        """On the search scale."""
        low, high = self.limits or (self.parameter.lower, self.parameter.upper)
        return self.to_search(max(low, self.parameter.lower)), self.to_search(
            min(high, self.parameter.upper)
        )


@dataclass(frozen=True)
class Linear:
    """Solved parameters: values (p,), their covariance (p, p), and what is left in the bins."""

    beta: np.ndarray
    covariance: np.ndarray
    power: np.ndarray
    weight: np.ndarray
    log_det: float


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

    """

    def __init__(self, evidence: Evidence, part: str, model: Model, mean: Fit | None = None):
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
            for e in model.effects
            if not isinstance(e, MEASURED)
            for p in e.parameters
            if not (p.linear or p.discrete) and not (mean and isinstance(e, Mean))
        ]
        self.linear_slots = [
            Slot(e.label, p)
            for e in (*self.couplings, *(() if mean else self.means))
            for p in e.parameters
            if p.linear
        ]
        self.power = np.maximum(self.part.power, 1e-300)
        self.weight = self.bins.count.astype(float)
        for row in self.part.lines:  # a line took frequency, amplitude and phase with it
            top = int(np.argmax(row))
            self.weight[top] = max(self.weight[top] - 3, 0.0)
        self._slow: np.ndarray | None = None
        self._known: np.ndarray | None = None
        self._columns: dict[tuple, np.ndarray] = {}
        if self.means:
            self._prepare_slow(mean)

    # --- the mean
    # ---------------------------------------------------------------------------------------------

    def _prepare_slow(self, mean):
        e = self.evidence
        total = len(e.slow_y)
        some = {
            'whole': slice(None),
            'first': slice(0, total // 2),
            'second': slice(total // 2, None),
        }[self.part_name]
        self.inputs = Inputs(e.slow_t[some], e.dt, {k: v[some] for k, v in e.slow_others.items()})
        count = len(self.inputs.t)
        low = e.common.low[e.axis, self.part_name]
        q = np.arange(1, min(count // 4, len(low)) + 1)
        n = self.part.n
        # the mean over a block passes a cosine with the gain of its Dirichlet kernel
        gain = np.sin(np.pi * q / (2 * count)) / ((n / count) * np.sin(np.pi * q / (2 * n)))
        self._to_full = np.sqrt(n / count) / gain
        self._count = len(q)
        self._inside = int(np.searchsorted(self.bins.last, len(q) + 1, side='right'))
        self._slow = low[: len(q)]
        if mean:
            known = sum(mean.model[m.label].mean(self.inputs) for m in self.means)
            self._known = self._slow_transform(known)
            self.power = self._less_known(self.power, self._slow)

    def _slow_transform(self, y):
        y = y - np.mean(y, axis=0)
        c = dct(y, type=2, norm='ortho', axis=0)[1:self._count + 1]
        return c * (self._to_full if c.ndim == 1 else self._to_full[:, None])

    def _less_known(self, power, slow):
        """Return the bins' power less the mean that is known, of slow coefficients (q,)."""
        return np.maximum(self._replaced(power, self.weight, slow, slow - self._known), 1e-300)

    def _replaced(self, power, weight, before, after):
        """Return the bins' power with slow coefficients (q,) replaced by others."""
        i = self._inside
        if i == 0:
            return power
        change = 2 * self.dt * (after**2 - before**2)
        change = np.add.reduceat(change[: self.bins.last[i - 1] - 1], self.bins.first[:i] - 1)
        out = power.copy()
        out[:i] += change / np.maximum(weight[:i], 1e-9)
        return out

    def _decoupled(self, beta, channels):
        """Return the power (b,) and the slow coefficients (q,) less what the couplings add."""
        names, cross, own = channels
        power = np.maximum(self.part.power, 1e-300)
        power = power - 2 * beta @ cross + np.einsum('i,ijb,j->b', beta, own, beta)
        power = np.maximum(power, 1e-300)
        slow = self._slow
        if slow is not None:
            low = self.evidence.common.low
            slow = slow - beta @ [low[name, self.part_name][: len(slow)] for name in names]
            if self._known is not None:
                power = self._less_known(power, slow)
        return power, slow

    def _coupled(self, model, v):
        """Return the gains (p,) of the couplings, their covariance, and :meth:`_decoupled`."""
        channels = self._channels(model)
        _, cross, own = channels
        covariance = np.linalg.pinv(np.tensordot(own, self.weight / v, axes=(2, 0)))
        beta = covariance @ (cross @ (self.weight / v))
        covariance = covariance * np.prod([r.crowd() for r in model.of(Response)] or [1.0])
        return beta, covariance, *self._decoupled(beta, channels)

    def slow_rest(self, model, v):
        """Return the slow coefficients (q,) less what the couplings add, given a spectrum v."""
        named = [n for c in self.couplings for n in model[c.label].channels(self.evidence)]
        return self._coupled(model, v)[3] if named else self._slow

    def design(self, model) -> np.ndarray:
        """Return the slow coefficients of all columns of the mean, (q, p)."""
        columns = []
        for e in (model[m.label] for m in self.means):
            rest = {p.name: e[p.name] for p in e.parameters if not p.linear}
            key = (e.label, *rest.values())
            if key not in self._columns:
                if len(self._columns) > 8:
                    self._columns.clear()
                self._columns[key] = self._slow_transform(e.columns(self.inputs, **rest))
            columns.append(self._columns[key])
        return np.concatenate(columns, axis=1)

    def solve_linear(self, model: Model, v: np.ndarray) -> Linear:
        """Solve for all linear parameters given the model's spectrum v (b,)."""
        power, slow, weight, log_det = self.power, self._slow, self.weight, 0.0
        betas, covariances = [], []
        if self.couplings:
            beta, covariance, power, slow = self._coupled(model, v)
            betas.append(beta)
            covariances.append(covariance)
        if self.means and any(s.label == m.label for s in self.linear_slots for m in self.means):
            x = self.design(model)
            root = np.sqrt(2 * self.dt / self._fine(v))
            xw, cw = x * root[:, None], slow * root
            scale = np.sqrt(np.sum(xw**2, axis=0))
            scale[scale == 0] = 1.0
            u, s, vt = np.linalg.svd(xw / scale, full_matrices=False)
            keep = s > 1e-10 * s[0] if s[0] > 0 else np.zeros(len(s), bool)
            u, s, vt = u[:, keep], s[keep], vt[keep]
            beta = (vt.T @ ((u.T @ cw) / s)) / scale
            covariance = (vt.T / s**2) @ vt / np.outer(scale, scale)
            leverage = np.sum(u**2, axis=1)
            total = self._replaced(power, weight, slow, slow - x @ beta) * weight
            weight = weight.copy()
            i = self._inside
            if i:
                weight[:i] -= np.add.reduceat(
                    leverage[: self.bins.last[i - 1] - 1], self.bins.first[:i] - 1
                )
            weight = np.maximum(weight, 1e-9)
            power = np.maximum(total, 1e-300) / weight
            # scaled by the white level, so that it does not depend on units
            log_det = 2 * float(np.sum(np.log(s))) + 2 * float(np.sum(np.log(scale)))
            betas.append(beta)
            covariances.append(covariance)
        beta = np.concatenate(betas) if betas else np.zeros(0)
        covariance = np.zeros((len(beta), len(beta)))
        at = 0
        for c in covariances:
            covariance[at:at + len(c), at:at + len(c)] = c
            at += len(c)
        return Linear(beta, covariance, power, weight, log_det)

    def _fine(self, v):
        k = np.arange(1, self._count + 1)
        centre = 0.5 * (self.bins.first + self.bins.last - 1)
        return np.exp(np.interp(np.log(k), np.log(centre), np.log(v)))

    def _channels(self, model):
        """Return (names (p), cross (p, b), own (p, p, b)) of the couplings."""
        pair, here = self.evidence.common.pair, self.part_name
        names = [n for c in self.couplings for n in model[c.label].channels(self.evidence)]
        return (
            names,
            np.array([pair(self.evidence.axis, n, here) for n in names]),
            np.array([[pair(a, b, here) for b in names] for a in names]),
        )

    def without_couplings(self, model: Model) -> np.ndarray:
        """
        Return the power (b,) less what the model's couplings put there.

        The couplings have the values that the model gives them.

        """
        beta = [e[p.name] for e in (model[c.label] for c in self.couplings)
                for p in e.parameters if p.linear]
        return self._decoupled(np.array(beta), self._channels(model))[0]

    # --- the spectrum
    # -----------------------------------------------------------------------------------------

    def with_search(self, x: np.ndarray) -> Model:
        """Return the model at a point of the search."""
        values: dict[str, dict[str, float]] = {}
        for slot, value in zip(self.slots, x):
            values.setdefault(slot.label, {})[slot.parameter.name] = slot.from_search(value)
        return self.model.with_values(values)

    def spectra(self, model: Model) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Return (v, {label: v of that effect}) in the bins."""
        responses = model.of(Response)
        each = {e.label: self._spectrum(e, model) for e in model.of(Spectrum)}
        if not each:
            # a model of the mean alone: white noise of the measured level stands in
            return np.full(len(self.power), float(np.average(self.power, weights=self.weight))), {}
        total = sum(each.values())
        if responses:
            # rounding happens behind the filter: where that leaves nothing, the output's own step
            # is what is measured
            total = total + self.evidence.resolution**2 * self.dt / 6
            total = total + leaked(total, self.bins)
        return np.maximum(total, 1e-290), each

    def _spectrum(self, effect, model):
        """Return what one effect puts into the bins, as expected behind the sensor's responses."""
        return expected(lambda f: psd_behind(effect, model, f, self.dt), self.bins)

    def value(self, x: np.ndarray, penalty: float = 0.0, reddest: int | None = None):
        """Return (-ln L, Linear, v, each) at a point; penalised by the reddest amplitude."""
        model = self.with_search(x)
        v, each = self.spectra(model)
        linear = self.solve_linear(model, v)
        nll = (
            0.5 * float(np.sum(linear.weight * (np.log(v) + linear.power / v)))
            + 0.5 * linear.log_det
        )
        if penalty and reddest is not None:
            nll -= penalty * x[reddest]
        return nll, linear, v, each

    def jacobian(self, x, v, each) -> np.ndarray:
        """Return d ln v / d x, (b, p)."""
        out = np.zeros((len(v), len(x)))
        for j, slot in enumerate(self.slots):
            effect = self.model[slot.label]
            if isinstance(effect, Spectrum) and slot.parameter.amplitude and slot.parameter.log:
                out[:, j] = 2 * each[slot.label] / v  # power goes with the square of an amplitude
            elif isinstance(effect, (Spectrum, Response)):
                h = 1e-4
                sides = []
                for step in (h, -h):
                    moved = x.copy()
                    moved[j] += step
                    model = self.with_search(moved)
                    if isinstance(effect, Spectrum):
                        sides.append(self._spectrum(model[slot.label], model))
                    else:
                        sides.append(self.spectra(model)[0])
                out[:, j] = (sides[0] - sides[1]) / (2 * h * v)
        return out

    def minimise(self, x0, free=None, penalty=0.0, reddest=None, steps=400, enough=1e-7):
        """
        Return (x, -ln L, information) from a start.

        ``free`` (p,) bool says which parameters move; a step that gains less than ``enough`` nats
        is the last.

        """
        x = np.array(x0, float)
        p = len(x)
        free = np.ones(p, bool) if free is None else free
        lower, upper = (
            (np.array([s.bounds[i] for s in self.slots]) for i in (0, 1)) if p else (x, x)
        )
        x = np.clip(x, lower, upper)
        best, linear, v, each = self.value(x, penalty, reddest)
        damping = 1e-3
        for _ in range(steps):
            gradient, information = self._derivatives(x, linear, v, each, penalty, reddest)
            if not free.any():
                break
            g, f = gradient[free], information[np.ix_(free, free)]
            scale = np.maximum(np.diag(f), 1e-9)
            moved = False
            while damping < 1e9:
                step = -np.linalg.solve(f + damping * np.diag(scale) + 1e-12 * np.eye(len(g)), g)
                trial = x.copy()
                trial[free] += np.clip(step, -2.0, 2.0)
                trial = np.clip(trial, lower, upper)
                result = self.value(trial, penalty, reddest)
                if np.isfinite(result[0]) and result[0] <= best:
                    gain = best - result[0]
                    x, (best, linear, v, each) = trial, result
                    damping = max(damping / 10, 1e-9)
                    moved = True
                    break
                damping *= 10
            if not moved or gain < enough:
                break
            damping = min(damping, 1.0)
        return x, best, self._derivatives(x, linear, v, each, penalty, reddest)[1]

    def _derivatives(self, x, linear, v, each, penalty, reddest):
        jac = self.jacobian(x, v, each)
        w = linear.weight
        gradient = 0.5 * jac.T @ (w * (1 - linear.power / v))
        information = 0.5 * (jac * w[:, None]).T @ jac
        for j in self._mean_slots():
            h = 1e-3
            up, down = x.copy(), x.copy()
            up[j] += h
            down[j] -= h
            a, b, c = (self.value(z)[0] for z in (down, x, up))
            gradient[j] = (c - a) / (2 * h)
            information[j, j] = max((a - 2 * b + c) / h**2, 1e-3)
        if penalty and reddest is not None:
            gradient[reddest] -= penalty
        return gradient, information

    def _mean_slots(self):
        return [j for j, s in enumerate(self.slots) if isinstance(self.model[s.label], Mean)]


def fit(
    evidence: Evidence,
    model: Model,
    part: str = 'whole',
    *,
    mean: Fit | None = None,
    intervals: bool = True,
    cautious: bool | None = None,
    start: Model | None = None,
) -> Fit:
    """
    Fit a model to one part of one axis.

    Parameters
    ----------
    evidence : Evidence
        Of the axis.
    model : Model
        Values it already has are starts, not constraints.
    part : str
        ``whole``, ``first`` or ``second``.
    mean : Fit or None
        For a half: the fit of the same model to the whole.
    intervals : bool
        Whether to compute profile intervals (slow part).
    cautious : bool or None
        Whether to keep the slowest amplitude off zero, as a value with an interval wants it; None:
        where there are intervals. For a prediction the most likely value is better.
    start : Model or None
        A model whose values to start from first (the fit of a smaller model, say).

    Raises
    ------
    FitError
        No finite likelihood from any start.

    """
    model, measured, flags = _measured(evidence, model, mean)
    if mean is not None:
        for e in model.of(Mean):
            model = model.with_effect(mean.model[e.label])
    plain = Likelihood(evidence, part, model, mean)
    starts = _starts(plain, start)
    best = None
    cautious = intervals if cautious is None else cautious
    enough, most = (1e-7, 6) if cautious else (1e-3, 3)  # a comparison needs no more
    for likelihood, x0 in _most_promising(plain, starts, mean, most):
        reddest = _reddest(likelihood, x0) if cautious else None
        found = likelihood.minimise(x0, penalty=_REDDEST, reddest=reddest, enough=enough)
        found = _revived(likelihood, found, reddest, enough)
        if np.isfinite(found[1]) and (best is None or found[1] < best[0][1] - 1e-9):
            best = found, reddest, likelihood
    if best is None:
        raise FitError(
            f'{evidence.axis}: {model} has no finite likelihood',
            'remove an effect, or look at the data',
        )
    (x, _, information), reddest, likelihood = best
    nll, linear, v, each = likelihood.value(x)
    fitted = _with_linear(likelihood, likelihood.with_search(x), linear)
    estimates = dict(measured)
    if intervals:
        more, hit = _estimates(likelihood, x, information, linear, reddest)
        flags += hit
    else:
        more = _plain_estimates(likelihood, x, information, linear)
    for found in (more, _chosen_estimates(likelihood)):
        for label, values in found.items():
            estimates[label] = {**estimates.get(label, {}), **values}
    order = {e.label: e for e in fitted.effects}
    estimates = {k: estimates[k] for k in order if k in estimates}
    return Fit(
        fitted,
        estimates,
        -nll,
        tuple(flags),
        {
            'information': information,
            'v': v,
            'each': each,
            'power': linear.power,
            'weight': linear.weight,
            'ml': _maximum_likelihood(likelihood, linear, v),
            'slots': tuple((s.label, s.parameter.name) for s in likelihood.slots),
        },
    )


def _maximum_likelihood(likelihood, linear, v):
    """Return ln L without the REML terms, which makes models with other means comparable."""
    w = likelihood.weight
    return -0.5 * float(np.sum(w * np.log(v) + linear.power * linear.weight / v))


def _measured(evidence, model, mean):
    """Give effects that are measured on the samples their values; say where nothing was found."""
    estimates, flags = {}, []
    claimed: set[int] = set()
    for e in model.effects:
        if not isinstance(e, MEASURED):
            continue
        values, found, note = measure(evidence, e, claimed)
        model = model.with_effect(e.with_values(**values))
        estimates[e.label] = found
        if note:
            flags.append(f'{e.label}: {note}')
    return model, estimates, flags


def penalty(name: str) -> float:
    """
    Return the gain (nats) that chance reaches in one record of a thousand.

    Nothing is hidden in these records.

    """
    return PENALTY.get(name, DEFAULT)


def measure(evidence: Evidence, effect, claimed: set[int]):
    """Return (values, estimates, note) of an effect that is measured on the samples."""
    if isinstance(effect, Line):
        return _measure_line(evidence, effect, claimed)
    finding = evidence.measured(effect)
    if finding is not None and not isinstance(effect, (Spectrum, Response)) \
            and finding.gain < penalty(effect.name):
        finding = None  # chance finds as much where there is nothing
    if finding is None or finding.effect is None:
        values = {
            p.name: effect.neutral.get(
                p.name, 0.0 if p.amplitude or not p.log else float(np.sqrt(p.lower * p.upper))
            )
            for p in effect.parameters
        }
        found = {
            p.name: Estimate(
                None,
                None,
                (0.0, 0.0) if p.amplitude else None,
                units.si(p.unit, evidence.sensor),
                upper95=0.0 if p.amplitude else None,
                note='nothing of the kind in the samples',
                point=values[p.name],
            )
            for p in effect.parameters
        }
        return values, found, 'nothing of the kind in the samples'
    return dict(finding.effect.values), with_units(finding, evidence).estimates, ''


def with_units(finding: Finding, evidence: Evidence) -> Finding:
    """
    Return a finding whose estimates have units and points.

    They are marked as measured on the samples.

    """
    known = {p.name: p for p in finding.effect.parameters}
    return replace(
        finding,
        estimates={
            k: replace(
                v,
                unit=units.si(known[k].unit, evidence.sensor),
                fixed=True,
                point=float(finding.effect.values[k]),
            )
            for k, v in finding.estimates.items()
        },
    )


def _measure_line(evidence, effect, claimed):
    """
    Claim the strongest free line (or the one nearest to a given frequency).

    Its errors are the Cramer-Rao bound.

    """
    table = evidence.line_table
    free = [i for i in range(len(table)) if i not in claimed]
    t = evidence.duration
    rate, hertz = (units.si(p.unit, evidence.sensor) for p in effect.parameters)
    if not free:
        level = float(np.median(evidence.whole.power))
        upper = float(np.sqrt(level / t) * 2.45)  # 95 % of a Rayleigh amplitude
        found = {
            'amplitude': Estimate(
                None,
                None,
                (0.0, upper),
                rate,
                upper95=upper,
                point=0.0,
                note='not observable: no line stands out of the spectrum',
            ),
            'frequency': Estimate(
                None, None, None, hertz, point=0.25 / evidence.dt, note='no line'
            ),
        }
        return (
            {'amplitude': 0.0, 'frequency': 0.25 / evidence.dt},
            found,
            'no line stands out of the spectrum',
        )
    wanted = effect.values.get('frequency')
    near = [i for i in free if wanted and abs(table[i, 0] - wanted) < max(2 / t, 1e-3 * wanted)]
    i = near[0] if near else free[0]
    claimed.add(i)
    frequency, a, b, _ = table[i]
    amplitude = float(np.hypot(a, b))
    bins = evidence.whole.bins
    at = bins.index(max(1, min(evidence.whole.n - 1, int(2 * t * frequency))))
    level = float(np.median(evidence.whole.power[max(0, at - 5):at + 6]))
    std_a = float(np.sqrt(2 * level / (2 * t)))
    std_f = float(np.sqrt(3 * level / (np.pi**2 * amplitude**2 * t**3)))
    found = {
        'amplitude': Estimate(
            amplitude,
            std_a,
            (amplitude - 1.96 * std_a, amplitude + 1.96 * std_a),
            rate,
            point=amplitude,
            fixed=True,
        ),
        'frequency': Estimate(
            float(frequency),
            std_f,
            (frequency - 1.96 * std_f, frequency + 1.96 * std_f),
            hertz,
            point=float(frequency),
            fixed=True,
        ),
    }
    return {'amplitude': amplitude, 'frequency': float(frequency)}, found, ''


# --- starts --------------------------------------------------------------------------------------
# -------------


def _starts(likelihood: Likelihood, given: Model | None):
    """
    Return search vectors: every combination of shapes the effects propose.

    Amplitudes are set by non-negative least squares.

    """
    model = likelihood.model
    grid = [model]
    for e in model.effects:
        if isinstance(e, MEASURED):
            continue
        shapes = [p.name for p in e.parameters if not p.amplitude and not p.linear]
        known = given[e.label] if given is not None and e.label in given.labels else e
        if shapes and all(s in known.values for s in shapes):
            options = [e.with_values(**{s: known[s] for s in shapes})]
        else:
            options = e.starts(likelihood.evidence)
            if not options:
                raise FitError(
                    f'{likelihood.evidence.axis}: {e.name} does not apply to this record', e.needs
                )
        if isinstance(e, Mean) and len(options) > 2:
            options = _best_columns(likelihood, grid[0], e, options)
        grid = [g.with_effect(o) for g in grid for o in options]
    out = []
    for candidate in grid[:64]:
        out += [
            (candidate, _with_amplitudes(likelihood, candidate, share)) for share in (0.02, 0.3)
        ]
    return out


def _revived(likelihood, found, reddest, enough):
    """
    Return the better of a minimum and what follows when dead amplitudes are revived.

    These are the amplitudes that died on the way to the minimum.

    """
    x = found[0]
    v, each = likelihood.spectra(likelihood.with_search(x))
    again = x.copy()
    for j, slot in enumerate(likelihood.slots):
        share = np.max(each[slot.label] / v) if slot.label in each else 1.0
        if slot.parameter.amplitude and slot.parameter.log and share < 1e-3:
            again[j] += 0.5 * np.log(0.3 / max(share, 1e-300))
    if np.array_equal(again, x):
        return found
    other = likelihood.minimise(again, penalty=_REDDEST, reddest=reddest, enough=enough)
    return other if other[1] < found[1] - 1e-6 else found


def _best_columns(likelihood, model, effect, options, keep=2):
    """
    Return the options whose columns explain most of the slow part.

    They are judged against the smoothed measured spectrum.

    """
    root = np.sqrt(2 * likelihood.dt / likelihood._fine(_smooth(likelihood.power)))
    y = likelihood.slow_rest(model, _smooth(likelihood.power)) * root
    gains = []
    for o in options:
        rest = {p.name: o[p.name] for p in o.parameters if not p.linear}
        x = likelihood._slow_transform(o.columns(likelihood.inputs, **rest)) * root[:, None]
        scale = np.sqrt(np.sum(x**2, axis=0))
        q, r = np.linalg.qr(x / np.where(scale > 0, scale, 1.0))
        gains.append(float(np.sum((q.T @ y)[np.abs(np.diag(r)) > 1e-9] ** 2)))
    return [options[i] for i in np.argsort(gains)[::-1][:keep]]


def _most_promising(plain, starts, mean, most):
    """Return (likelihood, start) of the starts whose likelihood is best where they stand."""
    found = []
    for candidate, x0 in starts:
        likelihood = (
            plain
            if candidate == plain.model
            else Likelihood(plain.evidence, plain.part_name, candidate, mean)
        )
        found.append((likelihood.value(x0)[0], likelihood, x0))
    found.sort(key=lambda z: z[0] if np.isfinite(z[0]) else np.inf)
    return [(likelihood, x0) for _, likelihood, x0 in found[:most]]


def _with_amplitudes(likelihood, model, share):
    """
    Return the search vector with amplitudes from the measured power.

    None below a share of where it matters most.

    """
    spectra = [e for e in model.of(Spectrum) if not isinstance(e, Defect)]
    for e in spectra:
        amplitude = [p.name for p in e.parameters if p.amplitude]
        rest = {
            p.name: float(np.sqrt(p.lower * p.upper))
            for p in e.parameters
            if p.name not in e.values and p.name not in amplitude
        }
        model = model.with_effect(e.with_values(**rest, **{a: 1.0 for a in amplitude}))
    for e in model.effects:
        rest = {
            p.name: (float(np.sqrt(p.lower * p.upper)) if p.log else 0.0)
            for p in e.parameters
            if p.name not in e.values
        }
        model = model.with_effect(model[e.label].with_values(**rest))
    if spectra:
        _, each = likelihood.spectra(model)
        names = [e.label for e in spectra]
        fixed = sum(
            (v for k, v in each.items() if k not in names), np.zeros(len(likelihood.power))
        )
        shape = np.array([each[k] for k in names]).T
        power = likelihood.power
        if likelihood.couplings:  # what another channel puts there is not the noise's
            power = likelihood.solve_linear(model, _smooth(power)).power
        target = np.maximum(power - fixed, 0)
        floor = np.maximum(_smooth(power), 1e-300)
        level = floor
        # behind a filter only the band that passes says something of the amplitudes
        gain = np.prod(
            [r.gain2(likelihood.bins.f, likelihood.dt) for r in model.of(Response)]
            or [np.ones(len(floor))],
            axis=0,
        )
        passes = np.sqrt(likelihood.weight) * (gain > 0.2 * gain.max())
        for _ in range(3):
            w = passes / level
            scale = np.max(shape * w[:, None], axis=0)
            a2 = nnls(shape * w[:, None] / scale, target * w)[0] / scale
            level = np.maximum(shape @ a2 + fixed, 1e-3 * floor)
        least = share / np.max(shape / level[:, None], axis=0)
        for name, value in zip(names, np.maximum(a2, least)):
            e = model[name]
            amplitude = next(p.name for p in e.parameters if p.amplitude)
            model = model.with_effect(e.with_values(**{amplitude: float(np.sqrt(value))}))
    return np.array(
        [slot.to_search(model[slot.label][slot.parameter.name]) for slot in likelihood.slots]
    )


def _smooth(power):
    window = np.ones(9) / 9
    return np.exp(np.convolve(np.pad(np.log(power), 4, mode='edge'), window, mode='valid'))


def _reddest(likelihood, x):
    """
    Return the slot of the amplitude whose spectrum rises most towards low frequencies.

    None for a single spectrum.

    """
    spectra = [e for e in likelihood.model.of(Spectrum) if not isinstance(e, Defect)]
    if len(spectra) < 2:
        return None
    f = likelihood.bins.f
    pair = np.array([f[0], f[len(f) // 2]])
    model = likelihood.with_search(x)
    rise = {}
    for e in spectra:
        s = model[e.label].psd(pair, likelihood.dt)
        rise[e.label] = np.log(s[0]) - np.log(s[1])
    label = max(rise, key=rise.get)
    for j, slot in enumerate(likelihood.slots):
        if slot.label == label and slot.parameter.amplitude:
            return j
    return None


# --- uncertainty
# ----------------------------------------------------------------------------------------------


def _with_linear(likelihood, model, linear):
    for slot, value in zip(likelihood.linear_slots, linear.beta):
        model = model.with_effect(
            model[slot.label].with_values(**{slot.parameter.name: float(value)})
        )
    return model


def _chosen_estimates(likelihood):
    """Return what was chosen among the proposed values."""
    return {
        e.label: {
            p.name: Estimate(
                e[p.name],
                None,
                None,
                units.si(p.unit, likelihood.evidence.sensor),
                point=e[p.name],
                note='the best of the values tried',
            )
            for p in e.parameters
            if p.discrete and p.name in e.values
        }
        for e in likelihood.model.effects
        if not isinstance(e, MEASURED)
    }


def _covariance(information):
    if not len(information):
        return information
    scale = np.sqrt(np.maximum(np.diag(information), 1e-12))
    return np.linalg.pinv(information / np.outer(scale, scale), rcond=1e-10) / np.outer(
        scale, scale
    )


def _linear_estimates(likelihood, linear):
    out: dict[str, dict] = {}
    for slot, value, variance in zip(
        likelihood.linear_slots, linear.beta, np.diag(linear.covariance)
    ):
        std = float(np.sqrt(max(variance, 0)))
        value = float(value)
        lo, hi = value - 1.96 * std, value + 1.96 * std
        unit = units.si(slot.parameter.unit, likelihood.evidence.sensor)
        if slot.parameter.amplitude and lo <= 0 <= hi:
            upper = abs(value) + 1.645 * std
            e = Estimate(
                None,
                std,
                (0.0, max(abs(lo), abs(hi))),
                unit,
                upper95=upper,
                point=value,
                note='not observable: the interval holds zero',
            )
        else:
            e = Estimate(value, std, (lo, hi), unit, point=value)
        out.setdefault(slot.label, {})[slot.parameter.name] = e
    return out


def _plain_estimates(likelihood, x, information, linear):
    """Return values with the standard deviations of the information, without intervals."""
    out = _linear_estimates(likelihood, linear)
    std = np.sqrt(np.maximum(np.diag(_covariance(information)), 0)) if len(x) else []
    for slot, at, s in zip(likelihood.slots, x, std):
        value = slot.from_search(at)
        s = float(s * value if slot.parameter.log else s)
        out.setdefault(slot.label, {})[slot.parameter.name] = Estimate(
            value,
            s,
            (value - 1.96 * s, value + 1.96 * s),
            units.si(slot.parameter.unit, likelihood.evidence.sensor),
            point=value,
        )
    return out


def _estimates(likelihood, x, information, linear, reddest):
    """Return profile-likelihood intervals, upper limits and flags."""
    out = _linear_estimates(likelihood, linear)
    flags: list[str] = []
    if not len(x):
        return out, flags
    std = np.sqrt(np.maximum(np.diag(_covariance(information)), 0))
    top, least, _ = likelihood.minimise(x)  # unpenalised
    profile = _Profile(likelihood, top, least)
    for j, slot in enumerate(likelihood.slots):
        unit = units.si(slot.parameter.unit, likelihood.evidence.sensor)
        value = slot.from_search(x[j])
        wide = float(np.clip(std[j], 1e-6, 3.0))
        spread = float(std[j] * value) if slot.parameter.log else float(std[j])
        lower_bound, upper_bound = slot.bounds
        lo = profile.crossing(j, -1, CHI2_95, wide)
        if slot.parameter.amplitude and lo is None:
            upper = slot.from_search(profile.crossing(j, +1, CHI2_90, wide) or upper_bound)
            hi = slot.from_search(profile.crossing(j, +1, CHI2_95, wide) or upper_bound)
            e = Estimate(
                None,
                spread,
                (0.0, hi),
                unit,
                upper95=upper,
                point=value,
                note='not observable: the interval reaches zero',
            )
        else:
            hi = profile.crossing(j, +1, CHI2_95, wide)
            note = ''
            if lo is None or hi is None:
                note = 'one end of the interval is the bound of the search'
                flags.append(f'{slot.label}.{slot.parameter.name}: {note}')
            e = Estimate(
                value,
                spread,
                (
                    slot.from_search(lower_bound if lo is None else lo),
                    slot.from_search(upper_bound if hi is None else hi),
                ),
                unit,
                point=value,
                note=note,
            )
        out.setdefault(slot.label, {})[slot.parameter.name] = e
    return out, flags


class _Profile:
    """The profile likelihood of one parameter after another."""

    def __init__(self, likelihood, top, least):
        self.likelihood, self.top, self.least = likelihood, top, least

    def deviance(self, j, at, warm):
        """Return 2 (-ln L(at) - min) with all others free, and where they went."""
        free = np.ones(len(self.top), bool)
        free[j] = False
        x = warm.copy()
        x[j] = at
        x, nll, _ = self.likelihood.minimise(x, free=free, steps=25)
        return max(2 * (nll - self.least), 0.0), x

    def crossing(self, j, sign, level, step):
        """
        Return where the deviance reaches a level on one side.

        None where it never does (a limit).

        """
        lower, upper = self.likelihood.slots[j].bounds
        # downwards on a logarithmic scale there is nothing more to come after a few powers of ten
        reach = 14.0 if sign < 0 and self.likelihood.slots[j].parameter.log else np.inf
        low, d_low, warm = self.top[j], 0.0, self.top
        move = np.sqrt(level) * step
        high = None
        for _ in range(16):
            at = float(np.clip(low + sign * move, lower, upper))
            d, found = self.deviance(j, at, warm)
            if d >= level:
                high, d_high = at, d
                break
            if at in (lower, upper) or abs(at - self.top[j]) > reach:
                return None
            low, d_low, warm = at, d, found
            move *= 2
        if high is None:
            return None
        # The square root of the deviance is nearly a straight line; but where a step went far up a
        # wall the secant creeps, so every second try halves.
        for k in range(40):
            a, b, c = np.sqrt(d_low), np.sqrt(d_high), np.sqrt(level)
            share = 0.5 if k % 2 else np.clip((c - a) / max(b - a, 1e-12), 0.05, 0.95)
            at = low + share * (high - low)
            d, found = self.deviance(j, at, warm)
            if abs(np.sqrt(d) - c) < 2e-3:
                return at
            if d >= level:
                high, d_high = at, d
            else:
                low, d_low, warm = at, d, found
        return 0.5 * (low + high)
