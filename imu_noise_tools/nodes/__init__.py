# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The four ROS 2 nodes: thin shells over the functions that the command line calls."""

from ..core.interrupt import loading

loading('bag_reader', 'analyser', 'calibration', 'filter')
