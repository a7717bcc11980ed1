# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Machines side by side, of no form that is known: a band, as high as it is measured.

Their phases are integrated from speeds that wander; no formula of the package makes them.
"""

from __future__ import annotations

import numpy as np
from params import seldom
import pytest
from scipy.fft import idct
from scipy.signal import lfilter

from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.loop.effect import find_effect, model_of
from imu_noise_tools.noise.block_means import covariance_of_means
from imu_noise_tools.noise.effects.shock import Shock
from imu_noise_tools.noise.gather import gather
from imu_noise_tools.noise.problem import NoiseProblem
from imu_noise_tools.tasks.noise import analyse_record

N_WHITE = 1e-4      # rad/s/sqrt(Hz)
BASE = model_of('noise', ('white', 'flicker', 'random_walk'))
BAND = find_effect('noise', 'band')


def motors(rng, rate, seconds, speeds, wander=1.0, above=1e4, tau=0.5, axes=1):
    """Return (axes, n): what motors do whose speeds (Hz) wander, so far above white noise."""
    n = int(rate * seconds)
    out = np.zeros((axes, n))
    for speed in speeds:
        a = np.exp(-1 / (rate * tau))
        drive = wander * np.sqrt(1 - a * a) * rng.standard_normal(n + 2000)
        f = speed + lfilter([1.0], [1.0, -a], drive)[2000:]
        phase = 2 * np.pi * np.cumsum(f) / rate
        size = np.sqrt(8 * above * wander) * N_WHITE * rng.lognormal(0, 0.3, (axes, 1))
        out += size * np.sin(phase + rng.uniform(0, 2 * np.pi, (axes, 1)))
    return out


def record_of(shaken, rng, rate):
    """Return a record whose axes hear so much, (k, n), in white noise; the others hear nothing."""
    gyro = N_WHITE * np.sqrt(rate) * rng.standard_normal((shaken.shape[1], 3))
    gyro[:, :len(shaken)] += shaken.T
    return ImuRecord(gyro, None, np.arange(len(gyro)) / rate, rate)


def told(record):
    """Return gyro_x of a record after all that its loop adds, and its diagnosis."""
    study = analyse_record(record, axes=('gyro_x',), keep_motion=True)
    study.complete()
    return study.states['gyro_x'], study.diagnosis['gyro_x']


def problem_of(record):
    """Return the problem of gyro_x."""
    return NoiseProblem(gather(record, ['gyro_x'])['gyro_x'])


@pytest.mark.parametrize(('seed', 'rate', 'speeds', 'axes'), [
    (2, 400, (181.4, 191.5, 192.0), 1),                     # up to the end of the spectrum
    seldom(1, 1000, (187.0, 190.0, 193.7, 201.0), 1),       # alone on its axis
    seldom(3, 1000, (184.0, 187.5, 196.0), 3),              # heard by all axes
    seldom(4, 500, (120.0, 122.0, 140.0, 141.0), 3),
])
def test_machines_side_by_side_are_a_band_and_nothing_is_missing(seed, rate, speeds, axes):
    rng = np.random.default_rng(seed)
    state, said = told(record_of(motors(rng, rate, 60, speeds, axes=axes), rng, rate))
    assert said.verdict == 'complete'
    assert 'band' in [e.name for e in state.model]
    assert {e.name for e in state.model} <= {'white', 'flicker', 'random_walk', 'band'}
    low, high = state.fit.estimates['white']['N'].ci95
    assert low < N_WHITE < high or state.fit.estimates['white']['N'].value == pytest.approx(
        N_WHITE, rel=0.01)


@pytest.mark.thorough
def test_what_an_accelerometer_hears_of_machines_as_well_is_no_coupling():
    """Shares of its axes are other ones for each machine; the band leaves nothing to them."""
    rng, rate = np.random.default_rng(10), 1000
    heard = motors(rng, rate, 60, (187.0, 190.0, 193.7, 201.0), axes=6)
    record = record_of(heard[:3], rng, rate)
    noise = np.sqrt(rate) * rng.standard_normal((3, heard.shape[1]))
    accel = [[0], [0], [9.81]] + 1e-3 * (noise + heard[3:] / N_WHITE)
    state, said = told(ImuRecord(record.gyro, accel.T, record.t, rate))
    assert said.verdict == 'complete' and 'band' in [e.name for e in state.model]
    assert 'accel_coupling' not in [e.name for e in state.model]


def coloured(rng, n, rate, psd):
    """Return noise of a density, drawn by the cosines of the record."""
    f = np.arange(n) * rate / (2 * n)
    f[0] = f[1]
    return idct(rng.standard_normal(n) * np.sqrt(0.5 * rate * psd(f)), type=2, norm='ortho')


@pytest.mark.parametrize('psd', [
    lambda f: 1e-8 * (1 + (1 / f) ** 3),                            # rises to the slow end
    lambda f: 1e-8 * (1 + (f / 10) ** 4),                           # rises to the fast end
    lambda f: 1e-8 * (1 + 4 * np.exp(-0.5 * ((f - 20) / 3) ** 2)),  # not high
    lambda f: 1e-8 * (1 + 1e3 * np.exp(-0.5 * np.log(f / 5) ** 2)),  # wider than an octave
], ids=['slow', 'fast', 'low', 'wide'])
def test_no_band_stands_out_of(psd):
    rng = np.random.default_rng(5)
    n, rate = 60_000, 100.0
    problem = problem_of(ImuRecord(np.column_stack(
        [coloured(rng, n, rate, psd) for _ in range(3)]), None, np.arange(n) / rate, rate))
    assert not BAND().starts(problem.evidence)


def test_two_lines_that_the_record_does_not_resolve_are_none():
    """Nearly all of that is in a few coefficients: a band has as many levels as there are."""
    n, rate = 25_600, 400.0
    t = np.arange(n) / rate
    beat = sum(a * np.sin(2 * np.pi * f * t + p) for a, f, p in (
        (2.2e-4, 4.2137, 2.5), (2.8e-4, 4.1988, 0.8)))
    y = 1e-3 * np.random.default_rng(3).standard_normal(n) + beat
    record = ImuRecord(np.column_stack([y, y, y]), None, t, rate)
    evidence = gather(record, ['gyro_x'])['gyro_x']
    assert find_effect('noise', 'band')().starts(evidence) == []


def test_one_machine_of_a_known_form_keeps_its_name():
    """It is the band that is asked last."""
    rng = np.random.default_rng(6)
    state, said = told(record_of(motors(rng, 500, 60, (120.0,), above=100.0), rng, 500))
    assert 'band' not in [e.name for e in state.model]
    assert 'narrowband' in [e.name for e in state.model]


@pytest.mark.parametrize(('seed', 'on'), [(4, False), seldom(5, True), seldom(6, True)])
def test_one_machine_that_wanders_seldom_is_a_narrow_band_as_measured(seed, on):
    """Its spectrum is where it has been; that its level stays tells it from noise of no form."""
    rng, rate, seconds = np.random.default_rng(seed), 100, 1200
    shaken = motors(rng, rate, seconds, (23.0,), wander=0.1, above=300, tau=seconds / 40)
    if on:
        t = np.arange(shaken.shape[1]) / rate
        shaken = shaken * ((t > 200) & (t < 700) | (t > 1000))
    state, said = told(record_of(shaken, rng, rate))
    assert said.verdict == 'complete'
    assert {e.name for e in state.model} <= {'white', 'flicker', 'random_walk', 'narrowband'}
    machine = state.model['narrowband']
    assert machine.chosen('form') == 'measured' and machine.as_measured
    assert machine['frequency'] == pytest.approx(23.0, abs=0.15)
    assert machine['rms'] == pytest.approx(np.std(shaken), rel=0.02)
    assert state.fit.estimates['narrowband']['frequency'].note == 'as it is measured'
    assert 'while that runs' in machine.manner(state.problem.evidence)
    low, high = state.fit.estimates['white']['N'].ci95
    assert low < N_WHITE < high


def test_of_noise_no_form_is_measured():
    """Where no level stays it is no form that another one may take."""
    rng = np.random.default_rng(7)
    evidence = problem_of(record_of(np.zeros((1, 20_000)), rng, 100)).evidence
    peak = find_effect('noise', 'narrowband').example()
    form = next(p for p in peak.parameters if p.name == 'form')
    assert len(evidence.machines) == 0 and evidence.machine_at(4.0) is None
    assert peak.with_values(form='measured').by_chance(evidence) == np.inf
    assert form.choices.index('measured') not in peak.others(form, evidence)
    assert not type(peak)({'form': 'measured'}).starts(evidence)


def test_its_levels_are_those_of_each_part():
    """A half tells how a machine was in it: what it did in the other one is no prediction."""
    rng = np.random.default_rng(7)
    rate, n = 500, 60_000
    shaken = motors(rng, rate, 120, (100.0, 104.0))
    shaken[:, :n // 2] = motors(rng, rate, 60, (101.0, 106.0))[:, :n // 2]
    problem = problem_of(record_of(shaken, rng, rate))
    band = BAND().starts(problem.evidence)[0]
    first, second = problem.split()[0]
    before, after = (second.score(first.point(m)) for m in (BASE, BASE.plus(band)))
    assert after.within_chance and before.excess > 100


def test_means_of_blocks_hear_what_is_fast_and_narrow():
    """A strong peak beyond what is folded one by one adds to them as its power does."""
    rng = np.random.default_rng(8)
    rate = 1000
    problem = problem_of(record_of(motors(rng, rate, 60, (187.0, 190.0, 194.0)), rng, rate))
    fit = problem.point(BASE.plus(BAND().starts(problem.evidence)[0]))
    for known in ('odd', 'even'):
        view = problem.time(fit, known)
        assert view.excess < 3 * view.std


def test_white_noise_is_as_loud_beyond_the_folds_as_within():
    """What is told of beyond takes the place of the last fold's level, and of nothing else."""
    def level(f):
        return np.ones(np.shape(f))

    same = covariance_of_means(level, 64, 64 * 100, 0.01)
    twice = covariance_of_means(level, 64, 64 * 100, 0.01, lambda low: 2.0)
    assert np.allclose(covariance_of_means(level, 64, 64 * 100, 0.01, lambda low: 1.0), same)
    assert 1 < twice[0, 0] / same[0, 0] < 1.1


def test_a_ring_where_a_machine_wanders_is_no_shock():
    rng = np.random.default_rng(9)
    problem = problem_of(record_of(motors(rng, 500, 60, (120.0, 124.0)), rng, 500))
    fit = problem.point(BASE.plus(BAND().starts(problem.evidence)[0]))
    knock = Shock({'rate': 0.1, 'size': 1.0, 'decay': 0.5, 'ring': 121.0})
    assert 'band' in knock.otherwise(problem.evidence, fit, 100.0)
    assert not knock.with_values(ring=30.0).otherwise(problem.evidence, fit, 100.0)
    assert not knock.otherwise(problem.evidence, problem.point(BASE), 100.0)
