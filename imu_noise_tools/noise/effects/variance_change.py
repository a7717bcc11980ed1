# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A variance that changes in time."""

import numpy as np
from scipy.optimize import minimize, minimize_scalar

from ..dying import course
from ..evidence import Evidence
from ..in_time import (
    block_variance, degrees_of, followed_by, pooled, power_in_time, rough_degrees
)
from ..kinds import Modulation, Parameter
from ...core.statistics import in_a_row, interval
from ...loop.effect import Effect, Estimate, Finding
from ...loop.verdict import DIRECTED

FORMS = ('step', 'stretch', 'drift', 'periodic', 'growth', 'swell')
MOST = 8  # stretches
FEWEST = 12  # blocks in which a change may be told
LASTS = 3  # blocks that one is in at least: what is shorter is a knock or a burst of spikes
ONE = 0.7  # of the gain in one block: it is loud by itself, and nothing changes there
TIMES = tuple(('time', 'duration') if k == 1 else (f'time_{k}', f'duration_{k}')
              for k in range(1, MOST + 1))


class VarianceChange(Modulation):
    """The noise itself grows, shrinks or comes and goes: a step, a stretch, a drift, a period."""

    name = 'variance_change'
    symbol = 'form, factor, time, period, duration'
    title = 'variance that changes in time'
    equation = (
        'variance x factor from time on (step), or for a duration, up to eight times (stretch); x '
        '1 + (factor - 1) t/T over the record (drift), or x factor^(t/T) (growth); or swinging by '
        'factor between its extremes with a period, largest at time: as a cosine (periodic), or '
        'its logarithm as one (swell)'
    )
    signature = (
        'the dynamic Allan deviation moves; the power of blocks in time scatters more than '
        'chance; heavy tails'
    )
    hint = (
        'Something near was switched on, the supply, the range or a filter of the sensor was '
        'changed, or it warms up. Analyse the stretches by themselves, and look at what happened '
        'at that time.'
    )
    reference = 'Galleani and Tavella, The dynamic Allan variance, 2009'
    decide = 'record again with everything around switched off'
    parameters = (
        Parameter.choice('form', FORMS, title='how it changes'),
        Parameter('factor', '1', 1e-3, 1e3, title='ratio of the variances'),
        Parameter('time', 's', 0, 1e7, log=False, title='when; when largest (of a period)'),
        Parameter('period', 's', 0, 1e7, log=False, title='0 unless it swings'),
        Parameter('duration', 's', 0, 1e7, log=False, title='0 unless it ends again'),
        *(
            Parameter(name, 's', 0, 1e7, log=False, title=f'{what} of stretch {k}, 0 for none')
            for k, pair in enumerate(TIMES[1:], 2)
            for name, what in zip(pair, ('beginning', 'duration'))
        ),
    )

    neutral = {p.name: 1.0 if p.name == 'factor' else 0.0 for p in parameters}

    def variance(self, t: np.ndarray) -> np.ndarray:
        """Return the factor at t (s)."""
        t = np.asarray(t, float)
        f, form = self['factor'], self.chosen('form')
        if form in ('periodic', 'swell') and self['period'] > 0:
            wave = np.cos(2 * np.pi * (t - self['time']) / self['period'])
            return f ** (0.5 * wave) if form == 'swell' else 1 + (f - 1) / (f + 1) * wave
        if form == 'stretch':
            inside = np.zeros(t.shape, bool)
            for begin, duration in TIMES:
                since = t - self[begin]
                inside |= (since >= 0) & (since < self[duration])
            return np.where(inside, f, 1.0)
        if form == 'step':
            return np.where(t >= self['time'], f, 1.0)
        if form in ('drift', 'growth'):
            u = t / max(float(t[-1]), 1e-300)
            return 1 + (f - 1) * u if form == 'drift' else f ** u
        return np.ones(t.shape)

    def measure(self, evidence: Evidence) -> Finding | None:
        """
        Return the shape that gains most likelihood over a constant variance.

        It is found from the power in time; None where none does.

        """
        t, x, w = power_in_time(evidence)
        if len(t) < FEWEST:
            return None
        if np.ptp(x) < 1e-9:    # of means, which are 1
            return None
        # scatter of the blocks beyond w: flicker in the low bands; take it from neighbours
        w = rough_degrees(x, w)
        some = sorted(self._shapes(t, pooled(x, w), degrees_of(w)),
                      key=lambda z: z[1] + _nll(z[0], t, x, w))
        found = [self._refined(e, t, x, w, cost) for e, cost in some[:3]]
        found = [z for z in found if z[0] > 0 and _lasts(z[1], t, x, w)]
        if not found:
            return None
        gain, effect, std = max(found, key=lambda z: z[0])
        f = effect['factor']
        shape = {
            'periodic': f'swings with a period of {effect["period"]:.3g} s',
            'stretch': 'is another ' + ', '.join(
                f'for {effect[b]:.4g} s from {effect[a]:.4g} s on' for a, b in TIMES if effect[b]),
            'step': f'steps at {effect["time"]:.4g} s',
            'drift': 'drifts',
            'growth': 'grows or shrinks by the same share each second',
            'swell': f'swells and fades with a period of {effect["period"]:.3g} s',
        }[effect.chosen('form')]
        return Finding(
            self.name,
            float(gain),
            effect,
            {
                k: Estimate(v, std.get(k), interval(v, std[k])
                            if k in std else None)
                for k, v in effect.values.items()
            },
            view='variance',
            evidence=f'the variance {shape}, by a factor {max(f, 1 / f):.3g}',
        )

    def _refined(self, start, t, x, w, cost):
        """Return (gain, effect, std) of a shape at its likeliest values, from a start."""
        used = [k for k in start.values if k not in ('form', 'factor') and start[k] > 0]
        if len(used) > 3:   # each edge is told by the blocks beside it alone
            start, used = self._edges_moved(start, t, x, w), []
        names = ['factor', *used]
        steps = {k: t[1] - t[0] for k in used}
        steps |= {'factor': 1.0, 'period': start['period'] / len(t)}
        scale = np.array([steps[k] for k in names])

        def at(z):
            moved = dict(zip(names, [start[k] for k in names] + scale * z))
            factor = start['factor'] * np.exp(np.clip(z[0], -9, 9))
            moved['factor'] = np.clip(factor, 1e-3, 1e3)
            if 'duration' in used:
                moved['duration'] = max(moved['duration'], (LASTS - 1) * steps['duration'])
            return start.with_values(**{k: float(v) for k, v in moved.items()})

        def nll(z):
            return _nll(at(z), t, x, w)

        best = minimize(nll, np.zeros(len(names)), method='Nelder-Mead',
                        options={'xatol': 1e-3, 'fatol': 1e-3, 'maxiter': 200,
                                 'initial_simplex': np.vstack([np.zeros(len(names)),
                                                               0.3 * np.eye(len(names))])})
        effect, std = at(best.x), {}
        for j, name in enumerate(names):        # the curvature along each, the others held
            h = 0.1 * np.eye(len(names))[j]
            bend = (nll(best.x + h) - 2 * best.fun + nll(best.x - h)) / 0.01
            if bend > 0:
                std[name] = float((effect['factor'] if j == 0 else scale[j]) / np.sqrt(bend))
                if name != 'factor' and not effect['period'] > 0:
                    # an edge within a block: its place is told by that block's level alone
                    std[name] = float(np.hypot(std[name], 0.1 * scale[j]))
        return -best.fun - cost, effect, std

    def _edges_moved(self, start, t, x, w):
        """Return stretches whose edges, one after the other, lie where it is likeliest."""
        width = float(t[1] - t[0])
        for begin, duration in (pair for pair in TIMES if start[pair[1]] > 0):
            for both in (True, False):     # the beginning, the end where it is, and the end
                def moved(by, both=both, begin=begin, duration=duration):
                    lasts = start[duration] + (-by if both else by)
                    return start.with_values(**{begin: max(start[begin] + both * by, 0.0),
                                                duration: max(lasts, (LASTS - 1) * width)})

                best = minimize_scalar(lambda by: _nll(moved(by), t, x, w),
                                       bounds=(-width, width), method='bounded',
                                       options={'xatol': 0.05 * width})
                if best.fun < _nll(start, t, x, w):
                    start = moved(float(best.x))
        return start

    def _of(self, form: str, **values: float):
        """Return a form with these values, neutral else."""
        return self.with_values(**self.neutral).with_values(form=form, **values)

    def _shapes(self, t, x, degrees):
        """Return (effect, nats to pay for the search) of each shape near its likeliest values."""
        n = len(x)
        total = np.cumsum(x)
        i = np.arange(4, n - 4)
        a, b = total[i - 1] / i, (total[-1] - total[i - 1]) / (n - i)
        level = total[-1] / n
        profile = n * np.log(level) - i * np.log(a) - (n - i) * np.log(b)
        k = int(np.argmax(profile))
        width = t[1] - t[0]
        yield (
            self._of('step', factor=float(b[k] / a[k]), time=float(t[i[k]] - width / 2)),
            0.5 * np.log(n) + 1,
        )
        one = self._stretch(t, x)
        yield one, np.log(n) + 2
        several = self._stretches(t, x, degrees, one)
        if several is not None:
            yield several, np.log(n) * sum(several[k] > 0 for _, k in TIMES) + 2
        slope, begin = np.polyfit(t / t[-1], x, 1)
        factor = np.clip((begin + slope) / max(begin, 0.01 * level), 0.01, 100)
        yield self._of('drift', factor=float(factor)), 0.0
        rise = np.polyfit(t / t[-1], np.log(x), 1)[0]
        yield self._of('growth', factor=float(np.exp(np.clip(rise, -5, 5)))), 0.0
        yield from self._swings(t, x)

    def _swings(self, t, x):
        """Return what :meth:`_shapes` does, of those with a period."""
        n, width = len(x), t[1] - t[0]
        y = x / np.mean(x) - 1
        power = np.abs(np.fft.rfft(y, 4 * n)) ** 2
        power[:6] = 0
        k = int(np.argmax(power))
        period = 4 * n / k * width
        z = 2 / n * np.sum(y * np.exp(-2j * np.pi * (t - t[0]) / period))
        swing = min(abs(z), 0.95)
        peak = float(np.angle(z) / (2 * np.pi) * -period + t[0]) % period
        for form in ('periodic', 'swell'):
            yield self._of(form, factor=float((1 + swing) / (1 - swing)),
                           time=peak if peak > 0 else period, period=float(period)), np.log(n)

    def _stretch(self, t, x):
        """Return the stretch of blocks whose level is likeliest to be another than the rest's."""
        n = len(x)
        total = np.concatenate([[0.0], np.cumsum(x)])
        i, j = (k.ravel() for k in np.indices((n + 1, n + 1)))
        count = j - i
        some = (count >= LASTS) & (count <= n - 6) & (i > 0) & (j < n)
        i, j, count = i[some], j[some], count[some]
        inside = total[j] - total[i]
        a, b = inside / count, (total[-1] - inside) / (n - count)
        k = int(np.argmin(count * np.log(a) + (n - count) * np.log(b)))
        width = float(t[1] - t[0])
        return self._of(
            'stretch', factor=float(np.clip(a[k] / b[k], 1e-3, 1e3)),
            time=float(t[i[k]] - width / 2), duration=float(count[k] * width),
        )

    def _stretches(self, t, x, degrees, one):
        """
        Return the likeliest course between two levels, from those of one stretch on.

        None where it has not two to eight stretches. Levels and course are found in turn, the
        course by Viterbi's algorithm, ln n nats a switch.

        """
        inside = block_variance(one, t) != 1
        for _ in range(4):
            if not 2 < inside.sum() < len(x) - 2:
                return None
            level = np.array([np.mean(x[~inside]), np.mean(x[inside])])
            cost = 0.5 * degrees * (np.log(level) + x[:, None] / level)
            inside = course(cost, 0.5 * np.log(len(x)) + 1)
        if inside[0]:
            inside, level = ~inside, level[::-1]
        edges = in_a_row(inside)
        edges = edges[edges[:, 1] - edges[:, 0] >= LASTS]
        # nor is a knock what they leave of a record: bursts here and there are no change
        gaps = edges[1:, 0] - edges[:-1, 1]
        if 2 * np.sum(edges[:, 1] - edges[:, 0]) > len(x) and np.any(gaps < LASTS):
            return None
        if not 2 <= len(edges) <= MOST:
            return None
        width = float(t[1] - t[0])
        values = {'factor': float(np.clip(level[1] / level[0], 1e-3, 1e3))}
        for (begin, duration), (i, j) in zip(TIMES, edges):
            values |= {begin: float(t[i] - width / 2), duration: float((j - i) * width)}
        return self._of('stretch', **values)

    @classmethod
    def example(cls) -> Effect:
        """Return a variance that is 2.5 times as large from 100 s on."""
        return cls({**cls.neutral, 'factor': 2.5, 'time': 100.0})


def _nll(effect, t, x, w) -> float:
    """Return -ln L of power in time (blocks, groups) whose variance follows an effect."""
    return float(np.sum(_each(np.maximum(block_variance(effect, t), 1e-6), x, w)))


def _lasts(effect, t: np.ndarray, x: np.ndarray, w: np.ndarray) -> bool:
    """
    Tell whether blocks are as an effect says all along.

    Not where one of them has most of what all gain, nor where one within a stretch (and not at
    its ends) is surely as those outside.

    """
    gains = _gained(effect, t, x, w)
    if np.max(gains) > ONE * np.sum(gains):
        return False
    if effect.chosen('form') != 'stretch':
        return True
    inside = np.isclose(block_variance(effect, t), effect['factor'])
    inner = inside & np.roll(inside, 1) & np.roll(inside, -1)
    return not np.any(gains[inner] < -DIRECTED)


def _gained(effect, t, x, w) -> np.ndarray:
    """Return by how much each block is likelier than of a constant variance, (blocks,)."""
    changing = np.maximum(block_variance(effect, t), 1e-6)
    return _each(np.ones(len(t)), x, w) - _each(changing, x, w)


def _each(variance: np.ndarray, x: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Return -ln L of each block, (blocks,), whose power follows a variance."""
    m = followed_by(variance, x, w)
    return 0.5 * np.sum(w * (np.log(m) + x / m - 1), axis=1)
