# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The sensor's own low-pass filter."""

from functools import lru_cache
from itertools import product

import numpy as np

from ..alike import alike
from ..behind import beside_unfiltered, seen_behind
from ..evidence import Evidence
from ..kinds import FILTERS, Parameter, Response, Spectrum
from ...core.spectrum import Bins
from ...loop.effect import Effect, Fit

#: a Butterworth filter inside the sensor, run at so many times the output rate and decimated
DECIMATED = {f'butterworth_2_decimated_{k}': k for k in (2, 4, 8)}
POLE, POLE_AVERAGED = 'first_order', 'first_order_averaged'
PAIR_AVERAGED = 'butterworth_2_averaged'
AVERAGED = (POLE_AVERAGED, PAIR_AVERAGED)
FORMS = (
    POLE, 'butterworth_2', 'butterworth_2_analogue', 'moving_average', 'two_averages',
    'butterworth_2_sampled', *DECIMATED, *AVERAGED
)
FOLDED = ('butterworth_2_sampled', *DECIMATED, PAIR_AVERAGED)
# shares to start from: for one that is missed a form with a floor of its own makes up
BEHIND = (0.0, *np.geomspace(1e-4, 1.6e-2, 12))
SHARES = (0.3, 0.7)  # of an average, too
BESIDE = np.array([-0.2, -0.1, 0.0, 0.1, 0.2])    # of which
LEAST = 1e-4  # of which: beside a pole less of it is lost in rounding
SHORTEST = 0.1  # share of an average beside a pair
ROUNDED = 1e-15  # of the gain in the band, which is told no better
FINER, NEARER = np.geomspace(0.9, 1.1, 11), np.geomspace(0.8, 1.25, 5)
WINDOW = 0.443  # -3 dB frequency of an average times its length
ALL = 0.9  # share of the power from which there is nothing but white noise
CASCADE = 0.319  # of two averages of one length, one behind the other


class LowPass(Response):
    """Power falls towards Nyquist: the sensor's bandwidth is below half the sample rate."""

    name = 'low_pass'
    symbol = 'cutoff'
    title = "the sensor's own low-pass"
    equation = (
        'gain^2: first order (1-p)^2/(1-2p cos w+p^2), p = e^(-2 pi cutoff dt); Butterworth '
        '1/(1+(tan(w/2)/tan(wc/2))^4) or 1/(1+(f/cutoff)^4), as it is or folded by sampling; '
        'moving average (sin(w r/2)/(r sin(w/2)))^2, r = 0.443/(cutoff dt); or one pole, or a '
        'Butterworth pair, before an average over the share averaged of that r, '
        'sinc^2(f r dt)/(1 + (f/pole)^2), or ^4, folded'
    )
    signature = (
        'PSD falls near Nyquist; the Allan deviation lies below N/sqrt(tau) at the first tau; no '
        'repeated samples'
    )
    hint = (
        'The digital low-pass of the sensor is set below half the output rate. Harmless: N holds '
        'below the cutoff. Ask for a lower output rate, or a wider filter, if neighbouring '
        'samples must be independent.'
    )
    reference = 'IEEE 1554, bandwidth'
    decide = 'set the widest filter of the sensor and record again'
    parameters = (
        Parameter('cutoff', 'Hz', 1e-3, 1e5, title='-3 dB frequency'),
        Parameter.choice('form', FORMS, title='shape of the fall'),
        # more of it is a Gauss-Markov process beside white noise
        Parameter('behind', '1', 0.0, 0.02, log=False, knee=1e-4,
                  title='share of the white noise that arises behind it'),
        Parameter('averaged', '1', 0.0, 1.0, log=False,
                  title='share of an average beside poles: 1 is an average alone'),
        FILTERS,
    )
    broad = True
    neutral = {'behind': 0.0, 'averaged': 0.0, 'filters': 0.0}
    optional = ('behind', 'averaged', 'filters')

    def starts(self, evidence: Evidence) -> list[Effect]:
        """
        Return the two best cutoffs of each form, the best form first.

        The best are those behind which the measured spectrum is flattest, coefficient by
        coefficient: far off the minimum a fit of the power itself goes astray, since a gain near
        zero makes the smallest mismatch enormous. Beside effects with many starts of their own
        only the first of them are tried.

        """
        falls = np.geomspace(0.02, 1.6, 40) * 0.5 / evidence.dt
        lengths = np.concatenate([np.arange(1.05, 4, 0.05), np.arange(4, 65)]) * evidence.dt
        tried = dict.fromkeys(FORMS, falls)
        tried[PAIR_AVERAGED] = falls[falls * evidence.dt < 0.5]
        tried['moving_average'] = WINDOW / lengths
        tried['two_averages'] = CASCADE / lengths  # shorter ones look like one average
        out: list[tuple[float, Effect]] = []
        for form in FORMS:
            behind = (0.0,) if form in AVERAGED else BEHIND
            averaged = SHARES if form in AVERAGED else (0.0,)
            best, second = self._smoothest(evidence, form, tried[form], averaged, behind)
            if form not in _LENGTH:     # forms differ by less than one step of either does
                e = best[1]
                shares = np.clip(e['averaged'] + BESIDE, SHORTEST, 1.0) \
                    if form in AVERAGED else averaged
                best = self._smoothest(evidence, form, e['cutoff'] * FINER, shares,
                                       e['behind'] * NEARER)[0]
            out += [best, second]
        return [e for _, e in sorted(out, key=lambda z: z[0])]

    def _smoothest(self, evidence, form, cutoffs, averaged, behind):
        """Return (roughness, start) of the two best cutoffs and averages, the best behind each."""
        tried = tuple((float(c), float(a)) for c, a in product(cutoffs, averaged))
        bins = evidence.whole.bins
        falls, squares = _falls(bins, form, tried, tuple(behind))
        log_power = np.log(np.maximum(evidence.whole.power, 1e-300))
        weight = bins.count / np.sum(bins.count)
        log_power = log_power - log_power @ weight
        # the variance of a difference, of which only the product of both goes with the power
        rough = squares - 2 * falls @ (weight * log_power) + log_power**2 @ weight
        best = np.argmin(rough, axis=1)
        least = rough[np.arange(len(tried)), best]
        return [(float(least[i]), self.with_values(
            cutoff=tried[i][0], form=form, averaged=tried[i][1], behind=float(behind[best[i]]),
            filters=0.0)) for i in np.argsort(least, kind='stable')[:2]]

    def bounds(self, evidence: Evidence) -> dict[str, tuple[float, float]]:
        """
        Up to a little beyond Nyquist, where the beginning of a fall still shows.

        Not of what is folded by sampling: a wider filter than that adds more at Nyquist than it
        takes, and the power rises as that of an angle's rounding does. What is no part of a form
        stays null.

        """
        out = {'cutoff': (1 / evidence.duration, 1 / evidence.dt)}
        if 'form' in self.values:
            form = self.chosen('form')
            if form in FOLDED:
                out['cutoff'] = (1 / evidence.duration, 0.5 / evidence.dt)
            out['behind' if form in AVERAGED else 'averaged'] = (0.0, 0.0)
            if form == PAIR_AVERAGED:   # with less it is the form that is sampled
                out['averaged'] = (SHORTEST, 1.0)
        return out

    @property
    def knees(self) -> int:
        """One, where, for a single pole."""
        return int('form' in self.values and self.chosen('form') in (POLE, POLE_AVERAGED))

    def gain2(self, f: np.ndarray, dt: float) -> np.ndarray:
        """Return the squared gain."""
        form = self.chosen('form')
        behind = self.values.get('behind', 0.0) if form not in AVERAGED else 0.0
        return beside_unfiltered(self._shape(form, f, dt), behind)

    def bonus(self, evidence: Evidence, fit: Fit) -> float:
        """
        Return what the other axes say for one pole, beside a Gauss-Markov process.

        A filter is that of the sensor: behind it all axes are alike, where such a process is as
        strong in each of them as it may be. What holds samples holds those of every axis.

        """
        if not self.knees:
            return 0.0
        bins, dt, behind = evidence.whole.bins, evidence.dt, self['behind']
        white = sum(fit.details.each[e.label] for e in fit.model.of(Spectrum) if e.never_absent)
        passed = seen_behind((self.with_values(behind=0.0),), fit.model, bins.f, dt)
        passed = np.where(white > ALL * fit.details.v, passed, 0.0)
        every = seen_behind((), fit.model, bins.f, dt)
        std = fit.estimates[self.label]['behind'].std or behind
        return sum(alike(bins, power, passed, every, behind, std)
                   for power in evidence.other_axes().values())

    def _shape(self, form, f, dt):
        """Return that of a form, with nothing behind it."""
        f, c = np.asarray(f, float), self['cutoff']
        if form in AVERAGED:
            share, poles = max(self['averaged'], LEAST), 1 + (form == PAIR_AVERAGED)
            return _poles_and_average(f * dt, c * dt, share, poles)
        if form == POLE:
            p = np.exp(-2 * np.pi * c * dt)
            return (1 - p) ** 2 / ((1 - p) ** 2 + p * (2 * np.sin(np.pi * f * dt)) ** 2)
        if form == 'butterworth_2':
            top = np.tan(np.pi * min(c * dt, 0.499))
            return 1 / (1 + (np.tan(np.pi * np.minimum(f * dt, 0.49999)) / top) ** 4)
        if form == 'butterworth_2_analogue':
            return 1 / (1 + (f / c) ** 4)
        if form == 'butterworth_2_sampled':
            return _sampled(f * dt, c * dt)
        if form in DECIMATED:
            return _decimated(f * dt, c * dt, DECIMATED[form])
        shape = _average if form == 'moving_average' else _two_averages
        return shape(f * dt, max(_LENGTH[form] / (c * dt), 1.0))

    @classmethod
    def example(cls) -> Effect:
        """Return a first-order filter of 12 Hz, a quarter of Nyquist at 100 Hz."""
        return cls({'cutoff': 12.0, 'form': POLE, **cls.neutral})


@lru_cache(maxsize=32)
def _falls(bins: Bins, form: str, tried: tuple[tuple[float, float], ...],
           behind: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """
    Return ln gain^2 less its mean (s, r, b), and its variance (s, r), over the coefficients.

    Of each (cutoff, averaged) that is tried, with each share of noise behind it. Every fit looks
    at the same ones, whatever power it has.

    """
    shares, weight = np.array(behind)[:, None], bins.count / np.sum(bins.count)
    falls = np.empty((len(tried), len(behind), len(bins.f)))
    for out, (cutoff, averaged) in zip(falls, tried):
        alone = LowPass({**LowPass.neutral, 'cutoff': cutoff, 'form': form, 'averaged': averaged})
        out[:] = np.log(beside_unfiltered(alone.gain2(bins.f, bins.dt), shares))
        out -= (out @ weight)[:, None]
    return falls, falls**2 @ weight


_LENGTH = {'moving_average': WINDOW, 'two_averages': CASCADE}


def _sampled(x: np.ndarray, c: float) -> np.ndarray:
    """
    Return the squared gain at x = f dt of an analogue Butterworth filter behind which is sampled.

    Its autocovariance is e^(-a t) (cos a t + sin a t), a = sqrt(2) pi c/dt: geometric sums.

    """
    p = np.exp((-1 + 1j) * np.sqrt(2) * np.pi * c)

    def folded(z):
        return 1 + ((1 - 1j) * (p * z / (1 - p * z) + p / z / (1 - p / z))).real

    return folded(np.exp(2j * np.pi * x)) / folded(1.0)


def _decimated(x: np.ndarray, c: float, times: int) -> np.ndarray:
    """Return the squared gain at x = f dt of a digital one run at ``times`` the output rate."""
    top = np.tan(np.pi * min(c / times, 0.499))

    def folded(x):
        y = np.add.outer(np.arange(times), x) / times
        y = np.abs(y - np.floor(y + 0.5))
        square = (np.tan(np.pi * np.minimum(y, 0.49999)) / top) ** 2
        return np.sum(1 / (1 + square * square), axis=0)

    return folded(x) / folded(0.0)


def _average(x: np.ndarray, r: float) -> np.ndarray:
    """
    Return the squared gain at x = f dt of an average over r samples, any number from one on.

    White noise that is averaged over r dt and then sampled has the autocovariance 1 - k/r: the
    triangles of the whole numbers on either side, mixed.

    """
    m = np.floor(r)
    u = r - m
    return _triangle(x, r) / ((1 - u) * m**2 + u * (m + 1) ** 2)


def _triangle(x: np.ndarray, r: float) -> np.ndarray:
    """Return the sum over all k of max(r - |k|, 0) cos 2 pi k x."""
    m = np.floor(r)
    u = r - m

    def whole(m):
        return (np.sin(np.pi * x * m) / np.sin(np.pi * x)) ** 2

    return (1 - u) * whole(m) + u * whole(m + 1)


def _two_averages(x: np.ndarray, r: float) -> np.ndarray:
    """
    Return the squared gain at x = f dt of two averages over r samples, one behind the other.

    The autocovariance of what is sampled behind them is the cubic B-spline of half-length 2 r;
    where that is many samples, nothing is folded any more.

    """
    if r > 32:
        return _average(x, r) ** 2
    k = np.arange(1, int(2 * r) + 1)
    z = k / r
    spline = np.where(z < 1, 2 / 3 - z**2 + z**3 / 2, (2 - z) ** 3 / 6)
    waves = 2 * np.cos(2 * np.pi * np.multiply.outer(x, k))
    return (2 / 3 + waves @ spline) / (2 / 3 + 2 * np.sum(spline))


def _poles_and_average(x: np.ndarray, c: float, share: float, poles: int) -> np.ndarray:
    """
    Return the squared gain at x = f dt of one or two poles and an average over r samples.

    -3 dB at c = cutoff dt, of which an average over r/share samples alone would be the cause. The
    autocovariance of one pole, e^(-a |k|), smoothed by a triangle of half-length r is 2/a times
    that triangle, and (e^(-a |k + r|) + e^(-a |k - r|) - 2 e^(-a |k|))/a^2. That of a Butterworth
    pair is the real part of (1 - i) e^(-a |k|) with a complex a (:func:`_sampled`).

    """
    r = share * WINDOW / c
    pole = c / max(2 * np.sinc(c * r) ** 2 - 1, 1e-9**poles) ** (0.5 / poles)
    a, part = (2 * np.pi * pole, 1.0) if poles == 1 else (
        np.sqrt(2) * np.pi * pole * (1 - 1j), 1 - 1j)
    m, p = np.floor(r), np.exp(-a)
    u = r - m

    def beside(z):
        return (np.exp(-a * u) / (1 - p * z) + np.exp(-a * (1 - u)) / (z - p)) * z ** -m

    def folded(x, triangle):
        z = np.exp(2j * np.pi * x)
        own = (1 - p * p) / ((1 - p * z) * (1 - p / z))
        both = 2 / a * triangle + (beside(z) + beside(1 / z) - 2 * own) / a**2
        return (part * both).real

    gain2 = folded(x, _triangle(x, r)) / folded(0.0, (1 - u) * m**2 + u * (m + 1) ** 2)
    return np.maximum(gain2, ROUNDED)   # far above a pair it is a difference of equal numbers
