# Copyright 2026 imu_noise_tools maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Rate ramp: a bias that drifts at a constant rate."""

import numpy as np

from ..kinds import Mean, Parameter


class Ramp(Mean):
    """R: the mean grows linearly."""

    name = 'ramp'
    symbol = 'R'
    title = 'rate ramp'
    equation = 'mean = R t, sigma^2(tau) = R^2 tau^2/2'
    signature = (
        'slope +1 at the long end of the Allan deviation; the mean of the record drifts in one '
        'direction'
    )
    hint = (
        'Warming up, a slow temperature change, ageing. Record the temperature, and wait before '
        'recording: if the drift then ends it was a warm-up (transient) or temperature.'
    )
    reference = 'IEEE 952 C.1.6'
    decide = 'record twice as long: a ramp goes on, what settles or wanders does not'
    parameters = (
        Parameter(
            'R', '{slope}', -1e3, 1e3, log=False, amplitude=True, linear=True, title='rate ramp'
        ),
    )

    def columns(self, inputs):
        """t."""
        return inputs.t[:, None]

    def avar(self, m, dt):
        """R^2 tau^2/2."""
        return (self['R'] * np.asarray(m) * dt) ** 2 / 2

    @classmethod
    def example(cls):
        """10 deg/h in an hour."""
        return cls({'R': 1.3e-8})
