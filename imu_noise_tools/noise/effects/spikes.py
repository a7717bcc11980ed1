# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Spikes: outliers, isolated or the tails of what the sensor makes all the time."""

from collections.abc import Mapping

import numpy as np
from scipy.ndimage import maximum_filter1d, uniform_filter1d
from scipy.special import chdtri, log_ndtr, ndtri

from ..drawn import drawn
from ..evidence import Evidence
from ..in_samples import of_nats
from ..in_time import power_in_time
from ..kinds import Defect, Inputs, Parameter, Spectrum
from ..lines import HALO, PIECE, strong_lines
from ..tails import Tails
from ..telegraph import levels
from ...core.statistics import (
    grid_step,
    hold,
    interval,
    means_of_blocks,
    median_sigma,
    middle_sigma,
    repeats,
    row_medians,
)
from ...loop.effect import Effect, Estimate, Finding, Fit, View
from ...loop.verdict import DIRECTED, FLEXIBLE, FLEXIBLE_SHARE, HEALED, STRIKING

LEAST = 2.0  # standard deviations of a spike and the noise under it
SURE = 15.0  # nats from which outliers are taken out of the samples that the spectrum is made of
BESIDE = 2  # samples on either side that are its neighbours
LEVEL = 5  # samples on either side that tell a level
AROUND = 32  # samples of a median that a burst does not move
PASSES = 6
SLOW = 8  # samples in a mean that swings leave as it is and spikes shift
MORE = 0.02  # share of its power that may be gained where what stands out is taken out
LAGS = (8, 12, 16, 24, 32)  # samples between those that may be large together
LARGE = 4.0  # standard deviations from which a size counts no more
FEW = 1e-5  # share of samples that no cell shows
AGAINST = 1.139  # standard deviation of normal noise less the median of its four neighbours
SMOOTH = 65  # samples of a mean that is no part of the tails
STRETCH = 8  # blocks in time whose loudness is looked at together
HELD = 1, 2, 4, 8, 16  # samples between neighbours, and more
FEWEST = 64  # samples that tell how far such are from their neighbours
ALTERNATE = 3.1  # standard deviations of what one in a thousand normal numbers is below
MOST = 0.5  # share of all that stands out that is most of it
NEAR = np.arange(9, 41)     # samples from one that stands out, beyond a burst of them
DRAWN = 1 << 17  # samples that are drawn at most of a record
DRAWS, ALL = 100, 1 << 20  # records that are drawn at most, and samples of all of them
DEGREES = np.geomspace(1.5, 60, 40)  # of freedom that are tried


class Spikes(Defect):
    """Single samples far outside the noise: transmission errors, knocks."""

    name = 'spikes'
    symbol = 'rate, sigma'
    title = 'spikes (outliers)'
    equation = (
        'x_k + s_k, s_k ~ N(0, sigma^2) in a share rate*dt of the samples, else 0; nu > 0: the '
        'whitened samples follow Student t with nu degrees of freedom, of which rate and sigma '
        'are what stands out'
    )
    signature = (
        'tails of the whitened samples beyond the normal distribution, isolated in time; white '
        'spectrum'
    )
    hint = (
        'Transmission errors, electrical interference, or knocks (these show on several axes at '
        'once and ring). Check the bus, its checksums and the supply; heavy tails all the time '
        '(nu) are the sensor\'s own, a converter\'s or a comparator\'s. N as fitted here is that '
        'of the samples without what stands out.'
    )
    reference = 'Huber, Robust Statistics, 1981'
    views = ('distribution', 'variance', 'ends')
    decide = 'change cable or bus rate and record again'
    parameters = (
        Parameter('rate', 'Hz', 1e-9, 1e4, amplitude=True, title='spikes a second'),
        Parameter('sigma', '{rate}', 1e-12, 1e4, title='standard deviation of their size'),
        Parameter('nu', '1', 0, 1e3, log=False,
                  title="degrees of freedom of Student's t, 0 where the rest is normal"),
    )
    neutral = {'nu': 0.0}

    @classmethod
    def statistics(cls, y: np.ndarray, inputs: Inputs) -> dict[str, np.ndarray]:
        """
        Keep size of each outlier, the noise around it, and which samples it fills.

        What was held is looked at once, or every fresh sample would stand out of its repeats; it
        is of that that a level can be told.

        """
        n = len(y)
        if n < 100:
            return {}
        fresh = np.arange(n)
        if repeats(y).held:
            new = np.concatenate([[True], y[1:] != y[:-1]])
            fresh = np.flatnonzero(new)
            at = levels(y[fresh])
            if at is not None:
                y = y - at[np.cumsum(new) - 1]
        kept = _outliers(y, fresh, _against_neighbours, alone=True)
        if kept and len(kept['size']) and (kept['slow'] > 1 + MORE or _in_bursts(kept, fresh)):
            # there the neighbours are outliers as well: what takes more of them away knows better
            around = _outliers(y, fresh, _against_around, alone=False)
            kept = min(kept, around, key=lambda k: float(k.get('slow', np.inf)))
        if not kept:
            return {}
        return {**kept, 'n': np.array(n), 'dt': np.array(inputs.dt),
                'fresh': np.array(len(fresh) / n),
                'together': np.array(_together(y[fresh]) if len(kept['size']) else 0.0)}

    @classmethod
    def screen(cls, y: np.ndarray, kept: Mapping[str, np.ndarray], inputs: Inputs) -> np.ndarray:
        """Put what its neighbours say in place of each spike."""
        found = _gain(kept)
        if found is None or found[0] < SURE:
            return y
        out = y.copy()
        out[kept['index']] -= kept['excess']
        return out

    @classmethod
    def held_out(cls, evidence: Evidence, part: str, fit: Fit) -> View | None:
        """Return what the first and the last samples say, which no window of a block looks at."""
        kept = evidence.kept(cls.name)
        at = kept.get('at', np.zeros(0, int))
        if not len(at):
            return None
        n = int(kept['n'])
        nats = np.maximum(0.5 * (kept['size'] / kept['sigma']) ** 2 - np.log(n) - 1, 0.0)
        ends = np.array([np.sum(nats[some]) for some in (at < BESIDE, at >= n - BESIDE)])
        if not np.any(ends):
            return None
        return of_nats('ends', np.array([0.0, evidence.duration]), ends, part,
                       bool(fit.model.of(cls)))

    def find(self, evidence: Evidence) -> Finding | None:
        """
        Weigh each outlier's likelihood as a spike against that of a normal sample.

        The spike is one of the fitted size.

        """
        kept = evidence.kept(self.name)
        found = _gain(kept) if kept else None
        if found is None:
            return None
        gain, spread, seen = found
        size, sigma, n = kept['size'], kept['sigma'], int(kept['n'])
        k = len(size)
        nu, error, more = _degrees(evidence, _isolated(kept, spread, k / n / seen),
                                   float(kept.get('together', 0.0)))
        tails = f'; all of them as of Student t with {nu:.2g} degrees of freedom' if nu else ''
        if nu:  # what is below the threshold belongs to the same distribution
            spread, seen = float(np.sqrt(np.mean(size**2))), 1.0
        # spikes too small to be told from noise are missing: scale by the share that is seen
        duration = n * float(kept['dt'])
        rate = k / duration / seen
        std = np.sqrt(k) / duration / seen
        effect = self.with_values(rate=rate, sigma=spread, nu=nu)
        return Finding(
            self.name,
            float(gain + more),
            effect,
            {
                'rate': Estimate(rate, float(std), interval(rate, float(std), positive=True)),
                'sigma': Estimate(
                    spread,
                    spread / np.sqrt(2 * k),
                    (float(spread * np.sqrt(k / chdtri(k, 0.025))),
                     float(spread * np.sqrt(k / chdtri(k, 0.975)))),
                ),
                'nu': Estimate(nu, error, interval(nu, error) if error else None),
            },
            view='distribution',
            evidence=f'{k} samples beyond {float(kept["threshold"]):.1f} standard '
            f'deviations, the largest {np.max(np.abs(size) / sigma):.0f}{tails}',
        )

    def tails(self, evidence: Evidence) -> Tails | None:
        """Return the t distribution that samples follow, or what isolated ones leave of them."""
        kept, nu = evidence.kept(self.name), self.values.get('nu', 0.0)
        if not self['rate'] > 0 or not len(kept.get('size', ())):
            return None
        if nu > 0:
            return Tails(nu, len(kept['size']) / int(kept['n']))
        left = _isolated(kept, self['sigma'], self['rate'] * float(kept['dt']))
        return left if left.hidden > FEW else None

    def otherwise(self, evidence: Evidence, fit: Fit, claim: float) -> str:
        """Say that they swing, or that the rest of the model has as many, as short stays do."""
        swing = _swing(evidence.kept(self.name))
        if swing:
            return swing
        paths = [s for s in fit.model.of(Spectrum) if 'distribution' in s.mutes]
        if not paths:
            return ''
        n, rng = min(evidence.n, DRAWN), np.random.default_rng(1)
        fresh = float(evidence.kept(self.name).get('fresh', 1.0))
        # a short record may be one of the few that have them by chance
        for y in drawn(evidence, fit, paths, n, min(ALL // n, DRAWS)):
            if fresh < 1:       # of fewer samples a stay is shorter
                y = hold(y, rng.random(n) < fresh)
            at = levels(y)
            kept = self.statistics(y if at is None else y - at,
                                   Inputs(np.arange(n) * evidence.dt, evidence.dt, {}))
            found = _gain(kept) if kept else None
            gain = found[0] * evidence.n / n if found else 0.0
            if gain >= HEALED * claim:
                return (f'beside {paths[0].name} samples that have none claim {gain:.0f} nats as '
                        'well')
        return ''

    def apply(self, x: np.ndarray, inputs: Inputs, rng: np.random.Generator) -> np.ndarray:
        """
        Add a normal spike to a share of the samples.

        With degrees of freedom, scale what is fast in each sample as Student's t is scaled.

        """
        nu = self.values.get('nu', 0.0)
        if nu > 0:
            slow = uniform_filter1d(x, SMOOTH, mode='nearest')
            return slow + (x - slow) * np.sqrt(nu / rng.chisquare(nu, len(x)))
        hit = rng.random(len(x)) < self['rate'] * inputs.dt
        return x + hit * self['sigma'] * rng.standard_normal(len(x))

    @classmethod
    def example(cls) -> Effect:
        """Return one spike in twenty seconds, of 2.9 deg/s (0.05 rad/s) rms."""
        return cls({'rate': 0.05, 'sigma': 0.05, 'nu': 0.0})


def _outliers(y, fresh, against, alone: bool) -> dict[str, np.ndarray]:
    """
    Return size of each outlier, the noise around it, and which samples it fills.

    Of the samples y (n,) those at ``fresh`` are looked at ``against`` what is around them; if
    ``alone``, one at a time among neighbours.

    """
    n = len(y)
    z = y if len(fresh) == n else y[fresh]
    rest = against(z)
    blocks, sigma = _local_sigma(rest)
    # on a coarse grid most neighbours are equal, and a jump by a step is no outlier
    sigma = np.maximum(sigma, 0.4 * grid_step(y)[0])
    if not np.all(sigma > 0):
        return {}
    threshold = float(-ndtri(0.01 / n))

    def beyond(at, size):
        return at[np.abs(size) > threshold * np.interp(at, blocks, sigma)]

    at = np.zeros(0, int)
    for again in range(PASSES):
        if again:
            rest = against(z)
        pieces = (np.arange(i, min(i + PIECE, len(z))) for i in range(0, len(z), PIECE))
        new = np.concatenate([beyond(k, rest[k]) for k in pieces])
        if alone:   # the largest first: it may be all that is there
            around = np.clip(new[:, None] + np.arange(-2, 3), 0, len(z) - 1)
            new = new[np.abs(rest[new]) >= np.max(np.abs(rest[around]), axis=1)]
        if not len(new):
            break
        z = z if again else z.copy()
        z[new] -= rest[new]
        at = np.union1d(at, new)
    size = y[fresh[at]] - z[at]
    noise = _louder_around(rest, at, np.interp(at, blocks, sigma)) * _farther(rest, fresh)[at]
    some = (np.abs(size) > threshold * noise) & ~_at_an_edge(z, at, size, threshold * noise)
    at, size, noise = at[some], size[some], noise[some]
    ends = np.append(fresh, n)
    filled = [np.arange(i, j) for i, j in zip(ends[at], ends[at + 1])]
    index = np.concatenate([np.zeros(0, int), *filled])
    excess = np.repeat(size, np.diff(ends)[at])
    return {
        'at': fresh[at],
        'index': index,
        'excess': excess,
        'slow': np.array(_slow_without(y, index, excess)),
        'size': size,
        'sigma': noise,
        'threshold': np.array(threshold),
    }


def _at_an_edge(z: np.ndarray, at: np.ndarray, size: np.ndarray, least: np.ndarray) -> np.ndarray:
    """
    Return which samples ``at`` (k,) are between the levels before and after them, (k,) bool.

    Those of z (n,) are without what stands out, by a ``size``; where the mean steps the last one
    before and the first one after do so.

    """
    k = np.arange(1, LEVEL + 1)
    before, after = (np.median(z[np.clip(at[:, None] + side * k, 0, len(z) - 1)], axis=1)
                     for side in (-1, 1))
    y, low, high = z[at] + size, np.minimum(before, after), np.maximum(before, after)
    return (high - low > least) & (y > low - least) & (y < high + least)


def _farther(rest: np.ndarray, fresh: np.ndarray) -> np.ndarray:
    """
    Return how many times as far as usual samples (k,) are from their neighbours, 1 at least.

    Where others between them were held: behind a filter what is near is alike.

    """
    out, between = np.ones(len(rest)), np.zeros(len(rest), int)
    between[BESIDE:-BESIDE] = fresh[2 * BESIDE:] - fresh[:-2 * BESIDE] - 2 * BESIDE
    usual = rest[between == 0]
    sigma = float(median_sigma(usual)) if len(usual) >= FEWEST else 0.0
    for held in HELD if sigma > 0 else ():
        apart = between >= held
        if np.sum(apart) >= FEWEST:
            out[apart] = max(1.0, float(median_sigma(rest[apart])) / sigma)
    return out


def _louder_around(rest: np.ndarray, at: np.ndarray, sigma: np.ndarray) -> np.ndarray:
    """
    Return the standard deviation (k,) of the noise around samples ``at`` (k,), ``sigma`` at least.

    Of noise that wanders faster than blocks it is where it is loud that samples stand out; those
    of even noise are anywhere, and so few neighbours tell less than a block does.

    """
    if len(rest) < 4 * NEAR[-1] or not len(at):
        return sigma
    beside = rest[(at[:, None] + np.append(-NEAR, NEAR)) % len(rest)]
    local = median_sigma(beside, axis=1)
    clear = np.mean(local / sigma) > 1 + STRIKING * 1.2 / np.sqrt(2 * beside.size)
    return np.maximum(sigma, local) if clear else sigma


def _in_bursts(kept, fresh) -> bool:
    """Tell whether more outliers are among each other's neighbours than chance puts there."""
    at = np.unique(np.searchsorted(fresh, kept['index'], 'right'))
    chance = BESIDE * len(at) ** 2 / len(fresh)
    return bool(np.sum(np.diff(at) <= BESIDE) > chance + STRIKING * np.sqrt(chance))


def _swing(kept: Mapping[str, np.ndarray]) -> str:
    """
    Say that samples that stand out next to each other go up and down by turns, '' if not.

    Where most of what stands out does. Errors of transmission in a burst have any sign: their
    products with the next, of mean 0, are this far below it in one record of a thousand.

    """
    size = kept['size'] / kept['sigma']
    next_to = np.flatnonzero(np.diff(kept['at']) == 1)
    if not len(next_to):
        return ''
    product = size[next_to] * size[next_to + 1]
    some = np.union1d(next_to, next_to + 1)
    if np.sum(product) > -ALTERNATE * np.sqrt(np.sum(product**2)) or (
            np.sum(size[some] ** 2) < MOST * np.sum(size**2)):
        return ''
    return (f'{len(some)} of {len(size)} samples that stand out are next to each other and go up '
            'and down by turns: a swing of a moment does that')


def _gain(kept):
    """
    Return (nats, standard deviation of the spikes, share of them beyond the threshold).

    None where there are none, or too many, or where they are the crests of swings: a spike adds
    to what is slow as well, but a swing that comes and goes does not until its crests are taken.

    """
    size, sigma, n = kept['size'], kept['sigma'], int(kept['n'])
    k = len(size)
    if not 0 < k <= 0.05 * n or float(kept.get('slow', 1.0)) > 1 + MORE:
        return None
    wide, seen = _wide(size / sigma, float(kept['threshold']))
    spread = float(np.sqrt(wide**2 - 1) * np.sqrt(np.mean(sigma**2)))
    wide = np.hypot(sigma, spread)
    gain = np.sum(
        0.5 * (size / sigma) ** 2 - 0.5 * (size / wide) ** 2 - np.log(wide / sigma)
    ) - k * (np.log(n / k) + 1)
    return float(gain), spread, seen


def _isolated(kept: Mapping[str, np.ndarray], spread: float, share: float) -> Tails:
    """
    Return how the samples are distributed from which isolated spikes were taken out.

    Of a ``share`` of them, of standard deviation ``spread``, those below the threshold are left.

    """
    size, n = kept['size'], int(kept['n'])
    rest = float(np.sqrt(np.mean(kept['sigma'] ** 2))) / AGAINST    # the noise beside neighbours
    wide, beyond = float(np.hypot(1, spread / rest)), AGAINST * float(kept['threshold'])
    return Tails(out=len(size) / n, hidden=max(share - len(size) / n, 0.0), wide=wide,
                 beyond=beyond)


def _together(y: np.ndarray) -> float:
    """
    Return by how many standard deviations samples near each other are large together.

    Those of Student's t are not; noise whose loudness wanders has heavy tails as well. What is
    slow is in the scale, and nearer than LAGS the same neighbours are taken off.

    """
    rest = _against_neighbours(y)
    blocks, sigma = _local_sigma(rest)
    size = np.minimum(np.abs(rest) / np.interp(np.arange(len(y)), blocks, np.maximum(
        sigma, 1e-300)), LARGE)
    size -= np.mean(size)
    square = float(np.mean(size**2))
    if len(y) <= 2 * LAGS[-1] or not square > 0:
        return 0.0
    like = [float(np.mean(size[k:] * size[:-k])) / square for k in LAGS]
    return float(np.sum(like)) * np.sqrt(len(y) / len(LAGS))


def _degrees(evidence: Evidence, isolated: Tails, together: float,
             ) -> tuple[float, float | None, float]:
    """
    Return (degrees of freedom, std, nats gained) of the samples but for what was taken out.

    (0, None, 0) where normal noise with isolated spikes does as well, or free quantiles do better:
    then it is none of these. Noise that is louder for a while is normal of several scales: those
    of stretches of blocks, as far as they differ by more than neighbours do.

    """
    cells = evidence.cells[-1].astype(float)
    _, x, w = power_in_time(evidence.as_rounded)
    level = means_of_blocks(x @ w / w.sum(), STRETCH)
    spread = np.ones(1)
    if len(level) > 2:
        chance = 0.5 * float(median_sigma(np.diff(level))) ** 2    # whatever steps among them
        more = max(0.0, 1 - chance / max(float(np.var(level)), 1e-300))
        spread = np.sqrt(np.maximum(1 + more * (level - 1), 0.01))
    tried = (isolated, *(Tails(nu, isolated.out) for nu in DEGREES))
    lost = [tails.fitted(cells, spread)[1] for tails in tried]
    best = int(np.argmin(lost))
    gain, free = lost[0] - lost[best], lost[best] - 0.5 * len(cells)
    free += 0.5 * max(together, 0.0) ** 2   # each is drawn for itself
    if best == 0 or gain < DIRECTED or free > max(FLEXIBLE, FLEXIBLE_SHARE * gain):
        return 0.0, None, 0.0
    nu = DEGREES[best - 1]
    if not 1 < best < len(DEGREES):
        return float(nu), None, gain
    before, here, after = lost[best - 1:best + 2]       # a parabola in the logarithm
    bend, step = before - 2 * here + after, np.log(DEGREES[1] / DEGREES[0])
    nu *= np.exp(0.5 * step * (before - after) / bend)
    return float(nu), float(nu * step / np.sqrt(bend)), gain


def _slow_without(y, index, excess) -> float:
    """Return the slow power of the samples without what stands out, over that with it."""
    taken = y.copy()
    taken[index] -= excess
    power = [float(np.mean(np.diff(means_of_blocks(x, SLOW)) ** 2)) for x in (y, taken)]
    return power[1] / power[0] if power[0] > 0 else 1.0


def _wide(size: np.ndarray, threshold: float) -> tuple[float, float]:
    """
    Return (standard deviation of spike and noise together, share of spikes that are seen).

    In units of the noise.
    The mean square of those beyond the threshold is that of a normal distribution cut off there,
    w^2 (1 + z phi(z)/Phi(-z)), z = threshold/w; it is all there is where far fewer lie just beyond
    the threshold than of such a distribution.

    """
    square = float(np.mean(size**2))
    w = np.geomspace(LEAST, max(2 * np.sqrt(square), 2 * LEAST), 400)
    z = threshold / w
    seen = w**2 * (1 + z * np.exp(-0.5 * z * z - log_ndtr(-z)) / np.sqrt(2 * np.pi))
    wide = float(np.interp(square, seen, w))
    share = -np.expm1(log_ndtr(-1.3 * threshold / wide) - log_ndtr(-threshold / wide))
    near = np.sum(np.abs(size) < 1.3 * threshold)
    few = near < len(size) * share - 3 * np.sqrt(len(size) * share * (1 - share))
    if few:
        return float(np.sqrt(square)), 1.0
    return wide, float(max(2 * np.exp(log_ndtr(-threshold / wide)), 0.05))


def _against_neighbours(y):
    """Return y less its lines and the median of its four neighbours."""
    return _against(y, lambda z: _median_of(z, (0, 1, 3, 4)))


def _median_of(z, four):
    """Return the medians (n - 4,) of ``four`` of five samples in a row, of z (n,)."""
    a, b, c, d = (z[k:len(z) - 4 + k] for k in four)
    low = np.maximum(np.minimum(a, b), np.minimum(c, d))
    high = np.minimum(np.maximum(a, b), np.maximum(c, d))
    return 0.5 * (low + high)


def _against_around(y):
    """Return y less its lines and the medians of the samples around, between them interpolated."""
    def medians(z):
        rows = z[:len(z) // AROUND * AROUND].reshape(-1, AROUND)
        middle = (np.arange(len(rows)) + 0.5) * AROUND - 0.5
        return np.interp(np.arange(2, len(z) - 2), middle, row_medians(rows))

    return _against(y, medians)


def _against(y, level):
    """Return y less its lines and what ``level`` says of each sample, or those beside an end."""
    n = len(y)
    rest = np.zeros(n)
    for i in range(2, n - 2, PIECE - 2 * HALO):
        first = max(0, min(i - HALO, n - PIECE))
        z = y[first:first + PIECE]
        z = z - strong_lines(z)
        begin, end = max(i, first + 2), min(i + PIECE - 2 * HALO, n - 2)
        inside = z[2:-2] - level(z)
        rest[begin:end] = inside[begin - first - 2:end - first - 2]
        if not first:
            rest[:2] = _at_the_end(z, inside)
        if first + len(z) == n:
            rest[-2:] = _at_the_end(z[::-1], inside)[::-1]
    return rest


def _at_the_end(z, inside):
    """
    Return the first two of the samples z (n,) less the median of the four that are beside each.

    Those lie on one side: what the mean moves by between is taken off, and it is less as far as
    such differ by more than the ones ``inside`` do.

    """
    usual = float(median_sigma(z[:-4] - _median_of(z, (1, 2, 3, 4))))
    less = min(1.0, float(median_sigma(inside)) / usual) if usual > 0 else 1.0
    near = z[:AROUND // 2].reshape(2, -1)
    slope = (np.median(near[1]) - np.median(near[0])) / near.shape[1]
    away = np.array([(k - np.delete(np.arange(5), k).mean()) * slope for k in (0, 1)])
    return less * (z[:2] - away - [np.median(np.delete(z[:5], k)) for k in (0, 1)])


def _local_sigma(rest):
    """
    Return (middle of each block, standard deviation of the noise there).

    Noise that changes in time must not look like spikes where it is loud.

    """
    count = int(np.clip(len(rest) // 1000, 1, 256))
    edges = np.linspace(0, len(rest), count + 1).astype(int)
    middle = 0.5 * (edges[1:] + edges[:-1])
    some = [rest[i:j:max(1, (j - i) // 2000)] for i, j in zip(edges, edges[1:])]
    sigma = np.array([max(float(median_sigma(x)), middle_sigma(x)) for x in some])
    sigma = maximum_filter1d(sigma, 3, mode='nearest')  # where it changes, the louder counts
    # a block in which nearly nothing happens says little of the noise in it
    return middle, np.maximum(sigma, 0.1 * np.median(sigma))
