# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The gyroscope by the turns between poses: intervals, axes, both sensors from one recording."""

from __future__ import annotations

from dataclasses import replace
import io
import re
from types import SimpleNamespace

import calibration_sessions as sim
from matplotlib import image as mpimg
import numpy as np
from params import daily, seldom
import pytest
from scipy.spatial.transform import Rotation
import yaml

from imu_noise_tools import calibration as core
from imu_noise_tools.calibration.between import integrated, rotations, time_offset
from imu_noise_tools.calibration.solution import stated
from imu_noise_tools.calibration.turn_problem import off_axes
from imu_noise_tools.cli.calibration import _late as calibration_words
from imu_noise_tools.cli.main import main
from imu_noise_tools.core.errors import FitError, InputError
from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.loop.effect import find_effect
from imu_noise_tools.loop.problem import Problem
from imu_noise_tools.plots import calibration as plots
from imu_noise_tools.plots.style import new_figure, png, stacked
from imu_noise_tools.tasks import calibration as tasks
from imu_noise_tools.tasks.compare import _apart

DEG = np.pi / 180


def session(seed, n=16, **device):
    """Return (record, accelerometer, gyroscope) of poses in all directions, turned by hand."""
    rng = np.random.default_rng(seed)
    accel = sim.Device.drawn(rng, noise=0.02, upper=True)
    gyro = sim.Device.drawn(rng, 'gyro', noise=2e-3)
    for name, value in device.items():
        setattr(gyro, name, value)
    ups = sim.spread_directions(n, rng)[rng.permutation(n)]
    t, rates, force, _ = sim.stream(accel, ups, rng, gyro=gyro, hold_s=3.0)
    return ImuRecord(rates, force, t, 100.0), accel, gyro


def problem_of(record):
    """Return the problem of a record's turns."""
    found = core.rests(record)
    poses, _ = core.positions(record, sim.G)
    accel = core.calibrate(poses).correction
    return core.TurnsProblem.of(core.gathered(record, found, accel, sim.G))


def test_rotation_vectors():
    """Rodrigues against scipy, small and large, and none."""
    rng = np.random.default_rng(0)
    v = np.concatenate([rng.normal(size=(20, 3)), 1e-9 * rng.normal(size=(5, 3)),
                        np.zeros((1, 3))])
    np.testing.assert_allclose(rotations(v), Rotation.from_rotvec(v).as_matrix(), atol=1e-12)


def test_integration_is_coning_correct():
    """A cone of 5 deg at 5 Hz, 4 s at 100 Hz: ten times nearer the closed form than mid-points."""
    rate, a, w = 100.0, 5 * DEG, 2 * np.pi * 5
    t = np.arange(401) / rate

    def att(x):
        about = w * np.atleast_1d(x)[:, None] * np.array([[0, 0, 1]])   # Rz(wt) Ry(a) Rz(-wt)
        tilt = Rotation.from_rotvec([0, a, 0])
        return Rotation.from_rotvec(about) * tilt * Rotation.from_rotvec(-about)

    step = 1e-6
    rates = ((att(t - step).inv() * att(t + step)).as_rotvec()) / (2 * step)
    problem = problem_of(session(1)[0])
    turns = replace(problem.data, gyro=rates, force=rates, step=np.append(np.diff(t), 0.0),
                    temperature=t, time=t, turn=np.zeros(len(t), int),
                    before=problem.data.before[:, :1], after=problem.data.after[:, :1],
                    spread=problem.data.spread[:1])
    true = (att(t[0]).inv() * att(t[-1])).as_matrix()[0]
    plain = np.eye(3)
    for x in (rates[:-1] + rates[1:]) / 2 / rate:
        plain = plain @ rotations(x[None])[0]

    def off(r):
        return Rotation.from_matrix(r.T @ true).magnitude()
    assert off(integrated(turns, rates)[-1]) < off(plain) / 10


@pytest.mark.thorough
def test_intervals_hold_the_truth():
    """Twenty sessions, twelve numbers each."""
    hits = []
    for seed in range(20):
        record, _, gyro = session(seed)
        fit = problem_of(record).fit(core.base_model())
        true = [*np.diag(gyro.scale), *gyro.scale[~np.eye(3, dtype=bool)], *gyro.bias]
        std = np.sqrt(np.diag(fit.details.cov))
        hits.append(np.abs(fit.details.theta - true) < 1.96 * std)
    assert 0.92 <= np.mean(hits) <= 0.98


def test_cross_axis_terms_are_no_better_known_than_the_axes_they_refer_to():
    """As printed and as compared: two sessions, in one the axes are known to 0.1 rad alone."""
    sure = problem_of(session(1, 8)[0])
    fit = sure.fit(core.base_model())
    unsure = core.TurnsProblem.of(replace(sure.data, axes=np.array([0.0, 0.0, 0.1])))
    wide = unsure.fit(core.base_model())
    np.testing.assert_array_equal(wide.details.cov, fit.details.cov)    # of turns by each other
    s, other = (stated(p, f).std[0] for p, f in ((sure, fit), (unsure, wide)))
    turned = np.zeros((3, 3))
    turned[0, 1] = turned[1, 0] = 0.1
    turned[0, 0] = turned[1, 1] = 0.1 ** 2 / 2
    np.testing.assert_allclose(other, np.hypot(s, turned), rtol=1e-6)
    parameter = find_effect('calibration', 'cross_axis').parameter('S_xy')
    x, y = (f.estimates['cross_axis']['S_xy'] for f in (fit, wide))
    moved = replace(y, value=y.value + 0.05, ci95=tuple(v + 0.05 for v in y.ci95))
    assert _apart(parameter, x, moved) == pytest.approx(0.5, rel=0.02)
    back = core.problems(core.arrays_of({'gyro': unsure}))['gyro']
    assert back.fit(core.base_model()).estimates == wide.estimates


def test_the_axes_of_an_accelerometer_are_off_by_half_of_what_its_terms_differ():
    keys = (('scale', 'S_xx'), ('cross_axis', 'S_xy'), ('cross_axis', 'S_yx'))
    cov = np.array([[9.0, 0, 0], [0, 4, 1], [0, 1, 4]])
    fit = SimpleNamespace(details=SimpleNamespace(keys=keys, cov=cov))
    np.testing.assert_allclose(off_axes(fit), [0, 0, np.sqrt((4 + 4 - 2) / 4)])


@pytest.mark.thorough
def test_intervals_hold_the_truth_where_the_axes_are_what_is_not_known():
    """A loud accelerometer beside a quiet gyroscope: without its axes 91 % of 600 held it."""
    hits = []
    for seed in range(2000, 2100):
        rng = np.random.default_rng(seed)
        accel = sim.Device.drawn(rng, noise=0.1, upper=True)
        gyro = sim.Device.drawn(rng, 'gyro', noise=3e-4)
        ups = sim.spread_directions(16, rng)[rng.permutation(16)]
        t, rates, force, _ = sim.stream(accel, ups, rng, gyro=gyro, hold_s=3.0)
        record = ImuRecord(rates, force, t, 100.0)
        done = tasks.calibrate_records([record], sensor='gyro').calibration
        off = ~np.eye(3, dtype=bool)
        hits.append(np.abs(done.S - gyro.scale)[off] < 1.96 * done.std[0][off])
    assert 0.93 <= np.mean(hits) <= 0.97


@pytest.mark.thorough
def test_left_out_closed_form_is_split_fit_score():
    """Turns left out by leverage against fitting n times."""
    problem = problem_of(session(3, g_sensitivity=1e-3 * np.ones((3, 3)))[0])
    model = core.base_model()
    looped = Problem.held_out(problem, model)
    left = problem.left_out(problem.fit(model))
    n = 2 * problem.data.n
    assert np.mean(left.pulls[:n] ** 2) - 1 == pytest.approx(looped.excess, rel=0.5, abs=0.3)


def test_a_rest_in_which_a_hand_creeps_is_no_end_of_a_turn():
    """One pose of sixteen turns by 0.17 deg/s while it is held: said, and the rest is sound."""
    rng = np.random.default_rng(7)
    ups = sim.spread_directions(16, rng)[rng.permutation(16)]
    t, rates, force, _ = sim.stream(sim.Device(noise=0.02), ups, rng, hold_s=3.0)
    plain = ImuRecord(rates, force, t, 100.0)
    assert not core.held(plain, core.rests(plain))[1]
    begin, creep = 8 * 450, 0.1 * DEG * np.array([1.0, -1.0, 1.0])
    since = np.clip(t - t[begin], 0.0, 3.0)
    back = Rotation.from_rotvec(since[:, None] * -creep)
    record = ImuRecord(back.apply(rates) + creep * ((since > 0) & (since < 3))[:, None],
                       back.apply(force), t, 100.0)
    found = core.rests(record)
    kept, notes = core.held(record, found)
    assert len(found) == 16 and len(kept) == 15 and 'deg/s at 36 s' in notes[0]
    done = tasks.calibrate_records([record], sensor='gyro')
    assert any('still turn' in n for n in done.calibration.notes)
    fit = done.calibration.fit
    assert not fit.details.tilt or fit.details.tilt < 0.05 * DEG
    true = [1, 1, 1, *np.zeros(6), 0.01, -0.02, 0.005]
    assert np.all(np.abs(fit.details.theta - true) < 4 * np.sqrt(np.diag(fit.details.cov)))
    assert done.study.diagnose()['gyro'].verdict == 'complete'


@pytest.mark.thorough
def test_a_bias_that_steps_is_no_hand_that_creeps():
    """All rests after a step of 0.2 deg/s are kept, and it is found by name and time."""
    plain, _, _ = session(8, 24)
    at = plain.t[int(0.6 * plain.n)]
    jump = 0.2 * DEG * np.outer(plain.t > at, [1.0, 0.0, 0.4])
    record = replace(plain, gyro=np.asarray(plain.gyro) + jump)
    found = core.rests(record)
    assert core.held(record, found) == (found, [])
    d = tasks.calibrate_records([record]).study.diagnose(['gyro'])['gyro']
    assert [f.name for f in d.found] == ['step']
    time = d.found[0].estimates['t'].ci95
    assert time[0] - 4.5 < at < time[1] + 4.5


def test_what_the_bias_does_in_time_is_taken_out_of_the_turns():
    """A drift that moves the end of the last turns by half a degree leaves what noise makes."""
    plain, _, _ = session(9, 24)
    record = replace(plain, gyro=np.asarray(plain.gyro) + np.outer(plain.t, [5e-5, -3e-5, 4e-5]))
    drift = find_effect('calibration', 'drift')()
    bare, with_it = problem_of(plain), problem_of(record)
    fit = with_it.fit(core.base_model() + drift)
    missed = [p.summary(f)['residual_rms'] for p, f in (
        (bare, bare.fit(core.base_model())), (with_it, fit))]
    assert missed[1] < 1.2 * missed[0]
    assert all(e.ci95[0] < v < e.ci95[1] for e, v in zip(
        fit.estimates['drift'].values(), [5e-5, -3e-5, 4e-5]))


@pytest.mark.thorough
def test_directions_are_those_of_the_accelerometer_with_what_it_lacked():
    """The square of the accelerometer is not charged to the gyroscope, and it is said."""
    rms = []
    for square in (0.0, 1e-3):
        rng = np.random.default_rng(12)
        accel = sim.Device.drawn(rng, noise=0.02, upper=True)
        gyro = sim.Device.drawn(rng, 'gyro', noise=2e-3)
        accel.quadratic = square * np.array([1.0, -0.5, 0.8])
        ups = sim.spread_directions(24, rng)[rng.permutation(24)]
        t, rates, force, _ = sim.stream(accel, ups, rng, gyro=gyro, hold_s=3.0)
        done = tasks.calibrate_records([ImuRecord(rates, force, t, 100.0)])
        rms.append(done.study.states['gyro'].summary['left_out_rms'])
        assert any('with quadratic' in n for n in done.gyro.notes) == (square > 0)
    assert rms[1] < 1.2 * rms[0]


@pytest.mark.thorough
def test_turns_that_miss_by_far_are_never_complete():
    """Rates held at 60 deg/s by what comes before the noise: what is missed and where it ends."""
    record, _, gyro = session(10, 24)
    rng = np.random.default_rng(10)
    rates = np.clip(np.asarray(record.gyro), -60 * DEG, 60 * DEG)
    record = replace(record, gyro=rates + 2e-3 * rng.normal(size=rates.shape))
    done = tasks.calibrate_records([record])
    d = done.study.diagnose(['gyro'])['gyro']
    assert d.verdict != 'complete' and d.remaining is not None
    assert 'turns miss gravity by' in d.advice + ' '.join(f.evidence for f in d.remaining.failed)
    assert any('reach 60 deg/s and none more' in w.replace('61', '60').replace('62', '60')
               for w in done.gyro.warnings)


def test_g_sensitivity_is_found_and_the_error_of_turns_left_out_falls():
    """The loop names it, and adding it brings turns left out back to noise."""
    sensitivity = 2e-3 * np.array([[1, -1, 0.5], [0.3, -1, 1], [1, 0.2, 0.4]])
    record, _, gyro = session(4, g_sensitivity=sensitivity)
    study = tasks.calibrate_records([record], sensor='gyro').study
    before = study.states['gyro'].summary['left_out_rms']
    assert study.diagnose()['gyro'].found[0].name == 'g_sensitivity'
    study.add()
    state = study.states['gyro']
    assert state.summary['left_out_rms'] < before / 3
    found = state.model['g_sensitivity']
    values = np.array([found[p.name] for p in found.parameters]).reshape(3, 3)
    np.testing.assert_allclose(values, sensitivity, atol=3e-4)


@pytest.mark.thorough
def test_the_error_of_turns_is_not_scaled_to_itself():
    """A gross effect stands out of chance, its rung falls to chance, and nothing stays within."""
    sensitivity = 2e-4 * np.array([[1, -1, 0.5], [0.3, -1, 1], [1, 0.2, 0.4]])
    record, _, _ = session(4, g_sensitivity=sensitivity)
    study = tasks.calibrate_records([record], sensor='gyro').study
    before = study.states['gyro'].error
    assert before.failing == ['poses'] and before.excess > 20 * before.std
    step = study.add(['g_sensitivity'])[0]
    assert step.verdict == 'falls to chance' and step.held_out < 0.1 * before.excess
    clean = tasks.calibrate_records([session(5)[0]], sensor='gyro').study.states['gyro'].error
    assert clean.within_chance


@pytest.mark.parametrize('sensor, way, words', [
    ('gyro', np.diag([1, -1, 1]), 'gyro_y upside down'),
    seldom('accel', np.diag([1, 1, -1]), 'accel_z upside down'),
    seldom('gyro', np.eye(3)[[1, 0, 2]], 'gyro_x and gyro_y swapped'),
    ('accel', np.eye(3)[[0, 2, 1]], 'accel_y and accel_z swapped')])
def test_wrong_axes_are_refused_by_name(sensor, way, words):
    """The turns contradict gravity with these axes, and agree with them put right."""
    record, _, _ = session(5)
    wrong = replace(record, **{sensor: getattr(record, sensor) @ way.T})
    with pytest.raises(FitError, match=words) as refusal:
        tasks.calibrate_records([wrong])
    assert 'left-handed' in str(refusal.value)


@pytest.mark.thorough       # of the accelerometer test_ladder_processes.py has it
def test_both_sensors_from_one_recording(tmp_path, capsys):
    """One calibration.yaml with two parts, one study, one apply for both."""
    record, accel, gyro = session(6)
    bag, out = tmp_path / 'poses.npz', tmp_path / 'out'
    np.savez(bag, t=record.t, gyro=record.gyro, accel=record.accel)
    assert main(['calibrate', str(bag), '-o', str(out)]) == 0
    assert 'turns left out miss gravity by' in capsys.readouterr().out
    data = yaml.safe_load((out / 'calibration.yaml').read_text())
    assert data['gyro']['method'] == 'turns' and data['accel']['method'] == 'norm'
    assert abs(data['time_offset']['value']) < 5 * data['time_offset']['std'] + 1e-3
    np.testing.assert_allclose(data['gyro']['S'], gyro.scale, atol=1e-3)
    for command in (['compare', str(out)], ['diagnose', str(out)], ['history', str(out)],
                    ['add', str(out), 'g_sensitivity', '--axis', 'gyro']):
        assert main(command) == 0, command
    again = yaml.safe_load((out / 'calibration.yaml').read_text())
    assert list(again['gyro']['effects']) == ['g_sensitivity'] and not again['accel']['effects']
    better = tmp_path / 'better.npz'
    assert main(['apply', str(bag), '-o', str(better), '--calibration', str(out)]) == 0
    with np.load(better) as new:
        corrected = {k.split('_')[0]: new[k] for k in new.files if '_' in k}
    still = slice(0, 250)
    assert np.linalg.norm(corrected['gyro'][still].mean(0)) < 1e-3
    assert np.linalg.norm(corrected['accel'][still].mean(0)) == pytest.approx(sim.G, abs=5e-3)


@pytest.mark.parametrize('asked', [False, seldom(True)])
def test_turns_tell_whether_samples_or_stamps_are_even(asked):
    """A driver that stamps late is no clock; where samples are asked for, stamps hold."""
    rng = np.random.default_rng(21)
    accel, gyro = sim.Device.drawn(rng, noise=0.02, upper=True), sim.Device.drawn(
        rng, 'gyro', noise=2e-3)
    ups = sim.spread_directions(16, rng)[rng.permutation(16)]
    t, rates, force, _ = sim.stream(accel, ups, rng, gyro=gyro, hold_s=3.0, move_s=0.4, rate=600.0)
    late = rng.integers(-2, 3, len(t) // 6 - 1)
    even = 6 * np.arange(1, len(late) + 1)
    taken = even + late if asked else even
    record = ImuRecord(rates[taken], force[taken], t[even + late], 100.0)
    done = tasks.calibrate_records([record]).gyro
    assert any('taken as even' in n for n in done.notes) is not asked
    np.testing.assert_allclose(done.S, gyro.scale, atol=1.5e-3)


def test_a_table_without_stamps_goes_all_the_way(undrawn, tmp_path):
    """What calibrate reads with --rate-hz, apply and filter read so: each asked for it in vain."""
    record, accel, _ = session(3)
    log, out, better = tmp_path / 'imu.log', str(tmp_path / 'out'), tmp_path / 'better.csv'
    np.savetxt(log, np.hstack([record.accel, record.gyro]))
    read = ['--fields', 'accel=1+2+3,gyro=4+5+6', '--rate-hz', '100']
    assert main(['calibrate', str(log), *read, '-o', out, '--sensor', 'accel']) == 0
    assert main(['apply', str(log), *read, '-o', str(better), '--calibration', out]) == 0
    new = np.genfromtxt(better, delimiter=',', names=True)
    still = np.array([new[f'accel_{c}_calibrated'][:250].mean() for c in 'xyz'])
    assert np.linalg.norm(still) == pytest.approx(sim.G, abs=5e-3)
    assert main(['filter', str(log), *read, '-o', str(tmp_path / 'smooth.csv')]) == 0
    assert main(['apply', str(log), *read[:2], '-o', str(better), '--calibration', out,
                 '--force']) == 1


def test_too_few_turns_are_said():
    """Six faces calibrate the accelerometer; why not the gyroscope is a note, or a refusal."""
    rng = np.random.default_rng(7)
    device = sim.Device.drawn(rng, noise=0.02)
    t, rates, force, _ = sim.stream(device, sim.faces()[1], rng)
    record = ImuRecord(rates, force, t, 100.0)
    done = tasks.calibrate_records([record])
    assert done.gyro is None
    assert any('the gyroscope is left out: 5 turns' in n for n in done.calibration.notes)
    with pytest.raises(InputError, match='5 turns between poses'):
        tasks.calibrate_records([record], sensor='gyro')


def test_turns_with_a_saturated_gyroscope_are_left_out_and_said():
    """At the end of the range what it turned is not known: they would come out short."""
    record, _, _ = session(10)
    most = 0.95 * record.gyro[:, 0].max()
    clipped = record.gyro.copy()
    clipped[:, 0] = np.minimum(clipped[:, 0], most)
    whole, some = (tasks.calibrate_records([r]).gyro for r in (
        record, replace(record, gyro=clipped)))
    assert any(n.startswith('gyro_x is saturated in') for n in some.notes)
    assert not any('gyro_y' in n or 'gyro_z' in n for n in some.notes)
    assert some.poses.n < whole.poses.n


@pytest.mark.thorough
def test_time_offset_between_the_sensors():
    """An accelerometer stamped 12 ms late is told to be."""
    rng = np.random.default_rng(8)
    accel, gyro = sim.Device(noise=0.02), sim.Device(noise=2e-3)
    ups = sim.spread_directions(14, rng)[rng.permutation(14)]
    t, rates, force, _ = sim.stream(accel, ups, rng, rate=1000.0, gyro=gyro, hold_s=4.0)
    record = ImuRecord(rates[::10], np.roll(force, 12, axis=0)[::10], t[::10], 100.0)
    offset = core.offset_of(tasks.calibrate_records([record]).gyro)
    assert offset['value'] == pytest.approx(0.012, abs=max(4 * offset['std'], 1e-3))


@pytest.mark.thorough
def test_the_interval_of_the_time_offset_holds():
    """Handling of 1.5 m/s^2 over tenths of a second, and knocks: z is 1 rms."""
    record, _, gyro = session(31)
    turns = problem_of(record).data
    rates = (turns.gyro - gyro.bias) @ np.linalg.inv(gyro.scale).T
    up = np.einsum('mji,jm->mi', integrated(turns, rates), turns.before[:, turns.turn])
    force = sim.G * (up - 0.02 * np.cross(rates, -up))      # stamped 20 ms late
    rng, z = np.random.default_rng(32), []
    shape = np.exp(-0.5 * (np.arange(-24, 25) / 8.0) ** 2)
    for _ in range(150):
        hand = np.array([np.convolve(x, shape, 'same') for x in rng.normal(size=up.T.shape)]).T
        hand *= 1.5 / hand.std()
        hand[rng.integers(0, len(hand), 5)] += 50.0
        value, std = time_offset(replace(turns, force=force + hand), rates, sim.G)
        z.append((value - 0.02) / std)
    assert 0.8 < np.sqrt(np.mean(np.square(z))) < 1.25
    assert abs(np.mean(z)) < 0.35


@pytest.mark.parametrize('offset, said', [
    ({'value': -0.021, 'std': 0.004, 'ci95': [-0.029, -0.013]}, '21.0 ms earlier than the gyro'),
    ({'value': 0.021, 'std': 0.004, 'ci95': [0.013, 0.029]}, '21.0 ms later than the gyroscope'),
    ({'value': -0.003, 'std': 0.004, 'ci95': [-0.011, 0.005]}, 'alike, as far as the turns tell')])
def test_a_delay_in_words(offset, said):
    """Nothing that is within its interval of none is printed as a delay, and none is negative."""
    assert said in calibration_words(offset) and '-' not in calibration_words(offset)


@pytest.mark.parametrize('name, gravity, scale', [
    ('mpu9150_0_multipos', 9.81, (0.041, 0.457, 0.826)),
    seldom('xsens_mti_multipos', 9.81744, (0.224, -0.195, -0.027))])
def test_real_turns(shared_data, name, gravity, scale):
    """Published scale factors (per cent) within their errors, turns left out within 0.2 deg."""
    with np.load(shared_data / 'records' / f'{name}.npz') as d:
        rate = float(d['rate_hz'])
        t = d['t'] - d['t'][0] if 't' in d.files else np.arange(len(d['accel'])) / rate
        record = ImuRecord(d['gyro'].astype(float), d['accel'].astype(float), t, rate, path=name)
    problem = tasks.calibrate_records([record], gravity=gravity, sensor='gyro',
                                      seconds=1.0).calibration.problem
    model = core.base_model()
    if name.startswith('xsens'):
        model = model + find_effect('calibration', 'g_sensitivity')()
    fit = problem.fit(model)
    np.testing.assert_allclose(100 * (np.diag(fit.details.scale) - 1), scale, atol=0.15)
    assert np.degrees(problem.summary(fit)['left_out_rms']) < 0.2


def test_a_guided_session_calibrates_both():
    """Captures of nine poses, one after the other: what lies between them is the gyroscope's."""
    from imu_noise_tools.core.stillness import still_stretches
    record, _, gyro = session(9, n=16)
    guided = tasks.Session(gravity=sim.G)
    ends = {b - 1 for _, b in still_stretches(record, 2.0)}
    for k, row in enumerate(zip(record.t, record.gyro, record.accel)):
        guided.feed(*row)
        if k in ends:
            guided.capture()
    guided.solve()
    assert guided.gyro is not None and guided.study.targets == ['accel', 'gyro']
    np.testing.assert_allclose(guided.gyro.S, gyro.scale, atol=2e-3)
    still = record.gyro[:200].mean(0)
    corrected, _ = guided.apply(still, record.accel[:200].mean(0))
    assert np.linalg.norm(corrected) < 1e-3 < np.linalg.norm(still)


def coarse(record, sensor, step):
    """Return a record with one sensor's output on a grid."""
    return replace(record, **{sensor: step * np.round(getattr(record, sensor) / step)})


def test_what_a_coarse_gyroscope_hides_is_said():
    """Constant at rest: the bias is no better known than the step, and nothing is missing."""
    record, _, gyro = session(41, n=24, bias=np.array([0.004, -0.003, 0.002]))
    done = tasks.calibrate_records([coarse(record, 'gyro', 0.02)]).gyro
    assert any('the resolution of gyro_x, gyro_y, gyro_z (0.02 rad/s) limits' in n
               for n in done.notes)
    assert not any('still turn' in n for n in done.notes)
    std_s, std_b = done.std
    assert (std_b >= 0.99 * 0.02 / np.sqrt(12)).all() and (std_b < 0.01).all()
    assert np.all(np.abs(done.bias - gyro.bias) < 2 * std_b)
    z = (done.S - gyro.scale) / std_s
    assert np.sqrt(np.mean(z ** 2)) < 2
    again = core.problems(core.arrays_of({'gyro': done.problem}))['gyro'].fit(core.base_model())
    np.testing.assert_allclose(np.diag(again.details.cov), np.diag(done.fit.details.cov))
    fine = tasks.calibrate_records([record]).gyro
    assert not any('resolution' in n for n in fine.notes)


@pytest.mark.parametrize('noise', [0.02, 0.005])
def test_a_coarse_accelerometer_has_no_knocks(noise):
    """What goes to a neighbour on the grid now and then was not knocked; the step is said."""
    rng = np.random.default_rng(42)
    device = sim.Device.drawn(rng, noise=noise, upper=True)
    ups = sim.spread_directions(16, rng)[rng.permutation(16)]
    t, rates, force, _ = sim.stream(device, ups, rng, hold_s=4.0)
    done = tasks.calibrate_records([coarse(ImuRecord(rates, force, t, 100.0), 'accel', 0.15)],
                                   sensor='accel').calibration
    assert not any('knock' in n for n in done.notes)
    assert any('(0.15 m/s^2) limits' in n for n in done.notes)
    knocked = force.copy()
    still = int(np.median(core.rests(ImuRecord(rates, force, t, 100.0))[3].samples()))
    knocked[still:still + 5] += 1.0
    done = tasks.calibrate_records([coarse(ImuRecord(rates, knocked, t, 100.0), 'accel', 0.15)],
                                   sensor='accel').calibration
    assert sum('knock' in n for n in done.notes) == 1


def six_faces(seed):
    """Return a record of six faces by hand with a gyroscope: five turns."""
    rng = np.random.default_rng(seed)
    device = sim.Device.drawn(rng, noise=0.02)
    t, rates, force, _ = sim.stream(device, sim.faces()[1], rng)
    return ImuRecord(rates, force, t, 100.0)


@pytest.mark.parametrize('axis', daily(range(3), 1))
def test_five_turns_show_a_mirrored_axis(axis):
    """Three of them are half turns, that end at gravity about any axis: the others tell."""
    record = six_faces(7)
    assert tasks.calibrate_records([record]).gyro is None       # nothing is wrong with it
    force = record.accel.copy()
    force[:, axis] *= -1
    with pytest.raises(FitError, match=f'accel_{"xyz"[axis]} upside down'):
        tasks.calibrate_records([replace(record, accel=force)])


@pytest.mark.parametrize('factor, said, remedy', [
    (180 / np.pi, 'is in deg/s, not rad/s', 'give --gyro-unit deg/s'),
    seldom(np.pi / 180, 'is in rad/s already', 'leave out --gyro-unit')])
def test_turns_tell_the_unit_of_the_gyroscope(factor, said, remedy):
    """Turns between poses are known by gravity: 57.3 times as large, or as small."""
    record, _, _ = session(10)
    with pytest.raises(FitError, match=said) as error:
        tasks.calibrate_records([replace(record, gyro=factor * record.gyro)])
    assert error.value.remedy.startswith(remedy)


@pytest.mark.parametrize('factor', [seldom(3.5), 40.0, seldom(0.2)])
def test_turns_tell_by_how_much_a_count_is_wrong(factor):
    """The fit begins at a scale near 1: by far off it fails, or fits what no turn was."""
    record, _, gyro = session(10)
    done = tasks.calibrate_records([replace(record, gyro=factor * record.gyro)])
    assert done.gyro is None
    (said,) = [n for n in done.calibration.notes if 'times as large as gravity tells' in n]
    told = float(re.search('are ([0-9.]+) times', said)[1])
    np.testing.assert_allclose(told, factor * np.mean(np.diag(gyro.scale)), rtol=0.02)


def test_a_gyroscope_that_does_not_turn_has_no_wrong_count():
    """No factor brings noise to where gravity is."""
    record, _, _ = session(10)
    still = np.random.default_rng(1).normal(0, 2e-3, record.gyro.shape)
    done = tasks.calibrate_records([replace(record, gyro=still)])
    assert done.gyro is None
    assert not any('times as large' in n for n in done.calibration.notes)


def test_what_a_sensor_stands_still_for_is_no_pose():
    """A driver that sends one value until it runs: as a face of its own the fit failed by it."""
    record = six_faces(7)
    n = 400
    late = replace(record, t=np.arange(record.n + n) / 100, gyro=np.concatenate(
        [np.zeros((n, 3)), record.gyro]), accel=np.concatenate(
            [np.tile([0.1, 0.2, 9.5], (n, 1)), record.accel]))
    done, alone = (tasks.calibrate_records([r]).calibration for r in (late, record))
    np.testing.assert_allclose(done.S, alone.S, atol=1e-9)
    said = tasks.calibrate_records([late]).study.source['warnings']
    assert any('accel stands at one value on all axes from 0 s to 3.99 s' in w for w in said)
    one = record.accel.copy()
    one[50:350, 0] = one[50:350, 0].mean()          # an axis alone may be coarse
    several = tasks.calibrate_records([replace(record, accel=one)])
    assert not any('left out' in w for w in several.study.source['warnings'])


def test_a_few_samples_that_are_not_finite_are_missing():
    """As in analyse: left out and counted; more than one in a hundred are refused."""
    record, accel, _ = session(10)
    some = record.accel.copy()
    some[200:205] = np.nan
    done = tasks.calibrate_records([replace(record, accel=some)])
    assert '5 sample(s) not finite, treated as missing' in done.study.source['warnings']
    np.testing.assert_allclose(done.calibration.S, accel.scale, atol=1e-3)
    some[::50] = np.nan
    with pytest.raises(InputError, match='% of the samples are not finite'):
        tasks.calibrate_records([replace(record, accel=some)])


@pytest.mark.parametrize('factor, unit', [(1e3, 'ms'), (1e6, 'us'), (1e9, 'ns')])
def test_stamps_that_are_not_seconds_are_refused(factor, unit):
    """No IMU is recorded at 0.1 Hz."""
    record, _, _ = session(10)
    with pytest.raises(InputError, match=f'they are in {unit}, not s') as error:
        tasks.calibrate_records([replace(record, t=factor * record.t, rate_hz=100 / factor)])
    assert error.value.remedy.endswith('--rate-hz 100')


def test_add_and_history_print_what_is_solved(undrawn, tmp_path, capsys):
    """The new S and bias, and the temperature they hold at where they follow it."""
    record, _, _ = session(10)
    heat = 25 + 5 * np.sin(record.t / 15)
    bag, out = tmp_path / 'poses.npz', str(tmp_path / 'out')
    np.savez(bag, t=record.t, gyro=record.gyro, accel=record.accel, temperature=heat)
    assert main(['calibrate', str(bag), '-o', out, '--sensor', 'accel']) == 0
    assert 'degC' not in capsys.readouterr().out
    assert main(['add', out, 'temperature']) == 0
    said = capsys.readouterr().out
    data = yaml.safe_load((tmp_path / 'out' / 'calibration.yaml').read_text())
    assert f'{data["bias"][0]:10.6f} ±' in said and f'{data["S"][2][2]:9.6f} ±' in said
    assert '± one standard deviation' in said
    assert f'at {data["reference_temperature"]:.2f} degC' in said
    assert main(['history', out]) == 0
    assert f'{data["bias"][0]:10.6f} ±' in capsys.readouterr().out
    # history is read, not fitted: it needs no effect of a user's own
    for name in ('study.yaml', 'calibration.yaml'):
        file = tmp_path / 'out' / name
        file.write_text(file.read_text().replace('effect: temperature', 'effect: of_my_own'))
    assert main(['history', out]) == 0
    assert f'{data["bias"][0]:10.6f} ±' in capsys.readouterr().out
    file.write_text(file.read_text().replace('bias:', 'bios:'))
    assert main(['history', out]) == 1
    said = capsys.readouterr().err
    assert said.count('\n') == 1 and 'not a calibration' in said and 'calibrate again' in said


@pytest.mark.thorough
@pytest.mark.parametrize('sensitivity, loud', [(0.0, False), (1e-3, True)])
def test_the_picture_shows_what_the_gyroscope_lacks(sensitivity, loud):
    """Turns and rests, times their noise: the scatter that every fit has would hide it."""
    record, _, _ = session(12, g_sensitivity=sensitivity * np.ones((3, 3)))
    problem = problem_of(record)
    calibration = core.calibrate_turns(problem.data)
    ax = plots.residuals(new_figure(11, 4).add_subplot(), calibration)
    turns, rests = ([b.get_height() for b in bars] for bars in ax.containers)
    assert (len(turns), len(rests)) == (15, 16)
    assert (np.mean(rests) > 5) == loud and (np.mean(rests) < 2) == (not loud)
    before, after = (line.get_ydata() for line in plots.before_and_after(
        new_figure(4, 4).add_subplot(), calibration).lines[::2])
    # the same angles by the definition: gravity before, turned by the rates, against that after
    data = problem.data
    turned = integrated(data, data.gyro)[np.flatnonzero(np.diff(data.turn, append=99))]
    cosine = np.einsum('nij,jn,in->n', turned, data.after, data.before)
    np.testing.assert_allclose(before, np.degrees(np.arccos(cosine)), rtol=1e-6)
    assert loud or np.mean(after) < np.mean(before) / 3


def test_pictures_below_each_other():
    """All of both, in that order."""
    parts = []
    for height, colour in ((1, 'red'), (2, 'blue')):
        figure = new_figure(3, height)
        figure.set_facecolor(colour)
        parts.append(png(figure))
    whole = mpimg.imread(io.BytesIO(stacked(parts)))
    assert whole.shape[:2] == (300, 300)
    assert np.all(whole[:100, :, 0] == 1) and np.all(whole[100:, :, 2] == 1)
    assert not whole[:100, :, 2].any() and not whole[100:, :, 0].any()


@pytest.mark.thorough
def test_what_is_shaded_is_said_where_no_bar_is():
    """Above the axes, whatever the bars do; and only where something is shaded."""
    rng = np.random.default_rng(13)
    device = sim.Device.drawn(rng, noise=0.02, upper=True)
    ups = sim.spread_directions(16, rng)
    for off in (0.0, 0.3):
        t, rates, force, _ = sim.stream(device, ups, rng, hold_s=1.5)
        at = slice(4 * 300, 4 * 300 + 150)      # the fifth pose
        force[at] += off
        poses, _ = core.positions(ImuRecord(rates, force, t, 100.0), sim.G)
        ax = plots.residuals(new_figure(11, 4).add_subplot(), core.calibrate(poses))
        said = [x.get_position()[1] for x in ax.texts if x.get_text().startswith('shaded')]
        assert said == ([1.02] if off else [])
