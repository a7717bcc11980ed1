"""Write a simulated record as a bag, and its truth beside it."""

from __future__ import annotations

from pathlib import Path

from .. import files, store
from ..bag import write_bag
from ..simulate import simulate as simulate_record


def simulate(spec, out, force: bool = False) -> dict:
    """
    Simulate a specification (a mapping, or the path of a YAML file) into a bag; return the truth.

    ``truth.yaml`` is written beside the bag (in its folder's parent).

    """
    import imu_noise_tools.noise  # noqa: F401  (registers the effects)

    if not isinstance(spec, dict):
        spec = store.load_yaml(spec)
    record, truth = simulate_record(spec)
    out = Path(out)
    write_bag(out, record, force=force)
    files.atomic_write(out.parent / 'truth.yaml', store.dump_yaml(truth))
    return truth
