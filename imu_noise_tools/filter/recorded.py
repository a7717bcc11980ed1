# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A record through the filter, as fast as arrays go: rules and numbers are those of the engine."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from . import kalman
from .design import Design, memory, quiet_variance
from .lanes import Lanes, Layout
from .smoother import smooth_chunks
from .stamps import Clock, DUPLICATE, RESTART
from .statespace import state_space
from .window import Window
from ..core.clock import median_rate
from ..core.errors import FitError, InputError

IRREGULAR = (
    0.002  # share of odd intervals above which the steady state is left for the bank's recursion
)


@dataclass(frozen=True)
class Filtered:
    """
    A filtered record; arrays (n, axes) unless said otherwise.

    ``rate`` and its ``variance``; ``score`` the normalised innovations (standard normal if the
    model is right);
    ``smooth`` whether a rate knows the samples after it too, ``delay`` for how long (s);
    ``used`` (n,) False where a sample was refused (not finite) and rate is NaN; ``counts`` of what
    was met.

    """

    rate: np.ndarray
    variance: np.ndarray
    score: np.ndarray
    used: np.ndarray
    design: Design
    clock: Clock
    counts: dict = field(default_factory=dict)
    smooth: bool = False
    delay: float = 0.0


def filter_record(t: np.ndarray, z: np.ndarray, design: Design, rate_hz: float | None = None,
                  progress: Any = None, smooth: bool = False, delay: float = 0.0) -> Filtered:
    """
    Filter samples z (n, axes) at stamps t (s) in the order in which they came.

    Parameters
    ----------
    t : ndarray (n,)
        Stamps, s.
    z : ndarray (n, axes)
        Rates, rad/s.
    design : Design
        What to filter with.
    rate_hz : float or None
        Nominal rate; by default one over the median interval.
    progress : callable or None
        Called with the share done, 0 to 1.
    smooth : bool
        Whether each answer knows the samples after it too (fixed interval); the scores stay those
        of the filter.
    delay : float
        For how long, s, each answer waits for the samples after it (fixed lag): of those of half
        of the delay it knows all. 0: it knows none.

    Raises
    ------
    InputError
        Fewer than ten finite samples, or stamps that never advance.
    FitError
        Answers that are no numbers.
    UsageError
        To be smoothed with a fading memory, or twice.

    """
    memory(design, smooth, delay)
    t, z = np.asarray(t, float), np.asarray(z, float)
    finite = np.isfinite(z).all(axis=1) & np.isfinite(t)
    if finite.sum() < 10:
        raise InputError(
            f'{int(finite.sum())} finite samples are too few to filter', 'give a longer recording'
        )
    kept_t, kept = t[finite], z[finite]
    rate_hz = rate_hz or median_rate(kept_t)
    if not rate_hz:
        raise InputError(
            'the stamps never advance', 'state the rate and give stamps, or use the receive times'
        )
    clock = Clock.of(rate_hz)
    if design.unknown_r:
        design = design.with_r(quiet_variance(kept))
    design = design.with_read(kept)
    keys = np.concatenate([[RESTART], clock.keys(np.diff(kept_t))])
    twice = np.concatenate(
        [[False], (keys[1:] == DUPLICATE) & (kept[1:] == kept[:-1]).all(axis=1)]
    )
    counts = {
        'samples': len(t),
        'refused': int((~finite).sum()),
        'duplicates': int((keys == DUPLICATE).sum()),
        'restarts': int((keys == RESTART).sum()) - 1,
    }
    work, todo = kept[~twice], keys[~twice]
    steady = [None] if smooth or delay else _steady_states(todo, design, clock)
    if smooth:
        parts = smooth_chunks(work, todo, design, clock, progress)
    elif delay:
        parts = _by_delay(work, todo, design, clock, clock.samples(delay), progress)
    elif all(steady):
        parts = _by_steady_state(work, todo, design, clock, steady)
    else:
        parts = _by_chunks(work, todo, design, clock, progress)
    if not all(np.isfinite(part).all() for part in parts[:2]):
        raise FitError('the filter gives rates or deviations that are no numbers',
                       'filter with fewer effects, or without --smooth')
    back = np.cumsum(~twice) - 1  # a copy of a message gets its original's answer
    out = []
    for part in parts:
        whole = np.full(z.shape, np.nan)
        whole[finite] = part[back]
        out.append(whole)
    rate, variance, score = out
    return Filtered(rate, variance, score, finite, design, clock, counts, smooth, delay)


def _steady_states(keys: np.ndarray, design: Design, clock: Clock) -> list:
    """Return the steady state of each axis; [None] where there is none, or no time for it."""
    odd = np.count_nonzero((keys != 0) & (keys != RESTART))
    starts = np.count_nonzero(keys == RESTART)
    if not design.linear or odd > IRREGULAR * len(keys) or starts > 1 + 1e-4 * len(keys):
        return [None]
    return [kalman.steady_state(state_space(m, clock.interval), design.alpha)
            for m in design.models()]


def _by_steady_state(z, keys, design, clock, steady):
    """Filter by recursion until it settles, then at constant gain, up to the next odd interval."""
    rate, variance, score = np.empty_like(z), np.empty_like(z), np.empty_like(z)
    for axis, (model, end) in enumerate(zip(design.models(), steady)):
        spaces = {
            k: state_space(model, clock.span(k)) for k in np.unique(keys[keys != RESTART]).tolist()
        }
        spaces.setdefault(0, state_space(model, clock.interval))
        x = p = None
        for begin, stop in _stretches(keys):
            first = spaces[0 if keys[begin] == RESTART else int(keys[begin])]
            series = z[begin:stop, axis]
            if keys[begin] == RESTART:
                x, p = np.zeros(first.size), first.p0
            else:
                x, p = kalman.predict(
                    first, x, p, design.alpha if keys[begin] != DUPLICATE else 1.0
                )
            got = kalman.resume(spaces[0], series, x, p, design.alpha, end)
            rate[begin:stop, axis], variance[begin:stop, axis] = got.rate, got.variance
            score[begin:stop, axis] = got.innovations / np.sqrt(got.s)
            x, p = got.x, got.p
    return rate, variance, score


def _stretches(keys):
    """Return (begin, stop) of stretches whose intervals after the first are all nominal."""
    begin = np.flatnonzero(keys != 0)
    return list(zip(begin.tolist(), [*begin[1:].tolist(), len(keys)]))


def _by_chunks(z, keys, design, clock, progress):
    """Filter chunks side by side, each warmed up on what comes before it."""
    layout = Layout(len(z), clock.interval)
    lanes = Lanes(keys, design, clock, len(layout.first), z.shape[1])
    out = np.empty_like(z), np.empty_like(z), np.empty_like(z)
    for k in range(layout.steps):
        at = layout.at(k)
        layout.put(k, out, lanes.step(z[at].ravel(), at, first=k == 0))
        if progress and k % 1000 == 0:
            progress(k / layout.steps)
    return out


def _by_delay(z, keys, design, clock, length, progress):
    """Filter chunks side by side, answers waiting for later samples."""
    layout = Layout(len(z), clock.interval, beyond=length)
    lanes = Lanes(keys, design, clock, len(layout.first), z.shape[1])
    window = Window(lanes.bank, length)
    out = np.empty_like(z), np.empty_like(z), np.empty_like(z)
    for k in range(layout.steps):
        at = layout.at(k)
        layout.put(k, out[2:], lanes.step(z[at].ravel(), at, first=k == 0)[2:])
        answer = window.add(z[at].ravel(), lanes.entries(at), lanes.begins(at, layout.over(k)))
        if answer:
            layout.put(k - length, out, answer)
        if progress and k % 1000 == 0:
            progress(k / layout.steps)
    for k, answer in enumerate(window.rest(), max(0, layout.steps - length)):
        layout.put(k, out, answer)
    return out
