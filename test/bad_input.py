# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Inputs that go wrong, made by code: what each is, and what reading it has to say.

``corpus(folder)`` makes them all; the tests of reading and of the commands go through them.

"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
import io
import os
from pathlib import Path
import pickle
import struct
import zipfile

import numpy as np
import zstandard

from imu_noise_tools.bag import write_bag
from imu_noise_tools.bag.mcap_writer import McapWriter
from imu_noise_tools.core.record import ImuRecord

START = 1_700_000_000


@dataclass(frozen=True)
class Case:
    """
    One bad input.

    ``outcome`` is what ``analyse`` does: ``refused`` (exit 1, one line with ``words``) or
    ``warned`` (exit 0, with ``words`` in a warning). ``opens`` tells whether it can be inspected
    all the same.

    """

    name: str
    path: Path
    outcome: str
    words: str
    opens: bool = True


def still(seconds: float = 120.0, rate: float = 100.0, seed: int = 1) -> ImuRecord:
    """Return a healthy record at rest."""
    rng = np.random.default_rng(seed)
    n = round(seconds * rate)
    return ImuRecord(gyro=0.01 + 1e-2 * rng.standard_normal((n, 3)),
                     accel=5e-2 * rng.standard_normal((n, 3)) + [0.1, -0.2, 9.8],
                     t=np.arange(n) / rate, rate_hz=rate, start=float(START), frame_id='imu')


_MAKERS: list[tuple[Callable, str, str, bool]] = []


def case(outcome: str, words: str, opens: bool = True):
    """Register a maker: it takes a path without suffix and returns what it made."""
    def keep(make):
        _MAKERS.append((make, outcome, words, opens))
        return make
    return keep


def corpus(folder: Path) -> list[Case]:
    """Make all bad inputs in a folder."""
    return list(_made(Path(folder)))


def names() -> list[str]:
    """Return the names of the cases in order."""
    return [make.__name__ for make, *_ in _MAKERS]


def opening() -> list[str]:
    """Return the names of those that can be inspected."""
    return [make.__name__ for make, _, _, opens in _MAKERS if opens]


def make_one(name: str, folder: Path) -> Case:
    """Make one of them."""
    for make, outcome, words, opens in _MAKERS:
        if make.__name__ == name:
            return Case(name, make(Path(folder) / name), outcome, words, opens)
    raise KeyError(name)


def _made(folder: Path) -> Iterator[Case]:
    for name in names():
        yield make_one(name, folder)


def cut(path: Path, share: float) -> Path:
    """Cut a file short, as a crash does."""
    os.truncate(path, int(path.stat().st_size * share))
    return path


# -- no record at all

@case('refused', 'no such file', opens=False)
def missing(path):
    """Name nothing."""
    return path


@case('refused', 'empty', opens=False)
def empty_file(path):
    """Make a file of no bytes."""
    path = path.with_suffix('.mcap')
    path.touch()
    return path


@case('refused', 'not a bag', opens=False)
def empty_folder(path):
    """Make a folder of nothing."""
    path.mkdir()
    return path


@case('refused', 'not a bag', opens=False)
def text_file(path):
    """Make a file of words."""
    path = path.with_suffix('.bag')
    path.write_text('hello\n' * 1000)
    return path


@case('refused', 'version', opens=False)
def old_rosbag(path):
    """Make a rosbag of version 1.2."""
    path = path.with_suffix('.bag')
    path.write_bytes(b'#ROSBAG V1.2\n' + bytes(5000))
    return path


@case('refused', 'not a file', opens=False)
def fifo(path):
    """Make a pipe that nobody writes to."""
    os.mkfifo(path)
    return path


@case('refused', 'no such file', opens=False)
def dangling_link(path):
    """Make a link to nothing."""
    path.symlink_to('nowhere')
    return path


@case('refused', 'no such file', opens=False)
def link_to_itself(path):
    """Make a link to itself."""
    path.symlink_to(path.name)
    return path


@case('refused', 'nothing|cannot|not a bag', opens=False)
def magic_only(path):
    """Make an MCAP of eight bytes."""
    path = path.with_suffix('.mcap')
    path.write_bytes(b'\x89MCAP0\r\n')
    return path


@case('refused', 'nothing', opens=False)
def sqlite_head_only(path):
    """Make the first page of a database."""
    write_bag(path.with_suffix('.db3'), still(10))
    os.truncate(path.with_suffix('.db3'), 3000)
    return path.with_suffix('.db3')


@case('refused', 'nothing', opens=False)
def database_of_others(path):
    """Make a database of something else."""
    import sqlite3
    path = path.with_suffix('.db3')
    with sqlite3.connect(path) as database:
        database.execute('CREATE TABLE people(name TEXT)')
    database.close()
    return path


# -- the wrong topics

def _topics(path: Path, wanted: dict[str, str], length: int = 324) -> Path:
    """Write an MCAP folder-less file of topics with messages of zeros."""
    path = path.with_suffix('.mcap')
    with open(path, 'xb') as file:
        writer = McapWriter(file)
        for k, (name, kind) in enumerate(wanted.items(), 1):
            schema = struct.pack('<H', k) + _text(kind) + _text('ros2msg') + _text('float64 x')
            writer.add_schema(schema)
            writer.add_channel(
                struct.pack('<HH', k, k) + _text(name) + _text('cdr') + struct.pack('<I', 0)
            )
            rows = np.zeros((200, length), np.uint8)
            rows[:, 1] = 1
            writer.messages({k: (START * 10 ** 9 + np.arange(200) * 10 ** 7, rows)})
        writer.finish()
    return path


def _text(value: str) -> bytes:
    return struct.pack('<I', len(value)) + value.encode()


@case('refused', r'no Imu topic.*/odom', opens=False)
def no_imu_topic(path):
    """Record odometry alone."""
    return _topics(path, {'/odom': 'nav_msgs/msg/Odometry'})


@case('refused', 'custom type', opens=False)
def custom_type(path):
    """Record a type of one's own."""
    return _topics(path, {'/imu': 'my_driver/msg/Imu'})


@case('refused', 'custom type', opens=False)
def custom_layout(path):
    """Record another layout under the standard name."""
    return _topics(path, {'/imu': 'sensor_msgs/msg/Imu'}, length=100)


@case('refused', r'2 Imu topics.*/a/imu.*/b/imu', opens=False)
def two_imu_topics(path):
    """Record two complete units."""
    path = path.with_suffix('.mcap')
    from imu_noise_tools.bag.decode import IMU
    from imu_noise_tools.bag.encode import imu_values, serialise
    with open(path, 'xb') as file:
        writer = McapWriter(file)
        record = still(10)
        when = START * 10 ** 9 + np.round(record.t * 1e9).astype(np.int64)
        rows = serialise(when, imu_values(record.gyro, record.accel), 'imu')
        writer.messages({writer.topic(name, IMU): (when, rows) for name in ('/a/imu', '/b/imu')})
        writer.finish()
    return path


@case('refused', 'no messages|nothing', opens=False)
def no_messages(path):
    """Record a topic on which nothing came."""
    path = path.with_suffix('.mcap')
    with open(path, 'xb') as file:
        writer = McapWriter(file)
        writer.topic('/imu', 'sensor_msgs/msg/Imu')
        writer.finish()
    return path


# -- cut short and damaged

@case('warned', 'cut short')
def truncated_mcap(path):
    """Cut an MCAP in the middle of a chunk."""
    return cut(write_bag(path.with_suffix('.mcap'), still()), 0.8)


@case('warned', 'cut short')
def truncated_mcap_zstd(path):
    """Cut a compressed MCAP in the middle of a chunk."""
    return cut(write_bag(path.with_suffix('.mcap'), still(), compression='zstd'), 0.9)


@case('warned', 'cut short')
def damaged_where_cut(path):
    """Cut a compressed file, and lose what the last chunk begins with."""
    path = write_bag(path.with_suffix('.mcap'), still(), compression='zstd')
    raw = path.read_bytes()
    raw = raw[:int(len(raw) * 0.8)]
    begin = raw.rindex(b'\x28\xb5\x2f\xfd')
    path.write_bytes(raw[:begin + 4] + bytes(200) + raw[begin + 204:])
    return path


@case('warned', 'cut short')
def truncated_sqlite(path):
    """Cut a database in the middle of a page."""
    return cut(write_bag(path.with_suffix('.db3'), still()), 0.8)


@case('warned', 'cut short')
def truncated_rosbag1(path):
    """Cut a rosbag1 in the middle of a chunk."""
    return cut(write_bag(path.with_suffix('.bag'), still()), 0.8)


@case('warned', 'cut short|last line')
def truncated_csv(path):
    """Cut a table in the middle of a line."""
    return cut(write_bag(path.with_suffix('.csv'), still()), 0.8)


@case('refused', 'cannot be read', opens=False)
def truncated_npz(path):
    """Cut an archive, which loses its list of contents."""
    return cut(write_bag(path.with_suffix('.npz'), still()), 0.8)


@case('warned', 'metadata')
def no_metadata(path):
    """Lose the metadata of a folder."""
    write_bag(path, still())
    (path / 'metadata.yaml').unlink()
    return path


@case('warned', 'damaged')
def flipped_bits(path):
    """Flip bits in a chunk that has a checksum."""
    write_bag(path.with_suffix('.mcap'), still())
    raw = bytearray(path.with_suffix('.mcap').read_bytes())
    raw[len(raw) // 2] ^= 0x10
    path.with_suffix('.mcap').write_bytes(raw)
    return path.with_suffix('.mcap')


# -- hostile

@case('refused', 'nothing|cannot|not a bag|no Imu', opens=False)
def huge_chunk(path):
    """Declare a chunk that unpacks to a terabyte."""
    path = path.with_suffix('.mcap')
    body = (
        struct.pack('<QQQI', 0, 0, 1 << 40, 0) + _text('zstd') + struct.pack('<Q', 20) + bytes(20)
    )
    path.write_bytes(b'\x89MCAP0\r\n' + b'\x01' + struct.pack('<Q', 8) + bytes(8)
                     + b'\x06' + struct.pack('<Q', len(body)) + body)
    return path


@case('refused', 'nothing|no Imu', opens=False)
def huge_record(path):
    """Declare a record of an exabyte."""
    path = path.with_suffix('.mcap')
    path.write_bytes(b'\x89MCAP0\r\n\x06' + struct.pack('<Q', 1 << 62) + bytes(1000))
    return path


@case('refused', 'nothing|no Imu', opens=False)
def huge_header(path):
    """Declare a rosbag1 header of four gigabytes."""
    path = path.with_suffix('.bag')
    path.write_bytes(b'#ROSBAG V2.0\n' + b'\xff\xff\xff\xff' + bytes(1000))
    return path


@case('refused', 'far more', opens=False)
def zstd_bomb(path):
    """Compress 300 MB of nothing into some kilobytes."""
    path = path.with_name(path.name + '.db3.zstd')
    pack = zstandard.ZstdCompressor().compressobj()
    with open(path, 'xb') as file:
        file.write(pack.compress(b'SQLite format 3\0'))
        for _ in range(300):
            file.write(pack.compress(bytes(1 << 20)))
        file.write(pack.flush())
    return path


@case('refused', 'far more', opens=False)
def zip_bomb(path):
    """Compress 300 MB of zeros into an .npz of a megabyte."""
    path = path.with_suffix('.npz')
    n = 300 * (1 << 20) // 24
    with zipfile.ZipFile(path, 'x', zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        with archive.open('gyro.npy', 'w', force_zip64=True) as member:
            np.lib.format.write_array_header_1_0(
                member, {'descr': '<f8', 'fortran_order': False, 'shape': (n, 3)})
            for _ in range(300):
                member.write(bytes(1 << 20))
    return path


@case('refused', 'cannot be read|declares', opens=False)
def npz_huge_shape(path):
    """Declare an array of a petabyte."""
    path = path.with_suffix('.npz')
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        head, {'descr': '<f8', 'fortran_order': False, 'shape': (1 << 45, 3)})
    with zipfile.ZipFile(path, 'x') as archive:
        archive.writestr('gyro.npy', head.getvalue() + bytes(100))
    return path


class _Trap:
    """Creates a file where it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        """Say what unpickling runs."""
        return open, (self.path, 'w')


@case('refused', 'header of gyro.npy is damaged', opens=False)
def npz_odd_header(path):
    """Write words where the header of an array has numbers."""
    buffer = io.BytesIO()
    np.save(buffer, still().gyro)
    with zipfile.ZipFile(path.with_suffix('.npz'), 'w') as archive:
        archive.writestr('gyro.npy', buffer.getvalue().replace(b'False', b'Fal_e'))
    return path.with_suffix('.npz')


@case('refused', 'not an array of numbers', opens=False)
def npz_pickle(path):
    """Hide code in an .npz; run, it leaves a file ``<path>.ran``."""
    trap = np.array([_Trap(str(path) + '.ran')], dtype=object)
    with open(path.with_suffix('.npz'), 'xb') as file:
        np.savez(file, gyro=trap)
    return path.with_suffix('.npz')


@case('refused', 'not a bag|nothing|cannot|gyro|array|read', opens=False)
def pickle_named_npz(path):
    """Name a pickle .npz."""
    path.with_suffix('.npz').write_bytes(pickle.dumps(_Trap(str(path) + '.ran')))
    return path.with_suffix('.npz')


@case('warned', 'metadata')
def yaml_bomb(path):
    """Make metadata that unfolds into a billion words."""
    write_bag(path, still())
    text = 'a: &a [x, x, x, x, x, x, x, x, x]\n'
    for k in range(1, 10):
        name, before = 'abcdefghij'[k], 'abcdefghij'[k - 1]
        text += f'{name}: &{name} [{", ".join([f"*{before}"] * 9)}]\n'
    (path / 'metadata.yaml').write_text(text)
    return path


@case('warned', 'metadata')
def retyped_metadata(path):
    """Write mappings and words in the metadata where there are lists and numbers."""
    path = write_bag(path, still())
    (path / 'metadata.yaml').write_text(
        'rosbag2_bagfile_information:\n  version: new\n  message_count: {a: 1}\n'
        '  files: {b: 2}\n  relative_file_paths: 5\n  topics_with_message_count: many\n')
    return path


@case('warned', 'metadata')
def deep_metadata(path):
    """Nest metadata deeper than a stack is."""
    path = write_bag(path, still())
    (path / 'metadata.yaml').write_text('[' * 50_000 + ']' * 50_000)
    return path


@case('warned', 'metadata')
def yaml_object(path):
    """Make metadata that asks for a Python object; made, it leaves a file ``<path>.ran``."""
    write_bag(path, still())
    (path / 'metadata.yaml').write_text(f'!!python/object/apply:os.system ["touch {path}.ran"]\n')
    return path


# -- tables that are none

@case('refused', 'no line of names', opens=False)
def csv_without_header(path):
    """Leave the first line out."""
    path = path.with_suffix('.csv')
    path.write_text('0,0,0,0,0,0,9.8\n' * 1000)
    return path


@case('refused', 'line 3', opens=False)
def csv_with_words(path):
    """Put words among the numbers."""
    path = path.with_suffix('.csv')
    path.write_text('t,gyro_x,gyro_y,gyro_z\n0,1,2,3\n0.01,one,2,3\n0.02,1,2,3\n')
    return path


@case('refused', 'rate', opens=False)
def npz_without_rate(path):
    """Leave stamps and rate out."""
    path = path.with_suffix('.npz')
    np.savez(path, gyro=still().gyro)
    return path


@case('refused', 'differ in length', opens=False)
def npz_of_two_lengths(path):
    """Make fewer accelerations than rates."""
    path = path.with_suffix('.npz')
    np.savez(path, gyro=still().gyro, accel=still().accel[:-5], rate_hz=100.0)
    return path


# -- bad data in a good file

def _with(path: Path, **changes) -> Path:
    return write_bag(path, replace(still(), **changes))


def _gyro(change) -> np.ndarray:
    gyro = still().gyro.copy()
    change(gyro)
    return gyro


@case('refused', 'samples')
def three_samples(path):
    """Record three samples."""
    return write_bag(path, still().part(0, 3))


@case('refused', 'every axis is constant')
def all_constant(path):
    """Record a dead sensor."""
    n = still().n
    return _with(path, gyro=np.full((n, 3), 0.1), accel=np.full((n, 3), 9.8))


@case('refused', 'not finite')
def many_nan(path):
    """Lose a twentieth of the samples to NaN."""
    return _with(path, gyro=_gyro(lambda x: x.__setitem__(slice(None, None, 20), np.nan)))


@case('refused', 'still|rest')
def moving(path):
    """Rock all the time."""
    r = still()
    swing = 1.5 * np.sin(2 * np.pi * 0.3 * r.t)[:, None]
    return _with(
        path, gyro=r.gyro + swing * [1.0, 0.5, 0.2], accel=r.accel + 2 * swing * [0.5, 1.0, 0.1]
    )


@case('warned', 'not finite')
def few_nan(path):
    """Lose ten samples to NaN."""
    return _with(path, gyro=_gyro(lambda x: x.__setitem__((slice(500, 510), 0), np.nan)))


@case('warned', 'not finite')
def infinite(path):
    """Record an infinite sample."""
    return _with(path, gyro=_gyro(lambda x: x.__setitem__((700, 1), np.inf)))


@case('refused', 'not finite')
def overflowing(path):
    """Record values whose squares are no numbers."""
    return _with(path, gyro=_gyro(lambda x: x.__setitem__((slice(None, None, 50), 0), 1e300)))


@case('warned', 'gyro_y.*never changes')
def one_axis_constant(path):
    """Record an axis that is stuck."""
    return _with(path, gyro=_gyro(lambda x: x.__setitem__((slice(None), 1), 0.25)))


@case('warned', 'accel part is all zero')
def half_zero(path):
    """Record no accelerations."""
    return _with(path, accel=np.zeros((still().n, 3)))


@case('warned', 'long gap')
def hour_gap(path):
    """Stop for an hour."""
    t = still().t.copy()
    t[9000:] += 3600
    return _with(path, t=t)


@case('warned', 'lost')
def short_dropout(path):
    """Lose a fifth of a second."""
    keep = np.r_[0:5000, 5020:12000]
    r = still()
    return _with(path, t=r.t[keep], gyro=r.gyro[keep], accel=r.accel[keep])


@case('warned', 'backward')
def backward_stamps(path):
    """Set the clock back by ten seconds."""
    t = still().t.copy()
    t[6000:] -= 10
    return _with(path, t=t, receive_t=still().t)


@case('warned', 'backward')
def swapped_stamps(path):
    """Swap neighbours here and there."""
    t = still().t.copy()
    for k in (100, 2000, 7000):
        t[k], t[k + 1] = t[k + 1], t[k]
    return _with(path, t=t, receive_t=still().t)


@case('warned', 'duplicate')
def duplicate_stamps(path):
    """Give two samples one stamp."""
    t = still().t.copy()
    t[[50, 900, 8000]] = t[[49, 899, 7999]]
    return _with(path, t=t, receive_t=still().t)


@case('warned', 'duplicate')
def repeated_messages(path):
    """Record some messages twice."""
    r = still()
    index = np.sort(np.r_[np.arange(r.n), 100, 5000, 5001])
    return _with(path, t=r.t[index], gyro=r.gyro[index], accel=r.accel[index])


@case('warned', 'stamps are zero')
def zero_stamps(path):
    """Leave all stamps unset."""
    return _zero_stamped(path.with_suffix('.mcap'))


def _zero_stamped(path: Path) -> Path:
    from imu_noise_tools.bag import Block
    r = still()
    receive = START * 10 ** 9 + np.round(r.t * 1e9).astype(np.int64)
    return write_bag(path, [Block(np.zeros(r.n, np.int64), receive, r.gyro, r.accel, 'imu')])


@case('warned', 'wrong unit suspected.*--accel-unit g')
def accel_in_g(path):
    """Record accelerations in g."""
    return _with(path, accel=still().accel / 9.80665)


@case('warned', 'wrong unit suspected.*--gyro-unit deg/s')
def gyro_in_degrees(path):
    """Record rates in degrees per second."""
    return _with(path, gyro=np.degrees(still().gyro))
