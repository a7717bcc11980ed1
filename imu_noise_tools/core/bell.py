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

import numpy as np

from .spectrum import Bins

PER_WIDTH = 1 / np.sqrt(8 * np.log(2))  # the deviation of a bell in its full width at half height
LEAST = 2.2  # cells of 1/T: of a wider bell the ends of a record are independent
GONE = 9.0  # deviations: exp(-9^2/2) is lost in rounding
IMAGES = 2 * np.pi * np.array([-1.0, 0.0, 1.0])  # of angles; below they stand in an axis before
STEP = 1e-5  # of ln f0, in widths, and of ln width: what slopes are taken over
SERIES = 10.0  # from here on Dawson's integral is its series, to 1e-6 of what images add


def _angles(f0: float, width: float, dt: float) -> tuple[float, float]:
    """Return (theta, alpha)."""
    return 2 * np.pi * f0 * dt, 2 * np.pi * PER_WIDTH * width * dt


def covariance(lag: np.ndarray, f0: float, width: float, dt: float) -> np.ndarray:
    """Return the autocovariance at lags (samples), of variance 1."""
    theta, alpha = _angles(f0, width, dt)
    return np.exp(-0.5 * (alpha * lag) ** 2) * np.cos(theta * lag)


def psd(f: np.ndarray, sigma: float, f0: float, width: float, dt: float) -> np.ndarray:
    """Return the one-sided PSD of the sampled process at f (Hz), unit^2/Hz."""
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
    n, (one, wide, points) = bins.n, _points(bins)
    alone, edge, before, behind = points
    lines = theta * np.array([[1.0], [-1.0]])
    # one call for all: most of them hold few points
    odd = np.split(np.sum(_odd(np.concatenate(points) + lines, alpha), axis=0),
                   np.cumsum([len(x) for x in points[:-1]]))
    unit = np.zeros(len(one))
    unit[one] = np.sum(_bells(alone + lines, alpha) - _steepness(alone + lines, alpha) / n,
                       axis=0) - odd[0] / (n * np.sin(alone))
    risen = np.sum(_risen(edge + lines, alpha), axis=0) - odd[1] / n
    unit[~one] = (np.diff(risen) / np.diff(edge))[wide]
    for x, there in ((before, odd[2]), (behind, odd[3])):
        unit[~one] -= 0.5 * there / (n * np.sin(x))
    return 2 * bins.dt * np.maximum(unit, 0.0)


@lru_cache(maxsize=8)
def _points(bins: Bins) -> tuple[np.ndarray, np.ndarray, tuple[np.ndarray, ...]]:
    """
    Return which bins (b,) hold one coefficient, which of the cells others, and angles to ask at.

    Of those that hold one, at all edges of cells from the first that holds several on, and at
    Gauss' points of these.

    """
    phi, one = 2 * np.pi * bins.f * bins.dt, bins.count == 1
    begin = len(one) if one.all() else int(np.argmin(one))
    edge = np.pi * (np.append(bins.first[begin:], bins.last[-1]) - 0.5) / bins.n
    wide = ~one[begin:]
    reach = np.diff(edge)[wide] / np.sqrt(12)
    return one, wide, (phi[one], edge, phi[~one] - reach, phi[~one] + reach)


def _wrapped(x: np.ndarray) -> np.ndarray:
    return (x + np.pi) % (2 * np.pi) - np.pi


def _bells(x: np.ndarray, alpha: float) -> np.ndarray:
    """Return 1/2 + Re G at angles (2, a), as all that follow."""
    x = _wrapped(x) + IMAGES[:, None, None]
    return np.sqrt(np.pi / 2) / alpha * np.exp(-0.5 * (x / alpha) ** 2).sum(0)


def _risen(x: np.ndarray, alpha: float) -> np.ndarray:
    """Return the integral of :func:`_bells` from 0 (x within -pi and 2 pi)."""
    from scipy.special import erf
    centres = np.append(IMAGES, 4 * np.pi)[:, None, None]
    return 0.5 * np.pi * erf((x - centres) / (alpha * np.sqrt(2))).sum(0)


def _odd(x: np.ndarray, alpha: float) -> np.ndarray:
    """Return Im G, the sum over images of sqrt(2)/alpha D(x/(alpha sqrt(2)))."""
    from scipy.special import dawsn
    x = _wrapped(x)
    size = alpha * np.sqrt(2)
    near = 2 / size * dawsn(x / size)
    far = x + IMAGES[[0, 2], None, None]
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
    v = (x + IMAGES[[0, 2], None, None]) / size
    small = np.abs(x) < 1e-3
    safe = np.where(small, 1.0, x)
    images = np.where(small, -1 / 12, 1 / safe**2 - 0.25 / np.sin(0.5 * safe) ** 2)
    return 2 / size**2 * (1 - 2 * u * dawsn(u)) + images \
        + (2 / size**2 * (0.5 / (v * v) - 2 * v * _beyond(v))).sum(0)


def avar(m: np.ndarray, sigma: float, f0: float, width: float, dt: float) -> np.ndarray:
    """
    Return the Allan variance at cluster sizes m: (4 V(m) - V(2m))/(2 m^2).

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
