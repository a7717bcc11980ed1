# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Write a simulated record as a bag, and its truth beside it."""

from __future__ import annotations

from pathlib import Path

from .. import store
from ..bag import write_bag
from ..core import files
from ..simulate import simulate as simulate_record


def simulate(spec, out, force: bool = False) -> dict:
    """
    Simulate a specification (a mapping, or the path of a YAML file) into a bag; return the truth.

    ``truth.yaml`` is written beside the bag (in its folder's parent).

    """
    if not isinstance(spec, dict):
        spec = store.load_yaml(spec)
    record, truth = simulate_record(spec)
    out = Path(out)
    with files.atomic_path(out.parent / 'truth.yaml') as temporary:
        temporary.write_text(store.dump_yaml(truth))
        write_bag(out, record, force=force)
    return truth
