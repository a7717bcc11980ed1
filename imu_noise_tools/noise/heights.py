# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""How high coefficients of a record stand above their level, while lines are taken out of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .lines import CROWD, least_height, line_penalty, NEAR, PIECE
from .passing import projected
from .smooth import CURVED, reach_at, reference_spectrum, smooth_level
from ..core.spectrum import line_basis, line_coefficients


@dataclass(frozen=True)
class Spot:
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


class Heights:
    """
    The coefficients of a record while lines are taken out of them, and their heights.

    Parameters
    ----------
    c : ndarray (n,)
        Cosine coefficients.
    reference : ndarray (n - 1,)
        Smooth one-sided PSD at each coefficient k >= 1.
    dt : float
        Interval, s.

    Attributes
    ----------
    whole, c : ndarray (n,)
        The coefficients, and what is left of them.
    reference, rough : ndarray (n - 1,)
        The level above which they stand, unit^2/Hz, and one that lines do not pull.
    window : ndarray (n - 1,)
        The heights, twice the nats; 0 where nothing is looked for any more.
    threshold : float
        The height from which a line is taken up.
    blocked, refused : list of (int, int)
        Where nothing is looked for: around lines, and around what is none at this level.

    """

    def __init__(self, c: np.ndarray, reference: np.ndarray, dt: float):
        self.n, self.dt = len(c), dt
        self.whole, self.c, self.reference = c, c, reference
        self.rough, self.unknown = reference, np.zeros((2, 0))
        # four coefficients hold a line of any phase
        self.threshold = least_height(self.n)
        self.window = np.empty(self.n - 1)
        self.blocked = [(0, 16), (self.n - 17, self.n - 1)]
        self.refused: list[tuple[int, int]] = []    # what is no line above the level as it is
        self.look_everywhere()

    def at(self, frequency: float) -> int:
        """Return the coefficient at a frequency, Hz."""
        return int(2 * self.n * self.dt * frequency)

    def four(self, begin: int, end: int) -> np.ndarray:
        """Return the heights of the coefficients 1 + [begin, end) above their level."""
        i, j = max(0, begin - 2), min(self.n - 1, end + 2)
        ratio = 2 * self.dt * self.c[i + 1:j + 1] ** 2 / self.reference[i:j]
        four = np.convolve(ratio, np.ones(4), mode='same')[begin - i:begin - i + end - begin]
        return four / self.doubt(np.arange(begin + 1, end + 1))

    def doubt(self, k: np.ndarray) -> np.ndarray:
        """Return by how much a height at k must be more for what is not known of its level."""
        if self.unknown.size:   # the mean of exp(-g e^x), of a small x with that variance
            return 1 + 0.5 * line_penalty(self.n) * np.interp(np.log(k), *self.unknown)
        # near both ends it is known from a few dozen coefficients only
        reach = np.where(k <= CURVED, 1.5 * k, reach_at(k, self.n))
        return 1 + 25 / (2 * reach + 1)

    def look_anew(self, changed: bool) -> None:
        """Look at all coefficients once more, above a level that thousands of them tell."""
        if changed:
            self.rough = reference_spectrum(self.c, self.dt)
        at, level, variance = smooth_level(self.c, self.rough, self.dt)
        self.reference = np.empty(self.n - 1)
        self.unknown, self.refused = np.stack([at, variance]), []
        for i in range(0, self.n - 1, PIECE):
            j = min(i + PIECE, self.n - 1)
            self.reference[i:j] = np.exp(np.interp(np.log(np.arange(i, j) + 1), at, level))
        self.look_everywhere()

    def look_everywhere(self) -> None:
        """Work all heights out, a piece at a time: a day of them is not held at once."""
        for i in range(0, self.n - 1, PIECE):
            self._look(i, min(i + PIECE, self.n - 1))

    def _look(self, begin: int, end: int) -> None:
        """Work those heights out anew, where something may be looked for."""
        self.window[begin:end] = self.four(begin, end)
        for low, high in (*self.blocked, *self.refused):
            if low < end and high > begin:
                self.window[max(low, begin):min(high, end)] = 0

    def add(self, spot: Spot, sign: float) -> None:
        """Add a line to the coefficients around it, or take it away."""
        if self.c is self.whole:
            self.c = self.whole.copy()
        centre = self.at(spot.frequency)
        reach = min(1 << 15, 64 + int(8 * np.sqrt(spot.height)))
        low, high = max(1, centre - reach), min(self.n, centre + reach)
        self.c[low:high] += sign * line_coefficients(
            spot.frequency, spot.a, spot.b, np.arange(low, high), self.n, self.dt,
            *spot.stretch(self.n))
        self._look(low - 1, high - 1)

    def measured(self, k: int) -> Spot:
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
        height = energy[i] / self.doubt(np.array(k))
        return Spot(best / (2 * self.n * self.dt), float(a[i]), float(b[i]), float(height))

    def power(self, spots: list[Spot], wider: int = 1) -> tuple[float, float]:
        """Return the power, over the level, beyond the noise around some lines; its scatter."""
        low, high = self.around(spots, wider)
        ratio = 2 * self.dt * self.c[low:high] ** 2 / self.reference[low - 1:high - 1]
        return float(np.sum(ratio)) - (high - low), float(np.sqrt(2 * (high - low)))

    def around(self, spots: list[Spot], wider: int = 1) -> tuple[int, int]:
        """Return [low, high) of the coefficients that some lines are looked for in."""
        at = [self.at(s.frequency) for s in spots]
        # what is there for a while is spread over as many more
        begin, end = np.array([s.stretch(self.n) for s in spots]).T
        reach = wider * CROWD * max(1, int(self.n / (4 * np.min(end - begin))))
        return max(1, min(at) - reach), min(self.n, max(at) + reach + 1)

    def near(self, some: list[Spot], spot: Spot) -> list[Spot]:
        """Return which of some lines are neighbours of one."""
        width = CROWD / (2 * self.n * self.dt)
        return [s for s in some if abs(s.frequency - spot.frequency) < width]

    def block(self, spots: list[Spot], blocked: list[tuple[int, int]]) -> None:
        """Look no more around lines, as far as what is left there stands above its level."""
        low, high = self.around(spots)
        while low > 16 and np.max(self.window[max(low - CROWD, 0):low]) > self.threshold:
            low = max(low - CROWD, 0)
        while high < self.n - 17 and np.max(self.window[high:high + CROWD]) > self.threshold:
            high += CROWD
        blocked.append((low, high))
        self.window[low:high] = 0


def jointly(lines: np.ndarray, c: np.ndarray, reference: np.ndarray, dt: float,
            stretch: np.ndarray | None = None) -> np.ndarray:
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
