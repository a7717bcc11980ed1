# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the pictures of noise show, as numbers: curves, pulls, runs of pulls, places to read at."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np

from ..core.allan import AllanCurve, degrees_of_freedom
from ..core.statistics import gamma_pull
from ..loop.prediction import State
from ..loop.verdict import CHANCE, STRIKING
from ..noise.classic import FLAT, READINGS
from ..noise.curve import effect_avar
from ..noise.evidence import Evidence
from ..noise.kinds import Line, Mean
from ..noise.likelihood import Likelihood
from ..noise.problem import NoiseProblem

# A run is marked where |pull| > 2 for three points or more, one of them > 3; or for one alone > 5.
NOTABLE, ALONE = CHANCE, 5.0


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


def line_envelope(effect: Line, m: np.ndarray, dt: float) -> np.ndarray:
    """
    Return a line's Allan variance, its crests where the nulls would lie too close to be drawn.

    From half a period on, the crests fall as 1/tau^2: sin^4 = 1 in IEEE 952 C.1.7. Of several
    lines the strongest gives the period.

    """
    if not effect.lines():
        return np.zeros(len(m))
    half = 0.5 / (max(effect.lines(), key=lambda line: line[1])[0] * dt)
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
