# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Fleets: many bags of many units on Dask, one table of all, and what it says of units and models.

``inputs`` says which bags, ``work`` what a worker does with one, ``run`` drives Dask, ``table`` is
the long table, ``population`` the statistics (plain arrays, no files), ``findings`` asks them,
``page`` shows it, ``export`` hands the numbers on.

"""

from __future__ import annotations

from importlib import import_module
from typing import Any

from ..core.errors import InputError

INSTALL = "pip install 'imu_noise_tools[fleet]'"


def extra(name: str) -> Any:
    """Return a module of the optional extra; raise InputError with the remedy without it."""
    try:
        return import_module(name)
    except ImportError:
        raise InputError(f'fleets need {name.partition(".")[0]}, which is not installed',
                         INSTALL) from None
