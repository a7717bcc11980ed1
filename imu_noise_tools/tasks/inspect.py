"""Look at a bag: its topics and the health of its record."""

from __future__ import annotations

from dataclasses import dataclass

from ..bag import open_record, TopicInfo, topics
from ..health import examine, Health


@dataclass(frozen=True)
class Inspection:
    """Topics of a bag, the record's topic, its health, and warnings of reading."""

    topics: tuple[TopicInfo, ...]
    topic: str
    health: Health
    warnings: tuple[str, ...]
    analysed: str


def inspect(bag, topic=None, progress=None) -> Inspection:
    """Return what a bag holds; raises what reading it raises."""
    from ..health import summary
    record = open_record(bag, topic, progress=progress)
    return Inspection(tuple(topics(bag)), record.topic, examine(record), record.warnings, summary(record))
