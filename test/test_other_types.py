# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Bags as other drivers write them: PX4's messages, types of one's own, several IMUs at once.

They are written with rosbags, by their definitions, and read through the installed command.

"""

from __future__ import annotations

import json
from pathlib import Path
import sqlite3
import subprocess
import sys

import bad_input
import calibration_sessions as sessions
import numpy as np
from params import daily
import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin, Writer as Writer2
from rosbags.typesys import get_types_from_msg, get_typestore, Stores
import yaml

from imu_noise_tools.bag import imus, iter_raw, open_record
from imu_noise_tools.bag.decode import decode, IMU
from imu_noise_tools.bag.fields import Fields
from imu_noise_tools.bag.source import Bag
from imu_noise_tools.cli.main import main
from imu_noise_tools.core.errors import InputError, UsageError

START = 1_700_000_000 * 10 ** 9
N_GYRO, N_ACCEL = 2e-4, 1.5e-3
COMBINED, GYRO, ACCEL = (f'px4_msgs/msg/{n}' for n in (
    'SensorCombined', 'SensorGyro', 'SensorAccel'))
# as px4_msgs has them, constants and comments too
PX4 = {
    COMBINED: """# Sensor readings in SI-unit form.
uint64 timestamp                                # time since system start (microseconds)
int32 RELATIVE_TIMESTAMP_INVALID = 2147483647   # (0x7fffffff)
float32[3] gyro_rad                     # rad/s
uint32 gyro_integral_dt                 # microseconds
int32 accelerometer_timestamp_relative
float32[3] accelerometer_m_s2
uint32 accelerometer_integral_dt
uint8 CLIPPING_X = 1
uint8 accelerometer_clipping
uint8 gyro_clipping
uint8 accel_calibration_count
uint8 gyro_calibration_count
""",
    GYRO: """uint64 timestamp
uint64 timestamp_sample
uint32 device_id
float32 x
float32 y
float32 z
float32 temperature
uint32 error_count
uint8[3] clip_counter
uint8 samples
uint8 ORB_QUEUE_LENGTH = 8
""",
}
PX4[ACCEL] = PX4[GYRO]
# strings and sequences of any length before, between and behind what is wanted
OWN = """Tag[] tags
string name
uint8 kind
Raw raw
float64 temperature
uint32[] counts
string note
================================================================================
MSG: acme/Tag
string key
bool set
================================================================================
MSG: acme/Raw
uint16 status
float32[3] w
int16[6] force
builtin_interfaces/Time at
"""
KINDS = ('mcap', 'sqlite', 'ros1')


def run(*words, status=0):
    """Run a command; return its standard output, and what it said beside."""
    done = subprocess.run([sys.executable, '-m', 'imu_noise_tools.cli.main', *map(str, words)],
                          capture_output=True, text=True, timeout=600)
    assert done.returncode == status, (done.stdout, done.stderr)
    return done.stdout, done.stderr


class Driver:
    """Writes a bag of one kind."""

    def __init__(self, path: Path, kind: str, definitions=()):
        self.ros1 = kind == 'ros1'
        self.store = get_typestore(Stores.ROS1_NOETIC if self.ros1 else Stores.ROS2_JAZZY)
        for type, text in dict(definitions).items():
            self.store.register(get_types_from_msg(text, type))
        self.path = path.with_suffix({'mcap': '', 'sqlite': '', 'ros1': '.bag'}[kind])
        self.writer = Writer1(self.path) if self.ros1 else Writer2(
            self.path, version=9, storage_plugin=StoragePlugin.MCAP if kind == 'mcap'
            else StoragePlugin.SQLITE3)
        self.connections: dict = {}

    def __enter__(self):
        """Open the bag."""
        self.writer.open()
        return self

    def __exit__(self, *_):
        """Close it."""
        self.writer.close()

    def write(self, topic, type, receive, little=True, **values):
        """Write a message."""
        if topic not in self.connections:
            self.connections[topic] = self.writer.add_connection(
                topic, type, typestore=self.store)
        message = self.store.types[type](**values)
        raw = (self.store.serialize_ros1(message, type) if self.ros1
               else self.store.serialize_cdr(message, type, little_endian=little))
        self.writer.write(self.connections[topic], int(receive), raw)

    def struct(self, type, **values):
        """Return a part of a message."""
        return self.store.types[type](**values)


def combined(path, kind, seconds=120, rate=200, seed=1):
    """Write a PX4 bag; return its path, stamps (us), rates and accelerations."""
    rng = np.random.default_rng(seed)
    n = seconds * rate
    us = 7_000_000 + np.round(np.arange(n) * 1e6 / rate + rng.integers(-20, 20, n)).astype(int)
    gyro = (0.01 + N_GYRO * rate ** 0.5 * rng.standard_normal((n, 3))).astype('f4')
    accel = ([0.1, 0.2, -9.8] + N_ACCEL * rate ** 0.5 * rng.standard_normal((n, 3))).astype('f4')
    with Driver(path, kind, PX4) as bag:
        for k in range(n):
            bag.write('/fmu/out/sensor_combined', COMBINED, START + 1000 * us[k] + 3_000_000,
                      timestamp=int(us[k]), gyro_rad=gyro[k], gyro_integral_dt=5000,
                      accelerometer_timestamp_relative=0x7fffffff if k == 50 else -300,
                      accelerometer_m_s2=accel[k], accelerometer_integral_dt=5000,
                      accelerometer_clipping=0, gyro_clipping=0, accel_calibration_count=1,
                      gyro_calibration_count=1)
    return bag.path, us, gyro, accel


@pytest.mark.parametrize('kind', KINDS)
def test_sensor_combined_is_read_as_it_is(tmp_path, kind):
    """All samples to the bit, stamps in microseconds, what is invalid missing."""
    path, us, gyro, accel = combined(tmp_path / 'px4', kind, seconds=5)
    record = open_record(path)
    np.testing.assert_array_equal(record.gyro, gyro)
    accel[50] = np.nan
    np.testing.assert_array_equal(record.accel, accel)
    np.testing.assert_allclose(record.t, (us - us[0]) * 1e-6, atol=1e-12)
    assert record.start == pytest.approx(us[0] * 1e-6, abs=1e-9)
    assert record.topic == '/fmu/out/sensor_combined' and record.warnings == ()


@pytest.mark.thorough
def test_a_px4_bag_is_analysed(tmp_path):
    """As a process, with nothing said but the bag; a bag of Humble holds no definitions."""
    path, *_ = combined(tmp_path / 'px4', 'sqlite')
    (database,) = path.glob('*.db3')
    with sqlite3.connect(database) as db:
        db.execute('DROP TABLE message_definitions')
    db.close()
    run('analyse', path, '-o', tmp_path / 's', '--axes', 'gyro_x,gyro_z,accel_y')
    study = yaml.safe_load((tmp_path / 's' / 'study.yaml').read_text())
    assert study['source']['rate_hz'] == pytest.approx(200, rel=1e-4)
    for axis, n in (('gyro_x', N_GYRO), ('gyro_z', N_GYRO), ('accel_y', N_ACCEL)):
        found = study['targets'][axis]['effects']['white']['N']['value']
        assert found == pytest.approx(n, rel=0.03)
    out, _ = run('inspect', path, '--json')
    data = json.loads(out)
    assert data['topics'][0]['type'] == COMBINED and data['topics'][0]['role'] == 'imu'
    assert data['health']['samples'] == 24000


@pytest.fixture(scope='module')
def px4_pair(tmp_path_factory):
    """Return a bag with PX4's gyroscope and accelerometer, each at its own rate."""
    rng = np.random.default_rng(3)
    with Driver(tmp_path_factory.mktemp('px4') / 'pair', 'mcap', PX4) as bag:
        for topic, type, rate, sigma, mean in (
                ('sensor_gyro', GYRO, 250, N_GYRO, (0, 0, 0)),
                ('sensor_accel', ACCEL, 80, N_ACCEL, (0, 0, -9.8))):
            for k in range(100 * rate):
                us = 5_000_000 + round(k * 1e6 / rate)
                x, y, z = mean + sigma * rate ** 0.5 * rng.standard_normal(3)
                bag.write(f'/fmu/out/{topic}', type, START + 1000 * us, timestamp=us + 400,
                          timestamp_sample=us, device_id=1, x=x, y=y, z=z, temperature=40.0,
                          error_count=0, clip_counter=np.zeros(3, 'u1'), samples=8)
    return bag.path


@pytest.mark.thorough
def test_px4s_two_sensors_are_analysed_each_at_its_rate(px4_pair, tmp_path):
    out, said = run('analyse', px4_pair, '-o', tmp_path / 's', '--duration', '90%')
    study = yaml.safe_load((tmp_path / 's' / 'study.yaml').read_text())
    streams = study['source']['streams']
    assert streams['gyro']['rate_hz'] == pytest.approx(250, rel=1e-4)
    assert streams['accel']['rate_hz'] == pytest.approx(80, rel=1e-4)
    assert streams['accel']['topic'] == '/fmu/out/sensor_accel'
    assert streams['accel']['duration_s'] == pytest.approx(90, abs=0.1)
    for axis, n in (('gyro_x', N_GYRO), ('accel_z', N_ACCEL)):
        assert study['targets'][axis]['effects']['white']['N']['value'] == pytest.approx(
            n, rel=0.04)
    assert 'zero' not in said and 'interpolated' not in said


def test_the_temperature_that_px4s_messages_hold_is_a_covariate_of_each_sensor(px4_pair):
    apart = open_record(px4_pair, apart=True)
    np.testing.assert_array_equal(apart.covariates['temperature'], np.full(apart.n, 40.0))
    (accel,) = apart.beside
    np.testing.assert_array_equal(accel.covariates['temperature'], np.full(accel.n, 40.0))


def own(path, kind, n=3000, little=True):
    """Write a bag of a type of one's own; return its path, times (ns), rates, counts."""
    rng = np.random.default_rng(4)
    rates = rng.standard_normal((n, 3)).astype('f4')
    force = rng.integers(-2000, 2000, (n, 6)).astype('i2')
    at = START + np.arange(n) * 10_000_000 + rng.integers(0, 1000, n)
    with Driver(path, kind, {'acme/msg/Own': OWN}) as bag:
        for k in range(n):
            sec, nanosec = divmod(int(at[k]), 10 ** 9)
            raw = bag.struct(
                'acme/msg/Raw', status=k % 7, w=rates[k], force=force[k],
                at=bag.struct('builtin_interfaces/msg/Time', sec=sec, nanosec=nanosec))
            tags = [bag.struct('acme/msg/Tag', key='k' * (j + k % 3), set=True)
                    for j in range(k % 4)]
            bag.write('/own', 'acme/msg/Own', at[k] + 2_000_000, little, tags=tags,
                      name='sensor ' + 'é' * (k % 5), kind=1, raw=raw, temperature=20.0 + k,
                      counts=np.arange(k % 6, dtype='u4'), note='n' * (k % 11))
    return bag.path, at, rates, force


@pytest.mark.parametrize('little', [True, False])
@pytest.mark.parametrize('kind', KINDS)
def test_a_type_of_ones_own_is_read_by_its_fields(tmp_path, kind, little):
    """Nested, behind strings and sequences of changing length, in either order of bytes."""
    path, at, rates, force = own(tmp_path / 'own', kind, little=little)
    record = open_record(path, fields='gyro=raw.w:deg/s,accel=raw.force[3]+raw.force[4]'
                                      '+raw.force[5]:mg,stamp=raw.at')
    np.testing.assert_allclose(record.gyro, np.radians(rates.astype(float)), rtol=1e-12)
    np.testing.assert_allclose(record.accel, force[:, 3:] * 9.80665e-3, rtol=1e-12)
    np.testing.assert_allclose(record.t, (at - at[0]) * 1e-9, atol=1e-12)
    unstamped = open_record(path, fields='gyro=raw.w')
    assert unstamped.accel is None and any('receive times' in w for w in unstamped.warnings)
    warm = open_record(path, fields='gyro=raw.w,temperature=temperature:K')
    np.testing.assert_allclose(warm.covariates['temperature'], np.arange(3000) - 253.15)
    number = open_record(path, fields='gyro=raw.w,stamp=temperature:s')
    np.testing.assert_allclose(number.t, np.arange(3000), atol=1e-9)


@pytest.mark.parametrize('fields, words', [
    ('gyro=raw.v', 'did you mean raw.w'), ('gyro=raw.w,stamp=temperature', 'unit'),
    ('gyro=raw.force', 'not three numbers'), ('gyro=raw.w+raw.w', 'one field, or three'),
    ('speed=raw.w', 'unknown name in --fields speed'), ('gyro', 'invalid --fields'),
    ('gyro=raw.w:rpm', 'unknown unit of gyro rpm'),
    ('gyro=raw.w,temperature=raw.w', 'a number'), ('stamp=raw.at', 'invalid --fields'),
    ('gyro=raw.force[0]+raw.force[1]+raw.force[6]', 'raw.force[6]'),
    ('gyro=kind+temperature+name', 'unknown field')])
def test_fields_that_are_not_there_are_refused(tmp_path, capsys, fields, words):
    path, *_ = own(tmp_path / 'own', 'mcap', n=200)
    assert main(['inspect', str(path), '--fields', fields]) == 2
    said = capsys.readouterr().err
    assert words in said.splitlines()[-1], said


def test_a_bag_without_definitions_says_so(tmp_path):
    path, *_ = own(tmp_path / 'own', 'sqlite', n=200)
    (database,) = path.glob('*.db3')
    with sqlite3.connect(database) as db:
        db.execute('DROP TABLE message_definitions')
    db.close()
    _, said = run('inspect', path, '--fields', 'gyro=raw.w', status=1)
    assert 'no definition of acme/msg/Own' in said and 'ros2 bag convert' in said


def test_messages_that_are_not_as_defined_are_left_out(tmp_path):
    """Cut and foreign bytes are counted, never decoded."""
    path, at, rates, _ = own(tmp_path / 'own', 'sqlite', n=400)
    (database,) = path.glob('*.db3')
    with sqlite3.connect(database) as db:
        db.execute('UPDATE messages SET data = substr(data, 1, 30) WHERE id % 40 = 1')
        db.execute("UPDATE messages SET data = x'00010000' || zeroblob(900) WHERE id % 40 = 2")
    db.close()
    record = open_record(path, fields='gyro=raw.w,stamp=raw.at')
    assert record.n == 380
    assert any('20 message(s) could not be decoded' in w for w in record.warnings)
    kept = np.flatnonzero(~np.isin(np.arange(1, 401) % 40, (1, 2)))
    np.testing.assert_array_equal(record.gyro, rates[kept])


def test_damaged_bytes_are_left_out_or_read_as_rosbags_reads_them(tmp_path):
    """One byte of each message changed: lengths that lead astray included."""
    path, *_ = own(tmp_path / 'own', 'sqlite', n=1500)
    rng = np.random.default_rng(8)
    (database,) = path.glob('*.db3')
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg(OWN, 'acme/msg/Own'))
    truth = []
    with sqlite3.connect(database) as db:
        for key, data in db.execute('SELECT id, data FROM messages ORDER BY id').fetchall():
            raw = bytearray(data)
            raw[rng.integers(4, len(raw))] = rng.integers(256)
            db.execute('UPDATE messages SET data = ? WHERE id = ?', (bytes(raw), key))
            try:
                truth.append(store.deserialize_cdr(bytes(raw), 'acme/msg/Own').raw)
            except Exception:       # whatever its generated code runs into
                truth.append(None)
    db.close()
    with Bag(path) as bag:
        bag.read_as(Fields.of('gyro=raw.w,accel=raw.force[0]+raw.force[4]+raw.force[5]'))
        found = [decode(batch) for batch in bag.batches(['/own'], [IMU])]
    readable = np.concatenate([f.readable for f in found])
    values = np.concatenate([f.values for f in found])
    assert 0.5 < readable.mean() < 1 and len(readable) == 1500
    both = [k for k in np.flatnonzero(readable) if truth[k] is not None]
    assert len(both) > 0.8 * readable.sum()     # it refuses text that is not UTF-8, too
    rank = np.cumsum(readable) - 1
    np.testing.assert_array_equal(values[rank[both], 13:16], [truth[k].w for k in both])
    np.testing.assert_array_equal(
        values[rank[both], 25:28], [truth[k].force[[0, 4, 5]] for k in both])


def test_a_recorded_custom_type(shared_data):
    """A real driver's type: its fields are proposed, and with them it is what rosbags reads."""
    path = shared_data / 'bags' / 'custom_imu_type_mcap'
    _, said = run('inspect', path, status=1)
    fields = 'gyro=angular_velocity,accel=linear_acceleration'
    assert f'--fields {fields}' in said and 'custom type' in said
    run('inspect', path, '--fields', fields)
    record = open_record(path, fields=fields)
    with AnyReader([path]) as reader:
        some = [c for c in reader.connections if c.topic == '/imutopic']
        truth = [reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages(some)]
    np.testing.assert_array_equal(record.gyro, [
        [m.angular_velocity.x, m.angular_velocity.y, m.angular_velocity.z] for m in truth])
    np.testing.assert_array_equal(record.accel, [
        [m.linear_acceleration.x, m.linear_acceleration.y, m.linear_acceleration.z]
        for m in truth])
    stamps = [m.header.stamp.sec * 10 ** 9 + m.header.stamp.nanosec for m in truth]
    np.testing.assert_allclose(record.t, (np.array(stamps) - stamps[0]) * 1e-9, atol=1e-9)
    assert record.frame_id == truth[0].header.frame_id


# -- a part of a record, and copies

@pytest.mark.parametrize('kind', daily(KINDS))
def test_a_part_of_a_px4_bag_is_filtered(tmp_path, kind):
    """The copy has Imu messages for the part alone; what was there is there still."""
    path, us, gyro, _ = combined(tmp_path / 'px4', kind, seconds=40)
    copy = tmp_path / ('out.bag' if kind == 'ros1' else 'out')
    run('filter', path, '-o', copy, '--start', '25%', '--duration', '20')
    record = open_record(copy, '/imu/data_filtered')
    inside = (us >= us[0] + 10e6 - 1e3) & (us <= us[0] + 30e6 + 1e3)
    assert record.n == pytest.approx(inside.sum(), abs=2)
    assert record.start == pytest.approx(us[inside][0] * 1e-6, abs=0.006)
    same = np.isin(np.round(us * 1e-6 - record.start, 6), np.round(record.t, 6))
    assert same.sum() == record.n
    assert np.std(record.gyro) < 0.5 * np.std(gyro)
    np.testing.assert_array_equal(record.accel[1000:1100], open_record(path).accel[same][
        1000:1100])
    np.testing.assert_array_equal(open_record(copy, '/fmu/out/sensor_combined').gyro, gyro)
    store = get_typestore(Stores.ROS1_NOETIC if kind == 'ros1' else Stores.ROS2_JAZZY)
    with AnyReader([copy], default_typestore=store) as reader:
        (new,) = [c for c in reader.connections if c.topic == '/imu/data_filtered']
        assert new.msgtype == 'sensor_msgs/msg/Imu' and new.msgcount == record.n
    study = yaml.safe_load((Path(f'{copy}.study') / 'study.yaml').read_text())
    assert study['source']['samples'] == record.n


@pytest.mark.thorough
def test_a_part_of_a_table_is_filtered(tmp_path):
    rng = np.random.default_rng(2)
    np.savez(tmp_path / 'a.npz', gyro=0.01 * rng.standard_normal((4000, 3)), rate_hz=100.0)
    run('filter', tmp_path / 'a.npz', '-o', tmp_path / 'b.npz', '--start', '10',
        '--duration', '50%')
    with np.load(tmp_path / 'b.npz') as data:
        there = np.isfinite(data['gyro_filtered']).all(axis=1)
    assert there[1001:2999].all() and there.sum() == pytest.approx(2000, abs=1)
    _, said = run('filter', tmp_path / 'a.npz', '-o', tmp_path / 'c.npz', '--start', '50',
                  status=2)
    assert '--start' in said and not (tmp_path / 'c.npz').exists()
    _, said = run('filter', tmp_path / 'a.npz', '-o', tmp_path / 'c.npz', '--fields', 'gyro=x',
                  status=2)
    assert '--fields' in said


@pytest.mark.thorough
def test_a_part_of_a_session_is_calibrated(tmp_path):
    """Six faces, then the IMU is carried away: without the end of it the faces are level."""
    rng = np.random.default_rng(5)
    device = sessions.Device(np.array([[1.02, 0.004, 0], [0, 0.99, 0.003], [0, 0, 1.01]]),
                             np.array([0.1, -0.2, 0.05]), noise=2e-3)
    names, ups = sessions.faces()
    t, gyro, accel, _ = sessions.stream(device, ups, rng)
    wild = accel[-1] + 3 * rng.standard_normal((2000, 3))
    bad = np.concatenate([np.full((1000, 3), [9.0, 9.0, 0.0]) + 2e-3 * rng.standard_normal(
        (1000, 3)), wild])
    np.savez(tmp_path / 'a.npz', accel=np.concatenate([accel, bad]),
             gyro=np.concatenate([gyro, np.zeros((3000, 3))]), rate_hz=100.0)
    run('calibrate', tmp_path / 'a.npz', '-o', tmp_path / 'c', '--duration', f'{t[-1]:.2f}')
    found = yaml.safe_load((tmp_path / 'c' / 'calibration.yaml').read_text())
    found = found.get('accel', found)
    assert len(found['poses']) == 6
    np.testing.assert_allclose(np.diag(found['S']), [1.02, 0.99, 1.01], atol=2e-3)
    np.testing.assert_allclose(found['bias'], [0.1, -0.2, 0.05], atol=2e-2)
    _, said = run('calibrate', tmp_path / 'a.npz', '-o', tmp_path / 'd', '--start', '1e4',
                  status=2)
    assert 'past the end' in said


# -- every IMU of a bag

@pytest.fixture(scope='module')
def robot(tmp_path_factory):
    """Return a bag with an Imu, a camera's pair, a second Imu that moves, one of a type."""
    rng = np.random.default_rng(6)
    with Driver(tmp_path_factory.mktemp('robot') / 'robot', 'mcap', PX4) as bag:
        def imu(topic, rate, gyro, accel, moves=False, seconds=70):
            for k in range(seconds * rate):
                stamp = START + round(k * 1e9 / rate)
                sec, nanosec = divmod(stamp, 10 ** 9)
                w = gyro * rate ** 0.5 * rng.standard_normal(3) + (
                    np.sin(k / 30) if moves else 0)
                f = accel * rate ** 0.5 * rng.standard_normal(3) + (
                    [0, 0, 9.8] if accel else [0, 0, 0])

                def vector(x):
                    return bag.struct('geometry_msgs/msg/Vector3', x=x[0], y=x[1], z=x[2])
                nine = np.zeros(9)
                bag.write(topic, 'sensor_msgs/msg/Imu', stamp, header=bag.struct(
                    'std_msgs/msg/Header', frame_id=topic[1:], stamp=bag.struct(
                        'builtin_interfaces/msg/Time', sec=sec, nanosec=nanosec)),
                    orientation=bag.struct('geometry_msgs/msg/Quaternion', x=0., y=0., z=0.,
                                           w=1.),
                    orientation_covariance=nine, angular_velocity=vector(w),
                    angular_velocity_covariance=nine, linear_acceleration=vector(f),
                    linear_acceleration_covariance=nine)
        imu('/imu/data_raw', 100, N_GYRO, N_ACCEL)
        imu('/camera/accel/sample', 63, 0, N_ACCEL)
        imu('/camera/gyro/sample', 100, 3 * N_GYRO, 0)
        imu('/arm/imu', 50, N_GYRO, N_ACCEL, moves=True)
    return bag.path


@pytest.mark.thorough
def test_every_imu_of_a_bag_has_a_study(robot, tmp_path):
    """With --topic all, each in its own folder; what cannot be analysed is said."""
    assert sorted(imus(robot)) == [
        '/arm/imu', '/camera/gyro/sample,/camera/accel/sample', '/imu/data_raw']
    _, said = run('analyse', robot, '-o', tmp_path / 's', '--topic', 'all')
    assert '/arm/imu is not analysed' in said and 'moves' in said
    assert sorted(p.name for p in (tmp_path / 's').iterdir()) == [
        'camera_gyro_sample', 'imu_data_raw', 'studies.yaml']
    listed = yaml.safe_load((tmp_path / 's' / 'studies.yaml').read_text())
    assert listed['studies']['imu_data_raw'] == '/imu/data_raw' and '/arm/imu' in listed['refused']
    for name, n, rate in (
            ('camera_gyro_sample', 3 * N_GYRO, 63), ('imu_data_raw', N_GYRO, 100)):
        study = yaml.safe_load((tmp_path / 's' / name / 'study.yaml').read_text())
        white = study['targets']['gyro_y']['effects']['white']['N']['value']
        assert white == pytest.approx(n, rel=0.06)
        streams = study['source'].get('streams', {'accel': study['source']})
        assert streams['accel']['rate_hz'] == pytest.approx(rate, rel=1e-3)
        run('compare', tmp_path / 's' / name)
    alone = tmp_path / 'alone'
    run('analyse', robot, '-o', alone, '--topic', '/imu/data_raw')
    one, other = ((folder / 'allan.csv').read_text() for folder in (
        alone, tmp_path / 's' / 'imu_data_raw'))
    assert one == other
    _, said = run('analyse', robot, '-o', tmp_path / 's', '--topic', 'all', status=1)
    assert '--force' in said


@pytest.mark.thorough
def test_every_imu_of_a_bag_is_inspected(robot):
    out, _ = run('inspect', robot, '--topic', 'all', '--json')
    found = {r['topic']: r['health']['samples'] for r in json.loads(out)['records']}
    assert found == {'/imu/data_raw': 7000, '/camera/gyro/sample': 7000, '/arm/imu': 3500}
    out, _ = run('inspect', robot, '--topic', 'all')
    assert out.count('can be analysed') == 4        # the camera's sensors have a clock each
    _, said = run('filter', robot, '-o', '/nowhere/x', '--topic', 'all', status=2)
    assert 'analyse and inspect' in said


@pytest.mark.thorough
def test_all_of_one_is_that_one(px4_pair, tmp_path):
    out, _ = run('analyse', px4_pair, '-o', tmp_path / 's', '--topic', 'all', '--json')
    assert list(json.loads(out)['studies']) == ['fmu_out_sensor_gyro']


def test_px4_messages_are_replayed_as_imu_messages(tmp_path):
    """What the nodes get of them."""
    path, us, gyro, _ = combined(tmp_path / 'px4', 'mcap', seconds=2)
    store = get_typestore(Stores.ROS2_JAZZY)
    found = list(iter_raw(path))
    assert len(found) == len(us)
    for k in (0, 137, len(us) - 1):
        m = store.deserialize_cdr(found[k][1], 'sensor_msgs/msg/Imu')
        assert m.header.stamp.sec * 10 ** 6 + m.header.stamp.nanosec // 1000 == us[k]
        assert np.float32(m.angular_velocity.y) == gyro[k, 1]


def test_a_definition_of_another_layout_wins(tmp_path):
    """A bag says itself how its messages are laid out; one that fits no message is refused."""
    text = PX4[GYRO].replace('uint64 timestamp_sample\n', '').replace(
        'uint32 device_id', 'uint32 device_id\nfloat64 more')
    with Driver(tmp_path / 'old', 'mcap', {GYRO: text}) as bag:
        for k in range(300):
            bag.write('/fmu/sensor_gyro', GYRO, START + k * 10 ** 7, timestamp=10_000 * k + 5,
                      device_id=1, more=0.5, x=1.0 + k, y=2.0, z=3.0, temperature=40.0,
                      error_count=0, clip_counter=np.zeros(3, 'u1'), samples=8)
    record = open_record(bag.path)
    np.testing.assert_array_equal(record.gyro[:, 0], 1.0 + np.arange(300))
    assert record.rate_hz == pytest.approx(100)
    with Driver(tmp_path / 'lost', 'sqlite', {GYRO: text}) as bag:
        for k in range(300):
            bag.write('/fmu/sensor_gyro', GYRO, START + k * 10 ** 7, timestamp=10_000 * k + 5,
                      device_id=1, more=0.5, x=1.0 + k, y=2.0, z=3.0, temperature=40.0,
                      error_count=0, clip_counter=np.zeros(3, 'u1'), samples=8)
    (database,) = bag.path.glob('*.db3')
    with sqlite3.connect(database) as db:
        db.execute('DROP TABLE message_definitions')
    db.close()
    with pytest.raises(InputError, match='has the layout of'):
        open_record(bag.path)
    with pytest.raises(UsageError, match='unknown field'):
        open_record(bag.path, fields='gyro=gyro_rad')


def test_several_imus_are_listed_where_none_is_named(tmp_path):
    """To list the topics is what inspect is for; it says which commands need one."""
    path = bad_input.make_one('two_imu_topics', tmp_path).path
    out, _ = run('inspect', path)
    assert 'topic ' in out and out.count('can be analysed') == 2
    assert 'disturbed' in out       # ten seconds at rest, looked at
    assert ' '.join(out.split()).count('--topic /a/imu or --topic /b/imu') == 1
    for command in ('analyse', 'calibrate', 'apply', 'filter'):
        assert command in out
    out, _ = run('inspect', path, '--json')
    found = json.loads(out)
    assert [t['name'] for t in found['topics']] == ['/a/imu', '/b/imu']
    assert [r['topic'] for r in found['records']] == ['/a/imu', '/b/imu']
    out, _ = run('inspect', path, '--topic', '/b/imu', '--json')
    assert json.loads(out)['topic'] == '/b/imu'
