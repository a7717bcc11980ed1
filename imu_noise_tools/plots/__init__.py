# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pictures: functions that take an Axes or make a Figure; the only importer of matplotlib."""
