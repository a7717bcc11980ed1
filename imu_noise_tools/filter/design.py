# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What a filter is made of before it sees a sample; and R where nobody states it.

Motion, noise, memory.

"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from .modes import default_modes, Modes, modes_of
from .output_noise import White
from .statespace import DOMAIN, FilterEffect, jumps, state_space, white_of
from ..core.errors import UsageError
from ..core.statistics import median_sigma
from ..loop.effect import find_effect, Model

AUTO = 'auto'
DIFFERENCES = np.array([1.0, -3.0, 3.0, -1.0])      # their squares sum to 20
QUIET = 128             # samples of a block of which the noise is read
QUIETEST = 0.25  # which quantile of the blocks is taken: in motion the others hold the motion
QUANTILE_BIAS = 0.92    # what that quantile shows of sigma when all blocks are still (simulated)


@dataclass(frozen=True)
class Design:
    """
    A filter for some axes.

    ``noise`` and ``motion`` hold a model for each axis; ``motion`` None is the default bank.
    ``unknown_r``: no R was given, it is read from the samples. ``unread`` are the labels of what
    else has no values given: typical ones, or of a record its own. ``alpha`` is the fading memory.

    """

    motion: tuple[Model, ...] | None
    noise: tuple[Model, ...]
    alpha: float = 1.0
    unknown_r: bool = False
    unread: tuple[str, ...] = ()

    @property
    def linear(self) -> bool:
        """Whether each axis is one linear Gaussian model, which has a steady state."""
        return self.motion is not None and not any(jumps(m) for m in (*self.motion, *self.noise))

    @property
    def r(self) -> np.ndarray:
        """Variance of the white noise of each axis, (axes,)."""
        return np.array([w[w.variance] for w in map(white, self.noise)])

    @property
    def names(self) -> dict:
        """Labels of motion and noise, for people."""
        return {
            'motion': [AUTO] if self.motion is None else self.motion[0].labels,
            'noise': self.noise[0].labels,
        }

    def with_r(self, r: Any) -> Design:
        """Return the design with the variance of the white noise of each axis, (axes,), given."""
        return Design(
            self.motion,
            tuple(m.with_values({w.label: {w.variance: float(v)}})
                  for m, w, v in zip(self.noise, map(white, self.noise), r)),
            self.alpha,
            unread=self.unread,
        )

    def with_read(self, z: np.ndarray) -> Design:
        """Return the design with what the samples z (n, axes) of a record tell of its noise."""
        if not self.unread:
            return self
        noise = []
        for model, r, x in zip(self.noise, self.r, z.T):
            for e in model.of(FilterEffect):
                if e.label in self.unread:
                    model = model.with_effect(e.told(x, float(r)))
            noise.append(model)
        return replace(self, noise=tuple(noise))

    def models(self) -> list[Model]:
        """Return motion and noise of each axis as one model; the default bank has none."""
        return [m + n for m, n in zip(self.motion or (), self.noise)]

    def modes(self, dt: float) -> Modes:
        """Return the bank over an interval dt, s."""
        return (
            default_modes(list(self.noise), dt)
            if self.motion is None
            else modes_of(self.models(), dt)
        )


def white(model: Model) -> FilterEffect:
    """Return the white noise of a model that has one."""
    found = white_of(model)
    assert found is not None
    return found


def design(motion: Any = AUTO, noise: Any = ('white',), alpha: float = 1.0, values: Any = None,
           axes: int = 3) -> Design:
    """
    Return a design from names.

    Parameters
    ----------
    motion : 'auto', sequence of str, Model or one Model for each axis
        ``'auto'`` (also ``['auto']``) is the default bank of :mod:`imm`.
    noise : sequence of str, Model or one Model for each axis
        ``white`` is added where it is missing; where it has no value, R is read from the samples.
    alpha : float
        Fading memory, 0 < alpha <= 1.
    values : mapping of label to mapping of parameter to value, or one for each axis
        In SI; what is not given is typical, or told by a record (:meth:`Design.with_read`).
    axes : int
        How many there are.

    Raises
    ------
    UsageError
        An unknown or repeated effect, a motion among the noise or the reverse, alpha out of range,
        no motion.

    """
    if not 0 < float(alpha) <= 1:
        raise UsageError(f'invalid alpha {alpha}', 'it must be above 0 and at most 1')
    values = (
        [values or {}] * axes if values is None or isinstance(values, Mapping) else list(values)
    )
    automatic = not isinstance(motion, Model) and (motion == AUTO or list(motion) == [AUTO])
    motions = aligned([_named(m, 'motion') for m in motion]) if _by_axis(motion) else \
        [] if automatic else [_named(motion, 'motion')] * axes
    moving = None if automatic else tuple(_valued(m, v) for m, v in zip(motions, values))
    if moving is not None and not len(moving[0]):
        raise UsageError('no motion is named', f"name one, or '{AUTO}'")
    if _by_axis(noise):
        noises = aligned([_named(m, 'noise') for m in noise])
    else:
        noises = [_named(noise, 'noise')] * axes
    noises = [m if white_of(m) else m + White() for m in noises]
    unknown = any(not w.fitted and not v.get(w.label)
                  for w, v in zip(map(white, noises), values))
    unread = {e.label for m, v in zip(noises, values) for e in m.of(FilterEffect)
              if not e.fitted and not v.get(e.label)}
    made = Design(
        moving, tuple(_valued(m, v) for m, v in zip(noises, values)), float(alpha), unknown,
        tuple(sorted(unread)),
    )
    if moving is not None:
        state_space(made.models()[0], 0.01)          # refuse here what cannot be built
    return made


def memory(chosen: Design, smooth: bool, delay: float = 0.0) -> None:
    """Raise UsageError where a design that fades the past is to be smoothed, or it is twice."""
    if not 0 <= delay < np.inf:
        raise UsageError(f'invalid delay {delay:g} s', 'it must be 0 or more')
    if smooth and delay:
        raise UsageError('both --smooth and --delay are given', 'give only one')
    if (smooth or delay) and chosen.alpha != 1:
        raise UsageError('a smoother has no fading memory',
                         'leave alpha at 1, or leave out --smooth and --delay')


def _named(names, kind: str) -> Model:
    """Return a model of names (or a model), all of one kind."""
    if isinstance(names, Model):
        model = names
    else:
        names = [names] if isinstance(names, str) else list(names)
        model = Model(find_effect(DOMAIN, n)() for n in names if n)
    for e in model.of(FilterEffect):
        if e.kind != kind:
            raise UsageError(
                f'{e.name} is a {e.kind} effect, not a {kind} effect', f'name it under {e.kind}'
            )
    return model


def _by_axis(models) -> bool:
    return isinstance(models, (list, tuple)) and bool(models) and isinstance(models[0], Model)


def aligned(models: list[Model]) -> list[Model]:
    """
    Return the models with the same labels in each, since the axes share their states.

    What one axis lacks it gets from another, doing next to nothing.

    """
    every = {e.label: e for m in reversed(models) for e in reversed(m.effects)}
    order = list(dict.fromkeys(label for m in models for label in m.labels))
    return [Model(m[x] if x in m else cast(FilterEffect, every[x]).idling() for x in order)
            for m in models]


def _valued(model: Model, values: Mapping) -> Model:
    """Return the model with the values given, and typical ones elsewhere."""
    return Model(e.with_values(**{**(type(e).example().values if not e.fitted else e.values),
                                  **values.get(e.label, {})}) for e in model)


def quiet_variance(z: np.ndarray) -> np.ndarray:
    """
    Return the variance of the white noise of z (n, axes), motion or not, (axes,).

    Third differences have variance 20 R and leave little of any motion slower than a tenth of the
    rate; the median of their sizes in blocks is deaf to outliers, and the quiet quarter of the
    blocks to what motion is left. Noise that is not white (a sensor that smooths its output) is
    read too low: then give R, or a study.

    """
    z = np.asarray(z, float)
    d = (
        DIFFERENCES[0] * z[:-3]
        + DIFFERENCES[1] * z[1:-2]
        + DIFFERENCES[2] * z[2:-1]
        + DIFFERENCES[3] * z[3:]
    )
    blocks = len(d) // QUIET
    if blocks >= 4:
        sizes = median_sigma(d[:blocks * QUIET].reshape(blocks, QUIET, -1), axis=1)
        sigma = np.quantile(sizes, QUIETEST, axis=0) / QUANTILE_BIAS
    else:
        sigma = median_sigma(d, axis=0)
    rough = np.sqrt(np.mean(d * d, axis=0))
    sigma = np.where(sigma > 0, sigma, rough)  # most samples equal: a coarse output at rest
    return np.maximum(sigma ** 2 / 20, 1e-16)
