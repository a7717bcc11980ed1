# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The loop over any problem: effects and models, held-out deviance, diagnosis, study."""
