# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Gram matrices of signals that are loud, silent, or the same."""

from __future__ import annotations

import numpy as np
import pytest

from imu_noise_tools.core.linear import inverse, inverse_of


@pytest.mark.parametrize('seed', range(5))
def test_signals_of_any_loudness_are_told_apart(seed):
    rng = np.random.default_rng(seed)
    x = rng.standard_normal((50, 4)) * 10.0 ** rng.uniform(-120, 20, 4)
    found = inverse(x.T @ x)
    scale = np.sqrt(np.diag(found))
    unit = found / np.outer(scale, scale)
    wanted = np.linalg.inv((x / np.linalg.norm(x, axis=0)).T @ (x / np.linalg.norm(x, axis=0)))
    wanted /= np.sqrt(np.outer(np.diag(wanted), np.diag(wanted)))
    assert unit == pytest.approx(wanted, abs=1e-9)


@pytest.mark.parametrize('silent', [0.0, 1e-313, 7e-311, 1e-300])
def test_of_a_silent_signal_nothing_is_said(silent):
    """Far behind a filter what is left of a channel is less than the least number with digits."""
    x = np.random.default_rng(1).standard_normal((50, 3))
    gram = np.zeros((5, 5))
    gram[:3, :3] = x.T @ x
    gram[3:, 3:] = silent * np.array([[1.0, 0.1], [0.1, 1.0]])
    found = inverse(gram)
    assert np.all(np.isfinite(found)) and not np.any(found[3:])
    assert found[:3, :3] == pytest.approx(np.linalg.inv(x.T @ x))


def test_what_says_the_same_twice_is_fitted_once():
    x = np.random.default_rng(2).standard_normal((50, 2))
    y = x @ [1.0, -2.0]
    twice = np.column_stack([x, x[:, 0]])
    assert twice @ (inverse_of(twice) @ y) == pytest.approx(y)
