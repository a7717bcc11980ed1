# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is no coupling of a sensor, though axes are coherent: a machine that all of them hear."""

from __future__ import annotations

from typing import cast

import numpy as np

from .evidence import Evidence
from .kinds import Coupling, heard_by_all
from .likelihood import explained_by, Likelihood
from ..core.spectrum import band_of, Bins, OCTAVE
from ..loop.effect import Fit

ACCEL = ('accel_x', 'accel_y', 'accel_z')
MOST = 0.9      # of what a coupling explains (a choice): no coupling if it lies within ...
SHARP = 30.0    # ... a width of f over this: a driven resonance with Q = 190
# of the largest share that a turn would move gravity by: shares that are off by less are those
# of a turn (a choice)
LIKE = 0.25


def why_no_coupling(evidence: Evidence, fit: Fit, label: str) -> str:
    """Say why what a coupling of a model explains is no coupling of the sensor, or nothing."""
    effect = cast(Coupling, fit.model[label])
    return at_one_frequency(evidence, fit, label) or effect.motion(evidence, fit)


def at_one_frequency(evidence: Evidence, fit: Fit, label: str) -> str:
    """
    Say that what a coupling of a model explains lies at one frequency, or nothing.

    A coupling is told by gains that are the same at all frequencies. At one any signal is a share
    of any two others that have different phases, and a machine that shakes the mount is heard by
    all axes: the peak is there in any case, the coupling is not shown.

    """
    bins, nats = _heard(evidence, fit, label)
    if not nats.sum() > 0:
        return ''
    for e, heard in heard_by_all(fit.model, bins.f):
        if nats[heard].sum() > MOST * nats.sum():
            return f'what it explains is {e.label}, which all axes hear'
    wide = bins.count / (2 * evidence.duration)
    order = np.argsort(-nats / wide)
    some = order[:1 + np.searchsorted(np.cumsum(nats[order]), MOST * nats.sum())]
    width, f = float(wide[some].sum()), float(np.average(bins.f[some], weights=nats[some]))
    if width > f / SHARP:
        return ''
    return (f'{100 * MOST:.0f} % of what it explains lies within {width:.2g} Hz at {f:.4g} Hz: '
            'at one frequency a coupling cannot be told from a machine that all axes hear')


def _heard(evidence: Evidence, fit: Fit, label: str) -> tuple[Bins, np.ndarray]:
    """Return the bins, and the nats (b,) that a coupling of a model explains in each."""
    bins, weight, power = explained_by(evidence, fit, label)
    return bins, np.maximum(weight * power, 0.0)


def heard_at(evidence: Evidence, fit: Fit, label: str) -> str:
    """
    Say at which frequencies a coupling of a model explains something, empty where nowhere.

    What is heard in a narrow band comes from a machine or from a resonance of the mount.

    """
    bins, nats = _heard(evidence, fit, label)
    if not nats.sum() > 0:
        return ''
    low, high = band_of(nats, bins.f)
    if high > OCTAVE * low:
        return f'most of it between {low:.3g} and {high:.3g} Hz'
    middle = bins.f[np.searchsorted(np.cumsum(nats), 0.5 * nats.sum())]
    return (f'around {middle:.4g} Hz, most of it between {low:.4g} and {high:.4g} Hz: as a '
            'machine or a resonance of the mount is heard')


def by_gravity(evidence: Evidence, fit: Fit, label: str, shares: np.ndarray) -> str:
    """
    Say that shares of the accelerometer are those by which a turn moves gravity, or nothing.

    While the mount turns by omega the specific force f moves by -omega x f, so that across f
    omega = f' x f/|f|^2 (Titterton and Weston, Strapdown Inertial Navigation Technology, section
    3.6): the gyroscope tells a rotation that is there. At a frequency f' is 2 pi times that, a
    quarter of a period earlier.

    ``shares`` (2, 3) are those of the accelerometer axes, at once and a quarter of a period later.

    """
    force = np.array([np.mean(evidence.slow_others[a]) for a in ACCEL])
    if not np.any(force):
        return ''
    view = Likelihood(evidence, 'whole', fit.model, fit)
    heard = cast(Coupling, fit.model[label]).channels(evidence)[:3]
    # a share that is fitted is the mean over what is heard
    power = np.array([evidence.common.pair(a, a, 'whole') for a in heard])
    power = power * view.weight / fit.details.v
    f = power @ view.bins.f / np.maximum(power.sum(axis=1), np.finfo(float).tiny)
    turned = np.cross(force, np.eye(3))[:, 'xyz'.index(evidence.axis[-1])]    # force x e_j
    wanted = np.array([np.zeros(3), 2 * np.pi * f * turned / (force @ force)])
    if np.abs(shares - wanted).max() > LIKE * np.abs(wanted).max():
        return ''
    at = f[np.argmax(np.abs(turned))]
    return (f'these are the shares by which turning moves gravity at {at:.2g} Hz: the mount '
            'turns, and the gyroscope tells it')
