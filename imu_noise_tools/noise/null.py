# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Gain in nats that a candidate exceeds by chance in one axis of a thousand.

Written by bench/null.py; ``SOURCES`` is the hash of the code it was drawn with.

"""

AXES = 240
SOURCES = '8d9893e811e1b900'
DEFAULT = 10.0  # of an effect that is not of the package
PENALTY = {
    'accel_coupling': 11.8,
    'drift': 9.35,
    'duplicates': 6.0,
    'flicker': 9.22,
    'gauss_markov': 8.47,
    'low_pass': 6.48,
    'narrowband': 15.76,
    'notch': 15.71,
    'quantization': 6.0,
    'ramp': 7.54,
    'random_walk': 6.0,
    'rate_quantization': 6.0,
    'rts': 7.05,
    'shared_noise': 8.47,
    'shock': 6.0,
    'slow_periodic': 15.84,
    'spikes': 6.0,
    'step': 15.19,
    'temperature': 13.89,
    'transient': 6.31,
    'variance_change': 13.74,
    'white': 6.0,
}
