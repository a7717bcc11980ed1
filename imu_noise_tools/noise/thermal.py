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

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.fft import dct, idct
from scipy.special import betainc

from ..core.statistics import means_of_blocks, median_sigma

TEMPERATURE, COURSE = 'temperature', 'course'    # the covariate, and what axes tell of it
LEADS, LAGS = 12, 20    # starts of either sign
SMOOTHED = (1, 2, 4, 8, 16)     # parts of a lead by which a thermometer is smoothed for it
POWERS = 3
COMPARED_MEANS = 4096   # block means in which axes are compared with the thermometer
FEWEST, MOST = 16, 256  # coefficients that tell whether an axis follows it
CHANCE = 1e-3           # records in which an axis seems to
NEAR = 0.2              # of a frequency, and coefficients, over which a level is read
FEW = 8
AROUND = 3              # coefficients that a line takes on either side
NOISE = 8               # times as many, of which those beyond twice as many tell the noise
GAIN = 2.5              # times that of what is slow, or as much less, that of a line may be
LEFT = 0.1              # share of a line that what explains it leaves
ABOVE = 2.0             # times its floor up to which axes show the temperature
BEYOND = 1.5            # times that frequency: further on it is 1/5 of the noise, and less
STANDS = 8.0            # times the level around it, from which one coefficient is of a line
ALONG = 0.5             # share of what axes have there, that goes as they follow the temperature
LEAST = 1e-6            # of a course, that is none: what lines leave of one by the last digits
FAR = 4                 # times that frequency up to which lines are looked for, beyond all else
CLEAR, SAME = 20.0, 0.8     # there, for STANDS and ALONG


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

    Lags go from none to a quarter of the record, of a temperature that rested before it or that
    went on as it begins. What a slow thermometer lost of a fast cycle is more than its noise, or
    less: so each lead comes with several smoothings.

    """
    least = max(duration / 2000, 2 * step)
    later = np.geomspace(least, duration / 4, LAGS)
    earlier = np.geomspace(least, max(duration / 10, 2 * least), LEADS)
    moved = [(0.0, 0.0), *((x, s) for x in later for s in (0.0, x)),
             *((-x, x / q) for x in earlier for q in SMOOTHED)]
    return [(float(x), float(s)) for x, s in moved]


def rows_of_readings(duration: float, step: float) -> list[list[tuple[float, float]]]:
    """Return :func:`readings` in rows of lags, in each of which they are alike but for the lag."""
    rows: dict[tuple[bool, float], list[tuple[float, float]]] = {}
    none, *some = readings(duration, step)
    for lag, s in some:
        rows.setdefault((lag > 0, round(s / lag, 6)), [none]).append((lag, s))
    return list(rows.values())


def moved(temperature: np.ndarray, t: np.ndarray, lag: float, smoothing: float) -> np.ndarray:
    """
    Return a temperature behind a time constant, or what a thermometer with one is behind of.

    ``smoothing`` is the time constant (s) by which its noise is taken out of its rate of change,
    from both sides: 0 for none. Behind a lag that is the rate at which it began, and went on
    before; with none it had rested.

    """
    if not lag or len(t) < 3:
        return temperature
    step = t[1] - t[0]
    if lag > 0:
        return _behind(temperature, lag / step, smoothing / step)
    smooth, s = temperature, smoothing / step
    if smoothing > 0:
        smooth = _behind(_behind(temperature, s)[::-1], s)[::-1]
    return temperature - lag * np.gradient(smooth, step)


def _behind(x: np.ndarray, lag: float, along: float = 0.0) -> np.ndarray:
    """Return x (n,) behind a lag; before it went as ``along`` its first values, 0: it rested."""
    from scipy.signal import lfilter  # half a second to load

    a, before = np.exp(-1 / lag), x[0]
    if along > 0:
        count = int(np.clip(along, 2, len(x)))
        k = np.arange(count) - 0.5 * (count - 1)
        rate = float(k @ x[:count]) / float(k @ k)
        # behind a straight line it is the line less what that does in a time constant
        before = np.mean(x[:count]) - rate * (0.5 * (count - 1) + 1 / (1 - a))
    return lfilter([1 - a], [1, -a], x, zi=[a * before])[0]


def powers(u: np.ndarray, more: Iterable[np.ndarray] = ()) -> np.ndarray:
    """
    Return u (n,), its square and its cube and what else is given, (n, p), each without mean.

    Each is less what those before it hold of it.

    """
    u = u - np.mean(u)
    scale = np.sqrt(np.mean(u * u)) or 1.0
    u = u / scale
    out = [u]
    for x in (u * u, u * u * u, *more):
        for _ in range(2):  # Gram and Schmidt's steps, twice for the sake of rounding
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

    What those that follow it share is the temperature from the slow end on to where it sinks into
    their noise.

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
    times, warmth = _coarse(t), _coarse(temperature)
    count = min(len(times) // 4, *(len(x) for x in own.values()))
    if count < FEWEST:
        return None
    c = _coefficients(np.column_stack([_coarse(slow[a]) for a in own]), count)
    trend = _coefficients((times / times[-1])[:, None] ** np.arange(1, POWERS + 1), count)
    tried = readings(float(times[-1]), float(t[1] - t[0]))
    columns = [_coefficients(powers(moved(warmth, times, *r))[:, :POWERS], count) for r in tried]
    best, follow = _followed(c, trend, columns)
    if not np.any(follow):
        return None
    noise = np.column_stack([x[:count] for x in own.values()])[:, follow] * len(times) / len(t)
    way, shown, along = _shared(c[:, follow], trend, columns[best], noise)
    share = _share(shown, along)
    if not len(share):
        return None
    whole = np.column_stack([slow[a] for a, f in zip(own, follow) if f]) @ way
    out = np.zeros(len(t))
    out[1:len(share) + 1] = share * _coefficients(whole, len(share))
    values = idct(out, type=2, norm='ortho')
    edge = (len(share) + 0.5) / (2 * len(t) * float(t[1] - t[0]))
    return Course(values / np.sqrt(np.mean(values**2)), edge, *tried[best])


def without_lines(course: Course, lines: np.ndarray, t: np.ndarray) -> Course:
    """
    Return a course (at the times t (s,) of its blocks) without lines, Hz (l,), of an axis.

    They were taken out of that axis, and what others have of them would put them back.

    """
    lines = lines[lines < course.edge]
    if not len(lines):
        return course
    angle = 2 * np.pi * t[:, None] * lines
    x = np.column_stack([np.ones(len(t)), np.cos(angle), np.sin(angle)])
    values = course.values - x @ np.linalg.lstsq(x, course.values, rcond=None)[0]
    return replace(course, values=values / max(float(np.sqrt(np.mean(values**2))), LEAST))


def follows_at(lines: np.ndarray, y: np.ndarray, t: np.ndarray, temperature: np.ndarray,
               course: Course) -> np.ndarray:
    """
    Tell which lines, Hz (l,), of block means y (s,) are those of a course that axes tell.

    What y follows of the temperature and of the course is told without the coefficients around a
    line; it is theirs where it explains all of them but a tenth, and noise.

    """
    step = float(t[1] - t[0])
    columns = powers(moved(temperature, t, course.lag, course.smoothing), [course.values])
    at = np.rint(2 * len(y) * step * lines).astype(int) - 1
    count = int(2 * len(y) * step * course.edge)
    c, x = _coefficients(y, count), _coefficients(columns, count)
    root = np.sqrt(np.maximum(_level(c**2), 1e-300))
    out = np.zeros(len(lines), bool)
    for i in np.flatnonzero(at + AROUND < count):
        out[i] = _explains(c, x, root, at[i])
    return out


def _explains(c: np.ndarray, x: np.ndarray, root: np.ndarray, at: int) -> bool:
    """
    Tell whether columns x (k, p) explain the line at one of coefficients c (k,), levels root (k,).

    By what c follows of them elsewhere. What axes tell, the last column, is smaller than it is
    where their noise is as large: of a line its gain may be another.

    """
    away = np.abs(np.arange(len(c)) - at)
    far, mine = away > 2 * AROUND, away <= AROUND
    if np.sum(far) <= 2 * x.shape[1]:
        return False
    scaled = (x / root[:, None])[far]
    size = np.maximum(np.sqrt(np.sum(scaled**2, axis=0)), 1e-300)
    b = np.linalg.lstsq(scaled / size, (c / root)[far], rcond=1e-9)[0] / size
    left, beside = c - x @ b, far & (away < NOISE * AROUND)
    noise = np.sum(mine) * median_sigma(left[beside]) ** 2 if np.any(beside) else 0.0
    told = x[mine, -1]
    more = np.clip(told @ left[mine] / max(told @ told, 1e-300),
                   *np.sort(b[-1] * np.array([1 / GAIN - 1, GAIN - 1])))
    rest = float(np.sum((left[mine] - more * told) ** 2))
    return rest < LEFT * float(np.sum(c[mine] ** 2)) + noise


def _followed(c: np.ndarray, trend: np.ndarray,
              columns: Sequence[np.ndarray]) -> tuple[int, np.ndarray]:
    """
    Return which reading comes nearest, and which axes (p,) follow it by more than chance.

    An axis does where its coefficients (k, p), each over the level around it, go with those of the
    temperature and its powers further than noise of its spectrum (F test), a smooth trend apart.
    What a line or a step puts into few of them counts as so many as it is spread over.

    """
    spans = [n for n in len(c) >> np.arange(16) if FEWEST <= n <= MOST]
    chances = np.ones((len(columns), len(spans), c.shape[1]))
    for j, y in enumerate(c.T):
        root = np.sqrt(np.maximum(_level(y**2), 1e-300))[:, None]
        for i, n in enumerate(spans):
            drift = np.linalg.qr((trend / root)[:n])[0]
            z = _less((y[:, None] / root)[:n], drift)[:, 0]
            # of normal coefficients the fourth power is three times the square of the second
            free = min(n, 3 * (z @ z) ** 2 / max(np.sum(z**4), 1e-300)) - 2 * POWERS
            for k, x in enumerate(columns if free > 0 else ()):
                x = _less((x / root)[:n], drift)
                q, r = np.linalg.qr(x / np.maximum(np.sqrt(np.sum(x**2, axis=0)), 1e-300))
                along = q[:, np.abs(np.diag(r)) > 1e-6].T @ z
                left = np.clip(1 - (along @ along) / (z @ z), 0.0, 1.0)
                chances[k, i, j] = betainc(free / 2, POWERS / 2, left)
    least = np.min(chances, axis=1)
    best = int(np.argmin(np.sum(np.log(np.maximum(least, 1e-300)), axis=1)))
    if not np.any(least[best] < CHANCE / chances.size):
        return best, np.zeros(c.shape[1], bool)
    # where one does, that is how the temperature is to be read: others need not be told from all
    return best, least[best] < CHANCE / len(spans)


def _shared(c: np.ndarray, trend: np.ndarray, x: np.ndarray,
            noise: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """
    Return (weights of axes (p,), what they show so, whitened (k,), how much of all it is (k,)).

    Of as many dimensions as there are axes that is the direction in which the thermometer, x
    (k, 3), moves their coefficients c (k, p), and in which little else does (Capon, Proc. IEEE 57,
    1969); ``noise`` (k, p) is what they are known to have.

    """
    root = np.exp(0.5 * np.mean(np.log(noise), axis=1))[:, None]
    c, both = c / root, np.column_stack([x, trend]) / root
    # one weight for all axes: what the thermometer gets wrong is then wrong in all alike
    told = both[:, :POWERS] @ np.linalg.lstsq(both, c, rcond=None)[0][:POWERS]
    rest = (c - told).T @ (c - told) + np.diag(np.sum(noise / root**2, axis=0))
    by_heat = np.linalg.svd(told, full_matrices=False)[2][0]
    way = np.linalg.solve(rest, by_heat)
    shown, whole = c @ way, np.sum(c * np.linalg.solve(rest, c.T).T, axis=1)
    return way, shown, shown**2 / np.maximum((way @ by_heat) * whole, 1e-300)


def _share(shown: np.ndarray, along: np.ndarray) -> np.ndarray:
    """
    Return what share of coefficients (k,) is more than noise, from the slow end to where none is.

    A little further on: what is slow to change falls with the fourth power of the frequency. A
    line of a heater's cycle stands out of all that, and is ``along`` the axes (k,) as they follow
    the temperature; further on still it must be clear that it does.

    """
    level = _level(shown**2)
    floor = np.min(level)
    end = int(np.argmin(np.append(level > ABOVE * floor, False)))
    further = np.arange(end, int(BEYOND * end))
    out = np.append(1 - floor / level[:end], 1 / (1 + (further / max(end, 1)) ** 4))
    last, out = len(out), np.append(out, np.zeros(max(min(FAR * end, len(shown)) - len(out), 0)))
    far = np.arange(len(shown)) >= last
    stands = (shown**2 > np.where(far, CLEAR, STANDS) * level) \
        & (along > np.where(far, SAME, ALONG))
    for k in np.flatnonzero(stands[:len(out)]):
        line = slice(max(k - AROUND, 0), min(k + AROUND + 1, len(out)))
        noise = median_sigma(shown[max(k - NOISE * AROUND, 0):k + NOISE * AROUND]) ** 2
        out[line] = np.maximum(out[line], 1 - noise / np.maximum(shown[line] ** 2, noise))
        last = max(last, line.stop)
    return out[:last]


def _coarse(x: np.ndarray) -> np.ndarray:
    """Return means of neighbours, at least COMPARED_MEANS where there are as many."""
    return means_of_blocks(x, max(1, len(x) // COMPARED_MEANS))


def _less(x: np.ndarray, basis: np.ndarray) -> np.ndarray:
    """Return columns x (k, p) less what an orthonormal basis (k, q) holds of them."""
    return x - basis @ (basis.T @ x)


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
