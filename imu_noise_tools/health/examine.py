# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The health of a record: what is recorded, what is wrong with it, and what to do about it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .prepare import LEAST_REST_S, LEAST_SAMPLES, RECORDING
from .stamps import examine_stamps, ordered
from .united import united
from .values import (
    at_the_end, finite, is_constant, never_taken, not_finite, standing, too_fast,
    unit_of_stamps, where_not_finite, wrong_units)
from ..core.clipped import at_ends
from ..core.clock import fit_clock, LONG_GAP_S, median_rate, PATTERNS, SampleClock
from ..core.record import ImuRecord, Memory, possible
from ..core.statistics import FAR, grid_step
from ..core.stillness import finite_mean, longest_rest, span, STILL_S, still_stretches
from ..core.units import G0, times

# the first twentieth is off by so many times the scatter of those of the second half
WARM_UP = 5.0
APART = 60.0    # s: no driver is so late
STEP = 1e-9     # s: what stamps are written in
HELD = 0.02     # share of samples that repeat the one before, from which it is said
FOR_CHANCE = 1 << 20    # samples that tell how many do by chance
# times what a random walk moves meanwhile: with all else that is asked, one reaches it in one axis
# of a thousand (of 1e6 that were drawn 1069 did)
WANDERS = 4.0
POSES, APART_DEG = 6, 10.0    # directions that tell three scale factors and biases
GRAVITY_OFF = 0.25      # more than local gravity and a good accelerometer's bias make, m/s^2


@dataclass(frozen=True)
class Resolution:
    """
    Step of an axis's output and the number of different values.

    ``step`` is None where there is no grid.

    """

    step: float | None
    levels: int


@dataclass(frozen=True)
class Health:
    """
    What :func:`examine` found.

    Rates are in Hz, times in s, ``start`` of the record being 0; shares are of all samples.
    ``clock_drift_ppm`` is by how much the stamps' clock runs faster than that of the receiver,
    with its standard error.

    """

    samples: int
    duration_s: float
    rate_hz: float | None               # from the stamps, gaps left out
    median_rate_hz: float | None        # 1 / median step
    mean_rate_hz: float | None          # (n - 1) / span
    labelled_rate_hz: float | None
    receive_rate_hz: float | None
    clock_drift_ppm: float | None
    clock_drift_std_ppm: float | None
    gaps: int
    longest_gap_s: float
    missing: int
    duplicates: int
    backward: int
    ahead: int                          # forward jumps of the stamps that the receive times lack
    jitter_s: float | None              # scatter of the stamps about an even clock
    stamps: str                         # what they look like, a key of core.clock.PATTERNS
    received: str                       # the same of the receive times; empty: none
    received_after_s: float | None      # by how much they lie after the stamps
    tick_s: float                       # step of the grid the stamps lie on; 0: none
    resolvable: int                     # fewer samples lost in a row would not show
    clock_steps: int                    # how often the clock of the stamps was set
    not_finite: int
    not_finite_axes: Mapping[str, tuple[int, float]]    # samples by axis, and when the first is
    stuck: tuple[str, ...]
    saturated: Mapping[str, int]        # samples at the end of the range, by axis
    range_ends: Mapping[str, tuple[tuple[float, int], ...]]     # each end, SI, and samples there
    resolution: Mapping[str, Resolution]
    held: float                         # share of samples equal to the one before on every axis
    alike: float                        # share of samples that are by chance, far apart
    absent: tuple[str, ...]             # 'gyro', 'accel'
    gravity: float | None               # |mean acceleration| of the longest stretch at rest, m/s^2
    units: tuple[str, ...]              # sentences: wrong unit suspected
    still: tuple[tuple[float, float], ...]      # stretches at rest of 2 s and more
    longest_still_s: float              # the longest rest, with knocks in it
    directions: int                     # of gravity in these, 10 deg apart and more
    moving: float                       # share of the time in motion
    warm_up: tuple[str, ...]            # axes that still change at the beginning
    temperature: Mapping[str, tuple[float, float]]      # least and most, degrees C, by covariate
    covariates: tuple[str, ...]
    advice: tuple[str, ...] = field(default=())


def examine(record: ImuRecord, memory: Memory | None = None) -> Health:
    """
    Examine a record as it was recorded.

    Parameters
    ----------
    record : ImuRecord
        Any, however bad; nothing is refused.
    memory : Memory, optional
        Where long arrays are kept.

    """
    memory = memory or Memory()
    stamps = examine_stamps(record)
    tidy = ordered(record, memory)
    clock = fit_clock(tidy.t)

    def each(what: Callable) -> dict:
        found = {}
        for a in record.columns:
            found[a] = what(record.column(a))
            memory.rest()
        return found

    memory.rest()
    still = still_stretches(tidy) if clock and tidy.n > 10 else []
    longest = max(still, key=lambda s: s[1] - s[0], default=(0, tidy.n))
    rest = tidy.part(*longest)
    units = tuple(wrong_units(rest)) if still else ()
    accel = finite_mean(rest.accel) if still and rest.accel is not None else None
    median = median_rate(tidy.t)
    drift, drift_std = _drift(tidy)
    memory.rest()
    held = _equal(record, 1)
    alike = max((_equal(record, k, FOR_CHANCE) for k in FAR), default=0.0) if held > HELD else 0.0
    memory.rest()
    clipped = at_ends(record)
    found = Health(
        samples=record.n,
        duration_s=tidy.duration_s,
        median_rate_hz=median,
        mean_rate_hz=(tidy.n - 1) / tidy.duration_s if tidy.duration_s > 0 else None,
        labelled_rate_hz=record.labelled_rate_hz,
        clock_drift_ppm=drift, clock_drift_std_ppm=drift_std,
        duplicates=stamps.repeated + stamps.duplicate,
        backward=stamps.backward, ahead=stamps.ahead,
        **_clock_fields(tidy, clock, _receive_clock(record)),
        **_damaged_fields(record), received_after_s=_received_after(record),
        stuck=tuple(a for a, stuck in each(is_constant).items() if stuck),
        saturated={a: sum(k for _, k in ends) for a, ends in clipped.items()},
        range_ends=clipped,
        resolution=each(resolution),
        held=held,
        alike=alike,
        absent=tuple(s for s in ('gyro', 'accel') if getattr(record, s) is None),
        gravity=None if accel is None else float(np.linalg.norm(accel)),
        units=units,
        still=tuple((float(tidy.t[a]), float(tidy.t[b - 1])) for a, b in still),
        longest_still_s=span(tidy, longest_rest(tidy, still)),
        directions=_directions(tidy, still),
        moving=1 - sum(b - a for a, b in still) / tidy.n if tidy.n and clock else 0.0,
        warm_up=tuple(a for a in record.columns if rest.n >= 1000 and _warms_up(rest.column(a))),
        temperature={
            k: (float(np.nanmin(v)), float(np.nanmax(v)))
            for k, v in record.covariates.items()
            if 'temp' in k.lower() and len(v) and np.isfinite(v).any()
        },
        covariates=tuple(record.covariates),
    )
    return _with_advice(tidy, found)


def _directions(record: ImuRecord, still: list[tuple[int, int]]) -> int:
    """Return in how many directions gravity points in these ranges of samples."""
    known: list[np.ndarray] = []
    if record.accel is None:
        return 0
    for a, b in still:
        mean = finite_mean(record.accel[a:b])
        up = mean / np.linalg.norm(mean)
        if np.isfinite(up).all() and all(up @ u < np.cos(np.radians(APART_DEG)) for u in known):
            known.append(up)
    return len(known)


def _damaged_fields(record: ImuRecord) -> dict[str, Any]:
    """Return what is not finite, of all samples and by axis."""
    axes = not_finite(record)
    return {'not_finite': record.n - int(finite(record).sum()) if axes else 0,
            'not_finite_axes': axes}


def _clock_fields(
    record: ImuRecord, clock: SampleClock | None, received: SampleClock | None
) -> dict[str, Any]:
    """Return what the stamps say, with what stands for it where they say nothing."""
    gaps = np.zeros(0) if clock is None else record.t[clock.gaps + 1] - record.t[clock.gaps]
    return {
        'rate_hz': clock.rate_hz if clock else None,
        'receive_rate_hz': received.rate_hz if received else None,
        'gaps': len(gaps),
        'missing': clock.missing if clock else 0,
        'longest_gap_s': float(np.max(gaps, initial=0.0)),
        'jitter_s': clock.jitter_s if clock else None,
        'stamps': clock.pattern if clock else '',
        'received': received.pattern if received else '',
        'tick_s': clock.tick_s if clock else 0.0,
        'resolvable': clock.resolvable if clock else 0,
        'clock_steps': len(clock.steps) if clock else 0,
    }


def _receive_clock(record: ImuRecord) -> SampleClock | None:
    if record.receive_t is None:
        return None
    return fit_clock(np.maximum.accumulate(record.receive_t))


def _received_after(record: ImuRecord) -> float | None:
    """Return by how much the receive times lie after the stamps, s; None without any."""
    if record.receive_t is None or not record.n:
        return None
    return float(np.nanmedian(record.receive_t[:FOR_CHANCE] - record.t[:FOR_CHANCE]))


def _drift(record: ImuRecord) -> tuple[float | None, float | None]:
    """
    Return how much faster the stamps' clock is than the receiver's, ppm, and its standard error.

    The least delayed samples of each part tell it.

    """
    if record.receive_t is None or record.n < 100 or np.array_equal(record.receive_t, record.t):
        return None, None
    parts = np.array_split(np.arange(record.n), 20)
    delay = record.receive_t - record.t
    best = np.array([p[np.argmin(delay[p])] for p in parts])
    t, late = record.t[best] - np.mean(record.t[best]), delay[best] - np.mean(delay[best])
    span = float(t @ t)
    if not span > 0:
        return None, None
    slope = float(t @ late) / span
    left = float(np.sum((late - slope * t) ** 2)) / (len(t) - 2)
    return -1e6 * slope, 1e6 * float(np.sqrt((left + STEP ** 2) / span))


def resolution(x: np.ndarray) -> Resolution:
    """Return the step of an axis's output and how many different values it takes."""
    step, levels = grid_step(x[possible(x)])
    return Resolution(step or None, levels)


def _equal(record: ImuRecord, apart: int, most: int | None = None) -> float:
    """Return the share of samples, of so many at most, that equal those ``apart`` later."""
    same = np.ones(max(min(record.n, most or record.n) - apart, 0), bool)
    for data in record.data:
        for k in range(3):
            same &= data[apart:, k][:len(same)] == data[:len(same), k]
    return float(same.mean()) if len(same) else 0.0


def _warms_up(x: np.ndarray) -> bool:
    """
    Tell whether the beginning comes from afar.

    It is then off from the second half by more than that varies, and comes nearer to it; and by
    more than noise wanders by itself in that time, as its later means tell. A random walk wanders
    most: its mean over a twentieth of the record goes (5 - 1/3)/(2/3) = 7 times as far in five
    of them as in one, in variance; flicker and white noise go less far.

    """
    means = finite_mean(x[:len(x) // 20 * 20].reshape(20, -1).T)
    if not np.isfinite(means).all():
        return False
    late = means[10:]
    off = (means[:4] - late.mean()) / max(late.std(), np.ptp(late) / 3, 1e-12)
    wandering = np.sqrt(7 * np.mean(np.diff(means[5:])**2))
    return bool(
        abs(means[0] - means[5]) > WANDERS * wandering and abs(off[0]) > WARM_UP
        and np.all(np.diff(np.abs(off)) < 0) and np.all(off[:3] * off[0] > 0)
    )


def _with_advice(record: ImuRecord, h: Health) -> Health:
    """Return the report with sentences on what to do."""
    say = _length_advice(h)
    if h.gaps:
        say.append(
            f'{times(h.missing, "sample")} {"was" if h.missing == 1 else "were"} lost in '
            f'{times(h.gaps, "gap")} (the longest of {h.longest_gap_s:.3g} s): record fewer '
            'topics, to a faster disk, or with a larger queue.'
            + (' One of more than a second may be a driver that started anew, recordings that '
               'were joined, or a clock that was set ahead.' if h.longest_gap_s > LONG_GAP_S
               else '')
        )
    if h.duplicates or h.backward:
        found = ' and '.join(f'{n} {kind}' for n, kind in (
            (h.duplicates, 'duplicate'), (h.backward, 'backward')) if n)
        more = '' if h.duplicates + h.backward == 1 else 's'
        say.append(f'{found} stamp{more}: check the driver and the clock.')
    if h.ahead:
        say.append(f'The clock of the stamps was set ahead {times(h.ahead)}, which the '
                   'receive times do not show: later samples follow on.')
    say += [*_stamp_advice(h), *_sample_advice(record, h)]
    if h.warm_up:
        say.append(
            f'{", ".join(h.warm_up)} still {"change" if len(h.warm_up) > 1 else "changes"} at '
            'the beginning: let the IMU warm up for half an hour.'
        )
    if not h.temperature:
        say.append(
            'There is no temperature topic: record one along, drifts are mostly temperature.'
        )
    for name, (low, high) in h.temperature.items():
        if high - low > 2:
            say.append(
                f'{name} went from {low:.4g} to {high:.4g} degrees C: its effect can be told '
                'apart.'
            )
    return Health(**{**h.__dict__, 'advice': tuple(say)})


def _length_advice(h: Health) -> list[str]:
    """Return sentences on how long it lasts and rests."""
    say = []
    if h.samples < LEAST_SAMPLES:
        say.append(f'{h.samples} samples are too few to analyse: {RECORDING}.')
    if h.rate_hz is None:
        say.append('The stamps give no rate: give one with --rate-hz.')
    if h.duration_s < STILL_S and not h.longest_still_s and h.samples >= LEAST_SAMPLES:
        say.append(f'{h.duration_s:.3g} s are too short to tell whether the IMU rests: '
                   f'{RECORDING}.')
    elif h.moving > 0 and h.samples >= LEAST_SAMPLES:
        rest = (f'the longest rest is {h.longest_still_s:.3g} s' if h.longest_still_s
                else 'it is nowhere at rest')
        if h.longest_still_s < LEAST_REST_S:
            say.append(f'The IMU moves ({rest}): for the noise, {RECORDING}.')
        else:
            say.append(f'The IMU moves in {100 * h.moving:.2g} % of the time; {rest}.')
        say += _of_motion(h)
    elif h.duration_s < 3600 and h.samples >= LEAST_SAMPLES:
        say.append(
            f'{_duration(h.duration_s)} show the white noise; bias instability takes an hour or '
            'more, '
            'random walk several.'
        )
    return say


def _of_motion(h: Health) -> list[str]:
    """Return sentences on what else than an analysis can be made of a record that moves."""
    if h.directions >= POSES:
        return [f'It rests in {h.directions} directions, as for a calibration: imu_noise '
                'calibrate BAG.']
    if h.moving > 0.5 and 'gyro' not in h.absent:
        return ['Its rates can be filtered: imu_noise filter BAG.']
    return []


def _sample_advice(record: ImuRecord, h: Health) -> list[str]:
    """Return sentences on the values of the samples."""
    say = []
    if h.clock_drift_ppm is not None and abs(h.clock_drift_ppm) > 500:
        say.append(
            f"The sensor's clock is off by {h.clock_drift_ppm:.3g} ppm from the computer's."
        )
    if h.not_finite:
        say.append(f'{h.not_finite} samples are not finite '
                   f'({where_not_finite(h.not_finite_axes)}): check the driver.')
    for axis in h.stuck:
        say.append(f'{axis} never changes: check the driver and the wiring.')
    say += [f'{s.in_words}.' for s in standing(record)]
    say += [f'{s}.' for s in at_the_end(h.range_ends, h.samples)]
    say += [f'{s}.' for s in never_taken(record)]
    if h.held > HELD:
        # more of a coarse output do by chance
        again = h.held - h.alike > HELD * (1 - h.alike)
        say.append(
            f'{100 * h.held:.3g} % of the samples repeat the one before: '
            + ('the driver publishes faster than the sensor measures.' if again else
               'the noise is less than the steps of the output, which hide it; choose a smaller '
               'range, if there is one.')
        )
    say += [f'{s[0].upper()}{s[1:]}.' for s in united(record)]
    for sensor in h.absent:
        say.append(
            f'There is no {"gyroscope" if sensor == "gyro" else "accelerometer"} in the record.'
        )
    stamps = unit_of_stamps(h.median_rate_hz)
    if stamps:
        say.append(f'{stamps[0][0].upper()}{": ".join(stamps)[1:]}.')
    say += [f'{s[0].upper()}{s[1:]}.' for s in h.units or too_fast(record)]
    if h.gravity is not None and not h.units and abs(h.gravity - G0) > GRAVITY_OFF:
        say.append(
            f'Gravity reads {h.gravity:.4g} m/s^2, {100 * (h.gravity / G0 - 1):+.2g} % off: '
            'calibrate the accelerometer (imu_noise calibrate), and check its range setting.'
        )
    return say


def _stamp_advice(h: Health) -> list[str]:
    """Return sentences on the clock of the stamps."""
    say: list[str] = []
    apart = h.received_after_s or 0.0
    if abs(apart) > APART:
        say.append(
            f'The stamps are {_long(abs(apart))} {"before" if apart > 0 else "after"} the receive '
            'times: their clock was not set or counts from its start, or the bag was played and '
            'recorded again. The noise is none the worse for it, but other topics may not fit.'
        )
    if h.rate_hz is None or h.jitter_s is None:
        return say
    if h.stamps == 'computed' and h.received in ('', 'computed'):
        # receive times of another clock bear the rate out, or the drift between them is said
        say.append(
            f'The stamps are {PATTERNS["computed"]}: nothing here bears out the rate of '
            f'{h.rate_hz:.6g} Hz. If it is only what the driver was set to, count the samples of '
            'a minute once.'
        )
    elif h.stamps in ('jitter', 'bursts', 'coarse') and h.jitter_s * h.rate_hz > 0.1:
        what = PATTERNS[h.stamps]
        if h.stamps == 'coarse':
            what += f' of {1e3 * h.tick_s:.4g} ms'
        say.append(
            f'The stamps are {what} and scatter by {1e3 * h.jitter_s:.3g} ms: take them from the '
            'sensor, not on arrival. The samples are taken as even.'
        )
    if h.resolvable > 1:
        say.append(f'Fewer than {h.resolvable} samples lost in a row would not show.')
    if h.clock_steps:
        say.append(f'The clock of the stamps was set {times(h.clock_steps)} within the record.')
    return say


def _long(seconds: float) -> str:
    """Return a time of minutes to years in words."""
    for unit, length in (('years', 365.25 * 86400), ('days', 86400.0), ('h', 3600.0)):
        if seconds >= 2 * length:
            return f'{seconds / length:.3g} {unit}'
    return f'{seconds / 60:.3g} min'


def _duration(seconds: float) -> str:
    return f'{seconds:.3g} s' if seconds < 120 else f'{seconds / 60:.3g} min'
