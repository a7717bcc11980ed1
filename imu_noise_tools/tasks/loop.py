# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Go on with a study on disk, and tell what changed between two."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from . import sheet
from .. import store
from ..core import files
from ..core.errors import InputError
from ..loop.domains import part
from ..loop.study import Study


class ChangedError(InputError):
    """Between reading and writing a study somebody else has written it."""


def change(folder: str | Path, what: Callable[[Study], object]) -> tuple[Study, object]:
    """
    Load a study, do something to it, rewrite all of its files; return it and what came back.

    Raise ChangedError where somebody else has changed it meanwhile: nothing is written then.

    """
    return change_by_steps(folder, lambda study, _: what(study))


def change_by_steps(
    folder: str | Path, what: Callable[[Study, Callable[[], None]], object]
) -> tuple[Study, object]:
    """
    Do as :func:`change` does, for what takes long: ``what`` may keep what it has by then.

    Its second argument writes the study, which is then what a killed process leaves. Page and
    pictures, which take longer, come at the end.

    """
    seen = store.fingerprint(folder)

    def keep() -> None:
        nonlocal seen
        seen = rewrite(folder, store.study_files(study), seen)

    study = store.load(folder)
    if study.source.get('sheet'):
        raise InputError(f'{folder}: a data sheet, no measurement', 'analyse a record of the unit')
    result = what(study, keep)
    rewrite(folder, outputs(study, folder), seen)
    return study, result


def rewrite(folder: str | Path, content: Mapping[str, str | bytes], seen: str) -> str:
    """
    Rewrite the files of a study that nobody else has changed, and return its new fingerprint.

    Parameters
    ----------
    folder : str or Path
        Of a study.
    content : mapping of str to str or bytes
        What :func:`outputs` gave.
    seen : str
        :func:`~imu_noise_tools.store.fingerprint` of the folder when the study was read.

    Raises
    ------
    ChangedError
        It is another study now; nothing is written.

    """
    with files.only_writer(folder):
        if store.fingerprint(folder) != seen:
            raise ChangedError(f'{folder}: somebody else has changed the study meanwhile',
                               'look at what is new, and do it again')
        files.replace_files(folder, content)
        return store.fingerprint(folder)


def outputs(study: Study, folder: str | Path) -> dict[str, str | bytes]:
    """Return all files of a study of any domain by name; ``folder`` is what the page names."""
    if study.source.get('sheet'):
        return sheet.outputs(study)
    return part('tasks', study.domain).outputs(study, folder)


def save(study: Study, folder: str | Path, force: bool = False) -> Path:
    """
    Write all files of a study into a new folder, and return it.

    Raises
    ------
    InputError
        The folder is there and ``force`` is not given, or it cannot be written.

    """
    with files.new_folder(Path(folder), force=force) as new:
        for name, data in outputs(study, folder).items():
            files.atomic_write(Path(new) / name, data)
    return Path(folder)
