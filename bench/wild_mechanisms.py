# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Imperfect IMU records made from the physics, to judge the loop with.

It shares no code with the package.  A record is *planned* (a sensor grade, a rate, a duration,
hidden effects with their parameters) from one seed and then *realised* (noise drawn).  ``second``
realises the same plan once more with new noise. All effects are mechanisms in the time domain:
traps that relax, telegraphs with exponential dwells, resonators driven by noise, filters run over
samples, counts that are rounded. Paths which belong to the plan (temperature, knocks, steps,
stretches of a motor, a chaotic sway) stay the same in ``second``.

The truth of a record says for each hidden effect its name in the library (``outside: ...`` where
there is none), form, parameters, axes, the names that are accepted, and for each axis

* ``strength``: the largest ratio of Allan deviations effect/base over tau <= T/10, or
  ``|var_with/var_base - 1|**0.5`` for an effect that does not add;
* ``clear``: the expected log-likelihood gain, in nats, of a perfect method told the true model
  over the base model (white, flicker, random walk) refitted, all *other* hidden effects taken as
  known:

  - spectra (narrowband, gauss_markov, low_pass, angle quantization, flicker or random walk
    missing, power laws ...): sum over the n - 1 ordinates of the cosine transform, f = k/(2T), of
    1/2 (E/S_fit - 1 - ln(S_true/S_fit)) with E = S_true and S_fit the base refitted by minimising
    it; for noise gated on and off S_true is its mean spectrum, so that the number is a lower
    bound;
  - means (lines, steps, ramps, temperature, knocks, chirps ...): the same sum with S_true the
    noise alone and E = S_true + M_k^2, M_k the transform of the mean: half the generalised least
    squares chi-square (kept as ``chi2_half``), less what the refitted base swallows;
  - shared_noise and accel_coupling: the same with E the whole spectrum of the axis and S_true
    what is left of it when the other axes (or the accelerometer, with its own noise) are known;
  - variance in time: 1/2 sum ln(mean v / v_i), v_i the innovation variance;
  - rts: the larger of its spectrum's gain and that of its path (as a mean), less 1 + ln(dwell /
    time resolution) nats for each switch that has to be found;
  - spikes: n times the Kullback-Leibler distance of the true amplitude distribution of the
    whitened samples from the Gaussian of the same variance (bursts are counted as if isolated: a
    lower bound);
  - duplicates: n times the binary distance between the share of equal neighbours and that which
    the resolution makes by chance;
  - rate_quantization: n ln(step / (sigma/50)): the lattice against an output fine enough.

``bar`` is what ``clear`` has to reach for the verdict to be asked: 36 nats where flicker or
random_walk can imitate the effect, else 18.  For what lies outside, ``distinct`` is the distance
in nats to the nearest of a few simple library forms (ramp, transient, step, slow sine;
Gauss-Markov, angle quantization).

``python3 bench/wild_mechanisms.py`` checks the generator against closed forms (about a minute).
"""
from dataclasses import dataclass, field
import itertools
from typing import Any, Callable, Dict, List, Optional
import zlib

import numpy as np
from scipy import fft, optimize, signal, special

DEG = np.pi / 180.0
GRAVITY = 9.80665
UG = 1e-6 * GRAVITY
AXES = ('gyro_x', 'gyro_y', 'gyro_z')
BASE = ('white', 'flicker', 'random_walk')

# Gyro N in deg/s/sqrt(Hz), gyro B in deg/h, gyro bias in deg/s; accelerometer N in ug/sqrt(Hz), B
# in ug.
GRADES = {
    'consumer': ((4e-3, 2e-2), (4., 25.), 1.0, (100., 400.), (20., 100.)),
    'industrial': ((1.5e-3, 6e-3), (1.5, 8.), 0.2, (30., 120.), (8., 40.)),
    'tactical': ((6e-4, 3e-3), (0.3, 2.5), 0.02, (10., 50.), (3., 15.)),
    'fibre': ((2e-5, 3e-4), (0.01, 0.2), 4e-3, (3., 20.), (1., 8.)),
    'laser': ((8e-6, 4e-5), (0.002, 0.02), 4e-3, (2., 10.), (0.5, 3.)),
}
IMITABLE = {'ramp', 'transient', 'temperature', 'slow_periodic', 'gauss_markov', 'rts', 'step',
            'flicker',
            'random_walk'}
# At most one effect of each of these families is hidden in one record.
FAMILIES = ({'low_pass'}, {'duplicates', 'rate_quantization', 'quantization'},
            {'gauss_markov', 'rts', 'flicker', 'random_walk'},
            {'ramp', 'transient', 'slow_periodic'},
            {'shared_noise', 'accel_coupling'}, {'spikes', 'shock'})


def _rng(*key):
    """Return a generator for a key of numbers and words."""
    return np.random.default_rng([zlib.crc32(k.encode()) if isinstance(k, str) else int(k)
                                  for k in key])


def _between(rng, low, high):
    """Draw log-uniformly."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


@dataclass
class Hidden:
    """
    One hidden mechanism: how it enters, its unit spectrum or mean, and what may be called right.

    ``how`` is mean, noise, filter, level, shared, coupled, base (a part of the base not fitted),
    spikes, angle, lattice or hold.  Effects that add enter axis i as ``size * gains[i]`` times the
    unit one.
    """

    name: str
    form: str
    how: str
    params: Dict[str, Any]
    accept: set = field(default_factory=set)
    kin: set = field(default_factory=set)
    size: float = 1.0
    gains: Any = (1.0, 0.0, 0.0)
    mean: Optional[Any] = None
    psd: Optional[Any] = None
    draw: Optional[Callable] = None
    level: Optional[Any] = None
    extra: Dict[str, Any] = field(default_factory=dict)
    rivals: tuple = ()

    @property
    def outside(self):
        """Tell whether the library has no name for it."""
        return self.name.startswith('outside')


@dataclass
class Record:
    """A realised record with its truth; ``plan`` lets ``second`` realise it once more."""

    gyro: Any
    accel: Optional[Any]
    t: Optional[Any]
    rate_hz: float
    covariates: Dict[str, Any]
    truth: Dict[str, Any]
    plan: Any

    def arrays(self):
        """Return what an .npz of this record holds."""
        out = {'gyro': self.gyro, **self.covariates}
        if self.accel is not None:
            out['accel'] = self.accel
        out.update({'t': self.t} if self.t is not None else {'rate_hz': self.rate_hz})
        return out


class Bed:
    """The sensor on which effects are laid: grade, sampling, and N, B, K of each axis."""

    def __init__(self, rng, grade=None, rate_hz=None, duration_s=None):
        self.grade = grade or str(rng.choice(list(GRADES), p=[.3, .25, .2, .15, .1]))
        kind = rng.choice(4, p=[.72, .13, .04, .11])
        fs, span = (
            (float(rng.choice([25, 50, 100, 125, 200])), _between(rng, 150, 3600)),
            (float(rng.choice([200, 400, 500, 1000])), _between(rng, 60, 300)),
            (float(rng.choice([2000, 4000])), _between(rng, 60, 75)),
            (10.0, _between(rng, 7200, 86400)))[kind]
        if kind == 0:
            span = min(span, 360000 / fs)
        self.fs = float(rate_hz or fs)
        self.n = fft.next_fast_len(int(round((duration_s or span) * self.fs)), real=True)
        self.dt = 1 / self.fs
        self.span = self.n * self.dt
        self.time = np.arange(self.n) * self.dt
        gn, gb, self.bias, an, ab = GRADES[self.grade]
        n0, b0 = _between(rng, *gn) * DEG, _between(rng, *gb) * DEG / 3600
        a0, c0 = _between(rng, *an) * UG, _between(rng, *ab) * UG
        self.base, self.accel_base = [], []
        for out, (white, flick) in ((self.base, (n0, b0)), (self.accel_base, (a0, c0))):
            for _ in range(3):
                b = flick * _between(rng, .8, 1.25)
                # Where the random walk passes the flicker floor.
                knee = _between(rng, 300, 20000)
                out.append([white * _between(rng, .85, 1.18), b,
                            np.sqrt(3 / knee * 2 * np.log(2) / np.pi) * b])
        self.fit = [0, 1, 2]
        self.f = np.arange(self.n) * self.fs / (2 * self.n)
        self.f[0] = self.f[1]
        s = 2 * np.sin(np.pi * self.f * self.dt)
        self.columns = np.array([np.ones(self.n), self.dt / s, (self.dt / s) ** 2])
        edges = np.unique(np.round(np.geomspace(1, self.n, 260)).astype(int))
        self.edges, self.counts = edges[:-1], np.diff(edges).astype(float)
        self.steps = 2 ** np.arange(int(np.log2(max(2, self.n / 10))) + 1)
        self.folded = None

    def spectrum(self, axis):
        """Return the base spectrum of an axis at the ordinates of the cosine transform."""
        return np.square(self.base[axis]) @ self.columns

    def sigma(self, axis=0):
        """Return the standard deviation of the white noise of a sample."""
        return self.base[axis][0] * np.sqrt(self.fs)

    def binned(self, x):
        """Return the means of x over bins that are even in ln f."""
        return np.add.reduceat(x, self.edges) / self.counts

    def allan_base(self, axis):
        """Return the base Allan variance at ``steps`` (sampled; flicker's for large m)."""
        n, b, k = self.base[axis]
        tau = self.steps * self.dt
        walk = k ** 2 * tau / 3 * (1 + .5 / self.steps ** 2)
        return n ** 2 / tau + 2 * np.log(2) / np.pi * b ** 2 + walk

    def allan_of_psd(self, psd):
        """Return the Allan variance of block means that a two-sided spectrum makes."""
        x = np.pi * self.f * self.dt
        low = np.sin(x) ** 2
        return np.array([np.mean(psd[1:] * (2 * np.sin(m * x) ** 4 / (m * m * low))[1:])
                         for m in self.steps]) * self.fs

    def allan_of_mean(self, mean):
        """Return the Allan variance of a deterministic series."""
        c = np.concatenate([[0], np.cumsum(mean)])
        return np.array([np.mean((c[2 * m:] - 2 * c[m:-m] + c[:-2 * m]) ** 2) / (2 * m * m)
                         for m in self.steps])

    def power_of_mean(self, mean):
        """Return the squared cosine transform of a mean, in units of a two-sided spectrum."""
        return fft.dct(mean, norm='ortho') ** 2 * self.dt


# ---------------------------------------------------------------- noise in the time domain

def flicker(rng, n, fs, b, traps=False):
    """
    Draw flicker noise of S = B^2/(2 pi f), two-sided.

    Either the sum of relaxation traps even in ln(rate), each a stationary AR(1) of variance
    B^2 ln(q)/pi, or white noise through (1 - 1/z)^(-1/2) on a stretch four times as long.
    """
    if traps:
        q = np.exp(.75)
        count = int(np.log(2.9 * fs / (.05 * fs / n)) / .75) + 1
        rates = 2.9 * fs * q ** -(np.arange(count) + .5)
        x = np.zeros(n)
        for rate in rates:
            phi = np.exp(-rate / fs)
            e = rng.standard_normal(n)
            x += signal.lfilter([np.sqrt(1 - phi * phi)], [1, -phi], e,
                                zi=[phi * rng.standard_normal()])[0]
        return x * b * np.sqrt(.75 / np.pi)
    return _shaped(rng, n, lambda w: b * np.sqrt(1 / (2 * np.sin(w / 2))))


def _shaped(rng, n, gain):
    """Draw noise of the amplitude gain(w), w in rad/sample, as a cut from 4n samples."""
    m = fft.next_fast_len(4 * n, real=True)
    spectrum = fft.rfft(rng.standard_normal(m))
    spectrum[0] = 0
    spectrum[1:] *= gain(2 * np.pi * np.arange(1, len(spectrum)) / m)
    return fft.irfft(spectrum, m)[:n]


class Resonator:
    """
    A mass on a spring driven by white noise, sampled: two conjugate poles, unit variance.

    ``velocity`` puts zeros at 0 and Nyquist (what a rate sensor sees of a swinging mount).
    """

    def __init__(self, f0, q, fs, velocity=False):
        r = np.exp(-np.pi * f0 / (q * fs))
        self.a1, self.a2 = 2 * r * np.cos(2 * np.pi * f0 / fs), -r * r
        self.g0 = (1 - self.a2) / ((1 + self.a2) * ((1 - self.a2) ** 2 - self.a1 ** 2))
        self.rho = self.a1 / (1 - self.a2)
        self.velocity, self.fs = velocity, fs
        rho2 = self.a1 * self.rho + self.a2
        self.var = self.g0 * (2 - 2 * rho2) if velocity else self.g0

    def psd(self, f):
        """Return the exact spectrum of the sampled resonator."""
        z = np.exp(-2j * np.pi * f / self.fs)
        s = 1 / np.abs(1 - self.a1 * z - self.a2 * z * z) ** 2
        if self.velocity:
            s = s * np.abs(1 - z * z) ** 2
        return s / (self.var * self.fs)

    def draw(self, rng, n):
        """Draw n samples, started stationary."""
        g = np.sqrt(self.g0)
        x0 = g * rng.standard_normal()
        x1 = self.rho * x0 + g * np.sqrt(1 - self.rho ** 2) * rng.standard_normal()
        a = [1, -self.a1, -self.a2]
        y = signal.lfilter([1], a, rng.standard_normal(n), zi=signal.lfiltic([1], a, [x1, x0]))[0]
        y = np.concatenate([[x0, x1], y])
        return (y[2:] - y[:-2] if self.velocity else y[2:]) / np.sqrt(self.var)


def relaxation_psd(f, fs, tc):
    """Return the spectrum of a unit-variance process with autocovariance exp(-|t|/tc), sampled."""
    phi = np.exp(-1 / (fs * tc))
    return (1 - phi ** 2) / (1 - 2 * phi * np.cos(2 * np.pi * f / fs) + phi ** 2) / fs


def telegraph(rng, time, dwell_high, dwell_low):
    """Draw a 0/1 telegraph with exponential dwells, started stationary."""
    span = time[-1] + 1
    state = int(rng.random() < dwell_high / (dwell_high + dwell_low))
    count = int(2 * span / (dwell_high + dwell_low) * 1.3 + 60)
    mean = np.where((np.arange(count) + state) % 2 == 1, dwell_high, dwell_low)
    switches = np.cumsum(rng.exponential(mean))
    return ((np.searchsorted(switches, time) + state) % 2).astype(float)


# ---------------------------------------------------------------- how clear an effect is

def refit(bed, wanted, fixed, columns):
    """Return the squares of N, B, K >= 0 that minimise sum(E/S + ln S)/2; inputs are binned."""
    columns = np.asarray(columns)
    scale = np.array([np.quantile(wanted / c, .3) for c in columns])
    scaled = columns * scale[:, None]

    def cost(u):
        e = np.exp(u)
        s = fixed + e @ scaled
        slope = bed.counts * (1 / s - wanted / s ** 2) / 2
        return .5 * bed.counts @ (np.log(s) + wanted / s), e * (scaled @ slope)

    best = None
    for start in itertools.product((0.0, -6.0), repeat=min(2, len(columns) - 1)):
        u0 = np.zeros(len(columns))
        u0[1:1 + len(start)] = start
        for _ in range(30):
            # Multiplicative steps never raise the cost, whatever the start; then the quick search.
            e = np.exp(u0)
            s = fixed + e @ scaled
            u0 += .5 * np.log((scaled @ (bed.counts * wanted / s ** 2))
                              / (scaled @ (bed.counts / s)))
        got = optimize.minimize(cost, u0, jac=True, method='L-BFGS-B',
                                bounds=[(-30, 15)] * len(u0),
                                options={'maxiter': 300, 'ftol': 1e-13, 'gtol': 1e-9})
        if best is None or got.fun < best.fun:
            best = got
    return np.exp(best.x) * scale


def gain_nats(bed, wanted, true, fixed, response, fit, coarse=False, more=()):
    """
    Return the expected gain of the true model over the base refitted.

    ``wanted`` is the expected power of each ordinate, ``true`` the spectrum the true model gives
    the noise, ``fixed`` what else is known to add, ``response`` the known filter after the base.
    """
    columns = [bed.columns[i] * response for i in fit] + list(more)
    small = np.array([bed.binned(c) for c in columns])
    fixed_b, wanted_b = bed.binned(fixed), bed.binned(wanted)
    theta = refit(bed, wanted_b, fixed_b, small)
    if coarse:
        s, true_b = fixed_b + theta @ small, bed.binned(true)
        return float(.5 * bed.counts @ (wanted_b / s - 1 - np.log(true_b / s)))
    s = (fixed + sum(a * c for a, c in zip(theta, columns)))[1:]
    return float(.5 * np.sum(wanted[1:] / s - 1 - np.log(true[1:] / s)))


def rival_gaps(bed, mean, noise):
    """Return how many nats separate a mean from the best of each simple form of mean."""
    blocks = min(bed.n, 2048)
    step = bed.n // blocks
    x = mean[:blocks * step].reshape(blocks, step).mean(1)
    t = (np.arange(blocks) + .5) / blocks
    weight = np.sqrt(bed.dt * step / noise[1:blocks])

    def cosine(v):
        return fft.dct(v, axis=-1, norm='ortho')[..., 1:] * weight

    y = cosine(x)

    def left(forms):
        q, _ = np.linalg.qr(cosine(forms).T)
        return .5 * max(0.0, float(y @ y - np.sum((q.T @ y) ** 2)))

    out = {'ramp': left(t[None])}
    out['transient'] = min(left(np.exp(-t / c)[None]) for c in np.geomspace(.01, 3, 24))
    out['slow_periodic'] = min(left(np.array([np.sin(2 * np.pi * t / p),
                                              np.cos(2 * np.pi * t / p)]))
                               for p in np.geomspace(.1, 2, 60))
    out['step'] = min(left((t > c).astype(float)[None]) for c in np.linspace(.02, .98, 97))
    return out


# ---------------------------------------------------------------- effects of the library

def _spread(rng, chance=.4):
    """Return gains of the three axes: x alone, or all of them, unlike."""
    if rng.random() > chance:
        return np.array([1.0, 0.0, 0.0])
    return np.array([1.0,
                     *(rng.choice([-1, 1], 2) * np.exp(rng.uniform(np.log(.3), np.log(2), 2)))])


def _form(rng, form, forms):
    """Return the form asked for or one of them."""
    return form or str(rng.choice(forms))


def make_sinusoid(rng, bed, form=None, low=20.0):
    """Make a steady line: supply hum, a coil, a crystal's beat."""
    f0, phase = _between(rng, low / bed.span, .48 * bed.fs), rng.uniform(0, 2 * np.pi)
    hidden = Hidden('sinusoid', 'steady', 'mean', {'frequency': f0, 'phase': phase},
                    gains=_spread(rng, .3),
                    mean=np.cos(2 * np.pi * f0 * bed.time + phase))
    if hidden.gains[1]:
        # One source seen on several axes is a shared disturbance as well as a line: both words are
        # true.
        hidden.accept.add('shared_noise')
    return hidden


def make_slow_periodic(rng, bed, form=None):
    """Make air conditioning: a mean of half a cycle to eight cycles, sine or skewed."""
    form = _form(rng, form, ['sine', 'skewed'])
    period, phase = _between(rng, bed.span / 8, 2 * bed.span), rng.uniform(0, 2 * np.pi)
    angle = 2 * np.pi * bed.time / period + phase
    hidden = Hidden('slow_periodic', form, 'mean', {'period': period, 'phase': phase},
                    gains=_spread(rng),
                    mean=np.cos(angle + (.5 * np.sin(angle) if form == 'skewed' else 0)),
                    rivals=('ramp', 'transient'))
    if form == 'sine':
        # The same equation; only the count of cycles divides the names.
        hidden.accept.add('sinusoid')
    return hidden


def make_harmonics(rng, bed, form=None):
    """Make an engine or fan: orders 1 to 8 of one speed, at times folded about Nyquist."""
    form = _form(rng, form, ['engine', 'engine', 'aliased'])
    top = .12 if form == 'engine' else .4
    f0 = rng.uniform(.3, 1) * min(top * bed.fs, 90.0)
    orders = np.array([1, 2, 3])
    while True:
        orders = np.sort(rng.choice(np.arange(1, 9), rng.integers(3, 7), replace=False))
        if np.gcd.reduce(orders) == 1 and (form == 'aliased' or orders[-1] * f0 < .48 * bed.fs):
            break
        f0 *= .98
    amps = np.exp(rng.normal(0, .6, len(orders))) / np.sqrt(orders)
    phases = rng.uniform(0, 2 * np.pi, len(orders))
    mean = np.zeros(bed.n)
    for order, amp, phase in zip(orders, amps, phases):
        mean += amp * np.cos(2 * np.pi * order * f0 * bed.time + phase)
    hidden = Hidden('harmonics', form, 'mean', {'frequency': f0, 'orders': orders.tolist(),
                                                'amplitudes': amps.tolist()},
                    mean=mean, gains=_spread(rng, .3))
    if hidden.gains[1]:
        hidden.accept.add('shared_noise')  # as for a line on several axes
    return hidden


def _stretches(rng, bed, count):
    """Return an on/off gate of a machine that runs now and then, on for a fifth to four fifths."""
    while True:
        marks = np.sort(rng.uniform(0, bed.span, 2 * count))
        duty = np.diff(marks)[::2].sum() / bed.span
        if np.diff(marks).min() > bed.span / (12 * count) and .2 < duty < .8:
            return (np.searchsorted(marks, bed.time) % 2).astype(float), marks


def make_narrowband(rng, bed, form=None):
    """Make a resonance excited by noise or a motor whose speed wanders, steady or on and off."""
    form = _form(rng, form,
                 ['resonance', 'resonance', 'resonance on_off', 'motor', 'motor on_off'])
    params, gate = {}, None
    if 'on_off' in form:
        gate, marks = _stretches(rng, bed, int(rng.integers(1, 5)))
        params['marks'] = marks.tolist()
    duty = 1.0 if gate is None else gate.mean()
    if form.startswith('resonance'):
        q = _between(rng, 5, min(3000, .06 * bed.n))
        f0 = _between(rng, max(.01 * bed.fs, 2.5 * q / bed.span, .2), .45 * bed.fs)
        res = Resonator(f0, q, bed.fs, rng.random() < .5)
        params.update(frequency=f0, q=q, width=f0 / q, velocity=res.velocity)
        psd = res.psd(bed.f) * duty

        def draw(rng, n):
            x = res.draw(rng, n)
            return x if gate is None else x * gate
    else:
        tc = _between(rng, 4, max(5, bed.span / 15))
        f0 = rng.uniform(.08, .4) * bed.fs
        sd = max(_between(rng, .002, .02) * f0, 1.5 / (2 * np.pi * tc))
        sd = min(sd, .02 * bed.fs)
        params.update(frequency=f0, wander=sd, tc=tc)
        gauss = np.exp(-.5 * ((bed.f - f0) / sd) ** 2) / (sd * np.sqrt(2 * np.pi))
        psd = .5 * gauss * duty + 1e-12 / bed.fs

        def draw(rng, n):
            phi = np.exp(-1 / (tc * bed.fs))
            e = rng.standard_normal(n) * np.sqrt(1 - phi * phi)
            speed = signal.lfilter([1], [1, -phi], e, zi=[phi * rng.standard_normal()])[0]
            x = np.sqrt(2) * np.cos(2 * np.pi * np.cumsum(f0 + sd * speed) / bed.fs
                                    + rng.uniform(0, 2 * np.pi))
            return x if gate is None else x * gate
    hidden = Hidden('narrowband', form, 'noise', params, psd=psd, draw=draw,
                    gains=_spread(rng, .2))
    if gate is not None:
        # A line that is on and off is narrowband and is a change of variance in time: both are
        # true.
        hidden.accept.add('variance_change')
    elif 'q' in params and params['width'] * bed.span < 3:
        hidden.accept.add('sinusoid')      # narrower than the record resolves
    return hidden


def make_low_pass(rng, bed, form=None):
    """Make the bandwidth of the sensor, of five kinds."""
    form = _form(rng, form, ['first', 'second', 'average', 'folded', 'notch'])
    z = np.exp(-2j * np.pi * bed.f / bed.fs)
    extra, params = {}, {}
    if form == 'first':
        fc = bed.fs * _between(rng, .02, .4)
        a = np.exp(-2 * np.pi * fc / bed.fs)
        extra['ba'] = ([1 - a], [1, -a])
    elif form == 'second':
        fc = bed.fs * _between(rng, .02, .45)
        extra['ba'] = signal.butter(2, 2 * fc / bed.fs)
    elif form == 'average':
        m = int(round(_between(rng, 2, 24)))
        fc = .443 * bed.fs / m
        params['samples'] = m
        extra['ba'] = (np.ones(m) / m, [1.0])
    elif form == 'notch':
        fc, q = bed.fs * rng.uniform(.05, .42), _between(rng, .7, 5)
        params['q'] = q = max(q, fc / (.4 * bed.fs))     # one of half the rate is not stable
        extra['ba'] = signal.iirnotch(fc, q, fs=bed.fs)
    else:
        fast = int(rng.integers(3, 9))
        length = int(round(fast * rng.uniform(1.4, 5)))
        params.update(internal=fast, samples=length)
        fc = .443 * bed.fs * fast / length
        h2 = np.zeros(bed.n)
        for j in range(fast):
            x = np.pi * (bed.f + j * bed.fs) / (fast * bed.fs)
            h2 += (np.sin(length * x) / (length * np.sin(x))) ** 2
        extra.update(fast=fast, length=length)
    if form != 'folded':
        b, a = extra['ba']
        h2 = np.abs(np.polyval(b[::-1], z) / np.polyval(np.asarray(a)[::-1], z)) ** 2
    extra['response'] = h2
    # The electronics behind the filter hiss a little: no null of a spectrum is empty.
    params['pedestal'] = extra['pedestal'] = _between(rng, .02, .12)
    return Hidden('low_pass', form, 'filter', {'cutoff': fc, **params}, extra=extra,
                  accept={'notch'} if form == 'notch' else set(), gains=_spread(rng, 1))


def make_spikes(rng, bed, form=None):
    """Make outliers: alone, in bursts, or as Student's t tails of the noise itself."""
    form = _form(rng, form, ['isolated', 'bursts', 'student'])
    if form == 'student':
        params = {'nu': float(rng.uniform(3, 8))}
    else:
        share = _between(rng, max(2e-5, 15 / bed.n), .02)
        low = rng.uniform(5, 15)
        params = {'share': share, 'sigmas': [low, rng.uniform(low + 1, 30)],
                  'burst': int(rng.integers(2, 10)) if form == 'bursts' else 1}
    return Hidden('spikes', form, 'spikes', params, gains=(_spread(rng) != 0).astype(float))


def make_shock(rng, bed, form=None):
    """Make a few knocks, each ringing down, seen by all axes and the accelerometer."""
    count = int(rng.integers(1, 7))
    times = np.sort(rng.uniform(.02, .98, count)) * bed.span
    decay = max(_between(rng, .03, .6), 4 * bed.dt)
    ring = rng.uniform(.05, .4) * min(bed.fs, 300.0)
    mean = np.zeros(bed.n)
    for at in times:
        i = int(at * bed.fs)
        t = np.arange(min(bed.n - i, int(12 * decay * bed.fs))) * bed.dt
        size = _between(rng, .5, 2)
        mean[i:i + len(t)] += size * np.exp(-t / decay) * np.cos(2 * np.pi * ring * t)
    return Hidden('shock', 'one' if count == 1 else 'several', 'mean',
                  {'times': times.tolist(), 'decay': decay, 'ring': ring}, mean=mean,
                  gains=_spread(rng, 1))


def make_step(rng, bed, form=None):
    """Make a bias that jumps: once, several times up and down, or there and back."""
    form = _form(rng, form, ['one', 'several', 'pulse'])
    count = {'one': 1, 'several': int(rng.integers(3, 5)), 'pulse': 2}[form]
    while True:
        times = np.sort(rng.uniform(.08, .92, count)) * bed.span
        if count == 1 or np.diff(times).min() > .06 * bed.span:
            break
    sizes = rng.choice([-1, 1], count) * np.exp(rng.uniform(np.log(.5), np.log(1.5), count))
    if form == 'pulse':
        sizes = np.array([1.0, -1.0])
    mean = np.concatenate([[0], np.cumsum(sizes)])[np.searchsorted(times, bed.time)]
    return Hidden('step', form, 'mean', {'times': times.tolist(), 'sizes': sizes.tolist()},
                  mean=mean,
                  gains=_spread(rng))


def make_variance_change(rng, bed, form=None):
    """Make white noise whose level steps, drifts, beats, or is higher while something runs."""
    form = _form(rng, form, ['step', 'drift', 'periodic', 'on_off'])
    factor = 1 + _between(rng, .03, 1.5)
    u = bed.time / bed.span
    params = {'factor': factor}
    if form == 'step':
        params['time'] = rng.uniform(.1, .9) * bed.span
        level = np.where(bed.time > params['time'], factor, 1.0)
    elif form == 'drift':
        level = factor ** u
    elif form == 'periodic':
        params['period'] = _between(rng, .04, .6) * bed.span
        angle = 2 * np.pi * bed.time / params['period'] + rng.uniform(0, 2 * np.pi)
        level = factor ** (.5 * np.sin(angle))
    else:
        gate, marks = _stretches(rng, bed, int(rng.integers(2, 7)))
        params['marks'] = marks.tolist()
        level = 1 + (factor - 1) * gate
    if rng.random() < .5:
        level = 1 / level
    return Hidden('variance_change', form, 'level', params, level=level,
                  gains=(_spread(rng) != 0).astype(float))


def temperature_course(rng, bed):
    """Return coarse times and a temperature: weather, warm-up, a heater with hysteresis."""
    m = 4000
    t = np.linspace(-.3, 1, m) * bed.span
    step = t[1] - t[0]
    phi = np.exp(-step / (bed.span * rng.uniform(.05, .3)))
    weather = signal.lfilter([np.sqrt(1 - phi * phi)], [1, -phi], rng.standard_normal(m))
    weather = np.convolve(weather, np.ones(41) / 41, 'same')
    warm = -np.exp(-(t - t[0]) / (bed.span * rng.uniform(.1, .6)))
    tau, temp, heating = bed.span * _between(rng, .02, .15), 0.0, True
    heater = np.empty(m)
    for i in range(m):
        temp += ((1.6 if heating else 0.0) - temp) * (1 - np.exp(-step / tau))
        heating = temp < 1 if heating else temp < .6
        heater[i] = temp
    parts = [rng.uniform(.3, 1) * weather, rng.uniform(0, 2) * warm, rng.uniform(.3, 2) * heater]
    total = sum(parts) + rng.uniform(-.6, .6) * t / bed.span
    inside = total[t >= 0]
    return t, (total - inside.min()) / np.ptp(inside)


def thermometer(rng, bed, t, course, swing):
    """Return what a coarse, slow thermometer logs of a course."""
    lsb = min(float(rng.choice([.0625, .125, .25, .5])), swing / 8)
    lag, every = rng.uniform(1, 15), _between(rng, .05, 2)
    step = t[1] - t[0]
    a = np.exp(-step / lag)
    slow = signal.lfilter([1 - a], [1, -a], course, zi=[a * course[0]])[0]
    at = np.floor(bed.time / every) * every
    reading = rng.uniform(18, 45) + swing * np.interp(at, t, slow)
    ticks = (at / every).astype(int)
    reading = reading + rng.normal(0, .3 * lsb, ticks[-1] + 1)[ticks]
    return np.round(reading / lsb) * lsb


def make_temperature(rng, bed, form=None):
    """Make a bias that follows the temperature: straight, curved, or late."""
    form = _form(rng, form, ['linear', 'quadratic', 'cubic', 'lagged'])
    t, course = temperature_course(rng, bed)
    swing = _between(rng, 1, 20)
    params: Dict[str, Any] = {'swing': swing}
    u = course
    if form == 'lagged':
        params['lag'] = bed.span * _between(rng, .01, .1)
        a = np.exp(-(t[1] - t[0]) / params['lag'])
        u = signal.lfilter([1 - a], [1, -a], course, zi=[a * course[0]])[0]
    mean = np.interp(bed.time, t, u)
    if form == 'quadratic':
        mean = mean + rng.choice([-1, 1]) * rng.uniform(.6, 2) * mean ** 2
    elif form == 'cubic':
        v = 2 * mean - 1
        first, second_, sign = rng.uniform(-1, 1), rng.uniform(-1, 1), rng.choice([-1, 1])
        mean = first * v + second_ * v ** 2 + sign * 1.5 * v ** 3
    return Hidden('temperature', form, 'mean', params, mean=mean, gains=_spread(rng, 1),
                  extra={'temperature': thermometer(rng, bed, t, course, swing)})


def make_ramp(rng, bed, form=None):
    """Make a bias that grows with time."""
    return Hidden('ramp', 'linear', 'mean', {}, mean=bed.time / bed.span, gains=_spread(rng, .7))


def make_transient(rng, bed, form=None):
    """Make a warm-up that relaxes exponentially."""
    tc = bed.span * _between(rng, .03, .5)
    return Hidden('transient', 'exponential', 'mean', {'tc': tc}, mean=np.exp(-bed.time / tc),
                  gains=_spread(rng, .7), rivals=('ramp',))


def make_gauss_markov(rng, bed, form=None):
    """Make a first-order relaxation driven by noise."""
    tc = _between(rng, 4 * bed.dt, bed.span / 10)
    phi = np.exp(-bed.dt / tc)

    def draw(rng, n):
        e = rng.standard_normal(n) * np.sqrt(1 - phi * phi)
        return signal.lfilter([1], [1, -phi], e, zi=[phi * rng.standard_normal()])[0]
    return Hidden('gauss_markov', 'first order', 'noise', {'tc': tc},
                  psd=relaxation_psd(bed.f, bed.fs, tc),
                  draw=draw, gains=_spread(rng))


def make_rts(rng, bed, form=None):
    """Make popcorn noise: one trap, two levels, exponential dwells."""
    form = _form(rng, form, ['symmetric', 'asymmetric'])
    dwell = _between(rng, 4 * bed.dt, bed.span / 10)
    ratio = 1.0 if form == 'symmetric' else _between(rng, 1.5, 5)
    high, low = dwell * np.sqrt(ratio), dwell / np.sqrt(ratio)
    share = high / (high + low)
    tc = 1 / (1 / high + 1 / low)

    def draw(rng, n):
        return telegraph(rng, bed.time, high, low) - share
    return Hidden('rts', form, 'noise', {'dwell_high': high, 'dwell_low': low, 'tc': tc},
                  draw=draw,
                  psd=share * (1 - share) * relaxation_psd(bed.f, bed.fs, tc), gains=_spread(rng),
                  extra={'cycle': high + low})


def make_flicker(rng, bed, form=None):
    """Make flicker that is there while the base model has none."""
    floor = _between(rng, 20 * bed.dt, bed.span / 40)      # tau where it passes the white noise
    for axis in range(3):
        bed.base[axis][1] = bed.base[axis][0] / np.sqrt(floor * 2 * np.log(2) / np.pi)
        bed.base[axis][2] = bed.base[axis][1] * np.sqrt(3 / bed.span) * _between(rng, .05, .6)
    bed.fit.remove(1)
    return Hidden('flicker', 'missing', 'base', {}, gains=np.ones(3), extra={'part': 1})


def make_random_walk(rng, bed, form=None):
    """Make random walk that is there while the base model has none."""
    knee = _between(rng, 100 * bed.dt, bed.span / 8)
    for axis in range(3):
        bed.base[axis][2] = bed.base[axis][0] * np.sqrt(3) / knee
        bed.base[axis][1] = min(bed.base[axis][1], bed.base[axis][0] / np.sqrt(knee))
    bed.fit.remove(2)
    return Hidden('random_walk', 'missing', 'base', {}, gains=np.ones(3), extra={'part': 2})


def make_quantization(rng, bed, form=None):
    """
    Make an angle that is rounded and differenced.

    'counts' gives out the whole counts of a pulse output; 'stripped' adds the differenced rounding
    error to a finely resolved rate, as where a dither is taken out again.
    """
    ratio = _between(rng, .1, 200)                          # (count^2 fs)/N^2
    form = _form(rng, form, ['counts', 'stripped'])
    if form == 'counts':
        ratio = min(ratio, 8 * rng.uniform(.3, 1))          # the noise must dither the counter
    count = np.sqrt(ratio / bed.fs) * bed.base[0][0]
    hidden = Hidden('quantization', form, 'angle', {'Q': count / np.sqrt(12), 'count': count},
                    gains=np.ones(3),
                    psd=(4 * count ** 2 / 12 * bed.fs) * np.sin(np.pi * bed.f * bed.dt) ** 2)
    sigma_out = np.sqrt(bed.sigma() ** 2 + (count * bed.fs) ** 2 / 6)
    if form == 'counts' and count * bed.fs > .5 * sigma_out:
        # Whole counts are a coarse output as well: both are true.
        hidden.accept.add('rate_quantization')
    return hidden


def make_rate_quantization(rng, bed, form=None):
    """Make an output resolution of the size of the noise."""
    ratio = _between(rng, .6, 3)
    return Hidden('rate_quantization', 'coarse', 'lattice',
                  {'step': ratio * bed.sigma(), 'ratio': ratio},
                  gains=np.ones(3))


def make_duplicates(rng, bed, form=None):
    """
    Make held samples: now and then, in runs, or a slower sensor read too often.

    A bed is that of the sensor, filters and all: what reads it faster, by a clock of its own, only
    repeats what was measured last.

    """
    form = _form(rng, form, ['random', 'runs', 'slower'])
    params = {'random': lambda: {'share': _between(rng, .005, .4)},
              'runs': lambda: {'share': _between(rng, .005, .2), 'run': int(rng.integers(3, 12))},
              'slower': lambda: {'ratio': float(rng.uniform(.3, .95))}}[form]()
    return Hidden('duplicates', form, 'hold', params, gains=np.ones(3))


def make_shared_noise(rng, bed, form=None):
    """Make one source that enters several axes, with a gain and a phase for each."""
    form = _form(rng, form, ['white', 'relaxing', 'resonance'])
    params: Dict[str, Any] = {}
    if form == 'white':
        psd = np.full(bed.n, 1 / bed.fs)

        def draw(rng, n):
            return rng.standard_normal(n)
    elif form == 'relaxing':
        params['tc'] = tc = _between(rng, 3 * bed.dt, bed.span / 100)
        phi = np.exp(-bed.dt / tc)
        psd = relaxation_psd(bed.f, bed.fs, tc)

        def draw(rng, n):
            e = rng.standard_normal(n) * np.sqrt(1 - phi * phi)
            return signal.lfilter([1], [1, -phi], e, zi=[phi * rng.standard_normal()])[0]
    else:
        f0, q = _between(rng, .02, .42) * bed.fs, _between(rng, 3, 60)
        params.update(frequency=f0, q=q)
        res = Resonator(f0, q, bed.fs, True)
        psd, draw = res.psd(bed.f), res.draw
    gains = np.array([1.0, *(rng.choice([-1, 1], 2) * rng.uniform(.5, 1.6, 2))])
    params['phases'] = [0.0, *rng.uniform(-np.pi, np.pi, 2).tolist()]
    if rng.random() < .4:
        params['phases'] = [0.0, 0.0, 0.0]
    return Hidden('shared_noise', form, 'shared', params, psd=psd, draw=draw, gains=gains)


def make_accel_coupling(rng, bed, form=None):
    """Make a gyroscope that feels acceleration: a swaying building or a vibrating mount."""
    form = _form(rng, form, ['sway', 'vibration'])
    if form == 'sway':
        f0, q = _between(rng, max(.1, 30 / bed.span), 1.2), _between(rng, 3, 15)
        rms = _between(rng, 20, 200) * bed.accel_base[0][0] * np.sqrt(f0)
    else:
        f0, q = _between(rng, .05, .4) * bed.fs, _between(rng, 2, 15)
        rms = _between(rng, 3, 30) * bed.accel_base[0][0] * np.sqrt(bed.fs)
    swings = [Resonator(f0 * _between(rng, .8, 1.15), q, bed.fs, True) for _ in range(3)]
    sizes = rms * np.exp(rng.uniform(np.log(.4), 0, 3))
    matrix = rng.normal(0, 1, (3, 3)) / rms
    motion = np.array([s * s * r.psd(bed.f) for s, r in zip(sizes, swings)])
    return Hidden('accel_coupling', form, 'coupled', {'frequency': f0, 'q': q, 'rms': rms},
                  gains=np.ones(3),
                  psd=(matrix[0] ** 2) @ motion,
                  extra={'swings': swings, 'sizes': sizes, 'matrix': matrix, 'motion': motion})


# ---------------------------------------------------------------- shapes outside the library

def _outside(word, how, rng, params=None, **more):
    return Hidden('outside: ' + word, word, how, params or {}, gains=_spread(rng, .3), **more)


def _coloured(rng, bed, word, psd_of, params=None):
    """Make a noise of any spectrum, psd_of(f) in units per Hz."""
    scale = psd_of(bed.f)
    top = scale.max()

    def draw(rng, n):
        return _shaped(rng, n, lambda w: np.sqrt(psd_of(w / (2 * np.pi) * bed.fs) / top * bed.fs))
    return _outside(word, 'noise', rng, params, psd=scale / top, draw=draw)


def out_chirp(rng, bed):
    """Make a line that sweeps through the record, once."""
    f1, f2 = rng.permutation([_between(rng, .01, .08), _between(rng, .15, .45)]) * bed.fs
    method = str(rng.choice(['linear', 'logarithmic']))
    return _outside('chirp', 'mean', rng, {'f1': f1, 'f2': f2, 'method': method},
                    mean=signal.chirp(bed.time, f1, bed.span, f2, method))


def out_power_law(rng, bed):
    """Make a noise between the colours of the library."""
    power = float(rng.choice([.5, .7, 1.4, 1.5]))
    return _coloured(rng, bed, 'power law', lambda f: f ** -power, {'power': power})


def out_cube(rng, bed):
    """Make a wander of 1/f^3, level below one cycle in two records."""
    low = .5 / bed.span
    return _coloured(rng, bed, 'cube', lambda f: (f ** 2 + low ** 2) ** -1.5)


def out_matern(rng, bed):
    """Make a noise with a knee steeper or softer than a relaxation's."""
    fc, power = _between(rng, 20 / bed.span, .1 * bed.fs), float(rng.choice([.6, 2.0, 3.0]))
    return _coloured(rng, bed, 'matern', lambda f: (1 + (f / fc) ** 2) ** -power,
                     {'fc': fc, 'power': power})


def out_blue(rng, bed):
    """Make a noise that rises with f."""
    power = float(rng.choice([.7, 1.0, 1.3]))
    return _coloured(rng, bed, 'blue', lambda f: f ** power, {'power': power})


def out_humps(rng, bed):
    """Make a broad vibration: many wide humps."""
    count = int(rng.integers(4, 9))
    centres = bed.fs * np.exp(rng.uniform(np.log(.01), np.log(.45), count))
    widths, heights = rng.uniform(.15, .5, count), np.exp(rng.normal(0, .7, count))

    def psd(f):
        return sum(h * np.exp(-.5 * (np.log(f / c) / w) ** 2)
                   for c, w, h in zip(centres, widths, heights)) + 1e-9
    return _coloured(rng, bed, 'humps', psd,
                     {'centres': centres.tolist(), 'widths': widths.tolist()})


def out_plateau(rng, bed):
    """Make a band of noise with steep edges."""
    low = _between(rng, .01, .15) * bed.fs
    high = min(low * rng.uniform(2, 5), .45 * bed.fs)
    return _coloured(rng, bed, 'plateau',
                     lambda f: 1 / (1 + (low / f) ** 12 + (f / high) ** 12) + 1e-9,
                     {'low': low, 'high': high})


def out_parabola(rng, bed):
    """Make a mean that bends there and back, or flattens at both ends."""
    u = 2 * bed.time / bed.span - 1 + rng.uniform(-.3, .3)
    power = int(rng.integers(2, 5))
    return _outside('parabola', 'mean', rng, {'power': power},
                    mean=np.abs(u) ** power * np.sign(u) ** power,
                    kin={'transient'} | ({'drift'} if power == 2 else set()))


def out_creep(rng, bed):
    """Make a settling with the logarithm of time."""
    t0 = bed.span * _between(rng, 3e-4, 3e-3)
    return _outside('creep', 'mean', rng, {'t0': t0}, mean=-np.log1p(bed.time / t0),
                    kin={'transient'})


def out_lorenz(rng, bed):
    """Make a mean that sways chaotically, the slow convection of Lorenz."""
    count, step = int(rng.integers(1500, 6000)), .01
    p = rng.normal(0, 5, 3) + [0, 0, 25]

    def speed(p):
        return np.array([10 * (p[1] - p[0]), p[0] * (28 - p[2]) - p[1],
                         p[0] * p[1] - 8 / 3 * p[2]])
    path = np.empty(count)
    for i in range(-300, count):
        k1 = speed(p)
        k2 = speed(p + step / 2 * k1)
        k3 = speed(p + step / 2 * k2)
        p = p + step / 6 * (k1 + 2 * k2 + 2 * k3 + speed(p + step * k3))
        if i >= 0:
            path[i] = p[0]
    return _outside('lorenz', 'mean', rng, {'units': count * step},
                    mean=np.interp(bed.time, np.linspace(0, bed.span, count), path / 8))


def out_bistable(rng, bed):
    """Make a drift in two unequal wells, kicked by noise with memory."""
    count = 6000
    kick = signal.lfilter([.3], [1, -.97], rng.standard_normal(count)) * rng.uniform(.8, 1.3)
    tilt, x, step = rng.uniform(.1, .3), -1.0, .05
    path = np.empty(count)
    for i in range(count):
        x += step * (x - x ** 3 + tilt + kick[i])
        path[i] = x
    return _outside('bistable', 'mean', rng, {'tilt': tilt}, kin={'rts', 'step'},
                    mean=np.interp(bed.time, np.linspace(0, bed.span, count), path))


def _level(rng, bed, word, level):
    return _outside(word, 'level', rng, {'ratio': float(level.max() / level.min())}, level=level,
                    kin={'variance_change'})


def out_variance_telegraph(rng, bed):
    """Make white noise of three levels that come and go by chance, with a drift on top."""
    dwell = bed.span * _between(rng, .01, .06)
    both = telegraph(rng, bed.time, dwell, 2 * dwell) + telegraph(rng, bed.time, dwell / 3, dwell)
    return _level(rng, bed, 'variance telegraph',
                  np.exp(rng.uniform(.15, .6) * both + rng.choice([-1, 1]) * .5 * bed.time
                         / bed.span))


def out_multiplicative(rng, bed):
    """Make noise multiplied by a slow log-normal process."""
    phi = np.exp(-1 / (1000 * _between(rng, .005, .05)))
    slow = signal.lfilter([np.sqrt(1 - phi * phi)], [1, -phi], rng.standard_normal(2000))[1000:]
    return _level(rng, bed, 'multiplicative', np.exp(
        rng.uniform(.1, .6) * np.interp(bed.time, np.linspace(0, bed.span, 1000), slow)))


def out_skirts(rng, bed):
    """Make a wide hollow in the spectrum between raised skirts, through a filter without phase."""
    f0, width, depth = bed.fs * _between(rng, .02, .3), rng.uniform(.3, .7), rng.uniform(.4, .95)

    def h2(f):
        u = np.log(np.maximum(f, 1e-9) / f0) / width
        return 1 - depth * np.exp(-u ** 2) + .5 * depth * (np.exp(-(u - 2) ** 2)
                                                           + np.exp(-(u + 2) ** 2))
    return _outside('skirts', 'filter', rng, {'frequency': f0, 'depth': depth},
                    extra={'response': h2(bed.f), 'h2': h2}, kin={'low_pass'})


def out_fm_line(rng, bed):
    """
    Make a line that is swung to and fro in frequency, slowly and far.

    By a sine, so that it is lines a swing apart (Bessel's), where they can be told apart.
    """
    f0, slow = rng.uniform(.1, .38) * bed.fs, rng.uniform(3, 12) / bed.span
    swing = rng.uniform(.03, .2) * f0
    return _outside('fm line', 'mean', rng, {'frequency': f0, 'swing': swing, 'slow': slow},
                    mean=np.cos(2 * np.pi * f0 * bed.time + swing / slow * np.sin(
                        2 * np.pi * slow * bed.time + rng.uniform(0, 6))),
                    kin={'narrowband', 'sinusoid', 'band'})


MAKERS = {name[5:]: make for name, make in list(globals().items()) if name.startswith('make_')}
OUTSIDE = {name[4:]: make for name, make in list(globals().items()) if name.startswith('out_')}


# ---------------------------------------------------------------- planning

class Plan:
    """What a record will be: the bed, the hidden effects at their sizes, and the truth."""

    def __init__(self, seed, kind, names, rng, bed, target=None):
        self.seed, self.kind, self.bed = int(seed), kind, bed
        self.hidden: List[Hidden] = []
        for name in names:
            word, _, form = name.partition('/')
            if word == 'outside':
                make = OUTSIDE[form or str(rng.choice(list(OUTSIDE)))]
                hidden = make(rng, bed)
            else:
                hidden = MAKERS[word](rng, bed, form or None)
            self.hidden.append(hidden)
        for hidden in self.hidden:
            if hidden.how in ('mean', 'noise', 'shared', 'coupled'):
                self._scale(rng, hidden, target)
        self.traps = bool(rng.random() < .25)
        self.has_accel = bool(rng.random() < .9) or any(
            h.how == 'coupled' or h.name == 'shock' for h in self.hidden)
        self.jitter = _between(rng, .002, .02) if rng.random() < .4 else 0.0
        self.covariates = {}
        for h in self.hidden:
            if 'temperature' in h.extra:
                self.covariates['temperature'] = h.extra['temperature']
        if not self.covariates and rng.random() < .2:
            t, course = temperature_course(rng, bed)
            self.covariates['temperature'] = thermometer(rng, bed, t, course, _between(rng, 1, 8))
        self.fine = float(rng.uniform(.004, .1)) if rng.random() < .75 else 0.0
        self.lsb = [0.0] * 3
        self.bias = rng.normal(0, bed.bias * DEG, 3)
        self.accel_bias = rng.normal(0, 300 * bed.accel_base[0][1], 3)
        self.tilt = rng.normal(0, .005, 2)
        self.whole: List[Any] = []
        self.truth = self._truth()

    def _scale(self, rng, hidden, target):
        """Give an effect that adds its size, by its strength or by its gain in nats."""
        bed, base = self.bed, self.bed.spectrum(0)
        power = bed.power_of_mean(hidden.mean) if hidden.how == 'mean' else hidden.psd
        slow = hidden.name in IMITABLE
        if hidden.outside:
            target = target or _between(rng, 300, 10000)
        elif target is None and rng.random() < .5:
            target = _between(rng, 8, 300 if slow else 5000)
        strength = _between(rng, .4, 20 if slow and hidden.how == 'mean' else 8)
        own = bed.allan_of_mean(hidden.mean) if hidden.how == 'mean' else bed.allan_of_psd(power)
        unit = np.sqrt(np.max(own / bed.allan_base(0)))
        hidden.size = strength / unit
        if target is None:
            return
        zero, one = np.zeros(bed.n), np.ones(bed.n)

        def nats(u):
            wanted = base + np.exp(2 * u) * power
            if hidden.how == 'mean':
                return gain_nats(bed, wanted, base, zero, one, bed.fit, True)
            if hidden.how == 'noise' and hidden.name != 'narrowband':
                return gain_nats(bed, wanted, wanted, zero, one, bed.fit, True)
            true = wanted
            if hidden.how in ('shared', 'coupled'):
                true = self._conditional(hidden, 0, np.exp(2 * u), wanted,
                                         [bed.spectrum(i) for i in range(3)])
            return gain_nats(bed, wanted, true, zero, one, bed.fit)
        start = .5 * np.log(np.median(base) / power[1:].max())
        low, high = start - 9, start + 9
        for _ in range(15):
            middle = (low + high) / 2
            low, high = (middle, high) if nats(middle) < target else (low, middle)
        # What a refitted random walk swallows has no size that gains so much: thirty times is
        # enough.
        hidden.size = float(min(np.exp((low + high) / 2), (100 if hidden.outside else 30) / unit))

    def _conditional(self, h, axis, size2, whole, others):
        """Return what is left of a spectrum once the other axes or the accelerometer are known."""
        bed = self.bed
        if h.how == 'shared':
            known = 1 / np.maximum(h.psd, 1e-300)
            for i in range(3):
                if i != axis:
                    known = known + size2 * h.gains[i] ** 2 / others[i]
            return whole - size2 * h.gains[axis] ** 2 * (h.psd - 1 / known)
        left = whole
        for j in range(3):
            own = np.square(bed.accel_base[j]) @ bed.columns
            motion = h.extra['motion'][j]
            left = left - size2 * h.extra['matrix'][axis, j] ** 2 * motion ** 2 / (motion + own)
        return left

    def _added(self, h, axis):
        """Return the spectrum a mechanism adds to an axis, or None."""
        if h.how in ('noise', 'shared'):
            return (h.size * h.gains[axis]) ** 2 * h.psd
        if h.how == 'coupled':
            return h.size ** 2 * (h.extra['matrix'][axis] ** 2 @ h.extra['motion'])
        if 'pedestal' in h.extra and h.gains[axis]:
            return np.full(self.bed.n, (h.extra['pedestal'] * self.bed.base[axis][0]) ** 2)
        return h.psd if h.how == 'angle' else None

    def _base_of(self, axis):
        """Return N, B, K of an axis with what a change of level makes of N."""
        n, b, k = self.bed.base[axis]
        for h in self.hidden:
            if h.how == 'level' and h.gains[axis]:
                n *= np.sqrt(np.mean(h.level ** 2))
        return n, b, k

    def _truth(self):
        bed = self.bed
        zero, one = np.zeros(bed.n), np.ones(bed.n)
        found: List[Dict[str, Any]] = [{'clear': {}, 'strength': {}, 'chi2_half': {}, 'gaps': {}}
                                       for _ in self.hidden]
        pure = [np.square(self._base_of(i)) @ bed.columns for i in range(3)]
        for axis in range(3):
            response = one
            for h in self.hidden:
                if h.how == 'filter' and h.gains[axis]:
                    response = response * h.extra['response']
            whole = pure[axis] * response
            shaped = whole
            for h in self.hidden:
                more = self._added(h, axis)
                whole = whole + (0 if more is None else more)
            quick = np.sqrt(bed.fs * np.mean(whole[bed.f > bed.fs / 200]))
            innovation = np.exp(np.mean(np.log(whole[1:] * bed.fs)))
            lattice = [h for h in self.hidden if h.how == 'lattice']
            # the word of an output is finer than the sensor's noise, whatever is heard beside it
            own = np.sqrt(bed.fs * np.mean(shaped[bed.f > bed.fs / 200]))
            self.lsb[axis] = lattice[0].params['step'] if lattice else self.fine * min(own, quick)
            floor = self.lsb[axis] ** 2 / 12 * bed.dt
            whole = whole + floor
            self.whole.append(whole)
            for h, out in zip(self.hidden, found):
                if not np.any(h.gains[axis]):
                    continue
                fixed = zero + floor
                for other in self.hidden:
                    more = None if other is h else self._added(other, axis)
                    if other is not h and other.how == 'base':
                        part = other.extra['part']
                        more = response * np.square(bed.base[axis][part]) * bed.columns[part]
                    fixed = fixed + (0 if more is None else more)
                others_response = response / h.extra['response'] if h.how == 'filter' else response
                clear, strength, half = 0.0, 0.0, None
                if h.how == 'mean':
                    mean = h.size * h.gains[axis] * h.mean
                    power = bed.power_of_mean(mean)
                    clear = gain_nats(bed, whole + power, whole, fixed, response, bed.fit)
                    half = float(.5 * np.sum((power / whole)[1:]))
                    strength = np.sqrt(np.max(bed.allan_of_mean(mean) / bed.allan_base(axis)))
                    if h.outside and h.form in ('chirp', 'fm line'):
                        out['gaps'][axis] = self._spectral_gaps(whole + power, whole, fixed,
                                                                response)
                    elif h.rivals or h.outside:
                        out['gaps'][axis] = rival_gaps(bed, mean, whole)
                elif h.how in ('noise', 'angle', 'base', 'shared', 'coupled'):
                    if h.how == 'base':
                        part = h.extra['part']
                        own = np.square(bed.base[axis][part]) * bed.columns[part]
                        other = bed.allan_base(axis) - bed.allan_of_psd(own)
                    else:
                        own, other = self._added(h, axis), bed.allan_base(axis)
                    true = whole
                    if h.how in ('shared', 'coupled'):
                        true = self._conditional(h, axis, h.size ** 2, whole, pure)
                    clear = gain_nats(bed, whole, true, fixed, response, bed.fit)
                    other = np.maximum(other, 1e-3 * bed.allan_base(axis))
                    strength = np.sqrt(np.max(bed.allan_of_psd(own) / other))
                    if h.name == 'rts':
                        clear, out['path'] = self._rts(h, axis, clear, whole, own, fixed, response)
                    if h.outside:
                        out['gaps'][axis] = self._spectral_gaps(whole, whole, fixed, response)
                elif h.how == 'filter':
                    clear = gain_nats(bed, whole, whole, fixed, others_response, bed.fit)
                    ratio = bed.allan_of_psd(shaped) / bed.allan_of_psd(pure[axis])
                    strength = np.sqrt(np.max(np.abs(ratio - 1)))
                    if h.outside:
                        out['gaps'][axis] = self._spectral_gaps(whole, whole, fixed,
                                                                others_response)
                elif h.how == 'level':
                    share = 1.0
                    if response is one:
                        share = min(1.0, pure[axis].min() * bed.fs / innovation)
                    v = share * h.level ** 2 / np.mean(h.level ** 2) + 1 - share
                    clear = float(-.5 * np.sum(np.log(v)))
                    strength = np.sqrt(np.max(np.abs(v - 1)))
                else:
                    clear, strength = self._defect(h, axis, quick)
                out['clear'][AXES[axis]] = float(clear)
                out['strength'][AXES[axis]] = float(strength)
                if half is not None:
                    out['chi2_half'][AXES[axis]] = half
        return self._summary(found)

    def _rts(self, h, axis, spectral, whole, own, fixed, response):
        """Return the gain of a telegraph by spectrum or path, and the lead of the path."""
        bed = self.bed
        noise = whole - own
        path = gain_nats(bed, whole, noise, fixed, response, bed.fit)
        switches = 2 * bed.span / h.extra['cycle']
        step = h.size * h.gains[axis]
        resolution = max(bed.dt, 4 * bed.base[axis][0] ** 2 / step ** 2)
        path -= switches * (1 + max(0.0, np.log(h.extra['cycle'] / 2 / resolution)))
        return max(spectral, path), float(path - spectral)

    def _spectral_gaps(self, wanted, true, fixed, response):
        """Return the distance to a Gauss-Markov process or angle quantization beside the base."""
        bed = self.bed
        forms = {'gauss_markov': [relaxation_psd(bed.f, bed.fs, tc)
                                  for tc in np.geomspace(2 * bed.dt, bed.span / 4, 14)],
                 'quantization': [np.sin(np.pi * bed.f * bed.dt) ** 2]}
        return {name: min(gain_nats(bed, wanted, true, fixed, response, bed.fit, True, [form])
                          for form in some) for name, some in forms.items()}

    def _defect(self, h, axis, quick):
        """Return clear and strength of spikes, held samples and coarse output."""
        bed = self.bed
        if h.how == 'spikes':
            z = np.linspace(-80, 80, 16001)
            step = z[1] - z[0]
            normal = np.exp(-z * z / 2) / np.sqrt(2 * np.pi)
            if h.form == 'student':
                nu = h.params['nu']
                scale = np.sqrt((nu - 2) / nu)
                p = (1 + (z / scale) ** 2 / nu) ** (-(nu + 1) / 2)
                p /= p.sum() * step
                var, size = 1.0, 1.0
            else:
                share, (low, high) = h.params['share'], h.params['sigmas']
                sizes = np.linspace(low, high, 400)
                tail = special.ndtr(np.abs(z) - low) - special.ndtr(np.abs(z) - high)
                tail = tail / (2 * (high - low))
                p = (1 - share) * normal + share * tail
                size = share * np.mean(sizes ** 2)
                var = 1 + size
            flat = np.exp(-z * z / (2 * var)) / np.sqrt(2 * np.pi * var)
            ok = (p > 1e-280) & (flat > 1e-280)
            distance = np.sum((p * np.log(np.where(ok, p, 1) / np.where(ok, flat, 1)))[ok]) * step
            return bed.n * distance, np.sqrt(size)
        if h.how == 'lattice':
            ratio = h.params['step'] / quick
            return bed.n * np.log(max(1.0, 50 * ratio)), ratio / np.sqrt(12)
        share = h.params.get('share', 1 - h.params.get('ratio', 1))
        chance = max(1e-9, self.lsb[axis] / (quick * 2 * np.sqrt(np.pi)))
        share = share + (1 - share) * chance
        distance = share * np.log(share / chance)
        distance += (1 - share) * np.log((1 - share) / (1 - chance))
        return bed.n * distance, np.sqrt(share)

    def _summary(self, found):
        """Return the truth as plain numbers, aliases settled."""
        bed, hidden = self.bed, []
        for h, out in zip(self.hidden, found):
            accept = {h.name} | h.accept
            if h.name == 'rts' and out.get('path', 0) < 5:
                # Dwells too short for two levels to be seen: the same spectrum.
                accept.add('gauss_markov')
            if h.name == 'harmonics' and out['clear']:
                # With one order only above the noise there is nothing to tell it from a line.
                amps = np.sort(h.params['amplitudes'])[::-1] ** 2
                if next(iter(out['clear'].values())) * amps[1] / amps.sum() < 18:
                    accept.add('sinusoid')
            for name in h.rivals:
                # A simpler mean that does as well to within four nats: no record can tell them
                # apart.
                if out['gaps'].get(0, {}).get(name, 99) < 4:
                    accept.add(name)
            one = {'name': h.name, 'form': h.form, 'params': {**h.params, 'size': float(h.size)},
                   'axes': sorted(out['clear']), 'gains': np.asarray(h.gains, float).tolist(),
                   'accept': sorted(accept), 'kin': sorted(h.kin), 'outside': h.outside,
                   'clear': out['clear'], 'strength': out['strength'],
                   'chi2_half': out['chi2_half'],
                   'bar': 36 if h.name in IMITABLE else 18}
            if h.outside and out['gaps']:
                one['distinct'] = float(min(out['gaps'].get(0, {'-': 0.}).values()))
            hidden.append(one)
        base = {}
        for i, axis in enumerate(AXES):
            n, b, k = self._base_of(i)
            lattice = any(h.how == 'lattice' for h in self.hidden)
            rounding = 0 if lattice else self.lsb[i] ** 2 / 12 * bed.dt
            base[axis] = {'N': float(np.sqrt(n * n + rounding)), 'B': float(b), 'K': float(k)}
        return {'seed': self.seed, 'kind': self.kind, 'grade': bed.grade, 'rate_hz': bed.fs,
                'samples': bed.n, 'duration_s': bed.span, 'fit': [BASE[i] for i in bed.fit],
                'base': base, 'hidden': hidden,
                'names': [h['name'] for h in hidden], 'lsb': [float(x) for x in self.lsb],
                'traps': self.traps}


# ---------------------------------------------------------------- realising

def _filtered(x, h):
    """Run the filter of a mechanism over a series, with a run-in mirrored from its beginning."""
    pad = min(len(x) - 1, 6000)
    long = np.concatenate([x[pad:0:-1], x])
    if 'h2' in h.extra:
        long = np.concatenate([long, x[-2:-2 - pad:-1]])
        m = len(long)
        f = np.arange(m // 2 + 1) / m * h.extra['fs']
        return fft.irfft(fft.rfft(long) * np.sqrt(h.extra['h2'](f)), m)[pad:pad + len(x)]
    return signal.lfilter(*h.extra['ba'], long)[pad:]


def _white(plan, axis, rng, n0):
    """Draw the white noise of an axis, with tails or an inner average if so planned."""
    bed = plan.bed
    sigma = n0 * np.sqrt(bed.fs)
    for h in plan.hidden:
        if not h.gains[axis]:
            continue
        if h.how == 'filter' and 'fast' in h.extra:
            fast, length = h.extra['fast'], h.extra['length']
            c = np.cumsum(np.concatenate([[0], rng.standard_normal(bed.n * fast + length)]))
            inner = (c[length:] - c[:-length]) / length
            return sigma * np.sqrt(fast) * inner[:bed.n * fast:fast]
        if h.how == 'spikes' and h.form == 'student':
            nu = h.params['nu']
            return sigma * np.sqrt((nu - 2) / nu) * rng.standard_t(nu, bed.n)
    return sigma * rng.standard_normal(bed.n)


def _hold(h, rng, n):
    """Return for each sample which one is given out."""
    if h.form == 'slower':      # what is made here is what the sensor measured, at its own times
        read = int((n - 1) / h.params['ratio']) + 1
        return np.floor(np.arange(read) * h.params['ratio'] + 1e-9).astype(int)
    run = h.params.get('run', 1)
    start = rng.random(n) < h.params['share'] / run
    held = np.convolve(start, np.ones(run), 'full')[:n] > 0
    held[0] = False
    return np.maximum.accumulate(np.where(held, 0, np.arange(n)))


def realise(plan, turn=0):
    """Draw a record of a plan; another ``turn`` gives new noise for the same plan."""
    bed, seed = plan.bed, plan.seed
    n, fs = bed.n, bed.fs
    gyro = np.empty((n, 3))
    streams = {}
    for number, h in enumerate(plan.hidden):
        rng = _rng(seed, turn, 'stream', number)
        if h.how == 'shared':
            s = h.draw(rng, n)
            streams[number] = (s, np.imag(signal.hilbert(s)))
        elif h.how == 'coupled':
            swings = zip(h.extra['sizes'], h.extra['swings'])
            streams[number] = np.array([a * r.draw(rng, n) for a, r in swings])
        elif h.how == 'hold':
            streams[number] = _hold(h, rng, n)
        if 'h2' in h.extra:
            h.extra['fs'] = fs
    for axis in range(3):
        n0, b, k = bed.base[axis]
        rng = _rng(seed, turn, 'gyro', axis)
        white = _white(plan, axis, rng, n0)
        slow = flicker(rng, n, fs, b, plan.traps)
        slow += np.cumsum(rng.standard_normal(n)) * k / np.sqrt(fs)
        for h in plan.hidden:
            if h.how == 'level' and h.gains[axis]:
                white = white * h.level
        x = white + slow
        for h in plan.hidden:
            if h.how == 'filter' and h.gains[axis] and 'fast' not in h.extra:
                x = _filtered(x, h)
            if 'pedestal' in h.extra and h.gains[axis]:
                x = x + h.extra['pedestal'] * n0 * np.sqrt(fs) * _rng(
                    seed, turn, 'pedestal', axis).standard_normal(n)
        for number, h in enumerate(plan.hidden):
            own = _rng(seed, turn, 'own', number, axis)
            gain = h.size * h.gains[axis]
            if not gain:
                continue
            if h.how == 'mean':
                x = x + gain * h.mean
            elif h.how == 'noise':
                x = x + gain * h.draw(own, n)
            elif h.how == 'shared':
                s, turned = streams[number]
                phase = h.params['phases'][axis]
                x = x + gain * (np.cos(phase) * s + np.sin(phase) * turned)
            elif h.how == 'coupled':
                x = x + h.size * (h.extra['matrix'][axis] @ streams[number])
            elif h.how == 'spikes' and h.form != 'student':
                burst, (low, high) = h.params['burst'], h.params['sigmas']
                start = own.random(n) < h.params['share'] / burst
                hit = np.convolve(start, np.ones(burst), 'full')[:n] > 0
                count = int(hit.sum())
                x = x.copy()
                sizes = own.choice([-1, 1], count) * own.uniform(low, high, count)
                x[hit] += n0 * np.sqrt(fs) * sizes
        x = x + plan.bias[axis]
        for number, h in enumerate(plan.hidden):
            if h.how != 'angle':
                continue
            count = h.params['count']
            if h.form == 'counts':
                dial = _rng(seed, turn, 'dial').random()
                angle = np.concatenate([[0], np.cumsum(x / fs)]) + count * dial
                x = np.diff(np.round(angle / count)) * (count * fs)
            else:
                error = _rng(seed, turn, 'dial', axis).uniform(-.5, .5, n + 1)
                x = x + np.diff(error) * count * fs
        counts = any(h.how == 'angle' and h.form == 'counts' for h in plan.hidden)
        if plan.lsb[axis] and not counts:
            x = np.round(x / plan.lsb[axis]) * plan.lsb[axis]
        gyro[:, axis] = x
    accel = _accel(plan, turn, streams) if plan.has_accel else None
    covariates = {name: np.array(values) for name, values in plan.covariates.items()}
    for number, h in enumerate(plan.hidden):
        if h.how != 'hold':
            continue
        gyro = gyro[streams[number]]
        accel = accel[streams[number]] if accel is not None else None
        if h.form == 'slower':
            fs = fs / h.params['ratio']
            covariates = {name: values[streams[number]] for name, values in covariates.items()}
    t, n = None, len(gyro)
    if plan.jitter:
        wobble = np.clip(_rng(seed, turn, 'stamps').standard_normal(n), -4, 4) * plan.jitter
        t = (np.arange(n) + wobble) / fs + 1000.0
    return Record(gyro, accel, t, fs, covariates, dict(plan.truth, turn=turn), plan)


def _accel(plan, turn, streams):
    """Draw the accelerometer: its own noise, gravity, knocks, sway, temperature."""
    bed = plan.bed
    n, fs = bed.n, bed.fs
    accel = np.empty((n, 3))
    gravity = GRAVITY * np.array([*plan.tilt, np.sqrt(1 - np.sum(plan.tilt ** 2))])
    for axis in range(3):
        white, b, k = bed.accel_base[axis]
        rng = _rng(plan.seed, turn, 'accel', axis)
        x = white * np.sqrt(fs) * rng.standard_normal(n) + flicker(rng, n, fs, b)
        x += np.cumsum(rng.standard_normal(n)) * k / np.sqrt(fs)
        x += gravity[axis] + plan.accel_bias[axis]
        ratio = white / bed.base[0][0]
        for number, h in enumerate(plan.hidden):
            weight = _rng(plan.seed, 'accel weight', number, axis).uniform(.3, 1.5)
            if h.how == 'coupled':
                x += streams[number][axis]
            elif h.name == 'shock':
                x += 3 * weight * ratio * h.size * h.mean
            elif h.name == 'temperature':
                x += .5 * weight * ratio * h.size * h.mean
        lsb = plan.fine * white * np.sqrt(fs)
        accel[:, axis] = np.round(x / lsb) * lsb if lsb else x
    return accel


def record(seed, effects=None, kind=None, grade=None, rate_hz=None, duration_s=None, target=None):
    """
    Return a record for a seed.

    Parameters
    ----------
    seed : int
        One seed gives one record.
    effects : list of str, optional
        Names, each maybe with a form: ``['low_pass/folded', 'outside/chirp']``.
    kind : str, optional
        A word that goes into the seeding and the truth.
    grade, rate_hz, duration_s : optional
        Fixed instead of drawn.
    target : float, optional
        The gain in nats to which an effect that adds is scaled, instead of a drawn one.

    Returns
    -------
    Record
        With gyro, accel (or None), t (or None), rate_hz, covariates and truth.

    """
    names = list(effects or [])
    rng = _rng(seed, kind or 'record', *names)
    bed = Bed(rng, grade, rate_hz, duration_s)
    return realise(Plan(seed, kind or 'record', names, rng, bed, target))


def second(rec):
    """Return an independent realisation of the same truth: same parameters, new noise."""
    return realise(rec.plan, rec.truth['turn'] + 1)


def nothing(seed):
    """Return a record that hides nothing."""
    return record(seed, [], 'nothing')


def one(seed):
    """Return a record that hides one effect of the library."""
    return record(seed, [str(_rng(seed, 'which').choice(sorted(MAKERS)))], 'one')


def _several(seed, count, kind):
    """Return a record with several effects of different families, all clear if it can be had."""
    best = None
    for attempt in range(6):
        rng = _rng(seed, kind, attempt)
        names: List[str] = []
        while len(names) < count:
            name = str(rng.choice(sorted(MAKERS)))
            taken = any(name in family and family & set(names) for family in FAMILIES)
            if name not in names and not taken:
                names.append(name)
        bed = Bed(rng)
        plan = Plan(seed, kind, names, rng, bed,
                    None if rng.random() < .3 else _between(rng, 60, 3000))
        forms = {h.name: h.form for h in plan.hidden}
        if forms.get('spikes') == 'student' and forms.get('low_pass', 'notch') != 'notch':
            continue    # what such a filter leaves of the tails is not that t distribution
        worst = min(h['clear'].get('gyro_x', 0) / h['bar'] for h in plan.truth['hidden'])
        if best is None or worst > best[0]:
            best = (worst, plan)
        if worst >= 1:
            break
    return realise(best[1])


def two(seed):
    """Return a record that hides two effects."""
    return _several(seed, 2, 'two')


def three(seed):
    """Return a record that hides three effects."""
    return _several(seed, 3, 'three')


def lines(seed, count=5):
    """Return a record with several unrelated steady lines."""
    return record(seed, ['sinusoid'] * count, 'lines')


def outside(seed):
    """Return a record with a shape that the library does not have."""
    name = 'outside/' + str(_rng(seed, 'shape').choice(sorted(OUTSIDE)))
    for size in (1, 4, 16, 64):
        rng = _rng(seed, 'outside', name)
        bed = Bed(rng)
        plan = Plan(seed, 'outside', [name], rng, bed,
                    size * _between(_rng(seed, 'gross'), 300, 3000))
        if plan.truth['hidden'][0].get('distinct', 99) > 60:
            break
    return realise(plan)


# ---------------------------------------------------------------- the generator checked

def _check_base():
    """Print brute-force Allan variances of N, B and K over their closed forms."""
    rng, fs, n = _rng(7, 'check'), 50.0, 100000
    bed = Bed(_rng(1), 'industrial', fs, n / fs)
    steps = np.array([1, 2, 5, 10, 100, 1000])

    def allan(x):
        c = np.concatenate([[0], np.cumsum(x)])
        return np.array([np.mean((c[2 * m:] - 2 * c[m:-m] + c[:-2 * m]) ** 2) / (2 * m * m)
                         for m in steps])
    floor = 2 * np.log(2) / np.pi
    walk = steps / fs / 3 * (1 + .5 / steps ** 2)
    for word, draw, wanted in (
            ('white N', lambda: rng.standard_normal(n) * np.sqrt(fs), fs / steps),
            ('flicker B, filter', lambda: flicker(rng, n, fs, 1), floor),
            ('flicker B, traps', lambda: flicker(rng, n, fs, 1, True), floor),
            ('random walk K', lambda: np.cumsum(rng.standard_normal(n)) / np.sqrt(fs), walk)):
        got = np.mean([allan(draw()) for _ in range(12)], 0) / wanted
        print(f'{word:20s} Allan variance / closed form at m = {steps}: {np.round(got, 3)}')
    for traps in (False, True):
        power = np.mean([fft.dct(flicker(rng, bed.n, fs, 1, traps), norm='ortho') ** 2
                         for _ in range(12)], 0) / fs
        ratio = bed.binned(power * 2 * np.pi * bed.f)
        parts = np.array_split(np.arange(len(ratio)), 6)
        print('flicker spectrum / (B^2/2 pi f)', 'traps ' if traps else 'filter', 'by band:', [
            round(float(np.average(ratio[p], weights=bed.counts[p])), 3) for p in parts])


def _check_spectra():
    """Print, for each form, measured over planned spectrum, and realised over expected gain."""
    forms = {'narrowband': ('resonance', 'motor'), 'rts': ('symmetric', 'asymmetric'),
             'low_pass': ('first', 'second', 'average', 'folded', 'notch'),
             'quantization': ('counts', 'stripped'), 'gauss_markov': ('',), 'flicker': ('',),
             'shared_noise': ('white', 'relaxing', 'resonance'), 'random_walk': ('',),
             'accel_coupling': ('sway', 'vibration'), 'variance_change': ('drift',),
             'outside': ('power_law', 'cube', 'matern', 'blue', 'humps', 'plateau', 'skirts')}
    names = [f'{a}/{b}'.rstrip('/') for a in forms for b in forms[a]]
    for name in ['sinusoid', 'temperature', *names]:
        rec = record(5, [name], 'check', 'industrial', 100.0, 300.0)
        plan, power, gains = rec.plan, 0, []
        bed, h = plan.bed, plan.hidden[0]
        mean = 0 if h.how != 'mean' else h.size * h.gains[0] * h.mean
        whole = plan.whole[0]
        expected = whole + (0 if h.how != 'mean' else bed.power_of_mean(mean))
        columns = bed.columns[bed.fit]
        for turn in range(4):
            x = realise(plan, turn).gyro[:, 0]
            own = fft.dct(x - mean, norm='ortho') ** 2 * bed.dt
            full = fft.dct(x, norm='ortho') ** 2 * bed.dt
            theta = refit(bed, bed.binned(full), bed.binned(bed.f * 0),
                          [bed.binned(c) for c in columns])
            s = (theta @ columns)[1:]
            gains.append(.5 * np.sum(full[1:] / s + np.log(s) - own[1:] / whole[1:]
                                     - np.log(whole[1:])))
            power = power + own / 4
        z = (bed.binned(power / whole) - 1) / np.sqrt(.5 / bed.counts)
        zero, one_ = bed.f * 0, bed.f * 0 + 1
        clear = gain_nats(bed, expected, whole, zero, one_, bed.fit)
        print(f'{name:26s} spectrum: mean ratio {np.mean((power / whole)[1:]):.3f}, rms z'
              f' {np.sqrt(np.mean(z ** 2)):.2f}, largest {np.abs(z).max():.1f}; gain expected'
              f' {clear:9.1f}, realised {np.mean(gains):9.1f} +- {np.std(gains) / 2:.1f}')


if __name__ == '__main__':
    _check_base()
    _check_spectra()
