# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Gain in nats that a candidate exceeds by chance in one axis of a thousand.

Written by bench/null.py. ``DRAWN`` is the hash of the code that it was drawn with,
``SOURCES`` that of the last code that was found to gain the same in a sample of it.

"""

AXES = 1080
DRAWN = 'f67b2baba8eafcea'
SOURCES = '524bf99ea5f18171'
DEFAULT = 10.0  # of an effect that is not of the package
PENALTY = {
    'accel_coupling': 11.42,
    'band': 6.0,
    'digital_filter': 6.0,
    'drift': 8.57,
    'duplicates': 6.0,
    'flicker': 6.0,
    'gauss_markov': 8.57,
    'low_pass': 6.0,
    'narrowband': 12.77,
    'notch': 11.8,
    'quantization': 6.0,
    'ramp': 6.03,
    'random_walk': 6.0,
    'rate_quantization': 6.0,
    'rts': 7.21,
    'shared_noise': 7.1,
    'shock': 6.0,
    'slow_periodic': 17.11,
    'spikes': 6.0,
    'step': 13.06,
    'temperature': 13.61,
    'transient': 7.24,
    'variance_change': 14.41,
    'white': 6.0,
}
