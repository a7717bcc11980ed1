# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What was chosen among some values: the best of them, and all that may be as well.

A mean that is read behind a lag goes otherwise for each lag, and where the lag is not known what
goes with it is not known either: its interval is that over all lags, each weighed by its
likelihood (Hoeting et al. 1999, Bayesian model averaging). Of each the spectrum is fitted anew,
as what a lag gets wrong is noise beside it. The values that a mean proposes are as likely
beforehand.

"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.special import ndtr

from .descent import minimise
from .kinds import Mean
from .likelihood import Linear
from .search import Found, REDDEST
from .uncertainty import Estimates, of_linear
from ..core.statistics import CHI2_95, interval, TWO_SIDED

HOPELESS = 10.0     # nats below the best, at its spectrum, that a spectrum of its own never makes
ROUNDS = 8          # of going between neighbours
APART = 0.5         # standard deviations by which neighbours may differ that are as likely, nats
ENOUGH = 1e-3       # nats that end a fit
COARSE = 0.05       # of a mean, that its readings do not tell, from where too many intervals miss
FEW_STEPS = 'read in few steps: the interval may be too narrow'
OUTSIDE = 0.025     # of what may be, on either side of an interval
HALVINGS = 60       # of what may be, to find its end


@dataclass(frozen=True)
class Way:
    """
    One of the ways to read a mean, what is solved for by it, and how probable it is.

    ``coarse`` is whether what it is read by shows few steps of what it follows.

    """

    mean: Mean
    linear: Linear
    weight: float
    coarse: bool


def ways(found: Found) -> tuple[Found, list[Way]]:
    """
    Return the best fit of all ways to read its means, and what those ways say.

    Nothing where nothing was chosen. Ways that a mean proposes come in rows in which neighbours
    are alike; where those differ the one between them is asked as well, so that the best is found
    though it is none of them. Beside what else tells of what a mean follows it is no matter how
    that is read: it stays as it is, and how well that is known is asked without the other.

    """
    out: list[Way] = []
    for mean in found.likelihood.means:
        proposed = mean.ways(found.likelihood.evidence)
        if proposed:
            alone = mean.with_values(**{p.name: proposed[0][0][p.name] for p in mean.parameters
                                        if p.choices})
            fits = _Fits(found if alone == mean else _fitted(found, alone), alone)
            rows = [_with(dict(enumerate(row)), alone) for row in proposed]
            for _ in range(ROUNDS):
                finer = [fits.between(row) for row in rows]
                if finer == rows:
                    break
                rows = finer
            out = fits.weighed(rows)
            found = fits.best if alone == mean else found
    return found, out


def over_ways(said: Estimates, found: Found, some: Sequence[Way]) -> Estimates:
    """
    Return estimates whose intervals are those over all ways to read a mean.

    Of what is solved for, and of what was chosen.

    """
    if not some:
        return said
    out = {label: dict(values) for label, values in said.items()}
    weight = np.array([w.weight for w in some])
    beta = np.array([w.linear.beta for w in some])
    std = np.sqrt(np.array([np.diag(w.linear.covariance) for w in some]))
    for slot, at, spread in zip(found.likelihood.linear_slots, beta.T, std.T):
        here = out[slot.label][slot.parameter.name]
        if np.any(spread) and here.point is not None:
            low, high = (_quantile(weight, at, spread, p) for p in (OUTSIDE, 1 - OUTSIDE))
            if here.std:    # of the way that is stated, whichever others there are
                low, high = (pick(pair) for pick, pair in zip(
                    (min, max), zip((low, high), interval(here.point, here.std))))
            wide = of_linear(slot, here.point, (high - low) / (2 * TWO_SIDED), (low, high),
                             found.likelihood.evidence.sensor)
            coarse = some[0].coarse and slot.label == some[0].mean.label
            out[slot.label][slot.parameter.name] = replace(wide, note=FEW_STEPS) \
                if coarse and wide.value is not None else wide
    label, rows = some[0].mean.label, some[0].mean.ways(found.likelihood.evidence)
    for name in _chosen(some[0].mean):
        tried = [mean[name] for row in rows for mean in row]
        here, at = out[label][name], np.array([w.mean[name] for w in some])
        order = np.argsort(at)
        seen = at[order][np.searchsorted(np.cumsum(weight[order]), [OUTSIDE, 1 - OUTSIDE])]
        ends = float(min(seen[0], here.point)), float(max(seen[1], here.point))
        out[label][name] = replace(here, value=here.point, ci95=ends, note=(
            'one end of the interval is the last of the values tried'
            if ends[0] == min(tried) != 0 or ends[1] == max(tried) else here.note))
    return out


def _quantile(weight: np.ndarray, at: np.ndarray, std: np.ndarray, share: float) -> float:
    """Return below what a share is of normal distributions at (k,), std (k,), of weights (k,)."""
    low, high = float(np.min(at - 9 * std)), float(np.max(at + 9 * std))
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        below = float(weight @ ndtr((middle - at) / np.maximum(std, 1e-300)))
        low, high = (middle, high) if below < share else (low, middle)
    return 0.5 * (low + high)


def _chosen(mean: Mean) -> list[str]:
    """Return the names of what is chosen of a mean among some numbers."""
    return [p.name for p in mean.parameters if p.discrete and not p.choices]


def _with(row: dict[float, Mean], mean: Mean) -> dict[float, Mean]:
    """Return ways by their places in a row, and a mean at its own where it lies between two."""
    wanted = np.array([mean[name] for name in _chosen(mean)])
    for (i, a), (j, b) in pairwise(row.items()):
        ends = np.array([[x[name] for name in _chosen(mean)] for x in (a, b)])
        along = ends[1] - ends[0]
        share = float(along @ (wanted - ends[0])) / float(along @ along)
        if 0 < share < 1 and np.allclose(ends[0] + share * along, wanted):
            return dict(sorted({**row, i + share * (j - i): mean}.items()))
    return row


def _fitted(found: Found, mean: Mean) -> Found:
    """Return the fit by another way to read a mean, from one that is known."""
    likelihood = found.likelihood.beside(found.likelihood.model.with_effect(mean))
    x, nll = minimise(likelihood, found.x, penalty=REDDEST, reddest=found.slowest, enough=ENOUGH)
    return Found(likelihood, x, nll, found.slowest)


class _Fits:
    """The fits by ways to read a mean, as far as they were asked for."""

    def __init__(self, found: Found, mean: Mean):
        """Begin with the one that is there."""
        self.best = found
        self.known: dict[Mean, Found | None] = {mean: found}
        likelihood = found.likelihood
        solved = likelihood.with_linear(likelihood.model, _linear(found).beta)[mean.label]
        assert isinstance(solved, Mean)
        self.missed = solved.missed(likelihood.evidence)
        self.size = np.sqrt(likelihood.part.n)

    def by(self, mean: Mean) -> Found | None:
        """Return the fit by a way; None where it is hopeless."""
        if mean not in self.known:
            start, slowest, out = self.best, self.best.slowest, None
            likelihood = start.likelihood.beside(start.likelihood.model.with_effect(mean))
            here = Found(likelihood, start.x, likelihood.value(start.x)[0] - (
                0.0 if slowest is None else REDDEST * start.x[slowest]), slowest)
            if here.nll - start.nll < HOPELESS or self._reads_alike(here):
                out = _fitted(start, mean)
                if out.nll < start.nll:
                    self.best = out
            self.known[mean] = out
        return self.known[mean]

    def _reads_alike(self, found: Found) -> bool:
        """Tell whether a mean differs from the best by no more than its readings leave open."""
        if not self.missed:
            return False
        one, other = (f.likelihood.slow.design(f.likelihood.model) @ _of_means(f)
                      for f in (found, self.best))
        return float(np.linalg.norm(one - other)) < self.missed * self.size

    def _deviance(self, found: Found) -> float:
        """Return 2 ln L below the best; of what reads alike nothing."""
        return 0.0 if self._reads_alike(found) else 2 * (found.nll - self.best.nll)

    def between(self, row: dict[float, Mean]) -> dict[float, Mean]:
        """Return ways by their places in a row, and those between likely ones that differ."""
        for mean in row.values():
            self.by(mean)
        out = dict(row)
        for (i, a), (j, b) in pairwise(row.items()):
            if self._differ(a, b):
                out[0.5 * (i + j)] = a.with_values(
                    **{name: 0.5 * (a[name] + b[name]) for name in _chosen(a)})
        return dict(sorted(out.items()))

    def _differ(self, *pair: Mean) -> bool:
        some = [f for f in map(self.by, pair) if f is not None]
        if not any(self._deviance(f) < CHI2_95 for f in some):
            return False
        if len(some) < 2:
            return True
        one, other = map(_linear, some)
        std = np.sqrt(np.diag(one.covariance))
        return abs(some[0].nll - some[1].nll) > APART or bool(
            np.any(np.abs(one.beta - other.beta) > APART * std))

    def weighed(self, rows: Sequence[dict[float, Mean]]) -> list[Way]:
        """Return the ways of rows, each by its likelihood and by how much of its row it is."""
        out = []
        for row in rows:
            places = np.array(list(row))
            share = 0.5 * np.diff(places, prepend=places[0] - 1, append=places[-1] + 1)
            for mean, one, other in zip(row.values(), share, share[1:]):
                found = self.by(mean)
                if found is not None:
                    out.append((mean, found, (one + other) * np.exp(-0.5 * self._deviance(found))))
        total = sum(weight for *_, weight in out)
        shown = self.best.likelihood.slow.design(self.best.likelihood.model) @ _of_means(self.best)
        coarse = self.missed * self.size > COARSE * float(np.linalg.norm(shown))
        return [Way(mean, _linear(found), weight / total, coarse) for mean, found, weight in out]


def _linear(found: Found) -> Linear:
    """Return what is solved for at a minimum."""
    return found.likelihood.value(found.x)[1]


def _of_means(found: Found) -> np.ndarray:
    """Return the solved parameters (p,) of the columns of the mean."""
    count = sum(len(m.linear) for m in found.likelihood.means)
    return _linear(found).beta[-count:]
