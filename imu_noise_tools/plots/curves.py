"""What the pictures of noise show, as numbers: curves of model and effects, pulls, runs of pulls, places to read at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..allan import degrees_of_freedom, overlapping_variance
from ..effect import Effect, Model
from ..noise.evidence import Evidence
from ..noise.fit import Likelihood
from ..noise.kinds import Coupling, Inputs, Line, Mean, model_avar, Response, Spectrum
from ..noise.views import gamma_pull
from ..spectrum import quadrature_avar
from ..study import State

# A run is marked where |pull| > 2 for three points or more, one of them > 3; or for a single one > 5.
NOTABLE, STRIKING, ALONE = 2.0, 3.0, 5.0
# Where the line of an effect is read (IEEE 952 C.1): there sigma equals the coefficient.
_READ_AT = {'quantization': 3 ** 0.5, 'white': 1.0, 'random_walk': 3.0, 'ramp': 2 ** 0.5}


@dataclass(frozen=True)
class Curves:
    """
    Allan variances at the curve's averaging times, all (k,): the model's and what each effect adds.

    ``pull`` is the measured curve's distance from the model in standard errors; positive: more noise than the model has.

    """

    tau: np.ndarray
    model: np.ndarray
    each: dict[str, np.ndarray]
    pull: np.ndarray


def curves(state: State) -> Curves | None:
    """Return the curves of one axis; None where its deviation is not one the model predicts (modified, Hadamard, total)."""
    e, c, model = state.problem.evidence, state.problem.evidence.curve, state.model
    if c.deviation not in ('oadev', 'adev'):
        return None
    each = {x.label: v for x in model if (v := effect_avar(e, model, x, c.m)) is not None}
    total = sum(each.values(), np.zeros(len(c.m)))
    total = np.maximum(total, 1e-300)
    # what chance allows is a matter of the model, not of the slope that chance gave the measurement
    edf = degrees_of_freedom(np.sqrt(total), c.m, c.n, c.deviation == 'oadev')
    pull = gamma_pull(c.dev ** 2 / total, edf)
    return Curves(c.tau, total, each, pull)


def effect_avar(evidence: Evidence, model: Model, effect: Effect, m: np.ndarray) -> np.ndarray | None:
    """Return what one effect adds to the Allan variance at cluster sizes m, behind the model's responses; None: nothing."""
    dt = evidence.dt
    if isinstance(effect, Mean) and type(effect).avar is Mean.avar:
        return _drift_avar(evidence, effect, m)
    if isinstance(effect, Spectrum):
        return model_avar(Model([effect, *(r for r in model.of(Response) if r is not effect)]), m, dt)
    if isinstance(effect, (Mean, Line)):
        return effect.avar(m, dt)
    if isinstance(effect, Coupling):
        return _coupled_avar(evidence, effect, m)
    return None


def _drift_avar(evidence, effect, m):
    """Allan variance of a fitted mean, from block means; below their length it is a straight line's: as tau^2."""
    length = evidence.common.slow_length
    y = effect.mean(Inputs(evidence.slow_t, evidence.dt, evidence.slow_others))
    blocks = np.unique(np.clip(np.round(m / length), 1, len(y) // 3).astype(int))
    v = np.maximum(overlapping_variance(y, blocks), 1e-300)
    out = np.exp(np.interp(np.log(m), np.log(blocks * length), np.log(v)))
    return np.where(m < length, v[0] * (m / length) ** 2, out)


def _coupled_avar(evidence, effect, m):
    """Allan variance of what other channels put into this one, from the binned cross-spectra."""
    likelihood = Likelihood(evidence, 'whole', Model([effect]))
    s = np.maximum(likelihood.power - likelihood.without_couplings(Model([effect])), 0)
    f = likelihood.bins.f
    return quadrature_avar(lambda x: np.interp(np.log(x), np.log(f), s), m, evidence.dt)


def line_envelope(effect: Effect, m: np.ndarray, dt: float) -> np.ndarray:
    """Return the crests of a sinusoid's Allan variance at cluster sizes m: its nulls lie too close to be drawn."""
    fine = np.unique(np.round(np.geomspace(m[0], m[-1], 3000)).astype(int))
    v = effect.avar(fine, dt)
    top = int(np.argmax(v))
    v[top:] = np.maximum.accumulate(v[top:][::-1])[::-1]
    return np.interp(m, fine, v)


def runs(pull: np.ndarray) -> list[tuple[int, int]]:
    """Return [begin, end) of each run of points of one sign beyond 2 that chance hardly explains."""
    out = []
    for sign in (1, -1):
        high = np.concatenate([[False], sign * pull > NOTABLE, [False]])
        edge = np.flatnonzero(np.diff(high.astype(int)))
        out += [(a, b) for a, b in zip(edge[::2], edge[1::2])
                if np.max(sign * pull[a:b]) > (STRIKING if b - a >= 3 else ALONE)]
    return sorted(out)


@dataclass(frozen=True)
class Reading:
    """Where one coefficient is read on the curve: (tau, sigma), and how it is written there."""

    label: str
    tau: float
    sigma: float
    symbol: str
    observable: bool


def readings(state: State, found: Curves) -> list[Reading]:
    """Return where the coefficients are read: N at 1 s, K at 3 s, 0.664 B where flicker has its largest share."""
    out = []
    for e in state.model:
        if e.name in _READ_AT or e.name == 'flicker':
            p = e.parameters[0].name
            estimate = state.fit.estimates.get(e.label, {}).get(p)
            seen = estimate is None or estimate.value is not None
            if e.name == 'flicker':
                at = int(np.argmax(found.each[e.label] / np.maximum(found.model, 1e-300)))
                out.append(Reading(e.label, found.tau[at], 0.664 * e[p], f'0.664 {p}', seen))
            else:
                out.append(Reading(e.label, _READ_AT[e.name], abs(e[p]), p, seen))
    return out
