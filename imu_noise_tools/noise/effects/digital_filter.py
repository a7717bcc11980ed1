# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A low-pass of the sensor that has none of the usual forms: a decimator, a steep filter."""

import numpy as np
from scipy.special import polygamma

from ..evidence import Evidence
from ..kinds import Parameter, Response
from ...core.spectrum import Bins
from ...loop.effect import Effect

ORDER = 8  # cosines of ln gain^2: of a filter that is steep and deep some percent are left
BENDS = tuple(f'bend_{k}' for k in range(2, ORDER + 1))
FALLS, RISES = 0.5, 2.0  # gain^2 at half the rate at most, and anywhere
SAME = 0.02  # of the variance of the fall that may be otherwise in another axis behind it
APART = 0.1  # of the power of two axes in common, from which they hear one source
DEEPEST = 60.0  # of ln gain^2, which a number can hold
FAR = 1.0  # of ln power: a bin farther off counts no more, a line is there
STEPS, ENOUGH, LONGEST = 50, 1e-9, 3.0  # Newton steps, and of one how much of ln power
LEAST = 1e-12  # of the curvature: some of it is left where a band holds no power at all


class DigitalFilter(Response):
    """Power falls towards Nyquist as it does in the other axes, and as no usual filter does."""

    name = 'digital_filter'
    symbol = 'cutoff, bend'
    title = "the sensor's own low-pass, of no usual form"
    equation = (
        'ln gain^2 = sum_k b_k (cos(2 pi k f dt) - 1), k = 1 to 8, b_1 such that gain^2(cutoff) = '
        '1/2, b_k = bend_k'
    )
    signature = (
        'PSD falls near Nyquist by the same factors in all axes of the sensor, and their noise '
        'has nothing in common'
    )
    hint = (
        'A decimation filter, or a filter of a higher order, in the sensor or its driver. '
        'Harmless: N holds below the cutoff. Ask for a lower output rate, or a wider filter, if '
        'neighbouring samples must be independent.'
    )
    reference = 'Oppenheim and Schafer, Discrete-Time Signal Processing, chapters 7 and 13'
    decide = 'set the widest filter of the sensor and record again'
    needs = 'another axis of the sensor that falls alike: record all axes'
    parameters = (
        Parameter('cutoff', 'Hz', 1e-3, 1e5, title='-3 dB frequency'),
        *(Parameter(name, '1', -20.0, 20.0, log=False, title=f'cosine of order {name[5:]}')
          for name in BENDS),
    )
    broad = free = True

    def starts(self, evidence: Evidence) -> list[Effect]:
        """Start at the cosines of the measured spectrum, where the other axes have them too."""
        if self.fitted:
            return [self]
        bins = evidence.whole.bins
        b = _cosines(bins, evidence.whole.power)
        f = np.linspace(0.01, 0.5, 491) / bins.dt
        gain2 = np.exp(_orders(f, bins.dt) @ b)
        if gain2[-1] > FALLS or np.max(gain2) > RISES \
                or not self._shared(evidence, _orders(bins.f, bins.dt) @ b):
            return []
        return [self.with_values(cutoff=float(f[np.argmax(gain2 < 0.5)]),
                                 **dict(zip(BENDS, map(float, b[1:]))))]

    @staticmethod
    def _shared(evidence: Evidence, fall: np.ndarray) -> bool:
        """Tell whether this axis and another of the sensor fall so, and hear no one source."""
        bins, own = evidence.whole.bins, evidence.whole.power
        weight = bins.count / np.sum(bins.count)
        size = weight @ (fall - weight @ fall) ** 2

        def falls(power):
            away = bins.log_level(power) - fall
            lost = weight @ np.minimum((away - np.median(away)) ** 2, FAR**2)
            return lost - weight @ polygamma(1, bins.count / 2) < SAME * size

        def alone(axis, power):
            both = evidence.common.pair(evidence.axis, axis, 'whole')
            return weight @ (both**2 / (own * power)) < APART

        return falls(own) and any(falls(power) and alone(axis, power)
                                  for axis, power in evidence.other_axes().items())

    def bounds(self, evidence: Evidence) -> dict[str, tuple[float, float]]:
        """Below Nyquist, where a cosine tells it."""
        return {'cutoff': (0.01 / evidence.dt, 0.5 / evidence.dt)}

    def gain2(self, f: np.ndarray, dt: float) -> np.ndarray:
        """Return the squared gain."""
        bends = np.array([self[name] for name in BENDS])
        down, at = (_orders(x, dt) for x in (np.asarray(f, float), np.array(self['cutoff'])))
        first = (np.log(0.5) - at[1:] @ bends) / at[0]
        return np.exp(np.clip(down[..., 0] * first + down[..., 1:] @ bends, -DEEPEST, DEEPEST))

    @classmethod
    def example(cls) -> Effect:
        """Return a filter of 12 Hz, steeper than one pole."""
        return cls({'cutoff': 12.0, **dict.fromkeys(BENDS, 0.0), 'bend_2': -0.4})


def _orders(f: np.ndarray, dt: float) -> np.ndarray:
    """Return cos(2 pi k f dt) - 1 (..., ORDER), k from 1 on."""
    return np.cos(2 * np.pi * dt * np.multiply.outer(f, np.arange(1, ORDER + 1))) - 1


def _cosines(bins: Bins, power: np.ndarray) -> np.ndarray:
    """
    Return the cosines (ORDER,) of the logarithm of a spectrum (b,) with the greatest likelihood.

    A spectrum whose logarithm is linear in its parameters has a convex one (Bloomfield,
    Biometrika 60, 1973), so that Newton's steps find it.

    """
    basis = np.column_stack([np.ones(len(bins.f)), _orders(bins.f, bins.dt)])
    root = np.sqrt(bins.count)
    a = np.linalg.lstsq(basis * root[:, None], root * bins.log_level(power), rcond=None)[0]
    for _ in range(STEPS):
        over = bins.count * power * np.exp(-basis @ a)
        curved = (basis.T * over) @ basis + LEAST * np.sum(over) * np.eye(ORDER + 1)
        step = np.linalg.solve(curved, basis.T @ (over - bins.count))
        a = a + step / max(1.0, np.max(np.abs(basis @ step)) / LONGEST)
        if np.max(np.abs(basis @ step)) < ENOUGH:
            break
    return a[1:]
