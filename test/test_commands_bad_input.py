# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Every command on every bad input: one clear line, the right status, old results whole, no litter.

Within one process, so that thousands of pairs take seconds; the time limit is for what waits for
ever.

"""

import builtins
import errno
import hashlib
import os
from pathlib import Path
import re
import shutil
import signal
import stat
import subprocess
import sys

import bad_input
import bad_studies
from params import seldom
import pytest

from imu_noise_tools import report, store
from imu_noise_tools.bag import write_bag
from imu_noise_tools.cli.main import main
from imu_noise_tools.tasks import noise as noise_tasks

ROOT = Path(__file__).resolve().parents[1]
LIMIT_S = 300               # for a command that waits for ever, not for one that is slow
BAGS = bad_input.names()
SPOILT = {**bad_studies.STUDY, **bad_studies.STUDY_VALUES, **bad_studies.EVIDENCE}
CALIBRATION = """sensor: accel
S: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
bias: [0.0, 0.0, 0.0]
"""


@pytest.fixture
def quick(undrawn, monkeypatch):
    """Leave out the pictures, and the page."""
    monkeypatch.setattr(report, 'html', lambda *_, **__: '')


@pytest.fixture(scope='module')
def corpus(tmp_path_factory):
    """Return the folder of all bad bags, made once."""
    folder = tmp_path_factory.mktemp('bags')
    return {c.name: c for c in bad_input.corpus(folder)}


@pytest.fixture(scope='module')
def good(tmp_path_factory, without_pictures):
    """Return a folder with a good bag, its study and a calibration."""
    folder = tmp_path_factory.mktemp('good')
    write_bag(folder / 'x.mcap', bad_input.still(61))
    with pytest.MonkeyPatch.context() as patch, without_pictures():
        patch.setattr(report, 'html', lambda *_, **__: '')
        # of two effects: every command that opens the study fits them again
        noise_tasks.analyse(folder / 'x.mcap', folder / 'x.study', axes=['gyro_x', 'accel_z'],
                            effects=['white', 'flicker'])
    (folder / 'calibration.yaml').write_text(CALIBRATION)
    return folder


@pytest.fixture
def run(capsys, monkeypatch, tmp_path):
    """Return a function that runs a command here and gives (status, what it said of an error)."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'tmp').mkdir()
    monkeypatch.setattr('tempfile.tempdir', str(tmp_path / 'tmp'))

    def ring(*_):
        raise AssertionError('it waits for ever')

    def run_(*args):
        before = signal.signal(signal.SIGALRM, ring)
        signal.alarm(LIMIT_S)
        try:
            status = main([str(a) for a in args])
        except SystemExit as stop:
            status = stop.code
        finally:
            signal.alarm(0)
            signal.signal(signal.SIGALRM, before)
        said = [s for s in capsys.readouterr().err.splitlines() if not s.startswith('warning: ')]
        assert not list((tmp_path / 'tmp').iterdir())
        assert not list(tmp_path.glob('**/ran')) and not Path('ran').exists(), 'code was run'
        return status, said

    return run_


def content(folder: Path) -> dict:
    """Return all that is in a folder, but for times."""
    found = {}
    for path in sorted(folder.rglob('*')):
        mode = path.lstat().st_mode
        sum_ = ''
        if stat.S_ISREG(mode) and path.stat().st_size < 1 << 28:
            sum_ = hashlib.md5(path.read_bytes()).hexdigest()
        found[str(path.relative_to(folder))] = stat.S_IFMT(mode), sum_
    return found


def assert_one_line(status, said, *words, statuses=(1,)):
    """Check that a command ended as one that says what is wrong and what to do."""
    assert status in statuses, (status, said)
    assert len(said) == 1, said
    assert said[0].startswith('imu_noise: ') and len(said[0]) < 2000
    assert 'a defect' not in said[0], said[0]
    assert 'Traceback' not in said[0] and 'object at 0x' not in said[0]
    for w in words:
        assert re.search(w, said[0]), said[0]


def in_turn(inputs, commands):
    """
    Return pairs: each input with one of the commands, in turn.

    With IMU_NOISE_CORPUS=all (``make fuzz``) each input with every command.

    """
    inputs, commands = list(inputs), list(commands)
    if os.environ.get('IMU_NOISE_CORPUS') == 'all':
        return [(i, c) for i in inputs for c in commands]
    return [(i, commands[k % len(commands)]) for k, i in enumerate(inputs)]


def in_turn_daily(inputs, commands):
    """Return each input with each command: every day as in turn, else with thorough tests."""
    every = [(i, c) for i in inputs for c in commands]
    some = in_turn(inputs, commands)
    return [pytest.param(*pair, marks=() if pair in some else pytest.mark.thorough,
                         id='-'.join(str(x if isinstance(x, str) else x[0]) for x in pair))
            for pair in every]


# -- bags

READING = {
    'inspect': ('inspect', '{bag}'),
    'analyse': ('analyse', '{bag}', '-o', 'out', '--axes', 'gyro_x'),
    'calibrate': ('calibrate', '{bag}', '-o', 'out'),
    'apply': ('apply', '{bag}', '-o', 'out{suffix}', '--calibration', '{good}/calibration.yaml'),
    'filter': ('filter', '{bag}', '-o', 'out{suffix}', '--motion', 'constant_rate'),
}


def on_a_bag(command, case, good, run):
    """Run a command on a bad bag."""
    names = {'bag': case.path, 'good': good, 'suffix': case.path.suffix}
    return run(*(c.format(**names) for c in READING[command]))


@pytest.mark.parametrize('name, command', in_turn_daily(
    [n for n in BAGS if n not in bad_input.opening()], READING))
def test_bags_that_are_none(name, command, corpus, good, run, tmp_path):
    """Each command that reads a bag refuses what is none, and writes nothing; inspect lists."""
    found = on_a_bag(command, corpus[name], good, run)
    if (name, command) == ('two_imu_topics', 'inspect'):
        assert found == (0, [])
    else:
        assert_one_line(*found, corpus[name].words)
    assert {p.name for p in tmp_path.iterdir()} == {'tmp'}


@pytest.mark.parametrize('name, command', in_turn(bad_input.opening(), READING))
def test_odd_bags(name, command, corpus, good, run, quick, tmp_path):
    """What can be read is worked on, or refused in one line; nothing else is left."""
    case = corpus[name]
    status, said = on_a_bag(command, case, good, run)
    held = {p.name for p in tmp_path.iterdir()} - {'tmp'}
    if status:
        assert_one_line(status, said)
        assert not held
    else:
        assert said == []
        assert held <= {'out', f'out{case.path.suffix}', f'out{case.path.suffix}.study'}
    if command == 'inspect':
        assert status == 0
    if command == 'analyse' and case.outcome == 'refused':
        assert status == 1 and re.search(case.words, said[0])
    elif command == 'analyse':
        assert status == 0
        assert any(re.search(case.words, w) for w in store.read('out')['source']['warnings'])


# -- studies

TAKING = {
    'compare': ('compare', 'bad'), 'second': ('compare', '{good}/x.study', 'bad'),
    'diagnose': ('diagnose', 'bad'), 'add': ('add', 'bad', 'ramp'),
    'remove': ('remove', 'bad', 'flicker'), 'plan': ('plan', 'bad'),
    'export': ('export', 'bad', '--format', 'kalibr', '-o', 'out.yaml'),
    'filter': ('filter', '{good}/x.mcap', '-o', 'out.mcap', '--model', 'bad'),
}


@pytest.mark.parametrize('name, command', [
    *in_turn(SPOILT, [c for c in TAKING if c not in ('filter', 'second')]),
    ('unknown_target', 'second'),
    *(seldom(n, 'second') for n in SPOILT if n != 'unknown_target'),
    *(seldom(n, c) for c in ('history', 'filter')
      for n in SPOILT if n in bad_studies.STUDY or n.startswith('history'))])
def test_spoilt_studies(name, command, good, run, tmp_path):
    """A damaged study is refused by every command that takes one, and not touched."""
    bad = bad_studies.spoil(good / 'x.study', tmp_path / 'bad', SPOILT[name])
    before = content(bad)
    words = TAKING.get(command, ('history', 'bad'))
    status, said = run(*(c.format(good=good) for c in words))
    assert_one_line(status, said)
    assert content(bad) == before
    assert {p.name for p in tmp_path.iterdir()} == {'tmp', 'bad'}


@pytest.mark.parametrize('command, where', in_turn_daily(
    ['compare', 'diagnose', 'history', 'add', 'plan'], ['missing', 'file', 'link', 'fifo']))
def test_no_study_at_all(where, command, run, tmp_path):
    """What is no folder is refused."""
    if where == 'file':
        Path('bad').write_text('x')
    elif where == 'link':
        Path('bad').symlink_to('bad')
    elif where == 'fifo':
        os.mkfifo('bad')
    assert_one_line(*run(command, 'bad'))


@pytest.mark.parametrize('there, named, said', [
    ([], 'x', r'^imu_noise: x: no such folder: name a folder that '),
    (['x.study/'], 'x', r'x: no such folder: did you mean x\.study\?'),
    (['x/', 'x.study/'], 'x', r'x: no @ in it: did you mean x\.study\?'),
    (['robot.study/', 'x.study/'], 'robto.study', r'no such folder: did you mean robot\.study\?'),
    (['x.study/a/', 'x.study/b/'], 'x.study', r'no @ in it: name one of.*: x.study/a, x.study/b'),
])
@pytest.mark.parametrize('command, file', [
    (('diagnose', 'NAME'), 'study.yaml'),
    (('filter', '{good}/x.mcap', '-o', 'out.mcap', '--model', 'NAME'), 'study.yaml'),
    (('apply', '{good}/x.mcap', '-o', 'out.mcap', '--calibration', 'NAME'), 'calibration.yaml')])
def test_a_study_beside_the_name_is_told(there, named, said, command, file, good, run):
    """The path once, and what was meant by it."""
    for folder in there:
        Path(folder).mkdir(parents=True)
        if folder != 'x/':
            (Path(folder) / file).write_text('a: [')
    status, line = run(*(c.format(good=good).replace('NAME', named) for c in command))
    assert_one_line(status, line, said.replace('@', file))
    assert line[0].count(f'{named}: ') == 1


def test_what_a_file_is_read_for_is_the_remedy(good, run):
    """A specification or a calibration that cannot be read is none of a study."""
    Path('bad.yaml').write_text('a: [')
    _, said = run('simulate', 'nowhere', '-o', 'x')
    assert said == ['imu_noise: nowhere: no such file or directory: imu_noise simulate --help '
                    'shows one']
    _, said = run('apply', good / 'x.mcap', '-o', 'out.mcap', '--calibration', 'bad.yaml')
    assert said[0].count('bad.yaml') == 1 and said[0].endswith(': calibrate again')
    _, said = run('history', 'bad.yaml')
    assert 'a file, and no folder of a study' in said[0]


@pytest.mark.parametrize('name', list(bad_studies.SPECS))
def test_specifications(name, run, tmp_path):
    """A specification that makes no sense makes no bag."""
    Path('spec.yaml').write_text(bad_studies.SPECS[name])
    assert_one_line(*run('simulate', 'spec.yaml', '-o', 'out.mcap'), statuses=(1, 2))
    assert {p.name for p in tmp_path.iterdir()} == {'tmp', 'spec.yaml'}


@pytest.mark.parametrize('name, command', in_turn_daily(
    [*bad_studies.CALIBRATIONS, 'missing', 'fifo', 'folder'],
    [('apply', '{good}/x.mcap', '-o', 'out.mcap', '--calibration', 'bad.yaml'),
     ('export', '{good}/x.study', '--format', 'openvins', '--calibration', 'bad.yaml',
      '-o', 'out.yaml')]))
def test_calibrations(name, command, good, run, tmp_path):
    """A calibration that cannot be used is refused."""
    path = Path('bad.yaml')
    if name == 'fifo':
        os.mkfifo(path)
    elif name == 'folder':
        path.mkdir()
    elif name != 'missing':
        path.write_text(bad_studies.CALIBRATIONS[name])
    assert_one_line(*run(*(c.format(good=good) for c in command)), statuses=(1, 2))
    assert {p.name for p in tmp_path.iterdir()} <= {'tmp', 'bad.yaml'}


@pytest.mark.parametrize('text', ['', '1 +', 'raise RuntimeError("no")', '\x00', 'import nothing_',
                                  'raise SystemExit(3)', 'x' * 100_000 + ' y'])
def test_own_effects(text, good, run):
    """A file of effects that fails is told with its name."""
    Path('mine.py').write_text(text)
    assert_one_line(*run('compare', good / 'x.study', '--effects-from', 'mine.py'), 'mine.py')


# -- output

@pytest.mark.parametrize('command, where', in_turn_daily([
    ('analyse', '{good}/x.mcap', '-o'), ('calibrate', '{good}/x.mcap', '-o'),
    ('apply', '{good}/x.mcap', '--calibration', '{good}/calibration.yaml', '-o'),
    ('filter', '{good}/x.mcap', '--motion', 'constant_rate', '-o'),
    ('export', '{good}/x.study', '--format', 'kalibr', '-o'),
    ('simulate', 'spec.yaml', '-o'),
], ['/proc/x.mcap', 'file/x.mcap', 'held', 'x' * 300]))
def test_unwritable(where, command, good, run, tmp_path):
    """Where nothing can be written nothing is, and it is said."""
    Path('file').write_text('mine')
    Path('held').mkdir()
    Path('held/mine').write_text('mine')
    Path('spec.yaml').write_text('rate_hz: 100\nduration_s: 10\n' + bad_studies._WHITE)
    before = content(tmp_path)
    status, said = run(*(c.format(good=good) for c in command), where)
    assert_one_line(status, said, statuses=(1, 2))
    assert content(tmp_path) == before


def test_full_device(good, run):
    """A device that is full is told as one."""
    assert_one_line(
        *run('export', good / 'x.study', '--format', 'kalibr', '-o', '/dev/full'), 'no space left')


FULL = [
    ('analyse', '{good}/x.mcap', '-o', 'old', '--force', '--axes', 'gyro_x'),
    ('apply', '{good}/x.mcap', '--calibration', '{good}/calibration.yaml', '-o', 'old.mcap',
     '--force'),
    ('filter', '{good}/x.mcap', '--motion', 'constant_rate', '-o', 'old.mcap', '--force'),
    ('export', '{good}/x.study', '--format', 'kalibr', '-o', 'old.yaml', '--force'),
    ('simulate', 'spec.yaml', '-o', 'old.mcap', '--force'),
    ('remove', 'old', 'flicker'),
]
LIMITED = """
import resource, signal, sys
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]),) * 2)
from imu_noise_tools.cli.main import main
sys.exit(main(sys.argv[2:]))
"""


def old_results(good, here: Path) -> dict:
    """Put results of every kind here, and what a command needs; return all that there is."""
    shutil.copytree(good / 'x.study', here / 'old')
    write_bag(here / 'old.mcap', bad_input.still(20))
    (here / 'old.yaml').write_text('old')
    (here / 'spec.yaml').write_text('rate_hz: 100\nduration_s: 10\n' + bad_studies._WHITE)
    return content(here)


def limited(size, command, good):
    """Run a command in a process whose files may not grow beyond a size."""
    return subprocess.run(
        [sys.executable, '-c', LIMITED, str(size), *(c.format(good=good) for c in command)],
        capture_output=True, text=True, timeout=300,
        env={**os.environ, 'PYTHONPATH': str(ROOT), 'OPENBLAS_NUM_THREADS': '1'})


@pytest.mark.parametrize('command', FULL, ids=lambda c: c[0])
def test_full_disk_in_between(command, good, run, quick, tmp_path, monkeypatch):
    """When room runs out at any write, the old results stay as they were."""
    before = old_results(good, tmp_path)
    open_, writes = builtins.open, []

    class Full:
        """A file that holds no more."""

        def __init__(self, file):
            self.file = file

        def write(self, data):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(self.file.name))

        def __getattr__(self, name):
            return getattr(self.file, name)

        def __enter__(self):
            return self

        def __exit__(self, *_):
            self.file.close()

    def opened(path, mode='r', *args, **kwargs):
        file = open_(path, mode, *args, **kwargs)
        if '.part' in str(path) and set(mode) & set('wxa'):
            writes.append(path)
            return Full(file)
        return file

    monkeypatch.setattr(builtins, 'open', opened)
    status, said = run(*(c.format(good=good) for c in command))
    monkeypatch.setattr(builtins, 'open', open_)
    if not writes:
        pytest.skip('writes by other means: see the test in a process of its own')
    assert_one_line(status, said, 'no space left', 'free some disk space')
    assert content(tmp_path) == before


@pytest.mark.parametrize('command', [
    pytest.param(FULL[0], marks=pytest.mark.thorough), FULL[1]], ids=lambda c: c[0])
def test_full_disk_in_a_process(command, good, tmp_path, monkeypatch):
    """The same, said by the system itself."""
    monkeypatch.chdir(tmp_path)
    before = old_results(good, tmp_path)
    done = limited(2000, command, good)
    said = [s for s in done.stderr.splitlines() if not s.startswith('warning: ')]
    assert_one_line(done.returncode, said, 'cannot be written')
    assert content(tmp_path) == before


@pytest.mark.parametrize('size', [2000, 40_000])
def test_full_disk_under_a_database(size, good, tmp_path, monkeypatch):
    """What SQLite says of a full disk is told as of any other file."""
    monkeypatch.chdir(tmp_path)
    write_bag('x', bad_input.still(20), storage='sqlite3')
    before = content(tmp_path)
    done = limited(size, ('apply', 'x', '--calibration', '{good}/calibration.yaml', '-o', 'y'),
                   good)
    said = [s for s in done.stderr.splitlines() if not s.startswith('warning: ')]
    assert_one_line(done.returncode, said, 'y: cannot be written')
    assert content(tmp_path) == before


@pytest.mark.parametrize('command, after', in_turn(FULL, [2, 1, 3]))
def test_interrupted(command, after, good, run, quick, tmp_path, monkeypatch):
    """Ctrl-C while files are written: status 130, old results whole, nothing left over."""
    before = old_results(good, tmp_path)
    open_, count = builtins.open, []

    def opened(path, mode='r', *args, **kwargs):
        if '.part' in str(path):
            count.append(path)
            if len(count) == after:
                raise KeyboardInterrupt
        return open_(path, mode, *args, **kwargs)

    monkeypatch.setattr(builtins, 'open', opened)
    status, said = run(*(c.format(good=good) for c in command))
    monkeypatch.setattr(builtins, 'open', open_)
    if len(count) < after:
        assert status == 0
        return
    assert status == 130 and said == ['interrupted']
    assert content(tmp_path) == before
