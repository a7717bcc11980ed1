"""What the pictures of noise show, as numbers: curves, pulls, runs of pulls, places to read at."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np

from ..allan import AllanCurve, degrees_of_freedom, overlapping_variance
from ..effect import Effect, Model
from ..noise.classic import FLAT, READINGS
from ..noise.evidence import Evidence
from ..noise.fit import Likelihood
from ..noise.kinds import Coupling, Defect, Inputs, Line, Mean, model_avar
from ..noise.kinds import Response, Spectrum
from ..noise.problem import NoiseProblem
from ..noise.views import gamma_pull
from ..spectrum import quadrature_avar
from ..study import State

# A run is marked where |pull| > 2 for three points or more, one of them > 3; or for one alone > 5.
NOTABLE, STRIKING, ALONE = 2.0, 3.0, 5.0


@dataclass(frozen=True)
class Curves:
    """
    Allan variances at the curve's averaging times, all (k,): the model's and of each effect.

    ``pull`` is how far the measured curve lies from the model, in standard errors under the model;
    positive: more noise than the model has.

    """

    tau: np.ndarray
    model: np.ndarray
    each: dict[str, np.ndarray]
    pull: np.ndarray


def evidence_of(state: State) -> Evidence:
    """Return the evidence of one axis of a noise study."""
    return cast(NoiseProblem, state.problem).evidence


def curves(state: State) -> Curves | None:
    """Return the curves of one axis; None where no model predicts its deviation (mdev ...)."""
    e, model = evidence_of(state), state.model
    c = e.curve
    if c.deviation not in ('oadev', 'adev'):
        return None
    each = {x.label: v for x in model if (v := effect_avar(e, model, x, c.m)) is not None}
    total = np.maximum(sum(each.values(), np.zeros(len(c.m))), 1e-300)
    steady = sum((v for k, v in each.items() if isinstance(model[k], (Mean, Line))), 0.0 * total)
    pull = gamma_pull(c.dev ** 2 / total, _degrees(c, total, steady))
    return Curves(c.tau, total, each, pull)


def _degrees(c: AllanCurve, total, steady):
    """
    Return degrees of freedom of the measured variance under the model.

    What chance allows is a matter of the model, not of the slope that chance gave the measurement;
    what does not scatter (a mean, a line) only crosses what does: var = 2 n^2/edf (1 + 2 s/n).

    """
    noise = np.maximum(total - steady, 1e-6 * total)
    edf = degrees_of_freedom(np.sqrt(noise), c.m, c.n, c.deviation == 'oadev')
    return edf * (total / noise) ** 2 / (1 + 2 * steady / noise)


def effect_avar(evidence: Evidence, model: Model, effect: Effect, m: np.ndarray):
    """Return what one effect adds to the Allan variance at cluster sizes m (k,); None: nothing."""
    dt = evidence.dt
    if isinstance(effect, Mean) and type(effect).avar is Mean.avar:
        return _drift_avar(evidence, effect, m)
    if isinstance(effect, Spectrum):
        behind = [r for r in model.of(Response) if r is not effect]
        return model_avar(Model([effect, *behind]), m, dt)
    if isinstance(effect, (Mean, Line)):
        return effect.avar(m, dt)
    if isinstance(effect, Coupling):
        return _coupled_avar(evidence, effect, m)
    if isinstance(effect, Defect) and _screens(effect):
        return _screened_avar(evidence, m)
    return None


def _drift_avar(evidence, effect, m):
    """Allan variance of a fitted mean by its block means; below a block, of a straight line."""
    length = evidence.common.slow_length
    y = effect.mean(Inputs(evidence.slow_t, evidence.dt, evidence.slow_others))
    blocks = np.unique(np.clip(np.round(m / length), 1, len(y) // 3).astype(int))
    v = np.maximum(overlapping_variance(y, blocks), 1e-300)
    out = np.exp(np.interp(np.log(m), np.log(blocks * length), np.log(v)))
    return np.where(m < length, v[0] * (m / length) ** 2, out)


def _coupled_avar(evidence, effect, m):
    """Allan variance of what other channels put into this one, from the binned cross-spectra."""
    alone = Model([effect])
    likelihood = Likelihood(evidence, 'whole', alone)
    s = np.maximum(likelihood.power - likelihood.without_couplings(alone), 0)
    at = np.log(likelihood.bins.f)
    return quadrature_avar(lambda f: np.interp(np.log(f), at, s), m, evidence.dt)


def _screens(effect):
    own, none = (getattr(c.screen, '__func__', None) for c in (type(effect), Defect))
    return own is not none


def _screened_avar(evidence, m):
    """
    Allan variance of isolated samples that are screened before the fit, and stay in the curve.

    They are white; their level is that of the curve at one sample less that of the spectrum, which
    was made without them: 2 int S(f) sin^2(pi f dt) df.

    """
    bins, curve, part = evidence.whole.bins, evidence.curve, evidence.whole
    width = bins.count / (2 * bins.n * bins.dt)
    s = part.power + part.lines.sum(axis=0)
    clean = 2 * np.sum(s * np.sin(np.pi * bins.f * bins.dt) ** 2 * width)
    return max(curve.dev[0] ** 2 * curve.m[0] - clean, 0.0) / m


def line_envelope(effect: Line, m: np.ndarray, dt: float) -> np.ndarray:
    """
    Return a line's Allan variance, its crests where the nulls would lie too close to be drawn.

    From half a period on, the crests fall as 1/tau^2: sin^4 = 1 in IEEE 952 C.1.7.

    """
    half = 0.5 / (effect['frequency'] * dt)
    crest = effect.avar(np.array([half]), dt) * (half / m) ** 2
    return np.where(m < half, effect.avar(m, dt), crest)


def spectra(state: State) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Return power in the bins of the whole record, (b,): measured, the model's, each effect's."""
    likelihood = Likelihood(evidence_of(state), 'whole', state.model, state.fit)
    measured = likelihood.without_couplings(state.model) if likelihood.couplings else \
        likelihood.power
    return measured, *likelihood.spectra(state.model)


def runs(pull: np.ndarray) -> list[tuple[int, int]]:
    """Return [begin, end) of runs of one sign beyond 2 that chance hardly explains."""
    out = []
    for sign in (1, -1):
        high = np.concatenate([[False], sign * pull > NOTABLE, [False]])
        edge = np.flatnonzero(np.diff(high.astype(int)))
        out += [(int(a), int(b)) for a, b in zip(edge[::2], edge[1::2])
                if np.max(sign * pull[a:b]) > (STRIKING if b - a >= 3 else ALONE)]
    return sorted(out)


@dataclass(frozen=True)
class Reading:
    """Where one coefficient is read: (tau, sigma), what is written there, if it is resolved."""

    label: str
    tau: float
    sigma: float
    symbol: str
    observable: bool


def observable(state: State, label: str) -> bool:
    """Tell whether any amplitude of an effect is resolved."""
    found = state.fit.estimates.get(label, {})
    amplitudes = [found[p.name].value is not None for p in state.model[label].parameters
                  if p.amplitude and p.name in found]
    return any(amplitudes) or not amplitudes


def readings(state: State, found: Curves) -> list[Reading]:
    """Return where coefficients are read: N at 1 s, K at 3 s, 0.664 B where flicker is most."""
    out = []
    for e in state.model:
        if e.name in READINGS and e.label in found.each:
            name, slope, tau, _ = READINGS[e.name]
            sigma, symbol = abs(e[name]), name
            if slope == 0:
                tau = found.tau[int(np.argmax(found.each[e.label] / found.model))]
                sigma, symbol = FLAT * sigma, f'{FLAT:.3f} {name}'
            out.append(Reading(e.label, float(tau), sigma, symbol, observable(state, e.label)))
    return out
