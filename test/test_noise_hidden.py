# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The generator of hidden effects against closed forms, and the fit on what it draws."""

from __future__ import annotations

import numpy as np
from params import daily
import pytest
from scipy.fft import dct

import hidden
from imu_noise_tools.core import allan
from imu_noise_tools.loop.effect import Model, model_of, registry
from imu_noise_tools.loop.study import assess
from imu_noise_tools.noise.fit import fit
from imu_noise_tools.noise.gather import gather
from imu_noise_tools.noise.problem import NoiseProblem

BASE = ('white', 'flicker', 'random_walk')
RATE = 20.0


# --- the generator itself ------------------------------------------------------------------------

@pytest.mark.parametrize(('make', 'density', 'red'), [
    (lambda n, dt, rng: hidden.white(n, dt, 2.0, rng), lambda f: 8.0 + 0 * f, False),
    (lambda n, dt, rng: hidden.flicker(n, dt, 2.0, rng), lambda f: 4 / (np.pi * f), True),
    (lambda n, dt, rng: hidden.random_walk(n, dt, 2.0, rng),
     lambda f: 2 * (2 / (2 * np.pi * f)) ** 2, False),
    (lambda n, dt, rng: hidden.decay(n, dt, 2.0, 3.0, rng),
     lambda f: 4 * 4 * 3 / (1 + (2 * np.pi * f * 3) ** 2), False)],
    ids=['white', 'flicker', 'random walk', 'Gauss-Markov'])
def test_base_noise_has_the_density_of_ieee_952(make, density, red):
    """Below a tenth of Nyquist, where sampling does not matter, and above the ends of a record."""
    n, dt, rng = 1 << 14, 0.05, np.random.default_rng(1)
    power = np.mean([2 * dt * dct(make(n, dt, rng), norm='ortho') ** 2 for _ in range(60)], axis=0)
    f = np.arange(n) / (2 * n * dt)
    edges = np.geomspace(8, n / 10, 12).astype(int)
    for a, b in zip(edges, edges[1:]):
        # the mean of the ratio, over 60 draws of b - a coefficients
        ratio = np.mean(power[a:b] / density(f[a:b]))
        # at the lowest, the ends of the record take a few per cent from flicker noise
        slack = 0.012 + (0.25 / a if red else 0)
        assert abs(ratio - 1) < 4.5 * np.sqrt(2 / (60 * (b - a))) + slack


def test_base_noise_has_the_variance_of_ieee_952():
    base, n, dt = {'N': 1.0, 'B': 0.2, 'K': 0.01}, 1 << 14, 0.1
    rng, m = np.random.default_rng(2), np.array([10, 30, 100, 300, 1000])
    some = [hidden.allan_variance(hidden.base_noise(n, dt, base, rng), m) for _ in range(200)]
    error = np.std(some, axis=0) / np.sqrt(200)
    off = np.abs(np.mean(some, axis=0) - hidden.base_variance(base, m * dt))
    assert np.all(off < 4.5 * error + 0.01 * np.mean(some, axis=0))


def test_two_codes_of_the_allan_variance():
    y = np.random.default_rng(3).standard_normal(3000)
    m = hidden.clusters(len(y))
    np.testing.assert_allclose(hidden.allan_variance(y, m), allan.overlapping_variance(y, m),
                               rtol=1e-9)


@pytest.mark.parametrize('name', hidden.RECIPES)
def test_every_recipe(name):
    """Drawn as strong as asked, on one axis; the same seed gives the same record."""
    (record, truth), (again, _) = (hidden.draw(np.random.default_rng(4), [name], strength=3.0,
                                               hours=0.25, rate_hz=RATE) for _ in range(2))
    np.testing.assert_array_equal(record.gyro, again.gyro)
    assert record.n == 18_000 and np.all(np.isfinite(record.gyro))
    (found,) = truth.hidden['gyro_x']
    assert found.name == name and found.known == (name in registry('noise'))
    assert truth.hidden['gyro_y'] == () == truth.hidden['gyro_z']
    assert found.nats >= 0 and found.strength > 0
    recipe = hidden.RECIPES[name]
    if recipe.unit:
        assert found.strength == 3.0
    elif name not in ('low_pass', 'notch', 'rate_quantization', 'duplicates'):
        assert found.strength == pytest.approx(3, rel=0.35)     # as it came out in the record
    if found.known:
        known = {p.name for p in registry('noise')[name].parameters}
        assert set(found.values) <= known


def test_strength_is_a_ratio_of_deviations():
    """A sinusoid of strength 4: its deviation at the worst tau is 4 times that of the base."""
    record, truth = hidden.draw(np.random.default_rng(5), ['sinusoid'], strength=4.0, hours=0.5)
    line, base = truth.hidden['gyro_x'][0], truth.base['gyro_x']
    tau = np.geomspace(0.02, 180, 4000)
    x = np.pi * line.values['frequency'] * tau
    adev = line.values['amplitude'] * np.sin(x) ** 2 / x
    ratio = np.max(adev / np.sqrt(hidden.base_variance(base, tau)))
    assert 3.9 < ratio < 5.5                         # 40 tau need not meet the very peak


@pytest.mark.thorough
def test_nats_are_what_a_fit_gains():
    """The expected gain, against the gain in likelihood of a fit that is told what is there."""
    for name, effects in (('sinusoid', ()), ('gauss_markov', ('gauss_markov',))):
        for seed in range(3):
            record, truth = hidden.draw(np.random.default_rng(seed), [name], strength=2.0,
                                        hours=0.5, rate_hz=RATE)
            (found,) = truth.hidden['gyro_x']
            e = gather(record, ['gyro_x'])['gyro_x']
            less = fit(e, model_of('noise', BASE)).log_likelihood
            more = fit(e, model_of('noise', (*BASE, *effects))).log_likelihood
            if effects:
                scatter = np.sqrt(2 * found.nats) + 3
                assert abs(more - less - found.nats) < 5 * scatter
            else:
                assert found.nats > 18 and len(e.line_table) >= 1


def test_several_at_once():
    record, truth = hidden.draw(np.random.default_rng(6), ['rate_quantization', 'ramp', 'rts'],
                                strength=(2.0, 3.0), hours=0.25, rate_hz=RATE)
    assert [h.name for h in truth.hidden['gyro_x']] == ['ramp', 'rts', 'rate_quantization']
    step = truth.hidden['gyro_x'][-1].values['step']
    levels = record.gyro[:, 0] / step
    np.testing.assert_allclose(levels, np.round(levels), atol=1e-6)


# --- the fit on what it draws --------------------------------------------------------------------

def check_truth(seed):
    """Draw a base and one effect that can be fitted by name, fit the true model, hold it to it."""
    rng = np.random.default_rng(seed)
    name = str(rng.choice(['sinusoid', 'gauss_markov', 'ramp', 'rate_quantization',
                           'quantization']))
    # a step of the output beyond two standard deviations is no white noise any more
    strength = 0.5 if name == 'rate_quantization' else (3.0, 10.0)
    record, truth = hidden.draw(rng, [name], strength=strength, hours=0.75, rate_hz=RATE)
    e = gather(record, ['gyro_x'])['gyro_x']
    problem = NoiseProblem(e)
    state = assess(problem, model_of('noise', (*BASE, name)))
    (inside,) = truth.hidden['gyro_x']
    found = {**{k: state.fit.estimates[x][k] for x, k in zip(BASE, 'NBK')},
             **state.fit.estimates[name]}
    for k, value in {**truth.base['gyro_x'], **inside.values}.items():
        estimate = found[k]
        if estimate.value is None:
            # 1 in 10^6 beyond; the limit is for 5 in 100
            assert abs(value) < 4 * estimate.upper95, (name, k)
        else:
            # by the interval, which need not be symmetric: three times as wide is six std
            lo, hi = estimate.ci95
            half = max(hi - lo, 1e-9 * abs(value)) / 2
            middle = (hi + lo) / 2
            assert abs(value - middle) < 3.5 * half + 0.02 * abs(value), (name, k, value, estimate)
    return state


@pytest.mark.parametrize('seed', daily(range(8), 0))
def test_true_model_finds_the_truth(seed):
    check_truth(seed)


def check_nothing(seed):
    """Draw a base with nothing hidden, three axes; the base model is within chance of it."""
    record, _ = hidden.draw(np.random.default_rng(seed), hours=0.75, rate_hz=RATE)
    for e in gather(record, ['gyro_x', 'gyro_y', 'gyro_z']).values():
        state = assess(NoiseProblem(e), model_of('noise', BASE))
        for v in state.error.views.values():
            assert v.excess < 7 * v.std, v.name
        assert np.all(np.isfinite([v.excess for v in state.error.views.values()]))
        assert isinstance(state.model, Model) and abs(state.error.excess) < 6 * state.error.std


@pytest.mark.parametrize('n, check', list(enumerate((check_truth, check_truth, check_nothing))))
def test_on_draws_never_seen(fresh_seed, n, check):
    """
    Another record every time the suite runs; the seeds are in the message where it fails.

    Fails where three draws in a row do. Of 300 draws with an effect and 200 without, none failed:
    one does in less than 1.5 % (95 %), and three in a row by chance in less than 4 in 10^6. What
    is broken fails every time.

    """
    failed = []
    for k in range(3):
        seed = [fresh_seed, n, k]
        try:
            check(seed)
            return
        except AssertionError as error:
            failed.append(f'{seed}: {error}')
    pytest.fail('\n'.join(failed))
