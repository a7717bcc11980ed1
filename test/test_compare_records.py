# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Two records of one sensor beside each other: what changed, and what chance does."""

from types import SimpleNamespace

import calibration_sessions as sim
import numpy as np
import pytest

from imu_noise_tools import calibration
from imu_noise_tools.cli import text
from imu_noise_tools.core.errors import InputError
from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.filter.fitting import _covariance
from imu_noise_tools.filter.problem import problem_of
from imu_noise_tools.loop.effect import Estimate, find_effect, model_of
from imu_noise_tools.loop.study import Study
from imu_noise_tools.noise.differences import as_sigmas
from imu_noise_tools.tasks.calibration import study_of
from imu_noise_tools.tasks.compare import _apart, _on_scale, compare_two, limit
from imu_noise_tools.tasks.noise import analyse_record

N, K = 1e-4, 5e-5


def study(seed, seconds, rate=100, n=N, line=0.0):
    rng = np.random.default_rng(seed)
    t = np.arange(int(seconds * rate)) / rate
    y = n * np.sqrt(rate) * rng.standard_normal((len(t), 3))
    y += K / np.sqrt(rate) * np.cumsum(rng.standard_normal((len(t), 3)), axis=0)
    y += line * np.sin(2 * np.pi * 7.3 * t + 1.0)[:, None]
    return analyse_record(ImuRecord(y, None, t, rate), axes=('gyro_x',))


def changed(rows):
    return [r['what'] for r in rows if r['verdict'] == 'changed']


@pytest.mark.thorough
def test_nothing_has_changed_where_lengths_and_rates_differ():
    """Of four pairs not one row is: a mean of logarithms found 5 sigma in most."""
    short = study(1, 85)
    assert not changed(compare_two(short, study(2, 180)))
    assert not changed(compare_two(study(3, 300), short))
    assert not changed(compare_two(short, study(4, 120, rate=200)))
    power = [float(r['second']) for r in compare_two(short, study(5, 180))
             if r['what'].startswith('power')]
    assert len(power) == 6 and abs(power[-1] - 1) < 0.1     # 3300 coefficients of the shorter


@pytest.mark.thorough
def test_white_noise_and_lines_that_differ_are_told():
    first = study(11, 180, line=2e-4)
    assert 'white.N' in changed(compare_two(first, study(12, 300, n=1.1 * N, line=2e-4)))
    louder = compare_two(first, study(13, 300, line=3e-4))
    assert [w[:8] for w in changed(louder)] == ['line 7.3']
    gone = compare_two(first, study(14, 300))
    assert [w[:8] for w in changed(gone)] == ['line 7.3']
    row = next(r for r in gone if r['what'].startswith('line'))
    assert row['second'].startswith('< ') and row['unit'] == 'rad/s'
    assert row['unit_shown'] == 'deg/h'


def test_sigmas_of_a_ratio_are_those_of_its_tail():
    """As often as such ratios are drawn."""
    rng = np.random.default_rng(5)
    for w, v in ((2, 40), (7, 7), (300, 20)):
        drawn = rng.chisquare(w, 10_000) / w / (rng.chisquare(v, 10_000) / v)
        z = np.array([as_sigmas(float(x), w, v) for x in drawn])
        assert np.mean(z > 2) == pytest.approx(0.0228, abs=0.006)
        assert np.mean(z < -2) == pytest.approx(0.0228, abs=0.006)


def test_intervals_count_towards_each_other():
    of = find_effect('noise', 'random_walk').parameters[0]
    small = Estimate(1.0, 0.5, (0.5, 4.0))
    large = Estimate(4.0, 1.0, (2.0, 5.0))
    # ln 4 apart, deviations ln 4/1.96 and ln 2/1.96
    assert _on_scale(np.log, small, large) == pytest.approx(1.96 * 2 / np.sqrt(5))
    assert _on_scale(np.log, large, small) == pytest.approx(-1.96 * 2 / np.sqrt(5))
    # by power 15 apart, deviations 15/1.96 and 12/1.96: the scale on which they are nearer counts
    assert _apart(of, small, large) == pytest.approx(1.96 * 15 / np.hypot(15, 12))
    assert _apart(of, large, small) == pytest.approx(-1.96 * 15 / np.hypot(15, 12))
    hidden = Estimate(None, None, (0.0, 1.2), upper95=1.0)
    # limits at 1.645 and 1.96 deviations: ln 1.2/.315 = .579 each, the middle at -1.645 of them
    assert _on_scale(np.log, hidden, small) == pytest.approx(1.645 * .579 / np.hypot(
        np.log(2) / 1.96, .579), rel=1e-3)
    assert _apart(of, hidden, large) > 1.96
    assert _apart(of, hidden, hidden) is None


def test_an_amplitude_beside_stronger_noise_is_no_further_from_none_than_its_power_says():
    """An interval from 1 to 2 is 4/3 of 1.96 deviations of its power above zero, 1/0.3 of ln."""
    of = find_effect('noise', 'flicker').parameters[0]
    seen = Estimate(2.0, 0.5, (1.0, 3.0))
    none = Estimate(None, None, (0.0, 1.01e-3), upper95=1e-3)
    assert _apart(of, seen, none) == pytest.approx(-1.96 * 4 / 3, rel=1e-3)
    assert _apart(of, none, seen) == pytest.approx(1.96 * 4 / 3, rel=1e-3)
    assert _on_scale(np.log, seen, none) < -15
    # down to nothing: by the logarithm it may be anything
    assert _apart(of, Estimate(2.0, 1.0, (0.0, 3.0)), none) == 0


def quantised(rate, seconds, seed, step=1.5e-3, mean=0.3):
    rng = np.random.default_rng(seed)
    n = int(rate * seconds)
    y = step * np.round(N * np.sqrt(rate) * rng.standard_normal((n, 3)) / step + mean)
    return analyse_record(ImuRecord(y, None, np.arange(n) / rate, rate), axes=('gyro_x',))


def test_rounding_is_no_change_where_rates_differ():
    """It adds step^2/(12 rate) to N^2: 5 % of N at 200 Hz, 17 % at 50 Hz."""
    slow = quantised(50, 200, 21)
    rows = compare_two(slow, quantised(200, 100, 22))
    assert not changed(rows)
    row = rows[0]
    assert row['what'] == 'white.N less rounding' and abs(float(row['sigmas'])) < 3
    for value in (row['first'], row['second']):
        assert float(value.split()[0]) == pytest.approx(N, rel=0.04)
    assert float(rows[-1]['second']) == pytest.approx(1, abs=0.06)
    # no step is a change, and is told
    assert 'white.N' in changed(compare_two(slow, quantised(200, 100, 23, step=1e-6)))


def test_another_bias_is_no_other_noise_of_a_coarse_grid():
    """Noise of 0.4 steps has a quarter more power where the mean is between two levels."""
    first = quantised(100, 100, 31, step=2.5e-3, mean=0.0)
    rows = compare_two(first, quantised(100, 100, 32, step=2.5e-3, mean=0.5))
    assert not changed(rows) and rows[0]['what'] == 'white.N'
    ratio = float(rows[0]['second'].split()[0]) / float(rows[0]['first'].split()[0])
    assert ratio == pytest.approx(1.13, abs=0.03)


def filtered(rate, seed, moved=0.0):
    rng = np.random.default_rng(seed)
    t = np.arange(int(10 * rate)) / rate
    z = N * np.sqrt(rate) * rng.standard_normal(len(t)) + moved * np.sin(9 * t)
    motion = 'any_motion' if moved else 'constant_rate'
    return Study.begin({'gyro_x': problem_of(t, z, 'gyro_x')},
                       model_of('filter', (motion, 'white')), {})


def test_the_variance_of_a_filters_samples_is_compared_at_one_rate():
    row, = (r for r in compare_two(filtered(100, 41), filtered(200, 42)))
    assert row['what'] == 'white.R at 100 Hz' and row['verdict'] == 'the same'
    assert float(row['second'].split()[0]) == pytest.approx(N**2 * 100, rel=0.15)


def test_what_a_bank_in_motion_calls_noise_is_not_compared():
    problem = filtered(100, 43, moved=1.0).states['gyro_x']
    rows = problem.problem.comparable({'gyro_x': problem.fit}, problem.problem,
                                      {'gyro_x': problem.fit})
    assert all(e.std is None for e in rows['white', 'R'][1:])


def test_parameters_that_go_together_are_not_too_sure():
    """Of a narrow ridge with a skew, which differences to one side take for a wider angle."""
    exact = np.array([[1.0, 0.9], [0.9, 1.0]])

    def evaluate(points):
        x = np.array(points)
        return (-0.5 * np.einsum('ki,ij,kj->k', x, np.linalg.inv(exact), x)
                + 2.0 * x[:, 0]**2 * x[:, 1])

    evaluate.span = 1.0
    free = SimpleNamespace(scale=lambda span: np.array([0.5, 0.5]), at=lambda x: x)
    assert _covariance(free, np.zeros(2), 0.0, evaluate) == pytest.approx(exact)


def test_a_row_is_a_line_of_80_columns(monkeypatch):
    monkeypatch.setenv('COLUMNS', '80')
    row = {'target': 'accel_x', 'what': 'power 0.00417 to 0.0199 Hz', 'first': '1', 'unit': 'x',
           'second': '1.2', 'first_shown': '0.3426 +- 0.0022', 'second_shown': '0.3426 +- 0.0022',
           'unit_shown': 'deg/sqrt(h)', 'sigmas': '+11.0', 'verdict': 'changed'}
    said = text.changes([row, {**row, 'sigmas': '', 'verdict': 'not to be told'}], 'a', 'b')
    assert len(said.split('\n')) == 12 and max(map(len, said.split('\n'))) <= 80
    assert said.endswith('accel_x: power 0.00417 to 0.0199 Hz')


def test_the_limit_goes_with_the_rows():
    rows = [{'sigmas': 0.0}] * 50 + [{'sigmas': None}] * 9
    assert limit(rows) == pytest.approx(3.7190, abs=1e-3)       # 1e-4 on either side
    row = {'target': 'gyro_x', 'what': 'white.N', 'first': '1', 'second': '2', 'unit': 'x',
           'first_shown': '1', 'second_shown': '2', 'unit_shown': 'y', 'sigmas': '+1.0',
           'verdict': 'the same'}
    assert 'more than 3.7 sigma' in text.changes([row] * 50, 'a', 'b')


def test_studies_of_different_kinds_are_named():
    one, other = (SimpleNamespace(domain=d, targets=('gyro_x',)) for d in ('noise', 'calibration'))
    with pytest.raises(InputError, match='a noise study, the second a calibration study'):
        compare_two(one, other)
    with pytest.raises(InputError, match='no target in common'):
        compare_two(one, SimpleNamespace(domain='noise', targets=('accel_x',)))


def test_calibrations_are_compared_in_the_units_and_digits_that_calibrate_prints():
    """A scale factor to 1e-4 has five decimals; a bias is in m/s^2, not in ug."""
    rng = np.random.default_rng(3)
    some = []
    for bias in (0.1, 0.13):
        device = sim.Device(bias=np.array([bias, 0.0, 0.0]), noise=1e-3)
        true = sim.G * sim.spread_directions(16, rng)
        poses = calibration.Poses.of('accel', device.output(true, rng).T, device.noise, sim.G)
        some.append(study_of(calibration.calibrate(poses)))
    row = {r['what']: r for r in compare_two(*some)}
    assert row['bias.b_x']['unit_shown'] == 'm/s^2' and row['bias.b_x']['verdict'] == 'changed'
    assert float(row['bias.b_x']['first_shown'].split()[0]) == pytest.approx(0.1, abs=0.005)
    value, _, std = row['scale.S_xx']['first_shown'].split()
    assert float(std) < 2e-4 and len(value.partition('.')[2]) >= 5
