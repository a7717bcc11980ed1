# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Held samples: the same value is sent again."""

from collections.abc import Sequence

import numpy as np
from scipy.special import xlogy

from ..behind import gain2_of
from ..evidence import Evidence
from ..kinds import Defect, Inputs, Parameter, Response
from ..repeated import ANGLES, begins, coherent, LONGEST, scattered
from ...core.record import sensor_of
from ...core.spectrum import Bins
from ...core.statistics import hold, interval, Repeats, repeats, whole_runs
from ...loop.effect import Effect, Estimate, Finding, Fit, View

OTHERS = 2      # axes of a sensor that repeat with one where a message does
OFTEN = 0.2     # share of neighbours that rounding makes equal, beyond which nothing is told so
STRETCH = 1024  # samples in which it makes them equal as often
SHIFTS, APART = 64, 0.5     # by which axes are looked at apart; share of more that may be there
ROUNDS = 20     # in which the share that is sent again settles
LONG = 0.9      # quantile of the runs of messages that are sent again
FEWEST = 10.0   # messages more than chance has
STRETCHES = 8  # of the record, in which repeats are counted
WITHIN = (np.arange(1024) + 0.5) / 1024     # cubed, of Nyquist: a filter may end far below it


class Duplicates(Defect, Response):
    """
    A share of the samples repeats the one before.

    A message is sent twice, or the sensor is read faster than it measures: what repeats evenly
    tells nothing, and the record is looked at as it was measured, once each
    (:mod:`~imu_noise_tools.noise.slower`).

    """

    name = 'duplicates'
    symbol = 'fraction'
    title = 'repeated samples'
    equation = (
        'gain^2, scaled to 1 at f = 0, of the autocovariance r_k, the chance that k samples more '
        'repeat one: p^k held at random, each for one sample; behind a filter of gain^2 g, white '
        'noise has (g + w)/(1 + w) for g, w = (1+p)/(1-p) mean (1 - gain^2) g up to Nyquist; none '
        'where always held as long: each value counts once, at the rate of the sensor'
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
    of_readings = True
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

        Kept too are the shares of stretches of the record, how they clump, whether all are those
        of a slower sensor, and for how long samples are held where not. Where one axis does not
        tell, all of a sensor do.

        """
        fraction, expected, held, runs = repeats(y)
        same = np.diff(y) == 0
        whole = None if held else _messages(same, inputs)
        if whole is not None:
            same, expected = whole
            fraction, held = float(np.mean(same)), True
        out = {
            'fraction': np.array(fraction),
            'expected': np.array(expected),
            'regular': np.array(float(inputs.slower)),
            'held': np.array(held),
            'runs': np.array(runs),
            'n': np.array(len(y)),
        }
        if not held:
            return out
        runs = whole_runs(same)
        more = runs[runs > 1] - 1
        out['stretches'] = np.array([np.mean(x) for x in np.array_split(same, STRETCHES)])
        out['clumps'] = np.array(np.mean(more**2) / np.mean(more) if len(more) else 1.0)
        if len(runs) > 10:
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
        gain = max(gain, float(kept.get('runs', 0.0)))      # or that of runs of one length
        std = float(np.sqrt(seen * (1 - seen) / n))
        effect = self.with_values(fraction=share, pattern=float(kept['regular']),
                                  run=float(kept.get('run', 1.0)))
        slower = '' if effect.scatters else (
            f'; a sensor that measures {1 / evidence.dt:.4g} times a second is read '
            f'{1 / max(1 - share, 1e-6):.3g} times as often, and each value counts once')
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
            f'would be by rounding{slower}',
        )

    def muting(self) -> tuple[str, ...]:
        """Return the views that fail where samples are held; none where each counts once."""
        return self.mutes if self.scatters else ()

    def gain2(self, f: np.ndarray, dt: float) -> np.ndarray:
        """
        Return the squared gain, scaled to 1 at zero frequency.

        Of what is passed without being :meth:`scattered`; 1 of a slower sensor, at its own rate.

        """
        if not self.scatters:
            return np.ones(np.shape(f))
        if self._run > 1:
            return coherent(self['fraction'], self._run, f, dt)
        p, w = self['fraction'], 2 * np.pi * np.asarray(f, float) * dt
        return (1 - p) ** 2 / ((1 - p) ** 2 + p * (2 * np.sin(w / 2)) ** 2)

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
        if not self.scatters:
            return np.zeros(np.shape(f))
        if self._run == 1 and not before:
            return np.full(np.shape(f), self._often - 1)    # white noise keeps its form
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

    @property
    def _run(self) -> int:
        return int(self.values.get('run', 1.0))

    def crowd(self) -> float:
        """
        Return the scatter of sums of products of two white axes held together, whitened.

        A run of L samples holds one product with the weight 1 + p^2 + (L-1)(1-p)^2, L geometric,
        and two of neighbouring runs with p; as many independent samples would have (1-p)(1+p)^2.

        """
        if not self.scatters:
            return 1.0
        p = self['fraction']
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
        return hold(x, ~held)

    @classmethod
    def example(cls) -> Effect:
        """Every fifth sample is a repeat."""
        return cls({'fraction': 0.2, 'pattern': 'random', 'run': 1.0})


def _messages(same: np.ndarray, inputs: Inputs) -> tuple[np.ndarray, float] | None:
    """
    Return which samples repeat the one before on all axes, and how often chance has that.

    On all axes of the sensor, or, where rounding makes many of those equal, of the record. None
    where it is no more than chance has. ``same`` (n - 1,): those that do on one axis.

    """
    if inputs.axis not in inputs.axes or not np.any(same):
        return None
    each = {name: np.diff(x) == 0 for name, x in inputs.axes.items()}
    own = [x for name, x in each.items() if sensor_of(name) == sensor_of(inputs.axis)]
    for some in (own, list(each.values())):
        found = _together(np.stack(some)) if len(some) > OTHERS else None
        if found is not None:
            return found
    return None


def _together(each: np.ndarray) -> tuple[np.ndarray, float] | None:
    """
    Return which neighbours are equal on all axes (axes, n - 1), and how often by chance.

    None where it is no more. Chance is told stretch by stretch: where a sensor rests rounding
    makes more of them equal, on all axes. What moves all axes at once, a vibration that turns,
    makes them equal at once as well, but then also on all but one, and nearly as often some
    samples apart, where a message that is sent again shows on one axis.

    """
    together, n = np.all(each, axis=0), each.shape[1]
    parts = np.array_split(each, max(1, n // STRETCH), axis=1)
    expected, but_one = (sum(x) for x in zip(*map(_by_chance, parts)))
    more = np.sum(together) - expected
    if np.sum(np.sum(each, axis=0) == len(each) - 1) - but_one > APART * more:
        return None
    if expected > OFTEN * n or more < FEWEST + 5 * np.sqrt(4 * expected):
        return None
    # beyond the runs in which a message is sent again
    first = int(np.quantile(whole_runs(~together), LONG))
    if any(_apart(each, k) - expected > APART * more for k in range(first, first + SHIFTS)):
        return None
    chance, seen = expected / n, float(np.mean(together))
    for _ in range(ROUNDS):     # what is sent again is equal on each axis, and not by chance
        again = Repeats(seen, chance, True).share
        chance = sum(_by_chance(part, again)[0] for part in parts) / n
    return together, chance


def _by_chance(each: np.ndarray, again: float = 0.0) -> tuple[float, float]:
    """Return how many of those not sent again are equal on all axes, and on all but one."""
    q = np.maximum(np.mean(each, axis=1) - again, 0.0) / (1 - again)
    others = [np.prod(np.delete(q, i)) for i in range(len(q))]
    return each.shape[1] * float(np.prod(q)), each.shape[1] * float((1 - q) @ others)


def _apart(each: np.ndarray, k: int) -> float:
    """Return how many are equal on all axes, each looked at k samples after the one before."""
    n = each.shape[1] - k * (len(each) - 1)
    if n < STRETCH:
        return 0.0
    later = np.all([x[k * i:k * i + n] for i, x in enumerate(each)], axis=0)
    return float(np.mean(later)) * each.shape[1]
