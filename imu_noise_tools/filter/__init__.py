# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Denoising a rate, live or recorded.

Motion that drives it, noise that adds to it, a Kalman filter between.

Units are SI (rad/s); one axis at a time, since the three see each other only through the motion.

"""
