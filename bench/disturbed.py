# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Disturbed stretches: how many are found, and how often a clean record is called disturbed.

Clean records have every kind of noise a sensor makes by itself or a bench makes all the time; the
others have knocks, steps of people, a motor that runs for a while, a step, or clipping on top. Run
as ``python bench/disturbed.py [--records 200] [--seed 1] [--ends]``.

"""

from __future__ import annotations

import argparse
import time

import numpy as np
from scipy.signal import lfilter

from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.core.stillness import handled_ends
from imu_noise_tools.health import prepare

GRADES = {'tactical': (3e-5, 5e-4), 'industrial': (1e-4, 1e-3), 'MEMS': (3e-4, 3e-3),
          'toy': (1e-3, 8e-3)}
RATES = (50, 100, 100, 200, 200, 400)


def white(rng, n):
    """Return unit noise of six axes."""
    return rng.standard_normal((n, 6))


def walk(rng, n, rate):
    """Return a random walk as strong as the white noise within 0.3 to 30 s."""
    cross = rate * 10 ** rng.uniform(-0.5, 1.5)
    return white(rng, n) + np.cumsum(rng.standard_normal((n, 6)), axis=0) / cross


def flicker(rng, n, rate):
    """Return white and strong 1/f noise."""
    f = np.fft.rfftfreq(n)
    f[0] = 1
    shape = f ** -0.5
    z = np.fft.irfft(shape[:, None] * np.fft.rfft(rng.standard_normal((n, 6)), axis=0), n, axis=0)
    return white(rng, n) + z * 10 ** rng.uniform(-1, 0.3)


def coarse(rng, n, rate):
    """Return noise rounded to half to six standard deviations."""
    step = 10 ** rng.uniform(-0.3, 0.8)
    return np.round((white(rng, n) + rng.uniform(-3, 3, 6)) / step) * step


def drift(rng, n, rate):
    """Return noise over a temperature drift of many standard deviations."""
    t = np.linspace(0, 1, n)[:, None]
    return white(rng, n) + 10 ** rng.uniform(0, 2) * (np.exp(-t / 0.2) + 0.3 * np.sin(5 * t))


def vibration(rng, n, rate):
    """Return steady lines, 1 to 30 standard deviations, on all axes."""
    t = np.arange(n) / rate
    x = white(rng, n)
    for _ in range(int(rng.integers(1, 4))):
        f = rng.uniform(0.05, 0.48) * rate
        x += np.sin(2 * np.pi * f * t + rng.uniform(0, 6))[:, None] * (
            10 ** rng.uniform(0, 1.5) * rng.uniform(0.2, 1, 6)
        )
    return x


def resonance(rng, n, rate):
    """Return a vibration of random amplitude, shared by all axes: a structure that rings."""
    f, q = rng.uniform(0.05, 0.4), 10 ** rng.uniform(0.7, 2)
    r = np.exp(-np.pi * f / q)
    z = lfilter([1], [1, -2 * r * np.cos(2 * np.pi * f), r * r], rng.standard_normal(n))
    gain = 10 ** rng.uniform(0, 1) * rng.uniform(0.3, 1, 6)
    return white(rng, n) + gain * (z / z.std())[:, None]


def popcorn(rng, n, rate):
    """Return noise that jumps between two levels."""
    x = white(rng, n)
    for k in range(int(rng.integers(1, 4))):
        dwell = 10 ** rng.uniform(0, 2) * rate
        flips = np.cumsum(rng.exponential(dwell, int(3 * n / dwell) + 10)).astype(int)
        level = np.zeros(n)
        level[flips[flips < n]] = 1
        x[:, k] += 10 ** rng.uniform(0, 1) * (np.cumsum(level) % 2)
    return x


def spikes(rng, n, rate):
    """Return lone outliers of each axis by itself."""
    share = 10 ** rng.uniform(-5, -1.7)
    hit = rng.random((n, 6)) < share
    return white(rng, n) + hit * rng.choice([-1, 1], (n, 6)) * rng.uniform(5, 30)


def heavy(rng, n, rate):
    """Return noise of Student's distribution."""
    return rng.standard_t(rng.uniform(2.5, 6), (n, 6))


def plain(rng, n, rate):
    """Return white noise."""
    return white(rng, n)


CLEAN = (plain, walk, flicker, coarse, drift, vibration, resonance, popcorn, spikes, heavy)


def times(rng, n, rate, count, apart=30.0):
    """Return starts of so many events, far from each other and from the ends, samples."""
    while True:
        at = np.sort(rng.uniform(20 * rate, n - 90 * rate, count))
        if count < 2 or np.min(np.diff(at)) > apart * rate:
            return at.astype(int)


def knocks(rng, x, rate):
    """Add one to six knocks of 12 to 60 standard deviations that ring down."""
    events = []
    for at in times(rng, len(x), rate, int(rng.integers(1, 7))):
        t = np.arange(int(1.0 * rate)) / rate
        ring = np.exp(-t / rng.uniform(0.05, 0.2)) * np.sin(
            2 * np.pi * rng.uniform(5, min(40, 0.4 * rate)) * t + 1)
        x[at:at + len(t)] += np.outer(ring, rng.uniform(12, 60) * rng.uniform(0.4, 1, 6))
        events.append((at / rate, at / rate + 0.2))
    return events


def people(rng, x, rate):
    """Add the steps of somebody who walks by, 2 a second for 10 to 20 s."""
    at = int(times(rng, len(x), rate, 1)[0])
    seconds = rng.uniform(10, 20)
    for k in np.arange(0, seconds, 0.5):
        t = np.arange(int(0.4 * rate)) / rate
        ring = np.exp(-t / 0.08) * np.sin(2 * np.pi * 9 * t)
        i = at + int(k * rate)
        x[i:i + len(t)] += np.outer(ring, rng.uniform(8, 20) * rng.uniform(0.3, 1, 6))
    return [(at / rate, at / rate + seconds)]


def motor(rng, x, rate):
    """Add a motor that runs for 5 s to 4 % of the time, 4 to 20 standard deviations strong."""
    at = int(times(rng, len(x), rate, 1)[0])
    m = int(min(rng.uniform(5, 60), 0.04 * len(x) / rate) * rate)
    t = np.arange(m) / rate
    line = np.sin(2 * np.pi * rng.uniform(0.1, 0.45) * rate * t)
    x[at:at + m] += np.outer(line, rng.uniform(4, 20) * rng.uniform(0.4, 1, 6))
    return [(at / rate, (at + m) / rate)]


def step(rng, x, rate):
    """Add a step of one axis, 8 to 40 standard deviations."""
    at = int(times(rng, len(x), rate, 1)[0])
    x[at:, int(rng.integers(6))] += rng.choice([-1, 1]) * rng.uniform(8, 40)
    return [(at / rate, at / rate)]


def hard(rng, x, rate):
    """Add a long knock that leaves the range, and cut it there."""
    at = int(times(rng, len(x), rate, 1)[0])
    t = np.arange(int(1.5 * rate)) / rate
    x[at:at + len(t)] += np.outer(np.exp(-t / 0.5) * np.sin(2 * np.pi * 4 * t),
                                  300 * rng.uniform(0.5, 1, 6))
    np.clip(x, -100, 100, out=x)
    return [(at / rate, at / rate + 0.5)]


EVENTS = (knocks, people, motor, step, hard)


def record(x, rate, grade):
    """Return unit noise as a record of a grade of sensor."""
    scale = np.repeat(np.array(GRADES[grade]) * np.sqrt(rate), 3)
    y = x * scale + [0.01, -0.02, 0.0, 0.1, 0.2, 9.8]
    return ImuRecord(y[:, :3], y[:, 3:], np.arange(len(y)) / rate, float(rate))


def draw(rng, noise):
    """Return unit noise, its rate and a grade."""
    rate = int(rng.choice(RATES))
    n = int(rng.uniform(400, 1800) * rate)
    return noise(rng, n, rate), rate, str(rng.choice(list(GRADES)))


def clean(count, seed):
    """Print what is said of clean records."""
    print('| clean record | records | something set aside | something listed |')
    print('|---|---|---|---|')
    total = np.zeros(3, int)
    for k, noise in enumerate(CLEAN):
        row = np.zeros(3, int)
        for i in range(count // len(CLEAN)):
            rng = np.random.default_rng([seed, 0, k, i])
            found = prepare(record(*draw(rng, noise)), keep_motion=True)
            row += [1, bool(found.left_out), bool(found.disturbances)]
        total += row
        print(f'| {noise.__name__} | {row[0]} | {row[1]} | {row[2]} |', flush=True)
    print(f'| all | {total[0]} | {total[1]} | {total[2]} |\n')


def disturbed(count, seed):
    """Print how many events are found, set aside, and how much else is listed."""
    print('| event | events | listed | set aside | listed beside them |')
    print('|---|---|---|---|---|')
    for k, event in enumerate(EVENTS):
        all_of, listed, aside, other = 0, 0, 0, 0
        for i in range(count // len(EVENTS)):
            rng = np.random.default_rng([seed, 1, k, i])
            x, rate, grade = draw(rng, CLEAN[int(rng.integers(0, 3))])
            events = event(rng, x, rate)
            found = prepare(record(x, rate, grade), keep_motion=True)
            spans = [(d.begin, d.end) for d in found.disturbances]
            for a, b in events:
                all_of += 1
                listed += any(c < b + 1 and a < d + 1 for c, d in spans)
                aside += any(c < b + 1 and a < d + 1 for c, d, _ in found.left_out)
            other += sum(
                not any(c < b + 3 and a < d + 3 for a, b in events) for c, d in spans
            )
        print(f'| {event.__name__} | {all_of} | {listed} | {aside} | {other} |', flush=True)


def rock(rng, x, rate):
    """Add a swing of 0.3 to 2 Hz, gone after 3 to 15 s, at one end or both; return where."""
    where = int(rng.integers(1, 4))
    out = [0.0, 0.0]
    for end in (0, 1):
        if where & (1 << end):
            seconds = rng.uniform(3, 15)
            t = np.arange(int(seconds * rate)) / rate
            wave = np.sin(2 * np.pi * rng.uniform(0.3, 2) * t + rng.uniform(0, 6))
            size = 10 ** rng.uniform(0, 1.5) * rng.uniform(0.3, 1, 6)
            piece = slice(0, len(t)) if end == 0 else slice(len(x) - len(t), None)
            x[piece] += np.outer(wave * rng.uniform(0.7, 1.3, len(t)), size)
            out[end] = seconds
    return out


def ends(count, seed):
    """Print how often an end that is rocked is cut off, and one that is not."""
    print('| record | ends | cut off | of them more than 5 s too much | CPU s a record |')
    print('|---|---|---|---|---|')
    kinds = [(noise, False) for noise in CLEAN] + [(noise, True) for noise in CLEAN[:3]]
    for k, (noise, rocked) in enumerate(kinds):
        many, cut, far, cpu = 0, 0, 0, 0.0
        draws = max(1, count // len(CLEAN))
        for i in range(draws):
            rng = np.random.default_rng([seed, 2, k, i])
            x, rate, grade = draw(rng, noise)
            true = rock(rng, x, rate) if rocked else [0.0, 0.0]
            begun = time.process_time()
            begin, end = handled_ends(record(x, rate, grade))
            cpu += time.process_time() - begun
            for said, there in zip((begin, len(x) - end), true):
                if bool(there) == rocked:
                    many += 1
                    cut += said > 0
                    far += said / rate > there + 5
        name = f'{noise.__name__}, rocked by 1 to 30 standard deviations' if rocked \
            else noise.__name__
        print(f'| {name} | {many} | {cut} | {far} | {cpu / draws:.2f} |', flush=True)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--records', type=int, default=200)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--ends', action='store_true', help='of the ends of records alone')
    args = parser.parse_args()
    if args.ends:
        ends(args.records, args.seed)
    else:
        clean(args.records, args.seed)
        disturbed(args.records, args.seed)


if __name__ == '__main__':
    main()
