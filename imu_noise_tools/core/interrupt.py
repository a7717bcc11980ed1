# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Ctrl-C while a program of ours is loaded: nothing can be caught yet, nothing need be undone."""

from __future__ import annotations

import os
import signal
import sys
import threading


def loading(*programs: str) -> None:
    """
    Let Ctrl-C end this process as it ends any, at once and without a traceback.

    To be called by what a program imports first, and does nothing where the process is another:
    ``sys.argv[0]`` is the script that runs, and ``-m`` while ``python -m`` looks for its module.
    A handler that raises would not do: some of what is imported drops or wraps the exception.

    Parameters
    ----------
    programs : str
        Names of the scripts.

    """
    running = sys.argv[0] if sys.argv else ''
    if (os.path.basename(running) in ('-m', *programs)
            and threading.current_thread() is threading.main_thread()
            and signal.getsignal(signal.SIGINT) == signal.default_int_handler):
        signal.signal(signal.SIGINT, signal.SIG_DFL)


def loaded() -> None:
    """Let Ctrl-C raise KeyboardInterrupt again, which the program now takes care of."""
    if signal.getsignal(signal.SIGINT) == signal.SIG_DFL:
        signal.signal(signal.SIGINT, signal.default_int_handler)
