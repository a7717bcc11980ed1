# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Print what the loop says of each axis of the shared records, beside what a plain spectrum shows.

    python bench/real_verdicts.py [--data ../shared/data] [--only NAME,...] [-o FOLDER]

Each record goes to ``imu_noise analyse`` and ``diagnose`` as processes, and only their JSON is
read. Behind each name stands whether a plain script bears it out (`real_names.py`): + yes, ! no,
? it cannot tell; what it measured follows below the table. The last two columns use no
package either: Welch's spectrum of the stretch that was analysed
(Hann's window, 64 pieces), its peaks that stand five times and more above the median of a third
of an octave around them, each told with whether a line, a harmonic or a narrow band was named
there; and the share of equal neighbours, which an output step or held samples explain.
"""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path
import resource
import subprocess
import sys
import tempfile

import numpy as np
from real_names import check
from real_records import analysed, load, NAMES

COMMAND = Path(sys.executable).parent / 'imu_noise'
PIECES, CLEAR, MOST = 64, 5.0, 6


def run(*arguments) -> tuple[dict, float]:
    """Return the JSON of a command and its CPU seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    got = subprocess.run([str(COMMAND), *map(str, arguments), '--json'], capture_output=True,
                         text=True, env={'OMP_NUM_THREADS': '1', **os.environ,
                                         'PYTHONDONTWRITEBYTECODE': ''})
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if got.returncode:
        print(got.stderr.strip(), file=sys.stderr)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return json.loads(got.stdout or '{}') if got.returncode == 0 else {}, cpu


def peaks(y: np.ndarray, dt: float) -> list[tuple[float, float]]:
    """Return (Hz, times the level around) of the clearest peaks, those side by side as one."""
    n = max(256, len(y) // PIECES)
    window = np.hanning(n)
    pieces = np.lib.stride_tricks.sliding_window_view(y, n)[::n // 2]
    power = np.mean([np.abs(np.fft.rfft((x - x.mean()) * window))**2 for x in pieces], axis=0)
    f, out = np.fft.rfftfreq(n, dt), []
    reach = np.maximum(8, np.arange(len(f)) // 6)
    over = np.array([p / np.median(power[max(3, i - r):i + r + 1])
                     for i, (p, r) in enumerate(zip(power, reach))])
    over[:4] = 0
    for i in np.argsort(-over):
        if over[i] < CLEAR or len(out) == MOST:
            break
        if all(abs(f[i] - g) > max(4 * f[1], 0.05 * g) for g, _ in out):
            out.append((float(f[i]), float(over[i])))
    return out


def bands(found) -> list[tuple[float, float]]:
    """Return (Hz, half width) of each line, order and narrow band that was named."""
    out = []
    for one in found:
        values = {k: v.get('value') for k, v in one.get('parameters', {}).items()}
        f, width = values.get('frequency'), values.get('width') or 0.0
        if f:
            orders = [int(k.split('_')[1]) for k, v in values.items()
                      if k.startswith('amplitude_') and v] or [1]
            out += [(k * f, width) for k in orders]
    return out


def named(f: float, found, dt: float, resolution: float) -> bool:
    """Tell whether something was named at a frequency, folded at Nyquist."""
    return any(abs(f - abs((g * dt + 0.5) % 1 - 0.5) / dt) < w + max(2 * resolution, 0.01 * f)
               for g, w in bands(found))


def checked(t, axes, axis, left_out, found) -> list[tuple[str, str, str]]:
    """Return (name, mark, what was measured) of each finding on an axis."""
    out = []
    for i, one in enumerate(found):
        f = (one.get('parameters', {}).get('frequency') or {}).get('value')
        held, words = check(one, t, axes, axis, [x['effect'] for x in found[:i]], left_out)
        mark = '?' if held is None else '+' if held else '!'
        out.append((one['effect'] + (f' {f:.4g} Hz' if f else ''), mark, words))
    return out


def row(name, axis, y, dt, said, checks) -> str:
    """Return the row of one axis."""
    found = said.get('found', [])
    left = said.get('remaining') or {}
    words = [f'{what} {mark}' for what, mark, _ in checks]
    seen = [f'{f:.3g} Hz x{over:.0f}{"" if named(f, found, dt, PIECES / (len(y) * dt)) else " *"}'
            for f, over in peaks(y, dt)]
    views = ', '.join(dict.fromkeys(f['test'] for f in left.get('failed', ())))
    return ' | '.join([
        f'| {name}, {axis}', said.get('verdict', 'refused'), ', '.join(words) or '-', views or '-',
        {True: 'yes', False: 'no'}.get(said.get('sufficient'), '-'), ', '.join(seen) or '-',
        f'{100 * np.mean(np.diff(y) == 0):.1f} % |'])


def main():
    """Run."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--data', type=Path,
                        default=Path(__file__).resolve().parents[2] / 'shared' / 'data')
    parser.add_argument('--only', help='records, by commas')
    parser.add_argument('-o', '--output', type=Path, help='where the studies are kept')
    args = parser.parse_args()
    wanted = args.only.split(',') if args.only else NAMES
    folder = args.output or Path(tempfile.mkdtemp())
    measured: list[str] = []
    print('| record, axis | verdict | found | then fails | sufficient | peaks of a plain '
          'spectrum (*: not named) | equal neighbours |\n|---|---|---|---|---|---|---|')
    for name in wanted:
        path = next(p for p in (args.data / 'records' / f'{name}.npz', args.data / 'bags' / name,
                                args.data / 'bags' / f'{name}.bag') if p.exists())
        study = folder / f'{name}.study'
        source = run('analyse', path, '-o', study, '--force')[0].get('source')
        if not source:
            continue
        t, axes = load(args.data, name)
        some = analysed(t, source)
        whole = analysed(t, {**source, 'left_out': ()})
        inside = {k: x[whole] for k, x in axes.items()}
        result, cpu = run('diagnose', study)
        for axis, said in result.get('diagnosis', {}).items():
            y = axes[axis][some & np.isfinite(axes[axis])]
            checks = checked(t[whole], inside, axis, ~some[whole], said.get('found', []))
            print(row(name, axis, y, 1 / float(source['rate_hz']), said, checks), flush=True)
            measured += [f'{name}, {axis}, {a} {b} {c}' for a, b, c in checks]
        print(f'| {name}: {cpu:.1f} CPU s | | | | | | |', flush=True)
    print('', *measured, sep='\n- ')


if __name__ == '__main__':
    main()
