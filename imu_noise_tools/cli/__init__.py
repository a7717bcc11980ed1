# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The command line: parsing, progress and printing; all else is in tasks."""

from ..core.interrupt import loading

loading('imu_noise')
