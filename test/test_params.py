# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which tests run when."""

from __future__ import annotations

from params import in_share


def test_shares_are_parts_of_much_the_same_size_and_together_all():
    tests = [f'test/test_noise_loop.py::test_nothing_hidden_is_complete[{k}]' for k in range(400)]
    parts = [{t for t in tests if in_share(t, f'{k}/4')} for k in range(4)]
    assert sum(map(len, parts)) == len(set().union(*parts)) == 400
    assert all(70 < len(part) < 130 for part in parts)
    assert {t for t in tests if in_share(t, '6/4')} == parts[2]
