# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Whether a record is fit to be analysed: its health, its rest, and the part to analyse."""

from __future__ import annotations

from .examine import examine, Health, Resolution, resolution
from .prepare import in_motion, motion_doubts, MOTION_KEPT, prepare, unit_doubts
from .selection import Selection
from .stamps import evenly_stamped
from .values import SUSPECTED, suspected
from ..core.stillness import still_stretches

__all__ = ['evenly_stamped', 'examine', 'Health', 'in_motion', 'motion_doubts', 'MOTION_KEPT',
           'prepare', 'Resolution', 'resolution', 'Selection', 'still_stretches',
           'SUSPECTED', 'suspected', 'unit_doubts']
