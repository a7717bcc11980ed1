# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Coupling of acceleration into the rate: g-sensitivity and vibration rectification."""

from ..kinds import Coupling, Parameter


class AccelCoupling(Coupling):
    """The rate holds a share of each accelerometer axis, and of the squared vibration."""

    name = 'accel_coupling'
    symbol = 'gain_x, gain_y, gain_z, rectification'
    title = 'g-sensitivity and vibration rectification'
    equation = 'rate = ... + gain_x a_x + gain_y a_y + gain_z a_z + rectification |a - mean a|^2'
    signature = 'coherence of the gyroscope axis with accelerometer axes, where the mount shakes'
    hint = (
        'Acceleration and vibration leak into the gyroscope. Damp the mount, move the sensor '
        'away from the source; calibrate g-sensitivity on several poses.'
    )
    reference = 'IEEE 1554, g-sensitivity and vibration rectification error'
    needs = 'record the accelerometer along with the gyroscope; it applies to gyroscope axes'
    decide = 'shake the mount gently along one axis after the other, and record the accelerometer'
    parameters = tuple(
        Parameter(name, unit, -1e6, 1e6, log=False, amplitude=True, linear=True, title=title)
        for name, unit, title in (
            ('gain_x', '{rate}/(m/s^2)', 'share of x'),
            ('gain_y', '{rate}/(m/s^2)', 'share of y'),
            ('gain_z', '{rate}/(m/s^2)', 'share of z'),
            ('rectification', '{rate}/(m/s^2)^2', 'share of the squared vibration'),
        )
    )

    def starts(self, evidence):
        """For gyroscope axes, where the accelerometer was recorded."""
        return [self] if self.channels(evidence) else []

    def channels(self, evidence):
        """Return the accelerometer axes and their squared vibration."""
        names = ('accel_x', 'accel_y', 'accel_z', 'accel_square')
        return (
            names
            if evidence.sensor == 'gyro' and all(n in evidence.channels for n in names)
            else ()
        )

    def apply(self, x, inputs, rng):
        """Add the shares of the accelerometer axes in the inputs."""
        import numpy as np

        a = np.column_stack([inputs.axes[f'accel_{c}'] for c in 'xyz'])
        a = a - a.mean(axis=0)
        gains = np.array([self['gain_x'], self['gain_y'], self['gain_z']])
        return x + a @ gains + self['rectification'] * np.sum(a**2, axis=1)

    @classmethod
    def example(cls):
        """Return a g-sensitivity of 0.1 deg/s/g (1.8e-4 rad/s for each m/s^2) on x."""
        return cls({'gain_x': 1.8e-4, 'gain_y': 0.0, 'gain_z': 0.0, 'rectification': 0.0})
