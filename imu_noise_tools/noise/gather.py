# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The one look at a record: from samples to :class:`~imu_noise_tools.noise.evidence.Evidence`.

It is cut in the middle. Coherent lines are measured on the samples and taken out of the spectrum;
what each of them adds is kept beside it. Arrays as long as the record are worked on a piece at a
time and kept where a :class:`~imu_noise_tools.core.record.Memory` says.

"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations_with_replacement
from typing import cast, TypeGuard

import numpy as np
from scipy.fft import idct
from scipy.special import ndtri

from . import shared
from .blocks import block_power
from .ends import without_ends
from .evidence import Common, course_beside, Evidence, Part, SQUARE
from .fading import of_humps
from .humps import fine_edges
from .kinds import Defect, Inputs, NoiseEffect
from .line_search import find_peaks, MOST_LINES, ROUNDS
from .lines import also_in, NO_LINES, of_a_swing, PIECE, take_lines_out, waves
from .loud_bands import machines
from .passing import in_part
from .quiet import loud_stretches, quiet_spectrum
from .rounded import added_by_rounding, before_rounding, coarse, coarse_part, noise_before
from .slower import as_measured, images_of_lines, Measured
from .smooth import reference_spectrum
from .stairs import unrounded
from .sweep import find_sweep, on_its_path, Sweep
from .telegraph import levels
from .thermal import follows_at, TEMPERATURE
from ..core import allan
from ..core.clipped import at_ends
from ..core.record import AXES, ImuRecord, MASKED, Memory, sensor_of
from ..core.spectrum import Bins, bins_of, cosine_transform, power
from ..core.statistics import (
    grid_step, means_of_blocks, quiet_sigma, robust_sigma, sum_of_squares
)
from ..loop.effect import Effect, registry

SLOW = 1 << 14  # block means kept (up to twice as many)
LOW = 4096  # signed coefficients kept: what jumps shows in all of them
CALM = 1024  # of them, in which a thermometer is looked at for lines
JUMPED = 4.0  # times what means change by on either side of what is left out
CELLS = 64  # equiprobable cells of the distribution
ENVELOPE = 1000  # columns of the picture of the time series


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


def gather(record: ImuRecord, axes: Sequence[str], *, deviation: str = 'oadev', points: int = 100,
           octaves: bool = False, progress: Callable[[float, str], None] | None = None,
           memory: Memory | None = None) -> dict[str, Evidence]:
    """
    Return the evidence of each axis of a prepared (still, evenly sampled, finite) record.

    Parameters
    ----------
    record : ImuRecord
        The prepared one.
    axes : sequence of str
        Names of the axes that are wanted.
    deviation, points, octaves
        Of the curve, see :func:`imu_noise_tools.core.allan.curve`.
    progress : callable or None
        Called with (share done, what) as the work goes on.
    memory : Memory or None
        Where arrays as long as the record are kept.

    """
    memory, out = memory or Memory(), {}
    groups = as_measured(record, axes, memory)
    for k, seen in enumerate(groups):
        part = (lambda p, what, k=k: progress((k + p) / len(groups), what)) if progress else None
        work = _Gathering(record, seen, part, memory)
        out.update(work.evidence(deviation=deviation, points=points, octaves=octaves))
    return {a: out[a] for a in axes}


class _Gathering:
    """
    What is gathered of axes of one clock, step by step; what is long lies where ``memory`` says.

    ``read`` is the record as it was read.

    """

    def __init__(self, read: ImuRecord, seen: Measured, progress, memory: Memory):
        self.read, self.seen, axes = read, seen, seen.axes
        self.gaps, record = seen.record, _unmasked(seen.record, memory)
        self.record, self.axes, self.memory = record, axes, memory
        self.step = _Steps(progress, 4 * len(axes) + 2)
        self.dt, n = record.dt, record.n
        self.half = n // 2 if n < 1 << 15 else smooth_length(n // 2)
        self.used = 2 * self.half
        self.covariates = _covariates(record, axes, memory)
        self.clipped = {a: np.array([(end, count / n) for end, count in ends])
                        for a, ends in at_ends(self.gaps).items()}
        self.t = memory.keep(np.arange(n) * self.dt)
        self.inputs = Inputs(self.t, self.dt, self.covariates,
                             {a: record.column(a) for a in record.axes})
        self.own: dict[str, dict] = {a: {} for a in axes}
        self.kept: dict[str, dict] = {}
        self.raw: dict[str, np.ndarray] = {}
        self.clean: dict[str, np.ndarray] = {}
        self.cross: dict[tuple[str, str, str], np.ndarray] = {}
        self.low: dict[tuple[str, str], np.ndarray] = {}
        self.shaken: dict[str, tuple[np.ndarray, np.ndarray | None, bool]] = {}
        self.slow_derived: dict[str, np.ndarray] = {}

    def evidence(self, **curve) -> dict[str, Evidence]:
        """Return what is gathered of each axis; ``curve`` says which curve."""
        for axis in self.axes:
            self.samples(axis, **curve)
        self.beside()
        whole = {axis: self.spectrum(axis) for axis in self.axes}
        self.follow(whole)
        self.part('whole', 0, self.used, whole)
        self.part('first', 0, self.half)
        self.part('second', self.half, self.half)
        self.step('halves and cross-spectra')
        common = self.common()
        return {a: Evidence(a, self.dt, self.used, common=common, statistics=self.kept[a],
                            **self.own[a]) for a in self.axes}

    def samples(self, axis: str, **curve) -> None:
        """Look at the samples of an axis: what effects keep of them, the Allan curve, blocks."""
        y = self.raw[axis] = np.ascontiguousarray(self.record.column(axis), float)
        self.kept[axis], without = _looked_at(
            y, replace(self.inputs, axis=axis), _known())
        self.kept[axis].update(self._of_readings(axis))
        without = _bridged(without, self.record)
        self.clean[axis] = y if without is y else self.memory.keep(without)
        self.memory.rest()
        self.step(f'{axis}: samples')
        own = self.own[axis]
        own['curve'] = allan.curve(y, self.dt, **curve)
        self.step(f'{axis}: Allan curve')
        own['resolution'] = step = grid_step(y)[0]
        own['clipped'] = self.clipped.get(axis, np.zeros((0, 2)))
        own.update(_power_of_looks(_looks(y, self.clean[axis], self.used), self.dt))
        self._listen(axis)
        # what is loud for a part moves over levels on which the rest stands
        clean, sigma = self.clean[axis][:self.used], quiet_sigma(y, step)[0]
        quiet = clean
        if coarse(step, sigma):
            quiet = coarse_part(clean, step)
            own['before'] = noise_before(quiet, step)
        own['rounding'] = added_by_rounding(quiet, step, sigma)
        if coarse(step, robust_sigma(y)):
            own['unrounded'] = before_rounding(clean, step)
        own['envelope'] = _envelope(y, self.dt)
        self.memory.rest()

    def _listen(self, axis: str) -> None:
        """See when something beside the sensor is switched on."""
        own = self.own[axis]
        length = self.used // own['block_power'].shape[1]
        own['loud'] = self.dt * length * loud_stretches(own['block_power'][-1], own['block_count'])

    def _of_readings(self, axis: str) -> dict[str, dict[str, np.ndarray]]:
        """Return what effects keep of all that was read of an axis."""
        y = np.ascontiguousarray(self.read.column(axis), float)
        inputs = Inputs(self.read.t, self.read.dt, self.read.covariates,
                        {a: self.read.column(a) for a in self.read.axes}, axis, self.seen.slower)
        return {name: kept for name, cls in _known().items()
                if cls.of_readings and (kept := cls.statistics(y, inputs))}

    def beside(self) -> None:
        """Take defects out of the axes that were not asked for, as out of those that were."""
        screened = {name: cls for name, cls in _known().items() if _is_taken_out(cls)}
        for axis in (a for a in self.record.axes if a in self.covariates):
            y = np.ascontiguousarray(self.record.column(axis), float)
            without = _bridged(
                _looked_at(y, replace(self.inputs, axis=axis), screened)[1], self.record)
            if without is not y:
                self.covariates[axis] = self.memory.keep(without)
            self.memory.rest()

    def spectrum(self, axis: str) -> np.ndarray:
        """Return the coefficients of an axis; find its lines, and how its samples spread."""
        own, c = self.own[axis], cosine_transform(self.clean[axis][:self.used])
        reference = reference_spectrum(c, self.dt)
        lines = NO_LINES
        if self.gaps.left_out:
            lines = find_peaks(c, reference, self.dt)[0]
        if len(lines):  # broken off by what was left out, they would look like a narrow band
            c, reference = self._instead(axis, _bridged(self.clean[axis], self.gaps, lines))
        measured = self.clean[axis]
        for _ in range(ROUNDS if self.seen.slower else 0):
            if not len(lines := find_peaks(c, reference, self.dt)[0]):
                break
            images = images_of_lines(measured, lines, self.seen)
            c, reference = self._instead(axis, measured - images)
            if len(lines) < MOST_LINES:     # there may be fainter ones behind the images
                break
        self._whiten(axis, c, reference)
        self.step(f'{axis}: distribution')
        table, humps = find_peaks(c, reference, self.dt)
        own['humps'] = humps
        own['fading'] = of_humps(c, self.dt, humps, table[:, 0])
        length = max(1, self.used // SLOW)
        means = means_of_blocks(self.clean[axis][:self.used], length)
        slow = of_a_swing(table[:, 0], means, length * self.dt)
        passed = on_its_path(Sweep(*own['sweep']), table, len(c), self.dt)
        own['line_table'] = table[~(self._followed(table[:, 0], means) | slow | passed)]
        kept = self.memory.keep(c)
        self.memory.rest()
        self.step(f'{axis}: spectrum')
        return kept

    def _instead(self, axis: str, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Take other samples for those of an axis; return their coefficients and reference."""
        whole = self.memory.keep(y)
        if self.clean[axis] is self.raw[axis]:  # without defects they are one
            self.raw[axis] = whole
        self.clean[axis] = whole
        c = cosine_transform(whole[:self.used])
        return c, reference_spectrum(c, self.dt)

    def _followed(self, lines: np.ndarray, means: np.ndarray) -> np.ndarray:
        """
        Tell which lines, Hz (l,), of an axis something recorded beside it has too: they stay.

        A heater's cycle is a line of the temperature and of all that follows it: what explains
        that explains the line, and could not if it were taken out.

        """
        out, length = np.zeros(len(lines), bool), max(1, self.used // SLOW)
        beside = set(self.record.covariates) & set(self.covariates) - {*AXES, SQUARE}
        for name in sorted(beside) if len(lines) else ():
            slow = means_of_blocks(self.covariates[name][:self.used], length)
            out |= also_in(lines, slow, length * self.dt, CALM, means)
        return out

    def follow(self, whole: dict[str, np.ndarray]) -> None:
        """
        Leave in lines of an axis that are those of a course which others tell of the temperature.

        A slow thermometer does not show a heater's cycle, and all that follows the heater does.

        """
        tables = {a: own['line_table'] for a, own in self.own.items() if len(own['line_table'])}
        if TEMPERATURE not in self.covariates or not tables:
            return
        bins, (length, slow) = bins_of(self.used, self.dt), self._slow_means()
        t, each = slow.pop('t'), {}
        for a in (a for a in self.record.axes if a in slow):
            c = whole[a] if a in whole else cosine_transform(self.covariates[a][:self.used])
            each[a] = power(c, self.dt, bins)
            self.memory.rest()
        for axis, table in tables.items():
            course = course_beside(
                {a: x for a, x in slow.items() if a != axis}, t, bins,
                {a: x for a, x in each.items() if a != axis}, length, min(LOW, bins.n - 1))
            if course is not None:
                self.own[axis]['line_table'] = table[~follows_at(
                    table[:, 0], slow[axis], t, slow[TEMPERATURE], course)]

    def _whiten(self, axis: str, c: np.ndarray, reference: np.ndarray) -> None:
        """Whiten the samples: how they spread, and a line that sweeps."""
        own, cells = self.own[axis], []
        looks = _looks(self.raw[axis], self.clean[axis], self.used)
        for white in _whitened_looks(looks, own['resolution'], c, reference, self.dt):
            cells.append(_counted(white))
        own['cells'] = np.array(cells)
        own['sweep'] = find_sweep(white, self.dt)

    def part(self, name: str, begin: int, length: int,
             whole: dict[str, np.ndarray] | None = None) -> None:
        """Bin the spectra of a part of the record, and of all pairs; ``whole`` is used up."""
        fine = fine_edges(np.concatenate([self.own[axis]['humps'] for axis in self.axes]))
        bins = bins_of(length, self.dt, fine)
        coefficients, lines, ended = {}, {}, set()
        for axis in self.axes:
            own = self.own[axis]
            if whole is not None:
                c = whole.pop(axis)
            else:
                c = cosine_transform(self.clean[axis][begin:begin + length])
            lines[axis] = take_lines_out(c, own['line_table'], begin, self.dt, bins)
            if whole is not None and len(lines[axis]):
                self._without_lines(axis, c)
            as_cut, c = c, without_ends(c, bins)
            if c is not as_cut:
                ended.add(axis)
            coefficients[axis] = c if whole is not None else self.memory.keep(c)
            self.memory.rest()
        for other, values in self.covariates.items():
            c = cosine_transform(values[begin:begin + length])
            coefficients[other] = self.memory.keep(c)
            self.memory.rest()
        coefficients |= self._derived(coefficients, bins, whole is not None)
        binned = _cross_powers(coefficients, bins, self.memory)
        self.cross |= {(a, b, name): x for (a, b), x in binned.items()}
        for axis in self.axes:
            loud = np.round(self.own[axis]['loud'] / self.dt).astype(int) - begin
            quiet = quiet_spectrum(self.clean[axis][begin:begin + length], loud, self.dt, bins)
            self.own[axis][name] = Part(
                length, self.dt, binned[axis, axis], lines[axis], fine, quiet,
                axis in ended)
            if whole is not None:
                self.own[axis]['machines'] = machines(self.own[axis][name], coefficients[axis])
        self.low |= {(k, name): np.array(c[1:LOW + 1]) for k, c in coefficients.items()}
        self.memory.rest()

    def _without_lines(self, axis: str, c: np.ndarray) -> None:
        """
        Look at the samples whose coefficients c the lines were taken out of.

        What is left is normal only then, and steady: two lines of one band beat.

        """
        own, looks = self.own[axis], _looks(self.raw[axis], self.clean[axis], self.used)
        cells = _cells_without_lines(c, own['resolution'], self.dt)
        own['cells'] = np.vstack([own['cells'], cells])
        left = idct(c, type=2, norm='ortho')
        own.update(_power_of_looks(
            (left if y is looks[-1] else y - looks[-1] + left for y in looks), self.dt))
        if np.any(in_part(own['line_table'], self.used)):
            # to what sweeps and what is loud they are neither
            self._listen(axis)
            white = whitened(c, reference_spectrum(c, self.dt), self.dt)
            own['sweep'] = find_sweep(white, self.dt)

    def _derived(self, coefficients, bins: Bins, first: bool) -> dict[str, np.ndarray]:
        """Return what is derived of the axes that hear something together."""
        out: dict[str, np.ndarray] = {}
        if first:
            heard = shared.heard_together(
                {a: (self.clean if a in self.clean else self.covariates)[a]
                 for a in self.record.axes if a in coefficients}, self.dt)
            # what moves one accelerometer moves others, each perhaps too little to show by itself
            accel = {a for a in self.record.axes if a in coefficients and sensor_of(a) == 'accel'}
            together = {*heard, *(accel if accel & heard.keys() else ())}
            for a in sorted(together | accel):
                above = shared.share(bins, power(coefficients[a], bins.dt, bins), heard.get(a))
                if a in heard or above is not None:
                    self.shaken[a] = bins.f, above, a in together
        length = max(1, self.used // SLOW)
        for a, (f, share, together) in self.shaken.items():
            for name, c in shared.signals(a, coefficients[a], self.dt, f, share, together):
                if first:
                    self.slow_derived[name] = means_of_blocks(
                        idct(c, type=2, norm='ortho'), length)
                out[name] = self.memory.keep(c)
                self.memory.rest()
        return out

    def common(self) -> Common:
        """Return what all axes share: slow means, cross-spectra, the lowest coefficients."""
        length, slow = self._slow_means()
        return Common(length, slow.pop('t'), slow | self.slow_derived, self.cross, self.low)

    def _slow_means(self) -> tuple[int, dict[str, np.ndarray]]:
        """Return samples a block, and block means of the time and of all channels."""
        length, slow = max(1, self.used // SLOW), {}
        for name, values in {'t': self.t, **self.clean, **self.covariates}.items():
            slow[name] = means_of_blocks(values[:self.used], length)
            self.memory.rest()
        return length, slow


def _looks(y: np.ndarray, clean: np.ndarray, used: int) -> list[np.ndarray]:
    """Return the samples as they are and, where they differ, without defects."""
    return [y[:used]] if clean is y else [y[:used], clean[:used]]


def _covariates(record: ImuRecord, axes, memory: Memory) -> dict[str, np.ndarray]:
    """
    Return all that varies beside the axes that are asked for.

    Other axes, covariates, the squared vibration.

    """
    out = {**{a: record.column(a) for a in record.axes if a not in axes},
           **{k: unrounded(v) for k, v in record.covariates.items()}}
    out = {k: v for k, v in out.items() if np.all(np.isfinite(v)) and np.ptp(v) > 0}
    if record.accel is not None:
        total = memory.empty(record.n)
        total[:] = 0.0
        for x in record.accel.T:
            total += (x - np.mean(x)) ** 2
        out[SQUARE] = total
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


def _looked_at(y: np.ndarray, inputs: Inputs,
               known: Mapping[str, type[NoiseEffect]]) -> tuple[dict[str, dict], np.ndarray]:
    """
    Return what effects keep of the samples (n,), and the samples without defects.

    What one turn finds is taken out before the next one looks: the samples of a shock are no
    spikes. Nor are short stays at another level, beside which what is taken out is looked for.

    """
    at = levels(y)
    kept: dict[str, dict] = {}
    for turn in sorted({cls.turn for cls in known.values()}):
        some = {name: cls for name, cls in known.items()
                if cls.turn == turn and not cls.of_readings}
        beside = y if at is None else y - at
        found = {name: cls.statistics(beside if _is_taken_out(cls) else y, inputs)
                 for name, cls in some.items()}
        kept.update({name: f for name, f in found.items() if f})
        for name, cls in some.items():
            if _is_taken_out(cls) and name in kept:
                y = _without(y, at, partial(cls.screen, kept=kept[name], inputs=inputs))
    return kept, y


def _known() -> dict[str, type[NoiseEffect]]:
    return {k: cast('type[NoiseEffect]', cls) for k, cls in registry('noise').items()}


def _is_taken_out(cls: type[Effect]) -> TypeGuard[type[Defect]]:
    """Tell whether an effect is taken out of the samples."""
    return issubclass(cls, Defect) and cls.screens()


def _without(y: np.ndarray, at: np.ndarray | None,
             screen: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Return samples (n,) that are screened beside the levels they are at, if they are at some."""
    if at is None:
        return screen(y)
    beside = y - at
    left = screen(beside)
    return y if left is beside else left + at


def _unmasked(record: ImuRecord, memory: Memory) -> ImuRecord:
    """
    Return the record with what a person left out bridged on every axis: it is no sensor's noise.

    What was found disturbed and set aside by itself stays for curve, views and effects, so that
    the loop can say what it was.

    """
    masked = replace(record, left_out=tuple(x for x in record.left_out if MASKED in x[2]))
    found = tuple(x for x in record.left_out if x not in masked.left_out)
    if not masked.left_out:
        return record

    def bridged(data: np.ndarray | None) -> np.ndarray | None:
        if data is None:
            return None
        out = memory.columns(record.n)
        for k, y in enumerate(data.T):
            out[:, k] = _bridged(y, masked)
            memory.rest()
        return out

    return replace(record, gyro=bridged(record.gyro), accel=bridged(record.accel), left_out=found)


def _bridged(y: np.ndarray, record: ImuRecord,
             lines: np.ndarray = NO_LINES) -> np.ndarray:
    """
    Return y with what is left out replaced by what is beside it, lines (l, 6) going on through it.

    Mirrored, half from before and half from after, about a line between their means: so the
    spectrum keeps its level, which a bare line would lower. The means are of as much as is
    mirrored: those of fewer samples are off by more than the record drifts, and tilt the line.
    Where they are far apart beside how much the record changes before and after, it has jumped
    there, and the line does in its middle.

    """
    if not record.left_out:
        return y
    y = y.copy()
    ranges = [np.searchsorted(record.t, (begin, end)) for begin, end, _ in record.left_out]
    starts = [int(i) for i, _ in ranges[1:]] + [len(y)]
    for (i, j), following in zip(ranges, starts):
        first, last = max(0, i - max(50, j - i)), max(j, min(j + max(50, j - i), following))
        through = waves(lines, np.arange(first, last) * record.dt, record.dt)
        before, after = y[first:i] - through[:i - first], y[j:last] - through[j - first:]
        half = min(max((j - i + 1) // 2, j - i - len(before)), len(after))
        near = max(50, half)
        beside = [x for x in (before[-near:], after[:near]) if len(x)] or [y]
        means = [float(np.mean(beside[0])), float(np.mean(beside[-1]))]
        mirrored = np.zeros(j - i)
        back = (before[::-1] - means[0])[:j - i - half]
        mirrored[:len(back)] = back
        mirrored[j - i - half:] = (after[:half] - means[1])[::-1]
        line = np.linspace(means[0], means[1], j - i)
        if abs(means[1] - means[0]) > JUMPED * max(_changes_by(x) for x in beside):
            line = np.where(np.arange(j - i) < (j - i) // 2, *means)
        y[i:j] = line + mirrored + through[i - first:j - first]
    return y


def _changes_by(y: np.ndarray) -> float:
    """Return by how much means of half of samples (n,) differ, their standard error at least."""
    halves = np.array_split(y, 2)
    return max(abs(float(np.mean(halves[0]) - np.mean(halves[-1]))),
               2 * float(np.std(y)) / np.sqrt(len(y)))


def _power_of_looks(looks, dt):
    """Return ``block_power`` and ``block_count`` of one or two versions of the samples."""
    found = [block_power(y, dt) for y in looks]
    return {'block_power': np.array([p for p, _ in found]), 'block_count': found[0][1]}


def _whitened_looks(looks, step, c, reference, dt) -> Iterator[np.ndarray]:
    """
    Return one or two versions of the samples, whitened, one after the other.

    ``c`` are the coefficients of the last of them, ``reference`` its smooth spectrum.

    """
    dither = _dither(len(looks[0]), step) if step > 0 else None
    for y in looks:
        if dither is not None or y is not looks[-1]:
            own = cosine_transform(y if dither is None else y + dither)
            yield whitened(own, reference_spectrum(own, dt), dt)
        else:
            yield whitened(c, reference, dt)


def _cells_without_lines(c, step, dt) -> np.ndarray:
    """Return the cells of the samples whose coefficients c the lines were taken out of."""
    if step > 0:
        c = c + cosine_transform(_dither(len(c), step))
    return _counted(whitened(c, reference_spectrum(c, dt), dt))


def _dither(n: int, step: float) -> np.ndarray:
    """Return triangular noise of a step: a grid would show through the cells without it."""
    return step * (np.random.default_rng(0).random((2, n)).sum(axis=0) - 1)


def whitened(c: np.ndarray, reference: np.ndarray, dt: float) -> np.ndarray:
    """Return the samples of coefficients c (n,) over their smooth spectrum (n - 1,), rms 1."""
    white = np.empty_like(c)
    white[0] = 0.0
    np.divide(reference, 2 * dt, out=white[1:])
    np.sqrt(white[1:], out=white[1:])
    np.divide(c[1:], white[1:], out=white[1:])
    y = idct(white, type=2, norm='ortho', overwrite_x=True)
    y -= np.mean(y)
    y /= np.sqrt(sum_of_squares(y) / len(y))
    return y


def _counted(y: np.ndarray) -> np.ndarray:
    """
    Return how many of the samples y (n,), whitened, fall into each equiprobable cell.

    A fine table tells the cell but for one edge within its step: many times faster than sorting.

    """
    edges, fine = ndtri(np.arange(1, CELLS) / CELLS), 1 << 12
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


def _envelope(y, dt):
    n = len(y)
    length = max(1, n // ENVELOPE)
    rows = np.asarray(y, float)[: n // length * length].reshape(-1, length)
    return np.column_stack(
        [(np.arange(len(rows)) + 0.5) * length * dt, rows.min(axis=1), rows.max(axis=1)]
    )
