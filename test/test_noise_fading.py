# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""How the level of a narrow band fades tells a machine from a resonance."""

from __future__ import annotations

from collections import Counter

import numpy as np
from params import daily
import pytest
from scipy.signal import lfilter

from imu_noise_tools.core.spectrum import cosine_transform
from imu_noise_tools.noise import fading
from imu_noise_tools.noise.effects.narrowband import Narrowband
from imu_noise_tools.noise.line_search import find_peaks
from imu_noise_tools.noise.smooth import reference_spectrum

N, DT = 20_000, 0.01
T = np.arange(N) * DT


def resonance(rng, f, width):
    pole = np.exp(2j * np.pi * f * DT - np.pi * width * DT)
    return lfilter([1], [1, -2 * pole.real, abs(pole) ** 2], rng.standard_normal(2 * N))[N:]


def machine(rng, f, width):
    """Return a line whose speed wanders, slowly beside its width."""
    a = np.exp(-DT * width / 3)
    wander = lfilter([np.sqrt(1 - a * a)], [1, -a], rng.standard_normal(2 * N))[N:]
    return np.cos(2 * np.pi * np.cumsum(f + width / 2.355 * wander) * DT)


def switched(rng, f, width):
    return machine(rng, f, width) * ((T % 70 > 20) & (T % 70 < 38))


def kinds_of(make, count):
    """Return how often each kind is told of bands of any width, well above the noise."""
    rng, out = np.random.default_rng(11), Counter()
    for _ in range(count):
        width = 10 ** rng.uniform(-0.9, -0.3)
        y = make(rng, rng.uniform(10, 40), width)
        y = rng.standard_normal(N) + y / np.std(y) * np.sqrt(width)
        c = cosine_transform(y)
        lines, humps = find_peaks(c, reference_spectrum(c, DT), DT)
        told = fading.of_humps(c, DT, humps[:1], lines[:, 0])
        out[fading.kind(*told[0, :2]) if len(told) else 'none'] += 1
    return out


@pytest.mark.thorough
@pytest.mark.parametrize('count', (60, 8))
@pytest.mark.parametrize('make, kind, others', [
    (resonance, 'swings', {'stays', 'comes'}),
    (machine, 'stays', {'swings', 'comes'}),
    (switched, 'comes', {'swings', 'stays'}),
])
def test_the_level_of_a_band_tells_what_makes_it(make, kind, others, count):
    """Where it is told at all: never another one."""
    told = kinds_of(make, count)
    assert told[kind] > 0.4 * count and not others & set(told), told


def test_the_ratio_is_one_of_a_machine_two_of_a_resonance_more_of_what_is_switched():
    rng = np.random.default_rng(12)
    ratio = {}
    for make in (resonance, machine, switched):
        y = make(rng, 25.0, 0.5)
        c = cosine_transform(y / np.std(y) + 0.01 * rng.standard_normal(N))
        ratio[make.__name__], count = fading.fading(c, round(25 * 2 * N * DT), round(4 * N * DT))
        assert 40 < count < 4 * N * DT
    assert ratio['resonance'] == pytest.approx(2, abs=0.35)
    assert ratio['machine'] == pytest.approx(1, abs=0.1)
    assert ratio['switched'] == pytest.approx(70 / 18, rel=0.15)


def once(rng, f, width):
    """Return a machine that runs for less than half of the record."""
    return machine(rng, f, width) * ((T > 40) & (T < 130))


def beating(rng, f, width):
    """Return two machines side by side."""
    return machine(rng, f, width) + machine(rng, f + width, width)


@pytest.mark.parametrize('seed', daily([*range(6)], 0))
@pytest.mark.parametrize('make, told', [
    (machine, True), (once, True), (resonance, False), (beating, False)])
def test_the_level_of_one_machine_stays_while_it_is_on(seed, make, told):
    """Of a band whose ends are far from it; what a resonance or two machines make swings."""
    rng, width = np.random.default_rng([15, seed]), 0.4
    y = make(rng, 25.0, width)
    c = cosine_transform(y / np.std(y) + 0.1 * rng.standard_normal(N))
    low, high = (round(f * 2 * N * DT) for f in (23.5, 26.5))
    assert fading.stays(c, low, high) == told
    assert not fading.stays(c, low, low + 10), 'too few amplitudes'


@pytest.mark.parametrize('count', daily((400, 60), 60))
def test_noise_in_a_band_is_no_machine(count):
    """Of any width and shape."""
    rng = np.random.default_rng(16)
    for _ in range(count):
        c = 0.1 * rng.standard_normal(N)
        x = np.linspace(-1, 1, int(10 ** rng.uniform(1.3, 3.5)))
        low = rng.integers(500, N - 500 - len(x))
        shape = np.exp(-0.5 * (x / rng.uniform(0.1, 3)) ** 2)
        c[low:low + len(x)] += 10 * shape * rng.standard_normal(len(x))
        assert not fading.stays(c, low, low + len(x))


def test_a_band_at_the_end_of_the_spectrum_and_one_that_is_cut_are_not_told():
    rng = np.random.default_rng(13)
    c = cosine_transform(resonance(rng, 25.0, 2.0))
    assert fading.fading(c, 10, 100) == fading.fading(c, N - 10, 100) == (0.0, 0.0)
    assert fading.fading(c, round(25 * 2 * N * DT), 200) == (0.0, 0.0)
    assert fading.in_words(0.0, 0.0, 0.0) == ''


def test_no_band_is_told_that_a_line_lies_on():
    c = cosine_transform(np.random.default_rng(14).standard_normal(N))
    hump = np.array([[20.0, 0.1, 50.0]])
    assert np.all(fading.of_humps(c, DT, hump, np.array([20.05])) == 0)


@pytest.mark.parametrize('width, said', [(0.2, True), (2.0, False)])
def test_a_narrowband_says_how_its_own_band_fades(width, said):
    class Seen:
        def fades(self, frequency, width):
            return (1.0, 300.0, 0.0) if width < 1 else (0.0, 0.0, 0.0)

    one = Narrowband({'frequency': 25.0, 'width': width, 'rms': 1.0, 'form': 'wandering'})
    assert ('machine' in one.manner(Seen())) == said


def swing_of(rng, make):
    """Return when the narrow band of a swing in noise is said to have faded, None: no band."""
    y = 0.5 * make(rng.uniform(0.2, 40), rng.uniform(0, 6)) + rng.standard_normal(N)
    c = cosine_transform(y)
    lines, humps = find_peaks(c, reference_spectrum(c, DT), DT)
    told = fading.of_humps(c, DT, humps[:1], lines[:, 0])
    return told[0, 2] if len(told) else None


@pytest.mark.parametrize('share', daily([0.2, 0.4, -0.3], 0.4, -0.3))
def test_a_swing_that_fades_tells_in_which_time(share):
    """Three draws each; one that swells has it below zero."""
    rng = np.random.default_rng(15)
    for _ in range(3):
        level = np.exp(-(T if share > 0 else T - T[-1]) / (share * T[-1]))
        found = swing_of(rng, lambda f, phase: level * np.sin(2 * np.pi * f * T + phase))
        assert found == pytest.approx(share * T[-1], rel=0.2)


@pytest.mark.thorough
@pytest.mark.parametrize('make', [
    lambda f, phase: np.sin(2 * np.pi * f * T + phase),
    lambda f, phase: np.sin(2 * np.pi * f * T + phase) * (np.abs(T - 100) < 40),
    lambda f, phase: 2 * resonance(np.random.default_rng(int(1e3 * phase)), f, 4 / (N * DT)) / 60,
], ids=['steady', 'part', 'resonance'])
def test_what_stays_runs_for_a_part_or_is_driven_by_noise_does_not_fade(make):
    rng = np.random.default_rng(16)
    assert not any(swing_of(rng, make) for _ in range(4))
