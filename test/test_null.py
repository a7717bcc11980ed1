# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The table of what chance gains: of every effect, and as new as the code."""

from __future__ import annotations

import json
from pathlib import Path
import sys

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'bench'))

import null as bench  # noqa: E402,I100

from imu_noise_tools.loop.effect import registry  # noqa: E402
from imu_noise_tools.noise import null  # noqa: E402
from imu_noise_tools.noise.kinds import Line  # noqa: E402


def test_the_table_is_as_new_as_the_code():
    assert null.SOURCES == bench.source_hash(), 'run: python bench/null.py --carry'


@pytest.mark.thorough
@pytest.mark.parametrize('row', bench.SAMPLED.read_text().splitlines()[::2])
def test_what_gains_by_chance_gains_what_it_did(row):
    """The hash of the code may be carried on only where this holds."""
    old = json.loads(row)
    assert bench.moved(old, bench.one(old['seed'])) == []


def test_a_gain_that_moves_is_told():
    old = {'seed': 3, 'gains': [{'step': 2.0, 'rts': 1.0}, {}]}
    assert bench.moved(old, {'seed': 3, 'gains': [{'step': 2.3}, {'rts': -4.0}]}) == [
        'rts: 1.00, now 0.00 (record 3, axis 0)']


def test_no_effect_of_the_package_falls_back_on_the_default():
    for name, cls in registry('noise').items():
        if cls.__module__.startswith('imu_noise_tools.') and not issubclass(cls, Line):
            assert name in null.PENALTY, name


@pytest.mark.parametrize('scale', [0.5, 1.0, 3.0])
def test_the_threshold_is_what_one_in_a_thousand_exceeds(scale):
    """Of an exponential, whose thousandth is known: scale ln 1000."""
    rng = np.random.default_rng(1)
    found = [bench.threshold(rng.exponential(scale, 360), 360) for _ in range(40)]
    assert np.mean(found) == pytest.approx(max(scale * np.log(1000), bench.LEAST), rel=0.05)
