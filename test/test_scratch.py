# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Long records on disk: the same numbers, and nothing left over however it ends."""

import errno
import os
from pathlib import Path
import signal
import subprocess
import sys

import bad_input
import numpy as np
from params import daily
import pytest
import zstandard

from imu_noise_tools.bag import open_record, Scratch, scratch, write_bag
from imu_noise_tools.core.errors import InputError
from imu_noise_tools.core.record import ImuRecord, Memory
from imu_noise_tools.health import prepare
from imu_noise_tools.noise.evidence import to_arrays
from imu_noise_tools.noise.gather import gather

ROOT = Path(__file__).resolve().parents[1]
# The command, with every array on disk; the place to stop at is given by name.
COMMAND = """
import signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)    # else ignored where tests run aside
from imu_noise_tools.bag import scratch
scratch.LARGE = 1
from imu_noise_tools import report
report.pictures = lambda study: {'allan': b''}
report.html = lambda *_, **__: ''
stop = sys.argv.pop(1)
if stop:
    from imu_noise_tools.noise import gather
    def wait(*_):
        print('there', flush=True)
        for _ in range(6000):   # a signal just before a sleep begins does not end it
            time.sleep(0.1)
    setattr(gather, stop, wait)
from imu_noise_tools.cli.main import main
sys.exit(main(sys.argv[1:]))
"""


def test_arrays_keep_what_they_hold():
    """Arrays on disk are as others, through a rest too, and end with their last user."""
    memory = Scratch(large=1)
    a = memory.columns(1000)
    a[:] = np.arange(3000.0).reshape(1000, 3)
    memory.rest()
    assert a.shape == (1000, 3) and a[:, 0].flags.c_contiguous
    np.testing.assert_array_equal(a, np.arange(3000.0).reshape(1000, 3))
    kept = memory.keep(np.arange(5, dtype=np.int64))
    assert kept.dtype == np.int64 and kept.tolist() == [0, 1, 2, 3, 4]
    assert len(memory._maps) == 2
    del a
    assert len(memory._maps) == 1
    assert memory.empty(0).shape == (0,)


def test_small_arrays_stay_in_memory():
    """Only what is large goes to disk."""
    memory = Scratch(large=1000)
    assert memory.empty(100).base is None and not len(memory._maps)
    x = np.zeros(10)
    assert memory.keep(x) is x


def test_no_room_is_said(monkeypatch):
    """A full disk is told before anything is written to it."""
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    monkeypatch.setattr(os, 'posix_fallocate', full)
    with pytest.raises(InputError, match='no room for 1 MB.*no space left.*TMPDIR'):
        Scratch(large=1).empty(100_000)


def hard_record() -> ImuRecord:
    """Return a record that takes every path: lost and unordered samples, spikes, a covariate."""
    r = bad_input.still(150)
    rng = np.random.default_rng(3)
    gyro, t = r.gyro.copy(), r.t.copy()
    gyro[rng.integers(0, r.n, 20), 1] += 0.5
    gyro[700, 2] = np.nan
    t[[300, 301]] = t[[301, 300]]
    keep = np.r_[0:5000, 5020:r.n]
    return ImuRecord(gyro[keep], r.accel[keep], t[keep], r.rate_hz, receive_t=r.t[keep],
                     covariates={'temperature': 25 + 0.01 * r.t[keep]}, path='hard')


def test_same_numbers_as_in_memory():
    """What is gathered of a record on disk is what is gathered of it in memory, bit for bit."""
    found = []
    for memory in (Memory(), Scratch(large=1)):
        ready = prepare(hard_record(), memory=memory)
        found.append((ready, to_arrays(gather(ready, ready.axes, memory=memory))))
    (a, first), (b, second) = found
    assert a.warnings == b.warnings
    np.testing.assert_array_equal(a.gyro, b.gyro)
    assert set(first) == set(second)
    for name, x in first.items():
        np.testing.assert_array_equal(second[name], x, err_msg=name)


@pytest.mark.parametrize('options', [{}, {'input_kind': 'integrated'}, {'accel_unit': 'mg'},
                                     {'input_kind': 'delta'}, {'rate_hz': 50.0}])
@pytest.mark.parametrize('kind', ['.mcap', '.db3', '.bag'])
def test_same_record_from_a_bag(kind, options, tmp_path):
    """A bag read to disk is the bag read to memory."""
    path = write_bag(tmp_path / f'x{kind}', bad_input.still(60))
    a, b = open_record(path, **options), open_record(path, memory=Scratch(large=1), **options)
    for name in ('t', 'gyro', 'accel', 'receive_t'):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    assert b.gyro[:, 0].flags.c_contiguous


@pytest.fixture
def place(tmp_path):
    """Return a folder for a process to work in, with a still bag and a temporary folder."""
    (tmp_path / 'tmp').mkdir()
    write_bag(tmp_path / 'x.mcap', bad_input.still(60))
    return tmp_path


def start(place, *command, stop=''):
    """Start a command on disk arrays."""
    process = subprocess.Popen(
        [sys.executable, '-c', COMMAND, stop, *command], cwd=place, text=True,
        env={**os.environ, 'TMPDIR': str(place / 'tmp'), 'PYTHONPATH': str(ROOT),
             'OPENBLAS_NUM_THREADS': '1'}, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    if stop:
        assert process.stdout.readline() == 'there\n'
    return process


def left(place) -> set[str]:
    """Return what is in the folder besides the bag."""
    assert not list((place / 'tmp').iterdir())
    return {p.name for p in place.iterdir()} - {'tmp', 'x.mcap', 'moving'}


@pytest.mark.thorough
def test_nothing_left_after_success_and_error(place):
    """A study, or nothing."""
    bad_input.make_one('moving', place)
    good, bad = start(place, 'analyse', 'x.mcap'), start(place, 'analyse', 'moving')
    assert good.wait(300) == 0, good.stderr.read()
    assert bad.wait(300) == 1
    assert bad.stderr.read().count('\n') == 1
    assert left(place) == {'x.mcap.study'}


@pytest.mark.parametrize('where', daily(['_cross_powers', 'whitened'], 'whitened'))
def test_nothing_left_after_ctrl_c(where, place):
    """Ctrl-C within the work leaves nothing, and the status of a Ctrl-C."""
    process = start(place, 'analyse', 'x.mcap', stop=where)
    process.send_signal(signal.SIGINT)
    assert process.wait(300) == 130
    assert left(place) == set()


@pytest.mark.thorough
def test_nothing_left_after_kill(place):
    """A killed process leaves no array behind, and its half study goes at the next start."""
    process = start(place, 'analyse', 'x.mcap', stop='_cross_powers')
    maps = Path(f'/proc/{process.pid}/maps').read_text()
    assert str(place / 'tmp') in maps, 'nothing was on disk'
    process.kill()
    process.wait(300)
    assert not list((place / 'tmp').iterdir())
    again = start(place, 'analyse', 'x.mcap')
    assert again.wait(300) == 0
    assert left(place) == {'x.mcap.study'}


@pytest.mark.thorough
def test_what_a_killed_process_unpacked_goes_at_the_next_start(place):
    """A compressed file is unpacked to a folder that names its process."""
    raw = (place / 'x.mcap').read_bytes()
    (place / 'x.mcap.zstd').write_bytes(zstandard.compress(raw))
    (place / 'x.mcap').unlink()
    (place / 'x.mcap.zstd').rename(place / 'x.mcap')
    process = start(place, 'analyse', 'x.mcap', stop='_cross_powers')
    process.kill()
    process.wait(300)
    # what an unpacking process leaves when it is killed
    host = [p for p in place.iterdir() if p.name.endswith('.part')][0].name.split('.')[-2]
    dead = place / 'tmp' / f'.imu_noise.{host}.part'
    dead.mkdir()
    (dead / '0_x').write_bytes(raw)
    process = start(place, 'inspect', 'x.mcap')
    assert process.wait(300) == 0
    assert not list((place / 'tmp').iterdir())


def test_threshold():
    """Three hours of 200 Hz go to disk as wholes; what is under a minute never does."""
    n = 3 * 3600 * 200
    assert 3 * 8 * n > scratch.LARGE > 3 * 8 * 60 * 200
