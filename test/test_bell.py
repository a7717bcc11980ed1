# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A line that wanders: every closed form against the covariance matrix of a short record."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.fft import dct
from scipy.linalg import toeplitz

from imu_noise_tools.core import bell, spectrum

N, DT, RMS = 600, 0.02, 2.0
cases = pytest.mark.parametrize(('f0', 'width'), [
    (4.0, 0.4), (4.02, bell.LEAST / (N * DT)), (12.0, 3.0), (1.0, 0.3), (24.0, 2.0)])


def covariance(f0, width):
    return RMS**2 * toeplitz(bell.covariance(np.arange(N), f0, width, DT))


@cases
def test_power_in_bins_is_that_of_the_finite_record(f0, width):
    basis = dct(np.eye(N), type=2, norm='ortho', axis=0)
    power = 2 * DT * np.sum((basis @ covariance(f0, width)) * basis, axis=1)
    bins = spectrum.bins_of(N, DT, (11.9, 12.4))
    found, truth = bell.binned(bins, RMS, f0, width), bins.mean(power)
    alone, top = bins.count == 1, np.max(truth)
    np.testing.assert_allclose(found[alone], truth[alone], rtol=1e-4, atol=1e-7 * top)
    np.testing.assert_allclose(found[~alone], truth[~alone], rtol=5e-3, atol=2e-3 * top)
    assert np.sum(found * bins.count) == pytest.approx(2 * DT * N * RMS**2, rel=0.05)


@cases
def test_allan_variance(f0, width):
    c = covariance(f0, width)
    for m in (1, 2, 5, 20, 100):
        weight = np.repeat([-1.0, 1.0], m) / m
        truth = 0.5 * weight @ c[:2 * m, :2 * m] @ weight
        assert bell.avar(m, RMS, f0, width, DT) == pytest.approx(truth, rel=1e-9)


def test_allan_variance_of_a_long_record_is_that_of_its_spectrum():
    m = np.array([1, 10, 1000, 100_000])
    by_hand = spectrum.quadrature_avar(lambda f: bell.psd(f, RMS, 5.0, 1.0, DT), m, DT)
    np.testing.assert_allclose(bell.avar(m, RMS, 5.0, 1.0, DT), by_hand, rtol=0.02)


@cases
def test_slopes_are_those_of_the_power(f0, width):
    bins, h = spectrum.bins_of(N, DT), 1e-3
    for slope, (a, b) in zip(bell.slopes(bins, RMS, f0, width), ((h * width / f0, 0), (0, h))):
        up, down = (bell.binned(bins, RMS, f0 * np.exp(s * a), width * np.exp(s * b))
                    for s in (1, -1))
        scale = np.max(up) * (f0 / width if a else 1.0)
        np.testing.assert_allclose(slope, (up - down) / (2 * (a + b)), atol=1e-3 * scale)


@cases
def test_density_holds_the_variance(f0, width):
    f = np.linspace(0, 0.5 / DT, 20_001)
    total = np.trapezoid(bell.psd(f, RMS, f0, width, DT), f) if hasattr(np, 'trapezoid') else \
        np.trapz(bell.psd(f, RMS, f0, width, DT), f)
    assert total == pytest.approx(RMS**2, rel=1e-3)


def test_density_is_the_power_of_wide_bins():
    bins = spectrum.bins_of(50_000, DT)
    truth = spectrum.expected(lambda f: bell.psd(f, RMS, 5.0, 1.0, DT), bins)
    high = truth > 0.01 * truth.max()
    np.testing.assert_allclose(bell.binned(bins, RMS, 5.0, 1.0)[high], truth[high], rtol=0.02)


def test_samples_have_the_covariance():
    """Of 400 short records, each mean product of two samples within five of its errors."""
    rng, many, n = np.random.default_rng(5), 400, 300
    y = np.array([bell.sample(n, RMS, 4.0, 0.8, DT, rng) for _ in range(many)])
    c = covariance(4.0, 0.8)[:n, :n]
    error = np.sqrt((np.outer(np.diag(c), np.diag(c)) + c * c) / many)
    assert np.max(np.abs(y.T @ y / many - c) / error) < 5.5


def test_the_bell_is_that_of_a_frequency_that_wanders_slowly():
    """Woodward's theorem, on a line whose frequency follows a slow Gauss-Markov process."""
    rng, n, dt, f0, width = np.random.default_rng(3), 2**19, 0.01, 10.0, 0.5
    from scipy.signal import lfilter
    r = np.exp(-dt / 100.0)
    s = bell.PER_WIDTH * width
    drive = s * np.sqrt(1 - r * r) * rng.standard_normal((20, n))
    drive[:, 0] = s * rng.standard_normal(20)
    f = f0 + lfilter([1.0], [1.0, -r], drive)
    y = np.sqrt(2) * np.cos(2 * np.pi * np.cumsum(f, axis=1) * dt)
    bins = spectrum.bins_of(n, dt, tuple(np.arange(8.0, 12.0, 0.05)))
    power = np.mean([spectrum.power(spectrum.cosine_transform(x), dt, bins) for x in y], axis=0)
    near = np.abs(bins.f - f0) < 0.4
    assert power[near] == pytest.approx(bell.binned(bins, 1.0, f0, width)[near], rel=0.25)


def test_bins_with_edges_of_their_own_hold_what_their_coefficients_do():
    """Among wide ones there are some of one coefficient."""
    f0, width, n = 14.0, 1.0, 1200
    bins = spectrum.bins_of(n, DT, tuple(np.linspace(13.0, 15.0, 25)))
    assert np.any(np.diff(bins.count) < 0)
    basis = dct(np.eye(n), type=2, norm='ortho', axis=0)
    c = RMS**2 * toeplitz(bell.covariance(np.arange(n), f0, width, DT))
    truth = bins.mean(2 * DT * np.sum((basis @ c) * basis, axis=1))
    found = bell.binned(bins, RMS, f0, width)
    np.testing.assert_allclose(found, truth, atol=2e-3 * np.max(truth))


def test_allan_variance_is_nowhere_negative():
    m = np.unique(np.geomspace(1, 333_333, 25).astype(int))
    assert np.all(bell.avar(m, 1.0, 10.0, 2.2e-4, 0.01) >= 0)
