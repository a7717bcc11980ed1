# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Which part of a spectrum a model explains, so that the rest does not decide its coefficients.

The spectrum is judged in half-octave bands: nearly all coefficients lie in the last decade before
Nyquist, where a sensor's own filter and vibration are, while drift and the level at 1 s are read
over decades below. A band is kept where its mean agrees with the fit; what is not kept carries a
level of its own. Beside that, a smooth response that tends to 1 at low frequencies may be left
open: ln of the squared gain of any linear filter is an even function of frequency, and so is the
slow side of a resonance.

"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from scipy.special import chdtr, chdtrc, digamma, ndtri

from .kinds import Parameter, Response
from ..core.spectrum import Bins

AGREES = 4.0  # standard errors within which a band is explained
NEARLY = 0.02  # or this share of its power
FAR = 5.0  # standard errors beyond which one bin alone is set aside
MANY = 200  # coefficients from which the slope inside a band says something
COST = 0.5 * AGREES**2  # nats that a level of its own costs a band
OPEN = '(response)'  # label of the response that is left open


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
    order : int
        Terms of the response that is left open, 0 for none.
    top : float
        Frequency up to which that response was fitted, Hz.

    """

    f: np.ndarray
    weight: np.ndarray
    order: int = 0
    top: float = 1.0

    @property
    def everything(self) -> bool:
        """Whether nothing is set aside."""
        return self.order == 0 and bool(np.all(self.weight == 1))

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
        return _open_response(self.order, self.top) if self.order else None


class OpenResponse(Response):
    """A nuisance: ln gain^2 = sum_j a_j (T_2j(f/top) - T_2j(0)), T Chebyshev's polynomials."""

    last = True
    leaks = False
    top = 1.0

    def gain2(self, f, dt):
        """Return the squared gain."""
        values = np.array([self[p.name] for p in self.parameters])
        return np.exp(np.clip(self.terms(f) @ values, -60, 60))

    def terms(self, f: np.ndarray) -> np.ndarray:
        """Return d ln gain^2/d a_j at f (b,), (b, p)."""
        x = 2 * np.minimum(np.asarray(f, float) / self.top, 1.0) ** 2 - 1  # T_2j(u) = T_j(x)
        before, now, out = np.ones_like(x), x, []
        for j in range(1, len(self.parameters) + 1):
            out.append(now - (-1) ** j)
            before, now = now, 2 * x * now - before
        return np.stack(out, axis=-1)

    def starts(self, evidence):
        """Return no response at all."""
        return [self.with_values(**{p.name: 0.0 for p in self.parameters})]


@lru_cache(maxsize=64)
def _open_response(order: int, top: float) -> OpenResponse:
    terms = tuple(Parameter(f'a{j}', '1', -30.0, 30.0, log=False) for j in range(1, order + 1))
    kind = type('Open', (OpenResponse,), {'parameters': terms, 'top': top})
    return kind({}, OPEN)


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


def gamma_pull(x: np.ndarray, w: np.ndarray) -> np.ndarray:
    """
    Return the standard normal pull of x ~ chi^2_w/w, (b,).

    By the cube root (Wilson and Hilferty 1931) and, where that says more than 2.5, exactly: of few
    degrees of freedom its upper tail is a thousand times too thin at 4.

    """
    w = np.maximum(w, 0.5)
    spread = 2 / (9 * w)
    pull = np.asarray((np.cbrt(x) - (1 - spread)) / np.sqrt(spread))
    far = (np.abs(pull) > 2.5) & (np.abs(pull) < 12)
    if far.any():
        some, tail = pull[far], (w * x)[far]
        n = w[far]
        p = np.where(some > 0, chdtrc(n, tail), chdtr(n, tail))
        some = np.where(p > 1e-300, np.sign(some) * -ndtri(np.maximum(p, 1e-300)), some)
        pull = pull.copy()
        pull[far] = some
    return pull


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


def judge(
    bands: Bands, ratio: np.ndarray, count: np.ndarray, nearly: float = NEARLY
) -> Judgement:
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
    near = np.abs(gamma_pull(ratio, count)) <= FAR
    w = count * near
    left = bands.sum(w)
    mean = bands.sum(w * ratio) / np.maximum(left, 1e-9)
    pull = np.where(left > 0, gamma_pull(mean, left), np.inf)
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


def supported(
    bands: Bands, power: np.ndarray, weight: np.ndarray, v: np.ndarray, cost: float = COST
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

    """
    w = np.maximum(weight, 0.5)
    own = -0.5 * weight * (np.log(v) + power / v)
    free = -0.5 * weight * (np.log(np.maximum(power, 1e-300)) + 1)
    chance = 0.5 * w * (np.log(w / 2) - digamma(w / 2))
    return float(np.sum(np.maximum(bands.sum(own), bands.sum(free - chance) - cost)))


def stretches(bands: Bands, explained: np.ndarray):
    """
    Yield (bins, low Hz, high Hz) of each stretch that is not explained.

    Neighbouring bands of which nothing is explained are one stretch, single bins inside a band
    that is (lines) another.

    """
    whole = bands.sum(explained.astype(float)) == 0
    edge = np.flatnonzero(np.diff(np.concatenate([[False], whole, [False]]).astype(int)))
    for a, b in zip(edge[::2], edge[1::2]):
        yield np.flatnonzero((bands.of >= a) & (bands.of < b)), \
            float(bands.low[a]), float(bands.high[b - 1])
    alone = ~explained & ~whole[bands.of]
    edge = np.flatnonzero(np.diff(np.concatenate([[False], alone, [False]]).astype(int)))
    for a, b in zip(edge[::2], edge[1::2]):
        yield np.arange(a, b), float(bands.edges[a]), float(bands.edges[b])


def set_aside(bands: Bands, explained, measured, count, v, total) -> tuple[SetAside, ...]:
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
