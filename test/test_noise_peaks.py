# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Peaks that wander, and several in one record: how they are confirmed, and what they move."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from params import daily
import pytest
from scipy.linalg import solve_discrete_lyapunov
from scipy.signal import lfilter, welch

from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.loop.diagnosis import diagnose
from imu_noise_tools.loop.effect import find_effect, model_of, unfitted
from imu_noise_tools.loop.prediction import fall_of, State
from imu_noise_tools.loop.verdict import PRICE
from imu_noise_tools.noise import flexible, materiality, rivals, starts
from imu_noise_tools.noise.candidates import _one as tried, _where as where
from imu_noise_tools.noise.fit import fit as fit_part
from imu_noise_tools.noise.gather import gather
from imu_noise_tools.noise.kinds import Inputs
from imu_noise_tools.noise.likelihood import Likelihood
from imu_noise_tools.noise.problem import NoiseProblem
from imu_noise_tools.noise.search import Found

BASE = ('white', 'flicker', 'random_walk')
DT, SIZE = 0.01, 1e-3


def problem_of(y):
    """Return the problem of the first of three axes (n, 3)."""
    record = ImuRecord(SIZE * y, None, np.arange(len(y)) * DT, 1 / DT)
    return NoiseProblem(gather(record, ['gyro_x'])['gyro_x'])


def ringing(rng, n, f, width, rms):
    """Return a resonance (n,), as the recursion of its two states has it."""
    pole = np.exp(2j * np.pi * f * DT - np.pi * width * DT)
    swing = lfilter([1], [1, -2 * pole.real, abs(pole) ** 2], rng.standard_normal(n + 2000))[2000:]
    return rms * swing / np.std(swing)


def machine(rng, n, f, rms):
    """Return a line (n,) of a frequency (n,) whose strength wanders."""
    slow = lfilter([1], [1, -0.995], rng.standard_normal((n, 2)), axis=0)
    phase = 2 * np.pi * np.cumsum(f) * DT
    y = slow[:, 0] * np.cos(phase) + slow[:, 1] * np.sin(phase)
    return rms * y / np.std(y)


@pytest.fixture(scope='module')
def fan():
    """Return the problem of noise behind a filter, two resonances and a fan that wanders."""
    rng, n = np.random.default_rng(0), 60_000
    y = lfilter([0.55], [1, -0.45], rng.standard_normal((n, 3)), axis=0)
    y[:, 0] += ringing(rng, n, 0.567, 0.0015, 0.3) + ringing(rng, n, 1.7, 0.009, 0.12)
    y[:, 0] += machine(rng, n, 10 + np.cumsum(rng.standard_normal(n)) * 0.02 * np.sqrt(DT), 0.25)
    return problem_of(y)


def test_of_machines_side_by_side_a_peak_is_one_of_them():
    """What a fit rests on has none of their middles, and their skirts any peak explains."""
    rng, n = np.random.default_rng(2), 60_000
    y = rng.standard_normal((n, 3))
    middles = np.array([19.2, 20.05, 18.6])
    for f in middles:
        slow = lfilter([1], [1, -0.9995], rng.standard_normal(n))
        y[:, 0] += 6 * np.sin(2 * np.pi * np.cumsum(f + 0.1 * slow / np.std(slow)) * DT)
    problem = problem_of(y)
    found = tried(problem, problem.point(model_of('noise', BASE)),
                  find_effect('noise', 'narrowband')()).finding
    assert found.gain > found.penalty and not found.against
    assert np.min(np.abs(found.effect['frequency'] - middles)) < 0.1
    assert 0.1 < found.effect['width'] < 0.4, found.effect


def test_what_rings_above_half_the_rate_is_one_peak():
    """Its skirts are those of one pole: without that form two stood for it on each other."""
    rng, n, f, width = np.random.default_rng(5), 60_000, 312.4, 1.8
    r = np.exp(-np.pi * width * DT)
    swing = lfilter([1], [1, -r * np.exp(2j * np.pi * f * DT)],
                    np.sqrt(1 - r * r) * (rng.standard_normal(n) + 1j * rng.standard_normal(n)))
    y = rng.standard_normal((n, 3))
    y[:, 0] += 2 * swing.real
    problem = problem_of(y)
    fit = problem.fit(model_of('noise', BASE))
    found = diagnose(State(problem, fit, problem.held_out(fit.model))).found
    assert [x.name for x in found] == ['narrowband']
    assert found[0].effect.chosen('form') == 'folded'
    assert found[0].effect['frequency'] == pytest.approx(12.4, abs=0.1)
    assert found[0].effect['width'] == pytest.approx(width, rel=0.1)


@pytest.mark.parametrize('form', ['displacement', 'velocity', 'folded'])
def test_what_is_drawn_has_the_spectrum_and_the_states_of_its_form(form):
    """Of the states' covariance that of what is heard; and of the samples that are drawn."""
    peak = find_effect('noise', 'narrowband').example().with_values(form=form)
    step, q, heard = peak.state_space(DT)
    state = heard @ solve_discrete_lyapunov(step, q) @ heard.T
    assert np.sqrt(state) == pytest.approx(peak['rms'])
    f = np.linspace(2.0, 45.0, 40)
    turn = np.exp(2j * np.pi * f * DT)
    gain = [heard @ np.linalg.solve(z * np.eye(len(step)) - step, np.eye(len(step))) for z in turn]
    psd = [2 * DT * (g @ q @ g.conj().T).real.item() for g in gain]
    np.testing.assert_allclose(peak.psd(f, DT), psd, rtol=1e-9)
    y = peak.apply(np.zeros(400_000), Inputs(np.arange(400_000) * DT, DT),
                   np.random.default_rng(1))
    at, power = welch(y, 1 / DT, nperseg=4096)
    near = np.abs(at - peak['frequency']) < 2 * peak['width']
    np.testing.assert_allclose(np.sum(power[near]), np.sum(peak.psd(at[near], DT)), rtol=0.05)


@pytest.mark.parametrize('f, width, told', [(10.0, 0.3, True), (10.0, 30.0, False)])
def test_a_band_of_too_much_power_is_told_where_it_is_narrow(f, width, told):
    """People look for what turns or swings there, whether or not a form of the library has it."""
    rng, n = np.random.default_rng(4), 20_000
    y = rng.standard_normal((n, 3))
    y[:, 0] += ringing(rng, n, f, width, 3.0)
    problem = problem_of(y)
    where = flexible.smooth_misfit(problem.evidence, problem.point(model_of('noise', BASE))).where
    low, high = map(float, where.removesuffix(' Hz').split(' to ')) if told else (0.0, 0.0)
    assert (f - 1 < low < f < high < f + 1) if told else not where, where


@pytest.mark.thorough
def test_what_is_fitted_to_every_bin_begins_where_the_fit_is(fan):
    """Begun anew, two peaks exchanged their places, and each had left its intervals."""
    for many in 1, 2, 3:    # as a search finds them
        fit = fan.point(model_of('noise', [*BASE, 'gauss_markov', *['narrowband'] * many]))
    assert sorted(e['frequency'] for e in fit.model if e.name == 'narrowband') == pytest.approx(
        [0.567, 1.7, 10.0], rel=0.06)
    other = fit_part(fan.evidence, unfitted(fit.model), intervals=False, start=fit.model,
                     robust=False)
    assert other.details.ml > fit.details.ml - 1e-3
    assert not materiality._moved(fan.evidence, fit)


@pytest.mark.thorough
def test_no_smooth_form_stands_in_a_sharp_peak_s_place(fan, monkeypatch):
    """What is left beside it is another's: of five peaks all fell for what the others had left."""
    fit = fan.point(model_of('noise', [*BASE, 'gauss_markov', *['narrowband'] * 3]))
    monkeypatch.setattr(rivals, 'smooth_gain', lambda *_: 1e6)
    for e in (e for e in fit.model if e.name == 'narrowband'):
        against = rivals.shape(fan.evidence, fit, fan.point(unfitted(fit.model.minus(e.label))),
                               e.label, 100.0)
        assert ('a smooth form' in against) != e.sharp, (e, against)
    assert {e.sharp for e in fit.model if e.name == 'narrowband'} == {False, True}


@pytest.mark.thorough
def test_what_wanders_is_elsewhere_in_each_half():
    rng, n = np.random.default_rng(5), 40_000
    y = rng.standard_normal((n, 3))
    f = np.where(np.arange(n) < n / 2, 20.5, 19.0) + 0.02 * np.cumsum(
        rng.standard_normal(n)) * np.sqrt(DT)
    y[:, 0] += machine(rng, n, f, 0.7)
    problem = problem_of(y)
    model = model_of('noise', [*BASE, 'narrowband'])
    peak = problem.point(model).model['narrowband']
    # a thirtieth of it where the one half is predicted at the other one's place
    assert fall_of(problem.held_out(model.minus('narrowband')), problem.held_out(model),
                   [peak]) > 5000
    assert peak.chosen('form') == 'wandering' and len(peak.elsewhere()) > 30
    assert not peak.with_values(form='velocity').elsewhere()


@pytest.mark.parametrize('seed', daily((0, 1), 0))
@pytest.mark.parametrize('stays, least, most', [(None, 1.0, 2.5), (400, 1.0, 3.0), (6, 6.0, 1e3)])
def test_a_line_that_stayed_at_few_places_is_restless(seed, stays, least, most):
    """
    Its halves differ by more than noise; of many places, and of a resonance, by as much.

    Its phase wanders where it stays: else there are as many lines, each of which begins and ends.

    """
    rng, n = np.random.default_rng([seed, 94]), 40_000
    if stays is None:
        peak = ringing(rng, n, 10.0, 0.8, 0.5)
    else:
        speed = np.repeat(10 + 0.4 * rng.standard_normal(stays), n // stays + 1)[:n]
        speed = speed + 0.5 * np.random.default_rng([seed, 95]).standard_normal(n)
        peak = 0.7 * np.cos(2 * np.pi * np.cumsum(speed) * DT)
    y = rng.standard_normal((n, 3))
    y[:, 0] += peak
    assert least <= rivals._restless(problem_of(y).evidence, 9.0, 11.0) <= most


def test_of_two_forms_as_good_that_which_has_room_is_meant():
    """Of a line that hardly wanders: a bell ends at the narrowest it may be."""
    problem = problem_of(np.random.default_rng(3).standard_normal((15_000, 3)))
    bell = {'form': 'wandering', 'frequency': 31.3, 'width': 0.1}
    view = Likelihood(problem.evidence, 'whole', model_of('noise', [*BASE, 'narrowband'])
                      .with_values({'narrowband': bell}))
    lower, upper = view.bounds
    inside = (lower + upper) / 2
    width, rms = ([s.parameter.name for s in view.slots].index(k) for k in ('width', 'rms'))
    ends = np.where(np.arange(len(inside)) == width, lower, inside)
    assert np.exp(ends[width]) == pytest.approx(2.2 / 150)
    with_room, at_end, weak = (
        Found(view, x, 10.0, None).cost - view.value(x)[1].form for x in (
            inside, ends, np.where(np.arange(len(inside)) == rms, lower, inside)))
    assert at_end - with_room == PRICE
    assert weak == with_room, 'an amplitude at its bound is none, which is an estimate'


@pytest.mark.thorough
@pytest.mark.parametrize('seed', [0, 2])
def test_a_peak_behind_a_filter_begins_at_its_own_height(seed):
    """By its foot, where the filter lets pass, it began a million times too high and was lost."""
    rng, n = np.random.default_rng(seed), 26_000
    y = 0.034 * rng.standard_normal((n, 3))
    y[:, 0] += lfilter([0.23], [1, -0.973], rng.standard_normal(n))
    y[:, 0] += ringing(rng, n, 3.15, 0.02, 0.15)
    problem = problem_of(y)
    fit = problem.point(model_of('noise', [*BASE, 'low_pass']))
    peak = next(f for f in problem.candidates(fit) if f.name == 'narrowband')
    assert peak.effect['frequency'] == pytest.approx(3.15, abs=0.03) and peak.gain > peak.penalty


@pytest.mark.thorough
def test_a_filter_behind_a_coupling_begins_at_what_that_leaves():
    """By the vibration that other channels tell it began where the fit was worse than without."""
    rng, n = np.random.default_rng(0), 40_000
    shaken = ringing(rng, n, 30.0, 3.0, 1.0)[:, None]
    accel = 0.2 * shaken * [1, 0.5, 0.7] + 0.002 * rng.standard_normal((n, 3))
    y = lfilter([0.8], [1, -0.2], rng.standard_normal((n, 3)) + 10 * shaken, axis=0)
    record = ImuRecord(SIZE * y, accel, np.arange(n) * DT, 1 / DT)
    problem = NoiseProblem(gather(record, ['gyro_x'])['gyro_x'])
    coupled = problem.point(model_of('noise', [*BASE, 'accel_coupling']))
    model = unfitted(coupled.model).plus(find_effect('noise', 'low_pass')())
    likelihood = Likelihood(problem.evidence, 'whole', model)
    begun = starts._of_what_passes(likelihood, coupled.model, model['low_pass'])
    assert begun and all(e['cutoff'] > 15.0 for e in begun if e['form'] < 1)
    left = starts._gain_alone(likelihood, coupled.model.plus(begun[0]), begun[0]).whole.power
    at = np.argmax(problem.evidence.whole.power)
    assert left[at] < 30 * np.median(left)      # of 2000 that the vibration stands above the noise


def test_a_peak_is_asked_for_where_it_shows_whatever_is_lost_elsewhere():
    """Refitted beside it others lost more, and of a line that was named no part asked for it."""
    f, at = np.arange(1.0, 101.0), 20
    power, peak = np.ones(100), np.zeros(100)
    power[at], peak[at] = 10.0, 9.0
    bins = SimpleNamespace(f=f, count=np.full(100, 8.0))
    evidence = SimpleNamespace(whole=SimpleNamespace(bins=bins, power=power))
    before = SimpleNamespace(details=SimpleNamespace(v=np.ones(100)))
    after = SimpleNamespace(model=model_of('noise', ('white', 'narrowband')),
                            details=SimpleNamespace(v=0.5 + peak, each={'narrowband': peak}))
    said = where(evidence, before, after, find_effect('noise', 'narrowband')())
    assert said == 'the spectrum asks for it at 21 Hz'
