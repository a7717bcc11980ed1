# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
One contract for every registered noise effect, by capability.

A new effect is tested before its author thinks of it: no test here is about one effect.
"""

from __future__ import annotations

from dataclasses import replace
import functools
import itertools

import numpy as np
import pytest
import yaml

from imu_noise_tools import store
from imu_noise_tools.core import allan, record, spectrum, units
from imu_noise_tools.core.errors import ImuNoiseError
from imu_noise_tools.loop.effect import find_effect, Model, registry
from imu_noise_tools.noise import (
    Coupling,
    Defect,
    Inputs,
    Line,
    Mean,
    Modulation,
    NoiseEffect,
    Response,
    Spectrum,
)
from imu_noise_tools.noise.behind import gain2_of
from imu_noise_tools.noise.fit import fit
from imu_noise_tools.noise.gather import gather
from imu_noise_tools.noise.slower import as_measured

DT = 0.02
VIEWS = {'frequency', 'time', 'variance', 'distribution', 'coherence', 'repeats', 'grid',
         'moments', 'ends'}
EFFECTS = dict(registry('noise'))
# Where another value of one parameter asks for another value of a second one as well.
# Noise of less than half a step is not white after rounding: there is no density to test.
MORE = {'duplicates': [{'fraction': 0.5, 'pattern': 'regular', 'run': 1.0},
                       {'fraction': 0.3, 'pattern': 'regular', 'run': 1.0},
                       {'fraction': 0.15, 'pattern': 'random', 'run': 6.0}],
        'spikes': [{'rate': 0.05, 'sigma': 0.05, 'nu': 4.0}],
        'rate_quantization': [{'step': 2e-3, 'white': 1.0}],
        'variance_change': [{**EFFECTS['variance_change'].neutral, 'factor': 3.0, **v} for v in (
            {'form': 'drift'}, {'form': 'periodic', 'time': 60.0, 'period': 150.0},
            {'form': 'growth'}, {'form': 'swell', 'time': 60.0, 'period': 150.0},
            {'form': 'stretch', 'time': 90.0, 'duration': 60.0},
            {'form': 'stretch', 'time': 30.0, 'duration': 60.0, 'time_2': 160.0,
             'duration_2': 100.0})]}


def variants(cls) -> list[NoiseEffect]:
    """Return the example, and one for each value of a parameter that takes few."""
    out = [cls.example(), *(cls(v) for v in MORE.get(cls.name, ()))]
    for p in cls.parameters if len(out) == 1 else ():
        out += [cls.example().with_values(**{p.name: v}) for v in p.choices
                if v != cls.example().chosen(p.name)]
    return out


def of_kind(*kinds, without=(), seldom=False):
    """Parametrise over the variants of all effects of a kind; every day their examples do."""
    found = [pytest.param(e, id=' '.join([n, *(f'{e[p.name]:g}' for p in c.parameters)]),
                          marks=pytest.mark.thorough if seldom and e != c.example() else ())
             for n, c in EFFECTS.items() if issubclass(c, kinds) and not issubclass(c, without)
             for e in variants(c)]
    return pytest.mark.parametrize('effect', found)


every = pytest.mark.parametrize('cls', EFFECTS.values(), ids=EFFECTS)


def inputs(n, seed=0) -> Inputs:
    """Return times, a temperature that rises and sways, and the axes of a shaken sensor."""
    rng = np.random.default_rng([seed, 99])
    t = np.arange(n) * DT
    temperature = 25 + 4 * (1 - np.exp(-3 * t / t[-1])) + np.sin(2 * np.pi * t / t[-1] * 5)
    axes = {a: rng.standard_normal(n) * (6e-4 if a.startswith('gyro') else 0.5)
            for a in record.AXES}
    course = np.sin(np.sqrt(temperature))     # what axes tell that follow it
    return Inputs(t, DT, {'temperature': temperature, 'course': course}, axes)


def test_an_effect_that_derives_from_another_has_the_allan_variance_of_its_own_spectrum(
        clean_registry):
    """Beside the other's, at the same cluster sizes: what is kept of one is not the other's."""
    def doubled(cls):
        class Louder(cls):
            name = f'louder_{cls.name}'

            def psd(self, f, dt):
                return 2 * super().psd(f, dt)

        return Louder

    m = np.array([1.0, 3.0, 20.0])
    one = EFFECTS['flicker'].example()
    for _ in range(2):
        twice = doubled(type(one))(dict(one.values)).avar(m, DT)
        np.testing.assert_allclose(twice, 2 * one.avar(m, DT), rtol=1e-12)


def test_the_known_effects_are_there():
    assert {'white', 'flicker', 'random_walk', 'quantization', 'ramp', 'gauss_markov', 'sinusoid',
            'rate_quantization'} <= set(EFFECTS)


# --- what people read ----------------------------------------------------------------------------

@every
def test_documentation(cls):
    for text in (cls.title, cls.equation, cls.signature, cls.hint, cls.reference, cls.symbol):
        assert text.strip() and text == text.strip()
    assert cls.__doc__ and cls.domain == 'noise'
    assert len(cls.hint) > 60, 'say the cause and what to check on the bench'
    assert set(cls.views) <= VIEWS
    assert len(cls.title) < 60


@every
def test_parameters(cls):
    assert cls.parameters
    names = [p.name for p in cls.parameters]
    assert len(set(names)) == len(names) and all(n.isidentifier() for n in names)
    for p in cls.parameters:
        assert p.title and p.unit and p.lower < p.upper
        assert '{' not in units.si(p.unit, 'gyro') and '{' not in units.si(p.unit, 'accel')
        assert p.lower > 0 or not p.log
        assert not (p.linear and p.log), 'what is solved for may be negative'


@every
def test_example_is_complete_and_within_bounds(cls):
    for e in variants(cls):
        assert e.fitted
        for p in cls.parameters:
            assert p.lower <= e[p.name] <= p.upper, p.name


@every
def test_has_a_simulation(cls):
    e = cls.example()
    x = 6e-4 * np.random.default_rng(1).standard_normal(8000)
    before = x.copy()
    out = e.apply(x, inputs(8000), np.random.default_rng(2))
    np.testing.assert_array_equal(x, before, err_msg='apply changed its argument')
    assert out.shape == x.shape and np.all(np.isfinite(out)) and not np.array_equal(out, x)
    again = e.apply(x, inputs(8000), np.random.default_rng(2))
    np.testing.assert_array_equal(out, again, err_msg='drew from somewhere else than rng')


@every
def test_values_survive_yaml(cls):
    e = cls({p.name: p.choices[-1] if p.choices else v
             for p, v in zip(cls.parameters, itertools.cycle((1 / 3 * 1e-5, 2e-5, 3.0, 1e22)))})
    data = yaml.safe_load(store.dump_yaml({e.label: {'effect': e.name, **e.written()}}))[e.label]
    assert all(isinstance(data[p.name], str) == bool(p.choices) for p in cls.parameters)
    back = find_effect('noise', data.pop('effect'))(data)
    assert back == e and back.values == e.values


# --- kinds ---------------------------------------------------------------------------------------

F = np.geomspace(1e-6, 0.5 / DT, 300)


@of_kind(Spectrum)
def test_density_is_positive_and_finite(effect):
    s = effect.psd(F, DT)
    assert s.shape == F.shape and np.all(np.isfinite(s)) and np.all(s >= 0) and np.any(s > 0)
    np.testing.assert_allclose(effect.psd(F[::7], DT), s[::7], rtol=1e-12)


@of_kind(Spectrum)
def test_variance_is_the_quadrature_of_the_density(effect):
    m = np.unique(np.round(np.geomspace(1, 20_000, 50)))
    quadrature = spectrum.quadrature_avar(lambda f: effect.psd(f, DT), m, DT)
    # in a deep null of a narrow band the quadrature has an error of its own
    np.testing.assert_allclose(effect.avar(m, DT), quadrature, rtol=0.006,
                               atol=3e-6 * np.max(quadrature))


@of_kind(Spectrum)
@pytest.mark.parametrize('factor', [1e-3, 2.0])
def test_power_goes_with_the_square_of_the_amplitude(effect, factor):
    some = [p.name for p in effect.parameters if p.amplitude]
    assert some, 'a spectrum has an amplitude that may be null'
    other = effect.with_values(**{k: factor * effect[k] for k in some})
    np.testing.assert_allclose(other.psd(F, DT), factor ** 2 * effect.psd(F, DT), rtol=1e-9)
    m = np.array([1, 10, 1000])
    np.testing.assert_allclose(other.avar(m, DT), factor ** 2 * effect.avar(m, DT), rtol=1e-9)


@of_kind(Spectrum)
def test_state_space_has_the_density(effect):
    """S(f) = 2 dt H (z - Phi)^-1 Q (z - Phi)^-* H^T at z = e^{i 2 pi f dt}."""
    parts = effect.state_space(DT)
    if parts is None:
        pytest.skip('no finite state space')
    phi, q, h = parts
    k = len(phi)
    assert phi.shape == q.shape == (k, k) and h.shape == (1, k)
    np.testing.assert_allclose(q, q.T)
    assert np.all(np.linalg.eigvalsh(q) >= -1e-15 * np.max(np.abs(q)))
    assert np.all(np.abs(np.linalg.eigvals(phi)) <= 1 + 1e-12)
    s = []
    for f in F[F > 1e-3]:
        g = h @ np.linalg.inv(np.exp(2j * np.pi * f * DT) * np.eye(k) - phi)
        s.append(2 * DT * (g @ q @ g.conj().T).real.item())
    # at Nyquist some have a zero
    np.testing.assert_allclose(s, effect.psd(F[F > 1e-3], DT), rtol=1e-6, atol=1e-15 * np.max(s))


@of_kind(Spectrum)
def test_simulation_follows_density_and_variance(effect):
    """The mean over many draws, within five standard errors of the draws themselves and 1 %."""
    n, draws = 4096, 120
    b = spectrum.bins_of(n, DT)
    variance = np.sum(effect.psd(b.f, DT) * b.count) / (2 * n * DT)
    given, rng = inputs(n), np.random.default_rng(7)
    m = np.unique(np.round(np.geomspace(1, n // 8, 12)).astype(int))
    power, avar = [], []
    for _ in range(draws):
        # some effects act on samples: what they add is looked at, on top of noise of their size
        x = 3 * np.sqrt(variance) * rng.standard_normal(n)
        added = effect.apply(x, given, rng) - x
        power.append(spectrum.power(spectrum.cosine_transform(added), DT, b))
        avar.append(allan.overlapping_variance(added, m))
    for seen, truth, spread in (
            (power, effect.binned(b), np.sqrt(2 / b.count)),
            (avar, effect.avar(m, DT), np.zeros(len(m)))):
        ratio = np.array(seen) / truth
        if truth[-1] > 100 * truth[0]:
            # the ends of a record leak a floor into the lowest coefficients of a rising spectrum
            ratio, spread = ratio[:, truth > 0.01 * truth[-1]], spread[truth > 0.01 * truth[-1]]
        # the scatter of the draws themselves, or that of a normal process if larger
        error = np.maximum(ratio.std(axis=0), spread) / np.sqrt(draws)
        pull = (np.abs(ratio.mean(axis=0) - 1) - 0.01) / error
        assert np.max(pull) < 5, f'at {np.argmax(pull)}'
        # and on the whole, much closer than any one bin can tell
        whole = ratio.mean(axis=1)
        assert abs(whole.mean() - 1) < 5 * whole.std() / np.sqrt(draws) + 0.01


@of_kind(Mean)
def test_mean(effect):
    n = 20_000
    given = inputs(n)
    linear = [p.name for p in effect.parameters if p.linear]
    rest = {p.name: effect[p.name] for p in effect.parameters if not p.linear}
    columns = effect.columns(given, **rest)
    assert columns.shape == (n, len(linear)) and np.all(np.isfinite(columns))
    there = [k for k, x in zip(linear, columns.T) if np.any(x) or k not in effect.optional]
    assert np.linalg.matrix_rank(np.column_stack([np.ones(n), columns])) == 1 + len(there)
    added = effect.apply(np.zeros(n), given, np.random.default_rng(0))
    np.testing.assert_allclose(added, columns @ [effect[k] for k in linear], rtol=1e-12)
    if type(effect).avar is not Mean.avar:
        m = np.array([1, 10, 500])
        np.testing.assert_allclose(allan.overlapping_variance(added, m), effect.avar(m, DT),
                                   rtol=1e-6)


@of_kind(Line)
def test_line(effect):
    """Its Allan variance is that of the samples, the phase averaged away."""
    given, rng = inputs(20_000), np.random.default_rng(1)
    m = np.unique(np.round(np.geomspace(1, 2000, 20)).astype(int))
    seen = np.mean([allan.overlapping_variance(effect.apply(np.zeros(20_000), given, rng), m)
                    for _ in range(20)], axis=0)
    np.testing.assert_allclose(seen, effect.avar(m, DT), rtol=0.03,
                               atol=1e-3 * np.max(effect.avar(m, DT)))


@of_kind(Response)
def test_response(effect):
    """White noise behind it has its shape; a defect may change the level as well."""
    gain = effect.gain2(F, DT)
    assert gain.shape == F.shape and np.all(np.isfinite(gain)) and np.all(gain >= 0)
    assert gain[0] == pytest.approx(1, abs=1e-6), 'N is what it was at low frequencies'
    n, draws = 4096, 150
    given, rng, seen = inputs(n), np.random.default_rng(3), []
    for _ in range(draws):      # once each, where samples are those of a slower sensor
        y = np.outer(effect.apply(rng.standard_normal(n), given, rng), [1, 0, 0])
        own = as_measured(record.ImuRecord(y, None, given.t, 1 / DT), ['gyro_x'],
                          record.Memory())[0].record
        b = spectrum.bins_of(own.n, own.dt)
        seen.append(spectrum.power(
            spectrum.cosine_transform(own.column('gyro_x')), own.dt, b) / (2 * own.dt))
    seen = np.mean(seen, axis=0)
    expected = spectrum.expected(lambda f: gain2_of([effect], f, b.dt, white=True), b)
    some = expected > 1e-4
    error = np.sqrt(2 / (draws * b.count))[some]
    ratio = seen[some] / expected[some]
    level = np.average(ratio, weights=1 / error ** 2) if isinstance(effect, Defect) else 1.0
    # a narrow null of the gain is not resolved by a bin that holds it
    slack = 0.02 + 3 * np.abs(np.gradient(np.log(expected[some])))
    assert np.all(np.abs(ratio / level - 1) < 5 * error + slack)


@of_kind(Modulation)
def test_modulation(effect):
    n, draws = 20_000, 60
    given, rng = inputs(n), np.random.default_rng(4)
    factor = effect.variance(given.t)
    assert factor.shape == (n,) and np.all(np.isfinite(factor)) and np.all(factor > 0)
    seen = np.mean([(effect.apply(rng.standard_normal(n), given, rng)) ** 2
                    for _ in range(draws)], axis=0).reshape(40, -1).mean(axis=1)
    np.testing.assert_allclose(seen, factor.reshape(40, -1).mean(axis=1),
                               rtol=5 * np.sqrt(2 / (draws * n / 40)))


# --- the samples ---------------------------------------------------------------------------------

SAMPLES = {
    'noise': lambda rng: rng.standard_normal(3000),
    'a hundred': lambda rng: rng.standard_normal(100),
    'two levels': lambda rng: np.where(rng.random(3000) < 0.5, 0.0, 1.0),
    'constant but for one': lambda rng: np.where(np.arange(3000) == 1500, 1.0, 0.0),
    'counts': lambda rng: np.round(3 * rng.standard_normal(3000)),
    'at 9.8, small': lambda rng: 9.80665 + 1e-6 * rng.standard_normal(3000),
    'single precision': lambda rng: rng.standard_normal(3000).astype(np.float32).astype(float),
}


@every
@pytest.mark.parametrize('samples', SAMPLES.values(), ids=SAMPLES)
@pytest.mark.filterwarnings('error')
def test_statistics_are_plain_arrays(cls, samples):
    y = samples(np.random.default_rng(5))
    before = y.copy()
    kept = cls.statistics(y, inputs(len(y)))
    np.testing.assert_array_equal(y, before)
    for name, value in kept.items():
        value = np.asarray(value)
        assert name.isidentifier() and value.dtype.kind in 'fiub' and np.all(np.isfinite(value))
        assert value.size < 200_000
    if issubclass(cls, Defect) and kept:
        screened = cls.screen(y, kept, inputs(len(y)))
        assert screened.shape == y.shape and np.all(np.isfinite(screened))


def the_record(effect=None, minutes=40, seed=0):
    """Return a record of white noise with an effect on gyro_x, on a shaken mount that warms up."""
    n = int(minutes * 60 / DT)
    given, rng = inputs(n, seed), np.random.default_rng([seed, 5])
    axes = dict(given.axes)
    if effect is not None:
        base = axes['gyro_x'] if effect.name != 'white' else np.zeros(n)
        axes['gyro_x'] = effect.apply(base, given, rng)
        if effect.free:     # told by the other axes
            axes |= {a: effect.apply(axes[a], given, rng) for a in ('gyro_y', 'gyro_z')}
    gyro, accel = (np.column_stack([axes[f'{s}_{c}'] for c in 'xyz']) for s in ('gyro', 'accel'))
    return record.ImuRecord(gyro, accel, given.t, 1 / DT, covariates=dict(given.covariates))


def evidence_of(effect=None, **kwargs):
    """Return what is kept of gyro_x; the other axes are dead where no effect needs them."""
    made = the_record(effect, **kwargs)
    if effect is None or effect.free or isinstance(effect, Coupling):
        return gather(made, record.AXES)['gyro_x']
    alone = np.where(np.arange(3) == 0, made.gyro, 0.0)
    return gather(replace(made, gyro=alone, accel=None), ['gyro_x'])['gyro_x']


@functools.lru_cache(maxsize=None)
def evidence_of_example(name):
    """Return what is kept of gyro_x with the example of an effect, gathered once."""
    return evidence_of(EFFECTS[name].example())


N_WHITE = 6e-4 * np.sqrt(DT)


@pytest.fixture(scope='module')
def plain_evidence():
    """Return the evidence of a record with nothing but white noise."""
    return evidence_of()


@every
def test_starts_are_complete(cls, plain_evidence):
    measured = issubclass(cls, (Line, Defect, Modulation))
    for e in cls().starts(plain_evidence):
        assert e.name == cls.name
        for p in cls.parameters:
            if not (p.amplitude or p.linear or measured):
                assert p.name in e.values, f'{p.name} has no start'
            if p.name in e.values:
                assert p.lower <= e[p.name] <= p.upper
    kept = cls({p.name: cls.example()[p.name] for p in cls.parameters if not p.amplitude})
    for e in kept.starts(plain_evidence):
        assert all(e[k] == v for k, v in kept.values.items()) or not issubclass(cls, Spectrum)


@of_kind(Defect)
def test_nothing_is_found_where_there_is_nothing(effect, plain_evidence):
    found = type(effect)().find(plain_evidence)
    assert found is None or found.gain < 10


def _model(effect):
    return Model([find_effect('noise', 'white')()] * (effect.name != 'white') + [type(effect)()])


@pytest.mark.parametrize('effect', [pytest.param(c.example(), id=n) for n, c in EFFECTS.items()])
def test_what_simulation_puts_in_the_fit_finds(effect):
    """Every value within five standard deviations of the truth (1 % where it has none)."""
    evidence = evidence_of_example(effect.name)
    found = fit(evidence, _model(effect))
    estimates = found.estimates[effect.label]
    assert set(estimates) == {p.name for p in effect.parameters}
    for p in effect.parameters:
        e, truth = estimates[p.name], effect[p.name]
        assert e.unit == units.si(p.unit, 'gyro')
        if p.discrete:
            # one of the values tried: a kind (a whole number) must be right, a time near
            assert abs(e.value - truth) < (1e-9 if p.unit == '1' else 0.01 * evidence.duration)
        elif truth == 0:
            assert e.value is None or abs(e.value) <= 5 * (e.std or 0)
        else:
            assert e.value is not None, f'{p.name}: {e.note}'
            assert abs(e.value - truth) < 5 * (e.std or 0) + 0.01 * abs(truth), \
                f'{p.name}: {e.value:.4g} +- {e.std or 0:.2g}, truth {truth:.4g}'
            if e.std:
                assert e.std < 0.5 * abs(truth), f'{p.name}: too uncertain to mean much'
    if effect.name != 'white' and isinstance(effect, (Line, Mean, Coupling)):
        white = found.estimates['white']['N']
        assert abs(white.value - N_WHITE) < 5 * white.std


@of_kind(Defect, Modulation, seldom=True)
def test_what_simulation_puts_in_is_found_in_the_samples(effect):
    example = effect == type(effect).example()
    evidence = evidence_of_example(effect.name) if example else evidence_of(effect, seed=1)
    look = type(effect)().find if isinstance(effect, Defect) else type(effect)().measure
    finding = look(evidence)
    assert finding is not None and finding.gain > 50 and finding.evidence
    assert finding.effect.name == effect.name and finding.effect.fitted
    for k, e in finding.estimates.items():
        assert e.value == pytest.approx(finding.effect[k])


@functools.lru_cache(maxsize=None)
def accelerometer_alone():
    """Return what is kept of an axis with nothing but two others beside."""
    made = the_record(minutes=2)
    return gather(record.ImuRecord(None, made.accel, made.t, 1 / DT), ['accel_x'])['accel_x']


@every
def test_what_does_not_apply_is_refused_in_words(cls):
    """An accelerometer axis alone, no temperature: an effect that needs more says so."""
    evidence = accelerometer_alone()
    if cls().starts(evidence):
        assert set(fit(evidence, _model(cls.example())).estimates) == {'white', cls.name}
    else:
        with pytest.raises(ImuNoiseError) as error:
            fit(evidence, _model(cls.example()))
        assert cls.name in error.value.message and error.value.remedy


@pytest.mark.parametrize('poles', [1, 2])
@pytest.mark.parametrize('cutoff, averaged', [
    (0.15, 0.37), (0.15, 0.0), (0.15, 1.0), (0.01, 0.5), (0.37, 0.9), (0.02, 1.0), (0.9, 0.5)])
def test_poles_and_an_average_fold_as_their_product_does(poles, cutoff, averaged):
    """Of white noise in continuous time, sampled; either end of the share is another form."""
    alone, beside = (('first_order', 'first_order_averaged') if poles == 1 else
                     ('butterworth_2_sampled', 'butterworth_2_averaged'))
    effect = EFFECTS['low_pass']({'cutoff': cutoff / DT, 'form': beside,
                                  'behind': 0.0, 'averaged': averaged})
    x = np.linspace(0.001, 0.4997, 40)
    r = max(averaged, 1e-4) * 0.443 / cutoff
    pole = cutoff / max(2 * np.sinc(cutoff * r) ** 2 - 1, 1e-9**poles) ** (0.5 / poles)

    def folded(x):
        f = np.add.outer(x, np.arange(-20_000, 20_001))
        return np.sum(np.sinc(f * r) ** 2 / (1 + (f / pole) ** (2 * poles)), axis=-1)

    np.testing.assert_allclose(effect.gain2(x / DT, DT), folded(x) / folded(0.0), rtol=1e-5)
    for share, form in ((0.0, alone), (1.0, 'moving_average')):
        if share == averaged:
            other = effect.with_values(form=form)
            np.testing.assert_allclose(effect.gain2(x / DT, DT), other.gain2(x / DT, DT),
                                       rtol=2e-3)
