# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A fit that what it cannot explain does not bend; whether that matters; what imu.yaml says of it.

The records are made with the bench's generator, which shares nothing with the package.
"""

from __future__ import annotations

from dataclasses import replace
from io import BytesIO
from pathlib import Path
import re
import sys
from types import SimpleNamespace

from matplotlib.image import imread
import numpy as np
from params import daily, seldom
import pytest
from scipy.signal import butter, freqz, iirpeak, lfilter, welch
import yaml

from imu_noise_tools import export
from imu_noise_tools.core import units
from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.core.spectrum import bins_of
from imu_noise_tools.export._values import covering, HORIZON
from imu_noise_tools.health import MOTION_KEPT
from imu_noise_tools.loop.effect import Estimate, model_of
from imu_noise_tools.noise import robust as resting
from imu_noise_tools.noise.curve import bin_weights
from imu_noise_tools.noise.evidence import from_arrays, to_arrays
from imu_noise_tools.noise.explained import (
    Bands, COST, Explained, gained, judge, stretches, supported)
from imu_noise_tools.noise.fit import fit
from imu_noise_tools.noise.gather import _bridged, gather
from imu_noise_tools.noise.likelihood import Likelihood
from imu_noise_tools.noise.problem import NoiseProblem
from imu_noise_tools.noise.quiet import loud_stretches
from imu_noise_tools.noise.response import (
    beside_a_band, open_response, Order, raised_to, Rational)
from imu_noise_tools.noise.search import Found
from imu_noise_tools.noise.uncertainty import widened
from imu_noise_tools.plots.noise import pictures
from imu_noise_tools.tasks.noise import analyse_record, outputs

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'bench'))
import robust  # noqa: E402, I100, I201, I202

BASE = ('white', 'flicker', 'random_walk')
DT, N = 0.02, 90_000


def axis_of(y, dt=DT):
    """Return the evidence of samples of one axis; the others are dead, and not looked at."""
    record = ImuRecord(np.outer(y, [1, 0, 0]), None, np.arange(len(y)) * dt, dt ** -1)
    return gather(record, ['gyro_x'])['gyro_x']


def noise(seed):
    """Return half an hour of white noise, flicker noise and random walk."""
    rng = np.random.default_rng(seed)
    return robust.white(N, DT, rng) + robust.slow_noise(N, DT, rng), rng


def record_of(y, dt=DT):
    """Return a record of three axes alike in kind."""
    return ImuRecord(np.column_stack(y), None, np.arange(len(y[0])) * dt, 1 / dt)


# --- two fits are compared by what both count --------------------------------------------------

@pytest.mark.parametrize('partly', [False, True])
def test_what_a_fit_gains_over_another_has_no_unit(partly):
    """Degrees of freedom that one of them took for a mean are worth a ln v, in some unit."""
    rng, bins = np.random.default_rng(3), bins_of(4096, 0.01)
    power = rng.chisquare(bins.count) / bins.count
    taken = np.where(bins.f < 1, 0.1, 0.0)
    weight = bins.count - taken
    one = SimpleNamespace(power=power * bins.count / weight, weight=weight, v=np.ones(len(power)))
    other = SimpleNamespace(power=power, weight=1.0 * bins.count, v=np.full(len(power), 1.01))

    def said(unit):
        fits = (SimpleNamespace(power=d.power * unit, weight=d.weight, v=d.v * unit)
                for d in (one, other))
        return gained(Bands.on(bins), *fits, partly=partly)

    assert said(1e-12) == pytest.approx(said(1.0), abs=1e-6)
    assert abs(said(1.0)) < 2


# --- where nothing fails nothing changes ---------------------------------------------------------

@pytest.mark.parametrize('seed', daily(range(4), 0, 1))
def test_nothing_hidden_is_the_plain_fit(seed):
    evidence = axis_of(noise(seed)[0])
    found, plain = (fit(evidence, model_of('noise', BASE), robust=r) for r in (True, False))
    assert found.details.explained.all() and found.details.set_aside == ()
    for label, values in plain.estimates.items():
        for name, e in values.items():
            mine = found.estimates[label][name]
            assert mine.point == pytest.approx(e.point, rel=1e-12)
            assert mine.ci95 == pytest.approx(e.ci95, rel=1e-12)


def test_a_basis_of_everything_is_the_plain_fit():
    evidence = axis_of(noise(9)[0])
    plain = fit(evidence, model_of('noise', BASE), robust=False)
    bins = evidence.whole.bins
    found = fit(evidence, model_of('noise', BASE), basis=Explained(bins.f, np.ones(len(bins.f))))
    for label, values in plain.estimates.items():
        for name, e in values.items():
            assert found.estimates[label][name].point == pytest.approx(e.point, rel=1e-12)


# --- what is hidden does not decide --------------------------------------------------------------

@pytest.mark.parametrize('case', daily(
    robust.CASES[1:], robust.folded, robust.hump), ids=lambda c: c.__name__)
def test_what_is_not_in_the_model_does_not_bend_it(case):
    """N within 3 % of the level at 1 s (8 % where four disturb it), B within a factor 1.8."""
    y, rng = noise([5, robust.CASES.index(case)])
    if case in (robust.knocks, robust.on_and_off):
        pytest.skip('seen in time, not in the spectrum')
    y, level, _ = case(y, DT, rng)
    evidence = axis_of(y)
    found = fit(evidence, model_of('noise', BASE)).estimates
    near = 0.08 if case is robust.several else 0.03
    assert found['white']['N'].value == pytest.approx(level, rel=near)
    assert found['flicker']['B'].point == pytest.approx(robust.TRUTH['B'], rel=0.8)


def test_the_low_pass_of_a_sensor():
    """Second order at 68 Hz, sampled at 250 Hz: N 0.104 deg/sqrt(h), B 1.2 deg/h."""
    rng, n, dt = np.random.default_rng(68), 225_000, 1 / 250
    white, b = np.radians(0.104) / 60, np.radians(1.2) / 3600
    slow = robust.slow_noise(n, dt, rng) * b / robust.TRUTH['B']
    y = lfilter(*butter(2, 68 / 125), white / np.sqrt(dt) * rng.standard_normal(n) + slow)
    evidence = axis_of(y, dt)
    model = model_of('noise', BASE)
    found, plain = fit(evidence, model), fit(evidence, model, robust=False)
    assert plain.estimates['white']['N'].value is None and plain.model['flicker']['B'] > 10 * b
    assert found.estimates['white']['N'].value == pytest.approx(white, rel=0.02)
    assert found.model['flicker']['B'] < 3 * b
    (aside,) = found.details.set_aside
    assert aside.direction == 'too little' and aside.high == pytest.approx(125)
    assert any('not explained from' in flag for flag in found.flags)


@pytest.mark.parametrize('b, a, order', [
    ([0.4], [1, -0.6], Order(0, 1)),
    (np.ones(5) / 5, [1.0], Order(4, 0)),
    (*butter(2, 0.4), Order(2, 2)),
    (*butter(2, 0.1), Order(2, 2)),
    ([0.02], [1, -1.6, 0.9], Order(0, 2)),
])
def test_a_rational_response_follows_a_filter(b, a, order):
    bins = bins_of(N, DT)
    gain2 = np.abs(freqz(b, a, 2 * np.pi * bins.f * DT)[1] / (np.sum(b) / np.sum(a))) ** 2
    w = bins.count.astype(float)
    x = 1.7 * gain2 * np.random.default_rng(4).chisquare(w) / w
    w = w * (gain2 > 1e-3)
    _, level, v = Rational(x, w, bins, order).fit()
    assert level == pytest.approx(1.7, rel=0.04)
    some = (w > 0) & (bins.count < 400)  # wider bins hold the mean of the gain, not that inside
    assert v[some] == pytest.approx(1.7 * gain2[some], rel=0.1)


def test_a_tied_response_is_one_at_both_ends():
    bins = bins_of(N, DT)
    gain2 = 1 + 30 * np.abs(freqz(*iirpeak(0.5, 8), 2 * np.pi * bins.f * DT)[1]) ** 2
    w = bins.count.astype(float)
    x = gain2 * np.random.default_rng(5).chisquare(w) / w
    free, tied = (Rational(x, w, bins, Order(2, 2, t)) for t in (False, True))
    values, level, v = tied.fit([(Order(2, 2), free.fit()[0])])
    assert len(values) == Order(2, 2, True).terms == 3
    assert level == pytest.approx(1, rel=0.01)
    assert v[-1] == pytest.approx(level, rel=0.02)
    assert np.max(v) == pytest.approx(31, rel=0.2)


def swing(middle, q, more):
    """Return the filter (b, a) of two poles whose gain^2 is so high at a share of Nyquist."""
    r = np.exp(-np.pi * middle / (2 * q))
    a = [1, -2 * r * np.cos(np.pi * middle), r * r]
    return [np.sqrt(more) * np.abs(np.polyval(a[::-1], np.exp(-1j * np.pi * middle)))], a


def test_a_response_beside_poles_alone_keeps_their_slow_side():
    bins, b_a = bins_of(N, DT), swing(0.3, 6, 20)
    gain2 = 1 + np.abs(freqz(*b_a, 2 * np.pi * bins.f * DT)[1]) ** 2
    w = bins.count.astype(float)
    x = gain2 * np.random.default_rng(6).chisquare(w) / w
    order = Order(2, 2, alone=True)
    values, level, v = Rational(x, w, bins, order).fit()
    assert len(values) == order.terms == 3
    assert level == pytest.approx(1 + (b_a[0][0] / np.sum(b_a[1])) ** 2, rel=0.01)
    assert v[-1] == pytest.approx(gain2[-1], rel=0.02)
    assert np.max(v) == pytest.approx(21, rel=0.2)
    for other in order.rivals:
        assert raised_to(order, other, raised_to(other, order, values)) == pytest.approx(
            values, rel=1e-6) or other.tied
    response = open_response(order)
    one = {p.name: at for p, at in zip(response.parameters, values)}
    slopes = response.with_values(**one).slopes(bins)
    for j, name in enumerate(one):
        up, down = (np.log(response.with_values(**{**one, name: one[name] + h}).gain2(bins.f, DT))
                    for h in (1e-5, -1e-5))
        some = bins.count < 100  # wider bins hold the mean of the gain
        assert slopes[some, j] == pytest.approx((up - down)[some] / 2e-5, abs=0.02)


@pytest.mark.thorough
def test_the_level_between_a_wandering_line_and_a_filter(shared_data):
    """N is what the spectrum shows there, not what drift leaves of it below the line."""
    with np.load(shared_data / 'records' / 'adis16405_run6.npz') as kept:
        y, dt = kept['accel'][:, 0].astype(float), 1 / float(kept['rate_hz'])
    f, power = welch(y, 1 / dt, nperseg=1 << 14)
    level = np.sqrt(np.median(power[(f > 1) & (f < 6)]) / 2)
    found = fit(axis_of(y, dt), model_of('noise', BASE), intervals=False)
    assert found.model['white']['N'] == pytest.approx(level, rel=0.05)


def test_what_is_left_out_leaves_no_swing_behind():
    """The line across a long gap stands on as much as is mirrored, not on its last second."""
    gap, dips = 4000, []
    for seed in range(60):
        y = np.random.default_rng(seed).standard_normal(5 * gap)
        left = ((2 * gap * DT, 3 * gap * DT, 'masked'),)
        record = ImuRecord(np.column_stack([y] * 3), None, np.arange(len(y)) * DT, 1 / DT)
        bridged = _bridged(y, replace(record, left_out=left))
        assert np.array_equal(bridged[:2 * gap], y[:2 * gap])
        first, second = bridged[2 * gap:3 * gap].reshape(2, -1)
        assert np.std(first) == pytest.approx(1, rel=0.1)
        dips.append(np.mean(first) - np.mean(second))
    assert np.mean(np.square(dips)) < 1.3 * 2 / (gap / 2)  # white noise itself, no more


@pytest.mark.parametrize('drift, jumps', [(0.0, True), (0.0, False), (3e-3, False)])
def test_what_jumps_within_what_is_left_out_jumps_once(drift, jumps):
    """A line there is a ramp, two steps to who looks for one; of a drift it is the better one."""
    rng, n, gap = np.random.default_rng(31), 20_000, 100
    y = rng.standard_normal(n) + drift * np.arange(n)
    y[n // 2:] += 5.0 * jumps
    t = np.arange(n) * DT
    begin, end = n // 2 - gap // 3, n // 2 - gap // 3 + gap
    record = replace(ImuRecord(np.column_stack([y] * 3), None, t, 1 / DT),
                     left_out=((t[begin], t[end], 'masked'),))
    filled = _bridged(y, record)[begin:end]
    quarters = [np.mean(x) for x in np.array_split(filled, 4)]
    assert abs(quarters[1] - quarters[0]) < 1.2 and abs(quarters[3] - quarters[2]) < 1.2
    assert (quarters[2] - quarters[1] > 4) == jumps


@pytest.mark.parametrize('why', daily(['shock', 'shock, masked'], 'shock, masked'))
def test_a_line_goes_on_through_what_is_left_out(why):
    """Mirrored it has another phase there: a foot about it that is as wide as a gap is short."""
    t, line = np.arange(20_000) * DT, 2.345
    y = np.random.default_rng(9).standard_normal((len(t), 3))
    y[:, 0] += 2 * np.sin(2 * np.pi * line * t)
    record = ImuRecord(y, None, t, 1 / DT, left_out=tuple(
        (at, at + 3.0, why) for at in (20.0, 71.0, 133.0)))
    evidence = gather(record, ['gyro_x'])['gyro_x']
    part = evidence.whole
    assert len(evidence.block_power) == 1 + ('masked' not in why)
    assert len(evidence.cells) == 1 + len(evidence.block_power)     # and without lines
    near = np.abs(part.bins.f - line) < 0.3
    foot = np.average(part.power[near], weights=part.bins.count[near])
    assert foot == pytest.approx(2 * DT, rel=0.3)


@pytest.mark.thorough
def test_what_is_masked_is_seen_by_nothing():
    """Neither curve nor view nor effect, of no axis; the fit alone leaves out what was found."""
    rng, t = np.random.default_rng(5), np.arange(8000) * DT
    quiet = rng.standard_normal((len(t), 3))
    ring = (t > 50) * 80 * np.exp((50 - t) / 0.3) * np.sin(20 * t)
    left = (49.0, 55.0)
    shaken = ImuRecord(quiet + ring[:, None], None, t, 1 / DT)
    seen, masked = (
        gather(replace(shaken, left_out=((*left, why),)), ['gyro_x'])['gyro_x']
        for why in ('shock', 'shock, masked'))
    plain = gather(ImuRecord(quiet, None, t, 1 / DT), ['gyro_x'])['gyro_x']
    assert 'shock' in seen.statistics and set(masked.statistics) == set(plain.statistics)
    assert masked.curve.dev == pytest.approx(plain.curve.dev, rel=0.25)
    assert np.max(seen.curve.dev / masked.curve.dev) > 1.5
    assert len(masked.block_power) == 1
    others = [np.mean(x.common.pair('gyro_y', 'gyro_y', 'whole')) for x in (masked, plain)]
    assert others[0] == pytest.approx(others[1], rel=0.2)


@pytest.mark.parametrize('middle, q, more', [(0.2, 8, 10.0), seldom(0.4, 20, 60.0)])
def test_the_slow_side_of_a_swing_belongs_to_the_level(middle, q, more):
    rng = np.random.default_rng([49, q])
    n, (b, a) = 2 * N, swing(middle, q, more)
    y = robust.white(n, DT, rng) + robust.slow_noise(n, DT, rng)
    found = fit(axis_of(y + lfilter(b, a, robust.white(n, DT, rng))), model_of('noise', BASE))
    value, level = found.estimates['white']['N'], np.sqrt(1 + (b[0] / np.sum(a)) ** 2)
    assert found.details.basis.order.alone
    assert value.value == pytest.approx(robust.TRUTH['N'] * level, rel=0.008)
    assert value.ci95[1] / value.ci95[0] < 1.016


@pytest.mark.thorough
def test_a_half_rests_on_what_the_whole_rests_on():
    y, rng = noise(11)
    evidence = axis_of(robust.hump(y, DT, rng)[0])
    problem = NoiseProblem(evidence)
    whole = problem.point(model_of('noise', BASE))
    half = problem.split()[0][0].point(model_of('noise', BASE))
    ours, theirs = half.details.basis, whole.details.basis
    assert theirs is not None and ours.order == theirs.order
    assert np.array_equal(ours.f, theirs.f) and np.array_equal(ours.weight, theirs.weight)


# --- the parts -----------------------------------------------------------------------------------

def test_bands_are_half_octaves_that_hold_every_bin_once():
    bins = bins_of(50_000, 0.01)
    bands = Bands.on(bins)
    assert np.all(np.diff(bands.of) >= 0) and bands.of[-1] == bands.count - 1
    np.testing.assert_allclose(bands.sum(bins.count).sum(), 49_999)
    assert np.all(bands.high[20:-1] / bands.low[20:-1] < 1.6)
    np.testing.assert_allclose(bands.low[1:], bands.high[:-1])


def test_a_crossing_is_not_an_agreement():
    """A fit that goes through a falling spectrum agrees in one band's mean only."""
    bins = bins_of(50_000, 0.01)
    bands = Bands.on(bins)
    ratio = np.where(bins.f > 5, 20 / bins.f, 1.0)
    found = judge(bands, ratio, bins.count.astype(float))
    assert found.kept[bands.high < 5].all() and not found.kept[bands.low > 5].any()
    assert not found.weight[bins.f > 8].any()


@pytest.mark.parametrize('name, whole', [
    ('low_pass', True), ('shared_noise', True), ('gauss_markov', False)])
def test_what_is_told_in_bands_set_aside_is_taken_from_all_bins(name, whole, monkeypatch):
    """A filter, and what other axes hear of a peak: beside it either may be anything."""
    ends = [SimpleNamespace(likelihood=SimpleNamespace(model=model_of('noise', ('white', name))))
            for _ in range(2)]
    monkeypatch.setattr(resting, '_in_part', lambda found: 1000.0 * (found is ends[1]))
    monkeypatch.setattr(resting, '_most_of', lambda found: set())
    monkeypatch.setattr(resting, '_seen_in', lambda found: set())
    assert resting.more_explained(*ends) is ends[whole]


def test_lines_inside_a_band_are_set_aside_alone():
    bins = bins_of(50_000, 0.01)
    bands, ratio = Bands.on(bins), np.ones(len(bins.f))
    ratio[-20] = 50.0
    found = judge(bands, ratio, bins.count.astype(float))
    assert found.kept.all() and list(np.flatnonzero(found.weight == 0)) == [len(ratio) - 20]
    ((at, low, high),) = stretches(bands, found.weight > 0)
    assert list(at) == [len(ratio) - 20] and low < bins.f[-20] < high


def test_supported_bounds_what_a_band_can_cost():
    rng = np.random.default_rng(0)
    bins = bins_of(20_000, 0.01)
    bands, w = Bands.on(bins), bins.count.astype(float)
    power = rng.chisquare(w) / w
    true = supported(bands, power, w, np.ones(len(w)))
    assert true == pytest.approx(-0.5 * np.sum(w * power), abs=3 * COST)
    for scale in (3.0, 1e6):
        off = np.where(bands.of == bands.count - 3, scale, 1.0)
        assert true - 3 * COST < supported(bands, power, w, off) < true


def test_bin_weights_add_up_to_the_allan_variance():
    rng = np.random.default_rng(3)
    evidence = axis_of(rng.standard_normal(40_000))
    m = np.array([1, 4, 30])
    variance = bin_weights(evidence.whole.bins, m) @ evidence.whole.power
    np.testing.assert_allclose(variance, 1 / m, rtol=0.1)


# --- whether it matters, and what is written -----------------------------------------------------

def study_of(case, seed=3):
    """Return the study of a record whose first axis is disturbed."""
    y = [noise([seed, k]) for k in range(3)]
    first = case(*(y[0][0], DT, y[0][1]))[0]
    return analyse_record(record_of([first, y[1][0], y[2][0]]), keep_motion=True)


def strong_hump(y, dt, rng):
    """A hump ten times above the white noise, around 5 Hz."""
    b, a = butter(2, (0.15, 0.3), 'band')
    return y + 4 * lfilter(b, a, robust.white(len(y), dt, rng)), None


def faint_line(y, dt, rng):
    """A line of 2 % of a standard deviation: clear in the spectrum, nothing in the curve."""
    return y + 0.05 * np.std(np.diff(y)) * np.sin(2 * np.pi * 7 * np.arange(len(y)) * dt), None


def test_a_hump_matters_and_is_said_in_every_file():
    study = study_of(strong_hump)
    state = study.states['gyro_x']
    found = state.problem.matters(state.fit)
    assert not found.sufficient and found.largest_ratio > 1.05
    assert 0.2 < sum(found.shares.values()) < 1
    text = export.export(study, 'kalibr')
    assert '# gyro_x: model fails at' in text and 'times the curve at 1 s' in text
    assert 'keep-motion' in text and 'gyro_y: model fails' not in text
    values = covering(state)
    c = state.problem.evidence.curve
    some = (c.tau >= HORIZON[0]) & (c.tau <= HORIZON[1]) & (c.edf > 3)
    written = np.sqrt(values['N'] ** 2 / c.tau + values['K'] ** 2 * c.tau / 3)[some]
    assert np.all(written >= c.dev[some] * (1 - 1e-9))
    number = yaml.safe_load(text)['gyroscope_noise_density']
    assert number == pytest.approx(values['N'], rel=1e-5)


def test_limits_of_what_is_not_shown_widen_by_a_finite_factor():
    """Its most likely value may be next to nothing: a power of the ratio to it has no end."""
    slots = [SimpleNamespace(label=label, parameter=SimpleNamespace(name=name, log=True))
             for label, name in (('flicker', 'B'), ('white', 'N'))]
    found = {'flicker': {'B': Estimate(None, None, (0.0, 3e-5), 'rad/s', upper95=2e-5,
                                       point=1e-180)},
             'white': {'N': Estimate(1e-4, 1e-6, (0.9e-4, 1.1e-4), 'rad/s/sqrt(Hz)', point=1e-4)}}
    wide = widened(SimpleNamespace(slots=slots), found, np.array([2.25, 2.0]))
    b, n = wide['flicker']['B'], wide['white']['N']
    assert b.upper95 == pytest.approx(3e-5) and b.ci95 == pytest.approx((0.0, 4.5e-5))
    assert n.ci95 == pytest.approx((0.81e-4, 1.21e-4)) and n.std == pytest.approx(2e-6)


@pytest.mark.thorough
@pytest.mark.parametrize('kept', [True, False])
def test_what_keeps_motion_is_marked_in_every_file(kept):
    y = [noise([8, k])[0] for k in range(3)]
    study = analyse_record(record_of(y), keep_motion=kept)
    files = outputs(study)
    for name in ('study.yaml', 'report.html', 'imu.yaml'):
        assert (MOTION_KEPT in ' '.join(files[name].split()).replace('# ', '')) is kept, name
    head, first = files['allan.csv'].splitlines()[:2]
    assert head.endswith(',model,motion' if kept else ',model')
    assert first.endswith(',kept') is kept
    drawn = imread(BytesIO(pictures(study)['allan']))
    study.source.pop('keep_motion', None)
    plain = imread(BytesIO(pictures(study)['allan']))
    assert bool(np.any(drawn != plain)) is kept


def test_what_changes_no_curve_is_sufficient():
    study = study_of(faint_line)
    state = study.states['gyro_x']
    assert len(state.problem.evidence.line_table)           # it is there
    found = state.problem.matters(state.fit)
    assert found.sufficient and abs(np.log(found.largest_ratio)) < 0.05
    assert 'whose curve is not below' not in export.export(study, 'kalibr')


def test_nothing_hidden_is_sufficient_and_says_nothing():
    study = study_of(lambda y, dt, rng: (y, None))
    for state in study.states.values():
        found = state.problem.matters(state.fit)
        assert found.sufficient and found.largest_ratio == 1 and not found.failures
        assert state.problem.basis(state.fit) == {'sufficient': True}


def test_a_response_at_its_limit_leaves_every_spectrum_finite():
    """A half has bins of its own, and poles between those of the whole."""
    response = open_response(Order(2, 2)).with_values(a1=0.3, a2=-0.9, a3=-1.1, a4=0.7)
    for n in (400, 5000, 30_224):
        bins = bins_of(n, DT)
        assert np.all(np.isfinite(response.gain2(bins.f, DT)))
        assert np.all(np.isfinite(response.slopes(bins)))


@pytest.mark.parametrize('q', daily([20, 45], 20))
def test_a_half_behind_a_sharp_resonance_is_fitted(q):
    y, rng = noise(21)
    y = y + 12 * lfilter(*iirpeak(0.3, q), robust.white(N, DT, rng))
    problem = NoiseProblem(axis_of(y))
    whole = problem.point(model_of('noise', BASE))
    assert whole.details.basis is not None and whole.details.basis.order.terms
    for part in problem.split():
        for half in part:
            found = half.point(model_of('noise', BASE)).model
            assert found['white']['N'] == pytest.approx(robust.TRUTH['N'], rel=0.05)


@pytest.mark.thorough
def test_swings_that_come_and_go_are_no_spikes():
    """A band that swells every few seconds: its crests stay, and N is that of the curve at 1 s."""
    y, rng = noise(31)
    band = lfilter(*butter(2, (0.7, 0.9), 'band'), robust.white(N, DT, rng))
    swell = lfilter(*butter(2, 0.012), rng.standard_normal(N))
    y = y + 4 * band * np.minimum((swell / swell.std()) ** 2, 16)
    evidence = axis_of(y)
    bins = evidence.whole.bins
    slow = (bins.f > 1) & (bins.f < 5)
    level = np.average(evidence.whole.power[slow], weights=bins.count[slow])
    assert level == pytest.approx(2 * robust.TRUTH['N'] ** 2, rel=0.05)
    found = fit(evidence, model_of('noise', BASE)).estimates['white']['N']
    assert found.value == pytest.approx(robust.TRUTH['N'], rel=0.03)


@pytest.mark.thorough
def test_an_n_that_is_not_the_curve_at_1_s_says_so():
    """Swings about 0.5 Hz hold the curve there: N is below, and its note and exports tell it."""
    y, rng = noise(43)
    band = lfilter(*butter(2, (0.016, 0.024), 'band'), rng.standard_normal(N))
    problem = NoiseProblem(axis_of(y + 5e-4 * band / band.std()))
    said = problem.fit(model_of('noise', BASE)).estimates['white']['N']
    c = problem.evidence.curve
    assert np.interp(1, c.tau, c.dev) > 1.3 * said.value
    assert 'times the model' in said.note
    plain = NoiseProblem(axis_of(y)).fit(model_of('noise', BASE)).estimates['white']['N']
    assert plain.note == ''


@pytest.mark.thorough
def test_n_beside_a_changing_variance_says_which():
    """That of the whole where all of it is louder for a while, whether the model knows or not."""
    y, _ = noise(47)
    y[N // 2:N // 2 + N // 5] *= 1.8
    problem = NoiseProblem(axis_of(y))
    for effects in (BASE, (*BASE, 'variance_change')):
        n = problem.fit(model_of('noise', effects)).estimates['white']['N']
        assert 'mean over the whole record' in n.note
        assert n.value == pytest.approx(robust.TRUTH['N'] * (1 + 0.2 * (1.8**2 - 1)) ** 0.5,
                                        rel=0.03)
    quiet, loud = map(float, re.findall(r'(\S+) deg/sqrt\(h\) where', n.note))
    assert quiet * units.field('{rate}/sqrt(Hz)', 'gyro')[0] == pytest.approx(
        robust.TRUTH['N'], rel=0.03)
    assert loud == pytest.approx(1.8 * quiet, rel=0.05)
    idle = NoiseProblem(axis_of(noise(47)[0])).fit(model_of('noise', (*BASE, 'variance_change')))
    assert idle.estimates['white']['N'].note == ''


@pytest.mark.thorough
def test_what_is_switched_on_and_off_is_left_out_where_it_shows():
    """A machine that runs for a fifth of the time: N is that of the rest, B and K of it all."""
    y, rng = noise(41)
    begin, end = 30_000, 48_000
    machine = lfilter(*butter(2, (0.3, 0.6), 'band'), robust.white(N, DT, rng))
    y[begin:end] += 3 * machine[begin:end]
    evidence = axis_of(y)
    (first, last), = evidence.loud
    assert first <= begin * DT <= first + 30 and last - 30 <= end * DT <= last
    found = fit(evidence, model_of('noise', BASE))
    n = found.estimates['white']['N']
    assert n.ci95[0] < robust.TRUTH['N'] < n.ci95[1]
    assert n.ci95[1] / n.ci95[0] < 1.015 and np.isfinite(found.details.basis.quiet)
    assert f'{first:.4g} to {last:.4g} s' in ' '.join(found.flags)
    assert 'quiet part' in NoiseProblem(evidence).fit(found.model).estimates['white']['N'].note
    # the whole record's power is what is stated as not explained, and the halves rest on theirs
    assert any(s.low < 8 < s.high and s.ratio > 1.5 for s in found.details.set_aside)
    for part in ('first', 'second'):
        half = fit(evidence, model_of('noise', BASE), part, mean=found, intervals=False)
        assert half.model['white']['N'] == pytest.approx(robust.TRUTH['N'], rel=0.02)
    again = from_arrays(to_arrays({'gyro_x': evidence}))['gyro_x']
    assert np.array_equal(again.loud, evidence.loud)
    assert fit(again, model_of('noise', BASE)).model['white'] == found.model['white']


@pytest.mark.thorough
@pytest.mark.parametrize('seed', (1, 2))
def test_noise_that_is_most_of_what_is_set_aside_is_not_lost_there(seed):
    """An angle's rounding beside a process that the model lacks: 99 % of the power is its."""
    rng, n, rate = np.random.default_rng([79, seed]), 150_000, 100.0
    r = np.exp(-1 / (0.16 * rate))
    slow = lfilter([np.sqrt(1 - r * r)], [1, -r], rng.standard_normal(n))
    y = 2.2e-4 * rng.standard_normal(n) + 1e-4 * slow \
        + 2.1e-3 * np.diff(rng.uniform(-0.5, 0.5, n + 1))
    problem = NoiseProblem(axis_of(y, 1 / rate))
    assert problem.point(model_of('noise', BASE)).details.set_aside
    found = problem.point(model_of('noise', (*BASE, 'quantization')))
    assert found.model['quantization']['Q'] == pytest.approx(2.1e-5 / np.sqrt(12), rel=0.15)


@pytest.mark.thorough
@pytest.mark.parametrize('seed', (0, 3))
def test_a_fit_begun_behind_an_open_response_keeps_the_noise_that_it_had_there(seed):
    """Means of three samples, of which the model knows nothing, and a process that it knows."""
    rng, n, rate = np.random.default_rng([80, seed]), 54_000, 50.0
    r = np.exp(-1 / (1.6 * rate))
    slow = lfilter([np.sqrt(1 - r * r)], [1, -r], rng.standard_normal(n + 2))
    y = 3.5e-4 * rng.standard_normal(n + 2) + 2e-4 * slow
    evidence = axis_of(np.convolve(y, np.ones(3) / 3, 'valid'), 1 / rate)
    model = model_of('noise', (*BASE, 'gauss_markov'))
    first = fit(evidence, model, intervals=False)
    assert first.details.basis.order.terms and first.model['gauss_markov']['sigma'] > 1e-4
    again = fit(evidence, model, intervals=False, start=first.model, hint=first.details.hint)
    assert again.model['gauss_markov']['sigma'] == pytest.approx(
        first.model['gauss_markov']['sigma'], rel=0.05)


def test_what_the_model_knows_is_not_left_out():
    """With the band that is switched on in the model, its power is that of the whole record."""
    y, rng = noise(42)
    begin, end = 20_000, 40_000
    y[begin:end] += 2 * lfilter(*iirpeak(0.4, 8), robust.white(N, DT, rng))[begin:end]
    evidence = axis_of(y)
    assert len(evidence.loud) == 1
    found = fit(evidence, model_of('noise', (*BASE, 'narrowband')))
    assert found.details.basis is None or not np.isfinite(found.details.basis.quiet)


@pytest.mark.thorough
def test_what_is_left_open_beside_a_model_is_no_filter_that_holds_what_is_switched_on():
    """A rising floor, as loud as the noise, on now and then: N is that of the rest."""
    rng, n = np.random.default_rng(3), N // 2
    y = robust.white(n, DT, rng) + robust.slow_noise(n, DT, rng)
    share = np.arange(n) / n
    on = ((share > 0.2) & (share < 0.45)) | ((share > 0.6) & (share < 0.72))
    rising = 2 * np.std(np.diff(y)) * lfilter(*butter(1, 0.1, 'high'), rng.standard_normal(n))
    found = fit(axis_of(y + on * rising), model_of('noise', BASE))
    assert found.model['white']['N'] == pytest.approx(robust.TRUTH['N'], rel=0.01)


@pytest.mark.thorough
@pytest.mark.parametrize('seed', (1, 3))
def test_a_machine_that_is_switched_on_is_where_it_is_loud(seed):
    """Its speed wanders, so that no resonance is of quite its form; in quiet there is no peak."""
    y, rng = noise([71, seed])
    r = np.exp(-DT / 10)
    wanders = lfilter([np.sqrt(1 - r * r)], [1, -r], rng.standard_normal(N))
    share = np.arange(N) / N
    on = ((share > 0.2) & (share < 0.45)) | ((share > 0.6) & (share < 0.72))
    swing = on * np.sin(2 * np.pi * np.cumsum(0.35 / DT + 0.1 * wanders) * DT)
    evidence = axis_of(y + 0.8 * np.std(np.diff(y)) * swing)
    assert len(evidence.loud) == 2
    found = fit(evidence, model_of('noise', (*BASE, 'narrowband'))).model['narrowband']
    assert found['frequency'] == pytest.approx(0.35 / DT, abs=0.1)
    assert found['rms'] == pytest.approx(0.8 * np.std(np.diff(y)) * np.std(swing), rel=0.1)


@pytest.mark.parametrize('seed', daily(range(4), 0))
def test_nothing_is_switched_on_where_noise_is_steady(seed):
    y, rng = noise([43, seed])
    lines = y + 1e-3 * np.sin(2 * np.pi * 3.3 * DT * np.arange(N))
    narrow = y + 5 * lfilter(*iirpeak(0.3, 400), robust.white(N, DT, rng))
    for some in (y, lines, narrow, lfilter(*butter(2, 0.3), y)):
        evidence = axis_of(some)
        assert not len(evidence.loud) and not evidence.whole.quiet.size


def test_two_machines_leave_the_quiet_between_them():
    count = np.full(6, 40)
    power = np.random.default_rng(44).chisquare(40, (200, 6)) / 40
    power[30:50, 4] *= 4
    power[120:160, 2:5] *= 3
    found = loud_stretches(power, count)
    assert len(found) == 2      # and a window more on either side
    for (a, b), (first, last) in zip(found, ((30, 50), (120, 160))):
        assert first - 4 <= a < first and last < b <= last + 4
    power = np.random.default_rng(45).chisquare(40, (200, 6)) / 40
    power[:150, 1] *= 5         # what runs for most of the time is the record
    assert not len(loud_stretches(power, count))


@pytest.mark.thorough
@pytest.mark.parametrize('low, high, more', [(0.016, 0.1, 18.7)])
def test_a_low_and_wide_hump_leaves_n(low, high, more):
    """What is left at both ends of it is little, and its skirts reach down to the drift."""
    rng = np.random.default_rng([46, int(100 * more)])
    n = 2 * N
    y = robust.white(n, DT, rng) + robust.slow_noise(n, DT, rng)
    y += np.sqrt(more) * lfilter(*butter(2, (low, high), 'band'), robust.white(n, DT, rng))
    found = fit(axis_of(y), model_of('noise', BASE)).estimates['white']['N']
    assert found.value == pytest.approx(robust.TRUTH['N'], rel=0.02)
    assert found.ci95[1] / found.ci95[0] < 1.05


@pytest.mark.parametrize('low, high, more', [(0.05, 0.3, 7.0), (0.004, 0.03, 25.0)])
def test_the_response_beside_a_band_is_that_of_the_band(low, high, more):
    order, values = beside_a_band(low, high, more)
    response = open_response(order)
    response = response.with_values(**{p.name: v for p, v in zip(response.parameters, values)})
    f = np.linspace(0.01, 0.49, 60)
    gain = np.abs(freqz(*butter(2, (low, high), 'band'), worN=2 * np.pi * f)[1]) ** 2
    assert response.gain2(f, 1.0) == pytest.approx(1 + more * gain, rel=1e-4)
    assert len(values) == order.terms == 5
    for other in (o for o in order.rivals if o.tied or not o.alone):
        back = raised_to(order, other, raised_to(other, order, values))
        assert back == pytest.approx(values, rel=1e-6)


def test_a_lower_order_is_raised_into_the_variable_of_a_band():
    lower, order = Order(2, 2), Order(4, 4, False, 0.01)
    f, gains = np.linspace(0.001, 0.49, 60), []
    for one, values in ((lower, np.array([3.0, 1.0, 5.0, 2.0])), (order, None)):
        if values is None:
            values = raised_to(order, lower, gains[0][1])
        response = open_response(one)
        response = response.with_values(
            **{p.name: v for p, v in zip(response.parameters, values)})
        gains.append((response.gain2(f, 1.0), values))
    assert gains[1][0] == pytest.approx(gains[0][0], rel=1e-6)


@pytest.mark.thorough
@pytest.mark.parametrize('middle, octaves, more', [(0.12, 3.0, 6.0), (0.13, 2.8, 29.0)])
def test_holes_do_not_stand_where_a_response_tells_more(middle, octaves, more):
    """Between such a hump's skirts and drift little white noise is left: its form tells N."""
    rng, half = np.random.default_rng([48, int(more)]), 2 ** (octaves / 2)
    n = 2 * N
    y = robust.white(n, DT, rng) + robust.slow_noise(n, DT, rng)
    edges = (middle / half, middle * half)
    y += np.sqrt(more) * lfilter(*butter(2, edges, 'band'), robust.white(n, DT, rng))
    found = fit(axis_of(y), model_of('noise', BASE))
    value = found.estimates['white']['N']
    assert found.details.basis.order.tied
    assert value.value == pytest.approx(robust.TRUTH['N'], rel=0.02)
    assert value.ci95[1] / value.ci95[0] < 1.03


@pytest.mark.parametrize('seed', [1, 2])
def test_white_noise_that_is_not_told_from_drift_has_a_value(seed):
    """Every sensor has some: its interval reaches zero, its value does not."""
    rng = np.random.default_rng([47, seed])
    y = robust.white(600, DT, rng) + 80 * robust.slow_noise(600, DT, rng)
    found = fit(axis_of(y), model_of('noise', BASE)).estimates['white']['N']
    assert found.ci95[0] == 0 and found.value is not None and found.upper95 is None
    assert 0.3 < found.value / robust.TRUTH['N'] < 3 and robust.TRUTH['N'] < found.ci95[1]
    assert 'every sensor' in found.note


@pytest.mark.parametrize('gain', [0.5, 2.0])
def test_what_a_fit_explains_has_what_couplings_miss_of_their_sources(gain):
    """Other axes that hear a source below their own noise miss the more of it the larger gains."""
    rng, n, dt = np.random.default_rng([61, round(10 * gain)]), 20_000, 0.01
    gyro = 1e-3 * (rng.standard_normal((n, 3)) + rng.standard_normal((n, 1)) * [gain, 1.0, -0.8])
    evidence = gather(ImuRecord(gyro, None, np.arange(n) * dt, 1 / dt), ['gyro_x'])['gyro_x']
    made = fit(evidence, model_of('noise', ('white', 'shared_noise')), intervals=False)
    shared = made.model['shared_noise']
    likelihood = Likelihood(evidence, 'whole', model_of('noise', ('white',)).plus(
        type(shared)({k: shared[k] for k in ('source', 'other', 'heard')})))
    missed = np.full(len(likelihood.power), 1e-6)
    likelihood.channels.spreads = {c: missed for c in shared.channels(evidence)}
    x = np.array([np.log(1e-4)])
    nll, linear, v, _ = likelihood.value(x)
    assert np.all(v > 2 * likelihood.spectra(likelihood.with_search(x))[0])
    wanted = supported(Bands.on(likelihood.bins), linear.power, likelihood.full_weight, v,
                       resting._BAND, partly=True)
    assert resting._in_part(Found(likelihood, x, nll, None)) == pytest.approx(wanted)
