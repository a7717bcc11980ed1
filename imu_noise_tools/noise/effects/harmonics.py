# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Harmonics: an engine, a fan, the mains; lines at whole multiples of one frequency."""

from functools import lru_cache
from itertools import product

import numpy as np
from scipy.special import bdtrc

from ..evidence import Evidence
from ..kinds import Line, measured, Parameter
from ..lines import crowding
from ...core.spectrum import folded
from ...loop.effect import Effect, Estimate

ORDERS = 12
HIGHEST = (2, 3, 4, 6, 8, ORDERS)  # what the search for f0 takes for the highest order
LOWEST = 6  # some line must be of this order or a lower one
CHANCE = 0.01  # that unrelated lines stand so
CELLS = 0.05, 0.2  # of 1/T by which a line may be off its order: a strong one, a faint one
KNOWN = 4 * np.sqrt(3) / np.pi  # four errors of a frequency, cells, times the pull of its line


class Harmonics(Line):
    """Coherent lines at orders 1 to 12 of one frequency, folded at Nyquist where beyond it."""

    name = 'harmonics'
    symbol = 'f0, Omega1 ... Omega12'
    title = 'harmonics of one machine'
    equation = (
        'sigma^2(tau) = sum_k Omega_k^2 [sin^2(pi k f0 tau)/(pi k f0 tau)]^2, k f0 folded at '
        'Nyquist'
    )
    signature = (
        'several narrow lines in the PSD at whole multiples of one frequency (of half of the '
        "shaft's, for a four-stroke engine)"
    )
    hint = (
        'One machine that turns: an engine, a fan, a pump; or the mains and its harmonics. '
        'Compare with its speed in rpm; change that speed or stop it, and record again: all '
        'lines move or go together. Damp the mount at the strongest order.'
    )
    reference = 'Brandt, Noise and Vibration Analysis, 2011, ch. 12 (order analysis)'
    several = True
    family = True
    decide = 'change the speed of the machine: all of its orders move together'
    parameters = (
        Parameter('frequency', 'Hz', 1e-6, 1e5, title='frequency of order 1'),
        *(
            Parameter(
                f'amplitude_{k}', '{rate}', 0.0, 1e3, log=False, amplitude=True,
                title=f'amplitude of order {k}',
            )
            for k in range(1, ORDERS + 1)
        ),
    )
    neutral = {f'amplitude_{k}': 0.0 for k in range(1, ORDERS + 1)}

    def lines(self) -> list[tuple[float, float]]:
        """Return the orders that are there."""
        return [
            (k * self['frequency'], self[f'amplitude_{k}'])
            for k in range(1, ORDERS + 1)
            if self[f'amplitude_{k}'] > 0
        ]

    def rows(self, evidence: Evidence, free: list[int]) -> list[int]:
        """
        Return the largest set of free rows that stand at orders of one frequency.

        Of equally large sets the one of the lowest orders.
        Sets that unrelated lines would form by chance are none.

        """
        return sorted(self._family(evidence, evidence.throughout(free))[1].values())

    def _family(self, evidence, free) -> tuple[float, dict[int, int]]:
        """Return f0, and which row stands at each of its orders."""
        f, _, _, pull = evidence.line_table[free, :4].T
        f0, orders = _family_of(
            tuple(f.tolist()), tuple(np.clip(KNOWN / np.maximum(pull, 1.0), *CELLS).tolist()),
            self.values.get('frequency'), evidence.duration, evidence.dt)
        return f0, {order: free[i] for order, i in orders}

    def read(self, evidence: Evidence, rows: list[int]) -> dict[str, Estimate]:
        """Return f0 by least squares from all orders, and the amplitude of each."""
        near, family = self._family(evidence, rows)
        out = {p.name: evidence.no_line() for p in self.parameters if p.amplitude}
        if not family:
            nothing = Estimate(None, None, None, point=0.1 / evidence.dt, note='no harmonics')
            return {'frequency': nothing, **out}
        f0, weight = [], []
        for k, row in family.items():
            line, turns = evidence.line(row), k * near * evidence.dt
            out[f'amplitude_{k}'] = line.amplitude
            # beyond Nyquist a line that moves up is seen to move down every second time
            sign = 1 if (turns + 0.5) % 1 >= 0.5 else -1
            at, std = line.frequency.point, line.frequency.std
            assert at is not None and std is not None
            f0.append(near + sign * (at - folded(k * near, evidence.dt)) / k)
            weight.append((k / std) ** 2)
        mean = float(np.average(f0, weights=weight))
        return {'frequency': measured(mean, float(1 / np.sqrt(np.sum(weight)))), **out}

    def in_words(self, evidence: Evidence, rows: list[int]) -> str:
        """Name the orders and the speed."""
        f0, family = self._family(evidence, rows)
        orders = ', '.join(str(k) for k in sorted(family))
        return (
            f'lines at orders {orders} of {f0:.6g} Hz, coherent through the record: a shaft at '
            f'{60 * f0:.0f} rpm, or a four-stroke engine at {120 * f0:.0f} rpm'
        )

    @classmethod
    def example(cls) -> Effect:
        """Return a fan at 186 rpm (3.1 Hz) with orders 1, 2 and 4, 20.6 deg/h the strongest."""
        return cls({**cls.neutral, 'frequency': 3.1, 'amplitude_1': 1e-4, 'amplitude_2': 5e-5,
                    'amplitude_4': 3e-5})


@lru_cache(maxsize=64)
def _family_of(lines: tuple[float, ...], cells: tuple[float, ...], given: float | None,
               duration: float, dt: float) -> tuple[float, tuple[tuple[int, int], ...]]:
    """
    Return f0, and (order, which line) of the largest set; the sets of low orders first.

    Of lines at some frequencies, each of which may be off by some cells.

    Worked out once: each fit asks again for the lines of the same record.

    """
    f, within = np.array(lines), np.array(cells) / duration
    best: tuple[float, dict[int, int]] = 0.0, {}
    # then those of which no line is seen as it is, where they hold more
    for is_folded, most in product((False, True), HIGHEST):
        trials = _trials(f, most, is_folded, dt)
        for f0, k, i in trials:
            if is_folded and f0 * dt > 0.5:    # that of its mirror image
                continue
            if given and abs(f0 - given) > max(1 / duration, 1e-3 * given):
                continue
            found, chance = _at_orders(
                f, within, f0, within[i] / k, most, duration, dt)
            if len(found) <= max(len(best[1]), 1):
                continue
            likely = float(bdtrc(len(found) - 2, len(f) - 1, chance))
            if likely * len(trials) * len(HIGHEST) < CHANCE:
                best = f0, found
    return best[0], tuple(best[1].items())


def _trials(f: np.ndarray, most: int, is_folded: bool, dt: float) -> list[
        tuple[float, int, int]]:
    """Return (f0, order, which) as which each line f (l,) may be read, as it is or folded."""
    orders = range(1, min(most, LOWEST) + 1)
    if not is_folded:
        return sorted(((x / k, k, i) for k in orders for i, x in enumerate(f)), reverse=True)
    return sorted({(abs(m / dt + side * x) / k, k, i) for k in orders
                   for m in range(1, k // 2 + 1) for side in (1, -1)
                   for i, x in enumerate(f)}, reverse=True)


def _at_orders(f: np.ndarray, within: np.ndarray, f0: float, error: float, most: int,
               duration: float, dt: float) -> tuple[dict[int, int], float]:
    """
    Return ({order: which of f stands there}, the chance that an unrelated line stands at one).

    ``within`` (l,) is how far off each of f may be; that of f0 grows with the order.

    """
    order = np.arange(1, most + 1)
    if not len(f):
        return {}, 0.0
    width = within + order[:, None] * error
    places = folded(order * f0, dt)
    chance = min(float(np.sum(
        4 * np.max(width, axis=1) * dt * crowding(places, duration, dt))), 1.0)
    off = np.abs(f - places[:, None])
    near = np.argmin(off / width, axis=1)
    found: dict[int, int] = {}
    for j in np.flatnonzero((off < width)[order - 1, near]).tolist():
        if int(near[j]) not in found.values():
            found[j + 1] = int(near[j])
    return found, chance
