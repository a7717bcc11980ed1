# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Studies on disk: what comes back is what was kept, and what is damaged or hostile is refused."""

from __future__ import annotations

import io
import math
import struct
import zipfile

import calibration_sessions as sim
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
import yaml

import hidden
from imu_noise_tools import calibration, store
from imu_noise_tools.cli.main import main
from imu_noise_tools.core.errors import InputError
from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.loop import effect
from imu_noise_tools.loop.diagnosis import Diagnosis
from imu_noise_tools.loop.effect import Estimate, find_effect, Finding, model_of
from imu_noise_tools.loop.study import Study
from imu_noise_tools.noise.evidence import from_arrays, to_arrays
from imu_noise_tools.noise.fit import fit
from imu_noise_tools.noise.gather import gather
from imu_noise_tools.noise.problem import arrays_of, NoiseProblem, problems
from imu_noise_tools.simulate import simulate
from imu_noise_tools.tasks.calibration import study_of
from imu_noise_tools.tasks.filter import from_study


@pytest.fixture(scope='module')
def study() -> Study:
    """Return a study of two axes with a line, a null random walk and a history."""
    record, _ = hidden.draw(np.random.default_rng(1), ['sinusoid', 'temperature'], strength=3.0,
                            hours=0.2, rate_hz=20)
    found = gather(record, ['gyro_x', 'gyro_y'])
    s = Study.begin({a: NoiseProblem(e) for a, e in found.items()},
                    model_of('noise', ['white', 'flicker', 'random_walk']),
                    {'path': 'a bag', 'samples': np.int64(record.n), 'rate_hz': 20.0,
                     'warnings': ('it was cold: 3 °C',)})
    s.add(['sinusoid', 'sinusoid'], ['gyro_x'])
    s.add(['ramp'])
    return s


@pytest.fixture
def folder(study, tmp_path):
    """Return a folder with the study in it."""
    for name, content in store.study_files(study).items():
        data = content if isinstance(content, bytes) else content.encode()
        (tmp_path / name).write_bytes(data)
    return tmp_path


# --- there and back ------------------------------------------------------------------------------

def test_round_trip(study, folder):
    back = store.load(folder)
    assert back.domain == 'noise' and back.targets == study.targets
    assert back.source == {'path': 'a bag', 'samples': study.source['samples'], 'rate_hz': 20.0,
                           'warnings': ['it was cold: 3 °C']}
    assert back.history == study.history
    for t in study.targets:
        a, b = study.states[t], back.states[t]
        assert b.model.labels == a.model.labels and b.fit.flags == a.fit.flags
        assert b.fit.log_likelihood == pytest.approx(a.fit.log_likelihood, abs=1e-6)
        assert b.error.excess == pytest.approx(a.error.excess, abs=1e-9)
        for label, values in a.fit.estimates.items():
            for name, e in values.items():
                other = b.fit.estimates[label][name]
                assert other.point == pytest.approx(e.point, rel=1e-9)
                assert other.ci95 == (e.ci95 and pytest.approx(e.ci95, rel=1e-9))
                assert (other.value, other.note) == (e.value and pytest.approx(e.value), e.note)


def test_the_study_goes_on_after_loading(folder):
    back = store.load(folder)
    before = len(back.history)
    back.remove('ramp')
    back.add(['gauss_markov'], ['gyro_y'])
    assert len(back.history) == before + 3
    data = yaml.safe_load(store.dump_yaml(store.study_to_dict(back)))
    assert data['targets']['gyro_y']['effects']['gauss_markov']['tc']['unit'] == 's'


@pytest.mark.thorough
def test_diagnosis_survives(study, folder, tmp_path):
    s = store.load(folder)
    s.diagnose(['gyro_x'])
    for name, content in store.study_files(s).items():
        data = content if isinstance(content, bytes) else content.encode()
        (tmp_path / name).write_bytes(data)
    a, b = s.diagnosis['gyro_x'], store.load(tmp_path).diagnosis['gyro_x']
    assert (a.verdict, a.advice) == (b.verdict, b.advice)
    for one, other in ((a.ranked, b.ranked), (a.failed, b.failed)):
        assert [(f.name, f.probability, f.p_value, f.evidence) for f in one] \
            == [(f.name, f.probability, f.p_value, f.evidence) for f in other]


def test_a_diagnosis_by_a_former_name_of_a_parameter(folder):
    """``pattern`` of duplicates was ``regular``, and its value the number of the choice."""
    def parameters(**given):
        return {k: {'value': v, 'std': None, 'unit': '1'} for k, v in given.items()}

    data = yaml.safe_load((folder / 'study.yaml').read_text(encoding='utf-8'))
    data['diagnosis'] = {'gyro_x': {'verdict': 'missing', 'ranked': [
        {'effect': 'duplicates', 'gain': 30.0, 'parameters': parameters(fraction=0.5, regular=1.0)}
    ], 'failed': [], 'advice': ''}}
    (folder / 'study.yaml').write_text(store.dump_yaml(data), encoding='utf-8')
    back = store.load(folder)
    (found,) = back.diagnosis['gyro_x'].ranked
    assert found.effect.chosen('pattern') == 'regular' and found.effect['fraction'] == 0.5
    written = store.study_to_dict(back)['diagnosis']['gyro_x']['ranked'][0]['parameters']
    assert written['pattern']['value'] == 'regular' and 'regular' not in written


def test_a_specification_by_a_former_name_of_a_parameter():
    """It gives the record that the name of today gives; both at once are refused."""
    def record(**held):
        return simulate({'rate_hz': 100, 'duration_s': 2, 'targets': {'gyro_x': {
            'white': {'N': 1e-4}, 'duplicates': {'fraction': 0.5, **held}}}})[0].gyro

    np.testing.assert_array_equal(record(regular=1), record(pattern='regular'))
    assert find_effect('noise', 'duplicates')({'regular': 1.0}).chosen('pattern') == 'regular'
    with pytest.raises(InputError, match='duplicates has no parameter regular: '):
        record(regular=1, pattern='random')


def test_form_of_the_file(folder):
    """Others read it, so it stays as it is: names, nulls with limits, plain numbers."""
    data = yaml.safe_load((folder / 'study.yaml').read_text(encoding='utf-8'))
    assert list(data) == ['format', 'domain', 'source', 'targets', 'history', 'diagnosis']
    assert data['format'] == 'imu_noise_study/1' and data['diagnosis'] == {}
    x = data['targets']['gyro_x']
    assert x['unit'] == 'rad/s'
    assert list(x['effects']) == ['white', 'flicker', 'random_walk', 'sinusoid', 'sinusoid.2',
                                  'ramp']
    n = x['effects']['white']['N']
    assert x['effects']['white']['effect'] == 'white' and n['unit'] == 'rad/s/sqrt(Hz)'
    assert n['ci95'][0] < n['value'] < n['ci95'][1] and n['shown'].endswith('deg/sqrt(h)')
    assert x['effects']['sinusoid.2']['effect'] == 'sinusoid'
    for label, values in x['effects'].items():
        for e in (v for k, v in values.items() if k != 'effect'):
            if e['value'] is None and e.get('ci95'):
                assert e['ci95'][0] == 0 and e['upper95'] <= e['ci95'][1] * (1 + 1e-6), label
    error = x['error']
    assert {'held_out', 'held_out_std', 'views', 'misfit_percent', 'misfit_expected'} <= set(error)
    assert [h['target'] for h in data['history']] == ['gyro_x', 'gyro_y', 'gyro_x', 'gyro_x',
                                                      'gyro_y']
    assert data['history'][2]['added'] == 'sinusoid+sinusoid'
    for value in _leaves(data):
        assert type(value) in (str, int, float, bool, type(None))


def _leaves(data):
    if isinstance(data, dict):
        assert all(type(k) is str for k in data)
        for v in data.values():
            yield from _leaves(v)
    elif isinstance(data, list):
        for v in data:
            yield from _leaves(v)
    else:
        yield data


def test_evidence_keeps_every_array(study):
    found = {t: s.problem.evidence for t, s in study.states.items()}
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **to_arrays(found))
    buffer.seek(0)
    with np.load(buffer, allow_pickle=False) as data:
        arrays = {k: data[k] for k in data.files}
    back = from_arrays(arrays)
    assert list(back) == list(found)
    again = to_arrays(back)
    assert set(again) == set(arrays)
    for key, value in arrays.items():
        np.testing.assert_array_equal(again[key], value, err_msg=key)
    model = model_of('noise', ['white', 'flicker', 'sinusoid'])
    assert fit(back['gyro_x'], model).estimates == fit(found['gyro_x'], model).estimates


@pytest.mark.thorough
def test_evidence_is_small():
    """Three axes of a long record: what is kept hardly grows with its length."""
    n = 400_000
    rng = np.random.default_rng(0)
    y = rng.standard_normal((n, 3))
    record = ImuRecord(y, None, np.arange(n) / 200, 200.0)
    found = gather(record, ['gyro_x', 'gyro_y', 'gyro_z'])
    arrays = arrays_of({a: NoiseProblem(e) for a, e in found.items()})
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    assert buffer.tell() < 5e6
    assert list(problems(arrays)) == ['gyro_x', 'gyro_y', 'gyro_z']


def test_a_choice_is_written_and_read_by_name():
    """In the values of a target and of a candidate; older studies hold its index."""
    low = find_effect('noise', 'low_pass')
    effect_ = low({'cutoff': 9.0, 'form': 'moving_average'})
    index = effect_['form']
    found = {'cutoff': Estimate(9.0, 0.1, (8.8, 9.2), 'Hz', point=9.0),
             'form': Estimate(index, None, None, '1', point=index)}
    d = Diagnosis('missing', (Finding('low_pass', 30.0, effect_, found, 4.0, probability=0.99),))
    data = yaml.safe_load(store.dump_yaml(store.diagnosis_to_dict('gyro_x', d)))
    assert data['ranked'][0]['parameters']['form'] == {'value': 'moving_average'}
    assert store._diagnosis_of('noise', data).ranked[0].effect == effect_
    data['ranked'][0]['parameters']['form']['value'] = index
    assert store._diagnosis_of('noise', data).ranked[0].effect == effect_


# --- numbers -------------------------------------------------------------------------------------

finite = st.floats(allow_nan=False, allow_infinity=False)


@given(finite)
def test_floats_are_numbers_to_yaml_1_1(value):
    """1e-05 without a point is a *string* to YAML 1.1; ours has one."""
    text = store.dump_yaml({'x': value})
    back = yaml.safe_load(text)['x']
    assert type(back) is float and back == value


@pytest.mark.parametrize(('value', 'text'), [
    (2e-5, '2.0e-05'), (1e22, '1.0e+22'), (1.5e-7, '1.5e-07'), (3.0, '3.0'), (0.0, '0.0')])
def test_how_a_float_is_written(value, text):
    assert store.dump_yaml({'x': [value]}).strip() == f'x: [{text}]'


def test_values_that_are_no_numbers():
    back = yaml.safe_load(store.dump_yaml({'x': [math.inf, -math.inf, math.nan]}))['x']
    assert back[:2] == [math.inf, -math.inf] and math.isnan(back[2])


# control characters come back only from double quotes, which nobody's topic or path needs
words = st.text(st.characters(blacklist_categories=('Cc', 'Cs', 'Zl', 'Zp')), min_size=1)
scalars = st.one_of(finite, st.integers(-2 ** 63, 2 ** 63 - 1), st.booleans(), st.none(), words)


@given(st.recursive(scalars, lambda inner: st.one_of(
    st.lists(inner, max_size=4), st.dictionaries(words, inner, max_size=4)),
    max_leaves=12))
def test_plain_data_survives(data):
    assert yaml.safe_load(store.dump_yaml({'data': data}))['data'] == data


def test_numpy_is_made_plain():
    data = {'a': np.float64(1.5), 'b': np.int32(3), 'c': np.array([[1.0, 2.0]]), 'd': (1, 2),
            'e': np.bool_(True), 5: np.str_('x'), 'f': np.float32(0.5)}
    text = store.dump_yaml(data)
    assert 'numpy' not in text and '!!' not in text
    assert yaml.safe_load(text) == {'a': 1.5, 'b': 3, 'c': [[1.0, 2.0]], 'd': [1, 2], 'e': True,
                                    '5': 'x', 'f': 0.5}


# --- damaged and hostile -------------------------------------------------------------------------

def refused(folder, match):
    """Assert that loading is refused in one line that names the folder and a remedy."""
    with pytest.raises(InputError, match=match) as error:
        store.load(folder)
    assert str(folder) in error.value.message and error.value.remedy
    assert '\n' not in str(error.value)


def edited(folder, **changes):
    """Change entries of study.yaml."""
    path = folder / 'study.yaml'
    data = yaml.safe_load(path.read_text(encoding='utf-8'))
    for key, value in changes.items():
        if value is None:
            del data[key]
        else:
            data[key] = value
    path.write_text(yaml.safe_dump(data), encoding='utf-8')


def test_no_study_there(tmp_path):
    refused(tmp_path, 'no study.yaml')
    refused(tmp_path / 'nowhere', 'no such folder')


@pytest.mark.parametrize('text', [
    '', 'just words', '[1, 2]', 'format: imu_noise_study/2\ndomain: noise\n',
    'format: imu_noise_study/1\ndomain: cooking\n', 'format: imu_noise_study/1\n',
    'format: imu_noise_study/1\ndomain: [noise]\n'])
def test_another_format(folder, text):
    (folder / 'study.yaml').write_text(text)
    refused(folder, 'not a study')


def of_format(folder, number):
    """Make the evidence one of another format; 1 states none."""
    arrays = dict(np.load(folder / 'evidence.npz'))
    assert arrays.pop('format') == store.NEWEST
    np.savez_compressed(folder / 'evidence.npz', **arrays,
                        **({'format': np.array(number)} if number > 1 else {}))


@pytest.mark.parametrize('command', ['compare', 'diagnose', 'add', 'plan', 'export'])
def test_a_noise_study_of_an_older_version(folder, command, capsys):
    """Its evidence means something else now: it is not read, and what makes it anew is said."""
    of_format(folder, 1)
    edited(folder, source={'path': 'my bags/a.mcap'})
    more = ['--format', 'kalibr', '-o', '-'] if command == 'export' else []
    assert main([command, str(folder), *more]) == 1
    assert capsys.readouterr().err == (
        f'imu_noise: {folder}: evidence of format 1, written by an older version: make it anew: '
        f"imu_noise analyse 'my bags/a.mcap' -o {folder} --force\n")


def test_an_older_study_that_names_no_recording(folder):
    of_format(folder, 1)
    edited(folder, source={})
    refused(folder, 'evidence of format 1, written by an older version')
    with pytest.raises(InputError, match='make it anew: imu_noise analyse BAG -o '):
        store.load(folder)


def test_plain_numbers_of_an_older_study_are_read(folder, capsys):
    """As the ladder, and what states the noise for a filter."""
    of_format(folder, 1)
    assert main(['history', str(folder)]) == 0 and 'sinusoid' in capsys.readouterr().out
    assert 'white' in from_study(folder)[1][0]


def test_an_older_calibration_is_read(tmp_path):
    rng = np.random.default_rng(1)
    t, rates, force, _ = sim.stream(sim.Device(noise=0.02), sim.spread_directions(14, rng), rng)
    poses, _ = calibration.positions(ImuRecord(rates, force, t, 100.0), sim.G)
    begun = study_of(calibration.calibrate(poses))
    for name, content in store.study_files(begun).items():
        data = content if isinstance(content, bytes) else content.encode()
        (tmp_path / name).write_bytes(data)
    of_format(tmp_path, 1)
    bias, as_was = (s.states['accel'].fit.estimates['bias'] for s in (store.load(tmp_path), begun))
    assert [e.value for e in bias.values()] == pytest.approx([e.value for e in as_was.values()])


def test_a_newer_study(folder):
    of_format(folder, store.NEWEST + 1)
    refused(folder, f'evidence of format {store.NEWEST + 1}, for which this version is too old')
    with pytest.raises(InputError, match='too old .*: update imu_noise_tools'):
        store.load(folder)


@pytest.mark.parametrize('text', [
    'a: [1, 2', '\x00\x01', 'a: b: c', '!!python/object/apply:os.system ["echo hacked > {}"]',
    'a: !!python/name:os.system', '!!python/object/new:tuple [[1]]', '? ' * 3000, '[' * 3000])
def test_not_yaml_or_an_object(folder, text, tmp_path):
    """Nothing in a file is ever run: Python objects are not readable at all."""
    mark = tmp_path / 'hacked'
    (folder / 'study.yaml').write_text(text.replace('{}', str(mark)))
    refused(folder, 'not readable as YAML|not a study')
    assert not mark.exists()


def test_bytes_that_are_no_text(folder):
    (folder / 'study.yaml').write_bytes(b'\xff\xfe\x00format: \xc3\x28')
    refused(folder, 'not readable as YAML')


def test_aliases_that_would_explode(folder):
    """A billion laughs: nine levels of nine references."""
    lines = ['a: &a [x, x, x, x, x, x, x, x, x]']
    for one, two in zip('abcdefgh', 'bcdefghi'):
        lines.append(f'{two}: &{two} [{", ".join(["*" + one] * 9)}]')
    (folder / 'study.yaml').write_text('\n'.join(lines))
    refused(folder, 'alias')


@pytest.mark.parametrize('share', [0.1, 0.5, 0.9])
def test_a_study_cut_short(folder, share):
    path = folder / 'study.yaml'
    text = path.read_text(encoding='utf-8')
    path.write_text(text[:int(len(text) * share)], encoding='utf-8')
    try:
        store.load(folder)                        # what is left may still be a whole, older study
    except InputError as error:
        assert str(folder) in error.message


def test_entries_missing_or_of_another_kind(folder):
    keep = (folder / 'study.yaml').read_text(encoding='utf-8')
    for changes in ({'targets': None}, {'targets': [1]}, {'targets': {'gyro_x': 3}},
                    {'targets': {'gyro_x': {'effects': {'white': {}}}}},
                    {'targets': {'gyro_q': {'effects': {'white': {'effect': 'white'}}}}},
                    {'history': [{}]}, {'history': 5}, {'diagnosis': {'gyro_x': 'fine'}},
                    {'diagnosis': [1]}):
        edited(folder, **changes)
        refused(folder, 'damaged')
        (folder / 'study.yaml').write_text(keep, encoding='utf-8')


def test_an_effect_nobody_knows(folder):
    edited(folder, targets={'gyro_x': {'effects': {'hum': {'effect': 'hum'}}}})
    refused(folder, 'unknown noise effect hum')
    with pytest.raises(InputError) as error:
        store.load(folder)
    assert '--effects-from' in error.value.remedy


def test_evidence_is_not_there(folder):
    (folder / 'evidence.npz').unlink()
    refused(folder, 'evidence.npz')


@pytest.mark.parametrize('damage', [
    lambda data: b'', lambda data: data[:len(data) // 2], lambda data: b'PK\x03\x04' + b'\0' * 50,
    lambda data: data[:1000] + bytes(len(data) - 2000) + data[-1000:],
    lambda data: b'\x80\x04\x95' + data[3:], lambda data: bytes(len(data))])
def test_damaged_evidence(folder, damage):
    path = folder / 'evidence.npz'
    path.write_bytes(damage(path.read_bytes()))
    refused(folder, 'evidence.npz')


@pytest.mark.parametrize('seed', range(6))
def test_evidence_with_flipped_bytes(folder, seed):
    """Whatever is broken: a clear refusal, or numbers; never another exception."""
    path, rng = folder / 'evidence.npz', np.random.default_rng(seed)
    data = bytearray(path.read_bytes())
    for i in rng.integers(0, len(data), 20):
        data[i] = rng.integers(0, 256)
    path.write_bytes(bytes(data))
    try:
        store.load(folder)
    except InputError as error:
        assert str(folder) in error.message and error.remedy


def _archive(path, **members):
    with zipfile.ZipFile(path, 'w', zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(f'{name}.npy', data)


def test_pickled_arrays_are_not_unpickled(folder, tmp_path):
    """An object array would run what it likes on loading."""
    mark = tmp_path / 'hacked'

    class Evil:
        def __reduce__(self):
            return open, (str(mark), 'w')

    np.savez(folder / 'evidence.npz', common=np.array([Evil()], dtype=object))
    assert not mark.exists()
    refused(folder, 'evidence.npz')
    assert not mark.exists()


def test_a_zip_that_would_fill_the_memory(folder):
    """Declared sizes count before anything is unpacked."""
    path = folder / 'evidence.npz'
    _archive(path, a=bytes(1000))
    data = bytearray(path.read_bytes())
    at = data.rindex(b'PK\x01\x02')               # the central directory states what it unpacks to
    data[at + 24:at + 28] = struct.pack('<I', 0xF0000000)
    path.write_bytes(bytes(data))
    refused(folder, 'would unpack to')


def test_a_header_that_lies(folder):
    """An array that claims a terabyte and holds nothing."""
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (137438953472,), }"
    header += b' ' * (117 - len(header)) + b'\n'
    _archive(folder / 'evidence.npz',
             a=b'\x93NUMPY\x01\x00' + struct.pack('<H', len(header)) + header)
    refused(folder, 'evidence.npz')


def test_a_member_that_really_is_a_bomb(folder):
    """Forty megabytes of zeros in forty kilobytes, under a limit that is set lower."""
    buffer, number = io.BytesIO(), io.BytesIO()
    np.save(buffer, np.zeros(5_000_000))
    np.save(number, np.array(store.NEWEST))
    _archive(folder / 'evidence.npz', a=buffer.getvalue(), format=number.getvalue())
    refused(folder, 'damaged')                    # within the limit: read, and then not evidence


def test_an_effect_registered_later_does_not_disturb(folder, monkeypatch):
    """A study made before an effect was known loads as it did."""
    monkeypatch.setitem(effect._REGISTRY, 'noise', dict(effect._REGISTRY['noise']))

    class Late(effect.find_effect('noise', 'white')):
        """White noise under another name."""

        name = 'late_effect'

        @classmethod
        def statistics(cls, y, inputs):
            return {'n': np.array(len(y))}

    assert store.load(folder).targets == ['gyro_x', 'gyro_y']
