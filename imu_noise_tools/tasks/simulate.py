# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Write a simulated record as a bag, and its truth beside it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
import re
from typing import Any

from .. import store
from ..bag import write_bag
from ..bag.writing import SUFFIX
from ..core import files
from ..core.errors import ImuNoiseError, UsageError
from ..simulate import simulate as simulate_record

Progress = Callable[[float | None, str], None]


def simulate(spec: Any, out: str | Path, force: bool = False,
             progress: Progress | None = None) -> dict:
    """
    Simulate a specification (a mapping, or the path of a YAML file) into a bag; return the truth.

    ``truth.yaml`` is written beside the bag (in its folder's parent); where that of another record
    is there already, as ``<bag>.truth.yaml``. ``bag`` in it names the record that it is of.

    Raises
    ------
    InputError
        The specification cannot be used, or something is in the way.
    UsageError
        The name ends as a file does that cannot be written.

    """
    ending = Path(out).suffix.lower()
    if re.search('[a-z].*[a-z]', ending) and ending not in SUFFIX:      # my_robot.v2 is a folder
        raise UsageError(f'{out}: cannot be written as {ending}',
                         f'choose from {", ".join(SUFFIX)}, or a folder: a name without an ending')
    if not isinstance(spec, dict):
        spec = store.load_yaml(spec, 'imu_noise simulate --help shows one')
    drawing = (lambda p, what: progress(0.5 * p, what)) if progress else None
    writing = (lambda p: progress(0.5 + 0.5 * p, 'writing')) if progress else None
    record, truth = simulate_record(spec, drawing)
    out = Path(out)
    truth = {'bag': out.name, **truth}
    with files.atomic_path(truth_of(out)) as temporary:
        temporary.write_text(store.dump_yaml(truth))
        write_bag(out, record, force=force, progress=writing)
    return truth


def truth_of(out: Path) -> Path:
    """Return where the truth of a record goes: not where that of another one is."""
    path = out.parent / 'truth.yaml'
    if not path.is_file():
        return path
    try:
        there = store.load_yaml(path)
    except ImuNoiseError:
        there = None
    mine = isinstance(there, dict) and there.get('bag') == out.name
    return path if mine else out.parent / f'{out.name}.truth.yaml'
