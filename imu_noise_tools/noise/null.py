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
