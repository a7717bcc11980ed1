# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Coupling of acceleration into the rate: g-sensitivity and vibration rectification."""

import numpy as np

from ..coupled import by_gravity
from ..evidence import Evidence
from ..kinds import Coupling, Inputs, Parameter
from ..shared import HEARD, LATER, quarter_later, SHAKEN
from ...loop.effect import Effect, Fit


AXES = tuple('xyz')


class AccelCoupling(Coupling):
    """The rate holds a share of each accelerometer axis, and of the squared vibration."""

    name = 'accel_coupling'
    symbol = 'gain_x, gain_y, gain_z, later_x, later_y, later_z, rectification, heard'
    title = 'g-sensitivity and vibration rectification'
    equation = (
        'rate = ... + sum gain_i a_i + later_i H[a_i] + rectification |a - mean a|^2, H a quarter '
        'of a period later; a as recorded, or what in it is not its own noise'
    )
    signature = 'coherence of the gyroscope axis with accelerometer axes, where the mount shakes'
    hint = (
        'Acceleration and vibration leak into the gyroscope, or the mount turns as it shakes. '
        'Damp the mount, move the sensor away from the source; calibrate g-sensitivity on several '
        'poses.'
    )
    reference = 'IEEE 1554, g-sensitivity and vibration rectification error'
    needs = 'record the accelerometer along with the gyroscope; it applies to gyroscope axes'
    decide = 'shake the mount gently along one axis after the other, and record the accelerometer'
    parameters = (
        *(
            Parameter(name, unit, -1e6, 1e6, log=False, amplitude=True, linear=True, title=title)
            for name, unit, title in (
                *((f'gain_{c}', '{rate}/(m/s^2)', f'share of {c}') for c in AXES),
                *((f'later_{c}', '{rate}/(m/s^2)', f'share of {c} a quarter of a period later')
                  for c in AXES),
                ('rectification', '{rate}/(m/s^2)^2', 'share of the squared vibration'),
            )
        ),
        Parameter.choice('heard', HEARD, title='what of the accelerometer'),
    )
    optional = tuple(f'later_{c}' for c in AXES)

    def starts(self, evidence: Evidence) -> list[Effect]:
        """For gyroscope axes, where the accelerometer was recorded."""
        return [e for e in (self.with_values(heard=h) for h in HEARD) if e.channels(evidence)]

    def channels(self, evidence: Evidence) -> tuple[str, ...]:
        """Return the accelerometer axes, twice, and their squared vibration."""
        axes = tuple(f'accel_{c}' for c in AXES)
        recorded = all(n in evidence.channels for n in (*axes, 'accel_square'))
        if evidence.sensor != 'gyro' or not recorded:
            return ()
        if self.values.get('heard'):
            if not any(evidence.shaken(a) for a in axes):
                return ()
            axes = tuple(a + SHAKEN for a in axes)
        return (*axes, *(a + LATER for a in axes), 'accel_square')

    def motion(self, evidence: Evidence, fit: Fit) -> str:
        """Say that gravity moves by as much in a mount that turns."""
        return by_gravity(evidence, fit, self.label, np.array(
            [[self[f'{k}_{c}'] for c in AXES] for k in ('gain', 'later')]))

    def apply(self, x: np.ndarray, inputs: Inputs, rng: np.random.Generator) -> np.ndarray:
        """Add the shares of the accelerometer axes in the inputs."""
        a = np.column_stack([inputs.axes[f'accel_{c}'] for c in AXES])
        a = a - a.mean(axis=0)
        gains, late = (np.array([self[f'{k}_{c}'] for c in AXES]) for k in ('gain', 'later'))
        x = x + a @ gains + self['rectification'] * np.sum(a**2, axis=1)
        return x + quarter_later(a) @ late if np.any(late) else x

    @classmethod
    def example(cls) -> Effect:
        """Return a g-sensitivity of 0.1 deg/s/g (1.8e-4 rad/s for each m/s^2) on x."""
        return cls({p.name: 0.0 for p in cls.parameters} | {'gain_x': 1.8e-4, 'heard': 'all'})
