# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A record through the bank and back: what a rate was, by the samples before and after it.

The two-filter form of the interacting-multiple-model smoother (Helmick, Blair, Hoffman 1995).
Forward runs the bank. Backward runs, for each mode, what the samples after a moment say of the
state then: a likelihood K exp(h (x - c) - (x - c)' J (x - c)/2), which needs no prior and starts
from nothing (J = 0). Where one mode may go on as several, each pair of modes is weighed by how
well the two sides agree on the state, and the likelihoods are brought to one of the same first two
moments under what the forward pass knows. A bank of one is the smoother of Fraser and Potter 1969.

"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .design import Design
from .imm import added, Bank, Entries, times
from .lanes import Lanes, Layout
from .stamps import Clock

BLOCK = 512             # samples that are kept at a time on the way back
TINY = 1e-200           # a variance below which there is none
ROUNDING = 1e-12        # share of a variance below which a pivot is rounding
SPOKEN = 1.0            # times its probability by itself from which a change of mode is heeded


@dataclass(frozen=True)
class Kept:
    """
    A bank at one moment, as the way back needs it; arrays (modes, lanes).

    Probabilities, states, covariances; the samples, the entries of the interval before them, and
    the lanes that know nothing before it (None: all do).

    """

    mu: np.ndarray
    x: list
    p: dict
    z: np.ndarray
    e: Entries
    begins: np.ndarray | None

    def mean(self) -> list:
        """Return the mean state over the modes, [d] of (lanes,)."""
        return [(self.mu * v).sum(0) for v in self.x]


@dataclass
class Likelihood:
    """
    What samples say of a state: log K + h (x - c) - (x - c)' J (x - c)/2, element by element.

    ``j`` {(i, k)}, i <= k, and ``h`` [d] hold arrays that broadcast, ``log_k`` one.

    """

    j: dict
    h: list
    log_k: Any

    @classmethod
    def nothing(cls, size: int, shape: tuple) -> Likelihood:
        """Return that of no samples."""
        return cls({(i, k): np.zeros(shape) for i in range(size) for k in range(i, size)},
                   [np.zeros(shape) for _ in range(size)], np.zeros(shape))

    def forgotten(self, lanes: np.ndarray) -> Likelihood:
        """Return that of no samples in some lanes, mask (lanes,)."""
        return Likelihood({k: np.where(lanes, 0.0, v) for k, v in self.j.items()},
                          [np.where(lanes, 0.0, v) for v in self.h],
                          np.where(lanes, 0.0, self.log_k))

    def times(self, v: Any) -> list:
        """Return J v, [d]; a component of v that is None is zero."""
        d = range(len(self.h))
        return [added(self.j[min(i, k), max(i, k)] * v[k] for k in d if v[k] is not None)
                for i in d]

    def shifted(self, by: list) -> Likelihood:
        """Return the same about c + by."""
        turned = self.times(by)
        log_k = self.log_k + added((h - 0.5 * t) * b for h, t, b in zip(self.h, turned, by))
        return Likelihood(self.j, [h - t for h, t in zip(self.h, turned)], log_k)

    def blurred(self, parts: list) -> Likelihood:
        """
        Return what it says of y where x = y + w, w normal about 0 with covariance sum s v v'.

        ``parts`` are the (s, v) of :func:`factors`.

        """
        j, h, det, more = self.j, self.h, 1.0, 0.0
        for s, v in parts:
            jv = Likelihood(j, h, 0.0).times(v)
            share = 1 + s * added(a * b for a, b in zip(jv, v) if b is not None)
            vh = added(a * b for a, b in zip(h, v) if b is not None)
            weight = s / share
            pull = weight * vh
            h = [a - b * pull for a, b in zip(h, jv)]
            j = {(i, k): a - weight * jv[i] * jv[k] for (i, k), a in j.items()}
            det, more = det * share, more + pull * vh
        return Likelihood(j, h, self.log_k + 0.5 * (more - np.log(det)))


def factors(p: dict, size: int) -> list:
    """
    Return (s, v) of covariances P = sum s v v', {(i, k)} with i <= k.

    By L D L^T; what is not in P, and a component of v that is None, is zero everywhere.

    """
    p = dict(p)
    out = []
    for i in range(size):
        if (i, i) not in p:
            continue
        s = np.where(p[i, i] > TINY, p[i, i], 0.0)
        v: list = [None] * size
        v[i] = 1.0
        below = [k for k in range(i + 1, size) if (i, k) in p]
        if below:
            inverse = _inverse(s)
        for k in below:
            v[k] = p[i, k] * inverse
        for n, k in enumerate(below):
            for m in below[n:]:
                p[k, m] = p.get((k, m), 0.0) - p[i, k] * v[m]
                if k == m:
                    p[k, m] = np.where(p[k, m] > ROUNDING * p[i, k] * v[m], p[k, m], 0.0)
        out.append((s, v))
    return out


def _inverse(s: np.ndarray) -> np.ndarray:
    """Return 1/s, 0 where s is."""
    return np.divide(1.0, s, out=np.zeros_like(s), where=s > 0)


def backward(bank: Bank, earlier: Kept, later: Kept, after: Likelihood) -> tuple:
    """
    Return (likelihood, rate, variance) of a moment from what is said after the next one.

    ``after`` is about the mean of ``later``.

    """
    said = _carried(bank, later.e, _weighed(bank, later, after), earlier.mean(), later.mean())
    if later.begins is not None:
        said = said.forgotten(later.begins)
    return _met(bank, earlier, said, later.e)


def _weighed(bank: Bank, later: Kept, said: Likelihood) -> Likelihood:
    """Return a likelihood about the mean of a moment with that moment's samples in it."""
    centre, r = later.mean(), later.e.r
    off = later.z - added(w * centre[i] for i, w in bank.seen)
    precision = 1 / r
    j, h = dict(said.j), list(said.h)
    for n, (i, a) in enumerate(bank.seen):
        h[i] = h[i] + a * off * precision
        for k, b in bank.seen[n:]:
            j[i, k] = j[i, k] + a * b * precision
    return Likelihood(j, h, said.log_k - 0.5 * (off * off * precision + np.log(r)))


def _carried(bank: Bank, e: Entries, said: Likelihood, centre: list, old: list) -> Likelihood:
    """Return for each mode what a likelihood says of the state an interval before, about c."""
    d = range(bank.table.size)
    phi = e.phi
    to = [added(times(phi[i, k], centre[k]) for k in bank.rows[i]) - old[i] for i in d]
    said = said.shifted(to).blurred(factors(e.q, bank.table.size))
    columns = {k: [i for i in d if (i, k) in phi] for k in d}
    half = [[added(times(phi[m, k], said.j[min(i, m), max(i, m)]) for m in columns[k])
             if columns[k] else 0.0 for k in d] for i in d]                # J Phi
    j = {(i, k): added(times(phi[m, i], half[m][k]) for m in columns[i]) for i, k in bank.pairs}
    h = [added(times(phi[m, k], said.h[m]) for m in columns[k]) for k in d]
    return Likelihood(j, h, said.log_k)


def _met(bank: Bank, now: Kept, said: Likelihood, e: Entries) -> tuple:
    """
    Return (likelihood, rate, variance) where the modes of a moment meet those after it.

    Arrays are (modes now, modes after, lanes) until the latter are summed over.

    """
    off = [v - c for v, c in zip(now.x, now.mean())]
    parts = factors(now.p, bank.table.size)
    moved = said.shifted([v[:, None] for v in off])
    pair = moved.blurred([(s[:, None], [v if v is None or isinstance(v, float) else v[:, None]
                                        for v in vs]) for s, vs in parts])
    weight, log_k = _odds(pair.log_k, e)
    h, pull = ([(weight * v).sum(1) for v in of.h] for of in (pair, moved))
    apart = [v - m[:, None] for v, m in zip(pair.h, h)]
    j = {k: (weight * v).sum(1) for k, v in pair.j.items()}
    spread = {(i, k): (weight * apart[i] * apart[k]).sum(1) for i, k in bank.pairs}
    rate, variance = _rate(bank, now, log_k, h, {k: v - spread[k] for k, v in j.items()})
    # one likelihood for each mode: all of them by their weights, flatter the more they differ
    # (a trace of rounding, where states are seen only in their sum, may come out below zero)
    share = 1 / (1 + np.maximum(_trace(j, spread, bank.table.size), 0.0))
    one = Likelihood({k: share * (weight * v).sum(1) for k, v in said.j.items()},
                     [share * v for v in pull], 0.0)
    one.log_k = log_k - one.blurred(parts).log_k
    one = one.shifted([-v for v in off])
    one.log_k = one.log_k - one.log_k.max(0)
    return one, rate, variance


def _odds(log_k: np.ndarray, e: Entries) -> tuple[np.ndarray, np.ndarray]:
    """
    Return how each mode goes on, (modes now, modes after, lanes), and what that makes its log K.

    From log K of each pair. A change that later samples do not speak for is left out: of many
    small shares, sample by sample, the likelihood would be flattened for nothing.

    """
    other = np.broadcast_to(e.prior * (1 - e.stay), log_k.shape[1:])
    odds = log_k + np.log(np.maximum(other, 1e-300))
    same = np.arange(len(log_k))
    odds[same, same] += np.log1p(e.stay / np.maximum(other, 1e-300))
    top = odds.max(1)
    weight = np.exp(odds - top[:, None])
    total = weight.sum(1)
    weight /= total[:, None]
    kept = weight > SPOKEN * other
    kept[same, same] = True
    weight = np.where(kept, weight, 0.0)
    return weight / weight.sum(1)[:, None], top + np.log(total)


def _rate(bank: Bank, now: Kept, log_k: Any, h: list, j: dict) -> tuple:
    """Return rate and variance over all modes, each x + P h with P - P J P."""
    d = range(bank.table.size)
    mu = np.log(np.maximum(now.mu, 1e-300)) + log_k
    mu = np.exp(mu - mu.max(0))
    mu = mu / mu.sum(0)
    p = [added(w * now.p[min(i, k), max(i, k)] for k, w in bank.moving) for i in d]
    x = added(w * now.x[i] for i, w in bank.moving) + added(p[i] * h[i] for i in d)
    var = added(w * p[i] for i, w in bank.moving) - added(
        p[i] * p[k] * j[min(i, k), max(i, k)] for i in d for k in d)
    rate = (mu * x).sum(0)
    return rate, (mu * (np.maximum(var, 0.0) + (x - rate) ** 2)).sum(0)


def _trace(b: dict, c: dict, size: int) -> Any:
    """Return the trace of B^-1 C over the range of B, element by element."""
    total = 0.0
    c = dict(c)
    for s, v in factors(b, size):
        i = next(k for k in range(size) if isinstance(v[k], float))
        total = total + c[i, i] * _inverse(s)
        row = {k: c[i, k] for k in range(i, size)}
        for k in range(i + 1, size):
            for m in range(k, size):
                if v[k] is not None and v[m] is not None:
                    c[k, m] = c[k, m] - v[k] * row[m] - v[m] * row[k] + v[k] * v[m] * row[i]
    return total


def keep(bank: Bank, z: np.ndarray, e: Entries, begins: Any = None) -> Kept:
    """Return a bank as it is after samples z (lanes,)."""
    return Kept(bank.mu.copy(), list(bank.x.copy()), dict(zip(bank.pairs, bank.cov.copy())), z,
                replace(e, r=bank.noise_seen(e)), begins)


def forward(bank: Bank, z: np.ndarray, e: Entries, begins: np.ndarray | None = None) -> Kept:
    """Carry a bank over an interval to samples z (lanes,); return what it then is."""
    bank.mix(e)
    bank.predict(e)
    if begins is not None:
        bank.restart(begins)
    bank.update(z, e)
    return keep(bank, z, e, begins)


def look_back(bank: Bank, kept: list[Kept], said: Likelihood | None = None) -> tuple:
    """
    Return (rate, variance) of all moments but the last, oldest first, by those after each.

    ``said`` is what samples after the last moment say of it (None: there are none); what all say
    of the first moment is returned too.

    """
    said = said or Likelihood.nothing(bank.table.size, bank.mu.shape)
    out = []
    for earlier, later in zip(kept[-2::-1], kept[:0:-1]):
        said, *answer = backward(bank, earlier, later, said)
        out.append(tuple(answer))
    return out[::-1], said


def at_once(bank: Bank, now: Kept) -> tuple:
    """Return (rate, variance) of a moment by no later sample."""
    return _rate(bank, now, 0.0, [0.0] * bank.table.size, dict.fromkeys(bank.pairs, 0.0))


def smooth_chunks(
    z: np.ndarray, keys: np.ndarray, design: Design, clock: Clock, progress: Any = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """
    Return rate, variance and score (n, axes) of z (n, axes): as the bank's, but smoothed.

    Memory is bounded by blocks: forward once, keeping the bank at the beginning of each block;
    then from the last block to the first, forward through it again and back.

    """
    layout = Layout(len(z), clock.interval, beyond=None)
    lanes = Lanes(keys, design, clock, len(layout.first), z.shape[1])
    bank = lanes.bank
    out = np.empty_like(z), np.empty_like(z), np.empty_like(z)

    def moment(k):
        at = layout.at(k)
        return z[at].ravel(), lanes.entries(at), lanes.begins(at, layout.over(k))

    starts = []
    for k in range(layout.steps):
        at = layout.at(k)
        layout.put(k, out[2:], lanes.step(z[at].ravel(), at, first=k == 0)[2:])
        if k % BLOCK == 0:
            starts.append(keep(bank, *moment(k)))
        if progress and k % 1000 == 0:
            progress(0.3 * k / layout.steps)
    layout.put(layout.steps - 1, out, bank.rate())
    said = None
    for b in reversed(range(len(starts))):
        bank.load(starts[b].mu, starts[b].x, starts[b].p.values())
        first, last = b * BLOCK, min((b + 1) * BLOCK, layout.steps - 1)
        kept = [starts[b], *(forward(bank, *moment(k)) for k in range(first + 1, last + 1))]
        answers, said = look_back(bank, kept, said)
        for k, answer in enumerate(answers, first):
            layout.put(k, out, answer)
        if progress:
            progress(1 - 0.7 * b / len(starts))
    return out
