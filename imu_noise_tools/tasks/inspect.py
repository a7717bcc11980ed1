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

"""Look at a bag: its topics and the health of its record."""

from __future__ import annotations

from dataclasses import dataclass

from ..bag import open_record, Scratch, TopicInfo, topics
from ..errors import InputError
from ..health import examine, Health, prepare
from ..record import Memory


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
