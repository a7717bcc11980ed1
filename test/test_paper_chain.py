# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The chain of Qian et al. 2010 for a record at rest, which bench/paper.py prints."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

import paper_chain as ar


def test_chain_of_the_paper():
    rng = np.random.default_rng(5)
    z = lfilter([1], [1, -0.107], rng.standard_normal(20000))
    z[[100, 5000, 12345]] += 15
    got = ar.chain(z)
    assert got.outliers in range(3, 9) and abs(got.phi - 0.107) < 0.022 and got.order >= 1
    assert abs(got.u_square) < 3 and abs(got.autocorrelation) < 0.02 and got.p_white > 1e-3
    text = '\n'.join(got.lines())
    for word in ('outliers', 'reverse arrangements', 'AIC', 'Yule-Walker', 'Ljung-Box'):
        assert word in text


def test_reverse_arrangements_count_pairs():
    values = np.random.default_rng(6).standard_normal(30)
    pairs = sum(values[i] > values[j] for i in range(30) for j in range(i + 1, 30))
    assert ar.reverse_arrangements(values) == pytest.approx(
        (pairs - 30 * 29 / 4) / np.sqrt(30 * 65 * 29 / 72)
    )
    assert (
        ar.reverse_arrangements(np.arange(30.0))
        < -1.96
        < 1.96
        < ar.reverse_arrangements(-np.arange(30.0))
    )
    many = [
        ar.reverse_arrangements(np.random.default_rng(s).standard_normal(100)) for s in range(300)
    ]
    assert abs(np.mean(many)) < 0.2 and np.std(many) == pytest.approx(1, abs=0.15)


def test_yule_walker_uses_the_biased_autocovariance():
    z = np.random.default_rng(7).standard_normal(500)
    d = z - z.mean()
    c = [d[:500 - k] @ d[k:] / 500 for k in range(3)]
    a, variance = ar.yule_walker(z, 2)
    assert np.allclose(np.array([[c[0], c[1]], [c[1], c[0]]]) @ a, c[1:])
    assert variance == pytest.approx(c[0] - a @ np.array(c[1:]))
