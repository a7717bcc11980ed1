# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Whether one sensor's samples were made to fit the other's stamps.

A driver that publishes gyroscope and accelerometer in one message, though they are sampled at
rates of their own, interpolates the slower or repeats it (a depth camera's ``unite_imu_method``):
its noise at short times is then not the sensor's.

"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import correlate1d, median_filter, uniform_filter1d
from scipy.special import gammainccinv, gammaincinv

from ..core.record import ImuRecord, possible, SENSORS

LOOKED_AT = 200_000     # samples that tell
LEAST = 0.2             # share of samples for which it holds on all axes at once
TOGETHER = 0.5          # of the way from axes that have nothing to do with each other to one fate
ON_LINE = 1e-3          # of the usual change of slope: what counts as none
CLOSE = 0.1             # of the usual interval: stamps that came in one burst
SEGMENT = 1 << 14       # samples of a periodogram: over longer, two clocks drift apart
LINE = 15.0             # of the level around it: what of a spectrum is no noise
BROAD = 1.3             # of the level: what is no line but a hump
# Motion is a cubic over so many samples. What is left of a turn's ends, a knock or a step stands
# out over so many samples by so many times the power where it is quiet; slow beats make 1.9.
CUBIC, AROUND, STANDS_OUT = 29, 64, 2.5
QUIET = 0.1             # of a part: less tells nothing
SHALLOW, DEEP = 0.1, 0.45       # depth of the first harmonic; 3 / pi^2 for white noise


def united(record: ImuRecord) -> list[str]:
    """
    Return a sentence on each sensor whose samples are interpolated or repeated.

    Only where both are there, and only one is so: what holds for both is no matter of uniting.
    Under two samples for one that was taken, none lie on a line that would tell; the variance
    does, which is half as large midway between two samples taken as it is at one.

    """
    there = [s for s in SENSORS if getattr(record, s) is not None]
    if len(there) < 2 or record.n < 1000:
        return []
    t = record.t[:LOOKED_AT]
    found = {s: _how(getattr(record, s)[:LOOKED_AT], t) for s in there}
    if all(found.values()):
        return []
    return [
        f'{s} {how} at about {rate} Hz (a driver that unites two sensors): its noise at '
        'short times is not its own; record its own topic, and analyse that'
        for s, answer in found.items() if answer
        for how, rate in [answer]
    ]


def _how(x: np.ndarray, t: np.ndarray) -> tuple[str, str] | None:
    """Return how samples (n, 3) at t (n,) came about, and the rate (Hz) behind them."""
    x = x[:, (np.ptp(x, axis=0) > 0) & possible(x).all(axis=0)]
    span = float(t[-1] - t[0])
    if x.shape[1] < 2 or not (np.isfinite(x).all() and span > 0):
        return None
    step = np.diff(x, axis=0)
    same = step == 0
    if _beyond_chance(same):
        return 'repeats samples taken', f'{np.sum(~same.all(axis=1)) / span:.3g}'
    width = np.diff(t)[:, None]
    apart = width > CLOSE * span / (len(t) - 1)     # stamps of one burst tell no slope
    for width, known in ((np.where(apart, width, np.inf), apart), (1.0, np.ones_like(apart))):
        both = known[1:] & known[:-1]
        if not both.any():
            continue
        bend = np.abs(np.diff(step / width, axis=0))
        straight = both & (bend < ON_LINE * np.mean(bend, axis=0, where=both))
        straight &= ~(same[1:] | same[:-1])
        if _beyond_chance(straight):
            bent = ~straight.all(axis=1)
            return 'is interpolated between samples taken', f'{_runs(bent) / span:.3g}'
    return _by_variance(x, (len(t) - 1) / span)


def _by_variance(x: np.ndarray, rate: float) -> tuple[str, str] | None:
    """
    Return the same by a variance that is periodic in time, as the phase of two clocks is.

    At a share u of the way between two samples of white noise the variance is (1 - u)^2 + u^2 of
    theirs: its first harmonic is 3/pi^2 of its mean. It shows in the periodogram of the squares
    at the rate behind the samples, or where that is folded to. A vibration does so, too: lines are
    taken out first, there must be little of them, and all axes must show it, as deep. Where motion
    is more than noise the squares are its own, of which nothing is told. It is not told of what
    was rounded afterwards, nor at a rate close to this one or to a multiple of it.

    """
    if np.unique(x[:2000, 0]).size < 0.9 * len(x[:2000]):
        return None                         # a converter's levels come again, their mixtures not
    n = min(SEGMENT, 1 << int(np.log2(len(x) // 4)))
    cubic = np.linalg.pinv(np.vander(np.arange(CUBIC) - CUBIC // 2, 4))[-1]
    x = x - correlate1d(x, cubic, axis=0)
    power = uniform_filter1d(x ** 2, AROUND, axis=0)
    quiet = (power < STANDS_OUT * np.percentile(power, 25, axis=0)).all(axis=1)[:, None]
    x = x * quiet
    parts = [_squares(x[k:k + n], quiet[k:k + n]) for k in range(0, len(x) - n + 1, n)
             if quiet[k:k + n].mean() > QUIET]
    if not parts:
        return None
    squares, whole, shaken = (np.sum([p[i] for p in parts], axis=0) for i in range(3))
    level = _level(squares)
    share = (squares / np.where(level > 0, level, np.inf)).sum(axis=1) / x.shape[1]
    share[:32] = share[-8:] = 0.0           # the window, and rates too close to this one
    at = int(np.argmax(share))
    near = np.r_[share[at - 16:at - 4], share[at + 5:at + 17]]
    if (np.max(shaken) > 0 or share[at] < _beyond(len(parts) * x.shape[1], n)
            or np.median(near) > BROAD):
        return None
    depth = 2 * np.sqrt(np.maximum(squares[at] - level[at], 0.0) / whole)
    if depth.min() < SHALLOW or depth.max() > min(DEEP, 2 * depth.min()):
        return None
    folded = at * rate / n
    return ('is interpolated between samples taken',
            f'{rate - folded:.3g} or {rate + folded:.3g}')


def _squares(x: np.ndarray, quiet: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """
    Return the periodogram of the squares of x (n, axes) where it is quiet (n, 1), without lines.

    All parts of a record have it as high, however much of them is quiet, lest one outdoes the
    rest; beside it (bins, axes) the square of what the squares sum up to (axes,), and by how much
    the power of lines surpasses that of the rest (axes,). Of a line that stops where it is not
    quiet (1 - share)^2 of the power stays, which may be a twentieth of the rest.

    """
    n, share, window = len(x), quiet.mean(), np.hanning(len(x))[:, None]
    spectrum = np.fft.rfft(window * x, axis=0)
    power = np.abs(spectrum) ** 2
    lines = power > LINE * _level(power)
    lines[2:-2] |= lines[4:] | lines[:-4] | lines[3:-1] | lines[1:-3]
    power[:n // 20] = spectrum[:n // 20] = 0.0      # what drifts
    stays = max(1.0, 20 * (1 - share) ** 2) / share
    shaken = stays * np.sum(power * lines, axis=0) - np.sum(power * ~lines, axis=0)
    spectrum[lines] = 0.0
    q = np.fft.irfft(spectrum, n, axis=0) ** 2
    q = np.minimum(q, 10 * q.mean(axis=0, where=quiet)) * quiet
    mean = quiet * window ** 2      # the turns of a session may come as regularly as clocks beat
    mean = mean * (q.sum(axis=0) / mean.sum())
    squares = np.abs(np.fft.rfft(q - mean, axis=0)) ** 2
    usual = np.median(squares, axis=0)
    return squares / usual, q.sum(axis=0) ** 2 / usual, shaken


def _level(power: np.ndarray) -> np.ndarray:
    """
    Return the level around each bin of a periodogram (bins, axes): no line raises it.

    An axis at a time: scipy's filter of one dimension is thirty times as quick.

    """
    return np.column_stack([median_filter(p, 201, mode='mirror')
                            for p in np.ascontiguousarray(power.T)])


def _beyond(count: int, bins: int) -> float:
    """Return what so many exponential powers reach, over their median, once in 10^6 records."""
    return float(gammainccinv(count, 1e-6 / bins) / gammaincinv(count, 0.5))


def _beyond_chance(flags: np.ndarray) -> bool:
    """Tell whether flags (n, axes) come on all axes at once, and often."""
    together, alone = flags.all(axis=1).mean(), flags.mean(axis=0)
    chance = np.prod(alone)
    return bool(together > LEAST and together - chance > TOGETHER * (np.min(alone) - chance))


def _runs(flags: np.ndarray) -> int:
    return int(np.sum(flags[1:] & ~flags[:-1])) + int(flags[0])
