# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the pictures of noise show, as numbers: curves, pulls, runs of pulls, places to read at."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np
from scipy.special import ndtri

from ..core import units
from ..core.allan import AllanCurve, equivalent_freedom, interval
from ..core.statistics import gamma_pull, means_of_blocks
from ..loop.prediction import observable, State
from ..loop.verdict import CHANCE, STRIKING
from ..noise import in_samples, in_time, views
from ..noise.classic import FLAT, READINGS
from ..noise.curve import effects_avar, mean_avar, model_curve
from ..noise.evidence import Evidence
from ..noise.kinds import Line
from ..noise.likelihood import Likelihood
from ..noise.problem import NoiseProblem

# A run is marked where |pull| > 2 for three points or more, one of them > 3; or for one alone > 5.
NOTABLE, ALONE = CHANCE, 5.0
SHOWN = {'gyro': (units.DEG, 'deg/s'), 'accel': (1.0, 'm/s^2')}          # time series
DENSITY = {'gyro': (units.DEG, 'deg/s/sqrt(Hz)'), 'accel': (1e-6 * units.G0, 'ug/sqrt(Hz)')}
RARE = 3.29           # standard errors that one point of a thousand exceeds by chance
TAU = 'averaging time τ, s'


@dataclass(frozen=True)
class Curves:
    """
    Allan variances at the curve's averaging times, all (k,): the model's and of each effect.

    Those of several means or couplings do not add up to the model's: they have one course.

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
    each = effects_avar(e, model, model, c.m)
    total = model_curve(e, model, c.m, each)
    steady = mean_avar(e, model, c.m) + sum(v for k, v in each.items()
                                            if isinstance(model[k], Line))
    pull = gamma_pull(c.dev ** 2 / total, _degrees(c, total, steady))
    return Curves(c.tau, total, each, pull)


def _degrees(c: AllanCurve, total, steady):
    """
    Return degrees of freedom of the measured variance under the model.

    What chance allows is a matter of the model, not of the slope that chance gave the measurement;
    what does not scatter (a mean, a line) only crosses what does: var = 2 n^2/edf (1 + 2 s/n).

    """
    noise = np.maximum(total - steady, 1e-6 * total)
    edf = equivalent_freedom(np.sqrt(noise), c.m, c.n, c.deviation == 'oadev')
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


@dataclass(frozen=True)
class Densities:
    """
    Noise densities, two-sided, in the unit of :data:`DENSITY`.

    At the bins f (b,) the model's, each effect's and ``every`` measured one, without lines; at
    mid (k,) the measured ``level``, and [lo, hi] that hold 95 %.

    """

    f: np.ndarray
    every: np.ndarray
    model: np.ndarray
    each: dict[str, np.ndarray]
    mid: np.ndarray
    level: np.ndarray
    lo: np.ndarray
    hi: np.ndarray

    def with_lines(self, state: State) -> np.ndarray:
        """Return the measured ones (b,) with the lines that the model of a state does not hold."""
        e = evidence_of(state)
        return np.hypot(self.every, _density(e, views.unclaimed(e, state.model)))


def _density(e: Evidence, power: np.ndarray) -> np.ndarray:
    return np.sqrt(np.maximum(power, 1e-300) / 2) / DENSITY[e.sensor][0]


def densities(state: State) -> Densities:
    """Return the noise densities of one axis."""
    e = evidence_of(state)
    f, (measured, model, each) = e.whole.bins.f, spectra(state)
    mid, level, weight = rebinned(f, measured, e.whole.bins.count)
    level = _density(e, level)
    return Densities(f, _density(e, measured), _density(e, model),
                     {label: _density(e, s) for label, s in each.items()},
                     mid, level, *interval(level, weight))


def rebinned(f: np.ndarray, power: np.ndarray, count: np.ndarray,
             per_decade: int = 10) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (f, mean power, coefficients) of logarithmic bins made of the kept ones."""
    group = np.floor(np.log10(f / f[0]) * per_decade).astype(int)
    starts = np.flatnonzero(np.diff(np.concatenate([[-1], group])))
    w = np.add.reduceat(count.astype(float), starts)
    return (np.exp(np.add.reduceat(np.log(f) * count, starts) / w),
            np.add.reduceat(power * count, starts) / w, w)


def coarse(e: Evidence) -> tuple[np.ndarray, np.ndarray]:
    """Return (t, y) of some 256 block means."""
    per = max(1, len(e.slow_y) // 256)
    return means_of_blocks(e.slow_t, per), means_of_blocks(e.slow_y, per)


def noise_level(state: State) -> tuple[np.ndarray, np.ndarray, float]:
    """
    Return (t, ratio, spread): the noise's mean square in time over what the model says of it.

    The cube root of a ratio is nearly normal, 1 - spread in the mean with variance ``spread``
    (Wilson and Hilferty 1931).

    """
    t, x, w = in_time.power_in_time(evidence_of(state), state.model, groups=1)
    return t, (x / in_time.modulated(state.model, t, x, w))[:, 0], 2 / (9 * in_time.degrees_of(w))


def chance_of_level(spread: float) -> tuple[float, float]:
    """Return (low, high) of the rms over the model's, beyond which one point of a thousand is."""
    low, high = ((1 - spread + z * spread ** 0.5) ** 1.5 for z in (-RARE, RARE))
    return low, high


def against_normal(state: State) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """
    Return how many samples lie in each of k cells that a normal distribution fills alike.

    The middle of each in standard deviations, how many are in it, how many the model expects, and
    by which share one cell of a thousand differs by chance.

    """
    e = evidence_of(state)
    cells = e.cells_of(state.model).astype(float)
    k, total = len(cells), cells.sum()
    expected = total * in_samples.cell_shares(e, state.model, cells)[0]
    at = ndtri((np.arange(k) + 0.5) / k)
    return at, cells, expected, RARE * float(np.sqrt((1 - 1 / k) / (total / k)))


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
