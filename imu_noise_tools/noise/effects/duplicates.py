# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Held samples: the same value is sent again."""

from collections.abc import Sequence

import numpy as np
from scipy.special import xlogy

from ..evidence import Evidence
from ..held import clock
from ..kinds import Defect, gain2_of, Inputs, Parameter, Response
from ..repeated import ANGLES, begins, coherent, LONGEST, same_again, scattered
from ...core.spectrum import Bins, folded
from ...core.statistics import interval, Repeats, repeats
from ...loop.effect import Effect, Estimate, Finding, Fit, View

STRETCHES = 8  # of the record, in which repeats are counted
PIECES = (1024, 256)  # samples in which a beat is looked for
IMAGES, FAINTEST = 16, 1e-3  # of a line, on either side; shares of its power
WITHIN = (np.arange(1024) + 0.5) / 1024     # cubed, of Nyquist: a filter may end far below it


class Duplicates(Defect, Response):
    """
    A share of the samples repeats the one before.

    The sensor is read faster than it measures, or a message is sent twice.

    """

    name = 'duplicates'
    symbol = 'fraction'
    title = 'repeated samples'
    equation = (
        'gain^2, scaled to 1 at f = 0, of the autocovariance r_k, the chance that k samples more '
        'repeat one: p^k held at random, each for one sample; the triangle of 1/(1-p) samples '
        'where always held as long; held at random behind a filter of gain^2 g, white noise has '
        '(g + w)/(1 + w) for g, w = (1+p)/(1-p) mean (1 - gain^2) g up to Nyquist'
    )
    signature = (
        'neighbours are exactly equal more often than noise and resolution allow; power falls '
        'towards Nyquist'
    )
    hint = (
        'The bus or the driver is read faster than the sensor updates: lower the publishing rate '
        "to the sensor's, or read on its data-ready interrupt. N as fitted here holds at low "
        'frequencies.'
    )
    reference = 'sample and hold: Oppenheim and Schafer, Discrete-Time Signal Processing'
    views = ('frequency', 'time', 'distribution', 'variance', 'repeats')
    mutes = ('distribution', 'variance')  # whitened, held samples are neither normal nor steady
    last = True
    certain = True      # exactly equal beyond what the resolution makes: no spectrum does that
    decide = 'read the sensor at its own rate'
    parameters = (
        Parameter('fraction', '1', 1e-6, 0.99, amplitude=True, title='share of repeated samples'),
        Parameter.choice('pattern', ('random', 'regular'),
                         title='now and then, or always as long', formerly='regular'),
        Parameter('run', '1', 1, LONGEST, discrete=True,
                  title='samples that are held each time, where now and then'),
    )
    neutral = {'run': 1.0}

    @classmethod
    def statistics(cls, y: np.ndarray, inputs: Inputs) -> dict[str, np.ndarray]:
        """
        Keep the share of equal neighbours and what chance gives.

        Kept too are the shares of stretches of the record, how they clump, whether a sample is
        held always as long, and how long where not.

        """
        fraction, expected, held = repeats(y)
        out = {
            'fraction': np.array(fraction),
            'expected': np.array(expected),
            'regular': np.array(0.0),
            'held': np.array(held),
            'n': np.array(len(y)),
        }
        if not held:
            return out
        same = np.diff(y) == 0
        edges = np.flatnonzero(np.concatenate([[True], ~same, [True]]))
        runs = np.diff(edges)[1:-1]
        more = runs[runs > 1] - 1
        out['stretches'] = np.array([np.mean(x) for x in np.array_split(same, STRETCHES)])
        out['clumps'] = np.array(np.mean(more**2) / np.mean(more) if len(more) else 1.0)
        if len(runs) > 10:
            # always as long: one length, or two that are neighbours where its mean lies between
            counts = np.bincount(runs)
            shorter = int(np.argmax(counts[:-1] + counts[1:]))
            longer = np.mean(runs > shorter + 1)
            by_chance = fraction**(shorter + 1)
            # two of them become one where rounding makes them equal
            merged = expected if shorter > 1 else 0.0
            alike = (longer < 0.1 * by_chance + merged and by_chance * len(runs) > 10
                     and np.mean(runs < shorter) < 0.02)
            share = Repeats(fraction, expected, held).share
            out['regular'] = np.array(float(alike or _beats(same, share)))
            found = clock(same, share) if out['regular'] and 0 < share < 1 else None
            out['clock'] = np.array(found or ())
            # rounding makes some equal as well, mostly one at a time
            often = np.bincount(more, minlength=2).astype(float)
            often -= len(runs) * (1 - expected) * float(expected) ** np.arange(len(often))
            out['run'] = np.array(float(min(int(np.argmax(often[1:])) + 1, LONGEST)))
        return out

    @classmethod
    def held_out(cls, evidence: Evidence, part: str, fit: Fit) -> View | None:
        """Return the equal neighbours of stretches beside what the others say, or chance alone."""
        kept = evidence.kept(cls.name)
        if 'stretches' not in kept or not kept['held']:
            return None
        seen, n = kept['stretches'], int(kept['n']) // STRETCHES
        half = {'first': seen[:STRETCHES // 2], 'second': seen[STRETCHES // 2:]}
        here = half.get(part, seen)
        others = {'first': half['second'], 'second': half['first']}.get(part, seen)
        known = bool(fit.model.of(cls))
        q = float(np.mean(others)) if known else float(kept['expected'])
        q = min(max(q, 0.5 / n), 1 - 0.5 / n)
        clumps = float(kept['clumps']) if known else 1.0
        # the root of the deviance is normal where few are equal, too; what the others say scatters
        deviance = 2 * n * (xlogy(here, here / q) + xlogy(1 - here, (1 - here) / (1 - q)))
        pull = np.sign(here - q) * np.sqrt(
            np.maximum(deviance, 0) / clumps / (1 + known * len(here) / STRETCHES))
        t = (np.arange(STRETCHES) + 0.5) * evidence.duration / STRETCHES
        return View('repeats', t[-len(here):] if part == 'second' else t[:len(here)], pull,
                    float(np.mean(pull**2) - 1), float(np.sqrt(2 / len(here))), 's')

    def find(self, evidence: Evidence) -> Finding | None:
        """Test for more equal neighbours than a Poisson count of the expected ones allows."""
        kept = evidence.kept(self.name)
        if not kept or not kept['held']:
            return None
        n, seen, chance = int(kept['n']), float(kept['fraction']), float(kept['expected'])
        share = Repeats(seen, chance, True).share
        # likelihood ratio of the binomial count of equal neighbours
        q = min(max(chance, 0.5 / n), 0.999)
        gain = n * (seen * np.log(seen / q) + (1 - seen) * np.log(max(1 - seen, 1e-12) / (1 - q)))
        std = float(np.sqrt(seen * (1 - seen) / n))
        effect = self.with_values(fraction=share, pattern=float(kept['regular']),
                                  run=float(kept.get('run', 1.0)))
        return Finding(
            self.name,
            float(gain),
            effect,
            {
                'fraction': Estimate(share, std, interval(share, std, positive=True)),
                'pattern': Estimate(effect['pattern'], None, None),
                'run': Estimate(effect['run'], None, None),
            },
            evidence=f'{100 * seen:.3g} % of neighbours are exactly equal, {100 * chance:.2g} % '
            'would be by rounding',
        )

    def gain2(self, f: np.ndarray, dt: float) -> np.ndarray:
        """
        Return the squared gain, scaled to 1 at zero frequency.

        On white noise, where always held as long; at random what is passed without being
        :meth:`scattered`.

        """
        p, w = self['fraction'], 2 * np.pi * np.asarray(f, float) * dt
        if self.scatters and self._run == 1:
            return (1 - p) ** 2 / ((1 - p) ** 2 + p * (2 * np.sin(w / 2)) ** 2)
        if self.scatters:
            return coherent(p, self._run, f, dt)
        share = self._repeated()
        k = np.arange(1, len(share) + 1)
        gain = 1 + 2 * np.cos(np.multiply.outer(w, k)) @ share
        return np.maximum(gain / (1 + 2 * np.sum(share)), 1e-9)

    def scattered(self, before: Sequence[Response], f: np.ndarray, dt: float) -> np.ndarray:
        """
        Return the level at f (Hz) of what holding at random scatters of noise behind filters.

        Held for one sample each, with probability p, y is on average what A = (1-p)/(1 - p e^(-i
        w)) makes of x, and beside that as often repeated as anything: its spectrum is |A|^2 S +
        (int S - int |A|^2 S) r, r that of the autocorrelation p^|k|, |A|^2 (1+p)/(1-p) of the
        white one. So S + (1+p)/(1-p) mean (1-|A|^2) S, the mean up to Nyquist, passes |A|^2. In
        longer runs what is scattered stays nearer to where it was
        (:mod:`~imu_noise_tools.noise.repeated`).

        """
        p = self['fraction']
        if not self.scatters or self._run == 1 and not before:
            return np.zeros(np.shape(f))    # all of white noise keeps its form
        if self._run == 1:
            at = WITHIN ** 3 * 0.5 / dt
            lost = (1 - self.gain2(at, dt)) * gain2_of(before, at, dt)
            return np.full(np.shape(f), self._often * np.mean(3 * WITHIN ** 2 * lost))
        return scattered(p, self._run, gain2_of(before, ANGLES ** 3 * 0.5 / dt, dt), f, dt)

    def unscattered(self, gain2: np.ndarray, bins: Bins) -> np.ndarray:
        """Return the g that is seen so over what would be seen of 1."""
        if not self.scatters:
            return gain2
        if self._run == 1:
            lost = (1 - self.gain2(bins.f, bins.dt)) * bins.count / bins.n
            seen, every = float(lost @ gain2), float(np.sum(lost))
            level = seen / (1 / self._often + every - seen)
            return gain2 * (1 + level) - level if level > 0 else gain2
        f, at = np.append(0.0, bins.f), ANGLES ** 3 * 0.5 / bins.dt
        every = self.scattered((), f, bins.dt)
        seen = gain2 * (1 + every[1:]) / (1 + every[0])
        # g = seen (1 + what it scatters to zero) - what it scatters, linear in g
        one, own = np.eye(len(at)), np.interp(at, bins.f, seen)
        to = scattered(self['fraction'], self._run, one, np.append(0.0, at), bins.dt)
        g = np.linalg.solve(one + to[1:] - np.outer(own, to[0]), own)
        level = scattered(self['fraction'], self._run, np.maximum(g, 0.0), f, bins.dt)
        return seen * (1 + level[0]) - level[1:]

    @property
    def scatters(self) -> bool:
        """Whether samples are held at random."""
        return self.chosen('pattern') == 'random'

    @property
    def _often(self) -> float:
        """How much more of white noise is seen at low frequencies than there is."""
        return (1 + self['fraction']) / (1 - self['fraction'])

    def images(self, f: float, dt: float) -> list[tuple[float, float]]:
        """
        Return (Hz, share of the power) of what it makes of a line at f, where it is regular.

        The age of a sample goes with the phase of the two clocks: the line is modulated at the
        multiples of the sensor's own rate.

        """
        if self.chosen('pattern') != 'regular':
            return []
        rate, w = 1 - self['fraction'], 2 * np.pi * f * dt
        edges = np.append(np.arange(0, 1, rate), 1.0)
        k = np.arange(-IMAGES, IMAGES + 1)[:, None]
        turns = np.exp(-2j * np.pi * k * edges)
        each = np.where(k == 0, np.diff(edges), np.diff(turns, axis=1) / np.where(
            k == 0, 1, -2j * np.pi * k))
        share = np.abs(each @ np.exp(-1j * w * np.arange(len(edges) - 1))) ** 2
        at = folded(f + k[:, 0] * rate / dt, dt)
        return [(float(x), float(s)) for x, s in zip(at, share) if s > FAINTEST]

    @property
    def _run(self) -> int:
        return int(self.values.get('run', 1.0))

    def _repeated(self) -> np.ndarray:
        """Return the chance that k = 1, 2, ... samples more repeat one, where that is any."""
        p = self['fraction']
        if self.chosen('pattern') == 'regular':
            r = 1 / max(1 - p, 1e-6)
            m, k = int(r), np.arange(1, int(r) + 1)
            short, long = np.maximum(m - k, 0), m + 1 - k   # blocks of m and of m + 1 samples
            return ((m + 1 - r) * short + (r - m) * long) / r
        return same_again(p, self._run)

    def crowd(self) -> float:
        """
        Return the scatter of sums of products of two white axes held together, whitened.

        A run of L samples holds one product with the weight 1 + p^2 + (L-1)(1-p)^2, L geometric,
        and two of neighbouring runs with p; as many independent samples would have (1-p)(1+p)^2.

        """
        p = self['fraction']
        if self.chosen('pattern') == 'regular':
            return 1 / max(1 - p, 1e-6)
        return ((1 + p) ** 2 + p * (1 - p) ** 2 + 2 * p * p) / ((1 - p) * (1 + p) ** 2)

    def apply(self, x: np.ndarray, inputs: Inputs, rng: np.random.Generator) -> np.ndarray:
        """Hold samples, at random or always the same number of times."""
        n = len(x)
        if self.chosen('pattern') == 'regular':
            # what is read at each time was measured at the sensor's own rate
            rate = 1 - self['fraction']
            return x[(np.floor(np.floor(np.arange(n) * rate + 1e-9) / rate + 1e-9)).astype(int)]
        run = self._run
        begin = rng.random(n) < begins(self['fraction'], run)
        held = np.convolve(begin, np.ones(run))[:n] > 0
        held[0] = False
        return x[np.maximum.accumulate(np.where(held, 0, np.arange(n)))]

    @classmethod
    def example(cls) -> Effect:
        """Every fifth sample is a repeat."""
        return cls({'fraction': 0.2, 'pattern': 'random', 'run': 1.0})


def _beats(same: np.ndarray, p: float) -> bool:
    """
    Tell whether a share p is held in the beat of two rates, whatever rounding makes equal beside.

    A sensor that is read 1/(1-p) times as often as it measures is held at the frequency p of the
    reading: the indicator has 2 (sin(pi p)/pi)^2 of its variance p (1 - p) there (the first
    harmonic of a pulse train), held at random or in runs what is around there as well.

    """
    length = next((n for n in PIECES if len(same) >= 8 * n), 0)
    if not length:
        return False
    rows = same[:len(same) // length * length].reshape(-1, length)
    rows = rows - rows.mean(axis=1, keepdims=True)
    window = np.hanning(length + 1)[:length]
    power = np.mean(np.abs(np.fft.rfft(rows * window, axis=1)) ** 2, axis=0)
    # what rounding makes equal is known to a hundredth or so
    at, reach = int(abs(p - round(p)) * length), length // 50
    if at <= reach:     # slower than what comes in bursts
        return False
    k = at - reach + int(np.argmax(power[at - reach:at + reach + 1]))
    near = power[max(1, k - 2):k + 3]
    around = np.median(power[max(1, k - length // 32):k + length // 32])
    beat = 2 * (np.sin(np.pi * p) / np.pi) ** 2 / (p * (1 - p))
    return bool(np.sum(near - 2 * around) > 0.5 * beat * np.sum(power[1:]))
