# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Every export, read as its consumer reads it, does in one second what the sensor does.

The readers here know nothing of the writers: each is written from the rules of the consumer's own
reader, and gives what its filter adds in a second for what the file holds: N^2 to the integral,
K^2 to the bias.

"""

from __future__ import annotations

from copy import copy
from dataclasses import replace
import json
import math
from pathlib import Path
import re
import runpy
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml

from imu_noise_tools import export
from imu_noise_tools.core.errors import InputError, UsageError
from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.export._numbers import _stated
from imu_noise_tools.loop.effect import Estimate, Model, registry
from imu_noise_tools.sheet import Sheet
from imu_noise_tools.tasks.noise import analyse_record

GYRO_HZ, ACCEL_HZ = 200.0, 63.0         # on topics of their own, as of a camera
SENSORS = ('gyro', 'accel')


def sensor_record(sensor, rate, n, k, seed, seconds=600.0):
    """Return a record of white noise and random walk, the three axes 10 % apart in N."""
    rng = np.random.default_rng(seed)
    count = int(rate * seconds)
    white = n * rate ** 0.5 * rng.standard_normal((count, 3)) * [0.9, 1.0, 1.1]
    walk = np.cumsum(k / rate ** 0.5 * rng.standard_normal((count, 3)), axis=0)
    data = white + walk + ([0, 0, 9.81] if sensor == 'accel' else [0, 0, 0])
    return ImuRecord(data if sensor == 'gyro' else None, data if sensor == 'accel' else None,
                     np.arange(count) / rate, rate, start=1.7e9, topic=f'/camera/{sensor}',
                     path='camera.mcap')


@pytest.fixture(scope='module')
def study():
    """Return a study in which N and K of all axes are well resolved."""
    gyro = sensor_record('gyro', GYRO_HZ, 2e-4, 3e-5, 1)
    accel = sensor_record('accel', ACCEL_HZ, 1.5e-3, 4e-4, 2)
    return analyse_record(replace(gyro, beside=(accel,)), effects=('white', 'random_walk'))


def truth(study, rule, inflate=1.0):
    """Return N and K of each sensor by a rule, straight from the fits."""
    out = {}
    for sensor in SENSORS:
        for parameter, label in (('N', 'white'), ('K', 'random_walk')):
            found = [s.fit.estimates[label][parameter].value * inflate
                     for t, s in study.states.items() if t.startswith(sensor)]
            out[sensor, parameter] = {
                'worst': max(found), 'mean': math.sqrt(np.mean(np.square(found))),
                'each': found}[rule]
    return out


# -- the consumers' readers

def file_storage(text):
    """Read what OpenCV's FileStorage would of a YAML file: types by how numbers are written."""
    lines = text.split('\n')
    assert re.match(r'%YAML[: ]1\.0$', lines[0])

    def scalar(word):
        if word.startswith('"'):
            return word.strip('"')
        if re.fullmatch(r'[+-]?\d+', word):
            return int(word)
        if re.fullmatch(r'[+-]?\d+(\.\d*)?([eE][+-]?\d+)?', word):
            return float(word)
        return word

    def row(word):
        return [scalar(x.strip()) for x in word.strip()[1:-1].split(',')]

    root: dict = {}
    stack = [(-1, root)]
    last = None
    for line in lines[1:]:
        line = line.split(' #')[0].rstrip() if not line.startswith('#') else ''
        if not line:
            continue
        assert '\t' not in line
        deep = len(line) - len(line.lstrip())
        word = line.strip()
        if word.startswith('- '):
            parent, name = last
            parent.setdefault(name, [])
            parent[name] = parent[name] or []
            parent[name].append(row(word[2:]))
            continue
        while stack[-1][0] >= deep:
            stack.pop()
        name, _, value = word.partition(':')
        value = value.strip()
        here = stack[-1][1]
        if value:
            here[name] = row(value) if value.startswith('[') else scalar(value)
        else:
            here[name] = {}
            stack.append((deep, here[name]))
        last = here, name
    return root


def kalibr(text):
    """ConfigReader.py: all above zero; the sample's sigma is N over sqrt(1/update_rate)."""
    d = yaml.safe_load(text)
    assert isinstance(d['rostopic'], str) and ',' not in d['rostopic'] and d['update_rate'] > 0
    dt = 1.0 / d['update_rate']
    out = {}
    for sensor, name in (('gyro', 'gyroscope'), ('accel', 'accelerometer')):
        n, k = d[f'{name}_noise_density'], d[f'{name}_random_walk']
        assert n > 0 and k > 0
        out[sensor] = (n / math.sqrt(dt)) ** 2 * dt, k ** 2
    return out


def openvins(text):
    """VioManagerOptions.h, Propagator.cpp: sigma^2/dt a sample, times dt a step; sigma_b^2 dt."""
    d = file_storage(text)['imu0']
    assert np.array(d['T_i_b']).shape == (4, 4) and d['model'] == 'kalibr'
    assert isinstance(d['update_rate'], float) and isinstance(d['rostopic'], str)
    dt, out = 1 / 200, {}
    for sensor, name in (('gyro', 'gyroscope'), ('accel', 'accelerometer')):
        n, k = d[f'{name}_noise_density'], d[f'{name}_random_walk']
        assert isinstance(n, float) and isinstance(k, float)
        out[sensor] = n ** 2 / dt * dt * dt / dt, k ** 2 * dt / dt
    return out


def vins_fusion(text):
    """integration_base.h: (dt sigma)^2 a step of white noise, (dt w)^2 of the bias."""
    d = file_storage(text)
    assert all(isinstance(d[k], float) for k in ('acc_n', 'gyr_n', 'acc_w', 'gyr_w', 'g_norm'))
    out = {}
    for sensor, name, rate in (('gyro', 'gyr', GYRO_HZ), ('accel', 'acc', ACCEL_HZ)):
        dt = 1 / rate
        out[sensor] = (dt * d[f'{name}_n']) ** 2 / dt, (dt * d[f'{name}_w']) ** 2 / dt
    return out


def orb_slam3(text):
    """Settings.cc, Tracking.cc: sigma N sf a sample, K/sf a step, sf the root of the frequency."""
    d = file_storage(text)
    assert isinstance(d['IMU.Frequency'], float)
    sf = math.sqrt(d['IMU.Frequency'])
    out = {}
    for sensor, name in (('gyro', 'Gyro'), ('accel', 'Acc')):
        n, k = d[f'IMU.Noise{name}'], d[f'IMU.{name}Walk']
        assert isinstance(n, float) and isinstance(k, float)
        dt = 1 / d['IMU.Frequency']
        out[sensor] = (n * sf * dt) ** 2 / dt, (k / sf) ** 2 / dt
    return out


def basalt(text):
    """calibration.hpp: discrete sigma is the density times sqrt(imu_update_rate), x y z."""
    d = json.loads(text)['value0']
    dt, out = 1 / d['imu_update_rate'], {}
    for sensor in SENSORS:
        n, k = (np.array(d[f'{sensor}_{what}_std']) for what in ('noise', 'bias'))
        assert n.shape == k.shape == (3,)
        out[sensor] = (n * math.sqrt(1 / dt) * dt) ** 2 / dt, k ** 2
    assert len(d['calib_accel_bias']) == 9 and len(d['calib_gyro_bias']) == 12
    return out


def lio_sam(text):
    """ROS 2 parameters: GTSAM's continuous covariances are the squares."""
    d = yaml.safe_load(text)['/**']['ros__parameters']
    assert all(isinstance(x, float) for x in d.values())
    return {'gyro': (d['imuGyrNoise'] ** 2, d['imuGyrBiasN'] ** 2),
            'accel': (d['imuAccNoise'] ** 2, d['imuAccBiasN'] ** 2)}


def fast_lio(text):
    """esekfom.hpp: dt^2 Q a step."""
    d = yaml.safe_load(text)['mapping']
    return {s: (rate * d[f'{n}_cov'] / rate ** 2, rate * d[f'b_{n}_cov'] / rate ** 2)
            for s, n, rate in (('gyro', 'gyr', GYRO_HZ), ('accel', 'acc', ACCEL_HZ))}


def gtsam(text):
    """PreintegrationParams: continuous-time covariances, times dt a step."""
    d = json.loads(text)

    def diagonal(name):
        matrix = np.array(d[name])
        assert matrix.shape == (3, 3) and np.array_equal(matrix, np.diag(np.diag(matrix)))
        return np.diag(matrix)
    return {'gyro': (diagonal('gyroscopeCovariance'), diagonal('biasOmegaCovariance')),
            'accel': (diagonal('accelerometerCovariance'), diagonal('biasAccCovariance'))}


def covariance(text):
    """sensor_msgs/Imu: nine doubles, the variance of a sample; nothing of the bias."""
    d = yaml.safe_load(text)
    out = {}
    for sensor, name, rate in (('gyro', 'angular_velocity', GYRO_HZ),
                               ('accel', 'linear_acceleration', ACCEL_HZ)):
        nine = d[f'{name}_covariance']
        assert len(nine) == 9 and all(isinstance(x, float) for x in nine)
        out[sensor] = np.diag(np.reshape(nine, (3, 3))) / rate, None
    return out


def stepped(values, names, dt):
    """Return what a filter adds in a second that squares dt p at each step."""
    return {s: tuple((dt * values[name]) ** 2 / dt for name in pair) for s, pair in names.items()}


def px4(text):
    """QGroundControl: five columns with tabs between, # for comments; EKF2 steps 10 ms."""
    values = {}
    for line in text.splitlines():
        if not line.startswith('#'):
            vehicle, component, name, value, kind = line.split('\t')
            assert (vehicle, component, kind) == ('1', '1', '9') and len(name) <= 16
            values[name] = float(value)
    return stepped(values, {'gyro': ('EKF2_GYR_NOISE', 'EKF2_GYR_B_NOISE'),
                            'accel': ('EKF2_ACC_NOISE', 'EKF2_ACC_B_NOISE')}, 0.01)


def ardupilot(text):
    """mavparm.py: two words a line, commas as blanks, # for comments; EKF3 steps 12 ms."""
    values = {}
    for line in text.splitlines():
        if line.strip() and not line.startswith('#'):
            name, value = line.replace(',', ' ').split()
            assert len(name) <= 16
            values[name] = float(value)
    return stepped(values, {'gyro': ('EK3_GYRO_P_NSE', 'EK3_GBIAS_P_NSE'),
                            'accel': ('EK3_ACC_P_NSE', 'EK3_ABIAS_P_NSE')}, 0.012)


def sdf(text):
    """GaussianNoiseModel.cc: stddev a sample; the bias steps by -s^2 tau/2 expm1(-2 dt/tau)."""
    root = ElementTree.fromstring(text)
    assert root.tag == 'imu'
    out = {}
    for sensor, name, rate in (('gyro', 'angular_velocity', GYRO_HZ),
                               ('accel', 'linear_acceleration', ACCEL_HZ)):
        found = []
        for axis in 'xyz':
            noise = root.find(f'{name}/{axis}/noise')
            assert noise.get('type') == 'gaussian'
            v = {e.tag: float(e.text) for e in noise}
            s, tau, dt = v['dynamic_bias_stddev'], v['dynamic_bias_correlation_time'], 1 / rate
            found.append(((v['stddev'] * dt) ** 2 / dt,
                          -s ** 2 * tau / 2 * math.expm1(-2 * dt / tau) / dt))
        out[sensor] = tuple(np.array(found).T)
    return out


def kalman(text):
    """Blocks of a state space: what R and Q add in a second, axis by axis."""
    d = json.loads(text)['axes']
    out = {}
    for sensor in SENSORS:
        found = []
        for axis in 'xyz':
            a = d[f'{sensor}_{axis}']
            (walk,) = a['blocks']
            assert walk['Phi'] == [[1.0]] and walk['H'] == [[1.0]] and a['without'] == []
            found.append((a['R'][0][0] * a['dt'], walk['Q'][0][0] / a['dt']))
        out[sensor] = tuple(np.array(found).T)
    return out


READERS = {f.__name__: f for f in (
    kalibr, openvins, vins_fusion, orb_slam3, basalt, lio_sam, fast_lio, gtsam, covariance, px4,
    ardupilot, sdf, kalman)}
OF_EACH = {'basalt', 'gtsam', 'covariance', 'sdf', 'kalman'}        # hold x, y and z


def test_the_page_of_formats_is_that_of_the_formats():
    """Else: python doc/exports_table.py --write; each names its consumer's files and lines."""
    script = runpy.run_path(str(Path(__file__).parents[1] / 'doc' / 'exports_table.py'))
    assert script['PAGE'].read_text(encoding='utf-8') == script['page']()
    for name in export.formats():
        module = export.module(name)
        if name == 'kalman':
            continue
        for file, where, commit in module.PLACES:
            assert '.' in file and where and re.fullmatch('[0-9a-f]{10}', commit), name
            assert Path(file).name in module.__doc__, (name, file)
        assert module.CONSUMER.split('/')[1] in module.__doc__, name


def test_every_format_has_a_reader_and_a_line():
    assert set(export.formats()) == set(READERS) | {'dlio'}
    for name, line in export.descriptions().items():
        assert 10 < len(line) < 90 and '\n' not in line, name


@pytest.mark.parametrize('inflate', [1.0, 2.0])
@pytest.mark.parametrize('name', sorted(READERS))
def test_a_second_of_the_filter_is_a_second_of_the_sensor(study, name, inflate):
    """N^2 and K^2, whatever is in the file: density, sigma of a sample or variance."""
    rule = 'each' if name == 'kalman' else 'worst'
    wanted = truth(study, rule, inflate)
    found = READERS[name](export.export(study, name, inflate=inflate))
    for sensor in SENSORS:
        white, walk = found[sensor]
        np.testing.assert_allclose(white, np.square(wanted[sensor, 'N']), rtol=2e-6)
        if walk is not None:
            # a correlation time of an hour takes some of the walk of the bias away
            np.testing.assert_allclose(walk, np.square(wanted[sensor, 'K']), rtol=1e-5)


@pytest.mark.parametrize('name', sorted(READERS))
def test_rules_for_the_axes(study, name):
    """The mean is the rms; each axis where the consumer holds three, else refused."""
    if name == 'kalman':
        with pytest.raises(UsageError, match='each axis'):
            export.export(study, name, axes='mean')
        return
    wanted = truth(study, 'mean')
    found = READERS[name](export.export(study, name, axes='mean'))
    for sensor in SENSORS:
        np.testing.assert_allclose(found[sensor][0], wanted[sensor, 'N'] ** 2, rtol=2e-6)
    if name not in OF_EACH:
        with pytest.raises(UsageError, match='one value per sensor'):
            export.export(study, name, axes='each')
        return
    wanted = truth(study, 'each')
    found = READERS[name](export.export(study, name, axes='each'))
    for sensor in SENSORS:
        np.testing.assert_allclose(found[sensor][0], np.square(wanted[sensor, 'N']), rtol=2e-6)


@pytest.mark.parametrize('name', sorted(READERS))
def test_a_horizon_is_covered_or_refused(study, name):
    """What is written covers the measured deviation up to the horizon."""
    if name == 'kalman':
        with pytest.raises(UsageError, match='--horizon'):
            export.export(study, name, horizon=30.0)
        return
    found = READERS[name](export.export(study, name, horizon=30.0))
    for sensor in SENSORS:
        white, walk = (None if x is None else np.max(x) for x in found[sensor])
        if walk is None:
            continue
        for target, state in study.states.items():
            if target.startswith(sensor):
                c = state.problem.evidence.curve
                some = c.tau <= 30
                model = white / c.tau[some] + walk * c.tau[some] / 3
                assert np.all(model > 0.999 * c.dev[some] ** 2)


@pytest.mark.parametrize('name', sorted(READERS))
def test_a_file_says_where_it_is_from(study, name):
    """Source, samples, the rates of both sensors, the interval and the convention."""
    text = export.export(study, name)
    assert 'camera.mcap' in text
    assert '120000 samples' in text and '63 Hz' in text and '200 Hz' in text and '10 min' in text
    e = study.states['gyro_x'].fit.estimates['white']['N']
    assert f'[{e.ci95[0]:.3g}, {e.ci95[1]:.3g}]' in text


@pytest.mark.parametrize('name', sorted(READERS))
def test_a_unit_that_is_doubted_is_said_in_the_file(study, name):
    """The file is passed on, the terminal's warning is not; it comes before any number."""
    doubted = copy(study)
    said = ('gyro: wrong unit suspected: the gyro reads 5 rad/s', '3 sample(s) not finite')
    doubted.source = {**study.source, 'warnings': list(said)}
    text = export.export(doubted, name)
    assert f'WARNING: {said[0]}' in '\n'.join(text.splitlines()[:4])
    assert said[1] not in text and 'WARNING' not in export.export(study, name)
    assert export._heading(text) == export._heading(export.export(study, name))


def test_what_a_record_does_not_show_is_not_said_to_be_left_out(study):
    """It stays below a limit, which the file tells; what is there is not in N and K."""
    for value, upper, said, other in ((None, 2e-5, 'Not observable in this record: gyro_x: ',
                                       'Not in N and K'),
                                      (2e-5, None, 'Not in N and K: gyro_x: flicker',
                                       'Not observable')):
        state = study.states['gyro_x']
        flicker = Estimate(value, None, None, 'rad/s', upper95=upper, point=1e-5)
        effect = registry('noise')['flicker']({'B': 1e-5})
        fit = replace(state.fit, estimates={**state.fit.estimates, 'flicker': {'B': flicker}},
                      model=Model([*state.model, effect]))
        one = copy(study)
        one.states = {'gyro_x': replace(state, fit=fit)}
        text = export.export(one, 'kalibr')
        assert said in text and other not in text
        assert (value is not None) or 'flicker (B below 4.13 deg/h)' in text


def test_a_horizon_claims_no_more_than_the_record_shows(study):
    """Beyond its longest averaging time nothing is covered, whatever is asked for."""
    text = export.export(study, 'kalibr', horizon=1e9)
    said = next(x for x in text.splitlines() if 'Chosen' in x)
    reach = min(float(c.tau[c.edf > 3][-1]) for c in (
        s.problem.evidence.curve for s in study.states.values()))
    assert f'up to {reach:.3g} s: the record shows nothing longer' in said
    assert 'up to 30 s\n' in export.export(study, 'kalibr', horizon=30.0)


def test_of_a_population_it_is_said_and_the_topic_is_not_made_up():
    """Values of no record: who states them, and that the topic is not known."""
    values = {'gyro_x': {('white', 'N'): 1e-4, ('random_walk', 'K'): 1e-6}}
    one = Sheet('f: population of m', 'a fleet', 100.0, values, ('covers 95 % of units',)).study()
    text = export.export(one, 'kalibr')
    assert 'values stated by a fleet' in text and '# covers 95 % of units' in text
    assert 'samples' not in text and "rostopic: '/imu0'   # not known here" in text
    assert yaml.safe_load(text)['rostopic'] == '/imu0'


def test_the_rule_that_is_written_is_the_rule(study):
    """The mean of the axes is their rms, and said to be."""
    assert 'rms of the axes' in export.export(study, 'kalibr', axes='mean')


# -- calibrations

S_ACCEL = np.array([[1.02, 0.004, -0.006], [0.01, 0.99, 0.003], [-0.008, 0.005, 1.01]])
S_GYRO = np.array([[0.98, -0.01, 0.002], [0.006, 1.03, 0.007], [0.003, -0.004, 1.0]])
B_ACCEL, B_GYRO = np.array([0.1, -0.2, 0.05]), np.array([0.01, 0.02, -0.015])


@pytest.fixture
def calibrated(tmp_path):
    """Return a folder with a calibration of both sensors."""
    folder = tmp_path / 'calibration'
    folder.mkdir()
    (folder / 'calibration.yaml').write_text(yaml.safe_dump({
        'accel': {'S': S_ACCEL.tolist(), 'bias': B_ACCEL.tolist()},
        'gyro': {'S': S_GYRO.tolist(), 'bias': B_GYRO.tolist()}}))
    return folder


def turned(matrix):
    """Assert that a matrix is a rotation; return it."""
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-6)
    assert np.linalg.det(matrix) > 0
    return matrix


def test_openvins_corrects_as_the_calibration(study, calibrated):
    """Its model kalibr: raw = Ta x, raw = Tw R_IMUtoGYRO w, lower triangles, one frame."""
    d = file_storage(export.export(study, 'openvins', calibration=calibrated))['imu0']
    ta, tw, rg = (np.array(d[k], float) for k in ('Ta', 'Tw', 'R_IMUtoGYRO'))
    for t in (ta, tw):
        assert np.allclose(np.triu(t, 1), 0, atol=1e-9)
        assert np.allclose(np.triu(np.linalg.inv(t), 1), 0, atol=1e-9)
    frame = turned(np.linalg.inv(ta) @ S_ACCEL)
    np.testing.assert_allclose(tw @ turned(rg) @ frame, S_GYRO, atol=1e-6)
    assert np.degrees(np.arccos((np.trace(frame) - 1) / 2)) < 2


def test_dlio_corrects_as_the_calibration(study, calibrated):
    d = yaml.safe_load(export.export(study, 'dlio', calibration=calibrated))
    accel = d['dlio']['imu']['intrinsics']['accel']
    x = np.array([0.3, -9.7, 1.2])
    corrected = np.reshape(accel['sm'], (3, 3)) @ (S_ACCEL @ x + B_ACCEL) - accel['bias']
    np.testing.assert_allclose(corrected, x, atol=1e-5)
    with pytest.raises(UsageError, match='--calibration'):
        export.export(study, 'dlio')


def test_basalt_corrects_as_the_calibration(study, calibrated):
    """Its model: raw + scale raw - bias, the accelerometer's scale lower triangular."""
    d = json.loads(export.export(study, 'basalt', calibration=calibrated))['value0']
    a, g = d['calib_accel_bias'], d['calib_gyro_bias']
    scale = np.array([[a[3], 0, 0], [a[4], a[6], 0], [a[5], a[7], a[8]]])
    x = np.array([0.3, -9.7, 1.2])
    raw = S_ACCEL @ x + B_ACCEL
    frame = turned((np.eye(3) + scale) @ S_ACCEL)
    np.testing.assert_allclose(raw + scale @ raw - a[:3], frame @ x, atol=1e-9)
    raw = S_GYRO @ x + B_GYRO
    columns = np.reshape(g[3:], (3, 3)).T
    np.testing.assert_allclose(raw + columns @ raw - g[:3], frame @ x, atol=1e-9)


def test_a_calibration_is_refused_where_it_has_no_place(study, calibrated, tmp_path):
    for name in export.formats():
        if name in ('openvins', 'dlio', 'basalt'):
            with pytest.raises(InputError, match='nowhere'):
                export.export(study, name, calibration='/nowhere')
        else:
            with pytest.raises(UsageError, match='has no place.*basalt, dlio, openvins'):
                export.export(study, name, calibration=calibrated)
    (tmp_path / 'calibration.yaml').write_text('accel: {S: [[1, 0, 0]], bias: [0, 0, 0]}')
    with pytest.raises(InputError, match='not a calibration'):
        export.export(study, 'dlio', calibration=tmp_path)


def test_what_px4_does_not_allow_is_said(study):
    text = export.export(study, 'px4', inflate=1e4)
    values = {x.split('\t')[2]: float(x.split('\t')[3]) for x in text.splitlines()
              if not x.startswith('#')}
    assert values['EKF2_GYR_NOISE'] == 0.1 and values['EKF2_ACC_NOISE'] == 1.0
    assert 'EKF2_GYR_NOISE would be' in text


def test_of_an_output_coarser_than_its_noise_n_is_that_in_motion():
    """At rest in the middle of a step it has little of the noise that it has when it moves."""
    rng = np.random.default_rng(8)
    n, rate, step = 30_000, 100.0, 0.15
    accel = 0.2 * step * rng.standard_normal((n, 3))
    study = analyse_record(ImuRecord(1e-3 * rng.standard_normal((n, 3)),
                                     step * np.round(accel / step), np.arange(n) / rate, rate),
                           axes=('gyro_x', 'accel_x', 'accel_y', 'accel_z'))
    written = np.sqrt(kalibr(export.export(study, 'kalibr'))['accel'][0])
    fitted = max(s.fit.estimates['white']['N'].value for a, s in study.states.items()
                 if 'accel' in a)
    true = step * np.sqrt((0.2**2 + 1 / 12) / rate)
    assert fitted < 0.5 * true < 0.98 * true < written < 1.3 * true
    assert 'written is what it is in motion' in export.export(study, 'kalibr')


def test_a_study_without_an_accelerometer(study):
    """A format that needs both says so; a covariance is marked as not measured."""
    alone = type(study)('noise', {t: s for t, s in study.states.items() if 'gyro' in t},
                        study.source)
    with pytest.raises(InputError, match='no accelerometer'):
        export.export(alone, 'orb_slam3')
    d = yaml.safe_load(export.export(alone, 'covariance'))
    assert d['linear_acceleration_covariance'][0] == -1.0


@pytest.mark.parametrize('e, value, said', [
    (Estimate(2.0, 0.1, (1.8, 2.2)), 2.0, '2 [1.8, 2.2]'),
    (Estimate(2.0, 0.1, (1.8, 2.2)), 2.5, '2.5 (fitted [1.8, 2.2])'),
    (Estimate(None, None, (0.0, 2.2), upper95=2.1), 2.1, 'below 2.1'),
    (Estimate(None, None, (0.0, 2.2), upper95=2.1), 8.0, '8 (fitted [0, 2.2])'),
    (None, 2.0, '2')])
def test_an_interval_beside_a_value_that_covers_the_curve_is_the_fits(e, value, said):
    """Where the model fails the value written is none of the fit; a limit is no value at all."""
    assert _stated(e, value) == said


@pytest.mark.parametrize('name', [n for n in export.formats() if n != 'dlio'])
def test_an_export_knows_its_own(name, study, tmp_path):
    """One of other numbers is replaced, one of another format is not."""
    path, other = tmp_path / 'imu', 'kalibr' if name != 'kalibr' else 'px4'
    export.write(path, export.export(study, name))
    export.write(path, export.export(study, name, inflate=2.0))
    with pytest.raises(InputError, match='exists.*--force'):
        export.write(path, export.export(study, other))
    export.write(path, export.export(study, other), force=True)
    assert path.read_text() == export.export(study, other)
