# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The one root of all errors that are meant for a person: what is wrong, where, and what to do."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from difflib import get_close_matches


class ImuNoiseError(Exception):
    """
    Something is wrong that a person can mend.

    Parameters
    ----------
    message : str
        What is wrong and where, in one line, without a full stop.
    remedy : str
        What to do about it, in one line.

    ``warnings`` holds what was found doubtful before.

    """

    def __init__(self, message: str, remedy: str = '') -> None:
        super().__init__(message, remedy)
        self.message = message
        self.remedy = remedy
        self.warnings: tuple[str, ...] = ()

    def after(self, *warnings: str) -> 'ImuNoiseError':
        """Return the error with warnings that came before it, each once."""
        self.warnings = tuple(dict.fromkeys((*warnings, *self.warnings)))
        return self

    def __str__(self) -> str:
        """Return both in one line."""
        return f'{self.message}: {self.remedy}' if self.remedy else self.message


class InputError(ImuNoiseError):
    """The data cannot be used: no such file, no Imu topic, too short, moving (exit status 1)."""


class UsageError(ImuNoiseError):
    """The request makes no sense: an unknown effect, axis or format (exit status 2)."""


class FitError(ImuNoiseError):
    """A model could not be fitted to usable data (exit status 1)."""


def unknown(what: str, name: object, known: Iterable[str]) -> UsageError:
    """Return the error for a name that is not known, with the nearest one and all that are."""
    names = list(dict.fromkeys(known))
    near = get_close_matches(str(name), names, 1)
    meant = f'did you mean {near[0]}? ' if near else ''
    return UsageError(f'unknown {what} {name}', f'{meant}choose from {", ".join(names)}')


def listed(names: Sequence[str], most: int) -> str:
    """Return names in a line, and how many more there are than these."""
    more = f' and {len(names) - most} more' if len(names) > most else ''
    return ', '.join(names[:most]) + more


def degrees_of_freedom(n: int) -> str:
    """Return so many of them in words."""
    return f'{n} degree{"" if n == 1 else "s"} of freedom'
