"""
Bags: reading any kind of them, writing them in bulk, copying one with a topic more.

:func:`open_record` is all that an analysis needs.

"""

from __future__ import annotations

from .reading import Block, iter_blocks, open_record, topics
from .topics import TopicInfo
from .writing import write_bag

__all__ = ['Block', 'TopicInfo', 'iter_blocks', 'open_record', 'topics', 'write_bag']
