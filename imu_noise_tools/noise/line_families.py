# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fainter lines: at multiples of the frequency of one, each too faint to be sure by itself."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from .heights import Heights, Spot
from .lines import CROWD, crowding, line_penalty, NEAR
from .passing import projected
from ..core.spectrum import folded, line_basis
from ..core.statistics import median_of

SEEDS = 8  # lines, sure ones and faint ones, whose multiples are looked for
LOWER, HIGHER = 8, 12  # orders that a line may be of, and its company
FOLDED = 32  # readings of a line as one of those orders, folded at Nyquist
MULTIPLE = 3.5  # nats that one of a dozen frequencies reaches by chance every third time
MEMBER = 2.5  # nats beyond that from which it is a line: then one of a dozen in fifteen families
OFF, STEP = 0.2, 0.15  # of 1/T by which a line may be off its order, and by which it is sought


def family(heights: Heights, found: list[Spot]) -> list[Spot]:
    """
    Return fainter lines: at multiples of one frequency, each too faint to be sure by itself.

    Of a line that is known few frequencies are multiples, so that chance reaches less there;
    and several that are none by themselves may be sure together, or beside others that stand
    at multiples.

    """
    best, most = [], 0.0
    sure = sorted(found, key=lambda s: -s.height)[:SEEDS]
    for seed in [*sure, *_faint(heights)]:
        for f0, order, is_folded in _readings(heights.dt, seed.frequency, seed in found):
            # once in a thousand records, by whichever line and reading of it
            tried = np.log((FOLDED if is_folded else LOWER) * max(len(sure), 1))
            if seed not in found:
                tried += max(line_penalty(heights.n) - 0.5 * seed.height, 0.0)
            company, known = _multiples(heights, f0, order, is_folded, seed, found)
            # lines that are known tell which reading it is, and nothing of those that are not
            gain = sum(more for _, more in company) - max(tried - known, 0.0) - np.log(1000)
            if gain > most:
                best, most = [seed, *(s for s, more in company if more > MEMBER)], gain
    return [s for s in best if s not in found]


def _readings(dt: float, f: float, folds: bool) -> Iterator[tuple[float, int, bool]]:
    """Yield (f0, order, whether folded at Nyquist) as which a line may be read."""
    for order in range(1, LOWER + 1):
        yield f / order, order, False
    for order in range(2, LOWER + 1 if folds else 2):
        for m in range(1, order // 2 + 1):
            for f0 in (abs(m / dt + side * f) / order for side in (1, -1)):
                if f0 * dt < 0.5:      # beyond, it is the mirror image of another
                    yield f0, order, True


def _faint(heights: Heights) -> list[Spot]:
    """Return the highest of what is too low for a line, what is near one left out."""
    out, window = [], heights.window.copy()
    for _ in range(SEEDS):
        k = int(np.argmax(window))
        if window[k] < 0.5 * heights.threshold:
            break
        window[max(k - CROWD, 0):k + CROWD + 1] = 0
        spot = heights.measured(k + 1)
        height = float(_height(heights, np.array([spot.frequency]))[0][0])
        out.append(replace(spot, height=height))
    return out


def _height(heights: Heights, f: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """
    Return twice the nats (f,) that a line at each of near frequencies gains, and a, b.

    Beside the level around: where a crowd stands out none of it is a line.

    """
    k = heights.at(f[len(f) // 2])
    some = np.arange(max(1, k - NEAR), min(heights.n, k + NEAR + 1))
    energy, a, b = projected(line_basis(f[:, None], some, heights.n, heights.dt), heights.c[some])
    level = median_of(heights.reference[some - 1])
    beside = np.abs(some - k) > CROWD
    level = max(level, 2 * heights.dt * float(np.mean(heights.c[some[beside]] ** 2)))
    return 2 * heights.dt * energy / level, a, b


def _multiples(heights: Heights, f0: float, order: int, is_folded: bool, seed: Spot,
               known: list[Spot]) -> tuple[list[tuple[Spot, float]], float]:
    """
    Return what stands at the other orders of f0, read from a line of ``order``.

    With each how many nats it has beyond what one of them has by chance; and how many lines
    that are known have by standing at one.

    """
    out: list[tuple[Spot, float]] = []
    orders = np.delete(np.arange(1, HIGHER + 1), order - 1)
    places, off = folded(orders * f0, heights.dt), OFF * (1 + orders / order)
    others = np.array([s.frequency for s in known if s != seed])
    stands = np.any(
        np.abs(places[:, None] - others) * heights.n * heights.dt < off[:, None], axis=1)
    if is_folded and not np.any(stands):    # one line alone may be read in so many ways
        return out, 0.0
    by_chance = 4 * off[stands] * HIGHER * len(others) / heights.n * crowding(
        places[stands], heights.n * heights.dt, heights.dt)
    chances = 2 * (MULTIPLE + np.log1p(2 * off))
    high = _high(heights, places, int(2 * np.max(off)) + 2)
    for i in np.flatnonzero(~stands & (high > chances)):
        if heights.near([*known, *(s for s, _ in out)], Spot(float(places[i]), 0.0, 0.0, 0.0)):
            continue
        spot = _highest(heights, float(places[i]), float(off[i]))
        if spot.height > chances[i]:
            out.append((spot, 0.5 * (spot.height - float(chances[i]))))
    return out, float(-np.sum(np.log(np.minimum(by_chance, 1.0))))


def _high(heights: Heights, f: np.ndarray, reach: int) -> np.ndarray:
    """Return the highest window (f,) near frequencies; none near the ends."""
    middle = (2 * heights.n * heights.dt * f).astype(int)
    near = middle[:, None] + np.arange(-reach, reach)
    inside = (middle > 2 * NEAR) & (middle < heights.n - 2 * NEAR)
    return np.where(inside, np.max(heights.window[np.clip(near, 0, heights.n - 2)], axis=1), 0.0)


def _highest(heights: Heights, at: float, off: float) -> Spot:
    """Return the highest line at most so many 1/T from a frequency."""
    count = int(np.ceil(off / STEP))
    f = at + off / (heights.n * heights.dt) * np.linspace(-1, 1, 2 * count + 1)
    height, a, b = _height(heights, f)
    i = int(np.argmax(height))
    return Spot(float(f[i]), float(a[i]), float(b[i]), float(height[i]))
