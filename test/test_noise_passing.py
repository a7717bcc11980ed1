# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Lines that begin or end within a record: which are found, how well, and what is none."""

from __future__ import annotations

import numpy as np
from params import daily, seldom
import pytest

import hidden
from imu_noise_tools.core.allan import curve
from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.core.spectrum import cosine_transform, line_basis
from imu_noise_tools.loop.effect import find_effect, Model
from imu_noise_tools.noise.curve import effect_avar
from imu_noise_tools.noise.effects.sinusoid import Sinusoid
from imu_noise_tools.noise.gather import gather
from imu_noise_tools.noise.kinds import Inputs
from imu_noise_tools.noise.line_search import find_peaks
from imu_noise_tools.noise.lines import waves
from imu_noise_tools.noise.passing import in_part, louder, Passing
from imu_noise_tools.noise.smooth import reference_spectrum
from imu_noise_tools.report.words import times_in_words
from imu_noise_tools.tasks.noise import analyse_record

DT, N = 0.01, 30_000
T = DT * np.arange(N)


def table(y):
    """Return the line table of some samples."""
    c = cosine_transform(y.copy())
    return find_peaks(c, reference_spectrum(c, DT), DT)[0]


def passing(rng, share, z):
    """Return (samples of a line of z standard deviations in white noise, f, a, begin, end)."""
    m, f = int(share * N), rng.uniform(2, 40)
    begin = int(rng.choice([0, N - m, rng.integers(N - m)]))
    size, y = z * np.sqrt(2 / m), rng.standard_normal(N)
    y[begin:begin + m] += size * np.sin(2 * np.pi * f * T[:m] + rng.uniform(0, 7))
    return y, f, size, begin, begin + m


def record_of(y):
    """Return a record of samples (n,) of one axis beside two that share nothing with it."""
    others = np.random.default_rng(0).permuted([y, y], axis=1)
    return ImuRecord(1e-3 * np.column_stack([y, *others]), None, T, 1 / DT)


def evidence_of(y):
    """Return what is gathered of samples (n,) of one axis."""
    return gather(record_of(y), ['gyro_x'])['gyro_x']


@pytest.mark.parametrize('share', daily((0.1, 0.5, 0.8), 0.5))
@pytest.mark.parametrize('z', daily((40, 300, 3000), 40))
def test_a_line_of_a_stretch_is_one_line(share, z):
    """Beside it there is none: its skirts are no lines, and leave no hump."""
    for seed in range(3):
        rng = np.random.default_rng([seed, z, int(10 * share)])
        y, f, _, begin, end = passing(rng, share, z)
        c = cosine_transform(y)
        (row,), humps = find_peaks(c, reference_spectrum(c, DT), DT)
        assert abs(row[0] - f) < 1 / ((end - begin) * DT) and not len(humps)
        # five times as far as it scatters, and half a swing
        off = 25 * (end - begin) / z**2 + 0.5 / (f * DT)
        assert row[4:] == pytest.approx([begin, end], abs=off)
        assert (row[4] == 0) == (begin == 0) and (row[5] == N) == (end == N)


@pytest.mark.thorough
def test_what_is_said_of_it_is_as_far_off_as_it_says():
    pulls = {'frequency': [], 'amplitude': [], 'begin': [], 'end': []}
    for seed in range(60):
        rng = np.random.default_rng([seed, 3])
        y, f, size, begin, end = passing(rng, rng.uniform(0.2, 0.7), np.exp(rng.uniform(3.3, 6)))
        evidence = evidence_of(y)
        line = evidence.line(0)
        for name, truth in (('frequency', f), ('amplitude', 1e-3 * size), ('begin', begin * DT),
                            ('end', end * DT)):
            found = getattr(line, name)
            if found.std > 0:
                pulls[name].append((found.point - truth) / found.std)
    for name, some in pulls.items():
        # the place of a change has long tails: half of them are within a third of its scatter
        least = 0.5 if name in ('frequency', 'amplitude') else 0.25
        assert len(some) > 30 and least < 1.48 * np.median(np.abs(some)) < 1.3, (name, some)
        assert np.mean(np.abs(some) < 1.96) > 0.88, (name, some)


def narrow(rng, kind, cells, z):
    """Return samples with a narrow band of so many cells of 1/T."""
    band = hidden.narrow_band(rng, N, DT, rng.uniform(2, 40), cells / (N * DT), kind)
    return rng.standard_normal(N) + z / np.sqrt(N) * band


@pytest.mark.thorough
@pytest.mark.parametrize('kind', ('resonance', 'wandering'))
def test_a_narrow_band_has_no_beginning_and_no_end(kind):
    """Of a width below 1/T and above, faint and strong: one of 1600 of each has."""
    some = [table(narrow(np.random.default_rng([seed, i, j]), kind, cells, z))
            for seed in range(2) for i, cells in enumerate((0.3, 1, 3, 10))
            for j, z in enumerate((8, 15, 40, 200))]
    assert sum(bool(np.any(t[:, 5] - t[:, 4] < N)) for t in some) <= 1


def test_the_noise_of_a_stretch_is_told_beside_a_line():
    rng = np.random.default_rng(80613)
    for share, times in ((0.2, 1.0), (0.2, 4.0), (0.5, 1.5)):
        m = int(share * N)
        y = rng.standard_normal(N)
        y[:m] *= np.sqrt(times * (1 - share) / (1 - share * times))
        c = cosine_transform(y / np.std(y))
        told = [louder(Passing(f, 0.0, 0.0, 0.0, 0, m), c, np.full(N - 1, 2 * DT), DT)
                for f in np.linspace(3, 47, 40)]
        assert np.median(told) == pytest.approx(times, rel=0.2)


@pytest.mark.thorough
def test_a_resonance_that_is_on_for_a_while_is_seldom_a_line():
    lines = 0
    for seed in range(80614, 80634):
        rng = np.random.default_rng(seed)
        m, begin = int(0.25 * N), int(rng.integers(0.7 * N))
        band = hidden.narrow_band(rng, N, DT, rng.uniform(2, 40), 20 / (m * DT), 'resonance')
        y = rng.standard_normal(N)
        y[begin:begin + m] += 200 / np.sqrt(m) * band[begin:begin + m]
        lines += np.any(in_part(table(y), N))
    assert lines <= 2


def test_a_line_that_fades_is_none_that_ends():
    for seed in range(8):
        rng = np.random.default_rng([seed, 5])
        fades = (1 - 0.5 * T / T[-1], np.exp(-T / T[-1]))[seed % 2]
        found = table(rng.standard_normal(N) + 0.3 * fades * np.sin(2 * np.pi * 7.7 * T))
        assert not np.any(found[:, 5] - found[:, 4] < N)


def test_coefficients_of_a_stretch_are_those_of_its_samples():
    y = np.where((T >= 40) & (T < 170), np.exp(2j * np.pi * 3.21 * T), 0)
    k = np.arange(1, N, 7)
    for part, own in ((y.real, np.real), (y.imag, np.imag)):
        np.testing.assert_allclose(
            own(line_basis(3.21, k, N, DT, 4000, 17_000)), cosine_transform(part)[k], atol=1e-9)
    both = line_basis(3.21, k, N, DT, np.array([[0], [4000]]), np.array([[N], [17_000]]))
    np.testing.assert_allclose(both[0], line_basis(3.21, k, N, DT), atol=1e-9)


def test_it_is_there_in_means_as_long_as_it_is_there():
    rows = np.array([[0.5, 2.0, 1.0, 50.0, 4005, 17_000]])
    y = np.where((np.arange(N) >= 4005) & (np.arange(N) < 17_000),
                 2 * np.cos(np.pi * T) + np.sin(np.pi * T), 0.0)
    np.testing.assert_allclose(waves(rows, T, DT), y, atol=1e-9)
    means, middle = y.reshape(-1, 10).mean(axis=1), T.reshape(-1, 10).mean(axis=1)
    np.testing.assert_allclose(waves(rows, middle, DT, 10), means, atol=0.05)


def test_the_effect_is_simulated_and_drawn_as_it_says():
    line = Sinusoid({'amplitude': 1.0, 'frequency': 2.0, 'begin': 100.0, 'end': 160.0})
    y = line.apply(np.zeros(N), Inputs(T, DT), np.random.default_rng(1))
    assert np.ptp(y[:10_000]) == np.ptp(y[16_000:]) == 0 and np.std(y[10_000:16_000]) > 0.7
    assert line.share(300.0) == pytest.approx(0.2) and line.share(130.0) == pytest.approx(3 / 13)
    assert Sinusoid({'amplitude': 1.0, 'frequency': 2.0}).share(10.0) == 1
    seen = curve(y, DT, deviation='oadev')
    evidence = evidence_of(y + 1e-3 * np.random.default_rng(2).standard_normal(N))
    said = effect_avar(evidence, Model([line]), line, seen.m)
    some = seen.m < 500
    np.testing.assert_allclose(np.sqrt(said[some]), seen.dev[some], rtol=0.1, atol=0.02)


@pytest.mark.thorough
def test_half_of_a_line_is_no_order_of_a_machine():
    """A family of lines is there throughout."""
    rng = np.random.default_rng(9)
    y = rng.standard_normal(N) + sum(
        (T < 150) * 0.3 * np.sin(2 * np.pi * k * 4.1 * T) for k in (1, 2, 3))
    evidence = evidence_of(y)
    assert len(evidence.line_table) == 3
    assert find_effect('noise', 'harmonics')().rows(evidence, [0, 1, 2]) == []


@pytest.mark.parametrize(('share', 'z'), [seldom(0.05, 20), (0.05, 60), seldom(0.025, 60)])
def test_what_is_there_for_a_moment_ends_when_it_does(share, z):
    """As short as a 64th of the record; what is shorter is no line of a limit's length."""
    for seed in range(4):
        rng = np.random.default_rng([seed, z, int(1000 * share)])
        y, _, _, begin, end = passing(rng, share, z)
        (row,) = table(y)
        assert row[4:] == pytest.approx([begin, end], abs=25 * (end - begin) / z**2 + 60)
        y, *_ = passing(rng, 0.008, 60)
        assert not np.any(table(y)[:, 5] - table(y)[:, 4] < N)


@pytest.mark.thorough
def test_where_a_line_that_wanders_stayed_it_neither_began_nor_ended():
    """Fast and then slowly, by dozens of 1/T: there was a line for a tenth of such records."""
    some = []
    for seed in range(12):
        rng = np.random.default_rng([seed, 21])
        f = 22 + np.cumsum(rng.standard_normal(N)) * 0.07 * np.sqrt(2 * DT / 100)
        y = rng.standard_normal(N) + 0.3 * np.sin(2 * np.pi * DT * np.cumsum(f))
        found = table(y)
        some.append(bool(np.any(found[:, 5] - found[:, 4] < N)))
    assert sum(some) == 0


@pytest.mark.thorough
def test_it_sweeps_nowhere():
    """Nor is what is there for a moment, and strong, loud or a line that moves."""
    rng, t = np.random.default_rng(0), DT * np.arange(60_001)
    y = rng.standard_normal((len(t), 3))
    y[:, 0] += 3 * ((t >= 411) & (t < 471)) * np.sin(2 * np.pi * 31.7 * t + rng.uniform(0, 7))
    evidence = gather(ImuRecord(1e-3 * y, None, t, 1 / DT), ['gyro_x'])['gyro_x']
    assert len(evidence.line_table) == 1
    assert evidence.sweep[0] < 10 and not len(evidence.loud), evidence.sweep


@pytest.mark.parametrize('begin', [None, 102.0])
def test_times_that_count_from_later_than_the_recording_are_said_to(begin):
    source = {'path': 'x', 'duration_s': 300.0} | ({'begin_s': begin} if begin else {})
    said = times_in_words(source)
    assert said == ([] if begin is None else [
        'times count from 102 s of the recording on, where what is analysed begins'])
    assert times_in_words({'streams': {'gyro': source, 'accel': {}}}) == [
        f'gyro: {x}' for x in said]


@pytest.mark.thorough
@pytest.mark.parametrize('seed', range(6))
def test_a_machine_that_is_switched_on_or_off_is_all_that_is_missing(seed):
    """Where one begins as the other ends, both; the errors of both halves fall to chance."""
    rng = np.random.default_rng([seed, 11])
    y, f, *_, end = passing(rng, rng.uniform(0.3, 0.7), np.exp(rng.uniform(3.5, 5)))
    first = 1
    if seed % 2 and end < N:
        y[end:] += 0.3 * np.sin(2 * np.pi * (f + 0.6) * T[end:])
        first = 2
    study = analyse_record(record_of(y), axes=('gyro_x',))
    study.complete()
    state = study.states['gyro_x']
    assert [e.name for e in state.model.effects][3:] == first * ['sinusoid'], state.model.labels
    assert study.diagnosis['gyro_x'].verdict == 'complete'
