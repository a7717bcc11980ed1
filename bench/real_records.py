# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Read N, B and K off the Allan curves of the shared records, in a few lines that use no package.

    python bench/real_records.py [--data ../shared/data] [--json BEFORE AFTER] [--only NAME]

N is the overlapping Allan deviation at 1 s, once as it is and once with lines below 2 Hz taken out
(sinusoids fitted to stretches of 100 s by least squares, since such lines wander); `white part` is
the N of that curve without what flicker noise holds of it at 1 s: least squares of sigma^2 =
N^2/tau + c over 0.3 ... 10 s. B is the curve's minimum over 0.664 (1 s <= tau <= T/10), K the
deviation over sqrt(tau/3) at T/10 where it has risen by a half above the minimum. With
``--json`` the readings stand beside what ``imu_noise analyse --json`` said, kept as NAME.json in
each of the folders, so that any versions of the package can be compared; the stretch that is read
is then the one that the last of them analysed, less what it left out. Bags are read with rosbags.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

NAMES = ('adis16405_run2', 'adis16405_run6', 'mpu6050_static_449s', 'mpu6050_static_100s',
         'mpu6050_buffered_655s', 'vn100_desk_756s', 'px4_auavx21', 'truck_idle_xsens_45s',
         'amr_imu_static_mcap', 'imu_tools_phidgets_imu_upside_down')
LABEL = (('white', 'N'), ('flicker', 'B'), ('random_walk', 'K'))


# --- the records ---------------------------------------------------------------------------------

def load(data, name):
    """Return t (n,) s and {axis: samples (n,)}."""
    file = data / 'records' / f'{name}.npz'
    if not file.is_file():
        return from_bag(data / 'bags' / name)
    with np.load(file) as kept:
        axes = {f'{s}_{c}': kept[s][:, i].astype(float) for s in ('gyro', 'accel') if s in kept
                for i, c in enumerate('xyz')}
        n = len(next(iter(axes.values())))
        t = kept['t'].astype(float) if 't' in kept else np.arange(n) / float(kept['rate_hz'])
    return t, axes


def from_bag(path):
    """Return the same of the first topic with Imu messages."""
    from rosbags.highlevel import AnyReader
    path = path if path.exists() else path.with_suffix('.bag')
    rows = []
    with AnyReader([path]) as reader:
        topic = next(c for c in reader.connections if c.msgtype == 'sensor_msgs/msg/Imu')
        for connection, _, raw in reader.messages([topic]):
            m = reader.deserialize(raw, connection.msgtype)
            w, a, s = m.angular_velocity, m.linear_acceleration, m.header.stamp
            rows.append((s.sec + 1e-9 * s.nanosec, w.x, w.y, w.z, a.x, a.y, a.z))
    rows = np.array(rows)
    names = [f'{s}_{c}' for s in ('gyro', 'accel') for c in 'xyz']
    return rows[:, 0], dict(zip(names, rows[:, 1:].T))


def analysed(t, source):
    """Return which samples (n,) an analysis used."""
    begin = float(source.get('start') or 0.0)
    origin = begin if begin > t[-1] - t[0] + 1 else t[0] + begin  # of the clock, or of the record
    some = (t >= origin - 1e-6) & (t <= origin + float(source['duration_s']) + 1e-6)
    for low, high, *_ in source.get('left_out') or ():
        some &= ~((t >= origin + low) & (t <= origin + high))
    return some


# --- the readings --------------------------------------------------------------------------------

def deviation(y, m):
    """Return the overlapping Allan deviation of y (n,) at m samples."""
    x = np.concatenate([[0.0], np.cumsum(y - y.mean())])
    d = x[2 * m:] - 2 * x[m:-m] + x[:-2 * m]
    return np.sqrt(0.5 * np.mean(d ** 2)) / m


def readings(y, dt):
    """Return N, N beside lines, its white part, B, K; K is nan where the curve does not rise."""
    m = np.unique(np.round(np.geomspace(1, len(y) // 10, 60)).astype(int))
    s = np.array([deviation(y, k) for k in m])
    low = s[m * dt >= min(1.0, m[-1] * dt / 2)].min()
    k = s[-1] / np.sqrt(m[-1] * dt / 3) if s[-1] > 1.5 * low else np.nan
    one, rest = max(1, round(1 / dt)), without_lines(y, dt)
    return deviation(y, one), deviation(rest, one), white_part(rest, dt), low / 0.664, k


def white_part(y, dt):
    """Return N of sigma^2 = N^2/tau + c, fitted to the curve over 0.3 ... 10 s (T/10 at most)."""
    longest = min(10.0, len(y) * dt / 10)
    m = np.unique(np.round(np.geomspace(0.3, longest, 16) / dt).astype(int))
    m = m[m > 0]
    s2 = np.array([deviation(y, k) ** 2 for k in m])
    root = 1 / (s2 * np.sqrt(m))        # a deviation at m scatters as sqrt(m)
    rows = np.column_stack([1 / (m * dt), np.ones(len(m))]) * root[:, None]
    (n2, c), *_ = np.linalg.lstsq(rows, s2 * root, rcond=None)
    return np.sqrt(n2 if c > 0 else np.mean(s2 * m * dt))


def without_lines(y, dt, span=100.0, high=2.0, clear=25.0):
    """
    Return y (n,) less the sinusoids below ``high`` Hz of each stretch of about ``span`` s.

    Those that stand ``clear`` times above the median power of the half octaves around them: of
    chance alone one in e^17 does.
    """
    out = y.copy()
    for part in np.array_split(np.arange(len(y)), max(1, round(len(y) * dt / span))):
        t = np.arange(len(part)) * dt
        some = out[part]
        trend = np.polynomial.chebyshev.chebvander(2 * t / t[-1] - 1, 3)
        for _ in range(6):
            rest = some - trend @ np.linalg.lstsq(trend, some, rcond=None)[0]
            f = np.fft.rfftfreq(8 * len(part), dt)
            p = np.abs(np.fft.rfft(rest * np.hanning(len(part)), 8 * len(part))) ** 2
            inside = np.flatnonzero((f > 10 / t[-1]) & (f < high))
            if not len(inside):
                break
            top = inside[np.argmax(p[inside] * f[inside])]
            near = (f > f[top] / 1.4) & (f < f[top] * 1.4)
            if p[top] < clear * np.median(p[near]):
                break
            # a sinusoid whose frequency and size drift a little: its columns times 1 and t
            angle = 2 * np.pi * f[top] * t
            wave = np.column_stack([np.cos(angle), np.sin(angle)])
            wave = np.column_stack([wave, wave * (2 * t / t[-1] - 1)[:, None]])
            x = np.column_stack([wave, trend])
            some = some - wave @ np.linalg.lstsq(x, some, rcond=None)[0][:wave.shape[1]]
        out[part] = some
    return out


# --- the table -----------------------------------------------------------------------------------

def main():
    """Run."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--data', type=Path,
                        default=Path(__file__).resolve().parents[2] / 'shared' / 'data')
    parser.add_argument('--json', type=Path, nargs='*', default=(), help='folders of NAME.json')
    parser.add_argument('--only', help='one record')
    args = parser.parse_args()
    print('| record, axis | N at 1 s | beside lines | white part | B of the floor | K |'
          + ' N | B | K |' * len(args.json) + ' model/curve at 1 s | set aside | sufficient |\n|'
          + '---|' * (9 + 3 * len(args.json)))
    for name in NAMES:
        if args.only not in (None, name):
            continue
        t, axes = load(args.data, name)
        said = [report(folder, name) for folder in args.json]
        source = (said[-1] if said else {}).get('source')
        some = analysed(t, source) if source else np.ones(len(t), bool)
        dt, usual = float(np.ptp(t)) / (len(t) - 1), float(np.median(np.diff(t)))
        if abs(usual / dt - 1) < 0.1:  # else stamps come in bursts; gaps lengthen the mean
            dt = usual
        for axis, y in axes.items():
            y = y[some & np.isfinite(y)]
            if np.ptp(y) == 0:
                continue
            read = readings(y, dt)
            found = [d.get('targets', {}).get(axis) for d in said]
            print(' | '.join([f'| {name}, {axis}', *(f'{v:.3g}' for v in read),
                              *(x for one in found for x in values(one)),
                              *(last(found[-1], read[1]) if found else ['-'] * 3)]) + ' |',
                  flush=True)


def report(folder, name):
    """Return what an analysis said, {} where it refused."""
    file = folder / f'{name}.json'
    return json.loads((file.read_text() if file.is_file() else '') or '{}')


def values(found):
    """Return N, B, K of an analysis."""
    return [shown(found['effects'][e][k]) if found else '-' for e, k in LABEL]


def last(found, curve):
    """Return the model's deviation at 1 s over the curve's, what was set aside, sufficient."""
    if not found:
        return ['-'] * 3
    n, b, k = (found['effects'][e][p]['value'] or 0.0 for e, p in LABEL)
    model = np.sqrt(n**2 + 2 * np.log(2) / np.pi * b**2 + k**2 / 3)
    aside = found.get('set_aside', ())
    said = '; '.join(f'{s["from_hz"]:.3g}-{s["to_hz"]:.3g} Hz' for s in aside[:4])
    said += f' and {len(aside) - 4} more' if len(aside) > 4 else ''
    return [f'{model / curve:.2f}', said, 'yes' if found.get('sufficient') else 'no']


def shown(e):
    """Return a value, or its limit."""
    return f'{e["value"]:.3g}' if e['value'] is not None else f'< {e.get("upper95") or 0:.2g}'


if __name__ == '__main__':
    main()
