# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Reading and writing bags.

The real ones; the bulk decoder against rosbags' own; separate topics; copies.

"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
import sqlite3
import struct
import subprocess
import sys

import bad_input
from hypothesis import given, settings, strategies as st
import numpy as np
from params import daily, seldom
import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer as Writer2
from rosbags.typesys import get_typestore, Stores

from imu_noise_tools.bag import (
    Block,
    Changed,
    copy_bag,
    iter_blocks,
    iter_raw,
    open_record,
    topics,
    write_bag,
)
from imu_noise_tools.bag.container import Batch, Connection
from imu_noise_tools.bag.decode import decode, DOUBLES, IMU, TEMPERATURE, VECTOR
from imu_noise_tools.bag.encode import imu_values, serialise
from imu_noise_tools.bag.mcap_writer import McapWriter
from imu_noise_tools.bag.rosbag1_writer import Rosbag1Writer
from imu_noise_tools.bag.sqlite_writer import SqliteWriter
from imu_noise_tools.cli.main import main
from imu_noise_tools.core.errors import InputError, UsageError
from imu_noise_tools.core.units import G0
from imu_noise_tools.health.stamps import ordered

STORE = get_typestore(Stores.ROS2_JAZZY)
STORE1 = get_typestore(Stores.ROS1_NOETIC)
START = bad_input.START * 10 ** 9
STATIC = ('amr_imu_static_sqlite3', 'amr_imu_static_mcap', 'amr_imu_static_mcap_zstd',
          'amr_imu_static_sqlite3_file_zstd', 'amr_imu_static_sqlite3_message_zstd')
COUNTS = {
    'mpu6050_static_449s': 44930,
    'imu_tools_phidgets_imu_upside_down.bag': 13964,
    'robot_localization_test1.bag': 11865,
    'xsens_mti_multipos': 51175,
    'imucal_ferraris': 10376,
}


def by_rosbags(path, topic=None):
    """Return stamp, receive, gyro and accel of an Imu topic as rosbags reads them."""
    found = []
    with AnyReader([Path(path)], default_typestore=STORE) as reader:
        chosen = [c for c in reader.connections if c.msgtype == IMU and topic in (None, c.topic)]
        for connection, receive, raw in reader.messages(chosen):
            m = reader.deserialize(raw, connection.msgtype)
            w, a = m.angular_velocity, m.linear_acceleration
            found.append((m.header.stamp.sec * 10 ** 9 + m.header.stamp.nanosec, receive,
                          (w.x, w.y, w.z), (a.x, a.y, a.z)))
    stamp, receive, gyro, accel = zip(*found)
    return np.array(stamp), np.array(receive), np.array(gyro), np.array(accel)


def same(record, truth):
    """Assert that a record holds exactly what rosbags read."""
    stamp, receive, gyro, accel = truth
    np.testing.assert_array_equal(record.gyro, gyro)
    np.testing.assert_array_equal(record.accel, accel)
    np.testing.assert_array_equal(record.t, (stamp - stamp[0]) * 1e-9)
    np.testing.assert_array_equal(record.receive_t, (receive - stamp[0]) * 1e-9)


# -- real bags

@pytest.mark.parametrize('name', daily(
    [*STATIC, *COUNTS], *STATIC, *list(COUNTS)[:2], 'imucal_ferraris'))
def test_real_bag(shared_data, name):
    """Every real bag gives what rosbags reads, to the last bit, whole and in blocks."""
    path = shared_data / 'bags' / name
    record = open_record(path)
    assert record.n == COUNTS.get(name, 4894)
    assert record.warnings == ()
    same(record, by_rosbags(path))
    assert [t.samples for t in topics(path) if t.name == record.topic] == [record.n]
    blocks = list(iter_blocks(path, block=1000))
    assert max(len(b.stamp) for b in blocks) <= 1000
    np.testing.assert_array_equal(np.concatenate([b.gyro for b in blocks]), record.gyro)


def test_containers_agree(shared_data):
    """The five containers of one recording give one record."""
    first, *others = [open_record(shared_data / 'bags' / n) for n in STATIC]
    for other in others:
        np.testing.assert_array_equal(other.gyro, first.gyro)
        np.testing.assert_array_equal(other.t, first.t)


@pytest.mark.parametrize('name, words', [('no_imu_topic_sqlite3', 'no Imu topic.*/odom'),
                                         ('custom_imu_type_mcap', 'custom type.*/gpstopic')])
def test_real_refusals(shared_data, name, words):
    """What has no Imu topic is refused, and the topics are listed."""
    with pytest.raises(InputError, match=words):
        open_record(shared_data / 'bags' / name)


@pytest.mark.parametrize('name, least', [('truncated_ros1.bag', 9000), ('truncated_db3', 3000)])
def test_real_broken(shared_data, name, least):
    """What is whole in a broken bag is read, and equals the beginning of the whole one."""
    record = open_record(shared_data / 'bags' / 'broken' / name)
    assert record.n >= least
    assert any('cut short' in w for w in record.warnings)
    whole = open_record(shared_data / 'bags' / {'truncated_db3': 'amr_imu_static_sqlite3'}.get(
        name, 'imu_tools_phidgets_imu_upside_down.bag'))
    np.testing.assert_array_equal(record.gyro[:least], whole.gyro[:least])
    assert np.all(np.isin(record.t + record.start, whole.t + whole.start))


# -- the bulk decoder against rosbags', over whatever may differ

def imu_message(store, stamp, frame, numbers):
    """Build one Imu message of rosbags."""
    t = store.types
    time = t['builtin_interfaces/msg/Time'](sec=stamp // 10 ** 9, nanosec=stamp % 10 ** 9)
    seq = {'seq': 0} if store is STORE1 else {}
    vector = t['geometry_msgs/msg/Vector3']
    return t[IMU](
        header=t['std_msgs/msg/Header'](stamp=time, frame_id=frame, **seq),
        orientation=t['geometry_msgs/msg/Quaternion'](*numbers[:4]),
        orientation_covariance=numbers[4:13],
        angular_velocity=vector(*numbers[13:16]),
        angular_velocity_covariance=numbers[16:25],
        linear_acceleration=vector(*numbers[25:28]),
        linear_acceleration_covariance=numbers[28:37],
    )


FRAMES = st.text(st.characters(codec='utf-8', exclude_characters='\0'), max_size=20)


@settings(max_examples=60)
@given(
    data=st.data(),
    frames=st.lists(FRAMES, min_size=1, max_size=3),
    ros1=st.booleans(),
    big=st.booleans(),
    seed=st.integers(0, 2**32 - 1),
)
def test_bulk_equals_plain(data, frames, ros1, big, seed):
    """Messages of any frame, endianness and encoding decode to rosbags' bits."""
    rng = np.random.default_rng(seed)
    n = data.draw(st.integers(1, 12))
    numbers = rng.standard_normal((n, 37)) * 10.0 ** rng.integers(-300, 300, (n, 37))
    numbers[rng.random((n, 37)) < 0.05] = np.nan
    store = STORE1 if ros1 else STORE
    stamps = START + rng.integers(0, 10 ** 12, n)
    raw = []
    for k in range(n):
        message = imu_message(
            store, int(stamps[k]), data.draw(st.sampled_from(frames)), numbers[k]
        )
        if ros1:
            raw.append(bytes(store.serialize_ros1(message, IMU)))
        else:
            raw.append(bytes(store.serialize_cdr(message, IMU, little_endian=not big)))
    if data.draw(st.booleans()):
        # one is longer than it should be
        raw[data.draw(st.integers(0, n - 1))] += b'\0\0\0\0'
    batch = batch_of(raw, IMU, 'ros1' if ros1 else 'cdr')
    fast, slow = decode(batch), decode(batch, plain=True)
    np.testing.assert_array_equal(fast.readable, slow.readable)
    np.testing.assert_array_equal(fast.stamp, slow.stamp)
    np.testing.assert_array_equal(
        np.array(fast.values, '=f8').view(np.int64), slow.values.view(np.int64)
    )
    assert fast.frame_id == slow.frame_id and fast.frames == slow.frames


def batch_of(raw, type, encoding):
    """Return raw messages as a batch with odd bytes between them."""
    length = np.array([len(r) for r in raw])
    begin = np.cumsum(length + 3) - length
    return Batch(
        Connection(1, '/imu', type, encoding),
        np.arange(len(raw)),
        np.frombuffer(b''.join(b'\xaa\xbb\xcc' + r for r in raw), np.uint8),
        begin,
        length,
    )


@pytest.mark.parametrize('encoding', ['cdr', 'ros1'])
@pytest.mark.parametrize('frame', ['', 'a', 'imu_link', 'base_imu_link_frame'])
def test_padding_may_be_anything(frame, encoding):
    """What pads a message before its doubles is not initialised by real writers."""
    values = np.random.default_rng(0).standard_normal((5, 37))
    rows = serialise(START + np.arange(5), values, frame, encoding)
    body = rows.shape[1] - 37 * 8
    used = 16 + len(frame) + (encoding == 'cdr')
    rows[:, used:body] = 0xee
    found = decode(batch_of([r.tobytes() for r in rows], IMU, encoding))
    np.testing.assert_array_equal(found.values, values)
    assert found.readable.all() and found.frame_id == frame


@pytest.mark.parametrize(
    'kind', ['mcap', 'mcap_zstd', 'sqlite3', 'file', 'message', 'bag', 'bag_lz4', 'bag_bz2']
)
def test_written_by_rosbags(kind, tmp_path):
    """
    Bags of rosbags' writers are read to the last bit.

    There are topics between, and frames that change.

    """
    rng = np.random.default_rng(2)
    ros1 = kind.startswith('bag')
    store = STORE1 if ros1 else STORE
    path = tmp_path / ('x.bag' if ros1 else 'x')
    if ros1:
        writer = Writer1(path)
        if kind != 'bag':
            writer.set_compression(
                {'lz4': Writer1.CompressionFormat.LZ4, 'bz2': Writer1.CompressionFormat.BZ2}[
                    kind[4:]
                ]
            )
    else:
        plugin = StoragePlugin.MCAP if kind.startswith('mcap') else StoragePlugin.SQLITE3
        writer = Writer2(path, version=9, storage_plugin=plugin)
        mode = {'mcap_zstd': CompressionMode.STORAGE, 'file': CompressionMode.FILE,
                'message': CompressionMode.MESSAGE}.get(kind)
        if mode:
            writer.set_compression(mode, CompressionFormat.ZSTD)
    pack = store.serialize_ros1 if ros1 else store.serialize_cdr
    text = store.types['std_msgs/msg/String']
    with writer:
        imu = writer.add_connection('/imu', IMU, typestore=store)
        other = writer.add_connection('/talk', 'std_msgs/msg/String', typestore=store)
        for k in range(3000):
            stamp = START + k * 10 ** 7
            frame = 'imu' if k < 2000 else 'imu_with_another_name'
            writer.write(
                imu,
                stamp + 1000,
                pack(imu_message(store, stamp, frame, rng.standard_normal(37)), IMU),
            )
            for _ in range(rng.integers(0, 3)):
                said = text('x' * int(rng.choice([1, 50, 9000], p=[0.6, 0.39, 0.01])))
                writer.write(other, stamp + 2000, pack(said, 'std_msgs/msg/String'))
    record = open_record(path)
    assert record.n == 3000 and record.warnings == ()
    if kind != 'message':
        same(record, by_rosbags(path))
    info = {t.name: t for t in topics(path)}
    assert info['/imu'].samples == 3000 and info['/imu'].role == 'imu'
    assert info['/imu'].rate_hz == pytest.approx(100, rel=1e-3)


@pytest.mark.parametrize('kind', ['mcap', 'sqlite3', 'bag', 'cut.mcap', 'cut.bag', 'cut.db3'])
def test_a_topic_has_the_rate_of_its_own_time(kind, tmp_path):
    """One that begins late and ends early: 10 Hz, with and without the index of the file."""
    ros1 = kind.endswith('bag')
    store, path = (STORE1, tmp_path / 'x.bag') if ros1 else (STORE, tmp_path / 'x')
    writer = Writer1(path) if ros1 else Writer2(path, version=9, storage_plugin=(
        StoragePlugin.MCAP if 'mcap' in kind else StoragePlugin.SQLITE3))
    text = store.types['std_msgs/msg/String']('x' * 300)
    raw = (store.serialize_ros1 if ros1 else store.serialize_cdr)(text, 'std_msgs/msg/String')
    with writer:
        every, late = (writer.add_connection(name, 'std_msgs/msg/String', typestore=store)
                       for name in ('/every', '/late'))
        for k in range(30_000):
            writer.write(every, START + k * 10 ** 7, raw)
            if 20_000 <= k < 21_000 and k % 10 == 0:
                writer.write(late, START + k * 10 ** 7, raw)
    if kind.startswith('cut'):
        whole = path if ros1 else next(f for f in path.iterdir() if f.suffix != '.yaml')
        path = tmp_path / f'cut{whole.suffix}'
        path.write_bytes(whole.read_bytes()[:-100_000])
    info = {t.name: t for t in topics(path)}
    assert info['/late'].samples == 100
    assert info['/late'].rate_hz == pytest.approx(10, rel=1e-6)
    assert info['/every'].rate_hz == pytest.approx(100, rel=1e-3)      # a row or two is lost


def parts_of(folder, ending, begins):
    """Write recordings of 60 s that begin at these times, s, into a folder; return the record."""
    folder.mkdir()
    record = bad_input.still(60)
    for k, begin in enumerate(begins):
        write_bag(folder / f'run_{9 + k}{ending}', replace(record, start=record.start + begin))
    return record


@pytest.mark.parametrize('ending', ['.bag', '.mcap', '.db3'])
def test_a_folder_of_parts_is_one_recording(ending, tmp_path):
    """In the order of their times, with a word; a copy of it is such a folder, too."""
    one = parts_of(tmp_path / 'x', ending, [0, 60])
    record = open_record(tmp_path / 'x')
    np.testing.assert_array_equal(record.gyro, np.concatenate([one.gyro, one.gyro]))
    assert [w for w in record.warnings if '2 files of the folder' in w and 'name one' in w]
    if ending == '.bag':
        assert 'metadata' not in record.warnings[0]
    copy_bag(tmp_path / 'x', tmp_path / 'y', lambda r: Changed(2 * r.gyro, None))
    again = open_record(tmp_path / 'y', '/imu/data_filtered')
    np.testing.assert_array_equal(again.gyro, 2 * record.gyro)


@pytest.mark.parametrize('ending', ['.bag', '.mcap', '.db3'])
def test_a_folder_of_recordings_is_no_bag(ending, tmp_path):
    """Where they are of the same time; nor is a folder of bags, of tables, or a study."""
    parts_of(tmp_path / 'x', ending, [0, 5])
    with pytest.raises(InputError, match=rf'same time, run_9\{ending}, run_10\{ending}.*name one'):
        open_record(tmp_path / 'x')
    with pytest.raises(InputError, match='a folder with x: name one'):
        open_record(tmp_path)
    (tmp_path / 'x.csv').touch()
    with pytest.raises(InputError, match='a folder with x, x.csv: name one'):
        open_record(tmp_path)
    (tmp_path / 'study.yaml').touch()
    with pytest.raises(InputError, match='a study, not a bag'):
        open_record(tmp_path)


@pytest.mark.parametrize('chunked', [True, False])
def test_mcap_without_summary_or_index(tmp_path, chunked):
    """An MCAP of bare records is read as one with an index is."""
    record = bad_input.still(60)
    whole = write_bag(tmp_path / 'whole.mcap', record).read_bytes()
    out, at = [whole[:8]], 8
    while at < len(whole) - 8:
        op, length = whole[at], int.from_bytes(whole[at + 1:at + 9], 'little')
        body = whole[at + 9:at + 9 + length]
        if op == 6:
            out.append(whole[at:at + 9 + length] if chunked else body[40:])     # compression is ''
        elif op in (1, 15):
            out.append(whole[at:at + 9 + length])
        if op == 15:
            break
        at += 9 + length
    (tmp_path / 'bare.mcap').write_bytes(
        b''.join(out) + b'\x02' + struct.pack('<QQQI', 20, 0, 0, 0) + whole[:8])
    bare = open_record(tmp_path / 'bare.mcap')
    np.testing.assert_array_equal(bare.gyro, record.gyro)
    assert bare.warnings == ()
    assert [t.samples for t in topics(tmp_path / 'bare.mcap')] == [record.n]


@pytest.mark.parametrize('other', ['imu_back', 'imu_behind', 'f'])
@pytest.mark.parametrize('kind', ['.mcap', '.bag'])
def test_two_sensors_that_send_on_one_topic_are_said(other, kind, tmp_path):
    """They made one even record of twice the rate, and nothing was said of it."""
    record = bad_input.still(6)
    stamp = START + np.arange(record.n) * 10 ** 7

    def block(k):
        i = slice(k, k + 1)
        return Block(stamp[i], stamp[i], record.gyro[i], record.accel[i], ('f', other)[k % 2])

    write_bag(tmp_path / f'x{kind}', [block(k) for k in range(record.n)])
    said = [w for w in open_record(tmp_path / f'x{kind}').warnings if 'several frames' in w]
    assert len(said) == (other != 'f') and all(f'in turn (f, {other})' in w for w in said)


def test_log_times_out_of_order(tmp_path):
    """Messages are in order of the times of receiving, as rosbags gives them."""
    record = bad_input.still(30)
    rng = np.random.default_rng(4)
    receive = START + np.arange(record.n) * 10 ** 7 + rng.integers(0, 5 * 10 ** 7, record.n)
    stamp = START + np.arange(record.n) * 10 ** 7
    write_bag(tmp_path / 'x.mcap', [Block(stamp, receive, record.gyro, record.accel, 'f')])
    same(open_record(tmp_path / 'x.mcap'), by_rosbags(tmp_path / 'x.mcap'))


def test_sqlite_as_recorded_by_others(tmp_path):
    """Small and large pages, a column more, rows that go on in other pages are read."""
    record = bad_input.still(20)
    for page, more in ((512, ''), (1024, ''), (65536, ''), (4096, ', note TEXT')):
        path = write_bag(tmp_path / f'{page}{bool(more)}.db3', record)
        database = sqlite3.connect(path)
        database.execute(f'PRAGMA page_size = {page}')
        if more:
            database.execute('ALTER TABLE messages ADD COLUMN note TEXT')
        database.execute("UPDATE topics SET id = 300 WHERE id = 1")
        database.execute('UPDATE messages SET topic_id = 300')
        database.commit()
        database.execute('VACUUM')
        database.close()
        np.testing.assert_array_equal(open_record(path).gyro, record.gyro)


def test_sqlite_of_other_text(tmp_path):
    """Messages of a database whose text is UTF-16 are read to the last bit."""
    record = bad_input.still(20)
    path = write_bag(tmp_path / 'x.db3', record)
    with sqlite3.connect(path) as database:
        script = list(database.iterdump())
    other = sqlite3.connect(tmp_path / 'y.db3')
    other.execute("PRAGMA encoding = 'UTF-16'")
    other.executescript('\n'.join(script))
    other.close()
    np.testing.assert_array_equal(open_record(tmp_path / 'y.db3').gyro, record.gyro)


@pytest.mark.parametrize('change, lost', [
    ("timestamp = 'soon'", 0), ('timestamp = 0.5', 0), ("data = 'text'", 1), ('data = 7', 1),
    ("data = x''", 1)])
def test_sqlite_of_other_types(change, lost, tmp_path):
    """A row whose time is of a type that cannot be is read, one without a message is left out."""
    record = bad_input.still(20)
    path = write_bag(tmp_path / 'x.db3', record)
    with sqlite3.connect(path) as database:
        database.execute(f'UPDATE messages SET {change} WHERE id = 1000')
    kept = np.arange(record.n) != (999 if lost else -1)
    found = open_record(path)
    np.testing.assert_array_equal(np.sort(found.gyro, axis=0), np.sort(record.gyro[kept], axis=0))


def test_sqlite_write_ahead_log(tmp_path):
    """What a recorder has not yet put into the file is read from the log beside it."""
    record = bad_input.still(20)
    path = write_bag(tmp_path / 'x.db3', record)
    database = sqlite3.connect(path)
    database.execute('PRAGMA journal_mode = WAL')
    database.execute('DELETE FROM messages WHERE id > 1500')
    database.commit()
    try:
        assert open_record(path).n == 1500
    finally:
        database.close()


# -- writing and reading back

@pytest.mark.parametrize('name', ['a', 'b.mcap', 'c.db3', 'd.bag', 'e.csv', 'f.npz'])
def test_round_trip(name, tmp_path):
    """What is written is read back to the last bit, covariates too, and rosbags reads the same."""
    n = 6000
    slow = np.linspace(20, 30, n)
    record = replace(bad_input.still(60), covariates={
        'temperature': slow, 'temperature_2': slow + 1, 'pressure': 1e5 + slow,
        **{f'magnetic_{a}': slow * 1e-6 for a in 'xyz'}})
    path = write_bag(tmp_path / name, record)
    back = open_record(path)
    np.testing.assert_array_equal(back.gyro, record.gyro)
    np.testing.assert_array_equal(back.accel, record.accel)
    np.testing.assert_allclose(back.t, record.t, atol=3e-7, rtol=0)
    assert back.start == pytest.approx(record.start, abs=1e-6)
    assert set(back.covariates) == set(record.covariates)
    for key, value in record.covariates.items():
        np.testing.assert_allclose(back.covariates[key], value, rtol=1e-12)
    if path.suffix not in ('.csv', '.npz'):
        same(back, by_rosbags(path))
    with pytest.raises(InputError, match='exists'):
        write_bag(path, record)
    write_bag(path, record, force=True)


@pytest.mark.parametrize('kept', ['a.mcap', 'a.db3'])
def test_a_rosbag1_beside_a_rosbag2_is_said_to_be_left_out(kept, tmp_path):
    """One is the other converted, as a rule: of a folder of both the newer kind is read."""
    record = bad_input.still(5)
    write_bag(tmp_path / kept, record)
    write_bag(tmp_path / 'b.bag', record)
    write_bag(tmp_path / 'c.bag', record)
    found = open_record(tmp_path)
    assert found.n == record.n
    assert [w for w in found.warnings if 'left out' in w] == [
        'b.bag, c.bag: left out (rosbag1 beside rosbag2; name one of them to read it)']


def test_zstd_sqlite3_and_rosbag1_by_storage(tmp_path):
    """Storage and compression are chosen by name."""
    record = bad_input.still(20)
    small = write_bag(
        tmp_path / 'small', replace(record, gyro=np.round(record.gyro, 3)), compression='zstd'
    )
    assert open_record(small).n == record.n
    assert (write_bag(tmp_path / 'lite', record, storage='sqlite3') / 'lite_0.db3').is_file()
    with pytest.raises(UsageError, match='choose from mcap'):
        write_bag(tmp_path / 'x', record, storage='tape')


def test_no_room(tmp_path):
    """Where a file cannot grow any more, that is one line for a person, and nothing is left."""
    code = ('import resource, sys\n'
            'sys.path.insert(0, "test")\n'
            'import bad_input\n'
            'from imu_noise_tools.bag import write_bag\n'
            'from imu_noise_tools.core.errors import InputError\n'
            'resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, 300_000))\n'
            'for path in sys.argv[1:]:\n'
            '    try:\n        write_bag(path, bad_input.still(60))\n'
            '    except InputError as error:\n        print(error)\n')
    paths = [str(tmp_path / n) for n in ('a', 'b.mcap', 'c.db3', 'd.bag', 'e.csv', 'f.npz')]
    done = subprocess.run([sys.executable, '-c', code, *paths], capture_output=True,
                          text=True, cwd=Path(__file__).parents[1])
    said = done.stdout.splitlines()
    assert len(said) == len(paths) and done.stderr == '', done
    assert all(p in s and 'cannot be written' in s for p, s in zip(paths, said)), said
    assert list(tmp_path.iterdir()) == []


def test_interrupted_writing_leaves_nothing(tmp_path):
    """Ctrl-C half-way leaves no file and the old bag whole."""
    record = bad_input.still(20)

    def blocks():
        yield Block(np.arange(10), np.arange(10), record.gyro[:10], record.accel[:10], 'f')
        raise KeyboardInterrupt
    for name in ('a', 'b.mcap', 'c.db3', 'd.bag'):
        write_bag(tmp_path / name, record)
        with pytest.raises(KeyboardInterrupt):
            write_bag(tmp_path / name, blocks(), force=True)
        assert open_record(tmp_path / name).n == record.n
    assert sorted(p.name for p in tmp_path.iterdir()) == ['a', 'b.mcap', 'c.db3', 'd.bag']


# -- which topics

def bag_of(path, parts):
    """Write an MCAP of topics: name -> (type, stamps, doubles)."""
    with open(path, 'xb') as file:
        writer = McapWriter(file)
        writer.messages({writer.topic(name, type): (stamps, serialise(stamps, values, 'imu'))
                         for name, (type, stamps, values) in parts.items()})
        writer.finish()
    return path


def part(record, gyro, accel):
    """Return the doubles of messages that hold one part or both."""
    return imu_values(record.gyro if gyro else None, record.accel if accel else None)


def test_separate_topics_of_one_clock(tmp_path):
    """Topics of one part each, of the same stamps or nearly, are put together."""
    r = bad_input.still(30)
    stamps = START + np.arange(r.n) * 10 ** 7
    for shift in (0, 2 * 10 ** 6):
        path = bag_of(
            tmp_path / f'{shift}.mcap',
            {
                '/camera/gyro/sample': (IMU, stamps, part(r, True, False)),
                '/camera/accel/sample': (IMU, stamps + shift, part(r, False, True)),
            },
        )
        record = open_record(path)
        np.testing.assert_array_equal(record.gyro, r.gyro)
        np.testing.assert_array_equal(record.accel, r.accel)
        assert record.warnings == ()
        assert record.topic == '/camera/gyro/sample,/camera/accel/sample'
        alone = open_record(path, '/camera/accel/sample')
        assert alone.gyro is None and alone.axes == ('accel_x', 'accel_y', 'accel_z')


def test_separate_topics_of_two_rates(tmp_path):
    """Where the rates differ the accelerations are interpolated, and it is said."""
    r = bad_input.still(30)
    stamps = START + np.arange(r.n) * 10 ** 7
    ramp = np.zeros((r.n // 2, 37))
    ramp[:, 25] = np.arange(r.n // 2) * 2
    ramp[:, 26:28] = 1.0
    path = bag_of(tmp_path / 'x.mcap', {'/gyro': (IMU, stamps, part(r, True, False)),
                                        '/accel': (IMU, stamps[::2], ramp)})
    record = open_record(path)
    np.testing.assert_allclose(record.accel[:-1, 0], np.arange(r.n - 1), rtol=1e-9)
    assert any('interpolated' in w for w in record.warnings)


def test_vector_topics(tmp_path):
    """Vector3Stamped topics are joined where their names say what they are."""
    r = bad_input.still(30)
    stamps = START + np.arange(r.n) * 10 ** 7
    path = bag_of(tmp_path / 'x.mcap', {'/angular_velocity': (VECTOR, stamps, r.gyro),
                                        '/acceleration': (VECTOR, stamps, r.accel)})
    record = open_record(path)
    np.testing.assert_array_equal(record.gyro, r.gyro)
    np.testing.assert_array_equal(record.accel, r.accel)
    alone = open_record(path, 'angular_velocity')
    assert alone.accel is None and np.array_equal(alone.gyro, r.gyro)
    alone = open_record(path, 'acceleration')
    assert alone.gyro is None and np.array_equal(alone.accel, r.accel)


def test_a_pair_without_one_part(tmp_path):
    """A pair of which one has not what it should have is refused."""
    r = bad_input.still(30)
    stamps = START + np.arange(r.n) * 10 ** 7
    path = bag_of(tmp_path / 'x.mcap', {'/a': (IMU, stamps, part(r, True, False)),
                                        '/b': (IMU, stamps, part(r, True, False))})
    with pytest.raises(InputError, match='/b lacks the readings'):
        open_record(path, '/a,/b')


def test_chosen_topic(tmp_path):
    """
    One of several topics is chosen with or without its slash.

    A wrong one is refused with a list.

    """
    path = bad_input.make_one('two_imu_topics', tmp_path).path
    assert open_record(path, 'a/imu').topic == '/a/imu'
    with pytest.raises(InputError, match=r'no topic /c.*/a/imu'):
        open_record(path, '/c')


def test_covariates_of_another_clock(tmp_path):
    """A temperature whose stamps are of another clock is placed by the times of receiving."""
    r = bad_input.still(30)
    stamps = START + np.arange(r.n) * 10 ** 7
    path = tmp_path / 'x.mcap'
    with open(path, 'xb') as file:
        writer = McapWriter(file)
        imu, temperature = writer.topic('/imu', IMU), writer.topic('/t', TEMPERATURE)
        warm = np.stack([np.linspace(20, 30, r.n), np.zeros(r.n)], axis=1)
        writer.messages({imu: (stamps, serialise(stamps, imu_values(r.gyro, r.accel), 'imu')),
                         temperature: (stamps, serialise(np.arange(r.n), warm, 'imu'))})
        writer.finish()
    record = open_record(path)
    np.testing.assert_allclose(record.covariates['temperature'], warm[:, 0])
    assert any('clock' in w for w in record.warnings)


def test_units_and_kinds(tmp_path):
    """Units are converted only when asked; increments and integrals become rates."""
    r = bad_input.still(30)
    path = write_bag(tmp_path / 'x.mcap', r)
    np.testing.assert_allclose(open_record(path, gyro_unit='deg/s').gyro, np.radians(r.gyro))
    np.testing.assert_allclose(open_record(path, accel_unit='mg').accel, r.accel * 9.80665e-3)
    np.testing.assert_allclose(open_record(path, input_kind='delta').gyro, r.gyro * 100)
    whole = write_bag(
        tmp_path / 'y.mcap',
        replace(r, gyro=np.cumsum(r.gyro, 0) / 100, accel=np.cumsum(r.accel, 0) / 100),
    )
    np.testing.assert_allclose(
        open_record(whole, input_kind='integrated').gyro, r.gyro[1:], atol=1e-9
    )
    assert open_record(path, rate_hz=50.0).duration_s == pytest.approx(2 * r.duration_s)
    for unit, size in (('1/131deg/s', np.radians(1) / 131), ('0.00106', 0.00106),
                       ('1.06e-3 rad/s', 0.00106), ('.5 mdeg/s', np.radians(0.5e-3))):
        counts = open_record(path, gyro_unit=unit)
        np.testing.assert_allclose(counts.gyro, size * r.gyro)
        assert counts.input_unit == {'gyro': unit}
    np.testing.assert_allclose(open_record(path, accel_unit='0.061mg').accel,
                               0.061e-3 * G0 * r.accel)
    for wrong in (
        {'gyro_unit': 'rpm'},
        {'accel_unit': 'gal'},
        {'gyro_unit': '1/0deg/s'},
        {'gyro_unit': '-1/131deg/s'},
        {'accel_unit': '0g'},
        {'accel_unit': 'nan'},
        {'accel_unit': '1/16384deg/s'},
        {'gyro_unit': '131/'},
        {'input_kind': 'sum'},
        {'rate_hz': -1.0},
    ):
        with pytest.raises(UsageError):
            open_record(path, **wrong)


def test_progress(tmp_path):
    """Progress rises to 1."""
    seen = []
    for name in ('x.mcap', 'x.db3', 'x.bag'):
        path = write_bag(tmp_path / name, bad_input.still(200))
        seen.clear()
        open_record(path, progress=seen.append)
        assert len(seen) > 1 and seen == sorted(seen) and 0.9 < seen[-1] <= 1


def test_raw_messages(tmp_path):
    """Replay gives CDR Imu messages from any kind of bag."""
    r = bad_input.still(10)
    for name in ('x.mcap', 'x.db3', 'x.bag', 'x.npz'):
        raw = list(iter_raw(write_bag(tmp_path / name, r)))
        assert len(raw) == r.n
        receive, message, stamp = raw[-1]
        m = STORE.deserialize_cdr(message, IMU)
        assert (
            m.angular_velocity.y == r.gyro[-1, 1]
            and m.header.stamp.sec * 10**9 + m.header.stamp.nanosec == stamp
        )


# -- copies

@pytest.mark.parametrize('name', ['a', 'b.mcap', 'c.db3', 'd.bag'])
def test_copy(name, tmp_path):
    """A copy holds all that was there, message by message, and one topic more."""
    record = replace(bad_input.still(60), covariates={'temperature': np.linspace(20, 30, 6000)})
    source = write_bag(tmp_path / name, record)
    target = tmp_path / f'copy_{name}'
    copy_bag(source, target, lambda r: Changed(2 * r.gyro, None, np.eye(3)))
    assert messages(source) == {
        k: v for k, v in messages(target).items() if k != '/imu/data_filtered'
    }
    back, new = open_record(target, '/imu/data_raw'), open_record(target, '/imu/data_filtered')
    np.testing.assert_array_equal(back.gyro, record.gyro)
    np.testing.assert_array_equal(new.gyro, 2 * record.gyro)
    np.testing.assert_array_equal(new.accel, record.accel)
    np.testing.assert_array_equal(new.t, back.t)
    with AnyReader([target], default_typestore=STORE) as reader:
        mine = [c for c in reader.connections if c.topic == '/imu/data_filtered']
        _, _, raw = next(reader.messages(mine))
        np.testing.assert_array_equal(
            reader.deserialize(raw, IMU).angular_velocity_covariance, np.eye(3).ravel()
        )
    with pytest.raises(InputError, match='already'):
        copy_bag(target, tmp_path / f'again_{name}', lambda r: r, topic='/imu/data_raw')
    with pytest.raises(UsageError, match='the bag that is read'):
        copy_bag(source, source, lambda r: r)


def messages(path):
    """Return all raw messages with their times by topic."""
    found = {}
    with AnyReader([path], default_typestore=STORE) as reader:
        for connection, receive, raw in reader.messages():
            found.setdefault(connection.topic, []).append((receive, bytes(raw)))
    return found


@pytest.mark.parametrize(
    'name', ['truncated_mcap', seldom('truncated_sqlite'), 'truncated_rosbag1', 'flipped_bits']
)
def test_copy_of_what_is_whole(name, tmp_path):
    """The copy of a damaged bag is a sound one of what could be read."""
    source = bad_input.make_one(name, tmp_path).path
    target = tmp_path / f'copy{source.suffix}'
    record = open_record(source)
    copy_bag(source, target, lambda r: Changed(-r.gyro))
    assert open_record(target, 'imu/data_raw').warnings == ()
    np.testing.assert_array_equal(open_record(target, 'imu/data_filtered').gyro, -record.gyro)
    assert len(messages(target)['/imu/data_raw']) == record.n


@pytest.mark.parametrize('suffix', ['.csv', '.npz'])
def test_a_thermometer_that_is_read_less_often(suffix, tmp_path):
    """Empty cells are interpolated; a column that is empty throughout is none."""
    r = bad_input.still(5)
    rarely = np.where(np.arange(r.n) % 50 == 10, 20 + 0.1 * r.t, np.nan)
    path = write_bag(tmp_path / f'x{suffix}', replace(r, covariates={
        'temperature': rarely, 'pressure': np.full(r.n, np.nan)}))
    warm = open_record(path).covariates
    assert set(warm) == {'temperature'}
    at = np.flatnonzero(np.isfinite(rarely))
    np.testing.assert_allclose(warm['temperature'], np.interp(np.arange(r.n), at, rarely[at]))


def echoed(r):
    """Return the lines of ``ros2 topic echo --csv`` of a record."""
    stamp = START + np.arange(r.n) * 10 ** 7
    none = ['0.0'] * 9
    return '\n'.join(','.join([str(t // 10 ** 9), str(t % 10 ** 9), 'imu', *'0001', *none,
                               *map(repr, w), *none, *map(repr, a), *none])
                     for t, w, a in zip(stamp.tolist(), r.gyro.tolist(), r.accel.tolist())) + '\n'


def written(r, head, factor=1.0, between=',', t=None, text=None, behind=None):
    """Return a table of stamps, rates (by a factor) and accelerations."""
    t = np.round(START + np.arange(r.n) * 1e7).astype(np.int64) if t is None else t
    lines = [between.join([str(s), *([text] if text else []), *map(repr, w), *map(repr, a),
                           *([behind] if behind else [])])
             for s, w, a in zip(t.tolist(), (r.gyro * factor).tolist(), r.accel.tolist())]
    lines = [x.replace('.', ',') for x in lines] if between == ';' else lines
    return '\n'.join([head, *lines]) + '\n'


def two(r):
    """Return stamps in two columns, seconds and nanoseconds."""
    ns = START + np.arange(r.n) * 10 ** 7
    return np.array([f'{t // 10 ** 9},{t % 10 ** 9}' for t in ns])


def dated(r, between, zone):
    """Return stamps as ISO 8601 writes them; the second turns in the midst of them."""
    return np.array([f'2024-05-01{between}12:00:{k // 100:02d}.{k % 100:02d}0{zone}'
                     for k in range(50, 50 + r.n)])


AXES6 = 'gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z'
EUROC = ','.join(f'{s}_RS_S_{c} [{u}]' for s, u in (('w', 'rad s^-1'), ('a', 'm s^-2'))
                 for c in 'xyz')
NOETIC = ','.join(f'field.{s}.{c}' for s in ('angular_velocity', 'linear_acceleration')
                  for c in 'xyz')
TABLES = {
    'decimal comma': lambda r: written(r, f't,{AXES6}'.replace(',', ';'), between=';', t=r.t),
    'tabs': lambda r: written(r, f't,{AXES6}'.replace(',', '\t'), between='\t', t=r.t),
    'spaces': lambda r: written(r, '# ' + f't,{AXES6}'.replace(',', ' '), between=' ', t=r.t),
    'euroc': lambda r: written(r, f'#timestamp [ns],{EUROC}'),
    'rostopic echo -p': lambda r: written(r, '%time,field.header.frame_id,' + NOETIC, text='imu'),
    'ros2 topic echo --csv': echoed,
    'plotjuggler': lambda r: written(
        r, '__time,' + NOETIC.replace('field', '/imu').replace('.', '/'), t=START * 1e-9 + r.t
    ) + f'{START * 1e-9 + 0.005},,,,,,\n',
    'quoted': lambda r: written(r, '"time (ms)","device",' + ','.join(
        f'"{c}"' for c in ('gx', 'gy', 'gz', 'ax', 'ay', 'az')), t=1e3 * r.t, text='"a, b"'),
    'deg/s': lambda r: written(r, 'timestamp_us,' + ','.join(
        f'{s}{c}{u}' for s, u in (('Gyro', ' (dps)'), ('Acc', '')) for c in 'XYZ'),
        180 / np.pi, t=1e6 * r.t),
    'ulog2csv': lambda r: written(
        r, 'timestamp,' + ','.join(f'{s}[{k}]' for s in ('gyro_rad', 'accelerometer_m_s2')
                                   for k in range(3)) + ',accelerometer_timestamp_relative',
        t=np.round(1e6 * r.t).astype(int), behind='0'),
    'units in names': lambda r: written(
        r, 'TimeUS,gx_dps,gy_dps,gz_dps,acc_x_m_s2,acc_y_m_s2,acc_z_m_s2', 180 / np.pi,
        t=1e6 * r.t),
    'slashes': lambda r: written(
        r, '%time,' + NOETIC.replace('field', '/imu/data').replace('.', '/'), t=r.t),
    'sec and nanosec': lambda r: written(r, f'sec,nanosec,{AXES6}', t=two(r)),
    'header.stamp.sec': lambda r: written(
        r, 'header.stamp.sec,header.stamp.nanosec,header.frame_id,' + NOETIC, t=two(r),
        text='imu'),
    'dates': lambda r: written(r, f'time,{AXES6}', t=dated(r, 'T', 'Z')),
    'dates with a zone': lambda r: written(r, f't,{AXES6}', t=dated(r, ' ', '+02:00')),
    'dates, decimal comma': lambda r: written(
        r, f'when,{AXES6}'.replace(',', ';'), between=';', t=dated(r, 'T', '')),
}


@pytest.mark.parametrize(('names', 'fields'), [
    ('gyro_x [deg/h],gyro_y [deg/h],gyro_z [deg/h],accel_x [µg],accel_y [µg],accel_z [µg]', ''),
    ('Gyro X (°/hr),Gyro Y (°/hr),Gyro Z (°/hr),Acc X (ug),Acc Y (ug),Acc Z (ug)', ''),
    ('p,q,r,f1,f2,f3', 'gyro=p+q+r:1/3600deg/s,accel=f1+f2+f3:1/1000000g')])
def test_units_of_the_field_and_counts_in_a_table(names, fields, tmp_path):
    """A gyroscope of fibre optics writes deg/h; raw counts are told with the columns."""
    r = bad_input.still(5)
    scaled = replace(r, gyro=np.degrees(r.gyro) * 3600, accel=r.accel / 9.80665e-6)
    (tmp_path / 'x.csv').write_text(written(scaled, f't,{names}', t=r.t))
    record = open_record(tmp_path / 'x.csv', fields=fields or None)
    np.testing.assert_allclose(record.gyro, r.gyro, rtol=1e-9)
    np.testing.assert_allclose(record.accel, r.accel, rtol=1e-9)
    assert not any('not known' in w for w in record.warnings)
    (tmp_path / 'y.csv').write_text(written(r, f'GPS TOW [s],{AXES6}', t=r.t))
    with pytest.raises(InputError, match='column of the stamps with --fields'):
        open_record(tmp_path / 'y.csv')


@pytest.mark.parametrize('name', ['I', 'imu_id', 'instance'])
def test_of_two_sensors_in_one_table_one_is_chosen(name, tmp_path):
    """ArduPilot logs one line of each in turn: read as one sensor, nothing of it was right."""
    r = bad_input.still(5)
    other = replace(r, gyro=0.1 - r.gyro, accel=2 * r.accel)
    t = np.repeat(r.t, 2)
    both = replace(r, gyro=np.stack([r.gyro, other.gyro], 1).reshape(-1, 3), t=t,
                   accel=np.stack([r.accel, other.accel], 1).reshape(-1, 3))
    lines = written(both, f't,{AXES6},T'.replace('_', ' '), t=t, behind='41.5').splitlines()
    path = tmp_path / 'x.csv'
    path.write_text('\n'.join([f'{name},{lines[0]}'] + [
        f'{k % 2},{line}' for k, line in enumerate(lines[1:])]) + '\n')
    with pytest.raises(InputError, match=f'2 sensors, by its column {name}: 0, 1.*only={name}:0'):
        open_record(path)
    for k, one in enumerate((r, other)):
        record = open_record(path, fields=f'only={name}:{k},temperature=T')
        np.testing.assert_allclose(record.gyro, one.gyro, rtol=1e-12)
        np.testing.assert_allclose(record.accel, one.accel, rtol=1e-12)
        assert record.rate_hz == pytest.approx(100) and set(record.covariates) == {'temperature'}
    with pytest.raises(InputError, match='no line has 2 in its column'):
        open_record(path, fields=f'only={name}:2')
    with pytest.raises(UsageError, match='only=COLUMN:VALUE'):
        open_record(path, fields=f'only={name}')
    path.write_text('\n'.join([f'{name},{lines[0]}'] + [f'1,{line}' for line in lines[1::2]]))
    assert open_record(path).n == r.n       # of one sensor alone it says nothing


@pytest.mark.parametrize('name', TABLES)
def test_tables_of_others(name, tmp_path):
    """What other programs write is read as what it is, with its units."""
    r = bad_input.still(5)
    (tmp_path / 'x.csv').write_text(TABLES[name](r))
    record = open_record(tmp_path / 'x.csv')
    np.testing.assert_allclose(record.gyro, r.gyro, rtol=1e-12)
    np.testing.assert_allclose(record.accel, r.accel, rtol=1e-12)
    assert record.rate_hz == pytest.approx(100, rel=1e-5) and not record.covariates
    degrees = name in ('deg/s', 'units in names')
    assert bool(record.warnings) == degrees, record.warnings
    again = open_record(tmp_path / 'x.csv', gyro_unit='deg/s')      # what is said goes first
    np.testing.assert_allclose(again.gyro, r.gyro * (1 if degrees else np.pi / 180))
    assert topics(tmp_path / 'x.csv')[0].samples == r.n


def test_times_as_dates_are_those(tmp_path):
    """UTC where no zone is said."""
    for zone, ahead in (('Z', 0), ('', 0), ('+02:00', 7200), ('-0330', -12600)):
        (tmp_path / 'x.csv').write_text(
            written(bad_input.still(5), f't,{AXES6}', t=dated(bad_input.still(5), 'T', zone)))
        assert open_record(tmp_path / 'x.csv').start == 1714564800.5 - ahead


def test_px4s_tables_are_told_by_their_names(tmp_path):
    """Two have the same columns: the name of the file tells which; what is invalid is missing."""
    r = bad_input.still(5)
    head = 'timestamp,timestamp_sample,x,y,z,temperature'
    lines = [f'{k * 10000 + 7},{k * 10000},{x},{y},{z},31'
             for k, (x, y, z) in enumerate(r.accel)]
    for name in ('sensor_gyro', 'sensor_accel'):
        path = tmp_path / f'log_1_{name}_0.csv'
        path.write_text('\n'.join([head, *lines]) + '\n')
        record = open_record(path)
        assert record.rate_hz == pytest.approx(100) and record.start == 0
        assert (record.gyro is None, record.accel is None) == (
            name != 'sensor_gyro', name == 'sensor_gyro')
    path = path.rename(tmp_path / 'x.csv')
    with pytest.raises(InputError, match='no axis; its columns are timestamp, timestamp_sample'):
        open_record(path)
    lines = TABLES['ulog2csv'](r).splitlines()
    lines[9] = lines[9][:-1] + str(0x7fffffff)
    path.write_text('\n'.join(lines) + '\n')
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(open_record(path).accel[:, 0])), [8])
    fields = 'gyro=gyro_rad,accel=accelerometer_m_s2,stamp=timestamp:us'     # as of a bag
    np.testing.assert_array_equal(open_record(path, fields=fields).gyro, r.gyro)


@pytest.mark.parametrize('put, words, at', [
    ({500: '4.99,0.00', }, 'cut short; its last line was left out', [499]),
    ({500: '\0' * 40}, 'cut short; its last line was left out', [499]),
    ({300: '2.99,0.001,0.00x,1,1,1,1'},
     "line 301 is not 7 numbers and was left out: '2.99,", [299]),
    ({300: '0.001,1,1,1,1,1', 301: '# restart'},
     '2 of 500 lines are not 7 numbers and were left out; the first is line 301: ', [299, 300])])
def test_a_few_bad_lines_are_left_out(put, words, at, tmp_path):
    r, path = bad_input.still(5), tmp_path / 'x.csv'
    lines = written(r, f't,{AXES6}', t=r.t).splitlines()
    for k, line in put.items():
        lines[k] = line
    path.write_text('\n'.join(lines) + '\n')
    record = open_record(path)
    np.testing.assert_array_equal(record.gyro, np.delete(r.gyro, at, axis=0))
    (said,) = record.warnings
    assert words in said


def test_many_bad_lines_are_refused(tmp_path):
    r, path = bad_input.still(5), tmp_path / 'x.csv'
    lines = written(r, f't,{AXES6}', t=r.t).splitlines()
    for k in range(100, 106):
        lines[k] = 'x' + lines[k]
    path.write_text('\n'.join(lines) + '\n')
    with pytest.raises(InputError, match=r'line 101 is not 7 .*\(and 5 of the 499 others'):
        open_record(path)


def test_parts_of_a_second_are_named_as_the_seconds_are(tmp_path):
    r, path = bad_input.still(5), tmp_path / 'x.csv'
    path.write_text(written(r, f'time,exposure_s,delay_us,{AXES6}', text='1,20', t=r.t))
    assert open_record(path).rate_hz == pytest.approx(100)


def test_stamps_in_an_unknown_unit_are_answered_with_the_likely_one(tmp_path):
    r, path = bad_input.still(5), tmp_path / 'x.csv'
    path.write_text(written(r, f'timestamp,{AXES6}', t=1e6 * r.t))
    with pytest.raises(InputError, match='microseconds, 100 Hz, divide them by 1e6.*column t_us'):
        open_record(path)
    path.write_text(written(r, f't_us,{AXES6}', t=1e6 * r.t))
    assert open_record(path).rate_hz == pytest.approx(100)


def test_counts_of_a_tenth_of_a_millisecond(tmp_path):
    """SampleTimeFine, by its name or as a field; it begins anew at 2^32."""
    r, path = bad_input.still(5), tmp_path / 'x.csv'
    counts = (np.round(1e4 * r.t) + 2**32 - 20_000) % 2**32
    for name, fields in (('SampleTimeFine', None), ('tick', 'stamp=tick:0.1ms')):
        path.write_text(written(r, f'{name},{AXES6}', t=counts))
        record = open_record(path, fields=fields)
        assert record.rate_hz == pytest.approx(100)
        np.testing.assert_allclose(ordered(record).t, r.t, atol=1e-6)


@pytest.mark.parametrize('name', ['x.csv', 'x.txt', 'imu.log', 'x'])
@pytest.mark.parametrize(('before', 'ends', 'said'), [
    ('', '', False), ('\n\n', '', False), ('', '\t', False),
    ('LOG\nRate,100\n\nDATA_START\n', '\t', True)])
def test_a_table_by_what_is_in_it(name, before, ends, said, tmp_path):
    """Under any name, after lines that are none of it, and with a separator behind each line."""
    r, path = bad_input.still(5), tmp_path / name
    table = written(r, f't,{AXES6}'.replace(',', '\t'), between='\t', t=r.t)
    first, rest = table.split('\n', 1)
    path.write_text(before + first + '\n' + rest.replace('\n', ends + '\n'))
    record = open_record(path)
    np.testing.assert_array_equal(record.gyro, r.gyro)
    np.testing.assert_array_equal(record.accel, r.accel)
    begins = f'the table begins in line {before.count(chr(10)) + 1}; what is before was left out: '
    assert record.warnings == ((begins + "'LOG'",) if said else ())
    path.write_text(before.partition('LOG')[0] + rest.replace('\n', ends + '\n'))
    record = open_record(path, fields='accel=5+6+7,stamp=1')
    np.testing.assert_array_equal(record.accel, r.accel)
    with pytest.raises(UsageError, match='must be of the same format'):
        copy_bag(path, tmp_path / 'y.npz', lambda x: x)


@pytest.mark.parametrize('text', ['a: 1\nb: 2\n', 'three words here\n', '1,2\n3,4\n'])
def test_what_is_no_table_is_no_bag(text, tmp_path):
    (tmp_path / 'x.yaml').write_text(text)
    with pytest.raises(InputError, match='not a bag: give'):
        open_record(tmp_path / 'x.yaml')


def test_columns_that_no_name_tells_are_pointed_at(tmp_path, capsys):
    """An accelerometer under a name of its own is not silently left out."""
    r, path = bad_input.still(5), tmp_path / 'x.csv'
    path.write_text(written(r, 'time,wx,wy,wz,tx,ty,tz', t=r.t))
    record = open_record(path)
    assert record.accel is None
    (said,) = record.warnings
    assert 'known as accel by their names' in said and 'tx, ty, tz, name them with' in said
    assert main(['calibrate', str(path)]) == 1
    assert said in ' '.join(capsys.readouterr().err.split())
    assert not open_record(path, fields='gyro=wx+wy+wz,accel=tx+ty+tz').warnings


def test_stamps_in_two_columns_that_are_named(tmp_path):
    """Where two pairs have seconds and parts of them, --fields says which: SECONDS+PARTS."""
    r, path = bad_input.still(5), tmp_path / 'x.csv'
    path.write_text(written(r, f'sec_gps,nanosec_gps,sec_imu,nanosec_imu,{AXES6}',
                            t=np.array([f'0,0,{t}' for t in two(r)])))
    record = open_record(path, fields='stamp=sec_imu+nanosec_imu')
    np.testing.assert_allclose(record.t, r.t, atol=1e-6)
    assert record.start == pytest.approx(START * 1e-9)
    with pytest.raises(UsageError, match='unknown column of x.csv nanosec'):
        open_record(path, fields='stamp=sec_imu+nanosec')


def test_columns_that_are_named(tmp_path):
    """By --fields, with their units, or by their numbers where they have no names."""
    r, path = bad_input.still(5), tmp_path / 'x.csv'
    path.write_text(written(r, 'ticks,p,q,r,f1,f2,f3', 180 / np.pi, t=1e3 * r.t))
    record = open_record(path, fields='gyro=p+q+r:deg/s,accel=f1+f2+f3,stamp=ticks:ms')
    np.testing.assert_allclose(record.gyro, r.gyro, rtol=1e-12)
    assert record.rate_hz == pytest.approx(100, rel=1e-5)
    assert record.input_unit == {'gyro': 'deg/s'}
    with pytest.raises(InputError, match='no axis; its columns are ticks, p, q, r, f1.*--fields'):
        open_record(path)
    with pytest.raises(UsageError, match='unknown column of x.csv tick: did you mean ticks'):
        open_record(path, fields='gyro=p+q+r,stamp=tick')
    path.write_text(written(r, '', t=r.t).lstrip())
    record = open_record(path, fields='accel=5+6+7,stamp=1')
    np.testing.assert_array_equal(record.accel, r.accel)
    copy_bag(path, tmp_path / 'y.csv', lambda x: Changed(None, 2 * x.accel), fields='accel=5+6+7,'
             'stamp=1')
    assert np.all(open_record(tmp_path / 'y.csv').accel == r.accel)
    with pytest.raises(InputError, match='no line of names; its columns are 1, 2, 3, 4, 5, 6, 7'):
        open_record(path)
    path.write_text(written(r, '__time,' + ','.join(
        f'/{n}/angular_velocity/{c}' for n in 'ab' for c in 'xyz')))
    with pytest.raises(InputError, match='several columns may be gyro_x: /a/.*/x, /b/.*/x.*--fi'):
        open_record(path)
    for text, words in ((f't,{AXES6}\n', 'names and no samples'),
                        ('t,gx,gy\n0,1,2\n', 'gyro_x, gyro_y but not all three.*t, gx, gy')):
        path.write_text(text)
        with pytest.raises(InputError, match=words):
            open_record(path)


@pytest.mark.parametrize('suffix', ['.csv', '.npz'])
def test_copy_of_a_table(suffix, tmp_path):
    """A table keeps its columns and gets more."""
    source = write_bag(tmp_path / f'x{suffix}', bad_input.still(20))
    target = copy_bag(
        source,
        tmp_path / f'y{suffix}',
        lambda r: Changed(2 * r.gyro),
        new_topic='imu/data_calibrated',
    )
    record = open_record(target)
    np.testing.assert_array_equal(record.gyro, bad_input.still(20).gyro)
    if suffix == '.csv':
        np.testing.assert_array_equal(
            record.covariates['gyro_x_calibrated'], 2 * record.gyro[:, 0]
        )
    else:
        with np.load(target) as arrays:
            np.testing.assert_array_equal(arrays['gyro_calibrated'], 2 * record.gyro)


@pytest.mark.parametrize('name', [*STATIC, seldom('imu_tools_phidgets_imu_upside_down.bag')])
def test_copy_of_a_real_bag(shared_data, name, tmp_path):
    """Real bags of every compression are copied in kind."""
    source = shared_data / 'bags' / name
    target = copy_bag(source, tmp_path / name, lambda r: Changed(r.gyro + 1))
    record = open_record(source)
    np.testing.assert_array_equal(open_record(target, 'imu/data_filtered').gyro, record.gyro + 1)
    before, after = messages(source), messages(target)
    assert all(after[topic] == sent for topic, sent in before.items())


def test_failed_transform_leaves_nothing(tmp_path):
    """Where the transformation fails, nothing is left."""
    source = write_bag(tmp_path / 'x', bad_input.still(20))
    with pytest.raises(ZeroDivisionError):
        copy_bag(source, tmp_path / 'y', lambda r: 1 / 0)
    with pytest.raises(UsageError, match='shape'):
        copy_bag(source, tmp_path / 'y', lambda r: r.part(0, 10))
    assert [p.name for p in tmp_path.iterdir()] == ['x']


def test_writers_are_read_by_type():
    """Every type that is read here has the number of doubles that rosbags knows."""
    for type, count in DOUBLES.items():
        assert type in STORE.types and count > 0
    assert {McapWriter, Rosbag1Writer, SqliteWriter}
