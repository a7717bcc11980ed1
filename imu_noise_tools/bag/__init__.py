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
Bags: reading any kind of them, writing them in bulk, copying one with a topic more.

:func:`open_record` is all that an analysis needs.

"""

from __future__ import annotations

from .blocks import Block, iter_blocks, iter_raw
from .copy_files import Changed
from .copying import copy_bag
from .reading import open_record, topics
from .scratch import Scratch
from .topics import TopicInfo
from .writing import write_bag

__all__ = [
    'Block',
    'Changed',
    'Scratch',
    'TopicInfo',
    'copy_bag',
    'iter_blocks',
    'iter_raw',
    'open_record',
    'topics',
    'write_bag',
]
