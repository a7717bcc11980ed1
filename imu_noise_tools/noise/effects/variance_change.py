# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A variance that changes in time."""

import numpy as np
from scipy.optimize import minimize

from ..kinds import Modulation, Parameter
from ..views import block_variance, followed_by, power_in_time, rough_degrees
from ...core.statistics import interval
from ...loop.effect import Estimate, Finding


class VarianceChange(Modulation):
    """The noise itself grows, shrinks or comes and goes: a step, a stretch, a drift, a period."""

    name = 'variance_change'
    symbol = 'factor, time, period, duration'
    title = 'variance that changes in time'
    equation = (
        'variance x factor from time on, or for a duration; x 1 + (factor - 1) t/T over the '
        'record (time 0, period 0); or swinging by factor between its extremes with a period, '
        'largest at time'
    )
    signature = (
        'the dynamic Allan deviation moves; the power of blocks in time scatters more than '
        'chance; heavy tails'
    )
    hint = (
        'Something near was switched on, the supply or the range changed, or the sensor warms '
        'up. Analyse the stretches by themselves, and look at what happened at that time.'
    )
    reference = 'Galleani and Tavella, The dynamic Allan variance, 2009'
    decide = 'record again with everything around switched off'
    parameters = (
        Parameter('factor', '1', 1e-3, 1e3, title='ratio of the variances'),
        Parameter(
            'time',
            's',
            0,
            1e7,
            log=False,
            title='when (step), when largest (period), 0 for a drift',
        ),
        Parameter('period', 's', 0, 1e7, log=False, title='0 unless periodic'),
        Parameter('duration', 's', 0, 1e7, log=False, title='0 unless it ends again'),
    )

    neutral = {'factor': 1.0, 'time': 0.0, 'period': 0.0, 'duration': 0.0}

    def variance(self, t):
        """Return the factor at t (s)."""
        t = np.asarray(t, float)
        f = self['factor']
        if self['period'] > 0:
            swing = (f - 1) / (f + 1)
            return 1 + swing * np.cos(2 * np.pi * (t - self['time']) / self['period'])
        if self['duration'] > 0:
            since = t - self['time']
            return np.where((since >= 0) & (since < self['duration']), f, 1.0)
        if self['time'] > 0:
            return np.where(t >= self['time'], f, 1.0)
        return 1 + (f - 1) * t / max(float(t[-1]), 1e-300)

    def measure(self, evidence):
        """
        Return the shape that gains most likelihood over a constant variance.

        It is found from the power in time; None where none does.

        """
        t, x, w = power_in_time(evidence)
        # scatter of the blocks beyond w: flicker in the low bands; take it from neighbours
        w = rough_degrees(x, w)
        some = sorted(self._shapes(t, x @ w / w.sum()), key=lambda z: z[1] + _nll(z[0], t, x, w))
        found = [self._refined(e, t, x, w, cost) for e, cost in some[:2]]
        gain, effect, std = max(found, key=lambda z: z[0])
        if not gain > 0:
            return None
        f = effect['factor']
        shape = (
            f'swings with a period of {effect["period"]:.3g} s'
            if effect['period'] > 0
            else f'is another for {effect["duration"]:.4g} s from {effect["time"]:.4g} s on'
            if effect['duration'] > 0
            else f'steps at {effect["time"]:.4g} s'
            if effect['time'] > 0
            else 'drifts'
        )
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
        names = ['factor', *(k for k in ('time', 'period', 'duration') if start[k] > 0)]
        steps = {'factor': 1.0, 'time': t[1] - t[0], 'period': start['period'] / len(t),
                 'duration': t[1] - t[0]}
        scale = np.array([steps[k] for k in names])

        def at(z):
            moved = dict(zip(names, [start[k] for k in names] + scale * z))
            factor = start['factor'] * np.exp(np.clip(z[0], -9, 9))
            moved['factor'] = np.clip(factor, 1e-3, 1e3)
            return self.with_values(**{**start.values, **{k: float(v) for k, v in moved.items()}})

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
                if name in ('time', 'duration') and not effect['period'] > 0:
                    # an edge within a block: its place is told by that block's level alone
                    std[name] = float(np.hypot(std[name], 0.1 * scale[j]))
        return -best.fun - cost, effect, std

    def _shapes(self, t, x):
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
            self.with_values(
                factor=float(b[k] / a[k]), time=float(t[i[k]] - width / 2), period=0.0,
                duration=0.0,
            ),
            0.5 * np.log(n) + 1,
        )
        yield self._stretch(t, x), np.log(n) + 2
        slope, begin = np.polyfit(t / t[-1], x, 1)
        factor = np.clip((begin + slope) / max(begin, 0.01 * level), 0.01, 100)
        yield self.with_values(factor=float(factor), time=0.0, period=0.0,
                               duration=0.0), 0.0
        y = x / level - 1
        power = np.abs(np.fft.rfft(y, 4 * n)) ** 2
        power[:6] = 0
        k = int(np.argmax(power))
        period = 4 * n / k * width
        z = 2 / n * np.sum(y * np.exp(-2j * np.pi * (t - t[0]) / period))
        swing = min(abs(z), 0.95)
        peak = float(np.angle(z) / (2 * np.pi) * -period + t[0]) % period
        yield (
            self.with_values(
                factor=float((1 + swing) / (1 - swing)),
                time=peak if peak > 0 else period,
                period=float(period),
                duration=0.0,
            ),
            np.log(n),
        )

    def _stretch(self, t, x):
        """Return the stretch of blocks whose level is likeliest to be another than the rest's."""
        n = len(x)
        total = np.concatenate([[0.0], np.cumsum(x)])
        i, j = (k.ravel() for k in np.indices((n + 1, n + 1)))
        count = j - i
        some = (count >= 3) & (count <= n - 6) & (i > 0) & (j < n)
        i, j, count = i[some], j[some], count[some]
        inside = total[j] - total[i]
        a, b = inside / count, (total[-1] - inside) / (n - count)
        k = int(np.argmin(count * np.log(a) + (n - count) * np.log(b)))
        width = float(t[1] - t[0])
        return self.with_values(
            factor=float(np.clip(a[k] / b[k], 1e-3, 1e3)), period=0.0,
            time=float(t[i[k]] - width / 2), duration=float(count[k] * width),
        )

    @classmethod
    def example(cls):
        """Return a variance that is 2.5 times as large from 100 s on."""
        return cls({**cls.neutral, 'factor': 2.5, 'time': 100.0})


def _nll(effect, t, x, w) -> float:
    """Return -ln L of power in time (blocks, groups) whose variance follows an effect."""
    m = followed_by(np.maximum(block_variance(effect, t), 1e-6), x, w)
    return 0.5 * float(np.sum(w * np.sum(np.log(m) + x / m - 1, axis=0)))
