# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every bad input gets its error or its warning, in memory bounded by its own size."""

from __future__ import annotations

import os
from pathlib import Path
import re
import resource
import subprocess
import sys

import bad_input
import numpy as np
import pytest

from imu_noise_tools.bag import open_record, topics, write_bag
from imu_noise_tools.core.errors import ImuNoiseError, InputError
from imu_noise_tools.health import examine, prepare


@pytest.mark.parametrize('name', bad_input.names())
def test_case(name, tmp_path):
    """The outcome is the one that the case states, in one line with the right words."""
    case = bad_input.make_one(name, tmp_path)
    try:
        record = open_record(case.path)
        opened = True
        found = prepare(record)
    except InputError as error:
        said = str(error)
        assert case.outcome == 'refused', said
        assert '\n' not in said and str(case.path) in said
        opened = 'record' in locals()
    else:
        said = '\n'.join(found.warnings)
        assert case.outcome == 'warned', said
        assert np.isfinite(found.gyro if found.gyro is not None else found.accel).all()
    assert re.search(case.words, said), said
    assert opened == case.opens
    if opened:
        assert examine(record).samples == record.n
    assert not list(tmp_path.glob('*.ran')), 'code in the input was run'


@pytest.mark.parametrize(
    'name',
    [
        'truncated_mcap',
        'truncated_mcap_zstd',
        'truncated_sqlite',
        'truncated_rosbag1',
        'truncated_csv',
        'flipped_bits',
    ],
)
def test_what_is_whole_is_read(name, tmp_path):
    """A file cut to 80 % gives some 80 % of its samples, and each as it was."""
    record = open_record(bad_input.make_one(name, tmp_path).path)
    truth = bad_input.still()
    index = np.round(record.t * truth.rate_hz).astype(int)
    if name == 'flipped_bits':
        assert 0.3 < record.n / truth.n < 1
        index = np.flatnonzero(np.isin(truth.gyro[:, 0], record.gyro[:, 0]))
    else:
        assert 0.6 < record.n / truth.n < 0.95
    assert len(index) == record.n
    np.testing.assert_array_equal(record.gyro, truth.gyro[index])
    np.testing.assert_array_equal(record.accel, truth.accel[index])


@pytest.mark.parametrize('kind', [
    '.mcap', pytest.param('.db3', marks=pytest.mark.thorough), '.bag'])
def test_cut_anywhere(kind, tmp_path):
    """
    Wherever a file is cut, there is a record or an error for a person.

    More of the file is never fewer samples.

    """
    whole = write_bag(tmp_path / f'whole{kind}', bad_input.still(20))
    raw = whole.read_bytes()
    counts = []
    for k, size in enumerate(np.linspace(0, len(raw), 41).astype(int)):
        path = tmp_path / f'{k}{kind}'
        path.write_bytes(raw[:size])
        try:
            counts.append(open_record(path).n)
        except InputError:
            counts.append(0)
    assert counts[-1] == 2000 and counts[30] > 1000
    assert all(b >= a for a, b in zip(counts, counts[1:]))


@pytest.mark.parametrize('kind', ['.mcap', '.db3', '.bag', '.npz', '.csv'])
def test_bits_flipped_anywhere(kind, tmp_path):
    """Whatever byte is wrong, nothing but an error for a person comes out."""
    whole = write_bag(tmp_path / f'whole{kind}', bad_input.still(5))
    raw = whole.read_bytes()
    rng = np.random.default_rng(5)
    path = tmp_path / f'flipped{kind}'
    # Headers and indexes are where it matters: half of the places are at the ends of the file.
    places = np.r_[
        rng.integers(0, 600, 30),
        len(raw) - rng.integers(1, 1500, 30),
        rng.integers(0, len(raw), 40),
    ]
    for at in places:
        bad = bytearray(raw)
        bad[min(max(int(at), 0), len(raw) - 1)] ^= 1 << rng.integers(8)
        path.write_bytes(bad)
        try:
            prepare(open_record(path), keep_motion=True)
            topics(path)
        except ImuNoiseError:
            pass


def test_no_permission(tmp_path):
    """A file that may not be read is refused in one line."""
    path = write_bag(tmp_path / 'closed.mcap', bad_input.still(5))
    path.chmod(0)
    if os.access(path, os.R_OK):
        pytest.skip('this user may read everything')
    with pytest.raises(InputError, match='permission denied'):
        open_record(path)


def test_memory_is_bounded(tmp_path):
    """A hostile file takes no more memory than a harmless one of its size could."""
    paths = [bad_input.make_one(name, tmp_path).path for name in (
        'huge_chunk', 'huge_record', 'huge_header', 'zstd_bomb', 'zip_bomb', 'npz_huge_shape',
        'yaml_bomb')]
    code = ('import sys, resource\n'
            'from imu_noise_tools.bag import open_record\n'
            'from imu_noise_tools.core.errors import InputError\n'
            'for path in sys.argv[1:]:\n'
            '    print(path)\n'
            '    try:\n        open_record(path)\n    except InputError:\n        pass\n')

    def limited():
        resource.setrlimit(resource.RLIMIT_AS, (2 << 30, 2 << 30))
    done = subprocess.run(
        [sys.executable, '-c', code, *map(str, paths)],
        cwd=Path(__file__).parents[1],
        preexec_fn=limited,
        env={**os.environ, 'OPENBLAS_NUM_THREADS': '1'},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, (done.stdout, done.stderr[-500:])


def test_missing_file_of_a_bag(tmp_path):
    """A bag with one file missing gives the rest; with a strange one beside it, what is listed."""
    path = write_bag(tmp_path / 'bag', bad_input.still(20))
    text = (path / 'metadata.yaml').read_text()
    (path / 'metadata.yaml').write_text(
        text.replace('relative_file_paths:\n', 'relative_file_paths:\n  - gone.mcap\n')
    )
    record = open_record(path)
    assert record.n == 2000
    assert any('gone.mcap' in w and 'missing' in w for w in record.warnings)
