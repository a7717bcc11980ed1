# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The study behind the page: what is clicked, what is on disk, who else writes. No browser."""

from __future__ import annotations

import json
import shutil

import calibration_sessions as sessions
import explore_study
import numpy as np
import pytest

from imu_noise_tools import export, store
from imu_noise_tools.calibration import base_model, CalibrationProblem, Poses
from imu_noise_tools.calibration.poses import unit
from imu_noise_tools.cli.main import main
from imu_noise_tools.core.errors import InputError, UsageError
from imu_noise_tools.explore import jobs, panels
from imu_noise_tools.explore.figure import drawn, marked
from imu_noise_tools.explore.session import Session
from imu_noise_tools.filter import FilterProblem
from imu_noise_tools.loop.domains import DOMAINS, part
from imu_noise_tools.loop.effect import model_of
from imu_noise_tools.loop.study import assess
from imu_noise_tools.plots.panel import Stretch
from imu_noise_tools.tasks import loop as tasks

THERE = Stretch(0.9 * explore_study.LINE, 1.1 * explore_study.LINE, 'Hz')


def silent(share, what=''):
    """Say nothing."""


@pytest.fixture(scope='module')
def made(tmp_path_factory, without_pictures):
    """Return a study that nobody changes; its pictures nobody looks at."""
    with without_pictures():
        return explore_study.study(tmp_path_factory.mktemp('explore') / 'a.study')


@pytest.fixture
def folder(made, tmp_path):
    """Return a copy of it."""
    return shutil.copytree(made, tmp_path / 'a.study')


@pytest.fixture(scope='module')
def loaded(made):
    return store.load(made)


def opened(folder):
    """Yield a session of a folder."""
    s = Session(folder)
    s.begin()
    s.wait()
    assert s.study is not None, s.said
    yield s
    s.close()


@pytest.fixture
def session(folder):
    yield from opened(folder)


@pytest.fixture(scope='module')
def reading(made, tmp_path_factory):
    """Return a session for who changes nothing: each begins a process of its own."""
    yield from opened(shutil.copytree(made, tmp_path_factory.mktemp('reading') / 'a.study'))


def done(session, what, *args):
    """Do something, wait for it, and return what is said."""
    assert getattr(session, what)(*args)
    session.wait()
    return session.said


def rungs(session, target='gyro_x'):
    return [(s.added, s.removed) for s in session.study.history if s.target == target]


# --- the loop, and the study on disk

@pytest.mark.thorough
def test_what_is_clicked_is_what_the_commands_see(session, folder, capsys):
    assert done(session, 'diagnose', ['gyro_x']) is None
    assert session.study.diagnosis['gyro_x'].found[0].name == 'sinusoid'
    before = session.study.states['gyro_x'].error
    done(session, 'add', 'gyro_x')
    after = session.study.states['gyro_x'].error
    assert not before.within_chance and after.within_chance
    assert rungs(session) == [(None, None), ('sinusoid', None)]
    assert main(['history', str(folder)]) == 0
    assert 'sinusoid' in capsys.readouterr().out
    on_disk = store.load(folder)
    assert on_disk.states['gyro_x'].model.labels == session.study.states['gyro_x'].model.labels
    assert on_disk.states['gyro_x'].error.excess == pytest.approx(after.excess, rel=1e-6)
    assert (folder / 'report.html').read_text().count('sinusoid') > 3


@pytest.mark.thorough
def test_undo_goes_back_and_the_ladder_remembers(session):
    assert not session.can_undo and not session.undo()
    done(session, 'add', 'gyro_x', ['sinusoid'])
    assert session.can_undo == 'gyro_x: white + flicker + random_walk'
    done(session, 'remove', 'gyro_x', 'flicker')
    done(session, 'undo')
    assert set(session.study.states['gyro_x'].model.labels) == {
        'white', 'flicker', 'random_walk', 'sinusoid'}
    done(session, 'undo')
    assert session.study.states['gyro_x'].model.labels == ['white', 'random_walk', 'flicker']
    assert not session.can_undo
    assert rungs(session) == [(None, None), ('sinusoid', None), (None, 'flicker'),
                              ('flicker', None), (None, 'sinusoid')]


@pytest.mark.thorough
def test_two_things_at_once_are_refused(session):
    assert session.diagnose(['accel_z'])
    assert not session.add('gyro_x', ['ramp'])
    session.wait()
    assert rungs(session) == [(None, None)]


@pytest.mark.thorough
def test_what_is_stopped_leaves_everything_as_it_was(session, folder):
    seen = store.fingerprint(folder)
    assert session.complete(['gyro_x', 'accel_z'])
    session.stop()
    session.wait()
    assert session.said.kind == 'doubt' and 'nothing was changed' in session.said.text
    assert store.fingerprint(folder) == seen
    assert rungs(session) == [(None, None)]
    assert done(session, 'diagnose', ['accel_z']) is None        # and it goes on


def test_a_refusal_is_said(reading):
    assert done(reading, 'remove', 'gyro_x', 'ramp').kind == 'bad'
    assert 'unknown label ramp' in reading.said.text


# --- others at the same study

@pytest.mark.thorough
def test_what_the_command_line_does_meanwhile_is_read(session, folder):
    assert main(['add', str(folder), 'ramp', '--axis', 'accel_z']) == 0
    session.look()
    session.wait()
    assert 'changed elsewhere' in session.said.text
    assert 'ramp' in session.study.states['accel_z'].model.labels


@pytest.mark.thorough
def test_a_step_on_a_study_that_is_another_by_now_is_not_written(session, folder):
    assert main(['add', str(folder), 'ramp', '--axis', 'accel_z']) == 0
    said = done(session, 'add', 'gyro_x', ['sinusoid'])         # before anybody looked
    assert said.kind == 'doubt' and 'not kept' in said.text
    assert 'ramp' in session.study.states['accel_z'].model.labels
    assert 'sinusoid' not in store.load(folder).states['gyro_x'].model.labels
    assert done(session, 'add', 'gyro_x', ['sinusoid']) is None
    both = store.load(folder)
    assert 'sinusoid' in both.states['gyro_x'].model.labels
    assert 'ramp' in both.states['accel_z'].model.labels


@pytest.mark.thorough
def test_neither_does_a_command_overwrite_what_the_page_did(folder):
    def meanwhile(study):
        tasks.change(folder, lambda other: other.add(['ramp'], ['accel_z']))
        study.add(['sinusoid'], ['gyro_x'])

    with pytest.raises(tasks.ChangedError, match='somebody else'):
        tasks.change(folder, meanwhile)
    now = store.load(folder)
    assert 'ramp' in now.states['accel_z'].model.labels
    assert 'sinusoid' not in now.states['gyro_x'].model.labels


def test_touching_the_file_is_no_change(session, folder):
    (folder / 'study.yaml').touch()
    version = session.version
    session.look()
    session.wait()
    assert session.version == version and session.said is None


# --- what it is opened with

@pytest.mark.thorough
def test_a_recording_is_analysed_first(tmp_path):
    r = explore_study.record()
    np.savez(tmp_path / 'r.npz', t=r.t, gyro=r.gyro, accel=r.accel)
    s = Session(tmp_path / 'r.npz', options={'axes': ['gyro_x']})
    told = []
    progress = s._progress
    s._progress = lambda *said: (told.append(said), progress(*said))
    s.begin()
    s.wait()
    s.close()
    assert s.said is None and s.study.targets == ['gyro_x']
    assert (tmp_path / 'r.npz.study' / 'report.html').is_file()
    assert any(share is not None for share, _ in told)
    again = Session(tmp_path / 'r.npz')         # the study is there now
    assert again.folder == s.folder and again._bag is None


def test_a_recording_is_read_in_the_units_that_are_told(tmp_path, capsys, monkeypatch):
    """As by analyse, with the same options; what is none is refused before a page opens."""
    gyro = np.random.default_rng(3).normal(0, 0.1, (7000, 3))
    gyro[:, 1:] = 0.0                   # one axis at work, which takes a third of the time
    np.savez(tmp_path / 'r.npz', gyro=gyro)
    words = ['explore', str(tmp_path / 'r.npz'), '--no-browser', '--rate-hz', '100']

    def serve(session, *_):
        session.begin()
        session.wait()
        session.close()
    monkeypatch.setattr('imu_noise_tools.explore.server.serve', serve)
    assert main([*words, '--gyro-unit', 'deg/x']) == 2
    assert 'deg/s' in capsys.readouterr().err and not (tmp_path / 'r.npz.study').exists()
    assert main([*words, '--gyro-unit', 'deg/s']) == 0
    white = store.read(tmp_path / 'r.npz.study')['targets']['gyro_x']['effects']['white']
    assert white['N']['value'] == pytest.approx(np.radians(0.01), rel=0.1)


def test_what_cannot_be_opened_is_one_line(tmp_path, capsys, folder):
    assert main(['explore', str(tmp_path / 'no.bag'), '--no-browser']) == 1
    assert capsys.readouterr().err.startswith('imu_noise: ')
    assert main(['explore', str(folder)[:-1], '--no-browser']) == 1
    assert capsys.readouterr().err == (f'imu_noise: {str(folder)[:-1]}: no such file or folder: '
                                       f'did you mean {folder}?\n')
    text = (folder / 'study.yaml').read_text().replace('source:\n', 'source:\n  sheet: x\n', 1)
    (folder / 'study.yaml').write_text(text)
    assert main(['explore', str(folder), '--no-browser']) == 1
    assert 'data sheet' in capsys.readouterr().err


def test_a_study_of_an_older_version_is_refused_before_the_page_opens(folder, capsys):
    arrays = dict(np.load(folder / 'evidence.npz'))
    np.savez_compressed(folder / 'evidence.npz',
                        **{k: v for k, v in arrays.items() if k != 'format'})
    assert main(['explore', str(folder), '--no-browser']) == 1
    assert 'evidence of format 1, written by an older version: make it' in capsys.readouterr().err


def test_without_the_framework_the_extra_is_named(folder, capsys, monkeypatch):
    import sys
    monkeypatch.setitem(sys.modules, 'nicegui', None)
    assert main(['explore', str(folder), '--no-browser']) == 1
    err = capsys.readouterr().err
    assert err.count('\n') == 1 and 'pip install "imu_noise_tools[explore]"' in err


def test_the_studies_beside_it_are_offered(session, folder):
    shutil.copytree(folder, folder.parent / 'b.study')
    (folder.parent / 'other').mkdir()
    assert sorted(session.others().values()) == ['a.study (noise)', 'b.study (noise)']
    done(session, 'go_to', folder.parent / 'b.study')
    assert session.folder.name == 'b.study'
    with pytest.raises(InputError):
        session.go_to(folder.parent / 'other')


def test_every_format_can_be_exported(reading):
    refused = []
    for name in export.formats():
        try:
            assert len(reading.export(name)) > 20
        except UsageError as error:             # said on the page
            refused.append((name, error.remedy))
    assert all('--calibration' in remedy for _, remedy in refused) and len(refused) < 3


# --- what is looked at

@pytest.mark.parametrize('domain', DOMAINS)
def test_every_domain_says_what_there_is_to_see(domain):
    module = part('explore', domain)
    assert callable(module.by_hand) and callable(part('plots', domain).panels)


def test_a_panel_is_the_measurement_beside_the_model(loaded):
    state = loaded.states['gyro_x']
    for name, title in panels.names_of('noise', state).items():
        panel = panels.panel_of('noise', state, name)
        assert title and len(panel.x) == len(panel.pull) > 10
        assert np.all(np.isfinite(panel.pull)) and np.all(np.diff(panel.x) >= 0)
        found = json.loads(marked(drawn(panel, state.model.labels), THERE, suspect='x'))
        assert len(found['data']) >= len(panel.curves)
    curve = panels.panel_of('noise', state, 'allan')
    by_name = {c.name: c.y for c in curve.curves}
    total = sum(by_name[x] ** 2 for x in state.model.labels)
    np.testing.assert_allclose(total, by_name['model'] ** 2, rtol=1e-6)
    noise = panels.panel_of('noise', loaded.states['accel_z'], 'frequency')
    assert 0.8 < np.std(noise.pull) < 1.25      # nothing is hidden there


def test_pulls_beyond_chance_are_where_the_line_is(loaded):
    panel = panels.panel_of('noise', loaded.states['gyro_x'], 'frequency')
    bins, fails = panel.fails(THERE)
    assert fails > 10 * np.sqrt(2 * bins)
    clean = Stretch(12.0, 20.0, 'Hz')
    bins, fails = panel.fails(clean)
    assert abs(fails) < 5 * np.sqrt(2 * bins)


def test_a_stretch_that_fails_is_told_what_it_is(loaded):
    _, answer = jobs.identify(loaded, 'gyro_x', 'frequency', THERE, silent)
    near = answer.nearest
    assert near.name == 'sinusoid' and near.share > 0.95 and near.beyond_chance
    assert answer.makes[0][0] == 'white' and answer.makes[0][1] > 0.9
    assert all(c.share <= near.share or not c.beyond_chance for c in answer.candidates)


def test_where_nothing_fails_nothing_is_named(loaded):
    _, answer = jobs.identify(loaded, 'accel_z', 'allan', Stretch(0.05, 1.0, 's'), silent)
    assert answer.nearest is None and not answer.candidates
    assert sum(v for _, v in answer.makes) == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize('name', ['gauss_markov', 'sinusoid', 'ramp', 'low_pass', 'quantization'])
def test_what_is_put_in_by_hand_stands_where_it_says(loaded, name):
    state = loaded.states['accel_z']
    effect = panels.begin_by_hand('noise', state, name)
    for p in effect.parameters:
        if not p.choices:
            low, high = panels.span_of('noise', state, effect, p)
            assert low <= effect[p.name] <= high
    more = panels.with_hand(state, effect)
    assert more.model[more.model.labels[-1]] == effect
    before, after = (panels.panel_of('noise', s, 'allan') for s in (state, more))
    model = [next(c.y for c in p.curves if c.name == 'model') for p in (before, after)]
    drawn = [c for c in after.curves if c.name == name]
    assert np.max(np.abs(model[1] / model[0] - 1)) > 0.01
    assert len(drawn) == (name != 'low_pass')
    for x in state.model.labels:                    # nothing was fitted again
        assert more.model[x] == state.model[x]


@pytest.fixture(scope='module')
def posed():
    """Return the state of an accelerometer whose z has a quadratic part."""
    rng = np.random.default_rng(5)
    device = sessions.Device.drawn(rng)
    device.quadratic = (0.0, 0.0, 2e-3)
    inputs = sessions.G * unit(rng.standard_normal((3, 24)))
    poses = Poses.of('accel', device.output(inputs.T, rng).T, np.full(24, 1e-3), sessions.G,
                     None)
    return assess(CalibrationProblem(poses, 'norm'), base_model())


def test_a_calibrations_effect_put_in_by_hand_heals_what_it_explains(posed):
    assert 'quadratic' in panels.names_by_hand('calibration', posed)
    effect = panels.begin_by_hand('calibration', posed, 'quadratic')
    low, high = panels.span_of('calibration', posed, effect, effect.parameters[0])
    assert low < effect[effect.parameters[0].name] < high
    truth = effect.with_values(**{p.name: 0.0 for p in effect.parameters})
    name = next(p.name for p in effect.parameters if p.name.endswith('z'))
    fails = [panels.panel_of('calibration', state, 'poses').fails(Stretch(0, 99, 'pose'))[1]
             for state in (posed, *(panels.with_hand(posed, truth.with_values(**{name: v}))
                                    for v in (2e-3, -2e-3)))]
    assert fails[1] < 0.2 * fails[0] < fails[2]
    own = panels.panel_of('calibration', panels.with_hand(posed, effect), 'poses').curves
    assert {'scale', 'bias', 'quadratic'} <= {c.name for c in own}


@pytest.fixture(scope='module')
def filtered():
    """Return the state of a rate that sways, under the filter for constant rates."""
    rng = np.random.default_rng(3)
    t = np.arange(6000) / 100
    z = 0.3 * np.sin(2 * np.pi * 0.4 * t) + 0.01 * rng.standard_normal(len(t))
    return assess(FilterProblem(z, 0.01, stated={'white': {'R': 1e-4},
                                                 'ar_increment': {'phi': 0.1, 'q': 1e-10}}),
                  model_of('filter', ['constant_rate', 'ar_increment', 'white']))


def test_a_filters_effect_put_in_by_hand_heals_what_it_explains(filtered):
    names = panels.names_by_hand('filter', filtered)
    assert {'angular_acceleration', 'harmonic'} <= set(names) and 'any_motion' not in names
    effect = panels.begin_by_hand('filter', filtered, 'harmonic')
    for p in effect.parameters:
        low, high = panels.span_of('filter', filtered, effect, p)
        assert low <= effect[p.name] <= high
    effect = effect.with_values(tc=1e4)
    before, after = (panels.panel_of('filter', s, 'spectrum') for s in (
        filtered, panels.with_hand(filtered, effect)))
    everywhere = Stretch(0, 99, 'Hz')
    assert after.fails(everywhere)[1] < 0.5 * before.fails(everywhere)[1]
    lines = {c.name: c for c in after.curves}
    assert {'measured', 'model', 'white', 'harmonic'} <= set(lines)
    peak = lines['harmonic'].x[int(np.argmax(lines['harmonic'].y))]
    assert peak == pytest.approx(0.4, rel=0.1)
    np.testing.assert_allclose(lines['model'].y ** 2, sum(
        lines[e].y ** 2 for e in panels.with_hand(filtered, effect).model.labels), rtol=1e-9)


def test_a_line_put_in_by_hand_heals_no_other(loaded):
    state = loaded.states['gyro_x']
    line = panels.begin_by_hand('noise', state, 'sinusoid').with_values(frequency=0.5)
    before, far, near = (panels.panel_of('noise', s, 'frequency').fails(THERE)[1] for s in (
        state, panels.with_hand(state, line),
        panels.with_hand(state, line.with_values(frequency=explore_study.LINE))))
    assert far == pytest.approx(before) and near < 0.1 * before


@pytest.mark.thorough
def test_every_effect_offered_by_hand_can_be_drawn(loaded):
    state = loaded.states['accel_z']
    names = panels.names_by_hand('noise', state)
    assert len(names) > 8
    drawn = 0
    for name in names:
        try:
            effect = panels.begin_by_hand('noise', state, name)
        except InputError as error:
            assert 'does not apply' in str(error)
            continue
        for view in panels.names_of('noise', state):
            panel = panels.panel_of('noise', panels.with_hand(state, effect), view)
            assert np.all(np.isfinite(panel.pull)), (name, view)
        drawn += 1
    assert drawn > 8
