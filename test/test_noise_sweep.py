# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A line that moves through the frequencies, and all that is none."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import chirp, iirpeak, lfilter

import hidden
from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.core.spectrum import cosine_transform
from imu_noise_tools.loop.effect import find_effect, Model, model_of
from imu_noise_tools.noise.gather import whitened
from imu_noise_tools.noise.smooth import reference_spectrum
from imu_noise_tools.noise.sweep import _along_lines, find_sweep, HALVED, Sweep
from imu_noise_tools.tasks.noise import analyse_record

N, DT = 60_000, 0.01
T = np.arange(N) * DT


def found(y):
    """Return the sweep of samples (n,)."""
    c = cosine_transform(y - np.mean(y))
    return Sweep(*find_sweep(whitened(c, reference_spectrum(c, DT), DT), DT))


def white(seed, n=N):
    """Return white noise of variance 1."""
    return np.random.default_rng(seed).standard_normal(n)


@pytest.mark.parametrize('first, last, red', [(5.0, 25.0, 0.0), (40.0, 12.0, 0.0),
                                              (30.0, 20.0, 0.9)])
def test_a_sweep_is_found_with_its_path(first, last, red):
    """Its energy is half of A^2 n over the noise around: nats, of which cells keep the most."""
    noise = lfilter([1.0], [1, -red], white(1))
    level = np.abs(1 / (1 - red * np.exp(-2j * np.pi * 25.0 * DT)))
    said = found(noise + 0.15 * level * chirp(T, first, T[-1], last))
    # all of it or half: digital lines leave some straight ones by a cell
    part = (said.end - said.begin) / T[-1]
    assert said.sure > 20 and part > 0.45
    path = [first + (last - first) * t / T[-1] for t in (said.begin, said.end)]
    assert [said.first, said.last] == pytest.approx(path, abs=1.0)
    assert 0.4 < said.strong / (0.25 * 0.15**2 * N * part) < 1.2


@pytest.mark.parametrize('first, last', [(2.18, 10.0), (1.0, 20.0), (30.0, 8.0)])
def test_a_machine_that_runs_up_by_its_share_is_found(first, last):
    """A fiftieth of the power of the noise: along straight lines through all of it few were."""
    for seed in range(3):
        said = found(white([21, seed]) + 0.2 * chirp(T, first, T[-1], last, 'logarithmic'))
        assert said.sure > 15 and said.end - said.begin > 0.45 * T[-1]
        path = [first * (last / first)**(t / T[-1]) for t in (said.begin, said.end)]
        assert [said.first, said.last] == pytest.approx(path, abs=1.0)


@pytest.mark.thorough
def test_noise_has_none():
    """Of 300 records one in thirty would have a sweep of 3.4 nats, were the bound exact."""
    rng = np.random.default_rng(2)
    sure = [found(rng.standard_normal(int(rng.integers(3_000, 20_000)))).sure for _ in range(300)]
    assert max(sure) < np.log(3000)


@pytest.mark.parametrize('y', [
    pytest.param(white(3) + 2 * np.sin(2 * np.pi * 11 * T), id='line'),
    pytest.param(white(4) + np.sin(2 * np.pi * 11 * T) * (T % 100 < 50), id='on and off'),
    pytest.param(white(5) * np.where(T < 200, 1, 5), id='louder'),
    pytest.param(white(6) + 40 * (np.random.default_rng(6).random(N) < 1e-3), id='spikes'),
    pytest.param(lfilter([1], [1, -1.7, 0.9], white(7)), id='resonance'),
    pytest.param(lfilter([1], [1, -1.9, 0.998], white(8)) + 3 * white(9), id='narrow band'),
    pytest.param(np.cumsum(white(10)) + white(11), id='random walk'),
    pytest.param(white(12)[np.arange(N) // 3], id='held')])
def test_what_stays_is_none(y):
    assert found(y).sure < 5


@pytest.mark.parametrize('high', [1.0, 20.0])
def test_a_band_that_is_switched_on_and_off_is_none(high):
    """Nor what it leaks into: of most of these, a line along 4 Hz was seen."""
    for seed in range(3):
        rng = np.random.default_rng([9, seed])
        x = lfilter(*iirpeak(rng.uniform(5, 40), 30, 1 / DT), rng.standard_normal(2 * N))[N:]
        on = np.searchsorted(np.sort(rng.uniform(0, T[-1], 4)), T) % 2
        assert found(rng.standard_normal(N) + high * on * x / np.std(x)).sure < 7


@pytest.mark.parametrize('f, tc, width, harmonics, on', [
    (23.4, 40, 0.005, 2, True), (11.8, 100, 0.03, 3, False), (35.0, 40, 0.01, 1, False),
    (8.0, 200, 0.04, 1, True)])
def test_a_machine_whose_speed_wanders_is_none(f, tc, width, harmonics, on):
    """Nor one that runs now and then: it crosses a path, and is loud there."""
    for seed in range(4):
        rng = np.random.default_rng([seed, tc])
        a = np.exp(-DT / tc)
        speed = lfilter([width * np.sqrt(1 - a**2)], [1, -a], rng.standard_normal(2 * N))[N:]
        phase = 2 * np.pi * f * DT * np.cumsum(1 + speed)
        runs = (T > 60) & (T < 200) | (T > 350) & (T < 480) if on else 1
        heard = sum(np.sin(k * phase) / k for k in range(1, harmonics + 1)) * runs
        assert found(rng.standard_normal(N) + 2 * heard).sure < 6


@pytest.mark.parametrize('runs', [1, 2, 4])
@pytest.mark.parametrize('wander', [0.0, 0.003])
def test_a_machine_that_runs_up_again_and_again_sweeps(runs, wander):
    """With a speed that is not quite even, and louder the faster it is."""
    at, a = T * runs / T[-1] % 1, np.exp(-DT / 20)
    speed = 8 + 24 * at + 20 * lfilter([wander * np.sqrt(1 - a**2)], [1, -a], white(18))
    said = found(white(17) + (speed / 32)**2 * np.sin(2 * np.pi * DT * np.cumsum(speed)))
    rate = (said.last - said.first) / (said.end - said.begin)
    assert said.sure > 30 and rate == pytest.approx(24 * runs / T[-1], rel=0.1)


def test_sums_along_lines_are_those_of_the_cells():
    """The best of all lines, against every digital line of Brady's recursion written out."""
    power = np.random.default_rng(13).exponential(size=(32, 37))
    power[np.arange(32), (5 + np.arange(32) * 20 // 31) % 37] += 4

    def path(steps, w):
        if w == 1:
            return [0]
        half = path(steps // 2, w // 2)
        return half + [(steps + 1) // 2 + k for k in half]

    sums = {(s, at): sum(power[i, (at + k) % 37] for i, k in enumerate(path(s, 32)))
            for s in range(8, 32) for at in range(37)}
    _, strong, blocks, _, steps, at = _along_lines(power, 5, 1, HALVED)
    best = max(sums, key=lambda k: sums[k])
    assert (blocks, steps, at) == (32, *best) and strong == pytest.approx(sums[best] - 32)


@pytest.mark.thorough
def test_a_weak_sweep_is_unknown_and_no_filter():
    """Over the lower third of the band: the spectrum alone says that it falls."""
    y = 1e-4 * np.column_stack([white(s) for s in (14, 15, 16)])
    y[:, 0] += 1.5e-5 * chirp(T, 18.0, T[-1], 1.0)
    study = analyse_record(ImuRecord(y, None, T, 1 / DT), axes=('gyro_x',), keep_motion=True)
    said = study.diagnose(['gyro_x'])['gyro_x']
    assert said.verdict == 'unknown' and 'sweep' in {f.view for f in said.failed}, said


@pytest.mark.thorough
@pytest.mark.parametrize('first, last, n', [
    (7.0, 12.0, 20_000), *(pytest.param(*x, 54_000, marks=pytest.mark.thorough) for x in (
        (7.35, 9.61), (3.15, 4.9), (6.0, 4.0), (1.7, 3.2)))])
def test_a_line_that_sweeps_all_along_is_no_band_that_it_passes(first, last, n):
    """A band that wanders was named, for 454 nats of 68 000."""
    rate = 50.0
    t = np.arange(n) / rate
    y = 1e-3 * np.random.default_rng(n).standard_normal((n, 3))
    y[:, 0] += 3e-3 * np.sqrt(2) * chirp(t, first, t[-1], last)
    study = analyse_record(ImuRecord(y, None, t, rate), axes=('gyro_x',), keep_motion=True)
    said = study.diagnose(['gyro_x'])['gyro_x']
    assert not said.found and said.verdict == 'unknown'
    assert 'sweep' in {f.name for f in said.remaining.failed}


@pytest.mark.thorough
@pytest.mark.parametrize('real', [False, True])
def test_a_machine_that_runs_up_between_two_speeds_is_no_change_of_the_noise(real):
    """It makes the bands that it passes louder meanwhile; noise that changes does so in all."""
    n, rate = 16_000, 100.0
    t = np.arange(n) / rate
    phase = 2 * np.pi * np.cumsum(np.interp(t, [0, 40, 80, 160], [20, 20, 32, 32])) / rate
    noise = np.random.default_rng(5).standard_normal((n, 3))
    noise[(t > 40) & (t < 80)] *= 1.5 if real else 1.0
    y = 1e-3 * noise
    y[:, 0] += 1.5e-3 * np.sin(phase)
    study = analyse_record(ImuRecord(y, None, t, rate), axes=('gyro_x',), keep_motion=True)
    problem = study.states['gyro_x'].problem
    model = model_of('noise', ('white', 'sinusoid', 'sinusoid'))
    before = problem.point(model)
    found = {f.name: f for f in problem.candidates(before)}['variance_change']
    fit = problem.point(model.plus(find_effect('noise', 'variance_change')()))
    said = problem.shape(fit, 'variance_change', found.gain)
    assert found.gain > 50 and ('a line that sweeps' not in said) == real, said


@pytest.mark.thorough
@pytest.mark.parametrize('seed', [126603798, 126603854])
def test_a_hump_is_no_band_far_above_it_nor_one_in_a_hole(seed):
    """So damped it has no name: skirts of a line 400 000 times as high were one, and a notch."""
    rng = np.random.default_rng([7, seed])
    record, _ = hidden.draw(rng, ('resonance',), strength=(1.0, 10.0), hours=0.3, rate_hz=50.0)
    study = analyse_record(record, axes=('gyro_x',), keep_motion=True)
    said = study.diagnose(['gyro_x'])['gyro_x']
    assert not said.found and said.verdict == 'unknown'


def test_a_notch_has_no_peak_in_it():
    notch, band, white_ = (find_effect('noise', k) for k in ('notch', 'narrowband', 'white'))
    hole = notch({**notch.neutral, 'frequency': 2.4, 'width': 1.6})
    for f, width, inside in ((2.3, 0.2, True), (2.3, 2.0, False), (4.0, 0.2, False)):
        peak = band({**band.neutral, 'frequency': f, 'width': width, 'rms': 1.0})
        assert bool(hole.part_of(Model([white_({'N': 1.0}), hole, peak]))) == inside
