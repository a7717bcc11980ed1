# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The gyroscope from the turns between rests: gravity before, turned as integrated, is gravity after.

Tedaldi, Pretto and Menegatti (ICRA 2014), as a weighted linear least squares, iterated: with
raw = S w + b + effects, a change of these coefficients turns what was integrated by

    d phi = -sum_i R_i S^-1 (dS w_i + db + ...) dt_i        (frame of the start)

so each turn gives two equations across the vertical, each rest three (w = 0). Integration is
coning-correct: the rotation vector of an interval is the integral of the cubic through four rates
and dt^2 / 12 w0 x w1 (Savage 1998, section 7.1.1.1).

"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from .correction import Correction
from .poses import joined, Poses, unit
from .positions import grid_steps, hidden, means_of, Rest, scatter_errors, temperatures
from ..core.clipped import stays
from ..core.errors import InputError
from ..core.record import ImuRecord

_KNOCKED = 3.0          # times the median: what a hand adds reaches it seldom, a knock does
_SETTLED_S = 1e-7
_NEAR_S = 1.0           # of a rest that is next to a turn gives its direction: a hand creeps


@dataclass(frozen=True)
class Turns:
    """
    Turns from rest to rest: n turns of m samples in all, and the rests between.

    Parameters
    ----------
    gyro, force : ndarray (m, 3)
        Raw rates, rad/s, and specific force, m/s^2 (of the calibrated accelerometer).
    step : ndarray (m,)
        Time to the next sample, s; 0 at the last of a turn.
    temperature, time : ndarray (m,)
        Degrees Celsius, nan where unknown; s since the start of the record.
    turn : ndarray (m,)
        To which turn a sample belongs, 0 to n - 1.
    before, after : ndarray (3, n)
        Direction of up before and after each turn, in the frame of the accelerometer.
    spread : ndarray (n,)
        Standard deviation of the angle between prediction and measurement from noise, rad.
    rests : Poses
        Mean outputs at rest, inputs zero.
    hidden : ndarray (3,)
        What the step of the output hides of the bias, rad/s rms: all rests share it.
    axes : ndarray (3,)
        By what angle about x, y and z the accelerometer's axes may be off, rad rms: all turns
        share it.

    """

    gyro: np.ndarray
    force: np.ndarray
    step: np.ndarray
    temperature: np.ndarray
    time: np.ndarray
    turn: np.ndarray
    before: np.ndarray
    after: np.ndarray
    spread: np.ndarray
    rests: Poses
    hidden: np.ndarray = field(default_factory=lambda: np.zeros(3))
    axes: np.ndarray = field(default_factory=lambda: np.zeros(3))

    @property
    def n(self) -> int:
        """Number of turns."""
        return self.before.shape[1]

    def without(self, k: int) -> Turns:
        """Return all turns but one, with all rests."""
        return self.take([j for j in range(self.n) if j != k])

    def take(self, turns: Any) -> Turns:
        """Return some turns, with all rests."""
        turns = np.atleast_1d(np.asarray(turns, int))
        number = np.full(self.n, -1)
        number[turns] = np.arange(len(turns))
        mine = np.isin(self.turn, turns)
        some = {k: getattr(self, k)[mine] for k in _SAMPLES}
        return replace(self, **{**some, 'turn': number[self.turn[mine]],
                                'before': self.before[:, turns], 'after': self.after[:, turns],
                                'spread': self.spread[turns]})

    @property
    def samples(self) -> Poses:
        """All samples as poses, one column each, inputs not known yet."""
        return Poses.of('gyro', self.gyro.T, 0.0, 1.0, force=self.force.T,
                        temperature=self.temperature, time=self.time,
                        reference_temperature=self.rests.reference_temperature,
                        names=[''] * len(self.gyro))

    def to_arrays(self) -> dict[str, np.ndarray]:
        """Return all but the rests as plain arrays by name, for an npz file; shapes as above."""
        return {k: np.asarray(getattr(self, k)) for k in (*_SAMPLES, *_TURNS, *_SHARED)}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Any], rests: Poses) -> Turns:
        """Return the turns that :meth:`to_arrays` wrote."""
        found = {k: np.array(arrays[k], float) for k in (*_SAMPLES, *_TURNS)}
        shared = {k: np.array(arrays.get(k, np.zeros(3)), float) for k in _SHARED}
        return cls(**{**found, 'turn': found['turn'].astype(int)}, rests=rests, **shared)


_SAMPLES = ('gyro', 'force', 'step', 'temperature', 'time', 'turn')
_TURNS = ('before', 'after', 'spread')
_SHARED = ('hidden', 'axes')        # which older studies lack


def gathered(record: ImuRecord, found: list[Rest], accel: Correction, gravity: float) -> Turns:
    """
    Return the turns of a record between its rests, directions by a calibrated accelerometer.

    Raises
    ------
    InputError
        There is no gyroscope, there are fewer than two rests, or no turn between them that is
        whole: one with a gap, or in which a rate stands at the end of its range, is not.

    """
    if record.gyro is None or record.accel is None:
        raise InputError(f'{record.path or "the record"} has not both sensors',
                         'turns between poses need a gyroscope and an accelerometer')
    if len(found) < 2:
        raise InputError('fewer than two rests in one recording: no turn between poses is seen',
                         'hold some poses, still, one after the other')
    gyro = np.asarray(record.gyro, float)
    heat = record.covariates.get('temperature', np.full(record.n, np.nan))
    force = accel.apply(np.asarray(record.accel, float), _known(heat), time=record.t)
    near = max(1, round(_NEAR_S * record.rate_hz))
    first, last = (np.array([force[r.samples()[s]].mean(0) for r in found]).T
                   for s in (slice(near), slice(-near, None)))
    noise = _off(record, force, found, near) / gravity
    least = hidden(gyro, found)
    white = _density(gyro, found, record, least)
    clipped = np.any([stays(x) for x in gyro.T], axis=0)
    parts: dict[str, list] = {k: [] for k in _SAMPLES}
    kept: list[tuple[int, float]] = []
    for k, (a, b) in enumerate(zip(found[:-1], found[1:])):
        here = _turning(gyro, a.end - 1, b.begin + 1)
        t = record.t[here]
        if not np.isfinite(gyro[here]).all() or np.diff(t).max(initial=0) > 0.1 \
                or clipped[here].any():
            continue        # a gap, or faster than it can tell: what it turned there is not known
        for name, value in (('gyro', gyro[here]), ('force', force[here]), ('time', t),
                            ('step', np.append(np.diff(t), 0.0)), ('temperature', heat[here]),
                            ('turn', np.full(len(t), len(kept)))):
            parts[name].append(value)
        kept.append((k, np.sqrt(np.mean(noise[:, k] ** 2 + noise[:, k + 1] ** 2)
                                + white ** 2 * (t[-1] - t[0]))))
    if not kept:
        raise InputError('no turn between rests without a gap, or with a rate within the range',
                         'record again, and turn more slowly')
    index = np.array([k for k, _ in kept])
    rests = Poses.of(
        'gyro', means_of(gyro, found).T, _bias_errors(gyro, found, record.rate_hz, least), 1.0,
        np.zeros((3, len(found))), force=means_of(force, found).T,
        temperature=temperatures(record, found),
        time=[record.t[r.samples()].mean() for r in found], names=['rest'] * len(found))
    return Turns(**{k: np.concatenate(v) for k, v in parts.items()},
                 before=unit(last[:, index]), after=unit(first[:, index + 1]),
                 spread=np.array([s for _, s in kept]), rests=rests, hidden=least)


def _known(heat):
    return heat if np.isfinite(heat).all() else None


def _off(record, force, found, near) -> np.ndarray:
    """Return the standard error of the force next to a turn, (3, rests), of ``near`` samples."""
    length = np.array([len(r.samples()) for r in found])
    noise = scatter_errors(force, found, record.rate_hz)
    noise = noise * np.sqrt(length / np.minimum(length, near))
    # a calibrated force is on no grid any more
    return np.hypot(noise, hidden(np.asarray(record.accel, float), found)[:, None])


def _density(gyro, found, record, least) -> float:
    """
    Return the white noise of the rates, rad/s/sqrt(Hz), rms of the axes.

    What a grid hides at rest, ``least`` (3,), comes anew with every sample while it turns.

    """
    rms = scatter_errors(gyro, found, record.rate_hz)
    span = np.array([len(r.samples()) * record.dt for r in found])
    return float(np.sqrt(np.mean(rms ** 2 * span + least[:, None] ** 2 * record.dt)))


def _turning(gyro, begin, end) -> slice:
    """
    Return what turns of the samples between two rests.

    Not the constant output of a coarse sensor that still rests, which hides up to half a step of
    its bias for that long.

    """
    same = (gyro[begin + 1:end] == gyro[begin:end - 1]).all(axis=1)
    if same.all():
        return slice(begin, end)
    moves = np.flatnonzero(~same)
    return slice(begin + int(moves[0]), begin + int(moves[-1]) + 2)


def _bias_errors(gyro, found, rate_hz, least) -> np.ndarray:
    """
    Return the standard error of the rates at rest, (3, rests).

    Rests at one level of a grid share the error of its rounding: together they tell the bias no
    better than one.

    """
    alike = np.ones(3)
    means, steps = means_of(gyro, found), grid_steps(gyro)
    for k in np.flatnonzero(steps):
        alike[k] = len(found) / len(np.unique(np.round(means[:, k] / steps[k])))
    return np.hypot(scatter_errors(gyro, found, rate_hz), (least * np.sqrt(alike))[:, None])


def together(parts: list[Turns]) -> Turns:
    """Return the turns of several records as one."""
    count = np.cumsum([0] + [p.n for p in parts])
    some = {k: np.concatenate([getattr(p, k) for p in parts], axis=-1) for k in _TURNS}
    all_ = {k: np.concatenate([getattr(p, k) for p in parts]) for k in _SAMPLES}
    all_['turn'] = np.concatenate([p.turn + n for p, n in zip(parts, count)])
    return Turns(**all_, **some, rests=joined([p.rests for p in parts]),
                 hidden=np.max([p.hidden for p in parts], axis=0))


def integrated(turns: Turns, rates: np.ndarray) -> np.ndarray:
    """
    Return the rotation from the body at each sample to that at its turn's start, (m, 3, 3).

    Products of 1, 2, 4 ... steps up to each sample, by pairs of those before (Hillis and Steele,
    Communications of the ACM 29, 1986): as many rounds as the longest turn has binary digits.

    """
    step = turns.step[:-1, None]
    a, b = rates[:-1], rates[1:]
    turn = rotations(step * _means(turns, rates) + step ** 2 / 12 * np.cross(a, b))
    begin = begins(turns)
    length = np.diff(np.append(begin, len(rates)))
    since = np.arange(len(rates)) - np.repeat(begin, length)    # samples from its turn's start
    out = np.broadcast_to(np.eye(3), (len(rates), 3, 3)).copy()
    out[since > 0] = turn[since[1:] > 0]
    reach = 1
    while reach < length.max(initial=1):
        at = np.flatnonzero(since > reach)      # of others the start is reached already
        out[at] = out[at - reach] @ out[at]
        reach *= 2
    return out


def _means(turns, rates):
    """Return the mean rate between each sample and the next, (m - 1, 3)."""
    mean = (rates[:-1] + rates[1:]) / 2
    step, turn = turns.step, turns.turn
    if len(rates) > 3:
        # a cubic where four samples are of one turn, as far apart as stamps jitter
        even = np.ptp([step[:-3], step[1:-2], step[2:-1]], axis=0) < 0.2 * step[1:-2]
        inner = 1 + np.flatnonzero(even & (turn[:-3] == turn[3:]))
        bow = rates[inner - 1] - rates[inner] - rates[inner + 1] + rates[inner + 2]
        mean[inner] -= bow / 24
    return mean


def rotations(vectors: np.ndarray) -> np.ndarray:
    """Return the rotation matrices of rotation vectors (m, 3), Rodrigues."""
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    k = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
    sine = np.sinc(angle / np.pi)
    versine = 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    return np.eye(3) + sine * k + versine * k @ k


def begins(turns: Turns) -> np.ndarray:
    """Return the index of each turn's first sample, (n,)."""
    return np.searchsorted(turns.turn, np.arange(turns.n))


def ends(turns: Turns) -> np.ndarray:
    """Return the index of each turn's last sample, (n,)."""
    return np.searchsorted(turns.turn, np.arange(turns.n), side='right') - 1


def misses(turns: Turns, rotation: np.ndarray) -> np.ndarray:
    """
    Return by which small rotation (frame of the start) each turn misses gravity, (n, 3), rad.

    Its length is the angle between predicted and measured direction.

    """
    seen = np.einsum('nij,jn->ni', rotation[ends(turns)], turns.after)
    axis = np.cross(seen, turns.before.T)
    sine = np.linalg.norm(axis, axis=1)
    angle = np.arctan2(sine, np.einsum('ni,in->n', seen, turns.before))
    return axis * np.where(sine > 1e-12, angle / np.maximum(sine, 1e-12), 1.0)[:, None]


def tangents(directions: np.ndarray) -> np.ndarray:
    """Return two unit vectors across each direction (3, n): (n, 2, 3)."""
    least = np.eye(3)[np.argmin(np.abs(directions), axis=0)]
    first = unit(np.cross(directions.T, least).T)
    return np.stack([first.T, np.cross(directions.T, first.T)], axis=1)


def sums(turns: Turns, rotation: np.ndarray, scale: np.ndarray, terms: np.ndarray) -> np.ndarray:
    """Return sum_i R_i S^-1 terms_i dt of each turn, (n, 3, k), for terms (3, m, k)."""
    weight = turns.step.copy()
    weight[1:] += turns.step[:-1]
    back = np.einsum('mij,jl->mil', rotation, np.linalg.inv(scale)) * (weight / 2)[:, None, None]
    each = np.einsum('mil,lmk->mik', back, terms)
    return np.add.reduceat(each, begins(turns), axis=0)


def time_offset(turns: Turns, rates: np.ndarray, gravity: float) -> tuple[float, float]:
    """
    Return (s, standard error): by how much the accelerometer's stamps are late.

    While it turns, gravity goes through the accelerometer: f(t) / g = u(t - offset) and what the
    hand adds; least squares of f / g - u on -du/dt = w x u, bounded against knocks (Huber). What
    a hand adds is coloured: samples of a turn are not independent of each other, turns are. So
    the error is that of leaving out each turn (the jackknife of an M-estimate, by its first
    order: Huber and Ronchetti 2009, section 1.5).

    """
    rotation = integrated(turns, rates)
    up = np.einsum('mji,jm->mi', rotation, turns.before[:, turns.turn])
    speed = np.cross(rates, up)
    off = turns.force / gravity - up
    speed2 = np.maximum(np.sum(speed ** 2, axis=1), 1e-300)
    weight = np.ones(len(off))
    slope = 0.0
    for _ in range(30):
        before, slope = slope, float(weight @ np.sum(off * speed, axis=1) / (weight @ speed2))
        left = off - slope * speed
        size = np.maximum(np.linalg.norm(left, axis=1), 1e-300)
        weight = np.minimum(1.0, _KNOCKED * np.median(size) / size)
        if abs(slope - before) < _SETTLED_S:
            break
    along = np.sum(left * speed, axis=1)
    # a sample beyond the bound follows the slope only across what is left of it
    bends = weight * (speed2 - (weight < 1) * (along / size) ** 2)
    share = np.bincount(turns.turn, bends, turns.n) / bends.sum()
    each = np.bincount(turns.turn, weight * along, turns.n) / np.maximum(1 - share, 1e-9)
    return slope, float(np.sqrt(np.sum(each ** 2)) / bends.sum())
