# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A data sheet as a study, and whether a unit meets its sheet."""

from __future__ import annotations

from pathlib import Path
import sys

from .. import export, store
from ..core import files, units
from ..core.errors import InputError, unknown
from ..loop.study import Study
from ..sheet import read, Sheet

MEETS, MISSES, OPEN = 'meets', 'does not meet', 'cannot tell'


def known() -> dict[str, Path]:
    """Return the sheets that come with the package, by name."""
    here = Path(__file__).resolve()
    package = here.parents[1]
    # in a checkout, else above lib/pythonX.Y/site-packages; a checkout may lie near the root
    for folder in (package.parent / 'config', *(p / 'share' / package.name / 'config'
                                                for p in (*here.parents[5:6], Path(sys.prefix)))):
        found = sorted((folder / 'sheets').glob('*.yaml'))
        if found:
            return {p.stem: p for p in found}
    return {}


def load(path: str | Path) -> Sheet:
    """
    Return the sheet of a YAML file, or by the name of one that comes with the package.

    Raises
    ------
    InputError
        There is none, or it is no sheet.

    """
    path = Path(path)
    if not path.exists() and path.parent == Path():
        sheets = known()
        if str(path) not in sheets:
            error = unknown('sheet', str(path), sheets)
            raise InputError(f'{path}: no such file', error.remedy)
        path = sheets[str(path)]
    return read(store.load_yaml(path, 'imu_noise sheet --help shows one'), str(path))


def sheet(path: str | Path, out: str | Path, force: bool = False) -> tuple[Study, Path]:
    """
    Write a sheet as a study: study.yaml, evidence.npz, imu.yaml where the sheet gives a walk.

    Raises
    ------
    InputError
        The sheet cannot be read, or a study is in the way and ``force`` is not given.

    """
    study = load(path).study(str(path))
    content = outputs(study)
    with files.new_folder(Path(out), force=force) as new:
        for name, data in content.items():
            files.atomic_write(Path(new) / name, data)
    return study, Path(out)


def outputs(study: Study) -> dict[str, str | bytes]:
    """Return the files of a sheet's study by name; without imu.yaml a note says why."""
    content: dict[str, str | bytes] = {}
    try:
        content['imu.yaml'] = export.export(study, 'kalibr')
    except InputError as error:
        note = f'no imu.yaml: {error.message}'
        study.source['notes'] = list(dict.fromkeys([*study.source['notes'], note]))
    return {**store.study_files(study), **content}


def against(study: Study, path: str | Path) -> list[dict]:
    """
    Return one row a coefficient that both give: measured, stated, and whether the axis meets it.

    It meets where its whole interval (or its limit) is not above the stated value, and does not
    where its whole interval is.

    """
    stated = load(path).values
    rows = []
    for axis in study.targets:
        for (label, name), value in stated.get(axis, {}).items():
            e = study.states[axis].fit.estimates.get(label, {}).get(name)
            if e is None:
                continue
            low, high = e.ci95 if e.ci95 else (e.value or 0.0, e.value or e.upper95 or 0.0)
            if e.value is None:
                low, high = 0.0, e.upper95 or high
            verdict = MEETS if high <= value else MISSES if low > value else OPEN
            unit = study.states[axis].model[label].parameter(name).unit
            sensor = axis.partition('_')[0]
            ratio = (e.value if e.value is not None else high) / value
            rows.append({
                'target': axis, 'parameter': name, 'measured': e.value, 'ci95': [low, high],
                'sheet': value, 'ratio': ratio, 'verdict': verdict,
                'measured_shown': units.shown(e.value, unit, sensor) if e.value is not None
                else f'below {units.shown(high, unit, sensor)}',
                'interval_shown': f'{units.shown(low, unit, sensor)} to '
                                  f'{units.shown(high, unit, sensor)}',
                'sheet_shown': units.shown(value, unit, sensor),
                'si': f'{high if e.value is None else e.value:.4g}, sheet {value:.4g} {e.unit}'})
    if not rows:
        raise InputError(f'{path}: nothing in it that the study has as well',
                         f'the study has {", ".join(study.targets)}')
    return rows
