# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The package from Python: what the page about it shows, the same numbers as the commands'."""

from __future__ import annotations

import contextlib
import io
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys

import calibration_sessions as sessions
import numpy as np
import pytest
import yaml

import imu_noise_tools as imu
from imu_noise_tools.bag import write_bag

ROOT = Path(__file__).resolve().parents[1]
SPEC = {'rate_hz': 100, 'duration_s': 200, 'seed': 11, 'targets': {
    a: {'white': {'N': 8.7e-5}, 'flicker': {'B': 2.4e-5}} for a in ('gyro_x', 'gyro_y', 'gyro_z')}}
SPEC['targets']['gyro_x'] = {**SPEC['targets']['gyro_x'],
                             'sinusoid': {'amplitude': 1.5e-4, 'frequency': 23.4}}
SPEC['targets'].update({a: {'white': {'N': 1e-3}} for a in ('accel_x', 'accel_y', 'accel_z')})


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    """Return a folder with the recordings that the page names."""
    folder = tmp_path_factory.mktemp('python')
    write_bag(folder / 'still.bag', imu.simulate(SPEC))
    rng = np.random.default_rng(5)
    _, ups = sessions.faces()
    t, gyro, accel, _ = sessions.stream(sessions.Device.drawn(rng), ups, rng)
    np.savez(folder / 'six_faces.npz', t=t, gyro=gyro, accel=accel)
    shutil.copytree(ROOT / 'config', folder / 'config')
    return folder


@pytest.fixture(scope='module')
def study(folder):
    """Return the study of a record with a line hidden in gyro_x."""
    return imu.analyse(folder / 'still.bag')


def blocks(path):
    """Return the Python examples of a page."""
    return re.findall(r'^```python\n(.*?)^```', path.read_text(encoding='utf-8'), re.M | re.S)


@pytest.mark.thorough
def test_every_example_of_the_page_runs(folder, tmp_path, monkeypatch):
    shutil.copytree(folder, tmp_path / 'there')
    monkeypatch.chdir(tmp_path / 'there')
    names: dict = {}
    out = io.StringIO()
    some = blocks(ROOT / 'doc' / 'python.md')
    assert len(some) >= 8
    with contextlib.redirect_stdout(out):
        for k, block in enumerate(some):
            exec(compile(block, f'example {k + 1}', 'exec'), names)
    said = out.getvalue()
    assert names['line'].frequency.value == pytest.approx(23.4, abs=1e-3)
    for words in ('N = 0.', 'falls', 'unknown coefficient M', 'no such file'):
        assert words in said, said
    for name in ('imu.yaml', 'gyro_x.png', 'still.study/report.html',
                 'six_faces.study/calibration.yaml'):
        assert (tmp_path / 'there' / name).stat().st_size > 200


def test_the_import_loads_nothing_heavy():
    """No numpy, no scipy, and of the package what names its functions: the rest on first use."""
    code = ('import sys\nbefore = set(sys.modules)\nimport imu_noise_tools\n'
            'print(*sorted({m.partition(".")[0] for m in set(sys.modules) - before}'
            ' - set(sys.stdlib_module_names)), sum("imu_noise" in m for m in sys.modules))')
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True,
                          cwd=ROOT)
    *loaded, own = done.stdout.split()
    assert loaded == ['imu_noise_tools'] and int(own) <= 2


def test_a_room_does_not_hide_the_function_of_its_name():
    """The import system binds submodules in their package: two have the names of functions."""
    code = ('import imu_noise_tools as imu, importlib\n'
            'import imu_noise_tools.filter.design, imu_noise_tools.simulate\n'
            'from imu_noise_tools import filter, simulate\n'
            'assert filter is imu.filter and callable(filter) and callable(simulate)\n'
            'assert importlib.import_module("imu_noise_tools.filter").design')
    subprocess.run([sys.executable, '-c', code], check=True, cwd=ROOT)


def test_what_is_public_is_said_three_times_alike():
    """For tools that read (the typed block), for dir() and for star imports."""
    import imu_noise_tools.api as api
    text = (ROOT / 'imu_noise_tools' / '__init__.py').read_text()
    typed = re.findall(r'from \.api import (\w+) as (\w+)', text)
    assert [a for a, _ in typed] == [b for _, b in typed] == imu.__all__
    assert set(imu.__all__) <= set(dir(imu)) and set(imu.__all__) <= set(api.__all__)
    assert all(getattr(imu, n) is getattr(api, n) for n in imu.__all__)
    with pytest.raises(AttributeError, match='analize'):
        imu.analize


@pytest.mark.thorough
def test_a_study_has_the_numbers_of_the_command(folder, study, tmp_path):
    done = subprocess.run(
        [sys.executable, '-m', 'imu_noise_tools.cli.main', 'analyse', str(folder / 'still.bag'),
         '-o', str(tmp_path / 'a')], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    study.save(tmp_path / 'b')
    a, b = (yaml.safe_load((tmp_path / x / 'study.yaml').read_text()) for x in 'ab')
    assert a['targets'] == b['targets']
    assert {p.name for p in (tmp_path / 'a').iterdir()} == {
        p.name for p in (tmp_path / 'b').iterdir()}
    assert b['targets']['gyro_y']['effects']['white']['N']['value'] == study['gyro_y'].N.value
    assert imu.load(tmp_path / 'a')['gyro_y'].N.value == pytest.approx(study['gyro_y'].N.value)


@pytest.mark.thorough
def test_a_type_checker_knows_what_is_offered(tmp_path):
    pytest.importorskip('mypy')
    (tmp_path / 'use.py').write_text(
        'import imu_noise_tools as imu\nstudy = imu.analyse("x", duration="50%")\n'
        'reveal_type(study)\nreveal_type(imu.filter("x").compare())\n'
        'reveal_type(study["gyro_x"].N)\nimu.analize("x")\n')
    done = subprocess.run(
        [sys.executable, '-m', 'mypy', '--config-file', ROOT / 'setup.cfg', '--cache-dir',
         ROOT / '.mypy_cache', '--follow-imports', 'silent', 'use.py'], cwd=tmp_path,
        env={**os.environ, 'MYPYPATH': str(ROOT)}, capture_output=True, text=True)
    for words in ('"imu_noise_tools.api.Study"', '"imu_noise_tools.api.Table"',
                  '"imu_noise_tools.api.Coefficient"', 'no attribute "analize"'):
        assert words in done.stdout, done.stdout


@pytest.mark.thorough
def test_a_study_is_saved_where_it_came_from(study, tmp_path):
    study.save(tmp_path / 's')
    (tmp_path / 's' / 'mine.txt').write_text('kept')
    with pytest.raises(imu.InputError, match='exists already'):
        imu.Study(study.study).save(tmp_path / 's')
    again = imu.load(tmp_path / 's')
    again.diagnose('gyro_y')
    assert again.save() == tmp_path / 's' and (tmp_path / 's' / 'mine.txt').is_file()
    assert imu.load(tmp_path / 's')['gyro_y'].diagnosis is not None


def test_what_a_record_does_not_show_is_none_with_a_limit(study):
    k = next(study[a].K for a in study if study[a].K.value is None)
    assert k.upper95 > 0 and 'below' in k.shown and k.unit.endswith('/sqrt(Hz)')
    with pytest.raises(imu.InputError, match='not observable'):
        float(k)
    n = study['accel_x'].N
    assert n.interval[0] < float(n) < n.interval[1] and n.std > 0


def test_an_export_replaces_no_other_file(study, tmp_path):
    """Nor does the command; an earlier export it does."""
    path = tmp_path / 'imu.yaml'
    path.write_text('mine')
    with pytest.raises(imu.InputError, match='another name'):
        study.export('kalibr', path)
    assert path.read_text() == 'mine'
    text = study.export('kalibr', path, force=True)
    assert path.read_text() == text
    study.export('kalibr', path, inflate=2.0)
    assert path.read_text() != text


def test_unknown_names_are_answered_with_the_nearest(study, tmp_path):
    for name, meant in (('gyrox', 'gyro_x'), ('acel_z', 'accel_z')):
        with pytest.raises(imu.UsageError, match=f'did you mean {meant}'):
            study[name]
    assert not hasattr(study['gyro_x'], 'Q') and 'gyro_x' in study and 'x' not in study
    with pytest.raises(imu.UsageError, match='did you mean kalibr'):
        study.export('calibr')
    with pytest.raises(imu.UsageError, match='did you mean allan'):
        study.plot('alan')
    with pytest.raises(imu.UsageError, match='save where'):
        imu.analyse(imu.simulate(SPEC), axes='gyro_y').save()
    with pytest.raises(imu.InputError, match='noise study'):
        study.apply(imu.simulate(SPEC))


def test_two_effects_with_one_name_are_told_apart(study):
    mine = imu.Study(study.study)
    mine.add(['sinusoid', 'sinusoid'], 'gyro_x')
    try:
        assert mine['gyro_x']['sinusoid'].frequency.value != \
            mine['gyro_x']['sinusoid.2'].frequency.value
        with pytest.raises(imu.UsageError, match='of which effect'):
            mine['gyro_x'].frequency
    finally:
        mine.remove('sinusoid.2', 'gyro_x')
        mine.remove('sinusoid', 'gyro_x')


@pytest.mark.thorough
def test_notebooks_show_it(study):
    page = study._repr_html_()
    assert page.startswith('<div>') and page.count('<table>') == 1 + len(study)
    assert 'gyro_x' in page and 'deg/sqrt(h)' in page
    assert study.plot()._repr_png_().startswith(b'\x89PNG')
    assert len(str(study.plot())) < 60
    rows = study.compare()
    assert rows._repr_html_().count('<tr>') == 1 + len(study) and 'gyro_x' in repr(rows)
    assert '&lt;' in imu.api.Table([{'a': '<script>'}])._repr_html_()


def test_rows_go_to_pandas(study, monkeypatch):
    monkeypatch.setitem(sys.modules, 'pandas', None)
    with pytest.raises(imu.InputError, match='pip install pandas'):
        study.to_pandas()
    monkeypatch.undo()
    pandas = pytest.importorskip('pandas')
    frame = study.to_pandas()
    assert isinstance(frame, pandas.DataFrame)
    row = frame[(frame.target == 'gyro_y') & (frame.parameter == 'N')].iloc[0]
    assert row.value == study['gyro_y'].N.value and row.low < row.value < row.high


def test_sensors_with_a_clock_of_their_own_are_kept_apart(folder):
    """A record opened here is analysed as the bag is, each sensor at its own rate."""
    whole = imu.open_record(folder / 'still.bag')
    assert imu.analyse(whole, axes=['gyro_z'])['gyro_z'].N.value == pytest.approx(
        imu.analyse(folder / 'still.bag', axes=['gyro_z'])['gyro_z'].N.value, rel=1e-12)
    half = imu.analyse(whole, duration='50%', axes=['gyro_z'])
    assert half.source['duration_s'] == pytest.approx(100, abs=0.1)


@pytest.mark.thorough
def test_a_filter_writes_the_bag_it_is_told_to(folder, tmp_path):
    done = imu.filter(folder / 'still.bag', tmp_path / 'out.bag')
    again = imu.filter(folder / 'still.bag')
    assert done.domain == 'filter' and done.folder.is_dir() and (tmp_path / 'out.bag').is_file()
    np.testing.assert_allclose(done.record.gyro, again.record.gyro, rtol=0, atol=1e-12)
    raw = imu.open_record(folder / 'still.bag').gyro
    assert (again.record.gyro.std(axis=0) < 0.5 * raw.std(axis=0)).all()
