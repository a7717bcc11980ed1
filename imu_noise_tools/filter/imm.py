# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A bank of linear models, run side by side and mixed.

The interacting-multiple-model filter (Blom, Bar-Shalom 1988).

One model is a bank of one; a model with steps of the rate is a bank of two whose modes are drawn
anew each sample. All modes share one state vector. The bank runs over *lanes*: the three axes
online, chunks times axes for a recorded bag. States and covariances are kept component by
component as arrays (modes, lanes) with structural zeros left out: for two states that is several
times faster than stacked matrices, online as in bulk.

"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.special import ndtr, ndtri

from .kalman import LOG_2PI
from .modes import Modes


class Coefficients:
    """
    The entries of a bank's matrices over each of several intervals.

    None where zero everywhere, 1.0 where one.

    """

    def __init__(self, choices: list[Modes], alpha: float = 1.0):
        first = choices[0].spaces[0][0]
        self.axes, self.modes = len(choices[0].spaces), len(choices[0].prior)
        self.size, self.alpha = first.size, alpha
        self.prior = np.array([c.prior for c in choices])
        self.stay = np.array([c.stay for c in choices])
        self.h, self.rate = first.h, first.rate
        self.p0 = _stack(choices[:1], lambda s: s.p0)[0]
        d = range(self.size)
        phi, q = _stack(choices, lambda s: s.phi), _stack(choices, lambda s: s.q)
        self.phi = {(i, j): 1.0 if np.all(phi[..., i, j] == 1.0) else phi[..., i, j]
                    for i in d for j in d if i == j or np.any(phi[..., i, j])}
        self.q = {(i, j): q[..., i, j] for i in d for j in d[i:] if np.any(q[..., i, j])}
        self.r = _stack(choices, lambda s: s.r)
        mixture = [axis[0].outliers for axis in choices[0].spaces]
        self.outliers = np.array(mixture).T if all(mixture) else None
        self.slope = self._slopes(choices)
        self.grows = self._growing(choices)

    @staticmethod
    def _slopes(choices):
        """
        Return what of the state, (d,) of (choices, modes, axes), makes a sample off by jitter.

        The change of the rate over the interval, jitter/dt of it; None where there is no jitter
        over any of them (over no time there never is).

        """
        if not any(axis[0].jitter for c in choices for axis in c.spaces):
            return None
        change = _stack(
            choices, lambda s: (s.rate @ s.phi - s.rate) * (s.jitter / s.dt if s.dt else 0.0))
        return np.moveaxis(change, -1, 0)

    @staticmethod
    def _growing(choices):
        """Return what the acceleration's square adds to Q, {(i, k): (choices, modes, axes)}."""
        spaces = [s for c in choices for axis in c.spaces for s in axis]
        if all(s.grows is None for s in spaces):
            return None
        none = np.zeros((2, 2))
        each = _stack(choices, lambda s: none if s.grows is None else s.grows)
        return {(i, k): each[..., i, k] for i in range(2) for k in range(i, 2)}

    def at(self, which: Any) -> Entries:
        """
        Return the entries for lanes, chunk after chunk with all axes each.

        ``which`` (chunks,) names the interval.

        One whole number: the same interval for every chunk; entries (modes, axes) then.

        """
        if np.ndim(which) == 0:
            def lanes(a):
                return a[which]
            prior, stay = self.prior[which][:, None], float(self.stay[which])
        else:
            def lanes(a):
                return a[which].swapaxes(0, 1).reshape(self.modes, -1)
            prior = np.repeat(self.prior[which], self.axes, 0).T
            stay = np.repeat(self.stay[which], self.axes)
        return Entries.of(self, lanes, prior, stay)


def _stack(choices, entry):
    """Return what ``entry`` gives of every model, (...): (choices, modes, axes, ...)."""
    return np.array(
        [[[entry(s) for s in axis] for axis in c.spaces] for c in choices]).swapaxes(1, 2)


@dataclass(frozen=True)
class Entries:
    """What one step of a bank needs; arrays (modes, lanes) or what broadcasts to it."""

    phi: dict
    q: dict
    r: np.ndarray
    prior: np.ndarray
    stay: float | np.ndarray
    slope: list | None = None
    grows: dict | None = None

    @classmethod
    def of(cls, some: Coefficients | Entries, lanes: Callable[[np.ndarray], np.ndarray],
           prior: np.ndarray, stay: float | np.ndarray) -> Entries:
        """Return what some hold, ``lanes`` of each array; the number one stays what it is."""
        return cls({k: v if isinstance(v, float) else lanes(v) for k, v in some.phi.items()},
                   {k: lanes(v) for k, v in some.q.items()}, lanes(some.r), prior, stay,
                   None if some.slope is None else [lanes(v) for v in some.slope],
                   None if some.grows is None else {k: lanes(v) for k, v in some.grows.items()})

    @cached_property
    def fresh(self) -> np.ndarray:
        """What of each mode's probability comes from a change of mode; as ``prior``."""
        return self.prior * (1 - self.stay)

    def tiled(self, chunks: int) -> Entries:
        """Return entries (modes, axes) repeated for every chunk."""
        return Entries.of(self, lambda a: np.tile(a, (1, chunks)), self.prior, self.stay)


class Bank:
    """
    A bank at one moment: probabilities, states and covariances.

    ``mu`` (modes, lanes), ``x`` (d, modes, lanes), ``cov`` (pairs, modes, lanes): the entries i <=
    k of the covariances, row after row. Each step writes into the same arrays, what it returns of
    each mode included: a few calls of numpy for all states at once, and no room to be made.

    Parameters
    ----------
    table : Coefficients
        Of the modes.
    lanes : int
        How many, a multiple of the table's axes.
    prior : ndarray (modes, lanes) or None
        Probabilities to start with, where they differ from lane to lane.

    """

    def __init__(self, table: Coefficients, lanes: int, prior: np.ndarray | None = None):
        self.table, self.lanes = table, lanes
        d, shape = range(table.size), (table.modes, lanes)
        self.pairs = [(i, j) for i in d for j in d if i <= j]
        self.place = {pair: n for n, (i, j) in enumerate(self.pairs) for pair in ((i, j), (j, i))}
        self.row = [slice(self.place[i, i], self.place[i, table.size - 1] + 1) for i in d]
        self.rows = {i: [k for k in d if (i, k) in table.phi] for i in d}
        # what of Phi P the upper half of Phi P Phi^T takes
        self.halves = [(i, m) for i in d for m in sorted({m for j in d[i:] for m in self.rows[j]})]
        self.seen = [(i, float(table.h[i])) for i in d if table.h[i]]
        self.moving = [(i, float(table.rate[i])) for i in d if table.rate[i]]
        repeat = lanes // table.axes
        self.mixture = None if table.outliers is None else np.tile(table.outliers, repeat)
        self.start = np.stack([np.tile(table.p0[:, :, i, k], repeat) for i, k in self.pairs])
        self.first = np.tile(table.prior[0][:, None], lanes) if prior is None else prior
        self.good: Any = 1.0            # probability that the last sample was no outlier
        self.jitter = np.zeros(shape)   # variance that uneven sampling adds to the next sample
        self.mu, self.prior, self._own, self._common, self._s, self._nu = np.empty((6, *shape))
        self.x, self._x, self._off = np.empty((3, table.size, *shape))
        self.cov, self._cov, self._work = np.empty((3, len(self.pairs), *shape))
        self._half = np.empty((table.size, table.size, *shape))
        self.restart(slice(None))

    @property
    def p(self) -> dict:
        """The covariances entry by entry, {(i, k)} with i <= k: views."""
        return dict(zip(self.pairs, self.cov))

    def load(self, mu: np.ndarray, x: Any, cov: Any) -> None:
        """Take over probabilities, states [d] and covariances [pairs], each (modes, lanes)."""
        self.mu[:] = mu
        for mine, one in ((self.x, x), (self.cov, cov)):
            for into, value in zip(mine, one):
                into[:] = value

    def restart(self, lanes: np.ndarray | slice) -> None:
        """Forget everything in some lanes: mask (lanes,) or index (k,)."""
        self.mu[:, lanes] = self.prior[:, lanes] = self.first[:, lanes]
        self.jitter[:, lanes] = 0.0
        self.x[..., lanes] = 0.0
        self.cov[..., lanes] = self.start[..., lanes]

    def mix(self, e: Entries) -> None:
        """
        Let the modes interact.

        Each starts from what all of them say, weighed by how it may have come about. With ``own``
        the weight of the mode itself, and ``off`` how far it is from the mean of all,
        x = mean + own off, P = own P + (1 - own) (E[P + off off'] + own off off').

        """
        if self.table.modes == 1:
            return
        mu, x, cov, work, other, off = (
            self.mu, self.x, self.cov, self._work, self._cov, self._off)
        own, common = self._own, self._common
        np.multiply(e.stay, mu, out=own)
        np.add(own, e.fresh, out=self.prior)
        np.divide(own, self.prior, out=own)
        np.subtract(1.0, own, out=common)
        mean = np.einsum('ml,iml->il', mu, x)[:, None]
        np.subtract(x, mean, out=off)
        for i, row in enumerate(self.row):
            np.multiply(off[i], off[i:], out=other[row])
        np.add(cov, other, out=work)
        np.multiply(own, other, out=other)
        np.add(other, np.einsum('ml,iml->il', mu, work)[:, None], out=other)
        np.multiply(common, other, out=other)
        np.multiply(own, cov, out=cov)
        np.add(cov, other, out=cov)
        np.multiply(own, off, out=off)
        np.add(mean, off, out=x)

    def predict(self, e: Entries) -> None:
        """Carry every mode over the interval: P^- = Phi P Phi^T/alpha + Q."""
        phi, x, cov, place, half = e.phi, self.x, self.cov, self.place, self._half
        new_x, new, spare = self._x, self._cov, self._s
        if e.slope is not None:
            mean = added(a * v for a, v in zip(e.slope, x))
            self.jitter = mean ** 2 + added(e.slope[i] * e.slope[j] * cov[place[i, j]]
                                            for i in self.rows for j in self.rows)
        square = None if e.grows is None else x[1] ** 2 + cov[place[1, 1]]
        for i, row in self.rows.items():
            _combine([(phi[i, k], x[k]) for k in row], new_x[i], spare)
        parts = {(i, m): _combined([(phi[i, k], cov[place[k, m]]) for k in self.rows[i]],
                                   half[i, m], spare) for i, m in self.halves}
        for n, (i, j) in enumerate(self.pairs):
            v = _combined([(phi[j, m], parts[i, m]) for m in self.rows[j]], new[n], spare)
            if self.table.alpha != 1.0:
                v = np.divide(v, self.table.alpha, out=new[n])
            if (i, j) in e.q:
                np.add(v, e.q[i, j], out=new[n])
            elif v is not new[n]:
                new[n] = v
        for pair, grows in (e.grows or {}).items():
            new[place[pair]] += grows * square
        self.x, self._x, self.cov, self._cov = new_x, x, new, cov

    def noise(self, e: Entries) -> np.ndarray:
        """Return the variance of the next sample's noise, (modes, lanes) or what broadcasts."""
        return e.r if e.slope is None else e.r + self.jitter

    def noise_seen(self, e: Entries) -> np.ndarray:
        """Return the variance (modes, lanes) that the last sample's noise had by its weight."""
        if self.mixture is None:
            return self.noise(e)
        return self.noise(e) / (self.good + (1 - self.good) / self.mixture[1])

    def update(self, z: np.ndarray, e: Entries) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """
        Weigh the samples z (lanes,) in.

        Return (innovation, S, log-likelihood) of each mode, prior weights included.

        """
        x, cov, work, r = self.x, self.cov, self._work, self.noise(e)
        nu, s, power = self._nu, self._s, self._own
        ph = self._half[0]
        if self.seen == [(0, 1.0)]:
            ph = cov[self.row[0]]
        else:
            for i in self.rows:
                _combine([(w, cov[self.place[i, k]]) for k, w in self.seen], ph[i], s)
        np.subtract(z, _combined([(w, x[i]) for i, w in self.seen], nu, s), out=nu)
        np.add(_combined([(w, ph[i]) for i, w in self.seen], s, self._common), r, out=s)
        if self.mixture is None:
            shrink = np.divide(1.0, s, out=self._common)
            gain = np.multiply(nu, shrink, out=work[0])
            np.multiply(nu, gain, out=power)
            power *= -0.5
            factor = np.sqrt(shrink)
        else:
            gain, shrink, power, factor = self._robust(nu, s, r)
        x += np.multiply(gain, ph, out=self._off)
        scaled = np.multiply(shrink, ph, out=self._off)
        for i, row in enumerate(self.row):
            np.multiply(scaled[i], ph[i:], out=work[row])
        cov -= work
        return nu, s, self._weigh(power, factor)

    def _weigh(self, power, factor):
        """
        Give the modes their probabilities; return the log-likelihood of all, (lanes,).

        That of each is ``factor`` exp(``power``): a root is had for less than a logarithm.

        """
        if self.table.modes == 1:
            return power[0] + np.log(factor[0])
        top = power.max(0)
        weight = np.subtract(power, top, out=self.mu)
        np.exp(weight, out=weight)
        weight *= factor
        weight *= self.prior
        total = weight.sum(0)
        weight /= total
        return top + np.log(total)

    def _robust(self, nu, s, r):
        """
        Weigh a sample as good or as an outlier (Sorenson, Alspach 1971).

        Two moments are kept of what both say.

        Return (K nu over P H, what shrinks the covariance, power and factor of the likelihood): P
        - Ph Ph^T shrink.

        """
        assert self.mixture is not None
        fraction, factor = self.mixture
        wide = s + r * (factor - 1)
        a, b = nu / s, nu / wide
        power = -0.5 * nu * b           # of an outlier, which is the larger one
        good = (1 - fraction) / np.sqrt(s) * np.exp(-0.5 * nu * a - power)
        both = good + fraction / np.sqrt(wide)
        w = self.good = good / both
        gain = w * a + (1 - w) * b
        return gain, w / s + (1 - w) / wide - w * (1 - w) * (a - b) ** 2, power, both

    def rate(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the rate and its variance, over all modes, (lanes,) each."""
        x = added(times(w, self.x[i]) for i, w in self.moving)
        var = added(times(w * v, self.cov[self.place[i, j]])
                    for i, w in self.moving for j, v in self.moving)
        if self.table.modes == 1:
            return x[0].copy(), var[0].copy()
        mean = (self.mu * x).sum(0)
        return mean, (self.mu * (var + (x - mean) ** 2)).sum(0)

    def step(self, z: np.ndarray, e: Entries | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """
        Mix, predict and update with samples z (lanes,).

        ``e`` None: the first sample, nothing to predict.

        """
        if e is not None:
            self.mix(e)
            self.predict(e)
        return self.update(z, self.table.at(0) if e is None else e)

    def score(self, nu: np.ndarray, s: np.ndarray, e: Entries) -> np.ndarray:
        """
        Return the normalised innovation, (lanes,), of a mixture its transform.

        Standard normal if the model is right.

        """
        if self.table.modes == 1 and self.mixture is None:
            return (nu / np.sqrt(s))[0]
        return self.transform(nu, s, e)

    def transform(self, nu: np.ndarray, s: np.ndarray, e: Entries) -> np.ndarray:
        """
        Return the standard normal value at the sample's place in its predicted distribution.

        (lanes,).

        The probability integral transform of the mixture (Rosenblatt 1952).

        """
        parts = [(self.prior, nu / np.sqrt(s))]
        if self.mixture is not None:
            fraction, factor = self.mixture
            parts = [(self.prior * (1 - fraction), parts[0][1]),
                     (self.prior * fraction, nu / np.sqrt(s + self.noise(e) * (factor - 1)))]
        below: Any = 0.0
        above: Any = 0.0
        for w, a in parts:      # either tail by itself: a small one keeps its digits
            tail = ndtr(-np.abs(a))
            near, low = 1 - tail, a < 0
            below = below + (w * np.where(low, tail, near)).sum(0)
            above = above + (w * np.where(low, near, tail)).sum(0)
        value = ndtri(np.maximum(np.minimum(below, above), 1e-300))
        return np.where(below < above, value, -value)


def times(factor: Any, a: Any) -> Any:
    """Return a product, the array itself where the factor is the number one."""
    return a if isinstance(factor, float) and factor == 1.0 else factor * a


def _combined(terms, out, spare):
    """Return the sum of (factor, array): in ``out``, or the array itself if it is but that."""
    total = None
    for factor, a in terms:
        if not isinstance(factor, float) or factor != 1.0:
            a = np.multiply(factor, a, out=out if total is None else spare)
        total = a if total is None else np.add(total, a, out=out)
    return total


def _combine(terms, out, spare):
    """Write the sum of (factor, array) into ``out``."""
    total = _combined(terms, out, spare)
    if total is not out:
        out[:] = total


def added(terms: Iterable[Any]) -> Any:
    """Return the sum of arrays, not begun from zero: it costs another array; 0 of none."""
    out = None
    for t in terms:
        out = t if out is None else out + t
    return 0.0 if out is None else out


def log_density(log_l: np.ndarray) -> np.ndarray:
    """Return log-likelihoods of :meth:`Bank.step`, nats, of their shape, its constant put in."""
    return log_l - 0.5 * LOG_2PI
