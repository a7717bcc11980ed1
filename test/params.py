# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of tests: a few for every day, the others with the thorough tests."""

from __future__ import annotations

from collections.abc import Iterable
from zlib import crc32

import pytest


def daily(values: Iterable, *few) -> list:
    """Return parameters, all but a few of them for the thorough tests."""
    values = list(values)
    assert set(few) <= set(values)
    return [v if v in few else seldom(v) for v in values]


def seldom(*values):
    """Return one row of parameters for the thorough tests."""
    return pytest.param(*values, marks=pytest.mark.thorough)


def in_share(test: str, share: str) -> bool:
    """Tell whether a test (its id) is in a share of all, "2/4": what it is in stays the same."""
    which, of = map(int, share.split('/'))
    return crc32(test.encode()) % of == which % of
