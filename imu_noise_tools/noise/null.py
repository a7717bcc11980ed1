# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Gain in nats that a candidate exceeds by chance in one axis of a thousand.

Written by bench/null.py.

"""

AXES = 360
SOURCES = ''
DEFAULT = 10.0  # of an effect that is not of the package
PENALTY = {
    'accel_coupling': 9.42,
    'gauss_markov': 7.24,
    'low_pass': 6.0,
    'quantization': 6.0,
    'ramp': 6.0,
    'rts': 8.09,
    'shared_noise': 6.0,
    'spikes': 6.0,
    'step': 10.98,
    'temperature': 8.17,
    'transient': 6.99,
    'variance_change': 15.01,
}
