# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The values of a record: finite, constant, in which unit."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..core.clipped import ends_in_words
from ..core.clock import STAMPED_HZ
from ..core.record import ImuRecord, possible
from ..core.statistics import grid_step, longest_in_a_row
from ..core.stillness import finite_mean
from ..core.units import A_COUNT, SI, to_si

LOUD = 4e-3      # rad/s/sqrt(Hz), two-sided: an idling truck under a gyro has 1.1e-3
CALM_PARTS, FEWEST = 10, 100     # parts of a record, and samples that tell how calm one is
FLOOR = 10_000          # samples that are enough for it
FASTEST = 70.0          # rad/s: 4000 deg/s, the widest range that is common
FAST = 10               # samples beyond it are no outliers of an IMU in rad/s
PLAUSIBLE_HZ = 5.0, 5000.0      # of an IMU, where stamps are in another unit than s
SUSPECTED = 'wrong unit suspected'
STANDS = 100             # equal samples in a row that may be a dead axis
BY_CHANCE = 1e-9        # of a record: how likely so many are equal in one of noise alone
SOME = 1 << 18          # samples that tell which levels are taken


def finite(record: ImuRecord) -> np.ndarray:
    """Tell of every sample whether all its values are finite and not absurd, (n,)."""
    good = np.ones(record.n, bool)
    for data in record.data:
        for k in range(3):
            # column by column: many times faster than along the rows
            good &= possible(data[:, k])
    return good


def not_finite(record: ImuRecord) -> dict[str, tuple[int, float]]:
    """Return how many samples of each axis :func:`finite` is not of, and when the first is, s."""
    found = {}
    for axis in record.columns:
        bad = ~possible(record.column(axis))
        if bad.any():
            found[axis] = int(bad.sum()), float(record.t[int(np.argmax(bad))])
    return found


def where_not_finite(found: Mapping[str, tuple[int, float]]) -> str:
    """Return what :func:`not_finite` found in words."""
    return ', '.join(f'{axis} {n} from {first:.6g} s' for axis, (n, first) in found.items())


def is_constant(x: np.ndarray) -> bool:
    """Tell whether the finite values of an axis are all the same."""
    if len(x) > 1000 and not is_constant(x[:1000]):
        return False
    some = x[np.isfinite(x)]
    return not len(some) or bool(np.all(some == some[0]))


class Standing(NamedTuple):
    """An axis that stands at one value for a while: of which sample on, how many, from and to."""

    axis: str
    first: int
    samples: int
    begin: float    # s
    end: float

    @property
    def in_words(self) -> str:
        """A sentence on it, which goes on with what follows from it."""
        return (f'{self.axis} stands at one value from {self.begin:.6g} s to {self.end:.6g} s '
                f'({self.samples} samples): check the driver and the wiring')


def standing(record: ImuRecord) -> list[Standing]:
    """
    Return each axis that changes, but not for a while.

    It is no noise that is small there but none, which makes N too small. Equal samples of a
    coarse output come by chance, as often as elsewhere in the record, and where most of its
    samples repeat, a drift may hold it on one level: of such a one nothing is said.

    """
    said = []
    for axis in record.columns:
        x = record.column(axis)
        same = x[1:] == x[:-1]
        first, last = longest_in_a_row(same)
        run, others = last - first + 1, len(x) - (last - first + 1)
        if run < STANDS or not others or x[first] in (np.min(x), np.max(x)):
            continue                        # at_the_end says the last of these
        again = (int(np.count_nonzero(same)) - (run - 1)) / others
        if again < 0.5 and len(x) * again ** (run - 1) < BY_CHANCE:
            said.append(Standing(axis, first, run, float(record.t[first]), float(record.t[last])))
    return said


def never_taken(record: ImuRecord) -> list[str]:
    """
    Return a sentence on each axis whose output skips levels that its noise must meet.

    Noise with one hump stands on a level at least as often as on the rarer of any two around it,
    and so as often as neighbours leap from the one to the other. A telegraph leaps as well, but
    stays far longer: neighbours that know nothing of each other leap twice as often as the root
    of how often they stay on the one times how often on the other, and half of that is asked.

    """
    said = []
    for axis in record.columns:
        x = record.column(axis)[:SOME]
        x = x[possible(x)]
        step = grid_step(x)[0]
        skipped = _skipped(np.round((x - np.min(x)) / step)) if step > 0 else 0
        if skipped:
            said.append(
                f'{axis} never stands on {skipped} level{"s" * (skipped > 1)} between others on '
                'which it often does: the converter misses codes, or the driver rounds twice; '
                'how loud its noise is goes with where the mean stands')
    return said


def _skipped(counts: np.ndarray) -> int:
    """Return how many levels are never taken by some counts (n,), beyond chance."""
    levels, of = np.unique(counts, return_inverse=True)
    low, high = np.sort(of[:len(of) // 2 * 2].reshape(-1, 2)).T
    stays, leaps = (np.bincount(low[high - low == k], minlength=len(levels)) for k in (0, 1))
    leaps = leaps[:-1]
    # as many samples at least are expected on each of the levels that are leapt over
    skips = (leaps > -np.log(BY_CHANCE)) & (leaps > np.sqrt(stays[1:] * stays[:-1]))
    return int(np.sum(np.diff(levels)[skips] - 1))


def wrong_units(record: ImuRecord, turns: bool = False) -> list[str]:
    """
    Return sentences where the values at rest are such as no IMU gives in SI.

    Of one that may be on a table that ``turns``, a steady rate tells nothing.

    """
    said = []
    if record.accel is not None:
        g = float(np.linalg.norm(finite_mean(record.accel)))
        if not (7 <= g <= 12.5 or np.isnan(g)):
            said.append(
                f'{SUSPECTED}: |mean acceleration| is {g:.4g} m/s^2 at rest, not 9.8'
                + (_converted_twice(record) or _likely_accel(g, record))
            )
    if record.gyro is not None:
        rate = float(np.max(np.abs(finite_mean(record.gyro))))
        density = _calmest(record.gyro, record.dt)
        # 30 deg/s of bias, or 14 deg/sqrt(h) of white noise where it is calmest: no gyro is so
        # bad; the same numbers in deg/s are common. A machine may shake it by any amplitude.
        if rate > 0.52 and not turns or density > LOUD:
            said.append(
                f'{SUSPECTED}: the gyro reads {rate:.3g} rad/s, with noise of {density:.2g} '
                f'rad/s/sqrt(Hz), at rest{_likely_gyro(record.gyro)}'
            )
    return said


def suspected(warnings: Iterable[str]) -> list[str]:
    """Return of which sensors a recording's warnings suspect the unit: gyro, accel."""
    said = [w for w in warnings if SUSPECTED in w]
    of_gyro = [f'{SUSPECTED}: the gyro' in w for w in said]
    return ['gyro'] * any(of_gyro) + ['accel'] * (not all(of_gyro))


def _converted_twice(record: ImuRecord) -> str:
    """Say so where the accelerations are of the size of gravity as they were recorded."""
    unit, other = (record.input_unit.get(s, SI[s]) for s in ('accel', 'gyro'))
    if unit == SI['accel'] or record.accel is None:
        return ''
    # Each by itself: so small, those of all poses together seem to rest, and their mean is none.
    sizes = np.linalg.norm(record.accel, axis=1) / to_si('accel', unit)
    if not 7 <= np.nanmedian(sizes) <= 12.5:
        return ''
    return (f'; it is in m/s^2 already, not in {unit}: use --accel-unit m/s^2'
            + (f' (and --gyro-unit rad/s, if that is not in {other} either)'
               if record.gyro is not None and other != SI['gyro'] else ''))


def _counts(sensor: str) -> str:
    return ('; these look like raw counts: say what one is by the sensor\'s data sheet, e.g. '
            f'--{sensor}-unit {A_COUNT[sensor]}')


def _likely_gyro(data: np.ndarray) -> str:
    return _counts('gyro') if _are_whole(data) else '; if it is in deg/s, use --gyro-unit deg/s'


def _are_whole(data: np.ndarray) -> bool:
    """Tell whether the values (n, 3) are whole numbers, as those of a converter are."""
    some = data[:10_000]
    some = some[possible(some)]
    return bool(len(some) and np.all(some == np.round(some)))


def _likely_accel(g: float, record: ImuRecord) -> str:
    if 0.7 <= g <= 1.3:
        return '; if it is in g, use --accel-unit g'
    if 700 <= g <= 1300:
        return '; if it is in mg, use --accel-unit mg'
    if g > 100 or record.accel is not None and g > 12.5 and _are_whole(record.accel):
        return _counts('accel')
    if 9 <= g * record.rate_hz <= 10.5:
        return ('; times the rate it is: these look like increments (m/s, rad for each sample), '
                'which analyse --delta takes')
    return '; gravity may have been removed' if g < 0.5 else ''


def _calmest(data: np.ndarray, dt: float) -> float:
    """Return the white noise of the noisiest axis (n, 3) in the part in which that is least."""
    parts = [x for x in np.array_split(data, CALM_PARTS) if len(x) >= FEWEST] or [data]
    return min(max(_white(x, dt) for x in part[:FLOOR].T) for part in parts)


def _white(x: np.ndarray, dt: float) -> float:
    """
    Return the density of the white noise of an axis (n,), two-sided, in its unit/sqrt(Hz).

    It is no more than neighbours differ by, which what sways hardly does, and no more than most
    of the spectrum lies at up to a quarter of the rate, of which the lines of a machine are but a
    few bins: the taper keeps each within them.

    """
    x = x[possible(x)]
    if len(x) < 20:
        return 0.0
    taper = np.hanning(len(x))
    power = np.abs(np.fft.rfft((x - x.mean()) * taper)[2:len(x) // 4]) ** 2
    level = np.median(power) / np.log(2) / (taper @ taper)
    return float(np.sqrt(min(level, np.var(np.diff(x)) / 2) * dt))


def at_the_end(found: Mapping[str, Sequence[tuple[float, int]]], n: int) -> list[str]:
    """Return a sentence on each axis that stands at an end of its range, of :func:`at_ends`."""
    return [f'{axis} stands at the end of its range in {sum(count for _, count in ends)} samples '
            f'({ends_in_words(axis, [(end, count / n) for end, count in ends])}): choose a '
            'larger range' for axis, ends in found.items()]


def too_fast(record: ImuRecord) -> list[str]:
    """Return a sentence where rates are such as no IMU that moves gives in rad/s."""
    if record.gyro is None:
        return []
    rate = np.abs(np.asarray(record.gyro))
    if not np.any(np.sum((rate > FASTEST) & possible(rate), axis=0) >= FAST):
        return []
    most = float(np.max(rate[possible(rate)]))
    return [f'{SUSPECTED}: the gyro reads up to {most:.3g} rad/s '
            f'({np.degrees(most):.2g} deg/s), beyond the range of any usual one'
            + _likely_gyro(record.gyro)]


def unit_of_stamps(
    rate_hz: float | None, slowest: float = STAMPED_HZ[0]
) -> tuple[str, str] | None:
    """
    Return (what is wrong, remedy) where stamps taken for seconds give a rate that no IMU has.

    In ms (or tenths of them), us or ns, one of which gives a plausible one.

    """
    if not rate_hz or rate_hz >= slowest:
        return None
    for unit, factor in (('ms', 1e3), ('us', 1e6), ('ns', 1e9)):
        true = rate_hz * factor
        if PLAUSIBLE_HZ[0] <= true < PLAUSIBLE_HZ[1]:
            # Xsens counts tenths of ms
            then, by = (f'; in 0.1 ms {10 * true:.4g} Hz', ' (0.1 ms: by 10000)') if (
                unit == 'ms') else ('', '')
            return (f'the stamps give {rate_hz:.3g} Hz: they are in {unit}, not s '
                    f'({true:.4g} Hz then{then})', f'divide t by {factor:g}{by}, or leave t out '
                    f'and give --rate-hz {true:.4g}')
    return None
