# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Records with something hidden in them, made without a formula of the package.

Base noise and effects are drawn in the time domain (recursions, rounding, dwell times, filters):
a wrong spectrum or closed form in ``noise/`` cannot hide behind a simulation that shares it. One
gyroscope axis holds the hidden effects; the others are plain but for held samples and the sensor's
filter, which act on all axes alike.

Strength is the largest ratio over tau <= T/10 of the effect's Allan deviation to the base model's;
for what does not add, sqrt |variance with / variance without - 1|. ``nats`` is what a perfect
method, told the true model, would gain in log-likelihood over the base model fitted again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.fft import dct
from scipy.optimize import minimize
from scipy.signal import butter, iirnotch, lfilter

from imu_noise_tools.core.record import ImuRecord

DEG = np.pi / 180
GYRO, ACCEL = (tuple(f'{sensor}_{c}' for c in 'xyz') for sensor in ('gyro', 'accel'))
# What flicker noise and a random walk can imitate needs twice the evidence.
IMITABLE = {
    'drift', 'gauss_markov', 'ramp', 'rts', 'slow_periodic', 'step', 'temperature', 'transient'}
ENOUGH = 18.0


@dataclass(frozen=True)
class Hidden:
    """One effect that was put in: its name and values as the package calls them, how strong."""

    name: str
    values: Mapping[str, float]
    strength: float
    nats: float
    known: bool = True
    beside: float = np.inf                  # nats, where there are others

    @property
    def clear(self) -> bool:
        """Whether a verdict on it counts among those of strength 1 and more."""
        enough = ENOUGH * (2 if self.name in IMITABLE else 1)
        return self.strength >= 1 and self.nats >= enough

    @property
    def clear_beside(self) -> bool:
        """Whether it is clear beside the others too, which may drown or imitate it."""
        return self.clear and self.beside >= ENOUGH * (2 if self.name in IMITABLE else 1)


@dataclass(frozen=True)
class Truth:
    """What is in a record: base noise (N, B, K) and hidden effects of each axis."""

    base: Mapping[str, Mapping[str, float]]
    hidden: Mapping[str, tuple[Hidden, ...]]
    bystanders: Mapping[str, str] = field(default_factory=dict)    # axes in which it shows as well


def right(hidden: tuple[Hidden, ...], verdict: str) -> bool:
    """
    Tell whether a first verdict (the name that is missing, or the verdict) on an axis is right.

    Any name of those that are hidden; for what nothing in the library explains, unknown; with less
    than 5 nats to be had, that nothing or nothing certain is missing as well.

    """
    if not hidden:
        return verdict == 'complete'
    if not all(h.known for h in hidden):
        return verdict == 'unknown'
    faint = max(h.nats for h in hidden) < 5
    return verdict in {h.name for h in hidden} or \
        (faint and verdict in ('complete', 'undecidable'))


@dataclass
class Scene:
    """A record in the making."""

    t: np.ndarray
    dt: float
    rng: np.random.Generator
    base: dict[str, dict[str, float]]
    axes: dict[str, np.ndarray]
    target: str
    covariates: dict[str, np.ndarray] = field(default_factory=dict)

    @property
    def n(self) -> int:
        """Number of samples."""
        return len(self.t)

    @property
    def span(self) -> float:
        """Length, s."""
        return self.n * self.dt

    @property
    def y(self) -> np.ndarray:
        """The axis that is to hold the effect."""
        return self.axes[self.target]

    def log_uniform(self, low, high) -> float:
        """Draw a number, all decades alike."""
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def sign(self) -> float:
        """Draw a sign."""
        return float(self.rng.choice([-1, 1]))


# --- base noise ----------------------------------------------------------------------------------

def white(n, dt, density, rng):
    """Return white noise of a two-sided density N."""
    return density / np.sqrt(dt) * rng.standard_normal(n)


def decay(n, dt, sigma, tc, rng):
    """Return a stationary first-order Gauss-Markov process: x_k = e^(-dt/tc) x_(k-1) + w_k."""
    p = np.exp(-dt / tc)
    w = sigma * np.sqrt(1 - p * p) * rng.standard_normal(n)
    w[0] = sigma * rng.standard_normal()
    return lfilter([1.0], [1.0, -p], w)


def flicker(n, dt, b, rng, ratio=3.0):
    """
    Return flicker noise of bias instability B: a sum of decays, time constants in a ratio of 3.

    The sum over ln(tc) of 2 s^2 tc/(1 + (2 pi f tc)^2) is s^2/(2 f ln ratio), so that
    s^2 = B^2 ln(ratio)/pi makes B^2/(2 pi f). It is flat below 1/(60 T), which no record of length
    T sees, and within 3 % of 1/sin(pi f dt) up to Nyquist by the choice of the shortest.
    """
    sigma = b * np.sqrt(np.log(ratio) / np.pi)
    out, tc = np.zeros(n), 0.4 * dt
    while tc < 30 * n * dt:
        out += decay(n, dt, sigma, tc, rng)
        tc *= ratio
    return out - out[0]


def random_walk(n, dt, k, rng):
    """Return the running sum of N(0, K^2 dt)."""
    return np.cumsum(k * np.sqrt(dt) * rng.standard_normal(n))


def base_noise(n, dt, base, rng):
    """Return the sum of the three."""
    return (white(n, dt, base['N'], rng) + flicker(n, dt, base['B'], rng)
            + random_walk(n, dt, base['K'], rng))


def draw_sensor(rng, size=DEG) -> dict[str, float]:
    """Return N, B, K of a MEMS: flat from 10-200 s on, rising from 10-40 times as long."""
    n = size * np.exp(rng.uniform(np.log(0.002), np.log(0.02)))
    flat = np.exp(rng.uniform(np.log(10), np.log(200)))
    b = n / (0.664 * np.sqrt(flat))
    rise = flat * np.exp(rng.uniform(np.log(10), np.log(40)))
    return {'N': float(n), 'B': float(b), 'K': float(0.664 * b * np.sqrt(3 / rise))}


def base_variance(base, tau):
    """Return the Allan variance of the base model (IEEE 952)."""
    flat = 2 * np.log(2) / np.pi * base['B'] ** 2
    return base['N'] ** 2 / tau + flat + base['K'] ** 2 * tau / 3


def base_density(base, f):
    """Return its one-sided density."""
    return (2 * base['N'] ** 2 + base['B'] ** 2 / (np.pi * f)
            + 2 * (base['K'] / (2 * np.pi * f)) ** 2)


# --- how strong ----------------------------------------------------------------------------------

def clusters(n):
    """Return some 40 cluster sizes up to a tenth of a record."""
    return np.unique(np.round(np.geomspace(1, n // 10, 40)).astype(int))


def allan_variance(x, m):
    """Return the overlapping Allan variance: mean squared second differences of the integral."""
    s = np.concatenate([[0.0], np.cumsum(x - x[0])])
    return np.array([np.mean((s[2 * k:] - 2 * s[k:-k] + s[:-2 * k]) ** 2) / (2.0 * k * k)
                     for k in m])


def added_strength(added, base, dt) -> float:
    """Return the strength of what adds."""
    m = clusters(len(added))
    return float(np.sqrt(np.max(allan_variance(added, m) / base_variance(base, m * dt))))


def changed_strength(before, after) -> float:
    """Return the strength of what does not add."""
    m = clusters(len(before))
    ratio = allan_variance(after, m) / allan_variance(before, m)
    return float(np.sqrt(np.max(np.abs(ratio - 1))))


def _binned(x):
    """Return (first, count, mean square of the cosine coefficients in each bin), k >= 1."""
    n = len(x)
    more = np.round(np.geomspace(41, n, 300)).astype(int)
    edges = np.unique(np.concatenate([np.arange(1, 41), more]))
    first, count = edges[:-1], np.diff(edges)
    square = dct(x - x.mean(), type=2, norm='ortho') ** 2
    return first, count, np.add.reduceat(square, first) / count


def nats_of(added, base, dt, deterministic=False, times=1.0) -> float:
    """
    Return the expected gain of knowing an added effect over the base model fitted again, nats.

    In the cosine domain: what is deterministic adds its square to the mean power, and a model that
    knows it takes it out; what is random adds its (smoothed) power to the true density. ``times``
    is what else there is: the density without the effect over the base model's, in the bins.
    """
    first, count, extra = _binned(added)
    f = (2 * first + count - 1) / (4 * len(added) * dt)
    extra = 2 * dt * extra
    if not deterministic:
        padded = np.pad(np.log(extra + 1e-12 * extra.max()), 3, mode='edge')
        extra = np.exp(np.convolve(padded, np.ones(7) / 7, mode='valid'))
    v = times * base_density(base, f)
    seen = v + extra
    told = np.sum(count * (np.log(v if deterministic else seen) + 1))
    start = np.log([base['N'], base['B'], base['K']])

    def misfit(x):
        w = times * base_density(dict(zip('NBK', np.exp(x))), f)
        return np.sum(count * (np.log(w) + seen / w))

    best = min(minimize(misfit, start + d, method='Nelder-Mead', options={'maxiter': 600}).fun
               for d in ((0, 0, 0), (0, 1, 1), (0, -1, 2)))
    return float(max(0.5 * (best - told), 0.0))


# --- effects that add: (samples at amplitude 1, values) ------------------------------------------

def _sinusoid(s):
    f = s.log_uniform(20 / s.span, 0.4 / s.dt)
    wave = np.sin(2 * np.pi * f * s.t + s.rng.uniform(0, 2 * np.pi))
    return wave, {'amplitude': 1.0, 'frequency': f}


def _harmonics(s):
    """Two to six orders of a machine of steady speed."""
    f0 = s.log_uniform(20 / s.span, 0.08 / s.dt)
    orders = s.rng.choice(np.arange(2, 7), s.rng.integers(1, 6), replace=False)
    out, values = np.zeros(s.n), {'frequency': f0}
    for k in (1, *sorted(int(x) for x in orders)):
        values[f'amplitude_{k}'] = size = s.log_uniform(0.2, 1.0)
        out += size * np.cos(2 * np.pi * k * f0 * s.t + s.rng.uniform(0, 2 * np.pi))
    return out, values


def _gauss_markov(s):
    tc = s.log_uniform(0.3, s.span / 60)
    return decay(s.n, s.dt, 1.0, tc, s.rng), {'sigma': 1.0, 'tc': tc}


def _ramp(s):
    sign = s.sign()
    return sign * s.t, {'R': sign}


def _drift(s):
    """What drifts drifts ever faster, or turns back."""
    turn, sign = s.span * s.rng.uniform(-0.2, 0.8), s.sign()
    # written as a rate at the beginning and its change
    return sign * (s.t - turn) ** 2, {'rate': -2 * sign * turn, 'curvature': 2 * sign}


def _slow_periodic(s):
    """The room's temperature is regulated, or the day goes by."""
    period, phase = s.span * s.log_uniform(0.12, 1.8), s.rng.uniform(0, 2 * np.pi)
    # cos(w t + p) = cos p cos w t - sin p sin w t
    return np.cos(2 * np.pi * s.t / period + phase), \
        {'period': period, 'cosine': np.cos(phase), 'sine': -np.sin(phase)}


def _transient(s):
    tc, sign = s.log_uniform(s.span / 50, s.span / 6), s.sign()
    return sign * np.exp(-s.t / tc), {'amplitude': sign, 'tc': tc}


def _temperature(s):
    """
    The die warms up and follows the room; the bias may lag behind the thermometer.

    Or bend, as a sensor's does between extremes; the thermometer may be a coarse and slow one.
    """
    u = s.t / s.t[-1]
    sway = np.sin(2 * np.pi * (s.rng.uniform(0.7, 3) * u + s.rng.uniform()))
    warm = 1 - np.exp(-u / s.rng.uniform(0.03, 0.2))
    wander = np.cumsum(s.rng.standard_normal(s.n)) * 0.3 / np.sqrt(s.n)
    true = 25 + s.rng.uniform(0.5, 3) * sway + s.rng.uniform(2, 10) * warm + wander
    s.covariates['temperature'] = np.round(true + 0.01 * s.rng.standard_normal(s.n), 2)
    lag, sign, felt = float(s.rng.choice([0.0, s.span / 60])), s.sign(), true
    if lag:
        a = np.exp(-s.dt / lag)
        felt = true[0] + lfilter([1 - a], [1, -a], true - true[0])
    if s.rng.random() < 0.3:
        every = max(1, int(s.rng.uniform(1, 4) / s.dt))
        read = np.repeat(true[::every], every)[:s.n]
        s.covariates['temperature'] = 0.25 * np.round(4 * read)
    values = {'slope': sign, 'curvature': 0.0, 'cubed': 0.0, 'lag': lag}
    if s.rng.random() < 0.3:
        # a cubic that stands with its inflection at the mean and turns back towards both ends
        u = felt - felt.mean()
        return sign * (u - 0.6 * u ** 3 / np.max(np.abs(u)) ** 2), {
            'cubed': -0.6 * sign / np.max(np.abs(u)) ** 2, 'lag': lag}
    return sign * (felt - felt.mean()), values


def _rts(s):
    """Dwell times are exponential with mean tau."""
    tau = s.log_uniform(1.0, s.span / 60)
    switches = np.cumsum(s.rng.exponential(tau, int(3 * s.span / tau) + 50))
    return np.searchsorted(switches, s.t) % 2 - 0.5, {'step': 1.0, 'tau': tau}


def _step(s):
    time, sign = s.span * s.rng.uniform(0.15, 0.85), s.sign()
    return np.where(s.t < time, 0.0, sign), {'size': sign, 'time': time}


def _spikes(s):
    form = s.rng.choice(['rare', 'often', 'bursts', 'heavy'])
    count = s.rng.poisson(s.log_uniform(0.01, 0.3) * s.span) + 3
    if form == 'often':
        count = max(3, int(s.log_uniform(1e-3, 0.02) * s.n))
    at = s.rng.integers(0, s.n, count)
    if form == 'bursts':                    # a bus that is disturbed for a few samples
        at = (at[:, None] + np.arange(s.rng.integers(2, 6))).ravel() % s.n
    at = np.unique(at)
    out = np.zeros(s.n)
    out[at] = s.rng.standard_t(3, len(at)) if form == 'heavy' else s.rng.standard_normal(len(at))
    out /= np.std(out[at])
    return out, {'rate': len(at) / s.span, 'sigma': 1.0}


def _shock(s):
    """Something is put down now and then: the mount rings and comes to rest."""
    rate, tc = s.log_uniform(2, 12) / s.span, s.log_uniform(max(0.3, 12 * s.dt), 2.0)
    out, count = np.zeros(s.n), max(1, s.rng.poisson(rate * s.span))
    for i in s.rng.integers(0, int(0.98 * s.n), count):
        x, k = 1.0, i
        while x > 1e-3 and k < s.n:         # a step at a time
            out[k] += x * s.rng.standard_normal()
            x, k = x * (1 - s.dt / tc), k + 1
    return out, {'rate': count / s.span, 'size': 1.0, 'decay': tc}


def _accel_coupling(s):
    """The mount shakes in a band; the gyroscope feels one axis of it."""
    centre, axis, sign = s.rng.uniform(0.05, 0.3) / s.dt, s.rng.choice(list('xyz')), s.sign()
    for a in ACCEL:
        s.axes[a] = s.axes[a] + 0.3 * resonance(s, centre, 4.0)
    felt = s.axes[f'accel_{axis}']
    gains = {f'gain_{c}': sign * (c == axis) for c in 'xyz'}
    return sign * (felt - felt.mean()), {**gains, 'rectification': 0.0}


def _shared_noise(s):
    """Another axis of the gyroscope leaks in."""
    source = int(s.rng.choice([i for i, a in enumerate(GYRO) if a != s.target]))
    other = s.axes[GYRO[source]]
    return other - other.mean(), {'gain': 1.0, 'source': float(source)}


def resonance(s, centre, quality):
    """Return a second-order resonance driven by white noise, of variance 1."""
    w = 2 * np.pi * centre * s.dt
    r = np.exp(-w / (2 * quality))
    x = lfilter([1.0], [1, -2 * r * np.cos(w), r * r], s.rng.standard_normal(s.n + 2000))[2000:]
    return x / np.std(x)


def _narrowband(s):
    """A resonance of Q 5 and more, or a machine whose speed wanders a little or not a little."""
    centre = s.log_uniform(max(0.004, 30 * s.dt / s.span), 0.3) / s.dt
    width = s.log_uniform(0.5 / s.span, centre / 5)
    decay_time = int(5 / (np.pi * width * s.dt)) + 10
    w, r = 2 * np.pi * centre * s.dt, np.exp(-np.pi * width * s.dt)
    # a rotating phasor that forgets its phase, started long before; its real part is seen
    rng, n = s.rng, s.n + decay_time
    if s.rng.random() < 0.5:
        drive = rng.standard_normal(n) + 1j * rng.standard_normal(n)
        x = lfilter([1.0], [1, -r * np.exp(1j * w)], drive)[decay_time:].real
        x *= np.sqrt(1 - r * r)
    else:                                   # a mass on a spring, shaken by white noise
        x = lfilter([1.0], [1, -2 * r * np.cos(w), r * r], rng.standard_normal(n))[decay_time:]
        x *= np.sqrt((1 - r * r) / (1 + r * r) * (1 - 2 * r * r * np.cos(2 * w) + r ** 4))
    return x, {'frequency': centre, 'width': width, 'rms': 1.0}


def _resonance(s):
    """So damped that it is no narrow band, and no Gauss-Markov process."""
    centre = s.log_uniform(0.02, 0.25) / s.dt
    return resonance(s, centre, s.rng.uniform(1.0, 1.5)), {'centre': centre}


def _chirp(s):
    low = s.log_uniform(0.02, 0.15) / s.dt
    high = low * s.rng.uniform(1.3, 2.5)
    phase = low * s.t + 0.5 * (high - low) * s.t ** 2 / s.span
    return np.sin(2 * np.pi * phase), {'from': low, 'to': high}


def _intermittent_line(s):
    """A line that comes and goes at random, its phase new each time."""
    f, dwell = s.log_uniform(0.05, 0.3) / s.dt, s.span / s.rng.uniform(15, 60)
    at = np.searchsorted(np.cumsum(s.rng.exponential(dwell, 500)), s.t)
    phase = s.rng.uniform(0, 2 * np.pi, 600)
    return (at % 2) * np.sin(2 * np.pi * f * s.t + phase[at]), {'frequency': f}


# --- effects that act on the samples: (act, values, nats), act making samples of samples ---------

def _quantization(s, strength):
    """
    The angle is read to a finite step; sqrt(3) Q/dt = strength N/sqrt(dt) at the first tau.

    As ring lasers do, it is dithered by a step, so that errors are independent: Q^2 = step^2/6.
    """
    q = strength * s.base[s.target]['N'] * np.sqrt(s.dt / 3)
    step, dither = q * np.sqrt(6), s.rng.uniform(-0.5, 0.5, s.n + 1)

    def act(y):
        angle = np.cumsum(np.append(0.0, y * s.dt)) / step
        return np.diff(step * np.round(angle + dither)) / s.dt

    return act, {'Q': q}, nats_of(act(s.y) - s.y, s.base[s.target], s.dt)


def _rate_quantization(s, strength):
    """Rounded to steps of half to four standard deviations; each sample on the grid tells it."""
    sigma = s.base[s.target]['N'] / np.sqrt(s.dt)
    step = sigma * float(np.clip(np.sqrt(12) * strength, 0.5, 4.0))
    offset = s.rng.uniform(-10, 10) * step
    return lambda y: step * np.round((y + offset) / step), {'step': step}, np.inf


def _duplicates(s, strength):
    """Held samples, at random or every second one; each tells it."""
    if s.rng.random() < 0.3:
        return lambda y: y[np.arange(s.n) // 2 * 2], {'fraction': 0.5, 'pattern': 1.0}, np.inf
    # the level at low frequencies grows by (1 + p)/(1 - p)
    share = float(np.clip(strength ** 2 / (2 + strength ** 2), 0.01, 0.8))
    fresh = s.rng.random(s.n) >= share
    fresh[0] = True
    at = np.maximum.accumulate(np.where(fresh, np.arange(s.n), 0))
    return lambda y: y[at], {'fraction': share, 'pattern': 0.0}, np.inf


def _low_pass(s, strength):
    """The sensor's own filter; the first tau loses a share strength^2 (at most .9) by it."""
    form, keep, nyquist = int(s.rng.integers(0, 4)), 1 - min(strength, 0.95) ** 2, 0.5 / s.dt
    x, one = s.y - s.y[0], allan_variance(s.y, [1])[0]

    def filtered(x, share):
        if form == 0:
            p = np.exp(-2 * np.pi * share * nyquist * s.dt)
            return lfilter([1 - p], [1, -p], x), {'cutoff': share * nyquist, 'form': 0.0}
        if form == 1:
            return lfilter(*butter(2, share), x), {'cutoff': share * nyquist, 'form': 1.0}
        if form == 2:
            # a fast rate averaged over r intervals and decimated: neighbours share 1 - 1/r
            r = float(np.clip(0.886 / share, 1.02, 1.98))
            part = 0.5 - np.sqrt(0.25 - (1 - 1 / r) / (1 + 2 * (1 - 1 / r)))
            return lfilter([1 - part, part], [1.0], x), {'cutoff': 0.443 / (r * s.dt), 'form': 3.0}
        r = max(2, int(round(0.886 / share)))
        return lfilter(np.ones(r) / r, [1.0], x), {'cutoff': 0.443 / (r * s.dt), 'form': 3.0}

    grid = np.geomspace(0.02, 0.98, 24)
    off = [abs(np.log(allan_variance(filtered(x, g)[0], [1])[0] / one / keep)) for g in grid]
    share = grid[int(np.argmin(off))]
    after, values = filtered(x, share)
    _, count, power = _binned(after)
    ratio = power / _binned(x)[2]
    ratio = ratio / np.exp(np.average(np.log(ratio), weights=count))
    nats = float(0.5 * np.sum(count * (ratio - np.log(ratio) - 1)))
    return lambda y: filtered(y - y[0], share)[0] + y[0], values, nats


def _notch(s, strength):
    """The driver takes a band out; as wide as makes the first tau lose a share strength^2."""
    centre, x = s.rng.uniform(0.15, 0.8), s.y - s.y[0]
    quality = float(np.clip(2 * centre / min(strength, 0.9) ** 2, 1.5, 20))
    b, a = iirnotch(centre, quality)
    after = lfilter(b, a, x)
    _, count, power = _binned(after)
    ratio = power / _binned(x)[2]
    nats = float(0.5 * np.sum(count * (ratio - np.log(ratio) - 1)))
    values = {'frequency': centre * 0.5 / s.dt, 'width': centre * 0.5 / s.dt / quality}
    return lambda y: lfilter(b, a, y - y[0]) + y[0], values, nats


def _louder(s, shape, strength):
    """Return what adds white noise of a variance that follows a shape, and its nats."""
    factor = 1 + strength ** 2 / shape.mean() * shape
    extra = np.sqrt(factor - 1) * white(s.n, s.dt, s.base[s.target]['N'], s.rng)
    gain = 0.5 * s.n * (np.log(np.mean(factor)) - np.mean(np.log(factor)))
    return lambda y: y + extra, float(factor.max()), float(gain)


def _variance_change(s, strength):
    """White noise steps, is loud for a while, drifts or swings: mean variance 1 + strength^2."""
    kind = s.rng.choice(['step', 'stretch', 'drift', 'period'])
    values = {'time': 0.0, 'period': 0.0, 'duration': 0.0,
              'form': float(['step', 'stretch', 'drift', 'period'].index(kind))}
    if kind == 'step':
        values['time'] = s.span * s.rng.uniform(0.2, 0.8)
        shape = (s.t >= values['time']).astype(float)
    elif kind == 'stretch':
        values['time'], values['duration'] = s.span * s.rng.uniform((0.1, 0.1), (0.6, 0.3))
        since = s.t - values['time']
        shape = ((since >= 0) & (since < values['duration'])).astype(float)
    elif kind == 'drift':
        shape = s.t / s.span
    else:
        values['period'] = s.span / s.rng.uniform(3, 20)
        values['time'] = values['period'] * s.rng.uniform(0.01, 1)
        shape = 0.5 + 0.5 * np.cos(2 * np.pi * (s.t - values['time']) / values['period'])
    act, factor, gain = _louder(s, shape, strength)
    return act, {'factor': factor, **values}, gain


def _random_modulation(s, strength):
    """The variance wanders without a shape: its logarithm is a slow Gauss-Markov process."""
    slow = decay(s.n, s.dt, 1.0, s.span / s.rng.uniform(15, 40), s.rng)
    act, factor, gain = _louder(s, np.exp(1.2 * slow), strength)
    return act, {'factor': factor}, gain


@dataclass(frozen=True)
class Recipe:
    """How an effect is made: by ``unit`` samples that are scaled and added, or by a ``change``."""

    unit: Callable | None = None
    change: Callable | None = None
    deterministic: bool = False
    known: bool = True
    scaled: tuple[str, ...] = ()              # the values that are amplitudes


RECIPES: dict[str, Recipe] = {
    'sinusoid': Recipe(_sinusoid, deterministic=True, scaled=('amplitude',)),
    'harmonics': Recipe(_harmonics, deterministic=True,
                        scaled=tuple(f'amplitude_{k}' for k in range(1, 7))),
    'narrowband': Recipe(_narrowband, scaled=('rms',)),
    'gauss_markov': Recipe(_gauss_markov, scaled=('sigma',)),
    'temperature': Recipe(_temperature, deterministic=True, scaled=('slope', 'cubed')),
    'ramp': Recipe(_ramp, deterministic=True, scaled=('R',)),
    'drift': Recipe(_drift, deterministic=True, scaled=('rate', 'curvature')),
    'slow_periodic': Recipe(_slow_periodic, deterministic=True, scaled=('cosine', 'sine')),
    'transient': Recipe(_transient, deterministic=True, scaled=('amplitude',)),
    'rate_quantization': Recipe(change=_rate_quantization),
    'quantization': Recipe(change=_quantization),
    'low_pass': Recipe(change=_low_pass),
    'notch': Recipe(change=_notch),
    'duplicates': Recipe(change=_duplicates),
    'spikes': Recipe(_spikes, scaled=('sigma',)),
    'shock': Recipe(_shock, scaled=('size',)),
    'rts': Recipe(_rts, scaled=('step',)),
    'accel_coupling': Recipe(_accel_coupling, deterministic=True,
                             scaled=('gain_x', 'gain_y', 'gain_z')),
    'shared_noise': Recipe(_shared_noise, deterministic=True, scaled=('gain',)),
    'step': Recipe(_step, deterministic=True, scaled=('size',)),
    'variance_change': Recipe(change=_variance_change),
    # what nothing in the library explains
    'resonance': Recipe(_resonance, known=False),
    'chirp': Recipe(_chirp, deterministic=True, known=False),
    'intermittent_line': Recipe(_intermittent_line, deterministic=True, known=False),
    'random_modulation': Recipe(change=_random_modulation, known=False),
}
KNOWN = tuple(k for k, r in RECIPES.items() if r.known)
UNKNOWN = tuple(k for k, r in RECIPES.items() if not r.known)
# What the electronics do to the samples comes after what the sensor feels, in this order.
# Linear, and the same for all axes of a device: a message that is sent again repeats them all.
COMMON = ('low_pass', 'notch', 'duplicates')
LAST = {k: i for i, k in enumerate(
    ('low_pass', 'notch', 'quantization', 'rate_quantization', 'duplicates', 'spikes'), 1)}


def _spike_nats(added, base, dt) -> float:
    """Return what telling each spike from a normal sample brings, less what their places cost."""
    size = added[added != 0]
    sigma2 = base['N'] ** 2 / dt
    wide2 = sigma2 + np.mean(size ** 2)
    each = 0.5 * (size ** 2 + sigma2) * (1 / sigma2 - 1 / wide2) - 0.5 * np.log(wide2 / sigma2)
    return float(max(np.sum(np.maximum(each - np.log(len(added) / len(size)), 0)), 0.0))


@dataclass(frozen=True)
class Deed:
    """What hiding an effect did: the unit samples it added, scaled, or none, and how it acts."""

    name: str
    added: np.ndarray | None
    act: Callable

    @property
    def recipe(self) -> Recipe:
        """How it was made."""
        return RECIPES[self.name]


def _hide(s: Scene, name: str, strength: float) -> tuple[Hidden, Deed]:
    """Put one effect into the target axis of a scene."""
    recipe, base, before = RECIPES[name], s.base[s.target], s.y
    if recipe.change:
        act, values, nats = recipe.change(s, strength)
        s.axes[s.target] = act(before)
        size = changed_strength(before, s.y)
        return Hidden(name, values, size, nats, recipe.known), Deed(name, None, act)
    unit, values = recipe.unit(s)
    scale = strength / added_strength(unit, base, s.dt)
    added = scale * unit
    s.axes[s.target] = before + added
    values = {k: v * scale if k in recipe.scaled else v for k, v in values.items()}
    nats = _spike_nats(added, base, s.dt) if name in ('spikes', 'shock') else \
        nats_of(added, base, s.dt, recipe.deterministic)
    return Hidden(name, values, strength, nats, recipe.known), \
        Deed(name, added, lambda y: y + added)


def nats_beside(i: int, deeds: list[Deed], plain: np.ndarray, base, dt) -> float:
    """
    Return what knowing deed i, which adds, is worth beside the others, all of which are known.

    It reaches the record through what filters or holds samples after it, and stands against the
    power of the others, less what of them is deterministic. The model without it may bend that
    power as it may the base model's.
    """
    rest, added = plain, deeds[i].added
    for k, deed in enumerate(deeds):
        if k != i:
            rest = rest if deed.recipe.deterministic else deed.act(rest)
            if k > i and deed.name in COMMON:
                added = deed.act(added)
    first, count, power = _binned(rest)
    f = (2 * first + count - 1) / (4 * len(rest) * dt)
    padded = np.pad(np.log(2 * dt * power), 3, mode='edge')
    against = np.exp(np.convolve(padded, np.ones(7) / 7, mode='valid'))
    return nats_of(added, base, dt, deeds[i].recipe.deterministic,
                   against / base_density(base, f))


def draw(rng: np.random.Generator, effects=(), *, strength=(1.0, 10.0), hours=1.0, rate_hz=50.0,
         target='gyro_x', sensor=None, accel=False) -> tuple[ImuRecord, Truth]:
    """
    Return a record at rest and what is in it.

    Parameters
    ----------
    rng : Generator
    effects : sequence of str
        Of :data:`RECIPES`; none: nothing hidden.
    strength : float or (float, float)
        Of each effect, or the range from which it is drawn, all decades alike. What cannot be as
        strong (a low-pass above 1) is as strong as it can be; the truth tells.
    hours, rate_hz : float
    target : str
        The gyroscope axis that holds the effects.
    sensor : mapping or None
        N, B, K of all gyroscope axes; None: drawn for each.
    accel : bool
        Whether to make the accelerometer axes too (they are where an effect needs them).

    """
    n, dt = int(hours * 3600 * rate_hz), 1 / rate_hz
    names = GYRO + (ACCEL if accel or 'accel_coupling' in effects else ())
    base = {a: draw_sensor(rng, 0.1) if a in ACCEL else dict(sensor or draw_sensor(rng))
            for a in names}
    axes = {a: base_noise(n, dt, base[a], rng) + DEG * rng.uniform(-0.5, 0.5) for a in names}
    if 'accel_z' in axes:
        axes['accel_z'] += 9.80665
    s = Scene(np.arange(n) * dt, dt, rng, base, axes, target)
    hidden, deeds, bystanders, plain = [], [], {}, axes[target]
    for name in sorted(effects, key=lambda e: LAST.get(e, 0)):
        size = float(strength) if np.isscalar(strength) else s.log_uniform(*strength)
        done, deed = _hide(s, name, size)
        hidden.append(done)
        deeds.append(deed)
        if name == 'shared_noise':
            bystanders[GYRO[int(hidden[-1].values['source'])]] = name
        if name in COMMON:
            for a in set(names) - {target}:
                axes[a] = deed.act(axes[a])
                bystanders[a] = name
    if len(deeds) > 1:
        hidden = [replace(h, beside=nats_beside(i, deeds, plain, base[target], dt))
                  if deeds[i].added is not None and h.name not in ('spikes', 'shock') else h
                  for i, h in enumerate(hidden)]
    gyro, felt = (np.column_stack([s.axes[a] for a in some]) if some[0] in s.axes else None
                  for some in (GYRO, ACCEL))
    record = ImuRecord(gyro, felt, s.t, rate_hz, covariates=s.covariates)
    found = {a: tuple(hidden) if a == target else () for a in names}
    return record, Truth(base, found, bystanders)


def narrow_band(rng, n, dt, frequency, width, kind):
    """Return samples (n,) of rms 1 of a resonance, or of a line whose phase wanders as far."""
    if kind == 'resonance':
        r = np.exp(-np.pi * width * dt)
        turn = [1, -2 * r * np.cos(2 * np.pi * frequency * dt), r * r]
        band = lfilter([1], turn, rng.standard_normal(4 * n))[-n:]
    else:
        phase = np.sqrt(2 * np.pi * width * dt) * np.cumsum(rng.standard_normal(n))
        band = np.sin(2 * np.pi * frequency * dt * np.arange(n) + phase + rng.uniform(0, 7))
    return band / np.std(band)
