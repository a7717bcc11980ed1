# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Gram matrices of signals that are loud, silent, or the same."""

from __future__ import annotations

import numpy as np
import pytest

from imu_noise_tools.core.linear import inverse, inverse_of, least_squares


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


@pytest.mark.parametrize('apart', [1.0, 1e-2, 1e-5])
def test_least_squares_of_columns_near_each_other_and_one_that_is_nothing(apart):
    """By the Gram matrix or by a factorisation of the columns: beyond a thousandth it loses."""
    rng = np.random.default_rng(3)
    x = rng.standard_normal((200, 3)) * [1e-9, 1.0, 1e6]
    x[:, 2] = 1e6 * (x[:, 1] + apart * x[:, 2] / 1e6)
    x, y = np.insert(x, 1, 0.0, axis=1), rng.standard_normal(200)
    found = least_squares(x, y)
    beta, covariance = found.beta, found.covariance
    some = [0, 2, 3]
    q, r = np.linalg.qr(x[:, some])
    assert beta[some] == pytest.approx(np.linalg.solve(r, q.T @ y), rel=1e-8) and beta[1] == 0
    wanted = np.linalg.inv(r) @ np.linalg.inv(r).T
    assert covariance[np.ix_(some, some)] == pytest.approx(wanted, rel=1e-8)
    assert not np.any(covariance[1]) and not np.any(covariance[:, 1])
    assert found.left == pytest.approx(y - x @ beta, abs=1e-8)
    assert found.leverage == pytest.approx(np.sum(q**2, axis=1), rel=1e-8)
    assert found.log_det == pytest.approx(2 * np.sum(np.log(np.abs(np.diag(r)))))


def test_how_what_is_left_turns_with_what_the_columns_depend_on():
    """Two decays and a swing beside white noise: the differences of what is minimised."""
    t, rng = np.linspace(0, 1, 300), np.random.default_rng(7)
    at = np.array([0.2, 1.0, 9.0])

    def columns(a, b, f):
        return np.stack([np.exp(-t / a), np.exp(-t / b), np.cos(f * t), np.sin(f * t)], 1)

    y = columns(0.21, 1.1, 9.2) @ [20.0, -9.0, 3.0, 9.0] + rng.standard_normal(300)

    def half(p):
        return 0.5 * np.sum(least_squares(columns(*p), y).left ** 2)

    def cost(p):
        return half(p) + 0.5 * least_squares(columns(*p), y).log_det

    steps = 1e-4 * np.eye(3)
    some = [[columns(*(at + e)), columns(*at), columns(*(at - e))] for e in steps]
    change = np.array([(up - down) / 2e-4 for up, _, down in some])
    bend = np.array([(up - 2 * here + down) / 1e-8 for up, here, down in some])
    told, least = least_squares(columns(*at), y).turned(change, bend)
    wanted = np.array([(cost(at + e) - cost(at - e)) / 2e-4 for e in steps])
    assert told == pytest.approx(wanted, rel=1e-4)
    square = np.array([[(half(at + d + e) - half(at + d - e) - half(at - d + e) + half(at - d - e))
                        / 4e-8 for d in steps] for e in steps])
    assert np.all(np.linalg.eigvalsh(square) > 0)
    assert least == pytest.approx(square, rel=1e-3, abs=1e-3 * np.max(square))


def test_where_what_is_left_curves_the_other_way_the_curvature_is_that_of_a_minimum():
    t = np.linspace(0, 1, 300)
    y = np.exp(-t / 0.1)
    at, h = 3.0, 1e-3       # the way down from there bends down
    up, here, down = (np.exp(-t / (at + e))[:, None] for e in (h, 0.0, -h))
    found = least_squares(here, y)
    _, curved = found.turned(((up - down) / (2 * h))[None], ((up - 2 * here + down) / h**2)[None])

    def half(a):
        return 0.5 * np.sum(least_squares(np.exp(-t / a)[:, None], y).left ** 2)

    assert half(at + h) + half(at - h) < 2 * half(at)
    assert curved.item() > 0
