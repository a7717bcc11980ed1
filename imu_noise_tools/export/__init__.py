# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A study's numbers in the files that other programs read.

One module a consumer, found by its name.

"""

from __future__ import annotations

import importlib
import pkgutil

from ..core.errors import unknown


def formats() -> list[str]:
    """Return the names of the formats."""
    return sorted(m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith('_'))


def export(study, name: str, **options) -> str:
    """
    Return the text of one format.

    Raises
    ------
    UsageError
        An unknown format, or an option that it cannot hold.

    """
    if name not in formats():
        raise unknown('format', name, formats())
    return importlib.import_module(f'{__name__}.{name}').text(study, **options)
