# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Bags: reading any kind of them, writing them in bulk, copying one with a topic more.

:func:`open_record` is all that an analysis needs.

"""

from __future__ import annotations

from .blocks import Block, iter_blocks, iter_raw
from .copy_files import Changed
from .copying import copy_bag
from .reading import imus, open_record, topics
from .scratch import Scratch
from .topics import ALL, TopicInfo
from .writing import write_bag

__all__ = [
    'ALL',
    'Block',
    'Changed',
    'Scratch',
    'TopicInfo',
    'copy_bag',
    'imus',
    'iter_blocks',
    'iter_raw',
    'open_record',
    'topics',
    'write_bag',
]
