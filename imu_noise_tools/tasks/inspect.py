# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Look at a bag: its topics and the health of its record."""

from __future__ import annotations

from dataclasses import dataclass

from ..bag import open_record, Scratch, TopicInfo, topics
from ..core.errors import InputError
from ..core.record import Memory
from ..health import examine, Health, prepare


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
    memory = Scratch()
    record = open_record(bag, topic, progress=progress, memory=memory)
    return Inspection(
        tuple(topics(bag)), record.topic, examine(record, memory), record.warnings,
        _analysed(record, memory)
    )


def _analysed(record, memory: Memory) -> str:
    """Return one line on what of a record can be analysed, or why nothing can."""
    try:
        part = prepare(record, memory=memory)
    except InputError as error:
        return error.message
    return f'{part.n} samples, {part.duration_s:.4g} s at rest'
