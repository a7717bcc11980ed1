# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Two records of one sensor beside each other: what changed, and what chance does."""

from types import SimpleNamespace

import numpy as np
import pytest

from imu_noise_tools.cli import text
from imu_noise_tools.core.errors import InputError
from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.loop.effect import Estimate, find_effect
from imu_noise_tools.noise.differences import as_sigmas
from imu_noise_tools.tasks.compare import _apart, compare_two, limit
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
    assert _apart(of, small, large) == pytest.approx(1.96 * 2 / np.sqrt(5))
    assert _apart(of, large, small) == pytest.approx(-1.96 * 2 / np.sqrt(5))
    hidden = Estimate(None, None, (0.0, 1.2), upper95=1.0)
    # limits at 1.645 and 1.96 deviations: ln 1.2/.315 = .579 each, the middle at -1.645 of them
    assert _apart(of, hidden, small) == pytest.approx(1.645 * .579 / np.hypot(
        np.log(2) / 1.96, .579), rel=1e-3)
    assert _apart(of, hidden, large) > 1.96
    assert _apart(of, hidden, hidden) is None


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
