# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Let the loop at mechanisms in the time domain that no effect's own code has inspired.

Figures for bench/RESULTS.md.

    python bench/mechanisms.py swell|thermal|stairs|shake|supply [--count 10] [--first 0]

A record is *right* where all that is found is true, *wrong* where a name is not, else the verdict
is said. *swell*: a tone whose phase and size wander a few times in the record. *thermal*: board,
die and element warm up and follow a room that is heated on and off; the bias is straight, bent or
late; the thermometer is slow and coarse. *stairs*: the thermometer is read once a second to a
whole or half a degree, of the three to ten that it warms up and that the room sways. *shake*: two
modes of a mount on a shaken floor, rates follow their velocity, accelerations their acceleration,
on each axis otherwise mixed. *supply*: noise that is louder while something runs, or warms up, or
cycles, or is switched on.

"""

from __future__ import annotations

import argparse
from pathlib import Path
import sys
import time
import zlib

import numpy as np
from scipy.signal import lfilter

TOP = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TOP), str(TOP / 'test')]

import hidden  # noqa: E402

from imu_noise_tools.core.record import ImuRecord  # noqa: E402
from imu_noise_tools.tasks.noise import analyse_record  # noqa: E402

GYRO = ('gyro_x', 'gyro_y', 'gyro_z')


def bed(rng, n, dt, size=1.0):
    """Return three axes of noise and the standard deviation of what is white in each."""
    out, level = [], []
    for _ in range(3):
        density = size * np.exp(rng.uniform(np.log(3e-5), np.log(3e-4)))
        b = density / (0.664 * np.sqrt(rng.uniform(20, 150)))
        level.append(density / np.sqrt(dt))
        out.append(level[-1] * rng.standard_normal(n) + hidden.flicker(n, dt, b, rng)
                   + hidden.random_walk(n, dt, 0.03 * b, rng))
    return out, level


def record_of(gyro, dt, accel=None, **covariates):
    """Return a record."""
    return ImuRecord(np.column_stack(gyro), None if accel is None else np.column_stack(accel),
                     np.arange(len(gyro[0])) * dt, 1 / dt, covariates=covariates)


def swell(rng):
    """Make a tone that forgets itself four to twenty-five times in the record."""
    dt, n = 1 / rng.choice([25.0, 50.0, 100.0]), int(rng.uniform(60e3, 100e3))
    axes, level = bed(rng, n, dt)
    f, tc = rng.uniform(0.05, 0.4) / dt, n * dt / rng.uniform(4, 25)
    a = np.exp(-dt / tc)
    push = np.sqrt(1 - a * a) * (rng.standard_normal(n) + 1j * rng.standard_normal(n))
    begin = [a * (rng.standard_normal() + 1j * rng.standard_normal())]
    size = lfilter([1.0], [1, -a], push, zi=begin)[0]
    axes[0] = axes[0] + rng.uniform(0.1, 1) * level[0] * np.real(
        size * np.exp(2j * np.pi * f * dt * np.arange(n)))
    return record_of(axes, dt), f'{f:.3g} Hz, {n * dt / tc:.0f} times', {'narrowband'}


def thermal(rng):
    """Make a sensor in a box in a room."""
    dt = 1 / rng.choice([20.0, 50.0])
    n, h = int(rng.uniform(0.4, 0.8) * 3600 / dt), 0.5
    t, form = np.arange(n) * dt, rng.choice(['straight', 'bent', 'cubic', 'late'])
    span, m = n * dt, int(n * dt / h) + 2
    board = die = element = thermometer = 22.0
    slow, fast, lag = rng.uniform(200, 900), rng.uniform(20, 80), rng.uniform(1, 20)
    late = rng.uniform(0.02, 0.08) * span if form == 'late' else h
    power, sway, period = rng.uniform(0, 6), rng.uniform(0.5, 3), rng.uniform(0.15, 0.6) * span
    course = np.empty((2, m))
    for i in range(m):
        room = 22 + sway * (1 if i * h % period < 0.45 * period else -1)
        board += h / slow * (room + power - board)
        die += h / fast * (board + 2 - die)
        element += h / late * (die - element)
        thermometer += h / lag * (die - thermometer)
        course[:, i] = element, thermometer
    u = (course[0] - course[0].mean()) / (0.5 * np.ptp(course[0]))
    bend = {'bent': rng.choice([-1, 1]) * rng.uniform(0.5, 1.5) * u**2,
            'cubic': 1.5 * rng.choice([-1, 1]) * u**3 - u * rng.uniform(0.4, 1.6)}
    y = np.interp(t, h * np.arange(m), u + bend.get(str(form), 0.0))
    every, step = rng.uniform(0.5, 6), min(rng.choice([0.0625, 0.25, 0.5]), np.ptp(course[1]) / 10)
    read = step * np.round(np.interp(t // every * every, h * np.arange(m), course[1]) / step)
    axes, level = bed(rng, n, dt)
    size = level[0] * np.sqrt(dt * 30 / span) * np.exp(rng.uniform(np.log(10), np.log(60)))
    axes[0] = axes[0] + size * (y - y.mean()) / y.std()
    said = f'{form}, read each {every:.1f} s to {step:.2f} degC, {lag:.0f} s late'
    return record_of(axes, dt, temperature=read), said, {'temperature'}


def stairs(rng):
    """Make a sensor beside a thermometer of a few levels of what the die goes through."""
    dt, seconds = 0.5, 7200
    n, s = int(seconds / dt), np.arange(seconds + 1.0)
    if rng.random() < 0.5:
        kind = 'air conditioning'
        warmth = rng.uniform(3, 7) * (1 - np.exp(-s / rng.uniform(1500, 4000)))
        warmth += rng.uniform(0.6, 1.5) * np.sin(2 * np.pi * s / rng.uniform(900, 2400))
    else:
        kind, a, b = 'weather', np.exp(-1 / 600), np.exp(-1 / 200)
        room = lfilter([1], [1, -a], rng.standard_normal(len(s) + 3000))
        room = lfilter([1 - b], [1, -b], room)[3000:]
        warmth = rng.uniform(1.8, 4.5) * (room - room.mean()) / room.std()
    a = np.exp(-1 / rng.uniform(10, 90))
    late = lfilter([1 - a], [1, -a], warmth, zi=[a * warmth[0]])[0]
    u = np.interp(np.arange(n) * dt, s, late - late.mean())
    step = rng.choice([0.5, 1.0])
    read = np.interp(np.arange(n) * dt, s, step * np.round((25 + warmth) / step))
    axes, level = bed(rng, n, dt)
    axes[0] = axes[0] + level[0] * rng.uniform(0.5, 2) * (u + rng.uniform(-0.2, 0.2) * u**2)
    return record_of(axes, dt, temperature=read), f'{kind}, in steps of {step}', {'temperature'}


def shake(rng):
    """Make a mount with two modes, integrated at eight times the rate."""
    dt = 1 / rng.choice([50.0, 100.0])
    n, h = int(rng.uniform(0.15, 0.4) * 3600 / dt), dt / 8
    f0 = np.exp(rng.uniform(np.log(0.4), np.log(0.3 / dt)))
    modes = [(f0, rng.uniform(3, 40)), (f0 * rng.uniform(0.7, 1.4), rng.uniform(3, 40))]
    push, moves = rng.standard_normal(8 * n + 4000), []
    for f, q in modes:
        w = 2 * np.pi * f
        x = lfilter([0, h * h], [1 + h * w / q, h * h * w * w - 2 - h * w / q, 1.0], push)
        v = np.gradient(x, h)
        moves.append([z[3999::8][:n] / z.std() for z in (v, np.gradient(v, h))])
    (gyro, rate), (accel, force) = bed(rng, n, dt), bed(rng, n, dt, 50.0)
    width = np.sqrt(f0 / modes[0][1] * dt)
    for some, level, kind, low, high in ((gyro, rate, 0, 2, 12), (accel, force, 1, 5, 60)):
        for i in range(3):
            size = level[i] * width * np.exp(rng.uniform(np.log(low), np.log(high)))
            for gain, mode in zip(rng.normal(0, 1, 2) * [1, 0.4], moves):
                some[i] = some[i] + size * gain * mode[kind]
    accel[2] = accel[2] + 9.80665
    felt = rng.random() < 0.5
    said = ', '.join(f'{f:.2f} Hz Q {q:.0f}' for f, q in modes) + (', accel' if felt else '')
    return (record_of(gyro, dt, accel if felt else None), said,
            {'accel_coupling', 'shared_noise', 'narrowband'})


def supply(rng):
    """Make noise of something that runs now and then, warms up, cycles or is switched on."""
    dt, n = 1 / rng.choice([25.0, 50.0, 100.0]), int(rng.uniform(40e3, 80e3))
    u = np.arange(n) / n
    axes, level = bed(rng, n, dt)
    form = rng.choice(['runs', 'runs', 'warms', 'cycles', 'switched'])
    if form == 'runs':
        marks = np.zeros(2)
        while np.diff(marks).min() < 0.04:
            marks = np.sort(rng.uniform(0.03, 0.97, 2 * int(rng.integers(2, 5))))
        on = (np.searchsorted(marks, u) % 2).astype(float)
    elif form == 'warms':
        on = 1 - np.exp(-u / rng.uniform(0.3, 2))
    elif form == 'cycles':
        on = 0.5 + 0.5 * np.sin(2 * np.pi * u * rng.uniform(2, 9) + rng.uniform(0, 6))
    else:
        on = (u > rng.uniform(0.2, 0.8)).astype(float)
    more = np.exp(rng.uniform(np.log(0.15), np.log(2)))
    axes[0] = axes[0] + level[0] * np.sqrt(more * on / on.max()) * rng.standard_normal(n)
    return record_of(axes, dt), f'{form}, {1 + more:.2f} times', {'variance_change'}


def main():
    """Run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('name', choices=('swell', 'thermal', 'stairs', 'shake', 'supply'))
    parser.add_argument('--count', type=int, default=10)
    parser.add_argument('--first', type=int, default=0)
    args = parser.parse_args()
    make = {'swell': swell, 'thermal': thermal, 'stairs': stairs, 'shake': shake,
            'supply': supply}[args.name]
    told: dict[str, int] = {}
    for seed in range(args.first, args.first + args.count):
        record, said, true = make(np.random.default_rng([zlib.crc32(args.name.encode()), seed]))
        begin = time.process_time()
        study = analyse_record(record, axes=GYRO, keep_motion=True)
        found = study.diagnose(['gyro_x'])['gyro_x']
        names = [f.name for f in found.found]
        outcome = 'right' if names and set(names) <= true else 'wrong' if names else found.verdict
        told[outcome] = told.get(outcome, 0) + 1
        left = [f.name for f in found.remaining.failed] if found.remaining else []
        print(f'{seed} {said}: {outcome}; {", ".join(names) or "-"}; '
              f'remains {", ".join(left) or "-"}; {time.process_time() - begin:.0f} CPU s',
              flush=True)
    print(args.name, told)


if __name__ == '__main__':
    main()
