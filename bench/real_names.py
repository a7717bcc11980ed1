# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Check what was named on a record against its samples, in a few lines each that use no package.

Every check takes a finding's own numbers (a frequency, a time, a source) and reads the samples,
once as a whole and once in each half of the record, which an effect of the sensor should show
alike. ``check`` returns (whether the samples bear the name out, in words); None where a script of
this kind cannot tell. `real_verdicts.py` prints it beside each name.

Lines: Hann's periodogram, the highest of five cells over the median of 5 % (200 cells and more)
around, of the stretch in which it is said to be on. Narrow bands: the mean over the width against
that median. Filters: Welch's level in the upper half of what the cutoff leaves. What is shared:
gain to the other axis in each of 64 blocks, of differenced samples less those of the axes of the
same sensor that were named before, the median over its own scatter. Shocks: the squares of
differences over 0.4 s at each time that is told, among all such stretches of the record. What
moves the mean: least squares on 200 block means, Newey and West's error (lag n^(1/3)), beside a
straight line where that is not itself the question.
"""

from __future__ import annotations

import re

import numpy as np

CLEAR = 4.0  # standard errors
HALF = 7.0  # times the median in a half: of a known cell 1 in 2^7 by chance
BLOCKS, MEANS = 64, 200


# --- what is read --------------------------------------------------------------------------------

def calm(y, dt, left_out):
    """Return y with the median in place of what was left out or is knocked, a second around."""
    middle = np.nanmedian(y)
    sigma = 1.4826 * np.nanmedian(np.abs(y - middle))
    loud = left_out | ~np.isfinite(y) | (np.abs(y - middle) > 8 * sigma)
    # slow drift is no knock, and what is loud throughout is no knock either
    if np.mean(np.abs(y - middle) > 8 * sigma) > 0.01:
        loud = left_out | ~np.isfinite(y)
    some = np.convolve(loud, np.ones(1 + 2 * int(0.5 / dt)), 'same') > 0.5
    return np.where(some, middle, y)


def without_gaps(t, axes, left_out):
    """Return stamps, axes and what was left out with lost samples interpolated: time goes on."""
    d = np.diff(t)
    usual = np.mean(d[d < 1.5 * np.median(d)])
    lost = np.maximum(np.round(d / usual), 1)
    if not np.any(lost > 1) or np.mean(lost > 1) > 0.01:  # bursts of stamps are no losses
        return t, axes, left_out
    at = np.append(0.0, np.cumsum(lost))
    k = np.arange(int(at[-1]) + 1)
    return (np.interp(k, at, t), {a: np.interp(k, at, y) for a, y in axes.items()},
            np.interp(k, at, left_out) > 0.5)


# --- spectra -------------------------------------------------------------------------------------

def cells(y, dt):
    """Return f and Hann's periodogram of y, once each."""
    window = np.hanning(len(y))
    return np.fft.rfftfreq(len(y), dt), np.abs(np.fft.rfft((y - y.mean()) * window))**2


def height(y, dt, f0, width=0.0):
    """Return (highest of the cells at f0, mean over them, how many), over the median around."""
    f, p = cells(y, dt)
    at = int(round(f0 * len(y) * dt))
    reach = max(2, int(np.ceil(width * len(y) * dt)))
    far = max(100 + reach, int(0.025 * at) + reach)
    low, high = max(3, at - far), min(len(f) - 1, at + far)
    around = np.r_[low:max(low, at - reach - 2), min(at + reach + 3, high):high]
    if at + 2 >= len(f) or at < 3 or len(around) < 20:
        return np.nan, np.nan, 0
    level = np.median(p[around])
    band = p[max(3, at - reach):at + reach + 1] / level
    return float(band.max()), float(np.mean(band) * np.log(2)), len(band)


def folded(f, dt):
    """Return a frequency as it is seen after sampling."""
    return abs((f * dt + 0.5) % 1 - 0.5) / dt


def line(y, dt, orders):
    """Tell whether lines stand at frequencies, and how high, in the whole and in halves."""
    n, said, good = len(y), [], 0
    for f in orders:
        whole, a, b = (height(x, dt, folded(f, dt))[0] for x in (y, y[:n // 2], y[n // 2:]))
        some = whole > np.log2(100 * n) and min(a, b) > HALF
        good += bool(some)
        said.append(f'{folded(f, dt):.4g} Hz x{whole:.0f} ({a:.0f}, {b:.0f})')
    return 2 * good > len(orders), ', '.join(said[:4])


def band(y, dt, f0, width):
    """Tell whether the power within a width stands above that around, in both halves."""
    n, out = len(y), []
    for x in (y, y[:n // 2], y[n // 2:]):
        top, mean, k = height(x, dt, f0, width)
        out.append((top, (mean - 1) * np.sqrt(k / 2) if k else np.nan))
    (top, whole), (_, a), (_, b) = out
    # it may be on in one half alone, or for a stretch across the middle
    return bool(whole > 2 * CLEAR or whole > CLEAR + 2 and max(a, b) > CLEAR), \
        f'top x{top:.0f}, mean of the band {whole:.0f} standard errors above ({a:.0f}, {b:.0f})'


def level(y, dt, low, high):
    """Return the level of Welch's spectrum between two frequencies (medians: no shocks)."""
    n = max(256, len(y) // 100)
    window = np.hanning(n)
    pieces = np.lib.stride_tricks.sliding_window_view(y, n)[::n // 2]
    power = np.median([np.abs(np.fft.rfft((x - x.mean()) * window))**2 for x in pieces], axis=0)
    f = np.fft.rfftfreq(n, dt)
    some = (f >= low) & (f <= high)
    return float(np.median(power[some])) if some.any() else np.nan


def low_pass(y, dt, cutoff):
    """Tell whether the level falls from a fifth of the cutoff to the fast end, and each step."""
    top = 0.5 / dt
    edges = np.geomspace(0.15 * min(cutoff, top), 0.98 * top, 7)
    n, out = len(y), []
    for x in (y, y[:n // 2], y[n // 2:]):
        some = [level(x, dt, a, b) for a, b in zip(edges, edges[1:])]
        out.append(np.array(some) / some[0])
    steps = ' '.join(f'{v:.2g}' for v in out[0])
    # never more than a tenth up on the way, and down by a tenth in the end, in both halves
    good = all(z[-1] < 0.9 * z[0] and np.all(np.diff(z) < 0.1 * z[:-1]) for z in out)
    return bool(good), f'levels {edges[0]:.2g} to {edges[-1]:.3g} Hz: {steps}'


def rising(y, raw, dt):
    """Tell whether power rises by what an angle rounded to the samples' own step puts there."""
    step = np.median(np.diff(np.unique(raw[np.isfinite(raw)])))
    edges = np.linspace(0.05, 0.99, 25) * 0.5 / dt
    f = 0.5 * (edges[1:] + edges[:-1])
    s = np.array([level(y, dt, *pair) for pair in zip(edges, edges[1:])])
    x = np.column_stack([np.ones(24), np.sin(np.pi * f * dt)**2])
    weight = 1 / np.median(s)
    for _ in range(5):   # lines stand above: least absolute deviations
        beta = np.linalg.lstsq(x * weight[:, None] if np.ndim(weight) else x * weight, s * weight,
                               rcond=None)[0]
        weight = 1 / np.sqrt(np.maximum(np.abs(s - x @ beta), 0.02 * np.median(s)))
    # var = level/(2 dt) of a one-sided density; rounding of the angle adds step^2/3 sin^2 times 2
    scale = np.var(y) / np.mean(s)
    found, asked = beta[1] * scale, step**2 / 3
    return bool(0.5 * asked < found < 2 * asked), \
        f'rises by {found / asked:.2f} of what an angle rounded to the step {step:.3g} adds'


# --- other axes ----------------------------------------------------------------------------------

def shared(y, others, known):
    """Tell whether a share of others stays alike over blocks, beside what is known."""
    said = []
    for name, x in others.items():
        gains = []
        beside = [v for k, v in known.items() if k != name]
        for part in np.array_split(np.arange(len(y)), BLOCKS):
            columns = np.column_stack([np.diff(v[part]) for v in (x, *beside)])
            columns = columns - columns.mean(axis=0)
            d = np.diff(y[part])
            gains.append(np.linalg.lstsq(columns, d - d.mean(), rcond=None)[0][0])
        gains = np.array(gains)
        middle = np.median(gains)
        error = 1.253 * 1.4826 * np.median(np.abs(gains - middle)) / np.sqrt(BLOCKS)
        half = [np.median(g) for g in np.array_split(gains, 2)]
        said.append((abs(middle) / error, name, middle, error, half))
    said.sort(reverse=True)
    far, name, middle, error, half = said[0]
    good = far > CLEAR and min(h * np.sign(middle) for h in half) > 0.3 * abs(middle)
    return bool(good), (f'{name} {middle:.2g} +- {error:.1g}, in halves {half[0]:.2g}, '
                        f'{half[1]:.2g}' + (f'; {said[1][1]} {said[1][0]:.0f} standard errors'
                                            if len(said) > 1 else ''))


def foretold(y, others, known):
    """Tell whether what others do in one half foretells an axis in the other, beside the known."""
    columns = np.array([*others.values()])
    columns = columns - columns.mean(axis=1)[:, None]
    columns = np.vstack([np.roll(columns, k, axis=1) for k in (-1, 0, 1)]
                        + [np.sum(columns**2, axis=0)])
    beside = np.vstack([np.ones(len(y)), *(np.roll(x, k) for x in known.values()
                                           for k in (-1, 0, 1))])
    n, said = len(y), []
    parts = slice(2, n // 2), slice(n // 2, n - 2)
    for fitted, asked in (parts, parts[::-1]):
        def rest(z, some):
            x = beside[:, some].T
            return z[some] - x @ np.linalg.lstsq(x, z[some], rcond=None)[0]

        x, yes = (np.array([rest(c, some) for c in columns]).T for some in (fitted, asked))
        beta = np.linalg.lstsq(x, rest(y, fitted), rcond=None)[0]
        said.append(float(np.corrcoef(yes @ beta, rest(y, asked))[0, 1]) * np.sqrt(n / 2))
    return min(said) > CLEAR, (f'gains of one half foretell the other by {said[0]:.1f} and '
                               f'{said[1]:.1f} standard errors')


# --- samples -------------------------------------------------------------------------------------

def shocks(y, t, evidence, ring=None):
    """
    Tell how loud the record is at the times that a finding tells, beside all of it.

    By the squares of differences over 0.4 s, and of what rings by what swings at that frequency in
    0.4 s: over the median of all such stretches, and how many of them are as loud. What a single
    sample reaches chance reaches as well in a million of them.

    """
    times = [float(x) for x in re.findall(r'\d+(?:\.\d+)?', evidence.partition(' at ')[2]
                                          .partition(' s')[0])]
    dt, d = (t[-1] - t[0]) / (len(t) - 1), np.diff(y, prepend=y[0])
    width = max(4, round(0.4 / dt))
    if ring:
        swing = (y - np.median(y)) * np.exp(-2j * np.pi * ring * dt * np.arange(len(y)))
        running = np.abs(np.convolve(swing, np.ones(width) / width, 'same')) ** 2
        all_ = running[width // 2::width]
    else:
        d = (d - np.median(d)) ** 2
        all_ = np.add.reduceat(d, np.arange(0, len(d) - width, width))[:-1] / width
        running = np.convolve(d, np.ones(width) / width, 'same')
    out = []
    for at in times:
        inside = np.abs(t - t[0] - at) < 1
        if inside.any():
            top = float(np.max(running[inside]))
            out.append((top / np.median(all_), int(np.sum(all_ >= top))))
    told = ', '.join(f'x{x:.1f} ({k} of {len(all_)} as loud)' for x, k in out)
    # a shock fills a few stretches itself, and there may be others
    return bool(out) and np.median([x for x, _ in out]) > 2 and np.median(
        [k for _, k in out]) < 5 + 0.001 * len(all_) + 3 * len(out), told


def grid(y):
    """Tell whether the samples lie on few levels."""
    levels = np.unique(y)
    step = np.median(np.diff(levels)) if len(levels) > 1 else 0.0
    return len(levels) < 0.1 * len(y) and step > 0.5 * np.std(y), \
        f'{len(levels)} levels, {np.std(y) / step:.2g} steps rms'


def loudness(y):
    """Tell how the robust size of differences moves over twenty stretches."""
    s = np.array([np.median(np.abs(np.diff(x))) for x in np.array_split(y, 20)])
    error = 1.17 / np.sqrt(len(y) / 20)
    return bool(np.ptp(s) / np.median(s) > 10 * error), ' '.join(f'{v / s[0]:.2f}' for v in s[::2])


# --- the mean ------------------------------------------------------------------------------------

def regression(y, column, trend=True):
    """Return a column's coefficient and its error by Newey and West, on block means."""
    m = np.array([x.mean() for x in np.array_split(y, MEANS)])
    c = np.array([x.mean() for x in np.array_split(column, MEANS)])
    line_ = np.linspace(-1, 1, MEANS)
    x = np.column_stack([c, np.ones(MEANS), line_] if trend else [c, np.ones(MEANS)])
    inverse = np.linalg.pinv(x.T @ x)
    beta = inverse @ x.T @ m
    z = x * (m - x @ beta)[:, None]
    lags = int(MEANS ** (1 / 3)) + 1
    inner = z.T @ z
    for k in range(1, lags + 1):
        g = z[k:].T @ z[:-k]
        inner += (1 - k / (lags + 1)) * (g + g.T)
    return beta[0], np.sqrt((inverse @ inner @ inverse)[0, 0])


def moved(y, column, trend=True):
    """Tell whether the mean follows a column, in the whole record."""
    b, e = regression(y, column, trend)
    return bool(abs(b) > CLEAR * e), f'{b:.3g} +- {e:.1g}'


def knee(y, dt, tc):
    """Tell whether power falls by more around the knee than flicker noise would."""
    f = 1 / (2 * np.pi * tc)
    above, below = (np.array([x.mean() for x in np.array_split(
        cells(y, dt)[1][max(1, int(a * f * len(y) * dt)):max(2, int(b * f * len(y) * dt))], 1)])[0]
        for a, b in ((3, 10), (0.1, 1)))
    return None, f'power above the knee to below it {above / below:.2g}'


# --- all of them ---------------------------------------------------------------------------------

def check(one, t, axes, axis, before=(), left_out=False):
    """
    Return (whether the samples bear a finding out or None, in words).

    ``one`` is a finding as ``diagnose --json`` prints it, ``axes`` the samples of all axes by
    name, ``before`` the names of those that were found before it on the axis, ``left_out`` (n,)
    tells which samples the analysis left out.
    """
    v = {k: p.get('value') for k, p in one.get('parameters', {}).items()}
    t, axes, left_out = without_gaps(t, axes, np.broadcast_to(left_out, len(t)))
    dt, name, raw = (t[-1] - t[0]) / (len(t) - 1), one['effect'], axes[axis]
    axes = {k: calm(x, dt, np.broadcast_to(left_out, len(t))) for k, x in axes.items()}
    y, sensor = axes[axis], axis.partition('_')[0]
    own = {k: x for k, x in axes.items() if k.startswith(sensor) and k != axis}
    s = t - t[0]
    if name == 'sinusoid':
        on = (s >= (v.get('begin') or 0)) & (s < (v.get('end') or np.inf))
        return line(y[on], dt, [v['frequency']])
    if name == 'harmonics':
        orders = [int(k.split('_')[1]) for k, a in v.items() if k.startswith('amplitude_') and a]
        return line(y, dt, [k * v['frequency'] for k in orders])
    if name == 'narrowband':
        return band(y, dt, v['frequency'], v['width'])
    if name == 'band':
        return band(y, dt, 0.5 * (v['low'] + v['high']), v['high'] - v['low'])
    if name == 'low_pass':
        return low_pass(y, dt, v['cutoff'])
    if name == 'shared_noise':
        return shared(y, own, {})
    if name == 'accel_coupling':
        accel = {k: x for k, x in axes.items() if k.startswith('accel')}
        return foretold(y, accel, own if 'shared_noise' in before else {})
    mean = {'ramp': (s, False), 'transient': (np.exp(-s / (v.get('tc') or 1.0)), True),
            'step': ((s > (v.get('time') or 0)) * 1.0, True), 'drift': (np.sqrt(s), False)}
    if name in mean:
        return moved(y, *mean[name])
    samples = {'shock': lambda: shocks(raw, t, one.get('evidence', ''), v.get('ring')),
               'rate_quantization': lambda: grid(raw), 'quantization': lambda: rising(y, raw, dt),
               'variance_change': lambda: loudness(y),
               'gauss_markov': lambda: knee(y, dt, v['tc'])}
    return samples[name]() if name in samples else (None, '')
