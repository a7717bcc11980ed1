# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the nodes are made of: the live curve, the stream, parameters, messages."""

from __future__ import annotations

import numpy as np
import pytest

from imu_noise_tools.core.allan import curve, overlapping_variance
from imu_noise_tools.core.errors import InputError, UsageError
from imu_noise_tools.core.record import AXES
from imu_noise_tools.nodes.live import LiveCurve, Stream
from imu_noise_tools.nodes.saving import check, Folder
from imu_noise_tools.nodes.streams import Streams
from imu_noise_tools.nodes.times import ARRIVALS, Times


def signal(n, columns=3, seed=1):
    """Return white noise, a random walk and an offset, (n, columns)."""
    rng = np.random.default_rng(seed)
    walk = np.cumsum(rng.standard_normal((n, columns)), axis=0) * 1e-3
    return 9.8 + rng.standard_normal((n, columns)) + walk


def fed(y, seed=2, largest=700):
    """Return a live curve that was given y in pieces of random length."""
    rng, live, k = np.random.default_rng(seed), LiveCurve(y.shape[1]), 0
    while k < len(y):
        piece = int(rng.integers(1, largest))
        live.add(y[k:k + piece])
        k += piece
    return live


def test_live_curve_is_the_definition_with_a_stride():
    y = signal(20_000)
    tau, dev, _, _ = fed(y).curve(0.01)
    prefix = np.concatenate([np.zeros((1, 3)), np.cumsum(y - y[0], axis=0)])
    for t, d in zip(tau, dev):
        m = round(t / 0.01)
        x = prefix[::max(1, m // 16)]
        lag = m // max(1, m // 16)
        second = x[2 * lag:] - 2 * x[lag:-lag] + x[:-2 * lag]
        assert d == pytest.approx(np.sqrt(np.mean(second ** 2, axis=0) / 2) / m, rel=1e-9)


def test_live_curve_is_close_to_every_pair_and_exact_at_short_times():
    y = signal(60_000)
    tau, dev, lo, hi = fed(y).curve(1.0)
    m = np.round(tau).astype(int)
    assert m[-1] <= len(y) // 3 and len(m) > 50
    full = np.sqrt(np.stack([overlapping_variance(y[:, k], m) for k in range(3)], axis=1))
    assert dev[m <= 16] == pytest.approx(full[m <= 16], rel=1e-12)
    assert dev == pytest.approx(full, rel=0.05)
    assert np.all(lo < dev) and np.all(dev < hi)


def test_live_curve_does_not_depend_on_the_pieces():
    y = signal(9_000)
    whole = LiveCurve(3)
    whole.add(y)
    assert np.allclose(fed(y).curve(1.0)[1], whole.curve(1.0)[1], rtol=1e-12)


def test_live_curve_takes_the_last_value_for_what_is_not_finite():
    y = signal(2_000)
    holes, filled = y.copy(), y.copy()
    holes[500:503, 1] = np.nan
    filled[500:503, 1] = y[499, 1]
    assert np.allclose(fed(holes, largest=10).curve(1.0)[1], fed(filled).curve(1.0)[1], rtol=1e-9)


def test_memory_of_the_live_curve_does_not_grow():
    live = LiveCurve(6)
    piece = signal(5_000, 6)

    def held():
        return sum(s.tail.nbytes for s in live._sizes)
    for _ in range(40):
        live.add(piece)
    before = held()
    for _ in range(40):
        live.add(piece)
    assert held() <= 1.1 * before < 1e6


def test_stream_holds_the_last_hours_and_says_so():
    stream = Stream(hours=100 / 3600)                   # 100 s at 100 Hz
    y = signal(30_000, 6)
    for k in range(0, 30_000, 500):
        stamps = np.arange(k, k + 500) * 10_000_000
        stream.add(stamps, y[k:k + 500, :3], y[k:k + 500, 3:])
        assert stream.whole == (k + 500 <= 10_000)
    stamps, gyro, accel = stream.samples()
    assert stream.received == 30_000 and 10_000 <= len(stamps) <= 10_500
    assert stamps[-1] == 29_999 * 10_000_000 and np.array_equal(gyro, y[-len(gyro):, :3])
    assert np.array_equal(accel, y[-len(accel):, 3:])
    tau, dev, _, _ = stream.curve()
    reference = curve(y[:, 0], 0.01)
    assert tau[-1] > 80 and dev[0, 0] == pytest.approx(reference.dev[0], rel=1e-9)


def test_a_record_that_begins_again_replaces_what_was_there():
    """Wherever in a batch it begins; a stamp that only goes back a little is not a beginning."""
    y, stamps = signal(1000, 6), 10 ** 9 + np.arange(1000) * 10_000_000
    again = np.concatenate([stamps[900:], stamps[:400]])
    stream = Stream(hours=1.0)
    assert stream.add(stamps[:900], y[:900, :3], y[:900, 3:]) == ''
    assert 'begins again' in stream.add(again, y[:500, :3], y[:500, 3:])
    assert stream.received == 400 and np.array_equal(stream.samples()[0], stamps[:400])
    assert np.array_equal(stream.samples()[1], y[100:500, :3])
    assert stream.add(stamps[[390, 391]], y[:2, :3], y[:2, 3:]) == '' and stream.received == 402
    assert 'begins again' in stream.add(stamps[:10], y[:10, :3], y[:10, 3:], first=0)
    assert '10 samples are missing' in stream.add(
        stamps[20:30], y[:10, :3], y[:10, 3:], first=20)
    assert (stream.received, stream.missed) == (20, 10)


def test_of_a_stream_of_two_sources_nothing_is_missing():
    """Gaps of 3 and 7 ms in turn are none of 10 ms; who publishes is asked where one shows."""
    y, both = signal(400, 6), np.sort(np.concatenate(
        [np.arange(200) * 10_000_000, np.arange(200) * 10_000_000 + 3_000_000]))
    asked = []
    for several, missed in ((False, 99), (True, 0)):
        stream = Stream(hours=1.0)
        for k in range(0, 400, 100):
            said = stream.add(both[k:k + 100], y[k:k + 100, :3], y[k:k + 100, 3:],
                              several=lambda: asked.append(1) or several)
            assert bool(said) == (k > 0 and not several)
        assert (stream.missed > missed / 2) == (missed > 0) and stream.mixed == several
        assert not stream.complete
    assert len(asked) == 3 + 1          # once it is known it is asked no more


def test_sensors_with_topics_of_their_own_have_streams_of_their_own():
    streams = Streams(hours=1.0)
    y = signal(400, 6)
    slow, fast = np.arange(100) * 20_000_000, np.arange(300) * 5_000_000 + 1
    assert not streams.complete
    streams.add(fast, y[:300, :3], np.zeros((300, 3)), 0, 'gyro')
    streams.expected = 400
    assert not streams.complete and streams.received == 300
    streams.add(slow, y[:100, :3], y[:100, 3:], 0, 'accel')
    assert streams.complete and streams.received == streams.held == 400
    record = streams.record('/w,/f', 'bag')
    (accel,) = record.beside
    assert (record.topic, accel.topic) == ('/w', '/f')
    assert record.accel is None and np.array_equal(record.gyro, y[:300, :3])
    assert accel.gyro is None and np.array_equal(accel.accel, y[:100, 3:])
    assert record.rate_hz == pytest.approx(200) and accel.rate_hz == pytest.approx(50)
    curves = {axis: (dt, c[1][0, k]) for axis, k, dt, c in streams.curves()}
    assert set(curves) == set(AXES) and curves['gyro_x'][0] == pytest.approx(0.005)
    assert curves['accel_z'][0] == pytest.approx(0.02)
    assert curves['accel_z'][1] == pytest.approx(curve(y[:100, 5], 0.02).dev[0])
    assert {k: sorted(v) for k, v in streams.arrays().items()} == {
        'gyro': ['gyro', 't'], 'accel': ['accel', 't']}
    assert 'for both' in streams.add(fast, y[:300, :3], y[:300, 3:], 0)
    assert streams.received == 300 and streams.record('/imu').beside == ()


def test_what_is_no_number_is_counted_but_not_a_sensor_that_is_not_there():
    streams, y = Streams(hours=1.0), signal(200, 6)
    y[20:30, 1], y[25:40, 5] = np.nan, np.inf
    t = np.arange(200) * 5_000_000
    streams.add(t, y[:, :3], y[:, 3:])
    assert streams.not_finite == 20 and streams.received == 200
    streams.add(t, y[:, :3], np.full((200, 3), np.nan))     # again, and no accelerometer
    assert streams.not_finite == 10
    streams.clear()
    assert streams.not_finite == 0


def test_stamps_that_stand_are_said_once_and_how_it_is_now():
    """All zero, or one from some sample on; a buffer that is read at once is neither."""
    rng, step = np.random.default_rng(4), 5_000_000
    moving = 10 ** 18 + step * np.arange(200)
    for before in (0, 200):
        stream = Stream(1.0)
        said, stamps = [], np.concatenate([
            moving[:before], np.full(150, moving[-1] if before else 0)])
        for part in np.split(stamps, range(50, len(stamps), 50)):
            y = rng.standard_normal((len(part), 3))
            said.append(stream.add(part, y, y))
        assert stream.standing and [x for x in said if x] == [
            'the stamps do not advance; stamp the messages in the driver']
        y = rng.standard_normal((2, 3))
        stream.add(moving[-1] + step * np.arange(1, 3), y, y)
        assert not stream.standing
    stream = Stream(1.0)
    y = rng.standard_normal((640, 3))
    assert not stream.add(np.repeat(moving[:10], 64), y, y) and not stream.standing


def test_a_stream_of_stamps_that_stand_is_one_of_its_arrivals():
    """They come late and several at once; where only some stamps stand, they are what there is."""
    rng, n = np.random.default_rng(5), 4000
    late = np.cumsum(rng.standard_exponential(n)) % 1       # of 5 ms
    arrivals = np.maximum.accumulate((5e6 * (np.arange(n) + late)).astype(np.int64))
    y = rng.standard_normal((n, 3))
    stream, said = Stream(1.0), []
    for part in np.split(np.arange(n), range(50, n, 50)):
        came = np.full(len(part), arrivals[part[-1]]) if part[0] == 500 else arrivals[part]
        said.append(stream.add(np.zeros(len(part), np.int64), y[part], y[part], None, came))
    assert [x for x in said if x] == [ARRIVALS] and stream.standing == ARRIVALS
    assert stream.rate_hz == pytest.approx(200, rel=1e-3) and not stream.missed
    record = stream.record('imu/data_raw')
    assert record.rate_hz == pytest.approx(200, rel=1e-3) and record.n == n
    assert record.warnings == (f'{ARRIVALS}: they jitter',)
    stream = Stream(1.0)
    stream.add(np.arange(n) * 10_000_000, y, y, None, arrivals)
    assert stream.rate_hz == pytest.approx(100) and not stream.record('imu').warnings


def test_times_are_the_stamps_or_the_arrivals_where_they_stand():
    ms, start = 1_000_000, 10 ** 18
    times = Times()
    assert [times.of(start + k * 10 * ms, 7 * k, k) for k in range(5)] == [
        k * 10 * ms for k in range(5)]
    # stuck from here on; 16 messages over 0.1 s show it, and the arrivals go on from there
    got = [times.of(start + 40 * ms, k * 10 * ms, 5 + k) for k in range(20)]
    assert got[:15] == [40 * ms] * 15 and times.standing
    assert set(np.diff(got[15:])) == {10 * ms}
    # they move again, years on: no gap
    assert times.of(9 * start, 210 * ms, 0) == got[-1] + 20 * ms and not times.standing
    assert times.of(9 * start + 10 * ms, 0, 0) == got[-1] + 30 * ms
    # neither a buffer that is read at once, nor one message again and again
    for step, rate in ((ms // 10, 1), (50 * ms, 0)):
        times = Times()
        assert not any(times.of(start, k * step, k * rate) for k in range(40))
        assert not times.standing


def test_where_nothing_can_be_written_the_parameter_is_named(tmp_path):
    for try_it in (check, lambda wanted: Folder().save(wanted, {'x': 'x'})):
        with pytest.raises(InputError, match='set the parameter output_dir') as refused:
            try_it('/proc/x')
        assert '-o' not in str(refused.value)
    with pytest.raises(InputError, match='names no folder'):
        check('')
    check(str(tmp_path / 'a' / 'b'))
    assert not list(tmp_path.iterdir())


def test_a_parameter_reads_what_people_write():
    pytest.importorskip('rclpy')
    from imu_noise_tools.nodes.params import Setting
    speed = Setting('speed', 1.0, 'how fast', unit='x', low=0.0, high=100.0)
    assert speed.read(10) == 10.0 and isinstance(speed.read(10), float)
    names = Setting('effects', ['white'], 'the model')
    assert names.read('white, flicker') == ['white', 'flicker'] == names.read(['white', 'flicker'])
    described = speed.descriptor()
    assert described.description == 'how fast [x]'
    assert described.floating_point_range[0].to_value == 100.0


def test_a_parameter_says_why_it_refuses():
    pytest.importorskip('rclpy')
    from imu_noise_tools.nodes.params import Setting

    def refuse(value):
        raise UsageError(f'no {value}', 'take another')
    cases = [(Setting('a', 1.0, '', low=0, high=2), 3.0, 'between 0 and 2'),
             (Setting('a', 1.0, '', low=0, high=2), float('nan'), 'between'),
             (Setting('a', 1.0, ''), 'fast', 'takes a number'),
             (Setting('a', ['b'], ''), 3, 'takes a list of names'),
             (Setting('a', 'b', '', choices=('b', 'c')), 'd', 'one of b, c'),
             (Setting('a', 'b', '', check=refuse), 'd', 'no d: take another')]
    for setting, value, reason in cases:
        with pytest.raises(ValueError, match=reason):
            setting.read(value)


def imu(stamp_ns, gyro, accel, frame='imu_link'):
    """Return a sensor_msgs/Imu with something in every field."""
    from sensor_msgs.msg import Imu
    m = Imu()
    m.header.stamp.sec, m.header.stamp.nanosec = divmod(stamp_ns, 10 ** 9)
    m.header.frame_id = frame
    m.orientation.x, m.orientation.w = 0.5, 0.25
    m.orientation_covariance = np.arange(9.0)
    m.angular_velocity.x, m.angular_velocity.y, m.angular_velocity.z = gyro
    m.linear_acceleration.x, m.linear_acceleration.y, m.linear_acceleration.z = accel
    m.linear_acceleration_covariance = np.arange(10.0, 19.0)
    return m


@pytest.mark.parametrize('frame', ['', 'i', 'imu_link', 'a/long/name/of/a/frame', 'ä'])
def test_serialised_messages_are_read_and_changed_in_place(frame):
    pytest.importorskip('rclpy')
    from rclpy.serialization import deserialize_message, serialize_message
    from sensor_msgs.msg import Imu

    from imu_noise_tools.nodes import messages
    sent = [imu(1_700_000_000_123_456_789 + k, (0.1 * k, 2.0, 3.0), (4.0, 5.0, 9.0 + k), frame)
            for k in range(5)]
    raw = [serialize_message(m) for m in sent]
    read = messages.samples(raw)
    assert read.stamps.tolist() == [1_700_000_000_123_456_789 + k for k in range(5)]
    assert read.gyro[:, 0].tolist() == [0.1 * k for k in range(5)]
    assert read.accel[3].tolist() == [4.0, 5.0, 12.0] and read.refused == 0
    if frame.isascii():
        assert read.frame_id == frame
    stamp, rate, there = messages.rate_of(raw[2])
    assert (stamp, rate, there) == (1_700_000_000_123_456_791, (0.2, 2.0, 3.0), True)
    written = messages.with_rate(raw[2], (7.0, 8.0, 9.0), (0.1, 0.2, 0.3))
    changed = deserialize_message(written, Imu)
    wanted = imu(1_700_000_000_123_456_791, (7.0, 8.0, 9.0), (4.0, 5.0, 11.0), frame)
    wanted.angular_velocity_covariance = np.diag([0.1, 0.2, 0.3]).ravel()
    assert changed == wanted
    moved = deserialize_message(messages.with_stamp(raw[0], 5_000_000_007), Imu)
    assert (moved.header.stamp.sec, moved.header.stamp.nanosec) == (5, 7)
    assert moved.orientation == sent[0].orientation
    accel = deserialize_message(messages.with_vectors(raw[0], accel=(1.0, 2.0, 3.0)), Imu)
    assert accel.linear_acceleration.y == 2.0
    assert accel.angular_velocity == sent[0].angular_velocity


def test_what_is_no_message_is_counted():
    pytest.importorskip('rclpy')
    from rclpy.serialization import serialize_message

    from imu_noise_tools.nodes import messages
    good = serialize_message(imu(7, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0)))
    read = messages.samples([good, b'\0\1\0\0short', good])
    assert len(read) == 2 and read.refused == 1


def test_blocks_and_curves_survive_the_way():
    pytest.importorskip('rclpy')
    from imu_noise_tools.nodes import messages
    stamps = 1_700_000_000_000_000_000 + np.arange(50) * 5_000_000
    y = signal(50, 6)
    first, sensor, read = messages.samples_of_block(
        messages.block(4096, stamps, y[:, :3], y[:, 3:]))
    assert (first, sensor) == (4096, '')
    own = messages.block(7, stamps, np.full((50, 3), np.nan), y[:, 3:], 'accel')
    first, sensor, alone = messages.samples_of_block(own)
    assert (first, sensor) == (7, 'accel') and np.array_equal(alone.accel, y[:, 3:])
    own.layout.dim[0].label = 'first:7:magnetic'
    with pytest.raises(ValueError, match='not a block'):
        messages.samples_of_block(own)
    assert np.abs(read.stamps - stamps).max() <= 128            # a double holds no more
    assert np.array_equal(read.gyro, y[:, :3]) and np.array_equal(read.accel, y[:, 3:])
    tau, dev = np.array([1.0, 10.0]), np.array([0.1, 0.01])
    message = messages.curve(tau, dev, np.ones(2), np.ones(2))
    _, columns, rows = messages.rows_of(message)
    assert columns == 'tau adev lo hi model log10_tau log10_adev'.split()
    assert rows[1, 5:] == pytest.approx([1.0, -2.0]) and np.isnan(rows[:, 4]).all()
    message.layout.dim[0].size = 3
    with pytest.raises(ValueError, match='14 numbers for 3 x 7'):
        messages.rows_of(message)


def test_images_and_numbers():
    pytest.importorskip('rclpy')
    from rclpy.clock import Clock

    from imu_noise_tools.nodes import messages

    class Node:
        get_clock = Clock
    pixels = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)[:, ::-1]        # not contiguous
    image = messages.image(Node(), pixels)
    assert (image.height, image.width, image.step, image.encoding) == (2, 4, 12, 'rgb8')
    assert bytes(image.data) == np.ascontiguousarray(pixels).tobytes()
    status = messages.status('a', 'b', {'N [rad/s]': np.float64(2e-5), 'n': np.int64(3),
                                        'whole': np.True_, 'none': None})
    assert [(v.key, v.value) for v in status.values] == [
        ('N [rad/s]', '2e-05'), ('n', '3'), ('whole', 'true')]
