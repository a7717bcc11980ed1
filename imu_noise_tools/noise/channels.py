# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The channels that couplings bring into a part: their gains, what they add and what they miss."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from .evidence import Evidence
from .kinds import Coupling, model_crowd
from .shared import spread
from .slow_part import SlowPart
from ..core.linear import inverse
from ..loop.effect import Model


class _Heard(NamedTuple):
    """Of channels (p): cross-powers (p, b), their own (p, p, b), slow coefficients (p, q)."""

    cross: np.ndarray
    own: np.ndarray
    slow: np.ndarray


class Channels:
    """
    The channels of a model's couplings, beside its means.

    Parameters
    ----------
    evidence : Evidence
    part : str
        ``whole``, ``first`` or ``second``.
    couplings : sequence of Coupling
    slow : SlowPart
        The slow coefficients of the part, and the means in them.

    Attributes
    ----------
    spreads : dict
        By channel the power (b,) of its source that it misses, of a gain of 1, where it does.

    """

    def __init__(self, evidence: Evidence, part: str, couplings: Sequence[Coupling],
                 slow: SlowPart):
        self.evidence, self.part_name, self.couplings = evidence, part, couplings
        self._slow = slow
        self._names: dict[tuple, tuple[str, ...]] = {}
        self._heard: dict[tuple, _Heard] = {}
        spreads = {
            n: self._spread(n)
            for c in couplings for n in c.channels(evidence) if evidence.common.holds(n)}
        self.spreads = {k: v for k, v in spreads.items() if np.any(v)}

    def _spread(self, channel: str) -> np.ndarray:
        """Return what :func:`spread` says of a channel, which is the same for all models."""
        return self.evidence.remembered(
            ('spread', self.part_name, channel),
            lambda: spread(partial(self.evidence.coupled, part=self.part_name), channel,
                           self._slow.bins))

    def _of(self, coupling):
        """Return the channels of a coupling, which go with its choices alone."""
        key = coupling.label, *(coupling.values.get(p.name) for p in coupling.parameters
                                if p.choices)
        if key not in self._names:
            self._names[key] = tuple(coupling.channels(self.evidence))
        return self._names[key]

    def names(self, model: Model) -> tuple[str, ...]:
        """Return the channels (p) that the couplings have in a model."""
        return tuple(n for c in self.couplings for n in self._of(model[c.label]))

    def _of_model(self, model):
        """Return what a model's couplings hear."""
        pair, here, names = self.evidence.coupled, self.part_name, self.names(model)
        if names not in self._heard:
            self._heard[names] = _Heard(
                np.array([pair(self.evidence.axis, n, here) for n in names]),
                np.array([[pair(a, b, here) for b in names] for a in names]),
                self._slow.of_channels(names),
            )
        return self._heard[names]

    def gains(self, model: Model, v: np.ndarray, weight: np.ndarray,
              ) -> tuple[np.ndarray, np.ndarray]:
        """Return gains of couplings (p,) and their covariance, at a spectrum and weights (b,)."""
        cross, own, first = self._of_model(model)
        share, slow = weight / v, self._slow
        towards, gram = cross @ share, own @ share
        some = slow.beside_means(model, v, slow.measured, first)
        if some is not None:    # what the slow coefficients give these sums, as beside the mean
            each = slow.of_each(share)
            left, rest, before, first = (
                x[..., :len(each)] for x in (*some, slow.measured, first))
            towards = towards + rest @ (each * left) - first @ (each * before)
            gram = gram + (each * rest) @ rest.T - (each * first) @ first.T
        covariance = inverse(gram)
        return covariance @ towards, covariance * model_crowd(model)

    def taken_out(self, model: Model, gains: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return power (b,) and slow coefficients (q,) less what couplings of gains (p,) add."""
        cross, own, first = self._of_model(model)
        power = np.maximum(self._slow.part.power, 1e-300)
        power = power - 2 * gains @ cross + gains @ (gains @ own)
        power = np.maximum(power, 1e-300)
        slow = self._slow.measured - gains @ first
        return self._slow.less_known(power, slow), slow

    def missed(self, model: Model) -> np.ndarray:
        """Return the power (b,) of a shared source that the channels of a model miss."""
        out = np.zeros(len(self._slow.bins.f))
        for e in model.of(Coupling):
            for channel, name in zip(self._of(e), e.linear):
                if channel in self.spreads:
                    out = out + e.values.get(name, 0.0) ** 2 * self.spreads[channel]
        return out

    def left_to(self, model: Model, v: np.ndarray,
                names: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
        """
        Return what channels (p) still share with what the model leaves of the axis.

        Cross-powers (p, b), and the channels' own (p, p, b), given a spectrum v (b,); both as
        beside the mean, which the channels may have too.

        """
        def shared(others):
            """Return cross-powers, and slow coefficients."""
            return (np.array([[pair(a, n, here) for n in names] for a in others]),
                    self._slow.of_channels(others))

        pair, here = self.evidence.coupled, self.part_name
        gains = {known: model[c.label][k] for c in self.couplings
                 for known, k in zip(self._of(model[c.label]), c.linear)}
        beta, slow = np.array(list(gains.values())), self._slow.measured
        cross = np.array([pair(self.evidence.axis, n, here) for n in names])
        own, first = shared(names)
        if len(beta):
            known, its = shared(list(gains))
            cross, slow = cross - np.tensordot(beta, known, 1), slow - beta @ its
        return self._beside_means(model, v, cross, own, first, slow)

    def _beside_means(self, model, v, cross, own, first, slow):
        """
        Return cross-powers (p, b) and own powers (p, p, b) of channels as beside the mean.

        ``first`` (p, q) are the channels' slow coefficients, ``slow`` (q,) those of the axis.

        A step of all axes would else decide the gain.

        """
        some = self._slow.beside_means(model, v, slow, first)
        if some is None:
            return cross, own
        left, rest = some
        return (self._slow.changed(cross, left * rest - slow * first),
                own if rest is first else
                self._slow.changed(own, rest[:, None] * rest - first[:, None] * first))
