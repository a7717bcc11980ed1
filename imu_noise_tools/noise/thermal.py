# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The temperature, and axes that follow it.

A thermometer is read in steps, late, and through its own noise; the axes of an IMU feel the same
temperature with less. Where others follow the thermometer by more than chance, what they share as
they do is the better thermometer: it tells the temperature's course, and up to where in frequency
an axis follows it. Below that what axes have in common is the temperature's, no coupling.

"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.fft import dct, idct
from scipy.special import betainc

TEMPERATURE, COURSE = 'temperature', 'course'    # the covariate, and what axes tell of it
LEADS, LAGS = 12, 20    # starts of either sign
SMOOTHED = (1, 2, 4, 8, 16)     # parts of a lead by which a thermometer is smoothed to be read ahead
POWERS = 3
BLOCKS = 4096           # block means in which axes are compared with the thermometer
FEWEST = 16             # coefficients that tell whether an axis follows it
CHANCE = 1e-3           # records in which an axis seems to
NEAR = 0.2              # of a frequency, and coefficients, over which a level is read
FEW = 8
ABOVE = 2.0             # times its floor up to which axes show the temperature
BEYOND = 1.5            # times that frequency: further on it is 1/5 of the noise, and less


@dataclass(frozen=True)
class Course:
    """
    What other axes tell of the temperature.

    ``values`` (s,) are the course at the blocks of the record, of rms 1; below ``edge`` Hz an axis
    follows it; ``lag`` and ``smoothing``, s, are those of the thermometer that comes nearest.

    """

    values: np.ndarray
    edge: float
    lag: float
    smoothing: float


def readings(duration: float, step: float) -> list[tuple[float, float]]:
    """
    Return (lag, smoothing), s, by which a thermometer may be behind or ahead of what follows it.

    Lags go from none to a quarter of the record. What a slow thermometer lost of a fast cycle is
    more than its noise, or less: so each lead comes with several smoothings.

    """
    least = max(duration / 2000, 2 * step)
    later = np.geomspace(least, duration / 4, LAGS)
    earlier = np.geomspace(least, max(duration / 10, 2 * least), LEADS)
    moved = [(0.0, 0.0), *((x, 0.0) for x in later),
             *((-x, x / q) for x in earlier for q in SMOOTHED)]
    return [(float(x), float(s)) for x, s in moved]


def moved(temperature: np.ndarray, t: np.ndarray, lag: float, smoothing: float) -> np.ndarray:
    """
    Return a temperature behind a time constant, or what a thermometer with one is behind of.

    ``smoothing`` is the time constant (s) by which its noise is taken out of its rate of change,
    from both sides: 0 for none.

    """
    if not lag or len(t) < 3:
        return temperature
    from scipy.signal import lfilter  # half a second to load

    step = t[1] - t[0]

    def slow(x, tc):
        a = np.exp(-step / tc)
        return lfilter([1 - a], [1, -a], x, zi=[a * x[0]])[0]

    if lag > 0:
        return slow(temperature, lag)
    smooth = temperature
    if smoothing > 0:
        smooth = slow(slow(temperature, smoothing)[::-1], smoothing)[::-1]
    return temperature - lag * np.gradient(smooth, step)


def powers(u: np.ndarray, more: Iterable[np.ndarray] = ()) -> np.ndarray:
    """
    Return u (n,), its square and its cube and what else is given, (n, p), each without mean.

    Each is less what those before it hold of it.

    """
    u = u - np.mean(u)
    scale = np.sqrt(np.mean(u * u)) or 1.0
    u = u / scale
    out = [u]
    for x in (u**2, u**3, *more):   # Gram and Schmidt's steps, twice for the sake of rounding
        for _ in range(2):
            x = x - np.mean(x)
            for y in out:
                x = x - y * (x @ y / max(y @ y, 1e-300))
        out.append(x)
    return np.column_stack(out) * np.append(
        scale ** np.arange(1, POWERS + 1), np.ones(len(out) - POWERS))


def course_of(slow: Mapping[str, np.ndarray], t: np.ndarray,
              own: Mapping[str, np.ndarray]) -> Course | None:
    """
    Return what axes tell of the temperature; None where none follows it by more than chance.

    An axis follows it where its slow coefficients go with those of the temperature and its powers,
    read late or ahead, further than noise does (F test) and than a smooth trend would. What such
    axes share is told by the direction, of as many dimensions as there are axes, in which the
    thermometer moves them and little else does (Capon, Proc. IEEE 57, 1969, eq. 8); that is the
    temperature from the slow end on to where it sinks into their noise.

    Parameters
    ----------
    slow : mapping of ndarray (s,)
        Block means of the axes and of the temperature.
    t : ndarray (s,)
        Their times, s.
    own : mapping of ndarray (k,)
        By the names of the axes, the power of their own noise in the first cosine coefficients of
        the blocks.

    """
    temperature = slow.get(TEMPERATURE)
    if temperature is None or not own or np.ptp(temperature) == 0:
        return None
    per = max(1, len(t) // BLOCKS)

    def coarse(x):
        return x[:len(x) // per * per].reshape(-1, per).mean(axis=1)

    times, warmth = coarse(t), coarse(temperature)
    count = min(len(times) // 4, *(len(x) for x in own.values()))
    if count < FEWEST:
        return None
    noise = np.column_stack([x[:count] for x in own.values()])
    root = np.exp(0.5 * np.mean(np.log(noise), axis=1))[:, None]

    def whitened(x):
        return _coefficients(x, count) / root

    c = whitened(np.column_stack([coarse(slow[a]) for a in own]))
    trend = whitened((times / times[-1])[:, None] ** np.arange(1, POWERS + 1))
    tried = [(reading, whitened(powers(moved(warmth, times, *reading))))
             for reading in readings(float(times[-1]), float(t[1] - t[0]))]
    spans = [count >> i for i in range(int(np.log2(count / FEWEST)) + 1)]
    # what is left of axes where each reading is taken out of so many coefficients
    found = [(n, reading, x, _left(c[:n], x[:n], trend[:n])) for reading, x in tried
             for n in spans]
    n, (lag, smoothing), x, left = max(found, key=lambda f: -f[0] * np.sum(np.log(f[3])))
    chance = betainc((n - 2 * POWERS) / 2, POWERS / 2, left)
    follow = chance < CHANCE / (len(found) * len(left))
    if not np.any(follow):
        return None
    c, both = c[:, follow], np.column_stack([x, trend])
    told = x @ np.linalg.lstsq(both[:n], c[:n], rcond=None)[0][:POWERS]
    rest = (c - told).T @ (c - told) + np.diag(np.sum((noise / root**2)[:, follow], axis=0))
    way = np.linalg.solve(rest, np.linalg.svd(told[:n], full_matrices=False)[2][0])
    shown = c @ way
    level = _level(shown**2)
    floor = np.min(level)
    end = int(np.argmin(np.append(level > ABOVE * floor, False)))
    if end == 0:
        return None
    # what is slow to change falls with the fourth power of the frequency further on
    share = 1 - floor / level[:end]
    share = np.append(share, 1 / (1 + (np.arange(end, int(BEYOND * end)) / end) ** 4))
    whole = np.column_stack([slow[a] for a, f in zip(own, follow) if f]) @ way
    out = np.zeros(len(t))
    out[1:len(share) + 1] = share * _coefficients(whole, len(share))
    values = idct(out, type=2, norm='ortho')
    return Course(values / np.sqrt(np.mean(values**2)),
                  (len(share) + 0.5) / (2 * len(t) * (t[1] - t[0])), lag, smoothing)


def _left(c: np.ndarray, x: np.ndarray, trend: np.ndarray) -> np.ndarray:
    """Return what share (p,) of c (k, p), less a trend (k, q), columns x (k, r) leave."""
    trend = np.linalg.qr(trend)[0]
    c, x = (y - trend @ (trend.T @ y) for y in (c, x))
    x = x / np.maximum(np.sqrt(np.sum(x**2, axis=0)), 1e-300)
    q, r = np.linalg.qr(x)
    along = q[:, np.abs(np.diag(r)) > 1e-6].T @ c
    return np.clip(1 - np.sum(along**2, axis=0) / np.maximum(np.sum(c**2, axis=0), 1e-300),
                   1e-12, 1.0)


def _coefficients(x: np.ndarray, count: int) -> np.ndarray:
    """Return the first cosine coefficients (count, ...) of x (s, ...), but for the mean."""
    return dct(x - np.mean(x, axis=0), type=2, norm='ortho', axis=0)[1:count + 1]


def _level(power: np.ndarray) -> np.ndarray:
    """Return the mean power (k,) of coefficients around each."""
    k = np.arange(1, len(power) + 1)
    reach = np.maximum(FEW // 2, (NEAR * k).astype(int))
    low, high = np.maximum(k - 1 - reach, 0), np.minimum(k + reach, len(power))
    total = np.append(0.0, np.cumsum(power))
    return (total[high] - total[low]) / (high - low)
