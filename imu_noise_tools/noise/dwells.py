# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Two levels in the path of a record: how far apart they lie, and how long it dwells in each.

Block means are predicted one after another, by two levels beside a drift, or by whatever else
moves: a Gauss-Markov process beside a drift and steps of any size, or three levels. The drift is
followed beside either. A random walk that is fitted to the spectrum takes dwells of a tenth of the
record for its own, and what it says of the drift is mostly the telegraph.

"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter1d, median_filter

from ..core.statistics import means_of_blocks
from ..loop.verdict import FLEXIBLE

_FOLLOWED = 1024  # block means that are followed
_ROWS = 4  # stretches of them, side by side: each is as long as many dwells
_FEWEST = 32  # blocks of a stretch at least
SHORTEST = 12  # blocks of a dwell: of shorter ones most are neither in one level nor the other
_LEAST = 6  # dwells of a record: of fewer, steps that happen to come back are as likely
_STEPS = 1.0  # steps of a record beside two levels
_LEVEL = 1e-3  # share of a step that makes no levels
_PATHS = 48  # that are followed at once
_CALM = 9  # blocks of which the middle one tells the drift
_WIDE = 4.0  # variance of a level before anything is seen, and of such steps; of the record: 1
_ROUNDS = 14  # of a climb, at most
_REACH = 0.8  # by how much what is on a log scale moves in the first of them
_SETTLED = 0.02  # nats that are no gain
_SLIGHT = 0.1  # step of the search scale that tells a curvature
_CLEAR = 5.0  # standard deviations of a jump that is seen by itself
_SURE = 0.02  # relative error that is not undercut: levels of a real sensor are no two numbers

#: ln p (g,) of block means for g values of each parameter
_Chance = Callable[..., np.ndarray]


class Levels(NamedTuple):
    """
    Two levels, as a symmetric telegraph of the same spectrum has them, and how sure they are.

    ``lead`` is by how many nats they predict the path better than what else moves; the errors are
    of logarithms. ``path`` (n,) is what the levels add to each of the means.

    """

    step: float
    tau: float
    step_error: float
    tau_error: float
    lead: float
    path: np.ndarray


def two_levels(y: np.ndarray, duration: float) -> Levels | None:
    """Return the levels of means (n,) that fill a record, s; None where none are clear."""
    count = len(y) // max(1, len(y) // _FOLLOWED)
    per = len(y) // count
    z = y[:count * per].reshape(count, per).mean(axis=1)
    long = count // _ROWS
    size = float(np.std(z))
    if long < _FEWEST or not size > 0:
        return None
    z = ((z - np.mean(z)) / size)[:long * _ROWS].reshape(_ROWS, long)
    noise = max(float(np.median(np.diff(z, axis=1) ** 2)), 1e-6)
    at, best, curved = _climb(
        lambda *x: _levels(z, *x),
        [(s, r * t, t / r, noise, q) for s, r, t, q in product(
            (0.5, 1.0, 2.0, *_jump(z, noise)), (0.6, 1.0, 1.7), z.size / np.array([9, 18, 36]),
            (1e-5, 1e-3))],
        (0.02, 1.0, 1.0, 1e-8, 1e-8), (10.0, z.size / 2, z.size / 2, 10.0, 1.0))
    step, up, down = np.exp(at[:3])
    share = up / (up + down)
    tau = 2 * (1 - share) * up
    if not SHORTEST <= tau <= z.size / _LEAST:
        return None
    one = np.exp(at)[:, None] * np.array([[_LEVEL], [1], [1], [1], [1]])
    if best - _levels(z, *one)[0] < FLEXIBLE:
        return None  # a drift does it
    rival = _climb(
        lambda *x: _otherwise(z, *x),
        [(s, t, noise, q, j, p / z.size) for (s, t), q, (j, p) in product(
            ((0.1, z.size / 20), (1.0, z.size / 100), (1.0, z.size / 20)), (1e-6, 1e-4, 1e-2),
            ((4.0, 1.0), (0.5, 10.0), (2.0, 20.0)))],
        (1e-3, 1.0, 1e-8, 1e-8, 1e-4, 1e-2 / z.size), (10.0, z.size, 10.0, 1.0, 100.0, 0.5))[1]
    if best - rival < FLEXIBLE or _third(z, np.exp(at)) - best > FLEXIBLE:
        return None
    step_error, tau_error = _errors(curved[:3], float(share))
    path = size * step * _within(y, per, _upper(z.ravel(), np.exp(at)), size * step,
                                 0.5 + 0.5 * np.exp(-2 / (tau * per)))
    return Levels(float(2 * size * step * np.sqrt(share * (1 - share))),
                  float(tau * per * duration / len(y)), step_error, tau_error, best - rival,
                  path - np.mean(path))


def _third(z: np.ndarray, values: np.ndarray) -> float:
    """
    Return ln p of z (rows, k) as it goes between three levels, two of which are near ``values``.

    The third is below, between or above: its place has one sign, so that a log tells it.

    """
    def climbed(places, sign):
        return _climb(
            lambda *x: _levels(z, *x[:5], sign * x[5], x[6]),
            [(*values, where, often) for where, often in product(places, (0.05, 0.3))],
            (0.02, 1.0, 1.0, 1e-8, 1e-8, 0.02, 1e-3),
            (10.0, z.size / 2, z.size / 2, 10.0, 1.0, 20.0, 0.8))[1]

    return max(climbed((0.25, 0.5, 0.75, 1.5, 2.0, 3.0), 1.0), climbed((0.5, 1.0, 2.0), -1.0))


def _jump(z: np.ndarray, noise: float) -> list[float]:
    """Return by how much z (rows, k) jumps in most of its jumps, nothing where none are seen."""
    far = np.abs(z[:, 2:] - z[:, :-2])      # from before a block within which it does to behind
    seen = (far == maximum_filter1d(far, 3, axis=1)) & (far > _CLEAR * np.sqrt(2 * noise))
    return [float(np.median(far[seen]))] if np.any(seen) else []


def _errors(curved: np.ndarray, share: float) -> tuple[float, float]:
    """Return errors of ln step and ln tau of the symmetric telegraph, of a share in the upper."""
    error = 1 / np.sqrt(np.maximum(curved, 1.0))
    turn = np.array([[1, 0.5 - share, share - 0.5], [0, 1 - share, share]])
    step, tau = np.maximum(np.sqrt(turn**2 @ error**2), _SURE)
    return float(step), float(tau)


def _upper(z: np.ndarray, values: np.ndarray) -> np.ndarray:
    """
    Return whether each of z (k,) is in the upper level, on the likeliest of many paths.

    Each is followed with a drift of its own, for what comes before the first switches may be at
    either level, and is told from there on.

    """
    step, up, down, noise, drift = values[:, None]
    ways = _Ways(z.size, step, up, down, noise, drift)
    steps = ways.steps.ravel()
    level, odds = np.array([0, 1]), ways.log_share[:, 0, 0]
    mean, wide = np.zeros(2), np.full(2, _WIDE)
    course = []
    for y in z:
        before = (wide + drift)[:, None]
        seen = before + ways.spread[..., 0, 0][:, level]
        rest = (y - mean - ways.between[..., 0, 0, 0][:, level])[..., None]
        likely = odds[:, None] + ways.log_chance[..., 0, 0][:, level] - 0.5 * (
            rest**2 / seen + np.log(seen))
        best = np.unravel_index(np.argsort(-likely, axis=None)[:_PATHS], likely.shape)
        gain = ((before + 0.5 * steps) / seen)[best]
        mean = mean[best[1]] + gain * rest[best[0], best[1], 0]
        wide = before[best[1], 0] + steps[best[2]] - gain**2 * seen[best]
        level, odds = best[0], likely[best]
        course.append(best)
    return _back(course)


def _back(course: Sequence[tuple[np.ndarray, ...]]) -> np.ndarray:
    """Return the levels (k,) of the first of some paths, of which each place tells the last."""
    out, at = [], 0
    for level, parent, _ in reversed(course):
        out.append(level[at] > 0)
        at = parent[at]
    return np.array(out[::-1])


def _within(y: np.ndarray, per: int, upper: np.ndarray, step: float, stay: float) -> np.ndarray:
    """
    Return the chance of the upper level of each of means (n,), of blocks (k,) of ``per``.

    Beside the drift that the blocks tell; a dwell may be shorter than one of these.

    """
    z = means_of_blocks(y[:len(upper) * per], per)
    drift = median_filter(z - step * upper, _CALM, mode='mirror')   # an end counts once
    rest = y - np.interp(np.arange(len(y)), per * (np.arange(len(z)) + 0.5) - 0.5, drift)
    noise = max(float(np.mean((rest - step * (rest > 0.5 * step)) ** 2)), 1e-12 * step**2)
    density = np.exp(-0.5 * (rest[:, None] - np.array([0.0, step])) ** 2 / noise) + 1e-12
    return both_ways(density, stay)


def both_ways(density: np.ndarray, stay: float) -> np.ndarray:
    """Return the probability of the upper of two levels (k,), of densities (k, 2) in each."""
    down, up = density.T.tolist()
    passed = []
    for low, high in ((down, up), (down[::-1], up[::-1])):
        p, out = 0.5, []
        for a, b in zip(low, high):
            p = stay * p + (1 - stay) * (1 - p)
            out.append(p)
            p = p * b / (p * b + (1 - p) * a)
        passed.append(np.array(out))
    before, after = passed[0], passed[1][::-1]
    yes, no = before * after * density[:, 1], (1 - before) * (1 - after) * density[:, 0]
    return yes / (yes + no)


def _climb(chance: _Chance, starts: Sequence[Sequence[float]], lower: Sequence[float],
           upper: Sequence[float]):
    """
    Return logarithms of values (p,) that are most likely, ln p, and its curvatures (p,) there.

    Each way by itself is looked at on both sides, and where the parabola through these has its
    top: at last as far off as its error, where it is one. Many values at once take hardly longer
    than one.

    """
    some, ends = np.log(np.array(starts)), np.log(np.array([lower, upper]))
    tried = chance(*np.exp(some.T))
    at, best = some[np.argmax(tried)], np.max(tried)
    ways, reach = np.eye(len(at)), np.full(len(at), _REACH)
    for _ in range(_ROUNDS):
        beside = np.clip(np.concatenate([at + reach * ways, at - reach * ways]), *ends)
        seen = chance(*np.exp(beside.T))
        up, down = seen.reshape(2, -1) - best
        curved = -(up + down)
        top = np.where(curved > 0, reach * (up - down) / (2 * np.maximum(curved, 1e-9)),
                       np.sign(up - down) * reach)
        top = np.clip(top, -1.5 * reach, 1.5 * reach)
        further = np.clip(at + np.concatenate([[top, 0.5 * top], np.diag(top)]), *ends)
        trial = np.concatenate([beside, further])
        tried = np.concatenate([seen, chance(*np.exp(further.T))])
        gain = np.max(tried) - best
        if gain > _SETTLED:
            at, best = trial[np.argmax(tried)], np.max(tried)
        # levels far apart are told to a thousandth: what is looked at further off is no parabola
        least = np.minimum(_SLIGHT, reach / np.sqrt(np.maximum(curved, 1e-9)))
        if np.all(reach < 2 * least) and gain < 5 * _SETTLED:
            break
        if gain < 3:
            reach = np.maximum(reach / (2 if gain > _SETTLED else 3), least)
    reach = np.minimum(reach, _SLIGHT)
    near = chance(*np.exp(np.concatenate([at + reach * ways, at - reach * ways]).T))
    return at, float(best), (2 * best - near.reshape(2, -1).sum(axis=0)) / reach**2


class _Ways:
    """
    The ways from one block to the next of two levels or three in white noise beside a drift.

    They lie a ``step`` apart and last ``up`` and ``down`` blocks; ``drift`` is the variance that
    a random walk gains in one. A block within which it switches is anywhere between. Axes: level
    after, level before, whether a step comes, rows, values.

    """

    def __init__(self, size: int, step, up, down, noise, drift, third=None):
        share, keep = up / (up + down), np.exp(-1 / up - 1 / down)
        each, level = np.array([1 - share, share]), np.array([-share * step, (1 - share) * step])
        if third is not None:
            where, often = third
            each = np.array([*(1 - often) * each, often])
            level = np.array([*level, level[0] + where * step])
        stays = np.eye(len(level))[:, :, None]
        comes = np.array([1 - _STEPS / size, _STEPS / size])[:, None, None]
        chance = keep * stays + (1 - keep) * each[:, None]
        between = 0.5 * (level[:, None] + level)
        self.log_chance = np.log(chance[:, :, None, None] * comes)
        self.log_share = np.log(each)[:, None]
        self.between = between[:, :, None, None]
        self.steps = np.array([0.0, _WIDE])[:, None, None]
        apart = (level[:, None] - level)[:, :, None, None]
        self.spread = noise + self.steps / 3 + apart**2 / 12
        self.drift = drift


def _levels(z, step, up, down, noise, drift, *third) -> np.ndarray:
    """
    Return ln p (g,) of z (rows, k) as :class:`_Ways` lead through it.

    Of the drift one normal density is kept for each level (Blom and Bar-Shalom 1988). Of a
    ``third`` level it is told where it is, in steps from the lower one, and how often.

    """
    ways = _Ways(z.size, step, up, down, noise, drift, third or None)
    count = len(ways.log_share)
    shape = (count, 2 * count, len(z), len(step))
    odds = ways.log_share + np.zeros((count, len(z), 1))
    mean, wide = np.zeros(odds.shape), np.full(odds.shape, _WIDE)
    total = np.zeros(len(step))
    for y in z.T:
        before = (wide + ways.drift)[:, None]
        seen = before + ways.spread
        rest = y[:, None] - mean[:, None] - ways.between
        weight, log_sum = _weights((ways.log_chance + odds[:, None] - 0.5 * (
            rest**2 / seen + np.log(seen))).reshape(shape), (0, 1))
        total += log_sum.sum(axis=0)
        gain = (before + 0.5 * ways.steps) / seen
        odds = np.log(np.maximum(weight.sum(axis=1), 1e-12))
        moved = (mean[:, None] + gain * rest).reshape(shape)
        left = (before + ways.steps - gain**2 * seen).reshape(shape)
        likely = _likely(weight, 1)
        mean = (likely * moved).sum(axis=1)
        wide = (likely * (left + (moved - mean[:, None]) ** 2)).sum(axis=1)
    return total


class _Drifting:
    """A Gauss-Markov process x beside a drift d: what is known of both, (rows, g) each."""

    def __init__(self, rows: int, sigma, keep):
        self.keep, self.fresh = keep, sigma**2 * (1 - keep**2)
        self.x = np.zeros((rows, len(sigma)))
        self.d = self.x.copy()
        self.xx, self.xd, self.dd = self.x + sigma**2, self.x.copy(), self.x + _WIDE

    def seen(self, weight: np.ndarray, rest: np.ndarray, seen: np.ndarray,
             steps: np.ndarray) -> None:
        """Learn from a block and go on to the next, by what is (2, rows, g) of each way there."""
        with_x, with_d = self.xx + self.xd, self.xd + self.dd + 0.5 * steps
        x, d = with_x / seen * rest, with_d / seen * rest
        by_x, by_d = (weight * x).sum(axis=0), (weight * d).sum(axis=0)
        xx = (weight * (x**2 - with_x**2 / seen)).sum(axis=0) - by_x**2
        xd = (weight * (x * d - with_x * with_d / seen)).sum(axis=0) - by_x * by_d
        dd = (weight * (steps + d**2 - with_d**2 / seen)).sum(axis=0) - by_d**2
        self.x, self.d = self.keep * (self.x + by_x), self.d + by_d
        self.xx = self.keep**2 * (self.xx + xx) + self.fresh
        self.xd = self.keep * (self.xd + xd)
        self.dd = self.dd + dd


def _otherwise(z, sigma, time, noise, drift, step, comes) -> np.ndarray:
    """
    Return ln p (g,) of z (rows, k) as a Gauss-Markov process beside a drift and steps.

    Steps have the variance ``step`` and come in a block by the chance ``comes``: to come back to
    where it was is nothing that they do.

    """
    log_chance = np.log(np.array([1 - comes, comes]))[:, None]
    steps = np.array([np.zeros(len(step)), step])[:, None]
    known = _Drifting(len(z), sigma, np.exp(-1 / time))
    total = np.zeros(len(step))
    for y in z.T:
        known.dd = known.dd + drift
        seen = known.xx + 2 * known.xd + known.dd + noise + steps / 3
        rest = y[:, None] - known.x - known.d
        weight, log_sum = _weights(log_chance - 0.5 * (rest**2 / seen + np.log(seen)), (0,))
        total += log_sum.sum(axis=0)
        known.seen(_likely(weight, 0), rest, seen, steps)
    return total


def _likely(weight: np.ndarray, axis: int) -> np.ndarray:
    """Return squares of chances, that add to 1: unlikely ways, kept, would widen all others."""
    square = np.maximum(weight, 1e-100) ** 2
    return square / square.sum(axis=axis, keepdims=True)


def _weights(log_p: np.ndarray, axes: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Return chances from their logarithms, that add to 1 over axes, and ln of their sum."""
    top = log_p.max(axis=axes)
    weight = np.exp(log_p - top)
    total = weight.sum(axis=axes)
    return weight / total, top + np.log(total)
