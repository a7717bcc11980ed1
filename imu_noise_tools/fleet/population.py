# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The population behind one coefficient of many units: plain arrays, no files, no plots, no Dask.

Coefficients are amplitudes, so they are looked at on a log scale. A record's value is

    y = X beta + u[unit] + a[unit, axis] + r[record] + e

with u ~ N(0, tau^2) between units, a ~ N(0, omega^2) between the axes of one unit, r ~ N(0, rho^2)
between the records of one axis, and e ~ N(0, s^2) the error of measurement, whose s is known: the
linear mixed model (Laird and Ware 1982), its variances by restricted maximum likelihood (Patterson
and Thompson 1971). A record that does not show its value well, or not at all, enters by the
likelihood of its square (:mod:`.amplitude`), which is not normal on this scale: by expectation
propagation (Minka 2001; Rasmussen and Williams 2006, section 3.6), each likelihood in turn being
replaced by the normal one that does the same to what all others say.

A unit that is out must not hide by widening the spread that it is measured with. So each unit is a
mixture: regular with probability 1 - OUT, or moved in one of a few directions (the whole unit, one
of its axes, a drift over its dates) by an amount of its own, N(0, WIDE^2). Both are normal, so all
of it is in closed form (a rank-one change of V), the probability of being out comes with it, and a
unit that is out has no weight in the spread (Box and Tiao 1968; of the same family as the
heavy-tailed fits, but it says for each unit which it is, and in which axis).

Of few units this likelihood has two maxima: with a unit out beside a narrow spread, and with the
unit within a wide one. Between them decides the unit's distance from the others alone, by the
spread of the others alone: the deletion residual (Cook and Weisberg 1982, section 2.2.2), here the
direction as a fixed effect with Student's t, at a level shared by all units and directions.

"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, special, stats

from .amplitude import deviance, of_limit

Array = NDArray[np.float64]
OUT = 0.03          # share of units that are out, before anything is known of them ...
WHOLE = 0.5         # ... and of these, those that are out with all of their axes
WIDE = np.log(2.0)  # how far out: one standard deviation is a factor of two
FALSE = 0.05        # false discovery rate of what is called
MASKED = 0.01       # level at which one of all units is out beside the spread of the others:
#                     N, B and K of two sensors together have about FALSE
SMALL, LARGE = 5e-4, 3.0        # bounds of a standard deviation on the log scale
LEAST = 3           # units that show a value, for a population
MOST = 4000         # records from which variances are estimated; more do not change them
DENSE = 900         # records up to which degrees of freedom are computed
VAGUE = 30.0        # variance on the log scale, more than all that is free
REACH = 1.0         # on the log scale
NODES, WEIGHTS = np.polynomial.hermite_e.hermegauss(20)


@dataclass(frozen=True)
class Sample:
    """
    Records of one coefficient.

    Parameters
    ----------
    y : array (n,)
        Natural log of the value, or of its 95 % upper limit.
    s : array (n,)
        Standard error of it; of a limit not used.
    limit : bool array (n,)
        Whether it shows an upper limit only.
    unit, axis : int array (n,)
        Which unit, numbered from 0 without gaps, and which of its axes.
    X : array (n, p)
        Fixed effects, of full rank.
    time : array (n,) or None
        When, in any unit of time; NaN where unknown.
    square : array (n, 3) or None
        What the record says of the square: mode, std and dof (:mod:`.amplitude`); NaN where y and
        s say it all, or where it is a limit and no more.

    """

    y: Array
    s: Array
    limit: NDArray[np.bool_]
    unit: NDArray[np.int64]
    axis: NDArray[np.int64]
    X: Array
    time: Array | None = None
    square: Array | None = None

    def squares(self) -> Array:
        """Return what each record says of its square (n, 3); NaN where y and s say it all."""
        out = np.full((len(self.y), 3), np.nan) if self.square is None else self.square.copy()
        plain = self.limit & ~np.isfinite(out[:, 0])
        out[plain] = np.column_stack(of_limit(np.exp(self.y[plain])))
        return out

    @property
    def units(self) -> int:
        """Number of units."""
        return int(np.max(self.unit)) + 1

    def part(self, some: NDArray[np.bool_]) -> Sample:
        """Return the records of some units, numbered anew."""
        _, unit = np.unique(self.unit[some], return_inverse=True)
        return Sample(self.y[some], self.s[some], self.limit[some], unit, self.axis[some],
                      self.X[some], None if self.time is None else self.time[some],
                      None if self.square is None else self.square[some])

    def directions(self) -> dict[str, Array]:
        """
        Return in which ways a unit may be out: 'unit', 'axis k', 'drift', each (n,).

        A drift is a straight line over a unit's own dates, where it has three or more; 1 is the
        span of the dates of all.

        """
        out = {'unit': np.ones(len(self.y))}
        axes = np.unique(self.axis)
        if len(axes) > 1:
            out.update({f'axis {k}': (self.axis == k).astype(float) for k in axes})
        if self.time is not None and (line := self._lines()).any():
            out['drift'] = line
        return out

    def _lines(self) -> Array:
        """Return each record's place on the dates of its unit; zero where they are too few."""
        assert self.time is not None
        known = np.isfinite(self.time)
        line = np.zeros(len(self.y))
        if known.sum() < 3 or np.ptp(self.time[known]) <= 0:
            return line
        t = np.where(known, self.time, 0.0) / np.ptp(self.time[known])
        count = np.bincount(self.unit, known, self.units)
        mean = np.bincount(self.unit, t * known, self.units) / np.maximum(count, 1)
        pairs = np.unique(np.column_stack([self.unit, np.round(t, 9)])[known], axis=0)
        dates = np.bincount(pairs[:, 0].astype(int), minlength=self.units)
        able = known & (dates >= 3)[self.unit]
        line[able] = (t - mean[self.unit])[able]
        return line


class _Nested:
    """V = diag(d) + omega^2 in each (unit, axis) + tau^2 in each unit, by its inverse (n,)."""

    def __init__(self, data: Sample, group: NDArray[np.int64], d: Array, tau: float,
                 omega: float) -> None:
        self.unit, self.group, self.units = data.unit, group, data.units
        self.w, self.tau2, self.omega2 = 1 / d, tau**2, omega**2
        in_group = np.bincount(group, self.w)
        self.inner = self.omega2 / (1 + self.omega2 * in_group)
        self.one = self.w / (1 + self.omega2 * in_group)[group]
        per_unit = np.bincount(self.unit, self.one, self.units)
        self.outer = self.tau2 / (1 + self.tau2 * per_unit)
        first = np.zeros(len(in_group), int)
        first[group] = self.unit
        self.logdet = (np.bincount(self.unit, np.log(d), self.units)
                       + np.bincount(first, np.log1p(self.omega2 * in_group), self.units)
                       + np.log1p(self.tau2 * per_unit))

    def solve(self, a: Array) -> Array:
        """Return V^-1 a for a vector (n,) or the columns of a matrix (n, p)."""
        if a.ndim > 1:
            return np.column_stack([self.solve(x) for x in a.T])
        b = self.w * (a - (self.inner * np.bincount(self.group, self.w * a))[self.group])
        return b - self.one * (self.outer * np.bincount(self.unit, b, self.units))[self.unit]

    def diagonal(self) -> Array:
        """Return the diagonal of V^-1 (n,)."""
        return (self.w - self.inner[self.group] * self.w**2
                - self.outer[self.unit] * self.one**2)

    def dot(self, a: Array, solved: Array) -> Array:
        """Return a' V^-1 b for each unit, of a and what :meth:`solve` gave for b."""
        return np.asarray(np.bincount(self.unit, a * solved, self.units), float)


@dataclass
class _Sites:
    """What records say by their likelihoods, as normal pseudo-observations of it (m,)."""

    at: Array
    var: Array


@dataclass(frozen=True)
class Fit:
    """
    A population.

    Parameters
    ----------
    beta, cov : array (p,), (p, p)
        Fixed effects and their covariance.
    tau, omega, rho : float
        Standard deviations between units, axes of a unit, records of an axis (log scale).
    out : array (units, 1 + directions)
        Probability of a unit to be regular, and to be out in each direction.
    names : tuple of str
        Of the directions.
    size, size_std : array (units, directions)
        How far out a unit is, if it is.
    level, level_std : array (n,)
        The shrunk level of each record's unit and axis, and its standard error.
    dof : array (p,)
        Degrees of freedom of each fixed effect.

    """

    beta: Array
    cov: Array
    tau: float
    omega: float
    rho: float
    out: Array
    names: tuple[str, ...]
    size: Array
    size_std: Array
    level: Array
    level_std: Array
    dof: Array

    def interval(self, k: int, level: float = 0.95) -> tuple[float, float]:
        """Return the interval of a fixed effect, by Student's t."""
        half = stats.t.ppf(0.5 + level / 2, self.dof[k]) * np.sqrt(self.cov[k, k])
        return float(self.beta[k] - half), float(self.beta[k] + half)

    @property
    def p_out(self) -> Array:
        """Probability of each unit to be out, in whatever direction (units,)."""
        return 1 - self.out[:, 0]


class _Likelihood:
    """The restricted likelihood of a sample over (tau, omega, rho); what is not free is zero."""

    def __init__(self, data: Sample) -> None:
        self.data = data
        pairs = np.column_stack([data.unit, data.axis])
        _, group, count = np.unique(pairs, axis=0, return_inverse=True, return_counts=True)
        self.group = group.reshape(-1)
        self.free = (data.units > 1, len(count) > data.units, bool((count > 1).any()))
        self.directions = data.directions()
        self.D = np.column_stack(list(self.directions.values()))
        many = self.D.shape[1]
        share = np.array([1.0] if many == 1 else [WHOLE] + [(1 - WHOLE) / (many - 1)] * (many - 1))
        self.prior = np.append(1 - OUT, OUT * share)
        square = data.squares()
        self.curved = k = np.flatnonzero(np.isfinite(square[:, 0]))
        self.square = square[k].T[:, None, :, None]
        self.begin = _Sites(np.where(data.limit, data.y - 1, data.y)[k],
                            np.where(data.limit, 4.0, data.s**2)[k])
        self.sites = replace(self.begin)
        self.beyond = np.zeros((data.units, 1 + many))
        self.middle = _middle(data.y, data.X)

    def sds(self, x: Array) -> tuple[float, float, float]:
        """Return (tau, omega, rho) of the free parameters, logarithms."""
        values = iter(np.exp(np.clip(x, np.log(SMALL), np.log(LARGE))))
        tau, omega, rho = (float(next(values)) if f else 0.0 for f in self.free)
        return tau, omega, rho

    def at(self, x: Array) -> dict:
        """Return all that follows from the variances: beta, who is out, the likelihood."""
        tau, omega, rho = self.sds(x)
        y, s2 = self.data.y.copy(), self.data.s**2
        # from where most units are: from the mean, all would be out beside one that is far out
        before, out, beta = np.inf, np.tile(self.prior, (self.data.units, 1)), self.middle
        for k in range(40):
            y[self.curved], s2[self.curved] = self.sites.at, self.sites.var
            d = s2 + rho**2
            V = _Nested(self.data, self.group, d, tau, omega)
            found = {**self._given(V, y, out, beta), 'V': V, 'y': y}
            out, beta = found['out'], None
            if settled := abs(found['value'] - before) < 1e-5:
                break
            before = found['value']
            if len(self.curved):
                mean, var, weight = (x[:, self.curved] for x in self.ways(found, s2))
                self._propagate(mean, var, weight, 1.0 if k < 8 else 0.5)
        if not settled:     # the next one does not begin with what came of it
            self.sites, self.beyond = replace(self.begin), np.zeros_like(self.beyond)
        return {**found, 'd': d, 'sds': (tau, omega, rho), 'settled': settled}

    def ways(self, found: dict, d: Array) -> tuple[Array, Array, Array]:
        """
        Return mean and variance of y without the part d (n,) of its variance, and probability.

        For each way k of being out (ways, n): y - d V_k^-1 r and d - d^2 (V_k^-1)_ii.

        """
        unit, y, size = self.data.unit, found['y'], found['b'] / found['a']
        inner = found['V'].diagonal()
        means, variances = [y - d * found['Vr']], [d - d**2 * inner]
        for k, VD in enumerate(found['VD'].T):
            means.append(y - d * (found['Vr'] - VD * size[unit, k]))
            variances.append(d - d**2 * (inner - VD**2 / found['a'][unit, k]))
        return np.array(means), np.maximum(variances, 1e-12), found['out'][unit].T

    def _given(self, V: _Nested, y: Array, out: Array, beta: Array | None) -> dict:
        """Return beta (generalised least squares), who is out with it, and the likelihood."""
        X, prior = self.data.X, 1 / WIDE**2
        VX, Vy, VD = V.solve(X), V.solve(y), V.solve(self.D)
        a = np.column_stack([V.dot(x, v) for x, v in zip(self.D.T, VD.T)])
        e = np.stack([np.column_stack([V.dot(c, v) for c in X.T]) for v in VD.T])
        f = np.column_stack([V.dot(y, v) for v in VD.T])
        share = out[:, 1:] / (a + prior)        # a direction takes so much of V^-1 away
        A = X.T @ VX - np.einsum('uk,kui,kuj->ij', share, e, e)
        if beta is None:
            beta = np.linalg.solve(A, X.T @ Vy - np.einsum('uk,kui,uk->i', share, e, f))
        r, Vr = y - X @ beta, Vy - VX @ beta
        b = f - np.einsum('kui,i->uk', e, beta)
        whole, out = self._mixture(a, b)
        value = float(np.sum(whole - 0.5 * (V.dot(r, Vr) + V.logdet))
                      - 0.5 * np.linalg.slogdet(A)[1])
        return {'value': value, 'beta': beta, 'A': A, 'out': out, 'r': r, 'Vr': Vr, 'VD': VD,
                'a': a + prior, 'b': b}

    def _mixture(self, a: Array, b: Array) -> tuple[Array, Array]:
        """Return the log odds of a unit to a regular one, and the probability of each way."""
        prior = 1 / WIDE**2
        gain = 0.5 * b**2 / (a + prior) - 0.5 * np.log1p(a / prior)
        gain[a <= 0] = -np.inf          # no such direction in this unit
        odds = np.column_stack([np.zeros(len(a)), gain]) + np.log(self.prior) + self.beyond
        top = odds.max(axis=1)
        share = np.exp(odds - top[:, None])
        sums = share.sum(axis=1)
        return top + np.log(sums), share / sums[:, None]

    def _propagate(self, mean: Array, var: Array, weight: Array, step: float) -> None:
        """
        Move the pseudo-observations to where they do what the likelihoods do.

        From mean, variance and probability (ways, m) of all, for each way of being out; what a
        likelihood says of a way beyond what its pseudo-observation does goes to ``beyond``.

        """
        sites = self.sites
        cavity = 1 / np.maximum(1 / var - 1 / sites.var, 1 / VAGUE)
        where = cavity * (mean / var - sites.at / sites.var)
        for _ in range(2):          # the second time from where the first has ended
            whole, mean, var = self._tilted(mean, var, where, cavity)
        slope = (mean - where) / cavity
        # no further than REACH at a time: a likelihood that is nearly straight here is not there
        precision = np.maximum(1 / var - 1 / cavity, np.abs(slope) / REACH + 1 / VAGUE)
        pull = mean * precision + slope
        before = 1 / sites.var
        sites.var = 1 / (before + step * (np.sum(weight * precision, axis=0) - before))
        sites.at = sites.var * ((1 - step) * sites.at * before
                                + step * np.sum(weight * pull, axis=0))
        both = cavity + sites.var
        beyond = whole + 0.5 * np.log(both) + 0.5 * (where - sites.at) ** 2 / both
        self.beyond = np.column_stack([np.bincount(self.data.unit[self.curved], x, self.data.units)
                                       for x in beyond])

    def _tilted(self, mean: Array, var: Array, where: Array, cavity: Array) -> tuple:
        """Return (log of the whole, mean, variance) of likelihood times cavity (ways, m)."""
        v = mean[..., None] + np.sqrt(var)[..., None] * NODES
        log = (-0.5 * deviance(np.exp(2 * v), *self.square)
               - 0.5 * (v - where[..., None]) ** 2 / cavity[..., None] + 0.5 * NODES**2)
        top = log.max(axis=-1, keepdims=True)
        share = np.exp(log - top) * WEIGHTS
        sums = share.sum(axis=-1)
        whole = np.log(sums) + top[..., 0] + 0.5 * np.log(var / cavity / (2 * np.pi))
        mean = np.sum(share * v, axis=-1) / sums
        var = np.sum(share * (v - mean[..., None]) ** 2, axis=-1) / sums
        return whole, mean, np.maximum(var, 1e-12)


def _middle(y: Array, X: Array) -> Array:
    """Return the least absolute deviations fit, by reweighting (Schlossmacher 1973)."""
    beta = np.asarray(np.linalg.lstsq(X, y, rcond=None)[0], float)
    for _ in range(50):
        w = 1 / np.maximum(np.abs(y - X @ beta), 1e-3)
        beta = np.asarray(np.linalg.solve(X.T @ (w[:, None] * X), X.T @ (w * y)), float)
    return beta


def fit(data: Sample) -> Fit:
    """
    Return the population of a sample.

    Raises
    ------
    ValueError
        Fewer than three units show the value: there is no population to be had.

    """
    if len(np.unique(data.unit[~data.limit])) < LEAST:
        raise ValueError('no population: shown by too few units')
    some = _Likelihood(data)
    x = _variances(_Likelihood(_thinned(data)) if len(data.y) > MOST else some)
    if len(data.y) <= DENSE:    # of more, one cannot make the spread
        x = _unmasked(some, x)
    found = some.at(x)
    found = some.at(x)          # once more: the limits have settled
    tau, omega, rho = found['sds']
    cov = np.linalg.inv(found['A'])
    means, variances, weight = some.ways(found, found['d'])
    level = np.sum(weight * means, axis=0)
    level_var = np.sum(weight * (variances + (means - level) ** 2), axis=0)
    size = found['b'] / found['a']
    return Fit(found['beta'], cov, tau, omega, rho, found['out'], tuple(some.directions), size,
               found['a'] ** -0.5, level, np.sqrt(level_var), _dof(some, found, cov))


def _thinned(data: Sample) -> Sample:
    keep = np.arange(data.units) % int(np.ceil(len(data.y) / MOST)) == 0
    return data.part(keep[data.unit])


def _unmasked(some: _Likelihood, x: Array) -> Array:
    """Return the free logarithms, where no unit that is out hides in the spread that it makes."""
    for _ in range(some.data.units - LEAST + 1):
        found = some.at(x)
        narrow = found['a'] - 1 / WIDE**2
        far = np.where((narrow > 1e-9) & (found['out'][:, :1] > 0.5),
                       found['b']**2 / np.maximum(narrow, 1e-9), 0.0)
        u, k = np.unravel_index(int(np.argmax(far)), far.shape)
        level = MASKED / max(int(np.count_nonzero(narrow > 1e-9)), 1)
        if far[u, k] < _least(level, some.data.units - 1):
            return x
        own = some.D[:, k] * (some.data.unit == u)
        p, others = _beside(some.data, own, x)
        if p > level:
            return x
        there = _variances(some, others, 0.2)
        if some.at(there)['out'][u, 0] > 0.5:       # told at no other maximum either
            return x
        x = there
    return x


def _least(level: float, dof: int) -> float:
    """Return the square of the residual of which the deletion residual may be at a level."""
    t2 = stats.t.isf(level / 2, dof - 1) ** 2
    return float(dof * t2 / (dof - 1 + t2))


def _beside(data: Sample, own: Array, x: Array) -> tuple[float, Array]:
    """
    Return the chance of one direction (n,) beside all others, and the variances of the others.

    They are looked for from ``x``, where that direction is not left out.

    """
    X = np.column_stack([data.X, own])
    if np.linalg.matrix_rank(X) < X.shape[1]:
        return 1.0, np.zeros(0)
    some = _Likelihood(replace(data, X=X))
    x = _variances(some, x)
    found = some.at(x)
    cov = np.linalg.inv(found['A'])
    t = abs(found['beta'][-1]) / np.sqrt(cov[-1, -1])
    return float(2 * stats.t.sf(t, _dof(some, found, cov)[-1])), x


def _variances(some: _Likelihood, near: Array | None = None, step: float = 0.7) -> Array:
    """Return the free logarithms at the maximum ``near`` some, or from the best of few starts."""
    n = sum(some.free)
    if not n:
        return np.zeros(0)
    seen = some.data.y[~some.data.limit]
    spread = float(np.clip(1.48 * np.median(np.abs(seen - np.median(seen))), 3 * SMALL, 1.0))

    def wrong(x: Array) -> float:
        beyond = np.clip(np.log(SMALL) - x, 0, None) + np.clip(x - np.log(LARGE), 0, None)
        found = some.at(x)
        return 1e3 * float(np.sum(beyond)) - float(found['value']) + 1e6 * (not found['settled'])

    starts = [np.full(n, np.log(share * spread)) for share in (1.0, 0.3, 0.1)]
    start = min(starts, key=wrong) if near is None else near
    simplex = start + step * np.vstack([np.zeros(n), np.eye(n)])
    return np.asarray(optimize.minimize(wrong, start, method='Nelder-Mead', options={
        'xatol': 0.01, 'fatol': 1e-3, 'maxfev': 250, 'initial_simplex': simplex}).x)


def _dof(some: _Likelihood, found: dict, cov: Array) -> Array:
    """
    Return the degrees of freedom of each fixed effect.

    By Satterthwaite (1941) as for mixed models (Fai and Cornelius 1996): 2 var^2 over the variance
    of that variance, which follows from the expected information of the variances.

    """
    data, n = some.data, len(some.data.y)
    plain = float(max(data.units - np.linalg.matrix_rank(data.X), 1))
    tau, omega, _ = found['sds']
    if n > DENSE:
        return np.full(len(cov), plain)
    same_unit = data.unit[:, None] == data.unit[None, :]
    same_axis = some.group[:, None] == some.group[None, :]
    V = np.diag(found['d']) + omega**2 * same_axis + tau**2 * same_unit
    worst = np.argmax(found['out'], axis=1)
    for u in np.flatnonzero(worst):
        d = some.D[:, worst[u] - 1] * (data.unit == u)
        V += WIDE**2 * np.outer(d, d)
    W = np.linalg.inv(V)
    WX = W @ data.X
    P = W - WX @ cov @ WX.T
    parts = [part.astype(float) for part, free in zip(
        (same_unit, same_axis, np.eye(n)), some.free) if free]
    if not parts:
        return np.full(len(cov), plain)
    PV = [P @ part for part in parts]
    information = 0.5 * np.array([[np.sum(p * q.T) for q in PV] for p in PV])
    slopes = np.array([np.diag(cov @ (WX.T @ part @ WX) @ cov) for part in parts])
    spread = np.einsum('jk,ji,ik->k', slopes, np.linalg.pinv(information), slopes)
    return np.clip(2 * np.diag(cov) ** 2 / np.maximum(spread, 1e-300), 1.0, 1e6)


def called(p: Array, level: float = FALSE) -> NDArray[np.bool_]:
    """
    Return which are called, so that the expected share of false ones is at most ``level``.

    From the probabilities of being true: the longest list whose mean of 1 - p is within it (Newton
    et al. 2004).

    """
    p = np.asarray(p, float)
    order = np.argsort(-p, kind='stable')
    false = np.cumsum(1 - p[order]) / np.arange(1, len(p) + 1)
    many = int(np.max(np.flatnonzero(false <= level), initial=-1)) + 1
    out = np.zeros(len(p), bool)
    out[order[:many]] = True
    return out


def upper(found: Fit, axes: Sequence[int], share: float = 0.95) -> float:
    """
    Return the log of what the worst axis of a new, regular unit does not exceed in ``share``.

    A prediction bound: the quantile of max over the axes of mean + u + a, the standard deviations
    widened by Student's t for what the fleet leaves open of them.

    Parameters
    ----------
    found : Fit
        The population.
    axes : sequence of int
        The columns of X that are the means of the axes.
    share : float
        Of the units.

    """
    mean = found.beta[list(axes)]
    own = float(np.mean(np.diag(found.cov)[list(axes)]))
    dof = float(np.min(found.dof[list(axes)]))
    wider = stats.t.ppf(share, dof) / stats.norm.ppf(share)
    tau, omega = np.sqrt(found.tau**2 + own) * wider, max(found.omega * wider, 1e-9)
    nodes, weights = np.polynomial.hermite_e.hermegauss(80)
    weights = weights / weights.sum()

    def short(x: float) -> float:
        inside = special.ndtr((x - mean[None, :] - tau * nodes[:, None]) / omega)
        return float(weights @ np.prod(inside, axis=1)) - share

    reach = 12 * (tau + omega) + 1e-6
    return float(optimize.brentq(short, np.min(mean) - reach, np.max(mean) + reach))
