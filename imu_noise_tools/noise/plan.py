# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How precisely a record of some length and rate can show a model's parameters.

The Cramer-Rao bound, and its inverse.

"""

from __future__ import annotations

from functools import partial

import numpy as np

from .kinds import model_psd, Spectrum
from ..core.spectrum import bins_of, expected
from ..loop.effect import Model

LONGEST = 1000 * 3600.0  # s; what takes longer than a thousand hours is not worth planning


def precision(model: Model, duration: float, dt: float) -> dict[tuple[str, str], float]:
    """
    Return the Cramer-Rao bound of each searched parameter, relative to its value.

    The parameters are those of the spectral effects.

    Parameters
    ----------
    model : Model
        With values; an amplitude of zero is left out.
    duration, dt : float
        Length of the record and sample interval, s.

    Returns
    -------
    dict of (label, parameter) to float

    """
    bins = bins_of(max(int(duration / dt), 16), dt)
    slots = [
        (e.label, p.name)
        for e in model.of(Spectrum)
        for p in e.parameters
        if p.log and e.values.get(p.name, 0) > 0 and all(v > 0 for v in e.values.values())
    ]
    base = expected(lambda f: model_psd(model, f, dt), bins)
    h = 1e-3
    columns = []
    for label, name in slots:
        moved = (
            model.with_effect(model[label].with_values(**{name: model[label][name] * k}))
            for k in (np.exp(h), np.exp(-h))
        )
        up, down = (expected(partial(model_psd, m, dt=dt), bins) for m in moved)
        columns.append((up - down) / (2 * h) / base)
    if not columns:
        return {}
    jac = np.array(columns).T
    information = 0.5 * (jac * bins.count[:, None]).T @ jac
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    bound = (
        np.sqrt(
            np.maximum(
                np.diag(np.linalg.pinv(information / np.outer(scale, scale), rcond=1e-12)), 0
            )
        )
        / scale
    )
    return dict(zip(slots, (float(b) for b in bound)))


def duration_for(
    model: Model, label: str, name: str, dt: float, wanted: float = 0.2, begin: float = 60.0
) -> float | None:
    """
    Return the record length (s) from which a parameter is known to a relative precision.

    None beyond 1000 h.

    """
    low, high = begin, begin

    def at(t):
        return precision(model, t, max(dt, t / 2e6)).get((label, name), np.inf)

    while at(high) > wanted:
        low, high = high, 2 * high
        if high > LONGEST:
            return None
    while high / low > 1.05:
        middle = np.sqrt(low * high)
        low, high = (low, middle) if at(middle) <= wanted else (middle, high)
    return float(high)


def in_words(seconds: float) -> str:
    """Return a duration as a person would plan it."""
    return f'{seconds / 60:.0f} min' if seconds < 5400 else f'{float(f"{seconds / 3600:.2g}"):g} h'
