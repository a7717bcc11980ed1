# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is seen of the effects of a model behind its responses: gains, spectra, Allan variance."""

from __future__ import annotations

from collections.abc import Sequence
from math import prod
from typing import Any

import numpy as np

from .kinds import is_peak, Line, Mean, Response, Spectrum
from ..core.spectrum import quadrature_avar
from ..loop.effect import Model

NOTHING = 1e-16     # squared gain: double precision has no less of what passes


def psd_behind(effect: Spectrum, model: Model, f: np.ndarray, dt: float) -> np.ndarray:
    """Return the one-sided PSD (n,) of an effect behind the model's responses on it, unit^2/Hz."""
    return effect.psd(f, dt) * gain2_of(responses_on(effect, model), f, dt, effect.flat)


def responses_on(effect: Spectrum, model: Model) -> list[Response]:
    """Return the model's responses that act on an effect."""
    return [r for r in model.of(Response) if r.acts_on(effect)]


def leaks_behind(model: Model) -> bool:
    """Tell whether a model has a response that may leave so little that other things show."""
    return any(r.leaks for r in model.of(Response))


def model_gain2(model: Model, f: np.ndarray, dt: float) -> np.ndarray:
    """Return the squared gain (n,) at f (n,), Hz, of all the model's responses on white noise."""
    return gain2_of(model.of(Response), f, dt, True)


def beside_unfiltered(gain2: np.ndarray | float, share: float | np.ndarray,
                      at_zero: float | None = None) -> np.ndarray:
    """
    Return a filter's squared gain where a share of the white noise arises behind it.

    (g + s)/(1 + s): the total at full gain stays, and it never falls to nothing. Of a share that
    is not the same at all frequencies, that ``at_zero`` is in the total.

    """
    total = 1 + (share if at_zero is None else at_zero)
    return np.maximum((gain2 + share) / total, NOTHING)


def gain2_of(responses: Sequence[Response], f: np.ndarray, dt: float,
             white: bool = False) -> np.ndarray:
    """Return the squared gain (n,) at f (n,), Hz, of responses one behind the other."""
    return np.ones(np.shape(f)) * together(
        responses, [r.gain2(f, dt) for r in responses], f, dt, white)


def together(responses: Sequence[Response], each: Sequence[np.ndarray], f: np.ndarray, dt: float,
             white: bool) -> np.ndarray | float:
    """
    Return the squared gain at f (Hz, (k,)) of responses, one behind the other, from ``each``'s.

    On white noise, what holds samples at random fills what the filters before it left empty. Of
    other noise it scatters as well: into what is white, and counts as that.

    """
    before = [r for r in responses if not r.last]
    out: Any = prod((g for r, g in zip(responses, each) if not r.last), start=1.0)
    for r, g in zip(responses, each):
        if r.last:
            if white and r.scatters:
                level = r.scattered(before, np.append(0.0, f), dt)
                out = beside_unfiltered(out, level[1:].reshape(np.shape(f)), level[0])
            out = g * out
    return out


def seen_behind(before: Sequence[Response], model: Model, f: np.ndarray,
                dt: float) -> np.ndarray:
    """
    Return the power at f (n,), Hz, of white noise of 1 behind some responses and a model's last.

    As :func:`together` has it, and not scaled to 1 at zero: powers of noise that passes other
    responses add to it.

    """
    out = gain2_of(before, f, dt)
    for r in (r for r in model.of(Response) if r.last):
        out = r.gain2(f, dt) * (out + r.scattered(before, f, dt))
    return out


def model_psd(model: Model, f: np.ndarray, dt: float) -> np.ndarray:
    """Return the one-sided PSD of the whole model, responses in it, at f (n,), Hz: unit^2/Hz."""
    return sum((psd_behind(e, model, f, dt) for e in model.of(Spectrum)), np.zeros(np.shape(f)))


def model_avar(model: Model, m: np.ndarray, dt: float) -> np.ndarray:
    """
    Return the Allan variance of the whole model at cluster sizes m (k,): (k,), unit^2.

    It is the sum of its effects', or a quadrature behind a response.

    """
    if model.of(Response):
        some = [e for e in model.of(Spectrum) if not is_peak(e)]
        rest = Model((*some, *model.of(Response)))
        total = quadrature_avar(lambda f: model_psd(rest, f, dt), m, dt)
        for e in filter(is_peak, model.effects):
            passed = float(gain2_of(responses_on(e, model), np.array(e.centre), dt))
            total = total + passed * e.avar(m, dt)
    else:
        total = sum((e.avar(m, dt) for e in model.of(Spectrum)), np.zeros(len(m)))
    return total + sum(
        (e.avar(m, dt) for e in model.effects if isinstance(e, (Mean, Line))), np.zeros(len(m))
    )
