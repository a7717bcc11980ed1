# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Gazebo's noise of an imu sensor in SDF: sigma of a sample, and a bias that walks.

Source: gazebosim/gz-sensors at 9ba02f2410, src/GaussianNoiseModel.cc:114-140: stddev is drawn at
each sample (N sqrt(f)); the bias is a Gauss-Markov process of dynamic_bias_correlation_time tau
whose step has the variance -s^2 tau/2 expm1(-2 dt/tau), about s^2 dt: dynamic_bias_stddev s is K,
not the scatter of the bias, which is s sqrt(tau/2).

"""

from __future__ import annotations

from xml.sax.saxutils import escape

from ._numbers import Numbers
from ._values import number
from ..loop.study import Study

CONSUMER = 'gazebosim/gz-sensors'
HOLDS = 'N sqrt(f), K'
HOW = 'x, y, z; K with a correlation time'
#: file, lines, commit
PLACES = (
    ('src/GaussianNoiseModel.cc', '114-140', '9ba02f2410'),
)
DESCRIPTION = 'Gazebo SDF <imu> noise block: stddev (N sqrt f), dynamic_bias_stddev (K)'
CORRELATION_S = 3600.0      # the one that the SDF specification names as typical
ELEMENTS = (('angular_velocity', 'gyro'), ('linear_acceleration', 'accel'))


def text(study: Study, axes: str = 'worst', inflate: float = 1.0,
         horizon: float | None = None) -> str:
    """Return an <imu> element for x, y and z."""
    numbers = Numbers(study, axes, inflate, horizon)
    said = numbers.about('Gazebo: stddev is of a sample at update_rate, N sqrt(f); '
                         'dynamic_bias_stddev is K, with a correlation time that hardly ends it')
    comment = '\n'.join(escape(s).replace('--', '- -') for s in said)
    out = f'<!--\n{comment}\n-->\n<imu>\n'
    for name, sensor in ELEMENTS:
        if sensor not in numbers.sensors:
            continue
        out += f'  <{name}>\n'
        sigma, walk = (numbers.three(sensor, p) for p in 'NK')
        for axis, s, k in zip('xyz', sigma, walk):
            s *= numbers.rate(sensor) ** 0.5
            out += (f'    <{axis}>\n      <noise type="gaussian">\n        <mean>0.0</mean>\n'
                    f'        <stddev>{number(s)}</stddev>\n'
                    f'        <dynamic_bias_stddev>{number(k)}</dynamic_bias_stddev>\n'
                    '        <dynamic_bias_correlation_time>'
                    f'{number(CORRELATION_S)}</dynamic_bias_correlation_time>\n'
                    f'      </noise>\n    </{axis}>\n')
        out += f'  </{name}>\n'
    return out + '</imu>\n'
