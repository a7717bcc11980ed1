# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The popular readings of an Allan curve: weighted least squares (``avar``) and slopes (``slopes``).

They throw information away (a slope reading of B or K is easily wrong by a half) and are offered
because everybody knows them. Their standard deviations come from the equivalent degrees of freedom
of the points they use.

"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize, nnls

from .curve import bin_weights
from .evidence import Evidence
from .kinds import Line, Mean, NoiseEffect, Spectrum
from ..core import units
from ..core.errors import UsageError
from ..core.statistics import interval, ONE_SIDED
from ..loop.effect import Estimate, Fit, Model

FLAT = np.sqrt(2 * np.log(2) / np.pi)  # 0.664: the flat part is 0.664 B
# name: parameter, slope, tau at which the line of that slope is read, and what the reading is
# divided by
READINGS = {
    'quantization': ('Q', -1.0, np.sqrt(3), 1.0),
    'white': ('N', -0.5, 1.0, 1.0),
    'flicker': ('B', 0.0, 1.0, FLAT),
    'random_walk': ('K', 0.5, 3.0, 1.0),
    'ramp': ('R', 1.0, np.sqrt(2), 1.0),
}
NEAR = 0.25  # a slope farther from the wanted one is not that slope


def fit_avar(evidence: Evidence, full: Fit) -> Fit:
    """
    Return the model fitted to the Allan curve.

    Non-negative least squares weighted by edf, shapes by simplex search.

    Parameters
    ----------
    evidence : Evidence
        Of the axis; its whole curve is fitted.
    full : Fit
        The likelihood fit: start of the shape parameters, and the values of what does not show in
        a curve.

    """
    terms = _CurveTerms(evidence, full.model)
    x = np.array([np.log(full.model[label][n]) for label, n in terms.shapes])
    if len(x):
        x = minimize(lambda z: terms.solve(z)[1], x, method='Nelder-Mead',
                     options={'maxiter': 200}).x
    square, _, a, w = terms.solve(x)
    gain = np.linalg.pinv(a * w[:, None]) * w  # squares = gain @ measured variances
    covariance = gain @ curve_covariance(evidence, full.details.v) @ gain.T
    fitted, estimates = full.model, {k: dict(v) for k, v in full.estimates.items()}
    for k, e in enumerate(terms.effects):
        name, found, own = terms.amplitude[e.label], terms.values(e, x), estimates[e.label]
        of = {p.name: units.si(p.unit, evidence.sensor) for p in e.parameters}
        own[name] = _from_square(square[k], float(np.sqrt(max(covariance[k, k], 0))), of[name])
        for n, v in found.items():
            own[n] = Estimate(v, None, None, of[n], point=v,
                              note='from the Allan curve, without an interval')
        found[name] = max(float(np.sqrt(square[k])), _floor(e, name))
        fitted = fitted.with_effect(fitted[e.label].with_values(**found))
    return Fit(fitted, estimates, full.log_likelihood, full.flags, full.details)


class _CurveTerms:
    """The effects of a model that show in an Allan curve by one amplitude each."""

    def __init__(self, evidence: Evidence, model: Model):
        self.curve = c = evidence.curve
        self.effects = [e for e in model.of(NoiseEffect) if isinstance(e, (Spectrum, Mean))
                        and type(e).avar is not Mean.avar and len(e.amplitudes) == 1]
        self.rest = sum((e.share(c.n * c.dt) * e.avar(c.m, c.dt) for e in model.of(Line)),
                        np.zeros(len(c.m)))
        self.shapes = [(e.label, p.name) for e in self.effects for p in e.parameters
                       if not p.amplitude]
        self.amplitude = {e.label: e.amplitudes[0] for e in self.effects}

    def values(self, effect: NoiseEffect, x: np.ndarray) -> dict[str, float]:
        """Return the values of an effect's shapes."""
        return {n: float(np.exp(v)) for (label, n), v in zip(self.shapes, x)
                if label == effect.label}

    def solve(self, x: np.ndarray) -> tuple[np.ndarray, float, np.ndarray, np.ndarray]:
        """Return squared amplitudes, what they leave, columns and weights for shapes (logs)."""
        c, tau2 = self.curve, self.curve.dev ** 2
        a = np.array([
            e.with_values(**{self.amplitude[e.label]: 1.0}, **self.values(e, x)).avar(c.m, c.dt)
            for e in self.effects]).T
        level = tau2
        for _ in range(4):
            w = np.sqrt(c.edf / 2) / level
            scale = np.maximum(np.max(a * w[:, None], axis=0), 1e-300)
            s, norm = nnls(a * w[:, None] / scale, np.maximum(tau2 - self.rest, 0) * w)
            level = np.maximum(a @ (s / scale) + self.rest, 1e-6 * tau2)
        return s / scale, norm, a, w


def _from_square(square: float, spread: float, unit: str) -> Estimate:
    """Return an amplitude from its square and the standard deviation of that."""
    value = float(np.sqrt(square))
    low, high = np.sqrt(interval(square, spread, positive=True)).tolist()
    if low > 0:
        return Estimate(value, spread / (2 * value), (low, high), unit, point=value)
    upper = float(np.sqrt(square + ONE_SIDED * spread))
    return Estimate(None, None, (0.0, high), unit, upper95=upper, point=value,
                    note='not observable in the Allan curve')


def curve_covariance(evidence: Evidence, v: np.ndarray) -> np.ndarray:
    """
    Return the covariance (k, k) of the measured Allan variances.

    It holds under a model with power v (b,) in the bins.

    A bin of w ordinates has variance 2 v^2/w.

    """
    bins = evidence.whole.bins
    g = bin_weights(bins, evidence.curve.m)
    return (g * (2 * v**2 / bins.count)) @ g.T


def _floor(effect, name):
    """Return the lower bound of an amplitude on a logarithmic scale, else zero."""
    p = effect.parameter(name)
    return p.lower if p.log else 0.0


def fit_slopes(evidence: Evidence, full: Fit, bias_at: str = 'flat') -> Fit:
    """
    Return the model with coefficients read from the slopes of the curve.

    Each is read at the point whose local slope is nearest to its line's.

    Parameters
    ----------
    evidence : Evidence
        Of the axis; its curve is read.
    full : Fit
        The likelihood fit: the values of what is not read from the curve.
    bias_at : str
        Where B is read: ``flat`` (slope nearest to zero), ``rise`` (the first rise after tau = 1
        s), ``minimum``, or a number of seconds.

    """
    c = evidence.curve
    slope = c.slope
    fitted, estimates = full.model, {k: dict(v) for k, v in full.estimates.items()}
    for e in full.model:
        known = next((n for n in e.lineage() if n in READINGS), '')
        if not known:
            continue
        name, wanted, at, divisor = READINGS[known]
        unit = units.si(e.parameter(name).unit, evidence.sensor)
        some = (
            np.flatnonzero(c.tau < 1)
            if known == 'white' and np.sum(c.tau < 1) > 2
            else np.arange(len(c.tau))
        )
        i = some[int(np.argmin(np.abs(slope[some] - wanted)))]
        if known == 'flicker':
            i = _bias_point(c, bias_at, i)
        value = float(c.dev[i] * (at / c.tau[i]) ** wanted / divisor)
        there = abs(slope[i] - wanted) <= NEAR or (known == 'flicker' and bias_at != 'flat')
        ratio = value / c.dev[i]
        if there:
            std = value / np.sqrt(2 * c.edf[i])
            estimates[e.label][name] = Estimate(
                value, float(std), (float(c.lo[i] * ratio), float(c.hi[i] * ratio)), unit,
                point=value, note=f'read at tau = {c.tau[i]:.4g} s, slope {slope[i]:+.2f}')
        else:
            value = _floor(e, name)
            upper = float(np.min(c.hi * (at / c.tau) ** wanted / divisor))
            estimates[e.label][name] = Estimate(
                None, None, (0.0, upper), unit, upper95=upper, point=value,
                note=f'no part of the curve has slope {wanted:+.1f}')
        fitted = fitted.with_effect(fitted[e.label].with_values(**{name: value}))
    return Fit(fitted, estimates, full.log_likelihood, full.flags, full.details)


def _bias_point(c, rule, flattest):
    if rule == 'flat':
        return flattest
    if rule == 'minimum':
        return int(np.argmin(c.dev))
    if rule == 'rise':
        late = np.flatnonzero((c.tau > 1) & (np.append(np.diff(c.dev), 0) > 0))
        return int(late[0]) if len(late) else int(np.argmin(c.dev))
    try:
        return int(np.argmin(np.abs(np.log(c.tau / float(rule)))))
    except ValueError:
        raise UsageError(
            f'--bias-at {rule} is none of flat, rise, minimum or seconds', 'e.g. --bias-at 100'
        ) from None
