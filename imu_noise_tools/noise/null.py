"""
Gain in nats that a candidate exceeds by chance in one axis of a thousand.

Written by bench/null.py.

"""

AXES = 180
DEFAULT = 10.0
PENALTY = {
    'accel_coupling': 10.29,
    'gauss_markov': 7.44,
    'low_pass': 6.0,
    'quantization': 6.0,
    'ramp': 6.0,
    'rts': 6.0,
    'shared_noise': 6.0,
    'spikes': 6.0,
    'step': 10.37,
    'temperature': 8.7,
    'transient': 7.72,
    'variance_change': 6.48,
}
