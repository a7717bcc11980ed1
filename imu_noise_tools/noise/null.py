# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Gain in nats that a candidate exceeds by chance in one axis of a thousand.

Written by bench/null.py; ``SOURCES`` is the hash of the code it was drawn with.

"""

AXES = 759
SOURCES = '7d522d40ee2bd120'
DEFAULT = 10.0  # of an effect that is not of the package
PENALTY = {
    'accel_coupling': 12.14,
    'drift': 7.79,
    'duplicates': 6.0,
    'flicker': 6.0,
    'gauss_markov': 9.09,
    'low_pass': 8.62,
    'narrowband': 13.46,
    'notch': 11.82,
    'quantization': 6.0,
    'ramp': 6.67,
    'random_walk': 6.0,
    'rate_quantization': 6.0,
    'rts': 7.96,
    'shared_noise': 7.27,
    'shock': 6.0,
    'slow_periodic': 16.23,
    'spikes': 6.0,
    'step': 12.37,
    'temperature': 13.12,
    'transient': 7.36,
    'variance_change': 14.64,
    'white': 6.0,
}
