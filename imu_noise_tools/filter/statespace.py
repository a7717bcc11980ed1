# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Blocks of a linear state space that add.

x_k = Phi x_{k-1} + w_k, z_k = H x_k + v_k, cov w = Q, var v = R.

Blocks stand side by side on the diagonal. The one exception: motions that *integrate* (their first
state is the rate, driven by the rest) share that first state. Side by side, each would bring an
integrator of its own; of parallel integrators only the sum can be seen, and the filter's
covariance would grow without end in what cannot.

"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..core.errors import UsageError
from ..loop.effect import Effect, Model, Parameter

DOMAIN = 'filter'


@dataclass(frozen=True)
class Switching:
    """
    Noise that drives the rate now as one thing, now as another: the modes of a bank.

    ``wander`` are densities of random walks of the rate ({rate}^2/s), the acceleration held at
    zero; ``acceleration`` those of random walks of the acceleration ({slope}^2/s). ``prior``
    (modes,) is what the probabilities of the modes drift towards, by the share ``leave`` (1/s).

    """

    wander: tuple[float, ...]
    acceleration: tuple[float, ...]
    prior: tuple[float, ...]
    leave: float


@dataclass(frozen=True)
class Block:
    """
    One effect's part of a state space.

    ``phi`` and ``q`` (d, d), ``h`` (d,), ``p0`` (d, d) the covariance it starts with.

    ``r`` is variance added to the measurement, ``r_factor`` multiplies what all blocks add.
    ``integrates``: the first state is the rate itself, to be shared. ``outliers`` is (fraction,
    variance factor), ``step`` (probability, variance) of a jump of the rate within one interval,
    ``jitter`` the standard deviation, s, of when a sample is taken.
    ``switching``: its second state is the acceleration, and q is for a density of one.
    ``law`` (size, share 1/s, decay 1/s, spring 1/s^2) is what such modes do not know of the
    motion: ``size`` times the density, grown by ``share`` times the square of the acceleration a,
    drives it, and a' = -decay a - spring x.
    ``keeps``: its states keep a phase, for the whole record perhaps.

    """

    phi: np.ndarray
    q: np.ndarray
    h: np.ndarray
    p0: np.ndarray
    r: float = 0.0
    r_factor: float = 1.0
    integrates: bool = False
    outliers: tuple[float, float] | None = None
    step: tuple[float, float] | None = None
    switching: Switching | None = None
    jitter: float = 0.0
    law: tuple[float, ...] | None = None
    keeps: bool = False


@dataclass(frozen=True)
class StateSpace:
    """
    The sum of blocks over one interval dt.

    ``phi``, ``q``, ``p0`` (d, d); ``h`` (d,) what is measured; ``rate`` (d,) what of it is motion;
    ``r`` the variance of the white part; ``outliers``, ``step``, ``switching``, ``jitter`` and
    ``law`` as in :class:`Block`; ``keeps`` the states that keep a phase. ``grows`` (2, 2), of a
    mode, is what the square of the acceleration (state 1) adds to Q of the first two states; None
    where nothing does.

    """

    phi: np.ndarray
    q: np.ndarray
    h: np.ndarray
    rate: np.ndarray
    r: float
    p0: np.ndarray
    dt: float
    outliers: tuple[float, float] | None = None
    step: tuple[float, float] | None = None
    switching: Switching | None = None
    jitter: float = 0.0
    keeps: tuple[int, ...] = ()
    law: tuple[float, ...] | None = None
    grows: np.ndarray | None = None

    @property
    def size(self) -> int:
        """Number of states."""
        return len(self.h)


@dataclass(frozen=True)
class Look:
    """
    What a first look at a series shows, for starting values.

    ``z`` (n,) at ``dt`` s, ``u`` its scores so far.

    ``r`` is the variance of its white noise, ``lines`` (k, 2) frequency and amplitude of what
    stands out of the spectrum, the strongest first; ``tails`` tells whether single scores are far
    larger than chance.

    """

    z: np.ndarray
    u: np.ndarray
    dt: float
    r: float
    lines: np.ndarray
    tails: bool


class FilterEffect(Effect):
    """
    An effect of the filter's domain: it supplies one block.

    What it can do it says here; nothing goes by its name.

    """

    domain: ClassVar[str] = DOMAIN
    #: motion drives the rate, noise adds to the output
    kind: ClassVar[str] = ''
    #: whether it is a candidate of a diagnosis: not what is always there, or cannot be told apart
    sought: ClassVar[bool] = True
    #: it is a candidate only where this is in the model already
    after: ClassVar[str] = ''
    #: nats that chance gains by the places where it is looked for
    search: ClassVar[float] = 0.0
    #: the test of evaluate.omnibus that it must mend to be believed
    heals: ClassVar[str] = ''
    #: whether its block holds a step, outliers or jitter: a model with it has no steady state
    jumps: ClassVar[bool] = False
    #: whether it stands for every motion: no other is missing beside it
    every: ClassVar[bool] = False
    #: whether it is seen by what the angular acceleration does, which the model must then know
    slopes: ClassVar[bool] = False
    #: whether it multiplies the stated noise: nothing to be found where none is stated
    scales: ClassVar[bool] = False
    #: values with which it does next to nothing, beside the least of its amplitudes
    idle: ClassVar[dict[str, float]] = {}
    #: the parameter that is the variance of white noise, for an effect that is
    variance: ClassVar[str] = ''
    #: whether its values are of one step of the samples, and others at another rate
    counts: ClassVar[bool] = False
    #: the parameter that is the frequency of a line, for an effect that keeps its phase
    line: ClassVar[str] = ''
    #: the parameter that says for how long it keeps its phase, s
    keeps: ClassVar[str] = ''
    #: parameters read from the samples (:meth:`read`), not from the likelihood
    measured: ClassVar[tuple[str, ...]] = ()
    views: ClassVar[tuple[str, ...]] = ()       # it is judged by all views

    @classmethod
    def guesses(cls, look: Look) -> list[Effect]:
        """
        Return where a fit may start, by default the typical effect.

        None: the effect does not apply to these data.

        """
        return [cls.example()]

    @classmethod
    def within(cls, parameter: Parameter, dt: float) -> tuple[float, float]:
        """Return the range of a parameter in data at dt (s), which may know of less than all."""
        return parameter.lower, parameter.upper

    def idling(self) -> Effect:
        """Return it doing next to nothing."""
        least = {p.name: p.lower for p in self.parameters if p.amplitude}
        return self.with_values(**{**least, **self.idle})

    def read(self, z: np.ndarray, dt: float) -> Effect:
        """Return it with the values that come from samples z (n,), NaN if missing, at dt (s)."""
        return self

    def told(self, z: np.ndarray, r: float) -> Effect:
        """Return it with what z (n,), of white noise of variance r, tells without a model."""
        return self

    def block(self, dt: float) -> Block:
        """Return (Phi, Q, H, R) over one interval dt, s."""
        raise NotImplementedError


class Motion(FilterEffect):
    """What drives the rate."""

    kind: ClassVar[str] = 'motion'
    #: whether the rate has a slope that goes on: an angular acceleration
    smooth: ClassVar[bool] = False


class OutputNoise(FilterEffect):
    """What adds to the output and is to be taken away."""

    kind: ClassVar[str] = 'noise'


def nothing(**parts: Any) -> Block:
    """Return a block without states: only R, outliers, a step or jitter."""
    empty = np.zeros((0, 0))
    return Block(empty, empty, np.zeros(0), empty, **parts)


def white_of(model: Model) -> FilterEffect | None:
    """Return the white noise of a model, the effect that sets R; None where there is none."""
    return next((e for e in model.of(FilterEffect) if e.variance), None)


def jumps(model: Model) -> bool:
    """Tell whether a model has no steady state: it steps, switches, or its noise changes."""
    return any(e.jumps for e in model.of(FilterEffect))


def oscillates(model: Model) -> bool:
    """Tell whether an effect of the model has a phase, which it may keep for the whole record."""
    return any(e.line for e in model.of(FilterEffect))


def psd(effect: FilterEffect, f: np.ndarray, dt: float) -> np.ndarray | None:
    """
    Return the one-sided PSD (k,) at f > 0 (Hz) of what an effect adds to the measurement.

    By its block: H (z - Phi)^-1 Q (z - Phi)^-H H', and R; of a motion that goes on for ever that
    of its steps. None of what switches, and of what only multiplies other noise.

    """
    b = effect.block(dt)
    if b.switching or b.outliers or b.jitter or b.r_factor != 1.0:
        return None
    out = np.full(len(f), 2 * dt * b.r)
    if b.step:
        out = out + 2 * dt * b.step[0] * b.step[1] / (2 * np.sin(np.pi * f * dt)) ** 2
    if len(b.h):
        z = np.exp(2j * np.pi * f * dt)[:, None, None]
        gain = np.linalg.solve((z * np.eye(len(b.h)) - b.phi).transpose(0, 2, 1),
                               np.broadcast_to(b.h[:, None], (len(f), len(b.h), 1)))[:, :, 0]
        out = out + 2 * dt * np.einsum('fi,ij,fj->f', gain, b.q, gain.conj()).real
    return out


def output_noise(model: Model, dt: float) -> Block:
    """Return what adds to the output, all noise of a model, as one block: states and white."""
    blocks = [e.block(dt) for e in model.of(OutputNoise)]
    return Block(_diagonal([b.phi for b in blocks]), _diagonal([b.q for b in blocks]),
                 np.concatenate([np.zeros(0), *(b.h for b in blocks)]),
                 _diagonal([b.p0 for b in blocks]), _white(blocks))


def _white(noises: list[Block]) -> float:
    """Return the variance of all white noise, with what multiplies it."""
    return sum(b.r for b in noises) * float(np.prod([b.r_factor for b in noises]))


def state_space(model: Model, dt: float) -> StateSpace:
    """
    Add the blocks of a model over one interval dt (s).

    Raises
    ------
    UsageError
        No motion in the model, no white noise, or a value missing.

    """
    blocks = []
    for e in model.of(FilterEffect):
        if not e.fitted:
            raise UsageError(f'{e.label} has no values', 'fit it, or give them')
        blocks.append((e, e.block(dt)))
    motions = [b for e, b in blocks if e.kind == 'motion']
    sharing = [b for b in motions if b.integrates]
    sharing.sort(key=lambda b: b.switching is None)     # its states come first: the bank's modes
    own = [b for b in motions if not b.integrates]
    noises = [b for e, b in blocks if e.kind == 'noise']
    if not motions:
        raise UsageError('the model has no motion', 'add constant_rate or another motion')
    r = _white(noises)
    if not r > 0:
        if (w := white_of(model)) is not None:
            raise UsageError(f'{w.label}.{w.variance} is {r:g}', 'it must be above 0: without '
                             'noise every sample is exact')
        raise UsageError(
            'the model has no white noise', 'add white: without it every sample is exact'
        )
    parts = ([_share(sharing)] if sharing else []) + own
    if not any(b.h.size for b in parts):
        raise UsageError(
            'no motion of the model has a state', 'add constant_rate or another motion'
        )
    everything = parts + noises
    rate = np.concatenate([*(b.h for b in parts), *(0 * b.h for b in noises)])
    return StateSpace(
        _diagonal([b.phi for b in everything]),
        _diagonal([b.q for b in everything]),
        np.concatenate([b.h for b in everything]),
        rate,
        r,
        _diagonal([b.p0 for b in everything]),
        dt,
        next((b.outliers for _, b in blocks if b.outliers), None),
        next((b.step for _, b in blocks if b.step), None),
        _switching([b for _, b in blocks]),
        float(np.sqrt(sum(b.jitter ** 2 for b in noises))),
        tuple(np.flatnonzero(np.concatenate([np.full(len(b.h), b.keeps) for b in everything]))),
        next((b.law for b in motions if b.law), None),
    )


def _switching(blocks: list[Block]) -> Switching | None:
    """Return what switches: one thing at the most, and then nothing steps beside it."""
    found = [b.switching for b in blocks if b.switching]
    if len(found) + sum(b.step is not None for b in blocks) > 1:
        raise UsageError('two motions that jump or switch stand side by side', 'name one of them')
    return found[0] if found else None


def _share(blocks: list[Block]) -> Block:
    """
    Return the blocks with their integrators, states 0, made one.

    Rows, columns and covariances add.

    """
    d = 1 + sum(len(b.h) - 1 for b in blocks)
    phi, q, p0 = np.zeros((d, d)), np.zeros((d, d)), np.zeros((d, d))
    at = 1
    for b in blocks:
        mine = np.array([0, *range(at, at + len(b.h) - 1)])
        q[np.ix_(mine, mine)] += b.q
        p0[np.ix_(mine, mine)] += b.p0
        phi[np.ix_(mine, mine)] += b.phi
        at += len(b.h) - 1
    phi[0, 0] = 1.0
    p0[0, 0] = max(b.p0[0, 0] for b in blocks)
    return Block(phi, q, np.eye(d)[0], p0, integrates=True)


def _diagonal(parts: list[np.ndarray]) -> np.ndarray:
    d = sum(len(p) for p in parts)
    out = np.zeros((d, d))
    at = 0
    for p in parts:
        out[at:at + len(p), at:at + len(p)] = p
        at += len(p)
    return out
