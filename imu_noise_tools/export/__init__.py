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

"""
A study's numbers in the files that other programs read.

One module a consumer, found by its name.

"""

from __future__ import annotations

import importlib
import pkgutil

from ..errors import UsageError


def formats() -> list[str]:
    """Return the names of the formats."""
    return sorted(m.name for m in pkgutil.iter_modules(__path__) if not m.name.startswith('_'))


def export(study, name: str, **options) -> str:
    """
    Return the text of one format.

    Raises
    ------
    UsageError
        An unknown format, or an option that it cannot hold.

    """
    if name not in formats():
        raise UsageError(f'there is no format {name}', f'known are {", ".join(formats())}')
    return importlib.import_module(f'{__name__}.{name}').text(study, **options)
