# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What looks like an effect and is of another form is not called by its name.

The records are drawn in the time domain or through the Fourier transform; no formula of the
package makes them.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from types import SimpleNamespace

import numpy as np
from params import daily, seldom
import pytest
from scipy.fft import dct
from scipy.signal import butter, chirp, iirnotch, iirpeak, lfilter, sosfilt
from scipy.stats import kurtosistest

import hidden
from imu_noise_tools.core import bell
from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.core.spectrum import Bins
from imu_noise_tools.core.statistics import kurtosis_pull
from imu_noise_tools.loop.effect import find_effect, Finding, Model, model_of, registry
from imu_noise_tools.loop.verdict import DIRECTED, FLEXIBLE
from imu_noise_tools.noise import (
    candidates, coupled, flexible, in_time, likelihood, nameless, normality, refitted, rivals,
    shared
)
from imu_noise_tools.noise.candidates import _one as tried, by_one_measure, Tried
from imu_noise_tools.noise.doubts import at_bound
from imu_noise_tools.noise.effects.low_pass import AVERAGED
from imu_noise_tools.noise.effects.variance_change import TIMES, VarianceChange
from imu_noise_tools.noise.explained import Explained
from imu_noise_tools.noise.gather import gather
from imu_noise_tools.noise.kinds import Inputs
from imu_noise_tools.noise.likelihood import Likelihood, told_anew
from imu_noise_tools.noise.nonlinear import follows_a_law
from imu_noise_tools.noise.problem import NoiseProblem
from imu_noise_tools.noise.starts import starts
from imu_noise_tools.noise.together import unlike_noise
from imu_noise_tools.tasks.noise import analyse_record

N, DT = 60_000, 0.01
T = np.arange(N) * DT
SIZE = 1e-4     # of a sample of white noise, rad/s


def found_in(gyro):
    """Return the names found in gyro_x of a record of three axes, (n,) each, and its diagnosis."""
    record = ImuRecord(np.column_stack(gyro), None, T[:len(gyro[0])], 1 / DT)
    study = analyse_record(record, axes=('gyro_x',), keep_motion=True)
    said = study.diagnose(['gyro_x'])['gyro_x']
    return [f.name for f in said.found], said


def axes_with(signal, rng):
    """Return three axes of white noise and a little drift that hear a signal, each its share."""
    return [SIZE * rng.standard_normal(N) + hidden.random_walk(N, DT, SIZE / 3e3, rng) + g * signal
            for g in (1.0, -0.7, 1.3)]


def two_wells(rng):
    """Return a path between two levels, each step of which takes some samples."""
    stay = rng.exponential(8.0, 200).cumsum()
    level = np.sign(0.5 - np.searchsorted(stay, T) % 2)
    return np.convolve(level, np.ones(20) / 20, 'same')


def coloured(rng, power):
    """Return noise of a power f^-power, of which a record is cut out."""
    f = np.fft.rfftfreq(8 * N, DT)
    spectrum = rng.standard_normal(len(f)) + 1j * rng.standard_normal(len(f))
    spectrum[1:] *= f[1:] ** (-0.5 * power)
    spectrum[0] = 0.0
    x = np.fft.irfft(spectrum)[3 * N:4 * N]
    return x / np.std(x)


@pytest.mark.thorough
def test_some_candidates_are_fitted_without_the_others():
    """With the others after them they are what they are beside them from the first."""
    rng = np.random.default_rng(15)
    y = SIZE * rng.standard_normal((6000, 3))
    y[3000:, 0] += 0.3 * SIZE
    evidence = gather(ImuRecord(y, None, T[:6000], 1 / DT), ['gyro_x'])['gyro_x']
    alone, whole = NoiseProblem(evidence), NoiseProblem(evidence)
    fit = alone.point(model_of('noise', ('white',)))
    some = alone.some_candidates(fit, lambda kind: kind.paired)
    assert 'step' == some[0].name and {k[-1] for k in alone.tried} == {
        name for name, kind in registry('noise').items() if kind.paired}
    assert not alone.knows_candidates(fit)
    for problem in (alone, whole):
        every = problem.candidates(fit)
        assert problem.knows_candidates(fit) and len(every) > len(some)
        assert [(f.name, f.gain) for f in every if f.effect.paired] == [
            (f.name, f.gain) for f in some]


def test_no_more_of_a_kind_is_looked_for_than_a_smooth_form_would_leave_a_name():
    """Three swings with harmonics bend to anything; of steps there may be as many as there are."""
    rng = np.random.default_rng(16)
    y = SIZE * rng.standard_normal((2000, 3))
    evidence = gather(ImuRecord(y, None, T[:2000], 1 / DT), ['gyro_x'])['gyro_x']
    problem = NoiseProblem(evidence)
    for names, there in ((['slow_periodic'] * 2 + ['step'] * 4, True),
                         (['slow_periodic'] * 3 + ['step'] * 4, False)):
        fit = problem.point(model_of('noise', ['white', *names]))
        found = {f.name for f in problem.some_candidates(fit, lambda kind: kind.paired)}
        assert ('slow_periodic' in found) == there and 'step' in found


@pytest.mark.thorough
def test_a_weak_relaxation_is_not_called_popcorn_noise():
    """Its spectrum is that of both, and the samples tell neither: what chance reaches is equal."""
    rng = np.random.default_rng(14)
    x = SIZE * rng.standard_normal(N)
    x += lfilter([0.003 * SIZE], [1, -0.99], rng.standard_normal(N + 2000))[2000:]
    problem = NoiseProblem(gather(ImuRecord(x[:, None] * [1, 0, 0] + SIZE * rng.standard_normal(
        (N, 3)) * [0, 1, 1], None, T, 1 / DT), ['gyro_x'])['gyro_x'])
    found = {f.name: f for f in problem.candidates(problem.point(model_of('noise', ('white',))))}
    assert found['rts'].penalty == found['gauss_markov'].penalty
    assert abs(found['rts'].gain - found['gauss_markov'].gain) < 3


@pytest.mark.thorough
def test_what_a_fit_leaves_open_does_not_do_the_work_of_noise():
    """Angle quantization beside a relaxation: two zeros and a pole, free, do what they do."""
    rng, n = np.random.default_rng(81), 30_000
    x = SIZE * rng.standard_normal((n, 3))
    x[:, 0] += SIZE * np.diff(rng.standard_normal(n + 1))
    x[:, 0] += lfilter([0.12 * SIZE], [1, -0.9], rng.standard_normal(n + 500))[500:]
    problem = NoiseProblem(gather(ImuRecord(x, None, T[:n], 1 / DT), ['gyro_x'])['gyro_x'])
    fit = problem.point(model_of('noise', ('white', 'flicker', 'random_walk')))
    assert fit.details.hint.order.terms
    found = tried(problem, fit, find_effect('noise', 'quantization')()).finding
    assert found.gain > 50
    assert found.effect['Q'] == pytest.approx(SIZE * DT, rel=0.1)


@pytest.mark.thorough
def test_noise_that_axes_share_is_named():
    rng = np.random.default_rng(5)
    names, said = found_in(axes_with(0.3 * SIZE * rng.standard_normal(N), rng))
    assert names == ['shared_noise'], said


@pytest.mark.thorough
@pytest.mark.parametrize('share', [0.0, 0.1])
def test_a_coupling_claims_what_it_shares_and_not_that_a_fit_was_caught(share):
    gyro = axes_with(share * SIZE * np.random.default_rng(7).standard_normal(N),
                     np.random.default_rng(6))
    evidence = gather(ImuRecord(np.column_stack(gyro), None, T, 1 / DT), axes=('gyro_x',))
    problem = NoiseProblem(evidence['gyro_x'])
    fit = problem.point(model_of('noise', ['white', 'flicker', 'random_walk']))
    high = fit.details.v * np.where(evidence['gyro_x'].whole.bins.f < 1, 3.0, 1.0)
    caught = replace(fit, details=replace(fit.details, v=high))
    some = {f.name: f for f in problem.candidates(caught)}
    named = some['shared_noise'].gain > some['shared_noise'].penalty
    assert named == (share > 0), some['shared_noise']
    # each axis once, by its name: as it is, and a quarter of a period later
    assert some['shared_noise'].evidence.startswith('coherent with gyro_')
    assert '^' not in some['shared_noise'].evidence and '~' not in some['shared_noise'].evidence


@pytest.mark.thorough
@pytest.mark.parametrize('signal', [
    pytest.param(lambda rng: 0.15 * SIZE * chirp(T, 0.5, T[-1], 40.0, 'logarithmic'), id='chirp'),
    pytest.param(lambda rng: 0.3 * SIZE * two_wells(rng), id='two wells')])
def test_what_axes_share_and_is_no_noise_is_not_called_noise(signal):
    rng = np.random.default_rng(6)
    names, said = found_in(axes_with(signal(rng), rng))
    assert 'shared_noise' not in names, said
    assert said.verdict == 'unknown' or said.remaining or {'rts', 'step'} & set(names)
    against = [f.against for f in said.ranked if f.name == 'shared_noise']
    assert against and against[0], said


@pytest.mark.thorough
@pytest.mark.parametrize('power', [0.6, 1.5])
def test_a_power_of_the_frequency_is_no_relaxation(power):
    rng = np.random.default_rng(7)
    names, said = found_in([SIZE * (0.1 * rng.standard_normal(N) + coloured(rng, power))
                            for _ in range(3)])
    assert 'gauss_markov' not in names, said


def test_the_pull_of_a_kurtosis_is_the_one_of_anscombe_and_glynn():
    rng = np.random.default_rng(9)
    for n, x in ((64, rng.standard_normal(64)), (300, rng.standard_t(4, 300))):
        x = x - x.mean()
        assert kurtosis_pull(x) == pytest.approx(kurtosistest(x).statistic, rel=1e-9), n
    assert kurtosis_pull(np.ones(8)) == 0.0 and kurtosis_pull(np.zeros(100)) == 0.0


@pytest.mark.thorough
def test_a_line_that_is_on_for_a_stretch_is_a_narrow_band():
    rng = np.random.default_rng(11)
    wander = 13.4 * T + 0.3 * np.cumsum(rng.standard_normal(N)) * DT
    on = (T > 0.4 * T[-1]) & (T < 0.6 * T[-1])
    line = 8 * SIZE * on * np.sin(2 * np.pi * wander)
    _, said = found_in([SIZE * rng.standard_normal(N) + g * line for g in (1.0, 0.0, 0.0)])
    bands = [f for f in said.found if f.name == 'narrowband']
    assert bands and abs(bands[0].effect['frequency'] - 13.4) < 0.05, said


def test_a_power_of_f_that_does_without_white_noise_and_flicker_is_no_low_pass():
    """f^-0.7 alone, of few samples: what the knee spends, a level and a flicker spent as well."""
    rng, n, dt = np.random.default_rng(2), 6000, 0.04
    f = np.fft.rfftfreq(8 * n, dt)
    spectrum = rng.standard_normal(len(f)) + 1j * rng.standard_normal(len(f))
    spectrum[1:] *= f[1:] ** -0.35
    spectrum[0] = 0.0
    x = np.fft.irfft(spectrum)[3 * n:4 * n]
    x *= 0.01 / np.std(x)
    record = ImuRecord(np.column_stack([x, *1e-4 * rng.standard_normal((2, n))]), None,
                       np.arange(n) * dt, 1 / dt)
    problem = NoiseProblem(gather(record, ['gyro_x'])['gyro_x'])
    base = ('white', 'flicker', 'random_walk')
    fit, after = (problem.point(model_of('noise', x)) for x in (base, (*base, 'low_pass')))
    gain = after.details.ml - fit.details.ml
    assert gain > 20 and 'steepness' in problem.shape(after, 'low_pass', gain)


@pytest.mark.thorough
@pytest.mark.parametrize('seed', [1, 4])
def test_what_a_filter_filters_is_asked_again_beside_noise_that_was_missing(seed):
    """Beside a random walk alone it filtered white noise; flicker passes it as well."""
    rng, n, dt = np.random.default_rng(seed), 18_000, 0.02
    f = np.fft.rfftfreq(8 * n, dt)
    spectrum = rng.standard_normal(len(f)) + 1j * rng.standard_normal(len(f))
    spectrum *= np.append(0.0, f[1:] ** -0.5)
    flicker = np.fft.irfft(spectrum)[3 * n:4 * n]
    passes = rng.standard_normal(n) + 0.35 * flicker / np.std(flicker)
    x = lfilter(*iirnotch(7.3, 3.3, fs=1 / dt), passes) + 0.06 * rng.standard_normal(n)
    record = ImuRecord(np.column_stack([1e-3 * x, *rng.standard_normal((2, n))]), None,
                       np.arange(n) * dt, 1 / dt)
    problem = NoiseProblem(gather(record, ['gyro_x'])['gyro_x'])
    fit = problem.point(model_of('noise', ('white', 'random_walk', 'notch')))
    flicker, other = (next(c for c in problem.candidates(fit) if c.name == name)
                      for name in ('flicker', 'gauss_markov'))
    assert flicker.gain - flicker.penalty > other.gain - other.penalty + 3, (flicker, other)
    without = problem.point(model_of('noise', ('white', 'notch', 'flicker')))
    with_it = problem.point(fit.model.plus(registry('noise')['flicker']()))
    assert with_it.details.ml > without.details.ml - 1.5


@pytest.mark.thorough
@pytest.mark.parametrize('redder, holds, seed', [(True, False, 24), (False, True, 10)])
def test_a_slow_mean_beside_a_spectrum_that_fails_is_asked_whether_the_noise_is_redder(
        redder, holds, seed):
    """A swing of f^-0.7 by chance, of which a knee leaves nothing; a real one beside a hump."""
    rng = np.random.default_rng(seed)
    y = 0.1 * rng.standard_normal(N)
    if redder:
        y = y + coloured(rng, 0.7)
    else:
        hump = lfilter([1.0], [1, -2 * 0.7 * np.cos(1.5), 0.49], 0.2 * rng.standard_normal(N))
        y = y + hump + 0.03 * np.sin(2 * np.pi * T / (0.4 * T[-1]))
    record = ImuRecord(np.column_stack([SIZE * y, *rng.standard_normal((2, N))]), None, T, 1 / DT)
    problem = NoiseProblem(gather(record, ['gyro_x'])['gyro_x'])
    base = ('white', 'flicker', 'random_walk')
    fit = problem.point(model_of('noise', base))
    swing, = (f for f in problem.candidates(fit) if f.name == 'slow_periodic')
    after = problem.point(model_of('noise', (*base, 'slow_periodic')))
    against = problem.shape(after, 'slow_periodic', swing.gain)
    assert (against == '') == holds, (swing, against)
    # asked for itself: such a swing may end at its bound as well
    against = rivals.shape(problem.evidence, after, fit, 'slow_periodic', swing.gain)
    assert (against == '') == holds and (holds or 'steepness' in against), against


@pytest.mark.thorough
@pytest.mark.parametrize('redder, seed', [(True, 6), (True, 7), (False, 3), (False, 4)])
def test_two_swings_that_hold_what_falls_with_the_cube_of_the_frequency_are_no_swings(
        redder, seed):
    rng = np.random.default_rng(seed)
    y = rng.standard_normal(N)
    if redder:
        y = y + 1.5 * coloured(rng, 3.0)
    else:
        y = y + sum(a * np.sin(2 * np.pi * T / (p * T[-1]) + seed)
                    for a, p in ((0.3, 0.7), (0.2, 0.23)))
    record = ImuRecord(np.column_stack([SIZE * y, *rng.standard_normal((2, N))]), None, T, 1 / DT)
    evidence = gather(record, ['gyro_x'])['gyro_x']
    base = ('white', 'flicker', 'random_walk', 'slow_periodic')
    one, both = (NoiseProblem(evidence).point(model_of('noise', x))
                 for x in (base, (*base, 'slow_periodic')))
    gain = both.details.ml - one.details.ml
    against = rivals.shape(evidence, both, one, 'slow_periodic.2', gain)
    assert ('noise that falls with f^-3' in against) == redder and (redder or not against), against


@pytest.mark.thorough
@pytest.mark.parametrize('t0', [0.5, 2.0])
def test_a_creep_with_the_logarithm_of_time_is_neither_a_shock_nor_a_drift(t0):
    rng = np.random.default_rng(31)
    creep = 1.5 * SIZE * np.log1p(T / t0)
    names, said = found_in([y - g * creep for y, g in zip(
        axes_with(np.zeros(N), rng), (1.0, -0.7, 1.3))])
    assert not set(names) - {'shared_noise'} and said.remaining is not None, said


@pytest.mark.parametrize('rings', [False, True])
def test_what_goes_off_to_one_side_is_no_shock(rings):
    rng = np.random.default_rng(32)
    away = 6 * np.exp(-0.5 * ((T - 200.0) / 0.15) ** 2)
    if rings:
        away = away * np.sqrt(2) * np.cos(2 * np.pi * 12 * T)
    y = SIZE * (rng.standard_normal(N) + away)
    kept = registry('noise')['shock'].statistics(y, Inputs(T, DT, {}, {}))
    assert bool(len(kept.get('begin', ()))) == rings


@pytest.mark.parametrize('knock', daily([False, True], True))
@pytest.mark.parametrize('dt, t0', [(DT, 0.1), seldom(DT, 0.5), seldom(0.04, 0.12)])
def test_what_settles_since_before_the_record_is_no_shock(dt, t0, knock):
    rng, t = np.random.default_rng(34), np.arange(N) * dt
    y = rng.standard_normal(N) - 40.0 * np.log1p(t / t0) if not knock \
        else rng.standard_normal(N) * (1 + 30 * np.exp(-t / 0.4))
    kept = registry('noise')['shock'].statistics(SIZE * y, Inputs(t, dt, {}, {}))
    assert bool(len(kept.get('begin', ()))) == knock


def test_three_peaks_with_no_valley_between_them_are_one_shape():
    cls = registry('noise')['narrowband']
    for count, apart, joined in ((3, 0.5, True), (3, 1.5, False), (2, 0.5, False)):
        peaks = [cls({'frequency': 5.0 + apart * k, 'width': 0.5, 'form': 0.0, 'rms': 1e-5},
                     f'peak.{k}') for k in range(count)]
        fit = SimpleNamespace(model=Model(peaks))
        runs = [rivals.joined(fit, e.label, DT) for e in peaks]
        assert all((len(run) >= rivals.TOGETHER) == joined for run in runs)
        assert all(e.label in run and len(run) == (1 if apart > 1 else count)
                   for e, run in zip(peaks, runs))


@pytest.mark.parametrize('second, form, one', [
    ((5.02, 0.9, 1.2e-6), 'displacement', True),    # its skirts
    ((5.02, 0.9, 2e-6), 'displacement', False),
    ((5.8, 0.9, 1.2e-6), 'displacement', True),
    ((6.2, 0.9, 1.2e-6), 'displacement', False),    # beside it
    ((5.2, 0.04, 2e-6), 'wandering', True),         # where it stayed a while
    ((5.2, 0.04, 2e-6), 'displacement', False),
    ((5.2, 0.04, 4e-6), 'wandering', False),
    ((5.8, 0.3, 2e-6), 'wandering', True),          # or on its skirts
    ((6.2, 0.3, 2e-6), 'wandering', False),
    ((5.2, 0.9, 7e-6), 'wandering', True),          # what is no bell
    ((5.2, 0.9, 7e-6), 'displacement', False),
    ((5.7, 0.9, 7e-6), 'wandering', True),          # it was here and there, and at times between
    ((5.7, 0.9, 7e-6), 'displacement', False),
    ((6.9, 0.9, 7e-6), 'wandering', False),
])
def test_of_two_peaks_that_lie_on_each_other_one_is_the_other_s_shape(second, form, one):
    cls = registry('noise')['narrowband']
    first, other = (cls(dict(zip(('frequency', 'width', 'rms'), z), form=form))
                    for z in ((5.0, 0.5, 1e-5), second))
    model = model_of('noise', ('white',)).plus(first).plus(other)
    assert [bool(model[k].part_of(model)) for k in model.labels[1:]] == [one, one]


@pytest.mark.parametrize('gain, kept, form', [
    (400.0, (0, 1), 1.0), (400.0, (1,), 1.0), (400.0, (0,), 0.0), (400.0, (), 2.0),
    (40.0, (0, 1), 2.0)])
def test_a_clear_peak_that_ends_at_its_bound_is_asked_in_its_other_forms(
        gain, kept, form, monkeypatch):
    """The best of those that do not; not where it is no peak in any form, nor where all do."""
    cls = registry('noise')['narrowband']

    def fit_of(effect):
        return SimpleNamespace(model=model_of('noise', ('white',)).plus(effect),
                               estimates={'narrowband': {}})

    monkeypatch.setattr(refitted, 'refitted', lambda e, f, effect: fit_of(effect))
    monkeypatch.setattr(refitted, 'at_bound', lambda e, effect, s: effect['form'] not in kept)
    monkeypatch.setattr(refitted, 'gain_of', lambda e, f, more, partly: gain + more.model[
        'narrowband']['form'])
    no_machine = SimpleNamespace(machine_at=lambda frequency: None)
    best = refitted.within_bounds(no_machine, None, fit_of(cls({'frequency': 5.0, 'form': 2.0})))
    assert best.model['narrowband']['form'] == form


@pytest.mark.parametrize('there', [False, True])
def test_a_broad_effect_gains_more_than_chance_beside_the_others(there):
    y = np.random.default_rng(9).standard_normal(N)
    if there:
        y += lfilter([0.08], [1, -0.95], np.random.default_rng(10).standard_normal(N))
    problem, fit = alone(SIZE * y, 'white', 'flicker', 'gauss_markov')
    without = problem.point(model_of('noise', ('white', 'flicker')))
    said = candidates.no_more_than_chance(problem, fit, without, 'gauss_markov')
    assert ('beside the others it gains' in said) != there


def alone(x, *names):
    """Return the problem of an axis beside two of white noise, and the fit of some effects."""
    rng = np.random.default_rng(0)
    others = SIZE * rng.standard_normal((N, 2))
    problem = NoiseProblem(gather(
        ImuRecord(np.column_stack([x, others]), None, T, 1 / DT), ['gyro_x'])['gyro_x'])
    return problem, problem.point(model_of('noise', names))


@pytest.mark.thorough
def test_a_peak_wider_than_one_may_be_is_none_beside_the_others():
    """Noise behind a band-pass from 8 to 12 Hz; a resonance, wide but one."""
    rng = np.random.default_rng(3)
    white = rng.standard_normal((2, N + 3000))
    band = butter(3, (8.0, 12.0), 'band', output='sos', fs=1 / DT)
    b, a = iirpeak(10.0, 5.0, fs=1 / DT)
    for x, is_one in ((sosfilt(band, white[0]), False), (lfilter(b, a, white[0]), True)):
        problem, fit = alone(SIZE * (white[1] + x)[3000:], 'white', 'narrowband')
        against = problem.shape(fit, 'narrowband', 500.0)
        assert ('width lies at its bound' in against) != is_one, against


@pytest.mark.parametrize('width, against', ((1.0, ''), (2.0, 'width'), (3.0, 'width')))
def test_a_shape_beyond_a_bound_that_goes_with_another_is_at_it(width, against):
    """At 6 Hz the widest peak has 2 Hz, wherever the fit began."""
    peak = find_effect('noise', 'narrowband')().with_values(
        frequency=6.0, width=width, rms=SIZE, form='velocity')
    said = at_bound(SimpleNamespace(duration=600.0, dt=DT), peak, {})
    assert against in said and bool(against) == bool(said)


@pytest.mark.parametrize('behind, fills', ((0.0, False), (0.002, False), (0.02, True)))
def test_a_hollow_that_more_fills_than_may_arise_behind_a_filter_is_no_filter(behind, fills):
    """Where nothing does it is one: that is no bound, but nothing. A hollow goes on beyond."""
    evidence = SimpleNamespace(duration=600.0, dt=DT, whole=SimpleNamespace(
        bins=SimpleNamespace(f=np.linspace(0.01, 50.0, 5000))))
    for name, more in (('notch', {}), ('low_pass', {'cutoff': 2.0})):
        effect = find_effect('noise', name).example().with_values(behind=behind, **more)
        said = at_bound(evidence, effect, {})
        assert ('its behind lies at its bound' in said) == fills


@pytest.mark.thorough
@pytest.mark.parametrize('seed', (0, 3, 4, 7))
def test_near_the_fast_end_it_is_not_seen_what_arises_behind_a_filter(seed):
    """A pole at 35 Hz of 50: .02 +- .2, but it lets more pass. Of a hollow it is seen."""
    rng, up, pole = np.random.default_rng([seed, 8]), 8, np.exp(-2 * np.pi * 0.35 / 8)
    x = lfilter([1 - pole], [1, -pole], rng.standard_normal(up * (N + 100)))[100 * up::up]
    problem, fit = alone(SIZE * (np.sqrt(up) * x + 0.04 * rng.standard_normal(N)),
                         'white', 'low_pass')
    assert fit.model['low_pass']['behind'] == pytest.approx(0.02)
    assert not at_bound(problem.evidence, fit.model['low_pass'], fit.estimates['low_pass'])
    x = lfilter(*iirnotch(20.0, 3.0, fs=1 / DT), rng.standard_normal(N))
    problem, fit = alone(SIZE * (x + 0.3 * rng.standard_normal(N)), 'white', 'notch')
    assert 'its behind lies at its bound' in problem.shape(fit, 'notch', 500.0)


@pytest.mark.thorough
@pytest.mark.parametrize('power', (0.5, 0.7))
def test_what_the_others_do_elsewhere_is_no_claim_of_a_notch(power):
    """Beside a dip they bend to f^-p, and 200 nats that are left are little of those 10^4."""
    rng = np.random.default_rng(2)
    problem, fit = alone(SIZE * coloured(rng, power),
                         'white', 'flicker', 'random_walk', 'notch')
    without = problem.point(fit.model.minus('notch'))
    assert rivals.shape(problem.evidence, fit, without, 'notch', 50.0)
    b, a = iirnotch(20.0, 2.0, fs=1 / DT)
    x = lfilter(b, a, rng.standard_normal(N)) + 0.05 * rng.standard_normal(N)
    problem, fit = alone(SIZE * x, 'white', 'notch')
    assert not problem.shape(fit, 'notch', 50.0)
    assert likelihood.lost_without(problem.evidence, fit, 'notch') > 1000


@pytest.mark.thorough
@pytest.mark.parametrize('bonus, refuted', ((0.0, True), (50.0, False)))
def test_popcorn_noise_spends_what_a_relaxation_does_unless_the_samples_tell(
        bonus, refuted, monkeypatch):
    """Beside a pole it is two knees, of which one of any steepness does the work."""
    problem, fit = alone(SIZE * coloured(np.random.default_rng(4), 0.6),
                         'white', 'rts', 'low_pass')
    monkeypatch.setattr(nameless, 'gained', lambda *_, **__: 1.0)
    monkeypatch.setattr(find_effect('noise', 'rts'), 'bonus', lambda *_: bonus)
    one = replace(fit, model=fit.model.with_values({'low_pass': {
        'form': 'first_order', 'averaged': 0.0, 'behind': 0.0, 'filters': 0.0}}))
    said = nameless.knee_instead(problem.evidence, one, one.model['low_pass'], 30.0)
    assert ('which has no name' in said) == refuted, said


@pytest.mark.thorough
def test_what_the_samples_speak_against_is_no_popcorn_noise():
    """A relaxation of the same spectrum has one hump."""
    rng = np.random.default_rng(2)
    x = lfilter([0.25], [1, -0.97], rng.standard_normal(N + 2000))[2000:]
    problem, fit = alone(SIZE * (rng.standard_normal(N) + 2 * x), 'white', 'rts')
    assert 'samples' in problem.shape(fit, 'rts', 300.0)
    problem, fit = alone(SIZE * (rng.standard_normal(N) + 2 * x), 'white', 'gauss_markov')
    assert not problem.shape(fit, 'gauss_markov', 300.0)


@pytest.mark.thorough
def test_what_is_optional_counts_where_it_is_used_beside_a_knee(monkeypatch):
    """A filter of own noise alone and a relaxation spend four, a knee that is as good three."""
    names = ('white', 'gauss_markov', 'low_pass')
    problem, fit = alone(SIZE * coloured(np.random.default_rng(3), 0.6), *names)
    monkeypatch.setattr(nameless, 'gained', lambda *_, **__: -1.0)
    said = []
    for filters in (0.0, 1.0):
        one = replace(fit, model=fit.model.with_values({'low_pass': {
            'form': 'butterworth_2', 'averaged': 0.0, 'behind': 0.0, 'filters': filters}}))
        said.append(nameless.knee_instead(problem.evidence, one, one.model['low_pass'], 100.0))
    assert not said[0] and '1 parameter less' in said[1], said


@pytest.mark.parametrize('better, named', [seldom(1.0, True), (8.0, False)])
def test_a_filter_alone_is_named_where_it_is_as_good_as_a_knee(better, named, monkeypatch):
    """It may spend more parameters, of noise behind it and what it acts on; it has a name."""
    problem, fit = alone(SIZE * coloured(np.random.default_rng(3), 0.6), 'white', 'low_pass')
    monkeypatch.setattr(nameless, 'gained', lambda *_, **__: better)
    one = replace(fit, model=fit.model.with_values({'low_pass': {
        'form': 'first_order', 'averaged': 0.0, 'behind': 0.01, 'filters': 1.0}}))
    said = nameless.knee_instead(problem.evidence, one, one.model['low_pass'], 100.0)
    assert (not said) == named, said


def averaged(rng):
    """Return white noise of which 34 samples are averaged, and every eighth average is read."""
    fine = rng.standard_normal(8 * N + 34)
    return np.convolve(fine, np.ones(34) / 34, 'valid')[:8 * N:8] + 0.02 * rng.standard_normal(N)


@pytest.mark.thorough
def test_a_knee_that_does_something_else_is_no_rival_of_a_filter():
    """No band counts much: what a filter takes away, and a slow end that nothing explains yet."""
    rng = np.random.default_rng(35)
    x = averaged(rng) + 0.05 * coloured(rng, 1.0)
    problem, fit = alone(SIZE * x, 'white', 'low_pass')
    assert not nameless.knee_instead(problem.evidence, fit, fit.model['low_pass'], 300.0)


@pytest.mark.thorough
def test_a_filter_stands_out_though_a_peak_does_of_what_it_lets_pass():
    """Beneath the peak the filter leaves next to nothing, and the white noise of before more."""
    rng = np.random.default_rng(36)
    r, w = np.exp(-np.pi * 0.24 * DT), 2 * np.pi * 31.4 * DT
    peak = lfilter([1 - r], [1, -2 * r * np.cos(w), r * r], rng.standard_normal(N))
    x = averaged(rng) + 0.3 * peak / np.std(peak)
    problem, fit = alone(SIZE * x, 'white', 'flicker', 'random_walk')
    low_pass = tried(problem, fit, find_effect('noise', 'low_pass')()).finding
    assert low_pass.gain > 100 > low_pass.penalty


def test_what_a_sweeping_line_outweighs_may_be_its_doing():
    """Nor is a peak of which it passes all, most of the time; but what explains more."""
    sweep = np.array([50.0, 200.0, 0.0, 600.0, 1.0, 5.0])
    evidence = SimpleNamespace(sweep=sweep, duration=600.0, n=60_000, dt=0.01)
    filtered, peak = (find_effect('noise', k).example() for k in ('low_pass', 'narrowband'))
    assert rivals.swept(evidence, filtered, 25.0)
    assert not rivals.swept(evidence, filtered, 250.0)
    for frequency, width, is_none in ((3.0, 1.0, True), (1.4, 1.0, False), (3.0, 4.5, False),
                                      (3.0, 1.5, False)):     # a machine that wanders
        one = peak.with_values(frequency=frequency, width=width)
        assert bool(rivals.swept(evidence, one, 25.0)) == is_none
        assert not rivals.swept(evidence, one, 250.0)
    louder = find_effect('noise', 'variance_change').example()
    assert rivals.swept(evidence, louder, 25.0) and not rivals.swept(evidence, louder, 250.0)
    # nor noise that is nothing where it passes
    slow, f = find_effect('noise', 'gauss_markov').example(), np.geomspace(1e-3, 10, 50)
    evidence.whole = SimpleNamespace(bins=SimpleNamespace(f=f))
    for corner, is_none in ((0.05, False), (1.0, True)):
        fit = SimpleNamespace(details=SimpleNamespace(v=np.ones(50), each={
            'gauss_markov': 1 / (1 + (f / corner) ** 4)}))
        assert bool(rivals.swept(evidence, slow, 25.0, fit)) == is_none
    faint = SimpleNamespace(sweep=sweep * [0.1, 1, 1, 1, 1, 1], duration=600.0, n=60_000, dt=0.01)
    assert not rivals.swept(faint, filtered, 25.0)
    # what is nowhere but on its path, all along, is no peak there, whatever that explains
    along = SimpleNamespace(sweep=sweep * [1, 10, 1, 1, 1, 1], duration=600.0, n=60_000, dt=0.01)
    for frequency, is_none in ((3.0, True), (8.0, False)):
        one = peak.with_values(frequency=frequency, width=2.0)
        assert bool(rivals.swept(along, one, 1e4)) == is_none
    # what axes share it may do all along, on a path that is straight for a while
    shared_noise = find_effect('noise', 'shared_noise').example()
    late = SimpleNamespace(sweep=np.array([8.0, 200.0, 500.0, 600.0, 1.0, 5.0]), duration=600.0,
                           n=60_000, dt=0.01)
    assert rivals.swept(late, shared_noise, 1000.0)
    assert not rivals.swept(late, peak.with_values(frequency=3.0, width=1.0), 0.5)
    assert not rivals.swept(late, shared_noise, 1300.0)
    assert not rivals.swept(evidence, shared_noise, 250.0)
    assert not rivals.swept(late, filtered, 25.0)


@pytest.mark.thorough
def test_a_peak_on_the_path_of_a_line_that_sweeps_is_none_at_once(monkeypatch):
    """Five were found on one, one after the other, and fell together in the end."""
    rng, r = np.random.default_rng(38), 0.98
    swing = lfilter([1 - r], [1, -1.6 * r, r * r], rng.standard_normal(N))
    problem, fit = alone(SIZE * (rng.standard_normal(N) + 8 * swing), 'white', 'flicker')
    monkeypatch.setattr(candidates, 'swept', lambda *_: 'a line that sweeps')
    peak, broad = (tried(problem, fit, find_effect('noise', name)()).finding
                   for name in ('narrowband', 'gauss_markov'))
    assert peak.gain > peak.penalty
    assert 'a line that sweeps' in peak.against and 'sweeps' not in broad.against


@pytest.mark.thorough
def test_what_axes_hear_faintly_over_many_octaves_is_shared():
    """A tenth of the power below 1 Hz: no few neighbouring coefficients tell it."""
    rng = np.random.default_rng(46)
    a = np.exp(-DT / 0.3)
    relaxing = lfilter([1.0], [1.0, -a], np.sqrt(1 - a * a) * rng.standard_normal(N))
    names, said = found_in(axes_with(0.1 * SIZE * relaxing, rng))
    assert names == ['shared_noise'] and said.remaining is None, said


@pytest.mark.thorough
def test_axes_of_an_accelerometer_that_sways_are_heard_together():
    """Each with a part of what the gyroscope has of it; alone two of them would not show."""
    rng = np.random.default_rng(47)
    accel = np.column_stack([
        1e-3 * rng.standard_normal(N) + 4e-3 * lfilter(
            *iirpeak(f, 12, 1 / DT), 10 * rng.standard_normal(N)) for f in (0.12, 0.13, 0.14)])
    gyro = SIZE * rng.standard_normal((N, 3))
    gyro[:, 0] += accel @ [2e-2, 1e-3, 1e-3]
    record = ImuRecord(gyro, accel, T, 1 / DT)
    evidence = gather(record, axes=('gyro_x',))['gyro_x']
    assert all(evidence.shaken(f'accel_{a}') for a in 'xyz')


@pytest.mark.thorough
def test_an_accelerometer_that_sways_is_heard_where_hardly_anything_hears_it():
    """Its own noise, elsewhere in the spectrum, is no part of what a gyroscope has of it."""
    rng = np.random.default_rng(48)
    sway = [lfilter(*iirpeak(f, 3, 1 / DT), rng.standard_normal(N)) for f in (0.2, 0.25, 0.3)]
    sway = np.column_stack(sway) / np.std(sway, axis=1)
    accel = 7e-3 * sway + 4e-3 * rng.standard_normal((N, 3))
    gyro = SIZE * rng.standard_normal((N, 3))
    gyro[:, 0] += 0.06 * SIZE * sway @ [1.0, 0.8, -0.9]
    said = analyse_record(ImuRecord(gyro, accel, T, 1 / DT), axes=('gyro_x',),
                          keep_motion=True).diagnose(['gyro_x'])['gyro_x']
    assert [f.name for f in said.found] == ['accel_coupling'] and said.remaining is None, said
    assert said.found[0].effect.chosen('heard') == 'vibration'


@pytest.mark.parametrize('seed', [
    pytest.param(4, marks=pytest.mark.thorough),
    pytest.param(5, marks=pytest.mark.thorough)])
def test_a_motion_that_a_loud_accelerometer_hardly_tells_is_one_coupling(seed):
    """
    Three narrow sways, each one axis's, in fifty cycles; the gyroscope hears them more clearly.

    What the accelerometer's own noise hides of them other axes of the gyroscope tell, and it is no
    source of its own; nor is that noise, in the rest of the spectrum, heard.
    """
    rng, n = np.random.default_rng([51, seed]), 30_000
    sway = np.column_stack([lfilter(*iirpeak(f, 12, 1 / DT), rng.standard_normal(n + 5000))[5000:]
                            for f in (0.15, 0.165, 0.18)]) * [20, 28, 24]
    gains = np.array([[-0.72, 0.6, -0.8], [0.48, 0.64, 0.4], [-0.4, 0.56, 0.72]])
    gyro = SIZE * (rng.standard_normal((n, 3)) + sway @ gains.T)
    accel = 1e-3 * (sway + rng.standard_normal((n, 3)))
    problem = NoiseProblem(gather(ImuRecord(gyro, accel, T[:n], 1 / DT), ['gyro_x'])['gyro_x'])
    base = ['white', 'flicker', 'random_walk', 'accel_coupling']
    fit = problem.point(model_of('noise', base))
    effect = fit.model['accel_coupling']
    assert [effect[f'gain_{c}'] for c in 'xyz'] == pytest.approx(1e3 * SIZE * gains[0], rel=0.1)
    assert all(f.p_value > 1e-3 for f in problem.omnibus(fit) if f.name in ('frequency', 'time'))
    assert not [f for f in problem.candidates(fit) if f.gain > f.penalty], fit.model


def test_what_two_signals_share_is_told_from_noise():
    """At any spectrum: narrow, slow, white; each with noise of its own, one's in bursts."""
    rng, n = np.random.default_rng(52), 12_000
    t = np.arange(n)
    on = 1 + 4 * (t % 1000 < 100)

    def said(source, size):
        x, y = size * source / np.std(source) + rng.standard_normal((2, n)) * [on, np.ones(n)]
        return unlike_noise(x, y)

    for source in (rng.standard_normal(n), np.cumsum(rng.standard_normal(n)),
                   lfilter(*iirpeak(0.004, 15), rng.standard_normal(n)),
                   lfilter(*iirpeak(0.2, 40), rng.standard_normal(n))):
        assert max(said(source, size) for size in (0.3, 1.0, 5.0)) < DIRECTED
    line = np.cos(2 * np.pi * (0.2 * t + 200 * np.sin(2 * np.pi * 5 * t / n) / (2 * np.pi)))
    assert said(line, 0.6) > DIRECTED
    assert said(rng.standard_normal(n) * (on - 0.8), 1.0) > DIRECTED
    slow = np.cumsum(np.cumsum(rng.standard_normal(n)))
    with np.errstate(all='raise', under='ignore'):  # a channel that tells nothing
        assert np.isfinite(unlike_noise(slow, 1e-4 * np.round(1e4 * np.sin(t / n))))
        assert np.isfinite(unlike_noise(slow, 0 * slow))


def lorenz(rng, n, units):
    """Return n samples of the first coordinate of Lorenz's system over some units of its time."""
    steps = int(300 * units)
    path, (x, y, z) = np.empty(steps), rng.normal([0, 0, 25], 5)
    for k in range(-3000, steps):
        dx, dy, dz = 10 * (y - x), x * (28 - z) - y, x * y - 8 / 3 * z
        x, y, z = x + dx / 300, y + dy / 300, z + dz / 300
        path[max(k, 0)] = x
    return np.interp(np.linspace(0, steps - 1, n), np.arange(steps), path / 8)


def octaves(y):
    """Yield block means, each of twice as many values as those before."""
    while len(y) >= 128:
        yield y
        y = y[:len(y) // 2 * 2].reshape(-1, 2).mean(axis=1)


def test_a_path_that_follows_a_law_is_told_from_noise_of_any_spectrum():
    """By few values: twenty turns of a chaotic sway; not by bursts, nor a drift at one place."""
    rng, n = np.random.default_rng(54), 8192
    white = rng.standard_normal(n)
    bursts = white * (1 + 3 * (np.arange(n) // 400 % 5 == 0))
    for noise in (white, bursts, np.cumsum(white), lfilter([1], [1, -0.97], white),
                  lfilter(*iirpeak(0.01, 10), rng.standard_normal(n)),
                  lfilter(*iirpeak(0.04, 40), rng.standard_normal(n))):
        for size in (1.0, 5.0):
            path = size * noise / np.std(noise) + rng.standard_normal(n)
            assert follows_a_law(octaves(path)) < FLEXIBLE
    assert follows_a_law(octaves(lorenz(rng, n, 20) + 0.5 * rng.standard_normal(n))) > FLEXIBLE
    assert follows_a_law(octaves(np.zeros(n))) < FLEXIBLE


@pytest.mark.parametrize('path, holds', [('lorenz', False), ('relaxation', True)])
def test_a_chaotic_sway_is_neither_noise_that_axes_share_nor_a_relaxation(path, holds):
    """As often as it turns it is as normal as noise: its differences have no heavy tails."""
    rng, n = np.random.default_rng(55), 20_000
    sway = lorenz(rng, n, 20) if path == 'lorenz' else lfilter(
        [0.14], [1, -0.99], rng.standard_normal(n + 2000))[2000:]
    x = SIZE * (rng.standard_normal((n, 3)) + sway[:, None] * [1.0, 0.8, -0.9])
    problem = NoiseProblem(gather(ImuRecord(x, None, T[:n], 1 / DT), ['gyro_x'])['gyro_x'])
    for name in ('shared_noise', 'gauss_markov'):
        fit = problem.point(model_of('noise', ['white', name]))
        effect = fit.model[name]
        assert ('law' in normality.not_normal(problem.evidence, fit, effect, 1000.0)) != holds


def test_what_is_shared_and_is_no_noise_loses_the_name_unless_the_model_knows_why(monkeypatch):
    rng, n = np.random.default_rng(53), 20_000
    x = SIZE * (rng.standard_normal((n, 3)) + 0.5 * rng.standard_normal((n, 1)))
    problem = NoiseProblem(gather(ImuRecord(x, None, T[:n], 1 / DT), ['gyro_x'])['gyro_x'])
    fits = [problem.point(model_of('noise', ['white', 'shared_noise', *more]))
            for more in ((), ('ramp',))]
    assert not any(problem.shape(fit, 'shared_noise', 100.0) for fit in fits)
    monkeypatch.setattr(coupled, 'unlike_noise', lambda x, y: 10.0)
    said = [problem.shape(fit, 'shared_noise', 101.0) for fit in fits]
    assert 'as no noise does' in said[0] and not said[1]
    assert not problem.shape(fits[0], 'shared_noise', 3000.0), 'a part of what it claims'


def test_what_is_shared_is_noise_though_all_axes_grow_louder():
    """And have a mean: divided by what the noise does, that is a step."""
    rng, n = np.random.default_rng(57), 20_000
    loud = 1 + 0.5 * (np.arange(n) > 0.3 * n)[:, None]
    common = 0.2 * rng.standard_normal((n, 1)) * [1.0, 0.6, -1.3]
    x = SIZE * (loud * (rng.standard_normal((n, 3)) + common) + [30.0, -20.0, 40.0])
    problem = NoiseProblem(gather(ImuRecord(x, None, T[:n], 1 / DT), ['gyro_x'])['gyro_x'])
    fit = problem.point(model_of('noise', ['white', 'variance_change', 'shared_noise']))
    assert coupled._shared_otherwise(
        problem.evidence, fit, fit.model['shared_noise']) < 0.5 * DIRECTED


def test_what_is_shared_is_noise_though_all_axes_hold_samples_at_random():
    """Where one is held so are the others, and what they share comes and goes with it."""
    rng, n = np.random.default_rng(58), 20_000
    x = SIZE * (rng.standard_normal((n, 3)) + rng.standard_normal((n, 1)) * [0.6, -0.7, -0.8])
    at = np.maximum.accumulate(np.where(rng.random(n) < 0.38, 0, np.arange(n)))
    problem = NoiseProblem(gather(ImuRecord(x[at], None, T[:n], 1 / DT), ['gyro_x'])['gyro_x'])
    fit = problem.point(model_of('noise', ['white', 'duplicates', 'shared_noise']))
    assert coupled._shared_otherwise(
        problem.evidence, fit, fit.model['shared_noise']) < 0.5 * DIRECTED


@pytest.mark.thorough
def test_a_filter_is_begun_where_it_is_seen_beside_a_source_that_comes_in_behind_it():
    """Beside the source other noise has bent to what the filter leaves: that is not its shape."""
    rng, n, true = np.random.default_rng(59), 40_000, 0.443 / (15 * DT)
    x = np.array([lfilter(np.ones(15) / 15, 1, rng.standard_normal(n)) for _ in range(3)]).T
    x += 0.08 * rng.standard_normal((n, 3)) + 0.6 * rng.standard_normal((n, 1)) * [1, 0.6, -1.3]
    problem = NoiseProblem(gather(ImuRecord(SIZE * x, None, T[:n], 1 / DT), ['gyro_x'])['gyro_x'])
    bent = problem.point(model_of('noise', ['white', 'random_walk', 'shared_noise'])).model
    level = bent['white']['N']
    bent = bent.with_values({'white': {'N': 0.05 * level},
                             'random_walk': {'K': 2 * np.pi * true * level}})
    more = Likelihood(problem.evidence, 'whole', bent.plus(find_effect('noise', 'low_pass')()))
    begun = {model['low_pass']['cutoff'] for model, _ in starts(more, bent)}
    assert min(abs(np.log(cutoff / true)) for cutoff in begun) < 0.05


@pytest.mark.thorough
def test_a_step_of_all_axes_is_a_step():
    """What axes share is not only noise; each step is told from the one before it."""
    rng = np.random.default_rng(51)
    course = (T > 0.391 * T[-1]) * 1.0 - 1.4 * (T > 0.532 * T[-1]) + 1.2 * (T > 0.61 * T[-1])
    names, said = found_in(axes_with(1.5 * SIZE * course, rng))
    assert names == ['step', 'step', 'step'] and said.remaining is None, said
    at = sorted(f.effect['time'] for f in said.found)
    assert at == pytest.approx([0.391 * T[-1], 0.532 * T[-1], 0.61 * T[-1]], abs=2.0)


@pytest.mark.thorough
def test_a_gain_is_that_of_the_noise_where_all_axes_have_a_step():
    """Of each axis another part of it: solved for without the mean, it would be the steps'."""
    rng = np.random.default_rng(52)
    a = np.exp(-DT / 5.0)
    source = 3 * SIZE * lfilter([np.sqrt(1 - a * a)], [1.0, -a], rng.standard_normal(N))
    step = 20 * SIZE * (T > 0.4 * T[-1])
    gyro = SIZE * rng.standard_normal((N, 3)) * [1.0, 0.01, 1.0]
    gyro += np.outer(source, [0.5, 1.0, 0.0]) + np.outer(step, [-1.0, 1.0, 0.0])
    e = gather(ImuRecord(gyro, None, T, 1 / DT), axes=('gyro_x',))['gyro_x']
    shared_noise = registry('noise')['shared_noise'](
        {'source': 'gyro_y', 'other': 'gyro_z', 'heard': 'all'})
    model = model_of('noise', ('white', 'random_walk', 'step')).plus(shared_noise)
    found = NoiseProblem(e).point(model).model
    assert found['shared_noise']['gain'] == pytest.approx(0.5, abs=0.08)
    assert found['step']['size'] == pytest.approx(-30 * SIZE, abs=2 * SIZE)     # less half of y's


@pytest.mark.thorough
def test_a_grid_gives_no_effect_more_than_it_holds():
    """Whatever else the spectrum has that nothing explains."""
    rng = np.random.default_rng(53)
    a = np.exp(-DT / 3.0)
    gyro = SIZE * rng.standard_normal((N, 3))
    gyro[:, 0] += 3 * SIZE * lfilter([np.sqrt(1 - a * a)], [1.0, -a], rng.standard_normal(N))
    gyro = 1.2 * SIZE * np.round(gyro / (1.2 * SIZE))
    e = gather(ImuRecord(gyro, None, T, 1 / DT), axes=('gyro_x',))['gyro_x']
    problem = NoiseProblem(e)
    fit = problem.point(model_of('noise', ('white', 'flicker', 'random_walk')))
    grid = {f.name: f.elsewhere or f.gain for f in problem.candidates(fit)}
    assert grid['quantization'] <= grid['rate_quantization'] * (1 + 1e-9)


@pytest.mark.thorough
def test_one_loud_block_is_no_change_of_variance():
    rng = np.random.default_rng(54)
    gyro = SIZE * rng.standard_normal((N, 3))
    e = gather(ImuRecord(gyro, None, T, 1 / DT), axes=('gyro_x',))['gyro_x']
    change = registry('noise')['variance_change']()
    for blocks, is_one in ((1, False), (6, True)):
        power = e.block_power.copy()
        power[..., 100:100 + blocks, :] *= 9.0
        finding = change.measure(replace(e, block_power=power))
        assert is_one == (finding is not None and finding.gain > 20), finding


@pytest.mark.parametrize('quiet', daily([False, True], False))
def test_loud_blocks_are_no_stretch_if_one_between_them_is_quiet(quiet):
    """They are bursts that happen to be near each other."""
    x = SIZE * np.random.default_rng(40).standard_normal(N)
    e = gather(ImuRecord(np.column_stack([x] * 3), None, T, 1 / DT), ['gyro_x'])['gyro_x']
    power = e.block_power.copy()
    power[:, 100:104] *= np.array([5.0, 1.0 if quiet else 4.0, 4.0, 3.0])[:, None]
    finding = find_effect('noise', 'variance_change')().measure(replace(e, block_power=power))
    assert (finding is None or finding.effect.chosen('form') != 'stretch') == quiet


def test_bursts_here_and_there_make_no_stretches_of_what_is_between_them():
    """Each is shorter than a stretch may be; stretches that are longer may be near each other."""
    of_calm = near = 0
    for lasts, seed in product((1, 3), range(40)):
        rng = np.random.default_rng([seed, 11, lasts])
        t, level = np.arange(256) + 0.5, np.ones(256)
        for k in rng.integers(2, 250, 11):
            level[k:k + lasts] = rng.uniform(1.3, 3)
        x = level * rng.gamma(20, 1 / 20, 256)
        one = VarianceChange()._stretch(t, x)
        found = VarianceChange()._stretches(t, x, np.full((256, 1), 40.0), one)
        if found is not None:
            begin, length = np.array([[found[a], found[b]] for a, b in TIMES if found[b] > 0]).T
            gap = np.min(begin[1:] - (begin + length)[:-1])
            of_calm += gap < 2.5 and np.sum(length) > 128
            near += gap < 2.5
    assert of_calm == 0 and near > 0


@pytest.mark.thorough
def test_an_effect_gains_no_more_than_a_fit_loses_without_it():
    rng = np.random.default_rng(33)
    y = axes_with(np.zeros(N), rng)
    evidence = gather(ImuRecord(np.column_stack(y), None, T, 1 / DT), axes=('gyro_x',))['gyro_x']
    problem = NoiseProblem(evidence)
    fit = problem.point(model_of('noise', ['white', 'flicker', 'random_walk']))
    high = fit.details.v * np.where(evidence.whole.bins.f < 1, 3.0, 1.0)
    caught = replace(fit, details=replace(fit.details, v=high))
    some = [f for f in problem.candidates(caught)
            if f.name in ('notch', 'narrowband', 'quantization', 'low_pass', 'gauss_markov')]
    assert len(some) > 2 and all(f.gain < f.penalty for f in some), some


@pytest.mark.thorough
def test_samples_on_a_grid_lie_on_it_whatever_bends_the_spectrum():
    rng, n = np.random.default_rng(11), N // 2
    octaves = np.log2(np.maximum(np.fft.rfftfreq(n, DT), 1e-3) / 8)
    swell = 1 + 1.5 * np.exp(-0.5 * octaves**2)     # no effect has this form
    gyro = [np.fft.irfft(np.fft.rfft(SIZE * rng.standard_normal(n)) * swell) for _ in range(3)]
    names, said = found_in([SIZE * np.round(x / SIZE) for x in gyro])
    assert 'rate_quantization' in names, said
    assert said.remaining is not None, said


def test_a_peak_is_ranked_by_the_measure_of_a_rival_that_explains_more():
    """What it explains in part counts unless a form that stands out without that does better."""
    def tried(name, whole, partly, peak=False):
        return Tried(Finding(name, partly if peak else whole, penalty=10.0), whole, partly, peak)

    peak = tried('peak', 20.0, 234.0, peak=True)
    for rival, gain in ((tried('rival', 58.0, 240.0), 20.0), (tried('rival', 58.0, 230.0), 234.0),
                        (tried('rival', 5.0, 300.0), 234.0)):
        found = {f.name: f.gain for f in by_one_measure([peak, rival, Tried(None)])}
        assert found == {'peak': gain, 'rival': rival.whole}


# --- several at once -----------------------------------------------------------------------------

def test_what_is_set_aside_keeps_its_power_beside_a_mean():
    """Or no band that was once set aside could agree again with an effect on the mean beside."""
    rng = np.random.default_rng(21)
    record = ImuRecord(np.column_stack(axes_with(SIZE * T / T[-1], rng)), None, T, 1 / DT)
    evidence = gather(record, ['gyro_x'])['gyro_x']
    bins, model = evidence.whole.bins, model_of('noise', ['white', 'ramp']).with_values(
        {'white': {'N': SIZE * np.sqrt(DT)}, 'ramp': {'R': 0.0}})
    aside = (bins.f > 5) & (bins.f < 20)
    basis = Explained(bins.f, np.where(aside, 0.0, 1.0))
    some, all_of_it = (Likelihood(evidence, 'whole', model, explained=b) for b in (basis, None))
    v, _ = some.spectra(model)
    left, whole = (x.solve_linear(model, v).power for x in (some, all_of_it))
    assert left[aside] == pytest.approx(whole[aside], rel=0.01)
    assert left[~aside] == pytest.approx(whole[~aside], rel=0.5)


def test_a_peak_over_several_bins_asks_for_something(monkeypatch):
    """Each of them is within chance; together they are not."""
    x, w = np.ones(256), np.full(256, 50.0)
    said = []
    for bins in (0, 1, 6):
        x[100:100 + bins] = 1.5     # 2.3 standard deviations
        monkeypatch.setattr(flexible, 'spectrum_left', lambda *_: (np.arange(1.0, 257), x, w))
        said.append(flexible.asks_nothing(None, None))
    assert said == [True, True, False]


@pytest.mark.thorough
@pytest.mark.parametrize(('high', 'told'), [(10.0, True), (0.1, False)])
def test_skirts_of_a_sharp_resonance_that_stands_high_tell_what_is_heard_of_it(high, told):
    """A faint one is tried as displacement alone: nothing is seen of its skirts."""
    rng = np.random.default_rng(7)
    w, r = 2 * np.pi * 9.0 * DT, np.exp(-np.pi * 0.05 * DT)
    y = lfilter([1.0, 0.0, -1.0], [1.0, -2 * r * np.cos(w), r * r], rng.standard_normal(2 * N))[N:]
    problem, _ = alone(SIZE * (high * y / np.std(y) + rng.standard_normal(N)), 'white')
    (f, width, _), *_ = problem.evidence.humps
    assert f > 30 * width
    tried = {e.chosen('form') for e in find_effect('noise', 'narrowband')().starts(
        problem.evidence) if e['frequency'] == pytest.approx(f)}
    assert 'displacement' in tried and ('velocity' in tried) == told


@pytest.mark.thorough
@pytest.mark.parametrize('slow', ['warm-up', 'sway'])
def test_what_warms_up_together_is_no_coupling(slow):
    """One source moves a gyroscope and an accelerometer once; a bench that sways goes on."""
    rng, n, rate = np.random.default_rng(17), 60_000, 25.0
    t = np.arange(n) / rate
    course = np.exp(-t / 45) + 1.5 * np.exp(-t / 400)
    if slow == 'sway':
        w, r = 2 * np.pi * 0.05 / rate, np.exp(-np.pi * 0.05 / 8 / rate)
        course = lfilter([1.0], [1.0, -2 * r * np.cos(w), r * r], rng.standard_normal(2 * n))[n:]
        course /= 2 * np.std(course)
    gyro, accel = 1e-3 * rng.standard_normal((n, 3)), 1e-2 * rng.standard_normal((n, 3))
    gyro[:, 0] += 3e-3 * course
    accel += 0.1 * course[:, None] * [1.0, 0.2, 0.7]
    problem = NoiseProblem(gather(ImuRecord(gyro, accel, t, rate), ['gyro_x'])['gyro_x'])
    fit = problem.point(model_of('noise', ('white', 'flicker', 'random_walk', 'accel_coupling')))
    said = problem.shape(fit, 'accel_coupling', 300.0)
    assert said == (normality.COURSE_OF_AXES if slow == 'warm-up' else '')


@pytest.mark.thorough
def test_a_faint_band_is_begun_at_beside_what_stands_narrow_elsewhere():
    """A swing of a few cycles stands narrow, and is another effect's."""
    rng, rate, f0, width = np.random.default_rng(4), 125.0, 24.0, 0.9
    t = np.arange(184_320) / rate
    band = bell.sample(len(t), 0.075, f0, width, 1 / rate, rng)
    x = rng.standard_normal(len(t)) + band + 0.6 * np.sin(2 * np.pi * t / 321.0)
    x = np.column_stack([x, *rng.standard_normal((2, len(t)))])
    evidence = gather(ImuRecord(SIZE * x, None, t, rate), ['gyro_x'])['gyro_x']
    assert evidence.humps.size and np.all(evidence.humps[:, 0] < 0.1)
    begun = find_effect('noise', 'narrowband')().starts(evidence)
    assert any(abs(e['frequency'] - f0) < 2 * width for e in begun)


def test_a_notch_that_takes_out_most_of_the_band_is_one():
    """40 Hz of 50 between its -3 dB points: at a bound below that it was none."""
    rng = np.random.default_rng(1)
    y = lfilter(*iirnotch(40.0, 1.0, fs=1 / DT), rng.standard_normal(N))
    y += 0.05 * rng.standard_normal(N)
    problem, fit = alone(SIZE * y, 'white', 'notch')
    assert not problem.shape(fit, 'notch', 100.0)
    assert fit.estimates['notch']['width'].point == pytest.approx(40.0, rel=0.03)


@pytest.mark.thorough
def test_a_notch_filled_by_what_hisses_behind_it_is_one_beside_a_warm_up():
    rng, n = np.random.default_rng(22), 40_000
    b, a = iirnotch(30, 5, 1 / DT)
    gyro = [lfilter(b, a, SIZE * rng.standard_normal(n)) + 0.05 * SIZE * rng.standard_normal(n)
            + 30 * SIZE * np.exp(-T[:n] / 80) for _ in range(3)]
    names, said = found_in(gyro)
    assert set(names) == {'notch', 'transient'}, said
    assert said.remaining is None, said


@pytest.mark.thorough
def test_up_and_down_again_is_two_steps_though_neither_stands_out_alone():
    rng, size = np.random.default_rng(67), 2.0
    b = 0.05 * SIZE
    gyro = [SIZE * rng.standard_normal(N) + hidden.flicker(N, DT, b, rng) for _ in range(3)]
    gyro[0] = gyro[0] + 3 * size * b * ((T > 0.45 * T[-1]) & (T < 0.6 * T[-1]))
    names, said = found_in(gyro)
    assert names == ['step', 'step'], said
    assert said.found[0].gain < said.found[0].penalty, 'it stands out alone'


@pytest.mark.thorough
@pytest.mark.parametrize(('times', 'at'), [
    (1, 0.7013), pytest.param(2, 0.2513, marks=pytest.mark.thorough)])
def test_a_step_is_no_noise_that_is_loud_where_it_comes(times, at):
    """Its power in time is that of the mean, once the model has it, whatever the length."""
    rng = np.random.default_rng(43)
    gyro = np.concatenate([axes_with(np.zeros(N), rng) for _ in range(times)], axis=1).T
    t = np.arange(len(gyro)) * DT
    gyro[:, 0] += 20 * SIZE * (t > at * t[-1])
    record = ImuRecord(gyro, None, t, 1 / DT)
    problem = NoiseProblem(gather(record, axes=('gyro_x',))['gyro_x'])
    first = model_of('noise', ('white', 'flicker', 'random_walk'))
    without, with_it = (
        in_time.variance(problem.evidence, problem.point(m))
        for m in (first, first.plus(registry('noise')['step']())))
    assert np.max(without.pull) > 6 and np.max(np.abs(with_it.pull)) < 5


@pytest.mark.thorough
def test_a_floor_that_falls_lays_bare_what_stood_beside_it():
    """Flicker alone leaves more of the angle's rounding than there was: both heal what neither."""
    rng = np.random.default_rng(3)
    n, dt = 120_000, 1 / 4000
    gyro = [1.6e-5 * np.sqrt(1 / dt) * rng.standard_normal(n) + hidden.flicker(n, dt, 3.2e-4, rng)
            + hidden.random_walk(n, dt, 1e-5, rng) for _ in range(3)]
    gyro = np.column_stack(gyro) + 6.8e-7 / dt * np.diff(rng.standard_normal((n + 1, 3)), axis=0)
    record = ImuRecord(gyro, None, np.arange(n) * dt, 1 / dt)
    study = analyse_record(record, axes=('gyro_x',), effects=('white', 'random_walk'),
                           keep_motion=True)
    said = study.diagnose(['gyro_x'])['gyro_x']
    assert {f.name for f in said.found} == {'flicker', 'quantization'}, said
    assert said.remaining is None


@pytest.mark.parametrize(('free', 'holds'), [(60.0, True), (1e6, False)])
def test_a_coupling_claims_what_it_tells_beside_all_others(monkeypatch, free, holds):
    """A filter that was found later may have hidden most of it where it was found."""
    signal = 2 * SIZE * np.random.default_rng(45).standard_normal(N)
    gyro = np.column_stack(axes_with(signal, np.random.default_rng(46)))
    problem = NoiseProblem(gather(ImuRecord(gyro, None, T, 1 / DT), axes=('gyro_x',))['gyro_x'])
    without, model = (model_of('noise', names) for names in (
        ('white', 'random_walk'), ('white', 'random_walk', 'shared_noise')))
    monkeypatch.setattr(coupled, '_gains_free', lambda *_: (free, 13.0))
    said = rivals.shape(problem.evidence, problem.point(model), problem.point(without),
                        'shared_noise', 100.0)
    assert (not said) == holds, said


@pytest.mark.parametrize(('free', 'holds'), [((60.0, 0.0), True), ((60.0, 60.0), False)])
def test_a_gain_that_is_less_where_an_axis_is_noisier_is_one_gain(monkeypatch, free, holds):
    """Free gains must do better than one of the axes as recorded, and than one of their shares."""
    rng = np.random.default_rng(48)
    gyro = np.column_stack(axes_with(0.4 * SIZE * rng.standard_normal(N), rng))
    gyro += 5 * SIZE * np.diff(rng.standard_normal((N + 1, 3)), axis=0)
    problem = NoiseProblem(gather(ImuRecord(gyro, None, T, 1 / DT), axes=('gyro_x',))['gyro_x'])
    without, model = (model_of('noise', names) for names in (
        ('white', 'quantization'), ('white', 'quantization', 'shared_noise')))
    fit = problem.point(model)
    gain, chance = coupled._gains_free(problem.evidence, fit, fit.model['shared_noise'])
    assert gain < chance and chance > FLEXIBLE      # many free gains reach more than eight
    monkeypatch.setattr(coupled, '_gains_free', lambda evidence, fit, effect: (
        free[int(effect['heard'])], 20.0))
    said = rivals.shape(problem.evidence, fit, problem.point(without), 'shared_noise', 30.0)
    assert (not said) == holds, said


@pytest.mark.thorough
def test_a_source_that_axes_share_is_named_beside_the_rounding_of_their_angles():
    rng = np.random.default_rng([0, 49])
    source = np.fft.rfft(0.4 * SIZE * rng.standard_normal(N))
    gyro = np.column_stack([
        np.fft.irfft(np.exp(1j * phase) * source, N) + SIZE * rng.standard_normal(N)
        + 4 * SIZE * np.diff(rng.standard_normal(N + 1)) for phase in (0.0, 2.0, -1.0)])
    names, said = found_in(gyro.T)
    assert set(names) == {'quantization', 'shared_noise'}, said


def test_no_form_of_the_spectrum_stands_for_samples_that_are_equal():
    held = registry('noise')['duplicates']()
    fit = SimpleNamespace(model={'duplicates': held})
    assert rivals.shape(None, fit, None, 'duplicates', 1.0) == ''


def test_a_line_raises_what_a_shaken_source_is_missed_by_at_its_own_place_alone():
    """The noise of an accelerometer is smooth: beside a line it is what it is elsewhere."""
    k = np.arange(1, 301)
    bins = Bins(N, DT, k, k + 1)
    noise = np.random.default_rng(8).chisquare(1, 300)
    loud = noise + 1e4 * (k == 150)
    plain, beside = (shared.spread(
        lambda a, b, own=own: own if a == b else 2 * own, 'accel_x~', bins)
        for own in (noise, loud))
    assert np.max(beside / plain) < 1.9 and np.mean(plain) == pytest.approx(1, rel=0.1)


def test_a_ramp_of_another_axis_bends_nothing_a_quarter_of_a_period_later():
    n = 4096
    noise = np.random.default_rng(3).standard_normal(n)
    plain, sloped = (
        dict(shared.signals('gyro_y', dct(x, norm='ortho'), DT, np.ones(1), None, True))
        for x in (noise, noise + 0.02 * np.arange(n)))
    np.testing.assert_allclose(sloped['gyro_y^'], plain['gyro_y^'], atol=1e-6)
    t = np.arange(n)
    without = dct(noise - np.polyval(np.polyfit(t, noise, 1), t), norm='ortho')
    np.testing.assert_allclose(plain['gyro_y^'], shared.later(without), atol=1e-6)


@pytest.mark.thorough
@pytest.mark.parametrize('stays, form, least, most', [
    (2, 'wandering', 5.0, 1e3), (600, 'wandering', 1.0, 3.0), (2, 'displacement', 1.0, 1.0)])
def test_a_peak_on_a_line_of_few_stays_says_the_less(stays, form, least, most):
    """Within the width of the line its power is here and there, with a peak at each."""
    rng, n, cls = np.random.default_rng([62, stays]), 30_000, registry('noise')['narrowband']
    f = 5 + 0.1 * np.repeat(rng.standard_normal(stays), n // stays)
    y = SIZE * (rng.standard_normal((n, 3)) + 3 * np.sin(2 * np.pi * DT * np.cumsum(f))[:, None])
    evidence = gather(ImuRecord(y, None, T[:n], 1 / DT), ['gyro_x'])['gyro_x']
    line, peak, far = (cls({'frequency': a, 'width': b, 'form': form, 'rms': c}, label)
                       for a, b, c, label in ((5.0, 0.23, 2 * SIZE, 'line'),
                                              (5.1, 0.01, SIZE, 'peak'), (5.4, 0.01, SIZE, 'far')))
    bins = evidence.whole.bins
    fit = SimpleNamespace(model=Model([line, peak, far]), details=SimpleNamespace(
        each={e.label: e.binned(bins) for e in (line, peak, far)}))
    assert least <= rivals._on_what_wanders(evidence, fit, peak) <= most
    assert rivals._on_what_wanders(evidence, fit, far) == 1.0, 'beside it'
    assert rivals._on_what_wanders(evidence, fit, line) == 1.0, 'it is what wanders'


def test_samples_that_other_axes_hold_are_no_sign_against_what_they_share(monkeypatch):
    monkeypatch.setattr(normality, 'uneven', lambda some: 100.0 if some else 0.0)
    rng, n = np.random.default_rng(54), 20_000
    x = SIZE * (rng.standard_normal((n, 3)) + 0.7 * rng.standard_normal((n, 1)))
    problem = NoiseProblem(gather(ImuRecord(x, None, T[:n], 1 / DT), ['gyro_x'])['gyro_x'])
    for more, holds in (((), False), (('duplicates',), True), (('ramp',), True)):
        fit = problem.point(model_of('noise', ['white', 'shared_noise', *more]))
        said = normality.not_normal(problem.evidence, fit, fit.model['shared_noise'], 100.0)
        assert ('not normal' in said) != holds


@pytest.mark.thorough
@pytest.mark.parametrize('power', [1.0, 1.3])
def test_filters_that_bend_noise_of_any_colour_to_its_form_give_it_no_name(power):
    """What rises with the frequency is an angle's rounding behind a filter and a notch, or one."""
    y = np.random.default_rng(7).standard_normal(N) + coloured(np.random.default_rng(8), -power)
    problem, fit = alone(SIZE * y, 'white', 'quantization', 'low_pass', 'notch')
    assert 'which has no name, fits as well' in problem.shape(fit, 'quantization', 50.0)
    # with as many parameters the knee of one of the two is better still
    fits = 'better' if power == 1 else 'as well'
    without = problem.point(fit.model.minus('low_pass'))
    said = rivals.shape(problem.evidence, fit, without, 'low_pass', 50.0)
    assert f'which has no name, fits {fits}' in said
    # it lets more pass than may arise behind it: that this lies at its bound says nothing
    some = fit.model['low_pass']
    assert some['behind'] == (0.0 if some.chosen('form') in AVERAGED else 0.02)
    assert problem.shape(fit, 'low_pass', 50.0) == said


@pytest.mark.parametrize(('bend', 'no_more'), [(0.0, True), (6.0, False)])
def test_a_drift_that_is_a_ramp_beside_the_others_is_none(bend, no_more):
    """As a candidate it may have been more, by what others explain that were not there yet."""
    u = T / T[-1]
    y = np.random.default_rng(5).standard_normal(N) + 2 * u + bend * u**2
    problem, fit = alone(SIZE * y, 'white', 'random_walk', 'drift')
    assert ('than the ramp that it holds' in problem.shape(fit, 'drift', 50.0)) == no_more


@pytest.mark.thorough
def test_bursts_are_taken_out_before_two_levels_are_looked_for():
    """They are short stays at another level: 74 nats said so of a filter's noise between them."""
    rng = np.random.default_rng(6)
    y = lfilter([0.2], [1, -0.8], rng.standard_normal(N))
    at = rng.choice(N - 8, 75, replace=False)[:, None] + np.arange(8)
    y[at] += rng.choice([-1, 1], at.shape) * rng.uniform(6, 25, at.shape)
    problem, _ = alone(SIZE * y, 'white', 'spikes')
    kept = problem.evidence.kept('rts')
    assert np.max(np.abs(kept['means_1'])) < 6 * np.std(kept['means_1'])


@pytest.mark.thorough
def test_where_a_response_was_left_open_a_filter_is_looked_for_in_all_of_the_spectrum(monkeypatch):
    """What the smaller model explained with that says nothing of where the filter shows."""
    rng, n, rate = np.random.default_rng(60), 46_000, 200.0
    own = np.convolve(rng.standard_normal(5 * n + 20), np.ones(21) / 21, 'valid')[::5]
    y = SIZE * (own / np.std(own) + 0.06 * rng.standard_normal(n))
    e = gather(ImuRecord(np.outer(y, [1, 0, 0]), None, np.arange(n) / rate, rate), ['gyro_x'])
    fit = NoiseProblem(e['gyro_x']).point(model_of('noise', ('white', 'flicker', 'random_walk')))
    assert fit.details.hint.order.terms
    begun = []
    original = refitted.fit_part

    def seen(*given, hint=None, **named):
        begun.append(hint)
        return original(*given, hint=hint, **named)

    monkeypatch.setattr(refitted, 'fit_part', seen)
    more = refitted.refitted(e['gyro_x'], fit, find_effect('noise', 'low_pass')())
    assert begun[0] is None
    assert more.model['low_pass']['cutoff'] == pytest.approx(0.443 * rate / 4.2, rel=0.05)


@pytest.mark.parametrize('first', [True, False])
def test_of_two_peaks_of_one_shape_the_weaker_falls_whichever_was_found_first(first):
    """The narrow one stood out first; when the whole line was found it lay on that."""
    cls = registry('noise')['narrowband']
    weak, strong = (cls(dict(zip(('frequency', 'width', 'rms'), z), form='wandering'))
                    for z in ((5.2, 0.04, 2e-6), (5.0, 0.5, 1e-5)))
    model = model_of('noise', ('white',))
    for e in (weak, strong) if first else (strong, weak):
        model = model.plus(e)
    power = {e.label: np.full(3, e.values.get('rms', 0.0)) for e in model}
    evidence = SimpleNamespace(whole=SimpleNamespace(bins=SimpleNamespace(count=np.ones(3))))
    fit = SimpleNamespace(model=model, details=SimpleNamespace(each=power))
    said = [e.part_of(rivals._stronger(evidence, fit, e.label)) for e in model.effects[1:]]
    assert [bool(x) for x in said] == [first, not first]


@pytest.mark.thorough
def test_a_peak_explains_what_it_does_where_the_fit_without_it_rests_on_every_bin(monkeypatch):
    """A fit that sets a band aside misses it by any amount, of which a little is much."""
    rng, n = np.random.default_rng([4, 0]), 9400
    y = 1e-3 * rng.standard_normal((n, 3))
    band = sosfilt(butter(10, [0.95, 1.25], 'band', fs=50, output='sos'),
                   rng.standard_normal(n + 3000))[3000:]
    y[:, 0] += 3e-3 * band / band.std()
    record = ImuRecord(y, None, np.arange(n) * 0.02, 50.0)
    problem = NoiseProblem(gather(record, ['gyro_x'])['gyro_x'])
    base = 'white', 'flicker', 'random_walk'
    fit, without = (problem.point(model_of('noise', names)) for names in (
        [*base, 'narrowband'], base))
    assert fit.details.ml - without.details.ml > 10_000
    assert 200 < rivals._explains(problem.evidence, fit, without) < 3000
    monkeypatch.setattr(rivals, 'smooth_gain', lambda *_: 200.0)
    monkeypatch.setattr(rivals, '_restless', lambda *_: 1.0)
    said = rivals.shape(problem.evidence, fit, without, 'narrowband', 100.0)
    assert 'a smooth form without a name fits better by 200 nats' in said


@pytest.mark.parametrize('share, said', [(0.015, True), (0.03, False)])
def test_of_two_couplings_one_that_tells_a_hundredth_is_the_other_s_source(
        monkeypatch, share, said):
    """What an accelerometer's noise hides of a sway other axes hear, and it is no other noise."""
    model = model_of('noise', ['white', 'accel_coupling', 'shared_noise'])
    monkeypatch.setattr(coupled, 'told_by_gains', lambda evidence, fit, label: {
        'accel_coupling': 2000.0, 'shared_noise': 2000.0 * share}[label])
    monkeypatch.setattr(coupled, 'told_anew', lambda *_: (60.0, 60.0))
    monkeypatch.setattr(coupled, '_ways_to_hear', lambda evidence, fit, label: [fit])
    monkeypatch.setattr(coupled, '_gains_free', lambda *_: (0.0, 0.0))
    monkeypatch.setattr(coupled, 'not_normal', lambda *_: 'no noise')
    against = coupled.coupled_otherwise(
        None, SimpleNamespace(model=model), model['shared_noise'], 15.0)
    assert ('do not hear of the same source' in against) == said


@pytest.mark.thorough
@pytest.mark.parametrize('seed', range(4))
@pytest.mark.parametrize('other', [False, True])
def test_axes_tell_of_a_sway_what_an_accelerometer_s_noise_hides_of_it(seed, other):
    """Of each axis, beside the accelerometer, others tell that, and where it is no sway more."""
    rng = np.random.default_rng([33, seed])
    peak = butter(2, [2.0, 2.4], 'band', fs=1 / DT, output='sos')
    sways = sosfilt(peak, rng.standard_normal((N, 3)), axis=0)
    sways *= 1.0 / np.std(sways, axis=0)
    gains = rng.choice([-1.0, 1.0], (3, 3)) * rng.uniform(2.0, 4.0, (3, 3))
    y = rng.standard_normal((N, 3)) + sways @ gains
    if other:
        band = sosfilt(butter(2, [0.1, 5.0], 'band', fs=1 / DT, output='sos'),
                       rng.standard_normal(N))
        y += (1.5 * band / np.std(band))[:, None] * np.array([1.0, -0.8, 1.2])
    record = ImuRecord(SIZE * y, 0.01 * (sways + 0.3 * rng.standard_normal((N, 3))), T, 1 / DT)
    problem = NoiseProblem(gather(record, ['gyro_x'])['gyro_x'])
    fit = problem.point(model_of('noise', (
        'white', 'flicker', 'random_walk', 'accel_coupling', 'shared_noise')))
    told, own = told_anew(problem.evidence, fit, 'shared_noise', 'accel_coupling')
    assert told > 30 and (own > 0.3 * told if other else own < 6), (told, own)
    said = coupled.coupled_otherwise(problem.evidence, fit, fit.model['shared_noise'], told)
    assert ('of the same source' in said) == (not other), said
