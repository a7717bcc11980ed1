# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Gain in nats that a candidate exceeds by chance in one axis of a thousand.

Written by bench/null.py; ``SOURCES`` is the hash of the code it was drawn with.

"""

AXES = 360
SOURCES = '39eb646fdc463e3f'
DEFAULT = 10.0  # of an effect that is not of the package
PENALTY = {
    'accel_coupling': 10.35,
    'drift': 7.52,
    'duplicates': 6.0,
    'flicker': 7.31,
    'gauss_markov': 10.29,
    'low_pass': 8.21,
    'narrowband': 17.39,
    'notch': 12.26,
    'quantization': 6.47,
    'ramp': 6.42,
    'random_walk': 6.0,
    'rate_quantization': 6.0,
    'rts': 9.09,
    'shared_noise': 7.32,
    'shock': 6.0,
    'slow_periodic': 10.36,
    'spikes': 6.0,
    'step': 13.95,
    'temperature': 11.26,
    'transient': 7.59,
    'variance_change': 14.88,
    'white': 6.0,
}
