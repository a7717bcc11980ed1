# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How fast bags are read: in bulk, by rosbags' own deserialiser, and as raw bytes.

``python bench/reading.py [HOURS]`` writes bags of 200 Hz (default 0.5 h) of every kind into a
temporary folder and prints millions of messages per CPU second, and the two ratios, all in one
run. What deserialising adds for rosbags is measured on 100 000 messages. It checks that all give
the same numbers.

"""

from __future__ import annotations

from itertools import islice
from pathlib import Path
import subprocess
import sys
import tempfile
import time

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.typesys import get_typestore, Stores

from imu_noise_tools.bag import Block, iter_blocks, open_record, write_bag

RATE = 200
SOME = 100_000
TURNS = 3
KINDS = {'mcap': {}, 'mcap zstd': {'compression': 'zstd'}, 'sqlite3': {'storage': 'sqlite3'},
         'rosbag1': {'storage': 'rosbag1'}}
STORE = get_typestore(Stores.ROS2_JAZZY)
MEMORY = """
import re, sys
from imu_noise_tools.bag import open_record
open_record(sys.argv[1])
print(int(re.search(r'VmHWM:\\s*(\\d+)', open('/proc/self/status').read())[1]) // 1024)
"""


def blocks(n: int):
    """Yield n samples of a unit at rest."""
    rng = np.random.default_rng(0)
    for k in range(0, n, 4096):
        m = min(4096, n - k)
        t = 1_700_000_000_000_000_000 + np.round((k + np.arange(m)) * 1e9 / RATE).astype(np.int64)
        yield Block(t, t, 1e-3 * rng.standard_normal((m, 3)),
                    2e-2 * rng.standard_normal((m, 3)) + [0, 0, 9.8], 'imu_link')


def cpu(run) -> tuple[float, object]:
    """Return CPU seconds and the result."""
    begin = time.process_time()
    found = run()
    return time.process_time() - begin, found


def messages(path, count: int, decode: bool) -> np.ndarray:
    """
    Read messages one by one with rosbags.

    Return the rates about x, or lengths of the raw bytes.

    """
    out = []
    with AnyReader([path], default_typestore=STORE) as reader:
        for connection, _, raw in islice(reader.messages(), count):
            if decode:
                out.append(reader.deserialize(raw, connection.msgtype).angular_velocity.x)
            else:
                out.append(len(raw))
    return np.array(out)


def measure(path: Path, n: int) -> tuple[float, float, float]:
    """Return M messages per CPU second in bulk, deserialised by rosbags, and as raw bytes."""
    some = min(n, SOME)
    bulk = raw = decoding = np.inf
    for _ in range(TURNS):
        spent, record = cpu(lambda: open_record(path))
        bulk = min(bulk, spent)
        spent, _ = cpu(lambda: messages(path, n, False))
        raw = min(raw, spent)
        # Deserialising is the same for every message: what it adds is measured on some of them.
        spent, plain = cpu(lambda: messages(path, some, True))
        without, _ = cpu(lambda: messages(path, some, False))
        decoding = min(decoding, (spent - without) * n / some)
        assert np.array_equal(record.gyro[:some, 0], plain)
    return n / bulk / 1e6, n / (raw + decoding) / 1e6, n / raw / 1e6


def main() -> int:
    """Measure every kind of bag; return 1 where a figure is missed."""
    hours = float(sys.argv[1]) if len(sys.argv) > 1 else 0.5
    n = int(hours * 3600 * RATE)
    missed = 0
    print(f'{n} messages, M messages per CPU second (best of {TURNS})')
    print(
        f'{"":10s} {"bulk":>6s} {"rosbags":>8s} {"raw":>6s} {"x rosbags":>10s} {"x raw":>6s} '
        f'{"blocks":>7s} '
        f'{"write":>6s} {"MB":>5s}'
    )
    with tempfile.TemporaryDirectory(prefix='imu_noise_bench_') as folder:
        for name, options in KINDS.items():
            path = Path(folder) / (name.replace(' ', '_') + '.bag' * (name == 'rosbag1'))
            written, _ = cpu(lambda: write_bag(path, blocks(n), **options))
            bulk, plain, raw = measure(path, n)
            passed, _ = cpu(lambda: sum(len(b.stamp) for b in iter_blocks(path)))
            peak = subprocess.run(
                [sys.executable, '-c', MEMORY, str(path)],
                capture_output=True,
                text=True,
                check=True,
            ).stdout.strip()
            good = bulk >= 5 * plain and bulk >= 0.5 * raw
            missed += not good
            print(
                f'{name:10s} {bulk:6.2f} {plain:8.3f} {raw:6.2f} {bulk / plain:10.1f} '
                f'{bulk / raw:6.2f} '
                f'{n / passed / 1e6:7.2f} {n / written / 1e6:6.2f} {peak:>5s}  '
                f'{"ok" if good else "MISSED"}'
            )
    print('asked: 5 x rosbags, 0.5 x raw; MB is the peak of a process that reads the whole record')
    return int(missed > 0)


if __name__ == '__main__':
    sys.exit(main())
