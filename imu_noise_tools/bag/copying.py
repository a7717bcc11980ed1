# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A bag again, with one Imu topic more: the same kind of file, all that it held untouched."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from .container import Progress
from .copy_files import Changed, Copy
from .reading import open_record
from .source import Bag
from .tables import table_arrays, table_kind
from .writing import SUFFIX, write_table, writing_file
from ..core.errors import InputError, UsageError
from ..core.files import new_folder
from ..core.record import ImuRecord


def copy_bag(
    source: str | Path,
    target: str | Path,
    transform: Callable[[ImuRecord], ImuRecord | Changed],
    *,
    topic: str | None = None,
    new_topic: str = 'imu/data_filtered',
    force: bool = False,
    progress: Progress = None,
    fields: str | None = None,
    gyro_unit: str | None = None,
    accel_unit: str | None = None,
    part: Callable[[ImuRecord], tuple[int, int]] | None = None,
    rate_hz: float | None = None,
) -> Path:
    """
    Write a copy of a bag with one more Imu topic.

    All topics, messages and times stay as they are; each message of the Imu topic is there again
    under ``new_topic``, stamp, frame and other fields kept, with what ``transform`` made of it. A
    .csv or .npz gets columns more: ``gyro_x_filtered``, ``gyro_filtered``.

    Parameters
    ----------
    source, target : str or Path
        Bags; the target is of the kind of the source.
    transform : callable
        Takes the record as :func:`open_record` gives it; returns one of the same length, or a
        Changed.
    topic, fields : str, optional
        The Imu topic, and what of its messages, as for :func:`open_record`.
    gyro_unit, accel_unit : str, optional
        Unit of the data where it is not SI; ``transform`` gets SI.
    new_topic : str
        Name of the new one.
    force : bool
        Replace a bag that is there.
    progress : callable, optional
        Called with the fraction done.

    part : callable, optional
        Which samples, from and to, are changed: those outside are not under the new topic (in a
        table they are NaN).
    rate_hz : float, optional
        Sample rate of a table that has no stamps; stamps go before it.

    Returns
    -------
    Path
        The target.

    Raises
    ------
    InputError
        As :func:`open_record`; or something is in the way, or the source has such a topic already.
    UsageError
        The target's name is that of another kind of file, or of the source itself.

    """
    source, target = Path(source), Path(target)
    _check_kind(source, target)
    bare = rate_hz and table_kind(source) and 't' not in table_arrays(source, fields=fields)
    record = open_record(source, topic, progress=_share(progress, 0.0, 0.4), fields=fields,
                         gyro_unit=gyro_unit, accel_unit=accel_unit,
                         rate_hz=rate_hz if bare else None)
    first, last = part(record) if part else (0, record.n)
    changed = _changed(transform(record.part(first, last)), last - first).within(
        first, record.n)
    if table_kind(source):
        with writing_file(target, force) as temporary:
            write_table(temporary, table_kind(source), _more_columns(source, changed, new_topic,
                                                                     fields))
        return target
    with Bag(source) as bag:
        copy = Copy(
            bag, topic, '/' + new_topic.strip('/'), changed, record.n,
            _share(progress, 0.4, 1.0), fields,
        )
        if source.is_dir():
            with new_folder(target, force) as folder:
                copy.folder(folder)
        else:
            with writing_file(target, force) as temporary:
                copy.file(0, temporary)
    return target


def _check_kind(source: Path, target: Path) -> None:
    if target.exists() and source.exists() and target.samefile(source):
        raise UsageError(f'{target}: is the bag that is read', 'choose another name')
    asked = SUFFIX.get(target.suffix.lower())
    name = source.name.removesuffix('.zstd').removesuffix('.zst')
    held = table_kind(source) or SUFFIX.get(Path(name).suffix.lower())
    if source.is_dir() and asked or not source.is_dir() and asked and held and asked != held:
        raise UsageError(
            f'{target}: the copy must be of the same format as {source.name}', 'choose such a name'
        )


def _share(progress: Progress, begin: float, end: float) -> Progress:
    return (
        None if progress is None else lambda fraction: progress(begin + (end - begin) * fraction)
    )


def _changed(made: ImuRecord | Changed, n: int) -> Changed:
    """Return what is new, its shapes checked."""
    found = made if isinstance(made, Changed) else Changed(made.gyro, made.accel)
    for name, x in zip(('gyro', 'accel'), found[:2]):
        if x is not None and x.shape != (n, 3):
            raise UsageError(
                f'the new {name} has the shape {x.shape}, not ({n}, 3)',
                'change samples, not their number',
            )
    covariances = [None if c is None else np.asarray(c, float).reshape(-1, 9) for c in found[2:4]]
    for c in covariances:
        if c is not None and len(c) not in (1, n):
            raise UsageError(f'{len(c)} covariances for {n} samples', 'give one, or one for each')
    return Changed(
        *found[:2], *(None if c is None else c[0] if len(c) == 1 else c for c in covariances)
    )


def _more_columns(source: Path, changed: Changed, new_topic: str,
                  fields: str | None) -> dict[str, np.ndarray]:
    arrays = table_arrays(source, fields=fields)
    ending = new_topic.rpartition('_')[2].strip('/') or 'changed'
    for name, x in zip(('gyro', 'accel'), changed[:2]):
        if x is not None:
            if f'{name}_{ending}' in arrays or f'{name}_x_{ending}' in arrays:
                raise InputError(
                    f'{source}: {name}_{ending} exists already', 'start from the original'
                )
            arrays[f'{name}_{ending}'] = x
    return arrays
