# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A calibration from records, in a person's session, by command, of real recordings."""

from __future__ import annotations

import json
from pathlib import Path
import re

import calibration_sessions as sim
import numpy as np
import pytest
from scipy.signal import lfilter
import yaml

from imu_noise_tools import calibration as core, store
from imu_noise_tools.calibration.session import pooled_errors
from imu_noise_tools.cli.main import main
from imu_noise_tools.core.errors import FitError, InputError, UsageError
from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.core.units import G0
from imu_noise_tools.tasks import calibration as tasks

DEG = np.pi / 180


def record(t, gyro, accel, temperature=None, path='session'):
    """Return a record of a stream."""
    covariates = {} if temperature is None else {'temperature': temperature}
    return ImuRecord(gyro, accel, t, (len(t) - 1) / (t[-1] - t[0]), covariates=covariates,
                     path=path)


def six_faces(rng, device, faces=sim.AXES, **options):
    """Return the stream of these faces, tilted by 1 deg."""
    ups = sim.tilted([sim.AXES[f] for f in faces], 1 * DEG, rng)
    return sim.stream(device, ups, rng, **options)


def write(path, t, gyro, accel, **more):
    """Write an npz record."""
    np.savez(path, t=t, gyro=gyro, accel=accel, **more)
    return path


def play(session, stream, at):
    """Feed a stream and capture at these times; return what each capture said or refused."""
    t, gyro, accel, temperature = stream
    said, at = [], list(at)
    for k in range(len(t)):
        session.feed(t[k], gyro[k], accel[k], None if temperature is None else temperature[k])
        while at and t[k] >= at[0]:
            at.pop(0)
            try:
                said.append(str(session.capture()))
            except InputError as error:
                said.append(str(error))
    return said


def test_record_with_handling():
    """Six faces with handling between them: found, in order, and the device comes out."""
    rng = np.random.default_rng(0)
    device = sim.Device.drawn(rng, noise=0.02)
    done = tasks.calibrate_records([record(*six_faces(rng, device))])
    c = done.calibration
    assert c.poses.names == tuple(sim.AXES) and done.calibration.problem.method == 'faces'
    np.testing.assert_array_less(np.abs(c.bias - device.bias), 4 * c.std[1])
    np.testing.assert_array_less(np.abs(c.S - device.scale), 4 * c.std[0])
    assert done.study.source['gravity_from'].startswith('standard gravity')


def test_knock_is_left_out_and_said():
    """A knock within a face: said with its time, the face is there, and its mean is not spoilt."""
    rng = np.random.default_rng(1)
    device = sim.Device.drawn(rng, noise=0.02)
    stream = six_faces(rng, device, hold_s=6.0, knock=(2, 5.0))
    done = tasks.calibrate_records([record(*stream)])
    assert any('a knock at 1' in n and 'left out' in n for n in done.calibration.notes)
    assert done.calibration.poses.names == tuple(sim.AXES)
    np.testing.assert_array_less(np.abs(done.calibration.bias - device.bias),
                                 4 * done.calibration.std[1])


@pytest.mark.parametrize('hold_s', [1.0, 1.3, 2.5])
def test_short_holds_are_poses(hold_s):
    """Faces held for a second are found, each once; what is shorter still is listed."""
    rng = np.random.default_rng(30)
    device = sim.Device.drawn(rng, noise=0.02)
    r = record(*six_faces(rng, device, hold_s=hold_s))
    poses, notes = core.positions(r, sim.G)
    assert [core.nearest_face(o)[0] for o in poses.outputs.T] == list(sim.AXES)
    assert not any('knock' in n for n in notes)
    short = record(*six_faces(rng, device, hold_s=0.7))
    with pytest.raises(InputError, match='too short to count: .*--still 0.[56] takes'):
        core.positions(short, sim.G)
    assert core.positions(short, sim.G, 0.5)[0].n == 6


def test_a_refusal_of_too_few_poses_says_which_rests_were_too_short():
    """Of six faces two are held: the other four are counted, and what takes them takes them."""
    rng = np.random.default_rng(32)
    device = sim.Device.drawn(rng, noise=0.02)
    whole = record(*six_faces(rng, device, hold_s=[3.0, 3.0, 0.7, 0.7, 0.7, 0.7]))
    with pytest.raises(InputError, match='4 rests under 0.8 s are too short to count: ') as said:
        tasks.calibrate_records([whole])
    assert str(said.value).startswith('2 of 6 faces seen')
    assert said.value.remedy.startswith('hold +y, -y, +z, -z up, still')
    value, = re.findall(r'--still (\d\.\d) takes them all', str(said.value))
    assert tasks.calibrate_records([whole], seconds=float(value)).calibration.poses.n == 6
    some = record(*six_faces(rng, device, hold_s=0.5))
    with pytest.raises(InputError, match='6 rests under 0.8 s') as said:
        core.positions(some, sim.G)
    (value, count), = re.findall(r'--still (\d\.\d) takes (\d) of them', str(said.value))
    assert core.positions(some, sim.G, float(value))[0].n == int(count)
    with pytest.raises(InputError, match='--still takes none under 0.5 s'):
        core.positions(record(*six_faces(rng, device, ['+x', '-x'], hold_s=0.44)), sim.G)


def test_one_face_put_down_twice_is_two_poses():
    """Turned over and put back as it was: two placements; a knock between parts one of them."""
    rng = np.random.default_rng(31)
    device = sim.Device.drawn(rng, noise=0.02)
    t, gyro, accel, _ = six_faces(rng, device, ['+z', '+x', '+z', '-z'])
    n = len(t)
    hold, move = 500, 150
    # cut the rest at +x out: up, half over, and back again
    keep = np.r_[0:hold + move, hold + move + hold:n]
    t = np.arange(len(keep)) / 100.0
    poses, notes = core.positions(record(t, gyro[keep], accel[keep]), sim.G)
    faces = [core.nearest_face(o)[0] for o in poses.outputs.T]
    assert faces == ['+z', '+z', '-z'] and not any('knock' in n for n in notes)


@pytest.mark.thorough
def test_a_coarse_output_widens_the_intervals():
    """With a step ten times the noise means are no better than the step: intervals still hold."""
    rng = np.random.default_rng(32)
    hits = []
    for _ in range(8):
        device = sim.Device.drawn(rng, noise=0.005)
        t, gyro, accel, _ = sim.stream(device, sim.tilted(sim.faces()[1], 0.02, rng), rng)
        c = tasks.calibrate_records([record(t, gyro, 0.05 * np.round(accel / 0.05))]).calibration
        assert 0.9 * 0.05 / np.sqrt(12) < np.median(c.poses.std) < 1.2 * 0.05 / np.sqrt(12)
        hits += [np.abs(c.bias - device.bias) < 1.96 * c.std[1],
                 np.abs(np.diag(c.S - device.scale)) < 1.96 * np.diag(c.std[0])]
    assert np.mean(hits) > 0.85


def test_a_clipped_pose_is_refused():
    """An axis at the end of its range in a pose: refused, with the axis and what to do."""
    rng = np.random.default_rng(33)
    t, gyro, accel, _ = six_faces(rng, sim.Device.drawn(rng, noise=0.05))
    accel[:, 1] = np.minimum(accel[:, 1], 9.4)
    with pytest.raises(InputError, match='accel_y is saturated at 9.4'):
        tasks.calibrate_records([record(t, gyro, accel)])


def test_a_turned_case_is_said():
    """S close to a rotation of 18 deg is called that."""
    rng = np.random.default_rng(34)
    turn = np.array([sim.turned(e, (0, 0, 1), 18 * DEG) for e in np.eye(3)])
    device = sim.Device(scale=turn, noise=0.02)
    done = tasks.calibrate_records([record(*six_faces(rng, device))])
    assert any('turned by 1' in w and 'S is that rotation' in w
               for w in done.calibration.warnings)


def test_six_poses_that_are_no_faces_are_fitted():
    """A case turned so far that no pose is a face: scale factors and biases by magnitudes."""
    rng = np.random.default_rng(35)
    device = sim.Device.drawn(rng, noise=0.02)
    ups = np.array([sim.turned(np.array(e, float), (0.6, 0.7, -0.39), 40 * DEG)
                    for e in sim.AXES.values()])
    c = tasks.calibrate_records([record(*sim.stream(device, ups, rng))]).calibration
    assert not set(c.poses.names) & set(sim.AXES)
    np.testing.assert_array_less(np.abs(c.bias - device.bias), 4 * c.std[1])


@pytest.mark.parametrize('what, low, high', [('tremor', 0.55, 1.1), ('wander', 0.9, 1.25)])
def test_a_pose_held_by_hand_is_as_sure_as_it_is_said(what, low, high):
    """A tremor swings out in a pose, and what wanders does not: the error over the stated one."""
    rng = np.random.default_rng(36)
    t, pull = np.arange(500) / 100, []
    for _ in range(8):
        windows = []
        for _ in range(20):
            hand = np.empty((500, 3))
            for k in range(3):
                swing = np.sin(2 * np.pi * rng.uniform(5, 12) * t + rng.uniform(0, 7))
                wander = lfilter([0.03], [1, -np.exp(-1 / 30)], rng.normal(size=800))[300:]
                hand[:, k] = 0.04 * swing if what == 'tremor' else 0.3 * wander
            windows.append(hand + rng.normal(0, 0.005, (500, 3)))
        pull.append(np.mean(windows, axis=1).T / pooled_errors(windows, 100.0))
    assert low < np.sqrt(np.mean(np.square(pull))) < high


def test_one_bag_a_face_and_a_sign_upside_down():
    """Six records named after their faces; where all signs are turned, the name tells."""
    rng = np.random.default_rng(2)
    device = sim.Device.drawn(rng, noise=0.02)
    parts = {f: six_faces(rng, device, [f]) for f in sim.AXES}
    good = [record(*s, path=f'bench_{f}.npz') for f, s in parts.items()]
    assert tasks.calibrate_records(good).calibration.poses.names == tuple(sim.AXES)
    turned = [record(s[0], s[1], -s[2], path=f'bench_{f}.npz') for f, s in parts.items()]
    with pytest.raises(InputError, match=r'by its name \+x is up, but -x reads \+g: upside down'):
        tasks.calibrate_records(turned)


@pytest.mark.parametrize('name, face', [('a_-z.mcap', '-z'), ('x_up', '+x'), ('minus_y.npz', '-y'),
                                        ('imu_xn', '-x'),
                                        ('box', None), ('recz', None)])
def test_face_in_a_name(name, face):
    """What names of bags say."""
    assert tasks.face_in_name(name) == face


def test_refusals_of_records():
    """Moving all the time, counts, a missing face, contradictions: each its clear answer."""
    rng = np.random.default_rng(3)
    device = sim.Device.drawn(rng, noise=0.02)
    t, gyro, accel, _ = six_faces(rng, device)
    with pytest.raises(InputError, match='missing -z'):
        tasks.calibrate_records([record(*six_faces(rng, device, ['+x', '-x', '+y', '-y', '+z']))])
    with pytest.raises(InputError, match='counts'):
        tasks.calibrate_records([record(t, gyro, accel * 1671)])
    with pytest.raises(InputError, match='g, not m/s'):
        tasks.calibrate_records([record(t, gyro, accel / 9.80665)])
    with pytest.raises(InputError, match='moves all the time'):
        swing = np.column_stack([np.sin(1.7 * t), np.cos(1.3 * t), np.sin(2.1 * t + 1)])
        tasks.calibrate_records([record(t, swing, 6 * swing)])
    for wrong in ({'sensor': 'accel', 'turn_deg': 360}, {'gravity': 9.8, 'latitude': 3},
                  {'rate_deg_s': 10, 'turn_deg': 360}, {'tilt_deg': 50}):
        with pytest.raises(UsageError):
            tasks.calibrate_records([record(t, gyro, accel)], **wrong)


def test_hand_turns():
    """A full turn about each axis both ways: scale to some 1e-4; a wrong angle is refused."""
    rng = np.random.default_rng(4)
    device = sim.Device.drawn(rng, 'gyro', noise=2e-3)
    r = record(*sim.hand_turns(device, rng))
    c = tasks.calibrate_records([r], turn_deg=360, tilt_deg=0.2).calibration
    assert set(c.poses.names) == {'rest', *(f'turn {f}' for f in sim.AXES)}
    np.testing.assert_array_less(np.abs(np.diag(c.S - device.scale)), 4 * np.diag(c.std[0]))
    np.testing.assert_array_less(np.abs(c.bias - device.bias), 4 * c.std[1])
    assert any('Earth' in n and 'stays in the bias' in n for n in c.notes)
    with pytest.raises((InputError, FitError)) as refusal:
        tasks.calibrate_records([r], turn_deg=180)
    assert '--turn' in refusal.value.remedy


def test_rate_table_and_reference_columns():
    """Turns at a stated rate, and the same with the true rate recorded along, agree."""
    rng = np.random.default_rng(5)
    device = sim.Device.drawn(rng, 'gyro', noise=2e-3)
    rates, force = [], []
    for axis in np.eye(3):
        for way in (1, -1, 0):
            rates += [way * 30 * DEG * axis] * 500
            force += [sim.G * axis] * 500
    rates, force = np.array(rates), np.array(force)
    t = np.arange(len(rates)) / 100.0
    r = record(t, device.output(rates, rng), force + rng.normal(0, 0.01, force.shape))
    by_rate = tasks.calibrate_records([r], rate_deg_s=30, tilt_deg=0.05).calibration
    known = ImuRecord(r.gyro, r.accel, t, 100.0,
                      covariates=dict(zip(('reference_x', 'reference_y', 'reference_z'), rates.T)))
    by_column = tasks.calibrate_records([known], sensor='gyro', tilt_deg=0.05).calibration
    for c in (by_rate, by_column):
        np.testing.assert_array_less(np.abs(np.diag(c.S - device.scale)), 4 * np.diag(c.std[0]))
    np.testing.assert_allclose(by_rate.S, by_column.S, atol=2e-3)


def test_earth_rate_of_a_known_latitude():
    """With a latitude the vertical part goes into the inputs: the bias moves by it."""
    rng = np.random.default_rng(6)
    device = sim.Device.drawn(rng, 'gyro', noise=1e-3)
    r = record(*sim.hand_turns(device, rng))
    plain, known = (tasks.calibrate_records([r], turn_deg=360, latitude=x).calibration for x
                    in (None, 90))
    assert np.abs(known.bias - plain.bias).max() == pytest.approx(7.292e-5 / 3, rel=0.3)
    assert any('15.04 deg/h' in n for n in known.notes)


def test_session_guides_through_the_faces():
    """What a capture says, and what is refused while moving or before all is there."""
    rng = np.random.default_rng(7)
    device = sim.Device.drawn(rng, noise=0.02)
    session = tasks.Session()
    with pytest.raises(InputError, match='samples so far'):
        session.capture()
    # 5 s of rest and 1.5 s of handling, again and again
    stream = six_faces(rng, device)
    said = play(session, stream, [3, 5.8, 9.5, 10.5, 16, 22.5, 29])
    assert said[0] == 'held: +x; 1 of 6 done; left: -x, +y, -y, +z, -z'
    assert said[1].startswith('moving: not still for the last 2 s')
    assert 'not moved since the last capture' in said[3] and '2 of 6 done' in said[3]
    assert said[-1] == 'held: +z; 5 of 6 done; left: -z'
    for early in (session.solve, session.diagnose,
                  lambda: session.apply(np.zeros(3), np.zeros(3))):
        with pytest.raises(InputError):
            early()
    t, gyro, accel, _ = stream
    last = t > 32.5
    for row in zip(t[last], gyro[last], accel[last]):
        session.feed(*row)
    assert str(session.capture()).endswith('6 of 6 done; none left: solve')
    c = session.solve()
    np.testing.assert_array_less(np.abs(c.bias - device.bias), 4 * c.std[1])
    x = sim.G * np.array([0.6, 0.0, 0.8])
    gyro, corrected = session.apply(np.ones(3), device.output(x[None])[0])
    np.testing.assert_allclose(corrected, x, atol=0.25)
    assert gyro.tolist() == [1, 1, 1] and session.diagnose().verdict == 'complete'


def test_session_expects_a_face():
    """The person says which face is up: another one is refused, the opposite as upside down."""
    rng = np.random.default_rng(8)
    session = core.Session()
    play(session, six_faces(rng, sim.Device(noise=0.02), ['+z']), [])
    with pytest.raises(InputError, match='upside down'):
        session.capture('-z')
    with pytest.raises(InputError, match=r'\+x should be up, but \+z is'):
        session.capture('+x')
    assert session.capture('+z').name == '+z'


def test_session_of_turns():
    """The gyroscope: rest, turn, rest, capture."""
    rng = np.random.default_rng(9)
    device = sim.Device.drawn(rng, 'gyro', noise=2e-3)
    session = tasks.Session('gyro', turn=360 * DEG, tilt=0.2 * DEG)
    said = play(session, (*sim.hand_turns(device, rng), None), np.arange(2.8, 46, 3.0))
    assert any('moving' in s for s in said) and 'turn +x; 1 of 6 done' in ' '.join(said)
    assert said[-1].endswith('none left: solve')
    c = session.solve()
    np.testing.assert_array_less(np.abs(np.diag(c.S - device.scale)), 4 * np.diag(c.std[0]))


def test_session_saves_what_is_solved_and_nothing_else(tmp_path):
    """
    Save is refused before solve.

    What was saved corrects in another session, also after an effect was added.

    """
    rng = np.random.default_rng(10)
    device = sim.Device.drawn(rng, noise=0.02)
    session, file = tasks.Session(), tmp_path / 'calibration.yaml'
    stream = six_faces(rng, device)
    play(session, stream, [3, 9.5, 16, 22.5, 29])
    for act in (session.solve, lambda: session.save(file)):
        with pytest.raises(InputError):
            act()
    assert not file.exists()
    last = stream[0] > 32.5
    for row in zip(*(x[last] for x in stream[:3])):
        session.feed(*row)
    session.capture()
    session.solve()
    study = session.study
    study.add(['quadratic'])
    session.adopt(study)
    session.save(file)
    other = tasks.Session()
    other.load(file)
    raw = np.array([1.0, 2.0, 9.0])
    np.testing.assert_allclose(other.apply(raw, raw)[1], session.apply(raw, raw)[1], rtol=1e-9)
    with pytest.raises(InputError, match='calibrates the accel'):
        tasks.Session('gyro', turn=1.0).load(file)
    session.reset()
    with pytest.raises(InputError):
        session.save(file)


@pytest.fixture
def faces_npz(tmp_path):
    """Return a record of six faces as a file, and its device."""
    rng = np.random.default_rng(11)
    device = sim.Device.drawn(rng, noise=0.02)
    return write(tmp_path / 'faces.npz', *six_faces(rng, device)[:3]), device


def test_commands(faces_npz, tmp_path, capsys):
    """Calibrate, the loop on its study, and apply: files, exit status, numbers."""
    bag, device = faces_npz
    out = tmp_path / 'out'
    assert main(['calibrate', str(bag), '-o', str(out)]) == 0
    assert {p.name for p in out.iterdir()} >= {'calibration.yaml', 'calibration.png',
                                               'report.html', 'study.yaml', 'evidence.npz'}
    data = yaml.safe_load((out / 'calibration.yaml').read_text())
    assert data['sensor'] == 'accel' and data['method'] == 'faces' and data['unit'] == 'm/s^2'
    np.testing.assert_allclose(np.array(data['G']), np.column_stack([data['S'], data['bias']]))
    assert np.shape(data['std']['S']) == (3, 3) and len(data['poses']) == 6
    assert data['faces'] == {'seen': {f: 1 for f in sim.AXES}, 'missing': []}
    assert data['diagnosis']['verdict'] == 'complete'
    assert data['formula'] == 'x = S^-1 (raw - bias)'
    assert main(['calibrate', str(bag), '-o', str(out)]) == 1       # a study in the way
    capsys.readouterr()
    for command in (['compare', str(out)], ['diagnose', str(out)], ['history', str(out)],
                    ['add', str(out), 'quadratic']):
        assert main(command) == 0, command
    capsys.readouterr()
    again = yaml.safe_load((out / 'calibration.yaml').read_text())      # all files go along
    assert list(again['effects']) == ['quadratic'] and 'effects(x)' in again['formula']
    assert main(['calibrate', str(bag), '-o', str(out), '--force', '--json']) == 0
    assert json.loads(capsys.readouterr().out)['S'] == data['S']
    assert main(['apply', str(bag), '-o', str(tmp_path / 'better.npz'), '--calibration',
                 str(out)]) == 0
    with np.load(tmp_path / 'better.npz') as new, np.load(bag) as old:
        name, = [k for k in new.files if k.startswith('accel_')]
        np.testing.assert_allclose(new[name],
                                   np.linalg.solve(data['S'], (old['accel'] - data['bias']).T).T,
                                   rtol=1e-6)
        np.testing.assert_array_equal(new['accel'], old['accel'])


def test_apply_says_what_it_assumes_and_what_is_missing(faces_npz, tmp_path, capsys):
    """A line each; none where the temperature is recorded and the calibration complete."""
    bag, _ = faces_npz
    heated = {'sensor': 'accel', 'S': np.eye(3).tolist(), 'bias': [0, 0, 0],
              'reference_temperature': 31.5, 'effects': {'temperature': {
                  'effect': 'temperature', 't_x': 0.01, 't_y': 0.0, 't_z': 0.0}}}
    missing = {'sensor': 'gyro', 'S': np.eye(3).tolist(), 'bias': [0, 0, 0],
               'diagnosis': {'verdict': 'missing', 'advice': 'add quadratic: turn faster'}}
    file = tmp_path / 'calibration.yaml'
    file.write_text(yaml.safe_dump({'accel': heated, 'gyro': missing}))
    command = ['apply', str(bag), '-o', str(tmp_path / 'better.npz'), '--force', '--calibration',
               str(file)]
    assert main([*command, '--json']) == 0
    out, err = capsys.readouterr()
    said = json.loads(out)['warnings']
    assert err.splitlines() == [f'warning: {w}' for w in said] and len(said) == 2
    assert 'gyro: ' in said[0] and '(missing): add quadratic: turn faster' in said[0]
    assert 'accel: ' in said[1] and '31.50 degC is assumed' in said[1]
    with np.load(bag) as old:
        warm = {**old, 'temperature': np.full(len(old['t']), 41.5)}
    np.savez(bag, **warm)
    missing['diagnosis']['verdict'] = 'complete'
    file.write_text(yaml.safe_dump({'accel': heated, 'gyro': missing}))
    assert main(command) == 0 and capsys.readouterr().err == ''
    with np.load(tmp_path / 'better.npz') as new:
        off = warm['accel'] - new[next(k for k in new.files if k.startswith('accel_'))]
    np.testing.assert_allclose(off, np.tile([0.1, 0, 0], (len(off), 1)), atol=1e-9)


@pytest.mark.parametrize('bent, command', [(0, 'apply BAG'), (2e-3, 'calibrate BAG MORE')])
def test_what_to_run_after_a_calibration(undrawn, tmp_path, capsys, bent, command):
    """Six faces cannot tell i^2 from |i|, by which the values differ: more poses decide that."""
    rng = np.random.default_rng(1)
    _, ups = sim.faces(2)
    device = sim.Device(quadratic=(bent, -bent, bent), noise=2e-3)
    t, gyro, accel, _ = sim.stream(device, ups, rng)
    bag = write(tmp_path / 'faces.npz', t, gyro, accel)
    out = tmp_path / 'out'
    assert main(['calibrate', str(bag), '-o', str(out), '--sensor', 'accel']) == 0
    said = capsys.readouterr().out
    assert ('undecidable: ' in said) == (bent > 0)
    assert said.splitlines()[-1].startswith(f'next: imu_noise {command}')
    assert main(['diagnose', str(out)]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == said.splitlines()[-1]
    if not bent:
        return
    more = sim.stream(device, sim.spread_directions(12, rng), rng)
    write(tmp_path / 'more.npz', *more[:3])
    assert main(['calibrate', str(bag), str(tmp_path / 'more.npz'), '-o', str(out), '--sensor',
                 'accel', '--force']) == 0
    assert 'missing: add quadratic' in capsys.readouterr().out


def stated(path, **said):
    """Write a calibration with a bias of (0.1, 0, 0) m/s^2 that says so of its input."""
    path.write_text(yaml.safe_dump({'sensor': 'accel', 'S': np.eye(3).tolist(),
                                    'bias': [0.1, 0, 0], **said}))
    return path


@pytest.mark.parametrize('sent, said, options, read, warned', [
    ('g', 'g', (), 'g', r'read in g \(as the calibration\'s recording was\)'),
    ('g', None, (), 'm/s^2', 'if it is in g, use --accel-unit g'),
    ('g', 'm/s^2', ('--accel-unit', 'g'), 'g', r'read in g \(as told\)'),
    ('m/s^2', 'g', ('--accel-unit', 'm/s^2'), 'm/s^2', None),
    ('m/s^2', 'mg', (), 'mg', None),
    ('m/s^2', 'g', (), 'g', 'already, not in g: use --accel-unit'),
    ('m/s^2', None, (), 'm/s^2', None)])
def test_apply_corrects_in_si_what_is_sent_in_another_unit(
        tmp_path, capsys, sent, said, options, read, warned):
    """The unit is the one told, else that of the calibration's recording; doubts are said."""
    rng, factor = np.random.default_rng(31), {'m/s^2': 1.0, 'g': G0, 'mg': 1e-3 * G0}
    accel = (0.01 * rng.standard_normal((3000, 3)) + [0, 0, G0]) / factor[sent]
    bag = write(tmp_path / 'rest.npz', np.arange(3000) / 100, 0 * accel + 1e-4, accel)
    file = stated(tmp_path / 'c.yaml', **({} if said is None else {'input_unit': {'accel': said}}))
    assert main(['apply', str(bag), '-o', str(tmp_path / 'new.npz'), '--calibration', str(file),
                 *options]) == 0
    heard = capsys.readouterr().err
    assert re.search(warned, heard) if warned else read != 'm/s^2' or heard == ''
    with np.load(tmp_path / 'new.npz') as new:
        np.testing.assert_allclose(new['accel_calibrated'], accel * factor[read] - [0.1, 0, 0])


def test_apply_says_that_poses_in_si_were_read_as_raw_counts(faces_npz, tmp_path, capsys):
    """So small, all of them seem at rest, and the mean of six faces is next to nothing."""
    file = stated(tmp_path / 'c.yaml', input_unit={'accel': '1/16384g', 'gyro': '1/131deg/s'})
    assert main(['apply', str(faces_npz[0]), '-o', str(tmp_path / 'new.npz'),
                 '--calibration', str(file)]) == 0
    (said,) = [x for x in capsys.readouterr().err.splitlines() if 'wrong unit' in x]
    assert said.endswith('it is in m/s^2 already, not in 1/16384g: use --accel-unit m/s^2 (and '
                         '--gyro-unit rad/s, if that is not in 1/131deg/s either)')


@pytest.mark.thorough
def test_a_calibration_keeps_the_unit_of_what_it_was_made_from(faces_npz, tmp_path, capsys):
    """Its numbers are the same as of a recording in SI, and a loop's step keeps the unit."""
    bag, _ = faces_npz
    with np.load(bag) as old:
        data = dict(old)
    data['accel'] = data['accel'] / G0
    np.savez(tmp_path / 'in_g.npz', **data)
    out = tmp_path / 'out'
    whole = tasks.calibrate(bag, tmp_path / 'si')
    done = tasks.calibrate(tmp_path / 'in_g.npz', out, accel_unit='g')
    np.testing.assert_allclose(done.calibration.G, whole.calibration.G, atol=1e-9)
    assert main(['add', str(out), 'quadratic']) == 0 and capsys.readouterr()
    session = tasks.Session()
    for folder, unit in ((out, {'accel': 'g'}), (tmp_path / 'si', {})):
        session.load(folder)
        assert session.input_unit == unit


def test_a_session_takes_samples_in_the_unit_of_the_file_that_it_loads(tmp_path):
    """What it captures then is SI too; a reset forgets the unit, and an unknown is refused."""
    session = tasks.Session()
    session.load(stated(tmp_path / 'c.yaml', input_unit={'accel': 'g', 'gyro': 'deg/s'}))
    gyro, accel = session.apply([180.0, 0, 0], [0, 0, 1.0])
    np.testing.assert_allclose(gyro, [np.pi, 0, 0])
    np.testing.assert_allclose(accel, [-0.1, 0, G0])
    for k in range(400):
        session.feed(k / 100, [0.0, 0, 0.01 * (k % 2)], [0, 0, 1 + 1e-3 * (k % 2)])
    assert session.capture().name == '+z'
    np.testing.assert_allclose(session.poses.outputs[:, 0], [0, 0, G0], rtol=1e-3, atol=1e-9)
    session.reset()
    np.testing.assert_array_equal(session.in_si([1, 0, 0], [0, 0, 1]), [[1, 0, 0], [0, 0, 1]])
    with pytest.raises(InputError, match='input_unit .* is not known'):
        session.load(stated(tmp_path / 'c.yaml', input_unit={'accel': 'ft/s^2'}))


def test_a_calibration_is_read_once(tmp_path, monkeypatch):
    """Else values, unit and doubts may be of two, where it is calibrated again meanwhile."""
    file = stated(tmp_path / 'c.yaml', input_unit={'accel': 'g'})
    rng = np.random.default_rng(3)
    bag = write(tmp_path / 'a.npz', np.arange(50) / 100, rng.normal(size=(50, 3)),
                rng.normal(size=(50, 3)))
    read, whole = [], store.load_yaml
    monkeypatch.setattr(store, 'load_yaml', lambda *a: read.append(a) or whole(*a))
    tasks.apply_calibration(bag, tmp_path / 'b.npz', file)
    assert len(read) == 1
    tasks.Session().load(file)
    assert len(read) == 2


def test_failing_commands_leave_nothing(tmp_path, capsys):
    """A refusal is one line with its remedy, exit status 1 or 2, and no folder."""
    rng = np.random.default_rng(12)
    bag = write(tmp_path / 'five.npz', *six_faces(rng, sim.Device(noise=0.02),
                                                  ['+x', '-x', '+y', '-y', '+z'])[:3])
    out = tmp_path / 'out'
    assert main(['calibrate', str(bag), '-o', str(out)]) == 1
    said = capsys.readouterr().err
    assert 'missing -z' in said and said.count('\n') == 1
    assert main(['calibrate', str(bag), '-o', str(out), '--gravity', '9.8', '--latitude',
                 '3']) == 2
    assert main(['calibrate', str(bag), '-o', str(out), '--turn', '0']) == 2
    assert main(['apply', str(bag), '-o', str(tmp_path / 'b.npz'), '--calibration',
                 str(tmp_path)]) == 1
    assert sorted(p.name for p in tmp_path.iterdir()) == ['five.npz']


@pytest.mark.parametrize('text', ['', 'S: 3',
                                  'sensor: accel\nS: [[1,0,0],[0,1,0],[0,0,0]]\nbias: [0,0,0]',
                                  'sensor: accel\nS: [[1,0,0],[0,1,0],[0,0,1]]\nbias: [0,.nan,0]',
                                  '- 3',
                                  'sensor: accel\nS: [[1,0,0],[0,1,0],[0,0,1]]\nbias: [0,0,0]\n'
                                  'effects: {x: {effect: nothing_known}}'])
def test_a_damaged_calibration_is_never_applied(tmp_path, text):
    """A failed or damaged calibration is refused with the file's name."""
    file = tmp_path / 'calibration.yaml'
    file.write_text(text)
    with pytest.raises(InputError, match='calibration.yaml'):
        tasks.Session().load(file)


def real(folder: Path, name, rate=None):
    """Return a real record."""
    with np.load(folder / 'records' / f'{name}.npz') as d:
        gyro, accel = d['gyro'].astype(float), d['accel'].astype(float)
        rate = rate or float(d['rate_hz'])
        t = d['t'] - d['t'][0] if 't' in d.files else np.arange(len(accel)) / rate
    return ImuRecord(gyro, accel, t, rate, path=name)


@pytest.mark.thorough
def test_xsens(shared_data):
    """38 hand-held poses against the reference, in counts; nominal faces of them warn."""
    done = tasks.calibrate_records([real(shared_data, 'xsens_mti_multipos')], gravity=9.81744)
    c = done.calibration
    assert c.problem.method == 'norm' and c.poses.n >= 36
    np.testing.assert_allclose(np.diag(c.S) * 414.333, [414.419, 412.032, 414.621], atol=0.06)
    np.testing.assert_allclose(c.bias * 414.333 + 32768, [33123.84, 33275.16, 32364.49], atol=0.3)
    error = np.linalg.norm(c.apply(c.poses.outputs.T), axis=1) - 9.81744
    assert np.sqrt(np.mean(error ** 2)) == pytest.approx(0.0011, abs=1e-4)
    warned = ' '.join(tasks.calibrate_records([real(shared_data, 'xsens_mti_multipos')],
                                              gravity=9.81744,
                                              method='wls').calibration.warnings)
    assert 'tilted by about' in warned and 'chi-squared' in warned


@pytest.mark.parametrize('name, scale, bias', [
    ('mpu9150_0_multipos', (0.363, 0.315, 0.647), (0.103, 0.097, 0.344)),
    ('mpu9150_1_multipos', (0.471, 0.482, 0.932), (0.090, 0.070, 0.338))])
def test_mpu9150(shared_data, name, scale, bias):
    """Within three standard errors of the published numbers, with their gravity, 9.81."""
    c = tasks.calibrate_records([real(shared_data, name)], gravity=9.81).calibration
    std_s, std_b = c.std
    np.testing.assert_array_less(np.abs(100 * (np.diag(c.S) - 1) - scale), 300 * np.diag(std_s))
    np.testing.assert_array_less(np.abs(c.bias - bias), 3 * std_b + 5e-4)


@pytest.mark.thorough
def test_imucal(shared_data):
    """
    Six faces and three hand turns: both sensors solve.

    The turns need the rate the record really has.

    """
    accel = tasks.calibrate_records([real(shared_data, 'imucal_ferraris')],
                                    seconds=1.0).calibration
    assert set(sim.AXES) <= set(accel.poses.names)
    assert np.abs(np.diag(accel.S) - 1).max() < 0.03
    gyro = tasks.calibrate_records([real(shared_data, 'imucal_ferraris', 102.4)], turn_deg=360,
                                   seconds=1.0).calibration
    assert {'turn -x', 'turn -y', 'turn -z'} <= set(gyro.poses.names) and np.abs(np.diag(gyro.S)
                                                                                 - 1).max() < 0.03
    with pytest.raises(InputError, match='no turn about'):
        tasks.calibrate_records([real(shared_data, 'imucal_ferraris')], turn_deg=360, seconds=1.0)
