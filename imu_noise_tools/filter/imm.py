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

from dataclasses import dataclass
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
        self.axes, self.modes, self.size, self.alpha = (
            len(choices[0].spaces),
            len(choices[0].prior),
            first.size,
            alpha,
        )
        self.prior = np.array([c.prior for c in choices])
        self.stay = np.array([c.stay for c in choices])
        self.h, self.rate = first.h, first.rate
        self.p0 = self._stack([choices[0]], 'p0')[0]
        d = range(self.size)
        phi, q = self._stack(choices, 'phi'), self._stack(choices, 'q')
        self.phi = {
            (i, j): phi[..., i, j] for i in d for j in d if i == j or np.any(phi[..., i, j])
        }
        self.q = {
            (i, j): q[..., i, j] for i in d for j in range(i, self.size) if np.any(q[..., i, j])
        }
        self.r = np.array([[[s.r for s in axis] for axis in c.spaces] for c in choices]).swapaxes(
            1, 2
        )
        mixture = [axis[0].outliers for axis in choices[0].spaces]
        self.outliers = np.array(mixture).T if all(mixture) else None
        self.slope = self._slopes(choices)

    @staticmethod
    def _stack(choices, name):
        """Return (choices, modes, axes, d, d)."""
        return np.array(
            [[[getattr(s, name) for s in axis] for axis in c.spaces] for c in choices]
        ).swapaxes(1, 2)

    def _slopes(self, choices):
        """
        Return what of the state, (d,) of (choices, modes, axes), makes a sample off by jitter.

        The change of the rate over the interval, jitter/dt of it; None where there is no jitter.

        """
        if not any(axis[0].jitter for axis in choices[0].spaces):
            return None
        change = np.array([[[(s.rate @ s.phi - s.rate) * (s.jitter / s.dt if s.dt else 0.0)
                             for s in axis] for axis in c.spaces] for c in choices])
        return np.moveaxis(change.swapaxes(1, 2), -1, 0)

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
        return Entries({k: 1.0 if np.all(v == 1.0) else lanes(v) for k, v in self.phi.items()},
                       {k: lanes(v) for k, v in self.q.items()}, lanes(self.r), prior, stay,
                       None if self.slope is None else [lanes(v) for v in self.slope])


@dataclass(frozen=True)
class Entries:
    """What one step of a bank needs; arrays (modes, lanes) or what broadcasts to it."""

    phi: dict
    q: dict
    r: np.ndarray
    prior: np.ndarray
    stay: float | np.ndarray
    slope: list | None = None

    def tiled(self, chunks: int) -> Entries:
        """Return entries (modes, axes) repeated for every chunk."""
        def lanes(a):
            return a if isinstance(a, float) else np.tile(a, (1, chunks))
        return Entries(
            {k: lanes(v) for k, v in self.phi.items()},
            {k: lanes(v) for k, v in self.q.items()},
            lanes(self.r),
            self.prior,
            self.stay,
            None if self.slope is None else [lanes(v) for v in self.slope],
        )


class Bank:
    """
    A bank at one moment: probabilities, states and covariances.

    Component by component, (modes, lanes) each.

    """

    def __init__(self, table: Coefficients, lanes: int):
        self.table, self.lanes = table, lanes
        d = range(table.size)
        self.pairs = [(i, j) for i in d for j in d if i <= j]
        self.seen = [(i, float(table.h[i])) for i in d if table.h[i]]
        self.moving = [(i, float(table.rate[i])) for i in d if table.rate[i]]
        self.rows = {i: [k for k in d if (i, k) in table.phi] for i in d}
        repeat = lanes // table.axes
        self.mixture = None if table.outliers is None else np.tile(table.outliers, repeat)
        self.start = {k: np.tile(table.p0[:, :, k[0], k[1]], repeat) for k in self.pairs}
        shape = (table.modes, lanes)
        self.mu = np.tile(table.prior[0][:, None], lanes)
        self.jitter = np.zeros(shape)   # variance that uneven sampling adds to the next sample
        self.x = [np.zeros(shape) for _ in d]
        self.p = {k: v.copy() for k, v in self.start.items()}

    def restart(self, lanes: np.ndarray | slice) -> None:
        """Forget everything in some lanes (mask or index)."""
        self.mu[:, lanes] = self.table.prior[0][:, None]
        self.jitter[:, lanes] = 0.0
        for x in self.x:
            x[:, lanes] = 0.0
        for k, p in self.p.items():
            p[:, lanes] = self.start[k][:, lanes]

    def mix(self, e: Entries) -> None:
        """
        Let the modes interact.

        Each starts from what all of them say, weighed by how it may have come about.

        """
        if self.table.modes == 1:
            return
        mu, x, p = self.mu, self.x, self.p
        prior = e.prior * (1 - e.stay)
        kept = e.stay * mu
        self.mu = c = prior + kept
        own, common = kept / c, prior / c
        mean = [(mu * v).sum(0) for v in x]
        off = [v - m for v, m in zip(x, mean)]
        shift = [own * v for v in off]
        self.p = {(i, j): common * (mu * b).sum(0) + own * b - shift[i] * shift[j]
                  for (i, j), b in (((i, j), p[i, j] + off[i] * off[j]) for i, j in self.pairs)}
        self.x = [m + s for m, s in zip(mean, shift)]

    def predict(self, e: Entries) -> None:
        """Carry every mode over the interval: P^- = Phi P Phi^T/alpha + Q."""
        phi, p, alpha = e.phi, self.p, self.table.alpha
        if e.slope is not None:
            mean = _sum(a * x for a, x in zip(e.slope, self.x))
            self.jitter = mean ** 2 + _sum(e.slope[i] * e.slope[j] * p[min(i, j), max(i, j)]
                                           for i in self.rows for j in self.rows)

        def times(f, a):
            return a if isinstance(f, float) else f * a

        self.x = [_sum(times(phi[i, k], self.x[k]) for k in self.rows[i]) for i in self.rows]
        half = {(i, m): _sum(times(phi[i, k], p[min(k, m), max(k, m)]) for k in self.rows[i])
                for i in self.rows for m in self.rows}
        new = {}
        for i, j in self.pairs:
            v = _sum(times(phi[j, m], half[i, m]) for m in self.rows[j])
            if alpha != 1.0:
                v = v / alpha
            new[i, j] = v + e.q[i, j] if (i, j) in e.q else v
        self.p = new

    def noise(self, e: Entries) -> np.ndarray:
        """Return the variance of the next sample's noise, (modes, lanes) or what broadcasts."""
        return e.r if e.slope is None else e.r + self.jitter

    def update(self, z: np.ndarray, e: Entries) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """
        Weigh the samples z (lanes,) in.

        Return (innovation, S, log-likelihood) of each mode, prior weights included.

        """
        p, r = self.p, self.noise(e)
        ph = [_sum(w * p[min(i, k), max(i, k)] for k, w in self.seen) for i in self.rows]
        spread = _sum(w * ph[i] for i, w in self.seen)
        s = spread + r
        nu = z - _sum(w * self.x[i] for i, w in self.seen)
        if self.mixture is None:
            scaled = nu / s
            log_l = -0.5 * (nu * scaled + np.log(s))
            gain, shrink = scaled, 1 / s
        else:
            gain, shrink, log_l = self._robust(nu, s, r)
        self.x = [x + v * gain for x, v in zip(self.x, ph)]
        self.p = {(i, j): p[i, j] - ph[i] * ph[j] * shrink for i, j in self.pairs}
        if self.table.modes > 1:
            top = log_l.max(0)
            weight = self.mu * np.exp(log_l - top)
            total = weight.sum(0)
            self.mu = weight / total
            log_l = top + np.log(total)
        else:
            log_l = log_l[0]
        return nu, s, log_l

    def _robust(self, nu, s, r):
        """
        Weigh a sample as good or as an outlier (Sorenson, Alspach 1971).

        Two moments are kept of what both say.

        Return (K nu over P H, what shrinks the covariance, log-likelihood): P - Ph Ph^T shrink.

        """
        assert self.mixture is not None
        fraction, factor = self.mixture
        wide = s + r * (factor - 1)
        a, b = nu / s, nu / wide
        log_good = np.log1p(-fraction) - 0.5 * (nu * a + np.log(s))
        log_bad = np.log(fraction) - 0.5 * (nu * b + np.log(wide))
        top = np.maximum(log_good, log_bad)
        good, bad = np.exp(log_good - top), np.exp(log_bad - top)
        w = good / (good + bad)
        gain = w * a + (1 - w) * b
        return gain, w / s + (1 - w) / wide - w * (1 - w) * (a - b) ** 2, top + np.log(good + bad)

    def rate(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the rate and its variance, over all modes, (lanes,) each."""
        x = _sum(w * self.x[i] for i, w in self.moving)
        var = _sum(
            w * v * self.p[min(i, j), max(i, j)] for i, w in self.moving for j, v in self.moving
        )
        if self.table.modes == 1:
            return x[0], var[0]
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
        self.prior = self.mu
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
        below = sum((w * ndtr(a)).sum(0) for w, a in parts)
        above = sum((w * ndtr(-a)).sum(0) for w, a in parts)
        return np.where(
            below < above, ndtri(np.maximum(below, 1e-300)), -ndtri(np.maximum(above, 1e-300))
        )


def _sum(terms):
    """Add arrays without starting from zero."""
    total = None
    for t in terms:
        total = t if total is None else total + t
    return total


def log_density(log_l: np.ndarray) -> np.ndarray:
    """Return log-likelihoods of :meth:`Bank.step` with the constant that it leaves out."""
    return log_l - 0.5 * LOG_2PI
