# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Samples of one axis in their places on an even clock, NaN where one is missing.

A model is judged across what is missing: it predicts on, and is neither asked nor told there.

"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.ndimage import binary_dilation

from .held import REMEDY
from .stamps import Clock
from ..core.clipped import stays
from ..core.clock import fit_clock, median_rate
from ..core.errors import InputError

LEAST = 400             # samples that are judged
LONGEST = 2 * 16384     # of which are looked at
MOST = 0.075            # of them may be lost; more are no accident, and then stamps are doubtful
DELAYED = 0.01          # may come late; more are losses that such stamps do not show
BESIDE = 0.2            # s on either side of a sample at the end of the range: left out, too
LATE = 1.9              # intervals from which on a sample is lost, or late


class Placed(NamedTuple):
    """
    A series z (places,), NaN where nothing is known, ``dt`` s apart.

    ``part`` says from which sample of the record to which it goes.

    """

    z: np.ndarray
    dt: float
    part: tuple[int, int]


def placed(t: np.ndarray, z: np.ndarray, target: str, held: np.ndarray | None = None) -> Placed:
    """
    Return the longest stretch of a record that no pause interrupts, or its beginning.

    A pause is what a filter begins again after. Where more than a few of its samples are lost, it
    is the longest stretch without any loss. Samples at the end of the range are missing, too.

    Parameters
    ----------
    t, z : ndarray (n,)
        Stamps, s, and rates, rad/s, in the order in which they came.
    target : str
        Name of the axis.
    held : ndarray (n,) or None
        Which samples are none of this sensor (:mod:`held`): they have no place.

    Raises
    ------
    InputError
        The stamps never advance, or samples are lost all over.

    """
    t, z = np.asarray(t, float), np.asarray(z, float)
    there = np.isfinite(z) & np.isfinite(t)
    share = 0.0
    if held is not None:
        share = float(np.mean(held[there]))
        there &= ~held
    where = _in_order(t, np.flatnonzero(there), z)
    t, z = t[where], z[where]
    rate_hz = median_rate(t)
    if rate_hz is None:
        raise InputError(
            'the stamps never advance', 'state the rate and give stamps, or use the receive times'
        )
    dt = np.diff(t)
    late = (dt <= 0) | (dt * rate_hz > LATE)
    some = _longest((dt < 0) | (dt > Clock.of(rate_hz).gap))
    count = some.stop - some.start
    # rough stamps that many samples are lost from belie the rate, and the clock with it
    clock = fit_clock(t[some]) if np.sum(late[some]) <= MOST * count else None
    if clock is not None and clock.missing <= MOST * count \
            and np.sum(late[some]) - len(clock.gaps) <= DELAYED * count:
        place, period = clock.place(count), 1 / clock.rate_hz
    else:
        some = _longest(late)
        place, period = np.arange(some.stop - some.start), 1 / rate_hz
        if share and len(place) < LEAST:
            raise InputError(f'{target}: {share:.0%} of the samples repeat the one before', REMEDY)
        if len(place) < LEAST <= len(z):
            raise _lost(len(place), len(z), int(np.sum(late)), rate_hz)
    place = place[:np.searchsorted(place, LONGEST)]
    out = np.full(place[-1] + 1, np.nan)
    out[place] = z[some][:len(place)]
    out[_beyond_range(out, period)] = np.nan
    judged = where[some][:len(place)]
    return Placed(out, period, (int(judged.min()), int(judged.max()) + 1))


def _beyond_range(z: np.ndarray, dt: float) -> np.ndarray:
    """
    Return which of z (n,), NaN where missing, stand at an end of the range, or near one that does.

    While a motion stays near the end, noise is cut off on one side, also where no sample is.

    """
    at_end = stays(z)
    beside = max(1, round(BESIDE / dt))
    return binary_dilation(at_end, iterations=beside) if at_end.any() else at_end


def _in_order(t: np.ndarray, where: np.ndarray, z: np.ndarray) -> np.ndarray:
    """
    Return the places in the record of its samples, copies left out, by their stamps.

    Stamps that fall by less than half an interval scatter; by more than a pause, a clock was set.

    """
    rate_hz = median_rate(t[where])
    if rate_hz is None or not len(where):
        return where
    fall = -np.diff(t[where])
    if (fall > 0.5 / rate_hz).any():
        begun = np.cumsum(np.append(0, fall > Clock.of(rate_hz).gap))
        where = where[np.lexsort((t[where], begun))]
    again = (np.diff(t[where]) == 0) & (np.diff(z[where]) == 0)
    return where[np.append(True, ~again)]


def _longest(cut: np.ndarray) -> slice:
    """Return the longest stretch of samples between cuts, (n - 1,) bool."""
    ends = np.concatenate([[0], np.flatnonzero(cut) + 1, [len(cut) + 1]])
    k = int(np.argmax(np.diff(ends)))
    return slice(int(ends[k]), int(ends[k + 1]))


def _lost(longest: int, n: int, late: int, rate_hz: float) -> InputError:
    return InputError(
        f'the stamps are even for {longest} of {n} samples in a row at most, '
        f'{LEAST} are needed to judge the filter (a sample is lost, or late, in '
        f'{late} places; the median rate, {rate_hz:.4g} Hz, is as doubtful)',
        'record fewer topics, to a faster disk, with a larger queue, and stamps of the sensor')


def bridged(z: np.ndarray, r: float) -> np.ndarray:
    """
    Return z (n,) with something for what is missing: for a first look, not to be judged.

    Between neighbours, two on either side so that their noise counts for little, and white noise
    of the variance r beside it.

    """
    seen = np.isfinite(z)
    if seen.all():
        return z
    both = np.flatnonzero(seen[1:] & seen[:-1])
    at, level = (both + 0.5, 0.5 * (z[both] + z[both + 1])) if len(both) else \
        (np.flatnonzero(seen), z[seen])
    missing = np.flatnonzero(~seen)
    out = z.copy()
    noise = np.random.default_rng(len(z)).standard_normal(len(missing))
    out[missing] = np.interp(missing, at, level) + np.sqrt(r) * noise
    return out
