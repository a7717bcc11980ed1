# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The orthonormal DCT-II of a record, its power in bins, and what a finite record does to a spectrum.

c_k = sum_j y_j phi_k(j), phi_k(j) = sqrt(2/n) cos(pi k (j + 1/2)/n), so that f_k = k/(2 n dt) and
I_k = 2 dt c_k^2 is a one-sided periodogram. The even extension of the cosines has no jump at the
ends: red noise does not leak as it does in a Fourier periodogram, and no taper throws data away.

"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.fft import dct as _dct
from scipy.special import digamma

SINGLE = 256  # coefficients kept one by one
PER_DECADE = 40  # bins a decade above
LINEAR = 128  # no bin is wider than 1/128 of Nyquist: filters act on a linear scale
ROW_BLOCKS = 4  # of a triangle, which hold little of its empty half
NEAR = 24   # cycles in the record up to which their window is near
CORRECTED = 32  # coefficients whose expectation differs noticeably from the spectrum at f_k
MIDDLE = 0.05, 0.95  # of a power: between these it is in a band
OCTAVE = 2.0  # f/f: no wider is a band of one source


@dataclass(frozen=True, eq=False)
class Bins:
    """
    Bins of DCT coefficients of an n-sample record.

    [first, last) for each, ``count`` of them in each.

    All arrays (b,). The mean (k = 0) is in none. ``fine`` are edges (Hz) beside the usual ones.
    ``ended``: what leaks into the lowest from far above was taken out of them.

    """

    n: int
    dt: float
    first: np.ndarray
    last: np.ndarray
    fine: tuple[float, ...] = ()
    ended: bool = False

    @property
    def count(self) -> np.ndarray:
        """Coefficients in each bin, (b,)."""
        return self.last - self.first

    @property
    def f(self) -> np.ndarray:
        """Centre of each bin, (b,), Hz."""
        return (self.first + self.last - 1) / (4 * self.n * self.dt)

    def mean(self, values: np.ndarray) -> np.ndarray:
        """Average values of all coefficients k = 0 ... n-1 over each bin; (n,) -> (b,)."""
        return np.add.reduceat(values[: self.last[-1]], self.first) / self.count

    def log_level(self, power: np.ndarray) -> np.ndarray:
        """
        Return the logarithm of the level (b,) that a power (b,) tells, in the mean.

        Chi-squared of w degrees of freedom over w has a logarithm of the mean digamma(w/2) -
        ln(w/2), which is below zero, and far below it where they are few.

        """
        half = self.count / 2
        return np.log(np.maximum(power, 1e-300)) - digamma(half) + np.log(half)

    def between(self, v: np.ndarray, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return how many coefficients are between edges (k + 1,), Hz, and the mean of v (b,)."""
        at = np.clip(edges * 2 * self.n * self.dt, 1, self.n)
        total = np.interp(at, np.append(self.first, self.n),
                          np.concatenate([[0.0], np.cumsum(v * self.count)]))
        count = np.diff(at)
        return count, np.maximum(np.diff(total) / np.maximum(count, 1e-9), 1e-300)

    def index(self, k: Any) -> np.ndarray:
        """Return the bin that holds each coefficient k (1 <= k < n), of the shape of k."""
        return np.searchsorted(self.first, k, side='right') - 1


@lru_cache(maxsize=32)
def bins_of(n: int, dt: float, fine: tuple[float, ...] = (), ended: bool = False) -> Bins:
    """
    Return the bins of an n-sample record at interval dt.

    With edges of their own (``fine``, Hz) where the spectrum asks for narrower ones; ``ended`` as
    :class:`Bins` has it.

    """
    single = np.arange(1, min(SINGLE, n - 1) + 1)
    edges = [single]
    k = single[-1] + 1
    step = 10 ** (1 / PER_DECADE) - 1
    more = []
    while k < n:
        more.append(k)
        k += max(1, min(int(k * step), max(1, n // LINEAR)))
    if len(more) > 1 and n - more[-1] < 0.5 * (more[-1] - more[-2]):
        more.pop()
    edges.append(np.array(more, int))
    if fine:
        some = np.round(2 * n * dt * np.array(fine)).astype(int)
        edges.append(some[(some > single[-1]) & (some < n)])
    first = np.unique(np.concatenate(edges))
    return Bins(n, dt, first, np.append(first[1:], n), fine, ended)


def band_of(power: np.ndarray, f: np.ndarray) -> tuple[float, float]:
    """Return between which of the frequencies f (b,), Hz, nearly all of a power (b,) is."""
    total = np.cumsum(power)
    low, high = f[np.searchsorted(total, np.array(MIDDLE) * total[-1])]
    return float(low), float(high)


def cosine_transform(y: np.ndarray) -> np.ndarray:
    """Return c_k of y less its mean, (n,) -> (n,); c_0 is zero."""
    return _dct(y - np.mean(y), type=2, norm='ortho', overwrite_x=True)


def power(c: np.ndarray, dt: float, bins: Bins) -> np.ndarray:
    """Return the one-sided PSD of coefficients c (n,) averaged over bins, (b,), unit^2/Hz."""
    return bins.mean(2 * dt * c * c)


@lru_cache(maxsize=8)
def _finite_kernel(ended: bool) -> tuple[np.ndarray, np.ndarray]:
    """
    Return (x, W): E[I_k] = sum_x W[k-1, x] S(x/T) for k = 1 to CORRECTED.

    T is the length of the record.

    W_k(x) = 2 |Phi_k(x)|^2, Phi_k the Fourier transform of sqrt(2) cos(pi k u) on 0 < u < 1:
    |Phi_k|^2 = 2 (2 pi x)^2 4 {sin^2, cos^2}(pi x) / ((2 pi x)^2 - (pi k)^2)^2 for even, odd k. A
    midpoint rule to x = 24, then the mean of the oscillation on a log grid; scaled so that white
    noise passes unchanged. Without what is beyond 24 where the record is ``ended``.

    """
    step = 1 / 16
    near = step * (np.arange(int(NEAR / step)) + 0.5)
    edges = np.geomspace(NEAR, 2e4, 41)
    far = np.sqrt(edges[1:] * edges[:-1])
    x = np.concatenate([near, far])
    width = np.concatenate([np.full(len(near), step), np.diff(edges)])
    k = np.arange(1, CORRECTED + 1)[:, None]
    w = 2 * np.pi * x
    wave = np.where(k % 2 == 0, np.sin(np.pi * x) ** 2, np.cos(np.pi * x) ** 2)
    wave[:, len(near):] = 0.0 if ended else 0.5
    weight = 16 * w**2 * wave / (w**2 - (np.pi * k) ** 2) ** 2 * width
    return x, weight / weight.sum(axis=1, keepdims=True)


def expected(psd: Callable[[np.ndarray], np.ndarray], bins: Bins) -> np.ndarray:
    """
    Return what ``power`` is expected to be in each bin for a one-sided PSD, (b,).

    The first coefficients see the spectrum through the record's own window, which takes away part
    of a red spectrum (flicker .774, .903, .931 ... of the value at f_k).

    Parameters
    ----------
    psd : callable
        f (Hz) -> one-sided PSD of the sampled process.
    bins : Bins
        Of the record.

    """
    return gathered(psd(asked(bins)), bins)


def asked(bins: Bins) -> np.ndarray:
    """Return the frequencies (Hz) at which :func:`gathered` wants a spectrum, (g,)."""
    return _grid(bins.n, bins.dt, bins.fine, bins.ended)[0]


def gathered(s: np.ndarray, bins: Bins) -> np.ndarray:
    """Return :func:`expected` of what is known where it is asked for, (g, ...) -> (b, ...)."""
    _, weight, alone, pairs = _grid(bins.n, bins.dt, bins.fine, bins.ended)
    return np.concatenate(
        [weight @ s[: weight.shape[1]], s[alone], 0.5 * (s[pairs[0]] + s[pairs[1]])]
    )


@lru_cache(maxsize=32)
def _grid(
    n: int, dt: float, fine: tuple[float, ...], ended: bool
) -> tuple[np.ndarray, np.ndarray, slice, tuple[slice, slice]]:
    """
    Return the frequencies that ``expected`` asks for and the window's weights.

    With them comes where single bins and pairs are.

    """
    bins = bins_of(n, dt, fine)
    x, weight = _finite_kernel(ended)
    low = min(CORRECTED, len(bins.first))
    single = int(np.searchsorted(bins.count, 2))  # the bins that hold one coefficient come first
    # wide bins by Gauss' two points: a filter may go to zero at Nyquist within one of them
    reach = np.where(bins.count > 1, bins.count, 0)[single:] / (2 * n * dt) / np.sqrt(12)
    centre = bins.f[single:]
    parts = [
        np.minimum(x / (n * dt), 0.5 / dt),
        bins.f[low:single],
        centre - reach,
        centre + reach,
    ]
    at = np.cumsum([0, *(len(p) for p in parts)])
    alone, first, second = (slice(at[i], at[i + 1]) for i in (1, 2, 3))
    return np.concatenate(parts), weight[:low], alone, (first, second)


def leaked(v: np.ndarray, bins: Bins, along: np.ndarray | None = None) -> np.ndarray:
    """
    Return what reaches each bin from the bins far below it through the record's ends, (b,).

    The even extension of the cosines has a kink at each end, and what leaks through it falls only
    as 1/f^2 of the amplitude: behind a filter that leaves nothing near Nyquist, this is what is
    measured there. White noise leaks as much as it loses: nothing is added to it.

    Parameters
    ----------
    v : ndarray (b,)
        The expected power of the bins.
    bins : Bins
        Of the record.
    along : ndarray (b, p) or None
        Changes of v: then how much more leaks with each is returned, (b, p).

    """
    blocks, own = _leakage(bins.n, bins.dt, bins.fine)

    def net(v: np.ndarray) -> np.ndarray:
        return np.concatenate([w @ v[:w.shape[1]] for w in blocks]) - (own * v.T).T

    if along is None:
        return np.maximum(net(v), 0.0)
    more = net(np.column_stack([v, along]))
    return np.where(more[:, :1] > 0, more[:, 1:], 0.0)


def leaked_beside(v: np.ndarray, bins: Bins, inside: np.ndarray) -> np.ndarray:
    """
    Return what reaches the bins beside some from these through the record's ends, (b,).

    From far below and from above, by the formula of :func:`leaked`, the middle of a bin for all of
    it; not from an octave above where that was taken out.

    Parameters
    ----------
    v : ndarray (b,)
        The power of the bins.
    bins : Bins
        Of the record.
    inside : ndarray (b,) of bool
        Those that it leaks from; to them is nothing told.

    """
    out = np.zeros(len(v))
    share = _through_ends(bins, ~inside, inside)
    if bins.ended:
        share[bins.f[inside] > 2 * bins.f[~inside][:, None]] = 0.0
    out[~inside] = share @ v[inside]
    return out


def from_above(v: np.ndarray, bins: Bins) -> np.ndarray:
    """
    Return what reaches each bin from the bins an octave above and more, (b, b), of each its part.

    By the formula of :func:`leaked`, of the power v (b,) of the bins.

    """
    above = bins.f > 2 * bins.f[:, None]
    return np.where(above, _through_ends(bins) * v, 0.0)


@lru_cache(maxsize=8)
def _leakage(n: int, dt: float, fine: tuple[float, ...]) -> tuple[list[np.ndarray], np.ndarray]:
    """
    Return (w, own): the power that bin b takes from bin j is w[b, j] of its own.

    In blocks of bins (b, low), for what lies above leaks into nothing.

    """
    bins = bins_of(n, dt, fine)
    w = np.where(bins.f < 0.5 * bins.f[:, None], _through_ends(bins), 0.0)
    w[:CORRECTED] = 0.0  # their window is integrated as it is
    blocks = [np.ascontiguousarray(
        rows[:, :1 + int(np.max(np.flatnonzero(rows.any(axis=0)), initial=-1))])
        for rows in np.array_split(w, ROW_BLOCKS)]
    return blocks, w.sum(axis=1)


def _through_ends(bins: Bins, to: Any = slice(None), by: Any = slice(None)) -> np.ndarray:
    """
    Return w: the power that a bin of ``to`` takes from a bin of ``by`` is w[to, by] of its own.

    |Phi_k(omega)|^2 = (8/n) {sin, cos}^2(n omega/2) sin^2(omega/2) cos^2(theta/2) /
    (cos omega - cos theta)^2, theta = pi k/n, Phi_k the Fourier transform of the cosine k; its
    mean over the oscillation, integrated over each bin far from theta.

    """
    theta = 2 * np.pi * bins.f * bins.dt
    wave = (np.sin(theta / 2) ** 2 * bins.count)[by] / (2 * bins.n * bins.dt)
    gap = np.cos(theta[to])[:, None] - np.cos(theta[by])
    gap[gap == 0] = np.inf
    return 8 * bins.dt / bins.n * np.cos(theta[to] / 2)[:, None] ** 2 * wave / gap**2


def folded(f: Any, dt: float) -> Any:
    """Return where frequencies appear in samples at interval dt: from 0 to Nyquist, Hz."""
    return abs((f * dt + 0.5) % 1 - 0.5) / dt


def line_basis(frequency: float | complex | np.ndarray, k: np.ndarray, n: int, dt: float,
               begin: int | np.ndarray = 0, end: int | np.ndarray | None = None) -> np.ndarray:
    """
    Return the coefficients c_k (k >= 1) of cos(w t) + i sin(w t), t = j dt, w = 2 pi frequency.

    From the geometric sums: with alpha = w dt, the sum of e^{i alpha j} cos(theta (j + 1/2)),
    theta = pi k/n, is half the sum of two Dirichlet kernels. Frequency, k, begin and end are
    broadcast, and the coefficients, complex, are of that shape; of a line that is there in the
    samples [begin, end) alone, the sum over those. Frequency in Hz, dt in s; of frequency +
    i rate/(2 pi) both waves fade by e^(-rate t), rate in 1/s, or swell.

    """
    frequency = np.asarray(frequency)
    fades = np.iscomplexobj(frequency)
    if not fades and np.all(np.equal(begin, 0)) and (end is None or np.all(np.equal(end, n))):
        return _whole_line(2 * n * dt * frequency, np.asarray(k), n)
    last = n if end is None else end
    count, middle = last - begin, begin + last - 1
    alpha = 2 * np.pi * frequency * dt
    theta = np.pi * np.asarray(k, float) / n
    total = 0
    for sign in (1, -1):
        # sum_j<n e^{i (alpha + sign theta) j} = e^{i phi (n-1)/2} sin(n phi/2)/sin(phi/2)
        half = 0.5 * (alpha + sign * theta)
        s = np.sin(half)
        small = np.abs(s) < 1e-12
        kernel = np.where(small, count * np.cos(count * half),
                          np.sin(count * half) / np.where(small, 1.0, s))
        total = total + 0.5 * np.exp(1j * (half * middle + sign * 0.5 * theta)) * kernel
    return np.sqrt(2 / n) * total


def _whole_line(at: np.ndarray, k: np.ndarray, n: int) -> np.ndarray:
    """
    Return what :func:`line_basis` does of a line that is there throughout, in half the time.

    ``at`` is its frequency in coefficients, alpha n/pi. As theta n is k pi, sin(n phi/2) and the
    phases are those of the line alone, and only the denominators are of each coefficient.

    """
    turn = 0.5 * np.pi * np.mod(at, 4)
    sine, cosine, odd = np.sin(turn), np.cos(turn), k % 2 == 1
    kernel: Any = 0.0
    limit: Any = None
    for half in (0.5 * np.pi / n * (at + k), 0.5 * np.pi / n * (at - k)):
        s = np.sin(half)
        small = np.abs(s) < 1e-12
        if small.any():
            limit = (0.0 if limit is None else limit) + np.where(small, n / np.cos(half), 0.0)
            s = np.where(small, np.inf, s)
        kernel = kernel + 1 / s
    total = np.where(odd, 1j * cosine, sine) * kernel
    if limit is not None:
        total = total + np.where(odd, -1j * sine, cosine) * limit
    return np.asarray(np.sqrt(0.5 / n) * np.exp(1j * (turn - 0.5 * np.pi / n * at)) * total)


def line_coefficients(
    frequency: float, a: float, b: float, k: np.ndarray, n: int, dt: float,
    begin: int = 0, end: int | None = None
) -> np.ndarray:
    """
    Return c_k at k (j,) >= 1 of a cos(w t) + b sin(w t) in [begin, end), (j,), in a's unit.

    As of :func:`line_basis`.

    """
    basis = line_basis(frequency, k, n, dt, begin, end)
    return a * basis.real + b * basis.imag


def quadrature_avar(
    psd: Callable[[np.ndarray], np.ndarray], m: np.ndarray, dt: float
) -> np.ndarray:
    """
    Return the Allan variance of a sampled process with this one-sided PSD at cluster sizes m.

    m (k,) -> (k,), unit^2; ``psd`` takes frequencies (j,), Hz, and returns unit^2/Hz; dt in s.

    sigma^2(m) = 2 int_0^{1/(2 dt)} S(f) sin^4(pi f m dt) / (m sin(pi f dt))^2 df. In u = f m dt: a
    midpoint rule over the first oscillations, then the mean 3/8 of sin^4 on a log grid (no
    oscillation is left to resolve there).

    """
    m = np.atleast_1d(np.asarray(m, float))
    near_to, step = 24.0, 1 / 32
    out = np.empty(len(m))
    for i, k in enumerate(m):
        top = 0.5 * k
        if top <= near_to:
            u = top * (np.arange(4096) + 0.5) / 4096
            f = u / (k * dt)
            out[i] = (
                np.sum(psd(f) * np.sin(np.pi * u) ** 4 / np.sin(np.pi * u / k) ** 2) * top / 4096
            )
        else:
            low = np.geomspace(1e-5, step, 64)  # an integrand that is still rising at u -> 0
            ul, wl = np.sqrt(low[1:] * low[:-1]), np.diff(low)
            un = step + step * (np.arange(int((near_to - step) / step)) + 0.5)
            edges = np.geomspace(un[-1] + step / 2, top, 200)
            uf, wf = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
            u = np.concatenate([ul, un, uf])
            w = np.concatenate([wl, np.full(len(un), step), wf])
            wave = np.concatenate(
                [np.sin(np.pi * ul) ** 4, np.sin(np.pi * un) ** 4, np.full(len(uf), 0.375)]
            )
            f = u / (k * dt)
            out[i] = np.sum(psd(f) * wave * w / np.sin(np.pi * u / k) ** 2)
        out[i] *= 2 / (k * k) / (k * dt)
    return out


def smooth(power: np.ndarray) -> np.ndarray:
    """Return the power (b,) as the geometric mean over nine bins."""
    window = np.ones(9) / 9
    return np.exp(np.convolve(np.pad(np.log(power), 4, mode='edge'), window, mode='valid'))
