# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A line whose frequency wanders slowly, sampled: its power lies in a bell around f0.

Where the frequency strays by s Hz, and slowly beside 1/s, the autocovariance at lag k is sigma^2
exp(-(alpha k)^2/2) cos(k theta), alpha = 2 pi s dt, theta = 2 pi f0 dt, and the spectrum is the
density of the frequency itself (Woodward's theorem: Papoulis, Probability, Random Variables and
Stochastic Processes, section 10-2), a normal one here, folded by sampling. ``width`` is its full
width at half height, s sqrt(8 ln 2). Beside an oscillator's peak of that width it has no skirts.

"""

from __future__ import annotations

from functools import lru_cache
from math import factorial
from typing import NamedTuple

import numpy as np

from .spectrum import Bins

PER_WIDTH = 1 / np.sqrt(8 * np.log(2))  # the deviation of a bell in its full width at half height
LEAST = 2.2  # cells of 1/T: of a wider bell the ends of a record are independent
GONE = 9.0  # deviations: exp(-9^2/2) is lost in rounding
IMAGES = 2 * np.pi * np.array([-1.0, 0.0, 1.0])  # of angles; below they stand in an axis before
STEP = 1e-5  # of ln f0, in widths, and of ln width: what slopes are taken over
FAR = 12.0  # deviations: of the leakage there its series
TERMS = 6  # of that: it is right to 1e-9
SERIES = 10.0  # from here on Dawson's integral is its series, to 1e-6 of what images add


def _angles(f0: float, width: float, dt: float) -> tuple[float, float]:
    """Return (theta, alpha)."""
    return 2 * np.pi * f0 * dt, 2 * np.pi * PER_WIDTH * width * dt


def covariance(lag: np.ndarray, f0: float, width: float, dt: float) -> np.ndarray:
    """Return the autocovariance at lags (samples), of their shape, of variance 1; f0 in Hz."""
    theta, alpha = _angles(f0, width, dt)
    return np.exp(-0.5 * (alpha * lag) ** 2) * np.cos(theta * lag)


def psd(f: np.ndarray, sigma: float, f0: float, width: float, dt: float) -> np.ndarray:
    """Return the one-sided PSD of the sampled process at f (Hz), of its shape, unit^2/Hz."""
    f, s = np.asarray(f, float), PER_WIDTH * width
    both = np.zeros(np.shape(f))
    for line in (f0, -f0):
        for image in IMAGES / (2 * np.pi * dt):
            both += np.exp(-0.5 * ((f - line - image) / s) ** 2)
    return sigma**2 * both / (np.sqrt(2 * np.pi) * s)


def binned(bins: Bins, sigma: float, f0: float, width: float) -> np.ndarray:
    """
    Return what the power of a record is expected to be in each bin, (b,).

    E c_k^2 = sum over lags of R(lag) [(1 - |lag|/n) cos(lag phi) - sin(|lag| phi)/(n sin phi)],
    phi = pi k/n. With G(x) the sum over l > 0 of exp(-(alpha l)^2/2 + i l x), that is, over x =
    phi + theta and phi - theta, the sum of 1/2 + Re G(x) - Im G'(x)/n - Im G(x)/(n sin phi). The
    first is a sum of bells (Poisson) and the others are of Dawson's integral: what leaks through
    the ends of the record, all that there is far from the line. Exact where the width is more than
    ``LEAST``/T; of bins of several coefficients the last term is taken at Gauss' two points.

    """
    return sigma**2 * _unit(bins, f0, width)


def slopes(bins: Bins, sigma: float, f0: float, width: float) -> tuple[np.ndarray, np.ndarray]:
    """Return d :func:`binned`/d ln f0 and d ln width, (b,) each, by differences upwards."""
    step = STEP * width / f0
    here = binned(bins, sigma, f0, width)
    return ((binned(bins, sigma, f0 * np.exp(step), width) - here) / step,
            (binned(bins, sigma, f0, width * np.exp(STEP)) - here) / STEP)


@lru_cache(maxsize=64)
def _unit(bins: Bins, f0: float, width: float) -> np.ndarray:
    """Return the expected power of a variance of 1 over the bins, (b,)."""
    theta, alpha = _angles(f0, width, bins.dt)
    at, lines = _places(bins), np.array([[theta], [-theta]])
    alone, edges = len(at.alone), len(at.alone) + len(at.edge)
    odd, steepness, near = _far(at, lines, alpha)
    x = (at.all + lines)[near]
    odd[near] = _odd(x, alpha)
    one = near[1] < alone
    which = near[0][one], near[1][one]
    steepness[which] = _steepness(x[one], alpha)
    bells = np.zeros_like(steepness)
    bells[which] = _bells(x[one], alpha)
    risen = 0.5 * np.pi * (np.sign(at.edge + lines) - 1)
    one = ~one & (near[1] < edges)
    risen[near[0][one], near[1][one] - alone] = _risen(x[one], alpha)
    total = odd.sum(0) / bins.n
    ends = total / at.sine
    unit = np.empty(len(at.one))
    unit[at.one] = (bells - steepness / bins.n).sum(0) - ends[:alone]
    rises = np.diff(risen.sum(0) - total[alone:edges]) / np.diff(at.edge)
    unit[~at.one] = rises[at.wide] - 0.5 * ends[edges:].reshape(2, -1).sum(0)
    return 2 * bins.dt * np.maximum(unit, 0.0)


class _Places(NamedTuple):
    """
    Where a bell is asked for: which bins (b,) hold one coefficient, and angles.

    ``alone`` those of bins that hold one, ``edge`` of the edges of cells from the first that holds
    several on, which of these cells are ``wide``; ``all`` (a,) those two and Gauss' two points of
    the wide ones, with their sine and the cotangent of their half.

    """

    one: np.ndarray
    wide: np.ndarray
    alone: np.ndarray
    edge: np.ndarray
    all: np.ndarray
    sine: np.ndarray
    cotangent: np.ndarray


@lru_cache(maxsize=8)
def _places(bins: Bins) -> _Places:
    phi, one = 2 * np.pi * bins.f * bins.dt, bins.count == 1
    begin = len(one) if one.all() else int(np.argmin(one))
    edge = np.pi * (np.append(bins.first[begin:], bins.last[-1]) - 0.5) / bins.n
    wide = ~one[begin:]
    reach = np.diff(edge)[wide] / np.sqrt(12)
    x = np.concatenate([phi[one], edge, phi[~one] - reach, phi[~one] + reach])
    return _Places(one, wide, phi[one], edge, x, np.sin(x), 1 / np.tan(0.5 * x))


def _far(at: _Places, lines: np.ndarray,
         alpha: float) -> tuple[np.ndarray, np.ndarray, tuple[np.ndarray, ...]]:
    """
    Return :func:`_odd` far from lines, (2, a), its slope where bins hold one, and what is near.

    There it is the sum over k of (alpha^2/2)^k/k! times the 2k-th derivative of C(x) = cot(x/2)/2,
    each a polynomial in the cotangent: that of a line of no width, and moments of the bell.

    """
    turn = 1 / np.tan(0.5 * lines)
    above, below = at.cotangent * turn - 1, at.cotangent + turn
    near = np.nonzero(np.abs(above) * np.tan(0.5 * min(FAR * alpha, np.pi)) >= np.abs(below))
    below[near] = 1.0
    c = above / below
    square = c * c
    odd, slope = (terms @ alpha ** (2 * np.arange(TERMS)) for terms in _BY_WIDTH)
    return c * _horner(odd[:-1], square), _horner(slope, square[:, :len(at.alone)]), near


def _horner(terms: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return the polynomial of such terms (t,), the constant first, at x."""
    out = np.full(x.shape, terms[-1])
    for term in terms[-2::-1]:
        out *= x
        out += term
    return out


def _by_width() -> tuple[np.ndarray, np.ndarray]:
    """
    Return by which powers of alpha^2 the terms of :func:`_far` go, (t, k), of C and of its slope.

    d cot(x/2)/dx = -(1 + cot(x/2)^2)/2.

    """
    one, each = np.polynomial.Polynomial([1.0, 0.0, 1.0]), [np.polynomial.Polynomial([0.0, 0.5])]
    for _ in range(2 * TERMS - 1):
        each.append(-0.5 * one * each[-1].deriv())
    out = np.zeros((2, TERMS + 1, TERMS))
    for k in range(TERMS):
        for j in (0, 1):
            terms = each[2 * k + j].coef[1 - j::2]
            out[j, :len(terms), k] = terms / (2**k * factorial(k))
    return out[0], out[1]


_BY_WIDTH = _by_width()


def _wrapped(x: np.ndarray) -> np.ndarray:
    return (x + np.pi) % (2 * np.pi) - np.pi


def _bells(x: np.ndarray, alpha: float) -> np.ndarray:
    """Return 1/2 + Re G at angles (a,), as all that follow."""
    x = _wrapped(x) + IMAGES[:, None]
    return np.sqrt(np.pi / 2) / alpha * np.exp(-0.5 * (x / alpha) ** 2).sum(0)


def _risen(x: np.ndarray, alpha: float) -> np.ndarray:
    """Return the integral of :func:`_bells` from 0 (x within -pi and 2 pi)."""
    from scipy.special import erf
    centres = np.append(IMAGES, 4 * np.pi)[:, None]
    return 0.5 * np.pi * erf((x - centres) / (alpha * np.sqrt(2))).sum(0)


def _odd(x: np.ndarray, alpha: float) -> np.ndarray:
    """Return Im G, the sum over images of sqrt(2)/alpha D(x/(alpha sqrt(2)))."""
    from scipy.special import dawsn
    x = _wrapped(x)
    size = alpha * np.sqrt(2)
    near = 2 / size * dawsn(x / size)
    far = x + IMAGES[[0, 2], None]
    return near + 2 / size * _beyond(far / size).sum(0) + _cotangent(x)


def _beyond(x: np.ndarray) -> np.ndarray:
    """Return D(x) - 1/(2 x), what Dawson's integral leaves of an image; far out its series."""
    from scipy.special import dawsn
    if np.min(np.abs(x), initial=np.inf) < SERIES:
        return dawsn(x) - 0.5 / x
    square = 0.5 / (x * x)
    return square / (2 * x) * (1 + 3 * square * (1 + 5 * square * (1 + 7 * square)))


def _cotangent(x: np.ndarray) -> np.ndarray:
    """Return cot(x/2)/2 - 1/x, the images of 1/x."""
    small = np.abs(x) < 1e-3
    safe = np.where(small, 1.0, x)
    return np.where(small, -x / 12, 0.5 / np.tan(0.5 * safe) - 1 / safe)


def _steepness(x: np.ndarray, alpha: float) -> np.ndarray:
    """Return Im G', the slope of :func:`_odd`."""
    from scipy.special import dawsn
    x = _wrapped(x)
    size = alpha * np.sqrt(2)
    u = x / size
    v = (x + IMAGES[[0, 2], None]) / size
    small = np.abs(x) < 1e-3
    safe = np.where(small, 1.0, x)
    images = np.where(small, -1 / 12, 1 / safe**2 - 0.25 / np.sin(0.5 * safe) ** 2)
    return 2 / size**2 * (1 - 2 * u * dawsn(u)) + images \
        + (2 / size**2 * (0.5 / (v * v) - 2 * v * _beyond(v))).sum(0)


def avar(m: np.ndarray, sigma: float, f0: float, width: float, dt: float) -> np.ndarray:
    """
    Return the Allan variance at cluster sizes m (k,), (k,), unit^2: (4 V(m) - V(2m))/(2 m^2).

    V(m) is the variance of a sum of m, m + 2 sum over 0 < l < m of (m - l) R(l).

    """
    m = np.asarray(m, float)
    _, alpha = _angles(f0, width, dt)
    lags = np.arange(1, 2 + int(min(2 * m.max(initial=1), GONE / alpha)))
    r = covariance(lags, f0, width, dt)
    plain, weighted = (np.concatenate([[0.0], np.cumsum(v)]) for v in (r, lags * r))

    def summed(k: np.ndarray) -> np.ndarray:
        upto = np.minimum(k - 1, len(lags)).astype(int)
        return k * (1 + 2 * plain[upto]) - 2 * weighted[upto]

    # a difference of two that are nearly alike where a bell has whole cycles in m
    return sigma**2 * np.maximum(4 * summed(m) - summed(2 * m), 0.0) / (2 * m * m)


def sample(n: int, sigma: float, f0: float, width: float, dt: float,
           rng: np.random.Generator) -> np.ndarray:
    """Return n samples of the Gaussian process, (n,), out of a circle that is long enough."""
    from scipy.fft import irfft, next_fast_len
    _, alpha = _angles(f0, width, dt)
    many = next_fast_len(n + int(np.ceil(GONE / alpha)), real=True)
    f = np.arange(many // 2 + 1) / (many * dt)
    size = np.sqrt(psd(f, sigma, f0, width, dt) * many / (4 * dt))
    noise = size * (rng.standard_normal(len(f)) + 1j * rng.standard_normal(len(f)))
    noise[0] = np.sqrt(2) * noise[0].real
    if many % 2 == 0:
        noise[-1] = np.sqrt(2) * noise[-1].real
    return irfft(noise, many)[:n]
