# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A camera's IMU: gyroscope and accelerometer on topics of their own, at rates of their own.

The bag beside the single analyses of its topics, through the installed command.

"""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from types import SimpleNamespace

from camera import ACCEL, ACCEL_HZ, camera_bag, GYRO, GYRO_HZ, N_ACCEL, N_GYRO
import numpy as np
import pytest
import yaml

from imu_noise_tools import api
from imu_noise_tools.bag import open_record
from imu_noise_tools.cli.main import main
from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.health import examine, prepare
from imu_noise_tools.health.united import united as united_said
from imu_noise_tools.noise.beside import seen_from


def run(*words, status=0):
    """Run the installed command; return its standard output, and what it said beside."""
    done = subprocess.run([sys.executable, '-m', 'imu_noise_tools.cli.main', *map(str, words)],
                          capture_output=True, text=True, timeout=600)
    assert done.returncode == status, done.stderr
    return done.stdout, done.stderr


@pytest.fixture(scope='module')
def studies(tmp_path_factory, without_pictures):
    """Analyse the bag whole, and each of its topics alone; return the folder of all."""
    folder = tmp_path_factory.mktemp('camera')
    bag = camera_bag(folder / 'camera.mcap', seconds=120)
    run('analyse', bag, '-o', folder / 'both')
    with without_pictures():    # as a process and drawn the first has shown
        for name, topic in (('gyro', GYRO), ('accel', ACCEL)):
            assert main(['analyse', str(bag), '-o', str(folder / name), '--topic', topic]) == 0
    return folder


def study_of(folder):
    """Return study.yaml."""
    return yaml.safe_load((folder / 'study.yaml').read_text())


def test_each_sensor_is_analysed_as_if_it_were_alone(studies):
    """Coefficients, intervals and curves equal those of the single analyses to 1e-9."""
    both = study_of(studies / 'both')['targets']
    assert list(both) == [f'{s}_{a}' for s in ('gyro', 'accel') for a in 'xyz']
    compared = 0
    for sensor in ('gyro', 'accel'):
        alone = study_of(studies / sensor)['targets']
        assert len(alone) == 3
        for axis, entry in alone.items():
            for label, effect in entry['effects'].items():
                for name, estimate in effect.items():
                    if isinstance(estimate, str):
                        continue
                    other = both[axis]['effects'][label][name]
                    for key in ('value', 'std', 'upper95', 'point'):
                        one, two = estimate.get(key), other.get(key)
                        assert (one is None) == (two is None), (axis, label, key)
                        if one is not None:
                            assert two == pytest.approx(one, rel=1e-9)
                            compared += 1
                    assert other['ci95'] == pytest.approx(estimate['ci95'], rel=1e-9)
            for view in ('frequency', 'variance', 'distribution'):
                assert both[axis]['error']['views'][view] == pytest.approx(
                    entry['error']['views'][view], rel=1e-9)
    assert compared > 20
    with open(studies / 'both' / 'allan.csv', newline='') as file:
        rows = list(csv.reader(file))[1:]
    alone = []
    for sensor in ('gyro', 'accel'):
        with open(studies / sensor / 'allan.csv', newline='') as file:
            alone += list(csv.reader(file))[1:]
    assert [r[0] for r in rows] == [r[0] for r in alone]
    np.testing.assert_allclose(np.array([r[1:] for r in rows], float),
                               np.array([r[1:] for r in alone], float), rtol=1e-9)


def test_kalibr_gets_each_sensors_own_density(studies):
    """The densities are those that were put in; one topic and one rate, the gyroscope's."""
    text = (studies / 'both' / 'imu.yaml').read_text()
    data = yaml.safe_load(text)
    assert data['gyroscope_noise_density'] == pytest.approx(N_GYRO, rel=0.05)
    assert data['accelerometer_noise_density'] == pytest.approx(N_ACCEL, rel=0.05)
    assert data['rostopic'] == GYRO
    assert data['update_rate'] == pytest.approx(GYRO_HZ, rel=1e-3)
    said = [x for x in text.splitlines() if x.startswith('#') and ACCEL in x]
    assert len(said) == 1 and '63' in said[0], text


def test_the_study_says_what_each_sensor_is(studies):
    """The source holds a topic, a rate and a count of samples for each sensor."""
    source = study_of(studies / 'both')['source']
    streams = source['streams']
    assert source['topic'] == streams['gyro']['topic'] == GYRO
    assert streams['accel']['topic'] == ACCEL
    assert streams['accel']['rate_hz'] == pytest.approx(ACCEL_HZ, rel=1e-3)
    assert source['samples'] == 24000 and streams['accel']['samples'] == 7560
    assert not any('interpolat' in w for w in source['warnings'])
    page = (studies / 'both' / 'report.html').read_text()
    assert ACCEL in page and GYRO in page


@pytest.mark.thorough       # of one topic test_ladder_processes.py has it
def test_the_loop_goes_on_from_disk(studies):
    """What is loaded again is compared, diagnosed and added to, for both sensors alike."""
    out, _ = run('diagnose', studies / 'both', '--json')
    verdicts = {t: d['verdict'] for t, d in json.loads(out)['diagnosis'].items()}
    assert set(verdicts.values()) == {'complete'}, verdicts
    out, _ = run('add', studies / 'both', 'quantization', '--axis', 'accel_x', '--json')
    run('compare', studies / 'both')
    run('plan', studies / 'both')
    data = study_of(studies / 'both')
    assert 'quantization' in data['targets']['accel_x']['effects']


def test_inspect_tells_of_both(studies, capsys):
    """Rate and samples of each sensor are printed."""
    assert main(['inspect', str(studies / 'camera.mcap')]) == 0
    out = capsys.readouterr().out
    assert GYRO in out and ACCEL in out
    assert '24000 samples' in out and '7560 samples' in out
    assert main(['inspect', str(studies / 'camera.mcap'), '--json']) == 0
    data = json.loads(capsys.readouterr().out)
    assert data['health']['rate_hz'] == pytest.approx(GYRO_HZ, rel=1e-3)
    assert data['beside']['accel']['health']['rate_hz'] == pytest.approx(ACCEL_HZ, rel=1e-3)


def test_one_rate_for_two_is_refused(studies, capsys):
    """``--rate-hz`` cannot be meant for both."""
    assert main(['analyse', str(studies / 'camera.mcap'), '-o', str(studies / 'x'),
                 '--rate-hz', '200']) == 1
    said = capsys.readouterr().err
    assert '--rate-hz' in said and '--topic' in said


def test_a_disturbance_common_to_both_shows_between_them():
    """What gyroscope and accelerometer share is coherent, whichever is the faster."""
    rng = np.random.default_rng(3)
    shared = rng.standard_normal(60000)         # at 200 Hz, smooth over some 20 samples
    shared = np.convolve(shared, np.ones(20) / np.sqrt(20), 'same')
    fast = ImuRecord(gyro=np.column_stack([shared] * 3), accel=None,
                     t=np.arange(60000) / 200, rate_hz=200.0, start=100.0)
    at = 0.0317 + np.arange(18000) / 63
    slow = ImuRecord(gyro=None, accel=np.column_stack([np.interp(at, fast.t, shared)] * 3),
                     t=at - 0.0317, rate_hz=63.0, start=100.0317)
    for one, other, axis, own in ((fast, slow, 'accel_x', fast.gyro), (
            slow, fast, 'gyro_x', slow.accel)):
        seen = seen_from(one, other)
        assert seen[axis].shape == (one.n,)
        alike = [np.corrcoef(seen[axis][50:-2000], np.roll(own[:, 0], lag)[50:-2000])[0, 1]
                 for lag in range(-4, 5)]
        assert alike[4] > 0.9 and int(np.argmax(alike)) == 4, alike     # and at its own time
    apart = ImuRecord(gyro=None, accel=slow.accel, t=slow.t, rate_hz=63.0, start=300.0)
    assert seen_from(fast, apart) == {}


def united(method, rng, n=40000):
    """Return a record as ``unite_imu_method`` makes it: accelerations at the rates' stamps."""
    t = np.arange(n) / GYRO_HZ + 2e-5 * rng.standard_normal(n)
    known = np.arange(0, t[-1] + 1, 1 / ACCEL_HZ) - 0.004
    accel = [0.1, 0.2, 9.8] + 0.01 * rng.standard_normal((len(known), 3))
    if method == 'linear_interpolation':
        accel = np.column_stack([np.interp(t, known, a) for a in accel.T])
    elif method == 'copy':
        accel = accel[np.searchsorted(known, t) - 1]
    else:
        accel = [0.1, 0.2, 9.8] + 0.01 * rng.standard_normal((n, 3))
    if method == 'coarse':
        accel = np.round(accel / 0.02) * 0.02
    gyro = 1e-3 * rng.standard_normal((n, 3))
    return ImuRecord(gyro=gyro, accel=accel, t=t, rate_hz=GYRO_HZ)


@pytest.mark.parametrize('method, word', [
    ('linear_interpolation', 'interpolated'), ('copy', 'repeats'), ('none', ''), ('coarse', '')])
def test_united_samples_are_found_and_said(method, word):
    """Interpolated and copied accelerations are told, with the rate they were sampled at."""
    record = united(method, np.random.default_rng(5))
    for said in (prepare(record).warnings, examine(record).advice):
        found = [w for w in said if 'accel' in w.lower()
                 and ('interpolated' in w or 'repeats' in w)]
        assert len(found) == bool(word), said
        if word:
            assert word in found[0] and 'own topic' in found[0]
            assert float(found[0].split(' Hz')[0].split()[-1]) == pytest.approx(ACCEL_HZ, rel=0.03)


def held_at_once(source_hz, seed, n=40000, smooth=0, shake=0.0, step=0.0):
    """Return a record whose accelerations were sampled at source_hz (0: at the rates' stamps)."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) / GYRO_HZ + 2e-5 * rng.standard_normal(n)
    known = np.arange(0, t[-1] + 1, 1 / source_hz) - 0.004 if source_hz else t
    accel = 0.01 * rng.standard_normal((len(known), 3))
    for _ in range(smooth):
        accel = (accel + np.roll(accel, 1, axis=0)) / 2
    accel += shake * np.sin(2 * np.pi * 37.3 * known)[:, None] * [1.0, 0.9, 0.8]
    if source_hz:
        accel = np.column_stack([np.interp(t, known, a) for a in accel.T])
    accel = accel + [0.1, 0.2, 9.8]
    if step:
        accel = np.round(accel / step) * step
    return ImuRecord(gyro=1e-3 * rng.standard_normal((n, 3)), accel=accel, t=t, rate_hz=GYRO_HZ)


@pytest.mark.parametrize('source, shown', [
    (110, '110 or 290'), (125, '125 or 275'), (150, '150 or 250'), (208, '192 or 208'),
    (250, '150 or 250'), (260, '140 or 260')])
@pytest.mark.parametrize('n', [6000, 40000])
def test_fewer_than_two_for_one_are_told_by_the_variance(source, shown, n):
    """No two of them lie on a line, but the variance goes with the phase of the two clocks."""
    for seed in (1, 2):
        (said,) = united_said(held_at_once(source, seed, n))
        assert f'interpolated between samples taken at about {shown} Hz' in said


def test_what_is_not_interpolated_is_not_said_to_be():
    """White or smoothed, shaken at a line of any strength, in coarse levels."""
    for seed in range(60):
        record = held_at_once(0, seed, (40000, 8000)[seed % 2], seed % 3,
                              (0, 0.003, 0.03, 0.3, 3.0)[seed % 5], (0, 0.01, 0.03)[seed % 3])
        assert united_said(record) == [], seed


def turned_by_hand(seed, rest, turn, source_hz=0.0, hz=50.0):
    """Return a session of rests and turns of these lengths, s; accelerations as held_at_once."""
    rng = np.random.default_rng(seed)
    t = np.arange(10000) / hz
    u = (t % (rest + turn) - rest) / turn
    axes = rng.standard_normal((100, 3))[(t // (rest + turn)).astype(int)]
    rate = 2 * (np.sin(np.pi * u) * (u > 0))[:, None] * axes
    force = 9.8 * np.sin(np.cumsum(rate, axis=0) / hz)
    gyro = rate + 2e-3 * rng.standard_normal(rate.shape)
    if source_hz:
        known = np.arange(0, t[-1] + 1, 1 / source_hz) - 0.004
        taken = np.column_stack([np.interp(known, t, a) for a in force.T])
        taken += 0.02 * rng.standard_normal(taken.shape)
        accel = np.column_stack([np.interp(t, known, a) for a in taken.T])
    else:
        accel = force + 0.02 * rng.standard_normal(force.shape)
    return ImuRecord(gyro=gyro, accel=accel, t=t, rate_hz=hz)


def test_turns_are_not_taken_for_interpolation():
    """Turns come as regularly as two clocks beat; at the rests an interpolation still shows."""
    for seed in (0, 4):
        assert united_said(turned_by_hand(seed, 2.5, 1.2)) == [], seed
    for seed in (0, 1):
        (said,) = united_said(turned_by_hand(seed, 4.0, 1.5, 36.5))
        assert said.startswith('accel is interpolated') and '36.5 or 63.5 Hz' in said


def test_stamps_in_bursts_do_not_make_interpolated_samples():
    """Stamps given nearly once a frame tell no slope; a coarse gyroscope repeats itself."""
    rng = np.random.default_rng(3)
    record = held_at_once(0, 3, 20000)
    t = np.arange(record.n) / 100.0
    t = np.maximum.accumulate(np.ceil(t * 30) / 30 + 2e-4 * rng.random(record.n))
    accel = np.round(record.accel / 6e-4) * 6e-4
    gyro = np.round(record.gyro / 7e-4) * 7e-4
    assert united_said(ImuRecord(gyro=gyro, accel=accel, t=t, rate_hz=100.0)) == []


def test_both_at_once_where_something_needs_it(studies):
    """Who does not ask for the sensors apart gets them joined, and is told what that costs."""
    record = open_record(studies / 'camera.mcap')
    assert record.n == 24000 and record.accel is not None and not record.beside
    assert any('interpolated' in w for w in record.warnings)


def test_what_was_opened_apart_can_be_joined(tmp_path, monkeypatch):
    """A calibration and a filter need both: of a record at hand they see what they would read."""
    bag = camera_bag(tmp_path / 'camera.mcap', seconds=20)
    joined, apart = open_record(bag), open_record(bag, apart=True)
    assert apart.accel is None and len(apart.beside) == 1
    one = apart.united()
    np.testing.assert_array_equal(one.gyro, joined.gyro)
    # the start of a record is known to a quarter of a microsecond
    np.testing.assert_allclose(one.accel, joined.accel, atol=5e-7 * 63 * 0.1)
    assert one.beside == () and any('interpolated' in w for w in one.warnings)
    assert joined.united().accel is joined.accel and not apart.beside[0].united().beside
    seen = []
    monkeypatch.setattr(api.calibrating, 'calibrate_records',
                        lambda records, **_: seen.extend(records) or SimpleNamespace(study=None))
    monkeypatch.setattr(api.filtering, 'filter_samples', lambda record, **_: (
        seen.append(record) or record, SimpleNamespace(study=1, folder=None)))
    api.calibrate(apart)
    api.filter(apart)
    assert [r.accel is not None for r in seen] == [True, True]
