# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A response that a fit leaves open: a rational function, which is what filters are.

The squared gain of any filter of finite order is P(u)/Q(u) in u = sin^2(pi f dt), P(0) = Q(0);
so is white noise beside a resonance. Its order is what a few terms gain; N is the level that it
tends to at low frequencies. (Box, Jenkins: Time Series Analysis, 4th ed., 3.4.5: the spectrum of a
mixed autoregressive, moving average process is such a ratio.)

"""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from .evidence import Evidence
from .kinds import Parameter, Response
from ..core.spectrum import Bins, expected
from ..loop.effect import Effect

OPEN = '(response)'  # label of the response that is left open
_POSITIVE = 1e-4  # of its largest value, to which P or Q are raised where they begin below zero
_FLOOR = 1e-9  # of P and Q
_BAND = np.array([0.0, -4.0, 0.0, 1.0])  # 128 u^2 (1 - u)^2 in t_1 ... t_4, of z as of u
DEEP = 1e-3  # gain^2 below which something else shows: rounding, what leaks from other bands
_STEPS, _ENOUGH = 40, 1e-3


class Order(NamedTuple):
    """
    Degrees of P and Q.

    ``tied``: gain 1 at Nyquist as at zero, as beside something that is added in the middle; 2
    where that falls with the fourth power of f on either side: P - Q = h u^2 (1 - u)^2.
    ``middle``: of that, in u; where both degrees are the same P and Q may as well be polynomials
    in z = u (1 + middle)/(u + middle), of which a band at low frequencies lies in the middle: in
    u its values would be a hundred million times as large as what they add up to.
    ``alone``: what is added has poles alone, P - Q is constant, as beside a swing that is read as
    a displacement; its slow side is white.

    """

    zeros: int = 0
    poles: int = 0
    tied: int = 0
    middle: float = np.inf
    alone: bool = False

    @property
    def rivals(self) -> list[Order]:
        """What else it may be: something added with as many zeros and poles, or one less."""
        if not self.tied and not self.alone and self.terms > 1:
            less = [self._replace(zeros=self.zeros - 1), self._replace(poles=self.poles - 1)]
        else:
            less = []
        less = [o for o in less if min(o.zeros, o.poles) >= 0]
        if self.zeros != self.poles or self.poles < 2:
            return less
        own = self._replace(tied=0, alone=False)
        some = [own._replace(tied=k) for k in range(3 if self.poles == 4 else 2)]
        some.append(own._replace(alone=True, middle=np.inf))
        return [*(o for o in some if o != self), *less]

    @property
    def terms(self) -> int:
        """Values that are free."""
        known = self.alone or self.tied == 2
        return self.poles + 1 if known else self.zeros + self.poles - self.tied

    @property
    def twice(self) -> bool:
        """Whether it may have several minima: a resonance has two zeros and two poles."""
        return min(self.zeros, self.poles) >= 2

    def within(self, other: Order) -> bool:
        """Tell whether another order, higher or tied, can begin with its values."""
        return self != other and self.zeros <= other.zeros and self.poles <= other.poles

    def about(self, middle: float) -> Order:
        """Return the same about a band, if it is what one has beside it."""
        return self._replace(middle=middle) if self.tied and self.zeros == self.poles else self

    def variable(self, u: np.ndarray) -> np.ndarray:
        """Return z of u."""
        return u if np.isinf(self.middle) else u * (1 + self.middle) / (u + self.middle)

    def share(self, u: np.ndarray) -> np.ndarray:
        """Return what a polynomial in u is multiplied by to be one in z."""
        return (1 + u / self.middle) ** -float(max(self.zeros, self.poles))


class OpenResponse(Response):
    """A nuisance: gain^2 = (1 + sum p_j t_j(u))/(1 + sum q_j t_j(u)), t_j = T_j(2u-1)-T_j(-1)."""

    last = True
    leaks = False
    order = Order()

    def gain2(self, f: np.ndarray, dt: float) -> np.ndarray:
        """Return the squared gain, between floors where the values make none."""
        top, bottom, _ = self._both(f, dt)
        return np.maximum(top, _FLOOR) / np.maximum(bottom, _FLOOR)

    @property
    def _free(self):
        return np.array([self[p.name] for p in self.parameters])

    def _both(self, f, dt):
        """Return (P, Q, their terms (..., most)) at f."""
        zeros, poles = self.order[:2]
        values = _full(self.order, self._free)
        t = _terms(self.order, np.sin(np.pi * np.asarray(f, float) * dt) ** 2)
        return 1 + t[..., :zeros] @ values[:zeros], 1 + t[..., :poles] @ values[zeros:], t

    def slopes(self, bins: Bins) -> np.ndarray:
        """Return d ln v/d value in the bins, (b, p), of a spectrum that is white before it."""
        zeros, poles = self.order[:2]

        def change(f):
            p, q, t = self._both(f, bins.dt)
            top, bottom = np.maximum(p, _FLOOR), np.maximum(q, _FLOOR)
            return np.concatenate([t[:, :zeros] * ((p > _FLOOR) / bottom)[:, None],
                                   -t[:, :poles] * ((q > _FLOOR) * top / bottom**2)[:, None]],
                                  axis=1)
        v = expected(lambda f: self.gain2(f, bins.dt), bins)
        return expected(change, bins) / v[:, None] @ _mixing(self.order, self._free)

    def starts(self, evidence: Evidence) -> list[Effect]:
        """Return what it has, or no response at all."""
        return [self.with_values(**{p.name: self.values.get(p.name, 0.0)
                                    for p in self.parameters})]


@lru_cache(maxsize=64)
def open_response(order: Order) -> OpenResponse:
    """Return the response of an order, its values open."""
    terms = tuple(Parameter(f'a{j}', '1', -1e9, 1e9, log=False)
                  for j in range(1, order.terms + 1))
    kind = type('Open', (OpenResponse,), {'parameters': terms, 'order': order})
    return kind({}, OPEN)


def beside_a_band(low: float, high: float, more: float) -> tuple[Order, np.ndarray]:
    """
    Return the response that white noise has beside a band of noise, its order and values (p,).

    Parameters
    ----------
    low, high : float
        Edges of the band at half of its power, as shares of Nyquist.
    more : float
        Its power over that of the white noise.

    """
    order = Order(4, 4, 2, float(np.sin(np.pi / 2 * np.sqrt(low * high)) ** 2))
    u = _nodes(order)
    # The band is a Butterworth filter of second order by the bilinear transform: in terms of
    # w^2 = tan^2(pi f dt) = u / (1 - u) its gain^2 is 1 / (1 + ((w^2 - centre) / (width w))^4).
    edges = np.tan(np.pi / 2 * np.array([low, high]))
    centre, width = edges[0] * edges[1], edges[1] - edges[0]
    top = (width * width * u * (1 - u)) ** 2
    bottom = (u - centre * (1 - u)) ** 4 + top
    p, q = (_polynomial(order, 4, u, x / centre ** 4) for x in (bottom + more * top, bottom))
    return order, np.append((p - q) @ _BAND / (_BAND @ _BAND), q)


def _nodes(order: Order) -> np.ndarray:
    """Return u (16,) at which polynomials in z are told apart best."""
    z = 0.5 + 0.5 * np.cos(np.pi * (np.arange(16) + 0.5) / 16)
    return z if np.isinf(order.middle) else z * order.middle / (1 + order.middle - z)


def _polynomial(order: Order, degree: int, u: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return the values (degree,) of what is x (16,) at some u as a polynomial in u."""
    return np.linalg.lstsq(_terms(order, u)[:, :degree], x * order.share(u) - 1, rcond=None)[0]


@lru_cache(maxsize=64)
def _linear(order: Order) -> np.ndarray:
    """Return what makes (p_1 ..., q_1 ...) of the values of an order that is not ``alone``."""
    out = np.eye(order.zeros + order.poles)
    if order.tied == 2:
        one = np.eye(order.poles)
        return np.block([[_BAND[:, None], one], [0 * _BAND[:, None], one]])
    if order.tied:  # P(1) = Q(1), where t_j is 2 for odd j and 0 for even
        degree = np.concatenate([np.arange(1, order.zeros + 1), np.arange(1, order.poles + 1)])
        sign = np.where(np.arange(len(degree)) < order.zeros, -1.0, 1.0)
        out[0] = np.where(degree % 2, sign, 0.0)
        out = out[:, 1:]
    return out


def _full(order: Order, values: np.ndarray) -> np.ndarray:
    """Return (p_1 ..., q_1 ...) of the free values: p = (1 - s) q of (s, q_1 ...) if ``alone``."""
    if order.alone:
        return np.append((1 - values[0]) * values[1:], values[1:])
    return _linear(order) @ values


def _mixing(order: Order, values: np.ndarray) -> np.ndarray:
    """Return the derivatives (zeros + poles, terms) of :func:`_full`."""
    if order.alone:
        one, q = np.eye(order.poles), values[1:, None]
        return np.block([[-q, (1 - values[0]) * one], [0 * q, one]])
    return _linear(order)


def raised_to(order: Order, lower: Order, values: np.ndarray) -> np.ndarray:
    """Return the values of a lower order as those of an order that holds it, or comes near."""
    full = _full(lower, values)
    if order.middle == lower.middle:
        p = np.append(full[:lower.zeros], np.zeros(order.zeros - lower.zeros))
        q = np.append(full[lower.zeros:], np.zeros(order.poles - lower.poles))
    else:
        u = _nodes(order)
        t = _terms(lower, u)
        p, q = (_polynomial(order, degree, u, 1 + t[:, :len(some)] @ some) for degree, some in (
            (order.zeros, full[:lower.zeros]), (order.poles, full[lower.zeros:])))
    if order.alone:
        return np.append(1 - p @ q / max(q @ q, 1e-300), q)
    if order.tied == 2:
        return np.append((p - q) @ _BAND / (_BAND @ _BAND), q)
    return np.append(p, q)[order.tied:]


def _terms(order: Order, u: np.ndarray) -> np.ndarray:
    """Return T_j(2z-1) - T_j(-1) for j = 1 ... as many as it has, (..., most)."""
    x = 2 * order.variable(u) - 1
    before, now, out = np.ones_like(x), x, []
    for j in range(1, max(order.zeros, order.poles) + 1):
        out.append(now - (-1) ** j)
        before, now = now, 2 * x * now - before
    return np.stack(out, axis=-1) if out else np.zeros((*np.shape(u), 0))


class Rational:
    """
    The most likely rational response to what a model leaves: x = measured/model power.

    Parameters
    ----------
    x : ndarray (b,)
        Measured over a model's power, whose level is left free as well.
    w : ndarray (b,)
        What each counts.
    bins : Bins
    order : Order

    """

    def __init__(self, x: np.ndarray, w: np.ndarray, bins: Bins, order: Order):
        self.x, self.w, self.order = x, w, order
        # a wide bin is two points (Gauss), as it is where the response is fitted
        reach = np.where(bins.count > 1, bins.count, 0) / (2 * bins.n * bins.dt) / np.sqrt(12)
        f = bins.f[:, None] + np.outer(reach, (-1, 1))
        t = _terms(order, np.sin(np.pi * f * bins.dt) ** 2)
        self._top, self._bottom = t[..., :order.zeros], t[..., :order.poles]

    def fit(self, near: Iterable[tuple[Order, np.ndarray]] = (),
            ) -> tuple[np.ndarray, float, np.ndarray] | None:
        """
        Return (values (terms,), level, v = level gain^2 (b,)); None where there is none.

        ``near`` are (order, values) of lower orders to start from as well. By Fisher scoring of
        -ln L = 1/2 sum w (ln v + x/v).

        """
        raised = [self._raised(np.append(np.log(np.median(self.x)), raised_to(self.order, *one)))
                  for one in near]
        ended = []
        for some in ([*self._begun()], raised):
            begun = [(c, a) for c, a in ((self._cost(a), a) for a in some) if np.isfinite(c)]
            if begun:
                ended.append(self._descended(*min(begun, key=lambda z: z[0])))
        if not ended:
            return None
        _, a = min(ended, key=lambda z: z[0])
        return a[1:], float(np.exp(a[0])), self._slopes(a)[0]

    def _descended(self, best, a):
        """Return (-ln L, ln level and values) of the minimum reached from a point."""
        damping = 1e-3
        for _ in range(_STEPS):
            v, slopes = self._slopes(a)
            jac = np.column_stack([np.ones(len(v)), slopes @ _mixing(self.order, a[1:])])
            information = (jac * self.w[:, None]).T @ jac
            gradient = jac.T @ (self.w * (1 - self.x / v))
            scale = np.maximum(np.diag(information), 1e-12)
            gain = 0.0
            while damping < 1e6:
                trial = a - np.linalg.solve(information + damping * np.diag(scale), gradient)
                cost = self._cost(trial)
                if cost <= best:
                    gain, best, a = best - cost, cost, trial
                    break
                damping *= 10
            damping = max(damping / 10, 1e-9)
            if gain < _ENOUGH:
                break
        return best, a

    def _split(self, a):
        """Return (P, Q) of (ln level, values)."""
        values, zeros = _full(self.order, a[1:]), self.order.zeros
        top = np.maximum(1 + self._top @ values[:zeros], _FLOOR)
        return top, 1 + self._bottom @ values[zeros:]

    def _cost(self, a):
        """Return -ln L, infinite where P or Q are no power."""
        p, q = self._split(a)
        if not (np.all(q > 0) and abs(a[0]) < 50):
            return np.inf
        v = np.exp(a[0]) * np.mean(p / q, axis=1)
        return 0.5 * float(np.sum(self.w * (np.log(v) + self.x / v)))

    def _slopes(self, a):
        """Return v (b,) and d ln v/d (p_1 ..., q_1 ...), (b, zeros + poles)."""
        p, q = self._split(a)
        v = np.mean(p / q, axis=1)
        slopes = np.concatenate([self._top * (p > _FLOOR)[..., None] / q[..., None],
                                 -self._bottom * (p / q**2)[..., None]], axis=-1)
        return np.exp(a[0]) * v, np.mean(slopes, axis=1) / v[:, None]

    def _begun(self):
        """
        Yield (ln level, values) to start from.

        No response, and what linear least squares of Q x against P give, weighted by the one
        before (Sanathanan and Koerner 1963).

        """
        level = float(np.median(self.x[:max(8, len(self.x) // 8)]))
        order = self.order._replace(alone=False)
        yield np.append(np.log(level), np.zeros(self.order.terms))
        root, p = np.sqrt(self.w), self.x / level
        top, bottom = (np.mean(t, axis=1) for t in (self._top, self._bottom))
        for _ in range(8):
            x = np.clip(self.x / level, _FLOOR, 1 / _FLOOR)
            scale = root / np.maximum(np.abs(p), np.maximum(1e-3 * x, _FLOOR))
            rows = np.concatenate([top, -bottom * x[:, None]], axis=1) @ _linear(order)
            rows = np.column_stack([np.ones(len(x)), rows]) * scale[:, None]
            norm = np.maximum(np.sqrt(np.sum(rows**2, axis=0)), 1e-300)
            a = np.linalg.lstsq(rows / norm, (x - 1) * scale, rcond=1e-12)[0] / norm
            level *= float(np.clip(1 + a[0], 0.5, 2)) if np.isfinite(a[0]) else 1.0
            a = np.append(np.log(level), raised_to(self.order, order, a[1:]))
            yield a
            yield self._raised(a)
            p = np.mean(self._split(a)[0], axis=1)

    def _raised(self, a):
        """Return the same with P and Q raised until they are positive."""
        out, (p, q) = a.copy(), self._split(a)
        low = max(0.0, *(_POSITIVE * np.max(z) - np.min(z) for z in (p, q)))
        out[1 + self.order.alone:] /= 1 + low
        return out
