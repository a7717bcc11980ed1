# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
One series through banks of many values at once: its chunks run side by side.

A chunk begins with what a bank of the same structure knew there that came from far before; a few
samples let it forget the values which that had. Begun with nothing, a bank wants a thousand
samples at rest, and likelihoods would speak for whatever has less to learn.

"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .imm import Bank, Coefficients, log_density
from .modes import modes_of
from .statespace import StateSpace
from ..loop.effect import Model

CHUNKS = 40             # of a series: fewer take more steps, more warm up more
LEAST = 128             # samples of a chunk
LANES = 400             # chunks and models at once: what they need then stays in the cache
FAR = 1024              # samples from which a chunk is begun with nothing, once
NEAR = 64               # samples ahead of it from which it goes on with what was known there


def settle_of(n: int) -> int:
    """Return how many samples at the start are left out while a filter settles."""
    return min(512, n // 8)


@dataclass(frozen=True)
class Known:
    """What a bank knows where chunks begin: arrays (..., modes, chunks); of the first nothing."""

    mu: np.ndarray
    x: np.ndarray
    cov: np.ndarray


class Chunks:
    """
    A series z (n,) at dt (s), and what is known where its chunks begin.

    ``alpha`` is the fading memory of the banks.

    """

    def __init__(self, z: np.ndarray, dt: float, alpha: float = 1.0):
        self.z, self.dt, self.alpha = z, dt, alpha
        size = max(LEAST, -(-len(z) // CHUNKS))
        self.first = np.arange(0, len(z), size)
        self.stop = np.minimum(self.first + size, len(z))
        self._known: dict[tuple[str, ...], Known] = {}

    def densities(
        self, models: list[Model], at_off: tuple[float, ...] = ()
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        """
        Return log-likelihoods of each sample by k models of one structure, and lists of scores.

        (k, n - settle) each. There are scores of the samples off by each of ``at_off``.

        """
        key = tuple(models[0].labels)
        if key not in self._known:
            self.begin(models[0])
        some = max(1, LANES // len(self.first))
        parts = [self._run(models[i:i + some], at_off, self._known[key])
                 for i in range(0, len(models), some)]
        return (np.concatenate([part[0] for part in parts]),
                [np.concatenate(u) for u in zip(*(part[1] for part in parts))])

    def begin(self, model: Model, anew: bool = False) -> None:
        """
        Let all chunks of models of this structure begin with what this model knows there.

        Each goes on from where the one before it begins; if that is not known, or ``anew``, all
        come from far. What of a phase was seen before that is added (:func:`_joined`).

        """
        key, end = tuple(model.labels), np.maximum(self.first - NEAR, 0)
        before = None if anew else self._known.get(key)
        space = modes_of([model], self.dt).spaces[0][0]
        joins = before is None and bool(space.keeps)
        begin = np.maximum(end - FAR, 0)
        if before is not None:
            begin = np.concatenate([[0], end[:-1]])
        elif joins:     # from where another ends: all that it saw is of use
            back = -(-FAR // max(LEAST, self.stop[0]))
            begin = np.concatenate([np.zeros(back, int), end])[:len(end)]
        bank, e = self._bank([model], len(begin), _remembering if joins else None)
        if before is not None:
            bank.load(*(np.roll(a, 1, -1) for a in (before.mu, before.x, before.cov)))
        known = Known(*(np.zeros((*a.shape[:-1], len(end))) for a in (bank.mu, bank.x, bank.cov)))
        for step in range(int(np.max(end - begin))):
            at = begin + step
            if step or before is not None:
                bank.mix(e)
                bank.predict(e)
            if not step:
                bank.restart(begin == 0)
            bank.update(self.z[np.minimum(at, len(self.z) - 1)], e)
            there = at == end - 1
            if there.any():
                for into, now in zip((known.mu, known.x, known.cov), (bank.mu, bank.x, bank.cov)):
                    into[..., there] = now[..., there]
        self._known[key] = _joined(known, begin, end, space, self.alpha) if joins else known

    def _run(self, models, at_off, known):
        n, k, settle = len(self.z), len(models), settle_of(len(self.z))
        bank, e = self._bank(models, len(self.first))
        bank.load(*(np.repeat(a, k, -1) for a in (known.mu, known.x, known.cov)))
        new = np.repeat(self.first < NEAR, k)       # there is nothing before
        begin = np.maximum(self.first - NEAR, 0)
        each, *scores = np.empty((1 + len(at_off), k, n))
        for step in range(int(np.max(self.stop - begin))):
            at = begin + step
            live = (at >= self.first) & (at < self.stop)
            bank.mix(e)
            bank.predict(e)
            if not step:
                bank.restart(new)
            nu, s, density = bank.update(np.repeat(self.z[np.minimum(at, n - 1)], k), e)
            if not live.any():
                continue
            each[:, at[live]] = log_density(density).reshape(-1, k)[live].T
            for u, off in zip(scores, at_off):
                u[:, at[live]] = bank.transform(nu + off, s, e).reshape(-1, k)[live].T
        return each[:, settle:], [u[:, settle:] for u in scores]

    def _bank(self, models, chunks, changed=None):
        """
        Return a bank whose lanes are chunks of the series, all models each, and its entries.

        Of state spaces ``changed`` by a function.

        """
        each = [modes_of([m], self.dt) for m in models]
        spaces = tuple(m.spaces[0] for m in each)
        if changed:
            spaces = tuple(tuple(map(changed, some)) for some in spaces)
        table = Coefficients([replace(each[0], spaces=spaces)], self.alpha)
        prior = np.tile(np.array([m.prior for m in each]).T, (1, chunks))
        stay = np.tile([m.stay for m in each], chunks)
        return (Bank(table, len(models) * chunks, prior),
                replace(table.at(0).tiled(chunks), prior=prior, stay=stay))


def _remembering(space: StateSpace) -> StateSpace:
    """Return a space that goes on knowing, in states of its own, what phases it began with."""
    o, d = list(space.keeps), space.size
    both = [*range(d), *o]

    def wider(a):
        out = np.zeros((len(both), len(both)))
        out[:d, :d] = a
        return out

    none = np.zeros(len(o))
    return replace(space, phi=wider(space.phi) + np.diag([*np.zeros(d), *none + 1]),
                   q=wider(space.q), p0=space.p0[np.ix_(both, both)],
                   h=np.append(space.h, none), rate=np.append(space.rate, none))


def _joined(
    found: Known, begin: np.ndarray, end: np.ndarray, space: StateSpace, alpha: float
) -> Known:
    """
    Return what is known at each ``end`` with the phases seen before its ``begin``.

    A stretch that began with any phase has found how what it knows goes with that
    (:func:`_remembering`); what another knows where this one begins is information on it, as if
    it had been measured. So a pass over the whole series is done in stretches side by side.

    """
    o, d = list(space.keeps), space.size
    size = d + len(o)
    upper = np.triu_indices(size)
    place = np.zeros((size, size), int)
    place[upper] = place.T[upper] = np.arange(len(upper[0]))
    phi, q, fresh = (a[np.ix_(o, o)] for a in (space.phi, space.q, space.p0))
    for lane in np.flatnonzero(begin > 0):
        last = int(np.argmax(end == begin[lane]))
        mu, x = found.mu[:, last], found.x[o, :, last]
        mean = x @ mu
        off = x - mean[:, None]
        cov = phi @ (found.cov[place[np.ix_(o, o)], :, last] @ mu + off * mu @ off.T) @ phi.T + q
        kept = alpha ** int(end[lane] - begin[lane])
        more = kept * (np.linalg.inv(cov) - np.linalg.inv(fresh))
        told = kept * np.linalg.solve(cov, phi @ mean)
        x, p = found.x[..., lane].T, np.moveaxis(found.cov[place, :, lane], -1, 0)
        gain = p[:, :, d:] @ np.linalg.inv(np.eye(len(o)) + more @ p[:, d:, d:])
        found.x[..., lane] += np.einsum('mij,mj->im', gain, told - x[:, d:] @ more.T)
        found.cov[..., lane] -= (gain @ more @ p[:, d:])[:, upper[0], upper[1]].T
    return Known(found.mu, found.x[:d], found.cov[place[:d, :d][np.triu_indices(d)]])
