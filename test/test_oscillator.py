# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The damped oscillator: every closed form against the covariance matrix of a short record."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.fft import dct
from scipy.linalg import solve_discrete_lyapunov, toeplitz

from imu_noise_tools.core import oscillator, spectrum

N, DT, RMS = 600, 0.02, 2.0
cases = pytest.mark.parametrize(('f0', 'width', 'form'), [
    *((f0, width, 'displacement') for f0, width in (
        (4.0, 0.4), (4.02, 0.05), (4.02, 0.5 / (N * DT)), (12.0, 3.0), (1.0, 0.3))),
    *((f0, width, form) for f0, width in ((4.0, 0.4), (21.0, 3.0), (4.02, 0.05))
      for form in ('velocity', 'folded'))])


def covariance(f0, width, form):
    """Return the covariance (n, n) of the recursion, from its state's stationary covariance."""
    r, theta = np.exp(-np.pi * width * DT), 2 * np.pi * f0 * DT
    if form == 'folded':
        return toeplitz(RMS**2 * r ** np.arange(N) * np.cos(theta * np.arange(N)))
    phi = np.array([[2 * r * np.cos(theta), -r * r], [1.0, 0.0]])
    q = np.diag([oscillator.innovation_variance(RMS, f0, width, DT, form), 0.0])
    state, lags = solve_discrete_lyapunov(phi, q), []
    for _ in range(N + 2):
        lags.append(state[0, 0])
        state = phi @ state
    x = np.array(lags)
    if form == 'velocity':
        k = np.arange(N)
        return toeplitz(2 * x[:N] - x[np.abs(k - 2)] - x[k + 2])
    return toeplitz(x[:N])


@cases
def test_variance(f0, width, form):
    assert covariance(f0, width, form)[0, 0] == pytest.approx(RMS**2, rel=1e-9)


@cases
def test_power_in_bins_is_that_of_the_finite_record(f0, width, form):
    basis = dct(np.eye(N), type=2, norm='ortho', axis=0)
    power = 2 * DT * np.sum((basis @ covariance(f0, width, form)) * basis, axis=1)
    bins = spectrum.bins_of(N, DT, (11.9, 12.4))
    found, truth = oscillator.binned(bins, RMS, f0, width, form), bins.mean(power)
    alone, atol = bins.count == 1, 1e-3 * np.max(truth) * (form == 'velocity')  # has zeros
    np.testing.assert_allclose(found[alone], truth[alone], rtol=1e-9, atol=1e-9 * np.max(truth))
    # what alternates between neighbours is left out: the last of an odd number is missing
    np.testing.assert_allclose(found[~alone], truth[~alone], rtol=2e-3, atol=atol)
    assert np.sum(found * bins.count) == pytest.approx(2 * DT * N * RMS**2, rel=0.05)


@cases
def test_allan_variance(f0, width, form):
    c = covariance(f0, width, form)
    for m in (1, 2, 5, 20, 100):
        weight = np.repeat([-1.0, 1.0], m) / m
        truth = 0.5 * weight @ c[:2 * m, :2 * m] @ weight
        assert oscillator.avar(m, RMS, f0, width, DT, form) == pytest.approx(truth, rel=1e-9)


@cases
def test_slopes_are_those_of_the_power(f0, width, form):
    bins, h = spectrum.bins_of(N, DT), 1e-5
    for slope, (a, b) in zip(oscillator.slopes(bins, RMS, f0, width, form), ((h, 0), (0, h))):
        up, down = (oscillator.binned(bins, RMS, f0 * np.exp(s * a), width * np.exp(s * b),
                                      form) for s in (1, -1))
        np.testing.assert_allclose(slope, (up - down) / (2 * h), atol=1e-3 * np.max(up))


def test_density_is_the_power_of_wide_bins():
    bins = spectrum.bins_of(50_000, DT)
    np.testing.assert_allclose(
        oscillator.binned(bins, RMS, 5.0, 1.0),
        spectrum.expected(lambda f: oscillator.psd(f, RMS, 5.0, 1.0, DT), bins), rtol=0.02)


def test_bins_are_finer_where_that_is_asked_for():
    plain, fine = (spectrum.bins_of(50_000, DT, f) for f in ((), (5.001, 5.002, 5.003, 900.0)))
    assert len(fine.first) == len(plain.first) + 3 and fine.count.sum() == plain.count.sum()
    assert set(plain.first) < set(fine.first)
    white = spectrum.expected(lambda f: np.ones(len(f)), fine)
    np.testing.assert_allclose(white, 1.0, rtol=1e-9)


def test_what_rings_above_half_the_rate_is_folded():
    """A ring of 1 kHz, its noise exact at every 1/50 s, is what the folded form says."""
    f0, width, n = 1004.0, 2.0, 400
    t = np.arange(n) * DT
    sampled = toeplitz(np.exp(-np.pi * width * t) * (
        np.cos(2 * np.pi * f0 * t) + width / (2 * f0) * np.sin(2 * np.pi * f0 * t)))
    for m in (1, 2, 5, 20, 100):
        weight = np.repeat([-1.0, 1.0], m) / m
        truth = 0.5 * weight @ sampled[:2 * m, :2 * m] @ weight
        assert oscillator.avar(m, 1.0, 4.0, width, DT, 'folded') == pytest.approx(truth, rel=0.01)
