# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What disturbs a record at rest: knocks, people and machines near by, steps, clipping.

A sensor's own noise is alike at all times and comes to each axis by itself. So a frame of a
quarter of a second is compared with all others of its axis, and believed to be disturbed only
where several axes stand out together more often than chance makes them. Lone outliers do not
count: the third largest deviation of a frame tells its level.

"""

from __future__ import annotations

import numpy as np

from .clipped import stays
from .record import AXES, Disturbance, ImuRecord, sensor_of
from .statistics import in_a_row, median_sigma, quantile_sigma, row_medians

FRAME_S = 0.25
LEAST_FRAME = 16        # samples
RANK = 3                # the level of a frame is its third largest deviation
# times these quantiles of the levels, whichever is lower: one of Rayleigh's distribution, which
# narrow-band noise has and comes to 1.95 of 2 in 1e5 frames; the upper one alone would be the
# level of knocks where these come to more than one frame in twenty
QUANTILES = 0.8, 0.95
OUT = 2.73, 2.0
LEAST_OUT = 3.0         # and times the usual level
EDGE = 2.0              # frames beside a disturbed one belong to it down to so many times
CHANCE = 1e-3           # expected number of coincidences that is believed to be none
LONG_S = 4.0            # weaker disturbances are looked for in windows of this length
LEAST_WINDOWS = 10
LOUDER = 1.6            # and are louder by this factor
SURE = 6.0              # and by so many robust standard deviations of the log level
SHOCK_S = 3.0           # what is shorter is a shock
PAUSE_S = 1.0           # what is nearer than this is one disturbance
JUMP = 10.0             # a step is so many robust standard deviations of what levels change by
STEPS = 3               # an axis that steps more often has popcorn noise
MOST_LISTED = 100       # of what is clipped, and of all else
PIECE_S = 0.1           # of a short rest
KNOCK = 8.0             # a piece off by this many robust standard deviations is a knock
MOST_KNOCKED = 0.2      # share of the pieces; beyond it is shaken, not knocked


def disturbances(record: ImuRecord) -> tuple[Disturbance, ...]:
    """
    Return what disturbs a record at rest, in order of time.

    Parameters
    ----------
    record : ImuRecord
        Evenly sampled, finite, at rest.

    """
    length = max(LEAST_FRAME, round(FRAME_S * record.rate_hz))
    count = record.n // length
    axes = [a for a in record.axes if np.ptp(record.column(a)[:1 << 16]) > 0]
    if count < 40 or not axes:
        return ()
    level, middle = np.empty((2, len(axes), count))
    for i, axis in enumerate(axes):
        level[i], middle[i] = _levels(record.column(axis)[:count * length], length)
    usual = np.array([_usual(x) for x in level])
    ratio = level / usual[:, None]
    steady = np.quantile(ratio, QUANTILES, axis=1)
    out = np.maximum(LEAST_OUT, (np.array(OUT)[:, None] * steady).min(axis=0))[:, None]
    hot = _together(ratio > out) | _louder(ratio, max(1, round(LONG_S * record.rate_hz / length)))
    pause = max(1, round(PAUSE_S * record.rate_hz / length))
    found: list[tuple[int, int]] = []
    for a, b in _runs(hot.any(axis=0), pause):
        a, b = _widened(ratio, hot[:, a:b].any(axis=1), a, b)
        if found and a <= found[-1][1]:
            a = found.pop()[0]
        found.append((a, b))
    listed = []
    for a, b in found:
        if a == 0 and _settles(record, axes, b, length, usual[:, None] * out):
            continue    # a warm-up, that is an effect to be found
        shown = tuple(x for x, h in zip(axes, hot) if h[a:b].any())
        listed.append(disturbance(record, a * length, min(b * length, record.n), axes=shown))
    listed += _steps(record, axes, middle, found, length)
    listed = listed[:MOST_LISTED] + _clipped(record)[:MOST_LISTED]
    return tuple(sorted(listed, key=lambda d: d.begin))


def calm(data: np.ndarray, rate_hz: float, step: np.ndarray | float = 0.0
         ) -> list[tuple[int, int]]:
    """
    Return the sample ranges of a rest of a few seconds, (n, 3), between its knocks.

    Such a rest is too short for coincidences to be counted: pieces of a tenth of a second whose
    mean or scatter on any axis is far off those of the others are knocks; where many are, the
    sensor is shaken and none is. Going to and fro between neighbours on a grid of ``step`` (3,),
    0 for none, is not: noise far below the step does that now and then, and never the rest.

    """
    least = 1.001 * np.asarray(step) + 1e-12
    block = max(2, round(PIECE_S * rate_hz))
    n = len(data) // block
    cut = data[:n * block].reshape(n, block, 3)
    middle, scatter = cut.mean(1), cut.std(1)
    middle -= np.median(middle, axis=0)
    scatter -= np.median(scatter, axis=0)
    bad = ((np.abs(middle) > np.maximum(KNOCK * median_sigma(middle, axis=0), least))
           | (scatter > np.maximum(KNOCK * median_sigma(scatter, axis=0), least))).any(1)
    if not bad.any() or bad.mean() > MOST_KNOCKED:
        return [(0, len(data))]
    edges = in_a_row(~bad).tolist()
    return [(p * block, q * block if q < n else len(data)) for p, q in edges]


def _levels(x: np.ndarray, length: int) -> tuple[np.ndarray, np.ndarray]:
    """Return of every frame the third largest deviation from its median, and its median."""
    level, middle = np.empty((2, len(x) // length))
    rows = max(1, (1 << 18) // length)
    for i in range(0, len(level), rows):
        some = np.array(x[i * length:(i + rows) * length], float).reshape(-1, length)
        some.sort(axis=1)
        m = row_medians(some)
        ends = np.abs(np.hstack([some[:, :RANK], some[:, -RANK:]]) - m[:, None])
        level[i:i + len(some)] = np.sort(ends, axis=1)[:, -RANK]
        middle[i:i + len(some)] = m
    return level, middle


def _settles(record: ImuRecord, axes: list[str], count: int, length: int,
             out: np.ndarray) -> bool:
    """Tell whether the first frames stand out, beyond (axes, 1), by how fast they move alone."""
    k = np.arange(length) - 0.5 * (length - 1)
    rows = (np.asarray(record.column(a)[:count * length], float).reshape(count, length)
            for a in axes)
    level = [_levels((x - np.outer(x @ k / (k @ k), k)).ravel(), length)[0] for x in rows]
    return bool(np.all(np.array(level) <= out))


def _usual(level: np.ndarray) -> float:
    """Return the usual level of an axis; for coarse output at least a step of it."""
    positive = level[level > 0]
    if not len(positive):
        return np.inf
    return float(max(np.median(level), np.quantile(level, 0.9) / 2, np.min(positive)))


def _together(hot: np.ndarray) -> np.ndarray:
    """
    Return which frames of which axes stand out together beyond chance, (axes, frames) bool.

    A frame may be off by one between axes. Axes that stand out often by themselves (spikes, a
    change of the noise) make coincidences: these are counted against. How often is told by the
    frames in which no other axis does, or knocks that come often would count against themselves.

    """
    near = hot.copy()
    near[:, 1:] |= hot[:, :-1]
    near[:, :-1] |= hot[:, 1:]
    alone = near.sum(axis=0) - near == 0
    count = (hot & alone).sum(axis=1) + 1
    share = (count + np.sqrt(count)) / np.maximum(alone.sum(axis=1), 1)    # by a standard error
    chance = hot.shape[1] * np.exp(np.where(near, np.log(3 * share)[:, None], 0.0).sum(axis=0))
    real = (near.sum(axis=0) >= 2) & (chance < CHANCE)
    real &= hot.any(axis=0)
    return near & real


def _louder(ratio: np.ndarray, width: int) -> np.ndarray:
    """Return which frames lie in windows that are louder than all others on several axes."""
    axes, count = ratio.shape
    out = np.zeros(ratio.shape, bool)
    windows = count // width
    if windows < LEAST_WINDOWS:
        return out
    rows = ratio[:, :windows * width].reshape(axes, windows, width)
    level = np.log(np.maximum(np.median(rows, axis=2), 1e-3))
    middle = np.median(level, axis=1, keepdims=True)
    spread = np.maximum(quantile_sigma(level - middle, 0.7, axis=1, keepdims=True), 0.02)
    loud = (level - middle > SURE * spread) & (level - middle > np.log(LOUDER))
    loud &= loud.sum(axis=0) >= 2
    out[:, :windows * width] = np.repeat(loud, width, axis=1)
    return out


def _runs(hot: np.ndarray, pause: int) -> list[tuple[int, int]]:
    """Return the ranges (begin, end) that are set, those nearer than a pause put together."""
    out: list[tuple[int, int]] = []
    for a, b in in_a_row(hot).tolist():
        if out and a - out[-1][1] <= pause:
            out[-1] = out[-1][0], b
        else:
            out.append((a, b))
    return out


def _widened(ratio: np.ndarray, axes: np.ndarray, a: int, b: int) -> tuple[int, int]:
    """Return a range of frames with what rises before it and dies away after it."""
    high = (ratio[axes] > EDGE).any(axis=0)
    most = 2 * (b - a) + 8
    first, last = a, b
    while first > 0 and high[first - 1] and a - first < most:
        first -= 1
    while last < ratio.shape[1] and high[last] and last - b < most:
        last += 1
    return max(0, first - 1), min(ratio.shape[1], last + 1)


def disturbance(
    record: ImuRecord, begin: int, end: int, kind: str = '', axes: tuple[str, ...] = ()
) -> Disturbance:
    """
    Return a range of samples as a disturbance.

    Its size is the largest deviation of each axis from the level of the second before and after.

    """
    near = max(8, round(record.rate_hz))
    size = {}
    for axis in axes or record.axes:
        x = record.column(axis)
        beside = np.r_[x[max(0, begin - near):begin], x[end:end + near]]
        level = np.median(beside if len(beside) else x[begin:end])
        size[axis] = float(np.max(np.abs(x[begin:end] - level)))
    first, last = float(record.t[begin]), float(record.t[min(end, record.n) - 1])
    return Disturbance(
        first, last, kind or ('shock' if last - first <= SHOCK_S else 'disturbed'), size
    )


def _steps(record: ImuRecord, axes: list[str], middle: np.ndarray, found: list[tuple[int, int]],
           length: int) -> list[Disturbance]:
    """Return sharp steps of the mean that stay; none of an axis that steps often."""
    out = []
    wide = max(4, round(5 * record.rate_hz / length))
    calm = np.ones(middle.shape[1], bool)
    for a, b in found:
        calm[a:b] = False
    for axis, x in zip(axes, middle):
        if len(x) < 4 * wide:
            continue
        total = np.cumsum(np.r_[0.0, x])
        k = np.arange(wide, len(x) - wide)
        slow = (total[k + wide] - 2 * total[k] + total[k - wide]) / wide
        change = np.abs(x[k + 1] - x[k - 2])
        limits = [JUMP * quantile_sigma(c, 0.8) for c in (slow, change)]
        sharp = (np.abs(slow) > limits[0]) & (change > limits[1]) & calm[k]
        sharp &= (change > 0.5 * np.abs(slow)) & (change < 2 * np.abs(slow))
        runs = _runs(sharp, wide)
        if len(runs) > STEPS or np.median(change) == 0 and np.mean(change > 0) > 0.01:
            continue
        for a, b in runs:
            best = a + int(np.argmax(np.abs(slow[a:b])))
            at = float(record.t[k[best] * length])
            out.append(Disturbance(at, at, 'step', {axis: float(abs(slow[best]))}))
    return out


def _clipped(record: ImuRecord) -> list[Disturbance]:
    """
    Return the stretches in which an axis stands at the end of its range.

    What noise alone takes it to sample by sample is no stretch.

    """
    out = []
    for axis in AXES:
        if getattr(record, sensor_of(axis)) is None or axis in record.stuck:
            continue
        x = record.column(axis)
        for a, b in _runs(stays(x), max(1, round(record.rate_hz))):
            end = float(record.t[min(b, record.n - 1)])
            out.append(Disturbance(
                float(record.t[a]), end, 'clipped', {axis: float(np.max(np.abs(x[a:b])))}
            ))
    return out
