# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random telegraph signal: popcorn noise."""

from collections.abc import Callable
from itertools import product

import numpy as np
from scipy.fft import dct, idct

from ..behind import model_gain2
from ..block_means import slow_rest
from ..dwells import both_ways, Levels, SHORTEST, two_levels
from ..evidence import Evidence
from ..kinds import Drawing, Inputs, Modulation, Parameter, Portrait, Spectrum, StateSpace
from ..lines import waves
from ..views import slow_mean
from ...core import gauss_markov
from ...core.statistics import means_of_blocks
from ...loop.effect import Effect, Fit

_SHARES = (0.5, 0.3, 0.7, 0.15, 0.85)  # of the time spent in the upper level
_LEAST_AND_MOST = 0.05, 0.95  # of the same, where the third moment tells it
_SHOWN, _FOLLOWED = 30, 8192  # dwells in a picture, block means that are told apart
SLOW = 1 << 14  # block means of a record
_SHORT = (1, 4, 16)  # samples in means that tell dwells which the record's block means smear
_KEPT = 128  # segments kept of each of them
_BELOW = 60.0  # dwells in a period from which on a short stretch says nothing of the levels
_FEW, _LIKELY = 16, 64  # segments that tell which values are likeliest, and how many are kept
_SEGMENT = 128  # block means that are filtered one after another; segments go side by side
_LOST = 3.0  # nats, by taking noise behind filters for white
_UNKNOWN = 64  # steps of what wanders by which it is anywhere at the beginning of a segment
_LAGS = 1 << 12  # samples over which noise is asked for what it remembers
_OF_GRID = 1.5  # steps of the output's grid: no more, and it may be the grid that jumps
_LONG, _NEAR = 3.0, 0.5  # widths of means, and how often as far apart, in dwells that show
_HELD = 24.0  # times that it is on one level in a dwell: six means of four, near enough to normal


class Rts(Spectrum):
    """The bias jumps back and forth between two levels, dwelling tau on average in each."""

    name = 'rts'
    symbol = 'step, tau'
    title = 'random telegraph signal (popcorn noise)'
    equation = (
        'two levels, step apart, mean dwell tau: the spectrum of a Gauss-Markov process with '
        'sigma = step/2, Tc = tau/2'
    )
    signature = (
        'block means have two humps; the Allan deviation bumps as for a Gauss-Markov process, '
        'which has one hump'
    )
    hint = (
        'A defect in the semiconductor traps and frees a charge. It belongs to the unit: compare '
        'another one. Averaging helps only beyond many dwell times.'
    )
    reference = 'Machlup, Noise in semiconductors: spectrum of a two-parameter random signal, 1954'
    # whitened, a switch is a knock: samples with strong ones are neither normal nor steady
    mutes = ('distribution', 'variance')
    broad = True
    turn = 2    # bursts are short stays at another level as well
    alike = 'relaxation'
    decide = 'record longer, so that dozens of switches are in it'
    parameters = (
        Parameter('step', '{rate}', 1e-12, 1e3, amplitude=True, title='distance of the levels'),
        Parameter('tau', 's', 1e-4, 1e6, title='mean dwell in a level'),
    )

    @classmethod
    def statistics(cls, y: np.ndarray, inputs: Inputs) -> dict[str, np.ndarray]:
        """Keep means of a few samples from the middle of a record whose block means are longer."""
        changes = max(1, int(np.count_nonzero(np.diff(y))))
        out = {'held': np.array(inputs.dt * len(y) / changes)}
        for length in (k for k in _SHORT if 2 * k <= len(y) // SLOW):
            size = _KEPT * _SEGMENT * length
            begin = (len(y) - size) // 2
            z = means_of_blocks(y[begin:begin + size], length)
            out[f'means_{length}'] = (z - np.mean(z)).astype(np.float32)
            out[f'begin_{length}'] = np.array(begin)
        return out

    def starts(self, evidence: Evidence) -> list[Effect]:
        """Start from dwells that the record can show: four samples to a fifth of its length."""
        if 'tau' in self.values:
            return super().starts(evidence)
        seen = self._seen(evidence)
        if seen is not None:
            return [self.with_values(step=seen.step, tau=seen.tau)]
        return [
            self.with_values(step=1.0, tau=float(tau))
            for tau in np.geomspace(4 * evidence.dt, evidence.n * evidence.dt / 5, 7)
        ]

    def bounds(self, evidence: Evidence) -> dict[str, tuple[float, float]]:
        """Below two samples it is a white noise that was filtered, beyond the record a step."""
        return {'tau': (2 * evidence.dt, 2 * evidence.duration)}

    def told(self, evidence: Evidence) -> dict[str, tuple[float, float]]:
        """Return what is seen of long dwells: to the spectrum a random walk does as well."""
        seen = self._seen(evidence)
        return {} if seen is None else {'step': (seen.step, seen.step_error),
                                        'tau': (seen.tau, seen.tau_error)}

    def path(self, evidence: Evidence) -> np.ndarray | None:
        """Return the path between levels whose dwells are seen."""
        seen = self._seen(evidence)
        return None if seen is None else seen.path

    @staticmethod
    def _seen(evidence: Evidence) -> Levels | None:
        """Return the levels that the path of the record shows, None where none are clear."""
        def look():
            y, lines = evidence.slow_y.astype(float), evidence.line_table
            # what swings within a dwell is none of the path
            fast = lines[lines[:, 0] > SHORTEST / evidence.duration]
            y = y - waves(fast, evidence.slow_t, evidence.dt, evidence.common.slow_length)
            found = two_levels(y, evidence.duration)
            return np.zeros(0) if found is None else np.array([*found[:-1], *found.path])

        found = evidence.remembered((Rts.name, 'path'), look)
        numbers = len(Levels._fields) - 1
        if not len(found):
            return None
        step, tau, step_error, tau_error, lead = found[:numbers].tolist()
        if Rts._of_grid(evidence, step, tau):
            return None
        return Levels(step, tau, step_error, tau_error, lead, found[numbers:])

    @staticmethod
    def _of_grid(evidence: Evidence, step: float, tau: float) -> bool:
        """Tell whether levels may be the output's own: as near, and for not much longer."""
        held = float(evidence.kept(Rts.name).get('held', 0.0))
        return step < _OF_GRID * evidence.resolution and tau < _HELD * held

    @property
    def uneven(self) -> bool:
        """Yes: it switches now more often, now less, than the mean spectrum says."""
        return True

    @property
    def jumps(self) -> float:
        """From one level to the other."""
        return self['step']

    @property
    def knees(self) -> int:
        """Two, of its spectrum: how high, and where."""
        return 2

    def bonus(self, evidence: Evidence, fit: Fit) -> float:
        """
        Return what two levels say more than a Gauss-Markov process of the same spectrum.

        Block means are predicted one after another by either: by the filter of a two-state chain
        (Hamilton 1989) and by Kalman's, each with the level of noise, the step and the dwell that
        suit it best near the fitted ones, and with a random walk beside it or none. Where the path
        of the record shows long dwells, it is what they say more than that or anything else that
        drifts beside steps.

        """
        seen = self._seen(evidence)
        if seen is not None:
            return seen.lead
        if self._of_grid(evidence, self['step'], self['tau']):
            return 0.0
        z, t, width = self._whitened(evidence, fit)
        if len(z) < 2:
            return 0.0  # too few means that show the levels
        noise = 0.5 * np.mean(np.diff(z, axis=1) ** 2)
        grid = np.array(list(product(
            self['step'] * np.array([0.7, 0.85, 1.0, 1.2, 1.4]),
            self['tau'] * np.array([0.5, 0.7, 1.0, 1.4, 2.0]),
            noise * np.array([0.3, 0.5, 0.7, 0.85, 1.0]),
            np.unique([0.0, self._wanders_by(evidence, fit, width)]),
        ))).T
        loud = np.prod([m.variance(t.ravel()) for m in fit.model.of(Modulation)]
                       or [np.ones(z.size)], axis=0).reshape(z.shape)
        loud = loud / np.mean(loud)
        gaussian = _gauss_markov(z, loud, width, *grid)
        values = np.vstack([np.tile(grid, len(_SHARES)), np.repeat(_SHARES, grid.shape[1])])
        some = slice(None, None, max(1, len(z) // _FEW))
        likely = np.argsort(_two_levels(z[some], loud[some], width, *values))[-_LIKELY:]
        levels = np.max(_two_levels(z, loud, width, *values[:, likely]))
        return float(levels - gaussian - np.log(len(_SHARES)))

    def _whitened(self, evidence, fit):
        """
        Return (z, t, width): segments of means (rows, k) whose noise is white, and their times.

        As long as the dwells allow; or, behind a filter, further apart than that remembers: these
        may be as far as dwells are long, for they smear no levels. None where no means show them.

        """
        z, t, width = self._means(evidence, fit)
        some = int(np.clip(self['tau'] / (6 * width), 1, max(1, len(z) // (4 * _SEGMENT))))
        length = round(width / evidence.dt)
        means = _are_white(_correlations(evidence, fit, length * some), len(z) // some)
        if not means:
            alike = _correlations(evidence, fit, length)
            some = next((k for k in range(1, max(1, len(z) // (2 * _SEGMENT)) + 1)
                         if _are_white(alike[::k], len(z) // k)), 0)
        least = max(_LONG * width, (_LONG if means else _NEAR) * some * width)
        if not some or self['tau'] < least:
            return z[:0, None], t[:0, None], width
        z = z[: len(z) // some * some].reshape(-1, some)
        z = z.mean(axis=1) if means else z[:, -1]
        rows, width = len(z) // _SEGMENT, width * some
        z = z[len(z) - rows * _SEGMENT:].reshape(rows, _SEGMENT)
        return z, t[-1] - width * np.arange(z.size)[::-1].reshape(z.shape), width

    def _wanders_by(self, evidence, fit, width):
        """
        Return the variance of the steps, a width (s) apart, of a random walk like all else.

        It has their power where the levels turn over, at f = 1/(2 pi tau): S = 2 q/w (2 pi f)^-2.

        """
        other = _power(evidence, fit, flat=False, but=self.label)
        power = np.interp(1 / (2 * np.pi * self['tau']), evidence.whole.bins.f, other)
        return float(power) * width / (2 * self['tau'] ** 2)

    def _means(self, evidence, fit):
        """Return (means, times, width) without drift: of the record, or of less if they smear."""
        slow = evidence.common.slow_length * evidence.dt
        short = self._short(evidence, fit) if self['tau'] < _LONG * slow else None
        return short or (self._without_drift(evidence, fit), evidence.slow_t, slow)

    def _share(self, evidence: Evidence, fit: Fit) -> float:
        """
        Return the share s of the time in the upper level, which the third moment of means tells.

        That of levels of variance (step/2)^2 is (1 - 2 s)/sqrt(s (1 - s)) (step/2)^3, that of
        three samples e^(-2 (t3 - t1)/tau) of it, and that of noise beside them zero.

        """
        z, _, width = self._means(evidence, fit)
        if width > self['tau']:
            return 0.5
        m = round(width / evidence.dt)
        d = np.arange(m)
        smeared = (m + np.sum(6 * d * (m - d) * np.exp(-2 * d * evidence.dt / self['tau']))) / m**3
        skew = float(np.mean((z - np.mean(z)) ** 3)) / (smeared * (0.5 * self['step']) ** 3)
        return float(np.clip(0.5 - 0.5 * skew / np.hypot(2.0, skew), *_LEAST_AND_MOST))

    def _without_drift(self, evidence, fit):
        """
        Return the block means less all else that the model holds.

        Of drift that is Wiener's estimate. Neither chain knows of drift: it would break the two
        levels and not the other.

        """
        y = slow_rest(evidence, fit.model) - slow_mean(evidence, fit.model)
        return self._shrunk(y, evidence.common.slow_length * evidence.dt, evidence, fit)

    def _shrunk(self, y, width, evidence, fit, least=0.0):
        """Return means y (k,) of some width less Wiener's estimate of all other colours."""
        c = dct(y - np.mean(y), type=2, norm='ortho')
        v, bins = fit.details.v, evidence.whole.bins
        f = np.arange(1, len(c)) / (2 * len(c) * width)
        slow = bins.f <= f[-1]
        gain = model_gain2(fit.model, bins.f, evidence.dt)
        drift = sum(s - gain * np.min((s / gain)[slow]) for label, s in fit.details.each.items()
                    if label != self.label)
        c[1:] *= np.where(f < least, 0.0, 1 - np.clip(np.interp(f, bins.f, drift / v), 0, 1))
        return idct(c, type=2, norm='ortho')

    def _short(self, evidence, fit):
        """
        Return (means, times, width) of a few samples that show the dwells, None where none do.

        Without lines, for one that the model lacks still swings between two levels as well, and
        what is slower than dozens of dwells.

        """
        kept = evidence.kept(self.name)
        lengths = [k for k in _SHORT
                   if f'means_{k}' in kept and self['tau'] >= _LONG * k * evidence.dt]
        if not lengths:
            return None
        length = lengths[-1]
        y = kept[f'means_{length}'].astype(float)
        width = length * evidence.dt
        t = (int(kept[f'begin_{length}']) + 0.5 * (length - 1)) * evidence.dt \
            + width * np.arange(len(y))
        y = y - waves(evidence.line_table, t, evidence.dt, length)
        return self._shrunk(y, width, evidence, fit, 1 / (_BELOW * self['tau'])), t, width

    def portraits(self, evidence: Evidence, fit: Fit) -> dict[str, Callable[[], Portrait]]:
        """Return its levels in time and how long it dwells, where block means can show them."""
        width = evidence.common.slow_length * evidence.dt
        if not _LONG * width < self['tau'] < evidence.duration / 6:
            return {}
        return {'levels_of_the_telegraph': lambda: self._levels(evidence, fit, width),
                'dwell_times': lambda: self._dwells(evidence, fit, width)}

    def _levels(self, evidence: Evidence, fit: Fit, width: float) -> Portrait:
        z, upper, levels = self._followed(evidence, fit, width)
        some = slice(0, max(64, int(_SHOWN * self['tau'] / width)))
        t = evidence.slow_t[-1] - width * np.arange(len(z))[::-1]
        return Portrait(('time', 'mean of the axis'), ('s', '{rate}'), t[some], z[some],
                        t[some], levels[upper.astype(int)][some])

    def _dwells(self, evidence: Evidence, fit: Fit, width: float) -> Portrait:
        """Return which share of the dwells lasts longer than x: a straight line, -x/tau."""
        _, upper, _ = self._followed(evidence, fit, width)
        dwells = np.sort(np.diff(np.flatnonzero(np.diff(upper.astype(int))))) * width
        longer = 1 - (np.arange(len(dwells)) + 0.5) / max(1, len(dwells))
        x = np.linspace(0, 5 * self['tau'], 64)
        return Portrait(('dwell in a level', 'share of the dwells that last longer'), ('s', '1'),
                        dwells, longer, x, np.exp(-x / self['tau']))

    def _followed(self, evidence, fit, width):
        """
        Return block means (k,), whether each is in the upper level, and the levels (2,).

        The levels are those between which the means were told apart (Baum 1970: three rounds).

        """
        z = self._without_drift(evidence, fit)[-_FOLLOWED:]
        noise, stay = 0.5 * np.mean(np.diff(z) ** 2), 0.5 + 0.5 * np.exp(-2 * width / self['tau'])
        levels = np.mean(z) + self['step'] * np.array([-0.5, 0.5])
        for _ in range(3):
            density = np.exp(-0.5 * (z[:, None] - levels) ** 2 / noise) + 1e-12
            at = both_ways(density, stay)
            weight = np.stack([1 - at, at])
            levels = (weight @ z) / np.maximum(weight.sum(axis=1), 1e-9)
            noise = np.sum(weight * (z - levels[:, None]) ** 2) / len(z)
        return z, at > 0.5, levels

    def psd(self, f: np.ndarray, dt: float) -> np.ndarray:
        """Return the AR(1) spectrum."""
        return gauss_markov.psd(f, self['step'] / 2, self['tau'] / 2, dt)

    def avar(self, m: np.ndarray, dt: float) -> np.ndarray:
        """Return that of the Gauss-Markov process of the same spectrum."""
        return gauss_markov.avar(m, self['step'] / 2, self['tau'] / 2, dt)

    def state_space(self, dt: float) -> StateSpace | None:
        """One decaying state of the same spectrum."""
        return gauss_markov.state_space(self['step'] / 2, self['tau'] / 2, dt)

    def apply(self, x: np.ndarray, inputs: Inputs, rng: np.random.Generator) -> np.ndarray:
        """Add two levels that switch with probability (1 - e^(-2 dt/tau))/2 a sample."""
        flip = rng.random(len(x)) < -0.5 * np.expm1(-2 * inputs.dt / self['tau'])
        flip[0] = rng.random() < 0.5
        return x + self['step'] * (np.cumsum(flip) % 2 - 0.5)

    def drawing(self, evidence: Evidence, fit: Fit) -> Drawing:
        """Return what draws two levels, in each of which it is as long as the record shows."""
        share = self._share(evidence, fit)
        # of the same second moments: what leaves either level goes at 2/tau together
        leaves = -np.expm1(-2 * evidence.dt / self['tau']) * np.array([share, 1 - share])
        apart = 0.5 * self['step'] / np.sqrt(share * (1 - share))

        def draw(n: int, rng: np.random.Generator) -> np.ndarray:
            stays = (np.arange(n) + (rng.random() < share)) % 2
            ends = np.cumsum(rng.geometric(leaves[stays]))
            return apart * (stays[np.searchsorted(ends, np.arange(n), 'right')] - share)

        return draw

    @classmethod
    def example(cls) -> Effect:
        """Return levels 412 deg/h (0.002 rad/s) apart, each held for 8 s on average."""
        return cls({'step': 2e-3, 'tau': 8.0})


def _power(evidence: Evidence, fit: Fit, flat: bool, but: str = '') -> np.ndarray:
    """Return the noise (b,) of a fit that is white before filters, or is not, ``but`` for one."""
    return sum((s for label, s in fit.details.each.items() if label != but
                and isinstance(e := fit.model[label], Spectrum) and e.flat == flat),
               np.zeros(len(evidence.whole.bins.f)))


def _correlations(evidence: Evidence, fit: Fit, length: int) -> np.ndarray:
    """Return those of means over ``length`` samples of white noise, one after another (k,)."""
    white, dt = _power(evidence, fit, flat=True), evidence.dt
    f = np.fft.rfftfreq(_LAGS, dt)
    seen = np.interp(f, evidence.whole.bins.f, white) if np.any(white > 0) else np.ones(len(f))
    smeared = np.fft.irfft(seen * (np.sinc(length * f * dt) / np.sinc(f * dt)) ** 2)
    alike = smeared[:_LAGS // 2:length]
    return alike / alike[0]


def _are_white(correlations: np.ndarray, count: int) -> bool:
    """
    Tell whether as many values with correlations (k,) are as good as white.

    What is lost by taking them for that is sum r_j^2/2 nats a value, where they are small.

    """
    return bool(0.5 * count * np.sum(correlations[1:] ** 2) < _LOST)


def _gauss_markov(z, loud, width, step, tau, noise, drift) -> float:
    """
    Return the best ln p of z (rows, k) as an AR(1) in white noise, over sets of values (g,).

    The variance of the noise goes with ``loud`` (rows, k); beside it a random walk has steps of a
    variance ``drift``.

    """
    keep, power = np.exp(-2 * width / tau), 0.25 * step**2
    nothing = np.zeros((len(z), len(step)))
    mean, walked, both = nothing, nothing, nothing
    spread, wide = power + nothing, _UNKNOWN * drift + nothing
    total = np.zeros(len(step))
    for y, here in zip(z.T, loud.T):
        one, other = spread + both, both + wide
        v = one + other + here[:, None] * noise
        rest = y[:, None] - mean - walked
        total -= 0.5 * np.sum(rest**2 / v + np.log(v), axis=0)
        mean, walked = keep * (mean + one / v * rest), walked + other / v * rest
        spread = keep**2 * (spread - one**2 / v) + (1 - keep**2) * power
        both, wide = keep * (both - one * other / v), wide - other**2 / v + drift
    return float(np.max(total))


def _two_levels(z, loud, width, step, tau, noise, drift, share) -> np.ndarray:
    """
    Return ln p (g,) of z (rows, k) as a chain of two levels in white noise, of sets of values.

    A ``share`` (g,) of the time it is in the upper one. Beside it a random walk has steps of a
    variance ``drift``: what is known of it on either level is mixed where the chain may have
    switched (Blom and Bar-Shalom, IEEE Trans. AC-33, 1988).

    """
    # a chain of the same second moments: its levels lie apart by step, its mean is zero
    apart = 0.5 * step / np.sqrt(share * (1 - share))
    level = np.stack([-share * apart, (1 - share) * apart])[:, None, :]
    keep = np.exp(-2 * width / tau)
    stay = np.stack([1 - share + keep * share, share + keep * (1 - share)])    # lower, upper
    at = np.stack([1 - share, share])[:, None, :] + np.zeros((2, len(z), len(step)))
    mean = np.zeros_like(at)
    wide = _UNKNOWN * drift + mean
    total = np.zeros(len(step))
    for y, here in zip(z.T, loud.T):
        v = wide + here[:, None] * noise
        rest = y[:, None] - level - mean
        ln = -0.5 * (rest**2 / v + np.log(v))
        top = np.max(ln, axis=0)
        at = np.maximum(at * np.exp(ln - top), 1e-300)
        total += np.sum(top + np.log(at.sum(axis=0)), axis=0)
        at = at / at.sum(axis=0)
        mean, wide = mean + wide / v * rest, wide * (1 - wide / v)
        # what comes from the same level, and from the other one
        same = stay[:, None] * at
        at = same + (1 - stay[::-1])[:, None] * at[::-1]
        part, off = same / np.maximum(at, 1e-300), mean - mean[::-1]
        mean, wide = (part * x + (1 - part) * x[::-1] for x in (mean, wide))
        wide = wide + part * (1 - part) * off**2 + drift
    return total
