# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Room on disk for arrays that are too long for memory."""

from __future__ import annotations

import mmap
import os
import tempfile
from typing import Any
import weakref

import numpy as np

from ..core.errors import InputError
from ..core.record import Memory

LARGE = 1 << 25         # bytes of an array that goes to disk


class Scratch(Memory):
    """
    Keeps large arrays in files of the temporary folder that have no name.

    The system takes such a file back when the last array that uses it is gone or the process has
    ended, however it ended: nothing is ever left over. Arrays of less than ``large`` bytes are
    kept in memory.

    """

    def __init__(self, large: int | None = None):
        self.large = LARGE if large is None else large
        self._maps: weakref.WeakSet = weakref.WeakSet()

    def empty(self, shape: int | tuple[int, ...], dtype: Any = float) -> np.ndarray:
        """
        Return a new array.

        Raises
        ------
        InputError
            There is no room for it.

        """
        size = int(np.prod(shape)) * np.dtype(dtype).itemsize
        if size < max(self.large, 1):
            return super().empty(shape, dtype)
        try:
            with tempfile.TemporaryFile(prefix='imu_noise_') as file:
                # room is taken now: on a full disk, writing to the map would end the process
                os.posix_fallocate(file.fileno(), 0, size)
                held = mmap.mmap(file.fileno(), size)
        except OSError as error:
            raise InputError(
                f'{tempfile.gettempdir()}: no room for {size / 1e6:.0f} MB of a long record '
                f'({(error.strerror or str(error)).lower()})',
                'free some disk space or set TMPDIR',
            ) from error
        self._maps.add(held)
        return np.frombuffer(held, dtype).reshape(shape)

    def keep(self, x: np.ndarray) -> np.ndarray:
        """Return an array, copied to its place where it is large."""
        if x.nbytes < self.large:
            return x
        out = self.empty(x.shape, x.dtype)
        out[...] = x
        return out

    def rest(self) -> None:
        """Give the memory of all maps back; what they hold stays in the files."""
        for held in list(self._maps):
            held.madvise(mmap.MADV_DONTNEED)
