# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What somebody meets who tries the commands for the first time, as the process shows it."""

from __future__ import annotations

import json
import os
import pty
import select
import shutil
import subprocess
import sys
import time

import bad_input
import calibration_sessions as sessions
import numpy as np
from params import daily
import pytest
import yaml

from imu_noise_tools.bag.writing import write_bag
from imu_noise_tools.cli.main import main
from imu_noise_tools.core.errors import ImuNoiseError
from imu_noise_tools.tasks.simulate import simulate as simulate_bag


# Filters by one model where what a bank of them does is not asked: it takes six times as long.
ONE_MODEL = ('--motion', 'constant_rate,ar_increment')
SOME_AXES = ('--axes', 'gyro_x,gyro_y,accel_z')


def run(*words, status=0, columns=None, folder=None):
    """Run a command; return its standard output, and what it said beside."""
    env = {**os.environ, 'PYTHONPATH': str(bad_input.__file__).rpartition('/test/')[0]}
    env.pop('COLUMNS', None)
    if columns:
        env['COLUMNS'] = str(columns)
    done = subprocess.run([sys.executable, '-m', 'imu_noise_tools.cli.main', *map(str, words)],
                          capture_output=True, text=True, timeout=600, env=env, cwd=folder)
    assert done.returncode == status, (done.stdout, done.stderr)
    return done.stdout, done.stderr


@pytest.fixture
def here(capsys, monkeypatch):
    """Return a function that runs a command in this process, where no other is needed."""
    def run_(*words, status=0, columns=None):
        if columns:
            monkeypatch.setenv('COLUMNS', str(columns))
        capsys.readouterr()
        assert main([str(w) for w in words]) == status
        return capsys.readouterr()

    return run_


@pytest.fixture(scope='module')
def analysed(tmp_path_factory):
    """Return a study of 70 s, in which one sample is not finite, and what was printed."""
    folder = tmp_path_factory.mktemp('first')
    record = bad_input.still(70)
    record.gyro[100, 0] = np.nan
    np.savez(folder / 'a.npz', gyro=record.gyro, accel=record.accel, t=record.t)
    return folder / 'study', *run(
        'analyse', folder / 'a.npz', '-o', folder / 'study', *SOME_AXES)


@pytest.fixture(scope='module')
def study(analysed):
    """Return the folder of the study."""
    return analysed[0]


@pytest.mark.parametrize('arrays, words', [
    ({'gyro': np.full((500, 3), np.nan), 't': np.arange(500) / 100}, 'gyro is not a number'),
    ({'gyro': np.zeros((500, 3)), 't': np.arange(500) / 100}, 'gyro is all zero'),
    ({'accel': np.full((500, 3), np.nan), 'gyro': np.zeros((500, 3)), 'rate_hz': 100.0},
     'gyro is all zero, accel is not a number'),
    ({'gyro': np.random.default_rng(1).random((500, 3)), 't': -np.arange(500) / 100},
     'the stamps run backward'),
    ({'gyro': np.random.default_rng(1).random((500, 3)), 't': np.full(500, 7.0)},
     'the stamps do not advance'),
    ({'gyro': np.random.default_rng(1).random((500, 3))}, 'neither t nor rate_hz'),
    ({'gyro': np.random.default_rng(1).random((500, 3)), 't': np.arange(500) * 10_000_000},
     't is in s, and its stamps are 1e+07 s apart'),
])
def test_a_table_is_refused_for_what_is_so(tmp_path, here, arrays, words):
    np.savez(tmp_path / 'x.npz', **arrays)
    _, said = here('analyse', tmp_path / 'x.npz', status=1)
    assert words in said.splitlines()[-1], said


@pytest.mark.parametrize('unit, parts', [
    ('nanoseconds', 10**9), ('microseconds', 10**6), ('milliseconds', 10**3)])
def test_stamps_since_1970_are_read_in_the_unit_they_are_in(tmp_path, here, unit, parts):
    """A table that was written from a bag has them in nanoseconds."""
    r = bad_input.still(70)
    t = np.round((1_764_100_000 + r.t) * parts).astype(np.int64)
    rows = '\n'.join(','.join(map(str, (a, *b))) for a, b in zip(t, r.gyro))
    (tmp_path / 'x.csv').write_text(f't,gyro_x,gyro_y,gyro_z\n{rows}\n')
    out, said = here('inspect', tmp_path / 'x.csv')
    assert f'warning: t reads as {unit} since 1970' in said
    assert '7000 samples, 69.99 s' in out and 'rate                  100 Hz' in out


def test_an_array_of_objects_is_said(tmp_path):
    r = bad_input.still(70)
    np.savez(tmp_path / 'x.npz', gyro=r.gyro, accel=r.accel, t=r.t,
             notes=np.array([{'a': 1}, None], object))
    _, said = run('inspect', tmp_path / 'x.npz')
    assert 'warning: notes is not an array of numbers; left out' in said


@pytest.mark.parametrize('cut', daily([1, 8, 30], 8))
def test_a_cut_footer_is_said(tmp_path, here, cut):
    """All messages are read, and that the file did not end as it should is said."""
    write_bag(tmp_path / 'x.mcap', bad_input.still(70))
    data = (tmp_path / 'x.mcap').read_bytes()
    _, said = here('inspect', tmp_path / 'x.mcap')
    assert 'cut short' not in said
    (tmp_path / 'y.mcap').write_bytes(data[:-cut])
    out, said = run('inspect', tmp_path / 'y.mcap')
    assert 'cut short' in said and '7000 samples' in out


@pytest.mark.thorough
def test_what_was_doubtful_is_said_before_a_refusal(tmp_path):
    """A cut bag that is refused for another reason is still said to be cut."""
    write_bag(tmp_path / 'x.bag', bad_input.still(40))
    data = (tmp_path / 'x.bag').read_bytes()
    (tmp_path / 'y.bag').write_bytes(data[:len(data) // 2])
    _, said = run('analyse', tmp_path / 'y.bag', '--topic', '/nowhere', status=1)
    first, last = said.splitlines()
    assert first.startswith('warning:') and 'cut short' in first
    assert last.startswith('imu_noise:') and 'no topic /nowhere' in last
    moving = bad_input.still(50)
    moving.gyro[2000:3000] += 1.0
    moving.gyro[10] = np.nan
    np.savez(tmp_path / 'm.npz', gyro=moving.gyro, t=moving.t)
    _, said = run('analyse', tmp_path / 'm.npz', status=1)
    assert 'not finite' in said and 'moves' in said.splitlines()[-1], said


@pytest.mark.thorough
def test_each_warning_is_printed_once(tmp_path, analysed):
    """Also where more detail is asked for."""
    source = analysed[0].parent / 'a.npz'
    for out, said in (analysed[1:], run('analyse', source, '-o', tmp_path / 'x', '-v')):
        assert (out + said).count('not finite') == 1


@pytest.mark.thorough
def test_two_records_in_one_folder_keep_their_truths(tmp_path):
    spec = {'rate_hz': 100, 'duration_s': 20, 'targets': {'gyro_x': {'white': {'N': 1e-3}}}}
    for name, n in (('a', 1e-3), ('b', 2e-3)):
        spec['targets']['gyro_x']['white']['N'] = n
        (tmp_path / f'{name}.yaml').write_text(yaml.safe_dump(spec))
        run('simulate', tmp_path / f'{name}.yaml', '-o', tmp_path / f'{name}.mcap')
    run('simulate', tmp_path / 'a.yaml', '-o', tmp_path / 'a.mcap', '--force')
    first = yaml.safe_load((tmp_path / 'truth.yaml').read_text())
    second = yaml.safe_load((tmp_path / 'b.mcap.truth.yaml').read_text())
    assert (first['bag'], second['bag']) == ('a.mcap', 'b.mcap')
    assert '0.001' in str(first['targets']) and '0.002' in str(second['targets'])
    assert {p.name for p in tmp_path.glob('*truth.yaml')} == {'truth.yaml', 'b.mcap.truth.yaml'}


@pytest.mark.thorough
def test_an_export_goes_where_it_is_sent(tmp_path, study):
    """As JSON, to standard output, and never into a file named ``-``."""
    out, _ = run('export', study, '--format', 'kalibr', '-o', '-', folder=tmp_path)
    assert yaml.safe_load(out)['update_rate'] == 100.0
    assert not list(tmp_path.iterdir())
    answer, _ = run('export', study, '--format', 'kalibr', '-o', tmp_path / 'k.yaml', '--json')
    data = json.loads(answer)
    assert data['text'] == (tmp_path / 'k.yaml').read_text() == out
    assert data['format'] == 'kalibr'


@pytest.mark.thorough
def test_an_export_refuses_what_it_cannot_hold(tmp_path, study, capsys):
    for name, words, status, why in (
            ('kalibr', ('--calibration', '/nowhere'), 2, '--calibration'),
            ('kalibr', ('--axes', 'each'), 2, 'one value'),
            ('openvins', ('--calibration', '/nowhere'), 1, '/nowhere')):
        assert main(['export', str(study), '--format', name, '-o', str(tmp_path / 'k'),
                     *words]) == status
        assert why in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.thorough
def test_a_horizon_covers_flicker_and_says_so(study):
    plain, _ = run('export', study, '--format', 'kalibr', '-o', '-')
    wide, _ = run('export', study, '--format', 'kalibr', '-o', '-', '--horizon', '20')
    assert 'flicker' in plain and 'flicker' not in wide


@pytest.mark.parametrize('words', [('effects',), ('effects', 'flicker')])
def test_tables_fit_a_terminal(words, here):
    out, _ = here(*words, columns=80)
    assert max(len(line) for line in out.splitlines()) <= 80
    assert len(words) > 1 or len(out.splitlines()) < 120        # most effects in a line or two


@pytest.mark.parametrize('spec, name, words', [
    ({'duration': 60}, 'x', 'unknown entry duration: did you mean duration_s'),
    ({'targets': {'gyro_q': {'white': {'N': 1}}}}, 'x', 'targets: unknown axis gyro_q: did you'),
    ({'motion': {'rocking': {'axis': 'x', 'amplitude': 1}}}, 'x', 'did you mean amplitude_deg'),
    ({}, 'x.hdf5', r'written as .hdf5: choose from .mcap, .db3, .bag, .csv, .npz, or a folder')])
def test_a_simulation_that_cannot_be_is_answered_with_what_there_is(spec, name, words, tmp_path):
    whole = {'rate_hz': 100, 'duration_s': 60, 'targets': {'gyro_x': {'white': {'N': 1e-4}}}}
    with pytest.raises(ImuNoiseError, match=words):
        simulate_bag(whole | spec, tmp_path / name)
    assert not list(tmp_path.iterdir())


@pytest.mark.thorough
def test_a_comparison_fits_a_terminal(study):
    for words in ((), (study,)):
        out, _ = run('compare', study, *words, columns=80)
        assert max(len(line) for line in out.splitlines() if str(study) not in line) <= 80


@pytest.mark.parametrize('words, meant', [
    (('analise', 'x'), 'analyse'), (('exprt', 'x'), 'export'), (('calibrat', 'x'), 'calibrate'),
    (('analyse', 'x', '--method', 'slope'), 'slopes'), (('effects', 'flickr'), 'flicker'),
    (('export', 'x', '--format', 'open_vins', '-o', '-'), 'openvins'),
    (('analyse', 'x', '--axes', 'gyro_x,acel_z'), 'accel_z'),
    (('analyse', 'x', '--effects', 'white,fliker'), 'flicker'),
    (('analyse', 'x', '--deviation', 'oaddev'), 'oadev'),
    (('filter', 'x', '-o', 'y', '--motion', 'constant_rat'), 'constant_rate'),
    (('filter', 'x', '-o', 'y', '--noise', 'outlier'), 'outliers'),
    (('export', 'x', '--format', 'kalibr', '-o', '-', '--axes', 'meen'), 'mean'),
    (('calibrate', 'x', '--sensor', 'acel'), 'accel'), (('completion', 'fisch'), 'fish')])
def test_what_is_mistyped_is_answered_with_the_nearest(words, meant, capsys):
    try:
        status = main(list(words))
    except SystemExit as wrong:         # what argparse refuses
        status = wrong.code
    assert status == 2
    assert f'did you mean {meant}?' in capsys.readouterr().err


@pytest.mark.parametrize('words', [
    ('diagnose', 'x', '--axis', ','), ('add', 'x', 'ramp', '--axis', ''),
    ('analyse', 'x', '--axes', ' , '), ('analyse', 'x', '--effects', '')])
def test_a_list_that_names_nothing_is_refused(words, capsys):
    """Nothing was done, without a word; `analyse` called it a defect of its own."""
    with pytest.raises(SystemExit) as stop:
        main(list(words))
    assert stop.value.code == 2
    assert capsys.readouterr().err.splitlines()[-1].endswith(f'{words[-1]!r} names nothing')


def test_the_other_spelling_is_taken(tmp_path, here):
    """American users type analyze."""
    _, said = here('analyze', tmp_path / 'x.npz', status=1)
    assert 'no such file' in said


def test_what_a_study_has_not_is_answered_with_the_nearest(study, capsys):
    for words, meant in ((('add', study, 'sinusiod'), 'sinusoid'),
                         (('add', study, 'sinusoid', '--axis', 'gyrox'), 'gyro_x'),
                         (('diagnose', study, '--axis', 'gyro_x,accel_y'), 'accel_z'),
                         # before the bag is read
                         (('diagnose', study, '--bag', 'no.mcap', '--axis', 'gyrox'), 'gyro_x'),
                         (('remove', study, 'flickr'), 'flicker')):
        assert main([str(w) for w in words]) == 2
        assert f'did you mean {meant}?' in capsys.readouterr().err


def test_one_axis_is_diagnosed_alone(study, tmp_path):
    """By either spelling; of the others nothing is said, and nothing is known."""
    shutil.copytree(study, mine := tmp_path / 'mine')
    out, _ = run('diagnose', mine, '--axes', 'gyro_y')
    assert 'gyro_y: ' in out and 'gyro_x' not in out and 'accel_z' not in out
    said = json.loads(run('diagnose', mine, '--axis', 'accel_z,gyro_y', '--axis', 'accel_z',
                          '--until-complete', '--json')[0])
    assert list(said['diagnosis']) == ['gyro_y', 'accel_z']


@pytest.mark.thorough
def test_si_stands_beside_the_units_of_the_field(tmp_path, analysed):
    """Of every command that prints coefficients; without --si they are in the field's alone."""
    study, printed, _ = analysed
    source, mine = study.parent / 'a.npz', tmp_path / 'a'
    for words, unit, plain in (
            (('analyse', source, '-o', mine, *SOME_AXES), 'rad/s/sqrt(Hz)', printed),
            (('plan', mine), 'm/s^2/sqrt(Hz)', None),
            (('compare', mine, '--sheet', 'bmi088'), 'rad/s/sqrt(Hz)', None)):
        plain, with_si = plain or run(*words)[0], run(*words, '--si')[0]
        assert unit not in plain and unit in with_si
        assert plain.count('ug/sqrt(Hz)') == with_si.count('ug/sqrt(Hz)') > 0
    assert ' rad/s' in run('add', mine, 'gauss_markov', '--axis', 'gyro_y', '--si')[0]
    assert ' rad/s' in run('filter', source, '-o', tmp_path / 'f.npz', '--si', *ONE_MODEL)[0]


def shown_on_a_terminal(*words):
    """Return what a command prints where standard error is a terminal."""
    parent, child = pty.openpty()
    done = subprocess.Popen([sys.executable, '-m', 'imu_noise_tools.cli.main', *map(str, words)],
                            stdout=subprocess.PIPE, stderr=child)
    os.close(child)
    out, end = b'', time.monotonic() + 600
    while time.monotonic() < end:
        if select.select([parent], [], [], 0.2)[0]:
            try:
                out += os.read(parent, 65536)
            except OSError:             # the other side is closed
                break
        elif done.poll() is not None:
            break
    done.stdout.close()
    assert done.wait(60) == 0, out
    os.close(parent)
    return out.decode()


@pytest.mark.parametrize(
    'command', daily(['simulate', 'analyse', 'calibrate', 'filter'], 'analyse'))
def test_what_takes_long_shows_how_far_it_is(tmp_path, analysed, command):
    """On a terminal; not in a pipe, and not with --json."""
    (tmp_path / 'spec.yaml').write_text(yaml.safe_dump(
        {'rate_hz': 100, 'duration_s': 70, 'targets': {
            a: {'white': {'N': 1e-3}} for a in ('gyro_x', 'gyro_y', 'gyro_z')}}))
    rng = np.random.default_rng(5)
    _, ups = sessions.faces()
    t, gyro, accel, _ = sessions.stream(sessions.Device.drawn(rng), ups, rng)
    np.savez(tmp_path / 'faces.npz', t=t, gyro=gyro, accel=accel)
    # one axis at work, which is a third of the time
    np.savez(tmp_path / 'x.npz', t=np.arange(3000) / 100, gyro=np.outer(
        rng.normal(0, 1e-2, 3000), [1, 0, 0]), accel=np.tile([0, 0, 9.81], (3000, 1)))
    # a second axis shows nothing more of how far it is
    some = ('--axes', 'gyro_x') if command == 'analyse' else ()
    source = tmp_path / {'simulate': 'spec.yaml', 'calibrate': 'faces.npz', 'filter': 'x.npz',
                         'analyse': analysed[0].parent / 'a.npz'}[command]
    kind = '.npz' if command in ('simulate', 'filter') else ''
    said = shown_on_a_terminal(command, source, '-o', tmp_path / f'a{kind}', *some)
    assert '% ' in said and '[' in said and said.count('\r') > 2, said
    assert '#' in said
    said = shown_on_a_terminal(command, source, '-o', tmp_path / f'b{kind}', '--json', *some)
    assert '% ' not in said
    _, said = analysed[1:] if command == 'analyse' else run(
        command, source, '-o', tmp_path / f'c{kind}')
    assert '\r' not in said


@pytest.mark.parametrize('density, shaken, said', [
    (0.0055, 0, True), (1.2e-3, 0, False), (1e-4, 500, False), (0.0055, 500, True)])
def test_a_gyro_in_deg_s_is_suspected_by_its_noise(tmp_path, here, density, shaken, said):
    """
    0.0055 deg/s/sqrt(Hz) is a good sensor, and in rad/s none is so bad; nor is a truck.

    A machine may shake it (deg/s at 50 Hz) as it likes.

    """
    r = bad_input.still(70)
    noise = density * np.sqrt(r.rate_hz) * np.random.default_rng(3).standard_normal((r.n, 3))
    noise += np.radians(shaken) * np.sin(2 * np.pi * 50.3 * r.t)[:, None] * [1, 0.5, 0.2]
    np.savez(tmp_path / 'x.npz', gyro=noise + 0.05, accel=r.accel, t=r.t)
    out, _ = here('inspect', tmp_path / 'x.npz')
    assert ('if it is in deg/s, use --gyro-unit deg/s' in ' '.join(out.split())) == said
