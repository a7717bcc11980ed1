# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What is kept of a record, from which every model is fitted, scored and diagnosed.

It is some 500 numbers a view, gathered once (:mod:`~imu_noise_tools.noise.gather`). The whole and
each half have a spectrum of their own (power in bins of DCT coefficients), so that a model fitted
to one half can be scored on the other. The slow part (block means) serves everything that acts on
the mean. Each effect class may keep more (``statistics``).

"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.fft import dct, idct, next_fast_len
from scipy.ndimage import median_filter

from .kinds import Defect, Inputs, Line, measured, model_hides, Modulation, NoiseEffect
from .loud_bands import AROUND, STEP
from .passing import in_part
from .shared import derived, LATER, own_noise, SHAKEN
from .thermal import COURSE, Course, course_of, TEMPERATURE, without_lines
from ..core import allan
from ..core.record import AXES, sensor_of
from ..core.spectrum import Bins, bins_of, folded
from ..loop.effect import Effect, Estimate, Finding, Model

SQUARE = 'accel_square'  # the squared vibration
NEAR = 12  # bins on either side of a line that tell the level there
EDGE = np.sqrt(26)  # by which the place of a change scatters: of noise over squared change
QUICK = 1 << 11  # places in a half at which what is smooth in time is asked for, at least
REMEMBERED = 1 << 23  # numbers (64 MB) of a record that are not worked out again and again
ALIKE = 4.0     # times the width of another band, up to which it may be the same
FAINT = 14.0  # standard deviations of a line that does not show in the distribution
PART_NAMES = ('whole', 'first', 'second')


@dataclass(frozen=True)
class MeasuredLine:
    """
    One coherent line as the samples tell it: Hz, and the unit of the axis.

    Of one that is there for a part of the record, s; begin and end of others are 0.

    """

    frequency: Estimate
    amplitude: Estimate
    begin: Estimate
    end: Estimate


@dataclass(frozen=True)
class Part:
    """
    The spectrum of the whole or of a half: one-sided PSD in bins, unit^2/Hz.

    ``power`` (b,) is without lines; ``lines`` (l, b) is what each line adds to it. ``fine`` are
    edges of bins, Hz, beside the usual ones. ``quiet`` (2, b) is the power where nothing is
    switched on, and the coefficients that tell it; empty (0, b) where nothing ever is. ``ended``:
    without what loud bands leak through the ends of the record (:func:`.without_ends`).

    """

    n: int
    dt: float
    power: np.ndarray
    lines: np.ndarray
    fine: tuple[float, ...] = ()
    quiet: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    ended: bool = False

    @property
    def bins(self) -> Bins:
        """The bins."""
        return bins_of(self.n, self.dt, self.fine, self.ended)

    def quiet_above(self, low: float) -> tuple[np.ndarray, np.ndarray]:
        """Return (power, coefficients) of the bins, (b,), from ``low`` Hz on where it is quiet."""
        bins = self.bins
        count = bins.count.astype(float)
        if not len(self.quiet):
            return self.power, count
        above = bins.f >= low
        return np.where(above & (self.quiet[1] > 0), self.quiet[0], self.power), \
            np.where(above, self.quiet[1], count)

    @property
    def duration(self) -> float:
        """Length, s."""
        return self.n * self.dt


class Anew(dict[tuple, Any]):
    """What was made, by what it was made for; it goes to another process as nothing."""

    def __reduce__(self) -> tuple:
        """Return none: it is made anew there, where what it was for may have no name."""
        return Anew, ()


class Remembered:
    """Arrays by what they were made for, what was asked for last: up to some numbers in all."""

    def __init__(self, most: int) -> None:
        self._most, self.numbers = most, 0
        self._kept: dict[tuple, np.ndarray] = {}

    def __reduce__(self) -> tuple:
        """Go to another process without what can be made anew there."""
        return Remembered, (self._most,)

    def get(self, key: tuple, make: Callable[[], np.ndarray], once: bool = False) -> np.ndarray:
        """Return what was made for a key, or make it; not to be kept if it is asked for once."""
        found = self._kept.pop(key, None)
        if found is None:
            found = make()
            if once:
                return found
            self.numbers += found.size
        self._kept[key] = found     # the last to go
        while self.numbers > self._most and len(self._kept) > 1:
            self.numbers -= self._kept.pop(next(iter(self._kept))).size
        return found

    def clear(self) -> None:
        """Forget all."""
        self._kept.clear()
        self.numbers = 0


@dataclass(frozen=True)
class Common:
    """
    What the axes of one record share.

    ``slow_t`` (s,) are the times of blocks of ``slow_length`` samples, ``slow`` the block means
    (s,) of each axis and covariate by name. ``cross`` maps (name, name, part) to binned
    cross-powers (b,), each pair once, names sorted. ``low`` maps (name, part) to the first
    coefficients themselves (k,), with their signs: what acts on the mean is solved for in them.

    """

    slow_length: int
    slow_t: np.ndarray
    slow: Mapping[str, np.ndarray]
    cross: Mapping[tuple[str, str, str], np.ndarray]
    low: Mapping[tuple[str, str], np.ndarray]
    remembered: Remembered = field(default_factory=lambda: Remembered(REMEMBERED), init=False,
                                   repr=False, compare=False)

    def pair(self, a: str, b: str, part: str) -> np.ndarray:
        """Return the cross-power (b,) of two channels; with itself, the power."""
        found = self.cross.get((min(a, b), max(a, b), part))
        if found is None and (derived(a) or derived(b)):
            return np.zeros(next(len(v) for k, v in self.cross.items() if k[2] == part))
        return self.cross[min(a, b), max(a, b), part] if found is None else found

    def holds(self, channel: str) -> bool:
        """Tell whether a channel was recorded or derived."""
        return channel in self.slow

    def first(self, channel: str, part: str) -> np.ndarray:
        """Return the first coefficients (k,) of a channel, 0 of one that was not derived."""
        found = self.low.get((channel, part))
        if found is None and derived(channel):
            return np.zeros(next(len(v) for k, v in self.low.items() if k[1] == part))
        return self.low[channel, part] if found is None else found

    def blocks(self, channel: str) -> np.ndarray:
        """Return the block means (s,) of a channel, 0 of one that was not derived."""
        if channel not in self.slow and derived(channel):
            return np.zeros(len(self.slow_t))
        return self.slow[channel]


@dataclass(frozen=True)
class Evidence:
    """
    All that is kept of one axis.

    ``resolution`` is the step of the grid that the samples stand on, 0 where there is none, and
    ``rounding`` (lags,) the autocovariance of what that adds.
    ``line_table`` (l, 6) holds frequency Hz, a, b of a cos + b sin, z, and the samples [begin,
    end) in which a line is there, ``humps`` (h, 3) frequency and width, Hz, and nats of narrow
    bands that are no lines, ``fading`` (h, 3) how the level of each fades (:mod:`.fading`), and
    ``machines`` (m, 4) loud bands whose level stays (:mod:`.loud_bands`).
    ``block_power`` (1 or 2, blocks, bands) is the power in time, ``block_count`` its coefficients.
    ``cells`` (1 to 3, cells) counts the whitened samples in equiprobable cells; a second row of
    either is without
    defects, and one row more of cells without lines, where there are any. ``envelope`` (columns,
    3) is time, minimum, maximum. ``loud`` (stretches, 2) are the times in which something beside
    the sensor is switched on, s; ``sweep`` (6,) is a line that moves (:mod:`.sweep`).
    ``unrounded`` (2, blocks) is how loud the noise was before a coarse grid, and how many degrees
    of freedom tell it (:mod:`.rounded`), (2, 0) on no such; ``before`` (0 or 2) is
    how loud it was in all, in steps, and what tells that. ``clipped`` (0 to 2, 2) are the ends
    of the range at which samples stand, and the share of them. ``statistics`` maps an effect's
    name to what it kept.

    """

    axis: str
    dt: float
    n: int
    resolution: float
    whole: Part
    first: Part
    second: Part
    common: Common
    line_table: np.ndarray
    humps: np.ndarray
    block_power: np.ndarray
    block_count: np.ndarray
    cells: np.ndarray
    envelope: np.ndarray
    curve: allan.AllanCurve
    loud: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    sweep: np.ndarray = field(default_factory=lambda: np.zeros(6))
    unrounded: np.ndarray = field(default_factory=lambda: np.zeros((2, 0)))
    before: np.ndarray = field(default_factory=lambda: np.zeros(0))
    rounding: np.ndarray = field(default_factory=lambda: np.zeros(1))
    fading: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    machines: np.ndarray = field(default_factory=lambda: np.zeros((0, 4)))
    clipped: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    statistics: Mapping[str, Mapping[str, np.ndarray]] = field(default_factory=dict)
    _self: object = field(default_factory=object, init=False, repr=False, compare=False)
    #: what was worked out of it, by what was asked for
    _made: Anew = field(default_factory=Anew, init=False, repr=False, compare=False)
    #: what effects put into the bins of a part, for the likelihoods of all models
    units: Mapping[str, Anew] = field(
        default_factory=lambda: {part: Anew() for part in PART_NAMES}, init=False, repr=False,
        compare=False)

    def _once(self, key: tuple, make: Callable[[], Any]) -> Any:
        """Return what was made for a key, or make it."""
        if key not in self._made:
            self._made[key] = make()
        return self._made[key]

    @property
    def slow_t(self) -> np.ndarray:
        """Times of the block means, (s,), s."""
        return self.common.slow_t

    @property
    def slow_y(self) -> np.ndarray:
        """Block means of this axis, (s,), in its unit."""
        return self.common.slow[self.axis]

    @property
    def slow_others(self) -> dict[str, np.ndarray]:
        """Block means of the other axes and the covariates by name, (s,) each."""
        return {k: v for k, v in self.common.slow.items() if k != self.axis}

    def fades(self, frequency: float, width: float) -> tuple[float, float, float]:
        """Return what :func:`.fading.of_humps` tells of the level of a narrow band, or zeros."""
        for (f, half, _), told in zip(self.humps.tolist(), self.fading.tolist()):
            near = abs(f - frequency) < max(half, width)
            if near and (told[2] or width < ALIKE * half < ALIKE ** 2 * width):
                return told[0], told[1], told[2]
        return 0.0, 0.0, 0.0

    def machine_at(self, frequency: float) -> tuple[float, float] | None:
        """Return the ends, Hz, of the loud band of a machine that a frequency is in, or None."""
        for low, high, *_ in self.machines.tolist():
            if low <= frequency < high:
                return low, high
        return None

    @property
    def slow_inputs(self) -> Inputs:
        """What an effect on the mean may depend on, at the blocks."""
        # as large as the axis itself sways: what is solved for is then near 1 in any unit
        more = {} if self.course is None else {
            COURSE: np.std(self.slow_y) * self.course.values}
        return Inputs(self.slow_t, self.dt, {**self.slow_others, **more})

    @cached_property
    def even_inputs(self) -> Inputs:
        """
        Return the same at times that share out the record evenly, as a transform has them.

        The means leave out what remains of the last one.

        """
        step = self.n * self.dt / len(self.slow_t)
        return replace(self.slow_inputs, t=(np.arange(len(self.slow_t)) + 0.5) * step
                       - 0.5 * self.dt)

    def quick_inputs(self, many: int) -> Inputs:
        """
        Return what a smooth effect on the mean may depend on, at so many places or a few more.

        As many as a DCT is quick for, of the parts as well. The lower half of its coefficients is
        as good as that of all blocks.

        """
        def make() -> Inputs:
            inputs, n = self.even_inputs, len(self.slow_t)
            places = 2 * next_fast_len(max(many // 2, min(n // 2, QUICK)))
            at, here = (np.arange(places) + 0.5) * n / places - 0.5, np.arange(n)
            return Inputs(np.interp(at, here, inputs.t), inputs.dt,
                          {k: np.interp(at, here, x) for k, x in inputs.covariates.items()})

        return self._once(('inputs', many), make)

    @cached_property
    def course(self) -> Course | None:
        """What other axes tell of the temperature; None where none follows it."""
        axes = [a for a in self.channels if a in AXES]
        if TEMPERATURE not in self.channels or not axes:
            return None
        found = course_beside(
            self.common.slow, self.slow_t, self.whole.bins,
            {a: self.common.pair(a, a, 'whole') for a in axes},
            self.common.slow_length, len(self.common.low[axes[0], 'whole']))
        return found and without_lines(found, self.line_table[:, 0], self.slow_t)

    @property
    def sensor(self) -> str:
        """``gyro`` or ``accel``."""
        return sensor_of(self.axis)

    @property
    def duration(self) -> float:
        """Length, s."""
        return self.n * self.dt

    def part(self, name: str) -> Part:
        """Return ``whole``, ``first`` or ``second``."""
        return getattr(self, name)

    @property
    def channels(self) -> tuple[str, ...]:
        """Other axes and covariates that were recorded."""
        return tuple(k for k in self.common.slow if k != self.axis and not derived(k))

    def holds_itself(self, channel: str) -> bool:
        """Tell whether a channel is made of this axis, among others."""
        return channel == SQUARE and self.sensor == 'accel'

    def shaken(self, axis: str) -> bool:
        """Tell whether an axis hears what is above its own noise."""
        return self.common.holds(axis + SHAKEN)

    def shaken_together(self, axis: str) -> bool:
        """Tell whether an axis hears, above its own noise, what another hears."""
        return self.shaken(axis) and self.common.holds(axis + LATER)

    def cross(self, channel: str, part: str) -> np.ndarray:
        """Return the cross-power (b,) of this axis with another channel."""
        return self.common.pair(self.axis, channel, part)

    def other_axes(self) -> dict[str, np.ndarray]:
        """Return the powers (b,) of the other axes of the sensor by name, of the whole record."""
        others = (a for a in self.common.slow if a != self.axis and not derived(a)
                  and a in AXES and sensor_of(a) == self.sensor)
        return {a: self.common.pair(a, a, 'whole') for a in others}

    def thermal(self, part: str) -> int:
        """Return how many bins of a part there are in which axes follow the temperature."""
        if self.course is None:
            return 0
        return int(np.searchsorted(self.part(part).bins.f, self.course.edge))

    def coupled(self, a: str, b: str, part: str) -> np.ndarray:
        """
        Return the cross-power (b,) of two signals as couplings hear them.

        Where axes follow the temperature what they share is no coupling.

        """
        out, end = self.common.pair(a, b, part), self.thermal(part)
        return np.append(np.zeros(end), out[end:]) if end else out

    def coupled_first(self, channel: str, part: str) -> np.ndarray:
        """Return the first coefficients (k,) of a channel as couplings hear it."""
        out, end = self.common.first(channel, part).copy(), self.thermal(part)
        out[:self.part(part).bins.first[end] - 1] = 0.0
        return out

    def coupled_blocks(self, channel: str) -> np.ndarray:
        """Return the block means (s,) of a channel as couplings hear it."""
        out, end = self.common.blocks(channel), self.thermal('whole')
        if end:
            c = dct(out, type=2, norm='ortho')
            c[:self.whole.bins.first[end]] = 0.0
            out = idct(c, type=2, norm='ortho')
        return out

    def line(self, row: int) -> MeasuredLine:
        """Return a row of the line table with its errors, which are the Cramer-Rao bound."""
        frequency, a, b, _, begin, end = (float(x) for x in self.line_table[row])
        amplitude, t = float(np.hypot(a, b)), (end - begin) * self.dt
        level = self._level(frequency)
        # the largest of a random walk that falls on both sides, and no better than a swing tells
        edge = float(np.hypot(EDGE * level / amplitude**2, 1 / (8 * frequency)))
        never = measured(0.0, 0.0)
        return MeasuredLine(
            measured(frequency, float(np.sqrt(3 * level / (np.pi**2 * amplitude**2 * t**3)))),
            measured(amplitude, float(np.sqrt(level / t))),
            measured(begin * self.dt, edge) if begin > 0 else never,
            measured(end * self.dt, edge) if end < self.n else never,
        )

    def throughout(self, rows: Sequence[int]) -> list[int]:
        """Return which of some rows of the line table are of lines that are there throughout."""
        passing = in_part(self.line_table, self.n)
        return [i for i in rows if not passing[i]]

    def _level(self, frequency: float) -> float:
        """Return the power around a frequency: the geometric mean of bins, what it lacks added."""
        bins = self.whole.bins
        at = bins.index(max(1, min(bins.n - 1, int(2 * self.duration * frequency))))
        near = np.abs(np.arange(len(bins.f)) - at) <= NEAR
        # a bin of few coefficients is mostly below its level, and a line took some of them along
        log = bins.log_level(self.whole.power)[near]
        low, high = np.quantile(log, (0.1, 0.9))
        return float(np.exp(np.average(np.clip(log, low, high), weights=bins.count[near])))

    def no_line(self, frequency: float | None = None) -> Estimate:
        """Return the amplitude of a line that is not there: 95 % of a Rayleigh amplitude."""
        level = float(np.median(self.whole.power)) if frequency is None else self._level(frequency)
        upper = float(np.sqrt(level / self.duration) * 2.45)
        return Estimate(None, None, (0.0, upper), upper95=upper, point=0.0,
                        note='not observable: no line stands out of the spectrum')

    def bumps(self, most: int, sign: int = 1) -> list[tuple[float, float, float]]:
        """
        Return (frequency Hz, width Hz, standard errors) of the clearest peaks, or dips (-1).

        Of the whole record's power in steps of 5 %, beside its running median over 0.8 decades.

        """
        bins = self.whole.bins
        f = np.exp(np.arange(np.log(8 / self.duration), np.log(0.5 / self.dt), STEP))
        if len(f) < 16:
            return [(0.1 / self.dt, 0.01 / self.dt, 0.0)]
        count, mean = bins.between(self.whole.power, f)
        level = np.log(mean)
        over = sign * (level - median_filter(level, AROUND, mode='nearest'))
        clear = over * np.sqrt(np.minimum(count, 1000.0) / 2)
        out: list[tuple[float, float, float]] = []
        for i in np.argsort(-clear):
            middle = float(np.sqrt(f[i] * f[i + 1]))
            if all(abs(np.log(middle / x)) > 0.3 for x, _, _ in out):
                wide = int(np.sum(over[max(0, i - 8):i + 9] > 0.5 * over[i]))
                out.append((middle, middle * STEP * max(1, wide), float(clear[i])))
            if len(out) == most:
                break
        return out

    def _screens(self, model: Model) -> int:
        """1 where the model holds a defect that is taken out of the samples, else 0."""
        return int(any(e.screens() for e in model.of(Defect)))

    def block_power_of(self, model: Model) -> np.ndarray:
        """Return the power in time (blocks, bands), without defects where the model holds them."""
        return self.block_power[min(self._screens(model), len(self.block_power) - 1)]

    def cells_of(self, model: Model) -> np.ndarray:
        """
        Return the cells of the distribution, (cells,).

        Without defects, and without lines, where the model holds them.

        """
        looks = len(self.block_power)
        if len(self.cells) > looks:
            left = np.delete(self.line_table[:, 3], list(claimed_lines(self, model)))
            if np.all(left < FAINT) and (looks == 1 or self._screens(model)):
                return self.cells[-1]
        return self.cells[min(self._screens(model), looks - 1)]

    def measured(self, effect: Defect | Modulation) -> Finding | None:
        """Return what a defect finds or a modulation measures here, worked out once."""
        find = effect.find if isinstance(effect, Defect) else effect.measure
        key = 'measured', type(effect), *sorted(effect.values.items())
        return self._once(key, lambda: find(self))

    def starts(self, effect: NoiseEffect) -> list[Effect]:
        """Return where a fit should start an effect from, worked out once."""
        key = 'starts', type(effect), effect.label, *sorted(effect.values.items())
        return list(self._once(key, lambda: effect.starts(self)))

    @cached_property
    def as_rounded(self) -> Evidence:
        """The evidence without what the noise was before a coarse grid."""
        return replace(self, unrounded=np.zeros((2, 0)))

    def beside(self, model: Model) -> Evidence:
        """Return what is seen beside a model: the noise below a grid where that is in it."""
        some = self.unrounded.size and not model_hides(model, 'variance')
        return self.as_rounded if some else self

    def steadier(self, key: tuple, make: Callable[[np.ndarray], np.ndarray]) -> Evidence:
        """Return it with a power in time (blocks, bands) made of its own, once for a key."""
        return self._once(('steadier', *key), lambda: replace(
            self, block_power=np.array([make(power) for power in self.block_power])))

    def with_power(self, power: np.ndarray) -> Evidence:
        """Return the evidence with another power of the whole (b,), for starts to look at."""
        out = replace(self, whole=replace(self.whole, power=power))
        object.__setattr__(out, '_self', self._self)    # what starts remember is none of it
        return out

    def remembered(self, key: tuple, make: Callable[[], np.ndarray],
                   once: bool = False) -> np.ndarray:
        """
        Return an array that the record alone decides, made once for a key.

        Of a record's axes, which mostly are asked one after another, no more than
        :data:`REMEMBERED` numbers are kept, those that were asked for last. What is asked for
        ``once``, on the way of a descent, would push out what is asked for again.

        """
        return self.common.remembered.get((self._self, *key), make, once)

    def kept(self, effect: str) -> Mapping[str, np.ndarray]:
        """
        Return what an effect kept of the samples.

        Empty where it was not known when the record was read.

        """
        return self.statistics.get(effect, {})


def course_beside(slow: Mapping[str, np.ndarray], t: np.ndarray, bins: Bins,
                  power: Mapping[str, np.ndarray], length: int, count: int) -> Course | None:
    """
    Return what axes tell of the temperature; None where none follows it.

    Of block means (s,) of so many samples at t, and the power (b,) of each axis, whose own noise
    is wanted in so many coefficients.

    """
    f = np.arange(1, count + 1) / (2 * bins.n * bins.dt)
    own = {a: own_noise(bins, x)[2] for a, x in power.items()}
    each = 2 * bins.dt * length    # from a one-sided density
    return course_of(slow, t, {
        a: np.interp(np.log(f), np.log(bins.f), x) / each for a, x in own.items()})


def claimed_lines(evidence: Evidence, model: Model) -> set[int]:
    """Return which rows of the line table the model's lines account for."""
    out = set()
    for e in model.of(Line):
        for frequency, amplitude in e.lines():
            if amplitude > 0 and len(evidence.line_table):
                at = folded(frequency, evidence.dt)
                out.add(int(np.argmin(np.abs(evidence.line_table[:, 0] - at))))
    return out


def to_arrays(evidence: Mapping[str, Evidence]) -> dict[str, np.ndarray]:
    """
    Return plain arrays by ``axis/field`` names, which :func:`from_arrays` reads.

    What axes share is named ``common/...``, and ``common.2/...`` where there is more than one such
    (sensors with a clock of their own); ``axis/common`` says which is whose.

    """
    out: dict[str, np.ndarray] = {}
    shared = list({id(e.common): e.common for e in evidence.values()}.values())
    names = {id(c): f'common.{k}' if k > 1 else 'common' for k, c in enumerate(shared, 1)}
    for common in shared:
        out.update(_common_to_arrays(names[id(common)], common))
    for axis, e in evidence.items():
        if names[id(e.common)] != 'common':
            out[f'{axis}/common'] = np.asarray(names[id(e.common)])
        for f in (f for f in fields(Evidence) if f.init):
            value, key = getattr(e, f.name), f'{axis}/{f.name}'
            if isinstance(value, Part):
                out |= {f'{key}/{k}': np.asarray(getattr(value, k))
                        for k in ('n', 'power', 'lines', 'fine', 'quiet', 'ended')}
            elif isinstance(value, allan.AllanCurve):
                out |= {f'{key}/{k.name}': np.asarray(getattr(value, k.name))
                        for k in fields(value)}
            elif f.name == 'statistics':
                out |= {f'{key}/{name}/{k}': np.asarray(v)
                        for name, kept in value.items() for k, v in kept.items()}
            elif f.name not in ('axis', 'common'):
                out[key] = np.asarray(value)
    return out


def _common_to_arrays(name: str, common: Common) -> dict[str, np.ndarray]:
    """Return what axes share as arrays below a name."""
    out = {f'{name}/slow_length': np.asarray(common.slow_length), f'{name}/slow_t': common.slow_t}
    out.update({f'{name}/slow/{k}': v for k, v in common.slow.items()})
    for kind in ('cross', 'low'):
        kept = getattr(common, kind)
        out.update({f'{name}/{kind}/{"/".join(k)}': v for k, v in kept.items()})
    return out


def from_arrays(arrays: Mapping[str, np.ndarray]) -> dict[str, Evidence]:
    """Return the evidence of each axis by name from what :func:`to_arrays` gave."""
    tree: dict[str, dict] = {}
    for key, value in arrays.items():
        axis, _, rest = key.partition('/')
        tree.setdefault(axis, {})[rest] = value
    shared = {
        name: _common_from_arrays(tree.pop(name))
        for name in [n for n in tree if n.partition('.')[0] == 'common']
    }
    return {
        axis: _one_from_arrays(axis, flat, shared[str(flat.get('common', 'common'))])
        for axis, flat in tree.items()
    }


def _common_from_arrays(flat: Mapping[str, np.ndarray]) -> Common:
    return Common(
        int(flat['slow_length']),
        flat['slow_t'],
        _below(flat, 'slow'),
        *(
            {tuple(k.split('/')): v for k, v in _below(flat, name).items()}
            for name in ('cross', 'low')
        ),
    )


def _below(flat, prefix):
    return {k[len(prefix) + 1:]: v for k, v in flat.items() if k.startswith(prefix + '/')}


def _one_from_arrays(axis, flat, common):
    dt = float(flat['dt'])
    parts: dict[str, Any] = {
        p: Part(int(flat[f'{p}/n']), dt, flat[f'{p}/power'], flat[f'{p}/lines'],
                tuple(flat[f'{p}/fine'].tolist()), flat[f'{p}/quiet'],
                bool(flat.get(f'{p}/ended', False)))
        for p in PART_NAMES
    }
    curve = _below(flat, 'curve')
    curve = allan.AllanCurve(str(curve['deviation']), float(curve['dt']), int(curve['n']),
                             *(curve[k] for k in ('m', 'count', 'dev', 'lo', 'hi', 'edf')))
    statistics: dict[str, dict] = {}
    for key, value in _below(flat, 'statistics').items():
        name, _, what = key.partition('/')
        statistics.setdefault(name, {})[what] = value
    plain = {f.name: flat[f.name] for f in fields(Evidence) if f.type == 'np.ndarray'}
    return Evidence(axis, dt, int(flat['n']), float(flat['resolution']), **parts, common=common,
                    curve=curve, statistics=statistics, **plain)
