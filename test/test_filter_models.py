# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The filter's blocks and recursions against identities and independent oracles."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import linalg, stats

from imu_noise_tools.core import gauss_markov
from imu_noise_tools.core.errors import UsageError
from imu_noise_tools.core.units import DEG
from imu_noise_tools.filter import kalman
from imu_noise_tools.filter.chunks import Chunks, settle_of
from imu_noise_tools.filter.imm import Bank, Coefficients, log_density
from imu_noise_tools.filter.modes import default_modes, Modes, modes_of
from imu_noise_tools.filter.motion import (
    AngularAcceleration,
    AnyMotion,
    ArIncrement,
    ConstantRate,
    Harmonic,
    Jerk,
    Law,
    RateStep,
    Singer,
    StopAndGo,
)
from imu_noise_tools.filter.output_noise import (
    gauss_markov_terms,
    GaussMarkov,
    noise_blocks,
    NoiseLevel,
    Outliers,
    RandomWalk,
    Sinusoid,
    White,
)
from imu_noise_tools.filter.predict import predict
from imu_noise_tools.filter.statespace import DOMAIN, state_space
from imu_noise_tools.loop.effect import find_effect, Model, Parameter, registry
from imu_noise_tools.noise.kinds import Spectrum

WHITE = White({'R': 0.36 * DEG ** 2})
SEED = ConstantRate() + ArIncrement.example() + WHITE
LINEAR = {
    'seed': SEED,
    'acceleration': ConstantRate() + AngularAcceleration.example() + WHITE,
    'jerk': Jerk.example() + WHITE,
    'singer': Singer.example() + GaussMarkov.example() + WHITE,
    'sway': ConstantRate() + ArIncrement.example() + Harmonic.example() + WHITE,
    'line': ConstantRate() + ArIncrement.example() + WHITE + Sinusoid.example(),
    'level': ConstantRate() + ArIncrement.example() + WHITE + NoiseLevel({'factor': 3.0}),
}


def linear(effect):
    return effect.name not in ('rate_step', 'outliers', 'noise_level', 'white')


@pytest.mark.parametrize('name', sorted(registry(DOMAIN)))
def test_every_effect_has_a_block_and_says_what_it_is(name):
    effect = registry(DOMAIN)[name].example()
    block = effect.block(0.01)
    assert (
        effect.kind in ('motion', 'noise')
        and effect.title
        and effect.hint
        and effect.signature
        and effect.equation
    )
    assert block.phi.shape == block.q.shape == block.p0.shape == (len(block.h),) * 2
    for m in (block.q, block.p0):
        assert np.allclose(m, m.T) and np.all(
            np.linalg.eigvalsh(m) >= -1e-15 * (np.abs(m).max() if m.size else 0)
        )
    again = type(effect)(dict(effect.values))
    assert again == effect


@pytest.mark.parametrize(
    'effect',
    [
        AngularAcceleration.example(),
        Jerk.example(),
        Singer.example(),
        Harmonic.example(),
        GaussMarkov.example(),
        Sinusoid.example(),
        RandomWalk.example(),
    ],
    ids=lambda e: e.name,
)
@pytest.mark.parametrize('dt', [1e-3, 0.01, 0.3])
def test_two_steps_are_one_of_twice_the_length(effect, dt):
    one, two = effect.block(dt), effect.block(2 * dt)
    assert np.allclose(one.phi @ one.phi, two.phi, rtol=1e-9, atol=1e-14)
    assert np.allclose(
        one.phi @ one.q @ one.phi.T + one.q, two.q, rtol=1e-6, atol=1e-9 * np.abs(two.q).max()
    )


@pytest.mark.parametrize(
    'effect', [GaussMarkov.example(), Sinusoid.example(), Harmonic.example()], ids=lambda e: e.name
)
def test_stationary_blocks_solve_lyapunov(effect):
    b = effect.block(0.01)
    assert np.allclose(
        linalg.solve_discrete_lyapunov(b.phi, b.q), b.p0, rtol=1e-6, atol=1e-12 * b.p0.max()
    )


def test_singer_series_meets_its_closed_form():
    sigma, tc = 1.0, 1.0
    for dt in (0.9e-3, 1.1e-3):
        x = dt / tc
        q = Singer({'sigma': sigma, 'tc': tc}).block(dt).q[0, 0]
        assert q == pytest.approx(2 * x ** 3 / 3 - x ** 4 / 2 + 7 * x ** 5 / 30, rel=1e-5)


def test_noise_blocks_add_block_diagonally_and_integrators_are_shared():
    space = state_space(
        ConstantRate()
        + ArIncrement.example()
        + AngularAcceleration.example()
        + GaussMarkov.example()
        + WHITE,
        0.01,
    )
    assert space.size == 4                           # rate, increment, acceleration; colour
    assert space.rate.tolist() == [1, 0, 0, 0] and space.h.tolist() == [1, 0, 0, 1]
    assert space.phi[0].tolist() == [1, 1, 0.01, 0]
    assert not space.phi[:3, 3].any() and not space.phi[3, :3].any()
    q = AngularAcceleration.example().block(0.01).q
    assert space.q[0, 0] == pytest.approx(q[0, 0]) and space.q[0, 2] == pytest.approx(q[0, 1])


def test_shared_integrator_says_the_same_as_two_side_by_side():
    a, b = ArIncrement.example().block(0.01), AngularAcceleration.example().block(0.01)
    shared = state_space(ArIncrement.example() + AngularAcceleration.example() + WHITE, 0.01)
    n = 60
    dense = output_covariance(
        linalg.block_diag(a.phi, b.phi),
        linalg.block_diag(a.q, b.q),
        np.r_[a.h, b.h],
        np.zeros((4, 4)),
        n,
    )
    assert np.allclose(
        output_covariance(shared.phi, shared.q, shared.h, np.zeros((3, 3)), n), dense, rtol=1e-9
    )


def output_covariance(phi, q, h, p0, n):
    """Return cov(z_i, z_j) of h x, (n, n), by brute force."""
    p, ps = p0, []
    for k in range(n):
        p = p if k == 0 else phi @ p @ phi.T + q
        ps.append(p)
    out = np.empty((n, n))
    for i in range(n):
        forward = ps[i]
        for j in range(i, n):
            out[i, j] = out[j, i] = h @ forward @ h
            forward = phi @ forward
    return out


def run(space, z):
    """Filter samples z (n,) of which nothing is known before."""
    return kalman.resume(space, z, np.zeros(space.size), space.p0, 1.0,
                         kalman.steady_state(space))


@pytest.mark.parametrize('model', [SEED, LINEAR['singer'], LINEAR['line'], LINEAR['level']],
                         ids=['seed', 'singer', 'line', 'level'])
def test_likelihood_of_innovations_is_the_multivariate_normal(model):
    space = state_space(model, 0.01)
    # a proper prior, so that the joint density is one
    p0 = np.minimum(space.p0, 0.01)
    space = type(space)(**{**space.__dict__, 'p0': 0.5 * (p0 + p0.T) * np.eye(space.size)})
    n = 40
    z = np.random.default_rng(1).standard_normal(n) * 0.02
    got = run(space, z)
    covariance = output_covariance(space.phi, space.q, space.h, space.p0, n) + space.r * np.eye(n)
    assert kalman.log_likelihood(got.innovations, got.s) == pytest.approx(
        stats.multivariate_normal(np.zeros(n), covariance).logpdf(z), rel=1e-9)


@pytest.mark.parametrize('alpha', [1.0, 0.9, 0.6])
@pytest.mark.parametrize('name', sorted(LINEAR))
def test_steady_state_solves_the_riccati_equation(name, alpha):
    space = state_space(LINEAR[name], 0.01)
    steady = kalman.steady_state(space, alpha)
    oracle = linalg.solve_discrete_are(
        space.phi.T / np.sqrt(alpha), space.h[:, None], space.q, [[space.r]]
    )
    assert np.allclose(steady.predicted, oracle, rtol=1e-6, atol=1e-9 * np.abs(oracle).max())


@pytest.mark.parametrize('name', sorted(LINEAR))
def test_steady_state_is_where_the_recursion_ends(name):
    space = state_space(LINEAR[name], 0.01)
    z = 0.01 * np.random.default_rng(2).standard_normal(3000)
    got = run(space, z)
    x, p, slow = np.zeros(space.size), space.p0, []
    for k in range(len(z)):
        if k:
            x, p = kalman.predict(space, x, p)
        x, p, _, _ = kalman.update(space, x, p, z[k])
        slow.append(space.rate @ x)
    assert np.allclose(got.rate, slow, atol=1e-7 * np.std(slow))
    assert got.variance[-1] == pytest.approx(space.rate @ p @ space.rate, rel=1e-4)


def test_what_nothing_drives_has_no_steady_state():
    assert kalman.steady_state(state_space(ConstantRate() + WHITE, 0.01)) is None
    assert (
        kalman.steady_state(state_space(ConstantRate() + GaussMarkov.example() + WHITE, 0.01))
        is None
    )
    z = np.random.default_rng(3).standard_normal(500) + 7
    got = run(state_space(ConstantRate() + WHITE, 0.01), z)
    assert got.rate[-1] == pytest.approx(
        z.mean(), rel=1e-6
    )  # a constant's best estimate is the mean
    assert got.variance[-1] == pytest.approx(WHITE['R'] / 500, rel=1e-6)


@pytest.mark.parametrize('alpha', [1.0, 0.7])
@pytest.mark.parametrize('name', sorted(LINEAR))
def test_the_bank_of_one_is_the_dense_filter(name, alpha):
    model = LINEAR[name]
    space = state_space(model, 0.01)
    bank = Bank(Coefficients([modes_of([model], 0.01)], alpha), 1)
    z = 0.01 * np.random.default_rng(4).standard_normal(200)
    e = bank.table.at(0)
    x, p = np.zeros(space.size), space.p0
    for k in range(len(z)):
        nu, s, log_l = bank.step(z[k:k + 1], e if k else None)
        if k:
            x, p = kalman.predict(space, x, p, alpha)
        x, p, nu0, s0 = kalman.update(space, x, p, z[k])
        # the bank subtracts where the dense filter is in Joseph form: what the diffuse start costs
        # in digits
        assert nu[0, 0] == pytest.approx(nu0, abs=1e-8) and s[0, 0] == pytest.approx(s0, rel=1e-5)
        assert log_l[0] == pytest.approx(-0.5 * (nu0 ** 2 / s0 + np.log(s0)), rel=1e-5)
        rate, variance = bank.rate()
        assert rate[0] == pytest.approx(space.rate @ x, abs=1e-8)
        assert variance[0] == pytest.approx(space.rate @ p @ space.rate, rel=1e-4)


@pytest.mark.thorough
def test_the_bank_is_the_textbook_interacting_multiple_model_filter():
    noise = [WHITE + GaussMarkov.example()]
    modes = default_modes(noise, 0.01)
    bank = Bank(Coefficients([modes]), 1)
    spaces = modes.spaces[0]
    m, z = len(spaces), 0.05 * np.cumsum(np.random.default_rng(5).standard_normal(80))
    change = (1 - modes.stay) * np.tile(modes.prior, (m, 1)) + modes.stay * np.eye(m)
    assert np.allclose(change.sum(1), 1)
    mu = modes.prior.copy()
    xs, ps = [np.zeros(s.size) for s in spaces], [s.p0 for s in spaces]
    for k in range(len(z)):
        if k:
            c = mu @ change
            w = change * mu[:, None] / c
            mixed = [sum(w[i, j] * xs[i] for i in range(m)) for j in range(m)]
            ps = [
                sum(
                    w[i, j] * (ps[i] + np.outer(xs[i] - mixed[j], xs[i] - mixed[j]))
                    for i in range(m)
                )
                for j in range(m)
            ]
            xs, ps = zip(*(kalman.predict(s, x, p) for s, x, p in zip(spaces, mixed, ps)))
            mu = c
        got = [kalman.update(s, x, p, z[k]) for s, x, p in zip(spaces, xs, ps)]
        xs, ps = [g[0] for g in got], [g[1] for g in got]
        likelihood = np.array([stats.norm(0, np.sqrt(g[3])).pdf(g[2]) for g in got])
        mu = mu * likelihood / (mu @ likelihood)
        bank.step(z[k:k + 1], bank.table.at(0) if k else None)
        rate, variance = bank.rate()
        each = np.array([s.rate @ x for s, x in zip(spaces, xs)])
        assert rate[0] == pytest.approx(mu @ each, rel=1e-6, abs=1e-12)
        assert np.allclose(bank.mu[:, 0], mu, atol=1e-6)
        spread = (
            np.array([s.rate @ p @ s.rate for s, p in zip(spaces, ps)]) + (each - mu @ each) ** 2
        )
        assert variance[0] == pytest.approx(mu @ spread, rel=1e-4)


def test_weighing_outliers_keeps_two_moments_of_the_mixture():
    model = ConstantRate() + ArIncrement.example() + WHITE + Outliers.example()
    space = state_space(model, 0.01)
    bank = Bank(Coefficients([modes_of([model], 0.01)]), 1)
    for z in (0.01, 0.012, 0.3):
        e = bank.table.at(0)
        bank.mix(e)
        bank.predict(e)
        x = np.array([v[0, 0] for v in bank.x])
        p = np.array([[bank.p[min(i, j), max(i, j)][0, 0] for j in range(2)] for i in range(2)])
        fraction, factor = space.outliers
        parts = []
        for w, r in ((1 - fraction, space.r), (fraction, space.r * factor)):
            one = type(space)(**{**space.__dict__, 'r': r})
            xa, pa, nu, s = kalman.update(one, x, p, z)
            parts.append((w * stats.norm(0, np.sqrt(s)).pdf(nu), xa, pa))
        total = sum(w for w, _, _ in parts)
        mean = sum(w * xa for w, xa, _ in parts) / total
        covariance = sum(w * (pa + np.outer(xa - mean, xa - mean)) for w, xa, pa in parts) / total
        _, _, log_l = bank.update(np.array([z]), e)
        assert np.allclose([v[0, 0] for v in bank.x], mean, rtol=1e-9)
        assert bank.p[0, 0][0, 0] == pytest.approx(covariance[0, 0], rel=1e-6)
        assert log_l[0] - 0.5 * np.log(2 * np.pi) == pytest.approx(np.log(total), rel=1e-9)


def test_recursion_by_chunks_predicts_like_the_steady_state():
    rng = np.random.default_rng(6)
    z = 0.01 * rng.standard_normal(5000)
    model = LINEAR['acceleration']
    each, (u,) = Chunks(z, 0.01).densities([model, model], at_off=(0.0,))
    log_l = each.sum(1)
    fast = predict(model, z, 0.01)
    assert log_l[0] == log_l[1] == pytest.approx(fast.log_likelihood, abs=0.1)
    assert np.allclose(u[0], fast.u, atol=2e-3)


@pytest.mark.thorough
@pytest.mark.parametrize('more', [None, GaussMarkov({'sigma': 3e-3, 'tc': 5.0}), Sinusoid(
    {'amplitude': 2e-3, 'frequency': 20.0, 'tc': 1e4}), Sinusoid(
        {'amplitude': 2e-3, 'frequency': 20.0, 'tc': 20.0})],
    ids=['bank', 'slow colour', 'line', 'line that wanders'])
def test_chunks_of_a_record_at_rest_say_what_the_whole_says(more):
    """A bank at rest, a slow colour and a phase remember for longer than a chunk lasts."""
    z = 0.01 * np.random.default_rng(9).standard_normal(8000)
    model = AnyMotion() + White({'R': 1e-4})
    model = model if more is None else model + more
    bank = Bank(Coefficients([modes_of([model], 0.01)]), 1)
    e = bank.table.at(0)
    whole = [bank.step(z[k:k + 1], e if k else None)[2][0] for k in range(len(z))]
    whole = np.sum(log_density(np.array(whole))[settle_of(len(z)):])
    assert predict(model, z, 0.01).log_likelihood == pytest.approx(whole, abs=1.0)
    chunks = Chunks(z, 0.01)
    near = model.with_effect(White({'R': 1.2e-4}))
    chunks.densities([near])
    chunks.begin(near)
    chunks.begin(model, anew=True)
    assert chunks.densities([near, model])[0][1].sum() == pytest.approx(whole, abs=1.0)


@pytest.mark.parametrize('bank', [False, True])
def test_missing_samples_are_predicted_over(bank):
    """The likelihood is that of what is there: a normal density of all, without what is not."""
    rng, n, r = np.random.default_rng(3), 300, 1e-4
    z = 0.01 * rng.standard_normal(n) + np.cumsum(1e-3 * rng.standard_normal(n))
    z[[80, 100, 101, 102, 250]] = np.nan
    model = ConstantRate() + ArIncrement({'phi': 0.0, 'q': 1e-6}) + White({'R': r})
    if bank:        # of outliers that are none: through the same recursion as a mixture
        model = model + Outliers({'fraction': 1e-5, 'factor': 4.0})
    found = predict(model, z, 0.01)
    k = np.arange(n)
    cov = 1e-6 * (np.minimum.outer(k, k) + 1) + 1e2 + r * np.eye(n)
    there = np.isfinite(z)

    def density(some):
        return stats.multivariate_normal(None, cov[np.ix_(some, some)]).logpdf(z[some])

    settle = settle_of(n)
    expected = density(k[there]) - density(k[:settle][there[:settle]])
    assert found.log_likelihood == pytest.approx(expected, abs=0.1)
    assert len(found.u) == n - settle and np.isfinite(found.u).all()


def test_scores_of_a_true_mixture_are_standard_normal():
    rng = np.random.default_rng(7)
    n, r = 20000, WHITE['R']
    outliers = Outliers({'fraction': 0.05, 'factor': 400.0})
    z = np.sqrt(r) * rng.standard_normal(n) * np.where(rng.random(n) < 0.05, 20.0, 1.0)
    z += np.cumsum(np.sqrt(1e-3 * r) * rng.standard_normal(n))
    model = ConstantRate() + ArIncrement({'phi': 0.0, 'q': 1e-3 * r}) + WHITE + outliers
    u = predict(model, z, 0.01).u
    assert stats.kstest(u, 'norm').pvalue > 1e-3
    wrong = predict(model.minus('outliers'), z, 0.01).u
    assert stats.kstest(wrong, 'norm').pvalue < 1e-12


def test_steps_make_a_bank_of_two_that_finds_them():
    n, at = 1200, 700
    z = 0.01 * np.random.default_rng(8).standard_normal(n)
    z[at:] += 0.3
    model = (
        ConstantRate()
        + RateStep({'size': 0.3, 'rate': 0.1})
        + ArIncrement({'phi': 0.0, 'q': 1e-12})
        + White({'R': 1e-4})
    )
    bank = Bank(Coefficients([modes_of([model], 0.01)]), 1)
    jump = []
    for k in range(n):
        bank.step(z[k:k + 1], bank.table.at(0) if k else None)
        jump.append(bank.mu[1, 0])
    assert np.argmax(jump[1:]) + 1 == at and jump[at] > 0.99
    assert abs(bank.rate()[0][0] - 0.3) < 0.002


def noise(*effects):
    """Return effects of a study of noise from (name, values)."""
    return [find_effect('noise', name)(values) for name, values in effects]


def test_terms_follow_flicker_within_the_error_they_state():
    flicker, = noise(('flicker', {'B': 1e-4}))
    for per_decade, most in ((1, 0.08), (2, 0.01)):
        terms, error = gauss_markov_terms(flicker.psd, 0.001, 0.1, 1e3, per_decade)
        f = np.geomspace(3.2e-3, 3.1, 300) / (2 * np.pi)
        one_sided = sum(
            2 * 2 * e['sigma'] ** 2 * e['tc'] / (1 + (2 * np.pi * f * e['tc']) ** 2) for e in terms
        )
        off = np.abs(one_sided / (1e-4 ** 2 / (np.pi * f)) - 1)
        assert off.max() <= error * 1.01 + 1e-4 and error < most


def test_noise_of_a_study_becomes_blocks_and_notes():
    dt = 0.01
    model, notes = noise_blocks(noise(
        ('white', {'N': 1e-3}),
        ('flicker', {'B': 1e-4}),
        ('random_walk', {'K': 1e-5}),
        ('gauss_markov', {'sigma': 1e-3, 'tc': 2.0}),
        ('rts', {'step': 4e-3, 'tau': 6.0}),
        ('sinusoid', {'amplitude': 1e-2, 'frequency': 20.0}),
        ('ramp', {'R': 1e-7}),
        ('quantization', {'Q': 1e-6}),
        ('sinusoid', {'amplitude': 1e-2, 'frequency': 70.0}),
    ), dt)
    assert model['white']['R'] == pytest.approx(1e-6 / dt)
    assert model['random_walk']['K'] == pytest.approx(1e-5)
    terms = [(e['sigma'], e['tc']) for e in model.of(GaussMarkov)]
    assert len(terms) == 7 and 'sinusoid' in model
    # popcorn noise has the spectrum of half its step, for half its dwell
    assert terms[-2:] == [pytest.approx((1e-3, 2.0)), pytest.approx((2e-3, 3.0))]
    assert any('flicker' in n and '%' in n for n in notes)
    assert [n.split()[0] for n in notes] == ['flicker', 'ramp', 'quantization', 'sinusoid']
    assert (
        kalman.steady_state(state_space(ConstantRate() + ArIncrement.example() + model, dt))
        is not None
    )


def test_an_effect_of_ones_own_is_a_block_by_what_it_can_say():
    """No list of names decides: a state space will do."""
    class Slow(Spectrum):
        parameters = (Parameter('s', '{rate}', 1e-9, 1.0),)

        def state_space(self, dt):
            return np.array([[0.5]]), np.array([[self['s'] ** 2]]), np.array([[2.0]])

    model, notes = noise_blocks([Slow({'s': 1e-3}), *noise(('white', {'N': 1e-3}))], 0.01)
    assert not notes and model.labels == ['gauss_markov', 'white']
    assert model['gauss_markov']['sigma'] ** 2 == pytest.approx(4e-6 / 0.75)
    assert model['gauss_markov']['tc'] == pytest.approx(0.01 / np.log(2))


def test_random_walk_wanders_as_it_should_for_minutes():
    k, dt = 1e-3, 0.1
    b = RandomWalk({'K': k}).block(dt)
    assert b.q[0, 0] == pytest.approx(k ** 2 * dt, rel=1e-3)
    assert b.phi[0, 0] == pytest.approx(gauss_markov.phi(dt, 3600.0))


def test_a_model_that_cannot_be_built_says_what_is_missing():
    for model, what in (
        (Model([WHITE]), 'no motion'),
        (Model([ConstantRate()]), 'no white noise'),
        (ConstantRate() + White(), 'no values'),
        (RateStep.example() + WHITE, 'state'),
    ):
        with pytest.raises(UsageError, match=what):
            state_space(model, 0.01)


def test_default_bank_holds_the_acceleration_still_in_the_wandering_modes():
    modes: Modes = default_modes([Model([WHITE])], 0.01)
    spaces = modes.spaces[0]
    assert len({s.size for s in spaces}) == 1 and modes.prior.sum() == pytest.approx(1)
    still = spaces[0]
    assert not still.phi[1].any() and not still.phi[0, 1] and not still.q[1].any()
    one_step = modes.stay + (1 - modes.stay) * modes.prior[0]
    assert one_step == pytest.approx(np.exp(-0.01 / 10.0), rel=1e-6)  # a sojourn of ten seconds
    twice = default_modes([Model([WHITE])], 0.02)       # two intervals are one of twice the length
    assert twice.stay == pytest.approx(modes.stay ** 2, rel=1e-12)


def test_a_law_of_the_motion_brings_back_and_drives_more():
    """Phi is the exponential of the law; Q grows by the mean square of the acceleration."""
    dt, law = 0.02, Law({'size': 1.5, 'share': 3.0, 'decay': 20.0, 'spring': 350.0}, 'law')
    modes = modes_of([AnyMotion() + White({'R': 1e-4}) + law], dt).spaces[0]
    plain = modes_of([AnyMotion() + White({'R': 1e-4})], dt).spaces[0]
    bank = Bank(Coefficients([modes_of([AnyMotion() + White({'R': 1e-4}) + law], dt)]), 1)
    bank.x[:, :, 0] = np.array([0.3, 2.0])[:, None]
    before = [a.copy() for a in (bank.x, bank.cov)]
    bank.predict(bank.table.at(0))
    for k, (space, base) in enumerate(zip(modes, plain)):
        phi, q = base.phi, base.q
        x, cov = before[0][:, k, 0], before[1][:, k, 0][[[0, 1], [1, 2]]]
        if space.grows is not None:
            phi = linalg.expm(dt * np.array([[0.0, 1.0], [-350.0, -20.0]]))
            unit = np.array([[dt ** 3 / 3, dt ** 2 / 2], [dt ** 2 / 2, dt]])
            q = 1.5 * base.q + 3.0 * (x[1] ** 2 + cov[1, 1]) * unit
        assert np.allclose(bank.x[:, k, 0], phi @ x)
        assert np.allclose(bank.cov[:, k, 0], (phi @ cov @ phi.T + q)[[0, 0, 1], [0, 1, 1]])
    assert sum(space.grows is not None for space in modes) == 12


def test_models_side_by_side_switch_each_at_its_own_pace():
    """Their likelihoods are those that each has alone."""
    z = 0.01 * np.cumsum(np.random.default_rng(4).standard_normal(1500))
    models = [StopAndGo({'q': 10.0, 'dwell': dwell}) + White({'R': 1e-4}) for dwell in (0.5, 8.0)]
    together = Chunks(z, 0.01).densities(models)[0].sum(1)
    assert together == pytest.approx([predict(m, z, 0.01).log_likelihood for m in models])
    assert abs(together[0] - together[1]) > 1
