# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Data sheets: their units, as studies that exports take, and units of sensors that meet them."""

from __future__ import annotations

import json
import math
from pathlib import Path
import re
import subprocess
import sys

import numpy as np
from params import daily
import pytest
import yaml

from imu_noise_tools import export, sheet
from imu_noise_tools.core.errors import InputError, UsageError
from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.report import terminal
from imu_noise_tools.store import load
from imu_noise_tools.tasks import sheet as tasks
from imu_noise_tools.tasks.noise import analyse_record

DEG, G0 = math.pi / 180, 9.80665
SHEETS = sorted((Path(__file__).resolve().parents[1] / 'config' / 'sheets').glob('*.yaml'))
GIVEN = {'name': 'one', 'source': 'nowhere', 'rate_hz': 200, 'one_sided': False,
         'gyro': {'noise_density': '0.014 deg/s/sqrt(Hz)', 'allan_minimum': '8 deg/h'},
         'accel': {'noise_density': ['160 ug/sqrt(Hz)', '160 ug/sqrt(Hz)', '190 ug/sqrt(Hz)'],
                   'rate_random_walk': '1e-4 m/s^3/sqrt(Hz)'}}


def run(*words, status=0):
    """Run a command; return its standard output and error."""
    done = subprocess.run([sys.executable, '-m', 'imu_noise_tools.cli.main', *map(str, words)],
                          capture_output=True, text=True, timeout=300)
    assert done.returncode == status, (done.stdout, done.stderr)
    return done.stdout, done.stderr


@pytest.mark.parametrize('sensor, entry, text, parameter, si', [
    ('gyro', 'noise_density', '0.005 °/s/√Hz', 'N', 0.005 * DEG),
    ('gyro', 'noise_density', '3.8 mdps/√Hz', 'N', 0.0038 * DEG),
    ('gyro', 'noise_density', '0.01 dps/√(Hz)', 'N', 0.01 * DEG),
    ('gyro', 'random_walk_of_the_integral', '0.34 °/√hr', 'N', 0.34 * DEG / 60),
    ('gyro', 'random_walk_of_the_integral', '0.3 deg/sqrt(h)', 'N', 0.3 * DEG / 60),
    ('gyro', 'noise_rms', {'value': '0.1 °/s rms', 'bandwidth_hz': 50}, 'N', 0.1 * DEG / 10),
    ('gyro', 'bias_instability', '12 deg/hr', 'B', 12 * DEG / 3600),
    ('gyro', 'allan_minimum', '8 °/h', 'B', 8 * DEG / 3600 / 0.66428),
    ('gyro', 'rate_random_walk', '0.5 deg/h^1.5', 'K', 0.5 * DEG / 3600 ** 1.5),
    ('accel', 'noise_density', '150 µg/√Hz', 'N', 150e-6 * G0),
    ('accel', 'noise_density', '0.14 mg/sqrt(Hz)', 'N', 0.14e-3 * G0),
    ('accel', 'random_walk_of_the_integral', '0.037 m/s/√h', 'N', 0.037 / 60),
    ('accel', 'noise_rms', {'value': '1.4 mg rms', 'bandwidth_hz': 200}, 'N', 1.4e-3 * G0 / 20),
    ('accel', 'allan_minimum', '13 µg', 'B', 13e-6 * G0 / 0.66428),
    ('accel', 'rate_random_walk', '1e-4 m/s^3/√Hz', 'K', 1e-4),
])
def test_units_of_sheets(sensor, entry, text, parameter, si):
    found = sheet.read({'rate_hz': 100, sensor: {entry: text}}).values[f'{sensor}_y']
    (label, name), value = next(iter(found.items()))
    assert name == parameter and value == pytest.approx(si, rel=1e-4)


def test_a_one_sided_density_is_smaller_by_root_two():
    one, two, unsaid = (sheet.read({**GIVEN, **more}) for more in (
        {'one_sided': True}, {'one_sided': False}, {'one_sided': None}))
    slot = 'white', 'N'
    assert two.values['gyro_x'][slot] / one.values['gyro_x'][slot] == pytest.approx(2 ** 0.5)
    assert unsaid.values == two.values and unsaid.notes and not two.notes


@pytest.mark.parametrize('data, words', [
    ([], 'neither gyro nor accel'), ({'gyro': {}, 'rate_hz': 1}, 'is empty'),
    ({'gyro': {'noise_density': '1 deg/s/sqrt(Hz)'}}, 'no rate_hz'),
    ({'rate_hz': 100, 'gyro': {'noise': '1 deg/s'}}, "'noise'"),
    ({'rate_hz': 100, 'gyro': {'noise_density': '1 deg/s'}}, 'units are'),
    ({'rate_hz': 100, 'gyro': {'noise_density': '-1 deg/s/sqrt(Hz)'}}, 'units are'),
    ({'rate_hz': 100, 'gyro': {'noise_density': 0.01}}, 'units are'),
    ({'rate_hz': 100, 'accel': {'noise_rms': '1 mg'}}, 'bandwidth_hz'),
    ({'rate_hz': 100, 'accel': {'noise_density': ['1 mg/sqrt(Hz)'] * 2}}, 'one value or three')])
def test_what_is_no_sheet_is_refused(data, words):
    with pytest.raises(InputError) as error:
        sheet.read(data)
    assert words in str(error.value)


@pytest.mark.thorough
def test_every_export_takes_a_sheet(tmp_path):
    """N as it is; without a stated K only where a horizon gives one, B never in its place."""
    path = tmp_path / 'one.yaml'
    path.write_text(yaml.safe_dump(GIVEN))
    out, _ = run('sheet', path, '-o', tmp_path / 'study')
    assert 'gyro_x' in out
    study = load(tmp_path / 'study')
    n = 0.014 * DEG
    assert export.export(study, 'covariance')
    for name in export.formats():
        if name in ('covariance', 'dlio', 'kalman'):
            continue
        with pytest.raises(InputError, match='gives no K of the gyro.*--horizon'):
            export.export(study, name)
        assert export.export(study, name, horizon=100.0)
    data = yaml.safe_load(export.export(study, 'kalibr', horizon=100.0))
    tau = np.geomspace(0.005, 100, 200)
    model = n ** 2 / tau + (8 * DEG / 3600) ** 2
    covers = data['gyroscope_noise_density'] ** 2 / tau \
        + data['gyroscope_random_walk'] ** 2 * tau / 3
    assert np.all(covers > 0.98 * model) and np.median(covers / model) < 2
    each = yaml.safe_load(export.export(study, 'covariance', axes='each'))
    z = each['linear_acceleration_covariance'][8]
    assert z == pytest.approx((190e-6 * G0) ** 2 * 200, rel=1e-6)
    _, said = run('diagnose', tmp_path / 'study', status=1)
    assert 'no measurement' in said


def test_a_unit_beside_its_sheet(tmp_path):
    """A louder axis does not meet it, a quiet one does, by the interval; a wide one is open."""
    rng, n, rate = np.random.default_rng(4), 60000, 100.0
    sizes = [0.5, 1.5, 1.0]                 # of what the sheet states
    stated = 0.014 * DEG
    gyro = rng.standard_normal((n, 3)) * stated * np.array(sizes) * rate ** 0.5
    study = analyse_record(ImuRecord(gyro, None, np.arange(n) / rate, rate))
    path = tmp_path / 'one.yaml'
    path.write_text(yaml.safe_dump({**GIVEN, 'gyro': {'noise_density': '0.014 deg/s/sqrt(Hz)'}}))
    rows = {r['target']: r for r in tasks.against(study, path)}
    assert [rows[f'gyro_{a}']['verdict'] for a in 'xy'] == ['meets', 'does not meet']
    for axis, size in zip('xyz', sizes):
        row = rows[f'gyro_{axis}']
        assert row['ratio'] == pytest.approx(size, rel=0.02)
        assert row['ci95'][0] < row['measured'] < row['ci95'][1]
    with pytest.raises(InputError, match='nothing in it'):
        path.write_text(yaml.safe_dump({'rate_hz': 1, 'accel': GIVEN['accel']}))
        tasks.against(study, path)


@pytest.mark.thorough
def test_the_command_says_which_axes_meet(tmp_path):
    rng, n, rate = np.random.default_rng(5), 12000, 100.0
    gyro = rng.standard_normal((n, 3)) * 0.02 * DEG * rate ** 0.5
    np.savez(tmp_path / 'a.npz', gyro=gyro, t=np.arange(n) / rate)
    (tmp_path / 'one.yaml').write_text(yaml.safe_dump(GIVEN))
    run('analyse', tmp_path / 'a.npz', '-o', tmp_path / 'a')
    out, _ = run('compare', tmp_path / 'a', '--sheet', tmp_path / 'one.yaml')
    assert out.count('does not meet') == 3 and 'deg/sqrt(h)' in out
    out, _ = run('compare', tmp_path / 'a', '--sheet', tmp_path / 'one.yaml', '--json')
    found = [r for r in json.loads(out)['sheet'] if r['parameter'] == 'N']
    assert [r['verdict'] for r in found] == ['does not meet'] * 3


def test_a_checkout_near_the_root_has_its_sheets(monkeypatch):
    """As in a container: ``/ws/imu_noise_tools`` has few folders above it."""
    monkeypatch.setattr(tasks, '__file__', '/ws/imu_noise_tools/tasks/sheet.py')
    assert set(tasks.known()) <= {p.stem for p in SHEETS}


@pytest.mark.thorough
def test_ten_common_sensors_come_along():
    assert len(SHEETS) >= 10
    out, _ = run('sheet', '--list')
    for path in SHEETS:
        assert re.search(rf'^{path.stem} ', out, re.M)
    _, said = run('sheet', 'bmi88', '-o', 'x', status=1)
    assert 'did you mean bmi088?' in said
    run('sheet', 'bmi088', status=2)


@pytest.mark.parametrize('path', SHEETS, ids=lambda p: p.stem)
def test_a_sheet_that_comes_along_names_its_source_and_is_plausible(path):
    """
    A maker's document, with revision or date, and where in it.

    N of a MEMS gyroscope is 1 to 30 mdeg/s/sqrt(Hz), of an accelerometer 30 to 600 ug/sqrt(Hz);
    in-run stability 1 to 50 deg/h and 5 to 200 ug.
    """
    text = path.read_text(encoding='utf-8')
    found = tasks.load(path)
    assert re.search(r'rev\.|20\d\d', found.source), 'a revision or a date'
    assert re.search(r'table|section|page|leaflet', found.source)
    assert len([x for x in text.splitlines() if x.startswith('#')]) >= 3
    assert set(found.values) == {f'{s}_{a}' for s in ('gyro', 'accel') for a in 'xyz'}
    for axis, values in found.values.items():
        n = values['white', 'N'] * (2 ** 0.5 if 'one_sided: true' in text else 1)
        gyro = axis.startswith('gyro')
        assert (1e-3 * DEG < n < 3e-2 * DEG) if gyro else (3e-5 * G0 < n < 6e-4 * G0)
        b = values.get(('flicker', 'B'), 5 * DEG / 3600 if gyro else 2e-5 * G0)
        assert (DEG / 3600 < 0.664 * b < 50 * DEG / 3600) if gyro else 5e-6 < b / G0 < 2e-4
        assert ('random_walk', 'K') not in values, 'no maker here states one'


@pytest.mark.parametrize('path', daily(SHEETS, SHEETS[0]), ids=lambda p: p.stem)
def test_every_export_takes_a_sheet_that_comes_along(path, tmp_path):
    """Where the sheet states nothing slow, what wants a walk is refused: none is made up."""
    given = tasks.load(path)
    study = given.study(str(path))
    flicker = any(('flicker', 'B') in v for v in given.values.values())
    own = {'dlio': {'horizon': None}, 'kalman': {'horizon': None}}
    for name in export.formats():
        options = own.get(name, {'horizon': 100.0})
        if name == 'dlio':
            with pytest.raises(UsageError, match='no densities'):
                export.export(study, name, **options)
        elif flicker or name in ('covariance', 'kalman'):
            assert len(export.export(study, name, **options)) > 100
        else:
            with pytest.raises(InputError, match='states nothing slow'):
                export.export(study, name, **options)
    tasks.sheet(path, tmp_path / 'study')
    again = load(tmp_path / 'study')
    n = again.states['gyro_x'].fit.estimates['white']['N'].value
    assert n == pytest.approx(given.values['gyro_x']['white', 'N'])


def test_what_a_sheet_says_of_itself_agrees():
    """The angle random walk and the density of one sheet tell that the density is one-sided."""
    found = sheet.read({'rate_hz': 200, 'one_sided': True, 'gyro': {
        'noise_density': '0.008 deg/s/sqrt(Hz)'}}).values['gyro_x']['white', 'N']
    path = next(p for p in SHEETS if p.stem == 'adis16470')
    assert tasks.load(path).values['gyro_x']['white', 'N'] == pytest.approx(found, rel=0.01)


def test_an_error_that_nobody_measured_is_none(tmp_path):
    """In study.yaml null, in the ladder a dash; read back it is what it was."""
    one = sheet.read({'rate_hz': 100, 'gyro': {'noise_density': '0.01 deg/s/sqrt(Hz)'}}).study('s')
    for name, data in tasks.outputs(one).items():
        (tmp_path / name).write_bytes(data if isinstance(data, bytes) else data.encode())
    text = (tmp_path / 'study.yaml').read_text()
    assert '.nan' not in text and yaml.safe_load(text)['history'][0]['held_out'] is None
    again = load(tmp_path)
    assert all(math.isnan(s.held_out) and math.isnan(s.held_out_std) for s in again.history)
    shown = terminal.history(again.history)
    assert 'nan' not in shown and ' - ' in shown
