# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a fleet's folder holds besides the studies: the table, what it says, the page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from . import table
from .inputs import Bag
from .run import Fleet


def write(fleet: Fleet, bags: Sequence[Bag], lost: dict[str, str]) -> dict[str, Any]:
    """Write fleet.parquet and fleet.csv; return what they say."""
    factors = [f for b in bags for f in b.factors]
    whole = table.table(fleet.facts(bags, lost), factors)
    table.write(fleet.folder, whole)
    failed = {b.path: f['error'] for b, _, f in fleet.facts(bags, lost) if f['error']}
    return {'bags': len(bags), 'failed': failed}


def text(summary: dict[str, Any], folder: str) -> str:
    """Return a summary as lines for a terminal."""
    return '\n'.join([*summary['failed'].values(), f'written to {folder}'])


def compare(a: str, b: str) -> list[dict[str, Any]]:
    """Return what differs between two fleets."""
    raise NotImplementedError


def changes_text(rows: list[dict[str, Any]], title: str) -> str:
    """Return changes as a table for a terminal."""
    raise NotImplementedError
