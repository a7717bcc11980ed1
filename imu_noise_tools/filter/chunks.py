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
from .statespace import oscillates
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
        self, models: list[Model], at_off: tuple[float, ...] = (), quick: bool = False
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        """
        Return log-likelihoods of each sample by k models of one structure, and lists of scores.

        (k, n - settle) each. There are scores of the samples off by each of ``at_off``.

        """
        key = tuple(models[0].labels)
        if key not in self._known:
            self.begin(models[0], quick=quick)
        some = max(1, LANES // len(self.first))
        parts = [self._run(models[i:i + some], at_off, self._known[key])
                 for i in range(0, len(models), some)]
        return (np.concatenate([part[0] for part in parts]),
                [np.concatenate(u) for u in zip(*(part[1] for part in parts))])

    def begin(self, model: Model, anew: bool = False, quick: bool = False) -> None:
        """
        Let all chunks of models of this structure begin with what this model knows there.

        Each goes on from where the one before it begins; if that is not known, or ``anew``, all
        come from far, or, where a phase is kept for long, from the beginning of the series
        (``quick``: from far too, where it is enough to know that phase about).

        """
        key, end = tuple(model.labels), np.maximum(self.first - NEAR, 0)
        before = None if anew else self._known.get(key)
        begin = np.maximum(end - FAR, 0)
        if before is not None:
            begin = np.concatenate([[0], end[:-1]])
        elif oscillates(model) and not quick:
            begin = np.zeros(1, int)        # one lane that passes where each begins
        bank, e = self._bank([model], len(begin))
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
                lanes = there if len(begin) == len(end) else slice(None)
                for into, now in zip((known.mu, known.x, known.cov), (bank.mu, bank.x, bank.cov)):
                    into[..., there] = now[..., lanes]
        self._known[key] = known

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

    def _bank(self, models, chunks):
        """Return a bank whose lanes are chunks of the series, all models each, and its entries."""
        each = [modes_of([m], self.dt) for m in models]
        table = Coefficients([replace(each[0], spaces=tuple(m.spaces[0] for m in each))],
                             self.alpha)
        prior = np.tile(np.array([m.prior for m in each]).T, (1, chunks))
        stay = np.tile([m.stay for m in each], chunks)
        return (Bank(table, len(models) * chunks, prior),
                replace(table.at(0).tiled(chunks), prior=prior, stay=stay))
