# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Shocks: knocks that ring and die out."""

from collections.abc import Mapping

import numpy as np
from scipy.fft import idct
from scipy.ndimage import median_filter
from scipy.special import binom, chdtri, digamma, polygamma

from ..evidence import Evidence
from ..kinds import Defect, Inputs, Parameter
from ..lines import reference_spectrum
from ...core.spectrum import cosine_transform
from ...core.statistics import grid_step, interval, repeats, row_medians
from ...loop.effect import Effect, Estimate, Finding

BLOCK_S = 0.05  # s: blocks in which loudness is looked at, 6 to 32 samples
SLOW_S = 1.0  # s: what is slower than that is not looked at
LEVELS = 24  # stretches in which the usual loudness is looked at, longer than two shocks
LASTS = 3  # blocks that a shock fills at least where half a block may be spikes
SINGLE = 5.0  # standard deviations of a sample that counts as one
CHANCE = 1e-2  # expected number of blocks so filled that is believed to be none
MOST = 0.05  # share of the record that shocks may fill
LONGEST = 0.02  # share of the record that one may fill; what lasts longer is no shock
SURE = 15.0  # nats that one is worth at least, the search for it paid
AROUND = 1 << 14  # samples whose spectrum one is weighed against
SIDE = 2  # degree of what goes off to one side in the time of a shock
MEDIAN = 0.4549  # of chi-squared with one degree of freedom


class Shock(Defect):
    """Now and then all samples are far too large for a moment, then less and less."""

    name = 'shock'
    symbol = 'rate, size, decay'
    title = 'shocks (knocks)'
    equation = 'x + size e^(-t/decay) u, u ~ N(0, 1), t from each shock, of which there are rate T'
    signature = (
        'stretches of a second or so in which the samples are many times as large as around them, '
        'mostly on several axes at once'
    )
    hint = (
        'Somebody knocked at the bench, shut a door, put something down. Look at what happened at '
        'the times that are listed; record on a heavy base, at night. The spectrum is fitted '
        'without them.'
    )
    reference = 'Harris and Piersol, Shock and Vibration Handbook, 2002'
    views = ('distribution', 'variance')
    first = True
    certain = True      # loud for half a block at a time: no spike and no spectrum does that
    decide = 'record again with nobody near'
    parameters = (
        Parameter('rate', 'Hz', 1e-9, 1e2, amplitude=True, title='shocks a second'),
        Parameter('size', '{rate}', 1e-12, 1e4, title='standard deviation at the beginning'),
        Parameter('decay', 's', 1e-4, 1e4, title='time constant'),
    )

    @classmethod
    def statistics(cls, y: np.ndarray, inputs: Inputs) -> dict[str, np.ndarray]:
        """Keep begin, end, size, decay and worth in nats of each."""
        loud = _loudness(y, inputs.dt)
        if loud is None:
            return {}
        ratio, level, degrees, length, lasts = loud
        beyond = ratio > chdtri(degrees, 1e-3 / len(ratio)) / degrees
        edges = np.flatnonzero(np.diff(np.concatenate([[0], beyond, [0]]).astype(int)))
        found = []
        gap = max(2, int(0.5 / inputs.dt / length))
        runs: list[list[int]] = []
        for begin, end in edges.reshape(-1, 2):
            if runs and begin - runs[-1][1] < gap:
                runs[-1][1] = int(end)
            else:
                runs.append([int(begin), int(end)])
        for begin, end in runs:
            if np.sum(beyond[begin:end]) < lasts or end - begin > max(LONGEST * len(ratio), LASTS):
                continue
            begin, end = max(begin - 1, 0), min(_faded(ratio, end, degrees), len(ratio))
            over = np.maximum(ratio[begin:end] - 1, 0)
            worth = 0.5 * degrees * float(np.sum(over - np.log1p(over))) - 2 * np.log(len(ratio))
            if worth < SURE:
                continue
            size, decay, error = _dying(over, degrees)
            level_here = float(np.mean(level[begin:end]))
            found.append((begin * length, end * length, size * np.sqrt(level_here),
                          decay * length * inputs.dt, error, worth))
        if not found or sum(e - b for b, e, *_ in found) > MOST * len(y):
            return {}
        out = _beyond_the_spectrum(y, dict(zip(
            ('begin', 'end', 'size', 'decay', 'error', 'worth'), np.array(found).T)), inputs.dt)
        if not len(out['begin']):
            return {}
        return {**out, 'span': np.array(len(y) * inputs.dt), 'dt': np.array(inputs.dt)}

    @classmethod
    def screen(cls, y: np.ndarray, kept: Mapping[str, np.ndarray], inputs: Inputs) -> np.ndarray:
        """Put the noise before each shock, mirrored, in its place: the level stays as it is."""
        return _mirrored(y, kept)

    def find(self, evidence: Evidence) -> Finding | None:
        """Weigh the loud stretches against noise as loud as it is around them."""
        kept = evidence.kept(self.name)
        if not kept:
            return None
        k, span = len(kept['begin']), float(kept['span'])
        values = {
            'rate': k / span,
            'size': float(np.sqrt(np.mean(kept['size'] ** 2))),
            'decay': float(np.median(kept['decay'])),
        }
        spread = {
            'rate': np.sqrt(k) / span,
            'size': values['size'] * _share(kept['size'], kept['error']),
            'decay': values['decay'] * _share(kept['decay'], kept['error']),
        }
        times = ', '.join(f'{b * float(kept["dt"]):.1f}' for b in kept['begin'][:5])
        return Finding(
            self.name,
            float(np.sum(kept['worth'])),
            self.with_values(**values),
            {
                name: Estimate(v, float(s), interval(v, float(s), positive=True))
                for (name, v), s in zip(values.items(), spread.values())
            },
            view='distribution',
            evidence=f'{k} shocks at {times}{" ..." if k > 5 else ""} s',
        )

    def apply(self, x: np.ndarray, inputs: Inputs, rng: np.random.Generator) -> np.ndarray:
        """Add decaying bursts of white noise at random times."""
        out = x.copy()
        span = len(x) * inputs.dt
        for begin in rng.uniform(0, span, rng.poisson(self['rate'] * span)):
            i = int(begin / inputs.dt)
            t = np.arange(min(len(x) - i, int(8 * self['decay'] / inputs.dt) + 1)) * inputs.dt
            out[i:i + len(t)] += self['size'] * np.exp(-t / self['decay']) \
                * rng.standard_normal(len(t))
        return out

    @classmethod
    def example(cls) -> Effect:
        """Return one a minute (0.015 Hz), of 2.9 deg/s (0.05 rad/s), gone within a second."""
        return cls({'rate': 0.015, 'size': 0.05, 'decay': 0.2})


def _mirrored(y: np.ndarray, kept: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return samples (n,) with the noise before each stretch, mirrored, in its place."""
    out = y.copy()
    for begin, end in zip(kept['begin'].astype(int), kept['end'].astype(int)):
        at = np.arange(begin, min(end, len(y)))
        mirrored = 2 * begin - 1 - at
        if mirrored[-1] < 0:
            mirrored = 2 * end - 1 - at
        if mirrored[0] < len(y):
            out[at] = y[np.clip(mirrored, 0, len(y) - 1)]
    return out


def _beyond_the_spectrum(y: np.ndarray, kept: dict[str, np.ndarray], dt: float,
                         ) -> dict[str, np.ndarray]:
    """
    Return what is no crest of swings that the spectrum has all the time.

    Blocks of one swing are loud together, which a count of loud blocks takes for several that are
    loud by chance. The whitened samples of a stretch tell: of a crest their squares are as large
    as those around, of a shock they are not. Taken out, crests would leave more slow power than
    they hold. A shock swings to both sides: what goes off to one side there, as a creep that sets
    in or a step do, is a parabola through the stretch, and does not count.

    """
    clean, sure = _mirrored(y, kept), []
    for begin, end in zip(kept['begin'].astype(int), kept['end'].astype(int)):
        first = int(np.clip((begin + end - AROUND) // 2, 0, max(len(y) - AROUND, 0)))
        piece = slice(first, first + AROUND)
        white = np.sqrt(reference_spectrum(cosine_transform(clean[piece]), dt))
        whole, around = (
            idct(np.append(0.0, cosine_transform(x[piece])[1:] / white), norm='ortho')
            for x in (y, clean))
        some = whole[begin - first:end - first]
        t = np.linspace(-1.0, 1.0, len(some))
        some = (some - np.polyval(np.polyfit(t, some, SIDE), t)) ** 2
        over = float(np.sum(some)) * MEDIAN / (len(some) - SIDE - 1) / float(np.median(around**2))
        sure.append(0.5 * len(some) * (over - 1 - np.log(over)) > SURE if over > 1 else False)
    return {k: v[np.array(sure)] for k, v in kept.items()}


def _share(values: np.ndarray, error: np.ndarray) -> float:
    """Return the relative error of a mean over shocks: their scatter, or their own if larger."""
    own = float(np.sqrt(np.mean(error**2) / len(values)))
    scatter = float(np.std(values) / np.mean(values) / np.sqrt(max(len(values) - 1, 1)))
    return max(own, scatter)


def _dying(over: np.ndarray, degrees: float) -> tuple[float, float, float]:
    """
    Return (size over the level, time constant in blocks, relative error) of what dies out.

    By a straight line through the logarithm of the power from its top on, as far as it stands out.

    """
    top = int(np.argmax(over))
    faint = np.flatnonzero(over[top:] < 2)
    later = over[top:top + faint[0]] if len(faint) else over[top:]
    scatter = float(np.sqrt(polygamma(1, degrees / 2)))
    if len(later) < 4:
        return float(np.sqrt(over[top])), max(len(later), 1) / 2, 1.0
    t = np.arange(len(later)) + 0.5
    slope, begin = np.polyfit(t, np.log(later), 1)
    spread = scatter / np.sqrt(np.sum((t - t.mean()) ** 2))
    slope = max(-slope, spread)
    begin -= digamma(degrees / 2) - np.log(degrees / 2)  # the mean of such a logarithm
    return float(np.exp(0.5 * begin)), 2 / slope, max(spread / slope, scatter / np.sqrt(len(t)))


def _faded(ratio: np.ndarray, end: int, degrees: float) -> int:
    """Return where four blocks together are no louder than usual."""
    while end + 4 <= len(ratio) and np.mean(ratio[end:end + 4]) > 1 + 2.5 * np.sqrt(0.5 / degrees):
        end += 1
    return end + 1


def _loudness(y: np.ndarray, dt: float):
    """
    Return (ratio, level, degrees, length, lasts) of blocks, None where nothing can be said.

    The median square of the samples of each over that of the blocks around, how many degrees of
    freedom its scatter shows (few where the samples of a block go together), the samples and how
    many loud blocks make a shock. A median does not see single spikes: one loud block is enough
    unless they are so many that they fill half of one by chance, or each is held for several
    samples.

    """
    length = int(np.clip(round(BLOCK_S / dt), 6, 32))
    count = len(y) // length
    if count < 4 * LASTS:
        return None
    held, (step, _) = repeats(y).held, grid_step(y)
    if step > 0:    # on a coarse grid squares jump: what rounding took is put in its place
        y = y + step * np.random.default_rng(0).uniform(-0.5, 0.5, len(y))
    rows = y[:count * length].reshape(count, length)[:, ::max(1, length // 6)]
    slow = median_filter(row_medians(rows), max(int(SLOW_S / dt / length), 5))
    square = (rows - slow[:, None]) ** 2
    power = row_medians(square) / MEDIAN
    groups = int(np.clip(count // 50, 1, LEVELS))
    edges = np.linspace(0, count, groups + 1).astype(int)
    usual = np.array([np.median(power[i:j]) for i, j in zip(edges, edges[1:])])
    # a shock is shorter than that, and where the loudness changes the louder counts
    usual = np.max([np.roll(usual, k) for k in (-1, 0, 1)], axis=0) if groups > 2 else usual
    if not np.all(usual > 0):
        return None
    level = np.interp(np.arange(count), 0.5 * (edges[1:] + edges[:-1]), usual)
    ratio = power / level
    single = np.mean(square > SINGLE**2 * level[:, None])
    width = rows.shape[1]
    filled = count * binom(width, width // 2) * single ** (width // 2)
    lasts = LASTS if filled > CHANCE or held else 1
    low, high = np.quantile(np.log(np.maximum(ratio, 1e-12)), (0.25, 0.75))
    variance = max(((high - low) / 1.349) ** 2, 1e-3)
    # the logarithm of chi-squared over its degrees scatters by psi'(degrees/2)
    grid = np.geomspace(0.5, 200, 200)
    degrees = float(np.interp(-variance, -polygamma(1, grid / 2), grid))
    return ratio, level, degrees, length, lasts
