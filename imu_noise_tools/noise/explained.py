# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Which part of a spectrum a model explains, so that the rest does not decide its coefficients.

The spectrum is judged in half-octave bands: nearly all coefficients lie in the last decade before
Nyquist, where a sensor's own filter and vibration are, while drift and the level at 1 s are read
over decades below. A band is kept where its mean agrees with the fit; what is not kept carries a
level of its own. Beside that, a response that tends to 1 at low frequencies may be left open
(:mod:`~imu_noise_tools.noise.response`): what a sensor's filter does to every band, and what a
resonance does far from its middle.

"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Protocol

import numpy as np
from scipy.special import digamma

from .response import open_response, OpenResponse, Order
from ..core.spectrum import Bins
from ..core.statistics import gamma_pull_exact, in_a_row

AGREES = 4.0  # standard errors within which a band is explained
NEARLY = 0.02  # or this share of its power
FAR = 5.0  # standard errors beyond which one bin alone is set aside
MANY = 200  # coefficients from which the slope inside a band says something
FEW, SCARCE = 3, 1e-3  # coefficients whose own level is not below this share of the model's
COST = 0.5 * AGREES**2  # nats that a level of its own costs a band


@dataclass(frozen=True)
class SetAside:
    """
    A stretch of the spectrum that the model does not explain.

    From ``low`` to ``high`` Hz; ``share`` of the record's power that it holds; ``ratio`` of the
    measured power there to the model's.

    """

    low: float
    high: float
    share: float
    ratio: float

    @property
    def direction(self) -> str:
        """``too much`` or ``too little`` power."""
        return 'too much' if self.ratio > 1 else 'too little'


@dataclass(frozen=True)
class Explained:
    """
    What the fit rests on.

    Parameters
    ----------
    f : ndarray (b,)
        Centres of the bins that it was chosen on, Hz; empty where every bin counts.
    weight : ndarray (b,)
        What a bin counts, 0 ... 1: 0 is set aside, less than 1 agrees only nearly.
    order : Order
        Of the response that is left open; that of none by default.
    values : tuple of float
        Of that response, to start from; empty: no response at all.
    quiet : float
        Hz from which only those stretches count in which nothing is switched on; infinite: none.

    """

    f: np.ndarray
    weight: np.ndarray
    order: Order = Order()
    values: tuple[float, ...] = ()
    quiet: float = np.inf

    def on(self, bins: Bins) -> np.ndarray:
        """Return the weights (b,) on the bins of another part of the same record."""
        if not len(self.f):
            return np.ones(len(bins.f))
        if len(bins.f) == len(self.f) and np.array_equal(bins.f, self.f):
            return self.weight
        middle = np.sqrt(self.f[1:] * self.f[:-1])
        return self.weight[np.searchsorted(middle, bins.f)]

    def response(self) -> OpenResponse | None:
        """Return the response that is left open, to be fitted; None where there is none."""
        if not self.order.terms:
            return None
        response = open_response(self.order)
        names = [p.name for p in response.parameters]
        return response.with_values(**dict(zip(names, self.values or [0.0] * len(names))))


@dataclass(frozen=True)
class Bands:
    """
    Bins in half-octave bands: ``of`` (b,) is the band of each bin, 0 ... ``count`` - 1.

    Attributes
    ----------
    size : ndarray (bands,)
        Coefficients in each band.
    edges : ndarray (b + 1,)
        Edges of the bins, Hz.
    low, high : ndarray (bands,)
        Edges of the bands, Hz.

    """

    of: np.ndarray
    count: int
    size: np.ndarray = field(repr=False)
    edges: np.ndarray = field(repr=False)
    low: np.ndarray = field(repr=False)
    high: np.ndarray = field(repr=False)

    @classmethod
    @lru_cache(maxsize=16)
    def on(cls, bins: Bins) -> Bands:
        """Return the bands of these bins."""
        number = np.floor(2 * np.log2(bins.f / bins.f[0]) + 1e-9).astype(int)
        _, of = np.unique(number, return_inverse=True)
        count = int(of[-1]) + 1
        begin = np.searchsorted(of, np.arange(count))
        step = 1 / (2 * bins.n * bins.dt)
        edges = np.append(bins.first, bins.last[-1]) * step
        size = np.bincount(of, bins.count, count)
        return cls(of, count, size, edges, edges[begin], edges[np.append(begin[1:], len(of))])

    def beside(self, weight: np.ndarray) -> np.ndarray:
        """
        Return which bands (bands,) of many coefficients have a neighbour that counts nothing.

        None where fewer than three times as many would be left.

        """
        out = self.sum(weight) == 0
        near = np.zeros(self.count, bool)
        near[1:] |= out[:-1]
        near[:-1] |= out[1:]
        near &= ~out & (self.size >= MANY)
        return near if np.sum(~out & ~near) >= 3 * np.sum(near) else np.zeros(self.count, bool)

    def sum(self, values: np.ndarray) -> np.ndarray:
        """Return sums (bands,) of values (b,)."""
        return np.bincount(self.of, values, self.count)


@dataclass(frozen=True)
class Judgement:
    """
    Bands beside a fit: ``kept`` and ``pull`` (bands,), and what each bin counts, ``weight`` (b,).

    ``worth`` (bands,) is 1 for a band that agrees, 1/2 for one that nearly does not.

    """

    kept: np.ndarray
    pull: np.ndarray
    weight: np.ndarray
    worth: np.ndarray


def judge(bands: Bands, ratio: np.ndarray, count: np.ndarray, nearly: float = NEARLY) -> Judgement:
    """
    Return which bands agree with a fit.

    Parameters
    ----------
    bands : Bands
        Of these bins.
    ratio : ndarray (b,)
        Measured power over the model's.
    count : ndarray (b,)
        Coefficients in each bin.
    nearly : float
        Share of its power by which a band may be off in any case. None beside an open response,
        which would carry what is off at high frequencies down to the level at 1 s.

    """
    near = np.abs(gamma_pull_exact(ratio, count)) <= FAR
    w = count * near
    left = bands.sum(w)
    mean = bands.sum(w * ratio) / np.maximum(left, 1e-9)
    pull = np.where(left > 0, gamma_pull_exact(mean, left), np.inf)
    enough = bands.sum(near.astype(float)) >= 0.5 * bands.sum(np.ones(len(ratio)))
    # a fit that crosses the spectrum agrees in the mean: its slope does not
    at = np.arange(len(ratio)) - (bands.sum(w * np.arange(len(ratio)))
                                  / np.maximum(left, 1e-9))[bands.of]
    square = np.maximum(bands.sum(w * at**2), 1e-9)
    slope = bands.sum(w * at * (ratio - 1))
    steep = np.abs(slope) / np.sqrt(2 * square)
    steep = np.where(left >= MANY, steep, 0.0)
    steep = steep * (np.abs(slope) * np.sqrt(1 / (square * np.maximum(left, 1e-9))) > nearly)
    kept = enough & ((np.abs(pull) <= AGREES) | (np.abs(mean - 1) <= nearly)) & (steep <= AGREES)
    size = np.abs(pull)
    kept &= ~_crossings(kept, pull)
    kept &= ~_islands(kept)
    # what agrees nearly counts as if it scattered by as much as it is off
    counts = np.where(kept, np.where(size > AGREES, 1 / np.maximum(size, 1) ** 2, 1.0), 0.0)
    worth = kept * (1 - 0.5 * np.minimum(size / AGREES, 1) ** 2)
    return Judgement(kept, pull, counts[bands.of] * near, worth)


def _crossings(kept, pull):
    """Return which bands agree only because the fit goes from one side to the other there."""
    out = np.zeros(len(kept), bool)
    if len(kept) > 2:
        out[1:-1] = ~kept[:-2] & ~kept[2:] & (pull[:-2] * pull[2:] < 0)
    return out


def _islands(kept: np.ndarray) -> np.ndarray:
    """
    Return which bands are fewer than those not explained below them, and end before the fast end.

    What rises and falls above a level passes through it: between two disturbances some bands agree
    with any level, and so many coefficients are there that they would decide it.

    """
    out = np.zeros(len(kept), bool)
    edges = in_a_row(kept)
    end = edges[0, 1] if len(edges) else 0
    for a, b in edges[1:]:
        if b < len(kept) and b - a < a - end:
            out[a:b] = True
        else:
            end = b
    return out


class Explains(Protocol):
    """What a fit makes of the bins: power (b,) that is measured, its weight, the model's power."""

    @property
    def power(self) -> np.ndarray:
        """What is measured."""

    @property
    def weight(self) -> np.ndarray:
        """Degrees of freedom."""

    @property
    def v(self) -> np.ndarray:
        """The model's power."""


def supported(
    bands: Bands, power: np.ndarray, weight: np.ndarray, v: np.ndarray, cost: float = COST,
    partly: bool = False,
) -> float:
    """
    Return ln L of a spectrum v (b,) where each band may have levels of its own at a cost.

    A band counts what the model makes of it, or what levels fitted to each of its bins make of it
    less a cost and less what they gain by chance, sum_b w (ln(w/2) - psi(w/2))/2, whichever is
    more. So models are compared by what they explain: to explain one more band is worth up to
    that cost, however badly it was missed, and no model is better for bending to what it does not
    explain.

    Parameters
    ----------
    bands : Bands
        Of these bins.
    power, weight : ndarray (b,)
        Measured power and degrees of freedom of each bin.
    v : ndarray (b,)
        The model's power.
    cost : float
        Nats a band.
    partly : bool
        Whether to come nearer to what is not explained counts, each e times nearer as much as one
        more band: a peak may be there that is not quite of its form.

    """
    return float(np.sum(_of_bands(bands, power, weight, v, cost, partly)))


def _of_bands(bands: Bands, power: np.ndarray, weight: np.ndarray, v: np.ndarray, cost: float,
              partly: bool) -> np.ndarray:
    """Return what each band (bands,) counts of :func:`supported`."""
    w = np.maximum(weight, 0.5)
    own = -0.5 * weight * (np.log(v) + power / v)
    # one coefficient that happens to be zero, or was solved for, is no level
    least = np.where(weight < FEW, SCARCE * v, 1e-300)
    free = -0.5 * weight * (np.log(np.maximum(power, least)) + 1)
    chance = 0.5 * w * (np.log(w / 2) - digamma(w / 2))
    most = bands.sum(free - chance)
    lost = most - bands.sum(own)
    beyond = cost * np.log(np.maximum(lost / cost, 1.0)) if partly else 0.0
    return most - np.minimum(lost, cost) - beyond


def gained(bands: Bands, before: Explains, after: Explains, cost: float = COST,
           partly: bool = False, above: float = 0.0, loss: float = np.inf) -> float:
    """
    Return by how much more one fit explains than another, nats, as :func:`supported` says.

    In the bands ``above`` a frequency (Hz), in none of which it counts less by more than ``loss``.

    Both count the same degrees of freedom in a bin, the more of the two: what is solved for in the
    mean takes some of them, not alike in both, and each is worth a ln v, which has a unit.

    """
    one, other = _alike(bands, (before, after), cost, partly)
    return float(np.sum(np.maximum(other - one, -loss)[bands.low >= above]))


def gained_beyond(bands: Bands, before: Explains, known: Explains, after: Explains,
                  cost: float = COST, partly: bool = False) -> float:
    """Return :func:`gained`, less in each band what another one, ``known``, would gain there."""
    one, most, other = _alike(bands, (before, known, after), cost, partly)
    return float(np.sum(other - np.clip(other, one, np.maximum(one, most))))


def _alike(bands: Bands, some: Sequence[Explains], cost: float,
           partly: bool) -> list[np.ndarray]:
    """Return what each band (bands,) counts of fits that count the same degrees of freedom."""
    full = np.maximum(np.max([d.weight for d in some], axis=0), 1e-9)
    return [_of_bands(bands, d.power * d.weight / full, full, d.v, cost, partly) for d in some]


def stretches(bands: Bands, explained: np.ndarray) -> Iterator[
        tuple[np.ndarray, float, float]]:
    """
    Yield (bins, low Hz, high Hz) of each stretch that is not explained.

    Neighbouring bands of which nothing is explained are one stretch, single bins inside a band
    that is (lines) another.

    """
    whole = bands.sum(explained.astype(float)) == 0
    for a, b in in_a_row(whole):
        yield np.flatnonzero((bands.of >= a) & (bands.of < b)), \
            float(bands.low[a]), float(bands.high[b - 1])
    alone = ~explained & ~whole[bands.of]
    for a, b in in_a_row(alone):
        yield np.arange(a, b), float(bands.edges[a]), float(bands.edges[b])


def set_aside(bands: Bands, explained: np.ndarray, measured: np.ndarray, count: np.ndarray,
              v: np.ndarray, total: np.ndarray) -> tuple[SetAside, ...]:
    """
    Return the stretches that are not explained, from low to high frequencies.

    Parameters
    ----------
    bands : Bands
        Of these bins.
    explained : ndarray (b,) of bool
        Whether a bin is.
    measured, v : ndarray (b,)
        Power and the model's.
    count : ndarray (b,)
        Coefficients in each bin.
    total : ndarray (b,)
        Power of the record, lines and all.

    """
    share, out = total * count / np.sum(total * count), []
    for at, low, high in stretches(bands, explained):
        ratio = np.sum((measured * count)[at]) / np.sum((v * count)[at])
        out.append(SetAside(low, high, float(np.sum(share[at])), float(ratio)))
    return tuple(sorted(out, key=lambda s: s.low))
