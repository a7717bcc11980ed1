# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Axes upside down, swapped or left-handed: the turns between poses contradict gravity."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations, product

import numpy as np

from .between import integrated, misses, Turns
from ..core.errors import FitError

_AGREE = np.radians(8.0)        # a turn that ends so near to gravity agrees with it
_WRONG = np.radians(20.0)       # half of them further off: the axes do not belong together
_LEAST = 4                      # turns
_MOST_OFF = 300.0               # times too large or too small that a unit is looked for


def refuse_crossed_axes(turns: Turns) -> None:
    """
    Raise FitError where the two sensors agree only with axes turned over or swapped, saying which.

    Of the 48 ways to lay the gyroscope's axes on the accelerometer's, the one with which half of
    the turns end at gravity, where without half of them do not; or all of them, where without one
    does not: of five turns between six faces three are half turns, that end there any way. The
    same in another unit: turns are 57 times too large, or too small. Where none does, the turns
    say nothing (counts, a gyroscope that does not turn).

    """
    if turns.n < _LEAST:
        return
    as_is = _missed(turns, np.eye(3))
    for over in (np.median, np.max):
        if over(as_is) < _WRONG:
            continue
        found = sorted((float(over(_missed(turns, p))), k) for k, p in enumerate(_WAYS))
        if found[0][0] <= _AGREE:
            _refuse(over(as_is), found, 'at the median' if over is np.median else 'at most')
    if np.median(as_is) > _WRONG:
        _refuse_unit(turns)


def _refuse(as_is, found, which) -> None:
    best, k = found[0]
    fit = [k for miss, k in found if miss < 2 * best + _AGREE / 4]
    said = (f'the turns between the poses contradict gravity: {np.degrees(as_is):.0f} deg off '
            f'{which}, {np.degrees(best):.1f} deg with')
    remedy = 'mend the driver\'s axes and signs (REP-145), and record again'
    if len(fit) > 2:
        raise FitError(f'{said} other axes; more than one way fits', remedy)
    # in words the likelier first: of a mirror, which changes one axis
    ways = sorted((_WAYS[j] for j in fit), key=lambda w: min(_axes(w), _axes(-w)))
    raise FitError(f'{said} {"; or ".join(in_words(w) for w in ways)}', remedy)


def _refuse_unit(turns: Turns) -> None:
    """Raise FitError where the turns end at gravity in another unit, however axes are laid."""
    for factor, unit, remedy in (
            (np.pi / 180, 'deg/s, not rad/s', 'give --gyro-unit deg/s'),
            (180 / np.pi, 'rad/s already', 'leave out --gyro-unit, or mend the driver\'s unit')):
        if min(np.median(_missed(turns, factor * way)) for way in _WAYS) < _AGREE:
            raise FitError(f'the turns between the poses are 57.3 times as '
                           f'{"large" if factor < 1 else "small"} as gravity tells: the gyroscope '
                           f'is in {unit}', remedy)


def size_of_turns(turns: Turns) -> float | None:
    """
    Return how many times as large the turns are as gravity tells, or None where it tells nothing.

    The factor with which most turns, three of four, end at gravity: chance brings one or two there
    with one of hundreds of factors, not so many.

    """
    if turns.n < _LEAST:
        return None

    def off(log_factor: float) -> float:
        return float(np.quantile(_missed(turns, np.exp(log_factor) * np.eye(3)), 0.75))

    reach, step = np.log(_MOST_OFF), _AGREE / 2     # of turns of a radian and more
    best = min(np.arange(-reach, reach, step), key=off)
    for _ in range(2):
        step /= 10
        best = min(best + step * np.arange(-10, 11), key=off)
    return float(np.exp(-best)) if off(best) < _AGREE else None


def _missed(turns: Turns, way: np.ndarray) -> np.ndarray:
    """Return the angle by which each turn misses gravity, the gyroscope's axes laid so."""
    rates = (turns.gyro - np.median(turns.rests.outputs, axis=1)) @ way.T
    some = replace(turns, gyro=rates)
    return np.linalg.norm(misses(some, integrated(some, rates)), axis=1)


def _signed_permutations() -> list[np.ndarray]:
    return [np.eye(3)[list(order)] * np.array(signs)[:, None]
            for order in permutations(range(3)) for signs in product((1, -1), repeat=3)]


_WAYS = _signed_permutations()


def in_words(way: np.ndarray) -> str:
    """
    Return which axes are wrong, given what turns the gyroscope's rates into the accelerometer's.

    ``way`` (3, 3) is that, a signed permutation.

    A rate is an axial vector: an accelerometer whose axes are mapped by F makes it det(F) F w. So
    a mirror of the gyroscope is the gyroscope's alone, and a proper ``way`` may be a mirror of
    the accelerometer, -way, or a turn of either: what changes fewer axes is said first.

    """
    if np.linalg.det(way) < 0:
        return _changed('gyro', way) + ': its axes are left-handed as they are'
    mirror = _changed('accel', -way) + ': its axes are left-handed as they are'
    turned = _changed('gyro', way)
    few = _axes(-way) < _axes(way)
    return f'{mirror}; or {turned}' if few else f'{turned}; or {mirror}'


def _axes(way) -> int:
    return int(np.sum(~np.isclose(np.diag(way), 1)))


def _changed(sensor: str, way: np.ndarray) -> str:
    """Return the change of axes in words: 'gyro_y upside down', 'accel_x and accel_y swapped'."""
    flipped = [f'{sensor}_{a}' for a, v in zip('xyz', np.diag(way)) if v == -1]
    if len(flipped) + int(np.sum(np.diag(way) == 1)) == 3:
        return f'{" and ".join(flipped)} upside down'
    rows = [f'{"" if way[i].sum() > 0 else "-"}{"xyz"[int(np.argmax(np.abs(way[i])))]}'
            for i in range(3)]
    moved = [f'{sensor}_{a}' for a, i in zip('xyz', range(3)) if way[i, i] == 0]
    same = len(moved) == 2 and (way >= 0).all()
    return f'{" and ".join(moved)} swapped' if same else (f'{sensor} x, y, z taken as '
                                                          f'{", ".join(rows)}')
