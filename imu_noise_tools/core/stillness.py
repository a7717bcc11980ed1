# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Which part of a record is at rest.

What counts as motion is slow and large: below some 5 Hz, more than any sensor does at rest, and
more than this sensor does where it is quietest. So a fan's vibration, a drift with temperature and
a lone outlier are rest, and a turn, a tilt to another face, or handling are not.

"""

from __future__ import annotations

import numpy as np

from .record import ImuRecord, possible
from .statistics import in_a_row, median_sigma

BOX_S = 0.07            # three running means of this length leave 1 % of a vibration above 20 Hz
UNIT_S = 0.1            # smoothed values are taken this far apart
VIEW = 10               # a view is this many of them
# motion spreads a view by this many times what it is where the record is quietest
TIMES_QUIET = 6.0
# Spread of a view that is no motion whatever the sensor, and the most that is believed to be rest
# (rad/s, m/s^2).
LEAST = {'gyro': 0.0175, 'accel': 0.15}
MOST = {'gyro': 0.01, 'accel': 0.1}
TURNING = 0.035         # a steady rate that differs so much from the rest's is a turn, rad/s
# a disturbance no longer than this, after which nothing has changed, is a knock
KNOCK_S = 3.0
BRIEF = 0.003           # as is what takes no more of the shorter rest beside it, at most
BRIEF_S = 20.0
SAME = {'gyro': 0.0087, 'accel': 0.15}
# Who starts or stops a record rocks it: views at its ends swing by so many times what they usually
# do, and go on with so many, on two axes of each sensor. The middle one of three independent axes
# never comes near that; a vibration that is common to all and of random size comes to 4 times its
# median once in 2^16.
ROCKED, ROCKS = 4.0, 2.0
PAUSE = 4               # views in which it may rest meanwhile
MOST_ROCKED = 1 / 3     # share of the record; beyond it is no handling at its ends
HANDLED_S = 600.0       # as far from either end is looked at
SHAKEN_S = 3.0          # what shakes has gone round within this time
SWAYS_S = 30.0          # what sways, all the while: a tower, a raft, a long table
SWAYS = 0.5             # in so many of those times at least
TILT = 0.0175           # and has turned the sensor no further, rad
STILL_S = 2.0           # the shortest stretch that is called still: two views


def still_stretches(record: ImuRecord, seconds: float = STILL_S) -> list[tuple[int, int]]:
    """
    Return the stretches at rest.

    Parameters
    ----------
    record : ImuRecord
        As recorded; samples that are not finite are passed over.
    seconds : float
        The shortest stretch that counts.

    Returns
    -------
    list of (int, int)
        Sample ranges (begin, end) in order. A knock parts two of them.

    """
    ends = _at_gaps(record)
    least = max(2, round(seconds * record.rate_hz))
    if only_shaken(record):
        return [(a, b) for a, b in zip(ends[:-1].tolist(), ends[1:].tolist()) if b - a >= least]
    unit = max(1, round(UNIT_S * record.rate_hz))
    moving = np.zeros(record.n // unit + 1, bool)
    for sensor in ('gyro', 'accel'):
        data = getattr(record, sensor)
        if data is not None and record.n >= 2 * VIEW * unit:
            moving |= _moving(data, unit, record.rate_hz, sensor)
    if _sways(record, moving, unit):
        moving[:] = False
    found = []
    for a, b in zip(ends[:-1].tolist(), ends[1:].tolist()):
        first = a // unit
        quiet = ~moving[first:(b - 1) // unit + 1]
        edges = in_a_row(quiet)
        found += [
            (max(a, (first + i) * unit), min(b, (first + j) * unit)) for i, j in edges.tolist()
        ]
    return _not_turning(record, [(a, b) for a, b in found if b - a >= least])


def only_shaken(record: ImuRecord) -> bool:
    """Tell whether a record is shaken at most, not moved: an idling engine, a fan, knocks."""
    return _goes_round(record, SHAKEN_S)


def _sways(record: ImuRecord, moving: np.ndarray, unit: int) -> bool:
    """Tell whether all that moves, unit by unit, is a slow sway that goes on and on."""
    length = max(1, round(SWAYS_S * record.rate_hz / unit))
    count = len(moving) // length
    some = moving[:count * length].reshape(count, length).any(axis=1)
    swaying = count >= 4 and float(np.mean(some)) > SWAYS
    return swaying and _goes_round(record, SWAYS_S, drifts=True)


def _goes_round(record: ImuRecord, seconds: float, drifts: bool = False) -> bool:
    """
    Tell whether whatever moves a record comes back within so many seconds.

    Over each of them the direction of gravity is the same, or nearly that of the last ones where a
    long record ``drifts``; the mean rate is, while all it drifts by is no turn; and within them
    the sensor turns by less than a degree.

    """
    length = max(2, round(seconds * record.rate_hz))
    count = record.n // length
    if count < 4:
        return False
    for sensor, most in SAME.items():
        data = getattr(record, sensor)
        for x in () if data is None else data.T:
            rows = np.asarray(x[:count * length], float).reshape(count, length)
            means = rows.mean(axis=1)
            warms = sensor == 'gyro' and np.ptp(means) < TURNING
            change = np.max(np.abs(np.diff(means))) if drifts or warms else np.ptp(means)
            if not change < most:   # also where something is not finite
                return False
            if sensor == 'gyro':
                angle = np.cumsum(rows - means[:, None], axis=1)
                if not np.max(np.ptp(angle, axis=1)) < TILT * record.rate_hz:
                    return False
    return True


def without_knocks(
    record: ImuRecord, stretches: list[tuple[int, int]], brief: float = 0.0
) -> list[list[tuple[int, int]]]:
    """
    Return the stretches in groups, between whose members there were only knocks.

    A knock is short, and before and after it the means over ten seconds are the same. So is what
    takes no more than a ``brief`` share of the shorter of both stretches.

    """
    def takes(i: int, j: int) -> float:
        return float(record.t[j] - record.t[i])

    groups: list[list[tuple[int, int]]] = []
    for stretch in stretches:
        last = groups[-1][-1] if groups else None
        if (
            last
            and takes(last[1] - 1, stretch[0]) <= max(KNOCK_S, min(BRIEF_S, brief * min(
                takes(last[0], last[1] - 1), takes(stretch[0], stretch[1] - 1))))
            and _same(record, last, stretch)
        ):
            groups[-1].append(stretch)
        else:
            groups.append([stretch])
    return groups


def longest_rest(
    record: ImuRecord, stretches: list[tuple[int, int]] | None = None
) -> list[tuple[int, int]]:
    """
    Return the longest group of stretches that are parted by knocks alone, or by little time.

    Of those at rest that are found, or of ``stretches``; it is empty where nothing rests.

    """
    some = still_stretches(record) if stretches is None else stretches
    groups = without_knocks(record, some, BRIEF)
    return max(groups, key=lambda g: span(record, g), default=[])


def span(record: ImuRecord, pieces: list[tuple[int, int]]) -> float:
    """Return how long it is from the first sample of pieces to the last, s; 0 of none."""
    return float(record.t[pieces[-1][1] - 1] - record.t[pieces[0][0]]) if pieces else 0.0


def handled_ends(record: ImuRecord) -> tuple[int, int]:
    """
    Return the sample range (begin, end) without what is rocked where a record begins and ends.

    All of it where nothing is, or too much. A steady drift is no rocking.

    Parameters
    ----------
    record : ImuRecord
        At rest, finite, without gaps.

    """
    unit = max(1, round(UNIT_S * record.rate_hz))
    if record.n < 8 * VIEW * unit:
        return 0, record.n
    most = min(record.n, round(HANDLED_S * record.rate_hz))
    first, last = (_swing(record, piece, unit) for piece in (
        slice(None, most), slice(None, -most - 1, -1)))
    begin, end = (min(_rocked(x) * (VIEW // 2) * unit, record.n) for x in (first, last))
    if begin + end > MOST_ROCKED * record.n:
        return 0, record.n
    return begin, record.n - end


def _swing(record: ImuRecord, piece: slice, unit: int) -> np.ndarray:
    """Return how far the middle axis of each sensor swings in views, (n,), the less of both."""
    line = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, VIEW), 2))[0]
    swings = []
    for data in (record.gyro, record.accel):
        if data is None:
            continue
        size = []
        for x in data[piece].T:
            smooth = _smooth(x, unit, record.rate_hz)
            views = np.lib.stride_tricks.sliding_window_view(smooth, VIEW)[::VIEW // 2]
            left = np.sqrt(np.mean((views - views @ line @ line.T) ** 2, axis=1))
            size.append(left / max(float(np.median(left)), 1e-300))
        swings.append(np.sort(size, axis=0)[1])
    return np.asarray(np.min(swings, axis=0))


def _rocked(swing: np.ndarray) -> int:
    """Return how many views (n,) are rocked from the first on, and what still moves after."""
    hot = np.flatnonzero(swing > ROCKS)
    if not len(hot) or hot[0] > PAUSE:
        return 0
    far = np.flatnonzero(np.diff(hot) > PAUSE)
    last = int(hot[far[0]] if len(far) else hot[-1])
    return last + 1 + PAUSE if np.max(swing[:last + 1]) > ROCKED else 0


def quiet_level(spread: np.ndarray) -> np.ndarray:
    """Return what views spread where the record is quietest, (axes,), from (views, axes)."""
    # The 10th percentile of the spread of ten normal numbers is 0.72 of its median.
    return np.percentile(spread, 10, axis=0) / 0.72


def _smooth(x: np.ndarray, unit: int, rate: float) -> np.ndarray:
    """
    Return one axis without what is fast, a value for the middle of every unit.

    Gaps are closed.

    """
    good = possible(x)
    if not good.all():
        x = (
            np.interp(np.arange(len(x)), np.flatnonzero(good), x[good])
            if good.any()
            else np.zeros(len(x))
        )
    piece = max(1, round(0.01 * rate))
    whole = len(x) // piece * piece
    fine = x[0:whole:piece] - x[0]
    for k in range(1, piece):       # many times faster than a mean along short rows
        fine = fine + (x[k:whole:piece] - x[0])
    box = np.ones(max(1, round(BOX_S * rate / piece)) | 1)
    kernel = np.convolve(np.convolve(box, box), box) / (len(box) ** 3 * piece)
    middle = np.minimum((np.arange(len(good) // unit) * unit + unit // 2) // piece, len(fine) - 1)
    padded = np.pad(fine, len(kernel) // 2, mode='edge')
    return np.lib.stride_tricks.sliding_window_view(padded, len(kernel))[middle] @ kernel


def _moving(data: np.ndarray, unit: int, rate: float, sensor: str) -> np.ndarray:
    """Tell of every unit (and of the short one at the end) whether a view that holds it moves."""
    smooth = np.stack([_smooth(data[:, k], unit, rate) for k in range(3)], axis=1)
    views = np.lib.stride_tricks.sliding_window_view(smooth, VIEW, axis=0)[::VIEW // 2]
    ordered = np.partition(views, (1, VIEW - 2), axis=2)
    # the largest and the smallest may be outliers
    spread = ordered[:, :, VIEW - 2] - ordered[:, :, 1]
    white = _white(data) / np.sqrt(max(1.0, 2 * BOX_S * rate))
    quiet = np.minimum(quiet_level(spread), np.maximum(MOST[sensor], 4 * white))
    moves = np.any(spread > np.maximum(TIMES_QUIET * quiet, LEAST[sensor]), axis=1)
    out = np.zeros(len(data) // unit + 1, bool)
    for k in np.flatnonzero(moves).tolist():
        out[k * (VIEW // 2):k * (VIEW // 2) + VIEW] = True
    out[-1] = out[-2]
    return out


def _white(data: np.ndarray) -> np.ndarray:
    """
    Return the scatter of the samples themselves, (3,), blind to whatever is smooth.

    It is taken from second differences.

    """
    some = data[:200_000]
    second = some[2:] - 2 * some[1:-1] + some[:-2]
    second = second[possible(second).all(axis=1)]
    if not len(second):
        return np.zeros(3)
    robust = median_sigma(second, axis=0)
    return np.where(robust > 0, robust, second.std(axis=0)) / np.sqrt(6)


def _at_gaps(record: ImuRecord) -> np.ndarray:
    """Return where the record begins, ends, and is interrupted for more than a second."""
    with np.errstate(invalid='ignore'):
        breaks = np.flatnonzero(np.diff(record.t) > max(1.0, 10 * record.dt)) + 1
    return np.r_[0, breaks, record.n]


def finite_mean(data: np.ndarray) -> np.ndarray:
    """Return the means (k,) of the finite values of each column of (n, k), NaN where none is."""
    return np.array([
        x[good].mean() if (good := possible(x)).any() else np.nan for x in data.T])


def _mean(record: ImuRecord, sensor: str, a: int, b: int) -> np.ndarray | None:
    data = getattr(record, sensor)
    means = None if data is None else finite_mean(data[a:b])
    return means if means is not None and np.isfinite(means).all() else None


def _not_turning(record: ImuRecord, stretches: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Leave out stretches at a steady rate that is not that of the slowest one: a turntable."""
    means = [_mean(record, 'gyro', a, b) for a, b in stretches]
    known = [m for m in means if m is not None]
    if record.gyro is None or not known:
        return stretches
    rest = min(known, key=np.linalg.norm)
    most = max(TURNING, 10 * float(np.max(_white(record.gyro))) / np.sqrt(record.rate_hz))
    return [s for s, m in zip(stretches, means) if m is None or np.linalg.norm(m - rest) <= most]


def _same(record: ImuRecord, before: tuple[int, int], after: tuple[int, int]) -> bool:
    ten = max(2, round(10 * record.rate_hz))
    for sensor, most in SAME.items():
        a = _mean(record, sensor, max(before[0], before[1] - ten), before[1])
        b = _mean(record, sensor, after[0], min(after[1], after[0] + ten))
        if a is not None and b is not None and np.max(np.abs(a - b)) > most:
            return False
    return True
