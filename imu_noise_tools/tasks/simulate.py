# Copyright 2026 imu_noise_tools maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

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
    with files.atomic_path(out.parent / 'truth.yaml') as temporary:
        temporary.write_text(store.dump_yaml(truth))
        write_bag(out, record, force=force)
    return truth
