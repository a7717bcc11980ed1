# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What ``analyse`` costs with everything written, beside rosbags and allantools in the same run.

``python bench/limits.py [--hours 3] [--kinds mcap,sqlite3] [--keep DIR] [--turns 2]`` writes bags
of 200 Hz of every kind and prints CPU seconds (user and system, of the whole process) and peak
memory. rosbags' deserialiser is timed on the first 100 000 messages and scaled; allantools on one
axis and multiplied. ``--hours 24 --kinds mcap`` is the day.

"""

from __future__ import annotations

import argparse
from itertools import islice
import os
from pathlib import Path
import shutil
import sys
import tempfile
import time

import allantools
import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.typesys import get_typestore, Stores

from imu_noise_tools.bag import Block, write_bag
from imu_noise_tools.core.allan import cluster_sizes, overlapping_variance

RATE = 200
SOME = 100_000
KINDS = {'mcap': {}, 'mcap zstd': {'compression': 'zstd'}, 'sqlite3': {'storage': 'sqlite3'},
         'rosbag1': {'storage': 'rosbag1'}}
STORE = get_typestore(Stores.ROS2_JAZZY)
ASKED_CPU, ASKED_MB = 10.0, 500.0


def blocks(n: int, seed: int = 0):
    """Yield n samples of a MEMS-like unit at rest: white noise and random walk, stamps jitter."""
    rng = np.random.default_rng(seed)
    kinds = ((1e-4, 3e-6, [0.01, -0.02, 0.005]), (2e-3, 5e-5, [0.1, -0.2, 9.81]))
    level = [np.array(mean) for _, _, mean in kinds]
    for k in range(0, n, 4096):
        m = min(4096, n - k)
        t = 1_700_000_000_000_000_000 + np.round((k + np.arange(m)) * 1e9 / RATE).astype(np.int64)
        data = []
        for i, (density, walk, _) in enumerate(kinds):
            steps = rng.standard_normal((m, 3)) * walk / np.sqrt(RATE)
            drift = level[i] + np.cumsum(steps, axis=0)
            level[i] = drift[-1]
            data.append(drift + density * np.sqrt(RATE) * rng.standard_normal((m, 3)))
        yield Block(t + rng.integers(-20_000, 20_000, m), t + 100_000, *data, 'imu_link')


def bag(folder: Path, kind: str, hours: float) -> Path:
    """Return a bag of so many hours, written once."""
    name = f'{kind.replace(" ", "_")}_{hours:g}h' + '.bag' * (kind == 'rosbag1')
    path = folder / name
    if not path.exists():
        write_bag(path, blocks(round(hours * 3600 * RATE)), **KINDS[kind])
    return path


def process(*command: str) -> tuple[float, float, float]:
    """Run a command; return its CPU seconds, wall seconds and peak MB."""
    begin = time.monotonic()
    child = os.spawnvpe(os.P_NOWAIT, command[0], command,
                        {**os.environ, 'OMP_NUM_THREADS': '1', 'OPENBLAS_NUM_THREADS': '1'})
    _, status, used = os.wait4(child, 0)
    if status:
        raise SystemExit(f'{" ".join(command)}: status {status}')
    return (used.ru_utime + used.ru_stime, time.monotonic() - begin,
            used.ru_maxrss * 1024 / 1e6)


def analyse(path: Path, folder: Path) -> tuple[float, float, float]:
    """Analyse a bag in a process of its own; return CPU s, wall s, peak MB."""
    out = folder / f'{path.name}.study'
    shutil.rmtree(out, ignore_errors=True)
    return process(sys.executable, '-m', 'imu_noise_tools.cli.main', 'analyse', str(path), '-o',
                   str(out))


def rosbags_cpu(path: Path, n: int) -> float:
    """Return CPU seconds of rosbags' deserialiser for n messages, from the first of them."""
    def some(count):
        begin = time.process_time()
        with AnyReader([path], default_typestore=STORE) as reader:
            for connection, _, raw in islice(reader.messages(), count):
                reader.deserialize(raw, connection.msgtype)
        return time.process_time() - begin

    some(1)
    opening = some(1)
    return opening + max(0.0, some(SOME) - opening) * n / min(n, SOME)


def curve_cpu(n: int, turns: int) -> tuple[float, float, float]:
    """
    Return CPU seconds of one axis' overlapping deviation, 100 tau, by allantools and by us.

    Third comes the largest relative difference.

    """
    y = np.random.default_rng(0).standard_normal(n)
    m = cluster_sizes(n)
    theirs = ours = np.inf
    for _ in range(turns):
        begin = time.process_time()
        _, known, _, _ = allantools.oadev(y, rate=1.0, data_type='freq', taus=m.astype(float))
        between = time.process_time()
        found = np.sqrt(overlapping_variance(y, m))
        theirs = min(theirs, between - begin)
        ours = min(ours, time.process_time() - between)
    return theirs, ours, float(np.max(np.abs(found / known - 1)))


def main() -> int:
    """Measure every kind; return 1 where a figure for three hours is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--hours', type=float, default=3.0)
    parser.add_argument('--kinds', default=','.join(KINDS))
    parser.add_argument('--keep', type=Path, help='folder for the bags, kept')
    parser.add_argument('--turns', type=int, default=2)
    parser.add_argument('--no-peers', action='store_true')
    args = parser.parse_args()
    n = round(args.hours * 3600 * RATE)
    folder = args.keep or Path(tempfile.mkdtemp(prefix='imu_noise_bench_'))
    folder.mkdir(parents=True, exist_ok=True)
    missed = False
    try:
        curve = 0.0
        if not args.no_peers:
            curve, ours, apart = curve_cpu(n, args.turns)
            print(f'curve of an axis, 100 tau, {n} samples: allantools {curve:.2f} CPU s, here '
                  f'{ours:.2f}: {curve / ours:.1f} x (asked: 3), apart by {apart:.0e}')
        for kind in args.kinds.split(','):
            path = bag(folder, kind, args.hours)
            found = [analyse(path, folder) for _ in range(args.turns)]
            cpu, wall, peak = min(f[0] for f in found), min(f[1] for f in found), max(
                f[2] for f in found)
            missed |= args.hours <= 3 and (cpu > ASKED_CPU or peak > ASKED_MB)
            line = (f'{kind:10s} analyse {cpu:6.2f} CPU s, {wall:6.2f} s, '
                    f'{1e6 * cpu / n:.2f} us a message, peak {peak:.0f} MB')
            if not args.no_peers:
                peer = rosbags_cpu(path, n)
                line += (f'; rosbags {peer:.1f} CPU s; (rosbags + 6 allantools) / analyse '
                         f'{(peer + 6 * curve) / cpu:.1f}')
            print(line, flush=True)
    finally:
        if not args.keep:
            shutil.rmtree(folder, ignore_errors=True)
    print(f'asked of three hours: {ASKED_CPU:g} CPU s, {ASKED_MB:g} MB')
    return int(missed)


if __name__ == '__main__':
    sys.exit(main())
