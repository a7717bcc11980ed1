# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""SI and the field's units, by conversions worked out by hand."""

from __future__ import annotations

import math

from hypothesis import given, strategies as st
import pytest

from imu_noise_tools.core import units


@pytest.mark.parametrize(('template', 'sensor', 'si'), [
    ('{rate}', 'gyro', 'rad/s'), ('{rate}', 'accel', 'm/s^2'),
    ('{rate}/sqrt(Hz)', 'gyro', 'rad/s/sqrt(Hz)'), ('{rate}/sqrt(Hz)', 'accel', 'm/s^2/sqrt(Hz)'),
    ('{slope}/sqrt(Hz)', 'gyro', 'rad/s^2/sqrt(Hz)'), ('{slope}', 'accel', 'm/s^3'),
    ('{integral}', 'gyro', 'rad'), ('{integral}', 'accel', 'm/s'), ('Hz', 'gyro', 'Hz'),
    ('s', 'accel', 's')])
def test_si(template, sensor, si):
    assert units.si(template, sensor) == si


@pytest.mark.parametrize(('value', 'template', 'sensor', 'shown'), [
    # 0.005 deg/s/sqrt(Hz) is 0.3 deg/sqrt(h): sqrt(3600) = 60
    (0.005 * math.pi / 180, '{rate}/sqrt(Hz)', 'gyro', '0.3 deg/sqrt(h)'),
    # 4.848 microradians are one second of arc
    (math.pi / 180 / 3600, '{integral}', 'gyro', '1 arcsec'),
    (15.04 / 3600 * math.pi / 180, '{rate}', 'gyro', '15 deg/h'),
    # 1 deg/h/sqrt(h) = (pi/180/3600)/60 rad/s/sqrt(s)
    (math.pi / 180 / 3600 / 60, '{slope}/sqrt(Hz)', 'gyro', '1 deg/h^1.5'),
    (math.pi / 180 / 3600 / 3600, '{slope}', 'gyro', '1 deg/h^2'),
    (400e-6 * 9.80665, '{rate}/sqrt(Hz)', 'accel', '400 ug/sqrt(Hz)'),
    (9.80665e-6, '{rate}', 'accel', '1 ug'),
    (1 / 3600 ** 1.5, '{slope}/sqrt(Hz)', 'accel', '1 m/s/h^1.5'),
    (9.80665e-6 / 3600, '{slope}', 'accel', '1 ug/h'),
    (0.25, '{integral}', 'accel', '0.25 m/s'),
    (12.5, 'Hz', 'gyro', '12.5 Hz')])
def test_shown(value, template, sensor, shown):
    assert units.shown(value, template, sensor) == shown


def test_nothing_to_show():
    assert units.shown(None, '{rate}', 'gyro') == 'not observable'


@given(st.sampled_from(sorted(units._FIELD)), st.floats(1e-12, 1e6))
def test_shown_is_the_value(key, value):
    """Three digits survive the way to the field's unit and back."""
    sensor, template = key
    factor, unit = units.field(template, sensor)
    number, _, name = units.shown(value, template, sensor).partition(' ')
    assert name == unit
    assert float(number) * factor == pytest.approx(value, rel=5e-3)
