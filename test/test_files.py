# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Output is there whole or not at all."""

from __future__ import annotations

import errno
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

import pytest

from imu_noise_tools.core import files
from imu_noise_tools.core.errors import InputError
from imu_noise_tools.core.files import atomic_path, atomic_write, new_folder, replace_files


def names(folder) -> list[str]:
    """Return what a folder holds."""
    return sorted(p.name for p in folder.iterdir())


def test_atomic_write(tmp_path):
    """Text and bytes are written, over an old file, through a link, and into a device."""
    path = tmp_path / 'a'
    atomic_write(path, 'ä')
    assert path.read_bytes() == 'ä'.encode()
    (tmp_path / 'link').symlink_to('a')
    atomic_write(tmp_path / 'link', b'\0')
    assert path.read_bytes() == b'\0' and (tmp_path / 'link').is_symlink()
    atomic_write('/dev/null', 'gone')
    assert names(tmp_path) == ['a', 'link']


def test_atomic_write_keeps_the_usual_mode(tmp_path):
    """A file has the mode that any other new file has."""
    atomic_write(tmp_path / 'a', 'x')
    (tmp_path / 'b').write_text('x')
    assert (tmp_path / 'a').stat().st_mode == (tmp_path / 'b').stat().st_mode


@pytest.mark.parametrize('number, words', [(errno.ENOSPC, 'no space left.*free some disk space'),
                                           (errno.EACCES, 'permission denied.*-o'),
                                           (errno.EROFS, 'read-only.*-o')])
def test_what_the_system_says(number, words, tmp_path, monkeypatch):
    """A full disk and the like are one line for a person, and the old file stays."""
    (tmp_path / 'a').write_text('old')

    def refuse(*_):
        raise OSError(number, os.strerror(number))
    monkeypatch.setattr(files, '_write_new', refuse)
    with pytest.raises(InputError, match=f'(?i){words}') as error:
        atomic_write(tmp_path / 'a', 'new')
    assert '\n' not in str(error.value)
    with pytest.raises(InputError, match=f'(?i){words}'):
        replace_files(tmp_path, {'a': 'new', 'b': 'new'})
    with pytest.raises(InputError, match=f'(?i){words}'), new_folder(tmp_path / 'd') as folder:
        refuse(folder)
    assert (tmp_path / 'a').read_text() == 'old' and names(tmp_path) == ['a']


def test_real_full_disk(tmp_path):
    """A device that is full is said to be."""
    if not Path('/dev/full').exists():
        pytest.skip('no /dev/full here')
    with pytest.raises(InputError, match='no space left'):
        atomic_write('/dev/full', 'x')


def test_folder_in_the_way(tmp_path):
    """A folder where a file should be is said, and left alone."""
    with pytest.raises(InputError, match='is a directory'):
        atomic_write(tmp_path, 'x')


@pytest.mark.parametrize('stop', [KeyboardInterrupt, SystemExit, ValueError])
def test_interrupted(stop, tmp_path):
    """Whatever stops a block, nothing is left but what was there."""
    (tmp_path / 'old').mkdir()
    (tmp_path / 'old' / 'study.yaml').write_text('old')
    with pytest.raises(stop), new_folder(tmp_path / 'old', force=True) as folder:
        (folder / 'study.yaml').write_text('new')
        raise stop
    with pytest.raises(stop), new_folder(tmp_path / 'x' / 'y' / 'z') as folder:
        (folder / 'file').write_text('new')
        raise stop
    with pytest.raises(stop), atomic_path(tmp_path / 'file') as path:
        path.write_text('new')
        raise stop
    assert names(tmp_path) == ['old'] and (tmp_path / 'old' / 'study.yaml').read_text() == 'old'


def test_new_folder(tmp_path):
    """
    A folder appears whole, with its parents.

    One that is there is refused, or replaced if it is ours.

    """
    path = tmp_path / 'a' / 'b'
    with new_folder(path) as folder:
        (folder / 'study.yaml').write_text('1')
        assert not path.exists()
    assert names(path) == ['study.yaml']
    with pytest.raises(InputError, match='a study exists already.*--force'), new_folder(path):
        raise AssertionError
    with new_folder(path, force=True) as folder:
        (folder / 'metadata.yaml').write_text('2')
    assert names(path) == ['metadata.yaml'] and names(path.parent) == ['b']


def test_nothing_of_others_is_replaced(tmp_path):
    """
    A folder that holds other things, or a file, is not replaced even when forced.

    An empty folder is used.

    """
    (tmp_path / 'home').mkdir()
    (tmp_path / 'home' / 'thesis.tex').write_text('x')
    (tmp_path / 'file').write_text('x')
    for name in ('home', 'file'):
        with pytest.raises(InputError, match='is a file|holds other files'), new_folder(
            tmp_path / name, force=True
        ):
            raise AssertionError
    (tmp_path / 'empty').mkdir()
    with new_folder(tmp_path / 'empty') as folder:
        (folder / 'x').touch()
    assert names(tmp_path) == ['empty', 'file', 'home'] and names(tmp_path / 'empty') == ['x']


def test_errors_of_reading_are_not_mapped(tmp_path):
    """An error about another file passes through as it is."""
    with pytest.raises(FileNotFoundError), new_folder(tmp_path / 'a'):
        open(tmp_path / 'nowhere')


def test_replace_files(tmp_path):
    """Several files are replaced, or none."""
    replace_files(tmp_path, {'a': '1', 'b': b'2'})
    assert names(tmp_path) == ['a', 'b']
    with pytest.raises(TypeError):
        replace_files(tmp_path, {'a': '3', 'b': 4})
    assert (tmp_path / 'a').read_text() == '1' and names(tmp_path) == ['a', 'b']
    with pytest.raises(InputError, match='cannot be written'):
        replace_files(tmp_path / 'nowhere', {'a': '1'})


def test_replace_files_finishes_when_interrupted(tmp_path, monkeypatch):
    """Ctrl-C between two renames does not leave half of the files new."""
    replace_files(tmp_path, {'a': '1', 'b': '1', 'c': '1'})
    real, calls = os.replace, []

    def interrupted(source, target):
        calls.append(target)
        if len(calls) == 2:
            raise KeyboardInterrupt
        real(source, target)
    monkeypatch.setattr(os, 'replace', interrupted)
    with pytest.raises(KeyboardInterrupt):
        replace_files(tmp_path, {'a': '2', 'b': '2', 'c': '2'})
    assert [(tmp_path / n).read_text() for n in 'abc'] == ['2', '2', '2'] and names(tmp_path) == [
        'a',
        'b',
        'c',
    ]


def test_what_a_killed_process_left_goes(tmp_path):
    """After kill -9 the old file is whole, and the next writing removes what was left."""
    code = (
        'import sys, time\nfrom imu_noise_tools.core.files import new_folder\n'
        'with new_folder(sys.argv[1], force=True) as folder:\n'
        '    (folder / "study.yaml").write_text("new")\n'
        '    print("ready", flush=True)\n    time.sleep(60)\n'
    )
    path = tmp_path / 'study'
    with new_folder(path) as folder:
        (folder / 'study.yaml').write_text('old')
    child = subprocess.Popen([sys.executable, '-c', code, str(path)], stdout=subprocess.PIPE,
                             cwd=Path(files.__file__).parents[1])
    child.stdout.readline()
    child.send_signal(signal.SIGKILL)
    child.wait()
    child.stdout.close()
    assert (path / 'study.yaml').read_text() == 'old' and len(names(tmp_path)) == 2
    with new_folder(path, force=True) as folder:
        (folder / 'study.yaml').write_text('new')
    assert names(tmp_path) == ['study'] and (path / 'study.yaml').read_text() == 'new'


@pytest.mark.parametrize('number', [signal.SIGTERM, signal.SIGHUP])
def test_a_command_that_is_ended_leaves_nothing(number, tmp_path):
    """As after Ctrl-C, also where the signal comes twice, as `timeout` sends it."""
    code = (
        'import os, shutil, signal, sys, time\n'
        'from imu_noise_tools.cli import main, noise\n'
        'from imu_noise_tools.core import files\n'
        'signal.signal(int(sys.argv[2]), signal.SIG_DFL)\n'     # under nohup it is ignored
        'kill = lambda: os.kill(os.getpid(), int(sys.argv[2]))\n'
        'def slow(args):\n'
        '    with files.new_folder(sys.argv[1]) as folder:\n'
        '        (folder / "study.yaml").write_text("new")\n'
        '        kill()\n        time.sleep(60)\n'
        'def rmtree(*args, before=shutil.rmtree, **kwargs):\n'
        '    kill()\n    before(*args, **kwargs)\n'
        'shutil.rmtree = rmtree\n'
        'noise.analyse = slow\n'
        'sys.exit(main.main(["analyse", "x"]))\n'
    )
    done = subprocess.run([sys.executable, '-c', code, str(tmp_path / 'study'), str(int(number))],
                          capture_output=True, text=True, cwd=Path(files.__file__).parents[2],
                          timeout=50)
    assert (done.returncode, done.stderr) == (128 + number, 'interrupted\n')
    assert names(tmp_path) == []


def test_another_process_is_left_alone(tmp_path):
    """What a living process is writing stays."""
    with new_folder(tmp_path / 'a') as first:
        with new_folder(tmp_path / 'a') as second:
            (second / 'x').touch()
        assert first.is_dir()
        time.sleep(0)
        for p in (tmp_path / 'a').iterdir():
            p.unlink()
    assert names(tmp_path) == ['a']
