# Copyright 2026 imu_noise_tools maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
What is kept of a record, from which every model is fitted, scored and diagnosed.

It is some 500 numbers a view.

The record is looked at once, here. It is cut in the middle: the whole and each half have a
spectrum of their own (power in bins of DCT coefficients), so that a model fitted to one half can
be scored on the other. Coherent lines are measured on the samples and taken out of the spectrum;
what each of them adds is kept beside it. The slow part (block means) serves everything that acts
on the mean. Each effect class may keep more (``statistics``).

"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from itertools import combinations_with_replacement

import numpy as np
from scipy.fft import idct
from scipy.special import ndtri

from . import effects as _effects  # noqa: F401  (registers them)
from .grid import grid_step
from .kinds import Defect, Inputs, Line
from .. import allan
from ..effect import Model, registry
from ..record import ImuRecord, Memory, sensor_of
from ..spectrum import Bins, bins_of, cosine_transform, line_coefficients

SLOW = 1 << 14  # block means kept (up to twice as many)
LOW = 1024  # signed coefficients kept
BLOCKS = 256  # blocks in time
CURVED = 256  # coefficients whose level is read from a parabola
FAINT = 14.0  # standard deviations of a line that does not show in the distribution
BANDS = 20  # bands of the power in time
CELLS = 64  # equiprobable cells of the distribution
ENVELOPE = 1000  # columns of the picture of the time series
MOST_LINES = 12
PIECE = 1 << 15  # of an array as long as the record: what is worked on at a time
PARTS = ('whole', 'first', 'second')


@dataclass(frozen=True)
class Part:
    """
    The spectrum of the whole or of a half: one-sided PSD in bins, unit^2/Hz.

    ``power`` (b,) is without lines; ``lines`` (l, b) is what each line adds to it.

    """

    n: int
    dt: float
    power: np.ndarray
    lines: np.ndarray

    @property
    def bins(self) -> Bins:
        """The bins."""
        return bins_of(self.n, self.dt)

    @property
    def duration(self) -> float:
        """Length, s."""
        return self.n * self.dt


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

    def pair(self, a: str, b: str, part: str) -> np.ndarray:
        """Return the cross-power (b,) of two channels; with itself, the power."""
        return self.cross[min(a, b), max(a, b), part]


@dataclass(frozen=True)
class Evidence:
    """
    All that is kept of one axis.

    ``resolution`` is the step of the grid that the samples stand on, 0 where there is none.
    ``line_table`` (l, 4) holds frequency Hz, a, b of a cos + b sin, and z. ``block_power`` (1 or
    2, blocks, bands) is the power in time, ``block_count`` its coefficients, ``block_f`` the
    bands' centres, Hz. ``cells`` (1 to 3, cells) counts the whitened samples in equiprobable
    cells; a second row of either is without defects, and one row more of cells without lines,
    where there are any. ``envelope`` (columns, 3) is time, minimum, maximum. ``statistics`` maps
    an effect's name to what it kept.

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
    block_power: np.ndarray
    block_count: np.ndarray
    block_f: np.ndarray
    cells: np.ndarray
    envelope: np.ndarray
    curve: allan.AllanCurve
    statistics: Mapping[str, Mapping[str, np.ndarray]] = field(default_factory=dict)
    _measured: dict = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def slow_t(self) -> np.ndarray:
        """Times of the block means, s."""
        return self.common.slow_t

    @property
    def slow_y(self) -> np.ndarray:
        """Block means of this axis."""
        return self.common.slow[self.axis]

    @property
    def slow_others(self) -> dict[str, np.ndarray]:
        """Block means of the other axes and the covariates, by name."""
        return {k: v for k, v in self.common.slow.items() if k != self.axis}

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
        return tuple(k for k in self.common.slow if k != self.axis)

    def cross(self, channel: str, part: str) -> np.ndarray:
        """Return the cross-power (b,) of this axis with another channel."""
        return self.common.pair(self.axis, channel, part)

    def _screens(self, model) -> int:
        """1 where the model holds a defect that is taken out of the samples, else 0."""
        return int(
            model is not None
            and any(
                type(e).screen.__func__ is not Defect.screen.__func__ for e in model.of(Defect)
            )
        )

    def block_power_of(self, model) -> np.ndarray:
        """Return the power in time (blocks, bands), without defects where the model holds them."""
        return self.block_power[min(self._screens(model), len(self.block_power) - 1)]

    def cells_of(self, model) -> np.ndarray:
        """
        Return the cells of the distribution.

        Without defects, and without lines, where the model holds them.

        """
        looks = len(self.block_power)
        if len(self.cells) > looks and model is not None:
            left = np.delete(self.line_table[:, 3], list(claimed_lines(self, model)))
            if np.all(left < FAINT) and (looks == 1 or self._screens(model)):
                return self.cells[-1]
        return self.cells[min(self._screens(model), looks - 1)]

    def measured(self, effect):
        """Return what a defect finds or a modulation measures here, worked out once."""
        key = type(effect), tuple(sorted(effect.values.items()))
        if key not in self._measured:
            found = effect.find(self) if isinstance(effect, Defect) else effect.measure(self)
            self._measured[key] = found
        return self._measured[key]

    def kept(self, effect: str) -> Mapping[str, np.ndarray]:
        """
        Return what an effect kept of the samples.

        Empty where it was not known when the record was read.

        """
        return self.statistics.get(effect, {})


def claimed_lines(evidence: Evidence, model: Model) -> set[int]:
    """Return which rows of the line table the model's lines account for."""
    out = set()
    for e in model.of(Line):
        if e.values.get('amplitude', 0) > 0 and len(evidence.line_table):
            out.add(int(np.argmin(np.abs(evidence.line_table[:, 0] - e['frequency']))))
    return out


def smooth_length(n: int) -> int:
    """
    Return the largest 2-3-5-7-smooth number up to n.

    A prime length makes a transform many times slower.

    """
    while n > 1:
        k = n
        for p in (2, 3, 5, 7):
            while k % p == 0:
                k //= p
        if k == 1:
            break
        n -= 1
    return n


def gather(
    record: ImuRecord,
    axes,
    *,
    deviation: str = 'oadev',
    points: int = 100,
    octaves: bool = False,
    progress=None,
    memory: Memory | None = None,
) -> dict[str, Evidence]:
    """
    Return the evidence of each axis of a prepared (still, evenly sampled, finite) record.

    Parameters
    ----------
    record : ImuRecord
        The prepared one.
    axes : sequence of str
        Names of the axes that are wanted.
    deviation, points, octaves
        Of the curve, see :func:`imu_noise_tools.allan.curve`.
    progress : callable or None
        Called with (share done, what) as the work goes on.
    memory : Memory or None
        Where arrays as long as the record are kept.

    """
    step = _Steps(progress, 4 * len(axes) + 2)
    memory = memory or Memory()
    dt, n = record.dt, record.n
    half = n // 2 if n < 1 << 15 else smooth_length(n // 2)
    used = 2 * half
    covariates = _covariates(record, axes, memory)
    t = memory.keep(np.arange(n) * dt)
    inputs = Inputs(t, dt, covariates, {a: record.column(a) for a in record.axes})
    own: dict[str, dict] = {a: {} for a in axes}
    kept, raw, clean = {}, {}, {}
    for axis in axes:
        y = raw[axis] = np.ascontiguousarray(record.column(axis), float)
        kept[axis] = {name: cls.statistics(y, inputs) for name, cls in registry('noise').items()}
        kept[axis] = {k: v for k, v in kept[axis].items() if v}
        without = _bridged(_screened(y, kept[axis], inputs), record)
        clean[axis] = y if without is y else memory.keep(without)
        memory.rest()
        step(f'{axis}: samples')
        own[axis]['curve'] = allan.curve(
            y, dt, deviation=deviation, points=points, octaves=octaves
        )
        step(f'{axis}: Allan curve')
        own[axis]['resolution'] = grid_step(y)[0]
        own[axis].update(_power_of_looks(_looks(y, clean[axis], used), dt))
        own[axis]['envelope'] = _envelope(y, dt)
        memory.rest()
    cross: dict[tuple[str, str, str], np.ndarray] = {}
    low: dict[tuple[str, str], np.ndarray] = {}
    for name, begin, length in (('whole', 0, used), ('first', 0, half), ('second', half, half)):
        bins = bins_of(length, dt)
        coefficients, lines = {}, {}
        for axis in axes:
            y = clean[axis][begin:begin + length]
            c = cosine_transform(y)
            if name == 'whole':
                reference = reference_spectrum(c, dt)
                looks = _looks(raw[axis], clean[axis], used)
                own[axis]['cells'] = _cells(looks, own[axis]['resolution'], c, reference, dt)
                step(f'{axis}: distribution')
                own[axis]['line_table'] = _find_lines(c, reference, y, dt)
                step(f'{axis}: spectrum')
            lines[axis] = _take_lines_out(c, own[axis]['line_table'], begin, dt)
            if name == 'whole':
                if len(lines[axis]):  # what is left is normal only without them
                    cells = _cells_without_lines(c, own[axis]['resolution'], reference, dt)
                    own[axis]['cells'] = np.vstack([own[axis]['cells'], cells])
                del reference
            coefficients[axis] = memory.keep(c)
            memory.rest()
        for other, values in covariates.items():
            coefficients[other] = memory.keep(cosine_transform(values[begin:begin + length]))
            memory.rest()
        binned = _cross_powers(coefficients, bins, memory)
        cross.update({(a, b, name): power for (a, b), power in binned.items()})
        for axis in axes:
            own[axis][name] = Part(length, dt, binned[axis, axis], lines[axis])
        low.update({(k, name): np.array(c[1:LOW + 1]) for k, c in coefficients.items()})
        memory.rest()
    step('halves and cross-spectra')
    slow_length = max(1, used // SLOW)
    slow = {}
    for name, values in {'t': t, **clean, **covariates}.items():
        slow[name] = _block_means(values[:used], slow_length)
        memory.rest()
    common = Common(slow_length, slow.pop('t'), slow, cross, low)
    return {a: Evidence(a, dt, used, common=common, statistics=kept[a], **own[a]) for a in axes}


def _looks(y: np.ndarray, clean: np.ndarray, used: int) -> list[np.ndarray]:
    """Return the samples as they are and, where they differ, without defects."""
    return [y[:used]] if clean is y else [y[:used], clean[:used]]


def _covariates(record: ImuRecord, axes, memory: Memory) -> dict[str, np.ndarray]:
    """
    Return all that varies beside the axes that are asked for.

    Other axes, covariates, the squared vibration.

    """
    out = {**{a: record.column(a) for a in record.axes if a not in axes}, **record.covariates}
    out = {k: v for k, v in out.items() if np.all(np.isfinite(v)) and np.ptp(v) > 0}
    if record.accel is not None:
        total = memory.empty(record.n)
        total[:] = 0.0
        for x in record.accel.T:
            total += (x - np.mean(x)) ** 2
        out['accel_square'] = total
    memory.rest()
    return out


def _cross_powers(coefficients: Mapping[str, np.ndarray], bins: Bins, memory: Memory):
    """
    Return the binned cross-power (b,) of each pair of channels and of each with itself.

    Some bins at a time, so that what is read of each channel serves all of its pairs.

    """
    pairs = list(combinations_with_replacement(sorted(coefficients), 2))
    out = {pair: np.empty(len(bins.first)) for pair in pairs}
    piece = bins.first // PIECE
    begins = np.flatnonzero(np.diff(piece, prepend=-1))
    for i, j in zip(begins, np.append(begins[1:], len(piece))):
        low, high = bins.first[i], bins.last[j - 1]
        some = {k: c[low:high] for k, c in coefficients.items()}
        for a, b in pairs:
            out[a, b][i:j] = np.add.reduceat(some[a] * some[b], bins.first[i:j] - low)
        memory.rest()
    return {pair: 2 * bins.dt * total / bins.count for pair, total in out.items()}


class _Steps:
    """Turn counted steps into calls of a progress function."""

    def __init__(self, progress, total):
        self.progress, self.total, self.done = progress, total, 0

    def __call__(self, what):
        self.done += 1
        if self.progress:
            self.progress(min(1.0, self.done / self.total), what)


def _screened(y, kept, inputs):
    for name, cls in registry('noise').items():
        if issubclass(cls, Defect) and name in kept:
            y = cls.screen(y, kept[name], inputs)
    return y


def _bridged(y: np.ndarray, record: ImuRecord) -> np.ndarray:
    """Return y with straight lines through the stretches that are left out (knocks)."""
    if not record.left_out:
        return y
    y = y.copy()
    for begin, end, _ in record.left_out:
        i, j = np.searchsorted(record.t, (begin, end))
        before, after = y[max(0, i - 50):i], y[j:j + 50]
        ends = [np.mean(x) if len(x) else np.mean(y) for x in (before, after)]
        y[i:j] = np.linspace(*ends, j - i)
    return y


def _block_means(y, length):
    count = len(y) // length
    return np.asarray(y, float)[: count * length].reshape(count, length).mean(axis=1)


def _reach(k, n: int):
    """Return how many coefficients on either side of k its level is taken from."""
    # a filter may end at Nyquist as steeply as drift begins at zero
    return np.clip(0.2 * np.minimum(k, n - k), 12, max(12, n // 100)).astype(int)


def reference_spectrum(c: np.ndarray, dt: float) -> np.ndarray:
    """
    Return a smooth one-sided PSD at every k >= 1 from running medians.

    Lines and spikes in it do not show.

    """
    n = len(c)
    centres = np.round(np.geomspace(1, n - 1, 400)).astype(int)
    centres = np.unique(np.concatenate([centres, n - centres]))
    values = np.empty(len(centres))
    for i, (k, reach) in enumerate(zip(centres, _reach(centres, n))):
        some = c[max(1, k - reach):k + reach + 1]
        if len(some) > 2048:
            some = some[:: len(some) // 2048 + 1]
        values[i] = (
            np.median(2 * dt * some * some) / 0.4549
        )  # the median of chi-squared with one degree of freedom
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
    n = len(c)
    last = min(4 * top, n - 1)
    if last < 32:
        return level
    k = np.log(np.arange(1, last + 1))
    rough = np.interp(k, np.log(centres), level)
    seen = np.log(np.maximum(2 * dt * c[1:last + 1] ** 2, 1e-300))
    seen = rough + np.clip(seen - rough, -5, 2.5) + 1.1395  # its mean for one degree of freedom
    out = level.copy()
    for i in np.flatnonzero(centres <= top):
        a, b = max(1, centres[i] // 4), min(last, max(4 * centres[i], 32))
        x = k[a - 1:b] - k[centres[i] - 1]
        columns = np.stack([np.ones(len(x)), x, x * x])
        out[i] = np.linalg.solve(columns @ columns.T, columns @ seen[a - 1:b])[0]
    return out


def line_penalty(n: int) -> float:
    """
    Return the gain (nats) of a line that noise exceeds once in a thousand records.

    exp(-g) for each of n/2 frequencies that are independent, times sqrt(pi g/3) for the search
    between them (Rice 1954), g near 20.

    """
    return float(np.log(1000 * n / 2 * np.sqrt(np.pi * 20 / 3)))


def _find_lines(c, reference, y, dt) -> np.ndarray:
    """Return (l, 4): frequency, a, b, z of the coherent lines, strongest first."""
    n = len(c)
    if n < 200:
        return np.zeros((0, 4))
    ratio = c[1:] ** 2
    ratio *= 2 * dt
    ratio /= reference
    window = np.convolve(ratio, np.ones(4), mode='same')
    del ratio
    # near both ends the level around a coefficient is known from a few dozen of them only
    for i in range(0, n - 1, PIECE):
        k = np.arange(i + 1, min(i + PIECE, n - 1) + 1)
        window[i:i + PIECE] /= 1 + 25 / (2 * np.where(k <= CURVED, 1.5 * k, _reach(k, n)) + 1)
    window[:16] = window[-16:] = 0
    # four coefficients hold a line of any phase; the level is a little below that at which a line
    # is believed
    threshold = 2 * line_penalty(n) - 2
    found: list[tuple[float, float, float, float]] = []
    while len(found) < MOST_LINES:
        k = int(np.argmax(window))
        if window[k] < threshold:
            break
        frequency, a, b = _measure_line(y, (k + 1) / (2 * n * dt), dt)
        found.append((frequency, a, b, float(np.sqrt(window[k]))))
        reach = 8 + int(2 * np.sqrt(window[k]))  # the skirts of a strong line are not lines
        window[max(0, k - reach):k + reach + 1] = 0
    return np.array(found).reshape(-1, 4)


def _measure_line(y, near, dt):
    """
    Return (frequency, a, b) of the line near a frequency.

    Demodulate, then find the peak of the padded spectrum.

    """
    n = len(y)
    blocks = 512
    length = n // blocks
    if length < 1:
        blocks, length = n, 1
    used = blocks * length
    rows, mean = y[:used].reshape(blocks, length), np.mean(y)

    def demodulated(f):
        """Return the sums over blocks of the samples times exp(-2 pi i f t)."""
        turn = 2 * np.pi * f * dt
        wave = np.column_stack([g(turn * np.arange(length)) for g in (np.cos, np.sin)])
        both = rows @ wave - mean * wave.sum(axis=0)
        return (both[:, 0] - 1j * both[:, 1]) * np.exp(-1j * turn * length * np.arange(blocks))

    sums = demodulated(near)
    pad = 16 * blocks
    spectrum = np.abs(np.fft.fft(sums, pad))
    offsets = np.fft.fftfreq(pad, length * dt)
    near_zero = np.abs(offsets) < 4 / (n * dt)
    i = int(np.flatnonzero(near_zero)[np.argmax(spectrum[near_zero])])
    p, q, r = spectrum[i - 1], spectrum[i], spectrum[(i + 1) % pad]
    bend = p - 2 * q + r
    shift = 0.5 * (p - r) / bend if bend != 0 else 0.0
    frequency = near + offsets[i] + np.clip(shift, -1, 1) / (pad * length * dt)
    z = 2 / used * np.sum(demodulated(frequency))
    return float(frequency), float(z.real), float(-z.imag)


def _take_lines_out(c, table, begin, dt):
    """
    Subtract the lines from the coefficients of a part that begins at a sample, in place.

    Return what each added (l, b).

    """
    n = len(c)
    bins = bins_of(n, dt)
    out = np.zeros((len(table), len(bins.first)))
    for i, (frequency, a, b, _) in enumerate(table):
        angle = 2 * np.pi * frequency * dt * begin
        a, b = a * np.cos(angle) + b * np.sin(angle), b * np.cos(angle) - a * np.sin(angle)
        centre = int(2 * n * dt * frequency)
        low, high = max(1, centre - (1 << 15)), min(n, centre + (1 << 15))
        low, high = bins.first[bins.index(low)], bins.last[bins.index(high - 1)]
        k = np.arange(low, high)
        line = line_coefficients(frequency, a, b, k, n, dt)
        added = 2 * dt * (c[low:high] ** 2 - (c[low:high] - line) ** 2)
        c[low:high] -= line
        i0, i1 = bins.index(low), bins.index(high - 1) + 1
        out[i, i0:i1] = np.add.reduceat(added, bins.first[i0:i1] - low) / bins.count[i0:i1]
    return out


def _power_of_looks(looks, dt):
    """Return ``block_power`` and its axes of one or two versions of the samples."""
    found = [_power_in_time(y, dt) for y in looks]
    _, count, f = found[0]
    return {'block_power': np.array([p for p, _, _ in found]), 'block_count': count, 'block_f': f}


def _cells(looks, step, c, reference, dt) -> np.ndarray:
    """
    Return the cells of one or two versions of the samples.

    ``c`` are the coefficients of the last of them, ``reference`` its smooth spectrum.

    """
    if not step > 0:
        before = [cosine_transform(y) for y in looks[:-1]]
        found = [_whitened(b, reference_spectrum(b, dt), dt) for b in before]
        return np.array([*found, _whitened(c, reference, dt)])
    dither = _dither(len(looks[0]), step)
    found = []
    for y in looks:
        c = cosine_transform(y + dither)
        found.append(_whitened(c, reference_spectrum(c, dt), dt))
    return np.array(found)


def _cells_without_lines(c, step, reference, dt) -> np.ndarray:
    """Return the cells of the samples whose coefficients c the lines were taken out of."""
    if step > 0:
        c = c + cosine_transform(_dither(len(c), step))
        reference = reference_spectrum(c, dt)
    return _whitened(c, reference, dt)


def _dither(n: int, step: float) -> np.ndarray:
    """Return triangular noise of a step: a grid would show through the cells without it."""
    return step * (np.random.default_rng(0).random((2, n)).sum(axis=0) - 1)


def _whitened(c, reference, dt):
    """
    Return how many whitened samples fall into each equiprobable cell.

    They are whitened by the smoothed measured spectrum.

    """
    white = np.empty_like(c)
    white[0] = 0.0
    np.divide(reference, 2 * dt, out=white[1:])
    np.sqrt(white[1:], out=white[1:])
    np.divide(c[1:], white[1:], out=white[1:])
    y = idct(white, type=2, norm='ortho', overwrite_x=True)
    y -= np.mean(y)
    y /= np.std(y)
    return _counted(y, ndtri(np.arange(1, CELLS) / CELLS))


def _counted(y: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """
    Return how many of y lie below the first edge, between each two, and from the last on.

    A fine table tells the cell but for one edge within its step: many times faster than sorting.

    """
    fine = 1 << 12
    low, scale = edges[0], (fine - 1) / (edges[-1] - edges[0])
    first = np.searchsorted(edges, low + np.arange(-1, fine + 1) / scale)
    first = np.maximum(first - 1, 0)        # rounding must not pass an edge by
    after = np.append(edges, np.inf)
    out = np.zeros(len(edges) + 1, np.int64)
    for i in range(0, len(y), PIECE):
        some = y[i:i + PIECE]
        step = np.fmax(np.fmin((some - low) * scale + 1, fine + 1), 0)
        cell = first[step.astype(np.intp)]
        cell += some >= after[cell]
        cell += some >= after[cell]
        out += np.bincount(cell, minlength=len(out))
    return out


def _power_in_time(y, dt):
    """
    Return the Hann-windowed power (blocks, bands).

    With it come the coefficients in each band, and the bands' centres, Hz.

    """
    n = len(y)
    blocks = int(np.clip(n // 64, 4, BLOCKS))
    length = n // blocks
    # rows at a time, so that a long record needs no second copy of itself
    window = np.hanning(length + 1)[:length]
    edges = np.unique(np.round(np.geomspace(3, length // 2 + 1, BANDS + 1)).astype(int))
    out = np.empty((blocks, len(edges) - 1))
    rows = max(1, (1 << 18) // length)
    for i in range(0, blocks, rows):
        some = np.asarray(y[i * length:min(blocks, i + rows) * length], float).reshape(
            -1, length
        )
        spectrum = (
            np.abs(np.fft.rfft((some - some.mean(axis=1, keepdims=True)) * window, axis=1)) ** 2
        )
        out[i:i + len(some)] = np.add.reduceat(
            spectrum[:, : edges[-1]], edges[:-1], axis=1
        ) / np.diff(edges)
    return (
        2 * dt * out / np.sum(window**2),
        np.diff(edges),
        (edges[1:] + edges[:-1]) / (2 * length * dt),
    )


def _envelope(y, dt):
    n = len(y)
    length = max(1, n // ENVELOPE)
    rows = np.asarray(y, float)[: n // length * length].reshape(-1, length)
    return np.column_stack(
        [(np.arange(len(rows)) + 0.5) * length * dt, rows.min(axis=1), rows.max(axis=1)]
    )


# --- to and from plain arrays
# -------------------------------------------------------------------------------------


def to_arrays(evidence: Mapping[str, Evidence]) -> dict[str, np.ndarray]:
    """
    Return plain arrays by ``axis/field`` names, which :func:`from_arrays` reads.

    What is shared is named ``common/...``.

    """
    out: dict[str, np.ndarray] = {}
    for axis, e in evidence.items():
        for f in (f for f in fields(Evidence) if f.init):
            value, key = getattr(e, f.name), f'{axis}/{f.name}'
            if isinstance(value, Part):
                out.update(
                    {
                        f'{key}/{k}': np.asarray(getattr(value, k))
                        for k in ('n', 'power', 'lines')
                    }
                )
            elif isinstance(value, allan.AllanCurve):
                out.update(
                    {f'{key}/{k.name}': np.asarray(getattr(value, k.name)) for k in fields(value)}
                )
            elif f.name == 'statistics':
                out.update(
                    {
                        f'{key}/{name}/{k}': np.asarray(v)
                        for name, kept in value.items()
                        for k, v in kept.items()
                    }
                )
            elif f.name not in ('axis', 'common'):
                out[key] = np.asarray(value)
    common = next(iter(evidence.values())).common
    out['common/slow_length'], out['common/slow_t'] = np.asarray(common.slow_length), common.slow_t
    out.update({f'common/slow/{k}': v for k, v in common.slow.items()})
    for name in ('cross', 'low'):
        kept = getattr(common, name)
        out.update({f'common/{name}/{"/".join(k)}': v for k, v in kept.items()})
    return out


def from_arrays(arrays: Mapping[str, np.ndarray]) -> dict[str, Evidence]:
    """Return the evidence of each axis from what :func:`to_arrays` gave."""
    tree: dict[str, dict] = {}
    for key, value in arrays.items():
        axis, _, rest = key.partition('/')
        tree.setdefault(axis, {})[rest] = value
    flat = tree.pop('common')
    common = Common(
        int(flat['slow_length']),
        flat['slow_t'],
        _below(flat, 'slow'),
        *(
            {tuple(k.split('/')): v for k, v in _below(flat, name).items()}
            for name in ('cross', 'low')
        ),
    )
    return {axis: _one_from_arrays(axis, flat, common) for axis, flat in tree.items()}


def _below(flat, prefix):
    return {k[len(prefix) + 1:]: v for k, v in flat.items() if k.startswith(prefix + '/')}


def _one_from_arrays(axis, flat, common):
    dt = float(flat['dt'])
    parts = {
        p: Part(int(flat[f'{p}/n']), dt, *(flat[f'{p}/{k}'] for k in ('power', 'lines')))
        for p in PARTS
    }
    curve = _below(flat, 'curve')
    curve = allan.AllanCurve(
        str(curve['deviation']),
        float(curve['dt']),
        int(curve['n']),
        *(curve[k] for k in ('m', 'count', 'dev', 'lo', 'hi', 'edf')),
    )
    statistics: dict[str, dict] = {}
    for key, value in _below(flat, 'statistics').items():
        name, _, what = key.partition('/')
        statistics.setdefault(name, {})[what] = value
    plain = {
        k: flat[k]
        for k in ('line_table', 'block_power', 'block_count', 'block_f', 'cells', 'envelope')
    }
    return Evidence(
        axis,
        dt,
        int(flat['n']),
        float(flat['resolution']),
        **parts,
        common=common,
        **plain,
        curve=curve,
        statistics=statistics,
    )
