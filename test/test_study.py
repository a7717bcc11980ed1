# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The loop: on noise with a known truth, on a user's own effect, and on a problem it never saw."""

from __future__ import annotations

from dataclasses import dataclass
import functools

import numpy as np
import pytest

import hidden
from imu_noise_tools.core.errors import FitError, UsageError
from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.loop import effect, findings, prediction, study, verdict
from imu_noise_tools.loop.effect import (
    Effect,
    Estimate,
    Finding,
    Fit,
    Model,
    model_of,
    Parameter,
    Score,
    View,
)
from imu_noise_tools.loop.places import Places
from imu_noise_tools.loop.problem import Problem
from imu_noise_tools.loop.study import Study
from imu_noise_tools.noise.gather import gather
from imu_noise_tools.noise.problem import NoiseProblem
from imu_noise_tools.report import terminal

# All three matter within three hours: flat from 10 s, rising from 40 s.
SENSOR = {'N': 1e-4, 'B': 1e-4 / (0.664 * np.sqrt(10)), 'K': 1e-4 * np.sqrt(3 / 10 / 40)}


@functools.lru_cache
def noise_problems(seed=0):
    """Return the problems of two axes with the three base effects in them."""
    record, _ = hidden.draw(np.random.default_rng(seed), hours=3, rate_hz=10, sensor=SENSOR)
    return {a: NoiseProblem(e) for a, e in gather(record, ['gyro_x', 'gyro_y']).items()}


def begin(*effects, seed=0) -> Study:
    """Return a study of noise."""
    return Study.begin(noise_problems(seed), model_of('noise', effects), {'path': 'simulated'})


# --- the ladder on noise -------------------------------------------------------------------------

def test_the_ladder_falls_to_chance_and_stays():
    """White alone fails; flicker, then random walk heal it; a ramp that is not there does not."""
    s = begin('white')
    for t, score in s.compare().items():
        assert not score.within_chance
        assert {'frequency', 'time'} <= set(score.views)
        worst = score.views['frequency']
        # it fails at low frequencies, where flicker is
        assert worst.x[np.argmax(np.abs(worst.pull))] < 0.1
        assert np.max(worst.pull) > 10
    one = s.add(['flicker'])
    two = s.add(['random_walk'])
    three = s.add(['ramp'])
    for t in s.targets:
        start, a, b, c = [h for h in s.history if h.target == t]
        assert start.held_out > a.held_out > b.held_out
        assert a.fall > 100 and b.fall > verdict.FALL and c.fall < verdict.FALL
        assert b.verdict == 'falls to chance' and c.verdict == 'does not fall'
        assert b.held_out <= 2 * b.held_out_std
        assert abs(c.held_out - b.held_out) < b.held_out_std
    assert [x.target for x in one] == [x.target for x in two] == [x.target for x in three]
    # what held the walk had a value that the walk takes from it; what is not there moves nothing
    assert all(('flicker', 'B') in x.moved for x in two) and not any(x.moved for x in three)
    said = [line for line in terminal.steps(s, two).splitlines() if 'outside' in line]
    assert len(said) == 2 and all('flicker B;' in line for line in said)
    # what is not there ends as a null amplitude with a limit, nineteen times in twenty
    found = [state.fit.estimates['ramp']['R'] for state in s.states.values()]
    assert all(abs(r.point) < 4 * r.std for r in found)
    null = [r for r in found if r.value is None]
    assert null and all(r.upper95 > 0 and r.ci95[0] == 0 for r in null)
    assert all(x.fit.estimates['random_walk']['K'].value for x in s.states.values())


@pytest.mark.thorough
def test_the_chance_level_is_honest():
    """Held-out errors of the true model scatter about zero as their own std says."""
    scores = []
    for seed in range(8):
        s = begin('white', 'flicker', 'random_walk', seed=100 + seed)
        scores += list(s.compare().values())
    pulls = np.array([x.excess / x.std for x in scores])
    # 16 axes of 8 records: the mean within 4 of its errors, nobody far out
    assert abs(np.mean(pulls)) < 4 / np.sqrt(8) and np.all(np.abs(pulls) < 5)
    assert np.mean([x.within_chance for x in scores]) > 0.75
    for name in scores[0].views:
        views = [x.views[name] for x in scores]
        off = np.array([v.excess / v.std for v in views])
        assert abs(np.mean(off)) < 1.5 and np.all(np.abs(off) < 6), name


@pytest.mark.thorough
def test_order_does_not_matter():
    one, other = begin('white', 'flicker'), begin('white', 'random_walk')
    one.add(['random_walk'])
    other.add(['flicker'])
    for t in one.targets:
        a, b = one.states[t], other.states[t]
        assert a.error.excess == pytest.approx(b.error.excess, abs=0.05 * a.error.std)
        for label, name in (('white', 'N'), ('flicker', 'B'), ('random_walk', 'K')):
            x, y = (s.fit.estimates[label][name] for s in (a, b))
            assert x.point == pytest.approx(y.point, abs=0.02 * x.std)


def test_remove_goes_back():
    s = begin('white', 'flicker', 'random_walk')
    before = {t: (x.error.excess, dict(x.fit.estimates)) for t, x in s.states.items()}
    s.add(['ramp'])
    steps = s.remove('ramp')
    assert [x.removed for x in steps] == ['ramp', 'ramp'] and len(s.history) == 6
    for t, (error, estimates) in before.items():
        assert s.states[t].error.excess == pytest.approx(error, abs=1e-9)
        assert s.states[t].fit.estimates == estimates


def test_removing_what_is_there_makes_it_worse():
    s = begin('white', 'flicker', 'random_walk')
    for x in s.remove('random_walk'):
        assert x.verdict == 'rises' and x.fall < -verdict.FALL
        assert 'random_walk' not in x.effects


def test_one_target_alone():
    s = begin('white')
    (step,) = s.add(['flicker'], ['gyro_y'])
    assert step.target == 'gyro_y' and step.effects == ('white', 'flicker')
    assert s.states['gyro_x'].model.labels == ['white']
    assert len(s.history) == 3
    (back,) = s.remove('flicker')                     # only gyro_y has it
    assert back.target == 'gyro_y'


def test_undo_takes_out_the_last():
    s = begin('white')
    s.add(['flicker'])
    s.add(['random_walk'])
    s.undo(['gyro_x'])
    assert s.states['gyro_x'].model.labels == ['white', 'flicker']
    assert s.states['gyro_y'].model.labels == ['white', 'flicker', 'random_walk']
    s.undo()
    s.undo()
    assert s.states['gyro_y'].model.labels == ['white'] and s.undo() == []


def test_misuse_is_said():
    s = begin('white')
    for call, message in (
            (lambda: s.add(['flicke']), 'unknown noise effect flicke: did you mean flicker'),
            (lambda: s.add(['white']), 'already has white'),
            (lambda: s.add(['flicker'], ['gyro_q']), 'unknown axis gyro_q'),
            (lambda: s.remove('flicker'), 'unknown label flicker'),
            (lambda: s.compare(['gyro_z']), 'unknown axis gyro_z')):
        with pytest.raises(UsageError, match=message) as error:
            call()
        assert error.value.remedy
    assert len(s.history) == 2 and s.states['gyro_x'].model.labels == ['white']


# --- a user's own effect -------------------------------------------------------------------------

RESONANCE = '''
"""A broad mechanical resonance of the mount."""
from imu_noise_tools.noise import Parameter, Spectrum


class Resonance(Spectrum):
    """White force on a damped oscillator."""

    name = 'mount_resonance'
    symbol = 'A, f0, q'
    title = 'resonance of the mount'
    equation = 'S(f) = A^2/((1 - (f/f0)^2)^2 + (f/(q f0))^2)'
    signature = 'a broad hump in the PSD'
    hint = 'Tap the mount and listen; stiffen it.'
    reference = 'any book on vibration'
    parameters = (Parameter('A', '{rate}/sqrt(Hz)', 1e-10, 1e2, amplitude=True, title='density'),
                  Parameter('f0', 'Hz', 0.5, 9.0, title='frequency'),
                  Parameter('q', '1', 1.0, 50.0, title='quality'))

    def psd(self, f, dt):
        u = f / self['f0']
        return self['A'] ** 2 / ((1 - u ** 2) ** 2 + (u / self['q']) ** 2)
'''


@pytest.fixture
def own_effect(tmp_path):
    """Load the effect above, and forget it afterwards."""
    before = dict(effect._REGISTRY['noise'])
    path = tmp_path / 'my_effects.py'
    path.write_text(RESONANCE)
    assert effect.load_effects(path) == ['mount_resonance']
    yield
    effect._REGISTRY['noise'] = before


def test_an_effect_of_the_users_own(own_effect):
    """Twenty lines in a file: fitted, scored and added by name, with no change anywhere else."""
    rng = np.random.default_rng(3)
    n, dt, centre, quality = 72_000, 0.05, 2.5, 4.0
    scene = hidden.Scene(np.arange(n) * dt, dt, rng, {}, {}, '')
    y = hidden.base_noise(n, dt, SENSOR, rng) + 4e-4 * hidden.resonance(scene, centre, quality)
    record = ImuRecord(np.column_stack([y] * 3), None, scene.t, 1 / dt)
    problem = NoiseProblem(gather(record, ['gyro_x'])['gyro_x'])
    s = Study.begin({'gyro_x': problem}, model_of('noise', ['white', 'flicker', 'random_walk']))
    assert not s.compare()['gyro_x'].within_chance
    (step,) = s.add(['mount_resonance'])
    assert step.fall > 1000 and step.effects[-1] == 'mount_resonance'
    found = s.states['gyro_x'].fit.estimates['mount_resonance']
    assert found['f0'].value == pytest.approx(centre, rel=0.03)
    assert found['q'].value == pytest.approx(quality, rel=0.15)
    assert found['A'].ci95[0] < found['A'].value < found['A'].ci95[1]
    view = s.compare()['gyro_x'].views['frequency']
    assert view.excess < 3 * view.std
    # and the noise of the sensor is what it is without the resonance
    assert s.states['gyro_x'].fit.estimates['white']['N'].value == pytest.approx(1e-4, rel=0.02)


# --- a problem of another kind -------------------------------------------------------------------

class Term(Effect):
    """A power of x in a polynomial."""

    domain = 'polynomial'


class Constant(Term):
    """1."""

    name, power = 'constant', 0
    parameters = (Parameter('c', '', -1e9, 1e9, log=False, linear=True),)


class Slope(Term):
    """The first power of x."""

    name, power = 'slope', 1
    parameters = Constant.parameters


class Bend(Term):
    """The second power of x."""

    name, power = 'bend', 2
    parameters = Constant.parameters


@dataclass
class Points(Problem):
    """A problem that has nothing to do with noise: a polynomial through points of known error."""

    x: np.ndarray
    y: np.ndarray
    target: str = 'points'
    seen: tuple = ()

    domain = 'polynomial'

    def split(self):
        a, b = (Points(self.x[i::2], self.y[i::2]) for i in (0, 1))
        return [(a, b), (b, a)]

    def _columns(self, model):
        return np.column_stack([self.x ** e.power for e in model])

    def fit(self, model):
        i = self._columns(model)
        c = np.linalg.lstsq(i, self.y, rcond=None)[0]
        fitted = Model(e.with_values(c=v) for e, v in zip(model, c))
        rest = self.y - i @ c
        if np.linalg.matrix_rank(i) < i.shape[1]:
            raise FitError('the points cannot tell these powers apart', 'remove one')
        std = np.sqrt(np.diag(np.linalg.inv(i.T @ i)))
        return Fit(fitted, {e.label: {'c': Estimate(float(v), float(s), (v - 2 * s, v + 2 * s))}
                            for e, v, s in zip(model, c, std)}, float(-0.5 * rest @ rest))

    def score(self, fit):
        pull = self.y - self._columns(fit.model) @ [e['c'] for e in fit.model]
        k = len(pull)
        return Score.of([View('points', self.x, pull, float(np.mean(pull ** 2 - 1)),
                              float(np.sqrt(2 / k)))])

    def omnibus(self, fit):
        from scipy.stats import chi2
        z = self.score(fit).views['points'].pull
        p = chi2.sf(z @ z, len(z) - len(fit.model))
        return [Finding('points', 0.0, view='points', p_value=float(p))]

    def candidates(self, fit):
        out = []
        for e in (Constant(), Slope(), Bend()):
            if e.name not in fit.model:
                try:
                    other = self.fit(effect.unfitted(fit.model).plus(e))
                except FitError:
                    continue
                out.append(Finding(e.name, other.log_likelihood - fit.log_likelihood,
                                   other.model[e.name], other.estimates[e.name], 6.0, 'points'))
        return out


def parabola(bend, seed=0, trend=2.0):
    """Return a study of points around a line with a bend, that knows only the constant."""
    x = np.linspace(-1, 1, 200)
    noise = np.random.default_rng(seed).standard_normal(200)
    problem = Points(x, 5 + trend * x + bend * x ** 2 + noise)
    return Study.begin({'points': problem}, model_of('polynomial', ['constant']))


def test_the_loop_finds_what_is_missing():
    s = parabola(bend=4.0, trend=0.0)
    found = s.diagnose()['points']
    assert found.verdict == 'missing' and found.ranked[0].name == 'bend'
    assert found.ranked[0].probability > 0.9 and [f.name for f in found.failed] == ['points']
    (step,) = s.complete()
    assert step.added == 'bend' and step.verdict == 'falls to chance'
    assert s.diagnosis['points'].verdict == 'complete'
    assert s.states['points'].model['bend']['c'] == pytest.approx(4, abs=1)
    assert s.add() == [], 'nothing is missing, so nothing is added'


def test_each_verdict_is_told_as_soon_as_it_is_known():
    """And each rung; of long work it is seen where it is."""
    both = {'one': parabola(4.0, trend=0.0).states['points'].problem,
            'two': parabola(0.0, trend=0.0).states['points'].problem}
    s = Study.begin(both, model_of('polynomial', ['constant']))
    heard: list = []

    def told(target, step):
        heard.append((target, step and step.added, sorted(s.diagnosis)))

    def progress(share, what):
        heard.append(what)

    s.diagnose(progress=progress, told=told)
    assert heard == [
        'one: looks for what is missing', ('one', None, ['one']), 'one: missing',
        'two: looks for what is missing', ('two', None, ['one', 'two']), 'two: complete']
    s = Study.begin(both, model_of('polynomial', ['constant']))
    heard.clear()
    s.complete(told=told)
    assert heard == [('one', 'bend', []), ('one', None, ['one']), ('two', None, ['one', 'two'])]


def test_where_a_member_has_fallen_more_is_looked_at():
    """Of a place that was passed by, as the effort is bounded, the candidates are had then."""
    s = parabola(bend=4.0)
    s.states['points'].problem.looks = 0
    places = Places(s.states['points'])
    base, more = places.base, places.base.plus(Slope())
    assert places.at(base).candidates and not places.at(more).candidates
    places.look_further(1)
    assert [f.name for f in places.at(more).candidates] == ['bend']


def test_the_loop_finds_two_one_after_another():
    """Neither alone heals the view in which both show; the first must not wait for the other."""
    s = parabola(bend=8.0)
    steps = s.complete()
    assert {x.added for x in steps} == {'slope', 'bend'} and len(steps) == 2
    assert steps[0].held_out > steps[1].held_out and steps[1].verdict == 'falls to chance'
    assert s.diagnosis['points'].verdict == 'complete'


def test_what_shows_only_beside_another_is_added_after_it(monkeypatch):
    """The first of what is found that raises nothing; of what was tried before nothing is left."""
    first = [f.name for f in parabola(bend=8.0).diagnose()['points'].found][0]
    higher = Study._higher
    monkeypatch.setattr(Study, '_higher', lambda self, t, before, step: (
        step.added == first and len(before.model) == 1 or higher(self, t, before, step)))
    s = parabola(bend=8.0)
    steps = s.complete()
    assert [x.added for x in steps] == [*({'slope', 'bend'} - {first}), first]
    assert s.history[-2:] == steps and s.diagnosis['points'].verdict == 'complete'


def test_where_each_raises_the_error_all_that_is_found_is_added_together(monkeypatch):
    """Of four steps each may leave more to see than there was."""
    higher = Study._higher
    monkeypatch.setattr(Study, '_higher', lambda self, t, before, step: (
        step.added in ('slope', 'bend') or higher(self, t, before, step)))
    s = parabola(bend=8.0)
    (step,) = s.complete()
    assert set(step.added.split('+')) == {'slope', 'bend'} and s.history[-1:] == [step]
    assert s.diagnosis['points'].verdict == 'complete'


def test_what_was_added_and_taken_back_is_not_advised_again(monkeypatch):
    """It raised the error of this very model; what the user himself took out is found again."""
    s = parabola(bend=4.0, trend=0.0)
    s.add(['bend'])
    s.remove('bend')
    assert [f.name for f in s.diagnose()['points'].found] == ['bend']
    monkeypatch.setattr(study, 'fall_of', lambda *_: -10.0)
    up, back = s.complete()
    assert (up.added, back.removed) == ('bend', 'bend')
    for said in (s.diagnosis['points'], s.diagnose()['points']):
        assert said.verdict == 'unknown' and not said.found
        assert {f.name: f.against for f in said.ranked}['bend'] == study.TRIED
    s.add(['slope'])
    assert [f.name for f in s.diagnose()['points'].found] == ['bend']  # beside another it may do


def test_the_loop_adds_the_best_by_itself():
    s = parabola(bend=0.0)
    (step,) = s.add()
    assert step.added == 'slope' and s.diagnosis == {}
    assert s.diagnose()['points'].verdict == 'complete'


def test_verdicts_on_nothing():
    complete = [parabola(0.0, seed, trend=0.0).diagnose()['points'].verdict for seed in range(60)]
    assert complete.count('complete') >= 57 and 'missing' not in complete


def test_what_no_candidate_explains_is_unknown():
    s = parabola(bend=0.0, trend=0.0)
    s.states['points'].problem.y += 6 * np.sign(np.sin(40 * s.states['points'].problem.x))
    s = Study.begin({'points': s.states['points'].problem}, model_of('polynomial', ['constant']))
    found = s.diagnose()['points']
    assert found.verdict == 'unknown' and [f.name for f in found.failed] == ['points']
    assert s.add() == []


def test_rivals_that_cannot_be_told_apart_are_undecidable():
    """Two names for the same column: neither is sure."""
    class Twin(Term):
        name, power = 'twin', 1
        parameters = Constant.parameters

    try:
        s = parabola(bend=0.0)
        problem = s.states['points'].problem
        single = problem.candidates

        def doubled(fit):
            found = [f for f in single(fit) if f.name == 'slope']
            return found + [Finding('twin', f.gain, Twin({'c': 1.0}), f.estimates, f.penalty,
                                    f.view) for f in found]
        problem.candidates = doubled
        found = s.diagnose()['points']
        assert found.verdict == 'undecidable'
        assert {f.name for f in found.ranked} == {'slope', 'twin'}
        assert found.ranked[0].probability == pytest.approx(0.5, abs=0.01)
    finally:
        effect._REGISTRY['polynomial'].pop('twin')


# --- small parts ---------------------------------------------------------------------------------

def test_holm():
    def failed(*p):
        found = [Finding('x', 0, p_value=v) for v in p]
        return [f.p_value for f in findings.failures(found, 0.05)]
    assert failed(0.5, 0.9) == []
    assert failed(0.001, 0.9, 0.02) == [0.001, 0.02]       # 0.02 <= 0.05/2
    assert failed(0.03, 0.03, 0.03) == []                  # 0.03 > 0.05/3: none passes the first
    assert failed(0.0, 0.04) == [0.0, 0.04]


def test_fall_is_judged_in_the_views_of_the_effect():
    def score(f, t):
        return Score.of([View('frequency', np.zeros(10), np.zeros(10), f, 0.1),
                         View('time', np.zeros(5), np.zeros(5), t, 0.1)])

    class Timely(Term):
        views = ('time',)

    before, after = score(1.0, 2.0), score(0.5, 0.0)
    assert prediction.fall_of(before, after, [Timely()]) == pytest.approx(10)
    assert prediction.fall_of(before, after, [Constant()]) == pytest.approx(15)


def test_a_muted_view_is_heard_only_as_a_change_where_it_is_named():
    def score(d, muted):
        return Score.of([View('frequency', np.zeros(10), np.zeros(10), 1.0, 0.1),
                         View('shape', np.zeros(5), np.zeros(5), d, 0.1, muted=muted)])

    class Shapely(Term):
        views = ('shape',)

    loud, quiet = score(40.0, True), score(10.0, True)
    assert loud.excess == 0.5 and loud.std == 0.05 and list(loud.views) == ['frequency']
    assert loud.within_chance == score(40.0, True).within_chance is False
    assert prediction.fall_of(loud, quiet, [Shapely()]) == pytest.approx(150)
    assert prediction.fall_of(loud, quiet, [Constant()]) == 0
    # what was heard before and is muted now counts with its excess, as a view that is not there
    assert prediction.fall_of(score(40.0, False), loud, [Shapely()]) == pytest.approx(200)


def test_what_stands_in_the_shadow_of_the_unknown_is_not_named():
    """A slope heals the view that it is judged in; far more fails elsewhere, and stays so."""
    s = parabola(bend=0.0)
    problem = s.states['points'].problem
    plain = type(problem).omnibus

    def with_shadow(size):
        problem.omnibus = lambda fit: [*plain(problem, fit),
                                       Finding('elsewhere', size, view='elsewhere', p_value=0.0)]
        return s.diagnose()['points']
    gain = with_shadow(0.0).ranked[0].gain
    assert with_shadow(0.5 * verdict.SHADOW * gain).verdict == 'missing'
    assert with_shadow(2.0 * verdict.SHADOW * gain).verdict == 'unknown'
