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
import shutil
import signal
import subprocess
import sys

from calibration_sessions import Device, faces, stream
import numpy as np
import pytest
import yaml

from imu_noise_tools.cli.main import main

COMMAND = Path(sys.executable).with_name('imu_noise')


def run(*args, status=0):
    """Run the installed command; return what it prints."""
    done = subprocess.run([str(COMMAND), *map(str, args)], capture_output=True, text=True,
                          timeout=300, env={**os.environ, 'OPENBLAS_NUM_THREADS': '1'})
    assert done.returncode == status, f'{args}: exit {done.returncode}\n{done.stderr[-500:]}'
    return done.stdout


def noise_study(folder, *options):
    """Return the study of two noisy axes, one with a line at 17.3 Hz."""
    n, dt = 10_000, 0.01
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
    """Return the study of a filter in sway, of one axis: each is filtered by itself."""
    n, dt = 1500, 0.01
    t = np.arange(n) * dt
    gyro = 0.01 * np.random.default_rng(3).standard_normal((n, 3)) * [1, 0, 0]
    gyro[:, 0] += 0.3 * np.sin(0.8 * np.pi * t)
    np.savez(folder / 'sway.npz', gyro=gyro, t=t)
    run('filter', folder / 'sway.npz', '-o', folder / 'filtered.npz', *options)
    return folder / 'filtered.npz.study'


@pytest.fixture(scope='module')
def analysed(tmp_path_factory):
    """Return the noise study, made once: to be looked at, and copied by who changes it."""
    return noise_study(tmp_path_factory.mktemp('noise'))


STUDIES = {'noise': (noise_study, 'sinusoid', 'gyro_x'),
           'calibration': (calibration_study, 'quadratic', 'accel'),
           'filter': (filter_study, 'angular_acceleration', 'gyro_x')}


@pytest.mark.thorough       # every day in one process: test_calibration_session.py, test_study.py
@pytest.mark.parametrize('domain', STUDIES)
def test_the_ladder(domain, tmp_path):
    make, name, target = STUDIES[domain]
    study = make(tmp_path)
    assert target in json.loads(run('compare', study, '--json'))['targets']
    if domain == 'noise':       # the words are those of test_report.py
        assert target in run('compare', study)
    found = json.loads(run('diagnose', study, '--json'))['diagnosis']
    assert found[target]['verdict'] in ('missing', 'complete', 'unknown', 'undecidable')
    before = len(yaml.safe_load((study / 'study.yaml').read_text())['history'])
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
    if domain == 'noise':
        assert name in run('history', study)
        run('add', study, 'no_such_effect', status=2)
    if domain == 'calibration':         # of a gyroscope, and this is an accelerometer
        run('add', study, 'g_sensitivity', status=1)


@pytest.mark.thorough
def test_all_that_was_found_is_added_at_once(tmp_path):
    """A line and a step of the bias: one rung with both, and nothing is left."""
    n, dt = 20_000, 0.01
    t = np.arange(n) * dt
    gyro = 1e-3 * np.random.default_rng(4).standard_normal((n, 3))
    gyro[:, 0] += 5e-4 * np.sin(2 * np.pi * 17.3 * t) + 5e-4 * (t > 83)
    np.savez(tmp_path / 'still.npz', gyro=gyro, t=t)
    study = tmp_path / 'study'
    run('analyse', tmp_path / 'still.npz', '-o', study, '--axes', 'gyro_x', '--effects', 'white')
    found = json.loads(run('diagnose', study, '--json'))['diagnosis']['gyro_x']['found']
    names = [f['effect'] for f in found]
    assert set(names) == {'sinusoid', 'step'}
    (step,) = json.loads(run('add', study, '--all', '--json'))['history']
    assert step['added'] == '+'.join(names) and step['fall'] > 0
    data = yaml.safe_load((study / 'study.yaml').read_text())
    assert set(data['targets']['gyro_x']['effects']) == {'white', *names}
    assert data['diagnosis']['gyro_x']['found'] == []


HARMFUL = '''
from dataclasses import replace
import numpy as np
from imu_noise_tools.loop import study
from imu_noise_tools.loop.effect import Finding, Parameter
from imu_noise_tools.noise import Spectrum


class Harmful(Spectrum):
    """White noise a thousand times as large as there is."""

    name = 'harmful'
    symbol, title, equation, signature = 'S', 'harmful', '2 S^2', 'none'
    parameters = (Parameter('S', '{rate}/sqrt(Hz)', 0.1, 0.2, amplitude=True, title='S'),)

    def psd(self, f, dt):
        return np.full(np.shape(f), 2 * self['S'] ** 2)

    def starts(self, evidence):
        return [self.with_values(S=0.1)]


diagnose = study.diagnose


def sure(state, tried=()):
    """Find it whatever the record says."""
    found = () if 'harmful' in state.model.labels else (Finding('harmful', 1e3, Harmful()),)
    return replace(diagnose(state), verdict='missing', found=found)


study.diagnose = sure
'''


@pytest.mark.thorough
def test_a_rung_that_raises_the_error_is_taken_back(tmp_path, analysed):
    """Even a diagnosis that is sure of what does harm leaves the model as it was."""
    study = shutil.copytree(analysed, tmp_path / 'study')
    before = yaml.safe_load((study / 'study.yaml').read_text())['targets']
    own = tmp_path / 'harmful.py'
    own.write_text(HARMFUL)
    run('diagnose', study, '--until-complete', '--effects-from', own)
    data = yaml.safe_load((study / 'study.yaml').read_text())
    for target, entry in before.items():
        steps = [s for s in data['history'] if s['target'] == target]
        assert [s.get('added') for s in steps] == [None, 'harmful', None]
        assert [s.get('removed') for s in steps] == [None, None, 'harmful']
        assert steps[1]['fall'] < 0 < steps[2]['fall']
        assert data['targets'][target]['effects'] == entry['effects']
        assert data['targets'][target]['error'] == entry['error']


STOPPED = '''
import os
import signal
import sys
from imu_noise_tools.cli.main import main
from imu_noise_tools.loop import study

# a job that a shell began in the background ignores it
signal.signal(signal.SIGINT, signal.default_int_handler)
diagnose, first = study.diagnose, []


def stopped(state, tried=()):
    """Stop the process where the second target is begun."""
    first.append(state.problem)
    if state.problem is not first[0]:
        os.kill(os.getpid(), int(sys.argv[1]))
    return diagnose(state, tried)


study.diagnose = stopped
sys.exit(main(['diagnose', sys.argv[2], '--until-complete']))
'''


@pytest.mark.parametrize('number', [
    signal.SIGKILL, *(pytest.param(n, marks=pytest.mark.thorough)
                      for n in (signal.SIGTERM, signal.SIGINT))])
def test_what_a_stopped_command_had_done_is_kept(tmp_path, analysed, number):
    """The same command goes on from there, and ends where one that was not stopped does."""
    study = shutil.copytree(analysed, tmp_path / 'study')
    status = -number if number == signal.SIGKILL else 128 + number
    done = subprocess.run([sys.executable, '-c', STOPPED, str(int(number)), str(study)],
                          capture_output=True, timeout=300)
    assert done.returncode == status, done.stderr.decode()[-500:]
    kept = yaml.safe_load((study / 'study.yaml').read_text())
    assert kept['diagnosis']['gyro_x']['found'] == [] and 'gyro_y' not in kept['diagnosis']
    assert 'sinusoid' in kept['targets']['gyro_x']['effects']
    assert not [p for p in study.iterdir() if p.name.startswith('.')], 'nothing half written'
    said = run('diagnose', study, '--until-complete')
    assert said.startswith('kept from before: gyro_x (')
    whole = shutil.copytree(analysed, tmp_path / 'whole')
    assert 'kept' not in run('diagnose', whole, '--until-complete')
    assert (study / 'study.yaml').read_text() == (whole / 'study.yaml').read_text()
    assert (study / 'allan.csv').read_text() == (whole / 'allan.csv').read_text()


OWN = '''
import numpy as np
from imu_noise_tools.loop.effect import Estimate, Finding, Parameter
from imu_noise_tools.noise import Defect


class Alternating(Defect):
    """Every other sample is off by as much as the one before, the other way."""

    name = 'alternating'
    symbol, title, equation, signature = 'size', 'alternating', 'y + (-1)^k size', 'even and odd'
    parameters = (Parameter('size', '{rate}', 1e-9, 1.0, amplitude=True, title='size'),)
    views = ('frequency',)

    @classmethod
    def statistics(cls, y, inputs):
        return {'odd': np.array([np.mean(y[::2]) - np.mean(y[1::2]), np.var(y) / len(y)])}

    def find(self, evidence):
        kept = evidence.kept(self.name)
        if not kept:
            return None
        size, variance = abs(float(kept['odd'][0])) / 2, float(kept['odd'][1])
        return Finding(self.name, size ** 2 / variance / 2, self.with_values(size=size),
                       {'size': Estimate(size, variance ** 0.5, None)}, view='frequency',
                       evidence='even and odd samples differ')
'''


@pytest.mark.thorough
def test_an_effect_of_ones_own_looks_at_the_recording(tmp_path):
    """Given after the analysis, it has seen no sample: with the recording it has."""
    gyro = 1e-3 * np.random.default_rng(1).standard_normal((5_000, 3))
    gyro[:, 0] += 3e-4 * (-1.0) ** np.arange(5_000)
    np.savez(tmp_path / 'still.npz', gyro=gyro, t=np.arange(5_000) * 0.01)
    study = tmp_path / 'study'
    run('analyse', tmp_path / 'still.npz', '-o', study, '--axes', 'gyro_x', '--effects', 'white')
    own = tmp_path / 'own.py'
    own.write_text(OWN)

    def seen(*options):
        said = json.loads(run('diagnose', study, '--json', '--effects-from', own, *options))
        return [f['effect'] for d in said['diagnosis'].values() for f in d['ranked']]

    assert 'alternating' not in seen()
    assert 'alternating' in seen('--bag', tmp_path / 'still.npz')
    assert 'alternating' in seen(), 'what it saw is kept'
    steps = json.loads(run('add', study, 'alternating', '--effects-from', own, '--json'))
    assert {s['added'] for s in steps['history']} == {'alternating'}
    for command in ('compare', 'history'):
        run(command, study, '--effects-from', own)
    run('compare', study, status=1)     # it is in the model, and nobody says what it is
    run('export', study, '--effects-from', own, '--format', 'kalibr', '-o', tmp_path / 'imu.yaml')
    run('remove', study, 'alternating', '--effects-from', own)
    run('compare', study)
    np.savez(tmp_path / 'other.npz', gyro=2e-3 * np.random.default_rng(0).standard_normal(
        (9000, 3)), t=np.arange(9000) * 0.01)
    run('diagnose', study, '--bag', tmp_path / 'other.npz', status=1)


def test_what_is_exported_of_a_study(tmp_path, analysed):
    run('export', analysed, '--format', 'kalibr', '-o', tmp_path / 'imu.yaml')
    assert yaml.safe_load((tmp_path / 'imu.yaml').read_text())['gyroscope_noise_density'] > 0


def test_an_export_replaces_nothing_but_an_export(tmp_path, analysed, capsys):
    """Whatever else is there stays, a study first of all; a script may run again."""
    mine, study = tmp_path / 'mine.csv', analysed / 'study.yaml'
    mine.write_text('t,gyro_x\n' + '0.01,0.125,0.25,0.375,0.5\n' * 3)
    for path in (mine, study):
        before = path.read_bytes()
        assert main(['export', str(analysed), '--format', 'kalibr', '-o', str(path)]) == 1
        said = capsys.readouterr().err
        assert f'{path}: the file exists' in said and '--force' in said
        assert path.read_bytes() == before
    kalibr = ['export', str(analysed), '-o', str(mine), '--format', 'kalibr']
    assert main([*kalibr, '--force']) == 0
    before = mine.read_text()
    assert main([*kalibr, '--inflate', '2']) == 0
    assert mine.read_text() != before
    assert main([*kalibr[:-1], 'openvins']) == 1


def test_formats_are_listed(capsys):
    """Every format with what it holds; else a study, a format and a file are needed."""
    listed = json.loads(run('export', '--list', '--json'))['formats']
    assert {'kalibr', 'kalman'} <= set(listed) and all(listed.values())
    assert main(['export', '--list']) == 0
    lines = capsys.readouterr().out.splitlines()
    assert all(any(name in line for line in lines) for name in listed)
    for words in ((), ('study', '-o', 'x', '--format', 'no_such_format')):
        assert main(['export', *(words or ('--format', 'kalibr'))]) == 2


def test_effects_of_every_domain_are_listed(capsys):
    listed = json.loads(run('effects', '--json'))['effects']
    assert {e['domain'] for e in listed} == set(STUDIES)
    known = {(e['domain'], e['name']) for e in listed}
    assert known > {('noise', 'random_walk'), ('calibration', 'g_sensitivity'),
                    ('filter', 'angular_acceleration')}
    assert main(['effects', 'angular_acceleration']) == 0
    assert 'angular_acceleration' in capsys.readouterr().out
    assert main(['effects', 'filter']) == 0     # a domain: what is known in it
    of_filter = capsys.readouterr().out
    assert 'angular_acceleration' in of_filter and 'g_sensitivity' not in of_filter
