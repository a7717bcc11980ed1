# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Go on with a study on disk, and tell what changed between two."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from . import sheet
from .. import store
from ..core import files
from ..core.errors import InputError
from ..loop.domains import part
from ..loop.study import Study

BEYOND = 3.0  # standard deviations


class ChangedError(InputError):
    """Between reading and writing a study somebody else has written it."""


def change(folder: str | Path, what: Callable[[Study], object]) -> tuple[Study, object]:
    """
    Load a study, do something to it, rewrite all of its files; return it and what came back.

    Raise ChangedError where somebody else has changed it meanwhile: nothing is written then.

    """
    seen = store.fingerprint(folder)
    study = store.load(folder)
    if study.source.get('sheet'):
        raise InputError(f'{folder}: a data sheet, no measurement', 'analyse a record of the unit')
    result = what(study)
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


def compare_two(first: Study, second: Study) -> list[dict]:
    """
    Return what differs between two studies of one domain, target by target.

    Motor off and on, say, or cold and warm.

    Every parameter that both models hold is compared by value and interval; for noise, the spectra
    too, in a few bands.

    Raises
    ------
    InputError
        The studies have no target in common.

    """
    targets = [t for t in first.targets if t in second.targets]
    if first.domain != second.domain or not targets:
        raise InputError(
            'the two studies have no axis in common', 'compare two studies of the same kind'
        )
    out = []
    for t in targets:
        a, b = first.states[t], second.states[t]
        for label in a.model.labels:
            for name, x in a.fit.estimates.get(label, {}).items():
                y = b.fit.estimates.get(label, {}).get(name)
                of = a.model[label].parameter(name)
                if y is not None and not _unused(of, x, y):
                    out.append(_of_estimates(t, f'{label}.{name}', of, x, y))
        for label in set(a.model.labels) ^ set(b.model.labels):
            out.append(
                {
                    'target': t,
                    'what': label,
                    'first': 'in the model' if label in a.model else '-',
                    'second': 'in the model' if label in b.model else '-',
                    'sigmas': '',
                    'verdict': 'only in one model',
                }
            )
        for what, x, y, sigmas in a.problem.differences(b.problem):
            out.append({'target': t, 'what': what, 'first': x, 'second': y,
                        'sigmas': f'{sigmas:+.1f}', 'verdict': _changed(sigmas)})
    return out


def _unused(of, x, y) -> bool:
    """Tell whether a parameter says in both that this form of its effect is not there."""
    return (x.value == y.value == 0 and not (x.std or y.std)
            and not (of.amplitude or of.choices))


def _of_estimates(target, what, parameter, x, y):
    if parameter.choices:
        names = [str(parameter.written(e.value)) for e in (x, y)]
        return {'target': target, 'what': what, 'first': names[0], 'second': names[1],
                'sigmas': '', 'verdict': 'the same' if names[0] == names[1] else 'changed'}
    row = {
        'target': target,
        'what': what,
        'first': _shown(x),
        'second': _shown(y),
        'sigmas': '',
        'verdict': 'not to be told',
    }
    if x.value is not None and y.value is not None and x.std and y.std:
        sigmas = (y.value - x.value) / float(np.hypot(x.std, y.std))
        row.update(
            sigmas=f'{sigmas:+.1f}', verdict=_changed(sigmas)
        )
    elif (x.value is None) != (y.value is None):
        seen, hidden = (x, y) if x.value is not None else (y, x)
        if seen.ci95 and hidden.upper95 is not None:
            row['verdict'] = 'changed' if seen.ci95[0] > hidden.upper95 else 'the same'
    return row


def _changed(sigmas: float) -> str:
    return 'changed' if abs(sigmas) > BEYOND else 'the same'


def _shown(e):
    return (
        f'{e.value:.4g} +- {e.std:.2g}'
        if e.value is not None and e.std
        else f'{e.value:.4g}'
        if e.value is not None
        else f'< {e.upper95:.3g}'
        if e.upper95 is not None
        else '?'
    )
