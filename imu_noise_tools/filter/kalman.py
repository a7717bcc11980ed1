# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
One linear model: the recursion (Joseph form), its steady state, and a recorded series through it.

Fading memory (alpha < 1) weighs the past down: P^- = Phi P Phi^T/alpha + Q.

"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .statespace import StateSpace

BLOCK = 64  # samples per matrix product: a triangle this large still costs less than a Python loop
SETTLED = (
    1e-10  # relative change of the covariance at which the recursion has become its steady state
)
LOG_2PI = float(np.log(2 * np.pi))


def predict(
    space: StateSpace, x: Any, p: Any, alpha: float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """Return (x, P) one interval later; x (d,) or (d, axes)."""
    return space.phi @ x, space.phi @ p @ space.phi.T / alpha + space.q


def update(
    space: StateSpace, x: np.ndarray, p: np.ndarray, z: Any
) -> tuple[np.ndarray, np.ndarray, Any, float]:
    """
    Return (x, P, innovation, S) with the sample z weighed in; Joseph form.

    P = (I - K H) P (I - K H)^T + K R K^T stays symmetric and positive whatever the gain's
    rounding.

    """
    ph = p @ space.h
    s = float(space.h @ ph) + space.r
    gain = ph / s
    innovation = z - space.h @ x
    keep = np.eye(space.size) - np.outer(gain, space.h)
    p = keep @ p @ keep.T + space.r * np.outer(gain, gain)
    return (
        x + (np.outer(gain, innovation) if np.ndim(x) > 1 else gain * innovation),
        0.5 * (p + p.T),
        innovation,
        s,
    )


@dataclass(frozen=True)
class Steady:
    """
    A filter in steady state.

    Covariance predicted and after the update, gain (d,), variance of the innovations.

    """

    space: StateSpace
    predicted: np.ndarray
    gain: np.ndarray
    s: float
    after: np.ndarray
    closed: np.ndarray           # (I - K H) Phi

    @property
    def variance(self) -> float:
        """Variance of the rate."""
        return float(self.space.rate @ self.after @ self.space.rate)


def riccati(phi: np.ndarray, q: np.ndarray, h: np.ndarray, r: float, alpha: float = 1.0,
            doublings: int = 50) -> np.ndarray | None:
    """
    Return the predicted covariance P^- in steady state, or None where there is none.

    Structure-preserving doubling (Chu, Fan, Lin, Wang 2004): step k gives the covariance after 2^k
    samples.

    """
    a, g, p = phi.T / np.sqrt(alpha), np.outer(h, h) / r, np.array(q, float)
    eye = np.eye(len(h))
    scale = np.sqrt(r)
    for _ in range(doublings):
        w = eye + g @ p
        try:
            both = np.linalg.solve(w, np.concatenate([a, g], axis=1))
        except np.linalg.LinAlgError:
            return None
        v, u = both[:, :len(h)], both[:, len(h):]
        new = p + a.T @ p @ v
        g = g + a @ u @ a.T
        a = a @ v
        change = np.max(np.abs(new - p))
        p = 0.5 * (new + new.T)
        g = 0.5 * (g + g.T)
        if not np.isfinite(change):
            return None
        if change <= 1e-13 * max(np.max(np.abs(p)), 1e-30 * scale):
            break
    else:
        return None
    return p


def steady_state(space: StateSpace, alpha: float = 1.0) -> Steady | None:
    """
    Return the steady state of a model, or None where it has none.

    It has none where nothing drives one of its states: the gain never settles.

    The gain is right where (I - K H) Phi/sqrt(alpha) is stable (Anderson, Moore 1979, ch. 4).

    """
    p = riccati(space.phi, space.q, space.h, space.r, alpha)
    if p is None:
        return None
    ph = p @ space.h
    s = float(space.h @ ph) + space.r
    gain = ph / s
    keep = np.eye(space.size) - np.outer(gain, space.h)
    closed = keep @ space.phi
    if np.max(np.abs(np.linalg.eigvals(closed))) >= np.sqrt(alpha) * (1 - 1e-7):
        return None
    after = keep @ p @ keep.T + space.r * np.outer(gain, gain)
    return Steady(space, p, gain, s, after, closed)


def _powers(a: np.ndarray, b: int) -> np.ndarray:
    """Return a^0 ... a^b, (b + 1, d, d), by doubling."""
    out, last = np.eye(len(a))[None], a
    while len(out) <= b:
        out = np.concatenate([out, out @ last])
        last = last @ last
    return out[:b + 1]


def innovations_of(steady: Steady, z: np.ndarray, x: np.ndarray) -> np.ndarray:
    """
    Return the innovations at constant gain, of the shape of z.

    Of samples z (n,) or (n, axes), from the state x (d,) or (d, axes) on.

    """
    return _Blocks(steady, z, x).of(_to_innovations)


class _Blocks:
    """
    Samples in blocks, the last filled up with zeros, and the state before each, at constant gain.

    In steady state the filter is an IIR filter; it is run by blocks of matrix products, which stay
    exact for poles crowded at 1, where polynomial coefficients (lfilter) lose digits.

    """

    def __init__(self, steady, z, x):
        self.steady, self.shape = steady, z.shape
        z, x = z.reshape(len(z), -1), np.reshape(x, (steady.space.size, -1))
        n, axes = z.shape
        b = min(BLOCK, n) or 1
        count = -(-n // b)
        self.powers = _powers(steady.closed, b)
        self.drive = self.powers[b - 1::-1] @ steady.gain  # a block's samples to its last state
        # one row a block and axis, so that each step is one large matrix product
        self.rows = np.zeros((count, b, axes))
        self.rows.reshape(-1, axes)[:n] = z
        self.rows = self.rows.transpose(0, 2, 1).reshape(count * axes, b)
        pushed = (self.rows @ self.drive).reshape(count, axes, -1).transpose(0, 2, 1)
        self.states = np.concatenate([x[None], pushed])
        step, gap = self.powers[b], 1       # sums of 2, 4, 8 ... blocks: a few products for all
        while gap <= count:
            self.states[gap:] = self.states[gap:] + step @ self.states[:-gap]
            step, gap = step @ step, 2 * gap

    def of(self, response: Any) -> np.ndarray:
        """Return what a response makes of all, like z."""
        of_state, of_samples = response(self.steady, self.powers)
        count, b = len(self.states) - 1, len(of_state)
        before = self.states[:-1].transpose(0, 2, 1).reshape(len(self.rows), -1)
        found = before @ of_state.T + self.rows @ of_samples.T
        whole = found.reshape(count, -1, b).transpose(0, 2, 1).reshape(count * b, -1)
        return whole[:self.shape[0]].reshape(self.shape)

    def end(self) -> np.ndarray:
        """Return the state after the last sample."""
        count, b = len(self.states) - 1, len(self.drive)
        if not count:
            return self.states[0].reshape(-1, *self.shape[1:])
        left = self.shape[0] - (count - 1) * b
        last = self.rows.reshape(count, -1, b)[-1, :, :left]
        x = self.powers[left] @ self.states[-2] + (last @ self.drive[b - left:]).T
        return x.reshape(-1, *self.shape[1:])


def _to_rate(steady: Steady, powers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what makes the rates of a block of its first state (b, d) and samples (b, b)."""
    rate = steady.space.rate
    return rate @ powers[1:], _lower(rate @ powers[:-1] @ steady.gain)


def _to_innovations(steady: Steady, powers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the same of the innovations."""
    of_state = -(steady.space.h @ steady.space.phi @ powers[:-1])
    return of_state, _lower(np.concatenate([[1.0], of_state[:-1] @ steady.gain]))


def _lower(response: np.ndarray) -> np.ndarray:
    """Return the matrix of a response by lag: samples to what follows them."""
    lag = np.subtract.outer(np.arange(len(response)), np.arange(len(response)))
    return np.where(lag >= 0, response[np.maximum(lag, 0)], 0.0)


@dataclass(frozen=True)
class Run:
    """
    A filtered stretch, (n,) each.

    Rate, its variance, innovations and theirs; (x, P) is the state at its end.

    """

    rate: np.ndarray
    variance: np.ndarray
    innovations: np.ndarray
    s: np.ndarray
    x: np.ndarray
    p: np.ndarray


def resume(space: StateSpace, z: np.ndarray, x: np.ndarray, p: np.ndarray, alpha: float = 1.0,
           steady: Steady | None = None) -> Run:
    """
    Filter evenly spaced z (n,) from the prediction (x, P) of its first sample.

    Recursion, then steady state.

    """
    n = len(z)
    out = np.empty((4, n))
    for k in range(n):
        if k:
            before = x
            x, p = predict(space, x, p, alpha)
            if steady and np.max(np.abs(p - steady.predicted)) <= SETTLED * np.max(
                np.abs(steady.predicted)
            ):
                rest = _Blocks(steady, z[k:], before)
                out[:, k:] = (rest.of(_to_rate), np.full(n - k, steady.variance),
                              rest.of(_to_innovations), np.full(n - k, steady.s))
                x, p = rest.end(), steady.after
                break
        x, p, nu, s = update(space, x, p, z[k])
        out[:, k] = space.rate @ x, space.rate @ p @ space.rate, nu, s
    rate, variance, innovations, s = out
    return Run(rate, variance, innovations, s, x, p)


def log_likelihood(innovations: np.ndarray, s: Any) -> float:
    """
    Return the log-likelihood of innovations (n,) with variances s.

    The prediction-error decomposition.

    """
    s = np.broadcast_to(s, np.shape(innovations))
    return float(-0.5 * np.sum(LOG_2PI + np.log(s) + innovations ** 2 / s))
