# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Shocks: knocks that ring and die out."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.fft import idct
from scipy.ndimage import median_filter
from scipy.special import binom, chdtrc, chdtri, digamma, pdtrc, polygamma

from ..dying import lasting
from ..evidence import Evidence
from ..in_samples import of_nats
from ..kinds import Defect, heard_by_all, Inputs, Parameter
from ..line_search import find_peaks
from ..lines import waves
from ..ringing import find_rings, loudest, NONE, Rings, SWINGS, tail_of, TOLD
from ..smooth import reference_spectrum
from ...core.spectrum import cosine_transform
from ...core.statistics import (
    grid_step, hold, in_a_row, interval, means_of_blocks, MEDIAN, repeats, row_medians
)
from ...loop.effect import Effect, Estimate, Finding, Fit, View
from ...loop.verdict import SURE as NAMED

BLOCK_S = 0.05  # s: blocks in which loudness is looked at, 6 to 32 samples
SLOW_S = 1.0  # s: what is slower than that is not looked at
LEVELS = 24  # stretches in which the usual loudness is looked at, longer than two shocks
LASTS = 3  # blocks that a shock fills at least where half a block may be spikes
SINGLE = 5.0  # standard deviations of a sample that counts as one
CHANCE = 1e-2  # expected number of blocks so filled that is believed to be none
MOST = 0.05  # share of the record that shocks may fill
LONGEST = 0.02  # share of the record that one may fill; what lasts longer is no shock
SURE = 15.0  # nats that one is worth at least, the search for it paid
AROUND = 1 << 14  # samples at least whose spectrum one is weighed against
RINGS = 7.0  # nats beyond chance of knocks that ring alike: one record in a thousand has them
FADED = 4.0  # time constants after which nothing of a ring is heard
SELDOM = 1e-3    # share of the samples that reach a level of a coarse grid, and of such by chance
COARSE = 2.0  # standard deviations in a step of the grid
FEW_HELD = 0.2  # share of samples that are held, between which a ring is drawn
STRETCHES = 8  # of a half in which knocks that ring are counted
SIDE = 2  # degree of what goes off to one side in the time of a shock
SETTLES = 3  # degree in the logarithm of time of what settles since before the record
UNEVEN = 1e-3  # chance of a level that seems so uneven
OTHERS = 2  # axes that may hear what one does
FAINT = float(np.log(100.0))  # nats of a knock that others hear there
CLEAR = 50.0  # nats of a knock of which an axis hears a third, and of what surely dies out
BY_CHANCE = 0.05  # share of all that is looked at that seems to be heard by chance
KEPT = ('begin', 'end', 'size', 'decay', 'error', 'worth')     # of what is loud


class Shock(Defect):
    """Now and then the samples are far too large for a moment, or ring, and less and less."""

    name = 'shock'
    symbol = 'rate, size, decay, ring'
    title = 'shocks (knocks)'
    equation = (
        'x + size e^(-t/decay) cos(2 pi ring t + phase), t from each shock, of which there are '
        'rate T; where ring is 0, u ~ N(0, 1) in place of the cosine'
    )
    signature = (
        'stretches of a second or so in which the samples are many times as large as around them '
        'or swing at one frequency, mostly on several axes at once'
    )
    hint = (
        'Somebody knocked at the bench, shut a door, put something down. Look at what happened at '
        'the times that are listed; record on a heavy base, at night. The spectrum is fitted '
        'without them.'
    )
    reference = 'Harris and Piersol, Shock and Vibration Handbook, 2002'
    views = ('distribution', 'variance', 'moments')
    turn = 0    # its samples are no spikes
    certain = True      # loud or ringing for a moment: no spike and no spectrum does that
    decide = 'record again with nobody near'
    parameters = (
        Parameter('rate', 'Hz', 1e-9, 1e2, amplitude=True, title='shocks a second'),
        Parameter('size', '{rate}', 1e-12, 1e4, title='amplitude at the beginning, of all '
                  'frequencies its standard deviation'),
        Parameter('decay', 's', 1e-4, 1e4, title='time constant'),
        Parameter('ring', 'Hz', 0, 1e5, log=False, title='frequency, 0 where it is all of them'),
    )
    neutral = {'ring': 0.0}

    @classmethod
    def statistics(cls, y: np.ndarray, inputs: Inputs) -> dict[str, np.ndarray]:
        """
        Keep begin, end, size, decay and worth in nats of each; of one that rings its amplitudes.

        What is still loud where it rings is a part of that, and worth nothing by itself, unless it
        is worth more.

        """
        # what jumps between two levels or three is nothing like the noise that rings stand out of
        jumps = grid_step(y)[0] > COARSE * np.std(y)
        rings = NONE if jumps else _heard(_rings_in(y, inputs.dt), inputs)
        out = _fainter(y, _knocks(y, inputs), inputs)
        if out and np.sum(out['worth']) > np.sum(rings.worth):
            rings = NONE    # what rings is the less of it
        if len(rings.begin):
            some, left = _as_kept(rings, inputs.dt), _without(rings, y)
            out = _loud(left, inputs.dt)
            if out:
                begin, end = (out[k][:, None] for k in ('begin', 'end'))
                same = (some['end'] > begin) & (some['begin'] < end)
                out['worth'] = np.where(same @ some['worth'] > out['worth'], 0.0, out['worth'])
                out = _dying_out(left, out, inputs)
            if out:
                some = {k: np.append(v, out.get(k, np.zeros(len(out['begin']))))
                        for k, v in some.items()}
            out = some
        if not out:
            return {}
        return {**out, 'span': np.array(len(y) * inputs.dt), 'dt': np.array(inputs.dt)}

    @classmethod
    def screen(cls, y: np.ndarray, kept: Mapping[str, np.ndarray], inputs: Inputs) -> np.ndarray:
        """
        Take out what rings; of what is loud put the noise before it, mirrored, in its place.

        So the level stays as it is. Lines go on through it: mirrored they have another phase.

        """
        rings = _ring(kept)
        if np.any(rings):
            y = _without(_as_rings(kept, rings), y, grid_step(y)[0])
        loud = {k: kept[k][~rings] for k in ('begin', 'end')}
        if not len(loud['begin']):
            return y
        out = _mirrored(y, loud)
        c = cosine_transform(out)
        lines = find_peaks(c, reference_spectrum(c, inputs.dt), inputs.dt)[0]
        if not len(lines):
            return out
        through = waves(lines, inputs.dt * np.arange(len(y)), inputs.dt)
        return _mirrored(y - through, loud) + through

    @classmethod
    def held_out(cls, evidence: Evidence, part: str, fit: Fit) -> View | None:
        """Return what each stretch says of knocks that the model does not have."""
        kept = evidence.kept(cls.name)
        some = kept['worth'] > 0 if kept else np.zeros(0, bool)
        ring = kept.get('ring', np.zeros(len(some)))
        for _, heard in heard_by_all(fit.model, ring):      # that comes and goes of itself
            some = some & ~((ring > 0) & heard)
        if not np.any(some):
            return None
        edges = np.linspace(0, evidence.n, 2 * STRETCHES + 1)
        nats = np.histogram(np.minimum(kept['begin'][some], evidence.n - 1), edges,
                            weights=np.maximum(kept['worth'][some], 0.0))[0]
        return of_nats('moments', 0.5 * (edges[1:] + edges[:-1]) * evidence.dt, nats, part,
                       bool(fit.model.of(cls)))

    def otherwise(self, evidence: Evidence, fit: Fit, claim: float) -> str:
        """Say that what rings is a machine that wanders past, where the model has one there."""
        ring = self.values.get('ring', 0.0)
        others = heard_by_all(fit.model, np.array(ring)) if ring > 0 else ()
        return next((f'a ring at {ring:.4g} Hz is {e.label}, which comes and goes there'
                     for e, _ in others), '')

    def find(self, evidence: Evidence) -> Finding | None:
        """Weigh what rings, and what is loud, against noise as it is around them."""
        kept = evidence.kept(self.name)
        if not kept:
            return None
        worth, span, rings = kept['worth'], float(kept['span']), _ring(kept)
        whole = rings | (worth > 0)
        k = int(np.sum(whole))
        ringing = float(np.sum(worth[rings])) >= float(np.sum(worth[~rings]))
        # of two sorts the values of that which is worth more
        some = whole & (rings == ringing)
        ring = kept.get('ring', np.zeros(len(worth)))[some]
        values = {
            'rate': k / span,
            'size': float(np.sqrt(np.mean(kept['size'][some] ** 2))),
            'decay': float(np.median(kept['decay'][some])),
            'ring': float(np.median(ring)),
        }
        spread = {
            'rate': np.sqrt(k) / span,
            'size': values['size'] * _share(kept['size'][some], kept['error'][some]),
            'decay': values['decay'] * _share(kept['decay'][some], kept['error'][some]),
        }
        estimates = {name: Estimate(values[name], float(s), interval(
            values[name], float(s), positive=True)) for name, s in spread.items()}
        # of a damped ring the bounds of frequency and of 1/(2 pi decay) are alike
        wide = float(1 / (2 * np.pi * np.sqrt(2 * np.sum(worth[rings])))) if ringing else 0.0
        wide /= values['decay']
        estimates['ring'] = Estimate(values['ring'], wide, interval(
            values['ring'], wide)) if ringing else Estimate(0.0, None, None)
        times = ', '.join(
            f'{t:.1f}' for t in np.sort(kept['begin'][whole])[:5] * float(kept['dt']))
        said = f', ringing at {values["ring"]:.4g} Hz' if ringing else ''
        return Finding(self.name, float(np.sum(worth)), self.with_values(**values), estimates,
                       view='moments' if ringing else 'distribution',
                       evidence=f'{k} shocks at {times}{" ..." if k > 5 else ""} s{said}')

    def apply(self, x: np.ndarray, inputs: Inputs, rng: np.random.Generator) -> np.ndarray:
        """Add decaying rings, or bursts of white noise, at random times."""
        out = x.copy()
        span, ring = len(x) * inputs.dt, self.values.get('ring', 0.0)
        for begin in rng.uniform(0, span, rng.poisson(self['rate'] * span)):
            i = int(begin / inputs.dt)
            t = np.arange(min(len(x) - i, int(8 * self['decay'] / inputs.dt) + 1)) * inputs.dt
            form = np.cos(2 * np.pi * (ring * t + rng.random())) if ring > 0 \
                else rng.standard_normal(len(t))
            out[i:i + len(t)] += self['size'] * np.exp(-t / self['decay']) * form
        return out

    @classmethod
    def example(cls) -> Effect:
        """Return one a minute (0.015 Hz), of 2.9 deg/s (0.05 rad/s), gone within a second."""
        return cls({'rate': 0.015, 'size': 0.05, 'decay': 0.2, 'ring': 0.0})


def _rings_in(y: np.ndarray, dt: float) -> Rings:
    """
    Return what rings in samples (n,), of which some may be held.

    Where few are, others are drawn between; where many are, a spike is a swing of the frequencies
    that holding removes.

    """
    held = repeats(y)
    if not held.held:
        return find_rings(y, dt, RINGS)
    if held.seen >= FEW_HELD:
        return NONE
    return find_rings(_joined_by_lines(y), dt, RINGS, joined=True)


def _heard(rings: Rings, inputs: Inputs) -> Rings:
    """Return knocks, those that hardly swing or are faint where another axis hears any of them."""
    doubtful = (rings.swings < SWINGS) | (np.sum(rings.worth) < SURE)
    heard = _heard_by_others(_as_kept(rings.of(doubtful), inputs.dt), inputs) \
        if np.any(doubtful) else None
    return rings if heard is None or np.any(heard) else rings.of(~doubtful)


def _joined_by_lines(y: np.ndarray) -> np.ndarray:
    """Return samples (n,) with straight lines in place of those that are held."""
    fresh = np.flatnonzero(_fresh(y))
    return np.interp(np.arange(len(y)), fresh, y[fresh])


def _without(rings: Rings, y: np.ndarray, step: float = 0.0) -> np.ndarray:
    """Return samples (n,) of a grid without what rings; what is held of them is held again."""
    out = rings.out_of(y, step)
    if not repeats(y).held:
        return out
    return hold(out, _fresh(y))


def _fresh(y: np.ndarray) -> np.ndarray:
    """Tell which samples are not those before them again."""
    return np.append(True, y[1:] != y[:-1])


def _ring(kept: Mapping[str, np.ndarray]) -> np.ndarray:
    """Tell which shocks ring at one frequency."""
    return kept['ring'] > 0 if 'ring' in kept else np.zeros(len(kept.get('begin', ())), bool)


def _as_kept(rings: Rings, dt: float) -> dict[str, np.ndarray]:
    """Return what is kept of rings; the bound of a relative amplitude is (2 nats)^(-1/2)."""
    return {
        'begin': rings.begin, 'end': rings.begin + np.ceil(FADED * rings.tau),
        'size': np.hypot(rings.cos, rings.sin), 'decay': rings.tau * dt,
        'error': 1 / np.sqrt(2 * rings.nats), 'worth': rings.worth,
        'ring': rings.omega / (2 * np.pi * dt), 'cos': rings.cos, 'sin': rings.sin,
    }


def _as_rings(kept: Mapping[str, np.ndarray], some: np.ndarray) -> Rings:
    """Return some of what is kept as rings."""
    dt, worth = float(kept['dt']), kept['worth'][some]
    return Rings(kept['begin'][some], kept['cos'][some], kept['sin'][some],
                 2 * np.pi * dt * kept['ring'][some], kept['decay'][some] / dt, worth, worth)


def _knocks(y: np.ndarray, inputs: Inputs) -> dict[str, np.ndarray]:
    """Return what is loud and no burst of noise or outliers; or nothing."""
    return _dying_out(y, _loud(y, inputs.dt), inputs)


def _loud(y: np.ndarray, dt: float) -> dict[str, np.ndarray]:
    """Return begin, end, size, decay, its relative error and worth of what is loud; or nothing."""
    loud = _loudness(y, dt)
    if loud is None:
        return {}
    ratio, _, degrees, length, lasts = loud
    beyond = _far_louder(ratio, degrees)
    found: list[tuple[float, ...]] = []
    gap = max(2, int(0.5 / dt / length))
    runs: list[list[int]] = []
    for begin, end in in_a_row(beyond).tolist():
        if runs and begin - runs[-1][1] < gap:
            runs[-1][1] = end
        else:
            runs.append([begin, end])
    for begin, end in runs:
        if np.sum(beyond[begin:end]) < lasts or end - begin > max(LONGEST * len(ratio), LASTS):
            continue
        if found and begin * length < found[-1][1]:     # it has not faded yet
            continue
        one = _measured(loud, begin, end, dt, 2 * np.log(len(ratio)))
        if one[-1] >= SURE:
            found.append(one)
    if not found or sum(e - b for b, e, *_ in found) > MOST * len(y):
        return {}
    out = dict(zip(KEPT, np.array(found).T))
    out = _beyond_the_usual(ratio, degrees, length, out)
    out = _beyond_the_usual_levels(y, out)
    out = _beyond_the_spectrum(y, out, dt) if len(out['begin']) else {}
    return out if len(out.get('begin', ())) else {}


def _measured(loud: tuple, begin: int, end: int, dt: float, price: float) -> tuple[float, ...]:
    """Return what is KEPT of loud blocks, of :func:`_loudness`, worth their nats less a price."""
    ratio, level, degrees, length, _ = loud
    begin, end = max(begin - 1, 0), min(_faded(ratio, end, degrees), len(ratio))
    over = np.maximum(ratio[begin:end] - 1, 0)
    size, decay, error = _dying(over, degrees)
    return (begin * length, end * length, size * np.sqrt(float(np.mean(level[begin:end]))),
            decay * length * dt, error,
            0.5 * degrees * float(np.sum(over - np.log1p(over))) - price)


def _beyond_the_usual_levels(y: np.ndarray, kept: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """
    Return what reaches levels of a coarse grid more often than others do, or all where none is.

    How loud rounding makes noise less than its step goes with where the mean stands between two
    levels, which are all that is then seen.

    """
    if not len(kept['begin']) or grid_step(y)[0] < np.std(y):
        return kept
    off, (stretches, inside) = np.abs(y - np.median(y)), _stretches(kept, len(y))
    rare = off > np.quantile(off[~inside], 1 - SELDOM) * (1 + 1e-9)
    often = np.mean(rare[~inside])
    beyond = np.array([pdtrc(np.sum(rare[at]) - 1, often * (at.stop - at.start)) < SELDOM
                       if np.any(rare[at]) else False for at in stretches])
    return {k: v[beyond] for k, v in kept.items()}


def _stretches(kept: Mapping[str, np.ndarray], n: int) -> tuple[list[slice], np.ndarray]:
    """Return where each of what is kept is, and which of n samples are in one, (n,)."""
    stretches = [slice(int(b), int(e)) for b, e in zip(kept['begin'], kept['end'])]
    inside = np.zeros(n, bool)
    for at in stretches:
        inside[at] = True
    return stretches, inside


def _mirrored(y: np.ndarray, kept: Mapping[str, np.ndarray]) -> np.ndarray:
    """
    Return samples (n,) with the noise before each stretch, mirrored, in its place.

    Or that after it, where there is not as much before; what is of another stretch is passed over.

    """
    out, (stretches, inside) = y.copy(), _stretches(kept, len(y))
    calm = np.flatnonzero(~inside)
    for at in stretches:
        lasts, first = len(out[at]), int(np.searchsorted(calm, at.start))
        begin = first - lasts if first >= lasts else first
        beside = calm[begin:begin + lasts][::-1]
        if len(beside):
            out[at] = y[np.resize(beside, lasts)]
    return out


def _beyond_the_usual(ratio: np.ndarray, degrees: float, length: int,
                      kept: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """
    Return what is sure beside stretches as long elsewhere in the record.

    Where the loudness wanders some of them go beyond any threshold, and the loudest is no shock.
    Of normal noise the nats beyond a threshold are 1 in the mean.

    """
    blocks = {k: (kept[k] / length).astype(int) for k in ('begin', 'end')}
    rest = np.ones(len(ratio), bool)
    for begin, end in zip(blocks['begin'], blocks['end']):
        rest[begin:end] = False
    left = kept['worth'].copy()
    for k, lasts in enumerate(blocks['end'] - blocks['begin']):
        power = means_of_blocks(ratio[rest], lasts)
        over = np.maximum(power / np.median(power) - 1, 0)
        tail = tail_of(0.5 * degrees * lasts * (over - np.log1p(over)))
        left[k] -= tail.beyond(left[k])
    return {k: v[left >= SURE] for k, v in kept.items()}


def _beyond_the_spectrum(y: np.ndarray, kept: dict[str, np.ndarray], dt: float,
                         ) -> dict[str, np.ndarray]:
    """
    Return what is no crest of swings that the spectrum has all the time.

    Blocks of one swing are loud together, which a count of loud blocks takes for several that are
    loud by chance. The whitened samples of a stretch tell: of a crest their squares are as large
    as those around, of a shock they are not. Taken out, crests would leave more slow power than
    they hold. A shock swings to both sides and comes back: what goes off to one side there, as a
    creep that sets in, is a parabola through the stretch, and that and a step do not count.

    """
    sure = []
    for white, at, edge in _each_whitened(y, kept, dt):
        some = white[at]
        other = np.column_stack([np.vander(np.linspace(-1.0, 1.0, len(some)), SIDE + 1), edge[at]])
        if not at.start:
            settles = np.vander(np.log1p(np.arange(len(some))), SETTLES + 1)[:, :-1]
            other = np.column_stack([other, settles])
        some = some - other @ np.linalg.lstsq(other, some, rcond=None)[0]
        over = float(np.sum(some**2)) / max(len(some) - other.shape[1], 1)
        sure.append(0.5 * len(some) * (over - 1 - np.log(over)) > SURE if over > 1 else False)
    return {k: v[np.array(sure, bool)] for k, v in kept.items()}


def _dying_out(y: np.ndarray, kept: dict[str, np.ndarray], inputs: Inputs,
               ) -> dict[str, np.ndarray]:
    """
    Return what does not surely keep one level, and end as it began; or nothing.

    Noise that is louder for a while does so, and a burst of outliers. What keeps no level is a
    shock even if it swells, as no form is that of all shocks; the others are judged together, for
    one that is short says little. What is left of rings, worth nothing by itself, is not judged.
    A knock at the bench moves all axes, each by its share: what others hear beside one that dies
    out is one as well, and what none of them hears must die out surely.

    """
    if not kept:
        return {}
    told = [lasting(white[max(0, 2 * at.start - at.stop):2 * at.stop - at.start])
            for white, at, _ in _each_whitened(y, kept, inputs.dt)]
    gain, uneven, more = np.reshape(told, (-1, 3)).T
    heard = _heard_by_others(kept, inputs)
    level = (chdtrc(more, 2 * uneven) > UNEVEN) & (kept['worth'] > 0)
    even = chdtrc(np.sum(more[level]), 2 * np.sum(uneven[level])) > UNEVEN
    some = np.ones(len(level), bool)
    if even and np.sum(gain[level]) >= np.log(NAMED / (1 - NAMED)):
        some = ~level if heard is None or np.all(level) else ~level | heard
    if heard is not None:
        clear = some & (kept['worth'] > CLEAR)
        if np.any(clear) and not np.any(heard[clear]) and np.sum(gain[clear]) > -CLEAR:
            some[:] = False
    return {k: v[some] for k, v in kept.items()} if np.any(some) else {}


def _fainter(y: np.ndarray, kept: dict[str, np.ndarray],
             inputs: Inputs) -> dict[str, np.ndarray]:
    """
    Return knocks that an axis hears, with those that it hears faintly where several others do.

    Alone a faint one lasts for a few samples, that pass for spikes; where to look others say.

    """
    length = _block_length(inputs.dt)
    heard = np.zeros(len(y) // length, int)
    for name, x in _others(inputs).items():
        there = inputs.remembered((_knocks, name), partial(_knocks, x, replace(inputs, axis=name)))
        for begin, end in _blocks(there, length):
            heard[begin:end] += 1
    known = _blocks(kept, length)
    runs = [(i, j) for i, j in in_a_row(heard >= OTHERS).tolist()
            if not any(begin < j and i < end for begin, end in known)]
    own = _loudness(y, inputs.dt) if runs else None
    if own is None:
        return kept
    ends = zip(('begin', 'end'), length * np.reshape(runs, (-1, 2)).T)
    every = {k: np.append(x, kept.get(k, ())) for k, x in ends}
    found = []
    for (begin, end), (here, usual) in zip(runs, _beside_elsewhere(y, every)):
        worth = -np.log(len(runs) * _chance(here, usual))
        if worth > FAINT:
            found.append((*_measured(own, begin, end, inputs.dt, 0.0)[:-1], worth))
    if not found:
        return kept
    more = dict(zip(KEPT, np.transpose(found)))
    order = np.argsort(np.append(kept.get('begin', ()), more['begin']))
    return {k: np.append(kept.get(k, ()), x)[order] for k, x in more.items()}


def _blocks(kept: Mapping[str, np.ndarray], length: int) -> list[tuple[int, int]]:
    """Return (begin, end) of the blocks, of so many samples, that loud stretches reach."""
    return [(int(begin) // length, int(end - 1) // length + 1)
            for begin, end in zip(kept.get('begin', ()), kept.get('end', ()))]


def _others(inputs: Inputs) -> dict[str, np.ndarray]:
    """Return the samples of other axes by name, as far as they are any."""
    return {name: x for name, x in inputs.axes.items()
            if name != inputs.axis and np.ptp(x) > 0}


def _far_louder(ratio: np.ndarray, degrees: float) -> np.ndarray:
    """Tell of which blocks the loudness over that around them is none by chance."""
    return ratio > chdtri(degrees, 1e-3 / len(ratio)) / degrees


def _heard_by_others(kept: Mapping[str, np.ndarray], inputs: Inputs) -> np.ndarray | None:
    """Tell of each stretch whether another axis is louder in it; None where too few are known."""
    others = _others(inputs)
    if not inputs.axis or len(others) < OTHERS:
        return None
    chance = np.array([_as_loud(x, kept) for x in others.values()])
    return np.min(chance, axis=0) <= BY_CHANCE / chance.size


def _as_loud(x: np.ndarray, kept: Mapping[str, np.ndarray]) -> list[float]:
    """Return what share of stretches elsewhere, of samples (n,), is as loud as each that is."""
    return [float(np.mean(usual >= here)) for here, usual in _beside_elsewhere(x, kept)]


def _beside_elsewhere(x: np.ndarray, kept: Mapping[str, np.ndarray],
                      ) -> Iterator[tuple[float, np.ndarray]]:
    """Yield the variance of each stretch of samples (n,), and those (k,) of others as long."""
    stretches, inside = _stretches(kept, len(x))
    rest = x[~inside]
    for at in stretches:
        length = at.stop - at.start
        count = len(rest) // length
        yield float(np.var(x[at])), np.var(rest[:count * length].reshape(count, length), axis=1)


def _chance(here: float, usual: np.ndarray) -> float:
    """
    Return the chance of a variance as large, by those of the usual (k,).

    Beyond the largest few of them it falls as a power does, and not faster than it does among
    these (Hill, Annals of Statistics 3, 1975): noise of few outliers has such a tail.

    """
    top = np.log(np.sort(usual)[-TOLD - 1:])
    if len(top) <= TOLD:
        return 1.0
    beyond = np.log(here) - top[0]
    if not beyond > 0:
        return float(np.mean(usual >= here))
    return float(TOLD / len(usual) * np.exp(-beyond / np.mean(top[1:] - top[0])))


def _each_whitened(y: np.ndarray, kept: Mapping[str, np.ndarray], dt: float,
                   ) -> Iterator[tuple[np.ndarray, slice, np.ndarray]]:
    """
    Yield samples around each stretch, whitened, of variance 1 without it, and where it is.

    And a step where the samples jump the most in it, whitened alike.

    """
    clean = _mirrored(y, kept)
    for begin, end in zip(kept['begin'].astype(int), kept['end'].astype(int)):
        wide = max(AROUND, 4 * (end - begin))
        first = int(np.clip((begin + end - wide) // 2, 0, max(len(y) - wide, 0)))
        around = clean[first:first + wide]
        at = slice(begin - first, end - first)
        alone = around.copy()
        alone[at] = y[begin:end]
        step = (np.arange(len(alone)) >= begin - first + _jump(alone[at])).astype(float)
        white = np.sqrt(reference_spectrum(cosine_transform(around), dt))
        alone, around, step = (
            idct(np.append(0.0, cosine_transform(x)[1:] / white), norm='ortho')
            for x in (alone, around, step))
        yield alone / np.sqrt(np.median(around**2) / MEDIAN), at, step


def _jump(y: np.ndarray) -> int:
    """Return the sample of (n,) from which on the mean differs the most from that before."""
    k = np.arange(1, len(y))
    before = np.cumsum(y - np.mean(y))[:-1]
    return int(k[np.argmax(before**2 / (k * (len(y) - k)))]) if len(k) else 0


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


def _block_length(dt: float) -> int:
    """Return how many samples a block has, in which loudness is looked at."""
    return int(np.clip(round(BLOCK_S / dt), 6, 32))


def _loudness(y: np.ndarray, dt: float):
    """
    Return (ratio, level, degrees, length, lasts) of blocks, None where nothing can be said.

    The median square of the samples of each over that of the blocks around, how many degrees of
    freedom its scatter shows (few where the samples of a block go together), the samples and how
    many loud blocks make a shock. A median does not see single spikes: one loud block is enough
    unless they are so many that they fill half of one by chance, or each is held for several
    samples.

    """
    length = _block_length(dt)
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
    usual = loudest(usual) if groups > 2 else usual
    if not np.all(usual > 0):
        return None
    level = np.interp(np.arange(count), 0.5 * (edges[1:] + edges[:-1]), usual)
    ratio = power / level
    degrees = _degrees(ratio)
    # of blocks that are not loud: in those that are, samples of a shock are no single ones
    quiet = ~_far_louder(ratio, degrees)
    single = np.mean(square[quiet] > SINGLE**2 * level[quiet, None]) if np.any(quiet) else 1.0
    width = rows.shape[1]
    filled = count * binom(width, width // 2) * single ** (width // 2)
    lasts = LASTS if filled > CHANCE or held else 1
    return ratio, level, degrees, length, lasts


def _degrees(ratio: np.ndarray) -> float:
    """Return the degrees of freedom that the scatter of powers over their level shows."""
    low, high = np.quantile(np.log(np.maximum(ratio, 1e-12)), (0.25, 0.75))
    variance = max(((high - low) / 1.349) ** 2, 1e-3)
    # the logarithm of chi-squared over its degrees scatters by psi'(degrees/2)
    grid = np.geomspace(0.5, 200, 200)
    return float(np.interp(-variance, -polygamma(1, grid / 2), grid))
