# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How precisely a record of some length and rate can show a model's parameters.

The Cramer-Rao bound, and its inverse.

"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from .behind import model_psd
from .kinds import Spectrum
from ..core.spectrum import bins_of, expected
from ..loop.effect import Estimate, Model

LONGEST = 1000 * 3600.0  # s; what takes longer than a thousand hours is not worth planning
# Of a power that is not resolved the likelihood is about a half-normal from zero on: nine of ten
# lie above 0.126 of its deviation where the 95 % limit is at 1.96, and so nine of ten amplitudes
# above this share of the limit. (Eight of ten records shall show what is promised: the scatter of
# the second record's own estimate needs the rest.)
FAINT = float(np.sqrt(0.1257 / 1.96))


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
    covariance = np.linalg.pinv(information / np.outer(scale, scale), rcond=1e-12)
    bound = np.sqrt(np.maximum(np.diag(covariance), 0)) / scale
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


def durations_for(model: Model, estimates: Mapping[str, Mapping[str, Estimate]], label: str,
                  name: str, dt: float, wanted: float = 0.2,
                  begin: float = 60.0) -> tuple[float | None, float | None]:
    """
    Return how long a record (s) shows a parameter to a relative precision: at least, at most.

    From its interval, not from its value. At the upper end of the interval it takes the least. At
    the lower end it takes the most; of what is not resolved that is where nine of ten lie above,
    with all else that is not resolved at its limit. None beyond 1000 h.

    Parameters
    ----------
    model : Model
        With values.
    estimates : mapping of str to mapping of str to Estimate
        By label and name.
    label, name : str
        Of the parameter.
    dt, wanted, begin
        As of :func:`duration_for`.

    """
    low, high = _between(estimates[label][name])
    if not high > 0:
        return None, None

    def at(value: float, loud: bool) -> float | None:
        planned = model.with_effect(model[label].with_values(**{name: value}))
        for other, found in estimates.items():
            for key, e in found.items():
                if (other, key) != (label, name) and e.value is None and e.upper95:
                    least = e.upper95 if loud else FAINT * e.upper95
                    planned = planned.with_effect(planned[other].with_values(**{key: least}))
        return duration_for(planned, label, name, dt, wanted, begin)

    return at(high, False), at(low, True)


def _between(e: Estimate) -> tuple[float, float]:
    """Return between which values a parameter is likely to lie."""
    if e.value is None:
        return FAINT * (e.upper95 or 0.0), e.upper95 or 0.0
    return e.ci95 if e.ci95 else (e.value, e.value)


def range_in_words(least: float | None, most: float | None, had: float = 0.0) -> str:
    """Return a range of durations as a person would plan with it, who ``had`` as many seconds."""
    if least is None:
        return 'more than 1000 h'
    if least <= had:
        return 'far longer' if most is None else f'longer, up to {in_words(most)}'
    if most is None:
        return f'{in_words(least)} or far more'
    if in_words(least) == in_words(most):
        return in_words(most)
    return f'{in_words(least)} to {in_words(most)}'


def in_words(seconds: float) -> str:
    """Return a duration as a person would plan it."""
    if seconds < 59.5:
        return f'{max(seconds, 1):.0f} s'
    return f'{seconds / 60:.0f} min' if seconds < 5400 else f'{float(f"{seconds / 3600:.2g}"):g} h'
