# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Mutate bags, studies, specifications and calibrations, and run the commands on them.

``python bench/fuzz.py [--minutes 1] [--seed S] [--keep DIR]`` (``make fuzz``). Whatever is read,
a command must end with status 0, 1 or 2, one line of error and no trace of Python, within 20 s
and within 1.5 GB, and leave nothing over; every twentieth run is a process that is killed at a
random moment, after which the study that was there must be whole. What breaks this is kept with
the command that shows it. The seed is printed; a process of its own runs the commands, so that
one that dies is seen.

"""

from __future__ import annotations

import argparse
import collections
import contextlib
import io
import json
import multiprocessing
import os
from pathlib import Path
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import zipfile

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'test')]
LIMIT_S, LIMIT_MB = 20, 1500
SPEC = """rate_hz: 100
duration_s: 70
seed: 3
targets:
  gyro_x: {bias: 0.01, white: {N: 1.0e-4}, sinusoid: {amplitude: 0.01, frequency: 3.0}}
  accel_z: {white: {N: 2.0e-3}, temperature: {slope: 0.01, curvature: 0.0, lag: 0.0}}
covariates: {temperature: {base: 25.0, swing: 2.0, period_s: 50.0}}
motion: {rocking: {axis: x, amplitude_deg: 1.0, period_s: 10.0}}
"""
CALIBRATION = """sensor: accel
S: [[1.01, 0.0, 0.0], [0.0, 0.99, 0.0], [0.0, 0.0, 1.0]]
bias: [0.1, -0.1, 0.0]
"""
ODD = (b'\x00', b'\xff', b'\xff\xff\xff\xff', b'\x00\x00\x00\x80', b'\xff\xff\xff\x7f',
       b'nan', b'-1', b'1e308', b'!!python/none', b'\n', b'{', b'[', b'*a', b'&a', b': ', b'null')


def material(folder: Path) -> None:
    """Write one good input of every kind."""
    import bad_input
    from imu_noise_tools import report
    from imu_noise_tools.bag import write_bag
    from imu_noise_tools.tasks import noise

    record = bad_input.still(62, 50)
    for name in ('x.mcap', 'x.db3', 'x.bag', 'x.npz', 'x.csv', 'folder'):
        write_bag(folder / name, record)
    write_bag(folder / 'z.mcap', record, compression='zstd')
    report.pictures = lambda study: collections.defaultdict(bytes)
    noise.analyse(folder / 'x.mcap', folder / 'study', axes=['gyro_x', 'accel_z'])
    (folder / 'spec.yaml').write_text(SPEC)
    (folder / 'calibration.yaml').write_text(CALIBRATION)


def mutated(raw: bytes, rng: random.Random) -> bytes:
    """Return bytes with one to eight things wrong."""
    data = bytearray(raw)
    for _ in range(rng.choice((1, 1, 1, 2, 4, 8))):
        # headers and indexes are at the ends
        span = rng.choice((64, 600, len(data), len(data)))
        at = rng.randrange(min(span, len(data)) or 1)
        at = at if rng.random() < 0.6 else max(len(data) - 1 - at, 0)
        what = rng.randrange(7)
        if what == 0 and data:
            data[at] ^= 1 << rng.randrange(8)
        elif what == 1:
            word = rng.choice(ODD)
            data[at:at + len(word)] = word
        elif what == 2:
            data[at:at] = rng.choice(ODD) * rng.choice((1, 1, 3))
        elif what == 3:
            del data[at:at + rng.choice((1, 4, 8, 100, 5000))]
        elif what == 4:
            some = data[at:at + rng.choice((4, 8, 40, 1000))]
            to = rng.randrange(len(data) + 1)
            data[to:to] = some
        elif what == 5:
            data[at:at + 8] = rng.getrandbits(64).to_bytes(8, 'little')
        elif rng.random() < 0.3:
            del data[at:]
    return bytes(data)


def repacked(path: Path, rng: random.Random) -> None:
    """Mutate a member of an archive and give it the right sum again."""
    with zipfile.ZipFile(path) as archive:
        members = {i.filename: archive.read(i) for i in archive.infolist()}
    name = rng.choice(list(members))
    if rng.random() < 0.2:
        members.pop(name)
    else:
        members[name] = mutated(members[name], rng)
    with zipfile.ZipFile(path, 'w', zipfile.ZIP_DEFLATED) as archive:
        for name, raw in members.items():
            archive.writestr(name, raw)


def retyped(path: Path, rng: random.Random) -> None:
    """Put something else in the place of a value of a YAML file."""
    import yaml

    data = yaml.safe_load(path.read_text())
    at, key = data, None
    while isinstance(at, (dict, list)) and at and (key is None or rng.random() < 0.8):
        above, key = at, rng.choice(list(at) if isinstance(at, dict) else range(len(at)))
        at = above[key]
    odd = rng.choice([None, 'x', '', -1, 0, 1e308, float('nan'), float('inf'), [], {}, [1], True,
                      {'a': 1}, [[]], '\x07', 1 << 70, 'gyro_x'])
    if isinstance(above, dict) and rng.random() < 0.2:
        del above[key]
    elif isinstance(above, dict) and rng.random() < 0.1:
        above[odd if isinstance(odd, (str, int, float, bool)) else 7] = above.pop(key)
    else:
        above[key] = odd
    path.write_text(yaml.safe_dump(data))


BAGS = ('x.mcap', 'z.mcap', 'x.db3', 'x.bag', 'x.npz', 'x.csv')


def case(good: Path, here: Path, rng: random.Random) -> list[str]:
    """Make one bad input in a folder; return the command for it."""
    kind = rng.choice(('bag', 'bag', 'bag', 'folder', 'study', 'study', 'spec', 'calibration'))
    if kind == 'bag':
        name = rng.choice(BAGS)
        path = here / name
        shutil.copy(good / name, path)
        if name == 'x.npz' and rng.random() < 0.7:
            repacked(path, rng)
        else:
            path.write_bytes(mutated(path.read_bytes(), rng))
        bag = name
    elif kind == 'folder':
        shutil.copytree(good / 'folder', here / 'folder')
        path = rng.choice(sorted((here / 'folder').iterdir()))
        if path.suffix == '.yaml' and rng.random() < 0.5:
            retyped(path, rng)
        else:
            path.write_bytes(mutated(path.read_bytes(), rng))
        bag = 'folder'
    if kind in ('bag', 'folder'):
        out = 'out' + Path(bag).suffix
        return rng.choice((
            ['inspect', bag], ['inspect', bag, '--json'],
            ['analyse', bag, '-o', 'out', '--axes', 'gyro_x'],
            ['analyse', bag, '-o', 'out', '--keep-motion', '--octaves'],
            ['calibrate', bag, '-o', 'out'],
            ['apply', bag, '-o', out, '--calibration', str(good / 'calibration.yaml')],
            ['filter', bag, '-o', out, '--motion', 'constant_rate']))
    if kind == 'study':
        shutil.copytree(good / 'study', here / 'study')
        path = here / 'study' / rng.choice(('study.yaml', 'study.yaml', 'evidence.npz'))
        if path.suffix == '.yaml' and rng.random() < 0.7:
            retyped(path, rng)
        elif path.suffix == '.npz' and rng.random() < 0.7:
            repacked(path, rng)
        else:
            path.write_bytes(mutated(path.read_bytes(), rng))
        return rng.choice((
            ['compare', 'study'], ['compare', 'study', '--json'], ['history', 'study'],
            ['compare', str(good / 'study'), 'study'], ['diagnose', 'study'],
            ['add', 'study', 'ramp'], ['remove', 'study', 'flicker'], ['plan', 'study'],
            ['export', 'study', '--format', 'kalibr', '-o', 'out.yaml'],
            ['filter', str(good / 'x.mcap'), '-o', 'out.mcap', '--model', 'study']))
    name = f'{kind}.yaml'
    shutil.copy(good / name, here / name)
    if rng.random() < 0.6:
        retyped(here / name, rng)
    else:
        (here / name).write_bytes(mutated((here / name).read_bytes(), rng))
    if kind == 'spec':
        return ['simulate', name, '-o', 'out.mcap']
    return ['apply', str(good / 'x.mcap'), '-o', 'out.mcap', '--calibration', name]


def run(command: list[str], here: Path) -> str:
    """Run a command in this process; return what is wrong with how it ended, or nothing."""
    from imu_noise_tools.cli.main import main

    def ring(*_):
        raise TimeoutError(f'over {LIMIT_S} s')

    os.chdir(here)
    before = {p.name for p in here.iterdir()}
    out, err = io.StringIO(), io.StringIO()
    signal.signal(signal.SIGALRM, ring)
    signal.alarm(LIMIT_S)
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            status = main(command)
    except SystemExit as stop:
        status = stop.code
    except BaseException:
        return traceback.format_exc()
    finally:
        signal.alarm(0)
    said = [s for s in err.getvalue().splitlines() if not s.startswith('warning: ')]
    if status not in (0, 1, 2):
        return f'status {status}'
    if status and (len(said) != 1 or len(said[0]) > 3000 or 'object at 0x' in said[0]):
        return f'status {status}, said {said[:5]}'
    if status and 'a defect' in said[0]:
        with contextlib.redirect_stderr(err), contextlib.redirect_stdout(out):
            try:
                main([*command, '-v'])
            except Exception:
                return traceback.format_exc()
        return said[0]
    if not status and said:
        return f'done, but said {said[:5]}'
    if status == 0 and '--json' in command:
        json.loads(out.getvalue())
    new = {p.name for p in here.iterdir()} - before
    if any(n.startswith('.') for n in new) or status and new:
        return f'left {sorted(new)} with status {status}'
    return ''


def worker(jobs, answers) -> None:
    """Run commands until told to stop."""
    from imu_noise_tools import report

    resource.setrlimit(resource.RLIMIT_AS, (LIMIT_MB << 20,) * 2)
    report.pictures = lambda study: collections.defaultdict(bytes)
    report.html = lambda *_, **__: ''
    while job := jobs.get():
        answers.put(run(*job))


class Worker:
    """A process that runs commands, and is begun anew when one of them ends it."""

    def __init__(self):
        self.process = None

    def ask(self, command: list[str], here: Path) -> str:
        """Return what is wrong with how a command ended."""
        if self.process is None:
            context = multiprocessing.get_context('spawn')
            self.jobs, self.answers = context.Queue(), context.Queue()
            self.process = context.Process(target=worker, args=(self.jobs, self.answers),
                                           daemon=True)
            self.process.start()
        self.jobs.put((command, here))
        end = time.monotonic() + 3 * LIMIT_S
        while time.monotonic() < end:
            with contextlib.suppress(Exception):
                return self.answers.get(timeout=0.5)
            if not self.process.is_alive():
                break
        code = self.process.exitcode
        self.process.kill()
        self.process = None
        return f'the process ended with {code}' if code is not None else 'hangs'


def killed(good: Path, here: Path, rng: random.Random) -> str:
    """Kill an analysis at a random moment; return what is wrong with what is left."""
    shutil.copytree(good / 'study', here / 'study')
    before = {p.name: p.read_bytes() for p in (here / 'study').iterdir()}
    command = [sys.executable, '-m', 'imu_noise_tools.cli.main']
    own = {**os.environ, 'PYTHONPATH': str(ROOT), 'TMPDIR': str(here / 'tmp')}
    (here / 'tmp').mkdir()
    what = rng.choice((['analyse', str(good / 'x.mcap'), '-o', 'study', '--force'],
                       ['add', 'study', 'ramp'], ['remove', 'study', 'flicker']))
    process = subprocess.Popen([*command, *what], cwd=here, env=own, stdout=subprocess.DEVNULL,
                               stderr=subprocess.DEVNULL)
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(rng.uniform(0.1, 5.0))
    process.kill()
    process.wait()
    after = {p.name: p.read_bytes() for p in (here / 'study').iterdir()
             if not p.name.startswith('.')} if (here / 'study').is_dir() else {}
    for end in (['compare', 'study'], ['remove', 'study', 'random_walk']):
        done = subprocess.run([*command, *end], cwd=here, env=own, capture_output=True, text=True)
        if done.returncode:
            return f'{what} killed: then {end} gives {done.stderr[-300:]}'
    left = [p for p in (*here.iterdir(), *(here / 'study').iterdir(), *(here / 'tmp').iterdir())
            if p.name.startswith('.') and 'study.yaml' in p.name]
    if left:
        return f'{what} killed: {left} is left after the next change'
    return '' if set(before) <= set(after) | {'allan.png'} else f'{what} killed: lost files'


def main() -> int:
    """Run until the time is up; return 1 where something broke."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--minutes', type=float, default=1.0)
    parser.add_argument('--seed', type=int, default=None)
    parser.add_argument('--keep', type=Path, default=Path('fuzz_findings'))
    args = parser.parse_args()
    seed = random.SystemRandom().randrange(1 << 32) if args.seed is None else args.seed
    print(f'seed {seed}')
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))     # clean up then too
    top = Path(tempfile.mkdtemp(prefix='imu_noise_fuzz_'))
    good, here = top / 'good', top / 'here'
    good.mkdir()
    material(good)
    ask = Worker()
    end, count, found = time.monotonic() + 60 * args.minutes, collections.Counter(), []
    try:
        k = 0
        while time.monotonic() < end:
            rng = random.Random(f'{seed} {k}')
            here.mkdir()
            if k % 20 == 19:
                command = ['killed']
                wrong = killed(good, here, rng)
            else:
                command = case(good, here, rng)
                wrong = ask.ask(command, here)
            count[command[0]] += 1
            if wrong:
                place = args.keep / f'{seed}_{k}'
                print(f'{place}: {" ".join(command)}\n{wrong.rstrip()}', flush=True)
                found.append(k)
                shutil.rmtree(place, ignore_errors=True)
                shutil.copytree(here, place, symlinks=True)
                (place / 'command.txt').write_text(' '.join(command) + '\n' + wrong)
            shutil.rmtree(here)
            k += 1
    finally:
        os.chdir(ROOT)
        shutil.rmtree(top, ignore_errors=True)
    print(f'{sum(count.values())} runs ({", ".join(f"{n} {c}" for c, n in count.items())}), '
          f'{len(found)} findings')
    return int(bool(found))


if __name__ == '__main__':
    sys.exit(main())
