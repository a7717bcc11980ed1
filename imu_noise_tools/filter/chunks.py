# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
One series through banks of many values at once: its chunks run side by side.

A chunk begins with what a bank of the same structure knew there that came from far before; a few
samples let it forget the values which that had. Begun with nothing, a bank wants a thousand
samples at rest, and likelihoods would speak for whatever has less to learn.

Where a sample is missing (NaN) a bank predicts on.

"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .imm import Bank, Coefficients, Entries, log_density
from .modes import modes_of
from .statespace import FilterEffect, StateSpace
from ..loop.effect import Model

CHUNKS = 40             # of a series: fewer take more steps, more warm up more
LEAST = 128             # samples of a chunk
LANES = 400             # chunks and models at once: what they need then stays in the cache
FAR = 1024              # samples from which a chunk is begun with nothing, once
NEAR = 64               # samples ahead of it from which it goes on with what was known there
VAGUE = 1e30            # variance, {rate}^2, of a sample that says nothing


def settle_of(n: int) -> int:
    """Return how many samples at the start are left out while a filter settles."""
    return min(512, n // 8)


@dataclass(frozen=True)
class Known:
    """What a bank knows where chunks begin: arrays (..., modes, chunks); of the first nothing."""

    mu: np.ndarray
    x: np.ndarray
    cov: np.ndarray

    @property
    def parts(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The three arrays: probabilities, states, covariances."""
        return self.mu, self.x, self.cov

    def repeated(self, k: int) -> Known:
        """Return it for k models each."""
        return Known(*(np.repeat(a, k, -1) for a in self.parts))

    def take(self, bank: Bank, lanes: np.ndarray, ahead: int = 0) -> None:
        """Take over what a bank knows in some lanes (lanes,) bool, for those so many ``ahead``."""
        for into, now in zip(self.parts, (bank.mu, bank.x, bank.cov)):
            into[..., np.flatnonzero(lanes) + ahead] = now[..., lanes]

    def of(self, i: int, k: int) -> Known:
        """Return what the i-th of k models knows."""
        return Known(*(a[..., i::k].copy() for a in self.parts))


class Chunks:
    """
    A series z (n,), NaN where missing, at dt (s), and what is known where its chunks begin.

    ``alpha`` is the fading memory of the banks.

    """

    def __init__(self, z: np.ndarray, dt: float, alpha: float = 1.0):
        self.missing = np.isnan(z)
        self.gaps = bool(self.missing.any())
        self.z, self.dt, self.alpha = np.where(self.missing, 0.0, z), dt, alpha
        size = max(LEAST, -(-len(z) // CHUNKS))
        self.first = np.arange(0, len(z), size)
        self.stop = np.minimum(self.first + size, len(z))
        self._known: dict[tuple[str, ...], Known] = {}
        self._alike: dict[tuple, Known] = {}
        self._ended: dict[tuple[str, ...], dict[Model, Known]] = {}

    def densities(
        self, models: list[Model], at_off: tuple[float, ...] = (), share: float = 1.0
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        """
        Return log-likelihoods of each sample by k models of one structure, and lists of scores.

        (k, n - settle) each: of a missing sample 0, and NaN. There are scores of the samples off
        by each of ``at_off``. Of each chunk no more than ``share`` is passed, from its beginning;
        the rest is left at zero.

        """
        key = tuple(models[0].labels)
        if key not in self._known:
            self.begin(models[0])
        return self._parts(models, at_off, self._known[key], share)

    def passed(self, models: list[Model]) -> np.ndarray:
        """
        Return log-likelihoods, (k,), of models whose chunks begin each with its own.

        They come from far: what each model makes of a phase that it keeps is known there. From now
        on chunks begin with what the best of them knows.

        """
        parts = []
        before = self._known.get(tuple(models[0].labels))
        for some in self._groups(models):
            known = self._from(some, before and before.repeated(len(some)))
            value = self._run(some, (), known)[0].sum(1)
            best = int(np.argmax(value))
            parts.append((value, known.of(best, len(some))))
        best = int(np.argmax([np.max(v) for v, _ in parts]))
        self._known[tuple(models[0].labels)] = parts[best][1]
        return np.concatenate([v for v, _ in parts])

    def _groups(self, models):
        some = max(1, LANES // len(self.first))
        return [models[i:i + some] for i in range(0, len(models), some)]

    def _parts(self, models, at_off, known, share):
        if share == 1.0:
            self._ended[tuple(models[0].labels)] = {}
        parts = [self._run(some, at_off, known.repeated(len(some)), share)
                 for some in self._groups(models)]
        return (np.concatenate([part[0] for part in parts]),
                [np.concatenate(u) for u in zip(*(part[1] for part in parts))])

    def begin(self, model: Model, anew: bool = False) -> None:
        """
        Let all chunks of models of this structure begin with what this model knows there.

        Each goes on from where the one before it begins: as it did, if this model was among the
        last to be passed. If that is not known to this structure, nor to another of the same
        states, all come from far. ``anew``: phases are learnt again, and what of them was seen
        before is added (:func:`_joined`).

        """
        key, states = tuple(model.labels), self._states(model)
        before = self._known.get(key, self._alike.get(states))
        ended = None if anew else self._ended.get(key, {}).get(model)
        self._known[key] = ended or self._from([model], before, anew)
        self._alike.setdefault(states, self._known[key])

    def _states(self, model):
        """Return how many modes, and what has states: what one knows is of use to all alike."""
        return (len(modes_of([model], self.dt).prior),
                *(e.label for e in model.of(FilterEffect) if len(e.block(self.dt).h)))

    def _from(self, models, before=None, anew=True):
        """Return what models of one structure know where chunks begin, one after the other."""
        end, k = np.maximum(self.first - NEAR, 0), len(models)
        spaces = [modes_of([m], self.dt).spaces[0][0] for m in models]
        joins = bool(spaces[0].keeps) and (before is None or anew)
        begin = np.maximum(end - FAR, 0)
        if before is not None:
            begin = np.concatenate([[0], end[:-1]])
        elif joins:     # from where another ends: all that it saw is of use
            back = -(-FAR // max(LEAST, self.stop[0]))
            begin = np.concatenate([np.zeros(back, int), end])[:len(end)]
        bank, e = self._bank(models, len(begin), _remembering if joins else None)
        if before is not None:
            before = Known(*(np.roll(a, k, -1) for a in before.parts))
            bank.load(*(_with_memory(before, bank, spaces[0]) if joins else before).parts)
        known = Known(*(np.zeros_like(a) for a in (bank.mu, bank.x, bank.cov)))
        steps = int(np.max(end - begin))
        z, missing = self._samples(begin + np.arange(steps)[:, None], k)
        for step in range(steps):
            at = begin + step
            if step or before is not None:
                bank.mix(e)
                bank.predict(e)
            if not step:
                if before is not None and joins:
                    _forget(bank, spaces[0])
                bank.restart(np.repeat(begin == 0, k))
            bank.update(z[step], _by_what_is_there(e, missing[step]))
            if (at == end - 1).any():
                known.take(bank, np.repeat(at == end - 1, k))
        if not joins:
            return known
        each = [_joined(known.of(i, k), begin, end, space, self.alpha).parts
                for i, space in enumerate(spaces)]
        return Known(*(np.stack(a, -1).reshape(*a[0].shape[:-1], -1) for a in zip(*each)))

    @np.errstate(invalid='ignore')      # values far off may lose all digits: no likelihood then
    def _run(self, models, at_off, known, share=1.0):
        k = len(models)
        stop = np.minimum(self.stop, self.first + int(np.ceil(share * self.stop[0])))
        bank, e = self._bank(models, len(self.first))
        bank.load(known.mu, known.x, known.cov)
        begin = np.maximum(self.first - NEAR, 0)
        at = begin + np.arange(np.max(stop - begin))[:, None]
        live = (at >= self.first) & (at < stop)
        z, missing = self._samples(at, k)
        found = np.empty((1 + len(at_off), *z.shape))
        ends = np.equal(at, np.append(begin[1:], 0) - 1)
        ended = Known(*(np.zeros_like(a) for a in (bank.mu, bank.x, bank.cov)))
        last = np.sum(ends, axis=1) > 0
        for step in range(len(at)):
            bank.mix(e)
            bank.predict(e)
            if not step:
                bank.restart(np.repeat(self.first < NEAR, k))   # there is nothing before
            nu, s, found[0, step] = bank.update(z[step], _by_what_is_there(e, missing[step]))
            if last[step]:
                ended.take(bank, np.repeat(ends[step], k), k)
            if live[step].any():
                for u, off in zip(found[1:], at_off):
                    u[step] = bank.transform(nu + off, s, e)
        if share == 1.0:
            self._ended.setdefault(tuple(models[0].labels), {}).update(
                (m, ended.of(i, k)) for i, m in enumerate(models))
        found[0] = np.where(missing, 0.0, log_density(found[0]))
        found[1:, missing] = np.nan
        each, *scores = self._in_order(found.reshape(*found.shape[:2], -1, k), at, live)
        return each, scores

    def _samples(self, at, k):
        """Return the samples at places, (steps, chunks), k times each, and which are missing."""
        at = np.repeat(np.minimum(at, len(self.z) - 1), k, axis=1)
        return self.z[at], self.missing[at]

    def _in_order(self, found, at, live):
        """Return (..., k, n - settle) of what was found, (..., steps, chunks, k), where live."""
        out = np.zeros((len(found), found.shape[-1], len(self.z)))
        out[:, :, at[live]] = np.moveaxis(found[:, live], -1, 1)
        return out[:, :, settle_of(len(self.z)):]

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


def _by_what_is_there(e: Entries, missing: np.ndarray) -> Entries:
    """Return entries by which the samples that are missing, (lanes,), say nothing."""
    return replace(e, r=np.where(missing, VAGUE, e.r)) if missing.any() else e


def _with_memory(known: Known, bank: Bank, space: StateSpace) -> Known:
    """Return what is known for a bank of :func:`_remembering`: nothing of its further states."""
    x, cov = np.zeros_like(bank.x), np.zeros_like(bank.cov)
    x[:space.size] = known.x
    cov[[n for n, (_, k) in enumerate(bank.pairs) if k < space.size]] = known.cov
    return Known(known.mu, x, cov)


def _forget(bank: Bank, space: StateSpace) -> None:
    """Let a bank of :func:`_remembering` forget the phases that it knows, in all lanes."""
    lost = {*space.keeps, *range(space.size, bank.table.size)}
    bank.x[sorted(lost)] = 0.0
    for n, pair in enumerate(bank.pairs):
        if lost & set(pair):
            bank.cov[n] = bank.start[n]


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
