# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The statistics of fleets against dense algebra, closed forms, and drawn populations."""

from __future__ import annotations

from hypothesis import given, settings, strategies as st
import numpy as np
from params import seldom
import pytest
from scipy import stats

from imu_noise_tools.fleet import assemble, page
from imu_noise_tools.fleet.amplitude import deviance, of_limit, of_profile
from imu_noise_tools.fleet.findings import Population
from imu_noise_tools.fleet.population import (
    _beside, _least, _Likelihood, _Nested, called, fit, Sample, upper)


def sample(rng, units=20, axes=3, records=1, tau=0.1, omega=0.05, rho=0.0, s=0.02, limit=None,
           moved=()):
    """Return a drawn sample; ``moved`` are (unit, axis or None, by)."""
    unit = np.repeat(np.arange(units), axes * records)
    axis = np.tile(np.repeat(np.arange(axes), records), units)
    time = np.tile(np.arange(records) * 100.0, units * axes)
    y = (rng.normal(0, 1, units)[unit] * tau + rng.normal(0, 1, (units, axes))[unit, axis] * omega
         + rng.normal(0, 1, len(unit)) * np.hypot(rho, s))
    for u, a, by in moved:
        y[(unit == u) & ((axis == a) | (a is None))] += by
    limits = np.zeros(len(y), bool) if limit is None else limit(y)
    X = (axis[:, None] == np.arange(axes)).astype(float)
    return Sample(y, np.full(len(y), s), limits, unit, axis, X, time)


def dense(data, tau, omega, d):
    """Return V as a matrix."""
    unit = data.unit[:, None] == data.unit[None, :]
    return np.diag(d) + tau**2 * unit + omega**2 * (unit & (data.axis[:, None] == data.axis))


def test_nested_inverse_is_that_of_the_matrix():
    rng = np.random.default_rng(1)
    data = sample(rng, units=4, axes=3, records=2)
    d = rng.uniform(0.5, 2, len(data.y))
    V = dense(data, 0.7, 0.4, d)
    some = _Nested(data, _Likelihood(data).group, d, 0.7, 0.4)
    a = rng.normal(size=(len(d), 2))
    np.testing.assert_allclose(some.solve(a), np.linalg.solve(V, a), rtol=1e-10)
    np.testing.assert_allclose(some.diagonal(), np.diag(np.linalg.inv(V)), rtol=1e-10)
    assert some.logdet.sum() == pytest.approx(np.linalg.slogdet(V)[1])


def test_likelihood_is_the_dense_mixture():
    """Of each unit: normal with V, or with V and one direction wider."""
    rng = np.random.default_rng(2)
    data = sample(rng, units=5, axes=2, records=3, moved=[(2, None, 0.8)])
    some = _Likelihood(data)
    tau, omega, rho = 0.2, 0.1, 0.05
    found = some.at(np.log([tau, omega, rho]))
    V = dense(data, tau, omega, data.s**2 + rho**2)
    r, total = data.y - data.X @ found['beta'], 0.0
    for u in range(5):
        own = data.unit == u
        weights = [some.prior[0] * stats.multivariate_normal.pdf(r[own], cov=V[np.ix_(own, own)])]
        for k, direction in enumerate(some.D.T):
            wide = V[np.ix_(own, own)] + np.log(2) ** 2 * np.outer(direction[own], direction[own])
            weights.append(some.prior[k + 1] * stats.multivariate_normal.pdf(r[own], cov=wide))
        np.testing.assert_allclose(found['out'][u], np.array(weights) / np.sum(weights), rtol=1e-6)
        total += np.log(np.sum(weights))
    constant = 0.5 * len(r) * np.log(2 * np.pi)
    restricted = 0.5 * np.linalg.slogdet(found['A'])[1]
    assert found['value'] == pytest.approx(total + constant - restricted, rel=1e-6)


def test_without_a_spread_it_is_the_weighted_mean():
    """Records that agree within their errors, of very different precision."""
    y = np.array([0.02, -0.01, 0.004, 0.0, -0.03])
    s = np.array([0.05, 0.02, 0.01, 0.04, 0.08])
    data = Sample(y, s, np.zeros(5, bool), np.arange(5), np.zeros(5, int), np.ones((5, 1)))
    found = fit(data)
    w = 1 / s**2
    assert found.tau < 1e-3
    assert found.beta[0] == pytest.approx(np.sum(w * y) / w.sum(), abs=2e-4)
    assert found.cov[0, 0] == pytest.approx(1 / w.sum(), rel=0.02)


def test_equal_errors_give_the_textbook_interval():
    """Of one record a unit, measured well: mean and Student's t over the units."""
    rng = np.random.default_rng(4)
    y = rng.normal(0, 0.1, 7)
    data = Sample(y, np.full(7, 1e-3), np.zeros(7, bool), np.arange(7), np.zeros(7, int),
                  np.ones((7, 1)))
    found = fit(data)
    half = stats.t.ppf(0.975, 6) * np.std(y, ddof=1) / np.sqrt(7)
    assert found.interval(0) == pytest.approx((y.mean() - half, y.mean() + half), rel=0.05)


def test_too_few_units_show_a_value():
    """Upper limits alone make no population."""
    data = sample(np.random.default_rng(5), limit=lambda y: np.ones(len(y), bool))
    with pytest.raises(ValueError):
        fit(data)


def test_a_limit_far_above_says_nothing():
    rng = np.random.default_rng(6)
    plain = sample(rng, units=12)
    more = Sample(np.append(plain.y, 5.0), np.append(plain.s, 1.0), np.append(plain.limit, True),
                  np.append(plain.unit, 12), np.append(plain.axis, 0),
                  np.vstack([plain.X, plain.X[:1]]))
    a, b = fit(Sample(plain.y, plain.s, plain.limit, plain.unit, plain.axis, plain.X)), fit(more)
    np.testing.assert_allclose(a.beta, b.beta, atol=1e-3)
    assert b.tau == pytest.approx(a.tau, rel=0.05)


def test_what_is_not_normal_enters_as_its_integral():
    """Of a record in a unit of its own: its likelihood over the spread, by quadrature."""
    rng = np.random.default_rng(7)
    plain = sample(rng, units=6, axes=1, s=0.05)
    for said in ([0.2, 0.3, 30.0], [-0.5, 0.6, 8.0], [0.0, 0.5, 1e8], [60.0, 5.0, 300.0]):
        square = np.vstack([np.full((6, 3), np.nan), said])
        more = Sample(np.append(plain.y, -0.1), np.append(plain.s, 1.0),
                      np.append(plain.limit, True), np.append(plain.unit, 6),
                      np.append(plain.axis, 0), np.ones((7, 1)), square=square)
        some, x = _Likelihood(more), np.log([0.3])
        for _ in range(3):
            found = some.at(x)
        r = plain.y - found['beta'][0]
        v, ways = np.linspace(-6, 6, 200_001), [np.log(some.prior[0]), np.log(some.prior[1])]
        for k, wide in enumerate((0.0, np.log(2.0))):
            normal = stats.norm.pdf(v, found['beta'][0], np.hypot(0.3, wide))
            ways[k] += np.log(np.sum(normal * np.exp(-0.5 * deviance(np.exp(2 * v), *said)))
                              * (v[1] - v[0]))
        odds = [some.prior[k] * stats.norm.pdf(r, 0, np.hypot(np.hypot(0.3, wide), 0.05))
                for k, wide in enumerate((0.0, np.log(2.0)))]
        total = np.sum(np.log(np.sum(odds, axis=0))) + np.logaddexp(*ways)
        p = np.exp(ways[1] - np.logaddexp(*ways))
        assert found['out'][6, 1] == pytest.approx(p, abs=0.01), said
        constant = 0.5 * 6 * np.log(2 * np.pi)
        assert found['value'] + 0.5 * np.linalg.slogdet(found['A'])[1] == pytest.approx(
            total + constant, abs=0.02), said


@pytest.mark.thorough
def test_what_chance_shows_is_not_taken_as_it_is():
    """Half of the records show no value: the mean comes out, the shown ones alone are high."""
    means, naive, inside = [], [], 0
    for k in range(12):
        rng = np.random.default_rng([8, k])
        data, std = sample(rng, units=30, axes=1, tau=0.3, s=0.0), 0.6
        square = np.exp(2 * data.y) + rng.normal(0, std, 30)
        limit = square < 1.96 * std
        y = 0.5 * np.log(np.where(limit, np.maximum(square, 0) + 1.645 * std, square))
        said = np.column_stack([square, np.full((30, 2), [std, 1e8])])
        found = fit(Sample(y, np.full(30, 0.3), limit, data.unit, data.axis, data.X, square=said))
        means.append(found.beta[0])
        naive.append(y[~limit].mean())
        low, high = found.interval(0)
        inside += low < 0 < high
    assert abs(np.mean(means)) < 0.1 < 0.2 < np.mean(naive)
    assert inside >= 9          # of 12: less has a chance of 2e-4


@pytest.mark.parametrize('said', [(0.5, 0.3, 40.0), (-0.4, 0.5, 12.0), (0.0, 0.8, 1e8)])
def test_three_numbers_give_a_profile_back(said):
    """From where a search for the ends of an interval has looked."""
    value = np.sqrt(np.append(1e-6, np.linspace(0.1, 2.2, 9)))
    d = deviance(value**2, *said) - deviance(max(said[0], 0.0), *said)
    points = [(np.sqrt(max(said[0], 0)), 0.0), *zip(3e-5 * value / 3e-5, d)]
    found = of_profile([(3e-5 * v, d) for v, d in points])
    back = deviance(9e-10 * value**2, *found) - deviance(max(found[0], 0.0), *found)
    np.testing.assert_allclose(np.sqrt(back[d < 9]), np.sqrt(d[d < 9]), atol=0.1)
    assert of_profile(points[:3]) is None


def test_a_limit_is_one():
    """95 % of what it says lies below it."""
    mode, std, dof = of_limit(np.array([2.0]))
    p = np.linspace(0, 40, 400_001)
    density = np.exp(-0.5 * deviance(p, mode, std, dof))
    assert density[p < 4].sum() / density.sum() == pytest.approx(0.90, abs=0.001)


@pytest.mark.thorough
@settings(max_examples=8)
@given(st.integers(0, 10_000))
def test_order_does_not_matter(seed):
    rng = np.random.default_rng(seed)
    data = sample(rng, units=9, axes=2, records=2, moved=[(3, 1, 0.9)])
    names, order = rng.permutation(9), rng.permutation(len(data.y))
    other = Sample(data.y[order], data.s[order], data.limit[order], names[data.unit][order],
                   data.axis[order], data.X[order], data.time[order])
    a, b = fit(data), fit(other)
    np.testing.assert_allclose(a.beta, b.beta, atol=2e-4)
    np.testing.assert_allclose(a.p_out, b.p_out[names], atol=2e-2)


@pytest.mark.parametrize(('axis', 'name'), [(None, 'unit'), (1, 'axis 1')])
def test_a_bad_unit_does_not_hide_in_the_spread_it_makes(axis, name):
    rng = np.random.default_rng(9)
    found = fit(sample(rng, units=24, moved=[(5, axis, np.log(2.0))]))
    assert called(found.p_out).nonzero()[0].tolist() == [5]
    k = int(np.argmax(found.out[5, 1:]))
    assert found.names[k] == name
    assert abs(found.size[5, k] - np.log(2)) < 4 * found.size_std[5, k]
    assert found.tau < 0.16


FEW = {'units': 5, 'records': 2, 'tau': 0.0, 'omega': 0.06, 's': 0.0025}


@pytest.mark.parametrize('seed', [2, 12, *map(seldom, (3, 4, 5, 7))])
def test_a_bad_axis_does_not_hide_among_five_units(seed):
    """Half as much again: the likelihood has a maximum, too, with all of them in a wide spread."""
    found = fit(sample(np.random.default_rng([16, seed]), moved=[(1, 1, np.log(1.5))], **FEW))
    assert called(found.p_out).nonzero()[0].tolist() == [1]
    assert found.out[1, 1 + found.names.index('axis 1')] > 0.9
    assert 0.03 < np.hypot(found.tau, found.omega) < 0.09


def test_the_spread_is_that_of_one_axis_between_units():
    """Where each axis is its own, nothing is common to all axes of a unit."""
    data = sample(np.random.default_rng(19), **{**FEW, 'units': 12})
    said = Population('', 'gyro', 'N', ('gyro_x', 'gyro_y', 'gyro_z'), tuple('abcdefghijkl'), data,
                      (), fit(data), ()).plain()
    assert said['between'] == pytest.approx(6.2, rel=0.4) and said['between_units'] < 3
    terminal = assemble.text({'models': {'': {'gyro N': said}}, 'outlying': [], 'changes': [],
                              'failed': [], 'warned': []}, 'fleet')
    assert page.small(said['between']) in terminal and 'none seen' not in terminal


@pytest.mark.thorough
@pytest.mark.parametrize(('units', 'axes', 'records', 'tau', 'omega'), [
    (5, 3, 2, 0.0, 0.06), (5, 3, 1, 0.04, 0.02), (4, 1, 2, 0.05, 0.0), (8, 3, 1, 0.0, 0.05)])
def test_good_units_of_small_fleets_are_seldom_called(units, axes, records, tau, omega):
    """A fleet of six coefficients calls one that is not at FALSE, one coefficient at MASKED."""
    calls = 0
    for k in range(60):
        found = fit(sample(np.random.default_rng([17, units, axes, k]), units, axes, records, tau,
                           omega, s=0.0025))
        calls += bool(called(found.p_out).any())
    assert calls <= 4           # of 60 at 0.01: more has a chance of 4e-4


def test_the_deletion_residual_is_that_of_the_others_alone():
    """Of one record a unit: Student's t of one against the mean and scatter of the rest."""
    y = np.random.default_rng(18).normal(0, 0.1, 8)
    data = Sample(y, np.full(8, 1e-3), np.zeros(8, bool), np.arange(8), np.zeros(8, int),
                  np.ones((8, 1)))
    p, x = _beside(data, (np.arange(8) == 3).astype(float), np.log([0.1]))
    rest = np.delete(y, 3)
    t = (y[3] - rest.mean()) / (rest.std(ddof=1) * np.sqrt(1 + 1 / 7))
    assert p == pytest.approx(2 * stats.t.sf(abs(t), 6), rel=0.05)
    assert np.exp(x[0]) == pytest.approx(rest.std(ddof=1), rel=0.05)
    z = (y - y.mean()) / (y.std(ddof=1) * np.sqrt(7 / 8))       # and what one may be at the least
    far = abs(t) > stats.t.isf(0.05, 6)
    assert (z[3]**2 > _least(0.1, 7)) == far


def test_a_drifting_unit_is_told_from_one_that_is_off():
    rng = np.random.default_rng(10)
    data = sample(rng, units=20, records=3, rho=0.01)
    moving = data.unit == 7
    y = data.y + moving * 0.3 * data.time / 200
    found = fit(Sample(y, data.s, data.limit, data.unit, data.axis, data.X, data.time))
    assert called(found.p_out).nonzero()[0].tolist() == [7]
    k = found.names.index('drift')
    assert found.out[7, k + 1] > 0.9
    assert abs(found.size[7, k] - 0.3) < 4 * found.size_std[7, k]


def test_shrinking_is_by_weight():
    """What is measured well stays; what is not goes to the mean by tau^2/(tau^2 + s^2)."""
    rng = np.random.default_rng(11)
    n = 40
    s = np.where(np.arange(n) % 2, 0.3, 0.001)
    y = rng.normal(0, 0.1, n) + rng.normal(0, 1, n) * s
    found = fit(Sample(y, s, np.zeros(n, bool), np.arange(n), np.zeros(n, int), np.ones((n, 1))))
    sharp, blunt = np.arange(0, n, 2), np.arange(1, n, 2)
    np.testing.assert_allclose(found.level[sharp], y[sharp], atol=1e-3)
    weight = found.tau**2 / (found.tau**2 + 0.09)
    regular = blunt[found.p_out[blunt] < 0.05]
    expected = found.beta[0] + weight * (y[regular] - found.beta[0])
    np.testing.assert_allclose(found.level[regular], expected, atol=0.02)


def test_called_keeps_the_false_ones_few():
    p = np.array([0.99, 0.2, 0.97, 0.93, 0.5])
    assert called(p).tolist() == [True, False, True, True, False]
    assert not called(np.array([0.9])).any() and called(np.zeros(0)).size == 0


def test_the_bound_is_the_quantile_of_the_worst_axis():
    """Of many units, so that nothing is left open: against the drawn quantile."""
    rng = np.random.default_rng(12)
    found = fit(sample(rng, units=400, s=0.001))
    new = rng.normal(0, 0.1, 200_000)[:, None] + rng.normal(0, 0.05, (200_000, 3))
    drawn = np.quantile(new.max(axis=1), 0.95)
    assert upper(found, range(3)) == pytest.approx(drawn, abs=0.02)


@pytest.mark.thorough
@pytest.mark.parametrize('units', [4, 8])
def test_the_interval_of_a_change_covers_in_small_fleets(units):
    inside = 0
    for k in range(200):
        rng = np.random.default_rng([13, units, k])
        data = sample(rng, units=units)
        new = (data.unit % 2).astype(float)
        found = fit(Sample(data.y + 0.1 * new, data.s, data.limit, data.unit, data.axis,
                           np.column_stack([data.X, new])))
        low, high = found.interval(3)
        inside += low <= 0.1 <= high
    assert 0.90 <= inside / 200 <= 0.99         # binomial, 99.9 % about 95 %
