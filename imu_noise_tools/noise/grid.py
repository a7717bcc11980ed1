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

"""The grid that samples stand on, and the size of their fast noise."""

from __future__ import annotations

import numpy as np


def robust_sigma(y) -> float:
    """
    Return the standard deviation of the fast part of y.

    It is that of neighbouring differences, over sqrt(2).

    """
    return float(np.std(np.diff(y))) / np.sqrt(2)


def grid_step(y, most: int = 4096) -> tuple[float, int]:
    """
    Return (step, levels): the spacing of the grid that all of y lies on, 0 where there is none.

    Levels that differ by less than a millionth of their spread are one (float32 storage).

    """
    some = y[:200_000]
    levels = np.unique(some)
    spread = levels[-1] - levels[0] if len(levels) else 0.0
    if not spread > 0:
        return 0.0, len(levels)
    levels = levels[
        np.concatenate([[True], np.diff(levels) > 1e-6 * spread + 4e-7 * np.max(np.abs(levels))])
    ]
    if not 2 <= len(levels) <= min(most, len(some) // 4):
        return 0.0, len(levels)
    gaps = np.diff(levels)
    step = float(np.min(gaps))
    multiples = gaps / step
    step = float(np.sum(gaps) / np.sum(np.round(multiples)))
    on_grid = np.abs(gaps / step - np.round(gaps / step))
    return (step, len(levels)) if np.max(on_grid) < 0.05 else (0.0, len(levels))


def grid_gain(n: int, step: float, sigma: float) -> float:
    """
    Return what a grid says in nats: each sample on it is likelier than under a density.

    By about half the squared ratio of step to noise a sample, and nothing where the step is below
    half a standard deviation: finer grids are part of the white noise.

    """
    if not step >= 0.5 * sigma or not step > 0:
        return 0.0
    return 0.5 * n * min(1.0, (step / max(sigma, step / 12)) ** 2)
