# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Measure the default filter in one fixed setting.

Rms errors, delay, real motion against optical attitude, CPU time:

    python bench/filter.py [table] [fresh] [smooth] [coarse] [delay] [motion] [uneven] [verdicts]
                           [speed]

(all by default).

Verdicts on hidden effects: bench/filter_verdicts.py. The data of `motion` are looked for in
IMU_NOISE_DATA or ../shared/data; their licence is CC BY 4.0 (Laidig, Caruso, Cereatti, Seel:
BROAD, 2021).

"""

from __future__ import annotations

import os
from pathlib import Path
import sys
import time

import numpy as np
from scipy.signal import butter, filtfilt, lfilter, sosfiltfilt
from scipy.spatial.transform import Rotation

from imu_noise_tools.core.units import DEG
from imu_noise_tools.filter import motion as motions
from imu_noise_tools.filter.design import design
from imu_noise_tools.filter.evaluate import COARSE, score_of
from imu_noise_tools.filter.problem import problem_of
from imu_noise_tools.filter.recorded import filter_record
from imu_noise_tools.loop.effect import model_of
from imu_noise_tools.loop.study import Study

ROOT = Path(__file__).resolve().parents[1]
SIGMA, RATE = 0.6, 100.0
SEED = ('constant_rate', 'ar_increment')
KNOWN = {'white': {'R': (SIGMA * DEG) ** 2}, 'ar_increment': {'phi': 0.107, 'q': 4e-4 * DEG ** 2}}
MOTIONS = ('static', '15', '50', '150', 'mixed')
FRESH = ('rock 4 s', 'rock 20 s', 'wander', 'steps', 'turns')    # not those of the setting
REFERENCE = (
    0.046,
    0.206,
    0.240,
    0.278,
    0.305,
)  # interacting multiple models, as measured when this was designed
WIENER = (
    np.nan,
    0.182,
    0.242,
    0.310,
    np.nan,
)  # causal, for narrow-band motion of unknown frequency
FIRST_SETTING = (1e-5, 3e3), (1.0, 100.0, 1e4), 0.2


def motion(kind: str, n: int, rate: float, seed: int) -> np.ndarray:
    """
    Return n rates, deg/s.

    Rocking by an amplitude in degrees at a period of 10 s; `mixed` is rest, steps, rocking by 150
    deg and a sway of 60 deg/s at 1 Hz, 20 s each, over and over.

    """
    t = np.arange(n) / rate
    w = 2 * np.pi / 10
    if kind == 'static':
        return np.zeros(n)
    if kind != 'mixed':
        return float(kind) * w * np.sin(w * t)
    rng = np.random.default_rng(seed)
    stretch = int(20 * rate)
    parts = []
    while sum(map(len, parts)) < n:
        s = np.arange(stretch) / rate
        hold = np.repeat(rng.uniform(-150, 150, 5), stretch // 5)
        parts += [np.zeros(stretch), hold, 150 * w * np.sin(w * s), 60 * np.sin(2 * np.pi * s)]
    return np.concatenate(parts)[:n]


def fresh_motion(kind: str, n: int, rate: float, seed: int) -> np.ndarray:
    """
    Return n rates, deg/s, of a motion that the setting was not chosen on.

    Rocking by 30 deg at 4 s and by 100 deg at 20 s; a random rate of 40 deg/s below 0.3 Hz; steps
    of 60 deg/s rms every 3 s; turns by 90 deg within a second, smooth, and rest between.

    """
    t, rng = np.arange(n) / rate, np.random.default_rng([seed, 77])
    if kind.startswith('rock'):
        amplitude, period = (30.0, 4.0) if kind == 'rock 4 s' else (100.0, 20.0)
        w = 2 * np.pi / period
        return amplitude * w * np.sin(w * t + rng.uniform(0, 6.28))
    if kind == 'wander':
        x = lfilter(*butter(2, 0.3, fs=rate), rng.standard_normal(n))
        return 40.0 * x / x.std()
    k = (t / 3).astype(int)
    if kind == 'steps':
        return (60.0 * rng.standard_normal(k[-1] + 1))[k]
    inside = np.clip(t - 3 * k, 0, 1)
    return 90.0 * rng.choice([-1, 1], k[-1] + 1)[k] * (1 - np.cos(2 * np.pi * inside))


def run(z, rate, **settings):
    """Return z (n, axes), deg/s, filtered; R known."""
    settings = {'values': KNOWN, **settings}
    t = np.arange(len(z)) / rate
    return filter_record(t, z * DEG, design(axes=z.shape[1], **settings), rate).rate / DEG


class FirstSetting:
    """The default bank with the setting of the first design."""

    NAMES = ('WANDER', 'ACCELERATION', 'REST')

    def __enter__(self):
        """Put it in place."""
        self.default = [getattr(motions, name) for name in self.NAMES]
        for name, value in zip(self.NAMES, FIRST_SETTING):
            setattr(motions, name, value)

    def __exit__(self, *_):
        """Put the default back."""
        for name, value in zip(self.NAMES, self.default):
            setattr(motions, name, value)


def butterworth(z, rate, cutoff, order=1):
    """Return z (n, axes) through a causal low-pass."""
    return lfilter(*butter(order, cutoff, fs=rate), z, axis=0)


def one_euro(z, rate, least, beta, derivative=1.0):
    """Return z (n, axes) through the one-euro filter (Casiez, Roussel, Vogel 2012)."""
    def weight(cutoff):
        return 1 / (1 + rate / (2 * np.pi * cutoff))
    out, x, dx = np.empty_like(z), z[0].copy(), np.zeros(z.shape[1])
    out[0] = x
    ad = weight(derivative)
    for k in range(1, len(z)):
        dx += ad * ((z[k] - z[k - 1]) * rate - dx)
        x += weight(least + beta * np.abs(dx)) * (z[k] - x)
        out[k] = x
    return out


def rows(motions=MOTIONS, of=motion, seed=5, seconds=140.0, runs=8, skip=10.0):
    """Yield (name, rms in each motion, deg/s)."""
    n, head = int(seconds * RATE), int(skip * RATE)
    rng = np.random.default_rng(seed)
    truth = np.stack([of(k, n, RATE, i) for k in motions for i in range(runs)], axis=1)
    z = truth + SIGMA * rng.standard_normal(truth.shape)

    def error(y):
        return np.sqrt(
            np.mean((y - truth)[head:] ** 2, axis=0).reshape(len(motions), runs).mean(axis=1)
        )

    yield 'raw', error(z)
    yield 'paper', error(run(z, RATE, motion=SEED))
    yield 'paper, alpha 0.7', error(run(z, RATE, motion=SEED, alpha=0.7))
    if of is motion:
        q = (1e-4, 3.0, 100.0, 1e3, 1e5)
        with_q = [
            run(
                z[:, i * runs:(i + 1) * runs],
                RATE,
                motion=('constant_rate', 'angular_acceleration'),
                values={**KNOWN, 'angular_acceleration': {'q': v * DEG**2}},
            )
            for i, v in enumerate(q)
        ]
        yield 'acceleration, q by motion', error(np.concatenate(with_q, axis=1))
    with FirstSetting():
        yield 'first setting', error(run(z, RATE))
    yield 'DEFAULT (auto)', error(run(z, RATE))
    yield 'default, R from the data', error(run(z, RATE, values=None))
    for ms in (5.0, 20.0):
        cutoff = 1 / (2 * np.pi * ms * 1e-3)
        yield f'Butterworth 1, {ms:g} ms', error(butterworth(z, RATE, cutoff))
    yield 'one-euro (1 Hz, 0.05)', error(one_euro(z, RATE, 1.0, 0.05))


def table():
    """Print the table of rms errors."""
    print(
        f'rms error, deg/s; {RATE:g} Hz, white noise of {SIGMA} deg/s; rocking by 15, 50, 150 deg'
        ' at 10 s'
    )
    print(f'  {"filter":>28s}' + ''.join(f'{k:>9s}' for k in MOTIONS))
    for name, values in (('(design: bank)', REFERENCE), ('(design: causal Wiener)', WIENER)):
        print(f'  {name:>28s}' + ''.join(f'{v:9.3f}' for v in values))
    for name, values in rows():
        print(f'  {name:>28s}' + ''.join(f'{v:9.4f}' for v in values), flush=True)
        if name.startswith('DEFAULT'):
            print(
                f'  {"over the design bank":>28s}'
                + ''.join(f'{v / r:9.3f}' for v, r in zip(values, REFERENCE))
            )


def fresh():
    """Print the same for motions and noise that the setting was not chosen on."""
    print('\nmotions that the setting was not chosen on, rms error, deg/s')
    print(f'  {"filter":>28s}' + ''.join(f'{k:>11s}' for k in FRESH))
    for name, values in rows(FRESH, fresh_motion, 2027):
        print(f'  {name:>28s}' + ''.join(f'{v:11.4f}' for v in values), flush=True)


def smooth(runs=4, seconds=140.0, head=1000, seed=2034):
    """Print the smoother beside filter, plain smoother and zero-phase low-pass; its coverage."""
    n = int(seconds * RATE)
    print('\nfixed-interval smoother, rms error, deg/s; and how often the stated 95 % cover, mean'
          ' square of error over stated variance')
    for of, motion_names in ((motion, MOTIONS), (fresh_motion, FRESH)):
        rng = np.random.default_rng(seed)
        truth = np.stack([of(k, n, RATE, i) for k in motion_names for i in range(runs)], axis=1)
        z = truth + SIGMA * rng.standard_normal(truth.shape)

        def mean(x):
            return x[head:].reshape(n - head, len(motion_names), runs).mean(axis=(0, 2))

        print(f'  {"":>28s}' + ''.join(f'{k:>11s}' for k in motion_names))
        plain = filter_record(np.arange(n) / RATE, z * DEG, design(
            ('constant_rate', 'angular_acceleration'), axes=z.shape[1],
            values={**KNOWN, 'angular_acceleration': {'q': 1e4 * DEG ** 2}}), RATE, smooth=True)
        rows = {'zero-phase Butterworth, 5 Hz': filtfilt(*butter(2, 5.0, fs=RATE), z, axis=0),
                'plain smoother, q 1e4': plain.rate / DEG}
        for name, y in rows.items():
            print(f'  {name:>28s}' + ''.join(
                f'{v:11.4f}' for v in np.sqrt(mean((y - truth) ** 2))), flush=True)
        for name, settings in (('default', {}), ('delay 0.1 s', {'delay': 0.1}),
                               ('delay 0.5 s', {'delay': 0.5}), ('SMOOTHED', {'smooth': True})):
            got = filter_record(np.arange(n) / RATE, z * DEG, design(
                axes=z.shape[1], values=KNOWN), RATE, **settings)
            e2, v = (got.rate / DEG - truth) ** 2, got.variance / DEG ** 2
            for what, values in (('', np.sqrt(mean(e2))), (', 95 % cover', mean(e2 < 3.8415 * v)),
                                 (', chi-square', mean(e2 / v))):
                print(f'  {name + what:>28s}' + ''.join(f'{x:11.4f}' for x in values), flush=True)


def coarse(runs=2, seed=2):
    """Print what the default bank loses by itself, nats a sample: COARSE is no less."""
    n = 14000
    print(f'\nnats a sample that the bank loses by itself (allowed: {COARSE})')
    for of, kinds in ((motion, MOTIONS), (fresh_motion, FRESH)):
        rng = np.random.default_rng(seed)
        truth = np.stack([of(k, n, RATE, i) for k in kinds for i in range(runs)], axis=1)
        z = truth + SIGMA * rng.standard_normal(truth.shape)
        got = filter_record(np.arange(n) / RATE, z * DEG,
                            design(axes=z.shape[1], values=KNOWN), RATE)
        for i in range(z.shape[1]):
            u = got.score[1000:, i]
            lost = {k: v.excess * len(v.pull) / (2 * len(u))
                    for k, v in score_of(u, 1 / RATE).views.items()}
            print(f'  {kinds[i // runs]:>10s}' + ''.join(
                f'  {k} {x:.4f}' for k, x in lost.items()))


def verdicts():
    """Print what the loop says of real motion, and the CPU time of an axis."""
    for model in (('any_motion', 'white'), (*SEED, 'white')):
        print(f'\nverdicts of the loop on real records: {" + ".join(model)}')
        for name in ('yei*', 'px4_auavx21*', 'broad_01*', 'broad_10*', 'broad_24*'):
            for path in sorted(records().glob(f'{name}.npz')):
                with np.load(path) as data:
                    gyro = data['gyro'].astype(float)
                    t = (data['t'].astype(float) if 't' in data
                         else np.arange(len(gyro)) / float(data['rate_hz']))
                for axis in range(3):
                    _say_verdict(path.stem[:12], t, gyro[:, axis], f'gyro_{"xyz"[axis]}', model)


def _say_verdict(record, t, z, axis, model):
    begin = time.process_time()
    problem = problem_of(t, z, axis)
    study = Study.begin({axis: problem}, model_of('filter', model))
    found = study.diagnose()[axis]
    left = found.remaining.failed if found.remaining else ()
    print(f'  {record} {axis}, samples {problem.part}: {found.verdict}'
          f' {[f.name for f in found.found]},'
          f' gains {[(f.name, round(f.gain)) for f in found.ranked[:3]]}, then fails'
          f' {[f.evidence for f in left]}; {time.process_time() - begin:.1f} CPU s', flush=True)


def records() -> Path:
    """Return the folder of the real recordings."""
    return Path(os.environ.get('IMU_NOISE_DATA') or ROOT.parent / 'shared' / 'data') / 'records'


def rms(error):
    """Return the root mean square of errors (n, ...) over the first axis, NaN left out."""
    return np.sqrt(np.nanmean(np.square(error), axis=0))


def delay(rate, truth, frequency, dt):
    """Return by how many s a filtered sinusoid (n,) of a frequency, Hz, lags behind the true."""
    t = np.arange(len(truth)) * dt
    wave = np.exp(-2j * np.pi * frequency * t)
    phase = np.angle((truth - truth.mean()) @ wave) - np.angle((rate - rate.mean()) @ wave)
    return float((phase + np.pi) % (2 * np.pi) - np.pi) / (2 * np.pi * frequency)


def delays():
    """Print the delay of the default filter for sinusoidal rates, beside a low-pass's."""
    print(
        '\ndelay, ms (mean of 24 runs of 60 s, standard error), and gain of a sinusoidal rate;'
        ' default filter'
    )
    n = int(80 * RATE)
    t = np.arange(n) / RATE
    head = int(20 * RATE)
    for amplitude in (10.0, 100.0):
        for f in (0.1, 0.3, 1.0, 3.0, 10.0):
            truth = amplitude * np.sin(2 * np.pi * f * t)[:, None] * np.ones(24)
            y = run(truth + SIGMA * np.random.default_rng(3).standard_normal(truth.shape), RATE)
            late = [1e3 * delay(y[head:, i], truth[head:, i], f, 1 / RATE) for i in range(24)]
            gain = np.mean([y[head:, i] @ truth[head:, i] for i in range(24)]) / (
                truth[head:, 0] @ truth[head:, 0]
            )
            print(
                f'  {amplitude:5g} deg/s at {f:4g} Hz: {np.mean(late):6.2f} +-'
                f' {np.std(late) / np.sqrt(24):.2f}   gain {gain:.4f}   rms'
                f' {rms((y - truth)[head:]).mean():.3f}'
            )


def reference_rate(quaternions, rate):
    """
    Return the body rate (n, 3), rad/s, of optical attitudes [w x y z].

    By a local quadratic fit of rotation vectors.

    """
    good = np.isfinite(quaternions).all(axis=1)
    q = np.where(good[:, None], quaternions, [1.0, 0, 0, 0])
    r = Rotation.from_quat(q[:, [1, 2, 3, 0]])
    half = 4  # over 9 frames, 31 ms: marker noise down, motion up to 10 Hz kept
    total, weight = np.zeros((len(q), 3)), 0.0
    ok = good.copy()
    for k in range(1, half + 1):
        step = (r[:-2 * k].inv() * r[2 * k:]).as_rotvec() * rate / (2 * k)
        total[k:-k] += k * k * step
        weight += k * k
        ok[k:-k] &= good[:-2 * k] & good[2 * k:]
    ok[:half] = ok[-half:] = False
    return total / weight, ok


def attitude(rates, rate):
    """Return what rates (n, 3), rad/s, turn to by trapezoids: quaternions (n, 4) [w x y z]."""
    steps = 0.5 * (rates[1:] + rates[:-1])
    out = np.empty((len(rates), 4))
    out[0] = a, b, c, d = 1.0, 0.0, 0.0, 0.0
    for k, (x, y, z, w) in enumerate(Rotation.from_rotvec(steps / rate).as_quat(), 1):
        a, b, c, d = (a * w - b * x - c * y - d * z, a * x + b * w + c * z - d * y,
                      a * y - b * z + c * w + d * x, a * z + b * y - c * x + d * w)
        out[k] = a, b, c, d
    return out / np.linalg.norm(out, axis=1, keepdims=True)


def aligned(gyro, reference, ok, rate):
    """
    Return the reference in the gyroscope's frame and time.

    Rotation, delay (to a hundredth of a sample), and bias are found.

    """
    best = None
    index = np.arange(len(gyro), dtype=float)
    for shift in np.concatenate([np.arange(-8, 9, 1.0)]):
        found = _fit(gyro, reference, ok, index, shift)
        best = found if best is None or found[0] < best[0] else best
    for width in (0.5, 0.1, 0.02):
        for shift in best[1] + width * np.arange(-2, 3):
            found = _fit(gyro, reference, ok, index, shift)
            best = found if found[0] < best[0] else best
    return best


def _fit(gyro, reference, ok, index, shift):
    moved = np.stack([np.interp(index + shift, index, reference[:, i]) for i in range(3)], axis=1)
    good = ok & np.roll(ok, 8) & np.roll(ok, -8)
    a, b = moved[good], gyro[good]
    u, _, vt = np.linalg.svd((b - b.mean(0)).T @ (a - a.mean(0)))
    turn = u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
    bias = b.mean(0) - turn @ a.mean(0)
    error = np.sqrt(np.mean((b - a @ turn.T - bias) ** 2))
    return error, shift, moved @ turn.T + bias, good


def attitude_error(rate_estimate, truth, good, rate, seconds=5.0):
    """
    Return the rms angle (deg) by which integrated rates and the reference's drift apart.

    Over windows of equal length.

    """
    size = int(seconds * rate)
    out = []
    for begin in range(0, len(truth) - size, size):
        if good[begin:begin + size].all():
            a = _integral(rate_estimate[begin:begin + size], rate)
            b = _integral(truth[begin:begin + size], rate)
            out.append((a.inv() * b).magnitude())
    return float(np.sqrt(np.mean(np.square(out)))) / DEG


def _integral(rates, rate):
    steps = list(Rotation.from_rotvec(rates / rate))
    while len(steps) > 1:  # a product tree: fast, and short of rounding
        last = [steps[-1]] if len(steps) % 2 else []
        even = len(steps) - len(last)
        a, b = (Rotation.concatenate(steps[k:even:2]) for k in (0, 1))
        steps = [*(a * b), *last]
    return steps[0]


def measured_delay(y, z, rate):
    """
    Return by how many seconds y lags behind z.

    The shift of least squared difference over all axes, finer than a sample.

    """
    lags = np.arange(-2, 30)
    cost = [np.mean((y[40:-40] - z[40 - k:len(z) - 40 - k]) ** 2) for k in lags]
    k = int(np.clip(np.argmin(cost), 1, len(lags) - 2))
    a, b, c = cost[k - 1:k + 2]
    return float(lags[k] + 0.5 * (a - c) / (a - 2 * b + c)) / rate


def real_motion():
    """
    Print errors against optical attitude.

    Raw beside filtered and low-pass filters of the same delay.

    """
    folder = records()
    print(
        '\nreal motion against differentiated optical attitude (BROAD); noise as recorded, and'
        ' with 0.6 deg/s added;'
    )
    print(
        '"from recorded": rms in motion from the rates as recorded, whose own noise is small: what'
        ' filtering costs and gains'
    )
    print(
        '"by own attitude": the same, but the recorded rates are first integrated and then'
        ' differentiated as the optical attitude is: what its smoothing does to such a comparison'
    )
    if not folder.is_dir():
        print(f'  no recordings at {folder}')
        return
    rng = np.random.default_rng(9)
    for path in sorted(folder.glob('broad_*.npz')):
        with np.load(path) as data:
            gyro, rate = data['gyro'].astype(float), float(data['rate_hz'])
            quaternions, moving = data['opt_quat'].astype(float), data['movement'].astype(bool)
        _, shift, truth, good = aligned(gyro, *reference_rate(quaternions, rate), rate)
        own, ok = reference_rate(attitude(gyro, rate), rate)
        ok &= moving
        print(f'  {path.stem}: {rate:.1f} Hz, reference shifted by {1e3 * shift / rate:.2f} ms')
        print(
            f'    {"":26s} {"delay":>8s} {"rms, deg/s":>12s} {"in motion":>10s} {"at rest":>9s}'
            f' {"attitude, 5 s":>14s} {"from recorded":>14s} {"by own attitude":>16s}'
        )
        for added in (0.0, SIGMA):
            z = gyro + added * DEG * rng.standard_normal(gyro.shape)
            ours = filter_record(np.arange(len(z)) / rate, z, design(), rate).rate
            late = max(measured_delay(ours, gyro, rate), 2e-4)
            both = filter_record(np.arange(len(z)) / rate, z, design(), rate, smooth=True).rate
            candidates = {
                'raw': z,
                'default': ours,
                'smoothed': both,
                'zero-phase Butterworth 8 Hz': filtfilt(*butter(2, 8.0, fs=rate), z, axis=0),
                'Butterworth 1, same delay': _tuned(
                    lambda c: butterworth(z, rate, c), gyro, rate, late
                ),
                'Butterworth 2, same delay': _tuned(
                    lambda c: butterworth(z, rate, c, 2), gyro, rate, late
                ),
                'one-euro, same delay': _tuned(
                    lambda c: one_euro(z, rate, c, 1.0), gyro, rate, late
                ),
            }
            for name, y in candidates.items():
                e = (y - truth) / DEG
                print(
                    f'    {name + (" +0.6" if added else ""):26s}'
                    f' {1e3 * measured_delay(y, gyro, rate):5.2f} ms {rms(e[good].ravel()):12.4f}'
                    f' {rms(e[good & moving].ravel()):10.4f}'
                    f' {rms((e - e[good & ~moving].mean(axis=0))[good & ~moving].ravel()):9.4f}'
                    f' {attitude_error(y, truth, good & moving, rate):10.3f} deg'
                    f' {rms((y - gyro)[moving].ravel()) / DEG:14.4f}'
                    f' {rms((y - own)[ok].ravel()) / DEG:16.4f}',
                    flush=True,
                )


def uneven():
    """
    Print whether recorded motion was sampled off its time, by no model of the filter.

    What is left of each rate above 0.35 of the sampling rate, over its slope, is a delay: of
    chance noise it differs from axis to axis, of uneven sampling it is one for all.

    """
    print('\ndelay of samples in vigorous motion: rms, correlation between axes, with the next')
    for path in sorted(records().glob('broad_*.npz')):
        with np.load(path) as data:
            z = np.asarray(data['gyro'], float)
        z = z[np.isfinite(z).all(axis=1)]
        fast = sosfiltfilt(butter(4, 0.7, 'high', output='sos'), z, axis=0)
        rate = 1e7 / 35000
        slope = np.gradient(sosfiltfilt(butter(4, 0.2, output='sos'), z, axis=0), axis=0) * rate
        strong = np.abs(slope) > np.quantile(np.abs(slope), 0.7, axis=0)
        delay_of = np.where(strong, fast / slope, np.nan)

        def alike(a, b):
            both = np.isfinite(a) & np.isfinite(b)
            return np.corrcoef(a[both], b[both])[0, 1]

        between = [alike(delay_of[:, i], delay_of[:, j]) for i, j in ((0, 1), (0, 2), (1, 2))]
        after = [alike(d[1:], d[:-1]) for d in delay_of.T]
        print(f'  {path.stem[:8]}  {1e3 * np.nanstd(delay_of, axis=0).round(6)} ms '
              f'{np.round(between, 2)} {np.round(after, 2)}')


def _tuned(filtered, reference, rate, late):
    """Return the low-pass whose measured delay is `late` s, by bisection of its cut-off."""
    low, high = 0.2, 0.495 * rate
    for _ in range(14):
        middle = np.sqrt(low * high)
        if measured_delay(filtered(middle), reference, rate) > late:
            low = middle
        else:
            high = middle
    return filtered(high)


def speed():
    """Print CPU seconds for 2.16 million messages, three axes, and the time of a message live."""
    from imu_noise_tools.filter.engine import Engine
    n = 2_160_000
    t = np.arange(n) / 200.0
    z = SIGMA * DEG * np.random.default_rng(1).standard_normal((n, 3))
    print(
        '\nCPU seconds for 2.16 M messages (3 h, 200 Hz, three axes), reading and writing not'
        ' counted'
    )
    for name, settings, limit in (
        ('single model', {'motion': SEED}, 10),
        ('default bank', {}, 30),
        ('smoothed', {'smooth': True}, 300),
    ):
        begin = time.process_time()
        both = settings.pop('smooth', False)
        filter_record(t, z, design(**settings), smooth=both)
        print(f'  {name}: {time.process_time() - begin:.1f} (limit {limit})', flush=True)
    for name, settings in (('single model', {'motion': SEED}), ('default bank', {})):
        engine = Engine(rate_hz=1000.0, values=KNOWN, **settings)
        taken = []
        for k in range(5000):
            begin = time.perf_counter()
            engine.step(k * 1e-3, z[k])
            taken.append(time.perf_counter() - begin)
        print(
            f'  live, {name}: median {1e6 * np.median(taken):.0f} us, p99'
            f' {1e6 * np.percentile(taken, 99):.0f} us a message'
        )


def main(names) -> int:
    """Run what is named."""
    every = {'table': table, 'fresh': fresh, 'smooth': smooth, 'coarse': coarse, 'delay': delays,
             'motion': real_motion, 'uneven': uneven, 'verdicts': verdicts, 'speed': speed}
    for name in names or every:
        every[name]()
    return 0


if __name__ == '__main__':
    raise SystemExit(main(sys.argv[1:]))
