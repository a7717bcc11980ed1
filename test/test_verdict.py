# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The words of verdicts: one meaning each, wherever they are printed."""

from __future__ import annotations

import numpy as np
import pytest

from imu_noise_tools.loop import findings, verdict
from imu_noise_tools.loop.effect import Finding, Score, View
from imu_noise_tools.loop.prediction import fall_in_words
from imu_noise_tools.report import words


def score(*excess, std=0.1):
    """Return a score whose views have these excesses."""
    return Score.of([View(str(i), np.zeros(50), np.zeros(50), x, std)
                     for i, x in enumerate(excess)])


@pytest.mark.parametrize('before, after', [(0.0123, 0.0307), (0.161, 0.420), (0.5, 0.9)])
@pytest.mark.parametrize('fall', [7.0, 50.0, 1e4])
def test_an_error_that_rises_never_falls(before, after, fall):
    """However much the deviance falls in the views in which the change is judged."""
    for chance in (True, False):
        assert 'falls' not in verdict.change(before, after, fall, chance)
    assert 'falls' not in fall_in_words(score(before), score(after), fall)


@pytest.mark.parametrize('before, after, fall, chance, said', [
    (0.5, 0.1, 50.0, True, 'falls to chance'), (0.5, 0.4, 50.0, False, 'falls'),
    (0.5, 0.49, 3.0, False, 'does not fall'), (0.5, 0.51, -3.0, False, 'does not fall'),
    (0.5, 0.9, -50.0, False, 'rises'),
    (0.01, 0.02, 20.0, True, 'within chance, predicts better'),
    (0.01, 0.02, -7.0, True, 'does not fall'),
    (0.5, 0.4, float('nan'), False, 'not to be compared')])
def test_what_an_error_did(before, after, fall, chance, said):
    assert verdict.change(before, after, fall, chance) == said


@pytest.mark.parametrize('fall, said', [
    (5.0, 'does not fall'), (12.0, 'falls no more than by chance'), (30.0, 'falls')])
def test_an_error_falls_where_it_does_so_by_more_than_chance(fall, said):
    """Chance does more where the data that were not fitted chose the place of what is fitted."""
    assert verdict.change(0.5, 0.45, fall, False, 25.0) == said
    assert (said in verdict.NO_BETTER) == (fall < 25)


def test_what_fails_is_not_within_chance():
    """Four views, one of which fails by far: their mean is within chance, the model is not."""
    some = score(0.55, -0.15, -0.15, -0.15)
    assert some.excess <= 2 * some.std and some.failing == ['0']
    assert not some.within_chance and some.side == 'beyond chance'
    said = words.error_in_words(some)
    assert 'in the mean' in said and 'beyond chance: 1 of 4 views fail' in said
    assert [v.name for v in words.failing(some)] == ['0']


def test_within_chance_is_two_standard_deviations_where_nothing_fails():
    assert score(0.19).within_chance and score(0.19).side == 'within chance'
    assert score(0.23).side == 'at the edge of chance' and not score(0.23).within_chance
    assert score(0.6).side == 'beyond chance'


def test_what_is_beyond_chance_fails_for_the_diagnosis_too():
    """What `analyse` calls beyond chance, `diagnose` does not call complete."""
    for some in (score(0.6), score(0.55, -0.15, -0.15, -0.15), score(0.25, 0.25, 0.25, 0.25)):
        assert some.side == 'beyond chance'
        assert findings.beyond_chance(some)
    assert findings.beyond_chance(score(0.23)) == []


@pytest.mark.parametrize('found, rivals, failed, said', [
    (1, 0, 0, 'missing'), (1, 2, 3, 'missing'), (0, 1, 0, 'undecidable'),
    (0, 0, 1, 'unknown'), (0, 0, 0, 'complete')])
def test_the_word(found, rivals, failed, said):
    assert verdict.word(found, rivals, failed) == said


def test_sufficient_is_five_per_cent():
    assert verdict.sufficient(1.049) and verdict.sufficient(1 / 1.049)
    assert not verdict.sufficient(1.051) and not verdict.sufficient(1 / 1.06)


def test_of_nested_names_with_equal_gain_the_simpler_is_sure():
    simple, shaped = Finding('a', 30.0, penalty=7.0), Finding('b', 30.0, penalty=7.0, shapes=1)
    odds = np.exp([findings.surplus(simple), findings.surplus(shaped)])
    assert odds[0] / odds.sum() >= verdict.SURE
