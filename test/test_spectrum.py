# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The cosine spectrum against brute force: bins, finite records, lines, quadrature."""

from __future__ import annotations

from hypothesis import example, given, settings, strategies as st
import numpy as np
import pytest
from scipy.fft import dct
from scipy.linalg import toeplitz

from imu_noise_tools.core import gauss_markov, spectrum

N, DT = 4096, 0.02


@settings(max_examples=200)
@given(st.integers(3, 3_000_000))
@example(3)
@example(257)
@example(258)
@example(259)
@example(512)
def test_bins_tile_all_coefficients_but_the_mean(n):
    b = spectrum.bins_of(n, DT)
    assert b.first[0] == 1 and b.last[-1] == n
    np.testing.assert_array_equal(b.first[1:], b.last[:-1])
    assert np.all(b.count >= 1) and b.count.sum() == n - 1
    assert np.all(b.count[:min(spectrum.SINGLE, n - 1)] == 1)
    # no bin is wider than it may be (the last one may take what is left over)
    assert np.all(b.count <= max(1.5 * max(1, n / spectrum.LINEAR), 1))
    assert np.all(b.f > 0) and b.f[-1] < 0.5 / DT


@settings(max_examples=100)
@given(st.integers(300, 100_000), st.data())
def test_index_finds_the_bin(n, data):
    b = spectrum.bins_of(n, DT)
    k = data.draw(st.integers(1, n - 1))
    i = b.index(k)
    assert b.first[i] <= k < b.last[i]


def test_frequency_is_that_of_the_cosines():
    b = spectrum.bins_of(N, DT)
    np.testing.assert_allclose(b.f[:5], np.arange(1, 6) / (2 * N * DT), rtol=1e-14)
    i = len(b.f) - 2
    assert b.f[i] == pytest.approx(np.mean(np.arange(b.first[i], b.last[i])) / (2 * N * DT))


@settings(max_examples=30)
@given(st.integers(10, 5000), st.integers(0, 2 ** 31), st.floats(-1e3, 1e3))
def test_no_power_is_lost(n, seed, offset):
    """Parseval: the bins hold the variance of the record, whatever its mean."""
    y = np.random.default_rng(seed).standard_normal(n)
    b = spectrum.bins_of(n, DT)
    p = spectrum.power(spectrum.cosine_transform(y + offset), DT, b)
    assert np.sum(p * b.count) / (2 * DT) == pytest.approx(np.sum((y - y.mean()) ** 2), rel=1e-8)


def test_a_density_is_one_sided():
    """White noise of N has 2 N^2, so that its integral up to Nyquist is the variance N^2/dt."""
    y = 3e-3 / np.sqrt(DT) * np.random.default_rng(1).standard_normal(1 << 20)
    b = spectrum.bins_of(len(y), DT)
    p = spectrum.power(spectrum.cosine_transform(y), DT, b)
    assert np.average(p, weights=b.count) == pytest.approx(2 * 3e-3 ** 2, rel=0.005)


def test_transform_is_the_one_in_the_docstring():
    y = np.random.default_rng(2).standard_normal(50)
    k, j = np.arange(1, 50)[:, None], np.arange(50)
    phi = np.sqrt(2 / 50) * np.cos(np.pi * k * (j + 0.5) / 50)
    c = spectrum.cosine_transform(y.copy())
    np.testing.assert_allclose(c[1:], phi @ y, atol=1e-12)
    assert c[0] == pytest.approx(0, abs=1e-12)


# --- what a finite record does to a spectrum -----------------------------------------------------

def _cosines(n, most):
    k, j = np.arange(1, most + 1)[:, None], np.arange(n)
    return np.sqrt(2 / n) * np.cos(np.pi * k * (j + 0.5) / n)


def _expected_power(covariance, most=40):
    """Return E[2 dt c_k^2] of k = 1 ... most, from the covariance of the samples themselves."""
    phi = _cosines(len(covariance), most)
    return 2 * DT * np.einsum('ki,ij,kj->k', phi, covariance, phi, optimize=True)


def flicker_covariance(n):
    """
    Return -D/2, D(h) = (4/pi) sum_{j<=h} 1/(2j - 1): the variance of x_{i+h} - x_i for B = 1.

    D = int 2 B^2 dt/s 4 sin^2(pi f h dt) df, and int_0^{pi/2} sin^2(h x)/sin x dx is that sum. A
    constant may be added to D, since no cosine but the mean's sees it.
    """
    return toeplitz(-2 / np.pi * np.concatenate([[0], np.cumsum(1 / (2 * np.arange(1, n) - 1))]))


def flicker(f):
    return 2 * DT / (2 * np.sin(np.pi * f * DT))


def random_walk(f):
    return 2 * DT ** 2 / (2 * np.sin(np.pi * f * DT)) ** 2


def test_flicker_in_a_finite_record():
    b = spectrum.bins_of(N, DT)
    exact = _expected_power(flicker_covariance(N))
    np.testing.assert_allclose((exact / flicker(b.f[:40]))[:6],
                               [.774, .903, .931, .950, .959, .966], atol=6e-4)
    ours = spectrum.expected(flicker, b)
    np.testing.assert_allclose(ours[:32], exact[:32], rtol=0.004)
    np.testing.assert_allclose(ours[32:40], exact[32:], rtol=0.01)


def test_flicker_factors_do_not_depend_on_the_length():
    exact = _expected_power(flicker_covariance(512), 6) / flicker(np.arange(1, 7) / (1024 * DT))
    np.testing.assert_allclose(exact, [.774, .903, .931, .950, .959, .966], atol=2e-3)
    for n in (2000, 300_000):
        b = spectrum.bins_of(n, DT)
        np.testing.assert_allclose((spectrum.expected(flicker, b) / flicker(b.f))[:6],
                                   [.774, .903, .931, .950, .959, .966], atol=3e-3)


def test_random_walk_in_a_finite_record():
    i = np.arange(N)
    exact = _expected_power(DT * np.minimum.outer(i, i).astype(float))
    b = spectrum.bins_of(N, DT)
    np.testing.assert_allclose(exact / random_walk(b.f[:40]), 1, rtol=1e-6)
    np.testing.assert_allclose(spectrum.expected(random_walk, b)[:40], exact, rtol=0.01)


def test_white_noise_passes_unchanged():
    for n in (100, N, 1_000_000):
        b = spectrum.bins_of(n, DT)
        np.testing.assert_allclose(spectrum.expected(lambda f: np.full(len(f), 7.0), b), 7,
                                   rtol=1e-12)


@pytest.mark.parametrize('ratio', [0.03, 0.3, 1, 3, 10, 100, 1000])
def test_gauss_markov_in_a_finite_record(ratio):
    """From Tc far longer than the record, where it is a random walk, to Tc of a few samples."""
    tc = N * DT / ratio
    covariance = toeplitz(4.0 * np.exp(-np.arange(N) * DT / tc))
    exact = _expected_power(covariance)
    bins = spectrum.bins_of(N, DT)
    ours = spectrum.expected(lambda f: gauss_markov.psd(f, 2.0, tc, DT), bins)[:40]
    np.testing.assert_allclose(ours, exact, rtol=0.012)


@pytest.mark.parametrize('n', [100, 150, 300])
def test_short_records_are_expected_right_too(n):
    b = spectrum.bins_of(n, DT)
    exact = _expected_power(flicker_covariance(n), n - 1)
    np.testing.assert_allclose(spectrum.expected(flicker, b), b.mean(np.append([0], exact)),
                               rtol=0.03)


def test_a_bin_expects_the_mean_of_its_coefficients():
    """A bin's centre stands for all of it: checked where the spectrum falls most steeply."""
    b = spectrum.bins_of(400_000, DT)
    k = np.arange(400_000)
    with np.errstate(divide='ignore'):
        direct = b.mean(random_walk(k / (2 * 400_000 * DT)))
    np.testing.assert_allclose(spectrum.expected(random_walk, b)[32:], direct[32:], rtol=0.005)


# --- lines ---------------------------------------------------------------------------------------

@settings(max_examples=60)
@given(st.integers(20, 3000), st.floats(1e-3, 0.999), st.floats(-2, 2), st.floats(-2, 2))
@example(1000, 0.25, 1.0, 0.5)                          # exactly on a coefficient
@example(1000, 0.251, 1.0, 0.5)                         # and on an odd one
@example(1000, 0.2505, 1.0, 0.5)                        # exactly between two
def test_line_coefficients(n, share, a, b):
    frequency = share * 0.5 / DT
    t = np.arange(n) * DT
    w = 2 * np.pi * frequency
    exact = dct(a * np.cos(w * t) + b * np.sin(w * t), type=2, norm='ortho')[1:]
    ours = spectrum.line_coefficients(frequency, a, b, np.arange(1, n), n, DT)
    np.testing.assert_allclose(ours, exact, atol=1e-9 * np.sqrt(n) * 10)


# --- quadrature ----------------------------------------------------------------------------------

M = np.unique(np.round(np.geomspace(1, 30_000, 40)))


def allan_kernel(psd, m):
    """Return 2 int S sin^4(pi f m dt)/(m sin(pi f dt))^2 df by brute force: 4 million points."""
    f = (np.arange(1 << 22) + 0.5) / (1 << 22) * 0.5 / DT
    w = np.sin(np.pi * f * m * DT) ** 4 / (m * np.sin(np.pi * f * DT)) ** 2
    return 2 * np.mean(psd(f) * w) * 0.5 / DT


CASES = {
    'white': (lambda f: np.full(np.shape(f), 2.0), lambda m: 1 / (m * DT)),
    'random walk': (random_walk, lambda m: m * DT / 3 * (1 + 1 / (2 * m ** 2))),
    'quantization': (lambda f: 2 / DT * (2 * np.sin(np.pi * f * DT)) ** 2,
                     lambda m: 3 / (m * DT) ** 2),
    'AR(1), slow': (lambda f: gauss_markov.psd(f, 1.0, 50.0, DT),
                    lambda m: gauss_markov.avar(m, 1.0, 50.0, DT)),
    'AR(1), fast': (lambda f: gauss_markov.psd(f, 1.0, 0.05, DT),
                    lambda m: gauss_markov.avar(m, 1.0, 0.05, DT)),
}


@pytest.mark.parametrize('rate', [-2.0, 0.0, 3.0, 40.0])
@pytest.mark.parametrize('begin, end', [(0, N), (700, 3001)])
def test_a_line_that_fades_has_a_complex_frequency(rate, begin, end):
    t = np.arange(N) * DT
    inside = (np.arange(N) >= begin) & (np.arange(N) < end)
    gamma = rate / (N * DT)
    k = np.arange(1, N)
    wave = spectrum.line_basis(3.21 + 0.5j * gamma / np.pi, k, N, DT, begin, end)
    for part, y in (wave.real, np.cos), (wave.imag, np.sin):
        y = inside * np.exp(-gamma * t) * y(2 * np.pi * 3.21 * t)
        np.testing.assert_allclose(part, dct(y, type=2, norm='ortho')[1:], atol=1e-8)


@pytest.mark.parametrize('name', CASES)
def test_quadrature_against_closed_forms(name):
    psd, closed = CASES[name]
    np.testing.assert_allclose(spectrum.quadrature_avar(psd, M, DT), closed(M), rtol=0.005)


def test_quadrature_of_flicker():
    """Flat at 2 ln2/pi, and 1.443, 1.154, 1.034 times that at m = 1, 2, 5."""
    avar = spectrum.quadrature_avar(flicker, np.array([1, 2, 5, 3000]), DT)
    np.testing.assert_allclose(avar / (2 * np.log(2) / np.pi), [1.443, 1.154, 1.034, 1.0],
                               atol=2e-3)


@pytest.mark.parametrize('m', [1, 3, 48, 49, 700])
def test_quadrature_against_brute_force_on_a_band(m):
    """A broad resonance has no closed form: the seam between the two rules must not show."""
    def psd(f):
        return 1 / ((1 - (f / 0.7) ** 2) ** 2 + (0.3 * f / 0.7) ** 2)
    ours = spectrum.quadrature_avar(psd, m, DT)[0]
    assert ours == pytest.approx(allan_kernel(psd, m), rel=0.005)


@pytest.mark.parametrize('tc', [0.003, 0.05, 4.0, 500.0, 3e6])
def test_sampled_gauss_markov_against_its_covariance(tc):
    """Allan variance from the autocovariance of the samples, for every ratio of dt to tc."""
    m = 64
    a = np.concatenate([-np.ones(m), np.ones(m)]) / m
    exact = 0.5 * a @ toeplitz(np.exp(-np.arange(2 * m) * DT / tc)) @ a
    # for dt << tc the covariance itself cancels: compare with K^2 tau/3, K^2 = 2 sigma^2/tc
    if tc > 1e5:
        exact = 2 / tc * m * DT / 3 * (1 + 1 / (2 * m ** 2))
    assert gauss_markov.avar(np.array([m]), 1.0, tc, DT)[0] == pytest.approx(exact, rel=1e-4)


@pytest.mark.parametrize('n', [40, 300, 20_000])
def test_what_leaks_is_linear_and_the_same_in_blocks_as_in_one_matrix(n, monkeypatch):
    """Behind a filter that leaves nothing near Nyquist; a change of it leaks as it does."""
    b = spectrum.bins_of(n, DT)
    v = 1 / (1 + (b.f / 0.02) ** 4)
    changes = v[:, None] * np.random.default_rng(n).uniform(0.5, 1.5, (len(v), 3))
    at_once = spectrum.leaked(v, b), spectrum.leaked(v, b, changes)
    some = at_once[0] > 0
    assert some.any() and not at_once[1][~some].any()
    for j in range(3):
        more = spectrum.leaked(v + 1e-3 * changes[:, j], b) - at_once[0]
        np.testing.assert_allclose(at_once[1][some, j], 1e3 * more[some], rtol=1e-6, atol=1e-12)
    monkeypatch.setattr(spectrum, 'ROW_BLOCKS', 1)
    spectrum._leakage.cache_clear()
    try:
        np.testing.assert_allclose(spectrum.leaked(v, b, changes), at_once[1], rtol=1e-9,
                                   atol=1e-15)
    finally:
        spectrum._leakage.cache_clear()


def test_what_a_wave_leaks_beside_itself_is_what_its_cosines_have_there():
    """Of all phases at both ends: far from it, on either side, within 3 %."""
    n, dt, phases = 8192, 0.01, np.pi * np.arange(8) / 4
    moved = phases / (2 * np.pi * n * dt)
    b, t = spectrum.bins_of(n, dt), np.arange(n) * dt
    seen = np.mean([spectrum.power(spectrum.cosine_transform(
        np.sin(2 * np.pi * (20.0 + f) * t + phase)), dt, b) for phase in phases for f in moved],
        axis=0)
    inside = np.abs(b.f - 20.0) < 1.0
    told = spectrum.leaked_beside(seen, b, inside)
    far = (np.abs(b.f - 20.0) > 3.0) & (b.f > 0.5)
    assert np.all(told[inside] == 0)
    ratio = np.array([np.sum(seen[i]) / np.sum(told[i]) for i in np.array_split(
        np.flatnonzero(far), 12)])
    assert ratio == pytest.approx(np.ones(12), abs=0.03)
