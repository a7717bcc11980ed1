# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Coherent lines of one axis: found in its cosine coefficients, measured jointly, taken out.

A line keeps its phase through the record, or from when it begins to when it ends, so that one
frequency and two amplitudes take its power away. What leaves power behind (a resonance, a motor
whose speed wanders, vibration that comes and goes) is no line, and stays in the spectrum.

"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.fft import irfft, rfft
from scipy.ndimage import maximum_filter1d

from .passing import likeliest, louder, Passing, projected, refined, searched, shortest
from .smooth import smooth_level
from .steady import unsteady
from ..core.spectrum import (
    Bins,
    cosine_transform,
    folded,
    line_basis,
    line_coefficients,
)
from ..core.statistics import MEDIAN, median_of, row_medians
from ..loop.verdict import DIRECTED

CURVED = 256  # coefficients whose level is read from a parabola
MOST_LINES = 24
MOST_HUMPS = 8  # of an axis
MOST_RESOLVED = 16  # of all axes
PIECE = 1 << 15  # of an array as long as the record: what is worked on at a time
HALO = 1 << 11  # of a piece at either end, where lines leak
NEAR = 32  # coefficients on either side from which a line is measured
CROWD = 12  # coefficients within which lines are neighbours
BELOW = 2.0  # the level of the search is so much below that at which a line is believed
FAINT = 0.6  # of that: where four coefficients hold less, no line of that height is
MOST_FAINT = 200  # places where one is looked for
ROUNDS = 3  # of the search, each with the level as it is without the lines found before
RESOLVED = 4.0  # coefficients, two cycles in the record: nearer, a line that fades may do as well
MOST_NEAR = 3  # lines that may be neighbours: more of them are no lines
DOMINANT = 0.8  # share of the power around a line that it takes where it is coherent
CLEAN = 0.98  # share that two lines side by side must take, or one that begins or ends
BESIDE = 8      # times as far to either side, one of these may not leave much
MOST_PASSING = 8    # places where one that begins or ends is looked for
SEEDS = 8  # lines, sure ones and faint ones, whose multiples are looked for
LOWER, HIGHER = 8, 12  # orders that a line may be of, and its company
FOLDED = 32  # readings of a line as one of those orders, folded at Nyquist
MULTIPLE = 3.5  # nats that one of a dozen frequencies reaches by chance every third time
MEMBER = 2.5  # nats beyond that from which it is a line: then one of a dozen in fifteen families
OFF, STEP = 0.2, 0.15  # of 1/T by which a line may be off its order, and by which it is sought
POWERS = 3  # of a slow quantity that a mean may follow
SWING, ORDERS = 10.0, 3  # cycles in the record up to which what recurs is slow, and its orders
NO_LINES = np.zeros((0, 6))     # a line table
CELL = 1  # coefficients by which lines of one cause may be apart: half a cycle in the record
SHOWN = 4.0  # times its power that an axis may be foretold to have: its own may be opposite


def _reach(k, n: int):
    """Return how many coefficients on either side of k its level is taken from."""
    # a filter may end at Nyquist as steeply as drift begins at zero
    return np.clip(0.2 * np.minimum(k, n - k), 12, max(12, n // 100)).astype(int)


def reference_spectrum(c: np.ndarray, dt: float) -> np.ndarray:
    """
    Return a smooth one-sided PSD at every k >= 1 from running medians, (n - 1,), unit^2/Hz.

    Of cosine coefficients c (n,); lines and spikes in it do not show.

    """
    n = len(c)
    centres = np.round(np.geomspace(1, n - 1, 400)).astype(int)
    centres = np.unique(np.concatenate([centres, n - centres]))
    values = np.empty(len(centres))
    for i, (k, reach) in enumerate(zip(centres, _reach(centres, n))):
        some = c[max(1, k - reach):k + reach + 1]
        if len(some) > 2048:
            some = some[:: len(some) // 2048 + 1]
        values[i] = median_of(2 * dt * some * some) / MEDIAN
    at, level = np.log(centres), np.log(np.maximum(values, 1e-300))
    level = _smoothed_below(CURVED, c, dt, centres, level)
    out = np.empty(n - 1)
    for i in range(0, n - 1, PIECE):
        k = np.arange(i + 1, min(i + PIECE, n - 1) + 1)
        out[i:i + PIECE] = np.exp(np.interp(np.log(k), at, level))
    return out


def _smoothed_below(top: int, c, dt, centres, level):
    """
    Return ln of the levels, those of the first centres from parabolas over ln k.

    A few dozen neighbours are too few for a median, and more of them too far apart on a red
    spectrum; a parabola over k/4 ... 4 k follows it. Ordinates far off the median do not pull it.

    """
    last = min(4 * top, len(c) - 1)
    if last < 32:
        return level
    k = np.log(np.arange(1, last + 1))
    rough = np.interp(k, np.log(centres), level)
    seen = np.log(np.maximum(2 * dt * c[1:last + 1] ** 2, 1e-300))
    seen = rough + np.clip(seen - rough, -5, 2.5) + 1.1395  # its mean for one degree of freedom
    parabolas = _parabolas(tuple(centres[centres <= top].tolist()), last)
    right = np.stack([columns @ seen[a:b] for a, b, columns in parabolas])
    left = np.stack([columns @ columns.T for _, _, columns in parabolas])
    out = level.copy()
    out[centres <= top] = np.linalg.solve(left, right[:, :, None])[:, 0, 0]
    return out


@lru_cache(maxsize=4)
def _parabolas(centres: tuple[int, ...], last: int) -> list[tuple[int, int, np.ndarray]]:
    """Return [begin, end) of k - 1 around each centre, and 1, x, x^2 there, x = ln k/centre."""
    log_k, out = np.log(np.arange(1, last + 1)), []
    for centre in centres:
        a, b = max(1, centre // 4) - 1, min(last, max(4 * centre, 32))
        x = log_k[a:b] - log_k[centre - 1]
        out.append((a, b, np.stack([np.ones(len(x)), x, x * x])))
    return out


def strong_lines(z: np.ndarray) -> np.ndarray:
    """
    Return the narrow lines of a piece (k,): vibration, beside which a spike would not stand out.

    Power beyond forty medians is no noise, which reaches fifteen.

    """
    c = rfft(z - np.mean(z))
    groups = len(c) // 128
    if groups < 2:
        return np.zeros(len(z))
    power = np.abs(c) ** 2
    level = row_medians(power[:128 * groups].reshape(groups, 128))
    level = np.interp(np.arange(len(c)), 128 * np.arange(groups) + 63.5, level)
    line = power > 40 * level
    line[:128] = False  # what is slow its neighbours tell
    if not np.any(line):
        return np.zeros(len(z))
    return irfft(np.where(line, c, 0), len(z))


def without_strong_lines(y: np.ndarray) -> np.ndarray:
    """Return samples (n,) less the narrow lines of each piece."""
    out, n = np.empty(len(y)), len(y)
    for i in range(0, n, PIECE - 2 * HALO):
        first = max(0, min(i - HALO, n - PIECE))
        z = y[first:first + PIECE]
        end = min(i + PIECE - 2 * HALO, n)
        out[i:end] = (z - strong_lines(z))[i - first:end - first]
    return out


def line_penalty(n: int, known: int = 0) -> float:
    """
    Return the gain (nats) of a line that noise exceeds once in a thousand records.

    exp(-g) for each of n/2 frequencies that are independent, times sqrt(pi g/3) for the search
    between them (Rice 1954), g near 20. Where higher ones are ``known`` less is asked of the next:
    so many times as often, one line in a thousand is none (Benjamini and Hochberg 1995).

    """
    return float(np.log(1000 * n / 2 * np.sqrt(np.pi * 20 / 3))) - float(np.log1p(known))


def crowding(f: np.ndarray, duration: float, dt: float) -> np.ndarray:
    """
    Return how many times as likely an unrelated line is near f (n,), Hz, as if even over f.

    Nothing tells whether they are even over f or over ln f, from 8/T, where lines begin, to
    Nyquist; either is taken to be as likely. Slow lines stand at multiples the more often.

    """
    lowest = 8 / duration
    return 0.5 + 0.25 / (dt * np.maximum(f, lowest) * -np.log(2 * dt * lowest))


def sure(z: float, n: int, known: int = 0) -> bool:
    """Tell whether a line of height z^2 stands out by itself, not in company alone."""
    return z * z > _least_height(n, known)


def _least_height(n: int, known: int = 0) -> float:
    """Return the height z^2 from which the search takes a line up."""
    return 2 * line_penalty(n, known) - BELOW


@dataclass(frozen=True)
class _Spot:
    """
    A line as the search has it: frequency Hz, a, b, and twice the nats that it gains.

    Less for what is not known of the level. It is there in samples [begin, end), -1 for all.

    """

    frequency: float
    a: float
    b: float
    height: float
    begin: int = 0
    end: int = -1

    def stretch(self, n: int) -> tuple[int, int]:
        """Return [begin, end) of n samples."""
        return self.begin, n if self.end < 0 else self.end


class _Search:
    """The coefficients of a record while lines are taken out of them, the highest first."""

    def __init__(self, c: np.ndarray, reference: np.ndarray, dt: float):
        self.n, self.dt = len(c), dt
        self.whole, self.c, self.reference = c, c, reference
        self.rough, self.unknown = reference, np.zeros((2, 0))
        # four coefficients hold a line of any phase
        self.threshold = _least_height(self.n)
        self.window = np.empty(self.n - 1)
        self.blocked = [(0, 16), (self.n - 17, self.n - 1)]
        self.refused: list[tuple[int, int]] = []    # what is no line above the level as it is
        self._look_everywhere()

    def _four(self, begin: int, end: int) -> np.ndarray:
        """Return the heights of the coefficients 1 + [begin, end) above their level."""
        i, j = max(0, begin - 2), min(self.n - 1, end + 2)
        ratio = 2 * self.dt * self.c[i + 1:j + 1] ** 2 / self.reference[i:j]
        four = np.convolve(ratio, np.ones(4), mode='same')[begin - i:begin - i + end - begin]
        return four / self._doubt(np.arange(begin + 1, end + 1))

    def _doubt(self, k: np.ndarray) -> np.ndarray:
        """Return by how much a height at k must be more for what is not known of its level."""
        if self.unknown.size:   # the mean of exp(-g e^x), of a small x with that variance
            return 1 + 0.5 * line_penalty(self.n) * np.interp(np.log(k), *self.unknown)
        # near both ends it is known from a few dozen coefficients only
        reach = np.where(k <= CURVED, 1.5 * k, _reach(k, self.n))
        return 1 + 25 / (2 * reach + 1)

    def _look_anew(self, changed: bool) -> None:
        """Look at all coefficients once more, above a level that thousands of them tell."""
        if changed:
            self.rough = reference_spectrum(self.c, self.dt)
        at, level, variance = smooth_level(self.c, self.rough, self.dt, _reach)
        self.reference = np.empty(self.n - 1)
        self.unknown, self.refused = np.stack([at, variance]), []
        for i in range(0, self.n - 1, PIECE):
            j = min(i + PIECE, self.n - 1)
            self.reference[i:j] = np.exp(np.interp(np.log(np.arange(i, j) + 1), at, level))
        self._look_everywhere()

    def _look_everywhere(self) -> None:
        """Work all heights out, a piece at a time: a day of them is not held at once."""
        for i in range(0, self.n - 1, PIECE):
            self._look(i, min(i + PIECE, self.n - 1))

    def _look(self, begin: int, end: int) -> None:
        """Work those heights out anew, where something may be looked for."""
        self.window[begin:end] = self._four(begin, end)
        for low, high in (*self.blocked, *self.refused):
            if low < end and high > begin:
                self.window[max(low, begin):min(high, end)] = 0

    def _add(self, spot: _Spot, sign: float) -> None:
        """Add a line to the coefficients around it, or take it away."""
        if self.c is self.whole:
            self.c = self.whole.copy()
        centre = int(2 * self.n * self.dt * spot.frequency)
        reach = min(1 << 15, 64 + int(8 * np.sqrt(spot.height)))
        low, high = max(1, centre - reach), min(self.n, centre + reach)
        self.c[low:high] += sign * line_coefficients(
            spot.frequency, spot.a, spot.b, np.arange(low, high), self.n, self.dt,
            *spot.stretch(self.n))
        self._look(low - 1, high - 1)

    def _measured(self, k: int) -> _Spot:
        """Return the line nearest to a coefficient."""
        some = np.arange(max(1, k - NEAR), min(self.n, k + NEAR + 1))
        root = np.sqrt(2 * self.dt / self.reference[some - 1])
        y = root * self.c[some]
        best, step = float(k), 0.1
        for count in (21, 10, 10):
            at = best + step * np.arange(-count, count + 1)
            wave = line_basis(at[:, None] / (2 * self.n * self.dt), some, self.n, self.dt)
            energy, a, b = projected(root * wave, y)
            i = int(np.argmax(energy))
            best, step = float(at[i]), step / 10
        height = energy[i] / self._doubt(np.array(k))
        return _Spot(best / (2 * self.n * self.dt), float(a[i]), float(b[i]), float(height))

    def _power(self, spots: list[_Spot], wider: int = 1) -> tuple[float, float]:
        """Return the power (over the level) beyond the noise around some lines, its scatter."""
        low, high = self._around(spots, wider)
        ratio = 2 * self.dt * self.c[low:high] ** 2 / self.reference[low - 1:high - 1]
        return float(np.sum(ratio)) - (high - low), float(np.sqrt(2 * (high - low)))

    def _around(self, spots: list[_Spot], wider: int = 1) -> tuple[int, int]:
        at = [int(2 * self.n * self.dt * s.frequency) for s in spots]
        # what is there for a while is spread over as many more
        begin, end = np.array([s.stretch(self.n) for s in spots]).T
        reach = wider * CROWD * max(1, int(self.n / (4 * np.min(end - begin))))
        return max(1, min(at) - reach), min(self.n, max(at) + reach + 1)

    def _settle(self, spots: list[_Spot]) -> list[_Spot]:
        """
        Return which of some neighbours are lines: one that takes most of the power around it.

        Or two that leave nothing. The others are put back, and nothing more is looked for there.

        """
        for s in spots:
            self._add(s, 1.0)
        some = sorted(spots, key=lambda s: -s.height)[:2]
        power, scatter = self._power(spots)
        left, noise = [power], 3 * scatter
        for s in some:
            self._add(s, -1.0)
            left.append(self._power(spots)[0])
        alone = left[1] < (1 - DOMINANT) * left[0] + noise
        both = len(some) > 1 and self._apart(some) and left[2] < noise + (
            (1 - CLEAN) * left[0] if not alone else (1 - DOMINANT) * left[1])
        low, high = self._around(spots)
        count = 2 if both else 1 if alone else 0
        # and each must stand out of what is left around it, where that is more than chance
        level = 1 + left[count] / (high - low) if left[count] > 2 * scatter else 1.0
        kept = [s for s in some[:count] if s.height > self.threshold * level]
        for s in some:
            if s not in kept:
                self._add(s, 1.0)
        self._block(spots, self.blocked if kept else self.refused)
        return kept

    def _block(self, spots: list[_Spot], blocked: list[tuple[int, int]]) -> None:
        """Look no more around lines, as far as what is left there stands above its level."""
        low, high = self._around(spots)
        while low > 16 and np.max(self.window[max(low - CROWD, 0):low]) > self.threshold:
            low = max(low - CROWD, 0)
        while high < self.n - 17 and np.max(self.window[high:high + CROWD]) > self.threshold:
            high += CROWD
        blocked.append((low, high))
        self.window[low:high] = 0

    def lines(self) -> list[_Spot]:
        """Return the coherent lines: the high ones, and those that their skirts had covered."""
        found: list[_Spot] = []
        for i in range(ROUNDS):
            before = len(found)
            self.threshold = _least_height(self.n, before)
            self._more(found)
            if len(found) >= MOST_LINES or i and len(found) == before:
                break
            self._look_anew(len(found) > 0)
        self._beside_one(found)
        return self._passing(self._steady(found[:MOST_LINES]))

    def _steady(self, found: list[_Spot]) -> list[_Spot]:
        """Return the lines that keep amplitude and phase; put back those that do not."""
        if not found:
            return found
        lines = np.array([[s.frequency, s.a, s.b] for s in found])
        lines = _jointly(lines, self.whole, self.reference, self.dt)
        some = unsteady(lines, self.whole, self.reference, self.dt, NEAR, 1 - DOMINANT)
        for s in (s for s, no in zip(found, some) if no):
            self._add(s, 1.0)
        return [s for s, no in zip(found, some) if not no]

    def _passing(self, found: list[_Spot]) -> list[_Spot]:
        """Return the lines, those among them that begin or end within the record as such."""
        out = list(found)
        for _ in range(2):      # again above the level without what they had left
            for i, s in enumerate(out):
                left, scatter = self._power([s])
                if left < scatter and s == found[i]:    # it leaves nothing that another would take
                    continue
                self._add(s, 1.0)
                out[i] = self._while_there(s) or s
                self._add(out[i], -1.0)
            if out == found:
                break
            self._look_anew(True)
        self.refused = []
        self.blocked = [*self.blocked[:2], *(self._around([s]) for s in out)]
        self._look_everywhere()
        for _ in range(MOST_PASSING):
            k = int(np.argmax(self.window))
            if self.window[k] < self.threshold or len(out) >= MOST_LINES:
                break
            spot = self._measured(k + 1)
            there = self._while_there(spot)
            if there is not None:
                self._add(there, -1.0)
                out.append(there)
            self._block([there or spot], self.blocked if there else self.refused)
        return out

    def _while_there(self, spot: _Spot) -> _Spot | None:
        """
        Return the line that is there for a part of the record only; None where there is no such.

        Of a line that is now in the coefficients. Nothing of it must be left, and it must be
        likelier than a line throughout, and much more so than one that fades.

        """
        line = likeliest(spot.frequency, self.c, self.reference, self.dt)
        if line.end - line.begin == self.n:
            return None
        there = self._spot(line)
        twice = 2 * searched()
        throughout = self._measured(int(2 * self.n * self.dt * spot.frequency)).height
        if there.height < max(self.threshold, throughout + 2 * DIRECTED) + twice:
            return None
        fading = self._left_by_one_that_fades(there)
        line = refined(line, self.c, self.reference, self.dt)
        there = self._spot(line)
        if there.end - there.begin <= shortest(self.n):
            return None
        (power, scatter), (_, wide) = self._power([there]), self._power([there], BESIDE)
        self._add(there, -1.0)
        left, beside = (self._power([there], reach)[0] for reach in (1, BESIDE))
        loud = louder(line, self.c, self.reference, self.dt)
        self._add(there, 1.0)
        # and it is no place where a line that wanders stayed a while
        is_clean = left < (1 - CLEAN) * power + 3 * scatter \
            and beside < (1 - DOMINANT) * power + 3 * wide
        stands_out = there.height > loud * (self.threshold + twice)
        return there if is_clean and stands_out and fading - left > 2 * DIRECTED else None

    def _spot(self, line: Passing) -> _Spot:
        doubt = self._doubt(np.array(int(2 * self.n * self.dt * line.frequency)))
        return _Spot(line.frequency, line.a, line.b, float(line.height / doubt),
                     line.begin, line.end)

    def _beside_one(self, found: list[_Spot]) -> None:
        """
        Add lines that stand beside a line found, where the two of them leave nothing.

        A strong line lifts the level from which its neighbour is to stand out, and what is near a
        line is not looked at again: what an unsteady one leaves is no line.

        """
        for i, spot in enumerate(list(found)):
            low, high = self._around([spot])
            if len(self._near(found, spot)) > 1 or low < 16 or high > self.n - 16:
                continue
            four = self._four(low - 1, high - 1)
            k = low + int(np.argmax(four))
            if four[k - low] < self.threshold:
                continue
            pair = self._pair(spot, self._measured(k))
            alone = self._power([spot])[0]
            self._add(spot, 1.0)
            fading = self._left_by_one_that_fades(spot)
            for s in pair:
                self._add(s, -1.0)
            left, scatter = self._power([spot])
            apart = self._apart(pair) or fading - left > self.threshold
            if apart and left < 3 * scatter and alone - left > self.threshold:
                found[i] = pair[0]
                found.append(pair[1])
                self._block(pair, self.blocked)
            else:
                for s in pair:
                    self._add(s, 1.0)
                self._add(spot, -1.0)

    def _apart(self, pair: list[_Spot]) -> bool:
        """Tell whether two lines are further apart than one that fades is broad."""
        return 2 * self.n * self.dt * abs(pair[0].frequency - pair[1].frequency) > RESOLVED

    def _left_by_one_that_fades(self, spot: _Spot) -> float:
        """
        Return the power left around a line, now in the coefficients, that may fade and wander.

        Its two amplitudes are parabolas in time, of one parameter more than two lines have: the
        waves at its frequency with their first and second differences, which are t and t^2 times
        them. Lines that beat by more than a cycle it does not follow.

        """
        centre = int(2 * self.n * self.dt * spot.frequency)
        low, high = self._around([spot])
        some = np.arange(max(1, min(centre - NEAR, low)),
                         min(self.n, max(centre + NEAR + 1, high)))
        root = np.sqrt(2 * self.dt / self.reference[some - 1])
        f = spot.frequency + 0.05 / (self.n * self.dt) * np.array([[-1], [0], [1]])
        down, wave, up = root * line_basis(f, some, self.n, self.dt)
        columns = [x for w in (wave, up - down, up + down - 2 * wave) for x in (w.real, w.imag)]
        x = np.array(columns) / np.linalg.norm(columns, axis=1)[:, None]
        y = root * self.c[some]
        y = y - np.linalg.lstsq(x.T, y, rcond=1e-9)[0] @ x
        return float(np.sum(y[(some >= low) & (some < high)] ** 2)) - (high - low)

    def _pair(self, spot: _Spot, other: _Spot) -> list[_Spot]:
        """Return a line that was taken out and one beside it, measured together."""
        self._add(spot, 1.0)
        both = np.array([[s.frequency, s.a, s.b] for s in (spot, other)])
        both = _jointly(both, self.c, self.reference, self.dt)
        self._add(spot, -1.0)
        return [_Spot(float(f), float(a), float(b), s.height)
                for (f, a, b), s in zip(both, (spot, other))]

    def family(self, found: list[_Spot]) -> list[_Spot]:
        """
        Return fainter lines: at multiples of one frequency, each too faint to be sure by itself.

        Of a line that is known few frequencies are multiples, so that chance reaches less there;
        and several that are none by themselves may be sure together, or beside others that stand
        at multiples.

        """
        best, most = [], 0.0
        sure = sorted(found, key=lambda s: -s.height)[:SEEDS]
        for seed in [*sure, *self._faint()]:
            for f0, order, is_folded in self._readings(seed.frequency, seed in found):
                # once in a thousand records, by whichever line and reading of it
                tried = np.log((FOLDED if is_folded else LOWER) * max(len(sure), 1))
                if seed not in found:
                    tried += max(line_penalty(self.n) - 0.5 * seed.height, 0.0)
                company, known = self._multiples(f0, order, is_folded, seed, found)
                # lines that are known tell which reading it is, and nothing of those that are not
                gain = sum(more for _, more in company) - max(tried - known, 0.0) - np.log(1000)
                if gain > most:
                    best, most = [seed, *(s for s, more in company if more > MEMBER)], gain
        return [s for s in best if s not in found]

    def _readings(self, f: float, folds: bool) -> Iterator[tuple[float, int, bool]]:
        """Yield (f0, order, whether folded at Nyquist) as which a line may be read."""
        for order in range(1, LOWER + 1):
            yield f / order, order, False
        for order in range(2, LOWER + 1 if folds else 2):
            for m in range(1, order // 2 + 1):
                for f0 in (abs(m / self.dt + side * f) / order for side in (1, -1)):
                    if f0 * self.dt < 0.5:      # beyond, it is the mirror image of another
                        yield f0, order, True

    def _faint(self) -> list[_Spot]:
        """Return the highest of what is too low for a line, what is near one left out."""
        out, window = [], self.window.copy()
        for _ in range(SEEDS):
            k = int(np.argmax(window))
            if window[k] < 0.5 * self.threshold:
                break
            window[max(k - CROWD, 0):k + CROWD + 1] = 0
            spot = self._measured(k + 1)
            height = float(self._height(np.array([spot.frequency]))[0][0])
            out.append(replace(spot, height=height))
        return out

    def _height(self, f: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """
        Return twice the nats (f,) that a line at each of near frequencies gains, and a, b.

        Beside the level around: where a crowd stands out none of it is a line.

        """
        k = int(2 * self.n * self.dt * f[len(f) // 2])
        some = np.arange(max(1, k - NEAR), min(self.n, k + NEAR + 1))
        energy, a, b = projected(line_basis(f[:, None], some, self.n, self.dt), self.c[some])
        level = median_of(self.reference[some - 1])
        beside = np.abs(some - k) > CROWD
        level = max(level, 2 * self.dt * float(np.mean(self.c[some[beside]] ** 2)))
        return 2 * self.dt * energy / level, a, b

    def _multiples(self, f0: float, order: int, is_folded: bool, seed: _Spot,
                   known: list[_Spot]) -> tuple[list[tuple[_Spot, float]], float]:
        """
        Return what stands at the other orders of f0, read from a line of ``order``.

        With each how many nats it has beyond what one of them has by chance; and how many lines
        that are known have by standing at one.

        """
        out: list[tuple[_Spot, float]] = []
        orders = np.delete(np.arange(1, HIGHER + 1), order - 1)
        places, off = folded(orders * f0, self.dt), OFF * (1 + orders / order)
        others = np.array([s.frequency for s in known if s != seed])
        stands = np.any(np.abs(places[:, None] - others) * self.n * self.dt < off[:, None], axis=1)
        if is_folded and not np.any(stands):    # one line alone may be read in so many ways
            return out, 0.0
        by_chance = 4 * off[stands] * HIGHER * len(others) / self.n * crowding(
            places[stands], self.n * self.dt, self.dt)
        chances = 2 * (MULTIPLE + np.log1p(2 * off))
        high = self._high(places, int(2 * np.max(off)) + 2)
        for i in np.flatnonzero(~stands & (high > chances)):
            if self._near([*known, *(s for s, _ in out)], _Spot(float(places[i]), 0.0, 0.0, 0.0)):
                continue
            spot = self._highest(float(places[i]), float(off[i]))
            if spot.height > chances[i]:
                out.append((spot, 0.5 * (spot.height - float(chances[i]))))
        return out, float(-np.sum(np.log(np.minimum(by_chance, 1.0))))

    def _high(self, f: np.ndarray, reach: int) -> np.ndarray:
        """Return the highest window (f,) near frequencies; none near the ends."""
        middle = (2 * self.n * self.dt * f).astype(int)
        near = middle[:, None] + np.arange(-reach, reach)
        inside = (middle > 2 * NEAR) & (middle < self.n - 2 * NEAR)
        return np.where(inside, np.max(self.window[np.clip(near, 0, self.n - 2)], axis=1), 0.0)

    def _highest(self, at: float, off: float) -> _Spot:
        """Return the highest line at most so many 1/T from a frequency."""
        count = int(np.ceil(off / STEP))
        f = at + off / (self.n * self.dt) * np.linspace(-1, 1, 2 * count + 1)
        height, a, b = self._height(f)
        i = int(np.argmax(height))
        return _Spot(float(f[i]), float(a[i]), float(b[i]), float(height[i]))

    def _more(self, settled: list[_Spot]) -> None:
        """Add to the lines what stands out of the coefficients now."""
        found: list[_Spot] = []
        for _ in range(4 * MOST_LINES):
            k = int(np.argmax(self.window))
            if self.window[k] < self.threshold or len(found) + len(settled) >= MOST_LINES:
                break
            spot = self._measured(k + 1)
            near = self._near(found, spot)
            self._add(spot, -1.0)
            found.append(spot)
            if len(near) >= MOST_NEAR:
                kept = self._settle([*near, spot])
                found = [s for s in found if s in kept or (s not in near and s != spot)]
        for spot in self._spread_out():
            if len(found) + len(settled) < MOST_LINES and not self._near(found, spot):
                self._add(spot, -1.0)
                found.append(spot)
        while found:
            crowd = [found[0]]
            while len(more := [s for s in found if any(self._near([s], x) for x in crowd)]) \
                    > len(crowd):
                crowd = more
            settled += self._settle(crowd)
            found = [s for s in found if s not in crowd]

    def _spread_out(self) -> list[_Spot]:
        """Return lines, highest first, of which four coefficients do not hold enough."""
        near = maximum_filter1d(self.window, 2 * CROWD + 1)
        some = np.flatnonzero((self.window == near) & (near > FAINT * self.threshold))
        some = some[np.argsort(-self.window[some], kind='stable')][:MOST_FAINT]
        spots = [self._measured(k + 1) for k in some.tolist()]
        return sorted((s for s in spots if s.height > self.threshold), key=lambda s: -s.height)

    def _near(self, some: list[_Spot], spot: _Spot) -> list[_Spot]:
        width = CROWD / (2 * self.n * self.dt)
        return [s for s in some if abs(s.frequency - spot.frequency) < width]


def find_peaks(c: np.ndarray, reference: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """
    Return the coherent lines (l, 6), highest first, and the humps (h, 3), clearest first.

    Of a line frequency Hz, a, b of a cos + b sin, z, and the samples [begin, end) in which it is
    there; of a hump frequency and width, Hz, and what it is worth in nats.

    Parameters
    ----------
    c : ndarray (n,)
        Cosine coefficients.
    reference : ndarray (n - 1,)
        Smooth one-sided PSD at each coefficient k >= 1 (:func:`reference_spectrum`).
    dt : float
        Interval, s.

    """
    table, humps = NO_LINES, np.zeros((0, 3))
    if len(c) < 200:
        return table, humps
    search = _Search(c, reference, dt)
    spots = search.lines()
    spots = sorted([*spots, *search.family(spots)], key=lambda s: -s.height)[:MOST_LINES]
    if spots:
        table = np.array([[s.frequency, s.a, s.b, np.sqrt(s.height), *s.stretch(len(c))]
                          for s in spots])
        table[:, :3] = _jointly(table[:, :3], c, search.reference, dt, table[:, 4:].astype(int))
    return table, _humps(search)


def _humps(search: _Search) -> np.ndarray:
    """
    Return (h, 3): frequency, width and nats of what is too narrow for the usual bins.

    The windows, from 4 coefficients to a 64th of the record, whose power stands highest above the
    smooth spectrum.

    """
    n, dt = search.n, search.dt
    total = np.zeros((n - 1) // 2 + 1)      # of pairs of coefficients
    for i in range(1, len(total), PIECE):
        j = min(i + PIECE, len(total))
        ratio = 2 * dt * search.c[2 * i - 1:2 * j - 1] ** 2 / search.rough[2 * i - 2:2 * j - 2]
        total[i:j] = ratio[::2] + ratio[1::2]
    np.cumsum(total, out=total)
    found, width = [], 4
    while width <= max(n // 64, 8):
        half, step = width // 2, max(1, width // 4)
        x = (total[half::step] - total[:-half:step]) / width
        # ln x < x - 1: what is lower than this has too few nats
        some = np.flatnonzero(x > 1 + np.sqrt(2 * line_penalty(n) / width))
        x, at = x[some], some * step * 2 + half + 1
        nats = 0.5 * width * (x - 1 - np.log(x))
        nats[(at < 16) | (at > n - 16)] = 0.0
        best = np.argsort(-nats)[:1000]
        found += [(nats[i], int(at[i]), width) for i in best if nats[i] > line_penalty(n)]
        width *= 2
    out: list[tuple[float, float, float]] = []
    taken: list[tuple[int, int]] = []
    for gain, k, width in sorted(found, reverse=True):
        if len(out) == MOST_HUMPS:
            break
        if all(k + width < low or k - width > high for low, high in taken):
            out.append((k / (2 * n * dt), width / (4 * n * dt), gain))
            taken.append(_extent(total, k, width))
    return np.array(out).reshape(-1, 3)


def _extent(total: np.ndarray, k: int, width: int) -> tuple[int, int]:
    """Return [low, high) of the coefficients where the power of a hump stands above the level."""
    step, ends = max(width // 2, 1), []
    for sign in (-1, 1):
        i = k // 2 + sign * step
        while 0 <= i and i + step < len(total) \
                and total[i + step] - total[i] > 2 * step * (1 + 2 / np.sqrt(step)):
            i += sign * step
        ends.append(2 * i)
    return ends[0], ends[1] + 2 * step


def fine_edges(humps: np.ndarray) -> tuple[float, ...]:
    """
    Return edges (Hz) of bins that resolve the humps (h, 3) of all axes, closest at their middle.

    One that several axes show is resolved once, the clearest of it.

    """
    reach = np.array([0.15, 0.4, 0.7, 1.1, 1.7, 2.8, 4.5, 8.0])
    offsets = np.concatenate([-reach, reach])
    chosen: list[tuple[float, float]] = []
    for f, width, _ in sorted(humps.tolist(), key=lambda h: -h[2]):
        if all(abs(f - g) > 0.5 * (width + w) or not 0.3 < width / w < 3 for g, w in chosen):
            chosen.append((f, width))
    edges = [f + width * x for f, width in chosen[:MOST_RESOLVED] for x in offsets]
    return tuple(sorted(float(x) for x in edges))


def _jointly(lines: np.ndarray, c, reference, dt, stretch=None) -> np.ndarray:
    """
    Return (l, 3), frequency, a, b of all lines by least squares at once.

    Gauss and Newton's steps on the coefficients around all of them, so that the skirts of a strong
    line are no part of a weak one. ``stretch`` (l, 2) are the samples in which each is there.

    """
    n = len(c)
    stretch = np.tile([0, n], (len(lines), 1)) if stretch is None else stretch
    at = (2 * n * dt * lines[:, 0]).astype(int)
    k = np.unique(np.clip(at[:, None] + np.arange(-NEAR, NEAR + 1), 1, n - 1))
    root = np.sqrt(2 * dt / reference[k - 1])
    size, small = 2 * n * dt, 1e-4
    f, amplitudes = lines[:, 0], lines[:, 1:]
    for _ in range(4):
        wave = [np.array([line_basis(x + d / size, k, n, dt, *there)
                          for x, there in zip(f, stretch)]) for d in (-small, 0.0, small)]
        a, b = amplitudes[:, :1], amplitudes[:, 1:]
        slope = (wave[2] - wave[0]) / (2 * small)
        columns = np.concatenate(
            [wave[1].real, wave[1].imag, a * slope.real + b * slope.imag]) * root
        now = np.sum(a * wave[1].real + b * wave[1].imag, axis=0)
        scale = np.sqrt(np.sum(columns**2, axis=1))
        step = np.linalg.lstsq((columns / scale[:, None]).T, (c[k] - now) * root, rcond=1e-9)[0]
        da, db, df = np.split(step / scale, 3)
        f = f + np.clip(df, -0.5, 0.5) / size
        amplitudes = amplitudes + np.column_stack([da, db])
    return np.column_stack([f, amplitudes])


def also_in(frequency: np.ndarray, x: np.ndarray, dt: float, top: int,
            axis: np.ndarray | None = None) -> np.ndarray:
    """
    Tell which lines of an axis, Hz (l,), a slow quantity has too: it, its square or its cube.

    Where one stands is known, so that noise exceeds what is asked of each once in a thousand
    times; it must be the highest near by, or it is the skirt of another. But the quantity has
    cycles of its own, and images of them where it is read now and then: an axis that follows it as
    far as the line says must show what it is foretold at lower frequencies.

    Parameters
    ----------
    frequency : ndarray (l,)
        Of the lines, Hz.
    x : ndarray (s,)
        The quantity, as long as the axis.
    dt : float
        Its interval, s.
    top : int
        Coefficient up to which what follows the quantity is told from it.
    axis : ndarray (s,) or None
        The axis in the same means; None where x is the axis.

    """
    n, out = len(x), np.zeros(len(frequency), bool)
    able = np.flatnonzero(2 * n * dt * frequency < min(top, n // 4))
    if not len(able) or n < 200 or not np.ptp(x) > 0:
        return out
    seen = None if axis is None else cosine_transform(axis)
    u = x - np.mean(x)
    u = u / np.sqrt(np.mean(u * u))
    for power in range(1, POWERS + 1):
        c = cosine_transform(u**power)
        level = reference_spectrum(c, dt)
        for i in able:
            out[i] |= _is_in(float(frequency[i]), c, level, dt, seen)
    return out


def _is_in(frequency: float, c: np.ndarray, level: np.ndarray, dt: float,
           seen: np.ndarray | None) -> bool:
    """Tell whether coefficients c (n,) have a line, and an axis's own, ``seen``, as much of it."""
    n, offsets = len(c), np.arange(-2 * CROWD, 2 * CROWD + 1)
    middle = int(2 * n * dt * frequency)
    k = np.arange(max(1, middle - NEAR), min(n, middle + NEAR + 1))
    root = np.sqrt(2 * dt / level[k - 1])
    wave = line_basis((frequency + offsets / (4 * n * dt))[:, None], k, n, dt)
    energy, a, b = projected(root * wave, root * c[k])
    best, here = int(np.argmax(energy)), 2 * CROWD
    # chi-squared with two degrees of freedom, at as many places as there are cells near
    if abs(offsets[best]) > 2 * CELL or energy[best] <= 2 * np.log(1000 * POWERS * 2 * CELL):
        return False
    return seen is None or _shows(seen, c, level[middle - 1] / (2 * dt), middle,
                                  wave[here:here + 1], k, float(a[here]**2 + b[here]**2))


def _shows(seen: np.ndarray, c: np.ndarray, noise: float, middle: int, wave: np.ndarray,
           k: np.ndarray, size: float) -> bool:
    """
    Tell whether an axis shows what it is foretold by a line at a coefficient, octave by octave.

    Of the coefficients of the axis and of a quantity, whose line has the square ``size`` and
    beside it as much noise as it may have anywhere.

    """
    _, a, b = projected(wave, seen[k])
    gain = (a[0]**2 + b[0]**2) / size
    high = middle - CROWD // 2
    while high > 4:
        low = high // 2
        some = np.arange(low, high)
        # a quantity that is read late loses of the line more than of what is slower, up to f
        foretold = gain * (some / middle) ** 2 @ (c[some]**2 - noise)
        if foretold > SHOWN * np.sum(seen[some]**2):
            return False
        high = low
    return True


def of_a_swing(frequency: np.ndarray, y: np.ndarray, dt: float) -> np.ndarray:
    """
    Tell which lines of an axis, Hz (l,), are orders of one slow swing of its mean.

    A swing of a few cycles in the record that is no sine has orders that are fast enough to be
    lines; by themselves they would be a machine's. Of one that is a sine there is one line. One
    that jumps has more orders than the mean, which are lines in any case: of one family.

    Parameters
    ----------
    frequency : ndarray (l,)
        Of the lines, Hz.
    y : ndarray (s,)
        Slow means of the axis.
    dt : float
        Their interval, s.

    """
    out, cell = np.zeros(len(frequency), bool), CELL / (2 * len(y) * dt)
    for order in range(2, ORDERS + 1):
        first = frequency / order
        more = np.arange(ORDERS + 1, 2 * ORDERS + 1)[:, None, None] * first[:, None]
        mine = also_in(first, y, dt, int(2 * SWING)) & ~np.any(
            np.abs(frequency - more) < cell, axis=(0, 2))
        out |= mine
        out |= np.any(np.abs(frequency[:, None] - first[mine]) < cell, axis=1)
    return out


def waves(lines: np.ndarray, t: np.ndarray, dt: float, length: int = 1) -> np.ndarray:
    """
    Return the sum (n,) of lines in time, or in means of so many samples.

    Parameters
    ----------
    lines : ndarray (l, 6)
        Of a line table: frequency Hz, a, b of a cos + b sin, z, begin and end.
    t : ndarray (n,)
        The middle of each mean, s.
    dt : float
        Interval of the samples, s.
    length : int
        Samples in a mean.

    """
    out = np.zeros(len(t))
    first = t / dt - 0.5 * (length - 1)
    for frequency, a, b, _, begin, end in lines:
        angle = 2 * np.pi * frequency * t
        gain = np.sinc(frequency * dt * length) / np.sinc(frequency * dt)
        there = np.minimum(first + length, end) - np.maximum(first, begin)
        out += gain * np.clip(there / length, 0, 1) * (a * np.cos(angle) + b * np.sin(angle))
    return out


def _in_coefficients(table: np.ndarray, n: int, first: int,
                     dt: float) -> Iterator[tuple[int, int, int, np.ndarray]]:
    """Yield (row, low, high, what it has in those) of n coefficients from a sample on."""
    for i, (frequency, a, b, z, *stretch) in enumerate(table):
        begin, end = np.clip(np.subtract(stretch, first), 0, n).astype(int)
        if begin == end:
            continue
        angle = 2 * np.pi * frequency * dt * first
        a, b = a * np.cos(angle) + b * np.sin(angle), b * np.cos(angle) - a * np.sin(angle)
        centre = int(2 * n * dt * frequency)
        reach = min(1 << 15, 64 + int(40 * z))  # beyond, it is a hundredth of the noise
        low, high = max(1, centre - reach), min(n, centre + reach)
        yield i, low, high, line_coefficients(
            frequency, a, b, np.arange(low, high), n, dt, begin, end)


def without_lines(c: np.ndarray, dt: float) -> np.ndarray:
    """Return cosine coefficients c (n,) without the coherent lines in them."""
    reference = reference_spectrum(c, dt)
    if not np.any(dt * c[1:]**2 > line_penalty(len(c)) * reference):
        return c
    out = c.copy()
    for _, low, high, line in _in_coefficients(find_peaks(c, reference, dt)[0], len(c), 0, dt):
        out[low:high] -= line
    return out


def take_lines_out(c: np.ndarray, table: np.ndarray, begin: int, dt: float,
                   bins: Bins) -> np.ndarray:
    """
    Subtract the lines from the coefficients of a part that begins at a sample, in place.

    Return what each adds to the power of the bins (l, b).

    """
    out = np.zeros((len(table), len(bins.first)))
    for i, low, high, line in _in_coefficients(table, len(c), begin, dt):
        added = 2 * dt * (c[low:high] ** 2 - (c[low:high] - line) ** 2)
        c[low:high] -= line
        i0, i1 = bins.index(low), bins.index(high - 1) + 1
        starts = np.maximum(bins.first[i0:i1] - low, 0)
        out[i, i0:i1] = np.add.reduceat(added, starts) / bins.count[i0:i1]
    return out
