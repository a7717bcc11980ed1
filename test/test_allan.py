# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Allan deviations against brute force, published numbers and independent software."""

from __future__ import annotations

import allantools
from hypothesis import given, settings, strategies as st
import numpy as np
import pytest

from imu_noise_tools.core import allan
from imu_noise_tools.core.errors import InputError, UsageError

# The data of NIST Special Publication 1065, tables 29-31 (Riley 2008).
NBS14 = np.array([892.0, 809, 823, 798, 671, 644, 883, 903, 677])
NBS14_PUBLISHED = {
    'adev': (91.22945, 115.8082), 'oadev': (91.22945, 85.95287), 'mdev': (91.22945, 74.78849),
    'hdev': (70.80607, 116.7980), 'totdev': (91.22945, 93.90379)}
NBS1000_PUBLISHED = {
    'adev': (2.922319e-1, 9.965736e-2, 3.897804e-2),
    'oadev': (2.922319e-1, 9.159953e-2, 3.241343e-2),
    'mdev': (2.922319e-1, 6.172376e-2, 2.170921e-2),
    'hdev': (2.943883e-1, 1.052754e-1, 3.910860e-2),
    'totdev': (2.922319e-1, 9.134743e-2, 3.406530e-2)}


def nbs1000() -> np.ndarray:
    """Return NIST's 1000-point suite: a multiplicative congruential generator, on (0, 1)."""
    n, out = 1234567890, []
    for _ in range(1000):
        out.append(n / 2147483647)
        n = 16807 * n % 2147483647
    return np.array(out)


@pytest.fixture(scope='module')
def seed_example() -> np.ndarray:
    """Return the tutorial's example: unit white noise on a ramp of 1e-5 a sample."""
    n = 100_000
    return np.random.default_rng(20).standard_normal(n) + 1e-5 * np.arange(1, n + 1)


def brute_overlapping(y, m) -> float:
    """Return the variance by the definition: every pair of neighbouring cluster means, summed."""
    y = np.asarray(y, np.longdouble)
    total, count = np.longdouble(0), len(y) - 2 * m + 1
    left, right = np.sum(y[:m]), np.sum(y[m:2 * m])
    for j in range(count):
        total += (right - left) ** 2
        if j + 2 * m < len(y):
            left += y[j + m] - y[j]
            right += y[j + 2 * m] - y[j + m]
    return float(total / (2 * np.longdouble(m) ** 2 * count))


def brute_standard(y, m) -> float:
    """Return half the mean squared difference of the means of whole clusters, side by side."""
    y = np.asarray(y, np.longdouble)
    means = [np.mean(y[j * m:(j + 1) * m]) for j in range(len(y) // m)]
    return float(sum((b - a) ** 2 for a, b in zip(means, means[1:])) / (2 * (len(means) - 1)))


def test_seed_example_at_every_octave(seed_example):
    over = allan.curve(seed_example, 0.1, octaves=True)
    side = allan.curve(seed_example, 0.1, deviation='adev', octaves=True)
    assert over.m.tolist() == side.m.tolist() == [2 ** k for k in range(16)]
    np.testing.assert_allclose(over.tau, 0.1 * 2.0 ** np.arange(16), rtol=1e-15)
    np.testing.assert_array_equal(over.count, len(seed_example) - 2 * over.m + 1)
    some = over.m[::3]                                        # the loop takes 0.3 s an octave
    brute = [brute_overlapping(seed_example, m) for m in some.tolist()]
    np.testing.assert_allclose(over.dev[::3] ** 2, brute, rtol=1e-12)
    brute = [brute_standard(seed_example, m) for m in side.m.tolist()]
    np.testing.assert_allclose(side.dev ** 2, brute, rtol=1e-12)


def test_seed_example_against_prefix_sums_in_extended_precision(seed_example):
    m = allan.cluster_sizes(len(seed_example), octaves=True)
    x = np.concatenate([[0], np.cumsum(seed_example.astype(np.longdouble))])
    exact = [float(np.mean((x[2 * k:] - 2 * x[k:-k] + x[:-2 * k]) ** 2) / (2.0 * k * k))
             for k in m.tolist()]
    np.testing.assert_allclose(allan.overlapping_variance(seed_example, m), exact, rtol=1e-12)


@pytest.mark.parametrize('deviation', ['oadev', 'adev'])
def test_equal_to_allantools(seed_example, deviation):
    curve = allan.curve(seed_example, 0.1, deviation=deviation)
    assert 80 <= len(curve.m) <= 100 and curve.m[-1] == len(seed_example) // 3
    tau, dev, _, count = getattr(allantools, deviation)(
        seed_example - seed_example.mean(), rate=10.0, data_type='freq', taus=curve.tau)
    np.testing.assert_allclose(curve.tau, tau, rtol=1e-12)
    np.testing.assert_allclose(curve.dev, dev, rtol=1e-12)
    if deviation == 'oadev':
        np.testing.assert_array_equal(curve.count, count)


@pytest.mark.parametrize('deviation', allan.DEVIATIONS)
def test_numbers_published_by_nist(deviation):
    y = NBS14
    small = allan.curve(y, 1.0, deviation=deviation)
    for m, published in zip((1, 2), NBS14_PUBLISHED[deviation]):
        assert small.dev[small.m == m][0] == pytest.approx(published, rel=1e-6)
    y = nbs1000()
    assert np.mean(y) == pytest.approx(4.897745e-1, abs=5e-8)            # published with the data
    large = allan.curve(y, 1.0, deviation=deviation, points=10_000)
    for m, published in zip((1, 10, 100), NBS1000_PUBLISHED[deviation]):
        assert large.dev[large.m == m][0] == pytest.approx(published, rel=1e-6)


@pytest.mark.parametrize('deviation', ['mdev', 'hdev', 'totdev'])
def test_other_deviations_keep_grid_and_units(deviation):
    y = np.random.default_rng(3).standard_normal(3000)
    curve = allan.curve(y, 0.01, deviation=deviation, points=30)
    assert curve.deviation == deviation and np.all(np.diff(curve.m) > 0)
    np.testing.assert_allclose(curve.tau, curve.m / 100, rtol=1e-14)
    tau, dev, _, _ = getattr(allantools, deviation)(y, rate=100.0, data_type='freq',
                                                    taus=curve.tau)
    np.testing.assert_allclose(curve.dev, dev, rtol=1e-9)
    assert np.all((curve.lo < curve.dev) & (curve.dev < curve.hi))


records = st.tuples(st.integers(12, 400), st.integers(0, 2 ** 32 - 1)).map(
    lambda a: np.random.default_rng(a[1]).standard_normal(a[0]))


@settings(max_examples=50)
@given(records, st.floats(1e-9, 1e9), st.sampled_from([-1, 1]),
       st.sampled_from(['oadev', 'adev']))
def test_scales_with_the_data(y, size, sign, deviation):
    one, other = (allan.curve(v, 0.1, deviation=deviation) for v in (y, sign * size * y))
    np.testing.assert_allclose(other.dev, size * one.dev, rtol=1e-9)
    np.testing.assert_allclose(other.hi, size * one.hi, rtol=1e-6)


@settings(max_examples=50)
@given(records, st.floats(-1e3, 1e3), st.sampled_from(['oadev', 'adev']))
def test_blind_to_a_constant(y, offset, deviation):
    one, other = (allan.curve(v, 0.1, deviation=deviation) for v in (y, y + offset))
    np.testing.assert_allclose(other.dev, one.dev, rtol=1e-8)


@settings(max_examples=50)
@given(records)
def test_blind_to_the_direction_of_time(y):
    m = allan.cluster_sizes(len(y))
    forward, backward = (allan.overlapping_variance(v, m) for v in (y, y[::-1]))
    np.testing.assert_allclose(forward, backward, rtol=1e-9)


@settings(max_examples=30)
@given(records, st.floats(1e-4, 10))
def test_time_scale_moves_tau_alone(y, dt):
    one, other = allan.curve(y, 1.0), allan.curve(y, dt)
    np.testing.assert_array_equal(one.dev, other.dev)
    np.testing.assert_allclose(other.tau, dt * one.tau, rtol=1e-14)


def test_a_ramp_is_exact():
    """sigma(tau) = R tau/sqrt 2 (IEEE 952 C.1.6), with no noise at all."""
    curve = allan.curve(3e-4 * 0.02 * np.arange(5000), 0.02)
    np.testing.assert_allclose(curve.dev, 3e-4 * curve.tau / np.sqrt(2), rtol=1e-9)


def test_a_large_offset_costs_no_digits():
    """A vertical accelerometer reads 9.8 with noise of 1e-3."""
    y = 1e-3 * np.random.default_rng(5).standard_normal(50_000)
    m = allan.cluster_sizes(len(y))
    np.testing.assert_allclose(allan.overlapping_variance(y + 9.80665, m),
                               allan.overlapping_variance(y, m), rtol=1e-8)


def test_blocks_join_without_a_seam():
    """Records longer than one pass give what one pass gives."""
    y = np.random.default_rng(6).standard_normal(150_000)
    x = np.concatenate([[0.0], np.cumsum(y - y.mean())])
    m = np.array([1, 7, 4096, 65_536 // 2, 49_999])
    direct = [np.mean((x[2 * k:] - 2 * x[k:-k] + x[:-2 * k]) ** 2) / (2.0 * k * k) for k in m]
    np.testing.assert_allclose(allan.overlapping_variance(y, m), direct, rtol=1e-11)


def test_percentage_error_is_the_classic_one():
    curve = allan.curve(np.random.default_rng(7).standard_normal(1000), 1.0, octaves=True)
    assert curve.percent_error[0] == pytest.approx(100 / np.sqrt(2 * 999))
    assert curve.percent_error[3] == pytest.approx(100 / np.sqrt(2 * (1000 / 8 - 1)))


# --- confidence --------------------------------------------------------------------------------

LAWS = {2: -1.0, 0: -0.5, -1: 0.0, -2: 0.5}      # power law of frequency: slope of the curve


@pytest.mark.parametrize('alpha', LAWS)
def test_degrees_of_freedom_of_a_power_law(alpha):
    """Against the exact sums of Greenhall and Riley (2003) for a second difference of phase."""
    n = 2048
    m = 2 ** np.arange(9)
    edf = allan.equivalent_freedom(m ** LAWS[alpha], m, n)
    greenhall = np.array([allantools.edf_greenhall(alpha, 2, int(k), n + 1, overlapping=True)
                          for k in m])
    # SP 1065's simple forms are good to a few per cent, but for red noise at the shortest tau,
    # where there are degrees of freedom in plenty
    np.testing.assert_allclose(edf[2:], greenhall[2:], rtol=0.15)
    np.testing.assert_allclose(edf[:2], greenhall[:2], rtol=0.35)
    if alpha != -1:                               # allantools drops a square that SP 1065 has
        simple = np.array([allantools.edf_simple(n + 1, int(k), alpha) for k in m])
        np.testing.assert_allclose(edf, simple, rtol=1e-9)


@pytest.mark.parametrize('alpha', LAWS)
def test_degrees_of_freedom_side_by_side(alpha):
    n = 2048
    m = 2 ** np.arange(9)
    edf = allan.equivalent_freedom(m ** LAWS[alpha], m, n, overlapping=False)
    greenhall = np.array([allantools.edf_greenhall(alpha, 2, int(k), n + 1, overlapping=False)
                          for k in m])
    np.testing.assert_allclose(edf[1:], greenhall[1:], rtol=0.2)


@pytest.mark.parametrize('deviation', ['oadev', 'adev'])
@pytest.mark.parametrize('octaves', [True, False])
def test_intervals_cover_on_white_noise(deviation, octaves):
    """About 95 of 100 intervals hold the truth, N/sqrt(tau), up to a third of the record."""
    rng, inside = np.random.default_rng(8), []
    for _ in range(400):
        curve = allan.curve(rng.standard_normal(2048), 1.0, deviation=deviation, octaves=octaves)
        truth = 1 / np.sqrt(curve.m)
        inside.append((curve.lo <= truth) & (truth <= curve.hi))
    cover, long_end = np.mean(inside, axis=0), curve.m > 100
    # one share of 400 scatters by 1.1 per cent; at the long end the power law is read from the
    # curve itself, and intervals are a little too wide rather than too narrow
    assert 0.93 < np.mean(cover[~long_end]) < 0.97
    assert 0.93 < np.mean(cover[long_end]) < 0.99
    assert np.all(cover > 0.89)


def test_interval_is_chi_squared():
    lo, hi = allan.interval(np.array([1.0]), np.array([10.0]))
    assert lo[0] == pytest.approx(np.sqrt(10 / 20.48318), rel=1e-6)      # tables of chi-squared
    assert hi[0] == pytest.approx(np.sqrt(10 / 3.246973), rel=1e-6)


# --- grid and errors ---------------------------------------------------------------------------

@settings(max_examples=100)
@given(st.integers(9, 10 ** 7), st.integers(2, 300), st.booleans())
def test_grid(n, points, octaves):
    m = allan.cluster_sizes(n, points, octaves)
    assert m[0] == 1 and m[-1] <= n // 3 and np.all(np.diff(m) > 0)
    assert m.dtype.kind == 'i' and len(m) <= max(points, 24)
    if not octaves:
        assert m[-1] == n // 3


@pytest.mark.parametrize('n', [0, 3, 8])
def test_too_short(n):
    with pytest.raises(InputError, match='too few') as error:
        allan.curve(np.zeros(n), 0.01)
    assert error.value.remedy


def test_unknown_deviation():
    with pytest.raises(UsageError, match='unknown deviation median') as error:
        allan.curve(np.arange(100.0), 0.01, deviation='median')
    assert 'oadev' in error.value.remedy


# --- words -------------------------------------------------------------------------------------

def _drawn(variance) -> allan.AllanCurve:
    """Return a curve of 3 h at 100 Hz that follows a variance of tau exactly."""
    n, dt = 1_080_000, 0.01
    m = allan.cluster_sizes(n)
    dev = np.sqrt(variance(m * dt))
    edf = allan.equivalent_freedom(dev, m, n)
    return allan.AllanCurve('oadev', dt, n, m, n - 2 * m + 1, dev, *allan.interval(dev, edf), edf)


@pytest.mark.parametrize(('variance', 'word'), [
    (lambda t: 1 / t + 0.02 + 1e-5 * t, 'MEMS'),
    (lambda t: 1 / t + 1e-3 + 1e-9 * t, 'fibre-optic'),
    (lambda t: 1 / t ** 2 + 1e-9, 'ring-laser'),
    (lambda t: 1 / t, 'white noise over the whole curve'),
])
def test_shape_in_words(variance, word):
    assert word in allan.dominant_shape(_drawn(variance))
