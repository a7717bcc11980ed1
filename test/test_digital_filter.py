# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Filters of the sensor that have no usual form: seen in all of its axes alike."""

import numpy as np
from params import daily
import pytest
from scipy.signal import butter, cheby2, ellip, firwin, freqz, lfilter

from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.core.spectrum import bins_of
from imu_noise_tools.loop.effect import find_effect, model_of
from imu_noise_tools.loop.study import assess
from imu_noise_tools.noise.effects.digital_filter import _cosines, BENDS, DigitalFilter
from imu_noise_tools.noise.gather import gather
from imu_noise_tools.noise.problem import NoiseProblem
from imu_noise_tools.tasks.noise import analyse_record

RATE = 200.0
TIMES = 8   # the rate inside the sensor over that of its output
FILTERS = {
    'Butterworth 3': butter(3, 60, fs=TIMES * RATE),
    'Chebyshev II': cheby2(4, 40, 90, fs=TIMES * RATE),
    'elliptic': ellip(3, 0.5, 30, 55, fs=TIMES * RATE),
    'decimator': (firwin(47, 60, fs=TIMES * RATE), 1.0),
}


def record_of(rng, seconds, *filters):
    """Return a gyroscope whose axes are white noise of three levels, each behind a filter."""
    n = int(seconds * RATE)
    white = rng.standard_normal((TIMES * n, 3)) * [1e-3, 2e-3, 1.3e-3]
    gyro = np.column_stack([lfilter(*f, x)[::TIMES] for f, x in zip(filters, white.T)])
    return ImuRecord(gyro, None, np.arange(n) / RATE, RATE)


def start(record, axes=('gyro_x', 'gyro_y', 'gyro_z')):
    """Return where a fit of the first axis would start."""
    return DigitalFilter({}).starts(gather(record, list(axes))['gyro_x'])


@pytest.mark.parametrize('name', daily(FILTERS, 'Butterworth 3', 'decimator'))
def test_a_fit_starts_at_the_filter(name):
    """Within 2 % of ln gain^2 in the mean, its -3 dB within 1 Hz."""
    rng = np.random.default_rng([*FILTERS].index(name))
    (found,) = start(record_of(rng, 300, *[FILTERS[name]] * 3))
    f = np.linspace(0.5, 99.5, 300)
    folded = np.add.outer(RATE * np.arange(TIMES), f)
    true = np.log(np.sum(np.abs(freqz(*FILTERS[name], folded, fs=TIMES * RATE)[1]) ** 2, axis=0))
    seen = np.log(found.gain2(f, 1 / RATE))
    assert np.mean((seen - true) ** 2) < 0.02 * np.var(true)
    assert found['cutoff'] == pytest.approx(f[np.argmax(true < np.log(0.5))], abs=1.0)


@pytest.mark.thorough
def test_what_the_axes_do_not_share_is_no_filter_of_the_sensor():
    """Another fall in each axis, a flat spectrum, one source in two axes, a single axis."""
    rng = np.random.default_rng(4)
    flat, steep, soft = (1.0, 1.0), FILTERS['Butterworth 3'], butter(1, 15, fs=TIMES * RATE)
    assert not start(record_of(rng, 120, steep, flat, soft))
    assert not start(record_of(rng, 120, flat, flat, flat))
    one = record_of(rng, 120, steep, steep, flat).gyro.copy()
    one[:, 1] = 2 * one[:, 0] + 1e-5 * one[:, 1]
    t = np.arange(len(one)) / RATE
    assert not start(ImuRecord(one, None, t, RATE))
    one[:, 1:] = 0
    assert not start(ImuRecord(one, None, t, RATE), axes=['gyro_x'])


def test_a_rise_is_no_low_pass():
    rng = np.random.default_rng(5)
    assert not start(record_of(rng, 120, *[([1.0, *[0.0] * (TIMES - 1), -0.6], 1.0)] * 3))


def test_the_cutoff_is_where_half_of_the_power_passes():
    rng = np.random.default_rng(6)
    for _ in range(20):
        bends = dict(zip(BENDS, rng.normal(0, 0.3, len(BENDS))))
        cutoff = float(rng.uniform(5, 95))
        effect = DigitalFilter({'cutoff': cutoff, **bends})
        assert effect.gain2(np.array([0.0, cutoff]), 1 / RATE) == pytest.approx([1.0, 0.5])


def test_cosines_are_those_of_the_spectrum():
    """Of a power without noise, to rounding."""
    bins, rng = bins_of(40_000, 1 / RATE), np.random.default_rng(7)
    effect = DigitalFilter({'cutoff': 40.0, **dict(zip(BENDS, rng.normal(0, 0.3, len(BENDS))))})
    power = 3.0 * effect.gain2(bins.f, bins.dt)
    np.testing.assert_allclose(_cosines(bins, power)[1:], [effect[b] for b in BENDS], atol=1e-6)


@pytest.mark.parametrize('taps', [
    firwin(63, 0.3, window=('kaiser', 12)),
    pytest.param(butter(10, 0.3), marks=pytest.mark.thorough)], ids=['FIR', 'Butterworth 10'])
def test_a_deep_stop_band_leaves_the_error_its_scatter(taps):
    """By chance it was up to 1e20, so that a misfit was none: ln L is no parabola there."""
    b, a = taps if isinstance(taps, tuple) else (taps, 1.0)
    white = np.random.default_rng(1).standard_normal((24_400, 3))
    gyro = 1e-3 * lfilter(b, a, white, axis=0)[400:]
    record = ImuRecord(gyro, None, np.arange(24_000) / 400.0, 400.0)
    evidence = gather(record, ['gyro_x'])['gyro_x']
    model = model_of('noise', ['white', 'digital_filter'])
    error = assess(NoiseProblem(evidence), model, intervals=False).error
    assert 'frequency' in error.failing and error.excess > 10, 'a filter so steep has no such form'
    assert error.std < 0.2 and error.views['frequency'].std < 0.3


def test_a_step_between_two_bins_is_no_band():
    """What falls so steeply stands out of its surroundings there, where no bin has its middle."""
    record = record_of(np.random.default_rng([11, 1]), 600, *[FILTERS['Chebyshev II']] * 3)
    assert find_effect('noise', 'band')().starts(gather(record, ['gyro_y'])['gyro_y']) == []


@pytest.mark.thorough
@pytest.mark.parametrize('name', FILTERS)
def test_it_is_found_and_nothing_else_is(name):
    rng = np.random.default_rng([11, [*FILTERS].index(name)])
    record = record_of(rng, 600, *[FILTERS[name]] * 3)
    found = analyse_record(record, keep_motion=True).diagnose(['gyro_y'])['gyro_y']
    assert [f.name for f in found.found] == ['digital_filter']


@pytest.mark.thorough
def test_a_usual_form_is_named_where_it_is_as_good():
    rng = np.random.default_rng(12)
    record = record_of(rng, 600, *[butter(2, 30, fs=TIMES * RATE)] * 3)
    found = analyse_record(record, keep_motion=True).diagnose(['gyro_y'])['gyro_y']
    assert [f.name for f in found.found] == ['low_pass']
