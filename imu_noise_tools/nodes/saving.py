# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where a node saves: a folder of its own, never one that was there before it."""

from __future__ import annotations

from collections.abc import Mapping
import io
from pathlib import Path

import numpy as np

from ..core import files
from ..core.errors import InputError

REMEDY = 'set the parameter output_dir to a place that can be written'


def check(wanted: str) -> None:
    """Refuse a folder that cannot be made: InputError, before there is anything to lose."""
    if not Path(wanted).name:
        raise InputError('output_dir names no folder', 'e.g. analyser.study')
    files.refuse_unwritable(free(Path(wanted)), REMEDY)


class Folder:
    """
    A folder that is made with the first save and rewritten by later ones.

    What is there already stays: the next free name is taken then (``name.2``).

    """

    def __init__(self) -> None:
        self._made: Path | None = None

    def save(self, wanted: str, content: Mapping[str, str | bytes]) -> Path:
        """
        Write files, by name; return the folder.

        Raises
        ------
        InputError
            It cannot be written there.

        """
        try:
            return self._saved(wanted, content)
        except InputError as error:
            raise InputError(error.message, REMEDY) from error

    def _saved(self, wanted: str, content: Mapping[str, str | bytes]) -> Path:
        if self._made is not None and self._made.is_dir():
            files.replace_files(self._made, content)
            return self._made
        path = free(Path(wanted))
        with files.new_folder(path) as new:
            for name, data in content.items():
                files.atomic_write(new / name, data)
        self._made = path.resolve()
        return self._made


def free(path: Path) -> Path:
    """Return the path, or the first of ``name.2``, ``name.3`` ... that is not there yet."""
    taken, number = path, 2
    while taken.exists():
        taken, number = path.with_name(f'{path.stem}.{number}{path.suffix}'), number + 1
    return taken


def npz(**arrays: np.ndarray) -> bytes:
    """Return arrays as the bytes of an .npz file, not compressed: it must not take long."""
    out = io.BytesIO()
    np.savez(out, **arrays)         # type: ignore[arg-type]
    return out.getvalue()
