# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Gain in nats that a candidate exceeds by chance in one axis of a thousand.

Written by bench/null.py; ``SOURCES`` is the hash of the code it was drawn with.

"""

AXES = 360
SOURCES = 'fbbd3c3919ba5472'
DEFAULT = 10.0  # of an effect that is not of the package
PENALTY = {
    'accel_coupling': 10.32,
    'drift': 8.24,
    'duplicates': 6.0,
    'flicker': 7.68,
    'gauss_markov': 9.94,
    'low_pass': 9.56,
    'narrowband': 15.83,
    'notch': 13.39,
    'quantization': 6.5,
    'ramp': 7.99,
    'random_walk': 6.0,
    'rate_quantization': 6.0,
    'rts': 6.88,
    'shared_noise': 7.3,
    'shock': 6.0,
    'slow_periodic': 15.41,
    'spikes': 6.0,
    'step': 13.27,
    'temperature': 13.0,
    'transient': 7.16,
    'variance_change': 14.2,
    'white': 6.0,
}
