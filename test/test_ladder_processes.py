# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The installed command, each step of the loop in a process of its own, in all three domains.

A call of ``main()`` in the process of the tests finds loaded what other tests loaded; a person's
command finds nothing loaded.

"""

from __future__ import annotations

import json
import os
from pathlib import Path
import subprocess
import sys

from calibration_sessions import Device, faces, stream
import numpy as np
import pytest
import yaml

COMMAND = Path(sys.executable).with_name('imu_noise')


def run(*args, status=0):
    """Run the installed command; return what it prints."""
    done = subprocess.run([str(COMMAND), *map(str, args)], capture_output=True, text=True,
                          timeout=300, env={**os.environ, 'OPENBLAS_NUM_THREADS': '1'})
    assert done.returncode == status, f'{args}: exit {done.returncode}\n{done.stderr[-500:]}'
    return done.stdout


def noise_study(folder, *options):
    """Return the study of two noisy axes, one with a line at 17.3 Hz."""
    n, dt = 20_000, 0.01
    t = np.arange(n) * dt
    gyro = 1e-3 * np.random.default_rng(1).standard_normal((n, 3))
    gyro[:, 0] += 5e-4 * np.sin(2 * np.pi * 17.3 * t)
    np.savez(folder / 'still.npz', gyro=gyro, t=t)
    run('analyse', folder / 'still.npz', '-o', folder / 'study', '--axes', 'gyro_x,gyro_y',
        '--effects', 'white', *options)
    return folder / 'study'


def calibration_study(folder, *options):
    """Return the study of an accelerometer put down on its faces twice and on edges between."""
    rng = np.random.default_rng(2)
    edges = np.array([[a, b, c] for a in (-1, 0, 1) for b in (-1, 0, 1) for c in (-1, 0, 1)
                      if abs(a) + abs(b) + abs(c) == 2]) / np.sqrt(2)
    ups = np.vstack([faces(2)[1], edges])
    t, gyro, accel, _ = stream(Device.drawn(rng), ups, rng, rate=50.0)
    np.savez(folder / 'faces.npz', gyro=gyro, accel=accel, t=t)
    run('calibrate', folder / 'faces.npz', '-o', folder / 'study', '--tilt', '0.05', *options)
    return folder / 'study'


def filter_study(folder, *options):
    """Return the study of a filter at rest and in sway."""
    n, dt = 3000, 0.01
    t = np.arange(n) * dt
    gyro = 0.01 * np.random.default_rng(3).standard_normal((n, 3))
    gyro[:, 0] += 0.3 * np.sin(0.8 * np.pi * t)
    np.savez(folder / 'sway.npz', gyro=gyro, t=t)
    run('filter', folder / 'sway.npz', '-o', folder / 'filtered.npz', *options)
    return folder / 'filtered.npz.study'


STUDIES = {'noise': (noise_study, 'sinusoid', 'gyro_x'),
           'calibration': (calibration_study, 'quadratic', 'accel'),
           'filter': (filter_study, 'angular_acceleration', 'gyro_x')}


@pytest.mark.parametrize('domain', [
    'noise', 'calibration', pytest.param('filter', marks=pytest.mark.thorough)])
def test_the_ladder(domain, tmp_path):
    make, name, target = STUDIES[domain]
    study = make(tmp_path)
    assert target in json.loads(run('compare', study, '--json'))['targets']
    assert target in run('compare', study)
    found = json.loads(run('diagnose', study, '--json'))['diagnosis']
    assert found[target]['verdict'] in ('missing', 'complete', 'unknown', 'undecidable')
    before = len(json.loads(run('history', study, '--json'))['history'])
    # by name
    steps = json.loads(run('add', study, name, '--axis', target, '--json'))
    assert [s['added'] for s in steps['history']] == [name]
    entry = yaml.safe_load((study / 'study.yaml').read_text())['targets'][target]
    assert entry['effects'][name]['effect'] == name
    steps = json.loads(run('remove', study, name, '--axis', target, '--json'))
    assert [s['removed'] for s in steps['history']] == [name]
    # the best of the diagnosis, whatever it is: nothing may be missing
    steps = json.loads(run('add', study, '--json'))
    ladder = json.loads(run('history', study, '--json'))['history']
    assert [s.get('added') for s in ladder[before:before + 1]] == [name]
    assert [s.get('removed') for s in ladder[before + 1:before + 2]] == [name]
    assert len(ladder) == before + 2 + len(steps['history'])
    assert name in run('history', study)
    run('add', study, 'no_such_effect', status=2)
    if domain == 'calibration':         # of a gyroscope, and this is an accelerometer
        run('add', study, 'g_sensitivity', status=1)


def test_what_is_exported_of_a_study(tmp_path):
    study = noise_study(tmp_path)
    run('export', study, '--format', 'kalibr', '-o', tmp_path / 'imu.yaml')
    assert yaml.safe_load((tmp_path / 'imu.yaml').read_text())['gyroscope_noise_density'] > 0
    run('export', study, '--format', 'no_such_format', '-o', tmp_path / 'x', status=2)


def test_effects_of_every_domain_are_listed():
    listed = json.loads(run('effects', '--json'))['effects']
    assert {e['domain'] for e in listed} == set(STUDIES)
    known = {(e['domain'], e['name']) for e in listed}
    assert known > {('noise', 'random_walk'), ('calibration', 'g_sensitivity'),
                    ('filter', 'angular_acceleration')}
    for _, name, _ in STUDIES.values():
        assert name in run('effects', name)
