# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The damped oscillator driven by white noise, sampled: AR(2). A resonance, or a wandering line.

x_k = 2 r cos(theta) x_{k-1} - r^2 x_{k-2} + w_k, theta = 2 pi f0 dt, r = exp(-pi width dt), width
the full width at half the height of a narrow peak, Hz. Its autocovariance is sigma^2 r^|k|
(cos k theta + c sin |k| theta), c = (1 - r^2)/(1 + r^2) cot theta (Box and Jenkins, Time Series
Analysis, section 3.2), so that all that follows are geometric sums of p = r e^{i theta}.

A rate sensor hears how fast a mount swings, x_k - x_{k-2}: nothing at zero and at Nyquist. Of that
the autocovariance at lag k > 0 is sigma^2 Re(A p^k), too, A = -a (p - 1/p)^2/(2 - 2 Re a p^2),
a = 1 - i c, for a p^k solves the recursion at every k, and Re(a/p) = Re(a p).

One that rings far above half the rate is heard ``folded``: by the phase at which samples find it,
its autocovariance is sigma^2 r^|k| cos k theta, c = 0. It has the skirts of one pole on either
side of where it is seen. Its recursion has two states, turned by theta and shortened by r.

"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from .spectrum import Bins

FORMS = DISPLACEMENT, VELOCITY, FOLDED = ('displacement', 'velocity', 'folded')


def _pole(f0: float, width: float, dt: float) -> tuple[complex, complex]:
    """Return (p, a) of a displacement: the autocovariance at lag k is sigma^2 Re(a p^k)."""
    theta, r = 2 * np.pi * f0 * dt, np.exp(-np.pi * width * dt)
    c = np.tanh(np.pi * width * dt) / np.tan(theta)
    return complex(r * np.exp(1j * theta)), complex(1, -c)


def _swing(f0: float, width: float, dt: float, form: str) -> tuple[complex, complex]:
    """Return (p, a) of what is heard: the autocovariance at lag k > 0 is sigma^2 Re(a p^k)."""
    p, a = _pole(f0, width, dt)
    if form == FOLDED:
        return p, complex(1.0)
    return p, -a * (p - 1 / p) ** 2 / _difference(p, a) if form == VELOCITY else a


def _difference(p: complex, a: complex) -> float:
    """Return the variance of x_k - x_{k-2} in that of x_k."""
    return 2 - 2 * (a * p * p).real


def displacement(sigma: float, f0: float, width: float, dt: float,
                 form: str = DISPLACEMENT) -> float:
    """Return the standard deviation of x_k, ``sigma`` being that of it or of x_k - x_{k-2}."""
    away = _difference(*_pole(f0, width, dt)) if form == VELOCITY else 1.0
    return float(sigma / np.sqrt(away))


def innovation_variance(sigma: float, f0: float, width: float, dt: float,
                        form: str = DISPLACEMENT) -> float:
    """
    Return the variance of w_k, ``sigma`` being the deviation of what is heard.

    Of what is folded that of either state.

    """
    theta, r2 = 2 * np.pi * f0 * dt, np.exp(-2 * np.pi * width * dt)
    if form == FOLDED:
        return float(sigma**2 * (1 - r2))
    size = displacement(sigma, f0, width, dt, form)
    return float(size**2 * (1 - r2) / (1 + r2)
                 * ((1 - r2) ** 2 + 4 * r2 * np.sin(theta) ** 2))


def psd(f: np.ndarray, sigma: float, f0: float, width: float, dt: float,
        form: str = DISPLACEMENT) -> np.ndarray:
    """Return the one-sided PSD of the sampled process at f (Hz), of its shape, unit^2/Hz."""
    p, _ = _pole(f0, width, dt)
    r, half = abs(p), np.pi * np.asarray(f, float) * dt
    left, right = ((1 - r) ** 2 + 4 * r * np.sin(half - 0.5 * theta) ** 2
                   for theta in (np.angle(p), -np.angle(p)))
    heard: np.ndarray | float = 1.0
    if form == VELOCITY:
        heard = (2 * np.sin(2 * half)) ** 2
    elif form == FOLDED:
        heard = 0.5 * (left + right)    # the sum of two poles, in place of their product
    return 2 * dt * innovation_variance(sigma, f0, width, dt, form) * heard / (left * right)


def binned(bins: Bins, sigma: float, f0: float, width: float,
           form: str = DISPLACEMENT) -> np.ndarray:
    """
    Return what the power of a record is expected to be in each bin, (b,): exactly.

    A peak may be far narrower than a bin, or than what the record resolves. E c_k^2 = sum over
    lags of R(lag) [(1 - |lag|/n) cos(lag phi) - sin(|lag| phi)/(n sin phi)], phi = pi k/n; of a
    bin with several coefficients the integral of that, less what alternates between neighbours.

    """
    _, a = _swing(f0, width, bins.dt, form)
    unit = 1 + (a * _value(bins, f0, width)).real
    return 2 * bins.dt * sigma**2 * np.maximum(unit, 0.0)


def slopes(bins: Bins, sigma: float, f0: float, width: float,
           form: str = DISPLACEMENT) -> tuple[np.ndarray, np.ndarray]:
    """
    Return d :func:`binned`/d ln f0 and d ln width, (b,) each.

    It is Re(a F(p)) and F is analytic: dF = p F' dp/p, d ln p = i theta d ln f0 - pi width dt d ln
    width.

    """
    dt = bins.dt
    p, a = _pole(f0, width, dt)
    theta, damping = 2 * np.pi * f0 * dt, np.pi * width * dt
    value, slope = _value(bins, f0, width), _sums(bins, p, True)
    narrow, heard, out = np.tanh(damping), _swing(f0, width, dt, form)[1], []
    for more, turn in ((1j * narrow * theta / np.sin(theta) ** 2, 1j * theta),
                       (-1j * (1 - narrow**2) * damping / np.tan(theta), -damping)):
        if form == FOLDED:
            more = 0.0
        elif form == VELOCITY:
            share = _difference(p, a)
            less = -2 * (more * p**2 + 2 * a * p**2 * turn).real
            more = -(more * (p - 1 / p) ** 2 + 2 * a * (p**2 - p**-2) * turn
                     + heard * less) / share
        out.append(2 * dt * sigma**2 * (more * value + heard * turn * slope).real)
    return out[0], out[1]


@lru_cache(maxsize=64)
def _value(bins: Bins, f0: float, width: float) -> np.ndarray:
    """Return F of E c_k^2 = 1 + Re(a F), unit variance, over the bins, (b,) complex."""
    return _sums(bins, _pole(f0, width, bins.dt)[0], False)


def _sums(bins: Bins, p: complex, slope: bool) -> np.ndarray:
    """Return F, or its slope p F', over the bins, (b,) complex, E c_k^2 = 1 + Re(a F)."""
    n = bins.n
    alone, turn, sign, sine, begin, edge, span = _angles(bins)
    out = np.empty(len(bins.first), complex)
    zn = p**n * sign        # z^n: e^{i n phi} is +-1
    tapered: Any = 0
    plain: Any = 0
    for z, side in ((p * turn, 1), (p * np.conj(turn), -1)):
        one = 1 - z
        if slope:
            plain = plain + side * (z - n * zn + (n - 1) * zn * z) / one**2
            tapered = tapered + z / one**2 - (
                z - (n + 1) * zn * z + 2 * z * z * (1 - zn) / one) / (n * one**2)
        else:
            plain = plain + side * (z - zn) / one
            tapered = tapered + z / one - z * (1 - zn) / (n * one**2)
    out[alone] = tapered + 1j * plain / (n * sine[alone])
    if len(span):
        tapered = plain = 0
        for z, side in ((p * edge, 1), (p * np.conj(edge), -1)):
            # z/(1 - z) integrates to +-i ln(1 - z), z/(1 - z)^2 to -+i/(1 - z)
            one = 1 - z
            integral = side * 1j * (-z / one if slope else np.log(one))
            plain = plain + side * integral
            tapered = tapered + integral + side * 1j / n * (z / one**2 if slope else 1 / one)
        wide = ~alone[begin:]
        whole = np.diff(tapered) + 1j * np.diff(plain) / (n * sine[begin:])
        out[begin:][wide] = (whole / span)[wide]
    return out


@lru_cache(maxsize=8)
def _angles(bins: Bins) -> tuple[Any, ...]:
    """
    Return what the sums take from the bins alone.

    ``alone`` (b,) bool holds one coefficient, ``turn`` and ``sign`` are e^{i phi} and e^{i n phi}
    of those, ``sine`` (b,) is sin phi; from bin ``begin`` on are those that hold several, ``edge``
    e^{i phi} at their edges and ``span`` their width in phi.

    """
    phi = 2 * np.pi * bins.f * bins.dt
    alone = bins.count == 1
    begin = int(np.argmin(alone)) if not alone.all() else len(alone)
    edge = np.pi * (np.append(bins.first[begin:], bins.last[-1]) - 0.5) / bins.n
    sign = 1.0 - 2.0 * (bins.first[alone] % 2)
    return (alone, np.exp(1j * phi[alone]), sign, np.sin(phi), begin, np.exp(1j * edge),
            np.diff(edge))


def avar(m: np.ndarray, sigma: float, f0: float, width: float, dt: float,
         form: str = DISPLACEMENT) -> np.ndarray:
    """
    Return the Allan variance at cluster sizes m, of their shape, unit^2.

    The variance of a mean less its covariance with the next.

    """
    m = np.asarray(m, float)
    p, a = _swing(f0, width, dt, form)
    pm = np.exp(m * np.log(p))
    within = 2 * (m * p / (1 - p) - p * (1 - pm) / (1 - p) ** 2)
    between = p * (1 - pm) ** 2 / (1 - p) ** 2
    return sigma**2 / m**2 * (m + (a * (within - between)).real)
