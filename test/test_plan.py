# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""How long to record: from the interval of a coefficient, not from its likeliest value."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest

import hidden
from imu_noise_tools.cli.main import main
from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.loop.effect import Estimate, find_effect, Model
from imu_noise_tools.noise.plan import duration_for, durations_for, FAINT, range_in_words
from imu_noise_tools.store import FORMAT, study_files
from imu_noise_tools.tasks.noise import analyse_record

N, B = 8.7e-5, 2.4e-5
LABELS = {'N': 'white', 'B': 'flicker', 'K': 'random_walk'}


def model(**values):
    """Return a model with values."""
    return Model(find_effect('noise', LABELS[k])({k: v}) for k, v in values.items())


def limit(upper, point):
    """Return the estimate of what is not resolved."""
    return Estimate(None, None, (0.0, upper), upper95=upper, point=point)


def test_the_range_spans_the_interval_whatever_the_point_is():
    """A point that is wrong by far changes nothing."""
    known = {'white': {'N': Estimate(N, 1e-8, (N, N))},
             'flicker': {'B': Estimate(B, 1e-7, (B, B))}}
    said = []
    for point in (0.0, 3e-8, 9e-7):
        found = {**known, 'random_walk': {'K': limit(1e-6, point)}}
        said.append(durations_for(model(N=N, B=B, K=max(point, 1e-9)), found, 'random_walk', 'K',
                                  0.2))
    assert said[0] == said[1] == said[2]
    least, most = said[0]
    assert least == duration_for(model(N=N, B=B, K=1e-6), 'random_walk', 'K', 0.2)
    assert most == duration_for(model(N=N, B=B, K=FAINT * 1e-6), 'random_walk', 'K', 0.2)
    assert most > 4 * least


def test_what_else_is_not_resolved_counts_at_both_its_ends():
    """Flicker noise that may be there makes the longest longer, and not the shortest."""
    white = {'white': {'N': Estimate(N, 1e-8, (N, N))}, 'random_walk': {'K': limit(1e-6, 1e-6)}}
    without = durations_for(model(N=N, K=1e-6), white, 'random_walk', 'K', 0.2)
    beside = durations_for(model(N=N, B=1e-9, K=1e-6), {**white, 'flicker': {'B': limit(B, 0.0)}},
                           'random_walk', 'K', 0.2)
    assert beside[1] > 1.5 * without[1]
    assert without[0] <= beside[0] < beside[1]


def test_of_what_is_resolved_the_ends_are_those_of_its_interval():
    found = {'white': {'N': Estimate(N, 1e-8, (N, N))},
             'random_walk': {'K': Estimate(1e-6, 2e-7, (7e-7, 1.4e-6))}}
    least, most = durations_for(model(N=N, K=1e-6), found, 'random_walk', 'K', 0.2)
    assert least == duration_for(model(N=N, K=1.4e-6), 'random_walk', 'K', 0.2)
    assert most == duration_for(model(N=N, K=7e-7), 'random_walk', 'K', 0.2)


@pytest.mark.parametrize('least, most, said', [
    (None, None, 'more than 1000 h'), (7200.0, None, '2 h or far more'),
    (7200.0, 7201.0, '2 h'), (3600.0, 82800.0, '60 min to 23 h'), (0.4, 25.2, '1 s to 25 s')])
def test_ranges_in_words(least, most, said):
    assert range_in_words(least, most) == said


@pytest.mark.parametrize('domain', ['calibration', 'filter'])
def test_only_noise_is_planned(domain, tmp_path, capsys):
    """A study of another kind is named as one; it is no defect."""
    (tmp_path / 'study.yaml').write_text(
        f'format: {FORMAT}\ndomain: {domain}\nsource: {{}}\ntargets: {{}}\nhistory: []\n'
        'diagnosis: {}\n')
    assert main(['plan', str(tmp_path)]) == 1
    said = capsys.readouterr().err
    assert f'a {domain} study; only noise' in said and 'defect' not in said


def test_no_plan_for_what_is_there_already():
    assert range_in_words(3600.0, 82800.0, 3600.0) == 'longer, up to 23 h'
    assert range_in_words(3600.0, None, 3600.0) == 'far longer'
    assert range_in_words(7200.0, 82800.0, 3600.0) == '2 h to 23 h'


@pytest.mark.thorough
def test_records_of_a_walk_that_needs_23_h_are_told_so(tmp_path):
    """Of twelve axes of an hour, most ranges reach 23 h; the command prints them."""
    k, rng = 5.77e-7, np.random.default_rng(8)
    truth = duration_for(model(N=N, B=B, K=k), 'random_walk', 'K', 0.2)
    assert 20 < truth / 3600 < 26, truth / 3600
    n, rate, found = 18000, 5.0, []
    for _ in range(4):
        x = np.column_stack([hidden.base_noise(n, 1 / rate, {'N': N, 'B': B, 'K': k}, rng)
                             for _ in range(3)])
        study = analyse_record(ImuRecord(x, None, np.arange(n) / rate, rate, path='x.npz'))
        for state in study.states.values():
            e = state.fit.estimates
            found.append(durations_for(state.model, e, 'random_walk', 'K', 1 / rate, begin=3600))
            if e['random_walk']['K'].value is None:
                assert ' to ' in e['random_walk']['K'].note, e['random_walk']['K'].note
    # nine of ten by design; eight of twelve are what chance leaves of that
    assert sum(most is None or most >= truth for _, most in found) >= 8, found
    folder = tmp_path / 'x.study'
    folder.mkdir()
    for name, data in study_files(study).items():
        (folder / name).write_bytes(data if isinstance(data, bytes) else data.encode())
    done = subprocess.run([sys.executable, '-m', 'imu_noise_tools.cli.main', 'plan', str(folder),
                           '--json'], capture_output=True, text=True, timeout=300)
    rows = json.loads(done.stdout)['plan']
    assert len(rows) == 9 and all(r['seconds_at_least'] <= (r['seconds'] or np.inf)
                                  for r in rows if r['seconds_at_least'])
    shown = subprocess.run([sys.executable, '-m', 'imu_noise_tools.cli.main', 'plan', str(folder)],
                           capture_output=True, text=True, timeout=300)
    assert shown.returncode == 0 and 'below' in shown.stdout and ' to ' in shown.stdout
