# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A report says what the study says: every number, in words, and nothing that a file sneaks in."""

from __future__ import annotations

import base64
from dataclasses import replace
import hashlib
from html.parser import HTMLParser
import math
from pathlib import Path
import re
import shutil
import subprocess
import sys
from types import SimpleNamespace

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from imu_noise_tools import report, store
from imu_noise_tools.calibration.problem import CalibrationProblem
from imu_noise_tools.cli.main import main
from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.filter.problem import FilterProblem
from imu_noise_tools.loop import study as loop_study
from imu_noise_tools.loop.diagnosis import Diagnosis, Remaining
from imu_noise_tools.loop.effect import (
    Estimate,
    find_effect,
    Finding,
    Fit,
    Model,
    model_of,
    registry,
    Score,
    View,
)
from imu_noise_tools.loop.prediction import State
from imu_noise_tools.loop.study import Contrast, Step, Study
from imu_noise_tools.loop.verdict import CANNOT_TELL
from imu_noise_tools.noise.gather import gather
from imu_noise_tools.noise.kinds import Inputs
from imu_noise_tools.noise.problem import _worst, NoiseProblem, where_to_look
from imu_noise_tools.plots import style
from imu_noise_tools.report import words
from imu_noise_tools.report.markup import SCRIPT
from imu_noise_tools.store import estimate_to_dict
from imu_noise_tools.tasks.loop import save

DT, N = 0.02, 30000
KNOWN = registry('noise')
EVIL = '<script>alert("x")</script>&\x1b[31m'
SOURCE = {'path': '/data/static.mcap', 'topic': '/imu/data_raw', 'samples': N, 'rate_hz': 50.0,
          'duration_s': N * DT, 'start': 1.7e9, 'frame_id': 'imu', 'covariates': ['temperature'],
          'warnings': ['3 stamps repeated'], 'left_out': [[10.0, 12.0, 'knock']]}


@pytest.fixture(scope='module')
def hidden():
    """Return a study of two axes with white noise and a line, fitted and diagnosed."""
    rng = np.random.default_rng(0)
    inputs = Inputs(np.arange(N) * DT, DT)
    white = KNOWN['white']({'N': 1e-4})
    data = np.array([white.apply(np.zeros(N), inputs, rng) for _ in range(6)]).T
    line = KNOWN['sinusoid']({'amplitude': 4e-4, 'frequency': 3.7})
    data[:, 0] = line.apply(data[:, 0], inputs, rng)
    some = ImuRecord(data[:, :3], data[:, 3:], inputs.t, 1 / DT)
    evidence = gather(some, ['gyro_x', 'accel_z'])
    study = Study.begin({a: NoiseProblem(e) for a, e in evidence.items()},
                        model_of('noise', ['white', 'random_walk']), SOURCE)
    study.diagnose()
    return study


@pytest.fixture
def study(hidden):
    """Return a copy that a test may change."""
    return Study(hidden.domain, hidden.states, hidden.source, hidden.history, hidden.diagnosis)


@pytest.fixture(scope='module')
def pictures(hidden):
    """Return its pictures, drawn once."""
    return report.pictures(hidden)


class Page(HTMLParser):
    """Collect tags, attributes and text; check that tags close."""

    OPEN = {'meta', 'img', 'br'}

    def __init__(self, source):
        super().__init__()
        self.tags, self.attributes, self.said, self.stack, self.scripts = [], [], [], [], []
        self.feed(source)
        self.close()
        assert not self.stack

    def handle_starttag(self, tag, attrs):
        """Remember a tag."""
        self.tags.append(tag)
        self.attributes += attrs
        if tag not in self.OPEN:
            self.stack.append(tag)

    def handle_endtag(self, tag):
        """Close the innermost tag, and no other."""
        assert self.stack.pop() == tag

    def handle_data(self, data):
        """Remember scripts, and text outside styles."""
        if 'script' in self.stack:
            self.scripts.append(data)
        elif 'style' not in self.stack:
            self.said.append(data)

    @property
    def text(self):
        """All text."""
        return re.sub(r'\s+', ' ', ' '.join(self.said))


def other_study(domain='calibration'):
    """Return a small study of another domain, with a ladder and an effect that is not noise's."""
    effects = [c for c in registry(domain).values() if c.parameters][:2]
    model = Model(c({p.name: 0.5 for p in c.parameters}) for c in effects)
    estimates = {e.label: {p.name: Estimate(0.5, 0.01, (0.48, 0.52), p.unit.replace('{rate}', 'X'))
                           for p in e.parameters} for e in model}
    view = View('poses', np.arange(6.0), np.array([0, 1, -9.0, 0, 1, 0]), 4.0, 0.3, 's')
    state = State(None, Fit(model, estimates, -3.0, ('a flag',)), Score.of([view]),
                  {'residual_rms': 0.0123})
    first, second = model.labels
    history = [Step('accel', (first,), 9.0, 0.3, verdict='start'),
               Step('accel', (first, second), 4.0, 0.3, second, fall=30.0, verdict='falls')]
    return Study(domain, {'accel': state}, {'path': 'faces.bag', 'notes': ['pose 3 twice']},
                 history, {'accel': Diagnosis('unknown', (), (), 'hold these poses again')})


# --- text ----------------------------------------------------------------------------------------

def test_text_says_what_the_study_says(study):
    said = report.text(study, 'x.study')
    data = store.study_to_dict(study)
    assert '/data/static.mcap' in said and '10 min' in said
    # a command has said the warnings on standard error by then
    assert '3 stamps repeated' not in report.text(study, 'x.study', verbose=True)
    for target, entry in data['targets'].items():
        block = said[said.index(f'\n{target}:'):].split('\n\n')[0]
        value = entry['effects']['white']['N']
        number, unit = re.search(r'white +N +(\S+) (\S+)', block).groups()
        known, unit_too = value['shown'].split(' ')
        assert unit == unit_too
        assert float(number) == pytest.approx(float(known), rel=0.01)
        low, high = map(float, re.search(r'(\S+) \.\.\. (\S+)', block).groups())
        assert low < float(number) < high
        walk = next(x for x in block.split('\n') if 'random_walk  K' in x)
        assert 'not observable' in walk and 'below' in walk
    assert 'beyond chance' in said and 'within chance' in said
    assert 'near 3.' in said and 'Hz' in said


def test_text_names_what_is_missing_and_what_to_run(study):
    said = report.text(study, '/tmp/my study')
    assert re.search(r'diagnosis: missing: sinusoid, probability 1\b', said)
    assert re.search(r'sinusoid: amplitude 8[0-9.]+ deg/h, frequency 3\.70', said)
    assert "next: imu_noise add '/tmp/my study'" in said
    assert 'next:' not in report.text(study)


def test_verbose_says_more(study):
    short, long = report.text(study), report.text(study, verbose=True)
    assert len(long) > len(short)
    assert 'percent rms' in long and 'percent rms' not in short


def test_text_does_not_steer_the_terminal(study):
    study.source = {'path': EVIL, 'warnings': ['\x07 bell \u202e']}
    said = report.text(study)
    assert all(c == '\n' or c.isprintable() for c in said)
    assert '<script>' in said


@pytest.mark.parametrize(('verdicts', 'command'), [
    ({}, 'diagnose'), ({'gyro_x': 'complete'}, 'diagnose'),
    ({'gyro_x': 'complete', 'accel_z': 'missing'}, 'add'),
    ({'gyro_x': 'complete', 'accel_z': 'complete'}, 'export'),
    ({'gyro_x': 'unknown', 'accel_z': 'undecidable'}, 'export')])
def test_what_to_run_next(study, verdicts, command):
    ranked = (Finding('ramp', 9.0, penalty=5.0),)
    study.diagnosis = {t: Diagnosis(v, ranked, found=ranked if v == 'missing' else ())
                       for t, v in verdicts.items()}
    (said, why), = words.next_steps(study)
    assert said.startswith(f'imu_noise {command} DIR')
    assert ('accel_z' in why) == (command == 'add')


# --- the page ------------------------------------------------------------------------------------

def test_page_tells_the_story_in_order(study, pictures):
    page = Page(report.html(study, pictures, folder='x.study'))
    parts = ['verdict', 'For Kalibr', 'gyroscope_noise_density', 'The recording',
             'What to run next', 'Axis by axis', 'What the model says', 'Where the model fails',
             'What is missing', 'view by view', 'What was measured',
             'The effects in the model', 'The words of this page']
    at = [page.text.index(p) for p in parts]
    assert at == sorted(at)
    for said in ('static.mcap', '50 Hz', '2023-11-14', '3 stamps repeated', 'knock',
                 'not observable', 'deg/sqrt(h)', 'rad/s/sqrt(Hz)', 'missing: sinusoid',
                 'imu_noise add x.study',
                 KNOWN['sinusoid'].hint[:40], KNOWN['white'].equation):
        assert said in page.text, said
    assert page.tags.count('title') == 1 and page.tags.count('h1') == 1


def test_page_is_self_contained(study, pictures):
    page = Page(report.html(study, pictures))
    assert not {'link', 'iframe', 'object', 'form'} & set(page.tags)
    assert page.scripts == [SCRIPT]               # and the page's policy admits no other
    policy, = [v for k, v in page.attributes if k == 'content' and 'script-src' in v]
    assert policy.startswith("default-src 'none'") and policy.endswith("'")
    assert base64.b64encode(hashlib.sha256(SCRIPT.encode()).digest()).decode() in policy
    sources = [v for k, v in page.attributes if k == 'src']
    assert len(sources) == len(pictures) >= 3
    for s in sources:
        kind, coded = s.split(',')
        assert kind == 'data:image/png;base64'
        assert base64.b64decode(coded) in pictures.values()
    assert not [k for k, _ in page.attributes if k.startswith('on') or k == 'href']
    assert 'url(' not in report.html(study, {}) and '@import' not in report.html(study, {})
    assert ('name', 'viewport') in page.attributes


def test_page_escapes_all_that_comes_from_files(study):
    finding = Finding('sinusoid', 9.0, KNOWN['sinusoid'].example(),
                      {'frequency': Estimate(3.7, 0.1, (3.5, 3.9), 'Hz')}, 1.0, EVIL, EVIL, 0.9)
    failed = Finding(EVIL, 0.0, p_value=1e-9, evidence=EVIL)
    evil = replace(study.states['gyro_x'].fit, flags=(EVIL,))
    study = Study('noise', {'gyro_x': replace(study.states['gyro_x'], fit=evil)},
                  {k: EVIL for k in ('path', 'topic', 'frame_id', EVIL)}
                  | {'warnings': [EVIL], 'left_out': [[1.0, 2.0, EVIL]]},
                  [Step('gyro_x', (EVIL,), 1.0, 0.1),
                   Step('gyro_x', (EVIL,), 1.0, 0.1, EVIL, verdict=EVIL, failing=(EVIL,),
                        why=(finding,), contrast=Contrast(EVIL, EVIL, (1.0, 2.0), (0.0, 9.0),
                                                          (0.0, 1.0)))],
                  {'gyro_x': Diagnosis('missing', (finding,), (failed,), EVIL)})
    source = report.html(study, {}, folder=EVIL)
    page = Page(source)
    assert page.scripts == [SCRIPT]
    assert source.count('alert') > 12 and source.count('<script') == 1
    assert 'alert("x")' in page.text
    assert '<script>' in [v for k, v in page.attributes if k == 'alt'][0]


def test_what_is_there_but_by_one_of_two_names_is_said_beside_what_is_found():
    found = Finding('shock', 90.0, None, {}, 6.0, probability=1.0)
    either = Finding('gauss_markov', 90.0, None, {}, 9.9, probability=0.6,
                     against=f'{CANNOT_TELL} rts')
    other = Finding('ramp', 1.0, None, {}, 8.0, probability=0.0, against='no ramp')
    said = words.diagnosis_in_words(Diagnosis('missing', (found, either, other), found=(found,)))
    assert said == ('missing: shock, probability 1; and gauss_markov, but this record cannot tell '
                    'it from rts')


def test_one_rival_alone_is_undecidable_from_nothing():
    one, two = (Finding(name, 16.0, penalty=15.0, probability=0.6) for name in ('ramp', 'step'))
    assert words.diagnosis_in_words(Diagnosis('undecidable', (one,))) == \
        'undecidable: ramp or nothing'
    assert words.diagnosis_in_words(Diagnosis('undecidable', (one, two))) == \
        'undecidable: ramp or step'


def test_page_shows_the_pictures_of_any_domain(study):
    page = Page(report.html(study, {'poses': b'one', 'innovations': b'two'}))
    assert 'Poses' in page.text and 'Innovations' in page.text
    assert [base64.b64decode(v.split(',')[1]) for k, v in page.attributes if k == 'src'] == [
        b'one', b'two']


def test_pictures_of_a_study(study, pictures):
    """In full those targets that fail, worst first; the ladder once there is one."""
    assert list(pictures) == ['series', 'allan', 'target gyro_x', 'found gyro_x sinusoid']
    assert all(p[:4] == b'\x89PNG' for p in pictures.values())
    step = Step('gyro_x', ('white',), 0.1, 0.1, 'white', verdict='falls')
    study.history = [*study.history, step]
    study.states = {'accel_z': study.states['accel_z']}
    assert list(report.pictures(study)) == ['series', 'allan', 'ladder']


@pytest.mark.thorough
def test_what_is_missing_added_and_not_known_is_proven_by_a_picture(hidden):
    study = Study(hidden.domain, hidden.states, hidden.source, hidden.history, hidden.diagnosis)
    alts = [v for k, v in Page(report.html(study)).attributes if k == 'alt']
    assert 'gyro_x: measured, and the model without and with sinusoid' in alts
    study.add(targets=['gyro_x'])
    shown = report.pictures(study)
    assert 'added gyro_x sinusoid' in shown
    page = Page(report.html(study, shown))
    assert 'model without sinusoid and with it' in page.text
    near = Finding('ramp', 9.0, penalty=5.0, against='nothing in the mean speaks for it')
    study.diagnosis['accel_z'] = Diagnosis('unknown', (near,))
    shown = report.pictures(study)
    assert 'unexplained accel_z' in shown
    assert 'ramp comes nearest, and was rejected: nothing in the mean speaks for it' in Page(
        report.html(study, shown)).text


def test_a_page_full_of_pictures_can_be_mailed(hidden):
    """The most pictures that a page of six axes has, as large as those of real studies."""
    rng = np.random.default_rng(1)
    figure = style.new_figure(14, 8.4)
    for k in range(6):
        figure.add_subplot(2, 3, k + 1).plot(rng.standard_normal((3000, 2)), '.', markersize=2)
    large = style.png(figure)
    assert len(large) > 200_000
    shown = {'series': large, 'allan': large, 'target gyro_x': large, 'target accel_z': large}
    assert len(report.html(hidden, shown)) < 1.1e6


def test_each_axis_tells_its_own_story(study):
    study.history = [Step(t, ('white',), 3.0, 0.1, a, verdict='falls')
                     for a in (None, 'ramp') for t in study.targets]
    page = Page(report.html(study, {}))
    stories = page.text.split('What happened when effects were added')[1:]
    assert len(stories) == 2 and all('+ ramp' in story for story in stories)
    assert 'What happened' not in Page(report.html(
        Study('noise', study.states, history=study.history[:2]), {})).text


def test_a_rung_keeps_why_it_was_climbed_and_what_it_changed(hidden):
    study = Study(hidden.domain, hidden.states, hidden.source, hidden.history, hidden.diagnosis)
    step, = study.add(targets=['gyro_x'])
    assert step.added == 'sinusoid' and [f.name for f in step.why] == ['sinusoid']
    assert 'frequency' in study.history[0].failing and 'frequency' not in step.failing
    worst = np.argmax(np.abs(step.contrast.before))
    assert step.contrast.view == 'frequency'
    assert step.contrast.x[worst] == pytest.approx(3.7, rel=0.05)
    assert abs(step.contrast.after[worst]) < 5 < abs(step.contrast.before[worst])
    study.diagnose()
    page = Page(report.html(study, {}))
    story = page.text[page.text.index('What happened'):page.text.index('What the model says')]
    for said in ('+ sinusoid', 'failed in: power over frequency', 'Why: sinusoid', 'Physically:',
                 'falls'):
        assert said in story, said
    picture, = [v for k, v in page.attributes if k == 'src']
    assert base64.b64decode(picture.split(',')[1])[:4] == b'\x89PNG'


@pytest.mark.thorough
@pytest.mark.skipif(shutil.which('npx') is None, reason='no npx, with which the validator runs')
def test_pages_are_valid_html(study, pictures, tmp_path):
    """As html-validate (npm) judges by the HTML standard."""
    names = []
    for name, some, shown in (('noise', study, pictures), ('filter', other_study('filter'), {}),
                              ('calibration', other_study(), {})):
        names.append(str(tmp_path / f'{name}.html'))
        Path(names[-1]).write_text(report.html(some, shown), encoding='utf-8')
    validator = ['npx', '--yes', 'html-validate@10']
    if subprocess.run([*validator, '--version'], capture_output=True, cwd=tmp_path).returncode:
        pytest.skip('the validator is not to be had')
    for preset in ('recommended', 'standard'):
        done = subprocess.run([*validator, '--preset', preset, *names], capture_output=True,
                              text=True, cwd=tmp_path)
        assert done.returncode == 0, done.stdout


def test_colours_are_told_apart_by_the_colour_blind():
    """Machado, Oliveira and Fernandes (2009), deuteranomaly and protanomaly of severity 1."""
    blind = {
        'deuteranopia': [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
                         [-0.011820, 0.042940, 0.968881]],
        'protanopia': [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
                       [-0.003882, -0.048116, 1.051998]],
        'none': np.eye(3)}
    for matrix in blind.values():
        for palette in (style.AXES.values(), [style.MEASURED, style.MODEL, *style.AXES.values()],
                        [style.GOOD, style.MODEL], [style.MEASURED, style.FAIL]):
            seen = [lab(np.asarray(matrix) @ linear(c)) for c in palette]
            apart = min(np.linalg.norm(a - b)
                        for i, a in enumerate(seen) for b in seen[:i])
            assert apart > 15, (palette, apart)       # 2.3 is just noticeable side by side


def linear(colour):
    """Return linear RGB (3,) of a colour #rrggbb."""
    c = np.array([int(colour[k:k + 2], 16) for k in (1, 3, 5)]) / 255
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def lab(rgb):
    """Return CIE 1976 L*a*b* of linear RGB (3,), D65."""
    xyz = np.array([[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750],
                    [0.0193339, 0.1191920, 0.9503041]]) @ np.clip(rgb, 0, 1)
    t = xyz / np.array([0.95047, 1.0, 1.08883])
    f = np.where(t > 216 / 24389, np.cbrt(t), (24389 / 27 * t + 16) / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize('domain', ['calibration', 'filter'])
def test_other_domains(domain):
    study = other_study(domain)
    said = report.text(study, 'x.study', verbose=True)
    page = Page(report.html(study))
    for found in (said, page.text):
        for expected in ('beyond chance', 'poses left out', 'at 2 s', 'residual rms: 0.0123',
                         'a flag', 'hold these poses again', 'unknown', '0.500'):
            assert expected.lower() in found.lower(), expected
    assert 'What happened' in page.text and 'pose 3 twice' in page.text
    assert [v for k, v in page.attributes if k == 'src']                  # the ladder


def test_an_error_that_is_not_known():
    study = other_study()
    study.states = {'accel': replace(study.states['accel'], error=Score.of([]))}
    assert 'nothing was left to predict' in report.text(study)
    assert 'nothing was left to predict' in Page(report.html(study, {})).text


def test_text_needs_no_matplotlib():
    code = 'import sys\nfrom imu_noise_tools import report\nassert "matplotlib" not in sys.modules'
    subprocess.run([sys.executable, '-c', code], check=True)


# --- words ---------------------------------------------------------------------------------------

@given(st.floats(1e-12, 1e12), st.floats(1e-7, 0.5), st.sampled_from([1, -1]))
def test_a_number_is_rounded_within_a_tenth_of_its_uncertainty(size, relative, sign):
    value, std = sign * size, size * relative
    assert abs(float(words.significant(value, std)) - value) <= 0.1 * std * (1 + 1e-9)
    assert float(words.significant(value)) == pytest.approx(value, rel=0.006)


@pytest.mark.parametrize(('value', 'std', 'shown'), [
    (0.29891, 0.0003, '0.29891'), (0.301, 0.003, '0.3010'), (204.27, 0.24, '204.27'),
    (137.2, 60.0, '137'), (8.698e-5, 1e-7, '8.698e-05'), (0.0, 0.1, '0'), (5.0, None, '5.00'),
    (float('nan'), None, 'nan'), (3.7, 0.0, '3.70'), (-0.97391, 3.7e-4, '-0.97391')])
def test_numbers(value, std, shown):
    assert words.significant(value, std) == shown


def test_rows_keep_limits_and_notes():
    effect = KNOWN['random_walk']({'K': 1e-6})
    e = Estimate(None, None, (0.0, 2e-6), 'rad/s^2/sqrt(Hz)', 1.5e-6,
                 'not observable: record 20 h for 20 %', 1e-6)
    state = State(None, Fit(Model([effect]), {'random_walk': {'K': e}}, 0.0), Score.of([]))
    row, = words.rows(state, 'gyro_x')
    limit = math.degrees(1.5e-6) * 3600 ** 1.5
    assert row.shown == 'not observable' and row.note == 'record 20 h for 20 %'
    assert row.interval == f'below {limit:.1f} deg/h^1.5'
    assert row.si == '< 1.50e-06 rad/s^2/sqrt(Hz)'


def test_what_a_form_of_an_effect_does_not_use_is_not_listed():
    effect = KNOWN['variance_change'].example()
    estimates = {p.name: Estimate(0.0, None, None, p.unit) for p in effect.parameters}
    estimates['factor'] = Estimate(2.0, 0.1, (1.8, 2.2), '1')
    state = State(None, Fit(Model([effect]), {effect.label: estimates}, 0.0), Score.of([]))
    listed = [r.symbol for r in words.rows(state, 'gyro_x')]
    assert {'form', 'factor'} <= set(listed) and 'duration_3' not in listed
    assert 'duration_3' not in words.parameters_of(
        Finding(effect.name, 9.0, effect, estimates), 'gyro_x')


def test_places_are_named_once_and_only_when_they_stand_out():
    f = np.array([0.001, 3.70, 3.75, 20.0, 40.0])
    view = View('frequency', f, np.array([-8.0, 30.0, 25.0, 2.9, -4.0]), 5.0, 0.1, 'Hz')
    assert words.places_in_words(view) == (
        'worst near 3.7 Hz (30 standard errors too much), near 0.001 Hz (period 16.7 min) '
        '(8 standard errors too little), near 40 Hz (4 standard errors too little)')
    assert words.places_in_words(view, 1).count('near') == 1
    calm = replace(view, pull=np.full(5, 2.9))
    assert 'nowhere strikingly' in words.places_in_words(calm)


@pytest.mark.parametrize(('name', 'unit', 'x', 'said'), [
    ('time', 's', 300.0, 'at 5 min'), ('distribution', 'quantile', 0.99, 'in the tails'),
    ('distribution', 'quantile', 0.5, 'near the mean'), ('lags', 'samples', 7.0, 'at 7 samples')])
def test_places(name, unit, x, said):
    view = View(name, np.array([0.0, x]), np.array([0.0, 9.0]), 5.0, 0.1, unit)
    assert said in words.places_in_words(view)
    assert words.view_in_words(view).startswith(words.title_of(name))


def test_views_fail_by_the_one_rule():
    views = [View(name, np.zeros(1), np.zeros(1), excess, 0.1)
             for name, excess in (('time', 0.45), ('a', 0.2), ('b', 2.0))]
    assert [v.name for v in words.failing(Score.of(views))] == ['b', 'time']


def test_verdicts_are_printed_one_by_one(study, undrawn, tmp_path, capsys, monkeypatch):
    """In text the first is there, flushed, while the second is asked for; as one text in JSON."""
    folder, seen = tmp_path / 's', []
    save(study, folder)

    def asked(state, *tried):
        """Answer what was found before: it is asked for four times."""
        seen.append(capsys.readouterr().out)
        return study.diagnosis[state.problem.evidence.axis]

    monkeypatch.setattr(loop_study, 'diagnose', asked)
    assert main(['diagnose', str(folder)]) == 0
    assert seen[0] == '' and seen[1].startswith('gyro_x: missing: sinusoid')
    rest = capsys.readouterr().out
    assert rest.startswith('accel_z: ') and 'next: imu_noise add' in rest
    seen.clear()
    assert main(['diagnose', str(folder), '--json']) == 0
    assert not any(seen) and capsys.readouterr().out.startswith('{')


def test_a_record_of_which_nothing_is_listed_is_not_called_free_of_disturbances(study):
    study.source = {k: v for k, v in SOURCE.items() if k not in ('warnings', 'left_out')}
    said = Page(report.html(study, {})).text
    assert 'Nothing stands out of its noise' in said and 'the diagnosis of each axis names' in said


# --- the words of what is left -------------------------------------------------------------------

@pytest.mark.parametrize(('share', 'ratio', 'enough', 'said'), [
    (0.83, 0.986, True, 'That is 83 % of the power, and what makes it is not known. The '
     'coefficients hold all the same: the Allan deviation is up to 1.4 % below the model\'s, and '
     'none of them leaves its interval by it.'),
    (0.9998, 12.8, False,
     'That is 100 % of the power, and the Allan deviation is up to 12.8 times the model\'s.'),
    (0.0078, 1.0, True, 'That is 0.78 % of the power, and the Allan deviation is within chance: '
     'sufficient all the same.'),
    (6e-12, 1.0, False, 'That is less than 0.1 % of the power, and the Allan deviation is within '
     'chance.'),
    (0.0, 1.0, True, 'The power is as the model has it, and the Allan deviation is within chance: '
     'sufficient all the same.')])
def test_what_is_left_is_weighed_in_words(share, ratio, enough, said):
    left = Remaining((Finding('frequency', 9.0, evidence='worst at 60 Hz'),), share, ratio, enough)
    d = Diagnosis('unknown', remaining=left, sufficient=enough)
    assert words.remaining_in_words(d).endswith(said)


def test_what_stands_for_something_else_is_no_number():
    """A line that was there before the record begins is not one from 0 s on."""
    known = find_effect('noise', 'sinusoid')
    values = {'amplitude': 1e-4, 'frequency': 3.7, 'begin': 0.0, 'end': 120.0}
    found = Finding('sinusoid', 9.0, known(values), {
        k: Estimate(v, 0.0 if v == 0 else 1e-3 * v, None, 's') for k, v in values.items()})
    assert 'begin' not in words.parameters_of(found, 'gyro_x')
    assert 'end 120' in words.parameters_of(found, 'gyro_x')
    written = estimate_to_dict(found.estimates['begin'], known(values).parameter('begin'), 'gyro')
    assert written['shown'] == 'before the record' and written['value'] == 0.0
    coarse = find_effect('noise', 'rate_quantization')
    for white, said in ((1.0, ', white rounding adds white noise'), (0.0, '')):
        found = Finding('rate_quantization', 9.0, coarse({'step': 1e-3, 'white': white}),
                        {'white': Estimate(white, None, None, '1')})
        assert words.parameters_of(found, 'accel_x') == said.removeprefix(', ')


@pytest.mark.parametrize('domain', ['noise', 'calibration', 'filter'])
def test_where_nothing_explains_it_what_fails_is_said_once(domain, study):
    problem = study.states['gyro_x'].problem
    if domain != 'noise':
        problem = SimpleNamespace(share=1.0, refuting=lambda names: None)
        study = other_study(domain)
    target = study.targets[0]
    failed = (Finding('frequency', 0.0, view='frequency', p_value=1e-9, where='38 Hz',
                      evidence='8.4 standard errors too much'),)
    near = Finding('ramp', 9.0, penalty=5.0, against='nothing in the mean speaks for it')
    face = {'noise': NoiseProblem, 'calibration': CalibrationProblem, 'filter': FilterProblem}
    advice = face[domain].advice(problem, 'unknown', [near], list(failed))
    study.diagnosis[target] = Diagnosis('unknown', (near,), failed, advice, (),
                                        Remaining(failed, nearest=near))
    for text in (report.terminal.verdict(study, target),
                 Page(report.html(study, {})).text.split('why we think so')[1]):
        text = ' '.join(text.split())
        assert text.count(failed[0].evidence) == text.count('Nearest comes ramp') == 1
        assert advice[1:] in text
    assert 'standard errors' not in advice and 'no known effect' not in advice


@pytest.mark.parametrize('unit, said', [
    ('quantile', 'worst at the 96.9 % quantile, 6.5 standard errors below'),
    ('Hz', 'worst at 0.9688 Hz, 6.5 standard errors below')])
def test_where_a_test_fails_most_is_said_without_jargon(unit, said):
    view = View('v', np.array([0.5, 0.96875]), np.array([3.0, -6.5]), 1.0, 0.1, unit)
    assert _worst(view, 1) == said


def test_the_advice_of_a_filter_names_what_the_verdict_does():
    """What is refuted shares nothing; it was named as the other of two."""
    ranked = [Finding('outliers', 9.0, penalty=5.0, probability=0.53),
              Finding('sampling_jitter', 30.0, penalty=5.0, probability=0.0, against='refuted')]
    said = FilterProblem.advice(SimpleNamespace(), 'undecidable', ranked, [])
    assert said.startswith('outliers: record longer')
    d = Diagnosis('undecidable', tuple(ranked), (), said)
    assert words.diagnosis_in_words(d) == 'undecidable: outliers or nothing'


@pytest.mark.parametrize(('failed', 'said'), [
    ({'distribution': ''}, ''),
    ({'coherence': '', 'shape': '', 'frequency': '25 Hz', 'time': '132 s'}, ''),
    ({'frequency': '61.3 Hz'}, 'Look for what turns or swings at 61.3 Hz.'),
    ({'variance': '118 s', 'shape': ''}, 'Look at what was going on at 118 s.'),
    ({'time': '40 s', 'frequency': '61.3 Hz'},
     'Look at what was going on at 40 s, and for what turns or swings at 61.3 Hz.'),
    ({'shape': '182 to 201 Hz', 'frequency': '190 Hz', 'time': '40 s'},
     'Look for what turns or swings at 182 to 201 Hz.'),
    ({'sweep': '', 'frequency': '50 Hz'}, 'Look for what ran up or down while the line swept.')])
def test_where_to_look_is_said_where_a_time_or_a_frequency_is_told(failed, said):
    assert where_to_look([Finding(k, 9.0, view=k, where=w) for k, w in failed.items()]) == said
