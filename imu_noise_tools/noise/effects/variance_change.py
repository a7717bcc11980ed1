# Copyright 2026 imu_noise_tools maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""A variance that changes in time."""

import numpy as np

from ..kinds import Modulation, Parameter
from ...effect import Estimate, Finding


class VarianceChange(Modulation):
    """The noise itself grows, shrinks or comes and goes: a step, a drift, or a period."""

    name = 'variance_change'
    symbol = 'factor, time, period'
    title = 'variance that changes in time'
    equation = (
        'variance x factor from time on (period 0); x factor^(t/T) over the record (time 0, '
        'period 0); or swinging by factor between its extremes with a period, largest at time'
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
    )

    neutral = {'factor': 1.0, 'time': 0.0, 'period': 0.0}

    def variance(self, t):
        """Return the factor at t (s)."""
        t = np.asarray(t, float)
        f = self['factor']
        if self['period'] > 0:
            swing = (f - 1) / (f + 1)
            return 1 + swing * np.cos(2 * np.pi * (t - self['time']) / self['period'])
        if self['time'] > 0:
            return np.where(t >= self['time'], f, 1.0)
        return f ** (t / max(float(t[-1]), 1e-300))

    def measure(self, evidence):
        """
        Return the shape that gains most likelihood over a constant variance.

        It is found from the power in time; None where none does.

        """
        from ..views import power_in_time

        t, x, w = power_in_time(evidence)
        x, w = (x @ w) / w.sum(), float(w.sum())
        # scatter of the blocks beyond w: flicker in the low bands; take it from neighbours
        rough = np.mean(np.diff(np.log(np.maximum(x, 1e-300))) ** 2) / 2
        w = min(w, 2 / max(rough, 1e-12))
        best = None
        for effect, dof in self._shapes(t, x):
            v = effect.variance(t)
            level = np.mean(x / v)
            gain = 0.5 * w * (len(x) * np.log(np.mean(x)) - np.sum(np.log(v * level))) - dof
            if best is None or gain > best[0]:
                best = gain, effect
        if best is None or best[0] <= 0:
            return None
        gain, effect = best
        f = effect['factor']
        std = float(2 * f * np.sqrt(2 / (w * len(x))))
        shape = (
            'swings with a period'
            if effect['period'] > 0
            else 'steps'
            if effect['time'] > 0
            else 'drifts'
        )
        when = (
            f' of {effect["period"]:.3g} s'
            if effect['period'] > 0
            else f' at {effect["time"]:.4g} s'
            if effect['time'] > 0
            else ''
        )
        found = {
            'factor': Estimate(f, std, (f - 1.96 * std, f + 1.96 * std)),
            'time': Estimate(effect['time'], float(t[1] - t[0]) / 2, None),
            'period': Estimate(effect['period'], None, None),
        }
        return Finding(
            self.name,
            float(gain),
            effect,
            found,
            view='variance',
            evidence=f'the variance {shape}{when}, by a factor {max(f, 1 / f):.3g}',
        )

    def _shapes(self, t, x):
        """Return (effect, nats to pay for the search) of each shape at its most likely values."""
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
                factor=float(b[k] / a[k]), time=float(t[i[k]] - width / 2), period=0.0
            ),
            0.5 * np.log(n) + 1,
        )
        u = t / t[-1]
        slope = float(np.polyfit(u, np.log(x), 1)[0])
        yield (
            self.with_values(factor=float(np.exp(np.clip(slope, -6, 6))), time=0.0, period=0.0),
            0.0,
        )
        y = x / level - 1
        spectrum = np.fft.rfft(y, 4 * n)
        power = np.abs(spectrum) ** 2
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
            ),
            np.log(n),
        )

    @classmethod
    def example(cls):
        """Doubles half-way through."""
        return cls({'factor': 2.5, 'time': 100.0, 'period': 0.0})
