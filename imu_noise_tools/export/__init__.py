# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A study's numbers in the files that other programs read.

One module a consumer, found by its name. It has ``DESCRIPTION`` (one line), whose code says what
goes in (``CONSUMER``, ``PLACES``, ``HOLDS``, ``HOW``), and ``text(study, **options)``; one whose
consumer has a place for scale factors and biases sets ``CALIBRATION`` and takes them as
``calibration``, a :class:`~imu_noise_tools.export._calibration.Inverse`.

"""

from __future__ import annotations

import importlib
from pathlib import Path
import pkgutil
from typing import Any

from ._calibration import read
from ._values import PARAMETERS
from ..core import files
from ..core.errors import InputError, unknown, UsageError
from ..loop.study import Study

__all__ = ['descriptions', 'export', 'formats', 'module', 'PARAMETERS', 'write']


def formats() -> list[str]:
    """Return the names of the formats."""
    return sorted(m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith('_'))


def descriptions() -> dict[str, str]:
    """Return a line on each format by its name: what is written, and by whose convention."""
    return {name: module(name).DESCRIPTION for name in formats()}


def export(study: Study, name: str, calibration: str | Path | None = None, **options: Any) -> str:
    """
    Return the text of one format.

    Parameters
    ----------
    study : Study
        Of noise.
    name : str
        One of :func:`formats`.
    calibration : path or None
        A folder that calibrate wrote, to go with it.
    options
        ``axes`` (worst, mean or each), ``inflate``, ``horizon`` (s).

    Raises
    ------
    UsageError
        An unknown format, or an option that it cannot hold.
    InputError
        The calibration cannot be read.

    """
    if name not in formats():
        raise unknown('format', name, formats())
    chosen = module(name)
    if calibration is not None:
        if not getattr(chosen, 'CALIBRATION', False):
            able = [n for n in formats() if getattr(module(n), 'CALIBRATION', False)]
            raise UsageError(
                f'--calibration: {name} has no place for scale factors and biases',
                f'correct the bag with imu_noise apply, or choose from {", ".join(able)}')
        options['calibration'] = read(calibration)
    return chosen.text(study, **options)


def write(path: str | Path, text: str, force: bool = False) -> None:
    """
    Write the text of an export; one of the same format may be there, as when a script runs again.

    Raises
    ------
    InputError
        Another file is there and ``force`` is not given, or it cannot be written.

    """
    path = Path(path)
    if path.is_file() and not force and _heading(_begin(path)) != _heading(text):
        raise InputError(f'{path}: the file exists, and is no export of this format',
                         'choose another name with -o, or replace it with --force')
    files.atomic_write(path, text)


def _begin(path: Path) -> str:
    """Return how a file begins; nothing where it cannot be read."""
    try:
        with open(path, 'rb') as file:
            return file.read(4096).decode(errors='replace')
    except OSError:
        return ''


def _heading(text: str) -> str:
    """Return the first sentence of an export: its format. Lines before are {, %YAML:1.0, <!--."""
    line = next((s for s in text.splitlines() if len(s) > 25), '')
    return line.partition('. ')[0]


def module(name: str) -> Any:
    """Return the module of a format, by its name."""
    return importlib.import_module(f'{__name__}.{name}')
