# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A study in words: text for a terminal, and one self-contained HTML page."""

from .page import html, overview
from .pictures import pictures
from .terminal import text
from ..plots.style import stacked

__all__ = ['html', 'overview', 'pictures', 'stacked', 'text']
