# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What Dask runs when a worker starts here: load the package, leave Ctrl-C to the client."""

from __future__ import annotations

import signal
from typing import Any

from . import work

__all__ = ['dask_setup', 'work']


def dask_setup(worker: Any) -> None:
    """Ignore Ctrl-C, which a terminal sends to all: the client ends its workers."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
