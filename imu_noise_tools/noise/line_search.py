# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The search for coherent lines in cosine coefficients: which of what stands out is one.

The highest is measured and taken out, and what its skirts had covered is looked for again, above
a level that is better known. What takes most of the power around it and is as strong in all of the
record is a line; so are two side by side that leave nothing, and what begins or ends within it.

"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import maximum_filter1d

from .heights import Heights, jointly, Spot
from .humps import find_humps
from .line_families import family
from .lines import CROWD, in_coefficients, least_height, line_penalty, NEAR, NO_LINES
from .passing import likeliest, louder, Passing, refined, searched, shortest
from .smooth import reference_spectrum
from .steady import unsteady
from ..core.spectrum import line_basis
from ..loop.verdict import DIRECTED

MOST_LINES = 24
FAINT = 0.6  # of the threshold: where four coefficients hold less, no line of that height is
MOST_FAINT = 200  # places where one is looked for
ROUNDS = 3  # of the search, each with the level as it is without the lines found before
RESOLVED = 4.0  # coefficients, two cycles in the record: nearer, a line that fades may do as well
MOST_NEAR = 3  # lines that may be neighbours: more of them are no lines
DOMINANT = 0.8  # share of the power around a line that it takes where it is coherent
CLEAN = 0.98  # share that two lines side by side must take, or one that begins or ends
BESIDE = 8      # times as far to either side, one of these may not leave much
MOST_PASSING = 8    # places where one that begins or ends is looked for


class _Search:
    """The search for lines among the heights of a record, the highest first."""

    def __init__(self, heights: Heights):
        self.heights = heights

    def lines(self) -> list[Spot]:
        """Return the coherent lines: the high ones, and those that their skirts had covered."""
        found: list[Spot] = []
        for i in range(ROUNDS):
            before = len(found)
            self.heights.threshold = least_height(self.heights.n, before)
            self._more(found)
            if len(found) >= MOST_LINES or i and len(found) == before:
                break
            self.heights.look_anew(len(found) > 0)
        self._beside_one(found)
        return self._passing(self._steady(found[:MOST_LINES]))

    def _more(self, settled: list[Spot]) -> None:
        """Add to the lines what stands out of the coefficients now."""
        found: list[Spot] = []
        for _ in range(4 * MOST_LINES):
            k = int(np.argmax(self.heights.window))
            if self.heights.window[k] < self.heights.threshold \
                    or len(found) + len(settled) >= MOST_LINES:
                break
            spot = self.heights.measured(k + 1)
            near = self.heights.near(found, spot)
            self.heights.add(spot, -1.0)
            found.append(spot)
            if len(near) >= MOST_NEAR:
                kept = self._settle([*near, spot])
                found = [s for s in found if s in kept or (s not in near and s != spot)]
        for spot in self._spread_out():
            if len(found) + len(settled) < MOST_LINES and not self.heights.near(found, spot):
                self.heights.add(spot, -1.0)
                found.append(spot)
        while found:
            crowd = [found[0]]
            while len(more := [s for s in found if any(
                    self.heights.near([s], x) for x in crowd)]) > len(crowd):
                crowd = more
            settled += self._settle(crowd)
            found = [s for s in found if s not in crowd]

    def _spread_out(self) -> list[Spot]:
        """Return lines, highest first, of which four coefficients do not hold enough."""
        window, threshold = self.heights.window, self.heights.threshold
        near = maximum_filter1d(window, 2 * CROWD + 1)
        some = np.flatnonzero((window == near) & (near > FAINT * threshold))
        some = some[np.argsort(-window[some], kind='stable')][:MOST_FAINT]
        spots = [self.heights.measured(k + 1) for k in some.tolist()]
        return sorted((s for s in spots if s.height > threshold), key=lambda s: -s.height)

    def _settle(self, spots: list[Spot]) -> list[Spot]:
        """
        Return which of some neighbours are lines: one that takes most of the power around it.

        Or two that leave nothing. The others are put back, and nothing more is looked for there.

        """
        for s in spots:
            self.heights.add(s, 1.0)
        some = sorted(spots, key=lambda s: -s.height)[:2]
        power, scatter = self.heights.power(spots)
        left, noise = [power], 3 * scatter
        for s in some:
            self.heights.add(s, -1.0)
            left.append(self.heights.power(spots)[0])
        alone = left[1] < (1 - DOMINANT) * left[0] + noise
        both = len(some) > 1 and self._apart(some) and left[2] < noise + (
            (1 - CLEAN) * left[0] if not alone else (1 - DOMINANT) * left[1])
        low, high = self.heights.around(spots)
        count = 2 if both else 1 if alone else 0
        # and each must stand out of what is left around it, where that is more than chance
        level = 1 + left[count] / (high - low) if left[count] > 2 * scatter else 1.0
        kept = [s for s in some[:count] if s.height > self.heights.threshold * level]
        for s in some:
            if s not in kept:
                self.heights.add(s, 1.0)
        self.heights.block(spots, self.heights.blocked if kept else self.heights.refused)
        return kept

    def _steady(self, found: list[Spot]) -> list[Spot]:
        """Return the lines that keep amplitude and phase; put back those that do not."""
        if not found:
            return found
        lines = np.array([[s.frequency, s.a, s.b] for s in found])
        lines = jointly(lines, self.heights.whole, self.heights.reference, self.heights.dt)
        some = unsteady(lines, self.heights.whole, self.heights.reference, self.heights.dt, NEAR,
                        1 - DOMINANT)
        for s in (s for s, no in zip(found, some) if no):
            self.heights.add(s, 1.0)
        return [s for s, no in zip(found, some) if not no]

    def _passing(self, found: list[Spot]) -> list[Spot]:
        """Return the lines, those among them that begin or end within the record as such."""
        out = list(found)
        for _ in range(2):      # again above the level without what they had left
            for i, s in enumerate(out):
                left, scatter = self.heights.power([s])
                if left < scatter and s == found[i]:    # it leaves nothing that another would take
                    continue
                self.heights.add(s, 1.0)
                out[i] = self._while_there(s) or s
                self.heights.add(out[i], -1.0)
            if out == found:
                break
            self.heights.look_anew(True)
        self.heights.refused = []
        self.heights.blocked = [*self.heights.blocked[:2],
                                *(self.heights.around([s]) for s in out)]
        self.heights.look_everywhere()
        for _ in range(MOST_PASSING):
            k = int(np.argmax(self.heights.window))
            if self.heights.window[k] < self.heights.threshold or len(out) >= MOST_LINES:
                break
            spot = self.heights.measured(k + 1)
            there = self._while_there(spot)
            if there is not None:
                self.heights.add(there, -1.0)
                out.append(there)
            self.heights.block(
                [there or spot], self.heights.blocked if there else self.heights.refused)
        return out

    def _while_there(self, spot: Spot) -> Spot | None:
        """
        Return the line that is there for a part of the record only; None where there is no such.

        Of a line that is now in the coefficients. Nothing of it must be left, and it must be
        likelier than a line throughout, and much more so than one that fades.

        """
        line = likeliest(spot.frequency, self.heights.c, self.heights.reference, self.heights.dt)
        if line.end - line.begin == self.heights.n:
            return None
        there = self._spot(line)
        twice = 2 * searched()
        throughout = self.heights.measured(self.heights.at(spot.frequency)).height
        if there.height < max(self.heights.threshold, throughout + 2 * DIRECTED) + twice:
            return None
        fading = self._left_by_one_that_fades(there)
        line = refined(line, self.heights.c, self.heights.reference, self.heights.dt)
        there = self._spot(line)
        if there.end - there.begin <= shortest(self.heights.n):
            return None
        (power, scatter), (_, wide) = (self.heights.power([there], reach) for reach in (1, BESIDE))
        self.heights.add(there, -1.0)
        left, beside = (self.heights.power([there], reach)[0] for reach in (1, BESIDE))
        loud = louder(line, self.heights.c, self.heights.reference, self.heights.dt)
        self.heights.add(there, 1.0)
        # and it is no place where a line that wanders stayed a while
        is_clean = left < (1 - CLEAN) * power + 3 * scatter \
            and beside < (1 - DOMINANT) * power + 3 * wide
        stands_out = there.height > loud * (self.heights.threshold + twice)
        return there if is_clean and stands_out and fading - left > 2 * DIRECTED else None

    def _spot(self, line: Passing) -> Spot:
        doubt = self.heights.doubt(np.array(self.heights.at(line.frequency)))
        return Spot(line.frequency, line.a, line.b, float(line.height / doubt),
                    line.begin, line.end)

    def _beside_one(self, found: list[Spot]) -> None:
        """
        Add lines that stand beside a line found, where the two of them leave nothing.

        A strong line lifts the level from which its neighbour is to stand out, and what is near a
        line is not looked at again: what an unsteady one leaves is no line.

        """
        for i, spot in enumerate(list(found)):
            low, high = self.heights.around([spot])
            if len(self.heights.near(found, spot)) > 1 or low < 16 or high > self.heights.n - 16:
                continue
            four = self.heights.four(low - 1, high - 1)
            k = low + int(np.argmax(four))
            if four[k - low] < self.heights.threshold:
                continue
            pair = self._pair(spot, self.heights.measured(k))
            alone = self.heights.power([spot])[0]
            self.heights.add(spot, 1.0)
            fading = self._left_by_one_that_fades(spot)
            for s in pair:
                self.heights.add(s, -1.0)
            left, scatter = self.heights.power([spot])
            apart = self._apart(pair) or fading - left > self.heights.threshold
            if apart and left < 3 * scatter and alone - left > self.heights.threshold:
                found[i] = pair[0]
                found.append(pair[1])
                self.heights.block(pair, self.heights.blocked)
            else:
                for s in pair:
                    self.heights.add(s, 1.0)
                self.heights.add(spot, -1.0)

    def _apart(self, pair: list[Spot]) -> bool:
        """Tell whether two lines are further apart than one that fades is broad."""
        off = abs(pair[0].frequency - pair[1].frequency)
        return 2 * self.heights.n * self.heights.dt * off > RESOLVED

    def _left_by_one_that_fades(self, spot: Spot) -> float:
        """
        Return the power left around a line, now in the coefficients, that may fade and wander.

        Its two amplitudes are parabolas in time, of one parameter more than two lines have: the
        waves at its frequency with their first and second differences, which are t and t^2 times
        them. Lines that beat by more than a cycle it does not follow.

        """
        centre = self.heights.at(spot.frequency)
        low, high = self.heights.around([spot])
        some = np.arange(max(1, min(centre - NEAR, low)),
                         min(self.heights.n, max(centre + NEAR + 1, high)))
        root = np.sqrt(2 * self.heights.dt / self.heights.reference[some - 1])
        f = spot.frequency + 0.05 / (self.heights.n * self.heights.dt) * np.array([[-1], [0], [1]])
        down, wave, up = root * line_basis(f, some, self.heights.n, self.heights.dt)
        columns = [x for w in (wave, up - down, up + down - 2 * wave) for x in (w.real, w.imag)]
        x = np.array(columns) / np.linalg.norm(columns, axis=1)[:, None]
        y = root * self.heights.c[some]
        y = y - np.linalg.lstsq(x.T, y, rcond=1e-9)[0] @ x
        return float(np.sum(y[(some >= low) & (some < high)] ** 2)) - (high - low)

    def _pair(self, spot: Spot, other: Spot) -> list[Spot]:
        """Return a line that was taken out and one beside it, measured together."""
        self.heights.add(spot, 1.0)
        both = np.array([[s.frequency, s.a, s.b] for s in (spot, other)])
        both = jointly(both, self.heights.c, self.heights.reference, self.heights.dt)
        self.heights.add(spot, -1.0)
        return [Spot(float(f), float(a), float(b), s.height)
                for (f, a, b), s in zip(both, (spot, other))]


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
    heights = Heights(c, reference, dt)
    spots = _Search(heights).lines()
    spots = sorted([*spots, *family(heights, spots)], key=lambda s: -s.height)[:MOST_LINES]
    if spots:
        table = np.array([[s.frequency, s.a, s.b, np.sqrt(s.height), *s.stretch(len(c))]
                          for s in spots])
        table[:, :3] = jointly(table[:, :3], c, heights.reference, dt, table[:, 4:].astype(int))
    return table, find_humps(heights.c, heights.rough, dt)


def without_lines(c: np.ndarray, dt: float) -> np.ndarray:
    """Return cosine coefficients c (n,) without the coherent lines in them."""
    reference = reference_spectrum(c, dt)
    if not np.any(dt * c[1:]**2 > line_penalty(len(c)) * reference):
        return c
    out = c.copy()
    for _, low, high, line in in_coefficients(find_peaks(c, reference, dt)[0], len(c), 0, dt):
        out[low:high] -= line
    return out
