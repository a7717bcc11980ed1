# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pictures show what they claim: numbers against oracles, artists against the numbers."""

from __future__ import annotations

from dataclasses import replace
import io
import math
import subprocess
import sys
from types import SimpleNamespace
import warnings

from matplotlib.colors import to_hex
from matplotlib.image import imread
import numpy as np
from params import daily
import pytest

from imu_noise_tools.core import allan, gauss_markov, units
from imu_noise_tools.core.errors import FitError, ImuNoiseError
from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.filter import statespace
from imu_noise_tools.loop.diagnosis import Diagnosis
from imu_noise_tools.loop.effect import Finding, Model, model_of, registry, Score
from imu_noise_tools.loop.prediction import State
from imu_noise_tools.loop.study import assess, Step, Study
from imu_noise_tools.noise.behind import model_avar
from imu_noise_tools.noise.curve import effect_avar, model_curve
from imu_noise_tools.noise.gather import gather
from imu_noise_tools.noise.kinds import Coupling, Inputs
from imu_noise_tools.noise.problem import NoiseProblem
from imu_noise_tools.plots import curves, noise, panels, proof, signed, style
from imu_noise_tools.plots.ladder import ladder, ladder_figure

DT, N = 0.02, 60000
KNOWN = registry('noise')
BASE = (KNOWN['white']({'N': 1e-4}), KNOWN['flicker']({'B': 4e-5}),
        KNOWN['random_walk']({'K': 2e-5}))


def record(extra=(), seed=0, n=N):
    """Return a record: the base model on all axes, more on gyro_y; temperature rises evenly."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) * DT
    temperature = {'temperature': 20 + 10 * t / t[-1]}
    data = np.zeros((n, 6))
    for k in range(6):
        for e in BASE:
            data[:, k] = e.apply(data[:, k], Inputs(t, DT), rng)
    axes = {f'{s}_{a}': data[:, 3 * i + j]
            for i, s in enumerate(('gyro', 'accel')) for j, a in enumerate('xyz')}
    for e in extra:
        data[:, 1] = e.apply(data[:, 1], Inputs(t, DT, temperature, axes), rng)
    return ImuRecord(data[:, :3], data[:, 3:], t, 1 / DT, covariates=temperature)


@pytest.fixture(scope='module')
def study():
    """Return a study whose gyro_y hides a sinusoid."""
    some = record([KNOWN['sinusoid']({'amplitude': 3e-4, 'frequency': 3.7})])
    found = gather(some, some.axes)
    return Study.begin({a: NoiseProblem(e) for a, e in found.items()},
                       model_of('noise', ['white', 'flicker', 'random_walk']))


def texts(ax):
    """Return all that is written on an axes."""
    return [t.get_text() for t in ax.texts]


def an_axes():
    """Return an empty axes."""
    return style.new_figure(6, 4).add_subplot()


def state_of(curve, model):
    """Return what :func:`curves.curves` needs of a state."""
    evidence = SimpleNamespace(curve=curve, dt=DT)
    return SimpleNamespace(problem=SimpleNamespace(evidence=evidence), model=model)


# --- numbers -------------------------------------------------------------------------------------

def test_effects_sum_to_the_model(study):
    state = study.states['gyro_x']
    found = curves.curves(state)
    c = state.problem.evidence.curve
    assert set(found.each) == set(state.model.labels)
    np.testing.assert_allclose(found.model, model_avar(state.model, c.m, c.dt), rtol=1e-12)


def test_effects_sum_to_the_model_behind_a_response():
    model = Model([*BASE, KNOWN['low_pass'].example()])
    m = np.array([1, 3, 10, 100])
    each = [effect_avar(SimpleNamespace(dt=DT), model, e, m) for e in model]
    assert each[-1] is None
    np.testing.assert_allclose(sum(each[:-1]), model_avar(model, m, DT), rtol=1e-9)


@pytest.mark.thorough
def test_pulls_of_a_true_model_are_standard_normal():
    """At every tau: no systematic offset, never wider than chance, and beyond 2 in 5 % or less."""
    model, rng = Model(BASE), np.random.default_rng(1)
    inputs = Inputs(np.arange(20000) * DT, DT)
    found = []
    for _ in range(150):
        y = np.zeros(20000)
        for e in model:
            y = e.apply(y, inputs, rng)
        found.append(curves.curves(state_of(allan.curve(y, DT, points=30), model)).pull)
    found = np.array(found)
    assert np.all(np.abs(found.mean(axis=0)) < 0.4)
    assert np.all((found.std(axis=0) > 0.6) & (found.std(axis=0) < 1.2))
    assert np.mean(np.abs(found) > 2) < 0.06
    # what is shaded in red is hardly ever chance
    assert np.mean([bool(curves.runs(p)) for p in found]) < 0.08


def test_pulls_see_what_the_model_lacks():
    rng = np.random.default_rng(2)
    inputs = Inputs(np.arange(20000) * DT, DT)
    y = np.zeros(20000)
    for e in BASE:
        y = e.apply(y, inputs, rng)
    state = state_of(allan.curve(y, DT), Model(BASE[:1]))
    found = curves.curves(state)
    (a, b), *_ = curves.runs(found.pull)[-1:]
    assert b == len(found.pull) and found.tau[a] < 30
    assert np.all(found.pull[a:b] > 2)


@pytest.mark.parametrize('deviation', ['mdev', 'hdev', 'totdev'])
def test_no_model_is_drawn_beside_a_deviation_it_does_not_predict(deviation):
    y = np.random.default_rng(0).standard_normal(2000)
    curve = allan.curve(y, DT, deviation=deviation, points=20)
    assert curves.curves(state_of(curve, Model(BASE))) is None


def test_runs():
    pull = np.zeros(30)
    pull[3:5] = 4.0            # too short
    pull[8:12] = 2.5           # not striking
    pull[15:18] = [2.1, 3.2, 2.1]
    pull[20] = -5.5            # striking enough alone
    pull[25:30] = -4.0         # to the end
    assert curves.runs(pull) == [(15, 18), (20, 21), (25, 30)]
    assert curves.runs(np.zeros(0)) == []


def test_variance_of_a_drift():
    """A temperature that rises evenly makes a ramp: R^2 tau^2 / 2."""
    some = record(n=40000)
    evidence = gather(some, ['gyro_x'])['gyro_x']
    effect = KNOWN['temperature']({'slope': 1e-3, 'curvature': 0.0, 'cubed': 0.0, 'lag': 0.0})
    m = np.array([1, 10, 100, 1000, 10000])
    rise = 1e-3 * 10 / some.t[-1]
    np.testing.assert_allclose(effect_avar(evidence, Model([effect]), effect, m),
                               (rise * m * DT) ** 2 / 2, rtol=0.01)


def test_variance_of_several_means():
    """A step up and a step down are one pulse beside a ramp: their variances do not add up."""
    some = record(n=40000)
    evidence = gather(some, ['gyro_x'])['gyro_x']
    e, length = evidence.curve, evidence.common.slow_length
    step = KNOWN['step']
    means = [KNOWN['ramp']({'R': 3e-5}), step({'size': 0.01, 'time': 150.0}, 'step'),
             step({'size': -0.02, 'time': 210.0}, 'step.2')]
    model = Model([KNOWN['white']({'N': 1e-9}), *means])
    m = e.m[e.m > 4 * length]
    t = some.t - some.t[0]
    true = np.sqrt(allan.overlapping_variance(
        3e-5 * t + 0.01 * (t >= 150) - 0.02 * (t >= 210), m))
    np.testing.assert_allclose(np.sqrt(model_curve(evidence, model, m)), true, rtol=0.01)
    each = sum(effect_avar(evidence, model, e, m) for e in means)
    assert np.max(np.sqrt(each) / true) > 1.3
    state = SimpleNamespace(problem=SimpleNamespace(evidence=evidence), model=model)
    np.testing.assert_allclose(curves.curves(state).model[e.m > 4 * length], true ** 2, rtol=0.02)


@pytest.mark.thorough
def test_variance_of_couplings_that_hold_the_same():
    """What shakes an accelerometer shakes another axis too: shares of both are one."""
    some = record(seed=5)
    shake = some.accel[:, 0]
    gyro = 0.01 * some.gyro
    gyro[:, 1:] += 0.5 * shake[:, None]
    gyro[:, 0] += 0.5 * gyro[:, 1] + 0.5 * shake
    some = replace(some, gyro=gyro)
    evidence = gather(some, some.axes)['gyro_x']
    couplings = [KNOWN['accel_coupling']({p.name: 0.0 for p in KNOWN['accel_coupling'].parameters}
                                         | {'gain_x': 0.5}),
                 KNOWN['shared_noise']({p.name: 0.0 for p in KNOWN['shared_noise'].parameters}
                                       | {'gain': 0.5, 'source': 'gyro_y', 'other': 'gyro_z'})]
    model, m = Model(couplings), np.array([1, 10, 100])
    wanted = allan.overlapping_variance(gyro[:, 0], m)
    np.testing.assert_allclose(model_curve(evidence, model, m), wanted, rtol=0.1)
    each = sum(effect_avar(evidence, model, e, m) for e in couplings)
    assert np.all(each > 1.2 * wanted)


@pytest.mark.thorough
def test_variance_of_a_coupling():
    """Half of another axis has a quarter of that axis' Allan variance."""
    some = record(seed=5)
    accel = some.accel[:, 0]
    some = replace(some, gyro=some.gyro * 0.01 + 0.5 * accel[:, None])
    evidence = gather(some, ['gyro_x', 'accel_x'])['gyro_x']
    effect = KNOWN['accel_coupling']()
    model = Model([KNOWN['white'](), effect])
    fit = NoiseProblem(evidence).fit(model)
    m = np.array([1, 10, 100])
    got = effect_avar(evidence, fit.model, fit.model['accel_coupling'], m)
    np.testing.assert_allclose(got, 0.25 * allan.overlapping_variance(accel, m), rtol=0.1)


def test_variance_of_what_is_screened():
    """Spikes leave the fit, not the curve: the model with spikes goes through it."""
    spikes = KNOWN['spikes']({'rate': 0.2, 'sigma': 0.05})
    evidence = gather(record([spikes]), ['gyro_y'])['gyro_y']
    state = assess(NoiseProblem(evidence), Model([e.__class__() for e in (*BASE, spikes)]))
    found = curves.curves(state)
    m = state.problem.evidence.curve.m
    white = 0.2 * DT * 0.05 ** 2 / m
    np.testing.assert_allclose(found.each['spikes'][:20], white[:20], rtol=0.3)
    assert curves.runs(found.pull) == []


def test_crests_of_a_line():
    effect = KNOWN['sinusoid']({'amplitude': 1e-4, 'frequency': 1.3})
    m = allan.cluster_sizes(100000)
    crest, v = curves.line_envelope(effect, m, DT), effect.avar(m, DT)
    assert np.all(crest >= v * (1 - 1e-9))
    rising = m * DT < 0.5 / 1.3
    np.testing.assert_array_equal(crest[rising], v[rising])
    np.testing.assert_allclose(crest[~rising], (1e-4 / (np.pi * 1.3 * m[~rising] * DT)) ** 2,
                               rtol=0.01)


def test_coefficients_are_read_on_their_lines(study):
    state = study.states['gyro_x']
    found = curves.curves(state)
    read = {r.symbol: r for r in curves.readings(state, found)}
    assert set(read) == {'N', '0.664 B', 'K'}
    assert (read['N'].tau, read['K'].tau) == (1.0, 3.0)
    for r in read.values():
        on_line = np.interp(r.tau, found.tau, np.sqrt(found.each[r.label]))
        assert r.sigma == pytest.approx(on_line, rel=0.02)


# --- what is drawn -------------------------------------------------------------------------------

def test_allan_names_effects_and_marks_readings(study):
    state = study.states['gyro_x']
    ax = panels.allan(an_axes(), state)
    said = texts(ax)
    for label in state.model.labels:
        shown = label if curves.observable(state, label) else f'({label})'
        assert shown in said
    assert 'N' in said
    assert '°/h' in ax.get_ylabel()
    measured = ax.lines[0]
    factor = np.pi / 180 / 3600
    np.testing.assert_allclose(measured.get_ydata() * factor, state.problem.evidence.curve.dev)


def test_what_is_not_observable_is_in_parentheses_and_not_marked(study):
    state = study.states['gyro_x']
    estimates = {k: dict(v) for k, v in state.fit.estimates.items()}
    estimates['random_walk']['K'] = replace(estimates['random_walk']['K'], value=None)
    state = replace(state, fit=replace(state.fit, estimates=estimates))
    said = texts(panels.allan(an_axes(), state))
    assert '(random_walk)' in said and 'K' not in said and 'N' in said


@pytest.mark.parametrize(('verdict', 'label'), [
    ('missing', 'sinusoid'), ('unknown', 'something unknown'), ('complete', None), (None, None),
    ('undecidable', 'sinusoid or gauss_markov?')])
def test_failing_pulls_are_shaded_and_named(study, verdict, label):
    found = curves.curves(study.states['gyro_y'])
    ranked = (Finding('sinusoid', 90.0, penalty=5.0), Finding('gauss_markov', 60.0, penalty=5.0),
              Finding('ramp', 1.0, penalty=5.0))
    named = ranked[:1] if verdict == 'missing' else ()
    diagnosis = verdict and Diagnosis(verdict, ranked, found=named)
    ax = panels.pulls(an_axes(), found.tau, found.pull, panels.suspected(diagnosis))
    assert texts(ax) == ([label] if label else [])
    red = [p for p in ax.patches if to_hex(p.get_facecolor()) == style.FAIL]
    assert len(red) == len(curves.runs(found.pull)) > 0


def test_nothing_is_shaded_where_nothing_fails(study):
    found = curves.curves(study.states['gyro_x'])
    ax = panels.pulls(an_axes(), found.tau, found.pull, 'sinusoid')
    assert not texts(ax)
    assert not [p for p in ax.patches if to_hex(p.get_facecolor()) == style.FAIL]


def test_a_line_in_the_spectrum_is_named_until_it_is_in_the_model(study):
    before = study.states['gyro_y']
    assert '3.7 Hz' in texts(panels.psd(an_axes(), before))
    after = assess(before.problem, before.model + KNOWN['sinusoid']())
    assert '3.7 Hz' not in texts(panels.psd(an_axes(), after))


def test_the_flat_part_of_the_spectrum_reads_n(study):
    state = study.states['gyro_x']
    ax = panels.psd(an_axes(), state)
    white = next(x for x in ax.lines if x.get_linestyle() == '--')
    assert white.get_ydata()[-1] * np.pi / 180 == pytest.approx(state.model['white']['N'])


def test_series_shows_the_extremes_and_what_was_left_out(study):
    state = study.states['accel_z']
    ax = panels.series(an_axes(), state, [(60.0, 120.0, 'knock')])
    _, lowest, highest = state.problem.evidence.envelope.T
    path = ax.collections[0].get_paths()[0].vertices[:, 1]
    mean = np.mean(state.problem.evidence.slow_y)
    assert path.min() == pytest.approx(lowest.min() - mean)
    assert path.max() == pytest.approx(highest.max() - mean)
    grey = ax.patches[-1]
    assert (grey.get_x(), grey.get_x() + grey.get_width()) == pytest.approx((1.0, 2.0))


def _beyond(ax):
    return len(ax.lines[-1].get_xdata())


def test_loudness_and_distribution_mark_what_chance_does_not_explain(study):
    quiet = study.states['gyro_x']
    assert _beyond(panels.in_time(an_axes(), quiet)) <= 3
    assert _beyond(panels.distribution(an_axes(), quiet)) <= 2
    some = record()
    gyro = some.gyro.copy()
    gyro[N // 2:] *= 1.5
    loud = assess(NoiseProblem(gather(replace(some, gyro=gyro), ['gyro_x'])['gyro_x']),
                  model_of('noise', ['white']))
    assert _beyond(panels.in_time(an_axes(), loud)) > 100
    assert _beyond(panels.distribution(an_axes(), loud)) > 5


def alone_unless_coupled(some, name):
    """Return a record whose other axes are dead where an effect does not need them."""
    return some if issubclass(KNOWN[name], Coupling) else replace(
        some, gyro=some.gyro * [0, 1, 0], accel=None)


@pytest.mark.parametrize(
    'name', daily((n for n in KNOWN if n != 'white'), 'sinusoid'))
def test_every_effect_can_be_drawn(name):
    """One that a record cannot show as well; without any warning."""
    some = record([KNOWN[name].example()], n=10000)
    problem = NoiseProblem(gather(alone_unless_coupled(some, name), ['gyro_y'])['gyro_y'])
    try:
        fit = problem.fit(Model([KNOWN['white'](), KNOWN[name]()]))
    except ImuNoiseError:
        return                                      # refused in words
    state = State(problem, fit, Score(0.0, 1.0))
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        assert style.png(noise.target_figure(state, Diagnosis('unknown')))[:4] == b'\x89PNG'


# --- proofs --------------------------------------------------------------------------------------

def hidden(effect, n=N):
    """Return gyro_y of a record with an effect in it, fitted without it and with it."""
    some = alone_unless_coupled(record([effect], n=n), effect.name)
    problem = NoiseProblem(gather(some, ['gyro_y'])['gyro_y'])
    models = [model_of('noise', ['white', 'flicker', 'random_walk', *more])
              for more in ([], [effect.name])]
    return [State(problem, problem.point(m), Score(0.0, 1.0)) for m in models]


def test_a_temperature_is_shown_as_rate_over_temperature():
    slope = 2e-3
    before, after = hidden(KNOWN['temperature']({'slope': slope, 'curvature': 0.0, 'cubed': 0.0,
                                                 'lag': 0.0}))
    assert 'rate_over_temperature' not in noise.panels(before)
    shown = noise.panels(after)['rate_over_temperature']()
    points, line = shown.curves
    assert '°C' in shown.x_title and 19.9 < points.x.min() < points.x.max() < 30.1
    for curve in (points, line):        # in deg/s for a degree, measured and by the effect
        assert np.polyfit(curve.x, curve.y, 1)[0] == pytest.approx(math.degrees(slope), rel=0.2)
    for lag, said in ((8.0, 'behind a lag of 8 s'), (-8.0, 'ahead of a thermometer 8 s slow')):
        late = after.fit.model.with_values({'temperature': {'lag': lag}})
        shown = noise.panels(replace(after, fit=replace(after.fit, model=late)))
        assert said in shown['rate_over_temperature']().x_title


@pytest.mark.thorough
def test_a_telegraph_is_shown_by_its_levels_and_dwells():
    step, tau = 6e-4, 15.0
    before, after = hidden(KNOWN['rts']({'step': step, 'tau': tau}))
    shown = noise.panels(after)
    levels, dwells = (shown[k]().curves for k in ('levels_of_the_telegraph', 'dwell_times'))
    assert np.ptp(levels[1].y) == pytest.approx(math.degrees(step), rel=0.2)
    assert len(np.unique(levels[1].y)) == 2
    median = float(np.interp(-0.5, -dwells[0].y, dwells[0].x))
    assert median == pytest.approx(tau * math.log(2), rel=0.5)
    assert not {'levels_of_the_telegraph', 'dwell_times'} & set(noise.panels(before))


@pytest.mark.parametrize('name', daily(KNOWN, 'sinusoid', 'spikes'))
def test_every_effect_can_be_proven(name):
    """By the views and by what it shows of itself, if a record can hold it at all."""
    try:
        before, after = hidden(KNOWN[name].example(), n=10000)
    except (ImuNoiseError, FitError):
        return
    old, new = noise.panels(before), noise.panels(after)
    own = [new[k]() for k in new if k not in old]
    for view in KNOWN[name].views or ('frequency',):
        if view in old:
            with warnings.catch_warnings():
                warnings.simplefilter('error')
                figure = proof.proof_figure(old[view](), new[view](), [name], own, name)
                assert style.png(figure)[:4] == b'\x89PNG'
            assert len(figure.axes) == 2 + len(own)


def test_a_proof_shows_both_models_and_where_the_first_fails():
    before, after = hidden(KNOWN['sinusoid']({'amplitude': 3e-4, 'frequency': 3.7}))
    panels_ = [noise.panels(s)['frequency']() for s in (before, after)]
    figure = proof.proof_figure(*panels_, ['sinusoid'], [], 'sinusoid')
    key = [t.get_text() for t in figure.legends[0].get_texts()]
    assert {'measured', 'model without sinusoid', 'model with sinusoid',
            'sinusoid alone'} < set(key)
    place, = figure.axes[1].patches                     # shaded where it fails, and only there
    assert place.get_x() < 3.7 < place.get_x() + place.get_width() < 4.2
    clean = proof.proof_figure(panels_[1], panels_[1], [])
    assert not clean.axes[1].patches
    assert 'model' in [t.get_text() for t in clean.legends[0].get_texts()]


def test_the_filters_own_lines():
    f, dt = np.geomspace(0.01, 45, 50), 0.01
    known = registry('filter')
    white, slow = known['white']({'R': 0.04}), known['gauss_markov']({'sigma': 0.3, 'tc': 2.0})
    np.testing.assert_allclose(statespace.psd(white, f, dt), 2 * dt * 0.04)
    np.testing.assert_allclose(statespace.psd(slow, f, dt), gauss_markov.psd(f, 0.3, 2.0, dt))
    walk = known['random_walk'](dict.fromkeys([p.name for p in known['random_walk'].parameters],
                                              0.2))
    q = walk.block(dt).q[0, 0]
    np.testing.assert_allclose(statespace.psd(walk, f, dt),
                               2 * dt * q / (2 * np.sin(np.pi * f * dt)) ** 2, rtol=1e-3)


# --- the ladder ----------------------------------------------------------------------------------

def test_ladder():
    steps = [Step('accel', ('scale',), 50.0, 0.5, verdict='start'),
             Step('accel', ('scale', 'bias'), 0.3, 0.5, added='bias', verdict='falls to chance'),
             Step('accel', ('scale',), 50.0, 0.5, removed='bias', verdict='rises'),
             Step('gyro', ('scale',), 7.0, 0.5)]
    study = SimpleNamespace(history=steps, targets=['accel', 'gyro'])
    ax = ladder(an_axes(), study, 'accel')
    points = [x for x in ax.lines if x.get_marker() == 'o']
    assert [x.get_ydata()[0] for x in points] == [50.0, 0.3, 50.0]
    assert [x.get_color() for x in points] == [style.FAIL, style.GOOD, style.FAIL]
    chance = next(x for x in ax.lines if x.get_linestyle() == '--')
    np.testing.assert_allclose(chance.get_ydata(), 1.0)
    said = [t.get_text().split('\n')[0] for t in ax.get_xticklabels()]
    assert said == ['scale', '+ bias', '− bias']
    assert style.png(ladder_figure(study))[:4] == b'\x89PNG'


@pytest.mark.parametrize('error', [float('nan'), 0.0, -3.0, 1e9])
def test_ladder_takes_any_error(error):
    steps = [Step('accel', (), error, abs(error), verdict='start')]
    study = SimpleNamespace(history=steps, targets=['accel'])
    assert style.png(ladder_figure(study))[:4] == b'\x89PNG'


# --- figures -------------------------------------------------------------------------------------

def test_figures_are_the_same_twice_and_of_the_stated_size(study):
    first = style.png(noise.allan_figure(study))
    assert first == style.png(noise.allan_figure(study))
    assert imread(io.BytesIO(first)).shape[:2] == (1040, 1600)
    assert b'Software' not in first


def test_pixels_are_what_an_image_message_wants(study):
    figure = noise.series_figure(study)
    rgb = style.pixels(figure)
    assert rgb.dtype == np.uint8 and rgb.flags.c_contiguous
    shown = imread(io.BytesIO(style.png(figure)))[..., :3]
    np.testing.assert_array_equal(rgb, np.round(255 * shown).astype(np.uint8))


@pytest.mark.parametrize('axes', [['gyro_x'], ['accel_y', 'accel_z'], ['gyro_z', 'accel_x']])
def test_figures_of_some_axes(study, axes):
    some = Study('noise', {a: study.states[a] for a in axes}, {'left_out': [[1.0, 2.0, 'knock']]})
    panels_ = [ax.get_title(loc='left') for ax in noise.allan_figure(some).axes]
    assert [t for t in panels_ if t in axes] == axes
    assert style.png(noise.series_figure(some))


def test_no_global_state_of_matplotlib_is_touched():
    code = ('import sys, matplotlib; before = matplotlib.rcParams.copy()\n'
            'from imu_noise_tools.plots import noise, style\n'
            'figure = style.new_figure(3, 2)\n'
            'style.log_scale(style.dress(figure.add_subplot()).xaxis, 1, 100)\n'
            'style.png(figure)\n'
            'assert "matplotlib.pyplot" not in sys.modules\n'
            'assert matplotlib.rcParams.copy() == before\n')
    subprocess.run([sys.executable, '-W', 'ignore', '-c', code], check=True)


# --- small things --------------------------------------------------------------------------------

@pytest.mark.parametrize(('unit', 'shown'), [
    ('deg/sqrt(h)', '°/√h'), ('deg/h^1.5', '°/h¹·⁵'), ('ug/sqrt(Hz)', 'µg/√Hz'), ('m/s^2', 'm/s²'),
    ('m/s^3/sqrt(Hz)', 'm/s³/√Hz'), ('rad', 'rad'), ('degC^-1', '°C⁻¹')])
def test_units_as_people_write_them(unit, shown):
    assert style.readable(unit) == shown


@pytest.mark.parametrize(('value', 'shown'), [
    (0, '0'), (1, '1'), (0.001, '0.001'), (1e-5, '10⁻⁵'), (1000, '1000'), (1e6, '10⁶'),
    (-1e4, '−10⁴'), (20, '20')])
def test_numbers_of_ticks(value, shown):
    assert style.number(value) == shown


@pytest.mark.parametrize(('low', 'high'),
                         [(0.01, 1000), (3, 8), (0.9, 1.1), (1e-9, 1e9), (1, 10)])
def test_a_logarithmic_scale_has_ticks_within(low, high):
    ax = an_axes()
    style.log_scale(ax.xaxis, low, high)
    at = ax.get_xticks()
    assert 1 <= len(at) <= 10 and low <= min(at) and max(at) <= high


def test_names_on_lines_keep_clear_of_other_lines():
    ax = an_axes()
    style.log_scale(ax.xaxis, 1, 1000)
    style.log_scale(ax.yaxis, 1, 1000)
    x = np.geomspace(1, 1000, 100)
    style.label_lines(ax, [(x, x, 'up', 'r'), (x, 1000 / x, 'down', 'b'),
                           (x, x * 1e6, 'out', 'g')])
    where = {t.get_text(): np.array(t.get_position()) for t in ax.texts}
    assert set(where) == {'up', 'down'}
    assert abs(where['up'][0] - where['up'][1]) < 0.03              # on its own line
    assert abs(where['up'].sum() - 1) > 0.1                         # away from the other


def test_a_picture_says_what_it_is_of(study):
    """Name, topic, rate, duration and date stand in a strip of its own; what is above stays."""
    source = {'path': '/data/day 1/$bag', 'topic': '/imu', 'rate_hz': 200.0,
              'duration_s': 3600.0, 'start': 1.76e9}
    said = signed.origin(source)
    assert said == '$bag  ·  /imu  ·  200 Hz  ·  60 min  ·  2025-10-09 08:53 UTC'
    assert signed.origin({'path': 'x', 'start': 12.0, 'topic': ''}) == 'x'
    both = {'streams': {s: {'topic': f'/{s}', 'rate_hz': r} for s, r in
                        (('gyro', 400.0), ('accel', 200.0))}}
    assert signed.origin(both) == '/gyro  ·  /accel  ·  400 Hz  ·  200 Hz'
    figure = noise.series_figure(study)
    high = figure.get_figheight()
    before = [ax.get_window_extent().bounds for ax in figure.axes]
    assert signed.signed(figure, source).texts[-1].get_text() == said
    assert figure.get_figheight() == pytest.approx(high + signed.STRIP)
    for ax, (x, y, wide, tall) in zip(figure.axes, before):
        assert ax.get_window_extent().bounds == pytest.approx(
            (x, y + 100 * signed.STRIP, wide, tall), abs=0.01)
    assert style.png(figure)[:4] == b'\x89PNG'


def test_a_curve_says_its_values(study):
    """N, B, K stand above it with the units they are printed in; an upper limit is said to be."""
    state = study.states['gyro_x']
    ax = panels.allan(an_axes(), state)
    title = ax.get_title(loc='right')
    n = state.fit.estimates['white']['N'].value
    assert f'N {n / units.DEG * 60:.3g} °/√h' in title
    some = dict(state.fit.estimates)
    some['flicker'] = {'B': replace(some['flicker']['B'], value=None, upper95=1e-4)}
    panels.values(ax, replace(state, fit=replace(state.fit, estimates=some)))
    assert 'B < 20.6 °/h' in ax.get_title(loc='right')
    assert f'N = {n / units.DEG:.3g} °/s/√Hz = {n / units.DEG * 60:.3g} °/√h' == \
        panels.psd(an_axes(), state).get_title(loc='right')


def test_a_logarithmic_axis_can_be_read():
    """Over two decades 2 and 5 have numbers; between decades there are ticks without."""
    ax = an_axes()
    style.log_scale(ax.yaxis, 3.0, 250.0)
    assert [t.get_text() for t in ax.get_yticklabels()] == ['5', '10', '20', '50', '100', '200']
    assert 30 in ax.yaxis.get_minorticklocs() and 20 not in ax.yaxis.get_minorticklocs()
    style.log_scale(ax.yaxis, 1e-3, 1e3)
    assert 20 in ax.yaxis.get_minorticklocs()
    assert style.number(2e-5) == '2·10⁻⁵' and style.number(1e5) == '10⁵'


def test_names_keep_off_other_lines():
    """A name is wide: none of another line runs through it."""
    ax = an_axes()
    x = np.linspace(0, 1, 200)
    ax.set_xlim(0, 1)
    ax.set_ylim(0, 1)
    style.label_lines(ax, [(x, x, 'a_long_name', 'k')], [(x, np.minimum(x + 0.02, 0.5))])
    text = ax.texts[-1]
    ax.figure.canvas.draw()
    (x0, y0), (x1, y1) = ax.transData.inverted().transform(text.get_window_extent())
    other = np.minimum(x + 0.02, 0.5)
    inside = (x > x0) & (x < x1)
    assert not np.any((other[inside] > y0) & (other[inside] < y1))


def test_names_keep_off_names_and_hide_no_curve():
    """In a corner where all lines meet, and on a line that lies on a curve."""
    x = np.linspace(0, 1, 200)

    def boxes(lines, avoid=()):
        ax = style.new_figure(4, 3.5).add_subplot()
        ax.set_xlim(0, 1)
        ax.set_ylim(0, 1)
        style.label_lines(ax, lines, avoid)
        ax.figure.canvas.draw()
        return [ax.transData.inverted().transform(t.get_window_extent()) for t in ax.texts]

    def hides(box, y):
        inside = (x > box[0, 0]) & (x < box[1, 0])
        return np.any((y[inside] > box[0, 1]) & (y[inside] < box[1, 1]))
    for high, low in ((0.94, 0.75), (0.98, 0.8), (1.02, 0.8), (1.02, 0.9)):
        one, two = boxes([(x, high - x, 'white', 'b'), (x, x - low, '(random_walk)', 'r')],
                         [(x, np.maximum(1 - x, 0.12)), (x, np.maximum(1 - x, 0.1))])
        assert np.any(one[1] <= two[0]) or np.any(two[1] <= one[0]), (high, low)
    (box,) = boxes([(x, 1 - x, 'white', 'b')], [(x, 1 - x), (x, 1.005 - x)])
    assert not hides(box, 1 - x)


def test_values_above_a_curve_keep_off_its_name(study):
    """Where there is no room for all beside it they stand in rows."""
    from matplotlib.text import Text
    for target in study.targets:
        for wide in (6, 3.2, 2.2):
            figure = style.new_figure(wide, 3)
            ax = panels.allan(figure.add_subplot(), study.states[target])
            figure.draw_without_rendering()
            name, said = (next(t for t in ax.get_children() if isinstance(t, Text)
                               and t.get_text() == ax.get_title(loc=side)).get_window_extent()
                          for side in ('left', 'right'))
            assert name.x1 < said.x0, (target, wide)
