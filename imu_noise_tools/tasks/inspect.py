# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Look at a bag: its topics and the health of its record."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..bag import imus, open_record, Scratch, TopicInfo, topics
from ..core.errors import InputError
from ..core.record import Disturbance, ImuRecord, Memory
from ..core.units import duration
from ..health import examine, Health, prepare, Selection


@dataclass(frozen=True)
class Inspection:
    """
    Topics of a bag, the record's topic, its health, and warnings of reading.

    A topic whose samples were read has the rate of its stamps, others that of their messages.
    ``analysed`` is a line on what of it can be analysed; ``disturbances`` lists what disturbs that
    part, ``left_out`` what of it is set aside. Times are those of the record, its start being 0.
    ``looked`` tells whether there is such a part at all.
    ``beside`` are the same of sensors with a clock of their own.

    """

    topics: tuple[TopicInfo, ...]
    topic: str
    health: Health
    warnings: tuple[str, ...]
    analysed: str
    disturbances: tuple[Disturbance, ...] = ()
    left_out: tuple[tuple[float, float, str], ...] = ()
    beside: tuple[Inspection, ...] = ()
    looked: bool = False


def inspect(
    bag: str | Path,
    topic: str | None = None,
    selection: Selection | None = None,
    progress: Any = None,
    fields: str | None = None,
    **reading: Any,
) -> Inspection:
    """
    Return what a bag, or a part of its record, holds; raises what reading it raises.

    ``reading`` are the rate and the units of :func:`~imu_noise_tools.bag.open_record`.

    """
    memory = Scratch()
    selection = selection or Selection()
    record = open_record(bag, topic, progress=progress, memory=memory, apart=True,
                         fields=fields, **reading)
    known = tuple(topics(bag, fields))
    first, *others = (_one(r, known, selection, memory) for r in record.streams)
    whole = replace(first, beside=tuple(others))
    return replace(whole, topics=_rated(known, [whole]))


def inspect_every(
    bag: str | Path, **options: Any
) -> tuple[dict[str, Inspection], dict[str, InputError]]:
    """
    Return what each IMU of a bag holds by what --topic takes, and why others cannot be read.

    Raises
    ------
    InputError, UsageError
        As :func:`inspect`; none of them can be read.

    """
    found: dict[str, Inspection] = {}
    refused: dict[str, InputError] = {}
    for topic in imus(bag, options.get('fields')):
        try:
            found[topic] = inspect(bag, topic or None, **options)
        except InputError as error:
            refused[topic] = error
    if not found:
        raise next(iter(refused.values()))
    known = _rated(next(iter(found.values())).topics, found.values())
    return {topic: replace(one, topics=known) for topic, one in found.items()}, refused


def inspect_what_is_there(
    bag: str | Path, **options: Any
) -> tuple[dict[str, Inspection], dict[str, InputError]]:
    """Return what a bag holds of which no topic is named: its record, or each of several IMUs'."""
    try:
        return {'': inspect(bag, None, **options)}, {}
    except InputError:
        if len(imus(bag, options.get('fields'))) < 2:
            raise
    return inspect_every(bag, **options)


def _rated(known: Iterable[TopicInfo], found: Iterable[Inspection]) -> tuple[TopicInfo, ...]:
    """Return topics with the rate of their stamps where samples of theirs were looked at."""
    rates = {topic: one.health.rate_hz for whole in found for one in (whole, *whole.beside)
             for topic in one.topic.split(',')}
    return tuple(replace(t, rate_hz=rates.get(t.name) or t.rate_hz) for t in known)


def _one(record: ImuRecord, known, selection: Selection, memory: Memory) -> Inspection:
    """Return what one stream holds."""
    record = selection.part(record)
    health = examine(record, memory)
    about = known, record.topic, health, record.warnings
    try:
        part = prepare(record, memory=memory, screen=selection.screen, masks=selection.masks)
    except InputError as error:
        return Inspection(*about, f'no: {error.message.removeprefix(f"{record.path}: ")}')
    line = f'{part.n} samples, {duration(part.duration_s)} at rest'
    if part.duration_s < health.duration_s - part.dt:
        line += f', from {part.t[0]:.4g} to {part.t[-1]:.4g} s'
    return Inspection(*about, line, part.disturbances, part.left_out, looked=True)
