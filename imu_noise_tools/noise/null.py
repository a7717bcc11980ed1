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

"""
Gain in nats that a candidate exceeds by chance in one axis of a thousand.

Written by bench/null.py.

"""

AXES = 360
DEFAULT = 10.0
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
